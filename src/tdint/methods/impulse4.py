"""The impulse-momentum step with the restoring force and the load integrated: order 4, dissipation
by rho_inf.

    kinematics  u1 - u0 = h ((1 - th) v0 + th v1) + h^2 (al a0 - be a1)
    momentum    M (v1 - v0) + C (u1 - u0) + S = I
    equilibrium M a1 + C v1 + f(u1) = p1

I is the exact impulse of the load. S = h (w0 f0 + wc f(uc) + w1 f1) integrates the restoring force
with a point inside the step, uc = u0 + gd (u1 - u0) + h (g0 v0 + g1 v1) at the fraction c; forces
of power-law dashpots are integrated alike, with vc from the cubic Hermite interpolant
(`tdint.kernels.equations.impulse4`). In a linear building the step is the Pade approximation of the
exponential with denominator of degree 2: (2,2) for rho_inf = 1, order 4; (1,2), that is Radau IIA,
for rho_inf = 0; order 3 in between. The tests derive the coefficients again.
"""

from __future__ import annotations

import math

from tdint.kernels import layout as rows
from tdint.kernels.compiling import inline, kernel, outlined
from tdint.kernels.equations import impulse_momentum as momentum
from tdint.kernels.equations.impulse4 import (
    FACTORS,
    ROW,
    factor_rows,
    join,
    loads,
    newton,
    solve_linear,
)
from tdint.kernels.equations.iteration import add_rows, copy_rows
from tdint.kernels.laws.branch_following import copy_extra_rows
from tdint.kernels.laws.selection import HAS_CURVED_FORCE, HAS_CURVED_LAW, HAS_NONLINEAR_FORCE
from tdint.kernels.linear_terms import FORCES, finite, force_value
from tdint.kernels.peaks_between_steps import find_interstep_peaks, raise_peak
from tdint.kernels.stepping import STEP, Memory, Passage, Scene, Span
from tdint.kernels.stories.branches import NONE, advance, advance_outlined, first_event, switch
from tdint.kernels.stories.law_state import (
    accumulate_dissipation,
    commit,
    restoring_force_outlined,
    resume,
)
from tdint.methods.method import Family, Method, Parameter

_STRAYED = 0.1  # tolerance of an event location, as a fraction of the path of the drift
# Results of `_miss`: the event is not reached, or another event lies before it
_SHORT = -1.0
_BEYOND = 1.0
_BACKWARD = (
    1e-6  # allowed reversal on a branch valid for one direction, as a fraction of the drifts
)
_AT_ONCE = 1e-9  # an event within this fraction of the step is applied immediately


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
    """Take one time step, divided at the branch changes of the piecewise laws.

    The step is not divided if no law has branches or if there are too many branch changes.
    """
    scene = Scene(linear_terms, modal, law_parameters, forces, flags)
    memory = Memory(state, law_state, scratch, step_status)
    if not HAS_NONLINEAR_FORCE:
        return _by_branches(coefficients, scene, h, load, memory)
    n = linear_terms.shape[1] - 1
    if flags[rows.BRANCHES] != rows.NO_BRANCHES:
        code = _by_branches(coefficients, scene, h, load, memory)
        if code != rows.NOT_CONVERGED:
            return code
    step_status[rows.STEP_PEAKS] = 0.0
    loads(
        linear_terms, forces, load[rows.TIME], h, load[rows.GROUND_0], load[rows.GROUND_1], scratch
    )
    code = newton(False, False, coefficients, scene, h, memory, FACTORS)
    if code < 0:
        return code
    join(scene, h, memory)
    _arrive(False, linear_terms, law_parameters, state, law_state, scratch)
    if flags[rows.BRANCHES] != rows.NO_BRANCHES:
        for i in range(n):
            resume(law_parameters, law_state, i)
    return code if finite(state, n) else rows.NOT_FINITE


