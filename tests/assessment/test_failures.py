"""Test problems of the failure assessment: reference solutions by independent calculations, and the
verdicts on methods."""

import math
from dataclasses import replace
from decimal import Decimal
from functools import cache
from pathlib import Path

import numpy as np
import pytest

import readmes
from references import matrices, smooth
from selection import every
from tdint import load_model, run
from tdint.assessment.failures.failures import (
    attempt,
    hardening_motion,
    problems,
    soft_node_motion,
    softening_motion,
    usual_methods,
)
from tdint.methods.catalogue import parse

CONFIGS = Path(__file__).parents[2] / "configs"
NEEDED = {
    "hardening": "hardening", "softening": "softening", "stiff-node": "stiff-soft-node",
    "soft-node": "stiff-soft-node", "stiff-pair": "stiff-pair",
}  # fmt: skip


@cache
def trials(method, name):
    return attempt(parse(method), problems()[name])


def trial(method, name, dt=None):
    """Return the trial of a method on a problem; `dt` selects the step of a problem with several
    steps."""
    found = [result for result in trials(method, name) if dt is None or result.dt == dt]
    assert len(found) == 1
    return found[0]


# ---- Reference solutions


def test_hardening_motion_solves_its_equation():
    times = np.linspace(0.0, 3.0, 151)  # eleven of its periods
    u = smooth(lambda t, u, v: -100.0 * u - 1000.0 * u**3, 1.5, 0.0, times, 1e-12, math.inf)[0]
    assert hardening_motion(times) == pytest.approx(u, abs=1e-9)


@pytest.mark.long
def test_softening_motion_agrees_with_independent_integration():
    """The motion with the smallest time step of the problem agrees; the other time steps are
    subsets of its samples."""
    (fine, steps), *others = problems()["softening"].steps
    times = fine * np.arange(steps + 1)
    u = smooth(lambda t, u, v: -100.0 * math.tanh(u), 4.0, 0.0, times, 1e-10, math.inf)[0]
    assert softening_motion(fine, steps) == pytest.approx(u, abs=4e-6)
    for dt, count in others:
        assert softening_motion(dt, count) == pytest.approx(u[:: round(dt / fine)], abs=4e-6)


def test_soft_node_motion_is_limit_of_rigid_base():
    """The response to u'' + u = sin 1.2 t from rest has the published amplitudes."""
    times = np.linspace(0.0, 10.0, 101)
    u = smooth(lambda t, u, v: math.sin(1.2 * t) - u, 0.0, 0.0, times)[0]
    assert soft_node_motion(times) == pytest.approx(u, abs=1e-11)
    assert soft_node_motion(times) == pytest.approx(
        2.7273 * np.sin(times) - 2.2727 * np.sin(1.2 * times), abs=1e-4
    )


def test_stiff_pair_has_frequencies_of_pendulum():
    mass, _, stiffness = matrices(problems()["stiff-pair"].model)
    omega = np.sqrt(np.linalg.eigvals(stiffness / mass[:, None]))
    assert sorted(omega) == pytest.approx([math.sqrt(9.81), math.sqrt(1e8)], rel=1e-6)


@pytest.mark.parametrize(
    "name", [name for name in problems() if not problems()[name].model.excitation.forces]
)
def test_closed_form_energy_equals_energy_of_run(name):
    """Both energies are equal at the start and at the end, when no support moves."""
    problem = problems()[name]
    dt, steps = problem.steps[0]
    response = run(
        problem.model, method="impulse4:rho_inf=0.5", dt=dt, duration=dt * steps, history=True
    )
    energy = problem.energy(response.history)
    assert energy[0] == pytest.approx(response.energy.initial, rel=1e-12)
    assert energy[0] == pytest.approx(problem.energy_scale, rel=1e-6)
    end = response.energy.kinetic + response.energy.strain
    assert energy[-1] == pytest.approx(end, rel=1e-9, abs=1e-12 * energy[0])


@pytest.mark.parametrize(("name", "file"), NEEDED.items())
def test_model_files_define_the_problems(name, file):
    """Building, load, start, time step and duration agree, and the method of the file passes."""
    problem, model = problems()[name], load_model(CONFIGS / f"{file}.yaml")
    assert model.stories == problem.model.stories
    assert model.excitation == problem.model.excitation
    assert model.initial.displacement == pytest.approx(
        problem.model.initial.displacement, rel=1e-15
    )
    assert model.initial.velocity == problem.model.initial.velocity
    steps = dict(problem.steps)[model.analysis.dt]
    assert model.analysis.duration == pytest.approx(steps * model.analysis.dt, rel=1e-12)
    assert trial(model.analysis.method, name, model.analysis.dt).verdict == "pass"


# ---- Verdicts, with the numbers of the table in the README


@pytest.mark.parametrize(
    ("method", "name", "dt", "verdict"),
    [
        ("newmark-average", "hardening", 0.02, "gains energy"),
        ("impulse", "hardening", 0.005, "loses energy"),
        ("newmark-average", "softening", 0.05, "loses energy"),
        ("impulse4", "softening", 0.05, "pass"),
        ("impulse4:rho_inf=0.5", "stiff-node", None, "pass"),
        ("impulse4", "stiff-node", None, "rings"),
        ("gauss4", "stiff-pair", None, "rings"),
        ("park", "stiff-pair", None, "pass"),
        ("houbolt", "stiff-pair", None, "pass"),
    ],
)
def test_verdict_of_trial(method, name, dt, verdict):
    found = trial(method, name, dt)
    assert (found.outcome, found.verdict) == ("done", verdict)
    if verdict in ("gains energy", "loses energy"):
        assert found.measure == (
            found.energy_ratio_max if verdict == "gains energy" else found.energy_ratio_min
        )
    if name in ("stiff-node", "stiff-pair"):
        assert found.error == found.measure


