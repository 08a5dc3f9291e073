"""From a file's samples to m/s^2: what the user says about their units, what the file says, and
what is done.

A floating-point MiniSEED file whose location code is SI was exported by tdint, and is in m/s^2; SV
and SD stand for its velocity (m/s) and displacement (m).

One convention about units is leaned on: floating-point MiniSEED of an accelerometer is in m/s^2.
ObsPy and other programs that remove an instrument's response write what is left as floating-point
numbers, in SI units, under the channel's own code; MiniSEED has no place for the unit. The code of
an accelerometer's channel has the letter N in its second place (SEED manual 2.4, appendix A).
Whoever leans on it hears so, and is refused where the numbers speak against it.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, replace
from math import isclose
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tdint.errors import RecordError, UsageError
from tdint.ground_motion.record import UNITS_BY_LOCATION
from tdint.units import STANDARD_GRAVITY, Units, parse_units

_CURES = (
    "give the value of one count (`units=2.38e-6 m/s^2`) or the instrument's StationXML file as "
    "`inventory`, which removes its response"
)
_DIFFERENCES = "frequencies above a tenth of the sampling rate come out too small"
"""By 6 % at a tenth for a velocity (sin x / x, x = 2 pi / 10), by 3 % for a displacement."""

_FEWEST = {"velocity": 3, "displacement": 3}

_SELF_SCALED = ("KNET", "KINEMETRICS_EVT")
"""Formats whose `stats.calib` turns counts into m/s^2, once the recorder's zero offset is taken
off."""

_SAC_DISPLACEMENT, _SAC_VELOCITY, _SAC_TIME_SERIES = 6, 7, 1


@dataclass(frozen=True)
class Declared:
    """What a file says about its own samples: a motion is (sample - mean, if `remove_mean`) x
    factor x units.

    `origin` is `format` where all files of the format have these units, else `file`.
    """

    units: Units
    origin: str = "file"
    factor: float = 1.0
    remove_mean: bool = False


@dataclass(frozen=True)
class Motion:
    """A trace's samples in SI units, and how these are known; attributes as in
    `tdint.ground_motion.record`.

    Attributes
    ----------
    samples : ndarray, shape (samples,)
        What `quantity` says in m, m/s or m/s^2; the acceleration of that where `to_acceleration`
        made it.
    """

    samples: NDArray[np.float64]
    units: str
    units_from: str
    quantity: str = "acceleration"
    notes: tuple[str, ...] = ()
    warnings: tuple[str, ...] = ()


def to_acceleration(trace: Any, format_name: str, asked: Units | None, label: str) -> Motion:
    """Convert a trace's samples to m/s^2: as `to_motion`, and differentiated where they are no
    acceleration."""
    motion = to_motion(trace, format_name, asked, label)
    if motion.quantity == "acceleration":
        return motion
    note = f"the {motion.quantity} of the file is differentiated: {_DIFFERENCES}"
    samples = differentiated(motion.samples, float(trace.stats.delta), motion.quantity)
    return replace(motion, samples=samples, notes=(*motion.notes, note))


def to_motion(trace: Any, format_name: str, asked: Units | None, label: str) -> Motion:
    """Convert a trace's samples to SI units, applying every factor exactly once.

    A unit is stated by the format, by the file or by the user. Nothing else is leaned on but one
    convention, see `assumed_units`.

    Parameters
    ----------
    trace : obspy.Trace
        Samples as they stand in the file.
    format_name : str
        ObsPy's name of the file's format.
    asked : Units or None
        What the user says the samples are.
    label : str
        File and channel, for messages.

    Raises
    ------
    RecordError
        The samples are of unknown value, or the file contradicts the user.
    """
    declared = declared_units(trace, format_name, label, asked)
    named = trace.stats.get("tdint_quantity")
    if asked and named and named != asked.quantity:
        raise RecordError(
            f"{label}: the file calls the samples a {named}, {asked.text} is a unit of "
            f"{asked.quantity}; give one of {named}"
        )
    if declared:
        return _by_the_file(trace, declared, asked, label)
    # What stands in no unit: counts need the value of one, samples with a unit are taken at it.
    calibration = float(trace.stats.calib)
    if are_counts(trace) and not (asked and asked.has_factor):
        if asked:
            write = f'write "1 {asked.text}" if one count is 1 {asked.text}'
            raise RecordError(f"{label}: the samples are counts; {write}, else {_CURES}")
        factor = (
            ""
            if calibration == 1.0
            else f" (the header's calibration factor {calibration:g} has no unit)"
        )
        raise RecordError(
            f"{label}: the samples are counts of a recorder, not an acceleration{factor}; {_CURES}"
        )
    notes = (
        []
        if calibration == 1.0
        else [f"the header's calibration factor {calibration:g} is not applied: no unit"]
    )
    if asked:
        return Motion(
            _times(trace.data, asked.scale), asked.text, "given", asked.quantity, tuple(notes)
        )
    units, warning = assumed_units(trace, format_name, label)
    samples = _times(trace.data, units.scale)
    return Motion(samples, units.text, "assumed", notes=tuple(notes), warnings=(warning,))


def are_counts(trace: Any) -> bool:
    """Whether samples are counts of a recorder, as whole numbers are, and what a header calls
    so."""
    return trace.data.dtype.kind in "iu" or _ascii_unit(trace) in ("COUNTS", "COUNT")


def declared_units(
    trace: Any, format_name: str, label: str, asked: Units | None = None
) -> Declared | None:
    """What the file says about its samples' units, None if nothing.

    A reader of tdint's own tells them in `trace.stats.tdint_units`, as text for `parse_units`
    (empty where the user must give them); formats of the recorders have them in their calibration
    factor, text formats in their header.

    Raises
    ------
    RecordError
        The file says that its samples are no ground motion, or not evenly spaced.
    """
    stats = trace.stats
    of_reader = stats.get("tdint_units")
    if of_reader:
        return Declared(parse_units(of_reader), stats.get("tdint_units_from", "file"))
    if (
        format_name == "MSEED"
        and stats.location in UNITS_BY_LOCATION
        and not _OTHER_INSTRUMENT.fullmatch(stats.channel)
    ):
        return Declared(parse_units(UNITS_BY_LOCATION[stats.location]))
    if format_name in _SELF_SCALED:
        return Declared(Units("m/s^2", 1.0, False), "format", float(stats.calib), remove_mean=True)
    if "sac" in stats:
        # Refuse what a SAC header declares to be something else than an evenly sampled acceleration
        # (SAC manual, IDEP).
        sac = stats.sac
        other = {_SAC_DISPLACEMENT: "displacement", _SAC_VELOCITY: "velocity"}.get(sac.get("idep"))
        if other and not (asked and asked.quantity == other):
            raise RecordError(
                f"{label}: the SAC header says that the samples are a {other}, not an "
                f"acceleration; with units of a {other} they are differentiated"
            )
        if sac.get("iftype", _SAC_TIME_SERIES) != _SAC_TIME_SERIES or not sac.get("leven", True):
            raise RecordError(f"{label}: the SAC file is not an evenly sampled time series")
    unit = _ascii_unit(trace)
    if unit in ("", "COUNTS", "COUNT"):
        return None
    try:
        return Declared(parse_units(unit))
    except UsageError:
        raise RecordError(
            f"{label}: the header gives the samples in {unit[:40]}, which is no ground motion"
        ) from None


def _by_the_file(trace: Any, declared: Declared, asked: Units | None, label: str) -> Motion:
    units = declared.units
    if asked and not (
        isclose(asked.scale, units.scale, rel_tol=1e-9) and asked.quantity == units.quantity
    ):
        raise RecordError(
            f"{label}: the file itself gives its units ({units.text}), {asked.text} contradicts "
            "them; leave the units out"
        )
    samples, notes = trace.data, []
    if declared.remove_mean:
        samples, note = without_mean(samples)
        notes.append(note)
    if declared.factor != 1.0:
        notes.append(
            f"counts turned into m/s^2 with the file's calibration factor {declared.factor:.6g}"
        )
        units = replace(units, text=f"{declared.factor:.6g} {units.text}")
    scale = declared.factor * declared.units.scale
    return Motion(_times(samples, scale), units.text, declared.origin, units.quantity, tuple(notes))


def differentiated(samples: NDArray[np.float64], dt: float, quantity: str) -> NDArray[np.float64]:
    """Acceleration, m/s^2, from a `velocity` (m/s) or a `displacement` (m) by central differences.

    The second difference serves a displacement. The ends take the value beside them.
    """
    if samples.size < _FEWEST[quantity]:
        raise RecordError(
            f"{samples.size} samples of a {quantity} are too few to be differentiated"
        )
    inner = np.empty(samples.size)
    with np.errstate(over="ignore", invalid="ignore"):  # What overflows is found among the samples.
        if quantity == "velocity":
            inner[1:-1] = (samples[2:] - samples[:-2]) / (2.0 * dt)
        else:
            inner[1:-1] = (samples[2:] - 2.0 * samples[1:-1] + samples[:-2]) / (dt * dt)
    inner[0], inner[-1] = inner[1], inner[-2]
    return inner


def without_mean(samples: NDArray[Any]) -> tuple[NDArray[np.float64], str]:
    """Take off the recorder's zero offset (the mean of the record); also a note about it."""
    mean = float(np.mean(samples, dtype=np.float64))
    return samples - mean, f"the recorder's zero offset, the mean of {mean:.6g} counts, is removed"


