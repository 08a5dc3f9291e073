"""The impulse-momentum step with the restoring force and the load integrated: order 4, dissipation by rho_inf.

    kinematics  u1 - u0 = h ((1 - th) v0 + th v1) + h^2 (al a0 - be a1)
    momentum    M (v1 - v0) + C (u1 - u0) + S = I
    equilibrium M a1 + C v1 + f(u1) = p1

I is the exact impulse of the load. S = h (w0 f0 + wc f(uc) + w1 f1) integrates the restoring force with a point inside
the step, uc = u0 + gd (u1 - u0) + h (g0 v0 + g1 v1) at the fraction c; forces of power-law dashpots are integrated
alike, with vc from the cubic Hermite interpolant. In a linear building the step is the Pade
approximation of the exponential with denominator of degree 2: (2,2) for rho_inf = 1, order 4; (1,2), that is Radau IIA,
for rho_inf = 0; order 3 in between. The tests derive the coefficients again.
"""

from __future__ import annotations

import math

from tdint.kernels.branches import ABOVE, BELOW, TURNED, advance, switch
from tdint.kernels.chain import finite, floor_impulse, floor_load, power_damper
from tdint.kernels.compiling import called, inlined, kernel
from tdint.kernels.events import NONE, first_event
from tdint.kernels.layout import (
    ACCELERATION,
    ALL_BRANCHES,
    BRANCHES,
    DISPLACEMENT,
    DRIFT,
    EVENTS,
    FIRST_TRIAL,
    FORCE,
    GEOMETRIC,
    GROUND_0,
    GROUND_1,
    LINEAR,
    LINK,
    LOWER,
    MASS,
    NO_BRANCHES,
    NOT_CONVERGED,
    NOT_FINITE,
    POWER_DAMPER,
    SECOND_TRIAL,
    SLOPE,
    SPRING_ROWS,
    STIFFNESS,
    STORY_DAMPER,
    TIME,
    TURN,
    UPPER,
    VELOCITY,
)
from tdint.kernels.momentum import (
    A1,
    DU,
    DV,
    FORCE_1,
    FORCE_S,
    IMPULSE,
    LOAD,
    MOMENTUM_ROWS,
    SIZE,
    U1,
    V1,
    correct,
    guess,
    in_balance,
    residuals,
)
from tdint.kernels.springs import commit, restoring, resume, settle
from tdint.kernels.stepping import CLOSE, ITERATIONS, SAME_TANGENT, SMALL, STEP
from tdint.kernels.tridiagonal import assemble_blocks, factor_blocks
from tdint.methods.method import Family, Method, Parameter

# Coefficients
THETA = 0
ALPHA = 1
BETA = 2
WEIGHT_0 = 3
WEIGHT_C = 4
WEIGHT_1 = 5
BY_INCREMENT = 6  # gd
BY_VELOCITY_0 = 7  # g0
BY_VELOCITY_1 = 8  # g1
RATE_BY_INCREMENT = 9  # vc = these times (u1 - u0) / h, v0 and v1
RATE_BY_VELOCITY_0 = 10
RATE_BY_VELOCITY_1 = 11

# Rows of work beyond those of the momentum equations
_TANGENT_C = MOMENTUM_ROWS
_TANGENT_1 = MOMENTUM_ROWS + 1
_SLOPE_C = MOMENTUM_ROWS + 2  # of the power-law dashpots
_SLOPE_1 = MOMENTUM_ROWS + 3
_SAVED = MOMENTUM_ROWS + 4  # state and springs at the start of a step that is done in pieces
_FACTORS = _SAVED + 3 + SPRING_ROWS

# Rows of a block of factors
_FACTORED_C = 0  # its tangents; the step stands in the last column
_FACTORED_1 = 1
_FACTORED_SLOPE = 2  # the one at the end
_BLOCKS = 3
_COUPLING = 7
_STORE = 11

_STRAYED = 0.1  # over the drift's change: a located event that is missed by more was not located
_BACKWARD = 1e-6  # over the drifts: what a story may go back on a branch that holds for one direction
_AT_ONCE = 1e-9  # an event within this part of the step from here happens here


def _factor_rows(modes: int) -> int:
    return _STORE + 6 * modes + 1


