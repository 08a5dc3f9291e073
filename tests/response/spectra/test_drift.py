"""Tests of drift spectra against the matrix exponential, the wave sum of the shear beam, and the
limits of one and many stories."""

import math
from dataclasses import replace

import numpy as np
import pytest

from building_cases import ModalDamping, model, noise, story
from real_records import real_file
from references import drifts, exact_linear, finer
from tdint.errors import AnalysisError, UsageError
from tdint.ground_motion.reading.read import read_record
from tdint.ground_motion.record import Record
from tdint.response.spectra.drift import HeightPeriod, drift_spectrum, parse_height_period

MANY = HeightPeriod(0.1, 1.0)


def uniform(period, stories, damping):
    """Return the building of a drift spectrum as a model."""
    root = 2.0 * math.pi / period / (2.0 * math.sin(math.pi / (2.0 * (2 * stories + 1))))
    return model([story(1.0, root**2)] * stories, damping=ModalDamping((damping,)))


@pytest.mark.parametrize(
    ("stories", "period", "damping"), [(1, 0.3, 0.0), (2, 0.2, 0.02), (7, 0.8, 0.05), (12, 2, 0.2)]
)
def test_drifts_agree_with_matrix_exponential(stories, period, damping):
    record = noise(samples=401)
    spectrum = drift_spectrum(
        record, np.array([period]), damping, stories=stories, height_period=MANY
    )
    motion = exact_linear(uniform(period, stories, damping), finer(record, 16))
    ratios = np.max(np.abs(drifts(motion)), axis=0) * stories / spectrum.heights[0]
    roof = np.max(np.abs(motion[:, -1])) / spectrum.heights[0]
    # The reference is evaluated at samples, and misses a maximum by at most (omega h)^2 / 8.
    missed = (2.0 * math.pi / period * 2 * stories * record.dt / 16) ** 2 / 8.0
    assert spectrum.story[0] == np.argmax(ratios) + 1
    assert 0.0 <= spectrum.peak_drift_ratio[0] / np.max(ratios) - 1.0 + 1e-10 < missed
    assert 0.0 <= spectrum.roof_drift_ratio[0] / roof - 1.0 + 1e-10 < missed


@pytest.mark.parametrize("damping", [0.01, 0.05])
def test_maxima_between_samples_are_found(damping):
    """Additional samples of the same motion do not change the result."""
    record = noise(samples=401)
    periods = np.geomspace(0.2, 5.0, 9)
    coarse = drift_spectrum(record, periods, damping)
    fine = drift_spectrum(finer(record, 7), periods, damping)
    assert coarse.peak_drift_ratio == pytest.approx(fine.peak_drift_ratio, rel=1e-10)
    assert coarse.roof_drift_ratio == pytest.approx(fine.roof_drift_ratio, rel=1e-10)
    assert np.array_equal(coarse.story, fine.story)


def velocity(record, times):
    """Return the exact ground velocity at any times; it is 0 before the motion."""
    a, h = record.acceleration, record.dt
    at_samples = np.append(0.0, np.cumsum(0.5 * h * (a[1:] + a[:-1])))
    i = np.clip((times / h).astype(int), 0, a.size - 2)
    t = times - i * h
    inside = at_samples[i] + a[i] * t + 0.5 * (a[i + 1] - a[i]) / h * t**2
    return np.where(times < 0.0, 0.0, inside)


@pytest.mark.parametrize("period", [0.21, 0.5, 1.3, 3.0])
def test_undamped_beam_is_sum_of_waves(period):
    """By Iwan (1997), waves of the velocity 4 H / T are reflected at the roof and, with opposite
    sign, at the base."""
    record = noise(samples=801)
    spectrum = drift_spectrum(record, np.array([period]), 0.0, beam=True)
    times = np.arange((record.acceleration.size - 1) * 20 + 1) * record.dt / 20
    waves = velocity(record, times)
    for n in range(1, int(2.0 * times[-1] / period) + 1):
        waves += 2.0 * (-1.0) ** n * velocity(record, times - n * period / 2.0)
    assert spectrum.peak_drift_ratio[0] == pytest.approx(
        np.max(np.abs(waves)) * period / (4.0 * spectrum.heights[0]), rel=5e-5
    )


