"""Fragility functions of the types of buildings of a campaign, one for each damage state, of its store.

A run under which a building falls exceeds all states. The dispersion of the thresholds is part of beta: stripes count
probabilities of exceedance, a cloud adds it to the scatter about its line. Runs under one ground motion err alike, so
that the errors of a fit are those of leaving out the motions one by one, in groups where there are many (delete-a-group
jackknife, Kott 2001).
"""

from __future__ import annotations

import math
from array import array
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from tdint.arrays import Array
from tdint.campaign.fragility.fit_table import MEASURES, FragilityRequest, FragilityResult, levels_of
from tdint.campaign.fragility.fits import CLOUD, IDA, STRIPES, Fragility, fit_cloud, fit_stripes
from tdint.campaign.fragility.run_damage import BuildingDamage, building_damages, exceedance
from tdint.campaign.profiles import motion_numbers
from tdint.campaign.store.store import Store, check_chunks, open_existing
from tdint.errors import AnalysisError, UsageError
from tdint.model.damage_states import FALLEN, DamageStates
from tdint.written_numbers import how_many

Fit = Callable[[NDArray[np.bool_]], list[Fragility | AnalysisError]]

_GROUPS = 30  # of motions, at the most
_LEAST_STRIPE = 3  # motions a level has at the least
_SAME_PERIOD = 1e-6


@dataclass(frozen=True)
class TypeRuns:
    """The runs of a type that have a result, all arrays of shape (runs,).

    Attributes
    ----------
    states : DamageStates
        Of the type.
    im, demand : ndarray
        Intensity, m/s^2, and what the states are told by, SI units; of a fall what was reached.
    fallen : ndarray of bool
        Whether the building fell.
    motion : ndarray of int
        The ground motion.
    failed : int
        Runs without a result.
    name : str
        Of the intensity measure.
    """

    states: DamageStates
    im: Array
    demand: Array
    fallen: NDArray[np.bool_]
    motion: NDArray[np.intp]
    failed: int
    name: str


def fit_types(folder: Path, request: FragilityRequest) -> FragilityResult:
    """Fit a function for each type of buildings of a campaign and each of its damage states.

    Raises
    ------
    UsageError
        The folder holds no campaign, or one that says nothing of damage; a fit or a threshold that is not for it.
    OutputError
        The store cannot be read.
    """
    if request.thresholds:
        raise UsageError("functions by type are of the damage states of the campaign: leave --threshold out")
    if request.fit == IDA:
        raise UsageError("functions by type are fitted to runs: --fit stripes or cloud")
    with open_existing(folder) as store:
        check_chunks(store)
        found = type_runs(store, request.measure or "sa_t1")
    if not found:
        raise UsageError(f"{folder}: this campaign says nothing of damage; add `damage` to its file and call it again")
    fitted = [
        AnalysisError(f"{name}, {state}: {one}")
        if isinstance(one, AnalysisError)
        else replace(one, type=name, state=state, beta_model=request.beta_model)
        for name, runs in found.items()
        for state, one in zip(runs.states.states, _fitted(runs, request), strict=True)
    ]
    lost = sum(runs.failed for runs in found.values())
    warnings = (f"{folder}: {how_many(lost, 'run')} without a result left out",) * (lost > 0)
    return FragilityResult.of(fitted, *warnings)


def type_runs(store: Store, measure: str) -> dict[str, TypeRuns]:
    """The runs of each type, by its name; the intensity is `sa_t1` or `pga`. One building is held at a time."""
    motions = motion_numbers(store.records())
    gathered: dict[str, _Gathered] = {}
    for of in building_damages(store):
        gathered.setdefault(of.type, _Gathered(of.states)).add(of, measure, motions)
    return {name: gathered[name].runs(measure) for name in sorted(gathered)}


