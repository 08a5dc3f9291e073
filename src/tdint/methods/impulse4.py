"""Method impulse4: the impulse-momentum step of order 4 with controllable numerical dissipation.

The equations of a step of length h, with the state u0, v0, a0 at its start and u1, v1, a1 at its
end, the floor masses M, the damping matrix C, the restoring forces f and the loads p, are

    kinematics  u1 - u0 = h ((1 - th) v0 + th v1) + h^2 (al a0 - be a1)
    momentum    M (v1 - v0) + C (u1 - u0) + S = I
    equilibrium M a1 + C v1 + f(u1) = p1

I is the exact impulse of the load. S is the impulse of the restoring force,

    S = h (w0 f(u0) + wc f(uc) + w1 f(u1)),   uc = u0 + gd (u1 - u0) + h (g0 v0 + g1 v1)

where uc is the displacement at an inner point, at the fraction c of the step. The impulse of
power-law dashpots has the same weights, with the velocity vc of the cubic Hermite interpolant. The
coefficients th, al, be, w, g and c depend on the spectral radius rho_inf at infinite frequency
(function `coefficients`). In a linear building, the step is a Pade approximation of the matrix
exponential: (2,2) with order 4 for rho_inf = 1; (1,2), which is Radau IIA, for rho_inf = 0. The
order is 3 for rho_inf < 1.

A step is divided into substeps at the branch changes of piecewise-linear hysteretic laws. The
equations are solved in `tdint.kernels.equations.impulse4`.
"""

from __future__ import annotations

import math

from tdint.kernels import layout as rows
from tdint.kernels.compiling import FULL, copy_rows_within, inline, outlined
from tdint.kernels.equations import impulse_momentum as momentum
from tdint.kernels.equations.impulse4 import (
    FACTORS,
    ROW,
    accelerate,
    factor_rows,
    keep_negligible_kinks,
    newton,
    solve_linear,
    store_load,
)
from tdint.kernels.equations.iteration import add_rows, copy_rows
from tdint.kernels.laws.branch_following import copy_extra_rows
from tdint.kernels.laws.selection import elements_of
from tdint.kernels.linear_terms import (
    above,
    below,
    finite,
    force_value,
    has_dashpot,
    has_inerters,
    inerter_force,
    is_tree,
    story_value,
    tie,
)
from tdint.kernels.located_peaks import raise_located_peaks, raise_peaks_at
from tdint.kernels.peaks_between_steps import (
    ends_of_story,
    explains_velocities,
    find_interstep_peaks,
    keep_corner,
    raise_peak,
    zero_of_rate,
)
from tdint.kernels.step_interpolant import quintic_motion
from tdint.kernels.stepping import Located, Passage, Span, step_kernel
from tdint.kernels.stories.brace import add_reported_accelerations, commit_brace
from tdint.kernels.stories.branches import (
    NONE,
    advance,
    advance_law,
    advance_outlined,
    column_of_event,
    first_event,
    sum_branches,
    switch,
    synchronize,
)
from tdint.kernels.stories.impact import damping_slope, start_impact
from tdint.kernels.stories.law_state import (
    accumulate_dissipation,
    commit,
    raise_element_peaks,
    restoring_force_outlined,
    resume,
    step_start,
    store_step_start,
    tangent_in_motion,
)
from tdint.methods.method import SIMPSON_MEAN, Family, Method, Parameter

# Rows for `first_event`
_EVENT_ROWS = (momentum.U1, momentum.V1, ROW.KINK)
# Fraction of the path of the story drift in the substep. A substep reaches its branch change if the
# drift at its end differs from the limit of the branch by no more than this tolerance.
_LOCATION_TOLERANCE = 0.1
# Tolerance of a curved branch in a building whose laws can fracture, divided by the drift. It is
# less than the distance beyond the fracture up to which a path keeps its force (`laws.fracture`).
_FRACTURE_LOCATION = 5e-7
# Fraction of the force of an elastic story at this drift. The tolerance of a located branch change
# causes smaller changes of the force than a law that breaks.
_JUMP = 5e-3

# Results of `_compare_with_event`
_BEFORE_EVENT = -1.0
_BEYOND_EVENT = 1.0
# Fraction of the drift. A smaller movement against the direction of a branch is attributed to
# rounding and to the error of the interpolant, and does not count as a reversal.
_REVERSAL_TOLERANCE = 1e-6
# Fraction of the time step. A branch change closer to the start of a substep is applied at the
# start, because a shorter substep would be lost in rounding.
_IMMEDIATE = 1e-9