def work_rows(modes: int) -> int:
    """Rows of work that the step needs for a building with `modes` modally damped modes."""
    return _FACTORS + 2 * _factor_rows(modes)


@kernel(STEP)
def step(coefficients, chain, modal, laws, forces, h, load, state, springs, work, memo):
    """One step from kink to kink of the laws that have any; where kinks pile up, and without any, straight on."""
    n = chain.shape[1] - 1
    if memo[BRANCHES] != NO_BRANCHES:
        code = _by_branches(coefficients, chain, modal, laws, forces, h, load, state, springs, work, memo)
        if code != NOT_CONVERGED:
            return code
    _loads(chain, forces, load[TIME], h, load[GROUND_0], load[GROUND_1], work)
    code = _newton(False, coefficients, chain, modal, laws, h, state, springs, work, memo, _FACTORS)
    if code < 0:
        return code
    _arrive(False, chain, laws, state, springs, work)
    if memo[BRANCHES] != NO_BRANCHES:
        for i in range(n):
            resume(laws, springs, i)
    return code if finite(state, n) else NOT_FINITE


@called
def _newton(frozen, coefficients, chain, modal, laws, h, state, springs, work, memo, factors):
    """Motion over a step by Newton on all stories at once, unknowns (u1 - u0, v1 - v0) per floor, a1 eliminated by
    equilibrium.

    With `frozen`, stories that are linear on their branches stay on them.
    """
    n = chain.shape[1] - 1
    guess(1.0, h, state, work, n)
    iterations = 0
    last = False
    while True:
        stale = _path(False, frozen, coefficients, chain, laws, h, state, springs, work, factors)
        _residuals(coefficients, chain, modal, h, state, work)
        if in_balance(coefficients[BETA], chain, h, state, work, memo) or last:
            break
        if iterations == ITERATIONS:
            return NOT_CONVERGED
        if stale:
            _factor(coefficients, chain, modal, h, work, factors)
        last = _correct(coefficients, modal, h, work, factors, n)
        iterations += 1
    return max(iterations, 1)


@called
def _by_branches(coefficients, chain, modal, laws, forces, h, load, state, springs, work, memo):
    """One step in which no law changes its branch, or one piece for each part of it between two such changes.

    The first change is looked for on the cubic Hermite interpolant of the drifts, the step done again up to there, and
    the rest of it on the new branch. Where all laws are linear on their branches, a piece is one linear solve; curved
    ones among them take Newton's iteration. Where the changes exceed a few per story, or the motion up to one does not
    reach it because the step is too large for the interpolant, the state is left as it was.
    """
    n = chain.shape[1] - 1
    straight = memo[BRANCHES] == ALL_BRANCHES
    slope = (load[GROUND_1] - load[GROUND_0]) / h
    most = 20 + 4 * n
    done = 0.0
    piece = h
    events = 0
    solves = 0
    ending = False  # whether the piece ends with a change of branch
    story = -1
    how = TURNED
    while True:
        factors = _FACTORS if piece == h else _FACTORS + _STORE + 6 * modal.shape[0] + 1
        ground = load[GROUND_0] + slope * done
        _loads(chain, forces, load[TIME] + done, piece, ground, ground + slope * piece, work)
        if straight:
            _solve_piece(coefficients, chain, modal, laws, piece, state, springs, work, factors)
            solves += 1
        else:
            code = _newton(True, coefficients, chain, modal, laws, piece, state, springs, work, memo, factors)
            if code < 0:
                if events > 0:
                    _restore(state, springs, work, n)
                return code
            solves += code
        if not ending and memo[LINEAR] == 0.0:
            fraction, story, how = first_event(chain, piece, state, springs, work, U1, V1)
            if fraction != NONE:
                if events == 0:
                    _save(state, springs, work, n)
                events += 1
                if events > most:
                    _restore(state, springs, work, n)
                    return NOT_CONVERGED
                if fraction * piece > _AT_ONCE * h:
                    piece *= fraction
                    ending = True
                else:
                    switch(laws, springs, story, 0, how)
                continue
        if ending and _strays(chain, springs, work, story, how):
            _restore(state, springs, work, n)
            return NOT_CONVERGED
        if straight:
            _advance(chain, laws, state, springs, work)
        else:
            _arrive(True, chain, laws, state, springs, work)
        done += piece
        piece = h - done
        if not ending or piece <= _AT_ONCE * h:
            break
        switch(laws, springs, story, 0, how)
        ending = False
    if ending:
        switch(laws, springs, story, 0, how)
    memo[EVENTS] += events
    return solves if finite(state, n) else NOT_FINITE