def _times(samples: NDArray[Any], factor: float) -> NDArray[np.float64]:
    with np.errstate(
        over="ignore"
    ):  # An overflow is found, with its place, among the samples that are not finite.
        return np.asarray(samples, dtype=np.float64) * factor


def _ascii_unit(trace: Any) -> str:
    """Unit in the header of a TIMESERIES file, empty if none."""
    unit = str(trace.stats.get("ascii", {}).get("unit", "")).upper()
    # Without a unit ObsPy reports the header's last word, which is the type of the numbers.
    return "" if re.fullmatch(r"INTEGER|INT\d+|FLOAT\d*|DOUBLE|ASCII|UNKNOWN", unit) else unit


_ACCELEROMETER = "N"
_OTHER_INSTRUMENT = re.compile(r"[A-Z][HLGMPD][A-Z0-9]")
"""Channel codes of instruments that are no accelerometers. Motions that tdint writes may also have
the direction as the channel code (067, EW)."""

_LARGEST = 3.0 * STANDARD_GRAVITY
"""m/s^2; the largest acceleration of the ground ever recorded is a little less."""

_NEAR = 0.05  # of g: gravity and the offset of a sensor
_GRAVITIES = {1.0: "gravity in g", STANDARD_GRAVITY: "gravity"}
_CURE = "say what the samples are with `units=g`, cm/s^2 or m/s^2"


