"""A power-law dashpot along a parabola of drift, on which the drift rate is linear: mean and first moment of its force.

Gauss points. Towards rest the force bends sharply, so the path is cut where the rate changes its sign, and a part on
which the rate grows from little is measured by the cube root of the rate; the force is then good to about 1e-6.
Whatever the error, the dashpot takes energy: weights are positive, and at each point force times rate is.
"""

from __future__ import annotations

from tdint.kernels.chain import power_damper
from tdint.kernels.compiling import called, inlined
from tdint.kernels.stories.path import (
    MEAN,
    MEAN_BY_BEND,
    MEAN_BY_RISE,
    MOMENT,
    MOMENT_BY_BEND,
    MOMENT_BY_RISE,
    NODES,
    WEIGHTS,
)

_STEADY = 0.5  # least rate over the largest up to which the rate itself will do
_STEADY_POINTS = 6
_POINTS = 12


@called
def follow_dashpot(chain, i, h, rise, bend, work, path, own):
    """Mean and moment of the dashpot's force along the path (as in `path.follow`) into rows `own` and `own` + 1; they
    and the tangents are added to the rows from `path` on."""
    work[own + MEAN, i] = 0.0
    work[own + MOMENT, i] = 0.0
    first = rise - 0.5 * bend  # h times the rates at the ends
    last = rise + 0.5 * bend
    if first * last < 0.0:
        rest = -rise / bend
        _part(chain, i, h, rise, bend, rest, -0.5, work, path, own)
        _part(chain, i, h, rise, bend, rest, 0.5, work, path, own)
    elif abs(first) < abs(last):
        _part(chain, i, h, rise, bend, -0.5, 0.5, work, path, own)
    else:
        _part(chain, i, h, rise, bend, 0.5, -0.5, work, path, own)
    work[path + MEAN, i] += work[own + MEAN, i]
    work[path + MOMENT, i] += work[own + MOMENT, i]


@called
def _part(chain, i, h, rise, bend, slow, fast, work, path, own):
    """The part of the path between s = `slow` and s = `fast`, where the rate is larger and of the same sign."""
    least = abs(rise + bend * slow)
    largest = abs(rise + bend * fast)
    length = abs(fast - slow)
    if least >= _STEADY * largest:
        for point in range(_STEADY_POINTS):
            s = slow + (fast - slow) * NODES[_STEADY_POINTS, point]
            _add(chain, i, h, rise, bend, s, length * WEIGHTS[_STEADY_POINTS, point], work, path, own)
        return
    root = (least / largest) ** (1.0 / 3.0) if least > 0.0 else 0.0
    whole = 1.0 - root * root * root
    for point in range(_POINTS):
        x = root + (1.0 - root) * NODES[_POINTS, point]
        s = slow + (fast - slow) * (x * x * x - root * root * root) / whole
        weight = length * 3.0 * x * x / whole * (1.0 - root) * WEIGHTS[_POINTS, point]
        _add(chain, i, h, rise, bend, s, weight, work, path, own)


@inlined
def _add(chain, i, h, rise, bend, s, weight, work, path, own):
    force, slope = power_damper(chain, i, (rise + bend * s) / h)
    moment = 12.0 * weight * s
    work[own + MEAN, i] += weight * force
    work[own + MOMENT, i] += moment * force
    work[path + MEAN_BY_RISE, i] += weight * slope / h
    work[path + MEAN_BY_BEND, i] += weight * slope * s / h
    work[path + MOMENT_BY_RISE, i] += moment * slope / h
    work[path + MOMENT_BY_BEND, i] += moment * slope * s / h
