"""Fragility functions of a table: selection of the fit by the columns, and preparation of the data.

A table of stripes has the columns `im,collapses,records`, a table of capacities
`capacity[,censored]`, a cloud `im,edp[,censored]`. The tables of `tdint ida` and of campaigns are
supported also. The columns `threshold`, `im_name` and `unit` are optional.
"""

from __future__ import annotations

import math
from array import array
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from tdint.analysis.arguments import between, numbers_of
from tdint.arrays import Array
from tdint.campaign.fragility.fits import (
    CLOUD,
    FITS,
    IDA,
    SAME_LEVEL,
    SELDOM,
    STRIPES,
    Fragility,
    extrapolated,
    fit_at_threshold,
    fit_capacities,
    fit_cloud,
    fit_stripes,
    levels_of,
)
from tdint.campaign.fragility.measures import (
    RunIntensities,
    RunMeasure,
    column_of,
    measure_named,
    motions_of,
    of_pairs,
    over_motions,
    period_beside,
    rows_of_motions,
    stated_motions,
    with_measures,
)
from tdint.campaign.fragility.runs import (
    BuildingDamage,
    building_damages,
    by_motion,
    exceedance,
    places_of_motions,
)
from tdint.campaign.pairs import PairRule
from tdint.campaign.store import check_chunks, open_existing
from tdint.csv_table import CsvTable, read_table
from tdint.errors import AnalysisError, ModelError, UsageError
from tdint.files import is_file, is_folder
from tdint.model.damage_states import DONE, FALLEN, DamageStates
from tdint.number_parsing import pluralize
from tdint.tabular import Tabular
from tdint.units import ACCELERATION, suffix

NEEDS = (
    "a table has the columns im,collapses,records (stripes), capacity[,censored] (ida) or "
    "im,edp[,censored] (cloud), or is one of tdint ida or tdint campaign"
)
EVERY_DEMAND = (0.0, math.inf)
_MIN_RUNS_PER_LEVEL = 3
"""Minimum number of runs at each intensity level of stripes. For functions by type, the minimum
number of ground motions."""


_NO_COMMON_LEVELS = "the runs have no common intensity levels; use --fit cloud, or another --im"


@dataclass(frozen=True)
class FragilityRequest:
    """Settings of the fits to a table.

    Attributes
    ----------
    fit : str or None
        `stripes`, `ida` or `cloud`; default is the fit that suits the columns of the table.
    thresholds : tuple of float
        Demands for which the exceedance is computed; default are the thresholds of the table.
    edp_range : tuple of two floats
        For a cloud: smaller demands are omitted, larger demands are known only to be above the
        upper limit.
    modeling_dispersion : float
        Dispersion due to the uncertainty of the model.
    measure : str or None
        Intensity measure of runs, as in `measures.run_measure`, or its column without the unit;
        default Sa(T1).
    states : tuple of str
        Names of the states of the thresholds in ascending order; default ds1, ds2, ...
    pair_demand : str or None
        Rule by which the components of pairs are combined (`tdint.campaign.pairs`); default is the
        rule of the study in the same directory, otherwise the larger demand.
    """

    fit: str | None = None
    thresholds: tuple[float, ...] = ()
    edp_range: tuple[float, float] = EVERY_DEMAND
    modeling_dispersion: float = 0.0
    measure: str | None = None
    states: tuple[str, ...] = ()
    pair_demand: str | None = None


@dataclass(frozen=True, repr=False)
class FragilityResult(Tabular):
    """Fitted functions, reasons why other functions cannot be fitted, warnings and notes.

    Attributes
    ----------
    functions : tuple of Fragility
        Fitted functions.
    failures : tuple of AnalysisError
        Reasons why other functions cannot be fitted.
    warnings : tuple of str
        Warnings that affect the meaning of the functions.
    notes : tuple of str
        Information for the user.
    """

    functions: tuple[Fragility, ...]
    failures: tuple[AnalysisError, ...] = ()
    warnings: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()

    @property
    def disagreements(self) -> list[str]:
        """Messages about differences that exceed the scatter, and about extrapolated medians."""
        return [
            *(text for fit in self.functions if (text := fit.disagreement)),
            *extrapolated(self.functions),
        ]

    @classmethod
    def of(cls, results: Iterable[Fragility | AnalysisError], *warnings: str) -> Self:
        """Return the result of several fits.

        Parameters
        ----------
        results : iterable of Fragility or AnalysisError
            Fitted functions, and errors of fits that failed.
        warnings : str
            Warnings about the data.
        """
        fits = list(results)
        functions = tuple(fit for fit in fits if isinstance(fit, Fragility))
        failures = tuple(fit for fit in fits if isinstance(fit, AnalysisError))
        return cls(functions, failures, warnings)

    def _headline(self) -> str:
        medians = ", ".join(
            f"{function.theta:.4g} {function.unit}".rstrip() for function in self.functions
        )
        return f"of {pluralize(len(self.functions), 'function')}, medians {medians}"


