"""Units of measure in model files, records and on the command line, as factors to SI."""

from __future__ import annotations

import re
import sys
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass, replace
from itertools import product
from math import isclose, isfinite, nan
from typing import Any, NamedTuple, get_args

from tdint.errors import UsageError, did_you_mean
from tdint.number_parsing import LARGEST, SMALLEST, number_text

STANDARD_GRAVITY = 9.80665
"""Standard gravity, m/s^2 (CGPM 1901)."""

_INCH = 0.0254  # m, by definition (1959)
_POUND = 0.45359237  # kg, by definition (1959)
_POUND_FORCE = _POUND * STANDARD_GRAVITY

LENGTH = {"m": 1.0, "cm": 0.01, "mm": 0.001, "in": _INCH, "ft": 12.0 * _INCH}
FORCE = {
    "N": 1.0,
    "kN": 1e3,
    "MN": 1e6,
    "lbf": _POUND_FORCE,
    "kip": 1e3 * _POUND_FORCE,
    "kgf": STANDARD_GRAVITY,
    "tf": 1e3 * STANDARD_GRAVITY,
    "tonf": 1e3 * STANDARD_GRAVITY,
}
"""Units of force. `tf` and `tonf` are both the weight of a metric ton, as in structural analysis
programs."""

MASS = {
    "kg": 1.0,
    "t": 1e3,
    "lb": _POUND,
    "kip*s^2/in": 1e3 * _POUND_FORCE / _INCH,
    "kip*s^2/ft": 1e3 * _POUND_FORCE / (12.0 * _INCH),
    "lbf*s^2/in": _POUND_FORCE / _INCH,
    "blob": _POUND_FORCE / _INCH,
    "slug": _POUND_FORCE / (12.0 * _INCH),
    "kN*s^2/m": 1e3,
    "N*s^2/mm": 1e3,
    "kgf*s^2/m": STANDARD_GRAVITY,
    "tf*s^2/m": 1e3 * STANDARD_GRAVITY,
    "tonf*s^2/m": 1e3 * STANDARD_GRAVITY,
}
ACCELERATION = {
    "m/s^2": 1.0,
    "cm/s^2": 0.01,
    "gal": 0.01,
    "mm/s^2": 0.001,
    "g": STANDARD_GRAVITY,
    "mg": 1e-3 * STANDARD_GRAVITY,
    "%g": 1e-2 * STANDARD_GRAVITY,
    "in/s^2": _INCH,
    "ft/s^2": 12.0 * _INCH,
}
VELOCITY = {f"{unit}/s": factor for unit, factor in LENGTH.items()}
GROUND_MOTION = {"acceleration": ACCELERATION, "velocity": VELOCITY, "displacement": LENGTH}
"""Quantities that the samples of a record may represent, and the units of each quantity."""

_NUMBER = re.compile(r"[-+]?(\d+\.?\d*|\.\d+)(e[-+]?\d+)?", re.IGNORECASE)


_POWER_OF_TEN = r"^(?:[x*\u00d7]\s*)?10\s*(?:\^|\*\*)\s*\(?([-+\u2212]?\d{1,3})\)?"


class Units(NamedTuple):
    """Units of a ground motion.

    Attributes
    ----------
    text : str
        Text as the user wrote it.
    scale : float
        Value of a single sample in SI units.
    has_factor : bool
        True if the text has a number before the unit, which converts counts to the unit.
    quantity : str
        Quantity of the samples, a key of `GROUND_MOTION`.
    """

    text: str
    scale: float
    has_factor: bool
    quantity: str = "acceleration"


