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

# ---- Text of a first model file: a building that can be run without changes, with comments that
# state the values to replace

_HARDENING = "3%"
_BASE_SHEAR = 0.2
"""Base shear at first yield over the weight."""

_ISOLATION_PERIOD, _BEARING_HARDENING, _BEARING_STRENGTH = 2.5, 0.1, 0.05
"""Typical lead-rubber bearings: period of the building as a rigid body on the bearings after yield,
s; stiffness after yield over the initial stiffness; force at zero displacement over the weight."""

_BEARING_DAMPING = 0.05
"""Viscous damping ratio of the building as a rigid body at this period."""

_ABSORBER_MASS = 0.05
"""Mass of a tuned mass damper over the modal mass of the first mode; typical values are 0.01 to
0.1."""

_MOAT = 0.3
"""Clearance of the moat wall, m; typical values are 0.3 to 0.8 m."""


@dataclass(frozen=True)
class _UnitSystem:
    """Units of a model file, and typical values of a building in these units.

    Attributes
    ----------
    units, output : str
        Values of the keys `units` and `output_units`.
    length, force : str
        Units of length and force.
    height : float
        Story height, in the unit of length.
    load_key : str
        Key of a story, `mass` or `weight`.
    load : float
        Mass or weight of a floor.
    area : str
        Unit of length of floor areas.
    """

    units: str
    output: str
    length: str
    force: str
    height: float
    load_key: str
    load: float
    area: str


SYSTEMS = {
    "si": _UnitSystem(
        "{length: m, force: kN, mass: t}", "kN, m, g", "m", "kN", 3.5, "mass", 300.0, "m"
    ),
    "us": _UnitSystem(
        "{length: in, force: kip}", "kip, in, g", "in", "kip", 144.0, "weight", 600.0, "ft"
    ),
}


@dataclass(frozen=True)
class FittedLaw:
    """Law fitted to a story curve.

    Attributes
    ----------
    parameters : tuple of (str, float, str)
        Name, value in SI units and dimension (`force`, `length` or empty) of each parameter.
    backbone : tuple of (float, float)
        Drift (m) and shear (N) of each point of the backbone curve; empty for laws without points.
    """

    type: str
    stiffness: float
    parameters: tuple[tuple[str, float, str], ...]
    backbone: tuple[tuple[float, float], ...] = ()


