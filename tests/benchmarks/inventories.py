"""How far methods are off in the buildings of inventories: python tests/benchmarks/inventories.py

What error of the peak drifts each method has at steps from one to eight times the records', in
buildings of one to four stories: by the rules mdof-lu, and with the law multilinear-pinching in its
place.
"""

import random
import re
from collections.abc import Sequence
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from common import components

import tdint
from tdint.analysis.run.batch import Subject
from tdint.analysis.run.prepared import Motions
from tdint.campaign.batch import Batch, Run, RunSettings, spectral_accelerations
from tdint.model.definition import Model
from tdint.model.inventory import InventoryRow, derive_row, model_text
from tdint.model.mdof_lu import BuildingFacts

BUILDINGS = 40
METHODS = ("impulse4", "moment4", "newmark-average")
STEPS = (1, 2, 4, 8)
SCALES = (0.5, 1.0, 2.0)
TRILINEAR = re.compile(
    r"type: trilinear-pinching, yield_force: (\S+), ultimate_force: (\S+), ultimate_drift: (\S+), "
    r".*?}"
)


def buildings(law: str) -> list[Model]:
    """Models by the rules mdof-lu, with their law or the other one through the same points."""
    kinds, found = random.Random(1), []
    with TemporaryDirectory() as folder:
        file = Path(folder) / "building.yaml"
        for number in range(BUILDINGS):
            structure = kinds.choice(["W1", "C1", "S1", "RM1", "URM"])
            facts = BuildingFacts(structure, kinds.randint(1, 4), kinds.randint(1920, 2015), 200.0)
            row = InventoryRow(str(number), facts)
            text = model_text(row.id, derive_row(row, "mdof-lu"), "mdof-lu")
            file.write_text(text if law == "trilinear" else _multilinear(text))
            found.append(tdint.load_model(file))
    return found


def _multilinear(text: str) -> str:
    lines = text.splitlines()
    for number, line in enumerate(lines):
        if found := TRILINEAR.search(line):
            stiffness = float(lines[number - 1].split()[-1])
            first, last, drift = (float(one) for one in found.groups())
            points = f"[[{first / stiffness!r}, {first!r}], [{drift!r}, {last!r}]]"
            pinching = "{drift: 0.5, force: 0.25, unloading: 0.05}"
            lines[number] = (
                f"    law: {{type: multilinear-pinching, backbone: {points}, pinching: {pinching}}}"
            )
    return "\n".join(lines) + "\n"


def motions() -> Motions:
    """The horizontals of the shipped motions."""
    return Motions(dict(enumerate(components())))


def campaign(subjects: Sequence[Subject], suite: Motions, dt: float) -> np.ndarray:
    """Peak drift ratios of all runs; nan where a building has collapsed."""
    runs, drifts = [Run(motion, scale) for motion in suite.records for scale in SCALES], []
    for subject in subjects:
        spectral = {
            n: spectral_accelerations(record, [subject.period])[0]
            for n, record in suite.records.items()
        }
        rows = Batch(0, subject, suite, spectral, RunSettings(dt=dt)).results(runs).runs
        found = {row[1:3]: row.peak_drift_ratio if row.status == "done" else np.nan for row in rows}
        drifts.append([found[run.motion, run.scale] for run in runs])
    return np.array(drifts, dtype=float)


def methods(suite: Motions, step: float) -> None:
    for law in ("trilinear", "multilinear"):
        models = buildings(law)
        exact = campaign([Subject(model, "impulse4") for model in models], suite, step / 16)
        print(f"\n| {law}: step over the record's | method | 50 % | 90 % | 99 % of errors within |")
        print("|---|---|---|---|---|")
        for part in STEPS:
            for method in METHODS:
                drifts = campaign([Subject(model, method) for model in models], suite, step * part)
                errors = np.abs(drifts / exact - 1.0)
                within = " | ".join(
                    f"{100 * one:.2g} %" for one in np.nanquantile(errors, [0.5, 0.9, 0.99])
                )
                print(f"| {part:g} | {method} | {within} |")


if __name__ == "__main__":
    suite = motions()
    methods(suite, suite.records[0].dt)
