"""Tests of the maxima between the samples against matrix exponentials, refined by Brent's method,
and of the definitions of PEER and USGS."""

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from building_cases import noise
from real_records import real_file
from references import OscillatorResponse
from selection import every
from tdint import read_record, spectrum
from tdint.ground_motion.record import Record

ROOT = Path(__file__).parents[3]
INCH = 0.0254


def values(result):
    return np.array([result.sd, result.sv, result.sa])


def reference(record, periods, damping=0.05):
    return np.stack(
        [OscillatorResponse(record, 2.0 * math.pi / t, damping).largest() for t in periods], axis=1
    )


@pytest.mark.parametrize(
    ("name", "component", "periods"),
    every(
        3,
        [
            ("firm-soil", "HN1", [0.01, 0.017, 0.033, 0.07, 0.4, 10.0]),
            ("near-fault", "HN2", [0.012, 0.022, 0.05, 0.15, 1.0, 4.0]),
            ("soft-soil", "HN1", [0.015, 0.1, 2.0]),
        ],
    ),
)
def test_maxima_of_shipped_records(name, component, periods):
    record = read_record(ROOT / "records" / f"{name}.mseed", component=component, units="m/s^2")
    measured = values(spectrum(record, np.array(periods)))
    np.testing.assert_allclose(measured, reference(record, periods), rtol=1e-9)


@pytest.mark.parametrize("name", ["elCentro1940_180.at2", "RSN763_LOMAP_GIL067.AT2"])
def test_maxima_of_real_records(name):
    record = read_record(real_file(name))
    periods = [0.01, 0.021, 0.045, 0.1, 0.5, 2.0, 10.0]
    measured = values(spectrum(record, np.array(periods)))
    np.testing.assert_allclose(measured, reference(record, periods), rtol=1e-9)


@pytest.mark.long
@settings(max_examples=30, deadline=None)
@given(
    seed=st.integers(0, 2**32 - 1),
    samples=st.integers(2, 90),
    period=st.floats(0.06, 300.0),  # in sampling intervals
    damping=st.sampled_from([0.0, 0.001, 0.05, 0.3, 0.99]),
)
# If the displacement has a maximum in the first step from rest, it is far smaller than the terms of
# the series.
@example(seed=0, samples=2, period=19.0, damping=0.0)
@example(seed=0, samples=2, period=115.0, damping=0.0)
def test_maxima_of_white_noise(seed, samples, period, damping):
    """White noise is the most difficult motion to search, because every sample is a kink."""
    noise = np.random.default_rng(seed).standard_normal(samples)
    # The free vibration after the noise is part of both results.
    noise = np.append(noise, np.zeros(math.ceil(period) + 1))
    record = Record(noise, 0.02, "", "", "", "")
    measured = values(spectrum(record, np.array([0.02 * period]), damping))
    parts = max(20, math.ceil(30.0 / period))
    exact = OscillatorResponse(record, 100.0 * math.pi / period, damping).largest(parts)
    np.testing.assert_allclose(measured[:, 0], exact, rtol=1e-8)


def test_two_extremes_within_one_sampling_interval():
    """The velocity has the same sign at both samples and the opposite sign between the samples,
    near the end of the record."""
    record = Record(np.array([8.0, -6.0, 3.0, -5.0]), 1.0, "", "", "", "")
    periods = np.linspace(4.4, 4.6, 9)
    quiet = Record(np.append(record.acceleration, np.zeros(12)), 1.0, "", "", "", "")
    np.testing.assert_allclose(
        values(spectrum(record, periods, 0.0)), reference(quiet, periods, 0.0), rtol=1e-9
    )


def test_maximum_after_last_sample_is_found():
    """The record ends within a pulse, so that the displacement still grows at its last sample."""
    record = Record(np.linspace(0.0, 1.0, 40), 0.01, "", "", "", "")
    result = spectrum(record, np.array([5.0]))
    at_last = abs(OscillatorResponse(record, 0.4 * math.pi, 0.05).at(1.0)[0, -1])
    assert result.sd[0] > 5.0 * at_last
    quiet = Record(np.append(record.acceleration, np.zeros(300)), 0.01, "", "", "", "")
    expected = reference(quiet, np.array([5.0]))
    np.testing.assert_allclose(values(result), expected, rtol=1e-9)


@pytest.mark.parametrize(
    ("maxima", "steps_per_period"), [("peer", 10.0), ("samples", 0.0)], ids=["peer", "usgs"]
)
def test_maxima_at_samples(maxima, steps_per_period):
    """The definition of PEER uses ten or more steps per period, that of USGS the step of the
    record."""
    record = noise(samples=401)
    for period in (0.01, 0.013, 0.04, 0.05, 0.0999, 0.1, 0.7):
        parts = max(1, math.ceil(steps_per_period * record.dt / period - 1e-9))
        measured = values(spectrum(record, np.array([period]), maxima=maxima))[:, 0]
        expected = OscillatorResponse(record, 2.0 * math.pi / period, 0.05).sampled(parts)
        np.testing.assert_allclose(measured, expected, rtol=1e-9)


def test_peak_displacements_of_el_centro_1940():
    """The peaks agree with Chopra, Dynamics of Structures, section 6.4, to 0.03 inches, and the
    maxima at the samples to three digits."""
    record = read_record(real_file("elCentro1940_180.at2"))
    g = 386.4 * INCH
    ground = np.append(0.0, record.acceleration) * (g / 9.80665)
    record = replace(record, acceleration=ground)
    for period, damping, published, recomputed in (
        (0.5, 0.02, 2.67, 2.676),
        (1.0, 0.02, 5.97, 5.971),
        (2.0, 0.02, 7.47, 7.471),
        (2.0, 0.00, 9.91, 9.919),
        (2.0, 0.05, 5.37, 5.375),
    ):
        assert spectrum(record, np.array([period]), damping).sd[0] / INCH == pytest.approx(
            published, abs=0.03
        )
        sampled = spectrum(record, np.array([period]), damping, maxima="samples").sd[0] / INCH
        assert sampled == pytest.approx(recomputed, abs=0.0006)  # fmt: skip