def story_model(
    name: str,
    *,
    floors: int | Sequence[float],
    period: float,
    system: str,
    motion: str | None,
    laws: Sequence[FittedLaw] | None = None,
    isolated: bool = False,
    absorber: bool = False,
) -> str:
    """Return the text of a model file with a list of stories.

    Without `laws`, the stiffnesses are chosen so that the first mode is a straight line and has the
    given period. For the mode shape 1, 2, ..., n each story has a drift of 1, so that the stiffness
    of story i is the sum of the inertia forces above: k_i = omega^2 (m_i i + ... + m_n n). The
    shape has no change of sign and is therefore the first mode. The strengths are proportional to
    the stiffnesses, so that all stories yield at the same time in this mode.

    Parameters
    ----------
    floors : int or sequence of float
        Number of floors with equal masses, or the weights of the floors from the ground up, kN or
        kip.
    period : float
        Period of the first mode, s; not used if `laws` are specified. Of an isolated building, the
        period without the isolation.
    system : str
        `si` or `us`.
    motion : str | None
        File of the record; None for free vibration from an initial displacement.
    isolated : bool
        True to add a story with bearings and a moat wall below the stories.
    absorber : bool
        True to add a tuned mass damper on the roof.
    """
    units = SYSTEMS[system]
    if isinstance(floors, int):
        loads = [units.load] * floors
    else:
        loads = list(floors)
        units = replace(
            units, load_key="weight", units=f"{{length: {units.length}, force: {units.force}}}"
        )
    stories = len(loads)
    stiffness, strength = _uniform_mode_stiffness(units, loads, 2.0 * math.pi / period)
    lines = _isolation_lines(units, loads) if isolated else []
    for i, load in enumerate(loads):
        if laws is None:
            stiffness_text = f"stiffness: {stiffness[i]:.9g}, "
            law_text = f"type: bilinear, yield_force: {strength[i]:.6g}, hardening: {_HARDENING}"
        else:
            # A backbone curve determines the initial stiffness, so the key `stiffness` is omitted.
            initial_stiffness = laws[i].stiffness * LENGTH[units.length] / FORCE[units.force]
            stiffness_text = "" if laws[i].backbone else f"stiffness: {initial_stiffness:.9g}, "
            law_text = _law_text(laws[i], units)
        lines.append(
            f"  - {{{units.load_key}: {load:g}, height: {units.height:g}, {stiffness_text}"
            f"law: {{{law_text}}}}}"
        )
    if laws is None:
        title_end = f" with a fundamental period of {period:g} s"
        comment_lines = [
            "# yield force (omit `law` for a linear story). The stiffnesses decrease with height, "
            "so that",
            f"# the first mode is a straight line. The {'lowest' if isolated else 'first'} story "
            f"yields at {100.0 * _BASE_SHEAR:g} % of the weight.",
        ]
    else:
        title_end = " with the curves of its stories"
        comment_lines = ["# parameters that were fitted to the curve of the story."]
    # Without a record, the building vibrates freely from a drift ratio of 0.5 % in each story.
    displacements = [0.005 * units.height * story for story in range(1, stories + 1)]
    if isolated:
        title_end += " on bearings"
        displacements = [0.0, *displacements]
    return "\n".join(
        [
            f"# Building of {pluralize(stories, 'story')}{title_end}, generated by `tdint init`:",
            "# an example to edit.",
            f"name: {json.dumps(name, ensure_ascii=False)}",
            f"units: {units.units}"
            + ("  # weights in kip; for masses add mass: kip*s^2/in" if system == "us" else ""),
            f"# From the ground up: {units.load_key} of the floor, story height, initial "
            "stiffness, hysteretic law with",
            *comment_lines,
            "stories:",
            *lines,
            *(_absorber_lines(units, loads, 2.0 * math.pi / period) if absorber else ()),
            *_remaining_lines(units, motion, [f"{value:.6g}" for value in displacements]),
        ]
    )


def _absorber_lines(units: _UnitSystem, loads: Sequence[float], omega: float) -> list[str]:
    """Return the lines of a tuned mass damper on the roof of a building with the circular frequency
    `omega` (rad/s), with a first mode that is a straight line.

    The tuning f of the frequencies and the damping ratio are the optimum for a harmonic force on an
    undamped building (Den Hartog 1956): f = 1 / (1 + mu), zeta = sqrt(3 mu / (8 (1 + mu))), with
    the mass ratio mu. The ratio zeta refers to the frequency of the damper.
    """
    floors, mu = len(loads), _ABSORBER_MASS
    modal_load = math.fsum(load * (i / floors) ** 2 for i, load in enumerate(loads, start=1))
    tuned = omega / (1.0 + mu)
    damping_ratio = math.sqrt(3.0 * mu / (8.0 * (1.0 + mu)))
    mass = mu * modal_load * _mass_factor(units)
    by_force = LENGTH[units.length] / FORCE[units.force]
    return [
        f"# Tuned mass damper, {100.0 * mu:g} % of the modal mass of the first mode. Tuning and",
        "# damping are the optimum of Den Hartog (1956): frequency of the building over 1 + mu,",
        f"# damping ratio sqrt(3 mu / (8 (1 + mu))) = {damping_ratio:.4f} of the damper itself.",
        "attachments:",
        f"  - {{name: tuned mass damper, floor: roof, {units.load_key}: {mu * modal_load:.6g}, "
        f"stiffness: {mass * tuned**2 * by_force:.6g}, "
        f"dashpot: {2.0 * damping_ratio * mass * tuned * by_force:.6g}}}",
    ]


