"""The error that moment4 carries along: python tests/benchmarks/carried_error.py [honesty | work] [FOLDER] [BUILDINGS]

honesty: estimates beside true errors, by their size, over random buildings of all laws, with two runs (h and h/2)
beside; work: time per step with and without it and with the repetitions, and error over time, on the two ten-story
buildings. FOLDER holds ground motions for the random buildings in place of synthetic ones.
"""

from __future__ import annotations

import sys
import time
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np

from tdint import load_model, read_record, run
from tdint.analysis.run.run import FailedRun, prepare, run_case

sys.path.append(str(Path(__file__).parents[1]))
from random_buildings import checked_building, piecewise_building

CONFIGS = Path(__file__).parents[2] / "configs"
BOUNDS = (1e-9, 1e-4, 1e-3, 1e-2)
NAMES = ("peak_drift", "peak_shear", "peak_displacement", "peak_velocity", "peak_acceleration")
FINE = 32


def cases(count, folder):
    records = [read_record(file) for file in sorted(folder.glob("*.mseed"))] if folder else []
    for seed in range(count):
        if seed % 2:
            building, record = piecewise_building(np.random.default_rng(seed))
        else:
            building, record, *_ = checked_building(seed)
        if records:
            record = records[seed % len(records)]
        yield replace(building, collapse_drift=1e9), record


def errors(building, record):
    """For each step and quantity: true error, estimate, error once corrected, difference of two runs over 15, doubt of
    the truth; of the story that is worst."""
    truth = run(building, record, method="moment4", dt=record.dt / FINE).stories
    other = run(building, record, method="impulse4", dt=record.dt / FINE).stories
    half = None
    for parts in (8, 4, 2, 1):
        response = run(building, record, method="moment4", dt=record.dt / parts, check=True)
        if half is not None and response.check.corrected is not None:
            for name in NAMES:
                true, own, better = (getattr(one, name) for one in (truth, response.stories, response.check.corrected))
                pairs = (
                    (own, true),
                    (better, own),
                    (better, true),
                    (own, getattr(half, name)),
                    (getattr(other, name), true),
                )
                found = [float(np.max(np.abs(a - b) / np.abs(true))) for a, b in pairs]
                found[3] *= 16.0 / 15.0
                yield name, *found
        half = response.stories


def honesty(count, folder):
    rows = []
    for building, record in cases(count, folder):
        try:
            rows += list(errors(building, record))
        except FailedRun:
            continue
    print("quantity, estimate from | runs | within 1.25, 2 | largest | corrected over own: median, 95 % | two runs")
    for name in NAMES:
        for low, high in zip(BOUNDS, (*BOUNDS[1:], np.inf), strict=True):
            found = [row[1:] for row in rows if row[0] == name and low <= row[2] < high and row[5] < 0.2 * row[1]]
            if found:
                print(f"{name}, {low:.0e} | {len(found)} | {shares(np.array(found))}")


def shares(found):
    """A line of the table from rows of `errors`."""
    ratio, corrected, two = found[:, 0] / found[:, 1], found[:, 2] / found[:, 0], found[:, 0] / found[:, 3]
    within = f"{100 * np.mean(ratio < 1.25):.0f}, {100 * np.mean(ratio < 2.0):.0f} % | {ratio.max():.2f}"
    better = f"{np.median(corrected):.3f}, {np.percentile(corrected, 95):.2f}"
    return f"{within} | {better} | {100 * np.mean(np.maximum(two, 1.0 / two) < 1.25):.0f} %"


def fastest(job, repeats=25):
    best = np.inf
    for _ in range(repeats):
        began = time.thread_time()
        job()
        best = min(best, time.thread_time() - began)
    return best


def work():
    for name in ("ten-story", "ten-story-bilinear"):
        case = prepare(load_model(CONFIGS / f"{name}.yaml"), method="moment4")
        dt = case.record.dt
        truth = run_case(case, dt=dt / FINE).stories.peak_drift
        print(f"{name}: dt | ms plain, carried, repeated | error: plain, corrected | estimates: carried, repeated")
        for parts in (4, 2, 1, 0.5):
            h = dt / parts
            plain, carried = run_case(case, dt=h), run_case(case, dt=h, check=True)
            finer = [run_case(case, dt=h / k).stories.peak_drift for k in (2, 4)]
            own = plain.stories.peak_drift
            repeated = np.max(np.maximum(4 / 3 * np.abs(own - finer[0]), np.abs(own - finer[1])) / own)
            seconds = [fastest(partial(run_case, case, dt=h, check=check)) for check in (False, True)]
            seconds.append(sum(fastest(partial(run_case, case, dt=h / k), 5) for k in (1, 2, 4)))
            corrected = carried.check.corrected.peak_drift if carried.check.corrected else np.full_like(own, np.nan)
            print(
                f"{h:g} | " + ", ".join(f"{1e3 * one:.2f}" for one in seconds) + f" ({seconds[1] / seconds[0]:.2f}) | "
                f"{np.max(np.abs(own / truth - 1)):.1e}, {np.max(np.abs(corrected / truth - 1)):.1e} | "
                f"{carried.check.drift_error:.1e}, {repeated:.1e}"
            )


def main(wanted):
    tables = [one for one in wanted if one in ("honesty", "work")] or ["honesty", "work"]
    count = next((int(one) for one in wanted if one.isdigit()), 60)
    folder = next((Path(one) for one in wanted if Path(one).is_dir()), None)
    if "honesty" in tables:
        honesty(count, folder)
    if "work" in tables:
        work()


if __name__ == "__main__":
    main(sys.argv[1:])