@outlined
def _by_branches(coefficients, scene, h, load, memory):
    """Take one time step as a sequence of substeps between the branch changes of the laws.

    The first branch change is located on the cubic Hermite interpolant of the drifts. The step is
    repeated up to this time and continues on the new branch. A curved law may reverse within a
    substep if the effect on its force is smaller than the error of a step (`join`). If all laws are
    linear on their branches, a substep is one linear solve; curved laws require Newton's method. If
    the step is too large for the interpolant, the motion may not reach the located branch change:
    the substep is accepted and the search continues from its end. If the motion goes far beyond the
    branch change, the search is repeated on the interpolant of the substep. If there are more than
    20 + 4 n substeps, the initial state is restored and the code NOT_CONVERGED is returned.
    """
    linear_terms, modal, law_parameters, forces, flags = scene
    state, law_state, scratch, step_status = memory
    n = linear_terms.shape[1] - 1
    straight = flags[rows.BRANCHES] == rows.ALL_BRANCHES
    slope = (load[rows.GROUND_1] - load[rows.GROUND_0]) / h
    most = 20 + 4 * n
    done = 0.0
    piece = h
    pieces = 0
    events = 0
    solves = 0
    has_guess = False  # DU and DV contain the first estimate of the next substep
    is_shortened = False  # REMAINING contains the motion to the end of the step
    ending = False  # whether the piece ends with a change of branch
    story = -1
    how = rows.REVERSED
    while True:
        factors = FACTORS if piece == h else FACTORS + factor_rows(modal.shape[0])
        ground = load[rows.GROUND_0] + slope * done
        loads(
            linear_terms,
            forces,
            load[rows.TIME] + done,
            piece,
            ground,
            ground + slope * piece,
            scratch,
        )
        if not HAS_CURVED_FORCE or straight:
            solve_linear(coefficients, scene, piece, memory, factors)
            solves += 1
        else:
            code = newton(True, has_guess, coefficients, scene, piece, memory, factors)
            if code < 0:
                if pieces > 0:
                    _restore(state, law_state, scratch, n)
                return code
            solves += code
            join(scene, piece, memory)
            if HAS_CURVED_LAW and ending and how == rows.REVERSED:
                scratch[ROW.KINK, story] = 0.0
        if HAS_NONLINEAR_FORCE and flags[rows.LINEAR] == 0.0:
            miss = (
                _miss(linear_terms, piece, state, law_state, scratch, story, how)
                if ending
                else _BEYOND
            )
            if miss == _BEYOND:
                ending = False
                fraction, story, how = first_event(
                    linear_terms,
                    piece,
                    state,
                    law_state,
                    scratch,
                    momentum.U1,
                    momentum.V1,
                    ROW.KINK,
                )
                if fraction != NONE:
                    if pieces == 0:
                        _save(state, law_state, scratch, n)
                    pieces += 1
                    if pieces > most:
                        _restore(state, law_state, scratch, n)
                        return rows.NOT_CONVERGED
                    if fraction * piece > _AT_ONCE * h:
                        if HAS_CURVED_FORCE and not straight:
                            if not is_shortened:
                                copy_rows(scratch, momentum.DU, ROW.REMAINING, 2, n)
                            _shorten(fraction, piece, state, scratch, n)
                            has_guess = is_shortened = True
                        piece *= fraction
                        ending = True
                    else:
                        _change(linear_terms, law_parameters, state, law_state, story, how)
                        events += 1
                        piece = h - done
                        if HAS_CURVED_FORCE and is_shortened:
                            copy_rows(scratch, ROW.REMAINING, momentum.DU, 2, n)
                            is_shortened = False
                    continue
            elif miss == _SHORT:
                ending = False
        if HAS_NONLINEAR_FORCE and pieces > 0:
            for row in range(3):
                for i in range(n):
                    scratch[ROW.PIECE + row, i] = state[row, i]
        if not HAS_CURVED_FORCE or straight:
            _advance(linear_terms, law_parameters, state, law_state, scratch)
        else:
            _arrive(True, linear_terms, law_parameters, state, law_state, scratch)
        if HAS_NONLINEAR_FORCE and pieces > 0:
            t = load[rows.TIME] + done + piece
            _look(
                scene,
                Span(
                    t,
                    piece,
                    ground,
                    ground + slope * piece,
                    False,
                    flags[rows.UNRESOLVED_MODES] != 0.0,
                    False,
                ),
                memory,
            )
            step_status[rows.STEP_PEAKS] = ROW.PEAKS
            step_status[rows.RUN_PEAKS] = ROW.PEAKS
        if HAS_CURVED_FORCE and is_shortened:
            # The remaining motion is the first estimate of the next substep.
            add_rows(-1.0, scratch, momentum.DU, ROW.REMAINING, 2, n)
            copy_rows(scratch, ROW.REMAINING, momentum.DU, 2, n)
            is_shortened = False
        done += piece
        if HAS_NONLINEAR_FORCE and ending:
            _change(linear_terms, law_parameters, state, law_state, story, how)
            events += 1
            ending = False
        piece = h - done
        if not HAS_NONLINEAR_FORCE or piece <= _AT_ONCE * h:
            break
    step_status[rows.BRANCH_CHANGES] += events
    return solves if finite(state, n) else rows.NOT_FINITE