@inlined
def _loads(chain, forces, t, h, ground_0, ground_1, work):
    """Load at the end and exact impulse over [t, t + h]."""
    floor_load(chain, forces, t + h, ground_1, work, LOAD)
    floor_impulse(chain, forces, t, h, ground_0, ground_1, work, IMPULSE)


@inlined
def _solve_piece(coefficients, chain, modal, laws, h, state, springs, work, factors):
    """Motion over a step in which no story leaves its branch: linear, so one solve."""
    n = chain.shape[1] - 1
    guess(0.0, h, state, work, n)
    for solved in range(2):
        stale = _path(True, True, coefficients, chain, laws, h, state, springs, work, factors)
        _residuals(coefficients, chain, modal, h, state, work)
        if solved == 0:
            if stale:
                _factor(coefficients, chain, modal, h, work, factors)
            _correct(coefficients, modal, h, work, factors, n)


@inlined
def _path(straight, frozen, coefficients, chain, laws, h, state, springs, work, factors):
    """Drift laws along the step: at the inner point and from there to the end.

    With `frozen`, stories that are linear on their branches stay on them; with `straight`, all are such stories.
    Leaves the story forces at the end and the story impulses. True if the factorization does not fit the tangents.
    """
    n = chain.shape[1] - 1
    stale = work[factors + _FACTORED_1, n] != h
    uc_below = 0.0
    u_below = 0.0
    v_below = 0.0
    v0_below = 0.0
    du_below = 0.0
    for i in range(n):
        du = work[DU, i]
        u = state[DISPLACEMENT, i] + du
        v = state[VELOCITY, i] + work[DV, i]
        uc = (
            state[DISPLACEMENT, i]
            + coefficients[BY_INCREMENT] * du
            + h * (coefficients[BY_VELOCITY_0] * state[VELOCITY, i] + coefficients[BY_VELOCITY_1] * v)
        )
        work[U1, i] = u
        work[V1, i] = v
        link = chain[LINK, i]
        drift_c = uc - link * uc_below
        drift = u - link * u_below
        increment = du - link * du_below
        rate = v - link * v_below
        if straight or (frozen and springs[SLOPE, i] < math.inf):
            tangent_c = tangent = springs[SLOPE, i]
            force_c = springs[FORCE, i] + tangent * (drift_c - springs[DRIFT, i])
            force = springs[FORCE, i] + tangent * (drift - springs[DRIFT, i])
        else:
            tangent_c = restoring(laws, springs, i, 0, FIRST_TRIAL, drift_c)
            tangent = restoring(laws, springs, i, FIRST_TRIAL, SECOND_TRIAL, drift)
            force_c = springs[FIRST_TRIAL + FORCE, i]
            force = springs[SECOND_TRIAL + FORCE, i]
        if straight:
            stale = stale or tangent != work[factors + _FACTORED_1, i]
        else:
            same = SAME_TANGENT * laws[STIFFNESS, i]
            stale = stale or abs(tangent_c - work[factors + _FACTORED_C, i]) > same
            stale = stale or abs(tangent - work[factors + _FACTORED_1, i]) > same
            # A drift is a difference: what the displacements round is not out of balance.
            work[SIZE, i] = SMALL / CLOSE * laws[STIFFNESS, i] * (abs(u) + abs(link * u_below))
        work[_TANGENT_C, i] = tangent_c
        work[_TANGENT_1, i] = tangent
        damper_1 = 0.0
        dampers = 0.0
        if not straight and chain[POWER_DAMPER, i] != 0.0:
            rate_0 = state[VELOCITY, i] - link * v0_below
            rate_c = (
                coefficients[RATE_BY_INCREMENT] / h * increment
                + coefficients[RATE_BY_VELOCITY_0] * rate_0
                + coefficients[RATE_BY_VELOCITY_1] * rate
            )
            damper_c, slope_c = power_damper(chain, i, rate_c)
            damper_1, slope_1 = power_damper(chain, i, rate)
            dampers = (
                coefficients[WEIGHT_0] * power_damper(chain, i, rate_0)[0]
                + coefficients[WEIGHT_C] * damper_c
                + coefficients[WEIGHT_1] * damper_1
            )
            work[_SLOPE_C, i] = slope_c
            work[_SLOPE_1, i] = slope_1
            change = abs(slope_1 - work[factors + _FACTORED_SLOPE, i])
            stale = stale or h * change > SAME_TANGENT * chain[MASS, i]
        geometric = chain[GEOMETRIC, i]
        mean = (
            coefficients[WEIGHT_0] * (springs[FORCE, i] + geometric * springs[DRIFT, i])
            + coefficients[WEIGHT_C] * (force_c + geometric * drift_c)
            + coefficients[WEIGHT_1] * (force + geometric * drift)
        )
        damper = chain[STORY_DAMPER, i]
        work[FORCE_1, i] = force + geometric * drift + damper * rate + damper_1
        work[FORCE_S, i] = h * (mean + dampers) + damper * increment
        uc_below = uc
        u_below = u
        v_below = v
        v0_below = state[VELOCITY, i]
        du_below = du
    return stale


