"""What a result was, how it came about, and from which inputs and versions: summary.json of a run, and the JSON file
beside a table of records."""

from __future__ import annotations

import hashlib
import json
import math
import platform
from collections.abc import Sequence
from importlib.metadata import PackageNotFoundError, version
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from tdint.ground_motion.record import Input, Record
from tdint.model.definition import Model

if TYPE_CHECKING:
    from tdint.analysis.run.outcome import Check, Collapse, Energy, FailedRun, Response, StoryErrors, StoryPeaks

Array = NDArray[np.float64]

_PACKAGES = ("tdint", "numpy", "scipy", "numba", "obspy")


def model_input(model: Model) -> Input:
    """The input that a model file was, with the content that was read."""
    return Input(model.source, hashlib.sha256(model.text).hexdigest())


def run_summary(response: Response, inputs: Sequence[Input], wall_time: float) -> dict[str, Any]:
    """Content of summary.json for a run that came to its end; `wall_time` (s) counts from the command's start."""
    return {
        "status": response.status,
        "name": response.model.name,
        "method": response.method,
        "dt_s": response.dt,
        "steps": response.steps,
        "duration_s": response.steps * response.dt,
        "iterations": response.iterations,
        "halvings": response.halvings,
        "events": response.events,
        "wall_time_s": wall_time,
        "march_time_s": response.march_time,
        "energy": _energy(response.energy),
        "peaks": overall_peaks(response.stories),
        "check": _check(response.check, response.stories),
        "collapse_drift": response.model.collapse_drift,
        "collapse": _collapse(response.collapse),
        "record": _motion(response.record),
        "notes": list(response.notes),
        "inputs": _inputs(inputs),
        "versions": versions(),
    }


def failure_summary(
    failure: FailedRun,
    model: Model,
    record: Record | None,
    inputs: Sequence[Input],
    wall_time: float,
) -> dict[str, Any]:
    """Content of summary.json for a run without a result; `time_s` is the last time reached."""
    return {
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
        "collapse_drift": model.collapse_drift,
        "record": _motion(record),
        "notes": list(failure.notes),
        "inputs": _inputs(inputs),
        "versions": versions(),
    }


def record_summary(record: Record) -> dict[str, Any]:
    """What a record is, where it came from and what was done to it."""
    notes = [note for note in record.notes if note not in record.processing]
    return {**(_motion(record) or {}), "notes": notes, "inputs": _inputs(record.inputs)}


def table_summary(command: str, settings: dict[str, Any], records: Sequence[dict[str, Any]]) -> dict[str, Any]:
    """Content of the JSON file beside a table of records.

    Parameters
    ----------
    command : str
        The command that made the table.
    settings : dict
        Its settings, those of the command line and the defaults.
    records : sequence of dict
        The `record_summary` of each record in the table.
    """
    return {"command": command, "settings": settings, "records": list(records), "versions": versions()}


def overall_peaks(stories: StoryPeaks) -> dict[str, float | int | None]:
    """The largest peaks of a building, SI units, and the story or floor (from 1) that has them; None where unknown."""
    drift, drift_story = _largest(stories.peak_drift)
    ratio, ratio_story = _largest(stories.peak_drift_ratio)
    ductility, ductility_story = _largest(stories.ductility)
    acceleration, floor = _largest(stories.peak_acceleration)
    residual, residual_story = _largest(np.abs(stories.residual_drift))
    return {
        "roof_displacement_m": float(stories.peak_displacement[-1]),
        "base_shear_N": float(stories.peak_shear[0]),
        "drift_m": drift,
        "drift_story": drift_story,
        "drift_ratio": ratio,
        "drift_ratio_story": ratio_story,
        "residual_drift_m": residual,
        "residual_drift_story": residual_story,
        "ductility": ductility,
        "ductility_story": ductility_story,
        "floor_acceleration_m_s2": acceleration,
        "floor_acceleration_floor": floor,
    }


