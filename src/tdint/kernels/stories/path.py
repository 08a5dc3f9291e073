"""Mean and first moment of the force of a drift law along a parabola of drift within one step.

The method moment4 needs these integrals. The drift d and the integrals of the force f are

    d(t) = d0 + rise t + bend (t^2 - t) / 2,   t in [0, 1], s = t - 1/2
    mean = int f dt,   moment = 12 int s f dt

The rise is the change of the drift over the path. The bend is the change over the path of the rate
d'(t) = rise + bend s. The work along the path is rise * mean + bend * moment / 12. The tangents are
the complete derivatives with respect to rise and bend: after a reversal of the path, the force also
depends on the drift at the reversal.

Times t are fractions of the step. A path has at most one reversal, at the extremum of the parabola.

The integrals of a piecewise-linear law are exact. The path is divided at each change of branch and
at the reversal. A curved elastic law is integrated with the number of Gauss points that the law
requests. A curved hysteretic law is integrated in the same way, first to the reversal and then from
the reversal to the end.
"""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np

from tdint.kernels import layout as rows
from tdint.kernels.compiling import inline, outlined
from tdint.kernels.laws.branch_following import copy_extra_rows
from tdint.kernels.laws.selection import (
    CURVED_LAWS,
    DISSIPATING_LAWS,
    HAS_CURVED_LAW,
    case_with_4_arguments,
    case_with_5_arguments,
    select_function,
)
from tdint.kernels.stepping import Integrals, PathSegment
from tdint.kernels.stories.branches import advance, switch
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

# Maximum number of changes of branch up to a reversal; the laws of tdint have fewer
_MAX_BRANCHES = 16
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
MAX_POINTS = 16  # maximum number of Gauss points in one part of the path
# Number of Gauss points for laws that do not specify a number; the maximum in one part of the path
_DEFAULT_POINTS = 16.0
# Maximum number of Gauss points on a path. If Newton's method diverges, the change of drift is
# large and laws would request millions of points.
_MAX_POINTS = 32e3


def _gauss() -> tuple[np.ndarray, np.ndarray]:
    """Return nodes and weights of the Gauss-Legendre rules on [0, 1] with up to MAX_POINTS points.

    The rules are read from a table, so that all machines use equal numbers and no LAPACK call is
    needed at import. The table contains the result of NumPy's `leggauss` on [-1, 1]; each line
    contains the nodes and the weights of one rule.

    Returns
    -------
    nodes, weights : ndarray, shape (MAX_POINTS + 1, MAX_POINTS)
        Row n contains the n nodes or weights of the rule with n points, then zeros.
    """
    # Rule n is in row n, column 0 to n - 1; row 0 remains empty.
    nodes = np.zeros((MAX_POINTS + 1, MAX_POINTS))
    weights = np.zeros_like(nodes)
    lines = Path(__file__).with_name("gauss_legendre.txt").read_text(encoding="ascii").splitlines()
    for n, line in enumerate(lines, 1):
        numbers = np.array(list(map(float, line.split())))
        # Convert from the interval [-1, 1] to [0, 1].
        nodes[n, :n] = 0.5 * (numbers[:n] + 1.0)
        weights[n, :n] = 0.5 * numbers[n:]
    return nodes, weights


NODES, WEIGHTS = _gauss()


@inline
def _default_points(law_parameters, law_state, i, drift_change):
    """Return the number of Gauss points for curved laws that do not specify a number: a constant.

    A law can replace this function by a function `points` with the same arguments. The constant
    depends on none of the arguments.

    Parameters
    ----------
    law_parameters, law_state : ndarray
        Parameters and states of the hysteretic laws: one row per quantity, one column per story;
        not used.
    i : int
        Index of the story; not used.
    drift_change : float
        Length of the path, m; not used.
    """
    return _DEFAULT_POINTS


_points = select_function("points", case_with_4_arguments, _default_points)


@inline
def required_points(law_parameters, law_state, i, drift_change):
    """Return the number of Gauss points that the law of story `i` requires on a path.

    The law specifies the number (`_points`). It is at least 1, also if the function of a plug-in
    returns less or nan. It is limited to _MAX_POINTS because a diverging Newton iteration can
    produce an unrealistic change of drift.

    Parameters
    ----------
    law_parameters, law_state : ndarray
        Parameters and states of the hysteretic laws: one row per quantity, one column per story.
    i : int
        Index of the story.
    drift_change : float
        Length of the path (absolute change of drift of a path without reversal), m, or an upper
        bound of the length.

    Returns
    -------
    float
        Minimum number of points; not necessarily an integer.
    """
    return min(max(1.0, _points(law_parameters, law_state, i, drift_change)), _MAX_POINTS)


@inline
def _no_sharp_bend(law_parameters, law_state, i, block, side):
    """Return infinity: the distance to a kink of the force, for laws without a kink.

    A kink is a sharp bend of the force: the tangent stiffness changes rapidly near this point. A
    law with a kink defines a function `kink`, which replaces this function. It returns the change
    of drift from the state in `block` to the kink in the direction `side`, m, not negative;
    infinity if the kink is not on the path. The present function, for all other laws, uses no
    argument.

    Parameters
    ----------
    law_parameters, law_state : ndarray
        Parameters and states of the hysteretic laws: one row per quantity, one column per story.
    i : int
        Index of the story.
    block : int
        First row of the state in `law_state`: 0 for the committed state (the end of the last step
        or substep), otherwise the first row of a trial state.
    side : float
        Direction of loading, 1 or -1.
    """
    return math.inf


_distance_to_bend = select_function("kink", case_with_5_arguments, _no_sharp_bend)


