"""Undamped modes of a chain."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from tdint.arrays import Array, cached_property
from tdint.errors import ModelError
from tdint.tabular import Tabular
from tdint.written_numbers import how_many

CLASSICAL = 1e-12
"""Couplings of the modal damping matrix below this, over its diagonal, are rounding."""

_FEW = 100
"""Stories up to which all modes are solved for where one is asked for."""

_MOST_ITERATIONS, _CONVERGED = 200, 1e-15  # of the inverse iteration


@dataclass(frozen=True, repr=False)
class Modes(Tabular):
    """Modes by rising frequency.

    Attributes
    ----------
    omega : ndarray, shape (n,)
        Circular frequencies, rad/s.
    shapes : ndarray, shape (n, n)
        Mode shapes as columns, phi^T M phi = 1, roof displacement not negative.
    mass : ndarray, shape (n,)
        Masses of the floors, kg.
    damping : ndarray, shape (n,), or None
        Damping ratios, where they were asked for (`tdint.modes`) and the damping couples no modes.
    """

    omega: Array
    shapes: Array
    mass: Array
    damping: Array | None = None

    def _headline(self) -> str:
        return f"of {how_many(self.omega.size, 'floor')}, T1 {2.0 * math.pi / self.omega[0]:.4g} s"

    @property
    def participation(self) -> Array:
        """Participation factors phi^T M 1 / phi^T M phi for shapes with unit roof displacement,
        shape (n,)."""
        roof = self.shapes[-1]
        return np.asarray(self.mass @ self.shapes * roof)

    @property
    def mass_ratio(self) -> Array:
        """Effective modal mass over the total mass, shape (n,)."""
        return np.asarray(np.square(self.mass @ self.shapes) / self.mass.sum())

    def modal_damping(self, damping: Array) -> Array:
        """phi^T C phi of a damping matrix C (N s/m, shape (n, n)), 1/s, shape (n, n)."""
        return np.asarray(self.shapes.T @ damping @ self.shapes)

    def own_damping(self, damping: Array) -> Array:
        """Damping ratio of each mode as if it moved alone under a damping matrix (N s/m, shape (n,
        n)), shape (n,)."""
        return np.asarray(
            np.maximum(np.diagonal(self.modal_damping(damping)), 0.0) / (2.0 * self.omega)
        )

    def normalized(self, norm: str) -> Array:
        """The shapes as columns, shape (n, n): 1 at the `roof`, or `participation`: with a
        participation factor of 1.

        A mode whose roof stands still has no shape by its roof: nan.
        """
        if norm == "participation":
            return np.asarray(self.shapes * (self.mass @ self.shapes))
        roof = self.shapes[-1]
        return np.asarray(self.shapes / np.where(roof == 0.0, np.nan, roof))

    def damping_ratios(self, damping: Array) -> Array | None:
        """Damping ratio of each mode under a damping matrix (N s/m, shape (n, n)); None if it
        couples the modes."""
        modal = self.modal_damping(damping)
        diagonal = np.maximum(np.diagonal(modal), 0.0)
        coupling = np.abs(modal - np.diag(diagonal))
        if np.any(
            coupling
            > CLASSICAL * np.sqrt(np.outer(diagonal, diagonal)) + CLASSICAL * np.max(diagonal)
        ):
            return None
        return diagonal / (2.0 * self.omega)


def solve_modes(mass: Array, stiffness: Array, link: Array) -> Modes:
    """Modes of a chain with springs `stiffness` between neighbours.

    The tridiagonal matrix is L L^T of a bidiagonal L, whose singular values are the frequencies:
    the lowest one keeps its relative accuracy in tall buildings.

    Raises
    ------
    ModelError
        A spring that is not positive (P-delta beyond the story's stiffness).
    """
    _check_springs(stiffness)
    root_mass = np.sqrt(mass)
    root_spring = np.sqrt(stiffness)
    # Springs over floors: d = B u, K = B^T diag(k) B; with y = M^(1/2) u the matrix is L^T L.
    lower = np.diag(root_spring / root_mass) - np.diag(
        (root_spring * link)[1:] / root_mass[:-1], -1
    )
    _, omega, right = np.linalg.svd(lower)
    omega = omega[::-1]
    shapes = (right[::-1] / root_mass).T
    signs = np.where(shapes[-1] < 0.0, -1.0, 1.0)
    return Modes(omega, shapes * signs, mass)


@dataclass(frozen=True)
class FreeVibration:
    """The undamped vibration of a chain, solved when it is first asked for and then kept.

    Attributes
    ----------
    mass, stiffness, link : ndarray, shape (n,)
        Masses (kg), springs to the floor below (N/m), and 1 for those that stand on it, 0 for those
        on the ground.
    geometric : ndarray, shape (n,), optional
        The part of the springs that P-delta has, N/m, for what an error says.
    """

    mass: Array
    stiffness: Array
    link: Array
    geometric: Array | None = None

    @cached_property
    def modes(self) -> Modes:
        """All modes; errors are those of `solve_modes`."""
        _check_springs(self.stiffness, self.geometric)
        return solve_modes(self.mass, self.stiffness, self.link)

    def frequency(self, number: int) -> float:
        """Circular frequency of one mode, counted from 1, rad/s, without solving for the others.

        Raises
        ------
        ModelError
            A spring that is not positive.
        """
        if self.mass.size <= _FEW:
            return float(self.modes.omega[number - 1])
        _check_springs(self.stiffness, self.geometric)
        return singular_value(np.sqrt(self.stiffness), np.sqrt(self.mass), self.link, number)

    @cached_property
    def first(self) -> tuple[float, Array]:
        """Circular frequency (rad/s) and shape (phi^T M phi = 1) of the first mode; all stories
        stand on each other.

        By inverse iteration with the flexibility of the chain, two sums over the stories each time:
        all digits, and no matrix, however tall the building is.

        Raises
        ------
        ModelError
            A spring that is not positive.
        """
        _check_springs(self.stiffness, self.geometric)
        shape, omega = np.cumsum(1.0 / self.stiffness), 0.0
        for _ in range(_MOST_ITERATIONS):
            force = self.mass * shape
            shear = np.cumsum(force[::-1])[::-1]
            displacement = np.cumsum(shear / self.stiffness)  # K displacement = force
            square = float(np.sum(self.mass * displacement**2))
            if not 0.0 < square < math.inf:
                raise ModelError(
                    "there is no first mode: masses and stiffnesses are too far from each other"
                )
            before, omega = omega, math.sqrt(float(displacement @ force) / square)
            shape = displacement / math.sqrt(square)
            if abs(omega - before) <= _CONVERGED * omega:
                break
        return omega, shape


def singular_value(root_spring: Array, root_mass: Array, link: Array, number: int) -> float:
    """The circular frequency `number` of a chain, counted from the lowest, rad/s.

    The frequencies are the singular values of the bidiagonal matrix of `solve_modes`, and with
    their negatives the eigenvalues of the symmetric tridiagonal matrix with a zero diagonal and the
    entries of that matrix, in turn, beside it (Golub and Kahan 1965). Bisection with Sturm's
    sequence of this matrix, which is not squared, keeps the relative accuracy of the lowest ones
    (Demmel and Kahan 1990).
    """
    from scipy.linalg.lapack import dstebz

    n = root_mass.size
    beside = np.zeros(2 * n - 1)
    beside[::2] = root_spring / root_mass
    beside[1::2] = (root_spring * link)[1:] / root_mass[:-1]
    place = n + number - 1
    # What scipy.linalg.eigh_tridiagonal calls, in a sixth of its time. 2 and "E": one by its place,
    # among all.
    _, values, *_, failed = dstebz(
        np.zeros(2 * n), beside, 2, 0.0, 1.0, place + 1, place + 1, _SMALLEST, "E"
    )
    assert failed == 0
    return float(values[0])


_SMALLEST = float(np.finfo(float).tiny)
"""Tolerance of the bisection: it goes on to the last bit."""


def _check_springs(stiffness: Array, geometric: Array | None = None) -> None:
    weak = np.flatnonzero(stiffness <= 0.0)
    if not weak.size:
        return
    i, both = int(weak[0]), ""
    if geometric is not None:
        both = f", {-geometric[i]:.4g} beside {stiffness[i] - geometric[i]:.4g} N/m"
    raise ModelError(
        f"story {i + 1}: P-delta exceeds the initial stiffness{both}; the building cannot stand: "
        "are the units of mass, height and stiffness right? Else give the story more stiffness, or "
        "p_delta: false"
    )
