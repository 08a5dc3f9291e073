"""Units of measure that model files, records and the command line may use, as factors to SI."""

from __future__ import annotations

import re
import sys
from collections.abc import Callable
from dataclasses import dataclass, replace
from math import isfinite
from typing import Any, get_args, get_type_hints

from tdint.errors import UsageError, did_you_mean
from tdint.written_numbers import number_text

STANDARD_GRAVITY = 9.80665
"""Standard gravity, m/s^2 (CGPM 1901)."""

_INCH = 0.0254  # m, by definition (1959)
_POUND = 0.45359237  # kg, by definition (1959)
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
    """Understand units of a ground motion with an optional factor before them: `gal`, `cm/s^2`,
    `2.38e-6 m/s^2`.

    Case, blanks and the way of writing the square of the second (s^2, s2, s**2, s/s, sec^2) are
    free; `g` is the standard gravity. A velocity's or a displacement's unit (`cm/s`, `cm`) says
    that the samples are one.

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
        # Accelerations alone are offered: that is what most records are.
        hint = did_you_mean(unit, ACCELERATION, cutoff=0.75)
        allowed = ", ".join(ACCELERATION)
        raise UsageError(
            f"units {words[:40]!r}: use one of {allowed}, with a factor before it for counts{hint}"
        )
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


_MIN_DRIFT, _MAX_DRIFT = 1e-60, 1e60
"""Limits of a drift, a ratio or in m; products of numbers within them neither vanish nor overflow
(`tdint.written_numbers.SMALLEST`)."""


def parse_drift(text: str) -> DriftSize:
    """Understand a drift: a drift ratio (`0.02`, `2%`), a length (`20mm`), or a multiple of the
    yield drift (`4dy`).

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
            f"drift {text!r}: write a drift ratio (0.02 or 2%), a length ({units}: 20mm), or a "
            "multiple of the yield drift (4dy)"
        )
    factor, kind = _DRIFT_UNITS[unit]
    value = float(number[0]) * factor
    if not _MIN_DRIFT <= value <= _MAX_DRIFT:
        raise UsageError(
            f"drift {text!r}: must be a positive number between {_MIN_DRIFT:g} and {_MAX_DRIFT:g}"
        )
    if kind == "ratio" and value > 1.0:
        # 2 for 2 % is the usual slip.
        hint = "" if unit else f"; a number without a unit is one, did you mean {words}%?"
        raise UsageError(f"drift {text!r}: a drift ratio is 1 at most{hint}")
    return DriftSize(words, value, kind)


def canonical(name: str) -> str:
    """The spelling that `GROUND_MOTION` uses, if there is one."""
    plain = (
        "".join(name.split())
        .lower()
        .lstrip("*")
        .replace("²", "^2")
        .replace("sec", "s")
        .replace("**", "^")
    )
    plain = re.sub(r"/(s/s|s2|\(s\^2\))$", "/s^2", plain)
    return "gal" if plain == "gals" else plain


def parse_with_unit(text: str, quantity: str, example: str, key: str = "") -> float:
    """A number with its unit, of a quantity of `GROUND_MOTION`, in SI units; one without a unit is
    refused.

    Parameters
    ----------
    example, key : str
        How it is written and what it is called, for messages.

    Raises
    ------
    UsageError
        It is none.
    """
    try:
        units = parse_units(text)
    except UsageError:
        units = None
    if units is None or not units.has_factor or units.quantity != quantity:
        raise UsageError(
            f"{key} must be a number with its unit, such as {example}, got {text[:40]!r}".lstrip()
        )
    return units.scale


# ---- What a number of a result is: its unit, its meaning and where it comes from, declared once,
# where its field is

_SHORT = {"1": "", "text": "", "degree": "_deg", "Hz": "_hz"}


def suffix(unit: str) -> str:
    """The end of a name that says a unit: `_m_s2` for m/s^2, `_kipin` for kip*in; none for a number
    without a unit and for words (`text`)."""
    return _SHORT.get(unit, "_" + unit.replace("*", "").replace("^", "").replace("/", "_"))


@dataclass(frozen=True)
class Quantity:
    """A number of a result, or an array of them, as the annotation of its field.

    Attributes
    ----------
    unit : str
        In SI; 1 for a number without a unit, `text` for words.
    meaning : str
        What it is, for people.
    value : callable or None
        What gives it from what the class that declares it says; None where it is just put there.
    shown : tuple of str
        Where it appears, in words of that class.
    called : str
        Its name in columns and keys, where these say more than the field.
    name : str
        Of the field; filled in by `quantities`.
    kind : type
        Of a value: float, int or str; told where it does not follow from the field's annotation, an
        array.
    """

    unit: str
    meaning: str
    value: Callable[..., Any] | None = None
    shown: tuple[str, ...] = ("table", "summary")
    called: str = ""
    name: str = ""
    kind: type = float

    @property
    def column(self) -> str:
        """Its name with its unit, as in the header of a table."""
        return (self.called or self.name) + suffix(self.unit)


def quantities(declaring: type) -> tuple[Quantity, ...]:
    """The quantities among the fields and properties of a class, in the order of its `columns`, if
    it has those, else in that in which they stand."""
    # Functions in annotations look for names in the modules where they stand, and not in the class.
    place: dict[str, Any] = {}
    hints: dict[str, Any] = {}
    for base in reversed(declaring.__mro__):
        place |= vars(sys.modules[base.__module__])
    hints |= get_type_hints(declaring, place, include_extras=True)
    for name, member in vars(declaring).items():
        if isinstance(member, property) and "Quantity" in str(
            member.fget.__annotations__.get("return", "")
        ):
            hints[name] = get_type_hints(member.fget, place, include_extras=True)["return"]
    declared = []
    for name in getattr(declaring, "columns", hints):
        hint = hints[name]
        for stated in getattr(hint, "__metadata__", ()):
            if isinstance(stated, Quantity):
                kind = (*get_args(hint.__origin__), hint.__origin__)[0]
                declared.append(
                    replace(stated, name=name, kind=kind if kind in (int, str) else stated.kind)
                )
    return tuple(declared)


