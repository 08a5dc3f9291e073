"""Text of a first model file, and drift laws fitted to story curves of shear over drift."""

from __future__ import annotations

import json
import math
import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from tdint.arrays import Array
from tdint.errors import ModelError, UsageError
from tdint.number_parsing import pluralize
from tdint.units import FORCE, LENGTH, MASS, STANDARD_GRAVITY

if TYPE_CHECKING:
    from tdint.csv_table import CsvTable

# ---- The text of a first model file: a building that runs as it is, with comments on what to
# replace

_HARDENING = "3%"
_BASE_SHEAR = 0.2
"""Base shear at first yield over the weight."""


@dataclass(frozen=True)
class _System:
    """A building's usual units, and round numbers in them: height of a story, mass or weight of a
    floor."""

    units: str
    output: str
    length: str
    force: str
    height: float
    load_key: str
    load: float
    area: str


SYSTEMS = {
    "si": _System(
        "{length: m, force: kN, mass: t}", "kN, m, g", "m", "kN", 3.5, "mass", 300.0, "m"
    ),
    "us": _System(
        "{length: in, force: kip}", "kip, in, g", "in", "kip", 144.0, "weight", 600.0, "ft"
    ),
}


@dataclass(frozen=True)
class FittedLaw:
    """Law fitted to a story curve, SI units: initial stiffness, and parameters by name or the
    points of a backbone curve (drift, shear)."""

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
    """A building whose first mode is a straight line and has the period (s), or with the laws
    given.

    With the mode shape 1, 2, ..., n the story stiffnesses are the inertia forces above over a drift
    of 1: k_i = omega^2 (m_i i + ... + m_n n). Strengths are in proportion, so that all stories
    yield together in that mode. The shape has no change of sign, so it is the first one.

    Parameters
    ----------
    name : str
        Name of the building.
    stories : int
        Number of stories.
    period : float
        Period of the first mode, s; not used if `laws` are specified.
    system : str
        System of units, `si` or `us`.
    motion : str or None
        The record's file; None is free vibration, from a roof that was pulled.
    weights : sequence of float, optional
        Of the floors from the ground up, kN or kip; equal masses without.
    laws : sequence of FittedLaw, optional
        Of the stories from the ground up, in place of the period.
    """
    units = SYSTEMS[system]
    if weights is not None:
        units = replace(
            units, load_key="weight", units=f"{{length: {units.length}, force: {units.force}}}"
        )
    loads = list(weights) if weights is not None else [units.load] * stories
    # Fitted laws replace these values; the masses are user-defined or equal.
    stiffness, strength = _in_a_line(units, loads, 2.0 * math.pi / period)
    lines = []
    for i, load in enumerate(loads):
        law = f"type: bilinear, yield_force: {strength[i]:.6g}, hardening: {_HARDENING}"
        initial = f"stiffness: {stiffness[i]:.9g}, "
        if laws is not None:
            initial_stiffness = laws[i].stiffness * LENGTH[units.length] / FORCE[units.force]
            initial = "" if laws[i].backbone else f"stiffness: {initial_stiffness:.9g}, "
            law = _written(laws[i], units)
        lines.append(
            f"  - {{{units.load_key}: {load:g}, height: {units.height:g}, {initial}law: {{{law}}}}}"
        )
    told = [
        "# yields (leave `law` out for a story that stays linear). The stiffness falls with the "
        "height so that the",
        f"# first mode is a straight line; the first story yields at {100.0 * _BASE_SHEAR:g} % of "
        "the weight.",
    ]
    made = f" with a fundamental period of {period:g} s"
    if laws is not None:
        told, made = ["# yields, as fitted to its curve."], " with the curves of its stories"
    # Without a record it vibrates freely, from half a percent of drift in each story.
    pulled = [0.005 * units.height * story for story in range(1, stories + 1)]
    return "\n".join(
        [
            f"# A building of {pluralize(stories, 'story')}{made}, made by `tdint init`:",
            "# an example to replace.",
            f"name: {json.dumps(name, ensure_ascii=False)}",
            f"units: {units.units}"
            + ("  # weights in kip; for masses add mass: kip*s^2/in" if system == "us" else ""),
            f"# From the ground up: the floor's {units.load_key}, story height, initial stiffness, "
            "and how the story",
            *told,
            "stories:",
            *lines,
            *_rest(units, motion, [f"{number:.6g}" for number in pulled]),
        ]
    )


