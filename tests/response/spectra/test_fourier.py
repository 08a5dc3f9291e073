"""Fourier amplitude spectra: closed forms, the theorem of Parseval, and smoothing."""

from __future__ import annotations

import math

import numpy as np
import pytest

import tdint
from tdint.errors import UsageError
from tdint.ground_motion.messages import quiet_import
from tdint.ground_motion.record import Record

DT, SIZE = 0.01, 4000


def record(samples) -> Record:
    return Record(np.asarray(samples, dtype=float), DT, "", "", "X", "made")


@pytest.fixture(scope="module")
def noise() -> Record:
    return record(np.random.default_rng(5).normal(size=SIZE))


@pytest.mark.parametrize("cycles", [1, 37, 1500])
def test_sinusoid_of_complete_cycles_has_one_frequency(cycles) -> None:
    """The amplitude of A sin(2 pi k t / T) over a duration T is A T / 2 at k / T, and zero at all
    other frequencies."""
    duration = SIZE * DT
    found = tdint.fourier_spectrum(
        record(3.0 * np.sin(2.0 * math.pi * cycles * np.arange(SIZE) / SIZE)), None
    )
    assert found.frequencies[cycles - 1] == pytest.approx(cycles / duration, rel=1e-14)
    assert found.amplitude[cycles - 1] == pytest.approx(1.5 * duration, rel=1e-12)
    assert np.max(np.delete(found.amplitude, cycles - 1)) < 1e-10


@pytest.mark.parametrize("size", [SIZE, SIZE - 1])
def test_parseval_theorem_holds(noise, size) -> None:
    """dt sum a^2 equals df sum |A|^2 over both signs of the frequency; the last frequency of an
    even size has only one sign."""
    samples = noise.acceleration[:size]
    found = tdint.fourier_spectrum(record(samples), None)
    assert found.frequencies.size == size // 2
    squares = found.amplitude**2
    both = 2.0 * np.sum(squares) - (squares[-1] if size % 2 == 0 else 0.0)
    zero = (DT * np.sum(samples)) ** 2
    assert (both + zero) / (size * DT) == pytest.approx(DT * np.sum(samples**2), rel=1e-12)


@pytest.mark.parametrize("bandwidth", [10.0, 40.0, 188.0])
def test_smoothing_agrees_with_konno_ohmachi_window_of_obspy(noise, bandwidth) -> None:
    """The window of ObsPy is normalized and evaluated at the same frequencies."""
    with quiet_import():
        from obspy.signal.konnoohmachismoothing import konno_ohmachi_smoothing_window
    plain = tdint.fourier_spectrum(noise, None)
    found = tdint.fourier_spectrum(noise, bandwidth)
    assert found.frequencies.size <= 300
    for frequency, amplitude in list(zip(found.frequencies, found.amplitude, strict=True))[::10]:
        window = konno_ohmachi_smoothing_window(
            plain.frequencies, frequency, bandwidth, normalize=True
        )
        assert amplitude == pytest.approx(window @ plain.amplitude, rel=1e-9)


def test_scaled_motion_has_scaled_spectrum(noise) -> None:
    twice = tdint.fourier_spectrum(noise.scaled(-2.0))
    np.testing.assert_allclose(
        twice.amplitude, 2.0 * tdint.fourier_spectrum(noise).amplitude, rtol=1e-12
    )
    assert twice.bandwidth == 40.0
    assert "smoothed with b = 40" in repr(twice)
    assert list(twice.to_dict()) == [
        "record",
        "component",
        "bandwidth",
        "frequency_hz",
        "fourier_amplitude_m_s",
    ]


@pytest.mark.parametrize("bandwidth", [0.0, -40.0, math.nan, 1e6])
def test_invalid_bandwidth_is_refused(noise, bandwidth) -> None:
    with pytest.raises(UsageError, match=r"bandwidth .* 1 to 1000"):
        tdint.fourier_spectrum(noise, bandwidth)
