"""Force of a power-law dashpot on a parabola of drift: mean and first moment.

The drift rate is linear on the parabola. The integrals are computed with Gauss points. Near zero
rate the force has a sharp bend. The path is therefore divided where the rate changes its sign, and
on a part with a large ratio of the rates the integration variable is the cube root of the rate. The
error is then about 1e-6 of the force. The dashpot dissipates energy for any integration error,
because the weights and the product of force and rate are positive at each point.
"""

from __future__ import annotations

from typing import NamedTuple

from tdint.kernels.compiling import inline, outlined
from tdint.kernels.linear_terms import power_damper
from tdint.kernels.stepping import Array
from tdint.kernels.stories import path

STEADY = 0.5  # ratio of minimum to maximum rate from which on the rate is the integration variable
STEADY_POINTS = 6  # Gauss points if the rate is the integration variable
POINTS = 12  # Gauss points in the cube root of the rate; error about 1e-6 of the force


class _Move(NamedTuple):
    """Parabola of drift over a step, and the rows of its integrals.

    Attributes
    ----------
    rise, bend : float
        Coefficients of the parabola, m (see `tdint.kernels.stories.path`).
    h : float
        Length of the step, s.
    scratch : ndarray
        Scratch array of the step.
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


def split_at_zero_rate(part):
    """Return a function that integrates over a parabola of drift in parts without change of sign of
    the rate.

    Parameters
    ----------
    part : function
        (linear_terms, i, move, slow, fast). Integrates over a part from s = slow, where the
        absolute rate is smaller, to s = fast.

    Returns
    -------
    function
        (linear_terms, i, move).
    """

    @inline
    def over_parts(linear_terms, i, move):
        """Integrate over the parts of the path."""
        first_rate = move.rise - 0.5 * move.bend  # h times the rates at both endpoints
        last_rate = move.rise + 0.5 * move.bend
        if first_rate * last_rate < 0.0:
            zero_rate = -move.rise / move.bend
            part(linear_terms, i, move, zero_rate, -0.5)
            part(linear_terms, i, move, zero_rate, 0.5)
        elif abs(first_rate) < abs(last_rate):
            part(linear_terms, i, move, -0.5, 0.5)
        else:
            part(linear_terms, i, move, 0.5, -0.5)

    return over_parts


@inline
def _add(linear_terms, i, move, s, weight):
    """Add a point of the path to the integrals and their tangents.

    Parameters
    ----------
    linear_terms : ndarray
        Linear terms of the building (`tdint.kernels.layout`).
    i : int
        Index of the story.
    move : _Move
        Path and rows.
    s : float
        Position on the path, between -1/2 and 1/2.
    weight : float
        Integration weight.
    """
    rise, bend, h, scratch, story_rows, dashpot_rows = move
    force, slope = power_damper(linear_terms, i, (rise + bend * s) / h)
    moment = 12.0 * weight * s
    scratch[dashpot_rows + path.MEAN, i] += weight * force
    scratch[dashpot_rows + path.MOMENT, i] += moment * force
    scratch[story_rows + path.MEAN_BY_RISE, i] += weight * slope / h
    scratch[story_rows + path.MEAN_BY_BEND, i] += weight * slope * s / h
    scratch[story_rows + path.MOMENT_BY_RISE, i] += moment * slope / h
    scratch[story_rows + path.MOMENT_BY_BEND, i] += moment * slope * s / h


@outlined
def _part(linear_terms, i, move, slow, fast):
    """Add the part of the path from s = `slow` to s = `fast` to the integrals.

    Parameters
    ----------
    linear_terms : ndarray
        Linear terms of the building (`tdint.kernels.layout`).
    i : int
        Index of the story.
    move : _Move
        Path and rows.
    slow, fast : float
        Endpoints of the part, with the smaller and the larger absolute rate.
    """
    minimum = abs(move.rise + move.bend * slow)
    largest = abs(move.rise + move.bend * fast)
    length = abs(fast - slow)
    if minimum >= STEADY * largest:
        for point in range(STEADY_POINTS):
            s = slow + (fast - slow) * path.NODES[STEADY_POINTS, point]
            _add(linear_terms, i, move, s, length * path.WEIGHTS[STEADY_POINTS, point])
        return
    root = (minimum / largest) ** (1.0 / 3.0) if minimum > 0.0 else 0.0
    story_rows = 1.0 - root * root * root
    for point in range(POINTS):
        x = root + (1.0 - root) * path.NODES[POINTS, point]
        s = slow + (fast - slow) * (x * x * x - root * root * root) / story_rows
        _add(
            linear_terms,
            i,
            move,
            s,
            length * 3.0 * x * x / story_rows * (1.0 - root) * path.WEIGHTS[POINTS, point],
        )


_over_parts = split_at_zero_rate(_part)


@outlined
def follow_dashpot(linear_terms, i, h, rise, bend, scratch, story_rows, dashpot_rows):
    """Compute mean and first moment of the dashpot force along a path.

    Parameters
    ----------
    linear_terms : ndarray
        Linear terms of the building (`tdint.kernels.layout`).
    i : int
        Index of the story.
    h : float
        Time step, s.
    rise, bend : float
        Coefficients of the parabola, m (see `tdint.kernels.stories.path`).
    scratch : ndarray
        Scratch array of the step.
    story_rows : int
        First row of the integrals of the story. The integrals and tangents of the dashpot are
        added.
    dashpot_rows : int
        Row of the mean force of the dashpot, N. The first moment is stored in the next row.
    """
    move = _Move(rise, bend, h, scratch, story_rows, dashpot_rows)
    scratch[dashpot_rows + path.MEAN, i] = 0.0
    scratch[dashpot_rows + path.MOMENT, i] = 0.0
    _over_parts(linear_terms, i, move)
    scratch[story_rows + path.MEAN, i] += scratch[dashpot_rows + path.MEAN, i]
    scratch[story_rows + path.MOMENT, i] += scratch[dashpot_rows + path.MOMENT, i]
