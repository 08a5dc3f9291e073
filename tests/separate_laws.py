"""Second statements of the laws, in plain Python, which share no code with tdint.

An object is a spring: `go(x)` moves it along a straight path to the drift `x`, and `f` is its force
there. Branches are stated as the force that results, not as branches that change: return mapping,
parallel springs, the smallest of several curves, or polygons.
"""

import math

import numpy as np


def copied(value):
    """Return a copy of a spring, with copies of its lists and of the springs in it."""
    if isinstance(value, list):
        return [copied(item) for item in value]
    if isinstance(value, dict):
        return {key: copied(item) for key, item in value.items()}
    if hasattr(value, "go"):
        copy = object.__new__(type(value))
        copy.__dict__ = {key: copied(item) for key, item in value.__dict__.items()}
        return copy
    return value


class Spring:
    """A spring without memory, with a force that is a function of the drift."""

    def __init__(self, force):
        self.force = force
        self.f = 0.0

    def go(self, x):
        self.f = self.force(x)


class Bilinear:
    """A linear spring beside a spring whose force is limited by return mapping."""

    def __init__(self, stiffness, strength, hardening, negative=None):
        self.kinematic = hardening * stiffness
        self.stiffness = (1.0 - hardening) * stiffness
        self.high = (1.0 - hardening) * strength
        self.low = -(1.0 - hardening) * (negative or strength)
        self.plastic = self.f = 0.0

    def go(self, x):
        trial = self.stiffness * (x - self.plastic)
        limited = min(max(trial, self.low), self.high)
        self.plastic = x - limited / self.stiffness
        self.f = self.kinematic * x + limited


class Kinematic:
    """Parallel springs with limited forces, one for each point of the backbone."""

    def __init__(self, points, last_slope):
        drifts, forces = np.array([(0.0, 0.0), *points]).T
        slopes = [*(np.diff(forces) / np.diff(drifts)), last_slope]
        self.springs = [
            Bilinear(slope - after, (slope - after) * drift, 0.0)
            for slope, after, drift in zip(slopes, slopes[1:], drifts[1:], strict=False)
        ]
        self.last_slope = last_slope
        self.f = 0.0

    def go(self, x):
        for spring in self.springs:
            spring.go(x)
        self.f = self.last_slope * x + sum(spring.f for spring in self.springs)


class Isotropic:
    """A spring whose two strengths grow with the plastic path, by bisection of its drift."""

    def __init__(self, points, last_slope):
        self.stiffness = points[0][1] / points[0][0]
        self.drifts = [drift - force / self.stiffness for drift, force in points]
        self.forces = [force for _, force in points]
        self.last_slope = last_slope * self.stiffness / (self.stiffness - last_slope)
        self.x = self.f = self.plastic = 0.0

    def strength(self, plastic):
        beyond = max(plastic - self.drifts[-1], 0.0)
        return float(np.interp(plastic, self.drifts, self.forces)) + self.last_slope * beyond

    def go(self, x):
        trial = self.f + self.stiffness * (x - self.x)
        if abs(trial) > self.strength(self.plastic):
            low, high = 0.0, abs(trial) / self.stiffness
            for _ in range(60):
                middle = 0.5 * (low + high)
                if abs(trial) - self.stiffness * middle > self.strength(self.plastic + middle):
                    low = middle
                else:
                    high = middle
            self.plastic += low
            trial = math.copysign(self.strength(self.plastic), trial)
        self.x, self.f = x, trial


class Origin:
    """The backbone beyond the farthest drift of a side, a line through the origin below it."""

    def __init__(self, backbone):
        self.backbone = backbone
        self.far = {1.0: 0.0, -1.0: 0.0}
        self.f = 0.0

    def go(self, x):
        side = math.copysign(1.0, x)
        far = self.far[side] = max(self.far[side], abs(x))
        self.f = self.backbone(far) / far * x if far else 0.0


