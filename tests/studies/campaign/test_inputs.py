"""Inputs of a campaign before the first run: overrides, damage demands, inventories, differences,
motions, levels and scaling."""

import math
import pickle
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.linalg import eigh

from building_cases import model, noise, story
from tdint.errors import ModelError, UsageError
from tdint.ground_motion.horizontals import Horizontals
from tdint.response.pairs import recording_numbers
from tdint.response.runs.damage import divisor_and_period as type_of_model
from tdint.response.spectra.target import TargetSpectrum, read_target
from tdint.studies.campaign.definition import AnalysisOverrides, InventoryFile
from tdint.studies.campaign.inputs import adapted, read_rows
from tdint.studies.motions.intensity import sa
from tdint.studies.motions.scaling import scale, scale_p695
from tdint.studies.store.result_store import all_differences, differences

HEIGHTS = (4.0, 3.0, 3.5)
BUILDING = model(
    [story(1.0 + i, 500.0 - 40.0 * i, height=height) for i, height in enumerate(HEIGHTS)]
)
WITHOUT = replace(
    BUILDING,
    stories=tuple(replace(building_story, height=None) for building_story in BUILDING.stories),
)
HALF = replace(BUILDING, stories=(*BUILDING.stories[:2], WITHOUT.stories[2]))


def test_analysis_overrides_apply_to_all_buildings() -> None:
    for building in (BUILDING, WITHOUT):
        assert adapted(building, AnalysisOverrides()) == building
        assert adapted(building, AnalysisOverrides(p_delta=False)) == replace(
            building, p_delta=False
        )
        assert adapted(building, AnalysisOverrides(collapse_drift=0.04)) == replace(
            building, collapse_drift=0.04
        )
    both = adapted(BUILDING, AnalysisOverrides(collapse_drift=0.04, p_delta=True))
    assert both == replace(BUILDING, collapse_drift=0.04, p_delta=True)
    for bare in (WITHOUT, HALF):
        with pytest.raises(ModelError, match=r"test: p_delta .*heights"):
            adapted(bare, AnalysisOverrides(p_delta=True))


def test_damage_demands_use_first_mode_and_height() -> None:
    """The participation factor of a mode that is 1 at the roof is computed with the matrices of the
    same chain."""
    masses = np.array([building_story.mass for building_story in BUILDING.stories])
    springs = [building_story.stiffness for building_story in BUILDING.stories]
    stiffness = (
        np.diag(springs)
        + np.diag([*springs[1:], 0.0])
        - np.diag(springs[1:], 1)
        - np.diag(springs[1:], -1)
    )
    values, vectors = eigh(stiffness, np.diag(masses))
    first = vectors[:, 0]
    first = first / first[-1]
    period = 2.0 * math.pi / math.sqrt(values[0])
    participation = masses @ first / (masses @ first**2)
    divisors = {
        "drift_ratio": 1.0,
        "roof_drift_ratio": 10.5,
        "acceleration": 1.0,
        "spectral_displacement": participation,
    }
    for demand, divisor in divisors.items():
        assert type_of_model(BUILDING, demand) == pytest.approx((divisor, period), rel=1e-9)
    assert type_of_model(HALF, "drift_ratio")[1] == pytest.approx(period)
    for bare, demand in (
        (WITHOUT, "drift_ratio"),
        (WITHOUT, "roof_drift_ratio"),
        (HALF, "roof_drift_ratio"),
    ):
        with pytest.raises(
            ModelError, match=f"test: damage by {demand} requires the heights of the stories"
        ):
            type_of_model(bare, demand)


def test_inventory_without_buildings_is_refused(tmp_path: Path) -> None:
    file = tmp_path / "none.csv"
    file.write_text("id,NumberOfStories,YearBuilt,StructureType,PlanArea\n")
    with pytest.raises(ModelError, match=r"none.csv: .*no buildings"):
        read_rows(InventoryFile(str(file), "mdof-lu", 1.0))


