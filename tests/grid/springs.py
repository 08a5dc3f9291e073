"""Hysteretic laws of the separate solver, written without code of tdint.

A law is a class that is declared with `law`. A piecewise-linear law describes its path from a point
on in one direction: a list of straight segments (end, slope). Paths are mirrored, so that drifts
increase in the direction of motion, and `side` is 1 or -1. The path starts at the present point and
is requested at each reversal and at the end of a path that ends at a finite drift. A law with
curved branches computes its force from the drift and an internal variable.

The declaration of a law contains examples of its parameters for the grid: functions of a random
generator, the stiffness k (N/m) and the strength F (N), which return the mapping of a model file.
"""

import math
from itertools import pairwise

LAWS = {}
"""Classes of laws by the value of `type` in a model file."""


class StoryFailureError(Exception):
    """The story loses its strength, or its state leaves the range of the solver."""


AT_REST = 1e-3
"""Fraction of the yield drift. A law that remembers its reversals counts none before its drift
exceeds this fraction: the drift of an upper story is at first below the error of the solver."""
_MANY = 10_000
"""More branches than a path between two drifts can have."""


def law(name, loops=None, **examples):
    """Return the decorator that declares a law with examples of its parameters for the grid, and
    with `loops`, examples whose forces are compared along paths of drifts only."""

    def declare(spring):
        spring.examples = examples
        spring.loops = examples | (loops or {})
        LAWS[name] = spring
        return spring

    return declare


class Spring:
    """Spring of a story, in the virgin state at zero drift; a linear spring.

    Attributes
    ----------
    k : float
        Initial stiffness, N/m.
    drift, force, work : float
        Present drift, m, force, N, and work done on the spring since the virgin state, J.
    side : float
        Direction of the present path, 1 or -1; 0 before the first path.
    slope, end : float
        Slope of the present segment, N/m, and its last drift, m, positive in the direction of the
        path.
    is_reversible : bool
        True if the path back from any point is the path towards this point, and has no kink.
    variables : int
        Number of internal variables, whose rates are integrated.
    defines_stiffness : bool
        True if the initial stiffness follows from the parameters of the law.
    """

    is_reversible = True
    variables = 0
    defines_stiffness = False

    def __init__(self, story, parameters):
        self.k = story.get("stiffness", 0.0)
        self.drift = self.force = self.work = 0.0
        self.side, self.slope, self.end, self.rest = 0.0, self.k, math.inf, []
        self.read(parameters)

    def read(self, parameters):
        """Read the parameters of the law, and the initial stiffness if the law defines it."""

    def path(self, x, f, reversed_here):
        """Return the segments from a point on. `x` and `f` are drift and force in the direction of
        the path; `reversed_here` is False if the previous path ended here."""
        return [(math.inf, self.k)]

    def value(self, drift, *variables):
        """Return the force at a drift on the present segment, N."""
        return self.force + self.slope * (drift - self.drift)

    def tangent(self, drift, *variables):
        """Return the stiffness at a drift on the present segment, N/m."""
        return self.slope

    def largest(self, drift):
        """Return the largest possible absolute force at absolute drifts up to `drift`, N."""
        return self.k * drift

    def move(self, drift, *variables):
        """Move to a drift on the present segment."""
        force = self.value(drift, *variables)
        self.work += 0.5 * (self.force + force) * (drift - self.drift)
        self.drift, self.force = drift, force

    def turn(self, side):
        """Reverse the direction at the present drift, or start in a direction."""
        if side == self.side:
            return
        self.side = side
        self.rest = self.path(side * self.drift, side * self.force, True)
        self._next()

    def arrive(self):
        """Continue at the end of the present segment."""
        self.move(self.side * self.end)
        if not self.rest:
            self.rest = self.path(self.side * self.drift, self.side * self.force, False)
        self._next()

    def _next(self):
        """Enter the next segment that is longer than zero."""
        for _ in range(_MANY):
            self.end, self.slope = self.rest.pop(0)
            if self.end > self.side * self.drift:
                return
            if not self.rest:
                self.rest = self.path(self.side * self.drift, self.side * self.force, False)
        raise RuntimeError("a path does not end")

    def go(self, drift):
        """Move monotonically from the present drift to another drift; return the variables."""
        if drift != self.drift:
            self.turn(math.copysign(1.0, drift - self.drift))
            while self.side * drift > self.end:
                self.arrive()
            self.move(drift)
        return []


class Wrapped:
    """Spring with the attributes of another spring unless it defines them."""

    is_reversible = False

    def __init__(self, spring):
        self.spring = spring

    def __getattr__(self, name):
        return getattr(self.spring, name)


class Fracturing(Wrapped):
    """Spring that loses its force at a drift of a side for good."""

    def __init__(self, spring, limit):
        super().__init__(spring)
        if not isinstance(limit, dict):
            limit = {"positive": limit, "negative": limit}
        self.is_broken = False
        self.limits = {
            side: limit.get(name, math.inf)
            for side, name in ((1.0, "positive"), (-1.0, "negative"))
        }

    @property
    def end(self):
        if self.is_broken:
            return math.inf
        return min(self.spring.end, self.limits.get(self.side, math.inf))

    def value(self, drift, *variables):
        return 0.0 if self.is_broken else self.spring.value(drift, *variables)

    def tangent(self, drift, *variables):
        return 0.0 if self.is_broken else self.spring.tangent(drift, *variables)

    def largest(self, drift):
        return self.spring.largest(min(drift, max(self.limits.values())))

    def arrive(self):
        if self.end < self.spring.end:
            self.is_broken = True
        else:
            self.spring.arrive()

    def turn(self, side):
        if self.is_broken:
            self.spring.side = side
        else:
            self.spring.turn(side)

    def move(self, drift, *variables):
        if not self.is_broken:
            self.spring.move(drift, *variables)

    def go(self, drift):
        return self.spring.go(drift) if self.variables else Spring.go(self, drift)


class Inclined(Wrapped):
    """Spring along an inclined element: its deformation is the drift times `factor`, and the force
    of the story is its force times `factor`."""

    def __init__(self, spring, factor):
        super().__init__(spring)
        self.factor, self.k = factor, factor**2 * spring.k

    @property
    def end(self):
        return self.spring.end / self.factor

    def value(self, drift, *variables):
        return self.factor * self.spring.value(self.factor * drift, *variables)

    def tangent(self, drift, *variables):
        return self.factor**2 * self.spring.tangent(self.factor * drift, *variables)

    def rates(self, drift_rate, *variables):
        return self.spring.rates(self.factor * drift_rate, *variables)

    def largest(self, drift):
        return self.factor * self.spring.largest(self.factor * drift)

    def move(self, drift, *variables):
        self.spring.move(self.factor * drift, *variables)

    def go(self, drift):
        return self.spring.go(self.factor * drift)


def spring_of(story, parameters):
    """Return the spring of a law or an element."""
    spring = LAWS[parameters["type"]](story, parameters)
    if "fracture_drift" in parameters:
        spring = Fracturing(spring, parameters["fracture_drift"])
    if "angle" in parameters or "factor" in parameters:
        angle = math.radians(parameters.get("angle", 0.0))
        spring = Inclined(spring, parameters.get("factor", math.cos(angle)))
    return spring


def _along(points):
    """Return the segments through points (x, f) with increasing x."""
    return [(x1, (f1 - f0) / (x1 - x0)) for (x0, f0), (x1, f1) in pairwise(points) if x1 > x0]


@law("linear", linear=lambda rng, k, F: {})
class Linear(Spring):
    pass


