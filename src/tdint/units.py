"""Units of measure that model files and records may use, as factors to SI."""

from __future__ import annotations

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
}
