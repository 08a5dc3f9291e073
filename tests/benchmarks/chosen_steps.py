"""Steps that moment4 chooses on the way for a tolerance: python tests/benchmarks/chosen_steps.py

Processor time of equal steps over that of chosen ones at equal true error of the peak drifts, six buildings under
the motions of Kaikoura (164 s), those of `--records FOLDER` that last 160 s and longer, and the short artificial ones.
Equal steps are the best for the error, known afterwards, one run with its error; chosen ones are all that `--tolerance`
takes, the elastic first mode and runs made again included.
How many are beyond their tolerance says `carried_error.py tolerance`.
"""

import argparse
import time
import warnings
from functools import partial
from pathlib import Path

import numpy as np
from common import ROOT, least

from tdint import load_model, prepare, run_case
from tdint.errors import TdintError
from tdint.ground_motion.reading.read import read_records

ERRORS = (1e-2, 1e-3, 1e-4)
PARTS = (4, 2, 1, 0.5, 0.25, 0.125)
TOLERANCES = (0.01, 5e-3, 2e-3, 1e-3, 5e-4, 2e-4, 1e-4, 5e-5)
LONG, PGA = 160.0, 3.0


def frame(stories, period, yield_ratio, soft=1.0, damping="5%"):
    """Bilinear stories, the stiffness falling to a half at the top."""
    stiffness = 1.0 - 0.5 * np.arange(stories) / stories
    stiffness[0] *= soft
    matrix = np.diag(stiffness + np.append(stiffness[1:], 0.0)) - np.diag(stiffness[1:], 1) - np.diag(stiffness[1:], -1)
    stiffness *= 1e5 * (2.0 * np.pi / period) ** 2 / np.linalg.eigvalsh(matrix)[0]
    return load_model(
        {
            "stories": [
                {
                    "mass": 1e5,
                    "height": 3.3,
                    "stiffness": float(k),
                    "law": {"type": "bilinear", "yield_force": float(3.3 * yield_ratio * k), "hardening": 0.03},
                }
                for k in stiffness
            ],
            "damping": damping,
        }
    )


def buildings():
    for name in ("ten-story-bilinear", "ten-story"):
        yield name, load_model(ROOT / "configs" / f"{name}.yaml")
    yield "three stories, 0.25 s", frame(3, 0.25, 0.0012)
    yield "twenty stories, 2.4 s", frame(20, 2.4, 0.003)
    yield "seven stories, 0.7 s", frame(7, 0.7, 0.003, damping="3%")
    yield "five stories, soft first, 0.5 s", frame(5, 0.5, 0.002, soft=0.4, damping="3%")


def long_motions(folder):
    """Horizontal motions of a folder that tell their units and last long enough, weak ones strengthened."""
    inventories = sorted(folder.rglob("*.xml"))
    for file in sorted(one for one in folder.rglob("*") if one.is_file()):
        for inventory in (None, *inventories):
            try:
                found = read_records(file, inventory=inventory)
            except (TdintError, ValueError):
                continue
            for one in found:
                if one.duration >= LONG and not one.component.upper().endswith(("Z", "U", "UD", "V")):
                    yield one.scaled(PGA / one.pga) if one.pga < 0.5 * PGA or one.pga > 2.0 * PGA else one
            break


def at_errors(points):
    """Times at ERRORS from (error, time), the best with at most an error, between them on logarithms; nan outside."""
    error, spent = np.log(np.array(sorted(points))).T
    spent = np.minimum.accumulate(spent)
    return np.exp(np.interp(np.log(ERRORS), error, spent, left=np.nan, right=np.nan))


def gain(building, record, repeats):
    """Time of equal steps over that of chosen ones at ERRORS."""
    case = prepare(building, record, method="moment4")
    fine = prepare(building, record, method="impulse4")
    truth = fine.march(fine.steps(record.dt / 32)).stories.peak_drift
    jobs = [partial(run_case, case, dt=record.dt / parts, check=None) for parts in PARTS]
    jobs += [partial(run_case, case, tolerance=tolerance) for tolerance in TOLERANCES]
    off = [float(np.max(np.abs(job().stories.peak_drift / truth - 1.0))) for job in jobs]
    points = list(zip(np.maximum(off, 1e-12), least(jobs, repeats, time.thread_time), strict=True))
    return at_errors(points[: len(PARTS)]) / at_errors(points[len(PARTS) :])


def work(folder, repeats):
    warnings.simplefilter("ignore")
    real = [one for place in (ROOT / "records" / "kaikoura", folder) if place for one in long_motions(place)]
    made = [one for file in sorted((ROOT / "records").glob("*.mseed")) for one in read_records(file)]
    for kind, records in (("artificial", made), ("real", real)):
        every = []
        for name, building in buildings():
            gains = np.array([gain(building, record, repeats) for record in records])
            every.append(gains)
            told = " / ".join(f"{one:.2f}" for one in np.exp(np.nanmean(np.log(gains), axis=0)))
            print(f"| {kind} ({len(records)}) | {name} | {told} | {np.nanmin(gains):.2f} to {np.nanmax(gains):.2f} |")
        logs = np.log(np.concatenate(every))
        told = " / ".join(f"{one:.2f}" for one in np.exp(np.nanmean(logs, axis=0)))
        print(f"| {kind} | all, geometric mean | {told} | {np.isfinite(logs).sum(axis=0)} |", flush=True)


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("--records", type=Path)
    parser.add_argument("--repeats", type=int, default=5)
    given = parser.parse_args()
    work(given.records, given.repeats)


if __name__ == "__main__":
    main()