def _in_a_line(
    units: _System, loads: Sequence[float], omega: float
) -> tuple[list[float], list[float]]:
    """Stiffnesses and strengths with which the first mode is a straight line, in the system's
    units.

    Parameters
    ----------
    units : _System
        Units of the model file. Its `load_key` determines if loads are masses or weights.
    loads : sequence of float
        Masses (t) or weights (in the unit of force) of the floors from the ground up.
    omega : float
        Circular frequency of the first mode, rad/s.
    """
    in_kg = MASS["t"] if units.load_key == "mass" else FORCE[units.force] / STANDARD_GRAVITY
    masses = [in_kg * load for load in loads]
    moments = [mass * floor for floor, mass in enumerate(masses, start=1)]
    above = [math.fsum(moments[i:]) for i in range(len(moments))]
    weight = math.fsum(masses) * STANDARD_GRAVITY / FORCE[units.force]
    stiffness = [omega**2 * moment * LENGTH[units.length] / FORCE[units.force] for moment in above]
    return stiffness, [moment / above[0] * _BASE_SHEAR * weight for moment in above]


def _written(law: FittedLaw, units: _System) -> str:
    """Return a law in the notation of model files; the dimension of a parameter is force, length or
    empty."""
    scale = {"force": FORCE[units.force], "length": LENGTH[units.length], "": 1.0}
    values = [
        f"{name}: {value / scale[dimension]:.6g}" for name, value, dimension in law.parameters
    ]
    points = ", ".join(
        f"[{d / scale['length']:.6g}, {f / scale['force']:.6g}]" for d, f in law.backbone
    )
    backbone = (
        [f"backbone: [{points}]", "pinching: {drift: 1, force: 1, unloading: 0}"] if points else []
    )
    return ", ".join([f"type: {law.type}", *values, *backbone])


def type_model(
    name: str,
    *,
    structure: str,
    stories: int,
    year: int,
    area: float,
    system: str,
    motion: str | None,
) -> str:
    """A building of a Hazus type by rules: see `tdint.model.config.building_facts`; the area in m^2
    or ft^2.

    Parameters
    ----------
    name : str
        Name of the building.
    structure : str
        Structural type of Hazus.
    stories : int
        Number of stories.
    year : int
        Year of construction.
    area : float
        Area of one floor, m^2 or ft^2.
    system : str
        System of units, `si` or `us`.
    motion : str or None
        File of the record; None for free vibration.
    """
    units = SYSTEMS[system]
    lengths = units.units if system == "si" else "{length: ft, force: kip}"
    return "\n".join(
        [
            f"# A {structure} building of {pluralize(stories, 'story')}, made by `tdint init`: an "
            "example to replace.",
            f"name: {json.dumps(name, ensure_ascii=False)}",
            f"units: {lengths}",
            "# Rules make the stories and their damping of these few facts; area is that of one "
            f"floor, in {units.area}^2. More",
            "# keys: height (of the whole building), zone, design_level, damping_ratio.",
            f"building: {{rules: mdof-lu, type: {structure}, stories: {stories}, year: {year}, "
            f"area: {area:g}}}",
            *_rest(
                units,
                motion,
                [f"{0.02 * story:.6g}" for story in range(1, stories + 1)],
                damping=False,
            ),
        ]
    )


def _rest(
    units: _System, motion: str | None, pulled: list[str], *, damping: bool = True
) -> list[str]:
    """Return the lines for damping, load, analysis and output units.

    Parameters
    ----------
    units : _System
        System of units, which defines the output units.
    motion : str or None
        File of the record; None for free vibration.
    pulled : list of str
        Initial displacements from the ground up, as text, in the units of the file; used only
        without a record.
    damping : bool
        Include the line for damping.
    """
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
            "# Free vibration: the building was pulled and is let go. For a ground motion write "
            "instead",
            "# excitation: {record: {file: station.mseed, component: HNE, units: m/s^2}}",
            f"initial: {{displacement: [{', '.join(pulled)}]}}",
            "analysis: {method: impulse4, dt: 0.01, duration: 20}",
        ]
    return [*lines, f"output_units: {units.output}", ""]


def model_template(
    stories: int = 5, *, period: float | None = None, name: str = "building", units: str = "si"
) -> str:
    """The text of a first model that `load_model(io.StringIO(text))` takes: equal floors on
    bilinear stories, vibrating freely.

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

    Returns
    -------
    str
        YAML with comments.

    Raises
    ------
    UsageError
        No story, no positive period, unknown units.
    """
    chosen = 0.1 * stories if period is None else period
    if stories < 1 or not 0.0 < chosen < math.inf or units not in SYSTEMS:
        raise UsageError(
            "a first model has stories from 1 on, a positive period, and units of si or us"
        )
    return story_model(name, stories=stories, period=chosen, system=units, motion=None)


# ---- Story curves

