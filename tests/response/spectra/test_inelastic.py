"""Tests of bilinear oscillators against closed forms, the matrix exponential and `tdint run`, and
of the search for a strength."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from building_cases import Law, model, noise, oscillator, story
from real_records import real_file
from references import exact_linear, finer
from selection import every
from tdint import run
from tdint.errors import AnalysisError, UsageError
from tdint.ground_motion.reading.read import read_record
from tdint.ground_motion.record import Record
from tdint.response.spectra.inelastic import constant_ductility, constant_strength, largest_ratio
from tdint.units import STANDARD_GRAVITY

NOISE = noise(samples=601)


def between_samples(values):
    """Return the largest absolute value of the parabolas through three neighboring points."""
    values = np.abs(values)
    i = 1 + int(np.argmax(values[1:-1]))
    low, top, high = values[i - 1 : i + 2]
    return max(values[0], values[-1], top + (high - low) ** 2 / (8.0 * (2.0 * top - low - high)))


def bilinear_story(period, damping, yield_acceleration, hardening):
    """Return a building with a bilinear story of unit mass."""
    omega = 2.0 * math.pi / period
    law = Law("bilinear", (yield_acceleration, hardening))
    return model([story(1.0, omega**2, law, dashpot=2.0 * damping * omega)])


def steady(value, seconds, dt=0.01):
    return Record(np.full(round(seconds / dt) + 1, value), dt, "", "", "", "")


# The oscillator


@pytest.mark.parametrize("damping", every(3, [0.0, 0.05, 0.5]))
def test_spectrum_for_ductility_1_is_exact_elastic_spectrum(damping):
    periods = np.array([0.02, 0.1, 0.5, 2.0])
    (spectrum,) = constant_ductility(NOISE, periods, [1.0], damping)
    for i, (period, parts) in enumerate(zip(periods, (40, 20, 10, 10), strict=True)):
        omega = 2.0 * math.pi / period
        motion = exact_linear(oscillator(omega, damping), finer(NOISE, parts))[:, 0]
        psa = omega**2 * between_samples(motion)
        assert spectrum.yield_acceleration[i] == pytest.approx(psa, rel=1e-6)
    assert np.array_equal(spectrum.sd, spectrum.elastic_sd)
    assert np.array_equal(spectrum.ductility, np.ones(4))
    assert np.array_equal(spectrum.reduction_factor, np.ones(4))
    assert np.array_equal(spectrum.residual, np.zeros(4))


@pytest.mark.parametrize(
    ("load", "hardening"),
    [(0.55, 0.0), (0.7, 0.0), (0.97, 0.0), (0.6, 0.01), (1.0, 0.1), (1.5, 0.5), (3.0, 0.999)],
)
def test_ductility_under_suddenly_applied_force(load, hardening):
    """The work of the force equals the absorbed energy: F mu = 1/2 + (mu - 1) + hardening (mu -
    1)^2 / 2. For an elastoplastic oscillator, mu = 1 / (2 (1 - F)) (Biggs 1964, Chopra 7.1)."""
    strength = 2.0
    (spectrum,) = constant_strength(
        steady(load * strength, 20.0),
        np.array([1.0]),
        [strength / STANDARD_GRAVITY],
        0.0,
        hardening=hardening,
    )
    ductility = 0.5 / (1.0 - load) if hardening == 0.0 else 1.0
    if hardening:
        ductility += (
            (load - 1.0) + math.sqrt((load - 1.0) ** 2 + hardening * (2.0 * load - 1.0))
        ) / hardening
    assert spectrum.ductility[0] == pytest.approx(ductility, rel=1e-11)


@pytest.mark.parametrize("hardening", [0.0, 0.1])
@pytest.mark.parametrize("period", [0.05, 0.4, 2.0])
def test_strength_of_constant_ductility_reaches_target_in_run(period, hardening):
    """The run of a one-story building with impulse4 and a small time step shares no code with the
    kernel of the spectrum."""
    record = noise(samples=401)
    for spectrum in constant_ductility(
        record, np.array([period]), [1.5, 4.0], 0.05, hardening=hardening
    ):
        building = bilinear_story(period, 0.05, spectrum.yield_acceleration[0], hardening)
        response = run(building, record, method="impulse4", dt=record.dt / 32)
        stories = response.stories
        assert abs(response.energy.error) < 1e-6
        assert spectrum.ductility[0] == pytest.approx(spectrum.target, rel=1e-8)
        assert stories.ductility[0] == pytest.approx(spectrum.target, rel=1e-6)
        assert stories.peak_drift[0] == pytest.approx(spectrum.sd[0], rel=1e-6)


@pytest.mark.parametrize("hardening", [0.0, 0.2])
def test_residual_displacement_equals_end_of_long_run(hardening):
    record = noise(samples=301)
    periods = np.array([0.3, 0.8])
    (spectrum,) = constant_ductility(record, periods, [4.0], 0.1, hardening=hardening)
    quiet = replace(record, acceleration=np.append(record.acceleration, np.zeros(2500)))
    for i, period in enumerate(periods):
        building = bilinear_story(period, 0.1, spectrum.yield_acceleration[i], hardening)
        stories = run(building, quiet, method="impulse4", dt=record.dt / 8).stories
        assert spectrum.residual[i] == pytest.approx(
            stories.residual_drift[0], abs=1e-5 * spectrum.sd[i]
        )
    assert np.all(np.abs(spectrum.residual) > 1e-3 * spectrum.sd)


@pytest.mark.long
def test_random_oscillators_are_independent_of_added_samples():
    """Motions are noise, plateaus, spikes and steps; oscillators are weak or strong, and stiff or
    soft. Additional samples of the same motion do not change the results, because branch changes
    and maxima are located within steps of any length."""
    generator = np.random.default_rng(5)
    for trial in range(200):
        noise = generator.normal(size=int(generator.integers(2, 200)))
        spikes = np.where(generator.random(noise.size) < 0.7, 0.0, noise)
        shape = (noise, np.round(noise), spikes, np.sign(noise), np.ones(noise.size))[trial % 5]
        # The last sample is zero, because a motion falls to zero within a sampling interval.
        shape = np.append(shape, 0.0)
        record = Record(shape, 10 ** generator.uniform(-3.0, -0.3), "", "", "", "")
        period = np.array([10 ** generator.uniform(-2.5, 1.3)])
        damping = float(generator.choice([0.0, 0.02, 0.3, 0.99]))
        hardening = float(generator.choice([0.0, 1e-6, 0.1, 0.99]))
        (elastic,) = constant_ductility(record, period, [1.0], damping)
        strength = elastic.yield_strength_ratio[0] * 10 ** generator.uniform(-3.0, 0.1) or 1.0
        coarse, fine = (
            constant_strength(motion, period, [strength], damping, hardening=hardening)[0]
            for motion in (record, finer(record, 7))
        )
        assert coarse.sd == pytest.approx(fine.sd, rel=1e-10)
        assert coarse.residual == pytest.approx(fine.residual, abs=1e-7 * fine.sd[0])


def test_strong_oscillator_stays_elastic():
    periods = np.array([0.1, 1.0])
    (elastic,) = constant_ductility(NOISE, periods, [1.0])
    strength = 1.5 * elastic.yield_strength_ratio.max()
    (spectrum,) = constant_strength(NOISE, periods, [strength])
    assert spectrum.sd == pytest.approx(elastic.sd, rel=1e-14)
    assert spectrum.ductility == pytest.approx(elastic.yield_strength_ratio / strength, rel=1e-12)
    assert spectrum.reduction_factor == pytest.approx(spectrum.ductility, rel=1e-12)
    assert np.array_equal(spectrum.residual, [0.0, 0.0])
    assert spectrum.target is None


def test_zero_motion_requires_no_strength():
    record = Record(np.zeros(50), 0.01, "", "", "", "")
    (spectrum,) = constant_ductility(record, np.array([1.0]), [2.0])
    assert (spectrum.yield_strength_ratio[0], spectrum.sd[0], spectrum.residual[0]) == (
        0.0,
        0.0,
        0.0,
    )
    assert np.isnan(spectrum.ductility[0])
    (spectrum,) = constant_strength(record, np.array([1.0]), [0.1])
    assert (spectrum.ductility[0], spectrum.sd[0]) == (0.0, 0.0)


def test_elastoplastic_oscillators_under_el_centro_agree_with_chopra():
    """Chopra, Dynamics of Structures, 7.4: T = 0.5 s, 5 %, strengths of 1, 1/2, 1/4 and 1/8 of the
    elastic strength. The largest displacements are 2.25, 1.62, 1.75 and 2.07 in, the ductilities 1,
    1.44, 3.11 and 7.36."""
    record = read_record(real_file("elCentro1940_180.at2")).scaled(
        386.4 * 0.0254 / STANDARD_GRAVITY
    )
    record = replace(record, acceleration=np.append(0.0, record.acceleration))
    period = np.array([0.5])
    (elastic,) = constant_ductility(record, period, [1.0])
    strengths = [elastic.yield_strength_ratio[0] / factor for factor in (1, 2, 4, 8)]
    spectra = constant_strength(record, period, strengths)
    inches = [spectrum.sd[0] / 0.0254 for spectrum in spectra]
    assert inches == pytest.approx([2.25, 1.62, 1.75, 2.07], abs=0.006)
    assert [spectrum.ductility[0] for spectrum in spectra] == pytest.approx(
        [1.0, 1.44, 3.11, 7.36], abs=0.011
    )


# The search


def bumpy(heights, positions, widths):
    """Return a ductility that is not monotone: 1 / ratio with bumps over the logarithm of the
    ratio."""

    def ductility(ratio):
        x = math.log(ratio)
        bumps = [
            height * x * x * math.exp(-(((x + position) / width) ** 2))
            for height, position, width in zip(heights, positions, widths, strict=True)
        ]
        return math.exp(-x) * math.exp(sum(bumps))

    return ductility


@given(
    st.lists(
        st.tuples(st.floats(-2.0, 4.0), st.floats(0.1, 2.0), st.floats(0.05, 0.5)), max_size=3
    ),
    st.floats(1.05, 10.0),
)
def test_largest_of_several_strengths_is_found(bumps, target):
    ductility = bumpy(*zip(*bumps, strict=True)) if bumps else bumpy((), (), ())
    ratio = largest_ratio(ductility, target)
    assert ductility(ratio) == pytest.approx(target, rel=1e-7)
    # If a maximum only touches the target, both results are correct.
    assert all(
        ductility(x) < 1.001 * target
        for x in np.geomspace(1.0005 * ratio, 1.0, 400)
        if x > 1.0005 * ratio
    )


def test_narrow_maximum_between_search_steps_is_found():
    ductility = bumpy([10.0], [0.4], [0.03])
    top = math.exp(-0.4)
    target = 0.97 * ductility(top)
    assert max(ductility(x) for x in np.geomspace(1e-3, 0.6, 500)) > target
    assert top < largest_ratio(ductility, target) < 1.03 * top


def test_steep_rise_of_ductility_is_resolved():
    assert largest_ratio(lambda ratio: 1.0 + 1e6 * (1.0 - ratio), 3.0) == pytest.approx(
        1.0 - 2e-6, rel=1e-12
    )


def test_unreachable_ductility_is_refused():
    with pytest.raises(AnalysisError, match=r"strength .*ductility 3"):
        largest_ratio(lambda _: 1.5, 3.0)


def test_too_short_periods_are_refused():
    for function, levels in ((constant_ductility, [2.0]), (constant_strength, [0.1])):
        with pytest.raises(AnalysisError, match=r"period 9e-06 s .* at least 1e-05 s"):
            function(NOISE, np.array([1.0, 9e-6]), levels)
        assert np.isfinite(
            function(replace(NOISE, acceleration=NOISE.acceleration[:9]), [1e-5], levels)[0].sd[0]
        )


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"periods": [0.0]}, "periods must be positive"),
        ({"periods": []}, "periods must be positive"),
        ({"damping": 1.0}, "damping must be a ratio"),
        ({"hardening": 1.0}, "hardening must be a ratio"),
        ({"hardening": -0.1}, "hardening must be a ratio"),
        ({"hardening": math.nan}, "hardening must be a ratio"),
        ({"ductilities": [0.5]}, "ductilities must be numbers from 1 to 1000"),
        ({"ductilities": [math.nan]}, "ductilities must be numbers from 1 to 1000"),
        ({"strengths": [0.0]}, "yield strength ratios must be numbers from"),
        ({"strengths": [math.inf]}, "yield strength ratios must be numbers from"),
    ],
)
def test_invalid_arguments_are_refused(arguments, message):
    arguments = {"periods": [1.0]} | arguments
    function = constant_strength if "strengths" in arguments else constant_ductility
    if function is constant_ductility:
        arguments = {"ductilities": [2.0]} | arguments
    with pytest.raises(UsageError, match=message):
        function(NOISE, **arguments)
