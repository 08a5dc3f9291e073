"""Intensity measures of the runs of a campaign, and errors of fits to runs of which some have the
same ground motion.

The measures are Sa at a period or at the first period of each building, Sa_avg, the maximum
displacement of a yielding oscillator (SDi, Tothong and Cornell 2006), peaks, Arias intensity,
cumulative absolute velocities, and durations. They refer to the component of the run times its
factor. Measures that are not a power of the factor (SDi, CAV5) are computed for each factor.

Comparison of intensity measures by their efficiency and sufficiency.

Efficiency is the standard deviation beta of ln EDP about its line over ln IM (Luco and Cornell
2007, Earthquake Spectra 23(2)). Proficiency is beta over the slope of the line (Padgett, Nielson
and DesRoches 2008, Earthquake Engineering and Structural Dynamics 37). A measure is sufficient if
the residuals of the line do not depend on other characteristics of the ground motions. The slope
of the residuals over a characteristic is reported with its p-value. Runs under the same ground
motion, or of the same event if events are known, are treated as correlated.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from functools import cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from tdint.arrays import Array
from tdint.csv_table import CsvTable, read_table
from tdint.errors import AnalysisError, ModelError, UsageError, did_you_mean
from tdint.files import is_file
from tdint.grids import Grid, parse_grid
from tdint.ground_motion.axes import intensity_of
from tdint.ground_motion.measures import MEASURES as MEASURES_OF_MOTION
from tdint.ground_motion.record import Record
from tdint.number_parsing import parse_ratio
from tdint.output.tables.table import Cell
from tdint.response.pairs import (
    LARGER,
    SEPARATE,
    Indices,
    PairRule,
    Run,
    demands_of_motions,
    first_runs,
    geometric_means,
    indices_of,
    outcomes_of,
    outcomes_of_motions,
    recording_numbers,
    with_outcomes,
)
from tdint.response.spectra.elastic import SA_DAMPING, spectrum
from tdint.response.spectra.inelastic import constant_strength
from tdint.studies.campaign.plan import Plan
from tdint.studies.campaign.story_profiles import level_measure
from tdint.studies.fragility.building_damage import BuildingDamage
from tdint.studies.fragility.fragility_function import JACKKNIFE, Fragility
from tdint.studies.motions import intensity
from tdint.studies.store.opening import open_existing
from tdint.studies.store.result_store import FILE, Store
from tdint.units import ACCELERATION, LENGTH, VELOCITY, suffix

FIRST = "T1"
"""Name of the first period of each building."""


@dataclass(frozen=True)
class RunMeasure:
    """Intensity measure of a run: of a scaled record, and for some measures of the first period of
    the building.

    Attributes
    ----------
    column : str
        Name of the column in tables, without the unit.
    unit, meaning : str
        SI unit and description.
    value : callable
        Function that computes the measure from a record and the first period of the building, s.
    power : float | None
        The measure is proportional to this power of the scale factor of the record; None if it must
        be computed for each scale factor.
    called : str
        Name in tables of functions, where {} is replaced by the first period of the building.
    """

    column: str
    unit: str
    meaning: str
    value: Callable[[Record, float], float]
    power: float | None = 1.0
    called: str = ""

    def label(self, period: float | None) -> str:
        """Return the name of the measure in tables of functions.

        Parameters
        ----------
        period : float | None
            First period of all buildings, s. If it is `None` (different or unknown periods), the
            name contains T1 instead of the period.
        """
        return self.called.format(FIRST if period is None else f"{period:.6g}")

    def of(self, record: Record, factor: float, period: float) -> float:
        """Return the measure of a record times `factor`, for a building with the first period
        `period` (s); nan if it cannot be computed."""
        try:
            if self.power is None:
                scaled = record.scaled(abs(factor))
                return float(intensity_of(scaled, lambda part: self.value(part, period)))
            unscaled = float(intensity_of(record, lambda part: self.value(part, period)))
            return unscaled * float(abs(factor) ** self.power)
        except AnalysisError:  # the period is too short for the sampling interval of the record
            return math.nan


_FORMS = ("sa[:T1|SECONDS]", "sa-avg[:FIRST:LAST[:COUNT]]", "sdi:T1|SECONDS:STRENGTH")


def run_measure(text: str) -> RunMeasure:
    """Return the intensity measure that a text specifies.

    Parameters
    ----------
    text : str
        For example `pgv`, `sa:0.5` (period in s), `sa` (at the first period of each building),
        `sa-avg:0.2:2` (periods in s), `sa-avg` (from 0.2 to 3 times the first period), `sdi:1:0.1`
        or `sdi:T1:10%` (period and yield force over weight).

    Raises
    ------
    UsageError
        The measure is unknown, or a number is missing or invalid.
    """
    name, _, parameters = text.strip().partition(":")
    # The name of the column is accepted also, for example d5_75 for d5-75.
    motion_measure = MEASURES_OF_MOTION.get(name.replace("_", "-"))
    if motion_measure and not parameters:
        compute = motion_measure.of
        return RunMeasure(
            motion_measure.head,
            motion_measure.unit,
            motion_measure.meaning,
            lambda record, period: compute(record),  # independent of the period of the building
            motion_measure.power,
            motion_measure.name,
        )
    parsers = {"sa": _spectral, "sa-avg": _average, "sdi": _inelastic}
    if name not in parsers:
        hint = did_you_mean(name, [*parsers, *MEASURES_OF_MOTION])
        raise intensity.unknown_measure(text, (*MEASURES_OF_MOTION, *_FORMS), hint)
    try:
        return parsers[name](parameters)
    except (UsageError, ValueError) as error:
        form = next(possible for possible in _FORMS if re.match(rf"{name}[:\[]", possible))
        raise UsageError(f"{text!r}: {error}; expected {form}") from None


def _period(text: str) -> tuple[float | None, str, str]:
    """Parse the period of an intensity measure: `T1` or an empty text for the first period of each
    building, or a number of seconds.

    The result is the period (s; None for the first period), its text in descriptions, and its text
    in names, where {} is replaced by the first period later. ValueError or UsageError is raised
    for any other text.
    """
    if text in ("", FIRST):
        return None, "the first period of the building", "{}"
    value = float(text)
    intensity.check_period(value)
    return value, f"{value:g} s", f"{value:g}"


def _column_name(*parts: object) -> str:
    """Return the name of a column, for example sa_0p5 for ("sa", 0.5)."""
    texts = [f"{part:g}" if isinstance(part, float) else str(part) for part in parts]
    return "_".join(texts).replace(".", "p")


def _spectral(parameters: str) -> RunMeasure:
    """Return the measure Sa at a period, for the text of the period (`_period`)."""
    period, period_text, symbol = _period(parameters)

    def value(record: Record, first_period: float) -> float:
        """Return Sa of a record, m/s^2."""
        return float(spectrum(record, np.array([period or first_period]), SA_DAMPING).psa[0])

    return RunMeasure(
        _column_name("sa", period or "t1"),
        "m/s^2",
        f"Sa at {period_text}, 5 % damping",
        value,
        called=f"sa({symbol})",
    )


def _average(parameters: str) -> RunMeasure:
    """Return the measure Sa_avg, the geometric mean of Sa over a range of periods. `parameters` is
    FIRST:LAST[:COUNT] in s, or empty for the default multiples of the first period of the building
    (`AVERAGE`)."""
    with_count = (
        parameters if parameters.count(":") == 2 else f"{parameters}:{intensity.AVERAGE.count}"
    )
    grid = parse_grid(with_count) if parameters else None
    if grid is not None and grid.count == 1:
        raise UsageError(f"an average requires a first and a last period, got {parameters!r}")
    # The default range contains the periods of higher modes and of the damaged building.
    if isinstance(grid, Grid):
        range_text = f"{grid.first:g} to {grid.last:g} s"
    else:
        low, high = intensity.AVERAGE.first, intensity.AVERAGE.last
        range_text = f"{low:g} to {high:g} times the first period of the building"

    def value(record: Record, first_period: float) -> float:
        """Return Sa_avg of a record, m/s^2."""
        periods = grid.values() if grid else first_period * intensity.AVERAGE.values()
        return intensity.geometric_mean(spectrum(record, periods, SA_DAMPING).psa)

    column = _column_name("sa_avg", grid.first, grid.last) if grid else "sa_avg_t1"
    called = f"sa-avg({grid.first:g}:{grid.last:g})" if grid else "sa-avg({})"
    return RunMeasure(
        column,
        "m/s^2",
        f"geometric mean of Sa from {range_text}, 5 % damping",
        value,
        called=called,
    )


def _inelastic(parameters: str) -> RunMeasure:
    """Return the measure SDi, the maximum displacement of an elastoplastic oscillator. `parameters`
    is PERIOD:STRENGTH, where the strength is the yield force divided by the weight."""
    parameter_text, _, strength_text = parameters.partition(":")
    period, oscillator_period_text, symbol = _period(parameter_text)
    strength = parse_ratio(strength_text)
    if not 0.0 < strength < math.inf:
        raise UsageError(
            f"the strength (yield force divided by weight) must be positive, got {strength_text!r}"
        )

    def value(record: Record, first_period: float) -> float:
        """Return the maximum displacement of the oscillator under a record, m."""
        periods = np.array([period or first_period])
        (inelastic,) = constant_strength(record, periods, [strength], SA_DAMPING)
        return float(inelastic.sd[0])

    meaning = (
        f"maximum displacement of an elastoplastic oscillator of {oscillator_period_text}, 5 % "
        f"damping, yielding at {strength:g}"
    )
    called = f"sdi({symbol},{strength:g})"
    return RunMeasure(
        _column_name("sdi", period or "t1", strength),
        "m",
        f"{meaning} of its weight",
        value,
        None,
        called,
    )


def measured(
    plan: Plan, store: Store, measures: Sequence[RunMeasure]
) -> Iterator[tuple[Cell, ...]]:
    """Yield the rows of measures.csv: the intensity measures of all stored runs of a campaign, in
    the order of runs.csv. The first cells identify the run (`_KEYS`)."""
    names, records = store.buildings(), store.records()
    # First period of a building by its number, s
    period = cache(lambda building: plan.buildings[building].subject().period)

    # Values of unscaled records are computed one time.
    measures = [
        measure if measure.power is None else replace(measure, value=cache(measure.value))
        for measure in measures
    ]
    # The order keeps the runs of a building together, so that its period is computed one time.
    query = (
        "SELECT building, record, scale, sample FROM run_rows ORDER BY building, record, scale, "
        "sample"
    )
    for building, motion, scale, sample in store.connection.execute(query):
        record, first_period = plan.motions[motion].record, period(building)
        values = (measure.of(record, scale, first_period) for measure in measures)
        yield (names[building][0], *records[motion][:2], scale, sample, *values)


def measure_named(text: str) -> RunMeasure:
    """Return the intensity measure for a fit to a table of runs.

    Parameters
    ----------
    text : str
        A measure that `run_measure` accepts, `sa_t1` (the name of the column of `sa`, without its
        unit), or the name of another column of the table without its unit. The values of such a
        column are only read; they cannot be computed from records.

    Raises
    ------
    UsageError
        The text is not a measure, and cannot be the name of a column.
    """
    try:
        return run_measure(text)
    except UsageError:
        # The table of runs contains the measure `sa` in the column sa_t1.
        if text == "sa_t1":
            return run_measure("sa")
        if not re.fullmatch(r"\w+", text):  # not the name of a column
            raise
        # The values are read from the column, so the function that computes them is not used.
        return RunMeasure(text, "", text, lambda record, period: math.nan, called=text)


class RunIntensities:
    """Intensities of the runs of a store.

    Both components of a pair have the geometric mean of their intensities, because the hazard
    refers to pairs. If the campaign has scaled the runs to levels of this intensity measure, the
    intensities are the levels. Sa(T1) and PGA are columns of the store; other measures are read
    from measures.csv.

    Parameters
    ----------
    folder : Path
        Directory of the campaign, which may contain measures.csv.

    Raises
    ------
    UsageError
        The runs have no such measure.
    """

    def __init__(self, store: Store, folder: Path, measure: RunMeasure) -> None:
        """Select the source of the intensities: the levels of the campaign, otherwise values of the
        store (Sa(T1) and PGA), otherwise the file measures.csv."""
        self._measure, self._file = measure, folder / MEASURES
        records = store.records()
        self._record_names = {
            number: (name, component) for number, (name, component, _) in records.items()
        }
        self._has_pairs = store.pair_rule().pairs > 0
        self._is_level = measure.column == LEVEL
        self.unit = measure.unit
        # Attribute of `BuildingDamage` with the values; the store contains only Sa(T1) and PGA.
        stored_name = {"sa_t1": "sa", "pga": "pga"}.get(measure.column)
        self._stored_name = None if self._is_level else stored_name
        self._values: dict[tuple[str, ...], float] = {}
        if not (self._is_level or stored_name):
            # Values of the file of `tdint campaign --im`, SI units, by the names of the run
            if not is_file(self._file):
                raise UsageError(no_measure_message(str(self._file.parent), measure.column))
            table = read_table(str(self._file), "the measures of a campaign are a table")
            column_name, unit = column_of(table, measure.column)
            si, factor = _UNITS[unit]
            self.unit = measure.unit or si
            values = factor * np.array(table.numbers(column_name, empty=True))
            self._values = dict(zip(_keys(table), values.tolist(), strict=True))

    @property
    def note(self) -> str:
        """Note for the user on the intensity of pairs; empty without pairs, and if the intensities
        are levels."""
        if not self._has_pairs or self._is_level:
            return ""
        return (
            f"{self._measure.called.format(FIRST)} of a pair is the geometric mean of both "
            "components"
        )

    def of(self, building: BuildingDamage) -> Array:
        """Return the intensity of each run of a building, shape (runs,), SI units; nan if it is
        unknown.

        Raises
        ------
        ModelError
            A run of the store is missing in measures.csv.
        """
        if self._is_level:
            return building.level
        if self._stored_name:
            values = np.array(getattr(building, self._stored_name), float)
        else:
            values = np.array([self._value(building, run) for run in building.keys])
        # The intensity of a pair does not depend on the rule for its demand.
        if self._has_pairs:
            values = geometric_means(building.motion, values)[building.motion]
        return values

    def _value(self, building: BuildingDamage, run: Run) -> float:
        """Return the value of a run in measures.csv, SI units; nan if the cell is empty."""
        names = self._record_names[run.motion]
        key = (building.building, *names, f"{run.scale:.12g}", str(run.sample))
        # A run is missing if the campaign was run again after the table was written.
        if key not in self._values:
            raise _outdated_measures(str(self._file), key)
        return self._values[key]


LEVEL = "level"
"""Column of the levels of a campaign in runs.csv."""


def measure_of_campaign(store: Store | None, text: str | None) -> RunMeasure:
    """Return the intensity measure for fits to the runs of a campaign, by default the measure of
    its levels, otherwise Sa(T1). Its column is `LEVEL` if the campaign has scaled its motions to
    levels of this measure. The name states the combination of the components if there are pairs.

    Parameters
    ----------
    store : Store | None
        Store of the campaign, if available.
    text : str | None
        Requested measure (`measure_named`).
    """
    levels, settings = None, {}
    if store is not None:
        levels, settings = level_measure(store), store.parameters()
    measure = None if text is None else measure_named(text)
    combination = intensity.GEOMETRIC_MEAN
    if levels and levels[1]:  # numbered levels have no unit
        name, unit = levels
        called = name.replace(f"({FIRST})", "({})")
        # The measures of runs have the usual damping ratio.
        is_same = measure is not None and measure.called == called
        if measure is None or (is_same and settings.get("damping", SA_DAMPING) == SA_DAMPING):
            measure = RunMeasure(LEVEL, unit, name, lambda record, period: math.nan, called=called)
            combination = settings.get("pair", combination)
    measure = measure or run_measure("sa")
    if store is None or not store.has_pairs or measure.called == LEVEL:
        return measure
    return replace(measure, called=f"{combination}-{measure.called}")


MEASURES = "measures.csv"
"""File name of the measures, next to runs.csv; written by `tdint campaign --im`."""

_KEYS = ("building", "record", "component", "scale", "sample")  # columns that identify a run
_QUANTITIES = {"m/s^2": ACCELERATION, "m/s": VELOCITY, "m": LENGTH, "s": {"s": 1.0}}
_UNITS = {unit: (si, factor) for si, units in _QUANTITIES.items() for unit, factor in units.items()}
"""SI unit and conversion factor to it, by the unit of a measure in a table."""


def recordings_of_rows(table: CsvTable) -> tuple[list[int], dict[int, int]]:
    """Return the number of the record of each row of a table, and the number of the first component
    of the recording of each record.

    The table of a campaign contains motions. In other tables, pairs are recognized by the names of
    records and components; HN1+HN2 is a pair in one row. Without records, each row is a record.
    """
    rows = range(len(table.rows))
    if not table.has("record"):
        return [*rows], {row: row for row in rows}
    components = table.texts("component") if table.has("component") else [""] * len(rows)
    firsts = (component.partition("+")[0] for component in components)
    names = list(zip(table.texts("record"), firsts, strict=True))
    number_of_name = {name: number for number, name in enumerate(dict.fromkeys(names))}
    numbers = [number_of_name[name] for name in names]
    if not table.has("motion"):
        records = {number: (*name, 0) for name, number in number_of_name.items()}
        return numbers, recording_numbers(records)
    first_of: dict[str, int] = {}
    recordings = (motion.partition("-")[0] for motion in table.texts("motion"))
    pairs = zip(numbers, recordings, strict=True)
    return numbers, {number: first_of.setdefault(name, number) for number, name in pairs}


def motions_of(table: CsvTable) -> Indices:
    """Return, for each run of a table, the index of its recording, or of its event if events are
    known."""
    with store_of_table(table) as store:
        # Without ground motion fields, a column `event` is a column of the inventory, not an event.
        if table.has("event") and (store is None or store.events()):
            return indices_of(table.texts("event"))
    numbers, recordings = recordings_of_rows(table)
    return indices_of(recordings[number] for number in numbers)


# Runs under the same ground motion, or of the same event if events are known, are correlated. The
# errors of a fit are therefore jackknife estimates over ground motions or events (Efron and Stein
# 1981, The Annals of Statistics 9(3)). For many runs, groups of ground motions are used
# (delete-a-group jackknife, Kott 2001, Journal of Official Statistics 17(4)).

Fit = Callable[[NDArray[np.bool_]], list[Fragility | AnalysisError]]
"""Function that fits one or more fragility functions to the runs that a mask selects. A fit that is
impossible is replaced by its error."""

_MIN_GROUPS = 30
"""Minimum number of groups of ground motions, if there are as many ground motions. With 30 groups,
the standard errors are accurate to about 13 %."""

_MAX_FITTED_RUNS = 2_000_000
"""Maximum total number of runs in all fits of a jackknife. For more runs, several ground motions
form a group. Fits of this number of runs to a cloud need several seconds."""


def over_motions(
    fit: Fit,
    is_used: NDArray[np.bool_],
    motion: NDArray[np.intp] | None,
    draw: NDArray[np.intp] | None = None,
) -> list[Fragility | AnalysisError]:
    """Fit fragility functions, and estimate the covariance of ln theta and beta by a jackknife over
    ground motions, and the dispersions within and between draws of the properties.

    Parameters
    ----------
    fit : callable
        Function that fits the runs selected by a mask of shape (n,).
    is_used : ndarray of bool, shape (n,)
        True for the runs that are used in the fit.
    motion : ndarray of int, shape (n,), or None
        Ground motion of each run. If None, the covariance of the fit is kept.
    draw : ndarray of int, shape (n,), optional
        Draw of the properties of the building in each run; by default there are no draws.

    Returns
    -------
    list
        Functions, or errors that prevent them. The covariance is nan if fewer than three groups
        permit a fit.
    """
    fits = fit(is_used)
    if draw is not None:
        draws = np.unique(draw[is_used])
        fits_of_draws = [fit(is_used & (draw == number)) for number in draws]
        fits = [
            _with_draws(function, of_draws)
            for function, of_draws in zip(fits, zip(*fits_of_draws, strict=True), strict=True)
        ]
    if motion is None:
        return fits
    # Groups with about equal numbers of ground motions: ground motion i of m, in ascending order,
    # belongs to group floor(i * groups / m).
    motions = np.unique(motion[is_used])
    affordable_groups = _MAX_FITTED_RUNS // max(int(np.sum(is_used)), 1)
    group_count = min(motions.size, max(_MIN_GROUPS, affordable_groups))
    group_of_run = (np.searchsorted(motions, motion) * group_count) // motions.size
    # (ln theta, beta) of the fits without a group, for each function
    estimates: list[list[tuple[float, float]]] = [[] for _ in fits]
    for omitted_group in range(group_count) if group_count > 2 else ():
        try:
            refits = fit(is_used & (group_of_run != omitted_group))
        except AnalysisError:
            continue
        for position, refit in enumerate(refits):
            if isinstance(refit, Fragility):
                estimates[position].append((math.log(refit.theta), refit.beta))
    results: list[Fragility | AnalysisError] = []
    for function, function_estimates in zip(fits, estimates, strict=True):
        if isinstance(function, Fragility):
            covariance = _jackknife_covariance(function_estimates)
            method = "" if np.isnan(covariance).any() else JACKKNIFE
            function = replace(
                function, covariance=covariance, motions=motions.size, error_method=method
            )
        results.append(function)
    return results


def _with_draws(
    function: Fragility | AnalysisError, of_draws: Sequence[Fragility | AnalysisError]
) -> Fragility | AnalysisError:
    """Return a function with the dispersions within and between draws, from the functions of the
    single draws; without them if there is only one draw, or a draw determines no function."""
    fitted = [item for item in of_draws if isinstance(item, Fragility)]
    if isinstance(function, AnalysisError) or not 1 < len(fitted) == len(of_draws):
        return function
    return replace(
        function,
        beta_within=math.sqrt(np.mean([item.beta**2 for item in fitted])),
        beta_between=float(np.std([math.log(item.theta) for item in fitted], ddof=1)),
    )


def _jackknife_covariance(estimates: Sequence[tuple[float, float]]) -> Array:
    """Return the jackknife covariance of two parameters, shape (2, 2): n - 1 times the covariance
    of their n estimates, each without a group of the observations; nan for fewer than three
    estimates."""
    if len(estimates) < 3:
        return np.full((2, 2), math.nan)
    return np.asarray((len(estimates) - 1) * np.cov(np.array(estimates).T, bias=True))


def motion_of_rows(table: CsvTable, pair_demand: str | None) -> tuple[PairRule, Indices]:
    """Return the rule for pairs, and the index of the motion at a level of each row of a table of
    runs.

    A table of a campaign contains motion and level. In other tables, the rows of the components of
    a recording with equal intensity, or equal factor, are a motion. Each row is a motion if
    components count separately. Without `pair_demand`, the rule of the store applies, or the
    default if there is no store.

    Raises
    ------
    UsageError
        The components of a pair were run at different levels.
    """
    numbers, recordings = recordings_of_rows(table)
    with store_of_table(table) as store:
        rule = PairRule(pair_demand or (store.pair_demand() if store else LARGER), recordings)
    if rule.demand == SEPARATE or not rule.pairs:
        return rule, np.arange(len(numbers))
    samples = table.texts("sample") if table.has("sample") else [""] * len(numbers)
    if table.has("motion", LEVEL):
        return rule, indices_of(
            zip(table.texts("motion"), samples, table.texts(LEVEL), strict=True)
        )
    column = next((name for name in ("im", "scale") if table.has(name)), None)
    intensities = table.numbers(column, empty=True) if column else [1.0] * len(numbers)
    levels = [f"{value:.6g}" for value in intensities]
    motion = indices_of(zip((recordings[n] for n in numbers), samples, levels, strict=True))
    # The demands of the components can be combined only if both were run at the level.
    paired = {*rule.partners.values()}
    for row in np.flatnonzero(np.bincount(motion)[motion] == 1) if column == "im" else ():
        if recordings[numbers[row]] in paired:
            raise UsageError(
                f"{table.source}: the components of a pair ({table.texts('record')[row]}) were run "
                "at different levels, so that their demands cannot be combined; use --fit ida, or "
                "--pair-demand separate"
            )
    return rule, motion


@contextmanager
def store_of_table(table: CsvTable) -> Iterator[Store | None]:
    """Open the store in the directory of a table in a `with` statement. Yield None if the table is
    not runs.csv or the directory has no store."""
    folder = Path(table.source).parent
    if table.source == "-" or Path(table.source).name != "runs.csv" or not is_file(folder / FILE):
        yield None
        return
    with open_existing(folder) as store:
        yield store


def with_measures(table: CsvTable) -> CsvTable:
    """Add the columns of measures.csv to the table of runs in the same directory.

    If measures.csv does not exist, the table is returned unchanged.

    Returns
    -------
    CsvTable
        The table with the additional columns. Columns that it already has are not added again.

    Raises
    ------
    ModelError
        measures.csv has no row for one of the runs.
    """
    file = Path(table.source).with_name(MEASURES)
    if table.source == "-" or not is_file(file):
        return table
    measures = read_table(str(file), "the measures of a campaign are a table")
    # Match rows by the names of the runs, because the table may have been sorted.
    measures_by_run = {
        key: cells for key, (_line, cells) in zip(_keys(measures), measures.rows, strict=True)
    }
    new_columns = [
        column for column, name in enumerate(measures.header) if name not in table.header
    ]
    rows = []
    for key, (line, cells) in zip(_keys(table), table.rows, strict=True):
        if key not in measures_by_run:
            raise _outdated_measures(str(file), key)
        new_cells = [measures_by_run[key][column] for column in new_columns]
        rows.append((line, [*cells, *new_cells]))
    names = tuple(measures.header[column] for column in new_columns)
    return replace(
        table, header=(*table.header, *names), titles=(*table.titles, *names), rows=tuple(rows)
    )


def _outdated_measures(location: str, keys: Sequence[str]) -> ModelError:
    """Return the error of a table of measures that does not contain the row of a run. `location` is
    the path of the file, with the line if known."""
    return ModelError(
        f"{location}: the row of the run {' '.join(keys)} is missing; run `tdint campaign` with "
        "--im again"
    )


def _keys(table: CsvTable) -> list[tuple[str, ...]]:
    """Return the keys of the runs of a table (`_KEYS`)."""
    return list(zip(*(table.texts(name) for name in _KEYS), strict=True))


def column_of(table: CsvTable, name: str) -> tuple[str, str]:
    """Return the title of the column with an intensity measure, and the unit of the column. `name`
    is the title without the suffix of the unit, such as `pga` for the column `pga_m_s2`.

    Raises
    ------
    UsageError
        The table does not contain the measure.
    """
    for unit in _UNITS:
        if table.has(f"{name}{suffix(unit)}"):
            return f"{name}{suffix(unit)}", unit
    raise UsageError(no_measure_message(table.source, name))


def no_measure_message(source: str, name: str) -> str:
    """Return the error message about a table of runs that does not contain the intensity measure
    `name`."""
    return (
        f"{source}: the runs have no measure {name}; run `tdint campaign` on the same directory "
        f"with --im, which writes {MEASURES}"
    )


def motions_if_known(table: CsvTable) -> NDArray[np.intp] | None:
    """Return the index of the ground motion, or of the event, of each row of a table; None if the
    table has neither a column `event` nor a column `record`."""
    return motions_of(table) if table.has("event") or table.has("record") else None


# ---- Runs of a building or of a type


@dataclass(frozen=True)
class SuiteRuns:
    """Runs of a group, the buildings of a type or a single building: one entry for each building,
    ground motion and level. All arrays have the shape (n,).

    Attributes
    ----------
    im : ndarray
        Intensities in `names[1]`.
    demand : ndarray
        Demand of the damage states; infinity is a collapse, NaN a run without a result.
    motion : ndarray of int | None
        Ground motion, or event of ground motion fields; None if unknown.
    weight : ndarray
        Number of equal buildings.
    names : tuple of str
        Name and unit of the intensity measure.
    has_levels : bool
        True if the intensities are the levels of a campaign: a cloud must then be requested.
    censored : ndarray of bool | None
        True for demands known only to be above their value; None if all are known.
    draw : ndarray of int | None
        Draw of the properties of the buildings; None without draws.
    """

    im: Array
    demand: Array
    motion: NDArray[np.intp] | None
    weight: Array
    names: tuple[str, str]
    has_levels: bool = False
    censored: NDArray[np.bool_] | None = None
    draw: NDArray[np.intp] | None = None


def suite_runs(
    table: CsvTable, measure: str | None, pair_demand: str | None
) -> tuple[SuiteRuns, PairRule]:
    """Return the runs of a table of runs of one building, with the components of pairs combined,
    and the rule for

    Parameters
    ----------
    measure : str | None
        Requested intensity measure, or its column without the unit (`_intensity_column`).
    pair_demand : str | None
        Requested rule for pairs (`motion_of_rows`).

    Raises
    ------
    ModelError
        The table contains several buildings, or no run has an intensity and a result.
    UsageError
        The table does not contain the measure.
    """
    try:
        table.only("building")
    except ModelError as error:
        raise ModelError(
            f"{error}, or fit functions of a campaign's directory: of each building with --by "
            "building, or of all variations of a model together with --by type"
        ) from None
    column, *names = _intensity_column(table, measure)
    im = np.array(table.numbers(column, empty=True))
    rule, motion_at_level = motion_of_rows(table, pair_demand)
    # The columns `im` and `level` contain the intensity of the pair already.
    if column not in ("im", LEVEL):
        # The intensity of a pair does not depend on the rule for its demand.
        _, of_pairs = motion_of_rows(table, LARGER)
        im = geometric_means(of_pairs, im)[of_pairs]
    firsts = first_runs(motion_at_level)
    drift = np.array(table.numbers("peak_drift_ratio", empty=True))
    demand = with_outcomes(
        demands_of_motions(motion_at_level, drift, rule.demand),
        outcomes_of_motions(motion_at_level, outcomes_of(table.texts("status"))),
    )
    demand[~(demand > 0.0)] = math.nan  # runs without a drift ratio have no result
    has_intensity = im[firsts] > 0.0
    runs = SuiteRuns(
        im[firsts][has_intensity],
        demand[has_intensity],
        motions_of(table)[firsts][has_intensity],
        np.ones(int(np.sum(has_intensity))),
        (names[0], names[1]),
        has_levels=column == LEVEL,
    )
    if np.isnan(runs.demand).all():
        raise ModelError(
            f"{table.source}: no run has both an intensity and a result; at least one "
            "completed run is required, and load cases (key `forces` of a campaign) have no "
            "intensity"
        )
    return runs, rule


def _intensity_column(table: CsvTable, requested: str | None) -> tuple[str, str, str]:
    """Return the title of the column with the intensities of runs, the name of the intensity
    measure, for example `sa(0.5)`, and the unit.

    Without a requested measure, it is the column `im` of the table if it exists, then the level of
    the campaign, otherwise Sa(T1). UsageError is raised if the table has no column of the requested
    measure.
    """
    if requested is None and table.has("im"):
        return "im", table.only("im_name"), table.only("unit")
    with store_of_table(table) as store:
        measure = measure_of_campaign(store, requested)
        periods = dict(store.first_periods()) if store is not None else {}
    name = measure.label(periods.get(table.only("building")))
    if measure.column == LEVEL and table.has(LEVEL):
        return LEVEL, name, measure.unit
    has_column = any(table.has(f"{measure.column}{suffix(unit)}") for unit in ACCELERATION)
    if requested is None and not has_column:
        # The column of Sa(T1) is missing. Return its usual title, so that the caller's attempt to
        # read the column raises an error with this title.
        return f"{measure.column}{suffix('m/s^2')}", name, "m/s^2"
    column, unit = column_of(table, measure.column)
    return column, name, unit


# ---- Comparison of intensity measures by their efficiency

_MIN_RUNS = 3  # minimum number of runs for a line with a dispersion


@dataclass(frozen=True)
class MeasureFit:
    """Line of ln EDP over ln IM, fitted to the runs without collapse. EDP is the maximum drift
    ratio, IM the intensity measure.

    Attributes
    ----------
    im, unit : str
        Name of the measure as requested, and its unit in the table.
    runs, left_out : int
        Number of motions used for the line, and number of omitted motions, which collapsed or have
        no result or no measure.
    slope, slope_error, beta, r_squared : float
        Slope with its standard error, standard deviation about the line (n - 2), and squared
        correlation.
    rule : PairRule
        Rule that combines the components of pairs.
    """

    im: str
    unit: str
    runs: int
    left_out: int
    slope: float
    slope_error: float
    beta: float
    r_squared: float
    rule: PairRule = field(default_factory=PairRule)

    @property
    def proficiency(self) -> float:
        """Beta divided by the slope: the dispersion in terms of the intensity measure; infinite if
        the slope is zero."""
        return self.beta / self.slope if self.slope else math.inf


def compare_measures(
    folder: str | Path, measures: Sequence[str], pair_demand: str | None = None
) -> list[MeasureFit]:
    """Compare intensity measures for the runs of a campaign, in ascending order of beta: the
    motions, intensities and demands of each measure are those of its single fit (`suite_runs`).

    Parameters
    ----------
    folder : str or Path
        Directory of a campaign of one building, with runs.csv. Measures other than `sa` and `pga`
        require measures.csv.
    pair_demand : str, optional
        Rule for pairs; by default that of the campaign.

    Returns
    -------
    list of MeasureFit
        Line of each measure, the most efficient measure (smallest beta) first.

    Raises
    ------
    UsageError, ModelError
        As by `suite_runs`.
    AnalysisError
        Fewer than three runs were completed, or a measure is equal for all runs.
    """
    table = with_measures(
        read_table(str(Path(folder) / "runs.csv"), "the runs of a campaign are a table")
    )
    motion_count = first_runs(motion_of_rows(table, pair_demand)[1]).size
    fits = []
    for name in dict.fromkeys(measures):
        runs, rule = suite_runs(table, name, pair_demand)
        assert runs.motion is not None
        is_used = np.isfinite(runs.demand)
        fit = line(
            np.log(runs.im[is_used]), np.log(runs.demand[is_used]), name, runs.motion[is_used]
        )
        left_out = int(motion_count - np.sum(is_used))
        fits.append(replace(fit, im=name, unit=runs.names[1], left_out=left_out, rule=rule))
    return sorted(fits, key=lambda fit: fit.beta)


def line(x: Array, y: Array, name: str, motion: NDArray[np.intp]) -> MeasureFit:
    """Fit a line by least squares to logarithms of the intensity measure and of the demand.

    Runs with the same number in `motion` are correlated. Name and unit of the result are empty, and
    no runs count as omitted.

    Raises
    ------
    AnalysisError
        There are fewer than three runs, or all have the same intensity.
    """
    if x.size < _MIN_RUNS:
        raise AnalysisError(
            f"{name}: the regression of ln drift over ln IM requires at least {_MIN_RUNS} "
            f"completed runs, got {x.size}"
        )
    if np.ptp(x) == 0.0:
        raise AnalysisError(
            f"{name}: this intensity measure has the same value in all runs; the regression of ln "
            "drift over ln IM requires different values"
        )

    def slope_of(rows: NDArray[np.bool_]) -> tuple[float, float]:
        """Return the slope of some of the runs, and the sum of the squared residuals."""
        u, v = x[rows] - np.mean(x[rows]), y[rows] - np.mean(y[rows])
        slope = float(u @ v / (u @ u)) if u.any() else math.nan
        residuals = v - slope * u
        return slope, float(residuals @ residuals)

    # Two parameters are estimated from the runs. The jackknife variance of the slope is m - 1 times
    # the variance of the m slopes without a motion.
    slope, unexplained = slope_of(np.ones(x.size, bool))
    total = float(np.sum((y - np.mean(y)) ** 2))
    slopes = [slope_of(motion != number)[0] for number in np.unique(motion)]
    slope_error = math.sqrt((len(slopes) - 1) * np.var(slopes)) if len(slopes) > 2 else math.nan
    beta, r_squared = math.sqrt(unexplained / (x.size - 2)), 1.0 - unexplained / total
    return MeasureFit("", "", x.size, 0, slope, slope_error, beta, r_squared)
