"""Elastic spectra: limits, invariances and methods; values are tested in
tests/response/spectra/test_exact_maxima.py."""

import math

import numpy as np
import pytest

from building_cases import noise, oscillator
from references import finer
from tdint import run, spectrum
from tdint.errors import AnalysisError, UsageError

PERIODS = np.array([0.01, 0.03, 0.1, 0.35, 1.0, 3.0, 10.0])


def test_five_quantities_agree_with_one_story_building():
    """The one-story building is integrated exactly, and its acceleration follows from
    equilibrium."""
    record = noise()
    omega = 2.0 * math.pi / PERIODS
    result = spectrum(record, PERIODS, 0.05, maxima="samples", method="exact")
    for i, w in enumerate(omega):
        history = run(oscillator(w, 0.05), record, method="exact", history=True).history
        assert result.sd[i] == pytest.approx(np.max(np.abs(history.displacement)), rel=1e-9)
        assert result.sv[i] == pytest.approx(np.max(np.abs(history.velocity)), rel=1e-9)
        assert result.sa[i] == pytest.approx(
            np.max(np.abs(history.absolute_acceleration)), rel=1e-8
        )
    assert result.psv == pytest.approx(omega * result.sd, rel=1e-14)
    assert result.psa == pytest.approx(omega**2 * result.sd, rel=1e-14)


def test_rigid_oscillator_follows_ground():
    record = noise(samples=201)
    for interpolation in ("linear", "band-limited"):
        result = spectrum(record, np.array([0.5, 0.0]), 0.05, interpolation=interpolation)
        assert (result.sd[1], result.psv[1], result.sv[1]) == (0.0, 0.0, 0.0)
        assert result.psa[1] == result.sa[1] == pytest.approx(record.pga, rel=1e-3)
        assert result.sd[0] == spectrum(record, 0.5, interpolation=interpolation).sd[0]
    rigid = spectrum(record, np.array([0.0]))
    assert rigid.psa[0] == rigid.sa[0] == record.pga


@pytest.mark.parametrize("count", [1, 2, 15, 55, 56, 57, 100, 200])
def test_spectrum_does_not_depend_on_number_of_periods(count):
    """Oscillators are integrated in groups, and each result equals the result for a single
    oscillator."""
    record = noise(samples=301)
    periods = np.geomspace(0.05, 5.0, count)
    together = spectrum(record, periods).sd
    alone = [spectrum(record, period).sd[0] for period in periods[:: max(1, count // 7)]]
    np.testing.assert_allclose(together[:: max(1, count // 7)], alone, rtol=1e-12)


def test_spectrum_by_other_method_converges_to_exact_spectrum():
    """The time step is halved by adding samples on the straight lines of the record, which does not
    change the motion."""
    record = noise(samples=801)
    periods = np.array([0.4, 1.0, 2.5])
    errors = []
    for parts in (1, 2, 4):
        motion = finer(record, parts)
        exact = spectrum(motion, periods)
        measured = spectrum(motion, periods, method="newmark-average")
        assert measured.method == "newmark-average"
        errors.append(np.max(np.abs(measured.sd / exact.sd - 1.0)))
    assert np.log2(errors[1] / errors[2]) == pytest.approx(2.0, abs=0.05)
    assert (
        np.max(
            np.abs(
                spectrum(record, periods, method="impulse4").sd / spectrum(record, periods).sd - 1
            )
        )
        < 1e-5
    )


def test_unstable_method_is_refused():
    with pytest.raises(AnalysisError, match=r"central-difference .*unstable .* 0\.01 s"):
        spectrum(noise(samples=201), PERIODS, method="central-difference")
    stable = spectrum(noise(samples=201), PERIODS[3:], method="central-difference")
    assert np.all(np.isfinite(stable.sd))


@pytest.mark.parametrize(
    ("periods", "damping", "choices", "message"),
    [
        ([1.0, -1.0], 0.05, {}, "periods must be numbers of seconds"),
        ([math.nan], 0.05, {}, "periods must be numbers of seconds"),
        ([], 0.05, {}, "periods must be numbers of seconds"),
        ([1.0], 1.0, {}, "damping must be a ratio"),
        ([1.0], -0.1, {}, "damping must be a ratio"),
        ([1.0], 0.05, {"maxima": "best"}, "maxima .*exact, peer, samples, got 'best'"),
        ([1.0], 0.05, {"interpolation": "cubic"},
         "interpolation .*linear, band-limited, got 'cubic'"),
        ([1.0], 0.05, {"method": "newmark", "maxima": "exact"},
         "cannot be selected for the method newmark"),
        ([1.0], 0.05, {"method": "newmark", "interpolation": "band-limited"},
         "cannot be selected for the method newmark"),
        (*([1.0], 0.05, {"maxima": "peer", "interpolation": "band-limited"}),
         "maxima peer require the interpolation linear"),
    ],
)  # fmt: skip
def test_invalid_arguments_are_refused(periods, damping, choices, message):
    with pytest.raises(UsageError, match=message):
        spectrum(noise(samples=21), np.array(periods), damping, **choices)


@pytest.mark.parametrize(
    ("choices", "expected"),
    [
        ({}, ("exact", "exact", "linear")),
        ({"method": "exact", "interpolation": "band-limited"}, ("exact", "exact", "band-limited")),
        ({"method": "newmark-average"}, ("newmark-average", "interpolated", "linear")),
    ],
)
def test_result_reports_method_maxima_and_interpolation(choices, expected):
    result = spectrum(noise(samples=21), np.array([1.0]), **choices)
    assert (result.method, result.maxima, result.interpolation) == expected


def test_period_far_below_sampling_interval_is_refused():
    with pytest.raises(AnalysisError, match=r"period 0\.0004 s .* 0\.05 .* 0\.01 s"):
        spectrum(noise(samples=21), np.array([1.0, 4e-4]))