@pytest.mark.parametrize(("period", "damping"), [(0.4, 0.05), (1.3, 0.02), (3.0, 0.2)])
def test_damped_beam_is_convolution_with_impulse_response(period, damping):
    """The sum over all modes of exp(-xi omega_j t) sin(omega_dj t) / omega_dj, times 2 / H, has the
    closed form arctan(sin(omega_d t) / sinh(xi omega t)) / (H omega_d)."""
    record = noise(samples=401)
    spectrum = drift_spectrum(record, np.array([period]), damping, beam=True)
    motion = finer(record, 40)
    omega = 2.0 * math.pi / period
    damped = omega * math.sqrt(1.0 - damping**2)
    t = (np.arange(motion.acceleration.size) + 0.5) * motion.dt
    kernel = np.arctan(np.sin(damped * t) / np.sinh(damping * omega * t)) / damped
    # Mid points of the kernel, means of the motion over its steps
    means = 0.5 * (motion.acceleration[1:] + motion.acceleration[:-1])
    twice = 2 * means.size
    drift = (
        np.fft.irfft(np.fft.rfft(means, twice) * np.fft.rfft(kernel[:-1], twice), twice)[
            : means.size
        ]
        * motion.dt
    )
    expected = np.max(np.abs(drift)) / spectrum.heights[0]
    assert spectrum.peak_drift_ratio[0] == pytest.approx(expected, rel=2e-4)


def test_heights_and_numbers_of_stories():
    periods = np.array([0.1, 0.3, 1.0, 2.0])
    spectrum = drift_spectrum(noise(samples=21), periods)
    assert 0.0731 * spectrum.heights**0.75 == pytest.approx(periods, rel=1e-14)
    assert np.array_equal(spectrum.stories, [1, 2, 9, 24])
    assert np.array_equal(
        drift_spectrum(noise(samples=21), periods, story_height=3.0).stories, [1, 2, 11, 27]
    )
    assert np.array_equal(
        drift_spectrum(noise(samples=21), periods, stories=4).stories, [4, 4, 4, 4]
    )
    assert parse_height_period("0.0466, 0.9") == HeightPeriod(0.0466, 0.9)


def test_zero_motion_has_zero_drift():
    record = Record(np.zeros(50), 0.01, "", "", "", "")
    for beam in (False, True):
        spectrum = drift_spectrum(record, np.array([0.5, 1.0]), beam=beam)
        assert np.array_equal(spectrum.peak_drift_ratio, [0.0, 0.0])
        assert np.array_equal(spectrum.story, [0, 0] if beam else [1, 1])


def test_five_stories_under_el_centro_agree_with_chopra():
    """Chopra's uniform building (Dynamics of Structures, 12.8 and 13.2.6): k = 31.54 kip/in, T1 =
    1.99963 s, 5 %.

    Computed once more for the record at hand: roof 6.857 in, base shear 73.09 kip.
    """
    # The value of g and the first sample of zero are taken from the book.
    record = read_record(real_file("elCentro1940_180.at2")).scaled(386.4 * 0.0254 / 9.80665)
    record = replace(record, acceleration=np.append(0.0, record.acceleration))
    spectrum = drift_spectrum(record, np.array([1.99963]), 0.05, stories=5)
    height = spectrum.heights[0]
    assert spectrum.roof_drift_ratio[0] * height / 0.0254 == pytest.approx(6.857, rel=2e-3)
    assert spectrum.story[0] == 1
    assert spectrum.peak_drift_ratio[0] * height / 5 / 0.0254 * 31.54 == pytest.approx(
        73.09, rel=2e-3
    )


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"periods": [0.0]}, "periods must be positive"),
        ({"periods": []}, "periods must be positive"),
        ({"damping": 1.0}, "damping must be a ratio"),
        ({"stories": 0}, "from 1 to 1000, got 0"),
        ({"stories": 1001}, "from 1 to 1000, got 1001"),
        ({"story_height": 0.0}, "story height .* positive"),
        ({"story_height": math.nan}, "story height .* positive"),
        ({"periods": [100.0]}, "from 1 to 1000, got 4339"),
        ({"height_period": HeightPeriod(0.1, 1e-4)}, "height .* zero or too large"),
        ({"height_period": HeightPeriod(10.0, 1e-4), "beam": True}, "height .* zero or too large"),
    ],
)
def test_invalid_arguments_are_refused(arguments, message):
    arguments = {"periods": [1.0], "damping": 0.05} | arguments
    with pytest.raises(UsageError, match=message):
        drift_spectrum(noise(samples=21), **arguments)


def test_too_short_and_too_long_periods_are_refused():
    with pytest.raises(AnalysisError, match=r"too many modes .* 200 s"):
        drift_spectrum(noise(samples=21), np.array([300.0]), beam=True)
    with pytest.raises(AnalysisError, match=r"period 9e-06 s .* at least 1e-05 s"):
        drift_spectrum(noise(samples=21), np.array([9e-6, 1.0]))


@pytest.mark.parametrize(
    "text", ["", "0.07", "0.07,0.75,1", "a,b", "0,0.75", "0.07,-1", "nan,1", "0.07,inf"]
)
def test_invalid_height_period_relations_are_refused(text):
    with pytest.raises(UsageError, match=r"height-period relation .*two positive"):
        parse_height_period(text)
