"""Mean and first moment of the force of a power-law dashpot along a parabola of drift.

Along the parabola d0 + rise t + bend (t^2 - t) / 2, with t from 0 to 1 over the step of length h,
the drift rate is (rise + bend s) / h, with s = t - 1/2. The integrals of the dashpot force f are
mean = int f ds and moment = 12 int s f ds, with s from -1/2 to 1/2. They are computed by Gauss
integration. Near zero rate the force has a kink. The path is therefore divided where the rate
changes its sign. On a part where the rate varies strongly, the integration variable is the cube
root of the rate. The error is then about 1e-6 of the force. The dashpot dissipates energy for any
integration error, because the weights and the product of force and rate are positive at each point.
"""

from __future__ import annotations

from typing import NamedTuple

from tdint.kernels.compiling import inline, outlined
from tdint.kernels.linear_terms import power_damper
from tdint.kernels.stepping import Array
from tdint.kernels.stories import path

# Dimensionless. If the ratio of the minimum to the maximum absolute rate on a part is at least this
# value, the integration variable is the rate; otherwise it is the cube root of the rate.
_MIN_RATE_RATIO = 0.5
# Number of Gauss points with the rate and with its cube root as integration variable; the error is
# about 1e-6 of the force
_POINTS_IN_RATE = 6
_POINTS_IN_CUBE_ROOT = 12


class _DashpotPath(NamedTuple):
    """Parabola of drift over a step of length h, and the scratch rows of the integrals along it.

    Attributes
    ----------
    story_rows : int
        First row of the integrals and tangents of the story.
    dashpot_rows : int
        First of the two rows with mean and moment of the dashpot force only.
    """

    rise: float
    bend: float
    h: float
    scratch: Array
    story_rows: int
    dashpot_rows: int


@inline
def _add_point(linear_terms, i, dashpot_path, s, weight):
    """Add one integration point at the position `s` to the integrals of the dashpot force and to
    their derivatives; the weights of all points on the path have the sum 1.

    The rate changes by 1 / h per unit of rise and by s / h per unit of bend.
    """
    rise, bend, h, scratch, story_rows, dashpot_rows = dashpot_path
    # with respect to the drift rate, N s/m
    force, derivative = power_damper(linear_terms, i, (rise + bend * s) / h)
    moment_weight = 12.0 * weight * s  # 12 int s f ds
    scratch[dashpot_rows + path.MEAN, i] += weight * force
    scratch[dashpot_rows + path.MOMENT, i] += moment_weight * force
    scratch[story_rows + path.MEAN_BY_RISE, i] += weight * derivative / h
    scratch[story_rows + path.MEAN_BY_BEND, i] += weight * derivative * s / h
    scratch[story_rows + path.MOMENT_BY_RISE, i] += moment_weight * derivative / h
    scratch[story_rows + path.MOMENT_BY_BEND, i] += moment_weight * derivative * s / h


@outlined
def _integrate_part(linear_terms, i, dashpot_path, slow, fast):
    """Add the integrals of the dashpot force over the part of the path between the positions s =
    `slow` and s = `fast`.

    The absolute rate is smaller at `slow` than at `fast`; `slow` can be later than `fast`.

    If the rate is not nearly constant, the Gauss rule is applied to x, the cube root of the rate
    divided by the maximum rate. x increases from x_0 (at `slow`) to 1 (at `fast`), and

        s     = slow + (fast - slow) (x^3 - x_0^3) / (1 - x_0^3)
        ds/dx = (fast - slow) 3 x^2 / (1 - x_0^3)
    """
    # h times the absolute drift rates at both endpoints of the part, m
    min_rate = abs(dashpot_path.rise + dashpot_path.bend * slow)
    max_rate = abs(dashpot_path.rise + dashpot_path.bend * fast)
    length = abs(fast - slow)
    if min_rate >= _MIN_RATE_RATIO * max_rate:
        for point in range(_POINTS_IN_RATE):
            s = slow + (fast - slow) * path.NODES[_POINTS_IN_RATE, point]
            _add_point(
                linear_terms, i, dashpot_path, s, length * path.WEIGHTS[_POINTS_IN_RATE, point]
            )
        return
    # The weight of a point is |ds/dx| times the range 1 - x_0 times the weight of the Gauss rule.
    cube_root = (min_rate / max_rate) ** (1.0 / 3.0) if min_rate > 0.0 else 0.0
    cube_range = 1.0 - cube_root * cube_root * cube_root
    for point in range(_POINTS_IN_CUBE_ROOT):
        x = cube_root + (1.0 - cube_root) * path.NODES[_POINTS_IN_CUBE_ROOT, point]
        s = slow + (fast - slow) * (x * x * x - cube_root * cube_root * cube_root) / cube_range
        weight = length * 3.0 * x * x / cube_range * (1.0 - cube_root)
        weight *= path.WEIGHTS[_POINTS_IN_CUBE_ROOT, point]
        _add_point(linear_terms, i, dashpot_path, s, weight)


@inline
def _integrate_path(linear_terms, i, dashpot_path):
    """Add the integrals of the dashpot force over the path, in two parts if the rate changes its
    sign."""
    # h times the drift rates at both endpoints of the step, m
    first_rate = dashpot_path.rise - 0.5 * dashpot_path.bend
    last_rate = dashpot_path.rise + 0.5 * dashpot_path.bend
    if first_rate * last_rate < 0.0:
        # Both parts start at zero rate, their smaller absolute rate.
        s_zero = -dashpot_path.rise / dashpot_path.bend
        _integrate_part(linear_terms, i, dashpot_path, s_zero, -0.5)
        _integrate_part(linear_terms, i, dashpot_path, s_zero, 0.5)
    elif abs(first_rate) < abs(last_rate):
        _integrate_part(linear_terms, i, dashpot_path, -0.5, 0.5)
    else:
        _integrate_part(linear_terms, i, dashpot_path, 0.5, -0.5)


@outlined
def follow_dashpot(linear_terms, i, h, rise, bend, scratch, story_rows, dashpot_rows):
    """Compute mean and first moment of the dashpot force along a path, and add them to the story
    force.

    Row `dashpot_rows` and the next row receive mean and moment. They and their derivatives are
    added to the rows of the story from `story_rows` on.
    """
    dashpot_path = _DashpotPath(rise, bend, h, scratch, story_rows, dashpot_rows)
    scratch[dashpot_rows + path.MEAN, i] = 0.0
    scratch[dashpot_rows + path.MOMENT, i] = 0.0
    # The integrals are stored separately first, the derivatives are added to the rows of the story.
    _integrate_path(linear_terms, i, dashpot_path)
    scratch[story_rows + path.MEAN, i] += scratch[dashpot_rows + path.MEAN, i]
    scratch[story_rows + path.MOMENT, i] += scratch[dashpot_rows + path.MOMENT, i]
