"""Mean and first moment of the force of a drift law along a parabola of drift within one step.

The method moment4 needs these integrals. The drift d and the integrals of the force f are

    d(t) = d0 + rise t + bend (t^2 - t) / 2,   t in [0, 1], s = t - 1/2
    mean = int f dt,   moment = 12 int s f dt

Times t are fractions of the step, and d0 is the committed drift. The rise is the change of the
drift over the path. The bend is the change over the path of the rate d'(t) = rise + bend s. The
work along the path is rise * mean + bend * moment / 12. The derivatives with respect to rise and
bend are complete: after a reversal of the path, the force also depends on the drift at the
reversal. A path has at most one reversal, at the extremum of the parabola.

The integrals of a piecewise-linear law are exact. The path is divided at each change of branch and
at the reversal. A curved elastic law is integrated with the number of Gauss points that the law
requests. A curved hysteretic law is integrated in the same way, first to the reversal and then from
the reversal to the end.

Functions add their results to the six rows MEAN to MOMENT_BY_BEND that `results` (`Integrals`)
locates, or to the same rows from `out` on. All other arguments are in `tdint.kernels.layout`.
"""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np

from tdint.kernels import layout as rows
from tdint.kernels.compiling import FULL, inline, outlined
from tdint.kernels.laws.branch_following import MAX_BRANCHES, copy_state
from tdint.kernels.laws.selection import (
    dissipates,
    distance_to_kink,
    elements_of,
    is_curved,
    points_on_path,
)
from tdint.kernels.stepping import Integrals, PathSegment
from tdint.kernels.stories.branches import advance_law, sum_branches, switch, synchronize
from tdint.kernels.stories.law_state import (
    accumulate_dissipation,
    commit_without_dissipation,
    restoring_force,
    restoring_force_outlined,
)

# Rows of the results in the scratch array, relative to the first row `out`: mean and moment (N),
# and their derivatives with respect to rise and bend (N/m)
MEAN = 0
MOMENT = 1
MEAN_BY_RISE = 2
MEAN_BY_BEND = 3
MOMENT_BY_RISE = 4
MOMENT_BY_BEND = 5
_RESULTS = 6
_AFTER_REVERSAL = 6  # first row of the same results for the part of the path after a reversal
_SHIFTED = 12  # first row of the same results after a reversal at a slightly shifted drift
PATH_ROWS = 18

# Fraction of the step. Tolerance of the time of a reversal; rounding errors are about 1e-15.
_ROOT = 1e-12
_MAX_ROOT_ITERATIONS = 60  # bisection alone would need 40 iterations
# Fraction of the rate that a story reaches within the step. A smaller rate in the opposite
# direction is regarded as rounding error and not as a reversal. In a building at rest, the initial
# acceleration has a rounding error of about 1e-16 of the floor loads, and the drifts of upper
# stories are only 1e-6 of the floor displacements.
_RATE_ROUNDING = 1e-9
# Ratio (dimensionless) of a rate against the direction of the movement to the rate at the drift to
# be reached; up to this ratio, the opposite rate is regarded as a rounding error. A path that
# starts at a reversal can have such a rate.
_OPPOSITE_RATE = 1e-12
# Shift of the drift at a reversal for the numerical derivative of the integrals with respect to
# this drift, as a fraction of |rise| + |bend|
_SHIFT = 1e-6
MAX_POINTS = 16  # maximum number of Gauss points in a single part of the path
# Maximum number of Gauss points on a path. If Newton's method diverges, the change of drift is
# large and laws would request millions of points.
_MAX_POINTS = 32e3


def _gauss() -> tuple[np.ndarray, np.ndarray]:
    """Return nodes and weights of the Gauss-Legendre rules on [0, 1], shape (MAX_POINTS + 1,
    MAX_POINTS).

    Row n contains the n nodes or weights of the rule with n points, then zeros; row 0 is empty. The
    rules are read from a table, so that all machines use equal numbers and no LAPACK call is needed
    at import. Line n of the table contains the nodes and the weights of NumPy's `leggauss(n)` on
    [-1, 1].
    """
    nodes = np.zeros((MAX_POINTS + 1, MAX_POINTS))
    weights = np.zeros_like(nodes)
    lines = Path(__file__).with_name("gauss_legendre.txt").read_text(encoding="ascii").splitlines()
    for n, line in enumerate(lines, 1):
        numbers = np.array(list(map(float, line.split())))
        nodes[n, :n] = 0.5 * (numbers[:n] + 1.0)
        weights[n, :n] = 0.5 * numbers[n:]
    return nodes, weights


NODES, WEIGHTS = _gauss()


