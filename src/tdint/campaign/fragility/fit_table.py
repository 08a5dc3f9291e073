"""Fragility functions of a table: which fit its columns are for, and what is taken from them.

A table of stripes has `im,collapses,records`, one of capacities `capacity[,censored]`, a cloud
`im,edp[,censored]`; the tables of `tdint ida` and of campaigns are understood, too. `threshold`,
`im_name` and `unit` may stand beside.
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

from tdint.analysis.given import between, numbers_of
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
from tdint.tabular import Tabular
from tdint.units import ACCELERATION, suffix
from tdint.written_numbers import how_many

NEEDS = (
    "a table has the columns im,collapses,records (stripes), capacity[,censored] (ida) or "
    "im,edp[,censored] (cloud), or is one of tdint ida or tdint campaign"
)
EVERY_DEMAND = (0.0, math.inf)
_LEAST_STRIPE = 3  # runs that a level has at the least; of types motions


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
        Of a cloud: demands below the first are left out, those above the second known only to be
        above it.
    modeling_dispersion : float
        Standard deviation of what is not known of the model.
    measure : str or None
        Of runs: their intensity as `measures.run_measure` reads it, or its column without the unit;
        Sa(T1) by default.
    states : tuple of str
        Names of the states of thresholds, in the order that these rise; ds1, ds2, ... by default.
    pair_demand : str or None
        How the components of pairs count (`tdint.campaign.pairs`); by default as the study beside
        the table has it, else the larger demand.
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
    """The functions that could be fitted, why others could not, and what is to be said."""

    functions: tuple[Fragility, ...]
    failures: tuple[AnalysisError, ...] = ()
    warnings: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()

    @property
    def disagreements(self) -> list[str]:
        """Where functions and counts part by more than their scatter allows, and what no count
        stands beside."""
        return [
            *(text for fit in self.functions if (text := fit.disagreement)),
            *extrapolated(self.functions),
        ]

    @classmethod
    def of(cls, results: Iterable[Fragility | AnalysisError], *warnings: str) -> Self:
        """What came of several fits."""
        every = list(results)
        functions = tuple(fit for fit in every if isinstance(fit, Fragility))
        return cls(
            functions, tuple(fit for fit in every if isinstance(fit, AnalysisError)), warnings
        )

    def _headline(self) -> str:
        medians = ", ".join(
            f"{function.theta:.4g} {function.unit}".rstrip() for function in self.functions
        )
        return f"of {how_many(len(self.functions), 'function')}, medians {medians}"


def fragility(
    source: str | Path,
    thresholds: float | Sequence[float] = (),
    *,
    fit: str | None = None,
    edp_range: tuple[float, float] = EVERY_DEMAND,
    modeling_dispersion: float = 0.0,
    measure: str | None = None,
) -> FragilityResult:
    """Fit lognormal fragility functions to a CSV table, or to the one in a folder of `tdint ida` or
    `tdint campaign`.

    What is in memory goes to `fit_stripes`, `fit_capacities` or `fit_cloud`.

    Parameters
    ----------
    source : str or Path
        The table or the folder.
    thresholds : float or sequence of float
        Demands whose exceedance is meant (drift ratios); by default those of the table.
    fit, edp_range, modeling_dispersion, measure : optional
        As of `FragilityRequest`.

    Returns
    -------
    FragilityResult
        The functions, why others could not be fitted, and what is to be said.

    Raises
    ------
    UsageError, ModelError
        As of `fit_table`.
    AnalysisError
        None of the functions can be fitted.
    """
    asked = tuple(numbers_of(thresholds, "thresholds").tolist())
    modeling_dispersion = between(modeling_dispersion, "modeling_dispersion")
    result = fit_table(
        str(source), FragilityRequest(fit, asked, edp_range, modeling_dispersion, measure)
    )
    if not result.functions:
        raise result.failures[0]
    return result


def fit_table(source: str, request: FragilityRequest) -> FragilityResult:
    """Fit fragility functions to a table, or to the one in a folder of `tdint ida` or `tdint
    campaign`.

    Raises
    ------
    UsageError
        The fit is not for this table, or a threshold is missing.
    ModelError
        The table cannot be read or holds what makes no sense.
    """
    if request.fit is not None and request.fit not in FITS:
        raise UsageError(f"the fit must be one of {', '.join(FITS)}, got {request.fit!r}")
    # Of a folder the table that goes with the fit: what a study has found before its runs, but for
    # stripes.
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
                f"{source}: this folder has no {' and no '.join(names)}, as tdint ida and tdint "
                "campaign write them"
            )
        file = str(path)
    table = read_table(file, NEEDS)
    table = with_measures(table) if request.measure else table
    # The kind of a table by its columns; the fit decides where they are those of several.
    kinds = [kind for kind in (_STRIPES, _CAPACITIES, _CLOUD, _OF_RUNS) if table.has(*kind.columns)]
    if not kinds:
        raise ModelError(f"{table.source}:1: {NEEDS}; there are {', '.join(table.header)[:200]}")
    # What is asked for decides among kinds that the columns allow; nothing is guessed between two.
    suited = [kind for kind in kinds if request.fit in (None, *kind.fits)]
    if not suited:
        possible = " or ".join(dict.fromkeys(fit for kind in kinds for fit in kind.fits))
        raise UsageError(f"{table.source}: this table is for --fit {possible}, not {request.fit}")
    if len(suited) > 1:
        both = " and of ".join(",".join(kind.columns) for kind in suited)
        fits = " or ".join(f"--fit {kind.fits[0]}" for kind in suited)
        raise UsageError(
            f"{table.source}:1: this is a table of {both}; say which is meant by {fits}"
        )
    # The dispersion of the model is not fitted: each function takes it along.
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

    # The counts go along with the function, for pictures and for the test of its shape.
    def fit(chosen: NDArray[np.bool_]) -> Fragility:
        levels, all_runs, share = (
            im[chosen],
            total[chosen],
            np.sum(hits[chosen]) / np.sum(total[chosen]),
        )
        function = fit_stripes(levels, hits[chosen], all_runs)
        told = function.beside_counts(levels, hits[chosen] / all_runs, runs=all_runs)
        # Counts that others publish with their interval keep it where the median alone lies beyond
        # their levels.
        return (
            replace(told, covariance=function.covariance)
            if SELDOM <= share <= 1.0 - SELDOM
            else told
        )

    functions = _by_threshold(table, request, fit)
    return FragilityResult.of(functions)


def _fit_capacities(table: CsvTable, request: FragilityRequest) -> FragilityResult:
    # A row without a capacity tells nothing, not even that the building stood: it is left out and
    # told.
    capacity = np.array(table.numbers("capacity", empty=True, positive=True))
    censored = np.array(table.truths("censored"))
    finite = np.isfinite(capacity)
    # Of each state of the building before, if the table tells such states, a fit of its own rows.
    states = [(math.nan, finite)]
    if table.has("damage"):
        damage = np.array(table.numbers("damage"))
        states = [(value, finite & (damage == value)) for value in np.unique(damage).tolist()]
    functions: list[Fragility | AnalysisError] = []
    motion = _told_motions(table)
    for state, rows in states:

        def fit(chosen: NDArray[np.bool_], rows: NDArray[np.bool_] = rows) -> Fragility:
            of = chosen & rows
            # Capacities of motions of their own are independent: their errors are known in closed
            # form.
            alike = motion is not None and np.unique(motion[of]).size < np.sum(of)
            (function,) = over_motions(
                lambda taken: [fit_capacities(capacity[taken], censored[taken].tolist())],
                of,
                motion if alike else None,
            )
            assert isinstance(function, Fragility)
            # Known ones are all beyond.
            return function.within(capacity[of], min(0.5, 1.0 - float(np.mean(censored[of]))))

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
    warnings = (f"{table.source}: {how_many(without, 'row')} without a capacity left out",) * (
        without > 0
    )
    # Capacities of pairs are those of the choice that the table states.
    if table.has("pair_demand"):
        stated = table.only("pair_demand")
        if request.pair_demand not in (None, stated):
            raise UsageError(
                f"{table.source}: its capacities were found with pair_demand {stated}; call "
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
        table, request, im, edp, np.array(table.truths("censored")), motion=_told_motions(table)
    )


def _told_motions(table: CsvTable) -> NDArray[np.intp] | None:
    """The event of each row of a table, or its motion; None where the table tells neither."""
    return motions_of(table) if table.has("event") or table.has("record") else None


def _fit_runs(table: CsvTable, request: FragilityRequest) -> FragilityResult:
    """Stripes or a cloud of the runs of a study; a run without a result counts neither as standing
    nor as collapse."""
    # Stripes where enough runs stand at each level, else a cloud; asked for, stripes need such
    # levels.
    runs = _runs_of(table, request)
    result = _fit_known_runs(table, request, runs)
    if not runs.pairs.pairs:
        return result
    functions = (replace(item, pair_demand=runs.pairs.stated) for item in result.functions)
    notes = () if request.pair_demand else (runs.pairs.note(),)
    return replace(result, functions=tuple(functions), notes=(*result.notes, *notes))


def _fit_known_runs(table: CsvTable, request: FragilityRequest, runs: _Runs) -> FragilityResult:
    """Stripes or a cloud of these runs."""
    stripes = [runs.result & (runs.level == level) for level in np.unique(runs.level[runs.result])]
    in_stripes = all(np.sum(stripe) >= _LEAST_STRIPE for stripe in stripes)
    fit = request.fit or (STRIPES if in_stripes else CLOUD)
    # A cloud's runs have intensities of their own: each would be a stripe of one.
    if fit == STRIPES and not in_stripes:
        raise UsageError(
            f"{table.source}: the runs do not stand at common levels of intensity; use --fit cloud"
        )
    _check_thresholds(table, request)
    lost = int(np.sum(~runs.result))
    left_out = (
        f"{table.source}: {lost} of {lost + int(np.sum(runs.result))} runs have no result and are "
        "left out"
    )
    if fit == CLOUD:
        # A collapse is beyond every threshold, and no more is known: where a runaway stopped is the
        # method's.
        of = runs.result
        drift = np.where(runs.collapsed, max(request.thresholds), runs.drift)[of]
        result = _cloud(
            table, request, runs.im[of], drift, runs.collapsed[of], runs.names, runs.motion[of]
        )
        of_cloud = tuple(replace(item, failed=lost) for item in result.functions)
        return replace(result, functions=of_cloud, warnings=(left_out,) * (lost > 0))
    functions = [
        _tried(drift, runs.names, partial(_of_stripes, runs, drift)) for drift in request.thresholds
    ]
    leaning = (
        "which leans the fits; how far at most tell those with all of them counted as exceeding, "
        "and as not"
    )
    return FragilityResult.of(functions, *(f"{left_out}, {leaning}",) * (lost > 0))


@dataclass(frozen=True)
class _Runs:
    """Runs of a study, all arrays of shape (n,): intensity and the number of its level, largest
    drift, whether the building collapsed, whether there is a result, the ground motion; the
    intensity's name and unit, and the rule by which components of pairs were combined."""

    im: Array
    level: NDArray[np.intp]
    drift: Array
    collapsed: NDArray[np.bool_]
    result: NDArray[np.bool_]
    motion: NDArray[np.intp]
    names: tuple[str, str]
    pairs: PairRule


