"""Fragility functions of a campaign: one function for each building type (or building) and damage
state.

A run that ends with a collapse exceeds all states, regardless of the drift where the run was
stopped. The dispersion of the thresholds is part of beta: stripes count probabilities of
exceedance, and a cloud adds its variance to the variance about the line. Equal buildings count with
their number.
"""

from __future__ import annotations

import math
from array import array
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from tdint.arrays import Array
from tdint.errors import AnalysisError, UsageError
from tdint.model.damage_states import DamageStates
from tdint.number_parsing import abbreviate, pluralize
from tdint.studies.fragility.building_damage import (
    BuildingDamage,
    building_damages,
    damage_by_motion,
)
from tdint.studies.fragility.fit_table import (
    FragilityRequest,
    FragilityResult,
    SuiteRuns,
    fit_states,
    notes_of_fits,
)
from tdint.studies.fragility.fragility_function import IDA, Fragility
from tdint.studies.fragility.measures import (
    LEVEL,
    RunIntensities,
    RunMeasure,
    measure_of_campaign,
)
from tdint.studies.motions.outcomes import first_runs, outcomes_of, with_outcomes
from tdint.studies.motions.pairs import PairRule
from tdint.studies.store.opening import check_chunks, open_existing

_SAME_PERIOD = 1e-6  # relative difference; tables are written with at least six digits

TYPE, BUILDING = "type", "building"
BY = (TYPE, BUILDING)
"""Groups of runs for which functions of a campaign can be fitted."""


def fit_types(folder: Path, request: FragilityRequest, by: str = TYPE) -> FragilityResult:
    """Fit a function for each building type (or building) and damage state of a campaign.

    For functions by building, the states can be thresholds of the maximum drift ratio.

    Raises
    ------
    UsageError
        The directory contains no campaign, or the campaign has no damage states. The fit or the
        thresholds cannot be used with a campaign. The runs have no such intensity measure.
    OutputError
        The store cannot be read.
    """
    if request.fit == IDA:
        raise UsageError(
            f"--fit ida cannot be used with functions by {by}, which are fitted to runs; use --fit "
            "stripes or --fit cloud"
        )
    requested_states = _requested_states(request)
    with open_existing(folder) as store:
        check_chunks(store)
        # The damage states of a campaign depend on the building type. A requested threshold applies
        # to each building, or to all variations of a building.
        has_draws = by == TYPE and bool(store.varied())
        if request.thresholds and by == TYPE and not has_draws:
            raise UsageError(
                "--threshold cannot be used with functions by type, which use the damage states of "
                "the campaign; omit --threshold"
            )
        if not (store.damage() or requested_states):
            remedy = "add `damage` to its file and run it again"
            more = ", or specify --threshold" if by == BUILDING or has_draws else ""
            raise UsageError(f"{folder}: this campaign has no damage states; {remedy}{more}")
        measure = measure_of_campaign(store, request.measure)
        intensities = RunIntensities(store, folder, measure)
        rule = store.pair_rule()
        if request.pair_demand:
            rule = replace(rule, demand=request.pair_demand)
        # The runs of the components of a recording are correlated, so they count as a single ground
        # motion. In a campaign with ground motion fields, the same applies to the runs of an event;
        # the store numbers the events in its column of samples, and no mapping is needed.
        motion_of_record = {} if store.events() else rule.recordings
        collectors: dict[str, _RunCollector] = {}
        for damage in building_damages(store, requested_states):
            name = damage.type if by == TYPE else damage.building
            collector = collectors.setdefault(name, _RunCollector(damage.states, has_draws))
            collector.add(damage, intensities.of(damage), motion_of_record, rule)
    fits: list[Fragility | AnalysisError] = []
    for name in sorted(collectors):
        states = collectors[name].states
        runs = collectors[name].runs(measure, intensities.unit)
        medians = dict(zip(states.states, states.medians, strict=True))
        state_fits = fit_states(runs, medians, request, states.dispersion)
        for state, fit in zip(medians, state_fits, strict=True):
            if isinstance(fit, AnalysisError):
                fits.append(AnalysisError(f"{name}, {fit}"))
                continue
            fits.append(
                replace(
                    fit,
                    type=name,
                    state=state,
                    modeling_dispersion=request.modeling_dispersion,
                    pair_demand=rule.demand_if_pairs,
                )
            )
    failed = sum(collector.failed for collector in collectors.values())
    warnings = [f"{folder}: omitted {pluralize(failed, 'run')} without a result"] if failed else []
    if has_draws and request.modeling_dispersion:
        warnings.append(
            f"{folder}: beta contains the dispersion between the draws of `vary`; the modeling "
            "dispersion must not contain it again"
        )
    result = FragilityResult.of(fits, *warnings)
    notes = [*filter(None, [intensities.note]), *notes_of_fits(result, request, rule)]
    unknown = [f"{f.type}, {f.state}" for f in result.functions if has_draws and not f.draws_text]
    if unknown:
        notes.append(
            f"the dispersions within and between draws are unknown ({abbreviate(unknown, 4)}), "
            "because a draw alone determines no function; add intensity levels or motions"
        )
    return replace(result, notes=tuple(notes))


