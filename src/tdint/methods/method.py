"""Data types of a time-integration method: compiled step, coefficients and citation."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from tdint.arrays import Array
from tdint.kernels import layout as rows

if TYPE_CHECKING:
    from tdint.kernels.compiling import Kernel
    from tdint.model.building import Building


@dataclass(frozen=True)
class Parameter:
    """Parameter of a method: default value and allowed range.

    The default may be a function of the values of the preceding parameters.

    Attributes
    ----------
    name : str
        Name in a method specification.
    default : float or callable
        Default value, or a function of the values of the preceding parameters that returns it.
    low, high : float
        Ends of the allowed range.
    low_allowed, high_allowed : bool, default True
        True if the end belongs to the range.
    """

    name: str
    default: float | Callable[..., float]
    low: float
    high: float
    low_allowed: bool = True
    high_allowed: bool = True

    def allows(self, value: float) -> bool:
        """Return True if `value` is finite and in the range; an end of the range can be excluded.

        Parameters
        ----------
        value : float
            Value of the parameter.
        """
        is_above_low = value >= self.low if self.low_allowed else value > self.low
        is_below_high = value <= self.high if self.high_allowed else value < self.high
        return math.isfinite(value) and is_above_low and is_below_high

    @property
    def range(self) -> str:
        """Allowed range as text, such as [0, 1); a round bracket excludes the end."""
        opening = "[" if self.low_allowed else "("
        closing = "]" if self.high_allowed else ")"
        return f"{opening}{self.low:g}, {self.high:g}{closing}"


SIMPSON_MEAN = (1.0 / 6.0, 0.5)
"""`Family.mean_rule`: Simpson's rule."""

GAUSS_MEAN = (0.5, math.sqrt(3.0) / 6.0)
"""`Family.mean_rule`: rule of Gauss with two points."""


@dataclass(frozen=True)
class Family:
    """Methods that share one compiled step.

    Attributes
    ----------
    name : str
        Name of the family for the user, equal to the name of its file.
    step : Kernel
        The compiled step, with the signature of `tdint.kernels.stepping`.
    scratch_rows : callable
        Number of modally damped modes -> number of scratch rows that the step needs.
    memory : tuple of int
        Rows of the state that are independent. If the row of the acceleration is not included, it
        follows from equilibrium.
    state_rows : int
        Rows of the state.
    derivatives : tuple of int
        For each row of the state, the order of the displacement derivative with the same unit: 0
        for m, 1 for m/s, 2 for m/s^2.
    halvable : bool
        True if a step that does not converge may be divided into shorter steps, because the
        coefficients are valid for any h.
    power_dampers : bool
        True if the step supports power-law dashpots.
    linear_only : bool
        True if the step is valid for linear buildings only.
    limited_by_stiffening : bool
        True if the step is only conditionally stable if a story becomes stiffer than at rest.
    own_work : bool
        True if the step computes the work of the load and of the dampers; otherwise the work is
        computed from the power at both ends of the step.
    shifts : tuple of float
        Change of each row of the state per unit increase of the floor accelerations at a jump of
        the ground acceleration between two steps, divided by h^(2 - derivative). Such jumps occur
        if the time step is longer than the sampling interval of the record.
    parabolic : bool
        True if the displacements are parabolic within the step, with rates that change linearly
        between its start and end.
    mean_rule : tuple of float
        Rule that is nearest to the mean of the damping forces in the change of velocity over a
        step: weight of two points, and their distance from the middle of the step as a fraction of
        the step. The middle has the rest of the weight. The default is the trapezoidal rule.
    prepare : callable, optional
        (building, forces, h) -> coefficients of the step, if they depend on the building.
    moments : callable, optional
        (building, h) -> number of Legendre coefficients, from degree 2 on, of a table of forces
        over a step that the step uses. Other steps use only the line of the table.
    step_peaks : int
        First scratch row of the peaks that the step computes, a copy of the peaks of the run; 0 if
        the step computes none.
    devices : bool
        True if the step supports attachments and links: it uses `above`, `base_of` and `tie`
        throughout (`tdint.kernels.linear_terms`).
    braced_devices : bool
        True if it supports them together with braces of dampers and tangent damping.
    impact_damping : bool
        True if it supports the damping of contacts with the law `hertz`.
    inertance : bool
        True if it supports inerters in a building that is not linear.
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
    mean_rule: tuple[float, float] = (0.5, 0.5)
    prepare: Callable[[Building, Array, float], Array] | None = None
    moments: Callable[[Building, float], int] | None = None
    step_peaks: int = 0
    devices: bool = False
    braced_devices: bool = False
    impact_damping: bool = False
    inertance: bool = False


@dataclass(frozen=True)
class Method:
    """Entry of the catalogue of methods.

    Attributes
    ----------
    name : str
        Name in a method specification.
    family : Family
        Methods with the same compiled step.
    parameters : tuple of Parameter
        Parameters; the functions below receive their values in this order.
    coefficients : callable
        Parameter values -> coefficients of the family's step.
    rho_inf : callable
        Parameter values -> spectral radius for omega dt to infinity; nan where the method is not
        stable in this limit.
    source : str
        Publication of the method.
    order : callable
        Parameter values -> order of displacement and velocity for a smooth load; default 2.
    implicit : callable
        Parameter values -> True (default) if the step solves for the restoring force at its end.
    stability_limit : callable
        Parameter values -> largest stable omega dt without damping; inf if the method is always
        stable. If the method is unstable in a band of omega dt, the lower end of the band.
    braces : bool
        True if the step integrates dampers with braces; default False.
    tangent_damping : callable
        Parameter values -> True if the step integrates Rayleigh damping with the tangent stiffness;
        default False.
    variants : tuple of str
        Further parameter values, such as `theta=1.3`, that show behavior which the defaults do not
        show. `tdint failures` also tries these values.
    estimating_coefficients : callable, optional
        Parameter values -> coefficients of a run that estimates errors of the method in
        buildings for which it is more suitable than the default method
        (`tdint.response.runs.error_estimate`); None by default.
    estimated_by : str, optional
        Method of the run that estimates errors of the method in buildings whose forces change
        abruptly; empty by default, for the method of most estimates.
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
    variants: tuple[str, ...] = ()
    estimating_coefficients: Callable[..., tuple[float, ...]] | None = None
    estimated_by: str = ""
    braces: bool = False
    tangent_damping: Callable[..., bool] = lambda *values: False