class Flag:
    """An elastic force between an upper and a lower curve (both of them odd functions)."""

    def __init__(self, stiffness, upper, lower):
        self.stiffness, self.upper, self.lower = stiffness, upper, lower
        self.x = self.f = 0.0

    def go(self, x):
        high = self.upper(x) if x >= 0.0 else -self.lower(-x)
        low = self.lower(x) if x >= 0.0 else -self.upper(-x)
        self.f = min(max(self.f + self.stiffness * (x - self.x), low), high)
        self.x = x


class Steel:
    """Menegotto and Pinto's curves, in units of the yield drift and the yield force."""

    def __init__(self, hardening, transition):
        self.hardening, self.transition = hardening, transition
        self.x = self.f = 0.0
        self.extremes = {1: 1.0, -1: -1.0}
        self.side = 0
        self.curve = None

    def start(self, side):
        """Start a curve at the present point."""
        r0, c1, c2 = self.transition
        b, turn = self.hardening, (self.x, self.f)
        corner = (side * (1.0 - b) - self.f + self.x) / (1.0 - b)
        xi = abs(self.extremes[side] - corner)
        exponent = r0 * (1.0 - c1 * xi / (c2 + xi)) if self.side else r0
        self.curve = (*turn, corner, exponent)
        self.side = side

    def go(self, x):
        side = 1 if x > self.x else -1
        if x == self.x:
            return
        if side != self.side:
            if self.side:
                extreme = max if self.side > 0 else min
                self.extremes[self.side] = extreme(self.extremes[self.side], self.x)
            self.start(side)
        x0, f0, corner, exponent = self.curve
        b, e = self.hardening, (x - x0) / (corner - x0)
        self.f = f0 + (x - x0) * (b + (1.0 - b) / (1.0 + abs(e) ** exponent) ** (1.0 / exponent))
        self.x = x


class RambergOsgood:
    """The skeleton curve and branches of twice its size, in units of the yield drift and force."""

    def __init__(self, alpha, exponent):
        self.alpha, self.exponent = alpha, exponent
        self.x = self.f = 0.0
        self.side = 0
        self.turns = []

    def skeleton(self, drift):
        """Force of the skeleton curve by Newton's method from above."""
        size, y = abs(drift), abs(drift)
        for _ in range(200):
            power = self.alpha * y ** (self.exponent - 1.0)
            step = (y + power * y - size) / (1.0 + self.exponent * power)
            y -= step
            if abs(step) <= 1e-15 * y:
                break
        return math.copysign(y, drift)

    def go(self, x):
        if x == self.x:
            return
        side = 1 if x > self.x else -1
        if self.side not in (0, side):
            self.turns.append((self.x, self.f))
        self.side = side
        # A branch that closes its loop continues the branch before the loop.
        while self.turns:
            limit = self.turns[-2][0] if len(self.turns) > 1 else -self.turns[0][0]
            if side * x < side * limit:
                break
            del self.turns[-2:]
        self.x = x
        if self.turns:
            x0, f0 = self.turns[-1]
            self.f = f0 + 2.0 * self.skeleton(0.5 * (x - x0))
        else:
            self.f = self.skeleton(x)


class Pinching4:
    """Polygons through an unloading and a reloading point, without degradation, and equal on both
    sides; `pinching` contains the ratios of drift, force and unloading force."""

    def __init__(self, points, pinching):
        self.points, self.pinching = [(0.0, 0.0), *points], pinching
        self.stiffness = points[0][1] / points[0][0]
        self.far = {1: points[0][0], -1: points[0][0]}
        self.x = self.f = 0.0
        self.side, self.polygon = 0, None

    def backbone(self, drift):
        return float(np.interp(drift, *zip(*self.points, strict=True)))

    def draw(self, side):
        """Draw the polygon from the present point to the farthest point of a side."""
        drift, force, unloading = self.pinching
        far = self.far[side]
        turn, target = (side * self.x, side * self.f), (far, self.backbone(far))
        if turn[0] >= 0.0:
            self.polygon = [turn, target]
            return
        late = far > self.points[3][0]
        ru, rf = drift * target[0], force * target[1]
        if (target[1] - rf) / (target[0] - ru) > self.stiffness:
            ru = target[0] - (target[1] - rf) / self.stiffness
        vf = unloading * self.points[4 if late else 3][1]
        vu = turn[0] + (vf - turn[1]) / self.stiffness
        self.polygon = [turn, (vu, vf), (ru, rf), target]
        if not np.all(np.diff(self.polygon, axis=0) > 0.0):
            raise ValueError("these polygons are corrected by rules that are not stated here")

    def go(self, x):
        if x == self.x:
            return
        side = 1 if x > self.x else -1
        if self.side not in (0, side) and (self.polygon or abs(self.x) > self.points[1][0]):
            if not self.polygon:
                self.far[self.side] = max(self.far[self.side], self.side * self.x)
            self.side = side
            self.draw(side)
        self.side = side
        if self.polygon and side * x > self.polygon[-1][0]:
            self.polygon = None
        if self.polygon:
            force = float(np.interp(side * x, *zip(*self.polygon, strict=True)))
        else:
            force = self.backbone(side * x) if side * x > 0.0 else -self.backbone(-side * x)
        self.x, self.f = x, side * force


