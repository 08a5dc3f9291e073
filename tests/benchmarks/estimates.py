"""Estimated errors beside true ones, over random buildings: python tests/benchmarks/estimates.py [TABLE]...

Tables: check (`--check` at steps of 1, 2, 4 and 8 samples: share of the peaks and residual drifts that are off by less
than the estimate, and by less than twice that), tolerance (`--tolerance 1%`: steps that were chosen, true errors).
All if none is named.

The buildings are those of `random_buildings.checked_building`: six laws, eight methods, motions of five to eight
seconds. The truth is impulse4 at a 64th of the record's step up to the same time.
"""

from __future__ import annotations

import sys
from collections import Counter, defaultdict
from dataclasses import fields
from pathlib import Path

import numpy as np

from tdint import run
from tdint.analysis.run.outcome import FailedRun, StoryErrors

sys.path.append(str(Path(__file__).parents[1]))
from random_buildings import checked_building

NAMES = [field.name for field in fields(StoryErrors)]
COUNT = 200
STEP, FINE = 0.01, 64
SAMPLES = (1, 2, 4, 8)


def cases():
    """Random buildings, motions and methods."""
    for seed in range(COUNT):
        yield seed, *checked_building(seed, 501 + seed * 37 % 300, STEP)


def truth(building, record, end):
    """The stories of a fine run up to a time."""
    return run(building, record, method="impulse4", dt=STEP / FINE, duration=end).stories


def check():
    """Estimates at steps of several samples."""
    found = defaultdict(list)
    for _, building, record, method in cases():
        for samples in SAMPLES:
            try:
                response = run(building, record, method=method, dt=samples * STEP, check=True)
            except FailedRun:
                continue
            if response.check.drift_error is None or response.status != "done":
                continue
            exact = truth(building, record, response.steps * response.dt)
            for name in NAMES:
                true = np.abs(getattr(response.stories, name) - getattr(exact, name))
                estimate = getattr(response.check.errors, name)
                known = np.isfinite(estimate) & np.isfinite(true)
                floor = 1e-7 * np.abs(getattr(exact, "peak_drift" if name == "residual_drift" else name))
                found[name, samples] += list(zip(true[known] - floor[known], estimate[known], strict=True))
    print("share off by less than the estimate / twice the estimate; the estimate over the true error, median")
    for (name, samples), pairs in sorted(found.items()):
        true, estimate = np.transpose(pairs)
        ratio = np.median(estimate / np.maximum(true, 1e-30))
        print(
            f"{name:20s}{samples:3d}{len(pairs):7d}  {100.0 * np.mean(true <= estimate):6.2f} %"
            f"  {100.0 * np.mean(true <= 2.0 * estimate):6.2f} %  {ratio:8.2f}"
        )


def tolerance():
    """Steps that are chosen for a tolerance."""
    for within in (0.01, 0.001):
        errors, steps = [], Counter()
        for seed, building, record, method in cases():
            try:
                response = run(building, record, method=method, tolerance=within)
            except FailedRun as failure:
                print(f"seed {seed}, {method}: {failure.status}")
                continue
            exact = truth(building, record, response.steps * response.dt)
            error = np.max(np.abs(response.stories.peak_drift / exact.peak_drift - 1.0))
            errors.append(error)
            steps[round(response.check.choice.samples, 4)] += 1
            if error > within:
                found = response.check.drift_error
                print(f"seed {seed}, {method}, dt {response.dt:g}: estimated {found:.2e}, true {error:.2e}")
        beyond = np.sum(np.array(errors) > within)
        print(f"{100.0 * within:g} %: {beyond} of {len(errors)} beyond, largest {max(errors):.1e}; {dict(steps)}")


TABLES = {one.__name__: one for one in (check, tolerance)}

if __name__ == "__main__":
    for table in sys.argv[1:] or TABLES:
        TABLES[table]()
        print()
