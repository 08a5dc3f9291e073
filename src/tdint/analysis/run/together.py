"""Runs of one building and one step, taken together: the one place where many runs are integrated
and settled.

What comes to its end without a collapse is taken as the compiled call left it. All else is judged
by `tdint.analysis.run.case.Case`, as a single run is. Runs whose errors are asked for are made one
by one. Who asks decides what is kept: `tdint.run_many` fills its arrays, a campaign makes rows and
repeats what failed with half of the step.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import lru_cache, partial

import numpy as np
from numpy.typing import NDArray

from tdint.analysis.run.case import Case, doubtful, energy_errors, peaks_of, until_rest, windows
from tdint.analysis.run.error_estimate import ended_at_rest, told_run
from tdint.analysis.run.outcome import STORY, Collapse, FailedRun, Response, StoryPeaks
from tdint.analysis.run.prepared import NO_REST, MarchedRuns, Motions, PreparedBuilding
from tdint.analysis.run.workspace import Steps
from tdint.arrays import Array, cached_property
from tdint.ground_motion.record import Record
from tdint.kernels.time_loop.loop import AT_REST, STEPS_COMPLETED
from tdint.methods.catalogue import parse
from tdint.methods.method import Integrator
from tdint.model.building import Building, DrawnBuildings
from tdint.model.definition import Model

_parsed = lru_cache(maxsize=64)(parse)
"""The method of a specification, read once for all buildings that share it."""


@dataclass(frozen=True)
class Subject:
    """A building and the method that integrates it; what follows from both is found once and kept.

    Attributes
    ----------
    model : Model
        The building; what it says of a record is not asked.
    method : str
        The method with its parameters.
    """

    model: Model
    method: str

    @cached_property
    def prepared(self) -> PreparedBuilding:
        """The building as arrays."""
        return PreparedBuilding.of(self.model)

    @cached_property
    def integrator(self) -> Integrator:
        """The method."""
        return _parsed(self.method)

    def case(self, record: Record | None, scale: float = 1.0) -> Case:
        """The building under a ground motion times a factor, or at rest."""
        scaled = record if record is None or scale == 1.0 else record.scaled(scale)
        return Case(self.model, self.prepared, scaled, self.integrator)

    @cached_property
    def period(self) -> float:
        """First period of the initial stiffness, s."""
        return self.prepared.period

    def __reduce__(self) -> tuple[type[Subject], tuple[Model, str]]:
        return Subject, (self.model, self.method)  # what was kept is found again where it goes


RunOfMotion = tuple[int, float, Steps]
"""The number of a ground motion, the factor on it, and the steps."""

Settled = tuple[Response | Collapse, int | None]
"""What came of a run by itself, and whether it came to rest; None where nobody waited for that."""


@dataclass(frozen=True)
class Outcomes:
    """What came of runs, columns over them; nan and 0 where a run has no result.

    Attributes
    ----------
    stories : StoryPeaks
        Peaks of shape (runs, n), SI units.
    energy_error, steps : ndarray, shape (runs,)
        Imbalance of the energies over the largest input energy; steps that were taken.
    at_rest : list of int or None
        Whether each came to rest, 1 or 0; None where nobody waited for that and where a run did not
        come to its end.
    responses : mapping of int to Response
        The runs that were made by themselves, by their places: with errors and history, if these
        were asked for.
    collapses, failures : mapping of int to Collapse and to FailedRun
        How runs ended that are not `done`; one that went on after its collapse is among the
        responses, too.
    """

    stories: StoryPeaks
    energy_error: Array
    steps: NDArray[np.int64]
    at_rest: list[int | None]
    responses: dict[int, Response] = field(default_factory=dict)
    collapses: dict[int, Collapse] = field(default_factory=dict)
    failures: dict[int, FailedRun] = field(default_factory=dict)

    @classmethod
    def of(cls, building: Building, marched: MarchedRuns, to_rest: bool) -> Outcomes:
        """As a compiled call left them; where each run has its own building, its arrays have the
        runs first."""
        waited = (
            marched.ends[:, AT_REST].astype(int).tolist() if to_rest else [None] * len(marched.ends)
        )
        return cls(
            peaks_of(building, marched.peaks, marched.drifts),
            energy_errors(marched.totals),
            marched.ends[:, STEPS_COMPLETED].astype(int),
            waited,
        )

    @property
    def status(self) -> dict[int, str]:
        """How those ended that are not simply done, by their places."""
        return {
            i: ended.status
            for i, ended in (self.collapses | self.responses | self.failures).items()
        }

    def stories_of(self, i: int) -> StoryPeaks:
        """The peaks of a run."""
        values = {quantity.name: getattr(self.stories, quantity.name)[i] for quantity in STORY}
        return StoryPeaks(height=self.stories.height, **values)

    def replace(self, i: int, attempt: Callable[[], Settled]) -> None:
        """Replace what is known of a run by what comes of it by itself."""
        try:
            settled, at_rest = attempt()
        except FailedRun as failure:
            self.failures[i], self.at_rest[i] = failure, None
            self._put(i, None, np.nan, 0)
            return
        collapse = settled if isinstance(settled, Collapse) else settled.collapse
        self.at_rest[i] = None if collapse else at_rest
        if collapse:
            self.collapses[i] = collapse
        if isinstance(settled, Collapse):
            return
        self.responses[i] = settled
        self._put(i, settled.stories, settled.energy.error, settled.steps)

    def _put(self, i: int, stories: StoryPeaks | None, energy_error: float, steps: int) -> None:
        for quantity in STORY:
            getattr(self.stories, quantity.name)[i] = (
                getattr(stories, quantity.name) if stories else np.nan
            )
        self.energy_error[i], self.steps[i] = energy_error, steps


def run_together(
    subject: Subject,
    motions: Motions,
    runs: Sequence[RunOfMotion],
    *,
    check: bool = False,
    to_rest: bool = False,
    history: bool = False,
    march: Callable[[], MarchedRuns] | None = None,
) -> Outcomes:
    """Integrate runs of one building and one step; each is the one that `run` makes, to the last
    bit.

    Parameters
    ----------
    check : bool
        Estimate the errors of the peaks.
    to_rest : bool
        Go on with the ground at rest until the building is.
    history : bool
        Keep the histories of runs that are made by themselves.
    march : callable, optional
        In place of one compiled call without histories: what leaves the same.

    Raises
    ------
    AnalysisError
        The method does not integrate this building.
    """
    prepared, h = subject.prepared, runs[0][2].h

    def case(i: int) -> Case:
        return subject.case(motions.records[runs[i][0]], runs[i][1])

    if check or prepared.instability(subject.integrator, h):
        outcomes = Outcomes.of(
            prepared.building, MarchedRuns.empty(len(runs), prepared.building.stories), to_rest
        )
        for i, (_, _, steps) in enumerate(runs):
            outcomes.replace(
                i, partial(_alone, case(i), steps, check=check, to_rest=to_rest, history=history)
            )
        return outcomes
    if march:
        marched = march()
    else:
        lanes, rest = (
            [motions.lane(*run) for run in runs],
            windows(prepared, h) if to_rest else NO_REST,
        )
        marched = prepared.march_many(subject.integrator, h, motions.samples, lanes, rest)
    outcomes = Outcomes.of(prepared.building, marched, to_rest)
    for i in np.flatnonzero(doubtful(marched)).tolist():
        outcomes.replace(
            i, partial(_judged, case(i), runs[i][2], marched, i, to_rest=to_rest, history=history)
        )
    return outcomes


def run_drawn(
    subject: Subject,
    motions: Motions,
    runs: Sequence[tuple[int, RunOfMotion]],
    drawn: DrawnBuildings,
    subjects: Sequence[Callable[[], Subject]],
) -> Outcomes:
    """Integrate runs of buildings that differ in numbers, and of one step; the draw of each comes
    before its motion.

    Parameters
    ----------
    subjects : sequence of callable
        Gives the building of a draw by itself, for runs that do not come to their end.

    Raises
    ------
    AnalysisError
        The method does not integrate these buildings.
    """
    h, places = runs[0][1][2].h, [d for d, _ in runs]
    lanes = [(d, motions.lane(*run)) for d, run in runs]
    marched = subject.prepared.march_drawn(subject.integrator, h, motions.samples, lanes, drawn)
    outcomes = Outcomes.of(drawn.of_runs(places), marched, False)
    for i in np.flatnonzero(doubtful(marched)).tolist():
        d, (number, scale, steps) = runs[i]
        case = subjects[d]().case(motions.records[number], scale)
        outcomes.replace(i, partial(_judged, case, steps, marched, i, to_rest=False, history=False))
    return outcomes


def _judged(
    case: Case, steps: Steps, marched: MarchedRuns, i: int, *, to_rest: bool, history: bool
) -> Settled:
    """A run that the compiled call of all has left for its own case to judge."""
    return case.settle(steps, marched, i, history), int(
        marched.ends[i, AT_REST]
    ) if to_rest else None


def _alone(case: Case, steps: Steps, *, check: bool, to_rest: bool, history: bool) -> Settled:
    """A run that is made by itself from the start."""
    at_rest = None
    if to_rest:
        steps, came = until_rest(case, steps)
        at_rest = int(came)
        steps = case.steps(steps.h, steps.count * steps.h)  # all of them are asked for now
    response = (told_run if check else Case.march)(case, steps, history)
    return (ended_at_rest(response) if to_rest else response), at_rest
