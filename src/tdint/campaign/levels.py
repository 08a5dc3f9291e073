"""How strong the motions are made: factors that are given, or found from a measure of intensity."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol

from tdint.campaign.motions import SuiteMotion
from tdint.campaign.studies.intensity import GroundMotion, IntensityMeasure

if TYPE_CHECKING:  # A campaign file is read without the engine that runs it.
    from tdint.campaign.engine.chunk import Source


class Levels(Protocol):
    """Factors on each motion."""

    def count(self, motion: int) -> int:
        """How many factors a motion has."""

    def factors(self, sources: Sequence[Source], motion: int) -> Sequence[tuple[float, ...]]:
        """The factors of a motion under each of some buildings."""

    def description(self) -> dict[str, object]:
        """What was asked for, for the fingerprint."""


@dataclass(frozen=True)
class Scales:
    """The same factors on all motions."""

    values: tuple[float, ...]

    def count(self, motion: int) -> int:
        return len(self.values)

    def factors(self, sources: Sequence[Source], motion: int) -> Sequence[tuple[float, ...]]:
        return [self.values] * len(sources)

    def description(self) -> dict[str, object]:
        return {"scales": list(self.values)}


@dataclass(frozen=True)
class GivenFactors:
    """Factors of each motion by its number, as `tdint scale` finds them."""

    by_motion: Mapping[int, tuple[float, ...]]

    def count(self, motion: int) -> int:
        return len(self.by_motion[motion])

    def factors(self, sources: Sequence[Source], motion: int) -> Sequence[tuple[float, ...]]:
        return [self.by_motion[motion]] * len(sources)

    def description(self) -> dict[str, object]:
        return {"factors": {str(motion): list(values) for motion, values in self.by_motion.items()}}


@dataclass(frozen=True)
class MeasureLevels:
    """Values that an intensity measure is to take.

    Attributes
    ----------
    measure : callable
        A period (s) -> the measure.
    period : float or None
        Its period, s; None for the first period of each building.
    values : tuple of float
        The values, in SI units.
    pair : str
        What stands for a pair of components, a name of `tdint.campaign.studies.intensity.PAIRS`.
    """

    measure: Callable[[float], IntensityMeasure]
    period: float | None
    values: tuple[float, ...]
    pair: str

    def factors(self, whole: GroundMotion, period: float) -> tuple[float, ...]:
        """The factors with which a motion takes them at a period, s; both components of a pair have the same one."""
        measured = self.measure(period).of(whole, self.pair)
        return tuple(value / measured for value in self.values)

    def description(self) -> dict[str, object]:
        """What was asked for, for the fingerprint."""
        name = self.measure(1.0).name.partition("(")[0]
        period = "T1" if self.period is None else self.period
        return {"measure": name, "period": period, "levels": list(self.values), "pair": self.pair}


@dataclass(frozen=True)
class IntensityLevels:
    """Factors with which each of some motions takes values of a measure."""

    wanted: MeasureLevels
    motions: Sequence[SuiteMotion]

    def count(self, motion: int) -> int:
        return len(self.wanted.values)

    def factors(self, sources: Sequence[Source], motion: int) -> Sequence[tuple[float, ...]]:
        whole, period = self.motions[motion].whole, self.wanted.period
        if period is not None:
            return [self.wanted.factors(whole, period)] * len(sources)
        return [self.wanted.factors(whole, source.subject().period) for source in sources]

    def description(self) -> dict[str, object]:
        return self.wanted.description()
