"""Separate solver for shear buildings with attachments and links, without code of tdint.

The equation of motion is integrated with DOP853 between the kinks of the ground motion and the
branch changes of the laws, which are roots of the dense output. The motion of each part is smooth,
so that the order of DOP853 holds. Peaks between the steps are those of polynomials through
Chebyshev points of each part.

A building is a mapping with the keys of a model file in SI units.
"""

import math
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from scipy.integrate import DOP853
from scipy.linalg import eigh
from scipy.optimize import brentq

from grid.springs import StoryFailureError, spring_of

GRAVITY = 9.80665  # m/s^2

QUANTITIES = (
    "drift",
    "shear",
    "damper_force",
    "total_shear",
    "displacement",
    "velocity",
    "absolute_acceleration",
)
"""Quantities with peaks, in the order of `Chain.quantities`."""

_NODES = 9
_CHEBYSHEV = 0.5 - 0.5 * np.cos(np.pi * np.arange(_NODES) / (_NODES - 1))
"""Chebyshev points of the second kind in [0, 1]."""

_FINE = np.linspace(0.0, 1.0, 61)
_INTERPOLATION = np.polynomial.chebyshev.chebvander(2.0 * _FINE - 1.0, _NODES - 1) @ np.linalg.inv(
    np.polynomial.chebyshev.chebvander(2.0 * _CHEBYSHEV - 1.0, _NODES - 1)
)
"""Matrix that interpolates values at `_CHEBYSHEV` to `_FINE`."""

_MOST_EVENTS = 20_000