@inline
def required_points(law_parameters, law_state, i, drift_change):
    """Return the minimum number of Gauss points on a path whose length, or an upper bound of it, is
    `drift_change` (m); not necessarily an integer.

    The law specifies the number. It is at least 1, also if the function of a plug-in returns less
    or nan. It is limited to _MAX_POINTS because a diverging Newton iteration can produce an
    unrealistic change of drift.
    """
    return min(max(1.0, points_on_path(law_parameters, law_state, i, drift_change)), _MAX_POINTS)


@inline
def remains_on_branch(law_state, i, rise, bend):
    """Return True if story `i` remains on its current linear branch along the complete path from
    the committed state.

    The branch ends if the drift exceeds UPPER or falls below LOWER, or if the rate has the sign
    opposite to RATE_SIGN. The result is False on a curved branch (infinite SLOPE).
    """
    if not law_state[rows.SLOPE, i] < math.inf:
        return False
    start_drift = law_state[rows.DRIFT, i]
    rate_sign = law_state[rows.RATE_SIGN, i]
    # Rates at both endpoints times the length of the step, m.
    first_rate = rise - 0.5 * bend
    last_rate = rise + 0.5 * bend
    if rate_sign * first_rate < 0.0 or rate_sign * last_rate < 0.0:
        return False
    # The Bezier points of the parabola are d(0), d(0) + d'(0) / 2 and d(1); the extremum is needed
    # only if they exceed a limit.
    middle_drift = start_drift + 0.5 * first_rate
    end_drift = start_drift + rise
    highest = max(start_drift, middle_drift, end_drift)
    lowest = min(start_drift, middle_drift, end_drift)
    if highest <= law_state[rows.UPPER, i] and lowest >= law_state[rows.LOWER, i]:
        return True
    if first_rate * last_rate < 0.0:
        t = 0.5 - rise / bend
        middle_drift = start_drift + rise * t + 0.5 * bend * (t * t - t)
    else:
        middle_drift = start_drift
    return (
        max(start_drift, middle_drift, end_drift) <= law_state[rows.UPPER, i]
        and min(start_drift, middle_drift, end_drift) >= law_state[rows.LOWER, i]
    )


@outlined
def locate_reversals(rise, first_rate, last_rate, initial_slope):
    """Locate the reversals of a story within a step: the zeros of its drift rate.

    The drift rate is approximated by a cubic polynomial of the time t, which increases from 0 to 1
    over the step. All rates are multiplied by the length of the step and therefore have the unit m:

        r(t) = r0 + c1 t + c2 t^2 + c3 t^3
        c2 = 12 (rise - r0 - c1 / 2) - 3 (r1 - r0 - c1)
        c3 = 4 (r1 - r0 - c1) - 12 (rise - r0 - c1 / 2)

    with r0 = `first_rate`, r1 = `last_rate` and c1 = `initial_slope`. The polynomial has the rates
    r(0) = r0 and r(1) = r1, the slope r'(0) = c1 and the integral `rise`. The method moment4
    describes the drift within a step by a parabola. The parabola is not used here, because its rate
    differs from the rates r0 and r1.

    Returns
    -------
    direction : float
        Direction of the initial movement, 1 or -1.
    first_reversal, second_reversal, third_reversal : float
        Fractions of the step in (0, 1) where the rate changes its sign; 1 for no further
        reversal.
    min_extremum : float
        Minimum absolute rate at an extremum within the step, m. It is infinite if there is no
        extremum, or if the story starts from rest without an initial slope and has no reversal.
    """
    tolerance = _RATE_ROUNDING * (abs(rise) + abs(last_rate))
    if abs(first_rate) <= tolerance and abs(initial_slope) <= tolerance and rise * last_rate > 0.0:
        # An example are the upper stories of a building at rest: their rate is r1 t^m with the
        # power m = 3 or higher. Its integral, the rise, is r1 / (m + 1), so that c2 = (12 / (m + 1)
        # - 3) r1. For m = 3, c2 consists of rounding errors; for larger m, c2 and the rate have
        # opposite signs. In both cases the cubic could have a reversal that the story does not
        # have.
        return math.copysign(1.0, rise), 1.0, 1.0, 1.0, math.inf
    rate_change = last_rate - first_rate - initial_slope
    mean_excess = rise - first_rate - 0.5 * initial_slope
    c2 = 12.0 * mean_excess - 3.0 * rate_change
    c3 = 4.0 * rate_change - 12.0 * mean_excess
    # The rate is monotonic between its extrema, the roots of initial_slope + 2 c2 t + 3 c3 t^2 = 0.
    # Each of the three intervals therefore contains at most one zero. The roots q / (3 c3) and
    # initial_slope / q are free of cancellation. The conditions with abs() are true for roots
    # between -1 and 1; they also exclude a division by zero. Other roots are replaced by 1, and
    # negative roots by 0: a replaced root only adds an interval of zero length.
    first_extremum = last_extremum = 1.0
    discriminant = c2 * c2 - 3.0 * c3 * initial_slope
    if discriminant > 0.0:
        q = -(c2 + math.copysign(math.sqrt(discriminant), c2))
        first_extremum = max(q / (3.0 * c3), 0.0) if abs(q) < abs(3.0 * c3) else 1.0
        last_extremum = max(initial_slope / q, 0.0) if abs(initial_slope) < abs(q) else 1.0
        first_extremum, last_extremum = (
            min(first_extremum, last_extremum),
            max(first_extremum, last_extremum),
        )
    if abs(first_rate) > tolerance:
        initial_rate = first_rate
    elif abs(initial_slope) > tolerance:
        initial_rate = initial_slope
    else:
        initial_rate = rise
    first_reversal = second_reversal = third_reversal = 1.0
    min_extremum = math.inf
    lower, previous_rate = 0.0, initial_rate
    for part in range(3):
        upper = first_extremum if part == 0 else last_extremum if part == 1 else 1.0
        rate = first_rate + upper * (initial_slope + upper * (c2 + upper * c3))
        if part < 2 and 0.0 < upper < 1.0:
            min_extremum = min(min_extremum, abs(rate))
        if previous_rate * rate < 0.0 and abs(rate) > tolerance:
            root = _find_zero((first_rate, initial_slope, c2, c3), lower, upper, rate)
            if first_reversal == 1.0:
                first_reversal = root
            elif second_reversal == 1.0:
                second_reversal = root
            else:
                third_reversal = root
        lower = upper
        previous_rate = rate if abs(rate) > tolerance else previous_rate
    return (
        math.copysign(1.0, initial_rate),
        first_reversal,
        second_reversal,
        third_reversal,
        min_extremum,
    )


