"""RotD spectra compared with the spectra of 180 rotated motions."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from building_cases import noise
from selection import every
from tdint import spectrum
from tdint.errors import AnalysisError, UsageError
from tdint.ground_motion.horizontals import Horizontals
from tdint.ground_motion.record import Record
from tdint.response.spectra.rotated import rotated_spectrum

ALL = tuple(range(101))
PERIODS = np.array([0.01, 0.03, 0.07, 0.2, 1.0, 5.0])


def pair(samples=301, seeds=(7, 8), second=0.6):
    first, perpendicular = (noise(samples=samples, seed=seed) for seed in seeds)
    return Horizontals(first, perpendicular.scaled(second))


def rotated(motion, degrees):
    angle = math.radians(degrees)
    first, second = motion.first.acceleration, motion.second.acceleration
    return replace(motion.first, acceleration=math.cos(angle) * first + math.sin(angle) * second)


def each_direction(motion, periods, damping=0.05, **choices):
    """Return the pseudo-accelerations of the motion rotated to each direction, shape (180, k)."""
    return np.array(
        [
            spectrum(rotated(motion, degrees), periods, damping, **choices).psa
            for degrees in range(180)
        ]
    )


@pytest.mark.parametrize(
    "choices",
    every(
        2,
        [{}, {"maxima": "peer"}, {"maxima": "samples"}, {"interpolation": "band-limited"}],
        ids=["exact", "peer", "samples", "band-limited"],
    ),
)
def test_percentiles_agree_with_rotated_motions(choices):
    motion = pair(samples=151) if "interpolation" in choices else pair()
    psa = each_direction(motion, PERIODS, **choices)
    result = rotated_spectrum(motion, PERIODS, 0.05, ALL, **choices)
    np.testing.assert_allclose(result.psa, np.percentile(psa, ALL, axis=0), rtol=1e-11)
    np.testing.assert_allclose(
        psa[result.angle.astype(int), np.arange(PERIODS.size)], psa.max(axis=0), rtol=1e-12
    )
    np.testing.assert_allclose(result.geometric_mean, np.sqrt(psa[0] * psa[90]), rtol=1e-12)


@settings(max_examples=6, deadline=None)
@given(
    seed=st.integers(0, 2**32 - 1),
    samples=st.integers(2, 120),
    period=st.floats(0.06, 300.0),  # in sampling intervals
    damping=st.sampled_from([0.0, 0.05, 0.7]),
    second=st.sampled_from([1.0, 1e-3]),
)
@pytest.mark.long
def test_percentiles_of_white_noise(seed, samples, period, damping, second):
    generator = np.random.default_rng(seed)
    first, perpendicular = (
        Record(generator.standard_normal(samples), 0.01, "", "", "", "") for _ in range(2)
    )
    motion, periods = Horizontals(first, perpendicular.scaled(second)), np.array([0.01 * period])
    result = rotated_spectrum(motion, periods, damping, (0, 50, 100))
    expected = np.percentile(each_direction(motion, periods, damping), (0, 50, 100), axis=0)
    np.testing.assert_allclose(result.psa, expected, rtol=1e-9)


@pytest.mark.parametrize("interpolation", ["linear", "band-limited"])
def test_period_zero_is_peak_in_each_direction(interpolation):
    motion = pair(samples=101)
    result = rotated_spectrum(
        motion, np.array([0.0, 1.0]), 0.05, (0, 50, 100), interpolation=interpolation
    )
    peaks = [
        spectrum(rotated(motion, d), np.array([0.0]), interpolation=interpolation).psa[0]
        for d in range(180)
    ]
    np.testing.assert_allclose(result.psa[:, 0], np.percentile(peaks, (0, 50, 100)), rtol=1e-12)
    assert result.angle[0] == np.argmax(peaks)


@pytest.mark.parametrize("percentiles", [(), (-1,), (50, 101)])
def test_percentiles_out_of_range_are_refused(percentiles):
    with pytest.raises(UsageError, match="percentiles must be from 0 to 100"):
        rotated_spectrum(pair(samples=21), PERIODS, 0.05, percentiles)


@pytest.mark.parametrize(
    ("periods", "damping", "choices", "error", "message"),
    [
        ([-1.0], 0.05, {}, UsageError, "periods must be numbers"),
        (PERIODS, 1.5, {}, UsageError, "damping must be"),
        (PERIODS, 0.05, {"maxima": "best"}, UsageError, "maxima must be one of"),
        ([1e-5], 0.05, {}, AnalysisError, r"less than 0\.05 sampling intervals"),
    ],
)
def test_invalid_arguments_are_refused(periods, damping, choices, error, message):
    with pytest.raises(error, match=message):
        rotated_spectrum(pair(samples=21), np.array(periods), damping, **choices)