def _runs_of(table: CsvTable, request: FragilityRequest) -> _Runs:
    try:
        table.only("building")
    except ModelError as error:
        raise ModelError(
            f"{error}, or of a campaign's folder fit functions of each with --by building"
        ) from None
    status = np.array(table.texts("status"))
    drift = np.array(table.numbers("peak_drift_ratio", empty=True))

    # Where no measure is asked for, the intensity of the table itself, or else Sa(T1).
    if request.measure is None and table.has("im"):
        column, name, unit = "im", table.only("im_name"), table.only("unit")
    else:
        measure = measure_named(request.measure or "sa")
        name = measure.label(period_beside(table))
        if request.measure is None and not any(
            table.has(f"{measure.column}{suffix(unit)}") for unit in ACCELERATION
        ):
            column, unit = (
                f"{measure.column}{suffix('m/s^2')}",
                "m/s^2",
            )  # which the table is then said to lack
        else:
            column, unit = column_of(table, measure.column)
    im = np.array(table.numbers(column, empty=True))
    motion, collapsed = motions_of(table), np.isin(status, FALLEN)
    known = collapsed | (status == DONE)

    # The runs under a pair at a level are one, by the rule for pairs.
    rule, groups = rows_of_motions(table, request.pair_demand)
    if len(groups) < len(table.rows):
        im = np.array([float(np.prod(im[group])) ** (1.0 / len(group)) for group in groups])
        drift = np.array([rule.combine(drift[group]) for group in groups])
        known = np.array([np.all(known[group]) for group in groups])
        collapsed = np.array([np.any(collapsed[group]) for group in groups])
        motion = motion[[group[0] for group in groups]]
    elif column != "im":
        im = of_pairs(table, im)

    # A run without an intensity is none; one without a drift ratio has no result.
    positive = im > 0.0
    result = known & (drift > 0.0) & positive
    if not result.any():
        raise ModelError(f"{table.source}: no run has a result")
    im, drift, motion = im[positive], drift[positive], motion[positive]
    collapsed, result = collapsed[positive], result[positive]
    return _Runs(im, levels_of(im), drift, collapsed, result, motion, (name, unit), rule)


