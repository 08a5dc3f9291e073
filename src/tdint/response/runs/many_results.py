"""Results of many runs: peaks and histories as arrays over the runs."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import field, fields, replace
from operator import itemgetter
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from tdint.arrays import Array, each_array, immutable
from tdint.errors import AnalysisError, UsageError, did_you_mean
from tdint.fractiles import fractiles
from tdint.ground_motion.record import Record
from tdint.model.definition import Model
from tdint.number_parsing import first_warning, pluralize
from tdint.response.runs.history import (
    ELEMENT_FORCE,
    HISTORIES_OF_MANY,
    History,
    values_of,
)
from tdint.response.runs.outcome import (
    STORY_QUANTITIES,
    Gradient,
    StoryErrors,
    StoryPeaks,
    StoryValues,
)
from tdint.response.time_steps import Steps
from tdint.system import available_memory
from tdint.tabular import Tabular

if TYPE_CHECKING:
    from xarray import Dataset

    from tdint.model.limits import LimitCheck

SCALE = "record.scale"
"""Name in `vary` that is not a parameter of the building: factor on the ground motion."""


@immutable
class Runs(Tabular):
    """Results of many runs. The first axis of the arrays is the run.

    If a building has fewer stories than the tallest building, the values above its roof are nan.

    Attributes
    ----------
    models, records : tuple
        Buildings and ground motions, each one time.
    methods : tuple of str
        Method specification of each building, as given.
    model, record : ndarray of int, shape (runs,)
        Index of the building and of the ground motion of each run.
    scale, dt : ndarray, shape (runs,)
        Factor on the ground motion; time step, s.
    steps : ndarray of int, shape (runs,)
        Number of completed time steps.
    status : ndarray of str, shape (runs,)
        As in `Response`, or as in `FailedRun` if there is no result; the values of the run are then
        nan.
    energy_error : ndarray, shape (runs,)
        Energy imbalance divided by the maximum input energy.
    stories : StoryPeaks
        Peaks of shape (runs, stories), SI units.
    history : mapping of str to ndarray, shape (runs, rows, stories)
        Kept quantities of the histories, SI units; nan after the end of a run. Arrays of
        attachments and links have the columns of `devices`.
    every : int
        Number of time steps between two rows.
    failures : mapping of int to str
        Messages of the runs without a result, by their index.
    errors, corrected : StoryErrors and StoryPeaks, or None
        Estimated errors of the peaks, and the peaks of the additional runs that determine these
        estimates, if errors were requested; as in `ErrorEstimate`, of shape (runs, stories), nan
        without an estimate.
    varied : mapping of str to ndarray, shape (runs,)
        Values of the varied parameters by name; `models` contains the buildings as given.
    gradient : Gradient | None
        Derivatives of the peaks, if requested.
    devices : StoryPeaks | None
        Peaks of the attachments and then the links, shape (runs, attachments and links), as
        `Response.devices.stories`; None without.
    warnings : tuple of str
        Unusual values of the buildings, each with its model file, as shown by `check`.
    record_rows : ndarray of int, shape (runs,)
        Number of rows of the histories up to the last sample of the record.
    """

    models: tuple[Model, ...]
    records: tuple[Record, ...]
    methods: tuple[str, ...]
    model: NDArray[np.int64]
    record: NDArray[np.int64]
    scale: Array
    dt: Array
    steps: NDArray[np.int64]
    status: NDArray[np.str_]
    energy_error: Array
    stories: StoryPeaks
    history: dict[str, NDArray[np.floating[Any]]]
    every: int
    failures: dict[int, str]
    errors: StoryErrors | None = None
    corrected: StoryPeaks | None = None
    varied: dict[str, Array] = field(default_factory=dict)
    gradient: Gradient | None = None
    warnings: tuple[str, ...] = ()
    record_rows: NDArray[np.int64] = field(default_factory=lambda: np.zeros(0, np.int64))
    devices: StoryPeaks | None = None

    def __len__(self) -> int:
        return len(self.model)

    def __getitem__(self, index: int | slice | Sequence[int]) -> Runs:
        """Return some of the runs: one run for an integer, which also counts from the end if it is
        negative. The arrays of the result keep the axis of the runs."""
        numbers = np.atleast_1d(np.arange(len(self))[index])
        runs = numbers.tolist()
        arrays = {
            name: each_array(itemgetter(numbers), getattr(self, name)) for name in _ARRAYS_OF_RUNS
        }
        failures = {i: self.failures[run] for i, run in enumerate(runs) if run in self.failures}
        return replace(self, failures=failures, **arrays)

    @property
    def time(self) -> Array:
        """Times of the rows, s, shape (1, rows) if all runs have one time step, otherwise (runs,
        rows).
        """
        rows = max((kept.shape[1] for kept in self.history.values()), default=0)
        steps = self.dt[:1] if np.all(self.dt == self.dt[:1]) else self.dt
        return np.asarray(np.multiply.outer(self.every * steps, np.arange(rows)))

    def to_xarray(self) -> Dataset:
        """Return peaks, errors and histories with units, and the properties of the runs as
        coordinates.

        Returns
        -------
        xarray.Dataset
            Dimensions run, story and, with histories, time.

        Raises
        ------
        UsageError
            xarray is not installed.
        """
        dataset: Dataset = type(self).tables().to_xarray(self)
        return dataset

    def select_building(self, number: int) -> tuple[NDArray[np.int64], StoryPeaks]:
        """Return the indices of the runs of one building, and the peaks of these runs.

        Parameters
        ----------
        number : int
            Index of the building in `models`.

        Returns
        -------
        runs : ndarray of int
            Indices of the runs.
        peaks : StoryPeaks
            Peaks, shape (runs of the building, stories of the building), SI units.
        """
        runs = np.flatnonzero(self.model == number)
        n = len(self.models[number].stories)
        return runs, each_array(lambda array: array[runs, :n], self.stories)

    def limit_checks(
        self, limit: float | str | None = None, pair_demand: str = "larger"
    ) -> dict[tuple[str, str], tuple[LimitCheck, ...]]:
        """Compare the mean demands over the ground motions with limits, as `tdint run` does for
        several records, and campaigns do.

        The records of a building with equal varied parameters are a suite. If a record has several
        factors, its smallest factor belongs to the first suite, and so on. The mean is computed in
        each story, over the ground motions without collapse; a building that collapsed or failed
        under a ground motion does not meet any limit.

        Parameters
        ----------
        limit : float or str, optional
            Drift limit that is used instead of the limits of the models, or the name of a
            performance level of the models. By default, all limits of the models.
        pair_demand : str, default "larger"
            Demand of two records that are the components of a pair by their names, with equal
            factors: the `larger` or the `mean` demand of both, as one ground motion; `separate`:
            each component is a ground motion.

        Returns
        -------
        dict of (str, str) to tuple of LimitCheck
            Comparisons by the name of the building and the text of the level (`scale 0.5`, followed
            by the varied parameters); empty tuples without a completed run.

        Raises
        ------
        UsageError
            A building has no story with a height, or no such performance level, or `pair_demand` is
            unknown.
        RecordError
            The components of a pair differ in sampling interval, length or event.
        """
        from tdint.ground_motion.horizontals import pair_name
        from tdint.ground_motion.reading.suites import suite_motions
        from tdint.model.limits import check_demands
        from tdint.response import pairs

        motions = suite_motions(self.records)
        rule = pairs.PairRule.from_motions(motions, pairs.check_pair_demand(pair_demand))
        pairs.check_pairs(motions, rule)
        checks = {}
        for (model, level), runs in self._suites().items():
            building = self.models[model]
            n = len(building.stories)
            records = self.record[runs].tolist()
            motion = rule.motions_of(list(map(pairs.Run, records, self.scale[runs].tolist())))
            outcome = pairs.outcomes_of_motions(motion, pairs.outcomes_of(self.status[runs]))
            is_completed = outcome == pairs.COMPLETED
            ends = np.array([pairs.first_runs(motion), pairs.last_runs(motion)]).T[is_completed]
            components = [[self.records[records[run]] for run in both] for both in ends.tolist()]
            names = [
                first.name if first is last else pair_name(first.source, last.source)
                for first, last in components
            ]
            peaks = {
                name: pairs.demands_of_motions(motion, abs(values), rule.demand)[is_completed]
                for name, values in vars(
                    each_array(itemgetter((runs, slice(n))), self.stories)
                ).items()
            }
            checks[building.name, level] = check_demands(
                building.limits,
                limit,
                peaks,
                np.array([story.height or math.nan for story in building.stories]),
                names,
                name=building.name,
                has_failure=not is_completed.all(),
            )
        return checks

    def over_samples(
        self, percentiles: Sequence[float] = (16.0, 50.0, 84.0)
    ) -> dict[str, list[Any]]:
        """Return statistics of the peaks over the samples of `vary`, for each building, record and
        scale.

        Parameters
        ----------
        percentiles : sequence of float
            Percentiles from 0 to 100; by default the median and the fractiles at one standard
            deviation. They are interpolated between the logarithms of the sorted values, linearly
            if the lower value is not positive, as all fractiles of studies (`tdint.fractiles`).

        Returns
        -------
        dict of str to list
            Columns of a table with a row per quantity and story: `building`, `record`, `scale`,
            `quantity`, `story` (from 1), `unit`, `samples` (number of completed runs), `failed`
            (number of other runs), `mean`, `std` (n - 1 in the denominator, nan for a single
            sample) and `p16`, `p50`, ... All values are in SI units. Runs that are not completed
            are not part of the statistics.

        Raises
        ------
        UsageError
            No parameter is varied, or a percentile is out of range.
        """
        if not self.varied:
            raise UsageError("statistics over samples require runs with `vary`")
        if not all(0.0 <= percentile <= 100.0 for percentile in percentiles):
            raise UsageError(f"percentiles must be from 0 to 100, got {list(percentiles)!r:.60}")
        names = [f"p{percentile:g}" for percentile in percentiles]
        heads = ("building", "record", "scale", "quantity", "story", "unit", "samples", "failed")
        table: dict[str, list[Any]] = {name: [] for name in (*heads, "mean", "std", *names)}
        # A varied scale is not part of the scale that all samples have in common. Rounding removes
        # the last digits of the quotient.
        common = self.scale / self.varied.get(SCALE, 1.0)
        scale = np.array([float(f"{value:.12g}") for value in common])
        groups = dict.fromkeys(
            zip(self.model.tolist(), self.record.tolist(), scale.tolist(), strict=True)
        )
        for model, record, factor in groups:
            is_member = (self.model == model) & (self.record == record) & (scale == factor)
            completed = is_member & (self.status == "done")
            head = (self.models[model].name, self.records[record].name, float(factor))
            counts = (int(completed.sum()), int((is_member & ~completed).sum()))
            for quantity in STORY_QUANTITIES:
                values = getattr(self.stories, quantity.name)[completed]
                for story in range(len(self.models[model].stories)):
                    sample = values[:, story]
                    if not sample.size or np.isnan(sample).all():
                        continue
                    row = (
                        *(*head, quantity.name, story + 1, quantity.unit, *counts),
                        float(sample.mean()),
                        float(sample.std(ddof=1)) if sample.size > 1 else math.nan,
                        *fractiles(sample, [0.01 * item for item in percentiles]).tolist(),
                    )
                    for name, value in zip(table, row, strict=True):
                        table[name].append(value)
        return table

    def _suites(self) -> dict[tuple[int, str], NDArray[np.int64]]:
        """Return the indices of the runs of each suite, by the index of the building and the text
        of the level; `limit_checks` averages the demands over a suite.

        A suite contains a run under each record, of one building with equal parameters. If a
        record has several factors, each factor belongs to another suite.
        """
        varied = {name: values for name, values in self.varied.items() if name != SCALE}
        # The run with the factor of rank r under its record belongs to suite r.
        ranks: Counter[tuple[Any, ...]] = Counter()
        suites: dict[tuple[int, tuple[float, ...], int], list[int]] = {}
        for run in np.argsort(np.abs(self.scale), kind="stable").tolist():
            building = int(self.model[run]), tuple(float(all_of[run]) for all_of in varied.values())
            record = (*building, int(self.record[run]))
            ranks[record] += 1
            suites.setdefault((*building, ranks[record]), []).append(run)
        # A suite is named by its factor if all its records have the same factor, otherwise by its
        # rank.
        named = {}
        for (model, values, rank), runs in sorted(suites.items()):
            scales = set(self.scale[runs].tolist())
            level = f"scale {scales.pop():g}" if len(scales) == 1 else f"level {rank}"
            parts = [f"{name} {value:g}" for name, value in zip(varied, values, strict=True)]
            named[model, ", ".join([level, *parts])] = np.array(sorted(runs))
        return named

    def _headline(self) -> str:
        buildings = pluralize(len(self.models), "building")
        records = pluralize(len(self.records), "record")
        kept = f", histories of {', '.join(self.history)}" if self.history else ""
        lost = f", {len(self.failures)} without a result" if self.failures else ""
        first = first_warning(self.warnings)
        return f"{len(self.model)} of {buildings} under {records}{kept}{lost}{first}"


_ARRAYS_OF_RUNS = (
    *("model", "record", "scale", "dt", "steps", "status", "energy_error", "stories", "history"),
    *("record_rows", "devices"),
    *("errors", "corrected", "varied", "gradient"),
)
"""Attributes of `Runs` with arrays that have the run as their first axis."""


def kept_quantities(
    history: bool | str | Sequence[str], width: Callable[[str], int]
) -> tuple[str, ...]:
    """Return the names of the requested history quantities without duplicates; all for True.

    `width` returns the number of columns of a quantity.

    Raises
    ------
    UsageError
        A quantity is unknown, or no building has its elements, attachments or links.
    """
    if isinstance(history, bool | np.bool_):
        return tuple(filter(width, HISTORIES_OF_MANY)) if history else ()
    names = (history,) if isinstance(history, str) else tuple(history)
    for name in names:
        if name not in HISTORIES_OF_MANY:
            raise UsageError(
                f"unknown quantity {name!r}{did_you_mean(str(name), HISTORIES_OF_MANY)} (known: "
                f"{', '.join(HISTORIES_OF_MANY)})"
            )
        if not width(name):
            is_element = name == ELEMENT_FORCE
            needed = "several elements in a story" if is_element else "attachments or links"
            raise UsageError(f"history: {name} needs a building with {needed}")
    return tuple(dict.fromkeys(names))


def history_arrays(shapes: Mapping[str, tuple[int, int, int]], out: Any) -> HistoryArrays:
    """Return the arrays for the histories: the arrays of the caller (`out`), or new arrays of nan.

    `shapes` contains for each quantity the number of runs, number of rows of the longest run, and
    number of columns (`RunsRequest.width`).

    Raises
    ------
    UsageError
        Arrays of the caller have other names, shapes or types than required.
    AnalysisError
        There is not enough memory for new arrays.
    """
    kept = tuple(shapes)
    if out is None:
        needed, free = 8.0 * sum(map(math.prod, shapes.values())), available_memory()
        runs = max((shape[0] for shape in shapes.values()), default=0)
        if needed > free:
            raise AnalysisError(
                f"the histories of {runs} runs need {needed / 1000000000.0:.3g} GB of "
                f"memory, {free / 1000000000.0:.3g} GB are free; keep fewer time steps with "
                "every=, or pass arrays with out= (float32 or memory-mapped files)"
            )
        new = {name: np.full(shape, math.nan) for name, shape in shapes.items()}
        return HistoryArrays(new, False)
    if not kept:
        raise UsageError(
            "out cannot be used, because no history is requested; omit out, or request a history"
        )
    arrays = dict(out) if isinstance(out, Mapping) else dict.fromkeys(kept[:1], out)
    if sorted(arrays) != sorted(kept):
        raise UsageError(
            f"out must contain one array for each of: {', '.join(kept)}; got "
            f"{', '.join(map(str, arrays)) or 'no array'}"
        )
    for name, array in arrays.items():
        shape = shapes[name]
        if not isinstance(array, np.ndarray) or array.shape != shape or array.dtype.kind != "f":
            received = (
                f"{array.dtype} {array.shape}"
                if isinstance(array, np.ndarray)
                else type(array).__name__
            )
            raise UsageError(
                f"out[{name!r}] must be an array of floating-point numbers, shape {shape}, got "
                f"{received}"
            )
    return HistoryArrays(arrays, True)


def store_values(
    arrays: StoryValues | None, numbers: int | Sequence[int], values: StoryValues | None
) -> None:
    """Write the values of runs to their rows; values above the roof are not changed.

    Parameters
    ----------
    arrays : StoryValues | None
        Arrays of all runs, shape (all runs, stories of the tallest building), which are changed.
        No effect if None.
    values : StoryValues | None
        Values of the runs, shape (n,) or (runs, n). No effect if None.
    """
    if arrays and values:
        for quantity in fields(arrays):
            run_values = getattr(values, quantity.name)
            getattr(arrays, quantity.name)[numbers, : run_values.shape[-1]] = run_values


class HistoryArrays(dict[str, NDArray[np.floating[Any]]]):
    """Arrays of the histories by quantity while runs write to them, shape (runs, rows, stories),
    or (runs, rows, elements).

    The arrays have the rows of the longest record. Further rows of runs that continue after it are
    added when all runs are complete (`joined`), because their number is unknown before.

    Attributes
    ----------
    later : dict
        Further rows by quantity and number of the run.
    are_given : bool
        True for arrays of the caller, which are not extended.
    """

    def __init__(self, arrays: Mapping[str, NDArray[np.floating[Any]]], are_given: bool) -> None:
        super().__init__(arrays)
        self.later: dict[tuple[str, int], Array] = {}
        self.are_given = are_given

    def store(self, number: int, name: str, values: Array) -> None:
        """Write the values of a quantity to the row `number`; nan after the end of the run and
        above its roof."""
        array = self[name]
        kept, stories = values[: array.shape[1]], values.shape[1]
        array[number, : len(kept), :stories] = kept
        array[number, len(kept) :] = array[number, :, stories:] = math.nan
        if len(values) > len(kept) and not self.are_given:
            self.later[name, number] = values[len(kept) :].copy()

    def store_history(self, number: int, history: History | None, every: int) -> None:
        """Write the history of an individual run to the row `number` of each array; nan without a
        history."""
        for name, array in self.items():
            if history is None:
                array[number] = math.nan
            else:
                self.store(number, name, values_of(history, name)[::every])

    def joined(self) -> dict[str, NDArray[np.floating[Any]]]:
        """Return the arrays with the further rows of all runs."""
        more = max((len(values) for values in self.later.values()), default=0)
        arrays = dict(self)
        for name, array in self.items() if more else ():
            rows = np.full((len(array), more, array.shape[2]), math.nan)
            for number in range(len(array)):
                values = self.later.get((name, number), rows[:0, 0])
                rows[number, : len(values), : values.shape[1]] = values
            arrays[name] = np.concatenate([array, rows], axis=1)
        return arrays


class RunSpec(NamedTuple):
    """One of many runs.

    Attributes
    ----------
    number : int
        Number of the run, which is its row in the results.
    model, draw, record : int
        Indices of its building, of the sample of its varied parameters, and of its record.
    """

    number: int
    model: int
    draw: int
    record: int
    scale: float
    steps: Steps
