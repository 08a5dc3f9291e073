"""Maxima after the last sample of a record, during which the ground is at rest."""

import math

import numpy as np
import pytest
from scipy.optimize import brentq

from building_cases import Law, model, noise, oscillator, story
from exact_oscillators import transition
from tdint import run
from tdint.errors import UsageError
from tdint.ground_motion.horizontals import find_horizontals
from tdint.ground_motion.record import Record
from tdint.response.spectra.drift import drift_spectrum
from tdint.response.spectra.elastic import spectrum
from tdint.response.spectra.inelastic import constant_ductility, constant_strength
from tdint.response.spectra.rotated import rotated_spectrum
from tdint.units import STANDARD_GRAVITY

PERIODS = np.array([0.3, 1.0, 2.0, 4.0, 9.0])


def cut_record(seed, size=120, dt=0.02, component=""):
    """Return noise that grows until its last sample."""
    samples = np.random.default_rng(seed).normal(size=size) * np.linspace(0.2, 2.0, size)
    return Record(np.convolve(samples, np.ones(9) / 9.0, "same"), dt, "", "", component, "")


def pulse(dt=0.01, duration=0.5):
    """Return a half sine."""
    times = np.arange(round(duration / dt) + 1) * dt
    return Record(np.sin(math.pi * times / duration), dt, "", "", "", "")


def padded(record, seconds):
    zeros = np.zeros(math.ceil(seconds / record.dt))
    return Record(
        np.concatenate([record.acceleration, zeros]), record.dt, "", "", record.component, ""
    )


def largest(ground, dt, omega, ratio):
    """Return the maxima of displacement, velocity and absolute acceleration by the matrix
    exponential, with the extrema between the steps."""
    by_u, by_v = omega**2, 2.0 * ratio * omega
    (a11, a12), (a21, a22) = transition(by_u, by_v, dt)[0].tolist()
    forcing = np.column_stack([ground[:-1], ground[1:]]) @ transition(by_u, by_v, dt)[1].T
    states, u, v = np.zeros((ground.size, 2)), 0.0, 0.0
    for k, (f, g) in enumerate(forcing.tolist()):
        u, v = a11 * u + a12 * v - f, a21 * u + a22 * v - g
        states[k + 1] = u, v

    u, v = states.T
    p = by_u * u + by_v * v
    a = -p - ground
    maxima = []
    for k, (values, rates) in enumerate(((u, v), (v, a), (p, by_u * v + by_v * a))):
        best = np.max(np.abs(values))
        # Between the steps, a maximum exceeds its neighbors by less than the largest change.
        reach = np.maximum(np.abs(values[:-1]), np.abs(values[1:])) + 0.25 * dt * np.abs(
            np.diff(rates)
        )
        for i in np.flatnonzero((rates[:-1] * rates[1:] < 0.0) & (reach >= best)):

            def at(t, i=i, k=k):
                g = ground[i] + (ground[i + 1] - ground[i]) * t / dt
                matrices = transition(by_u, by_v, t)
                u, v = matrices[0] @ states[i] - matrices[1] @ [ground[i], g]
                p = by_u * u + by_v * v
                return ((u, v), (v, -p - g), (p, by_u * v - by_v * (p + g)))[k]

            t = brentq(lambda t, at=at: at(t)[1], 1e-9 * dt, dt, xtol=1e-12)
            best = max(best, abs(at(t)[0]))
        maxima.append(best)
    return maxima


@pytest.mark.long
def test_random_oscillators_agree_with_matrix_exponential_over_ten_periods():
    random = np.random.default_rng(1)
    later = 0
    for seed in range(50):
        record = cut_record(seed)
        for _ in range(20):
            # Steps are short enough for one extremum between them.
            period = math.exp(random.uniform(math.log(0.3), math.log(6.0)))
            ratio = random.choice([0.0, 0.02, 0.05, 0.3, 0.9])
            found = spectrum(record, [period], ratio)
            ground = padded(record, 10.0 * period).acceleration
            omega = 2.0 * math.pi / period
            expected = largest(ground, record.dt, omega, ratio)
            values = [found.sd[0], found.sv[0], found.sa[0]]
            assert values == pytest.approx(expected, rel=1e-9)
            until_end = spectrum(record, [period], ratio, maxima="samples").sd[0]
            later += found.sd[0] > 1.001 * until_end
    assert later > 200


def test_half_sine_has_published_amplification():
    """Shock spectrum of a half sine of duration t1: 2 (T/t1) cos(pi t1/T) / ((T/t1)^2 - 4) in the
    free vibration (Chopra, Dynamics of Structures, 4.8)."""
    found = spectrum(pulse(dt=0.001), [2.0, 4.0], 0.0)
    beta = np.array([2.0, 4.0]) / 0.5
    factor = 4.0 * beta * np.cos(math.pi / beta) / (beta**2 - 4.0)
    assert found.psa == pytest.approx(factor, rel=1e-5)