@inline
def remains_on_branch(law_state, i, rise, bend):
    """Return True if story `i` remains on its current linear branch along the complete path.

    The drift along the path is d(t) = d0 + rise t + bend (t^2 - t) / 2, where d0 is the committed
    drift and t increases from 0 to 1 over the step. The branch ends if the drift exceeds UPPER or
    falls below LOWER, or if the rate d'(t) = rise + bend (t - 1/2) has the sign opposite to
    RATE_SIGN. The result is False for a curved law, which has no linear branch.

    Parameters
    ----------
    law_state : ndarray
        States of the hysteretic laws, one column per story. Rows of the committed state: DRIFT (m);
        SLOPE, stiffness of the branch (N/m), infinite for a curved law; UPPER and LOWER, limits of
        the branch (m); RATE_SIGN, 0 for a branch that is valid for both signs of the rate,
        otherwise 1 or -1.
    i : int
        Index of the story.
    rise, bend : float
        Coefficients of d(t), m.
    """
    if not law_state[rows.SLOPE, i] < math.inf:
        return False
    start_drift = law_state[rows.DRIFT, i]
    rate_sign = law_state[rows.RATE_SIGN, i]
    # These are the rates of the parabola at both endpoints times the length of the step, m.
    first_rate = rise - 0.5 * bend
    last_rate = rise + 0.5 * bend
    if rate_sign * first_rate < 0.0 or rate_sign * last_rate < 0.0:
        return False
    # The Bezier points of the parabola are d(0), d(0) + d'(0) / 2 and d(1). The parabola is between
    # their minimum and their maximum. If these are within the limits, the exact extremum is not
    # needed.
    middle_drift = start_drift + 0.5 * first_rate
    end_drift = start_drift + rise
    highest = max(start_drift, middle_drift, end_drift)
    lowest = min(start_drift, middle_drift, end_drift)
    if highest <= law_state[rows.UPPER, i] and lowest >= law_state[rows.LOWER, i]:
        return True
    # Otherwise replace the middle Bezier point by the drift at the extremum within the step, if
    # there is an extremum: d'(t) = rise + bend (t - 1/2) = 0.
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

    Parameters
    ----------
    rise : float
        Change of drift in the step, m.
    first_rate, last_rate : float
        Drift rates at both endpoints times the step, m.
    initial_slope : float
        Rate of change of the drift rate at the start times the squared step, m.

    Returns
    -------
    direction : float
        Direction of the initial movement, 1 or -1.
    first_reversal, second_reversal, third_reversal : float
        Fractions of the step in (0, 1) at which the rate changes its sign; 1 for no further
        reversal.
    min_extremum : float
        Minimum absolute rate at an extremum within the step, m. It is infinite if there is no
        extremum, or if the story starts from rest without an initial slope and has no reversal.
    """
    tolerance = _RATE_ROUNDING * (abs(rise) + abs(last_rate))
    if abs(first_rate) <= tolerance and abs(initial_slope) <= tolerance and rise * last_rate > 0.0:
        # Initial rate and slope are zero, and the story has no reversal. An example are the upper
        # stories of a building at rest: their rate is r1 t^m with the power m = 3 or higher. Its
        # integral, the rise, is r1 / (m + 1), so that c2 = (12 / (m + 1) - 3) r1. For m = 3, c2
        # consists of rounding errors; for larger m, c2 and the rate have opposite signs. In both
        # cases the cubic could have a reversal that the story does not have.
        return math.copysign(1.0, rise), 1.0, 1.0, 1.0, math.inf
    rate_change = last_rate - first_rate - initial_slope
    mean_excess = rise - first_rate - 0.5 * initial_slope
    c2 = 12.0 * mean_excess - 3.0 * rate_change
    c3 = 4.0 * rate_change - 12.0 * mean_excess
    # The rate first_rate + initial_slope t + c2 t^2 + c3 t^3 is monotonic between its extrema, the
    # roots of initial_slope + 2 c2 t + 3 c3 t^2 = 0. Each of the three intervals therefore contains
    # at most one zero. The roots q / (3 c3) and initial_slope / q are free of cancellation. The
    # conditions with abs() are true for roots between -1 and 1; they also exclude a division by
    # zero. Other roots are replaced by 1, and negative roots by 0. A replaced root only adds an
    # interval of zero length, which has no effect.
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
    # `initial_rate` has the sign of the rate immediately after the start. If the rate at the start
    # is zero, this is the sign of its slope. If the slope is also zero, it is the sign of the
    # change of drift.
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
        # The parts end at the first extremum, at the last extremum and at the end of the step.
        upper = first_extremum if part == 0 else last_extremum if part == 1 else 1.0
        rate = first_rate + upper * (initial_slope + upper * (c2 + upper * c3))
        if part < 2 and 0.0 < upper < 1.0:
            min_extremum = min(min_extremum, abs(rate))
        if previous_rate * rate < 0.0 and abs(rate) > tolerance:
            root = _find_zero((first_rate, initial_slope, c2, c3), lower, upper, rate)
            # Store the root in the first variable that is still 1.
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
    rise : float
        Change of drift in the step, m.
    first_rate, last_rate : float
        Drift rates at both endpoints times the step, m.
    """
    tolerance = _RATE_ROUNDING * (abs(rise) + abs(last_rate))
    return (rise * first_rate < 0.0 and abs(first_rate) > tolerance) or (
        rise * last_rate < 0.0 and abs(last_rate) > tolerance
    )