@inline
def has_certain_reversal(rise, first_rate, last_rate):
    """Return True if the drift rate at an endpoint of the step is opposite to the change of drift.

    The drift then has a reversal within the step for any initial acceleration. Rates below
    _RATE_ROUNDING times (|rise| + |last_rate|) are regarded as rounding errors and ignored. The
    rate at the start is not included in the sum: in a building at rest, it can consist of rounding
    errors, and is compared with the motion that follows. For `rise` 0, the result is False.

    Parameters
    ----------
    first_rate, last_rate : float
        Drift rates at both endpoints times the step, m.
    """
    tolerance = _RATE_ROUNDING * (abs(rise) + abs(last_rate))
    return (rise * first_rate < 0.0 and abs(first_rate) > tolerance) or (
        rise * last_rate < 0.0 and abs(last_rate) > tolerance
    )


@inline
def _find_zero(cubic, lower, upper, value_at_upper):
    """Return the zero of c0 + c1 t + c2 t^2 + c3 t^3 in an interval in which this cubic is
    monotonic.

    Newton's method is used, with bisection if an iterate is not inside the interval. Only the sign
    of `value_at_upper` is used.
    """
    c0, c1, c2, c3 = cubic
    t = 0.5 * (lower + upper)
    # The value at `upper` always has the sign of `value_at_upper`.
    for _ in range(_MAX_ROOT_ITERATIONS):
        value = c0 + t * (c1 + t * (c2 + t * c3))
        if value * value_at_upper < 0.0:
            lower = t
        else:
            upper = t
        slope = c1 + t * (2.0 * c2 + 3.0 * t * c3)
        # Without a slope, `lower` is not inside the interval, which selects the midpoint.
        new_t = t - value / slope if slope != 0.0 else lower
        new_t = new_t if lower < new_t < upper else 0.5 * (lower + upper)
        if abs(new_t - t) < _ROOT:
            return new_t
        t = new_t
    return t


@inline
def integrate_on_branch(law_state, i, rise, bend, scratch, out):
    """Store the results for a story that remains on the linear branch of its committed state, from
    row `out` on.

    With the force f0 at the start and the stiffness k of the branch, the force is f(t) = f0 + k
    (d(t) - d0), and

        mean   = int f dt              = f0 + k (rise / 2 - bend / 12)
        moment = 12 int (t - 1/2) f dt = k rise
    """
    slope = law_state[rows.SLOPE, i]
    scratch[out + MEAN, i] = law_state[rows.FORCE, i] + slope * (0.5 * rise - bend / 12.0)
    scratch[out + MOMENT, i] = slope * rise
    scratch[out + MEAN_BY_RISE, i] = 0.5 * slope
    scratch[out + MEAN_BY_BEND, i] = -slope / 12.0
    scratch[out + MOMENT_BY_RISE, i] = slope
    scratch[out + MOMENT_BY_BEND, i] = 0.0


