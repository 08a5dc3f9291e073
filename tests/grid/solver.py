"""Separate solver for shear buildings, without code of tdint.

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

    The state y contains the displacements, the velocities, and the internal variables of the
    springs and dampers.
    """

    def __init__(self, model, ground, interval):
        stories = model["stories"]
        self.n = len(stories)
        # Lists: single elements of arrays are slow.
        self.ground, self.interval = ground.tolist(), interval
        self.mass = np.array([story["mass"] for story in stories])
        self.start = 0  # index of the sample at the start of the present interval
        self.springs = []  # (story, spring, index of its variable in y)
        self.size = 2 * self.n
        for i, story in enumerate(stories):
            for spring in springs_of(story):
                self.springs.append((i, spring, self.size if spring.variables else None))
                self.size += spring.variables
        self.stiffness = np.zeros(self.n)
        for i, spring, _ in self.springs:
            self.stiffness[i] += spring.k
        self.geometric = np.zeros(self.n)
        if model.get("p_delta"):
            heights = np.array([story["height"] for story in stories])
            self.geometric = GRAVITY * np.cumsum(self.mass[::-1])[::-1] / heights
        self.dashpots = [dashpot_of(story.get("dashpot", 0.0)) for story in stories]
        self.braces = {}  # index of the variable in y by story
        for i, dashpot in enumerate(self.dashpots):
            if dashpot.brace:
                self.braces[i] = self.size
                self.size += 1
        self.damping, self.tangent = damping_of(model, self.mass, self.stiffness, self.geometric)
        self.is_damped = bool(self.damping.any())
        self.masses, self.geometries = self.mass.tolist(), self.geometric.tolist()
        forces = model.get("excitation", {}).get("forces", ())
        self.forces = [
            (force["floor"] - 1, force["amplitude"], force["omega"], force["phase"] == "cos")
            for force in forces
            if "omega" in force
        ]
        self.tables = [ForceTable(force) for force in forces if "points" in force]

    def initial_state(self, model):
        """Return the state at t = 0. Each spring moves monotonically to its initial drift."""
        initial = model.get("initial", {})
        y = np.zeros(self.size)
        y[: self.n] = initial.get("displacement", 0.0)
        y[self.n : 2 * self.n] = initial.get("velocity", 0.0)
        drifts = np.diff(y[: self.n], prepend=0.0)
        for i, spring, variable in self.springs:
            values = spring.go(float(drifts[i]))
            if variable is not None:
                y[variable] = values[0]
        # The direction of the motion after t = 0, by the drift rates and, at rest, accelerations.
        change = self.rates(0.0, y)
        rates = np.diff(change[: self.n], prepend=0.0)
        accelerations = np.diff(change[self.n : 2 * self.n], prepend=0.0)
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
        """Return the forces on the floors at a time, N."""
        loads = [0.0] * self.n
        for floor, amplitude, omega, is_cosine in self.forces:
            loads[floor] += amplitude * (math.cos if is_cosine else math.sin)(omega * t)
        for table in self.tables:
            loads[table.floor] += table.value(t)
        return loads

    def _balance(self, t, y):
        """Return the forces of the springs and dampers, the total shears without viscous forces of
        the floors, the absolute accelerations, and the rates of the state."""
        n, values = self.n, y.tolist()
        change = values[n : 2 * n] + [0.0] * (self.size - n)
        drifts, rates = values[:n], values[n : 2 * n]
        for i in range(n - 1, 0, -1):
            drifts[i] -= drifts[i - 1]
            rates[i] -= rates[i - 1]
        shears = [0.0] * n
        for i, spring, variable in self.springs:
            if variable is None:
                shears[i] += spring.value(drifts[i])
            else:
                shears[i] += spring.value(drifts[i], values[variable])
                change[variable] = spring.rate(rates[i], values[variable])
        dampers = [dashpot.force(rate) for dashpot, rate in zip(self.dashpots, rates, strict=True)]
        for i, variable in self.braces.items():
            dampers[i] = values[variable]
            change[variable] = self.dashpots[i].force_rate(rates[i], values[variable])
        floors = self.loads(t)
        if self.is_damped:
            viscous = (self.damping @ y[n : 2 * n]).tolist()
            floors = [load - force for load, force in zip(floors, viscous, strict=True)]
        ground, above, absolute = self.ground_at(t), 0.0, [0.0] * n
        tangents = [0.0] * n
        if self.tangent:
            for i, spring, variable in self.springs:
                w = 0.0 if variable is None else values[variable]
                tangents[i] += self.tangent[i] * spring.tangent(drifts[i], w)
        for i in range(n - 1, -1, -1):
            total = shears[i] + self.dashpots[i].factor * dampers[i] + tangents[i] * rates[i]
            total -= self.geometries[i] * drifts[i]
            absolute[i] = (floors[i] - total + above) / self.masses[i]
            change[n + i] = absolute[i] - ground
            above = total
        return drifts, shears, dampers, absolute, change

    def rates(self, t, y):
        """Return the rates of the state."""
        return np.array(self._balance(t, y)[-1])

    def quantities(self, t, y):
        """Return the quantities at a time, rows of `QUANTITIES`."""
        drifts, shears, dampers, absolute, _ = self._balance(t, y)
        inertia = np.array(absolute) * self.mass - self.loads(t)
        total_shear = -np.cumsum(inertia[::-1])[::-1]
        n = self.n
        return [drifts, shears, dampers, total_shear, y[:n], y[n : 2 * n], absolute]


def springs_of(story):
    """Return the springs of a story: its elements, or its law."""
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

    def force_rate(self, drift_rate, force):
        """Return the rate of the force of damper and brace, N/s."""
        damper_rate = (abs(force) / self.coefficient) ** (1.0 / self.exponent)
        if self.relief and abs(force) > self.relief["force"]:
            excess = abs(force) - self.relief["force"]
            damper_rate += excess / self.coefficient * (1.0 / self.relief["ratio"] - 1.0)
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
    squares, shapes = eigh(chain_matrix(stiffness - geometric), M)
    omega = np.sqrt(np.maximum(squares, 0.0))
    if isinstance(damping, dict) and "modal" in damping:
        ratios, modal = np.zeros(n), damping["modal"]
        if isinstance(modal, dict):
            ratios[: modal["modes"]] = modal["ratio"]
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
        [story.get("isolator", False) in (False, "rayleigh") for story in stories]
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
    drifts = np.diff(states[:n], axis=0, prepend=0.0)
    rates = np.diff(states[n : 2 * n], axis=0, prepend=0.0)
    first = None
    for i, spring, _ in chain.springs:
        if spring.is_reversible:
            continue
        s, end = spring.side, spring.end

        def excess(t, kind, i=i, s=s, end=end):
            row, y = (i + n if kind == "turn" else i), dense(t)
            value = y[row] - (y[row - 1] if i else 0.0)
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
    drifts = np.diff(y[: chain.n], prepend=0.0)
    for i, spring, variable in chain.springs:
        if spring is changed and kind == "end":
            spring.arrive()
        elif not spring.is_reversible:
            spring.move(float(drifts[i]), 0.0 if variable is None else y[variable])
            if spring is changed:
                spring.turn(-spring.side)


class Peaks:
    """Integration of a building, with the largest absolute values of all quantities so far."""

    def __init__(self, chain, tolerance):
        self.chain, self.tolerance = chain, tolerance
        self.values = np.zeros((len(QUANTITIES), chain.n))
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
    """Return the peaks and the residual drifts of a building by name, arrays over the stories.

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
    return result | {"residual_drift": np.diff(y[: chain.n], prepend=0.0)}
