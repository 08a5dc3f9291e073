"""Runge-Kutta methods on the first-order system u' = v, M v' = p - C v - f(u), explicit and implicit.

A method is its table: nodes c, matrix A, weights b. The ground acceleration is linear within the step, floor forces are
taken at the time of each stage.

Drift laws with a memory: the stages of an explicit method go back and forth in time, so each is reached from the state
at the start of the step; those of the implicit one lie one after the other, and the path runs through them.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from tdint.kernels import layout as at
from tdint.kernels.compiling import inlined, kernel
from tdint.kernels.equations.iteration import (
    CLOSE,
    ITERATIONS,
    PATIENCE,
    SAME_TANGENT,
    SMALL,
    add_rows,
    balanced,
    copy_rows,
    squares,
    too_far,
)
from tdint.kernels.equations.tridiagonal import (
    COUPLING_ROWS,
    ModalBlocks,
    factor_blocks,
    link_blocks,
    solve_blocks_damped,
)
from tdint.kernels.linear_terms import (
    add_modal_force,
    finite,
    floor_load,
    internal_forces,
    power_damper,
)
from tdint.kernels.stepping import STEP, Factors, Memory, Scene
from tdint.kernels.stories.law_state import commit, restoring, settle
from tdint.methods.method import Family, Method

Table = tuple[tuple[float, ...], ...]

# ---- Explicit: a step of s stages. Coefficients: s, then for each stage after the first, and for the end of the step,
# its node and its row of A (for the end: 1 and b).

_MOST_STAGES = 6  # of the methods here: rk5


class _ExplicitRows(NamedTuple):
    """Rows of work."""

    LOAD: int = 1
    SUM: int = 1
    U: int = 1
    V: int = _MOST_STAGES + 1  # velocity of each stage and of the end
    A: int = _MOST_STAGES + 1  # acceleration, likewise


_AT, _EXPLICIT_ROWS = at.chained(_ExplicitRows)


@kernel(STEP)
def explicit_step(
    coefficients,
    linear_terms,
    modal,
    law_parameters,
    forces,
    flags,
    h,
    load,
    state,
    springs,
    work,
    report,
):
    """One explicit step. The first stage is the end of the step before: state row ACCELERATION, from equilibrium."""
    n = linear_terms.shape[1] - 1
    for i in range(n):
        work[_AT.V, i] = state[at.VELOCITY, i]
        work[_AT.A, i] = state[at.ACCELERATION, i]
    stages = int(coefficients[0])
    row = 1
    for stage in range(1, stages + 1):
        for i in range(n):
            work[_AT.U, i] = state[at.DISPLACEMENT, i]
            work[_AT.V + stage, i] = state[at.VELOCITY, i]
        # A stage is the start and what the rates of the earlier ones add.
        for earlier in range(stage):
            weight = h * coefficients[row + 1 + earlier]
            for i in range(n):
                work[_AT.U, i] += weight * work[_AT.V + earlier, i]
                work[_AT.V + stage, i] += weight * work[_AT.A + earlier, i]
        below = 0.0
        for i in range(n):
            restoring(
                law_parameters,
                springs,
                i,
                0,
                at.FIRST_TRIAL,
                work[_AT.U, i] - linear_terms[at.LINK, i] * below,
            )
            below = work[_AT.U, i]
        # Its acceleration from equilibrium at its own time, the ground linear in the step.
        c = coefficients[row]
        ground = load[at.GROUND_0] + c * (load[at.GROUND_1] - load[at.GROUND_0])
        floor_load(linear_terms, forces, load[at.TIME] + c * h, ground, work, _AT.LOAD)
        internal_forces(
            linear_terms,
            modal,
            springs,
            at.FIRST_TRIAL,
            work,
            _AT.V + stage,
            _AT.A + stage,
            _AT.SUM,
        )
        for i in range(n):
            work[_AT.A + stage, i] = linear_terms[at.INVERSE_MASS, i] * (
                work[_AT.LOAD, i] - work[_AT.A + stage, i]
            )
        row += stage + 1
    for i in range(n):
        state[at.DISPLACEMENT, i] = work[_AT.U, i]
        state[at.VELOCITY, i] = work[_AT.V + stages, i]
        state[at.ACCELERATION, i] = work[_AT.A + stages, i]
        commit(law_parameters, springs, i, 0, at.FIRST_TRIAL)
    return 1 if finite(state, n) else at.NOT_FINITE


def explicit_row(a: Table) -> tuple[float, ...]:
    """Coefficients of `explicit_step`; the rows of A below the first one, b last."""
    return (float(len(a)), *(number for row in a for number in (math.fsum(row), *row)))


def imaginary_limit(a: Table) -> float:
    """Largest stable omega h without damping: the first root of |R(i omega h)|^2 = 1, R the stability polynomial; 0 if
    the method grows from the start.

    R(z) = 1 + sum of b A^k 1 z^(k+1).
    """
    from numpy.polynomial import Polynomial  # for this alone

    s = len(a)
    matrix = np.zeros((s, s))
    for i, row in enumerate(a[:-1], start=1):
        matrix[i, :i] = row
    power = np.ones(s)
    moments = [1.0]
    for _ in range(s):
        moments.append(float(np.dot(a[-1], power)))
        power = matrix @ power
    # With y = (omega h)^2 the real part of R is a polynomial in y, and so is the imaginary part over omega h.
    real = Polynomial([(-1.0) ** k * moment for k, moment in enumerate(moments[0::2])])
    imaginary = Polynomial([(-1.0) ** k * moment for k, moment in enumerate(moments[1::2])])
    growth = real**2 + Polynomial([0.0, 1.0]) * imaginary**2 - 1.0
    # The terms below the order of the method vanish, but for rounding.
    leading = int(np.argmax(np.abs(growth.coef) > 1e-12))
    if growth.coef[leading] > 0.0:
        return 0.0
    roots = np.asarray(Polynomial(growth.coef[leading:]).roots(), dtype=np.complex128)
    crossings = roots.real[(np.abs(roots.imag) < 1e-9) & (roots.real > 0.0)]
    return math.sqrt(np.min(crossings, initial=math.inf))


DORMAND_PRINCE: Table = (
    (1 / 5,),
    (3 / 40, 9 / 40),
    (44 / 45, -56 / 15, 32 / 9),
    (19372 / 6561, -25360 / 2187, 64448 / 6561, -212 / 729),
    (9017 / 3168, -355 / 33, 46732 / 5247, 49 / 176, -5103 / 18656),
    (35 / 384, 0.0, 500 / 1113, 125 / 192, -2187 / 6784, 11 / 84),
)

# ---- Implicit, two stages one after the other. The unknowns are the accelerations a1, a2 of the stages,
#
#     M ai + C (v0 + h sum Aij aj) + f(u0 + ci h v0 + h^2 sum (A^2)ij aj) = pi,
#
# so that nothing cancels at small h. Newton's matrix has a block of 2 x 2 per floor.

# Coefficients
C = 0
A = 2  # row by row
A2 = 6  # A^2
B = 10
BA = 12  # b A


class _StageRows(NamedTuple):
    """Rows of work, one for each stage and more."""

    STAGE_LOAD: int = 2
    STAGE_A: int = 2
    STAGE_U: int = 2
    STAGE_V: int = 2
    STAGE_SUM: int = 2  # story forces, dampers included
    SIZE: int = 2  # of the terms in them
    R: int = 2  # residuals, then corrections
    TANGENT: int = 2
    SLOPE: int = 2  # of the power-law dashpots
    FACTORED: int = 2
    FACTORED_SLOPE: int = 2
    CORRECTION: int = 2  # the last one
    BLOCKS: int = 4
    COUPLING: int = COUPLING_ROWS


_ROW, _STORE = at.chained(_StageRows)


@kernel(STEP)
def implicit_step(
    coefficients,
    linear_terms,
    modal,
    law_parameters,
    forces,
    flags,
    h,
    load,
    state,
    springs,
    work,
    report,
):
    """One step of a two-stage method; Newton on all stories and both stages at once.

    Where it goes round in a cycle, corrections are halved until they bring the equations closer to balance.
    """
    n = linear_terms.shape[1] - 1
    scene = Scene(linear_terms, modal, law_parameters, forces, flags)
    memory = Memory(state, springs, work, report)
    factors = Factors(work, _ROW.BLOCKS, _ROW.COUPLING, _STORE)
    first, second = h * coefficients[A], h * coefficients[A + 1]
    damping = ModalBlocks(modal, first, second, h * coefficients[A + 2], h * coefficients[A + 3])
    _predict(coefficients, scene, h, load, memory)
    iterations = 0
    part = 1.0
    before = math.inf
    while True:
        stale = _stages(coefficients, linear_terms, law_parameters, h, memory)
        if _in_balance(iterations == ITERATIONS, linear_terms, modal, work, report):
            break
        if iterations >= PATIENCE:
            # A correction that led farther from balance is taken back by half, and by half again.
            size = squares(linear_terms, work, _ROW.R, n) + squares(
                linear_terms, work, _ROW.R + 1, n
            )
            if too_far(size, before, part):
                part *= 0.5
                add_rows(-part, work, _ROW.CORRECTION, _ROW.STAGE_A, 2, n)
                continue
            before = size
            part = 1.0
        if iterations == ITERATIONS:
            return at.NOT_CONVERGED
        if stale:
            _factor(coefficients, linear_terms, h, factors, damping)
            report[at.FACTORED_STEP] = h
        solve_blocks_damped(factors, damping, _ROW.R, _ROW.R + 1, n)
        iterations += 1
        for stage in range(2):
            for i in range(n):
                work[_ROW.STAGE_A + stage, i] += work[_ROW.R + stage, i]
        if iterations > PATIENCE:
            copy_rows(work, _ROW.R, _ROW.CORRECTION, 2, n)
        if flags[at.LINEAR] != 0.0:
            break
    _finish(coefficients, linear_terms, law_parameters, h, memory)
    return max(iterations, 1) if finite(state, n) else at.NOT_FINITE


@inlined
def _predict(coefficients, scene, h, load, memory):
    """Load at the stages; constant acceleration as the first guess, none in a linear building: that rounds least."""
    linear_terms, _, _, forces, flags = scene
    state, _, work, _ = memory
    guess = 0.0 if flags[at.LINEAR] != 0.0 else 1.0
    for stage in range(2):
        c = coefficients[C + stage]
        ground = load[at.GROUND_0] + c * (load[at.GROUND_1] - load[at.GROUND_0])
        floor_load(
            linear_terms, forces, load[at.TIME] + c * h, ground, work, _ROW.STAGE_LOAD + stage
        )
        for i in range(linear_terms.shape[1] - 1):
            work[_ROW.STAGE_A + stage, i] = guess * state[at.ACCELERATION, i]


@inlined
def _stages(coefficients, linear_terms, law_parameters, h, memory):
    """Motion and story forces at both stages, one reached from the other. True if the factorization does not fit."""
    state, springs, work, report = memory
    n = linear_terms.shape[1] - 1
    stale = report[at.FACTORED_STEP] != h
    for stage in range(2):
        past = stage * at.FIRST_TRIAL
        trial = past + at.FIRST_TRIAL
        shift = h * coefficients[C + stage]
        v_by_1 = h * coefficients[A + 2 * stage]
        v_by_2 = h * coefficients[A + 2 * stage + 1]
        u_by_1 = h * h * coefficients[A2 + 2 * stage]
        u_by_2 = h * h * coefficients[A2 + 2 * stage + 1]
        u_below = 0.0
        v_below = 0.0
        for i in range(n):
            a_1 = work[_ROW.STAGE_A, i]
            a_2 = work[_ROW.STAGE_A + 1, i]
            u = (
                state[at.DISPLACEMENT, i]
                + shift * state[at.VELOCITY, i]
                + (u_by_1 * a_1 + u_by_2 * a_2)
            )
            v = state[at.VELOCITY, i] + (v_by_1 * a_1 + v_by_2 * a_2)
            drift = u - linear_terms[at.LINK, i] * u_below
            rate = v - linear_terms[at.LINK, i] * v_below
            u_below = u
            v_below = v
            work[_ROW.STAGE_U + stage, i] = u
            work[_ROW.STAGE_V + stage, i] = v
            tangent = restoring(law_parameters, springs, i, past, trial, drift)
            work[_ROW.TANGENT + stage, i] = tangent
            stale = (
                stale
                or abs(tangent - work[_ROW.FACTORED + stage, i])
                > SAME_TANGENT * law_parameters[at.STIFFNESS, i]
            )
            damper, slope = power_damper(linear_terms, i, rate)
            work[_ROW.SLOPE + stage, i] = slope
            change = abs(slope - work[_ROW.FACTORED_SLOPE + stage, i])
            stale = (
                stale or change * h * abs(coefficients[A]) > SAME_TANGENT * linear_terms[at.MASS, i]
            )
            total = (
                springs[trial + at.FORCE, i]
                + linear_terms[at.GEOMETRIC, i] * drift
                + linear_terms[at.STORY_DAMPER, i] * rate
                + damper
            )
            work[_ROW.STAGE_SUM + stage, i] = total
            # A drift is a difference: what the displacements round is not out of balance.
            rounding = SMALL / CLOSE * law_parameters[at.STIFFNESS, i]
            work[_ROW.SIZE + stage, i] = abs(total) + rounding * (abs(u) + abs(u - drift))
    return stale


@inlined
def _in_balance(last, linear_terms, modal, work, report):
    """Unbalanced forces at both stages into their rows, N. Whether all are small. At the last of them the worst is
    noted."""
    n = linear_terms.shape[1] - 1
    report[at.RESIDUAL] = 0.0
    small = True
    for stage in range(2):
        total = _ROW.STAGE_SUM + stage
        for i in range(n):
            work[_ROW.R + stage, i] = 0.0
        add_modal_force(modal, work, _ROW.STAGE_V + stage, 1.0, work, _ROW.R + stage, n)
        for i in range(n):
            link = linear_terms[at.LINK, i + 1]
            outer = work[_ROW.STAGE_LOAD + stage, i]
            inertia = linear_terms[at.MASS, i] * work[_ROW.STAGE_A + stage, i]
            damping = (
                linear_terms[at.FLOOR_DAMPER, i] * work[_ROW.STAGE_V + stage, i]
                + work[_ROW.R + stage, i]
            )
            residual = outer - inertia - damping - work[total, i] + link * work[total, i + 1]
            work[_ROW.R + stage, i] = residual
            scale = abs(outer) + abs(inertia) + abs(damping)
            scale += work[_ROW.SIZE + stage, i] + link * work[_ROW.SIZE + stage, i + 1]
            small &= balanced(last, CLOSE, report, i, residual, scale)
    return small


@inlined
def _factor(coefficients, linear_terms, h, factors, damping):
    """Factor I2 (x) M + h A (x) C + h^2 A^2 (x) K, each stage with its own tangents."""
    work = factors.table
    n = linear_terms.shape[1] - 1
    for entry in range(4):
        stage = entry // 2
        by_m = 1.0 if entry == 0 or entry == 3 else 0.0
        by_c = h * coefficients[A + entry]
        by_k = h * h * coefficients[A2 + entry]
        for i in range(n):
            damper = linear_terms[at.STORY_DAMPER, i] + work[_ROW.SLOPE + stage, i]
            story = (
                by_k * (work[_ROW.TANGENT + stage, i] + linear_terms[at.GEOMETRIC, i])
                + by_c * damper
            )
            work[_ROW.COUPLING + entry, i] = story
            work[_ROW.BLOCKS + entry, i] = (
                by_m * linear_terms[at.MASS, i] + by_c * linear_terms[at.FLOOR_DAMPER, i] + story
            )
    for stage in range(2):
        for i in range(n):
            work[_ROW.FACTORED + stage, i] = work[_ROW.TANGENT + stage, i]
            work[_ROW.FACTORED_SLOPE + stage, i] = work[_ROW.SLOPE + stage, i]
    link_blocks(linear_terms, factors, n)
    factor_blocks(factors, damping, n)


@inlined
def _finish(coefficients, linear_terms, law_parameters, h, memory):
    """Update the state and commit the drift laws, reached from the second stage.

    State row ACCELERATION, the next step's first guess, is the line through both stages.
    """
    state, springs, work, _ = memory
    n = linear_terms.shape[1] - 1
    beyond = (1.0 - coefficients[C + 1]) / (coefficients[C + 1] - coefficients[C])
    below = 0.0
    for i in range(n):
        a_1 = work[_ROW.STAGE_A, i]
        a_2 = work[_ROW.STAGE_A + 1, i]
        v = state[at.VELOCITY, i]
        u = (
            state[at.DISPLACEMENT, i]
            + h * v
            + h * h * (coefficients[BA] * a_1 + coefficients[BA + 1] * a_2)
        )
        state[at.DISPLACEMENT, i] = u
        state[at.VELOCITY, i] = v + h * (coefficients[B] * a_1 + coefficients[B + 1] * a_2)
        state[at.ACCELERATION, i] = a_2 + beyond * (a_2 - a_1)
        settle(law_parameters, springs, i, 0, at.FIRST_TRIAL)
        settle(law_parameters, springs, i, at.FIRST_TRIAL, at.SECOND_TRIAL)
        restoring(
            law_parameters,
            springs,
            i,
            at.SECOND_TRIAL,
            at.THIRD_TRIAL,
            u - linear_terms[at.LINK, i] * below,
        )
        commit(law_parameters, springs, i, at.SECOND_TRIAL, at.THIRD_TRIAL)
        below = u


def implicit_row(a: Table, b: tuple[float, ...]) -> tuple[float, ...]:
    """Coefficients of `implicit_step` from A and b; the nodes are the row sums of A."""
    matrix = np.array(a)
    parts = (matrix.sum(axis=1), matrix, matrix @ matrix, np.array(b), np.array(b) @ matrix)
    return tuple(float(number) for part in parts for number in part.ravel())


_SHIFT = math.sqrt(3.0) / 6.0
GAUSS: Table = ((0.25, 0.25 - _SHIFT), (0.25 + _SHIFT, 0.25))

EXPLICIT = Family(
    "runge-kutta",
    explicit_step,
    lambda modes: _EXPLICIT_ROWS,
    memory=(at.DISPLACEMENT, at.VELOCITY),
    halvable=False,
)
IMPLICIT = Family(
    "runge-kutta",
    implicit_step,
    lambda modes: _STORE + 6 * modes + 1,
    memory=(at.DISPLACEMENT, at.VELOCITY),
)

METHODS = (
    Method(
        name="rk5",
        family=EXPLICIT,
        coefficients=lambda: explicit_row(DORMAND_PRINCE),
        order=lambda: 5,
        implicit=lambda: False,
        stability_limit=lambda: imaginary_limit(DORMAND_PRINCE),
        rho_inf=lambda: math.nan,
        source="Dormand and Prince (1980), the fifth-order weights at a fixed step",
    ),
    Method(
        name="gauss4",
        family=IMPLICIT,
        coefficients=lambda: implicit_row(GAUSS, (0.5, 0.5)),
        order=lambda: 4,
        rho_inf=lambda: 1.0,
        source="two-stage Gauss method, Kuntzmann (1961) and Butcher (1964)",
    ),
)
