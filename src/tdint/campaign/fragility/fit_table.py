"""Fragility functions of a table: which fit its columns are for, and what is taken from them.

A table of stripes has `im,collapses,records`, one of capacities `capacity[,censored]`, a cloud `im,edp[,censored]`; the
tables of `tdint ida` and of campaigns are understood, too. `threshold`, `im_name` and `unit` may stand beside.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Self

import numpy as np
from numpy.typing import NDArray

from tdint.analysis.given import numbers_of
from tdint.arrays import Array
from tdint.campaign.fragility.fits import CLOUD, FITS, IDA, STRIPES, Fragility, fit_capacities, fit_cloud, fit_stripes
from tdint.campaign.fragility.run_measures import column_of, with_measures
from tdint.csv_table import CsvTable, read_table
from tdint.errors import AnalysisError, ModelError, UsageError
from tdint.input_bytes import is_folder
from tdint.model.damage_states import DONE, FALLEN
from tdint.quantity import suffix
from tdint.tabular import Tabular
from tdint.units import ACCELERATION
from tdint.written_numbers import how_many

NEEDS = (
    "a table has the columns im,collapses,records (stripes), capacity[,censored] (ida) or im,edp[,censored] (cloud), "
    "or is one of tdint ida or tdint campaign"
)
_RUNS = ("status", "peak_drift_ratio")
MEASURES = {"sa_t1": "sa(T1)", "pga": "pga"}
"""Columns of runs in which their intensity may stand, without their unit, and its name."""

EVERY_DEMAND = (0.0, math.inf)
_SAME = 1e-6  # intensities that differ by less than this part are one level
_LEAST_STRIPE = 3  # runs a level has at the least


@dataclass(frozen=True)
class FragilityRequest:
    """What is asked of a table.

    Attributes
    ----------
    fit : str or None
        `stripes`, `ida` or `cloud`; by default what the table's columns are for.
    thresholds : tuple of float
        Demands whose exceedance is asked for; by default those of the table.
    edp_range : tuple of two floats
        Of a cloud: demands below the first are left out, those above the second known only to be above it.
    beta_model : float
        Standard deviation of what is not known of the model.
    measure : str or None
        Of a table of runs: the column of their intensity without its unit, such as pga; sa_t1 by default.
    """

    fit: str | None = None
    thresholds: tuple[float, ...] = ()
    edp_range: tuple[float, float] = EVERY_DEMAND
    beta_model: float = 0.0
    measure: str | None = None


@dataclass(frozen=True, repr=False)
class FragilityResult(Tabular):
    """The functions that could be fitted, why others could not, and what is to be said."""

    functions: tuple[Fragility, ...]
    failures: tuple[AnalysisError, ...] = ()
    warnings: tuple[str, ...] = ()

    @classmethod
    def of(cls, found: Iterable[Fragility | AnalysisError], *warnings: str) -> Self:
        """What came of several fits."""
        every = list(found)
        functions = tuple(one for one in every if isinstance(one, Fragility))
        return cls(functions, tuple(one for one in every if isinstance(one, AnalysisError)), warnings)

    def _headline(self) -> str:
        medians = ", ".join(f"{one.theta:.4g} {one.unit}".rstrip() for one in self.functions)
        return f"of {how_many(len(self.functions), 'function')}, medians {medians}"


def fragility(
    source: str | Path,
    thresholds: float | Sequence[float] = (),
    *,
    fit: str | None = None,
    edp_range: tuple[float, float] = EVERY_DEMAND,
    beta_model: float = 0.0,
    measure: str | None = None,
) -> FragilityResult:
    """Fit lognormal fragility functions to a CSV table, or to the one in a folder of `tdint ida` or `tdint campaign`.

    What is in memory goes to `fit_stripes`, `fit_capacities` or `fit_cloud`.

    Parameters
    ----------
    thresholds : float or sequence of float
        Demands whose exceedance is meant (drift ratios); by default those of the table.
    fit, edp_range, beta_model, measure : optional
        As of `FragilityRequest`.

    Raises
    ------
    UsageError, ModelError
        As of `fit_table`.
    AnalysisError
        None of the functions can be fitted.
    """
    asked = tuple(numbers_of(thresholds, "thresholds").tolist())
    result = fit_table(str(source), FragilityRequest(fit, asked, edp_range, beta_model, measure))
    if not result.functions:
        raise result.failures[0]
    return result


def fit_table(source: str, request: FragilityRequest) -> FragilityResult:
    """Fit fragility functions to a table, or to the one in a folder of `tdint ida` or `tdint campaign`.

    Raises
    ------
    UsageError
        The fit is not for this table, or a threshold is missing.
    ModelError
        The table cannot be read or holds what makes no sense.
    """
    if request.fit is not None and request.fit not in FITS:
        raise UsageError(f"the fit must be one of {', '.join(FITS)}, got {request.fit!r}")
    table = read_table(_file(source, request.fit), NEEDS)
    table = with_measures(table) if request.measure else table
    kind = _kind_of(table, request.fit)
    result = kind.fit(table, request)
    functions = [replace(one, beta_model=request.beta_model) for one in result.functions]
    return replace(result, functions=tuple(functions))


def _kind_of(table: CsvTable, fit: str | None) -> _Kind:
    """The kind of a table by its columns; the fit decides where they are those of several."""
    kinds = [kind for kind in (_STRIPES, _CAPACITIES, _CLOUD, _OF_RUNS) if table.has(*kind.columns)]
    if not kinds:
        raise ModelError(f"{table.source}:1: {NEEDS}; there are {', '.join(table.header)[:200]}")
    suited = [kind for kind in kinds if fit is None or fit in kind.fits]
    if not suited:
        known = " or ".join(dict.fromkeys(one for kind in kinds for one in kind.fits))
        raise UsageError(f"{table.source}: this table is for --fit {known}, not {fit}")
    if len(suited) > 1:
        both = " and of ".join(",".join(kind.columns) for kind in suited)
        fits = " or ".join(f"--fit {kind.fits[0]}" for kind in suited)
        raise UsageError(f"{table.source}:1: this is a table of {both}; say which is meant by {fits}")
    return suited[0]


def _file(source: str, fit: str | None) -> str:
    folder = Path(source)
    if source == "-" or not is_folder(folder):
        return source
    names = ["ida.csv"] if fit == CLOUD and (folder / "ida.csv").is_file() else ["capacities.csv", "runs.csv"]
    if fit == STRIPES:
        names = ["runs.csv"]
    found = next((folder / name for name in names if (folder / name).is_file()), None)
    if found is None:
        raise ModelError(
            f"{source}: this folder has no {' and no '.join(names)}, as tdint ida and tdint campaign write them"
        )
    return str(found)


def _fit_stripes(table: CsvTable, request: FragilityRequest) -> FragilityResult:
    im, hits, total = (np.array(table.numbers(name)) for name in ("im", "collapses", "records"))
    table.check("im", im > 0.0, "must be positive")
    table.check("records", total > 0.0, "must be positive")
    for name, counts in (("records", total), ("collapses", hits)):
        table.check(name, counts == np.floor(counts), "must be a whole number")
    table.check("collapses", (hits >= 0.0) & (hits <= total), "must be from 0 to the number of records")
    found = _by_threshold(table, request, lambda chosen: fit_stripes(im[chosen], hits[chosen], total[chosen]))
    return FragilityResult.of(found)


def _fit_capacities(table: CsvTable, request: FragilityRequest) -> FragilityResult:
    capacity = np.array(table.numbers("capacity", empty=True, positive=True))
    censored = np.array(table.truths("censored"))
    known = np.isfinite(capacity)
    found = [
        _of_state(damage, one)
        for damage, rows in _states(table)
        for one in _by_threshold(table, request, partial(_of_capacities, capacity, censored, known & rows))
    ]
    without = int(np.sum(~known))
    warnings = (f"{table.source}: {how_many(without, 'row')} without a capacity left out",) * (without > 0)
    return FragilityResult.of(found, *warnings)


def _of_capacities(
    capacity: Array, censored: NDArray[np.bool_], known: NDArray[np.bool_], chosen: NDArray[np.bool_]
) -> Fragility:
    return fit_capacities(capacity[chosen & known], censored[chosen & known].tolist())


def _states(table: CsvTable) -> list[tuple[float, NDArray[np.bool_]]]:
    """The states of the building before, and their rows: all rows where the table tells none."""
    if not table.has("damage"):
        return [(math.nan, np.ones(len(table.rows), bool))]
    damage = np.array(table.numbers("damage"))
    return [(one, damage == one) for one in np.unique(damage).tolist()]


def _of_state(damage: float, found: Fragility | AnalysisError) -> Fragility | AnalysisError:
    if isinstance(found, Fragility):
        return replace(found, damage=damage)
    return found if math.isnan(damage) else AnalysisError(f"damage {damage:g}: {found}")


def _fit_cloud(table: CsvTable, request: FragilityRequest) -> FragilityResult:
    im, edp = (np.array(table.numbers(name, positive=True)) for name in ("im", "edp"))
    return _cloud(table, request, im, edp, np.array(table.truths("censored")))


def _fit_runs(table: CsvTable, request: FragilityRequest) -> FragilityResult:
    """Stripes or a cloud of the runs of a study; a run without a result counts neither as standing nor as collapse."""
    runs = _runs_of(table, request)
    stripes = [runs.result & (runs.level == level) for level in np.unique(runs.level[runs.result])]
    in_stripes = all(np.sum(stripe) >= _LEAST_STRIPE for stripe in stripes)
    fit = request.fit or (STRIPES if in_stripes else CLOUD)
    if fit == STRIPES and not in_stripes:
        raise UsageError(f"{table.source}: the runs do not stand at common levels of intensity; use --fit cloud")
    _check_thresholds(table, request)
    lost = int(np.sum(runs.failed))
    warnings = [f"{table.source}: {lost} of {lost + int(np.sum(runs.result))} runs have no result and are left out"]
    if fit == CLOUD:
        of = runs.result
        result = _cloud(table, request, runs.im[of], runs.drift[of], runs.collapsed[of], runs.names)
        of_cloud = tuple(replace(one, failed=lost) for one in result.functions)
        return replace(result, functions=of_cloud, warnings=tuple(warnings * (lost > 0)))
    found = [_tried(one, runs.names, partial(_of_stripes, runs, one)) for one in request.thresholds]
    warnings[0] += (
        ", which leans the fits; how far at most tell those with all of them counted as exceeding, and as not"
    )
    return FragilityResult.of(found, *warnings * (lost > 0))


@dataclass(frozen=True)
class _Runs:
    """Runs of a study, all arrays of shape (n,): intensity and the number of its level, largest drift, whether the
    building collapsed, whether there is a result, whether there is none; the intensity's name and unit."""

    im: Array
    level: NDArray[np.intp]
    drift: Array
    collapsed: NDArray[np.bool_]
    result: NDArray[np.bool_]
    failed: NDArray[np.bool_]
    names: tuple[str, str]