@step_kernel
def step(coefficients, scene, h, load, memory):
    """Integrate the equations of motion over one time step of impulse4.

    If some laws have branches, the step is divided into substeps at the branch changes. Otherwise,
    and if the division fails (too many branch changes, or no convergence), Newton's method solves
    the complete step. The result, the number of linear solutions, does not count solutions of a
    division that failed.

    If the step is divided, STEP_PEAKS of `step_status` receives the row of the peaks in the scratch
    array.
    """
    linear_terms, _, law_parameters, _, flags = scene
    state, law_state, scratch, step_status = memory
    n = linear_terms.shape[1] - 1
    if flags[rows.BRANCHES] != rows.NO_BRANCHES:
        code = _take_substeps(coefficients, scene, h, load, memory)
        if code != rows.NOT_CONVERGED:
            return code
    # Newton's method does not follow branches.
    step_status[rows.STEP_PEAKS] = 0.0
    ground = load[rows.GROUND_0], load[rows.GROUND_1]
    store_load(scene, load[rows.TIME], h, ground, scratch)
    # Stories may change their branches (`keep_branches` is False), and rows DU and DV contain no
    # first estimate (`has_guess`).
    code = newton(False, False, coefficients, scene, h, memory, FACTORS)
    if code < 0:
        return code
    # `keep_negligible_kinks` is called for its measure of the step errors in row RUN_MAXIMA, from
    # which `newton` derives its tolerance in the next steps. The measure is computed from the
    # accelerations at the start in `state`, so the call must precede `_update_state`. The other
    # effect, a decision about reversals in row KINK, is computed again before it is used.
    keep_negligible_kinks(scene, h, memory)
    if FULL and flags[rows.HAS_BRACES] != 0.0:
        _commit_braces(linear_terms, h, state, scratch)
    if FULL and flags[rows.HAS_TANGENT_DAMPING] != 0.0:
        _commit_tangent_damping(linear_terms, state, scratch)
    _update_state(False, linear_terms, law_parameters, state, law_state, scratch)
    # The division into substeps failed. Newton's method does not update the branches of the laws.
    if flags[rows.BRANCHES] != rows.NO_BRANCHES:
        for i in range(n):
            was_open = law_state[rows.SLOPE, i] < math.inf
            resume(law_parameters, law_state, i)
            if FULL and was_open and linear_terms[rows.TANGENT_DAMPING, i] != 0.0:
                rate = story_value(linear_terms, state, rows.VELOCITY, i)
                start_impact(law_parameters, law_state, i, rate)
    return code if finite(state, n) else rows.NOT_FINITE


@outlined
def _take_substeps(coefficients, scene, h, load, memory):
    """Take one time step as a sequence of substeps between the branch changes of the laws.

    An event is the change of a story to another branch of its law. The first event of a substep is
    located on the cubic Hermite interpolant of the drifts, and the equations are solved again for a
    substep that ends at that point. Reversals of curved laws with a negligible effect
    (`keep_negligible_kinks`) are not located.

    The interpolant is inaccurate in large steps. The drift at the end of a substep may therefore
    differ from the limit of the branch (`_compare_with_event`). If the drift has not reached the
    limit, the substep is accepted, and the search continues from its end. If the drift exceeds the
    limit by more than a tolerance, the search is repeated on the interpolant of the substep.

    The result is NOT_CONVERGED, with the initial state, if Newton's method fails or if more than 20
    + 4 n branch changes are located in a building with n stories and elements; repeated locations
    of the same change are counted.
    """
    linear_terms, modal, law_parameters, _, flags = scene
    state, law_state, scratch, step_status = memory
    n = linear_terms.shape[1] - 1
    is_piecewise_linear = flags[rows.BRANCHES] == rows.ALL_BRANCHES
    ground_rate = (load[rows.GROUND_1] - load[rows.GROUND_0]) / h
    max_substeps = 20 + 4 * (law_state.shape[1] - 1)
    elapsed = 0.0  # completed part of the time step, s
    substep = h  # length of the present substep, s
    located_changes = 0  # located branch changes, including repeated locations of the same change
    branch_changes = 0  # applied branch changes
    solves = 0
    # True if rows DU and DV contain the first estimate of Newton's method. From the first shortened
    # substep on, the rows always contain a complete or partial earlier solution.
    has_guess = False
    # True if rows REMAINING contain the changes DU and DV from the start of the substep to the end
    # of the time step; only for Newton's method, because linear solutions need no estimate
    is_shortened = False
    ends_at_event = False  # True if the substep ends at the located branch change of `story`
    story = -1  # story of the located branch change
    column = -1  # column of the law that changes its branch: the story or one of its elements
    event = rows.REVERSED  # its type: the drift is ABOVE or BELOW the branch, or has REVERSED
    while True:
        # Complete time steps have a separate factorization, which is reused in the next step.
        factors = FACTORS if substep == h else FACTORS + factor_rows(modal.shape[0])
        ground = load[rows.GROUND_0] + ground_rate * elapsed
        grounds = ground, ground + ground_rate * substep
        store_load(scene, load[rows.TIME] + elapsed, substep, grounds, scratch)
        code = _solve_substep(has_guess, coefficients, scene, substep, memory, factors)
        if code < 0:
            if located_changes > 0:
                _restore_start(flags, state, law_state, scratch, n)
            return code
        solves += code
        if ends_at_event and event == rows.REVERSED:
            # The reversal is at the end, not within the substep.
            scratch[ROW.KINK, story] = 0.0
        if flags[rows.LINEAR] == 0.0:
            outcome = (
                _compare_with_event(scene, substep, state, law_state, scratch, story, event)
                if ends_at_event
                else _BEYOND_EVENT
            )
            if outcome == _BEYOND_EVENT:
                ends_at_event = False
                fraction, story, event = first_event(linear_terms, substep, memory, _EVENT_ROWS)
                if fraction != NONE:
                    column = column_of_event(law_parameters, law_state, story, event)
                    if located_changes == 0:
                        _save_start(state, law_state, scratch, n)
                    located_changes += 1
                    if located_changes > max_substeps:
                        _restore_start(flags, state, law_state, scratch, n)
                        return rows.NOT_CONVERGED
                    if fraction * substep > _IMMEDIATE * h:
                        if not is_piecewise_linear:
                            # The part of the present solution up to the branch change is the first
                            # estimate. The complete increments are kept for the rest of the step.
                            if not is_shortened:
                                copy_rows_within(scratch, momentum.DU, ROW.REMAINING, 2)
                            _shorten_increments(fraction, substep, state, scratch, n)
                            has_guess = is_shortened = True
                        substep *= fraction
                        ends_at_event = True
                    else:
                        # Change the branch at the start, without a substep, and solve again for the
                        # remaining step.
                        if _change_branch(scene, memory, story, column, event):
                            t = load[rows.TIME] + elapsed
                            _raise_peaks_after_jump(scene, t, ground, memory)
                        branch_changes += 1
                        substep = h - elapsed
                        if is_shortened:
                            copy_rows_within(scratch, ROW.REMAINING, momentum.DU, 2)
                            is_shortened = False
                    continue
            elif outcome == _BEFORE_EVENT:
                ends_at_event = False
        span = Span(
            load[rows.TIME] + elapsed + substep,
            substep,
            ground,
            ground + ground_rate * substep,
            False,  # on_path: the displacements are not parabolas of time
            flags[rows.UNRESOLVED_MODES] != 0.0,  # fast
            False,  # cornered: accelerations within the substep are not yet searched for peaks
            False,  # kinked: the forces of the substep are lines
        )
        # REVERSED has no limit of the drift.
        end_event = event if ends_at_event else rows.REVERSED
        _accept_substep(located_changes > 0, story, column, end_event, scene, span, memory)
        if is_shortened:
            # The remaining motion is the first estimate of the next substep.
            add_rows(-1.0, scratch, momentum.DU, ROW.REMAINING, 2, n)
            copy_rows_within(scratch, ROW.REMAINING, momentum.DU, 2)
            is_shortened = False
        elapsed += substep
        if ends_at_event:
            if _change_branch(scene, memory, story, column, event):
                _raise_peaks_after_jump(scene, span.t, span.ground_1, memory)
            branch_changes += 1
            ends_at_event = False
        substep = h - elapsed
        if substep <= _IMMEDIATE * h:
            break
    if located_changes > 0:
        branch_changes += _change_exceeded_branches(scene, memory)
    step_status[rows.BRANCH_CHANGES] += branch_changes
    return solves if finite(state, n) else rows.NOT_FINITE


