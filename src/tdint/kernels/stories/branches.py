"""Branches of drift laws, and the first change of branch within a time step.

The force on a branch is a linear or curved function of the drift. The branch ends where the drift
exceeds its limits (LOWER, UPPER) or where the drift rate changes to the sign opposite to RATE_SIGN.
`switch` then sets the branch that follows. Within a step, the first change of branch is located on
the cubic Hermite interpolant of each drift.
"""

from __future__ import annotations

import math

from tdint.kernels import layout as rows
from tdint.kernels.compiling import FULL, inline, outlined
from tdint.kernels.laws.branch_following import advancing
from tdint.kernels.laws.selection import (
    advance_rows,
    elements_of,
    enter_branch,
    is_curved,
    switch_branch,
)
from tdint.kernels.linear_terms import below

NONE = 2.0
"""Fraction of the step that represents "no change of branch"; any value above 1."""

# Relative to the drifts at both endpoints. A branch ends only if the drift exceeds its limit by
# more than this tolerance, which covers rounding and the error of a located change of branch.
_LIMIT_TOLERANCE = 1e-9
# Fraction of the step. Maximum last correction of Newton's method; the remaining error is about the
# square of this value.
_ROOT_TOLERANCE = 1e-10
# Relative to the drifts at both endpoints of the step. A smaller movement against the direction of
# the branch is a rounding error and not a reversal.
_REVERSAL_TOLERANCE = 1e-12

advance_law = advancing(advance_rows)
"""(law_parameters, law_state, i, block, drift). Moves the state of the law in column `i`, a story
with one element or an element, to `drift` (m) on its current linear branch."""


@inline
def advance(law_parameters, law_state, i, block, drift):
    """Move the state of story `i` in a block to a drift on its current linear branch.

    The elements of a story with elements must all be on linear branches.
    """
    if FULL and law_parameters[rows.CODE, i] == rows.ELEMENTS:
        # The elements remain behind (`synchronize`).
        step = drift - law_state[block + rows.DRIFT, i]
        law_state[block + rows.FORCE, i] += law_state[block + rows.SLOPE, i] * step
        law_state[block + rows.DRIFT, i] = drift
    elif FULL and law_parameters[rows.CODE, i] < rows.ELEMENTS:
        _advance_elements(law_parameters, law_state, i, block, drift)
    else:
        advance_law(law_parameters, law_state, i, block, drift)


@outlined
def _advance_elements(law_parameters, law_state, i, block, drift):
    """Move all elements of story `i` to a drift on their linear branches; sum their forces."""
    force = 0.0
    for element in elements_of(law_parameters, i):
        advance_law(law_parameters, law_state, element, block, drift)
        force += law_state[block + rows.FORCE, element]
    law_state[block + rows.DRIFT, i] = drift
    law_state[block + rows.FORCE, i] = force


@outlined
def synchronize(law_parameters, law_state, i, block):
    """Move the elements of story `i` in a block to the drift of the story, on their branches.

    Only piecewise-linear elements of a story without curved elements can be at another drift. On a
    linear branch, the order of the drifts between does not affect force and energy.
    """
    drift = law_state[block + rows.DRIFT, i]
    for element in elements_of(law_parameters, i):
        if law_state[block + rows.DRIFT, element] != drift:
            advance_law(law_parameters, law_state, element, block, drift)


@outlined
def advance_outlined(law_parameters, law_state, i, block, drift):
    """Call `advance_law`. The function is compiled separately, for rare calls."""
    advance_law(law_parameters, law_state, i, block, drift)


@outlined
def enter(law_parameters, law_state, i):
    """Determine the branch of story `i` from its committed state.

    A default branch is set before the function `enter` of the law is called: it has the initial
    stiffness, or an infinite SLOPE as the mark of a curved law, no limits, and both directions.
    """
    if FULL and law_parameters[rows.CODE, i] <= rows.ELEMENTS:
        for element in elements_of(law_parameters, i):
            enter_law(law_parameters, law_state, element)
        sum_branches(law_parameters, law_state, i, 0)
    else:
        enter_law(law_parameters, law_state, i)