def parse_units(text: str) -> Units:
    """Parse the units of a ground motion, with an optional factor before the unit.

    Examples are `gal`, `cm/s^2` and `2.38e-6 m/s^2`. Upper and lower case, blanks, and the notation
    of the squared second (s^2, s2, s**2, s/s, sec^2) are equivalent; `g` is the standard gravity.
    With a unit of velocity or displacement (`cm/s`, `cm`), the samples are velocities or
    displacements.

    Raises
    ------
    UsageError
        The unit is unknown, or the factor is not a positive number.
    """
    stripped = text.strip()
    # A power of ten may be written 10^-3, x10^-3 or 10**-3.
    stripped = re.sub(
        _POWER_OF_TEN, lambda power: f"1e{power[1].replace(chr(0x2212), '-')}", stripped
    )
    number = _NUMBER.match(stripped)
    factor = float(number[0]) if number else 1.0
    unit = canonical(stripped[number.end() :] if number else stripped)
    quantity = next((name for name, units in GROUND_MOTION.items() if unit in units), None)
    if quantity is None:
        # The message lists the units of acceleration only, because most records contain
        # accelerations.
        hint = did_you_mean(unit, ACCELERATION, cutoff=0.75)
        allowed = ", ".join(ACCELERATION)
        raise UsageError(
            f"units {stripped[:40]!r}: use one of {allowed}, with a factor before it for "
            f"counts{hint}"
        )
    if not (isfinite(factor) and factor > 0.0):
        raise UsageError(f"units {stripped[:40]!r}: the factor must be a positive number")
    return Units(stripped, factor * GROUND_MOTION[quantity][unit], number is not None, quantity)


class DriftSize(NamedTuple):
    """Drift on the command line or in a file.

    Attributes
    ----------
    text : str
        Text as the user wrote it.
    value : float
        Positive number; in m if `quantity` is `length`.
    quantity : str
        Meaning of the number: `ratio` (drift divided by story height), `length`, or `yield drift`
        (multiple of the yield drift).
    """

    text: str
    value: float
    quantity: str


_DRIFT_UNITS = {"": (1.0, "ratio"), "%": (0.01, "ratio"), "dy": (1.0, "yield drift")} | {
    unit: (factor, "length") for unit, factor in LENGTH.items()
}


def parse_drift(text: str) -> DriftSize:
    """Parse a drift: a drift ratio (`0.02`, `2%`), a length (`20mm`), or a multiple of the yield
    drift (`4dy`).

    Raises
    ------
    UsageError
        The text has another form, the number is not positive, or a drift ratio is larger than 1.
    """
    compact = "".join(text.split())
    number = _NUMBER.match(compact)
    unit = compact[number.end() :] if number else compact
    if number is None or unit not in _DRIFT_UNITS:
        units = ", ".join(LENGTH)
        raise UsageError(
            f"drift {text!r}: write a drift ratio (0.02 or 2%), a length ({units}: 20mm), or a "
            "multiple of the yield drift (4dy)"
        )
    factor, quantity = _DRIFT_UNITS[unit]
    value = float(number[0]) * factor
    if not SMALLEST <= value <= LARGEST:
        raise UsageError(
            f"drift {text!r}: must be a positive number between {SMALLEST:g} and {LARGEST:g}"
        )
    if quantity == "ratio" and value > 1.0:
        # A usual mistake is 2 instead of 2%.
        hint = (
            "" if unit else f"; a number without a unit is a drift ratio, did you mean {compact}%?"
        )
        raise UsageError(f"drift {text!r}: a drift ratio must be at most 1{hint}")
    return DriftSize(compact, value, quantity)


def canonical(name: str) -> str:
    """Return a unit in the spelling of `GROUND_MOTION`, such as `cm/s^2` for `CM / sec**2`.

    An unknown unit is returned in lower case and without blanks.
    """
    plain = "".join(name.split()).lower().lstrip("*").removesuffix("'s")
    if plain[:1] in ("(", "["):
        plain = plain.strip("()[]")
    for spelling, usual in _SPELLINGS.items():
        plain = plain.replace(spelling, usual)
    plain = re.sub(r"(?:segundos?|segs?|seconds?|secs?|sec)(?=\W|\d|$)", "s", plain)
    plain = re.sub(r"^cms(?=/)", "cm", plain)
    # Replace the other notations of the squared second at the end: m/s/s, m/s2, m/(s^2), m s^-2.
    plain = re.sub(r"(?:/(?:s/s|s2|\(s\^2\))|[.*]?s\^?-2)$", "/s^2", plain)
    plain = re.sub(r"[.*]?s\^?-1$", "/s", plain)
    return _NAMES.get(plain, plain)


