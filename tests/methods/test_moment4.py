"""Tests of moment4: it equals impulse4 in linear buildings, never generates energy, and integrates
the load by its moments."""

from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from building_cases import (
    FIVE_PERCENT,
    Force,
    Law,
    ModalDamping,
    model,
    noise,
    oscillator,
    story,
    ten_bilinear,
    ten_linear,
)
from random_buildings import CONSERVATIVE, HYSTERETIC, degrading_building, random_building
from selection import every
from step_checks import RAYLEIGH, building
from tdint import load_model, run
from tdint.assessment.failures.failures import attempt, problems
from tdint.kernels import layout as rows
from tdint.kernels.equations import moment4 as equations
from tdint.kernels.linear_terms import force_moment
from tdint.kernels.stories import path
from tdint.kernels.stories.branches import enter
from tdint.kernels.stories.law_tables import law_state_table
from tdint.kernels.time_loop.ground import fitted_line
from tdint.methods import moment4
from tdint.methods.catalogue import parse
from tdint.model.building import assemble, force_table
from tdint.model.story import PowerDashpot
from tdint.response.runs.measured_stability import amplification, spectral_radius

RHO = (1.0, 0.8, 0.5, 0.2, 0.0)
OFFICE = load_model(Path(__file__).parents[2] / "configs" / "ten-story-bilinear.yaml")
DT = 0.01


def both(rho_inf):
    return f"moment4:rho_inf={rho_inf}", f"impulse4:rho_inf={rho_inf}"


def close(got, expected, tolerance=1e-12):
    return np.max(np.abs(got - expected)) <= tolerance * np.max(np.abs(expected))


# ---- Linear buildings


@pytest.mark.parametrize("rho_inf", RHO)
@pytest.mark.parametrize("xi", [0.0, 0.05])
def test_amplification_matrix_equals_impulse4(rho_inf, xi):
    omega = np.geomspace(1e-3, 1e6, 60)
    mine, other = (
        amplification(parse(method), omega, np.full(60, xi), 1.0) for method in both(rho_inf)
    )
    scale = np.array(
        [[np.ones(60), 1.0 / np.maximum(omega, 1.0)], [np.maximum(omega, 1.0), np.ones(60)]]
    )
    scale = np.moveaxis(scale, 2, 0)  # u over v is 1 / omega where the step resolves it
    assert np.max(np.abs(mine - other) / scale) < 1e-10
    radii = [
        spectral_radius(parse(method), omega, np.full(60, xi), 1.0) for method in both(rho_inf)
    ]
    assert np.max(radii[0]) <= 1.0 + 1e-12
    assert radii[0] == pytest.approx(radii[1], abs=1e-9)


@pytest.mark.parametrize("rho_inf", every(2, RHO))
@pytest.mark.parametrize("case", ["free", "record"])
@pytest.mark.parametrize(
    "damping", [RAYLEIGH, ModalDamping((0.02, 0.05, 0.03, 0.08))], ids=["rayleigh", "modal"]
)
def test_histories_of_linear_buildings_equal_impulse4(rho_inf, case, damping):
    """The building has dashpots, P-delta and Rayleigh damping; it has a floor force if the load is
    linear or rho_inf is below 1."""
    case_model = building(damping)
    if rho_inf == 1.0:
        case_model = replace(case_model, excitation=replace(case_model.excitation, forces=()))
    record = noise(401) if case == "record" else None
    times = {} if record else {"dt": 0.01, "duration": 4.0}
    mine, other = (
        run(case_model, record, method=method, history=True, **times).history
        for method in both(rho_inf)
    )
    for quantity in ("displacement", "velocity", "absolute_acceleration", "shear"):
        assert close(getattr(mine, quantity), getattr(other, quantity))


def test_linear_building_requires_one_solve_per_step():
    response = run(ten_linear(), noise(), method="moment4")
    assert response.iterations == response.steps


# ---- Conservative problems


@pytest.mark.parametrize("rho_inf", RHO)
@pytest.mark.parametrize(
    "name", ["hardening", "softening", "stiff-pair", "limit-sqrt-12", "large-step"]
)
def test_no_step_increases_energy(name, rho_inf):
    problem = problems()[name]
    for dt, steps in problem.steps:
        response = run(
            problem.model, method=both(rho_inf)[0], dt=dt, duration=dt * steps, history=True
        )
        energy = problem.energy(response.history) / problem.energy_scale
        assert np.max(np.diff(energy)) <= (1e-6 if name == "softening" else 1e-11)
        assert response.substeps == 0