def _runs_of(table: CsvTable, request: FragilityRequest) -> _Runs:
    table.only("building")
    status = np.array(table.texts("status"))
    drift = np.array(table.numbers("peak_drift_ratio", empty=True))
    column, name, unit = _intensity(table, request)
    im = np.array(table.numbers(column, empty=True))
    collapsed = np.isin(status, FALLEN)
    known = im > 0.0
    result = (collapsed | (status == DONE)) & (drift > 0.0) & known
    if not result.any():
        raise ModelError(f"{table.source}: no run has a result")
    im, drift, collapsed, result = im[known], drift[known], collapsed[known], result[known]
    return _Runs(im, levels_of(im), drift, collapsed, result, ~result, (name, unit))


def _intensity(table: CsvTable, request: FragilityRequest) -> tuple[str, str, str]:
    """The column of the runs' intensity, what the intensity is called, and its unit."""
    if request.measure is None and table.has("im"):
        return "im", table.only("im_name"), table.only("unit")
    wanted = request.measure or "sa_t1"
    if request.measure is None and not any(table.has(f"{wanted}{suffix(unit)}") for unit in ACCELERATION):
        return f"{wanted}{suffix('m/s^2')}", MEASURES[wanted], "m/s^2"  # which the table is then said to lack
    column, unit = column_of(table, wanted)
    return column, MEASURES.get(wanted, wanted), unit