@law(
    "bilinear",
    rising=lambda rng, k, F: {"yield_force": F, "hardening": rng.uniform(0.02, 0.2)},
    unequal=lambda rng, k, F: {
        **{"yield_force": F, "hardening": rng.choice([0.0, 0.05])},
        "negative": {"yield_force": rng.uniform(0.6, 1.4) * F},
    },
    falling=lambda rng, k, F: {"yield_force": F, "hardening": -rng.uniform(0.005, 0.03)},
)
class Bilinear(Spring):
    """Linear spring (hardening ratio times k) parallel to an elastoplastic spring."""

    is_reversible = False

    def read(self, parameters):
        self.ratio = parameters["hardening"]
        negative = parameters.get("negative", parameters)
        self.strength = {1.0: parameters["yield_force"], -1.0: negative["yield_force"]}

    def path(self, x, f, reversed_here):
        limit = (1.0 - self.ratio) * self.strength[self.side]
        last = limit / (-self.ratio * self.k) if self.ratio < 0.0 else math.inf
        if x >= last:  # no resistance
            raise StoryFailureError
        left = limit - (f - self.ratio * self.k * x)
        return [(x + left / ((1.0 - self.ratio) * self.k), self.k), (last, self.ratio * self.k)]

    def largest(self, drift):
        strength = max(self.strength.values())
        if self.k * drift <= min(self.strength.values()):
            return self.k * drift
        return max(strength, (1.0 - self.ratio) * strength + abs(self.ratio) * self.k * drift)


@law(
    "gap",
    stiff=lambda rng, k, F: {"gap": 1.5 * F / k, "stop_stiffness": 20.0 * k},
    **{
        "one side": lambda rng, k, F: {
            **{"gap": 1.2 * F / k, "stop_stiffness": 5.0 * k, "sides": "negative"}
        }
    },
)
class Gap(Spring):
    """Elastic spring with stops."""

    is_reversible = False

    def read(self, parameters):
        self.gap, self.stop = parameters["gap"], parameters["stop_stiffness"]
        sides = parameters.get("sides", "both")
        self.has = {1.0: sides != "negative", -1.0: sides != "positive"}

    def path(self, x, f, reversed_here):
        behind, ahead = (self.k + self.stop * self.has[s] for s in (-self.side, self.side))
        return [(-self.gap, behind), (self.gap, self.k), (math.inf, ahead)]

    def largest(self, drift):
        return self.k * drift + self.stop * max(drift - self.gap, 0.0)


class Oriented(Spring):
    """Base of laws with a backbone curve and the farthest drift of each side."""

    is_reversible = False

    def read(self, parameters):
        self.strength = parameters["yield_force"]
        self.first = self.strength / self.k
        self.far = {1.0: self.first, -1.0: self.first}
        self.exponent = parameters["unloading"]

    def largest(self, drift):
        return self.backbone(drift)


@law(
    "peak-oriented",
    soft=lambda rng, k, F: {"yield_force": F, "hardening": 0.05, "unloading": 0.5},
)
class PeakOriented(Oriented):
    """Clough's law with the unloading stiffness of Takeda and two lower bounds of it."""

    def read(self, parameters):
        super().read(parameters)
        self.ratio = parameters["hardening"]
        self.branch = "elastic"
        self.start = (0.0, 0.0)  # point at which unloading started, with its signs

    def backbone(self, x):
        return (
            self.k * x
            if x <= self.first
            else self.strength + self.ratio * self.k * (x - self.first)
        )

    def unloading(self, side):
        far = self.far[side]
        return self.k * max(
            (self.first / far) ** self.exponent,
            self.backbone(far) / (self.k * far),
            min(1.0, self.ratio / (1.0 - 0.5 * self.exponent)),
        )

    def path(self, x, f, reversed_here):
        s = self.side
        if self.branch == "elastic":
            if reversed_here or x < self.first * (1.0 - 1e-12):
                return [(self.first, self.k)]
            return self.load(x, f)
        if not reversed_here:
            return self.load(x, f)
        if self.branch == "loading":
            # Leave the backbone, or the line to the farthest point, of the other side.
            if self.yields:
                self.far[-s] = max(self.far[-s], -x)
            self.start, self.loaded = (self.drift, self.force), -s
            self.branch = "unloading"
        stiffness = self.unloading(self.loaded)
        if s == self.loaded:  # back to the point at which unloading started
            return [(s * self.start[0], stiffness)]
        return [(s * (self.start[0] - self.start[1] / stiffness), stiffness)]

    def load(self, x, f):
        """Return the line to the farthest point of the side, or the backbone curve."""
        self.branch = "loading"
        far = self.far[self.side]
        self.yields = x >= far * (1.0 - 1e-12)
        if self.yields:
            return self.follow_backbone(x)
        return [(far, (self.backbone(far) - f) / (far - x))]

    def follow_backbone(self, x):
        """Return the segments of the backbone curve beyond x."""
        return [(math.inf, self.ratio * self.k)]


@law(
    "trilinear-pinching",
    pinched=lambda rng, k, F: {
        **{"yield_force": F, "ultimate_force": 1.4 * F, "ultimate_drift": 6.0 * F / k},
        **{"pinching": rng.uniform(0.2, 0.8), "unloading": 0.3},
    },
)
class TrilinearPinching(Oriented):
    """Backbone curve of three lines; reloading in two lines to the farthest point."""

    def read(self, parameters):
        super().read(parameters)
        self.ultimate = parameters["ultimate_drift"], parameters["ultimate_force"]
        self.pinching = parameters["pinching"]
        self.zero = {1.0: 0.0, -1.0: 0.0}  # drift at zero force from which a side is loaded
        self.is_virgin = True

    def backbone(self, x):
        drift, force = self.ultimate
        if x <= self.first:
            return self.k * x
        rise = (force - self.strength) / (drift - self.first)
        return min(self.strength + rise * (x - self.first), force)

    def stiffness(self, side):
        return self.k * (self.first / self.far[side]) ** self.exponent

    def path(self, x, f, reversed_here):
        s = self.side
        if reversed_here:
            self.far[-s] = max(self.far[-s], -x)
            if not self.is_virgin and f <= 0.0:
                self.zero[s] = s * (x - f / self.stiffness(-s))
            self.is_virgin = False
        far, zero = self.far[s], s * self.zero[s]
        if x >= far * (1.0 - 1e-12):
            ends = [(end, force) for end, force in ((self.first, self.strength), self.ultimate)]
            points = [(x, f), *(point for point in ends if point[0] > x)]
            return [*_along(points), (math.inf, 0.0)]
        if f < 0.0 and x < zero:
            return [(zero, self.stiffness(-s))]
        target = self.backbone(far)
        own, p = self.stiffness(s), self.pinching
        corner = zero + p * (far - (1.0 - p) * target / own - zero)
        reloading = [(zero, 0.0), (corner, p * target), (far, target)]
        # The line of the unloading stiffness from here limits the reloading force.
        segments = []
        for (x0, f0), (x1, f1) in pairwise(reloading):
            if x1 <= max(x, x0):
                continue
            rise = (f1 - f0) / (x1 - x0)
            start = max(x, x0)
            gap = f0 + rise * (start - x0) - (f + own * (start - x))
            if not segments and gap + (rise - own) * (x1 - start) >= 0.0:
                continue  # the line is below the reloading path up to the end of this part
            if not segments and gap > 0.0:
                segments.append((start + gap / (own - rise), own))
            segments.append((x1, rise))
        return segments or [(far, own)]


def _imk(drift, strength):
    """Return the parameters of an imk law with the yield drift `drift`, m."""
    return {
        **{"yield_force": strength, "plastic_drift": 4.0 * drift},
        **{"post_capping_drift": 15.0 * drift, "capping_ratio": 1.1},
        **{"residual_ratio": 0.3, "ultimate_drift": 100.0 * drift},
    }


