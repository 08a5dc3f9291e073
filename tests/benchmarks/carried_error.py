"""The error that moment4 carries along: python tests/benchmarks/carried_error.py [honesty | work] [--quick]

honesty: estimates beside true errors by their size, over random buildings of all laws under the motions of `records`
and artificial ones, with steps of 2, 1, 1/2 and 1/4 samples; two runs (h and h/2) beside. `--records FOLDER` takes all
motions that can be read there, `--buildings` so many buildings from `--seed` on, `--keep FILE` keeps what was found.
work: time per step with and without it and with the repetitions, and error over time, on the two ten-story buildings.
"""

from __future__ import annotations

import argparse
import sys
import time
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np

from tdint import load_model
from tdint.analysis.run.run import FailedRun, prepare, run_case
from tdint.errors import TdintError
from tdint.ground_motion.reading.read import read_records

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
    difference of two runs over 15, doubt of the truth; of the story that is worst."""
    case, other = (prepare(building, record, method=method) for method in ("moment4", "impulse4"))
    # A run ends with a story that fails: at the step, and is compared up to there.
    end = marched(case, 2 * PARTS[0]).collapse
    duration = None if end is None else case.record.dt * int(0.98 * end.time / case.record.dt / 2) * 2
    truth, second = marched(other, FINE, duration=duration).stories, marched(case, FINE // 2, duration=duration).stories
    half = marched(case, 2 * PARTS[0], duration=duration)
    for step, parts in enumerate(PARTS):
        response = marched(case, parts, True, duration)
        for index, name in enumerate(NAMES):
            size = truth.peak_drift if name == "residual_drift" else getattr(truth, name)
            true, own, better = (getattr(one, name) for one in (truth, response.stories, response.check.corrected))
            pairs = (
                (own, true),
                (own + getattr(response.check.errors, name), own),
                (better, true),
                (own, getattr(half.stories, name)),
                (getattr(second, name), true),
            )
            with np.errstate(invalid="ignore", divide="ignore"):
                found = [np.max(np.abs(a - b) / np.abs(size)) for a, b in pairs]
            if np.isfinite(found[0]):
                yield step, index, *found
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
    print("| estimate from | quantity | runs (unsure) | 5 / 50 / 95 %, largest | within | corrected over own |")
    for index, name in enumerate(NAMES):
        for low, high in zip(BOUNDS, (*BOUNDS[1:], np.inf), strict=True):
            found = rows[(rows[:, 2] == index) & (low <= rows[:, 4]) & (rows[:, 4] < high)][:, 3:]
            sure = found[(found[:, 4] < SURE * np.maximum(found[:, 0], found[:, 1])) & (found[:, 0] > 0.0)]
            if len(sure):
                print(f"| {low:.0e} | {name} | {len(sure)} ({len(found) - len(sure)}) | {shares(sure)} |")
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
    within = f"{100 * np.mean(ratio < 1.25):.0f} / {100 * np.mean(ratio < 2.0):.0f} %"
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


def work(repeats):
    for name in ("ten-story", "ten-story-bilinear"):
        case = prepare(load_model(ROOT / "configs" / f"{name}.yaml"), method="moment4")
        truth = marched(prepare(case.model, case.record, method="impulse4"), FINE).stories.peak_drift
        print(f"{name}: dt | ms plain, carried, repeated | error: plain, corrected | estimates: carried, repeated")
        for parts in PARTS:
            plain, carried = marched(case, parts), marched(case, parts, True)
            finer = [marched(case, k * parts).stories.peak_drift for k in (2, 4)]
            own, corrected = plain.stories.peak_drift, carried.check.corrected.peak_drift
            repeated = np.max(np.maximum(4 / 3 * np.abs(own - finer[0]), np.abs(own - finer[1])) / own)
            jobs = [partial(run_case, case, dt=case.record.dt / parts / k) for k in (1, 2, 4)]
            times = seconds([partial(marched, case, parts, True), *jobs], repeats)
            print(
                f"{plain.dt:g} | {1e3 * times[1]:.2f}, {1e3 * times[0]:.2f}, {1e3 * sum(times[1:]):.2f} "
                f"({times[0] / times[1]:.2f}) | "
                f"{np.max(np.abs(own / truth - 1)):.1e}, {np.max(np.abs(corrected / truth - 1)):.1e} | "
                f"{carried.check.drift_error:.1e}, {repeated:.1e}"
            )


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("table", nargs="?", choices=["honesty", "work"])
    parser.add_argument("--records", type=Path, default=ROOT / "records")
    parser.add_argument("--buildings", type=int, default=120)
    parser.add_argument("--seed", type=int, default=20_000)
    parser.add_argument("--keep", type=Path)
    parser.add_argument("--quick", action="store_true")
    given = parser.parse_args()
    count = 24 if given.quick else given.buildings
    if given.table != "work":
        honesty(given.seed, count, list(motions(given.records)), given.keep)
    if given.table != "honesty":
        work(5 if given.quick else 30)


if __name__ == "__main__":
    main()