def _isolation_lines(units: _UnitSystem, loads: Sequence[float]) -> list[str]:
    """Return the lines of a story with two elements, bearings and a moat wall, under a building
    with the masses or weights `loads`. The slab on the bearings has the load of the first floor."""
    total = loads[0] + math.fsum(loads)
    mass = total * _mass_factor(units)
    weight = mass * STANDARD_GRAVITY / FORCE[units.force]
    omega, unit = 2.0 * math.pi / _ISOLATION_PERIOD, LENGTH[units.length] / FORCE[units.force]
    stiffness = mass * omega**2 / _BEARING_HARDENING * unit
    dashpot = 2.0 * _BEARING_DAMPING * mass * omega * unit
    yield_force = _BEARING_STRENGTH * weight / (1.0 - _BEARING_HARDENING)
    return [
        "  # Bearings and a moat wall: two springs in one story (`elements`). After yield of the",
        f"  # bearings, the period of the rigid building is {_ISOLATION_PERIOD:g} s. At zero",
        f"  # displacement, their force is {100.0 * _BEARING_STRENGTH:g} % of the weight. The wall",
        "  # is ten times as stiff as they are after yield. The dashpot is viscous damping of",
        f"  # {100.0 * _BEARING_DAMPING:g} % at this period; Rayleigh damping omits isolators.",
        f"  - {units.load_key}: {loads[0]:g}",
        "    isolator: true  # its displacement is reported instead of a drift ratio",
        "    elements:",
        f"      - {{name: bearings, type: bilinear, stiffness: {stiffness:.6g}, "
        f"yield_force: {yield_force:.6g}, hardening: {_BEARING_HARDENING:g}}}",
        f"      - {{name: moat wall, type: gap, gap: {_MOAT / LENGTH[units.length]:.3g}, "
        f"stop_stiffness: {stiffness:.6g}}}",
        f"    dashpot: {dashpot:.6g}",
    ]


def _mass_factor(units: _UnitSystem) -> float:
    """Return the mass (kg) of a load of 1 in the unit of the load of the model file."""
    return MASS["t"] if units.load_key == "mass" else FORCE[units.force] / STANDARD_GRAVITY


def _uniform_mode_stiffness(
    units: _UnitSystem, loads: Sequence[float], omega: float
) -> tuple[list[float], list[float]]:
    """Return story stiffnesses and strengths, in the units of the model file, for a first mode that
    is a straight line.

    The strengths are proportional to the stiffnesses. The base shear at yield is the fraction
    `_BASE_SHEAR` of the weight. The loads are masses (t) or weights of the floors from the ground
    up, as determined by `units.load_key`.
    """
    masses = [_mass_factor(units) * load for load in loads]
    # The inertia forces in the mode shape 1, 2, ..., n are divided by omega^2.
    inertia = [mass * floor for floor, mass in enumerate(masses, start=1)]
    inertia_above = [math.fsum(inertia[i:]) for i in range(len(inertia))]
    weight = math.fsum(masses) * STANDARD_GRAVITY / FORCE[units.force]
    stiffness = [
        omega**2 * sum_above * LENGTH[units.length] / FORCE[units.force]
        for sum_above in inertia_above
    ]
    strength = [sum_above / inertia_above[0] * _BASE_SHEAR * weight for sum_above in inertia_above]
    return stiffness, strength


def _law_text(law: FittedLaw, units: _UnitSystem) -> str:
    """Return the entries of the mapping `law` of a story as text of a model file."""
    length, force = LENGTH[units.length], FORCE[units.force]
    units_in_si = {"force": force, "length": length, "": 1.0}
    entries = [f"type: {law.type}"]
    for name, value, dimension in law.parameters:
        entries.append(f"{name}: {value / units_in_si[dimension]:.6g}")
    if law.backbone:
        points = [f"[{drift / length:.6g}, {shear / force:.6g}]" for drift, shear in law.backbone]
        entries.append(f"backbone: [{', '.join(points)}]")
        # With these values, the law has no pinching.
        entries.append("pinching: {drift: 1, force: 1, unloading: 0}")
    return ", ".join(entries)


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
    """Return the text of a model file with a building of a Hazus type (the key `building`).

    Parameters
    ----------
    area : float
        Area of a single floor, m^2 or ft^2.
    motion : str | None
        File of the record; None for free vibration.
    """
    units = SYSTEMS[system]
    unit_mapping = units.units if system == "si" else "{length: ft, force: kip}"
    return "\n".join(
        [
            f"# {structure} building of {pluralize(stories, 'story')}, generated by `tdint init`: "
            "an example to edit.",
            f"name: {json.dumps(name, ensure_ascii=False)}",
            f"units: {unit_mapping}",
            "# Rules derive the stories and their damping from these properties. area is the area "
            f"of one floor, in {units.area}^2.",
            "# Further keys: height (of the building), zone, design_level, damping_ratio.",
            f"building: {{rules: mdof-lu, type: {structure}, stories: {stories}, year: {year}, "
            f"area: {area:g}}}",
            *_remaining_lines(
                units,
                motion,
                [f"{0.02 * story:.6g}" for story in range(1, stories + 1)],
                damping=False,
            ),
        ]
    )


