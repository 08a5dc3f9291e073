"""Turn a recorder's counts into m/s^2 by its StationXML file."""

from __future__ import annotations

import warnings
from dataclasses import dataclass
from importlib.metadata import distribution
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tdint.errors import RecordError
from tdint.ground_motion.messages import caught_messages, quiet_import
from tdint.ground_motion.record import Input
from tdint.ground_motion.scale import without_mean
from tdint.ground_motion.source import digested, read_bytes

_FADE = (0.8, 0.9)
"""Where frequencies are faded out, as parts of the Nyquist frequency. Above, the recorder's filter has left nothing of
the ground motion: dividing by its response would turn rounded counts into meters per second squared (1 m/s^2 of
it in a record of 3 m/s^2, Ridgecrest 2019, CI.CLC)."""

_NO_LOWER_LIMIT = (-2.0, -1.0)
_ACCELEROMETER_INPUT = ("M/S**2", "M/S^2", "M/S/S", "M/S2", "M/SEC**2", "M/SEC^2", "M/SEC2")


@dataclass(frozen=True)
class Instruments:
    """An obspy Inventory and the file it came from."""

    inventory: Any
    input: Input

    @property
    def source(self) -> str:
        """The file as the user named it."""
        return self.input.file


def read_instruments(source: str | Path) -> Instruments:
    """Read a StationXML file.

    Raises
    ------
    RecordError
        The file cannot be read, or is not StationXML.
    """
    data = read_bytes(source)
    # An entity could name other files; StationXML needs none.
    if b"<!DOCTYPE" in data or b"<!ENTITY" in data:
        raise RecordError(f"{source}: an inventory with a document type definition is not read")
    (read_format,) = distribution("obspy").entry_points.select(
        group="obspy.plugin.inventory.STATIONXML", name="readFormat"
    )
    with quiet_import():
        function = read_format.load()
    try:
        with caught_messages():
            return Instruments(function(BytesIO(data)), digested(data, source))
    except Exception as error:  # The XML parser and ObsPy's reader raise many kinds.
        reason = " ".join(str(error).split())
        raise RecordError(f"{source}: cannot be read as StationXML: {reason}") from error


def remove_response(trace: Any, instruments: Instruments, label: str) -> tuple[NDArray[np.float64], tuple[str, ...]]:
    """Remove an instrument's response, all of it, so that the trace becomes ground acceleration.

    The mean (the recorder's zero offset) is taken off first. The spectrum is then divided by the response without a
    water level, which would spoil the long periods of an accelerometer, and faded out by a cosine from 0.8 to 0.9 of
    the Nyquist frequency, beyond which the recorder's own filter leaves no ground motion. The ends of the record are
    not tapered.

    Parameters
    ----------
    trace : obspy.Trace
        Counts; left as they are.
    instruments : Instruments
        The StationXML file with the channel's response.
    label : str
        File and channel, for messages.

    Returns
    -------
    acceleration : ndarray, shape (samples,)
        m/s^2.
    notes : tuple of str
        What was done.

    Raises
    ------
    RecordError
        The inventory has no response of this channel at this time, or one that cannot be removed.
    """
    response = _find_response(trace, instruments, label)
    nyquist = 0.5 * float(trace.stats.sampling_rate)
    fade = tuple(part * nyquist for part in _FADE)
    copy = trace.copy()
    copy.data, mean_note = without_mean(trace.data)
    copy.stats.response = response
    try:
        with caught_messages() as messages:
            copy.remove_response(
                output="ACC", water_level=None, pre_filt=(*_NO_LOWER_LIMIT, *fade), zero_mean=False, taper=False
            )
    except Exception as error:  # ObsPy and evalresp raise many kinds for a response they cannot evaluate.
        reason = " ".join(str(error).split())
        raise RecordError(f"{label}: its response in {instruments.source} cannot be removed: {reason}") from error
    notes = [
        mean_note,
        f"the instrument's response ({instruments.source}) is removed, "
        f"frequencies are faded out from {fade[0]:g} to {fade[1]:g} Hz",
    ]
    unit = _input_unit(response)
    if unit not in _ACCELEROMETER_INPUT:
        notes.append(f"the instrument records {unit}, not acceleration: its long periods are amplified noise")
    return np.asarray(copy.data, dtype=np.float64), (*notes, *(f"ObsPy: {message}" for message in messages))


def _find_response(trace: Any, instruments: Instruments, label: str) -> Any:
    start = trace.stats.starttime
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # That several epochs match: the first one is taken, as ObsPy does.
            response = instruments.inventory.get_response(trace.id, start)
    except Exception:  # ObsPy raises a plain Exception.
        channels = sorted(set(instruments.inventory.get_contents()["channels"]))
        listed = ", ".join(channels[:20]) + (", ..." if len(channels) > 20 else "")
        raise RecordError(
            f"{label}: {instruments.source} has no response for {trace.id} at {start}; its channels are {listed or '-'}"
        ) from None
    if not response.response_stages:
        raise RecordError(f"{label}: {instruments.source} gives {trace.id} without the stages of its response")
    return response


def _input_unit(response: Any) -> str:
    sensitivity = response.instrument_sensitivity
    unit = sensitivity.input_units if sensitivity else response.response_stages[0].input_units
    return str(unit or "unknown units").upper()
