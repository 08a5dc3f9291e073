"""What a result was, how it came about, and from which inputs and versions: what all JSON files have in common, and the
one beside a table of records."""

from __future__ import annotations

import hashlib
import json
import math
import platform
from collections.abc import Iterable, Mapping, Sequence
from functools import cache
from importlib.metadata import PackageNotFoundError, version
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

import numpy as np

from tdint.ground_motion.record import Input, Record
from tdint.model.definition import Model
from tdint.output.tables.table import converted, describe, described_in
from tdint.output_units import SI, OutputUnits
from tdint.version import version_of_sources

if TYPE_CHECKING:
    from tdint.campaign.store.store import Store

_SCHEMA = 1

_UNITS = {"pga_m_s2": "m/s^2", "pgv_m_s": "m/s"}

_PACKAGES = ("numpy", "scipy", "numba", "obspy")


def model_input(model: Model) -> Input:
    """The input that a model file was, with the content that was read."""
    return input_of(model.source, model.text)


def input_of(source: str, text: bytes) -> Input:
    """The input that a file with this content was."""
    return Input(source, hashlib.sha256(text).hexdigest())


def record_summary(record: Record) -> dict[str, Any]:
    """What a record is, where it came from and what was done to it."""
    notes = [note for note in record.notes if note not in record.processing]
    return {**motion_summary(record), "notes": notes, "inputs": inputs_summary(record.inputs)}


def table_summary(
    command: str,
    settings: dict[str, Any],
    records: Sequence[dict[str, Any]],
    meanings: Mapping[str, Mapping[str, str]],
) -> dict[str, Any]:
    """Content of the JSON file beside a table.

    Parameters
    ----------
    command : str
        The command that made the table.
    settings : dict
        Its settings, those of the command line and the defaults.
    records : sequence of dict
        The `record_summary` of each record in the table.
    meanings : mapping
        What the table's columns mean: `Table.meanings`.
    """
    return {
        "schema": schema(command),
        "command": command,
        "settings": settings,
        "records": list(records),
        "inputs": merged_inputs(one for record in records for one in record["inputs"]),
        "columns": meanings,
        "versions": versions(),
    }


def campaign_summary(store: Store) -> dict[str, Any]:
    """What a campaign is, how far it has come, and what the columns of runs.csv mean."""
    from tdint.output.tables.campaign import PROFILE_ERRORS, PROFILES, run_columns
    from tdint.output.tables.damage_states import damage_summary

    statuses, unused = store.statuses(), store.unused()
    records = store.connection.execute(
        "SELECT name, component, direction, dt_s, samples, pga_m_s2, pgv_m_s, sha256 FROM records ORDER BY id"
    )
    keys = ("file", "component", "direction", "dt_s", "samples", "pga_m_s2", "pgv_m_s", "sha256")
    buildings = store.connection.execute("SELECT count(*) FROM buildings").fetchone()[0]
    return {
        "schema": schema("campaign"),
        "name": store.meta("name"),
        "fingerprint": store.meta("fingerprint"),
        "settings": {name: json.loads(value) for name, value in store.settings().items()},
        "buildings": buildings,
        "inputs": [{"file": file, "sha256": digest} for file, digest in store.files().items()],
        "records": [dict(zip(keys, row, strict=True)) for row in records],
        "runs": {"all": int(store.meta("runs")), "done": sum(statuses.values()), "by_status": statuses},
        "not_used": {f"{kind}s": {"count": len(reasons), "reasons": reasons} for kind, reasons in unused.items()},
        "repeated_with_finer_steps": store.count("repeats > 0"),
        "not_at_rest_at_their_end": store.count("at_rest = 0"),
        "processor_time_s": store.seconds(),
        "without_an_error": without_error(store),
        "columns": describe(run_columns(store)),
        "profiles": {"columns": describe([*PROFILES, *PROFILE_ERRORS * store.checked])},
        **({"damage": damage_summary(store)} if store.damage() else {}),
        "versions": versions(),
    }


def without_error(store: Store) -> int | None:
    """Runs with demands whose errors could not be estimated; None where this was not asked for."""
    return store.count("peak_drift_m IS NOT NULL AND peak_drift_m_error IS NULL") if store.checked else None


def schema(name: str) -> dict[str, str | int]:
    """Name and version of a JSON file's layout; the version grows when a key changes or goes."""
    return {"name": f"tdint {name}", "version": _SCHEMA}


def in_units(
    content: dict[str, Any], units: OutputUnits, keys: Mapping[str, str] = MappingProxyType({})
) -> dict[str, Any]:
    """A summary with its numbers in other units, under keys that say so.

    What `columns` and `meanings` tell of names changes with them; `settings` stay as they were given.

    Parameters
    ----------
    keys : mapping
        SI units of keys, beside those that summaries share.
    """
    return content if units == SI else _converted(content, units, {**_UNITS, **keys})


def _converted(content: dict[str, Any], units: OutputUnits, keys: Mapping[str, str]) -> dict[str, Any]:
    result: dict[str, Any] = {}
    for key, value in content.items():
        if key == "settings":
            result[key] = {**value, "output_units": str(units)}
        elif key in ("columns", "meanings") and isinstance(value, Mapping):
            result[key] = described_in(value, units)
        else:
            name, factor = units.column(key, keys.get(key, "1"))
            result[name] = _value_in(value, units, keys, factor)
    return result


def _value_in(value: Any, units: OutputUnits, keys: Mapping[str, str], factor: float) -> Any:
    if isinstance(value, dict):
        return _converted(value, units, keys)
    if isinstance(value, list | tuple):
        return [_value_in(item, units, keys, factor) for item in value]
    return converted(value, factor)


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


def motion_summary(record: Record) -> dict[str, Any]:
    """The numbers of a ground motion, as it is after its processing and scaling."""
    return {
        "file": record.source,
        "id": record.id,
        "component": record.component,
        "start": record.start,
        "quantity": record.quantity,
        "units": record.units,
        "units_from": record.units_from,
        "dt_s": record.dt,
        "samples": record.acceleration.size,
        "duration_s": record.duration,
        "pga_m_s2": record.pga,
        "scale": record.scale,
        "processing": list(record.processing),
        "warnings": list(record.warnings),
        "compared_with_file": list(record.compared) or ["nothing: the file states no number that its samples tell too"],
    }


def merged_inputs(*some: Iterable[Mapping[str, str]]) -> list[dict[str, str]]:
    """Inputs of several parts, each once, by name."""
    found = {(one["file"], one["sha256"]): dict(one) for inputs in some for one in inputs}
    return [found[key] for key in sorted(found)]


def inputs_summary(inputs: Sequence[Input]) -> list[dict[str, str]]:
    """Files and the SHA-256 of what was read of them."""
    return [{"file": item.file, "sha256": item.sha256} for item in inputs]


def versions() -> dict[str, str | None]:
    """Versions of tdint, of the packages it computes with, and of Python; and the hash of tdint's sources."""
    packages = {package: _version(package) for package in _PACKAGES}
    own, sources = version_of_sources()
    return {"tdint": own, **packages, "python": platform.python_version(), "sources": sources}


@cache
def _version(package: str) -> str | None:
    try:
        return version(package)
    except PackageNotFoundError:  # Imported from a folder, not installed.
        return None
