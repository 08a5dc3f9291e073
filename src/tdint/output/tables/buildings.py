"""Tables of buildings: models, modes, static analyses, inventories and comparisons with recordings.

Tables of runs are in `responses`.
"""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from itertools import groupby
from typing import TYPE_CHECKING, Any

import numpy as np

from tdint.arrays import Array
from tdint.model.story import Story, column_name
from tdint.model.story_laws import Law, default_numbers, named_parameters
from tdint.output.tables.columns import declared
from tdint.output.tables.table import (
    METHOD_SPEC,
    TEXT,
    Cell,
    Column,
    Table,
    numbered,
    placeholder,
)
from tdint.units import SI, OutputUnits

if TYPE_CHECKING:
    from tdint.model.capacity import CapacityBuilding
    from tdint.model.definition import Model
    from tdint.model.mdof_lu import DerivedBuilding
    from tdint.model.modes import ComplexModes, Modes
    from tdint.response.overview import Overview
    from tdint.response.spectra.modal import ModalResponse
    from tdint.response.static.cyclic import CyclicTest
    from tdint.response.static.pushover import Pushover
    from tdint.response.static.target_displacement import TargetDisplacement

_test: CyclicTest = placeholder()
CYCLIC = declared(
    "buildings.cyclic",
    _test.path,
    story=_test.story,
    step=numbered(_test.path.drift, 0),
    cycle=_test.cycle_numbers,
    shear_with_p_delta_N=_test.shear_with_p_delta,
    tangent_stiffness_N_m=_test.path.tangent,
    drift_ratio=lambda test: test.path.drift / test.height,
)


_building: DerivedBuilding = placeholder().building
_capacity: CapacityBuilding = placeholder().building
(_SHEAR_BEAM,) = declared("buildings.shear_beam", period_shear_beam_s=_building.period)
_STORIES_COLUMNS = declared("buildings.stories_columns", _building, story=numbered(_building.mass))
INVENTORY = (
    *declared(
        "buildings.inventory-1",
        _building,
        id=placeholder().row.id,
        hazus_type=_building.type,
        period_rule_s=_building.rule_period,
    ),
    _SHEAR_BEAM,
    *_STORIES_COLUMNS,
    *declared("buildings.inventory-2", _building, unloading_exponent=_building.unloading),
)
CLASS_COLUMNS = (
    INVENTORY[0],
    *declared(
        "buildings.class_columns",
        **{"class": _capacity.name, "period_curve_s": _capacity.curve_period},
    ),
    _SHEAR_BEAM,
    Column(
        "participation",
        "1",
        _capacity.participation,
        "roof displacement divided by spectral displacement",
    ),
    *_STORIES_COLUMNS,
    *(
        Column(
            f"{name}_{point + 1}_{unit}",
            unit,
            values[:, point],
            f"{name} of point {point + 1} of the backbone",
        )
        for point in range(4)
        for name, unit, values in (
            ("drift", "m", _capacity.drifts),
            ("force", "N", _capacity.forces),
        )
    ),
)
"""Columns of buildings with capacity curves."""


_pushover: Pushover = placeholder()


def pushover(stories: int) -> tuple[Column, ...]:
    """Return the columns of the table of a pushover analysis, with a column for the drift of each
    story. `stories` is the number of stories."""
    return (
        Column("step", "1", numbered("applied_force", 0), "load step; 0 is the undeformed state"),
        Column.named("roof_displacement", "roof displacement relative to the ground", "m"),
        Column.named("roof_drift_ratio", "roof displacement divided by the height of the building"),
        Column.named("base_shear", "base shear: restoring force of the first story", "N"),
        Column.named("applied_force", "sum of the forces on the floors", "N"),
        *(
            Column(
                f"story_{i + 1}_drift_m",
                "m",
                _pushover.drift[:, i],
                "drift: displacement relative to the floor below",
            )
            for i in range(stories)
        ),
    )


def pushover_table(result: Pushover) -> Table:
    """Return the table of a pushover, with a row per load step; row 0 is the undeformed state."""
    return Table.of_results(pushover(result.drift.shape[1]), [result])


ELEMENT_EVENTS = declared("buildings.element_events")
"""Changes of stiffness of the elements of stories with several elements in a pushover."""


