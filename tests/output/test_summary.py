"""summary.json: valid JSON, null for what is no number, hashes of the inputs."""

from __future__ import annotations

import json
import math

import numpy as np

from tdint.analysis.run.run import StoryErrors, StoryPeaks
from tdint.output.summaries.summary import json_bytes, overall_errors, overall_peaks


def test_json_has_twelve_digits_null_and_the_order_of_its_keys():
    content = {"b": 1 / 3, "a": math.nan, "c": [math.inf, np.float64(0.1), -0.0], "d": {"x": True, "y": None, "z": 7}}
    data = json_bytes(content)
    assert data.decode().splitlines()[:3] == ["{", '  "b": 0.333333333333,', '  "a": null,']
    assert data.endswith(b"}\n")
    assert json.loads(data) == {
        "b": 0.333333333333,
        "a": None,
        "c": [None, 0.1, 0.0],
        "d": {"x": True, "y": None, "z": 7},
    }


def test_names_of_any_bytes_are_valid_json():
    name = "Köln " + b"\xff".decode("utf-8", "surrogateescape")
    assert json.loads(json_bytes({"file": name})) == {"file": name}


def test_overall_peaks_name_story_and_pass_over_what_is_missing():
    nan = math.nan
    three = np.array([1.0, 3.0, 2.0])
    peaks = overall_peaks(
        StoryPeaks(
            height=np.array([nan, 3.0, 3.0]),
            peak_drift=three,
            peak_drift_ratio=np.array([nan, 0.1, 0.2]),
            residual_drift=np.array([0.0, 0.1, -0.5]),
            peak_shear=three * 10.0,
            ductility=np.full(3, nan),
            peak_displacement=np.array([0.1, 0.2, 0.15]),
            peak_velocity=three,
            peak_acceleration=np.array([4.0, 1.0, 2.0]),
        )
    )
    assert peaks == {
        "roof_displacement_m": 0.15,
        "base_shear_N": 10.0,
        "drift_m": 3.0,
        "drift_story": 2,
        "drift_ratio": 0.2,
        "drift_ratio_story": 3,
        "residual_drift_m": 0.5,
        "residual_drift_story": 3,
        "ductility": None,
        "ductility_story": None,
        "floor_acceleration_m_s2": 4.0,
        "floor_acceleration_floor": 1,
    }


def test_the_error_of_a_largest_peak_is_that_of_any_story_that_may_have_it():
    nan = math.nan
    values = np.array([1.0, 3.0, 2.9])
    stories = StoryPeaks(values, values, np.array([nan, 0.3, 0.1]), -values, values, np.full(3, nan), *[values] * 3)
    errors = StoryErrors(
        peak_drift=np.array([1.5, 0.01, 0.2]),  # the third may be larger than the second, the first may not
        peak_drift_ratio=np.array([nan, 0.01, 0.1]),
        residual_drift=np.array([2.5, 0.0, 0.0]),
        peak_shear=np.array([7.0, 8.0, 9.0]),
        ductility=np.full(3, nan),
        peak_displacement=np.array([4.0, 5.0, 6.0]),
        peak_velocity=values,
        peak_acceleration=np.full(3, nan),
    )
    assert overall_errors(stories, errors) == {
        "roof_displacement_m": 6.0,
        "base_shear_N": 7.0,
        "drift_m": 0.2,
        "drift_ratio": 0.01,
        "residual_drift_m": 2.5,
        "ductility": None,
        "floor_acceleration_m_s2": None,
    }
