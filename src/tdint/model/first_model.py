"""The text of a first model file: a building that runs as it is, with comments on what to replace."""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

from tdint.errors import UsageError
from tdint.units import FORCE, LENGTH, STANDARD_GRAVITY
from tdint.written_numbers import how_many

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


@dataclass(frozen=True)
class FittedLaw:
    """A law that was fitted to a story's curve, SI units: its initial stiffness, and its parameters by their names, or
    the points of a backbone (drift, shear)."""

    type: str
    stiffness: float
    parameters: tuple[tuple[str, float, str], ...]
    backbone: tuple[tuple[float, float], ...] = ()


def story_model(
    name: str,
    *,
    stories: int,
    period: float,
    system: str,
    motion: str | None,
    weights: Sequence[float] | None = None,
    laws: Sequence[FittedLaw] | None = None,
) -> str:
    """A building whose first mode is a straight line and has the period (s), or with the laws given.

    With the mode shape 1, 2, ..., n the story stiffnesses are the inertia forces above over a drift of 1: k_i = omega^2
    (m_i i + ... + m_n n). Strengths are in proportion, so that all stories yield together in that mode. The shape has
    no change of sign, so it is the first one.

    Parameters
    ----------
    motion : str or None
        The record's file; None is free vibration, from a roof that was pulled.
    weights : sequence of float, optional
        Of the floors from the ground up, kN or kip; equal masses without.
    laws : sequence of FittedLaw, optional
        Of the stories from the ground up, in place of the period.
    """
    units = SYSTEMS[system]
    if weights is not None:
        units = replace(units, load_key="weight", units=f"{{length: {units.length}, force: {units.force}}}")
    loads = list(weights) if weights is not None else [units.load] * stories
    stiffness, strength = _in_a_line(units, loads, 2.0 * math.pi / period)
    lines = []
    for i, load in enumerate(loads):
        law = f"type: bilinear, yield_force: {strength[i]:.6g}, hardening: {_HARDENING}"
        initial = f"stiffness: {stiffness[i]:.9g}, "
        if laws is not None:
            own = laws[i].stiffness * LENGTH[units.length] / FORCE[units.force]
            initial = "" if laws[i].backbone else f"stiffness: {own:.9g}, "
            law = _written(laws[i], units)
        lines.append(f"  - {{{units.load_key}: {load:g}, height: {units.height:g}, {initial}law: {{{law}}}}}")
    told = [
        "# yields (leave `law` out for a story that stays linear). The stiffness falls with the height so that the",
        f"# first mode is a straight line; the first story yields at {100.0 * _BASE_SHEAR:g} % of the weight.",
    ]
    made = f" with a fundamental period of {period:g} s"
    if laws is not None:
        told, made = ["# yields, as fitted to its curve."], " with the curves of its stories"
    pulled = [0.005 * units.height * story for story in range(1, stories + 1)]
    return "\n".join(
        [
            f"# A building of {how_many(stories, 'story')}{made}, made by `tdint init`:",
            "# an example to replace.",
            f"name: {json.dumps(name, ensure_ascii=False)}",
            f"units: {units.units}" + ("  # weights in kip; for masses add mass: kip*s^2/in" if system == "us" else ""),
            f"# From the ground up: the floor's {units.load_key}, story height, initial stiffness, and how the story",
            *told,
            "stories:",
            *lines,
            *_rest(units, motion, [f"{number:.6g}" for number in pulled]),
        ]
    )


def _in_a_line(units: _System, loads: Sequence[float], omega: float) -> tuple[list[float], list[float]]:
    """Stiffnesses and strengths with which the first mode is a straight line, in the system's units."""
    in_kg = units.load_in_kg / units.load
    if units.load_key == "weight":
        in_kg = FORCE[units.force] / STANDARD_GRAVITY
    masses = [in_kg * load for load in loads]
    moments = [mass * floor for floor, mass in enumerate(masses, start=1)]
    above = [math.fsum(moments[i:]) for i in range(len(moments))]
    weight = math.fsum(masses) * STANDARD_GRAVITY / FORCE[units.force]
    stiffness = [omega**2 * moment * LENGTH[units.length] / FORCE[units.force] for moment in above]
    return stiffness, [moment / above[0] * _BASE_SHEAR * weight for moment in above]


def _written(law: FittedLaw, units: _System) -> str:
    """A law as a model file has it; a parameter's dimension is force, length or none."""
    scale = {"force": FORCE[units.force], "length": LENGTH[units.length], "": 1.0}
    values = [f"{name}: {value / scale[dimension]:.6g}" for name, value, dimension in law.parameters]
    points = ", ".join(f"[{d / scale['length']:.6g}, {f / scale['force']:.6g}]" for d, f in law.backbone)
    backbone = [f"backbone: [{points}]", "pinching: {drift: 1, force: 1, unloading: 0}"] if points else []
    return ", ".join([f"type: {law.type}", *values, *backbone])


def type_model(
    name: str, *, structure: str, stories: int, year: int, area: float, system: str, motion: str | None
) -> str:
    """A building of a Hazus type by rules: see `tdint.model.config.building_facts`; the area in m^2 or ft^2."""
    units = SYSTEMS[system]
    lengths = units.units if system == "si" else "{length: ft, force: kip}"
    return "\n".join(
        [
            f"# A {structure} building of {how_many(stories, 'story')}, made by `tdint init`: an example to replace.",
            f"name: {json.dumps(name, ensure_ascii=False)}",
            f"units: {lengths}",
            "# Rules make the stories and their damping of these few facts; area is that of one floor, in "
            f"{units.area}^2. More",
            "# keys: height (of the whole building), zone, design_level, damping_ratio.",
            f"building: {{rules: mdof-lu, type: {structure}, stories: {stories}, year: {year}, area: {area:g}}}",
            *_rest(units, motion, [f"{0.02 * story:.6g}" for story in range(1, stories + 1)], damping=False),
        ]
    )


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


def first_model(stories: int = 5, *, period: float | None = None, name: str = "building", units: str = "si") -> str:
    """The text of a first model that `load_model(io.StringIO(text))` takes: equal floors on bilinear stories, vibrating
    freely.

    Parameters
    ----------
    stories : int
        Their number.
    period : float, optional
        Fundamental period, s; 0.1 s for each story by default.
    name : str
        The building's.
    units : str
        `si` or `us`.

    Raises
    ------
    UsageError
        No story, no positive period, unknown units.
    """
    chosen = 0.1 * stories if period is None else period
    if stories < 1 or not 0.0 < chosen < math.inf or units not in SYSTEMS:
        raise UsageError("a first model has stories from 1 on, a positive period, and units of si or us")
    return story_model(name, stories=stories, period=chosen, system=units, motion=None)
