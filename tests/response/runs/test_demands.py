"""Tests of the largest demands of runs, computed by hand for given peaks of stories, for two runs
and for a story without height."""

import math

import numpy as np
import pytest

import tdint
from tdint.kernels import layout as rows
from tdint.model.building import assemble
from tdint.response.runs.demands import DECLARED, demands, demands_of_runs
from tdint.response.runs.outcome import STORY_QUANTITIES, StoryErrors, StoryPeaks, story_values
from tdint.response.runs.run_values import demand_cells

HEIGHT = np.array([4.0, math.nan, 2.5])
RANDOM = np.random.default_rng(2)
VALUES = {
    declared_quantity.name: RANDOM.uniform(0.5, 2.0, (2, 3))
    for declared_quantity in STORY_QUANTITIES
}
VALUES["residual_drift"] *= np.array([-1.0, 1.0, -1.0])
VALUES["peak_drift_ratio"] = VALUES["peak_drift"] / HEIGHT
PEAKS = StoryPeaks(**VALUES, height=HEIGHT, isolator=np.zeros(3))


def largest(numbers):
    """Return the maximum and its number, counted from 1, without nan values; nan and 0 if all
    values are nan."""
    known = [
        (value, number) for number, value in enumerate(numbers, start=1) if not math.isnan(value)
    ]
    return max(known) if known else (math.nan, 0)


def expected_demands(run):
    values_of_run = {name: values[run].tolist() for name, values in VALUES.items()}
    residual = [abs(value) for value in values_of_run["residual_drift"]]
    return {
        "roof_displacement": (values_of_run["peak_displacement"][2], 3),
        "base_shear": (values_of_run["peak_shear"][0], 1),
        "total_base_shear": (values_of_run["peak_total_shear"][0], 1),
        "drift": largest(values_of_run["peak_drift"]),
        "isolator_displacement": (math.nan, 0),
        "drift_ratio": largest(
            [
                value / height
                for value, height in zip(values_of_run["peak_drift"], HEIGHT, strict=True)
            ]
        ),
        "residual_drift": largest(residual),
        "residual_drift_ratio": largest(
            [value / height for value, height in zip(residual, HEIGHT, strict=True)]
        ),
        "ductility": largest(values_of_run["ductility"]),
        "peak_absolute_acceleration": largest(values_of_run["peak_absolute_acceleration"]),
    }


def test_maximum_demands_and_their_positions():
    found = demands_of_runs(PEAKS)
    assert {declared.name for declared in DECLARED} == set(expected_demands(0))
    for run in (0, 1):
        single = demands(
            StoryPeaks(
                **{name: values[run] for name, values in VALUES.items()},
                height=HEIGHT,
                isolator=np.zeros(3),
            )
        )
        for name, expected in expected_demands(run).items():
            demand = getattr(found, name)
            assert (demand.value[run], demand.location[run]) == pytest.approx(
                expected, nan_ok=True
            ), name
            value, location = getattr(single, name)
            assert (value, location or 0) == pytest.approx(expected, nan_ok=True), name


def test_demands_of_isolators_are_apart_from_drifts_of_stories():
    isolated = StoryPeaks(**VALUES, height=HEIGHT, isolator=np.array([0.0, 1.0, 0.0]))
    found = demands_of_runs(isolated)
    for run in (0, 1):
        drifts = VALUES["peak_drift"][run]
        assert (found.drift.value[run], found.drift.location[run]) == largest(
            [drifts[0], math.nan, drifts[2]]
        )
        assert found.isolator_displacement.value[run] == drifts[1]
        assert found.isolator_displacement.location[run] == 2
        assert found.residual_drift.location[run] != 2
    only_isolators = StoryPeaks(**VALUES, height=HEIGHT, isolator=np.ones(3))
    cells = demand_cells(only_isolators)[0]
    assert math.isnan(cells["peak_drift"])
    assert cells["peak_isolator_displacement"] == VALUES["peak_drift"][0].max()


def test_governing_story_without_heights_has_maximum_drift():
    bare = StoryPeaks(
        **VALUES | {"peak_drift_ratio": np.full((2, 3), math.nan)},
        height=np.full(3, math.nan),
        isolator=np.zeros(3),
    )
    assert [cells["peak_drift_story"] for cells in demand_cells(bare)] == [
        expected_demands(run)["drift"][1] for run in (0, 1)
    ]


def test_error_of_demand_covers_all_possible_maxima():
    values = {quantity.name: np.ones(3) for quantity in STORY_QUANTITIES} | {
        "peak_drift": np.array([1.0, 0.97, 0.5])
    }
    peaks = StoryPeaks(**values, height=np.array([4.0, 3.0, 2.5]), isolator=np.zeros(3))
    (drift,) = (quantity for quantity in DECLARED if quantity.name == "drift")
    (roof,) = (quantity for quantity in DECLARED if quantity.name == "roof_displacement")

    def errors(*names):
        return StoryErrors(**{quantity.name: np.array(names) for quantity in STORY_QUANTITIES})

    assert drift.error(peaks, errors(0.01, 0.02, 0.4)) == 0.01
    assert drift.error(peaks, errors(0.01, 0.03, 0.4)) == 0.03
    assert drift.error(peaks, errors(0.01, 0.03, 0.5)) == 0.5
    assert drift.error(peaks, errors(0.01, math.nan, 0.4)) == 0.01
    assert math.isnan(drift.error(peaks, errors(math.nan, math.nan, math.nan)))
    assert roof.error(peaks, errors(0.01, 0.03, 0.4)) == 0.4


@pytest.mark.parametrize("story", [{}, {"dashpot": 5.0}])
def test_unobserved_peaks_are_not_used(story):
    """Time loops compute drift rates only with dashpots, and forces of braces only with braces."""
    building = assemble(
        tdint.load_model({"stories": [{"mass": 10.0, "height": 3.0, "stiffness": 800.0, **story}]})
    )
    peaks = np.ones((rows.PEAK_ROWS, 1))
    missing = {rows.PEAK_BRACE_FORCE} | (set() if story else {rows.PEAK_DRIFT_RATE})
    peaks[list(missing)] = math.nan
    values = story_values(building, peaks, np.zeros(1))
    assert values["peak_damper_force"] == pytest.approx([story.get("dashpot", 0.0)])
    assert all(np.isfinite(value).all() for name, value in values.items() if name != "ductility")
