"""Tables of studies: scale factors of suites, incremental dynamic analyses, fragility functions."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from tdint.ground_motion.reading.suites import components
from tdint.ground_motion.record import component_names
from tdint.output.tables.table import (
    NAMED_RECORD_COLUMNS,
    PAIR_DEMAND,
    PERIOD,
    RECORD_COLUMNS,
    Cell,
    Column,
    Table,
    error_columns,
    numbered,
)
from tdint.studies.fragility.fragility_function import BINS, Fragility
from tdint.studies.fragility.measure_comparison import MeasureFit
from tdint.studies.ida import IdaStudy
from tdint.studies.ida_curve import Capacity, IdaCurve, PairCurve
from tdint.studies.scaling import Scaling
from tdint.units import SI, OutputUnits

if TYPE_CHECKING:
    from tdint.studies.sensitivity import ParameterEffect

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

FACTORS = (
    *RECORD_COLUMNS,
    Column(
        "factor", "1", "factor", "scale factor of the record, equal for both components of a pair"
    ),
)

SCALED = (
    Column(
        "curve",
        "text",
        "curve",
        "`scaled`: scaled ground motion; `mean`: mean of the scaled ground motions; `target`",
    ),
    *NAMED_RECORD_COLUMNS,
    PERIOD,
    Column("psa_m_s2", "m/s^2", "psa", "pseudo-acceleration"),
)
"""Columns of the spectra of a scaled suite."""

_RECORD = (
    *NAMED_RECORD_COLUMNS,
    Column(
        "im_name",
        "text",
        "study.im_name",
        "intensity measure: sa(T) and sa-avg(T) with the period in s, pga, pgv, arias, cav",
    ),
    Column("unit", "text", "study.measure.unit", "unit of the intensity measure"),
)
"""First columns of the tables of an incremental dynamic analysis."""


def _run_values(name: str) -> Callable[[Any], Any]:
    """Return a function of a `_CurveRows` (an IDA curve), which returns the attribute `name` of all
    runs of the curve as an array, shape (runs,)."""
    return lambda curve: curve.run_values(name)


IDA = (
    *_RECORD,
    Column("level", "1", numbered("curve.runs"), "number of the intensity level, from the lowest"),
    Column("im", "1", _run_values("im"), "intensity"),
    Column("scale", "1", _run_values("scale"), "scale factor of the record"),
    Column("status", "text", _run_values("status"), "status of the run"),
    Column(
        "peak_drift_ratio",
        "1",
        _run_values("drift_ratio"),
        "maximum over the stories of peak drift divided by story height",
    ),
    Column(
        "peak_absolute_acceleration_m_s2",
        "m/s^2",
        _run_values("acceleration"),
        "maximum absolute acceleration over the floors",
    ),
    Column(
        "residual_drift_ratio",
        "1",
        _run_values("residual_drift_ratio"),
        "maximum over the stories of residual drift divided by story height",
    ),
)
_DEMANDS = ("drift_ratio", "acceleration", "residual_drift_ratio")
IDA_ERRORS = tuple(
    replace(column, value=_run_values(f"{name}_error"))
    for column, name in zip(error_columns(IDA[-3:]), _DEMANDS, strict=True)
)
"""Additional columns of a study with error estimates."""

DAMAGE = Column(
    "damage",
    "1",
    "curve.damage",
    "drift ratio of the damage by the main shock; 0: intact",
)
INTENSITIES = ("im", "capacity", "lower", "upper")
"""Columns in the unit of the column `unit`."""

CAPACITIES = (
    *_RECORD,
    Column(
        "threshold",
        "1",
        "capacity.threshold",
        "drift ratio; the largest threshold is the collapse drift and represents collapse",
    ),
    Column(
        "capacity",
        "1",
        "capacity.capacity",
        "lowest intensity at which the threshold is exceeded; if censored, a lower bound",
    ),
    Column("lower", "1", "capacity.lower", "next lower intensity level with a run"),
    Column(
        "upper",
        "1",
        "capacity.upper",
        "next higher intensity level with a run; empty if censored",
    ),
    Column(
        "censored",
        "text",
        "capacity.censored",
        "true if the threshold was not exceeded up to the largest level",
    ),
    Column(
        "resurrection",
        "text",
        "curve.resurrection",
        "true if the building did not collapse at a level above the first collapse: 1.25 or 1.5 "
        "times its intensity, or a level of the search",
    ),
)
FRAGILITY_DAMAGE = Column("damage", "1", "damage", DAMAGE.meaning)
FRAGILITY_STATES = (
    Column(
        "type",
        "text",
        "type",
        "building type: class, Hazus type with design level, or name of the model",
    ),
    Column("state", "text", "state", "damage state that is reached or exceeded"),
)
"""First columns of functions by type; their errors are over the ground motions."""

FRAGILITY_BUILDING = (
    Column("building", "text", "type", "name of the building"),
    FRAGILITY_STATES[1],
)
"""First columns of functions by building."""

FRAGILITY = (
    Column("threshold", "1", "threshold", "threshold of the demand"),
    Column("fit", "text", "fit", "stripes, ida or cloud"),
    Column("theta", "1", "theta", "median intensity"),
    Column(
        "beta",
        "1",
        "beta",
        "standard deviation of the logarithm of the intensity (record-to-record variability)",
    ),
    Column(
        "theta_error",
        "1",
        "theta_error",
        "standard error of ln theta, which is the relative standard error of theta; a jackknife "
        "estimate over ground motions (or events) if they are known; empty if the median is "
        "extrapolated or less than three ground motions determine it",
    ),
    Column("beta_error", "1", "beta_error", "standard error of beta, by the same method"),
    Column(
        "motions",
        "1",
        "motions",
        "number of ground motions, both components of a recording being one; number of events if "
        "the runs have events; if the table states neither, of its rows or of the largest stripe",
    ),
    Column("runs", "1", "runs", "number of runs, capacities or counted records"),
    Column("censored", "1", "censored", "number of runs with only a lower bound of the value"),
    Column("im", "text", "im", "intensity measure, if the table states it"),
    Column("unit", "text", "unit", "unit of the intensity measure, if the table states it"),
)
_SEEN = (
    "; for damage states with dispersion s, each run is used three times, with its demand times "
    "exp(-1.2247 s), 1 and exp(1.2247 s); demands above the heaviest or below the lightest state "
    "are censored"
)
CLOUD = (
    Column(
        "b0",
        "1",
        lambda function: _regression_value(function, "intercept"),
        f"cloud analysis: intercept of the regression of ln EDP on ln IM{_SEEN}",
    ),
    Column(
        "b1",
        "1",
        lambda function: _regression_value(function, "slope"),
        "cloud analysis: slope of the regression of ln EDP on ln IM",
    ),
    Column(
        "sigma",
        "1",
        lambda function: _regression_value(function, "sigma"),
        "cloud analysis: standard deviation of ln EDP about the regression line",
    ),
    Column(
        "below",
        "1",
        lambda function: _regression_value(function, "light"),
        "cloud analysis: number of runs that count only as below all states",
    ),
)
"""Columns of the regression line of a cloud analysis."""


def _regression_value(function: Fragility, name: str) -> float:
    """Return an attribute of the regression line of a fragility function from a cloud analysis.

    `name` is `intercept`, `slope`, `sigma` or `light` (number of demands below all states). The
    result is nan for functions that were fitted in another way.
    """
    return getattr(function.cloud, name, np.nan)


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
    Column("failed", "1", "failed", "number of runs without a result, which the fit omits"),
    *(_bound(bound, parameter) for bound in (0, 1) for parameter in ("theta", "beta")),
)
"""Columns of fits in which some runs have no result."""

_COUNTS = {
    "im": ("im", "geometric mean of the intensities in bin {}, from the lowest"),
    "runs": ("runs", "number of runs in bin {}"),
    "share": ("fraction", "fraction of the runs in bin {} that exceed the threshold"),
    "fitted": ("fitted", "fraction in bin {} by the fitted function"),
    "bound": ("bound", "difference of both fractions in bin {} above which a warning is printed"),
}
"""Attribute of `Counted` and meaning of each column of a bin, by the end of the column name."""


def _value_in_bin(bin_index: int, attribute: str) -> Callable[[Fragility], float]:
    """Return a function of a fragility function, which returns an attribute of `Counted` in one of
    the bins of the intensity, in which the runs of a fit are counted.
    """

    def value(function: Fragility) -> float:
        """Return the value in the bin; nan if the fragility function has fewer bins."""
        values = getattr(function.counted, attribute, ())
        return float(values[bin_index]) if bin_index < len(values) else np.nan

    return value


COUNTED = tuple(
    Column(
        f"bin_{bin_index + 1}_{name}",
        "1",
        _value_in_bin(bin_index, attribute),
        meaning.format(bin_index + 1),
    )
    for bin_index in range(BINS)
    for name, (attribute, meaning) in _COUNTS.items()
)
"""Last columns: counts in bins of the intensity."""

FRAGILITY_TOTAL = Column(
    "beta_total",
    "1",
    "beta_total",
    "beta including the modeling dispersion (--modeling-dispersion)",
)


def factor_table(scaling: Scaling) -> Table:
    """Return the table of the scale factors of a suite, with one row per record (each component of
    a pair has a row)."""
    records, factors = [], []
    for motion, factor in zip(scaling.motions, scaling.factors, strict=True):
        for record in components(motion):  # both components of a pair have the same factor
            records.append(record)
            factors.append(float(factor))
    sources = [record.source for record in records]
    return Table.of(FACTORS, zip(sources, component_names(records), factors, strict=True))


def scaled_table(scaling: Scaling) -> Table:
    """Return the spectra of a scaled suite, their mean and the target, at the periods where mean
    and target were compared.

    Raises
    ------
    ValueError
        The suite was not scaled to a target.
    """
    target, periods = scaling.target, scaling.periods
    if target is None or periods is None:
        raise ValueError(
            "the suite has no target spectrum, because it was scaled to a value; scale it to a "
            "target"
        )
    spectra = scaling.spectra(periods)
    curves = [
        ("scaled", motion.source, motion.component, psa)
        for motion, psa in zip(scaling.motions, spectra, strict=True)
    ]
    # Mean and target follow after the ground motions; they have no record and component.
    curves += [("mean", "", "", np.mean(spectra, axis=0)), ("target", "", "", target.at(periods))]
    rows = []
    for curve, record, component, psa in curves:
        for period, value in zip(periods.tolist(), psa.tolist(), strict=True):
            rows.append((curve, record, component, period, value))
    return Table.of(SCALED, rows)


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
    curve: IdaCurve
    capacity: Capacity | None = None

    def run_values(self, name: str) -> Any:
        """Return an attribute of all runs, shape (runs,)."""
        return np.array([getattr(run, name) for run in self.curve.runs])


def ida_table(study: IdaStudy) -> Table:
    """Return the table of the results of an incremental dynamic analysis, with one row per run.

    The rows are in the order of the records, and of the intensity levels of each record from the
    lowest.
    """
    columns = (*_with_damage(IDA, study), *(IDA_ERRORS if study.checked else ()))
    return _with_unit(Table.of_results(columns, _curves(study)), study.measure.unit)


def capacity_table(study: IdaStudy) -> Table:
    """Return the table of the capacities of an incremental dynamic analysis, with one row per
    ground motion and drift threshold.

    A capacity is the lowest intensity that exceeds the threshold.

    The two horizontal components of a pair are one ground motion unless they count separately.
    """
    # The rule for the demand of a pair is a column only if the study has pairs.
    pair_demand = (replace(PAIR_DEMAND, value="study.pair_demand"),) if study.partners else ()
    columns = (*_with_damage(CAPACITIES, study), *pair_demand)
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
    """Return the table of fragility functions, with one row per function.

    The columns of the regression line, of failed runs and of the counts in bins are omitted if no
    function has these values.

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
    bin_counts = [function.counted.im.size for function in functions if function.counted]
    columns = [
        *(states if any(function.type for function in functions) else ()),
        *((FRAGILITY_DAMAGE,) if has_damage else ()),
        *FRAGILITY,
        *(CLOUD if any(function.cloud for function in functions) else ()),
        *(FAILED if has_failed_runs else ()),
        *((FRAGILITY_TOTAL,) if total else ()),
        # Each bin has len(_COUNTS) columns; bins that no function has are omitted.
        *COUNTED[: len(_COUNTS) * max(bin_counts, default=0)],
        *((PAIR_DEMAND,) if any(function.pair_demand for function in functions) else ()),
    ]
    return Table.of_results(columns, functions)


