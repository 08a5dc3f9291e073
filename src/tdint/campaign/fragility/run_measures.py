"""Intensity measures of the runs of a campaign, and how well they tell its demands: efficiency and sufficiency.

Sa at a period or at that of each building, Sa_avg, the largest displacement of a yielding oscillator (SDi, Tothong and
Cornell 2006), peaks, Arias intensity, cumulative absolute velocities, durations; each of the component that the run
had, times its factor. Those that are not in proportion to it (SDi, CAV5) are found anew for each factor.

Efficiency is the standard deviation beta of ln EDP about its line over ln IM (Luco and Cornell 2007, Earthquake Spectra
23(2)), proficiency beta over the slope of that line (Padgett, Nielson and DesRoches 2008, Earthquake Engineering and
Structural Dynamics 37). A measure is sufficient where what the line leaves does not depend on what else is known of the
motions: the slope of the residuals over it is told with its p-value.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path

import numpy as np
from scipy.stats import linregress

from tdint.analysis.spectra.elastic import SA_DAMPING, spectrum
from tdint.analysis.spectra.inelastic import constant_strength
from tdint.arrays import Array
from tdint.campaign.plan import Plan
from tdint.campaign.store.store import Store
from tdint.campaign.suites.intensity import AVERAGE, geometric_mean
from tdint.csv_table import CsvTable, read_table
from tdint.errors import AnalysisError, ModelError, UsageError, did_you_mean
from tdint.ground_motion import measures
from tdint.ground_motion.record import Record
from tdint.model.damage_states import DONE
from tdint.quantity import suffix
from tdint.units import ACCELERATION, LENGTH, VELOCITY
from tdint.written_numbers import Grid, how_many, parse_grid, parse_ratio

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
    """

    column: str
    unit: str
    meaning: str
    value: Callable[[Record, float], float]
    power: float | None = 1.0

    def of(self, record: Record, factor: float, period: float) -> float:
        """The measure of a record times a factor, for a building of a period (s); nan where there is none."""
        try:
            if self.power is None:
                return self.value(record.scaled(abs(factor)), period)
            return self.value(record, period) * float(abs(factor) ** self.power)
        except AnalysisError:  # The period is too short for the record.
            return math.nan


def _of_record(value: Callable[[measures.Measures], float]) -> Callable[[Record, float], float]:
    return lambda record, period: value(measures.measure(record))


_PLAIN = {
    "pga": RunMeasure("pga", "m/s^2", "peak ground acceleration", lambda record, period: record.pga),
    "pgv": RunMeasure("pgv", "m/s", "peak ground velocity", _of_record(lambda one: one.pgv)),
    "pgd": RunMeasure("pgd", "m", "peak ground displacement", _of_record(lambda one: one.pgd)),
    "arias": RunMeasure("arias_intensity", "m/s", "Arias intensity", _of_record(lambda one: one.arias), 2.0),
    "cav": RunMeasure("cav", "m/s", "cumulative absolute velocity", _of_record(lambda one: one.cav)),
    "cav5": RunMeasure(
        "cav5", "m/s", "the same of accelerations of 0.05 m/s^2 and more", _of_record(lambda one: one.cav5), None
    ),
    "d5-75": RunMeasure(
        "d5_75", "s", "time between 5 and 75 % of the Arias intensity", _of_record(lambda one: one.d5_75), 0.0
    ),
    "d5-95": RunMeasure(
        "d5_95", "s", "time between 5 and 95 % of the Arias intensity", _of_record(lambda one: one.d5_95), 0.0
    ),
}
_FORMS = (*_PLAIN, "sa[:T1|SECONDS]", "sa-avg[:FIRST:LAST[:COUNT]]", "sdi:T1|SECONDS:STRENGTH")


def run_measure(text: str) -> RunMeasure:
    """The measure of a name: `pgv`, `sa:0.5` (s), `sa` at the first period of each building, `sa-avg:0.2:2` (s),
    `sa-avg` from 0.2 to 3 times that period, `sdi:1:0.1` or `sdi:T1:10%` (yield force over weight).

    Raises
    ------
    UsageError
        There is no such measure, or a number is missing or wrong.
    """
    name, _, rest = text.strip().partition(":")
    if name in _PLAIN and not rest:
        return _PLAIN[name]
    known = {"sa": _spectral, "sa-avg": _average, "sdi": _inelastic}
    if name not in known:
        hint = did_you_mean(name, [*known, *_PLAIN])
        raise UsageError(f"unknown intensity measure {text!r}{hint} (known: {', '.join(_FORMS)})")
    try:
        return known[name](rest)
    except (UsageError, ValueError) as error:
        form = next(one for one in _FORMS if re.match(rf"{name}[:\[]", one))
        raise UsageError(f"{text!r}: {error}; write {form}") from None


