"""Observed order of convergence of a method: errors of its compiled time loop for an oscillator of
period 1 s, with time steps that are halved repeatedly."""

from __future__ import annotations

import math
import sys
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from tdint.arrays import Array, immutable
from tdint.assessment.stability.stability import critical_step, false_limit, for_methods, stability
from tdint.errors import AnalysisError, UsageError
from tdint.kernels import layout as rows
from tdint.methods.catalogue import parse
from tdint.methods.exact_step import oscillator
from tdint.methods.method import Integrator
from tdint.methods.step_check import (
    GuardedArray,
    energy_balance,
    faults_in,
    faults_with_yielding,
    integrate_in_python,
)
from tdint.model.building import Building, assemble, element_yield_drifts, force_table, law_columns
from tdint.model.definition import Force, Model, simple_model
from tdint.model.law_checks import path_faults
from tdint.model.story import simple_story
from tdint.model.story_laws import LAWS, Law
from tdint.response.arguments import between
from tdint.response.runs.compiled_steps import VALIDATED_STEPS
from tdint.response.runs.measured_stability import find_instability
from tdint.response.runs.prepared import PreparedBuilding
from tdint.response.static.cyclic import cyclic_test
from tdint.response.time_steps import Steps
from tdint.tabular import Tabular

LOADS = ("free", "harmonic", "record")

STORY_LAWS = {
    "linear": Law("linear", ()),
    "polynomial": Law("polynomial", ((2.0 * math.pi) ** 2, 0.0, 0.5 * (2.0 * math.pi) ** 2)),
}
"""Hysteresis models of the oscillator of unit mass and period 1 s: linear, and nonlinear with
hardening."""

COARSEST = 0.02
"""Largest time step, s."""

OBSERVED_HALVINGS = 4
"""Default number of halvings of the time step."""

_OMEGA = 2.0 * math.pi
_XI = 0.02  # damping ratio; strong damping would reduce the errors that show the order
_START = (0.7, 2.0)  # initial displacement (m) and velocity (m/s) of the oscillator
_AMPLITUDE = 20.0  # N; amplitude of the harmonic force
_COARSE_STEPS = 200  # number of the largest time steps in the motion of 4 s
_MAX_FREQUENCY = 10.0  # Hz; maximum frequency in a record with several samples per time step
_ROUNDING = 3e-12  # error relative to the maximum motion, below which it is a rounding error
# Numbers of largest time steps after which the acceleration stored by the method is compared.
_COMPARED_STEPS = (40, 90, 130, 170, 200)


@immutable
class ObservedOrder(Tabular):
    """Errors for a sequence of time steps, and the observed orders.

    Attributes
    ----------
    method : str
        Method specification.
    load : str
        Load of the oscillator.
    law : str
        Hysteresis model of the oscillator.
    frequency_ratio : float
        Frequency of the load divided by the natural frequency.
    steps : ndarray, shape (k,)
        Time steps, s, in decreasing order.
    displacement, velocity, acceleration : ndarray, shape (k,)
        Maximum errors at the ends of the coarsest steps, divided by the maximum of the exact
        motion. The acceleration is the reported acceleration, computed from equilibrium.
    algorithmic_acceleration : ndarray, shape (k,)
        Errors of the acceleration that the method stores from step to step; nan for a method that
        does not store an acceleration.
    """

    method: str
    load: str
    law: str
    frequency_ratio: float
    steps: Array
    displacement: Array
    velocity: Array
    acceleration: Array
    algorithmic_acceleration: Array

    def _headline(self) -> str:
        order = self.order("displacement")
        return (
            f"of {self.method}: {order:.3g} of the displacement, load {self.load}, law {self.law}"
        )

    def order(self, quantity: str) -> float:
        """Return the slope of the error against the time step on logarithmic axes.

        The slope is a regression through the three finest errors above the rounding error.
        `quantity` is the name of an error attribute. The result is nan if fewer than two errors
        exceed the rounding error.

        Parameters
        ----------
        quantity : str
            `displacement`, `velocity`, `acceleration` or `algorithmic_acceleration`.
        """
        errors = getattr(self, quantity)
        used = np.flatnonzero(errors > _ROUNDING)[-3:]
        if used.size < 2:
            return math.nan
        return float(np.polyfit(np.log(self.steps[used]), np.log(errors[used]), 1)[0])


