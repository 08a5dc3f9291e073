"""Tables of buildings: models, modes, statics, inventories, results beside recordings; those of
runs: `responses`."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from itertools import islice
from typing import TYPE_CHECKING, Any

import numpy as np

from tdint.arrays import Array
from tdint.model.definition import LAWS
from tdint.output.tables.table import FLOOR, METHOD_SPEC, PERIOD, Cell, Column, Table, part, rows_of
from tdint.units import SI, OutputUnits

if TYPE_CHECKING:
    from tdint.analysis.compare import Comparison
    from tdint.analysis.fit import FittedValue
    from tdint.analysis.spectra.modal import ModalResponse
    from tdint.analysis.static import CyclicTest, Pushover
    from tdint.analysis.target_displacement import TargetDisplacement
    from tdint.model.definition import Model, Story
    from tdint.model.modes import Modes

CYCLIC = (
    Column("story", "1", "story", "story, from 1 at the ground"),
    Column(
        "step",
        "1",
        lambda test: np.arange(test.path.drift.size),
        "point of the path; 0 is the start at rest",
    ),
    Column("cycle", "1", "cycle_numbers", "cycle, from 1; 0 for the start; empty for a path given"),
    Column("drift_m", "m", "path.drift", "imposed drift"),
    Column(
        "drift_ratio", "1", lambda test: test.path.drift / test.height, "drift over story height"
    ),
    Column("shear_N", "N", "path.shear", "restoring force of the law"),
    Column(
        "shear_with_p_delta_N",
        "N",
        "shear_with_p_delta",
        "restoring force with the geometric stiffness",
    ),
    Column("tangent_stiffness_N_m", "N/m", "path.tangent", "tangent stiffness of the law"),
    Column("strain_energy_J", "J", "path.strain_energy", "energy that the law stores"),
    Column("hysteretic_energy_J", "J", "path.hysteretic_energy", "energy dissipated so far"),
)


_SHEAR_BEAM = Column(
    "period_shear_beam_s", "s", "building.period", "fundamental period of the shear building"
)
_OF_STORIES = (
    Column("damping_ratio", "1", "building.damping_ratio", "viscous damping ratio"),
    Column(
        "story",
        "1",
        lambda one: np.arange(1, one.building.mass.size + 1),
        "story, from 1 at the ground",
    ),
    Column("mass_kg", "kg", "building.mass", "mass of the floor"),
    Column("height_m", "m", "building.height", "story height"),
)
INVENTORY = (
    Column("id", "text", "row.id", "id of the building"),
    Column(
        "design_level", "text", "building.design_level", "design level: pre, low, moderate, high"
    ),
    Column("hazus_type", "text", "building.type", "structure type with its class of height"),
    Column("period_rule_s", "s", "building.rule_period", "fundamental period by the rules"),
    _SHEAR_BEAM,
    *_OF_STORIES,
    Column("stiffness_N_m", "N/m", "building.stiffness", "initial stiffness"),
    Column("yield_force_N", "N", "building.yield_force", "force at first yield"),
    Column("ultimate_force_N", "N", "building.ultimate_force", "largest force"),
    Column("yield_drift_m", "m", "building.yield_drift", "drift at first yield"),
    Column(
        "ultimate_drift_m",
        "m",
        "building.ultimate_drift",
        "drift at which the largest force is reached",
    ),
    Column(
        "pinching",
        "1",
        "building.pinching",
        "part of the force at which the first part of reloading ends",
    ),
    Column("unloading_exponent", "1", "building.unloading", "exponent of the unloading stiffness"),
)
OF_CLASSES = (
    INVENTORY[0],
    Column("class", "text", "building.name", "class of the building"),
    Column(
        "period_curve_s",
        "s",
        "building.curve_period",
        "period of the first line of the capacity curve",
    ),
    _SHEAR_BEAM,
    Column(
        "participation",
        "1",
        "building.participation",
        "roof displacement over spectral displacement",
    ),
    *_OF_STORIES,
    *(
        Column(
            f"{name}_{point + 1}_{unit}",
            unit,
            part(f"building.{of}", np.s_[:, point]),
            f"{name} of point {point + 1} of the backbone",
        )
        for point in range(4)
        for name, unit, of in (("drift", "m", "drifts"), ("force", "N", "forces"))
    ),
)
"""Of buildings with capacity curves."""


def pushover(stories: int) -> tuple[Column, ...]:
    """The columns of a pushover of a building with so many stories."""
    return (
        Column(
            "step",
            "1",
            lambda result: np.arange(result.base_shear.size),
            "step; 0 is the start at rest",
        ),
        Column("roof_displacement_m", "m", "roof_displacement", "relative to the ground"),
        Column(
            "roof_drift_ratio",
            "1",
            "roof_drift_ratio",
            "roof displacement over the height of the building",
        ),
        Column("base_shear_N", "N", "base_shear", "sum of the forces on the floors"),
        *(
            Column(
                f"story_{i + 1}_drift_m",
                "m",
                part("drift", np.s_[:, i]),
                "relative to the floor below",
            )
            for i in range(stories)
        ),
    )


def pushover_table(result: Pushover) -> Table:
    """One row per step; row 0 is the start at rest."""
    return Table.of_results(pushover(result.drift.shape[1]), [result])


TARGET_DISPLACEMENT = (
    Column(
        "method", "text", "method", "n2 (EN 1998-1, annex B) or coefficients (ASCE 41-17, 7.4.3.3)"
    ),
    Column(
        "story", "1", lambda made: np.arange(1, made.drift.size + 1), "story, from 1 at the ground"
    ),
    Column("drift_m", "m", "drift", "drift at the target displacement"),
    Column("drift_ratio", "1", "drift_ratio", "that over the story height"),
    Column("ductility", "1", "ductility", "that over the drift at first yield"),
)
TARGET_OF_BUILDING = (
    TARGET_DISPLACEMENT[0],
    Column("roof_displacement_m", "m", "roof_displacement", "target displacement of the roof"),
    Column("base_shear_N", "N", "base_shear", "base shear there"),
    Column("period_s", "s", "period", "period of the equivalent oscillator: T*, Te"),
    Column("sa_m_s2", "m/s^2", "spectral_acceleration", "of the target spectrum at that period"),
    Column(
        "participation", "1", "participation", "roof displacement over the oscillator's: Gamma, C0"
    ),
    Column(
        "mass_kg", "kg", "mass", "of the equivalent oscillator; of the building with coefficients"
    ),
    Column("yield_force_N", "N", "yield_force", "base shear at which the idealized curve yields"),
    Column(
        "yield_displacement_m", "m", "yield_displacement", "roof displacement at which it yields"
    ),
    Column("strength_ratio", "1", "strength_ratio", "elastic force over yield force"),
    Column("c1", "1", part("factors", 0), "C1; with n2 the displacement over the elastic one"),
    Column("c2", "1", part("factors", 1), "C2; 1 with n2"),
)


def target_table(results: Sequence[TargetDisplacement]) -> Table:
    """One row per method and story."""
    return Table.of_results(TARGET_DISPLACEMENT, results)


def target_building_table(results: Sequence[TargetDisplacement]) -> Table:
    """One row per method: the oscillators and where they are pushed to."""
    return Table.of_results(TARGET_OF_BUILDING, results)


_COMBINED = (
    ("srss", "square root of the sum of squares"),
    ("cqc", "complete quadratic combination"),
)
MODAL_RESPONSE = (
    Column(
        "story",
        "1",
        lambda made: np.arange(1, made.drift_cqc.size + 1),
        "story, from 1 at the ground",
    ),
    *(
        Column(f"drift_{rule}_m", "m", f"drift_{rule}", f"drift, {words}")
        for rule, words in _COMBINED
    ),
    Column(
        "drift_ratio_cqc",
        "1",
        lambda made: made.drift_cqc / made.height,
        "drift_cqc_m over the story height",
    ),
    *(
        Column(f"shear_{rule}_N", "N", f"shear_{rule}", f"story shear, {words}")
        for rule, words in _COMBINED
    ),
    *(
        Column(
            f"displacement_{rule}_m",
            "m",
            f"displacement_{rule}",
            f"of the floor to the ground, {words}",
        )
        for rule, words in _COMBINED
    ),
    Column(
        "absolute_acceleration_cqc_m_s2",
        "m/s^2",
        "acceleration_cqc",
        "of the floor, forces over mass",
    ),
    Column("floor_force_cqc_N", "N", "force_cqc", "on the floor above the story"),
    Column("overturning_moment_cqc_Nm", "N*m", "moment_cqc", "at the foot of the story"),
)
MODAL_SHARE = (
    Column(
        "mode",
        "1",
        lambda made: np.arange(1, made.period.size + 1),
        "mode, from 1 at the longest period",
    ),
    Column("period_s", "s", "period", "natural period"),
    Column(
        "sa_m_s2", "m/s^2", "spectral_acceleration", "of the target; 0 of a mode that is left out"
    ),
    Column("mass_ratio", "1", "mass_ratio", "effective modal mass over the total mass"),
    Column("base_shear_N", "N", "base_shear", "of the mode alone"),
    Column(
        "base_shear_share",
        "1",
        lambda made: made.base_shear**2 / np.sum(made.base_shear**2),
        "its square over the sum of the squares of all modes",
    ),
)


def modal_share_table(result: ModalResponse) -> Table:
    """One row per mode: what it has in the combined peaks."""
    return Table.of_results(MODAL_SHARE, [result])


def modal_response_table(result: ModalResponse) -> Table:
    """One row per story."""
    return Table.of_results(MODAL_RESPONSE, [result])


OVERVIEW = (
    Column("model", "text", "model.source", "the model file"),
    Column("name", "text", "model.name", "the building's name"),
    Column("stories", "1", "stories", "number of stories"),
    Column("height_m", "m", "height", "height of the building; empty where a story has none"),
    Column("mass_kg", "kg", "mass", "mass of all floors"),
    Column("t1_s", "s", "period", "fundamental period of the initial stiffness, P-delta included"),
    Column(
        "t1_damping",
        "1",
        "damping",
        "viscous damping ratio of the first mode, without power-law dashpots",
    ),
    Column(
        "laws",
        "text",
        "laws",
        "drift laws, with the number of stories of each where there are several",
    ),
    METHOD_SPEC,
    Column("record", "text", "record", "file of the ground motion"),
)

MODE = (
    Column(
        "mode",
        "1",
        lambda modes: np.arange(1, modes.omega.size + 1),
        "mode, from 1 at the longest period",
    ),
    Column("period_s", "s", lambda modes: 2.0 * math.pi / modes.omega, "natural period"),
    Column("frequency_hz", "Hz", lambda modes: modes.omega / (2.0 * math.pi), "natural frequency"),
)
MODE_END = (
    Column(
        "participation", "1", "participation", "participation factor for unit roof displacement"
    ),
    Column("mass_ratio", "1", "mass_ratio", "effective modal mass over the total mass"),
    Column(
        "cumulative_mass_ratio",
        "1",
        lambda modes: np.cumsum(modes.mass_ratio),
        "sum of that up to this mode",
    ),
)


def mode_damping(ratios: Any) -> Column:
    """The column of the modes' damping ratios, shape (n,)."""
    return Column(
        "damping",
        "1",
        lambda modes: ratios,
        "damping ratio, of the mode moving alone where damping couples the modes",
    )


