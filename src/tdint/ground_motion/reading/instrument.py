"""Turn a recorder's counts into m/s^2 by its StationXML file."""

from __future__ import annotations

import math
import warnings
from dataclasses import dataclass
from importlib.metadata import distribution
from io import BytesIO
from pathlib import Path
from typing import Any
from xml.parsers import expat

import numpy as np

from tdint.arrays import Array
from tdint.errors import RecordError
from tdint.ground_motion.messages import caught_messages, one_line, quiet_import
from tdint.ground_motion.reading.contents import digested, read_bytes
from tdint.ground_motion.reading.scale import without_mean
from tdint.ground_motion.record import Input

_PASSING, _LEFT = math.sqrt(0.5), 0.1
"""Parts of the amplitude between which the recorder's digital filters decide where frequencies are
faded out. What they have stopped cannot be had back: dividing by their response would turn rounded
counts into meters per second squared (1 m/s^2 of it in a record of 3 m/s^2, Ridgecrest 2019,
CI.CLC)."""

_SPECTRUM = 8192  # frequencies of the fading, which is smooth
_ACCELEROMETER_INPUT = ("M/S**2", "M/S^2", "M/S/S", "M/S2", "M/SEC**2", "M/SEC^2", "M/SEC2")


@dataclass(frozen=True)
class Instruments:
    """An obspy Inventory and the file it came from."""

    inventory: Any
    input: Input


def read_instruments(source: str | Path) -> Instruments:
    """Read a StationXML file.

    Raises
    ------
    RecordError
        The file cannot be read, or is not StationXML.
    """
    data = read_bytes(source)

    # A document type definition could name other files by its entities: it is refused, in whatever
    # encoding.
    def refuse(*_: object) -> None:
        raise RecordError(f"{source}: an inventory with a document type definition is not read")

    parser = expat.ParserCreate()
    parser.StartDoctypeDeclHandler = refuse
    parser.EntityDeclHandler = refuse
    (read_format,) = distribution("obspy").entry_points.select(
        group="obspy.plugin.inventory.STATIONXML", name="readFormat"
    )
    with quiet_import():
        function = read_format.load()
    try:
        parser.Parse(data, True)
        with caught_messages():
            return Instruments(function(BytesIO(data)), digested(data, source))
    except RecordError:
        raise
    except Exception as error:  # The XML parser and ObsPy's reader raise many kinds.
        raise RecordError(
            f"{source}: cannot be read as StationXML: {one_line(str(error))}"
        ) from error


def remove_response(
    trace: Any, instruments: Instruments, label: str
) -> tuple[Array, tuple[str, ...]]:
    """Remove an instrument's response, all of it, so that the trace becomes ground acceleration.

    The mean (the recorder's zero offset) is taken off first. The spectrum is then divided by the
    response without a water level, which would spoil the long periods of an accelerometer. It is
    faded out by a cosine where the recorder's digital filters stop it, from where they leave 1 /
    sqrt(2) of the amplitude to where they leave a tenth; without such filters it is left as it is.
    The ends of the record are not tapered.

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
    samples, mean_note = without_mean(trace.data)
    dt = float(trace.stats.delta)
    size = 1 << (2 * samples.size - 1).bit_length()
    try:
        with caught_messages():  # That a part of the stages has not the sensitivity of all.
            fade = _stop_band(response, dt)
        with caught_messages() as messages:
            counts, frequencies = response.get_evalresp_response(dt, size, output="ACC")
    except (
        Exception
    ) as error:  # ObsPy and evalresp raise many kinds for a response they cannot evaluate.
        reason = one_line(str(error))
        raise RecordError(
            f"{label}: its response in {instruments.input.file} cannot be removed: {reason}"
        ) from error
    faded = f", frequencies are faded out from {fade[0]:.4g} to {fade[1]:.4g} Hz" if fade else ""
    notes = [mean_note, f"the instrument's response ({instruments.input.file}) is removed{faded}"]
    of_input = response.instrument_sensitivity or response.response_stages[0]
    unit = str(of_input.input_units or "unknown units").upper()
    if unit not in _ACCELEROMETER_INPUT:
        notes.append(
            f"the instrument records {unit}, not acceleration: its long periods are amplified noise"
        )
    # Samples after division of their spectrum by counts per m/s^2, where these are known and
    # something is passed.
    passed = np.ones_like(frequencies)
    if fade is not None:
        part = np.maximum((frequencies - fade[0]) / (fade[1] - fade[0]), 0.0)
        passed = 0.5 * (1.0 + np.cos(np.pi * part)) * (part < 1.0)
    finite = np.isfinite(counts) & (counts != 0.0) & (passed > 0.0)
    spectrum = np.fft.rfft(samples, 2 * (counts.size - 1))
    spectrum[finite] *= passed[finite] / counts[finite]
    spectrum[~finite] = 0.0
    acceleration = np.fft.irfft(spectrum)[: samples.size]
    return acceleration, (*notes, *(f"ObsPy: {message}" for message in messages))


def _find_response(trace: Any, instruments: Instruments, label: str) -> Any:
    start, file = trace.stats.starttime, instruments.input.file
    try:
        with warnings.catch_warnings():
            warnings.simplefilter(
                "ignore"
            )  # That several epochs match: the first one is taken, as ObsPy does.
            response = instruments.inventory.get_response(trace.id, start)
    except Exception:  # ObsPy raises a plain Exception.
        channels = sorted(set(instruments.inventory.get_contents()["channels"]))
        listed = ", ".join(channels[:20]) + (", ..." if len(channels) > 20 else "")
        raise RecordError(
            f"{label}: {file} has no response for {trace.id} at {start}; its channels are "
            f"{listed or '-'}"
        ) from None
    if not response.response_stages:
        raise RecordError(f"{label}: {file} gives {trace.id} without the stages of its response")
    return response


def _stop_band(response: Any, dt: float) -> tuple[float, float] | None:
    """Frequencies, Hz, from which on and up to which the digital filters pass less and less; None
    if they pass all."""
    digital = []
    for stage in response.response_stages:
        # Filters of samples, not of voltages.
        kind = getattr(
            stage, "cf_transfer_function_type", getattr(stage, "pz_transfer_function_type", "")
        )
        if hasattr(stage, "symmetry") or str(kind).startswith("DIGITAL"):
            digital.append(stage.stage_sequence_number)
    if not digital:
        return None
    values, frequencies = response.get_evalresp_response(
        dt, _SPECTRUM, output="DEF", start_stage=min(digital), end_stage=max(digital)
    )
    passed = np.abs(values) / np.max(np.abs(values))
    start = int(np.flatnonzero(passed >= _PASSING)[-1])
    if start == passed.size - 1:
        return None
    stopped = np.flatnonzero(passed[start:] <= _LEFT)
    end = start + int(stopped[0]) if stopped.size else passed.size - 1
    return float(frequencies[start]), float(frequencies[end])
