"""JSON summaries: results, settings, input files and versions.

This module has the parts that all JSON files share, and the summaries of tables, campaigns, charts
and comparisons.
"""

from __future__ import annotations

import hashlib
import json
import math
import platform
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass
from functools import cache
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

import numpy as np

from tdint.analysis.defaults import PEAKS, QUANTITIES
from tdint.files import INPUT_DIGESTS
from tdint.ground_motion.record import Input, Record
from tdint.kernels.building.sources import CODE, code_of
from tdint.model.definition import Model
from tdint.output.tables.table import converted, describe, described_in, digits
from tdint.system import CLOCKS, version_of_sources
from tdint.units import SI, OutputUnits

if TYPE_CHECKING:
    from tdint.analysis.chart.profiles import FieldChart
    from tdint.analysis.chart.work_precision import Chart, Point, Timing
    from tdint.analysis.compare import Comparison
    from tdint.analysis.fit import Fit
    from tdint.campaign.store import Store

_LINE = 160  # maximum characters of a JSON line, indentation excluded
_SCHEMA = 1  # version of the layout; increased when a key is removed or changes its meaning

_FLAT_PART = re.compile(r'[\[{]\n(?:[^\[\]{}"]|"(?:[^"\\]|\\.)*")*[\]}]')
"""List or object of indented JSON without nested parts. Strings are matched as a whole, because
they may contain brackets."""

_UNITS = {"pga_m_s2": "m/s^2", "pgv_m_s": "m/s"}

_PACKAGES = ("numpy", "scipy", "numba", "obspy")


def model_input(model: Model) -> Input:
    """Return the file name of a model with the SHA-256 of the content that was read, for the list
    of inputs in a JSON file."""
    return input_of(model.source, model.text)


def input_of(source: str, text: bytes) -> Input:
    """Return a file name with the SHA-256 of its content `text`, for the list of inputs in a JSON
    file."""
    return Input(source, hashlib.sha256(text).hexdigest())


def record_summary(record: Record) -> dict[str, Any]:
    """Return the description of a record for a JSON file: data, origin, processing and inputs."""
    # The processing steps are listed separately, so they are not repeated in the notes.
    notes = [note for note in record.notes if note not in record.processing]
    return {**motion_summary(record), "notes": notes, "inputs": inputs_summary(record.inputs)}


def table_summary(
    command: str,
    settings: dict[str, Any],
    records: Sequence[dict[str, Any]],
    meanings: Mapping[str, Mapping[str, str]],
) -> dict[str, Any]:
    """Return the content of the JSON file that accompanies a table.

    Parameters
    ----------
    records : sequence of dict
        The `record_summary` of each record in the table.
    meanings : mapping
        Units and meanings of the columns: `Table.meanings`.
    """
    return {
        "schema": schema(command),
        "command": command,
        "settings": settings,
        "records": list(records),
        "inputs": merged_inputs(*(record["inputs"] for record in records)),
        "columns": meanings,
        "versions": versions(),
    }


def campaign_summary(store: Store) -> dict[str, Any]:
    """Return the content of summary.json of a campaign: settings, progress, inputs, and the columns
    of its tables."""
    from tdint.output.tables.campaign import PROFILE_ERRORS, PROFILES, run_columns
    from tdint.output.tables.damage_states import damage_summary

    statuses, unused = store.statuses(), store.unused()
    # The store is used instead of the files, because these may have been deleted or changed.
    records = store.connection.execute(
        "SELECT name, component, direction, dt_s, samples, pga_m_s2, pgv_m_s, sha256 FROM records "
        "ORDER BY id"
    )
    origins = store.origins()
    buildings = store.connection.execute("SELECT count(*) FROM buildings").fetchone()[0]
    return {
        "schema": schema("campaign"),
        "name": store.meta("name"),
        "fingerprint": store.meta("fingerprint"),
        "settings": store.parameters(),
        **({"scaling": scaling} if (scaling := store.scaling()) else {}),
        "buildings": buildings,
        "inputs": [{"file": file, "sha256": digest} for file, digest in store.files().items()],
        "records": [
            {**_record_entry(row), **origins.get(str(number), {})}
            for number, row in enumerate(records)
        ],
        "runs": {
            "all": int(store.meta("runs")),
            "done": sum(statuses.values()),
            "by_status": statuses,
        },
        "not_used": {
            f"{category}s": {"count": len(reasons), "reasons": reasons}
            for category, reasons in unused.items()
        },
        "repeated_with_finer_steps": store.count("repeats > 0"),
        "not_at_rest_at_their_end": store.count("at_rest = 0"),
        "processor_time_s": store.seconds(),
        "without_an_error": without_error(store),
        "columns": describe(run_columns(store)),
        "profiles": {"columns": describe([*PROFILES, *(PROFILE_ERRORS if store.checked else ())])},
        **({"damage": damage_summary(store)} if store.damage() else {}),
        "versions": {**versions(), **({"plugins": code} if (code := store.code()) else {})},
    }