@dataclass(frozen=True)
class Integrator:
    """Method with the values of its parameters, such as `newmark:beta=0.25:gamma=0.5`.

    Attributes
    ----------
    method : Method
        Method of the catalogue.
    values : tuple of float
        Values of all parameters of the method, in their order.
    typed : str
        Specification as the user wrote it; ignored when two integrators are compared.
    """

    method: Method
    values: tuple[float, ...] = ()
    typed: str = field(default="", compare=False)

    @property
    def label(self) -> str:
        """Label in tables, figures and JSON: the specification, in the form that `parse` reads.

        The label is the specification of the user (`typed`). If it is empty, the label contains the
        name of the method and the values of all parameters.
        """
        assignments = (f"{name}={value!r}" for name, value in self.resolved.items())
        return self.typed or ":".join([self.method.name, *assignments])

    @property
    def resolved(self) -> dict[str, float]:
        """Value of each parameter, specified or default."""
        # If the plug-in of the method could not be loaded, `values` is empty, and access to
        # `method.parameters` would raise the error of the plug-in.
        names = (parameter.name for parameter in self.method.parameters) if self.values else ()
        return dict(zip(names, self.values, strict=True))

    @property
    def family(self) -> Family:
        """Family of the method, which contains the compiled step."""
        return self.method.family

    @property
    def order(self) -> int:
        """Order of displacement and velocity for a smooth load."""
        return self.method.order(*self.values)

    @property
    def implicit(self) -> bool:
        """True if the step solves for the restoring force at its end."""
        return self.method.implicit(*self.values)

    @property
    def tangent_damping(self) -> bool:
        """True if the step integrates Rayleigh damping with the tangent stiffness."""
        return self.method.tangent_damping(*self.values)

    @property
    def stability_limit(self) -> float:
        """Largest stable omega dt without damping; inf if the method is stable for any omega dt.

        omega is the circular frequency of a mode, rad/s, and dt the time step, s.
        """
        return self.method.stability_limit(*self.values)

    @property
    def rho_inf(self) -> float:
        """Spectral radius of the amplification matrix as omega dt tends to infinity.

        omega is the circular frequency of a mode, rad/s, and dt the time step, s. nan if the method
        is not stable in this limit.
        """
        return self.method.rho_inf(*self.values)

    def coefficients(self, building: Building, forces: Array, h: float) -> Array:
        """Return the coefficients of the compiled step for one building and the time step h.

        They depend on building, forces and h only if the family has the function `prepare`. Their
        meaning and order are defined by the step of the family.

        Parameters
        ----------
        building : Building
            Assembled building.
        forces : ndarray
            Forces on floors: one row per force (see `tdint.kernels.layout`).
        h : float
            Time step, s.
        """
        if self.family.prepare is not None:
            return self.family.prepare(building, forces, h)
        return np.array(self.method.coefficients(*self.values), dtype=np.float64)
