"""Conversion of recorder counts to m/s^2 by the instrument response in a StationXML file."""

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
from tdint.ground_motion.reading.contents import read_bytes, register_input
from tdint.ground_motion.reading.scale import without_mean
from tdint.ground_motion.record import Input

_BAND_START, _BAND_END = math.sqrt(0.5), 0.1
"""Amplitudes of the digital filters of the recorder at the start and at the end of the frequency
range where the spectrum is tapered to zero. Frequencies stopped by the filters cannot be
recovered: a division by the filter response would amplify the rounding of counts (to 1 m/s^2 in a
record with a peak of 3 m/s^2, Ridgecrest 2019, CI.CLC)."""

_SPECTRUM = 8192  # number of frequencies used to evaluate the smooth filter response
_ACCELEROMETER_INPUT = ("M/S**2", "M/S^2", "M/S/S", "M/S2", "M/SEC**2", "M/SEC^2", "M/SEC2")


@dataclass(frozen=True)
class Instruments:
    """ObsPy Inventory and its file."""

    inventory: Any
    input: Input


def read_instruments(source: str | Path) -> Instruments:
    """Read the instrument responses in a StationXML file, and add the file to the inputs of the
    command.

    Parameters
    ----------
    source : str or Path
        File name.

    Raises
    ------
    RecordError
        The file cannot be read, or is not StationXML.
    """
    data = read_bytes(source)

    # Reject a document type definition, because its entities can reference other files. The parser
    # detects it in every encoding of the file; a search of the bytes would not.
    def refuse(*_: object) -> None:
        """Raise RecordError; the parser calls this function at a document type definition."""
        raise RecordError(
            f"{source}: a StationXML file with a document type definition is not accepted; "
            "remove the definition"
        )

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
            return Instruments(function(BytesIO(data)), register_input(data, source))
    except RecordError:
        raise
    except Exception as error:  # The XML parser and the ObsPy reader raise many exception types.
        raise RecordError(
            f"{source}: cannot be read as StationXML: {one_line(str(error))}"
        ) from error


def remove_response(
    trace: Any, instruments: Instruments, label: str
) -> tuple[Array, tuple[str, ...]]:
    """Remove the complete instrument response from counts; return the ground acceleration.

    The mean (the zero offset of the recorder) is subtracted first. The spectrum is then divided by
    the response. No water level is used: it would change long periods of an accelerometer.

    In the transition band of the digital filters of the recorder, the spectrum is multiplied by a
    cosine taper, and at higher frequencies by zero. The band is between the frequencies where the
    filters reduce the amplitude to 1 / sqrt(2) and to 0.1. Without such filters, no taper is used.
    The ends of the record are not tapered.

    Parameters
    ----------
    trace : obspy.Trace
        Counts; not changed.
    instruments : Instruments
        StationXML file with the response of the channel.
    label : str
        File and channel, for messages.

    Returns
    -------
    acceleration : ndarray, shape (samples,)
        Ground acceleration, m/s^2.
    notes : tuple of str
        Notes about the steps.

    Raises
    ------
    RecordError
        The inventory has no response for this channel at this time, or the response cannot be
        removed.
    """
    response = _find_response(trace, instruments, label)
    samples, mean_note = without_mean(trace.data)
    dt = float(trace.stats.delta)
    # The Fourier transform has the smallest power of 2 that is at least twice the number of
    # samples. Without the added zeros, the end of the motion would appear at its start.
    size = 1 << (2 * samples.size - 1).bit_length()
    try:
        with caught_messages():  # Ignore warnings about the sensitivity of a subset of the stages.
            band = _transition_band(response, dt)
        with caught_messages() as messages:
            counts, frequencies = response.get_evalresp_response(dt, size, output="ACC")
    # ObsPy and evalresp raise many exception types for invalid responses.
    except Exception as error:
        reason = one_line(str(error))
        raise RecordError(
            f"{label}: the instrument response in {instruments.input.file} cannot be removed: "
            f"{reason}"
        ) from error
    tapered = f", frequencies are faded out from {band[0]:.4g} to {band[1]:.4g} Hz" if band else ""
    notes = [mean_note, f"the instrument's response ({instruments.input.file}) is removed{tapered}"]
    input_stage = response.instrument_sensitivity or response.response_stages[0]
    unit = str(input_stage.input_units or "unknown units").upper()
    if unit not in _ACCELEROMETER_INPUT:
        notes.append(
            f"the instrument records {unit}, not acceleration: its long periods are amplified noise"
        )
    # Divide the spectrum by the response (counts per m/s^2) at frequencies with a finite non-zero
    # response in the pass band. All other frequencies are set to zero.
    taper = np.ones_like(frequencies)
    if band is not None:
        # Position in the transition band: 0 at its start and below, 1 at its end.
        position = np.maximum((frequencies - band[0]) / (band[1] - band[0]), 0.0)
        taper = 0.5 * (1.0 + np.cos(np.pi * position)) * (position < 1.0)
    is_divided = np.isfinite(counts) & (counts != 0.0) & (taper > 0.0)
    spectrum = np.fft.rfft(samples, 2 * (counts.size - 1))
    spectrum[is_divided] *= taper[is_divided] / counts[is_divided]
    spectrum[~is_divided] = 0.0
    acceleration = np.fft.irfft(spectrum)[: samples.size]
    return acceleration, (*notes, *(f"ObsPy: {message}" for message in messages))