@inlined
def _residuals(coefficients, chain, modal, h, state, work):
    residuals(coefficients[THETA], coefficients[ALPHA], coefficients[BETA], chain, modal, h, state, work)


@inlined
def _correct(coefficients, modal, h, work, factors, n):
    blocks = factors + _BLOCKS
    return correct(coefficients[BETA], modal, h, work, blocks, factors + _COUPLING, factors + _STORE, n)


@called
def _factor(coefficients, chain, modal, h, work, factors):
    """Factor the Newton matrix for the present tangents."""
    n = chain.shape[1] - 1
    by_a = coefficients[BETA] * h * h
    inner = h * (coefficients[THETA] - coefficients[WEIGHT_1])  # = h wc gd
    coupling = factors + _COUPLING
    for i in range(n):
        tangent_c = work[_TANGENT_C, i]
        tangent_1 = work[_TANGENT_1, i]
        work[factors + _FACTORED_C, i] = tangent_c
        work[factors + _FACTORED_1, i] = tangent_1
        tangent_c += chain[GEOMETRIC, i]
        tangent_1 += chain[GEOMETRIC, i]
        damper = chain[STORY_DAMPER, i]
        slope_c = coefficients[WEIGHT_C] * work[_SLOPE_C, i]
        slope_1 = work[_SLOPE_1, i]
        work[factors + _FACTORED_SLOPE, i] = slope_1
        work[coupling, i] = -by_a * tangent_1
        work[coupling + 1, i] = -by_a * (damper + slope_1)
        work[coupling + 2, i] = damper + inner * tangent_c + h * coefficients[WEIGHT_1] * tangent_1
        work[coupling + 2, i] += coefficients[RATE_BY_INCREMENT] * slope_c
        work[coupling + 3, i] = -by_a * tangent_c
        work[coupling + 3, i] += h * (coefficients[RATE_BY_VELOCITY_1] * slope_c + coefficients[WEIGHT_1] * slope_1)
    work[factors + _FACTORED_1, n] = h
    assemble_blocks(chain, work, factors + _BLOCKS, coupling, h * coefficients[THETA], by_a, n)
    factor_blocks(factors + _BLOCKS, coupling, work, modal, 0.0, -by_a, 1.0, 0.0, factors + _STORE, n)


@called
def _strays(chain, springs, work, story, how):
    """Whether a piece up to an event misses it, or takes another story far off its branch."""
    below = 0.0
    for i in range(chain.shape[1] - 1):
        drift = work[U1, i] - chain[LINK, i] * below
        below = work[U1, i]
        change = drift - springs[DRIFT, i]
        if springs[TURN, i] * change < -_BACKWARD * (abs(drift) + abs(springs[DRIFT, i])):
            return True
        allowed = _STRAYED * abs(change)
        if drift > springs[UPPER, i] + allowed or drift < springs[LOWER, i] - allowed:
            return True
        if i == story and (
            (how == ABOVE and drift < springs[UPPER, i] - allowed)
            or (how == BELOW and drift > springs[LOWER, i] + allowed)
        ):
            return True
    return False