class TrilinearCurves:
    """A law whose force is the smallest of three: reloading curve, backbone curve, unloading line
    through the turn point."""

    def __init__(self, ultimate, drift, pinching, unloading):
        self.ultimate, self.drift, self.pinching, self.unloading = (
            ultimate,
            drift,
            pinching,
            unloading,
        )
        self.x = self.f = self.zero = 0.0
        self.far = {1: 1.0, -1: 1.0}

    def backbone(self, x):
        return float(np.interp(x, [0.0, 1.0, self.drift], [0.0, 1.0, self.ultimate]))

    def slope(self, side):
        return self.far[side] ** -self.unloading

    def go(self, x):
        side = 1 if x > self.x else -1
        if self.f * side < 0.0:
            zero = self.x - self.f / self.slope(-side)
            if side * x <= side * zero:
                self.f += self.slope(-side) * (x - self.x)
                self.x = x
                return
            self.x, self.f, self.zero = zero, 0.0, zero
        far, z, slope = self.far[side], side * self.zero, self.slope(side)
        force = self.backbone(far)
        bend = z + self.pinching * (far - (1.0 - self.pinching) * force / slope - z)
        if side * x >= far:
            new = self.backbone(side * x)
        else:
            points = [(z, 0.0), (bend, self.pinching * force), (far, force)]
            line = np.interp(side * x, *zip(*points, strict=True))
            new = min(line, side * self.f + slope * side * (x - self.x))
        self.x, self.f = x, side * new
        self.far[side] = max(far, side * x)


