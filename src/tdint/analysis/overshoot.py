"""First steps of an undriven oscillator under a large step: does the method overshoot (Hilber and Hughes 1978)?"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tdint.analysis.stepping import Steps, integrate, workspace
from tdint.kernels.layout import DISPLACEMENT, FORCE_COLUMNS, VELOCITY
from tdint.methods.method import Integrator
from tdint.model.building import oscillators

Array = NDArray[np.float64]

STARTS = {"displacement": (1.0, 0.0), "velocity": (0.0, 1.0)}
"""Starts by name: u(0) and h v(0), m."""

_LARGE = (1e4, 1e5)  # omega h between which the power of growth is measured
_TINY = 1e-20
_NOTHING = 1e-9  # a first step smaller than this, over the start, is rounding


@dataclass(frozen=True)
class Overshoot:
    """First steps from one start; arrays of shape (steps + 1,), the first entry the start.

    Attributes
    ----------
    displacement, velocity : ndarray
        u (m) and v / omega (m): both stay within the start's amplitude in the exact motion, which is 1 for a start from
        displacement and 1 / (omega h) for one from velocity.
    displacement_power, velocity_power : float
        p in u_1 ~ (omega h)^p and h v_1 ~ (omega h)^p for omega h to infinity; -inf where the step leaves nothing. The
        exact motion stays within 0 and 1 for a start from displacement, within -1 and 0 for one from velocity.
    """

    method: str
    dt_over_t: float
    damping: float
    start: str
    displacement: Array
    velocity: Array
    displacement_power: float
    velocity_power: float


def overshoot(
    integrator: Integrator, start: str, dt_over_t: float = 10.0, steps: int = 10, damping: float = 0.0
) -> Overshoot:
    """Integrate an undriven oscillator over a few large steps, and measure the power of the first step's growth."""
    omega_h = 2.0 * math.pi * dt_over_t
    displacement, velocity = _first_steps(integrator, start, omega_h, steps, damping)
    powers = [_power(*(pair[part][1] for pair in _pairs(integrator, start, damping))) for part in (0, 1)]
    return Overshoot(
        integrator.label, dt_over_t, damping, start, displacement, velocity / omega_h, powers[0], powers[1]
    )


def _pairs(integrator: Integrator, start: str, damping: float) -> list[tuple[Array, Array]]:
    return [_first_steps(integrator, start, omega_h, 1, damping) for omega_h in _LARGE]


def _power(small: float, large: float) -> float:
    if abs(small) < _NOTHING / _LARGE[0] and abs(large) < _NOTHING / _LARGE[0]:
        return -math.inf
    return math.log(abs(large) / abs(small)) / math.log(_LARGE[1] / _LARGE[0])


def _first_steps(integrator: Integrator, start: str, omega_h: float, steps: int, damping: float) -> tuple[Array, Array]:
    """u and h v of the first steps, h = 1 s; nan after a response that ran away.

    The motion is linear in its start, so a tiny start leaves room for what grows.
    """
    building = oscillators(np.array([omega_h]), np.array([damping]))
    space = workspace(building, integrator, steps)
    space.history[1:] = math.nan
    space.state[DISPLACEMENT, 0], space.state[VELOCITY, 0] = np.multiply(_TINY, STARTS[start])
    forces = np.zeros((0, FORCE_COLUMNS))
    integrate(integrator, building, forces, np.zeros(1), Steps(1.0, steps), space)
    return space.history[:, 1] / _TINY, space.history[:, 2] / _TINY
