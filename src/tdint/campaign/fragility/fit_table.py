"""Fragility functions of a table: which fit its columns are for, and what is taken from them.

A table of stripes has `im,collapses,records`, one of capacities `capacity[,censored]`, a cloud `im,edp[,censored]`; the
tables of `tdint ida` and of campaigns are understood, too. `threshold`, `im_name` and `unit` may stand beside.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from tdint.campaign.fragility.fits import (
    CLOUD,
    FITS,
    IDA,
    STRIPES,
    Fragility,
    fit_capacities,
    fit_cloud,
    fit_stripes,
)
from tdint.campaign.ida.runs import COLLAPSED, DONE
from tdint.csv_table import CsvTable, read_table
from tdint.errors import AnalysisError, ModelError, UsageError
from tdint.files import is_folder

Array = NDArray[np.float64]

NEEDS = (
    "a table has the columns im,collapses,records (stripes), capacity[,censored] (ida) or im,edp[,censored] (cloud), "
    "or is one of tdint ida or tdint campaign"
)
_RUNS = ("status", "peak_drift_ratio")
_MEASURES = {"im": "", "sa_t1_m_s2": "sa(T1)", "pga_m_s2": "pga"}
"""Columns of runs in which their intensity may stand, and its name; that of `im` stands in the table."""

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
        Of a table of runs: the column of their intensity; sa_t1_m_s2 by default.
    """

    fit: str | None = None
    thresholds: tuple[float, ...] = ()
    edp_range: tuple[float, float] = (0.0, math.inf)
    beta_model: float = 0.0
    measure: str | None = None


@dataclass(frozen=True)
class FragilityResult:
    """The functions that could be fitted, why others could not, and what is to be said."""

    functions: tuple[Fragility, ...]
    failures: tuple[AnalysisError, ...] = ()
    warnings: tuple[str, ...] = ()


def fit_table(source: str, request: FragilityRequest | None = None) -> FragilityResult:
    """Fit fragility functions to a table, or to the one in a folder of `tdint ida` or `tdint campaign`.

    Raises
    ------
    UsageError
        The fit is not for this table, or a threshold is missing.
    ModelError
        The table cannot be read or holds what makes no sense.
    """
    request = request or FragilityRequest()
    if request.fit is not None and request.fit not in FITS:
        raise UsageError(f"the fit must be one of {', '.join(FITS)}, got {request.fit!r}")
    table = read_table(_file(source, request.fit), NEEDS)
    for kind in (_STRIPES, _CAPACITIES, _CLOUD, _OF_RUNS):
        if table.has(*kind.columns):
            break
    else:
        raise ModelError(f"{table.source}:1: {NEEDS}; there are {', '.join(table.header)[:200]}")
    if request.fit is not None and request.fit not in kind.fits:
        raise UsageError(f"{table.source}: this table is for --fit {' or '.join(kind.fits)}, not {request.fit}")
    result = kind.fit(table, request)
    functions = [replace(one, beta_model=request.beta_model) for one in result.functions]
    return replace(result, functions=tuple(functions))


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
    table.check("collapses", (hits >= 0.0) & (hits <= total), "must be from 0 to the number of records")
    return _by_threshold(table, request, lambda chosen: fit_stripes(im[chosen], hits[chosen], total[chosen]))


def _fit_capacities(table: CsvTable, request: FragilityRequest) -> FragilityResult:
    capacity = np.array(table.numbers("capacity", empty=True, positive=True))
    censored = np.array(table.truths("censored"))
    known = np.isfinite(capacity)
    result = _by_threshold(
        table, request, lambda chosen: fit_capacities(capacity[chosen & known], censored[chosen & known].tolist())
    )
    without = int(np.sum(~known))
    return replace(result, warnings=(f"{table.source}: {without} rows without a capacity left out",) * (without > 0))


def _fit_cloud(table: CsvTable, request: FragilityRequest) -> FragilityResult:
    im, edp = (np.array(table.numbers(name, positive=True)) for name in ("im", "edp"))
    return _cloud(table, request, im, edp, np.array(table.truths("censored")))