def overall_errors(stories: StoryPeaks, errors: StoryErrors) -> dict[str, float | None]:
    """Estimated errors of the numbers of the same names in `overall_peaks`; None where there is none."""
    residual = np.abs(stories.residual_drift)
    return {
        "roof_displacement_m": float(errors.peak_displacement[-1]),
        "base_shear_N": float(errors.peak_shear[0]),
        "drift_m": _error_of_largest(stories.peak_drift, errors.peak_drift),
        "drift_ratio": _error_of_largest(stories.peak_drift_ratio, errors.peak_drift_ratio),
        "residual_drift_m": _error_of_largest(residual, errors.residual_drift),
        "ductility": _error_of_largest(stories.ductility, errors.ductility),
        "floor_acceleration_m_s2": _error_of_largest(stories.peak_acceleration, errors.peak_acceleration),
    }


def _error_of_largest(values: Array, errors: Array) -> float | None:
    """The largest error among the stories that may have the largest value."""
    known = np.isfinite(values) & np.isfinite(errors)
    if not known.any():
        return None
    values, errors = values[known], errors[known]
    return float(np.max(errors[values + errors >= np.max(values)]))


def json_bytes(content: dict[str, Any]) -> bytes:
    """JSON with 12 significant digits, null for what is no finite number, keys in the order given, LF ends."""
    # A file name that is not UTF-8 has surrogates; escaped (ASCII) they are still valid JSON.
    text = json.dumps(_plain(content), indent=2, allow_nan=False)
    return (text + "\n").encode()


def _plain(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(item) for item in value]
    if isinstance(value, float | np.floating):
        return float(format(value + 0.0, ".12g")) if math.isfinite(value) else None
    return value


def _largest(values: Array) -> tuple[float | None, int | None]:
    """Largest value and its place from 1; nan is passed over."""
    if np.all(np.isnan(values)):
        return None, None
    i = int(np.nanargmax(values))
    return float(values[i]), i + 1


def _energy(energy: Energy) -> dict[str, float]:
    return {
        "start_J": energy.start,
        "input_J": energy.input,
        "kinetic_J": energy.kinetic,
        "damping_J": energy.damping,
        "recoverable_J": energy.recoverable,
        "dissipated_J": energy.dissipated,
        "error": energy.error,
    }


def _check(check: Check | None, stories: StoryPeaks) -> dict[str, Any] | None:
    if check is None:
        return None
    return {
        "dts_s": list(check.dts),
        "drift_error": check.drift_error,
        "drift_error_story": check.drift_story,
        "tolerance": check.tolerance,
        "errors": overall_errors(stories, check.errors),
    }


def _collapse(collapse: Collapse | None) -> dict[str, Any] | None:
    if collapse is None:
        return None
    return {"time_s": collapse.time, "story": collapse.story, "run_ended": collapse.ended}


def _motion(record: Record | None) -> dict[str, Any] | None:
    if record is None:
        return None
    return {
        "file": record.source,
        "id": record.id,
        "component": record.component,
        "start": record.start,
        "units": record.units,
        "dt_s": record.dt,
        "samples": record.acceleration.size,
        "duration_s": record.duration,
        "pga_m_s2": record.pga,
        "processing": list(record.processing),
        "compared_with_file": list(record.compared) or ["nothing: the file states no number that its samples tell too"],
    }


def _inputs(inputs: Sequence[Input]) -> list[dict[str, str]]:
    return [{"file": item.file, "sha256": item.sha256} for item in inputs]


def versions() -> dict[str, str | None]:
    """Versions of tdint, of the packages it computes with, and of Python."""
    return {**{package: _version(package) for package in _PACKAGES}, "python": platform.python_version()}


def _version(package: str) -> str | None:
    try:
        return version(package)
    except PackageNotFoundError:  # Run from a source tree that is not installed.
        return None
