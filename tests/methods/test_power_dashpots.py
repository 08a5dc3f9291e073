"""Power-law dashpots: methods that support them, compared with a linear dashpot, DOP853 and the
order of the method."""

import math
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from building_cases import Force, Law, model, noise, story
from references import orders, smooth
from selection import every
from step_checks import at_samples, refined
from tdint import run
from tdint.errors import AnalysisError
from tdint.methods.catalogue import catalogue, parse
from tdint.model.story import PowerDashpot

TAKING = [
    name
    for name, method in catalogue().items()
    if method.family.power_dampers and not method.family.linear_only
]
REFUSING = [name for name, method in catalogue().items() if not method.family.power_dampers]
LONG_MEMORY = ("houbolt", "park")


def damped(mass, stiffness, coefficient, exponent, linear_below=0.0, law=None):
    base = story(mass, stiffness, law) if law else story(mass, stiffness)
    return replace(base, power_dashpot=PowerDashpot(coefficient, exponent, linear_below))


@pytest.mark.parametrize("name", TAKING)
def test_exponent_1_equals_viscous_dashpot(name):
    record = noise(samples=201)
    linear = model([story(2e5, 4e7, dashpot=4e5), story(2e5, 4e7, dashpot=3e5)])
    power = model([damped(2e5, 4e7, 4e5, 1.0), damped(2e5, 4e7, 3e5, 1.0)])
    viscous, power_law = (
        run(building, record, method=name, dt=record.dt, history=True).history
        for building in (linear, power)
    )
    # impulse4 integrates a linear dashpot exactly, another by quadrature
    bound = 2e-3 if name == "impulse4" else 1e-9
    scale = np.max(np.abs(viscous.displacement))
    assert np.max(np.abs(viscous.displacement - power_law.displacement)) < bound * scale


@cache
def forced(exponent):
    """u of 10 u'' + c v (v^2 + 0.04)^e + 200 u = 40 cos 5 t by DOP853, each tenth of a second."""

    def acceleration(t, u, v):
        return (
            40.0 * math.cos(5.0 * t)
            - 20.0 * v * (v * v + 0.04) ** (0.5 * (exponent - 1.0))
            - 200.0 * u
        ) / 10.0

    return smooth(acceleration, 0.0, 0.0, np.linspace(0.0, 2.0, 21))[0]


@pytest.mark.parametrize("name", every(2, TAKING))
@pytest.mark.parametrize("exponent", every(2, [0.5, 1.7]))
def test_order_is_kept_with_power_law_dashpot(name, exponent):
    building = model([damped(10.0, 200.0, 20.0, exponent, 0.2)], forces=[Force(1, 40.0, 0.0, 5.0)])
    errors = []
    for dt in (0.05, 0.025, 0.0125, 0.00625) if name == "rk5" else (0.02, 0.01, 0.005, 0.0025):
        history = run(building, method=name, dt=dt, duration=2.0, history=True).history
        errors.append(
            np.max(np.abs(history.displacement[:: round(0.1 / dt), 0] - forced(exponent)))
        )
    assert errors[-1] < 1e-4
    assert orders(errors)[-1] > parse(name).order - (0.35 if name in LONG_MEMORY else 0.2)


@pytest.mark.parametrize("name", ["impulse4", "moment4", "newmark-average", "gauss4"])
def test_energy_balance_of_yielding_building_with_fluid_dampers(name):
    """The exponent 0.35 is typical of fluid viscous dampers; the dampers dissipate most of the
    input."""
    record = noise(peak=4.0)
    law = Law("bilinear", (8e5, 0.05))
    building = model([damped(2e5, 8e7, 3e5, 0.35, 0.002, law) for _ in range(5)])
    response = run(building, record, method=name, dt=record.dt / 4)
    assert response.status == "done"
    assert abs(response.energy.error) < 1e-3
    assert response.energy.dampers > 0.5 * response.energy.input


@pytest.mark.long
def test_located_yielding_with_dampers_agrees_with_average_acceleration():
    record = noise(peak=8.0)
    law = Law("bilinear", (4e5, 0.05))
    building = model([damped(2e5, 4e7, 1e5, 0.5, 0.02, law) for _ in range(3)])
    runs, finest, errors = refined(building, record, (1, 2, 4, 32))
    assert runs[0].branch_changes > 20
    assert errors[-1] < 1e-4
    _, average = at_samples(building, record, "newmark-average", 128)
    assert np.max(np.abs(average - finest)) < 5e-5 * np.max(np.abs(finest))


@pytest.mark.parametrize("name", REFUSING)
def test_methods_for_linear_damping_refuse_power_law_dashpots(name):
    with pytest.raises(AnalysisError, match="does not support power-law dashpots"):
        run(
            model([damped(1.0, 100.0, 1.0, 0.5, 0.01)], velocity=(1.0,)),
            method=name,
            dt=0.01,
            duration=0.1,
        )


@pytest.mark.parametrize("gamma", [0.5, 0.6])
def test_explicit_methods_balance_dashpot_forces_at_end_of_step(gamma):
    """The displacement at the end of a step of an explicit Newmark method does not depend on the
    acceleration there, but the force of the dashpot does, so the step needs several iterations.
    The accelerations of the history are computed from equilibrium. They fulfil Newmark's equation
    v1 = v0 + h ((1 - gamma) a0 + gamma a1) only if the step has converged."""
    building = model([damped(1.0, 400.0, 30.0, 0.3, 0.01)], velocity=(0.5,))
    h = 0.02
    method = f"newmark:beta=0:gamma={gamma}"
    history = run(building, method=method, dt=h, duration=0.4, history=True, check=False).history
    v, a = history.velocity[:, 0], history.absolute_acceleration[:, 0]
    mismatch = v[1:] - v[:-1] - h * ((1.0 - gamma) * a[:-1] + gamma * a[1:])
    assert np.max(np.abs(mismatch)) < 1e-8 * np.max(np.abs(v))