@law(
    "imk",
    deteriorating=lambda rng, k, F: {
        **_imk(F / k, F),
        **{"deterioration": 40.0 * F / k, "exponent": 1.2, "rate": 0.9},
        **{"negative": _imk(F / k, 0.8 * F) | {"rate": 0.7}},
    },
    pinched=lambda rng, k, F: {
        **_imk(F / k, F),
        **{"pinching": {"force": 0.4, "drift": 0.5}},
        "deterioration": {
            **{"strength": 60.0 * F / k, "capping": 80.0 * F / k},
            **{"reloading": 70.0 * F / k, "unloading": 100.0 * F / k},
        },
    },
)
class Imk(Spring):
    """Law of Ibarra, Medina and Krawinkler as modified by Lignos and Krawinkler.

    Drifts and forces of a side are positive. `far` and `last` are the farthest point and the last
    peak of a side, and `work_at_zero` is the work at the last zero crossing of the force.
    """

    is_reversible = False

    def read(self, parameters):
        capacities = parameters.get("deterioration", math.inf)
        if not isinstance(capacities, dict):
            capacities = dict.fromkeys(
                ("strength", "capping", "reloading", "unloading"), capacities
            )
        self.capacity = {name: c * parameters["yield_force"] for name, c in capacities.items()}
        self.exponent = parameters.get("exponent", 1.0)
        self.pinching = parameters.get("pinching")
        self.pinch = None  # end of the pinched part since the last zero crossing
        self.unloading, self.work_at_zero, self.branch = self.k, 0.0, "elastic"
        self.sides = {1.0: self._side(parameters)}
        self.sides[-1.0] = self._side(parameters | parameters.get("negative", {}))

    def _side(self, values):
        """Return the backbone curve and the stored points of a side."""
        strength, cap = values["yield_force"], values["capping_ratio"] * values["yield_force"]
        first = strength / self.k
        return {
            **{"strength": strength, "hardening": (cap - strength) / values["plastic_drift"]},
            **{"capping": (first + values["plastic_drift"], cap)},
            **{"falling": -cap / values["post_capping_drift"], "cap": cap},
            **{"residual": values["residual_ratio"] * strength},
            **{"far": (first, strength), "last": (first, strength)},
            **{"ultimate": values["ultimate_drift"], "rate": values.get("rate", 1.0)},
        }

    def largest(self, drift):
        # After one side has yielded, the force of the other side can exceed k times the drift.
        if self.k * drift <= min(side["strength"] for side in self.sides.values()):
            return self.k * drift
        return max(side["cap"] for side in self.sides.values())

    def path(self, x, f, reversed_here):
        side = self.sides[self.side]
        if self.branch == "elastic":
            if reversed_here:
                return [(side["strength"] / self.k, self.k)]
            self.branch = "loading"
            return self.backbone(side)
        if reversed_here:
            if self.branch == "loading":
                self.branch = "unloading"
                self.reverse(self.sides[-self.side], -x, -f)
            self.returns = f > 0.0
            # A reversal of unloading leads back to the last peak.
            return [(side["last"][0] if self.returns else x - f / self.unloading, self.unloading)]
        if self.branch == "loading":  # the ultimate drift
            raise StoryFailureError
        self.branch = "loading"
        if not self.returns:
            self.deteriorate(side)
            return self.load(side, x)
        points = [(x, f)]
        if self.pinch:
            drift, force = self.pinch
            far = side["far"]
            rise = (far[1] - f) / (far[0] - x) if far[0] > x else 0.0
            if x < drift < far[0] and f < force < far[1] and force - f < rise * (drift - x):
                points.append(self.pinch)
        return [*_along([*points, side["far"]]), *self.backbone(side)]

    def backbone(self, side):
        """Return the hardening, falling and residual lines of a side. The force is at least the
        residual force, also where deterioration has reduced the hardening line."""
        drift, force = side["capping"]
        if force <= side["residual"]:
            return [(side["ultimate"], 0.0)]
        residual = drift + (side["residual"] - force) / side["falling"]
        lines = [(drift, side["hardening"]), (residual, side["falling"]), (side["ultimate"], 0.0)]
        if side["hardening"] > 0.0:
            lines.insert(0, (drift - (force - side["residual"]) / side["hardening"], 0.0))
        return lines

    def reverse(self, other, x, f):
        """Leave a loading branch of the other side at (x, f)."""
        other["last"] = (x, f)
        if x > other["far"][0]:
            other["far"] = (x, f)
        elastic = 0.5 * f * f / self.unloading
        self.unloading *= 1.0 - self.fraction("unloading", self.work - elastic)

    def fraction(self, name, work):
        """Return the fraction of a deterioration by the work since the last zero crossing."""
        used, left = work - self.work_at_zero, self.capacity[name] - work
        if left <= 0.0 or used > left:
            raise StoryFailureError
        return (max(used, 0.0) / left) ** self.exponent

    def deteriorate(self, side):
        """Reduce the strength of the side that is loaded after a zero crossing of the force."""
        names = ("strength", "capping", "reloading")
        strength, capping, reloading = (
            side["rate"] * self.fraction(name, self.work) for name in names
        )
        self.work_at_zero = self.work
        drift, force = side["capping"]
        projection = (force - side["falling"] * drift) * (1.0 - capping)
        side["strength"] *= 1.0 - strength
        side["hardening"] *= 1.0 - strength
        first = side["strength"] / self.k
        at_zero = side["strength"] - side["hardening"] * first
        drift = (projection - at_zero) / (side["hardening"] - side["falling"])
        side["capping"] = drift, at_zero + side["hardening"] * drift
        x = side["far"][0] * (1.0 + reloading)
        if x < first:
            f = self.k * x
        elif x < drift:
            f = side["strength"] + side["hardening"] * (x - first)
        else:
            f = side["capping"][1] + side["falling"] * (x - drift)
        side["far"] = x, max(f, side["residual"])

    def load(self, side, x):
        """Return the path from zero force to the farthest point, and the backbone curve."""
        far, last, points = side["far"], side["last"], [(x, 0.0)]
        if self.pinching:
            drift = (1.0 - self.pinching["drift"]) * (far[0] - far[1] / self.unloading)
            force = self.pinching["force"] * far[1] * (drift - x) / (far[0] - x)
            self.pinch = drift, force
            if x < drift:
                points.append(self.pinch)
        x, f = points[-1]
        # The last peak is on the way if it is lower, and the line to it is steeper. Both points
        # often have the residual force, up to rounding.
        is_before = x < last[0] and f < last[1] < (1.0 - 1e-9) * far[1]
        if is_before and (last[1] - f) / (last[0] - x) > (far[1] - f) / (far[0] - x):
            points.append(last)
        return [*_along([*points, far]), *self.backbone(side)]


def _backbone(drift, strength, *points):
    return [[x * drift, f * strength] for x, f in points]


_FALLING = ((1.0, 1.0), (2.5, 1.2), (6.0, 1.35), (15.0, 0.8))


def _lost(peak, work, limit, peak_exponent=1.0, work_exponent=1.0):
    """Return the parameters of a type of degradation."""
    return {
        **{"peak": peak, "work": work, "limit": limit},
        **{"peak_exponent": peak_exponent, "work_exponent": work_exponent},
    }


