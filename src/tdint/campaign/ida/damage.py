"""A building that a mainshock has brought to a given drift: what an aftershock finds."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

from tdint.analysis.run.demands import demands
from tdint.analysis.run.outcome import FailedRun, Response
from tdint.analysis.run.run import Subject
from tdint.analysis.sequence import ShockSequence, sequence_of, shocks_of
from tdint.errors import AnalysisError, UsageError
from tdint.ground_motion.record import Record

_HUNT = 1.3
_HUNTS = 60
_EXACT = 1e-4
"""Part of the drift that is asked for by which it may be missed."""

_HALVINGS = 60


@dataclass(frozen=True)
class Mainshock:
    """A ground motion before each of a study's, scaled so that the building reaches some drift ratios.

    Attributes
    ----------
    records : tuple of Record
        Its horizontal components; one goes with all records, of several the one of a record's own component.
    damages : tuple of float
        The drift ratios.
    """

    records: tuple[Record, ...]
    damages: tuple[float, ...]

    def before(self, record: Record) -> Record:
        """The component that goes with a record.

        Raises
        ------
        UsageError
            There is none.
        """
        if len(self.records) == 1:
            return self.records[0]
        for own in self.records:
            if own.component == record.component:
                return own
        names = ", ".join(own.component for own in self.records)
        raise UsageError(
            f"{self.records[0].source}: no component {record.component or 'of that kind'} to go with {record.name}; it "
            f"has {names}: name one with --component"
        )


@dataclass(frozen=True)
class DamagedState:
    """What a mainshock does to a building.

    Attributes
    ----------
    record : Record
        The mainshock, scaled.
    drift : float
        The drift ratio that it is scaled to.
    left : float
        The largest drift ratio that it leaves.
    rest : float
        Time from its last sample until the building is at rest, s.
    """

    record: Record
    drift: float
    left: float
    rest: float


def damaged(subject: Subject, main: Record, drift: float, *, first: float, dt: float | None) -> DamagedState:
    """Scale a mainshock so that the largest drift ratio of a building first reaches a value.

    Parameters
    ----------
    first : float
        Factor from which on it is looked for upwards.

    Raises
    ------
    AnalysisError
        The building collapses before.
    """

    def reached(factor: float) -> float:
        case = subject.case(main, factor)
        try:
            response = case.march(case.steps(dt, main.duration))
        except FailedRun:
            return math.inf
        return math.inf if response.collapse else _drift(response)

    factor = _factor(reached, drift, first)
    if factor is None:
        raise AnalysisError(
            f"{main.name}: the building does not reach a drift of {100.0 * drift:g} % under any factor on it without "
            "collapse"
        )
    scaled = main.scaled(factor)
    case = subject.case(scaled)
    sequence = sequence_of(case, [scaled, scaled], dt=dt)
    alone = ShockSequence(sequence.records[:1], (0,))
    joined = case.under(alone.whole)
    rest = (sequence.starts[1] - scaled.acceleration.size + 1) * scaled.dt
    (shock,) = shocks_of(joined, alone, joined.steps(dt, scaled.duration + rest))
    return DamagedState(scaled, drift, demands(shock.stories).residual_drift_ratio.value, rest)


def _drift(response: Response) -> float:
    return demands(response.stories).drift_ratio.value


def _factor(reached: Callable[[float], float], drift: float, first: float) -> float | None:
    """The first factor with which a drift is reached, None if it is passed by."""
    low, high = 0.0, first
    for _ in range(_HUNTS):
        if reached(high) >= drift:
            break
        low, high = high, _HUNT * high
    for _ in range(_HALVINGS):
        middle = 0.5 * (low + high)
        found = reached(middle)
        if abs(found - drift) <= _EXACT * drift:
            return middle
        low, high = (middle, high) if found < drift else (low, middle)
    return None


def damages_of(mainshock: Mainshock | None, collapse_drift: float) -> Sequence[float]:
    """The states of a study: intact, and damaged to some drifts.

    Raises
    ------
    UsageError
        A drift is none, or that of a collapse.
    """
    damages = mainshock.damages if mainshock else ()
    for damage in damages:
        if not 0.0 < damage < collapse_drift:
            raise UsageError(
                f"damage {damage:g}: a drift ratio above 0 and below the collapse drift, {collapse_drift:g}"
            )
    return (0.0, *sorted(set(damages)))
