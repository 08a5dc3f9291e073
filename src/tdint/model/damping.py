"""Damping of a building: modal damping and Rayleigh damping, with or without isolators."""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import partial
from typing import Any

import numpy as np

from tdint.arrays import Array
from tdint.errors import ModelError
from tdint.kernels import layout as rows
from tdint.kernels.laws import OURS
from tdint.kernels.laws.law import can_fall
from tdint.model.definition import Damping, ModalDamping, Model, RayleighCoefficients, RayleighRatio
from tdint.model.modes import FreeVibration
from tdint.model.story import Element, Story
from tdint.model.story_laws import CODES, LAWS, LINEAR, of_samples
from tdint.system import memory

_MATRICES_OF_ALL_MODES = 4
"""Number of matrices of shape (stories, stories) in memory while all modes are computed."""


def has_tangent_damping(damping: Damping) -> bool:
    """Return True for Rayleigh damping with the tangent stiffness."""
    return isinstance(damping, RayleighRatio | RayleighCoefficients) and damping.tangent


def falling_spring(story: Story) -> Element | None:
    """Return the first spring of a story that can have a negative tangent stiffness, if any.

    The tangent stiffness of such a story cannot be used for damping. Where the force of a law drops
    to zero, as at a fracture, the damping force is not even defined. A plug-in law may not declare
    that it falls; its force is then followed on a path of drifts.
    """
    for spring in story.springs:
        law = LAWS.get(spring.law.name)
        if law is None or math.isnan(spring.stiffness):  # reported as an error of the model file
            continue
        if any(spring.law.fracture) or can_fall(law, spring.stiffness, spring.law.parameters):
            return spring
        if CODES[law.name] >= OURS:
            # Imported here, because only laws of plug-ins are measured.
            from tdint.model.law_checks import falls_on_path

            column = np.array([CODES[law.name], spring.stiffness, 0.0, 0.0, *spring.law.parameters])
            if falls_on_path(law, column):
                return spring
    return None


def falling_message(law_name: str, number: int) -> str:
    """Return the message for a law that falls in story `number` with tangent damping."""
    return (
        f"tangent: the stiffness of the {law_name} law of story {number} can be negative, which "
        "would be negative damping; omit `tangent`"
    )


def add_damping(
    linear_terms: Array, stiffness: Array, model: Model, vibration: FreeVibration
) -> Array:
    """Add the damping of a model to the linear terms of the building.

    Dampers of single floors and stories are added to `linear_terms`. Other damping is returned as
    rows.

    Rayleigh damping is C = a0 M + a1 K with the initial stiffness K without P-delta: a damper from
    each floor to the ground and a damper parallel to each story. Modal damping is C = sum 2 xi
    omega (M phi)(M phi)^T over mass-normalized modes phi, which P-delta changes unless
    `ModalDamping.p_delta` is False.

    Parameters
    ----------
    linear_terms : ndarray, shape (LINEAR_TERM_ROWS, n + 1)
        Table of linear terms; the damper rows are modified.
    stiffness : ndarray, shape (n,)
        Initial stiffness of the stories without P-delta, N/m.

    Returns
    -------
    ndarray, shape (k, n + 1)
        Rows w; each row contributes w w^T to the damping matrix: one for each damped mode
        (modal damping), one for each damper between two floors (Rayleigh damping of a building with
        isolators), otherwise none. The last column, for the ground, is 0.

    Raises
    ------
    ModelError
        Modal damping of the stories requires more memory than is available.
    """
    n = linear_terms.shape[-1] - 1
    damping = model.damping
    if isinstance(damping, ModalDamping):
        # All modes are computed simultaneously; check that the memory is sufficient for their
        # matrices of 8-byte numbers.
        needed, available = _MATRICES_OF_ALL_MODES * 8 * n**2, memory()
        if available is not None and needed > available:
            raise ModelError(
                f"modal damping of {n} stories requires {needed / 2**30:.0f} GiB of memory, "
                f"and this machine has {available / 2**30:.0f} GiB; use damping.rayleigh"
            )
        if not damping.p_delta:
            link = linear_terms[rows.LINK, ..., :n]
            vibration = FreeVibration(linear_terms[rows.MASS, ..., :n], stiffness, link)
        modes, ratios = vibration.modes, np.array(damping.ratios).T
        # Compute the rows sqrt(2 xi omega) M phi. The last ratio applies to all further modes.
        ratios = ratios[..., np.minimum(np.arange(n), ratios.shape[-1] - 1)]
        damped_modes = np.flatnonzero(ratios.reshape(-1, n)[0])
        factors = np.sqrt(2.0 * ratios[..., damped_modes] * modes.omega[..., damped_modes])
        modal = np.zeros((damped_modes.size, *linear_terms.shape[1:]))
        modal[..., :-1] = np.moveaxis(
            linear_terms[rows.MASS, ..., :n, None]
            * modes.shapes[..., damped_modes]
            * factors[..., None, :],
            -1,
            0,
        )
        return modal
    if isinstance(damping, RayleighRatio):
        frequencies = [vibration.frequency(mode) for mode in damping.modes]
        result = of_samples(partial(_rayleigh_of, damping), *damping.ratios, *frequencies)
        coefficients: list[Any] = list(np.array(result).T)
        damping = RayleighCoefficients(coefficients[0], coefficients[1], damping.tangent)
    if damping is None:
        return np.zeros((0, *linear_terms.shape[1:]))
    return _add_rayleigh_damping(linear_terms, stiffness, model, damping)


