"""The runs of a study as they are done, a line of JSON for each record: an interrupted study goes on from them.

The first line holds what the runs depend on. A line that was cut off when the machine stopped counts for nothing.
"""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import asdict, fields
from pathlib import Path
from typing import Any

from tdint.campaign.ida.runs import IdaRun
from tdint.errors import OutputError, UsageError
from tdint.system import lock

_VERSION = "tdint"
"""The key of what may differ without the study being another one."""

Fingerprint = Mapping[str, Any]
"""What the runs of a study depend on: settings, and a hash of each input."""

Keep = Callable[[str, Sequence[IdaRun]], None]
"""Keeps the runs of a record."""

_NAMES = [field.name for field in fields(IdaRun)]


@contextmanager
def journal(file: Path, fingerprint: Fingerprint) -> Iterator[tuple[dict[str, tuple[IdaRun, ...]], Keep, str]]:
    """Open the journal of a study, a new one if there is none.

    Yields
    ------
    dict
        The runs of each record that is done, by its name.
    callable
        What keeps the runs of one more.
    str
        The version of tdint that began the study, if it is another one; else nothing.

    Raises
    ------
    UsageError
        It is the journal of another study.
    OutputError
        It cannot be written, or another process writes it.
    """
    try:
        file.parent.mkdir(parents=True, exist_ok=True)
        stream = file.open("a+b")
    except OSError as error:
        raise OutputError(f"{file}: cannot be written: {error.strerror or error}") from error
    with stream:
        _lock(stream.fileno(), file)
        stream.seek(0)
        kept, end, version = _understood(stream.read(), file, fingerprint)
        stream.truncate(end)

        def keep(name: str, runs: Sequence[IdaRun]) -> None:
            _append(stream, file, {"record": name, "runs": [list(asdict(run).values()) for run in runs]})

        if not end:
            _append(stream, file, {"study": dict(fingerprint)})
        yield kept, keep, version


def _append(stream: Any, file: Path, content: dict[str, Any]) -> None:
    try:
        stream.write(json.dumps(content).encode() + b"\n")
        stream.flush()
        os.fsync(stream.fileno())
    except OSError as error:
        raise OutputError(f"{file}: cannot be written: {error.strerror or error}") from error


def _understood(data: bytes, file: Path, fingerprint: Fingerprint) -> tuple[dict[str, tuple[IdaRun, ...]], int, str]:
    """The runs in a journal, how many bytes of it are whole, and the version that began it."""
    whole = data.rpartition(b"\n")[0]
    if not whole:
        return {}, 0, ""
    lines = whole.split(b"\n")
    try:
        begun = json.loads(lines[0])["study"]
        entries = [json.loads(line) for line in lines[1:]]
        kept = {
            one["record"]: tuple(IdaRun(**dict(zip(_NAMES, run, strict=True))) for run in one["runs"])
            for one in entries
        }
    except (ValueError, KeyError, TypeError):
        raise OutputError(f"{file}: is no journal of tdint ida; give another folder, or --overwrite") from None
    differences = [
        name for name in {**begun, **fingerprint} if name != _VERSION and begun.get(name) != fingerprint.get(name)
    ]
    if differences:
        told = "; ".join(_difference(name, begun.get(name), fingerprint.get(name)) for name in differences)
        raise UsageError(
            f"{file.parent}: holds another study ({told}); give another folder, or --overwrite to begin anew"
        )
    other = str(begun.get(_VERSION, ""))
    return kept, len(whole) + 1, other if other != fingerprint.get(_VERSION) else ""


def _difference(name: str, before: Any, now: Any) -> str:
    if isinstance(before, dict) and isinstance(now, dict):
        changed = [key for key in {**before, **now} if before.get(key) != now.get(key)]
        return f"{name}: {', '.join(changed[:5])}{' and others' if len(changed) > 5 else ''}"
    return f"{name}: {before} there, {now} here"


def _lock(descriptor: int, file: Path) -> None:
    """Keep others from the journal while this process lives."""
    if not lock(descriptor):
        raise OutputError(f"{file.parent}: another process writes this study; wait for it or give another folder")
