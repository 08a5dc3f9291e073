"""What is run: a building with its method, ground motions and the factors on them, and how they are integrated."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple, Protocol

from tdint.analysis.run.run import Subject

REPEATS = 3
"""How often a run that failed is repeated, each time with half of the step before."""


@dataclass(frozen=True)
class RunSettings:
    """What is the same for all runs of a campaign.

    Attributes
    ----------
    dt, duration : float or None
        Time step and duration, s; None: those of the building's model, else those of the record.
    until_rest : bool
        Go on after that with the ground at rest until the building is (`tdint.analysis.run.case`).
    stories, profiles : bool
        Keep the peaks of every story, too: to write them, or what they are over the motions.
    check : bool
        Estimate the errors of the demands of each run, as `tdint.run` does.
    tolerance : float or None
        The step of a building is such that the estimated errors of its peak drifts are within this part of them.
    """

    dt: float | None = None
    duration: float | None = None
    until_rest: bool = False
    stories: bool = False
    tolerance: float | None = None
    profiles: bool = False
    check: bool = False

    @property
    def keeps_stories(self) -> bool:
        """Whether the peaks of stories are kept."""
        return self.stories or self.profiles


class Source(Protocol):
    """What makes a building: the building itself, or a row of an inventory with its rules."""

    def subject(self) -> Subject:
        """The building."""


class Run(NamedTuple):
    """A ground motion by its number, the factor on it, and which of a building's draws it is (0: none was drawn)."""

    motion: int
    scale: float
    sample: int = 0


class BuildingRuns(NamedTuple):
    """Runs of one building.

    Attributes
    ----------
    number : int
        Of the building in its campaign.
    source : Source
        What makes it.
    runs : tuple of Run
        The runs.
    largest : float or None
        Their largest step for a tolerance, s; None if no step is within it.
    """

    number: int
    source: Source
    runs: tuple[Run, ...]
    largest: float | None = math.inf