@inline
def _find_zero(cubic, lower, upper, value_at_upper):
    """Return the zero of a cubic in an interval; the cubic must be monotonic in the interval.

    The cubic is c0 + c1 t + c2 t^2 + c3 t^3.

    Newton's method is used. If a Newton iterate is not inside the interval, or if the slope is
    zero, the midpoint of the interval replaces the iterate (bisection). The iteration ends if a
    change of t is smaller than _ROOT, or after _MAX_ROOT_ITERATIONS iterations.

    Parameters
    ----------
    cubic : tuple of float
        Coefficients c0, c1, c2 and c3 of 1, t, t^2 and t^3.
    lower, upper : float
        Interval of t that contains the zero.
    value_at_upper : float
        Value of the cubic at `upper`; only its sign is used.
    """
    c0, c1, c2, c3 = cubic
    t = 0.5 * (lower + upper)
    # `lower` and `upper` enclose the zero. The value at `upper` always has the sign of
    # `value_at_upper`.
    for _ in range(_MAX_ROOT_ITERATIONS):
        value = c0 + t * (c1 + t * (c2 + t * c3))
        if value * value_at_upper < 0.0:
            lower = t
        else:
            upper = t
        slope = c1 + t * (2.0 * c2 + 3.0 * t * c3)
        # Without a slope, `new_t` is set to `lower`, which is not inside the interval. The next
        # line then selects the midpoint.
        new_t = t - value / slope if slope != 0.0 else lower
        new_t = new_t if lower < new_t < upper else 0.5 * (lower + upper)
        if abs(new_t - t) < _ROOT:
            return new_t
        t = new_t
    return t


