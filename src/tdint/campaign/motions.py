"""The ground motions of a campaign, and which of them each building gets."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple, Protocol

from tdint.campaign.studies.intensity import GroundMotion
from tdint.campaign.studies.suite import components
from tdint.ground_motion.record import Record, component_names


@dataclass(frozen=True)
class SuiteMotion:
    """A component of a ground motion.

    Attributes
    ----------
    record : Record
        The motion.
    name, component : str
        What tables call it.
    whole : Record or Horizontals
        The component itself, or the pair that it belongs to and shares its factors with.
    direction : int
        1, or 2 for the second component of a pair.
    """

    record: Record
    name: str
    component: str
    whole: GroundMotion
    direction: int = 1


def suite_motions(whole: Sequence[GroundMotion]) -> tuple[SuiteMotion, ...]:
    """The components of motions, in order; those of the same name in one file are told apart by their full ids."""
    found = [(one, records) for one in whole for records in [components(one)]]
    names = iter(component_names([record for _, records in found for record in records]))
    return tuple(
        SuiteMotion(record, record.source, next(names), one, direction)
        for one, records in found
        for direction, record in enumerate(records, start=1)
    )


class Draw(NamedTuple):
    """A motion by its number that a building gets, and the number of the draw; 0 where nothing is drawn."""

    motion: int
    sample: int


class Assignment(Protocol):
    """Which motions each building gets."""

    def draws(self, building: int) -> Sequence[Draw]:
        """The motions of a building."""

    def description(self) -> dict[str, object]:
        """What is drawn and how, for the fingerprint."""


@dataclass(frozen=True)
class EveryMotion:
    """All buildings get all motions."""

    count: int

    def draws(self, building: int) -> Sequence[Draw]:
        return [Draw(motion, 0) for motion in range(self.count)]

    def description(self) -> dict[str, object]:
        return {}