def _add_rayleigh_damping(
    linear_terms: Array, stiffness: Array, model: Model, damping: RayleighCoefficients
) -> Array:
    """Add Rayleigh damping that excludes isolators to the linear terms in place, and return a row w
    for each damper between two floors, which contributes w w^T to the damping matrix.

    Stiffness-proportional dampers act only in the other stories. Mass-proportional dampers act on
    the velocity of a floor relative to the floor on top of the nearest isolator below. Dampers to
    the ground would also damp the isolators.

    With the tangent stiffness, the row TANGENT_DAMPING receives the coefficient of stories with a
    nonlinear law. The tangent stiffness of a linear law is its stiffness.
    """
    n = stiffness.shape[-1]
    has_rayleigh = np.array([story.rayleigh for story in model.stories])
    by_mass, by_stiffness = np.array(damping[:2])[..., None]
    dampers = by_stiffness * np.where(has_rayleigh, stiffness, 0.0)
    if damping.tangent:
        is_nonlinear = np.array(
            [any(spring.law != LINEAR for spring in story.springs) for story in model.stories]
        )
        has_tangent = is_nonlinear & (dampers > 0.0)
        linear_terms[rows.TANGENT_DAMPING, :n] = np.where(has_tangent, damping.stiffness, 0.0)
        dampers = np.where(has_tangent, 0.0, dampers)
    linear_terms[rows.STORY_DAMPER, ..., :n] += dampers
    mass = linear_terms[rows.MASS, ..., :n]
    # The sum counts the isolators from the ground up to each story.
    is_below_isolators = np.cumsum(~has_rayleigh) == 0
    linear_terms[rows.FLOOR_DAMPER, ..., :n] += np.where(is_below_isolators, by_mass * mass, 0.0)
    between_floors = []
    floor_on_isolator = 0
    for floor in np.flatnonzero(~is_below_isolators).tolist():
        if not has_rayleigh[floor]:
            floor_on_isolator = floor
        elif damping.mass > 0.0:
            # This row w is the difference of the velocities of the two floors, so that w w^T is the
            # matrix of a damper between them.
            row = np.zeros(n + 1)
            row[floor], row[floor_on_isolator] = 1.0, -1.0
            between_floors.append(np.sqrt(damping.mass * mass[floor]) * row)
    return np.array(between_floors).reshape(len(between_floors), *linear_terms.shape[1:])


def _rayleigh_of(damping: RayleighRatio, numbers: Sequence[float]) -> RayleighCoefficients:
    """Return the result of `rayleigh` for other ratios, followed by the frequencies."""
    count = len(damping.ratios)
    return rayleigh(damping._replace(ratios=tuple(numbers[:count])), *numbers[count:])


def rayleigh(damping: RayleighRatio, *frequencies: float) -> RayleighCoefficients:
    """Compute the coefficients a0 and a1 of Rayleigh damping from the ratios of two modes, or of
    one mode without a share of the mass.

    `frequencies` contains the circular frequencies of the modes, rad/s. The ratio of a mode is xi =
    a0 / (2 omega) + a1 omega / 2 (Chopra 2012, eq. 11.4.8). If both modes are the same, mass and
    stiffness each contribute half of the damping. This is the limit for equal ratios as the two
    frequencies approach each other.

    Raises
    ------
    ModelError
        A frequency is zero, the two frequencies are numerically equal, or the difference of their
        squares exceeds the range of floats.
    """
    if min(frequencies) <= 0.0:
        raise ModelError(
            "damping: a ratio of Rayleigh damping needs the frequencies of its modes, and a story "
            "has no initial stiffness; give the coefficients `rayleigh: {mass, stiffness}`, or a "
            "law with an initial stiffness"
        )
    if len(frequencies) == 1:
        return RayleighCoefficients(0.0, 2.0 * damping.ratios[0] / frequencies[0], damping.tangent)
    (xi_1, xi_2), (omega_1, omega_2) = damping.ratios, frequencies
    if damping.modes[0] == damping.modes[1]:
        return RayleighCoefficients(xi_1 * omega_1, xi_1 / omega_1, damping.tangent)
    difference = omega_2**2 - omega_1**2
    if not 0.0 < abs(difference) < math.inf:
        raise ModelError(
            "damping: the coefficients of Rayleigh damping cannot be computed from the frequencies "
            f"of modes {damping.modes[0]} and {damping.modes[1]} ({omega_1:.4g} and {omega_2:.4g} "
            "rad/s), because masses or stiffnesses differ by too many orders of magnitude; check "
            "their units"
        )
    return RayleighCoefficients(
        mass=2.0 * omega_1 * omega_2 * (xi_1 * omega_2 - xi_2 * omega_1) / difference,
        stiffness=2.0 * (xi_2 * omega_2 - xi_1 * omega_1) / difference,
        tangent=damping.tangent,
    )
