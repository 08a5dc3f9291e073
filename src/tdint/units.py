"""Units of measure that model files, records and the command line may use, as factors to SI."""

from __future__ import annotations

import re
from dataclasses import dataclass
from math import isfinite

from tdint.errors import UsageError, did_you_mean

STANDARD_GRAVITY = 9.80665
"""Standard gravity, m/s^2 (CGPM 1901)."""

_INCH = 0.0254
_POUND = 0.45359237
_POUND_FORCE = _POUND * STANDARD_GRAVITY

LENGTH = {"m": 1.0, "cm": 0.01, "mm": 0.001, "in": _INCH, "ft": 12.0 * _INCH}
FORCE = {"N": 1.0, "kN": 1e3, "MN": 1e6, "lbf": _POUND_FORCE, "kip": 1e3 * _POUND_FORCE}
MASS = {
    "kg": 1.0,
    "t": 1e3,
    "lb": _POUND,
    "kip*s^2/in": 1e3 * _POUND_FORCE / _INCH,
    "kip*s^2/ft": 1e3 * _POUND_FORCE / (12.0 * _INCH),
}
ACCELERATION = {
    "m/s^2": 1.0,
    "cm/s^2": 0.01,
    "gal": 0.01,
    "mm/s^2": 0.001,
    "g": STANDARD_GRAVITY,
    "in/s^2": _INCH,
    "ft/s^2": 12.0 * _INCH,
}
VELOCITY = {f"{unit}/s": factor for unit, factor in LENGTH.items()}
GROUND_MOTION = {"acceleration": ACCELERATION, "velocity": VELOCITY, "displacement": LENGTH}
"""Quantities that the samples of a record may be, and their units."""

_NUMBER = re.compile(r"[-+]?(\d+\.?\d*|\.\d+)(e[-+]?\d+)?", re.IGNORECASE)


@dataclass(frozen=True)
class Units:
    """Units of a ground motion as someone wrote them.

    Attributes
    ----------
    text : str
        As it was written.
    scale : float
        Value of one sample in SI units.
    has_factor : bool
        Whether a number stood before the unit, so that even a count has a value.
    quantity : str
        A key of `GROUND_MOTION`.
    """

    text: str
    scale: float
    has_factor: bool
    quantity: str = "acceleration"


def parse_units(text: str) -> Units:
    """Understand units of a ground motion with an optional factor before them: `gal`, `cm/s^2`, `2.38e-6 m/s^2`.

    Case, blanks and the way of writing the square of the second (s^2, s2, s**2, s/s, sec^2) are free; `g` is the
    standard gravity. A velocity's or a displacement's unit (`cm/s`, `cm`) says that the samples are one.

    Raises
    ------
    UsageError
        The unit is unknown, or the factor is not a positive number.
    """
    if not isinstance(text, str):
        raise UsageError(f"units are a text such as 'm/s^2', got {text!r}")
    words = text.strip()
    number = _NUMBER.match(words)
    factor = float(number[0]) if number else 1.0
    unit = canonical(words[number.end() :] if number else words)
    quantity = next((name for name, units in GROUND_MOTION.items() if unit in units), None)
    if quantity is None:
        hint = did_you_mean(unit, ACCELERATION, cutoff=0.75)
        allowed = ", ".join(ACCELERATION)
        raise UsageError(f"units {words[:40]!r}: use one of {allowed}, with a factor before it for counts{hint}")
    if not (isfinite(factor) and factor > 0.0):
        raise UsageError(f"units {words[:40]!r}: the factor must be a positive number")
    return Units(words, factor * GROUND_MOTION[quantity][unit], number is not None, quantity)


@dataclass(frozen=True)
class DriftSize:
    """A drift as someone wrote it.

    Attributes
    ----------
    text : str
        As it was written.
    value : float
        The number, positive; of a length in m.
    kind : str
        What it is a number of: `ratio` (drift over story height), `length`, or `yield drift`.
    """

    text: str
    value: float
    kind: str


_DRIFT_UNITS = {"": (1.0, "ratio"), "%": (0.01, "ratio"), "dy": (1.0, "yield drift")} | {
    unit: (factor, "length") for unit, factor in LENGTH.items()
}


def parse_drift(text: str) -> DriftSize:
    """Understand a drift: a drift ratio (`0.02`, `2%`), a length (`20mm`), or a multiple of the yield drift (`4dy`).

    Raises
    ------
    UsageError
        Neither of these, not positive, or a drift ratio above 1.
    """
    words = "".join(text.split())
    number = _NUMBER.match(words)
    unit = words[number.end() :] if number else words
    if number is None or unit not in _DRIFT_UNITS:
        units = ", ".join(LENGTH)
        raise UsageError(
            f"drift {text!r}: write a drift ratio (0.02 or 2%), a length ({units}: 20mm), or a multiple of the yield "
            "drift (4dy)"
        )
    factor, kind = _DRIFT_UNITS[unit]
    value = float(number[0]) * factor
    if not (isfinite(value) and value > 0.0):
        raise UsageError(f"drift {text!r}: must be a positive number")
    if kind == "ratio" and value > 1.0:
        hint = "" if unit else f"; a number without a unit is one, did you mean {words}%?"
        raise UsageError(f"drift {text!r}: a drift ratio is 1 at most{hint}")
    return DriftSize(words, value, kind)


def canonical(name: str) -> str:
    """The spelling that `GROUND_MOTION` uses, if there is one."""
    plain = "".join(name.split()).lower().lstrip("*").replace("²", "^2").replace("sec", "s").replace("**", "^")
    plain = re.sub(r"/(s/s|s2|\(s\^2\))$", "/s^2", plain)
    return "gal" if plain == "gals" else plain


def parse_acceleration(key: str, text: str, example: str) -> float:
    """An acceleration in m/s^2; a number without a unit is refused.

    Parameters
    ----------
    key, example : str
        What it is called and how it is written, for messages.

    Raises
    ------
    UsageError
        It is none.
    """
    try:
        units = parse_units(text)
    except UsageError:
        units = None
    if units is None or not units.has_factor or units.quantity != "acceleration":
        raise UsageError(f"{key} must be a number with its unit, such as {example}, got {text[:40]!r}")
    return units.scale
