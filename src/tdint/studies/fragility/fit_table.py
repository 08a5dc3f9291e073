"""Fragility functions of a table: the columns determine the type of the fit; then the data are
prepared and fitted.

A table of stripes has the columns `im,collapses,records`, a table of capacities
`capacity[,censored]`, a cloud `im,edp[,censored]`. The tables of `tdint ida` and of campaigns are
supported also. The columns `threshold`, `im_name` and `unit` are optional.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from tdint.arrays import Array
from tdint.csv_table import CsvTable, read_table
from tdint.errors import AnalysisError, ModelError, UsageError
from tdint.files import is_file, is_folder
from tdint.number_parsing import pluralize
from tdint.output.summary import stored_summary
from tdint.response.arguments import between, numbers_of
from tdint.studies.fragility.fits import fit_capacities, fit_cloud, fit_levels, fit_stripes
from tdint.studies.fragility.fragility_function import (
    CLOUD,
    FITS,
    IDA,
    SAME_LEVEL,
    SELDOM,
    STRIPES,
    Fragility,
    extrapolated,
    levels_of,
)
from tdint.studies.fragility.measures import (
    LEVEL,
    column_of,
    combine_pair_intensities,
    first_period_of_runs,
    is_level,
    measure_of_campaign,
    motion_of_rows,
    motions_if_known,
    motions_of,
    over_motions,
    store_of_table,
    with_measures,
)
from tdint.studies.motions.outcomes import (
    COLLAPSED,
    FAILED,
    demands_of_motions,
    first_runs,
    outcomes_of,
    outcomes_of_motions,
)
from tdint.tabular import Tabular
from tdint.units import ACCELERATION, suffix

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
NO_COMMON_LEVELS = "the runs have no common intensity levels; use --fit cloud, or another --im"


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
        Rule of `tdint.studies.motions.pairs`; default is the rule of the study in the same
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
    edp_range : tuple of two floats
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
    table = with_measures(table) if request.measure else table
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
            return replace(with_counts, covariance=function.covariance)
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
    return FragilityResult.of(fits, *warnings)


def _fit_capacity_rows(
    table: CsvTable, request: FragilityRequest, capacity: Array, rows: NDArray[np.bool_]
) -> list[Fragility | AnalysisError]:
    """Fit a function to some capacities, for each threshold; the error that prevents a fit takes
    the place of the function.
    """
    censored = np.array(table.truths("censored"))
    motion = motions_if_known(table)

    def fit_selected(is_selected: NDArray[np.bool_]) -> list[Fragility | AnalysisError]:
        """Fit a function to the capacities that a mask selects."""
        return [fit_capacities(capacity[is_selected], censored[is_selected].tolist())]

    def fit(threshold_rows: NDArray[np.bool_]) -> Fragility:
        """Fit a function to the rows of a threshold, which a mask of all rows selects. Rows that
        `rows` excludes are not used."""
        is_used = threshold_rows & rows
        # If each ground motion has one capacity, the capacities are independent, and the fit
        # provides their errors. If a motion occurs repeatedly, a jackknife over motions is used.
        has_repeated_motion = motion is not None and np.unique(motion[is_used]).size < np.sum(
            is_used
        )
        (function,) = over_motions(fit_selected, is_used, motion if has_repeated_motion else None)
        assert isinstance(function, Fragility)
        if motion is not None:
            function = replace(function, motions=np.unique(motion[is_used]).size)
        # Each known (not censored) capacity counts as an exceedance. `within` regards the median as
        # extrapolated if nearly all runs exceed. This does not apply to capacities: if all are
        # known, they are on both sides of the median. The fraction is therefore at most 0.5.
        known_fraction = 1.0 - float(np.mean(censored[is_used]))
        return function.within(capacity[is_used], min(0.5, known_fraction))

    return _by_threshold(table, request, fit)


def _fit_cloud(table: CsvTable, request: FragilityRequest) -> FragilityResult:
    """Fit functions to a cloud, a table with an intensity (`im`) and a demand (`edp`) in each row,
    and optionally the column `censored`."""
    im, edp = (np.array(table.numbers(name, positive=True)) for name in ("im", "edp"))
    return _cloud(
        table, request, im, edp, np.array(table.truths("censored")), motion=motions_if_known(table)
    )


def _fit_runs(table: CsvTable, request: FragilityRequest) -> FragilityResult:
    """Fit the requested type of function to the runs of a study; by default stripes if each
    intensity level has enough runs, otherwise a cloud. Runs without a result count neither as
    exceedance nor as non-exceedance.

    Raises
    ------
    UsageError
        A threshold is missing, stripes are requested for runs without common levels, or the table
        does not contain the intensity measure.
    ModelError
        The table contains several buildings, or no run has a result.
    """
    runs = _Runs(table, request)
    # Numbers of runs with a result at the levels that have such runs
    counts = np.unique(runs.level[runs.result], return_counts=True)[1]
    has_stripes = int(counts.min()) >= MIN_RUNS_PER_LEVEL
    # Runs of a campaign with levels are stripes: a cloud must be requested.
    fit = request.fit or (STRIPES if has_stripes or runs.has_levels else CLOUD)
    # If the intensities of all runs differ, each run would be a separate stripe.
    if fit == STRIPES and not has_stripes:
        raise UsageError(f"{table.source}: {NO_COMMON_LEVELS}")
    _check_thresholds(table, request)
    failed_count = int(np.sum(~runs.result))
    omission_text = (
        f"{table.source}: {failed_count} of {runs.result.size} runs have no result and are omitted"
    )
    if fit == CLOUD:
        # A collapse exceeds every threshold. Its demand is not used, because the drift where the
        # run was stopped depends on the method.
        is_used = runs.result
        drift = np.where(runs.collapsed, math.inf, runs.drift)[is_used]
        im, motion = runs.im[is_used], runs.motion[is_used]
        censored = np.zeros(im.size, bool)
        result = _cloud(table, request, im, drift, censored, runs.names, motion)
    else:
        result = FragilityResult.of(
            _fit_at_threshold(drift, runs.names, partial(_fit_with_bounds, runs, drift))
            for drift in request.thresholds
        )
        omission_text += (
            ", which biases the fits; the bounds are the fits that count all of these runs as "
            "exceeding, or none of them"
        )
    functions = (
        replace(item, failed=failed_count, pair_demand=runs.pairs.demand_if_pairs)
        for item in result.functions
    )
    return replace(
        result,
        functions=tuple(functions),
        warnings=(omission_text,) if failed_count else (),
        notes=(
            *((runs.pairs.note(),) if runs.pairs.pairs and not request.pair_demand else ()),
            *((NO_LEVELS,) if fit == CLOUD and not request.fit else ()),
        ),
    )


class _Runs:
    """Runs of a table of runs of one building, with the components of pairs combined; all arrays
    have the shape (n,).

    ModelError is raised if the table contains several buildings, or no run has a result;
    UsageError, if it does not contain the intensity measure.

    Attributes
    ----------
    im, level : ndarray
        Intensity, and index of its intensity level, from 0.
    drift, motion : ndarray
        Maximum drift ratio, and index of the recording.
    collapsed, result : ndarray of bool
        True if the building collapsed; True if the run has a result.
    names : tuple of str
        Name and unit of the intensity measure.
    pairs : PairRule
        Rule for the components of pairs.
    has_levels : bool
        True if the intensities are the levels of a campaign.
    """

    def __init__(self, table: CsvTable, request: FragilityRequest) -> None:
        """Read the runs and combine the components of pairs."""
        try:
            table.only("building")
        except ModelError as error:
            raise ModelError(
                f"{error}, or fit functions of each building of a campaign's directory with "
                "--by building"
            ) from None
        status = table.texts("status")
        drift = np.array(table.numbers("peak_drift_ratio", empty=True))

        column, name, unit = _intensity_column(table, request)
        im = np.array(table.numbers(column, empty=True))
        motion = motions_of(table)
        self.has_levels = column == LEVEL

        # Combine the runs under both components of a pair at a level into one run: the intensity is
        # the geometric mean, the rule for pairs combines the drifts, and either component can cause
        # collapse. The columns `im` and `level` contain the intensity of the pair already.
        rule, motion_at_level = motion_of_rows(table, request.pair_demand)
        if column not in ("im", LEVEL):
            im = combine_pair_intensities(table, im)
        firsts = first_runs(motion_at_level)
        outcome = outcomes_of_motions(motion_at_level, outcomes_of(status))
        if firsts.size < len(table.rows):
            drift = demands_of_motions(motion_at_level, drift, rule.demand)
            im, motion = im[firsts], motion[firsts]

        # Omit runs without an intensity. Runs without a drift ratio have no result.
        has_intensity = im > 0.0
        has_result = (outcome != FAILED) & (drift > 0.0) & has_intensity
        if not has_result.any():
            raise ModelError(
                f"{table.source}: no run has both an intensity and a result; at least one "
                "completed run is required, and load cases (key `forces` of a campaign) have no "
                "intensity"
            )
        self.im = im[has_intensity]
        self.level = levels_of(self.im)
        self.drift = drift[has_intensity]
        self.collapsed = (outcome == COLLAPSED)[has_intensity]
        self.result = has_result[has_intensity]
        self.motion = motion[has_intensity]
        self.names = (name, unit)
        self.pairs = rule


def _intensity_column(table: CsvTable, request: FragilityRequest) -> tuple[str, str, str]:
    """Return the title of the column with the intensities of runs, the name of the intensity
    measure, for example `sa(0.5)`, and the unit.

    Without a requested measure, it is the column `im` of the table if it exists, then the level of
    the campaign, otherwise Sa(T1). UsageError is raised if the table has no column of the requested
    measure.
    """
    if request.measure is None and table.has("im"):
        return "im", table.only("im_name"), table.only("unit")
    with store_of_table(table) as store:
        measure = measure_of_campaign(store, request.measure)
        has_level = store is not None and is_level(store, measure)
    name = measure.label(first_period_of_runs(table))
    if has_level and table.has(LEVEL):
        return LEVEL, name, measure.unit
    has_column = any(table.has(f"{measure.column}{suffix(unit)}") for unit in ACCELERATION)
    if request.measure is None and not has_column:
        # The column of Sa(T1) is missing. Return its usual title, so that the caller's attempt to
        # read the column raises an error with this title.
        return f"{measure.column}{suffix('m/s^2')}", name, "m/s^2"
    column, unit = column_of(table, measure.column)
    return column, name, unit


def _fit_with_bounds(runs: _Runs, threshold: float) -> Fragility:
    """Fit a function to the stripes of the runs that have a result. If some runs have no result,
    add two fits as bounds: the first counts these runs as exceedances of the threshold; the second
    counts them as runs that do not exceed it.
    """
    exceeding = (runs.collapsed | (runs.drift > threshold)).astype(float)
    has_result = runs.result

    def fit(is_selected: NDArray[np.bool_]) -> list[Fragility | AnalysisError]:
        """Fit a function to the runs that a mask selects."""
        return [fit_levels(runs.im, runs.level, exceeding, is_selected)]

    (function,) = over_motions(fit, has_result, runs.motion)
    assert isinstance(function, Fragility)
    function = function.beside_counts(
        runs.im[has_result], exceeding[has_result], motion=runs.motion[has_result]
    )
    if runs.result.all():
        return function
    # A fit can be impossible, for example if all runs exceed; then the bound is unknown.
    bounds: list[Fragility | None] = []
    for of_failed in (1.0, 0.0):
        try:
            counted = np.where(has_result, exceeding, of_failed)
            bounds.append(fit_levels(runs.im, runs.level, counted, np.ones_like(has_result)))
        except AnalysisError:
            bounds.append(None)
    return replace(function, bounds=(bounds[0], bounds[1]))


def _cloud(
    table: CsvTable,
    request: FragilityRequest,
    im: Array,
    edp: Array,
    censored: NDArray[np.bool_],
    names: tuple[str, str] | None = None,
    motion: NDArray[np.intp] | None = None,
) -> FragilityResult:
    """Fit a function to a cloud for each requested threshold. If the cloud cannot be fitted, the
    result contains the reason and no function.

    Censored demands are known only to be above their value; infinity is a collapse. By default, the
    name and unit of the intensity measure are the columns `im_name` and `unit`, and the rows belong
    to independent ground motions (`motion`).
    """
    _check_thresholds(table, request)
    low_edp, high_edp = request.edp_range
    is_kept = edp >= low_edp
    # For each threshold, `is_known` is True for the rows of which it is known whether they exceed
    # the threshold. A censored demand below the threshold may or may not exceed it.
    is_known = [is_kept & ~(censored & (edp < threshold)) for threshold in request.thresholds]
    exceeding = [((edp > threshold) | censored).astype(float) for threshold in request.thresholds]
    collapsed = np.isinf(edp)
    censored = (censored | (edp >= high_edp)) & ~collapsed
    im_name, unit = names or (table.only("im_name"), table.only("unit"))

    def fit(is_used: NDArray[np.bool_]) -> list[Fragility | AnalysisError]:
        """Fit a function for each threshold to the rows that a mask selects."""
        demands = np.where(collapsed, 0.0, np.minimum(edp, high_edp))[is_used]
        fell, above = collapsed[is_used], censored[is_used]
        return [*fit_cloud(im[is_used], demands, request.thresholds, above, collapsed=fell)]

    try:
        functions = [
            item for item in over_motions(fit, is_kept, motion) if isinstance(item, Fragility)
        ]
    except AnalysisError as error:
        return FragilityResult((), (error,))
    with_counts = [
        function.beside_counts(
            im[is_used], exceeding[is_used], motion=None if motion is None else motion[is_used]
        )
        for function, is_used, exceeding in zip(functions, is_known, exceeding, strict=True)
    ]
    return FragilityResult(tuple(fit.named(fit.threshold, im_name, unit) for fit in with_counts))


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


def _check_thresholds(table: CsvTable, request: FragilityRequest) -> None:
    """Raise UsageError if no threshold is specified."""
    if not request.thresholds:
        raise UsageError(f"{table.source}: a demand threshold is required; specify --threshold")


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
