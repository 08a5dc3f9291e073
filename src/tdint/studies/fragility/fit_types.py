"""Fragility functions of a campaign: one function for each building type (or building) and damage
state.

A run that ends with a collapse exceeds all states. Its demand is known only to be above the
heaviest state, regardless of the drift at which the run was stopped. The dispersion of the
thresholds is part of beta: stripes count probabilities of exceedance, and a cloud uses each run
with several thresholds that have this dispersion.
"""

from __future__ import annotations

import math
from array import array
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tdint.arrays import Array
from tdint.errors import AnalysisError, UsageError
from tdint.model.damage_states import DamageStates
from tdint.model.status import FALLEN
from tdint.number_parsing import pluralize
from tdint.response.runs.damage import exceedance
from tdint.studies.fragility.building_damage import (
    BuildingDamage,
    building_damages,
    damage_by_motion,
    motion_of_runs,
)
from tdint.studies.fragility.fit_table import (
    MIN_RUNS_PER_LEVEL,
    NO_COMMON_LEVELS,
    FragilityRequest,
    FragilityResult,
)
from tdint.studies.fragility.fits import fit_cloud, fit_levels
from tdint.studies.fragility.fragility_function import CLOUD, IDA, STRIPES, Fragility, levels_of
from tdint.studies.fragility.measures import (
    RunIntensities,
    RunMeasure,
    measure_of_campaign,
    over_motions,
)
from tdint.studies.motions.outcomes import first_runs
from tdint.studies.motions.pairs import PairRule
from tdint.studies.store.opening import check_chunks, open_existing

_SAME_PERIOD = 1e-6  # relative difference; tables are written with at least six digits
# Three equally likely points with mean 0 and variance 1, which represent a normal distribution.
# With 20 points, losses differ by less than 1 %.
_THREE_POINTS = math.sqrt(1.5) * np.array([-1.0, 0.0, 1.0])