@inlined
def _advance(chain, laws, state, springs, work):
    """Update the state after a piece in which all stories go along their branches."""
    below = 0.0
    for i in range(chain.shape[1] - 1):
        u = state[DISPLACEMENT, i] + work[DU, i]
        state[DISPLACEMENT, i] = u
        state[VELOCITY, i] += work[DV, i]
        state[ACCELERATION, i] = work[A1, i]
        advance(laws, springs, i, 0, u - chain[LINK, i] * below)
        below = u


@called
def _arrive(frozen, chain, laws, state, springs, work):
    """Update the state after a step or a piece of one; with `frozen`, linear stories go along their branches.

    Not inlined, and not for linear stories alone: that would cost them a fifth to a half of their time.
    """
    below = 0.0
    for i in range(chain.shape[1] - 1):
        u = state[DISPLACEMENT, i] + work[DU, i]
        state[DISPLACEMENT, i] = u
        state[VELOCITY, i] += work[DV, i]
        state[ACCELERATION, i] = work[A1, i]
        if frozen and springs[SLOPE, i] < math.inf:
            advance(laws, springs, i, 0, u - chain[LINK, i] * below)
        else:
            settle(laws, springs, i, 0, FIRST_TRIAL)
            commit(laws, springs, i, FIRST_TRIAL, SECOND_TRIAL)
        below = u


@called
def _save(state, springs, work, n):
    for i in range(n):
        for row in range(3):
            work[_SAVED + row, i] = state[row, i]
        for row in range(SPRING_ROWS):
            work[_SAVED + 3 + row, i] = springs[row, i]


@called
def _restore(state, springs, work, n):
    for i in range(n):
        for row in range(3):
            state[row, i] = work[_SAVED + row, i]
        for row in range(SPRING_ROWS):
            springs[row, i] = work[_SAVED + 3 + row, i]


def coefficients(rho_inf: float) -> tuple[float, ...]:
    """Coefficients of the step for a spectral radius rho_inf at infinity.

    theta, alpha and beta make the linear step the Pade approximation that tends to rho_inf. Any inner point c would do
    for order 3: quadratics are integrated exactly by (w0, wc, w1), and uc is exact for quadratics. c runs from 1/3,
    where the step is Radau IIA for nonlinear laws too, to 1/2, where it is Simpson's rule on the cubic Hermite
    interpolant.

    Measured on a hardening and a softening oscillator: at rho_inf = 1 Simpson's rule has a quarter of the error of the
    corrected trapezoidal rule with tangents at the ends; below 1 the choice of c matters by a few percent, and the
    inner point of the cubic Hermite interpolant, c = 1 / (1 + rho_inf), degenerates towards rho_inf = 0.
    """
    theta = (2.0 + rho_inf) / (3.0 * (1.0 + rho_inf))
    alpha = 1.0 / 3.0 - theta / 2.0
    beta = theta / 2.0 - 1.0 / 6.0
    c = 1.0 / (3.0 - rho_inf)
    weight_c = 1.0 / (6.0 * c * (1.0 - c))
    weight_1 = 0.5 - weight_c * c
    weight_0 = 1.0 - weight_c - weight_1
    return (
        theta,
        alpha,
        beta,
        weight_0,
        weight_c,
        weight_1,
        (theta - weight_1) / weight_c,
        alpha / weight_c,
        -beta / weight_c,
        6.0 * c * (1.0 - c),
        (1.0 - c) * (1.0 - 3.0 * c),
        c * (3.0 * c - 2.0),
    )


FAMILY = Family("impulse4", step, work_rows, memory=(DISPLACEMENT, VELOCITY))

METHODS = (
    Method(
        name="impulse4",
        family=FAMILY,
        parameters=(Parameter("rho_inf", 1.0, 0.0, 1.0),),
        coefficients=coefficients,
        order=lambda rho_inf: 4 if rho_inf == 1.0 else 3,
        implicit=lambda rho_inf: True,
        stability_limit=lambda rho_inf: math.inf,
        rho_inf=lambda rho_inf: rho_inf,
        source="tdint: the impulse-momentum method of 2022 with exact impulses; rho_inf = 0 is Radau IIA (Ehle 1969)",
    ),
)