@inline
def _solve_substep(has_guess, coefficients, scene, h, memory, factors):
    """Compute the response over a substep in which all stories remain on their branches.

    If all laws are linear on their branches and there are no power-law dashpots (flag
    ALL_BRANCHES), a single linear solution is exact. After Newton's method, reversals with a
    negligible effect are marked in row KINK, so that the substep is not divided at these reversals.
    """
    code = 1
    if scene.flags[rows.BRANCHES] == rows.ALL_BRANCHES:
        solve_linear(coefficients, scene, h, memory, factors)
    else:
        code = newton(True, has_guess, coefficients, scene, h, memory, factors)
        if code >= 0:
            keep_negligible_kinks(scene, h, memory)
    return code


@inline
def _accept_substep(is_divided, story, column, event, scene, span, memory):
    """Move state and law states to the end of a substep, and update the peaks of a divided step.

    `event` is ABOVE or BELOW if the drift of `story` reaches a limit of the branch of the law in
    `column` at the end of the substep, otherwise REVERSED. The observer processes only the end of
    the time step; the peaks in the substeps of a divided step are therefore updated in rows PEAKS
    of the scratch array. STEP_PEAKS of the status receives the number of the first row. The
    observer merges rows PEAKS into the peaks of the run, and then resets the element to 0. After
    the merge, rows PEAKS are a copy of the peaks of the run. A function that resets the peaks of
    the run also resets the copy (`Family.step_peaks`).
    """
    linear_terms, _, law_parameters, _, flags = scene
    state, law_state, scratch, step_status = memory
    if is_divided:
        n = linear_terms.shape[1] - 1
        copy_rows(state, rows.DISPLACEMENT, scratch, ROW.SUBSTEP_START, 3, n)
        store_step_start(flags, law_state)
        if FULL and flags[rows.HAS_DAMPER_STATE] != 0.0:
            add_reported_accelerations(linear_terms, state, scratch, ROW.SUBSTEP_START + 2)
    if flags[rows.BRANCHES] == rows.ALL_BRANCHES:
        _advance_on_branches(linear_terms, law_parameters, state, law_state, scratch)
    else:
        if FULL and flags[rows.HAS_BRACES] != 0.0:
            _commit_braces(linear_terms, span.h, state, scratch)
        if FULL and flags[rows.HAS_TANGENT_DAMPING] != 0.0:
            _commit_tangent_damping(linear_terms, state, scratch)
        _update_state(True, linear_terms, law_parameters, state, law_state, scratch)
    if is_divided:
        _store_end_forces(story, column, event, linear_terms, law_parameters, memory)
        _update_substep_peaks(scene, span, memory)
        step_status[rows.STEP_PEAKS] = ROW.PEAKS


@outlined
def _shorten_increments(fraction, h, state, scratch, n):
    """Replace the increments over a substep by the increments over its first part `fraction`, on
    the cubic Hermite polynomial of displacement and velocity.

    The result is the first estimate of Newton's method for the shortened substep.
    """
    remaining = 1.0 - fraction
    for i in range(n):
        du = scratch[momentum.DU, i]
        v0 = state[rows.VELOCITY, i]
        v1 = v0 + scratch[momentum.DV, i]
        scratch[momentum.DU, i] = fraction * fraction * (3.0 - 2.0 * fraction) * du
        scratch[momentum.DU, i] += fraction * remaining * h * (remaining * v0 - fraction * v1)
        scratch[momentum.DV, i] = 6.0 * fraction * remaining * du / h
        scratch[momentum.DV, i] += remaining * (1.0 - 3.0 * fraction) * v0
        scratch[momentum.DV, i] += fraction * (3.0 * fraction - 2.0) * v1 - v0