def fragility(
    source: str | Path,
    thresholds: float | Sequence[float] = (),
    *,
    fit: str | None = None,
    edp_range: tuple[float, float] = EVERY_DEMAND,
    modeling_dispersion: float = 0.0,
    measure: str | None = None,
) -> FragilityResult:
    """Fit lognormal fragility functions to a CSV table, or to a study.

    A study is a directory of `tdint ida` or `tdint campaign`. For arrays in memory, use
    `fit_stripes`, `fit_capacities` or `fit_cloud`.

    Parameters
    ----------
    source : str or Path
        Table or directory.
    thresholds : float or sequence of float
        Demands (drift ratios) for which the exceedance is computed; default are the thresholds of
        the table.
    fit, edp_range, modeling_dispersion, measure : optional
        As in `FragilityRequest`.

    Returns
    -------
    FragilityResult
        Functions, reasons why other functions cannot be fitted, and messages.

    Raises
    ------
    UsageError, ModelError
        As in `fit_table`.
    AnalysisError
        No function can be fitted.
    """
    demands = tuple(numbers_of(thresholds, "thresholds").tolist())
    modeling_dispersion = between(modeling_dispersion, "modeling_dispersion")
    result = fit_table(
        str(source), FragilityRequest(fit, demands, edp_range, modeling_dispersion, measure)
    )
    if not result.functions:
        raise result.failures[0]
    return result


def fit_table(source: str, request: FragilityRequest) -> FragilityResult:
    """Fit fragility functions to a table, or to a study (see `fragility`).

    Raises
    ------
    UsageError
        The fit does not suit the table, or a threshold is missing.
    ModelError
        The table cannot be read or contains invalid values.
    """
    if request.fit is not None and request.fit not in FITS:
        raise UsageError(f"the fit must be one of {', '.join(FITS)}, got {request.fit!r}")
    # In a directory, select the table that suits the fit. Except for stripes, the capacities that a
    # study has computed are preferred to its runs.
    folder, file = Path(source), source
    if source != "-" and is_folder(folder):
        has_ida = request.fit == CLOUD and is_file(folder / "ida.csv")
        names = (
            ["runs.csv"]
            if request.fit == STRIPES
            else ["ida.csv"]
            if has_ida
            else ["capacities.csv", "runs.csv"]
        )
        path = next((folder / name for name in names if is_file(folder / name)), None)
        if path is None:
            raise ModelError(
                f"{source}: this directory contains no {' and no '.join(names)} written by "
                "tdint ida or tdint campaign"
            )
        file = str(path)
    table = read_table(file, NEEDS)
    table = with_measures(table) if request.measure else table
    # Determine the possible types of the table from its columns.
    types = [
        table_type
        for table_type in (_STRIPES, _CAPACITIES, _CLOUD, _STUDY_RUNS)
        if table.has(*table_type.columns)
    ]
    if not types:
        raise ModelError(
            f"{table.source}:1: {NEEDS}; its columns are {', '.join(table.header)[:200]}"
        )
    # The requested fit must select a single type; an ambiguous table is an error.
    suited = [table_type for table_type in types if request.fit in (None, *table_type.fits)]
    if not suited:
        possible = " or ".join(dict.fromkeys(fit for item in types for fit in item.fits))
        raise UsageError(f"{table.source}: this table is for --fit {possible}, not {request.fit}")
    if len(suited) > 1:
        columns = " and ".join(",".join(item.columns) for item in suited)
        fits = " or ".join(f"--fit {item.fits[0]}" for item in suited)
        raise UsageError(
            f"{table.source}:1: the table has the columns of two types, {columns}; specify {fits}"
        )
    # The dispersion of the model is not fitted; it is an attribute of each function.
    result = suited[0].fit(table, request)
    functions = [
        replace(function, modeling_dispersion=request.modeling_dispersion)
        for function in result.functions
    ]
    return replace(result, functions=tuple(functions))


