"""Conversion of the samples of a file to m/s^2, by the units that the user specifies or the file
states.

A MiniSEED file with the location code SI was exported by tdint and is in m/s^2. The location codes
SV and SD are its velocity (m/s) and displacement (m).

MiniSEED has no field for units. A name of the form of ESM and ITACA (`.ACC.MP.mseed`), or with the
word velocity or displacement, shows the quantity of the samples, and the user must specify their
units.

One assumption is made about units: floating-point MiniSEED of an accelerometer is in m/s^2. ObsPy
and other programs that remove an instrument response write the result as floating-point numbers in
SI units under the unchanged channel code, because MiniSEED has no field for units. The channel code
of an accelerometer has N as its second letter (SEED manual 2.4, appendix A). The assumption is
reported as a warning. It is an error if the values of the samples are unlikely for m/s^2.
"""

from __future__ import annotations

import re
from math import isclose
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from tdint.arrays import Array, max_absolute
from tdint.errors import RecordError, UsageError
from tdint.ground_motion.missing import IncompleteRecord, Missing, likely_units
from tdint.ground_motion.record import UNITS_BY_LOCATION
from tdint.units import STANDARD_GRAVITY, Units, parse_units

_SPECIFY_COUNT_OR_RESPONSE = (
    "specify the value of one count (`units=2.38e-6 m/s^2`), or the StationXML file of the "
    "instrument as `inventory` to remove its response"
)
_SPLINE_NOTE = "its acceleration is that of a cubic spline through the displacements"
_MIN_SPLINE_SAMPLES = 4  # a cubic spline without boundary conditions needs four points
_REST = 0.01
"""Maximum initial velocity of a ground that starts at rest, over its peak; the building would
otherwise have a relative velocity that changes its response visibly."""

_ROUNDING_GAINS = {"velocity": (1.848, 1), "displacement": (6.0, 2)}
"""Largest acceleration from rounded samples: number and power of the sampling interval by which the
unit of rounding is multiplied and divided. It is half of the sum of the absolute weights of the
samples in an acceleration of the spline, 3.696 and 12."""

_NOTICED_ROUNDING = 0.05
"""Contribution of rounding, as a fraction of the peak acceleration, that is reported."""

_UNITS_EXAMPLES = {
    "velocity": "for example `units=cm/s`",
    "displacement": "for example `units=cm`",
}
"""Examples of the units of samples that are not an acceleration."""

_FORMATS_WITH_CALIBRATION = ("KNET", "KINEMETRICS_EVT")
"""Formats with a factor `stats.calib` that converts counts without their zero offset to m/s^2."""

_SAC_DISPLACEMENT, _SAC_VELOCITY, _SAC_TIME_SERIES = 6, 7, 1
"""Values of the SAC header fields IDEP (quantity; the first two) and IFTYPE (file type; the
last)."""


class Declared(NamedTuple):
    """Units of the samples stated in a file.

    Attributes
    ----------
    origin : str
        `format` if all files of the format have these units, otherwise `file`.
    factor : float
        Factor from samples to `units`.
    remove_mean : bool
        Subtract the mean of the samples before multiplication.
    """

    units: Units
    origin: str = "file"
    factor: float = 1.0
    remove_mean: bool = False


class Motion(NamedTuple):
    """Samples of a trace in SI units and the source of their units.

    Attributes
    ----------
    samples : ndarray, shape (samples,)
        Samples of `quantity` in m, m/s or m/s^2; in the result of `to_acceleration`, the
        acceleration in m/s^2.
    units : str
        Units of the samples in the file, with their factor if any.
    units_from : str
        Source of the units: `format`, `file`, `inventory`, `given` (by the user) or `assumed`.
    quantity : str
        Quantity of the samples in the file: `acceleration`, `velocity` or `displacement`.
    notes, warnings : tuple of str
        Messages about changes of the samples and about assumptions.
    """

    samples: Array
    units: str
    units_from: str
    quantity: str = "acceleration"
    notes: tuple[str, ...] = ()
    warnings: tuple[str, ...] = ()


