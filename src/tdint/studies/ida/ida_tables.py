"""Tables of incremental dynamic analyses: curves and capacities."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from tdint.ground_motion.record import component_names
from tdint.output.tables.table import (
    NAMED_RECORD_COLUMNS,
    PAIR_DEMAND,
    Cell,
    Column,
    Table,
    error_columns,
    numbered,
    placeholder,
)
from tdint.studies.columns import declared
from tdint.studies.ida import ida_curve
from tdint.studies.ida.collapse_margin import CollapseMargin
from tdint.studies.ida.ida import IdaStudy

_row: _CurveRows = placeholder()
_RECORD = (
    *NAMED_RECORD_COLUMNS,
    *declared("ida.record", _row.study, unit=_row.study.measure.unit),
)
"""First columns of the tables of an incremental dynamic analysis."""


def _run_values(name: str) -> Callable[[Any], Any]:
    """Return a function of a `_CurveRows`, which returns the attribute `name` of all runs of the
    curve as an array, shape (runs,)."""
    return lambda row: np.array([getattr(run, name) for run in row.curve.runs])


IDA = (
    *_RECORD,
    *declared(
        "ida.ida",
        level=numbered(_row.curve.runs),
        im=_run_values("im"),
        scale=_run_values("scale"),
        status=_run_values("status"),
        peak_drift_ratio=_run_values("drift_ratio"),
        peak_absolute_acceleration_m_s2=_run_values("acceleration"),
        residual_drift_ratio=_run_values("residual_drift_ratio"),
    ),
)
_DEMANDS = ("drift_ratio", "acceleration", "residual_drift_ratio")
IDA_ERRORS = tuple(
    column._replace(value=_run_values(f"{name}_error"))
    for column, name in zip(error_columns(IDA[-3:]), _DEMANDS, strict=True)
)
"""Additional columns of a study with error estimates."""

DAMAGE = Column(
    "damage", "1", _row.curve.damage, "drift ratio of the damage by the main shock; 0: intact"
)
INTENSITIES = ("im", "capacity", "lower", "upper", "p16", "median", "p84")
"""Columns in the unit of the column `unit`."""

CAPACITIES = (
    *_RECORD,
    *declared("ida.capacities", _row.capacity, resurrection=_row.curve.resurrection),
)


(LIMIT,) = declared("ida.limit", _row.capacity)


FRACTILES = (*_RECORD[-2:], *declared("ida.fractiles"))
"""Columns of the fractile curves."""


_margin: CollapseMargin = placeholder()
MARGIN = declared(
    "ida.margin",
    s_mt_m_s2=_margin.design.s_mt,
    beta_rtr=_margin.design.beta_rtr,
    beta_total=_margin.design.beta_total,
    acmr_20=_margin.design.acmr_20,
    acmr_10=_margin.design.acmr_10,
)
"""Columns of the collapse margin by FEMA P-695."""


@dataclass(frozen=True)
class _CurveRows:
    """Source of the rows of the runs of a curve, or of the row of one of its capacities.

    Attributes
    ----------
    capacity : Capacity | None
        Capacity of the row; None for rows of runs.
    """

    record: str
    component: str
    study: IdaStudy
    curve: ida_curve.IdaCurve
    capacity: ida_curve.Capacity | None = None


def ida_table(study: IdaStudy) -> Table:
    """Return the table of the results of an incremental dynamic analysis, with a row per run.

    The rows are in the order of the records, and of the intensity levels of each record from the
    lowest.
    """
    columns = (*_with_damage(IDA, study), *(IDA_ERRORS if study.checked else ()))
    return _with_unit(
        Table.of_results(columns, curve_rows(study, study.curves)), study.measure.unit
    )


def capacity_table(study: IdaStudy) -> Table:
    """Return the table of the capacities of an incremental dynamic analysis, with a row per
    ground motion and drift threshold, or limit of attachments or links.

    A capacity is the lowest intensity that exceeds the threshold.

    The two horizontal components of a pair are one ground motion unless they count separately.
    """
    # The rule for the demand of a pair is a column only if the study has pairs.
    pair_demand = (PAIR_DEMAND._replace(value=_row.study.pair_demand),) if study.partners else ()
    limit_column = (LIMIT,) if study.limits else ()
    columns = (*_with_damage(CAPACITIES, study), *limit_column, *pair_demand)
    capacities = (
        replace(row, capacity=capacity)
        for row in curve_rows(study, study.motion_curves)
        for capacity in (
            *map(row.curve.capacity, study.thresholds),
            *limit_capacities(study, row.curve),
        )
    )
    return _with_unit(Table.of_results(columns, capacities), study.measure.unit)


def fractile_table(study: IdaStudy) -> Table:
    """Return the fractile curves of the intensities over the ground motions, as in the figure; for
    each state of damage, one row per drift ratio up to the collapse drift."""
    drifts = ida_curve.fractile_drifts(study.model.collapse_drift)
    rows: list[tuple[Cell, ...]] = []
    for state in study.states:
        curves = state.motion_curves
        head = (curves[0].damage, study.im_name, study.measure.unit)
        values = ida_curve.capacity_fractiles(curves, drifts)
        rows += [
            (*head, drift, *fractiles, len(curves))
            for drift, fractiles in zip(drifts.tolist(), values.T.tolist(), strict=True)
        ]
    columns = _with_damage(FRACTILES, study)
    omitted = 1 + len(FRACTILES) - len(columns)
    return _with_unit(Table.of(columns, (row[omitted:] for row in rows)), study.measure.unit)


def limit_capacities(study: IdaStudy, curve: ida_curve.IdaCurve) -> list[ida_curve.Capacity]:
    """Return the capacities of a curve for the limits of attachments and links; empty for a damaged
    building, whose attachments and links have no results of the record alone."""
    if curve.damage:
        return []
    return [
        curve.limit_capacity(
            index, f"{limit.level}: {limit.quantity}" if limit.level else limit.quantity
        )
        for index, limit in enumerate(study.limits)
    ]


def _with_damage(columns: tuple[Column, ...], study: IdaStudy) -> tuple[Column, ...]:
    """Return the columns of a table of an IDA study, preceded by the damage column if the building
    was damaged by a main shock in some of the curves."""
    return (DAMAGE, *columns) if any(curve.damage for curve in study.curves) else columns


def _with_unit(table: Table, unit: str) -> Table:
    """Return the table with the unit of the intensities in the descriptions of their columns. The
    names of these columns do not contain the unit."""
    units = {
        name: {**table.meanings[name], "unit": unit}
        for name in INTENSITIES
        if name in table.meanings
    }
    return table._replace(meanings=table.meanings | units)


def curve_rows(study: IdaStudy, curves: Iterable[ida_curve.IdaCurve]) -> Iterator[_CurveRows]:
    """Yield curves of a study with their files and the names of their components.

    A pair that counts as a single ground motion has the file name of its first component and the
    names of both components.

    Parameters
    ----------
    curves : iterable of IdaCurve
        `IdaStudy.curves` (each component) or `IdaStudy.motion_curves` (each ground motion).
    """
    # A single call for all curves makes the names distinct over all initial damages. Curves are
    # identified by `id`, because they contain arrays, which have no hash.
    names = component_names([curve.record for curve in study.curves])
    name_of_curve = dict(zip(map(id, study.curves), names, strict=True))
    for curve in curves:
        parts = curve.parts if isinstance(curve, ida_curve.PairCurve) else (curve,)
        component = "+".join(name_of_curve[id(part)] for part in parts)
        yield _CurveRows(curve.record.source, component, study, curve)
