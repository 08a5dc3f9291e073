"""Runs of one building with one time step in a batch.

Only this module integrates and evaluates many runs. The result of a run that reaches its end
without collapse is the result of the compiled call. All other runs are evaluated by
`tdint.response.runs.case.Case`, like a single run. Runs with error estimates are integrated
individually.

A run in two directions is a run of each direction (`integrate_directions`).

The caller decides which results are kept: `tdint.run_many` fills its arrays; a campaign writes rows
and repeats failed runs with half the time step.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import lru_cache, partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tdint.arrays import Array, cached_property
from tdint.errors import UsageError
from tdint.ground_motion.axes import PairRecord, components_of
from tdint.ground_motion.record import Record
from tdint.methods.catalogue import parse
from tdint.methods.method import Integrator
from tdint.model.building import Building
from tdint.model.definition import Model
from tdint.response.arguments import numbers_of
from tdint.response.runs.case import (
    Case,
    needs_review,
    rest_criterion,
    until_forces_end,
)
from tdint.response.runs.elements import ElementPeaks, element_peaks
from tdint.response.runs.error_estimate import (
    run_until_rest,
    run_with_error_estimate,
    without_additional_history,
)
from tdint.response.runs.load_case import LoadCase
from tdint.response.runs.loop_results import columns, energy_errors, named_devices, named_peaks
from tdint.response.runs.outcome import (
    STORY_QUANTITIES,
    Collapse,
    DevicePeaks,
    FailedRun,
    Response,
    StoryPeaks,
)
from tdint.response.runs.prepared import (
    AT_REST,
    NO_FREE_VIBRATION,
    STEPS_COMPLETED,
    BatchResult,
    PreparedBuilding,
    RunSpec,
    SampleTables,
)
from tdint.response.runs.settings import RunSettings
from tdint.response.time_steps import Steps

_parse_cached = lru_cache(maxsize=64)(parse)
"""`parse` with a cache, because thousands of buildings may have the same method."""


NO_MOTION = Record(np.zeros(2), 1.0, start="", id="", component="", source="")
"""Ground motion of runs under forces on floors or from an initial motion only. Its sampling
interval has no meaning: time steps are chosen as without a record."""


@dataclass(frozen=True)
class Subject:
    """Building with the method that integrates it, and cached properties of both.

    Attributes
    ----------
    model : Model
        Building; its ground motion is not used.
    """

    model: Model
    method: str

    @cached_property
    def prepared(self) -> PreparedBuilding:
        """Building as arrays."""
        model, *_ = self.model.directions
        if model.rows:
            model.require_chain("a set of runs")
        return PreparedBuilding.of(model)

    @cached_property
    def across(self) -> Subject | None:
        """Building in direction y with its method; None for a building with a single direction."""
        return None if self.model.across is None else Subject(self.model.across, self.method)

    @cached_property
    def integrator(self) -> Integrator:
        """Method."""
        return _parse_cached(self.method)

    def case(self, record: Record | None, scale: float = 1.0) -> Case:
        """Return the case of the building under a ground motion times `scale`, or with the ground
        at rest if `record` is `None`. A load case replaces the tables of forces of the building.
        """
        if isinstance(record, LoadCase):
            return self.loaded(record, scale).case(None)
        record = None if record is NO_MOTION else record
        scaled = record if record is None or scale == 1.0 else record.scaled(scale)
        across = None
        if self.across is not None:
            across = self.across.case(components_of(scaled)[1])
        model, *_ = self.model.directions
        return Case(model, self.prepared, scaled, self.integrator, across=across)

    def throughout(self) -> Subject:
        """Return the building without the duration in the `analysis` section of its model."""
        analysis = self.model.analysis
        if analysis.duration is None:
            return self
        model = self.model.in_directions(analysis=replace(analysis, duration=None))
        return Subject(model, self.method)

    def loaded(self, load_case: LoadCase, scale: float = 1.0) -> Subject:
        """Return the building under a load case times `scale`."""
        return Subject(load_case.scaled(scale).on(self.model), self.method)

    @cached_property
    def period(self) -> float:
        """First period of the initial stiffness, s; the longer one of two directions."""
        period = self.prepared.period
        return period if self.across is None else max(period, self.across.period)

    def __reduce__(self) -> tuple[type[Subject], tuple[Model, str]]:
        # Only the definition is pickled. The receiving process computes the arrays again.
        return Subject, (self.model, self.method)


RunOfMotion = tuple[Record, float, Steps]
"""Number of a ground motion, its scale factor, and the time steps."""


@dataclass(frozen=True)
class Outcomes:
    """Results of runs as arrays over the runs; nan, and 0 steps, for runs without a result.

    Attributes
    ----------
    elements : ndarray, shape (runs, 2, elements)
        Results of the elements, as in `BatchResult`, of runs that are not in `responses`.
    devices : DevicePeaks
        Values of attachments and links of runs that are not in `responses`, shape (runs, devices).
    energy_error, steps : ndarray, shape (runs,)
        Energy imbalance divided by the maximum input energy; number of completed time steps.
    at_rest : list of int | None
        1 if the run reached rest, 0 if not; None if rest was not requested or the run did not reach
        its end.
    responses : mapping of int to Response
        Individual runs by their index, with errors and history if requested.
    collapses, failures : mapping of int to Collapse and to FailedRun
        Runs by their index with a status other than `done`. A run that continued after its collapse
        is also in `responses`.
    """

    stories: StoryPeaks
    elements: Array
    devices: DevicePeaks | None
    energy_error: Array
    steps: NDArray[np.int64]
    at_rest: list[int | None]
    responses: dict[int, Response] = field(default_factory=dict)
    collapses: dict[int, Collapse] = field(default_factory=dict)
    failures: dict[int, FailedRun] = field(default_factory=dict)

    @classmethod
    def of(
        cls,
        building: Building,
        batch: BatchResult,
        to_rest: bool,
        is_settled: NDArray[np.bool_],
    ) -> Outcomes:
        """Convert the arrays of a compiled call to results.

        Parameters
        ----------
        building : Building
            Building of the runs.
        to_rest : bool
            True if the runs continue until free vibration has decayed.
        is_settled : ndarray of bool, shape (runs,)
            True for runs without residual drifts (`StoryPeaks.settled`).
        """
        at_rest = (
            batch.ends[:, AT_REST].astype(int).tolist() if to_rest else [None] * len(batch.ends)
        )
        peaks = named_peaks(building, batch.peaks, batch.drifts).settled(is_settled)
        return cls(
            columns(peaks, slice(building.floors)),
            batch.elements,
            named_devices(building, peaks, batch.devices) if building.branched else None,
            energy_errors(batch.totals),
            batch.ends[:, STEPS_COMPLETED].astype(int),
            at_rest,
        )

    @property
    def status(self) -> dict[int, str]:
        """Status of the runs that were evaluated individually, by their index. All other runs are
        done."""
        return {
            i: ended.status
            for i, ended in (self.collapses | self.responses | self.failures).items()
        }

    def stories_of(self, i: int) -> StoryPeaks:
        """Return the peaks of run `i`."""
        return _run_of(self.stories, i)

    def elements_of(self, i: int, model: Model) -> ElementPeaks | None:
        """Return the results of the elements of the building `model` in run `i`; None without
        stories with several elements."""
        if i in self.responses:
            return self.responses[i].elements
        return element_peaks(model, self.elements[i], self.stories_of(i).peak_drift)

    def devices_of(self, i: int) -> DevicePeaks | None:
        """Return the peaks of attachments and links in run `i`; None without devices."""
        if i in self.responses:
            return self.responses[i].devices
        if self.devices is None:
            return None
        devices = self.devices
        return DevicePeaks(_run_of(devices.stories, i), devices.dissipated_energy[i])

    def fail(self, i: int, failure: FailedRun) -> None:
        """Replace the results of run `i` by its failure."""
        self.failures[i], self.at_rest[i] = failure, None
        self._put(i, None, np.nan, 0)

    def replace(self, i: int, attempt: Callable[[], Response | Collapse]) -> None:
        """Replace the results of run `i` by the results of an individual run. Elements and devices
        remain unchanged, because `elements_of` and `devices_of` read the response.

        Parameters
        ----------
        attempt : callable
            Function without arguments that integrates or evaluates the run. If it raises FailedRun,
            the failure is recorded instead.
        """
        try:
            result = attempt()
        except FailedRun as failure:
            self.fail(i, failure)
            return
        collapse = result if isinstance(result, Collapse) else result.collapse
        if collapse:
            self.collapses[i], self.at_rest[i] = collapse, None
        # A collapse that was evaluated from the batch changes no other values of the batch.
        if isinstance(result, Collapse):
            self.stories.residual_drift[i] = np.nan
            if self.devices is not None:
                self.devices.stories.residual_drift[i] = np.nan
            return
        if result.time_at_rest is not None and not collapse:
            self.at_rest[i] = 1
        self.responses[i] = result
        self._put(i, result.stories, result.energy.error, result.steps)

    def _put(self, i: int, stories: StoryPeaks | None, energy_error: float, steps: int) -> None:
        """Write the results of run `i`; nan if `stories` is `None`."""
        for quantity in STORY_QUANTITIES:
            getattr(self.stories, quantity.name)[i] = (
                getattr(stories, quantity.name) if stories else np.nan
            )
        self.energy_error[i], self.steps[i] = energy_error, steps


def _run_of(peaks: StoryPeaks, i: int) -> StoryPeaks:
    """Return the peaks of run `i` of many runs."""
    values = {quantity.name: getattr(peaks, quantity.name)[i] for quantity in STORY_QUANTITIES}
    return replace(peaks, **values)


def run_batch(
    subject: Subject,
    runs: Sequence[RunOfMotion],
    *,
    check: bool = False,
    to_rest: bool = False,
    histories: tuple[int, Callable[[int, Array], None]] | None = None,
    status_only: bool = False,
    samples: SampleTables | None = None,
) -> Outcomes:
    """Integrate runs of one building with one time step. Each run equals that of `run`, bit for
    bit.

    Parameters
    ----------
    runs : sequence of (Record, float, Steps)
        Ground motion, scale factor and time steps of each run.
    to_rest : bool, default False
        Continue with the ground at rest until free vibration has decayed.
    histories : tuple of (int, callable), optional
        Arguments `every` and `on_history` of `PreparedBuilding.integrate_batch`. The histories of
        runs that are integrated individually are then part of their responses.
    status_only : bool, default False
        Failures contain only the status, so that a failed run is not integrated again for the
        details of its message.
    samples : SampleTables, optional
        Parameters of the building in each run; the arrays are changed.

    Raises
    ------
    AnalysisError
        The method does not support this building.
    """
    prepared = subject.prepared
    _, _, first_steps = runs[0]
    h, has_history = first_steps.h, histories is not None

    def case(i: int) -> Case:
        """Return the case of run `i`."""
        record, scale, _ = runs[i]
        return (samples.subject_of(i) if samples else subject).case(record, scale).silenced()

    if to_rest and subject.model.excitation.tables:
        runs = [(*run[:2], until_forces_end(subject.model, run[2])) for run in runs]

    def integrate_alone(
        run_case: Case, steps: Steps, history: bool, to_rest: bool, history_errors: bool = False
    ) -> Response:
        """Integrate a run with a single direction individually."""
        checked = partial(run_with_error_estimate, history_errors=history_errors)
        integrate_case = checked if check else Case.integrate
        if not to_rest:
            return integrate_case(run_case, steps, history)
        # The run ends at the requested time, so that no drift change after this time is estimated.
        return run_until_rest(
            run_case,
            steps,
            lambda duration: integrate_case(run_case, run_case.steps(steps.h, duration), history),
        )

    def integrate(i: int) -> Response:
        """Integrate run `i` individually."""
        run_case, steps = case(i), runs[i][2]
        if run_case.across is None:
            return integrate_alone(run_case, steps, has_history, to_rest)

        def integrate_part(
            part: Case, settings: RunSettings, history_errors: bool, **_: Any
        ) -> Response:
            """Integrate one direction of the run, with its history."""
            steps = part.steps(settings.dt, settings.duration)
            return integrate_alone(part, steps, True, settings.until_rest, history_errors)

        duration = None if steps.continues else steps.end
        settings = RunSettings(dt=steps.h, duration=duration, until_rest=to_rest, check=check)
        return integrate_directions(run_case, settings, integrate_part, keep=has_history)

    # Error estimates require a second run of each run, and an unstable time step an error message
    # of each run.
    building = prepared.building
    ends = np.array([steps.count * steps.h for _, _, steps in runs])
    is_settled = prepared.settled(subject.model, ends)
    if check or subject.across or prepared.instability(subject.integrator, h):
        outcomes = Outcomes.of(
            building, BatchResult.empty(len(runs), building), to_rest, is_settled
        )
        for i in range(len(runs)):
            outcomes.replace(i, partial(integrate, i))
        return outcomes
    every, on_history = histories or (1, None)
    batch = prepared.integrate_batch(
        subject.integrator,
        h,
        [RunSpec(record.acceleration, scale, steps) for record, scale, steps in runs],
        rest_criterion(prepared, h) if to_rest else NO_FREE_VIBRATION,
        every=every,
        on_history=on_history,
        samples=samples,
    )
    outcomes = Outcomes.of(samples.building if samples else building, batch, to_rest, is_settled)
    # A failed run is integrated again only if more than its status is required.
    for i in np.flatnonzero(needs_review(batch)).tolist():
        run_case, steps = case(i), runs[i][2]
        failure = run_case.failure_in_batch(steps, batch, i) if status_only else None
        if failure:
            outcomes.fail(i, failure)
        else:
            outcomes.replace(i, partial(run_case.review_batch_run, steps, batch, i, has_history))
    return outcomes


def samples_of(vary: Mapping[str, Any], product: bool) -> dict[str, Array]:
    """Expand the values of varied parameters to a single value per sample for each name.

    Parameters
    ----------
    vary : mapping of str to array
        Values by name: a common value, or a value per sample.
    product : bool
        True for all combinations of the values; the last name varies fastest.

    Returns
    -------
    dict of str to ndarray, shape (samples,)
        Values by name; all arrays have the same length.

    Raises
    ------
    UsageError
        A value is not a number, or names have different numbers of values.
    """
    arrays = {str(name): numbers_of(values, str(name)) for name, values in vary.items()}
    if product:
        grids = np.meshgrid(*arrays.values(), indexing="ij")
        arrays = {name: grid.ravel() for name, grid in zip(arrays, grids, strict=True)}
    sizes = {len(values) for values in arrays.values()}
    count = max(sizes, default=1)
    if not count or sizes - {1, count}:
        counts = ", ".join(f"{len(values)} of {name}" for name, values in arrays.items())
        raise UsageError(
            "vary: each parameter must have a single value or as many values as there are samples; "
            f"the numbers of values are: {counts}"
        )
    return {name: np.broadcast_to(values, count).copy() for name, values in arrays.items()}


LIMITS_OF_METHOD = (
    "the directions are uncoupled: torsion, biaxial yield surfaces, axial interaction and dampers "
    "that act in both directions are not included"
)


def integrate_directions(
    case: Case,
    settings: RunSettings,
    integrate: Callable[..., Response],
    *,
    tolerance: float | None = None,
    keep: bool = True,
) -> Response:
    """Integrate a case in both directions and return the combined response (`combined`).

    `integrate` is the function that integrates a case in a direction, with the arguments of
    `tdint.response.runs.run.integrate_case`.

    With a tolerance, both directions have the smaller of their time steps. A run with another end
    is repeated up to the common end. The histories of the directions are kept if `keep`.

    Raises
    ------
    FailedRun
        A direction failed.
    """
    # Imported here, because few models have two directions.
    from tdint.response.runs.two_directions import combined

    _check_durations(case, settings)
    run = partial(integrate, history=True, history_errors=settings.check)
    responses = [run(part, settings, tolerance=tolerance) for part in case.directions]
    # The building is at rest if both directions are; the second may be run again below.
    rests = [response.time_at_rest for response in responses]

    def completed(settings: RunSettings, is_right: Callable[[Response], bool]) -> list[Response]:
        """Return the runs, of which those that are not right are repeated with the settings."""
        return [
            response if is_right(response) else run(part, settings)
            for part, response in zip(case.directions, responses, strict=True)
        ]

    h = min(response.dt for response in responses)
    note: tuple[str, ...] = ()
    if any(response.dt != h for response in responses):
        note = (f"both directions have the time step {h:.6g} s, the smaller of their steps",)
    settings = replace(settings, dt=h)
    responses = completed(settings, lambda response: response.dt == h)
    # Both directions end together: at the first collapse that ends a run, or at the later end.
    ended = [item.steps for item in responses if item.collapse and item.collapse.ended]
    steps = min(ended) if ended else max(response.steps for response in responses)
    end = replace(settings, duration=steps * h, until_rest=False)
    responses = completed(end, lambda response: response.steps == steps)
    record = case.record if isinstance(case.record, PairRecord) else None
    response = combined(responses, record)
    responses = [without_additional_history(part) for part in responses]
    if not keep:
        responses = [replace(part, history=None, history_chunks=None) for part in responses]
    at_rest = None if None in rests else max(time for time in rests if time is not None)
    return replace(
        response,
        directions=tuple(responses),
        time_at_rest=None if response.collapse else at_rest,
        notes=(*response.notes, *note, LIMITS_OF_METHOD),
    )


def _check_durations(case: Case, settings: RunSettings) -> None:
    """Raise UsageError if the components have different durations, and the run does not end before
    both."""
    record = case.record
    if not isinstance(record, PairRecord):
        return
    durations = [component.duration for component in record.components]
    end = settings.duration or case.model.analysis.duration or math.inf
    if abs(durations[0] - durations[1]) > 0.5 * record.dt and end > min(durations):
        raise UsageError(
            f"{record.source}: the components of x and y last {durations[0]:.6g} and "
            f"{durations[1]:.6g} s; trim or pad them to the same duration, or end the run before "
            "both with a duration"
        )
