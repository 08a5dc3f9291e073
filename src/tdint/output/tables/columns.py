"""The columns of every table, each declared here once: its name, where its value comes from, and what it means.

A name ends with its unit (`tdint.output_units.ENDS`); a quantity that is absolute says so, all others are
relative to the ground or to the floor below. An estimated error of a column is called `<column>_error`.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from tdint.analysis.run.outcome import ENERGY_TERMS
from tdint.output.tables.table import Column, cell_text, error_columns

if TYPE_CHECKING:
    from tdint.methods.method import Integrator


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

OF_RECORD = (
    Column("record", "record.source", "file of the record", text=True),
    Column("component", "component", "component of the record", text=True),
)
"""The first columns of tables over records; their cells are found for all records together."""

OF_MOTION = (
    Column("record", "motion.source", "file of the first component", text=True),
    Column("component", "motion.component", "both components", text=True),
)

CHOICES = (
    Column("maxima", "maxima", "where the largest values were looked for", text=True),
    Column("interpolation", "interpolation", "the ground motion between its samples", text=True),
)
"""Last columns of a spectrum, where they are asked for."""

_DAMPING = Column("damping", "damping", "viscous damping ratio")

SPECTRUM = (
    _DAMPING,
    Column("period_s", "periods", "natural period"),
    Column("sd_m", "sd", "largest displacement relative to the ground"),
    Column("psv_m_s", "psv", "pseudo-velocity, omega sd"),
    Column("psa_m_s2", "psa", "pseudo-acceleration, omega^2 sd"),
    Column("sv_m_s", "sv", "largest velocity relative to the ground"),
    Column("sa_m_s2", "sa", "largest absolute acceleration"),
)


def difference(published: str) -> tuple[Column, ...]:
    """The columns of spectra beside a published one, of this column of `SPECTRUM`."""
    own = next(column for column in SPECTRUM if column.name == published)
    return (
        *SPECTRUM[:2],
        Column(own.name, "computed", own.meaning),
        Column(f"published_{own.name}", "expected", f"published: {own.meaning}"),
        Column("relative_difference", "relative_difference", "computed over published value, less 1"),
    )


ROTATED_START = (_DAMPING, Column("period_s", "periods", "natural period"))
ROTATED_END = (
    Column(
        "geometric_mean_psa_m_s2",
        "geometric_mean",
        "geometric mean of the pseudo-accelerations of both components",
    ),
    Column("rotd100_angle_deg", "angle", "direction of the largest, from the first component towards the second"),
)


def rotated(percentiles: Sequence[int]) -> tuple[Column, ...]:
    """The columns of a spectrum over all directions with these percentiles."""

    def percentile(place: int) -> Callable[[Any], Any]:
        return lambda spectrum: spectrum.psa[place]

    middle = (
        Column(f"rotd{p:02d}_psa_m_s2", percentile(i), f"pseudo-acceleration, percentile {p} over all directions")
        for i, p in enumerate(percentiles)
    )
    return (*ROTATED_START, *middle, *ROTATED_END)


INELASTIC = (
    _DAMPING,
    Column("hardening", "hardening", "stiffness after yielding over the initial one"),
    Column("target_ductility", "target", "ductility asked for"),
    Column("period_s", "periods", "natural period of the initial stiffness"),
    Column("yield_strength_ratio", "yield_strength_ratio", "yield force over weight"),
    Column("ductility", "ductility", "largest over yield displacement"),
    Column("residual_m", "residual", "displacement at rest after the record, with its sign"),
    Column("sd_m", "sd", "largest displacement relative to the ground"),
    Column("yield_sd_m", "yield_displacement", "displacement at first yield"),
    Column("yield_psa_m_s2", "yield_acceleration", "yield force over mass"),
    Column("reduction_factor", "reduction_factor", "largest elastic force over yield force"),
)
DRIFT_SPECTRUM = (
    _DAMPING,
    Column("period_s", "periods", "fundamental period"),
    Column("height_m", "heights", "height of the building"),
    Column("peak_drift_ratio", "peak_drift_ratio", "largest story drift over story height"),
    Column("story", lambda spectrum: np.where(spectrum.story > 0, spectrum.story, None), "where that is, from 1"),
    Column("roof_drift_ratio", "roof_drift_ratio", "largest roof displacement relative to the ground, over the height"),
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
    Column("method", "method", "time-integration method with its parameters", text=True),
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


def _power(value: float) -> float:
    """A power; nan for that of nothing, minus infinity."""
    return value if math.isfinite(value) else math.nan


METHOD = (
    Column("name", "method.name", "name", text=True),
    Column("family", "family.name", "methods that share one compiled step", text=True),
    Column("parameters", lambda one: _parameters(one), "defaults and ranges", text=True),
    Column("order", "order", "order of displacement and velocity for a smooth load"),
    Column("implicit", "implicit", "whether a step solves for the restoring force at its end", text=True),
    Column(
        "stability_limit",
        lambda one: "none" if math.isinf(one.stability_limit) else one.stability_limit,
        "largest stable omega dt without damping; none for stable at any step",
    ),
    Column("rho_inf", "rho_inf", "spectral radius for omega dt to infinity"),
    Column("source", "method.source", "who published it", text=True),
)


def _parameters(one: Integrator) -> str:
    """`beta=0.25 in [0, 1]; theta=1.02 in [1, 10], computed`: a computed default follows from the ones before it."""
    return "; ".join(
        f"{parameter.name}={cell_text(value)} in {parameter.range}" + (", computed" * callable(parameter.default))
        for parameter, value in zip(one.method.parameters, one.values, strict=True)
    )


_METHOD = Column("method", "method", "time-integration method with its parameters", text=True)
_DT_OVER_T = Column("dt_over_t", "dt_over_t", "step over the undamped period of the oscillator")

STABILITY = (
    _METHOD,
    _DAMPING,
    _DT_OVER_T,
    Column("spectral_radius", "spectral_radius", "largest modulus of the eigenvalues of the amplification matrix"),
    Column("period_error", "period_error", "numerical over exact damped period, less 1"),
    Column("numerical_damping", "numerical_damping", "damping ratio of the numerical oscillation less the exact one"),
    Column("amplitude_decay", "amplitude_decay", "part of the amplitude that the method takes in one cycle"),
)
OVERSHOOT = (
    _METHOD,
    _DAMPING,
    _DT_OVER_T,
    Column("start", "start", "what the oscillator starts from", text=True),
    Column("step", lambda motion: np.arange(motion.displacement.size), "step; 0 is the start"),
    Column("displacement", "displacement", "over the amplitude of the exact motion"),
    Column("velocity", "velocity", "over omega times that amplitude"),
    Column(
        "displacement_power",
        lambda one: _power(one.displacement_power),
        "power of omega dt in the first step's displacement; empty where the step leaves nothing of it",
    ),
    Column(
        "velocity_power",
        lambda one: _power(one.velocity_power),
        "power of omega dt in the first step's velocity times dt; empty where the step leaves nothing of it",
    ),
)


def _order(quantity: str) -> Column:
    return Column(f"{quantity}_order", lambda one: one.order(quantity), f"observed order of the {quantity}")


ORDER = (
    _METHOD,
    Column("load", "load", "load of the oscillator", text=True),
    Column("law", "law", "drift law of the oscillator", text=True),
    Column("frequency_ratio", "frequency_ratio", "frequency of the load over that of the oscillator"),
    *map(_order, ("displacement", "velocity", "acceleration", "own_acceleration")),
    Column(
        "displacement_error",
        lambda one: float(one.displacement[-1]),
        "largest error with the smallest step, over the largest displacement",
    ),
)


def _chart_error(quantity: str, meaning: str, name: str = "") -> Column:
    return Column(
        f"{name or quantity}_error",
        lambda point: math.nan if point.errors is None else getattr(point.errors, quantity),
        f"{meaning}, over that of the reference",
    )


CHART_STORIES = Column("stories", "stories", "stories of the building")
CHART = (
    _METHOD,
    Column("dt_s", "dt", "time step"),
    Column("steps", "steps", "time steps"),
    Column("iterations", "iterations", "solves; of scipy evaluations of the rate"),
    Column("time_s", "time", "median wall time of the compiled loop"),
    Column("time_min_s", "fastest", "least wall time of the compiled loop"),
    _chart_error("displacement", "error of the displacements relative to the ground (L2 of the history)"),
    _chart_error("drift", "error of the drifts (L2 of the history)"),
    _chart_error("peak_drift", "largest error of a story's peak drift"),
    _chart_error(
        "acceleration", "error of the absolute accelerations (L2 of the history)", name="absolute_acceleration"
    ),
    Column("outcome", "outcome", "how `tdint run` ends", text=True),
    _chart_error("velocity", "error of the velocities relative to the ground (L2 of the history)"),
)
FAILURE = (
    Column("problem", "problem", "problem", text=True),
    _METHOD,
    Column("dt_s", "dt", "time step"),
    Column("energy_ratio_min", "energy_ratio_min", "least energy over the largest of the exact motion"),
    Column("energy_ratio_max", "energy_ratio_max", "largest energy over the largest of the exact motion"),
    Column("error", "error", "what error_of says"),
    Column("outcome", "outcome", "how `tdint run` ends", text=True),
    Column("verdict", "verdict", "pass, the fault found, or how the run failed", text=True),
    Column("end_s", "time", "last time reached"),
    Column("error_of", "error_of", "what the error is", text=True),
)


def _example_error(quantity: str, name: str) -> Column:
    return Column(f"{name}_error", lambda run: run.error(quantity), f"largest error of the {quantity}, all floors")


EXAMPLE = (
    Column("example", "example", "example of the paper"),
    _METHOD,
    Column("variant", lambda run: run.variant or None, "what was done otherwise", text=True),
    Column("dt_s", "dt", "time step"),
    _example_error("displacement", "displacement_m"),
    _example_error("velocity", "velocity_m_s"),
    _example_error("acceleration", "acceleration_m_s2"),
)
OUTCOME = Column("outcome", "outcome", "how the run ended", text=True)


def rank(of: Callable[[Any], int | None]) -> Column:
    """The column of a method's rank among others."""
    return Column("rank", of, "place by the displacement's error among the methods, from 1")