@outlined
def _shorten(fraction, h, state, scratch, n):
    """Replace the motion over a substep by the motion over its first part.

    The displacements between the ends are the cubic Hermite polynomials of displacement and
    velocity at both ends. The result is the first estimate of Newton's method.

    Parameters
    ----------
    fraction : float
        Part of the substep that is kept, between 0 and 1.
    h : float
        Length of the substep, s.
    state : ndarray
        State at the start of the substep.
    scratch : ndarray
        Rows DU (m) and DV (m/s), the changes over the substep, are replaced.
    n : int
        Number of floors.
    """
    rest = 1.0 - fraction
    for i in range(n):
        du = scratch[momentum.DU, i]
        v0 = state[rows.VELOCITY, i]
        v1 = v0 + scratch[momentum.DV, i]
        scratch[momentum.DU, i] = fraction * fraction * (3.0 - 2.0 * fraction) * du
        scratch[momentum.DU, i] += fraction * rest * h * (rest * v0 - fraction * v1)
        scratch[momentum.DV, i] = 6.0 * fraction * rest * du / h
        scratch[momentum.DV, i] += rest * (1.0 - 3.0 * fraction) * v0
        scratch[momentum.DV, i] += fraction * (3.0 * fraction - 2.0) * v1 - v0


@outlined
def _change(linear_terms, law_parameters, state, law_state, story, how):
    """Change the branch of a story.

    The law is first moved exactly to the end of its branch, because rounding and the error of the
    interpolant may leave the drift slightly before it and the same event would be found again. A
    sudden change of the force, as in a story that fails, changes the floor accelerations.
    """
    drift = law_state[rows.DRIFT, story]
    force = law_state[rows.FORCE, story]
    if how == rows.REVERSED or not law_state[rows.SLOPE, story] < math.inf:
        switch(law_parameters, law_state, story, 0, how)
    else:
        advance_outlined(
            law_parameters,
            law_state,
            story,
            0,
            law_state[rows.UPPER, story] if how == rows.ABOVE else law_state[rows.LOWER, story],
        )
        switch(law_parameters, law_state, story, 0, how)
        advance_outlined(law_parameters, law_state, story, 0, drift)
    jump = law_state[rows.FORCE, story] - force
    if jump != 0.0:
        state[rows.ACCELERATION, story] -= jump * linear_terms[rows.INVERSE_MASS, story]
        if story > 0:
            state[rows.ACCELERATION, story - 1] += (
                linear_terms[rows.LINK, story] * jump * linear_terms[rows.INVERSE_MASS, story - 1]
            )