_target: TargetDisplacement = placeholder()
TARGET_DISPLACEMENT = declared("buildings.target_displacement", story=numbered("drift"))
TARGET_OF_BUILDING = (
    TARGET_DISPLACEMENT[0],
    *declared(
        "buildings.target_of_building",
        sa_m_s2=_target.spectral_acceleration,
        c1=_target.factors[0],
        c2=_target.factors[1],
        a=_target.site_factor,
        mu_max=_target.largest_ratio,
    ),
)


_COMBINED = (
    ("srss", "square root of the sum of squares"),
    ("cqc", "complete quadratic combination"),
)
_modal: ModalResponse = placeholder()
MODAL_RESPONSE = (
    Column("story", "1", numbered("drift_cqc"), "story, numbered from the ground"),
    *(
        Column(f"drift_{rule}_m", "m", f"drift_{rule}", f"drift, {text}")
        for rule, text in _COMBINED
    ),
    *declared(
        "buildings.modal_response-1",
        drift_ratio_cqc=lambda result: result.drift_cqc / result.height,
    ),
    *(
        Column(f"shear_{rule}_N", "N", f"shear_{rule}", f"story shear, {text}")
        for rule, text in _COMBINED
    ),
    *(
        Column(
            f"displacement_{rule}_m",
            "m",
            f"displacement_{rule}",
            f"floor displacement relative to the ground, {text}",
        )
        for rule, text in _COMBINED
    ),
    *declared(
        "buildings.modal_response-2",
        absolute_acceleration_cqc_m_s2=_modal.acceleration_cqc,
        floor_force_cqc_N=_modal.force_cqc,
        overturning_moment_cqc_Nm=_modal.moment_cqc,
    ),
)
MODAL_SHARE = declared(
    "buildings.modal_share",
    mode=numbered("period"),
    sa_m_s2=_modal.spectral_acceleration,
    base_shear_share=lambda result: result.base_shear**2 / np.sum(result.base_shear**2),
)


def _finite(values: Any) -> Any:
    """Replace infinity by nan, an empty cell: the period and the damping ratio of a mode without
    stiffness."""
    return np.where(np.isfinite(values), values, np.nan)


_overview: Overview = placeholder()
OVERVIEW = (
    *declared(
        "buildings.overview",
        model=_overview.model.source,
        name=_overview.model.name,
        t1_s=lambda overview: float(_finite(overview.period)),
        t1_damping=lambda overview: float(_finite(overview.damping)),
    ),
    METHOD_SPEC,
    Column.named("record", "file of the ground motion", TEXT),
)
OVERVIEW_WITH_DAMPERS = (
    *OVERVIEW,
    *declared(
        "buildings.overview_with_dampers",
        complex_t1_s=_overview.complex_period,
        complex_t1_damping=_overview.complex_damping,
    ),
)
"""Columns of the overview of models if at least one model has dampers."""

MODE = declared(
    "buildings.mode", mode=numbered("omega"), period_s=lambda modes: _finite(modes.period)
)
MODE_END = declared(
    "buildings.mode_end", cumulative_mass_ratio=lambda modes: np.cumsum(modes.mass_ratio)
)


def mode_damping(ratios: Any) -> Column:
    """Return the column of the damping ratios of modes. `ratios` are the cells, shape (modes,)."""
    return Column(
        "damping",
        "1",
        lambda modes: None if ratios is None else _finite(ratios),
        "damping ratio; if damping couples the modes, of the mode without the coupling terms",
    )


_complex: ComplexModes = placeholder()
COMPLEX_MODE = declared(
    "buildings.complex_mode",
    complex_period_s=_complex.natural_period,
    complex_damping=_complex.damping,
)
"""Columns of the modes of a building with dampers (`tdint.model.modes.ComplexModes`)."""


MODEL = declared(
    "buildings.model",
    story=numbered("stories"),
    mass_kg=lambda model: _story_values(model, "mass"),
    height_m=lambda model: _story_values(model, "height"),
    stiffness_N_m=lambda model: _story_values(model, "stiffness"),
)
"""Stories of a model; the text columns of hysteretic laws and dashpots follow."""
DEVICE = declared("buildings.device")
"""Attachments and links of a model; the text columns of hysteretic laws and dashpots follow."""


def _story_values(model: Model, name: str) -> Array:
    """Return the attribute `name` of all stories of a model, shape (stories,); nan for a story
    without a value."""
    values = [getattr(story, name) for story in model.stories]
    return np.array([math.nan if value is None else value for value in values])


