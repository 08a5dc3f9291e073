"""Spectral radius, period error and numerical damping of a method, measured on its compiled
step."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cache
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from tdint.analysis.given import between, numbers_of
from tdint.analysis.run.prepared import PreparedBuilding
from tdint.analysis.run.workspace import STABLE, Steps, amplification, spectral_radius
from tdint.arrays import Array, halved
from tdint.errors import UsageError
from tdint.methods.catalogue import parse
from tdint.methods.method import Integrator
from tdint.model.building import assemble, oscillators
from tdint.tabular import Tabular, each_of
from tdint.written_numbers import how_many

_MOST_STEPS = 1e6  # of an overshoot: it is seen in the first ten
_SMALLEST = 1e-3  # dt/T at which the principal root is beyond doubt
_REAL = 1e-9  # imaginary part of a root that is real but for rounding
_APART = 1.08  # ratio of neighboring steps at which roots are not mistaken for each other
LARGEST = 1e4
"""omega dt up to which a critical step is searched."""

_AGREEMENT = 1e-3  # of a declared and a measured limit
_ROUNDING = 1e-15  # over (omega dt)^2: how far rounding alone lifts a spectral radius above 1


@dataclass(frozen=True, repr=False)
class StabilityCurve(Tabular):
    """What one step does to an undriven oscillator; arrays of shape (k,).

    Period error, numerical damping and amplitude decay are nan where the principal roots are real,
    for steps longer than half the damped period, which tell no period, and for a damping ratio of 1
    and more, which has none.

    Attributes
    ----------
    damping : float
        Damping ratio xi of the oscillator.
    dt_over_t : ndarray
        Step over undamped period.
    spectral_radius : ndarray
        Largest modulus of the eigenvalues of the amplification matrix.
    period_error : ndarray
        Numerical over exact damped period, minus 1.
    numerical_damping : ndarray
        Damping ratio of the numerical oscillation minus xi: from the principal root exp(-d + i f),
        d / sqrt(d^2 + f^2) (Hughes 1987, sect. 9.1). Twice what eq. 40 of the paper of 2022 prints,
        for small d.
    amplitude_decay : ndarray
        Part of the amplitude lost in one cycle by the method, 1 - exp(-2 pi (d / f - xi / sqrt(1 -
        xi^2))): without damping eq. 41 of the paper.
    spurious_radius : ndarray
        Modulus of the largest eigenvalue beside the principal pair (eq. 35 of the paper: 0), nan
        where that is real; 0 for a method that remembers displacement and velocity alone.
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
            f"of {self.method}, damping {self.damping:g}, {how_many(self.dt_over_t.size, 'step')}"
        )


@each_of
def stability(method: Integrator | str, dt_over_t: Array, damping: float = 0.0) -> StabilityCurve:
    """Measure how a method follows an oscillator that vibrates freely, from its amplification
    matrix.

    Parameters
    ----------
    method : Integrator or str
        The method, or its specification; of a list or tuple there are `ResultList` results.
    dt_over_t : ndarray, shape (k,)
        Steps over the undamped period, rising.
    damping : float
        Damping ratio, 0 or more.

    Returns
    -------
    StabilityCurve
        Spectral radius, period error, numerical damping, amplitude decay and spurious root, shape
        (k,).

    Raises
    ------
    UsageError
        An unknown method, or a damping ratio that is none.
    AnalysisError
        A step of the oscillator fails.
    """
    method = _checked(method, damping)
    dt_over_t = numbers_of(dt_over_t, "dt_over_t")
    rises = dt_over_t.size and dt_over_t[0] > 0.0 and np.all(np.diff(dt_over_t) >= 0.0)
    if not (rises and np.isfinite(dt_over_t).all()):
        raise UsageError("dt_over_t must be positive numbers that rise")
    # Roots are followed from a small step on, with steps in between where those that are asked for
    # lie far apart.
    ends = [min(_SMALLEST, dt_over_t[0]), *dt_over_t]
    counts = [2 + int(math.log(high / low) / math.log(_APART)) for low, high in pairwise(ends)]
    ways = [
        np.geomspace(low, high, count)[:-1]
        for (low, high), count in zip(pairwise(ends), counts, strict=True)
    ]
    places = np.cumsum([way.size for way in ways])
    ratios = np.concatenate([*ways, dt_over_t[-1:]])
    ratios[places] = dt_over_t
    roots = _roots(method, 2.0 * math.pi * ratios, damping)
    principal, spurious = _followed(roots, 2.0 * math.pi * ratios[0], damping)
    roots, principal, spurious = roots[places], principal[places], spurious[places]
    # Above critical damping there is no period: nothing is told of it.
    damped = math.sqrt(max(1.0 - damping**2, 0.0))  # circular frequency over the undamped one
    exact_phase = 2.0 * math.pi * dt_over_t * damped
    tells = (np.abs(principal.imag) > _REAL) & (exact_phase <= math.pi) & (damped > 0.0)
    with np.errstate(divide="ignore", invalid="ignore"):
        decay, phase = -np.log(np.abs(principal)), np.angle(principal)
        period_error = np.where(tells, exact_phase / phase - 1.0, math.nan)
        numerical = np.where(tells, decay / np.hypot(decay, phase) - damping, math.nan)
        lost = np.where(tells, decay / phase - np.divide(damping, damped), math.nan)
    return StabilityCurve(
        method=method.label,
        damping=damping,
        dt_over_t=dt_over_t,
        spectral_radius=np.max(np.abs(roots), axis=1),
        period_error=period_error,
        numerical_damping=numerical,
        amplitude_decay=1.0 - np.exp(-2.0 * math.pi * lost),
        spurious_radius=spurious,
    )


