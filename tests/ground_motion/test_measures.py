"""Tests of measures of ground motions against closed forms and against fine integration of the same
straight lines."""

import math
import tracemalloc
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from facts import each_states, states
from tdint.ground_motion.measures import (
    baseline_notes,
    baseline_notes_of_suite,
    cumulative_absolute_velocity,
    cumulative_energy,
    cut_off,
    integrate,
    mean_period,
    measure,
    spectrum_intensity,
    time_of_energy,
    zeros_at_ends,
)
from tdint.ground_motion.record import Record
from tdint.output.tables.spectra import record_info
from tdint.response.spectra.elastic import spectrum
from tdint.units import STANDARD_GRAVITY


def record(samples, dt=0.5):
    return Record(np.array(samples, dtype=float), dt, "", "", "", "")


def arias(energy):
    return math.pi / (2.0 * STANDARD_GRAVITY) * energy


class TestClosedForms:
    def test_measures_of_step(self):
        """The motion is 2 m/s^2 for 10 s."""
        found = measure(record([2.0] * 21))
        assert (found.pga, found.pgv, found.pgd) == pytest.approx((2.0, 20.0, 100.0), rel=1e-13)
        assert found.arias == pytest.approx(arias(40.0), rel=1e-13)
        assert found.cav == pytest.approx(20.0, rel=1e-13)
        assert (found.d5_75, found.d5_95) == pytest.approx((7.0, 9.0), rel=1e-12)
        assert found.mean == 2.0

    def test_measures_of_ramp(self):
        """The motion is t from 0 to 10 s, whose energy grows with t^3."""
        found = measure(record(np.arange(21) * 0.5))
        assert (found.pga, found.pgv, found.pgd) == pytest.approx(
            (10.0, 50.0, 1000.0 / 6.0), rel=1e-13
        )
        assert (found.arias, found.cav) == pytest.approx((arias(1000.0 / 3.0), 50.0), rel=1e-13)
        start = 10.0 * 0.05 ** (1 / 3)
        assert found.d5_75 == pytest.approx(10.0 * 0.75 ** (1 / 3) - start, rel=1e-12)
        assert found.d5_95 == pytest.approx(10.0 * 0.95 ** (1 / 3) - start, rel=1e-12)

    def test_omitted_arias_intensity_is_reported(self):
        """The energy of 2 m/s^2 for 10 s increases with t, and the energy of a ramp with t^3; after
        5 s, a half and 7 / 8 of it are omitted."""
        step, ramp = (
            replace(record([2.0] * 21), source="step"),
            replace(record(np.arange(21.0)), source="ramp"),
        )
        message = "the analysis ends at 5 s and omits a part of the Arias intensity: "
        assert cut_off([step, ramp], 5.0)[0].startswith(f"{message}step 50 %, ramp 88 %")
        # 5 % are left after 9.5 s of the one, and after 10 * 0.95^(1/3) = 9.83 s of the other.
        assert cut_off([step], 9.5) == [] and "ramp 14 %" in cut_off([step, ramp], 9.5)[0]
        assert (
            cut_off([step, ramp], 10.0)
            == cut_off([step], math.inf)
            == cut_off([record([0.0] * 9)], 1.0)
            == []
        )

    def test_measures_of_triangle_through_zero(self):
        """The motion goes from 1 to -2 m/s^2 in 3 s: it is zero after 1 s, and the velocity is zero
        again after 2 s."""
        found = measure(record([1.0, -2.0], dt=3.0))
        assert found.pgv == pytest.approx(
            1.5
        )  # at the end, -1.5; 0.5 at the zero of the acceleration
        assert found.cav == pytest.approx(0.5 + 2.0)
        assert found.arias == pytest.approx(arias(1.0 / 3.0 + 8.0 / 3.0))
        motion = integrate(record([1.0, -2.0], dt=3.0))
        assert motion.displacement[-1] == pytest.approx(0.0, abs=1e-14)
        assert found.pgd == pytest.approx(
            2.0 / 3.0
        )  # where the velocity is zero, between the samples

    def test_measures_of_sine(self):
        """The record has twenty periods of A sin(omega t) with 400 samples each."""
        amplitude, omega, n = 3.0, 2.0 * math.pi, 8000
        dt = 20.0 / n
        found = measure(record(amplitude * np.sin(omega * dt * np.arange(n + 1)), dt))
        assert found.pga == pytest.approx(amplitude)
        assert found.pgv == pytest.approx(2.0 * amplitude / omega, rel=1e-4)
        assert found.pgd == pytest.approx(20.0 * amplitude / omega, rel=1e-4)
        assert found.arias == pytest.approx(arias(20.0 * amplitude**2 / 2.0), rel=1e-4)
        assert found.cav == pytest.approx(20.0 * 2.0 * amplitude / math.pi, rel=1e-4)
        assert (found.d5_75, found.d5_95) == pytest.approx((14.0, 18.0), rel=1e-3)

    def test_spectrum_intensity_of_straight_line(self):
        periods = np.linspace(0.1, 2.5, 7)
        assert spectrum_intensity(periods, 2.0 + periods) == pytest.approx(
            2.4 * 2.0 + (2.5**2 - 0.1**2) / 2.0
        )