def _units(info: Any) -> str:
    return f"{info.record.units} ({info.record.units_from})"


def _remarks(info: Any) -> str:
    return "; ".join((*info.record.warnings, *info.record.notes, *info.measures.notes))


INFO = (
    Column("record", "record.source", "file of the record", text=True),
    Column("component", "record.component", "component of the record", text=True),
    Column("id", lambda info: info.record.id if info.record.id.strip(".") else "", "full id of the channel", text=True),
    Column("start", "record.start", "time of the first sample, UTC", text=True),
    Column("samples", "record.acceleration.size", "samples"),
    Column("dt_s", "record.dt", "sampling interval"),
    Column("duration_s", "record.duration", "time from the first to the last sample"),
    Column("units", _units, "units of the file's samples and how they are known", text=True),
    Column("pga_m_s2", "measures.pga", "peak ground acceleration"),
    Column("pgv_m_s", "measures.pgv", "peak ground velocity"),
    Column("pgd_m", "measures.pgd", "peak ground displacement"),
    Column("arias_intensity_m_s", "measures.arias", "Arias intensity"),
    Column("cav_m_s", "measures.cav", "cumulative absolute velocity"),
    Column("d5_75_s", "measures.d5_75", "time between 5 and 75 % of the Arias intensity"),
    Column("d5_95_s", "measures.d5_95", "time between 5 and 95 % of the Arias intensity"),
    Column("housner_intensity_m", "housner_intensity", "Housner's spectrum intensity"),
    Column("mean_m_s2", "measures.mean", "mean of the acceleration"),
    Column("leading_zeros", "measures.leading_zeros", "samples at the start that are zero"),
    Column("trailing_zeros", "measures.trailing_zeros", "samples at the end that are zero"),
    Column("notes", _remarks, "remarks", text=True),
)

FLOOR = Column("floor", "floor", "floor, from 1 at the bottom")

COMPARISON = (
    FLOOR,
    Column("quantity", "quantity", "absolute acceleration, or displacement relative to the base", text=True),
    Column("correlation", "correlation", "Pearson's coefficient of the computed and the recorded motion"),
    Column("peak_ratio", "peak_ratio", "largest absolute value computed over that recorded"),
    Column("rms_difference", "rms_difference", "root mean square of the difference over that of the recording"),
)
COMPARISON_SPECTRA = (
    FLOOR,
    Column("period_s", "periods", "natural period"),
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