@law(
    "multilinear-pinching",
    degrading=lambda rng, k, F: {
        "backbone": _backbone(F / k, F, *_FALLING),
        "pinching": {"drift": 0.5, "force": 0.4, "unloading": 0.1},
        "degradation": {
            "stiffness": _lost(0.2, 0.2, 0.4, 1.2, 0.8),
            "drift": _lost(0.1, 0.05, 0.2),
            "strength": _lost(0.1, 0.1, 0.3, 0.9),
            "capacity": 10.0,
        },
        "ultimate_drift": 50.0 * F / k,
    },
    unequal=lambda rng, k, F: {
        "backbone": _backbone(F / k, F, *_FALLING),
        "pinching": {"drift": 0.3, "force": 0.5, "unloading": -0.1},
        "negative": {
            "backbone": _backbone(F / k, F, (1.0, 1.0), (3.0, 1.4), (8.0, 1.5), (20.0, 1.6)),
            "pinching": {"drift": 0.6, "force": 0.3, "unloading": 0.05},
        },
    },
)
class MultilinearPinching(Spring):
    """Pinching4 of Lowes and Altoontash, with equal initial stiffnesses of both sides.

    `far` contains the farthest drift of each side, and `lost` the fractions of strength and
    stiffness that were lost until the last reversal.
    """

    is_reversible = False
    defines_stiffness = True

    def read(self, parameters):
        sides = {1.0: parameters, -1.0: parameters | parameters.get("negative", {})}
        self.points = {s: [tuple(p) for p in side["backbone"]] for s, side in sides.items()}
        self.pinching = {s: side["pinching"] for s, side in sides.items()}
        self.degradation = parameters.get("degradation")
        self.ultimate = parameters.get("ultimate_drift", math.inf)
        self.k = self.points[1.0][0][1] / self.points[1.0][0][0]
        self.far = {s: points[0][0] for s, points in self.points.items()}
        self.branch, self.lost = "virgin", (0.0, 0.0)
        self.last = max(points[-1][0] for points in self.points.values())
        self.losses_at_last, self.remaining = None, []

    def backbone(self, side, x):
        """Return the force of the backbone curve without degradation, N."""
        points = self.points[side]
        for (d0, f0), (d1, f1) in pairwise([(0.0, 0.0), *points]):
            if x <= d1:
                return f0 + (x - d0) * (f1 - f0) / (d1 - d0)
        return points[-1][1] + self.last_slope(side) * (x - points[-1][0])

    def last_slope(self, side):
        """Return the slope beyond the last point, N/m."""
        (d3, f3), (d4, f4) = self.points[side][-2:]
        return max(f4 - f3, 0.0) / (d4 - d3)

    def largest(self, drift):
        forces = [self.backbone(s, drift) for s in self.points]
        points = [point for side in self.points.values() for point in side]
        # Paths between unequal sides can be above both curves.
        is_symmetric = self.points[1.0] == self.points[-1.0]
        return max([*forces, *(f for d, f in points if d < drift or not is_symmetric)])

    def follow_backbone(self, x):
        """Return the segments of the backbone curve beyond x."""
        s, kept = self.side, 1.0 - self.lost[0]
        drifts = [x, *(drift for drift, _ in self.points[s] if drift > x)]
        if drifts[-1] < self.last:
            drifts.append(self.last)
        segments = _along([(drift, self.backbone(s, drift)) for drift in drifts])
        segments = segments or [(self.ultimate, self.last_slope(s))]
        return [(end, kept * slope) for end, slope in segments]

    def path(self, x, f, reversed_here):
        s = self.side
        if x >= self.ultimate:
            raise StoryFailureError
        if self.branch == "virgin":
            # Reversals of a story that has not moved yet do not count.
            start = AT_REST * self.points[s][0][0]
            if abs(x) < start:
                return [(start, self.k)]
            self.branch = "backbone"
        if not reversed_here:
            if x == self.last:
                self.losses_at_last = self.losses()
            if self.remaining:
                return [self.remaining.pop(0)]
            self.branch = "backbone"
            return self.follow_backbone(x)
        fractions = self.losses_at_last if abs(self.drift) > self.last else self.losses()
        enlarged = {side: far * (1.0 + fractions[1]) for side, far in self.far.items()}
        if self.branch == "backbone":
            self.far[-s] = max(-x, enlarged[-s])
        self.lost = fractions[2], fractions[0]
        self.branch = "path"
        points = self.reload((x, f), enlarged[s], self.far[s] > self.points[s][2][0])
        # The path stops at the last drift of the backbone curve, where the losses become constant.
        for (d0, f0), (d1, f1) in pairwise(list(points)):
            if d0 < self.last < d1:
                points.append((self.last, f0 + (self.last - d0) * (f1 - f0) / (d1 - d0)))
        self.remaining = _along(sorted(points))
        return [self.remaining.pop(0)] if self.remaining else self.follow_backbone(x)

    def losses(self):
        """Return the fractions of stiffness, drift and strength lost by a reversal here."""
        farthest = dict(self.far)
        if self.branch == "backbone":
            farthest[-self.side] = max(farthest[-self.side], abs(self.drift))
        has_yielded = any(farthest[s] > self.points[s][0][0] for s in farthest)
        if not self.degradation or not has_yielded:
            return 0.0, 0.0, 0.0
        areas = [
            sum(0.5 * (f0 + f1) * (d1 - d0) for (d0, f0), (d1, f1) in pairwise([(0, 0), *points]))
            for points in self.points.values()
        ]
        capacity = self.degradation["capacity"] * max(areas)
        spent = max(self.work - 0.5 * self.force**2 / (self.k * (1.0 - self.lost[1])), 0.0)
        ratio = max(self.far.values()) / self.last
        secant = max(self.backbone(s, far) / far for s, far in self.far.items()) / self.k
        fractions = []
        for name in ("stiffness", "drift", "strength"):
            part = self.degradation[name]
            fraction = part["peak"] * ratio ** part["peak_exponent"]
            fraction += part["work"] * (spent / capacity) ** part["work_exponent"]
            fractions.append(
                min(fraction, part["limit"]) if self.work < capacity else part["limit"]
            )
        fractions[0] = min(fractions[0], max(0.0, 1.0 - (1.0 - self.lost[0]) * secant))
        return fractions

    def reload(self, start, far, is_late):
        """Return the points of the path from a reversal to the farthest drift of the side.

        `is_late` is True if the farthest drift is beyond the third point of the backbone curve.
        """
        s, (u, f) = self.side, start
        target = far, (1.0 - self.lost[0]) * self.backbone(s, far)
        if u * far >= 0.0:
            return [start, target]
        third, fourth = ((1.0 - self.lost[0]) * force for _, force in self.points[s][2:])
        k = self.k * (1.0 - self.lost[1])
        p, v = self.pinching[s]["force"], self.pinching[s]["unloading"]
        ru, rf = self.pinching[s]["drift"] * far, p * target[1]
        if p - v <= 1e-8 and not (s > 0.0 and v == 0.0):
            rf = max((target[1] if is_late else third) * v, fourth) * (1.0 + 1e-6)
        if target[0] == ru or (target[1] - rf) / (target[0] - ru) > k:
            ru = target[0] - (target[1] - rf) / k
        if ru < u:
            return self.checked([start, target])
        vf = v * (fourth if is_late else third)
        vu = u + (vf - f) / k
        if vu < u:
            vu, vf = 0.5 * (u + ru), 0.5 * (f + rf)
        elif ru != vu and (rf - vf) / (ru - vu) > k:
            return self.checked([start, target])
        elif ru < vu or (ru != vu and (rf - vf) / (ru - vu) < 0.0):
            if vu > 0.0:
                vu, vf = 0.5 * (u + ru), 0.5 * (f + rf)
            elif ru < 0.0:
                ru, rf = 0.5 * (vu + target[0]), 0.5 * (vf + target[1])
            else:
                leave, arrive = (vf - f) / (vu - u), (target[1] - rf) / (target[0] - ru)
                mean, spread = 0.5 * (vf + rf), abs(vf + rf) / 200.0
                vf, rf = mean - spread, mean + spread
                vu, ru = u + (vf - f) / leave, target[0] - (target[1] - rf) / arrive
        return self.checked([start, (vu, vf), (ru, rf), target])

    def checked(self, points):
        """Replace a path that falls by a line, or by two lines through the origin."""
        if all(b[0] >= a[0] and b[1] >= a[1] for a, b in pairwise(points)):
            return points
        (u, f), target = points[0], points[-1]
        slope = (target[1] - f) / (target[0] - u)
        secant = f / u if self.side > 0.0 else target[1] / target[0]
        return [points[0], (0.0, 0.0), target] if 1e-8 < slope < secant else [points[0], target]


