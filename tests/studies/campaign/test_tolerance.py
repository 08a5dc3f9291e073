"""Time step of a building for a tolerance, for records with several sampling intervals: it is
determined from some runs and used for all."""

from dataclasses import replace

import numpy as np
import pytest

import tdint
from selection import every
from tdint.ground_motion.record import Record
from tdint.response.pairs import Run
from tdint.response.runs.batch import Subject
from tdint.response.runs.case import Case
from tdint.response.runs.outcome import STORY_QUANTITIES
from tdint.response.runs.step_choice import choose_step, step_within
from tdint.studies.campaign.chunks import Batch, CampaignSettings, Rows, building_step


def first_part(name: str, component: str, samples: int = 1601) -> Record:
    """Return the strong first 16 s of a shipped record, which all tried time steps divide."""
    record = tdint.read_record(f"records/{name}.mseed", component=component, units="m/s^2")
    return replace(record, acceleration=record.acceleration[:samples].copy())


SHIPPED = [
    first_part(name, component)
    for name in ("firm-soil", "near-fault")
    for component in ("HN1", "HN2")
]
FINE = replace(first_part("firm-soil", "HN1", 2001), dt=0.004)
RECORDS = dict(enumerate([*SHIPPED, FINE]))
RUNS = [Run(motion, scale) for motion in RECORDS for scale in (0.3, 1.0, 2.0)]


OFFICE = tdint.load_model("configs/ten-story-bilinear.yaml")
PEAK_DRIFT = [quantity.name for quantity in STORY_QUANTITIES].index("peak_drift")


def results(subject: Subject, runs: list[Run], largest: float | None) -> Rows:
    batch = Batch(0, subject, RECORDS, dict.fromkeys(RECORDS), CampaignSettings(stories=True))
    return batch.results(runs, largest)


@pytest.fixture(scope="module")
def fine() -> Rows:
    """Return runs with errors of a thousandth of the tolerance."""
    return results(Subject(OFFICE, "impulse4"), RUNS, 0.01 / 8)


@pytest.mark.parametrize(
    ("method", "beyond"), every(2, [("impulse4", 0.0099), ("newmark-average", 0.0)])
)
def test_drifts_of_all_runs_are_within_the_tolerance(
    fine: Rows, method: str, beyond: float
) -> None:
    """The motions have sampling intervals of 0.01 and 0.004 s. Each run uses its largest time step
    within the chosen one: impulse4 uses several samples per step, and average acceleration steps
    below the sampling interval."""
    subject = Subject(OFFICE, method)
    step = building_step(subject, RECORDS, RUNS, CampaignSettings(), 0.01)
    assert step is not None
    assert step > beyond if beyond else step < 0.01
    coarse = results(subject, RUNS, step)
    drifts, true = (
        {(row.motion, row.scale, row.cells[0]): row.cells[2 + PEAK_DRIFT] for row in rows.stories}
        for rows in (coarse, fine)
    )
    assert len(drifts) == 10 * len(RUNS)
    assert max(abs(drifts[key] / true[key] - 1.0) for key in true) < 0.01
    for row in coarse.runs:
        assert step / 2 < row.dt <= step
        assert np.log2(row.dt / RECORDS[row.motion].dt) % 1.0 == 0.0


def test_building_step_is_minimum_of_steps_of_runs() -> None:
    """The minimum is taken over all four runs. A requested time step is an upper bound."""
    subject = Subject(OFFICE, "newmark-average")
    runs = [Run(motion, 1.0) for motion in range(4)]
    cases = [
        Case(subject.model, subject.prepared, RECORDS[run.motion], subject.integrator)
        for run in runs
    ]
    single = [choose_step(case, 0.05).dt for case in cases]
    assert len(set(single)) > 1
    assert building_step(subject, RECORDS, runs, CampaignSettings(), 0.05) == min(single)
    assert building_step(subject, RECORDS, runs, CampaignSettings(dt=0.0025), 0.05) == 0.0025
    largest = single.index(max(single))
    assert step_within(cases[largest], 0.05) == single[largest]
    assert step_within(cases[largest], 0.05, largest=min(single)) == min(single)


def test_collapsed_runs_do_not_affect_building_step() -> None:
    subject = Subject(tdint.load_model("configs/collapse-prone-frame.yaml"), "impulse4")
    collapses = [Run(0, 12.0), Run(1, 12.0), Run(2, 12.0)]
    assert {row.status for row in results(subject, collapses, 0.01).runs} == {"collapsed"}
    assert building_step(subject, RECORDS, collapses, CampaignSettings(), 0.01) is None
    alone = building_step(subject, RECORDS, [Run(0, 0.3)], CampaignSettings(), 0.01)
    assert alone is not None
    assert (
        building_step(subject, RECORDS, [*collapses, Run(0, 0.3)], CampaignSettings(), 0.01)
        == alone
    )