@outlined
def follow(law_parameters, law_state, i, rise, bend, no_reversal, scratch, out):
    """Store the results for story `i` along its parabola of drift, from the committed drift d0 on.

    The law follows the path in trial states, and the committed state is not changed. The function
    `commit_path_end` later commits the state at the end of the path.

    Parameters
    ----------
    no_reversal : bool
        True to ignore an extremum of the parabola, because the motion of the story has no reversal
        in the step. A piecewise-linear law does not change to an unloading branch; its force on the
        current branch is still evaluated at the drift of the parabola. Curved laws ignore the flag.
    out : int
        First of PATH_ROWS scratch rows; the first six receive the results. For a story with
        elements, they also receive the results of the elements in their columns.
    """
    if FULL and law_parameters[rows.CODE, i] <= rows.ELEMENTS:
        _integrate_elements(law_parameters, law_state, i, rise, bend, no_reversal, scratch, out)
    else:
        _follow_law(law_parameters, law_state, i, rise, bend, no_reversal, scratch, out)


@outlined
def _integrate_elements(law_parameters, law_state, i, rise, bend, no_reversal, scratch, out):
    """Store the results for the elements of story `i` along its path, and their sum.

    An element that remains on its linear branch is only moved to the end of the path.
    """
    synchronize(law_parameters, law_state, i, 0)
    _clear(Integrals(scratch, out), i)
    for element in elements_of(law_parameters, i):
        if is_piecewise_linear(law_parameters, element) and remains_on_branch(
            law_state, element, rise, bend
        ):
            integrate_on_branch(law_state, element, rise, bend, scratch, out)
            copy_state(law_state, element, 0, rows.FIRST_TRIAL)
            end_drift = law_state[rows.DRIFT, element] + rise
            advance_law(law_parameters, law_state, element, rows.FIRST_TRIAL, end_drift)
        else:
            _follow_law(law_parameters, law_state, element, rise, bend, no_reversal, scratch, out)
        for row in range(_RESULTS):
            scratch[out + row, i] += scratch[out + row, element]


@outlined
def _follow_law(law_parameters, law_state, i, rise, bend, no_reversal, scratch, out):
    """Store the results for the law in column `i`, a story with a single element or an element; see
    `follow`.
    """
    story_path = PathSegment(law_state[rows.DRIFT, i], rise, bend, 0.0, 1.0)
    results = Integrals(scratch, out)
    _clear(results, i)
    if is_piecewise_linear(law_parameters, i):
        reversal_time = 1.0 if no_reversal else time_of_extremum(story_path)
        _integrate_piecewise_linear(
            law_parameters, law_state, i, story_path, reversal_time, results
        )
    elif dissipates(law_parameters, i):
        _integrate_hysteretic(law_parameters, law_state, i, story_path, results)
    else:
        # The rate of the path is at most |rise| + |bend| / 2, at t = 0 or t = 1: an upper bound of
        # its length int |d'(t)| dt, which is at most |rise| + |bend| / 4.
        count = required_points(law_parameters, law_state, i, abs(rise) + 0.5 * abs(bend))
        _integrate(law_parameters, law_state, i, 0, True, count, story_path, results)


@outlined
def commit_path_end(law_parameters, law_state, i, rise):
    """Commit the state at the end of the path of the last call of `follow`, at the committed drift
    plus `rise`."""
    if FULL and law_parameters[rows.CODE, i] <= rows.ELEMENTS:
        for element in elements_of(law_parameters, i):
            _commit_law_at_path_end(law_parameters, law_state, element, rise)
        law_state[rows.DRIFT, i] += rise
        sum_branches(law_parameters, law_state, i, 0)
    else:
        _commit_law_at_path_end(law_parameters, law_state, i, rise)


@outlined
def force_at_path_end(law_parameters, law_state, i, rise):
    """Return force (N) and tangent stiffness (N/m) of story `i` at the end of the path of the last
    call of `follow`, at the committed drift plus `rise`."""
    if FULL and law_parameters[rows.CODE, i] <= rows.ELEMENTS:
        force = tangent = 0.0
        for element in elements_of(law_parameters, i):
            part, slope = _law_at_path_end(law_parameters, law_state, element, rise)
            force += part
            tangent += slope
        return force, tangent
    return _law_at_path_end(law_parameters, law_state, i, rise)


@outlined
def _law_at_path_end(law_parameters, law_state, i, rise):
    """Return force and tangent stiffness of the law in column `i` (`force_at_path_end`)."""
    if is_piecewise_linear(law_parameters, i):
        first = rows.FIRST_TRIAL
        return law_state[first + rows.FORCE, i], law_state[first + rows.SLOPE, i]
    previous = rows.FIRST_TRIAL if dissipates(law_parameters, i) else 0
    tangent = restoring_force_outlined(
        law_parameters, law_state, i, previous, rows.SECOND_TRIAL, law_state[rows.DRIFT, i] + rise
    )
    return law_state[rows.SECOND_TRIAL + rows.FORCE, i], tangent