def _of_stripes(runs: _Runs, threshold: float) -> Fragility:
    """The fit of the runs that have a result; of the others, if there are any, what they may change."""
    over = runs.collapsed | (runs.drift > threshold)
    found = _stripes(runs, over, runs.result)
    lost = int(np.sum(runs.failed))
    if not lost:
        return found
    every = np.ones_like(runs.result)
    bounds: list[Fragility | None] = []
    for counted in ((over & runs.result) | runs.failed, over & runs.result):
        try:
            bounds.append(_stripes(runs, counted, every))
        except AnalysisError:
            bounds.append(None)
    return replace(found, failed=lost, bounds=(bounds[0], bounds[1]))


def _stripes(runs: _Runs, over: NDArray[np.bool_], taken: NDArray[np.bool_]) -> Fragility:
    places = [taken & (runs.level == level) for level in np.unique(runs.level[taken])]
    middle = [float(np.exp(np.mean(np.log(runs.im[place])))) for place in places]
    return fit_stripes(middle, [int(np.sum(over[place])) for place in places], [int(np.sum(place)) for place in places])


def _cloud(
    table: CsvTable,
    request: FragilityRequest,
    im: Array,
    edp: Array,
    censored: NDArray[np.bool_],
    names: tuple[str, str] | None = None,
) -> FragilityResult:
    _check_thresholds(table, request)
    low, high = request.edp_range
    kept = edp >= low
    censored = (censored | (edp >= high))[kept]
    im_name, unit = names or (table.only("im_name"), table.only("unit"))
    try:
        functions = fit_cloud(im[kept], np.minimum(edp, high)[kept], request.thresholds, censored)
    except AnalysisError as error:
        return FragilityResult((), (error,))
    return FragilityResult(tuple(one.named(one.threshold, im_name, unit) for one in functions))