COMPARISON = (
    FLOOR,
    Column(
        "quantity",
        "text",
        "quantity",
        "absolute acceleration, or displacement relative to the base",
    ),
    Column(
        "correlation",
        "1",
        "correlation",
        "Pearson's coefficient of the computed and the recorded motion",
    ),
    Column("peak_ratio", "1", "peak_ratio", "largest absolute value computed over that recorded"),
    Column(
        "rms_difference",
        "1",
        "rms_difference",
        "root mean square of the difference over that of the recording",
    ),
)
COMPARISON_SPECTRA = (
    FLOOR,
    PERIOD,
    Column(
        "computed_sa_m_s2",
        "m/s^2",
        "computed",
        "largest absolute acceleration on the computed motion of the floor",
    ),
    Column(
        "recorded_sa_m_s2",
        "m/s^2",
        "recorded",
        "largest absolute acceleration on the recorded motion of the floor",
    ),
)
FITTED = (
    Column("parameter", "text", "name", "what was fitted, with its unit"),
    Column("place", "1", "place", "its story or mode, from 1; empty where it holds for all"),
    Column("start", "1", "start", "value of the model file"),
    Column("fitted", "1", "value", "value with which the model comes closest to the recording"),
    Column("lower_bound", "1", "low", "least value that the fit may take"),
    Column("upper_bound", "1", "high", "largest value that the fit may take"),
    Column(
        "standard_error",
        "1",
        "standard_error",
        "of the fitted value, for differences that are independent; inf: untold",
    ),
)


