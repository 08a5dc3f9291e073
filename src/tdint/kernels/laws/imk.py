"""The law of Ibarra, Medina and Krawinkler (2005), modified by Lignos and Krawinkler (2012):
capping and deterioration.

The backbone of each side rises to the yield point, on to the capping point, falls to a residual
force, and ends at the ultimate drift. Reloading goes towards the last peak or the farthest point
(peak-oriented), or first, with less force, to a point near zero drift (pinching). With the work
done on the story the strength, the capping line, the reloading point and the unloading stiffness of
a side deteriorate at each passage of zero force or at each turn, by

    beta = ((work since the last passage of zero force) / (Lambda Fy - work before))^exponent

A story whose beta exceeds 1, or whose drift exceeds the ultimate one, carries nothing from then on.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

from tdint.kernels import layout as rows
from tdint.kernels.laws.law import DriftLaw, LawFunctions, LawParameter, yields_at_its_strength

# Parameters: those of the positive side, of the negative one, of both
_YIELD_FORCE = rows.FIRST_PARAMETER
_PLASTIC_DRIFT = rows.FIRST_PARAMETER + 1
_POST_CAPPING_DRIFT = rows.FIRST_PARAMETER + 2
_CAPPING_RATIO = rows.FIRST_PARAMETER + 3
_RESIDUAL_RATIO = rows.FIRST_PARAMETER + 4
_ULTIMATE_DRIFT = rows.FIRST_PARAMETER + 5
_RATE = rows.FIRST_PARAMETER + 6
_SIDE = 7
_OF_STRENGTH = rows.FIRST_PARAMETER + 14
_OF_CAPPING = rows.FIRST_PARAMETER + 15
_OF_RELOADING = rows.FIRST_PARAMETER + 16
_OF_UNLOADING = rows.FIRST_PARAMETER + 17
_EXPONENT = rows.FIRST_PARAMETER + 18
_PINCHING_FORCE = rows.FIRST_PARAMETER + 19
_PINCHING_DRIFT = rows.FIRST_PARAMETER + 20

# Further rows, from the block's first one
_PEAK_DRIFT = 0  # the last turn point, of both sides
_PEAK_FORCE = 1
_STRENGTH = 4  # what is left of yield force and hardening, of both sides
_CAPPING = 5  # what is left of the capping line at zero drift
_UNLOADING_STIFFNESS = 8
_WORK_AT_ZERO = 9  # at the last passage of zero force, J
_PINCHED_DRIFT = 10  # the point at which the first part of the present reloading ends
_PINCHED_FORCE = 11
_TURNED_AT = 12  # the drift at the last turn since the last passage of zero force
_EXTRA_ROWS = 13

# Kinds of branches, in INTERNAL; negative on the negative side, 0 before the first yielding
_UNLOADING = 1.0
_PINCHED = 2.0
_TO_PEAK = 3.0
_TO_FARTHEST = 4.0
_PLASTIC = 5.0
_SOFTENING = 6.0
_RESIDUAL = 7.0
_FAILED = 8.0  # not negative

_HERE = 1e-12  # over a drift: what lies no farther ahead is reached
# over the farthest drift: a turn no farther from the last one is the same, which a step missed a
# little
_AGAIN = 1e-6


def _functions() -> LawFunctions:
    from tdint.kernels.compiling import inline, outlined
    from tdint.kernels.laws.branch_following import extra_rows, fail, follow_branches

    @inline
    def of(side, row):
        """The row of a pair that belongs to a side: the negative one's is two rows on, and
        positive, too."""
        return row if side > 0.0 else row + 2

    @inline
    def given(law_parameters, i, side, parameter):
        """A parameter that each side has."""
        return law_parameters[parameter if side > 0.0 else parameter + _SIDE, i]

    @inline
    def plastic_line(law_parameters, law_state, i, block, side):
        """Force at zero drift and slope of the present hardening line of a side."""
        k = law_parameters[rows.STIFFNESS, i]
        initial = given(law_parameters, i, side, _YIELD_FORCE)
        left = law_state[extra_rows(law_state, block) + of(side, _STRENGTH), i]
        slope = (
            left
            * (given(law_parameters, i, side, _CAPPING_RATIO) - 1.0)
            * initial
            / given(law_parameters, i, side, _PLASTIC_DRIFT)
        )
        return left * initial * (1.0 - slope / k), slope

    @inline
    def capping_line(law_parameters, law_state, i, block, side):
        """The same of the capping line."""
        initial = given(law_parameters, i, side, _YIELD_FORCE)
        cap = given(law_parameters, i, side, _CAPPING_RATIO) * initial
        slope = -cap / given(law_parameters, i, side, _POST_CAPPING_DRIFT)
        start = initial / law_parameters[rows.STIFFNESS, i] + given(
            law_parameters, i, side, _PLASTIC_DRIFT
        )
        return law_state[extra_rows(law_state, block) + of(side, _CAPPING), i] * (
            cap - slope * start
        ), slope

    @inline
    def residual(law_parameters, i, side):
        return given(law_parameters, i, side, _RESIDUAL_RATIO) * given(
            law_parameters, i, side, _YIELD_FORCE
        )

    @inline
    def backbone(law_parameters, law_state, i, block, side, drift):
        """Force of the present backbone at a drift beyond the yield drift."""
        plastic, rise = plastic_line(law_parameters, law_state, i, block, side)
        capping, fall = capping_line(law_parameters, law_state, i, block, side)
        return max(
            min(plastic + rise * drift, capping + fall * drift), residual(law_parameters, i, side)
        )

    @inline
    def beta(law_parameters, i, capacity, work, before):
        """Deterioration by an energy `work` after the energy `before`; 2 for more than 1."""
        left = law_parameters[capacity, i] * law_parameters[_YIELD_FORCE, i] - before
        if work <= 0.0 and left > 0.0:
            return 0.0
        if left <= 0.0 or work >= left:
            return 2.0
        part = work / left
        exponent = law_parameters[_EXPONENT, i]
        return part if exponent == 1.0 else part**exponent

    @outlined
    def beta_of_turning(law_parameters, law_state, i, block):
        """Deterioration of the unloading stiffness if the story turned here."""
        first = extra_rows(law_state, block)
        force = law_state[block + rows.FORCE, i]
        stored = 0.5 * force * force / law_state[first + _UNLOADING_STIFFNESS, i]
        before = law_state[block + rows.WORK, i] - stored
        return beta(
            law_parameters, i, _OF_UNLOADING, before - law_state[first + _WORK_AT_ZERO, i], before
        )

    @outlined
    def load(law_parameters, law_state, i, block, side, kind, slope, end):
        """Put the story on a loading branch of a side that goes up to the drift `end`."""
        ultimate = given(law_parameters, i, side, _ULTIMATE_DRIFT)
        if side * law_state[block + rows.DRIFT, i] >= ultimate * (1.0 - _HERE):
            fail(law_state, i, block, _FAILED)
            return
        end = min(end, ultimate)
        law_state[block + rows.INTERNAL, i] = side * kind
        law_state[block + rows.SLOPE, i] = slope
        law_state[block + rows.RATE_SIGN, i] = side
        law_state[block + rows.UPPER, i] = end if side > 0.0 else math.inf
        law_state[block + rows.LOWER, i] = -end if side < 0.0 else -math.inf

    @outlined
    def go_along_backbone(law_parameters, law_state, i, block, side):
        drift = side * law_state[block + rows.DRIFT, i]
        plastic, rise = plastic_line(law_parameters, law_state, i, block, side)
        capping, fall = capping_line(law_parameters, law_state, i, block, side)
        rest = residual(law_parameters, i, side)
        cap = (capping - plastic) / (rise - fall)
        near = _HERE * drift
        if drift < cap - near and plastic + rise * drift >= rest:
            law_state[block + rows.FORCE, i] = side * (plastic + rise * drift)
            load(law_parameters, law_state, i, block, side, _PLASTIC, rise, cap)
        elif drift >= cap - near and drift < (rest - capping) / fall - near:
            law_state[block + rows.FORCE, i] = side * (capping + fall * drift)
            load(
                law_parameters, law_state, i, block, side, _SOFTENING, fall, (rest - capping) / fall
            )
        else:
            law_state[block + rows.FORCE, i] = side * rest
            # A strength below the residual force may rise above it again before the capping point
            again = (rest - plastic) / rise if rise > 0.0 else math.inf
            end = again if drift < again - near and again < cap else math.inf
            load(law_parameters, law_state, i, block, side, _RESIDUAL, 0.0, end)

    @outlined
    def go_to_farthest(law_parameters, law_state, i, block, side):
        drift = side * law_state[block + rows.DRIFT, i]
        far = law_state[block + of(side, rows.HIGH_DRIFT), i]
        if drift < far * (1.0 - _HERE):
            rise = (
                law_state[block + of(side, rows.HIGH_FORCE), i]
                - side * law_state[block + rows.FORCE, i]
            )
            load(law_parameters, law_state, i, block, side, _TO_FARTHEST, rise / (far - drift), far)
        else:
            go_along_backbone(law_parameters, law_state, i, block, side)

    @outlined
    def aim(law_parameters, law_state, i, block, side):
        """Load towards the last peak if the way there is the steeper one, else towards the farthest
        point."""
        first = extra_rows(law_state, block)
        drift = side * law_state[block + rows.DRIFT, i]
        force = side * law_state[block + rows.FORCE, i]
        far = law_state[block + of(side, rows.HIGH_DRIFT), i]
        far_force = law_state[block + of(side, rows.HIGH_FORCE), i]
        peak = law_state[first + of(side, _PEAK_DRIFT), i]
        peak_force = law_state[first + of(side, _PEAK_FORCE), i]
        if drift < peak - _HERE * far and force < peak_force and peak_force < far_force:
            slope = (peak_force - force) / (peak - drift)
            if slope * (far - drift) > far_force - force:
                load(law_parameters, law_state, i, block, side, _TO_PEAK, slope, peak)
                return
        go_to_farthest(law_parameters, law_state, i, block, side)

    @outlined
    def unload(law_parameters, law_state, i, block, side):
        """Turn on a loading branch."""
        first = extra_rows(law_state, block)
        drift = side * law_state[block + rows.DRIFT, i]
        force = side * law_state[block + rows.FORCE, i]
        law_state[first + of(side, _PEAK_DRIFT), i] = drift
        law_state[first + of(side, _PEAK_FORCE), i] = force
        if drift > law_state[block + of(side, rows.HIGH_DRIFT), i]:
            law_state[block + of(side, rows.HIGH_DRIFT), i] = drift
            law_state[block + of(side, rows.HIGH_FORCE), i] = force
        lost = beta_of_turning(law_parameters, law_state, i, block)
        if (
            abs(side * drift - law_state[first + _TURNED_AT, i])
            <= _AGAIN * law_state[block + of(side, rows.HIGH_DRIFT), i]
        ):
            lost = 0.0
        law_state[first + _TURNED_AT, i] = side * drift
        if lost >= 1.0:
            fail(law_state, i, block, _FAILED)
            return
        slope = law_state[first + _UNLOADING_STIFFNESS, i] * (1.0 - lost)
        law_state[first + _UNLOADING_STIFFNESS, i] = slope
        zero = side * (drift - force / slope)
        law_state[block + rows.INTERNAL, i] = side * _UNLOADING
        law_state[block + rows.SLOPE, i] = slope
        law_state[block + rows.RATE_SIGN, i] = 0.0
        law_state[block + rows.UPPER, i] = side * drift if side > 0.0 else zero
        law_state[block + rows.LOWER, i] = zero if side > 0.0 else side * drift

    @outlined
    def deteriorate(law_parameters, law_state, i, block, side):
        """Deterioration of a side that is loaded after a passage of zero force; whether the story
        has failed."""
        first = extra_rows(law_state, block)
        before = law_state[block + rows.WORK, i]
        work = before - law_state[first + _WORK_AT_ZERO, i]
        rate = given(law_parameters, i, side, _RATE)
        strength = beta(law_parameters, i, _OF_STRENGTH, work, before)
        capping = beta(law_parameters, i, _OF_CAPPING, work, before)
        reloading = beta(law_parameters, i, _OF_RELOADING, work, before)
        law_state[first + _WORK_AT_ZERO, i] = before
        law_state[first + of(side, _STRENGTH), i] *= 1.0 - rate * strength
        law_state[first + of(side, _CAPPING), i] *= 1.0 - rate * capping
        law_state[block + of(side, rows.HIGH_DRIFT), i] *= 1.0 + rate * reloading
        return max(strength, capping, reloading) > 1.0

    @outlined
    def cross(law_parameters, law_state, i, block, side):
        """Zero force is passed towards a side."""
        first = extra_rows(law_state, block)
        law_state[block + rows.FORCE, i] = 0.0
        law_state[first + _TURNED_AT, i] = math.inf
        if deteriorate(law_parameters, law_state, i, block, side):
            fail(law_state, i, block, _FAILED)
            return
        stiffness = law_state[first + _UNLOADING_STIFFNESS, i]
        zero = side * law_state[block + rows.DRIFT, i]
        far = law_state[block + of(side, rows.HIGH_DRIFT), i]
        if far <= zero * (1.0 + _HERE) and zero > 0.0:
            # The other side unloaded so softly that it passed this side's farthest point: that is
            # moved ahead.
            far = (
                zero
                + max(
                    backbone(law_parameters, law_state, i, block, side, far),
                    _HERE * law_parameters[_YIELD_FORCE, i],
                )
                / stiffness
            )
            law_state[block + of(side, rows.HIGH_DRIFT), i] = far
        far_force = backbone(law_parameters, law_state, i, block, side, far)
        law_state[block + of(side, rows.HIGH_FORCE), i] = far_force
        if law_parameters[_PINCHING_FORCE, i] != 1.0 or law_parameters[_PINCHING_DRIFT, i] != 1.0:
            drift = (1.0 - law_parameters[_PINCHING_DRIFT, i]) * (far - far_force / stiffness)
            force = law_parameters[_PINCHING_FORCE, i] * far_force * (drift - zero) / (far - zero)
            law_state[first + _PINCHED_DRIFT, i] = drift
            law_state[first + _PINCHED_FORCE, i] = force
            if zero < drift - _HERE * far:
                load(
                    law_parameters,
                    law_state,
                    i,
                    block,
                    side,
                    _PINCHED,
                    force / (drift - zero),
                    drift,
                )
                return
        aim(law_parameters, law_state, i, block, side)

    @outlined
    def reload(law_parameters, law_state, i, block, side):
        """Go on from the last peak, to which the story came back while it unloaded."""
        first = extra_rows(law_state, block)
        drift = side * law_state[block + rows.DRIFT, i]
        force = side * law_state[block + rows.FORCE, i]
        far = law_state[block + of(side, rows.HIGH_DRIFT), i]
        far_force = law_state[block + of(side, rows.HIGH_FORCE), i]
        pinched = law_state[first + _PINCHED_DRIFT, i]
        pinched_force = law_state[first + _PINCHED_FORCE, i]
        if (
            drift < pinched - _HERE * far
            and force < pinched_force
            and pinched < far
            and pinched_force < far_force
        ):
            slope = (pinched_force - force) / (pinched - drift)
            if slope * (far - drift) < far_force - force:
                load(law_parameters, law_state, i, block, side, _PINCHED, slope, pinched)
                return
        go_to_farthest(law_parameters, law_state, i, block, side)

    @outlined
    def switch(law_parameters, law_state, i, block, event):
        kind = abs(law_state[block + rows.INTERNAL, i])
        if event == rows.REVERSED:
            side = law_state[block + rows.RATE_SIGN, i]
            if side * law_state[block + rows.FORCE, i] > 0.0:
                unload(law_parameters, law_state, i, block, side)
            else:
                cross(law_parameters, law_state, i, block, -side)
        elif kind == _UNLOADING:
            if event * law_state[block + rows.INTERNAL, i] < 0.0:
                cross(law_parameters, law_state, i, block, event)
            else:
                reload(law_parameters, law_state, i, block, event)
        elif event * law_state[block + rows.DRIFT, i] >= given(
            law_parameters, i, event, _ULTIMATE_DRIFT
        ) * (1.0 - _HERE):
            fail(law_state, i, block, _FAILED)
        elif kind == _PINCHED:
            aim(law_parameters, law_state, i, block, event)
        elif kind == _TO_PEAK:
            go_to_farthest(law_parameters, law_state, i, block, event)
        else:
            go_along_backbone(law_parameters, law_state, i, block, event)

    @inline
    def strain_energy(law_parameters, law_state, i):
        """What unloading gives back: on a loading branch with the stiffness that it would have."""
        force = law_state[rows.FORCE, i]
        energy = 0.5 * force * force / law_state[extra_rows(law_state, 0) + _UNLOADING_STIFFNESS, i]
        if abs(law_state[rows.INTERNAL, i]) > _UNLOADING and force != 0.0:
            energy /= 1.0 - min(beta_of_turning(law_parameters, law_state, i, 0), 0.9)
        return energy

    @inline
    def enter(law_parameters, law_state, i):
        k = law_parameters[rows.STIFFNESS, i]
        first = extra_rows(law_state, 0)
        law_state[first + _UNLOADING_STIFFNESS, i] = k
        law_state[first + _TURNED_AT, i] = math.inf
        for side in (1.0, -1.0):
            strength = given(law_parameters, i, side, _YIELD_FORCE)
            law_state[of(side, rows.HIGH_DRIFT), i] = law_state[
                first + of(side, _PEAK_DRIFT), i
            ] = strength / k
            law_state[of(side, rows.HIGH_FORCE), i] = law_state[
                first + of(side, _PEAK_FORCE), i
            ] = strength
            law_state[first + of(side, _STRENGTH), i] = law_state[first + of(side, _CAPPING), i] = (
                1.0
            )
        law_state[rows.UPPER, i] = given(law_parameters, i, 1.0, _YIELD_FORCE) / k
        law_state[rows.LOWER, i] = -given(law_parameters, i, -1.0, _YIELD_FORCE) / k

    return follow_branches(switch, strain_energy, enter)


def _fault(stiffness: float, values: Sequence[float]) -> str | None:
    for side, group in ((values[:_SIDE], ""), (values[_SIDE : 2 * _SIDE], "negative.")):
        strength, ultimate = side[0], side[5]
        if ultimate <= strength / stiffness:
            return (
                f"{group}ultimate_drift must be beyond the yield drift {strength / stiffness:.6g} "
                f"m, got {ultimate:.10g} m"
            )
        if side[4] > side[3]:
            return (
                f"{group}residual_ratio must not exceed capping_ratio {side[3]:.10g}, got "
                f"{side[4]:.10g}"
            )
    return None


_SIDES = (
    LawParameter("yield_force", force=1, low=0.0, low_allowed=False),
    LawParameter("plastic_drift", length=1, low=0.0, low_allowed=False),
    LawParameter("post_capping_drift", length=1, low=0.0, low_allowed=False),
    LawParameter("capping_ratio", low=1.0),
    LawParameter("residual_ratio", low=0.0, high=1.0),
    LawParameter("ultimate_drift", length=1, low=0.0, low_allowed=False),
    LawParameter("rate", low=0.0, high=1.0, default=1.0),
)


_CAPACITY = LawParameter(
    "strength", length=1, low=0.0, low_allowed=False, group="deterioration", shared=True
)

LAW = DriftLaw(
    "imk",
    "Ibarra-Medina-Krawinkler: capping, residual force, cyclic deterioration; peak-oriented or "
    "pinching",
    _functions,
    parameters=(
        *_SIDES,
        *(replace(one, default=one.name, group="negative") for one in _SIDES),
        *(
            replace(_CAPACITY, name=name, default=math.inf, without=math.inf)
            for name in ("strength", "capping", "reloading", "unloading")
        ),
        LawParameter("exponent", low=0.0, low_allowed=False, default=1.0),
        LawParameter("force", low=0.0, high=1.0, low_allowed=False, group="pinching", without=1.0),
        LawParameter("drift", low=0.0, high=1.0, group="pinching", without=1.0),
    ),
    kinked=True,
    apart=True,
    extra_rows=_EXTRA_ROWS,
    yield_drift=yields_at_its_strength,
    fault=_fault,
    failed=_FAILED,
)
