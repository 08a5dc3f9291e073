"""Branches of drift laws, and the first change of branch within a time step.

The force on a branch is a linear or curved function of the drift. The branch ends where the drift
exceeds its limits (LOWER, UPPER) or where the drift rate changes to the sign opposite to RATE_SIGN.
`switch` then sets the branch that follows. Within a step, the first change of branch is located on
the cubic Hermite interpolant of each drift.
"""

from __future__ import annotations

import math

from tdint.kernels import layout as rows
from tdint.kernels.compiling import inline, outlined
from tdint.kernels.laws.branch_following import add_work, advancing
from tdint.kernels.laws.selection import (
    CURVED_LAWS,
    HAS_ELEMENTS,
    case_with_3_arguments,
    case_with_5_arguments,
    case_with_6_arguments,
    select_function,
)

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

advance_law = advancing(select_function("advance", case_with_6_arguments, outlined(add_work)))
"""(law_parameters, law_state, i, block, drift). Moves the state of the law in column `i`, a story
with one element or an element, to `drift` (m) on its current linear branch."""


@inline
def advance(law_parameters, law_state, i, block, drift):
    """Move the state of story `i` in a block to a drift on its current linear branch.

    The elements of a story with elements must all be on linear branches.
    """
    if HAS_ELEMENTS and law_parameters[rows.CODE, i] == rows.ELEMENTS:
        # The elements remain behind (`synchronize`).
        step = drift - law_state[block + rows.DRIFT, i]
        law_state[block + rows.FORCE, i] += law_state[block + rows.SLOPE, i] * step
        law_state[block + rows.DRIFT, i] = drift
    elif HAS_ELEMENTS and law_parameters[rows.CODE, i] < rows.ELEMENTS:
        _advance_elements(law_parameters, law_state, i, block, drift)
    else:
        advance_law(law_parameters, law_state, i, block, drift)


@outlined
def _advance_elements(law_parameters, law_state, i, block, drift):
    """Move all elements of story `i` to a drift on their linear branches; sum their forces."""
    force = 0.0
    for element in range(
        int(law_parameters[rows.FIRST_ELEMENT, i]), int(law_parameters[rows.END_ELEMENT, i])
    ):
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
    for element in range(
        int(law_parameters[rows.FIRST_ELEMENT, i]), int(law_parameters[rows.END_ELEMENT, i])
    ):
        if law_state[block + rows.DRIFT, element] != drift:
            advance_law(law_parameters, law_state, element, block, drift)


@outlined
def advance_outlined(law_parameters, law_state, i, block, drift):
    """Call `advance_law`. The function is compiled separately, for rare calls."""
    advance_law(law_parameters, law_state, i, block, drift)


@inline
def _keep_branch(law_parameters, law_state, i):
    """Do nothing: default of the function `enter` of a law, for laws with a single branch.

    `enter` determines the branch of story `i` from its committed state. The arguments, the tables
    of the parameters and states of all laws and the index of the story, are not used.
    """
    pass


@inline
def _keep_branch_after(law_parameters, law_state, i, block, event):
    """Do nothing: default of the function `switch` of a law, for laws with a single branch.

    `switch` sets the branch that follows the end of the current branch.

    Parameters
    ----------
    event : float
        Reason for the end of the branch: ABOVE or BELOW (the drift exceeds the upper limit or falls
        below the lower limit) or REVERSED (the drift rate changes its sign).
    """
    pass


_enter = select_function("enter", case_with_3_arguments, _keep_branch)
_switch = select_function("switch", case_with_5_arguments, _keep_branch_after)


@outlined
def enter(law_parameters, law_state, i):
    """Determine the branch of story `i` from its committed state.

    First a default branch is set: it has the initial stiffness, or an infinite SLOPE as the mark of
    a curved law, no limits, and both directions. The function `enter` of the law, if it has one,
    then sets the actual branch.

    Column `i` of `law_parameters` contains the parameters of the story. The committed state, in the
    first rows of column `i` of `law_state`, is changed.
    """
    if HAS_ELEMENTS and law_parameters[rows.CODE, i] <= rows.ELEMENTS:
        for element in range(
            int(law_parameters[rows.FIRST_ELEMENT, i]), int(law_parameters[rows.END_ELEMENT, i])
        ):
            enter_law(law_parameters, law_state, element)
        sum_branches(law_parameters, law_state, i, 0)
    else:
        enter_law(law_parameters, law_state, i)


@inline
def enter_law(law_parameters, law_state, i):
    """Determine the branch of the law in column `i`, a story with one element or an element."""
    law_state[rows.SLOPE, i] = (
        math.inf
        if law_parameters[rows.CODE, i] in CURVED_LAWS
        else law_parameters[rows.STIFFNESS, i]
    )
    law_state[rows.RATE_SIGN, i] = 0.0
    law_state[rows.UPPER, i] = math.inf
    law_state[rows.LOWER, i] = -math.inf
    _enter(law_parameters, law_state, i)