def of_event(name: str) -> Column:
    """The column that tells events apart, the last one."""
    return Column("recorded", "text", lambda _: name, "file of the recordings")


def cyclic_table(test: CyclicTest) -> Table:
    """One row per point of the path; row 0 is the start at rest."""
    return Table.of_results(CYCLIC, [test])


MODEL = (
    Column(
        "story",
        "1",
        lambda model: np.arange(1, len(model.stories) + 1),
        "story, from 1 at the ground",
    ),
    Column("mass_kg", "kg", lambda model: _of_stories(model, "mass"), "mass of the floor above"),
    Column("height_m", "m", lambda model: _of_stories(model, "height"), "story height"),
    Column(
        "stiffness_N_m", "N/m", lambda model: _of_stories(model, "stiffness"), "initial stiffness"
    ),
)
"""The stories of a model; words on their laws and dashpots come behind."""


def _of_stories(model: Model, name: str) -> Array:
    return np.array(
        [math.nan if (value := getattr(story, name)) is None else value for story in model.stories]
    )


def law_words(story: Story, units: OutputUnits = SI) -> str:
    """The law of a story with its parameters, named as in a model file; those are left out that say
    nothing by themselves: what they are where a file has none of them, or a negative side like the
    positive one."""
    numbers = iter(story.law.parameters)
    described: list[str] = []
    words: dict[str, tuple[float, ...]] = {}
    for parameter in LAWS[story.law.name].parameters:
        values = tuple(islice(numbers, 8 if parameter.points else None if parameter.many else 1))
        # A default may be another parameter's value, which stands before it.
        usual = (
            words[parameter.default] if isinstance(parameter.default, str) else (parameter.default,)
        )
        words.setdefault(parameter.name, values)
        if values in (usual, (parameter.without,)):
            continue
        # The points of a backbone, force at drift; the numbers of a list; or a single one.
        if parameter.points:
            points = zip(values[::2], values[1::2], strict=True)
            text = ", ".join(
                f"{units.text(force, 'N')} at {units.text(drift, 'm')}" for drift, force in points
            )
        elif parameter.many:
            text = ", ".join(
                _in_units(value, 1, -j, units) for j, value in enumerate(values, start=1)
            )
        else:
            text = _in_units(values[0], parameter.force, parameter.length, units)
        described.append(f"{parameter.path} {text}")
    isolator = "; isolator" if story.isolator else ""
    return story.law.name + (f": {', '.join(described)}" if described else "") + isolator


