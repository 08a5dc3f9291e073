"""The ground motions of a campaign: which of them each building gets, all or draws among those near
it, and how strong they are made, by factors that are given or found from a measure of intensity.

Draws are by nearest neighbors, as in the regional workflow of SimCenter.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from tdint.analysis.spectra.elastic import SA_DAMPING
from tdint.arrays import Array, cached_property
from tdint.campaign.intensity import IntensityMeasure, factor_to
from tdint.errors import ModelError, TdintError
from tdint.ground_motion.reading.suites import GroundMotion, SuiteMotion, suite_motions
from tdint.model.inventory import InventoryRows

MAX_DISTANCE = 15e3
"""Of a building from the site whose motions it gets, m; `asset_hazard_distance` of OpenQuake has
this by default."""

_EARTH = 6371e3  # m, mean radius

Places = Sequence[tuple[float, float]] | Array
"""Longitudes and latitudes, degrees."""


class Draw(NamedTuple):
    """A motion by its number that a building gets, the number of the draw (0 where nothing is
    drawn), and the factor that the motion has where it is drawn."""

    motion: int
    sample: int
    factor: float = 1.0


@dataclass(frozen=True)
class FieldMotions:
    """Ground motions of events at sites: rows in the order of the sites, of which there may be
    millions.

    Attributes
    ----------
    events : tuple of str
        The events, which are numbered from 1.
    sites : tuple of str
        The sites.
    start : ndarray of int, shape (sites + 1,)
        The first row of each site, and how many there are.
    event, record : ndarray of int, shape (rows,)
        The number of the event, and of the record that it brings there.
    value : ndarray, shape (rows,)
        The factor on the record, or the intensity that it is brought to.
    motions : tuple of tuples of (int, float)
        Of each record its motions by their numbers, and what a value is divided by for their
        factor.
    places : sequence of tuples of two floats
        Longitude and latitude of the sites, degrees; empty where buildings name theirs.
    """

    events: tuple[str, ...]
    sites: tuple[str, ...] = field(repr=False)
    start: NDArray[np.int64] = field(repr=False)
    event: NDArray[np.int32] = field(repr=False)
    record: NDArray[np.int32] = field(repr=False)
    value: Array = field(repr=False)
    motions: tuple[tuple[tuple[int, float], ...], ...] = field(repr=False)
    places: Sequence[tuple[float, float]] = field(default=(), repr=False)

    @classmethod
    def of_rows(
        cls,
        events: Sequence[str],
        sites: Sequence[str],
        rows: tuple[NDArray[np.int32], NDArray[np.int32], NDArray[np.int32], Array],
        motions: Sequence[tuple[tuple[int, float], ...]],
        places: Sequence[tuple[float, float]] = (),
    ) -> FieldMotions:
        """Of rows in any order: site, event, record and value of each."""
        site, event, record, value = rows
        order = np.argsort(site, kind="stable")
        start = np.searchsorted(site[order], np.arange(len(sites) + 1))
        in_order = event[order], record[order], value[order]
        return cls(tuple(events), tuple(sites), start, *in_order, tuple(motions), places)

    def draws(self, site: int) -> list[Draw]:
        """The motions at a site; the number of a draw is that of its event."""
        here = slice(int(self.start[site]), int(self.start[site + 1]))
        rows = zip(
            self.event[here].tolist(),
            self.record[here].tolist(),
            self.value[here].tolist(),
            strict=True,
        )
        return sorted(
            Draw(motion, event, value / part)
            for event, record, value in rows
            for motion, part in self.motions[record]
        )


@dataclass(frozen=True)
class FieldDraws:
    """Each building has all events of its site, nothing is drawn: how the motions of one event lie
    to each other is that of the fields.

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
        return self.field.draws(int(self.site_of[building]))

    def counts(self, buildings: int, runs: Callable[[int], int]) -> NDArray[np.int64]:
        field = self.field
        of_record = np.array(
            [sum(runs(motion) for motion, _ in motions) for motions in field.motions],
            dtype=np.int64,
        )
        before = np.concatenate([[0], np.cumsum(of_record[field.record])])
        return np.asarray(np.diff(before[field.start])[self.site_of], dtype=np.int64)

    def description(self) -> dict[str, object]:
        field, whole = (
            self.field,
            hashlib.sha256(repr((self.field.sites, self.field.motions)).encode()),
        )
        for part in (field.start, field.event, field.record, field.value, self.site_of):
            whole.update(part.tobytes())
        return {"events": field.events, "field_sha256": whole.hexdigest()}


