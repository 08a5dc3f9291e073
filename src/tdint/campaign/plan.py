"""Plan of a campaign: all runs in order, divided into chunks. The plan does not depend on the
number of processes.

A plan is made from data in memory; no file is opened here.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Mapping, Sequence
from concurrent.futures import Future
from dataclasses import dataclass, field, replace
from pathlib import Path
from threading import Lock
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tdint.analysis.run.batch import Subject
from tdint.arrays import cached_property
from tdint.campaign.batch import BuildingRuns, Chunk, Run, RunSettings, Source, building_step
from tdint.campaign.buildings import Buildings, RowBuildings, Rules, given_buildings, models_of
from tdint.campaign.definition import CampaignFile, InventoryFile, ParameterSweep
from tdint.campaign.fragility.type_states import Damage, damage_of
from tdint.campaign.inputs import Inputs
from tdint.campaign.motions import (
    Assignment,
    Draw,
    EveryMotion,
    GivenFactors,
    Levels,
    MeasureLevels,
    Scales,
)
from tdint.errors import ModelError, ModelFault, TdintError, UsageError
from tdint.ground_motion.measures import cut_off
from tdint.ground_motion.reading.suites import SuiteMotion
from tdint.methods.catalogue import DEFAULT_METHOD
from tdint.model.definition import Model
from tdint.model.plausibility import on_plausibility
from tdint.number_parsing import abbreviate

_COLLAPSE_DRIFT = 0.10
"""Default collapse drift of buildings of an inventory."""

_SECONDS_PER_STEP = 0.15e-6
"""Approximate time per time step and story, s; used only to determine the size of chunks."""

_SECONDS_PER_BUILDING = 2e-4  # s; approximate time to create a building
_MIN_CHUNKS = 64  # number of chunks of a small campaign, enough for all processors
_MOST_NAMES = 10  # names listed in a note
_MAX_STORED_STEPS = 1000  # maximum number of buildings with a time step in memory
_MIN_CHUNK_TIME, _MAX_CHUNK_TIME = 0.002, 2.0
"""Minimum and maximum time of a chunk, s. A small campaign is divided into `_MIN_CHUNKS` chunks, so
that all processors are used."""


@dataclass(frozen=True)
class Plan:
    """Campaign with all input in memory.

    Attributes
    ----------
    name : str
        Name of the campaign.
    buildings : Buildings
        Buildings.
    motions : tuple of SuiteMotion
        All ground motions.
    assignment : Assignment
        Motions of each building.
    levels : Levels
        Scale factors of the motions.
    settings : RunSettings
        Settings of the runs.
    failures : tuple of TdintError
        Errors of records and rows of an inventory that were skipped.
    notes : tuple of str
        Notes for the user.
    warnings : tuple of str
        Unusual values of the buildings, as shown by `check`. They are shown before the notes.
    damage : Damage or None
        Definition of the damage states, if any.
    inventory : tuple of str
        Files of the inventory, if the campaign has one.
    too_far_from_sites : tuple of ModelFault
        Rows of the inventory that were skipped because they are too far from all sites.
    outputs : tuple of str or None
        Tables to write; None: all tables.
    rates : mapping of str to float
        Annual rate of each event, 1/year, if specified.
    factors : str
        Path of the file of scale factors, if any.
    style : tuple of (str, str)
        Style of the figures, and the directory that relative paths of style sheets refer to.
    pair_demand : str or None
        Rule that combines the components of pairs (`tdint.campaign.pairs`); None: the default.
    scaled : mapping
        Settings that `tdint scale` wrote next to the file of factors; empty if not available.
    """

    name: str
    buildings: Buildings
    motions: tuple[SuiteMotion, ...]
    assignment: Assignment
    levels: Levels
    settings: RunSettings
    failures: tuple[TdintError, ...] = ()
    notes: tuple[str, ...] = ()
    damage: Damage | None = None
    inventory: tuple[str, ...] = ()
    too_far_from_sites: tuple[ModelFault, ...] = ()
    outputs: tuple[str, ...] | None = None
    rates: Mapping[str, float] = field(default_factory=dict)
    factors: str = ""
    style: tuple[str, str] = ("", "")
    pair_demand: str | None = None
    scaled: Mapping[str, Any] = field(default_factory=dict)
    warnings: tuple[str, ...] = ()
    _chosen: dict[int, Future[float | None]] = field(
        default_factory=dict, init=False, repr=False, compare=False
    )
    _choosing: Lock = field(default_factory=Lock, init=False, repr=False, compare=False)

    @property
    def unused(self) -> list[tuple[str, str]]:
        """Inputs that could not be used, as pairs: the type, `record` or `building`, and the
        reasons. Errors in the same line of a file are one pair."""
        reasons_of: dict[tuple[str, str], list[str]] = {
            ("building", str(fault)): [str(fault)] for fault in self.too_far_from_sites
        }
        for error in self.failures:
            if not isinstance(error, ModelError):
                reasons_of[("record", str(error))] = [str(error)]
            else:
                for fault in error.faults:
                    reasons_of.setdefault(("building", f"{fault.source}:{fault.line}"), []).append(
                        str(fault)
                    )
        return [(kind, "; ".join(reasons)) for (kind, _), reasons in reasons_of.items()]

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
        return len(self._cuts) - 1

    def size(self, chunk: int) -> int:
        """Return the number of runs of a chunk."""
        return int(self._cuts[chunk + 1] - self._cuts[chunk])

    def buildings_of(self, chunks: Sequence[int]) -> list[int]:
        """Return the buildings with runs in some chunks. A building without runs belongs to the
        chunk of the next runs."""
        firsts = np.searchsorted(self._ends, self._cuts[:-1], side="right")
        firsts[0] = 0
        # If the runs of a building are divided between two chunks, it is the last building of the
        # first chunk and the first building of the second chunk.
        lasts = np.append(
            firsts[1:] + (self._starts[firsts[1:]] < self._cuts[1:-1]), len(self.buildings)
        )
        return sorted(
            {building for chunk in chunks for building in range(firsts[chunk], lasts[chunk])}
        )

    def chunk(self, number: int) -> Chunk:
        """Return a chunk with its complete input.

        Raises
        ------
        RecordError, AnalysisError
            An intensity measure cannot be computed for a motion.
        """
        first, last = int(self._cuts[number]), int(self._cuts[number + 1])
        # A chunk may start or end within the runs of a building: determine the slice of its runs.
        building = int(np.searchsorted(self._ends, first, side="right"))
        chosen: list[tuple[int, slice]] = []
        while first < last:
            start, end = int(self._starts[building]), int(self._ends[building])
            until = min(last, end)
            chosen.append((building, slice(first - start, until - start)))
            first, building = until, building + 1
        parts = self._with_runs(chosen)
        used = sorted({run.motion for part in parts for run in part.runs})
        return Chunk(
            number, parts, {motion: self.motions[motion].record for motion in used}, self.settings
        )

    def check_steps(self) -> None:
        """Raise UsageError if a time step does not fit a record. All buildings of an inventory have
        the same time step."""
        from tdint.analysis.time_steps import choose_steps

        settings = self.settings
        analyses = {(model.analysis.dt, model.analysis.duration) for model in self.models} or {
            (None, None)
        }
        for dt, duration in sorted(analyses, key=str):
            for motion in {last.record.dt: last for last in reversed(self.motions)}.values():
                record = motion.record
                try:
                    choose_steps(
                        settings.dt or dt, settings.duration or duration, record.dt, record.duration
                    )
                except UsageError as error:
                    raise UsageError(f"{motion.name} {motion.component}: {error}") from None

    @cached_property
    def _counts(self) -> NDArray[np.int64]:
        """Number of runs of each building."""
        return self.assignment.counts(len(self.buildings), self.levels.count)

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
        """Number of the first run of each chunk, and number of all runs."""
        steps = np.mean([motion.record.acceleration.size for motion in self.motions])
        buildings = self.buildings
        stories = (
            buildings.rows.stories
            if isinstance(buildings, RowBuildings)
            else np.array([building.stories for building in buildings])
        )
        counts = np.maximum(self._counts, 1)
        # The estimated time of a run is the time of its time steps, and a part of the time to
        # create its building.
        run_times = stories * steps * _SECONDS_PER_STEP + _SECONDS_PER_BUILDING / counts
        costs = np.cumsum(run_times * counts)
        length = min(max(costs[-1] / _MIN_CHUNKS, _MIN_CHUNK_TIME), _MAX_CHUNK_TIME)
        targets = np.arange(length, costs[-1], length)
        # Divide the runs by their estimated time, so that all chunks take about the same time: find
        # the building in which a chunk ends, and the run of this building.
        building = np.searchsorted(costs, targets)
        excess = targets - (costs[building] - run_times[building] * counts[building])
        cuts = self._starts[building] + np.ceil(excess / run_times[building]).astype(np.int64)
        return np.unique(np.concatenate([[0], np.minimum(cuts, self.runs), [self.runs]]))

    def _with_runs(self, chosen: Sequence[tuple[int, slice]]) -> tuple[BuildingRuns, ...]:
        """Return buildings with slices of their runs."""
        sources = [self.buildings[number] for number, _ in chosen]
        draws = [self.assignment.draws(number) for number, _ in chosen]
        factors = self._factors(sources, draws)
        parts = []
        for index, (number, part) in enumerate(chosen):
            runs = []
            for draw in draws[index]:
                # If the motions are scaled to levels of an intensity measure, only the sign of the
                # sampled factor is used.
                factor = math.copysign(1.0, draw.factor) if self.levels.of_value else draw.factor
                runs += [
                    Run(draw.motion, factor * scale, draw.sample)
                    for scale in factors[index, draw.motion]
                ]
            largest = self._largest_step(number, sources[index], runs)
            parts.append(BuildingRuns(number, sources[index], tuple(runs[part]), largest))
        return tuple(parts)

    def _largest_step(self, number: int, source: Source, runs: Sequence[Run]) -> float | None:
        """Return the maximum time step of a building for the tolerance, s. It is computed once for
        all chunks.

        Parameters
        ----------
        number : int
            Number of the building.
        source : Source
            Object that creates the building.
        runs : sequence of Run
            All runs of the building.
        """
        tolerance = self.settings.tolerance
        if tolerance is None:
            return math.inf
        # Several threads may have runs of the same building: the first one computes the time step,
        # the other threads wait.
        with self._choosing:
            is_first = number not in self._chosen
            if is_first:
                while len(self._chosen) >= _MAX_STORED_STEPS:
                    self._chosen.pop(next(iter(self._chosen)))
                self._chosen[number] = Future()
            chosen = self._chosen[number]
        if is_first:
            try:
                records = {run.motion: self.motions[run.motion].record for run in runs}
                chosen.set_result(
                    building_step(source.subject(), records, runs, self.settings, tolerance)
                )
            except BaseException as error:
                chosen.set_exception(error)
        return chosen.result()

    def _factors(
        self, sources: Sequence[Source], draws: Sequence[Sequence[Draw]]
    ) -> dict[tuple[int, int], tuple[float, ...]]:
        """Return the factors by index of the building and number of the motion."""
        # Compute the spectrum of each motion once for the periods of all buildings.
        buildings_of_motion: dict[int, list[int]] = {}
        for index, building_draws in enumerate(draws):
            for motion in dict.fromkeys(draw.motion for draw in building_draws):
                buildings_of_motion.setdefault(motion, []).append(index)
        periods = [
            source.subject().period if self.levels.by_period else math.nan for source in sources
        ]
        factors: dict[tuple[int, int], tuple[float, ...]] = {}
        for motion, indices in buildings_of_motion.items():
            values_by_index = self.levels.factors(motion, [periods[index] for index in indices])
            factors |= {
                (index, motion): values
                for index, values in zip(indices, values_by_index, strict=True)
            }
        return factors


def make_plan(campaign: CampaignFile, inputs: Inputs) -> Plan:
    """Return the plan of a campaign.

    Parameters
    ----------
    campaign : CampaignFile
        Definition of the campaign.
    inputs : Inputs
        Contents of its files.

    Raises
    ------
    ModelError
        A file of factors does not contain a motion.
    UsageError
        A time step does not fit a record.
    """
    motions, notes = inputs.motions, list[str]()
    buildings = _buildings(campaign, inputs, notes)
    levels: Levels
    if isinstance(campaign.intensity, Scales):
        levels = campaign.intensity
    elif isinstance(campaign.intensity, MeasureLevels):
        levels = replace(campaign.intensity, motions=motions.motions)
    else:
        assert inputs.factors is not None
        levels = GivenFactors(
            {number: inputs.factors.of(motion) for number, motion in enumerate(motions.motions)}
        )
    duration = campaign.settings.duration
    ends = [duration or model.analysis.duration for model in inputs.models] or [duration]
    notes += cut_off(
        (motion.record for motion in motions.motions), min(filter(None, ends), default=math.inf)
    )
    # Residual drifts at the end of a record are not final, because the building still vibrates.
    damage = damage_of(campaign.damage, inputs.damage, buildings)
    residual = damage and any("residual" in type_.demand for type_ in damage.types.values())
    if residual and not campaign.settings.until_rest:
        notes.append(
            "damage states depend on residual drifts, but the building still vibrates at the end "
            "of "
            "the records; set until_rest of the analysis to continue until it is at rest"
        )
    # The plan includes all messages before the runs: skipped inputs, notes and warnings.
    plan = Plan(
        name=campaign.name,
        buildings=buildings,
        motions=motions.motions,
        assignment=inputs.assignment or EveryMotion(len(motions.motions)),
        levels=levels,
        settings=campaign.settings,
        failures=(*motions.failures, *inputs.faults),
        too_far_from_sites=inputs.too_far_from_sites,
        outputs=campaign.outputs,
        style=(
            campaign.style,
            str(Path(campaign.source).parent.absolute()) if campaign.style else "",
        ),
        rates=motions.rates,
        pair_demand=campaign.pair_demand,
        notes=(*notes, *motions.notes),
        warnings=on_plausibility(
            (subject.model, subject.prepared.building)
            for subject in (item.subject() for item in (buildings if inputs.models else ()))
        ),
        damage=damage,
        factors=inputs.factors.source if inputs.factors else "",
        scaled=inputs.factors.scaled if inputs.factors else {},
        inventory=campaign.buildings.files if isinstance(campaign.buildings, InventoryFile) else (),
    )
    plan.check_steps()
    return plan


def _buildings(campaign: CampaignFile, inputs: Inputs, notes: list[str]) -> Buildings:
    """Return the buildings, each with its method.

    The campaign specifies the method for all buildings, otherwise the model; a building without a
    specified method has the default, and a note reports this.

    Parameters
    ----------
    campaign : CampaignFile
        Definition of the campaign.
    inputs : Inputs
        Contents of its files.
    notes : list of str
        Notes for the user; notes are appended.
    """
    inventory, analysis = campaign.buildings, campaign.analysis
    # All buildings of an inventory are derived by the same rules. Errors of the rules are reported
    # at the key of the sweep, because a sweep may have changed their parameters.
    if isinstance(inventory, InventoryFile):
        with (campaign.sweep or ParameterSweep()).reported_at_key():
            if analysis.method is None:
                notes.append(f"no method is specified; using {DEFAULT_METHOD}")
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
    counts = Counter((model.source, model.label) for model in inputs.models)
    repeated = [source for (source, _), count in counts.items() if count > 1]
    if repeated:
        notes.append(
            "model files listed more than once, which are run repeatedly: "
            f"{abbreviate(list(dict.fromkeys(repeated)), _MOST_NAMES)}"
        )
    # A method of the campaign replaces the methods of the models.
    subjects = []
    for model in inputs.models:
        method = analysis.method or model.analysis.method
        if method is None:
            method = DEFAULT_METHOD
            notes.append(f"{model.source}: no method is specified; using {DEFAULT_METHOD}")
        subjects.append(Subject(model, method))
    return given_buildings(subjects)
