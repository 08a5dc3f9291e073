"""How strong the motions are made: factors that are given, or found from a measure of intensity."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from tdint.campaign.suites.intensity import IntensityMeasure, factor_to
from tdint.errors import ModelError
from tdint.ground_motion.reading.suites import SuiteMotion


@dataclass(frozen=True)
class Scales:
    """The same factors on all motions.

    Attributes
    ----------
    values : tuple of float
        The factors.
    by_period : bool
        Whether they hang on the building, by its first period; else nobody needs to find it.
    of_value : bool
        Whether they bring a motion to a value, whatever factor it has in a grid; else they come on top of it.
    """

    values: tuple[float, ...]
    by_period: bool = field(default=False, init=False)
    of_value: bool = field(default=False, init=False)

    def count(self, motion: int) -> int:
        """How many factors a motion has."""
        return len(self.values)

    def factors(self, motion: int, periods: Sequence[float]) -> Sequence[tuple[float, ...]]:
        """The factors of a motion under each of some buildings, by their first periods, s."""
        return [self.values] * len(periods)

    def description(self) -> dict[str, object]:
        """What was asked for, for the fingerprint."""
        return {"scales": list(self.values)}


@dataclass(frozen=True)
class FactorTable:
    """Factors by the names of motions and components, as a CSV file has them; no component stands for all.

    Attributes
    ----------
    source : str
        The file as the user named it.
    by_name : mapping
        (record, component) -> factors.
    """

    source: str
    by_name: Mapping[tuple[str, str], tuple[float, ...]]

    def of(self, motion: SuiteMotion) -> tuple[float, ...]:
        """The factors of a motion: by its own name, by its file's, by its pair's.

        Raises
        ------
        ModelError
            There are none.
        """
        whole = motion.whole
        names = dict.fromkeys([motion.name, Path(motion.name).name, whole.source])
        components = dict.fromkeys([motion.component, whole.component, ""])
        for key in ((name, component) for name in names for component in components):
            if key in self.by_name:
                return self.by_name[key]
        raise ModelError(f"{self.source}: no factor for {motion.name} {motion.component}")


@dataclass(frozen=True)
class GivenFactors:
    """Factors of each motion by its number, as `tdint scale` finds them."""

    by_motion: Mapping[int, tuple[float, ...]]
    by_period: bool = field(default=False, init=False)
    of_value: bool = field(default=False, init=False)

    def count(self, motion: int) -> int:
        return len(self.by_motion[motion])

    def factors(self, motion: int, periods: Sequence[float]) -> Sequence[tuple[float, ...]]:
        return [self.by_motion[motion]] * len(periods)

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
        What stands for a pair of components, a name of `tdint.campaign.suites.intensity.PAIRS`.
    motions : sequence of SuiteMotion
        What is brought to them.
    """

    measure: Callable[[float], IntensityMeasure]
    period: float | None
    values: tuple[float, ...]
    pair: str
    motions: Sequence[SuiteMotion] = ()
    of_value: bool = field(default=True, init=False)

    def count(self, motion: int) -> int:
        return len(self.values)

    @property
    def by_period(self) -> bool:
        return self.period is None

    def factors(self, motion: int, periods: Sequence[float]) -> Sequence[tuple[float, ...]]:
        """Both components of a pair have the same ones."""
        whole, found = self.motions[motion].whole, dict[float, tuple[float, ...]]()
        for period in dict.fromkeys(self._at(periods)):
            measure = self.measure(period)
            measured = measure.of(whole, self.pair)
            found[period] = tuple(factor_to(value, measure, measured) for value in self.values)
        return [found[period] for period in self._at(periods)]

    def _at(self, periods: Sequence[float]) -> Sequence[float]:
        return periods if self.period is None else [self.period] * len(periods)

    def description(self) -> dict[str, object]:
        name = self.measure(1.0).name.partition("(")[0]
        period = "T1" if self.period is None else self.period
        return {"measure": name, "period": period, "levels": list(self.values), "pair": self.pair}


Levels = Scales | GivenFactors | MeasureLevels
"""Factors on each motion; `Scales` says what all of them tell."""