@outlined
def _change_branch(scene, memory, story, column, event):
    """Change the branch of the law in one column at a located event: ABOVE, BELOW or REVERSED.

    Because of rounding and the error of the interpolant, the drift may be slightly before the
    limit. The same event would then be located again. Therefore, the law is moved to the limit,
    changes its branch at this limit, and returns to the actual drift.

    The force of the story may change by a jump J, for example because the story fails. Equilibrium
    then changes the acceleration of the floor above by -J / m and the acceleration of the floor
    below by J / m, with the mass m of each floor.

    `column` is the story or the element with the branch that ends. At a reversal of a story with
    elements, it is the story, and all elements with its direction change their branches.

    The result is True if the force has jumped: a law has lost a part of it, or tangent damping or
    the dashpot of a contact starts or ends.
    """
    linear_terms, law_parameters = scene.linear_terms, scene.law_parameters
    state, law_state, _, _ = memory
    force = law_state[rows.FORCE, story]
    if FULL and law_parameters[rows.CODE, story] <= rows.ELEMENTS:
        _change_branches_of_elements(law_parameters, law_state, story, column, event)
    else:
        _leave_branch(law_parameters, law_state, story, event)
    jump = law_state[rows.FORCE, story] - force
    elastic = law_parameters[rows.STIFFNESS, story] * law_state[rows.DRIFT, story]
    has_jumped = abs(jump) > _JUMP * abs(elastic)
    # The force of tangent damping changes with the stiffness, also at the end of a loop of a curved
    # law.
    if FULL and linear_terms[rows.TANGENT_DAMPING, story] != 0.0:
        rate = story_value(linear_terms, state, rows.VELOCITY, story)
        slope = law_state[rows.SLOPE, story]
        if slope == math.inf:
            slope = tangent_in_motion(law_parameters, law_state, story, rate)
        start_impact(law_parameters, law_state, story, rate)
        slope = damping_slope(law_parameters, law_state, story, rows.COMMITTED, slope)
        damping_force = linear_terms[rows.TANGENT_DAMPING, story] * rate * slope
        damping_jump = damping_force - state[rows.DAMPING_FORCE, story]
        has_jumped |= abs(damping_jump) > _JUMP * abs(law_state[rows.FORCE, story] + damping_force)
        jump += damping_jump
        state[rows.DAMPING_FORCE, story] = damping_force
    if jump != 0.0:
        accelerate(linear_terms, state, rows.ACCELERATION, story, -jump, memory.scratch)
        tie(linear_terms, state, rows.ACCELERATION)
    return has_jumped


@outlined
def _change_branches_of_elements(law_parameters, law_state, story, column, event):
    """Change the branches of the elements of a story at an event.

    Several elements can have the same limit, for example equal devices; they change their branches
    together. An element that still has the opposite direction, because the reversal was within the
    tolerances, reverses first.
    """
    synchronize(law_parameters, law_state, story, 0)
    direction = law_state[rows.RATE_SIGN, story]
    row = rows.UPPER if event == rows.ABOVE else rows.LOWER
    limit = law_state[row, column]
    is_linear = law_state[rows.SLOPE, column] < math.inf
    for element in elements_of(law_parameters, story):
        rate_sign = law_state[rows.RATE_SIGN, element]
        if event == rows.REVERSED:
            if rate_sign == direction:
                _leave_branch(law_parameters, law_state, element, event)
        elif element == column or (is_linear and law_state[row, element] == limit):
            _leave_branch(law_parameters, law_state, element, event)
        elif rate_sign * event < 0.0:
            _leave_branch(law_parameters, law_state, element, rows.REVERSED)
    sum_branches(law_parameters, law_state, story, 0)


@outlined
def _leave_branch(law_parameters, law_state, story, event):
    """Move the law in column `story` to the end of its branch, change the branch, and return to the
    drift.
    """
    drift = law_state[rows.DRIFT, story]
    # A reversal has no limit. A curved branch has the slope inf, and its state is not moved.
    if event == rows.REVERSED or not law_state[rows.SLOPE, story] < math.inf:
        switch(law_parameters, law_state, story, 0, event)
    else:
        limit = law_state[rows.UPPER if event == rows.ABOVE else rows.LOWER, story]
        advance_outlined(law_parameters, law_state, story, 0, limit)
        switch(law_parameters, law_state, story, 0, event)
        if law_state[rows.SLOPE, story] < math.inf:
            advance_outlined(law_parameters, law_state, story, 0, drift)
        else:
            # Only a law of a plug-in has linear and curved branches.
            restoring_force_outlined(law_parameters, law_state, story, 0, rows.FIRST_TRIAL, drift)
            commit(law_parameters, law_state, story, 0, rows.FIRST_TRIAL)


@outlined
def _change_exceeded_branches(scene, memory):
    """Change the branch of each story whose drift exceeds a limit at the end of a divided step;
    return the number of changes.

    A substep that ends at the branch change of one story can exceed the limit of another story,
    within the tolerance of `_compare_with_event`. The next substep changes the branch of the other
    story at its start. After the last substep of a step this function changes it, because the
    observer reports the force at the end of the step.
    """
    law_state, count = memory.law_state, 0
    for i in range(scene.linear_terms.shape[1] - 1):
        drift = law_state[rows.DRIFT, i]
        is_above = drift > law_state[rows.UPPER, i]
        if is_above or drift < law_state[rows.LOWER, i]:
            event = rows.ABOVE if is_above else rows.BELOW
            column = column_of_event(scene.law_parameters, law_state, i, event)
            _change_branch(scene, memory, i, column, event)
            count += 1
    return count