def _fit_stripes(table: CsvTable, request: FragilityRequest) -> FragilityResult:
    """Fit a function to the numbers of collapses (or exceedances) at each intensity level."""
    im, hits, total = (np.array(table.numbers(name)) for name in ("im", "collapses", "records"))
    table.check("im", im > 0.0, "must be positive")
    table.check("records", total > 0.0, "must be positive")
    for name, counts in (("records", total), ("collapses", hits)):
        table.check(name, counts == np.floor(counts), "must be a whole number")
    table.check(
        "collapses", (hits >= 0.0) & (hits <= total), "must be from 0 to the number of records"
    )

    # The counts are stored with the function, for figures and for the test of its shape.
    def fit(chosen: NDArray[np.bool_]) -> Fragility:
        levels, all_runs = im[chosen], total[chosen]
        share = np.sum(hits[chosen]) / np.sum(total[chosen])
        function = fit_stripes(levels, hits[chosen], all_runs)
        counted = function.beside_counts(levels, hits[chosen] / all_runs, runs=all_runs)
        # `beside_counts` removes the covariance if the median is outside the levels. Restore it if
        # the fraction of exceedances is large enough for a reliable median.
        return (
            replace(counted, covariance=function.covariance)
            if SELDOM <= share <= 1.0 - SELDOM
            else counted
        )

    functions = _by_threshold(table, request, fit)
    return FragilityResult.of(functions)


def _fit_capacities(table: CsvTable, request: FragilityRequest) -> FragilityResult:
    """Fit functions to the capacities of an incremental dynamic analysis, for each state of
    previous damage and each threshold."""
    # A row without a capacity contains no information, not even that the building did not collapse.
    # It is omitted with a warning.
    capacity = np.array(table.numbers("capacity", empty=True, positive=True))
    censored = np.array(table.truths("censored"))
    finite = np.isfinite(capacity)
    # If the table specifies previous damage, each state is fitted separately to its rows.
    states = [(math.nan, finite)]
    if table.has("damage"):
        damage = np.array(table.numbers("damage"))
        states = [(value, finite & (damage == value)) for value in np.unique(damage).tolist()]
    functions: list[Fragility | AnalysisError] = []
    motion = stated_motions(table)
    for state, rows in states:

        def fit(chosen: NDArray[np.bool_], rows: NDArray[np.bool_] = rows) -> Fragility:
            used = chosen & rows
            # If each ground motion has one capacity, the capacities are independent, and the fit
            # provides their errors. If a motion occurs repeatedly, a jackknife over motions is
            # used.
            repeated = motion is not None and np.unique(motion[used]).size < np.sum(used)
            (function,) = over_motions(
                lambda kept: [fit_capacities(capacity[kept], censored[kept].tolist())],
                used,
                motion if repeated else None,
            )
            assert isinstance(function, Fragility)
            if motion is not None:
                function = replace(function, motions=np.unique(motion[used]).size)
            # All capacities that are not censored are exceedances.
            return function.within(capacity[used], min(0.5, 1.0 - float(np.mean(censored[used]))))

        for function in _by_threshold(table, request, fit):
            if isinstance(function, Fragility):
                functions.append(replace(function, damage=state))
            else:
                functions.append(
                    function
                    if math.isnan(state)
                    else AnalysisError(f"damage {state:g}: {function}")
                )
    omitted = int(np.sum(~finite))
    warnings = (
        (f"{table.source}: omitted {pluralize(omitted, 'row')} without a capacity",)
        if omitted
        else ()
    )
    # The capacities were computed with the rule for pairs of components that the table states. They
    # cannot be used for another rule.
    if table.has("pair_demand"):
        stated = table.only("pair_demand")
        if request.pair_demand not in (None, stated):
            raise UsageError(
                f"{table.source}: its capacities were computed with pair_demand {stated}; run "
                f"`tdint ida` again with --pair-demand {request.pair_demand}"
            )
        functions = [
            replace(function, pair_demand=stated) if isinstance(function, Fragility) else function
            for function in functions
        ]
    return FragilityResult.of(functions, *warnings)


def _fit_cloud(table: CsvTable, request: FragilityRequest) -> FragilityResult:
    """Fit functions to pairs of intensity and demand."""
    im, edp = (np.array(table.numbers(name, positive=True)) for name in ("im", "edp"))
    return _cloud(
        table, request, im, edp, np.array(table.truths("censored")), motion=stated_motions(table)
    )


def _fit_runs(table: CsvTable, request: FragilityRequest) -> FragilityResult:
    """Fit stripes or a cloud to the runs of a study.

    Runs without a result count neither as exceedance nor as non-exceedance.
    """
    runs = _runs_of(table, request)
    result = _fit_known_runs(table, request, runs)
    if not runs.pairs.pairs:
        return result
    functions = (replace(item, pair_demand=runs.pairs.demand_if_pairs) for item in result.functions)
    notes = () if request.pair_demand else (runs.pairs.note(),)
    return replace(result, functions=tuple(functions), notes=(*result.notes, *notes))


