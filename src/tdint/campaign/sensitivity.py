"""Sensitivity of the peaks of a building to its parameters: one at a time, or by rank correlation
in a sampled sweep."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np

from tdint.analysis.arguments import AnyModel, AnyRecord, model_of, record_of
from tdint.analysis.run.demands import RUN
from tdint.arrays import Array
from tdint.campaign.batch import RunSettings
from tdint.campaign.definition import AnalysisWishes, CampaignFile, ModelFiles, RecordFiles
from tdint.campaign.execute import execute_plan, threads
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
from tdint.tabular import Progress, ResultList, progress_reporter
from tdint.units import Quantity

_PEAK_NAMES = (
    "peak_drift_ratio",
    "peak_absolute_acceleration",
    "residual_drift_ratio",
    "peak_roof_displacement",
    "peak_base_shear",
)
PEAKS = tuple(quantity for quantity in RUN if quantity.name in _PEAK_NAMES)
"""Peaks that are evaluated."""


@dataclass(frozen=True)
class ParameterEffect:
    """Effect of one parameter on one peak; the other parameters are unchanged.

    Attributes
    ----------
    building, parameter : str
        Names of the model and of the parameter.
    quantity : Quantity
        Peak; its values are medians over the motions, in SI units.
    low, high : float
        Values of the parameter.
    at_low, as_it_is, at_high : float
        Peak for the low value, for the unchanged building, and for the high value; NaN if fewer
        than half of the runs have a value.
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
        # The quantity contains functions, which cannot be pickled. Its name is pickled instead.
        values = {field.name: getattr(self, field.name) for field in fields(self)}
        return _parameter_effect, ({**values, "quantity": self.quantity.name},)

    @property
    def effect(self) -> float:
        """Difference of the peaks for the low and high values, divided by the peak of the unchanged
        building."""
        return abs(self.at_high - self.at_low) / abs(self.as_it_is) if self.as_it_is else math.nan


def _parameter_effect(values: dict[str, Any]) -> ParameterEffect:
    """Return an unpickled effect; the quantity is found by name."""
    (quantity,) = (peak for peak in PEAKS if peak.name == values["quantity"])
    return ParameterEffect(**{**values, "quantity": quantity})


@dataclass(frozen=True)
class RankCorrelation:
    """Rank correlation of a peak with a parameter over the samples of a sweep.

    Attributes
    ----------
    building : str
        Name of the building.
    scale : float
        Scale factor of the motions.
    parameter : str
        Name of the parameter.
    quantity : Quantity
        Peak.
    coefficient : float
        Spearman's rank correlation of the parameter and the median of the peak over the motions;
        NaN if one of them does not vary.
    draws : int
        Number of samples with a peak.
    """

    building: str
    scale: float
    parameter: str
    quantity: Quantity
    coefficient: float
    draws: int


