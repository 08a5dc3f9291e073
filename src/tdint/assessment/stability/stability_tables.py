"""Tables of the stability, accuracy and overshoot of methods."""

from __future__ import annotations

from tdint.output.tables.methods import _finite_or_nan, _limit_or_none
from tdint.output.tables.table import DAMPING, METHOD_SPEC, TEXT, Column, numbered

DECLARATION = (
    Column("method", "text", "integrator.label", "method with its parameters"),
    Column.named("integrator.order", "declared order of accuracy"),
    Column(
        "observed_order",
        "1",
        "order",
        "minimum of the orders of displacement and velocity, in free vibration and under a "
        "harmonic force",
    ),
    Column(
        "stability_limit",
        "1",
        _limit_or_none("integrator.stability_limit"),
        "declared largest stable omega dt without damping",
    ),
    Column("measured_limit", "1", _limit_or_none("limit"), "measured largest stable omega dt"),
    Column.named("integrator.rho_inf", "declared spectral radius for omega dt to infinity"),
    Column("measured_rho_inf", "1", "rho_inf", "measured spectral radius for omega dt to infinity"),
    Column("faults", "1", lambda result: len(result.faults), "number of incorrect declarations"),
)

_DT_OVER_T = Column.named("dt_over_t", "time step divided by the undamped period of the oscillator")

STABILITY: tuple[Column, ...] = (
    METHOD_SPEC,
    DAMPING,
    _DT_OVER_T,
    Column.named(
        "spectral_radius", "maximum modulus of the eigenvalues of the amplification matrix"
    ),
    Column.named("period_error", "numerical damped period divided by exact damped period, minus 1"),
    Column.named(
        "numerical_damping",
        "damping ratio of the numerical oscillation minus the exact damping ratio",
    ),
    Column.named(
        "amplitude_decay", "fraction by which the method reduces the amplitude in one cycle"
    ),
    Column.named(
        "spurious_radius", "maximum modulus of the eigenvalues other than the principal pair"
    ),
)

OVERSHOOT: tuple[Column, ...] = (
    METHOD_SPEC,
    DAMPING,
    _DT_OVER_T,
    Column.named("start", "initial condition of the oscillator", TEXT),
    Column("step", "1", numbered("displacement", 0), "number of the time step; 0 is the start"),
    Column.named("displacement", "displacement divided by the maximum of the exact displacement"),
    Column.named("velocity", "velocity divided by the maximum of the exact velocity"),
    Column(
        "displacement_power",
        "1",
        lambda result: _finite_or_nan(result.displacement_power),
        "exponent of omega dt in the displacement after the first step; empty if this displacement "
        "is zero",
    ),
    Column(
        "velocity_power",
        "1",
        lambda result: _finite_or_nan(result.velocity_power),
        "exponent of omega dt in the velocity times dt after the first step; empty if this "
        "velocity is zero",
    ),
    Column.named("law", "restoring force of the oscillator", TEXT),
)