@outlined
def _compare_with_event(scene, h, state, law_state, scratch, story, event):
    """Compare the drifts at the end of a substep with the branch change for which it was shortened.

    The tolerance of each story is _LOCATION_TOLERANCE times the length of the path of its drift in
    the substep. The result is one of

        _BEYOND_EVENT the drift of a story is outside its branch by more than the tolerance, or its
                        net change is opposite to the direction of its branch and this reversal is
                        not accepted (row KINK)
        _BEFORE_EVENT   `story` has not reached the limit ABOVE or BELOW within the tolerance
        0               the substep ends at the branch change

    A reversal with a net change in the direction of the branch is not tested here: if the drift
    rate at the end still has the opposite sign, the next search locates a reversal at the end of
    the substep.
    """
    linear_terms, _, _, _, flags = scene
    has_fractures = FULL and flags[rows.CAN_FRACTURE] != 0.0
    outcome = 0.0
    for i in range(linear_terms.shape[1] - 1):
        drift = story_value(linear_terms, scratch, momentum.U1, i)
        drift_change = drift - law_state[rows.DRIFT, i]
        # If the drift reverses within the substep, its path is longer than its change.
        path_length = h * max(
            abs(story_value(linear_terms, state, rows.VELOCITY, i)),
            abs(story_value(linear_terms, scratch, momentum.V1, i)),
        )
        tolerance = _LOCATION_TOLERANCE * max(path_length, abs(drift_change))
        if has_fractures and not law_state[rows.SLOPE, i] < math.inf:
            tolerance = _FRACTURE_LOCATION * abs(drift)
        # A story with a net movement against its branch has a reversal in the substep.
        is_reversed = law_state[rows.RATE_SIGN, i] * drift_change < -_REVERSAL_TOLERANCE * (
            abs(drift) + abs(law_state[rows.DRIFT, i])
        )
        if is_reversed and scratch[ROW.KINK, i] == 0.0:
            return _BEYOND_EVENT
        if (
            drift > law_state[rows.UPPER, i] + tolerance
            or drift < law_state[rows.LOWER, i] - tolerance
        ):
            return _BEYOND_EVENT
        if i == story and (
            (event == rows.ABOVE and drift < law_state[rows.UPPER, i] - tolerance)
            or (event == rows.BELOW and drift > law_state[rows.LOWER, i] + tolerance)
        ):
            outcome = _BEFORE_EVENT
    return outcome


@inline
def _advance_on_branches(linear_terms, law_parameters, state, law_state, scratch):
    """Move state and law states to the end of a substep that was solved on linear branches."""
    u_below = 0.0
    for i in range(linear_terms.shape[1] - 1):
        u = state[rows.DISPLACEMENT, i] + scratch[momentum.DU, i]
        state[rows.DISPLACEMENT, i] = u
        state[rows.VELOCITY, i] += scratch[momentum.DV, i]
        state[rows.ACCELERATION, i] = scratch[momentum.A1, i]
        u_below = below(linear_terms, state, rows.DISPLACEMENT, i, u_below)
        advance(law_parameters, law_state, i, 0, u - linear_terms[rows.LINK, i] * u_below)
        u_below = u


@outlined
def _update_state(keep_branches, linear_terms, law_parameters, state, law_state, scratch):
    """Move state and law states to the end of a step or substep that Newton's method has solved.

    If `keep_branches` is True (substeps), laws on a linear branch remain on it. Otherwise row KINK
    contains values of an earlier solution. Buildings without curved laws use `_advance_on_branches`
    instead, because this function would increase their run time by 20 to 50 percent.
    """
    u_below = 0.0
    for i in range(linear_terms.shape[1] - 1):
        u = state[rows.DISPLACEMENT, i] + scratch[momentum.DU, i]
        state[rows.DISPLACEMENT, i] = u
        state[rows.VELOCITY, i] += scratch[momentum.DV, i]
        state[rows.ACCELERATION, i] = scratch[momentum.A1, i]
        u_below = below(linear_terms, state, rows.DISPLACEMENT, i, u_below)
        if keep_branches and law_state[rows.SLOPE, i] < math.inf:
            advance(law_parameters, law_state, i, 0, u - linear_terms[rows.LINK, i] * u_below)
        elif FULL and law_parameters[rows.CODE, i] < rows.ELEMENTS:
            drift = u - linear_terms[rows.LINK, i] * u_below
            _update_elements(keep_branches, law_parameters, law_state, scratch, i, drift)
        else:
            _commit_path(keep_branches, law_parameters, law_state, scratch, i, i)
        u_below = u


@inline
def _commit_path(keep_branches, law_parameters, law_state, scratch, story, column):
    """Commit the path of the law in `column`, a story or an element of `story`; see
    `_update_state`.
    """
    if keep_branches and scratch[ROW.KINK, story] != 0.0:
        # Accumulate the dissipated energy over the inner point and the reversal in chronological
        # order. Row PREVIOUS_BLOCK contains the block of the later state.
        second_block = int(scratch[ROW.PREVIOUS_BLOCK, story])
        first_block = rows.THIRD_TRIAL if second_block == rows.FIRST_TRIAL else rows.FIRST_TRIAL
        accumulate_dissipation(law_parameters, law_state, column, 0, first_block)
        accumulate_dissipation(law_parameters, law_state, column, first_block, second_block)
        commit(law_parameters, law_state, column, second_block, rows.SECOND_TRIAL)
    else:
        # The law was evaluated at the inner point (FIRST_TRIAL) and at the end (SECOND_TRIAL).
        accumulate_dissipation(law_parameters, law_state, column, 0, rows.FIRST_TRIAL)
        commit(law_parameters, law_state, column, rows.FIRST_TRIAL, rows.SECOND_TRIAL)