def _checked(method: Integrator | str, damping: float) -> Integrator:
    """The method; UsageError for an unknown one, and for a damping ratio that is none."""
    between(damping, "a damping ratio")
    return method if isinstance(method, Integrator) else parse(method)


def _followed(
    roots: NDArray[np.complex128], first: float, damping: float
) -> tuple[NDArray[np.complex128], Array]:
    """Of the roots at rising steps, the first one omega h, the one that stands for the oscillation,
    followed from there on (positive imaginary part while complex), and the largest modulus beside
    it and its conjugate."""
    guess = np.exp((-damping + np.emath.sqrt(damping**2 - 1.0)) * first)
    principal, spurious = np.empty(len(roots), dtype=np.complex128), np.zeros(len(roots))
    for index, candidates in enumerate(roots):
        upper = np.where(candidates.imag < 0.0, candidates.conj(), candidates)
        nearest = np.argsort(np.abs(upper - guess))
        principal[index] = guess = upper[nearest[0]]
        # Real roots are no pair: which one of the others is the partner is not told.
        if candidates.size > 2:
            spurious[index] = (
                math.nan if guess.imag <= _REAL else np.max(np.abs(upper[nearest[2:]]))
            )
    return principal, spurious


def _roots(method: Integrator, omega_h: Array, damping: float) -> NDArray[np.complex128]:
    """Eigenvalues of the amplification matrices at steps omega h, shape (k, m); the step is 1 s."""
    matrices = amplification(method, omega_h, np.full_like(omega_h, damping), 1.0)
    return np.asarray(np.linalg.eigvals(matrices), dtype=np.complex128)


@cache
def critical_step(method: Integrator, damping: float = 0.0) -> float:
    """Smallest omega dt from which on the spectral radius exceeds 1, bisected to rounding; inf if
    there is none.

    Searched at 4000 points up to `LARGEST`, and just above the limit that the method declares: an
    unstable band elsewhere that is narrower than half a percent of omega dt can be missed.
    """
    grid = np.geomspace(1e-3, LARGEST, 4000)
    declared = method.stability_limit
    if 0.0 < declared < LARGEST:
        grid = np.sort(np.concatenate([grid, declared * (1.0 + np.geomspace(1e-6, 1e-2, 40))]))
    unstable = np.flatnonzero(_grows(method, grid, damping))
    if not unstable.size:
        return math.inf
    high = grid[unstable[0]]
    low = grid[unstable[0] - 1] if unstable[0] else 0.0
    # 50 halvings are beyond rounding, for neighbors differ by half a percent.
    low, _ = halved(
        lambda middle: not _grows(method, np.array([middle]), damping)[0], low, high, 50
    )
    return float(low)


def false_limit(method: Integrator, measured: float) -> str:
    """What there is to say of a declared stability limit that is not the measured one
    (`critical_step` without damping); nothing where they agree or none is declared (nan)."""
    declared = method.stability_limit
    unlimited = declared > LARGEST and measured == math.inf
    if math.isnan(declared) or unlimited or math.isclose(declared, measured, rel_tol=_AGREEMENT):
        return ""
    limit = f"{measured:.6g}" if math.isfinite(measured) else f"none up to {LARGEST:g}"
    return (
        f"{method.label}: declares that it is stable up to omega dt {declared:.6g}, measured is "
        f"{limit}; `tdint run` refuses steps by what it measures at the building's own modes"
    )


