"""Sensitivity of the peaks of a building to its parameters: effect of changing one parameter at a
time, or rank correlation of peaks and parameters in a sweep with random samples."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import chain

import numpy as np

from tdint.arrays import Array
from tdint.errors import UsageError
from tdint.fractiles import fractiles
from tdint.ground_motion.reading.suites import suite_motions
from tdint.methods.catalogue import parse
from tdint.model.definition import Model
from tdint.response.arguments import AnyModel, AnyRecord, model_of, record_of
from tdint.response.runs.run_values import RUN
from tdint.studies.campaign.assigned_motions import CampaignMotions
from tdint.studies.campaign.chunks import CampaignSettings
from tdint.studies.campaign.definition import AnalysisOverrides, CampaignFile
from tdint.studies.campaign.execute import execute_plan, threads
from tdint.studies.campaign.inputs import Inputs
from tdint.studies.campaign.plan import Plan, make_plan
from tdint.studies.campaign.story_profiles import SuiteLevel, SuiteRules
from tdint.studies.store import schema
from tdint.studies.store.opening import open_store
from tdint.studies.store.result_store import Store
from tdint.system import processors
from tdint.tabular import Progress, ResultList, progress_reporter
from tdint.units import OutputUnits, Quantity

_PEAK_NAMES = (
    "peak_drift_ratio",
    "peak_absolute_acceleration",
    "residual_drift_ratio",
    "peak_roof_displacement",
    "peak_base_shear",
)
PEAKS = tuple(replace(quantity, value=None) for quantity in RUN if quantity.name in _PEAK_NAMES)
"""Peaks that are evaluated. Their values are read from the store; without functions, they can be
pickled."""


@dataclass(frozen=True)
class ParameterEffect:
    """Effect of a single parameter on one peak; the other parameters are unchanged.

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

    @property
    def effect(self) -> float:
        """Absolute difference of the peaks for the low and high values, divided by the peak of the
        unchanged building; NaN if this peak is zero."""
        return abs(self.at_high - self.at_low) / abs(self.as_it_is) if self.as_it_is else math.nan

    def in_units(self, units: OutputUnits) -> ParameterEffect:
        """Return the effect with its peaks in other units, which `quantity.unit` states.

        Parameters
        ----------
        units : OutputUnits
            Units of the result.
        """
        unit, factor = units.unit(self.quantity.unit)
        if factor == 1.0:
            return self
        quantity = replace(self.quantity, unit=unit)
        peaks = (peak / factor for peak in (self.at_low, self.as_it_is, self.at_high))
        return ParameterEffect(self.building, self.parameter, quantity, self.low, self.high, *peaks)


@dataclass(frozen=True)
class RankCorrelation:
    """Rank correlation of a peak with a parameter over the samples of a sweep.

    Attributes
    ----------
    scale, level : float
        Intensity level, as in `tdint.studies.campaign.story_profiles.SuiteLevel`.
    coefficient : float
        Spearman's rank correlation of the parameter and the median of the peak over the motions;
        NaN if one of the two does not vary.
    draws : int
        Number of samples with a peak.
    """

    building: str
    scale: float
    level: float
    parameter: str
    quantity: Quantity
    coefficient: float
    draws: int


def one_at_a_time(model: Model, ranges: Mapping[str, tuple[float, float]]) -> tuple[Model, ...]:
    """Return the unchanged building, then the building with the low and the high value of each
    parameter.

    Parameters
    ----------
    ranges : mapping of str to (float, float)
        Low and high values of parameters, by the names of `Model.replace`.

    Returns
    -------
    tuple of Model
        The unchanged building (index 0); parameter i has the indices 2 i + 1 (low) and 2 i + 2
        (high).

    Raises
    ------
    UsageError
        A parameter is unknown, or a value is out of range.
    """
    models = [model]
    for name, (low, high) in ranges.items():
        for value in (low, high):
            models.append(replace(model.replace(**{name: value}), label=f"{name}={value:g}"))
    return tuple(models)


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
        Low and high values of parameters, by the names of `Model.replace`:
        `{"damping": (0.02, 0.05), "stiffness_factor": (0.8, 1.2)}`.
    method : str, optional
        Method; by default the method of the model.
    dt : float, optional
        Time step, s; by default the value of the model.
    jobs : int, optional
        Number of threads; the default is the number of processors.
    progress : bool or callable, default False
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
    motions = CampaignMotions(suite_motions([record_of(motion) for motion in record_list]))
    plan = plan_of(building, ranges, motions, method=method, dt=dt)
    with open_store(None, plan)[0] as store:
        with progress_reporter(progress, plan.runs, "run") as report_progress:
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
    motions: CampaignMotions,
    *,
    method: str | None,
    dt: float | None,
) -> Plan:
    """Return the plan of the runs of a sensitivity analysis: the unchanged building, and the
    building with the low and the high value of each parameter, under all motions.

    Parameters
    ----------
    method : str | None
        Method; None: the method of the model.
    dt : float | None
        Time step, s; None: the value of the model.

    Raises
    ------
    UsageError
        A parameter or the method is unknown, a value is out of range, or a time step does not fit a
        record.
    """
    campaign = CampaignFile(
        name=model.name,
        source=model.source,
        analysis=AnalysisOverrides(method and parse(method).label),
        settings=CampaignSettings(dt=dt),
    )
    return make_plan(campaign, Inputs(one_at_a_time(model, ranges), motions=motions))


