"""Motions as MiniSEED, as other programs and tdint itself read them."""

from __future__ import annotations

import io
import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from tdint.errors import OutputError
from tdint.ground_motion.messages import quiet_import
from tdint.ground_motion.record import Record

_SAME = 1e-12
"""Relative difference up to which MiniSEED keeps a sampling interval: it stores a rate as a ratio of two small whole
numbers, or in single precision."""


@dataclass(frozen=True)
class Exported:
    """A file of motions, and what there is to say of it."""

    content: bytes
    notes: tuple[str, ...]


def to_mseed(motions: Sequence[Record]) -> Exported:
    """Accelerations in m/s^2 as MiniSEED: FLOAT64, a channel of each record's id (NET.STA.LOC.CHA), its start if known.

    Raises
    ------
    OutputError
        A sampling rate that MiniSEED cannot say.
    """
    with quiet_import():
        from obspy import Stream, Trace, UTCDateTime, read

    stream = Stream()
    for motion in motions:
        network, station, location, channel = motion.id.split(".")
        header = {"network": network, "station": station, "location": location, "channel": channel}
        trace = Trace(np.array(motion.acceleration), header | {"delta": motion.dt})
        trace.stats.starttime = UTCDateTime(motion.start) if motion.start else UTCDateTime(0)
        stream.append(trace)
    content = io.BytesIO()
    try:
        stream.write(content, format="MSEED", encoding="FLOAT64")
    except Exception as error:  # ObsPy's writer raises of many kinds
        raise OutputError(f"the motions cannot be written as MiniSEED: {error}") from error
    dt = motions[0].dt
    stored = float(read(io.BytesIO(content.getvalue()), headonly=True)[0].stats.delta)
    notes = []
    if not math.isclose(stored, dt, rel_tol=_SAME):
        notes.append(f"MiniSEED has a sampling interval of {stored:.12g} s for {dt:.12g} s")
    return Exported(content.getvalue(), tuple(notes))
