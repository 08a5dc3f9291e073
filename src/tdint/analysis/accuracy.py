"""Observed order of a method: errors of its compiled march on an oscillator of period 1 s over halved steps."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from tdint.analysis.amplification import find_instability
from tdint.analysis.stepping import Steps, integrate, workspace
from tdint.errors import AnalysisError, UsageError
from tdint.kernels.layout import ACCELERATION, DISPLACEMENT, FORCE_COLUMNS, VELOCITY
from tdint.methods.exact import oscillator
from tdint.methods.method import Integrator
from tdint.model.building import Building, assemble
from tdint.model.definition import Analysis, Excitation, Force, Initial, Law, Model, Story
from tdint.model.loads import force_table

Array = NDArray[np.float64]

LOADS = ("free", "harmonic", "record")

STORY_LAWS = {
    "linear": Law("linear", ()),
    "polynomial": Law("polynomial", ((2.0 * math.pi) ** 2, 0.0, 0.5 * (2.0 * math.pi) ** 2)),
}
"""Laws of the oscillator, unit mass and period 1 s: linear, and hardening u + u^3 / 2."""

_OMEGA = 2.0 * math.pi
_XI = 0.02
_START = (0.7, 2.0)  # u (m) and v (m/s)
_DURATION = 4.0
_COARSEST = 0.02  # the largest step, s
_ROUNDING = 3e-12  # errors below this, over the largest value, are rounding
_ENDS = (40, 90, 130, 170, 200)  # coarse steps at whose ends the method's own acceleration is looked at


@dataclass(frozen=True)
class ObservedOrder:
    """Errors over steps and the orders that follow from them.

    Attributes
    ----------
    steps : ndarray, shape (k,)
        Time steps, s, falling.
    displacement, velocity, acceleration : ndarray, shape (k,)
        Largest errors over the coarsest steps, over the largest value; acceleration from equilibrium, as it is
        reported.
    own_acceleration : ndarray, shape (k,)
        The same of the acceleration that the method carries itself.
    """

    method: str
    load: str
    law: str
    frequency_ratio: float
    steps: Array
    displacement: Array
    velocity: Array
    acceleration: Array
    own_acceleration: Array

    def order(self, quantity: str) -> float:
        """Slope of the error of a quantity over the step, by regression over the finest three that are not rounding.

        nan where fewer than two are.
        """
        errors = getattr(self, quantity)
        clear = np.flatnonzero(errors > _ROUNDING)[-3:]
        if clear.size < 2:
            return math.nan
        return float(np.polyfit(np.log(self.steps[clear]), np.log(errors[clear]), 1)[0])


@dataclass(frozen=True)
class _Problem:
    """The oscillator, its load, and its exact motion at given times (rows u, v, a)."""

    building: Building
    forces: Array
    ground: Array
    motion: Callable[[Array], Array]


def observed_order(
    integrator: Integrator, load: str = "harmonic", law: str = "linear", frequency_ratio: float = 0.5, halvings: int = 4
) -> ObservedOrder:
    """Measure the order of a method on one problem.

    Parameters
    ----------
    load : str
        `free` vibration, a `harmonic` force cos(r omega t), or a `record`: a ground motion that is linear between
        samples 0.02 s apart.
    law : str
        A key of `STORY_LAWS`.
    frequency_ratio : float
        r, circular frequency of the load over that of the oscillator.
    halvings : int
        The steps are 0.02 s / 2^j for j = 0 .. halvings.

    Raises
    ------
    UsageError
        A nonlinear law for a method that integrates linear buildings only; an unknown load or law.
    """
    if load not in LOADS or law not in STORY_LAWS:
        known = f"loads {', '.join(LOADS)}; laws {', '.join(STORY_LAWS)}"
        raise UsageError(f"no order problem {load!r} with {law!r}: {known}")
    if integrator.family.linear_only and law != "linear":
        raise UsageError(f"{integrator.label} integrates linear buildings only")
    problem = _problem(load, law, frequency_ratio)
    steps = _COARSEST / 2.0 ** np.arange(halvings + 1)
    if find_instability(integrator, np.array([_OMEGA]), np.array([_XI]), _COARSEST):
        raise AnalysisError(f"{integrator.label} is unstable at dt {_COARSEST} s")
    errors = np.array([_errors(integrator, problem, round(_COARSEST / h)) for h in steps])
    return ObservedOrder(integrator.label, load, law, frequency_ratio, steps, *errors.T)


def _errors(integrator: Integrator, problem: _Problem, parts: int) -> list[float]:
    """Largest errors of u, v, a and of the method's own a at the coarse steps, over the largest values."""
    count = round(_DURATION / _COARSEST)
    times = _COARSEST * np.arange(count + 1)
    exact = problem.motion(times)
    largest = np.max(np.abs(exact), axis=1)
    history = _march(integrator, problem, parts, count)[1][::parts]
    measured = history[:, 1:4].T
    measured[2] -= history[:, 0]
    errors = np.max(np.abs(measured - exact), axis=1) / largest
    own = [abs(_march(integrator, problem, parts, end)[0] - exact[2, end]) for end in _ENDS]
    return [*errors, max(own) / largest[2]]


