"""The generalized single-step family of Zhou and Tamma (2004): one kernel, a row of coefficients
per method.

The increment da of the acceleration follows from equilibrium at a weighted point of the step:

    M (a0 + L6W1 da) + C (v0 + W1 h a0 + L5W2 h da) + f(u0 + W1 h v0 + L2W2 h^2 a0 + L3W3 h^2 da) =
    (1 - W1) p0 + W1 p1 u1 = u0 + h v0 + h^2 a0 / 2 + l3 h^2 da,   v1 = v0 + h a0 + l5 h da,   a1 =
    a0 + da

(X. Zhou and K. K. Tamma, 2004, with L1W1 = L4W1 = W1, l1 = l4 = 1, l2 = 1/2 in every member here.)
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tdint.kernels import layout as rows
from tdint.kernels.compiling import inline, kernel
from tdint.kernels.equations.newton import (
    EQUILIBRIUM_ROWS,
    ROW,
    factor_rows,
    invalidate,
    solve_equilibrium,
)
from tdint.kernels.linear_terms import finite, floor_load
from tdint.kernels.stepping import STEP, EffectiveCoefficients, Memory, Scene
from tdint.kernels.stories.law_state import commit, restoring_force
from tdint.methods.method import Family, Method, Parameter

# Coefficients
W1 = 0
L2W2 = 1
L3W3 = 2
L5W2 = 3
L6W1 = 4
L3 = 5
L5 = 6

# Rows of work behind those of the balance
_LOAD_0 = EQUILIBRIUM_ROWS  # at the start of the step
_FACTORS = _LOAD_0 + 1


@kernel(STEP)
def step(
    coefficients,
    linear_terms,
    modal,
    law_parameters,
    forces,
    flags,
    h,
    load,
    state,
    law_state,
    scratch,
    step_status,
):
    """One step of the family; the unknown of the balance is da."""
    scene = Scene(linear_terms, modal, law_parameters, forces, flags)
    memory = Memory(state, law_state, scratch, step_status)
    n = linear_terms.shape[1] - 1
    if step_status[rows.FACTORED_STEP] != h:
        invalidate(scratch, _FACTORS, n)
        step_status[rows.FACTORED_STEP] = h
    _predict(coefficients, linear_terms, forces, h, load, state, scratch)
    # What brings the weighted point into balance: the state at the end follows from it.
    weights = EffectiveCoefficients(
        coefficients[L3W3] * h * h, coefficients[L5W2] * h, coefficients[L6W1]
    )
    code = solve_equilibrium(weights, _FACTORS, 0, rows.FIRST_TRIAL, scene, memory)
    if code < 0:
        return code
    below = 0.0
    for i in range(n):
        da = scratch[ROW.X, i]
        v = state[rows.VELOCITY, i]
        a = state[rows.ACCELERATION, i]
        u = state[rows.DISPLACEMENT, i] + h * v + h * h * (0.5 * a + coefficients[L3] * da)
        state[rows.DISPLACEMENT, i] = u
        state[rows.VELOCITY, i] = v + h * (a + coefficients[L5] * da)
        state[rows.ACCELERATION, i] = a + da
        restoring_force(
            law_parameters,
            law_state,
            i,
            0,
            rows.FIRST_TRIAL,
            u - linear_terms[rows.LINK, i] * below,
        )
        commit(law_parameters, law_state, i, 0, rows.FIRST_TRIAL)
        below = u
    return code if finite(state, n) else rows.NOT_FINITE


@inline
def _predict(coefficients, linear_terms, forces, h, load, state, scratch):
    """Weighted load, and the weighted point for da = 0."""
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


FAMILY = Family("single-step", step, lambda modes: _FACTORS + factor_rows(modes))


def newmark(beta: float, gamma: float) -> tuple[float, ...]:
    """Newmark (1959)."""
    return (1.0, 0.5, beta, gamma, 1.0, beta, gamma)


def generalized_alpha(
    alpha_m: float, alpha_f: float, beta: float, gamma: float
) -> tuple[float, ...]:
    """Chung and Hulbert (1993): equilibrium between the ends of the step, alpha_m and alpha_f from
    its end."""
    w1 = 1.0 - alpha_f
    return (w1, w1 / 2.0, w1 * beta, w1 * gamma, 1.0 - alpha_m, beta, gamma)


def dissipative(alpha_m: float, alpha_f: float) -> tuple[float, ...]:
    """`generalized_alpha` with the gamma of order 2 and the beta of most dissipation at high
    frequency."""
    excess = alpha_f - alpha_m
    return generalized_alpha(alpha_m, alpha_f, 0.25 * (1.0 + excess) ** 2, 0.5 + excess)


def collocation(beta: float, theta: float) -> tuple[float, ...]:
    """Hilber and Hughes (1978), gamma = 1/2; beta = 1/6 is Wilson's method."""
    return (theta, 0.5 * theta**2, beta * theta**3, 0.5 * theta**2, theta, beta, 0.5)


def u0(r1: float, r2: float, r3: float) -> tuple[float, ...]:
    """The U0 members of Zhou and Tamma (2004) from the three roots at infinity."""
    d = (1.0 + r1) * (1.0 + r2)
    e = d * (1.0 + r3)
    n = 3.0 + r1 + r2 - r1 * r2
    q = 2.0 + r1 + r2 + r3 - r1 * r2 * r3
    w1 = 1.0 / (1.0 + r3)
    return (w1, 0.5 * w1, 1.0 / e, n / (2.0 * e), q / e, 1.0 / d, n / (2.0 * d))


