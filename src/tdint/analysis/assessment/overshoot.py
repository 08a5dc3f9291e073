"""First steps of an undriven oscillator under a large step: does the method overshoot (Hilber and Hughes 1978)?"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from tdint.analysis.run.amplification import STABLE, spectral_radius
from tdint.analysis.run.prepared import PreparedBuilding
from tdint.analysis.run.steps import Steps
from tdint.arrays import Array
from tdint.errors import UsageError
from tdint.methods.catalogue import parse
from tdint.methods.method import Integrator
from tdint.model.building import oscillators
from tdint.tabular import Tabular
from tdint.written_numbers import how_many

STARTS = {"displacement": (1.0, 0.0), "velocity": (0.0, 1.0)}
"""Starts by name: u(0) and h v(0), m."""

EXACT_POWERS = {"displacement": (0.0, 1.0), "velocity": (-1.0, 0.0)}
"""By start, the powers of omega h in the amplitudes of u and h v of the exact motion."""

_LEVELS = 10.0 ** np.arange(2.0, 8.0)
_SPREAD = 1.0 + np.arange(16) * 0.61803398875 % 1.0  # so that no sine is caught at its zeros alone
_LARGER = 0.25  # powers further apart than this differ
_NOISE = {"displacement": 1e-13 * _LEVELS**2, "velocity": 1e-13 * _LEVELS}
"""What a step rounds, over its start: the acceleration of the start is omega^2 u(0) or 2 xi omega v(0)."""
_FAR = 1e3  # omega h by which an unstable method has left the unit circle
_TINY = 1e-200  # the motion is linear in its start: a tiny one leaves room for what grows


@dataclass(frozen=True, repr=False)
class Overshoot(Tabular):
    """First steps from one start; arrays of shape (steps + 1,), the first entry the start.

    Attributes
    ----------
    displacement, velocity : ndarray
        u over U and v over omega U with the amplitude U of the exact undamped motion, |u(0)| or |v(0)| / omega: the
        exact motion stays within -1 and 1. nan after a response that ran away.
    displacement_power, velocity_power : float
        p in u(h) ~ (omega h)^p and h v(h) ~ (omega h)^p for omega h to infinity; -inf where the step leaves nothing.
        The exact motion has `EXACT_POWERS`.
    """

    method: str
    dt_over_t: float
    damping: float
    start: str
    displacement: Array
    velocity: Array
    displacement_power: float
    velocity_power: float

    def _headline(self) -> str:
        steps = how_many(self.displacement.size - 1, "step")
        return f"of {self.method} from a {self.start}, dt/T {self.dt_over_t:g}, {steps}"

    @property
    def growing(self) -> set[str]:
        """Which of displacement and velocity grow with a higher power than in the exact motion."""
        powers = {"displacement": self.displacement_power, "velocity": self.velocity_power}
        bounds = EXACT_POWERS[self.start]
        return {name for (name, power), bound in zip(powers.items(), bounds, strict=True) if power > bound + _LARGER}


def overshoot(
    integrator: Integrator | str,
    start: str = "displacement",
    dt_over_t: float = 10.0,
    steps: int = 10,
    damping: float = 0.0,
) -> Overshoot:
    """Integrate an undriven oscillator over a few large steps, and measure the power of the first step's growth.

    Parameters
    ----------
    integrator : Integrator or str
        The method, or its name.
    start : str
        A key of `STARTS`.
    dt_over_t : float
        Step over undamped period.
    damping : float
        Damping ratio, in [0, 1).

    Raises
    ------
    UsageError
        An unknown method or start.
    """
    integrator = parse(integrator) if isinstance(integrator, str) else integrator
    if start not in STARTS:
        raise UsageError(f"a motion starts from one of {', '.join(STARTS)}, got {start!r:.60}")
    omega_h = 2.0 * math.pi * dt_over_t
    u, hv = _first_steps(integrator, start, np.array([omega_h]), steps, damping)[:, :, 0]
    amplitude = math.hypot(STARTS[start][0], STARTS[start][1] / omega_h)
    displacement_power, velocity_power = _powers(integrator, start, damping)
    return Overshoot(
        method=integrator.label,
        dt_over_t=dt_over_t,
        damping=damping,
        start=start,
        displacement=u / amplitude,
        velocity=hv / (omega_h * amplitude),
        displacement_power=displacement_power,
        velocity_power=velocity_power,
    )


def verdict(integrator: Integrator, both: Sequence[Overshoot]) -> str:
    """What the first step overshoots, judged by its powers from both starts: `none`, `displacement`, ..., or `unstable`
    where the method grows without bound anyway."""
    damping = np.array([both[0].damping])
    if spectral_radius(integrator, np.array([_FAR]), damping, 1.0)[0] > 1.0 + STABLE:
        return "unstable"
    growing: set[str] = set().union(*(motion.growing for motion in both))
    return " and ".join(sorted(growing)) or "none"


def _powers(integrator: Integrator, start: str, damping: float) -> tuple[float, ...]:
    """Powers of u and h v after one step: the slopes over the last decade of omega h that rounding leaves."""
    largest = np.array(
        [
            np.max(np.abs(_first_steps(integrator, start, level * _SPREAD, 1, damping)[:, 1]), axis=1)
            for level in _LEVELS
        ]
    )
    return tuple(_slope(values, _NOISE[start]) for values in largest.T)


def _slope(values: Array, noise: Array) -> float:
    clear = np.flatnonzero(values > noise)
    if clear.size < 2:
        return -math.inf
    low, high = clear[-2:]
    return math.log(values[high] / values[low]) / math.log(_LEVELS[high] / _LEVELS[low])


def _first_steps(integrator: Integrator, start: str, omega_h: Array, steps: int, damping: float) -> Array:
    """u and h v of the first steps of oscillators, shape (2, steps + 1, oscillators), h = 1 s; nan after a response
    that ran away."""
    displacement, velocity = np.multiply(_TINY, STARTS[start])
    building = oscillators(omega_h, np.array([damping]))
    prepared = PreparedBuilding(building, displacement=displacement, velocity=velocity)
    marched = prepared.march(integrator, Steps(1.0, steps), rows=steps)
    n = building.stories
    history = marched.space.history
    if marched.code < 0:
        history[1:][~history[1:].any(axis=1)] = math.nan  # never written
    return np.array([history[:, 1 : 1 + n], history[:, 1 + n : 1 + 2 * n]]) / _TINY