def _in_units(value: float, force: int, length: int, units: OutputUnits) -> str:
    """A number of the dimension force^i length^j and its unit: 5000 kN/m."""
    above: list[str] = []
    below: list[str] = []
    for si, power in (("N", force), ("m", length)):
        name, factor = units.unit(si)
        value /= factor**power
        (above if power > 0 else below).extend(
            [name if abs(power) == 1 else f"{name}^{abs(power)}"] * bool(power)
        )
    # Powers above and below the stroke, so that a stiffness is in kN/m.
    unit = "/".join(["*".join(above) or "1", *below])
    return f"{value:.4g}" if unit == "1" else f"{value:.4g} {unit}"


def model_table(model: Model, units: OutputUnits = SI) -> Table:
    """One row per story, from the ground up."""
    numbers = Table.of_results(MODEL, [model]).in_units(units)
    (force, newton), (speed, rate) = units.unit("N"), units.unit("m/s")
    rows = []
    for row, story in zip(numbers.rows, model.stories, strict=True):
        # Force over the rate of drift v: of a dashpot, or of one that follows a power law.
        power = story.power_dashpot
        coefficient, exponent = (
            (story.dashpot, 1.0) if power is None else (power.coefficient, power.exponent)
        )
        dashpot = ""
        if coefficient:
            law = "v" if exponent == 1.0 else f"v^{exponent:g}"
            below = (
                f"; linear below {power.linear_below / rate:.4g} {speed}"
                if power and power.linear_below
                else ""
            )
            dashpot = (
                f"{coefficient * rate**exponent / newton:.4g} {law} ({force}; v in {speed}{below})"
            )
        rows.append((*row, law_words(story, units), dashpot))
    return replace(numbers, columns=(*numbers.columns, "law", "dashpots"), rows=rows)


