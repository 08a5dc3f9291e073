"""The error that moment4 carries along: python tests/benchmarks/carried_error.py [honesty | work] [--quick]

honesty: estimates beside true errors by their size, over random buildings of all laws under the motions of `records`
and artificial ones, with steps of 2, 1, 1/2 and 1/4 samples; two runs (h and h/2) beside. `--records FOLDER` takes all
motions that can be read there, `--buildings` so many buildings from `--seed` on, `--keep FILE` keeps what was found.
work: time, true error and estimate of both ten-story buildings: moment4 without its error, with it, corrected by it,
impulse4, and both with the two more runs of a repetition; `--plot FILE.png` draws that.
"""

from __future__ import annotations

import argparse
import sys
import time
from dataclasses import replace
from functools import partial
from io import BytesIO
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from tdint import load_model
from tdint.analysis.run.error_estimate import TOLD, checked, checked_run
from tdint.analysis.run.outcome import FailedRun
from tdint.analysis.run.run import prepare
from tdint.errors import TdintError
from tdint.ground_motion.reading.read import read_records
from tdint.output.figures.style import COLORS, MARKERS, add_legend, picture

sys.path.append(str(Path(__file__).parents[1]))
from random_buildings import checked_building, piecewise_building, shaken_building

ROOT = Path(__file__).parents[2]
BOUNDS = (1e-9, 1e-4, 1e-3, 1e-2)
NAMES = (
    "peak_drift",
    "residual_drift",
    "peak_displacement",
    "peak_velocity",
    "peak_acceleration",
    "peak_shear",
    "peak_total_shear",
    "peak_damper_force",
)
FINE = 32
PARTS = (4, 2, 1, 0.5)
SECONDS = 20.0
SURE = 0.2  # of a true error: what two solvers may differ by

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


def motions(folder):
    """The strongest SECONDS of all motions of a folder that tell their units, without vertical ones."""
    for file in sorted(one for one in folder.rglob("*") if one.is_file()):
        try:
            records = read_records(file)
        except TdintError:
            continue
        for one in records:
            if one.duration > 10.0 and not one.component.upper().endswith(("Z", "U", "UD", "V")):
                first = max(0, int(np.argmax(np.abs(one.acceleration)) - 0.4 * SECONDS / one.dt))
                yield replace(one, acceleration=one.acceleration[first : first + int(SECONDS / one.dt)])


def cases(first, count, records):
    for seed in range(first, first + count):
        rng = np.random.default_rng(seed)
        if seed % 4 == 0:
            building, record = shaken_building(rng)
        elif seed % 4 == 1:
            building, record, *_ = checked_building(seed)
        else:
            building, record = piecewise_building(rng)
        if records and seed % 3:
            motion = records[seed % len(records)]
            record = motion.scaled(record.pga / motion.pga)
        yield seed, replace(building, collapse_drift=1e9), record


def marched(case, parts, carrying=False, duration=None):
    one = case.carrying_error()[0] if carrying else case
    return one.march(one.steps(case.record.dt / parts, duration))