def _record_entry(row: Sequence[Any]) -> dict[str, Any]:
    """Return the entry of a ground motion or a load case, a row of the table `records` of a store.
    A load case has no samples, and no values of a ground motion."""
    keys = ("file", "component", "direction", "dt_s", "samples", "pga_m_s2", "pgv_m_s", "sha256")
    entry = dict(zip(keys, row, strict=True))
    if entry["samples"]:
        return entry
    return {"file": entry["file"], "sha256": entry["sha256"]}


def without_error(store: Store) -> int | None:
    """Return the number of runs of a campaign that have a result but no error estimate; None if no
    estimates were requested."""
    if not store.checked:
        return None
    return store.count("peak_drift_m IS NOT NULL AND peak_drift_m_error IS NULL")


def schema(name: str) -> dict[str, str | int]:
    """Return the name and the version of the layout of a JSON file."""
    return {"name": f"tdint {name}", "version": _SCHEMA}


def in_units(
    content: dict[str, Any], units: OutputUnits, keys: Mapping[str, str] = MappingProxyType({})
) -> dict[str, Any]:
    """Convert the numbers of a summary to other units and rename their keys accordingly.

    Names in `columns` and `meanings` are renamed also; `settings` keep the values of the command
    line.

    Parameters
    ----------
    content : dict
        Summary in SI units.
    keys : mapping of str to str
        SI unit of the number of each key, in addition to `pga_m_s2` and `pgv_m_s`, which all
        summaries share.
    """
    if units == SI:
        return content
    result: dict[str, Any] = _in_units(content, units, {**_UNITS, **keys}, 1.0)
    return result


def _in_units(value: Any, units: OutputUnits, keys: Mapping[str, str], factor: float) -> Any:
    """Return a value of a summary, and all values in it, in output units: numbers are divided by
    `factor`. `keys` is the SI unit of the number of each key; numbers of other keys are not
    converted.
    """
    if isinstance(value, list | tuple):
        return [_in_units(item, units, keys, factor) for item in value]
    if not isinstance(value, dict):
        return converted(value, factor)
    result: dict[str, Any] = {}
    for key, item in value.items():
        # Settings keep the values of the command line; columns are described with their new units.
        if key == "settings":
            result[key] = {**item, "output_units": str(units)}
        elif key in ("columns", "meanings") and isinstance(item, Mapping):
            result[key] = described_in(item, units)
        else:
            name, factor_of_key = units.column(key, keys.get(key, "1"))
            result[name] = _in_units(item, units, keys, factor_of_key)
    return result


def json_bytes(content: dict[str, Any]) -> bytes:
    """Return a dictionary as JSON text with 12 significant digits, null for numbers that are not
    finite, and LF line ends."""
    # A file name that is not UTF-8 has surrogates; escaped (ASCII) they are still valid JSON.
    text = json.dumps(_plain(content), indent=2, allow_nan=False)
    # A short list or object without nested parts is written on one line. Strings contain no line
    # ends here, because JSON escapes them.
    text = _FLAT_PART.sub(_on_a_line, text)
    return (text + "\n").encode()


def _on_a_line(part: re.Match[str]) -> str:
    """Return a list or an object of indented JSON on one line if the line is short enough,
    otherwise unchanged; a function for `re.sub`."""
    line = re.sub(r"\n *", " ", part[0])
    line = f"{line[0]}{line[1:-1].strip()}{line[-1]}"
    return line if len(line) <= _LINE else part[0]