@outlined
def _update_elements(keep_branches, law_parameters, law_state, scratch, i, drift):
    """Move the elements of story `i` to the end of a step or substep, each as a law in
    `_update_state`, and sum their branches.
    """
    for element in elements_of(law_parameters, i):
        if keep_branches and law_state[rows.SLOPE, element] < math.inf:
            advance_law(law_parameters, law_state, element, 0, drift)
        else:
            _commit_path(keep_branches, law_parameters, law_state, scratch, i, element)
    law_state[rows.DRIFT, i] = drift
    sum_branches(law_parameters, law_state, i, 0)


@outlined
def _store_end_forces(story, column, event, linear_terms, law_parameters, memory):
    """Store the story forces and accelerations at the end of a substep for the peaks.

    The drift at the end can be outside the limit of a branch, or differ from the limit of the
    branch change at the end of the substep. The force of the committed state is on the old branch,
    and can exceed the strength of the story. The peaks use the force at the limit instead. The
    floor accelerations change by the difference of the forces divided by the mass. A curved branch,
    with the slope inf, is evaluated at the drift itself: its limit has already changed with its
    state.
    """
    state, law_state, scratch, _ = memory
    n = linear_terms.shape[1] - 1
    if FULL and has_inerters(linear_terms):  # a force accelerates all floors
        copy_rows(state, rows.ACCELERATION, scratch, ROW.END_ACCELERATION, 1, n)
    for i in range(n):
        drift = limited = law_state[rows.DRIFT, i]
        slope = law_state[rows.SLOPE, i]
        if FULL and law_parameters[rows.CODE, i] < rows.ELEMENTS:
            slope = _slope_of_linear_elements(law_parameters, law_state, i)
        if slope < math.inf:
            limited = min(max(drift, law_state[rows.LOWER, i]), law_state[rows.UPPER, i])
            if i == story and event != rows.REVERSED and law_state[rows.SLOPE, column] < math.inf:
                limited = law_state[rows.UPPER if event == rows.ABOVE else rows.LOWER, column]
        scratch[ROW.END_EXCESS, i] = drift - limited
        scratch[ROW.END_FORCE, i] = law_state[rows.FORCE, i]
        if not (FULL and has_inerters(linear_terms)):
            scratch[ROW.END_ACCELERATION, i] = state[rows.ACCELERATION, i]
        if limited != drift:
            excess = slope * (drift - limited)
            scratch[ROW.END_FORCE, i] -= excess
            accelerate(linear_terms, scratch, ROW.END_ACCELERATION, i, excess, scratch)


@outlined
def _slope_of_linear_elements(law_parameters, law_state, i):
    """Return the sum of the slopes of the elements of story `i` that are on linear branches, N/m.

    The limit of a story with curved elements is the limit of one of its linear branches.
    """
    slope = 0.0
    for element in elements_of(law_parameters, i):
        if law_state[rows.SLOPE, element] < math.inf:
            slope += law_state[rows.SLOPE, element]
    return slope


@outlined
def _commit_tangent_damping(linear_terms, state, scratch):
    """Store force and work of tangent damping at the end of a step or substep."""
    for i in range(linear_terms.shape[1] - 1):
        coefficient = linear_terms[rows.TANGENT_DAMPING, i]
        if coefficient != 0.0:
            rate = story_value(linear_terms, scratch, momentum.V1, i)
            state[rows.DAMPING_FORCE, i] = coefficient * scratch[ROW.DAMPING_SLOPE, i] * rate
            state[rows.DAMPING_WORK, i] += scratch[ROW.TANGENT_WORK, i]


@outlined
def _commit_braces(linear_terms, h, state, scratch):
    """Move all dampers with braces to the end of a step or substep of length `h`.

    `state` contains the velocities at its start, row V1 of the scratch array at its end.
    """
    for i in range(linear_terms.shape[1] - 1):
        if linear_terms[rows.BRACE, i] != 0.0:
            first_rate = story_value(linear_terms, state, rows.VELOCITY, i)
            last_rate = story_value(linear_terms, scratch, momentum.V1, i)
            rise = story_value(linear_terms, scratch, momentum.DU, i)
            rates = (first_rate, last_rate, last_rate, rise / h)
            commit_brace(linear_terms, i, h, rates, state, scratch, ROW.BRACE)


@outlined
def _update_substep_peaks(scene, span, memory):
    """Update the peaks with the response at the end of a substep and within the substep.

    The response between start and end is not used in a building with modes that the step does not
    resolve. Rows SUBSTEP_START contain the response at the start of the substep.
    """
    state, law_state, scratch, _ = memory
    # With stiff braces, the forces for the results give other accelerations than the state.
    if FULL and scene.flags[rows.HAS_DAMPER_STATE] != 0.0:
        add_reported_accelerations(scene.linear_terms, state, scratch, momentum.A1)
        add_reported_accelerations(scene.linear_terms, state, scratch, ROW.END_ACCELERATION)
    if not span.fast:
        # Row END_ACCELERATION would not agree with the velocities.
        passage = Passage(scratch, ROW.SUBSTEP_START, state, scratch, momentum.A1)
        located = Located(scratch, ROW.LOCATED, scratch, ROW.PEAKS)
        if find_interstep_peaks(span, scene, passage, law_state, located) > 0:
            previous = step_start(scene.flags)
            raise_located_peaks(scene, span, passage, law_state, previous, located)
    _raise_peaks_in_contact(scene, span, memory)
    _raise_floor_peaks(scene, span.t, span.ground_1, ROW.END_ACCELERATION, scratch)
    for i in range(scene.linear_terms.shape[1] - 1):
        drift = law_state[rows.DRIFT, i]
        raise_peak(scratch, ROW.PEAKS + rows.PEAK_DRIFT, i, drift)
        # The law is moved to the limit at the end of the substep, also if the drift is before it.
        raise_peak(scratch, ROW.PEAKS + rows.PEAK_DRIFT, i, drift - scratch[ROW.END_EXCESS, i])
        raise_peak(scratch, ROW.PEAKS + rows.PEAK_SHEAR, i, scratch[ROW.END_FORCE, i])
        raise_peak(scratch, ROW.PEAKS + rows.PEAK_DISPLACEMENT, i, state[rows.DISPLACEMENT, i])
        raise_peak(scratch, ROW.PEAKS + rows.PEAK_VELOCITY, i, state[rows.VELOCITY, i])
        if scene.flags[rows.HAS_DASHPOTS] != 0.0 and has_dashpot(scene.linear_terms, i):
            rate = story_value(scene.linear_terms, state, rows.VELOCITY, i)
            raise_peak(scratch, ROW.PEAKS + rows.PEAK_DRIFT_RATE, i, rate)
        if FULL and has_inerters(scene.linear_terms):
            force = inerter_force(scene.linear_terms, scratch, ROW.END_ACCELERATION, i)
            raise_peak(scratch, ROW.PEAKS + rows.PEAK_INERTER_FORCE, i, force)
        if FULL:
            acceleration = scratch[ROW.END_ACCELERATION, i] + span.ground_1
            keep_corner(scratch, ROW.PEAKS, i, acceleration, span.t)
        if FULL and scene.law_parameters[rows.CODE, i] <= rows.ELEMENTS:
            raise_element_peaks(
                scene.law_parameters, law_state, i, rows.COMMITTED, scratch[ROW.END_EXCESS, i]
            )