@outlined
def _miss(linear_terms, h, state, law_state, scratch, story, how):
    """Return 0 if a substep reaches its event, _SHORT if it ends before the event, and _BEYOND if a
    story goes far beyond its branch."""
    miss = 0.0
    u_below = 0.0
    v_below = 0.0
    v1_below = 0.0
    for i in range(linear_terms.shape[1] - 1):
        link = linear_terms[rows.LINK, i]
        drift = scratch[momentum.U1, i] - link * u_below
        change = drift - law_state[rows.DRIFT, i]
        # The path is longer than the change if the drift reverses.
        way = h * max(
            abs(state[rows.VELOCITY, i] - link * v_below),
            abs(scratch[momentum.V1, i] - link * v1_below),
        )
        allowed = _STRAYED * max(way, abs(change))
        u_below = scratch[momentum.U1, i]
        v_below = state[rows.VELOCITY, i]
        v1_below = scratch[momentum.V1, i]
        backward = law_state[rows.RATE_SIGN, i] * change < -_BACKWARD * (
            abs(drift) + abs(law_state[rows.DRIFT, i])
        )
        if backward and scratch[ROW.KINK, i] == 0.0:
            return _BEYOND
        if drift > law_state[rows.UPPER, i] + allowed or drift < law_state[rows.LOWER, i] - allowed:
            return _BEYOND
        if i == story and (
            (how == rows.ABOVE and drift < law_state[rows.UPPER, i] - allowed)
            or (how == rows.BELOW and drift > law_state[rows.LOWER, i] + allowed)
        ):
            miss = _SHORT
    return miss


@inline
def _advance(linear_terms, law_parameters, state, law_state, scratch):
    """Update the state after a substep in which all stories stay on their branches."""
    below = 0.0
    for i in range(linear_terms.shape[1] - 1):
        u = state[rows.DISPLACEMENT, i] + scratch[momentum.DU, i]
        state[rows.DISPLACEMENT, i] = u
        state[rows.VELOCITY, i] += scratch[momentum.DV, i]
        state[rows.ACCELERATION, i] = scratch[momentum.A1, i]
        advance(law_parameters, law_state, i, 0, u - linear_terms[rows.LINK, i] * below)
        below = u


@outlined
def _arrive(frozen, linear_terms, law_parameters, state, law_state, scratch):
    """Update the state after a step or a substep; with `frozen`, linear stories stay on their
    branches.

    The function is not inlined and not used if all stories are linear, because this would increase
    their run time by 20 to 50 percent.
    """
    below = 0.0
    for i in range(linear_terms.shape[1] - 1):
        u = state[rows.DISPLACEMENT, i] + scratch[momentum.DU, i]
        state[rows.DISPLACEMENT, i] = u
        state[rows.VELOCITY, i] += scratch[momentum.DV, i]
        state[rows.ACCELERATION, i] = scratch[momentum.A1, i]
        if frozen and law_state[rows.SLOPE, i] < math.inf:
            advance(law_parameters, law_state, i, 0, u - linear_terms[rows.LINK, i] * below)
        elif HAS_CURVED_LAW and frozen and scratch[ROW.KINK, i] != 0.0:
            # The inner point and the turn, in the order in which the motion comes to them
            second = int(scratch[ROW.BEFORE, i])
            first = rows.THIRD_TRIAL if second == rows.FIRST_TRIAL else rows.FIRST_TRIAL
            accumulate_dissipation(law_parameters, law_state, i, 0, first)
            accumulate_dissipation(law_parameters, law_state, i, first, second)
            commit(law_parameters, law_state, i, second, rows.SECOND_TRIAL)
        else:
            accumulate_dissipation(law_parameters, law_state, i, 0, rows.FIRST_TRIAL)
            commit(law_parameters, law_state, i, rows.FIRST_TRIAL, rows.SECOND_TRIAL)
        below = u