@inline
def enter_law(law_parameters, law_state, i):
    """Determine the branch of the law in column `i`, a story with a single element or an
    element.
    """
    law_state[rows.SLOPE, i] = (
        math.inf if is_curved(law_parameters, i) else law_parameters[rows.STIFFNESS, i]
    )
    law_state[rows.RATE_SIGN, i] = 0.0
    law_state[rows.UPPER, i] = math.inf
    law_state[rows.LOWER, i] = -math.inf
    enter_branch(law_parameters, law_state, i)


@outlined
def switch(law_parameters, law_state, i, block, event):
    """Set the branch that follows the current branch of the state in `block`.

    Parameters
    ----------
    event : float
        Reason for the end of the branch: ABOVE or BELOW (the drift exceeds the upper limit or falls
        below the lower limit) or REVERSED (the drift rate changes its sign).
    """
    switch_branch(law_parameters, law_state, i, block, event)


# ---- Stories with several elements. The branch of the story is the sum of the branches of its
# elements. It ends where the first of these branches ends.


@outlined
def sum_branches(law_parameters, law_state, i, block):
    """Set force and branch of story `i` in a block to the sum of the states of its elements.

    The branch is curved (infinite SLOPE) if an element is on a curved branch. INTERNAL is 1 if all
    elements have failed, otherwise 0. If a movement within the tolerances of a reversal has left
    the elements with different directions, the story has the direction of a linear branch: a change
    of stiffness at a reversal must be located, but a curved branch follows its path in any
    case.
    """
    force = 0.0
    slope = 0.0
    upper = math.inf
    lower = -math.inf
    direction = 0.0
    failed = 1.0
    for element in elements_of(law_parameters, i):
        force += law_state[block + rows.FORCE, element]
        slope += law_state[block + rows.SLOPE, element]
        upper = min(upper, law_state[block + rows.UPPER, element])
        lower = max(lower, law_state[block + rows.LOWER, element])
        rate_sign = law_state[block + rows.RATE_SIGN, element]
        is_linear = law_state[block + rows.SLOPE, element] < math.inf
        if rate_sign != 0.0 and (direction == 0.0 or is_linear):
            direction = rate_sign
        has_failed = (
            law_state[block + rows.INTERNAL, element] == law_state[rows.FAILED_INTERNAL, element]
        )
        if not has_failed:
            failed = 0.0
    law_state[block + rows.FORCE, i] = force
    law_state[block + rows.INTERNAL, i] = failed
    law_state[block + rows.SLOPE, i] = slope
    law_state[block + rows.UPPER, i] = upper
    law_state[block + rows.LOWER, i] = lower
    law_state[block + rows.RATE_SIGN, i] = direction
    law_state[block + rows.BRANCH_OFFSET, i] = 0.0


@outlined
def turns_at_reversal(law_parameters, law_state, i):
    """Return True if a linear branch of an element of story `i` ends at a reversal."""
    turns = False
    for element in elements_of(law_parameters, i):
        turns |= (law_state[rows.SLOPE, element] < math.inf) & (
            law_state[rows.RATE_SIGN, element] != 0.0
        )
    return turns


@inline
def column_of_event(law_parameters, law_state, i, event):
    """Return the column of the law whose branch ends at the event `event` of story `i`.

    It is an element, or the story for a story with a single element. At a reversal, the
    branches of several elements can end, and the result is the story. The branches must not have
    changed since the event was located.
    """
    if FULL and law_parameters[rows.CODE, i] <= rows.ELEMENTS:
        return _element_of_event(law_parameters, law_state, i, event)
    return i


@outlined
def _element_of_event(law_parameters, law_state, i, event):
    """Return the first element of story `i` with the limit of its branch, or `i` at a reversal."""
    row = rows.UPPER if event == rows.ABOVE else rows.LOWER
    if event != rows.REVERSED:
        for element in elements_of(law_parameters, i):
            # The limit of the story is a copy of the limit of the element.
            if law_state[row, element] == law_state[row, i]:
                return element
    return i