def test_at_most_eight_differences_per_type_are_reported() -> None:
    labels = "the store", "a.yaml"
    assert differences(
        {"a": "1", "b": "2", "c": "3"},
        {"b": "9", "c": "3", "d": "4"},
        "setting",
        labels,
    ) == [
        "setting a: only in the store",
        "setting b: 2 in the store, 9 in a.yaml",
        "setting d: only in a.yaml",
    ]
    assert differences({"a": "1f"}, {"a": "2f"}, "building", labels) == ["building a: differs"]
    for count in (8, 9, 20):
        first, second = ({f"r{i}": value for i in range(count)} for value in ("1", "2"))
        found = differences(first, second, "record", labels)
        assert found[:8] == [f"record r{i}: differs" for i in range(8)]
        assert found[8:] == (
            [] if count == 8 else [f"and {count - 8} more differences of type record"]
        )
    same = ({"a": "1"}, {}, {"r": "2"}, {})
    assert (
        all_differences(same, same, ("the store", "b"))
        == "the order of buildings or records differs"
    )
    assert all_differences(same, ({"a": "2"}, {}, {}, {}), ("the store", "b")).splitlines() == [
        "setting a: 1 in the store, 2 in b",
        "record r: only in the store",
    ]


def test_components_of_motion_are_identified_by_names() -> None:
    """Two perpendicular components with the same name are a pair. A single component, three
    components, and parallel or unnamed components are not."""
    records = {
        1: ("a_N.at2", "N", 0), 2: ("a_E.at2", "E", 0), 3: ("b_N.at2", "N", 0),
        4: ("c.mseed", "HN1", 0), 5: ("c.mseed", "HN2", 0), 6: ("d.mseed", "HNE", 0),
        7: ("d.mseed", "270", 0), 8: ("e.csv", "000", 0), 9: ("e.csv", "090", 0),
        10: ("e.csv", "180", 0), 11: ("f+g", "x", 1), 12: ("f+g", "x", 2),
    }  # fmt: skip
    alone = {number: number for number in records}
    assert recording_numbers(records) == alone | {2: 1, 5: 4, 12: 11}


@pytest.fixture
def pairs() -> list[Horizontals]:
    return [
        Horizontals(
            *(
                replace(noise(samples=100, seed=seed + i), component=name)
                for i, name in enumerate(("HNE", "HNN"))
            )
        )
        for seed in (1, 5, 9)
    ]


@pytest.mark.long
def test_scale_with_rule_equals_rule_function(pairs: list[Horizontals]) -> None:
    def same(result: object, expected: object) -> None:
        assert (result.rule, result.pair, result.damping, result.measure, result.value) == (
            expected.rule, expected.pair, expected.damping, expected.measure, expected.value
        )  # fmt: skip
        np.testing.assert_array_equal(result.factors, expected.factors)

    same(scale(pairs, rule="p695"), scale_p695(pairs))
    same(
        scale(pairs, "sa(0.7)", 3.0, rule="p695", damping=0.03),
        scale_p695(pairs, sa(0.7), 3.0, damping=0.03),
    )
    for measure in ("pga", "pgv", "sa-avg(1)"):
        with pytest.raises(UsageError, match="the rule p695 scales a set to a value of") as caught:
            scale(pairs, measure, 3.0, rule="p695")
        assert f"got {measure}; specify" in str(caught.value)
    target = TargetSpectrum("table", np.array([0.5, 0.7, 1.0]), np.array([5.0, 4.0, 2.0]))
    grid_periods = np.geomspace(0.5, 1.0, 100)
    rule = {"target": target, "damping": 0.2}
    same(
        scale(4 * pairs, **rule, rule="asce7"),
        scale(4 * pairs, **rule, rule="asce7", periods=grid_periods),
    )
    for wrong in ({}, {"measure": "pga"}, {"value": 3.0}):
        with pytest.raises(UsageError, match="scale requires an intensity measure"):
            scale(pairs, **wrong)
    for wrong in ({"measure": "pga"}, {"value": 3.0}):
        with pytest.raises(UsageError, match="target and a value"):
            scale(pairs, target=target, **wrong)
    with pytest.raises(UsageError, match=r"'p695'; .* mean, asce7, ec8"):
        scale(pairs, target=target, rule="p695")


def test_targets_are_picklable() -> None:
    for target in (
        TargetSpectrum("table", np.array([0.2, 1.0]), np.array([5.0, 4.0]), 2.0, 0.05),
        read_target("asce7:sds=1.0,sd1=0.6,tl=8"),
    ):
        other = pickle.loads(pickle.dumps(target))
        assert (other.source, other.zero, other.damping) == (
            target.source,
            target.zero,
            target.damping,
        )
        assert (other.curve is None) == (target.curve is None)
        np.testing.assert_array_equal(other.psa, target.psa)
        np.testing.assert_allclose(target.sd, target.psa / (2.0 * math.pi / target.periods) ** 2)
