"""Errors that are told, beside true ones: python tests/benchmarks/carried_error.py [honesty | tolerance | work]

honesty: `--buildings` random ones of all laws from `--seed` on (`random_buildings.any_building`) and the frames of
`configs` under the motions of `records`, at `--scales` factors drawn from 0.2 to 1.1 for each; steps of 4, 2, 1, 1/2
and 1/4 samples. Shares, over all stories, of told errors that are less than a half and a tenth of the true ones, and of
corrected peaks that are worse than computed ones. `--method impulse4` judges that one's repetitions, and what they add
to the word of moment4 where that is kept, too.
tolerance: how many runs that choose their steps for 1 and 0.1 % are within, two of each building.
work: time, true error and estimate of both ten-story buildings: moment4 without its error, with it, corrected by it,
impulse4, and both with the two more runs of a repetition; `--plot FILE.png` draws that.

Every case is kept in `--keep FOLDER`, its truth in `--truths FOLDER` (the same, if not given): what is there is not
made again, and `--minutes` ends the making of more. With TDINT_KERNELS=whole the loops are compiled once for all cases.
"""

import argparse
import os
import pickle
import sys
import tempfile
import time
from collections import Counter
from concurrent.futures import ProcessPoolExecutor
from functools import cache, partial
from io import BytesIO
from itertools import product
from pathlib import Path

import numpy as np
from common import ROOT, least
from matplotlib.figure import Figure

from tdint import load_model, prepare, run
from tdint.analysis.run.error_estimate import TOLD, checked
from tdint.analysis.run.outcome import FailedRun
from tdint.ground_motion.reading.read import read_records
from tdint.output.figures.style import COLORS, MARKERS, add_legend, picture

sys.path.append(str(Path(__file__).parents[1]))
from random_buildings import any_building

NAMES = (
    "peak_drift",
    "peak_acceleration",
    "peak_total_shear",
    "residual_drift",
    "peak_shear",
    "peak_displacement",
    "peak_velocity",
    "peak_damper_force",
)
MAIN = 4  # of these: by law and by step
SAMPLES = (4, 2, 1, 0.5, 0.25)
FINE = 32
TRUTHS = ("impulse4", "moment4")
SURE = 0.2  # of a true error: what both truths may differ by
RESOLUTION = 1e-6  # of a peak: below, Newton's tolerance and what both truths miss alike between steps are part of it
SMALL = 1e-2  # of a peak: up to here what is told is to be honest; above it says that the step is too long
TOLERANCES = (1e-2, 1e-3)

METHODS = ("moment4", "impulse4")
STEPS = (16, 8, 4, 2, 1, 0.5, 0.25)
HOW = ("plain", "carried", "repeated", "plain", "repeated")
LINES = (
    "moment4",
    "moment4 with its error",
    "moment4 corrected by it",
    "moment4 with two more runs",
    "impulse4",
    "impulse4 with two more runs",
)
OPEN = {"linestyle": "none", "markersize": 8.0, "markerfacecolor": "none"}

ROW = np.dtype(
    [("frame", "?"), ("collapsed", "?"), ("another", "?"), ("column", "i1"), ("law", "U22"), ("samples", "f8")]
    + [(name, "f8") for name in ("size", "own", "told", "corrected", "truth", "gap")]
    + [("case", "U60"), ("story", "i2")]
)


@cache
def frames():
    """The models of `configs` that name a ground motion."""
    models = {file.stem: load_model(file) for file in sorted((ROOT / "configs").glob("*.yaml"))}
    return {name: model for name, model in models.items() if model.excitation.record}


@cache
def motions():
    """The horizontal motions of `records` by file and component."""
    files = sorted((ROOT / "records").rglob("*.mseed"))
    found = {
        f"{file.stem} {record.component}": record for file in files for record in read_records(file, units="m/s^2")
    }
    return {name: record for name, record in found.items() if not name.endswith("Z")}


def names_of(seed, buildings, scales):
    """Cases by name: their models and motions follow from it."""
    rng = np.random.default_rng(seed)
    for frame, motion in product(frames(), motions()) if scales else ():
        for scale in rng.uniform(0.2, 1.1, scales):
            yield f"{frame} {motion} {scale:.4f}"
    yield from (f"building {one}" for one in range(seed, seed + buildings))


def case_of(name):
    """The model and the motion of a case, and a duration of whole steps of all lengths, s."""
    first, *others = name.split()
    if first == "building":
        model, record = any_building(int(others[0]))
        model = load_model(model)
    else:
        model, record = frames()[first], motions()[" ".join(others[:2])].scaled(float(others[2]))
    longest = SAMPLES[0] * record.dt
    return model, record, longest * int(record.duration / longest + 1e-9)