_SPELLINGS = {
    "**": "^",
    "²": "^2",
    "⁻": "^-",
    "¹": "1",
    "−": "-",
    "·": "*",
    "^-^": "^-",
    "meters": "m",
    "metres": "m",
    "meter": "m",
    "metre": "m",
}
"""Other spellings of characters and words in a unit, replaced in this order."""

_LENGTH_WORDS = (
    ("micro(?=met)|\N{GREEK SMALL LETTER MU}|\N{MICRO SIGN}", "u"),
    ("nano(?=met)", "n"),
    ("milli(?=met)", "m"),
    ("centi(?=met)", "c"),
    ("kilo(?=met)", "k"),
    (r"met(?:er|re)s?\b", "m"),
    (r"\binch(?:es)?\b", "in"),
    (r"\bf(?:oo|ee)t\b", "ft"),
)
"""Regular expressions of names of units of length, and their symbols, replaced in order."""


def abbreviated(text: str) -> str:
    """Return a unit in lower case with symbols instead of the names of lengths: mm for
    millimeter, ft for feet."""
    for word, symbol in _LENGTH_WORDS:
        text = re.sub(word, symbol, text)
    return text


_NAMES = {
    "gals": "gal",
    "gales": "gal",
    "gs": "g",
    "milli-g": "mg",
    "millig": "mg",
    "milligs": "mg",
    "g's": "g",
}
"""Other names of units."""


def parse_with_unit(text: str, quantity: str, example: str, key: str = "") -> float:
    """Return the value in SI units of a number with a unit. A number without a unit is refused.

    Parameters
    ----------
    quantity : str
        Quantity of the unit, a key of `GROUND_MOTION`.
    key : str
        Name of the option or the key, for the message.

    Raises
    ------
    UsageError
        The text is not a number with a unit of the quantity.
    """
    try:
        units = parse_units(text)
    except UsageError:
        units = None
    # `has_factor` is False for a unit without a number before it.
    if units is None or not units.has_factor or units.quantity != quantity:
        raise UsageError(
            f"{key} must be a number with its unit, such as {example}, got {text[:40]!r}".lstrip()
        )
    return units.scale


def compound_units(force: float, length: float, time: float = 0) -> dict[str, float]:
    """Return the units of force^`force` length^`length` s^`time`, such as kN/cm or kN*s/m, with
    their factors to SI units; empty for a number without a unit."""
    if not (force or length or time):
        return {}
    return {
        compound_unit(f, u, force, length, time): force_factor**force * length_factor**length
        for (f, force_factor), (u, length_factor) in product(FORCE.items(), LENGTH.items())
    }


def compound_unit(
    force_unit: str, length_unit: str, force: float, length: float, time: float = 0
) -> str:
    """Return the text of the unit force^`force` length^`length` s^`time`; empty without a unit."""
    powers = {force_unit: force, length_unit: length, "s": time}
    above, below = (
        [unit if p == 1 else f"{unit}^{p:g}" for unit, n in powers.items() if (p := sign * n) > 0]
        for sign in (1, -1)
    )
    return "/".join(["*".join(above) or "1", *below]) if above or below else ""


