"""Tables of studies: factors of a suite, incremental dynamic analyses and their capacities,
fragility functions."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from tdint.campaign.fragility.fits import BINS, Fragility
from tdint.campaign.fragility.measures import MeasureFit
from tdint.campaign.ida import IdaStudy
from tdint.campaign.ida_curve import Capacity, IdaCurve, PairCurve
from tdint.campaign.scaling import Scaling
from tdint.ground_motion.reading.suites import components
from tdint.ground_motion.record import component_names
from tdint.output.tables.table import (
    OF_NAMED_RECORD,
    OF_RECORD,
    PAIR_DEMAND,
    PERIOD,
    Cell,
    Column,
    Table,
    error_columns,
    numbered,
)

_PEAK = (
    Column(
        "quantity",
        "text",
        lambda one: one.quantity.called or one.quantity.name,
        "peak: median over the motions",
    ),
    Column("unit", "text", "quantity.unit", "its unit"),
)
PARAMETER_EFFECTS = (
    Column("building", "text", "building", "name of the building"),
    *_PEAK,
    Column("parameter", "text", "parameter", "what is changed, all else as it is"),
    Column("low", "1", "low", "its low value"),
    Column("high", "1", "high", "its high value"),
    Column("at_low", "1", "at_low", "the peak with it"),
    Column("as_it_is", "1", "as_it_is", "the peak of the building as it is"),
    Column("at_high", "1", "at_high", "the peak with the high value"),
    Column(
        "effect",
        "1",
        "effect",
        "what lies between the peaks at both ends, over that of the building as it is",
    ),
)
"""Of what a building is sensitive to."""

CORRELATIONS = (
    Column("building", "text", "building", "name of the building"),
    Column("scale", "1", "scale", "factor on the ground acceleration"),
    *_PEAK,
    Column("parameter", "text", "parameter", "what a sweep varied"),
    Column("rank_correlation", "1", "coefficient", "Spearman's, over the variations"),
    Column("draws", "1", "draws", "variations with a peak"),
)
"""Of the ranks of a sweep."""

FACTORS = (
    *OF_RECORD,
    Column("factor", "1", "factor", "factor on the record, the same for both components of a pair"),
)

SCALED = (
    Column(
        "curve",
        "text",
        "curve",
        "`scaled`: a motion times its factor; `mean` of all of these; `target`",
    ),
    *OF_NAMED_RECORD,
    PERIOD,
    Column("psa_m_s2", "m/s^2", "psa", "pseudo-acceleration"),
)
"""Of the spectra of a scaled suite."""

_RECORD = (
    *OF_NAMED_RECORD,
    Column(
        "im_name",
        "text",
        "study.im_name",
        "intensity measure: sa(T) and sa-avg(T) with the period in s, pga, pgv, arias, cav",
    ),
    Column("unit", "text", "study.measure.unit", "its unit"),
)
"""The first columns of the tables of an incremental dynamic analysis."""


def _of_runs(name: str) -> Callable[[Any], Any]:
    """What gives a value of all runs."""
    return lambda curve: curve.of_runs(name)


IDA = (
    *_RECORD,
    Column(
        "level", "1", numbered("curve.runs"), "number of the level of intensity, from the lowest"
    ),
    Column("im", "1", _of_runs("im"), "intensity"),
    Column("scale", "1", _of_runs("scale"), "factor on the record"),
    Column("status", "text", _of_runs("status"), "how the run ended"),
    Column(
        "peak_drift_ratio", "1", _of_runs("drift_ratio"), "largest peak drift over story height"
    ),
    Column(
        "peak_absolute_acceleration_m_s2",
        "m/s^2",
        _of_runs("acceleration"),
        "largest absolute acceleration of a floor",
    ),
    Column(
        "residual_drift_ratio",
        "1",
        _of_runs("residual_drift_ratio"),
        "largest drift at the end of the run over story height",
    ),
)
_DEMANDS = ("drift_ratio", "acceleration", "residual_drift_ratio")
IDA_ERRORS = tuple(
    replace(column, value=_of_runs(f"{name}_error"))
    for column, name in zip(error_columns(IDA[-3:]), _DEMANDS, strict=True)
)
"""Behind them, of a study that has estimated them."""

DAMAGE = Column(
    "damage",
    "1",
    "curve.damage",
    "drift ratio to which a mainshock has damaged the building; 0: intact",
)
INTENSITIES = ("im", "capacity", "lower", "upper")
"""Columns in the unit that the column `unit` tells."""

CAPACITIES = (
    *_RECORD,
    Column(
        "threshold",
        "1",
        "capacity.threshold",
        "drift ratio; the collapse drift, the largest one, stands for collapse",
    ),
    Column(
        "capacity",
        "1",
        "capacity.capacity",
        "intensity at which it is first exceeded; if censored one that it is above",
    ),
    Column("lower", "1", "capacity.lower", "level next below at which the building was run"),
    Column(
        "upper",
        "1",
        "capacity.upper",
        "level next above at which the building was run; empty if censored",
    ),
    Column(
        "censored",
        "text",
        "capacity.censored",
        "whether it was not exceeded up to the largest level",
    ),
    Column(
        "resurrection",
        "text",
        "curve.resurrection",
        "whether the building stood again at a level tried above its first collapse: 1.25 and 1.5 "
        "times it, and those of the search",
    ),
)
FRAGILITY_DAMAGE = Column("damage", "1", "damage", DAMAGE.meaning)
FRAGILITY_STATES = (
    Column(
        "type",
        "text",
        "type",
        "type of buildings: class, Hazus' type and design level, or name of the model",
    ),
    Column("state", "text", "state", "damage state that is reached or exceeded"),
)
"""Before those of functions by type; their errors are over the ground motions."""

FRAGILITY_BUILDING = (
    Column("building", "text", "type", "name of the building"),
    FRAGILITY_STATES[1],
)
"""Of functions by building."""

FRAGILITY = (
    Column("threshold", "1", "threshold", "demand whose exceedance is meant"),
    Column("fit", "text", "fit", "stripes, ida or cloud"),
    Column("theta", "1", "theta", "median intensity"),
    Column(
        "beta",
        "1",
        "beta",
        "standard deviation of the logarithm of the intensity, from record to record",
    ),
    Column(
        "theta_error",
        "1",
        "theta_error",
        "standard error of ln theta: of theta, as a part of it; of runs whose motions (or events) "
        "are known by leaving these out one by one; empty where the median is extrapolated or less "
        "than three motions tell it",
    ),
    Column("beta_error", "1", "beta_error", "standard error of beta, likewise"),
    Column(
        "records",
        "1",
        "records",
        "records; of stripes those of the largest one, of a cloud of runs the runs",
    ),
    Column(
        "censored", "1", "censored", "records of which the value is known only to lie above a limit"
    ),
    Column("im", "text", "im", "intensity measure, as far as the table tells it"),
    Column("unit", "text", "unit", "its unit, as far as the table tells it"),
)
_SEEN = (
    "; of damage states with a dispersion s each run stands three times, with its demand times "
    "exp(-1.2247 s), 1 and exp(1.2247 s), known only to be above the heaviest state, or below the "
    "lightest one, where it is"
)
CLOUD = (
    Column(
        "b0",
        "1",
        lambda one: _of_line(one, "intercept"),
        f"of a cloud: intercept of ln EDP over ln IM{_SEEN}",
    ),
    Column(
        "b1",
        "1",
        lambda one: _of_line(one, "slope"),
        "of a cloud: slope of ln EDP over ln IM, likewise",
    ),
    Column(
        "sigma",
        "1",
        lambda one: _of_line(one, "sigma"),
        "of a cloud: standard deviation of ln EDP, likewise",
    ),
    Column(
        "below",
        "1",
        lambda one: _of_line(one, "light"),
        "of a cloud: runs that count only as below all states",
    ),
)
"""Beside a cloud: its line."""


def _of_line(function: Fragility, name: str) -> float:
    return getattr(function.cloud, name, np.nan)


def _bound(place: int, name: str) -> Column:
    word, meaning = (("exceed", "exceeding"), ("stand", "not exceeding"))[place]
    return Column(
        f"{name}_failed_{word}",
        "1",
        lambda fit: getattr(fit.bounds[place], name, np.nan),
        f"{name} with all failed runs counted as {meaning}; empty where that tells none",
    )


FAILED = (
    Column("failed", "1", "failed", "runs without a result, which the fit leaves out"),
    *(_bound(place, name) for place in (0, 1) for name in ("theta", "beta")),
)
"""Beside a fit of runs some of which have no result."""

_COUNTS = {
    "im": ("1", "geometric mean of the intensities in bin {}, from the lowest"),
    "runs": ("1", "runs in this bin"),
    "share": ("1", "share of them that is beyond, as counted"),
    "fitted": ("1", "share that the function has there"),
    "bound": ("1", "what may lie between both until a warning tells it"),
}


def _of_bin(place: int, name: str) -> Callable[[Fragility], float]:
    """What was counted in a bin; nan where there are fewer."""

    def value(function: Fragility) -> float:
        values = getattr(function.counted, name, ())
        return float(values[place]) if place < len(values) else np.nan

    return value


COUNTED = tuple(
    Column(f"bin_{place + 1}_{name}", unit, _of_bin(place, name), meaning.format(place + 1))
    for place in range(BINS)
    for name, (unit, meaning) in _COUNTS.items()
)
"""Behind the others: what was counted in bins of the intensity."""

FRAGILITY_TOTAL = Column(
    "beta_total",
    "1",
    "beta_total",
    "beta with what is not known of the model (--modeling-dispersion)",
)


def factor_table(scaling: Scaling) -> Table:
    """A row for each component of a suite."""
    records = [record for motion in scaling.motions for record in components(motion)]
    factors = [
        factor
        for motion, factor in zip(scaling.motions, scaling.factors, strict=True)
        for _ in components(motion)
    ]
    rows = zip(
        (record.source for record in records),
        component_names(records),
        map(float, factors),
        strict=True,
    )
    return Table.of(FACTORS, rows)


def scaled_table(scaling: Scaling) -> Table:
    """The spectra of a suite as it is scaled, their mean and the target, at the periods where it
    was compared."""
    target, periods = scaling.target, scaling.periods
    if target is None or periods is None:
        raise ValueError("a suite that was scaled to a value has no target to stand beside")
    spectra = scaling.spectra(periods)
    curves = [
        ("scaled", motion.source, motion.component, psa)
        for motion, psa in zip(scaling.motions, spectra, strict=True)
    ]
    # Below the motions their mean and the target, which are of no record.
    curves += [("mean", "", "", np.mean(spectra, axis=0)), ("target", "", "", target.at(periods))]
    rows = (
        (*head, period, value)
        for *head, psa in curves
        for period, value in zip(periods.tolist(), psa.tolist(), strict=True)
    )
    return Table.of(SCALED, rows)


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
    columns = (*_with_damage(IDA, study), *IDA_ERRORS * study.checked)
    return _with_unit(Table.of_results(columns, _curves(study)), study.measure.unit)


def capacity_table(study: IdaStudy) -> Table:
    """A row for each motion and threshold. A pair is a motion, or its components are."""
    stated = (replace(PAIR_DEMAND, value="study.pair_demand"),) * bool(study.partners)
    columns = (*_with_damage(CAPACITIES, study), *stated)
    capacities = (
        replace(curve, capacity=curve.curve.capacity(threshold))
        for curve in _motion_curves(study)
        for threshold in study.thresholds
    )
    return _with_unit(Table.of_results(columns, capacities), study.measure.unit)


def fragility_table(
    functions: Sequence[Fragility],
    *,
    total: bool = False,
    states: Sequence[Column] = FRAGILITY_STATES,
) -> Table:
    """A row for each function; with `total` a column of the standard deviation with that of the
    model. Functions of states have the columns `states` first, clouds bring those of their line,
    runs without a result those that bound what they may change, and last stands what was
    counted."""
    columns = (
        *(states if any(function.type for function in functions) else ()),
        *(
            (FRAGILITY_DAMAGE,)
            if any(function.damage == function.damage for function in functions)
            else ()
        ),
        *FRAGILITY,
        *(CLOUD if any(function.cloud for function in functions) else ()),
        *(FAILED if any(function.failed and not function.type for function in functions) else ()),
        *(FRAGILITY_TOTAL,) * total,
        *COUNTED[
            : len(_COUNTS)
            * max(
                (function.counted.im.size for function in functions if function.counted), default=0
            )
        ],
        *((PAIR_DEMAND,) if any(function.pair_demand for function in functions) else ()),
    )
    return Table.of_results(columns, functions)


COMPARED = (
    Column("im", "text", "im", "intensity measure, as it was asked for"),
    Column("unit", "text", "unit", "its unit"),
    Column("runs", "1", "runs", "runs on the line: those that ended"),
    Column(
        "left_out",
        "1",
        "left_out",
        "runs left out: collapsed, without a result, or without the measure",
    ),
    Column("slope", "1", "slope", "of the line of ln drift ratio over ln IM"),
    Column(
        "slope_error",
        "1",
        "slope_error",
        "its standard error, by leaving out motions (or events) one by one",
    ),
    Column("beta", "1", "beta", "efficiency: standard deviation of ln drift ratio about the line"),
    Column("proficiency", "1", "proficiency", "beta over the slope"),
    Column("r_squared", "1", "r_squared", "squared correlation of the logarithms"),
)
DEPENDENCE = (
    Column(
        "characteristic",
        "text",
        "characteristic",
        "of the motions, on which the residuals may depend",
    ),
    Column(
        "residual_slope",
        "1",
        "slope",
        "sufficiency: slope of the residuals over the characteristic",
    ),
    Column(
        "p_value",
        "1",
        "p_value",
        "chance of a slope as large where the residuals do not depend on it",
    ),
)


def comparison_of_measures(fits: Sequence[MeasureFit]) -> Table:
    """A row for each measure and characteristic of the motions; one for each measure where there is
    none."""
    rows: list[tuple[Cell, ...]] = []
    for fit in fits:
        columns = tuple(column.of(fit) for column in COMPARED)
        # A measure whose residuals were held beside nothing still has its row.
        ends = [
            tuple(column.of(dependence) for column in DEPENDENCE) for dependence in fit.dependences
        ]
        rows += [(*columns, *end) for end in ends or [(None, None, None)]]
    return Table.of((*COMPARED, *DEPENDENCE), rows)


def _with_damage(columns: tuple[Column, ...], study: IdaStudy) -> tuple[Column, ...]:
    """The columns, the state of the building before them where a study has several."""
    return (DAMAGE, *columns) if any(curve.damage for curve in study.curves) else columns


def _with_unit(table: Table, unit: str) -> Table:
    """The table with the unit of its intensities among its meanings: their columns' names do not
    tell it."""
    told = {
        name: {**table.meanings[name], "unit": unit}
        for name in INTENSITIES
        if name in table.meanings
    }
    return replace(table, meanings=table.meanings | told)


def _motion_curves(study: IdaStudy) -> Iterator[_CurveRows]:
    """The curves of the motions; a pair is named by the file of its first component and both
    components."""
    rows = {id(row.curve): row for row in _curves(study)}
    for curve in study.motion_curves:
        if isinstance(curve, PairCurve):
            of_parts = [rows[id(part)] for part in curve.parts]
            component = "+".join(row.component for row in of_parts)
            yield replace(of_parts[0], component=component, curve=curve)
        else:
            yield rows[id(curve)]


def _curves(study: IdaStudy) -> Iterator[_CurveRows]:
    names = component_names([curve.record for curve in study.curves])  # of all states alike
    for curve, name in zip(study.curves, names, strict=True):
        yield _CurveRows(curve.record.source, name, study, curve)