@outlined
def switch(law_parameters, law_state, i, block, event):
    """Set the branch that follows the current branch of the state in `block`.

    Parameters
    ----------
    event : float
        Reason for the end of the branch: ABOVE or BELOW (the drift exceeds the upper limit or falls
        below the lower limit) or REVERSED (the drift rate changes its sign).
    """
    _switch(law_parameters, law_state, i, block, event)


# ---- Stories with several elements. The branch of the story is the sum of the branches of its
# elements. It ends where the first of these branches ends.


@outlined
def sum_branches(law_parameters, law_state, i, block):
    """Set force and branch of story `i` in a block to the sum of the states of its elements.

    The branch is curved (infinite SLOPE) if an element is on a curved branch. INTERNAL is 1 if all
    elements have failed, otherwise 0. If a movement within the tolerances of a reversal has left
    the elements with different directions, the story has the direction of a linear branch: a change
    of stiffness at a reversal must be located, whereas a curved branch follows its path in any
    case.
    """
    force = 0.0
    slope = 0.0
    upper = math.inf
    lower = -math.inf
    direction = 0.0
    failed = 1.0
    for element in range(
        int(law_parameters[rows.FIRST_ELEMENT, i]), int(law_parameters[rows.END_ELEMENT, i])
    ):
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
    for element in range(
        int(law_parameters[rows.FIRST_ELEMENT, i]), int(law_parameters[rows.END_ELEMENT, i])
    ):
        turns |= (law_state[rows.SLOPE, element] < math.inf) & (
            law_state[rows.RATE_SIGN, element] != 0.0
        )
    return turns


@inline
def column_of_event(law_parameters, law_state, i, event):
    """Return the column of the law whose branch ends at the event `event` of story `i`.

    It is an element, or the story itself for a story with one element. At a reversal, the branches
    of several elements can end, and the result is the story. The branches must not have changed
    since the event was located.
    """
    if HAS_ELEMENTS and law_parameters[rows.CODE, i] <= rows.ELEMENTS:
        return _element_of_event(law_parameters, law_state, i, event)
    return i


@outlined
def _element_of_event(law_parameters, law_state, i, event):
    """Return the first element of story `i` with the limit of its branch, or `i` at a reversal."""
    row = rows.UPPER if event == rows.ABOVE else rows.LOWER
    if event != rows.REVERSED:
        for element in range(
            int(law_parameters[rows.FIRST_ELEMENT, i]), int(law_parameters[rows.END_ELEMENT, i])
        ):
            # The limit of the story is a copy of the limit of the element.
            if law_state[row, element] == law_state[row, i]:
                return element
    return i


# ---- First change of branch within a time step


