"""Closings of links with stops: their times, forces and energies.

They follow from the deformations and their rates at the time steps, by a cubic Hermite polynomial
in each step.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING, Annotated

import numpy as np

from tdint.arrays import Array
from tdint.kernels import layout as rows
from tdint.model.building import assemble
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


def has_stops(model: Model) -> bool:
    """Return True if a link of a model has a law with stops."""
    return any(map(any, _stops(model)))


def _stops(model: Model) -> list[tuple[float, float, float]]:
    """Return the stops of the law of each link (`DriftLaw.stops`)."""
    return [LAWS[link.spring.law.name].stops(link.spring.law.parameters) for link in model.links]


def contacts_of(model: Model, history: History) -> tuple[LinkContact, ...]:
    """Return the contacts of all links with stops, by link and time, from all steps of a run."""
    damping = assemble(model).linear_terms[rows.TANGENT_DAMPING]
    found: list[LinkContact] = []
    for number, (link, (positive, negative, stiffness)) in enumerate(
        zip(model.links, _stops(model), strict=True)
    ):
        displacement, velocity = _motion(history, link.ends)
        exponent = LAWS[link.spring.law.name].stop_exponent
        damper = damping[len(model.stories) + len(model.attachments) + number]
        motion = history.time, link.sign * displacement, link.sign * velocity
        numbers = [
            numbers
            for gap, side in ((positive, 1.0), (negative, -1.0))
            if math.isfinite(gap) and gap
            for numbers in _passages(motion, gap, side, (stiffness, exponent, damper))
        ]
        found += [
            LinkContact(link.name, i, *values) for i, values in enumerate(sorted(numbers), start=1)
        ]
    return tuple(found)


def _motion(history: History, ends: tuple[int, int]) -> tuple[Array, Array]:
    """Return the deformation of a link (m) and its rate (m/s) at all times."""
    devices = history.devices
    assert devices is not None
    count = len(devices.attachments)
    ground = np.zeros((len(history.time), 1))
    series = (
        np.hstack([ground, of_floors, of_devices[:, :count]])
        for of_floors, of_devices in (
            (history.displacement, devices.displacement),
            (history.velocity, devices.velocity),
        )
    )
    start, end = ends
    displacement, velocity = (values[:, end] - values[:, start] for values in series)
    return displacement, velocity


def _passages(
    motion: tuple[Array, Array, Array], gap: float, side: float, stop: tuple[float, float, float]
) -> list[tuple[float, ...]]:
    """Return the times, durations, rates, peak forces and energies of the contacts with a stop.

    `motion` is time, deformation in the direction of the law and its rate. The stop is at `gap`
    times `side`; `stop` contains its stiffness, the exponent of its force, and its coefficient of
    damping (`DriftLaw.tangent_damping`). With the exponent 1 the dashpot is constant, otherwise it
    is proportional to the force over the approach velocity.
    """
    from scipy.interpolate import CubicHermiteSpline  # few models have contacts

    time, deformation, rate = motion
    stiffness, exponent, damper = stop
    overlap = CubicHermiteSpline(time, side * deformation - gap, side * rate)
    speed = overlap.derivative()
    crossings = overlap.roots(extrapolate=False)
    ends = np.unique(np.concatenate([time[[0, -1]], crossings[np.isfinite(crossings)]]))
    found = []
    for start, end in pairwise(ends):
        if overlap(0.5 * (start + end)) > 0.0:
            points = np.linspace(start, end, _POINTS + 1)
            rates = speed(points)
            force = stiffness * np.maximum(overlap(points), 0.0) ** exponent
            approach = abs(rates[0])
            dashpot = damper * (stiffness if exponent == 1.0 else force / (approach or math.inf))
            force = force + dashpot * rates
            power = dashpot * rates**2
            energy = (points[1] - points[0]) * (power.sum() - 0.5 * (power[0] + power[-1]))
            numbers = start, end - start, approach, np.abs(force).max(), energy
            found.append(tuple(map(float, numbers)))
    return found
