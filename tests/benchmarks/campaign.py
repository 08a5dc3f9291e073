"""Measure the time of campaigns: the engine compared with the compiled loop, and inventories with
their store.

    python tests/benchmarks/campaign.py                  # 440 runs of ten yielding stories, 22 motions x 20 scales
    # two-story buildings of an inventory under a pair of ground motions
    python tests/benchmarks/campaign.py --buildings 2000
    # one part of an inventory under fields of 100 events
    python tests/benchmarks/campaign.py --buildings 1000000 --parts 1000

Wall times are meaningful only on an idle machine; processor times also on a busy machine.
"""  # noqa: E501

import argparse
import os
import random
import subprocess
import time
from concurrent.futures import ThreadPoolExecutor
from multiprocessing import get_context
from pathlib import Path
from resource import RUSAGE_SELF, getrusage
from tempfile import TemporaryDirectory

import numpy as np
from common import turned

import tdint
from tdint.analysis.run.batch import Subject
from tdint.analysis.run.case import Case
from tdint.campaign.batch import RunSettings
from tdint.campaign.buildings import model_buildings
from tdint.campaign.execute import Shard, compile_for, execute_plan, threads
from tdint.campaign.inputs import read_inputs
from tdint.campaign.motions import EveryMotion, Scales
from tdint.campaign.plan import Plan, make_plan
from tdint.campaign.reader import load_campaign
from tdint.campaign.store import open_store
from tdint.ground_motion.reading.suites import suite_motions

SCALES = tuple(np.linspace(0.1, 2.0, 20).tolist())
SHELL_LOOP = 0.56  # s for a call of `tdint run` of version 0.1 on a quiet machine


def study(method: str) -> None:
    subject = Subject(tdint.load_model("configs/ten-story-bilinear.yaml"), method)
    records = turned(22)
    plan = Plan(
        "study",
        model_buildings([subject]),
        suite_motions(records),
        EveryMotion(len(records)),
        Scales(SCALES),
        RunSettings(dt=0.01),
    )
    compile_for(plan)
    cases = [
        Case(subject.model, subject.prepared, record.scaled(scale), subject.integrator)
        for record in records
        for scale in SCALES
    ]

    def kernel(part: list[Case]) -> float:
        marched = (
            case.prepared.integrate(case.method, case.steps(0.01), case.ground) for case in part
        )
        return sum(one.seconds for one in marched)

    def engine(jobs: int) -> tuple[float, float]:
        with TemporaryDirectory() as folder:
            store, _ = open_store(Path(folder), plan)
            began, used = time.perf_counter(), time.process_time()
            with store:
                execute_plan(plan, store, threads(jobs))
                spent = time.perf_counter() - began, time.process_time() - used
        return spent

    def alone() -> tuple[float, float]:
        began, used = time.perf_counter(), time.process_time()
        with ThreadPoolExecutor(2) as pool:
            list(pool.map(kernel, [cases[i::8] for i in range(8)]))
        return time.perf_counter() - began, time.process_time() - used

    print(
        f"{method}: {plan.runs} runs in {plan.chunks} chunks; least of three, wall and processor "
        "time, s"
    )
    for name, work in (("kernels, two threads", alone), ("engine, one job", lambda: engine(1)),
                       ("engine, two jobs", lambda: engine(2))):  # fmt: skip
        times = [work() for _ in range(3)]
        print(
            f"{name:<22} {min(wall for wall, _ in times):.3f} {min(used for _, used in times):.3f}"
        )
    with TemporaryDirectory() as folder:
        scales = ",".join(f"{scale:g}" for scale in SCALES)
        began = time.perf_counter()
        command = [
            "tdint",
            "-q",
            "run",
            "configs/ten-story-bilinear.yaml",
            "records/",
            "--units",
            "m/s^2",
        ]
        command += ["--scale", scales, "--method", method, "-o", folder]
        subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
        each = (time.perf_counter() - began) / (6 * len(SCALES))
    print(
        f"the command, 120 runs: {1e3 * each:.3g} ms a run, a shell loop {SHELL_LOOP / each:.0f} "
        "times that"
    )


