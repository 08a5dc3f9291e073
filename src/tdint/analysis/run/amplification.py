"""Amplification matrices measured on the compiled steps, and the stability that follows from them."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tdint.analysis.run.workspace import workspace
from tdint.arrays import Array
from tdint.errors import AnalysisError
from tdint.kernels import layout as at
from tdint.kernels.building.compilable import Variant
from tdint.kernels.bundles import Scene
from tdint.methods.method import Integrator
from tdint.model.building import Building, oscillators

LINEAR_OSCILLATORS = Variant(laws=("linear",), modal=False, forces=False, dashpots=False)
"""What the kernels need for them."""

STABLE = 1e-9
"""A spectral radius above 1 by less than this counts as 1: rounding."""

_SETTLED = 100.0  # steps done as a multi-step method sees it: past its start

# Oscillators in one building where the step's coefficients belong to the whole building: their matrix is dense, and
# LAPACK mixes the modes of uncoupled oscillators from 26 on.
_TOGETHER = 16


def amplification(integrator: Integrator, omega: Array, damping: Array, h: float) -> Array:
    """Amplification matrices of undriven oscillators over one step h (s), by stepping each row of the method's memory.

    Parameters
    ----------
    omega, damping : ndarray, shape (k,)
        Circular frequencies (rad/s) and damping ratios.

    Returns
    -------
    ndarray, shape (k, m, m)
        m is the number of memory rows of the family; units as in the state.
    """
    omega, damping = np.broadcast_arrays(np.asarray(omega, float), np.asarray(damping, float))
    if integrator.family.prepare is not None:
        starts = range(0, max(omega.size, 1), _TOGETHER)
        groups = [oscillators(omega[j : j + _TOGETHER], damping[j : j + _TOGETHER]) for j in starts]
        return np.concatenate([_amplification(integrator, group, h) for group in groups])
    return _amplification(integrator, oscillators(omega, damping), h)


def _amplification(integrator: Integrator, building: Building, h: float) -> Array:
    memory = integrator.family.memory
    k = building.stories
    forces = np.zeros((0, 4))
    coefficients = integrator.coefficients(building, forces, h)
    step = integrator.family.step.variant(LINEAR_OSCILLATORS)
    space = workspace(building, integrator)
    scene = Scene(building.linear_terms, building.modal, building.law_parameters, forces, space.flags)
    result = np.empty((k, len(memory), len(memory)))
    for column, row in enumerate(memory):
        space.state[:] = 0.0
        space.state[row, :k] = 1.0
        _settle(building, space.state, space.springs, at.ACCELERATION in memory)
        space.report[at.STEPS_DONE] = _SETTLED
        code = step(coefficients, *scene, h, np.zeros(at.LOAD_SIZE), *space.memory)
        if code < 0:
            raise AnalysisError(f"{integrator.label}: a step of an oscillator failed")
        result[:, :, column] = space.state[list(memory), :k].T
    return result


def _settle(building: Building, state: Array, springs: Array, carries_acceleration: bool) -> None:
    """Committed springs, and the acceleration of equilibrium where the method does not carry its own."""
    u, v = state[at.DISPLACEMENT, :-1], state[at.VELOCITY, :-1]
    springs[:] = 0.0
    springs[at.DRIFT, :-1] = u
    springs[at.FORCE, :-1] = building.initial_stiffness * u
    springs[at.SLOPE, :-1] = building.initial_stiffness
    springs[at.UPPER, :-1], springs[at.LOWER, :-1] = math.inf, -math.inf
    if not carries_acceleration:
        state[at.ACCELERATION, :-1] = -building.initial_stiffness * u - building.linear_terms[at.STORY_DAMPER, :-1] * v


def spectral_radius(integrator: Integrator, omega: Array, damping: Array, h: float) -> Array:
    """Spectral radii of the measured amplification matrices, shape (k,)."""
    matrices = amplification(integrator, omega, damping, h)
    # Balance the rows: the state mixes m, m/s and m/s^2.
    family = integrator.family
    scale = np.array([h ** family.derivatives[row] for row in family.memory])
    matrices = matrices * scale[:, None] / scale
    return np.asarray(np.max(np.abs(np.linalg.eigvals(matrices)), axis=1))


@dataclass(frozen=True)
class Instability:
    """An oscillator that grows: its index, and the largest stable step below the one that was asked for (0: none),
    s."""

    index: int
    largest_stable: float


def find_instability(integrator: Integrator, omega: Array, damping: Array, h: float) -> Instability | None:
    """Whether a step h (s) is beyond the method's limit for one of some oscillators; the stiffest such one.

    A method that is unconditionally stable is not measured.
    """
    if integrator.stability_limit == math.inf:
        return None

    def unstable(step: float) -> NDArray[np.bool_]:
        return spectral_radius(integrator, omega, damping, step) > 1.0 + STABLE

    grows = np.flatnonzero(unstable(h))
    if not grows.size:
        return None
    stiffest = grows[np.argmax(omega[grows])]
    return Instability(int(stiffest), largest_stable(lambda step: not unstable(step).any(), h))


def largest_stable(stable: Callable[[float], bool], h: float, parts: int = 200) -> float:
    """End of the first range of stable steps, searched upward in (0, h] and bisected, rounded down; 0 for none, s."""
    low, high = 0.0, h
    for part in range(1, parts + 1):
        candidate = h * part / parts
        if not stable(candidate):
            high = candidate
            break
        low = candidate
    for _ in range(40):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if stable(middle) else (low, middle)
    return low if low > 1e-9 * h else 0.0