def _of_stripes(runs: _Runs, threshold: float) -> Fragility:
    """The fit of the runs that have a result; of the others, if there are any, what they may
    change."""
    over = runs.collapsed | (runs.drift > threshold)
    of = runs.result
    (function,) = over_motions(lambda taken: [_stripes(runs, over, taken)], of, runs.motion)
    assert isinstance(function, Fragility)
    function = function.beside_counts(runs.im[of], over[of].astype(float), motion=runs.motion[of])
    lost = int(np.sum(~runs.result))
    # Nothing is known of runs that failed: at most all of them exceed, at least none.
    if not lost:
        return function
    every = np.ones_like(runs.result)
    # With all counted in a fit may be impossible; then that bound is not known.
    bounds: list[Fragility | None] = []
    for counted in (over | ~runs.result, over & runs.result):
        try:
            bounds.append(_stripes(runs, counted, every))
        except AnalysisError:
            bounds.append(None)
    return replace(function, failed=lost, bounds=(bounds[0], bounds[1]))


def _stripes(runs: _Runs, over: NDArray[np.bool_], taken: NDArray[np.bool_]) -> Fragility:
    places = [taken & (runs.level == level) for level in np.unique(runs.level[taken])]
    # A level's intensities differ by rounding: their geometric mean stands for all.
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
    _check_thresholds(table, request)
    # Below the range that is asked for demands say nothing of damage, above it only that they are
    # above.
    low, high = request.edp_range
    kept = edp >= low
    # Of a demand that is known to lie above a limit below the threshold it is not known whether it
    # is beyond.
    told = [kept & ~(censored & (edp < threshold)) for threshold in request.thresholds]
    beyond = [((edp > threshold) | censored).astype(float) for threshold in request.thresholds]
    censored = censored | (edp >= high)
    im_name, unit = names or (table.only("im_name"), table.only("unit"))

    def fit(of: NDArray[np.bool_]) -> list[Fragility | AnalysisError]:
        return [*fit_cloud(im[of], np.minimum(edp, high)[of], request.thresholds, censored[of])]

    try:
        functions = [
            item for item in over_motions(fit, kept, motion) if isinstance(item, Fragility)
        ]
    except AnalysisError as error:
        return FragilityResult((), (error,))
    # Counts stand beside it of the runs that are known to be on one side of the threshold.
    counted = [
        function.beside_counts(im[of], over[of], motion=None if motion is None else motion[of])
        for function, of, over in zip(functions, told, beyond, strict=True)
    ]
    return FragilityResult(tuple(fit.named(fit.threshold, im_name, unit) for fit in counted))