# ---- Units that results are written in, in place of SI: how names of columns and keys, and
# numbers, change with them

_MASSES = {"kN": "t", "MN": "t", "lbf": "lb", "kip": "kip*s^2/ft"}
"""Unit of mass in texts and reports for a unit of force. Default: kg."""


def mass_beside(force: str, length: str) -> str:
    """Return the unit of mass that belongs to units of force and length, for texts and reports."""
    return "kip*s^2/in" if (force, length) == ("kip", "in") else _MASSES.get(force, "kg")


_QUANTITIES = {
    "length": LENGTH,
    "force": FORCE,
    "mass": MASS,
    "velocity": VELOCITY,
    "acceleration": ACCELERATION,
}
_UNITS = {unit: quantity for quantity, units in _QUANTITIES.items() for unit in units}


@dataclass(frozen=True)
class OutputUnits:
    """Units of lengths, forces, masses, velocities and accelerations; what has none here stays in
    SI.

    A velocity or an acceleration without a unit of its own is in that of the length per s or s^2.
    """

    length: str = "m"
    force: str = "N"
    mass: str = "kg"
    velocity: str = ""
    acceleration: str = ""

    def __str__(self) -> str:
        return ",".join(
            filter(None, (self.force, self.length, self.mass, self.velocity, self.acceleration))
        )

    def unit(self, si: str) -> tuple[str, float]:
        """The unit that stands for an SI unit, and its value in SI: `unit("m/s^2")` is `("g",
        9.80665)`."""
        length, force = LENGTH[self.length], FORCE[self.force]
        chosen = {
            "m": (self.length, length),
            "m/s": (self.velocity or f"{self.length}/s", VELOCITY.get(self.velocity, length)),
            "m/s^2": (
                self.acceleration or f"{self.length}/s^2",
                ACCELERATION.get(self.acceleration, length),
            ),
            "N": (self.force, force),
            "kg": (self.mass, MASS[self.mass]),
            "N/m": (f"{self.force}/{self.length}", force / length),
            "J": (f"{self.force}*{self.length}", force * length),
            "N*m": (f"{self.force}*{self.length}", force * length),
        }
        # Nobody writes N*m for an energy.
        if (self.force, self.length) == ("N", "m"):
            chosen["J"] = ("J", 1.0)
        return chosen.get(si, (si, 1.0))

    def of(self, value: Any, si: str) -> Any:
        """A number or an array that is given in an SI unit, in the unit that stands for it."""
        return value / self.unit(si)[1]

    def text(self, value: float, si: str) -> str:
        """Return a number with its unit for people, with four significant digits.

        A mass is in the unit that belongs to the unit of force, unless another unit of mass was
        chosen: t for kN, kip*s^2/in for kip and in.
        """
        units = replace(self, mass=self.mass_beside) if si == "kg" else self
        return f"{number_text(units.of(value, si))} {units.unit(si)[0]}"

    @property
    def mass_beside(self) -> str:
        """Unit of mass in texts and reports: the chosen unit, or the one that belongs to the unit
        of force."""
        return mass_beside(self.force, self.length) if self.mass == "kg" else self.mass

    def label(self, si: str) -> str:
        """The unit that stands for an SI unit, as an axis of a picture has it: m/s², kip·in."""
        return self.unit(si)[0].replace("^2", "²").replace("*", "·")

    @property
    def in_pictures(self) -> OutputUnits:
        """The units that pictures are drawn in: accelerations in g, as people think of them, unless
        a unit is named."""
        return self if self.acceleration else replace(self, acceleration="g")

    def column(self, name: str, unit: str) -> tuple[str, float]:
        """The name of a column or key in an SI unit with the unit that it has here, and the value
        of that unit in SI.

        `column("peak_shear_N", "N")` is `("peak_shear_kip", 4448.22...)`. A product of units is
        written without a sign: an energy in kip*in ends in `kipin`, a stiffness in kip/in in
        `kip_in`. A name that does not say its unit stays.
        """
        shown, factor = self.unit(unit)
        error = "_error" * name.endswith("_error")
        bare, end = name.removesuffix("_error"), suffix(unit)
        if shown == unit or not end or not bare.endswith(end):
            return name, factor
        return f"{bare.removesuffix(end)}{suffix(shown)}{error}", factor


SI = OutputUnits()


def parse_output_units(text: str, others: OutputUnits = SI) -> OutputUnits:
    """Understand units of the output, with commas between them: `kip,in,g`, `kN,mm`; `others` stand
    for what is not named.

    Raises
    ------
    UsageError
        An unknown unit, or two of one quantity.
    """
    units: dict[str, str] = {}
    for word in (part.strip() for part in text.split(",")):
        # As it is written first: other spellings are those of ground motions.
        unit = word if word in _UNITS else canonical(word)
        if unit not in _UNITS:
            hint = did_you_mean(word, _UNITS) or f"; known: {', '.join(_UNITS)}"
            raise UsageError(f"output units {text[:60]!r}: unknown unit {word[:40]!r}{hint}")
        quantity = _UNITS[unit]
        if units.setdefault(quantity, unit) != unit:
            raise UsageError(
                f"output units {text[:60]!r}: two units of {quantity}, {units[quantity]} and {unit}"
            )
    return replace(others, **units)