# ---- Backbone curves with any number of points, and a rule


_STEEP = ((1.0, 1.0), (2.0, 1.5), (4.0, 2.0), (10.0, 2.2))


def _multilinear(rule, points, last_slope=0.0, **more):
    """Return the function of an example of a multilinear law. The points and the slope after the
    last point are multiples of the yield drift, the strength and the stiffness."""
    return lambda rng, k, F: {
        **{"rule": rule, "backbone": _backbone(F / k, 0.6 * F, *points)},
        **{"last_slope": 0.6 * last_slope * k},
        **{key: entry(0.6 * k, 0.6 * F) for key, entry in more.items()},
    }


class Multilinear(Spring):
    """Base of the rules: the backbone curve of each side, which continues with `last_slope`."""

    is_reversible = False

    def read(self, parameters):
        negative = parameters.get("negative", parameters)
        self.points = {
            1.0: [tuple(point) for point in parameters["backbone"]],
            -1.0: [tuple(point) for point in negative["backbone"]],
        }
        self.last_slope = parameters.get("last_slope", 0.0)
        self.last_slopes = {1.0: self.last_slope, -1.0: negative.get("last_slope", self.last_slope)}
        self.k = self.points[1.0][0][1] / self.points[1.0][0][0]
        self.far = {s: points[0][0] for s, points in self.points.items()}

    def slopes(self, side):
        """Return the slopes of the segments of a side, with `last_slope`, N/m."""
        points = [(0.0, 0.0), *self.points[side]]
        return [
            *((f1 - f0) / (d1 - d0) for (d0, f0), (d1, f1) in pairwise(points)),
            self.last_slopes[side],
        ]

    def curve(self, side, x):
        """Return the force of the backbone curve of a side, N."""
        points = self.points[side]
        for (d0, f0), (d1, f1) in pairwise([(0.0, 0.0), *points]):
            if x <= d1:
                return f0 + (x - d0) * (f1 - f0) / (d1 - d0)
        return points[-1][1] + self.last_slopes[side] * (x - points[-1][0])

    def follow_backbone(self, x):
        """Return the segments of the backbone curve beyond x, up to zero force."""
        drift, force = self.points[self.side][-1]
        last = drift - force / self.last_slope if self.last_slope < 0.0 else math.inf
        if x >= last:
            raise StoryFailureError
        ends = [*(end for end, _ in self.points[self.side]), last]
        return [(e, s) for e, s in zip(ends, self.slopes(self.side), strict=True) if e > x]

    def largest(self, drift):
        forces = [self.curve(s, drift) for s in self.points]
        points = [point for side in self.points.values() for point in side]
        return max([*forces, *(f for d, f in points if d < drift)])


class Kinematic(Multilinear):
    """Elastic-perfectly plastic springs in parallel; `forces` are those of the springs, N."""

    def read(self, parameters):
        super().read(parameters)
        slopes = self.slopes(1.0)
        self.parts = [before - after for before, after in pairwise(slopes)]
        self.limits = {
            s: [k * d for k, (d, _) in zip(self.parts, points, strict=True)]
            for s, points in self.points.items()
        }
        self.forces = [0.0] * len(self.parts)

    def path(self, x, f, reversed_here):
        s, slope, segments = self.side, self.k, []
        parts = zip(self.limits[s], self.forces, self.parts, strict=True)
        for distance, stiffness in sorted(((lim - s * z) / k, k) for lim, z, k in parts):
            segments.append((x + distance, slope))
            slope -= stiffness
        return [*segments, (math.inf, self.last_slope)]

    def move(self, drift, *variables):
        change = drift - self.drift
        bounds = zip(self.forces, self.parts, self.limits[-1.0], self.limits[1.0], strict=True)
        self.forces = [min(max(z + k * change, -low), high) for z, k, low, high in bounds]
        super().move(drift, *variables)

    def largest(self, drift):
        if drift <= min(self.far.values()):
            return self.k * drift
        return max(map(sum, self.limits.values())) + abs(self.last_slope) * drift


class Isotropic(Multilinear):
    """Elastic up to a strength that grows with the plastic path of both sides."""

    def read(self, parameters):
        super().read(parameters)
        self.plastic = 0.0

    def path(self, x, f, reversed_here):
        s = self.side
        plastic = [d - force / self.k for d, force in self.points[s]]
        slopes = self.slopes(s)[1:]
        # Strength at the present plastic path, and the following segments
        strength, at, segments = self.points[s][0][1], 0.0, []
        for end, slope in zip([*plastic[1:], math.inf], slopes, strict=True):
            if self.plastic < end:
                start = max(at, self.plastic)
                if not segments:
                    strength += (start - at) * slope / (1.0 - slope / self.k)
                    x += (strength - f) / self.k
                    segments.append((x, self.k))
                x += (end - start) / (1.0 - slope / self.k)
                segments.append((x, slope))
            else:
                strength += (end - at) * slope / (1.0 - slope / self.k)
            at = end
        return segments

    def move(self, drift, *variables):
        self.plastic += abs(drift - self.drift) * (1.0 - self.slope / self.k)
        super().move(drift, *variables)

    def largest(self, drift):
        if drift <= min(self.far.values()):
            return self.k * drift
        return max(f for points in self.points.values() for _, f in points)


class Origin(Multilinear):
    """Lines from the points of maximum drift to the origin."""

    def path(self, x, f, reversed_here):
        s = self.side
        if reversed_here:
            self.far[-s] = max(self.far[-s], -x)
        if x < 0.0:
            return [(0.0, self.curve(-s, self.far[-s]) / self.far[-s])]
        if x < self.far[s]:
            return [(self.far[s], self.curve(s, self.far[s]) / self.far[s])]
        return self.follow_backbone(x)


class Peak(PeakOriented, Multilinear):
    """Unloading with the initial stiffness, then a line to the point of maximum drift."""

    follow_backbone = Multilinear.follow_backbone
    largest = Multilinear.largest

    def read(self, parameters):
        Multilinear.read(self, parameters)
        self.branch, self.start = "elastic", (0.0, 0.0)

    def backbone(self, x):
        return self.curve(self.side, x)

    def unloading(self, side):
        return self.k

    def path(self, x, f, reversed_here):
        self.first = self.points[self.side][0][0]
        return super().path(x, f, reversed_here)


def _limited(x, f, slope, points):
    """Return the segments of the smaller of the line of a slope from (x, f) and the curve through
    points, from x on."""
    segments, follows = [], False
    for (x0, f0), (x1, f1) in pairwise(points):
        if x1 <= x or x1 <= x0:
            continue
        rise, start = (f1 - f0) / (x1 - x0), max(x, x0)
        gap = f0 + rise * (start - x0) - (f + slope * (start - x))
        is_close = gap <= 1e-9 * (abs(f0) + abs(f1)) and rise <= slope * (1.0 + 1e-9)
        if is_close and not follows:
            segments += [(start, slope)] if start > x else []
            follows = True
        if not follows and gap + (rise - slope) * (x1 - start) <= 0.0:
            segments.append((start + gap / (slope - rise), slope))
            follows = True
        if follows:
            segments.append((x1, rise))
    return segments or [(points[-1][0], slope)]