def law_words(story: Story, units: OutputUnits = SI) -> str:
    """Return the hysteretic law of a story as text: its name and its parameters, with the names of
    a model file. The elements of a story are separated by semicolons.
    """
    texts = []
    for spring in story.springs:
        parameters = _law_parameters(spring.law, units)
        listed = ", ".join(f"{name} {text}" for name, text in parameters.items())
        text = f"{spring.law.name}: {listed}" if listed else spring.law.name
        if spring.name:
            stiffness = units.text(spring.stiffness, "N/m")
            text = f"{spring.name}: {text.replace(':', ',', 1)}, stiffness {stiffness}"
        if spring.factor != 1.0:
            text += f" (in the direction of the drift; factor {spring.factor:.4g})"
        texts.append(text)
    return "; ".join([*texts, "isolator"] if story.isolator else texts)


def _law_parameters(law: Law, units: OutputUnits) -> dict[str, str]:
    """Return the values of the parameters of a law as texts, by their names in a model file.

    Parameters are omitted if their value is the default, or if the negative side is equal to the
    positive side.
    """
    texts: dict[str, str] = {}
    values_by_name: dict[str, tuple[float, ...]] = {}
    named = zip(named_parameters(law), law.parameters, strict=True)
    for parameter, group in groupby(named, key=lambda item: item[0][-1]):
        numbers = list(group)
        values = tuple(value for _, value in numbers)
        default = default_numbers(parameter, values_by_name)
        values_by_name.setdefault(parameter.name, values)
        # Omit a parameter with its default, or with the value that has no effect (`without`).
        if values in (default, (parameter.without,)):
            continue
        # The value is a list of backbone points (force at drift), a list of numbers, or a single
        # number.
        if parameter.points:
            points = [
                point
                for point in zip(values[::2], values[1::2], strict=True)
                if point[0] < math.inf
            ]
            text = ", ".join(
                f"{units.text(force, 'N')} at {units.text(drift, 'm')}" for drift, force in points
            )
        elif parameter.choices:
            text = parameter.choices[int(values[0])]
        else:
            text = ", ".join(
                _in_units(value, force, length, units) for (_, force, length, _), value in numbers
            )
        texts[parameter.path] = text
    return texts


def _in_units(value: float, force: int, length: float, units: OutputUnits) -> str:
    """Return a number with its unit as text, for example 5000 kN/m."""
    numerator: list[str] = []
    denominator: list[str] = []
    for si, power in (("N", force), ("m", length)):
        if not power:
            continue
        name, factor = units.unit(si)
        value /= factor**power
        factor_text = name if abs(power) == 1 else f"{name}^{abs(power)}"
        (numerator if power > 0 else denominator).append(factor_text)
    unit = "/".join(["*".join(numerator) or "1", *denominator])
    return f"{value:.4g}" if unit == "1" else f"{value:.4g} {unit}"


def model_table(model: Model, units: OutputUnits = SI) -> Table:
    """Return the table of a model with a row per story, from the ground up.

    Returns
    -------
    Table
        Mass, height and stiffness, the hysteretic law with a column for each of its parameters, and
        the dashpot as text. The law of a story with several elements is one text.
    """
    numbers = Table.of_results(MODEL, [model]).in_units(units)
    laws, parameters = [], []
    for story in model.stories:
        is_single = len(story.springs) == 1 and story.springs[0].factor == 1.0
        laws.append(
            f"{story.law.name}{'; isolator' if story.isolator else ''}"
            if is_single
            else law_words(story, units)
        )
        parameters.append(_law_parameters(story.law, units) if is_single else {})
    columns, meanings = [], dict(numbers.meanings)
    for name in dict.fromkeys(name for texts in parameters for name in texts):
        cells, unit = _numbers_of_texts([texts.get(name, "") for texts in parameters])
        columns.append(cells)
        meanings[name] = {"meaning": "parameter of the law", "unit": unit}
    dashpots = [_dashpot_text(story, units) for story in model.stories]
    rows = [
        (*row, *cells) for row, *cells in zip(numbers.rows, laws, *columns, dashpots, strict=True)
    ]
    names = (*numbers.columns, "law", *list(meanings)[len(numbers.meanings) :], "dashpots")
    return Table(names, rows, meanings)


