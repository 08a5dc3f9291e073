"""Observed order of a method: errors of its compiled march on an oscillator of period 1 s over halved steps."""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from tdint.analysis.run.amplification import find_instability
from tdint.analysis.run.prepared import PreparedBuilding
from tdint.analysis.run.steps import Steps
from tdint.arrays import Array
from tdint.errors import AnalysisError, UsageError
from tdint.kernels import layout as at
from tdint.methods.catalogue import parse
from tdint.methods.exact import oscillator
from tdint.methods.method import Integrator
from tdint.model.building import Building, assemble, force_table
from tdint.model.definition import Force, simple_model, simple_story
from tdint.model.laws import Law
from tdint.tabular import Tabular

LOADS = ("free", "harmonic", "record")

STORY_LAWS = {
    "linear": Law("linear", ()),
    "polynomial": Law("polynomial", ((2.0 * math.pi) ** 2, 0.0, 0.5 * (2.0 * math.pi) ** 2)),
}
"""Laws of the oscillator, unit mass and period 1 s: linear, and hardening u + u^3 / 2."""

COARSEST = 0.02
"""The largest step, s."""

HALVINGS = 4
"""How often it is halved."""

_OMEGA = 2.0 * math.pi
_XI = 0.02
_START = (0.7, 2.0)  # u (m) and v (m/s)
_AMPLITUDE = 20.0  # of the harmonic force, N
_SAMPLES = 200  # coarsest steps
_HIGHEST = 10.0  # frequency in a record of which several samples go into a step, Hz
_ROUNDING = 3e-12  # errors below this, over the largest value, are rounding
_ENDS = (40, 90, 130, 170, 200)  # coarse steps at whose ends the method's own acceleration is looked at


@dataclass(frozen=True, repr=False)
class ObservedOrder(Tabular):
    """Errors over steps and the orders that follow from them.

    Attributes
    ----------
    steps : ndarray, shape (k,)
        Time steps, s, falling.
    displacement, velocity, acceleration : ndarray, shape (k,)
        Largest errors over the coarsest steps, over the largest value; acceleration from equilibrium, as it is
        reported.
    own_acceleration : ndarray, shape (k,)
        The same of the acceleration that the method carries from step to step; nan for one that carries none.
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

    def _headline(self) -> str:
        order = self.order("displacement")
        return f"of {self.method}: {order:.3g} of the displacement, load {self.load}, law {self.law}"

    def order(self, quantity: str) -> float:
        """Slope of the error over the step, by regression over the finest three errors that are not rounding.

        `quantity` names one of the errors. nan where fewer than two are clear of rounding.
        """
        errors = getattr(self, quantity)
        clear = np.flatnonzero(errors > _ROUNDING)[-3:]
        if clear.size < 2:
            return math.nan
        return float(np.polyfit(np.log(self.steps[clear]), np.log(errors[clear]), 1)[0])


@dataclass(frozen=True)
class OrderProblem:
    """An oscillator, its load and its exact motion, to be solved by any number of methods.

    Attributes
    ----------
    load, law : str
        One of `LOADS` and of `STORY_LAWS`.
    frequency_ratio : float
        Circular frequency of the load over that of the oscillator; nan for a load without a frequency.
    exact : ndarray, shape (3, samples)
        Displacement (m), velocity (m/s) and acceleration (m/s^2) at the ends of the coarsest steps.
    stride : int
        Sampling intervals of a record in the coarsest step.
    """

    load: str
    law: str
    frequency_ratio: float
    prepared: PreparedBuilding
    ground: Array
    exact: Array
    stride: int = 1

    @property
    def building(self) -> Building:
        """The oscillator as arrays."""
        return self.prepared.building


def order(
    method: Integrator | str,
    *,
    load: str = "harmonic",
    law: str = "linear",
    frequency_ratio: float = 0.5,
    stride: int = 1,
) -> ObservedOrder:
    """Measure the order of a method, or of the one of this name: errors of an oscillator over halved steps.

    Parameters and errors are those of `order_problem`.

    Raises
    ------
    AnalysisError
        The method is for linear buildings and the law is not linear, or it failed.
    """
    return observed_order(
        parse(method) if isinstance(method, str) else method, order_problem(load, law, frequency_ratio, stride)
    )


def order_problem(
    load: str = "harmonic", law: str = "linear", frequency_ratio: float = 0.5, stride: int = 1
) -> OrderProblem:
    """Set an oscillator of period 1 s, damping ratio 0.02, from a displacement and a velocity, and solve it over 4 s.

    Parameters
    ----------
    load : str
        `free` vibration, a `harmonic` force 20 cos(r omega t) N on 1 kg, or a `record`: a ground motion that is linear
        between samples 0.02 s apart.
    law : str
        A key of `STORY_LAWS`.
    frequency_ratio : float
        r, circular frequency of the load over that of the oscillator.
    stride : int
        Samples of the record are so many times closer than the coarsest step: a power of 2.

    Raises
    ------
    UsageError
        An unknown load or law, a stride that is none or without a record.
    """
    if stride < 1 or stride & (stride - 1):
        raise UsageError(f"the stride is a power of 2, so that halved steps are whole samples, got {stride}")
    if stride > 1 and load != "record":
        raise UsageError(f"a stride is about the samples of a record; the load {load!r} has none")
    if load not in LOADS or law not in STORY_LAWS:
        known = f"loads {', '.join(LOADS)}; laws {', '.join(STORY_LAWS)}"
        raise UsageError(f"no order problem {load!r} with {law!r}: {known}")
    ratio = frequency_ratio if load == "harmonic" else math.nan
    applied = (Force(1, _AMPLITUDE, 0.0, ratio * _OMEGA),) if load == "harmonic" else ()
    story = simple_story(1.0, STORY_LAWS[law], stiffness=_OMEGA**2, dashpot=2.0 * _XI * _OMEGA)
    building = assemble(simple_model("oscillator", [story]))
    ground = _sampled_motion(stride) if load == "record" else np.zeros(1)
    if load == "record" and law == "linear":
        exact = _linear_record(ground, stride)
    else:
        exact = _by_dop853(load, law, ratio, ground, stride)
    displacement, velocity = _START
    prepared = PreparedBuilding(building, force_table(applied), displacement, velocity)
    return OrderProblem(load, law, ratio, prepared, ground, exact[:, ::stride], stride)


def observed_order(integrator: Integrator, problem: OrderProblem, halvings: int = HALVINGS) -> ObservedOrder:
    """Measure the order of a method on one problem, with the steps 0.02 s / 2^j for j = 0 .. halvings.

    Raises
    ------
    UsageError
        A nonlinear law for a method that integrates linear buildings only.
    AnalysisError
        The method is unstable or does not converge.
    """
    if integrator.family.linear_only and not problem.building.linear:
        raise UsageError(f"{integrator.label} integrates linear buildings only")
    if find_instability(integrator, np.array([_OMEGA]), np.array([_XI]), COARSEST):
        raise AnalysisError(f"{integrator.label} is unstable at dt {COARSEST} s")
    parts = 2 ** np.arange(halvings + 1)
    errors = np.array([_errors(integrator, problem, int(m)) for m in parts])
    return ObservedOrder(
        integrator.label, problem.load, problem.law, problem.frequency_ratio, COARSEST / parts, *errors.T
    )


def _errors(integrator: Integrator, problem: OrderProblem, parts: int) -> list[float]:
    """Largest errors of u, v, a and of the method's own a at the coarse steps, over the largest values."""
    exact = problem.exact
    largest = np.max(np.abs(exact), axis=1)
    history = _march(integrator, problem, parts, _SAMPLES)[1][::parts]
    measured = history[:, 1:4].T
    measured[2] -= history[:, 0]
    errors = np.max(np.abs(measured - exact), axis=1) / largest
    own = math.nan
    if at.ACCELERATION in integrator.family.memory and problem.stride == 1:  # else it is that under another motion
        own = max(abs(_march(integrator, problem, parts, end)[0] - exact[2, end]) for end in _ENDS)
    return [*errors, own / largest[2]]


