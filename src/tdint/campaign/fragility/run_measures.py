"""Intensity measures of the runs of a campaign, to be compared by how well they tell its demands.

Sa at a period or at that of each building, Sa_avg, the largest displacement of a yielding oscillator (SDi, Tothong and
Cornell 2006), peaks, Arias intensity, cumulative absolute velocities, durations; each of the component that the run
had, times its factor. Those that are not in proportion to it (SDi, CAV5) are found anew for each factor.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import cache

import numpy as np

from tdint.analysis.spectra.elastic import spectrum
from tdint.analysis.spectra.first_mode import SA_DAMPING
from tdint.analysis.spectra.inelastic import constant_strength
from tdint.campaign.plan import Plan
from tdint.campaign.store.store import Store
from tdint.campaign.suites.intensity import AVERAGE, geometric_mean
from tdint.errors import AnalysisError, UsageError, did_you_mean
from tdint.ground_motion import measures
from tdint.ground_motion.record import Record
from tdint.written_numbers import Grid, parse_grid, parse_ratio

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
    period = cache(lambda building: plan.buildings.source(building).subject().period)

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