def parse_in_units(text: str, units: Mapping[str, float], key: str) -> float:
    """Return the value in SI units of a number with one of the given units, such as `500 kN/cm`.

    Raises
    ------
    UsageError
        The text is not a number with such a unit. `key` is the name of the parameter.
    """
    number = _NUMBER.match(text.strip())
    words = text.strip()[number.end() :].split() if number else []
    unit = next((unit for sign in ("", "*") if (unit := sign.join(words)) in units), None)
    if number is None or unit is None:
        listed = ", ".join([*units][:12])
        raise UsageError(
            f"{key} must be a number in SI units, or a text of a number with a unit ({listed}, "
            f"...), got {text[:40]!r}"
        )
    return float(number[0]) * units[unit]


# ---- Unit, meaning and source of each value of a result, declared with the field of its dataclass

_SHORT = {"1": "", "text": "", "degree": "_deg", "Hz": "_hz"}


def suffix(unit: str) -> str:
    """Return the suffix of a column name for a unit: `_m_s2` for m/s^2, `_kipin` for kip*in.

    The suffix is empty for dimensionless numbers (`1`) and for texts (`text`).
    """
    return _SHORT.get(unit, "_" + unit.replace("*", "").replace("^", "").replace("/", "_"))


@dataclass(frozen=True)
class Quantity:
    """Declaration of a value of a result, or of an array of values, in the annotation of its field.

    Attributes
    ----------
    unit : str
        SI unit; `1` for a dimensionless number, `text` for a text.
    meaning : str
        Description for users.
    value : callable | None
        Function that computes the value from the arguments that the declaring class documents; None
        if the value is assigned directly.
    shown : tuple of str
        Outputs that contain the value, by the names that the declaring class documents.
    called : str
        Name in columns and keys if it differs from the name of the field.
    name : str
        Name of the field; set by `quantities`.
    value_type : type
        Type of a value: float, int or str. It is stated if the annotation of the field does not
        determine it, as for an array.
    """

    unit: str
    meaning: str
    value: Callable[..., Any] | None = None
    shown: tuple[str, ...] = ("table", "summary")
    called: str = ""
    name: str = ""
    value_type: type = float

    @property
    def column(self) -> str:
        """Name with the suffix of the unit, as in the header of a table."""
        return (self.called or self.name) + suffix(self.unit)


def _evaluated(annotation: Any, declaring: type) -> Any:
    """Return an annotation of a class. It is a text if the module of the class imports
    `annotations` from `__future__`; a text with names that only type checkers know remains."""
    if isinstance(annotation, str):
        with suppress(NameError):
            return eval(annotation, vars(sys.modules[declaring.__module__]))
    return annotation


def quantities(declaring: type) -> tuple[Quantity, ...]:
    """Return the `Quantity` objects in the annotations of the fields and properties of a class.

    Such an annotation is `Annotated[float, Quantity("m", "peak drift")]`. The result is in the
    order of the attribute `columns` of the class if it exists, otherwise in the order of
    declaration. The name and the type of each quantity are set from its field.
    """
    hints: dict[str, Any] = {}
    for base in reversed(declaring.__mro__):
        for name, annotation in vars(base).get("__annotations__", {}).items():
            hints[name] = _evaluated(annotation, base)
    # A property declares its quantity in the annotation of the returned value.
    for name, member in vars(declaring).items():
        if isinstance(member, property):
            hints[name] = _evaluated(member.fget.__annotations__.get("return"), declaring)
    declared = []
    for name in getattr(declaring, "columns", hints):
        hint = hints[name]
        for quantity in getattr(hint, "__metadata__", ()):
            if isinstance(quantity, Quantity):
                # For `int | None`, the type of the values is the first member of the union.
                value_type = (*get_args(hint.__origin__), hint.__origin__)[0]
                declared.append(
                    replace(
                        quantity,
                        name=name,
                        value_type=value_type if value_type in (int, str) else quantity.value_type,
                    )
                )
    return tuple(declared)


# ---- Output units: conversion of values and of the names of columns and keys

_MASSES = {"kN": "t", "MN": "t", "lbf": "lb", "kip": "kip*s^2/ft", "tf": "t", "tonf": "t"}
"""Unit of mass in texts and reports for a unit of force. Default: kg."""


