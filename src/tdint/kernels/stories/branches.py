"""Drift laws branch by branch.

On a branch the force is linear in the drift, or curved. It ends where the drift leaves (LOWER,
UPPER), or where the drift rate turns against TURN; `switch` tells what follows. Within a step the
first change of branch is looked for on the cubic Hermite interpolant of each drift.
"""

from __future__ import annotations

import math

from tdint.kernels import layout as rows
from tdint.kernels.compiling import inline, outlined
from tdint.kernels.laws.branch_following import add_work, advancing
from tdint.kernels.laws.choosing import CURVED, case_of_3, case_of_5, case_of_6, chosen

NONE = 2.0
"""The fraction of the step for no event."""

# over the drifts: a branch that is left by less is not left (rounding, and the error of a located
# event)
_SLACK = 1e-9
# of the step, the last correction by Newton's iteration: what is left is about the square of that
_CLOSE = 1e-10
_TURNED = 1e-12  # likewise: a drift that goes back by less has not turned

advance = advancing(chosen("advance", case_of_6, outlined(add_work)))
"""(law_parameters, law_state, i, block, drift): go to `drift` on the present linear branch of the
state in `block`."""


@outlined
def go_along(law_parameters, law_state, i, block, drift):
    """`advance` for where it is one of few calls."""
    advance(law_parameters, law_state, i, block, drift)


@inline
def _without_end(law_parameters, law_state, i):
    pass


@inline
def _without_branches(law_parameters, law_state, i, block, event):
    pass


_enter = chosen("enter", case_of_3, _without_end)
_switch = chosen("switch", case_of_5, _without_branches)


@outlined
def enter(law_parameters, law_state, i):
    """Put the committed state of story `i` on the branch that it implies."""
    law_state[rows.SLOPE, i] = (
        math.inf if law_parameters[rows.CODE, i] in CURVED else law_parameters[rows.STIFFNESS, i]
    )
    law_state[rows.RATE_SIGN, i] = 0.0
    law_state[rows.UPPER, i] = math.inf
    law_state[rows.LOWER, i] = -math.inf
    _enter(law_parameters, law_state, i)


@outlined
def switch(law_parameters, law_state, i, block, event):
    """Change to the branch that follows the present one in `block` after it ended by `event`."""
    _switch(law_parameters, law_state, i, block, event)


# ---- Where a branch ends within a step


@outlined
def first_event(linear_terms, h, state, law_state, scratch, u1, v1, joined):
    """Fraction of the step h at which the first story leaves its branch, the story, and how; NONE
    if none does.

    Rows `u1` and `v1` of work hold displacement and velocity at the end of the step; where row
    `joined` is not 0 the story may turn.
    """
    first = NONE
    story = -1
    how = rows.REVERSED
    v_below = 0.0
    u1_below = 0.0
    v1_below = 0.0
    for i in range(linear_terms.shape[1] - 1):
        link = linear_terms[rows.LINK, i]
        d0 = law_state[rows.DRIFT, i]
        w0 = h * (state[rows.VELOCITY, i] - link * v_below)
        d3 = scratch[u1, i] - link * u1_below
        w1 = h * (scratch[v1, i] - link * v1_below)
        v_below = state[rows.VELOCITY, i]
        u1_below = scratch[u1, i]
        v1_below = scratch[v1, i]
        # Bezier points: the drift lies between the smallest and the largest of them.
        d1 = d0 + w0 / 3.0
        d2 = d3 - w1 / 3.0
        slack = _SLACK * (abs(d0) + abs(d3))
        upper = law_state[rows.UPPER, i]
        lower = law_state[rows.LOWER, i]
        if max(d1, d2, d3) > upper + slack:
            fraction = _crossing((d0, d1, d2, d3), upper, slack, first)
            if fraction < first:
                first, story, how = fraction, i, rows.ABOVE
        if min(d1, d2, d3) < lower - slack:
            fraction = _crossing((-d0, -d1, -d2, -d3), -lower, slack, first)
            if fraction < first:
                first, story, how = fraction, i, rows.BELOW
        turn = law_state[rows.RATE_SIGN, i]
        slack = _TURNED / _SLACK * slack
        if (
            turn != 0.0
            and scratch[joined, i] == 0.0
            and (turn * (d2 - d1) < -slack or turn * (d3 - d2) < -slack)
        ):
            fraction = turning(turn * (d1 - d0), turn * (d2 - d1), turn * (d3 - d2))
            if fraction < first:
                first, story, how = fraction, i, rows.REVERSED
    return first, story, how


