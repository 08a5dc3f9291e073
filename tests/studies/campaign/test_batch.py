"""Runs of one building in a single compiled call equal separate runs of `tdint.run_case` to the
last digit."""

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import tdint
from selection import every
from tdint.ground_motion.joined import JoinedRecord
from tdint.ground_motion.record import Record
from tdint.response.pairs import Run
from tdint.response.runs.batch import Outcomes, Subject, run_batch
from tdint.response.runs.demands import DEMANDS, demands
from tdint.response.runs.outcome import STORY_QUANTITIES, FailedRun
from tdint.response.runs.prepared import PreparedBuilding
from tdint.response.runs.run_values import demand_errors
from tdint.response.runs.sequence import run_sequence
from tdint.studies.campaign.chunks import REPEATS, Batch, CampaignSettings, RunRow

RECORDS = {
    number: tdint.read_record(f"records/{name}.mseed", component=component, units="m/s^2")
    for number, (name, component) in enumerate([("firm-soil", "HN1"), ("near-fault", "HN2")])
}
SCALES = (0.5, -1.0, 4.0, 12.0)
RUNS = [Run(motion, scale) for motion in RECORDS for scale in SCALES]


def batch(model: str, method: str, **settings: bool | float) -> Batch:
    subject = Subject(tdint.load_model(f"configs/{model}.yaml"), method)
    return Batch(0, subject, RECORDS, dict.fromkeys(RECORDS), CampaignSettings(**settings))


def single(runs: Batch, run: Run, **wishes: float) -> tdint.response.runs.outcome.Response:
    case = tdint.prepare(
        runs.subject.model, RECORDS[run.motion].scaled(run.scale), method=runs.subject.method
    )
    return tdint.run_case(case, **wishes)


def rows_by_run(rows: list[RunRow]) -> dict[Run, RunRow]:
    found = {Run(row.motion, row.scale, row.sample): row for row in rows}
    assert len(found) == len(rows)
    return found


@pytest.mark.parametrize(
    ("model", "method"),
    every(2, [("ten-story-bilinear", "impulse4"), ("collapse-prone-frame", "newmark-average")]),
)
def test_rows_equal_single_runs(model: str, method: str) -> None:
    """The runs include completed runs, collapsed runs, and collapsed runs whose displacement then
    grows without bound."""
    subject_batch = batch(model, method, stories=True)
    results = subject_batch.results(RUNS)
    rows = rows_by_run(results.runs)
    assert set(rows) == set(RUNS)
    for run in RUNS:
        response, row = single(subject_batch, run), rows[run]
        found = demands(response.stories)
        assert (row.status, row.steps, row.energy_error) == (
            response.status,
            response.steps,
            response.energy.error,
        )
        assert (row.peak_drift_ratio, row.peak_drift_story) == found.drift_ratio
        floor = found.peak_absolute_acceleration
        assert (row.peak_absolute_acceleration, row.peak_acceleration_floor) == floor
        np.testing.assert_equal(
            (row.peak_drift, row.residual_drift_ratio, row.peak_isolator_displacement),
            (found.drift.value, found.residual_drift_ratio.value, math.nan),
        )
        assert (row.peak_roof_displacement, row.peak_base_shear) == (
            found.roof_displacement[0],
            found.base_shear[0],
        )
        assert row.pga == RECORDS[run.motion].pga * abs(run.scale)
        if response.collapse:
            assert (row.collapse_time, row.collapse_story) == (
                response.collapse.time,
                response.collapse.story,
            )
        stories = [
            story
            for story in results.stories
            if (story.motion, story.scale) == (run.motion, run.scale)
        ]
        number, _, *peaks = zip(*(story.cells for story in stories), strict=True)
        assert list(number) == list(range(1, len(subject_batch.subject.model.stories) + 1))
        for cells, quantity in zip(peaks, STORY_QUANTITIES, strict=True):
            np.testing.assert_array_equal(cells, getattr(response.stories, quantity.name))
    if model == "collapse-prone-frame":
        assert {"done", "collapsed"} <= {row.status for row in rows.values()}