@inline
def integrate_on_branch(law_state, i, rise, bend, scratch, out):
    """Compute mean, first moment and their derivatives for a story that remains on a linear branch.

    Along the path, the drift is d(t) = d0 + rise t + bend (t^2 - t) / 2, and t increases from 0 to
    1 over the step. With the force f0 at the start and the stiffness k of the branch, the force is
    f(t) = f0 + k (d(t) - d0), and

        mean   = int f dt              = f0 + k (rise / 2 - bend / 12)
        moment = 12 int (t - 1/2) f dt = k rise

    Parameters
    ----------
    law_state : ndarray
        States of the hysteretic laws, one column per story: committed rows SLOPE, k (N/m), and
        FORCE, f0 (N).
    i : int
        Index of the story.
    rise, bend : float
        Coefficients of d(t), m.
    scratch : ndarray
        Scratch array of the step: one row per quantity, one column per floor or story.
    out : int
        First of six consecutive rows of `scratch` that receive the results: MEAN and MOMENT (N),
        their derivatives with respect to the rise and to the bend (N/m).
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
    """Compute mean, first moment and their derivatives for story `i` along its parabola of drift.

    The integrals of the force f over the step, with t from 0 to 1, are

        d(t) = d0 + rise t + bend (t^2 - t) / 2
        mean = int f dt,   moment = 12 int (t - 1/2) f dt

    where d0 is the committed drift. The law follows the path in trial states, and the committed
    state is not changed. The function `commit_path_end` later commits the state at the end of the
    path. The integration depends on the type of the law:

        piecewise linear      exact on each branch (`_integrate_piecewise_linear`)
        curved, hysteretic    Gauss points before and after the reversal (`_integrate_hysteretic`)
        curved, elastic       Gauss points over the complete path (`_integrate`)

    Parameters
    ----------
    law_parameters, law_state : ndarray
        Parameters and states of the hysteretic laws: one row per quantity, one column per story.
        The committed state is read.
    i : int
        Index of the story.
    rise, bend : float
        Coefficients of d(t), m.
    no_reversal : bool
        True to ignore an extremum of the parabola, because the motion of the story has no reversal
        in the step. A piecewise-linear law does not change to an unloading branch; its force on the
        current branch is still evaluated at the drift of the parabola. Curved laws ignore the flag.
    scratch : ndarray
        Scratch array of the step: one row per quantity, one column per floor or story.
    out : int
        First of the rows of `scratch` that receive the results: MEAN and MOMENT (N), their
        derivatives with respect to the rise and to the bend (N/m). PATH_ROWS rows are used.
    """
    story_path = PathSegment(law_state[rows.DRIFT, i], rise, bend, 0.0, 1.0)
    results = Integrals(scratch, out)
    _clear(results, i)
    if is_piecewise_linear(law_parameters, i):
        _integrate_piecewise_linear(
            law_parameters,
            law_state,
            i,
            story_path,
            1.0 if no_reversal else time_of_extremum(story_path),
            results,
        )
    elif law_parameters[rows.CODE, i] in DISSIPATING_LAWS:
        _integrate_hysteretic(law_parameters, law_state, i, story_path, results)
    else:
        # Curved elastic law: one part from the committed state (block 0), with is_elastic = True.
        # The law receives the maximum rate of the path, |rise| + |bend| / 2 at t = 0 or t = 1, as
        # an upper bound of its length int |d'(t)| dt, which is at most |rise| + |bend| / 4.
        count = required_points(law_parameters, law_state, i, abs(rise) + 0.5 * abs(bend))
        _integrate(law_parameters, law_state, i, 0, True, count, story_path, results)


@outlined
def commit_path_end(law_parameters, law_state, i, rise):
    """Commit the state at the end of the path of the last call of `follow`.

    The drift at the end is the committed drift plus `rise`, because the parabola of drift
    d0 + rise t + bend (t^2 - t) / 2 has no contribution of the bend at t = 1.

    Parameters
    ----------
    law_parameters, law_state : ndarray
        Parameters and states of the hysteretic laws: one row per quantity, one column per story.
    i : int
        Index of the story.
    rise : float
        Change of drift along the path, m.
    """
    # Piecewise-linear law: FIRST_TRIAL already contains the state at the end.
    if is_piecewise_linear(law_parameters, i):
        copy(law_state, i, rows.FIRST_TRIAL, 0)
        return
    # Curved law: move to the end of the path. A hysteretic law starts from the
    # last Gauss point; `follow` has stored this state in FIRST_TRIAL (`_integrate_hysteretic`). An
    # elastic law starts from the committed state (0), because its force depends on the drift only.
    previous = rows.FIRST_TRIAL if law_parameters[rows.CODE, i] in DISSIPATING_LAWS else 0
    restoring_force_outlined(
        law_parameters, law_state, i, previous, rows.SECOND_TRIAL, law_state[rows.DRIFT, i] + rise
    )
    # Complete the dissipated energy in SECOND_TRIAL. The commit copies this row with the other rows
    # and adds no energy.
    accumulate_dissipation(law_parameters, law_state, i, previous, rows.SECOND_TRIAL)
    commit_without_dissipation(law_parameters, law_state, i, rows.SECOND_TRIAL)


@inline
def is_piecewise_linear(law_parameters, i):
    """Return True if all branches of the law of story `i` are linear.

    A law that is declared as curved can also have linear branches (a finite SLOPE in its state).
    Its path is integrated like the path of a curved law, because it can end on a curved branch.

    Parameters
    ----------
    law_parameters : ndarray
        Parameters of the hysteretic laws: one row per parameter, one column per story.
    i : int
        Index of the story.
    """
    return not HAS_CURVED_LAW or law_parameters[rows.CODE, i] not in CURVED_LAWS


@inline
def drift_at(segment, t):
    """Return the drift of a parabola at time `t`, m.

    d(t) = start + rise t + bend (t^2 - t) / 2, with t from 0 to 1 over the step; start, rise and
    bend are the coefficients in `segment`, m.
    """
    return segment.start + t * (segment.rise + 0.5 * segment.bend * (t - 1.0))


@inline
def path_segment(segment, begin, end):
    """Return the part of a parabola of drift from time `begin` to time `end`.

    `segment` is any part of the parabola start + rise t + bend (t^2 - t) / 2; its coefficients do
    not change. The times are fractions of the step, between 0 and 1.
    """
    return PathSegment(segment.start, segment.rise, segment.bend, begin, end)


@inline
def _clear(results, i):
    """Set the six results of story `i` to zero: mean and moment of the force and their derivatives.

    `results` contains the table and the first of the six rows.
    """
    for row in range(_RESULTS):
        results.table[results.first + row, i] = 0.0


@inline
def copy(law_state, i, source, target):
    """Copy the law state of story `i` from block `source` to block `target`.

    A block of `law_state` is a group of consecutive rows that describe a state: the committed state
    (block 0) or a trial state (FIRST_TRIAL, SECOND_TRIAL, THIRD_TRIAL). A law can have extra rows
    after all blocks, which are copied as well.

    Parameters
    ----------
    law_state : ndarray
        States of the hysteretic laws: one row per quantity, one column per story.
    i : int
        Index of the story.
    source : int
        First row of the block that is copied.
    target : int
        First row of the block that receives the copy.
    """
    for row in range(rows.LAW_STATE_ROWS):
        law_state[target + row, i] = law_state[source + row, i]
    copy_extra_rows(law_state, i, source, target)


@inline
def time_of_extremum(segment):
    """Return the time in (0, 1) of the extremum of a parabola of drift; 1 without an extremum.

    The parabola is d(t) = start + rise t + bend (t^2 - t) / 2, with t from 0 to 1 over the step.
    Its rate d'(t) = rise + bend (t - 1/2) is zero at t = 1/2 - rise / bend. `segment` contains the
    coefficients of the parabola, m; its times `begin` and `end` are not used.
    """
    if 2.0 * abs(segment.rise) >= abs(segment.bend):
        return 1.0
    t = 0.5 - segment.rise / segment.bend
    return t if 0.0 < t < 1.0 else 1.0


@inline
def _add(results, i, weight, t, force, tangent):
    """Add an integration point to mean and moment of the force and to their four derivatives.

    With the weight w, the force f and the tangent stiffness k at the point, the function adds

        to the mean      int f dt                 w f
        to the moment    12 int (t - 1/2) f dt    12 w (t - 1/2) f

    and to their derivatives with respect to the coefficients rise and bend the same expressions,
    with df/d(rise) = k t or df/d(bend) = k (t^2 - t) / 2 instead of f. These are k times the
    derivatives of the drift d0 + rise t + bend (t^2 - t) / 2.

    Parameters
    ----------
    results : Integrals
        Table, and the first of its six rows, to be increased: MEAN and MOMENT (N), and
        MEAN_BY_RISE, MEAN_BY_BEND, MOMENT_BY_RISE and MOMENT_BY_BEND (N/m).
    i : int
        Index of the story.
    weight : float
        Integration weight w; the weights of all points on the complete path have the sum 1.
    t : float
        Time of the point, as a fraction of the step.
    force, tangent : float
        Force f, N, and tangent stiffness k, N/m, at the point.
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
    """Add mean, moment and their derivatives after a reversal to the sums before the reversal.

    Mean and moment are the integrals mean = int f dt and moment = 12 int (t - 1/2) f dt of the
    story force f, with t from 0 to 1 over the step. Their derivatives are with respect to the
    coefficients rise and bend of the drift d(t) = d0 + rise t + bend (t^2 - t) / 2. The forces
    after the reversal at t = t_r depend on the drift d_r = d(t_r) at the reversal, which changes by
    t_r per unit of rise and by (t_r^2 - t_r) / 2 per unit of bend. This contribution to the
    derivatives is computed with a difference quotient. With the part M(d_r) of the mean after a
    reversal at the drift d_r, it is

        d M / d d_r = (M(d_r + shift) - M(d_r)) / shift

    The same applies to the moment.

    Parameters
    ----------
    results : Integrals
        Table, and the first of three groups of six rows. Each group contains MEAN, MOMENT (N) and
        their derivatives with respect to the rise and to the bend (N/m): before the reversal
        (receives the sums), after the reversal (_AFTER_REVERSAL), and after a reversal at a shifted
        drift (_SHIFTED).
    i : int
        Index of the story.
    reversal_time : float
        Time t_r of the reversal as a fraction of the step.
    shift : float
        Shift of the drift, m; 0 if the results do not depend on the drift at the reversal.
    """
    scratch, out = results
    for row in range(_RESULTS):
        scratch[out + row, i] += scratch[out + _AFTER_REVERSAL + row, i]
    if shift != 0.0:
        # Derivatives of mean and moment with respect to the drift at the reversal, N/m; this drift
        # changes by reversal_time per unit of rise and by `by_bend` per unit of bend.
        mean_by_drift = (
            scratch[out + _SHIFTED + MEAN, i] - scratch[out + _AFTER_REVERSAL + MEAN, i]
        ) / shift
        moment_by_drift = (
            scratch[out + _SHIFTED + MOMENT, i] - scratch[out + _AFTER_REVERSAL + MOMENT, i]
        ) / shift
        by_bend = 0.5 * (reversal_time * reversal_time - reversal_time)
        scratch[out + MEAN_BY_RISE, i] += mean_by_drift * reversal_time
        scratch[out + MEAN_BY_BEND, i] += mean_by_drift * by_bend
        scratch[out + MOMENT_BY_RISE, i] += moment_by_drift * reversal_time
        scratch[out + MOMENT_BY_BEND, i] += moment_by_drift * by_bend