def _requested_states(request: FragilityRequest) -> DamageStates | None:
    """Return damage states with the requested thresholds of the maximum drift ratio as medians;
    None if no threshold is requested. The default names of the states are ds1, ds2, and so on.
    UsageError is raised if the number of names differs from the number of thresholds.
    """
    medians = tuple(sorted(request.thresholds))
    if not medians:
        return None
    names = request.states or tuple(f"ds{number}" for number in range(1, len(medians) + 1))
    if len(names) != len(medians):
        raise UsageError(
            f"{pluralize(len(medians), 'threshold')}: --states requires the same number of names, "
            f"got {len(names)}"
        )
    return DamageStates("drift_ratio", names, medians)


@dataclass
class _RunCollector:
    """Runs of a group, collected building by building in contiguous arrays: intensity, demand
    (infinity: collapse), ground motion and number of equal buildings.

    Attributes
    ----------
    has_draws : bool
        True if the buildings are variations, which differ by their draws.
    periods : tuple of two floats
        Minimum and maximum first period of the buildings, s.
    """

    states: DamageStates
    has_draws: bool = False
    failed: int = 0
    periods: tuple[float, float] = (math.inf, 0.0)
    im: array[float] = field(default_factory=lambda: array("d"))
    demand: array[float] = field(default_factory=lambda: array("d"))
    motion: array[int] = field(default_factory=lambda: array("q"))
    weight: array[float] = field(default_factory=lambda: array("d"))
    draw: array[int] = field(default_factory=lambda: array("q"))
    _draws: dict[str, int] = field(default_factory=dict)

    def add(
        self,
        building: BuildingDamage,
        im: Array,
        motion_of_record: Mapping[int, int],
        rule: PairRule,
    ) -> None:
        """Add the runs of a building, or its ground motions if components of pairs are combined.

        `motion_of_record` is empty for ground motion fields, where runs with the same sample
        number (of the event) count as a single ground motion.
        """
        damage = damage_by_motion(building, rule.demand)
        # If the components of pairs were combined, `damage` has an entry per group of runs instead
        # of per run. Both runs of a group have the same intensity; use the first.
        if damage is not building:
            im = im[first_runs(building.motion)]
        is_used = damage.known & (im > 0.0) & (damage.equal > 0.0)
        motions = [
            motion_of_record[record] if motion_of_record else sample
            for record, _, sample in damage.keys
        ]
        # The name of a variation ends with its label.
        draw = self._draws.setdefault(building.building.rpartition(": ")[2], len(self._draws))
        columns = (
            (self.im, im),
            (self.demand, with_outcomes(damage.demand, outcomes_of(damage.status))),
            (self.motion, np.array(motions, np.int64)),
            (self.weight, np.full(im.size, damage.equal)),
            (self.draw, np.full(im.size, draw)),
        )
        for column, values in columns:
            column.frombytes(values[is_used].tobytes())
        self.failed += int(np.sum(~damage.known))
        shortest, longest = self.periods
        self.periods = min(shortest, damage.period), max(longest, damage.period)

    def runs(self, measure: RunMeasure, unit: str) -> SuiteRuns:
        """Return all collected runs as arrays.

        `measure` is the intensity measure. Its name in the result contains the first period if all
        buildings have the same first period.
        """
        shortest, longest = self.periods
        is_same_period = 0.0 < longest < math.inf and longest - shortest <= _SAME_PERIOD * shortest
        return SuiteRuns(
            np.frombuffer(self.im, np.float64),
            np.frombuffer(self.demand, np.float64),
            np.frombuffer(self.motion, np.int64),
            np.frombuffer(self.weight, np.float64),
            (measure.label(shortest if is_same_period else None), unit),
            has_levels=measure.column == LEVEL,
            draw=np.frombuffer(self.draw, np.int64) if self.has_draws else None,
        )