@dataclass
class _Gathered:
    """The runs of a type, as they come: numbers one after the other."""

    states: DamageStates
    failed: int = 0
    periods: tuple[float, float] = (math.inf, 0.0)
    im: array[float] = field(default_factory=lambda: array("d"))
    demand: array[float] = field(default_factory=lambda: array("d"))
    fallen: array[int] = field(default_factory=lambda: array("b"))
    motion: array[int] = field(default_factory=lambda: array("q"))

    def add(self, of: BuildingDamage, measure: str, motions: Mapping[int, int]) -> None:
        """Take the runs of a building."""
        im = of.pga if measure == "pga" else of.sa
        taken = of.known & (im > 0.0)
        fallen = np.isin(of.status, FALLEN).astype(np.int8)
        motion = np.array([motions[record] for record, _, _ in of.keys], np.int64)
        for kept, values in ((self.im, im), (self.demand, of.demand), (self.fallen, fallen), (self.motion, motion)):
            kept.frombytes(values[taken].tobytes())
        self.failed += int(np.sum(~of.known))
        self.periods = min(self.periods[0], of.period), max(self.periods[1], of.period)

    def runs(self, measure: str) -> TypeRuns:
        """All of them as arrays."""
        first, last = self.periods
        common = measure != "pga" and last - first <= _SAME_PERIOD * first
        return TypeRuns(
            self.states,
            np.frombuffer(self.im, np.float64),
            np.frombuffer(self.demand, np.float64),
            np.frombuffer(self.fallen, np.int8).astype(bool),
            np.frombuffer(self.motion, np.int64),
            self.failed,
            f"sa({first:.6g})" if common else MEASURES[measure],
        )


def _fitted(runs: TypeRuns, request: FragilityRequest) -> list[Fragility | AnalysisError]:
    """The function of each state, or why there is none."""
    if not runs.im.size:
        return [AnalysisError("no run has a result") for _ in runs.states.states]
    level = levels_of(runs.im)
    motions = np.bincount(np.unique(np.column_stack([level, runs.motion]), axis=0)[:, 0])  # of each level
    stripes = motions.size > 1 and int(motions.min()) >= _LEAST_STRIPE
    if request.fit == STRIPES and not stripes:
        raise UsageError("the runs do not stand at common levels of intensity; use --fit cloud, or another --im")
    chosen = request.fit or (STRIPES if stripes else CLOUD)

    def fit(taken: NDArray[np.bool_]) -> list[Fragility | AnalysisError]:
        return _stripes(runs, level, taken) if chosen == STRIPES else _cloud(runs, request, taken)

    functions = fit(np.ones(runs.im.size, bool))
    covariances = _jackknife(runs, fit)
    return [
        one
        if isinstance(one, AnalysisError)
        else replace(
            one.named(median, runs.name, "m/s^2"), covariance=covariance, failed=runs.failed, points=one.points
        )
        for one, median, covariance in zip(functions, runs.states.medians, covariances, strict=True)
    ]


def _stripes(runs: TypeRuns, level: NDArray[np.intp], taken: NDArray[np.bool_]) -> list[Fragility | AnalysisError]:
    """Of probabilities of exceedance at levels."""
    over = np.where(runs.fallen[:, np.newaxis], 1.0, exceedance(runs.states, runs.demand))[taken]
    place = np.unique(level[taken], return_inverse=True)[1]
    total = np.bincount(place).astype(float)
    im = np.exp(np.bincount(place, np.log(runs.im[taken])) / total)
    return [_tried(partial(fit_stripes, im, np.minimum(np.bincount(place, one), total), total)) for one in over.T]


def _cloud(runs: TypeRuns, request: FragilityRequest, taken: NDArray[np.bool_]) -> list[Fragility | AnalysisError]:
    """Of a line through the demands, those of falls known only to be above what was reached."""
    low, high = request.edp_range
    kept = taken & (runs.demand >= low) & (runs.demand > 0.0)
    censored = runs.fallen | (runs.demand >= high)
    try:
        found = fit_cloud(runs.im[kept], np.minimum(runs.demand, high)[kept], runs.states.medians, censored[kept])
    except AnalysisError as error:
        return [error for _ in runs.states.states]
    return [
        replace(one, beta=math.hypot(one.beta, runs.states.dispersion / one.cloud.slope)) if one.cloud else one
        for one in found
    ]


def _tried(fit: Callable[[], Fragility]) -> Fragility | AnalysisError:
    try:
        return fit()
    except AnalysisError as error:
        return error


def _jackknife(runs: TypeRuns, fit: Fit) -> list[Array]:
    """The covariance of ln theta and beta of each state, shape (2, 2): by leaving out groups of motions; nan where
    less than three of them leave a fit."""
    motions = np.unique(runs.motion)
    group = (np.searchsorted(motions, runs.motion) * min(_GROUPS, motions.size)) // motions.size
    left: list[list[tuple[float, float]]] = [[] for _ in runs.states.states]
    for one in np.unique(group) if motions.size > 2 else ():
        for place, found in enumerate(fit(group != one)):
            if isinstance(found, Fragility):
                left[place].append((math.log(found.theta), found.beta))
    return [
        (len(values) - 1) * np.cov(np.array(values).T, bias=True) if len(values) > 2 else np.full((2, 2), math.nan)
        for values in left
    ]
