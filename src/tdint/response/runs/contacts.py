"""Closings of links with stops: their times, forces and energies.

They follow from the deformations and their rates at the time steps, by a cubic Hermite polynomial
in each step. A closing or opening divides its step: the acceleration without the force of the stop
is linear in the step, and determines the motion on the open side of the instant.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import TYPE_CHECKING, Annotated, Any, NamedTuple

import numpy as np

from tdint.arrays import Array
from tdint.kernels import layout as rows
from tdint.model.building import Building, assemble
from tdint.model.story_laws import LAWS
from tdint.response.runs.history import History
from tdint.units import Quantity

if TYPE_CHECKING:
    from tdint.model.definition import Model

_POINTS = 400
"""Number of intervals of a contact. The force is smooth: a maximum between two points is at most a
relative 1e-5 larger."""


@dataclass(frozen=True, eq=False)
class LinkContact:
    """Contact of a link from a closing to the next opening, or to the end of the run.

    Attributes
    ----------
    link : str
        Name of the link.
    closing : int
        Number of the closing of the link, from 1.
    errors : LinkContact or None
        Estimated errors of the numbers, if those of the run were estimated; nan for a contact that
        the additional run does not have.
    """

    link: str
    closing: int
    time: Annotated[float, Quantity("s", "time of the closing from the first sample")]
    duration: Annotated[float, Quantity("s", "time from the closing to the opening")]
    approach_velocity: Annotated[
        float, Quantity("m/s", "absolute rate of the deformation at the closing")
    ]
    peak_force: Annotated[
        float, Quantity("N", "maximum absolute force of stop and dashpot during the contact")
    ]
    dissipated_energy: Annotated[
        float, Quantity("J", "energy dissipated by the dashpot of the contact")
    ]
    errors: LinkContact | None = None

    @property
    def numbers(self) -> tuple[float, ...]:
        """Time, duration, approach velocity, peak force and dissipated energy, SI units."""
        return (
            self.time,
            self.duration,
            self.approach_velocity,
            self.peak_force,
            self.dissipated_energy,
        )


def has_stops(model: Model) -> bool:
    """Return True if a link of a model has a law with stops."""
    return any(map(any, _stops(model)))


def _stops(model: Model) -> list[tuple[float, float, float]]:
    """Return the stops of the law of each link (`DriftLaw.stops`)."""
    return [LAWS[link.spring.law.name].stops(link.spring.law.parameters) for link in model.links]


def contacts_of(model: Model, history: History) -> tuple[LinkContact, ...]:
    """Return the contacts of all links with stops, by link and time, from all steps of a run."""
    building = assemble(model)
    damping = building.linear_terms[rows.TANGENT_DAMPING]
    found: list[LinkContact] = []
    for number, (link, (positive, negative, stiffness)) in enumerate(
        zip(model.links, _stops(model), strict=True)
    ):
        damper = damping[len(model.stories) + len(model.attachments) + number]
        stop = Stop(
            stiffness,
            LAWS[link.spring.law.name].stop_exponent,
            damper,
            _inverse_mass(building, link.ends),
        )
        motion = link.sign * _motion(history, link.ends)
        numbers = [
            numbers
            for gap, side in ((positive, 1.0), (negative, -1.0))
            if math.isfinite(gap) and gap
            for numbers in _passages(history.time, side * motion - [gap, 0.0, 0.0], stop)
        ]
        found += [
            LinkContact(link.name, i, *values) for i, values in enumerate(sorted(numbers), start=1)
        ]
    return tuple(found)


def with_errors(
    contacts: Sequence[LinkContact],
    others: Sequence[LinkContact],
    error: Callable[[Array, Array, Array], Array],
) -> tuple[LinkContact, ...]:
    """Return contacts with estimated errors from those of an additional run.

    Two contacts of a link are compared if the closing of each is the nearest to that of the other.
    `error` receives the numbers of both runs and their sizes; the size of a time is the duration.
    """

    def nearest(contact: LinkContact, found: Sequence[LinkContact]) -> LinkContact | None:
        of_link = [other for other in found if other.link == contact.link]
        return min(of_link, key=lambda other: abs(other.time - contact.time), default=None)

    pairs = [(contact, nearest(contact, others)) for contact in contacts]
    same = [i for i, (one, other) in enumerate(pairs) if other and nearest(other, contacts) is one]
    errors = np.full((len(contacts), 5), math.nan)
    if same:
        own = np.array([contacts[i].numbers for i in same])
        finer = np.array([other.numbers for i in same if (other := pairs[i][1])])
        size = own[:, [1, 1, 2, 3, 4]]
        errors[same] = np.column_stack([*map(error, own.T, finer.T, size.T)])
    rows: list[Any] = errors.tolist()
    return tuple(
        replace(contact, errors=LinkContact(contact.link, contact.closing, *numbers))
        for contact, numbers in zip(contacts, rows, strict=True)
    )


def _inverse_mass(building: Building, ends: tuple[int, int]) -> float:
    """Return the change of the acceleration between both ends of a link per force, 1/kg. An end is
    0 for the ground, otherwise 1 plus the column of its floor."""
    pattern = np.zeros(1 + building.masses)
    pattern[list(ends)] = -1.0, 1.0
    mass = np.diag(building.mass)
    if building.inertial and building.system is not None:
        mass = building.system.mass
    return float(pattern[1:] @ np.linalg.solve(mass, pattern[1:]))


def _motion(history: History, ends: tuple[int, int]) -> Array:
    """Return the deformation of a link (m), its rate (m/s) and its acceleration (m/s^2) at all
    times, shape (times, 3)."""
    devices = history.devices
    assert devices is not None
    count, ground = len(devices.attachments), np.zeros(len(history.time))
    series = (
        np.column_stack([of_ground, of_floors, of_devices[:, :count]])
        for of_ground, of_floors, of_devices in (
            (ground, history.displacement, devices.displacement),
            (ground, history.velocity, devices.velocity),
            (
                history.ground_acceleration,
                history.absolute_acceleration,
                devices.absolute_acceleration,
            ),
        )
    )
    start, end = ends
    return np.column_stack([values[:, end] - values[:, start] for values in series])


class Stop(NamedTuple):
    """Stop of a link.

    Attributes
    ----------
    stiffness, exponent : float
        The force is `stiffness` times the overlap (m) to the power of `exponent`, N.
    damper : float
        Coefficient of the damping (`DriftLaw.tangent_damping`). With the exponent 1 the dashpot is
        constant, otherwise it is proportional to the force over the approach velocity.
    inverse_mass : float
        Change of the acceleration between both ends of the link per force, 1/kg.
    """

    stiffness: float
    exponent: float
    damper: float
    inverse_mass: float

    def forces(self, overlap: Array, approach: float) -> tuple[Array, Array]:
        """Return the spring force (N) and the coefficient of the dashpot (N s/m) in contact."""
        force = self.stiffness * np.maximum(overlap, 0.0) ** self.exponent
        if self.exponent == 1.0:
            return force, np.full_like(force, self.damper * self.stiffness)
        return force, self.damper * force / (approach or math.inf)


def _passages(
    time: Array, motion: Array, stop: Stop
) -> list[tuple[float, float, float, float, float]]:
    """Return the times, durations, rates, peak forces and energies of the contacts with a stop.

    `motion` has the overlap, its rate and its acceleration in columns.
    """
    # Imported here, because few models have contacts.
    from scipy.integrate import simpson
    from scipy.interpolate import CubicHermiteSpline

    overlap = CubicHermiteSpline(time, motion[:, 0], motion[:, 1])
    crossings = overlap.roots(extrapolate=False)
    crossings = crossings[np.isfinite(crossings)]
    steps = np.clip(np.searchsorted(time, crossings) - 1, 0, time.size - 2)
    knots = [np.column_stack([time, motion[:, :2]])]
    for k, step in enumerate(steps):
        ends = motion[step : step + 2]
        if np.count_nonzero(steps == step) == 1 and ends[0, 0] * ends[1, 0] < 0.0:
            h, approach = time[step + 1] - time[step], abs(float(overlap(crossings[k], 1)))
            located = _located(h, ends, stop, crossings[k] - time[step], approach)
            if located is not None:
                crossings[k] = time[step] + located[0]
                knots.append(np.array([[crossings[k], 0.0, located[1]]]))
    table = np.concatenate(knots)
    overlap = CubicHermiteSpline(*table[np.argsort(table[:, 0])].T)
    speed = overlap.derivative()
    instants = np.unique(np.concatenate([time[[0, -1]], crossings]))
    found = []
    for start, end in pairwise(instants):
        if overlap(0.5 * (start + end)) > 0.0:
            points = np.linspace(start, end, _POINTS + 1)
            rates = speed(points)
            approach = abs(rates[0])
            force, dashpot = stop.forces(overlap(points), approach)
            force = force + dashpot * rates
            energy = simpson(dashpot * rates**2, x=points)
            peak = float(np.abs(force).max())
            found.append((float(start), float(end - start), float(approach), peak, float(energy)))
    return found


def _located(
    h: float, ends: Array, stop: Stop, first: float, approach: float
) -> tuple[float, float] | None:
    """Return the time of a closing or opening from the start of its step, s, and the rate of the
    overlap there, m/s; None if there is no such instant in the step.

    `ends` has the overlap, its rate and its acceleration at both ends of the step (rows), `first`
    and `approach` are the time and the absolute rate of the cubic polynomial.
    """
    force, dashpot = stop.forces(ends[:, 0], approach)
    total = np.where(ends[:, 0] > 0.0, force + dashpot * ends[:, 1], 0.0)
    without = ends[:, 2] + stop.inverse_mass * total
    # From the open end of the step, backwards in time after an opening
    closes = ends[0, 0] < 0.0
    direction, (open_end, other) = (1.0, (0, 1)) if closes else (-1.0, (1, 0))
    overlap, rate = ends[open_end, 0], direction * ends[open_end, 1]
    change = (without[other] - without[open_end]) / h
    terms = np.array([change / 6.0, 0.5 * without[open_end], rate, overlap])
    roots = np.roots(terms)
    times = roots.real[(abs(roots.imag) <= 1e-9 * h) & (roots.real > 0.0) & (roots.real < h)]
    if not times.size:
        return None
    times = times if closes else h - times
    time = float(times[np.argmin(abs(times - first))])
    passed = time if closes else h - time
    return time, float(direction * np.polyval(np.polyder(terms), passed))