@outlined
def _raise_peaks_in_contact(scene, span, memory):
    """Raise the peaks due to contacts within a substep that does not resolve them.

    Such a spring reverses on a branch that is stiffer than initially. Its extremum is only a
    possible peak for `find_interstep_peaks`, because the accelerations at both ends, where the
    contact has no force, do not explain the change of velocity.
    """
    state, law_state, scratch, _ = memory
    linear_terms, law_parameters = scene.linear_terms, scene.law_parameters
    passage = Passage(scratch, ROW.SUBSTEP_START, state, scratch, ROW.END_ACCELERATION)
    located = Located(scratch, ROW.LOCATED, scratch, ROW.PEAKS)
    for i in range(linear_terms.shape[1] - 1):
        if law_state[rows.SLOPE, i] <= law_parameters[rows.STIFFNESS, i]:
            continue
        spring = ends_of_story(False, linear_terms, passage, law_state, i)
        if spring.v0 * spring.v1 < 0.0 and not explains_velocities(span.h, spring):
            s = zero_of_rate(span.h, spring)
            extremum = quintic_motion(span.h, spring, s)[0]
            restoring_force_outlined(
                law_parameters, law_state, i, rows.COMMITTED, rows.FIRST_TRIAL, extremum
            )
            raise_peak(scratch, ROW.PEAKS + rows.PEAK_DRIFT, i, extremum)
            force = law_state[rows.FIRST_TRIAL + rows.FORCE, i]
            raise_peak(scratch, ROW.PEAKS + rows.PEAK_SHEAR, i, force)
            resolved = Span(
                span.t, span.h, span.ground_0, span.ground_1, False, False, False, False
            )
            raise_peaks_at(scene, resolved, passage, law_state, step_start(scene.flags), s, located)


@outlined
def _raise_floor_peaks(scene, t, ground, row, scratch):
    """Update the peaks of the absolute accelerations and of the total shears with the relative
    accelerations in a scratch row, m/s^2."""
    total_shear = 0.0
    # `while` as in `tdint.kernels.time_loop.observer.observe`
    i = scene.linear_terms.shape[1] - 1
    while i > 0:
        i -= 1
        total_shear *= scene.linear_terms[rows.LINK, i + 1]
        if FULL and is_tree(scene.linear_terms):
            # The column of a link has no inertia.
            scratch[momentum.FORCE_S, i] = 0.0
            total_shear = above(scene.linear_terms, scratch, momentum.FORCE_S, i)
        total_shear += scene.linear_terms[rows.MASS, i] * (scratch[row, i] + ground)
        if FULL:
            for j in range(scene.forces.shape[0]):
                if scene.forces[j, rows.FLOOR] == i:
                    total_shear -= force_value(scene.forces, j, t)
        if FULL and is_tree(scene.linear_terms):
            scratch[momentum.FORCE_S, i] = total_shear
        raise_peak(scratch, ROW.PEAKS + rows.PEAK_TOTAL_SHEAR, i, total_shear)
        raise_peak(scratch, ROW.PEAKS + rows.PEAK_ACCELERATION, i, scratch[row, i] + ground)


@outlined
def _raise_peaks_after_jump(scene, t, ground, memory):
    """Update the peaks with the accelerations after a jump of the force of a law or its damping."""
    state, _, scratch, step_status = memory
    row = ROW.SUBSTEP_START + 2
    copy_rows(state, rows.ACCELERATION, scratch, row, 1, scene.linear_terms.shape[1] - 1)
    if FULL and scene.flags[rows.HAS_DAMPER_STATE] != 0.0:
        add_reported_accelerations(scene.linear_terms, state, scratch, row)
    _raise_floor_peaks(scene, t, ground, row, scratch)
    step_status[rows.STEP_PEAKS] = ROW.PEAKS


