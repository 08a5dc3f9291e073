"""Measure the time of campaigns.

    python tests/benchmarks/campaign.py
        440 runs of ten yielding stories (22 ground motions, 20 scale factors): the campaign engine
        compared with the compiled time loops
    python tests/benchmarks/campaign.py --buildings 2000
        two-story buildings of an inventory under a pair of ground motions, with their database
    python tests/benchmarks/campaign.py --buildings 1000000 --parts 1000
        one of 1000 parts of an inventory under the ground motion fields of 100 events

Run it in the root directory of the repository. Wall times are meaningful only on an idle machine;
processor times also on a busy machine.
"""

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
from common import rotated_motions

import tdint
from tdint.ground_motion.reading.suites import suite_motions
from tdint.response.runs.batch import Subject
from tdint.response.runs.case import Case
from tdint.studies.campaign.assigned_motions import EveryMotion, Scales
from tdint.studies.campaign.buildings import model_buildings
from tdint.studies.campaign.chunks import CampaignSettings
from tdint.studies.campaign.execute import Shard, compile_for, execute_plan, threads
from tdint.studies.campaign.inputs import read_inputs
from tdint.studies.campaign.plan import Plan, make_plan
from tdint.studies.campaign.reader import load_campaign
from tdint.studies.store.opening import open_store

SCALES = tuple(np.linspace(0.1, 2.0, 20).tolist())
SHELL_LOOP = 0.56  # s; one call of `tdint run` of version 0.1 on an idle machine, for comparison


def measure_engine(method: str) -> None:
    """Print the times of 440 runs by the time loops, by the campaign engine, and by `tdint run`.

    Parameters
    ----------
    method : str
        Name of the method.
    """
    subject = Subject(tdint.load_model("configs/ten-story-bilinear.yaml"), method)
    records = rotated_motions(22)
    plan = Plan(
        "study",
        model_buildings([subject]),
        suite_motions(records),
        EveryMotion(len(records)),
        Scales(SCALES),
        CampaignSettings(dt=0.01),
    )
    compile_for(plan)
    cases = [
        Case(subject.model, subject.prepared, record.scaled(scale), subject.integrator)
        for record in records
        for scale in SCALES
    ]

    def integrate_cases(part: list[Case]) -> None:
        """Integrate some cases without storing results."""
        for case in part:
            case.prepared.integrate(case.method, case.steps(0.01), case.ground)

    def time_engine(jobs: int) -> tuple[float, float]:
        """Return wall and processor time of the campaign with its database, s."""
        with TemporaryDirectory() as directory:
            store, _ = open_store(Path(directory), plan)
            wall_start, processor_start = time.perf_counter(), time.process_time()
            with store:
                execute_plan(plan, store, threads(jobs))
                times = time.perf_counter() - wall_start, time.process_time() - processor_start
        return times

    def time_loops() -> tuple[float, float]:
        """Return wall and processor time of the time loops in two threads, s."""
        wall_start, processor_start = time.perf_counter(), time.process_time()
        with ThreadPoolExecutor(2) as pool:
            # Eight parts, so that both threads finish at about the same time.
            list(pool.map(integrate_cases, [cases[i::8] for i in range(8)]))
        return time.perf_counter() - wall_start, time.process_time() - processor_start

    print(
        f"{method}: {plan.runs} runs in {plan.chunks} chunks; minimum of three wall and "
        "processor times, s"
    )
    measurements = {
        "kernels, two threads": time_loops,
        "engine, one job": lambda: time_engine(1),
        "engine, two jobs": lambda: time_engine(2),
    }
    for name, measure in measurements.items():
        times = [measure() for _ in range(3)]
        wall, processor = (min(values) for values in zip(*times, strict=True))
        print(f"{name:<22} {wall:.3f} {processor:.3f}")
    with TemporaryDirectory() as directory:
        scales = ",".join(f"{scale:g}" for scale in SCALES)
        start = time.perf_counter()
        command = [
            "tdint", "-q", "run", "configs/ten-story-bilinear.yaml", "records/", "--units",
            "m/s^2",
        ]  # fmt: skip
        command += ["--scale", scales, "--method", method, "-o", directory]
        subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
        # The records have six horizontal components.
        per_run = (time.perf_counter() - start) / (6 * len(SCALES))
    print(
        f"tdint run with 120 runs: {1e3 * per_run:.3g} ms per run; a shell loop with one call per "
        f"run takes {SHELL_LOOP / per_run:.0f} times as long"
    )


