"""Tables of sensitivities: effects of parameters, and rank correlations of sweeps."""

from __future__ import annotations

from collections.abc import Sequence

from tdint.output.tables.table import TEXT, Column, Table
from tdint.studies.campaign.campaign_tables import with_level
from tdint.studies.sensitivity.sensitivity import ParameterEffect, rank_correlations
from tdint.studies.store.result_store import Store
from tdint.units import SI, OutputUnits

_PEAK = (
    Column(
        "quantity",
        "text",
        lambda result: result.quantity.called or result.quantity.name,
        "peak response: median over the ground motions",
    ),
    Column.named("quantity.unit", "unit of the quantity", TEXT),
)
PARAMETER_EFFECTS: tuple[Column, ...] = (
    Column.named("building", "name of the building", TEXT),
    *_PEAK,
    Column.named("parameter", "parameter that is changed while others are constant", TEXT),
    Column.named("low", "low value of the parameter"),
    Column.named("high", "high value of the parameter"),
    Column.named("at_low", "peak response with the low value"),
    Column.named("as_it_is", "peak response of the unchanged building"),
    Column.named("at_high", "peak response with the high value"),
    Column.named(
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
    Column.named("building", "name of the building", TEXT),
    Column.named(
        "scale",
        "scale factor of the ground motions; empty if ground motions have different factors",
    ),
    *_PEAK,
    Column.named("parameter", "parameter that the sweep varied", TEXT),
    Column("rank_correlation", "1", "coefficient", "Spearman rank correlation over the variations"),
    Column.named("draws", "number of variations with a peak response"),
)
"""Columns of the rank correlations of a sweep."""


def correlation_table(store: Store) -> Table:
    """Return the rank correlations of the sweep of a campaign, with the column of the level if the
    levels are not common scale factors."""
    return Table.of_results(with_level(store, CORRELATIONS, 2), rank_correlations(store))