@outlined
def _save_start(state, law_state, scratch, n):
    """Store the state and the law states at the start of a time step for `_restore_start`.

    The three rows of the state are displacements, velocities and accelerations. The committed block
    of the law states starts at row 0.
    """
    laws = ROW.SAVED + 3
    columns = law_state.shape[1] if FULL else n
    copy_rows(state, rows.DISPLACEMENT, scratch, ROW.SAVED, 3, n)
    copy_rows(law_state, rows.COMMITTED, scratch, laws, rows.LAW_STATE_ROWS, columns)
    copy_rows(law_state, rows.PEAK_FORCE, scratch, laws + rows.LAW_STATE_ROWS, 1, columns)
    # Only the state of a building with braces or tangent damping has more than three rows.
    if FULL and state.shape[0] > rows.FIRST_OLDER:
        copy_rows(state, rows.FIRST_OLDER, scratch, ROW.SAVED_ADDED, rows.ADDED_STATE_ROWS, n)
    # EXTRA_ROWS is the number of the first extra row. The table contains this row only if a law of
    # the building needs extra rows.
    if law_state.shape[0] > rows.EXTRA_ROWS:
        for i in range(columns):
            copy_extra_rows(law_state, i, 0, rows.THIRD_TRIAL)


@outlined
def _restore_start(flags, state, law_state, scratch, n):
    """Return to the start of a time step that could not be divided into substeps (`_save_start`).

    Rows PEAKS are set to zero, because the substeps are discarded. The status of the step is not
    changed: `step` resets STEP_PEAKS.
    """
    for row in range(ROW.PEAKS, ROW.PEAKS + 2 * rows.PEAK_ROWS + 2):
        for i in range(n):
            scratch[row, i] = 0.0
    laws = ROW.SAVED + 3
    columns = law_state.shape[1] if FULL else n
    copy_rows(scratch, ROW.SAVED, state, rows.DISPLACEMENT, 3, n)
    copy_rows(scratch, laws, law_state, rows.COMMITTED, rows.LAW_STATE_ROWS, columns)
    copy_rows(scratch, laws + rows.LAW_STATE_ROWS, law_state, rows.PEAK_FORCE, 1, columns)
    if FULL and state.shape[0] > rows.FIRST_OLDER:
        copy_rows(scratch, ROW.SAVED_ADDED, state, rows.FIRST_OLDER, rows.ADDED_STATE_ROWS, n)
    if law_state.shape[0] > rows.EXTRA_ROWS:
        for i in range(columns):
            copy_extra_rows(law_state, i, rows.THIRD_TRIAL, 0)
    store_step_start(flags, law_state)


def coefficients(rho_inf: float) -> tuple[float, ...]:
    """Return the coefficients of the step for a spectral radius `rho_inf` at infinite frequency.

    theta = (2 + rho_inf) / (3 (1 + rho_inf)), alpha = 1/3 - theta/2 and beta = theta/2 - 1/6 make
    the step of a linear oscillator a Pade approximation. Its amplification tends to `rho_inf` in
    absolute value as the frequency tends to infinity.

    The quadrature with the weights (w0, wc, w1) at the fractions 0, c and 1 of the step is exact
    for quadratic polynomials of time. gd, g0 and g1 follow from the condition that the impulse of a
    linear force k u has the same form as the kinematics,

        w0 u0 + wc uc + w1 u1 = (1 - theta) u0 + theta u1 + h (alpha v0 - beta v1)

    uc is then exact for quadratic displacements, and the step has order 3 for any c. The value c =
    1 / (3 - rho_inf) is used. For rho_inf = 0 it is 1/3, and the step is Radau IIA also for
    nonlinear laws. For rho_inf = 1 it is 1/2, and the quadrature is Simpson's rule on the cubic
    Hermite interpolant.

    This quadrature was tested with a hardening and a softening oscillator. An alternative without
    an inner point is the corrected trapezoidal rule h/2 (f0 + f1) + h^2/12 (f0' - f1'), with time
    derivatives of f from the tangent stiffnesses at the endpoints. For rho_inf = 1, its error is
    four times the error of Simpson's rule. For rho_inf < 1, the choice of c changes the error by a
    few percent. For c = 1 / (1 + rho_inf), uc would be on the cubic Hermite interpolant, but wc
    tends to infinity as rho_inf tends to 0; this value is therefore not used.

    The last two values are real and imaginary part of l / h, where l is a root of l^2 - theta h l +
    beta h^2 = 0. `solve_linear` uses l to write the equations of a linear step as a single complex
    equation.
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
        # Displacement at the inner point: gd, g0 and g1
        (theta - weight_1) / weight_c,
        alpha / weight_c,
        -beta / weight_c,
        # Velocity at the inner point: factors of (u1 - u0) / h, v0 and v1
        6.0 * c * (1.0 - c),
        (1.0 - c) * (1.0 - 3.0 * c),
        c * (3.0 * c - 2.0),
        # Real and imaginary part of l / h
        theta / 2.0,
        math.sqrt(beta - theta * theta / 4.0),
    )


FAMILY = Family(
    "impulse4",
    step,
    lambda modes: FACTORS + 2 * factor_rows(modes),
    memory=(rows.DISPLACEMENT, rows.VELOCITY),
    mean_rule=SIMPSON_MEAN,
    step_peaks=ROW.PEAKS,
    devices=True,
    braced_devices=True,
    impact_damping=True,
    inertance=True,
)

METHODS = (
    Method(
        name="impulse4",
        family=FAMILY,
        parameters=(Parameter("rho_inf", 1.0, 0.0, 1.0),),
        coefficients=coefficients,
        order=lambda rho_inf: 4 if rho_inf == 1.0 else 3,
        rho_inf=lambda rho_inf: rho_inf,
        estimated_by="moment4",
        braces=True,
        tangent_damping=lambda *values: True,
        variants=("rho_inf=0.5", "rho_inf=0"),
        source="tdint: the impulse-momentum method of 2022 with exact impulses; rho_inf = 0 is "
        "Radau IIA (Ehle 1969)",
    ),
)