def listed_files(summary: Path) -> dict[str, str]:
    """Return the SHA-256 of each file that the summary of a run lists, by file name.

    The result is empty if the file is not the summary of a run.
    """
    try:
        return {file["file"]: file["sha256"] for file in stored_summary(summary)["files"]}
    except (LookupError, TypeError):
        return {}


def stored_summary(summary: Path) -> dict[str, Any]:
    """Return the content of a JSON file of tdint; an empty dictionary if the file is missing,
    cannot be read, or was written by another program."""
    try:
        content = json.loads(summary.read_bytes())
        return dict(content) if content["schema"]["name"].startswith("tdint ") else {}
    except (OSError, ValueError, LookupError, TypeError, AttributeError, RecursionError):
        return {}


def _plain(value: Any) -> Any:
    """Convert a value and all values in it for JSON: numbers have 12 significant digits, nan and
    infinite numbers become None, tuples become lists."""
    if isinstance(value, dict):
        return {key: _plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(item) for item in value]
    if isinstance(value, float | np.floating):
        return digits(value) if math.isfinite(value) else None  # JSON has no nan
    return value


def motion_summary(record: Record) -> dict[str, Any]:
    """Return the description of a ground motion after processing and scaling for a JSON file: file,
    channel, sampling, peak, scale factor, processing and warnings."""
    attributes = ("id", "component", "event", "start", "quantity", "units", "units_from")
    return {
        "file": record.source,
        **{name: getattr(record, name) for name in attributes},
        "dt_s": record.dt,
        "samples": record.acceleration.size,
        "duration_s": record.duration,
        "pga_m_s2": record.pga,
        "scale": record.scale,
        "processing": list(record.processing),
        "warnings": list(record.warnings),
        **({"origin": record.origin.summary} if record.origin else {}),
        "compared_with_file": list(record.header_checks)
        or ["no comparison: the file states no value that can be computed from its samples"],
    }


def merged_inputs(*lists: Iterable[Mapping[str, str]]) -> list[dict[str, str]]:
    """Return the distinct inputs of several lists, sorted by name."""
    merged = {(item["file"], item["sha256"]): dict(item) for inputs in lists for item in inputs}
    # The keys are name and SHA-256, so that files with the same content and different names remain
    # separate entries.
    return [merged[key] for key in sorted(merged)]


def files_read() -> list[dict[str, str]]:
    """Return all files that the running command has read so far, with their SHA-256."""
    return [
        {"file": file, "sha256": digest} for file, digest in (INPUT_DIGESTS.get() or {}).items()
    ]


def inputs_summary(inputs: Sequence[Input]) -> list[dict[str, str]]:
    """Return the entries of a JSON file for input files: name and SHA-256 of the content."""
    return list(map(asdict, inputs))


def versions() -> dict[str, Any]:
    """Return the versions of tdint, its numerical packages and Python, and the hash of the sources.

    If plug-ins are loaded, the SHA-256 of their files is included, by name.
    """
    packages = {package: _version(package) for package in _PACKAGES}
    own_version, sources = version_of_sources()
    content = {
        "tdint": own_version,
        **packages,
        "python": platform.python_version(),
        "sources": sources,
    }
    return content | ({"plugins": code_of(CODE)} if CODE else {})


@cache
def _version(package: str) -> str | None:
    """Return the installed version of a package; None if it is not installed."""
    # This import needs 14 ms and is used only for JSON files.
    from importlib.metadata import PackageNotFoundError, version

    try:
        return version(package)
    except PackageNotFoundError:  # imported from a source directory, not installed
        return None


@dataclass(frozen=True)
class Advice:
    """Recommended method and time step for an error limit.

    Attributes
    ----------
    limit : float
        Limit of the relative error.
    point : Point | None
        Recommended point of the chart; None if no point meets the limit.
    next_best : Point | None
        Best point of another method.
    estimated_error : float
        Error of a peak drift that `tdint run` estimates at this point: maximum over the stories,
        divided by the peak drift; NaN if it is unknown.
    """

    limit: float
    point: Point | None
    next_best: Point | None
    estimated_error: float


