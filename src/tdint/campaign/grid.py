"""Ground motions at points, drawn for each building among the points near it: nearest neighbors, as in the regional
workflow of SimCenter."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from tdint.campaign.motions import Draw

Array = NDArray[np.float64]

EARTH_RADIUS = 6371.0088
"""Mean radius of the earth, km (IUGG)."""


@dataclass(frozen=True)
class GridDraws:
    """Which motions each building draws.

    Attributes
    ----------
    ids : sequence of str
        Of the buildings.
    places : ndarray, shape (buildings, 3)
        Where they are, as unit vectors from the center of the earth.
    points : ndarray, shape (points, 3)
        The same of the grid's points that have motions.
    motions : tuple of tuples of tuples of int
        Of each point its ground motions: of each the numbers of its components.
    neighbors, samples, seed : int
        Points among which is drawn, draws, and what is drawn from, with the building's id.
    """

    ids: Sequence[str] = field(repr=False)
    places: Array = field(repr=False)
    points: Array = field(repr=False)
    motions: tuple[tuple[tuple[int, ...], ...], ...] = field(repr=False)
    neighbors: int
    samples: int
    seed: int

    def draws(self, building: int) -> Sequence[Draw]:
        """Points by their weights, with replacement; then one of the point's ground motions, each as likely."""
        random = np.random.default_rng([self.seed, *self.ids[building].encode()])
        near, weights = self.weights(building)
        points = random.choice(near, size=self.samples, p=weights)
        found = []
        for sample, point in enumerate(points.tolist(), start=1):
            choices = self.motions[point]
            chosen = choices[int(random.integers(len(choices)))]
            found += [Draw(motion, sample) for motion in chosen]
        return sorted(found)

    def weights(self, building: int) -> tuple[NDArray[np.int64], Array]:
        """The points near a building, and how likely each is: by 1 / distance^2."""
        count = min(self.neighbors, len(self.points))
        distances, near = self._tree.query(self.places[building], k=np.arange(1, count + 1))
        at = distances == 0.0
        weights = at.astype(float) if at.any() else (distances[0] / distances) ** 2
        return near.astype(np.int64), weights / weights.sum()

    def description(self) -> dict[str, object]:
        return {"neighbors": self.neighbors, "samples": self.samples, "draw_seed": self.seed}

    @cached_property
    def _tree(self) -> Any:
        return cKDTree(self.points)


def unit_vectors(degrees: Array) -> Array:
    """Directions from the center of the earth to places given as longitude and latitude; shape (k, 3)."""
    longitude, latitude = np.radians(degrees).T
    return np.column_stack(
        [np.cos(latitude) * np.cos(longitude), np.cos(latitude) * np.sin(longitude), np.sin(latitude)]
    )