def _remaining_lines(
    units: _UnitSystem, motion: str | None, displacements: list[str], *, damping: bool = True
) -> list[str]:
    """Return the lines of a model file for damping, load, analysis and output units. The initial
    displacements (text, in the units of the file) are used only without a record (free vibration).
    """
    lines = (
        ["damping: 5%  # Rayleigh damping in modes 1 and 3 (or the last mode)"] if damping else []
    )
    lines.append("p_delta: false  # true: gravity acts on the displaced building")
    if motion:
        lines += [
            "excitation:",
            "  # An artificial pulse as a first example. Replace it by your record, such as",
            "  # record: {file: station.mseed, component: HNE, units: m/s^2, scale: 1}",
            f"  record: {{file: {json.dumps(motion, ensure_ascii=False)}}}",
            "analysis: {method: impulse4}  # the time step is that of the record",
        ]
    else:
        lines += [
            "# Free vibration from an initial displacement. For a ground motion, write instead",
            "# excitation: {record: {file: station.mseed, component: HNE, units: m/s^2}}",
            f"initial: {{displacement: [{', '.join(displacements)}]}}",
            "analysis: {method: impulse4, dt: 0.01, duration: 20}",
        ]
    return [*lines, f"output_units: {units.output}", ""]


def model_template(
    stories: int = 5, *, period: float | None = None, name: str = "building", units: str = "si"
) -> str:
    """Return the text of a first model file, for `load_model(io.StringIO(text))`.

    The building has equal floors and bilinear stories. It vibrates freely.

    Parameters
    ----------
    stories : int
        Number of stories.
    period : float, optional
        Fundamental period, s. Default: 0.1 s for each story.
    name : str
        Name of the building.
    units : str
        `si` or `us`.

    Returns
    -------
    str
        YAML with comments.

    Raises
    ------
    UsageError
        The number of stories is less than 1, the period is not positive, or the units are unknown.
    """
    chosen_period = 0.1 * stories if period is None else period
    if stories < 1 or not 0.0 < chosen_period < math.inf or units not in SYSTEMS:
        raise UsageError(
            "the number of stories must be at least 1, the period positive, and the units si or "
            f"us, got {stories!r} stories, {chosen_period!r} s and {units!r}"
        )
    return story_model(name, floors=stories, period=chosen_period, system=units, motion=None)


# ---- Story curves

_REQUIREMENTS = (
    "story curves must be a CSV file with the columns story, drift_m and shear_N (or drift_mm, "
    "shear_kN, ...)"
)
_MIN_POINTS = 4
"""Minimum number of points of a story curve."""

# Drifts in the fits are relative to the maximum drift of the curve, shears to the maximum shear.
_START_DRIFTS = (0.15, 0.3, 0.5, 0.7, 0.85)
"""Initial relative drifts of the search for the corners of a law."""

_LINE_POINTS = 51
"""Number of points with equal distances on the line through the points of a curve."""

_MIN_DISTANCE = 1e-3
"""Minimum difference of the relative drifts of successive points of a backbone curve."""

_MIN_SHEAR = 1e-6
"""Minimum relative shear of the points of a backbone curve. A law requires positive forces."""


@dataclass(frozen=True)
class CurveFit:
    """Law fitted to the curve of a story.

    Attributes
    ----------
    story : int
        Number of the story, from 1 at the ground.
    misfit : float
        Root mean square of the differences of shear between law and curve, relative to the maximum
        shear of the curve.
    """

    story: int
    law: FittedLaw
    misfit: float