@pytest.mark.parametrize(
    ("name", "times", "kept"),
    [
        ("hardening", 1, 1e-9),
        ("hardening", 4, 1e-9),
        ("softening", 1, 1e-6),
        ("softening", 4, 1e-2),
    ],
)
def test_energy_is_conserved_with_any_time_step(name, times, kept):
    problem = problems()[name]
    for dt, steps in problem.steps:
        response = run(
            problem.model, method="moment4", dt=times * dt, duration=dt * steps, history=True
        )
        assert np.max(np.abs(problem.energy(response.history) / problem.energy_scale - 1.0)) <= kept


@pytest.mark.parametrize("rho_inf", [1.0, 0.5, 0.0])
@pytest.mark.parametrize("name", every(3, problems()))
def test_verdicts_equal_impulse4_except_for_nonlinear_laws(name, rho_inf):
    mine, other = (attempt(parse(method), problems()[name]) for method in both(rho_inf))
    if name not in ("hardening", "softening"):
        assert [trial.verdict for trial in mine] == [trial.verdict for trial in other]
    elif rho_inf == 1.0:
        assert {trial.verdict for trial in mine} == {"pass"}


def energies(building_model, method, h, duration):
    """Return the response of a free vibration, and its kinetic and stored energy over the initial
    energy."""
    response = run(building_model, method=method, dt=h, duration=duration, history=True)
    parts = response.history.energy
    total = parts.kinetic + parts.strain
    return response, total / total[0]


@pytest.mark.long
@pytest.mark.parametrize(
    ("cases", "seed"), [(20, 11), pytest.param(200, 0, marks=pytest.mark.slow)]
)
def test_energy_of_random_conservative_buildings_is_constant(cases, seed):
    """The energy is constant within rounding, and few steps are halved."""
    generator = np.random.default_rng(seed)
    halved = 0
    for number in range(cases):
        building_model, period = random_building(generator, CONSERVATIVE)
        response, energy = energies(
            building_model, "moment4", period * generator.uniform(0.005, 0.2), 20.0 * period
        )
        by_points = any(each.law.name == "tanh" for each in building_model.stories)
        assert np.max(np.abs(energy - 1.0)) < (1e-6 if by_points else 1e-8), number
        halved += response.substeps > 0
    assert halved <= 0.05 * cases


@pytest.mark.parametrize(
    ("cases", "seed"), [(20, 12), pytest.param(200, 1, marks=pytest.mark.slow)]
)
def test_energy_of_random_yielding_buildings_does_not_increase(cases, seed):
    generator = np.random.default_rng(seed)
    for number in range(cases):
        building_model, period = random_building(generator, HYSTERETIC)
        response, energy = energies(
            building_model, "moment4", period * generator.uniform(0.005, 0.2), 20.0 * period
        )
        assert np.max(np.diff(energy)) <= 1e-12, number
        assert np.max(np.abs(response.history.energy.error)) <= 1e-10, number


# ---- The balance of energy


def damped(building_model):
    """Return the building with a power-law dashpot in each story."""
    stories = [
        replace(story, power_dashpot=PowerDashpot(2e5, 0.35, 0.002))
        for story in building_model.stories
    ]
    return replace(building_model, stories=tuple(stories))


BALANCED = {
    "linear": ten_linear(),
    "modal": ten_linear(ModalDamping((0.05,) * 10)),
    "yielding": ten_bilinear(),
    "yielding, modal": ten_bilinear(ModalDamping((0.05,) * 10)),
    "fluid dampers": damped(ten_bilinear(None)),
    "p-delta": replace(ten_bilinear(), p_delta=True),
    "pounding": model(
        [story(2e5, 3.5e8, Law("gap", (0.004, 2e9))) for _ in range(5)], damping=FIVE_PERCENT
    ),
    "degrading": model(
        [story(2e5, 3.5e8, Law("peak-oriented", (1e6, 0.05, 0.4))) for _ in range(5)],
        damping=FIVE_PERCENT,
    ),
    "driven": model(
        [story(2e5, 3.5e8, Law("polynomial", (3.5e8, 0.0, 1e12)), dashpot=1e5)],
        forces=[Force(1, 1e6, 5e5, 30.0)],
    ),
}


