"""summary.json of a run: what it was, how it ended, and what every number in it means."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any

from tdint.analysis.run.demands import demand_errors, demands
from tdint.analysis.run.outcome import ENERGY_TERMS
from tdint.ground_motion.record import Input, Record
from tdint.model.definition import Damping, ModalDamping, Model, RayleighCoefficients
from tdint.output.summaries.summary import inputs_summary, motion_summary, schema, versions
from tdint.output_units import unit_of

if TYPE_CHECKING:
    from tdint.analysis.run.outcome import Collapse, Energy, ErrorEstimate, FailedRun, Response, StoryErrors, StoryPeaks
    from tdint.analysis.spectra.first_mode import FirstMode

PEAKS = {
    "roof_displacement": ("roof_displacement_m", None),
    "base_shear": ("base_shear_N", None),
    "drift": ("drift_m", "drift_story"),
    "drift_ratio": ("drift_ratio", "drift_ratio_story"),
    "residual_drift": ("residual_drift_m", "residual_drift_story"),
    "residual_drift_ratio": ("residual_drift_ratio", "residual_drift_ratio_story"),
    "ductility": ("ductility", "ductility_story"),
    "acceleration": ("floor_absolute_acceleration_m_s2", "floor_absolute_acceleration_floor"),
}
"""By the names in `tdint.analysis.run.demands`, the keys of a largest value and of the story or floor that has it."""

MEANINGS = {
    "time_s": "last time reached",
    "story": "story of the failure or collapse, from 1 at the ground",
    "residual": "forces out of balance over the story's forces",
    "largest_stable_dt_s": "largest stable time step",
    "dt_s": "time step; of a record its sampling interval",
    "steps": "time steps",
    "duration_s": "time integrated; of a record from its first to its last sample",
    "iterations": "solves of the equations",
    "halved_steps": "steps divided because they did not converge",
    "events": "changes of branch of a drift law that were located in time",
    "wall_time_s": "wall time of the command",
    "time_loop_s": "wall time of the compiled time loop alone",
    "stories": "number of stories",
    "t1_s": "fundamental period of the initial stiffness, P-delta included",
    "t1_damping": "viscous damping ratio of the first mode, without power-law dashpots",
    "sa_t1_m_s2": "pseudo-acceleration of the ground motion at t1_s",
    "sa_t1_damping": "viscous damping ratio of sa_t1_m_s2",
    "ratios": "viscous damping ratios of the modes",
    "modes": "modes that the ratios belong to, from 1",
    "mass_1_s": "Rayleigh coefficient of the mass matrix",
    "stiffness_s": "Rayleigh coefficient of the initial stiffness matrix",
    "start_J": "kinetic and stored energy at the start, relative to the ground",
    "error": "imbalance of the energies over the largest input energy",
    "roof_displacement_m": "largest displacement of the roof, relative to the ground",
    "base_shear_N": "largest restoring force of the first story, without viscous forces",
    "drift_m": "largest drift of a story, relative to the floor below",
    "drift_story": "its story",
    "drift_ratio": "largest drift over story height",
    "drift_ratio_story": "its story",
    "residual_drift_m": "largest absolute drift at the end of the run",
    "residual_drift_story": "its story",
    "residual_drift_ratio": "largest absolute drift at the end over story height",
    "residual_drift_ratio_story": "its story",
    "ductility": "largest drift over drift at first yield",
    "ductility_story": "its story",
    "floor_absolute_acceleration_m_s2": "largest absolute acceleration of a floor",
    "floor_absolute_acceleration_floor": "its floor",
    "dts_s": "time steps of the repetitions that the errors come from; none if the run itself carried its error along",
    "drift_error": "largest estimated error of a peak drift over that drift",
    "drift_error_story": "its story",
    "tolerance": "what drift_error was asked to stay below",
    "runs_for_the_step": "runs that were made to choose the step for the tolerance",
    "samples_in_the_step": "sampling intervals of the record in the step that was chosen",
    "solves_at_record_step": "solves of a run with the record's own step, where one was made to choose",
    "collapse_drift": "drift ratio beyond which a run counts as collapsed",
    "samples": "samples of the record",
    "pga_m_s2": "peak ground acceleration",
    "scale": "factor on the record's acceleration",
    "version": "version of this file's layout",
}
MEANINGS |= {f"{name}_J": f"{meaning}, at the end or the last time reached" for name, meaning in ENERGY_TERMS.items()}
MEANINGS |= {f"{key}_error": f"estimated absolute error of {key}" for key, _ in PEAKS.values()}
"""What the number under a key is; its unit is in its name."""


def run_summary(
    response: Response,
    inputs: Sequence[Input],
    wall_time: float,
    *,
    first: FirstMode | None = None,
    settings: Mapping[str, Any] | None = None,
) -> dict[str, Any]:
    """Content of summary.json for a run that came to its end.

    Parameters
    ----------
    inputs : sequence of Input
        The files that were read.
    wall_time : float
        From the command's start, s.
    first : FirstMode, optional
        The building's first mode.
    settings : mapping, optional
        Settings of the command line beside those of the model.
    """
    content = {
        "schema": schema("run"),
        "status": response.status,
        "name": response.model.name,
        "method": response.method,
        "dt_s": response.dt,
        "steps": response.steps,
        "duration_s": response.steps * response.dt,
        "iterations": response.iterations,
        "halved_steps": response.halvings,
        "events": response.events,
        "wall_time_s": wall_time,
        "time_loop_s": response.march_time,
        "building": _building(response.model, first),
        "energy": _energy(response.energy),
        "peaks": peaks(response.stories),
        "check": _check(response.check, response.stories),
        "collapse_drift": response.model.collapse_drift,
        "collapse": _collapse(response.collapse),
    }
    return _ended(content, response.record, settings, (*response.warnings, *response.notes), inputs)


def failure_summary(
    failure: FailedRun,
    model: Model,
    record: Record | None,
    inputs: Sequence[Input],
    wall_time: float,
    *,
    first: FirstMode | None = None,
    settings: Mapping[str, Any] | None = None,
) -> dict[str, Any]:
    """Content of summary.json for a run without a result; `time_s` is the last time reached. See `run_summary`."""
    content = {
        "schema": schema("run"),
        "status": failure.status,
        "message": str(failure),
        "time_s": failure.time,
        "story": failure.story,
        "residual": failure.residual,
        "kinetic_J": failure.energy,
        "largest_stable_dt_s": failure.largest_stable_dt,
        "name": model.name,
        "method": failure.method,
        "dt_s": failure.dt,
        "wall_time_s": wall_time,
        "building": _building(model, first),
        "collapse_drift": model.collapse_drift,
    }
    return _ended(content, record, settings, failure.notes, inputs)


def _ended(
    content: dict[str, Any],
    record: Record | None,
    settings: Mapping[str, Any] | None,
    notes: Sequence[str],
    inputs: Sequence[Input],
) -> dict[str, Any]:
    """The content with what every summary of a run ends with."""
    content |= {
        "record": motion_summary(record) if record else None,
        "settings": dict(settings or {}),
        "notes": list(notes),
        "inputs": inputs_summary(inputs),
        "versions": versions(),
    }
    return content | {"meanings": meanings(content)}


def meanings(content: Mapping[str, Any]) -> dict[str, dict[str, str]]:
    """Unit and meaning of every key of a summary under which there is a number."""
    found = dict.fromkeys(_numbers({key: part for key, part in content.items() if key != "settings"}))
    return {key: {"meaning": MEANINGS[key], "unit": unit_of(key)} for key in found}


def _numbers(content: Mapping[str, Any]) -> Iterator[str]:
    """Keys of numbers, and of lists of them, however deep."""
    for key, value in content.items():
        if isinstance(value, Mapping):
            yield from _numbers(value)
        elif _is_number(value) or (isinstance(value, list) and any(map(_is_number, value))):
            yield key


def _is_number(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)


def peaks(stories: StoryPeaks) -> dict[str, float | int | None]:
    """The largest demands, SI units, and the story or floor (from 1) that has them; None where unknown."""
    result: dict[str, float | int | None] = {}
    found = demands(stories)
    for name, (key, place) in PEAKS.items():
        largest = getattr(found, name)
        result[key] = None if math.isnan(largest.value) else largest.value
        if place:
            result[place] = largest.place
    return result


def peak_errors(stories: StoryPeaks, errors: StoryErrors) -> dict[str, float | None]:
    """Estimated errors of the numbers in `peaks`; None where there is none."""
    found = demand_errors(stories, errors)
    return {f"{key}_error": None if math.isnan(found[name]) else found[name] for name, (key, _) in PEAKS.items()}


def _building(model: Model, first: FirstMode | None) -> dict[str, Any]:
    content: dict[str, Any] = {
        "stories": len(model.stories),
        "p_delta": model.p_delta,
        "damping": _damping(model.damping),
    }
    if first is not None:
        content |= {"t1_s": first.period, "t1_damping": first.damping}
        if first.sa is not None:
            content |= {"sa_t1_m_s2": first.sa, "sa_t1_damping": first.sa_damping}
    return content


def _damping(damping: Damping) -> dict[str, Any] | None:
    if damping is None:
        return None
    if isinstance(damping, RayleighCoefficients):
        return {"type": "rayleigh", "mass_1_s": damping.mass, "stiffness_s": damping.stiffness}
    if isinstance(damping, ModalDamping):
        return {"type": "modal", "ratios": list(damping.ratios)}
    return {"type": "rayleigh", "ratios": list(damping.ratios), "modes": list(damping.modes)}


def _energy(energy: Energy) -> dict[str, float]:
    terms = {f"{name}_J": getattr(energy, name) for name in ENERGY_TERMS}
    return {"start_J": energy.start, **terms, "error": energy.error}


def _check(check: ErrorEstimate | None, stories: StoryPeaks) -> dict[str, Any] | None:
    if check is None:
        return None
    choice = check.choice
    return {
        "dts_s": list(check.dts),
        "drift_error": check.drift_error,
        "drift_error_story": check.drift_story,
        "tolerance": choice.tolerance if choice else None,
        "runs_for_the_step": choice.runs if choice else None,
        "samples_in_the_step": choice.samples if choice else None,
        "solves_at_record_step": choice.solves_at_record if choice else None,
        "errors": peak_errors(stories, check.errors),
        "corrected_peaks": peaks(check.corrected) if check.corrected else None,
    }


def _collapse(collapse: Collapse | None) -> dict[str, Any] | None:
    if collapse is None:
        return None
    return {"time_s": collapse.time, "story": collapse.story, "run_ended": collapse.ended, "failed": collapse.failed}
