"""The ground motions of a campaign, and which of them each building gets: all, or draws among those near it.

Draws are by nearest neighbors, as in the regional workflow of SimCenter.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from tdint.arrays import Array
from tdint.errors import TdintError
from tdint.ground_motion.reading.suites import SuiteMotion
from tdint.model.inventory.table import InventoryRow

EARTH_RADIUS = 6371.0088
"""Mean radius of the earth, km (IUGG)."""


class Draw(NamedTuple):
    """A motion by its number that a building gets, the number of the draw (0 where nothing is drawn), and the factor
    that the motion has where it is drawn."""

    motion: int
    sample: int
    factor: float = 1.0


@dataclass(frozen=True)
class FieldMotions:
    """Ground motions of events at sites.

    Attributes
    ----------
    events : tuple of str
        The events, which are numbered from 1.
    sites : tuple of str
        The sites.
    motions : tuple of tuples of Draw
        Of each site the motions there; the number of a draw is that of its event.
    places : sequence of tuples of two floats
        Longitude and latitude of the sites, degrees; empty where buildings name theirs.
    """

    events: tuple[str, ...]
    sites: tuple[str, ...] = field(repr=False)
    motions: tuple[tuple[Draw, ...], ...] = field(repr=False)
    places: Sequence[tuple[float, float]] = field(default=(), repr=False)

    def nearest(self, rows: Sequence[InventoryRow], distance: str) -> NDArray[np.int64]:
        """Of each building, all of which have a place, the number of the nearest site."""
        here, there = (coordinates(places, distance) for places in (places_of(rows), self.places))
        return np.asarray(cKDTree(there).query(here)[1], dtype=np.int64)


@dataclass(frozen=True)
class FieldDraws:
    """Each building has all events of its site, nothing is drawn: how the motions of one event lie to each other is
    that of the fields.

    Attributes
    ----------
    field : FieldMotions
        The motions.
    site_of : ndarray of int, shape (buildings,)
        The site of each building.
    """

    field: FieldMotions
    site_of: NDArray[np.int64]

    def draws(self, building: int) -> Sequence[Draw]:
        return self.field.motions[self.site_of[building]]

    def description(self) -> dict[str, object]:
        whole = repr((self.field.sites, self.field.motions, self.site_of.tolist()))
        return {"events": self.field.events, "field_sha256": hashlib.sha256(whole.encode()).hexdigest()}


PointMotion = tuple[tuple[int, ...], float]
"""A ground motion at a point of a grid: the numbers of its components, and the factor on it there."""


@dataclass(frozen=True)
class GridMotions:
    """Ground motions at points of a grid.

    Attributes
    ----------
    places : sequence of tuples of two floats
        Longitude and latitude of the points that have motions, degrees.
    motions : tuple of tuples of PointMotion
        Of each point its ground motions.
    """

    places: Sequence[tuple[float, float]] = field(repr=False)
    motions: tuple[tuple[PointMotion, ...], ...] = field(repr=False)


@dataclass(frozen=True)
class FoundMotions:
    """Ground motions that were read, what could not be, what a person should know of them, and where they are."""

    motions: tuple[SuiteMotion, ...]
    failures: tuple[TdintError, ...]
    notes: tuple[str, ...] = ()
    places: GridMotions | FieldMotions | None = None


@dataclass(frozen=True)
class EveryMotion:
    """All buildings get all motions."""

    count: int

    def draws(self, building: int) -> Sequence[Draw]:
        """The motions of a building."""
        return [Draw(motion, 0) for motion in range(self.count)]

    def description(self) -> dict[str, object]:
        """What is drawn and how, for the fingerprint."""
        return {}


@dataclass(frozen=True)
class GridDraws:
    """Which motions each building draws.

    Attributes
    ----------
    ids : sequence of str
        Of the buildings.
    places : ndarray, shape (buildings, 2 or 3)
        Where they are, by `coordinates`.
    points : ndarray, shape (points, 2 or 3)
        The same of the grid's points that have motions.
    motions : tuple of tuples of PointMotion
        Of each point its ground motions.
    neighbors, samples, seed : int
        Points among which is drawn, draws, and what is drawn from, with the building's id.
    distance : str
        Of `COORDINATES`.
    """

    ids: Sequence[str] = field(repr=False)
    places: Array = field(repr=False)
    points: Array = field(repr=False)
    motions: tuple[tuple[PointMotion, ...], ...] = field(repr=False)
    neighbors: int
    samples: int
    seed: int
    distance: str = "km"

    def draws(self, building: int) -> Sequence[Draw]:
        """Points by their weights, with replacement; then one of the point's ground motions, each as likely."""
        random = np.random.default_rng([self.seed, *self.ids[building].encode()])
        near, weights = self.weights(building)
        points = random.choice(near, size=self.samples, p=weights)
        found = []
        for sample, point in enumerate(points.tolist(), start=1):
            choices = self.motions[point]
            chosen, factor = choices[int(random.integers(len(choices)))]
            found += [Draw(motion, sample, factor) for motion in chosen]
        return sorted(found)

    def weights(self, building: int) -> tuple[NDArray[np.int64], Array]:
        """The points near a building, and how likely each is: by 1 / distance^2."""
        count = min(self.neighbors, len(self.points))
        distances, near = self._tree.query(self.places[building], k=np.arange(1, count + 1))
        at = distances == 0.0
        weights = at.astype(float) if at.any() else (distances[0] / distances) ** 2
        return near.astype(np.int64), weights / weights.sum()

    def description(self) -> dict[str, object]:
        grid = hashlib.sha256(repr((self.points.tolist(), self.motions)).encode()).hexdigest()
        numbers = {"neighbors": self.neighbors, "samples": self.samples, "draw_seed": self.seed}
        return {**numbers, "distance": self.distance, "grid_sha256": grid}

    @cached_property
    def _tree(self) -> Any:
        return cKDTree(self.points)


Assignment = EveryMotion | FieldDraws | GridDraws
"""Which motions each building gets; `EveryMotion` says what all of them tell."""


def places_of(rows: Sequence[InventoryRow]) -> list[tuple[float, float]]:
    """Longitude and latitude of buildings, degrees."""
    return [(row.longitude or 0.0, row.latitude or 0.0) for row in rows]


def coordinates(places: Sequence[tuple[float, float]], distance: str) -> Array:
    """Points whose distances are those that are meant (`COORDINATES`), of longitudes and latitudes in degrees."""
    return COORDINATES[distance](np.array(places, dtype=np.float64).reshape(-1, 2))


def unit_vectors(degrees: Array) -> Array:
    """Directions from the center of the earth to places given as longitude and latitude; shape (k, 3)."""
    longitude, latitude = np.radians(degrees).T
    return np.column_stack(
        [np.cos(latitude) * np.cos(longitude), np.cos(latitude) * np.sin(longitude), np.sin(latitude)]
    )


COORDINATES: Mapping[str, Callable[[Array], Array]] = {"km": unit_vectors, "degrees": lambda degrees: degrees}
"""What distances are between: places on the earth, or, as in SimCenter's workflow, degrees of longitude and latitude as
if they were alike and the plane did not end."""
