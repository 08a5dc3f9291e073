"""Spectral radius, period error, numerical damping and overshoot of a method, measured on its
compiled step.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import cache
from itertools import pairwise
from typing import Concatenate, ParamSpec, Protocol, TypeVar, overload

import numpy as np
from numpy.typing import NDArray

from tdint.arrays import Array, Numbers, bisect_interval, immutable, max_absolute
from tdint.errors import UsageError
from tdint.methods.catalogue import parse
from tdint.methods.method import Integrator
from tdint.model.building import assemble, oscillators
from tdint.number_parsing import pluralize
from tdint.response.arguments import between, numbers_of
from tdint.response.runs.measured_stability import STABLE, amplification, spectral_radius
from tdint.response.runs.prepared import PreparedBuilding
from tdint.response.time_steps import Steps
from tdint.tabular import ResultList, Tabular, map_over_first

_MOST_STEPS = 1e6
"""Maximum number of time steps for the measurement of overshoot, which occurs in the first ten."""

_FIRST_STEP = 1e-3
"""Ratio dt/T where the principal root is close to the exact root, so that it is identified with
certainty."""

_REAL = 1e-9  # maximum imaginary part of a root that is real except for rounding errors
_MAX_STEP_RATIO = 1.08
"""Maximum ratio of neighboring time steps for which roots are tracked without confusion."""
LARGEST = 1e4
"""Dimensionless. Maximum omega dt of the search for a critical time step."""

_AGREEMENT = 1e-3  # relative tolerance between a declared and a measured limit
_ROUNDING = 1e-15  # excess of a spectral radius above 1 by rounding, divided by (omega dt)^2


_Methods = list[str] | tuple[Integrator | str, ...] | list[Integrator] | ResultList[Integrator]
_Arguments = ParamSpec("_Arguments")
_Result = TypeVar("_Result")


class ForMethods(Protocol[_Arguments, _Result]):
    """Function of a method, with a single result, or of several methods, with a list of results."""

    @overload
    def __call__(
        self, method: Integrator | str, *args: _Arguments.args, **kwargs: _Arguments.kwargs
    ) -> _Result: ...

    @overload
    def __call__(
        self, method: _Methods, *args: _Arguments.args, **kwargs: _Arguments.kwargs
    ) -> ResultList[_Result]: ...


def for_methods(
    function: Callable[Concatenate[Integrator | str, _Arguments], _Result],
) -> ForMethods[_Arguments, _Result]:
    """Wrap a function of a method so that its first argument may also be several methods."""
    return map_over_first(function)


@immutable
class StabilityCurve(Tabular):
    """Properties of one time step of an undriven oscillator; arrays of shape (k,).

    Period error, numerical damping and amplitude decay are nan if the principal roots are real, for
    time steps longer than half the damped period (too long to determine a period), and for
    damping ratios of at least 1.

    Attributes
    ----------
    method : str
        Method specification.
    damping : float
        Damping ratio xi of the oscillator.
    dt_over_t : ndarray
        Time step divided by undamped period.
    spectral_radius : ndarray
        Maximum modulus of the eigenvalues of the amplification matrix.
    period_error : ndarray
        Numerical divided by exact damped period, minus 1.
    numerical_damping : ndarray
        Damping ratio of the numerical oscillation minus xi. For the principal root exp(-d + i f),
        the former is d / sqrt(d^2 + f^2) (Hughes 1987, sect. 9.1). For small d, it is twice the
        value of eq. 40 of the paper of 2022.
    amplitude_decay : ndarray
        Relative loss of amplitude in a single cycle caused by the method, 1 - exp(-2 pi (d / f - xi
        / sqrt(1 - xi^2))); without damping, eq. 41 of the paper.
    spurious_radius : ndarray
        Maximum modulus of the eigenvalues other than the principal pair (eq. 35 of the paper: 0);
        nan if the pair is real; 0 for a method that stores only displacement and velocity.
    """

    method: str
    damping: float
    dt_over_t: Array
    spectral_radius: Array
    period_error: Array
    numerical_damping: Array
    amplitude_decay: Array
    spurious_radius: Array

    def _headline(self) -> str:
        return (
            f"of {self.method}, damping {self.damping:g}, {pluralize(self.dt_over_t.size, 'step')}"
        )


@for_methods
def stability(method: Integrator | str, dt_over_t: Numbers, damping: float = 0.0) -> StabilityCurve:
    """Measure the accuracy of a method for a freely vibrating oscillator from its amplification
    matrix.

    Parameters
    ----------
    method : Integrator or str
        Method or its specification. A list or tuple returns a `ResultList`.
    dt_over_t : ndarray, shape (k,)
        Time steps divided by the undamped period, increasing.
    damping : float, default 0
        Damping ratio, at least 0.

    Returns
    -------
    StabilityCurve
        Spectral radius, period error, numerical damping, amplitude decay and spurious root, shape
        (k,).

    Raises
    ------
    UsageError
        The method is unknown, or the time steps or the damping ratio are invalid.
    AnalysisError
        A step of the oscillator fails.
    """
    method = _validated_method(method, damping)
    dt_over_t = numbers_of(dt_over_t, "dt_over_t")
    rises = dt_over_t.size and dt_over_t[0] > 0.0 and np.all(np.diff(dt_over_t) >= 0.0)
    if not (rises and np.isfinite(dt_over_t).all()):
        raise UsageError(
            f"dt_over_t must be positive and increasing, got {' '.join(str(dt_over_t).split()):.60}"
        )
    ratios, requested = _refined_steps(dt_over_t)
    roots = _roots(method, 2.0 * math.pi * ratios, damping)
    principal, spurious = _track_principal_root(roots, 2.0 * math.pi * ratios[0], damping)
    roots, principal, spurious = roots[requested], principal[requested], spurious[requested]
    # Above critical damping there is no period, and the results are nan.
    frequency_ratio = math.sqrt(max(1.0 - damping**2, 0.0))  # damped divided by undamped frequency
    exact_phase = 2.0 * math.pi * dt_over_t * frequency_ratio
    has_period = (
        (np.abs(principal.imag) > _REAL) & (exact_phase <= math.pi) & (frequency_ratio > 0.0)
    )
    with np.errstate(divide="ignore", invalid="ignore"):
        # The principal root of one time step is exp(-decay + i phase).
        decay, phase = -np.log(np.abs(principal)), np.angle(principal)
        period_error = np.where(has_period, exact_phase / phase - 1.0, math.nan)
        numerical = np.where(has_period, decay / np.hypot(decay, phase) - damping, math.nan)
        exact_decay = np.divide(damping, frequency_ratio)  # per radian, as decay / phase
        excess_decay = np.where(has_period, decay / phase - exact_decay, math.nan)
    return StabilityCurve(
        method=method.label,
        damping=damping,
        dt_over_t=dt_over_t,
        spectral_radius=np.max(np.abs(roots), axis=1),
        period_error=period_error,
        numerical_damping=numerical,
        amplitude_decay=1.0 - np.exp(-2.0 * math.pi * excess_decay),
        spurious_radius=spurious,
    )


def _validated_method(method: Integrator | str, damping: float) -> Integrator:
    """Return a method from its specification, and check a damping ratio. UsageError is raised if
    the method is unknown, or the damping ratio is negative or not finite.
    """
    between(damping, "a damping ratio")
    return method if isinstance(method, Integrator) else parse(method)


def _refined_steps(dt_over_t: Array) -> tuple[Array, NDArray[np.intp]]:
    """Add time steps to the requested time steps (divided by the period, increasing), so that roots
    can be tracked. Return all time steps, and the indices of the requested time steps.

    The sequence starts at a small time step, where the roots are identified, and neighboring time
    steps differ by a small ratio.
    """
    endpoints = [min(_FIRST_STEP, dt_over_t[0]), *dt_over_t]
    grids = []
    for low, high in pairwise(endpoints):
        count = 2 + int(math.log(high / low) / math.log(_MAX_STEP_RATIO))
        grids.append(np.geomspace(low, high, count)[:-1])  # the next grid starts at `high`
    requested = np.cumsum([grid.size for grid in grids])
    ratios = np.concatenate([*grids, dt_over_t[-1:]])
    ratios[requested] = dt_over_t  # removes the rounding errors of geomspace
    return ratios, requested


def _track_principal_root(
    roots: NDArray[np.complex128], first: float, damping: float
) -> tuple[NDArray[np.complex128], Array]:
    """Return the principal root at each of k increasing time steps, with a positive imaginary part
    if it is complex, and the maximum modulus of the roots other than this root and its conjugate.

    The principal root is the root nearest to the principal root of the preceding time step. At the
    first time step (`first` is its product with the circular frequency, rad), it is the root
    nearest to the exact root.
    """
    # Exact root exp((-xi + sqrt(xi^2 - 1)) omega h); complex below critical damping
    guess = np.exp((-damping + np.emath.sqrt(damping**2 - 1.0)) * first)
    principal, spurious = np.empty(len(roots), dtype=np.complex128), np.zeros(len(roots))
    for index, candidates in enumerate(roots):
        # Reflect roots of the lower half plane: of a conjugate pair, the upper root is tracked.
        upper = np.where(candidates.imag < 0.0, candidates.conj(), candidates)
        nearest = np.argsort(np.abs(upper - guess))
        principal[index] = guess = upper[nearest[0]]
        # The two principal roots are a conjugate pair, and all other roots are spurious. If the
        # principal root is real, its partner cannot be identified, and the result is nan.
        if candidates.size > 2:
            spurious[index] = (
                math.nan if guess.imag <= _REAL else np.max(np.abs(upper[nearest[2:]]))
            )
    return principal, spurious


def _roots(method: Integrator, omega_h: Array, damping: float) -> NDArray[np.complex128]:
    """Return the eigenvalues of the amplification matrices of a method.

    `omega_h` contains the products of the circular frequency and the time step, rad. The time step
    is 1 s.
    """
    matrices = amplification(method, omega_h, np.full_like(omega_h, damping), 1.0)
    return np.asarray(np.linalg.eigvals(matrices), dtype=np.complex128)


@cache
def critical_step(method: Integrator, damping: float = 0.0) -> float:
    """Return the stability limit of a method: the minimum omega dt (rad) above which the spectral
    radius exceeds 1, without further error than rounding; inf if no instability is found.

    The search uses 4000 points up to `LARGEST` and points just above the declared limit of the
    method, then bisection. Results are cached. An unstable interval elsewhere that is narrower than
    0.5 % of omega dt can be missed.
    """
    grid = np.geomspace(1e-3, LARGEST, 4000)
    declared = method.stability_limit
    if 0.0 < declared < LARGEST:
        grid = np.sort(np.concatenate([grid, declared * (1.0 + np.geomspace(1e-6, 1e-2, 40))]))
    unstable = np.flatnonzero(_is_unstable(method, grid, damping))
    if not unstable.size:
        return math.inf
    high = grid[unstable[0]]
    low = grid[unstable[0] - 1] if unstable[0] else 0.0
    # 50 bisections reach rounding, because neighboring points differ by 0.5 %.
    low, _ = bisect_interval(
        lambda middle: not _is_unstable(method, np.array([middle]), damping)[0], low, high, 50
    )
    return float(low)


def false_limit(method: Integrator, measured: float) -> str:
    """Return a message if the stability limit that a method declares differs from the measured
    limit.

    Parameters
    ----------
    method : Integrator
        Method with the declared limit; nan if it declares none.
    measured : float
        Result of `critical_step` without damping.

    Returns
    -------
    str
        Message; empty if the limits agree within 0.1 % or if no limit is declared.
    """
    declared = method.stability_limit
    # A limit above the range of the search cannot be measured.
    is_unlimited = declared > LARGEST and measured == math.inf
    if math.isnan(declared) or is_unlimited or math.isclose(declared, measured, rel_tol=_AGREEMENT):
        return ""
    limit = (
        f"{measured:.6g}" if math.isfinite(measured) else f"infinite (no limit up to {LARGEST:g})"
    )
    return (
        f"{method.label}: declares the stability limit omega dt = {declared:.6g}, but the measured "
        f"limit is {limit}; `tdint run` uses limits that it measures at the modes of the building"
    )


def _is_unstable(method: Integrator, omega_h: Array, damping: float) -> NDArray[np.bool_]:
    """Return True for each time step with a spectral radius that exceeds 1 by more than rounding.

    `omega_h` contains the products of the circular frequency and the time step, rad.
    """
    radius = np.max(np.abs(_roots(method, omega_h, damping)), axis=1)
    return np.asarray(radius > 1.0 + np.maximum(STABLE, _ROUNDING * omega_h**2))


# ---- Overshoot: first steps of an undriven oscillator with a large time step (Hilber and Hughes
# 1978)

STARTS = {"displacement": (1.0, 0.0), "velocity": (0.0, 1.0)}
"""Initial conditions by name: u(0) and h v(0), m."""

EXACT_POWERS = {"displacement": (0.0, 1.0), "velocity": (-1.0, 0.0)}
"""Powers of omega h in the amplitudes of u and h v of the exact motion, by initial condition."""

_LEVELS = 10.0 ** np.arange(2.0, 8.0)
"""Values of omega h for a fit of the power of the growth in one step."""

_SPREAD = 1.0 + np.arange(16) * 0.61803398875 % 1.0
"""Factors from 1 to 2 on each value of `_LEVELS`, spread by the golden ratio. With a single value
of omega h, the response of the step might be zero by chance, because it may contain a sine of
omega h."""

_LARGER = 0.25  # minimum difference of powers that are considered different
_NOISE = {"displacement": 1e-13 * _LEVELS**2, "velocity": 1e-13 * _LEVELS}
"""Rounding error of a step divided by the initial value. The initial acceleration is omega^2 u(0)
or 2 xi omega v(0).
"""
# Product of circular frequency and time step, rad, for the test of stability: an unstable method
# has a spectral radius above 1
_FAR = 1e3
# Factor on the initial condition of linear motion, so that a growing response does not exceed the
# range of floating-point numbers
_TINY = 1e-200

LAWS = ("linear", "hardening", "softening")
"""Restoring forces of the oscillator: linear, or from a problem of
`tdint.assessment.failures.failures`.
"""

BEYOND = 0.01
"""Dimensionless. Relative excess above the maximum exact value. A method with a larger excess in
nonlinear motion overshoots.
"""


@immutable
class Overshoot(Tabular):
    """First steps from one initial condition; arrays of shape (steps + 1,) including the start.

    Attributes
    ----------
    method : str
        Method specification.
    dt_over_t : float
        Time step divided by the natural period.
    damping : float
        Damping ratio.
    start : str
        Initial condition.
    law : str
        One of `LAWS`.
    displacement, velocity : ndarray
        u / U and v / V, where U and V are the maxima of the exact undamped motion, so that the
        exact values are between -1 and 1. Values are nan after the response has grown without
        bound.
    displacement_power, velocity_power : float
        Exponents p that describe the growth in the first step of length h for omega h to infinity,
        u(h) ~ (omega h)^p and h v(h) ~ (omega h)^p; -inf if the value after the step is 0. The
        exponents of the exact motion are `EXACT_POWERS`. nan for a nonlinear law.
    """

    method: str
    dt_over_t: float
    damping: float
    start: str
    displacement: Array
    velocity: Array
    displacement_power: float
    velocity_power: float
    law: str = "linear"

    def _headline(self) -> str:
        steps = pluralize(self.displacement.size - 1, "step")
        return f"of {self.method} from a {self.start}, {self.law}, dt/T {self.dt_over_t:g}, {steps}"

    @property
    def largest(self) -> tuple[float, float]:
        """Maximum displacement and maximum velocity, each divided by the maximum of the exact
        motion. Both are infinite if the response grew without bound.
        """
        u, v = (max_absolute(values) for values in (self.displacement, self.velocity))
        return (math.inf, math.inf) if math.isnan(u + v) else (u, v)

    @property
    def growing(self) -> set[str]:
        """Quantities (displacement, velocity) that grow with a higher power than in the exact
        motion.
        """
        powers = {"displacement": self.displacement_power, "velocity": self.velocity_power}
        bounds = EXACT_POWERS[self.start]
        return {
            name
            for (name, power), bound in zip(powers.items(), bounds, strict=True)
            if power > bound + _LARGER
        }


@for_methods
def overshoot(
    method: Integrator | str,
    start: str = "displacement",
    dt_over_t: float = 10.0,
    steps: int = 10,
    damping: float = 0.0,
    law: str = "linear",
) -> Overshoot:
    """Integrate an undriven oscillator over a few large time steps and measure its initial growth.

    A nonlinear oscillator starts with the energy of its problem in
    `tdint.assessment.failures.failures`. For a linear oscillator, the growth in the first step is
    also described by the power p of (omega h)^p for long steps (`displacement_power` and
    `velocity_power`; omega is the circular frequency, h the time step). A nonlinear oscillator has
    no such power (nan), because its growth also depends on its amplitude.

    Parameters
    ----------
    method : Integrator or str
        Method or its specification. A list or tuple returns a `ResultList`.
    start : str, default "displacement"
        Initial `displacement` or `velocity`.
    dt_over_t : float, default 10
        Time step divided by undamped period; for a nonlinear law, the period of small vibrations.
    steps : int, default 10
        Number of time steps.
    damping : float, default 0
        Damping ratio, at least 0; for a nonlinear law, the ratio of small vibrations.
    law : str, default "linear"
        `linear`, `hardening` or `softening`.

    Returns
    -------
    Overshoot
        Motion at the time steps, and powers of omega h that describe the growth in the first step.

    Raises
    ------
    UsageError
        The method, initial condition, law or damping ratio is invalid, or the method supports only
        linear buildings and the law is nonlinear.
    """
    method = _validated_method(method, damping)
    if start not in STARTS:
        raise UsageError(
            f"start must be one of the initial states {', '.join(STARTS)}, got {start!r:.60}"
        )
    if law not in LAWS:
        raise UsageError(f"law must be one of {', '.join(LAWS)}, got {law!r:.60}")
    dt_over_t = between(dt_over_t, "dt_over_t", above=True)
    steps = int(between(steps, "steps", 1.0, _MOST_STEPS))
    if law != "linear":
        return _nonlinear_overshoot(method, start, dt_over_t, steps, damping, law)
    omega_h = 2.0 * math.pi * dt_over_t
    u, hv = _first_steps(method, start, np.array([omega_h]), steps, damping)[:, :, 0]
    # The exact amplitude of u is the root of the sum of squares of u(0) and v(0) / omega.
    amplitude = math.hypot(STARTS[start][0], STARTS[start][1] / omega_h)
    motion = u / amplitude, hv / (omega_h * amplitude)
    powers = _growth_powers(method, start, damping)
    return Overshoot(method.label, dt_over_t, damping, start, *motion, powers[0], powers[1])


def _growth_powers(method: Integrator, start: str, damping: float) -> list[float]:
    """Determine how the response after one time step grows with omega h for omega h to infinity.
    Return the powers of omega h in the displacement u and in h v, where v is the velocity; -inf if
    the response is 0 except for rounding, nan if it overflows.
    """
    # Maxima of |u| and |h v| for each level of omega h, shape (levels, 2). `_first_steps` returns
    # the shape (2, 2, 16): u and h v; start and end of the only time step; factors.
    maxima = np.array(
        [
            np.max(np.abs(_first_steps(method, start, level * _SPREAD, 1, damping)[:, 1]), axis=1)
            for level in _LEVELS
        ]
    )
    powers = []
    for values in maxima.T:
        # The power is the slope between the last two levels of omega h with a response above the
        # rounding noise.
        above_noise = np.flatnonzero(values > _NOISE[start])
        power = -math.inf
        if above_noise.size >= 2:
            low, high = above_noise[-2:]
            power = math.log(values[high] / values[low]) / math.log(_LEVELS[high] / _LEVELS[low])
        powers.append(power)
    return powers


def verdict(method: Integrator, both: Sequence[Overshoot]) -> str:
    """Return the names of the quantities that overshoot in the first step.

    Parameters
    ----------
    both : sequence of two Overshoots
        Responses of the method to an initial displacement and to an initial velocity.

    Returns
    -------
    str
        `none`, `displacement`, `velocity`, `displacement and velocity`, or `unstable` if the
        response of the method to large time steps grows without bound.
    """
    damping = np.array([both[0].damping])
    if spectral_radius(method, np.array([_FAR]), damping, 1.0)[0] > 1.0 + STABLE:
        return "unstable"
    growing: set[str] = set().union(*(motion.growing for motion in both))
    return " and ".join(sorted(growing)) or "none"


def _first_steps(
    method: Integrator, start: str, omega_h: Array, steps: int, damping: float
) -> Array:
    """Integrate undriven linear oscillators over a few time steps of h = 1 s. Return the
    displacement u and h v, where v is the velocity (m), at the initial time and after each step,
    shape (2, steps + 1, k); nan after the response has grown without bound.
    """
    # The motion is proportional to the initial condition.
    displacement, velocity = np.multiply(_TINY, STARTS[start])
    building = oscillators(omega_h, np.array([damping]))
    prepared = PreparedBuilding(building, displacement=displacement, velocity=velocity)
    return _integrate(prepared, method, Steps(1.0, steps)) / _TINY


def _nonlinear_overshoot(
    method: Integrator, start: str, dt_over_t: float, steps: int, damping: float, law: str
) -> Overshoot:
    """Integrate the hardening or the softening oscillator of `tdint.assessment.failures.failures`
    over a few large time steps. UsageError is raised if the method supports only linear buildings.

    The initial condition is the displacement of the problem, or the velocity with the same energy.
    """
    if method.family.linear_only:
        raise UsageError(
            f"{method.label} supports linear buildings only and cannot be used with the law {law}; "
            "use another method, or the linear law"
        )

    from tdint.assessment.failures.failures import problems  # imports the modules for runs

    problem = problems()[law]
    (story,), (displacement,) = problem.model.stories, problem.model.initial.displacement
    velocity = math.sqrt(2.0 * problem.energy_scale / story.mass)
    omega = math.sqrt(story.stiffness / story.mass)  # rad/s, for vibrations of small amplitude
    damped = replace(story, dashpot=2.0 * damping * omega * story.mass)
    u_start, v_start = np.multiply(STARTS[start], (displacement, velocity))
    building = assemble(replace(problem.model, stories=(damped,)))
    prepared = PreparedBuilding(building, displacement=u_start, velocity=v_start)
    u, v = _integrate(prepared, method, Steps(2.0 * math.pi * dt_over_t / omega, steps))[:, :, 0]
    powers = (math.nan, math.nan)
    return Overshoot(
        method.label, dt_over_t, damping, start, u / displacement, v / velocity, *powers, law
    )


def _integrate(prepared: PreparedBuilding, method: Integrator, steps: Steps) -> Array:
    """Integrate a building from its initial state, and return the displacements (m) and velocities
    (m/s) of its floors at the initial time and after each time step, shape (2, steps + 1, n); nan
    after the response has grown without bound.
    """
    result = prepared.integrate(method, steps, history_rows=steps.count)
    n = prepared.building.stories
    history = result.space.history
    if result.code < 0:
        # The rows after the failure were not written; they still contain zeros.
        history[1:][~history[1:].any(axis=1)] = math.nan
    # The first column of the history is the ground acceleration.
    return np.array([history[:, 1 : 1 + n], history[:, 1 + n : 1 + 2 * n]])
