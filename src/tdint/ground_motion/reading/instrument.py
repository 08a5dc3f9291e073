"""Conversion of recorder counts to m/s^2 by the instrument response in a StationXML file.

A response states the calibration twice: by its stages, and by the sensitivity at a single
frequency. The stages are used, after a comparison with the sensitivity. ObsPy supports few
spellings of units; a stage with any other unit is evaluated as if its input were a displacement.
The unit of the first stage is therefore replaced by M, M/S or M/S**2, and the response is divided
by the value of the unit.
"""

from __future__ import annotations

import copy
import math
import re
import warnings
from dataclasses import dataclass
from io import BytesIO
from pathlib import Path
from typing import Any
from xml.parsers import expat

import numpy as np

from tdint.arrays import Array
from tdint.errors import RecordError
from tdint.ground_motion.messages import caught_messages, obspy_function, one_line
from tdint.ground_motion.reading.contents import read_bytes, register_input
from tdint.ground_motion.reading.scale import without_mean
from tdint.ground_motion.record import Input
from tdint.units import ACCELERATION, LENGTH, STANDARD_GRAVITY, abbreviated, canonical

_BAND_START, _BAND_END = math.sqrt(0.5), 0.1
"""Amplitudes of the digital filters of the recorder at the start and at the end of the frequency
range where the spectrum is tapered to zero. Frequencies stopped by the filters cannot be
recovered: a division by the filter response would amplify the rounding of counts (to 1 m/s^2 in a
record with a peak of 3 m/s^2, Ridgecrest 2019, CI.CLC)."""

_SPECTRUM = 8192  # number of frequencies used to evaluate the smooth filter response

_MAX_CONTRADICTION = 0.05
"""Maximum relative difference between the stages and the stated sensitivity. In public files, 239
of 241 accelerometers agree within 1e-4."""

_CORNER_FACTOR = 2.0
"""Maximum factor between the response and the stated sensitivity of a sensor of velocity or
displacement with gains that agree. The sensitivity may be stated near the corner frequency of the
sensor (factors from 0.81 to 1.6 in public files)."""

_STOPPED = 0.8
"""Fraction of the highest frequency of the record. At higher frequencies, digital filters reduce
the response, and only the gains are compared (channels with 1 sample/s may state the sensitivity at
1 Hz)."""

_OBSPY_UNITS = ("M", "M/S", "M/S**2")
"""Units of displacement, velocity and acceleration for ObsPy, by the number of derivatives."""

_UNITS = {name: (2, value) for name, value in ACCELERATION.items()}
_UNITS |= {"gn": (2, STANDARD_GRAVITY), "mgal": (2, 1e-5)}
_UNITS |= {
    f"{length}{time}": (derivatives, value)
    # 0.3048 is the double-precision number nearest to a foot; 12 inches differ in the last bit.
    for length, value in (LENGTH | {"ft": 0.3048, "nm": 1e-9, "um": 1e-6, "km": 1e3}).items()
    for derivatives, times in enumerate((("",), ("/s", "/s1", "/s^1"), ("/s^2", "/s*s")))
    for time in times
}
"""Number of derivatives and value in SI units of each unit, in the spelling of `canonical`."""


@dataclass(frozen=True)
class InputUnit:
    """Unit of a ground motion in a StationXML file.

    Attributes
    ----------
    text : str
        Unit in the spelling of the file.
    derivatives : int
        0 for a displacement, 1 for a velocity, 2 for an acceleration.
    value : float
        Value of the unit in SI units (m, m/s, m/s^2).
    """

    text: str
    derivatives: int
    value: float


def parse_input_unit(text: str | None) -> InputUnit | None:
    """Parse the unit of a ground motion in a StationXML file, in the spelling of any data center.

    Examples are `M/S**2`, `m/s^2`, `M/(SEC2)`, `m s-2`, `cm/s/s`, `nm/s`, `GAL` and `G`. A
    description that follows ` - ` is ignored. Return None for all other units and without a unit.
    """
    text = (text or "").partition(" - ")[0].strip()
    unit = re.sub(r"\s+per\s+", "/", abbreviated(text.lower()))
    known = _UNITS.get(canonical(re.sub(r"[()\[\]]", "", unit)))
    return InputUnit(text, *known) if known else None


