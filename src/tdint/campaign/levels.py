"""How strong the motions are made: factors that are given, or found from a measure of intensity."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Protocol

from tdint.campaign.engine.chunk import Source
from tdint.campaign.motions import SuiteMotion
from tdint.campaign.studies.intensity import GroundMotion, IntensityMeasure


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
class IntensityLevels:
    """Factors with which a measure of a motion takes some values; both components of a pair have the same one.

    Attributes
    ----------
    measure : callable
        A period (s) -> the measure.
    period : float or None
        Its period, s; None for the first period of each building.
    values : tuple of float
        The values, in SI units.
    pair : str
        What stands for a pair, a name of `tdint.campaign.studies.intensity.PAIRS`.
    motions : sequence of SuiteMotion
        All motions.
    """

    measure: Callable[[float], IntensityMeasure]
    period: float | None
    values: tuple[float, ...]
    pair: str
    motions: Sequence[SuiteMotion]

    def count(self, motion: int) -> int:
        return len(self.values)

    def factors(self, sources: Sequence[Source], motion: int) -> Sequence[tuple[float, ...]]:
        whole = self.motions[motion].whole
        if self.period is not None:
            return [self._factors(whole, self.period)] * len(sources)
        return [self._factors(whole, source.subject().period) for source in sources]

    def description(self) -> dict[str, object]:
        name = self.measure(1.0).name.partition("(")[0]
        period = "T1" if self.period is None else self.period
        return {"measure": name, "period": period, "levels": list(self.values), "pair": self.pair}

    def _factors(self, whole: GroundMotion, period: float) -> tuple[float, ...]:
        measured = self.measure(period).of(whole, self.pair)
        return tuple(value / measured for value in self.values)