PointMotion = tuple[tuple[int, ...], float]
"""A ground motion at a point of a grid: the numbers of its components, and the factor on it
there."""


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
    """Ground motions that were read, what could not be, what a person should know of them, where
    they are, and how often their events come in a year."""

    motions: tuple[SuiteMotion, ...] = ()
    failures: tuple[TdintError, ...] = ()
    notes: tuple[str, ...] = ()
    places: GridMotions | FieldMotions | None = None
    rates: Mapping[str, float] = field(default_factory=dict)


@dataclass(frozen=True)
class EveryMotion:
    """All buildings get all motions."""

    count: int

    def draws(self, building: int) -> Sequence[Draw]:
        """The motions of a building."""
        return [Draw(motion, 0) for motion in range(self.count)]

    def counts(self, buildings: int, runs: Callable[[int], int]) -> NDArray[np.int64]:
        """How many runs each building has, where a motion has so many."""
        return np.full(buildings, sum(map(runs, range(self.count))), dtype=np.int64)

    def description(self) -> dict[str, object]:
        """What is drawn and how, for the fingerprint."""
        return {}


@dataclass(frozen=True)
class GridFile:
    """Ground motions at points of a grid, drawn for each building among those near it.

    Attributes
    ----------
    file : str
        EventGrid.csv.
    units : str
        Of the motions' samples.
    neighbors, samples : int
        Points among which is drawn, and draws for each building.
    seed : int
        What is drawn from, with the building's id.
    distance : str
        As of `tdint.campaign.motions.COORDINATES`.
    events : bool
        Nothing is drawn: rows of the points' files are events, and a building has those of the
        nearest point.
    max_distance : float
        Buildings whose nearest point is farther away are left out, m.
    """

    file: str
    units: str
    neighbors: int
    samples: int
    seed: int
    distance: str = "km"
    events: bool = False
    max_distance: float = MAX_DISTANCE


@dataclass(frozen=True)
class GridDraws:
    """Which motions each building draws.

    Attributes
    ----------
    rows : InventoryRows
        The buildings, each with its place.
    grid : GridMotions
        The points that have motions.
    wanted : GridFile
        How they are drawn.
    """

    rows: InventoryRows = field(repr=False)
    grid: GridMotions
    wanted: GridFile

    def draws(self, building: int) -> Sequence[Draw]:
        """Points by their weights, with replacement; then one of the point's ground motions, each
        as likely."""
        random = np.random.default_rng([self.wanted.seed, *self.rows[building].id.encode()])
        near, weights = self.weights(building)
        points = random.choice(near, size=self.wanted.samples, p=weights)
        drawn = []
        for sample, point in enumerate(points.tolist(), start=1):
            choices = self.grid.motions[point]
            chosen, factor = choices[int(random.integers(len(choices)))]
            drawn += [Draw(motion, sample, factor) for motion in chosen]
        return sorted(drawn)

    def counts(self, buildings: int, runs: Callable[[int], int]) -> NDArray[np.int64]:
        # All choices bring as many runs almost always: nothing needs to be drawn then.
        each = {sum(map(runs, chosen)) for choices in self.grid.motions for chosen, _ in choices}
        if len(each) == 1:
            return np.full(buildings, self.wanted.samples * each.pop(), dtype=np.int64)
        drawn = map(self.draws, range(buildings))
        return np.array(
            [sum(runs(draw.motion) for draw in draws) for draws in drawn], dtype=np.int64
        )

    def weights(self, building: int) -> tuple[NDArray[np.int64], Array]:
        """The points near a building, and how likely each is: by 1 / distance^2."""
        count = min(self.wanted.neighbors, self._tree.n)
        distances, near = self._tree.query(self._places[building], k=np.arange(1, count + 1))
        at = distances == 0.0
        weights = at.astype(float) if at.any() else (distances[0] / distances) ** 2
        return near.astype(np.int64), weights / weights.sum()

    def description(self) -> dict[str, object]:
        grid_file, grid = self.wanted, repr((self._tree.data.tolist(), self.grid.motions))
        numbers = {
            "neighbors": grid_file.neighbors,
            "samples": grid_file.samples,
            "draw_seed": grid_file.seed,
        }
        return {
            **numbers,
            "distance": grid_file.distance,
            "grid_sha256": hashlib.sha256(grid.encode()).hexdigest(),
        }

    @cached_property
    def _places(self) -> Array:
        return coordinates(self.rows.places, self.wanted.distance)

    @cached_property
    def _tree(self) -> Any:
        return cKDTree(coordinates(self.grid.places, self.wanted.distance))


