"""Time steps over several samples of a record, which use only the impulse and the first moment of
the samples."""

from dataclasses import replace

import numpy as np
import pytest

from building_cases import Law, model, noise, oscillator, story, ten_bilinear, ten_linear
from references import orders
from selection import every
from step_checks import at_samples
from tdint import run
from tdint.methods.catalogue import catalogue, parse

DT = 0.01
ALL = list(catalogue())


def building_for(method, yield_force=3e5):
    """Return two stories with periods of 1.2 s and 0.5 s, so that central difference and rk5 are
    stable for steps of 0.08 s. All methods use one compiled variant."""
    linear = catalogue()[method].family.linear_only
    law = Law("linear", ()) if linear else Law("bilinear", (yield_force, 0.1))
    return model([story(1e5, 7e6, law, dashpot=5e4) for _ in range(2)])


@pytest.mark.parametrize("method", every(3, ALL))
def test_long_step_depends_only_on_impulse_and_moment_of_samples(method):
    """Samples (0, 1, -2, 1, 0) on four intervals have neither impulse nor first moment, and do not
    change the motion."""
    record = noise(samples=401)
    rng = np.random.default_rng(1)
    ripple = np.zeros(401)
    for start in range(0, 400, 4):
        ripple[start : start + 5] += rng.normal() * np.array([0.0, 1.0, -2.0, 1.0, 0.0])
    rippled = replace(record, acceleration=record.acceleration + ripple)
    plain, changed = (
        run(building_for(method), r, method=method, dt=4 * DT, history=True)
        for r in (record, rippled)
    )
    scale = np.max(np.abs(plain.history.displacement))
    assert np.max(np.abs(plain.history.displacement - changed.history.displacement)) < 1e-9 * scale
    assert (
        np.max(np.abs(plain.history.absolute_acceleration - changed.history.absolute_acceleration))
        < 1e-6 * plain.record.pga
    )


@pytest.mark.parametrize("method", every(3, ALL))
def test_order_is_kept_with_several_samples_per_step(method):
    """Steps of 4 and 2 samples in a linear building keep the order, although the fitted lines have
    jumps that remain in the memory of a method."""
    dt = DT / 2
    record = noise(samples=801, dt=dt)
    building = building_for(method, yield_force=1e12)
    exact = run(
        building_for("exact"),
        record,
        method="exact",
        dt=dt,
        duration=record.duration,
        history=True,
    ).history.displacement
    errors = []
    for k in (4, 2):
        found = run(
            building, record, method=method, dt=k * dt, duration=record.duration, history=True
        )
        errors.append(
            np.linalg.norm(found.history.displacement - exact[::k]) / np.linalg.norm(exact[::k])
        )
    declared = min(parse(method).order, 4) if method != "exact" else 4
    assert np.log2(errors[0] / errors[1]) > declared - 0.35


@pytest.mark.parametrize("method", every(3, ALL))
def test_ground_acceleration_of_short_steps_equals_record(method):
    """A step of one sampling interval, or of a fraction of it, uses the line of the record."""
    record = noise(samples=101)
    rows = [
        run(
            building_for(method),
            record,
            method=method,
            dt=dt,
            duration=record.duration,
            history=True,
        )
        for dt in (DT, DT / 2)
    ]
    for response in rows:
        ends = response.history.ground_acceleration
        every = round(DT / response.dt)
        assert np.array_equal(ends[::every], record.acceleration)


def test_impulse4_is_of_order_4_with_long_steps_of_yielding_building():
    record = noise(samples=801, peak=6.0)
    _, exact = at_samples(ten_bilinear(), record, "impulse4", 16)
    errors = []
    for k in (1, 2, 4):
        coarse = run(
            ten_bilinear(),
            record,
            method="impulse4",
            dt=k * DT,
            duration=record.duration,
            history=True,
        )
        assert coarse.branch_changes > 100
        errors.append(
            np.linalg.norm(coarse.history.displacement - exact[::k]) / np.linalg.norm(exact[::k])
        )
    assert 3.4 < -np.mean(orders(errors)) < 4.6


@pytest.mark.parametrize("method", ["impulse4", "newmark-average", "moment4", "park", "rk5"])
def test_energy_balance_of_long_steps(method):
    """The input is the work of the fitted lines, which are not continuous. Long steps keep the
    energy balance of steps of one sample."""
    response = run(ten_linear(), noise(), method=method, dt=2 * DT, allow_unstable=True)
    short = run(ten_linear(), noise(), method=method, dt=DT)
    assert abs(response.energy.error) < 20.0 * abs(short.energy.error) + 1e-9
    if parse(method).order >= 4:
        assert response.energy.input == pytest.approx(short.energy.input, rel=5e-4)


