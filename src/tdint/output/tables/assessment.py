"""Tables of what is measured of methods: stability, overshoot and order."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING

from tdint.output.tables import columns
from tdint.output.tables.table import Table

if TYPE_CHECKING:
    from tdint.analysis.assessment.order import ObservedOrder
    from tdint.analysis.assessment.overshoot import Overshoot
    from tdint.analysis.assessment.stability import StabilityCurve


def stability_table(curves: Iterable[StabilityCurve]) -> Table:
    """One row per method, damping ratio and step over period."""
    return Table.of_results(columns.STABILITY, curves)


def overshoot_table(motions: Iterable[Overshoot]) -> Table:
    """One row per method, start and step; step 0 is the start."""
    return Table.of_results(columns.OVERSHOOT, motions)


def order_table(measured: Iterable[ObservedOrder]) -> Table:
    """One row per method and frequency ratio."""
    return Table.of_results(columns.ORDER, measured)
