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
_LEAST_STRIPE = 3  # minimum number of runs at a level; for functions by type, of ground motions


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
        every = list(results)
        functions = tuple(fit for fit in every if isinstance(fit, Fragility))
        return cls(
            functions, tuple(fit for fit in every if isinstance(fit, AnalysisError)), warnings
        )

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
    kinds = [kind for kind in (_STRIPES, _CAPACITIES, _CLOUD, _OF_RUNS) if table.has(*kind.columns)]
    if not kinds:
        raise ModelError(
            f"{table.source}:1: {NEEDS}; its columns are {', '.join(table.header)[:200]}"
        )
    # The requested fit must select a single type; an ambiguous table is an error.
    suited = [kind for kind in kinds if request.fit in (None, *kind.fits)]
    if not suited:
        possible = " or ".join(dict.fromkeys(fit for kind in kinds for fit in kind.fits))
        raise UsageError(f"{table.source}: this table is for --fit {possible}, not {request.fit}")
    if len(suited) > 1:
        both = " and of ".join(",".join(kind.columns) for kind in suited)
        fits = " or ".join(f"--fit {kind.fits[0]}" for kind in suited)
        raise UsageError(f"{table.source}:1: this is a table of {both}; specify {fits}")
    # The dispersion of the model is not fitted; it is an attribute of each function.
    result = suited[0].fit(table, request)
    functions = [
        replace(function, modeling_dispersion=request.modeling_dispersion)
        for function in result.functions
    ]
    return replace(result, functions=tuple(functions))


def _fit_stripes(table: CsvTable, request: FragilityRequest) -> FragilityResult:
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
        levels, all_runs, share = (
            im[chosen],
            total[chosen],
            np.sum(hits[chosen]) / np.sum(total[chosen]),
        )
        function = fit_stripes(levels, hits[chosen], all_runs)
        counted = function.beside_counts(levels, hits[chosen] / all_runs, runs=all_runs)
        # Published counts keep their covariance if the median is outside the levels but the
        # fraction of exceedances is sufficient.
        return (
            replace(counted, covariance=function.covariance)
            if SELDOM <= share <= 1.0 - SELDOM
            else counted
        )

    functions = _by_threshold(table, request, fit)
    return FragilityResult.of(functions)


def _fit_capacities(table: CsvTable, request: FragilityRequest) -> FragilityResult:
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
    motion = _stated_motions(table)
    for state, rows in states:

        def fit(chosen: NDArray[np.bool_], rows: NDArray[np.bool_] = rows) -> Fragility:
            used = chosen & rows
            # Capacities under separate ground motions are independent, so their errors are known
            # explicitly.
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
    without = int(np.sum(~finite))
    warnings = (f"{table.source}: omitted {pluralize(without, 'row')} without a capacity",) * (
        without > 0
    )
    # Capacities of pairs apply to the rule that the table states.
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
    im, edp = (np.array(table.numbers(name, positive=True)) for name in ("im", "edp"))
    return _cloud(
        table, request, im, edp, np.array(table.truths("censored")), motion=_stated_motions(table)
    )


def _stated_motions(table: CsvTable) -> NDArray[np.intp] | None:
    """Return the event or ground motion of each row; None if the table states neither."""
    return motions_of(table) if table.has("event") or table.has("record") else None


def _fit_runs(table: CsvTable, request: FragilityRequest) -> FragilityResult:
    """Fit stripes or a cloud to the runs of a study.

    Runs without a result count neither as exceedance nor as non-exceedance.
    """
    runs = _runs_of(table, request)
    result = _fit_known_runs(table, request, runs)
    if not runs.pairs.pairs:
        return result
    functions = (replace(item, pair_demand=runs.pairs.stated) for item in result.functions)
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
    in_stripes = all(np.sum(stripe) >= _LEAST_STRIPE for stripe in stripes)
    fit = request.fit or (STRIPES if in_stripes else CLOUD)
    # Runs of a cloud have different intensities: each run would be a separate stripe.
    if fit == STRIPES and not in_stripes:
        raise UsageError(
            f"{table.source}: the runs have no common intensity levels; use --fit cloud"
        )
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
        of_cloud = tuple(replace(item, failed=lost) for item in result.functions)
        return replace(result, functions=of_cloud, warnings=(omitted,) * (lost > 0))
    functions = [
        _tried(drift, runs.names, partial(_of_stripes, runs, drift)) for drift in request.thresholds
    ]
    biased = (
        "which biases the fits; the fits with all of them counted as exceeding, and as not "
        "exceeding, are the bounds"
    )
    return FragilityResult.of(functions, *(f"{omitted}, {biased}",) * (lost > 0))


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
            # The table does not have this column; the message will name it.
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


