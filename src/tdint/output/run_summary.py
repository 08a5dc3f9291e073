"""Content of summary.json of a run: settings, status, results, and the meaning of every number."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any

from tdint.files import declared_rows
from tdint.ground_motion.record import Input, Record
from tdint.methods.catalogue import resolved
from tdint.model.damage_states import DEMANDS as DEMANDS_OF_DAMAGE
from tdint.model.definition import ModalDamping, Model, RayleighCoefficients, RayleighRatio
from tdint.model.limits import QUANTITIES, LimitCheck
from tdint.output.summary import inputs_summary, motion_summary, schema, versions
from tdint.output.tables import devices, matrices
from tdint.output.tables.elements import ELEMENT_COLUMNS, ELEMENT_ERROR, FRACTURE, element_table
from tdint.output.tables.loads import LOAD_COLUMNS, load_table
from tdint.output.verdicts import limits_summary
from tdint.response.runs.demands import DEMANDS, only
from tdint.response.runs.energy import ENERGY_TERMS
from tdint.system import CLOCKS, clock
from tdint.units import suffix

if TYPE_CHECKING:
    from tdint.output.tables.table import Column
    from tdint.response.runs.outcome import (
        ErrorEstimate,
        EventResponse,
        FailedRun,
        Response,
        StoryErrors,
        StoryPeaks,
    )
    from tdint.response.spectra.elastic import FirstMode


MEANINGS = {row["key"]: (row["unit"], row["meaning"]) for row in declared_rows(__file__)}
MEANINGS |= {column.name: (column.unit, column.meaning) for column in LOAD_COLUMNS}
MEANINGS |= {
    f"{name}_J": ("J", f"{meaning}, at the end or the last time reached")
    for name, meaning in ENERGY_TERMS.items()
}
MEANINGS |= {
    f"{name}{suffix(demand.unit)}": (demand.unit, demand.meaning)
    for name, demand in DEMANDS_OF_DAMAGE.items()
}
MEANINGS |= {demand.column: (demand.unit, demand.meaning) for demand in DEMANDS}
MEANINGS |= {
    demand.location_column: ("1", f"{demand.location} of {demand.column}") for demand in DEMANDS
}
MEANINGS |= {
    f"{demand.column}_error": (demand.unit, f"estimated absolute error of {demand.column}")
    for demand in DEMANDS
}
LIMIT_MEANINGS = {
    f"{name}{part}{suffix(quantity.unit)}": (quantity.unit, f"{text} {quantity.text}")
    for name, quantity in QUANTITIES.items()
    for part, text in (
        ("", "demand with the largest ratio to its limit:"),
        ("_limit", "limit of the"),
        ("_largest", "maximum of all motions:"),
    )
} | {
    "limit_story": ("1", "story or floor with the largest ratio of demand to limit"),
    "limit_ratio": ("1", "demand divided by limit"),
    "largest_story": ("1", "story or floor of the maximum of all motions"),
    "motions": ("1", "number of ground motions of the mean demand"),
}
"""Unit and meaning of the numbers on limits (`tdint.output.verdicts.limits_summary`)."""

MEANINGS = LIMIT_MEANINGS | MEANINGS
"""Unit and meaning of the number of each key."""

UNITS = {key: unit for key, (unit, _) in MEANINGS.items()}


def run_summary(
    response: Response,
    inputs: Sequence[Input],
    wall_time: float,
    *,
    first: FirstMode | None = None,
    settings: Mapping[str, Any] | None = None,
    limits: Sequence[LimitCheck] = (),
) -> dict[str, Any]:
    """Return the content of summary.json for a completed run.

    Parameters
    ----------
    wall_time : float
        Wall time since the start of the command, s.
    settings : mapping, optional
        Options of the command line that are not part of the model.
    limits : sequence of LimitCheck
        Comparisons with the limits of the model or of the command line.
    """
    energy = response.energy
    oscillating = int(response.residual_oscillation.argmax())  # index of the story
    elements, collapse = element_table(response), response.collapse
    content = {
        "schema": schema("run"),
        "status": response.status,
        "name": response.model.name,
        "method": response.method,
        "method_parameters": resolved(response.method),
        "dt_s": response.dt,
        "steps": response.steps,
        "duration_s": response.steps * response.dt,
        "iterations": response.iterations,
        "halved_steps": response.substeps,
        "branch_changes": response.branch_changes,
        "wall_time_s": wall_time,
        "time_loop_s": response.solver_time,
        "time_loop_clock": CLOCKS[clock()],
        "building": _building(response.model, first),
        **_loads(response.model),
        "energy": {
            "initial_J": energy.initial,
            **{f"{name}_J": getattr(energy, name) for name in ENERGY_TERMS},
            "error": energy.error,
        },
        "peaks": _peaks_of(response),
        **_directions(response),
        **matrices.as_json(response),
        **({"elements": elements.as_dictionaries()} if elements else {}),
        **devices.as_json(response),
        "check": _check(response.check, response.stories),
        **(
            {"events": [_event_summary(event) for event in response.events]}
            if response.events
            else {}
        ),
        "at_end": {
            "residual_oscillation_m": float(response.residual_oscillation[oscillating]),
            "residual_oscillation_story": oscillating + 1,
            "time_at_rest_s": response.time_at_rest,
        },
        "collapse_drift": response.model.collapse_drift,
        "collapse": collapse
        and {
            "time_s": collapse.time,
            "story": collapse.story,
            "run_ended": collapse.ended,
            "failed": collapse.failed,
        },
        **_damage(response),
        **({"limits": limits_summary(limits, mean=False)} if limits else {}),
    }
    notes = (*response.warnings, *response.notes)
    return _with_provenance(content, response.record, settings, notes, inputs)


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
    """Return the content of summary.json for a failed run, with the state at the failure; other
    arguments as for `run_summary`."""
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
        "method_parameters": resolved(failure.method) if failure.method else {},
        "dt_s": failure.dt,
        "wall_time_s": wall_time,
        "building": _building(model, first),
        **_loads(model),
        "collapse_drift": model.collapse_drift,
    }
    return _with_provenance(content, record, settings, failure.notes, inputs)


def _with_provenance(
    content: dict[str, Any],
    record: Record | None,
    settings: Mapping[str, Any] | None,
    notes: Sequence[str],
    inputs: Sequence[Input],
) -> dict[str, Any]:
    """Add the origin of the results to the content of summary.json in place, and return it: the
    record, the settings, the notes, the inputs and the versions. The meanings of all numbers
    follow.

    `settings` contains the options of the command line that are not part of the model.
    """
    content |= {
        "record": motion_summary(record) if record else None,
        "settings": {
            name: value for name, value in (settings or {}).items() if value not in (None, [])
        },
        "notes": list(notes),
        "inputs": inputs_summary(inputs),
        "versions": versions(),
    }
    return content | {"meanings": meanings(content)}


def meanings(content: Mapping[str, Any]) -> dict[str, dict[str, str]]:
    """Return the unit and the meaning of every key with a number in the summary of a run.

    The keys of the result are the keys in `content`, at any depth.
    """
    # Settings and parameters of methods are omitted, because --help and the publications of the
    # methods document them.
    skipped = ("settings", "method_parameters")
    names = dict.fromkeys(
        _number_keys({key: value for key, value in content.items() if key not in skipped})
    )
    columns: list[Column] = []
    if "elements" in content:
        columns += (*ELEMENT_COLUMNS, *ELEMENT_ERROR)
    if content.keys() & {"elements", "attachments", "links"}:
        columns += FRACTURE
    if content.keys() & {"attachments", "links"}:
        columns += devices.COLUMNS
    if content.keys() & {"rows", "flexure"}:
        columns += matrices.COLUMNS
    known = {column.name: (column.unit, column.meaning) for column in columns} | MEANINGS
    return {key: {"meaning": known[key][1], "unit": known[key][0]} for key in names}


def _number_keys(content: Mapping[str, Any]) -> Iterator[str]:
    """Yield the keys of numbers and of lists of numbers, at any depth."""
    for key, value in content.items():
        items = value if isinstance(value, list) else [value]
        # Events and outcomes can have different keys, so all events and outcomes are searched.
        if items and isinstance(items[0], Mapping):
            for item in items:
                yield from _number_keys(item)
        elif any(map(_is_number, items)):
            yield key


def _is_number(value: object) -> bool:
    """Return True for a number; False for a bool, which is an int in Python."""
    return isinstance(value, int | float) and not isinstance(value, bool)


def peaks(stories: StoryPeaks) -> dict[str, float | int | None]:
    """Return the maximum demands of a run over the stories in SI units, by the key in summary.json.

    Each demand is followed by its story or floor (from 1); None if it is unknown.
    """
    result: dict[str, float | int | None] = {}
    for demand in DEMANDS:
        largest = only(demand.of(stories))
        result[demand.column] = None if math.isnan(largest.value) else largest.value
        # A demand of a fixed story (`demand.story`), such as the base shear, does not need a key
        # for its story.
        if demand.story is None:
            result[demand.location_column] = largest.location
    return result


def _peaks_of(response: Response) -> dict[str, float | int | None]:
    """Return the maximum demands of a run; of rows only demands that are not of stories."""
    result = peaks(response.stories)
    if not response.model.rows:
        return result
    kept = ("base_shear", "total_base_shear")
    return {key: value for key, value in result.items() if key.startswith(kept)}


def _directions(response: Response) -> dict[str, Any]:
    """Return the peaks and errors in x and y of a run in two directions (its `peaks` are
    resultants)."""
    if not response.directions:
        return {}
    results = {
        name: {"peaks": _peaks_of(part), "check": _check(part.check, part.stories)}
        for name, part in zip(("x", "y"), response.directions, strict=True)
    }
    return {"directions": results}


def peak_errors(stories: StoryPeaks, errors: StoryErrors) -> dict[str, float | None]:
    """Return the estimated errors of the maximum demands of a run by the key in summary.json; None
    if an error is unknown."""
    errors_by_column = {
        f"{demand.column}_error": demand.error(stories, errors) for demand in DEMANDS
    }
    return {key: None if math.isnan(error) else error for key, error in errors_by_column.items()}


def _building(model: Model, first: FirstMode | None) -> dict[str, Any]:
    """Return the part of summary.json about the building: number of stories, damping, and, if they
    are known, the first mode and the spectral acceleration at its period."""
    damping: dict[str, Any] | None = None
    match model.damping:
        case RayleighCoefficients(mass, stiffness):
            damping = {"type": "rayleigh", "mass_1_s": mass, "stiffness_s": stiffness}
        case RayleighRatio(ratios, modes):
            damping = {"type": "rayleigh", "ratios": list(ratios), "modes": list(modes)}
        case ModalDamping(ratios):
            damping = {"type": "modal", "ratios": list(ratios)}
    content: dict[str, Any] = {
        "stories": len(model.stories),
        "p_delta": model.has_p_delta,
        "damping": damping,
    }
    # Without a first mode or a record, there is no spectral acceleration at the first period.
    if first is not None:
        content |= {"t1_s": first.period, "t1_damping": first.damping}
        if first.sa is not None:
            content |= {"sa_t1_m_s2": first.sa, "sa_t1_damping": first.sa_damping}
    return content


def _loads(model: Model) -> dict[str, Any]:
    """Return the part of summary.json about forces from tables; empty without such forces."""
    forces = load_table(model.excitation).as_dictionaries()
    return {"forces": forces} if forces else {}


def _event_summary(event: EventResponse) -> dict[str, Any]:
    """Return the part of summary.json about one event of a sequence: its record, its start and its
    peak responses, with their errors if these were estimated."""
    errors = peak_errors(event.stories, event.errors) if event.errors else None
    record = motion_summary(event.record)
    return {
        "record": record,
        "start_s": event.start,
        "peaks": peaks(event.stories),
        "errors": errors,
    }


def _check(check: ErrorEstimate | None, stories: StoryPeaks) -> dict[str, Any] | None:
    """Return the part of summary.json about the error estimate of a run; None if the errors were
    not estimated.

    `stories` contains the peak responses of the run; the errors are the errors of these values.
    """
    if check is None:
        return None
    choice = check.step_choice
    return {
        "method": check.method,
        "time_steps_s": list(check.time_steps),
        "drift_error": check.drift_error,
        "drift_error_story": check.drift_story,
        "tolerance": choice.tolerance if choice else None,
        "runs_for_the_step": choice.runs if choice else None,
        "samples_in_the_step": choice.samples if choice else None,
        "solves_at_record_step": choice.solves_at_record if choice else None,
        "errors": peak_errors(stories, check.errors),
        "corrected_peaks": peaks(check.corrected) if check.corrected else None,
    }


def _damage(response: Response) -> dict[str, Any]:
    """Return the part of summary.json about damage: demand, damage state, probabilities of the
    states and mean loss ratio; empty if the model has no damage states."""
    if response.model.damage is None:
        return {}
    # Imported here, because runs of buildings without damage states do not need it.
    from tdint.response.runs.damage import damage_of_run

    damage = damage_of_run(response.model, response.stories, response.status)
    assert damage is not None
    states = damage.states
    content = {
        f"{states.demand}{suffix(DEMANDS_OF_DAMAGE[states.demand].unit)}": None
        if math.isnan(damage.demand[0])  # the residual drift after a collapse
        else float(damage.demand[0]),
        "state": damage.state[0],
        "outcomes": [
            {"outcome": outcome, "probability": probability}
            for outcome, probability in zip(
                states.outcomes, damage.probability[0].tolist(), strict=True
            )
        ],
        **({"loss_ratio": float(damage.loss[0])} if states.losses else {}),
    }
    return {"damage": content}