def ended(method, model, record, **how):
    """What is judged of a run: how and when it ended, its peaks, the errors told and the corrected peaks."""
    try:
        response = run(model, record, method=method, **how)
    except FailedRun as failure:
        return {"status": failure.status}
    check = response.check
    about = {"status": response.status, "end": response.steps * response.dt, "dts": check and check.dts}
    peaks = {"own": response.stories, "told": check and check.errors, "corrected": check and check.corrected}
    return about | {kind: stories and {one: getattr(stories, one) for one in NAMES} for kind, stories in peaks.items()}


def kept(file, make):
    """What a file holds; made and written where there is none."""
    if not file.exists():
        file.parent.mkdir(parents=True, exist_ok=True)
        beside = file.with_suffix(f".{os.getpid()}")
        beside.write_bytes(pickle.dumps(make()))
        beside.replace(file)
    return pickle.loads(file.read_bytes())


def job(name, *, table, method, truths, keep, end):
    """What is kept of a case: its truth by both methods, and its runs; None where time is up."""
    if time.time() > end:
        return None
    model, record, duration = case_of(name)

    def true(until):
        return [ended(one, model, record, dt=record.dt / FINE, duration=until) for one in TRUTHS]

    def within(tolerance):
        one = ended(method, model, record, duration=duration, tolerance=tolerance)
        # Strides may end after the duration.
        same = "own" not in one or abs(one["end"] - duration) < 1e-6
        return one, truth if same else true(one["end"])

    truth = kept(truths / f"{name}.truth", lambda: true(duration))
    if table == "tolerance":
        runs = kept(keep / f"{name}.{method}.tolerance", lambda: {one: within(one) for one in TOLERANCES})
    else:
        coarse = {"duration": duration, "check": True}
        runs = kept(
            keep / f"{name}.{method}",
            lambda: {one: ended(method, model, record, dt=one * record.dt, **coarse) for one in SAMPLES},
        )
    return name, [story.law.name for story in model.stories], truth, runs


def rows_of(name, laws, truth, runs):
    """A row for each column and story of all runs, `ROW`; and how those ended that have none."""
    rows, without = [], Counter()
    fine, other = truth
    for samples, one in runs.items():
        if "own" not in one:
            without[f"failed ({one['status']})"] += 1
        elif not all("own" in two and abs(two["end"] - one["end"]) < 1e-6 for two in truth):
            without["end at another time than the truth: collapse"] += 1
        elif fine["status"] != other["status"]:
            without["truths differ in collapse"] += 1
        else:
            collapsed = one["status"] != "done" or fine["status"] != "done"
            for column, what in enumerate(NAMES):
                size = fine["own"]["peak_drift" if column == 3 else what]
                nothing = np.full_like(size, np.nan)
                values = (size, one["own"][what], one["told"][what], (one["corrected"] or {}).get(what, nothing))
                values += fine["own"][what], np.abs(fine["own"][what] - other["own"][what])
                head = not name.startswith("building"), collapsed, bool(one["dts"]), column
                rows += [
                    (*head, law, samples, *v, name, i) for i, (law, *v) in enumerate(zip(laws, *values, strict=True))
                ]
    return rows, without


def judged(rows):
    """Of rows those with a told error below `SMALL` and a truth; how many have none, or nothing that is told."""
    error = np.abs(rows["own"] - rows["truth"])
    seen = (rows["told"] < SMALL * rows["size"]) & (error > RESOLUTION * rows["size"])
    sure = seen & (rows["gap"] < SURE * error)
    return rows[sure], int(np.sum(seen & ~sure))


def share(part):
    return f"{100.0 * np.mean(part):.2f} % ({np.sum(part)})" if len(part) else "-"


def ratios(sure):
    """True errors over told ones."""
    return np.abs(sure["own"] - sure["truth"]) / np.maximum(sure["told"], 1e-300)


def gains(sure):
    """How many times nearer to the truth corrected peaks are than computed ones, of the rows that have them."""
    left = np.abs(sure["corrected"] - sure["truth"])
    return (np.abs(sure["own"] - sure["truth"]) / np.maximum(left, 1e-300))[np.isfinite(left)]


def line(head, rows):
    """A line of a table: of each of the main columns the number judged, and the shares beyond 2 and beyond 10."""
    cells = []
    for column in range(MAIN):
        ratio = ratios(judged(rows[rows["column"] == column])[0])
        two, ten = ((100.0 * np.mean(ratio > times)) if len(ratio) else 0.0 for times in (2, 10))
        cells.append(f"{len(ratio)}: {two:.2f} / {ten:.2f} %")
    if len(rows):
        print(f"| {head} | {' | '.join(cells)} | {share(gains(judged(rows)[0]) < 1.0)} |")