def inventory(buildings: int, method: str) -> None:
    kinds, types = random.Random(1), ["W1", "C1", "S1", "RM1", "URM"]
    rows = ["id,NumberOfStories,YearBuilt,StructureType,PlanArea"]
    rows += [
        f"{i},2,{kinds.randint(1920, 2015)},{kinds.choice(types)},{kinds.uniform(1e3, 6e3):.1f}"
        for i in range(1, buildings + 1)
    ]
    with TemporaryDirectory() as name:
        folder = Path(name)
        (folder / "buildings.csv").write_text("\n".join(rows) + "\n")
        (folder / "campaign.yaml").write_text(
            "buildings: {inventory: buildings.csv, units: {length: ft}}\n"
            f"records: {{files: [{Path('records/near-fault.mseed').resolve()}], units: m/s^2, "
            f"pairs: true}}\n"
            f"analysis: {{method: {method}}}\n"
        )
        began = time.perf_counter()
        process = subprocess.Popen(
            ["tdint", "campaign", str(folder / "campaign.yaml"), "-o", str(folder / "out")]
        )
        _, status, usage = os.wait4(process.pid, 0)
        wall, used = time.perf_counter() - began, usage.ru_utime + usage.ru_stime
        assert status == 0
    runs = 2 * buildings
    print(
        f"{method}: {runs} runs of 3000 steps, all of the command: {wall:.3g} s, {used:.3g} s of "
        "processor time"
    )
    print(
        f"{3.6e-3 * runs / wall:.3g} M runs an hour, {7.2e-3 * runs / used:.3g} M on two "
        "processors of one's own"
    )
    print(f"largest resident memory {usage.ru_maxrss / 1024:.0f} MB")


def write_region(buildings: int, folder: Path) -> None:
    """100 events at a site for each 100 buildings, factors on two motions."""
    kinds, types, sites = random.Random(1), ["W1", "C1", "S1", "RM1", "URM"], buildings // 100
    degrees = [
        (f"{-122.5 + 0.01 * (i % 100):.4f}", f"{37.3 + 0.01 * (i // 100):.4f}")
        for i in range(sites)
    ]
    tables = {"sites": ["site,longitude,latitude"], "fields": ["event,site,record,factor"]}
    tables["buildings"] = ["id,NumberOfStories,YearBuilt,StructureType,PlanArea,Longitude,Latitude"]
    tables["sites"] += [f"s{i},{','.join(degrees[i])}" for i in range(sites)]
    motions = [Path(f"records/{name}.mseed").resolve() for name in ("soft-soil", "firm-soil")]
    for event in range(100):
        tables["fields"] += [
            f"E{event},s{i},{kinds.choice(motions)},{kinds.uniform(0.2, 1.5):.4f}"
            for i in range(sites)
        ]
    for i in range(buildings):
        about = (
            kinds.randint(1, 3),
            kinds.randint(1920, 2015),
            kinds.choice(types),
            kinds.randint(100, 900),
        )
        tables["buildings"].append(",".join(map(str, (f"b{i}", *about, *kinds.choice(degrees)))))
    for table, lines in tables.items():
        (folder / f"{table}.csv").write_text("\n".join([*lines, ""]))
    (folder / "campaign.yaml").write_text(
        "buildings: {inventory: buildings.csv, units: {length: m}}\n"
        "records: {fields: fields.csv, sites: sites.csv, units: m/s^2, component: HN1}\n"
    )


def part(buildings: int, parts: int) -> None:
    """The part in the middle: processor time and memory before its first run, with the start of
    Python, and the time of its runs."""
    with TemporaryDirectory() as name:
        # Another process writes the tables, so that the memory is that of the part.
        writer = get_context("spawn").Process(target=write_region, args=(buildings, Path(name)))
        writer.start()
        writer.join()
        shard = Shard((parts + 1) // 2, parts)
        campaign = load_campaign(Path(name) / "campaign.yaml")
        plan = make_plan(campaign, read_inputs(campaign))
        kept = plan.buildings_of(shard.chunks(plan))
        store, _ = open_store(Path(name), plan, kept)
        compile_for(plan)
        before, memory = time.process_time(), getrusage(RUSAGE_SELF).ru_maxrss / 1024
        with store:
            runs = execute_plan(plan, store, threads(1), shard=shard).done
            work = store.seconds()
    print(
        f"part {shard.text}: {len(kept)} of {buildings} buildings, {runs} of {plan.runs} runs; "
        "processor time"
    )
    print(
        f"before the first run {before:.3g} s and {memory:.0f} MB, runs {work:.4g} s: "
        f"{before / work:.1%}; at the end {getrusage(RUSAGE_SELF).ru_maxrss / 1024:.0f} MB"
    )


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--buildings", type=int)
    parser.add_argument("--parts", type=int)
    parser.add_argument("--method", default="impulse4")
    given = parser.parse_args()
    if given.parts:
        part(given.buildings, given.parts)
    elif given.buildings:
        inventory(given.buildings, given.method)
    else:
        study(given.method)