def _fit_known_runs(table: CsvTable, request: FragilityRequest, runs: _Runs) -> FragilityResult:
    """Fit stripes if each level has enough runs, otherwise a cloud; or as requested.

    Parameters
    ----------
    table : CsvTable
        Table of the runs.
    request : FragilityRequest
        Settings.
    runs : _Runs
        Runs of the table.
    """
    stripes = [runs.result & (runs.level == level) for level in np.unique(runs.level[runs.result])]
    in_stripes = all(np.sum(stripe) >= _MIN_RUNS_PER_LEVEL for stripe in stripes)
    fit = request.fit or (STRIPES if in_stripes else CLOUD)
    # If the intensities of all runs differ, each run would be a separate stripe.
    if fit == STRIPES and not in_stripes:
        raise UsageError(f"{table.source}: {_NO_COMMON_LEVELS}")
    _check_thresholds(table, request)
    lost = int(np.sum(~runs.result))
    omitted = (
        f"{table.source}: {lost} of {lost + int(np.sum(runs.result))} runs have no result and are "
        "omitted"
    )
    if fit == CLOUD:
        # A collapse exceeds every threshold. Its demand is not used, because the drift at which the
        # run was stopped depends on the method.
        used = runs.result
        drift = np.where(runs.collapsed, max(request.thresholds), runs.drift)[used]
        im, collapsed, motion = runs.im[used], runs.collapsed[used], runs.motion[used]
        result = _cloud(table, request, im, drift, collapsed, runs.names, motion)
        functions = tuple(replace(item, failed=lost) for item in result.functions)
        return replace(result, functions=functions, warnings=(omitted,) if lost else ())
    fitted = [
        fit_at_threshold(drift, runs.names, partial(_fit_with_bounds, runs, drift))
        for drift in request.thresholds
    ]
    biased = (
        "which biases the fits; the bounds are the fits that count all of these runs as exceeding, "
        "or none of them"
    )
    return FragilityResult.of(fitted, *((f"{omitted}, {biased}",) if lost else ()))


@dataclass(frozen=True)
class _Runs:
    """Runs of a study; all arrays have the shape (n,).

    Attributes
    ----------
    im, level : ndarray
        Intensity, and index of its level.
    drift : ndarray
        Maximum drift ratio.
    collapsed, result : ndarray of bool
        True if the building collapsed, and if the run has a result.
    motion : ndarray of int
        Ground motion.
    names : tuple of str
        Name and unit of the intensity measure.
    pairs : PairRule
        Rule by which the components of pairs were combined.
    """

    im: Array
    level: NDArray[np.intp]
    drift: Array
    collapsed: NDArray[np.bool_]
    result: NDArray[np.bool_]
    motion: NDArray[np.intp]
    names: tuple[str, str]
    pairs: PairRule


def _runs_of(table: CsvTable, request: FragilityRequest) -> _Runs:
    """Return the runs of a table, with the components of pairs combined."""
    try:
        table.only("building")
    except ModelError as error:
        raise ModelError(
            f"{error}, or fit functions of each building of a campaign's directory with "
            "--by building"
        ) from None
    status = np.array(table.texts("status"))
    drift = np.array(table.numbers("peak_drift_ratio", empty=True))

    # By default the intensity is the column `im` of the table, otherwise Sa(T1).
    if request.measure is None and table.has("im"):
        column, name, unit = "im", table.only("im_name"), table.only("unit")
    else:
        measure = measure_named(request.measure or "sa")
        name = measure.label(period_beside(table))
        if request.measure is None and not any(
            table.has(f"{measure.column}{suffix(unit)}") for unit in ACCELERATION
        ):
            # No unit of this measure is a column of the table. Reading the column below raises an
            # error that names it.
            column, unit = f"{measure.column}{suffix('m/s^2')}", "m/s^2"
        else:
            column, unit = column_of(table, measure.column)
    im = np.array(table.numbers(column, empty=True))
    motion, collapsed = motions_of(table), np.isin(status, FALLEN)
    known = collapsed | (status == DONE)

    # Combine the runs under a pair at a level into one run, by the rule for pairs.
    rule, groups = rows_of_motions(table, request.pair_demand)
    if len(groups) < len(table.rows):
        im = np.array([float(np.prod(im[group])) ** (1.0 / len(group)) for group in groups])
        drift = np.array([rule.combine(drift[group]) for group in groups])
        known = np.array([np.all(known[group]) for group in groups])
        collapsed = np.array([np.any(collapsed[group]) for group in groups])
        motion = motion[[group[0] for group in groups]]
    elif column != "im":
        im = of_pairs(table, im)

    # Omit runs without an intensity. Runs without a drift ratio have no result.
    positive = im > 0.0
    result = known & (drift > 0.0) & positive
    if not result.any():
        raise ModelError(f"{table.source}: no run has a result")
    im, drift, motion = im[positive], drift[positive], motion[positive]
    collapsed, result = collapsed[positive], result[positive]
    return _Runs(im, levels_of(im), drift, collapsed, result, motion, (name, unit), rule)


