"""From a file's samples to m/s^2: what the user says about their units, what the file says, and what is done."""

from __future__ import annotations

import re
from dataclasses import dataclass
from math import isclose
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tdint.errors import RecordError, UsageError
from tdint.units import Units, parse_units

_CURES = (
    'give the value of one count as units ("2.38e-6 m/s^2") or the instrument\'s StationXML file as inventory, '
    "which removes its response"
)
_SELF_SCALED = ("KNET", "KINEMETRICS_EVT")
"""Formats whose `stats.calib` turns counts into m/s^2, once the recorder's zero offset is taken off."""

_SAC_DISPLACEMENT, _SAC_VELOCITY, _SAC_TIME_SERIES = 6, 7, 1


@dataclass(frozen=True)
class Declared:
    """What a file says about its own samples: an acceleration is (sample - mean, if `remove_mean`) x factor x units."""

    units: Units
    factor: float = 1.0
    remove_mean: bool = False


def to_acceleration(
    trace: Any, format_name: str, wanted: Units | None, label: str
) -> tuple[NDArray[np.float64], tuple[str, ...]]:
    """Convert a trace's samples to m/s^2, applying every factor exactly once.

    Parameters
    ----------
    trace : obspy.Trace
        Samples as they stand in the file.
    format_name : str
        ObsPy's name of the file's format.
    wanted : Units or None
        What the user says the samples are.
    label : str
        File and channel, for messages.

    Returns
    -------
    acceleration : ndarray, shape (samples,)
        m/s^2.
    notes : tuple of str
        What was assumed or done.

    Raises
    ------
    RecordError
        The samples are counts of unknown value, no acceleration, or the file contradicts the user.
    """
    declared = declared_units(trace, format_name, label)
    if declared:
        return _by_the_file(trace, declared, wanted, label)
    if wanted is None and trace.stats.get("tdint_units") == "":
        raise RecordError(f"{label}: the file does not tell the units of its samples; give them, such as g or cm/s^2")
    counts = trace.data.dtype.kind in "iu" or _ascii_unit(trace) in ("COUNTS", "COUNT")
    if counts and not (wanted and wanted.has_factor):
        raise RecordError(f"{label}: {_why_refused(trace, wanted)}")
    notes = []
    if wanted is None:
        notes.append("no units given or in the file: the samples are taken as m/s^2")
    calibration = float(trace.stats.calib)
    if calibration != 1.0:
        notes.append(f"the header's calibration factor {calibration:g} is not applied: it has no unit")
    return _times(trace.data, wanted.scale if wanted else 1.0), tuple(notes)


def declared_units(trace: Any, format_name: str, label: str) -> Declared | None:
    """What the file says about its samples' units, None if nothing.

    A reader of tdint's own tells them in `trace.stats.tdint_units`, as text for `parse_units` (empty where the user
    must give them); formats of the recorders have them in their calibration factor, text formats in their header.

    Raises
    ------
    RecordError
        The file says that its samples are no acceleration, or not evenly spaced.
    """
    stats = trace.stats
    own = stats.get("tdint_units")
    if own:
        return Declared(parse_units(own))
    if format_name in _SELF_SCALED:
        return Declared(Units("m/s^2", 1.0, False), float(stats.calib), remove_mean=True)
    if "sac" in stats:
        _refuse_other_sac(stats.sac, label)
    unit = _ascii_unit(trace)
    if unit in ("", "COUNTS", "COUNT"):
        return None
    try:
        return Declared(parse_units(unit))
    except UsageError:
        raise RecordError(f"{label}: the header gives the samples in {unit}, which is no acceleration") from None


def units_in_words(trace: Any, format_name: str, wanted: Units | None, label: str) -> str:
    """Units of a trace's samples and how they are known; parameters are those of `to_acceleration`."""
    declared = declared_units(trace, format_name, label)
    if declared:
        factor = "" if declared.factor == 1.0 else f"{declared.factor:.6g} "
        return f"{factor}{declared.units.text} (file)"
    return f"{wanted.text} (given)" if wanted else "m/s^2 (assumed)"


def _by_the_file(
    trace: Any, declared: Declared, wanted: Units | None, label: str
) -> tuple[NDArray[np.float64], tuple[str, ...]]:
    if wanted and not isclose(wanted.scale, declared.units.scale, rel_tol=1e-9):
        raise RecordError(
            f"{label}: the file itself gives its units ({declared.units.text}), {wanted.text} contradicts them; "
            "leave the units out"
        )
    samples, notes = trace.data, []
    if declared.remove_mean:
        samples, note = without_mean(samples)
        notes.append(note)
    if declared.factor != 1.0:
        notes.append(f"counts turned into m/s^2 with the file's calibration factor {declared.factor:.6g}")
    return _times(samples, declared.factor * declared.units.scale), tuple(notes)


def without_mean(samples: NDArray[Any]) -> tuple[NDArray[np.float64], str]:
    """Take off the recorder's zero offset (the mean of the record); also a note about it."""
    mean = float(np.mean(samples, dtype=np.float64))
    return samples - mean, f"the recorder's zero offset, the mean of {mean:.6g} counts, is removed"


def _times(samples: NDArray[Any], factor: float) -> NDArray[np.float64]:
    with np.errstate(over="ignore"):  # An overflow is found, with its place, among the samples that are not finite.
        return np.asarray(samples, dtype=np.float64) * factor


def _why_refused(trace: Any, wanted: Units | None) -> str:
    if wanted:
        return f'the samples are counts; write "1 {wanted.text}" if one count is 1 {wanted.text}, else {_CURES}'
    calibration = float(trace.stats.calib)
    known = "" if calibration == 1.0 else f" (the header's calibration factor {calibration:g} has no unit)"
    return f"the samples are counts of a recorder, not an acceleration{known}; {_CURES}"


def _ascii_unit(trace: Any) -> str:
    """Unit in the header of a TIMESERIES file, empty if none."""
    unit = str(trace.stats.get("ascii", {}).get("unit", "")).upper()
    # Without a unit ObsPy reports the header's last word, which is the type of the numbers.
    return "" if re.fullmatch(r"INTEGER|INT\d+|FLOAT\d*|DOUBLE|ASCII|UNKNOWN", unit) else unit


def _refuse_other_sac(sac: Any, label: str) -> None:
    """Refuse what a SAC header declares to be something else than an evenly sampled acceleration (SAC manual, IDEP)."""
    other = {_SAC_DISPLACEMENT: "displacement", _SAC_VELOCITY: "velocity"}.get(sac.get("idep"))
    if other:
        raise RecordError(f"{label}: the SAC header says that the samples are a {other}, not an acceleration")
    if sac.get("iftype", _SAC_TIME_SERIES) != _SAC_TIME_SERIES or not sac.get("leven", True):
        raise RecordError(f"{label}: the SAC file is not an evenly sampled time series")