# ---- First change of branch within a time step


@outlined
def first_event(linear_terms, h, memory, step_rows):
    """Locate the first change of branch of any story within a step: time as a fraction of the step,
    story and event (ABOVE, BELOW or REVERSED); (NONE, -1, REVERSED) without a change.

    The drift of each story within the step, d(s) with s from 0 to 1, is the cubic Hermite
    interpolant of the drifts d0, d3 and of h times the drift rates, w0, w1, at both endpoints, with
    the Bezier points d0, d1 = d0 + w0 / 3, d2 = d3 - w1 / 3 and d3.

    Rounding errors relative to |d0| + |d3| are tolerated. The start of the step is often the last
    branch change, which is located with a small error. Two deviations at the start are therefore no
    branch change:

    - The drift exceeds a limit and only moves back.
    - The drift rate has the sign opposite to RATE_SIGN, but the points d1, d2 and d3 follow each
      other in the direction of RATE_SIGN.

    `step_rows` are the rows of `scratch` with displacements and velocities at the end of the step,
    and the row that is not 0 for stories with reversals that are ignored.
    """
    state, law_state, scratch, _ = memory
    u1, v1, ignored = step_rows
    first_fraction = NONE
    story = -1
    event = rows.REVERSED
    v_below = 0.0
    u1_below = 0.0
    v1_below = 0.0
    for i in range(linear_terms.shape[1] - 1):
        link = linear_terms[rows.LINK, i]
        v_below = below(linear_terms, state, rows.VELOCITY, i, v_below)
        u1_below = below(linear_terms, scratch, u1, i, u1_below)
        v1_below = below(linear_terms, scratch, v1, i, v1_below)
        d0 = law_state[rows.DRIFT, i]
        w0 = h * (state[rows.VELOCITY, i] - link * v_below)
        d3 = scratch[u1, i] - link * u1_below
        w1 = h * (scratch[v1, i] - link * v1_below)
        v_below = state[rows.VELOCITY, i]
        u1_below = scratch[u1, i]
        v1_below = scratch[v1, i]
        # The drift is always between the minimum and the maximum of its Bezier points. The tests
        # omit d0: a drift that exceeds a limit at the start only matters if it moves further, and
        # d1 then also exceeds the limit.
        d1 = d0 + w0 / 3.0
        d2 = d3 - w1 / 3.0
        tolerance = _LIMIT_TOLERANCE * (abs(d0) + abs(d3))
        upper = law_state[rows.UPPER, i]
        lower = law_state[rows.LOWER, i]
        if max(d1, d2, d3) > upper + tolerance:
            fraction = _crossing((d0, d1, d2, d3), upper, tolerance, first_fraction)
            if fraction < first_fraction:
                first_fraction, story, event = fraction, i, rows.ABOVE
        if min(d1, d2, d3) < lower - tolerance:
            # Falling below the lower limit is exceeding a limit after a change of sign.
            fraction = _crossing((-d0, -d1, -d2, -d3), -lower, tolerance, first_fraction)
            if fraction < first_fraction:
                first_fraction, story, event = fraction, i, rows.BELOW
        rate_sign = law_state[rows.RATE_SIGN, i]
        # The tolerance of a reversal is _REVERSAL_TOLERANCE times the same sum of drifts, m.
        tolerance = _REVERSAL_TOLERANCE / _LIMIT_TOLERANCE * tolerance
        # The differences of the Bezier points, times 3, are the Bezier points of the drift rate.
        # The rate at the start, d1 - d0, is not tested, because the location of the last reversal
        # is not exact.
        if (
            rate_sign != 0.0
            and scratch[ignored, i] == 0.0
            and (rate_sign * (d2 - d1) < -tolerance or rate_sign * (d3 - d2) < -tolerance)
        ):
            fraction = find_sign_change(
                rate_sign * (d1 - d0), rate_sign * (d2 - d1), rate_sign * (d3 - d2)
            )
            if fraction < first_fraction:
                first_fraction, story, event = fraction, i, rows.REVERSED
    return first_fraction, story, event


