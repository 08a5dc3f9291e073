"""Allowed outcomes for a corrupt file: refused in one line, read without change, or changed where
no statement can reveal it."""

import tempfile
import time
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from fuzz.corpus import ALL, COUNT, PEAK, STEP, Sound
from tdint.errors import TdintError
from tdint.ground_motion.reading.read import read_records
from tdint.ground_motion.record import Record

LONGEST = 10.0
"""Seconds."""

LARGEST_MESSAGE = 2000
"""Characters."""

REFUSED, SAME, SAID, UNTOLD = "refused", "unchanged", "changed, said", "changed, nothing could tell"
OUTCOMES = (REFUSED, SAME, SAID, UNTOLD)


_DOUBTS = (
    "the mean is ",
    "the largest acceleration is ",
    "all samples are zero",
    "the recorder's zero offset",
)


_PEAK = 0.025
"""Part of a peak that the check's one per cent and the two digits that some headers have of it
leave open."""


class Failure(AssertionError):
    """Error: forbidden behavior."""


def read(data: bytes, units: str | None) -> tuple[Record, ...]:
    with tempfile.NamedTemporaryFile(suffix=".dat") as file:
        Path(file.name).write_bytes(data)
        return read_records(file.name, units=units)


def outcome(sound: Sound, before: Sequence[Record], data: bytes) -> str:
    """Read a damaged file and judge; raises Failure."""
    began = time.perf_counter()
    try:
        after = read(data, sound.units)
    except TdintError as error:
        text = str(error)
        if len(text) > LARGEST_MESSAGE:
            raise Failure(f"a message of {len(text)} characters") from error
        if error.exit_code != 4:
            raise Failure(f"exit code {error.exit_code}: {text}") from error
        return REFUSED
    except Exception as error:
        raise Failure(f"{type(error).__name__}: {error}") from error
    finally:
        if (took := time.perf_counter() - began) > LONGEST:
            raise Failure(f"took {took:.1f} s")
    return _judged(sound, before, after)


def _judged(sound: Sound, before: Sequence[Record], after: Sequence[Record]) -> str:
    for record in after:
        if not np.isfinite(record.acceleration).all():
            raise Failure("samples that are no finite numbers")
    if _is_complete_part(sound, before, after):
        return UNTOLD
    if len(after) != len(before):
        return _silent(sound, COUNT, before, after, f"{len(after)} components of {len(before)}")
    outcomes = [
        _component_outcome(sound, original, other)
        for original, other in zip(before, after, strict=True)
    ]
    return max(outcomes, key=OUTCOMES.index)


def _is_complete_part(sound: Sound, before: Sequence[Record], after: Sequence[Record]) -> bool:
    """Return True if complete components or one complete MiniSEED record are missing, because no
    file states their number."""
    if len(after) < len(before):
        return all(
            any(np.array_equal(record.acceleration, other.acceleration) for other in before)
            for record in after
        )
    sizes = [
        (record.acceleration.size, other.acceleration.size)
        for record, other in zip(before, after, strict=False)
    ]
    return (
        sound.name.startswith("MSEED")
        and len(after) == 1
        and sizes[0][1] < sizes[0][0]
        and sizes[0][1] in sound.ends
    )


def _component_outcome(sound: Sound, before: Record, after: Record) -> str:
    a, b = before.acceleration, after.acceleration
    if a.size != b.size:
        return _silent(sound, COUNT, [before], [after], f"{b.size} samples of {a.size}")
    if abs(after.dt - before.dt) > 1e-3 * before.dt:
        return _silent(sound, STEP, [before], [after], f"dt {after.dt:g} of {before.dt:g}")
    if np.array_equal(a, b):
        return SAME
    if abs(after.pga - before.pga) > _PEAK * max(after.pga, before.pga):
        return _silent(sound, PEAK, [before], [after], f"peak {after.pga:g} of {before.pga:g}")
    return _silent(sound, ALL, [before], [after], "other samples")


def _record_messages(records: Sequence[Record]) -> list[str]:
    """Return the notes and warnings on records, except doubts about samples, which any samples may
    cause."""
    notes = [note for record in records for note in (*record.notes, *record.warnings)]
    return [note for note in notes if not note.startswith(_DOUBTS)]


def _silent(
    sound: Sound, change: str, before: Sequence[Record], after: Sequence[Record], text: str
) -> str:
    """Raise Failure if a change was not reported although the file still contains a statement that
    reveals it."""
    known = set(_record_messages(before))
    if any(note not in known for note in _record_messages(after)):
        return SAID
    still_stated = all(any(change in name for name in record.header_checks) for record in after)
    if change in sound.tells and still_stated:
        raise Failure(f"changed without a word: {text}")
    return UNTOLD