@dataclass(frozen=True)
class Instruments:
    """ObsPy Inventory and its file."""

    inventory: Any
    input: Input


def read_instruments(source: str | Path) -> Instruments:
    """Read the instrument responses in a StationXML file, and add the file to the inputs of the
    command.

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
    function = obspy_function("obspy.plugin.inventory.STATIONXML", "readFormat")
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
) -> tuple[Array, tuple[str, ...], tuple[str, ...]]:
    """Remove the complete instrument response from counts. Return the ground acceleration (m/s^2),
    notes about the steps, and warnings about properties of the response that affect the meaning of
    the acceleration.

    The mean (the zero offset of the recorder) is subtracted first. The spectrum is then divided by
    the response. No water level is used: it would change long periods of an accelerometer.

    In the transition band of the digital filters of the recorder, the spectrum is multiplied by a
    cosine taper, and at higher frequencies by zero. The band is between the frequencies where the
    filters reduce the amplitude to 1 / sqrt(2) and to 0.1. Without such filters, no taper is used.
    The ends of the record are not tapered.

    Raises
    ------
    RecordError
        The inventory has no response for this channel at this time, the response contradicts its
        sensitivity or does not start with a ground motion, or it cannot be removed.
    """
    file = instruments.input.file
    samples, mean_note = without_mean(trace.data)
    dt = float(trace.stats.delta)
    # The copy of the response has an input in M, M/S or M/S**2.
    response = copy.deepcopy(_find_response(trace, instruments, label))
    first = min(response.response_stages, key=lambda stage: stage.stage_sequence_number)
    unit = parse_input_unit(first.input_units)
    if unit is None:
        stated = f"in {first.input_units}" if first.input_units else "without a unit"
        raise RecordError(
            f"{label}: the response in {file} must start with a ground motion, but the input of "
            f"its first stage is {stated}; correct the file, or specify the value of one count by "
            "`units`"
        )
    first.input_units = _OBSPY_UNITS[unit.derivatives]
    # The Fourier transform has the smallest power of 2 that is at least twice the number of
    # samples. Without the added zeros, the end of the motion would appear at its start.
    size = 1 << (2 * samples.size - 1).bit_length()
    try:
        response_warnings = _compare_with_sensitivity(response, unit, dt, label, file)
        with caught_messages():  # Ignore warnings about the sensitivity of a subset of the stages.
            band = _transition_band(response, dt)
        with caught_messages() as messages:
            # The sensitivity has been compared by the rule of the module, not of evalresp.
            counts, frequencies = response.get_evalresp_response(
                dt, size, output="ACC", hide_sensitivity_mismatch_warning=True
            )
    except RecordError:
        raise
    # ObsPy and evalresp raise many exception types for invalid responses.
    except Exception as error:
        reason = one_line(str(error))
        raise RecordError(
            f"{label}: the instrument response in {file} cannot be removed: {reason}"
        ) from error
    counts /= unit.value  # from counts per unit of the file to counts per m/s^2
    tapered = f", frequencies are faded out from {band[0]:.4g} to {band[1]:.4g} Hz" if band else ""
    notes = (mean_note, f"the instrument's response ({file}) is removed{tapered}")
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
    return acceleration, notes, (*response_warnings, *(f"ObsPy: {text}" for text in messages))


def _find_response(trace: Any, instruments: Instruments, label: str) -> Any:
    """Return the response of a channel at the start time of a trace. RecordError is raised if the
    inventory has no such response, or a response without stages.
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
        stated = response.instrument_sensitivity
        units = _units_of_sensitivity(stated, trace.stats.channel)
        sensitivity = (
            f"; it states only the sensitivity, {stated.value:.6g} counts per {stated.input_units}"
            if units
            else ""
        )
        alternative = f", or, for a flat response, specify `units={units}`" if units else ""
        raise RecordError(
            f"{label}: {file} must contain the stages of the response of {trace.id}{sensitivity}; "
            f"download the StationXML file at the response level{alternative}"
        )
    return response


