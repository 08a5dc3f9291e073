"""Generalized single-step methods of Zhou and Tamma (2004), such as Newmark and generalized-alpha.

All methods of the family share one compiled step and differ in seven coefficients. With the masses
M, the damping matrix C, the restoring forces f and the loads p, the increment da of the
acceleration follows from equilibrium at a weighted point of the step of length h:

    M (a0 + L6W1 da) + C (v0 + W1 h a0 + L5W2 h da)
        + f(u0 + W1 h v0 + L2W2 h^2 a0 + L3W3 h^2 da) = (1 - W1) p0 + W1 p1

The response at the end of the step is then

    u1 = u0 + h v0 + h^2 a0 / 2 + l3 h^2 da,   v1 = v0 + h a0 + l5 h da,   a1 = a0 + da

Functions that return coefficients of a method return W1, L2W2, L3W3, L5W2, L6W1, l3 and l5 in this
order (`row`). The names are the same as in the publication. Its other coefficients have the same
values in all methods of the module: L1W1 = L4W1 = W1, l1 = l4 = 1, l2 = 1/2.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np

from tdint.arrays import Array
from tdint.kernels import layout as rows
from tdint.kernels.compiling import FULL, inline, outlined
from tdint.kernels.equations.newton import (
    EQUILIBRIUM_ROWS,
    ROW,
    DamperStep,
    commit_tangent_damping,
    factor_rows,
    invalidate,
    solve_equilibrium_with_dampers,
)
from tdint.kernels.linear_terms import below, finite, floor_load
from tdint.kernels.stepping import EffectiveCoefficients, step_kernel
from tdint.kernels.stories.brace import commit_brace, follow_brace_at_midpoint
from tdint.kernels.stories.law_state import commit, restoring_force
from tdint.methods.method import Family, Method, Parameter

# Indices of the coefficients of the step, with the names of the publication
W1 = 0
L2W2 = 1
L3W3 = 2
L5W2 = 3
L6W1 = 4
L3 = 5
L5 = 6

# Scratch rows that follow the rows of `solve_equilibrium`
_LOAD_0 = EQUILIBRIUM_ROWS  # load at the start of the step, N
_FACTORS = _LOAD_0 + 1  # first row of the factorization


@step_kernel
def step(coefficients, scene, h, load, memory):
    """Integrate the equations of motion over one time step; equilibrium at the weighted point is
    solved by Newton's method.
    """
    linear_terms, _, law_parameters, forces, flags = scene
    state, law_state, scratch, step_status = memory
    n = linear_terms.shape[1] - 1
    if step_status[rows.FACTORED_STEP] != h:
        invalidate(scratch, _FACTORS, n)
        step_status[rows.FACTORED_STEP] = h
    _predict_weighted_point(coefficients, linear_terms, forces, h, load, state, scratch)
    # Change of displacement, velocity and acceleration at the weighted point per unit of da
    effective = EffectiveCoefficients(
        coefficients[L3W3] * h * h, coefficients[L5W2] * h, coefficients[L6W1]
    )
    # Row X receives da.
    damping_weight = coefficients[L6W1] / coefficients[L5]
    damper_step = DamperStep(h, coefficients[W1], coefficients[L3] * h * h, damping_weight / h)
    if FULL and flags[rows.HAS_TANGENT_DAMPING] != 0.0:
        _predict_tangent_damping(damping_weight, linear_terms, h, memory)
    code = solve_equilibrium_with_dampers(
        damper_step, effective, _FACTORS, 0, rows.FIRST_TRIAL, scene, memory
    )
    if code < 0:
        return code
    if FULL and flags[rows.HAS_BRACES] != 0.0:
        _commit_braces(coefficients, linear_terms, h, state, scratch)
    # The laws follow the path again, because they were evaluated at the weighted point.
    u_below = 0.0
    for i in range(n):
        da = scratch[ROW.X, i]
        v = state[rows.VELOCITY, i]
        a = state[rows.ACCELERATION, i]
        u = state[rows.DISPLACEMENT, i] + h * v + h * h * (0.5 * a + coefficients[L3] * da)
        state[rows.DISPLACEMENT, i] = u
        state[rows.VELOCITY, i] = v + h * (a + coefficients[L5] * da)
        state[rows.ACCELERATION, i] = a + da
        force_0, drift_0 = law_state[rows.FORCE, i], law_state[rows.DRIFT, i]
        slope = restoring_force(
            law_parameters,
            law_state,
            i,
            0,
            rows.FIRST_TRIAL,
            u
            - linear_terms[rows.LINK, i]
            * below(linear_terms, state, rows.DISPLACEMENT, i, u_below),
        )
        commit(law_parameters, law_state, i, 0, rows.FIRST_TRIAL)
        if FULL and linear_terms[rows.TANGENT_DAMPING, i] != 0.0:
            drift_change = law_state[rows.DRIFT, i] - drift_0
            work = (law_state[rows.FORCE, i] - force_0) * drift_change / h
            commit_tangent_damping(
                damper_step, coefficients[L6W1], work, slope, i, linear_terms, memory
            )
        u_below = u
    return code if finite(state, n) else rows.NOT_FINITE


@inline
def _predict_weighted_point(coefficients, linear_terms, forces, h, load, state, scratch):
    """Store the load and the response for da = 0 at the weighted point of the step.

    Row _LOAD_0 is not set for W1 = 1, because the load at the start is then not required.
    """
    n = linear_terms.shape[1] - 1
    w1 = coefficients[W1]
    if w1 != 1.0:
        floor_load(linear_terms, forces, load[rows.TIME], load[rows.GROUND_0], scratch, _LOAD_0)
    floor_load(linear_terms, forces, load[rows.TIME] + h, load[rows.GROUND_1], scratch, ROW.LOAD)
    for i in range(n):
        if w1 != 1.0:
            scratch[ROW.LOAD, i] = (1.0 - w1) * scratch[_LOAD_0, i] + w1 * scratch[ROW.LOAD, i]
        v = state[rows.VELOCITY, i]
        a = state[rows.ACCELERATION, i]
        scratch[ROW.U, i] = (
            state[rows.DISPLACEMENT, i] + w1 * h * v + coefficients[L2W2] * h * h * a
        )
        scratch[ROW.V, i] = v + w1 * h * a
        scratch[ROW.A, i] = a
        if FULL:
            scratch[ROW.RISE, i] = h * v + 0.5 * h * h * a


@outlined
def _predict_tangent_damping(weight, linear_terms, h, memory):
    """Store the part of the forces of tangent damping at the weighted point that is known (row
    DAMPING_BASE, N).

    The force D of the damping in the equations is treated as the inertia force M a, so that the sum
    of both is the rate of the momentum M v + a1 f. As the velocities satisfy v1 = v0 + h a0 +
    l5 h da, the forces of the law satisfy a1 f1 = a1 f0 + h D0 + l5 h (D1 - D0). Equilibrium
    contains

        D0 + L6W1 (D1 - D0) = D0 + weight (a1 (f1 - f0) / h - D0),   weight = L6W1 / l5

    With D = a1 k v at the end of the step, the order would be 1 if a law changes its stiffness.
    """
    for i in range(linear_terms.shape[1] - 1):
        impulse = linear_terms[rows.TANGENT_DAMPING, i] * memory.law_state[rows.FORCE, i]
        memory.scratch[ROW.DAMPING_BASE, i] = (1.0 - weight) * memory.state[
            rows.DAMPING_STATE, i
        ] - weight * impulse / h


@outlined
def _commit_braces(coefficients, linear_terms, h, state, scratch):
    """Move all dampers with braces to the end of the step, before the state is updated.

    The step is repeated at the solution, because the last evaluation of `solve_equilibrium` can
    precede the last correction.
    """
    by_rise, by_rate = coefficients[L3] * h * h, coefficients[L5] * h
    rise_below = v_0_below = v_below = 0.0
    for i in range(linear_terms.shape[1] - 1):
        link = linear_terms[rows.LINK, i]
        da = scratch[ROW.X, i]
        rise = scratch[ROW.RISE, i] + by_rise * da
        v_0 = state[rows.VELOCITY, i]
        v = v_0 + h * state[rows.ACCELERATION, i] + by_rate * da
        if linear_terms[rows.BRACE, i] != 0.0:
            force_0 = state[rows.BRACE_FORCE, i]
            drift_change = rise - link * rise_below
            follow_brace_at_midpoint(linear_terms, i, h, drift_change, force_0, scratch, ROW.BRACE)
            first_rate, last_rate = v_0 - link * v_0_below, v - link * v_below
            rates = (first_rate, last_rate, drift_change / h, 0.5 * (first_rate + last_rate))
            commit_brace(linear_terms, i, h, rates, state, scratch, ROW.BRACE)
        rise_below, v_0_below, v_below = rise, v_0, v


FAMILY = Family(
    "single-step",
    step,
    lambda modes: _FACTORS + factor_rows(modes),
    devices=True,
    inertance=True,
)


def newmark(beta: float, gamma: float) -> tuple[float, ...]:
    """Return the coefficients of Newmark's method (1959) for its parameters beta and gamma.

    The method is u1 = u0 + h v0 + h^2 ((1/2 - beta) a0 + beta a1), v1 = v0 + h ((1 - gamma) a0 +
    gamma a1) with equilibrium at the end, so that da = a1 - a0.
    """
    return (1.0, 0.5, beta, gamma, 1.0, beta, gamma)


def generalized_alpha(
    alpha_m: float, alpha_f: float, beta: float, gamma: float
) -> tuple[float, ...]:
    """Return the coefficients of the generalized-alpha method (Chung and Hulbert 1993).

    alpha_m and alpha_f are the fractions of the step, counted from its end, at which the inertial
    force (alpha_m) and the other forces (alpha_f) are evaluated; beta and gamma are the parameters
    of `newmark`.
    """
    w1 = 1.0 - alpha_f
    return (w1, w1 / 2.0, w1 * beta, w1 * gamma, 1.0 - alpha_m, beta, gamma)


def dissipative(alpha_m: float, alpha_f: float) -> tuple[float, ...]:
    """Return the coefficients of a generalized-alpha method of order 2 with maximum dissipation.

    alpha_m and alpha_f are the fractions of the step, counted from its end, where the inertial
    force and the other forces are evaluated. gamma = 1/2 - alpha_m + alpha_f gives order 2. beta =
    (1 - alpha_m + alpha_f)^2 / 4 maximizes the dissipation at high frequencies.
    """
    excess = alpha_f - alpha_m
    return generalized_alpha(alpha_m, alpha_f, 0.25 * (1.0 + excess) ** 2, 0.5 + excess)


def collocation(beta: float, theta: float) -> tuple[float, ...]:
    """Return the coefficients of the collocation method (Hilber and Hughes 1978), gamma = 1/2.

    Equilibrium is satisfied at theta h, after the end of the step, with Newmark's formulas over
    theta h. With beta = 1/6 this is Wilson's theta method. The result contains W1, L2W2, L3W3,
    L5W2, L6W1, l3 and l5 of `step`.
    """
    return (theta, 0.5 * theta**2, beta * theta**3, 0.5 * theta**2, theta, beta, 0.5)


def u0(r1: float, r2: float, r3: float) -> tuple[float, ...]:
    """Return the coefficients of the U0 methods of Zhou and Tamma (2004).

    r1, r2 and r3 are the absolute values of the three eigenvalues of the amplification matrix at
    infinite frequency. This matrix multiplies (u, h v, h^2 a) in each step of a linear oscillator.
    """
    # Abbreviations of the publication
    d = (1.0 + r1) * (1.0 + r2)
    e = d * (1.0 + r3)
    n = 3.0 + r1 + r2 - r1 * r2
    q = 2.0 + r1 + r2 + r3 - r1 * r2 * r3
    w1 = 1.0 / (1.0 + r3)
    return (w1, 0.5 * w1, 1.0 / e, n / (2.0 * e), q / e, 1.0 / d, n / (2.0 * d))


def _amplification_at_infinity(row: tuple[float, ...]) -> Array:
    """Return the amplification matrix of (u, h v, h^2 a) for omega h to infinity.

    The restoring force dominates at infinite frequency, so that the displacement at the weighted
    point must be zero. L3W3 must not be 0: the limit exists for implicit methods only. The caller
    excludes methods with a stability limit, and therefore all explicit methods.
    """
    # Row vector; its product with (u0, h v0, h^2 a0) is h^2 da.
    da = -np.array([1.0, row[W1], row[L2W2]]) / row[L3W3]
    # `free` gives the response at the end of the step for da = 0.
    free = np.array([[1.0, 1.0, 0.5], [0.0, 1.0, 1.0], [0.0, 0.0, 1.0]])
    return np.asarray(free + np.outer([row[L3], row[L5], 1.0], da))


def _rho_inf(row: tuple[float, ...]) -> float:
    """Return the spectral radius at infinite frequency of a method with the coefficients `row`.

    If three eigenvalues are nearly equal, the result has an error of about 1e-5. Methods with such
    eigenvalues must declare their spectral radius, as the generalized-alpha method and `u0v0` do.
    """
    eigenvalues = np.linalg.eigvals(_amplification_at_infinity(row)).astype(np.complex128)
    # Rounding errors separate a double eigenvalue into two that differ by up to 1e-8. Their mean
    # is exact up to rounding.
    for first, second in ((0, 1), (0, 2), (1, 2)):
        if abs(eigenvalues[first] - eigenvalues[second]) < 1e-7:
            eigenvalues[[first, second]] = 0.5 * (eigenvalues[first] + eigenvalues[second])
    return float(np.max(np.abs(eigenvalues)))


def _newmark_limit(beta: float, gamma: float) -> float:
    """Return the largest stable omega h of Newmark's method without damping (Hughes 1987, section
    9.1): inf for unconditional stability, 0 for gamma < 1/2, because the method is then unstable at
    every step.
    """
    if gamma < 0.5:
        return 0.0
    return math.inf if 2.0 * beta >= gamma else 1.0 / math.sqrt(gamma / 2.0 - beta)


def collocation_theta(beta: float) -> float:
    """Return the parameter theta of optimal collocation for a `beta` between 1/6 and 1/4.

    Equilibrium is satisfied at the time theta h after the start of the step of length h. At the
    optimal theta, the two principal eigenvalues of the amplification matrix at infinite frequency
    coincide and become complex. If theta decreases by a few percent, an eigenvalue approaches -1,
    the limit of unconditional stability. Hilber and Hughes (1978) tabulate theta: 1.021712 for beta
    = 0.24, 1.159772 for beta = 0.20. theta decreases from 1.42 at beta = 1/6 to 1.

    Exact fractions are used in the bisection so that rounding errors cannot change the sign of the
    discriminant.
    """
    from fractions import Fraction  # imported here because no other function needs it

    low, high = Fraction(1), Fraction(2)
    for _ in range(60):
        theta = (low + high) / 2
        # For an eigenvalue z at infinite frequency, x = 1 / (z - 1) is a root of the cubic
        #     x^3 + (1 + theta) x^2 + (beta + theta / 2 + theta^2 / 2) x + beta theta^3 = 0
        # Two of its roots are complex if the discriminant is negative.
        a, b, c = 1 + theta, Fraction(beta) + (theta + theta**2) / 2, Fraction(beta) * theta**3
        if a**2 * b**2 - 4 * b**3 - 4 * a**3 * c - 27 * c**2 + 18 * a * b * c < 0:
            high = theta
        else:
            low = theta
    return float(high)


def _collocation_limit(beta: float, theta: float) -> float:
    """Return inf if the collocation method is unconditionally stable (Hilber and Hughes 1978, for
    theta >= 1), otherwise nan (unknown).
    """
    low = (2.0 * theta**2 - 1.0) / (4.0 * (2.0 * theta**3 - 1.0))
    high = theta / (2.0 * (theta + 1.0))
    # The factor 1 + 1e-14 accepts parameters at a limit despite rounding errors.
    return math.inf if low <= beta * (1.0 + 1e-14) and beta <= high * (1.0 + 1e-14) else math.nan


def _family_member(
    name: str,
    row: Callable[..., tuple[float, ...]],
    source: str,
    *parameters: Parameter,
    **declared: Any,
) -> Method:
    """Return the entry of the catalogue for a single generalized single-step method.

    `row` returns the coefficients for values of the parameters. `declared` contains further fields
    of `Method`. By default, the spectral radius at infinite frequency is computed from the
    coefficients, the method is implicit unless L3W3 is 0, and methods that are unconditionally
    stable integrate tangent damping.
    """

    def rho_inf(*values: float) -> float:
        """Return the spectral radius at infinite frequency for the parameters `values`.

        nan if the method is not unconditionally stable. `method` is the method of the enclosing
        function, which is defined when this function is called.
        """
        if method.stability_limit(*values) != math.inf:
            return math.nan
        return _rho_inf(row(*values))

    def tangent_damping(*values: float) -> bool:
        """Return True if the motion does not grow under tangent damping.

        With a limit of the step (also explicit methods), or with equilibrium after the end of the
        step, it grows: the spectral radius is 1.1 to 3 for damping ratios of 2 % to 50 %.
        """
        return method.stability_limit(*values) == math.inf and row(*values)[W1] <= 1.0

    declared = {
        "rho_inf": rho_inf,
        "implicit": lambda *values: row(*values)[L3W3] != 0.0,
        "braces": True,
        "tangent_damping": tangent_damping,
        **declared,
    }
    method = Method(
        name=name, family=FAMILY, parameters=parameters, coefficients=row, source=source, **declared
    )
    return method


def _newmark(name: str, beta: float, source: str) -> Method:
    """Return the entry of the catalogue for Newmark's method with a fixed beta and gamma = 1/2."""
    return _family_member(
        name, lambda: newmark(beta, 0.5), source, stability_limit=lambda: _newmark_limit(beta, 0.5)
    )


