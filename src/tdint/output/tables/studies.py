"""Tables of studies: factors of a suite, incremental dynamic analyses and their capacities, fragility functions."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from tdint.campaign.fragility.fits import Fragility
from tdint.campaign.ida.curve import Capacity, IdaCurve
from tdint.campaign.ida.study import IdaStudy
from tdint.campaign.suites.scaling import Scaling
from tdint.campaign.suites.suite import components
from tdint.ground_motion.record import component_names
from tdint.output.tables.columns import studies as columns
from tdint.output.tables.table import Table, rows_of


def factor_table(scaling: Scaling) -> Table:
    """A row for each component of a suite."""
    records = [record for motion in scaling.motions for record in components(motion)]
    factors = [
        factor for motion, factor in zip(scaling.motions, scaling.factors, strict=True) for _ in components(motion)
    ]
    rows = zip((record.source for record in records), component_names(records), map(float, factors), strict=True)
    return Table.of(columns.FACTORS, list(rows))


@dataclass(frozen=True)
class _CurveRows:
    """The rows of a curve, or the row of one of its capacities."""

    record: str
    component: str
    study: IdaStudy
    curve: IdaCurve
    capacity: Capacity | None = None

    def of_runs(self, name: str) -> Any:
        """A value of all runs, shape (runs,)."""
        return np.array([getattr(run, name) for run in self.curve.runs])


def ida_table(study: IdaStudy) -> Table:
    """A row for each run of each record, from the lowest level."""
    table = Table.of(columns.IDA, [row for one in _curves(study) for row in rows_of(columns.IDA, one)])
    return _with_unit(table, study.measure.unit)


def capacity_table(study: IdaStudy) -> Table:
    """A row for each record and threshold."""
    rows = [
        rows_of(columns.CAPACITIES, _CurveRows(one.record, one.component, study, one.curve, capacity))[0]
        for one in _curves(study)
        for capacity in map(one.curve.capacity, study.thresholds)
    ]
    return _with_unit(Table.of(columns.CAPACITIES, rows), study.measure.unit)


def fragility_table(functions: Sequence[Fragility], *, total: bool = False) -> Table:
    """A row for each function; with `total` a column of the standard deviation with that of the model."""
    return Table.of_results((*columns.FRAGILITY, *(columns.FRAGILITY_TOTAL,) * total), functions)


def _with_unit(table: Table, unit: str) -> Table:
    """The table with the unit of its intensities among its meanings: their columns' names do not tell it."""
    told = {name: {**table.meanings[name], "unit": unit} for name in columns.INTENSITIES if name in table.meanings}
    return replace(table, meanings=table.meanings | told)


def _curves(study: IdaStudy) -> Iterator[_CurveRows]:
    names = component_names([curve.record for curve in study.curves])
    for curve, name in zip(study.curves, names, strict=True):
        yield _CurveRows(curve.record.source, name, study, curve)