_FAR = 1e3  # drift beyond all paths, m


class PeakWithKeys(Multilinear):
    """Peak rule with unloading, reloading, pinching, damage and sides. `zero` contains the drift
    from which each side is loaded, positive in the direction of this side."""

    def read(self, parameters):
        super().read(parameters)
        self.unloading, self.reloading = (
            parameters.get(key, 0.0) for key in ("unloading", "reloading")
        )
        pinching = parameters.get("pinching", {"drift": 1.0, "force": 1.0})
        self.x, self.y = pinching["drift"], pinching["force"]
        damage = parameters.get("damage", {})
        self.by_drift, self.by_work = damage.get("drift", 0.0), damage.get("work", 0.0)
        self.first = dict(self.far)
        self.far, self.zero = {1.0: 0.0, -1.0: 0.0}, {1.0: 0.0, -1.0: 0.0}
        self.has_reversed = self.has_moved = False
        sides = parameters.get("sides", "both")
        self.has = {1.0: sides != "negative", -1.0: sides != "positive"}

    def move(self, drift, *variables):
        # A reversal at rest is none.
        self.has_moved |= abs(drift) > AT_REST * self.first[1.0]
        super().move(drift, *variables)
        # A slack spring has no force: a rounding error would be a branch of its own.
        if abs(self.force) < 1e-9 * self.points[1.0][-1][1]:
            self.force = 0.0

    def stiffness(self, side):
        """Return the unloading stiffness with its bounds by the segments of the curve."""
        far, steepest = max(self.far[side], self.first[side]), max(self.slopes(side))
        soft = steepest * (self.first[side] / far) ** self.unloading
        ends = [*(drift for drift, _ in self.points[side][1:]), math.inf]
        for end, slope in zip(ends, self.slopes(side)[1:], strict=True):
            bound = slope / (1.0 - 0.5 * self.unloading)
            if end >= far or bound > steepest * (self.first[side] / end) ** self.unloading:
                soft = max(soft, bound)
            if end >= far:
                break
        return min(max(soft, self.curve(side, far) / far), steepest)

    def largest(self, drift):
        # Damage moves the target of the reloading beyond the drifts that were reached.
        return math.inf if self.by_drift or self.by_work else super().largest(drift)

    def area(self):
        corners = ([(0.0, 0.0), *points] for points in self.points.values())
        return sum(
            0.5 * (f0 + f1) * (d1 - d0) for side in corners for (d0, f0), (d1, f1) in pairwise(side)
        )

    def path(self, x, f, reversed_here):
        s, o = self.side, -self.side
        if reversed_here and self.has_moved:
            if not self.has_reversed or -f >= self.curve(o, -x) * (1.0 - 1e-9):
                self.far[o] = max(self.far[o], -x)
            self.has_reversed = True
            if f <= 0.0 and self.has[o]:
                soft = self.stiffness(o)
                if self.has[s]:
                    self.zero[s] = x - f / soft
                    if self.far[o] > self.first[o]:
                        work = self.work - 0.5 * f * f / soft
                        self.far[s] *= (
                            1.0
                            + self.by_drift * (self.far[o] / self.first[o] - 1.0)
                            + self.by_work * work / self.area()
                        )
                else:
                    self.zero[o] = -(x - f / soft)
            self.far[s] = max(self.far[s], self.first[s])
        if not self.has[s]:
            end = -self.zero[o]
            return [*([(end, self.stiffness(o))] if x < end else []), (math.inf, 0.0)]
        if not self.has_reversed:
            return self.follow_backbone(x)
        if x < self.zero[s] and f <= 1e-9 * self.points[s][0][1]:
            return [(self.zero[s], self.stiffness(o) if self.has[o] else 0.0)]
        first, own, z = self.first[s], self.stiffness(s), self.zero[s]
        far = max(self.far[s], first)
        target = far - self.reloading * (far - first)
        force = self.curve(s, target)
        pinched = self.y * force
        corner = z + self.x * (target - (force - pinched) / own - z)
        points = [(z, 0.0), (corner, pinched), (target, force)]
        if corner <= z:
            height = pinched
            if target > corner:
                height += (z - corner) * (force - pinched) / (target - corner)
            points = [(z, height), (target, force)]
        points += [(d, g) for d, g in self.points[s] if d > target]
        return _limited(x, f, own, [*points, (_FAR, self.curve(s, _FAR))])


class Flag(Multilinear):
    """Elastic force between an upper and a lower curve."""

    def read(self, parameters):
        super().read(parameters)
        negative = parameters.get("negative", {})
        sides = parameters.get("sides", "both")
        last = parameters.get("last_slope", 0.0)
        self.low_last, self.low = {}, {}
        for s, source in ((1.0, {}), (-1.0, negative)):
            slope = parameters.get("return_slope", last)
            self.low_last[s] = source.get("return_slope", slope)
            self.low[s] = source.get("return", parameters["return"])
            if sides == ("negative" if s > 0.0 else "positive"):
                self.points[s] = self.low[s] = [(1.0, 0.0)]
                self.last_slopes[s] = self.low_last[s] = 0.0
        steepest = max(
            (f1 - f0) / (d1 - d0)
            for points in self.points.values()
            for (d0, f0), (d1, f1) in pairwise([(0.0, 0.0), *points])
        )
        self.elastic = parameters.get("stiffness", steepest)

    def path(self, x, f, reversed_here):
        s = self.side
        low, last = self.low[-s], self.low_last[-s]
        drift, force = low[-1]
        behind = [(-d, -g) for d, g in [*low, (_FAR, force + last * (_FAR - drift))]]
        drift, force = self.points[s][-1]
        end = (_FAR, force + self.last_slopes[s] * (_FAR - drift))
        points = [*reversed(behind), (0.0, 0.0), *self.points[s], end]
        return _limited(x, f, self.elastic, points)


class Elastic(Multilinear):
    """The backbone curve itself."""

    def path(self, x, f, reversed_here):
        s = self.side
        before = [(-start, slope) for start, slope in self._other(-s)]
        ends = [*(d for d, _ in self.points[s]), math.inf]
        return [*before, *zip(ends, self.slopes(s), strict=True)]

    def _other(self, side):
        """Return the starts and slopes of the segments of a side, the last segment first."""
        starts = [0.0, *(d for d, _ in self.points[side])]
        return reversed(list(zip(starts, self.slopes(side), strict=True)))


_RULES = {
    **{"kinematic": Kinematic, "isotropic": Isotropic, "origin": Origin},
    **{"peak": Peak, "elastic": Elastic, "flag": Flag},
}

_PEAK_KEYS = {"unloading", "reloading", "pinching", "damage", "sides"}

_LOOPS = {
    "peak": _multilinear(
        *("peak", _STEEP),
        negative=lambda k, F: {"backbone": _backbone(F / k, F, (1.0, 1.0), (3.0, 1.8))},
    ),
    "elastic": _multilinear(
        *("elastic", ((1.0, 1.0), (2.0, 1.3), (5.0, 4.0)), 0.5),
        negative=lambda k, F: {"backbone": _backbone(F / k, F, (1.5, 1.5), (4.0, 2.0))},
    ),
    "unequal slopes": _multilinear(
        *("elastic", ((1.0, 1.0),), 0.5),
        negative=lambda k, F: {"backbone": _backbone(F / k, F, (1.0, 1.0)), "last_slope": 0.1 * k},
    ),
    "slip": _multilinear(
        "peak", ((1.0, 1.0),), 0.02, pinching=lambda k, F: {"drift": 1.0, "force": 0.2}
    ),
    "x brace": _multilinear(
        "peak", ((1.0, 1.0),), 0.02, pinching=lambda k, F: {"drift": 1.0, "force": 0.0}
    ),
    "rod": _multilinear(
        *("peak", ((1.0, 1.0),), 0.02),
        **{"pinching": lambda k, F: {"drift": 1.0, "force": 0.0}, "sides": lambda k, F: "positive"},
    ),
}
"""Further loops; rods alone leave a story without stiffness."""