def assumed_units(trace: Any, format_name: str, label: str) -> tuple[Units, str]:
    """Take floating-point samples of an accelerometer's channel in a MiniSEED file as m/s^2; also a
    warning about it.

    Raises
    ------
    RecordError
        The file is another one, or its numbers can hardly be m/s^2.
    """
    if format_name != "MSEED" or trace.stats.get("tdint_units") == "":
        raise RecordError(f"{label}: the file does not tell the units of its samples; {_CURE}")
    code = str(trace.stats.channel).upper()
    if len(code) != 3 or code[1] != _ACCELEROMETER:
        raise RecordError(
            f"{label}: MiniSEED does not tell the units of its samples, and "
            f"{code or 'a channel without a code'} is no accelerometer's channel (HN?, BN?), whose "
            f"samples would be taken as m/s^2; {_CURE}"
        )

    # Numbers that can hardly be a ground acceleration in m/s^2.
    samples = np.asarray(trace.data, dtype=np.float64)
    peak, mean = float(np.max(np.abs(samples))), float(np.mean(samples))
    at_rest = next((name for g, name in _GRAVITIES.items() if abs(abs(mean) - g) <= _NEAR * g), "")
    doubt = ""
    if peak > _LARGEST:
        doubt = f"the largest would be {peak:.4g} m/s^2, over 3 g"
    elif at_rest:
        doubt = f"their mean is {mean:.5g}, {at_rest} by its look"
    elif peak and not np.any(samples % 1.0):
        doubt = "all are whole numbers, counts by their look"
    if doubt:
        raise RecordError(
            f"{label}: MiniSEED does not tell the units of its samples, and m/s^2 is unlikely: "
            f"{doubt}; {_CURE}"
        )
    return Units("m/s^2", 1.0, False), (
        "m/s^2 is assumed for floating-point samples of an accelerometer's channel in MiniSEED, "
        "which has no units; give them to be sure"
    )
