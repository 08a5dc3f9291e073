"""Ground motions of a campaign: assignment to buildings, and scale factors.

Each building has all motions, or samples of the motions near it. Factors are specified, or computed
from levels of an intensity measure. Sampling is by nearest neighbors, as in SimCenter's regional
workflow.
"""

from __future__ import annotations

import hashlib
import os
from collections import defaultdict
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from tdint.arrays import Array, cached_property
from tdint.errors import ModelError, TdintError
from tdint.files import is_file
from tdint.ground_motion.axes import PairRecord
from tdint.ground_motion.choice import RecordChoice
from tdint.ground_motion.horizontals import with_component
from tdint.ground_motion.reading.suites import GroundMotion, SuiteMotion, suite_motions
from tdint.response.pairs import Run
from tdint.response.spectra.elastic import SA_DAMPING
from tdint.studies.motions.intensity import IntensityMeasure, factor_to
from tdint.studies.regions.inventory import InventoryRows

MAX_DISTANCE = 15e3
"""Default maximum distance of a building from its site, m; equal to the default of
`asset_hazard_distance` in OpenQuake."""

_EARTH_RADIUS = 6371e3  # m, mean radius of the earth

DISTANCES = ("km", "degrees")
"""Types of distance. `km` is measured on the earth; `degrees`, as in SimCenter's workflow, is
measured in a plane of longitude and latitude, which have equal weight and are not periodic."""

Locations = Sequence[tuple[float, float]] | Array
"""Longitudes and latitudes, degrees."""


