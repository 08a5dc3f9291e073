"""How much the parameters of a building move its peaks: one at a time, or by the ranks of a sampled
sweep."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np

from tdint.analysis.given import AnyModel, AnyRecord, model_of, record_of
from tdint.analysis.run.demands import RUN
from tdint.arrays import Array
from tdint.campaign.batch import RunSettings
from tdint.campaign.carry_out import carry_out, threads
from tdint.campaign.definition import AnalysisWishes, CampaignFile, ModelFiles, RecordFiles
from tdint.campaign.inputs import Inputs
from tdint.campaign.motions import FoundMotions, Scales
from tdint.campaign.plan import Plan, make_plan
from tdint.campaign.store import Store, open_store
from tdint.errors import UsageError
from tdint.ground_motion.choice import RecordChoice
from tdint.ground_motion.reading.suites import suite_motions
from tdint.methods.catalogue import parse
from tdint.model.definition import Model
from tdint.system import processors
from tdint.tabular import Progress, ResultList, told_progress
from tdint.units import Quantity

_LOOKED_AT = (
    "peak_drift_ratio",
    "peak_absolute_acceleration",
    "residual_drift_ratio",
    "peak_roof_displacement",
    "peak_base_shear",
)
PEAKS = tuple(one for one in RUN if one.name in _LOOKED_AT)
"""The peaks that are looked at."""


@dataclass(frozen=True)
class ParameterEffect:
    """What one parameter does to one peak, the others as they are.

    Attributes
    ----------
    building, parameter : str
        The model's name, and the parameter's.
    quantity : Quantity
        The peak; its values are medians over the motions, in SI units.
    low, high : float
        Values of the parameter.
    at_low, as_it_is, at_high : float
        The peak; nan where fewer than half of the runs have one.
    """

    building: str
    parameter: str
    quantity: Quantity
    low: float
    high: float
    at_low: float
    as_it_is: float
    at_high: float

    def __reduce__(self) -> tuple[Any, ...]:
        values = {field.name: getattr(self, field.name) for field in fields(self)}
        return _parameter_effect, ({**values, "quantity": self.quantity.name},)

    @property
    def effect(self) -> float:
        """What lies between the peaks at both ends, over that of the building as it is."""
        return abs(self.at_high - self.at_low) / abs(self.as_it_is) if self.as_it_is else math.nan


def _parameter_effect(values: dict[str, Any]) -> ParameterEffect:
    """One that has travelled: a quantity is found again by its name."""
    (quantity,) = (peak for peak in PEAKS if peak.name == values["quantity"])
    return ParameterEffect(**{**values, "quantity": quantity})


@dataclass(frozen=True)
class RankCorrelation:
    """How a peak goes with a parameter over the draws of a sweep.

    Attributes
    ----------
    building : str
        What the draws are of.
    scale : float
        Factor on the motions.
    coefficient : float
        Spearman's rank correlation of the parameter and the peak's median over the motions; nan
        where one of them does not vary.
    draws : int
        How many there are with a peak.
    """

    building: str
    scale: float
    parameter: str
    quantity: Quantity
    coefficient: float
    draws: int


def one_at_a_time(model: Model, ranges: Mapping[str, tuple[float, float]]) -> tuple[Model, ...]:
    """The building as it is, then with each parameter at its low and at its high value.

    Parameters
    ----------
    model : Model
        The building.
    ranges : mapping of str to (float, float)
        Low and high values of parameters, by the names of `Model.replace`.

    Raises
    ------
    UsageError
        As `Model.replace`.
    """
    ends = [(name, value) for name, both in ranges.items() for value in both]
    return (
        model,
        *(
            replace(model.replace(**{name: value}), label=f"{name}={value:g}")
            for name, value in ends
        ),
    )


def sensitivity(
    model: AnyModel,
    records: AnyRecord | Sequence[AnyRecord],
    ranges: Mapping[str, tuple[float, float]],
    *,
    method: str | None = None,
    dt: float | None = None,
    jobs: int | None = None,
    progress: bool | Progress = False,
) -> ResultList[ParameterEffect]:
    """How much each parameter of a building moves its peaks under records, one at a time.

    Parameters
    ----------
    model : Model, str, Path or mapping
        What `run` takes.
    records : one or a sequence
        Records, paths or traces.
    ranges : mapping of str to (float, float)
        As of `one_at_a_time`: `{"damping": (0.02, 0.05), "stiffness_factor": (0.8, 1.2)}`.
    method, dt : optional
        In place of what the model says; s.
    jobs : int, optional
        Threads; one for each processor by default.
    progress : bool or callable
        A bar on a terminal or in a notebook, by tqdm, or what is told how much is done, of how
        much.

    Returns
    -------
    ResultList of ParameterEffect
        Of each peak the largest effect first.

    Raises
    ------
    ModelError, RecordError
        The model or a record is none.
    UsageError
        An unknown parameter or method, a value out of range, a step that does not fit.
    """
    building = model_of(model)
    given = records if isinstance(records, list | tuple) else [records]
    motions = FoundMotions(suite_motions([record_of(motion) for motion in given]))
    plan = plan_of(building, ranges, motions, method=method, dt=dt)
    with open_store(None, plan)[0] as store:
        with told_progress(progress, sum(map(plan.size, range(plan.chunks))), "run") as told:
            carry_out(
                plan,
                store,
                threads(jobs or processors()),
                tell=lambda now: told(now.done, now.runs),
            )
        return ResultList(parameter_effects(store, building.name, ranges))


def plan_of(
    model: Model,
    ranges: Mapping[str, tuple[float, float]],
    motions: FoundMotions,
    *,
    method: str | None,
    dt: float | None,
) -> Plan:
    """The runs of the buildings that `one_at_a_time` gives under some motions."""
    inputs = Inputs(one_at_a_time(model, ranges), motions=motions)
    files, scales = (ModelFiles((model.source,)), RecordFiles((), RecordChoice())), Scales((1.0,))
    wishes = AnalysisWishes(method and parse(method).label)
    return make_plan(
        CampaignFile(model.name, model.source, *files, scales, wishes, RunSettings(dt)), inputs
    )


def parameter_effects(
    store: Store, name: str, ranges: Mapping[str, tuple[float, float]]
) -> list[ParameterEffect]:
    """Return the effects of the parameters on the peaks, from the runs of the buildings that
    `one_at_a_time` gives; for each peak the largest effect first."""
    result: list[ParameterEffect] = []
    medians = {number: values for (number, _), values in _medians(store, by_scale=False).items()}
    for place, quantity in enumerate(PEAKS):
        of_peak = []
        for i, (parameter, (low, high)) in enumerate(ranges.items()):
            # The order in which `one_at_a_time` makes them: as it is, then low and high of each.
            at_low, as_it_is, at_high = (
                float(medians[number][place]) for number in (2 * i + 1, 0, 2 * i + 2)
            )
            of_peak.append(
                ParameterEffect(name, parameter, quantity, low, high, at_low, as_it_is, at_high)
            )
        result += sorted(
            of_peak,
            key=lambda effect: -effect.effect if effect.effect == effect.effect else math.inf,
        )
    return result


def rank_correlations(store: Store) -> list[RankCorrelation]:
    """Rank correlations of what a sweep varied with the peaks, at each scale.

    Raises
    ------
    UsageError
        Nothing was varied.
    """
    from scipy.stats import spearmanr

    varied = store.varied()
    if not varied:
        raise UsageError("the campaign has no sweep: add `vary` to its file")
    # Variations carry their building's name before the colon: they belong together.
    names = {number: name.partition(": ")[0] for number, (name, _) in store.buildings().items()}
    groups: dict[tuple[str, float], list[tuple[int, Array]]] = {}
    for (number, scale), values in _medians(store, by_scale=True).items():
        groups.setdefault((names[number], scale), []).append((number, values))
    correlations = []
    for (building, scale), members in groups.items():
        for parameter in dict.fromkeys(name for number, _ in members for name in varied[number]):
            x = np.array([varied[number].get(parameter, math.nan) for number, _ in members])
            for place, quantity in enumerate(PEAKS):
                y = np.array([values[place] for _, values in members])
                # A draw without a peak, or without this parameter, has no rank.
                there = np.isfinite(x) & np.isfinite(y)
                both = x[there], y[there]
                # Ranks of equal values correlate with nothing.
                moving = all(np.unique(ranks).size > 1 for ranks in both)
                coefficient = float(spearmanr(*both)[0]) if moving else math.nan
                correlations.append(
                    RankCorrelation(
                        building, scale, parameter, quantity, coefficient, int(there.sum())
                    )
                )
    return correlations


def _medians(store: Store, *, by_scale: bool) -> dict[tuple[int, float], Array]:
    """The medians of `PEAKS` over the motions by building, and by scale if that is asked for."""
    runs: dict[tuple[int, float], list[list[float | None]]] = {}
    columns = ", ".join(peak.column for peak in PEAKS)
    for number, scale, *peaks in store.connection.execute(
        f"SELECT building, scale, {columns} FROM run_rows"
    ):
        runs.setdefault((number, scale if by_scale else 0.0), []).append(peaks)
    medians = {}
    for key, rows in runs.items():
        # A run without a value, as a collapse is, counts as larger than any peak: where one in two
        # has none, nan.
        ordered = np.sort(np.array(rows, dtype=np.float64), axis=0)
        middle = (len(rows) - 1) / 2.0
        medians[key] = np.asarray(0.5 * (ordered[math.floor(middle)] + ordered[math.ceil(middle)]))
    return medians