def _march(integrator: Integrator, problem: OrderProblem, parts: int, count: int) -> tuple[float, Array]:
    """The method's own acceleration at the end, and the history."""
    within = math.gcd(parts, problem.stride)
    steps = Steps(COARSEST / parts, parts * count, parts // within, problem.stride // within)
    marched = problem.prepared.march(integrator, steps, problem.ground, rows=parts * count)
    if marched.code < 0:
        raise AnalysisError(f"{integrator.label} failed with dt {steps.h:.6g} s")
    return float(marched.space.state[at.ACCELERATION, 0]), marched.space.history


def _sampled_motion(stride: int) -> Array:
    """Ground acceleration at samples 0.02 s / stride apart, m/s^2: seeded noise; where steps go over several samples,
    noise up to `_HIGHEST` as ground motions have it. (Of white noise each step leaves out a second moment as large as
    the two that it takes, which leaves orders of 2.6 and less.)"""
    generator = np.random.default_rng(20221120)
    if stride == 1:
        return 5.0 * generator.standard_normal(_SAMPLES + 1)
    times = COARSEST / stride * np.arange(_SAMPLES * stride + 1)
    frequencies = np.linspace(0.5, _HIGHEST, 40)
    phases = 2.0 * math.pi * (np.outer(times, frequencies) + generator.uniform(size=40))
    return np.asarray(np.sin(phases) @ generator.standard_normal(40))


def _linear_record(ground: Array, stride: int) -> Array:
    """Exact motion of the linear oscillator at the samples."""
    h = COARSEST / stride
    step = oscillator(np.array([_OMEGA * h]), np.array([_XI]))[0]
    states = np.empty((2, ground.size))
    states[:, 0] = _START[0], h * _START[1]
    for j in range(ground.size - 1):
        states[:, j + 1] = step @ np.concatenate([states[:, j], -h * h * ground[j : j + 2]])
    u, v = states[0], states[1] / h
    return np.array([u, v, -ground - 2.0 * _XI * _OMEGA * v - _OMEGA**2 * u])


def _by_dop853(load: str, law: str, ratio: float, ground: Array, stride: int) -> Array:
    """Motion at the samples by SciPy's DOP853 at a tolerance of 1e-13, restarted at the samples of a record."""
    from scipy.integrate import solve_ivp

    coefficients = STORY_LAWS[law].parameters or (_OMEGA**2,)
    times = COARSEST / stride * np.arange(_SAMPLES * stride + 1)

    def acceleration(t: float, u: float, v: float) -> float:
        restoring = u * sum(c * u**j for j, c in enumerate(coefficients))
        driving = _AMPLITUDE * math.cos(ratio * _OMEGA * t) if load == "harmonic" else 0.0
        if load == "record":
            driving = -float(np.interp(t, times, ground))
        return driving - 2.0 * _XI * _OMEGA * v - restoring

    states = [np.array(_START)]
    for begin, end in pairwise(times) if load == "record" else [(times[0], times[-1])]:
        solution = solve_ivp(
            lambda t, y: (y[1], acceleration(t, y[0], y[1])),
            (begin, end),
            states[-1],
            method="DOP853",
            t_eval=[end] if load == "record" else times[1:],
            rtol=1e-13,
            atol=1e-14,
        )
        states.extend(solution.y.T)
    u, v = np.array(states).T
    return np.array([u, v, [acceleration(*row) for row in zip(times, u, v, strict=True)]])