@pytest.mark.parametrize("seed", range(3))
def test_spectra_agree_with_those_of_padded_record(seed):
    record = cut_record(seed)
    long = padded(record, 100.0)
    for ratio in (0.0, 0.05):
        for name in ("sd", "sv", "sa"):
            assert getattr(spectrum(record, PERIODS, ratio), name) == pytest.approx(
                getattr(spectrum(long, PERIODS, ratio), name), rel=1e-9
            )
    by_method, by_method_long = (
        spectrum(motion, PERIODS[1:], 0.05, method="newmark-average") for motion in (record, long)
    )
    # The free vibration in closed form does not have the period error of the method.
    assert by_method.sd == pytest.approx(by_method_long.sd, rel=2e-3)
    assert by_method.sa == pytest.approx(by_method_long.sa, rel=2e-3)
    drift, drift_long = (drift_spectrum(motion, PERIODS, 0.05) for motion in (record, long))
    assert drift.peak_drift_ratio == pytest.approx(drift_long.peak_drift_ratio, rel=1e-9)
    assert drift.roof_drift_ratio == pytest.approx(drift_long.roof_drift_ratio, rel=1e-9)
    for kind in (
        lambda motion: constant_ductility(motion, PERIODS, [1.0, 3.0], 0.02)[1],
        lambda motion: constant_strength(motion, PERIODS, [0.02], 0.0, hardening=0.05)[0],
    ):
        assert kind(record).sd == pytest.approx(kind(long).sd, rel=1e-8)


def test_rotated_spectra_agree_with_those_of_padded_records():
    records = [cut_record(seed, component=name) for seed, name in ((5, "0"), (6, "90"))]
    found, long = (
        rotated_spectrum(find_horizontals(motions), PERIODS, 0.02)
        for motions in (records, [padded(record, 40.0) for record in records])
    )
    assert found.psa == pytest.approx(long.psa, rel=1e-9)
    assert found.geometric_mean == pytest.approx(long.geometric_mean, rel=1e-9)


def test_maxima_at_samples_end_with_the_record():
    record = cut_record(7)
    for maxima in ("samples", "peer"):
        until_end = spectrum(record, [9.0], 0.0, maxima=maxima).sd[0]
        assert until_end < 0.9 * spectrum(record, [9.0], 0.0).sd[0]


def test_maxima_of_complete_record_do_not_change():
    quiet = padded(noise(samples=601), 20.0)
    found = spectrum(quiet, PERIODS, 0.05)
    long = spectrum(padded(quiet, 30.0), PERIODS, 0.05)
    for name in ("sd", "sv", "sa"):
        assert np.array_equal(getattr(found, name), getattr(long, name))


# Runs


def bilinear(period, ratio, yield_acceleration):
    omega = 2.0 * math.pi / period
    law = Law("bilinear", (yield_acceleration, 0.05))
    return model([story(1.0, omega**2, law, height=100.0, dashpot=2.0 * ratio * omega)])


@pytest.mark.long
def test_bilinear_oscillators_are_within_twice_their_estimates():
    random, later = np.random.default_rng(2), 0
    for seed in range(100):
        record = cut_record(seed)
        period, ratio = math.exp(random.uniform(-1.0, 1.5)), random.choice([0.0, 0.02, 0.05])
        elastic = spectrum(record, [period], ratio).psa[0]
        strength = elastic / random.uniform(1.2, 5.0)
        response = run(bilinear(period, ratio, strength), record)
        (exact,) = constant_strength(
            record, [period], [strength / STANDARD_GRAVITY], ratio, hardening=0.05
        )
        error = abs(response.stories.peak_drift[0] - exact.sd[0])
        assert error <= 2.0 * response.check.errors.peak_drift[0]
        later += response.steps > record.acceleration.size - 1
    assert later > 30


def test_run_continues_while_a_drift_grows():
    record = pulse()
    response = run(oscillator(math.pi / 2.0, 0.02), record, history=True)
    expected = spectrum(record, [4.0], 0.02).sd[0]
    assert response.stories.peak_drift[0] == pytest.approx(expected, rel=1e-6)
    assert response.steps > record.acceleration.size
    assert response.history.time.size == response.steps + 1
    assert any("still grew at the end of the record" in note for note in response.notes)
    # A history file has the same rows; those up to the end of the record are counted.
    rows = np.concatenate([chunk.time for chunk in response.history_chunks(1)])
    assert np.array_equal(rows, response.history.time)
    assert response.record_rows == record.acceleration.size


def test_requested_duration_ends_the_run_with_a_warning():
    record = pulse()
    building = oscillator(math.pi / 2.0, 0.02)
    response = run(building, record, duration=record.duration)
    assert response.steps == record.acceleration.size - 1
    (warning,) = [text for text in response.warnings if "peaks still grow" in text]
    expected = spectrum(record, [4.0], 0.02).sd[0]
    missing = expected - response.stories.peak_drift[0]
    assert 0.5 * missing < response.check.errors.peak_drift[0] < 2.0 * missing
    assert "omit it" in warning


def test_run_under_complete_record_is_unchanged():
    quiet = padded(noise(samples=601), 20.0)
    building = oscillator(2.0 * math.pi, 0.05)
    found = run(building, quiet)
    fixed = run(building, quiet, duration=quiet.duration)
    assert found.steps == fixed.steps
    assert found.energy == fixed.energy
    assert np.array_equal(found.stories.peak_drift, fixed.stories.peak_drift)


def test_strength_relative_to_the_elastic_force():
    record = noise(samples=401)
    (found,) = constant_strength(record, PERIODS, [0.25], 0.05, relative_to="elastic")
    assert found.reduction_factor == pytest.approx(np.full(PERIODS.size, 4.0), rel=1e-12)
    for i, period in enumerate(PERIODS):
        (single,) = constant_strength(record, [period], [found.yield_strength_ratio[i]], 0.05)
        assert found.sd[i] == pytest.approx(single.sd[0], rel=1e-9)
    assert found.prescribed == "strength reduced by 4"
    with pytest.raises(UsageError, match="relative_to must be weight or elastic"):
        constant_strength(record, PERIODS, [0.25], relative_to="mass")