def read_story_curves(source: str) -> dict[int, tuple[Array, Array]]:
    """Read the story curves of a building from a CSV file.

    The names of the columns contain the units, such as `drift_mm` and `shear_kN`.

    Returns
    -------
    dict of int to (ndarray, ndarray)
        Drift (m) and shear (N) of the points of each story, by the number of the story from 1.

    Raises
    ------
    ModelError
        The file cannot be read, a story is missing, or a curve is invalid: too few points, no
        positive shear, or drifts that decrease.
    """
    from tdint.csv_table import read_table

    table = read_table(source, _REQUIREMENTS)
    drift_column, length_in_m = _find_column(table, "drift", LENGTH)
    shear_column, force_in_n = _find_column(table, "shear", FORCE)
    table.need("story")
    stories = np.array(table.numbers("story"))
    drift_and_shear = np.array(
        [
            np.array(table.numbers(drift_column)) * length_in_m,
            np.array(table.numbers(shear_column)) * force_in_n,
        ]
    )
    # Story numbers must have no gaps: a missing story would shift all stories above it.
    count = int(stories.max()) if stories.size else 0
    curves = {story: drift_and_shear[:, stories == story] for story in range(1, count + 1)}
    # Rows with other numbers, such as 0 or 1.5, belong to no curve.
    if not curves or stories.size != sum(curve.shape[1] for curve in curves.values()):
        raise ModelError(
            f"{source}: story: must be whole numbers from 1 at the ground, without gaps"
        )
    for story, (drifts, shears) in curves.items():
        is_valid = (
            drifts.size >= _MIN_POINTS
            and drifts[0] >= 0.0
            and np.all(np.diff(drifts) >= 0.0)
            and np.max(shears) > 0.0
        )
        if not is_valid:
            raise ModelError(
                f"{source}: story {story}: a curve requires at least {_MIN_POINTS} points, "
                "positive shears, and increasing positive drifts"
            )
    return {story: (curve[0], curve[1]) for story, curve in curves.items()}


def _find_column(table: CsvTable, quantity: str, units: dict[str, float]) -> tuple[str, float]:
    """Return the name of the column of a quantity (`drift` or `shear`), and the factor of its unit
    to SI units. The column is named after the quantity and a unit, such as `drift_mm`; ModelError
    is raised if it does not exist.
    """
    for unit, factor in units.items():
        # Names of columns contain only the letters of a unit.
        column = f"{quantity}_{re.sub(r'[^a-z]', '', unit.lower())}"
        if table.has(column):
            return column, factor
    table.need(f"{quantity}_{'m' if quantity == 'drift' else 'N'}".lower())
    raise AssertionError  # `need` has raised ModelError


def fit_story(story: int, drift: Array, shear: Array, law_type: str) -> CurveFit:
    """Fit a law to the curve of a story by least squares of the shear.

    Parameters
    ----------
    drift : array, shape (points,)
        Drifts, m, which do not decrease.
    law_type : str
        `bilinear`; `trilinear`: the law `trilinear-pinching` without pinching, with constant force
        after the ultimate point; or `multilinear`: the law `multilinear-pinching` without pinching,
        with four points and forces that may decrease.
    """
    fit, make_law = FITTED_LAWS[law_type]
    max_drift, max_shear = float(drift[-1]), float(np.max(shear))
    # Relative values make the search independent of the units. It starts from several drifts,
    # because the sum of squares has several minima.
    relative_drift, relative_shear = drift / max_drift, shear / max_shear
    # Between distant points, the curve is a straight line: without points on this line, a corner of
    # the law between two points of the curve could have any force.
    line = np.linspace(0.0, 1.0, _LINE_POINTS)[:-1]
    ends = np.searchsorted(relative_drift, line, side="right")
    is_distant = np.diff(relative_drift, prepend=0.0)[ends] > 1.5 / _LINE_POINTS
    added = np.setdiff1d(line[is_distant], relative_drift)
    added_shear = np.interp(added, np.append(0.0, relative_drift), np.append(0.0, relative_shear))
    places = np.searchsorted(relative_drift, added)
    relative_drift = np.insert(relative_drift, places, added)
    relative_shear = np.insert(relative_shear, places, added_shear)
    fits = [fit(relative_drift, relative_shear, start) for start in _START_DRIFTS]
    numbers, sum_of_squares = min(fits, key=lambda fitted: fitted[1])
    law = make_law(numbers, max_drift, max_shear)
    return CurveFit(story, law, float(np.sqrt(sum_of_squares / relative_drift.size)))


