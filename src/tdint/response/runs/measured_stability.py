"""Amplification matrices that are measured on the compiled steps of methods, and the resulting
stability."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from tdint.arrays import Array, bisect_interval, cached_property
from tdint.errors import AnalysisError
from tdint.kernels import layout as rows
from tdint.kernels.stepping import Scene
from tdint.methods.method import Integrator
from tdint.methods.workspace import workspace
from tdint.model.building import Building, oscillators
from tdint.response.runs.compiled_steps import LINEAR_OSCILLATORS, validate_plugin_step

STABLE = 1e-9
"""Dimensionless. Excess of a spectral radius above 1 that is attributed to rounding."""

# Number of completed steps that is stored in the state of a method before its step is measured.
# After this number, the start procedure of every method has ended
_COMPLETED_STEPS = 100.0

# Maximum number of oscillators in one building if the coefficients of the step belong to the
# complete building. Its matrix is dense, and from 26 oscillators LAPACK returns mixed modes of
# uncoupled oscillators.
_MAX_COUPLED = 16


def amplification(integrator: Integrator, omega: Array, damping: Array, h: float) -> Array:
    """Return amplification matrices of free oscillators over one time step.

    Each matrix is measured by one step from a unit value in each row of the memory of the method.

    Returns
    -------
    ndarray, shape (k, m, m)
        Matrices; m is the number of memory rows of the method family. Units are the units of the
        state.
    """
    omega, damping = np.broadcast_arrays(np.asarray(omega, float), np.asarray(damping, float))
    # If the coefficients of the method belong to the complete building, limit the number of
    # oscillators in a building.
    if integrator.family.prepare is not None:
        starts = range(0, max(omega.size, 1), _MAX_COUPLED)
        groups = [
            oscillators(omega[j : j + _MAX_COUPLED], damping[j : j + _MAX_COUPLED]) for j in starts
        ]
        return np.concatenate([_amplification(integrator, group, h) for group in groups])
    return _amplification(integrator, oscillators(omega, damping), h)


def _amplification(integrator: Integrator, building: Building, h: float) -> Array:
    """Return the amplification matrices of the uncoupled oscillators of a building (`oscillators`),
    each of mass 1 kg, shape (k, m, m).

    The memory rows of a method are the m rows of its state that a step uses from the previous step,
    such as displacement and velocity. Column j of a matrix contains the memory rows after one step
    that starts with the value 1 in memory row j and 0 in all further rows.
    """
    memory_rows = integrator.family.memory
    k = building.stories
    forces = np.zeros((0, rows.FORCE_COLUMNS))  # no forces on floors
    coefficients = integrator.coefficients(building, forces, h)
    step = integrator.family.step.variant(LINEAR_OSCILLATORS)
    validate_plugin_step(integrator)
    space = workspace(building, integrator)
    scene = Scene(
        building.linear_terms, building.modal, building.law_parameters, forces, space.flags
    )
    result = np.empty((k, len(memory_rows), len(memory_rows)))
    state, law_state, stiffness = space.state, space.law_state, building.initial_stiffness
    for column, row in enumerate(memory_rows):
        state[:], law_state[:] = 0.0, 0.0
        state[row, :k] = 1.0
        # If the acceleration is not part of the memory of the method, it follows from equilibrium
        # for the unit mass.
        u, v = state[rows.DISPLACEMENT, :-1], state[rows.VELOCITY, :-1]
        law_state[rows.DRIFT, :-1] = u
        law_state[rows.FORCE, :-1] = stiffness * u
        law_state[rows.SLOPE, :-1] = stiffness
        # A linear spring has no drifts where its branch changes.
        law_state[rows.UPPER, :-1], law_state[rows.LOWER, :-1] = math.inf, -math.inf
        if rows.ACCELERATION not in memory_rows:
            state[rows.ACCELERATION, :-1] = (
                -stiffness * u - building.linear_terms[rows.STORY_DAMPER, :-1] * v
            )
        # The step must not execute the start procedure of the method.
        space.step_status[rows.STEPS_DONE] = _COMPLETED_STEPS
        code = step(coefficients, *scene, h, np.zeros(rows.LOAD_SIZE), *space.memory)
        if code < 0:
            raise AnalysisError(
                f"{integrator.label}: the time step {h:.6g} s of a linear oscillator failed, so "
                "the stability of the method cannot be measured"
            )
        result[:, :, column] = state[list(memory_rows), :k].T
    return result


def spectral_radius(integrator: Integrator, omega: Array, damping: Array, h: float) -> Array:
    """Return the spectral radii of the amplification matrices of oscillators, shape (k,)."""
    matrices = amplification(integrator, omega, damping, h)
    # The memory of a method contains quantities in m, m/s and m/s^2. Scale its rows to similar
    # magnitudes, which reduces rounding errors of the eigenvalues.
    family = integrator.family
    scale = np.array([h ** family.derivatives[row] for row in family.memory])
    matrices = matrices * scale[:, None] / scale
    return np.asarray(np.max(np.abs(np.linalg.eigvals(matrices)), axis=1))


@dataclass(frozen=True)
class Instability:
    """Unstable oscillator for a time step h (s).

    Attributes
    ----------
    stable : callable
        Function that receives a time step, s, and returns True if all oscillators are stable with
        it.
    """

    index: int
    h: float
    stable: Callable[[float], bool] = field(compare=False)

    @cached_property
    def largest_stable(self) -> float:
        """Largest stable time step below h, s; 0 without a stable time step.

        It is computed on first access with about 150 measurements.
        """
        return largest_stable(self.stable, self.h)


def find_instability(
    integrator: Integrator, omega: Array, damping: Array, h: float
) -> Instability | None:
    """Return the stiffest oscillator that is unstable with a time step; None if all are stable.

    An oscillator is unstable if the spectral radius of its measured amplification matrix is above
    1. A method that declares no stability limit is not measured; the result is `None`.
    """
    if integrator.stability_limit == math.inf:
        return None

    def is_unstable(step: float) -> NDArray[np.bool_]:
        """Return True for each oscillator that grows with a time step."""
        return spectral_radius(integrator, omega, damping, step) > 1.0 + STABLE

    grows = np.flatnonzero(is_unstable(h))
    if not grows.size:
        return None
    stiffest = grows[np.argmax(omega[grows])]
    return Instability(int(stiffest), h, lambda step: not is_unstable(step).any())


def largest_stable(stable: Callable[[float], bool], h: float) -> float:
    """Return the end of the first interval of stable time steps in (0, h], rounded down, s.

    The interval is searched upward from 0 in 200 equal steps, and its end is bisected. The result
    is 0 if no step is stable.

    Parameters
    ----------
    stable : callable
        Function that receives a time step, s, and returns True if it is stable.
    h : float
        Upper end of the search, s.
    """
    low, high = 0.0, h
    # Some methods are unstable at intermediate time steps and stable again above them. Searching in
    # steps of h / 200 locates the first stable interval.
    for part in range(1, 201):
        candidate = h * part / 200
        if not stable(candidate):
            high = candidate
            break
        low = candidate
    # After 40 bisections the result is more precise than any time step that is written in messages.
    low, _ = bisect_interval(stable, low, high, 40)
    return low if low > 1e-9 * h else 0.0
