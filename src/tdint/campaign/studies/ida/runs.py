"""A building under a scaled ground motion at one level of intensity, repeated with a finer step where it must be."""

from __future__ import annotations

import math
from dataclasses import dataclass

from tdint.analysis.run.case import Case
from tdint.analysis.run.demands import demands
from tdint.analysis.run.outcome import FailedRun, Response
from tdint.analysis.run.steps import Steps, finer

DONE = "done"
COLLAPSED = ("collapsed", "failed-story")
"""Statuses of a run that count as collapse; every other but `done` says nothing of the building."""

_FINER = 3
"""How often a run without a result is repeated, each time with half the step."""

_REPEATED = ("not-converged", "diverged")


@dataclass(frozen=True)
class IdaRun:
    """A run of an incremental dynamic analysis.

    Attributes
    ----------
    im : float
        Intensity, in the unit of its measure.
    scale : float
        Factor on the record.
    status : str
        As of `tdint run`; one that is neither `done` nor a collapse has no result, also with a finer step.
    drift_ratio, acceleration, residual_drift_ratio : float
        Largest drift ratio, absolute acceleration (m/s^2) and drift ratio at the end; nan without a result.
    finer : int
        How often the step was halved, for the run had no result.
    energy_error : float
        Imbalance over the largest input energy; nan without a result.
    """

    im: float
    scale: float
    status: str
    drift_ratio: float = math.nan
    acceleration: float = math.nan
    residual_drift_ratio: float = math.nan
    finer: int = 0
    energy_error: float = math.nan

    @property
    def stable(self) -> bool:
        """Whether the building stood."""
        return self.status == DONE

    @property
    def collapsed(self) -> bool:
        """Whether the building collapsed, by its own motion."""
        return self.status in COLLAPSED


def run_level(case: Case, steps: Steps, im: float, scale: float) -> IdaRun:
    """Run a case with its ground motion times `scale`; a run that has no result is repeated with half the step.

    Raises
    ------
    FailedRun
        The step is beyond the method's limit.
    """
    scaled = case.scaled(scale)
    for halvings in range(_FINER + 1):
        try:
            return _of(scaled.march(steps), im, scale, halvings)
        except FailedRun as failure:
            if failure.status not in _REPEATED:
                raise
            status = failure.status
            steps = finer(steps)
    return IdaRun(im, scale, status, finer=_FINER)


def _of(response: Response, im: float, scale: float, halvings: int) -> IdaRun:
    found = demands(response.stories)
    return IdaRun(
        im=im,
        scale=scale,
        status=response.status,
        drift_ratio=found.drift_ratio.value,
        acceleration=found.acceleration.value,
        residual_drift_ratio=found.residual_drift_ratio.value,
        finer=halvings,
        energy_error=response.energy.error,
    )
