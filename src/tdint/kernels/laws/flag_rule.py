"""Flag rule: an elastic force between an upper and a lower curve (Christopoulos and others 2008).

With the upper curve U(x), the lower curve L(x) and the stiffness k between them, for x >= 0:

    hi(d) = U(d) for d >= 0, -L(-d) for d < 0;   lo(d) = L(d) for d >= 0, -U(-d) for d < 0
    f' = k d' if lo(d) <= f <= hi(d); otherwise f remains on the curve

The curves of both sides can differ. The force follows a curve in the direction of movement if its
slope is less than k, and the curve behind it if its slope exceeds k. In the functions below, drifts
and forces with a `side` are positive in the direction of movement.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

from tdint.kernels import layout as rows
from tdint.kernels.laws.peak_rule import TOLERANCE, BackboneCurve

_ON_CURVE = 1e-9
"""Fraction of the force. A force that is closer to a curve is regarded as on the curve."""

_PARALLEL = 1e-9
"""Fraction of k. A curve whose slope differs less from k is parallel to the elastic line."""


class FlagRule(NamedTuple):
    """Functions of the rule, as in `tdint.kernels.laws.law.LawFunctions`."""

    switch: Any
    strain_energy: Any
    enter: Any


def flag_rule(upper: BackboneCurve, lower: BackboneCurve, elastic_stiffness: Any) -> FlagRule:
    """Return the functions of a law that follows the flag rule.

    `elastic_stiffness` is a function (law_parameters, i) -> k, N/m.
    """
    from tdint.kernels.compiling import inline, outlined
    from tdint.kernels.laws.branch_following import set_branch, set_directed

    def bound(ahead, behind):
        """Return the functions `value` and `piece` of a curve in the direction of movement.

        `ahead` is the curve at positive drifts, `behind` the mirrored curve at negative drifts.
        """

        @inline
        def inner_segment(law_parameters, i, side, size):
            """Return the segment of the curve behind zero drift that ends at, or contains, the
            drift -`size`."""
            return behind.segment(law_parameters, i, -side, size * (1.0 - 4.0 * TOLERANCE))

        @outlined
        def value(law_parameters, i, side, x):
            """Return the force of the curve at a drift, N."""
            if x >= 0.0:
                j = ahead.segment(law_parameters, i, side, x)
                return ahead.force(law_parameters, i, side, j, x)
            j = inner_segment(law_parameters, i, side, -x)
            return -behind.force(law_parameters, i, -side, j, -x)

        @outlined
        def piece(law_parameters, i, side, x):
            """Return slope (N/m) and end (m) of the segment that follows a drift."""
            if x >= 0.0:
                j = ahead.segment(law_parameters, i, side, x)
                return ahead.slope(law_parameters, i, side, j), ahead.end(
                    law_parameters, i, side, j
                )
            j = inner_segment(law_parameters, i, side, -x)
            end = 0.0
            if j > 0:
                end = -behind.end(law_parameters, i, -side, j - 1)
            return behind.slope(law_parameters, i, -side, j), end

        return value, piece

    high_value, high_piece = bound(upper, lower)
    low_value, low_piece = bound(lower, upper)

    @outlined
    def elastic_end(law_parameters, i, side, x, force):
        """Return the drift at which the elastic line through a point leaves the space between the
        curves; infinite if it does not leave it."""
        k = elastic_stiffness(law_parameters, i)
        nearest = math.inf
        for curve in range(2):
            start = x
            while start < nearest:
                line = force + k * (start - x)
                if curve == 0:
                    slope, end = high_piece(law_parameters, i, side, start)
                    distance = high_value(law_parameters, i, side, start) - line
                    closing = k - slope
                else:
                    slope, end = low_piece(law_parameters, i, side, start)
                    distance = line - low_value(law_parameters, i, side, start)
                    closing = slope - k
                distance = max(distance, 0.0)
                if closing > _PARALLEL * k and distance <= closing * (end - start):
                    nearest = min(nearest, start + distance / closing)
                    break
                start = end
        return nearest

    @outlined
    def set_elastic(law_parameters, law_state, i, block):
        """Set the elastic branch through the current point, which is valid in both directions."""
        drift = law_state[block + rows.DRIFT, i]
        force = law_state[block + rows.FORCE, i]
        law_state[block + rows.INTERNAL, i] = 0.0
        high = elastic_end(law_parameters, i, 1.0, drift, force)
        low = -elastic_end(law_parameters, i, -1.0, -drift, -force)
        set_branch(law_state, i, block, elastic_stiffness(law_parameters, i), low, high, 0.0)

    @outlined
    def switch(law_parameters, law_state, i, block, event):
        """Follow a curve in the direction of movement, or the elastic line between the curves."""
        side = -law_state[block + rows.RATE_SIGN, i] if event == rows.REVERSED else event
        x = side * law_state[block + rows.DRIFT, i]
        force = side * law_state[block + rows.FORCE, i]
        k = elastic_stiffness(law_parameters, i)
        high = high_value(law_parameters, i, side, x)
        low = low_value(law_parameters, i, side, x)
        high_slope, high_end = high_piece(law_parameters, i, side, x)
        low_slope, low_end = low_piece(law_parameters, i, side, x)
        tolerance = _ON_CURVE * (abs(force) + k * abs(x))
        if high - force <= tolerance and high_slope < k * (1.0 - _PARALLEL):
            force, slope, end = high, high_slope, high_end
        elif force - low <= tolerance and low_slope > k * (1.0 + _PARALLEL):
            force, slope, end = low, low_slope, low_end
        else:
            set_elastic(law_parameters, law_state, i, block)
            return
        law_state[block + rows.FORCE, i] = side * force
        set_directed(law_state, i, block, side, 1.0, slope, end)

    @outlined
    def strain_energy(law_parameters, law_state, i):
        """Return the energy that a return to zero drift releases, J: the area below the elastic
        line down to the lower curve, and below this curve."""
        drift = law_state[rows.DRIFT, i]
        side = 1.0 if drift >= 0.0 else -1.0
        x = abs(drift)
        force = side * law_state[rows.FORCE, i]
        k = elastic_stiffness(law_parameters, i)
        energy = 0.0
        j = lower.segment(law_parameters, i, side, x * (1.0 - 4.0 * TOLERANCE))
        while True:
            start = lower.end(law_parameters, i, side, j - 1) if j > 0 else 0.0
            slope = lower.slope(law_parameters, i, side, j)
            distance = max(force - lower.force(law_parameters, i, side, j, x), 0.0)
            step = x - start
            if k > slope:
                step = min(step, distance / (k - slope))
            # Along the elastic line, then along the lower curve
            energy += step * (force - 0.5 * k * step)
            x -= step
            force = max(force - k * step, 0.0)
            if x > start:
                energy += (x - start) * (force - 0.5 * slope * (x - start))
                force -= slope * (x - start)
                x = start
            if j == 0:
                return energy
            j -= 1

    @inline
    def enter(law_parameters, law_state, i):
        """Set the first branch, through the origin."""
        set_elastic(law_parameters, law_state, i, 0)

    return FlagRule(switch, strain_energy, enter)