_EXAMPLES = {
    "kinematic": _multilinear("kinematic", _STEEP, 0.01),
    "isotropic": _multilinear("isotropic", _STEEP),
    "origin": _multilinear("origin", _STEEP, -0.01),
    "hysteretic": _multilinear(
        *("peak", _STEEP, 0.02),
        **{"pinching": lambda k, F: {"drift": 0.7, "force": 0.3}, "unloading": lambda k, F: 0.4},
        **{"damage": lambda k, F: {"drift": 0.01, "work": 0.01}},
    ),
    "takeda": _multilinear(
        *("peak", ((1.0, 1.0),), 0.05),
        **{"unloading": lambda k, F: 0.5, "reloading": lambda k, F: 0.3},
    ),
    "flag": _multilinear(
        *("flag", ((1.0, 1.0), (4.0, 1.3)), 0.05),
        **{"return": lambda k, F: _backbone(F / k, F, (0.4, 0.39), (3.0, 0.5))},
    ),
    "ring spring": _multilinear(
        *("flag", ((1.0, 1.0), (4.0, 1.3)), 0.05),
        **{
            "return": lambda k, F: _backbone(F / k, F, (1.0, 0.3)),
            "return_slope": lambda k, F: 0.0,
        },
        negative=lambda k, F: {
            **{"backbone": _backbone(F / k, F, (1.0, 0.8)), "last_slope": 0.2 * k},
            **{"return": _backbone(F / k, F, (1.0, 0.2)), "return_slope": 0.1 * k},
        },
        stiffness=lambda k, F: 2.5 * k,
    ),
}


@law("multilinear", loops=_LOOPS, **_EXAMPLES)
def multilinear(story, parameters):
    """Return the spring with the rule of a multilinear law."""
    if parameters["rule"] == "peak" and _PEAK_KEYS & set(parameters):
        return PeakWithKeys(story, parameters)
    return _RULES[parameters["rule"]](story, parameters)


multilinear.defines_stiffness = True


# ---- Curved laws


@law(
    "ramberg-osgood",
    steel=lambda rng, k, F: {"yield_force": F, "alpha": 0.2, "exponent": rng.uniform(4.0, 8.0)},
    soil=lambda rng, k, F: {"yield_force": F, "alpha": 1.0, "exponent": 2.0},
)
class RambergOsgood(Spring):
    """Skeleton curve with Masing branches; `reversals` are the points of open loops."""

    is_reversible = False

    def read(self, parameters):
        self.strength, self.alpha = parameters["yield_force"], parameters["alpha"]
        self.exponent, self.reversals = parameters["exponent"], []

    def value(self, drift, *variables):
        yields = self.strength / self.k
        if not self.reversals:
            return self.strength * self.relative(drift / yields)
        start, force = self.reversals[-1]
        return force + 2.0 * self.strength * self.relative(0.5 * (drift - start) / yields)

    def relative(self, t):
        """Return y of t = y (1 + alpha |y|^(n - 1)) by Newton's method from above."""
        size, n = abs(t), self.exponent
        y = min(size, (size / self.alpha) ** (1.0 / n))
        for _ in range(50):
            power = self.alpha * y ** (n - 1.0)
            change = (y * (1.0 + power) - size) / (1.0 + n * power)
            y -= change
            if abs(change) <= 1e-15 * y:
                break
        return math.copysign(y, t)

    def tangent(self, drift, *variables):
        force, scale = (self.reversals[-1][1], 2.0) if self.reversals else (0.0, 1.0)
        y = (self.value(drift) - force) / (scale * self.strength)
        return self.k / (1.0 + self.exponent * self.alpha * abs(y) ** (self.exponent - 1.0))

    def path(self, x, f, reversed_here):
        if reversed_here:
            if f:
                self.reversals.append((self.drift, self.force))
        else:
            # The loop is closed: continue on the branch that it interrupted.
            del self.reversals[-2:]
        if not self.reversals:
            return [(math.inf, math.nan)]
        if len(self.reversals) > 1:
            return [(self.side * self.reversals[-2][0], math.nan)]
        return [(-self.side * self.reversals[0][0], math.nan)]

    def largest(self, drift):
        return self.strength * self.relative(drift * self.k / self.strength)


@law(
    "tanh",
    weak=lambda rng, k, F: {"strength": rng.uniform(0.8, 1.5) * F},
)
class Tanh(Spring):
    """Elastic spring that approaches a strength."""

    def read(self, parameters):
        self.strength = parameters["strength"]

    def value(self, drift, *variables):
        return self.strength * math.tanh(self.k * drift / self.strength)

    def tangent(self, drift, *variables):
        return self.k / math.cosh(self.k * drift / self.strength) ** 2

    def largest(self, drift):
        return self.value(drift)


@law(
    "hertz",
    loops={
        "stiff": lambda rng, k, F: {
            **{"gap": 1.5 * F / k, "stop_stiffness": 20.0 * k**1.5 / F**0.5},
        },
        "one side": lambda rng, k, F: {
            **{"gap": 1.2 * F / k, "stop_stiffness": 5.0 * k**1.5 / F**0.5, "sides": "negative"}
        },
    },
)
class Hertz(Spring):
    """Elastic spring with stops whose force grows with the power 1.5."""

    def read(self, parameters):
        self.gap, self.stop = parameters["gap"], parameters["stop_stiffness"]
        sides = parameters.get("sides", "both")
        self.has = {1.0: sides != "negative", -1.0: sides != "positive"}

    def overlap(self, drift):
        return max(abs(drift) - self.gap, 0.0) * self.has[math.copysign(1.0, drift)]

    def value(self, drift, *variables):
        return self.k * drift + math.copysign(self.stop * self.overlap(drift) ** 1.5, drift)

    def tangent(self, drift, *variables):
        return self.k + 1.5 * self.stop * self.overlap(drift) ** 0.5

    def largest(self, drift):
        return max(abs(self.value(sign * drift)) for sign in (-1, 1))


@law(
    "polynomial",
    stiffening=lambda rng, k, F: {"coefficients": [k, 0.0, 0.4 * k**3 / F**2]},
    unequal=lambda rng, k, F: {"coefficients": [k, 0.25 * k**2 / F, 0.1 * k**3 / F**2]},
    softening=lambda rng, k, F: {
        "coefficients": [k, 0.0, -0.02 * k**3 / F**2, 0.0, 0.001 * k**5 / F**4]
    },
)
class Polynomial(Spring):
    """Elastic spring with the force sum of c_j d^j."""

    defines_stiffness = True

    def read(self, parameters):
        self.coefficients = parameters["coefficients"]
        self.k = self.coefficients[0]

    def value(self, drift, *variables):
        force = 0.0
        for coefficient in reversed(self.coefficients):
            force = (force + coefficient) * drift
        return force

    def tangent(self, drift, *variables):
        return sum((j + 1) * c * drift**j for j, c in enumerate(self.coefficients))

    def largest(self, drift):
        return max(
            abs(self.value(part * sign * drift / 50)) for part in range(51) for sign in (-1, 1)
        )


