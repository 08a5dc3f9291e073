"""Fragility functions of a table: the columns determine the type of the fit; then the data are
prepared and fitted.

A table of stripes has the columns `im,collapses,records`, a table of capacities
`capacity[,censored]`, a cloud `im,edp[,censored]`. The tables of `tdint ida` and of campaigns are
supported also. The columns `threshold`, `im_name` and `unit` are optional.

Fragility functions of a campaign: one function for each building type (or building) and damage
state.

A run that ends with a collapse exceeds all states, regardless of the drift where the run was
stopped. The dispersion of the thresholds is part of beta: stripes count probabilities of
exceedance, and a cloud adds its variance to the variance about the line. Equal buildings count with
their number.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from tdint.arrays import Array
from tdint.csv_table import CsvTable, read_table
from tdint.errors import AnalysisError, ModelError, UsageError
from tdint.files import is_file, is_folder
from tdint.fractiles import expected_deviation
from tdint.model.damage_states import DamageStates
from tdint.model.status import DONE, FALLEN, NO_RESULT
from tdint.number_parsing import abbreviate, pluralize
from tdint.output.summary import stored_summary
from tdint.response import pairs
from tdint.response.arguments import between, numbers_of
from tdint.response.runs.damage import exceedance
from tdint.studies.fragility import building_damage, measures
from tdint.studies.fragility.fits import fit_capacities, fit_cloud, fit_levels, fit_stripes
from tdint.studies.fragility.fragility_function import (
    CLOUD,
    FITS,
    IDA,
    NORMAL,
    SAME_LEVEL,
    SELDOM,
    STRIPES,
    Fragility,
    extrapolated,
    levels_of,
)
from tdint.studies.store.opening import check_chunks, open_existing
from tdint.tabular import Tabular

NEEDS = (
    "a table has the columns im,collapses,records (stripes), capacity[,censored] (ida) or "
    "im,edp[,censored] (cloud), or is one of tdint ida or tdint campaign"
)
EVERY_DEMAND = (0.0, math.inf)
"""Default range of the demands of a cloud."""

MIN_RUNS_PER_LEVEL = 3
"""Minimum number of runs at each intensity level of stripes. For functions by type, the minimum
number of ground motions."""


NO_LEVELS = "fit cloud, because the runs have no common intensity levels (--fit selects another)"
NO_COMMON_LEVELS = (
    f"a level has fewer than {MIN_RUNS_PER_LEVEL} ground motions: the runs have no common "
    "intensity levels; use --fit cloud, or another --im"
)


@dataclass(frozen=True)
class FragilityRequest:
    """Settings of the fits to a table, as in `fragility`.

    Attributes
    ----------
    measure : str | None
        Intensity measure of runs (`measures.run_measure`), or its column without the unit; default
        Sa(T1).
    states : tuple of str
        Names of the states of the thresholds in ascending order; default ds1, ds2, ...
    pair_demand : str | None
        Rule of `tdint.response.pairs`; default is the rule of the study in the same
        directory, otherwise the larger demand.
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
    """Result of fits: functions, reasons why other functions cannot be fitted, warnings and notes.

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
        """Messages about functions that differ from the counts by more than the random scatter, and
        about functions with an extrapolated median."""
        differences = [fit.disagreement for fit in self.functions if fit.disagreement]
        return [*differences, *extrapolated(self.functions)]

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
        """Return the number of functions, and their medians."""
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
    fit : str, optional
        `stripes`, `ida` or `cloud`; default is the fit that suits the columns of the table.
    edp_range : tuple of two floats, default (0, inf)
        For a cloud: smaller demands are omitted, larger demands are known only to be above the
        upper limit.
    modeling_dispersion : float
        Dispersion due to the uncertainty of the model; default 0.
    measure : str, optional
        Intensity measure of runs, such as `pgv` or `sa:0.5`; default Sa(T1).

    Returns
    -------
    FragilityResult
        Functions, reasons why other functions cannot be fitted, and messages.

    Raises
    ------
    UsageError
        The fit does not suit the table, or a threshold is missing.
    ModelError
        The table cannot be read or contains invalid values.
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
    """Fit fragility functions to a table, or to a study (`fragility`).

    Parameters
    ----------
    source : str
        Path of the table (`-`: standard input), or the directory of a study.
    """
    if request.fit is not None and request.fit not in FITS:
        raise UsageError(f"the fit must be one of {', '.join(FITS)}, got {request.fit!r}")
    file = source
    if source != "-" and is_folder(Path(source)):
        file = _table_of_study(Path(source), request.fit)
    table = read_table(file, NEEDS)
    table = measures.with_measures(table) if request.measure else table
    table_type = _table_type(table, request.fit)
    result = table_type.fit(table, request)
    # The dispersion of the model is not fitted; it is an attribute of each function.
    functions = [
        replace(function, modeling_dispersion=request.modeling_dispersion)
        for function in result.functions
    ]
    return replace(result, functions=tuple(functions))


_SUMMARIES = ("ida.json", "summary.json")
"""Names of the summaries in the directory of a study and of a campaign."""

_TABLES = ("capacities.csv", "ida.csv", "runs.csv")
"""Tables of studies that contain observations."""


def study_summary(source: Path) -> dict[str, Any]:
    """Return the JSON summary of the study that wrote a table; empty for a table from elsewhere.

    Parameters
    ----------
    source : Path
        Table with observations, or the directory of a study.
    """
    folder = source if source.is_dir() else source.parent
    if not source.is_dir() and source.name not in _TABLES:
        return {}
    summaries = (stored_summary(folder / name) for name in _SUMMARIES)
    content: dict[str, Any] = next(filter(None, summaries), {})
    return content if content.get("records") else {}


def _table_of_study(folder: Path, fit: str | None) -> str:
    """Return the path of the table in the directory of a study that suits a fit (None: any);
    ModelError if there is none. Stripes are fitted to the runs. Other fits use the capacities that
    the study has computed, if they exist; a cloud prefers the curves of `tdint ida`.
    """
    if fit == STRIPES:
        names = ["runs.csv"]
    elif fit == CLOUD and is_file(folder / "ida.csv"):
        names = ["ida.csv"]
    else:
        names = ["capacities.csv", "runs.csv"]
    for name in names:
        if is_file(folder / name):
            return str(folder / name)
    raise ModelError(
        f"{folder}: this directory contains no {' and no '.join(names)} written by tdint ida or "
        "tdint campaign"
    )


def _table_type(table: CsvTable, fit: str | None) -> _TableType:
    """Return the type of a table, which follows from its columns and the requested fit (None: any).
    ModelError is raised if the table has the columns of no type; UsageError, if the fit does not
    suit the table, or the table has the columns of two types.
    """
    types = [
        table_type
        for table_type in (_STRIPES, _CAPACITIES, _CLOUD, _STUDY_RUNS)
        if table.has(*table_type.columns)
    ]
    if not types:
        raise ModelError(
            f"{table.source}:1: no fit is possible with the "
            f"{pluralize(len(table.header), 'column')} of this file; {NEEDS}"
        )
    suitable = [table_type for table_type in types if fit in (None, *table_type.fits)]
    if not suitable:
        possible = " or ".join(dict.fromkeys(name for item in types for name in item.fits))
        raise UsageError(
            f"{table.source}: the columns of this table are for --fit {possible}, not {fit}; omit "
            "--fit"
        )
    if len(suitable) > 1:
        columns = " and ".join(",".join(item.columns) for item in suitable)
        fits = " or ".join(f"--fit {item.fits[0]}" for item in suitable)
        raise UsageError(
            f"{table.source}:1: with the columns {columns}, several types of fits are possible; "
            f"select one with {fits}"
        )
    return suitable[0]


def _fit_stripes(table: CsvTable, request: FragilityRequest) -> FragilityResult:
    """Fit stripes to a table with the columns `im`, `collapses` and `records`: for each intensity
    level, the number of records that cause collapse (or exceed a threshold), and the number of all
    records. Each requested threshold has a function. A requested threshold that is not in the table
    is a UsageError.
    """
    im, exceeding, records = (
        np.array(table.numbers(name)) for name in ("im", "collapses", "records")
    )
    table.check("im", im > 0.0, "must be positive")
    table.check("records", records > 0.0, "must be positive")
    for name, counts in (("records", records), ("collapses", exceeding)):
        table.check(name, counts == np.floor(counts), "must be a whole number")
    table.check(
        "collapses",
        (exceeding >= 0.0) & (exceeding <= records),
        "must be from 0 to the number of records",
    )

    def fit(rows: NDArray[np.bool_]) -> Fragility:
        """Fit a function to the rows that a mask selects, and add the counted fractions of the
        levels for a comparison in figures and warnings."""
        levels, level_records, level_exceeding = im[rows], records[rows], exceeding[rows]
        fraction = np.sum(level_exceeding) / np.sum(level_records)
        function = fit_stripes(levels, level_exceeding, level_records)
        with_counts = function.beside_counts(
            levels, level_exceeding / level_records, runs=level_records
        )
        # `beside_counts` removes the covariance if few records exceed, if nearly all exceed, or if
        # the median is outside the levels. In the last case, stripes keep the covariance.
        if SELDOM <= fraction <= 1.0 - SELDOM:
            return replace(
                with_counts, covariance=function.covariance, error_method=function.error_method
            )
        return with_counts

    return FragilityResult.of(_by_threshold(table, request, fit))


def _fit_capacities(table: CsvTable, request: FragilityRequest) -> FragilityResult:
    """Fit functions to the capacities of an incremental dynamic analysis, for each state of
    previous damage (column `damage`) and each threshold.

    UsageError is raised if the table does not contain a requested threshold, or the requested rule
    for pairs of components is not the rule of the table.
    """
    pair_demand = table.only("pair_demand") if table.has("pair_demand") else ""
    if pair_demand and request.pair_demand not in (None, pair_demand):
        raise UsageError(
            f"{table.source}: its capacities were computed with pair_demand {pair_demand}; run "
            f"`tdint ida` again with --pair-demand {request.pair_demand}"
        )
    # A row without a capacity contains no information, not even that the building did not collapse.
    # It is omitted with a warning.
    capacity = np.array(table.numbers("capacity", empty=True, positive=True))
    has_capacity = np.isfinite(capacity)
    # The key nan represents a table without this column.
    rows_of_damage = {math.nan: has_capacity}
    if table.has("damage"):
        damage = np.array(table.numbers("damage"))
        rows_of_damage = {
            value: has_capacity & (damage == value) for value in np.unique(damage).tolist()
        }
    fits: list[Fragility | AnalysisError] = []
    for value, rows in rows_of_damage.items():
        for fit_or_error in _fit_capacity_rows(table, request, capacity, rows):
            if isinstance(fit_or_error, Fragility):
                fits.append(replace(fit_or_error, damage=value, pair_demand=pair_demand))
            elif math.isnan(value):
                fits.append(fit_or_error)
            else:
                reason = fit_or_error
                fits.append(AnalysisError(f"no fit for the rows with damage = {value:g}: {reason}"))
    omitted = int(np.sum(~has_capacity))
    warnings = []
    if omitted:
        warnings = [f"{table.source}: omitted {pluralize(omitted, 'row')} without a capacity"]
    if request.pair_demand and not pair_demand:
        warnings.append(
            f"{table.source}: --pair-demand {request.pair_demand} has no effect, because the table "
            "has no column pair_demand and contains only capacities"
        )
    result = FragilityResult.of(fits, *warnings)
    samples = dict.fromkeys(f.motions for f in result.functions if f.error_method == NORMAL)
    notes = tuple(
        f"the beta of {pluralize(count, 'capacity')} is on average "
        f"{expected_deviation(count):.3f} times the true dispersion; it is not corrected"
        for count in samples
    )
    return replace(result, notes=notes)


def _fit_capacity_rows(
    table: CsvTable, request: FragilityRequest, capacity: Array, rows: NDArray[np.bool_]
) -> list[Fragility | AnalysisError]:
    """Fit a function to some capacities, for each threshold; the error that prevents a fit takes
    the place of the function.
    """
    censored = np.array(table.truths("censored"))
    motion = measures.motions_if_known(table)
    draw = pairs.indices_of(table.texts("draw")) if table.has("draw") else None

    def fit_selected(is_selected: NDArray[np.bool_]) -> list[Fragility | AnalysisError]:
        """Fit a function to the capacities that a mask selects; the error if it is impossible."""
        try:
            return [fit_capacities(capacity[is_selected], censored[is_selected].tolist())]
        except AnalysisError as error:
            return [error]

    def fit(threshold_rows: NDArray[np.bool_]) -> Fragility:
        """Fit a function to the rows of a threshold, which a mask of all rows selects. Rows that
        `rows` excludes are not used."""
        is_used = threshold_rows & rows
        # If each ground motion has one capacity, the capacities are independent, and the fit
        # provides their errors. If a motion occurs repeatedly, a jackknife over motions is used.
        has_repeated_motion = motion is not None and np.unique(motion[is_used]).size < np.sum(
            is_used
        )
        (function,) = measures.over_motions(
            fit_selected, is_used, motion if has_repeated_motion else None, draw
        )
        if isinstance(function, AnalysisError):
            raise function
        if motion is not None:
            function = replace(function, motions=np.unique(motion[is_used]).size)
        # Each known (not censored) capacity counts as an exceedance. `within` regards the median as
        # extrapolated if nearly all runs exceed. This does not apply to capacities: if all are
        # known, they are on both sides of the median. The fraction is therefore at most 0.5.
        known_fraction = 1.0 - float(np.mean(censored[is_used]))
        return function.within(capacity[is_used], min(0.5, known_fraction))

    return _by_threshold(table, request, fit)


def _fit_cloud(table: CsvTable, request: FragilityRequest) -> FragilityResult:
    """Fit functions to a table with the columns `im`, `edp` and optionally `censored`, `collapsed`
    and `status`, one for each requested threshold. Collapses and failed runs have no demand."""
    im = np.array(table.numbers("im", positive=True))
    outcome = np.where(table.truths("collapsed"), pairs.COLLAPSED, pairs.COMPLETED)
    if table.has("status"):
        statuses = [text.lower() for text in table.texts("status")]
        known = (DONE, *FALLEN, *NO_RESULT)
        table.check("status", np.isin(statuses, known), f"must be one of {', '.join(known)}")
        outcome = np.maximum(outcome, pairs.outcomes_of(statuses))
    edp = np.array(table.numbers("edp", empty=True))
    is_valid = (edp > 0.0) | (outcome != pairs.COMPLETED)
    table.check("edp", is_valid, "must be a positive number unless the run collapsed or failed")
    names = (table.only("im_name"), table.only("unit"))
    censored = np.array(table.truths("censored"))
    demand = pairs.with_outcomes(edp, outcome)
    runs = measures.SuiteRuns(
        im, demand, measures.motions_if_known(table), np.ones(im.size), names, censored=censored
    )
    return _fit_thresholds(table, runs, replace(request, fit=CLOUD))


def _fit_thresholds(
    table: CsvTable, runs: measures.SuiteRuns, request: FragilityRequest
) -> FragilityResult:
    """Fit functions for the requested thresholds; UsageError is raised if none is requested."""
    if not request.thresholds:
        raise UsageError(f"{table.source}: a demand threshold is required; specify --threshold")
    thresholds = {f"threshold {threshold:g}": threshold for threshold in request.thresholds}
    try:
        return FragilityResult.of(fit_states(runs, thresholds, request))
    except UsageError as error:
        raise UsageError(f"{table.source}: {error}") from None


def _fit_runs(table: CsvTable, request: FragilityRequest) -> FragilityResult:
    """Fit functions to the runs of a study, with the components of pairs combined.

    Raises
    ------
    UsageError
        A threshold is missing, stripes are requested for runs without common levels, or the table
        does not contain the intensity measure.
    ModelError
        The table contains several buildings, or no run has a result.
    """
    runs, rule = measures.suite_runs(table, request.measure, request.pair_demand)
    result = _fit_thresholds(table, runs, request)
    functions = tuple(
        replace(function, pair_demand=rule.demand_if_pairs) for function in result.functions
    )
    failed_count = int(np.sum(np.isnan(runs.demand)))
    omission_text = (
        f"{table.source}: {failed_count} of {runs.im.size} runs have no result and are omitted"
    )
    if any(function.fit == STRIPES for function in result.functions):
        omission_text += (
            ", which biases the fits; the bounds are the fits that count all of these runs as "
            "exceeding, or none of them"
        )
    return replace(
        result,
        functions=functions,
        warnings=(omission_text,) if failed_count else (),
        notes=notes_of_fits(result, request, rule),
    )


def notes_of_fits(
    result: FragilityResult, request: FragilityRequest, rule: pairs.PairRule
) -> tuple[str, ...]:
    """Return the notes on choices that the user did not make: the rule for pairs, and the cloud."""
    is_cloud = any(function.fit == CLOUD for function in result.functions)
    return (
        *((rule.note(),) if rule.pairs and not request.pair_demand else ()),
        *((NO_LEVELS,) if is_cloud and not request.fit else ()),
    )


def fit_states(
    runs: measures.SuiteRuns,
    states: Mapping[str, float],
    request: FragilityRequest,
    dispersion: float = 0.0,
) -> list[Fragility | AnalysisError]:
    """Fit a fragility function for each damage state (or threshold) of a group of runs.

    By default stripes are fitted if each intensity level has enough ground motions, otherwise a
    cloud. Runs without a result count neither as exceedance nor as non-exceedance.

    Parameters
    ----------
    states : mapping of str to float
        Name and median demand of each state.
    dispersion : float
        Standard deviation of the logarithm of the demand of a state.

    Returns
    -------
    list of Fragility or AnalysisError
        Function of each state, or the error if its fit is impossible.

    Raises
    ------
    UsageError
        Stripes are requested, or the intensities are levels of a campaign, but a level has fewer
        than three ground motions.
    """
    has_result = ~np.isnan(runs.demand)
    if not has_result.any():
        reason = "no run has a result; execute the runs of these buildings first"
        return [AnalysisError(f"{name}: {reason}") for name in states]
    # Each level counts a ground motion once, for all buildings of the group together.
    level = levels_of(runs.im)
    motion = np.arange(level.size) if runs.motion is None else runs.motion
    places = np.unique(np.column_stack([level, motion])[has_result], axis=0)
    motions_at_level = np.unique(places[:, 0], return_counts=True)[1]
    has_stripes = int(motions_at_level.min()) >= MIN_RUNS_PER_LEVEL
    selected_fit = request.fit or (STRIPES if has_stripes or runs.has_levels else CLOUD)
    # If the intensities of all runs differ, each run would be a separate stripe.
    if selected_fit == STRIPES and not has_stripes:
        raise UsageError(NO_COMMON_LEVELS)
    censored = np.zeros(level.size, bool) if runs.censored is None else runs.censored
    medians = np.array([*states.values()])
    exceeding = exceedance(np.where(censored, math.inf, runs.demand), medians, dispersion).T

    def fit(is_used: NDArray[np.bool_]) -> list[Fragility | AnalysisError]:
        """Fit each state to the runs that a mask selects, with errors in place of functions."""
        if selected_fit == CLOUD:
            # Demands above the range count only as lower limits. A collapse has a probability of
            # its own: the drift where the run was stopped is not used.
            rows = is_used & (runs.demand > 0.0)
            demand, largest = runs.demand[rows], request.edp_range[1]
            collapsed = np.isinf(demand)
            try:
                return [
                    *fit_cloud(
                        runs.im[rows],
                        np.where(collapsed, 0.0, np.minimum(demand, largest)),
                        medians,
                        (censored[rows] | (demand >= largest)) & ~collapsed,
                        collapsed=collapsed,
                        weight=runs.weight[rows],
                        dispersion=dispersion,
                    )
                ]
            except AnalysisError as error:
                return [AnalysisError(f"{name}: {error}") for name in states]
        fits: list[Fragility | AnalysisError] = []
        # The number of exceedances at a level is the sum of the probabilities of its runs.
        for name, probabilities in zip(states, exceeding, strict=True):
            try:
                fits.append(fit_levels(runs.im, level, probabilities, is_used, runs.weight))
            except AnalysisError as error:
                fits.append(AnalysisError(f"{name}: {error}"))
        return fits

    is_kept = has_result & ((runs.demand >= request.edp_range[0]) | (selected_fit == STRIPES))
    result: list[Fragility | AnalysisError] = []
    for state_fit, median, probabilities in zip(
        measures.over_motions(fit, is_kept, runs.motion, runs.draw),
        medians.tolist(),
        exceeding,
        strict=True,
    ):
        if isinstance(state_fit, Fragility):
            named = state_fit.named(median, *runs.names)
            is_known = is_kept & ~(censored & (runs.demand < median))
            state_fit = named.beside_counts(
                runs.im[is_known],
                probabilities[is_known],
                runs=runs.weight[is_known],
                motion=None if runs.motion is None else runs.motion[is_known],
            )
            state_fit = replace(state_fit, failed=int(np.sum(~has_result)))
            if selected_fit == STRIPES and not has_result.all():
                bounds = _bounds(runs, level, probabilities, has_result)
                state_fit = replace(state_fit, bounds=bounds)
        result.append(state_fit)
    return result


def _bounds(
    runs: measures.SuiteRuns,
    level: NDArray[np.intp],
    exceeding: Array,
    has_result: NDArray[np.bool_],
) -> tuple[Fragility | None, Fragility | None]:
    """Return two fits to stripes as bounds for runs without a result: the first counts these runs
    as exceedances; the second counts them as runs that do not exceed."""
    bounds: list[Fragility | None] = []
    for of_failed in (1.0, 0.0):
        counted = np.where(has_result, exceeding, of_failed)
        every = np.ones_like(has_result)
        try:
            bounds.append(fit_levels(runs.im, level, counted, every, runs.weight))
        except AnalysisError:
            bounds.append(None)
    return bounds[0], bounds[1]


def _by_threshold(
    table: CsvTable, request: FragilityRequest, fit: Callable[[NDArray[np.bool_]], Fragility]
) -> list[Fragility | AnalysisError]:
    """Fit a function to the rows (a mask) of each requested threshold of a table, by default of all
    thresholds in its column `threshold`. Without this column, all rows are used for a function. The
    error that prevents a fit takes the place of the function.

    UsageError is raised if the table does not contain a requested threshold; ModelError, if the
    column `threshold` is empty.
    """
    names = (table.only("im_name"), table.only("unit"))
    if not table.has("threshold"):
        if len(request.thresholds) > 1:
            raise UsageError(
                f"{table.source}: the table has no column threshold, so at most one --threshold "
                "can be specified"
            )
        all_rows = np.ones(len(table.rows), bool)
        threshold = next(iter(request.thresholds), math.nan)
        return [_fit_at_threshold(threshold, names, lambda: fit(all_rows))]
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
            available_text = ", ".join(f"{value:g}" for value in available)
            raise UsageError(
                f"{table.source}: threshold {threshold:g} not found; the thresholds of the table "
                f"are {available_text}"
            )
        functions.append(_fit_at_threshold(threshold, names, partial(fit, rows)))
    return functions


def _fit_at_threshold(
    threshold: float, names: tuple[str, str], fit: Callable[[], Fragility]
) -> Fragility | AnalysisError:
    """Fit a function for a threshold (NaN if unknown). If it cannot be fitted, return the error
    instead of raising it, so that the caller can report it with the other functions."""
    try:
        return fit().named(threshold, *names)
    except AnalysisError as error:
        return AnalysisError(
            f"threshold {threshold:g}: {error}" if math.isfinite(threshold) else str(error)
        )


@dataclass(frozen=True)
class _TableType:
    """Type of table, which determines the possible fits."""

    columns: tuple[str, ...]
    fits: tuple[str, ...]
    fit: Callable[[CsvTable, FragilityRequest], FragilityResult]


_STRIPES = _TableType(("im", "collapses", "records"), (STRIPES,), _fit_stripes)
_CAPACITIES = _TableType(("capacity",), (IDA,), _fit_capacities)
_CLOUD = _TableType(("im", "edp"), (CLOUD,), _fit_cloud)
_STUDY_RUNS = _TableType(("status", "peak_drift_ratio"), (STRIPES, CLOUD), _fit_runs)


# ---- Functions of a campaign: one for each building type, or building, and damage state

_SAME_PERIOD = 1e-6  # relative difference; tables are written with at least six digits

TYPE, BUILDING = "type", "building"
BY = (TYPE, BUILDING)
"""Groups of runs for which functions of a campaign can be fitted."""


def fit_types(folder: Path, request: FragilityRequest, by: str = TYPE) -> FragilityResult:
    """Fit a function for each building type (or building) and damage state of a campaign.

    For functions by building, the states can be thresholds of the maximum drift ratio.

    Raises
    ------
    UsageError
        The directory contains no campaign, or the campaign has no damage states. The fit or the
        thresholds cannot be used with a campaign. The runs have no such intensity measure.
    OutputError
        The store cannot be read.
    """
    if request.fit == IDA:
        raise UsageError(
            f"--fit ida cannot be used with functions by {by}, which are fitted to runs; use --fit "
            "stripes or --fit cloud"
        )
    requested_states = _requested_states(request)
    with open_existing(folder) as store:
        check_chunks(store)
        # The damage states of a campaign depend on the building type. A requested threshold applies
        # to each building, or to all variations of a building.
        has_draws = by == TYPE and bool(store.varied())
        if request.thresholds and by == TYPE and not has_draws:
            raise UsageError(
                "--threshold cannot be used with functions by type, which use the damage states of "
                "the campaign; omit --threshold"
            )
        if not (store.damage() or requested_states):
            remedy = "add `damage` to its file and run it again"
            more = ", or specify --threshold" if by == BUILDING or has_draws else ""
            raise UsageError(f"{folder}: this campaign has no damage states; {remedy}{more}")
        measure = measures.measure_of_campaign(store, request.measure)
        intensities = measures.RunIntensities(store, folder, measure)
        rule = store.pair_rule()
        if request.pair_demand:
            rule = replace(rule, demand=request.pair_demand)
        # The runs of the components of a recording are correlated, so they count as a single ground
        # motion. In a campaign with ground motion fields, the same applies to the runs of an event;
        # the store numbers the events in its column of samples, and no mapping is needed.
        motion_of_record = {} if store.events() else rule.recordings
        collectors: dict[str, _RunCollector] = {}
        for damage in building_damage.building_damages(store, requested_states):
            name = damage.type if by == TYPE else damage.building
            collector = collectors.setdefault(name, _RunCollector(damage.states, has_draws))
            collector.add(damage, intensities.of(damage), motion_of_record, rule)
    fits: list[Fragility | AnalysisError] = []
    for name in sorted(collectors):
        states = collectors[name].states
        runs = collectors[name].runs(measure, intensities.unit)
        medians = dict(zip(states.states, states.medians, strict=True))
        # The last loss ratio is that of a collapse, which has no function of its own.
        increments = np.diff(states.losses[:-1] or [math.nan] * len(medians), prepend=0.0)
        state_fits = fit_states(runs, medians, request, states.dispersion)
        for state, increment, fit in zip(medians, increments.tolist(), state_fits, strict=True):
            if isinstance(fit, AnalysisError):
                fits.append(AnalysisError(f"{name}, {fit}"))
                continue
            fits.append(
                replace(
                    fit,
                    type=name,
                    state=state,
                    loss_increment=increment,
                    modeling_dispersion=request.modeling_dispersion,
                    pair_demand=rule.demand_if_pairs,
                )
            )
    failed = sum(collector.failed for collector in collectors.values())
    warnings = [f"{folder}: omitted {pluralize(failed, 'run')} without a result"] if failed else []
    if has_draws and request.modeling_dispersion:
        warnings.append(
            f"{folder}: beta contains the dispersion between the draws of `vary`; the modeling "
            "dispersion must not contain it again"
        )
    result = FragilityResult.of(fits, *warnings)
    notes = [*filter(None, [intensities.note]), *notes_of_fits(result, request, rule)]
    unknown = [f"{f.type}, {f.state}" for f in result.functions if has_draws and not f.draws_text]
    if unknown:
        notes.append(
            f"the dispersions within and between draws are unknown ({abbreviate(unknown, 4)}), "
            "because a draw alone determines no function; add intensity levels or motions"
        )
    return replace(result, notes=tuple(notes))


def _requested_states(request: FragilityRequest) -> DamageStates | None:
    """Return damage states with the requested thresholds of the maximum drift ratio as medians;
    None if no threshold is requested. The default names of the states are ds1, ds2, and so on.
    UsageError is raised if the number of names differs from the number of thresholds.
    """
    medians = tuple(sorted(request.thresholds))
    if not medians:
        return None
    names = request.states or tuple(f"ds{number}" for number in range(1, len(medians) + 1))
    if len(names) != len(medians):
        raise UsageError(
            f"{pluralize(len(medians), 'threshold')}: --states requires the same number of names, "
            f"got {len(names)}"
        )
    return DamageStates("drift_ratio", names, medians)


@dataclass
class _RunCollector:
    """Runs of a group, collected building by building: intensity, demand (infinity: collapse),
    ground motion and number of equal buildings.

    Attributes
    ----------
    has_draws : bool
        True if the buildings are variations, which differ by their draws.
    periods : tuple of two floats
        Minimum and maximum first period of the buildings, s.
    parts : list of tuple of ndarray
        Intensities, demands, ground motions, numbers of equal buildings, and draws of the runs of
        each building.
    """

    states: DamageStates
    has_draws: bool = False
    failed: int = 0
    periods: tuple[float, float] = (math.inf, 0.0)
    parts: list[tuple[Any, ...]] = field(default_factory=list)
    _draws: dict[str, int] = field(default_factory=dict)

    def add(
        self,
        building: building_damage.BuildingDamage,
        im: Array,
        motion_of_record: Mapping[int, int],
        rule: pairs.PairRule,
    ) -> None:
        """Add the runs of a building, or its ground motions if components of pairs are combined.

        `motion_of_record` is empty for ground motion fields, where runs with the same sample
        number (of the event) count as a single ground motion.
        """
        damage = building_damage.damage_by_motion(building, rule.demand)
        # If the components of pairs were combined, `damage` has an entry per group of runs instead
        # of per run. Both runs of a group have the same intensity; use the first.
        if damage is not building:
            im = im[pairs.first_runs(building.motion)]
        is_used = damage.known & (im > 0.0) & (damage.equal > 0.0)
        motions = [
            motion_of_record[record] if motion_of_record else sample
            for record, _, sample in damage.keys
        ]
        # The name of a variation ends with its label.
        draw = self._draws.setdefault(building.building.rpartition(": ")[2], len(self._draws))
        added = (
            im,
            pairs.with_outcomes(damage.demand, pairs.outcomes_of(damage.status)),
            np.array(motions, np.int64),
            np.full(im.size, damage.equal),
            np.full(im.size, draw),
        )
        self.parts.append(tuple(values[is_used] for values in added))
        self.failed += int(np.sum(~damage.known))
        shortest, longest = self.periods
        self.periods = min(shortest, damage.period), max(longest, damage.period)

    def runs(self, measure: measures.RunMeasure, unit: str) -> measures.SuiteRuns:
        """Return all collected runs as arrays.

        `measure` is the intensity measure. Its name in the result contains the first period if all
        buildings have the same first period.
        """
        shortest, longest = self.periods
        is_same_period = 0.0 < longest < math.inf and longest - shortest <= _SAME_PERIOD * shortest
        im, demand, motion, weight, draw = map(np.concatenate, zip(*self.parts, strict=True))
        return measures.SuiteRuns(
            im,
            demand,
            motion,
            weight,
            (measure.label(shortest if is_same_period else None), unit),
            has_levels=measure.column == measures.LEVEL,
            draw=draw if self.has_draws else None,
        )
