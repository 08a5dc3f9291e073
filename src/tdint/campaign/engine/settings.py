"""How the runs of a campaign are integrated."""

from __future__ import annotations

from dataclasses import dataclass

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
        Go on after that with the ground at rest until the building is (`tdint.analysis.run.rest`).
    stories : bool
        Keep the peaks of every story, too.
    tolerance : float or None
        The step of a building is such that the estimated errors of its peak drifts are within this part of them.
    """

    dt: float | None = None
    duration: float | None = None
    until_rest: bool = False
    stories: bool = False
    tolerance: float | None = None
