"""Buildings as arrays: the tables that kernels read, the damping, and properties of the linear
system."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from tdint.arrays import Array, cached_property, immutable
from tdint.errors import ModelError
from tdint.kernels import layout as rows
from tdint.kernels.building.compilable import FULL, PLAIN, Variant
from tdint.kernels.laws import LAWS as NUMBERED_LAWS
from tdint.kernels.laws import LINEAR
from tdint.kernels.laws.compiled import compiled_laws
from tdint.kernels.laws.fracture import FRACTURING
from tdint.kernels.laws.law import DriftLaw
from tdint.kernels.stories.impact import HERTZ, RESTITUTION
from tdint.model.damping import (
    add_damping,
    falling_message,
    falling_spring,
    has_tangent_damping,
)
from tdint.model.definition import Attachment, Force, Link, Model
from tdint.model.modes import (
    Braces,
    ComplexModes,
    FreeVibration,
    Modes,
    chain_deformations,
    solve_complex_modes,
)
from tdint.model.story import Story, column_name
from tdint.model.story_laws import CODES, LAWS, Law, of_samples
from tdint.model.topology import GROUND, NO_SPRING, extended, incidence, springs_of, store_ends
from tdint.number_parsing import abbreviate
from tdint.units import STANDARD_GRAVITY

if TYPE_CHECKING:
    from tdint.model.linear_system import LinearSystem


_BOUND_ITERATIONS = 5  # iterations of the upper bound of the frequencies (`Building.fastest`)
_MAX_LISTED_STORIES = 5  # maximum number of stories named in a message
_BEYOND_YIELD = 1.1  # drift, in yield drifts, of the measurement of an undeclared stiffness
_SMALL_ORDINATE = 1e-9  # added to the ordinates of a mode with maximum 1, to avoid zeros


@immutable
class Building:
    """A chain of n stories, or n independent oscillators, as arrays.

    Attributes
    ----------
    linear_terms, law_parameters : ndarray, shapes (LINEAR_TERM_ROWS, n + 1) and (rows, n + 1)
        Tables of numbers, one row for each quantity of `tdint.kernels.layout` and one column for
        each story; the last column is zero. A building of many samples (`assemble`) has a further
        axis for the samples between both, also in `modal` and before the stories in other arrays.
    modal : ndarray, shape (modes, n + 1)
        Rows w of the modal damping C = sum of w w^T; no rows without modal damping.
    heights : ndarray, shape (n,)
        Story heights for drift ratios, m; nan for stories without a height and for isolators.
    yield_drift : ndarray, shape (n,)
        Drift at first yield, m; nan for stories that do not yield.
    vibration : FreeVibration
        The undamped vibration of the initial stiffness.
    isolators : tuple of int
        Indices of the isolator stories, counted from 0.
    element_labels : tuple of str
        Story and name of each element of the stories with several elements.
    attachments, links : tuple
        Attachments, with columns after the columns of the stories, and links, with columns that
        have no mass and are after the columns of the attachments.
    floors : int
        Number of floors without attachments. Rotations of floors with rotary inertia have the
        columns after the floors.
    stiffens : bool
        True if a story can become stiffer than initially.
    system : LinearSystem | None
        Matrices of a linear model, which replace the springs and dampers of the stories.
    """

    linear_terms: Array
    law_parameters: Array
    modal: Array
    heights: Array
    yield_drift: Array
    vibration: FreeVibration
    isolators: tuple[int, ...] = ()
    element_labels: tuple[str, ...] = ()
    attachments: tuple[Attachment, ...] = ()
    links: tuple[Link, ...] = ()
    floors: int = 0
    stiffens: bool = False
    system: LinearSystem | None = None

    @property
    def height_contributions(self) -> Array:
        """Height that each story contributes to the building, m, shape (floors,).

        It is zero for isolators and nan for stories without a height.
        """
        contributions = self.heights[: self.floors].copy()
        contributions[list(self.isolators)] = 0.0
        return contributions

    @property
    def stories(self) -> int:
        """Number of stories n, with attachments and links."""
        return int(self.linear_terms.shape[-1]) - 1

    @property
    def branched(self) -> bool:
        """True if the building has attachments or links."""
        return bool(self.attachments or self.links)

    @property
    def inertial(self) -> bool:
        """True if the compiled loop integrates the building with inerters."""
        return len(self.linear_terms) > rows.LINEAR_TERM_ROWS

    @property
    def uses_matrices(self) -> bool:
        """True if the loop of matrices integrates the building (`runs.linear_loop`)."""
        return self.system is not None and not self.inertial

    @property
    def masses(self) -> int:
        """Number of masses: of floors and attachments, and of further rows of matrices."""
        if not self.branched:
            return self.stories
        if self.system is not None:
            return len(self.system.mass)
        return self.floors + len(self.attachments)

    @property
    def mass(self) -> Array:
        """Masses of the floors and attachments, kg, shape (masses,)."""
        return self.linear_terms[rows.MASS, ..., : self.masses]

    @property
    def device_columns(self) -> slice:
        """Columns of the attachments and links."""
        return slice(self.floors, self.floors + len(self.attachments) + len(self.links))

    @property
    def device_signs(self) -> Array:
        """Signs of the deformations of attachments and links: -1 for a link that ends below its
        start, otherwise 1."""
        return np.array([*(1.0 for _ in self.attachments), *(link.sign for link in self.links)])

    @cached_property
    def deformations(self) -> Array:
        """Matrix of the deformations of all springs, shape (n, masses)."""
        if self.system is not None:
            return self.system.deformations
        if not self.branched:
            return chain_deformations(self.linear_terms[rows.LINK, :-1])
        return incidence(self.linear_terms, self.masses)

    def initial_values(self, floors: Sequence[float], attachments: Sequence[float]) -> Array:
        """Return the initial displacements or velocities of all columns: attachments without a
        value (nan) start with the motion of their floors, further rows with their static motion."""
        values = extended(self.linear_terms, floors, attachments)
        if self.system is not None:
            start = self.floors + len(self.attachments)
            further, stiffness = slice(start, self.masses), self.system.stiffness[start:]
            values[further] = -np.linalg.solve(
                stiffness[:, further], stiffness[:, :start] @ values[:start]
            )
        return values

    def drifts(self, floors: Array) -> Array:
        """Return the deformations of all springs from the displacements of the floors, or their
        derivatives, shape (..., n).

        `floors` contains values relative to the ground: springs on the ground keep the values of
        the floor. Columns for the links, which the state of a run has, and for the ground may
        follow.
        """
        n = self.stories
        if self.system is not None or floors.shape[-1] < n:
            return np.asarray(floors[..., : self.masses] @ self.deformations.T)
        link, base = self.linear_terms[[rows.LINK, rows.BASE], :-1]
        # Columns of the lower floors; any column for the ground.
        lower = base.astype(np.intp) if self.branched else np.arange(n) - 1
        return np.asarray(floors[..., :n] - link * floors[..., lower])

    @property
    def initial_stiffness(self) -> Array:
        """Initial stiffness of the stories, P-delta included, N/m, shape (n,)."""
        geometric = self.linear_terms[rows.GEOMETRIC, ..., :-1]
        return np.asarray(self.story_laws[rows.STIFFNESS] + geometric)

    def rest_distance(self, law_state: Array) -> tuple[Array, Array]:
        """Return the distance of each drift from its position of rest, where the story has no
        force, m, and the present stiffness of the story, N/m, never zero (1 without stiffness).

        A slope of the law that is not positive or exceeds the initial stiffness does not lead to
        the position of rest; the initial stiffness replaces it.
        """
        drift, force, slope = law_state[[rows.DRIFT, rows.FORCE, rows.SLOPE], : self.stories]
        initial_stiffness = self.initial_stiffness
        is_usable = (slope > 0.0) & (slope < initial_stiffness)
        stiffness = np.where(is_usable, slope, initial_stiffness)
        # Force of the law plus P-delta. A story without stiffness is at rest at zero drift. A link
        # without a spring has no force at any deformation.
        total_force = force + self.linear_terms[rows.GEOMETRIC, :-1] * drift
        has_stiffness = stiffness != 0.0
        divisor = np.where(has_stiffness, stiffness, 1.0)
        without_stiffness = np.where(total_force != 0.0, drift, 0.0)
        return np.where(has_stiffness, total_force / divisor, without_stiffness), divisor

    @property
    def story_laws(self) -> Array:
        """Columns of `law_parameters` of the stories, without the elements: views of the table."""
        return np.asarray(self.law_parameters[..., : self.stories])

    @cached_property
    def law_codes(self) -> set[float]:
        """Numbers of all laws: of the stories with a single law, and of the elements of the other
        stories.
        """
        codes = np.delete(self.law_parameters[rows.CODE], self.stories, axis=-1)
        # Without np.unique, which imports the masked arrays of NumPy.
        return {code for code in set(codes.ravel().tolist()) if code > rows.ELEMENTS}

    @cached_property
    def has_stops(self) -> bool:
        """True if a story, element, attachment or link has a law with stops."""
        return any(NUMBERED_LAWS[code].stops is not DriftLaw.stops for code in self.law_codes)

    @property
    def elements(self) -> int:
        """Number of elements of all stories with several elements."""
        return int(self.law_parameters.shape[-1]) - self.stories - 1

    @cached_property
    def linear(self) -> bool:
        """True if every story has a linear law and no story has a power-law dashpot or a damper
        with a brace."""
        is_damped = self.power_damped | self.braced | self.tangent_damped
        return not is_damped and self.has_linear_laws

    @cached_property
    def rests_at_zero(self) -> bool:
        """True if all drifts are zero at rest without forces: springs and dashpots are linear, and
        the building has a first period."""
        terms = self.linear_terms[:, :-1]
        has_brace = terms[rows.BRACE] != 0.0
        is_linear = np.where(has_brace, terms[rows.BRACED_EXPONENT] == 1.0, True)
        has_relief = has_brace & (terms[rows.BRACED_RELIEF] > 0.0)
        return bool(
            self.has_linear_laws
            and not (self.power_damped or self.tangent_damped)
            and np.all(is_linear & ~has_relief)
            and math.isfinite(self.first_period)
        )

    @property
    def has_linear_laws(self) -> bool:
        """True if all stories and elements have linear laws."""
        return self.law_codes <= {LINEAR}

    @cached_property
    def power_damped(self) -> bool:
        """True if any story has a power-law dashpot without a brace."""
        return bool(np.any(self.linear_terms[rows.POWER_DAMPER, :-1] != 0.0))

    @cached_property
    def braced(self) -> bool:
        """True if any story has a damper with a brace."""
        return bool(np.any(self.linear_terms[rows.BRACE, :-1] != 0.0))

    @cached_property
    def tangent_damped(self) -> bool:
        """True if any story has Rayleigh damping with the tangent stiffness."""
        return bool(np.any(self.linear_terms[rows.TANGENT_DAMPING, :-1] != 0.0))

    @property
    def impact_damped(self) -> bool:
        """True if a contact of Hertz has damping."""
        damped = self.law_parameters[rows.CODE, : self.stories] == HERTZ
        if not np.any(damped):  # the table can have fewer rows
            return False
        damped &= self.law_parameters[RESTITUTION, : self.stories] != 1.0
        return bool(np.any(self.linear_terms[rows.TANGENT_DAMPING, :-1][damped] != 0.0))

    @property
    def has_damper_state(self) -> bool:
        """True if a damper has state variables: with a brace or tangent damping."""
        return self.braced or self.tangent_damped

    @property
    def story_dampers(self) -> Array:
        """Coefficients of the dampers of the stories in the initial state, N s/m."""
        tangent = (
            self.linear_terms[rows.TANGENT_DAMPING, :-1]
            * self.law_parameters[rows.STIFFNESS, : self.stories]
        )
        return np.asarray(self.linear_terms[rows.STORY_DAMPER, :-1] + tangent)

    @property
    def has_power_law_dampers(self) -> bool:
        """True if the force of a damper, with or without a brace, is not proportional to its
        velocity."""
        terms = self.linear_terms[:, :-1]
        is_power = (terms[rows.POWER_DAMPER] != 0.0) & (terms[rows.POWER] != 0.0)
        return bool(
            np.any(is_power | (terms[rows.BRACE] != 0.0) & (terms[rows.BRACED_EXPONENT] != 1.0))
        )

    @cached_property
    def damped_by_devices(self) -> bool:
        """True if any story has a dashpot, with or without a brace."""
        coefficients = self.linear_terms[rows.DASHPOT, :-1]
        return self.power_damped or self.braced or bool(np.any(coefficients != 0.0))

    def damper_force(self, force: Array) -> Array:
        """Return forces along the dampers from their forces in the direction of the drift, N."""
        if not self.damped_by_devices:
            return force
        factor = self.linear_terms[rows.DAMPER_FACTOR, ..., :-1]
        return np.asarray(np.divide(force, factor, out=np.array(force), where=factor != 1.0))

    def peak_damper_force(self, peaks: Array) -> Array:
        """Return the peak forces along the dampers from the peaks of a run, N."""
        force = self.device_force(peaks[..., rows.PEAK_DRIFT_RATE, :])
        if self.braced:
            force = force + peaks[..., rows.PEAK_BRACE_FORCE, :]
        return self.damper_force(force)

    def device_force(self, rate: Array) -> Array:
        """Return the forces (N) of dashpots without a brace at drift rates (m/s), shape (..., n),
        in the direction of the drift.

        The force at the drift rate v is (c + c_p (v^2 + v_0^2)^p) v with the rows DASHPOT (c),
        POWER_DAMPER (c_p), THRESHOLD (v_0^2) and POWER (p) of the linear terms.
        """
        if not self.damped_by_devices:
            return np.zeros_like(rate)
        terms = self.linear_terms[..., :-1]
        squared_rate = rate**2 + terms[rows.THRESHOLD]
        # The exponent may be negative, for which the power of zero is infinite. The force of a
        # story at rest is zero.
        is_moving = (squared_rate > 0.0) & (terms[rows.POWER_DAMPER] != 0.0)
        power_of_rate = np.power(
            squared_rate, terms[rows.POWER], out=np.zeros_like(squared_rate), where=is_moving
        )
        return np.asarray((terms[rows.DASHPOT] + terms[rows.POWER_DAMPER] * power_of_rate) * rate)

    @cached_property
    def piecewise_linear(self) -> bool:
        """True if every story has a piecewise linear law."""
        return not any(NUMBERED_LAWS[code].curved for code in self.law_codes)

    @cached_property
    def kinked(self) -> bool:
        """True if any story has a law with a discontinuous tangent."""
        return any(NUMBERED_LAWS[code].kinked for code in self.law_codes)

    @cached_property
    def can_fracture(self) -> bool:
        """True if a law loses its force at a drift (`tdint.kernels.laws.fracture`)."""
        return any(code % 1.0 == FRACTURING for code in self.law_codes)

    @cached_property
    def concave(self) -> bool:
        """True if every story has a law that is concave from its position of rest on."""
        return all(NUMBERED_LAWS[code].concave for code in self.law_codes)

    @cached_property
    def curved_hysteresis(self) -> bool:
        """True if any story has a curved law with branches, that is, a curved hysteretic law."""
        laws = [NUMBERED_LAWS[code] for code in self.law_codes]
        return any(law.curved and law.kinked for law in laws)

    @cached_property
    def resistance_limits(self) -> tuple[Array, Array]:
        """Maximum and minimum drift of each story with resistance, m, shape (n,); infinite without
        a limit."""
        stories = range(self.stories)
        return (
            np.array([self._resistance_limit(i, 1.0) for i in stories]).T,
            np.array([-self._resistance_limit(i, -1.0) for i in stories]).T,
        )

    def _resistance_limit(self, i: int, side: float) -> Any:
        """Return the maximum drift on a side, m, at which a story has resistance.

        The last lines of its law, or of all its elements, and P-delta have no force together at
        that point. It is infinite if no line falls, or if a law has no last line.
        """
        table, geometric = self.law_parameters, self.linear_terms[rows.GEOMETRIC, ..., i]
        if table.ndim > 2:  # of many samples, without elements
            law = NUMBERED_LAWS[float(table[rows.CODE, 0, i])]
            columns = zip(*table[rows.STIFFNESS :, :, i].tolist(), strict=True)
            lines = (law.last_line(k, values, side) for k, _, _, *values in columns)
            return np.array(list(map(_limit_of_lines, zip(lines), geometric.tolist())))
        has_elements = table[rows.CODE, i] <= rows.ELEMENTS
        first = int(table[rows.FIRST_ELEMENT, i]) if has_elements else i
        end = int(table[rows.END_ELEMENT, i]) if has_elements else i + 1
        springs = table[:, first:end].T.tolist()
        return _limit_of_lines(
            (
                NUMBERED_LAWS[code].last_line(stiffness, values, side)
                for code, stiffness, _, _, *values in springs
            ),
            float(geometric),
        )

    @cached_property
    def fastest(self) -> Any:
        """Upper bound of the circular frequencies of the initial stiffness, rad/s.

        The bound exceeds the highest frequency by 1 to 2 %. Let K be the stiffness matrix with the
        absolute values of its entries; it has the same frequencies. For any vector x with positive
        entries, the largest eigenvalue of M^-1 K is at most the maximum of (M^-1 K x)_i / x_i over
        the floors i (Collatz 1942). The bound decreases as x approaches the mode: x is multiplied
        repeatedly by M^-1 K (power iteration).
        """
        if self.system is not None:
            return float(self.modes().omega[-1])
        if self.branched:
            return self.frequency_bound(self.initial_stiffness)
        # Row i of K has the entry `below` for the floor below and `above` for the floor above. The
        # last spring is above the roof and has no stiffness.
        stiffness = np.abs(self.initial_stiffness)
        above = np.zeros_like(stiffness)
        above[..., :-1] = (self.linear_terms[rows.LINK, ..., :-1] * stiffness)[..., 1:]
        shape, bound = np.ones(self.stories), np.inf
        for _ in range(_BOUND_ITERATIONS):
            product = (stiffness + above) * shape
            product[..., 1:] += above[..., :-1] * shape[..., :-1]
            product[..., :-1] += above[..., :-1] * shape[..., 1:]
            product /= self.mass
            bound = np.minimum(bound, np.max(product / shape, axis=-1))
            if not np.all(bound):  # no story has stiffness
                break
            # The small number keeps all entries of x positive, as the bound requires.
            shape = product / np.max(product, axis=-1, keepdims=True) + _SMALL_ORDINATE
        return np.sqrt(bound)

    def frequency_bound(self, stiffness: Array) -> float:
        """Return an upper bound of the circular frequencies with these stiffnesses of the stories
        (N/m), rad/s.

        It is the square root of the maximum row sum of |M^-1 K| with the mass matrix M and the
        stiffness matrix K.
        """
        if self.inertial and self.system is not None:
            matrix = self._spring_matrix(np.abs(stiffness))
            rates = np.linalg.solve(self.system.mass, matrix)
            return math.sqrt(np.abs(rates).sum(axis=1).max())
        if self.branched:
            ends = np.abs(self.deformations)
            row_sums = ends.T @ (np.abs(stiffness) * ends.sum(axis=1))
            return math.sqrt((row_sums / self.mass).max())
        stiffness, link = np.abs(stiffness), self.linear_terms[rows.LINK, :-1]
        # With the stiffnesses k and the links c, row i of the stiffness matrix has the diagonal
        # entry k[i] + c[i + 1] k[i + 1] and the off-diagonal entries c[i] k[i] and
        # c[i + 1] k[i + 1], without signs.
        row_sums = stiffness + link * stiffness
        row_sums[:-1] += 2.0 * link[1:] * stiffness[1:]
        return math.sqrt((row_sums / self.mass).max())

    def stiffness_matrix(self) -> Array:
        """Return the initial stiffness matrix, N/m, shape (n, n)."""
        if self.system is not None:
            return self.system.stiffness
        return self._spring_matrix(self.initial_stiffness)

    def _spring_matrix(self, springs: Array) -> Array:
        """Return the matrix of springs or dampers, shape (masses, masses)."""
        return np.asarray((self.deformations.T * springs) @ self.deformations)

    def damping_matrix(self) -> Array:
        """Return the damping matrix without power-law dashpots, N s/m, shape (n, n): the sum of the
        dampers in the stories, the dampers from the floors to the ground, and modal damping."""
        if self.system is not None:
            return self.system.damping
        story_matrix = self._spring_matrix(self.story_dampers)
        modal = self.modal[:, : self.masses]
        return (
            story_matrix
            + np.diag(self.linear_terms[rows.FLOOR_DAMPER, : self.masses])
            + modal.T @ modal
        )

    def first_mode(self) -> tuple[float, float]:
        """Return the circular frequency (rad/s) and the damping ratio of the first mode.

        Power-law dashpots are omitted. The damping ratio is computed from the diagonal of the modal
        damping matrix.
        """
        return self._first_mode

    @property
    def first_period(self) -> float:
        """Period of the first mode, s; infinite if a story has no stiffness."""
        return period(self.first_mode()[0])

    @cached_property
    def _first_mode(self) -> tuple[float, float]:
        """Result of `first_mode`: omega, and phi^T C phi / (2 omega) for a shape phi with the modal
        mass 1 and the `damping_matrix` C."""
        omega, shape = self.vibration.first
        if self.system is not None:
            return omega, self.system.modal_damping(self.modes(), 0) / (2.0 * omega)
        drift = self.drifts(shape)
        masses = self.masses
        modal_damping = np.add.reduce(self.story_dampers * drift**2)
        modal_damping += np.add.reduce(self.linear_terms[rows.FLOOR_DAMPER, :masses] * shape**2)
        if len(self.modal):
            modal_damping += np.add.reduce((self.modal[:, :masses] @ shape) ** 2)
        if omega:
            return omega, float(modal_damping / (2.0 * omega))
        return omega, math.inf if modal_damping else 0.0

    def modes(self) -> Modes:
        """Return the undamped modes of the initial stiffness, computed at the first call."""
        return self.vibration.modes

    def complex_modes(self) -> ComplexModes:
        """Return the damped modes of the initial stiffness with all linear dampers and their
        braces; power-law dampers are omitted.
        """
        damping = self.linear_damping()
        if self.system is not None:
            from tdint.model.linear_system import damped_modes

            return solve_complex_modes(*damped_modes(self.modes(), self.system, *damping))
        return solve_complex_modes(self.modes(), self.stiffness_matrix(), *damping)

    def linear_damping(self) -> tuple[Array, Braces]:
        """Return the damping matrix with all linear dampers without a brace, N s/m, and the linear
        dampers with a brace; power-law dampers are omitted."""
        terms = self.linear_terms[:, :-1]
        is_linear = (terms[rows.BRACE] == 0.0) & (terms[rows.POWER] == 0.0)
        dampers = np.where(is_linear, terms[rows.POWER_DAMPER], 0.0)
        braced = np.flatnonzero((terms[rows.BRACE] != 0.0) & (terms[rows.BRACED_EXPONENT] == 1.0))
        return (
            self.damping_matrix() + self._spring_matrix(dampers),
            Braces(
                self.deformations[braced],
                terms[rows.BRACE, braced],
                terms[rows.BRACED_DAMPER, braced],
            ),
        )

    @cached_property
    def stiffest_modes(self) -> Modes:
        """Undamped modes that limit the time step of conditionally stable methods.

        The braces of dampers are springs: the dampers are locked. Elements of stories with several
        elements have the largest stiffness of their laws, for example after the contact of a stop.
        """
        stiffness = self.initial_stiffness
        if self.elements:
            stiffness = stiffness + self._additional_stiffness()
        if self.braced:
            stiffness = stiffness + self.linear_terms[rows.BRACE, :-1]
        if not (self.braced or self.elements):
            return self.modes()
        locked = replace(self.vibration, stiffness=stiffness, geometric=None)
        if self.branched:
            locked = replace(
                locked,
                stiffness=_without_links(self.linear_terms, stiffness),
                deformations=_without_links(self.linear_terms, self.deformations, stiffness),
            )
        return locked.modes

    def _additional_stiffness(self) -> Array:
        """Return the sum over the elements of each story of their largest stiffness minus their
        initial stiffness, N/m."""
        table, result = self.law_parameters, np.zeros(self.stories)
        for i in np.flatnonzero(self.story_laws[rows.CODE] <= rows.ELEMENTS).tolist():
            for column in range(int(table[rows.FIRST_ELEMENT, i]), int(table[rows.END_ELEMENT, i])):
                numbers = table[:, column].tolist()
                law, stiffness = NUMBERED_LAWS[numbers[rows.CODE]], numbers[rows.STIFFNESS]
                if law.largest_stiffness is not None:
                    values = numbers[rows.FIRST_PARAMETER :]
                    result[i] += law.largest_stiffness(stiffness, values) - stiffness
        return result


def _limit_of_lines(lines: Iterable[tuple[float, float] | None], geometric: float) -> float:
    """Return the drift where the last lines of the springs of a story and P-delta (`geometric`,
    N/m) have no force together, m; infinite if no line falls, or if a law has no last line."""
    force, slope, has_falling_line = 0.0, geometric, False
    for line in lines:
        if line is None:
            return math.inf
        force += line[0]
        slope += line[1]
        has_falling_line |= line[1] < 0.0
    return force / -slope if has_falling_line and slope < 0.0 else math.inf


def period(omega: float) -> float:
    """Return the period of a circular frequency (rad/s), s; infinite for 0."""
    return 2.0 * math.pi / omega if omega else math.inf


def _without_links(linear_terms: Array, values: Array, stiffness: Array | None = None) -> Array:
    """Return the values of the springs without the links that have no spring (first axis), by their
    stiffness; default: the values."""
    count = linear_terms.shape[1] - 1
    is_link = linear_terms[rows.UPPER_FLOOR, :count] != np.arange(count)
    return np.asarray(values[~is_link | ((values if stiffness is None else stiffness) != 0.0)])


def over_stories(numbers: Iterable[Any]) -> Array:
    """Return one value per story, which can be arrays over samples, as an array with the stories as
    the last axis."""
    items = list(numbers)
    if any(isinstance(item, np.ndarray) for item in items):
        return np.stack(np.broadcast_arrays(*items), axis=-1)
    return np.array(items, float)


def assemble(model: Model, samples: tuple[int, ...] = ()) -> Building:
    """Assemble the arrays of the building of a model, including its damping.

    Parameters
    ----------
    samples : tuple of int
        Number of the samples of a model with arrays over samples (`Model.changed`): a chain of
        stories with a single law, without isolators, fractures and tangent damping.

    Raises
    ------
    ModelError
        P-delta exceeds the stiffness of a story, or a law that can fall has damping with the
        tangent stiffness; or the model has two directions, and no direction is selected.
    """
    if model.across is not None:
        raise ModelError(
            f"{model.name}: the model has two directions, which run, campaign, ida, fragility and "
            "profiles combine; for other results, write a file with one direction"
        )
    if model.matrices is not None:
        return _assemble_linear(model)
    building = _assemble_springs(model, samples)
    return _with_matrices(building, model) if model.has_inertance else building


def _with_matrices(building: Building, model: Model, frame: LinearSystem | None = None) -> Building:
    """Return a building of springs with its matrices (`linear_system.system_of_springs`), and with
    the rows of the inerters for the compiled loop if it is not linear."""
    # Imported here, because few models have inerters.
    from tdint.model.linear_system import system_of_springs

    inertance = np.zeros(len(building.deformations))
    springs = [spring.inertance for _, spring in model.springs]
    inertance[: len(springs)] = springs
    system, vibration = system_of_springs(building, inertance, frame)
    linear_terms = building.linear_terms
    if not model.has_linear_springs:
        attached = slice(building.floors, building.masses)
        linear_terms = _with_inertance(linear_terms, system.mass, inertance, attached)
    return replace(building, linear_terms=linear_terms, system=system, vibration=vibration)


def _with_inertance(
    linear_terms: Array, inertia: Array, inertance: Array, attached: slice
) -> Array:
    """Return the table of linear terms with the rows of inerters, from the mass matrix with
    inertance and the inertances of all springs; `attached` are the attachments."""
    count = len(inertia)
    table = np.zeros((rows.MASS_FACTORS + count, linear_terms.shape[1]))
    table[: rows.LINEAR_TERM_ROWS] = linear_terms
    table[rows.STORY_INERTANCE, : len(inertance)] = inertance
    table[rows.STORY_INERTANCE, attached] = 0.0
    table[rows.FLOOR_INERTANCE, attached] = inertance[attached]
    table[rows.INVERSE_MASS, :-1] = 1.0
    table[rows.UPPER_FLOOR, -1] = 1.0  # the kernels use the ends of the springs, also in a chain
    factors = table[rows.MASS_FACTORS :, :count]
    factors[:] = inertia
    for i in range(count):
        factors[i + 1 :, i] /= factors[i, i]
        factors[i + 1 :, i + 1 :] -= np.outer(factors[i + 1 :, i], factors[i, i + 1 :])
    return table


def _assemble_springs(model: Model, samples: tuple[int, ...], further: int = 0) -> Building:
    """Assemble the arrays of a building of springs, without its inerters, with further columns."""
    stories, ends = springs_of(model)
    stories, ends = (*stories, *(NO_SPRING,) * further), [*ends, *((0, GROUND),) * further]
    n, floors = len(stories), len(model.stories)
    if has_tangent_damping(model.damping):
        for i, story in enumerate(stories):
            if spring := falling_spring(story):
                raise ModelError(f"{model.name}: {falling_message(spring.law.name, i + 1)}")
    # The last column is a fictitious story above the roof and remains zero.
    linear_terms = np.zeros((rows.LINEAR_TERM_ROWS, *samples, n + 1))
    masses = floors + len(model.attachments)  # links have no mass
    linear_terms[rows.MASS, ..., :n] = over_stories(story.mass for story in stories)
    # An inerter replaces the mass of an attachment.
    has_mass = linear_terms[rows.MASS] > 0.0
    linear_terms[rows.INVERSE_MASS, has_mass] = 1.0 / linear_terms[rows.MASS, has_mass]
    # DASHPOT contains only the dashpots of the model. STORY_DAMPER is the sum of all linear dampers
    # of a story: `add_damping` adds Rayleigh damping to STORY_DAMPER.
    # The force and the drift rate of an inclined dashpot are multiplied by its factor.
    dashpots = over_stories(story.dashpot * story.damper_factor**2 for story in stories)
    linear_terms[rows.STORY_DAMPER, ..., :n] = linear_terms[rows.DASHPOT, ..., :n] = dashpots
    for i, story in enumerate(stories):
        linear_terms[rows.DAMPER_FACTOR, ..., i] = story.damper_factor
        if damper := story.power_dashpot:
            row_numbers = partial(dashpot_rows, story.damper_factor)
            numbers = *damper[:4], *(damper.relief or (None, None))
            table = np.array(of_samples(row_numbers, *numbers))
            dashpot = table[..., 0].reshape(-1, table.shape[-2])[0].astype(int)
            linear_terms[dashpot, ..., i] = table[..., 1].T.reshape(-1, *linear_terms.shape[1:-1])
        linear_terms[rows.STIFFENING, ..., i] = rows.UNLIMITED * _can_stiffen(story)
    for i in range(floors, n):
        own_law = stories[i].law
        end_masses = [stories[end].mass for end in ends[i] if end != GROUND]
        mass = 1.0 / sum(1.0 / end_mass if end_mass else math.inf for end_mass in end_masses)
        linear_terms[rows.TANGENT_DAMPING, i] = LAWS[own_law.name].tangent_damping(
            own_law.parameters, mass
        )
    store_ends(np.moveaxis(linear_terms, -1, 1), ends)
    heights = over_stories(
        math.nan if story.drift_height is None else story.drift_height for story in stories
    )
    if model.has_p_delta:
        linear_terms[rows.GEOMETRIC, ..., :floors] = -weight_over_height(model)
    law_parameters, yield_drift = _law_table(stories, samples)
    # P-delta (the row GEOMETRIC, negative) reduces the stiffness of the vibration.
    vibration = FreeVibration(
        linear_terms[rows.MASS, ..., :floors],
        law_parameters[rows.STIFFNESS, ..., :floors] + linear_terms[rows.GEOMETRIC, ..., :floors],
        linear_terms[rows.LINK, ..., :floors],
        linear_terms[rows.GEOMETRIC, ..., :floors],
    )
    isolators = tuple(i for i, story in enumerate(stories) if story.isolator)
    # `modal` contains the damping between several floors, such as modal damping. Each row w adds
    # w w^T to the damping matrix. It is a property of the stories: with the modes of a building
    # with attachments, the mode numbers and the damping of the stories would change.
    stiffness = law_parameters[rows.STIFFNESS, ..., :n]
    # Only the columns of the stories are changed in the view of the table.
    damping_rows = add_damping(
        linear_terms[..., : floors + 1], stiffness[..., :floors], model, vibration
    )
    modal = np.zeros((*damping_rows.shape[:-1], n + 1))
    modal[..., : floors + 1] = damping_rows
    if n > floors:
        vibration = FreeVibration(
            linear_terms[rows.MASS, :masses],
            _without_links(linear_terms, stiffness + linear_terms[rows.GEOMETRIC, :n]),
            linear_terms[rows.LINK, :masses],
            _without_links(linear_terms, linear_terms[rows.GEOMETRIC, :n], stiffness),
            _without_links(linear_terms, incidence(linear_terms, masses), stiffness),
            floors - 1,
        )
    labels = tuple(
        f"story_{number}_{column_name(element.name)}"
        for number, story in enumerate(model.stories, start=1)
        for element in story.elements
    )
    return Building(
        *(linear_terms, law_parameters, modal, heights, yield_drift, vibration, isolators, labels),
        attachments=model.attachments,
        links=model.links,
        floors=floors,
        stiffens=any(map(stiffens, stories)),
    )


def _assemble_linear(model: Model) -> Building:
    """Assemble the arrays of a model that has matrices or flexural stories. The stiffnesses of the
    stories are the values of `LinearSystem.drift_stiffness`."""
    # Imported here, because few models have matrices.
    from tdint.model.linear_system import assemble_system

    system, vibration = assemble_system(replace(model, attachments=(), links=()))
    if model.devices:
        # Springs with the stiffness of the drifts take the place of the stories.
        stories = tuple(
            replace(story, stiffness=float(stiffness), flexural=None)
            for story, stiffness in zip(model.stories, system.drift_stiffness, strict=False)
        )
        springs = replace(model, stories=stories, matrices=None, damping=None)
        further = len(system.mass) - len(stories)
        return _with_matrices(_assemble_springs(springs, (), further), springs, system)
    n, floors = len(system.mass), len(model.stories)
    linear_terms = np.zeros((rows.LINEAR_TERM_ROWS, n + 1))
    linear_terms[rows.MASS, :floors] = np.diagonal(system.loaded_mass)[:floors]
    law_parameters = _linear_laws(system.drift_stiffness)
    heights = np.full(n, math.nan)  # of rotations
    heights[:floors] = [story.height or math.nan for story in model.stories]
    return Building(
        *(linear_terms, law_parameters, np.zeros((0, n + 1)), heights, np.full(n, math.nan)),
        vibration,
        floors=floors,
        system=system,
    )


def law_columns(stories: Sequence[Story]) -> list[range]:
    """Return the columns of the springs of each story in the table of the laws.

    The springs are `Story.springs`: a story with a single law has the column of the story,
    and the elements of the other stories follow after the column of zeros.
    """
    columns, end = [], len(stories) + 1
    for i, story in enumerate(stories):
        columns.append(range(end, end + len(story.elements)) if story.elements else range(i, i + 1))
        end += len(story.elements)
    return columns


def _law_table(stories: Sequence[Story], samples: tuple[int, ...]) -> tuple[Array, Array]:
    """Return the table of the laws of all stories and elements, and the yield drifts of stories.

    The yield drift of a story with elements is the yield drift of the element that yields first.
    """
    columns_of_stories = law_columns(stories)
    # The law with the most parameters determines the number of rows. A story with elements has the
    # columns of its elements in the rows of two parameters.
    counts = [len(spring.law.parameters) for story in stories for spring in story.springs]
    has_elements = any(story.elements for story in stories)
    row_count = max(*counts, rows.END_ELEMENT + 1 - rows.FIRST_PARAMETER if has_elements else 0)
    column_count = len(stories) + 1 + sum(len(story.elements) for story in stories)
    table = np.zeros((rows.FIRST_PARAMETER + row_count, *samples, column_count))
    yield_drift = np.empty((*samples, len(stories)))
    for i, (story, columns) in enumerate(zip(stories, columns_of_stories, strict=True)):
        if story.elements:
            is_curved = any(LAWS[element.law.name].curved for element in story.elements)
            table[rows.CODE, i] = rows.CURVED_ELEMENTS if is_curved else rows.ELEMENTS
            table[rows.STIFFNESS, i] = story.stiffness
            table[rows.FIRST_ELEMENT, i], table[rows.END_ELEMENT, i] = columns.start, columns.stop
        for column, spring in zip(columns, story.springs, strict=True):
            numbers = law_column(spring.law, spring.stiffness)
            table[: len(numbers), ..., column] = over_stories(numbers).T.reshape(
                len(numbers), *(-1 for _ in samples)
            )
        yield_drift[..., i] = first_yield_drift(story)
    return table, yield_drift


def _linear_laws(stiffness: Array) -> Array:
    """Return the table of the laws of linear stories with these stiffnesses, N/m."""
    table = np.zeros((rows.FIRST_PARAMETER, stiffness.size + 1))
    table[rows.CODE, :-1] = LINEAR
    table[rows.STIFFNESS, :-1] = stiffness
    return table


def law_column(law: Law, stiffness: float) -> list[float]:
    """Return the column of the table of the laws for a law with an initial stiffness, N/m."""
    code = CODES[law.name] + (FRACTURING if any(law.fracture) else 0.0)
    return [code, stiffness, *law.fracture, *law.parameters]


def element_yield_drifts(story: Story) -> list[float]:
    """Return the yield drift of each spring of a story, m; nan for a law that does not yield."""
    return [
        of_samples(
            partial(_yield_drift, LAWS[spring.law.name]),
            spring.stiffness,
            *spring.law.parameters,
        )
        for spring in story.springs
    ]


def _yield_drift(law: DriftLaw, numbers: Sequence[float]) -> float:
    """Return the yield drift of a law, m, from its stiffness and parameters."""
    stiffness, *parameters = numbers
    return law.yield_drift(stiffness, parameters)


def first_yield_drift(story: Story) -> float:
    """Return the smallest yield drift of the springs of a story, m; nan if no spring yields."""
    drifts = element_yield_drifts(story)
    if len(drifts) == 1:
        return drifts[0]
    return min((drift for drift in drifts if drift == drift), default=math.nan)


def yield_strength(story: Story) -> float:
    """Return the sum of the yield forces of the springs of a story, N; nan if no spring yields."""
    drifts = element_yield_drifts(story)
    forces = [drift * spring.stiffness for drift, spring in zip(drifts, story.springs, strict=True)]
    known = [force for force in forces if force == force]
    return sum(known) if known else math.nan


def stiffens(story: Story) -> bool:
    """Return True if a story can become stiffer than initially."""
    return any(
        np.any(of_samples(LAWS[spring.law.name].stiffens, *spring.law.parameters))
        for spring in story.springs
    )


def _can_stiffen(story: Story) -> Any:
    """Return True if the peak shear of a story can occur at a smaller drift than its peak drift.

    This requires a law that stiffens and is not symmetric, or an element that stiffens in addition
    to an element with another law that is not elastic.
    """
    springs = [(LAWS[spring.law.name], spring.law.parameters) for spring in story.springs]
    if len(springs) == 1 and not any(story.law.fracture):
        (law, parameters), *_ = springs
        if law.stiffens is DriftLaw.stiffens:  # the default: False for all parameters
            return False
        return of_samples(
            lambda values: law.stiffens(values) and not law.symmetric(values), *parameters
        )
    symmetric = all(
        law.symmetric(parameters) or (CODES[law.name] == LINEAR and len(springs) > 1)
        for law, parameters in springs
    )
    # A law that fractures loses its force before the peak drift.
    return any(any(spring.law.fracture) for spring in story.springs) or (
        stiffens(story) and not symmetric
    )


def weight_over_height(model: Model) -> Array:
    """Return the weight above each story divided by the height of the story, N/m, shape (n,).

    P-delta reduces the stiffness of the story by this value. It is zero in stories without P-delta.
    """
    mass = over_stories(story.mass for story in model.stories)
    # An attachment loads its floor; it has no separate P-delta.
    for attachment in model.attachments:
        if attachment.floor:  # not on the ground
            mass[..., attachment.floor - 1] += attachment.spring.mass
    heights = over_stories(
        (math.nan if story.height is None else story.height) if has_p_delta else math.inf
        for story, has_p_delta in zip(model.stories, model.p_delta_stories, strict=True)
    )
    above = np.cumsum(mass[..., ::-1], axis=-1)[..., ::-1]
    return np.asarray(STANDARD_GRAVITY * above / heights)


def unstable_after_yield(model: Model) -> tuple[str, ...]:
    """Return a message with the stories that are unstable after yield because of P-delta.

    The tuple is empty if no story is unstable, and contains one message otherwise.

    P-delta reduces the stiffness of a story by the weight above it divided by its height. The
    story is unstable if this value exceeds the post-yield stiffness of its law.
    """
    if not model.has_p_delta:
        return ()
    # In SI units, write stiffnesses in MN/m, which gives short numbers for buildings.
    unit_name, unit_value = model.output_units.unit("N/m")
    unit_name, unit_value = ("MN/m", 1e6) if unit_name == "N/m" else (unit_name, unit_value)
    messages = []
    for i, (story, stiffness_reduction) in enumerate(
        zip(model.stories, weight_over_height(model), strict=True), start=1
    ):
        after_yield = stiffness_after_yield(story)
        if stiffness_reduction > max(after_yield, 0.0):
            messages.append(
                f"story {i}: {stiffness_reduction / unit_value:.4g} and "
                f"{after_yield / unit_value:.4g}"
            )
    if not messages:
        return ()
    return (
        "P-delta reduces the stiffness after yield below zero, so that a story that yields may "
        f"collapse; weight over height and stiffness after yield, {unit_name}: "
        f"{abbreviate(messages, _MAX_LISTED_STORIES)}",
    )


def stiffness_after_yield(story: Story) -> float:
    """Return the stiffness of a story after yield and before softening, N/m.

    It is infinite for a law that does not yield. The stiffness of a story with elements is the sum
    after all elements that yield have yielded; the other elements keep their initial stiffness.
    Before the last element yields, the story can be stiffer.
    """
    yields, total = False, 0.0
    for spring, yield_drift in zip(story.springs, element_yield_drifts(story), strict=True):
        law = LAWS[spring.law.name]
        after_yield = spring.stiffness
        if law.stiffness_after_yield is not None:
            after_yield = law.stiffness_after_yield(spring.stiffness, spring.law.parameters)
            yields = True
        elif yield_drift == yield_drift:
            # Imported here, because only laws without a declaration are measured.
            from tdint.model.law_checks import tangent_at

            column = np.array(law_column(spring.law, spring.stiffness))
            after_yield = tangent_at(law, column, _BEYOND_YIELD * yield_drift)
            yields = True
        total += after_yield
    return total if yields else math.inf


def oscillators(omega: Array, damping: Array) -> Building:
    """Assemble independent linear oscillators of unit mass.

    The equation of motion of an oscillator is u'' + 2 xi omega u' + omega^2 u = p with the
    displacement u, the damping ratio xi, the circular frequency omega and the load p.
    """
    omega, damping = np.broadcast_arrays(np.asarray(omega, float), np.asarray(damping, float))
    k = omega.size
    linear_terms = np.zeros((rows.LINEAR_TERM_ROWS, k + 1))
    linear_terms[rows.MASS, :k] = 1.0
    linear_terms[rows.INVERSE_MASS, :k] = 1.0
    linear_terms[rows.STORY_DAMPER, :k] = 2.0 * damping * omega
    law_parameters = _linear_laws(omega**2)
    # The links remain 0, because each oscillator is supported by the ground. Oscillators have no
    # height and do not yield.
    unknown = np.full(k, math.nan)
    vibration = FreeVibration(
        linear_terms[rows.MASS, :k], law_parameters[rows.STIFFNESS, :k], linear_terms[rows.LINK, :k]
    )
    damping_rows = np.zeros((0, k + 1))
    return Building(
        *(linear_terms, law_parameters, damping_rows, unknown, unknown, vibration), floors=k
    )


def force_table(forces: Sequence[Force]) -> NDArray[np.float64]:
    """Return a table with a row for each harmonic force.

    The first columns are the floor (counted from 0), the amplitudes of cosine and sine (N), and the
    circular frequency (rad/s).
    """
    table = np.zeros((len(forces), rows.FORCE_COLUMNS))
    for row, force in zip(table, forces, strict=True):
        row[: rows.POINTS] = force.floor - 1, force.cosine, force.sine, force.omega
    return table


def variant(building: Building, forces: Array | None = None) -> Variant:
    """Return the form of the kernels for a building, and its laws.

    Parameters
    ----------
    forces : ndarray, optional
        Table of `force_table`. Default: no forces.
    """
    has_optional_features = (
        len(building.modal) > 0
        or (forces is not None and len(forces) > 0)
        or building.power_damped
        or building.has_damper_state
        or building.elements > 0
        or building.branched
        or building.can_fracture
        or building.inertial
    )
    # The last column of the table of the laws counts as a linear law.
    result = Variant(
        FULL if has_optional_features else PLAIN,
        compiled_laws(sorted({float(LINEAR), *building.law_codes})),
    )
    # Return the same instance for equal variants, so that kernels recognize the last variant.
    return _VARIANTS.setdefault(result, result)


_VARIANTS: dict[Variant, Variant] = {}
"""Results of `variant` in this process, each as key and value."""


def dashpot_rows(factor: float, numbers: Sequence[Any]) -> list[tuple[int, float]]:
    """Return rows of the linear terms with their values for a power-law dashpot with the numbers of
    a `PowerDashpot`, the last two from its `Relief`.

    The force of a dashpot without a brace at the drift rate v is c v (v^2 + v0^2)^POWER. For |v|
    much larger than v0 it is c |v|^exponent, so POWER = (exponent - 1) / 2. With the `factor` of an
    inclined dashpot, the coefficient of the story is factor^(1 + exponent) times c, v0 is divided
    by the factor, and the stiffness of the brace is multiplied by the square of the factor. The
    relief force is multiplied by the factor.
    """
    coefficient, exponent, threshold, brace, relief_force, relief_ratio = numbers
    if factor != 1.0:
        coefficient *= factor ** (1.0 + exponent)
        threshold /= factor
    if brace is None:
        return [
            (rows.POWER_DAMPER, coefficient),
            (rows.POWER, 0.5 * (exponent - 1.0)),
            (rows.THRESHOLD, threshold**2),
        ]
    # A brace that the force at 1 m/s deforms by less than 1e-12 m is rigid. A stiffer one would
    # have only rounding errors.
    result = [
        (rows.BRACE, min(brace * factor**2, 1e12 * coefficient)),
        (rows.BRACED_DAMPER, coefficient),
        (rows.BRACED_EXPONENT, exponent),
        (rows.BRACED_THRESHOLD, threshold**2),
    ]
    if relief_force is not None:
        result.append((rows.BRACED_RELIEF, relief_force * factor))
        result.append((rows.BRACED_RELIEF_RATIO, relief_ratio))
    return result