_NEEDS = (
    "story curves are a CSV file with the columns story, drift_m and shear_N (or drift_mm, "
    "shear_kN, ...)"
)
_FEWEST = 4
_STARTS = (0.15, 0.3, 0.5, 0.7, 0.85)
"""Start values of the search for the corners of a law, over the largest drift."""
_GAP = 1e-3  # between the points of a law, over the largest drift
_LEAST_SHEAR = 1e-6  # over the largest


@dataclass(frozen=True)
class CurveFit:
    """Law fitted to the curve of a story.

    Attributes
    ----------
    story : int
        From 1 at the ground.
    law : FittedLaw
        The law.
    misfit : float
        Root mean square of the differences between the law and the curve, over the curve's largest
        shear.
    """

    story: int
    law: FittedLaw
    misfit: float


def read_story_curves(source: str) -> dict[int, tuple[Array, Array]]:
    """Drift (m) and shear (N) of each story from 1, from a CSV file whose columns say their units.

    Raises
    ------
    ModelError
        It is no such file, or a story is missing, has too few points, or drifts that do not grow.
    """
    from tdint.csv_table import read_table

    table = read_table(source, _NEEDS)
    drift, length = _column(table, "drift", LENGTH)
    shear, force = _column(table, "shear", FORCE)
    table.need("story")
    stories = np.array(table.numbers("story"))
    values = np.array(
        [np.array(table.numbers(drift)) * length, np.array(table.numbers(shear)) * force]
    )
    # Story numbers must have no gaps: a missing story would shift all stories above it.
    count = int(stories.max()) if stories.size else 0
    curves = {story: values[:, stories == story] for story in range(1, count + 1)}
    if not curves or stories.size != sum(part.shape[1] for part in curves.values()):
        raise ModelError(f"{source}: story: numbers from 1 at the ground are needed")
    for story, (drifts, shears) in curves.items():
        grows = drifts.size >= _FEWEST and drifts[0] >= 0.0 and np.all(np.diff(drifts) >= 0.0)
        if not grows or np.max(shears) <= 0.0:
            raise ModelError(
                f"{source}: story {story}: a curve has {_FEWEST} points at least, positive shears, "
                "and drifts that grow from zero"
            )
    return {story: (part[0], part[1]) for story, part in curves.items()}


def _column(table: CsvTable, name: str, units: dict[str, float]) -> tuple[str, float]:
    """Return the column name of a quantity with its unit, and the factor of the unit to SI.

    Parameters
    ----------
    table : CsvTable
        Table of story curves.
    name : str
        Quantity with which the name of the column begins, `drift` or `shear`.
    units : dict of str to float
        Factor to SI units of each unit.
    """
    names = {
        f"{name}_{re.sub(r'[^a-z]', '', unit.lower())}": factor for unit, factor in units.items()
    }
    for column, factor in names.items():
        if table.has(column):
            return column, factor
    table.need(f"{name}_{'m' if name == 'drift' else 'N'}".lower())
    raise AssertionError  # need has raised


def fit_story(story: int, drift: Array, shear: Array, kind: str) -> CurveFit:
    """The law of a kind that comes closest to a curve by least squares of the shear.

    Parameters
    ----------
    story : int
        Number of the story, from 1 at the ground.
    drift : array, shape (points,)
        Drifts, m; none is smaller than the one before.
    shear : array, shape (points,)
        Story shear at each drift, N.
    kind : str
        `bilinear`; `trilinear`: a law `trilinear-pinching` without pinching, flat beyond its
        largest force; or `multilinear`: a law `multilinear-pinching` without pinching, with four
        points, which may fall.
    """
    fit, model = _KINDS[kind]
    scale, top = float(drift[-1]), float(np.max(shear))
    # Over the largest drift and shear one search fits all units; several starts, for there are
    # several minima.
    d, f = drift / scale, shear / top
    best = min((fit(d, f, start) for start in _STARTS), key=lambda fitted: fitted[1])
    law = model(best[0], scale, top)
    return CurveFit(story, law, float(np.sqrt(best[1] / d.size)))


Corners = tuple[Array, float]


def _least_squares(d: Array, f: Array, corners: Array, *, flat: bool) -> tuple[Array, Array]:
    """Slopes between corners, none negative, and the shears they leave; `flat`: no slope after the
    last corner.

    Parameters
    ----------
    d : array, shape (points,)
        Drifts divided by the largest drift.
    f : array, shape (points,)
        Shears divided by the largest shear.
    corners : array
        Drifts of the corners divided by the largest drift, in any order.
    flat : bool
        Set the slope after the last corner to zero.
    """
    from scipy.optimize import nnls

    edges = np.concatenate([[0.0], np.sort(corners), [max(1.0, float(np.max(corners)) + 1e-9)]])
    parts = [np.clip(d - low, 0.0, high - low) for low, high in pairwise(edges)]
    base = np.column_stack(parts[:-1] if flat else parts)
    slopes, _ = nnls(base, f)
    return np.asarray(slopes), np.asarray(f - base @ slopes)