@pytest.mark.parametrize("case", every(2, BALANCED))
def test_energy_balance_is_satisfied_at_every_step(case):
    record = noise(401)
    for parts in (4, 1, 1 / 2, 1 / 8):
        response = run(BALANCED[case], record, method="moment4", dt=record.dt / parts, history=True)
        assert response.status == "done"
        assert response.energy.viscous + response.energy.dampers > 0.0
        assert np.max(np.abs(response.history.energy.error)) < 1e-10


@pytest.mark.parametrize("case", ["linear", "yielding", "fluid dampers", "driven"])
def test_dissipative_members_lose_energy_in_every_step(case):
    record = noise(401)
    for rho_inf in (0.8, 0.0):
        response = run(BALANCED[case], record, method=both(rho_inf)[0], history=True)
        assert np.min(np.diff(response.history.energy.error)) > -1e-13
        assert 0.0 < response.energy.error < 0.1


def test_energy_loss_agrees_with_equations():
    """The loss in each step is h^2 r / 12 (A1 M A1 + U1 K U1), with A1 and U1 from the motion."""
    rho_inf, omega, h = 0.5, 3.0, 0.2
    r = (1.0 - rho_inf) / (6.0 * (1.0 + rho_inf))
    history = run(
        oscillator(omega, displacement=(1.0,)),
        method=both(rho_inf)[0],
        dt=h,
        duration=4.0,
        history=True,
    ).history
    u, v = history.displacement[:, 0], history.velocity[:, 0]
    mean = np.diff(v) / h
    a1 = 12.0 / h * (v[:-1] + 0.5 * h * mean - np.diff(u) / h)
    u1 = h * (mean + r * a1)
    energy = 0.5 * v**2 + 0.5 * omega**2 * u**2
    assert -np.diff(energy) == pytest.approx(
        h * h * r / 12.0 * (a1**2 + omega**2 * u1**2), rel=1e-9
    )


# ---- The load


def test_moment_of_floor_force():
    nodes, weights = np.polynomial.legendre.leggauss(40)
    s = 0.5 * nodes
    for omega, h in ((0.0, 0.1), (3.0, 0.02), (20.0, 0.009), (20.0, 0.011), (40.0, 0.3)):
        forces = force_table([Force(1, 3.0, -2.0, omega)])
        t = 0.7

        angle = omega * (t + (s + 0.5) * h)
        moment = 12.0 * s * (3.0 * np.cos(angle) - 2.0 * np.sin(angle))
        assert force_moment(forces, 0, t, h) == pytest.approx(weights @ moment / 2.0, abs=1e-13)


@pytest.mark.parametrize(
    ("begin", "end"), [(0.0, 1.0), (3.25, 3.5), (2.0, 6.0), (1.5, 4.75), (6.0, 10.0), (9.0, 12.0)]
)
def test_fitted_line_has_impulse_and_moment_of_samples(begin, end):
    """Intervals beyond the last sample, where the ground is at rest, are included."""
    ground = np.random.default_rng(5).normal(size=9)
    knots = np.union1d(np.arange(14.0), [begin, end])
    knots = knots[(knots >= begin) & (knots <= end)]
    values = np.interp(knots, np.arange(14.0), np.append(ground, np.zeros(5)))
    # Simpson's rule is exact for the products of lines.
    middle = 0.5 * (begin + end)
    halves, halfway = 0.5 * (knots[1:] + knots[:-1]), 0.5 * (values[1:] + values[:-1])
    lengths = np.diff(knots)
    impulse = np.sum(lengths * halfway)
    edges = (knots - middle) * values
    moment = np.sum(lengths / 6.0 * (edges[:-1] + 4.0 * (halves - middle) * halfway + edges[1:]))
    first, last = fitted_line(ground, begin, end)
    duration = end - begin
    assert 0.5 * duration * (first + last) == pytest.approx(impulse, abs=1e-14)
    assert duration**2 / 12.0 * (last - first) == pytest.approx(moment, abs=1e-13)


# ---- Ten yielding stories


@cache
def reference(samples=1):
    """Return the result of impulse4 at dt / 16, which is within 2e-10 of that at dt / 64."""
    response = run(OFFICE, method="impulse4", dt=DT / 16, history=True)
    return response.history.displacement[:: 16 * samples], response.stories.peak_drift


def l2(u, exact):
    exact = exact[: len(u)]
    return np.linalg.norm(u[: len(exact)] - exact) / np.linalg.norm(exact)