def honesty(found, others, worst):
    rows, without, ends = [], Counter(), Counter()
    for name, laws, truth, runs in found:
        some, few = rows_of(name, laws, truth, runs)
        rows, without = rows + some, without + few
        ends.update(one["status"] for one in runs.values())
    rows = np.array(rows, ROW)
    nothing = share(np.isnan(rows["told"][rows["size"] > 0.0]))
    print(f"{len(found)} cases; runs by their end: {dict(ends)}; not judged: {dict(without)}; told nothing: {nothing}")
    done = rows[~rows["collapsed"]]
    groups = {"frames": done[done["frame"]], "random": done[~done["frame"]], "collapsed": rows[rows["collapsed"]]}
    print("| cases | column | judged (no truth) | beyond 2 | beyond 10 | most | corrected worse | times closer |")
    for (group, some), (column, name) in product(groups.items(), enumerate(NAMES)):
        sure, unsure = judged(some[some["column"] == column])
        if len(sure):
            ratio, gain = ratios(sure), gains(sure)
            shares = f"{share(ratio > 2.0)} | {share(ratio > 10.0)} | {ratio.max():.3g} | {share(gain < 1.0)}"
            closer = f"{np.median(gain):.0f}" if len(gain) else "-"
            print(f"| {group} | {name} | {len(sure)} ({unsure}) | {shares} | {closer} |")
    print(f"| of these | {' | '.join(NAMES[:MAIN])} | corrected worse |")
    for group, some in groups.items():
        for samples in SAMPLES:
            line(f"{group}, {samples:g} samples", some[some["samples"] == samples])
        for law in sorted(set(some["law"])) if group == "random" else ():
            line(law, some[some["law"] == law])
        runs = {samples: dict(some[some["samples"] == samples][["case", "another"]].tolist()) for samples in SAMPLES}
        told = (f"{share(np.array(list(by.values())))} at {samples:g}" for samples, by in runs.items() if by)
        print(f"{group}, told by another run: {', '.join(told)} samples")
    sure, _ = judged(done)
    ratio = ratios(sure)
    print(f"the {worst} worst: case, samples, story, law, column: true over told error, both over the peak")
    for i in np.argsort(-ratio)[:worst]:
        one = sure[i]
        true, told = abs(one["own"] - one["truth"]) / one["size"], one["told"] / one["size"]
        place = f"{one['case']}, {one['samples']:g}, {one['story'] + 1}, {one['law']}, {NAMES[one['column']]}"
        print(f"{place}: {ratio[i]:.3g}, {true:.1e}, {told:.1e}{', another run' if one['another'] else ''}")
    if others:
        second_opinion(rows, np.array([row for one in others for row in rows_of(*one)[0]], ROW))


def second_opinion(rows, others):
    """What another method's told errors (`rows`) add to those of moment4 (`others`): with the larger of both."""
    places = {(one["case"], one["samples"], one["column"], one["story"]): one for one in rows}
    for column in range(MAIN):
        sure = judged(others[~others["collapsed"] & (others["column"] == column)])[0]
        pairs = [(one, places.get((one["case"], one["samples"], column, one["story"]))) for one in sure]
        pairs = [(one, two) for one, two in pairs if two is not None and np.isfinite(two["told"])]
        both, other = (np.array(list(some), ROW) for some in zip(*pairs, strict=True))
        differ = np.abs(both["own"] - other["own"]) > both["told"] + other["told"]
        both["told"] = np.maximum(both["told"], other["told"])
        ratio = ratios(both)
        signed = f"{share(ratio > 2.0)} beyond 2, {share(ratio > 10.0)} beyond 10"
        print(f"{NAMES[column]}: with the larger of both errors {signed}; the two differ by more in {share(differ)}")


def tolerances(found):
    """How many runs are within the tolerance that they were asked for; those that err by more, one a line."""
    beyond, runs, ends = Counter(), Counter(), Counter()
    for name, _, _, of_case in found:
        for tolerance, (one, truth) in of_case.items():
            ends[one["status"]] += 1
            if one["status"] != "done" or any("own" not in two for two in truth):
                continue
            fine, other = (two["own"]["peak_drift"] for two in truth)
            error, gap = (float(np.max(np.abs(v / fine - 1.0))) for v in (one["own"]["peak_drift"], other))
            if gap > SURE * max(error, tolerance):
                ends["no truth"] += 1
                continue
            runs[tolerance] += 1
            if error > tolerance:
                beyond[tolerance] += 1
                told = float(np.max(one["told"]["peak_drift"] / fine))
                print(f"{name}, {100.0 * tolerance:g} %: true {error:.1e}, told {told:.1e}")
    print(f"{dict(ends)}; " + ", ".join(f"{beyond[t]} of {runs[t]} beyond {100.0 * t:g} %" for t in runs))


