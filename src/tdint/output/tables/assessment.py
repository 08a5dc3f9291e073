"""Tables of the laboratory: stability, overshoot and order of the methods.

The results of `tdint.analysis` fit the shapes told here as protocols, because imports run one way.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Protocol

from tdint.output.results import Array
from tdint.output.tables.tables import Cell, Table

STABILITY_COLUMNS = (
    "method",
    "damping",
    "dt_over_t",
    "spectral_radius",
    "period_error",
    "numerical_damping",
    "amplitude_decay",
)
OVERSHOOT_COLUMNS = (
    "method",
    "damping",
    "dt_over_t",
    "start",
    "step",
    "displacement",
    "velocity",
    "displacement_power",
    "velocity_power",
)
ORDER_COLUMNS = (
    "method",
    "load",
    "law",
    "frequency_ratio",
    "displacement_order",
    "velocity_order",
    "acceleration_order",
    "own_acceleration_order",
    "displacement_error",
)


class StabilityResult(Protocol):
    """One method at one damping ratio; arrays of shape (k,) over the step over the period, nan for no value."""

    @property
    def method(self) -> str: ...
    @property
    def damping(self) -> float: ...
    @property
    def dt_over_t(self) -> Array: ...
    @property
    def spectral_radius(self) -> Array: ...
    @property
    def period_error(self) -> Array: ...
    @property
    def numerical_damping(self) -> Array: ...
    @property
    def amplitude_decay(self) -> Array: ...


class OvershootResult(Protocol):
    """First steps of one method from one start, arrays of shape (steps + 1,) over the amplitude of the exact motion."""

    @property
    def method(self) -> str: ...
    @property
    def damping(self) -> float: ...
    @property
    def dt_over_t(self) -> float: ...
    @property
    def start(self) -> str: ...
    @property
    def displacement(self) -> Array: ...
    @property
    def velocity(self) -> Array: ...
    @property
    def displacement_power(self) -> float: ...
    @property
    def velocity_power(self) -> float: ...


class OrderResult(Protocol):
    """Relative errors of one method over falling steps, and the order of each quantity that follows from them."""

    @property
    def method(self) -> str: ...
    @property
    def load(self) -> str: ...
    @property
    def law(self) -> str: ...
    @property
    def frequency_ratio(self) -> float: ...
    @property
    def displacement(self) -> Array: ...
    def order(self, quantity: str) -> float: ...


def stability_table(curves: Iterable[StabilityResult]) -> Table:
    """One row per method, damping ratio and step over period."""
    rows: list[tuple[Cell, ...]] = []
    for curve in curves:
        columns = (
            curve.dt_over_t,
            curve.spectral_radius,
            curve.period_error,
            curve.numerical_damping,
            curve.amplitude_decay,
        )
        values = zip(*(column.tolist() for column in columns), strict=True)
        rows.extend((curve.method, curve.damping, *row) for row in values)
    return Table(STABILITY_COLUMNS, rows)


def overshoot_table(motions: Iterable[OvershootResult]) -> Table:
    """One row per method, start and step; step 0 is the start."""
    rows: list[tuple[Cell, ...]] = [
        (
            motion.method,
            motion.damping,
            motion.dt_over_t,
            motion.start,
            step,
            displacement,
            velocity,
            motion.displacement_power,
            motion.velocity_power,
        )
        for motion in motions
        for step, (displacement, velocity) in enumerate(
            zip(motion.displacement.tolist(), motion.velocity.tolist(), strict=True)
        )
    ]
    return Table(OVERSHOOT_COLUMNS, rows)


def order_table(measured: Iterable[OrderResult]) -> Table:
    """One row per method and frequency ratio."""
    rows: list[tuple[Cell, ...]] = [
        (
            one.method,
            one.load,
            one.law,
            one.frequency_ratio,
            *(one.order(quantity) for quantity in ("displacement", "velocity", "acceleration", "own_acceleration")),
            float(one.displacement[-1]),
        )
        for one in measured
    ]
    return Table(ORDER_COLUMNS, rows)
