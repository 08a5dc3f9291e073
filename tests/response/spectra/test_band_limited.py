"""Band-limited interpolation compared with a windowed sum of sines with a known response in closed
form."""

import math

import numpy as np
import pytest

from selection import every
from tdint import spectrum
from tdint.ground_motion.processing_steps import band_limited
from tdint.ground_motion.record import Record

DT, SAMPLES = 0.01, 801
FREQUENCIES = np.array([1.3, 3.7, 9.1, 17.3, 28.9, 40.1])  # Hz; half the sampling rate is 50 Hz
AMPLITUDES = np.array([1.0, 1.0, 0.8, 0.8, 0.6, 0.6])
PHASES = np.array([0.5, 1.5, 5.0, 3.6, 0.6, 2.7])
WINDOW = {
    0: 3 / 8,
    1: -1 / 4,
    -1: -1 / 4,
    2: 1 / 16,
    -2: 1 / 16,
}  # (1 - cos(2 pi t / D))^2 / 4 by its frequencies
DAMPING = 0.05


DURATION = (SAMPLES - 1) * DT
OMEGA = 2.0 * math.pi * np.array([f + k / DURATION for f in FREQUENCIES for k in WINDOW])
"""Circular frequencies of the windowed motion, and complex amplitudes."""
WAVES = np.array(
    [
        a * w * np.exp(1j * p)
        for a, p in zip(AMPLITUDES, PHASES, strict=True)
        for w in WINDOW.values()
    ]
)


def motion(t):
    return (WAVES @ np.exp(1j * OMEGA[:, None] * t)).real


@pytest.fixture(scope="module")
def dense():
    """Return 100 times between each pair of samples, and the value of each wave at these times."""
    t = np.arange((SAMPLES - 1) * 100 + 1) * (DT / 100)
    return t, np.exp(1j * OMEGA[:, None] * t)


def response(period, t, turning):
    """Return the relative displacement and velocity and the absolute acceleration from rest, as the
    sum of forced waves and a free vibration."""
    omega = 2.0 * math.pi / period
    forced = -WAVES / (omega**2 - OMEGA**2 + 2j * DAMPING * omega * OMEGA)
    free = omega * (-DAMPING + 1j * math.sqrt(1.0 - DAMPING**2))
    u0, v0 = -forced.sum().real, -(1j * OMEGA @ forced).real
    amplitude = u0 - 1j * (v0 - free.real * u0) / free.imag
    decay = amplitude * np.exp(free * t)
    u = (forced @ turning + decay).real
    v = ((1j * OMEGA * forced) @ turning + free * decay).real
    return u, v, omega**2 * u + 2.0 * DAMPING * omega * v


def largest(values):
    """Return the largest absolute value at the vertices of the parabolas through three neighboring
    points."""
    before, here, after = values[:-2], values[1:-1], values[2:]
    top = (np.abs(here) >= np.abs(before)) & (np.abs(here) >= np.abs(after)) & (before != after)
    slope, bend = 0.5 * (after - before)[top], (after - 2.0 * here + before)[top]
    return np.max(np.abs(here[top] - 0.5 * slope**2 / bend))


@pytest.fixture(scope="module")
def record():
    return Record(motion(np.arange(SAMPLES) * DT), DT, "", "", "", "")


@pytest.mark.parametrize(
    ("period", "bound"),
    every(2, [(0.005, 1e-5), (0.01, 1e-5), (0.025, 5e-6), (0.1, 2e-6), (1.0, 2e-7), (10.0, 5e-7)]),
)
def test_band_limited_spectrum_agrees_with_continuous_motion(record, dense, period, bound):
    exact = [largest(values) for values in response(period, *dense)]
    result = spectrum(record, np.array([period]), DAMPING, interpolation="band-limited")
    np.testing.assert_allclose([result.sd[0], result.sv[0], result.sa[0]], exact, rtol=bound)
    if period < 0.3:  # and the lines between the samples are another motion
        assert (
            abs(spectrum(record, np.array([period]), DAMPING).psa[0] / result.psa[0] - 1.0) > 2e-3
        )


def test_band_limited_pga_agrees_with_continuous_motion(record, dense):
    exact = largest((WAVES @ dense[1]).real)
    result = spectrum(record, np.array([0.0]), DAMPING, interpolation="band-limited")
    assert result.psa[0] == result.sa[0] == pytest.approx(exact, rel=1e-5)
    assert record.pga < 0.999 * exact


@pytest.mark.parametrize("samples", [2, 3, 100, 257])
def test_band_limited_points_contain_samples_and_follow_sincs(samples):
    values = np.random.default_rng(samples).standard_normal(samples)
    points = band_limited(values, 5)
    np.testing.assert_allclose(points[::5], values, atol=1e-13)
    # The interpolation repeats the record after at least twice its length; the sum of sincs does
    # not repeat.
    t = np.arange(points.size) / 5
    plain = np.sinc(t[:, None] - np.arange(samples)) @ values
    assert np.max(np.abs(points - plain)) < 0.35


def test_zero_padded_motion_is_not_affected_by_periodicity():
    values = np.zeros(600)
    values[290:310] = np.hanning(20)
    points = band_limited(values, 4)
    t = np.arange(points.size) / 4
    plain = np.sinc(t[:, None] - np.arange(600)) @ values
    np.testing.assert_allclose(points, plain, atol=1e-5)
