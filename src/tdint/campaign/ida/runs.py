"""A building under a scaled ground motion at one level of intensity, repeated with a finer step where it must be."""

from __future__ import annotations

import math
from dataclasses import dataclass

from tdint.analysis.run.case import Case
from tdint.campaign.engine.batch import Batch
from tdint.campaign.engine.rows import RUN_WITH_ERROR, RunRow
from tdint.campaign.engine.task import Run

DONE = "done"
COLLAPSED = ("collapsed", "failed-story")
"""Statuses of a run that count as collapse; every other but `done` says nothing of the building."""

_UNSTABLE = "unstable-step"


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
    drift_ratio_error, acceleration_error, residual_drift_ratio_error : float
        Estimated errors; nan where there are none.
    corrected_drift_ratio, corrected_acceleration, corrected_residual_drift_ratio : float
        The demands by the error that the run has carried along; nan where that does not do.
    """

    im: float
    scale: float
    status: str
    drift_ratio: float = math.nan
    acceleration: float = math.nan
    residual_drift_ratio: float = math.nan
    finer: int = 0
    energy_error: float = math.nan
    drift_ratio_error: float = math.nan
    acceleration_error: float = math.nan
    residual_drift_ratio_error: float = math.nan
    corrected_drift_ratio: float = math.nan
    corrected_acceleration: float = math.nan
    corrected_residual_drift_ratio: float = math.nan

    @classmethod
    def of(cls, im: float, row: RunRow) -> IdaRun:
        """What the row of a run at a level says."""
        names = [one.name for one in RUN_WITH_ERROR]
        errors, corrected = (dict(zip(names, told, strict=False)) for told in (row.errors, row.corrected))
        return cls(
            im=im,
            scale=row.scale,
            status=row.status,
            drift_ratio=_number(row.peak_drift_ratio),
            acceleration=_number(row.peak_acceleration),
            residual_drift_ratio=_number(row.residual_drift_ratio),
            finer=row.repeats,
            energy_error=_number(row.energy_error),
            drift_ratio_error=_number(errors.get("peak_drift_ratio")),
            acceleration_error=_number(errors.get("peak_acceleration")),
            residual_drift_ratio_error=_number(errors.get("residual_drift_ratio")),
            corrected_drift_ratio=_number(corrected.get("peak_drift_ratio")),
            corrected_acceleration=_number(corrected.get("peak_acceleration")),
            corrected_residual_drift_ratio=_number(corrected.get("residual_drift_ratio")),
        )

    @property
    def stable(self) -> bool:
        """Whether the building stood."""
        return self.status == DONE

    @property
    def collapsed(self) -> bool:
        """Whether the building collapsed, by its own motion."""
        return self.status in COLLAPSED


def run_level(batch: Batch, run: Run) -> RunRow:
    """Run a motion of a batch times a factor; a run that has no result is repeated with half the step.

    Raises
    ------
    FailedRun
        The step is beyond the method's limit.
    """
    (row,) = batch.results([run]).runs
    if row.status == _UNSTABLE:  # No level mends that; said as a single run says it.
        record = batch.motions.records[run.motion]
        case = Case(batch.subject.model, batch.subject.prepared, record, batch.subject.integrator)
        case.march(case.steps(batch.settings.dt, batch.settings.duration))
    return row


def _number(value: float | None) -> float:
    return math.nan if value is None else float(value)
