"""Steel law of Menegotto and Pinto (1973), with the isotropic part of Filippou, Popov and Bertero
(1983): `Steel02` of OpenSees.

Each reversal at (d_r, f_r) towards the side q (1 or -1) starts a curve that has the initial slope k
and approaches the line of the slope b k. Both lines intersect in the corner (d_0, f_0). With the
extremes d_max and d_min of the reversals, at first dy and -dy:

    S = 1 + a3 ((d_max - d_min) / (2 a4 dy))^0.8 for q = 1; a1, a2 for q = -1
    d_0 = (q Fy S (1 - b) - f_r + k d_r) / (k (1 - b)),   f_0 = f_r + k (d_0 - d_r)
    f = f_r + k (d - d_r) (b + (1 - b) / (1 + |e|^R)^(1/R)),   e = (d - d_r) / (d_0 - d_r)
    R = R0 (1 - cR1 xi / (cR2 + xi)),   xi = |d_p - d_0| / dy

d_p is d_max for q = 1, otherwise d_min. The first curve has d_r = f_r = 0, the corner (q dy, q Fy)
and R = R0; a reversal at rest starts it anew (`is_at_rest`). A short reversal starts a
curve as well: the force can then exceed the force without the reversal by some percent, which
belongs to the published law.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

from tdint.kernels import layout as rows
from tdint.kernels.laws.law import (
    DriftLaw,
    LawFunctions,
    LawParameter,
    hardening_stiffness,
    yields_at_its_strength,
)

# Rows of `law_parameters` with the parameters of the law: yield force (N), hardening ratio b,
# transition R0, cR1, cR2, and isotropic part a1 to a4.
_YIELD_FORCE = rows.FIRST_PARAMETER
_HARDENING = rows.FIRST_PARAMETER + 1
_R0 = rows.FIRST_PARAMETER + 2
_CR1 = rows.FIRST_PARAMETER + 3
_CR2 = rows.FIRST_PARAMETER + 4
_A1 = rows.FIRST_PARAMETER + 5

# Rows of a state: work (DISSIPATED, J), extremes of the reversals (HIGH_DRIFT, LOW_DRIFT, relative
# to dy and -dy), last reversal d_r (m) and f_r (N), and two extra rows: d_0 - d_r (m) and R.
_FROM_DRIFT = rows.HIGH_FORCE
_FROM_FORCE = rows.LOW_FORCE
_EXTRA_ROWS = 2

_MIN_REACH = 1e-12
"""Fraction of dy. Minimum |d_0 - d_r|, for a reversal on the line of the slope b k."""
_PANEL = 0.25
"""Length of the parts of the quadrature of the work in e; beyond e = 1, a fraction of e. With
eight points in each part and R up to 20, the error of the work is below 1e-9 Fy dy."""
_NO_FORCE = 1e-9
"""Fraction of the yield force that is regarded as zero; the error of the stored energy is the
square of this fraction."""
_MAX_ITERATIONS = 60
_USUAL_R0 = (10.0, 20.0)


def _functions() -> LawFunctions:
    """Return the compiled functions of the law."""
    import numpy as np

    from tdint.kernels.compiling import inline, outlined
    from tdint.kernels.laws.branch_following import copy_extra_rows, extra_rows, is_at_rest

    nodes, weights = np.polynomial.legendre.leggauss(8)

    @inline
    def on_curve(law_parameters, i, curve, drift):
        """Return force (N) and tangent (N/m) at a drift of a curve: the tuple d_r (m), f_r (N),
        d_0 - d_r (m) and R."""
        from_drift, from_force, reach, power = curve
        k = law_parameters[rows.STIFFNESS, i]
        b = law_parameters[_HARDENING, i]
        change = drift - from_drift
        e = abs(change / reach)
        # (1 + e^R)^(1/R) without overflow for large e
        if e <= 1.0:
            ratio = e**power
            root = (1.0 + ratio) ** (1.0 / power)
            share = 1.0 / (1.0 + ratio)
        else:
            ratio = (1.0 / e) ** power
            root = e * (1.0 + ratio) ** (1.0 / power)
            share = ratio / (1.0 + ratio)
        force = from_force + k * change * (b + (1.0 - b) / root)
        return force, k * (b + (1.0 - b) * share / root)

    @inline
    def current_curve(law_state, i, block):
        """Return the curve of a state."""
        own = extra_rows(law_state, block)
        return (
            law_state[block + _FROM_DRIFT, i],
            law_state[block + _FROM_FORCE, i],
            law_state[own, i],
            law_state[own + 1, i],
        )

    @outlined
    def curve_after_reversal(law_parameters, law_state, i, block, side):
        """Return the extremes after a reversal towards a side at the current point, and d_0 - d_r
        and R of the curve that starts at that point."""
        k = law_parameters[rows.STIFFNESS, i]
        b = law_parameters[_HARDENING, i]
        strength = law_parameters[_YIELD_FORCE, i]
        yield_drift = strength / k
        drift = law_state[block + rows.DRIFT, i]
        # The rows contain the excess over the initial extremes dy and -dy.
        high = max(law_state[block + rows.HIGH_DRIFT, i], drift - yield_drift)
        low = min(law_state[block + rows.LOW_DRIFT, i], drift + yield_drift)
        first = _A1 + 2 if side > 0.0 else _A1
        increase = law_parameters[first, i]
        if increase > 0.0:
            width = (high - low + 2.0 * yield_drift) / (
                2.0 * law_parameters[first + 1, i] * yield_drift
            )
            strength *= 1.0 + increase * width**0.8
        reach = side * strength * (1.0 - b) - law_state[block + rows.FORCE, i] + b * k * drift
        reach /= k * (1.0 - b)
        farthest = high + yield_drift if side > 0.0 else low - yield_drift
        xi = abs(farthest - drift - reach) / yield_drift
        power = law_parameters[_R0, i] * (
            1.0 - law_parameters[_CR1, i] * xi / (law_parameters[_CR2, i] + xi)
        )
        if abs(reach) < _MIN_REACH * yield_drift:
            reach = _MIN_REACH * yield_drift
        return high, low, reach, power

    @outlined
    def start_curve(law_parameters, law_state, i, block, side):
        """Start the curve towards a side at the current point."""
        yield_drift = law_parameters[_YIELD_FORCE, i] / law_parameters[rows.STIFFNESS, i]
        # Only the first curve starts at the origin.
        if (
            law_state[block + _FROM_DRIFT, i] == 0.0
            and law_state[block + _FROM_FORCE, i] == 0.0
            and is_at_rest(law_state, i, block, yield_drift)
        ):
            reach = side * yield_drift
            power = law_parameters[_R0, i]
        else:
            high, low, reach, power = curve_after_reversal(
                law_parameters, law_state, i, block, side
            )
            law_state[block + rows.HIGH_DRIFT, i] = high
            law_state[block + rows.LOW_DRIFT, i] = low
            law_state[block + _FROM_DRIFT, i] = law_state[block + rows.DRIFT, i]
            law_state[block + _FROM_FORCE, i] = law_state[block + rows.FORCE, i]
        law_state[block + rows.RATE_SIGN, i] = side
        own = extra_rows(law_state, block)
        law_state[own, i] = reach
        law_state[own + 1, i] = power

    @inline
    def copy_curve(law_state, i, source, target):
        """Copy the curve and its direction from a state to another one."""
        for row in range(rows.RATE_SIGN, rows.WORK):
            law_state[target + row, i] = law_state[source + row, i]
        copy_extra_rows(law_state, i, source, target)

    @outlined
    def force(law_parameters, law_state, i, previous, trial, drift):
        """Compute the force at a drift; return the tangent stiffness, N/m."""
        copy_curve(law_state, i, previous, trial)
        change = drift - law_state[previous + rows.DRIFT, i]
        side = law_state[previous + rows.RATE_SIGN, i]
        if side == 0.0 and change == 0.0:
            law_state[trial + rows.FORCE, i] = law_state[previous + rows.FORCE, i]
            return law_parameters[rows.STIFFNESS, i]
        if side == 0.0 or side * change < 0.0:
            law_state[trial + rows.DRIFT, i] = law_state[previous + rows.DRIFT, i]
            law_state[trial + rows.FORCE, i] = law_state[previous + rows.FORCE, i]
            start_curve(law_parameters, law_state, i, trial, math.copysign(1.0, change))
            law_state[trial + rows.DRIFT, i] = drift
        new_force, tangent = on_curve(law_parameters, i, current_curve(law_state, i, trial), drift)
        law_state[trial + rows.FORCE, i] = new_force
        return tangent

    @outlined
    def work_along(law_parameters, i, curve, start, end):
        """Return the work on a curve between two drifts, J."""
        work = 0.0
        while start != end:
            panel = _PANEL * max(abs(curve[2]), abs(start - curve[0]))
            half = 0.5 * min(panel, abs(end - start))
            step = math.copysign(half, end - start)
            for point in range(8):
                drift = start + step * (1.0 + nodes[point])
                work += step * weights[point] * on_curve(law_parameters, i, curve, drift)[0]
            start = end if 2.0 * half >= abs(end - start) else start + 2.0 * step
        return work

    @outlined
    def strain_energy(law_parameters, law_state, i):
        """Return the energy that unloading to zero force releases, J. During loading, it is the
        area below the curve that a reversal would start.

        A curve becomes softer with the distance from its start. Newton's method therefore
        approaches the zero of its force from one side.
        """
        drift = law_state[rows.DRIFT, i]
        force = law_state[rows.FORCE, i]
        if force == 0.0:
            return 0.0
        curve = current_curve(law_state, i, rows.COMMITTED)
        side = math.copysign(1.0, -force)
        if side * law_state[rows.RATE_SIGN, i] <= 0.0:
            _, _, reach, power = curve_after_reversal(law_parameters, law_state, i, 0, side)
            curve = (drift, force, reach, power)
        limit = _NO_FORCE * law_parameters[_YIELD_FORCE, i]
        end = drift
        for _ in range(_MAX_ITERATIONS):
            force, tangent = on_curve(law_parameters, i, curve, end)
            end -= force / tangent
            if abs(force) <= limit:
                break
        return -work_along(law_parameters, i, curve, drift, end)

    @inline
    def hysteretic_energy(law_parameters, law_state, i):
        """Return the work minus the stored energy, J."""
        return law_state[rows.DISSIPATED, i] - strain_energy(law_parameters, law_state, i)

    @outlined
    def accumulate_dissipation(law_parameters, law_state, i, previous, trial):
        """Add the work on the current curve; the stored energy is subtracted when the dissipated
        energy is requested."""
        start, end = law_state[previous + rows.DRIFT, i], law_state[trial + rows.DRIFT, i]
        work = work_along(law_parameters, i, current_curve(law_state, i, trial), start, end)
        law_state[trial + rows.DISSIPATED, i] = law_state[previous + rows.DISSIPATED, i] + work

    @inline
    def keep(law_parameters, law_state, i, previous, trial):
        """Commit the curve and its direction."""
        copy_curve(law_state, i, trial, rows.COMMITTED)

    @inline
    def switch(law_parameters, law_state, i, block, event):
        """Start a curve at a reversal."""
        start_curve(law_parameters, law_state, i, block, -law_state[block + rows.RATE_SIGN, i])

    @inline
    def points(law_parameters, law_state, i, drift_change):
        """Return the number of Gauss points on a path: the corner is sharp for a large R."""
        yield_drift = law_parameters[_YIELD_FORCE, i] / law_parameters[rows.STIFFNESS, i]
        return 3.0 + 1.2 * law_parameters[_R0, i] * drift_change / yield_drift

    return LawFunctions(
        force=force,
        strain_energy=strain_energy,
        hysteretic_energy=hysteretic_energy,
        accumulate_dissipation=accumulate_dissipation,
        keep=keep,
        switch=switch,
        points=points,
    )


def _warning(stiffness: float, values: Sequence[float]) -> str | None:
    """Return a warning about an unusual transition."""
    low, high = _USUAL_R0
    if low <= values[2] <= high:
        return None
    return f"R0 of the transition is usually {low:g} to {high:g}, got {values[2]:.4g}"


LAW = DriftLaw(
    "steel",
    "Menegotto-Pinto curves from each reversal to the line of the slope `hardening` k, with "
    "isotropic hardening: smooth hysteresis of steel (Steel02)",
    _functions,
    parameters=(
        LawParameter("yield_force", force=1, low=0.0, low_allowed=False),
        LawParameter("hardening", low=0.0, high=1.0, high_allowed=False),
        LawParameter("R0", low=0.0, low_allowed=False, group="transition", default=20.0),
        LawParameter(
            "cR1", low=0.0, high=1.0, high_allowed=False, group="transition", default=0.925
        ),
        LawParameter("cR2", low=0.0, low_allowed=False, group="transition", default=0.15),
        LawParameter("a1", low=0.0, group="isotropic", default=0.0),
        LawParameter("a2", low=0.0, low_allowed=False, group="isotropic", default=1.0),
        LawParameter("a3", low=0.0, group="isotropic", default=0.0),
        LawParameter("a4", low=0.0, low_allowed=False, group="isotropic", default=1.0),
    ),
    kinked=True,
    curved=True,
    equal_directions=lambda values: values[-4:-2] == values[-2:],  # a1, a2 and a3, a4
    extra_rows=_EXTRA_ROWS,
    warning=_warning,
    yield_drift=yields_at_its_strength,
    stiffness_after_yield=hardening_stiffness,
)
