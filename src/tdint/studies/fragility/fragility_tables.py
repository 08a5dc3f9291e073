"""Tables of fragility functions, and of the comparison of intensity measures."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from tdint.output.tables.table import PAIR_DEMAND, TEXT, Column, Table, numbered, placeholder
from tdint.studies.columns import declared
from tdint.studies.fragility.fragility_function import (
    CloudPoints,
    CollapseCloud,
    Counted,
    Fragility,
)
from tdint.studies.fragility.measures import MeasureFit
from tdint.studies.ida.ida_tables import DAMAGE

FRAGILITY_DAMAGE = Column.named("damage", DAMAGE.meaning)
FRAGILITY_STATES = declared("fragility.fragility_states")
"""First columns of functions by type; their errors are over the ground motions."""

FRAGILITY_BUILDING = (
    Column("building", "text", "type", "name of the building"),
    FRAGILITY_STATES[1],
)
"""First columns of functions by building."""

FRAGILITY = declared("fragility.fragility")

_function: Fragility = placeholder()
_cloud: CloudPoints = placeholder().cloud
_mixture: CollapseCloud = placeholder().cloud.mixture
_counted: Counted = placeholder().counted
CLOUD = declared(
    "fragility.cloud",
    _cloud,
    b0=_cloud.intercept,
    b1=_cloud.slope,
    collapsed=lambda function: function.cloud and float(function.cloud.collapsed),
    a0=_mixture.a0,
    a1=_mixture.a1,
)
"""Columns of the regression line of a cloud analysis."""


def _bound(bound: int, parameter: str) -> Column:
    """Return the column of a parameter of a fragility function that was fitted with the failed
    runs.

    `bound` is 0: all failed runs count as exceeding the threshold; 1: as not exceeding it.
    """
    name_end, meaning = (("exceed", "exceeding"), ("stand", "not exceeding"))[bound]
    return Column(
        f"{parameter}_failed_{name_end}",
        "1",
        lambda function: getattr(function.bounds[bound], parameter, np.nan),
        f"{parameter} if all failed runs are counted as {meaning}; empty if it cannot be estimated",
    )


FAILED = (
    Column.named("failed", "number of runs without a result, which the fit omits"),
    *(_bound(bound, parameter) for bound in (0, 1) for parameter in ("theta", "beta")),
)
"""Columns of fits where some runs have no result."""

COUNTED = (
    Column("bin", "1", numbered(_counted.im, 1.0), "bin of the intensity, from the lowest"),
    *declared(
        "fragility.counts",
        bin_im=_counted.im,
        bin_runs=_counted.runs,
        bin_share=_counted.fraction,
        bin_fitted=_counted.fitted,
        bin_bound=_counted.bound,
    ),
)
"""Columns of the counts in bins of the intensity, a table of their own."""

DRAWS = declared("fragility.draws")
"""Columns of functions of several draws of the properties of a building."""

(FRAGILITY_TOTAL,) = declared("fragility.fragility_total")

_RISK = declared("fragility.risk")
_TARGETS = ("risk_targeted_theta", "risk_targeted_im")
RISK = (*_RISK, *declared("fragility.risk-outside"))
"""Columns of the annual frequency by a hazard curve; frequencies in 1/year."""

ANNUAL_LOSS = declared("fragility.annual_loss")
"""Column of the expected annual loss."""

RISK_TOTAL = tuple(
    column._replace(
        name=f"{column.name}_total", meaning=f"{column.meaning}; with the modeling dispersion"
    )
    for column in _RISK
)


def _of(part: Any, columns: Sequence[Column]) -> list[Column]:
    """Return the columns of a part of a function."""
    return [column._replace(value=getattr(part, column.value)) for column in columns]


def fragility_table(
    functions: Sequence[Fragility],
    *,
    total: bool = False,
    states: Sequence[Column] = FRAGILITY_STATES,
) -> Table:
    """Return the table of fragility functions, with a row per function.

    The columns of the regression line and of failed runs are omitted if no function has these
    values. The risk target, which depends on the curve alone, is in the first row.

    Parameters
    ----------
    total : bool
        True to add the standard deviation with the modeling dispersion; false by default.
    states : sequence of Column
        First columns of functions of damage states; by default the building type and the state.
    """
    has_damage = any(not math.isnan(function.damage) for function in functions)
    # The fits of functions by type have no bounds for failed runs.
    has_failed_runs = any(function.failed and not function.type for function in functions)
    columns = [
        *(states if any(function.type for function in functions) else ()),
        *((FRAGILITY_DAMAGE,) if has_damage else ()),
        *FRAGILITY,
        *(CLOUD if any(function.cloud for function in functions) else ()),
        *(FAILED if has_failed_runs else ()),
        *(DRAWS if any(function.draws_text for function in functions) else ()),
        *((FRAGILITY_TOTAL,) if total else ()),
        *(_of(_function.risk, RISK) if functions[0].risk else ()),
        *(_of(_function.total_risk, RISK_TOTAL) if functions[0].total_risk else ()),
        *(ANNUAL_LOSS if any(function.annual_loss >= 0.0 for function in functions) else ()),
        *((PAIR_DEMAND,) if any(function.pair_demand for function in functions) else ()),
    ]
    table = Table.of_results(columns, functions)
    indices = {table.columns.index(name) for name in _TARGETS if name in table.columns}
    repeated = [
        tuple(None if index in indices else cell for index, cell in enumerate(row))
        for row in table.rows[1:]
    ]
    return table._replace(rows=[*table.rows[:1], *repeated])


def counts_table(
    functions: Sequence[Fragility], states: Sequence[Column] = FRAGILITY_STATES
) -> Table:
    """Return the counts of exceedances in bins of the intensity, with a row per function and bin.
    `states` is as for `fragility_table`."""
    head = states if any(function.type for function in functions) else ()
    counted = [function for function in functions if function.counted]
    return Table.of_results((*head, FRAGILITY[0], *COUNTED), counted)


def fit_table_of(functions: Sequence[Fragility], *, damaged: bool = False) -> Table:
    """Return the fitted parameters of fragility functions with their 95 % intervals.

    Parameters
    ----------
    functions : sequence of Fragility
        Functions; their thresholds are drift ratios or other demands.
    damaged : bool
        True to list the state of the building before the motion.
    """
    unit = functions[0].unit or "1"
    numbers: list[tuple[str, Any]] = [
        ("beta", "beta"),
        ("beta_low", _function.beta_interval[0]),
        ("beta_high", _function.beta_interval[1]),
    ]
    if any(function.draws_text for function in functions):
        numbers += [(column.name, column.name) for column in DRAWS]
    if any(function.modeling_dispersion for function in functions):
        numbers.append(("total_beta", "beta_total"))
    numbers.append(("motions", lambda function: function.motions or function.runs))
    # The number of runs is a column only if ground motions have several runs.
    if any(function.motions and function.runs != function.motions for function in functions):
        numbers.append(("runs", "runs"))
    numbers.append(("censored", "censored"))
    texts = {"threshold": "threshold_text"}
    if damaged:
        texts = {"state": "initial_damage"} | texts
    if any(function.type for function in functions):
        texts = {"type": "type", "damage_state": "state"} | texts
    columns = [
        *(Column(name, TEXT, value, "") for name, value in texts.items()),
        Column("theta", unit, "theta", ""),
        Column("theta_low", unit, _function.theta_interval[0], ""),
        Column("theta_high", unit, _function.theta_interval[1], ""),
        *(Column(name, "1", value, "") for name, value in numbers),
    ]
    return Table.of_results(columns, functions)


def risk_table_of(functions: Sequence[Fragility]) -> Table:
    """Return the annual frequencies of fragility functions for a report."""
    columns = [Column("function", TEXT, "exceeded", ""), *_of(_function.risk, _RISK)]
    if functions[0].total_risk:
        columns += _of(_function.total_risk, RISK_TOTAL[:3])
    units = dict.fromkeys(("annual_frequency", "annual_frequency_error"), "1/year")
    units["contributing_im"] = functions[0].unit
    columns = [column._replace(unit=units.get(column.name, column.unit)) for column in columns]
    return Table.of_results(columns, functions)


COMPARED = declared("fragility.compared")


def comparison_of_measures(fits: Sequence[MeasureFit]) -> Table:
    """Return the table that compares intensity measures as predictors of the drift ratio."""
    return Table.of(COMPARED, [tuple(column.of(fit) for column in COMPARED) for fit in fits])