# ---- Piecewise-linear laws


@inline
def time_to(limit, segment, t_now, direction):
    """Return the time that a story needs from time `t_now` to move to a drift limit.

    The drift is the parabola d(t) = start + rise t + bend (t^2 - t) / 2, with t from 0 to 1 over
    the step. With side = `direction`, three quantities are positive in the direction of movement:

        D = side (limit - d(t_now))             distance to the limit, m
        v = side (rise + bend (t_now - 1/2))    rate of the drift at `t_now`, m
        a = side bend                           rate of change of v, m

    The result x is the smallest positive root of v x + a x^2 / 2 = D. With the rate at the limit,
    R = sqrt(v^2 + 2 a D), the root has two forms:

        x = 2 D / (v + R) = (R - v) / a

    Both forms are equal, because R^2 - v^2 = 2 a D. The form without a difference of two nearly
    equal numbers is used: the first form for v >= 0, the second form for v < 0.

    - v >= 0 is the usual case: the story moves towards the limit. If a is negative, the story would
      later reverse and reach the limit a second time; x is the first time.
    - v < 0 and a > 0: the story first moves away from the limit, reverses, and then reaches it.
      The other root is negative. This case occurs if the caller ignores an extremum of the
      parabola. A negative v that is tiny compared with R is a rounding error and is replaced by 0.

    Callers ensure that the parabola reaches the limit after `t_now`, and limit the result to the
    end of their segment. Because of rounding errors, R^2 can still be negative, or v can be
    negative without a > 0; R or v is then replaced by 0, and x can exceed 1.

    The result is 0 if the limit has already been reached, and 1 (the complete step) if v and R are
    0, so that the story does not move.

    Parameters
    ----------
    limit : float
        Drift to be reached, m.
    segment : PathSegment
        Parabola of drift.
    t_now : float
        Time on the path, as a fraction of the step.
    direction : float
        Direction of the movement, 1 or -1.

    Returns
    -------
    float
        Time x as a fraction of the step.
    """
    rate = direction * (segment.rise + segment.bend * (t_now - 0.5))
    distance = direction * (limit - drift_at(segment, t_now))
    if not distance > 0.0:
        return 0.0
    root = math.sqrt(max(rate * rate + 2.0 * direction * segment.bend * distance, 0.0))
    # `rate`, `distance` and `root` are v, D and R of the docstring. The condition is the case v < 0
    # and a > 0, except for a v that is a rounding error.
    if -rate > _OPPOSITE_RATE * root and direction * segment.bend > 0.0:
        return (root - rate) / (direction * segment.bend)
    return 2.0 * distance / (max(rate, 0.0) + root) if max(rate, 0.0) + root > 0.0 else 1.0


def along_branches(add_part, process_end):
    """Return a compiled function that follows a part of a path without reversal, branch by branch.

    The path is a parabola of drift, d(t) = start + rise t + bend (t^2 - t) / 2, with t from 0 to 1
    over the step. The law is piecewise linear, and the drift has no reversal in the part.

    Parameters
    ----------
    add_part : function
        (law_state, i, block, segment, results). Called once for each branch on the path. `segment`
        is the part of the path on this branch. The state in `block` is on this branch.
    process_end : function
        (results, i, t, force). Called each time the drift passes the limit of a branch, with the
        time t (fraction of the step) and the force (N) at the limit. It is not called at the end of
        the path. It is also not called for the replacement of the first branch, if this branch is
        valid only for the opposite direction.

    Returns
    -------
    function
        (law_parameters, law_state, i, block, segment, side, target, results). The law state in
        `block` moves along `segment` in the direction `side` (0 for no movement) to the drift
        `target`, m. `results` (table, first row) is only passed to `add_part` and `process_end`.
    """

    @outlined
    def integrate_path(law_parameters, law_state, i, block, segment, side, target, results):
        """Move the law state of story `i` along a part of its path, branch by branch.

        The drift is d(t) = start + rise t + bend (t^2 - t) / 2 (coefficients in `segment`, t from 0
        to 1 over the step). A branch ends where d(t) reaches its limit UPPER (side = 1) or LOWER
        (side = -1).

        Parameters
        ----------
        law_parameters, law_state : ndarray
            Parameters and states of the hysteretic laws.
        i : int
            Index of the story.
        block : int
            First row of the block of `law_state` with the state at the start of the part. The state
            is moved to the end of the part.
        segment : PathSegment
            Part of the path without reversal.
        side : float
            Direction of the movement: 1, -1, or 0 for no movement.
        target : float
            Drift at the end of the part, m.
        results : Integrals
            Table and the first of its rows that `add_part` and `process_end` change. This function
            only passes them on.
        """
        if side == 0.0:
            add_part(law_state, i, block, segment, results)
            return
        # A branch that is valid only for the opposite direction ends at the start of the part.
        if law_state[block + rows.RATE_SIGN, i] * side < 0.0:
            switch(law_parameters, law_state, i, block, rows.REVERSED)
        t_now = segment.begin
        for branch_count in range(_MAX_BRANCHES + 1):
            limit = (
                law_state[block + rows.UPPER, i] if side > 0.0 else law_state[block + rows.LOWER, i]
            )
            leaves_branch = side * (target - limit) > 0.0
            if leaves_branch and branch_count == _MAX_BRANCHES:
                # The state has already left _MAX_BRANCHES branches, which is only possible for the
                # law of a plug-in. The loop must end: a force nan makes all results nan, so that
                # the step fails.
                law_state[block + rows.FORCE, i] = math.nan
                leaves_branch = False
            t_end = segment.end
            if leaves_branch:
                t_end = min(t_now + time_to(limit, segment, t_now, side), segment.end)
            # Process the part of the path on this branch, then move the state to its end.
            add_part(law_state, i, block, path_segment(segment, t_now, t_end), results)
            advance(law_parameters, law_state, i, block, limit if leaves_branch else target)
            if not leaves_branch:
                break
            # The drift reached a limit: set the next branch.
            process_end(results, i, t_end, law_state[block + rows.FORCE, i])
            switch(law_parameters, law_state, i, block, rows.ABOVE if side > 0.0 else rows.BELOW)
            t_now = t_end

    return integrate_path