Assignment = EveryMotion | FieldDraws | GridDraws
"""Which motions each building gets; `EveryMotion` says what all of them tell."""


def nearest(here: Places, there: Places, distance: str) -> NDArray[np.int64]:
    """Of each place the number of the nearest of others."""
    return np.asarray(
        cKDTree(coordinates(there, distance)).query(coordinates(here, distance))[1], dtype=np.int64
    )


def meters(here: Places, there: Places) -> Array:
    """The distance of each place from another one on the earth, m."""
    chord = np.linalg.norm(coordinates(here, "km") - coordinates(there, "km"), axis=1)
    return np.asarray(2.0 * _EARTH * np.arcsin(np.minimum(0.5 * chord, 1.0)))


def coordinates(places: Places, distance: str) -> Array:
    """Points whose distances are those that are meant (`COORDINATES`), of longitudes and latitudes
    in degrees."""
    return COORDINATES[distance](np.array(places, dtype=np.float64).reshape(-1, 2))


def unit_vectors(degrees: Array) -> Array:
    """Directions from the center of the earth to places given as longitude and latitude; shape (k,
    3)."""
    longitude, latitude = np.radians(degrees).T
    return np.column_stack(
        [
            np.cos(latitude) * np.cos(longitude),
            np.cos(latitude) * np.sin(longitude),
            np.sin(latitude),
        ]
    )


COORDINATES: Mapping[str, Callable[[Array], Array]] = {
    "km": unit_vectors,
    "degrees": lambda degrees: degrees,
}
"""What distances are between: places on the earth, or, as in SimCenter's workflow, degrees of
longitude and latitude as if they were alike and the plane did not end."""


@dataclass(frozen=True)
class Scales:
    """The same factors on all motions.

    Attributes
    ----------
    values : tuple of float
        The factors.
    by_period : bool
        Whether they hang on the building, by its first period; else nobody needs to find it.
    of_value : bool
        Whether they bring a motion to a value, whatever factor it has in a grid; else they come on
        top of it.
    """

    values: tuple[float, ...]
    by_period: bool = field(default=False, init=False)
    of_value: bool = field(default=False, init=False)

    def count(self, motion: int) -> int:
        """How many factors a motion has."""
        return len(self.values)

    def factors(self, motion: int, periods: Sequence[float]) -> Sequence[tuple[float, ...]]:
        """The factors of a motion under each of some buildings, by their first periods, s."""
        return [self.values] * len(periods)

    def description(self) -> dict[str, object]:
        """What was asked for, for the fingerprint."""
        return {"scales": list(self.values)}