@pytest.mark.parametrize(("parts", "allowed"), [(1, 2e-5), (2, 2e-6), (4, 3e-7)])
def test_errors_for_ten_yielding_stories(parts, allowed):
    response = run(OFFICE, method="moment4", dt=DT / parts, history=True)
    exact, peaks = reference()
    assert l2(response.history.displacement[::parts], exact) <= allowed
    assert np.max(np.abs(response.stories.peak_drift / peaks - 1.0)) <= 10.0 * allowed
    assert response.iterations <= 1.2 * response.steps
    assert (response.substeps, response.branch_changes) == (0, 0)
    assert np.max(np.abs(response.history.energy.error)) < 1e-12


@pytest.mark.parametrize(("samples", "allowed"), [(2, 2e-4), (4, 4e-3), (8, 2e-2)])
def test_errors_for_ten_yielding_stories_with_long_steps(samples, allowed):
    response = run(OFFICE, method="moment4", dt=DT * samples, history=True)
    assert l2(response.history.displacement, reference(samples)[0]) <= allowed
    assert np.max(np.abs(response.history.energy.error)) < 1e-12


# ---- Large steps


@pytest.mark.parametrize(
    ("method", "damping", "halved"), [("moment4", None, 2), ("gauss4", FIVE_PERCENT, 0)]
)
def test_large_steps_of_yielding_building_converge(method, damping, halved):
    """The steps are a tenth to a quarter of the fundamental period of a yielding building, where
    plain Newton iterations cycle."""
    building_model = ten_bilinear(damping)
    building_model = replace(
        building_model,
        initial=replace(building_model.initial, displacement=tuple(0.05 * np.arange(1, 11))),
    )
    for h in (0.1, 0.2):
        response, energy = energies(building_model, method, h, 8.0)
        assert response.substeps <= halved
        assert method == "gauss4" or np.max(np.diff(energy)) <= 1e-12


# ---- Turns


def turns_from_rest(monkeypatch, damping):
    """Perform ten steps from rest, in plain Python, of stories that reverse under a ramp of ground
    acceleration."""
    building_model = model(
        [story(1e5, 4e7, Law("peak-oriented", (1e-9, 0.9, 0.3)))] * 2, damping=damping
    )
    built = assemble(building_model)
    law_state = law_state_table(built.law_parameters)
    for i in range(2):
        enter(built.law_parameters, law_state, i)
    turned, switch = [], path.switch

    def watched(law_parameters, table, i, block, event):
        if event == rows.REVERSED:
            turned.append(i)
        switch(law_parameters, table, i, block, event)

    monkeypatch.setattr(path, "switch", watched)
    flags = np.zeros(rows.FLAGS_SIZE)
    flags[rows.BRANCHES] = rows.ALL_BRANCHES
    scratch = np.zeros((equations.scratch_rows(len(built.modal)), 16))
    state, step_status, h = np.zeros((3, 3)), np.zeros(rows.STEP_STATUS_SIZE), 0.02
    forces = np.zeros((0, rows.FORCE_COLUMNS))
    scene = (
        np.array(moment4.coefficients(1.0)), built.linear_terms, built.modal, built.law_parameters,
        forces, flags,
    )  # fmt: skip
    for k in range(10):
        load = np.array([k * h, k * h, (k + 1) * h, 0.0, 0.0])
        assert moment4.step.function(*scene, h, load, state, law_state, scratch, step_status) >= 0
    return turned


@pytest.mark.parametrize(
    "damping", [None, RAYLEIGH, ModalDamping((0.05, 0.05))], ids=["none", "rayleigh", "modal"]
)
def test_no_reversal_is_found_from_rest_under_ramp(monkeypatch, damping):
    """All drifts increase, in upper stories with higher powers of time, so that their parabolas
    start in the opposite direction. Reversals would be found if only the parabola were searched."""
    assert turns_from_rest(monkeypatch, damping) == []
    monkeypatch.setattr(equations, "_has_no_reversal", lambda *_: False)
    assert turns_from_rest(monkeypatch, damping)


@pytest.mark.slow
def test_energy_balance_of_degrading_buildings():
    """A hundred random buildings have stories that lose strength and stiffness, with and without
    reversals of their parabolas. In collapsing buildings, the energies grow far beyond the input,
    so that rounding errors are relative to these energies."""
    for number in range(100):
        case, record = degrading_building(number)
        energy = run(case, record, method="moment4").energy
        size = max(
            abs(value)
            for value in (energy.kinetic, energy.strain, energy.viscous, energy.reference)
        )
        assert abs(energy.error) * energy.reference < 1e-12 * size, number