@outlined
def _commit_law_at_path_end(law_parameters, law_state, i, rise):
    """Commit the state of the law in column `i`, a story with a single element or an element."""
    if is_piecewise_linear(law_parameters, i):
        copy_state(law_state, i, rows.FIRST_TRIAL, 0)
        return
    # A hysteretic law starts from the last Gauss point, which `follow` has stored in FIRST_TRIAL.
    # An elastic law starts from the committed state, because its force depends on the drift only.
    previous = rows.FIRST_TRIAL if dissipates(law_parameters, i) else 0
    restoring_force_outlined(
        law_parameters, law_state, i, previous, rows.SECOND_TRIAL, law_state[rows.DRIFT, i] + rise
    )
    # The commit copies the dissipated energy with the other rows and adds no energy.
    accumulate_dissipation(law_parameters, law_state, i, previous, rows.SECOND_TRIAL)
    commit_without_dissipation(law_parameters, law_state, i, rows.SECOND_TRIAL)


@inline
def is_piecewise_linear(law_parameters, i):
    """Return True if all branches of the law of story `i` are linear.

    A law that is declared as curved can also have linear branches (a finite SLOPE in its state).
    Its path is integrated like the path of a curved law, because it can end on a curved branch.
    All elements of a story with elements must be piecewise linear.
    """
    if FULL and law_parameters[rows.CODE, i] <= rows.ELEMENTS:
        for element in elements_of(law_parameters, i):
            if is_curved(law_parameters, element):
                return False
        return True
    return not is_curved(law_parameters, i)


@inline
def drift_at(segment, t):
    """Return the drift of a parabola at time `t`, m."""
    return segment.start + t * (segment.rise + 0.5 * segment.bend * (t - 1.0))


@inline
def path_segment(segment, begin, end):
    """Return the part of a parabola of drift from time `begin` to time `end`; its coefficients do
    not change."""
    return PathSegment(segment.start, segment.rise, segment.bend, begin, end)


@inline
def _clear(results, i):
    """Set the six results of story `i` to zero."""
    for row in range(_RESULTS):
        results.table[results.first + row, i] = 0.0


@inline
def time_of_extremum(segment):
    """Return the time in (0, 1) of the extremum of a parabola of drift; 1 without an extremum."""
    if 2.0 * abs(segment.rise) >= abs(segment.bend):
        return 1.0
    t = 0.5 - segment.rise / segment.bend
    return t if 0.0 < t < 1.0 else 1.0


@inline
def _add(results, i, weight, t, force, tangent):
    """Add an integration point with the weight w to the results of story `i`.

    The drift d(t) changes by t per unit of rise and by (t^2 - t) / 2 per unit of bend. The weights
    of all points on the complete path have the sum 1.
    """
    scratch, out = results
    by_bend = 0.5 * (t * t - t)
    moment = 12.0 * weight * (t - 0.5)
    scratch[out + MEAN, i] += weight * force
    scratch[out + MOMENT, i] += moment * force
    scratch[out + MEAN_BY_RISE, i] += weight * tangent * t
    scratch[out + MEAN_BY_BEND, i] += weight * tangent * by_bend
    scratch[out + MOMENT_BY_RISE, i] += moment * tangent * t
    scratch[out + MOMENT_BY_BEND, i] += moment * tangent * by_bend


@inline
def _add_after_reversal(results, i, reversal_time, shift):
    """Add the results after a reversal, rows _AFTER_REVERSAL, to the results before it.

    The forces after the reversal at t = t_r depend on the drift d_r = d(t_r), which changes by t_r
    per unit of rise and by (t_r^2 - t_r) / 2 per unit of bend. With the part M(d_r) of the mean
    after a reversal at the drift d_r, this contribution to the derivatives is the difference
    quotient

        d M / d d_r = (M(d_r + shift) - M(d_r)) / shift

    where M(d_r + shift) is in the rows _SHIFTED. The same applies to the moment. `shift` (m) is 0
    if the results do not depend on the drift at the reversal.
    """
    scratch, out = results
    for row in range(_RESULTS):
        scratch[out + row, i] += scratch[out + _AFTER_REVERSAL + row, i]
    if shift != 0.0:
        # Derivatives with respect to the drift at the reversal, N/m
        after, shifted = out + _AFTER_REVERSAL, out + _SHIFTED
        mean_by_drift = (scratch[shifted + MEAN, i] - scratch[after + MEAN, i]) / shift
        moment_by_drift = (scratch[shifted + MOMENT, i] - scratch[after + MOMENT, i]) / shift
        by_bend = 0.5 * (reversal_time * reversal_time - reversal_time)
        scratch[out + MEAN_BY_RISE, i] += mean_by_drift * reversal_time
        scratch[out + MEAN_BY_BEND, i] += mean_by_drift * by_bend
        scratch[out + MOMENT_BY_RISE, i] += moment_by_drift * reversal_time
        scratch[out + MOMENT_BY_BEND, i] += moment_by_drift * by_bend