def matching_mass_unit(force: str, length: str) -> str:
    """Return the unit of mass that belongs to units of force and length, for texts and reports: t
    for kN and tonf, lb for lbf, kip*s^2/in or kip*s^2/ft for kip, and kg for other units."""
    return "kip*s^2/in" if (force, length) == ("kip", "in") else _MASSES.get(force, "kg")


_QUANTITIES = {
    "length": LENGTH,
    "force": FORCE,
    "mass": MASS,
    "velocity": VELOCITY,
    "acceleration": ACCELERATION,
}
_UNITS = {unit: quantity for quantity, units in _QUANTITIES.items() for unit in units}

_FORCE_WORDS = {"newton": "N", "lb": "lbf", "pound": "lbf", "k": "kip", "kp": "kgf"}
_MASS_WORDS = {
    "kilogram": "kg",
    "tonne": "t",
    "lbm": "lb",
    "pound": "lb",
    "slinch": "blob",
}
"""Other names of units, without the s of the plural. A `ton` is not listed, because it has three
sizes."""

_WORDS = ((FORCE, _FORCE_WORDS), (MASS, _MASS_WORDS))

_MASS_PRODUCT = r"(?i)(\w+?)[-*. ]*s(?:\^2|2)/(\w+)"
"""Mass as a product of force, squared second and length, such as `lb-s2/in`."""


def _size(name: str, factors: Mapping[str, float]) -> float:
    """Return the size in SI units of a unit in another spelling, nan if it is unknown.

    Only units of the quantity with the factors `factors` are recognized.
    """
    words: Mapping[str, str] = next((words for units, words in _WORDS if units is factors), {})
    lower = abbreviated(name.strip().lower())
    by_lower_case = {unit.lower(): unit for unit in factors}
    # m is one thousandth and M is one million: a mN is not a MN, and a mg is not a Mg.
    if name.strip() == "Mg":
        return factors.get("t", nan)
    if lower != "mn":
        for word in (lower, lower.removesuffix("s")):
            if unit := by_lower_case.get(word) or words.get(word):
                return factors[unit]
    return nan


def unit_advice(text: str, factors: Mapping[str, float]) -> str:
    """Return the end of a message about an unknown unit: the known unit of the same size, or all
    known units.

    A unit of another size is not suggested, even if its spelling is similar: the results would be
    wrong by the ratio of the sizes.

    Parameters
    ----------
    factors : mapping of str to float
        Units of the quantity and their factors to SI units, for example `MASS`.
    """
    plain = text[:100].replace("²", "^2").replace("**", "^").replace("·", "*").replace("sec", "s")
    size = _size(plain, factors)
    if factors is MASS and (product := re.fullmatch(_MASS_PRODUCT, plain.strip())):
        size = _size(product[1], FORCE) / _size(product[2], LENGTH)
    equal = [unit for unit, factor in factors.items() if isclose(size, factor, rel_tol=1e-9)]
    return f"; did you mean {equal[0]!r}?" if equal else f"; known: {', '.join(factors)}"