class Chain:
    """Equation of motion of a building.

    A member is a story, an attachment or a link, in this order; it has springs and a dashpot
    between two floors. The masses of attachments count as floors after the roof. The state y
    contains the displacements, the velocities, and the internal variables of the springs and
    dampers.

    Attributes
    ----------
    n : int
        Number of masses: floors and attachments.
    stories : int
        Number of stories.
    ends : list of (int, int)
        Upper and lower floor of each member; -1 is the ground.
    """

    def __init__(self, model, ground, interval):
        stories = model["stories"]
        self.stories = len(stories)
        members, self.ends = members_of(model)
        self.upper, self.lower = np.array(self.ends).T
        # Lists: single elements of arrays are slow.
        self.ground, self.interval = ground.tolist(), interval
        self.mass = np.array([member["mass"] for member in members if "mass" in member])
        self.n = len(self.mass)
        # The story below each mass; -1 for a building of its own
        self.supports = [a if i < self.stories else b for i, (a, b) in enumerate(self.ends)][
            : self.n
        ]
        self.start = 0  # index of the sample at the start of the present interval
        self.springs = []  # (member, spring, slice of its variables in y)
        self.size = 2 * self.n
        for i, member in enumerate(members):
            for spring in springs_of(member):
                end = self.size + spring.variables
                self.springs.append((i, spring, slice(self.size, end)))
                self.size = end
        floors = slice(self.stories)
        stiffness = np.zeros(len(members))
        for i, spring, _ in self.springs:
            stiffness[i] += spring.k
        self.geometric = np.zeros(len(members))
        if model.get("p_delta"):
            carried = GRAVITY * self.above(self.mass)
            for i, story in enumerate(stories):
                if story.get("p_delta", True):
                    self.geometric[i] = carried[i] / story["height"]
        self.dashpots = [dashpot_of(member.get("dashpot", 0.0)) for member in members]
        self.braces = {}  # index of the variable in y by member
        for i, dashpot in enumerate(self.dashpots):
            if dashpot.brace:
                self.braces[i] = self.size
                self.size += 1
        self.damping, tangent = damping_of(
            model, self.mass[floors], stiffness[floors], self.geometric[floors]
        )
        self.tangent = tangent and tangent + [0.0] * (len(members) - self.stories)
        self.is_damped = bool(self.damping.any())
        self.masses, self.geometries = self.mass.tolist(), self.geometric.tolist()
        forces = model.get("excitation", {}).get("forces", ())
        self.forces = [
            (force["floor"] - 1, force["amplitude"], force["omega"], force["phase"] == "cos")
            for force in forces
            if "omega" in force
        ]
        self.tables = [ForceTable(force) for force in forces if "points" in force]

    def above(self, values):
        """Return the sums of the values of all masses above each story."""
        sums = np.bincount(np.array(self.supports) + 1, values, self.stories + 1)
        return np.cumsum(sums[:0:-1])[::-1]

    def deformations(self, motion):
        """Return the deformations of all members from the motion of the masses, axis 0."""
        motion = np.concatenate([motion, np.zeros_like(motion[:1])])  # the ground is the last
        return motion[self.upper] - motion[self.lower]

    def initial_state(self, model):
        """Return the state at t = 0. Each spring moves monotonically to its initial deformation;
        attachments move with their floors, or are at rest on the ground."""
        initial, n = model.get("initial", {}), self.n
        y = np.zeros(self.size)
        for key, first in (("displacement", 0), ("velocity", n)):
            values = np.append(initial.get(key, np.zeros(self.stories)), 0.0)  # the ground is last
            y[first : first + n] = values[self.supports]
        drifts = self.deformations(y[:n])
        for i, spring, variables in self.springs:
            y[variables] = spring.go(float(drifts[i]))
        # The direction of the motion after t = 0, by the drift rates and, at rest, accelerations.
        change = self.rates(0.0, y)
        rates, accelerations = self.deformations(change[:n]), self.deformations(change[n : 2 * n])
        for i, spring, _ in self.springs:
            spring.turn(math.copysign(1.0, rates[i] if rates[i] else accelerations[i]))
        return y

    def ground_at(self, t):
        """Return the ground acceleration, m/s^2."""
        x = t / self.interval - self.start
        return self.ground[self.start] * (1.0 - x) + self.ground[self.start + 1] * x

    def kinks(self, count):
        """Return the times of the samples and of the points of forces."""
        samples = self.interval * np.arange(count + 1)
        points = [table.times for table in self.tables]
        times = np.unique(np.concatenate([samples, *points]))
        # Times that differ by rounding are equal.
        times = times[np.diff(times, prepend=-1.0) > 1e-9 * self.interval]
        return [float(t) for t in times if 0.0 <= t <= samples[-1]]

    def enter(self, t, end):
        """Select the lines of the ground motion and of the forces between two kinks."""
        self.start = int(0.5 * (t + end) / self.interval)
        for table in self.tables:
            table.select(0.5 * (t + end))

    def loads(self, t):
        """Return the forces on the floors and the ground at a time, N."""
        loads = [0.0] * (self.n + 1)  # the ground is the last
        for floor, amplitude, omega, is_cosine in self.forces:
            loads[floor] += amplitude * (math.cos if is_cosine else math.sin)(omega * t)
        for table in self.tables:
            loads[table.floor] += table.value(t)
        return loads

    def _balance(self, t, y):
        """Return the deformations and the forces of springs and dampers of the members, the
        absolute accelerations, and the rates of the state."""
        n, values = self.n, y.tolist()
        change = values[n : 2 * n] + [0.0] * (self.size - n)
        motion, speeds = [*values[:n], 0.0], [*values[n : 2 * n], 0.0]
        drifts = [motion[upper] - motion[lower] for upper, lower in self.ends]
        rates = [speeds[upper] - speeds[lower] for upper, lower in self.ends]
        shears, tangents = [0.0] * len(drifts), [0.0] * len(drifts)
        for i, spring, variables in self.springs:
            own = values[variables]
            shears[i] += spring.value(drifts[i], *own)
            if own:
                change[variables] = spring.rates(rates[i], *own)
            if self.tangent:
                tangents[i] += self.tangent[i] * spring.tangent(drifts[i], *own)
        dampers = [dashpot.force(rate) for dashpot, rate in zip(self.dashpots, rates, strict=True)]
        for i, variable in self.braces.items():
            dampers[i] = self.dashpots[i].limited(values[variable])
            change[variable] = self.dashpots[i].force_rate(rates[i], values[variable])
        forces = self.loads(t)
        if self.is_damped:
            viscous = (self.damping @ y[n : n + self.stories]).tolist()
            for i, force in enumerate(viscous):
                forces[i] -= force
        for i, (upper, lower) in enumerate(self.ends):
            force = shears[i] + self.dashpots[i].factor * dampers[i] + tangents[i] * rates[i]
            force -= self.geometries[i] * drifts[i]
            forces[upper] -= force
            forces[lower] += force
        ground = self.ground_at(t)
        absolute = [force / mass for force, mass in zip(forces, self.masses, strict=False)]
        change[n : 2 * n] = [acceleration - ground for acceleration in absolute]
        return drifts, shears, dampers, absolute, change

    def rates(self, t, y):
        """Return the rates of the state."""
        return np.array(self._balance(t, y)[-1])

    def quantities(self, t, y):
        """Return the quantities of all members at a time, rows of `QUANTITIES`; 0 for those that a
        member does not have."""
        drifts, shears, dampers, absolute, _ = self._balance(t, y)
        n = self.n
        total_shear = -self.above(np.array(absolute) * self.mass - self.loads(t)[:n])
        rows = (drifts, shears, dampers, total_shear, y[:n], y[n : 2 * n], absolute)
        quantities = np.zeros((len(rows), len(drifts)))
        for quantity, values in zip(quantities, rows, strict=True):
            quantity[: len(values)] = values
        return quantities