def thousandths(value):
    """Round to thousandths. This is a named function, because older versions of hypothesis take
    more than a second to find the text of a lambda at every example."""
    return round(value, 3)


class TestAgainstFineIntegration:
    """The same straight lines between samples are divided into 2000 intervals each."""

    @settings(max_examples=30)
    @given(st.lists(st.floats(-5.0, 5.0).map(thousandths), min_size=2, max_size=8))
    def test_measures_agree_with_fine_integration(self, samples):
        pieces = 2000
        motion = record(samples)
        t = np.arange((len(samples) - 1) * pieces + 1) / pieces
        fine = record(np.interp(t, np.arange(len(samples)), samples), 0.5 / pieces)
        found, expected = integrate(motion), integrate(fine)
        np.testing.assert_allclose(found.velocity, expected.velocity[::pieces], atol=1e-10)
        np.testing.assert_allclose(found.displacement, expected.displacement[::pieces], atol=1e-9)
        assert found.pgv == pytest.approx(np.abs(expected.velocity).max(), abs=1e-6)
        assert found.pgd == pytest.approx(np.abs(expected.displacement).max(), abs=1e-6)
        absolute = np.abs(fine.acceleration)
        assert cumulative_absolute_velocity(motion) == pytest.approx(
            0.5 * fine.dt * np.sum(absolute[1:] + absolute[:-1]), abs=1e-5
        )
        energy = cumulative_energy(motion)
        assert energy[-1] == pytest.approx(cumulative_energy(fine)[-1], rel=1e-9, abs=1e-12)
        for part in (0.05, 0.95):
            when = time_of_energy(motion, energy, part)
            if energy[-1] > 0.0:
                at = np.interp(
                    when, np.arange(fine.acceleration.size) * fine.dt, cumulative_energy(fine)
                )
                assert at == pytest.approx(part * energy[-1], rel=1e-3, abs=1e-9)


class TestUnusualRecords:
    def test_measures_of_zero_record(self):
        found = measure(record([0.0, 0.0, 0.0]))
        assert (found.pga, found.pgv, found.pgd, found.arias, found.cav) == (
            0.0,
            0.0,
            0.0,
            0.0,
            0.0,
        )
        assert math.isnan(found.d5_75)
        assert math.isnan(found.d5_95)
        assert found.notes == ()

    def test_overflow_gives_infinite_measures(self):
        found = measure(record([1e300, -1e300]))
        assert not math.isfinite(found.arias)
        assert math.isnan(found.d5_95)

    @pytest.mark.parametrize(
        ("samples", "expected"),
        [([0, 0, 1, 0], (2, 1)), ([1, 0, 1], (0, 0)), ([0, 0], (2, 0)), ([1], (0, 0))],
    )
    def test_zeros_at_ends_are_counted(self, samples, expected):
        assert zeros_at_ends(np.array(samples, dtype=float)) == expected

    @pytest.mark.parametrize(
        ("samples", "notes"),
        [
            ([0] * 30 + [1, -2, 1] * 20 + [0], ["first 30 of 91 samples are zero; "]),
            ([0, 1, -2, 1] * 10 + [0] * 30, ["last 30 of 70 samples are zero; "]),
            ([1, -0.5, 0, 1, -2, 1, 0], ["first sample is 1 m/s^2, 50 % of the peak; "]),
            ([0, 1, 1, 0], ["velocity at the end is 1 m/s, 100 % of its peak; "]),
            ([0, 1, -2, 1, 0], []),
        ],
    )
    def test_suspect_samples_are_noted(self, samples, notes):
        assert each_states(measure(record(samples)).notes, notes)