def _by_threshold(
    table: CsvTable, request: FragilityRequest, fit: Callable[[NDArray[np.bool_]], Fragility]
) -> list[Fragility | AnalysisError]:
    """A fit for each threshold of the table that is asked for; of all rows where it has no
    thresholds."""
    names = (table.only("im_name"), table.only("unit"))
    # Without the column all rows are of one threshold, whatever it is.
    if not table.has("threshold"):
        if len(request.thresholds) > 1:
            raise UsageError(
                f"{table.source}: has no column threshold: one --threshold at most, the one it is "
                "for"
            )
        every = np.ones(len(table.rows), bool)
        return [_tried(next(iter(request.thresholds), math.nan), names, lambda: fit(every))]
    # Thresholds went through a text: they are compared but for rounding.
    thresholds = np.array(table.numbers("threshold", empty=True))
    there = list(dict.fromkeys(thresholds[np.isfinite(thresholds)].tolist()))
    if not there:
        raise ModelError(
            f"{table.source}: no row has a threshold; fill the column in or leave it out"
        )
    functions = []
    for threshold in request.thresholds or there:
        rows = np.isclose(thresholds, threshold, rtol=SAME_LEVEL, atol=0.0)
        if not rows.any():
            listed = ", ".join(f"{drift:g}" for drift in there)
            raise UsageError(f"{table.source}: has no threshold {threshold:g}; there are {listed}")
        functions.append(_tried(threshold, names, partial(fit, rows)))
    return functions


