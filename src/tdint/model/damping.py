"""Damping of a model as dampers of the chain and rows of modal damping."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from tdint.errors import ModelError
from tdint.kernels import layout as at
from tdint.model.definition import ModalDamping, Model, RayleighCoefficients, RayleighRatio
from tdint.model.modes import FreeVibration, Modes
from tdint.system import memory

Array = NDArray[np.float64]

_TABLES = 4  # of the size of the stories squared that solving for all modes takes


def add_damping(linear_terms: Array, stiffness: Array, model: Model, vibration: FreeVibration) -> Array:
    """Add the model's damping to the dampers of `chain`; return the rows of its modal damping, shape (modes, n + 1).

    Rayleigh damping is C = a0 M + a1 K with the initial stiffness K without P-delta: a damper from each floor to the
    ground and one beside each story. Modal damping is C = sum 2 xi omega (M phi)(M phi)^T over mass-normalized modes
    phi.
    """
    n = linear_terms.shape[1] - 1
    damping = model.damping
    if isinstance(damping, ModalDamping):
        _check_memory(n)
        return modal_rows(vibration.modes, linear_terms[at.MASS, :n], np.array(damping.ratios))
    if isinstance(damping, RayleighRatio):
        damping = rayleigh(damping, *(vibration.frequency(mode) for mode in damping.modes))
    if damping is not None and not all(story.rayleigh for story in model.stories):
        return _without_isolators(linear_terms, stiffness, model, damping)
    if damping is not None:
        linear_terms[at.FLOOR_DAMPER, :n] += damping.mass * linear_terms[at.MASS, :n]
        linear_terms[at.STORY_DAMPER, :n] += damping.stiffness * stiffness
    return np.zeros((0, n + 1))


def _without_isolators(linear_terms: Array, stiffness: Array, model: Model, damping: RayleighCoefficients) -> Array:
    """Rayleigh damping that does not reach isolators; return its rows w of C = sum w w^T, shape (rows, n + 1).

    Stiffness-proportional dampers stand beside the other stories alone. Mass-proportional ones act on the motion
    relative to the floor on top of the isolator below, not to the ground, from where they would brake the isolators.
    """
    n = linear_terms.shape[1] - 1
    reached = np.array([story.rayleigh for story in model.stories])
    linear_terms[at.STORY_DAMPER, :n] += np.where(reached, damping.stiffness * stiffness, 0.0)
    mass = linear_terms[at.MASS, :n]
    on_ground = np.cumsum(~reached) == 0
    linear_terms[at.FLOOR_DAMPER, :n] += np.where(on_ground, damping.mass * mass, 0.0)
    rows = []
    base = 0
    for floor in range(n):
        if not reached[floor]:
            base = floor
        elif not on_ground[floor] and damping.mass > 0.0:
            row = np.zeros(n + 1)
            row[floor], row[base] = 1.0, -1.0
            rows.append(np.sqrt(damping.mass * mass[floor]) * row)
    return np.array(rows).reshape(len(rows), n + 1)


def _check_memory(stories: int) -> None:
    """Refuse modal damping whose modes this machine cannot hold.

    Raises
    ------
    ModelError
        There are too many stories.
    """
    needed = _TABLES * 8 * stories**2
    if (has := memory()) is None or needed <= has:
        return
    raise ModelError(
        f"modal damping of {stories} stories takes {needed / 2**30:.0f} GiB of memory, and this machine has "
        f"{has / 2**30:.0f}: give damping.rayleigh"
    )


def rayleigh(wanted: RayleighRatio, omega_1: float, omega_2: float) -> RayleighCoefficients:
    """Coefficients from two ratios: xi = a0 / (2 omega) + a1 omega / 2 (Chopra 2012, eq. 11.4.8).

    Of one mode alone half from the mass, half from the stiffness: what equal ratios give as two modes come together.
    """
    xi_1, xi_2 = wanted.ratios
    if wanted.modes[0] == wanted.modes[1]:
        return RayleighCoefficients(mass=xi_1 * omega_1, stiffness=xi_1 / omega_1)
    difference = omega_2**2 - omega_1**2
    return RayleighCoefficients(
        mass=2.0 * omega_1 * omega_2 * (xi_1 * omega_2 - xi_2 * omega_1) / difference,
        stiffness=2.0 * (xi_2 * omega_2 - xi_1 * omega_1) / difference,
    )


def modal_rows(modes: Modes, mass: Array, ratios: Array) -> Array:
    """Rows sqrt(2 xi omega) M phi; one ratio stands for all modes, several for the first ones."""
    if ratios.size == 1:
        ratios = np.full(modes.omega.size, ratios[0])
    damped = np.flatnonzero(ratios)
    rows = np.zeros((damped.size, mass.size + 1))
    factors = np.sqrt(2.0 * ratios[damped] * modes.omega[damped])
    rows[:, :-1] = (mass[:, None] * modes.shapes[:, damped] * factors).T
    return rows