@inline
def _bezier(cubic, s):
    """Return the value at `s` of the cubic with the four Bezier points `cubic`.

    d(s) = (1-s)^3 d0 + 3 s (1-s)^2 d1 + 3 s^2 (1-s) d2 + s^3 d3, with s in [0, 1].
    """
    d0, d1, d2, d3 = cubic
    r = 1.0 - s
    return r * r * (r * d0 + 3.0 * s * d1) + s * s * (3.0 * r * d2 + s * d3)


@outlined
def _crossing(cubic, limit, tolerance, known_event):
    """Return the smallest s in [0, 1] where a rising cubic exceeds a limit, or `NONE` (2).

    `cubic` contains its Bezier points. Because the last event is located with a small error, the
    cubic can start above the limit. Only parts where the cubic rises are considered:

    - It starts at or above the limit and rises at the start: the result is 0.
    - It starts above the limit, falls, and later rises. The result is the crossing on the rising
      part, or the start of this part if the cubic does not fall below the limit (`_root`).
    - It starts above the limit and only falls: the result is `NONE`.
    - It starts below the limit: the result is the first crossing, or `NONE` without a crossing.

    `tolerance` is an excess that is tolerated, m: the result is `NONE` if no rising part exceeds
    the limit by more. Otherwise the crossing of `limit` is located. `known_event` is the
    fraction of the step at the first event found so far. It only saves time: for a crossing that is
    not before this event, the result can be `NONE`.
    """
    d0, d1, d2, d3 = cubic
    # The cubic is monotonic before, between and after its extrema at s_first and s_second, the
    # roots of its derivative, a s^2 + 2 b s + c = 0 (divided by 3). An extremum outside of the step
    # is replaced by the nearer endpoint, 0 or 1; both are 1 if the cubic is monotonic.
    a = d3 - d0 + 3.0 * (d1 - d2)
    b = d0 - 2.0 * d1 + d2
    c = d1 - d0
    s_first = 1.0
    s_second = 1.0
    value_first = d3
    value_second = d3
    discriminant = b * b - a * c
    if discriminant > 0.0:
        q = -(b + math.copysign(math.sqrt(discriminant), b))
        root = q / a if a != 0.0 else 1.0
        other = c / q if q != 0.0 else 1.0
        s_first = min(max(min(root, other), 0.0), 1.0)
        s_second = min(max(max(root, other), 0.0), 1.0)
        value_first = _bezier(cubic, s_first)
        value_second = _bezier(cubic, s_second)
    # `_exceeds_while_rising` considers the tolerance; the search below does not.
    if not _exceeds_while_rising(d0, d1, value_first, value_second, d3, limit + tolerance):
        return NONE
    # If a later part exceeds the limit by more than the tolerance, a rise at the start can be
    # smaller than the tolerance. The result 0 is then also correct: the drift rises at the limit.
    if d0 >= limit and d1 > d0:
        return 0.0
    if value_first > limit and value_first > d0:
        return _root(cubic, limit, (0.0, d0), (s_first, value_first), known_event)
    if value_second > limit and value_second > value_first:
        return _root(cubic, limit, (s_first, value_first), (s_second, value_second), known_event)
    return _root(cubic, limit, (s_second, value_second), (1.0, d3), known_event)


@inline
def _exceeds_while_rising(d0, d1, value_first, value_second, d3, limit):
    """Return True if a cubic exceeds `limit` on a rising part of the step.

    The two extrema divide the step into three parts. A part rises if its last value exceeds its
    first value. The result is also True if the cubic starts at the limit or above and rises at the
    start: if this rise is smaller than the rounding errors of the value at its end, only this
    condition detects it. `value_first` and `value_second` are the values at the extrema
    (`_crossing`).
    """
    at_first = (d0 >= limit) & (d1 > d0)
    between = ((value_first > limit) & (value_first > d0)) | (
        (value_second > limit) & (value_second > value_first)
    )
    return at_first | between | ((d3 > limit) & (d3 > value_second))