def _fit_runs(table: CsvTable, request: FragilityRequest) -> FragilityResult:
    """Stripes or a cloud of the runs of a study; a run without a result counts neither as standing nor as collapse."""
    table.only("building")
    status = np.array(table.texts("status"))
    drift = np.array(table.numbers("peak_drift_ratio", empty=True))
    column = request.measure or next((name for name in _MEASURES if name in table.header), "sa_t1_m_s2")
    im = np.array(table.numbers(column, empty=True))
    collapsed = np.isin(status, COLLAPSED)
    used = (collapsed | (status == DONE)) & (drift > 0.0) & (im > 0.0)
    lost = int(np.sum(~used))
    warnings = (f"{table.source}: {lost} of {used.size} runs have no result and are left out",) * (lost > 0)
    if not used.any():
        raise ModelError(f"{table.source}: no run has a result")
    im, drift, collapsed = im[used], drift[used], collapsed[used]
    names = (
        _MEASURES.get(column) or table.only("im_name"),
        table.only("unit") or ("m/s^2" if "_m_s2" in column else ""),
    )
    levels = _levels(im)
    in_stripes = all(np.sum(levels == level) >= _LEAST_STRIPE for level in np.unique(levels))
    fit = request.fit or (STRIPES if in_stripes else CLOUD)
    if fit == STRIPES and not in_stripes:
        raise UsageError(f"{table.source}: the runs do not stand at common levels of {column}; use --fit cloud")
    _check_thresholds(table, request)
    if fit == CLOUD:
        result = _cloud(table, request, im, drift, collapsed, names)
        return replace(result, warnings=warnings)
    places = [levels == level for level in np.unique(levels)]
    count = [int(np.sum(place)) for place in places]
    middle = [float(np.exp(np.mean(np.log(im[place])))) for place in places]
    functions: list[Fragility] = []
    failures: list[AnalysisError] = []
    for threshold in request.thresholds:
        over = collapsed | (drift > threshold)
        hits = [int(np.sum(over[place])) for place in places]
        _attempt(functions, failures, threshold, names, partial(fit_stripes, middle, hits, count))
    return FragilityResult(tuple(functions), tuple(failures), warnings)


def _cloud(
    table: CsvTable, request: FragilityRequest, im: Array, edp: Array, censored: NDArray[np.bool_],
    names: tuple[str, str] | None = None,
) -> FragilityResult:  # fmt: skip
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
) -> FragilityResult:
    """A fit for each threshold of the table that is asked for; of all rows where it has no thresholds."""
    names = (table.only("im_name"), table.only("unit"))
    functions: list[Fragility] = []
    failures: list[AnalysisError] = []
    if not table.has("threshold"):
        if len(request.thresholds) > 1:
            raise UsageError(f"{table.source}: has no column threshold: one --threshold at most, the one it is for")
        every = np.ones(len(table.rows), bool)
        _attempt(functions, failures, next(iter(request.thresholds), math.nan), names, lambda: fit(every))
        return FragilityResult(tuple(functions), tuple(failures))
    thresholds = np.array(table.numbers("threshold", empty=True))
    there = list(dict.fromkeys(thresholds[np.isfinite(thresholds)].tolist()))
    if not there:
        raise ModelError(f"{table.source}: no row has a threshold; fill the column in or leave it out")
    for wanted in request.thresholds or there:
        rows = np.isclose(thresholds, wanted, rtol=_SAME, atol=0.0)
        if not rows.any():
            listed = ", ".join(f"{one:g}" for one in there)
            raise UsageError(f"{table.source}: has no threshold {wanted:g}; there are {listed}")
        _attempt(functions, failures, wanted, names, partial(fit, rows))
    return FragilityResult(tuple(functions), tuple(failures))


def _attempt(
    functions: list[Fragility], failures: list[AnalysisError], threshold: float, names: tuple[str, str],
    fit: Callable[[], Fragility],
) -> None:  # fmt: skip
    try:
        functions.append(fit().named(threshold, *names))
    except AnalysisError as error:
        failures.append(AnalysisError(f"threshold {threshold:g}: {error}" if math.isfinite(threshold) else str(error)))


def _check_thresholds(table: CsvTable, request: FragilityRequest) -> None:
    if not request.thresholds:
        raise UsageError(f"{table.source}: which demands are exceeded? Give --threshold")


def _levels(im: Array) -> NDArray[np.intp]:
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
