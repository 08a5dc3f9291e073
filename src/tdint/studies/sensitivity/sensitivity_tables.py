"""Tables of sensitivities: effects of parameters, and rank correlations of sweeps."""

from __future__ import annotations

from collections.abc import Sequence

from tdint.output.tables.table import TEXT, Column, Table, placeholder
from tdint.studies.campaign.campaign_tables import suite_columns
from tdint.studies.columns import declared
from tdint.studies.sensitivity.sensitivity import (
    ParameterEffect,
    RankCorrelation,
    rank_correlations,
)
from tdint.studies.store.result_store import Store
from tdint.units import SI, OutputUnits

_correlation: RankCorrelation = placeholder()
_PEAK = declared(
    "sensitivity.peak",
    _correlation.quantity,
    quantity=lambda result: result.quantity.called or result.quantity.name,
)
PARAMETER_EFFECTS: tuple[Column, ...] = (
    Column.named("building", "name of the building", TEXT),
    *_PEAK,
    *declared("sensitivity.parameter_effects"),
)
"""Columns of the effects of parameters (sensitivity)."""


def parameter_effect_table(effects: Sequence[ParameterEffect], units: OutputUnits = SI) -> Table:
    """Return the effects of parameters with the peak responses in the units of their rows."""
    return Table.of_results(PARAMETER_EFFECTS, [effect.in_units(units) for effect in effects])


CORRELATIONS = (
    *declared("sensitivity.correlations-1"),
    *_PEAK,
    *declared("sensitivity.correlations-2", rank_correlation=_correlation.coefficient),
)
"""Columns of the rank correlations of a sweep."""


def correlation_table(store: Store) -> Table:
    """Return the rank correlations of the sweep of a campaign, with the column of the level if the
    levels are not common scale factors."""
    columns = suite_columns(store, CORRELATIONS, 2, of_pairs=False)
    return Table.of_results(columns, rank_correlations(store))