def _broken_line(parts: tuple[float, ...], flat: bool, d: Array, f: Array, start: float) -> Corners:
    """Fit a polygon; the search for the corners starts from fractions of `start`.

    Parameters
    ----------
    parts : tuple of float
        Start values of the drifts of the corners, as fractions of `start`.
    flat : bool
        Set the slope after the last corner to zero.
    d : array, shape (points,)
        Drifts divided by the largest drift.
    f : array, shape (points,)
        Shears divided by the largest shear.
    start : float
        Reference drift of the start values, divided by the largest drift.
    """
    from scipy.optimize import minimize

    # A corner before the first points is not determined by the data.
    low = 0.5 * float(d[d > 0.0][0])

    def squares(corners: Array) -> float:
        inside = np.clip(corners, low, 1.0)
        return float(np.sum(_least_squares(d, f, inside, flat=flat)[1] ** 2))

    search = {"xatol": 1e-7, "fatol": 1e-14}
    best = minimize(squares, start * np.array(parts), method="Nelder-Mead", options=search).x
    corners = np.sort(np.clip(best, low, 1.0))
    return np.concatenate([corners, _least_squares(d, f, corners, flat=flat)[0]]), squares(corners)


def _multilinear(d: Array, f: Array, start: float) -> Corners:
    """Drifts of four points, the last one that of the curve, and the shears there by least squares,
    none negative.

    Parameters
    ----------
    d : array, shape (points,)
        Drifts divided by the largest drift.
    f : array, shape (points,)
        Shears divided by the largest shear.
    start : float
        Start value of the drift of the second point, divided by the largest drift.
    """
    from scipy.optimize import minimize, nnls

    low = 0.5 * float(d[d > 0.0][0])

    # Points stay apart and below the last one, or two of them would make a jump.
    def points(corners: Array) -> Array:
        inside = np.sort(np.clip(corners, low, 1.0))
        return np.append(
            np.minimum(inside + _GAP * np.arange(3), 1.0 - _GAP * np.arange(3, 0, -1)), 1.0
        )

    # For given drifts the best shears follow in closed form: only drifts are searched.
    def shears(x: Array) -> tuple[Array, float]:
        hats = np.eye(5)[1:]
        weights, rest = nnls(
            np.column_stack([np.interp(d, np.append(0.0, x), hat) for hat in hats]), f
        )
        return np.asarray(weights), float(rest**2)

    begin = np.array([0.3 * start, start, 0.5 * (1.0 + start)])
    search = {"xatol": 1e-7, "fatol": 1e-14, "maxiter": 2000}
    best = points(
        minimize(lambda x: shears(points(x))[1], begin, method="Nelder-Mead", options=search).x
    )
    return np.concatenate([best, shears(best)[0]]), shears(best)[1]


def _bilinear_law(corners: Array, scale: float, top: float) -> FittedLaw:
    corner, first, second = corners
    hardening = float(np.clip(second / first, 0.0, 0.999))
    yield_force = ("yield_force", float(first * corner * top), "force")
    return FittedLaw(
        "bilinear", float(first * top / scale), (yield_force, ("hardening", hardening, ""))
    )


def _trilinear_law(corners: Array, scale: float, top: float) -> FittedLaw:
    first_corner, last_corner, first, second = corners
    yield_force = float(first * first_corner * top)
    largest = yield_force + float(second * (last_corner - first_corner) * top)
    parameters = (
        ("yield_force", yield_force, "force"),
        ("ultimate_force", largest, "force"),
        ("ultimate_drift", float(last_corner * scale), "length"),
        ("pinching", 1.0, ""),
        ("unloading", 0.0, ""),
    )
    return FittedLaw("trilinear-pinching", float(first * top / scale), parameters)


def _multilinear_law(corners: Array, scale: float, top: float) -> FittedLaw:
    drifts, shears = scale * corners[:4], top * np.maximum(corners[4:], _LEAST_SHEAR)
    backbone = tuple(zip(drifts.tolist(), shears.tolist(), strict=True))
    return FittedLaw("multilinear-pinching", float(shears[0] / drifts[0]), (), backbone)


_KINDS: dict[
    str, tuple[Callable[[Array, Array, float], Corners], Callable[[Array, float, float], FittedLaw]]
] = {
    "bilinear": (partial(_broken_line, (1.0,), False), _bilinear_law),
    "trilinear": (partial(_broken_line, (0.4, 1.0), True), _trilinear_law),
    "multilinear": (_multilinear, _multilinear_law),
}
"""Fit function and law constructor by kind of law."""
