"""Columns of buildings: runs, histories, statics, modes, inventories, results beside recordings."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np

from tdint.analysis.run.outcome import ENERGY_TERMS
from tdint.output.tables.columns.shared import FLOOR, METHOD_SPEC, PERIOD
from tdint.output.tables.table import Column, error_columns


def _counted(result: Any) -> Any:
    return np.arange(1, result.peak_drift.size + 1)


STORY = (
    Column("story", _counted, "story, or the floor above it, from 1 at the ground"),
    Column("height_m", "height", "story height"),
    Column("peak_drift_m", "peak_drift", "largest drift to either side: displacement relative to the floor below"),
    Column("peak_drift_ratio", "peak_drift_ratio", "peak drift over story height"),
    Column("residual_drift_m", "residual_drift", "drift at the end of the run"),
    Column("peak_shear_N", "peak_shear", "largest restoring force of the story to either side, without viscous forces"),
    Column("ductility", "ductility", "peak drift over drift at first yield"),
    Column("peak_displacement_m", "peak_displacement", "largest displacement of the floor, relative to the ground"),
    Column("peak_velocity_m_s", "peak_velocity", "largest velocity of the floor, relative to the ground"),
    Column("peak_absolute_acceleration_m_s2", "peak_acceleration", "largest absolute acceleration of the floor"),
)
STORY_ERROR = error_columns(STORY[2:])

HISTORY_START = (
    Column("time_s", "time", "time from the first sample"),
    Column("ground_acceleration_m_s2", "ground_acceleration", "acceleration of the ground"),
)
HISTORY_FLOOR = (
    Column("displacement_m", "displacement", "relative to the ground"),
    Column("velocity_m_s", "velocity", "relative to the ground"),
    Column("absolute_acceleration_m_s2", "acceleration", "absolute, from equilibrium"),
)
HISTORY_STORY = (
    Column("drift_m", "drift", "relative to the floor below"),
    Column("shear_N", "shear", "restoring force, without viscous forces"),
)
HISTORY_ENERGY = (
    *(Column(f"energy_{name}_J", f"energy.{name}", meaning) for name, meaning in ENERGY_TERMS.items()),
    Column("energy_error", "energy.error", "imbalance over the largest input energy of the run"),
)

CYCLIC = (
    Column("story", "story", "story, from 1 at the ground"),
    Column("step", lambda test: np.arange(test.path.drift.size), "point of the path; 0 is the start at rest"),
    Column("cycle", "cycle_numbers", "cycle, from 1; 0 for the start; empty for a path given"),
    Column("drift_m", "path.drift", "imposed drift"),
    Column("drift_ratio", lambda test: test.path.drift / test.height, "drift over story height"),
    Column("shear_N", "path.shear", "restoring force of the law"),
    Column("shear_with_p_delta_N", "shear_with_p_delta", "restoring force with the geometric stiffness"),
    Column("tangent_stiffness_N_m", "path.tangent", "tangent stiffness of the law"),
    Column("recoverable_energy_J", "path.recoverable", "energy that the law stores"),
    Column("dissipated_energy_J", "path.dissipated", "energy dissipated so far"),
)
INVENTORY = (
    Column("id", "row.id", "id of the building", text=True),
    Column("design_level", "building.design_level", "design level: pre, low, moderate, high", text=True),
    Column("hazus_type", "building.type", "structure type with its class of height", text=True),
    Column("period_rule_s", "building.rule_period", "fundamental period by the rules"),
    Column("period_shear_beam_s", "building.period", "fundamental period of the shear building"),
    Column("damping_ratio", "building.damping_ratio", "viscous damping ratio"),
    Column("story", lambda one: np.arange(1, one.building.mass.size + 1), "story, from 1 at the ground"),
    Column("mass_kg", "building.mass", "mass of the floor"),
    Column("height_m", "building.height", "story height"),
    Column("stiffness_N_m", "building.stiffness", "initial stiffness"),
    Column("yield_force_N", "building.yield_force", "force at first yield"),
    Column("ultimate_force_N", "building.ultimate_force", "largest force"),
    Column("yield_drift_m", "building.yield_drift", "drift at first yield"),
    Column("ultimate_drift_m", "building.ultimate_drift", "drift at which the largest force is reached"),
    Column("pinching", "building.pinching", "part of the force at which the first part of reloading ends"),
    Column("unloading_exponent", "building.unloading", "exponent of the unloading stiffness"),
)


def pushover(stories: int) -> tuple[Column, ...]:
    """The columns of a pushover of a building with so many stories."""

    def drift(i: int) -> Callable[[Any], Any]:
        return lambda result: result.drift[:, i]

    return (
        Column("step", lambda result: np.arange(result.base_shear.size), "step; 0 is the start at rest"),
        Column("roof_displacement_m", "roof_displacement", "relative to the ground"),
        Column("roof_drift_ratio", "roof_drift_ratio", "roof displacement over the height of the building"),
        Column("base_shear_N", "base_shear", "sum of the forces on the floors"),
        *(Column(f"story_{i + 1}_drift_m", drift(i), "relative to the floor below") for i in range(stories)),
    )


OVERVIEW = (
    Column("model", "model.source", "the model file", text=True),
    Column("name", "model.name", "the building's name", text=True),
    Column("stories", "stories", "number of stories"),
    Column("height_m", "height", "height of the building; empty where a story has none"),
    Column("mass_kg", "mass", "mass of all floors"),
    Column("t1_s", "period", "fundamental period of the initial stiffness, P-delta included"),
    Column("t1_damping", "damping", "viscous damping ratio of the first mode, without power-law dashpots"),
    Column("laws", "laws", "drift laws, with the number of stories of each where there are several", text=True),
    METHOD_SPEC,
    Column("record", "record", "file of the ground motion", text=True),
)

MODE = (
    Column("mode", lambda modes: np.arange(1, modes.omega.size + 1), "mode, from 1 at the longest period"),
    Column("period_s", lambda modes: 2.0 * math.pi / modes.omega, "natural period"),
    Column("frequency_hz", lambda modes: modes.omega / (2.0 * math.pi), "natural frequency"),
)
MODE_END = (
    Column("participation", "participation", "participation factor for unit roof displacement"),
    Column("mass_ratio", "mass_ratio", "effective modal mass over the total mass"),
    Column("cumulative_mass_ratio", lambda modes: np.cumsum(modes.mass_ratio), "sum of that up to this mode"),
)


def mode_damping(ratios: Any) -> Column:
    """The column of the modes' damping ratios, shape (n,)."""
    return Column("damping", lambda modes: ratios, "damping ratio; empty where damping couples the modes")


COMPARISON = (
    FLOOR,
    Column("quantity", "quantity", "absolute acceleration, or displacement relative to the base", text=True),
    Column("correlation", "correlation", "Pearson's coefficient of the computed and the recorded motion"),
    Column("peak_ratio", "peak_ratio", "largest absolute value computed over that recorded"),
    Column("rms_difference", "rms_difference", "root mean square of the difference over that of the recording"),
)
COMPARISON_SPECTRA = (
    FLOOR,
    PERIOD,
    Column("computed_sa_m_s2", "computed", "largest absolute acceleration on the computed motion of the floor"),
    Column("recorded_sa_m_s2", "recorded", "largest absolute acceleration on the recorded motion of the floor"),
)
FITTED = (
    Column("parameter", "name", "what was fitted, with its unit", text=True),
    Column("place", "place", "its story or mode, from 1; empty where it holds for all"),
    Column("start", "start", "value of the model file"),
    Column("fitted", "value", "value with which the model comes closest to the recording"),
    Column(
        "standard_error", "standard_error", "of the fitted value, for differences that are independent; inf: untold"
    ),
)


def of_event(name: str) -> Column:
    """The column that tells events apart, the last one."""
    return Column("recorded", lambda _: name, "file of the recordings", text=True)