@law(
    "bouc-wen",
    round=lambda rng, k, F: {"yield_force": F, "hardening": 0.05, "exponent": 1.0, "beta": 0.5},
    sharp=lambda rng, k, F: {"yield_force": F, "hardening": 0.0, "exponent": 5.0, "beta": 0.8},
    open=lambda rng, k, F: {"yield_force": F, "hardening": 0.05, "exponent": 1.5, "beta": 0.35},
    **{
        "degrading": lambda rng, k, F: {
            **{"yield_force": F, "hardening": 0.05, "exponent": 1.5, "beta": 0.7},
            "degradation": {
                **{"amplitude": 0.002 * k / F**2, "strength": 0.01 * k / F**2},
                **{"stiffness": 0.02 * k / F**2},
            },
            "asymmetry": 0.1,
        },
        "pinched": lambda rng, k, F: {
            **{"yield_force": F, "hardening": 0.05, "exponent": 2.0, "beta": 0.6},
            "pinching": {
                **{"slip": 0.9, "rate": 0.2 * k / F**2, "start": 0.1, "size": 0.3},
                **{"growth": 0.01 * k / F**2, "severity": 0.5},
            },
        },
    },
)
class BoucWen(Spring):
    """Bouc-Wen spring: an elastic part and the strength times the internal variable w. With
    degradation or pinching, the energy of the second part is another variable, in multiples of
    F^2/k."""

    is_reversible = False
    variables = 1

    def read(self, parameters):
        self.strength, self.ratio = parameters["yield_force"], parameters["hardening"]
        self.exponent, self.beta = parameters["exponent"], parameters["beta"]
        unit, degradation = self.strength**2 / self.k, parameters.get("degradation", {})
        self.loss, self.weakening, self.softening = (
            degradation.get(name, 0.0) * unit for name in ("amplitude", "strength", "stiffness")
        )
        self.pinching, self.phi = parameters.get("pinching"), parameters.get("asymmetry", 0.0)
        if self.pinching:
            per_energy = {name: self.pinching[name] * unit for name in ("rate", "growth")}
            self.pinching = self.pinching | per_energy
        if degradation or self.pinching:
            self.variables = 2
        self.state = [0.0] * self.variables

    def value(self, drift, w=0.0, energy=0.0):
        return self.ratio * self.k * drift + (1.0 - self.ratio) * self.strength * w

    def rates(self, drift_rate, w, energy=0.0):
        """Return the rates of the variables."""
        sign = self.beta if w * self.side > 0.0 else -self.beta
        if w * self.side > 0.0:
            sign += 2.0 * self.side * self.phi
        amplitude, weaker = 1.0 - self.loss * energy, 1.0 + self.weakening * energy
        if amplitude <= 0.0:
            raise StoryFailureError
        power = weaker * abs(w) ** self.exponent
        factor = (amplitude - power * (sign + 1.0 - self.beta)) / (1.0 + self.softening * energy)
        if p := self.pinching:
            slip = p["slip"] * (1.0 - math.exp(-p["rate"] * energy))
            width = (p["size"] + p["growth"] * energy) * (p["severity"] + slip)
            start = p["start"] * weaker ** (-1.0 / self.exponent)
            factor *= 1.0 - slip * math.exp(-(((w * self.side - start) / width) ** 2))
        relative_rate = self.k * drift_rate / self.strength
        rates = [factor * relative_rate, (1.0 - self.ratio) * w * relative_rate]
        return rates[: self.variables]

    def tangent(self, drift, *variables):
        change = self.rates(1.0, *variables)[0]
        return self.ratio * self.k + (1.0 - self.ratio) * self.strength * change

    def largest(self, drift):
        strength = (1.0 - 2.0 * abs(self.phi)) ** (-1.0 / self.exponent) * self.strength
        return self.ratio * self.k * drift + (1.0 - self.ratio) * strength

    def go(self, drift):
        """Integrate the variables over a monotonic path by the method of Runge and Kutta."""
        parts = 2000
        h = (drift - self.drift) / parts
        self.turn(math.copysign(1.0, h))

        def slope(before, part):
            state = [x + part * r for x, r in zip(self.state, before, strict=True)]
            return self.rates(h, *state)

        for _ in range(parts):
            a = slope([0.0] * self.variables, 0.0)
            b = slope(a, 0.5)
            c = slope(b, 0.5)
            slopes = zip(self.state, a, b, c, slope(c, 1.0), strict=True)
            self.state = [x + (p + 2.0 * q + 2.0 * r + s) / 6.0 for x, p, q, r, s in slopes]
        self.move(drift, *self.state)
        return self.state


@law(
    "steel",
    loops={
        "hardening": lambda rng, k, F: {
            **{"yield_force": F, "hardening": 0.02},
            "transition": {"R0": 20.0, "cR1": 0.925, "cR2": 0.15},
            "isotropic": {"a1": 0.15, "a2": 1.0, "a3": 0.15, "a4": 1.0},
        }
    },
    isotropic=lambda rng, k, F: {
        **{"yield_force": F, "hardening": 0.03},
        "transition": {"R0": 15.0, "cR1": 0.9, "cR2": 0.15},
        "isotropic": {"a1": 0.05, "a2": 1.0, "a3": 0.04, "a4": 1.0},
    },
)
class Steel(Spring):
    """Menegotto-Pinto curves from the last reversal to the corner of two lines."""

    is_reversible = False

    def read(self, parameters):
        self.strength, self.b = parameters["yield_force"], parameters["hardening"]
        self.transition = parameters["transition"]
        iso = parameters["isotropic"]
        self.iso = {1.0: (iso["a3"], iso["a4"]), -1.0: (iso["a1"], iso["a2"])}
        self.yields = self.strength / self.k
        self.extremes = {1.0: self.yields, -1.0: -self.yields}
        self.start, self.corner, self.power = None, (0.0, 0.0), self.transition["R0"]

    def path(self, x, f, reversed_here):
        q, d, f = self.side, self.drift, self.force
        if self.start in (None, (0.0, 0.0)) and abs(d) <= AT_REST * self.yields:
            self.start, self.corner = (0.0, 0.0), (q * self.yields, q * self.strength)
            return [(math.inf, math.nan)]
        self.extremes = {
            1.0: max(self.extremes[1.0], d),
            -1.0: min(self.extremes[-1.0], d),
        }
        rise, half = self.iso[q]
        width = (self.extremes[1.0] - self.extremes[-1.0]) / (2.0 * half * self.yields)
        strength = self.strength * (1.0 + rise * width**0.8)
        stiff = self.k * (1.0 - self.b)
        corner = (q * strength * (1.0 - self.b) - f + self.k * d) / stiff
        self.start, self.corner = (d, f), (corner, f + self.k * (corner - d))
        xi = abs(self.extremes[q] - corner) / self.yields
        t = self.transition
        self.power = t["R0"] * (1.0 - t["cR1"] * xi / (t["cR2"] + xi))
        return [(math.inf, math.nan)]

    def value(self, drift, *variables):
        if self.start is None:
            return self.k * drift
        (d, f), (corner, top) = self.start, self.corner
        e = (drift - d) / (corner - d)
        curve = (1.0 - self.b) * e / (1.0 + abs(e) ** self.power) ** (1.0 / self.power)
        return f + (top - f) * (self.b * e + curve)

    def tangent(self, drift, *variables):
        if self.start is None:
            return self.k
        (d, f), (corner, top) = self.start, self.corner
        e = (drift - d) / (corner - d)
        curve = (1.0 - self.b) / (1.0 + abs(e) ** self.power) ** (1.0 + 1.0 / self.power)
        return (top - f) / (corner - d) * (self.b + curve)

    def largest(self, drift):
        """The force is below the asymptotes of the largest strengths."""
        rises = [
            rise * (max(drift, self.yields) / (half * self.yields)) ** 0.8
            for rise, half in self.iso.values()
        ]
        return (1.0 - self.b) * self.strength * (1.0 + max(rises)) + self.b * self.k * drift