def to_acceleration(
    trace: Any, format_name: str, specified: Units | None, label: str, quantity: str = ""
) -> Motion:
    """Convert the samples of a trace to m/s^2, those of a velocity or a displacement by a spline
    (`moved`).

    Parameters
    ----------
    trace : obspy.Trace
        Unchanged samples of the file.
    quantity : str
        Quantity that the samples must have (`RecordChoice`).

    Raises
    ------
    RecordError
        The units are unknown or contradict the file, the samples are another quantity, or they are
        too few to be differentiated.
    """
    motion = to_motion(trace, format_name, specified, label)
    if quantity and motion.quantity != quantity:
        raise RecordError(
            f"{label}: excitation.{quantity} needs a {quantity}, but the samples are of the "
            f"quantity {motion.quantity}; use excitation.record, or choose another `column`"
        )
    if motion.quantity == "acceleration":
        return motion
    moving = moved(motion.samples, float(trace.stats.delta), motion.quantity)
    return motion._replace(
        samples=moving.acceleration,
        notes=(*motion.notes, *moving.notes),
        warnings=(*motion.warnings, *moving.warnings),
    )


def to_motion(trace: Any, format_name: str, specified: Units | None, label: str) -> Motion:
    """Convert the samples of a trace to SI units, without differentiation.

    Units are stated by the format, by the file or by the user. Otherwise `assumed_units` returns
    the only permitted assumption, or raises an error.

    Raises
    ------
    RecordError
        The units are unknown, or the units in the file contradict the units of the user.
    """
    declared = declared_units(trace, format_name, label, specified)
    stated_quantity = trace.stats.get("tdint_quantity") or (
        named_quantity(label) if format_name == "MSEED" and not declared else ""
    )
    if specified and stated_quantity and stated_quantity != specified.quantity:
        raise RecordError(
            f"{label}: the file or its name states that its values are of the quantity "
            f"{stated_quantity}, but "
            f"the specified unit {specified.text} is a unit of {specified.quantity}; specify a "
            f"unit of {stated_quantity}"
        )
    if declared:
        return _convert_by_file_units(trace, declared, specified, label)
    # The file states no units. The samples may be counts, which require the value of a single
    # count.
    calibration = float(trace.stats.calib)
    if are_counts(trace) and not (specified and specified.has_factor):
        if specified:
            raise RecordError(
                f'{label}: the samples are counts; write "1 {specified.text}" if one count is 1 '
                f"{specified.text}, otherwise {_SPECIFY_COUNT_OR_RESPONSE}"
            )
        factor_without_unit = (
            ""
            if calibration == 1.0
            else f" (the header's calibration factor {calibration:g} has no unit)"
        )
        raise RecordError(
            f"{label}: the samples are counts of a recorder, not an acceleration"
            f"{factor_without_unit}; {_SPECIFY_COUNT_OR_RESPONSE}"
        )
    notes = (
        []
        if calibration == 1.0
        else [f"the header's calibration factor {calibration:g} is not applied: no unit"]
    )
    if specified:
        return Motion(
            _scaled(trace.data, specified.scale),
            specified.text,
            "given",
            specified.quantity,
            tuple(notes),
        )
    units, warning = assumed_units(trace, format_name, label)
    samples = _scaled(trace.data, units.scale)
    return Motion(samples, units.text, "assumed", notes=tuple(notes), warnings=(warning,))


def are_counts(trace: Any) -> bool:
    """Return True if the samples of a trace are counts of a recorder.

    Samples are counts if their type is an integer, or if the header of a TIMESERIES file states
    counts.
    """
    return trace.data.dtype.kind in "iu" or _ascii_unit(trace) in ("COUNTS", "COUNT")


def are_whole(samples: NDArray[Any]) -> bool:
    """Return True if all samples are whole numbers, and not all are zero."""
    return bool(np.any(samples)) and not np.any(samples % 1.0)


def declared_units(
    trace: Any, format_name: str, label: str, specified: Units | None = None
) -> Declared | None:
    """Return the units of the samples stated in a file; None if the file states none.

    Readers of tdint store the units in `trace.stats.tdint_units`, as text for `parse_units` (empty
    if the user must specify them). Recorder formats have a calibration factor, and text formats
    have units in their header.

    Raises
    ------
    RecordError
        The file states that its samples are not a ground motion, or are not evenly spaced.
    """
    stats = trace.stats
    if units_from_reader := stats.get("tdint_units"):
        return Declared(parse_units(units_from_reader), stats.get("tdint_units_from", "file"))
    # Files exported by tdint state their units by the location code. Other networks may use the
    # same code for other instruments, which their channel codes identify.
    if (
        format_name == "MSEED"
        and stats.location in UNITS_BY_LOCATION
        and not re.fullmatch(_OTHER_INSTRUMENT, stats.channel)
    ):
        return Declared(parse_units(UNITS_BY_LOCATION[stats.location]))
    if format_name in _FORMATS_WITH_CALIBRATION:
        units = Units("m/s^2", 1.0, has_factor=False)
        return Declared(units, "format", float(stats.calib), remove_mean=True)
    if "sac" in stats:
        # Reject SAC files that are not an evenly sampled acceleration according to their header
        # (SAC manual, IDEP).
        sac = stats.sac
        quantities = {_SAC_DISPLACEMENT: "displacement", _SAC_VELOCITY: "velocity"}
        quantity = quantities.get(sac.get("idep"))
        if quantity and not (specified and specified.quantity == quantity):
            raise RecordError(
                f"{label}: the SAC header states that the samples are a {quantity}, not an "
                f"acceleration; specify their units ({_UNITS_EXAMPLES[quantity]}), and the "
                "acceleration is computed as their derivative"
            )
        if sac.get("iftype", _SAC_TIME_SERIES) != _SAC_TIME_SERIES or not sac.get("leven", True):
            raise RecordError(
                f"{label}: the SAC file is not an evenly sampled time series; resample it to equal "
                "steps first"
            )
    unit = _ascii_unit(trace)
    if unit in ("", "COUNTS", "COUNT"):
        return None
    try:
        return Declared(parse_units(unit))
    except UsageError:
        raise RecordError(
            f"{label}: the header states the units {unit[:40]}, which are not units of a ground "
            "motion; specify the units of the samples"
        ) from None


