"""Units that results are written in, in place of SI: how names of columns and keys, and numbers, change with them."""

from __future__ import annotations

import re
from dataclasses import dataclass, replace
from typing import Any

from tdint.errors import UsageError, did_you_mean
from tdint.units import ACCELERATION, FORCE, LENGTH, MASS, VELOCITY, canonical

ENDS = {
    "_m_s2": "m/s^2",
    "_m_s": "m/s",
    "_N_m": "N/m",
    "_deg": "degree",
    "_kg": "kg",
    "_hz": "Hz",
    "_m": "m",
    "_s": "s",
    "_N": "N",
    "_J": "J",
}
"""Ends of names and the SI units that they stand for, the longest ends first."""

_QUANTITIES = {"length": LENGTH, "force": FORCE, "mass": MASS, "velocity": VELOCITY, "acceleration": ACCELERATION}
_UNITS = {unit: quantity for quantity, units in _QUANTITIES.items() for unit in units}
_NAME = re.compile(r"\b[a-z][A-Za-z0-9]*(?:_[A-Za-z0-9]+)+\b")


def end_of(name: str) -> str:
    """The end of a column's or a key's name that says its unit; empty for a number without one."""
    bare = name.removesuffix("_error")
    return next((end for end in ENDS if bare.endswith(end)), "")


def unit_of(name: str) -> str:
    """The SI unit in a column's or a key's name; 1 for a number without one."""
    return ENDS.get(end_of(name), "1")


@dataclass(frozen=True)
class OutputUnits:
    """Units of lengths, forces, masses, velocities and accelerations; what has none here stays in SI.

    A velocity or an acceleration without a unit of its own is in that of the length per s or s^2.
    """

    length: str = "m"
    force: str = "N"
    mass: str = "kg"
    velocity: str = ""
    acceleration: str = ""

    def __str__(self) -> str:
        return ",".join(filter(None, (self.force, self.length, self.mass, self.velocity, self.acceleration)))

    def unit(self, si: str) -> tuple[str, float]:
        """The unit that stands for an SI unit, and its value in SI: `unit("m/s^2")` is `("g", 9.80665)`."""
        length, force = LENGTH[self.length], FORCE[self.force]
        own = {
            "m": (self.length, length),
            "m/s": (self.velocity or f"{self.length}/s", VELOCITY.get(self.velocity, length)),
            "m/s^2": (self.acceleration or f"{self.length}/s^2", ACCELERATION.get(self.acceleration, length)),
            "N": (self.force, force),
            "kg": (self.mass, MASS[self.mass]),
            "N/m": (f"{self.force}/{self.length}", force / length),
            "J": (f"{self.force}*{self.length}", force * length),
        }
        if (self.force, self.length) == ("N", "m"):
            own["J"] = ("J", 1.0)
        return own.get(si, (si, 1.0))

    def of(self, value: Any, si: str) -> Any:
        """A number or an array that is given in an SI unit, in the unit that stands for it."""
        return value / self.unit(si)[1]

    def text(self, value: float, si: str) -> str:
        """A number and its unit for people, in four digits."""
        return f"{self.of(value, si):.4g} {self.unit(si)[0]}"

    def label(self, si: str) -> str:
        """The unit that stands for an SI unit, as an axis of a picture has it: m/s², kip·in."""
        return self.unit(si)[0].replace("^2", "²").replace("*", "·")

    @property
    def in_pictures(self) -> OutputUnits:
        """The units that pictures are drawn in: accelerations in g, as people think of them, unless a unit is named."""
        return self if self.acceleration else replace(self, acceleration="g")

    def column(self, name: str) -> tuple[str, float]:
        """The name of a column or key with the unit that it has here, and the value of that unit in SI.

        `column("peak_shear_N")` is `("peak_shear_kip", 4448.22...)`. A product of units is written without a sign: an
        energy in kip*in ends in `kipin`, a stiffness in kip/in in `kip_in`.
        """
        end = end_of(name)
        unit, factor = self.unit(ENDS.get(end, ""))
        if not end or unit == ENDS[end]:
            return name, 1.0
        error = "_error" if name.endswith("_error") else ""
        return f"{name.removesuffix('_error').removesuffix(end)}_{in_a_name(unit)}{error}", factor

    def renamed(self, text: str) -> str:
        """A text for people in which names of columns stand, with their names here."""
        return _NAME.sub(lambda match: self.column(match[0])[0], text)


SI = OutputUnits()


def parse_output_units(text: str) -> OutputUnits:
    """Understand units of the output, with commas between them: `kip,in,g`, `kN,mm`.

    Raises
    ------
    UsageError
        An unknown unit, or two of one quantity.
    """
    found: dict[str, str] = {}
    for word in (part.strip() for part in text.split(",")):
        unit = word if word in _UNITS else canonical(word)
        if unit not in _UNITS:
            hint = did_you_mean(word, _UNITS) or f"; known: {', '.join(_UNITS)}"
            raise UsageError(f"output units {text[:60]!r}: unknown unit {word[:40]!r}{hint}")
        quantity = _UNITS[unit]
        if found.setdefault(quantity, unit) != unit:
            raise UsageError(f"output units {text[:60]!r}: two units of {quantity}, {found[quantity]} and {unit}")
    return OutputUnits(**found)


def in_a_name(unit: str) -> str:
    """A unit as names of columns have it: m/s^2 is m_s2, kip*in is kipin."""
    return unit.replace("*", "").replace("^", "").replace("/", "_")