def _find_response(trace: Any, instruments: Instruments, label: str) -> Any:
    """Return the response of a channel at the start time of a trace.

    Parameters
    ----------
    trace : obspy.Trace
        Trace with the id of the channel and the start time.
    instruments : Instruments
        Inventory with the responses.
    label : str
        File and channel, for messages.

    Raises
    ------
    RecordError
        The inventory has no response for the channel at this time, or a response without stages.
    """
    start, file = trace.stats.starttime, instruments.input.file
    try:
        with warnings.catch_warnings():
            # ObsPy warns if several epochs match, and uses the first of these.
            warnings.simplefilter("ignore")
            response = instruments.inventory.get_response(trace.id, start)
    except Exception:  # ObsPy raises a plain Exception.
        channels = sorted(set(instruments.inventory.get_contents()["channels"]))
        listed = ", ".join(channels[:20]) + (", ..." if len(channels) > 20 else "")
        raise RecordError(
            f"{label}: {file} has no response for {trace.id} at {start}; its channels are "
            f"{listed or '-'}"
        ) from None
    if not response.response_stages:
        raise RecordError(
            f"{label}: {file} must contain the stages of the response of {trace.id}; download the "
            "StationXML file at the response level"
        )
    return response


def _transition_band(response: Any, dt: float) -> tuple[float, float] | None:
    """Return the start and the end of the transition band of the digital filters, Hz; None if the
    filters pass all frequencies.

    Parameters
    ----------
    response : obspy.core.inventory.Response
        Response of the channel, with its stages.
    dt : float
        Sampling interval, s.
    """
    digital = []
    for stage in response.response_stages:
        # Select filters of digital samples; analog stages have no stop band near the highest
        # frequency. Only the filters of type FIR have an attribute `symmetry`.
        filter_type = getattr(
            stage, "cf_transfer_function_type", getattr(stage, "pz_transfer_function_type", "")
        )
        if hasattr(stage, "symmetry") or str(filter_type).startswith("DIGITAL"):
            digital.append(stage.stage_sequence_number)
    if not digital:
        return None
    values, frequencies = response.get_evalresp_response(
        dt, _SPECTRUM, output="DEF", start_stage=min(digital), end_stage=max(digital)
    )
    amplitudes = np.abs(values) / np.max(np.abs(values))
    # The band starts at the last frequency that the filters still pass.
    start = int(np.flatnonzero(amplitudes >= _BAND_START)[-1])
    if start == amplitudes.size - 1:
        return None
    # The band ends at the first amplitude below the limit, otherwise at the highest frequency.
    stopped = np.flatnonzero(amplitudes[start:] <= _BAND_END)
    end = start + int(stopped[0]) if stopped.size else amplitudes.size - 1
    return float(frequencies[start]), float(frequencies[end])