# ---- Piecewise-linear laws


@inline
def time_to(limit, segment, t_now, direction):
    """Return the time (fraction of the step) that a story needs from time `t_now` to move to a
    drift limit.

    With side = `direction`, three quantities are positive in the direction of movement:

        D = side (limit - d(t_now))             distance to the limit, m
        v = side (rise + bend (t_now - 1/2))    rate of the drift at `t_now`, m
        a = side bend                           rate of change of v, m

    The result x is the smallest positive root of v x + a x^2 / 2 = D. With the rate at the limit, R
    = sqrt(v^2 + 2 a D), the root has two forms, x = 2 D / (v + R) = (R - v) / a. The form without a
    difference of two nearly equal numbers is used: the first form for v >= 0, the second form for v
    < 0.

    - v >= 0 is the usual case: the story moves towards the limit. If a is negative, the story would
      later reverse and reach the limit a second time; x is the first time.
    - v < 0 and a > 0: the story first moves away from the limit, reverses, and then reaches it.
      This case occurs if the caller ignores an extremum of the parabola.

    Callers ensure that the parabola reaches the limit after `t_now`, and limit the result to the
    end of their segment. Because of rounding errors, R^2 can still be negative, or v can be
    negative without a > 0; R or v is then replaced by 0, and x can exceed 1. The result is 1 (the
    complete step) if the story does not move.
    """
    rate = direction * (segment.rise + segment.bend * (t_now - 0.5))
    distance = direction * (limit - drift_at(segment, t_now))
    if not distance > 0.0:
        return 0.0
    root = math.sqrt(max(rate * rate + 2.0 * direction * segment.bend * distance, 0.0))
    # The condition excludes a v that is a rounding error.
    if -rate > _OPPOSITE_RATE * root and direction * segment.bend > 0.0:
        return (root - rate) / (direction * segment.bend)
    return 2.0 * distance / (max(rate, 0.0) + root) if max(rate, 0.0) + root > 0.0 else 1.0


def along_branches(add_part, process_end):
    """Return a compiled function that moves a piecewise-linear law along a part of a path without
    reversal, branch by branch.

    Parameters
    ----------
    add_part : function
        (law_state, i, block, segment, results). Called once for each branch on the path. `segment`
        is the part of the path on this branch. The state in `block` is on this branch.
    process_end : function
        (results, i, t, drift, force). Called each time the drift passes the limit of a branch, with
        the time t (fraction of the step), the limit (m) and the force (N) at the limit. It is not
        called at the end of the path. It is also not called for the replacement of the first
        branch, if this branch is valid only for the opposite direction.

    Returns
    -------
    function
        (law_parameters, law_state, i, block, segment, side, target, results). The law state in
        `block` moves along `segment` in the direction `side` (0 for no movement) to the drift
        `target`, m. `results` is only passed to `add_part` and `process_end`.
    """

    @outlined
    def integrate_path(law_parameters, law_state, i, block, segment, side, target, results):
        """Move the law state in `block` to the drift `target` at the end of `segment`."""
        if side == 0.0:
            add_part(law_state, i, block, segment, results)
            return
        # A branch that is valid only for the opposite direction ends immediately.
        if law_state[block + rows.RATE_SIGN, i] * side < 0.0:
            switch(law_parameters, law_state, i, block, rows.REVERSED)
        t_now = segment.begin
        for branch_count in range(MAX_BRANCHES + 1):
            limit = (
                law_state[block + rows.UPPER, i] if side > 0.0 else law_state[block + rows.LOWER, i]
            )
            leaves_branch = side * (target - limit) > 0.0
            if leaves_branch and branch_count == MAX_BRANCHES:
                # The state has already left MAX_BRANCHES branches, which is only possible for the
                # law of a plug-in. The loop must end: a force nan makes all results nan, so that
                # the step fails.
                law_state[block + rows.FORCE, i] = math.nan
                leaves_branch = False
            t_end = segment.end
            if leaves_branch:
                t_end = min(t_now + time_to(limit, segment, t_now, side), segment.end)
            add_part(law_state, i, block, path_segment(segment, t_now, t_end), results)
            advance_law(law_parameters, law_state, i, block, limit if leaves_branch else target)
            if not leaves_branch:
                break
            process_end(results, i, t_end, limit, law_state[block + rows.FORCE, i])
            switch(law_parameters, law_state, i, block, rows.ABOVE if side > 0.0 else rows.BELOW)
            t_now = t_end

    return integrate_path