COMPARED = (
    Column("im", "text", "im", "intensity measure, as specified"),
    Column("unit", "text", "unit", "unit of the intensity measure"),
    Column("runs", "1", "runs", "number of completed runs in the regression"),
    Column(
        "left_out",
        "1",
        "left_out",
        "number of omitted runs: collapsed, without a result, or without the intensity measure",
    ),
    Column("slope", "1", "slope", "slope of the regression of ln drift ratio on ln IM"),
    Column(
        "slope_error",
        "1",
        "slope_error",
        "standard error of slope (jackknife over ground motions or events)",
    ),
    Column(
        "beta", "1", "beta", "efficiency: standard deviation of ln drift ratio about the regression"
    ),
    Column("proficiency", "1", "proficiency", "beta divided by slope"),
    Column("r_squared", "1", "r_squared", "squared correlation of the logarithms"),
)
DEPENDENCE = (
    Column(
        "characteristic",
        "text",
        "characteristic",
        "characteristic of the ground motions on which the residuals may depend",
    ),
    Column(
        "residual_slope",
        "1",
        "slope",
        "sufficiency: slope of the residuals as a function of the characteristic",
    ),
    Column(
        "p_value",
        "1",
        "p_value",
        "probability of a slope of this size if the residuals do not depend on the characteristic",
    ),
)