def _period(text: str) -> float | None:
    """Seconds; None for the first period of each building."""
    if text in ("", FIRST):
        return None
    value = float(text)
    if not 0.0 < value < math.inf:
        raise UsageError("the period must be a positive number")
    return value


def _named(*parts: object) -> str:
    """A name of a column: parts with _ between them, p for the decimal point."""
    return "_".join(f"{one:g}" if isinstance(one, float) else str(one) for one in parts).replace(".", "p")


def _spectral(rest: str) -> RunMeasure:
    period = _period(rest)
    where = "the first period of the building" if period is None else f"{period:g} s"

    def value(record: Record, own: float) -> float:
        return float(spectrum(record, np.array([period or own]), SA_DAMPING).psa[0])

    return RunMeasure(_named("sa", period or "t1"), "m/s^2", f"Sa at {where}, 5 % damping", value)


def _average(rest: str) -> RunMeasure:
    grid = parse_grid(rest if rest.count(":") == 2 else f"{rest}:{AVERAGE.count}") if rest else None
    if grid is not None and grid.count == 1:
        raise UsageError("an average needs a first and a last period")
    where = f"{AVERAGE.first:g} to {AVERAGE.last:g} times the first period of the building"
    where = f"{grid.first:g} to {grid.last:g} s" if isinstance(grid, Grid) else where

    def value(record: Record, own: float) -> float:
        periods = grid.values() if grid else own * AVERAGE.values()
        return geometric_mean(spectrum(record, periods, SA_DAMPING).psa)

    column = _named("sa_avg", grid.first, grid.last) if grid else "sa_avg_t1"
    return RunMeasure(column, "m/s^2", f"geometric mean of Sa from {where}, 5 % damping", value)


def _inelastic(rest: str) -> RunMeasure:
    seconds, _, text = rest.partition(":")
    period, strength = _period(seconds), parse_ratio(text)
    if not 0.0 < strength < math.inf:
        raise UsageError("the strength, yield force over weight, must be positive")
    where = "the first period of the building" if period is None else f"{period:g} s"

    def value(record: Record, own: float) -> float:
        return float(constant_strength(record, np.array([period or own]), [strength], SA_DAMPING)[0].sd[0])

    meaning = f"largest displacement of an elastoplastic oscillator of {where}, 5 % damping, yielding at {strength:g}"
    return RunMeasure(_named("sdi", period or "t1", strength), "m", f"{meaning} of its weight", value, None)


@dataclass(frozen=True)
class MeasuredRun:
    """A run as runs.csv names it, and the values of the measures asked for, nan where there is none."""

    building: str
    record: str
    component: str
    scale: float
    sample: int
    values: tuple[float, ...]


def measured(plan: Plan, store: Store, wanted: Sequence[RunMeasure]) -> Iterator[MeasuredRun]:
    """The measures of all runs that a store has of its plan, in the order of runs.csv."""
    names, records = store.buildings(), store.records()
    period = cache(lambda building: plan.buildings[building].subject().period)

    @cache
    def unscaled(measure: int, motion: int, own: float) -> float:
        return wanted[measure].of(plan.motions[motion].record, 1.0, own)

    def value(measure: int, motion: int, factor: float, own: float) -> float:
        power = wanted[measure].power
        if power is None:
            return wanted[measure].of(plan.motions[motion].record, factor, own)
        return unscaled(measure, motion, own) * float(abs(factor) ** power)

    keys = "SELECT building, record, scale, sample FROM run_rows ORDER BY building, record, scale, sample"
    for building, motion, scale, sample in store.connection.execute(keys):
        values = tuple(value(i, motion, scale, period(building)) for i in range(len(wanted)))
        yield MeasuredRun(names[building][0], *records[motion][:2], scale, sample, values)


MEASURES = "measures.csv"
"""Beside runs.csv, by `tdint campaign --im`."""

_KEYS = ("building", "record", "component", "scale", "sample")
_UNITS = (*ACCELERATION, *VELOCITY, *LENGTH, *(f"{one}/s" for one in LENGTH), *(f"{one}/s^2" for one in LENGTH), "s")
_NEEDS = "a table of characteristics has the column record and others of numbers, such as magnitude and distance_km"
_LEAST = 3  # runs of a line with a dispersion
_SCALE = "ln scale"