def members_of(model):
    """Return the stories, attachments and links of a building, and their upper and lower ends."""
    members, attachments = list(model["stories"]), model.get("attachments", [])
    names = {"ground": -1, "roof": len(members) - 1}
    ends = [(i, i - 1) for i in range(len(members))]
    for attachment in attachments:
        names[attachment["name"]] = len(members)
        floor = attachment["floor"]
        ends.append((len(members), names[floor] if isinstance(floor, str) else floor - 1))
        members.append(attachment)
    for link in model.get("links", []):
        lower, upper = (
            names[end] if isinstance(end, str) else end - 1 for end in (link["from"], link["to"])
        )
        ends.append((upper, lower))
        members.append(link)
    return members, ends


def springs_of(story):
    """Return the springs of a member: its elements, or its law."""
    if "elements" in story:
        return [spring_of(element, element) for element in story["elements"]]
    parameters = story.get("law", {"type": "linear"})
    return [spring_of(story, parameters)]


@dataclass
class Dashpot:
    """Dashpot with the force c v (v^2 + below^2)^((exponent - 1) / 2) at the damper rate v.

    The deformation of the damper is the drift times `factor`, and the force of the story is the
    force of the damper times `factor`. With a brace, N/m, in series the force is a variable.
    """

    coefficient: float
    exponent: float = 1.0
    below: float = 0.0
    brace: float = 0.0
    factor: float = 1.0
    relief: dict | None = None

    def force(self, drift_rate):
        """Return the force along the damper without a brace, N."""
        rate = self.factor * drift_rate
        square = rate * rate + self.below * self.below
        if not square:
            return 0.0
        return self.coefficient * rate * square ** (0.5 * (self.exponent - 1.0))

    def limited(self, force):
        """Return the force of damper and brace from its variable, N. A step in which a valve with
        the ratio 0 opens ends above the relief force."""
        if self.relief and not self.relief["ratio"]:
            return math.copysign(min(abs(force), self.relief["force"]), force)
        return force

    def force_rate(self, drift_rate, force):
        """Return the rate of the force of damper and brace, N/s."""
        damper_rate = (abs(force) / self.coefficient) ** (1.0 / self.exponent)
        if self.relief and abs(force) > self.relief["force"]:
            ratio, excess = self.relief["ratio"], abs(force) - self.relief["force"]
            if ratio:
                damper_rate += excess / self.coefficient * (1.0 / ratio - 1.0)
            elif drift_rate * force > abs(force) * damper_rate / self.factor:
                return 0.0
        return self.brace * (self.factor * drift_rate - math.copysign(damper_rate, force))


def dashpot_of(entry):
    """Return the dashpot of an entry of a model file."""
    if not isinstance(entry, dict):
        return Dashpot(entry)
    factor = entry.get("factor", math.cos(math.radians(entry.get("angle", 0.0))))
    power = entry["coefficient"], entry.get("exponent", 1.0), entry.get("linear_below", 0.0)
    return Dashpot(*power, entry.get("brace", 0.0), factor, entry.get("relief"))


class ForceTable:
    """Force on a floor, linear between points and zero outside. Two points with the same time are a
    jump."""

    def __init__(self, force):
        self.floor = force["floor"] - 1
        times, values = np.array(force["points"]).T
        self.times = times + force.get("start", 0.0)
        self.values = values * force.get("scale", 1.0)
        self.line = None

    def select(self, middle):
        """Select the line that contains a time."""
        j = int(np.searchsorted(self.times, middle))
        self.line = None
        if 0 < j < len(self.times):
            (t0, t1), (p0, p1) = self.times[j - 1 : j + 1], self.values[j - 1 : j + 1]
            self.line = float(t0), float(p0), float((p1 - p0) / (t1 - t0))

    def value(self, t):
        """Return the force on the selected line, N."""
        if self.line is None:
            return 0.0
        start, force, slope = self.line
        return force + slope * (t - start)


def chain_matrix(stiffness):
    """Return the matrix of springs between neighboring floors."""
    n = len(stiffness)
    drift = np.eye(n) - np.eye(n, k=-1)
    return drift.T @ np.diag(stiffness) @ drift