@dataclass(frozen=True)
class TypeRuns:
    """Runs with a result of a single group, the buildings of a type or a single building; all
    arrays have the shape (runs,).

    Attributes
    ----------
    im, demand : ndarray
        Intensity, and demand of the damage states, SI units. After a collapse, the demand is the
        median of the heaviest state.
    fallen : ndarray of bool
        True if the building collapsed.
    motion : ndarray of int
        Ground motion, or event of ground motion fields.
    weight : ndarray
        Number of equal buildings.
    failed : int
        Number of runs without a result.
    name, unit : str
        Name and unit of the intensity measure.
    """

    states: DamageStates
    im: Array
    demand: Array
    fallen: NDArray[np.bool_]
    motion: NDArray[np.intp]
    weight: Array
    failed: int
    name: str
    unit: str


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
    # The damage states of a campaign depend on the building type. A requested threshold would apply
    # to all types, so it is allowed only for functions by building.
    if request.thresholds and by == TYPE:
        raise UsageError(
            "--threshold cannot be used with functions by type, which use the damage states of the "
            "campaign; omit --threshold"
        )
    if request.fit == IDA:
        raise UsageError(
            f"--fit ida cannot be used with functions by {by}, which are fitted to runs; use --fit "
            "stripes or --fit cloud"
        )
    requested_states = _requested_states(request)
    with open_existing(folder) as store:
        check_chunks(store)
        if not (store.damage() or requested_states):
            remedy = "add `damage` to its file and run it again"
            more = ", or specify --threshold" if by == BUILDING else ""
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
            collector = collectors.setdefault(name, _RunCollector(damage.states))
            collector.add(damage, intensities.of(damage), motion_of_record, rule)
    # The error of an impossible fit takes the place of the function.
    fits: list[Fragility | AnalysisError] = []
    for name in sorted(collectors):
        runs = collectors[name].runs(measure, intensities.unit)
        for state, fit in zip(runs.states.states, fit_states(runs, request), strict=True):
            if isinstance(fit, AnalysisError):
                fits.append(AnalysisError(f"{name}, {state}: {fit}"))
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
    warnings = (f"{folder}: omitted {pluralize(failed, 'run')} without a result",) if failed else ()
    notes: tuple[str, ...] = (intensities.note,) if intensities.note else ()
    if rule.pairs and not request.pair_demand:
        notes += (rule.note(),)
    return replace(FragilityResult.of(fits, *warnings), notes=notes)


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
    """Runs of a group, collected building by building in contiguous arrays.

    Attributes
    ----------
    periods : tuple of two floats
        Minimum and maximum first period of the buildings, s.
    im, demand, fallen, motion : array
        Intensity, demand, 1 for a collapse (otherwise 0), and ground motion of each run.
    """

    states: DamageStates
    failed: int = 0
    periods: tuple[float, float] = (math.inf, 0.0)
    im: array[float] = field(default_factory=lambda: array("d"))
    demand: array[float] = field(default_factory=lambda: array("d"))
    fallen: array[int] = field(default_factory=lambda: array("b"))
    motion: array[int] = field(default_factory=lambda: array("q"))
    weight: array[float] = field(default_factory=lambda: array("d"))

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
        damage = damage_by_motion(building, rule)
        # If the components of pairs were combined, `damage` has one entry per group of runs instead
        # of per run. Both runs of a group have the same intensity; use the first.
        if damage is not building:
            im = im[first_runs(motion_of_runs(building, rule))]
        is_used = damage.known & (im > 0.0) & (damage.equal > 0.0)
        fallen = np.isin(damage.status, FALLEN)
        motions = [
            motion_of_record[record] if motion_of_record else sample
            for record, _, sample in damage.keys
        ]
        # The median threshold of the heaviest state replaces it; the fit treats the demand of a
        # collapse only as a lower limit.
        demand = np.where(fallen, damage.states.medians[-1], damage.demand)
        columns = (
            (self.im, im),
            (self.demand, demand),
            (self.fallen, fallen.astype(np.int8)),
            (self.motion, np.array(motions, np.int64)),
            (self.weight, np.full(im.size, damage.equal)),
        )
        for column, values in columns:
            column.frombytes(values[is_used].tobytes())
        self.failed += int(np.sum(~damage.known))
        shortest, longest = self.periods
        self.periods = min(shortest, damage.period), max(longest, damage.period)

    def runs(self, measure: RunMeasure, unit: str) -> TypeRuns:
        """Return all collected runs as arrays.

        `measure` is the intensity measure. Its name in the result contains the first period if all
        buildings have the same first period.
        """
        shortest, longest = self.periods
        is_same_period = 0.0 < longest < math.inf and longest - shortest <= _SAME_PERIOD * shortest
        return TypeRuns(
            states=self.states,
            im=np.frombuffer(self.im, np.float64),
            demand=np.frombuffer(self.demand, np.float64),
            fallen=np.frombuffer(self.fallen, np.int8).astype(bool),
            motion=np.frombuffer(self.motion, np.int64),
            weight=np.frombuffer(self.weight, np.float64),
            failed=self.failed,
            name=measure.label(shortest if is_same_period else None),
            unit=unit,
        )


def fit_states(runs: TypeRuns, request: FragilityRequest) -> list[Fragility | AnalysisError]:
    """Fit a fragility function for each damage state of a group of runs.

    By default stripes are fitted if there are several intensity levels, each with enough ground
    motions, otherwise a cloud.

    Returns
    -------
    list of Fragility or AnalysisError
        Function of each state, or the error if its fit is impossible.

    Raises
    ------
    UsageError
        Stripes are requested, but there is a single level, or a level has fewer than three ground
        motions.
    """
    if not runs.im.size:
        reason = "no run has a result; execute the runs of these buildings first"
        return [AnalysisError(reason) for _ in runs.states.states]
    # Count the distinct ground motions at each level, for all buildings of the group together: the
    # distinct pairs of level and ground motion are counted by level.
    level = levels_of(runs.im)
    motions_at_level = np.bincount(np.unique(np.column_stack([level, runs.motion]), axis=0)[:, 0])
    has_stripes = motions_at_level.size > 1 and int(motions_at_level.min()) >= MIN_RUNS_PER_LEVEL
    if request.fit == STRIPES and not has_stripes:
        raise UsageError(NO_COMMON_LEVELS)
    selected_fit = request.fit or (STRIPES if has_stripes else CLOUD)
    # Probability that each run reaches or exceeds each state; it is 1 after a collapse.
    probabilities_of_runs = exceedance(runs.states, runs.demand)
    probability_columns = np.where(runs.fallen[:, np.newaxis], 1.0, probabilities_of_runs).T

    def fit(is_used: NDArray[np.bool_]) -> list[Fragility | AnalysisError]:
        """Fit each state to the runs that a mask selects, with errors in place of functions."""
        if selected_fit == CLOUD:
            return _type_cloud(runs, request, is_used)
        fits: list[Fragility | AnalysisError] = []
        # The number of exceedances at a level is the sum of the probabilities of its runs.
        for probabilities in probability_columns:
            try:
                fits.append(fit_levels(runs.im, level, probabilities, is_used, runs.weight))
            except AnalysisError as error:
                fits.append(error)
        return fits

    fits = over_motions(fit, np.ones(runs.im.size, bool), runs.motion)
    result: list[Fragility | AnalysisError] = []
    for state_fit, median, probabilities in zip(
        fits, runs.states.medians, probability_columns, strict=True
    ):
        if isinstance(state_fit, Fragility):
            named = replace(state_fit.named(median, runs.name, runs.unit), failed=runs.failed)
            state_fit = named.beside_counts(
                runs.im, probabilities, runs=runs.weight, motion=runs.motion
            )
        result.append(state_fit)
    return result