@inline
def _add_on_branch(law_state, i, block, segment, results):
    """Add the results over the part of a path on the linear branch of the state in `block`.

    The integrands are polynomials of at most third degree, for which Gauss integration with two
    points is exact.
    """
    length = segment.end - segment.begin
    slope = law_state[block + rows.SLOPE, i]
    for point in range(2):
        t = segment.begin + length * NODES[2, point]
        force = law_state[block + rows.FORCE, i] + slope * (
            drift_at(segment, t) - law_state[block + rows.DRIFT, i]
        )
        _add(results, i, 0.5 * length, t, force, slope)


@inline
def _ignore_branch_end(results, i, t, drift, force):
    """Do nothing at a limit of a branch: `_add_on_branch` already adds the complete part."""
    pass


_integrate_over_branches = along_branches(_add_on_branch, _ignore_branch_end)


@inline
def _integrate_monotonic(law_parameters, law_state, i, block, segment, results):
    """Move a piecewise-linear law from the state in `block` along a part of a path without
    reversal, and add the results.

    Without a change of drift (side 0), the force of the current branch is integrated and the state
    is not changed.
    """
    target = drift_at(segment, segment.end)
    drift_change = target - drift_at(segment, segment.begin)
    side = math.copysign(1.0, drift_change) if drift_change != 0.0 else 0.0
    _integrate_over_branches(law_parameters, law_state, i, block, segment, side, target, results)


@outlined
def _integrate_piecewise_linear(law_parameters, law_state, i, story_path, reversal_time, results):
    """Add the results of a piecewise-linear law over a step with a reversal at `reversal_time` (1:
    none).

    The law follows the path in FIRST_TRIAL, which finally contains the state at its end. The rows
    of `results` are zero at the start; the next twelve rows (_AFTER_REVERSAL and _SHIFTED) are used
    for intermediate results.
    """
    copy_state(law_state, i, 0, rows.FIRST_TRIAL)
    path_before = path_segment(story_path, 0.0, reversal_time)
    _integrate_monotonic(law_parameters, law_state, i, rows.FIRST_TRIAL, path_before, results)
    if reversal_time == 1.0:
        return
    after_reversal = Integrals(results.table, results.first + _AFTER_REVERSAL)
    shifted = Integrals(results.table, results.first + _SHIFTED)
    path_back = path_segment(story_path, reversal_time, 1.0)
    direction = math.copysign(1.0, story_path.bend)  # after the reversal
    shift = 0.0
    # A branch that is valid for both directions does not change at the reversal, and its force does
    # not depend on the drift at the reversal: shift 0. Otherwise a copy of the state (SECOND_TRIAL)
    # is moved further by a small shift, in the direction of the path before the reversal, for the
    # difference quotient of `_add_after_reversal`.
    if law_state[rows.FIRST_TRIAL + rows.RATE_SIGN, i] * direction < 0.0:
        copy_state(law_state, i, rows.FIRST_TRIAL, rows.SECOND_TRIAL)
        shift = -direction * _SHIFT * (abs(story_path.rise) + abs(story_path.bend))
        drift = drift_at(story_path, reversal_time) + shift
        advance_law(law_parameters, law_state, i, rows.SECOND_TRIAL, drift)
        _clear(shifted, i)
        _integrate_monotonic(law_parameters, law_state, i, rows.SECOND_TRIAL, path_back, shifted)
    _clear(after_reversal, i)
    _integrate_monotonic(law_parameters, law_state, i, rows.FIRST_TRIAL, path_back, after_reversal)
    _add_after_reversal(results, i, reversal_time, shift)


# ---- Curved laws


@outlined
def _integrate(law_parameters, law_state, i, previous, is_elastic, count, segment, results):
    """Add the results of a curved law over a part of a path; return the block of the state at the
    last Gauss point.

    The part has at least `count` (positive, not necessarily an integer) Gauss points. It is divided
    equally so that no division has more than MAX_POINTS points. A hysteretic law starts from the
    state in block `previous` and advances from each point to the next, alternately in FIRST_TRIAL
    and SECOND_TRIAL; the energy dissipated from point to point is added. An elastic law
    (`is_elastic`) does not use `previous`.
    """
    scratch, out = results
    divisions = math.ceil(count / MAX_POINTS)
    points = math.ceil(count / divisions)
    length = (segment.end - segment.begin) / divisions
    mean = moment = 0.0
    mean_by_rise = mean_by_bend = moment_by_rise = moment_by_bend = 0.0
    trial = rows.FIRST_TRIAL
    for division in range(divisions):
        for point in range(points):
            t = segment.begin + length * (division + NODES[points, point])
            if not is_elastic:
                trial = rows.FIRST_TRIAL if previous != rows.FIRST_TRIAL else rows.SECOND_TRIAL
            tangent = restoring_force(
                law_parameters, law_state, i, previous, trial, drift_at(segment, t)
            )
            if not is_elastic:
                accumulate_dissipation(law_parameters, law_state, i, previous, trial)
                previous = trial
            # `force`, `by_rise` and `by_bend` include the weight of the point.
            weight = length * WEIGHTS[points, point]
            by_moment = 12.0 * (t - 0.5)
            force = weight * law_state[trial + rows.FORCE, i]
            by_rise = weight * tangent * t
            by_bend = 0.5 * by_rise * (t - 1.0)
            mean += force
            moment += by_moment * force
            mean_by_rise += by_rise
            mean_by_bend += by_bend
            moment_by_rise += by_moment * by_rise
            moment_by_bend += by_moment * by_bend
    scratch[out + MEAN, i] += mean
    scratch[out + MOMENT, i] += moment
    scratch[out + MEAN_BY_RISE, i] += mean_by_rise
    scratch[out + MEAN_BY_BEND, i] += mean_by_bend
    scratch[out + MOMENT_BY_RISE, i] += moment_by_rise
    scratch[out + MOMENT_BY_BEND, i] += moment_by_bend
    return trial