@dataclass(frozen=True)
class GridFile:
    """Ground motions at points of a grid, which are sampled for each building from its nearest
    points.

    Attributes
    ----------
    file : str
        Path of EventGrid.csv.
    units : str
        Units of the samples of motions.
    neighbors, samples : int
        Number of points to sample from, and number of samples for each building.
    seed : int
        Random seed, combined with the id of the building.
    distance : str
        Type of distance: an item of `DISTANCES`.
    events : bool
        True for no sampling: the rows of the points' files are events, and a building has the
        events of its nearest point.
    max_distance : float
        Buildings at a larger distance from the nearest point are omitted, m.
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
class FieldFile:
    """Ground motion fields: the motion of each event at each site.

    Attributes
    ----------
    file : str
        CSV file of events, sites, records and factors.
    pairs : bool
        Combine the two horizontal components of a record.
    sites : str | None
        CSV file with the locations of the sites; None: the inventory names the site of each
        building.
    distance : str
        Unit of the distance to the nearest site: an item of `DISTANCES`.
    max_distance : float
        Buildings at a larger distance from the nearest site are omitted, m.
    rates : str | None
        CSV file with the annual rates of the events.
    """

    file: str
    choice: RecordChoice
    pairs: bool = False
    sites: str | None = None
    distance: str = "km"
    max_distance: float = MAX_DISTANCE
    rates: str | None = None


@dataclass(frozen=True)
class FieldMotions:
    """Ground motions of events at sites, and their assignment to buildings: each building has all
    events of its site. There is no sampling, so the spatial correlation of the fields is preserved.
    The rows are sorted by site; there may be millions.

    Attributes
    ----------
    events : tuple of str
        Events, which are numbered from 1.
    start : ndarray of int, shape (sites + 1,)
        First row of each site, followed by the number of rows.
    event, record : ndarray of int, shape (rows,)
        Number of the event, from 1, and index of its record in `motions`.
    value : ndarray, shape (rows,)
        Factor on the record, or intensity to which the record is scaled.
    motions : tuple of tuples of (int, float)
        For each record, one pair per component: the number of the motion in the campaign, and the
        divisor that converts a value to a factor.
    locations : sequence of tuples of two floats
        Longitude and latitude of the sites, degrees; empty if the inventory names the sites.
    site_of : ndarray of int, shape (buildings,)
        Site of each building; empty before the buildings are read.
    """

    settings: GridFile | FieldFile
    events: tuple[str, ...]
    sites: tuple[str, ...] = field(repr=False)
    start: NDArray[np.int64] = field(repr=False)
    event: NDArray[np.int32] = field(repr=False)
    record: NDArray[np.int32] = field(repr=False)
    value: Array = field(repr=False)
    motions: tuple[tuple[tuple[int, float], ...], ...] = field(repr=False)
    locations: Sequence[tuple[float, float]] = field(default=(), repr=False)
    site_of: NDArray[np.int64] = field(default_factory=lambda: np.empty(0, np.int64), repr=False)

    @classmethod
    def from_rows(
        cls,
        settings: GridFile | FieldFile,
        events: tuple[str, ...],
        sites: tuple[str, ...],
        rows: tuple[NDArray[Any], ...],
        motions: Sequence[tuple[tuple[int, float], ...]],
        locations: Sequence[tuple[float, float]] = (),
    ) -> FieldMotions:
        """Create the object from rows in any order.

        Parameters
        ----------
        events, sites : tuple of str
            Names of the events and of the sites.
        rows : tuple of four ndarray, shape (rows,)
            Index of the site, number of the event, index of the record, and value of each row.
        """
        site, event, record, value = rows
        order = np.argsort(site, kind="stable")
        start = np.searchsorted(site[order], np.arange(len(sites) + 1))
        in_order = event[order], record[order], value[order]
        return cls(settings, events, sites, start, *in_order, tuple(motions), locations)

    def draws(self, building: int) -> Sequence[Run]:
        """Return the motions of a building, all events at its site, sorted by their numbers, each
        with its factor in the field. The sample number of a motion is the number of its event."""
        site = self.site_of[building]
        site_rows = slice(int(self.start[site]), int(self.start[site + 1]))
        rows = zip(
            self.event[site_rows].tolist(),
            self.record[site_rows].tolist(),
            self.value[site_rows].tolist(),
            strict=True,
        )
        draws = []
        for event, record, value in rows:
            # A record has one motion for each of its components.
            for motion, divisor in self.motions[record]:
                draws.append(Run(motion, value / divisor, event))
        return sorted(draws, key=lambda run: (run.motion, run.sample))

    def counts(self, buildings: int, runs: Callable[[int], int]) -> NDArray[np.int64]:
        """Return the number of runs of each building; `runs` returns the number of runs of a
        motion."""
        # The rows are sorted by site. The number of runs at a site is therefore the difference of
        # the cumulative number of runs between its first row and the first row of the next site.
        runs_of_record = np.array(
            [sum(runs(motion) for motion, _ in motions) for motions in self.motions], dtype=np.int64
        )
        cumulative = np.concatenate([[0], np.cumsum(runs_of_record[self.record])])
        return np.asarray(np.diff(cumulative[self.start])[self.site_of], dtype=np.int64)

    def description(self) -> dict[str, object]:
        """Return names of the events and SHA-256 of the fields, for the fingerprint of a
        campaign."""
        digest = hashlib.sha256(repr((self.sites, self.motions)).encode())
        for array in (self.start, self.event, self.record, self.value, self.site_of):
            digest.update(array.tobytes())
        return {"events": self.events, "field_sha256": digest.hexdigest()}


PointMotion = tuple[tuple[int, ...], float]
"""Ground motion at a point of a grid: numbers of its components, and its factor at the point."""


@dataclass(frozen=True)
class EveryMotion:
    """Assignment of all motions to all buildings."""

    count: int

    def draws(self, building: int) -> Sequence[Run]:
        """Return the motions of a building, without a factor or a sample."""
        return [Run(motion, 1.0) for motion in range(self.count)]

    def counts(self, buildings: int, runs: Callable[[int], int]) -> NDArray[np.int64]:
        """Return the number of runs of each building (`FieldMotions.counts`)."""
        return np.full(buildings, sum(map(runs, range(self.count))), dtype=np.int64)

    def description(self) -> dict[str, object]:
        """Return the settings of the assignment, which are part of the fingerprint that identifies
        a campaign. This assignment has no settings."""
        return {}


@dataclass(frozen=True)
class GridMotions:
    """Ground motions at the points of a grid, and their assignment to buildings: each building has
    random samples of the motions at its nearest points.

    Attributes
    ----------
    locations : sequence of tuples of two floats
        Longitude and latitude of the points that have motions, degrees.
    rows : InventoryRows | None
        The buildings; None before they are read.
    """

    settings: GridFile
    locations: Sequence[tuple[float, float]] = field(repr=False)
    motions: tuple[tuple[PointMotion, ...], ...] = field(repr=False)
    rows: InventoryRows | None = field(default=None, repr=False)

    def draws(self, building: int) -> Sequence[Run]:
        """Return the sampled motions of a building, sorted by motion number, then by sample number.

        Points are sampled by weight with replacement; then one of the motions of each sampled point
        is selected with equal probability. All components of the motion have the same sample
        number, and the scale factor that the grid specifies for the motion at the point.
        """
        # The seed includes the identifier of the building, so that the samples of a building do not
        # depend on the other buildings of the campaign.
        assert self.rows is not None
        random = np.random.default_rng([self.settings.seed, *self.rows[building].id.encode()])
        near_points, weights = self.weights(building)
        points = random.choice(near_points, size=self.settings.samples, p=weights)
        draws = []
        for sample, point in enumerate(points.tolist(), start=1):
            point_motions = self.motions[point]
            components, factor = point_motions[int(random.integers(len(point_motions)))]
            draws += [Run(motion, factor, sample) for motion in components]
        return sorted(draws, key=lambda run: (run.motion, run.sample))

    def counts(self, buildings: int, runs: Callable[[int], int]) -> NDArray[np.int64]:
        """Return the number of runs of each building (`FieldMotions.counts`)."""
        # Usually all motions have the same number of runs. Then the number of runs of a building
        # does not depend on the sampled motions, and the sampling, which needs time, is omitted.
        run_counts = {
            sum(map(runs, components))
            for point_motions in self.motions
            for components, _ in point_motions
        }
        if len(run_counts) == 1:
            return np.full(buildings, self.settings.samples * run_counts.pop(), dtype=np.int64)
        counts = [
            sum(runs(draw.motion) for draw in self.draws(building)) for building in range(buildings)
        ]
        return np.array(counts, dtype=np.int64)

    def weights(self, building: int) -> tuple[NDArray[np.int64], Array]:
        """Return the nearest points of the grid; their motions are sampled for a building.

        Returns
        -------
        near_points : ndarray of int, shape (k,)
            Indices of the nearest points, the nearest first.
        probabilities : ndarray, shape (k,)
            Probability of each point, proportional to 1 / distance^2.
        """
        # With a sequence for `k`, the results are arrays even for a single neighbor.
        count = min(self.settings.neighbors, self._tree.n)
        distances, near_points = self._tree.query(
            self._building_points[building], k=np.arange(1, count + 1)
        )
        # If the building is at a point of the grid, the point has an infinite weight: sample only
        # this point.
        is_at_point = distances == 0.0
        if is_at_point.any():
            weights = is_at_point.astype(float)
        else:
            weights = (distances[0] / distances) ** 2
        return near_points.astype(np.int64), weights / weights.sum()

    def description(self) -> dict[str, object]:
        """Return the settings of the sampling and SHA-256 of the grid, for the fingerprint of a
        campaign."""
        settings = self.settings
        grid_text = repr((self._tree.data.tolist(), self.motions))
        return {
            "neighbors": settings.neighbors,
            "samples": settings.samples,
            "draw_seed": settings.seed,
            "distance": settings.distance,
            "grid_sha256": hashlib.sha256(grid_text.encode()).hexdigest(),
        }

    @cached_property
    def _building_points(self) -> Array:
        """Coordinates of the buildings in the space of the selected distance."""
        assert self.rows is not None
        return coordinates(self.rows.locations, self.settings.distance)

    @cached_property
    def _tree(self) -> Any:
        """Search tree of the points of the grid, for nearest neighbors."""
        return cKDTree(coordinates(self.locations, self.settings.distance))


SiteMotions = GridMotions | FieldMotions
"""Ground motions by their locations, and their assignment to buildings."""


@dataclass(frozen=True)
class CampaignMotions:
    """Ground motions of a campaign.

    Attributes
    ----------
    motions : tuple of SuiteMotion
        The motions; their index is their number.
    site_motions : SiteMotions | None
        Motions by their location; None if all buildings have all motions.
    rates : mapping of str to float
        Annual rate of each event, 1/year; empty if not specified.
    """

    motions: tuple[SuiteMotion, ...] = ()
    failures: tuple[TdintError, ...] = ()
    notes: tuple[str, ...] = ()
    site_motions: SiteMotions | None = None
    rates: Mapping[str, float] = field(default_factory=dict)


Assignment = EveryMotion | SiteMotions
"""Assignment of motions to buildings: `draws` returns the motions of a building, `counts` the
number of runs of each building, and `description` the settings."""


def nearest(locations: Locations, candidates: Locations, distance: str) -> NDArray[np.int64]:
    """Return the index of the nearest candidate for each location.

    Parameters
    ----------
    locations : Places
        Longitudes and latitudes of the locations, degrees.
    distance : str
        Type of distance: an item of `DISTANCES`. `km` is measured on the earth, `degrees` in a
        plane of longitude and latitude. The nearest candidate depends on this choice.
    """
    tree = cKDTree(coordinates(candidates, distance))
    _, indices = tree.query(coordinates(locations, distance))
    return np.asarray(indices, dtype=np.int64)


def meters(locations: Locations, others: Locations) -> Array:
    """Return the distance on the earth between corresponding locations, m, shape (k,).

    The distance is 2 R arcsin(c / 2), where R is the radius of the earth and c is the length of the
    chord on the unit sphere.
    """
    chord = np.linalg.norm(coordinates(locations, "km") - coordinates(others, "km"), axis=1)
    return np.asarray(2.0 * _EARTH_RADIUS * np.arcsin(np.minimum(0.5 * chord, 1.0)))


def coordinates(locations: Locations, distance: str) -> Array:
    """Convert k longitudes and latitudes, in degrees, to points with Euclidean distances that can
    be compared: shape (k, 3) for the distance `km`, shape (k, 2) for `degrees`."""
    degrees = np.array(locations, dtype=np.float64).reshape(-1, 2)
    if distance == "degrees":
        return degrees
    # Unit vectors from the center of the earth
    longitude, latitude = np.radians(degrees).T
    return np.column_stack(
        [
            np.cos(latitude) * np.cos(longitude),
            np.cos(latitude) * np.sin(longitude),
            np.sin(latitude),
        ]
    )


@dataclass(frozen=True)
class Scales:
    """Equal scale factors for all motions."""

    values: tuple[float, ...]

    def factors(self, motion: int, periods: Sequence[float]) -> Sequence[tuple[float, ...]]:
        """Return the factors of a motion for each building."""
        return [self.values] * len(periods)

    def level_values(self, motion: int) -> Sequence[float]:
        """Return the level of each factor of a motion, which is the factor."""
        return self.values

    def description(self) -> dict[str, object]:
        """Return the scale factors, for the fingerprint of a campaign."""
        return {"scales": list(self.values)}


def files_of_row(text: str, table: str) -> list[str]:
    """Return the files to which the path in a row of a table can refer, if they exist: relative to
    the working directory, then to the directory of the table."""
    paths = dict.fromkeys([Path(text), Path(table).parent / text])
    return [str(path) for path in paths if text and is_file(path)]


@dataclass(frozen=True)
class FactorTable:
    """Scale factors by names of motions and components, as in a CSV file. An empty component
    represents all components. The factors are equal for all buildings.

    Attributes
    ----------
    by_name : mapping of (str, str) to mapping of float to float
        Factors by record and component, each with its level, SI units; NaN without levels.
    scaled : mapping
        Settings that `tdint scale` wrote next to the file, or only target and rule from the columns
        of a copied file.
    level_unit : str
        SI unit of the levels; empty without levels.
    by_motion : mapping of int to mapping of float to float
        Factors and levels of the motions of a campaign by their numbers; empty before the motions
        are read.
    """

    source: str
    by_name: Mapping[tuple[str, str], Mapping[float, float]]
    scaled: Mapping[str, Any] = field(default_factory=dict)
    level_unit: str = ""
    by_motion: Mapping[int, Mapping[float, float]] = field(default_factory=dict)

    def of_motions(self, motions: Sequence[SuiteMotion]) -> FactorTable:
        """Return the table with the factors and levels of the motions of a campaign. ModelError is
        raised if a row without an existing file can be that of two motions with the same name."""
        by_motion = {number: self.of(motion) for number, motion in enumerate(motions)}
        files: dict[str, set[str]] = defaultdict(set)
        for motion in motions:
            files[Path(motion.name).name].add(os.path.realpath(motion.name))
        for name in self._text_of_name.keys() & {name for name in files if len(files[name]) > 1}:
            raise ModelError(
                f"{self.source}: {self._text_of_name[name]} can be "
                f"{' or '.join(sorted(files[name]))}; write the path of the file in the table"
            )
        return replace(self, by_motion=by_motion)

    @cached_property
    def _text_of_file(self) -> Mapping[str, str]:
        """Path in the table by the file to which it refers."""
        texts = dict.fromkeys(text for text, _ in self.by_name)
        located = [(file, text) for text in texts for file in files_of_row(text, self.source)]
        return {os.path.realpath(file): text for file, text in reversed(located)}

    @cached_property
    def _text_of_name(self) -> Mapping[str, str]:
        """Path in the table by the name of its file, for paths whose files do not exist and whose
        names are unique."""
        located = {*self._text_of_file.values()}
        texts: dict[str, dict[str, None]] = defaultdict(dict)
        for text, _ in self.by_name:
            if text not in located:
                texts[Path(text).name][text] = None
        return {name: text for name, (text, *others) in texts.items() if not others}

    def unequal_factors(
        self, motions: Sequence[SuiteMotion], partners: Mapping[int, int]
    ) -> list[str]:
        """Return a warning for each pair of components with different factors. `partners` is the
        number of the first component by the number of the second component."""
        return [
            f"{self.source}: the components {motions[first].name} {motions[first].component} "
            f"(factor {_factors_text(self.by_motion[first])}) and {motions[second].name} "
            f"{motions[second].component} (factor {_factors_text(self.by_motion[second])}) of a "
            "recording have different factors and count as separate motions; use one factor per "
            "recording to count the pair as one motion"
            for second, first in partners.items()
            if [*self.by_motion[first]] != [*self.by_motion[second]]
        ]

    def of(self, motion: SuiteMotion) -> Mapping[float, float]:
        """Return the scale factors of a motion with their levels. The table may list the motion by
        its name, by any path of its file, by the name of its file without the directory, or by the
        name of the pair to which it belongs. A pair along the axes of a building has the common
        factors of its components.

        Raises
        ------
        ModelError
            The table has no factor for the motion, or different factors for the components.
        """
        # The ground motion of a component of a pair is the pair. The ground motion of a single
        # record is the record.
        ground_motion = motion.ground_motion
        by_file = self._text_of_file.get(os.path.realpath(motion.name))
        by_name = self._text_of_name.get(Path(motion.name).name)
        for name in dict.fromkeys([motion.name, by_file, ground_motion.source, by_name]):
            if name is None:
                continue
            for component in component_names_of(motion):
                if (name, component) in self.by_name:
                    return self.by_name[name, component]
        if isinstance(motion.record, PairRecord):
            first, second = (self.of(part) for part in suite_motions([ground_motion]))
            if [*first] != [*second]:
                raise ModelError(
                    f"{self.source}: the components of {motion.name} have the factors "
                    f"{_factors_text(first)} and {_factors_text(second)}; buildings with two "
                    "directions require the same factors of both"
                )
            return first
        raise ModelError(
            f"{self.source}: no factor for {motion.name} {motion.component}; add a row for it, or "
            "remove the key `files` to use only the records of the table"
        )

    def common_factors(self, motions: Sequence[GroundMotion]) -> list[float]:
        """Return the factor of each ground motion, which must be the same for both components of a
        pair.

        Parameters
        ----------
        motions : sequence of Record or Horizontals
            Single records and pairs.

        Raises
        ------
        ModelError
            A motion has no factor, or several factors.
        """
        # Distinct factors of the components of each motion, as keys of a dictionary. The motions
        # are identified by `id`, because they are not hashable.
        distinct_factors: dict[int, dict[float, None]] = {}
        for component in suite_motions(motions):
            values = distinct_factors.setdefault(id(component.ground_motion), {})
            values.update(dict.fromkeys(self.of(component)))
        factors: list[float] = []
        for motion in motions:
            values = distinct_factors[id(motion)]
            if len(values) > 1:
                values_text = ", ".join(f"{value:g}" for value in values)
                raise ModelError(
                    f"{self.source}: {motion.source} {motion.component} has the factors "
                    f"{values_text}; specify a single factor"
                )
            factors += values
        return factors

    def factors(self, motion: int, periods: Sequence[float]) -> Sequence[tuple[float, ...]]:
        """Return the factors of a motion for each building."""
        return [tuple(self.by_motion[motion])] * len(periods)

    def level_values(self, motion: int) -> Sequence[float]:
        """Return the level of each factor of a motion; NaN without levels, because all rows of the
        table are then one suite."""
        return tuple(self.by_motion[motion].values())

    def description(self) -> dict[str, object]:
        """Return factors and levels of each motion, for the fingerprint of a campaign."""
        settings: dict[str, object] = {
            "factors": {str(motion): list(values) for motion, values in self.by_motion.items()}
        }
        if self.level_unit:
            levels = {str(motion): [*rows.values()] for motion, rows in self.by_motion.items()}
            settings |= {"factor_levels": levels, "level_unit": self.level_unit}
        return settings


def component_names_of(motion: SuiteMotion) -> list[str]:
    """Return the names by which a table of factors can list the component of a motion: also that
    of its file name, which `tdint scale` writes for pairs. An empty name is all components."""
    names = [motion.component, motion.record.component, motion.ground_motion.component]
    return [*dict.fromkeys([*names, with_component(motion.record, in_degrees=True).component, ""])]


def _factors_text(factors: Iterable[float]) -> str:
    """Return the factors of a motion as text."""
    return ", ".join(f"{factor:g}" for factor in factors)


@dataclass(frozen=True)
class MeasureLevels:
    """Levels of an intensity measure to which motions are scaled.

    Attributes
    ----------
    measure : callable
        Function that returns the measure for a period, s.
    period : float | None
        Period, s; None: first period of each building.
    pair : str
        Combination of the components of a pair, a name of `tdint.studies.motions.intensity.PAIRS`.
    recordings : sequence of Record or Horizontals
        Recording to which each motion belongs: a pair, or a single record.
    """

    measure: Callable[[float], IntensityMeasure]
    period: float | None
    values: tuple[float, ...]
    pair: str
    recordings: Sequence[GroundMotion] = ()

    def level_values(self, motion: int) -> Sequence[float]:
        """Return the levels."""
        return self.values

    def factors(self, motion: int, periods: Sequence[float]) -> Sequence[tuple[float, ...]]:
        """Return the factors of a motion for each building, one per level. Both components of a
        pair have the same factors.
        """
        # The intensity of a pair is computed from both components. Equal periods of several
        # buildings are evaluated only one time.
        recording = self.recordings[motion]
        factors_at_period: dict[float, tuple[float, ...]] = {}
        periods = periods if self.period is None else [self.period] * len(periods)
        for period in dict.fromkeys(periods):
            measure = self.measure(period)
            unscaled = measure.of(recording, self.pair)
            factors_at_period[period] = tuple(
                factor_to(level, measure, unscaled) for level in self.values
            )
        return [factors_at_period[period] for period in periods]

    def description(self) -> dict[str, object]:
        """Return the levels and the intensity measure, which are part of the fingerprint that
        identifies a campaign. The default damping ratio is omitted."""
        # Any period is suitable, because only name and damping ratio of the measure are used.
        measure = self.measure(1.0)
        damping = getattr(measure, "damping", SA_DAMPING)
        return {
            "measure": measure.name.partition("(")[0],
            "period": "T1" if self.period is None else self.period,
            "levels": list(self.values),
            "pair": self.pair,
            **({} if damping == SA_DAMPING else {"damping": damping}),
        }


Levels = Scales | FactorTable | MeasureLevels
"""Scale factors of motions: `factors` returns the factors of a motion for each building,
`level_values` their levels, and `description` the settings."""
