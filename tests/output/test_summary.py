"""summary.json: valid JSON, null for missing numbers, meanings of all values."""

import json
import math
from dataclasses import replace

import numpy as np
import pytest

from building_cases import (
    ModalDamping,
    RayleighCoefficients,
    RayleighRatio,
    model,
    noise,
    ten_bilinear,
    ten_linear,
)
from story_values import story_values
from tdint import prepare, run_case, spectrum
from tdint.model.building import assemble
from tdint.output.run_summary import MEANINGS, failure_summary, peak_errors, run_summary
from tdint.output.summary import json_bytes
from tdint.response.runs.outcome import FailedRun, StoryErrors, StoryPeaks
from tdint.response.spectra.elastic import first_mode


def test_json_has_twelve_digits_null_and_ordered_keys():
    name = "Köln " + b"\xff".decode("utf-8", "surrogateescape")
    assert json.loads(json_bytes({"file": name})) == {"file": name}
    content = {
        "b": 1 / 3,
        "a": math.nan,
        "c": [math.inf, np.float64(0.1), -0.0],
        "d": {"x": True, "y": None, "z": 7},
    }
    data = json_bytes(content)
    assert data.decode().splitlines()[:3] == ["{", '  "b": 0.333333333333,', '  "a": null,']
    assert data.endswith(b"}\n")
    assert json.loads(data) == {
        "b": 0.333333333333, "a": None, "c": [None, 0.1, 0.0], "d": {"x": True, "y": None, "z": 7},
    }  # fmt: skip


def test_the_error_of_a_maximum_includes_all_stories_that_may_govern():
    nan = math.nan
    values = np.array([1.0, 3.0, 2.9])
    stories = story_values(
        StoryPeaks,
        height=np.array([nan, 10.0, 29.0]),
        peak_drift=values,
        peak_drift_ratio=np.array([nan, 0.3, 0.1]),
        residual_drift=-values,
        peak_shear=values,
        peak_damper_force=values,
        peak_total_shear=values,
        ductility=np.full(3, nan),
        peak_displacement=values,
        peak_velocity=values,
        peak_absolute_acceleration=values,
    )
    errors = story_values(
        StoryErrors,
        peak_drift=np.array(
            [1.5, 0.01, 0.2]
        ),  # The third value may exceed the second, the first may not.
        peak_drift_ratio=np.array([nan, 0.01, 0.1]),
        residual_drift=np.array([2.5, 0.0, 0.0]),
        peak_shear=np.array([7.0, 8.0, 9.0]),
        peak_damper_force=np.array([0.1, 0.2, 0.4]),
        peak_total_shear=np.array([6.0, 8.0, 9.0]),
        ductility=np.full(3, nan),
        peak_displacement=np.array([4.0, 5.0, 6.0]),
        peak_velocity=values,
        peak_absolute_acceleration=np.full(3, nan),
    )
    expected = {
        "roof_displacement_m_error": 6.0, "base_shear_N_error": 7.0,
        "total_base_shear_N_error": 6.0, "drift_m_error": 0.2, "drift_ratio_error": 0.01,
        "residual_drift_m_error": 2.5, "residual_drift_ratio_error": 0.0,
        "ductility_error": None, "peak_absolute_acceleration_m_s2_error": None,
        "peak_damper_force_N_error": 0.4,
    }  # fmt: skip
    found = peak_errors(stories, errors)
    assert {name: found[name] for name in expected} == expected


@pytest.mark.parametrize(
    "damping",
    [
        None,
        RayleighRatio((0.05, 0.04), (1, 3)),
        RayleighCoefficients(0.1, 1e-3),
        ModalDamping((0.05, 0.02, 0.01)),
    ],
)
def test_every_number_of_a_summary_has_a_meaning(damping):
    building = replace(ten_bilinear(damping), p_delta=True)
    case = prepare(building, noise(samples=101).scaled(3.0), method="impulse4")
    first = first_mode(case.record, case.building)
    summary = run_summary(run_case(case, check=True), [], 1.0, first=first, settings={"dt_s": 0.01})
    assert set(summary["meanings"]) <= set(MEANINGS)
    assert summary["meanings"]["peak_absolute_acceleration_m_s2"]["unit"] == "m/s^2"
    assert summary["record"]["scale"] == 3.0
    assert json.loads(json_bytes(summary))["settings"] == {"dt_s": 0.01}


def test_the_residual_oscillation_at_the_end_is_the_maximum_of_the_stories():
    response = replace(
        run_case(prepare(ten_linear(), noise(samples=101))),
        residual_oscillation=np.array([0.1, 0.3, 0.2]),
    )
    summary = run_summary(response, [], 1.0, first=first_mode(None, assemble(ten_linear())))
    assert summary["at_end"] == {
        "residual_oscillation_m": 0.3,
        "residual_oscillation_story": 2,
        "time_at_rest_s": None,
    }


def test_every_number_of_a_failure_has_a_meaning():
    case = prepare(ten_linear(), noise(samples=101), method="central-difference")
    with pytest.raises(FailedRun) as caught:
        run_case(case, dt=0.05)
    summary = failure_summary(
        caught.value, case.model, case.record, [], 1.0, first=first_mode(None, case.building)
    )
    assert summary["meanings"]["largest_stable_dt_s"]["unit"] == "s"
    assert "sa_t1_m_s2" not in summary["building"]


@pytest.mark.parametrize(
    "damping", [None, RayleighRatio((0.05, 0.04), (1, 3)), ModalDamping((0.05,))]
)
def test_the_first_mode_equals_the_first_of_all_modes(damping):
    for stories in (1, 2, 10):
        story = ten_bilinear().stories[0]
        damped = damping if stories > 2 or not isinstance(damping, RayleighRatio) else None
        building = assemble(model([story] * stories, damping=damped, p_delta=True))
        first = first_mode(noise(samples=101), building)
        modes = building.modes()
        assert first.period == pytest.approx(2.0 * np.pi / modes.omega[0], rel=1e-13)
        ratio = modes.modal_damping(building.damping_matrix())[0, 0] / (2.0 * modes.omega[0])
        assert first.damping == pytest.approx(ratio, rel=1e-9, abs=1e-15)
        exact = spectrum(noise(samples=101), np.array([first.period]), 0.05).psa[0]
        assert (first.sa, first.sa_damping) == (exact, 0.05)