class OutputUnits(NamedTuple):
    """Units of the output. Quantities without an output unit remain in SI units.

    Attributes
    ----------
    length, force, mass : str
        Units of lengths, forces and masses.
    velocity, acceleration : str
        Units of velocities and accelerations; if empty, the unit of length divided by s or s^2.
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
        """Return the output unit that replaces an SI unit, and its value in SI units.

        With accelerations in g, `unit("m/s^2")` is `("g", 9.80665)`.
        """
        length, force = LENGTH[self.length], FORCE[self.force]
        # Energies in kN mm are not common: lengths in mm or cm are replaced by m.
        arm = "m" if self.length in ("mm", "cm") else self.length
        energy = (f"{self.force}*{arm}", force * LENGTH[arm])
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
            "m/N": (f"{self.length}/{self.force}", length / force),
            "N*s": (f"{self.force}*s", force),
            "N*s/m": (f"{self.force}*s/{self.length}", force / length),
            "J": ("J", 1.0) if energy == ("N*m", 1.0) else energy,
            "N*m": energy,
        }
        return chosen.get(si, (si, 1.0))

    def of(self, value: Any, si: str) -> Any:
        """Convert a number or an array from the SI unit `si` to its output unit."""
        return value / self.unit(si)[1]

    def text(self, value: float, si: str) -> str:
        """Return a number with its output unit as text, with four significant digits.

        A mass is in the unit that belongs to the unit of force, unless another unit of mass was
        chosen: t for kN, kip*s^2/in for kip and in.

        Parameters
        ----------
        value : float
            Number in the SI unit.
        si : str
            SI unit, such as `N`.
        """
        units = self._replace(mass=self.matching_mass_unit) if si == "kg" else self
        return f"{number_text(units.of(value, si))} {units.unit(si)[0]}"

    @property
    def matching_mass_unit(self) -> str:
        """Unit of mass in texts and reports: the chosen unit, or the one that belongs to the unit
        of force."""
        return matching_mass_unit(self.force, self.length) if self.mass == "kg" else self.mass

    def label(self, si: str) -> str:
        """Return the output unit for the axis of a figure, such as m/s² or kip·in."""
        return self.unit(si)[0].replace("^2", "²").replace("*", "·")

    @property
    def in_figures(self) -> OutputUnits:
        """Units of figures: accelerations are in g unless another unit was requested."""
        return self if self.acceleration else self._replace(acceleration="g")

    def column(self, name: str, unit: str) -> tuple[str, float]:
        """Return the name of a column or key with its output unit, and the value of the unit in SI
        units.

        With forces in kip, `column("peak_shear_N", "N")` is `("peak_shear_kip", 4448.22...)`. The
        suffix of a product of units has no separator: an energy in kip*in ends in `kipin`, a
        stiffness in kip/in ends in `kip_in`. A name without the suffix of its unit is not changed.

        Parameters
        ----------
        name : str
            Name of the column or key in SI units.
        """
        output_unit, factor = self.unit(unit)
        error_suffix = "_error" if name.endswith("_error") else ""
        quantity_name, unit_suffix = name.removesuffix("_error"), suffix(unit)
        if output_unit == unit or not unit_suffix or not quantity_name.endswith(unit_suffix):
            return name, factor
        stem = quantity_name.removesuffix(unit_suffix)
        return f"{stem}{suffix(output_unit)}{error_suffix}", factor


SI = OutputUnits()


def parse_output_units(text: str, others: OutputUnits = SI) -> OutputUnits:
    """Parse a list of output units separated by commas, such as `kip,in,g` or `kN,mm`.

    Parameters
    ----------
    others : OutputUnits
        Units of the quantities that the list does not contain.

    Raises
    ------
    UsageError
        A unit is unknown, or the list contains two units of a quantity.
    """
    units: dict[str, str] = {}
    for word in (part.strip() for part in text.split(",")):
        # The exact spelling is tried first, because `canonical` returns lower case, and units such
        # as kN contain upper case.
        unit = word if word in _UNITS else canonical(word)
        if unit not in _UNITS:
            # A word such as `lbs` names a force and a mass.
            advice = [unit_advice(word, units) for units in _QUANTITIES.values()]
            hints = [hint for hint in advice if hint.startswith("; did you mean")]
            hint = hints[0] if len(hints) == 1 else f"; known: {', '.join(_UNITS)}"
            raise UsageError(f"output units {text[:60]!r}: unknown unit {word[:40]!r}{hint}")
        quantity = _UNITS[unit]
        if units.setdefault(quantity, unit) != unit:
            raise UsageError(
                f"output units {text[:60]!r}: two units of {quantity}, {units[quantity]} and {unit}"
            )
    return others._replace(**units)
