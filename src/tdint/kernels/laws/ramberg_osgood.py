"""Ramberg-Osgood law (Ramberg and Osgood 1943) with the branches of Masing (1926).

The skeleton curve is d / dy = x (1 + alpha |x|^(n - 1)) with x = f / fy and the yield drift
dy = fy / k. After a reversal at (d_r, f_r), the story follows the curve of twice the size:

    (d - d_r) / (2 dy) = y (1 + alpha |y|^(n - 1)),   y = (f - f_r) / (2 fy)

A branch ends at the point that closes a loop: at the last reversal on its side, or, for the first
reversal, at the opposite point of the skeleton curve. From there the story follows the earlier
branch, or the skeleton curve (Jennings 1964). The points of reversal of all open loops are extra
rows; row INTERNAL is their number. The law is the limit of infinitely many parallel
elastic-perfectly plastic springs (Iwan 1966), which determine the dissipated energy:

    skeleton curve      alpha (n - 1) / (n + 1) x^(n + 1) fy dy
    branch            2 alpha (n - 1) / (n + 1) y^(n + 1) fy dy

The stored energy is the work minus this energy. `tdint.kernels.laws.law.LawFunctions` describes the
functions and their arguments.
"""

from __future__ import annotations

import math

from tdint.kernels import layout as rows
from tdint.kernels.laws.law import DriftLaw, LawFunctions, LawParameter, yields_at_its_strength

# Yield force (N), alpha and exponent n in `law_parameters`.
_YIELD_FORCE = rows.FIRST_PARAMETER
_ALPHA = rows.FIRST_PARAMETER + 1
_EXPONENT = rows.FIRST_PARAMETER + 2

_MAX_REVERSALS = 40
"""Maximum number of points of reversal, an even number. If there are more open loops, the smallest
one is forgotten: a decaying vibration leaves a loop inside each loop."""
_REACHED = 1e-9
"""Fraction of a loop. A path that ends closer to the end of the loop remains on its branch: the
tangent stiffness at a located end then does not depend on rounding."""
_AT_END = 1e-3
"""Fraction of a loop. Time steps locate its end with a far smaller error."""
_MAX_ITERATIONS = 60
"""Newton's method converges in about six iterations; near the start of a branch in one."""