def comparison_of_measures(fits: Sequence[MeasureFit]) -> Table:
    """Return the table that compares intensity measures as predictors of the drift ratio.

    It has one row per intensity measure and characteristic of the ground motions, such as the
    magnitude, that may explain the residuals. Without characteristics, an intensity measure has a
    single row with empty cells at the end.
    """
    rows: list[tuple[Cell, ...]] = []
    for fit in fits:
        fit_cells = tuple(column.of(fit) for column in COMPARED)
        for dependence in fit.dependences:
            rows.append((*fit_cells, *(column.of(dependence) for column in DEPENDENCE)))
        if not fit.dependences:
            rows.append((*fit_cells, *(None for _ in DEPENDENCE)))
    return Table.of((*COMPARED, *DEPENDENCE), rows)


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
    return replace(table, meanings=table.meanings | units)


def motion_rows(study: IdaStudy) -> Iterator[tuple[str, str, IdaCurve]]:
    """Yield the file, the names of the components (`HNE+HNN` for a pair) and the IDA curve of each
    ground motion, as in the table of capacities."""
    for row in _motion_curves(study):
        yield row.record, row.component, row.curve


def _motion_curves(study: IdaStudy) -> Iterator[_CurveRows]:
    """Yield the IDA curve of each ground motion with its file and component.

    A pair that counts as a single ground motion has the file name of its first component and the
    names of both components.
    """
    # Curves are identified by `id`, because they contain arrays, which have no hash.
    rows = {id(row.curve): row for row in _curves(study)}
    for curve in study.motion_curves:
        if isinstance(curve, PairCurve):
            component_rows = [rows[id(part)] for part in curve.parts]
            component = "+".join(row.component for row in component_rows)
            yield replace(component_rows[0], component=component, curve=curve)
        else:
            yield rows[id(curve)]


def _curves(study: IdaStudy) -> Iterator[_CurveRows]:
    """Yield the IDA curve of each component, with its file and the name of the component."""
    # A single call for all curves makes the names distinct over all initial damages.
    names = component_names([curve.record for curve in study.curves])
    for curve, name in zip(study.curves, names, strict=True):
        yield _CurveRows(curve.record.source, name, study, curve)
