"""Tables of sensitivities: effects of parameters, and rank correlations of sweeps."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from tdint.output.tables.table import (
    Column,
    Table,
)
from tdint.units import SI, OutputUnits

if TYPE_CHECKING:
    from tdint.studies.sensitivity.sensitivity import ParameterEffect


_PEAK = (
    Column(
        "quantity",
        "text",
        lambda result: result.quantity.called or result.quantity.name,
        "peak response: median over the ground motions",
    ),
    Column("unit", "text", "quantity.unit", "unit of the quantity"),
)
PARAMETER_EFFECTS: tuple[Column, ...] = (
    Column("building", "text", "building", "name of the building"),
    *_PEAK,
    Column("parameter", "text", "parameter", "parameter that is changed while others are constant"),
    Column("low", "1", "low", "low value of the parameter"),
    Column("high", "1", "high", "high value of the parameter"),
    Column("at_low", "1", "at_low", "peak response with the low value"),
    Column("as_it_is", "1", "as_it_is", "peak response of the unchanged building"),
    Column("at_high", "1", "at_high", "peak response with the high value"),
    Column(
        "effect",
        "1",
        "effect",
        "difference of the peak responses at the two values divided by the peak response of the "
        "unchanged building",
    ),
)
"""Columns of the effects of parameters (sensitivity)."""


def parameter_effect_table(effects: Sequence[ParameterEffect], units: OutputUnits = SI) -> Table:
    """Return the effects of parameters with the peak responses in the units of their rows."""
    return Table.of_results(PARAMETER_EFFECTS, [effect.in_units(units) for effect in effects])


CORRELATIONS = (
    Column("building", "text", "building", "name of the building"),
    Column("scale", "1", "scale", "scale factor of the ground motion"),
    *_PEAK,
    Column("parameter", "text", "parameter", "parameter that the sweep varied"),
    Column("rank_correlation", "1", "coefficient", "Spearman rank correlation over the variations"),
    Column("draws", "1", "draws", "number of variations with a peak response"),
)
"""Columns of the rank correlations of a sweep."""