METHODS = (
    _family_member(
        "newmark",
        newmark,
        "Newmark (1959)",
        Parameter("beta", 0.25, 0.0, 1.0),
        Parameter("gamma", 0.5, 0.5, 1.0),
        stability_limit=_newmark_limit,
        order=lambda beta, gamma: 2 if gamma == 0.5 else 1,
    ),
    _newmark(
        "newmark-average", 1.0 / 4.0, "Newmark (1959), average acceleration: beta 1/4, gamma 1/2"
    ),
    _newmark(
        "newmark-linear", 1.0 / 6.0, "Newmark (1959), linear acceleration: beta 1/6, gamma 1/2"
    ),
    _newmark("fox-goodwin", 1.0 / 12.0, "Fox and Goodwin (1949): Newmark beta 1/12, gamma 1/2"),
    _newmark(
        "central-difference",
        0.0,
        "central difference with implicit damping: Newmark (1959), beta 0, gamma 1/2",
    ),
    _family_member(
        "hht",
        lambda alpha: dissipative(0.0, -alpha),
        "Hilber, Hughes and Taylor (1977)",
        Parameter("alpha", -0.05, -1.0 / 3.0, 0.0),
        rho_inf=lambda alpha: (1.0 + alpha) / (1.0 - alpha),
    ),
    _family_member(
        "wbz",
        lambda rho_inf: dissipative((rho_inf - 1.0) / (rho_inf + 1.0), 0.0),
        "Wood, Bossak and Zienkiewicz (1980)",
        Parameter("rho_inf", 0.8, 0.0, 1.0),
        rho_inf=lambda rho_inf: rho_inf,
    ),
    _family_member(
        "generalized-alpha",
        lambda rho_inf: dissipative(
            (2.0 * rho_inf - 1.0) / (1.0 + rho_inf), rho_inf / (1.0 + rho_inf)
        ),
        "Chung and Hulbert (1993)",
        Parameter("rho_inf", 0.8, 0.0, 1.0),
        rho_inf=lambda rho_inf: rho_inf,
    ),
    _family_member(
        "collocation",
        collocation,
        "Hilber and Hughes (1978), gamma 1/2",
        Parameter("beta", 0.24, 1.0 / 6.0, 0.25),
        Parameter("theta", collocation_theta, 1.0, 10.0),
        stability_limit=_collocation_limit,
        braces=False,  # as for wilson
    ),
    _family_member(
        "wilson",
        lambda theta: collocation(1.0 / 6.0, theta),
        "Wilson (1968), theta method; Bathe and Wilson (1973)",
        Parameter("theta", 1.4, 1.0, 10.0),
        variants=("theta=1.3",),  # below the stability limit
        stability_limit=lambda theta: _collocation_limit(1.0 / 6.0, theta),
        # Equilibrium after the end of the step is unstable with a damper and a stiff brace
        # (spectral radius 1.4 to 3.7).
        braces=False,
    ),
    _family_member(
        "u0v0",
        lambda r: u0(1.0, r, r),
        "Zhou and Tamma (2004), U0-V0 optimal: no overshoot, rho_inf 1 for every r",
        Parameter("r", 0.5, 0.0, 1.0),
        # The eigenvalues at infinite frequency are -1, -r and -r. They are nearly equal for r near
        # 1, so that computed eigenvalues would be inaccurate.
        rho_inf=lambda r: 1.0,
    ),
)