@pytest.mark.parametrize(
    ("method", "samples"), [("impulse4", 3), ("exact", 2), ("hht:alpha=-0.3", 1)]
)
def test_history_has_times_and_absolute_accelerations_of_steps(method, samples):
    """Absolute accelerations are the floor forces divided by the masses, for any line that
    approximates the record."""
    record = noise()
    response = run(
        ten_linear(None),
        record,
        method=method,
        dt=samples * DT,
        duration=record.duration,
        history=True,
    )
    history = response.history
    assert np.allclose(history.time, samples * DT * np.arange(response.steps + 1), rtol=1e-12)
    ground = response.record.acceleration[::samples][: response.steps]
    assert np.array_equal(history.ground_acceleration[:-1], ground)
    forces = history.shear - np.hstack([history.shear[:, 1:], np.zeros((len(history.shear), 1))])
    assert np.allclose(history.absolute_acceleration, -forces / 2e5, rtol=1e-9, atol=1e-9)


# ---- Peaks between the steps


@pytest.mark.parametrize("method", ["impulse4", "gauss4", "moment4"])
def test_peaks_of_free_vibration_between_steps(method):
    """The steps are a twentieth of the period and contain no peak of the sine. The interpolation
    has an error of (omega h)^4 / 1900 of the acceleration, and the period error of the method adds
    about three times (omega h)^4 / 720."""
    omega = 2.0 * np.pi
    h = 0.0517
    response = run(
        oscillator(omega, displacement=(1.0,), velocity=(1.0,)), method=method, dt=h, duration=10.0
    )
    amplitude = np.hypot(1.0, 1.0 / omega)
    bound = (omega * h) ** 4 * (1.0 / 1900.0 + 3.0 / 720.0)
    stories = response.stories
    for found, size in (
        (stories.peak_displacement, 1.0),
        (stories.peak_velocity, omega),
        (stories.peak_absolute_acceleration, omega**2),
        (stories.peak_shear, omega**2),
    ):
        assert found[0] == pytest.approx(amplitude * size, rel=bound)


def test_unresolved_modes_cause_a_warning():
    """For omega dt = 30, the missed peak of the velocity is reported and not extrapolated."""
    omega = 300.0
    response = run(
        oscillator(omega, displacement=(1.0,)), method="newmark-average", dt=0.1, duration=5.0
    )
    assert response.stories.peak_displacement[0] == pytest.approx(1.0, rel=1e-9)
    assert any("does not resolve the highest modes" in text for text in response.warnings)
    assert np.any(response.interstep_bound.peak_absolute_acceleration > 0.0) or np.any(
        response.interstep_bound.peak_velocity > 0.0
    )


def test_resolved_steps_cause_no_note():
    response = run(ten_bilinear(), noise(), method="impulse4")
    assert not any("too long" in note for note in response.notes)


@pytest.mark.parametrize("dt", [1e-7, 1e-8, 1e-9])
def test_very_short_steps_have_no_peaks_between_steps(dt):
    """Such steps occur between two events: (omega dt)^2 is below the rounding of the
    displacements."""
    response = run(
        oscillator(10.0, 0.05, displacement=(1.0,)), method="impulse4", dt=dt, duration=200.0 * dt
    )
    assert response.stories.peak_absolute_acceleration[0] == pytest.approx(100.0, rel=1e-12)
    assert response.notes == ()


def test_peaks_between_steps_are_of_order_of_moment4():
    """The hardening building vibrates in all its modes, with maximum shears at maximum stiffness.
    With the parabolas of the method, peaks of drift and displacement would be of order 2 to 3."""
    hardening = [story(1e5, 2e7, Law("polynomial", (2e7, 0.0, 1e10))) for _ in range(3)]
    case = model(hardening, displacement=(0.01, -0.01, 0.03), velocity=(0.3, 0.1, -0.2))
    fine = run(case, method="impulse4", dt=0.01 / 32, duration=3.0).stories
    found = [run(case, method="moment4", dt=0.01 / 2**j, duration=3.0).stories for j in range(4)]
    for name in (
        "peak_drift",
        "peak_displacement",
        "peak_shear",
        "peak_velocity",
        "peak_absolute_acceleration",
    ):
        errors = [
            np.max(np.abs(getattr(stories, name) / getattr(fine, name) - 1.0)) for stories in found
        ]
        assert np.min(np.log2(np.divide(errors[:-1], errors[1:]))) > 3.6, name