def _grows(method: Integrator, omega_h: Array, damping: float) -> NDArray[np.bool_]:
    """Whether the spectral radius exceeds 1 by more than rounding."""
    radius = np.max(np.abs(_roots(method, omega_h, damping)), axis=1)
    return np.asarray(radius > 1.0 + np.maximum(STABLE, _ROUNDING * omega_h**2))


# ---- First steps of an undriven oscillator under a large step: does the method overshoot (Hilber
# and Hughes 1978)?

STARTS = {"displacement": (1.0, 0.0), "velocity": (0.0, 1.0)}
"""Starts by name: u(0) and h v(0), m."""

EXACT_POWERS = {"displacement": (0.0, 1.0), "velocity": (-1.0, 0.0)}
"""By start, the powers of omega h in the amplitudes of u and h v of the exact motion."""

_LEVELS = 10.0 ** np.arange(2.0, 8.0)
_SPREAD = 1.0 + np.arange(16) * 0.61803398875 % 1.0  # so that no sine is caught at its zeros alone
_LARGER = 0.25  # powers further apart than this differ
_NOISE = {"displacement": 1e-13 * _LEVELS**2, "velocity": 1e-13 * _LEVELS}
"""What a step rounds, over its start: the acceleration of the start is omega^2 u(0) or 2 xi omega
v(0)."""
_FAR = 1e3  # omega h by which an unstable method has left the unit circle
_TINY = 1e-200  # the motion is linear in its start: a tiny one leaves room for what grows

LAWS = ("linear", "hardening", "softening")
"""Restoring forces of the oscillator: linear, or of the problem of that name
(`tdint.analysis.assessment.failures`)."""

BEYOND = 0.01
"""A method overshoots in nonlinear motion where its steps pass the largest exact value by more than
this part."""


