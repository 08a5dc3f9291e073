"""Matrices of a linear building with attachments and links, and its state-space form.

The displacements u of the rows relative to the ground satisfy

    M u'' + C u' + K u + B^T f = p - M0 r ag,    f' = k (B u' - f / c)

with the mass M0 that the ground motion loads (M without inerters to the ground), the influence
vector r, the ground acceleration ag, forces p on the rows, and the forces f of
dampers (coefficient c) in series with a brace (stiffness k). The rows of B give their drifts.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from tdint.arrays import Array, immutable
from tdint.errors import ModelError
from tdint.kernels import layout as rows
from tdint.model.building import Building, assemble
from tdint.model.definition import Model
from tdint.model.modes import Braces, state_matrix
from tdint.model.story import column_name
from tdint.response.arguments import AnyModel, model_of
from tdint.tabular import Described


class StateSpace(NamedTuple):
    """Matrices of x' = a x + b w, y = c x + d w.

    The state x contains displacements and velocities of the rows (m, m/s) and the forces of dampers
    with a brace (N). The input w contains the ground acceleration (m/s^2) and the forces on the
    rows (N), the output y the displacements, velocities and absolute accelerations of the rows.

    Attributes
    ----------
    a : ndarray, shape (2 n + b, 2 n + b)
    b : ndarray, shape (2 n + b, 1 + n)
    c : ndarray, shape (3 n, 2 n + b)
    d : ndarray, shape (3 n, 1 + n)
    """

    a: Array
    b: Array
    c: Array
    d: Array


@immutable
class SystemMatrices(Described):
    """Matrices of a building with its initial stiffness, in SI units.

    Attributes
    ----------
    names : tuple of str
        Names of the rows: floor_1, ..., then the attachments, or rotation_1, ... of the floors with
        rotary inertia (rad; forces are moments), base_rotation and base of a base with inertia or
        dashpots; names of rows that are not floors replace those of the floors.
    mass, stiffness, damping : ndarray, shape (n, n)
        M (kg) with inerters, K with P-delta (N/m), and C (N s/m) with Rayleigh or modal damping and
        all dashpots without a brace.
    loaded_mass : ndarray, shape (n, n)
        Masses M0 that the ground motion loads, kg: `mass` without the inertances.
    influence : ndarray, shape (n,)
        Displacements r of the rows for a unit displacement of the ground.
    braces : Braces
        Drifts, braces and coefficients of dampers with a brace, which C does not contain.
    """

    names: tuple[str, ...]
    mass: Array
    stiffness: Array
    damping: Array
    loaded_mass: Array
    influence: Array
    braces: Braces

    def state_space(self) -> StateSpace:
        """Return the state-space form, for example for `scipy.signal.StateSpace(*result)`.

        Returns
        -------
        StateSpace

        Raises
        ------
        ModelError
            The mass matrix is singular.
        """
        n, states = len(self.names), 2 * len(self.names) + self.braces.stiffness.size
        if np.linalg.matrix_rank(self.mass) < n:
            raise ModelError(
                "a row without mass has no acceleration, so that the model has no state-space "
                "form; condense the row, or give it a mass"
            )
        a = state_matrix(self.mass, self.stiffness, self.damping, self.braces)
        b = np.zeros((states, 1 + n))
        b[n : 2 * n, 1:] = np.linalg.inv(self.mass)
        b[n : 2 * n, 0] = -np.linalg.solve(self.mass, self.loaded_mass @ self.influence)
        c = np.vstack([np.eye(2 * n, states), a[n : 2 * n]])
        d = np.zeros((3 * n, 1 + n))
        # The absolute acceleration of a row contains the ground acceleration only if an inerter
        # connects it to the ground.
        d[2 * n :] = b[n : 2 * n]
        d[2 * n :, 0] += self.influence
        return StateSpace(a, b, c, d)


def matrices(model: AnyModel) -> SystemMatrices:
    """Return the matrices of a building with its initial stiffness.

    Parameters
    ----------
    model : Model, str, Path or mapping
        Model, model file or its content, as for `tdint.run`.

    Returns
    -------
    SystemMatrices
        Mass, stiffness, damping and influence vector of floors and attachments.

    Raises
    ------
    ModelError
        The model is invalid, P-delta effects exceed the stiffness of a story, or the force of a
        damper is not proportional to the velocity.
    """
    model = model_of(model)
    building = assemble(model)
    check_dampers(model, building, "matrix of its dampers")
    building.vibration.frequency(1)  # raises the error of a story without stiffness
    damping, braces = building.linear_damping()
    system = building.system
    floors = (f"floor_{number}" for number in range(1, building.floors + 1))
    turning = (
        f"rotation_{number}"
        for number, story in enumerate(model.stories, start=1)
        if story.rotary_inertia
    )
    names = (
        *(system.names if system and system.names else floors),
        *(column_name(item.name) for item in building.attachments),
        *turning,
        *(
            ("base_rotation", "base")[k]
            for k in (model.matrices.base_rows if model.matrices else ())
        ),
    )
    return SystemMatrices(
        names=names,
        mass=system.mass if system else np.diag(building.mass),
        stiffness=building.stiffness_matrix(),
        damping=damping,
        loaded_mass=system.loaded_mass if system else np.diag(building.mass),
        influence=system.influence if system else np.ones(building.masses),
        braces=braces,
    )


def check_dampers(model: Model, building: Building, subject: str) -> None:
    """Raise ModelError if the force of a damper is not proportional to the velocity, so that the
    building has no `subject`."""
    terms = building.linear_terms[:, :-1]
    is_power = (terms[rows.POWER_DAMPER] != 0.0) & (terms[rows.POWER] != 0.0)
    is_power |= (terms[rows.BRACE] != 0.0) & (
        (terms[rows.BRACED_EXPONENT] != 1.0) | (terms[rows.BRACED_RELIEF] != 0.0)
    )
    if is_power.any():
        i = int(np.argmax(is_power))
        devices = [item.name for item in model.devices]
        place = f"story {i + 1}" if i < building.floors else devices[i - building.floors]
        raise ModelError(
            f"{model.name}: {place} has a power-law dashpot, whose damping depends on the "
            f"amplitude, so that it has no {subject}; use a dashpot with "
            "exponent 1"
        )