class TestBaseline:
    """A constant acceleration is a drift of the baseline: the velocity ends at its peak."""

    drift, sound = [0, 0.1] + [0.1] * 40 + [0], [0, 1, -2, 1, 0]

    def test_displacement_at_the_end(self):
        """After 1 and -1 m/s^2 for 1 s each, the ground rests 1 m from its start."""
        samples = [0, 1, 1, 0, -1, -1, 0]
        (note,) = baseline_notes(record(samples, 0.4))
        assert note.startswith("the displacement at the end is ")
        assert "100 % of its peak" in note
        stored = replace(record(samples, 0.4), peaks=(None, 2.0))
        assert baseline_notes(stored) == ()

    def test_suite_has_one_note_for_each_property(self):
        suite = [replace(record(self.drift), source=f"{name}.csv") for name in "abcdefgh"]
        suite.insert(3, replace(record(self.sound), source="sound.csv"))
        (note,) = baseline_notes_of_suite(suite)
        assert states(note, "velocity at the end ... a.csv (2.05 m/s, 100 %), b.csv ... baseline")
        assert "sound" not in note and "more" in note
        (note,) = baseline_notes_of_suite(suite[2:4])
        assert note == f"c.csv: {baseline_notes(suite[2])[0]}"


class TestMeasuresOfFrequencyAndLevel:
    """Tests of mean period, A95 and bracketed duration against closed forms."""

    def test_mean_period_of_sine_is_its_period(self):
        """One hundred complete periods of 2 Hz have one Fourier amplitude."""
        dt, frequency = 0.005, 2.0
        motion = record(np.sin(2.0 * math.pi * frequency * dt * np.arange(10_000)), dt)
        assert measure(motion).mean_period == pytest.approx(0.5, rel=1e-9)
        assert measure(motion.scaled(7.0)).mean_period == pytest.approx(0.5, rel=1e-9)

    def test_mean_period_weights_periods_by_squared_amplitudes(self):
        """Amplitudes 1 at 1 Hz and 2 at 4 Hz have the mean period (1 x 1 + 4 x 0.25) / 5.
        Frequencies outside of 0.25 to 20 Hz do not count."""
        time = 0.005 * np.arange(20_000)
        sines = (1.0, 1.0), (2.0, 4.0), (9.0, 0.1), (9.0, 30.0)
        motion = sum(a * np.sin(2.0 * math.pi * f * time) for a, f in sines)
        assert measure(record(motion, 0.005)).mean_period == pytest.approx(0.4, rel=1e-9)

    def test_trailing_zeros_do_not_change_mean_period(self):
        """The frequency interval of a record of 2 s is 0.5 Hz; padding with zeros reduces it to the
        limit of 0.05 Hz."""
        rng = np.random.default_rng(4)
        samples = rng.standard_normal(400) * np.hanning(400)
        short = record(samples, 0.005)
        padded = record(np.concatenate([samples, np.zeros(3600)]), 0.005)
        assert measure(short).mean_period == measure(padded).mean_period

    def test_rounding_of_sampling_interval_does_not_change_mean_period(self):
        """The limits of the band are frequencies of the transform; 0.0125 x 0.2 is not 0.0025."""
        samples = np.random.default_rng(4).standard_normal(100)
        exact, rounded = (mean_period(record(samples, dt)) for dt in (0.0025, 0.0125 * 0.2))
        assert exact == pytest.approx(rounded, rel=1e-9)

    def test_a95_of_ramp(self):
        """The energy below A of a ramp from 0 to 1 is the fraction A^3 of the total energy."""
        assert measure(record([0.0, 1.0])).a95 == pytest.approx(0.95 ** (1.0 / 3.0), rel=1e-12)
        assert measure(record([-3.0, 3.0])).a95 == pytest.approx(
            3.0 * 0.95 ** (1.0 / 3.0), rel=1e-12
        )
        many_samples = np.linspace(-3.0, 3.0, 1001)
        assert measure(record(many_samples)).a95 == pytest.approx(
            3.0 * 0.95 ** (1.0 / 3.0), rel=1e-12
        )

        # From 1 to 2: (A^3 - 1) / 7 of the whole.
        assert measure(record([1.0, 2.0])).a95 == pytest.approx(7.65 ** (1.0 / 3.0), rel=1e-12)

    def test_a95_of_levels(self):
        """For the level 1 over 90 intervals and 2 over 10, 90 of 130 are at level 1, so that A95 is
        2. If the second level lasts one interval and is 1.1, A95 is 1. The ramps between are
        negligible."""
        flat = [1.0] * 91
        assert measure(record([*flat, *[2.0] * 11])).a95 == pytest.approx(2.0, rel=1e-9)
        assert measure(record([*[1.0] * 9001, 1.1, 1.1])).a95 == pytest.approx(1.0, rel=1e-9)

    def test_bracketed_duration_uses_linear_crossings(self):
        """The motion goes from 0 to 0.1 g, to -0.1 g and to 0 at intervals of 0.5 s. It first
        exceeds 0.05 g at 0.25 s. The last sample above is -0.1 g at 1 s, and the line to 0 crosses
        -0.05 g at 1.25 s."""
        g = STANDARD_GRAVITY
        motion = record([0.0, 0.1 * g, -0.1 * g, 0.0])
        assert measure(motion).bracketed_duration == pytest.approx(1.25 - 0.25, rel=1e-12)
        assert measure(record([0.0, 0.04 * g, 0.0])).bracketed_duration == 0.0
        assert measure(record([0.2 * g] * 5)).bracketed_duration == 2.0
        # One sample inside: 0.1 g, with 0 before and after.
        assert measure(record([0.0, 0.1 * g, 0.0])).bracketed_duration == pytest.approx(0.5)


