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
from functools import cache
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

import numpy as np

from tdint.files import INPUT_DIGESTS
from tdint.ground_motion.axes import pga_of
from tdint.ground_motion.record import Input, Record
from tdint.kernels.building.sources import CODE, code_of
from tdint.output.tables.table import converted, described_in, digits
from tdint.system import version_of_sources
from tdint.units import SI, OutputUnits

if TYPE_CHECKING:
    from tdint.model.definition import Model

_LINE = 160  # maximum characters of a JSON line, indentation excluded
_SCHEMA = 2  # version of the layout; increased when a key is removed or changes its meaning

_FLAT_PART = r'[\[{]\n(?:[^\[\]{}"]|"(?:[^"\\]|\\.)*")*[\]}]'
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


def schema(name: str) -> dict[str, str | int]:
    """Return the name and the version of the layout of a JSON file."""
    return {"name": f"tdint {name}", "version": _SCHEMA}


def in_units(
    content: dict[str, Any], units: OutputUnits, keys: Mapping[str, str] = MappingProxyType({})
) -> dict[str, Any]:
    """Convert a summary to other units and rename its keys accordingly.

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
    """Return a value of a summary, also nested, in output units: numbers are divided by
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
    text = re.sub(_FLAT_PART, _on_a_line, text)
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
    """Convert a value, also nested, for JSON: numbers have 12 significant digits, nan and
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
        "samples": record.samples,
        "duration_s": record.duration,
        "pga_m_s2": pga_of(record),
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
    """Return all files that the running command has read, with their SHA-256."""
    return [
        {"file": file, "sha256": digest} for file, digest in (INPUT_DIGESTS.get() or {}).items()
    ]


def inputs_summary(inputs: Sequence[Input]) -> list[dict[str, str]]:
    """Return the entries of a JSON file for input files: name and SHA-256 of the content."""
    return [source._asdict() for source in inputs]


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