def _tried(
    threshold: float, names: tuple[str, str], fit: Callable[[], Fragility]
) -> Fragility | AnalysisError:
    """The function of a threshold, or why there is none."""
    try:
        return fit().named(threshold, *names)
    except AnalysisError as error:
        return AnalysisError(
            f"threshold {threshold:g}: {error}" if math.isfinite(threshold) else str(error)
        )


def _check_thresholds(table: CsvTable, request: FragilityRequest) -> None:
    if not request.thresholds:
        raise UsageError(f"{table.source}: which demands are exceeded? Give --threshold")


@dataclass(frozen=True)
class _Kind:
    """A kind of table: columns by which it is known, the fits it is for, the default one first, and
    what does them."""

    columns: tuple[str, ...]
    fits: tuple[str, ...]
    fit: Callable[[CsvTable, FragilityRequest], FragilityResult]


_STRIPES = _Kind(("im", "collapses", "records"), (STRIPES,), _fit_stripes)
_CAPACITIES = _Kind(("capacity",), (IDA,), _fit_capacities)
_CLOUD = _Kind(("im", "edp"), (CLOUD,), _fit_cloud)
_OF_RUNS = _Kind(("status", "peak_drift_ratio"), (STRIPES, CLOUD), _fit_runs)


# ---- Fragility functions of the types of buildings of a campaign, or of each building, one for
# each damage state, of its store
#
# A run under which a building falls exceeds all states; no more is known of its demand than that it
# is above the heaviest one, wherever its runaway stopped. The dispersion of the thresholds is part
# of beta: stripes count probabilities of exceedance, a cloud sees each run with thresholds so
# dispersed.

_SAME_PERIOD = 1e-6  # tables write six digits or more
_THREE = math.sqrt(1.5) * np.array(
    [-1.0, 0.0, 1.0]
)  # of mean 0 and variance 1; twenty give losses the same to 1 %


