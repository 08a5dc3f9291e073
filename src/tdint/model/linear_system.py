"""Linear systems given by matrices: stiffness matrices, flexural stories, and rows that are not
floors.

The equation of motion is (M + B) a + C v + K u = -M r ag + p with the inertance B. Rows without
mass and inertance follow the other rows statically; the modes contain them. Their dashpots make
them lag behind (`Lag`).

A flexural story is a Timoshenko segment with constant EI and GA. Each end has a displacement and a
rotation. Rotations without rotary inertia, and motions of the base without inertia and dashpot, are
condensed. The rotations of floors with rotary inertia are rows after the floors (after attachments,
if there are any), rad; the forces on these rows are moments, and the ground motion does not load
them. The rotation and the displacement of the base are the last rows.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, fields, replace
from typing import Any

import numpy as np

from tdint.arrays import Array, cached_property
from tdint.errors import ModelError
from tdint.kernels import layout as rows
from tdint.model.damping import rayleigh
from tdint.model.definition import (
    Attachment,
    ModalDamping,
    Model,
    RayleighCoefficients,
    RayleighRatio,
)
from tdint.model.modes import Braces, FreeVibration, Modes, check_springs
from tdint.model.story import column_name


@dataclass(frozen=True)
class Flexure:
    """Deformations of n flexural stories as matrices on the displacements of the rows.

    Attributes
    ----------
    moment : ndarray, shape (n, rows)
        Moments at the bottom of the stories, N m.
    rotation : ndarray, shape (n, rows)
        Rotations at the top of the stories, rad.
    shear_drift, bending_drift : ndarray, shape (n, rows)
        Parts of the drifts, m. The third part is the rotation at the bottom times the height.
    base : ndarray, shape (2, rows)
        Rotation (rad) and displacement (m) of the base.
    levels : ndarray, shape (rows,)
        Moments at the bottom of the first story of unit forces on the rows: heights of the floors,
        m, 1 for rotations of floors, and 0 for the base.
    """

    moment: Array
    rotation: Array
    shear_drift: Array
    bending_drift: Array
    base: Array
    levels: Array

    def beside(self, attachments: Sequence[Attachment], n: int) -> Flexure:
        """Return the matrices with the rows of attachments, which act at their floors, after the
        rows of n floors."""
        heights = [self.levels[item.floor - 1] if item.floor else 0.0 for item in attachments]
        parts = {
            item.name: np.insert(getattr(self, item.name), [n] * len(attachments), 0.0, axis=-1)
            for item in fields(self)
        }
        parts["levels"][n : n + len(attachments)] = heights
        return Flexure(**parts)


@dataclass(frozen=True)
class Lag:
    """Deviation of rows without mass from the static positions, caused by their dashpots.

    With the matrices K_s and C_s of the rows without mass, the solutions of C_s psi = tau K_s psi
    with positive relaxation times tau are Maxwell elements. The coordinate q of the shape
    psi / sqrt(tau) follows the modal velocities w of the other rows, and its dashpot acts on the
    modes:

        q' = -E^T w - q / tau,   modal force of the dashpots on the modes: E q'

    in addition to the modal damping of static positions. The stored energy is q^2 / (2 tau).

    Attributes
    ----------
    shapes : ndarray, shape (n, r)
        Displacements of all rows per unit of each coordinate; zero in rows with mass.
    rates : ndarray, shape (r,)
        1 / tau, 1/s.
    coupling : ndarray, shape (modes, r)
        E.
    """

    shapes: Array
    rates: Array
    coupling: Array

    def coordinates(self, stiffness: Array, displacement: Array) -> Array:
        """Return q for displacements of the rows minus static displacements, shape (..., n)."""
        return np.asarray(displacement @ stiffness @ self.shapes / self.rates)


@dataclass(frozen=True)
class LinearSystem:
    """Matrices of a linear model; they replace the springs and dampers of `Building`.

    Attributes
    ----------
    mass, stiffness, damping : ndarray, shape (n, n)
        M + B (kg), K (N/m) and C (N s/m).
    loaded_mass : ndarray, shape (n, n)
        M, kg, which the ground motion loads.
    influence : ndarray, shape (n,)
        Displacements r of the rows for a unit displacement of the ground.
    deformations : ndarray, shape (n, n)
        Drifts for displacements; the identity for rows that are not floors.
    cuts : ndarray, shape (stories, n)
        Sums of the forces on the rows that give the total story shears. For rows that are not
        floors: the forces along the ground motion on a row and the rows after it; only the first is
        reported.
    spring_forces : ndarray, shape (n, n)
        Restoring forces of the stories for displacements, N/m, and moments on rotations; for rows
        that are not floors as `cuts`.
    names : tuple of str
        Names of rows that are not floors, in columns; empty for a building.
    flexure : Flexure | None
        Results of flexural stories.
    lag : Lag | None
        Deviation of rows without mass from the static positions; None if they follow statically.
    inerters : ndarray, shape (springs, n)
        Forces of the inerters of a building for accelerations of its rows, kg. Its stories,
        attachments and links are the first axis of all matrices of drifts and forces of stories.
    """

    mass: Array
    loaded_mass: Array
    stiffness: Array
    damping: Array
    influence: Array
    deformations: Array
    cuts: Array
    spring_forces: Array
    names: tuple[str, ...] = ()
    flexure: Flexure | None = None
    lag: Lag | None = None
    inerters: Array = field(default_factory=lambda: np.zeros((0, 0)))

    def modal_damping(self, modes: Modes, mode: int) -> float:
        """Return the modal damping phi^T C phi of a mode, 1/s, at its frequency: the elements of
        rows without mass have the damping E^2 / (1 + (omega tau)^2)."""
        shape, omega = modes.shapes[:, mode], modes.omega[mode]
        damping = shape @ self.damping @ shape
        if self.lag is not None:
            squared = np.square(self.lag.coupling[mode])
            damping -= np.sum(squared * omega**2 / (self.lag.rates**2 + omega**2))
        return float(damping)

    @property
    def drift_stiffness(self) -> Array:
        """Reciprocals s of the flexibilities of the drifts, N/m: a drift d stores at least the
        energy s d^2 / 2. In a chain they are the stiffnesses of the springs."""
        drifts = self.deformations
        flexibility = np.einsum("ij,jk,ik->i", drifts, np.linalg.inv(self.stiffness), drifts)
        return np.asarray(1.0 / flexibility)


@dataclass(frozen=True)
class MatrixVibration(FreeVibration):
    """Undamped vibration of a linear system. `mass` is the diagonal of the mass matrix.

    Attributes
    ----------
    mass_matrix, loaded_mass, stiffness_matrix : ndarray, shape (n, n)
        M + B (kg), M (kg) and K (N/m).
    influence : ndarray, shape (n,)
        As in `LinearSystem`.
    """

    mass_matrix: Array = None  # type: ignore[assignment]
    loaded_mass: Array = None  # type: ignore[assignment]
    stiffness_matrix: Array = None  # type: ignore[assignment]
    influence: Array = None  # type: ignore[assignment]

    @cached_property
    def modes(self) -> Modes:
        """All modes, one for each row with mass; rows without mass follow statically."""
        from scipy.linalg import eigh

        check_springs(self.stiffness, self.geometric)
        n = len(self.mass)
        moving, following = np.flatnonzero(self.mass), np.flatnonzero(self.mass == 0.0)
        motion = np.zeros((n, moving.size))
        motion[moving, np.arange(moving.size)] = 1.0
        if following.size:
            inner = self.stiffness_matrix[np.ix_(following, following)]
            motion[following] = -np.linalg.solve(
                inner, self.stiffness_matrix[np.ix_(following, moving)]
            )
        squared, shapes = eigh(
            motion.T @ self.stiffness_matrix @ motion, self.mass_matrix[np.ix_(moving, moving)]
        )
        if not squared[0] > 0.0:
            raise ModelError(
                "the first frequency is lost in rounding errors, because masses or stiffnesses "
                "differ by too many orders of magnitude; check their units"
            )
        shapes = motion @ shapes
        signs = np.where(shapes[self.roof] < 0.0, -1.0, 1.0)
        load = self.loaded_mass @ self.influence
        return Modes(
            np.sqrt(squared),
            shapes * signs,
            self.mass,
            roof=self.roof,
            load=load,
            moved_mass=float(self.influence @ load),
        )


def assemble_system(model: Model) -> tuple[LinearSystem, MatrixVibration]:
    """Return the matrices of a model that has matrices or flexural stories, and its vibration.

    Raises
    ------
    ModelError
        The matrices have no modes within the range of floats, or the damping has more modes.
    """
    matrices = model.matrices
    assert matrices is not None
    n = len(model.stories)
    own_mass = [story.mass for story in model.stories]
    own_mass += [story.rotary_inertia for story in model.stories if story.rotary_inertia]
    own_mass += [matrices.base_inertia[k] for k in matrices.base_rows]
    mass = np.asarray(matrices.mass) if len(matrices.mass) else np.diag(own_mass)
    flexure, drifts = None, np.eye(len(mass))
    cuts = np.zeros((n, len(mass)))
    cuts[:, :n] = np.triu(np.ones((n, n)))
    influence = np.array(matrices.influence or cuts[0])
    if 1 in matrices.base_rows:
        influence[-1] = 1.0
    if not model.rows:
        drifts[:n, :n] -= np.eye(n, k=-1)
    else:
        cuts *= influence
    if len(matrices.stiffness):
        stiffness = np.asarray(matrices.stiffness)
    else:
        stiffness, flexure = _stick(model, cuts)
        drifts[0] -= flexure.base[1]
    vibration = MatrixVibration(
        *(np.diagonal(mass), np.diagonal(stiffness), np.zeros(len(mass))),
        deformations=drifts,
        roof=n - 1,
        mass_matrix=mass,
        loaded_mass=mass,
        stiffness_matrix=stiffness,
        influence=influence,
    )
    damping = (
        np.asarray(matrices.damping)
        if len(matrices.damping)
        else _damping(model, mass, stiffness, vibration.modes)
    )
    for row, k in enumerate(reversed(matrices.base_rows), start=1):
        damping[-row, -row] += matrices.base_dashpots[k]
    inertia = mass
    if len(matrices.inertance):  # the damping does not depend on inerters
        inertia = mass + np.asarray(matrices.inertance)
        vibration = replace(vibration, mass=np.diagonal(inertia), mass_matrix=inertia)
    names = tuple(map(column_name, model.rows))
    has_lag = len(matrices.damping) or any(matrices.base_dashpots)
    lag = _lag(vibration.modes, inertia, stiffness, damping) if has_lag else None
    system = LinearSystem(
        *(inertia, mass, stiffness, damping),
        *(influence, drifts, cuts, np.vstack([cuts @ stiffness, stiffness[n:]])),
        *(names, flexure, lag),
    )
    return system, vibration


def system_of_springs(
    building: Any, inertance: Array, frame: LinearSystem | None = None
) -> tuple[LinearSystem, MatrixVibration]:
    """Return the matrices of a building of springs (`Building`) with inerters, kg, and its
    vibration.

    The matrices have the initial stiffnesses. The inerter of a story or link acts on its
    deformation, the inerter of an attachment on its motion relative to the ground. Damping and
    loaded masses do not include inerters. The matrices of the rows in `frame` replace the masses,
    the springs and the damping of the stories; its rows that are not floors follow the attachments.
    """
    n, count = building.floors, building.masses
    further = len(frame.mass) - n if frame else 0
    columns, square = ((0, 0), (0, further)), ((0, further), (0, further))
    deformations = np.pad(building.deformations, columns)
    motions = deformations.copy()
    motions[n:count] = np.eye(count, count + further)[n:]
    loaded = np.pad(np.diag(building.mass), square)
    # An attachment is above the stories below its floor.
    floors = np.arange(n)
    supports = [*floors + 1, *(item.floor for item in building.attachments)]
    cuts = np.pad((floors[:, None] < np.array(supports)).astype(float), columns)
    stiffness, damping = building.stiffness_matrix(), np.pad(building.damping_matrix(), square)
    forces = building.story_laws[rows.STIFFNESS, :, None] * deformations
    influence, names, flexure = np.ones(count), tuple[str, ...](), None
    inertia = (motions.T * inertance) @ motions
    if frame:
        own = [*floors, *range(count, count + further)]
        of_frame = np.ix_(own, own)
        loaded[of_frame] = frame.loaded_mass
        inertia[of_frame] += frame.mass - frame.loaded_mass
        stiffness = deformations[n:].T @ forces[n:]
        stiffness[of_frame] += frame.stiffness
        damping[of_frame] += frame.damping
        deformations[:n], forces[:n] = 0.0, 0.0
        deformations[:n, own], forces[:n, own] = frame.deformations[:n], frame.spring_forces[:n]
        # The ground moves an attachment as its floor.
        moved = [frame.influence[i.floor - 1] if i.floor else 1.0 for i in building.attachments]
        influence = np.insert(frame.influence, [n] * len(moved), moved)
        cuts *= influence
        names, flexure = frame.names, frame.flexure
        flexure = flexure and flexure.beside(building.attachments, n)
    inertia += loaded
    bare = building.vibration
    vibration = MatrixVibration(
        *(np.diagonal(inertia), bare.stiffness, bare.link, bare.geometric),
        deformations=deformations,
        roof=n - 1,
        mass_matrix=inertia,
        loaded_mass=loaded,
        stiffness_matrix=stiffness,
        influence=influence,
    )
    system = LinearSystem(
        *(inertia, loaded, stiffness, damping),
        *(influence, deformations, cuts, forces),
        *(names, flexure),
        lag=_lag(vibration.modes, inertia, stiffness, damping) if frame else None,
        inerters=inertance[:, None] * motions if inertance.any() else np.zeros((0, len(loaded))),
    )
    return system, vibration


_NO_LAG = 1e-12
"""Dimensionless. Maximum stiffness of a Maxwell element, relative to the stiffness of the highest
mode, that is a rounding error: the damping of its rows is proportional to their stiffness."""


def _lag(modes: Modes, mass: Array, stiffness: Array, damping: Array) -> Lag | None:
    """Return the deviation of rows without mass from the static positions."""
    from scipy.linalg import eigh

    following = np.flatnonzero(np.diagonal(mass) == 0.0)
    inner = np.ix_(following, following)
    if not damping[inner].any():
        return None
    times, vectors = eigh(damping[inner], stiffness[inner])
    damped = times > _NO_LAG * times[-1]
    shapes = np.zeros((len(mass), np.count_nonzero(damped)))
    shapes[following] = vectors[:, damped] / np.sqrt(times[damped])
    rates = 1.0 / times[damped]
    coupling = modes.shapes.T @ damping @ shapes
    coupled = rates * np.sum(coupling**2, axis=0) > _NO_LAG * modes.omega[-1] ** 2
    if not coupled.any():
        return None
    return Lag(shapes[:, coupled], rates[coupled], coupling[:, coupled])


def _damping(model: Model, mass: Array, stiffness: Array, modes: Modes) -> Array:
    """Return the Rayleigh or modal damping matrix of a model, N s/m."""
    damping, count = model.damping, modes.omega.size
    if isinstance(damping, RayleighRatio):
        if max(damping.modes) > count:
            raise ModelError(
                f"{model.name}: damping of mode {max(damping.modes)}, but only {count} rows have "
                "a mass"
            )
        damping = rayleigh(damping, *(float(modes.omega[mode - 1]) for mode in damping.modes))
    if isinstance(damping, RayleighCoefficients):
        return np.asarray(damping.mass * mass + damping.stiffness * stiffness)
    if isinstance(damping, ModalDamping):
        ratios = np.array(damping.ratios)[:count]
        ratios = np.concatenate([ratios, np.full(count - ratios.size, ratios[-1])])
        forces = mass @ modes.shapes
        return np.asarray((forces * (2.0 * ratios * modes.omega)) @ forces.T)
    return np.zeros_like(mass)


def _stick(model: Model, cuts: Array) -> tuple[Array, Flexure]:
    """Return the stiffness matrix of flexural stories at their rows, and their `Flexure`.

    The unknowns are the displacements of the floors, the rotations of the floors, and the rotation
    and displacement of the base, which are fixed if their springs are infinite. With phi = 12 EI /
    (GA h^2), a segment of the height h has the stiffness EI / (h^3 (1 + phi)) times the matrix
    below for the displacement and rotation of its lower and upper end.
    """
    assert model.matrices is not None
    n, base = len(model.stories), model.matrices.base
    # Columns of the displacement and rotation of each level; level 0 is the base.
    displacement = [2 * n + 1, *range(n)]
    rotation = [2 * n, *range(n, 2 * n)]
    matrix = np.zeros((2 * n + 2, 2 * n + 2))
    for i, story in enumerate(model.stories):
        assert story.flexural is not None and story.height is not None
        (bending, shear), h = story.flexural, story.height
        if math.isinf(bending):
            # The floors above and below rotate together: the only strain is the shear.
            rotation[i + 1] = rotation[i]
            strain = np.zeros(2 * n + 2)
            strain[[displacement[i], displacement[i + 1], rotation[i]]] = [1.0, -1.0, h]
            matrix += shear / h * np.outer(strain, strain)
            continue
        phi = 12.0 * bending / (shear * h**2)
        segment = np.array(
            [
                [12.0, 6.0 * h, -12.0, 6.0 * h],
                [6.0 * h, (4.0 + phi) * h**2, -6.0 * h, (2.0 - phi) * h**2],
                [-12.0, -6.0 * h, 12.0, -6.0 * h],
                [6.0 * h, (2.0 - phi) * h**2, -6.0 * h, (4.0 + phi) * h**2],
            ]
        )
        ends = [displacement[i], rotation[i], displacement[i + 1], rotation[i + 1]]
        matrix[np.ix_(ends, ends)] += bending / (h**3 * (1.0 + phi)) * segment
    # Infinite springs fix the base.
    free = [k for k, spring in zip((2 * n, 2 * n + 1), base, strict=True) if math.isfinite(spring)]
    matrix[free, free] += [spring for spring in base if math.isfinite(spring)]
    turning = [n + i for i, story in enumerate(model.stories) if story.rotary_inertia]
    kept = [*range(n), *turning, *(2 * n + k for k in model.matrices.base_rows)]
    others = [k for k in (*range(n, 2 * n), *free) if k in (*rotation, *free) and k not in kept]
    condensed = np.linalg.solve(matrix[np.ix_(others, others)], -matrix[np.ix_(others, kept)])
    stiffness = matrix[np.ix_(kept, kept)] + matrix[np.ix_(kept, others)] @ condensed
    stiffness = 0.5 * (stiffness + stiffness.T)
    motion = np.zeros((2 * n + 2, len(kept)))
    motion[others] = condensed
    motion[kept] = np.eye(len(kept))
    motion[n : 2 * n] = motion[rotation[1:]]
    return stiffness, _flexure(model, motion, cuts @ stiffness, stiffness)


def _flexure(model: Model, motion: Array, shears: Array, stiffness: Array) -> Flexure:
    """Return the matrices of moments, rotations and parts of drifts.

    `motion` contains the displacements and rotations of the floors, then rotation and displacement
    of the base. With the shear Q and the moment M at the top of a story, the bending part of its
    drift is Q h^3 / (3 EI) + M h^2 / (2 EI), and the shear part Q h / GA. A moment on a floor acts
    in all stories below it.
    """
    n, turning = len(model.stories), [i for i, s in enumerate(model.stories) if s.rotary_inertia]
    heights = np.array([story.height for story in model.stories], dtype=float)[:, None]
    flexural = np.array([story.flexural for story in model.stories], dtype=float)
    bending, shear = flexural[:, :1], flexural[:, 1:]
    levels = np.cumsum(heights)
    bottoms = levels - heights[:, 0]
    # Lever arms of the forces on the floors above the bottom of each story
    arms = np.maximum(levels[None, :] - bottoms[:, None], 0.0)
    on_floors = np.zeros((n, len(stiffness)))
    on_floors[turning] = stiffness[n : n + len(turning)]
    moment = arms @ stiffness[:n]
    moment += np.cumsum(on_floors[::-1], axis=0)[::-1]
    top = on_floors
    top[:-1] += moment[1:]
    return Flexure(
        moment=moment,
        rotation=motion[n : 2 * n],
        shear_drift=shears * heights / shear,
        bending_drift=shears * heights**3 / (3.0 * bending) + top * heights**2 / (2.0 * bending),
        base=motion[2 * n :],
        levels=np.pad(
            np.append(levels, np.ones(len(turning))), (0, len(stiffness) - n - len(turning))
        ),
    )


def damped_modes(
    modes: Modes, system: LinearSystem, damping: Array, braces: Braces
) -> tuple[Modes, Array, Array, Braces]:
    """Return the modes in modal coordinates (with unit mass matrix), the stiffness and
    damping matrices of these coordinates, and the dampers with braces, which rows without mass are,
    too, for `solve_complex_modes`."""
    count = modes.omega.size
    damping = modes.modal_damping(damping)
    braces = braces._replace(drifts=braces.drifts @ modes.shapes)
    if system.lag is not None:
        coupling, rates = system.lag.coupling, system.lag.rates
        damping = damping - coupling @ coupling.T
        braces = Braces(coupling.T, rates, np.ones(len(rates)))
    return (
        replace(modes, shapes=np.eye(count), mass=np.ones(count), load=None),
        np.diag(modes.omega**2),
        damping,
        braces,
    )