@inline
def _bezier(cubic, s):
    d0, d1, d2, d3 = cubic
    r = 1.0 - s
    return r * r * (r * d0 + 3.0 * s * d1) + s * s * (3.0 * r * d2 + s * d3)


@outlined
def _crossing(cubic, limit, slack, before):
    """Smallest s in [0, 1] at which the cubic goes beyond `limit`; NONE if that is not before
    `before`, or if it nowhere goes beyond it by `slack`.

    A cubic that starts beyond it by what the last event was missed by comes inside first, or turns
    outside: it goes beyond where it then rises.
    """
    d0, d1, d2, d3 = cubic
    # Between its extrema the cubic is monotone.
    a = d3 - d0 + 3.0 * (d1 - d2)
    b = d0 - 2.0 * d1 + d2
    c = d1 - d0
    s_low = 1.0
    s_high = 1.0
    low = d3
    high = d3
    discriminant = b * b - a * c
    if discriminant > 0.0:
        q = -(b + math.copysign(math.sqrt(discriminant), b))
        root = q / a if a != 0.0 else 1.0
        other = c / q if q != 0.0 else 1.0
        s_low = min(max(min(root, other), 0.0), 1.0)
        s_high = min(max(max(root, other), 0.0), 1.0)
        low = _bezier(cubic, s_low)
        high = _bezier(cubic, s_high)
    if not _rises_beyond(d0, d1, low, high, d3, limit + slack):
        return NONE
    if d0 >= limit and d1 > d0:
        return 0.0
    if low > limit and low > d0:
        return _root(cubic, limit, (0.0, d0), (s_low, low), before)
    if high > limit and high > low:
        return _root(cubic, limit, (s_low, low), (s_high, high), before)
    return _root(cubic, limit, (s_high, high), (1.0, d3), before)


@inline
def _rises_beyond(d0, d1, low, high, d3, limit):
    """Whether the cubic with these values at its extrema goes beyond `limit`."""
    at_first = (d0 >= limit) & (d1 > d0)
    between = ((low > limit) & (low > d0)) | ((high > limit) & (high > low))
    return at_first | between | ((d3 > limit) & (d3 > high))


@outlined
def _root(cubic, limit, low, high, before):
    """Where the cubic, rising from one place and its value there to another, crosses `limit`, by
    safeguarded Newton from where a line would; the former place if it is beyond it there; NONE if
    that is not before `before`."""
    d0, d1, d2, d3 = cubic
    left, from_value = low
    right, to_value = high
    if from_value >= limit:
        return left
    if before < right and (before <= left or _bezier(cubic, before) <= limit):
        return NONE
    s = left + (right - left) * (limit - from_value) / (to_value - from_value)
    for _ in range(60):
        value = _bezier(cubic, s) - limit
        if value > 0.0:
            right = s
        else:
            left = s
        r = 1.0 - s
        rate = 3.0 * (r * r * (d1 - d0) + 2.0 * r * s * (d2 - d1) + s * s * (d3 - d2))
        new = s - value / rate if rate != 0.0 else left
        if not left < new < right:
            new = 0.5 * (left + right)
        change = new - s
        s = new
        if abs(change) <= _CLOSE:
            break
    return s


@outlined
def turning(r0, r1, r2):
    """Smallest s in [0, 1] from which on the quadratic with the Bezier points r0, r1, r2 is
    negative; NONE if it is not."""
    if r0 <= 0.0:
        return 0.0 if r1 < 0.0 else NONE
    a = r0 - 2.0 * r1 + r2
    b = r1 - r0
    discriminant = b * b - a * r0
    if discriminant < 0.0:
        return NONE
    # The smaller positive root of a s^2 + 2 b s + r0 = 0, without cancellation.
    s = r0 / (-b + math.sqrt(discriminant)) if b < 0.0 else -(b + math.sqrt(discriminant)) / a
    return s if 0.0 <= s <= 1.0 else NONE