def _convert_by_file_units(
    trace: Any, declared: Declared, specified: Units | None, label: str
) -> Motion:
    """Convert samples to SI units by the units stated in the file. RecordError is raised if the
    units of the user differ.
    """
    units = declared.units
    if specified and not (
        isclose(specified.scale, units.scale, rel_tol=1e-9) and specified.quantity == units.quantity
    ):
        raise RecordError(
            f"{label}: the file states its units ({units.text}), but {specified.text} is "
            "specified; remove the specified units"
        )
    samples, notes = trace.data, []
    if declared.remove_mean:
        samples, note = without_mean(samples)
        notes.append(note)
    if declared.factor != 1.0:
        notes.append(
            f"counts converted to m/s^2 by the calibration factor of the file {declared.factor:.6g}"
        )
        units = units._replace(text=f"{declared.factor:.6g} {units.text}")
    scale = declared.factor * declared.units.scale
    return Motion(
        _scaled(samples, scale), units.text, declared.origin, units.quantity, tuple(notes)
    )


class Moving(NamedTuple):
    """Acceleration of a ground that moves with given displacements or velocities, m/s^2, with notes
    on its start and warnings on the rounding of the samples."""

    acceleration: NDArray[Any]
    notes: list[str]
    warnings: list[str]


def moved(samples: Array, dt: float, quantity: str) -> Moving:
    """Return the acceleration, linear between the samples, of the ground motion with given
    displacements (m) or velocities (m/s) at all samples.

    The displacement is then a cubic spline through the samples. The error of a frequency w is of
    the order (w dt)^4. Rounded samples cause accelerations of the order of the unit of rounding
    over dt^2 (displacements) or dt.

    Raises
    ------
    RecordError
        There are fewer than four samples.
    """
    from scipy.interpolate import CubicSpline  # few records are displacements

    if samples.size < _MIN_SPLINE_SAMPLES:
        raise RecordError(
            f"a {quantity} must have at least {_MIN_SPLINE_SAMPLES} samples, got {samples.size}"
        )
    if not np.isfinite(samples).all():  # reported by `check_finite`
        return Moving(samples, [], [])
    time = dt * np.arange(samples.size)
    with np.errstate(over="ignore", invalid="ignore"):  # reported by `check_finite`
        motion = CubicSpline(time, samples)
        if quantity == "velocity":
            motion = CubicSpline(time, motion.antiderivative()(time))
        velocity, acceleration = motion(time, 1), motion(time, 2)
    notes = [f"the {quantity} of the file is the motion of the ground: {_SPLINE_NOTE}"]
    if abs(velocity[0]) > _REST * max_absolute(velocity):
        notes.append(
            f"the ground starts with a velocity of {velocity[0]:.3g} m/s, and the building moves "
            "with it; give `initial: {velocity: ...}` relative to the ground if it does not"
        )
    return Moving(acceleration, notes, _rounding_warnings(samples, dt, quantity, acceleration))


def _rounding_warnings(samples: Array, dt: float, quantity: str, acceleration: Array) -> list[str]:
    """Return a warning if the rounding of the samples contributes to the peak acceleration. The
    unit of rounding is the smallest difference between two values."""
    steps = np.diff(np.unique(samples))
    gain, power = _ROUNDING_GAINS[quantity]
    unit = float(np.min(steps, initial=np.inf)) if steps.size else 0.0
    contribution, peak = gain * unit / dt**power, max_absolute(acceleration)
    if not _NOTICED_ROUNDING * peak < contribution < np.inf:
        return []
    return [
        f"the {quantity} of the file is rounded to {unit:.2g} {'m/s' if power == 1 else 'm'}; this "
        f"contributes up to {contribution:.2g} m/s^2 to accelerations (peak {peak:.3g} m/s^2); use "
        "samples with more digits, or a low-pass filter"
    ]