def _units_of_sensitivity(sensitivity: Any, channel: str = "") -> str:
    """Return the units of a count by a stated sensitivity, in the form that `parse_units` accepts.

    The text is empty if the sensitivity is not stated, not positive, not of a ground motion, or not
    of an acceleration although the channel code is of an accelerometer (second letter N).
    """
    unit = parse_input_unit(sensitivity.input_units) if sensitivity is not None else None
    if unit is None or not (sensitivity.value and 0.0 < sensitivity.value < math.inf):
        return ""
    if channel[1:2] == "N" and unit.derivatives < 2:
        return ""
    si_unit = ("m", "m/s", "m/s^2")[unit.derivatives]
    return f"{unit.value / float(sensitivity.value):.6g} {si_unit}"


def _compare_with_sensitivity(
    response: Any, unit: InputUnit, dt: float, label: str, file: str
) -> tuple[str, ...]:
    """Compare the stages of a response with its sensitivity; return warnings about the response.
    RecordError is raised if they contradict each other.

    The response at the frequency of the sensitivity and the product of the gains are compared,
    because neither is sufficient: without a pole the gains are still right, and digital filters or
    the corner of a sensor reduce a correct response.
    """
    remarks = []
    if unit.derivatives < 2:
        remarks.append(
            f"the instrument records {unit.text}, not acceleration: its long periods are amplified "
            "noise"
        )
    stated = response.instrument_sensitivity
    if stated is None or not stated.value:
        return (*remarks, "the response states no sensitivity; its stages are used unchecked")
    labeled = parse_input_unit(stated.input_units) or unit
    has_other_quantity = labeled.derivatives != unit.derivatives
    if has_other_quantity:
        remarks.append(
            f"the sensitivity is stated per {labeled.text}, but the response starts with "
            f"{unit.text}; the stages are used"
        )

    frequency = float(stated.frequency or 0.0)
    gains = math.prod(
        abs(stage.stage_gain) for stage in response.response_stages if stage.stage_gain
    )
    with caught_messages():
        (response_value,) = response.get_evalresp_response_for_frequencies(
            [frequency], output="DEF", hide_sensitivity_mismatch_warning=True
        )
    total = abs(complex(response_value))
    # The response at this frequency is not comparable if filters stop it.
    is_stopped = frequency > _STOPPED * 0.5 / dt or (frequency == 0.0 and total == 0.0)
    least, most = 1.0 - _MAX_CONTRADICTION, 1.0 + _MAX_CONTRADICTION
    if is_stopped:
        least, most = 0.0, math.inf
    elif unit.derivatives < 2:
        least, most = 1.0 / _CORNER_FACTOR, _CORNER_FACTOR
    # Possible values of the sensitivity in the unit of the first stage. If the unit in the file is
    # of another quantity, the number may be per unit of either quantity, because some files label
    # it wrongly.
    value = abs(float(stated.value))
    converted = value * unit.value / labeled.value
    sensitivities = [value] if has_other_quantity else [converted]
    if has_other_quantity and frequency != 0.0:
        order = labeled.derivatives - unit.derivatives
        sensitivities.append(converted * (2.0 * math.pi * frequency) ** order)
    if not any(
        abs(total / candidate - 1.0) <= _MAX_CONTRADICTION
        or (
            abs(gains / candidate - 1.0) <= _MAX_CONTRADICTION
            and least <= total / candidate <= most
        )
        for candidate in sensitivities
    ):
        units = "" if has_other_quantity else _units_of_sensitivity(stated)
        alternative = (
            f", or, if the sensitivity is right and the response is flat, specify `units={units}`"
            if units
            else ", or specify the value of one count by `units`"
        )
        raise RecordError(
            f"{label}: the response in {file} contradicts its sensitivity of "
            f"{stated.value:.6g} counts per {stated.input_units}: at {frequency:g} Hz its stages "
            f"give {total:.6g} counts per {unit.text}, and the product of their gains is "
            f"{gains:.6g}; correct the file{alternative}"
        )
    return tuple(remarks)


def _transition_band(response: Any, dt: float) -> tuple[float, float] | None:
    """Return the start and the end of the transition band of the digital filters, Hz; None if the
    filters pass all frequencies.

    `dt` is the sampling interval, s.
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
    start = int(np.flatnonzero(amplitudes >= _BAND_START)[-1])
    if start == amplitudes.size - 1:
        return None
    # The band ends at the first amplitude below the limit, otherwise at the highest frequency.
    stopped = np.flatnonzero(amplitudes[start:] <= _BAND_END)
    end = start + int(stopped[0]) if stopped.size else amplitudes.size - 1
    return float(frequencies[start]), float(frequencies[end])