def _fit_with_bounds(runs: _Runs, threshold: float) -> Fragility:
    """Return the fit of the runs with a result, with bounds for the runs without a result."""
    exceeds = runs.collapsed | (runs.drift > threshold)
    used = runs.result
    (function,) = over_motions(lambda kept: [_stripes(runs, exceeds, kept)], used, runs.motion)
    assert isinstance(function, Fragility)
    function = function.beside_counts(
        runs.im[used], exceeds[used].astype(float), motion=runs.motion[used]
    )
    lost = int(np.sum(~runs.result))
    # The bounds assume that all failed runs exceed the threshold, and that none of them does.
    if not lost:
        return function
    all_runs = np.ones_like(runs.result)
    # A fit can be impossible, for example if all runs exceed; then the bound is unknown.
    bounds: list[Fragility | None] = []
    for counted in (exceeds | ~runs.result, exceeds & runs.result):
        try:
            bounds.append(_stripes(runs, counted, all_runs))
        except AnalysisError:
            bounds.append(None)
    return replace(function, failed=lost, bounds=(bounds[0], bounds[1]))


def _stripes(runs: _Runs, exceeds: NDArray[np.bool_], used: NDArray[np.bool_]) -> Fragility:
    """Fit stripes to runs; `exceeds` marks runs above the threshold, `used` the runs to use."""
    stripes = [used & (runs.level == level) for level in np.unique(runs.level[used])]
    # Intensities within a level differ by rounding errors only. Their geometric mean is used.
    intensities = [float(np.exp(np.mean(np.log(runs.im[stripe])))) for stripe in stripes]
    return fit_stripes(
        intensities,
        [int(np.sum(exceeds[stripe])) for stripe in stripes],
        [int(np.sum(stripe)) for stripe in stripes],
    )


def _cloud(
    table: CsvTable,
    request: FragilityRequest,
    im: Array,
    edp: Array,
    censored: NDArray[np.bool_],
    names: tuple[str, str] | None = None,
    motion: NDArray[np.intp] | None = None,
) -> FragilityResult:
    """Return the functions of a cloud, or the reason why it cannot be fitted.

    Parameters
    ----------
    table : CsvTable
        Table with the observations.
    request : FragilityRequest
        Settings.
    im, edp : ndarray, shape (n,)
        Intensities and demands.
    censored : ndarray of bool, shape (n,)
        True for demands known only to be above their value.
    names : tuple of str, optional
        Name and unit of the intensity measure; default are the columns `im_name` and `unit`.
    motion : ndarray of int, shape (n,), optional
        Ground motion of each row; by default all rows are independent.
    """
    _check_thresholds(table, request)
    # Demands below the requested range are elastic and omitted. Demands above it are censored.
    low, high = request.edp_range
    kept = edp >= low
    # It is unknown whether a demand censored below the threshold exceeds the threshold.
    known = [kept & ~(censored & (edp < threshold)) for threshold in request.thresholds]
    exceeds = [((edp > threshold) | censored).astype(float) for threshold in request.thresholds]
    censored = censored | (edp >= high)
    im_name, unit = names or (table.only("im_name"), table.only("unit"))

    def fit(used: NDArray[np.bool_]) -> list[Fragility | AnalysisError]:
        demands = np.minimum(edp, high)[used]
        return [*fit_cloud(im[used], demands, request.thresholds, censored[used])]

    try:
        functions = [
            item for item in over_motions(fit, kept, motion) if isinstance(item, Fragility)
        ]
    except AnalysisError as error:
        return FragilityResult((), (error,))
    # Add counts of the runs for which exceedance of the threshold is known.
    counted = [
        function.beside_counts(
            im[used], exceeding[used], motion=None if motion is None else motion[used]
        )
        for function, used, exceeding in zip(functions, known, exceeds, strict=True)
    ]
    return FragilityResult(tuple(fit.named(fit.threshold, im_name, unit) for fit in counted))


def _by_threshold(
    table: CsvTable, request: FragilityRequest, fit: Callable[[NDArray[np.bool_]], Fragility]
) -> list[Fragility | AnalysisError]:
    """Return a fit for each requested threshold of the table.

    If the table has no column of thresholds, all rows are used.
    """
    names = (table.only("im_name"), table.only("unit"))
    # Without the column, all rows refer to the same threshold.
    if not table.has("threshold"):
        if len(request.thresholds) > 1:
            raise UsageError(
                f"{table.source}: has no column threshold, so at most one --threshold can be "
                "specified"
            )
        all_rows = np.ones(len(table.rows), bool)
        return [
            fit_at_threshold(next(iter(request.thresholds), math.nan), names, lambda: fit(all_rows))
        ]
    # Compare thresholds with a tolerance, because numbers in a table are rounded.
    thresholds = np.array(table.numbers("threshold", empty=True))
    available = list(dict.fromkeys(thresholds[np.isfinite(thresholds)].tolist()))
    if not available:
        raise ModelError(
            f"{table.source}: no row has a threshold; add thresholds or remove the column"
        )
    functions = []
    for threshold in request.thresholds or available:
        rows = np.isclose(thresholds, threshold, rtol=SAME_LEVEL, atol=0.0)
        if not rows.any():
            listed = ", ".join(f"{drift:g}" for drift in available)
            raise UsageError(
                f"{table.source}: threshold {threshold:g} not found; its thresholds are {listed}"
            )
        functions.append(fit_at_threshold(threshold, names, partial(fit, rows)))
    return functions