def without_mean(samples: NDArray[Any]) -> tuple[Array, str]:
    """Return the counts of a recorder without their mean (the zero offset), shape (samples,), and
    a note that states the mean."""
    mean = float(np.mean(samples, dtype=np.float64))
    return samples - mean, f"the recorder's zero offset, the mean of {mean:.6g} counts, is removed"


def _scaled(samples: NDArray[Any], factor: float) -> Array:
    """Return samples multiplied by a factor, as floating-point numbers."""
    # Overflow is found by `check_finite`, which reports the sample.
    with np.errstate(over="ignore"):
        return np.asarray(samples, dtype=np.float64) * factor


def _ascii_unit(trace: Any) -> str:
    """Return the unit in the header of a TIMESERIES file; empty if the header states no unit."""
    unit = str(trace.stats.get("ascii", {}).get("unit", "")).upper()
    # Without a unit, ObsPy returns the last word of the header, which is the number type.
    return "" if re.fullmatch(r"INTEGER|INT\d+|FLOAT\d*|DOUBLE|ASCII|UNKNOWN", unit) else unit


_ACCELEROMETER = "N"  # second letter of the SEED channel code of an accelerometer
_OTHER_INSTRUMENT = r"[A-Z][HLGMPD][A-Z0-9]"
"""Pattern of channel codes of instruments other than accelerometers. Ground motions written by
tdint may also have the direction as channel code (067, EW)."""

_MAX_PLAUSIBLE_ACCELERATION = 3.0 * STANDARD_GRAVITY
"""m/s^2; slightly more than the maximum ground acceleration ever recorded."""

_NEAR_GRAVITY = 0.05  # fraction of g; tolerance for gravity plus the offset of a sensor
_GRAVITIES = {1.0: "gravity in g", STANDARD_GRAVITY: "gravity"}
"""Means of a sensor that also records gravity, with their description in messages."""

_SPECIFY_UNITS = "specify the units, for example `units={}`"
_ANY_UNITS = _SPECIFY_UNITS.format("g") + ", cm/s^2 or m/s^2"


def assumed_units(trace: Any, format_name: str, label: str) -> tuple[Units, str]:
    """Return m/s^2 for floating-point MiniSEED of an accelerometer channel, and a warning.

    `to_motion` has refused samples of integer type before, and `check_finite` samples that are not
    finite.

    Raises
    ------
    RecordError
        The file has another format or channel, or its numbers are unlikely to be in m/s^2.
    """
    code = str(trace.stats.channel).upper()
    peak = max_absolute(trace.data)
    likely = likely_units(peak)
    # The empty text in `tdint_units` means that the user must specify the units.
    is_whole = are_whole(trace.data)
    if "sac" in trace.stats and (is_whole or re.fullmatch(_OTHER_INSTRUMENT, code)):
        evidence = "all are whole numbers" if is_whole else f"{code} is no accelerometer"
        problem = (
            f"the file does not state the units of its samples, and {evidence}: probably counts; "
            f"{_SPECIFY_COUNT_OR_RESPONSE}"
        )
        likely = "0.001 cm/s^2"
    elif format_name != "MSEED" or trace.stats.get("tdint_units") == "":
        problem = f"the file does not state the units of its samples; {_ANY_UNITS}"
    elif len(code) != 3 or code[1] != _ACCELEROMETER:
        problem = (
            "MiniSEED does not state the units of its samples, and m/s^2 is assumed only for "
            "accelerometer channels (?N?, such as HNE), not for "
            f"{code or 'a channel without a code'}; {_ANY_UNITS}"
        )
    else:
        # Reject numbers that are unlikely to be a ground acceleration in m/s^2.
        why_unlikely, likely = _why_unlikely(trace, label)
        if not why_unlikely:
            peaks = {unit: peak * parse_units(unit).scale for unit in ("m/s^2", "cm/s^2", "g")}
            # A recorded peak is above 1e-3 m/s^2.
            possible = " or ".join(
                f"{value / STANDARD_GRAVITY:.3g} g in {unit}"
                for unit, value in peaks.items()
                if 1e-3 <= value <= _MAX_PLAUSIBLE_ACCELERATION
            )
            return Units("m/s^2", 1.0, has_factor=False), (
                "m/s^2 is assumed for floating-point MiniSEED of an accelerometer channel, which "
                f"states no units; the peak is {possible or 'unusual'}: specify the units to "
                "confirm"
            )
        problem = (
            "MiniSEED does not state the units of its samples, and m/s^2 is unlikely: "
            f"{why_unlikely}; {_SPECIFY_UNITS.format(likely)}"
        )
    raise IncompleteRecord(f"{label}: {problem}", Missing(units=likely))