def _type_cloud(
    runs: TypeRuns, request: FragilityRequest, is_used: NDArray[np.bool_]
) -> list[Fragility | AnalysisError]:
    """Fit the functions of all damage states to a line through the logarithms of the demands over
    the intensities. If the line cannot be fitted, the result contains the same error for each
    state.

    The dispersion of the thresholds of the states is represented by three equally likely values:
    each run is used three times, with different thresholds. A collapse exceeds all three values.

    Collapses have a probability of their own (`fit_cloud`). Some demands are used only as limits
    (censored): demands at or above the upper limit of the range are lower limits. For the states of
    a campaign, demands above the heaviest state are also lower limits, and demands below the
    lightest state are upper limits. For requested thresholds these two rules do not apply: a
    function then does not depend on the other thresholds.

    The count `censored` of a function and the points of its figure refer to runs, and contain only
    collapses and demands at or above the range as censored.
    """
    # Omit demands of zero, which have no logarithm, and demands below the range, which are elastic.
    # A collapse exceeds every demand and is kept, also if the heaviest state is below the range.
    low, high = request.edp_range
    is_kept = is_used & (runs.fallen | ((runs.demand >= low) & (runs.demand > 0.0)))
    im, fallen = runs.im[is_kept], runs.fallen[is_kept]
    demand = np.minimum(runs.demand, high)[is_kept]
    lightest, heaviest = 0.0, math.inf
    if not request.thresholds:
        lightest, heaviest = runs.states.medians[0], runs.states.medians[-1]
    # `is_above_range` is the mask of the censored runs; it does not depend on the thresholds.
    is_above_range = ~fallen & (demand >= high)
    # Dividing a threshold by a factor is equivalent to multiplying the demand by this factor: each
    # demand is multiplied by three factors, and the thresholds remain constant. The shape of
    # `scattered` is (runs, 3). `is_above_states`, of the same shape, is the mask of the censored
    # values in the fit.
    threshold_factors = np.exp(runs.states.dispersion * _THREE_POINTS)
    scattered = threshold_factors * demand[:, np.newaxis]
    is_fallen = np.repeat(fallen, _THREE_POINTS.size)
    is_above_states = is_above_range[:, np.newaxis] | (scattered >= heaviest)
    repeated_im = np.repeat(im, _THREE_POINTS.size)
    limited_demand = np.minimum(scattered, heaviest).ravel()
    try:
        functions = fit_cloud(
            repeated_im,
            limited_demand,
            runs.states.medians,
            is_above_states.ravel() & ~is_fallen,
            collapsed=is_fallen,
            lower_threshold=lightest,
            values_per_demand=_THREE_POINTS.size,
        )
    except AnalysisError as error:
        return [error for _ in runs.states.states]
    # Counts and figures refer to the demands, not to the three values per demand.
    is_below_states = ~(is_above_range | fallen) & (demand < lightest)
    counts: dict[str, Any] = {"runs": im.size, "censored": int(np.sum(is_above_range | fallen))}
    points: dict[str, Any] = {
        "im": im,
        "edp": demand,
        "censored": is_above_range | fallen,
        "collapsed": int(np.sum(fallen)),
        "below": is_below_states,
    }
    return [
        replace(function, cloud=function.cloud and replace(function.cloud, **points), **counts)
        for function in functions
    ]
