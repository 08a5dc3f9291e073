"""Columns of methods: what they are, what is measured of them, what they cost."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np

from tdint.output.tables.columns.shared import DAMPING, METHOD_SPEC
from tdint.output.tables.table import Column, cell_text

if TYPE_CHECKING:
    from tdint.methods.method import Integrator


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


_DT_OVER_T = Column("dt_over_t", "dt_over_t", "step over the undamped period of the oscillator")

STABILITY = (
    METHOD_SPEC,
    DAMPING,
    _DT_OVER_T,
    Column("spectral_radius", "spectral_radius", "largest modulus of the eigenvalues of the amplification matrix"),
    Column("period_error", "period_error", "numerical over exact damped period, less 1"),
    Column("numerical_damping", "numerical_damping", "damping ratio of the numerical oscillation less the exact one"),
    Column("amplitude_decay", "amplitude_decay", "part of the amplitude that the method takes in one cycle"),
)
OVERSHOOT = (
    METHOD_SPEC,
    DAMPING,
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
    METHOD_SPEC,
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
    METHOD_SPEC,
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
    METHOD_SPEC,
    Column("dt_s", "dt", "time step"),
    Column("energy_ratio_min", "energy_ratio_min", "least energy over the largest of the exact motion"),
    Column("energy_ratio_max", "energy_ratio_max", "largest energy over the largest of the exact motion"),
    Column("error", "error", "what error_of says"),
    Column("outcome", "outcome", "how `tdint run` ends", text=True),
    Column("verdict", "verdict", "pass, the fault found, or how the run failed", text=True),
    Column("end_s", "time", "last time reached"),
    Column("error_of", "error_of", "what the error is", text=True),
)


def _example_errors(reference: str, against: str, prefix: str = "") -> tuple[Column, ...]:
    def column(quantity: str, name: str) -> Column:
        about = f"largest error of the {quantity}, all floors, against {against}"
        return Column(f"{prefix}{name}_error", lambda run: run.error(quantity, reference), about)

    return (
        column("displacement", "displacement_m"),
        column("velocity", "velocity_m_s"),
        column("acceleration", "acceleration_m_s2"),
    )


EXAMPLE = (
    Column("example", "example", "example of the paper"),
    METHOD_SPEC,
    Column("variant", lambda run: run.variant or None, "what was done otherwise", text=True),
    Column("dt_s", "dt", "time step"),
    *_example_errors("paper", "what the paper calls exact: newmark-linear with 0.001 or 0.002 s"),
    *_example_errors("finer", "rk5 with steps 8 times finer", "finer_"),
)
OUTCOME = Column("outcome", "outcome", "how the run ended", text=True)


def rank(of: Callable[[Any], int | None]) -> Column:
    """The column of a method's rank among others."""
    return Column("rank", of, "place by the displacement's error (that of --reference) among the methods, from 1")