@dataclass(frozen=True)
class FactorTable:
    """Factors by the names of motions and components, as a CSV file has them; no component stands
    for all.

    Attributes
    ----------
    source : str
        The file as the user named it.
    by_name : mapping
        (record, component) -> factors.
    scaled : mapping
        What `tdint scale` told beside the file of how they came about; empty where it did not.
    """

    source: str
    by_name: Mapping[tuple[str, str], tuple[float, ...]]
    scaled: Mapping[str, Any] = field(default_factory=dict)

    def of(self, motion: SuiteMotion) -> tuple[float, ...]:
        """The factors of a motion: by its own name, by its file's, by its pair's.

        Raises
        ------
        ModelError
            There are none.
        """
        whole = motion.whole
        names = dict.fromkeys([motion.name, Path(motion.name).name, whole.source])
        components = dict.fromkeys([motion.component, whole.component, ""])
        for key in ((name, component) for name in names for component in components):
            if key in self.by_name:
                return self.by_name[key]
        raise ModelError(
            f"{self.source}: no factor for {motion.name} {motion.component}; without records the "
            "records of the table are used"
        )

    def of_motions(self, motions: Sequence[GroundMotion]) -> list[float]:
        """Return the factor of each motion; both components of a pair have one factor.

        Raises
        ------
        ModelError
            A motion has no factor, or several.
        """
        factors: dict[int, dict[float, None]] = {}
        for motion in suite_motions(motions):
            factors.setdefault(id(motion.whole), {}).update(dict.fromkeys(self.of(motion)))
        for whole in motions:
            values = factors[id(whole)]
            if len(values) > 1:
                listed = ", ".join(f"{value:g}" for value in values)
                raise ModelError(
                    f"{self.source}: {whole.source} {whole.component} has the factors {listed}; "
                    "give one factor"
                )
        return [next(iter(factors[id(whole)])) for whole in motions]


@dataclass(frozen=True)
class GivenFactors:
    """Factors of each motion by its number, as `tdint scale` finds them."""

    by_motion: Mapping[int, tuple[float, ...]]
    by_period: bool = field(default=False, init=False)
    of_value: bool = field(default=False, init=False)

    def count(self, motion: int) -> int:
        return len(self.by_motion[motion])

    def factors(self, motion: int, periods: Sequence[float]) -> Sequence[tuple[float, ...]]:
        return [self.by_motion[motion]] * len(periods)

    def description(self) -> dict[str, object]:
        return {"factors": {str(motion): list(values) for motion, values in self.by_motion.items()}}


@dataclass(frozen=True)
class MeasureLevels:
    """Values that an intensity measure is to take.

    Attributes
    ----------
    measure : callable
        A period (s) -> the measure.
    period : float or None
        Its period, s; None for the first period of each building.
    values : tuple of float
        The values, in SI units.
    pair : str
        What stands for a pair of components, a name of `tdint.campaign.intensity.PAIRS`.
    motions : sequence of SuiteMotion
        What is brought to them.
    """

    measure: Callable[[float], IntensityMeasure]
    period: float | None
    values: tuple[float, ...]
    pair: str
    motions: Sequence[SuiteMotion] = ()
    of_value: bool = field(default=True, init=False)

    def count(self, motion: int) -> int:
        return len(self.values)

    @property
    def by_period(self) -> bool:
        return self.period is None

    def factors(self, motion: int, periods: Sequence[float]) -> Sequence[tuple[float, ...]]:
        """Both components of a pair have the same ones."""
        whole, by_period = self.motions[motion].whole, dict[float, tuple[float, ...]]()
        for period in dict.fromkeys(self._at(periods)):
            measure = self.measure(period)
            measured = measure.of(whole, self.pair)
            by_period[period] = tuple(factor_to(value, measure, measured) for value in self.values)
        return [by_period[period] for period in self._at(periods)]

    def _at(self, periods: Sequence[float]) -> Sequence[float]:
        return periods if self.period is None else [self.period] * len(periods)

    def description(self) -> dict[str, object]:
        measure = self.measure(1.0)
        name, damping = measure.name.partition("(")[0], getattr(measure, "damping", SA_DAMPING)
        period = "T1" if self.period is None else self.period
        other = {} if damping == SA_DAMPING else {"damping": damping}
        return {
            "measure": name,
            "period": period,
            "levels": list(self.values),
            "pair": self.pair,
            **other,
        }


Levels = Scales | GivenFactors | MeasureLevels
"""Factors on each motion; `Scales` says what all of them tell."""