def _of_stripes(runs: _Runs, threshold: float) -> Fragility:
    """Return the fit of the runs with a result, with bounds for the runs without a result."""
    over = runs.collapsed | (runs.drift > threshold)
    used = runs.result
    (function,) = over_motions(lambda kept: [_stripes(runs, over, kept)], used, runs.motion)
    assert isinstance(function, Fragility)
    function = function.beside_counts(
        runs.im[used], over[used].astype(float), motion=runs.motion[used]
    )
    lost = int(np.sum(~runs.result))
    # The bounds assume that all failed runs exceed the threshold, and that none of them does.
    if not lost:
        return function
    every = np.ones_like(runs.result)
    # If a fit is impossible, this bound is unknown.
    bounds: list[Fragility | None] = []
    for counted in (over | ~runs.result, over & runs.result):
        try:
            bounds.append(_stripes(runs, counted, every))
        except AnalysisError:
            bounds.append(None)
    return replace(function, failed=lost, bounds=(bounds[0], bounds[1]))


def _stripes(runs: _Runs, over: NDArray[np.bool_], taken: NDArray[np.bool_]) -> Fragility:
    """Return the fit of stripes; the intensity of a level is the geometric mean of its runs."""
    places = [taken & (runs.level == level) for level in np.unique(runs.level[taken])]
    # Intensities within a level differ by rounding errors only.
    middle = [float(np.exp(np.mean(np.log(runs.im[place])))) for place in places]
    return fit_stripes(
        middle,
        [int(np.sum(over[place])) for place in places],
        [int(np.sum(place)) for place in places],
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
    beyond = [((edp > threshold) | censored).astype(float) for threshold in request.thresholds]
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
            im[used], over[used], motion=None if motion is None else motion[used]
        )
        for function, used, over in zip(functions, known, beyond, strict=True)
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
        every = np.ones(len(table.rows), bool)
        return [_tried(next(iter(request.thresholds), math.nan), names, lambda: fit(every))]
    # Compare thresholds with a tolerance, because text rounds them.
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
        functions.append(_tried(threshold, names, partial(fit, rows)))
    return functions


def _tried(
    threshold: float, names: tuple[str, str], fit: Callable[[], Fragility]
) -> Fragility | AnalysisError:
    """Return the function of a threshold, or the error that prevents it."""
    try:
        return fit().named(threshold, *names)
    except AnalysisError as error:
        return AnalysisError(
            f"threshold {threshold:g}: {error}" if math.isfinite(threshold) else str(error)
        )


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
_OF_RUNS = _Kind(("status", "peak_drift_ratio"), (STRIPES, CLOUD), _fit_runs)


# ---- Fragility functions of a campaign: one function for each building type (or building) and
# damage state
#
# A run that ends with a collapse exceeds all states. Its demand is known only to be above the
# heaviest state, regardless of the drift at which the run was stopped. The dispersion of the
# thresholds is part of beta: stripes count probabilities of exceedance, and a cloud uses each run
# with several thresholds that have this dispersion.