class ImkCurves:
    """Story with the IMK law, which is loaded along a polygon that is constructed at each zero
    crossing of the force and at each return to the last peak."""

    def __init__(self, positive, negative, deterioration, exponent, pinching):
        self.sides = {1: dict(zip(["F", "p", "q", "c", "r", "u", "D"], positive, strict=True))}
        self.sides[-1] = dict(zip(["F", "p", "q", "c", "r", "u", "D"], negative, strict=True))
        for values in self.sides.values():
            values |= {
                "rise": (values["c"] - 1.0) * values["F"] / values["p"],
                "fall": -values["c"] * values["F"] / values["q"],
            }
            values |= {
                "rest": values["r"] * values["F"],
                "far": values["F"],
                "peak": (values["F"], values["F"]),
            }
            values["start"] = values["c"] * values["F"] - values["fall"] * (
                values["F"] + values["p"]
            )
        self.capacity, self.exponent, self.pinching = deterioration, exponent, pinching
        self.x = self.f = self.work = self.at_zero = 0.0
        self.slope, self.pinch = 1.0, None
        self.loading = self.yielded = 0
        self.polygon = []

    def backbone(self, side, x):
        values = self.sides[side]
        return max(
            min(
                values["F"] + values["rise"] * (x - values["F"]),
                values["start"] + values["fall"] * x,
            ),
            values["rest"],
        )

    def beta(self, work, before):
        return (
            (max(work, 0.0) / (self.capacity - before)) ** self.exponent
            if self.capacity < math.inf
            else 0.0
        )

    def draw(self, side, here, *points):
        """Draw a curve from the present point over some points and the farthest point along the
        backbone curve."""
        values = self.sides[side]
        far = values["far"]
        cap = (values["start"] - values["F"] + values["rise"] * values["F"]) / (
            values["rise"] - values["fall"]
        )
        residual_drift = (values["rest"] - values["start"]) / values["fall"]
        # The hardening line of a deteriorated side exceeds the residual force from here on.
        recovery = values["F"] + (values["rest"] - values["F"]) / values["rise"]
        bends = sorted(x for x in (recovery, cap, residual_drift, values["u"]) if x > far)
        self.polygon = [here, *points, *((x, self.backbone(side, x)) for x in (far, *bends))]
        self.loading = side

    def aim(self, side, here):
        """Return the last peak if the path to it is steeper."""
        far, peak = self.sides[side]["far"], self.sides[side]["peak"]
        force = self.backbone(side, far)
        if here[0] < peak[0] and here[1] < peak[1] < force:
            steep = (peak[1] - here[1]) / (peak[0] - here[0]) > (force - here[1]) / (far - here[0])
            return (peak,) if steep else ()
        return ()

    def cross(self, side):
        values = self.sides[side]
        beta = self.beta(self.work - self.at_zero, self.work)
        self.at_zero = self.work
        remaining_share = 1.0 - beta * values["D"]
        values["F"] *= remaining_share
        values["rise"] *= remaining_share
        values["start"] *= remaining_share
        values["far"] *= 1.0 + beta * values["D"]
        far, z = values["far"], side * self.x
        force = self.backbone(side, far)
        x = (1.0 - self.pinching[1]) * (far - force / self.slope)
        self.pinch = (
            (x, self.pinching[0] * force * (x - z) / (far - z))
            if self.pinching != (1.0, 1.0)
            else None
        )
        first = (self.pinch,) if self.pinch and z < x else ()
        self.draw(side, (z, 0.0), *first, *self.aim(side, first[0] if first else (z, 0.0)))

    def return_to_peak(self, side):
        """Draw a curve from the last peak."""
        values = self.sides[side]
        peak, far = values["peak"], values["far"]
        force = self.backbone(side, far)
        points = ()
        if self.pinch and peak[0] < self.pinch[0] < far and peak[1] < self.pinch[1] < force:
            flat = (self.pinch[1] - peak[1]) / (self.pinch[0] - peak[0]) < (force - peak[1]) / (
                far - peak[0]
            )
            points = (self.pinch,) if flat else ()
        self.draw(side, peak, *points)

    def to(self, x, f):
        self.work += 0.5 * (self.f + f) * (x - self.x)
        self.x, self.f = x, f

    def along_polygon(self, x):
        side = self.loading
        for a, b in [*self.polygon, (side * x, None)][1:]:
            if side * self.x < a <= side * x:
                self.to(
                    side * a,
                    side * (np.interp(a, *zip(*self.polygon, strict=True)) if b is None else b),
                )

    def go(self, x):
        side = 1 if x > self.x else -1
        if not self.yielded:
            if side * x <= self.sides[side]["F"]:
                self.to(x, x)
                return
            self.yielded = 1
            self.to(side * self.sides[side]["F"], side * self.sides[side]["F"])
            self.draw(side, (side * self.x, side * self.f))
        if self.loading == -side:
            values = self.sides[-side]
            values["peak"] = (-side * self.x, -side * self.f)
            values["far"] = max(values["far"], -side * self.x)
            stored = 0.5 * self.f**2 / self.slope
            self.slope *= 1.0 - self.beta(self.work - self.at_zero - stored, self.work - stored)
            self.loading = 0
        if self.loading == 0:
            zero = self.x - self.f / self.slope
            if self.f * side < 0.0:
                if side * x <= side * zero:
                    self.to(x, self.f + self.slope * (x - self.x))
                    return
                self.to(zero, 0.0)
                self.cross(side)
            else:
                peak = self.sides[side]["peak"]
                if side * x <= peak[0]:
                    self.to(x, self.f + self.slope * (x - self.x))
                    return
                self.to(side * peak[0], side * peak[1])
                self.return_to_peak(side)
        self.along_polygon(x)
