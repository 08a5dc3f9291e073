"""Units that results are written in, in place of SI: how names of columns and keys, and numbers, change with them."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

from tdint.errors import UsageError, did_you_mean
from tdint.quantity import suffix
from tdint.units import ACCELERATION, FORCE, LENGTH, MASS, VELOCITY, canonical

_QUANTITIES = {"length": LENGTH, "force": FORCE, "mass": MASS, "velocity": VELOCITY, "acceleration": ACCELERATION}
_UNITS = {unit: quantity for quantity, units in _QUANTITIES.items() for unit in units}


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

    def column(self, name: str, unit: str) -> tuple[str, float]:
        """The name of a column or key in an SI unit with the unit that it has here, and the value of that unit in SI.

        `column("peak_shear_N", "N")` is `("peak_shear_kip", 4448.22...)`. A product of units is written without a sign:
        an energy in kip*in ends in `kipin`, a stiffness in kip/in in `kip_in`. A name that does not say its unit stays.
        """
        shown, factor = self.unit(unit)
        error = "_error" * name.endswith("_error")
        bare, end = name.removesuffix("_error"), suffix(unit)
        if shown == unit or not end or not bare.endswith(end):
            return name, factor
        return f"{bare.removesuffix(end)}{suffix(shown)}{error}", factor


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