def measure_inventory(buildings: int, method: str) -> None:
    """Print the time and the memory of `tdint campaign` for an inventory.

    Parameters
    ----------
    buildings : int
        Number of buildings. Each has two stories and is analyzed under two components.
    method : str
        Name of the method.
    """
    generator, types = random.Random(1), ["W1", "C1", "S1", "RM1", "URM"]
    rows = ["id,NumberOfStories,YearBuilt,StructureType,PlanArea"]
    rows += [
        f"{i},2,{generator.randint(1920, 2015)},{generator.choice(types)},"
        f"{generator.uniform(1e3, 6e3):.1f}"
        for i in range(1, buildings + 1)
    ]
    with TemporaryDirectory() as name:
        directory = Path(name)
        (directory / "buildings.csv").write_text("\n".join(rows) + "\n")
        (directory / "campaign.yaml").write_text(
            "buildings: {inventory: buildings.csv, units: {length: ft}}\n"
            f"records: {{files: [{Path('records/near-fault.mseed').resolve()}], units: m/s^2, "
            f"pairs: true}}\n"
            f"analysis: {{method: {method}}}\n"
        )
        start = time.perf_counter()
        process = subprocess.Popen(
            ["tdint", "campaign", str(directory / "campaign.yaml"), "-o", str(directory / "out")]
        )
        _, status, usage = os.wait4(process.pid, 0)
        wall, processor = time.perf_counter() - start, usage.ru_utime + usage.ru_stime
        assert status == 0
    runs = 2 * buildings
    print(
        f"{method}: {runs} runs of 3000 steps, complete command: {wall:.3g} s, {processor:.3g} s "
        "of processor time"
    )
    # 3600 s/h / 1e6 = 3.6e-3; twice this value for two processors.
    print(
        f"{3.6e-3 * runs / wall:.3g} million runs per hour; {7.2e-3 * runs / processor:.3g} "
        "million if two processors do no other work"
    )
    print(f"maximum resident memory {usage.ru_maxrss / 1024:.0f} MB")


def write_region(buildings: int, directory: Path) -> None:
    """Write the files of a campaign with ground motion fields of 100 events.

    There is a site for each 100 buildings. At each site, each event is one of two ground motions
    with a random factor.

    Parameters
    ----------
    buildings : int
        Number of buildings.
    directory : Path
        Directory for campaign.yaml and its tables.
    """
    generator, types = random.Random(1), ["W1", "C1", "S1", "RM1", "URM"]
    sites = buildings // 100
    coordinates = [
        (f"{-122.5 + 0.01 * (i % 100):.4f}", f"{37.3 + 0.01 * (i // 100):.4f}")
        for i in range(sites)
    ]
    tables = {"sites": ["site,longitude,latitude"], "fields": ["event,site,record,factor"]}
    tables["buildings"] = ["id,NumberOfStories,YearBuilt,StructureType,PlanArea,Longitude,Latitude"]
    tables["sites"] += [f"s{i},{','.join(coordinates[i])}" for i in range(sites)]
    motions = [Path(f"records/{name}.mseed").resolve() for name in ("soft-soil", "firm-soil")]
    for event in range(100):
        tables["fields"] += [
            f"E{event},s{i},{generator.choice(motions)},{generator.uniform(0.2, 1.5):.4f}"
            for i in range(sites)
        ]
    for i in range(buildings):
        facts = (  # stories, year, type and area in m^2
            generator.randint(1, 3),
            generator.randint(1920, 2015),
            generator.choice(types),
            generator.randint(100, 900),
        )
        tables["buildings"].append(
            ",".join(map(str, (f"b{i}", *facts, *generator.choice(coordinates))))
        )
    for table, lines in tables.items():
        (directory / f"{table}.csv").write_text("\n".join([*lines, ""]))
    (directory / "campaign.yaml").write_text(
        "buildings: {inventory: buildings.csv, units: {length: m}}\n"
        "records: {fields: fields.csv, sites: sites.csv, units: m/s^2, component: HN1}\n"
    )


def measure_part(buildings: int, parts: int) -> None:
    """Run the middle part of a campaign of `write_region`, and print its processor time and memory.

    The time before the first run includes the start of Python.

    Parameters
    ----------
    buildings : int
        Number of buildings of the campaign.
    parts : int
        Number of parts.
    """
    with TemporaryDirectory() as name:
        # Another process writes the tables, so that it is not counted in the memory.
        writer = get_context("spawn").Process(target=write_region, args=(buildings, Path(name)))
        writer.start()
        writer.join()
        shard = Shard((parts + 1) // 2, parts)
        campaign = load_campaign(Path(name) / "campaign.yaml")
        plan = make_plan(campaign, read_inputs(campaign))
        building_numbers = plan.buildings_of(shard.chunks(plan))
        store, _ = open_store(Path(name), plan, building_numbers)
        compile_for(plan)
        before, memory = time.process_time(), getrusage(RUSAGE_SELF).ru_maxrss / 1024
        with store:
            runs = execute_plan(plan, store, threads(1), shard=shard).done
            run_time = store.seconds()
    print(
        f"part {shard.text}: {len(building_numbers)} of {buildings} buildings, {runs} of "
        f"{plan.runs} runs; processor time"
    )
    print(
        f"before the first run {before:.3g} s and {memory:.0f} MB, runs {run_time:.4g} s: "
        f"{before / run_time:.1%}; at the end {getrusage(RUSAGE_SELF).ru_maxrss / 1024:.0f} MB"
    )


if __name__ == "__main__":
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--buildings", type=int)
    parser.add_argument("--parts", type=int)
    parser.add_argument("--method", default="impulse4")
    options = parser.parse_args()
    if options.parts:
        measure_part(options.buildings, options.parts)
    elif options.buildings:
        measure_inventory(options.buildings, options.method)
    else:
        measure_engine(options.method)
