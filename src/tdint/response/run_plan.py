"""Plan of many runs: buildings, ground motions, samples of parameters, and the time step of each
run.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence, Set
from dataclasses import dataclass
from itertools import product as combined
from typing import Any

import numpy as np

from tdint.arrays import Array, cached_property
from tdint.errors import ModelError, UsageError
from tdint.ground_motion.record import Record
from tdint.methods.workspace import collapse_limits
from tdint.model.building import assemble
from tdint.model.definition import damped_by
from tdint.model.parameters import changes_of, check_parameter, check_value
from tdint.response.arguments import named_sample, numbers_of
from tdint.response.runs.batch import NO_MOTION, Subject
from tdint.response.runs.history import DEVICE, ELEMENT_FORCE
from tdint.response.runs.many_results import SCALE, RunSpec
from tdint.response.runs.prepared import SampleTables
from tdint.response.time_steps import Steps, record_steps

_FEWEST_SAMPLES = 4
"""Number of samples below which separate batches are faster."""


@dataclass(frozen=True)
class RunsRequest:
    """Checked arguments of `run_many` that determine its runs.

    Attributes
    ----------
    dt, duration : float | None
        Requested time step and duration, s. None: the values of the model or the record.
    vary : dict of str to ndarray, shape (samples,)
        Values of each varied parameter, SI units; empty for a single sample of the model values.
    """

    subjects: tuple[Subject, ...]
    records: tuple[Record, ...]
    dt: float | None
    duration: float | None
    check: bool
    vary: dict[str, Array]

    @cached_property
    def draws(self) -> int:
        """Number of samples; 1 if no parameter is varied."""
        return len(next(iter(self.vary.values()))) if self.vary else 1

    @cached_property
    def building_parameters(self) -> dict[str, Array]:
        """Varied parameters of buildings, without the record scale."""
        return {name: values for name, values in self.vary.items() if name != SCALE}

    def varied(self, model: int, draw: int) -> Subject:
        """Return the building with index `model` and the parameter values of sample `draw`.

        UsageError is raised, with the number of the sample, if this building is invalid.
        """
        subject = self.subjects[model]
        numbers = {name: float(values[draw]) for name, values in self.building_parameters.items()}
        # A value of nan does not change the parameter: neighbors of a run
        # (`gradient._neighbor_runs`) each differ in a single parameter.
        numbers = {name: number for name, number in numbers.items() if not math.isnan(number)}
        try:
            varied = Subject(subject.model.changed(numbers), subject.method)
            _ = varied.prepared
        except (UsageError, ModelError) as error:
            raise UsageError(f"{error} (sample {draw + 1})") from None
        return varied

    def samples(self, model: int, draws: Sequence[int]) -> SampleTables | None:
        """Return the tables of a building in the samples of some runs, for a single batch; None if
        each sample needs a separate batch, which also states the error of a sample.

        A batch has one form of the compiled loops: the samples must agree in the features that
        determine it.
        """
        method, building = self.subjects[model].integrator, self.subjects[model].model
        if len(set(draws)) < _FEWEST_SAMPLES or self.check or not building.has_samples:
            return None
        if method.family.prepare is not None or method.stability_limit != math.inf:
            return None
        numbers = {name: values[draws] for name, values in self.building_parameters.items()}
        numbers = {name: values for name, values in numbers.items() if not np.isnan(values).all()}
        if any(np.isnan(values).any() for values in numbers.values()):
            return None
        try:
            many = assemble(building.changed(numbers), (len(draws),))
        except (UsageError, ModelError):
            return None
        first = many.linear_terms[:, :1] != 0.0
        if np.any((many.linear_terms != 0.0) != first) or not many.modal.any(axis=-1).all():
            return None
        limits = collapse_limits(many, building.collapse_drift)
        return SampleTables(many, limits, lambda i: self.varied(model, draws[i]))

    def check_draws(self, but: Set[int]) -> None:
        """Raise UsageError if the name or a value of a varied parameter is invalid for a building.

        Parameters
        ----------
        but : set of int
            Samples that are not checked.
        """
        checked = [draw for draw in range(self.draws) if draw not in but]
        for name, all_values in self.building_parameters.items():
            check_parameter(name)
            values = all_values[checked] if but else all_values
            numbers = values.tolist()
            # The allowed values are intervals, so that the extreme values are sufficient; they are
            # nan if a value is nan.
            extremes = {float(values.min()), float(values.max())} if numbers else set[float]()
            try:
                for value in extremes:
                    check_value(name, value)
            except UsageError:  # the message names the first invalid value
                for value in numbers:
                    with named_sample(numbers, value, checked):
                        check_value(name, value)
            for subject in self.subjects:
                for change, value in combined(
                    changes_of(subject.model.name, subject.model.springs, name), sorted(extremes)
                ):
                    with named_sample(numbers, value, checked):
                        change.check(name, value)
                if name == "damping":
                    damped_by(subject.model, 0.0)  # raises an error if damping cannot be varied

    def out_of_range(self) -> dict[tuple[int, int], str]:
        """Return the samples with a parameter value out of range."""
        invalid = dict[tuple[int, int], str]()
        for model, draw in combined(range(len(self.subjects)), range(self.draws)):
            try:
                for name, values in self.building_parameters.items():
                    check_value(name, float(values[draw]))
                _ = self.varied(model, draw)
                scale = float(self.vary.get(SCALE, np.ones(self.draws))[draw])
                if not (math.isfinite(scale) and scale):
                    raise UsageError(
                        f"vary: {SCALE} must be a number other than zero, got {scale!r}"
                    )
            except UsageError as error:
                invalid[model, draw] = str(error)
        return invalid

    def record_steps(self, run: RunSpec) -> int:
        """Return the number of steps of a run up to the last sample of its record."""
        record = self.records[run.record]
        return record_steps(run.steps, None if record is NO_MOTION else record.duration)

    def width(self, name: str) -> int:
        """Return the number of columns of a history: elements, attachments and links, or stories of
        the building that has most of them."""
        models = [subject.model for subject in self.subjects]
        if name == ELEMENT_FORCE:
            counts = [sum(len(item.elements) for item in model.stories) for model in models]
        else:
            is_device = name.startswith(DEVICE)
            counts = [len(model.devices if is_device else model.stories) for model in models]
        return max(counts, default=0)

    @cached_property
    def stories(self) -> int:
        """Number of stories of the tallest building."""
        return self.width("")


def plan_runs(
    request: RunsRequest, scales: float | Iterable[float], zip_records: bool, invalid: Set[int]
) -> list[RunSpec]:
    """Return the runs with their time steps, after validation of scales and samples.

    Parameters
    ----------
    zip_records : bool
        True combines the first items of all lists, the second items, and so on. False combines each
        item with all items of the other lists.
    invalid : set of int
        Samples that are not checked, because their runs are not integrated.

    Returns
    -------
    list of RunSpec
        The building varies slowest, followed by the sample and the record; the scale varies
        fastest.

    Raises
    ------
    UsageError
        A scale is zero or not finite, a sample is invalid, or lists have different lengths.
    """
    factors = numbers_of(scales, "scales").tolist()
    if not factors or not all(math.isfinite(factor) and factor for factor in factors):
        raise UsageError(f"scales must be numbers other than zero, got {scales!r:.60}")
    if NO_MOTION in request.records and (factors != [1.0] or SCALE in request.vary):
        raise UsageError("scales: there is no ground motion to scale; give records")
    request.check_draws(invalid)
    record_scales = request.vary.get(SCALE, np.ones(request.draws)).tolist()
    for draw, factor in enumerate(record_scales):
        if draw not in invalid and not (math.isfinite(factor) and factor):
            raise UsageError(f"vary: {SCALE} must be a number other than zero, got {factor:g}")
    if zip_records:
        # Each list has the common length, or a single item that applies to all runs.
        sizes = {"models": len(request.subjects), "draws": request.draws}
        sizes |= {"records": len(request.records), "scales": len(factors)}
        count = max(sizes.values())
        for name, size in sizes.items():
            if size not in (1, count):
                raise UsageError(f"zip_records: {name} must have 1 or {count} items, got {size}")
        # The remainder is 0 in all runs for a list with a single item.
        combinations: Iterable[tuple[int, ...]] = zip(
            *((np.arange(count) % size).tolist() for size in sizes.values()), strict=True
        )
    else:
        combinations = combined(
            *map(range, (len(request.subjects), request.draws, len(request.records), len(factors)))
        )
    # Time steps depend on few values of model and record: each combination is computed one time.
    steps: dict[tuple[Any, ...], Steps] = {}
    plan = []
    for number, (model, draw, record, scale) in enumerate(combinations):
        analysis, motion = request.subjects[model].model.analysis, request.records[record]
        key = (analysis.dt, analysis.duration, motion.dt, motion.duration)
        if key not in steps:
            steps[key] = request.subjects[model].case(motion).steps(request.dt, request.duration)
        plan.append(
            RunSpec(number, model, draw, record, factors[scale] * record_scales[draw], steps[key])
        )
    return plan