@dataclass(frozen=True)
class TypeRuns:
    """The runs of a type that have a result, all arrays of shape (runs,).

    Attributes
    ----------
    states : DamageStates
        Of the type.
    im, demand : ndarray
        Intensity and what the states are told by, SI units; of a fall the median of the heaviest
        state.
    fallen : ndarray of bool
        Whether the building fell.
    motion : ndarray of int
        The ground motion, or the event of ground motion fields.
    failed : int
        Runs without a result.
    name, unit : str
        Of the intensity measure.
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
"""What functions of a campaign may be of."""


def fit_types(folder: Path, request: FragilityRequest, by: str = TYPE) -> FragilityResult:
    """Fit a function for each type of buildings of a campaign, or for each building, and each of
    its damage states; of buildings the states may be thresholds of the largest drift ratio.

    Raises
    ------
    UsageError
        The folder holds no campaign, or one that says nothing of damage; a fit or a threshold that
        is not for it; a measure that its runs do not have.
    OutputError
        The store cannot be read.
    """
    # States of the campaign are told apart by type; a threshold is one for all buildings.
    if request.thresholds and by == TYPE:
        raise UsageError(
            "functions by type are of the damage states of the campaign: leave --threshold out"
        )
    if request.fit == IDA:
        raise UsageError(f"functions by {by} are fitted to runs: --fit stripes or cloud")
    measure = measure_named(request.measure or "sa")
    # Thresholds of the largest drift ratio are states of all buildings.
    medians = tuple(sorted(request.thresholds))
    names = request.states or tuple(f"ds{number}" for number in range(1, len(medians) + 1))
    if medians and len(names) != len(medians):
        raise UsageError(
            f"{how_many(len(medians), 'threshold')}: name as many --states, got {len(names)}"
        )
    of_all = DamageStates("drift_ratio", names, medians) if medians else None
    # The store is read once, building by building; fits follow when it is closed.
    with open_existing(folder) as store:
        check_chunks(store)
        if not (store.damage() or of_all):
            way = "add `damage` to its file and call it again"
            more = "; or give --threshold" if by == BUILDING else ""
            raise UsageError(f"{folder}: this campaign says nothing of damage; {way}{more}")
        intensities = RunIntensities(store, folder, measure, request.pair_demand)
        # Of ground motion fields what errs alike is an event, whose numbers are those of the draws.
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
    # What cannot be fitted says of which type and state, and stops no other.
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
    warnings = (f"{folder}: {how_many(lost, 'run')} without a result left out",) * (lost > 0)
    notes = (intensities.note,) * bool(intensities.note)
    if rule.pairs and not request.pair_demand:
        notes += (rule.note(),)
    fitted = [
        one if isinstance(one, AnalysisError) else replace(one, pair_demand=rule.stated)
        for one in fitted
    ]
    return replace(FragilityResult.of(fitted, *warnings), notes=notes)


@dataclass
class _Gathered:
    """The runs of a type, as they come: numbers one after the other."""

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
        """Take the runs of a building with their intensities, or the motions that they are of."""
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
        """All of them as arrays."""
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
    """The function of each state, or why there is none."""
    if not runs.im.size:
        return [AnalysisError("no run has a result") for _ in runs.states.states]
    # Stripes need motions enough at every level, with the buildings of a type taken together.
    level = levels_of(runs.im)
    of_level = np.bincount(
        np.unique(np.column_stack([level, runs.motion]), axis=0)[:, 0]
    )  # how many motions
    stripes = of_level.size > 1 and int(of_level.min()) >= _LEAST_STRIPE
    if request.fit == STRIPES and not stripes:
        raise UsageError(
            "the runs do not stand at common levels of intensity; use --fit cloud, or another --im"
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
    """The probability that each run is in a state or a heavier one, shape (runs, states), 1 after a
    fall."""
    return np.where(runs.fallen[:, np.newaxis], 1.0, exceedance(runs.states, runs.demand))


def _type_stripes(
    runs: TypeRuns, level: NDArray[np.intp], taken: NDArray[np.bool_]
) -> list[Fragility | AnalysisError]:
    """Of probabilities of exceedance at levels."""
    # Levels that keep a run after some were left out, numbered anew.
    place = np.unique(level[taken], return_inverse=True)[1]
    total = np.bincount(place).astype(float)
    im = np.exp(np.bincount(place, np.log(runs.im[taken])) / total)
    functions: list[Fragility | AnalysisError] = []
    for row in _beyond(runs)[taken].T:
        count = np.minimum(
            np.bincount(place, row), total
        )  # sums of probabilities are off by rounding
        try:
            functions.append(fit_stripes(im, count, total))
        except AnalysisError as error:
            functions.append(error)
    return functions


def _type_cloud(
    runs: TypeRuns, request: FragilityRequest, taken: NDArray[np.bool_]
) -> list[Fragility | AnalysisError]:
    """Of a line through the demands, those of falls known only to be above the heaviest state.

    Of the states of a campaign each run is seen with three equally likely thresholds of their
    dispersion, which falls exceed whatever it is: beyond the heaviest state and below the lightest
    one no more is known. Of thresholds that are asked for all demands count as they are, so that no
    function hangs on which others are asked for."""
    # A demand of zero has no logarithm, those below the range are elastic.
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
    # For the picture the demands themselves stand, not the three that each was seen with.
    below = ~limited & (demand < lightest)
    counts: dict[str, Any] = {"records": im.size, "censored": int(np.sum(limited))}
    points: dict[str, Any] = {"im": im, "edp": demand, "censored": limited, "below": below}
    return [
        replace(function, cloud=function.cloud and replace(function.cloud, **points), **counts)
        for function in of_states
    ]