def mode_table(modes: Modes, damping: Array, norm: str | None = None) -> Table:
    """One row per mode, longest period first, with damping ratios of shape (n,); with `norm` a
    column for the ordinate of each floor (`tdint.model.modes.Modes.normalized`)."""
    shapes = modes.normalized(norm) if norm else ()
    size = "1 at the roof" if norm == "roof" else "with a participation factor of 1"
    meaning = f"ordinate of the mode at the floor, {size}"
    floors = (
        Column(f"floor_{floor}_shape", "1", shape, meaning)
        for floor, shape in enumerate(shapes, start=1)
    )
    return Table.of_results((*MODE, mode_damping(damping), *MODE_END, *floors), [modes])


def comparison_table(comparisons: Sequence[Comparison]) -> Table:
    """A row per floor; of several events, the file of each in the last column."""
    return _by_event(COMPARISON, [(comparison, comparison.floors) for comparison in comparisons])


def comparison_spectra_table(
    comparisons: Sequence[Comparison], periods: Array, damping: float
) -> Table:
    """A row per floor and period; of several events, the file of each in the last column."""
    return _by_event(
        COMPARISON_SPECTRA,
        [(comparison, comparison.spectra(periods, damping)) for comparison in comparisons],
    )


def fitted_table(values: Sequence[FittedValue], units: OutputUnits = SI) -> Table:
    """A row per fitted value, whose name says its unit."""
    return Table.of_results(FITTED, [fitted_in(value, units) for value in values])


def fitted_in(value: FittedValue, units: OutputUnits) -> FittedValue:
    """A fitted value in other units, with the name that goes with them."""
    name, factor = units.column(value.name, value.unit)
    numbers = {
        key: getattr(value, key) / factor
        for key in ("start", "value", "low", "high", "standard_error")
    }
    return replace(value, name=name, **numbers)


def _by_event(
    columns: Sequence[Column], events: Sequence[tuple[Comparison, Sequence[object]]]
) -> Table:
    rows: list[tuple[Cell, ...]] = []
    for comparison, results in events:
        # Of a single event the caller knows which one it is.
        every = (
            (*columns, of_event(comparison.event.recording.source)) if len(events) > 1 else columns
        )
        rows += [row for result in results for row in rows_of(every, result)]
    return Table.of((*columns, of_event("")) if len(events) > 1 else columns, rows)