def _numbers_of_texts(texts: Sequence[str]) -> tuple[list[Cell], str]:
    """Return numbers and their unit from texts with a common unit; otherwise the texts and
    `TEXT`. An empty text has no number."""
    found = [re.fullmatch(r"(-?[\d.]+(?:e[-+]\d+)?)(?: (\S+))?", text) for text in texts]
    units = {match[2] or "1" for match in found if match}
    if len(units) != 1 or any(text and not match for text, match in zip(texts, found, strict=True)):
        return list(texts), TEXT
    return [float(match[1]) if match else None for match in found], units.pop()


def device_model_table(model: Model, units: OutputUnits = SI) -> Table | None:
    """Return the table of the attachments and links of a model: place, mass, stiffness, hysteretic
    law and dashpot; None without devices."""
    if not model.devices:
        return None
    places = [
        *(f"floor {item.floor}" if item.floor else "ground" for item in model.attachments),
        *(" to ".join(map(model.end_name, item.ends)) for item in model.links),
    ]
    numbers = Table.of(
        DEVICE,
        [
            (item.name, place, item.spring.mass or None, item.spring.stiffness or None)
            for item, place in zip(model.devices, places, strict=True)
        ],
    ).in_units(units)
    rows = [
        (
            *row,
            law_words(item.spring, units) if item.spring.stiffness else "",
            _dashpot_text(item.spring, units),
        )
        for row, item in zip(numbers.rows, model.devices, strict=True)
    ]
    return numbers._replace(columns=(*numbers.columns, "law", "dashpot"), rows=rows)


def _dashpot_text(story: Story, units: OutputUnits) -> str:
    """Return the force of the linear or power-law dashpot of a story as a function of the drift
    rate v, for example `20 v^0.5 (kN; v in m/s)`; an empty text without a dashpot.

    With a brace, v is the rate of the damper.
    """
    power_law = story.power_dashpot
    if power_law is None:
        coefficient, exponent = story.dashpot, 1.0
    else:
        coefficient, exponent = power_law.coefficient, power_law.exponent
    if not coefficient:
        return ""
    (force_unit, newtons), (rate_unit, meters_per_second) = units.unit("N"), units.unit("m/s")
    function = "v" if exponent == 1.0 else f"v^{exponent:g}"
    linear_text = ""
    if power_law and power_law.linear_below:
        linear_text = f"; linear below {power_law.linear_below / meters_per_second:.4g} {rate_unit}"
    # The coefficient is in N/(m/s)^exponent.
    number = coefficient * meters_per_second**exponent / newtons
    text = f"{number:.4g} {function} ({force_unit}; v in {rate_unit}{linear_text})"
    if power_law and power_law.brace is not None:
        stiffness_unit, newtons_per_meter = units.unit("N/m")
        text += f", brace {power_law.brace / newtons_per_meter:.4g} {stiffness_unit}"
    if story.damper_factor != 1.0:
        text += f", factor {story.damper_factor:.4g}"
    return text


def mode_table(
    modes: Modes,
    damping: Array | None,
    norm: str | None = None,
    *,
    names: Sequence[str] = (),
    complex_modes: ComplexModes | None = None,
) -> Table:
    """Return the table of the modes of a building, with a row per mode, longest period first.

    Parameters
    ----------
    damping : ndarray, shape (modes,), or None
        Damping ratios; None for empty cells.
    complex_modes : ComplexModes, optional
        Damped modes, which add columns.
    norm : str, optional
        Normalization of the mode shapes (`tdint.model.modes.Modes.normalized`). If it is specified,
        the table has a column with the ordinates of the mode shapes for each name.
    names : sequence of str
        Names of floors and attachments, or rows of a model of matrices, in the names of columns.
    """
    # Rotations of floors are not shown.
    shapes = zip(names, modes.normalized(norm)[: len(names)], strict=True) if norm else ()
    scale_text = "1 at the roof" if norm == "roof" else "with a participation factor of 1"
    meaning = f"ordinate of the mode at the floor, {scale_text}"
    shape_columns = [
        Column(f"{column_name(name)}_shape", "1", shape, meaning) for name, shape in shapes
    ]
    columns = (*MODE, mode_damping(damping), *MODE_END)
    shown_shapes = shape_columns, modes if shape_columns else None
    return Table.joined((columns, modes), (COMPLEX_MODE, complex_modes), shown_shapes)