def damping_of(model, mass, stiffness, geometric):
    """Return the matrix of viscous damping without dashpots, N s/m, and the coefficients of the
    tangent stiffnesses of the stories, s, or None."""
    n, damping = len(mass), model.get("damping")
    if not damping:
        return np.zeros((n, n)), None
    M = np.diag(mass)
    modal = damping.get("modal") if isinstance(damping, dict) else None
    if isinstance(modal, dict) and not modal.get("p_delta", True):
        geometric = 0.0
    squares, shapes = eigh(chain_matrix(stiffness - geometric), M)
    omega = np.sqrt(np.maximum(squares, 0.0))
    if modal is not None:
        ratios = np.zeros(n)
        if isinstance(modal, dict):
            ratios[: modal.get("modes", n)] = modal["ratio"]
        elif isinstance(modal, list):
            ratios[: len(modal)] = modal
        else:
            ratios[:] = modal
        weighted = M @ shapes
        return weighted @ np.diag(2.0 * ratios * omega) @ weighted.T, None
    a, b = rayleigh_coefficients(damping, omega)
    # Isolators have no Rayleigh damping, and the floors above move relative to the isolator.
    stories = model["stories"]
    has_damping = np.array(
        [
            story.get("isolator", False) in (False, "rayleigh") and story.get("rayleigh", True)
            for story in stories
        ]
    )
    is_tangent = isinstance(damping, dict) and damping["rayleigh"].get("tangent", False)
    C = (0.0 if is_tangent else b) * chain_matrix(np.where(has_damping, stiffness, 0.0))
    base = None
    for i in range(n):
        if not has_damping[i]:
            base = i
            continue
        motion = np.zeros(n)
        motion[i] = 1.0
        if base is not None:
            motion[base] = -1.0
        C += a * mass[i] * np.outer(motion, motion)
    return C, (b * has_damping).tolist() if is_tangent else None


def rayleigh_coefficients(damping, omega):
    """Return the coefficients of mass and stiffness, 1/s and s."""
    n = len(omega)
    if not isinstance(damping, dict):
        ratios, modes = [damping] * 2, (1, min(3, n))
    elif "mass" in damping["rayleigh"]:
        return damping["rayleigh"]["mass"], damping["rayleigh"]["stiffness"]
    else:
        ratios, modes = damping["rayleigh"]["ratio"], damping["rayleigh"]["modes"]
    w = omega[np.array(modes) - 1]
    if w[0] == w[1]:
        return ratios[0] * w[0], ratios[0] / w[0]
    return np.linalg.solve([[0.5 / w[0], 0.5 * w[0]], [0.5 / w[1], 0.5 * w[1]]], ratios)


def _first_event(chain, dense, t0, t1, states):
    """Return the time of the first branch change in a step, and its spring and type; None if there
    is none. `states` are the states at the Chebyshev points of the step."""
    n, times = chain.n, t0 + (t1 - t0) * _CHEBYSHEV
    drifts, rates = chain.deformations(states[:n]), chain.deformations(states[n : 2 * n])
    first = None
    for i, spring, _ in chain.springs:
        if spring.is_reversible:
            continue
        s, end, (upper, lower) = spring.side, spring.end, chain.ends[i]

        def excess(t, kind, s=s, end=end, upper=upper, lower=lower):
            first, y = (n if kind == "turn" else 0), dense(t)
            value = y[first + upper] - (y[first + lower] if lower >= 0 else 0.0)
            return -s * value if kind == "turn" else s * value - end

        turn = None  # interval of the nodes that contains the reversal, and its time
        for kind, values in (("turn", -s * rates[i]), ("end", s * drifts[i] - end)):
            beyond = np.flatnonzero(values[1:] > 0.0)
            if beyond.size:
                j = beyond[0] + 1
                low, high = times[j - 1], times[j]
            elif kind == "end" and turn and excess(turn[1], "end") > 0.0:
                # The drift exceeds the end of the branch between two nodes only.
                j = turn[0]
                low, high = times[j - 1], turn[1]
            else:
                continue
            if values[j - 1] >= 0.0:
                when = times[j - 1]
            else:
                when = brentq(excess, low, high, args=(kind,), xtol=1e-15, rtol=1e-15)
            if kind == "turn":
                turn = j, when
            if first is None or when < first[0]:
                first = when, spring, kind
    return first


def _change_branch(chain, y, changed, kind):
    """Move all springs to a state, and change the branch of a spring."""
    drifts = chain.deformations(y[: chain.n])
    for i, spring, variables in chain.springs:
        if spring is changed and kind == "end":
            spring.arrive()
        elif not spring.is_reversible:
            spring.move(float(drifts[i]), *y[variables].tolist())
            if spring is changed:
                spring.turn(-spring.side)


