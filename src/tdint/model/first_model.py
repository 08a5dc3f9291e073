"""The text of a first model file: a building that runs as it is, with comments on what to replace."""

from __future__ import annotations

import json
import math
from dataclasses import dataclass

from tdint.units import FORCE, LENGTH, STANDARD_GRAVITY

_HARDENING = "3%"
_BASE_SHEAR = 0.2
"""Base shear at first yield over the weight."""


@dataclass(frozen=True)
class _System:
    """A building's usual units, and round numbers in them: height of a story, mass or weight of a floor."""

    units: str
    output: str
    length: str
    force: str
    height: float
    load_key: str
    load: float
    load_in_kg: float
    area: str


SYSTEMS = {
    "si": _System("{length: m, force: kN, mass: t}", "kN, m, g", "m", "kN", 3.5, "mass", 300.0, 300e3, "m"),
    "us": _System(
        "{length: in, force: kip}", "kip, in, g", "in", "kip", 144.0, "weight", 600.0,
        600.0 * FORCE["kip"] / STANDARD_GRAVITY, "ft",
    ),
}  # fmt: skip


def story_model(name: str, *, stories: int, period: float, system: str, motion: str | None) -> str:
    """A building of equal masses whose first mode is a straight line and has the period (s).

    With equal masses m and the mode shape 1, 2, ..., n the story stiffnesses are the inertia forces above over a drift
    of 1: k_i = omega^2 m (n (n + 1) - i (i - 1)) / 2. Strengths are in proportion, so that all stories yield together
    in that mode. The shape has no change of sign, so it is the first one.

    Parameters
    ----------
    motion : str or None
        The record's file; None is free vibration, from a roof that was pulled.
    """
    units = SYSTEMS[system]
    omega = 2.0 * math.pi / period
    weight = units.load_in_kg * STANDARD_GRAVITY / FORCE[units.force]
    lines = []
    for story in range(1, stories + 1):
        share = (stories * (stories + 1) - story * (story - 1)) / (stories * (stories + 1))
        whole = 0.5 * omega**2 * units.load_in_kg * stories * (stories + 1)
        stiffness = share * whole * LENGTH[units.length] / FORCE[units.force]
        strength = share * _BASE_SHEAR * weight * stories
        lines.append(
            f"  - {{{units.load_key}: {units.load:g}, height: {units.height:g}, stiffness: {stiffness:.9g}, "
            f"law: {{type: bilinear, yield_force: {strength:.6g}, hardening: {_HARDENING}}}}}"
        )
    pulled = [0.005 * units.height * story for story in range(1, stories + 1)]
    return "\n".join(
        [
            f"# A building of {_stories(stories)} with a fundamental period of {period:g} s, made by `tdint init`:",
            "# an example to replace.",
            f"name: {json.dumps(name, ensure_ascii=False)}",
            f"units: {units.units}" + ("  # weights in kip; for masses add mass: kip*s^2/in" if system == "us" else ""),
            f"# From the ground up: the floor's {units.load_key}, story height, initial stiffness, and how the story",
            "# yields (leave `law` out for a story that stays linear). The stiffness falls with the height so that the",
            f"# first mode is a straight line; the first story yields at {100.0 * _BASE_SHEAR:g} % of the weight.",
            "stories:",
            *lines,
            *_rest(units, motion, [f"{number:.6g}" for number in pulled]),
        ]
    )


def type_model(
    name: str, *, structure: str, stories: int, year: int, area: float, system: str, motion: str | None
) -> str:
    """A building of a Hazus type by rules: see `tdint.model.config.building_facts`; the area in m^2 or ft^2."""
    units = SYSTEMS[system]
    lengths = units.units if system == "si" else "{length: ft, force: kip}"
    return "\n".join(
        [
            f"# A {structure} building of {_stories(stories)}, made by `tdint init`: an example to replace.",
            f"name: {json.dumps(name, ensure_ascii=False)}",
            f"units: {lengths}",
            "# Rules make the stories and their damping of these few facts; area is that of one floor, in "
            f"{units.area}^2. More",
            "# keys: height (of the whole building), zone, design_level, damping_ratio.",
            f"building: {{rules: mdof-lu, type: {structure}, stories: {stories}, year: {year}, area: {area:g}}}",
            *_rest(units, motion, [f"{0.02 * story:.6g}" for story in range(1, stories + 1)], damping=False),
        ]
    )


def _stories(count: int) -> str:
    return f"{count} {'story' if count == 1 else 'stories'}"


def _rest(units: _System, motion: str | None, pulled: list[str], *, damping: bool = True) -> list[str]:
    """Damping, load, analysis and units of the output."""
    lines = ["damping: 5%  # Rayleigh damping in modes 1 and 3, or the last one"] if damping else []
    lines.append("p_delta: false  # true: gravity acts on the displaced building")
    if motion:
        lines += [
            "excitation:",
            "  # An artificial pulse, for a first look. Put your record in its place, such as",
            "  # record: {file: station.mseed, component: HNE, units: m/s^2, scale: 1}",
            f"  record: {{file: {json.dumps(motion, ensure_ascii=False)}}}",
            "analysis: {method: impulse4}  # the time step is that of the record",
        ]
    else:
        lines += [
            "# Free vibration: the building was pulled and is let go. For a ground motion write instead",
            "# excitation: {record: {file: station.mseed, component: HNE, units: m/s^2}}",
            f"initial: {{displacement: [{', '.join(pulled)}]}}",
            "analysis: {method: impulse4, dt: 0.01, duration: 20}",
        ]
    return [*lines, f"output_units: {units.output}", ""]