def chart_summary(
    charts: Sequence[Chart],
    *,
    model: Model,
    record: Record | None,
    target: str,
    advice: Sequence[Advice],
    notes: Sequence[str],
    meanings: Mapping[str, Mapping[str, str]],
) -> dict[str, Any]:
    """Return the content of the JSON file of a work-precision diagram.

    It contains the reference solutions with their estimated accuracy, and the recommended methods.

    Parameters
    ----------
    meanings : mapping
        Units and meanings of the columns of the table.
    """
    return {
        "schema": schema("chart"),
        "command": "chart",
        "name": model.name,
        "model": asdict(model_input(model)),
        "record": record_summary(record) if record else None,
        "target": target,
        "method_parameters": _parameters_of(
            point.line for chart in charts for point in chart.points
        ),
        "interval_s": charts[0].interval,
        "timing": [_timing(chart.timing) for chart in charts],
        "references": [
            {
                "stories": chart.stories,
                "method": chart.reference.method,
                "dt_s": chart.reference.dt,
                "confirmed_by": chart.reference.confirmed_by,
                "gap": {
                    quantity.replace("-", "_"): chart.reference.gap.of(quantity)
                    for quantity in QUANTITIES
                },
            }
            for chart in charts
        ],
        "peers": [asdict(peer) for chart in charts for peer in chart.peers],
        "recommended": [
            {"limit": advised.limit}
            | (_point(advised.point, target) if advised.point else {"method": None})
            | {
                "told_error": None
                if math.isnan(advised.estimated_error)
                else advised.estimated_error,
                "next_best": advised.next_best and _point(advised.next_best, target),
            }
            for advised in advice
        ],
        "usual": _point(charts[0].usual, target) if len(charts) == 1 else None,
        "notes": list(notes),
        "columns": meanings,
        "versions": versions(),
    }


def field_summary(
    chart: FieldChart, *, notes: Sequence[str], meanings: Mapping[str, Mapping[str, str]]
) -> dict[str, Any]:
    """Return the content of the JSON file of performance profiles.

    It contains the problems, the accuracy of their reference solutions, all measurements and the
    recommended methods.
    """
    peaks = [name.replace("-", "_") for name in PEAKS]
    names = (
        "name",
        "motion",
        "reason",
        "stories",
        "interval",
        "duration",
        "ductility",
        "changes",
        "confirmed_by",
    )
    return {
        "schema": schema("profiles"),
        "command": "chart",
        "method_parameters": _parameters_of(chart.lines),
        "problems": [
            {name: getattr(case, name) for name in names}
            | {
                "reference": "impulse4, 32 time steps per interval",
                "gap": asdict(case.gap),
                "points": [
                    [point.method, point.dt, point.outcome, point.iterations, point.fastest]
                    + [point.error(quantity) for quantity in asdict(case.gap)]
                    for point in case.points
                ],
            }
            for case in chart.measured
        ],
        # Order of the values in the lists of points. There are thousands of points, so their
        # values have no keys.
        "points": [
            "method",
            "dt_s",
            "outcome",
            "solves",
            "time_min_s",
            *(f"{quantity}_error" for quantity in peaks),
        ],
        "recommended": chart.leaders()._asdict(),
        "timing": _timing(chart.timing),
        "peers": [asdict(peer) for peer in chart.peers],
        "notes": list(notes),
        "columns": meanings,
        "versions": versions(),
    }


def _parameters_of(lines: Iterable[str]) -> dict[str, dict[str, float]]:
    """Return the parameters of each method of tdint, by the label of its line in a chart.

    Labels of other programs, such as `scipy/DOP853`, contain a slash. Labels of runs with a
    tolerance, such as `impulse4 by tolerance`, contain a space. Both are skipped.
    """
    from tdint.methods.catalogue import resolved  # most summaries do not need the catalogue

    # The condition is True for a label without a slash and without a space.
    return {line: resolved(line) for line in lines if not set("/ ") & set(line)}