class Peaks:
    """Integration of a building, with the largest absolute values of all quantities so far."""

    def __init__(self, chain, tolerance):
        self.chain, self.tolerance = chain, tolerance
        self.values = np.zeros((len(QUANTITIES), len(chain.ends)))
        self.h, self.events = chain.interval, 0
        sizes = np.full(chain.size, 1e-3)  # m, m/s and 1
        sizes[list(chain.braces.values())] = 1e2  # N
        self.absolute_tolerance = tolerance * sizes

    def integrate(self, t, end, y):
        """Integrate a smooth part of the loads, and return the state at its end."""
        while t < end:
            step = DOP853(
                *(self.chain.rates, t, y, end),
                **{"rtol": self.tolerance, "atol": self.absolute_tolerance},
                first_step=min(self.h, end - t),
            )
            t, y = self.integrate_branches(step)
        return y

    def integrate_branches(self, step):
        """Take steps up to the next branch change or the end; return time and state."""
        while step.status == "running":
            if step.step() or step.status == "failed":
                raise StoryFailureError
            self.h = step.step_size
            dense, start, stop = step.dense_output(), step.t_old, step.t
            states = dense(start + (stop - start) * _CHEBYSHEV)
            event = _first_event(self.chain, dense, start, stop, states)
            if event:
                stop = event[0]
                states = dense(start + (stop - start) * _CHEBYSHEV)
            if stop > start:
                times = start + (stop - start) * _CHEBYSHEV
                self.observe(
                    [self.chain.quantities(*at) for at in zip(times, states.T, strict=True)]
                )
            if event:
                self.events += 1
                if self.events > _MOST_EVENTS:
                    raise StoryFailureError
                _change_branch(self.chain, states[:, -1], *event[1:])
                return stop, states[:, -1].copy()
        return step.t, step.y

    def observe(self, nodes):
        """Update the peaks by the quantities at `_CHEBYSHEV` of a part."""
        fine = np.abs(_INTERPOLATION @ np.array(nodes).reshape(_NODES, -1))
        top = np.argmax(fine, axis=0)
        columns = np.arange(fine.shape[1])
        largest = fine[top, columns]
        # The parabola through the largest value and its neighbors
        inside = np.clip(top, 1, len(_FINE) - 2)
        left, middle, right = (fine[inside + shift, columns] for shift in (-1, 0, 1))
        bend = left - 2.0 * middle + right
        with np.errstate(divide="ignore", invalid="ignore"):
            vertex = middle - (right - left) ** 2 / (8.0 * bend)
        is_vertex = (top == inside) & (bend < 0.0)
        largest = np.where(is_vertex, vertex, largest)
        self.values = np.maximum(self.values, largest.reshape(self.values.shape))


def solve(model, ground, interval, duration, tolerance=1e-10):
    """Return the peaks and the residual drifts of a building by name, arrays over the stories,
    attachments and links; nan for quantities that a member does not have.

    Parameters
    ----------
    model : mapping
        Building, with the keys of a model file in SI units.
    ground : ndarray
        Ground acceleration at the samples, m/s^2, linear in between. It is zero one interval after
        the last sample.
    interval, duration : float
        Sampling interval and duration, s. The duration is a multiple of the interval.
    tolerance : float
        Relative tolerance of a step of DOP853.

    Raises
    ------
    StoryFailureError
        A story loses its strength.
    """
    count = round(duration / interval)
    samples = np.zeros(count + 1)
    samples[: min(len(ground), count + 1)] = ground[: count + 1]
    chain = Chain(model, samples, interval)
    kinks = chain.kinks(count)
    chain.enter(*kinks[:2])
    y = chain.initial_state(model)
    peaks = Peaks(chain, tolerance)
    try:
        for start, end in pairwise(kinks):
            chain.enter(start, end)
            y = peaks.integrate(start, end, y)
    except OverflowError as error:  # the drift of a softening spring grows without bound
        raise StoryFailureError from error
    result = {f"peak_{name}": row for name, row in zip(QUANTITIES, peaks.values, strict=True)}
    result["peak_total_shear"][chain.stories :] = math.nan
    for name in ("displacement", "velocity", "absolute_acceleration"):
        result[f"peak_{name}"][chain.n :] = math.nan
    return result | {"residual_drift": chain.deformations(y[: chain.n])}


def sizes_of(peaks, stories):
    """Return the largest value of each quantity of the stories, and each value of an attachment or
    a link, by name. The size of a residual drift is that of the peak drift."""
    sizes = {}
    for name, values in peaks.items():
        values = peaks["peak_drift"] if name == "residual_drift" else values
        sizes[name] = np.where(np.arange(len(values)) < stories, np.max(values[:stories]), values)
    return sizes