@outlined
def _integrate_divided(law_parameters, law_state, i, previous, segment, results):
    """Add the results of a hysteretic law along a path without reversal, in two parts if the force
    has a kink on the path; return the block of the state at the last Gauss point.

    At a kink, the tangent stiffness changes rapidly, and Gauss integration over the kink would be
    inaccurate. The path starts from the state in block `previous`.
    """
    start_drift = drift_at(segment, segment.begin)
    drift_change = drift_at(segment, segment.end) - start_drift
    side = math.copysign(1.0, drift_change)
    drift_change = abs(drift_change)
    begin = segment.begin
    # Change of drift from the state in `previous` to the kink, m. This state is at `start_drift`.
    # Only for the difference quotient after a reversal, it differs by the shift of the reversal
    # (`_integrate_hysteretic`), which is negligible.
    kink_distance = distance_to_kink(law_parameters, law_state, i, previous, side)
    if kink_distance < drift_change:
        count = required_points(law_parameters, law_state, i, kink_distance)
        duration = time_to(start_drift + side * kink_distance, segment, begin, side)
        part = path_segment(segment, begin, min(begin + duration, segment.end))
        previous = _integrate(law_parameters, law_state, i, previous, False, count, part, results)
        begin = part.end
        drift_change -= kink_distance
    count = required_points(law_parameters, law_state, i, drift_change)
    part = path_segment(segment, begin, segment.end)
    return _integrate(law_parameters, law_state, i, previous, False, count, part, results)


@outlined
def _integrate_hysteretic(law_parameters, law_state, i, story_path, results):
    """Add the results of a curved hysteretic law, such as Bouc-Wen, over a step.

    The path is integrated to the reversal and from there to the end. For the derivatives with
    respect to the drift at the reversal, the path after it is integrated a second time, from a
    slightly shifted drift (`_add_after_reversal`). FIRST_TRIAL finally contains the state at the
    last Gauss point; `commit_path_end` continues from this state. The rows of `results` are zero at
    the start; the next twelve rows are used for intermediate results.
    """
    reversal_time = time_of_extremum(story_path)
    previous = _integrate_divided(
        law_parameters, law_state, i, 0, path_segment(story_path, 0.0, reversal_time), results
    )
    if reversal_time < 1.0:
        after_reversal = Integrals(results.table, results.first + _AFTER_REVERSAL)
        shifted = Integrals(results.table, results.first + _SHIFTED)
        path_back = path_segment(story_path, reversal_time, 1.0)
        # The shift continues the path past the reversal, in the same direction: the drift at the
        # reversal is a minimum for a positive `bend`, otherwise a maximum.
        drift = drift_at(story_path, reversal_time)
        restoring_force_outlined(law_parameters, law_state, i, previous, rows.THIRD_TRIAL, drift)
        accumulate_dissipation(law_parameters, law_state, i, previous, rows.THIRD_TRIAL)
        shift = -math.copysign(_SHIFT, story_path.bend) * (
            abs(story_path.rise) + abs(story_path.bend)
        )
        restoring_force_outlined(
            law_parameters, law_state, i, rows.THIRD_TRIAL, rows.FIRST_TRIAL, drift + shift
        )
        # The path from the shifted reversal, in FIRST_TRIAL, is integrated first: an integration
        # from the actual reversal, in THIRD_TRIAL, would overwrite FIRST_TRIAL.
        _clear(shifted, i)
        _integrate_divided(law_parameters, law_state, i, rows.FIRST_TRIAL, path_back, shifted)
        _clear(after_reversal, i)
        previous = _integrate_divided(
            law_parameters, law_state, i, rows.THIRD_TRIAL, path_back, after_reversal
        )
        _add_after_reversal(results, i, reversal_time, shift)
    if previous != rows.FIRST_TRIAL:
        copy_state(law_state, i, previous, rows.FIRST_TRIAL)