def one_at_a_time(model: Model, ranges: Mapping[str, tuple[float, float]]) -> tuple[Model, ...]:
    """Return the unchanged building, then the building with the low and the high value of each
    parameter.

    Parameters
    ----------
    model : Model
        The building.
    ranges : mapping of str to (float, float)
        Low and high values of parameters, by the names of `Model.replace`.

    Raises
    ------
    UsageError
        As for `Model.replace`.
    """
    changes = [(name, value) for name, low_high in ranges.items() for value in low_high]
    return (
        model,
        *(
            replace(model.replace(**{name: value}), label=f"{name}={value:g}")
            for name, value in changes
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
    """Compute the effect of each parameter of a building on its peaks under records, one parameter
    at a time.

    Parameters
    ----------
    model : Model, str, Path or mapping
        Model as for `run`.
    records : one or a sequence
        Records, paths or traces.
    ranges : mapping of str to (float, float)
        As for `one_at_a_time`: `{"damping": (0.02, 0.05), "stiffness_factor": (0.8, 1.2)}`.
    method : str, optional
        Method; by default the method of the model.
    dt : float, optional
        Time step, s; by default the value of the model.
    jobs : int, optional
        Number of threads; the default is the number of processors.
    progress : bool or callable
        True for a progress bar by tqdm on a terminal or in a notebook, or a function that is called
        with the number of completed runs and of all runs.

    Returns
    -------
    ResultList of ParameterEffect
        Effects on each peak, in descending order.

    Raises
    ------
    ModelError, RecordError
        The model or a record is invalid.
    UsageError
        A parameter or method is unknown, a value is out of range, or a time step does not fit.
    """
    building = model_of(model)
    record_list = records if isinstance(records, list | tuple) else [records]
    motions = FoundMotions(suite_motions([record_of(motion) for motion in record_list]))
    plan = plan_of(building, ranges, motions, method=method, dt=dt)
    with open_store(None, plan)[0] as store:
        with progress_reporter(
            progress, sum(map(plan.size, range(plan.chunks))), "run"
        ) as report_progress:
            execute_plan(
                plan,
                store,
                threads(jobs or processors()),
                on_chunk=lambda now: report_progress(now.done, now.runs),
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
    """Return the plan of the runs of the buildings of `one_at_a_time`.

    Parameters
    ----------
    model : Model
        The building.
    ranges : mapping of str to (float, float)
        Low and high values of parameters.
    motions : FoundMotions
        Ground motions.
    method : str or None
        Method; None: the method of the model.
    dt : float or None
        Time step, s; None: the value of the model.
    """
    inputs = Inputs(one_at_a_time(model, ranges), motions=motions)
    files, scales = (ModelFiles((model.source,)), RecordFiles((), RecordChoice())), Scales((1.0,))
    wishes = AnalysisWishes(method and parse(method).label)
    return make_plan(
        CampaignFile(model.name, model.source, *files, scales, wishes, RunSettings(dt)), inputs
    )


def parameter_effects(
    store: Store, name: str, ranges: Mapping[str, tuple[float, float]]
) -> list[ParameterEffect]:
    """Return the effects of the parameters on the peaks, from the runs of the buildings of
    `one_at_a_time`; for each peak in descending order."""
    result: list[ParameterEffect] = []
    medians = {number: values for (number, _), values in _medians(store, by_scale=False).items()}
    for index, quantity in enumerate(PEAKS):
        effects = []
        for i, (parameter, (low, high)) in enumerate(ranges.items()):
            # The order of `one_at_a_time`: unchanged, then low and high value of each parameter.
            at_low, as_it_is, at_high = (
                float(medians[number][index]) for number in (2 * i + 1, 0, 2 * i + 2)
            )
            effects.append(
                ParameterEffect(name, parameter, quantity, low, high, at_low, as_it_is, at_high)
            )
        result += sorted(
            effects,
            key=lambda effect: math.inf if math.isnan(effect.effect) else -effect.effect,
        )
    return result


def rank_correlations(store: Store) -> list[RankCorrelation]:
    """Return the rank correlations of the varied parameters of a sweep with the peaks, at each
    scale factor.

    Raises
    ------
    UsageError
        The campaign has no sweep.
    """
    from scipy.stats import spearmanr

    varied = store.varied()
    if not varied:
        raise UsageError("the campaign has no sweep: add `vary` to its file")
    # Group variations by the name of their building, which precedes the colon.
    names = {number: name.partition(": ")[0] for number, (name, _) in store.buildings().items()}
    groups: dict[tuple[str, float], list[tuple[int, Array]]] = {}
    for (number, scale), values in _medians(store, by_scale=True).items():
        groups.setdefault((names[number], scale), []).append((number, values))
    correlations = []
    for (building, scale), members in groups.items():
        for parameter in dict.fromkeys(name for number, _ in members for name in varied[number]):
            x = np.array([varied[number].get(parameter, math.nan) for number, _ in members])
            for index, quantity in enumerate(PEAKS):
                y = np.array([values[index] for _, values in members])
                # Exclude samples without a peak, or without this parameter.
                is_valid = np.isfinite(x) & np.isfinite(y)
                both = x[is_valid], y[is_valid]
                # The rank correlation with a constant is not defined.
                is_varying = all(np.unique(ranks).size > 1 for ranks in both)
                coefficient = float(spearmanr(*both)[0]) if is_varying else math.nan
                correlations.append(
                    RankCorrelation(
                        building, scale, parameter, quantity, coefficient, int(is_valid.sum())
                    )
                )
    return correlations


def _medians(store: Store, *, by_scale: bool) -> dict[tuple[int, float], Array]:
    """Return the medians of `PEAKS` over the motions by building, and by scale factor if
    requested."""
    runs: dict[tuple[int, float], list[list[float | None]]] = {}
    columns = ", ".join(peak.column for peak in PEAKS)
    for number, scale, *peaks in store.connection.execute(
        f"SELECT building, scale, {columns} FROM run_rows"
    ):
        runs.setdefault((number, scale if by_scale else 0.0), []).append(peaks)
    medians = {}
    for key, rows in runs.items():
        # A run without a value, such as a collapse, counts as larger than any peak. The median is
        # NaN if at least half of the runs have no value.
        ordered = np.sort(np.array(rows, dtype=np.float64), axis=0)
        middle = (len(rows) - 1) / 2.0
        medians[key] = np.asarray(0.5 * (ordered[math.floor(middle)] + ordered[math.ceil(middle)]))
    return medians