def _check_thresholds(table: CsvTable, request: FragilityRequest) -> None:
    """Raise UsageError if no threshold is specified."""
    if not request.thresholds:
        raise UsageError(f"{table.source}: a demand threshold is required; specify --threshold")


@dataclass(frozen=True)
class _Kind:
    """Type of table.

    Attributes
    ----------
    columns : tuple of str
        Columns that identify the type.
    fits : tuple of str
        Possible fits, the default first.
    fit : callable
        Function that fits a table of this type.
    """

    columns: tuple[str, ...]
    fits: tuple[str, ...]
    fit: Callable[[CsvTable, FragilityRequest], FragilityResult]


_STRIPES = _Kind(("im", "collapses", "records"), (STRIPES,), _fit_stripes)
_CAPACITIES = _Kind(("capacity",), (IDA,), _fit_capacities)
_CLOUD = _Kind(("im", "edp"), (CLOUD,), _fit_cloud)
_STUDY_RUNS = _Kind(("status", "peak_drift_ratio"), (STRIPES, CLOUD), _fit_runs)


# ---- Fragility functions of a campaign: one function for each building type (or building) and
# damage state
#
# A run that ends with a collapse exceeds all states. Its demand is known only to be above the
# heaviest state, regardless of the drift at which the run was stopped. The dispersion of the
# thresholds is part of beta: stripes count probabilities of exceedance, and a cloud uses each run
# with several thresholds that have this dispersion.

_SAME_PERIOD = 1e-6  # relative difference; tables are written with at least six digits
# Three equally likely points with mean 0 and variance 1, which represent a normal distribution.
# With 20 points, losses differ by less than 1 %.
_THREE_POINTS = math.sqrt(1.5) * np.array([-1.0, 0.0, 1.0])


@dataclass(frozen=True)
class TypeRuns:
    """Runs of a type that have a result; all arrays have the shape (runs,).

    Attributes
    ----------
    states : DamageStates
        Damage states of the type.
    im, demand : ndarray
        Intensity, and demand of the damage states, SI units. After a collapse, the demand is the
        median of the heaviest state.
    fallen : ndarray of bool
        True if the building collapsed.
    motion : ndarray of int
        Ground motion, or event of ground motion fields.
    failed : int
        Number of runs without a result.
    name, unit : str
        Name and unit of the intensity measure.
    """

    states: DamageStates
    im: Array
    demand: Array
    fallen: NDArray[np.bool_]
    motion: NDArray[np.intp]
    failed: int
    name: str
    unit: str


TYPE, BUILDING = "type", "building"
BY = (TYPE, BUILDING)
"""Groups of runs for which functions of a campaign can be fitted."""