@dataclass(frozen=True)
class OrderProblem:
    """Oscillator with its load and exact motion, for use with any number of methods.

    Attributes
    ----------
    load, law : str
        An element of `LOADS` and a key of `STORY_LAWS`.
    frequency_ratio : float
        Ratio of the circular frequency of the load to the circular frequency of the oscillator; nan
        for a load without a frequency.
    prepared : PreparedBuilding
        Oscillator with its force and its initial state.
    ground : ndarray, shape (samples,)
        Ground acceleration, m/s^2; a single zero without a record.
    exact : ndarray, shape (3, samples)
        Displacement (m), velocity (m/s) and acceleration (m/s^2) at the ends of the coarsest steps.
    stride : int
        Number of sampling intervals of the record in the coarsest step.
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


@for_methods
def order(
    method: Integrator | str,
    *,
    load: str = "harmonic",
    law: str = "linear",
    frequency_ratio: float = 0.5,
    stride: int = 1,
) -> ObservedOrder:
    """Measure the order of a method from errors of an oscillator with repeatedly halved time steps.

    Parameters
    ----------
    method : Integrator or str
        The method or its specification. For a list or tuple, the result is a `ResultList`.
    load : str, default "harmonic"
        `free` vibration, a `harmonic` force, or `record`, a ground motion that is linear between
        samples.
    law : str, default "linear"
        `linear`, `hardening` or `softening`.
    frequency_ratio : float, default 0.5
        Circular frequency of the load divided by that of the oscillator, from 0.01 to 10.
    stride : int, default 1
        Number of sampling intervals of the record in the longest time step, a power of 2.

    Returns
    -------
    ObservedOrder
        Errors of displacement, velocity and acceleration for each time step, and the observed
        orders.

    Raises
    ------
    UsageError
        The method, load or law is unknown; the stride is invalid or the load is not a record; or
        the method integrates linear buildings only and the law is nonlinear.
    AnalysisError
        The method is unstable or failed.
    """
    return observed_order(
        method if isinstance(method, Integrator) else parse(method),
        order_problem(load, law, frequency_ratio, stride),
    )


def order_problem(
    load: str = "harmonic", law: str = "linear", frequency_ratio: float = 0.5, stride: int = 1
) -> OrderProblem:
    """Define an oscillator of period 1 s and damping ratio 0.02 with an initial displacement and
    velocity, and compute its exact motion for 4 s.

    Parameters
    ----------
    load : str
        `free` vibration, `harmonic` force 20 cos(r omega t) N on 1 kg, or `record`, a ground motion
        that is linear between samples at intervals of 0.02 s / stride.
    law : str
        A key of `STORY_LAWS`.
    frequency_ratio : float
        r, the ratio of the circular frequency of the load to the circular frequency of the
        oscillator, from 0.01 to 10.
    stride : int
        Number of sampling intervals of the record in the coarsest step, a power of 2.

    Raises
    ------
    UsageError
        The load or law is unknown, the frequency ratio is out of range, the stride is invalid, or a
        stride above 1 is specified for a load other than `record`.
    """
    # The bits of `stride` and `stride - 1` have no 1 in common only if `stride` is a power of 2.
    if not isinstance(stride, int | np.integer) or stride < 1 or stride & (stride - 1):
        raise UsageError(
            "stride must be a power of 2, so that a halved time step is a whole number of "
            "samples, "
            f"got {stride}"
        )
    if stride > 1 and load != "record":
        raise UsageError(
            f"stride can only be used with the load 'record', because the load {load!r} has no "
            "samples"
        )
    if load not in LOADS or law not in STORY_LAWS:
        raise UsageError(
            f"load must be one of {', '.join(LOADS)} and law one of {', '.join(STORY_LAWS)}, got "
            f"{load!r} and {law!r}"
        )
    # At the maximum ratio of 10, a period of the load contains five of the coarsest steps.
    ratio = (
        between(frequency_ratio, "frequency_ratio", 0.01, 10.0) if load == "harmonic" else math.nan
    )
    applied = (Force(1, _AMPLITUDE, 0.0, ratio * _OMEGA),) if load == "harmonic" else ()
    story = simple_story(1.0, STORY_LAWS[law], stiffness=_OMEGA**2, dashpot=2.0 * _XI * _OMEGA)
    building = assemble(simple_model("oscillator", [story]))
    ground = _sampled_motion(stride) if load == "record" else np.zeros(1)
    if load == "record" and law == "linear":
        # Compute the exact motion of the linear oscillator at the samples. A step maps (u, h v) and
        # the loads h^2 p at its start and end to (u, h v) at its end.
        h = COARSEST / stride
        step = oscillator(np.array([_OMEGA * h]), np.array([_XI]))[0]
        states = np.empty((2, ground.size))
        states[:, 0] = _START[0], h * _START[1]
        for j in range(ground.size - 1):
            states[:, j + 1] = step @ np.concatenate([states[:, j], -h * h * ground[j : j + 2]])
        u, v = states[0], states[1] / h
        exact = np.array([u, v, -ground - 2.0 * _XI * _OMEGA * v - _OMEGA**2 * u])
    else:
        exact = _by_dop853(load, law, ratio, ground, stride)
    displacement, velocity = _START
    prepared = PreparedBuilding(building, force_table(applied), displacement, velocity)
    return OrderProblem(load, law, ratio, prepared, ground, exact[:, ::stride], stride)


def observed_order(
    integrator: Integrator, problem: OrderProblem, halvings: int = OBSERVED_HALVINGS
) -> ObservedOrder:
    """Measure the order of a method for a problem with time steps 0.02 s / 2^j, j = 0 .. halvings.

    Parameters
    ----------
    halvings : int
        Number of times that the largest time step is halved.

    Raises
    ------
    UsageError
        The law is nonlinear and the method integrates linear buildings only.
    AnalysisError
        The method is unstable or does not converge.
    """
    if integrator.family.linear_only and not problem.building.linear:
        raise UsageError(
            f"{integrator.label} supports linear buildings only; use another method, or the linear "
            "law"
        )
    if find_instability(integrator, np.array([_OMEGA]), np.array([_XI]), COARSEST):
        raise AnalysisError(
            f"{integrator.label} is unstable with the largest time step of the test, {COARSEST} s; "
            "use a method with a larger stability limit"
        )
    exact, label = problem.exact, integrator.label
    largest = np.max(np.abs(exact), axis=1)
    # The acceleration stored by the method is compared if the method stores an acceleration. With
    # a stride above 1 it belongs to a different motion and is not compared.
    stores_acceleration = rows.ACCELERATION in integrator.family.memory and problem.stride == 1
    all_parts = 2 ** np.arange(halvings + 1)
    errors = []
    for parts in map(int, all_parts):
        # Columns of the history: ground acceleration, displacement, velocity, and absolute
        # acceleration of the oscillator. The exact acceleration is relative to the ground.
        _, history = _integrate(integrator, problem, parts, _COARSE_STEPS)
        motion = history[::parts, 1:4].T
        motion[2] -= history[::parts, 0]
        stored_error = math.nan
        if stores_acceleration:
            stored_error = max(
                abs(_integrate(integrator, problem, parts, end)[0] - exact[2, end])
                for end in _COMPARED_STEPS
            )
        errors.append(
            [*np.max(np.abs(motion - exact), axis=1) / largest, stored_error / largest[2]]
        )
    return ObservedOrder(
        label,
        problem.load,
        problem.law,
        problem.frequency_ratio,
        COARSEST / all_parts,
        *np.array(errors).T,
    )


def _integrate(
    integrator: Integrator, problem: OrderProblem, parts: int, count: int
) -> tuple[float, Array]:
    """Integrate a problem with a fraction of the largest time step. Return the acceleration at the
    end that the method stores in its state, m/s^2, and the table of the response history.
    AnalysisError is raised if the run fails.
    """
    # A time step is `stride / parts` sampling intervals; the fraction is passed in lowest terms.
    divisor = math.gcd(parts, problem.stride)
    steps = Steps(COARSEST / parts, parts * count, parts // divisor, problem.stride // divisor)
    result = problem.prepared.integrate(
        integrator, steps, problem.ground, history_rows=parts * count
    )
    if result.code < 0:
        raise AnalysisError(
            f"{integrator.label} failed with the time step {steps.h:.6g} s; the order of a method "
            "that fails cannot be measured"
        )
    return float(result.space.state[rows.ACCELERATION, 0]), result.space.history


def _sampled_motion(stride: int) -> Array:
    """Return a random ground acceleration at sampling intervals of 0.02 s / stride, m/s^2.

    The random numbers are the same in each call. For stride 1 the motion is white noise. If a time
    step contains several samples, the noise is limited to frequencies up to `_MAX_FREQUENCY`, as in
    ground motions. With white noise, each step would neglect a second moment as large as the two
    moments that it uses, and the observed order would be at most 2.6.
    """
    generator = np.random.default_rng(20221120)
    if stride == 1:
        return 5.0 * generator.standard_normal(_COARSE_STEPS + 1)
    times = COARSEST / stride * np.arange(_COARSE_STEPS * stride + 1)
    frequencies = np.linspace(0.5, _MAX_FREQUENCY, 40)
    phases = 2.0 * math.pi * (np.outer(times, frequencies) + generator.uniform(size=40))
    return np.sin(phases) @ generator.standard_normal(40)


def _by_dop853(load: str, law: str, ratio: float, ground: Array, stride: int) -> Array:
    """Compute the displacement (m), velocity (m/s) and acceleration (m/s^2) of the oscillator
    relative to the ground at intervals of 0.02 s / stride, by SciPy's DOP853 with a tolerance of
    1e-13. The ground acceleration is used for the load `record`.
    """
    from scipy.integrate import solve_ivp

    coefficients = STORY_LAWS[law].parameters or (_OMEGA**2,)
    times = COARSEST / stride * np.arange(_COARSE_STEPS * stride + 1)

    def acceleration(t: float, u: float, v: float) -> float:
        """Return the acceleration of the unit mass relative to the ground at time t, m/s^2."""
        # The force of the spring is the sum of c_j u^(j + 1).
        resistance = u * sum(c * u**j for j, c in enumerate(coefficients))
        driving = _AMPLITUDE * math.cos(ratio * _OMEGA * t) if load == "harmonic" else 0.0
        if load == "record":
            driving = -float(np.interp(t, times, ground))
        return driving - 2.0 * _XI * _OMEGA * v - resistance

    # A record has a kink at each sample. An integration across kinks would reduce the order of
    # DOP853, so the integration is restarted at each sample.
    states = [np.array(_START)]
    for first, end in pairwise(times) if load == "record" else [(times[0], times[-1])]:
        solution = solve_ivp(
            lambda t, y: (y[1], acceleration(t, y[0], y[1])),
            (first, end),
            states[-1],
            method="DOP853",
            t_eval=[end] if load == "record" else times[1:],
            rtol=1e-13,
            atol=1e-14,
        )
        states.extend(solution.y.T)
    u, v = np.array(states).T
    return np.array([u, v, [acceleration(*row) for row in zip(times, u, v, strict=True)]])


# ---- Comparison of the declared and measured properties of methods and hysteresis models, for
# authors of plug-ins

_ORDER = 0.1  # maximum difference between the declared and the observed order
_RADIUS = 1e-3  # maximum difference between the declared and the measured spectral radius
_FAST = 1e6
"""Value of omega dt that represents infinity; larger values increase the rounding error."""
_ENERGY = 1e-3  # maximum error of the energy balance, relative to the maximum work done


@dataclass(frozen=True)
class MethodCheck:
    """Measured properties of a method, and their differences from the declared properties.

    Attributes
    ----------
    order : float
        Minimum of the observed orders of displacement and velocity of a linear oscillator in free
        vibration and under a harmonic force; nan if all errors are rounding errors.
    limit : float
        Measured stability limit of omega dt without damping; inf if there is no limit up to 100.
    rho_inf : float
        Measured spectral radius at omega dt = 1e6; nan for a method with a stability limit.
    faults : tuple of str
        Differences from the declared properties, one line per fault.
    notes : tuple of str
        Measured properties that are not declared: the energy imbalance of bilinear stories and its
        order, if the imbalance is not negligible.
    """

    integrator: Integrator
    order: float
    limit: float
    rho_inf: float
    faults: tuple[str, ...]
    notes: tuple[str, ...] = ()


def check_method(integrator: Integrator) -> MethodCheck:
    """Measure the declared properties of a method.

    Returns
    -------
    MethodCheck
        Measured properties, and differences from the declared properties. If the step fails, the
        properties are nan, and the faults describe the failure.
    """
    yielding: dict[str, str] = {}
    notes: list[str] = []
    # The following lines validate the step. Mark it as validated, because the compiled runs below
    # need no further validation. The mark is removed if the step or a declaration is wrong.
    step = integrator.family.step
    VALIDATED_STEPS.add(step)
    try:
        integrate_in_python("linear", integrator, 1)
        if not integrator.family.linear_only:
            yielding = faults_with_yielding(integrator)
            balance = energy_balance(integrator, "bilinear")
            if not (balance.fault or math.isnan(balance.order)):
                notes.append(
                    f"{integrator.label}: with stories of law {balance.law}, numerical damping is "
                    f"missing from the energy balance: {balance.text}"
                )
        observed = [
            observed_order(integrator, order_problem(load)) for load in ("free", "harmonic")
        ]
    except AnalysisError as error:
        VALIDATED_STEPS.discard(step)
        # Wrong results with yielding stories usually explain this error and replace its message.
        messages = tuple(yielding.values()) or (str(error),)
        return MethodCheck(integrator, math.nan, math.nan, math.nan, messages)
    # The order of the method is the lowest order of all quantities and loads.
    orders = [
        result.order(quantity) for result in observed for quantity in ("displacement", "velocity")
    ]
    order = min((value for value in orders if not math.isnan(value)), default=math.nan)
    limit = critical_step(integrator)
    with np.errstate(all="ignore"):
        fast = stability(integrator, np.array([_FAST / (2.0 * math.pi)])).spectral_radius
    radius = float(fast[0]) if limit == math.inf else math.nan
    label, faults = integrator.label, []
    if abs(order - integrator.order) > _ORDER:
        faults.append(
            f"{label}: declares order {integrator.order}, but the observed order is {order:.2f}"
        )
        yielding.pop("order", None)  # Avoid reporting the same error twice.
    if limit_fault := false_limit(integrator, limit):
        faults.append(limit_fault)
    # A method with a stability limit has no measured radius (nan), and must declare nan. If only
    # one of the two radii is nan, their difference is nan and the comparison is False.
    declared = integrator.rho_inf
    has_no_radius = math.isnan(declared) and math.isnan(radius)
    if not (has_no_radius or abs(declared - radius) <= _RADIUS):
        measured = (
            "the method has a stability limit, so that no spectral radius can be measured"
            if math.isnan(radius)
            else f"the measured spectral radius is {radius:.4g}"
        )
        faults.append(
            f"{label}: declares the spectral radius {declared:.4g} for infinite time steps, but "
            f"{measured}"
        )
    faults += yielding.values()
    if faults:
        VALIDATED_STEPS.discard(step)
    return MethodCheck(integrator, order, limit, radius, tuple(faults), tuple(notes))


def check_law(model: Model, story: int) -> list[str]:
    """Check the hysteresis model of a story in a cyclic test, and return a message for each error.

    Errors are tangents that differ from the slope of the force, and errors of the energy balance.

    Parameters
    ----------
    story : int
        Number of the story, from 1. The amplitudes of the cycles are 0.5, 1 and 2 % of the story
        height, or 5, 10 and 20 mm if the story has no height.
    """
    subject, faults = model.stories[story - 1], list[str]()
    # The declared branches and the declared curvature are compared with the force. The model is
    # executed in plain Python with checks of array bounds (`path_faults`).
    parameters = assemble(model).law_parameters
    columns, yields = law_columns(model.stories)[story - 1], element_yield_drifts(subject)
    try:
        for spring, column, yield_drift in zip(subject.springs, columns, yields, strict=True):
            law = LAWS[spring.law.name]
            with faults_in(sys.modules[law.functions.__module__], f"law {law.name}"):
                faults += path_faults(law, parameters[:, column], yield_drift, GuardedArray.of)
    except AnalysisError as error:
        # The cyclic test below would fail with a less clear message.
        return [str(error)]
    has_height, name = subject.height is not None, subject.law_text
    path = cyclic_test(
        model, story, ["0.5%", "1%", "2%"] if has_height else ["5mm", "10mm", "20mm"], points=2000
    ).path
    # The work done must equal the sum of the stored and the dissipated energy. The work is
    # integrated by the trapezoidal rule.
    step, mean = np.diff(path.drift), 0.5 * (path.shear[1:] + path.shear[:-1])
    work = np.append(0.0, np.cumsum(mean * step))
    energy = path.strain_energy + path.hysteretic_energy
    imbalance = np.max(np.abs(work - (energy - energy[0]))) / np.max(np.abs(work))
    if not imbalance <= _ENERGY:
        faults.append(
            f"law {name}: stored and dissipated energy differ from the work done by "
            f"{imbalance:.2g} "
            "of the maximum work"
        )
    if np.any(np.diff(path.hysteretic_energy) < -_ENERGY * np.max(np.abs(work))):
        faults.append(f"law {name}: the dissipated energy decreases")
    return faults
