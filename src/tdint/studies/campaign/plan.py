"""Plan of a campaign: all runs, numbered from 0 in the order of the buildings, and their division
into chunks. The plan does not depend on the number of processes.

A plan is made from data in memory; this module does not open files.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import field, replace
from itertools import accumulate
from threading import Lock
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tdint.arrays import Array, cached_property, immutable
from tdint.errors import ModelError, ModelFault, TdintError, UsageError
from tdint.ground_motion.measures import cut_off
from tdint.ground_motion.reading.suites import SuiteMotion
from tdint.ground_motion.record import Record
from tdint.methods.catalogue import DEFAULT_METHOD, method_of
from tdint.model.definition import Model
from tdint.model.plausibility import study_plausibility_warnings
from tdint.number_parsing import abbreviate
from tdint.response.defaults import NO_METHOD
from tdint.response.pairs import PairRule, Run, motions_and_levels, recordings_of
from tdint.response.runs.batch import Subject
from tdint.response.runs.load_case import LoadCase
from tdint.response.runs.load_notes import table_notes
from tdint.response.time_steps import choose_steps
from tdint.studies.campaign import assigned_motions
from tdint.studies.campaign.buildings import (
    Buildings,
    RowBuildings,
    Rules,
    model_buildings,
    models_of,
)
from tdint.studies.campaign.chunks import (
    BuildingRuns,
    CampaignSettings,
    Chunk,
    Rows,
    Source,
    building_step,
    values_by_motion,
)
from tdint.studies.campaign.definition import CampaignFile, InventoryFile, ParameterSweep
from tdint.studies.campaign.inputs import Inputs
from tdint.studies.fragility.type_states import Damage, damage_of
from tdint.studies.regions.inventory import unusual_rows

_COLLAPSE_DRIFT = 0.10
"""Default collapse drift of buildings of an inventory."""

_SECONDS_PER_STEP = 0.15e-6
"""Approximate time per time step and story, s; used only to determine the size of chunks."""

_SECONDS_PER_BUILDING = 2e-4  # s; approximate time to create a building
_MIN_CHUNKS = 64  # number of chunks of a small campaign, enough for all processors
_MOST_NAMES = 10  # names listed in a note
_LOCKS = 64  # number of locks; buildings with different locks do not wait for each other
_MIN_CHUNK_TIME, _MAX_CHUNK_TIME = 0.002, 2.0
"""Minimum and maximum time of a chunk, s. A small campaign is divided into `_MIN_CHUNKS` chunks, so
that all processors are used."""


@immutable
class Plan:
    """Campaign with all input in memory.

    Attributes
    ----------
    failures : tuple of TdintError
        Errors of records and rows of an inventory that were skipped.
    warnings : tuple of str
        Unusual values of the buildings, as shown by `check`. They are shown before the notes.
    vary_units : mapping of str to str
        Units of the numbers of each varied parameter, if they are not SI units.
    """

    name: str
    buildings: Buildings
    motions: tuple[SuiteMotion, ...]
    assignment: assigned_motions.Assignment
    levels: assigned_motions.Levels
    settings: CampaignSettings
    failures: tuple[TdintError, ...] = ()
    notes: tuple[str, ...] = ()
    damage: Damage | None = None
    inventory: tuple[str, ...] = ()
    too_far_from_sites: tuple[ModelFault, ...] = ()
    outputs: tuple[str, ...] | None = None
    rates: Mapping[str, float] = field(default_factory=dict)
    style: str = ""
    pair_demand: str | None = None
    warnings: tuple[str, ...] = ()
    vary_units: Mapping[str, str] = field(default_factory=dict)
    # Rows of an earlier store (`tdint.studies.campaign.execute.reuse_results`) by the number of the
    # chunk; `chunk` omits their runs.
    kept: dict[int, Rows] = field(default_factory=dict, init=False)
    # Maximum number of the other runs of a chunk (`--max-runs`)
    most: dict[int, int] = field(default_factory=dict, init=False)
    _locks: list[Lock] = field(default_factory=lambda: [Lock() for _ in range(_LOCKS)], init=False)

    @property
    def scaling(self) -> dict[str, Any]:
        """File of the scale factors with rule and target of `tdint scale`, which are missing if
        they are unknown; empty without a file of factors."""
        if not isinstance(self.levels, assigned_motions.FactorTable):
            return {}
        settings = self.levels.scaled.get("settings", {})
        names = ("rule", "target", "measure", "value", "unit")
        return {"file": self.levels.source} | {
            name: settings[name] for name in names if settings.get(name) not in (None, "")
        }

    @property
    def unused(self) -> list[tuple[str, str]]:
        """Inputs that could not be used. Each item is a tuple of the category, `record` or
        `building`, and a text with the reasons. Errors in the same line of a file are one item."""
        # Reasons with the same key are one item. The key is the category and a text: the line of an
        # inventory, because a line is a building, otherwise the reason.
        reasons_of: dict[tuple[str, str], list[str]] = {
            ("building", str(fault)): [str(fault)] for fault in self.too_far_from_sites
        }
        for error in self.failures:
            if not isinstance(error, ModelError):
                reasons_of[("record", str(error))] = [str(error)]
            else:
                for invalid_entry in error.faults:
                    key = "building", f"{invalid_entry.source}:{invalid_entry.line}"
                    reasons_of.setdefault(key, []).append(str(invalid_entry))
        return [(category, "; ".join(reasons)) for (category, _), reasons in reasons_of.items()]

    @property
    def models(self) -> list[Model]:
        """Models of the model files; empty for an inventory."""
        return models_of(self.buildings)

    @property
    def runs(self) -> int:
        """Number of runs."""
        return int(self._ends[-1])

    @property
    def chunks(self) -> int:
        """Number of chunks."""
        return len(self._cuts) - 1  # the last element of `_cuts` is the end of the last chunk

    def size(self, chunk: int) -> int:
        """Return the number of runs of a chunk."""
        return int(self._cuts[chunk + 1] - self._cuts[chunk])

    def buildings_of(self, chunks: Sequence[int]) -> list[int]:
        """Return the numbers of the buildings of the given chunks in ascending order.

        A building belongs to each chunk with a run of the building. A building without runs belongs
        to the chunk of the preceding run; before the first run, to the first chunk. No chunk is
        empty."""
        # Runs are numbered from 0. `_starts` and `_ends` contain the first run of each building,
        # and its last run plus 1; `_cuts` contains the first run of each chunk, and the end.
        #
        # Number of the first building of each chunk: the first building with `_ends` above the
        # first run of the chunk. The first chunk starts with building 0, even without runs. A
        # building that starts before the next chunk is also part of this chunk.
        first_buildings = np.searchsorted(self._ends, self._cuts, side="right")
        first_buildings[0] = 0
        end_buildings = np.maximum(first_buildings, np.searchsorted(self._starts, self._cuts))
        selected = set[int]()
        for chunk in chunks:
            selected.update(range(first_buildings[chunk], end_buildings[chunk + 1]))
        return sorted(selected)

    def chunk(self, number: int) -> Chunk:
        """Return the chunk with the given number (from 0), with its complete input.

        Raises
        ------
        RecordError, AnalysisError
            An intensity measure cannot be computed for a motion.
        """
        run, end_run = int(self._cuts[number]), int(self._cuts[number + 1])
        # A chunk may start or end within the runs of a building. For each building, determine the
        # slice of its runs that belongs to the chunk, counted from the first run of the building.
        # `searchsorted` returns the building of the first run: the first with `_ends` above `run`.
        building = int(np.searchsorted(self._ends, run, side="right"))
        slices: list[tuple[int, slice]] = []
        while run < end_run:
            building_start, building_end = int(self._starts[building]), int(self._ends[building])
            slice_end = min(end_run, building_end)
            slices.append((building, slice(run - building_start, slice_end - building_start)))
            run, building = slice_end, building + 1
        buildings = self._with_runs(slices)
        if number in self.kept:
            kept_runs = {tuple(row[:4]) for row in self.kept[number].runs}
            buildings = tuple(part.without(kept_runs) for part in buildings)
        if number in self.most:
            counts = [len(part.runs) for part in buildings]
            left = [self.most[number] - before for before in accumulate(counts, initial=0)]
            limited = zip(buildings, left, strict=False)
            buildings = tuple(part.first(max(count, 0)) for part, count in limited)
        used_motions = sorted({run.motion for part in buildings for run in part.runs})
        records = {motion: self.motions[motion].record for motion in used_motions}
        return Chunk(number, buildings, records, self.settings)

    def check_steps(self) -> None:
        """Raise UsageError if the time step or duration of the campaign, or of a model, does not
        fit the sampling interval or the duration of a record."""
        settings = self.settings
        analyses = {(model.analysis.dt, model.analysis.duration) for model in self.models}
        # An inventory does not specify these settings, so all its buildings have the same.
        analyses = analyses or {(None, None)}
        # Records with the same sampling interval have the same result: check the first row. In
        # reverse order, the first motion is the last to be assigned to its key.
        first_motions = {motion.record.dt: motion for motion in reversed(self.motions)}
        for dt, duration in sorted(analyses, key=str):
            for first_motion in first_motions.values():
                record = first_motion.record
                if isinstance(record, LoadCase):
                    if (settings.duration or duration) is None:
                        raise UsageError(
                            "the duration is required, because forces have no record; specify "
                            "`analysis: {duration: SECONDS}` in the campaign file, or in each model"
                        )
                    continue
                try:
                    choose_steps(
                        settings.dt or dt, settings.duration or duration, record.dt, record.duration
                    )
                except UsageError as error:
                    motion_name = f"{first_motion.name} {first_motion.component}"
                    raise UsageError(f"{motion_name}: {error}") from None

    @cached_property
    def _counts(self) -> NDArray[np.int64]:
        """Number of runs of each building."""
        return self.assignment.counts(
            len(self.buildings), lambda motion: len(self.levels.level_values(motion))
        )

    @cached_property
    def _ends(self) -> NDArray[np.int64]:
        """Number of the last run of each building, plus 1."""
        return np.cumsum(self._counts)

    @cached_property
    def _starts(self) -> NDArray[np.int64]:
        """Number of the first run of each building."""
        return self._ends - self._counts

    @cached_property
    def _cuts(self) -> NDArray[np.int64]:
        """Number of the first run of each chunk, followed by the number of all runs. All chunks
        need about the same estimated time."""
        mean_samples = np.mean([_samples(motion.record) for motion in self.motions])
        buildings = self.buildings
        stories = (
            buildings.rows.stories
            if isinstance(buildings, RowBuildings)
            else np.array([building.stories for building in buildings])
        )
        run_counts = np.maximum(self._counts, 1)
        # The estimated time of a run is the time of its time steps, and a part of the time to
        # create its building.
        run_times = stories * mean_samples * _SECONDS_PER_STEP + _SECONDS_PER_BUILDING / run_counts
        cumulative_time = np.cumsum(run_times * run_counts)
        chunk_time = min(max(cumulative_time[-1] / _MIN_CHUNKS, _MIN_CHUNK_TIME), _MAX_CHUNK_TIME)
        end_times = np.arange(chunk_time, cumulative_time[-1], chunk_time)
        # Determine the building at the end of each chunk, and the last run of the building in the
        # chunk. The time in this building is counted from its first run.
        last_building = np.searchsorted(cumulative_time, end_times)
        run_time = run_times[last_building]
        time_in_building = end_times - (
            cumulative_time[last_building] - run_time * run_counts[last_building]
        )
        runs_in_building = np.ceil(time_in_building / run_time).astype(np.int64)
        cuts = self._starts[last_building] + runs_in_building
        return np.unique(np.concatenate([[0], np.minimum(cuts, self.runs), [self.runs]]))

    def _with_runs(self, slices: Sequence[tuple[int, slice]]) -> tuple[BuildingRuns, ...]:
        """Return buildings (by number) with a slice of their runs and with the maximum time step
        that meets the tolerance.
        """
        # `draws` contains the motions of each building with the factors of the grid or the field.
        sources = [self.buildings[number] for number, _ in slices]
        draws = [self.assignment.draws(number) for number, _ in slices]
        # Levels of a measure at the first period require the building; other levels do not.
        is_measure = isinstance(self.levels, assigned_motions.MeasureLevels)
        needs_period = (
            isinstance(self.levels, assigned_motions.MeasureLevels) and self.levels.period is None
        )
        periods = [source.subject().period if needs_period else math.nan for source in sources]
        motions = [[draw.motion for draw in building_draws] for building_draws in draws]
        factors = values_by_motion(motions, periods, self.levels.factors)
        result = []
        for index, (number, run_slice) in enumerate(slices):
            runs, levels = list[Run](), list[float]()
            for draw in draws[index]:
                # If the motions are scaled to levels of an intensity measure, the factor of the
                # grid or field only determines the direction of the motion (its sign). It is not
                # zero, because the readers of grids and fields refuse zero.
                factor = math.copysign(1.0, draw.scale) if is_measure else draw.scale
                scales = factors[index][draw.motion]
                runs += [draw._replace(scale=factor * scale) for scale in scales]
                levels += self._levels_of(draw.motion)
            # The time step is chosen from all runs of the building, so that it does not depend on
            # the division into chunks.
            max_step = self._max_step(number, sources[index], runs)
            places = motions_and_levels(runs, levels, self.recordings)
            part = dict(zip(runs[run_slice], places[run_slice], strict=True))
            result.append(BuildingRuns(number, sources[index], part, max_step))
        return tuple(result)

    @cached_property
    def own_periods(self) -> dict[str, float]:
        """First periods of the buildings of model files, s, if the motions are scaled to levels at
        these periods and they differ, so that buildings have different factors; otherwise empty."""
        if isinstance(self.buildings, RowBuildings):
            return {}
        period = self.levels.description().get("period")
        return different_periods(
            ((building.name, building.subject().period) for building in self.buildings), period
        )

    @cached_property
    def recordings(self) -> Mapping[int, int]:
        """Number of the first component of the recording of each motion."""
        return PairRule.from_motions(self.motions, None).recordings

    def _levels_of(self, motion: int) -> Sequence[float]:
        """Return the level of each scale factor of a motion. Several factors of motions at sites,
        which have individual factors, are numbered."""
        values = self.levels.level_values(motion)
        if not isinstance(self.levels, assigned_motions.Scales) or isinstance(
            self.assignment, assigned_motions.EveryMotion
        ):
            return values
        if len(values) == 1:
            return [math.nan]
        order = sorted(range(len(values)), key=lambda index: abs(values[index]))
        return [1.0 + order.index(index) for index in range(len(values))]

    def _max_step(self, number: int, source: Source, runs: Sequence[Run]) -> float | None:
        """Return the maximum time step of a building for which the estimated errors are within the
        tolerance of the campaign, s: None if there is none, infinity without a tolerance. It is
        computed once for all chunks.
        """
        tolerance = self.settings.tolerance
        if tolerance is None:
            return math.inf
        # Several threads may have runs of the same building: the first thread computes the time
        # step, the other threads wait.
        max_steps = self._max_steps
        with self._locks[number % _LOCKS]:
            if math.isnan(max_steps[number]):
                records = {run.motion: self.motions[run.motion].record for run in runs}
                step = building_step(source.subject(), records, runs, self.settings, tolerance)
                max_steps[number] = step or 0.0
        return float(max_steps[number]) or None

    @cached_property
    def _max_steps(self) -> Array:
        """Maximum time step of each building, s: NaN before it is computed, 0 if there is none."""
        return np.full(len(self.buildings), math.nan)


def different_periods(periods: Iterable[tuple[str, float]], period: object) -> dict[str, float]:
    """Return the first periods of the buildings by name if the levels are at the first period of
    each building (`period` is T1) and the periods differ; otherwise empty."""
    own_periods = dict(periods) if period == "T1" else {}
    return own_periods if len(set(own_periods.values())) > 1 else {}


def _samples(record: Record) -> int:
    """Return the number of samples of a record, or of rows of the table of a load case."""
    if isinstance(record, LoadCase):
        return int(record.loads[0].table.times.size)
    return record.samples


def make_plan(campaign: CampaignFile, inputs: Inputs) -> Plan:
    """Return the plan of a campaign: its buildings, ground motions, scale factors and settings, and
    the notes and warnings that are shown before the runs.

    Raises
    ------
    ModelError
        A file of factors does not contain a motion, or a building has no damage states.
    UsageError
        A time step does not fit a record.
    """
    motions, notes = inputs.motions, list[str]()
    vary_units = campaign.sweep.foreign_units(inputs.models) if campaign.sweep else {}
    sources = abbreviate(list(dict.fromkeys(model.source for model in inputs.models)), _MOST_NAMES)
    unit_lines = [
        f"vary: {name}: numbers are in {unit}, units of {sources}"
        for name, unit in vary_units.items()
    ]
    if campaign.sweep and campaign.sweep.correlation:
        notes.append(campaign.sweep.correlation.note)
    buildings, levels = _buildings(campaign, inputs, notes), _levels(campaign, inputs)
    # Report records that the shortest duration of the analyses cuts off. The duration of the
    # campaign has precedence over the durations of the models; None is no limit.
    duration = campaign.settings.duration
    durations = [duration or model.analysis.duration for model in inputs.models] or [duration]
    shortest_duration = min(filter(None, durations), default=math.inf)
    notes += cut_off((motion.record for motion in motions.motions), shortest_duration)
    for motion in motions.motions:
        if isinstance(motion.record, LoadCase) and inputs.models:
            notes += table_notes(motion.record.on(inputs.models[0]), shortest_duration)
    damage = damage_of(campaign.damage, inputs.damage, buildings)
    depends_on_residual = damage and any(
        "residual" in states.demand for states in damage.types.values()
    )
    if depends_on_residual and not campaign.settings.until_rest:
        notes.append(
            "damage states depend on residual drifts, but the building still vibrates at the end "
            "of the records; set until_rest of the analysis to continue until it is at rest"
        )
    plan = Plan(
        name=campaign.name,
        buildings=buildings,
        motions=motions.motions,
        assignment=motions.site_motions or assigned_motions.EveryMotion(len(motions.motions)),
        levels=levels,
        settings=campaign.settings,
        failures=(*motions.failures, *inputs.faults),
        too_far_from_sites=inputs.too_far_from_sites,
        outputs=campaign.outputs,
        style=campaign.style,
        rates=motions.rates,
        pair_demand=campaign.pair_demand,
        notes=(*notes, *motions.notes),
        warnings=(
            *unit_lines,
            *_factor_warnings(levels, motions.motions),
            *_plausibility_warnings(buildings),
        ),
        vary_units=vary_units,
        damage=damage,
        inventory=campaign.buildings.files if isinstance(campaign.buildings, InventoryFile) else (),
    )
    plan.check_steps()
    if plan.own_periods:
        note = (
            "the factors of a motion differ between the buildings, because the levels are at the "
            "first period of each building: the buildings are not compared"
        )
        plan = replace(plan, notes=(*plan.notes, note))
    return plan


def _levels(campaign: CampaignFile, inputs: Inputs) -> assigned_motions.Levels:
    """Return the scale factors of the motions. The campaign file specifies the factors, levels of
    an intensity measure from which factors are computed, or a file of factors. ModelError is raised
    if this file does not contain a motion.
    """
    motions = inputs.motions.motions
    if isinstance(campaign.intensity, assigned_motions.Scales):
        return campaign.intensity
    if isinstance(campaign.intensity, assigned_motions.MeasureLevels):
        return replace(campaign.intensity, recordings=recordings_of(motions))
    table = inputs.factors
    assert table is not None
    return table.of_motions(motions)


def _factor_warnings(levels: assigned_motions.Levels, motions: Sequence[SuiteMotion]) -> list[str]:
    """Return a warning for each pair of components with different factors in a table."""
    if not isinstance(levels, assigned_motions.FactorTable):
        return []
    return levels.unequal_factors(motions, PairRule.from_motions(motions, None).partners)


def _plausibility_warnings(buildings: Buildings) -> tuple[str, ...]:
    """Return the warnings about unusual values of the buildings, such as an implausible first
    period. All buildings of model files are created for this purpose."""
    if isinstance(buildings, RowBuildings):
        return tuple(unusual_rows(buildings.rows, buildings.rules.name))
    subjects = (building.subject() for building in buildings)
    return study_plausibility_warnings(
        (subject.model, subject.prepared.building) for subject in subjects
    )


def _buildings(campaign: CampaignFile, inputs: Inputs, notes: list[str]) -> Buildings:
    """Return the buildings of a campaign, each with its time integration method, and append notes
    for the user to `notes`.

    The method is specified by the campaign for all buildings, or by each model. A building without
    a specified method has the default method, which a note reports. ModelError is raised if a
    variation of a sweep is invalid.
    """
    inventory, analysis = campaign.buildings, campaign.analysis
    # All buildings of an inventory are derived by the same rules. Errors of the rules are reported
    # at the key of the sweep, because a sweep may have changed their parameters.
    if isinstance(inventory, InventoryFile):
        with (campaign.sweep or ParameterSweep()).reported_at_key():
            if analysis.method is None:
                notes.append(f"{NO_METHOD}; using {DEFAULT_METHOD}")
            scatter = inventory.stiffness_scatter, inventory.damping_scatter, inventory.seed
            analysis_settings = (
                analysis.method or DEFAULT_METHOD,
                analysis.collapse_drift or _COLLAPSE_DRIFT,
                bool(analysis.p_delta),
            )
            rules = Rules(inventory.rules, *scatter, *analysis_settings)
            assert inputs.rows is not None
            return RowBuildings(inputs.rows, rules)
    if len({model.output_units for model in inputs.models}) > 1:
        notes.append(
            "the models specify different output units: results are written in SI units; select "
            "others with --output-units"
        )
    # Warn of model files that are listed repeatedly. Variations of a model in a sweep have
    # different labels.
    file_counts = Counter((model.source, model.label) for model in inputs.models)
    repeated = [source for (source, _), count in file_counts.items() if count > 1]
    if repeated:
        notes.append(
            "model files listed more than once, which are run repeatedly: "
            f"{abbreviate(list(dict.fromkeys(repeated)), _MOST_NAMES)}"
        )
    subjects = []
    for model in inputs.models:
        method = method_of(model, analysis.method)
        if not (analysis.method or model.analysis.method):
            notes.append(f"{model.source}: {NO_METHOD}; using {method}")
        subjects.append(Subject(model, method))
    return model_buildings(subjects)