_SAME_PERIOD = 1e-6  # relative difference; tables are written with at least six digits
# Three points with mean 0 and variance 1; 20 points give losses that differ by less than 1 %
_THREE = math.sqrt(1.5) * np.array([-1.0, 0.0, 1.0])


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
    # States of the campaign depend on the type, whereas a threshold applies to all buildings.
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
    of_all = DamageStates("drift_ratio", names, medians) if medians else None
    # Read the store one time, building by building. The fits follow after it is closed.
    with open_existing(folder) as store:
        check_chunks(store)
        if not (store.damage() or of_all):
            remedy = "add `damage` to its file and run it again"
            more = ", or specify --threshold" if by == BUILDING else ""
            raise UsageError(f"{folder}: this campaign has no damage states; {remedy}{more}")
        intensities = RunIntensities(store, folder, measure, request.pair_demand)
        # For ground motion fields, the correlated runs belong to an event, numbered as a sample.
        rule = store.pair_rule()
        if request.pair_demand:
            rule = replace(rule, demand=request.pair_demand)
        motions = {} if store.events() else rule.recordings
        gathered: dict[str, _Gathered] = {}
        for of in building_damages(store, of_all):
            name = of.type if by == TYPE else of.building
            gathered.setdefault(name, _Gathered(of.states)).add(
                of, intensities.of(of), motions, rule
            )
        of_types = {
            name: gathered[name].runs(measure, intensities.unit) for name in sorted(gathered)
        }
    # An error message names type and state, and does not prevent other fits.
    fitted = [
        AnalysisError(f"{name}, {state}: {function}")
        if isinstance(function, AnalysisError)
        else replace(
            function, type=name, state=state, modeling_dispersion=request.modeling_dispersion
        )
        for name, runs in of_types.items()
        for state, function in zip(runs.states.states, _fitted(runs, request), strict=True)
    ]
    lost = sum(runs.failed for runs in of_types.values())
    warnings = (f"{folder}: omitted {pluralize(lost, 'run')} without a result",) * (lost > 0)
    notes = (intensities.note,) * bool(intensities.note)
    if rule.pairs and not request.pair_demand:
        notes += (rule.note(),)
    fitted = [
        item if isinstance(item, AnalysisError) else replace(item, pair_demand=rule.stated)
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
        self, of_runs: BuildingDamage, im: Array, motions: Mapping[int, int], rule: PairRule
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
        of = by_motion(of_runs, rule)
        if of is not of_runs:
            im = im[[group[0] for group in places_of_motions(of_runs, rule)]]
        taken = of.known & (im > 0.0)
        fallen = np.isin(of.status, FALLEN)
        motion = np.array(
            [motions[record] if motions else sample for record, _, sample in of.keys], np.int64
        )
        demand = np.where(fallen, of.states.medians[-1], of.demand)
        columns = (
            (self.im, im),
            (self.demand, demand),
            (self.fallen, fallen.astype(np.int8)),
            (self.motion, motion),
        )
        for kept, values in columns:
            kept.frombytes(values[taken].tobytes())
        self.failed += int(np.sum(~of.known))
        self.periods = min(self.periods[0], of.period), max(self.periods[1], of.period)

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
    stripes = motions_at_level.size > 1 and int(motions_at_level.min()) >= _LEAST_STRIPE
    if request.fit == STRIPES and not stripes:
        raise UsageError(
            "the runs have no common intensity levels; use --fit cloud or another --im"
        )
    chosen = request.fit or (STRIPES if stripes else CLOUD)

    def fit(taken: NDArray[np.bool_]) -> list[Fragility | AnalysisError]:
        return (
            _type_stripes(runs, level, taken)
            if chosen == STRIPES
            else _type_cloud(runs, request, taken)
        )

    functions = over_motions(fit, np.ones(runs.im.size, bool), runs.motion)
    return [
        function
        if isinstance(function, AnalysisError)
        else replace(
            function.named(median, runs.name, runs.unit), failed=runs.failed
        ).beside_counts(runs.im, over, motion=runs.motion)
        for function, median, over in zip(
            functions, runs.states.medians, _beyond(runs).T, strict=True
        )
    ]


def _beyond(runs: TypeRuns) -> Array:
    """Return the probability that each run reaches or exceeds each state, shape (runs, states).

    The probability is 1 after a collapse.
    """
    return np.where(runs.fallen[:, np.newaxis], 1.0, exceedance(runs.states, runs.demand))


def _type_stripes(
    runs: TypeRuns, level: NDArray[np.intp], taken: NDArray[np.bool_]
) -> list[Fragility | AnalysisError]:
    """Fit each state to probabilities of exceedance at intensity levels."""
    # Renumber the levels that contain a selected run.
    place = np.unique(level[taken], return_inverse=True)[1]
    total = np.bincount(place).astype(float)
    im = np.exp(np.bincount(place, np.log(runs.im[taken])) / total)
    functions: list[Fragility | AnalysisError] = []
    for row in _beyond(runs)[taken].T:
        # Rounding errors of the sum of probabilities must not exceed the number of runs.
        count = np.minimum(np.bincount(place, row), total)
        try:
            functions.append(fit_stripes(im, count, total))
        except AnalysisError as error:
            functions.append(error)
    return functions


def _type_cloud(
    runs: TypeRuns, request: FragilityRequest, taken: NDArray[np.bool_]
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
    kept = taken & (runs.demand >= low) & (runs.demand > 0.0)
    im, demand, fallen = runs.im[kept], np.minimum(runs.demand, high)[kept], runs.fallen[kept]
    lightest, heaviest = (
        (0.0, math.inf) if request.thresholds else (runs.states.medians[0], runs.states.medians[-1])
    )
    limited = fallen | (demand >= high)
    seen = (
        np.where(fallen[:, np.newaxis], 1.0, np.exp(runs.states.dispersion * _THREE))
        * demand[:, np.newaxis]
    )
    above = limited[:, np.newaxis] | (seen >= heaviest)
    im_of_seen, at_most = np.repeat(im, _THREE.size), np.minimum(seen, heaviest).ravel()
    try:
        of_states = fit_cloud(
            im_of_seen, at_most, runs.states.medians, above.ravel(), lower_threshold=lightest
        )
    except AnalysisError as error:
        return [error for _ in runs.states.states]
    # Figures show the demands, not the three values per demand.
    below = ~limited & (demand < lightest)
    counts: dict[str, Any] = {"runs": im.size, "censored": int(np.sum(limited))}
    points: dict[str, Any] = {"im": im, "edp": demand, "censored": limited, "below": below}
    return [
        replace(function, cloud=function.cloud and replace(function.cloud, **points), **counts)
        for function in of_states
    ]