@pytest.mark.parametrize(
    ("model", "method", "runs", "until_rest"),
    every(
        2,
        [
            ("ten-story-bilinear", "moment4", RUNS[:4], True),
            ("ten-story-bilinear", "impulse4", RUNS[:1], False),
            ("collapse-prone-frame", "moment4", RUNS[:4], False),
            ("collapse-prone-frame", "moment4", RUNS[1:4], True),
        ],
    ),
)
def test_errors_equal_errors_of_single_runs(
    model: str, method: str, runs: list[Run], until_rest: bool
) -> None:
    """Errors of every demand and story agree, for collapsed runs as well. The estimates do not
    change the runs."""
    results = batch(model, method, stories=True, check=True, until_rest=until_rest).results(runs)
    plain = batch(model, method, stories=True, until_rest=until_rest).results(runs)
    # Texts are compared, because missing values (nan) are unequal.
    assert str([row._replace(errors=()).changed(at_rest=0) for row in results.runs]) == str(
        [
            row.changed(at_rest=0)
            for row in sorted(plain.runs, key=lambda row: runs.index(Run(row.motion, row.scale)))
        ]
    )
    for row in results.runs:
        run = Run(row.motion, row.scale)
        stories = [
            item for item in results.stories if (item.motion, item.scale) == (row.motion, row.scale)
        ]
        response = single(batch(model, method), run, check=True, until_rest=until_rest)
        own = {item.name: item.error(response.stories, response.check.errors) for item in DEMANDS}
        named = (
            "drift_ratio", "drift", "isolator_displacement", "residual_drift_ratio",
            "peak_absolute_acceleration", "roof_displacement", "base_shear",
        )  # fmt: skip
        np.testing.assert_equal(row.errors, tuple(own[name] for name in named))
        for number, quantity in enumerate(STORY_QUANTITIES):
            np.testing.assert_array_equal(
                [item.cells[2 + len(STORY_QUANTITIES) + number] for item in stories],
                getattr(response.check.errors, quantity.name),
            )
    assert "collapsed" in {row.status for row in results.runs} or method == "impulse4"


@pytest.mark.parametrize("fixed", [0, 1])
def test_errors_of_events_in_sequence(fixed: int) -> None:
    """The errors apply to the complete sequence, or only to the last event if the first event
    defines the initial state of the building."""
    short = [
        replace(record, acceleration=record.acceleration[:1500]) for record in RECORDS.values()
    ]
    joined = JoinedRecord.of(short, 5.0, fixed=fixed)
    subject = Subject(tdint.load_model("configs/ten-story-bilinear.yaml"), "moment4")
    (row,) = (
        Batch(0, subject, {0: joined}, {0: None}, CampaignSettings(check=True))
        .results([Run(0, 1.0)])
        .runs
    )
    case = tdint.prepare(subject.model, short[0], method="moment4")
    sequence = run_sequence(case, short, rest=5.0, check=True)
    stories, errors = sequence.stories, sequence.check.errors
    if fixed:
        stories, errors = sequence.events[-1].stories, sequence.events[-1].errors
    assert row.peak_drift == np.max(stories.peak_drift)
    np.testing.assert_equal(row.errors, demand_errors(stories, errors))
    # The building has no isolators.
    assert [error >= 0.0 for error in row.errors] == [True, True, False, *[True] * 4]


def test_run_does_not_depend_on_other_runs() -> None:
    runs = batch("ten-story-bilinear", "impulse4")
    together = rows_by_run(runs.results(RUNS).runs)
    backwards = rows_by_run(runs.results(RUNS[::-1]).runs)
    single_runs = rows_by_run([runs.results([run]).runs[0] for run in RUNS])
    np.testing.assert_equal([backwards[run] for run in RUNS], [together[run] for run in RUNS])
    np.testing.assert_equal([single_runs[run] for run in RUNS], [together[run] for run in RUNS])