_PROCESSED = r"(?i)\.(ACC|VEL|DIS)\.(?:MP|CV|AP)\b"
"""Part of the names of processed files of ESM and ITACA, in cm/s^2, cm/s or cm: the quantity, and
the type of processing (manual, converted or automatic)."""

_WORDS = r"(?i)(?<![A-Z])(?:(VEL(?:OCITY)?)|(DISP?(?:L(?:ACEMENT)?)?))(?![A-Z])"
"""Abbreviations of velocity and displacement in the name of a file."""

_MAX_VELOCITY, _MAX_DISPLACEMENT = 10.0, 30.0
"""m/s and m; three times the maximum velocity and displacement of the ground ever recorded (3.2 m/s
and 9 m), because the baseline of a record may not be corrected."""

_MAX_JUMP = 2.0  # ratio of the first sample to the second; a larger ratio is no part of a pulse


def named_quantity(label: str) -> str:
    """Return the quantity that the name of a file states: `velocity` or `displacement`; empty if it
    states none.

    Parameters
    ----------
    label : str
        Name of the file, which may precede a colon and the channel.
    """
    name = label.split(": ")[0].replace("\\", "/").rpartition("/")[2]
    match = re.search(_PROCESSED, name)
    if match:
        return {"VEL": "velocity", "DIS": "displacement"}.get(match[1].upper(), "")
    match = re.search(_WORDS, name)
    return ("velocity" if match[1] else "displacement") if match else ""


def _why_unlikely(trace: Any, label: str) -> tuple[str, str]:
    """Return the reason why the samples of a trace are unlikely to be an acceleration in m/s^2, and
    the units that are likely; both are empty if the samples may be in m/s^2.

    The integrals are computed without the means of the acceleration and the velocity, so that an
    offset of the sensor does not matter.
    """
    name = label.split(": ")[0]
    quantity = named_quantity(label)
    unit = {"velocity": "m/s", "displacement": "m"}.get(quantity, "m/s^2")
    if re.search(_PROCESSED, name):
        return "the name is that of a processed file of ESM or ITACA", f"c{unit}"
    if quantity:
        return f"the name of the file states that the samples are a {quantity}", unit
    samples = np.asarray(trace.data, dtype=np.float64)
    peak, mean = max_absolute(samples), float(np.mean(samples))
    gravity = next((g for g in _GRAVITIES if abs(abs(mean) - g) <= _NEAR_GRAVITY * g), 0.0)
    if peak > _MAX_PLAUSIBLE_ACCELERATION:
        return f"the peak would be {peak:.4g} m/s^2, over 3 g", "cm/s^2"
    if gravity:
        return f"the mean is {mean:.5g}, probably {_GRAVITIES[gravity]}", (
            "g" if gravity == 1.0 else "m/s^2"
        )
    if are_whole(samples):
        return (
            "all samples are whole numbers, probably counts",
            "0.001 cm/s^2",
        )
    dt = float(trace.stats.delta)
    velocity = np.cumsum(samples - mean) * dt
    velocity -= np.mean(velocity)
    pgv = max_absolute(velocity)
    displacement = np.cumsum(velocity) * dt
    displacement -= np.linspace(displacement[0], displacement[-1], displacement.size)
    pgd = max_absolute(displacement)
    if pgv > _MAX_VELOCITY or pgd > _MAX_DISPLACEMENT:
        return (
            f"the peak velocity would be {pgv:.3g} m/s and the peak displacement {pgd:.3g} m",
            "cm/s^2",
        )
    return "", ""


def first_sample_warnings(acceleration: Array) -> tuple[str, ...]:
    """Return a warning if the first sample is the peak, as if it were a number of the header."""
    sizes = np.abs(acceleration[:2])
    is_peak = sizes.size == 2 and sizes[0] > _MAX_JUMP * sizes[1]
    if not is_peak or sizes[0] < max_absolute(acceleration):
        return ()
    return (
        f"the first sample, {acceleration[0]:.4g} m/s^2, is the peak of the record: check that it "
        "is not a number of the header (a count, a flag or the sampling interval)",
    )
