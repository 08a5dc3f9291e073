"""What a time-integration method is: a compiled step, a row of coefficients, and a citation."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from tdint.kernels import layout as rows

if TYPE_CHECKING:
    from tdint.kernels.compiling import Kernel
    from tdint.model.building import Building


@dataclass(frozen=True)
class Parameter:
    """A parameter of a method: its default and the range it may have (both ends allowed unless said
    otherwise).

    A default may be a function of the values of the parameters before it.
    """

    name: str
    default: float | Callable[..., float]
    low: float
    high: float
    low_allowed: bool = True
    high_allowed: bool = True

    def allows(self, value: float) -> bool:
        """Whether `value` lies in the range."""
        above = value >= self.low if self.low_allowed else value > self.low
        below = value <= self.high if self.high_allowed else value < self.high
        return math.isfinite(value) and above and below

    @property
    def range(self) -> str:
        """The range as text, round brackets for ends that are not allowed: [0, 1)."""
        left = "[" if self.low_allowed else "("
        right = "]" if self.high_allowed else ")"
        return f"{left}{self.low:g}, {self.high:g}{right}"


@dataclass(frozen=True)
class Family:
    """Methods that share one compiled step.

    Attributes
    ----------
    name : str
        For people; the file is named alike.
    step : Kernel
        The compiled step, with the signature of `tdint.kernels.stepping`.
    scratch_rows : callable
        Number of modally damped modes -> number of scratch rows that the step needs.
    memory : tuple of int
        Rows of the state that are independent; the acceleration row follows from equilibrium where
        it is not one of them.
    state_rows : int
        Rows of the state.
    derivatives : tuple of int
        Which derivative of the displacement each row of the state has the unit of.
    halvable : bool
        Whether a step that does not converge may be divided: its coefficients hold for any h.
    power_dampers : bool
        Whether the step takes power-law dashpots.
    linear_only : bool
        Whether the step holds for linear buildings alone.
    limited_by_stiffening : bool
        Whether the step is stable only up to some size where a story is stiffer than at rest.
    own_work : bool
        Whether the step tells the work of load and dampers in it; else it is found from the powers
        at its ends.
    shifts : tuple of float
        What each row of the state takes of a jump of the ground acceleration between two steps,
        over h^(2 - derivative). Such jumps come with steps longer than the record's sampling
        interval.
    parabolic : bool
        Whether the displacements follow parabolas within the step, along which the rates change as
        from end to end.
    prepare : callable, optional
        (building, forces, h) -> the step's coefficients, where they depend on the building.
    """

    name: str
    step: Kernel
    scratch_rows: Callable[[int], int]
    memory: tuple[int, ...] = (rows.DISPLACEMENT, rows.VELOCITY, rows.ACCELERATION)
    state_rows: int = 3
    derivatives: tuple[int, ...] = (0, 1, 2)
    halvable: bool = True
    power_dampers: bool = True
    linear_only: bool = False
    limited_by_stiffening: bool = False
    own_work: bool = False
    shifts: tuple[float, ...] = (0.0, 0.0, 1.0)
    parabolic: bool = False
    prepare: Callable[[Building, NDArray[np.float64], float], NDArray[np.float64]] | None = None


@dataclass(frozen=True)
class Method:
    """One entry of the catalogue.

    Attributes
    ----------
    coefficients : callable
        Parameter values -> coefficients of the family's step.
    rho_inf : callable
        Parameter values -> spectral radius for omega dt to infinity; nan where the method is not
        stable there.
    source : str
        Who published it.
    order : callable
        Parameter values -> order of displacement and velocity for a smooth load; 2 if left out.
    implicit : callable
        Parameter values -> whether the step solves for the restoring force at its end, as most do.
    stability_limit : callable
        Parameter values -> largest stable omega dt without damping; inf if there is none. Where a
        parameter opens an unstable band, the lower end of the band.
    """

    name: str
    family: Family
    coefficients: Callable[..., tuple[float, ...]]
    rho_inf: Callable[..., float]
    source: str
    parameters: tuple[Parameter, ...] = ()
    order: Callable[..., int] = lambda *values: 2
    implicit: Callable[..., bool] = lambda *values: True
    stability_limit: Callable[..., float] = lambda *values: math.inf


@dataclass(frozen=True)
class Integrator:
    """A method with the values of its parameters: what `method: newmark:beta=0.25:gamma=0.5` stands
    for.

    Attributes
    ----------
    typed : str
        The specification as it was given, without which two are the same.
    """

    method: Method
    values: tuple[float, ...] = ()
    typed: str = field(default="", compare=False)

    @property
    def label(self) -> str:
        """Its name in tables, pictures and JSON: as typed, which the catalogue reads."""
        full = (f"{name}={value!r}" for name, value in self.resolved.items())
        return self.typed or ":".join([self.method.name, *full])

    @property
    def resolved(self) -> dict[str, float]:
        """The value of each parameter, given or by default."""
        # Without values where a plug-in could not be loaded: its method is not asked.
        names = (parameter.name for parameter in self.method.parameters) if self.values else ()
        return dict(zip(names, self.values, strict=True))

    @property
    def family(self) -> Family:
        """The family whose step it takes."""
        return self.method.family

    @property
    def order(self) -> int:
        """Order of displacement and velocity for a smooth load."""
        return self.method.order(*self.values)

    @property
    def implicit(self) -> bool:
        """Whether the step solves for the restoring force at its end."""
        return self.method.implicit(*self.values)

    @property
    def stability_limit(self) -> float:
        """Largest stable omega dt without damping, inf if there is none."""
        return self.method.stability_limit(*self.values)

    @property
    def rho_inf(self) -> float:
        """Spectral radius for omega dt to infinity, nan where the method is not stable there."""
        return self.method.rho_inf(*self.values)

    def coefficients(
        self, building: Building, forces: NDArray[np.float64], h: float
    ) -> NDArray[np.float64]:
        """Coefficients of the compiled step for one building and step h (s)."""
        if self.family.prepare is not None:
            return self.family.prepare(building, forces, h)
        return np.array(self.method.coefficients(*self.values), dtype=np.float64)