@inline
def _add_on_branch(law_state, i, block, segment, results):
    """Add mean and moment of the force, and their derivatives, over a part of the path on a branch.

    Six quantities are added for the part of the path from time t_1 to t_2, where t from 0 to 1 is
    the time as a fraction of the step:

        mean      integral of f dt
        moment    12 times the integral of (t - 1/2) f dt
        derivatives of mean and moment with respect to the coefficients rise and bend of the drift

    The drift is d(t) = start + rise t + bend (t^2 - t) / 2. With drift d_b and force f_b of the
    state in `block` and the stiffness k = SLOPE of the linear branch, the force is
    f(t) = f_b + k (d(t) - d_b). The integrands are polynomials of at most third degree; the
    derivatives of f are k t and k (t^2 - t) / 2. Gauss integration with two points is exact for
    such polynomials.

    Parameters
    ----------
    law_state : ndarray
        States of the hysteretic laws: one row per quantity, one column per story.
    i : int
        Index of the story.
    block : int
        First row of the state in `law_state`: 0 for the committed state (the end of the last step
        or substep), otherwise the first row of a trial state. Any state on the branch is possible.
    segment : PathSegment
        Part of the path: start, rise and bend of d(t), m, and the times `begin` (t_1) and `end`
        (t_2).
    results : Integrals
        Table, and the first of its six rows, to be increased: mean and moment (N), the
        derivatives of the mean with respect to the rise and to the bend, and the same derivatives
        of the moment (N/m).
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
def _ignore_branch_end(results, i, t, force):
    """Ignore the end of a branch; `along_branches` calls this function if a limit is reached.

    `_add_on_branch` adds mean and moment of the force and their derivatives for the part of the
    path on each branch. No term is added at the end of a branch. No argument is used.

    Parameters
    ----------
    results : Integrals
        Scratch rows with mean and moment of the story force; not used.
    i : int
        Index of the story; not used.
    t : float
        Time of the end of the branch, as a fraction of the step from 0 to 1; not used.
    force : float
        Restoring force of the story at this time, N; not used.
    """
    pass


_integrate_over_branches = along_branches(_add_on_branch, _ignore_branch_end)


@inline
def _integrate_monotonic(law_parameters, law_state, i, block, segment, results):
    """Add mean, moment and their derivatives over a part of a path without reversal.

    The law is piecewise linear. Mean and moment of the force f are the integrals int f dt and
    12 int (t - 1/2) f dt over the part, with t from 0 to 1 over the step; the derivatives are with
    respect to rise and bend of the drift. The direction of the movement, `side`, is the sign of
    the change of drift from the start to the end of the part. Without a change, `side` is 0: the
    force of the current branch is then integrated over the part, and the state is not changed.

    Parameters
    ----------
    law_parameters, law_state : ndarray
        Parameters and states of the hysteretic laws: one row per quantity, one column per story.
    i : int
        Index of the story.
    block : int
        First row of the block of `law_state` with the state at the start of the part. The state is
        moved to the end of the part.
    segment : PathSegment
        Part of the parabola of drift, start + rise t + bend (t^2 - t) / 2.
    results : Integrals
        Table, and the first of its six rows: mean, moment (N) and their derivatives with respect to
        the rise and to the bend (N/m) are added.
    """
    target = drift_at(segment, segment.end)
    drift_change = target - drift_at(segment, segment.begin)
    side = math.copysign(1.0, drift_change) if drift_change != 0.0 else 0.0
    _integrate_over_branches(law_parameters, law_state, i, block, segment, side, target, results)


@outlined
def _integrate_piecewise_linear(law_parameters, law_state, i, story_path, reversal_time, results):
    """Compute mean, moment and their derivatives for a piecewise-linear law.

    The integrals of the force f over the step, with t from 0 to 1, are mean = int f dt and
    moment = 12 int (t - 1/2) f dt along the drift d(t) = d0 + rise t + bend (t^2 - t) / 2. The law
    follows the path in the trial state FIRST_TRIAL, first to the reversal, then to the end. If the
    branch changes at the reversal, the path after the reversal is followed a second time in
    SECOND_TRIAL, from a slightly shifted drift, for the derivatives.

    Parameters
    ----------
    law_parameters, law_state : ndarray
        Parameters and states of the hysteretic laws: one row per quantity, one column per story.
    i : int
        Index of the story.
    story_path : PathSegment
        Parabola of drift over the complete step: coefficients d0, rise and bend, m.
    reversal_time : float
        Time of the reversal as a fraction of the step; 1 for no reversal.
    results : Integrals
        Table, and the first of its six rows: mean, moment (N) and their derivatives with respect to
        the rise and to the bend (N/m) are added. The caller has set these rows to zero. The next
        twelve rows (offsets _AFTER_REVERSAL and _SHIFTED) are used for intermediate results.
    """
    # Follow the path before the reversal, from the committed state (block 0).
    copy(law_state, i, 0, rows.FIRST_TRIAL)
    _integrate_monotonic(
        law_parameters,
        law_state,
        i,
        rows.FIRST_TRIAL,
        path_segment(story_path, 0.0, reversal_time),
        results,
    )
    if reversal_time == 1.0:
        return
    after_reversal = Integrals(results.table, results.first + _AFTER_REVERSAL)
    shifted = Integrals(results.table, results.first + _SHIFTED)
    path_back = path_segment(story_path, reversal_time, 1.0)
    direction = math.copysign(1.0, story_path.bend)  # direction of the path after the reversal
    shift = 0.0
    # If the branch is valid for both directions, it does not change at the reversal, and its force
    # does not depend on the drift at the reversal. The shift 0 means that the derivatives have no
    # term for this drift. Otherwise this term is a difference quotient: (integrals after a shifted
    # reversal - integrals after the reversal) / shift, in `_add_after_reversal`. For the shifted
    # reversal, a copy of the state (SECOND_TRIAL) is moved further by a small shift, in the
    # direction of the path before the reversal.
    if law_state[rows.FIRST_TRIAL + rows.RATE_SIGN, i] * direction < 0.0:
        copy(law_state, i, rows.FIRST_TRIAL, rows.SECOND_TRIAL)
        shift = -direction * _SHIFT * (abs(story_path.rise) + abs(story_path.bend))
        advance(
            law_parameters,
            law_state,
            i,
            rows.SECOND_TRIAL,
            drift_at(story_path, reversal_time) + shift,
        )
        _clear(shifted, i)
        _integrate_monotonic(law_parameters, law_state, i, rows.SECOND_TRIAL, path_back, shifted)
    # Follow the path after the reversal, and add both parts.
    _clear(after_reversal, i)
    _integrate_monotonic(law_parameters, law_state, i, rows.FIRST_TRIAL, path_back, after_reversal)
    _add_after_reversal(results, i, reversal_time, shift)


# ---- Curved laws


def dividing_at_bend(integrate):
    """Return a compiled function that integrates a curved law along a path without reversal.

    The integrals of the force f are int f dt and 12 int (t - 1/2) f dt, and their derivatives,
    along the parabola of drift d(t) = start + rise t + bend (t^2 - t) / 2, with t from 0 to 1 over
    the step. The derivatives are with respect to the coefficients `rise` and `bend`; `bend` is the
    curvature of the drift. The path is divided at a kink (sharp bend) of the force. Near a kink,
    the tangent stiffness changes rapidly, and Gauss integration would be inaccurate.
    `_distance_to_bend` returns the change of drift up to the kink. In its name and in the name of
    this function, "bend" is the kink and not the coefficient `bend`.

    Parameters
    ----------
    integrate : function
        (law_parameters, law_state, i, previous, is_elastic, count, segment, results) -> block.
        Integrates along one part by `count` Gauss points (`_integrate`).

    Returns
    -------
    function
        (law_parameters, law_state, i, previous, segment, results) -> block of the state at the last
        Gauss point. The path starts from the state in block `previous`.
    """

    @outlined
    def integrate_path(law_parameters, law_state, i, previous, segment, results):
        """Integrate a curved law along a path without reversal, in two parts if the force has a
        kink on the path.

        At a kink, the tangent stiffness changes rapidly; `_distance_to_bend` returns the change of
        drift up to the kink, or infinity. The integrals of the force f are int f dt and
        12 int (t - 1/2) f dt. The drift is d(t) = start + rise t + bend (t^2 - t) / 2, with the
        coefficients in `segment`, and t from 0 to 1 over the step. The coefficient `bend` is not
        related to the kink. The state at the start of the path is in block `previous` of
        `law_state`. `integrate` adds the integrals of each part, and their derivatives with respect
        to `rise` and `bend`, to `results`.

        The argument False of `integrate` is its `is_elastic`: the state of the law advances from
        each Gauss point to the next, because only hysteretic laws are divided. Column `i` of
        `law_parameters` and `law_state` belongs to the story.

        Returns
        -------
        int
            First row of the block of `law_state` with the state at the last Gauss point.
        """
        start_drift = drift_at(segment, segment.begin)
        drift_change = drift_at(segment, segment.end) - start_drift
        side = math.copysign(1.0, drift_change)
        drift_change = abs(drift_change)
        begin = segment.begin
        # First part: from the start to the kink of the force, if the kink is on the path.
        # `kink_distance` is the change of drift from the state in `previous` to the kink, m. This
        # state is at `start_drift`. Only for the difference quotient after a reversal, it differs
        # by the shift of the reversal (`_integrate_hysteretic`), which is negligible.
        kink_distance = _distance_to_bend(law_parameters, law_state, i, previous, side)
        if kink_distance < drift_change:
            count = required_points(law_parameters, law_state, i, kink_distance)
            t_end = min(
                begin + time_to(start_drift + side * kink_distance, segment, begin, side),
                segment.end,
            )
            previous = integrate(
                law_parameters,
                law_state,
                i,
                previous,
                False,
                count,
                path_segment(segment, begin, t_end),
                results,
            )
            begin = t_end
            drift_change -= kink_distance
        # Integrate along the remaining part, or along the complete path without a kink.
        count = required_points(law_parameters, law_state, i, drift_change)
        return integrate(
            law_parameters,
            law_state,
            i,
            previous,
            False,
            count,
            path_segment(segment, begin, segment.end),
            results,
        )

    return integrate_path


@outlined
def _integrate(law_parameters, law_state, i, previous, is_elastic, count, segment, results):
    """Add mean, moment and their derivatives of a curved law over a part of a path.

    Mean and moment of the force f are the integrals mean = int f dt and moment =
    12 int (t - 1/2) f dt over the part. The drift is d(t) = start + rise t + bend (t^2 - t) / 2
    (coefficients in `segment`, t from 0 to 1 over the step). The derivatives of f with respect to
    rise and bend are the tangent stiffness times t and times (t^2 - t) / 2. The integration uses at
    least `count` Gauss points. The part is divided equally so that no division has more than
    MAX_POINTS points. For a hysteretic law, the energy dissipated from point to point is added to
    the trial state (`accumulate_dissipation`).

    Parameters
    ----------
    law_parameters, law_state : ndarray
        Parameters and states of the hysteretic laws: one row per quantity, one column per story.
    i : int
        Index of the story.
    previous : int
        First row of the block of `law_state` with the state at the start. An elastic law does not
        use it.
    is_elastic : bool
        True for an elastic law. The state of a hysteretic law advances from each Gauss point to the
        next.
    count : float
        Minimum number of Gauss points, positive.
    segment : PathSegment
        Part of the path.
    results : Integrals
        Table, and the first of its six rows: mean, moment (N) and their derivatives with respect to
        the rise and to the bend (N/m) are added.

    Returns
    -------
    int
        First row of the block of `law_state` with the state at the last Gauss point.
    """
    scratch, out = results
    # Distribute the points evenly: `divisions` equal parts with `points` Gauss points each.
    divisions = math.ceil(count / MAX_POINTS)
    points = math.ceil(count / divisions)
    length = (segment.end - segment.begin) / divisions
    mean = moment = 0.0
    mean_by_rise = mean_by_bend = moment_by_rise = moment_by_bend = 0.0
    trial = rows.FIRST_TRIAL
    for division in range(divisions):
        for point in range(points):
            t = segment.begin + length * (division + NODES[points, point])
            # The state of a hysteretic law moves from one block to the other at each point.
            if not is_elastic:
                trial = rows.FIRST_TRIAL if previous != rows.FIRST_TRIAL else rows.SECOND_TRIAL
            tangent = restoring_force(
                law_parameters, law_state, i, previous, trial, drift_at(segment, t)
            )
            if not is_elastic:
                accumulate_dissipation(law_parameters, law_state, i, previous, trial)
                previous = trial
            # Contribution of the point; `force`, `by_rise` and `by_bend` include its weight.
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


_integrate_divided = dividing_at_bend(_integrate)


@outlined
def _integrate_hysteretic(law_parameters, law_state, i, story_path, results):
    """Compute mean, moment and their derivatives for a curved hysteretic law, such as Bouc-Wen.

    The integrals of the force f over the step, with t from 0 to 1, are mean = int f dt and moment =
    12 int (t - 1/2) f dt along the drift d(t) = d0 + rise t + bend (t^2 - t) / 2. The path is
    integrated to the reversal, where d'(t) = 0, and from there to the end. The forces after the
    reversal also depend on the drift at the reversal. For the derivative with respect to this
    drift, the path after the reversal is integrated a second time, from a slightly shifted drift.
    FIRST_TRIAL finally contains the state at the last Gauss point.

    Parameters
    ----------
    law_parameters, law_state : ndarray
        Parameters and states of the hysteretic laws: one row per quantity, one column per story.
    i : int
        Index of the story.
    story_path : PathSegment
        Parabola of drift over the complete step: coefficients d0, rise and bend, m.
    results : Integrals
        Table, and the first of its six rows: mean, moment (N) and their derivatives with respect to
        the rise and to the bend (N/m) are added. The caller has set these rows to zero. The next
        twelve rows (offsets _AFTER_REVERSAL and _SHIFTED) are used for intermediate results.
    """
    reversal_time = time_of_extremum(story_path)
    previous = _integrate_divided(
        law_parameters, law_state, i, 0, path_segment(story_path, 0.0, reversal_time), results
    )
    if reversal_time < 1.0:
        after_reversal = Integrals(results.table, results.first + _AFTER_REVERSAL)
        shifted = Integrals(results.table, results.first + _SHIFTED)
        path_back = path_segment(story_path, reversal_time, 1.0)
        # Store the state at the reversal in THIRD_TRIAL and at the shifted reversal in FIRST_TRIAL.
        # `previous` is the block with the state at the last Gauss point before the reversal. The
        # shift continues the path past the reversal, in the same direction. The drift at the
        # reversal is a minimum for a positive `bend`, so that the shift is negative, and otherwise
        # a maximum.
        drift = drift_at(story_path, reversal_time)
        restoring_force_outlined(law_parameters, law_state, i, previous, rows.THIRD_TRIAL, drift)
        accumulate_dissipation(law_parameters, law_state, i, previous, rows.THIRD_TRIAL)
        shift = -math.copysign(_SHIFT, story_path.bend) * (
            abs(story_path.rise) + abs(story_path.bend)
        )
        restoring_force_outlined(
            law_parameters, law_state, i, rows.THIRD_TRIAL, rows.FIRST_TRIAL, drift + shift
        )
        # `_integrate_divided` stores the states at the Gauss points alternately in FIRST_TRIAL and
        # SECOND_TRIAL. An integration from the actual reversal would therefore overwrite the state
        # at the shifted reversal in FIRST_TRIAL. For this reason, the path from the shifted
        # reversal is integrated first. This integration does not change THIRD_TRIAL, the start of
        # the second integration.
        _clear(shifted, i)
        _integrate_divided(law_parameters, law_state, i, rows.FIRST_TRIAL, path_back, shifted)
        _clear(after_reversal, i)
        previous = _integrate_divided(
            law_parameters, law_state, i, rows.THIRD_TRIAL, path_back, after_reversal
        )
        _add_after_reversal(results, i, reversal_time, shift)
    # `commit_path_end` expects the state at the last Gauss point in FIRST_TRIAL.
    if previous != rows.FIRST_TRIAL:
        copy(law_state, i, previous, rows.FIRST_TRIAL)