def _timing(timing: Timing) -> Mapping[str, Any]:
    """Return the conditions of a time measurement for a JSON file: clock, repetitions, processor.

    `wall_over_processor_time` is above 1 if other programs used the processor meanwhile.
    """
    return {
        "clock": CLOCKS[timing.clock],
        "repeats": list(timing.repeats),
        "load": timing.load,
        "processor": timing.processor,
        "processors": timing.processors,
        "wall_over_processor_time": timing.stretch,
    }


def _point(point: Point, target: str) -> dict[str, Any]:
    """Return the description of a point of a work-precision diagram for a JSON file.

    Its error is the error of the quantity `target`, such as `peak-drift`.
    """
    return {
        "method": point.method,
        "dt_s": point.dt,
        "time_min_s": point.fastest,
        "error": point.error(target),
        "outcome": point.outcome,
    }


def comparison_summary(
    model: Model,
    comparisons: Sequence[Comparison],
    fitted: Fit | None,
    settings: Mapping[str, Any],
    units: OutputUnits = SI,
) -> dict[str, Any]:
    """Return the content of the JSON file of a comparison with recordings.

    Parameters
    ----------
    comparisons : sequence of Comparison
        The selected event first, then the events that were not used for the fit.
    fitted : Fit | None
        Result of the fit to the first event.
    units : OutputUnits
        Units of the fitted values, which are included in their names; SI by default. Other keys are
        converted by `in_units`.
    """
    from tdint.output.tables.buildings import comparison_table, fitted_table

    # The fitted values are stored with their descriptions, because their names depend on the units.
    fit: dict[str, Any] | None = None
    if fitted is not None:
        table = fitted_table(fitted.values, units)
        fit = {
            "runs": fitted.runs,
            "values": table.as_dictionaries(),
            "notes": list(fitted.notes),
            "columns": table.meanings,
        }
    inputs = [model_input(model)]
    for event in (comparison.event for comparison in comparisons):
        inputs += [input_of(event.recording.source, event.recording.text), *event.inputs]
    return {
        "schema": schema("compare"),
        "name": model.name,
        "events": [_event(comparison) for comparison in comparisons],
        "fit": fit,
        "settings": dict(settings),
        "inputs": inputs_summary(inputs),
        "columns": comparison_table(comparisons).meanings,
        "versions": versions(),
    }


def _event(comparison: Comparison) -> dict[str, Any]:
    """Return the part of a JSON file about one event of a comparison with recordings: its settings
    and the agreement of the responses on each floor."""
    from tdint.analysis.compare import absolute_displacements
    from tdint.methods.catalogue import resolved

    event, response = comparison.event, comparison.response
    return {
        "name": event.recording.name,
        "method": response.method,
        "method_parameters": resolved(response.method),
        "dt_s": response.dt,
        "status": response.status,
        "base": {"dt_s": event.base.dt, "samples": event.count, "pga_m_s2": event.base.pga},
        "band_hz": list(event.recording.band) if event.recording.band else None,
        "window_s": list(event.recording.window) if event.recording.window else None,
        "shift_s": comparison.shift,
        "floors": [
            {"floor": floor.floor, "quantity": floor.quantity, "samples": floor.time.size}
            | {
                name: getattr(floor, name)
                for name in ("correlation", "peak_ratio", "rms_difference")
            }
            for floor in comparison.floors
        ],
        "notes": [*event.notes, *response.notes],
        "warnings": [*event.warnings, *response.warnings, *absolute_displacements(comparison)],
    }


_SUMMARIES = ("ida.json", "summary.json")
"""Names of the summaries in the directory of a study and of a campaign."""

_TABLES = ("capacities.csv", "ida.csv", "runs.csv")
"""Tables of studies that contain observations."""


def study_summary(source: Path) -> dict[str, Any]:
    """Return the JSON summary of the study that wrote a table; empty for a table from elsewhere.

    Parameters
    ----------
    source : Path
        Table with observations, or the directory of a study.
    """
    folder = source if source.is_dir() else source.parent
    if not source.is_dir() and source.name not in _TABLES:
        return {}
    summaries = (stored_summary(folder / name) for name in _SUMMARIES)
    content: dict[str, Any] = next(filter(None, summaries), {})
    return content if content.get("records") else {}