def _march(integrator: Integrator, problem: _Problem, parts: int, count: int) -> tuple[float, Array]:
    """The method's own acceleration at the end, and the history."""
    space = workspace(problem.building, integrator, parts * count)
    space.state[DISPLACEMENT, 0], space.state[VELOCITY, 0] = _START
    steps = Steps(_COARSEST / parts, parts * count, per_sample=parts)
    if integrate(integrator, problem.building, problem.forces, problem.ground, steps, space) < 0:
        raise AnalysisError(f"{integrator.label} failed with dt {steps.h:.6g} s")
    return float(space.state[ACCELERATION, 0]), space.history


def _problem(load: str, law: str, ratio: float) -> _Problem:
    force = Force(1, 20.0, 0.0, ratio * _OMEGA)
    model = Model(
        name="oscillator",
        source="",
        text=b"",
        stories=(Story(1.0, None, _OMEGA**2, STORY_LAWS[law], 2.0 * _XI * _OMEGA),),
        damping=None,
        p_delta=False,
        excitation=Excitation(None, (force,) if load == "harmonic" else ()),
        initial=Initial((0.0,), (0.0,)),
        analysis=Analysis(None, None, None),
        collapse_drift=1.0,
    )
    ground = _sampled_motion() if load == "record" else np.zeros(1)
    forces = force_table(model.excitation.forces) if load == "harmonic" else np.zeros((0, FORCE_COLUMNS))
    motion = _linear_record(ground) if load == "record" and law == "linear" else _by_dop853(load, law, ratio, ground)
    return _Problem(assemble(model), forces, ground, motion)


def _sampled_motion() -> Array:
    """Ground acceleration at samples 0.02 s apart, m/s^2: seeded noise."""
    generator = np.random.default_rng(20221120)
    return 5.0 * generator.standard_normal(round(_DURATION / _COARSEST) + 1)


def _linear_record(ground: Array) -> Callable[[Array], Array]:
    """Exact motion of the linear oscillator at the samples."""
    h = _COARSEST
    step = oscillator(np.array([_OMEGA * h]), np.array([_XI]))[0]
    states = np.empty((2, ground.size))
    states[:, 0] = _START[0], h * _START[1]
    for j in range(ground.size - 1):
        states[:, j + 1] = step @ np.concatenate([states[:, j], -h * h * ground[j : j + 2]])
    u, v = states[0], states[1] / h
    return lambda times: np.array([u, v, -ground - 2.0 * _XI * _OMEGA * v - _OMEGA**2 * u])


def _by_dop853(load: str, law: str, ratio: float, ground: Array) -> Callable[[Array], Array]:
    """Motion by SciPy's DOP853 at a tolerance of 1e-13, restarted at the samples of a record."""
    from scipy.integrate import solve_ivp

    coefficients = STORY_LAWS[law].parameters or (_OMEGA**2,)

    def acceleration(t: float, u: float, v: float) -> float:
        restoring = u * sum(c * u**j for j, c in enumerate(coefficients))
        driving = 20.0 * math.cos(ratio * _OMEGA * t) if load == "harmonic" else 0.0
        if load == "record":
            driving = -float(np.interp(t, _COARSEST * np.arange(ground.size), ground))
        return driving - 2.0 * _XI * _OMEGA * v - restoring

    def motion(times: Array) -> Array:
        pieces = list(pairwise(times)) if load == "record" else [(times[0], times[-1])]
        states = [np.array(_START)]
        for begin, end in pieces:
            at = [end] if load == "record" else times[1:]
            solution = solve_ivp(
                lambda t, y: (y[1], acceleration(t, y[0], y[1])),
                (begin, end),
                states[-1],
                method="DOP853",
                t_eval=at,
                rtol=1e-13,
                atol=1e-14,
            )
            states.extend(solution.y.T)
        u, v = np.array(states).T
        a = [acceleration(t, *state) for t, *state in zip(times, u, v, strict=True)]
        return np.array([u, v, a])

    return motion
