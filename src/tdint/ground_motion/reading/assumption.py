"""The one convention about units that is leaned on: floating-point MiniSEED of an accelerometer is in m/s^2.

ObsPy and other programs that remove an instrument's response write what is left as floating-point numbers, in SI units,
under the channel's own code; MiniSEED has no place for the unit. The code of an accelerometer's channel has the letter
N in its second place (SEED manual 2.4, appendix A). Whoever leans on it hears so, and is refused where the numbers
speak against it.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from tdint.errors import RecordError
from tdint.units import STANDARD_GRAVITY, Units

_ACCELEROMETER = "N"
_LARGEST = 3.0 * STANDARD_GRAVITY
"""m/s^2; the largest acceleration of the ground ever recorded is a little less."""

_NEAR = 0.05
_GRAVITIES = {1.0: "gravity in g", STANDARD_GRAVITY: "gravity"}
_CURE = "say what the samples are with units, such as g, cm/s^2 or m/s^2"


def assumed_units(trace: Any, format_name: str, label: str) -> tuple[Units, str]:
    """Take floating-point samples of an accelerometer's channel in a MiniSEED file as m/s^2; also a warning about it.

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
            f"{label}: MiniSEED does not tell the units of its samples, and {code or 'a channel without a code'} "
            f"is no accelerometer's channel (HN?, BN?), whose samples would be taken as m/s^2; {_CURE}"
        )
    if doubt := _doubt(np.asarray(trace.data, dtype=np.float64)):
        raise RecordError(
            f"{label}: MiniSEED does not tell the units of its samples, and m/s^2 is unlikely: {doubt}; {_CURE}"
        )
    return Units("m/s^2", 1.0, False), (
        "m/s^2 is assumed for floating-point samples of an accelerometer's channel in MiniSEED, which has no units; "
        "give them to be sure"
    )


def _doubt(samples: np.ndarray[Any, np.dtype[np.float64]]) -> str:
    """Why samples can hardly be a ground acceleration in m/s^2, empty if they can."""
    peak, mean = float(np.max(np.abs(samples))), float(np.mean(samples))
    if peak > _LARGEST:
        return f"the largest would be {peak:.4g} m/s^2, over 3 g"
    for gravity, name in _GRAVITIES.items():
        if abs(abs(mean) - gravity) <= _NEAR * gravity:
            return f"their mean is {mean:.5g}, {name} by its look"
    if peak and not np.any(samples % 1.0):
        return "all are whole numbers, counts by their look"
    return ""