@outlined
def _look(scene, span, memory):
    """Raise the peaks by what the motion has at the end of a piece, and, unless it is fast, within
    it."""
    state, law_state, scratch, _ = memory
    turned = 0
    if not span.fast:
        passage = Passage(scratch, ROW.PIECE, state, state, rows.ACCELERATION)
        turned = find_interstep_peaks(
            span, scene, passage, law_state, scratch, ROW.TURNS, scratch, ROW.PEAKS
        )
    moved = 0.0
    for i in range(scene.linear_terms.shape[1] - 2, -1, -1):
        drift = law_state[rows.DRIFT, i]
        moved *= scene.linear_terms[rows.LINK, i + 1]
        moved += scene.linear_terms[rows.MASS, i] * (state[rows.ACCELERATION, i] + span.ground_1)
        if FORCES:
            for j in range(scene.forces.shape[0]):
                if scene.forces[j, rows.FLOOR] == i:
                    moved -= force_value(scene.forces, j, span.t)
        raise_peak(scratch, ROW.PEAKS + rows.PEAK_TOTAL_SHEAR, i, moved)
        raise_peak(scratch, ROW.PEAKS + rows.PEAK_DRIFT, i, drift)
        raise_peak(scratch, ROW.PEAKS + rows.PEAK_SHEAR, i, law_state[rows.FORCE, i])
        raise_peak(scratch, ROW.PEAKS + rows.PEAK_DISPLACEMENT, i, state[rows.DISPLACEMENT, i])
        raise_peak(scratch, ROW.PEAKS + rows.PEAK_VELOCITY, i, state[rows.VELOCITY, i])
        raise_peak(
            scratch,
            ROW.PEAKS + rows.PEAK_ACCELERATION,
            i,
            state[rows.ACCELERATION, i] + span.ground_1,
        )
        if turned > 0 and scratch[ROW.TURNS, i] != drift:
            restoring_force_outlined(
                scene.law_parameters, law_state, i, 0, rows.FIRST_TRIAL, scratch[ROW.TURNS, i]
            )
            raise_peak(
                scratch, ROW.PEAKS + rows.PEAK_SHEAR, i, law_state[rows.FIRST_TRIAL + rows.FORCE, i]
            )


@outlined
def _save(state, law_state, scratch, n):
    """Keep what a step begins with."""
    for i in range(n):
        for row in range(3):
            scratch[ROW.SAVED + row, i] = state[row, i]
        for row in range(rows.LAW_STATE_ROWS):
            scratch[ROW.SAVED + 3 + row, i] = law_state[row, i]
    if law_state.shape[0] > rows.EXTRA_ROWS:
        for i in range(n):
            copy_extra_rows(law_state, i, 0, rows.THIRD_TRIAL)


@outlined
def _restore(state, law_state, scratch, n):
    """Give up a step: what peaks it had within its pieces are none."""
    for i in range(n):
        for row in range(2 * rows.PEAK_ROWS):
            scratch[ROW.PEAKS + row, i] = 0.0
        for row in range(3):
            state[row, i] = scratch[ROW.SAVED + row, i]
        for row in range(rows.LAW_STATE_ROWS):
            law_state[row, i] = scratch[ROW.SAVED + 3 + row, i]
    if law_state.shape[0] > rows.EXTRA_ROWS:
        for i in range(n):
            copy_extra_rows(law_state, i, rows.THIRD_TRIAL, 0)


def coefficients(rho_inf: float) -> tuple[float, ...]:
    """Coefficients of the step for a spectral radius rho_inf at infinity.

    theta, alpha and beta make the linear step the Pade approximation that tends to rho_inf. Any
    inner point c would do for order 3: quadratics are integrated exactly by (w0, wc, w1), and uc is
    exact for quadratics. c runs from 1/3, where the step is Radau IIA for nonlinear laws too, to
    1/2, where it is Simpson's rule on the cubic Hermite interpolant.

    Measured on a hardening and a softening oscillator: at rho_inf = 1 Simpson's rule has a quarter
    of the error of the corrected trapezoidal rule with tangents at the ends; below 1 the choice of
    c matters by a few percent, and the inner point of the cubic Hermite interpolant, c = 1 / (1 +
    rho_inf), degenerates towards rho_inf = 0.
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
        theta / 2.0,
        math.sqrt(beta - theta * theta / 4.0),
    )


FAMILY = Family(
    "impulse4",
    step,
    lambda modes: FACTORS + 2 * factor_rows(modes),
    memory=(rows.DISPLACEMENT, rows.VELOCITY),
)

METHODS = (
    Method(
        name="impulse4",
        family=FAMILY,
        parameters=(Parameter("rho_inf", 1.0, 0.0, 1.0),),
        coefficients=coefficients,
        order=lambda rho_inf: 4 if rho_inf == 1.0 else 3,
        rho_inf=lambda rho_inf: rho_inf,
        source="tdint: the impulse-momentum method of 2022 with exact impulses; rho_inf = 0 is "
        "Radau IIA (Ehle 1969)",
    ),
)
