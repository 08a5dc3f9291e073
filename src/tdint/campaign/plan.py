"""All runs of a campaign in their order, cut into chunks; which run is which does not depend on who
does them.

A plan is made of what was read: nothing is opened here.
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

from tdint.analysis.run.together import Subject
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
from tdint.written_numbers import first_few

_COLLAPSE_DRIFT = 0.10
"""Of buildings by rules, where a campaign says nothing of it."""

_SECONDS_PER_STEP = 0.15e-6
"""Roughly, for each story; it decides on the size of chunks alone."""

_SECONDS_PER_BUILDING = 2e-4
_CHUNKS = 64
_MOST_NAMES = 10  # that a note names
_KEPT = 1000  # buildings whose steps are remembered
_SHORTEST, _LONGEST = 0.002, 2.0
"""Seconds of a chunk: a small campaign is cut into `_CHUNKS`, so that all processors have their
share."""


@dataclass(frozen=True)
class Plan:
    """A campaign, read and put together.

    Attributes
    ----------
    name : str
        Of the campaign.
    buildings : Buildings
        The buildings.
    motions : tuple of SuiteMotion
        All ground motions.
    assignment : Assignment
        Which of them each building gets.
    levels : Levels
        The factors on them.
    settings : RunSettings
        How all runs are integrated.
    failures : tuple of TdintError
        Records and rows of an inventory that could not be read; the others are taken.
    notes : tuple of str
        What a person should know.
    warnings : tuple of str
        Unusual values of the buildings, as `check` shows them: they are shown before all notes.
    damage : Damage or None
        How damage is told, where it is.
    inventory : tuple of str
        The files of the inventory, if its rows are the buildings.
    far : tuple of ModelFault
        Rows of the inventory that are left out, for they are too far from any site.
    outputs : tuple of str or None
        The tables that are written; None: all that there are.
    rates : mapping of str to float
        How often events come in a year, as far as it is told.
    factors : str
        The file of the factors on the motions, if there is one.
    style : tuple of (str, str)
        Looks of the pictures as they are written, and the folder that a style sheet in them is
        relative to.
    pair_demand : str or None
        How the components of pairs count (`tdint.campaign.pairs`); None: the default.
    scaled : mapping
        What `tdint scale` told beside it of how they came about; empty where it did not, or not of
        these.
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
    far: tuple[ModelFault, ...] = ()
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
        """Of each record and row of an inventory that could not be used `record` or `building`, and
        why."""
        reasons_of: dict[tuple[str, str], list[str]] = {
            ("building", str(fault)): [str(fault)] for fault in self.far
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
        """The models of its buildings, where they come from files; none of an inventory."""
        return models_of(self.buildings)

    @property
    def runs(self) -> int:
        """How many runs there are."""
        return int(self._ends[-1])

    @property
    def chunks(self) -> int:
        """How many chunks they are cut into."""
        return len(self._cuts) - 1

    def size(self, chunk: int) -> int:
        """How many runs a chunk has."""
        return int(self._cuts[chunk + 1] - self._cuts[chunk])

    def buildings_of(self, chunks: Sequence[int]) -> list[int]:
        """The buildings whose runs some chunks have; one without any belongs to the chunk that goes
        on behind it."""
        firsts = np.searchsorted(self._ends, self._cuts[:-1], side="right")
        firsts[0] = 0
        # A building may begin in one chunk and end in the next one.
        lasts = np.append(
            firsts[1:] + (self._starts[firsts[1:]] < self._cuts[1:-1]), len(self.buildings)
        )
        return sorted({at for chunk in chunks for at in range(firsts[chunk], lasts[chunk])})

    def chunk(self, number: int) -> Chunk:
        """A chunk with all that its runs need. Errors are those of intensity measures that a motion
        does not have."""
        first, last = int(self._cuts[number]), int(self._cuts[number + 1])
        # A chunk may begin and end within a building: its slice of that building's runs.
        at = int(np.searchsorted(self._ends, first, side="right"))
        chosen: list[tuple[int, slice]] = []
        while first < last:
            start, end = int(self._starts[at]), int(self._ends[at])
            until = min(last, end)
            chosen.append((at, slice(first - start, until - start)))
            first, at = until, at + 1
        parts = self._with_runs(chosen)
        used = sorted({run.motion for part in parts for run in part.runs})
        return Chunk(
            number, parts, {motion: self.motions[motion].record for motion in used}, self.settings
        )

    def check_steps(self) -> None:
        """Raise UsageError for a step that does not fit a record; of an inventory all buildings are
        alike in that."""
        from tdint.analysis.run.workspace import choose_steps

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
        """Runs of each building."""
        return self.assignment.counts(len(self.buildings), self.levels.count)

    @cached_property
    def _ends(self) -> NDArray[np.int64]:
        return np.cumsum(self._counts)

    @cached_property
    def _starts(self) -> NDArray[np.int64]:
        return self._ends - self._counts

    @cached_property
    def _cuts(self) -> NDArray[np.int64]:
        """The first run of each chunk, and the number of all runs."""
        steps = np.mean([motion.record.acceleration.size for motion in self.motions])
        of = self.buildings
        stories = (
            of.rows.stories
            if isinstance(of, RowBuildings)
            else np.array([building.stories for building in of])
        )
        counts = np.maximum(self._counts, 1)
        # What a run costs, by its steps and stories, and by the building that is made for it.
        each = stories * steps * _SECONDS_PER_STEP + _SECONDS_PER_BUILDING / counts
        costs = np.cumsum(each * counts)
        length = min(max(costs[-1] / _CHUNKS, _SHORTEST), _LONGEST)
        targets = np.arange(length, costs[-1], length)
        # Cuts by costs, not by numbers of runs: chunks then take about the same time.
        at = np.searchsorted(costs, targets)
        into = targets - (costs[at] - each[at] * counts[at])
        cuts = self._starts[at] + np.ceil(into / each[at]).astype(np.int64)
        return np.unique(np.concatenate([[0], np.minimum(cuts, self.runs), [self.runs]]))

    def _with_runs(self, chosen: Sequence[tuple[int, slice]]) -> tuple[BuildingRuns, ...]:
        """Buildings with some of their runs."""
        sources = [self.buildings[number] for number, _ in chosen]
        draws = [self.assignment.draws(number) for number, _ in chosen]
        factors = self._factors(sources, draws)
        parts = []
        for place, (number, part) in enumerate(chosen):
            runs = []
            for draw in draws[place]:
                # Levels of a value leave of a draw's own factor its sign alone.
                factor = math.copysign(1.0, draw.factor) if self.levels.of_value else draw.factor
                runs += [
                    Run(draw.motion, factor * scale, draw.sample)
                    for scale in factors[place, draw.motion]
                ]
            largest = self._largest_step(number, sources[place], runs)
            parts.append(BuildingRuns(number, sources[place], tuple(runs[part]), largest))
        return tuple(parts)

    def _largest_step(self, number: int, source: Source, runs: Sequence[Run]) -> float | None:
        """The largest step of a building for the tolerance, s: found once, whatever chunks its runs
        are in."""
        tolerance = self.settings.tolerance
        if tolerance is None:
            return math.inf
        # Several threads may have runs of one building: who comes first chooses, the others wait.
        with self._choosing:
            mine = number not in self._chosen
            if mine:
                while len(self._chosen) >= _KEPT:
                    self._chosen.pop(next(iter(self._chosen)))
                self._chosen[number] = Future()
            chosen = self._chosen[number]
        if mine:
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
        """The factors by the place of a building and the number of a motion."""
        # By motion: its spectrum is computed once for the periods of all buildings.
        users: dict[int, list[int]] = {}
        for place, of_building in enumerate(draws):
            for motion in dict.fromkeys(draw.motion for draw in of_building):
                users.setdefault(motion, []).append(place)
        periods = [
            source.subject().period if self.levels.by_period else math.nan for source in sources
        ]
        factors: dict[tuple[int, int], tuple[float, ...]] = {}
        for motion, places in users.items():
            of_places = self.levels.factors(motion, [periods[place] for place in places])
            factors |= {
                (place, motion): values for place, values in zip(places, of_places, strict=True)
            }
        return factors


def make_plan(campaign: CampaignFile, inputs: Inputs) -> Plan:
    """The plan of a campaign, of what was read for it.

    Raises
    ------
    ModelError
        A file of factors has none for a motion.
    UsageError
        A time step that does not fit.
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
    # A residual drift at the end of a record is still swinging.
    damage = damage_of(campaign.damage, inputs.damage, buildings)
    residual = damage and any("residual" in type_.demand for type_ in damage.types.values())
    if residual and not campaign.settings.until_rest:
        notes.append(
            "damage is told by drifts at the end of the records: until_rest of the analysis goes "
            "on to rest"
        )
    # All that is said before the runs goes along: what was left out, and what may surprise.
    plan = Plan(
        name=campaign.name,
        buildings=buildings,
        motions=motions.motions,
        assignment=inputs.assignment or EveryMotion(len(motions.motions)),
        levels=levels,
        settings=campaign.settings,
        failures=(*motions.failures, *inputs.faults),
        far=inputs.far,
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
            for subject in (item.subject() for item in buildings if inputs.models)
        ),
        damage=damage,
        factors=inputs.factors.source if inputs.factors else "",
        scaled=inputs.factors.scaled if inputs.factors else {},
        inventory=campaign.buildings.files if isinstance(campaign.buildings, InventoryFile) else (),
    )
    plan.check_steps()
    return plan


def _buildings(campaign: CampaignFile, inputs: Inputs, notes: list[str]) -> Buildings:
    """The buildings with their methods: that of the campaign, of a model, or the default, which is
    noted."""
    inventory, analysis = campaign.buildings, campaign.analysis
    # An inventory has rules for all rows; their scatter is drawn by the id of each.
    if isinstance(inventory, InventoryFile):
        with (campaign.sweep or ParameterSweep()).reported_at_key():
            if analysis.method is None:
                notes.append(f"no method is named, {DEFAULT_METHOD} is used")
            scatter = inventory.stiffness_scatter, inventory.damping_scatter, inventory.seed
            same = (
                analysis.method or DEFAULT_METHOD,
                analysis.collapse_drift or _COLLAPSE_DRIFT,
                bool(analysis.p_delta),
            )
            rules = Rules(inventory.rules, *scatter, *same)
            assert inputs.rows is not None
            return RowBuildings(inputs.rows, rules)
    if len({model.output_units for model in inputs.models}) > 1:
        notes.append(
            "the models want results in different units: they are written in SI; --output-units "
            "names others"
        )
    # Of a sweep the variations of a model are buildings of their own.
    named = Counter((model.source, model.label) for model in inputs.models)
    again = [source for (source, _), count in named.items() if count > 1]
    if again:
        notes.append(
            "named more than once, and run as often: "
            f"{first_few(list(dict.fromkeys(again)), _MOST_NAMES)}"
        )
    # Models may bring methods of their own, unless the campaign names one for all.
    subjects = []
    for model in inputs.models:
        method = analysis.method or model.analysis.method
        if method is None:
            method = DEFAULT_METHOD
            notes.append(f"{model.source}: names no method, {DEFAULT_METHOD} is used")
        subjects.append(Subject(model, method))
    return given_buildings(subjects)