FittedNumbers = tuple[Array, float]
"""Fitted relative values of a law, and the sum of the squared differences of relative shears."""


def _fit_slopes(
    drift: Array, shear: Array, corners: Array, *, is_flat: bool
) -> tuple[Array, Array]:
    """Fit a polygon with given corners through the origin to a curve, by least squares. Return the
    slope of each segment, zero or positive, and the shears of the curve minus the shears of the
    polygon.

    With `is_flat`, the slope after the last corner is zero and omitted from the result.
    """
    from scipy.optimize import nnls

    # Drifts are relative to the maximum drift. The last segment ends at the maximum drift (1), or
    # directly after the last corner if this corner is at a larger drift.
    end = max(1.0, float(np.max(corners)) + 1e-9)
    edges = np.concatenate([[0.0], np.sort(corners), [end]])
    # Column j contains the part of each drift that is within segment j. The shear of the polygon is
    # the sum of these parts times the slopes.
    segments = [np.clip(drift - low, 0.0, high - low) for low, high in pairwise(edges)]
    basis = np.column_stack(segments[:-1] if is_flat else segments)
    slopes, _ = nnls(basis, shear)
    return np.asarray(slopes), np.asarray(shear - basis @ slopes)


def _fit_polygon(
    start_fractions: tuple[float, ...],
    is_flat: bool,
    drift: Array,
    shear: Array,
    start_drift: float,
) -> FittedNumbers:
    """Fit the corners and slopes of a polygon to a curve, by least squares. Return the relative
    drifts of the corners followed by the slopes of the segments, and the sum of the squared
    differences of relative shears.

    The start values of the drifts of the corners are fractions of `start_drift`. With `is_flat`,
    the slope after the last corner is zero.
    """
    from scipy.optimize import minimize

    # A corner before the first points is not determined by the data.
    min_corner = 0.5 * float(drift[drift > 0.0][0])

    def sum_of_squares(corners: Array) -> float:
        """Return the sum of the squared residuals for corners, which are clipped to the data."""
        clipped = np.clip(corners, min_corner, 1.0)
        _, residuals = _fit_slopes(drift, shear, clipped, is_flat=is_flat)
        return float(np.sum(residuals**2))

    # Search only for the corners, because the slopes for given corners are a linear problem.
    start = start_drift * np.array(start_fractions)
    options = {"xatol": 1e-7, "fatol": 1e-14}
    best = minimize(sum_of_squares, start, method="Nelder-Mead", options=options).x
    corners = np.sort(np.clip(best, min_corner, 1.0))
    slopes, _ = _fit_slopes(drift, shear, corners, is_flat=is_flat)
    return np.concatenate([corners, slopes]), sum_of_squares(corners)


