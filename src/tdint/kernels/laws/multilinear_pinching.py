"""The multilinear law with pinched reloading: the backbone of a capacity curve, as regional models
have it.

The backbone of each side rises or falls through four points and ends flat, or with its last slope
if that rises. A turn starts a path of at most three straight parts to the farthest point of the
side that is moved towards: unloading to the part `unloading` of the third point's force, on to the
parts `drift` and `force` of the farthest point, up to that. It is the law that OpenSees has as
Pinching4 (Lowes and Altoontash 2003), with every turn at its own drift instead of at a step's end,
and without what follows there from rounding.

Degradation takes, at each turn, a part from stiffness and strength and moves the farthest points
ahead, by

    peak (largest drift / ultimate drift)^peak_exponent + work ((work - elastic) /
    capacity)^work_exponent <= limit

and takes nothing before the first yielding.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise

from tdint.kernels import layout as rows
from tdint.kernels.laws.law import DriftLaw, LawFunctions, LawParameter

# Parameters: drift and force of four points of the positive side, then of the negative one; the
# pinching of both sides
_POINTS = rows.FIRST_PARAMETER
_PINCHING = rows.FIRST_PARAMETER + 16
_SIDE = 8
_PINCHING_SIDE = 3
_ULTIMATE = rows.FIRST_PARAMETER + 22
_OF_STIFFNESS = rows.FIRST_PARAMETER + 23
_OF_DRIFT = rows.FIRST_PARAMETER + 28
_OF_STRENGTH = rows.FIRST_PARAMETER + 33
_CAPACITY = rows.FIRST_PARAMETER + 38

# Extra rows, from the block's first one
_KNOTS = 0  # drift and force of the three points of the path, on the side it leads to
_WEAKER = 6  # part of the strength, of the stiffness that was lost at the last turn
_SOFTER = 7
_HELD = (
    8  # losses of stiffness, drift and strength as they were where the ultimate drift was passed
)
_EXTRA_ROWS = _HELD + 3

# Kinds of branches, in INTERNAL; negative on the negative side, 0 before the first one
_ON_PATH = 1.0
_ON_BACKBONE = 2.0
_FAILED = 3.0  # not negative

_HERE = 1e-12  # over a drift: what lies no farther ahead is reached
# Over the first drift: a story that turns within it has not moved yet. An upper story of a building
# at rest turns at some 1e-10 m, by the step alone, and would lose up to a fifth of its stiffness
# there. A tenth of what OpenSees' law leaves out: forces this small are lost in those of any
# motion.
_AT_REST = 1e-5
_EQUAL = 1e-12  # stiffnesses that differ by rounding alone
_NO_PINCHING = 1e-8  # a difference of the parts of force below which reloading does not pinch
_FLAT = 1e-8  # over the stiffness


def _functions() -> LawFunctions:
    from tdint.kernels.compiling import inline, outlined
    from tdint.kernels.laws.branch_following import extra_rows, fail, follow_branches

    @inline
    def of(side, row):
        """The row of a pair that belongs to a side: the negative one's is two rows on, and
        positive, too."""
        return row if side > 0.0 else row + 2

    @inline
    def drift_of(law_parameters, i, side, point):
        return law_parameters[(_POINTS if side > 0.0 else _POINTS + _SIDE) + 2 * (point - 1), i]

    @inline
    def force_of(law_parameters, i, side, point):
        return law_parameters[(_POINTS if side > 0.0 else _POINTS + _SIDE) + 2 * point - 1, i]

    @inline
    def pinching(law_parameters, i, side, which):
        return law_parameters[(_PINCHING if side > 0.0 else _PINCHING + _PINCHING_SIDE) + which, i]

    @inline
    def stiffness(law_parameters, i, side):
        return force_of(law_parameters, i, side, 1) / drift_of(law_parameters, i, side, 1)

    @inline
    def last_slope(law_parameters, i, side):
        rise = force_of(law_parameters, i, side, 4) - force_of(law_parameters, i, side, 3)
        return max(rise, 0.0) / (
            drift_of(law_parameters, i, side, 4) - drift_of(law_parameters, i, side, 3)
        )

    @outlined
    def backbone(law_parameters, i, side, drift):
        """Force of the backbone that nothing has weakened."""
        x, y = 0.0, 0.0
        for point in range(1, 5):
            end, force = (
                drift_of(law_parameters, i, side, point),
                force_of(law_parameters, i, side, point),
            )
            if drift <= end:
                return y + (drift - x) * (force - y) / (end - x)
            x, y = end, force
        return y + last_slope(law_parameters, i, side) * (drift - x)

    @inline
    def area(law_parameters, i, side):
        """Under the backbone up to its last point."""
        x, y, sum_ = 0.0, 0.0, 0.0
        for point in range(1, 5):
            end, force = (
                drift_of(law_parameters, i, side, point),
                force_of(law_parameters, i, side, point),
            )
            sum_ += 0.5 * (y + force) * (end - x)
            x, y = end, force
        return sum_

    @inline
    def last_drift(law_parameters, i):
        return max(drift_of(law_parameters, i, 1.0, 4), drift_of(law_parameters, i, -1.0, 4))

    @inline
    def degrades(law_parameters, i):
        limits = 0.0
        for kind in (_OF_STIFFNESS, _OF_DRIFT, _OF_STRENGTH):
            limits += law_parameters[kind + 4, i]
        return limits > 0.0

    @inline
    def loss(law_parameters, i, kind, farthest, spent):
        """One loss before what bounds it from elsewhere; `spent` is a part of the capacity,
        negative where elastic."""
        limit = law_parameters[kind + 4, i]
        if limit == 0.0 or spent >= 1.0:
            return limit
        lost = law_parameters[kind, i] * farthest ** law_parameters[kind + 2, i]
        if spent > 0.0:
            lost += law_parameters[kind + 1, i] * spent ** law_parameters[kind + 3, i]
        return min(lost, limit)

    @inline
    def yielded(law_parameters, law_state, i, block):
        side = 1.0 if law_state[block + rows.INTERNAL, i] > 0.0 else -1.0
        loading = abs(law_state[block + rows.INTERNAL, i]) == _ON_BACKBONE
        if loading and side * law_state[block + rows.DRIFT, i] > drift_of(
            law_parameters, i, side, 1
        ):
            return True
        above = law_state[block + rows.HIGH_DRIFT, i] > drift_of(law_parameters, i, 1.0, 1)
        return above or law_state[block + rows.LOW_DRIFT, i] > drift_of(law_parameters, i, -1.0, 1)

    @outlined
    def losses(law_parameters, law_state, i, block):
        """Losses of stiffness, drift and strength if the story turned here."""
        first = extra_rows(law_state, block)
        drift = law_state[block + rows.DRIFT, i]
        if not degrades(law_parameters, i) or not yielded(law_parameters, law_state, i, block):
            return 0.0, 0.0, 0.0
        ultimate = last_drift(law_parameters, i)
        if abs(drift) > ultimate * (1.0 + _HERE):
            return (
                law_state[first + _HELD, i],
                law_state[first + _HELD + 1, i],
                law_state[first + _HELD + 2, i],
            )
        force, work = law_state[block + rows.FORCE, i], law_state[block + rows.WORK, i]
        capacity = law_parameters[_CAPACITY, i] * max(
            area(law_parameters, i, 1.0), area(law_parameters, i, -1.0)
        )
        k = stiffness(law_parameters, i, 1.0 if drift > 0.0 else -1.0) * (
            1.0 - law_state[first + _SOFTER, i]
        )
        spent = 2.0 if work >= capacity else (work - 0.5 * force * force / k) / capacity
        secant = 0.0
        for side in (1.0, -1.0):
            far = law_state[block + of(side, rows.HIGH_DRIFT), i]
            secant = max(
                secant,
                backbone(law_parameters, i, side, far) / far / stiffness(law_parameters, i, side),
            )
        room = max(0.0, 1.0 - secant * (1.0 - law_state[first + _WEAKER, i]))
        farthest = (
            max(law_state[block + rows.HIGH_DRIFT, i], law_state[block + rows.LOW_DRIFT, i])
            / ultimate
        )
        return (
            min(loss(law_parameters, i, _OF_STIFFNESS, farthest, spent), room),
            loss(law_parameters, i, _OF_DRIFT, farthest, spent),
            loss(law_parameters, i, _OF_STRENGTH, farthest, spent),
        )

    @inline
    def checked(u, f, knots, lowest, secant):
        """A path that goes back or falls is replaced by the straight line, or by the two lines
        through the origin."""
        b, fb, c, fc, d, fd = knots
        if b >= u and c >= b and d >= c and fb >= f and fc >= fb and fd >= fc:
            return b, fb, c, fc, d, fd
        slope = (fd - f) / (d - u)
        if slope > lowest and slope < secant:
            return 0.0, 0.0, 0.0, 0.0, d, fd
        return d, fd, d, fd, d, fd

    @inline
    def reloading_point(law_parameters, i, side, weak, k, far, force, late):
        """Where the pinched part of the way to the farthest point ends."""
        part, unloading = pinching(law_parameters, i, side, 1), pinching(law_parameters, i, side, 2)
        drift, pinched = pinching(law_parameters, i, side, 0) * far, part * force
        if part - unloading <= _NO_PINCHING:
            third = force if late else weak * force_of(law_parameters, i, side, 3)
            pinched = max(third * unloading, weak * force_of(law_parameters, i, side, 4)) * (
                1.0 + 1e-6
            )
        if force - pinched > k * (far - drift) or drift == far:
            drift = far - (force - pinched) / k
        return drift, pinched

    @outlined
    def path(law_parameters, i, side, u, f, demand, lost):
        """The three points of the path from a turn at (u, f), drift and force counted in the sense
        of the side it leads to, whose farthest drift is `demand`; `lost` are the losses that act
        from here on."""
        weak = 1.0 - lost[2]
        k = stiffness(law_parameters, i, side) * (1.0 - lost[0])
        d = demand * (1.0 + lost[1])
        fd = weak * backbone(law_parameters, i, side, d)
        if u * d >= 0.0 or u >= d:
            return d, fd, d, fd, d, fd
        back = stiffness(law_parameters, i, -side) * (1.0 - lost[0])
        secant = f / u if side > 0.0 else fd / d
        late = demand > drift_of(law_parameters, i, side, 3)
        c, fc = reloading_point(law_parameters, i, side, weak, k, d, fd, late)
        if c < u:
            return d, fd, d, fd, d, fd
        fb = (
            pinching(law_parameters, i, side, 2)
            * weak
            * force_of(law_parameters, i, side, 4 if late else 3)
        )
        b = u + (fb - f) / back
        if b < u:
            b, fb = 0.5 * (u + c), 0.5 * (f + fc)
        elif (c != b and (fc - fb) / (c - b) > max(k, back)) or (c == b and fc > fb):
            return d, fd, d, fd, d, fd
        elif c < b or fc < fb:
            if b > 0.0:
                b, fb = 0.5 * (u + c), 0.5 * (f + fc)
            elif c < 0.0:
                c, fc = 0.5 * (b + d), 0.5 * (fb + fd)
            else:
                mean = 0.5 * (fb + fc)
                leave, arrive = (fb - f) / (b - u), (fd - fc) / (d - c)
                fb, fc = mean - abs(mean) / 100.0, mean + abs(mean) / 100.0
                b, c = u + (fb - f) / leave, d - (fd - fc) / arrive
        return checked(u, f, (b, fb, c, fc, d, fd), _FLAT * k, secant)

    @outlined
    def lead(law_parameters, law_state, i, block, side, kind, slope, end):
        """Put the story on a branch that goes up to the drift `end` of a side."""
        drift = side * law_state[block + rows.DRIFT, i]
        end = min(end, law_parameters[_ULTIMATE, i])
        if degrades(law_parameters, i) and drift < last_drift(law_parameters, i) * (1.0 - _HERE):
            end = min(end, last_drift(law_parameters, i))
        law_state[block + rows.INTERNAL, i] = side * kind
        law_state[block + rows.SLOPE, i] = slope
        law_state[block + rows.RATE_SIGN, i] = side
        law_state[block + rows.UPPER, i] = end if side > 0.0 else math.inf
        law_state[block + rows.LOWER, i] = -end if side < 0.0 else -math.inf

    @outlined
    def go_along_backbone(law_parameters, law_state, i, block, side):
        drift = side * law_state[block + rows.DRIFT, i]
        weak = 1.0 - law_state[extra_rows(law_state, block) + _WEAKER, i]
        law_state[block + rows.FORCE, i] = side * weak * backbone(law_parameters, i, side, drift)
        x, y = 0.0, 0.0
        for point in range(1, 5):
            end, force = (
                drift_of(law_parameters, i, side, point),
                force_of(law_parameters, i, side, point),
            )
            if drift < end * (1.0 - _HERE):
                lead(
                    law_parameters,
                    law_state,
                    i,
                    block,
                    side,
                    _ON_BACKBONE,
                    weak * (force - y) / (end - x),
                    end,
                )
                return
            x, y = end, force
        lead(
            law_parameters,
            law_state,
            i,
            block,
            side,
            _ON_BACKBONE,
            weak * last_slope(law_parameters, i, side),
            math.inf,
        )

    @outlined
    def go_on(law_parameters, law_state, i, block, side):
        """Further along the path, or behind it along the backbone."""
        first = extra_rows(law_state, block)
        drift = side * law_state[block + rows.DRIFT, i]
        force = side * law_state[block + rows.FORCE, i]
        far = law_state[first + _KNOTS + 4, i]
        for knot in range(_KNOTS, _KNOTS + 6, 2):
            end = law_state[first + knot, i]
            if drift < end - _HERE * far:
                slope = (law_state[first + knot + 1, i] - force) / (end - drift)
                lead(law_parameters, law_state, i, block, side, _ON_PATH, slope, end)
                return
        go_along_backbone(law_parameters, law_state, i, block, side)

    @outlined
    def turn(law_parameters, law_state, i, block, side):
        """Turn towards a side."""
        first = extra_rows(law_state, block)
        drift = law_state[block + rows.DRIFT, i]
        lost = losses(law_parameters, law_state, i, block)
        if abs(law_state[block + rows.INTERNAL, i]) == _ON_BACKBONE:
            left = of(-side, rows.HIGH_DRIFT)
            reached = law_state[block + left, i] * (1.0 + lost[1])
            law_state[block + left, i] = max(reached, -side * drift)
        law_state[first + _SOFTER, i], law_state[first + _WEAKER, i] = lost[0], lost[2]
        demand = law_state[block + of(side, rows.HIGH_DRIFT), i]
        knots = path(
            law_parameters,
            i,
            side,
            side * drift,
            side * law_state[block + rows.FORCE, i],
            demand,
            lost,
        )
        for row in range(6):
            law_state[first + _KNOTS + row, i] = knots[row]
        go_on(law_parameters, law_state, i, block, side)

    @outlined
    def switch(law_parameters, law_state, i, block, event):
        kind = abs(law_state[block + rows.INTERNAL, i])
        reached = event * law_state[block + rows.DRIFT, i]
        if event == rows.REVERSED:
            turn(law_parameters, law_state, i, block, -law_state[block + rows.RATE_SIGN, i])
            return
        if reached >= law_parameters[_ULTIMATE, i] * (1.0 - _HERE):
            fail(law_state, i, block, _FAILED)
            return
        if (
            degrades(law_parameters, i)
            and abs(reached / last_drift(law_parameters, i) - 1.0) <= _HERE
        ):
            held = losses(law_parameters, law_state, i, block)
            for row in range(3):
                law_state[extra_rows(law_state, block) + _HELD + row, i] = held[row]
        if kind == _ON_PATH:
            go_on(law_parameters, law_state, i, block, event)
        else:
            go_along_backbone(law_parameters, law_state, i, block, event)

    @inline
    def until_zero(u, f, knots):
        """Energy that comes back on the way along a path from a negative force at `u` to where
        there is none."""
        energy = 0.0
        for row in range(0, 6, 2):
            end, force = knots[row], knots[row + 1]
            if end > u:
                if force >= 0.0:
                    return energy + 0.5 * f * f * (end - u) / (force - f)
                energy -= 0.5 * (f + force) * (end - u)
                u, f = end, force
        return energy

    @outlined
    def strain_energy(law_parameters, law_state, i):
        """What comes back on the path that a turn here would start, or on the rest of the present
        one."""
        drift, force = law_state[rows.DRIFT, i], law_state[rows.FORCE, i]
        if force == 0.0:
            return 0.0
        if law_state[rows.INTERNAL, i] == 0.0:
            return 0.5 * force * force / law_parameters[rows.STIFFNESS, i]
        first = extra_rows(law_state, 0)
        side = law_state[rows.RATE_SIGN, i]
        if side * force < 0.0:
            row = first + _KNOTS
            b, fb, c, fc = (
                law_state[row, i],
                law_state[row + 1, i],
                law_state[row + 2, i],
                law_state[row + 3, i],
            )
            knots = (b, fb, c, fc, law_state[row + 4, i], law_state[row + 5, i])
        else:
            side = -side
            demand = law_state[of(side, rows.HIGH_DRIFT), i]
            knots = path(
                law_parameters,
                i,
                side,
                side * drift,
                side * force,
                demand,
                losses(law_parameters, law_state, i, 0),
            )
        return until_zero(side * drift, side * force, knots)

    @inline
    def elastic(law_parameters, i):
        """Whether every path before the first yielding lies on the one straight line."""
        if (
            abs(stiffness(law_parameters, i, -1.0) / stiffness(law_parameters, i, 1.0) - 1.0)
            > _EQUAL
        ):
            return False
        for side in (1.0, -1.0):
            drift, force = (
                pinching(law_parameters, i, side, 0),
                pinching(law_parameters, i, side, 1),
            )
            unloading = pinching(law_parameters, i, side, 2)
            if not (unloading < force - _NO_PINCHING and force <= drift):
                return False
            if unloading * force_of(law_parameters, i, side, 3) >= force * force_of(
                law_parameters, i, side, 1
            ):
                return False
        return True

    @inline
    def enter(law_parameters, law_state, i):
        part = 1.0 if elastic(law_parameters, i) else _AT_REST
        law_state[rows.HIGH_DRIFT, i] = drift_of(law_parameters, i, 1.0, 1)
        law_state[rows.LOW_DRIFT, i] = drift_of(law_parameters, i, -1.0, 1)
        law_state[rows.UPPER, i] = min(
            part * drift_of(law_parameters, i, 1.0, 1), law_parameters[_ULTIMATE, i]
        )
        law_state[rows.LOWER, i] = -min(
            part * drift_of(law_parameters, i, -1.0, 1), law_parameters[_ULTIMATE, i]
        )

    return follow_branches(switch, strain_energy, enter)


def _slopes(side: Sequence[float]) -> list[float]:
    points = [(0.0, 0.0), *zip(side[::2], side[1::2], strict=True)]
    return [(force - f) / (drift - d) for (d, f), (drift, force) in pairwise(points)]


def _stiffens(values: Sequence[float]) -> bool:
    first = values[1] / values[0]
    return max(*_slopes(values[:_SIDE]), *_slopes(values[_SIDE : 2 * _SIDE])) > first * (
        1.0 + _EQUAL
    )


def _fault(stiffness: float, values: Sequence[float]) -> str | None:
    for drifts, name in (
        (values[0:_SIDE:2], "backbone"),
        (values[_SIDE : 2 * _SIDE : 2], "negative.backbone"),
    ):
        if any(later <= drift for drift, later in pairwise(drifts)):
            return (
                f"the drifts of {name} must rise from point to point, got "
                f"{', '.join(f'{d:.6g}' for d in drifts)} m"
            )
    return None


_PINCHINGS = (
    LawParameter("drift", low=0.0, high=1.0, group="pinching"),
    LawParameter("force", low=0.0, high=1.0, group="pinching"),
    LawParameter("unloading", low=-1.0, high=1.0, group="pinching"),
)


def _loss(name: str) -> tuple[LawParameter, ...]:
    group = f"degradation.{name}"
    part = LawParameter("peak", low=0.0, default=0.0, group=group, without=0.0)
    exponent = replace(part, default=1.0, without=1.0)
    return (
        part,
        replace(part, name="work"),
        replace(exponent, name="peak_exponent"),
        replace(exponent, name="work_exponent"),
        LawParameter("limit", low=0.0, high=1.0, high_allowed=False, group=group, without=0.0),
    )


LAW = DriftLaw(
    "multilinear-pinching",
    "backbone through two to four points a side, rising or falling; unloads, pinches and reloads "
    "along straight lines (Pinching4)",
    _functions,
    parameters=(
        LawParameter("backbone", points=True, low=0.0, low_allowed=False),
        LawParameter(
            "backbone",
            points=True,
            low=0.0,
            low_allowed=False,
            default="backbone",
            group="negative",
        ),
        *_PINCHINGS,
        *(replace(one, default=one.name, group="negative.pinching") for one in _PINCHINGS),
        LawParameter("ultimate_drift", length=1, low=0.0, low_allowed=False, default=math.inf),
        *_loss("stiffness"),
        *_loss("drift"),
        *_loss("strength"),
        LawParameter("capacity", low=0.0, low_allowed=False, group="degradation", without=math.inf),
    ),
    kinked=True,
    apart=True,
    extra_rows=_EXTRA_ROWS,
    initial_stiffness=lambda values: values[1] / values[0],
    yield_drift=lambda stiffness, values: values[0],  # the first point of the positive side
    stiffens=_stiffens,
    fault=_fault,
    failed=_FAILED,
)