@dataclass(frozen=True, repr=False)
class Overshoot(Tabular):
    """First steps from one start; arrays of shape (steps + 1,), the first entry the start.

    Attributes
    ----------
    law : str
        One of `LAWS`.
    displacement, velocity : ndarray
        u over U and v over V, the largest values of the exact undamped motion: it stays within -1
        and 1. nan after a response that ran away.
    displacement_power, velocity_power : float
        p in u(h) ~ (omega h)^p and h v(h) ~ (omega h)^p for omega h to infinity; -inf where the
        step leaves nothing. The exact motion has `EXACT_POWERS`. nan for a nonlinear law.
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
        steps = how_many(self.displacement.size - 1, "step")
        return f"of {self.method} from a {self.start}, {self.law}, dt/T {self.dt_over_t:g}, {steps}"

    @property
    def largest(self) -> tuple[float, float]:
        """Largest displacement and velocity of the steps, over those of the exact motion; infinite
        after a response that ran away."""
        u, v = (float(np.max(np.abs(values))) for values in (self.displacement, self.velocity))
        return (math.inf, math.inf) if math.isnan(u + v) else (u, v)

    @property
    def growing(self) -> set[str]:
        """Which of displacement and velocity grow with a higher power than in the exact motion."""
        powers = {"displacement": self.displacement_power, "velocity": self.velocity_power}
        bounds = EXACT_POWERS[self.start]
        return {
            name
            for (name, power), bound in zip(powers.items(), bounds, strict=True)
            if power > bound + _LARGER
        }


@each_of
def overshoot(
    method: Integrator | str,
    start: str = "displacement",
    dt_over_t: float = 10.0,
    steps: int = 10,
    damping: float = 0.0,
    law: str = "linear",
) -> Overshoot:
    """Integrate an undriven oscillator over a few large steps, and measure the power of the first
    step's growth.

    A nonlinear oscillator starts with the energy of its problem in
    `tdint.analysis.assessment.failures`; it has no powers, for its motion depends on its size.

    Parameters
    ----------
    method : Integrator or str
        The method, or its name; of a list or tuple there are `ResultList` results.
    start : str
        A key of `STARTS`.
    dt_over_t : float
        Step over undamped period; of a nonlinear law that of small vibrations.
    steps : int
        How many.
    damping : float
        Damping ratio, 0 or more; of a nonlinear law that of small vibrations.
    law : str
        One of `LAWS`.

    Returns
    -------
    Overshoot
        The motion over the steps, and the powers with which the first step grows.

    Raises
    ------
    UsageError
        An unknown method, start or law, a damping ratio that is none; a method for linear buildings
        with a nonlinear law.
    """
    method = _checked(method, damping)
    if start not in STARTS:
        raise UsageError(f"a motion starts from one of {', '.join(STARTS)}, got {start!r:.60}")
    if law not in LAWS:
        raise UsageError(f"the law of an oscillator is one of {', '.join(LAWS)}, got {law!r:.60}")
    dt_over_t, steps = (
        between(dt_over_t, "dt_over_t", above=True),
        int(between(steps, "steps", 1.0, _MOST_STEPS)),
    )
    if law != "linear":
        return _nonlinear_overshoot(method, start, dt_over_t, steps, damping, law)
    omega_h = 2.0 * math.pi * dt_over_t
    u, hv = _first_steps(method, start, np.array([omega_h]), steps, damping)[:, :, 0]
    amplitude = math.hypot(STARTS[start][0], STARTS[start][1] / omega_h)
    # Powers of u and h v after one step: the slopes over the last decade of omega h that rounding
    # leaves.
    largest = np.array(
        [
            np.max(np.abs(_first_steps(method, start, level * _SPREAD, 1, damping)[:, 1]), axis=1)
            for level in _LEVELS
        ]
    )
    powers = []
    for values in largest.T:
        clear = np.flatnonzero(values > _NOISE[start])
        power = -math.inf
        if clear.size >= 2:
            low, high = clear[-2:]
            power = math.log(values[high] / values[low]) / math.log(_LEVELS[high] / _LEVELS[low])
        powers.append(power)
    motion = u / amplitude, hv / (omega_h * amplitude)
    return Overshoot(method.label, dt_over_t, damping, start, *motion, powers[0], powers[1])


def verdict(method: Integrator, both: Sequence[Overshoot]) -> str:
    """What the first step overshoots, judged by its powers from both starts: `none`,
    `displacement`, ..., or `unstable` where the method grows without bound anyway."""
    damping = np.array([both[0].damping])
    if spectral_radius(method, np.array([_FAR]), damping, 1.0)[0] > 1.0 + STABLE:
        return "unstable"
    growing: set[str] = set().union(*(motion.growing for motion in both))
    return " and ".join(sorted(growing)) or "none"


def _first_steps(
    method: Integrator, start: str, omega_h: Array, steps: int, damping: float
) -> Array:
    """u and h v of the first steps of oscillators, shape (2, steps + 1, oscillators), h = 1 s; nan
    after a response that ran away."""
    displacement, velocity = np.multiply(_TINY, STARTS[start])
    building = oscillators(omega_h, np.array([damping]))
    prepared = PreparedBuilding(building, displacement=displacement, velocity=velocity)
    return _marched(prepared, method, Steps(1.0, steps)) / _TINY


def _nonlinear_overshoot(
    method: Integrator, start: str, dt_over_t: float, steps: int, damping: float, law: str
) -> Overshoot:
    """The steps of the oscillator of a problem, from its displacement or from the velocity of the
    same energy."""
    if method.family.linear_only:
        raise UsageError(f"{method.label} integrates linear buildings only; not with the law {law}")

    from tdint.analysis.assessment.failures import problems  # needs what makes whole runs

    problem = problems()[law]
    (story,), (displacement,) = problem.model.stories, problem.model.initial.displacement
    velocity = math.sqrt(2.0 * problem.energy_scale / story.mass)
    omega = math.sqrt(story.stiffness / story.mass)  # of small vibrations
    damped = replace(story, dashpot=2.0 * damping * omega * story.mass)
    u_start, v_start = np.multiply(STARTS[start], (displacement, velocity))
    building = assemble(replace(problem.model, stories=(damped,)))
    prepared = PreparedBuilding(building, displacement=u_start, velocity=v_start)
    u, v = _marched(prepared, method, Steps(2.0 * math.pi * dt_over_t / omega, steps))[:, :, 0]
    powers = (math.nan, math.nan)
    return Overshoot(
        method.label, dt_over_t, damping, start, u / displacement, v / velocity, *powers, law
    )


def _marched(prepared: PreparedBuilding, method: Integrator, steps: Steps) -> Array:
    """Displacements and velocities of the floors at the steps, shape (2, steps + 1, n); nan after a
    response that ran away."""
    marched = prepared.march(method, steps, history_rows=steps.count)
    n = prepared.building.stories
    history = marched.space.history
    if marched.code < 0:
        history[1:][~history[1:].any(axis=1)] = math.nan  # never written
    return np.array([history[:, 1 : 1 + n], history[:, 1 + n : 1 + 2 * n]])
