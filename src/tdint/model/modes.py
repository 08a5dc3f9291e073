"""Undamped modes of a chain."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from tdint.arrays import Array, cached_property, immutable
from tdint.errors import ModelError
from tdint.number_parsing import pluralize
from tdint.tabular import Tabular

CLASSICAL = 1e-12
"""Limit of off-diagonal terms of the modal damping matrix relative to its diagonal; smaller terms
are rounding errors."""

_MAX_STORIES_OF_ALL_MODES = 100
"""Maximum number of stories for which all modes are computed when a single mode is requested."""

# Inverse iteration for the first mode: maximum number of iterations, and relative change of the
# frequency below which it has converged.
_MAX_ITERATIONS, _RELATIVE_CHANGE = 200, 1e-15


@immutable
class Modes(Tabular):
    """Modes by increasing frequency.

    Attributes
    ----------
    omega : ndarray, shape (n,)
        Circular frequencies, rad/s.
    shapes : ndarray, shape (n, n)
        Mode shapes as columns, phi^T M phi = 1, roof displacement not negative.
    mass : ndarray, shape (n,)
        Masses of the floors, kg.
    damping : ndarray, shape (n,), or None
        Damping ratios without the coupling of modes (`own_damping`), as `tdint.modes` returns them;
        None for the modes of a building.
    roof : int
        Index of the roof; attachments follow after it.
    load : ndarray, shape (n,), or None
        Inertia M r of the influence vector r of a model of matrices, kg; None for the masses.
    moved_mass : float
        r^T M r of such a model, kg.
    """

    omega: Array
    shapes: Array
    mass: Array
    damping: Array | None = None
    roof: int = -1
    load: Array | None = None
    moved_mass: float = 0.0

    def _headline(self) -> str:
        return f"of {pluralize(self.omega.size, 'floor')}, T1 {2.0 * math.pi / self.omega[0]:.4g} s"

    @property
    def period(self) -> Array:
        """Periods, s, shape (n,); infinite for a mode without stiffness."""
        with np.errstate(divide="ignore"):
            return np.asarray(2.0 * math.pi / self.omega)

    @property
    def frequency(self) -> Array:
        """Frequencies, Hz, shape (n,)."""
        return np.asarray(self.omega / (2.0 * math.pi))

    @property
    def _projection(self) -> Array:
        """Participation factors phi^T M r of the stored shapes; r is 1 for a building."""
        return np.asarray((self.mass if self.load is None else self.load) @ self.shapes)

    @property
    def participation(self) -> Array:
        """Participation factors phi^T M r / phi^T M phi, shape (n,).

        The factors apply to shapes phi with unit roof displacement. The influence vector r is 1
        for a building.
        """
        # The stored shapes have phi^T M phi = 1; a shape divided by the roof displacement has a
        # factor multiplied by the roof displacement.
        roof = self.shapes[self.roof]
        return np.asarray(self._projection * roof)

    @property
    def mass_ratio(self) -> Array:
        """Effective modal mass over the total mass, shape (n,)."""
        total = self.mass.sum() if self.load is None else self.moved_mass
        return np.asarray(np.square(self._projection) / total)

    def modal_damping(self, damping: Array) -> Array:
        """Return the modal damping matrix phi^T C phi, 1/s, shape (n, n).

        Parameters
        ----------
        damping : ndarray, shape (n, n)
            Damping matrix C, N s/m.
        """
        return np.asarray(self.shapes.T @ damping @ self.shapes)

    def own_damping(self, damping: Array) -> Array:
        """Return the damping ratio of each mode, shape (n,), and neglect the coupling of modes.

        The ratio of a mode is its term on the diagonal of the modal damping matrix, divided by
        twice its circular frequency. It can be negative, for example in modes above two modes with
        specified ratios of Rayleigh damping.

        Parameters
        ----------
        damping : ndarray, shape (n, n)
            Damping matrix, N s/m.
        """
        diagonal = np.diagonal(self.modal_damping(damping))
        # A small negative term is a rounding error of an undamped mode.
        is_rounding = diagonal >= -CLASSICAL * np.max(np.abs(diagonal))
        diagonal = np.where(is_rounding, np.maximum(diagonal, 0.0), diagonal)
        return self._ratios(diagonal)

    def normalized(self, norm: str) -> Array:
        """Return the normalized shapes as columns, shape (n, n).

        Parameters
        ----------
        norm : str
            `roof`: the roof displacement is 1; nan for modes with zero roof displacement.
            `participation`: the participation factor is 1; zeros for modes with a participation
            factor of 0.
        """
        # The stored shapes phi have phi^T M phi = 1, so that their participation factors are
        # phi^T M 1. A shape multiplied by its factor has the participation factor 1.
        if norm == "participation":
            return np.asarray(self.shapes * self._projection)
        roof = self.shapes[self.roof]
        return np.asarray(self.shapes / np.where(roof == 0.0, np.nan, roof))

    def damping_ratios(self, damping: Array) -> Array | None:
        """Return the damping ratio of each mode, shape (n,); None if the damping couples modes or a
        ratio is negative.

        The damping couples modes if the modal damping matrix has off-diagonal terms.

        Parameters
        ----------
        damping : ndarray, shape (n, n)
            Damping matrix, N s/m.
        """
        modal_damping = self.modal_damping(damping)
        # A negative term remains in `coupling`. It is accepted only if it is a rounding error.
        diagonal = np.maximum(np.diagonal(modal_damping), 0.0)
        coupling = np.abs(modal_damping - np.diag(diagonal))
        # Off-diagonal terms up to these values are rounding errors.
        rounding = CLASSICAL * np.sqrt(np.outer(diagonal, diagonal)) + CLASSICAL * np.max(diagonal)
        if np.any(coupling > rounding):
            return None
        return self._ratios(diagonal)

    def _ratios(self, modal_damping: Array) -> Array:
        """Return the damping ratios of a diagonal of the modal damping matrix (1/s); infinite, or
        nan without damping, for a mode without stiffness."""
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.asarray(modal_damping / (2.0 * self.omega))


class ComplexModes(NamedTuple):
    """Damped modes of a building, one for each undamped mode; nan for a mode without vibration
    (critical damping or more).

    Attributes
    ----------
    eigenvalues : ndarray of complex, shape (n,)
        Eigenvalues of the state matrix with a positive imaginary part, 1/s.
    """

    eigenvalues: NDArray[np.complex128]

    @property
    def natural_period(self) -> Array:
        """Periods 2 pi over the absolute value, s, shape (n,)."""
        return np.asarray(2.0 * math.pi / np.abs(self.eigenvalues))

    @property
    def damping(self) -> Array:
        """Damping ratios, the negative real part divided by the absolute value, shape (n,)."""
        return np.asarray(-self.eigenvalues.real / np.abs(self.eigenvalues))

    @property
    def damped_period(self) -> Array:
        """Periods of the damped vibration, 2 pi over the imaginary part, s, shape (n,)."""
        return np.asarray(2.0 * math.pi / self.eigenvalues.imag)


class Braces(NamedTuple):
    """Linear dampers in series with a brace.

    Attributes
    ----------
    drifts : ndarray, shape (b, n)
        Rows of B, which give the drifts of the dampers.
    stiffness : ndarray, shape (b,)
        Stiffnesses k of the braces, N/m.
    coefficient : ndarray, shape (b,)
        Coefficients c of the dampers, N s/m.
    """

    drifts: Array
    stiffness: Array
    coefficient: Array


def state_matrix(mass: Array, stiffness: Array, damping: Array, braces: Braces) -> Array:
    """Return the matrix of the state of displacements u, velocities v and forces f of braces:

        M v' = -K u - C v - B^T f,   f' = k (B v - f / c)

    Parameters
    ----------
    mass : ndarray, shape (n,) or (n, n)
        Diagonal of the mass matrix, or the matrix, kg.
    stiffness, damping : ndarray, shape (n, n)
        Matrices K (N/m) and C (N s/m).
    """
    drifts, brace, damper = braces
    n, b = len(mass), brace.size
    state = np.zeros((2 * n + b, 2 * n + b))
    state[:n, n : 2 * n] = np.eye(n)
    forces = np.hstack([stiffness, damping, drifts.T])
    state[n : 2 * n] = -(
        forces / mass[:, None] if mass.ndim == 1 else np.linalg.solve(mass, forces)
    )
    state[2 * n :, n : 2 * n] = brace[:, None] * drifts
    state[2 * n :, 2 * n :] = -np.diag(brace / damper)
    return state


def solve_complex_modes(
    modes: Modes, stiffness: Array, damping: Array, braces: Braces
) -> ComplexModes:
    """Compute the damped modes of a building from its `state_matrix`.

    Each of the undamped `modes` receives the damped mode with the most similar shape.
    """
    from scipy.linalg import eig

    mass, n = modes.mass, modes.mass.size
    eigenvalues, vectors = eig(state_matrix(mass, stiffness, damping, braces))
    # Of each conjugate pair, the eigenvalue with the positive imaginary part. Rounding errors of a
    # double real eigenvalue may be imaginary.
    vibrates = eigenvalues.imag > _VIBRATES * np.abs(eigenvalues)
    eigenvalues, shapes = eigenvalues[vibrates], vectors[:n, vibrates]
    similarity = np.abs((modes.shapes.T * mass) @ shapes)
    similarity /= np.sqrt(mass @ np.abs(shapes) ** 2)
    result = np.full(n, complex(math.nan, math.nan))
    for _ in range(eigenvalues.size):
        mode, damped = np.unravel_index(np.argmax(similarity), similarity.shape)
        result[mode] = eigenvalues[damped]
        similarity[mode] = similarity[:, damped] = -1.0
    return ComplexModes(result)


_VIBRATES = 1e-7
"""Minimum imaginary part of the eigenvalue of a vibration, divided by its absolute value. Rounding
errors of a double eigenvalue are of the order of the square root of the machine precision, 1e-8."""


def solve_modes(
    mass: Array, stiffness: Array, deformations: Array | None = None, roof: int = -1
) -> Modes:
    """Compute the modes of masses with springs.

    The matrix M^(-1/2) K M^(-1/2) is L^T L with L = diag(k)^(1/2) B M^(-1/2), the spring
    stiffnesses k and the deformations B u of the springs for the displacements u. The singular
    values of L are the circular frequencies. Their computation without the product L^T L keeps the
    relative accuracy of the lowest frequency in tall buildings.

    Parameters
    ----------
    mass : ndarray, shape (n,)
        Masses, kg.
    stiffness : ndarray, shape (springs,)
        Spring stiffnesses, N/m.
    deformations : ndarray, shape (springs, n), optional
        Matrix B; by default that of a chain (`chain_deformations`).
    roof : int
        Index of the roof in the array of masses.

    Raises
    ------
    ModelError
        A spring stiffness is not positive (P-delta exceeds the stiffness of a story).
    """
    check_springs(stiffness)
    if deformations is None:
        deformations = chain_deformations(np.ones(mass.shape[-1]))
    root_mass = np.sqrt(mass)
    # The singular values are in decreasing order, and are therefore reversed.
    _, omega, right_vectors = np.linalg.svd(
        np.sqrt(stiffness)[..., None] * deformations / root_mass[..., None, :]
    )
    shapes = np.swapaxes(right_vectors[..., ::-1, :] / root_mass[..., None, :], -1, -2)
    signs = np.where(shapes[..., roof, :] < 0.0, -1.0, 1.0)
    return Modes(omega[..., ::-1], shapes * signs[..., None, :], mass, roof=roof)


def chain_deformations(link: Array) -> Array:
    """Return the matrix of the deformations of the springs between neighboring floors, shape
    (n, n): spring i connects floor i to the floor below, or to the ground if element i of `link` is
    0 instead of 1."""
    return np.asarray(np.eye(link.size) - np.diag(link[1:], -1))


@immutable
class FreeVibration:
    """Undamped vibration of a chain, computed at the first request and cached.

    Attributes
    ----------
    mass, stiffness, link : ndarray, shape (n,)
        Masses (kg), spring stiffnesses (N/m), and links: 1 for a spring to the floor below, 0 for a
        spring to the ground.
    geometric : ndarray, shape (n,), optional
        P-delta part of the spring stiffnesses, N/m, for error messages.
    deformations : ndarray, shape (springs, n), optional
        Matrix of the deformations of all springs of a building with attachments or links
        (`tdint.model.topology.incidence`) or of a linear system, which replaces `link`.
    roof : int
        Index of the roof in the array of masses.
    """

    mass: Array
    stiffness: Array
    link: Array
    geometric: Array | None = None
    deformations: Array | None = None
    roof: int = -1

    @cached_property
    def modes(self) -> Modes:
        """All modes; raises the errors of `solve_modes`."""
        check_springs(self.stiffness, self.geometric)
        deformations = self.deformations
        if deformations is None:
            # All samples have the same links.
            deformations = chain_deformations(self.link.reshape(-1, self.link.shape[-1])[0])
        return solve_modes(self.mass, self.stiffness, deformations, self.roof)

    def frequency(self, number: int) -> Any:
        """Return the circular frequency of a mode, counted from 1, rad/s; of many samples, an
        array.

        In tall buildings only this mode is computed.

        Raises
        ------
        ModelError
            A spring stiffness is not positive.
        """
        n = self.mass.shape[-1]
        if self.deformations is not None or n <= _MAX_STORIES_OF_ALL_MODES:
            omega = self.modes.omega[..., number - 1]
            return omega if omega.ndim else float(omega)
        check_springs(self.stiffness, self.geometric)
        return chain_frequency(np.sqrt(self.stiffness), np.sqrt(self.mass), self.link, number)

    @cached_property
    def first(self) -> tuple[float, Array]:
        """Circular frequency (rad/s) and shape (phi^T M phi = 1) of the first mode.

        Each story must be on top of the previous story (links 1). The inverse iteration solves
        K u = M phi by sums over the stories, without a matrix, and has full precision.

        Raises
        ------
        ModelError
            A spring stiffness is not positive.
        """
        if self.deformations is not None:
            return float(self.modes.omega[0]), self.modes.shapes[:, 0]
        check_springs(self.stiffness, self.geometric)
        if not self.stiffness.all():
            # The floors above a story without stiffness move as a rigid body.
            moves = np.cumsum(self.stiffness == 0.0) > 0.0
            return 0.0, np.where(moves, 1.0 / math.sqrt(float(np.sum(self.mass[moves]))), 0.0)
        shape, omega = np.cumsum(1.0 / self.stiffness), 0.0
        for _ in range(_MAX_ITERATIONS):
            force = self.mass * shape
            shear = np.add.accumulate(force[::-1])[::-1]
            displacement = np.add.accumulate(shear / self.stiffness)
            modal_mass = float(np.add.reduce(self.mass * displacement**2))
            if not 0.0 < modal_mass < math.inf:
                raise ModelError(
                    "the first mode cannot be computed: masses or stiffnesses differ by too many "
                    "orders of magnitude; check their units"
                )
            # The new frequency follows from the Rayleigh quotient u^T K u / u^T M u of the
            # displacement u, with K u = force.
            previous_omega, omega = omega, math.sqrt(float(displacement @ force) / modal_mass)
            shape = displacement / math.sqrt(modal_mass)
            if abs(omega - previous_omega) <= _RELATIVE_CHANGE * omega:
                break
        return omega, shape


def chain_frequency(root_spring: Array, root_mass: Array, link: Array, number: int) -> float:
    """Compute the circular frequency of a chain with a number counted from the lowest (1), rad/s.

    The frequencies are the singular values of a bidiagonal matrix L with L^T L = M^(-1/2) K
    M^(-1/2). The singular values and their negatives are the eigenvalues of a symmetric tridiagonal
    matrix with a zero diagonal and an off-diagonal that contains the entries of L: diagonal and
    subdiagonal entries alternate (Golub and Kahan 1965). Bisection with the Sturm sequence of the
    matrix keeps the relative accuracy of the lowest frequencies, because L is not squared (Demmel
    and Kahan 1990).

    The roots are square roots of the spring stiffnesses (N/m) and masses (kg); `link` is 1 for a
    spring to the floor below, 0 to the ground.
    """
    from scipy.linalg.lapack import dstebz

    n = root_mass.size
    off_diagonal = np.zeros(2 * n - 1)
    off_diagonal[::2] = root_spring / root_mass
    off_diagonal[1::2] = (root_spring * link)[1:] / root_mass[:-1]
    # The eigenvalues are sorted, so the n negative eigenvalues are first. LAPACK counts
    # from 1.
    index = n + number
    # scipy.linalg.eigh_tridiagonal calls the same function, but requires six times the time. The
    # arguments 2 and "E" select an eigenvalue by its index in the complete matrix; the interval
    # from 0.0 to 1.0 is not used.
    _, values, *_, failed = dstebz(
        np.zeros(2 * n), off_diagonal, 2, 0.0, 1.0, index, index, _TOLERANCE, "E"
    )
    assert failed == 0
    return float(values[0])


_TOLERANCE = float(np.finfo(float).tiny)
"""Absolute tolerance of the bisection, so small that the bisection continues to the last bit."""


def check_springs(stiffness: Array, geometric: Array | None = None) -> None:
    """Raise ModelError if P-delta makes the stiffness of a story zero or negative.

    `stiffness` contains the spring stiffnesses with P-delta, N/m. `geometric` is the p-delta part
    of the stiffnesses, N/m (negative), which the message then states.
    """
    # A story without stiffness is free, but not unstable, unless P-delta acts on the story.
    is_unstable = stiffness < 0.0
    if geometric is not None:
        is_unstable |= (stiffness <= 0.0) & (geometric < 0.0)
    if not is_unstable.any():
        return
    # The message names only the first unstable story.
    unstable = np.unravel_index(np.argmax(is_unstable), is_unstable.shape)
    values = ""
    if geometric is not None:
        weight_over_height = -geometric[unstable]
        initial_stiffness = stiffness[unstable] + weight_over_height
        values = (
            f" (weight over height {weight_over_height:.4g} N/m, initial stiffness "
            f"{initial_stiffness:.4g} N/m)"
        )
    raise ModelError(
        f"story {unstable[-1] + 1}: P-delta exceeds the initial stiffness{values}, so that the "
        "building is unstable; check the units of mass, height and stiffness, increase the "
        "stiffness of the story, or use `p_delta: false`"
    )
