"""Compare full time loops with the time loops of a building.

    python tests/benchmarks/loops.py [--wheel]

The script integrates each model of `configs` alternately with the form of its loops and with the
full form in one process, and stores the minimum processor times of the thread. It checks that the
peaks of both loops are equal to the bit.

`--wheel` uses the full loops of a wheel: those for the oldest processor of its platform,
compiled into TDINT_KERNELS_DIR by `tdint compile --all --target linux-x86-64-v3 -o DIR`. Results
are written to loops.csv, and run.py writes a table from this file.
"""

from __future__ import annotations

import csv
import math
import sys
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import raw_points
from common import ROOT

from tdint import load_model
from tdint.errors import TdintError
from tdint.kernels.building.compilable import FULL
from tdint.methods.catalogue import parse
from tdint.model.definition import Model
from tdint.response.runs.prepared import PreparedBuilding
from tdint.response.runs.run import model_record
from tdint.response.time_steps import choose_steps

FILE = Path(__file__).with_name("loops.csv")
HEADS = ("loops", "model", "method", "own_us_per_step", "ratio")
METHODS = ("impulse4", "gauss4", "newmark-average", "noh-bathe")
REPEATS = 25
MAX_STORIES = 30


def prepare_building(model: Model, is_full: bool) -> PreparedBuilding:
    """Return the prepared building with full loops, or with the loops of its form."""
    prepared = PreparedBuilding.of(model)
    if is_full:  # replace the value of the cached property
        vars(prepared)["variant"] = prepared.variant._replace(form=FULL)
    return prepared


def times(model: Model, method: str) -> tuple[float, float] | None:
    """Return the minimum time of a step in the loop of its form and in the full loop, s.

    None if the method does not integrate the building.
    """
    integrator, record = parse(method), model_record(model)
    assert record is not None
    steps = choose_steps(None, None, record.dt, record.duration)
    buildings = [prepare_building(model, is_full) for is_full in (False, True)]
    buildings[0].compile([integrator])
    best, peaks = [math.inf, math.inf], [None, None]
    for _ in range(REPEATS):
        for i, prepared in enumerate(buildings):
            result = prepared.integrate(integrator, steps, record.acceleration.copy())
            if result.code < 0:
                return None
            best[i] = min(best[i], result.seconds / steps.count)
            peaks[i] = result.space.peaks
    assert np.array_equal(*peaks)
    return best[0], best[1]


def main(arguments: Sequence[str]) -> None:
    """Measure all models and methods and write loops.csv.

    Rows of the loops from the other source (`compile --all` or a wheel) are kept in the file.
    """
    source = "wheel" if "--wheel" in arguments else "compile --all"
    other_rows = []
    if FILE.exists():
        with FILE.open(encoding="utf-8", newline="") as stream:
            other_rows = [row for row in csv.reader(stream) if row[0] not in (source, HEADS[0])]
    rows = []
    for file in sorted((ROOT / "configs").glob("*.yaml")):
        model = load_model(file)
        if not model.excitation.record or len(model.stories) > MAX_STORIES:
            continue
        for method in METHODS:
            try:
                step_times = times(model, method)
            except TdintError as error:  # the method does not support the building
                print(file.stem, method, error)
                continue
            if step_times is not None:
                own, all_laws = step_times
                rows.append(
                    [source, file.stem, method, f"{1e6 * own:.4g}", f"{all_laws / own:.3f}"]
                )
                print(*rows[-1], flush=True)
    raw_points.write(FILE, HEADS, sorted([*other_rows, *rows]))


if __name__ == "__main__":
    main(sys.argv[1:])