def errors(building, record):
    """For each step and quantity: index of the step and the name, true error, estimate, error once corrected,
    difference of two runs over 15, doubt of the truth, all of the story that is worst; and whether the estimate comes
    from another run, the one carried along being in doubt."""
    case, other = (prepare(building, record, method=method) for method in ("moment4", "impulse4"))
    # A run ends with a story that fails: at the step, and is compared up to there.
    end = marched(case, 2 * PARTS[0]).collapse
    # All end with a whole step of the longest.
    duration = case.record.duration if end is None else 0.98 * end.time
    duration = case.record.dt * int(duration / case.record.dt / 2 + 1e-9) * 2
    truth, second = marched(other, FINE, duration=duration).stories, marched(case, FINE // 2, duration=duration).stories
    half = marched(case, 2 * PARTS[0], duration=duration)
    for step, parts in enumerate(PARTS):
        response = marched(case, parts, True, duration)
        told = checked_run(case, case.steps(case.record.dt / parts, duration)).check
        for index, name in enumerate(NAMES):
            size = truth.peak_drift if name == "residual_drift" else getattr(truth, name)
            true, own, better = (getattr(one, name) for one in (truth, response.stories, response.check.corrected))
            pairs = (
                (own, true),
                (own + getattr(told.errors, name), own),
                (better, true),
                (own, getattr(half.stories, name)),
                (getattr(second, name), true),
            )
            with np.errstate(invalid="ignore", divide="ignore"):
                found = [np.max(np.abs(a - b) / np.abs(size)) for a, b in pairs]
            if np.isfinite(found[0]):
                yield step, index, *found, bool(told.dts)
        half = response


def honesty(first, count, records, keep):
    rows = []
    for seed, building, record in cases(first, count, records):
        try:
            rows += [(seed, *row) for row in errors(building, record)]
        except FailedRun:
            continue
    rows = np.array(rows)
    if keep:
        np.save(keep, rows)
    tell(rows)


def tell(rows):
    small = rows[(rows[:, 2] == 0) & (rows[:, 4] < BOUNDS[-1])]
    print(f"errors of drifts below {BOUNDS[-1]:g} that come from another run: {100 * np.mean(small[:, 8]):.1f} %")
    print("| estimate from | quantity | runs (unsure) | 5 / 50 / 95 %, largest | within | corrected over own |")
    ranges = [*zip(BOUNDS, (*BOUNDS[1:], np.inf), strict=True), (BOUNDS[0], BOUNDS[2])]
    for index, name in [*enumerate(NAMES), (None, "all")]:
        for low, high in ranges:
            own = (rows[:, 2] == index) | (index is None)
            found = rows[own & (low <= rows[:, 4]) & (rows[:, 4] < high)][:, 3:]
            sure = found[(found[:, 4] < SURE * np.maximum(found[:, 0], found[:, 1])) & (found[:, 0] > 0.0)]
            if len(sure):
                print(f"| {low:.0e} to {high:.0e} | {name} | {len(sure)} ({len(found) - len(sure)}) | {shares(sure)} |")
    found = rows[(rows[:, 1] == PARTS.index(1)) & (rows[:, 3] > 1e-9) & (rows[:, 7] < SURE * rows[:, 3])]
    for index, name in enumerate(NAMES):
        own = found[(found[:, 2] == index) & (found[:, 4] < 1e-2)]
        if len(own):
            print(f"{name} at the record's step: {np.median(own[:, 3] / own[:, 5]):.0f} times closer, {len(own)} runs")


def shares(found):
    """A line of the table from rows of `errors`."""
    ratio, corrected = found[:, 0] / found[:, 1], found[:, 2] / found[:, 0]
    two = 15.0 / 16.0 * found[:, 0] / np.maximum(found[:, 3], 1e-300)
    spread = " / ".join(f"{one:.2f}" for one in np.percentile(ratio, (5, 50, 95)))
    within = f"{100 * np.mean(ratio < 1.25):.1f} / {100 * np.mean(ratio < 2.0):.1f} %"
    within += f", to both sides {100 * np.mean((ratio < 1.25) & (ratio > 0.8)):.0f}"
    within += f", beyond 2: {np.sum(ratio >= 2.0)}"
    better = f"{np.median(corrected):.3f}, {np.percentile(corrected, 95):.2f}"
    both = f"{100 * np.mean(np.maximum(two, 1.0 / two) < 1.25):.0f} %"
    return f"{spread}, {ratio.max():.2f} | {within} | {better} | two runs {both}"


def seconds(jobs, repeats):
    """The least time of each job; they take turns."""
    best = [np.inf] * len(jobs)
    for _ in range(repeats):
        for i, job in enumerate(jobs):
            began = time.thread_time()
            job()
            best[i] = min(best[i], time.thread_time() - began)
    return best


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
            times = seconds(jobs, repeats)
            found = [(1e3 * times[i], job()) for i, job in enumerate(jobs)]
            found.insert(2, (found[1][0], found[1][1].check.corrected))
            for line, (ms, response) in zip(LINES, found, strict=True):
                stories, check = getattr(response, "stories", response), getattr(response, "check", None)
                if line in LINES[1:3] and found[1][1].check.drift_error > TOLD:
                    continue  # it says itself that it does not do
                error, estimate = np.max(np.abs(stories.peak_drift / truth - 1.0)), check and check.drift_error
                panels[name][1][line].append((ms, error, estimate))
                print(f"| {case.record.dt / parts:g} | {line} | {ms:.2f} | {error:.1e} | {estimate or 0:.1e} |")
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
    parser.add_argument("table", nargs="?", choices=["honesty", "work"])
    parser.add_argument("--records", type=Path, default=ROOT / "records")
    parser.add_argument("--buildings", type=int, default=120)
    parser.add_argument("--seed", type=int, default=20_000)
    parser.add_argument("--keep", type=Path)
    parser.add_argument("--plot", type=Path)
    parser.add_argument("--quick", action="store_true")
    given = parser.parse_args()
    count = 24 if given.quick else given.buildings
    if given.table != "work":
        honesty(given.seed, count, list(motions(given.records)), given.keep)
    if given.table != "honesty":
        work(5 if given.quick else 30, given.plot)


if __name__ == "__main__":
    main()