def test_failed_run_is_repeated_with_finer_steps() -> None:
    """The repeated run has the largest of the smaller time steps for which the run does not
    fail."""
    noise = Record(5.0 * np.random.default_rng(1).standard_normal(400), 0.1, "", "", "", "noise")
    model = tdint.load_model("configs/hardening.yaml")
    subject = Subject(model, "newmark-linear")
    runs = Batch(
        0,
        subject,
        {0: noise},
        {0: None},
        CampaignSettings(dt=0.1, duration=noise.duration),
    )
    (row,) = runs.results([Run(0, 3.0)]).runs
    case = tdint.prepare(model, noise.scaled(3.0), method="newmark-linear")
    for repeats in range(REPEATS + 1):
        dt = 0.1 / 2**repeats
        try:
            response = tdint.run_case(case, dt=dt, duration=noise.duration)
        except FailedRun as failure:
            assert row.repeats > repeats or (row.status, row.repeats) == (failure.status, REPEATS)
        else:
            assert (row.dt, row.repeats, row.status) == (dt, repeats, response.status)
            assert row.peak_drift == demands(response.stories).drift.value
            break
    assert row.repeats > 0


@pytest.mark.parametrize("method", ["newmark-linear", "newmark-average", "impulse4"])
def test_failed_attempt_is_integrated_once(method: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """The attempt is integrated in the batch. It is integrated again only for a run that collapses
    before its failure. The row equals the row of individual runs."""
    noise = Record(5.0 * np.random.default_rng(1).standard_normal(400), 0.1, "", "", "", "noise")
    settings = CampaignSettings(dt=0.1, duration=noise.duration)
    model = tdint.load_model("configs/hardening.yaml")
    runs = Batch(0, Subject(model, method), {0: noise}, {0: None}, settings)
    individual = []
    real = PreparedBuilding.integrate

    def counted(prepared: PreparedBuilding, *arguments: Any, **named: Any) -> Any:
        individual.append(arguments[1].h)
        return real(prepared, *arguments, **named)

    for scale in (3.0, 30.0, 3e3, 1e150):
        individual.clear()
        with monkeypatch.context() as patch:
            patch.setattr(PreparedBuilding, "integrate", counted)
            (row,) = runs.results([Run(0, scale)]).runs
        case = tdint.prepare(model, noise.scaled(scale), method=method)
        try:
            status = tdint.run_case(case, dt=row.dt, duration=noise.duration).status
        except FailedRun as failure:
            status = failure.status
        assert row.status == status
        assert len(individual) <= (row.status in ("collapsed", "failed-story"))


def test_chosen_steps_and_unreachable_tolerance() -> None:
    for method, largest, dt in (("newmark-average", 0.008, 0.005), ("impulse4", 0.05, 0.04)):
        runs = batch("ten-story-bilinear", method, **{"dt": 0.02} if dt < 0.02 else {})
        (row,) = runs.results([Run(0, 1.0)], max_step=largest).runs
        response = single(runs, Run(0, 1.0), dt=dt)
        assert (row.dt, row.steps, row.energy_error) == (dt, response.steps, response.energy.error)
        assert row.peak_drift == demands(response.stories).drift.value
    (row,) = runs.results([Run(0, 1.0)], max_step=None).runs
    assert (row.status, row.peak_drift) == ("not-within-tolerance", None)


@pytest.mark.parametrize(
    ("status", "expected"),
    [("diverged", REPEATS), ("not-converged", REPEATS), ("unstable-step", 0)],
)
def test_number_of_repetitions_of_failing_run(
    status: str, expected: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Each repetition halves the time step; finally, the row has the status of the failure."""
    of, steps = batch("hardening", "newmark-average"), []

    def failing(subject: Subject, runs: list[Any], **named: Any) -> Outcomes:
        steps.extend(run[2].h for run in runs)
        return replace(
            run_batch(subject, runs, **named), failures={0: FailedRun("", status, "", 0.1)}
        )

    monkeypatch.setattr("tdint.studies.campaign.chunks.run_batch", failing)
    (row,) = of.results([RUNS[0]]).runs
    assert (row.status, row.repeats, row.peak_drift) == (status, expected, None)
    assert steps == pytest.approx([steps[0] / 2.0**repeats for repeats in range(expected + 1)])
    assert row.dt == steps[-1]