def _amplification_at_infinity(row: tuple[float, ...]) -> NDArray[np.float64]:
    """Amplification matrix of (u, h v, h^2 a) for omega h to infinity: there da annuls the weighted
    displacement."""
    da = -np.array([1.0, row[W1], row[L2W2]]) / row[L3W3]
    free = np.array([[1.0, 1.0, 0.5], [0.0, 1.0, 1.0], [0.0, 0.0, 1.0]])
    return np.asarray(free + np.outer([row[L3], row[L5], 1.0], da))


def _rho_inf(row: tuple[float, ...]) -> float:
    roots = np.linalg.eigvals(_amplification_at_infinity(row)).astype(np.complex128)
    # Rounding parts two roots that meet by up to 1e-8, along the real axis or off it; their mean is
    # right to rounding.
    for first, other in ((0, 1), (0, 2), (1, 2)):
        if abs(roots[first] - roots[other]) < 1e-7:
            roots[[first, other]] = 0.5 * (roots[first] + roots[other])
    return float(np.max(np.abs(roots)))


def _newmark_limit(beta: float, gamma: float) -> float:
    """Critical omega h without damping (Hughes 1987, sect. 9.1)."""
    if gamma < 0.5:
        return 0.0
    return math.inf if 2.0 * beta >= gamma else 1.0 / math.sqrt(gamma / 2.0 - beta)


def collocation_theta(beta: float) -> float:
    """The theta of optimal collocation: where the two principal roots at infinity meet and become
    complex.

    Below it, down to the limit of unconditional stability, one of them runs to -1 within a few
    percent of theta (Hilber and Hughes 1978 tabulate it: 1.021712 for beta 0.24, 1.159772 for
    0.20). Bisected, ending above, in fractions: their sign is exact, so no rounding and no library
    decides on which side the roots meet.
    """
    from fractions import Fraction  # for this alone

    low, high = Fraction(1), Fraction(2)
    for _ in range(60):
        theta = (low + high) / 2
        # At infinity u = 1 / (z - 1) solves u^3 + (1 + theta) u^2 + (beta + theta / 2 + theta^2 /
        # 2) u + beta theta^3 =
        # 0. Two of its roots are complex where the discriminant is negative.
        a, b, c = 1 + theta, Fraction(beta) + (theta + theta**2) / 2, Fraction(beta) * theta**3
        if a**2 * b**2 - 4 * b**3 - 4 * a**3 * c - 27 * c**2 + 18 * a * b * c < 0:
            high = theta
        else:
            low = theta
    return float(high)


def _collocation_limit(beta: float, theta: float) -> float:
    low = (2.0 * theta**2 - 1.0) / (4.0 * (2.0 * theta**3 - 1.0))
    high = theta / (2.0 * (theta + 1.0))
    return math.inf if low <= beta * (1.0 + 1e-14) and beta <= high * (1.0 + 1e-14) else math.nan


def _member(
    name: str,
    row: Callable[..., tuple[float, ...]],
    source: str,
    *parameters: Parameter,
    **declared: Any,
) -> Method:
    """A method of the family: what follows from its row unless it is `declared`, by the fields of
    `Method`."""

    def rho_inf(*values: float) -> float:
        return _rho_inf(row(*values)) if method.stability_limit(*values) == math.inf else math.nan

    declared = {
        "rho_inf": rho_inf,
        "implicit": lambda *values: row(*values)[L3W3] != 0.0,
        **declared,
    }
    method = Method(
        name=name, family=FAMILY, parameters=parameters, coefficients=row, source=source, **declared
    )
    return method


def _newmark(name: str, beta: float, source: str) -> Method:
    return _member(
        name, lambda: newmark(beta, 0.5), source, stability_limit=lambda: _newmark_limit(beta, 0.5)
    )


METHODS = (
    _member(
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
    _member(
        "hht",
        lambda alpha: dissipative(0.0, -alpha),
        "Hilber, Hughes and Taylor (1977)",
        Parameter("alpha", -0.05, -1.0 / 3.0, 0.0),
        rho_inf=lambda alpha: (1.0 + alpha) / (1.0 - alpha),
    ),
    _member(
        "wbz",
        lambda rho_inf: dissipative((rho_inf - 1.0) / (rho_inf + 1.0), 0.0),
        "Wood, Bossak and Zienkiewicz (1980)",
        Parameter("rho_inf", 0.8, 0.0, 1.0),
        rho_inf=lambda rho_inf: rho_inf,
    ),
    _member(
        "generalized-alpha",
        lambda rho_inf: dissipative(
            (2.0 * rho_inf - 1.0) / (1.0 + rho_inf), rho_inf / (1.0 + rho_inf)
        ),
        "Chung and Hulbert (1993)",
        Parameter("rho_inf", 0.8, 0.0, 1.0),
        rho_inf=lambda rho_inf: rho_inf,
    ),
    _member(
        "collocation",
        collocation,
        "Hilber and Hughes (1978), gamma 1/2",
        Parameter("beta", 0.24, 1.0 / 6.0, 0.25),
        Parameter("theta", collocation_theta, 1.0, 10.0),
        stability_limit=_collocation_limit,
    ),
    _member(
        "wilson",
        lambda theta: collocation(1.0 / 6.0, theta),
        "Wilson (1968), theta method; Bathe and Wilson (1973)",
        Parameter("theta", 1.4, 1.0, 10.0),
        stability_limit=lambda theta: _collocation_limit(1.0 / 6.0, theta),
    ),
    _member(
        "u0v0",
        lambda r: u0(1.0, r, r),
        "Zhou and Tamma (2004), U0-V0 optimal: no overshoot, rho_inf 1 for every r",
        Parameter("r", 0.5, 0.0, 1.0),
    ),
)