def test_chaotic_growth_gains_energy():
    gained = trial("impulse", "softening", 0.1)
    # A different last digit of the initial state changes the ratio to values between 40 and 90.
    assert 20.0 < gained.energy_ratio_max < 200.0
    assert (gained.outcome, gained.verdict) == ("diverged", "gains energy")
    # A run of `tdint run` with a final energy of twice the input energy is diverged; the
    # verdict states the type of failure.
    ran_away = trial("impulse", "hardening", 0.02)
    assert ran_away.energy_ratio_max > 100.0
    assert (ran_away.outcome, ran_away.verdict) == ("diverged", "gains energy")


def test_explicit_model_based_methods_blow_up_in_hardening_story():
    for method in ("chang", "cr", "kr-alpha"):
        blown = trial(method, "hardening", 0.05)
        assert (blown.outcome, blown.verdict) == ("diverged", "blows up")
        assert blown.time == pytest.approx(blown.steps * blown.dt)
        assert blown.steps < 10
        assert all(
            map(
                math.isnan,
                (blown.energy_ratio_min, blown.energy_ratio_max, blown.error, blown.measure),
            )
        )


def test_errors_of_dissipative_impulse4_at_stiff_and_soft_node():
    """The errors agree, to the two published digits, with another implementation of the same
    formulas."""
    assert trial("impulse4:rho_inf=0.5", "stiff-node").error == pytest.approx(0.55, rel=0.03)
    assert trial("impulse4:rho_inf=0.5", "soft-node").error == pytest.approx(2.3e-3, rel=0.02)
    assert math.isnan(trial("impulse4", "stiff-node").energy_ratio_min)
    # The maximum energy is the energy for infinite stiffness, within the error of the time steps.
    assert trial("impulse4:rho_inf=0.5", "stiff-node").energy_ratio_max == pytest.approx(
        1.0, abs=2e-3
    )


# ---- README


def digest():
    """Return the rows of the digest in the README of the methods: problem, dt, method, text of the
    cell."""
    lines = [line.strip("|").split("|") for line in readmes.digest("failures").splitlines() if line]
    header, *body = [
        [cell.strip(" `") for cell in line] for line in lines if not line[0].startswith("---")
    ]
    return [
        (row[0], float(row[1]), method, cell)
        for row in body
        for method, cell in zip(header[2:], row[2:], strict=True)
    ]


@pytest.mark.parametrize(("name", "dt", "method", "cell"), every(6, digest()))
def test_readme_table_agrees_with_trials(name, dt, method, cell):
    """Printed digits agree, and failures are bold. Values after ~ depend on rounding and agree
    within a factor of two."""
    result = trial(method, name, dt)
    assert cell.startswith("**") == (result.verdict != "pass")
    value = cell.strip("*")
    if value == result.verdict:
        return
    if value.startswith("~"):
        rounded = [measured_from(method, name, dt, part) for part in (1e-15, -1e-15, 1e-13)]
        assert max(rounded) > 1.01 * min(rounded), "rounding does not change it: give its digits"
        assert all(0.5 < measure / float(value[1:]) < 2.0 for measure in (*rounded, result.measure))
        return
    last_digit = 10.0 ** Decimal(value).as_tuple().exponent
    assert result.measure == pytest.approx(float(value), abs=0.51 * last_digit)


def measured_from(method, name, dt, part):
    """Return the measure of a problem with initial displacements larger by a factor of 1 + part."""
    problem = problems()[name]
    start = problem.model.initial
    start = replace(start, displacement=tuple(value * (1.0 + part) for value in start.displacement))
    moved = replace(problem, model=replace(problem.model, initial=start))
    return next(trial.measure for trial in attempt(parse(method), moved) if trial.dt == dt)


# ---- Limits and overshoot


@pytest.mark.parametrize(
    ("method", "name"),
    [
        ("central-difference", "limit-2"),
        ("fox-goodwin", "limit-sqrt-6"),
        ("newmark-linear", "limit-sqrt-12"),
    ],
)
def test_verdict_below_and_above_stability_limit(method, name):
    below, above = attempt(parse(method), problems()[name])
    assert (below.outcome, below.verdict) == ("done", "pass")
    assert (above.outcome, above.verdict) == ("unstable-step", "blows up")


def test_overshoot_from_displacement_and_velocity():
    """Wilson's method overshoots from both initial states, U0-V0 and impulse4 from neither, and cr
    only from an initial velocity."""
    for method, expected in {
        "wilson": (True, True),
        "u0v0": (False, False),
        "impulse4": (False, False),
        "cr": (False, True),
    }.items():
        found = tuple(
            trial(method, f"overshoot-{start}").verdict for start in ("displacement", "velocity")
        )
        assert found == tuple("overshoots" if overshoots else "pass" for overshoots in expected)
    # It grows with the square of omega dt.
    assert trial("wilson", "overshoot-displacement").error > 100.0


# ---- Outcomes


@pytest.mark.parametrize("name", every(3, problems()))
def test_every_trial_has_verdict_and_numbers(name):
    for integrator in usual_methods():
        for result in trials(integrator.label, name):
            numbers = (result.energy_ratio_max, result.error, result.measure)
            if result.verdict in ("blows up", "does not converge", "refused"):
                assert all(map(math.isnan, numbers))
                assert result.outcome in ("diverged", "not-converged", "unstable-step", "refused")
            else:
                assert all(map(math.isfinite, numbers))
                assert result.outcome in ("done", "diverged", "unstable-step")
                assert result.steps == dict(problems()[name].steps)[result.dt]