@outlined
def first_event(linear_terms, h, state, law_state, scratch, u1, v1, ignored):
    """Locate the first change of branch of any story within a step.

    The drift of each story within the step, d(s) with s from 0 to 1, is the cubic Hermite
    interpolant of the drifts d0, d3 and of h times the drift rates, w0, w1, at both endpoints. In
    Bernstein form

        d(s) = (1-s)^3 d0 + 3 s (1-s)^2 d1 + 3 s^2 (1-s) d2 + s^3 d3
        d1 = d0 + w0 / 3,   d2 = d3 - w1 / 3

    A branch changes where d(s) exceeds UPPER or falls below LOWER, or where d'(s) changes to the
    sign opposite to RATE_SIGN. Rounding errors relative to |d0| + |d3| are tolerated. The start of
    the step is often the last branch change, which is located with a small error. Two deviations
    at the start are therefore no branch change:

    - The drift exceeds a limit and only moves back.
    - The drift rate has the sign opposite to RATE_SIGN, but the points d1, d2 and d3 follow each
      other in the direction of RATE_SIGN.

    Parameters
    ----------
    state : ndarray
        State at the start of the step; only its row VELOCITY (m/s) is used.
    law_state : ndarray
        Committed states of the laws at the start of the step: DRIFT (d0, m), limits UPPER and LOWER
        of the branch (m), RATE_SIGN (1, -1, or 0 for a branch that is valid for both signs of the
        rate).
    u1, v1 : int
        Rows of `scratch` with displacements (m) and velocities (m/s) at the end of the step.
    ignored : int
        Row of `scratch`. Reversals of a story are ignored if its value is not 0.

    Returns
    -------
    first_fraction : float
        Time of the change of branch as a fraction of the step; NONE (above 1) if there is no change
        of branch.
    story : int
        Index of the story; -1 if there is no change of branch.
    event : float
        ABOVE or BELOW if the drift exceeds the upper limit or falls below the lower limit of the
        branch; REVERSED if the drift rate changes its sign.
    """
    first_fraction = NONE
    story = -1
    event = rows.REVERSED
    v_below = 0.0
    u1_below = 0.0
    v1_below = 0.0
    for i in range(linear_terms.shape[1] - 1):
        link = linear_terms[rows.LINK, i]  # 0 for a story on the ground, otherwise 1
        # d0 and d3 are the drifts at the start and at the end of the step (m), w0 and w1 the drift
        # rates there times the length of the step (m).
        d0 = law_state[rows.DRIFT, i]
        w0 = h * (state[rows.VELOCITY, i] - link * v_below)
        d3 = scratch[u1, i] - link * u1_below
        w1 = h * (scratch[v1, i] - link * v1_below)
        v_below = state[rows.VELOCITY, i]
        u1_below = scratch[u1, i]
        v1_below = scratch[v1, i]
        # d0, d1, d2 and d3 are the Bezier points of the cubic. The drift is always between their
        # minimum and their maximum. The tests below omit d0: a drift that exceeds a limit at the
        # start only matters if it moves further, and d1 then also exceeds the limit.
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

    The cubic has the Bezier points d0 to d3: d(s) = (1-s)^3 d0 + 3 s (1-s)^2 d1 + 3 s^2 (1-s) d2 +
    s^3 d3. Because the last event is located with a small error, the cubic can start above the
    limit. Only parts where the cubic rises are considered:

    - It starts at or above the limit and rises at the start: the result is 0.
    - It starts above the limit, falls, and later rises. The result is the crossing on the rising
      part, or the start of this part if the cubic does not fall below the limit (`_root`).
    - It starts above the limit and only falls: the result is `NONE`.
    - It starts below the limit: the result is the first crossing, or `NONE` without a crossing.

    `cubic` contains the bezier points of the drift, m. `limit` is the limit, m.

    Parameters
    ----------
    tolerance : float
        Excess that is tolerated, m. The result is `NONE` if no rising part exceeds the limit by
        more than the tolerance. Otherwise the crossing of `limit` (without tolerance) is located.
    known_event : float
        Fraction of the step at the first event found so far. It only saves time: for a crossing
        that is not before this event, the result can be `NONE`. The caller compares the result with
        the event.
    """
    d0, d1, d2, d3 = cubic
    # The cubic is monotonic before, between and after its extrema at s_first and s_second. These
    # are the roots of its derivative, a s^2 + 2 b s + c = 0 (divided by 3). An extremum outside of
    # the step is replaced by the nearer endpoint, 0 or 1; both are 1 if the cubic is monotonic.
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
    # `_exceeds_while_rising` considers the tolerance; the search below does not. Search the rising
    # parts in their order: start, before the first extremum, between both extrema, after the second
    # extremum.
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

    The two extrema divide the step into three parts. The cubic is monotonic in each part. A part
    rises if its last value exceeds its first value. The result is True if the last value of a
    rising part exceeds the limit. It is also True if the cubic starts at the limit or above
    (d0 >= limit) and rises at the start (d1 > d0). If this rise is smaller than the rounding errors
    of the value at its end, only the second condition detects it.

    `d0`, `d1` and `d3` are the first, second and last Bezier point, m; d0 and d3 are the values at
    both endpoints, and d1 - d0 has the sign of the slope at the start. `limit` is the limit, m.

    Parameters
    ----------
    value_first, value_second : float
        Values at the first and second extremum, m, which are the last values of the first and
        second part. If an extremum is outside of the step, its value is replaced by the value at
        the nearer endpoint, d0 or d3; the part before or after it is then empty. If the cubic has
        no extrema, both values are d3, and the first part is the complete step.
    """
    at_first = (d0 >= limit) & (d1 > d0)
    between = ((value_first > limit) & (value_first > d0)) | (
        (value_second > limit) & (value_second > value_first)
    )
    return at_first | between | ((d3 > limit) & (d3 > value_second))


@outlined
def _root(cubic, limit, part_start, part_end, known_event):
    """Return the crossing of a limit on a monotonically rising part of a cubic.

    The cubic is d(s) = (1-s)^3 d0 + 3 s (1-s)^2 d1 + 3 s^2 (1-s) d2 + s^3 d3. Newton's method
    starts from the crossing of the secant of the part and is safeguarded by bisection.

    `cubic` is the bezier points d0 to d3, m. `limit` is the limit, m. `part_start` and `part_end`
    are the start and end of the part: the argument and the value of the cubic. `known_event` is the
    fraction of the step at the first event found so far. A crossing that is not before this event
    is not needed.

    Returns
    -------
    float
        Start of the part if the value there is at or above the limit (without comparison with
        `known_event`); otherwise the argument of the crossing, or `NONE` if the crossing is not
        before `known_event`.
    """
    d0, d1, d2, d3 = cubic
    lower_s, lower_value = part_start
    upper_s, upper_value = part_end
    if lower_value >= limit:
        return lower_s
    # The crossing is not before the known event if the cubic is still below the limit at that
    # event.
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
        # Take Newton's step, or bisect if it leaves the interval that contains the crossing.
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
        # more than 0.4 % (tests/MEASUREMENTS.md, "Location of branch changes").
        return 0.0 if r1 <= 0.0 else NONE
    a = r0 - 2.0 * r1 + r2
    b = r1 - r0
    discriminant = b * b - a * r0
    if discriminant < 0.0:
        return NONE
    # Smaller positive root of a s^2 + 2 b s + r0 = 0, without cancellation.
    s = r0 / (-b + math.sqrt(discriminant)) if b < 0.0 else -(b + math.sqrt(discriminant)) / a
    return s if 0.0 <= s <= 1.0 else NONE
