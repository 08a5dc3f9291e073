"""A power-law dashpot along a parabola of drift, on which the drift rate is linear: mean and first
moment of its force.

Gauss points. Towards rest the force bends sharply, so the path is cut where the rate changes its
sign, and a part on which the rate grows from little is measured by the cube root of the rate; the
force is then good to about 1e-6. Whatever the error, the dashpot takes energy: weights are
positive, and at each point force times rate is.
"""

from __future__ import annotations

from typing import NamedTuple

from tdint.kernels.compiling import inline, outlined
from tdint.kernels.linear_terms import power_damper
from tdint.kernels.stepping import Array
from tdint.kernels.stories import path

STEADY = 0.5  # least rate over the largest up to which the rate itself will do
STEADY_POINTS = 6  # where the rate itself will do
POINTS = 12  # towards rest, by the cube root of the rate: 1e-6 of the force


class _Move(NamedTuple):
    """A parabola of drift over a step of h, and where its integrals go: rows of a table, those of
    the whole story and those of the dashpot alone."""

    rise: float
    bend: float
    h: float
    scratch: Array
    whole: int
    own: int


def cut_at_rest(part):
    """A function (linear_terms, i, move) that goes over a parabola by `part` (linear_terms, i,
    move, slow, fast): from s = slow to s = fast, where the rate is larger and of the same sign."""

    @inline
    def over_parts(linear_terms, i, move):
        first = move.rise - 0.5 * move.bend  # h times the rates at the ends
        last = move.rise + 0.5 * move.bend
        if first * last < 0.0:
            rest = -move.rise / move.bend
            part(linear_terms, i, move, rest, -0.5)
            part(linear_terms, i, move, rest, 0.5)
        elif abs(first) < abs(last):
            part(linear_terms, i, move, -0.5, 0.5)
        else:
            part(linear_terms, i, move, 0.5, -0.5)

    return over_parts


@inline
def _add(linear_terms, i, move, s, weight):
    rise, bend, h, scratch, whole, rows = move
    force, slope = power_damper(linear_terms, i, (rise + bend * s) / h)
    moment = 12.0 * weight * s
    scratch[rows + path.MEAN, i] += weight * force
    scratch[rows + path.MOMENT, i] += moment * force
    scratch[whole + path.MEAN_BY_RISE, i] += weight * slope / h
    scratch[whole + path.MEAN_BY_BEND, i] += weight * slope * s / h
    scratch[whole + path.MOMENT_BY_RISE, i] += moment * slope / h
    scratch[whole + path.MOMENT_BY_BEND, i] += moment * slope * s / h


@outlined
def _part(linear_terms, i, move, slow, fast):
    least = abs(move.rise + move.bend * slow)
    largest = abs(move.rise + move.bend * fast)
    length = abs(fast - slow)
    if least >= STEADY * largest:
        for point in range(STEADY_POINTS):
            s = slow + (fast - slow) * path.NODES[STEADY_POINTS, point]
            _add(linear_terms, i, move, s, length * path.WEIGHTS[STEADY_POINTS, point])
        return
    root = (least / largest) ** (1.0 / 3.0) if least > 0.0 else 0.0
    whole = 1.0 - root * root * root
    for point in range(POINTS):
        x = root + (1.0 - root) * path.NODES[POINTS, point]
        s = slow + (fast - slow) * (x * x * x - root * root * root) / whole
        _add(
            linear_terms,
            i,
            move,
            s,
            length * 3.0 * x * x / whole * (1.0 - root) * path.WEIGHTS[POINTS, point],
        )


_over_parts = cut_at_rest(_part)


@outlined
def follow_dashpot(linear_terms, i, h, rise, bend, scratch, whole, rows):
    """Mean and moment of the dashpot's force along the path (as in `path.follow`) into `rows` and
    the row behind; they and the tangents are added to the rows from `whole` on."""
    move = _Move(rise, bend, h, scratch, whole, rows)
    scratch[rows + path.MEAN, i] = 0.0
    scratch[rows + path.MOMENT, i] = 0.0
    _over_parts(linear_terms, i, move)
    scratch[whole + path.MEAN, i] += scratch[rows + path.MEAN, i]
    scratch[whole + path.MOMENT, i] += scratch[rows + path.MOMENT, i]