def _functions() -> LawFunctions:
    """Return the compiled functions of the law."""
    from tdint.kernels.compiling import inline, outlined
    from tdint.kernels.laws.branch_following import extra_rows

    @outlined
    def relative_force(relative_drift, alpha, n):
        """Return y for a relative drift t = y (1 + alpha y^(n - 1)); both are not negative.

        Newton's method starts above the solution and decreases, because the curve is convex.
        """
        t = relative_drift
        y = t
        if alpha > 0.0 and t > 0.0:
            y = min(t, (t / alpha) ** (1.0 / n))
        for _ in range(_MAX_ITERATIONS):
            power = alpha * y ** (n - 1.0)
            new_y = y - (y * (1.0 + power) - t) / (1.0 + n * power)
            if not new_y < y:
                break
            y = new_y
        return y

    @inline
    def branch_start(law_state, i, block):
        """Return drift and force of the last reversal, and the size of the branch: 2, or 1 on the
        skeleton curve, which starts at the origin."""
        count = int(law_state[block + rows.INTERNAL, i])
        if count == 0:
            return 0.0, 0.0, 1.0
        row = extra_rows(law_state, block) + 2 * (count - 1)
        return law_state[row, i], law_state[row + 1, i], 2.0

    @inline
    def loop_end(law_state, i, block):
        """Return drift and force at which the branch closes a loop; infinite on the skeleton
        curve."""
        count = int(law_state[block + rows.INTERNAL, i])
        first = extra_rows(law_state, block)
        if count == 0:
            return math.inf, math.inf
        if count == 1:
            return -law_state[first, i], -law_state[first + 1, i]
        return law_state[first + 2 * (count - 2), i], law_state[first + 2 * (count - 2) + 1, i]

    @inline
    def close_loop(law_state, i, block):
        """Forget the points of reversal of the smallest loop."""
        law_state[block + rows.INTERNAL, i] = max(law_state[block + rows.INTERNAL, i] - 2.0, 0.0)

    @inline
    def reverse(law_state, i, block):
        """Start a branch at the current point."""
        if law_state[block + rows.INTERNAL, i] >= _MAX_REVERSALS:
            close_loop(law_state, i, block)
        row = extra_rows(law_state, block) + 2 * int(law_state[block + rows.INTERNAL, i])
        law_state[row, i] = law_state[block + rows.DRIFT, i]
        law_state[row + 1, i] = law_state[block + rows.FORCE, i]
        law_state[block + rows.INTERNAL, i] += 1.0
        law_state[block + rows.RATE_SIGN, i] = -law_state[block + rows.RATE_SIGN, i]

    @inline
    def set_limits(law_state, i, block):
        """Set the limit of the branch: the end of its loop."""
        side = law_state[block + rows.RATE_SIGN, i]
        end, _ = loop_end(law_state, i, block)
        law_state[block + rows.UPPER, i] = end if side > 0.0 else math.inf
        law_state[block + rows.LOWER, i] = end if side < 0.0 and end < math.inf else -math.inf

    @inline
    def copy_reversals(law_state, i, source, target):
        """Copy direction and points of reversal."""
        law_state[target + rows.INTERNAL, i] = law_state[source + rows.INTERNAL, i]
        law_state[target + rows.RATE_SIGN, i] = law_state[source + rows.RATE_SIGN, i]
        from_row, to_row = extra_rows(law_state, source), extra_rows(law_state, target)
        for row in range(2 * int(law_state[source + rows.INTERNAL, i])):
            law_state[to_row + row, i] = law_state[from_row + row, i]

    @outlined
    def move(law_parameters, law_state, i, block, drift):
        """Move the state in `block` along its branch to a drift, and add work and dissipation.

        Returns the slope of the branch divided by k.
        """
        yield_force = law_parameters[_YIELD_FORCE, i]
        alpha = law_parameters[_ALPHA, i]
        n = law_parameters[_EXPONENT, i]
        yield_drift = yield_force / law_parameters[rows.STIFFNESS, i]
        start_drift, start_force, scale = branch_start(law_state, i, block)
        side = law_state[block + rows.RATE_SIGN, i]
        unit_force = scale * yield_force
        unit_drift = scale * yield_drift
        y0 = max(side * (law_state[block + rows.FORCE, i] - start_force) / unit_force, 0.0)
        y1 = relative_force(max(side * (drift - start_drift) / unit_drift, 0.0), alpha, n)
        # Integrals of dt, y dt and of the dissipation over the branch, t = y + alpha y^n.
        p0, p1 = alpha * y0**n, alpha * y1**n
        drift_change = y1 + p1 - (y0 + p0)
        moment = 0.5 * (y1 * y1 - y0 * y0) + n / (n + 1.0) * (p1 * y1 - p0 * y0)
        law_state[block + rows.WORK, i] += unit_drift * (
            side * start_force * drift_change + unit_force * moment
        )
        law_state[block + rows.DISSIPATED, i] += (
            unit_drift * yield_force * (n - 1.0) / (n + 1.0) * (p1 * y1 - p0 * y0)
        )
        law_state[block + rows.DRIFT, i] = drift
        law_state[block + rows.FORCE, i] = start_force + side * unit_force * y1
        return 1.0 / (1.0 + n * alpha * y1 ** (n - 1.0))

    @outlined
    def force(law_parameters, law_state, i, previous, trial, drift):
        """Follow the branches to a drift; return the tangent stiffness."""
        copy_reversals(law_state, i, previous, trial)
        for row in (rows.DRIFT, rows.FORCE, rows.DISSIPATED, rows.WORK):
            law_state[trial + row, i] = law_state[previous + row, i]
        change = drift - law_state[previous + rows.DRIFT, i]
        side = 1.0 if change >= 0.0 else -1.0
        if law_state[trial + rows.RATE_SIGN, i] == 0.0:
            law_state[trial + rows.RATE_SIGN, i] = side
        elif law_state[trial + rows.RATE_SIGN, i] * change < 0.0:
            reverse(law_state, i, trial)
        side = law_state[trial + rows.RATE_SIGN, i]
        for _ in range(_MAX_REVERSALS):
            start, _, _ = branch_start(law_state, i, trial)
            end, end_force = loop_end(law_state, i, trial)
            if end == math.inf or side * (drift - end) <= _REACHED * abs(end - start):
                break
            move(law_parameters, law_state, i, trial, end)
            law_state[trial + rows.FORCE, i] = end_force
            close_loop(law_state, i, trial)
        return law_parameters[rows.STIFFNESS, i] * move(law_parameters, law_state, i, trial, drift)

    @inline
    def strain_energy(law_parameters, law_state, i):
        """Return the energy stored in the springs of Iwan's model."""
        return law_state[rows.WORK, i] - law_state[rows.DISSIPATED, i]

    @inline
    def accumulate_dissipation(law_parameters, law_state, i, previous, trial):
        """Do nothing: `force` has set DISSIPATED."""

    @inline
    def keep(law_parameters, law_state, i, previous, trial):
        """Commit work, direction, points of reversal and the limit of the branch."""
        if trial != rows.COMMITTED:
            copy_reversals(law_state, i, trial, rows.COMMITTED)
            law_state[rows.WORK, i] = law_state[trial + rows.WORK, i]
        set_limits(law_state, i, rows.COMMITTED)

    @inline
    def switch(law_parameters, law_state, i, block, event):
        """Start a branch at a reversal, or close a loop.

        `force` has already closed the loop if the drift is slightly outside the branch.
        """
        if event == rows.REVERSED:
            reverse(law_state, i, block)
        else:
            start, _, _ = branch_start(law_state, i, block)
            end, _ = loop_end(law_state, i, block)
            if abs(end - law_state[block + rows.DRIFT, i]) <= _AT_END * abs(end - start):
                close_loop(law_state, i, block)
        set_limits(law_state, i, block)

    @inline
    def kink(law_parameters, law_state, i, block, side):
        """Return the change of drift up to the end of the loop."""
        count = int(law_state[block + rows.INTERNAL, i])
        if side == law_state[block + rows.RATE_SIGN, i]:
            end, _ = loop_end(law_state, i, block)
        elif count > 0:
            # After a reversal, the loop ends at the start of the current branch.
            end, _, _ = branch_start(law_state, i, block)
        else:
            end = -law_state[block + rows.DRIFT, i]
        return side * (end - law_state[block + rows.DRIFT, i]) if abs(end) < math.inf else math.inf

    return LawFunctions(
        force=force,
        strain_energy=strain_energy,
        accumulate_dissipation=accumulate_dissipation,
        keep=keep,
        switch=switch,
        kink=kink,
    )


LAW = DriftLaw(
    "ramberg-osgood",
    "skeleton curve d / dy = f / Fy (1 + alpha |f / Fy|^(n - 1)), dy = Fy / k; branches of twice "
    "the size after reversals (Masing): smooth hysteresis without a strength",
    _functions,
    parameters=(
        LawParameter("yield_force", force=1, low=0.0, low_allowed=False),
        LawParameter("alpha", low=0.0, low_allowed=False),
        LawParameter("exponent", low=1.0, high=100.0, low_allowed=False),
    ),
    kinked=True,
    concave=True,
    equal_directions=lambda values: True,
    curved=True,
    extra_rows=2 * _MAX_REVERSALS,
    yield_drift=yields_at_its_strength,
)