def fit_types(folder: Path, request: FragilityRequest, by: str = TYPE) -> FragilityResult:
    """Fit a function for each building type (or building) and damage state of a campaign.

    For functions by building, the states can be thresholds of the maximum drift ratio.

    Parameters
    ----------
    folder : Path
        Directory of the campaign.
    request : FragilityRequest
        Settings.
    by : str
        One of `BY`; default by type.

    Raises
    ------
    UsageError
        The directory contains no campaign, or the campaign has no damage states; a fit or a
        threshold does not suit it; or the runs have no such measure.
    OutputError
        The store cannot be read.
    """
    # The damage states of a campaign depend on the building type, whereas a threshold would apply
    # to all types.
    if request.thresholds and by == TYPE:
        raise UsageError(
            "functions by type use the damage states of the campaign: remove --threshold"
        )
    if request.fit == IDA:
        raise UsageError(f"functions by {by} are fitted to runs: use --fit stripes or --fit cloud")
    measure = measure_named(request.measure or "sa")
    # Thresholds of the maximum drift ratio are states of all buildings.
    medians = tuple(sorted(request.thresholds))
    names = request.states or tuple(f"ds{number}" for number in range(1, len(medians) + 1))
    if medians and len(names) != len(medians):
        raise UsageError(
            f"{pluralize(len(medians), 'threshold')}: --states requires the same number of names, "
            f"got {len(names)}"
        )
    requested_states = DamageStates("drift_ratio", names, medians) if medians else None
    # Read the store one time, building by building. The fits follow after it is closed.
    with open_existing(folder) as store:
        check_chunks(store)
        if not (store.damage() or requested_states):
            remedy = "add `damage` to its file and run it again"
            more = ", or specify --threshold" if by == BUILDING else ""
            raise UsageError(f"{folder}: this campaign has no damage states; {remedy}{more}")
        intensities = RunIntensities(store, folder, measure, request.pair_demand)
        # Correlated runs form one ground motion: the components of a recording, or, for ground
        # motion fields, the runs of an event, which the store numbers as samples.
        rule = store.pair_rule()
        if request.pair_demand:
            rule = replace(rule, demand=request.pair_demand)
        motions = {} if store.events() else rule.recordings
        groups: dict[str, _Gathered] = {}
        for damage in building_damages(store, requested_states):
            name = damage.type if by == TYPE else damage.building
            groups.setdefault(name, _Gathered(damage.states)).add(
                damage, intensities.of(damage), motions, rule
            )
        runs_by_name = {
            name: groups[name].runs(measure, intensities.unit) for name in sorted(groups)
        }
    # A fit that is impossible is reported with its type and state; the other fits are returned.
    fitted = [
        AnalysisError(f"{name}, {state}: {function}")
        if isinstance(function, AnalysisError)
        else replace(
            function, type=name, state=state, modeling_dispersion=request.modeling_dispersion
        )
        for name, runs in runs_by_name.items()
        for state, function in zip(runs.states.states, _fitted(runs, request), strict=True)
    ]
    lost = sum(runs.failed for runs in runs_by_name.values())
    warnings = (f"{folder}: omitted {pluralize(lost, 'run')} without a result",) if lost else ()
    notes: tuple[str, ...] = (intensities.note,) if intensities.note else ()
    if rule.pairs and not request.pair_demand:
        notes += (rule.note(),)
    fitted = [
        item if isinstance(item, AnalysisError) else replace(item, pair_demand=rule.demand_if_pairs)
        for item in fitted
    ]
    return replace(FragilityResult.of(fitted, *warnings), notes=notes)


@dataclass
class _Gathered:
    """Runs of a type, collected building by building in contiguous arrays."""

    states: DamageStates
    failed: int = 0
    periods: tuple[float, float] = (math.inf, 0.0)
    im: array[float] = field(default_factory=lambda: array("d"))
    demand: array[float] = field(default_factory=lambda: array("d"))
    fallen: array[int] = field(default_factory=lambda: array("b"))
    motion: array[int] = field(default_factory=lambda: array("q"))

    def add(
        self, building: BuildingDamage, im: Array, motions: Mapping[int, int], rule: PairRule
    ) -> None:
        """Add the runs of a building, or its ground motions if components of pairs are combined.

        Parameters
        ----------
        of_runs : BuildingDamage
            Damage of the building after each run.
        im : ndarray, shape (runs,)
            Intensities.
        motions : mapping
            Ground motion of each record; empty for ground motion fields.
        rule : PairRule
            Rule by which the components of pairs are combined.
        """
        damage = by_motion(building, rule)
        # If components were combined, use the intensity of the first component of each pair.
        if damage is not building:
            im = im[[group[0] for group in places_of_motions(building, rule)]]
        used = damage.known & (im > 0.0)
        fallen = np.isin(damage.status, FALLEN)
        motion = np.array(
            [motions[record] if motions else sample for record, _, sample in damage.keys], np.int64
        )
        demand = np.where(fallen, damage.states.medians[-1], damage.demand)
        columns = (
            (self.im, im),
            (self.demand, demand),
            (self.fallen, fallen.astype(np.int8)),
            (self.motion, motion),
        )
        for column, values in columns:
            column.frombytes(values[used].tobytes())
        self.failed += int(np.sum(~damage.known))
        shortest, longest = self.periods
        self.periods = min(shortest, damage.period), max(longest, damage.period)

    def runs(self, measure: RunMeasure, unit: str) -> TypeRuns:
        """Return all runs as arrays."""
        first, last = self.periods
        common = 0.0 < last < math.inf and last - first <= _SAME_PERIOD * first
        im, demand = np.frombuffer(self.im, np.float64), np.frombuffer(self.demand, np.float64)
        fallen, motion = (
            np.frombuffer(self.fallen, np.int8).astype(bool),
            np.frombuffer(self.motion, np.int64),
        )
        name = measure.label(first if common else None)
        return TypeRuns(self.states, im, demand, fallen, motion, self.failed, name, unit)