class TestLongRecords:
    def test_measures_do_not_depend_on_the_blocks(self, monkeypatch):
        """Integrals continue from one block of samples to the next, with the same bits; sums of
        blocks differ by rounding errors."""
        motion = record(np.random.default_rng(7).normal(size=301).round(2) * 0.2, 0.01)
        in_one, energy, measures = integrate(motion), cumulative_energy(motion), measure(motion)
        for block in (13, 299):
            monkeypatch.setattr("tdint.ground_motion.measures._BLOCK", block)
            assert cumulative_energy(motion).tobytes() == energy.tobytes()
            in_blocks = integrate(motion)
            assert in_blocks.velocity.tobytes() == in_one.velocity.tobytes()
            assert in_blocks.displacement.tobytes() == in_one.displacement.tobytes()
            assert (in_blocks.pgv, in_blocks.pgd) == (in_one.pgv, in_one.pgd)
            for name in ("arias", "cav", "cav5", "d5_75", "d5_95", "a95", "bracketed_duration"):
                assert getattr(measure(motion), name) == pytest.approx(
                    getattr(measures, name), rel=1e-13
                ), name

    def test_peaks_between_samples_of_a_later_block(self, monkeypatch):
        """Acceleration from 1 to -1 m/s^2 in the fourth interval of 1 s: the velocity is 3.25 m/s
        in its middle, and 3 m/s at its ends."""
        monkeypatch.setattr("tdint.ground_motion.measures._BLOCK", 2)
        motion = integrate(record([1.0, 1.0, 1.0, 1.0, -1.0, -1.0], 1.0))
        assert motion.pgv == pytest.approx(3.25, rel=1e-14)
        assert np.max(motion.velocity) == 3.0

    def test_memory_of_info_is_six_records(self):
        """`tdint info` computes integrals, sums and spectra with 1106 periods."""
        motion = record(np.random.default_rng(7).normal(size=2**19), 0.005)
        tracemalloc.start()
        try:
            record_info(motion)
            _, most = tracemalloc.get_traced_memory()
        finally:
            tracemalloc.stop()
        assert most < 6 * motion.acceleration.nbytes


@pytest.mark.parametrize("seed", range(6))
def test_predominant_period_is_the_maximum_of_the_complete_spectrum(seed):
    """The search evaluates a part of the periods only, and finds the same period."""
    rng = np.random.default_rng(seed)
    width = int(rng.integers(2, 60))
    motion = np.convolve(rng.standard_normal(1500), np.hanning(width + 2), "same")
    ground_motion = record(motion, dt=(0.005, 0.02, 0.3)[seed % 3])
    complete = spectrum(ground_motion, np.geomspace(0.02, 10.0, 625))
    found = record_info(ground_motion).predominant_period
    assert found == complete.periods[np.argmax(complete.psa)]