def _by_threshold(
    table: CsvTable, request: FragilityRequest, fit: Callable[[NDArray[np.bool_]], Fragility]
) -> list[Fragility | AnalysisError]:
    """A fit for each threshold of the table that is asked for; of all rows where it has no thresholds."""
    names = (table.only("im_name"), table.only("unit"))
    if not table.has("threshold"):
        if len(request.thresholds) > 1:
            raise UsageError(f"{table.source}: has no column threshold: one --threshold at most, the one it is for")
        every = np.ones(len(table.rows), bool)
        return [_tried(next(iter(request.thresholds), math.nan), names, lambda: fit(every))]
    thresholds = np.array(table.numbers("threshold", empty=True))
    there = list(dict.fromkeys(thresholds[np.isfinite(thresholds)].tolist()))
    if not there:
        raise ModelError(f"{table.source}: no row has a threshold; fill the column in or leave it out")
    found = []
    for wanted in request.thresholds or there:
        rows = np.isclose(thresholds, wanted, rtol=_SAME, atol=0.0)
        if not rows.any():
            listed = ", ".join(f"{one:g}" for one in there)
            raise UsageError(f"{table.source}: has no threshold {wanted:g}; there are {listed}")
        found.append(_tried(wanted, names, partial(fit, rows)))
    return found


def _tried(threshold: float, names: tuple[str, str], fit: Callable[[], Fragility]) -> Fragility | AnalysisError:
    """The function of a threshold, or why there is none."""
    try:
        return fit().named(threshold, *names)
    except AnalysisError as error:
        return AnalysisError(f"threshold {threshold:g}: {error}" if math.isfinite(threshold) else str(error))


def _check_thresholds(table: CsvTable, request: FragilityRequest) -> None:
    if not request.thresholds:
        raise UsageError(f"{table.source}: which demands are exceeded? Give --threshold")


def levels_of(im: Array) -> NDArray[np.intp]:
    """The number of the level of each intensity, from 0."""
    order = np.argsort(im)
    steps = np.diff(np.log(im[order]), prepend=math.log(float(im[order[0]]))) > _SAME
    result = np.empty(im.size, np.intp)
    result[order] = np.cumsum(steps)
    return result


@dataclass(frozen=True)
class _Kind:
    """A kind of table: columns by which it is known, the fits it is for, the default one first, and what does them."""

    columns: tuple[str, ...]
    fits: tuple[str, ...]
    fit: Callable[[CsvTable, FragilityRequest], FragilityResult]


_STRIPES = _Kind(("im", "collapses", "records"), (STRIPES,), _fit_stripes)
_CAPACITIES = _Kind(("capacity",), (IDA,), _fit_capacities)
_CLOUD = _Kind(("im", "edp"), (CLOUD,), _fit_cloud)
_OF_RUNS = _Kind(_RUNS, (STRIPES, CLOUD), _fit_runs)