def _fit_backbone(drift: Array, shear: Array, start_drift: float) -> FittedNumbers:
    """Fit a backbone curve with four points, the last at the maximum drift, to a story curve by
    least squares. Return the relative drifts of the points followed by their relative shears (zero
    or positive), and the sum of the squared differences of relative shears.
    """
    from scipy.optimize import minimize, nnls

    # A point before the first points of the curve is not determined by the data.
    min_drift = 0.5 * float(drift[drift > 0.0][0])

    def drifts_of_points(tried: Array) -> Array:
        """Return the drifts of the four points for three drifts of the search, in any order.

        Successive points have at least the distance `_MIN_DISTANCE`, because two points with the
        same drift would be a jump of the force.
        """
        ordered = np.sort(np.clip(tried, min_drift, 1.0))
        # The maxima keep the minimum distance to the later points, the last point is at 1.
        maximum = 1.0 - _MIN_DISTANCE * np.arange(3, 0, -1)
        return np.append(np.minimum(ordered + _MIN_DISTANCE * np.arange(3), maximum), 1.0)

    def fit_shears(drifts: Array) -> tuple[Array, float]:
        """Return the best shears of points with given drifts, and the sum of squares.

        The curve is linear between the points, so the shears follow from a linear problem. Column j
        of its matrix is the curve with shear 1 at point j and 0 at the origin and all other points.
        """
        unit_shears = np.eye(5)[1:]  # rows: points; columns: origin and points
        matrix = np.column_stack(
            [np.interp(drift, np.append(0.0, drifts), unit_shear) for unit_shear in unit_shears]
        )
        shears, residual_norm = nnls(matrix, shear)
        return np.asarray(shears), float(residual_norm**2)

    def sum_of_squares(tried: Array) -> float:
        """Return the sum of squares for three drifts of the search."""
        return fit_shears(drifts_of_points(tried))[1]

    # The search starts with a point before the start drift, and a second point midway to the
    # maximum drift.
    start = np.array([0.3 * start_drift, start_drift, 0.5 * (1.0 + start_drift)])
    options = {"xatol": 1e-7, "fatol": 1e-14, "maxiter": 2000}
    best = minimize(sum_of_squares, start, method="Nelder-Mead", options=options).x
    drifts = drifts_of_points(best)
    shears, squares = fit_shears(drifts)
    return np.concatenate([drifts, shears]), squares


def _bilinear_law(fitted: Array, max_drift: float, max_shear: float) -> FittedLaw:
    """Return a bilinear law from its relative corner drift and the two relative slopes.

    `fitted` is the relative drift of the corner, slope before it and slope after it. `max_drift`
    and `max_shear` are the maximum drift (m) and shear (N) of the curve.
    """
    corner, first_slope, second_slope = fitted
    # The hardening ratio of the law must be less than 1.
    hardening = float(np.clip(second_slope / first_slope, 0.0, 0.999))
    yield_force = float(first_slope * corner * max_shear)
    return FittedLaw(
        "bilinear",
        float(first_slope * max_shear / max_drift),
        (("yield_force", yield_force, "force"), ("hardening", hardening, "")),
    )


def _trilinear_law(fitted: Array, max_drift: float, max_shear: float) -> FittedLaw:
    """Return a trilinear law from the relative drifts of the yield point and the ultimate point,
    and the relative slopes before the yield point and between the points. The maximum drift (m) and
    shear (N) are the values of the curve.
    """
    yield_drift, ultimate_drift, first_slope, second_slope = fitted
    yield_force = float(first_slope * yield_drift * max_shear)
    ultimate_force = yield_force + float(second_slope * (ultimate_drift - yield_drift) * max_shear)
    parameters = (
        ("yield_force", yield_force, "force"),
        ("ultimate_force", ultimate_force, "force"),
        ("ultimate_drift", float(ultimate_drift * max_drift), "length"),
        ("pinching", 1.0, ""),
        ("unloading", 0.0, ""),
    )
    return FittedLaw("trilinear-pinching", float(first_slope * max_shear / max_drift), parameters)


def _multilinear_law(fitted: Array, max_drift: float, max_shear: float) -> FittedLaw:
    """Return a multilinear law from the relative drifts and shears of its points.

    `fitted` contains the relative drifts of four points, followed by their relative shears.
    `max_drift` and `max_shear` are the maximum drift (m) and shear (N) of the curve.
    """
    drifts = max_drift * fitted[:4]
    shears = max_shear * np.maximum(fitted[4:], _MIN_SHEAR)
    backbone = tuple(zip(drifts.tolist(), shears.tolist(), strict=True))
    return FittedLaw("multilinear-pinching", float(shears[0] / drifts[0]), (), backbone)


FITTED_LAWS: dict[
    str,
    tuple[
        Callable[[Array, Array, float], FittedNumbers], Callable[[Array, float, float], FittedLaw]
    ],
] = {
    "bilinear": (partial(_fit_polygon, (1.0,), False), _bilinear_law),
    "trilinear": (partial(_fit_polygon, (0.4, 1.0), True), _trilinear_law),
    "multilinear": (_fit_backbone, _multilinear_law),
}
"""Functions by the type of the law: the fit of relative values, and the conversion to a law."""