def _fitted(runs: TypeRuns, request: FragilityRequest) -> list[Fragility | AnalysisError]:
    """Return the function of each state, or the error that prevents it."""
    if not runs.im.size:
        return [AnalysisError("no run has a result") for _ in runs.states.states]
    # Stripes require enough ground motions at every level, for all buildings of a type together.
    level = levels_of(runs.im)
    motions_at_level = np.bincount(np.unique(np.column_stack([level, runs.motion]), axis=0)[:, 0])
    stripes = motions_at_level.size > 1 and int(motions_at_level.min()) >= _MIN_RUNS_PER_LEVEL
    if request.fit == STRIPES and not stripes:
        raise UsageError(_NO_COMMON_LEVELS)
    chosen = request.fit or (STRIPES if stripes else CLOUD)

    def fit(used: NDArray[np.bool_]) -> list[Fragility | AnalysisError]:
        if chosen == STRIPES:
            return _type_stripes(runs, level, used)
        return _type_cloud(runs, request, used)

    functions = over_motions(fit, np.ones(runs.im.size, bool), runs.motion)
    return [
        function
        if isinstance(function, AnalysisError)
        else replace(
            function.named(median, runs.name, runs.unit), failed=runs.failed
        ).beside_counts(runs.im, exceeds, motion=runs.motion)
        for function, median, exceeds in zip(
            functions, runs.states.medians, _exceedance_probabilities(runs).T, strict=True
        )
    ]


def _exceedance_probabilities(runs: TypeRuns) -> Array:
    """Return the probability that each run reaches or exceeds each state, shape (runs, states).

    The probability is 1 after a collapse.
    """
    return np.where(runs.fallen[:, np.newaxis], 1.0, exceedance(runs.states, runs.demand))


def _type_stripes(
    runs: TypeRuns, level: NDArray[np.intp], used: NDArray[np.bool_]
) -> list[Fragility | AnalysisError]:
    """Fit each state to probabilities of exceedance at intensity levels."""
    # Renumber the levels that contain a selected run.
    level_number = np.unique(level[used], return_inverse=True)[1]
    total = np.bincount(level_number).astype(float)
    im = np.exp(np.bincount(level_number, np.log(runs.im[used])) / total)
    functions: list[Fragility | AnalysisError] = []
    for probabilities in _exceedance_probabilities(runs)[used].T:
        # The sum of probabilities may exceed the number of runs by rounding errors.
        count = np.minimum(np.bincount(level_number, probabilities), total)
        try:
            functions.append(fit_stripes(im, count, total))
        except AnalysisError as error:
            functions.append(error)
    return functions


def _type_cloud(
    runs: TypeRuns, request: FragilityRequest, used: NDArray[np.bool_]
) -> list[Fragility | AnalysisError]:
    """Fit each state to a line through the demands.

    The demands of collapses are known only to be above the heaviest state. For the states of a
    campaign, each run is used with three equally likely thresholds that have their dispersion. A
    collapse exceeds all of them. Demands above the heaviest state and below the lightest state are
    censored. For requested thresholds the demands are not censored, so that a function does not
    depend on the other thresholds.
    """
    # A demand of zero has no logarithm, and demands below the range are elastic.
    low, high = request.edp_range
    kept = used & (runs.demand >= low) & (runs.demand > 0.0)
    im, demand, fallen = runs.im[kept], np.minimum(runs.demand, high)[kept], runs.fallen[kept]
    lightest, heaviest = (
        (0.0, math.inf) if request.thresholds else (runs.states.medians[0], runs.states.medians[-1])
    )
    limited = fallen | (demand >= high)
    # Dividing a threshold by a factor is equivalent to multiplying the demand by it: each demand is
    # used three times, with factors that represent the dispersion of the thresholds.
    scattered = (
        np.where(fallen[:, np.newaxis], 1.0, np.exp(runs.states.dispersion * _THREE_POINTS))
        * demand[:, np.newaxis]
    )
    above = limited[:, np.newaxis] | (scattered >= heaviest)
    repeated_im = np.repeat(im, _THREE_POINTS.size)
    limited_demand = np.minimum(scattered, heaviest).ravel()
    try:
        functions = fit_cloud(
            repeated_im,
            limited_demand,
            runs.states.medians,
            above.ravel(),
            lower_threshold=lightest,
        )
    except AnalysisError as error:
        return [error for _ in runs.states.states]
    # Figures show the demands, not the three values per demand.
    below = ~limited & (demand < lightest)
    counts: dict[str, Any] = {"runs": im.size, "censored": int(np.sum(limited))}
    points: dict[str, Any] = {"im": im, "edp": demand, "censored": limited, "below": below}
    return [
        replace(function, cloud=function.cloud and replace(function.cloud, **points), **counts)
        for function in functions
    ]
