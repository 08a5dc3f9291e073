"""Tables of the laboratory: stability, overshoot and order of the methods."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING

from tdint.output.tables.tables import Cell, Table

if TYPE_CHECKING:
    from tdint.analysis.assessment.order import ObservedOrder
    from tdint.analysis.assessment.overshoot import Overshoot
    from tdint.analysis.assessment.stability import StabilityCurve

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


def stability_table(curves: Iterable[StabilityCurve]) -> Table:
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


def overshoot_table(motions: Iterable[Overshoot]) -> Table:
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


def order_table(measured: Iterable[ObservedOrder]) -> Table:
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