def parameter_effects(
    store: Store, name: str, ranges: Mapping[str, tuple[float, float]]
) -> list[ParameterEffect]:
    """Return the effects of the parameters on the peaks. The peaks are in the order of `PEAKS`; the
    effects on each peak are in descending order.
    """
    result: list[ParameterEffect] = []
    # Medians of all peaks by the number of the building
    medians = {number: values for (number, _), (_, values) in _medians(store).items()}

    def sort_key(item: ParameterEffect) -> float:
        """Return a number that sorts effects in descending order, unknown effects last."""
        return math.inf if math.isnan(item.effect) else -item.effect

    for index, quantity in enumerate(PEAKS):
        effects = []
        for i, (parameter, (low, high)) in enumerate(ranges.items()):
            # Building 0 is unchanged. Buildings 2 i + 1 and 2 i + 2 have the low and the high value
            # of parameter i.
            at_low, as_it_is, at_high = (
                float(medians[number][index]) for number in (2 * i + 1, 0, 2 * i + 2)
            )
            effects.append(
                ParameterEffect(name, parameter, quantity, low, high, at_low, as_it_is, at_high)
            )
        result += sorted(effects, key=sort_key)
    return result


def rank_correlations(store: Store) -> list[RankCorrelation]:
    """Return Spearman's rank correlations of the parameters of a sweep with the median peaks, for
    each building and intensity level, over the variations of the building.

    A variation whose peak is a collapse or missing is omitted.

    Raises
    ------
    UsageError
        The campaign has no sweep.
    """
    from scipy.stats import spearmanr

    changes_of_building = store.varied()
    if not changes_of_building:
        raise UsageError("the campaign has no sweep: add `vary` to its file")
    # The name of a variation is the name of its building, a colon and a label.
    names = {number: name.rpartition(": ")[0] for number, (name, _) in store.buildings().items()}
    groups: dict[tuple[str, int], list[tuple[SuiteLevel, dict[str, float], Array]]] = {}
    for (number, rank), (level, medians) in _medians(store).items():
        group = groups.setdefault((names[number], rank), [])
        group.append((level, changes_of_building[number], medians))
    correlations = []
    for (building, _), variations in groups.items():
        levels, changes, medians_of_variations = zip(*variations, strict=True)
        for parameter in dict.fromkeys(chain.from_iterable(changes)):
            values = np.array([change.get(parameter, math.nan) for change in changes])
            for quantity, peaks in zip(PEAKS, np.array(medians_of_variations).T, strict=True):
                is_valid = np.isfinite(values) & np.isfinite(peaks)
                samples = values[is_valid], peaks[is_valid]
                is_varying = all(np.unique(sample).size > 1 for sample in samples)
                coefficient = float(spearmanr(*samples)[0]) if is_varying else math.nan
                level, draws = levels[0], int(is_valid.sum())
                head = (building, level.scale, level.level, parameter, quantity)
                correlations.append(RankCorrelation(*head, coefficient, draws))
    return correlations


def _medians(store: Store) -> dict[tuple[int, int], tuple[SuiteLevel, Array]]:
    """Return the level, and the medians of the peaks (`PEAKS`) over the motions, by the number of
    the building and of the level, from 0; infinity if a median is a collapse."""
    rules, columns = SuiteRules.of(store), ", ".join(peak.column for peak in PEAKS)
    medians = {}
    for number in store.buildings():
        values = store.values_of_runs(schema.RUNS, columns, number)
        peaks = {run: np.abs(row) for run, (row,) in values.items()}
        for rank, level in enumerate(rules.levels_of(store, number)):
            (median,) = fractiles(level.demands(peaks), (0.5,))
            medians[number, rank] = level, median
    return medians