@outlined
def _root(cubic, limit, part_start, part_end, known_event):
    """Return the crossing of a limit on a monotonically rising part of a cubic, by Newton's method
    from the secant of the part, safeguarded by bisection.

    `part_start` and `part_end` contain the argument and the value of the cubic. The result is the
    start of the part if the value there is at or above the limit (without comparison with
    `known_event`), and `NONE` if the crossing is not before `known_event`.
    """
    d0, d1, d2, d3 = cubic
    lower_s, lower_value = part_start
    upper_s, upper_value = part_end
    if lower_value >= limit:
        return lower_s
    if known_event < upper_s and (known_event <= lower_s or _bezier(cubic, known_event) <= limit):
        return NONE
    s = lower_s + (upper_s - lower_s) * (limit - lower_value) / (upper_value - lower_value)
    for _ in range(60):
        value = _bezier(cubic, s) - limit
        if value > 0.0:
            upper_s = s
        else:
            lower_s = s
        r = 1.0 - s
        rate = 3.0 * (r * r * (d1 - d0) + 2.0 * r * s * (d2 - d1) + s * s * (d3 - d2))
        # Bisect if Newton's step ends outside the interval that contains the crossing.
        new_s = s - value / rate if rate != 0.0 else lower_s
        if not lower_s < new_s < upper_s:
            new_s = 0.5 * (lower_s + upper_s)
        change = new_s - s
        s = new_s
        if abs(change) <= _ROOT_TOLERANCE:
            break
    return s


@outlined
def find_sign_change(r0, r1, r2):
    """Return the smallest s in [0, 1] where a quadratic changes from positive to negative, or NONE
    (a number above 1).

    The quadratic r(s) = (1-s)^2 r0 + 2 s (1-s) r1 + s^2 r2 = a s^2 + 2 b s + r0 is a drift rate,
    positive in the direction of the branch, with a = r0 - 2 r1 + r2 and b = r1 - r0. s is the time
    as a fraction of the step. If the quadratic touches zero and remains positive, the result is the
    time of the contact.

    A rate that is not positive at the start (r0 <= 0) has two possible causes, which the sign of r1
    distinguishes:

    - For r1 <= 0, the story moves against the direction of the branch from the start, or from rest
      (r0 = r1 = 0). The result is 0.
    - For r1 > 0, the step starts at the previous reversal. Its location is inexact, so that the
      rate at the start is slightly negative instead of zero, and then becomes positive. The result
      is `NONE`. If the rate becomes negative again within the step, this reversal is not located.
      The branch then normally changes at the start of the next step.

    Parameters
    ----------
    r0, r1, r2 : float
        Bezier points of the quadratic. Callers ensure that r1 or r2 is negative. For r0 > 0, no
        divisor of the root is then 0. If b < 0, the divisor is positive. If b >= 0, r1 is at least
        r0 and therefore positive, so that r2 is negative, and the divisor a = r2 - r1 - b is
        negative.
    """
    if r0 <= 0.0:
        # For r1 > 0, the larger root of r(s) is a second reversal. Locating this reversal was
        # tested: for steps of up to five sampling intervals of the record, no error decreases by
        # more than 0.4 % (60 buildings of one to three Bouc-Wen stories).
        return 0.0 if r1 <= 0.0 else NONE
    a = r0 - 2.0 * r1 + r2
    b = r1 - r0
    discriminant = b * b - a * r0
    if discriminant < 0.0:
        return NONE
    # Smaller positive root of a s^2 + 2 b s + r0 = 0, without cancellation.
    s = r0 / (-b + math.sqrt(discriminant)) if b < 0.0 else -(b + math.sqrt(discriminant)) / a
    return s if 0.0 <= s <= 1.0 else NONE