def marched(case, parts, carrying=False):
    """A run with so many steps in a sample."""
    one = case.carrying_error()[0] if carrying else case
    return one.march(one.steps(case.record.dt / parts))


def work(repeats, plot):
    panels = {}
    for name in ("ten-story", "ten-story-bilinear"):
        case, other = (prepare(load_model(ROOT / "configs" / f"{name}.yaml"), method=one) for one in METHODS)
        truth = marched(other, 2 * FINE).stories.peak_drift
        gap = np.max(np.abs(marched(case, FINE).stories.peak_drift / truth - 1.0))
        print(f"{name} (the truth is sure to {gap:.0e})")
        print("| dt (s) | line | ms | error | estimate |")
        panels[name] = gap, {line: [] for line in LINES}
        for parts in STEPS:
            jobs = [partial(told, *one, parts) for one in zip((case, case, case, other, other), HOW, strict=True)]
            times = least(jobs, repeats, time.thread_time)
            found = [(1e3 * times[i], job()) for i, job in enumerate(jobs)]
            found.insert(2, (found[1][0], found[1][1].check.corrected))
            for line, (ms, response) in zip(LINES, found, strict=True):
                stories, check = getattr(response, "stories", response), getattr(response, "check", None)
                if line in LINES[1:3] and found[1][1].check.drift_error > TOLD:
                    continue  # it says itself that it does not do
                error, estimate = np.max(np.abs(stories.peak_drift / truth - 1.0)), check and check.drift_error
                panels[name][1][line].append((ms, error, estimate))
                print(f"| {case.record.dt / parts:g} | {line} | {ms:.2f} | {error:.1e} | {estimate or 0:.1e} |")
            print(f"with the error: {times[1] / times[0]:.2f} times the time without")
    if plot:
        plot.write_bytes(drawn(panels))


def told(case, how, parts):
    """A run, with its error by the way that is asked for: plain, carried, repeated."""
    if how == "carried":
        return marched(case, parts, True)
    response = marched(case, parts)
    return checked(case, case.steps(case.record.dt / parts, None), response) if how == "repeated" else response


def drawn(panels):
    """The picture of `work`: time over true error; open marks stand where the run itself says that its error is."""

    def draw():
        figure = Figure(figsize=(7.5, 4.8), layout="constrained")
        for axes, (name, (gap, lines)) in zip(figure.subplots(1, 2, sharey=True), panels.items(), strict=True):
            handles = []
            for line, color, marker in zip(LINES, COLORS, MARKERS, strict=False):
                sure = [one for one in lines[line] if one[1] > 3.0 * gap]
                style = {"color": color, "marker": marker, "markersize": 4.5}
                handles += axes.plot([one[1] for one in sure], [one[0] for one in sure], **style)
                known = [one for one in sure if one[2]]
                axes.plot([one[2] for one in known], [one[0] for one in known], **style | OPEN)
            axes.set(xscale="log", yscale="log", title=name)
            axes.set_xlabel("error of the peak drifts, worst story\n(filled: true; around it: as estimated)")
        figure.axes[0].set_ylabel("processor time (ms)")
        add_legend(figure, figure.axes[0], handles, list(LINES), 31)
        return figure

    stream = BytesIO()
    picture(".png", draw)(stream)
    return stream.getvalue()


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("table", nargs="?", choices=["honesty", "tolerance", "work"], default="honesty")
    parser.add_argument("--seed", type=int, default=800_000)
    parser.add_argument("--buildings", type=int, default=300)
    parser.add_argument("--scales", type=int, default=3)
    parser.add_argument("--method", default="moment4")
    parser.add_argument("--keep", type=Path)
    parser.add_argument("--truths", type=Path)
    parser.add_argument("--minutes", type=float, default=np.inf)
    parser.add_argument("--processes", type=int, default=2)
    parser.add_argument("--worst", type=int, default=30)
    parser.add_argument("--repeats", type=int, default=30)
    parser.add_argument("--plot", type=Path)
    given = parser.parse_args()
    if given.table == "work":
        return work(given.repeats, given.plot)
    keep = given.keep or Path(tempfile.mkdtemp())
    how = {"table": given.table, "truths": given.truths or keep, "keep": keep}
    one_case = partial(job, **how, method=given.method, end=time.time() + 60.0 * given.minutes)
    names = list(names_of(given.seed, given.buildings, given.scales if given.table == "honesty" else 0))
    with ProcessPoolExecutor(given.processes) as pool:
        found = [one for one in pool.map(one_case, names) if one]
    if given.table == "tolerance":
        return tolerances(found)
    both = given.method != "moment4" and all((keep / f"{one[0]}.moment4").exists() for one in found)
    others = [job(one[0], **how, method="moment4", end=np.inf) for one in found] if both else []
    return honesty(found, others, given.worst)


if __name__ == "__main__":
    main()
