"""Intensity measures of the runs of a campaign, and how well they tell its demands."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.special import stdtr

from tdint.analysis.spectra.elastic import SA_DAMPING, spectrum
from tdint.analysis.spectra.inelastic import constant_strength
from tdint.arrays import Array
from tdint.campaign.batch import Run
from tdint.campaign.fragility.fits import Fragility
from tdint.campaign.fragility.runs import BuildingDamage, places_of_motions
from tdint.campaign.intensity import AVERAGE, SPECTRAL, geometric_mean
from tdint.campaign.pairs import LARGER, SEPARATE, PairRule, recording_numbers
from tdint.campaign.plan import Plan
from tdint.campaign.store import FILE, Store, open_existing
from tdint.csv_table import CsvTable, read_table
from tdint.errors import AnalysisError, ModelError, UsageError, did_you_mean
from tdint.files import is_file
from tdint.ground_motion.horizontals import motion_names
from tdint.ground_motion.measures import MEASURES as MEASURES_OF_MOTION
from tdint.ground_motion.record import Record
from tdint.model.damage_states import DONE
from tdint.units import ACCELERATION, LENGTH, VELOCITY, suffix
from tdint.written_numbers import Grid, how_many, parse_grid, parse_ratio

# ---- Intensity measures of the runs of a campaign, and how well they tell its demands: efficiency
# and sufficiency
#
# Sa at a period or at that of each building, Sa_avg, the largest displacement of a yielding
# oscillator (SDi, Tothong and Cornell 2006), peaks, Arias intensity, cumulative absolute
# velocities, durations; each of the component that the run had, times its factor. Those that are
# not in proportion to it (SDi, CAV5) are found anew for each factor.
#
# Efficiency is the standard deviation beta of ln EDP about its line over ln IM (Luco and Cornell
# 2007, Earthquake Spectra 23(2)), proficiency beta over the slope of that line (Padgett, Nielson
# and DesRoches 2008, Earthquake Engineering and Structural Dynamics 37). A measure is sufficient
# where what the line leaves does not depend on what else is known of the motions: the slope of the
# residuals over it is told with its p-value, by which runs under one motion, or of one event where
# events are known, count as alike.

FIRST = "T1"
"""The first period of each building."""


@dataclass(frozen=True)
class RunMeasure:
    """An intensity measure of runs.

    Attributes
    ----------
    column : str
        Its name in tables, without the unit.
    unit, meaning : str
        Its SI unit, and what it is.
    value : callable
        Of a record and the first period of the building, s.
    power : float or None
        Of the factor on the record with which the measure grows; None: it must be found anew.
    called : str
        Its name in tables of functions; {} stands for the first period of the building.
    """

    column: str
    unit: str
    meaning: str
    value: Callable[[Record, float], float]
    power: float | None = 1.0
    called: str = ""

    def label(self, period: float | None) -> str:
        """Its name of buildings whose first period is this, s; None: it is not one period, or not
        known."""
        return self.called.format(FIRST if period is None else f"{period:.6g}")

    def of(self, record: Record, factor: float, period: float) -> float:
        """The measure of a record times a factor, for a building of a period (s); nan where there
        is none."""
        try:
            if self.power is None:
                return self.value(record.scaled(abs(factor)), period)
            return self.value(record, period) * float(abs(factor) ** self.power)
        except AnalysisError:  # The period is too short for the record.
            return math.nan


_FORMS = ("sa[:T1|SECONDS]", "sa-avg[:FIRST:LAST[:COUNT]]", "sdi:T1|SECONDS:STRENGTH")


def run_measure(text: str) -> RunMeasure:
    """The measure of a name: `pgv`, `sa:0.5` (s), `sa` at the first period of each building,
    `sa-avg:0.2:2` (s), `sa-avg` from 0.2 to 3 times that period, `sdi:1:0.1` or `sdi:T1:10%` (yield
    force over weight).

    Raises
    ------
    UsageError
        There is no such measure, or a number is missing or wrong.
    """
    name, _, rest = text.strip().partition(":")
    # A name may be written as its column is, d5_75 for d5-75.
    of_motion = MEASURES_OF_MOTION.get(name.replace("_", "-"))
    if of_motion and not rest:
        value = of_motion.of
        head, unit, meaning = of_motion.head, of_motion.unit, of_motion.meaning
        return RunMeasure(
            head,
            unit,
            meaning,
            lambda record, period: value(record),
            of_motion.power,
            of_motion.name,
        )
    kinds = {"sa": _spectral, "sa-avg": _average, "sdi": _inelastic}
    if name not in kinds:
        names = ", ".join((*MEASURES_OF_MOTION, *_FORMS))
        hint = did_you_mean(name, [*kinds, *MEASURES_OF_MOTION])
        raise UsageError(f"unknown intensity measure {text!r}{hint} (known: {names})")
    try:
        return kinds[name](rest)
    except (UsageError, ValueError) as error:
        form = next(possible for possible in _FORMS if re.match(rf"{name}[:\[]", possible))
        raise UsageError(f"{text!r}: {error}; write {form}") from None


def _period(text: str) -> tuple[float | None, str, str]:
    """Seconds, None for the first period of each building; in words, and in names of functions."""
    if text in ("", FIRST):
        return None, "the first period of the building", "{}"
    value = float(text)
    if not 0.0 < value < math.inf:
        raise UsageError("the period must be a positive number")
    return value, f"{value:g} s", f"{value:g}"


def _named(*parts: object) -> str:
    """A name of a column: parts with _ between them, p for the decimal point."""
    return "_".join(
        f"{part:g}" if isinstance(part, float) else str(part) for part in parts
    ).replace(".", "p")


def _spectral(rest: str) -> RunMeasure:
    period, where, at = _period(rest)

    def value(record: Record, first_period: float) -> float:
        return float(spectrum(record, np.array([period or first_period]), SA_DAMPING).psa[0])

    return RunMeasure(
        _named("sa", period or "t1"),
        "m/s^2",
        f"Sa at {where}, 5 % damping",
        value,
        called=f"sa({at})",
    )


def _average(rest: str) -> RunMeasure:
    grid = parse_grid(rest if rest.count(":") == 2 else f"{rest}:{AVERAGE.count}") if rest else None
    if grid is not None and grid.count == 1:
        raise UsageError("an average needs a first and a last period")
    # By default from periods of higher modes to those of the damaged building.
    where = f"{AVERAGE.first:g} to {AVERAGE.last:g} times the first period of the building"
    where = f"{grid.first:g} to {grid.last:g} s" if isinstance(grid, Grid) else where

    def value(record: Record, first_period: float) -> float:
        periods = grid.values() if grid else first_period * AVERAGE.values()
        return geometric_mean(spectrum(record, periods, SA_DAMPING).psa)

    column = _named("sa_avg", grid.first, grid.last) if grid else "sa_avg_t1"
    called = f"sa-avg({grid.first:g}:{grid.last:g})" if grid else "sa-avg({})"
    return RunMeasure(
        column, "m/s^2", f"geometric mean of Sa from {where}, 5 % damping", value, called=called
    )


def _inelastic(rest: str) -> RunMeasure:
    seconds, _, text = rest.partition(":")
    (period, where, at), strength = _period(seconds), parse_ratio(text)
    if not 0.0 < strength < math.inf:
        raise UsageError("the strength, yield force over weight, must be positive")

    def value(record: Record, first_period: float) -> float:
        return float(
            constant_strength(record, np.array([period or first_period]), [strength], SA_DAMPING)[
                0
            ].sd[0]
        )

    meaning = (
        f"largest displacement of an elastoplastic oscillator of {where}, 5 % damping, yielding at "
        f"{strength:g}"
    )
    called = f"sdi({at},{strength:g})"
    return RunMeasure(
        _named("sdi", period or "t1", strength),
        "m",
        f"{meaning} of its weight",
        value,
        None,
        called,
    )


@dataclass(frozen=True)
class MeasuredRun:
    """A run as runs.csv names it, and the values of the measures asked for, nan where there is
    none."""

    building: str
    record: str
    component: str
    scale: float
    sample: int
    values: tuple[float, ...]


def measured(plan: Plan, store: Store, measures: Sequence[RunMeasure]) -> Iterator[MeasuredRun]:
    """The measures of all runs that a store has of its plan, in the order of runs.csv."""
    names, records = store.buildings(), store.records()
    period = cache(lambda building: plan.buildings[building].subject().period)

    # A record is measured once at the scale 1; what grows by no power of a factor is measured at
    # each.
    @cache
    def unscaled(measure: int, motion: int, first_period: float) -> float:
        return measures[measure].of(plan.motions[motion].record, 1.0, first_period)

    def value(measure: int, motion: int, factor: float, first_period: float) -> float:
        power = measures[measure].power
        if power is None:
            return measures[measure].of(plan.motions[motion].record, factor, first_period)
        return unscaled(measure, motion, first_period) * float(abs(factor) ** power)

    # Runs of a building stand together: its period is found once.
    keys = (
        "SELECT building, record, scale, sample FROM run_rows ORDER BY building, record, scale, "
        "sample"
    )
    for building, motion, scale, sample in store.connection.execute(keys):
        values = tuple(value(i, motion, scale, period(building)) for i in range(len(measures)))
        yield MeasuredRun(names[building][0], *records[motion][:2], scale, sample, values)


def measure_named(text: str) -> RunMeasure:
    """The measure that a text names, or a column of a table of runs, without its unit."""
    try:
        return run_measure(text)
    except UsageError:
        if text == "sa_t1" or not re.fullmatch(r"\w+", text):
            return run_measure("sa" if text == "sa_t1" else text)
        return RunMeasure(text, "", text, lambda record, period: math.nan, called=text)


class RunIntensities:
    """A measure of the runs of a store, building by building in their order. Both components of a
    pair have the geometric mean of theirs, for hazard is a pair's; what the campaign has brought to
    levels has these.

    Parameters
    ----------
    folder : Path
        Of the campaign, in which measures.csv may be.
    pair_demand : str or None
        How the components of pairs count; None: as the campaign has it.

    Raises
    ------
    UsageError
        The runs have no such measure.
    """

    def __init__(
        self, store: Store, folder: Path, measure: RunMeasure, pair_demand: str | None = None
    ) -> None:
        self._measure, self._file = measure, folder / MEASURES
        records = store.records()
        self._names = {number: keys[:2] for number, keys in records.items()}
        # Pairs that were read as such have one intensity in any case, and pairs by their names if
        # they count as one motion.
        rule = store.pair_rule()
        if (pair_demand or rule.demand) == SEPARATE:
            read = {number: number - (at > 1) for number, (*_, at) in records.items()}
            rule = replace(rule, recordings=read)
        self._pairs = replace(rule, demand=LARGER)
        settings = store.parameters()
        # What the campaign has brought to levels of this measure has these.
        name, period = settings.get("measure"), settings.get("period")
        at = f"({period if period == FIRST else f'{period:g}'})" if name in SPECTRAL else ""
        is_levelled = (
            name is not None
            and settings.get("damping", SA_DAMPING) == SA_DAMPING
            and measure.called.format(FIRST) == f"{name}{at}"
            and (name != "sa-avg" or period == FIRST)
        )
        self._levels = sorted(settings["levels"], key=abs) if is_levelled else []
        self.unit = measure.unit
        column = {"sa_t1": "sa", "pga": "pga"}.get(measure.column)
        self._own = None if self._levels else column
        self._rows: Iterator[tuple[int, list[str]]] = iter(())
        if not (self._levels or column):
            # Only what `tdint campaign --im` has written is left; it is read along, a building at a
            # time.
            if not is_file(self._file):
                raise UsageError(no_measure(str(self._file.parent), measure.column))
            table = read_table(str(self._file), "the measures of a campaign are a table")
            column_name, unit = column_of(table, measure.column)
            self._place, self._rows = table.header.index(column_name), iter(table.rows)
            si, self._factor = _UNITS[unit]
            self.unit = measure.unit or si

    @property
    def note(self) -> str:
        """What to say of pairs; nothing without any."""
        if not self._pairs.pairs or self._levels:
            return ""
        return (
            f"{self._measure.called.format(FIRST)} of a pair is the geometric mean of both "
            "components"
        )

    def of(self, of: BuildingDamage) -> Array:
        """The intensity of each run of a building, SI units, shape (runs,); nan where there is
        none."""
        if self._levels:
            return np.array(self._levels)[of.rank]
        values = np.array(
            getattr(of, self._own) if self._own else [self._next(of, key) for key in of.keys], float
        )
        for places in places_of_motions(of, self._pairs) if self._pairs.pairs else ():
            if len(places) > 1:
                values[places] = math.sqrt(float(np.prod(values[places])))
        return values

    def _next(self, of: BuildingDamage, key: Run) -> float:
        """What the next row of measures.csv has, which is that of a run."""
        line, row = next(self._rows, (0, []))
        # Rows are in the order of the runs: one that does not fit means another state of the
        # folder.
        told = [of.building, *self._names[key.motion], f"{key.scale:.12g}", str(key.sample)]
        if row[: len(_KEYS)] != told:
            raise ModelError(
                f"{self._file}:{line}: has no row of {' '.join(told)}; call `tdint campaign` with "
                "--im again"
            )
        text = row[self._place] if self._place < len(row) else ""
        return self._factor * float(text) if text else math.nan


MEASURES = "measures.csv"
"""Beside runs.csv, by `tdint campaign --im`."""

_KEYS = ("building", "record", "component", "scale", "sample")
_KINDS = {"m/s^2": ACCELERATION, "m/s": VELOCITY, "m": LENGTH, "s": {"s": 1.0}}
_UNITS = {unit: (si, factor) for si, units in _KINDS.items() for unit, factor in units.items()}
"""Of measures: their SI unit, and the factor to it."""

_NEEDS = (
    "a table of characteristics has the column record and others of numbers, such as magnitude and "
    "distance_km"
)
_LEAST = 3  # runs of a line with a dispersion
_SCALE = "ln scale"


@dataclass(frozen=True)
class Dependence:
    """Of the residuals on a characteristic of the motions: slope, and the chance of one as large if
    there were none."""

    characteristic: str
    slope: float
    p_value: float


@dataclass(frozen=True)
class MeasureFit:
    """The line of ln EDP over ln IM of the runs that ended, EDP the largest drift ratio.

    Attributes
    ----------
    im, unit : str
        The measure as it was asked for, and its unit in the table.
    runs, collapsed : int
        Runs on the line; runs left out, for they collapsed or have no result or no measure.
    slope, slope_error, beta, r_squared : float
        Of the line, with the standard error of the slope and the standard deviation about it (n -
        2).
    dependences : tuple of Dependence
        Of what it leaves.
    """

    im: str
    unit: str
    runs: int
    left_out: int
    slope: float
    slope_error: float
    beta: float
    r_squared: float
    dependences: tuple[Dependence, ...] = ()

    @property
    def proficiency(self) -> float:
        """Beta over the slope: the dispersion in terms of the measure."""
        return self.beta / self.slope if self.slope else math.inf


def compare_measures(
    folder: str | Path, measures: Sequence[str], characteristics: str | Path | None = None
) -> list[MeasureFit]:
    """Compare intensity measures on the runs of a campaign, from the least beta to the largest.

    Parameters
    ----------
    folder : str or Path
        Of a campaign of one building, with runs.csv and, for other measures than `sa` and `pga`,
        measures.csv.
    measures : sequence of str
        As `tdint.campaign.fragility.measures.run_measure` reads them.
    characteristics : str or Path, optional
        CSV file of the motions, a row for each record; beside them stands the factor, where it
        differs.

    Raises
    ------
    UsageError
        A measure is unknown or was not found for these runs.
    ModelError
        A table cannot be read, has several buildings, or lacks a record.
    AnalysisError
        Fewer than three runs ended, or a measure is the same in all of them.
    """
    table = with_measures(
        read_table(str(Path(folder) / "runs.csv"), "the runs of a campaign are a table")
    )
    table.only("building")
    status = np.array(table.texts("status"))
    drift = np.array(table.numbers("peak_drift_ratio", empty=True))
    # A collapse has no drift that could lie on a line.
    stood = (status == DONE) & (drift > 0.0)
    told, events = _characteristics(table, characteristics)
    logarithms = {_SCALE: np.log(np.abs(table.numbers("scale"))), **told}
    motions = events if events is not None else motions_of(table)
    # What is the same in all runs explains nothing.
    logarithms = {
        name: values for name, values in logarithms.items() if np.unique(values[stood]).size > 1
    }
    fits = []
    for name in dict.fromkeys(measures):
        column, unit = column_of(table, run_measure(name).column)
        im = of_pairs(table, np.array(table.numbers(column, empty=True)))
        # Each measure on its own runs: a period too short for a record takes out few.
        taken = stood & (im > 0.0)
        parts = {about: values[taken] for about, values in logarithms.items()}
        fit = line(np.log(im[taken]), np.log(drift[taken]), parts, name, motions[taken])
        fits.append(replace(fit, im=name, unit=unit, left_out=int(np.sum(~taken))))
    return sorted(fits, key=lambda compared: compared.beta)


def line(
    x: Array,
    y: Array,
    characteristics: dict[str, Array],
    name: str = "the measure",
    motion: NDArray[np.intp] | None = None,
) -> MeasureFit:
    """The line of y over x, both logarithms, shape (n,), and how what it leaves depends on
    characteristics. Runs under one `motion`, a number for each, err alike; by default each run has
    its own."""
    from scipy.stats import (
        linregress,
    )  # takes half a second, which tables of other studies need not wait for

    if x.size < _LEAST:
        raise AnalysisError(
            f"{name}: of {how_many(x.size, 'run')} that ended; a line with a dispersion needs "
            f"{_LEAST}"
        )
    if np.ptp(x) == 0.0:
        raise AnalysisError(f"{name}: is the same in all runs")
    # In logarithms; beta is what the line leaves, with two numbers taken from the runs.
    fit = linregress(x, y)
    residual = y - (fit.intercept + fit.slope * x)
    beta = math.sqrt(float(residual @ residual) / (x.size - 2))
    dependences = []
    for about, values in characteristics.items():
        if np.ptp(values) > 0.0:
            # What the line leaves must not depend on what the motion is (sufficiency).
            of = linregress(values, residual)
            p_value = of.pvalue if motion is None else _clustered(values, residual, motion)
            dependences.append(Dependence(about, float(of.slope), float(p_value)))
    error = float(fit.stderr) if motion is None else _slope_error(x, y, motion)
    slope, r = float(fit.slope), float(fit.rvalue)
    return MeasureFit("", "", x.size, 0, slope, error, beta, r * r, tuple(dependences))


def _slope_error(x: Array, y: Array, cluster: NDArray[np.intp]) -> float:
    """The standard error of the slope of y over x by leaving out clusters one by one; nan of less
    than three."""
    place = np.unique(cluster, return_inverse=True)[1]
    x, y = x - np.mean(x), y - np.mean(y)
    # Each line without a cluster by its sums: of all runs less those of the cluster.
    sums = np.column_stack(
        [np.bincount(place, values) for values in (np.ones(x.size), x, y, x * x, x * y)]
    )
    count, of_x, of_y, of_xx, of_xy = (sums.sum(axis=0) - sums).T
    with np.errstate(divide="ignore", invalid="ignore"):
        slopes = (of_xy - of_x * of_y / count) / (of_xx - of_x**2 / count)
    return math.sqrt((slopes.size - 1) * float(np.var(slopes))) if slopes.size > 2 else math.nan


def _clustered(x: Array, y: Array, cluster: NDArray[np.intp]) -> float:
    """The p-value of the slope of y over x where what is left is alike within clusters: the
    variance by sums over them (Liang and Zeger 1986, Biometrika 73(1)), with the factor G / (G - 1)
    (n - 1) / (n - 2) and Student's t of G - 1 (Cameron and Miller 2015, Journal of Human Resources
    50(2)); nan of less than three clusters."""
    names, place = np.unique(cluster, return_inverse=True)
    count, groups = x.size, names.size
    if groups < 3:
        return math.nan
    design = np.column_stack([np.ones(count), x - np.mean(x)])
    inverse = np.linalg.inv(design.T @ design)
    solution = inverse @ design.T @ y
    left = design * (y - design @ solution)[:, np.newaxis]
    sums = np.column_stack([np.bincount(place, column, groups) for column in left.T])
    variance = (
        (inverse @ sums.T @ sums @ inverse)[1, 1]
        * groups
        / (groups - 1)
        * (count - 1)
        / (count - 2)
    )
    return (
        2.0 * float(stdtr(groups - 1, -abs(solution[1]) / math.sqrt(variance)))
        if variance > 0.0
        else 0.0
    )


def motions_of(table: CsvTable) -> NDArray[np.intp]:
    """The ground motion of each run of a table, or its event where events are known: a number. Both
    components of a pair, as the store beside the table tells, are of one; without a store all of a
    record or of files so named."""
    keys = (
        list(zip(table.texts("record"), table.texts("component"), strict=True))
        if table.has("component")
        else []
    )
    names: list[object] = list(range(len(table.rows)))
    if table.has("record"):
        names = list(motion_names(table.texts("record")))
    with _store_beside(table) as store:
        # Without fields a column of that name is one of the inventory.
        if table.has("event") and (store is None or store.events()):
            names = list(table.texts("event"))
        elif store is not None:
            records = store.records()
            motions = {
                records[number][:2]: motion for number, motion in recording_numbers(records).items()
            }
            names = [motions.get(key, key) for key in keys]
    numbers = {name: number for number, name in enumerate(dict.fromkeys(names))}
    return np.array([numbers[name] for name in names], np.intp)


# Runs under one ground motion err alike, and so do those of an event where events are known: the
# errors of a fit are those of leaving these out one by one (jackknife, Efron and Stein 1981, The
# Annals of Statistics 9(3)), in groups where that is much work (delete-a-group, Kott 2001, Journal
# of Official Statistics 17(4)).

Fit = Callable[[NDArray[np.bool_]], list[Fragility | AnalysisError]]

_GROUPS = 30  # of motions at the least, if there are so many: errors are then known to 13 %
# runs that all fits see together until groups have several motions: seconds of a cloud
_MOST_FITTED = 2_000_000


def over_motions(
    fit: Fit, of: NDArray[np.bool_], motion: NDArray[np.intp] | None
) -> list[Fragility | AnalysisError]:
    """Functions of those runs `of` some, shape (n,), that a mask tells, with the covariance of ln
    theta and beta over their motions, shape (n,): nan where less than three leave a fit. As they
    are fitted without motions."""
    functions = fit(of)
    if motion is None:
        return functions
    # Groups of motions of about one size, in the order of their numbers.
    motions = np.unique(motion[of])
    groups = min(motions.size, max(_GROUPS, _MOST_FITTED // max(int(np.sum(of)), 1)))
    group = (np.searchsorted(motions, motion) * groups) // motions.size
    left: list[list[tuple[float, float]]] = [[] for _ in functions]
    for number in range(groups) if groups > 2 else ():
        try:
            fitted = fit(of & (group != number))
        except AnalysisError:
            continue
        for place, function in enumerate(fitted):
            if isinstance(function, Fragility):
                left[place].append((math.log(function.theta), function.beta))
    covariances = [
        (len(values) - 1) * np.cov(np.array(values).T, bias=True)
        if len(values) > 2
        else np.full((2, 2), math.nan)
        for values in left
    ]
    return [
        replace(function, covariance=covariance) if isinstance(function, Fragility) else function
        for function, covariance in zip(functions, covariances, strict=True)
    ]


def rows_of_motions(table: CsvTable, pair_demand: str | None) -> tuple[PairRule, list[list[int]]]:
    """Return the rule for pairs of a table of runs, and the rows that count as one motion at a
    level; each row by itself if the table has no pairs or counts their components separately.

    Parameters
    ----------
    table : CsvTable
        Runs, with the columns record and component, and scale, sample, building as far as it has
        them. Pairs are those of the store beside it, or those recognized by their names.
    pair_demand : str or None
        One of `tdint.campaign.pairs.PAIR_DEMANDS`; None: that of the store, else the default.
    """
    every = [[place] for place in range(len(table.rows))]
    if not table.has("record", "component"):
        return PairRule(pair_demand or LARGER), every
    names = list(zip(table.texts("record"), table.texts("component"), strict=True))
    numbers = {name: number for number, name in enumerate(dict.fromkeys(names))}
    with _store_beside(table) as store:
        directions = {keys[:2]: keys[2] for keys in store.records().values()} if store else {}
        demand = pair_demand or (store.pair_demand() if store else LARGER)
    records = {number: (*name, directions.get(name, 0)) for name, number in numbers.items()}
    rule = PairRule(demand, recording_numbers(records))
    if rule.demand == SEPARATE or not rule.pairs:
        return rule, every

    # Levels by the intensity if the table has it, else by the rank of the factors, which may be
    # each component's own.
    samples = table.texts("sample") if table.has("sample") else [""] * len(names)
    by_scale = "scale" if table.has("scale") else None
    column = "im" if table.has("im") else by_scale
    sizes = table.numbers(column, empty=True) if column else [1.0] * len(names)
    of_records: dict[tuple[int, str], list[int]] = {}
    for place, (name, sample) in enumerate(zip(names, samples, strict=True)):
        of_records.setdefault((numbers[name], sample), []).append(place)
    groups: dict[tuple[int, str, object], list[int]] = {}
    for (number, sample), places in of_records.items():
        for rank, place in enumerate(sorted(places, key=lambda at: abs(sizes[at]))):
            level = f"{sizes[place]:.6g}" if column == "im" else rank
            groups.setdefault((rule.motion(number), sample, level), []).append(place)

    # Demands can be combined only at levels that both components have.
    paired = {*rule.partners.values()}
    alone = [key for key, places in groups.items() if key[0] in paired and len(places) == 1]
    if alone and column == "im":
        raise UsageError(
            f"{table.source}: the two components of a pair ({names[groups[alone[0]][0]][0]}) were "
            "run at different levels, so that their demands cannot be combined; use --fit ida, or "
            "--pair-demand separate"
        )
    return rule, sorted(groups.values())


def of_pairs(table: CsvTable, im: Array) -> Array:
    """The intensities of the runs of a table, with that of both components of a pair, their
    geometric mean."""
    with _store_beside(table) as store:
        records = store.records() if store is not None else {}
    seconds = {
        run_keys[:2]: records[number - 1][:2]
        for number, run_keys in records.items()
        if run_keys[2] > 1
    }
    if not seconds:
        return im
    result, keys = im.copy(), _keys(table)
    places = {key: place for place, key in enumerate(keys)}
    for place, key in enumerate(keys):
        other = places.get((key[0], *seconds.get((key[1], key[2]), ("", "")), *key[3:]))
        if other is not None:
            result[[place, other]] = math.sqrt(im[place] * im[other])
    return result


def period_beside(table: CsvTable) -> float | None:
    """The first period of the building of a table of runs, s, as the store beside it tells; None
    where it does not."""
    with _store_beside(table) as store:
        numbers = (
            {name: number for number, (name, _) in store.buildings().items()}
            if store is not None
            else {}
        )
        name = table.only("building")
        return store.period(numbers[name]) if store is not None and name in numbers else None


@contextmanager
def _store_beside(table: CsvTable) -> Iterator[Store | None]:
    """The store that a table of runs was made of; None where there is none."""
    folder = Path(table.source).parent
    if table.source == "-" or Path(table.source).name != "runs.csv" or not is_file(folder / FILE):
        yield None
        return
    with open_existing(folder) as store:
        yield store


def with_measures(table: CsvTable) -> CsvTable:
    """The table of runs with the columns of the measures beside it, if they are there.

    Raises
    ------
    ModelError
        They are not of these runs.
    """
    file = Path(table.source).with_name(MEASURES)
    if table.source == "-" or not is_file(file):
        return table
    others = read_table(str(file), "the measures of a campaign are a table")
    # By the names of the runs: the table may have been sorted since.
    cells = {key: row for key, (_, row) in zip(_keys(others), others.rows, strict=True)}
    places = [place for place, name in enumerate(others.header) if name not in table.header]
    rows = []
    for key, (number, row) in zip(_keys(table), table.rows, strict=True):
        if key not in cells:
            raise ModelError(
                f"{file}: has no row of {' '.join(key)}; call `tdint campaign` with --im again"
            )
        rows.append((number, [*row, *(cells[key][place] for place in places)]))
    names = tuple(others.header[place] for place in places)
    return replace(
        table, header=(*table.header, *names), titles=(*table.titles, *names), rows=tuple(rows)
    )


def _keys(table: CsvTable) -> list[tuple[str, ...]]:
    return list(zip(*(table.texts(name) for name in _KEYS), strict=True))


def column_of(table: CsvTable, name: str) -> tuple[str, str]:
    """The column of a measure, whatever its unit is, and this.

    Raises
    ------
    UsageError
        The table has none.
    """
    for unit in _UNITS:
        if table.has(f"{name}{suffix(unit)}"):
            return f"{name}{suffix(unit)}", unit
    raise UsageError(no_measure(table.source, name))


def no_measure(source: str, name: str) -> str:
    """That runs have no such measure."""
    return (
        f"{source}: the runs have no measure {name}; call `tdint campaign` on the same folder with "
        f"--im, which writes {MEASURES}"
    )


def _characteristics(
    table: CsvTable, file: str | Path | None
) -> tuple[dict[str, Array], NDArray[np.intp] | None]:
    """Of each run what is known of its record, by the names of the columns, and the number of its
    event, if there is a column `event`."""
    if file is None:
        return {}, None
    given = read_table(str(file), _NEEDS)
    records = given.texts("record")
    names = [name for name in given.header if name not in ("record", "component", "event")]
    if not names:
        raise ModelError(f"{file}: {_NEEDS}")
    by_name = {name: dict(zip(records, given.numbers(name), strict=True)) for name in names}
    records_of_runs = table.texts("record")
    # Of every record, or the dependence would be of those alone that happen to be known.
    missing = [key for key in dict.fromkeys(records_of_runs) if key not in set(records)]
    if missing:
        raise ModelError(
            f"{file}: has no row of the record {missing[0]}; records are named as in runs.csv"
        )
    events = None
    if given.has("event"):
        event = dict(zip(records, given.texts("event", empty=False), strict=True))
        events = np.unique([event[key] for key in records_of_runs], return_inverse=True)[1]
    return {
        name: np.array([values[key] for key in records_of_runs]) for name, values in by_name.items()
    }, events