@dataclass(frozen=True)
class Dependence:
    """Of the residuals on a characteristic of the motions: slope, and the chance of one as large if there were none."""

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
        Of the line, with the standard error of the slope and the standard deviation about it (n - 2).
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
        Of a campaign of one building, with runs.csv and, for other measures than `sa` and `pga`, measures.csv.
    measures : sequence of str
        As `tdint.campaign.fragility.run_measures.run_measure` reads them.
    characteristics : str or Path, optional
        CSV file of the motions, a row for each record; beside them stands the factor, where it differs.

    Raises
    ------
    UsageError
        A measure is unknown or was not found for these runs.
    ModelError
        A table cannot be read, has several buildings, or lacks a record.
    AnalysisError
        Fewer than three runs ended, or a measure is the same in all of them.
    """
    table = with_measures(read_table(str(Path(folder) / "runs.csv"), "the runs of a campaign are a table"))
    table.only("building")
    status = np.array(table.texts("status"))
    drift = np.array(table.numbers("peak_drift_ratio", empty=True))
    stood = (status == DONE) & (drift > 0.0)
    known = {_SCALE: np.log(np.abs(table.numbers("scale"))), **_characteristics(table, characteristics)}
    known = {name: values for name, values in known.items() if np.unique(values[stood]).size > 1}
    fits = []
    for name in dict.fromkeys(measures):
        column, unit = column_of(table, run_measure(name).column)
        im = np.array(table.numbers(column, empty=True))
        taken = stood & (im > 0.0)
        parts = {about: values[taken] for about, values in known.items()}
        found = line(np.log(im[taken]), np.log(drift[taken]), parts, name)
        fits.append(replace(found, im=name, unit=unit, left_out=int(np.sum(~taken))))
    return sorted(fits, key=lambda one: one.beta)


def line(x: Array, y: Array, characteristics: dict[str, Array], name: str = "the measure") -> MeasureFit:
    """The line of y over x, both logarithms, shape (n,), and how what it leaves depends on characteristics."""
    if x.size < _LEAST:
        raise AnalysisError(f"{name}: of {how_many(x.size, 'run')} that ended; a line with a dispersion needs {_LEAST}")
    if np.ptp(x) == 0.0:
        raise AnalysisError(f"{name}: is the same in all runs")
    fit = linregress(x, y)
    residual = y - (fit.intercept + fit.slope * x)
    beta = math.sqrt(float(residual @ residual) / (x.size - 2))
    dependences = []
    for about, values in characteristics.items():
        if np.ptp(values) > 0.0:
            of = linregress(values, residual)
            dependences.append(Dependence(about, float(of.slope), float(of.pvalue)))
    slope, error, r = float(fit.slope), float(fit.stderr), float(fit.rvalue)
    return MeasureFit("", "", x.size, 0, slope, error, beta, r * r, tuple(dependences))


def with_measures(table: CsvTable) -> CsvTable:
    """The table of runs with the columns of the measures beside it, if they are there.

    Raises
    ------
    ModelError
        They are not of these runs.
    """
    file = Path(table.source).with_name(MEASURES)
    if table.source == "-" or not file.is_file():
        return table
    others = read_table(str(file), "the measures of a campaign are a table")
    cells = {key: row for key, (_, row) in zip(_keys(others), others.rows, strict=True)}
    places = [place for place, name in enumerate(others.header) if name not in table.header]
    rows = []
    for key, (number, row) in zip(_keys(table), table.rows, strict=True):
        if key not in cells:
            raise ModelError(f"{file}: has no row of {' '.join(key)}; call `tdint campaign` with --im again")
        rows.append((number, [*row, *(cells[key][place] for place in places)]))
    names = tuple(others.header[place] for place in places)
    return replace(table, header=(*table.header, *names), titles=(*table.titles, *names), rows=tuple(rows))


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
    raise UsageError(
        f"{table.source}: the runs have no measure {name}; call `tdint campaign` on the same folder with --im, which "
        f"writes {MEASURES}"
    )


def _characteristics(table: CsvTable, file: str | Path | None) -> dict[str, Array]:
    """Of each run what is known of its record, by the names of the columns."""
    if file is None:
        return {}
    given = read_table(str(file), _NEEDS)
    records = given.texts("record")
    names = [name for name in given.header if name not in ("record", "component")]
    if not names:
        raise ModelError(f"{file}: {_NEEDS}")
    found = {name: dict(zip(records, given.numbers(name), strict=True)) for name in names}
    wanted = table.texts("record")
    missing = [one for one in dict.fromkeys(wanted) if one not in set(records)]
    if missing:
        raise ModelError(f"{file}: has no row of the record {missing[0]}; records are named as in runs.csv")
    return {name: np.array([values[one] for one in wanted]) for name, values in found.items()}
