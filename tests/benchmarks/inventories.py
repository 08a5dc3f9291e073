"""Measure the errors of peak drifts in buildings of inventories.

    python tests/benchmarks/inventories.py

The buildings have one to four stories and are derived by the rules `mdof-lu`. They are also
analyzed with the law multilinear-pinching instead of trilinear-pinching. For each method, and for
time steps of one to eight sampling intervals, the program prints fractiles of the errors as a
Markdown table. The reference solution is `impulse4` with a 16th of the sampling interval.
"""

import random
import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from common import components

import tdint
from tdint.ground_motion.record import Record
from tdint.model.definition import Model
from tdint.model.mdof_lu import BuildingFacts
from tdint.response.pairs import Run
from tdint.response.runs.batch import Subject
from tdint.studies.campaign.chunks import Batch, CampaignSettings, spectral_accelerations
from tdint.studies.regions.inventory import InventoryRow, derive_row, model_text

BUILDINGS = 40
METHODS = ("impulse4", "moment4", "newmark-average")
STEPS = (1, 2, 4, 8)  # sampling intervals
SCALES = (0.5, 1.0, 2.0)
TRILINEAR = re.compile(
    r"type: trilinear-pinching, yield_force: (\S+), ultimate_force: (\S+), ultimate_drift: (\S+), "
    r".*?}"
)
"""Law in the model files of the rules `mdof-lu`; groups: two forces, N, and a drift, m."""


def buildings(law: str) -> list[Model]:
    """Return `BUILDINGS` random models by the rules mdof-lu.

    Parameters
    ----------
    law : {"trilinear", "multilinear"}
        trilinear: the law of the rules, trilinear-pinching. multilinear: multilinear-pinching with
        a backbone curve through the yield point and the ultimate point of the law of the rules.
    """
    generator, models = random.Random(1), []
    with TemporaryDirectory() as directory:
        file = Path(directory) / "building.yaml"
        for number in range(BUILDINGS):
            structure = generator.choice(["W1", "C1", "S1", "RM1", "URM"])
            stories, year = generator.randint(1, 4), generator.randint(1920, 2015)
            facts = BuildingFacts(structure, stories, year, 200.0)
            row = InventoryRow(str(number), facts)
            text = model_text(row.id, derive_row(row, "mdof-lu"), "mdof-lu")
            file.write_text(text if law == "trilinear" else _multilinear(text))
            models.append(tdint.load_model(file))
    return models


def _multilinear(text: str) -> str:
    """Return the text of a model file with multilinear-pinching instead of trilinear-pinching."""
    lines = text.splitlines()
    for number, line in enumerate(lines):
        if match := TRILINEAR.search(line):
            # The line before the law ends with the initial stiffness.
            stiffness = float(lines[number - 1].split()[-1])
            yield_force, ultimate_force, drift = (float(text) for text in match.groups())
            yield_drift = yield_force / stiffness
            points = f"[[{yield_drift!r}, {yield_force!r}], [{drift!r}, {ultimate_force!r}]]"
            pinching = "{drift: 0.5, force: 0.25, unloading: 0.05}"
            lines[number] = (
                f"    law: {{type: multilinear-pinching, backbone: {points}, pinching: {pinching}}}"
            )
    return "\n".join(lines) + "\n"


def motions() -> dict[int, Record]:
    """Return the horizontal ground motions of records."""
    return dict(enumerate(components()))


def campaign(subjects: Sequence[Subject], suite: Mapping[int, Record], dt: float) -> np.ndarray:
    """Return the peak drift ratios of all runs; nan for a run that collapsed or failed.

    Parameters
    ----------
    subjects : sequence of Subject
        Buildings with their methods.
    suite : mapping of int to Record
        Ground motions; each is scaled by all factors of `SCALES`.
    dt : float
        Time step, s.

    Returns
    -------
    ndarray, shape (buildings, runs)
        The runs are ordered by ground motion and then by scale.
    """
    runs, drifts = [Run(motion, scale) for motion in suite for scale in SCALES], []
    for subject in subjects:
        spectral = {
            n: spectral_accelerations(record, [subject.period])[0] for n, record in suite.items()
        }
        rows = Batch(0, subject, suite, spectral, CampaignSettings(dt=dt)).results(runs).runs
        # The second and third column of a row are the ground motion and its scale.
        by_run = {
            row[1:3]: row.peak_drift_ratio if row.status == "done" else np.nan for row in rows
        }
        drifts.append([by_run[run.motion, run.scale] for run in runs])
    return np.array(drifts, dtype=float)


def print_errors(suite: Mapping[int, Record], interval: float) -> None:
    """Print the tables of errors for both laws; `interval` is the sampling interval, s."""
    for law in ("trilinear", "multilinear"):
        models = buildings(law)
        exact = campaign([Subject(model, "impulse4") for model in models], suite, interval / 16)
        print(
            f"\n| {law}: time step / sampling interval | method | 50 % | 90 % | 99 % of the "
            "errors below |"
        )
        print("|---|---|---|---|---|")
        for part in STEPS:
            for method in METHODS:
                subjects = [Subject(model, method) for model in models]
                drifts = campaign(subjects, suite, interval * part)
                errors = np.abs(drifts / exact - 1.0)
                fractiles = " | ".join(
                    f"{100 * value:.2g} %" for value in np.nanquantile(errors, [0.5, 0.9, 0.99])
                )
                print(f"| {part:g} | {method} | {fractiles} |")


if __name__ == "__main__":
    suite = motions()
    print_errors(suite, suite[0].dt)
