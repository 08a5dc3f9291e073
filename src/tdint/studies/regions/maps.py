"""Maps of a campaign: buildings and districts as GeoJSON (RFC 7946)."""

from __future__ import annotations

import json
import math
from collections import defaultdict
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from itertools import groupby, repeat
from typing import Any, BinaryIO

import numpy as np

from tdint.errors import UsageError
from tdint.files import MOST_BYTES, read_whole, record_digest
from tdint.items import grouped
from tdint.number_parsing import abbreviate
from tdint.output.tables.table import digits, names
from tdint.response.pairs import Run
from tdint.response.runs.run_values import RUN
from tdint.studies.campaign.campaign_tables import copied_columns, numeric
from tdint.studies.campaign.story_profiles import SuiteLevel, SuiteRules
from tdint.studies.fragility import building_damage
from tdint.studies.fragility.damage_tables import LOSS, check_column, has_costs, probability_name
from tdint.studies.store.result_store import Store
from tdint.studies.store.schema import RUNS
from tdint.units import SI, OutputUnits

_DEMAND_NAMES = ("peak_drift_ratio", "residual_drift_ratio", "peak_absolute_acceleration")
_DEMANDS = tuple(quantity for quantity in RUN if quantity.name in _DEMAND_NAMES)
_DEMAND_INDICES = tuple(RUNS.columns.index(quantity.column) for quantity in _DEMANDS)
_STATUS_INDEX = RUNS.columns.index("status")
_VALUE, _LOSS, _ANNUAL, _AVERAGE = "value", "loss", "annual_loss", "average_annual_loss"
_PROPERTIES = (
    *("building", "scale", "level", "runs", "collapsed", "failed", "pair_demand"),
    *(_VALUE, _LOSS, _ANNUAL, _AVERAGE),
)
"""Names of the properties that do not depend on the campaign."""

Feature = dict[str, Any]


def write_geojson(features: Iterable[Feature], stream: BinaryIO) -> None:
    """Write a GeoJSON FeatureCollection of the features to a stream, one feature per line."""
    stream.write(b'{"type": "FeatureCollection", "features": [')
    separator = b"\n"
    for feature in features:
        text = json.dumps(feature, ensure_ascii=False, allow_nan=False)
        stream.write(separator + text.encode("utf-8", "replace"))
        separator = b",\n"
    stream.write(b"\n]}\n")


def _in_json(properties: Feature) -> Feature:
    """Return computed properties with 12 digits of each number, and None for nan."""
    return {
        name: (None if math.isnan(value) else digits(value)) if isinstance(value, float) else value
        for name, value in properties.items()
    }


def is_mapped(store: Store) -> bool:
    """Return True if the inventory has locations."""
    return {"longitude", "latitude"} <= {title.lower() for title in store.inventory_columns()}


def check_map(store: Store, requested: Collection[str], by: str | None, *, complete: bool) -> None:
    """Raise UsageError if a map cannot be written from a store.

    A map requires coordinates of the buildings, the results of all runs, and known events. A map of
    districts also requires the column of the districts and damage states with losses.

    Parameters
    ----------
    requested : collection of str
        Names of the events on the map.
    by : str | None
        Column of the districts; None without a map of districts.
    complete : bool
        True if all runs are completed.
    """
    if not is_mapped(store):
        raise UsageError(
            f"{store.name}: the buildings have no coordinates; a map requires an inventory with "
            "the columns Latitude and Longitude"
        )
    if not complete:
        raise UsageError(
            f"{store.name}: not all runs are completed, and a map requires the results of all "
            "ground motions; run `tdint campaign` again first"
        )
    events = store.events()
    for name in requested:
        if name not in events:
            known_names = f"it has {abbreviate(events, 10)}"
            reason = known_names if events else "only ground motion fields have events"
            raise UsageError(f"--event {name}: {store.name} has no such event; {reason}")
    if by is not None:
        check_column(store, by)
        if not building_damage.has_losses(store):
            raise UsageError(
                f"--geojson --by {by}: a map of districts requires losses; add `damage` with "
                "`losses` to the campaign file"
            )


def building_features(
    store: Store, units: OutputUnits = SI, requested: Collection[str] = ()
) -> Iterator[Feature]:
    """Yield a GeoJSON point for each building, event and level of intensity.

    Coordinates are longitude and latitude in degrees; the geometry is null for a building without a
    location. Each point has these properties:

    - the columns of the inventory;
    - `event`, if the campaign has ground motion fields of events;
    - `scale` (scale factor) and `level` (intensity or number of the level), as in profiles.csv;
    - the numbers of ground motions, collapses and failed runs;
    - mean and maximum of the demands over the other runs;
    - `pair_demand`, if there are pairs of components: the rule for the demand of a pair;
    - with damage states: the mean probability of each state, and the mean loss ratio;
    - with costs: `value` and the mean `loss`, in the unit of the costs;
    - with rates of the events: `annual_loss` (rate times loss of the event) and
      `average_annual_loss` (sum of `annual_loss` over all events). Without costs these losses are
      fractions of the value of the building.

    Unknown values are null. The inventory must have locations (`is_mapped`).

    Parameters
    ----------
    requested : collection of str
        Events to write; all by default. The average annual loss includes all events.
    """
    titles = [title.lower() for title in store.inventory_columns()]
    longitude, latitude = titles.index("longitude"), titles.index("latitude")
    rules, events, buildings = SuiteRules.of(store), store.events(), store.buildings()
    # Buildings have the same order as the runs. Without damage states, the iterator is empty.
    damages = groupby(
        building_damage.group_damages(store, by_building=True), key=lambda group: group.building
    )
    rates, costs = store.rates(), has_costs(store)
    inventory_names, is_numeric = _inventory_names(store), numeric(store)
    for number, rows in groupby(store.runs(), key=lambda row: row[0]):
        groups = next(damages, ("", ()))[1]
        results_of_levels: dict[str, list[Feature]] = defaultdict(list)
        for group, losses in _with_losses([*groups], rates, costs=costs):
            outcomes = map(probability_name, group.states.outcomes)
            results = dict(zip(outcomes, group.probability.value.tolist(), strict=True))
            results_of_levels[group.event].append(results | (losses if group.states.losses else {}))
        # The cells 1 to 3 of a row identify the run: ground motion, scale factor and sample; the
        # cells 4 and 5 are its place.
        runs = {Run(*row[1:4]): row for row in rows}
        cells = store.copied_cells(number)
        inventory_properties: Feature = {}
        for name, text, is_number in zip(inventory_names, cells, is_numeric, strict=True):
            if is_number:
                inventory_properties[name] = json.loads(text) if text else None
            else:
                inventory_properties[name] = text
        position = _position(cells[longitude], cells[latitude])
        geometry = {"type": "Point", "coordinates": position} if position else None
        # With ground motion fields, the sample of a run is the number of its event, from 1. Without
        # events, all runs belong to event 0.
        building_events = sorted({run.sample for run in runs}) if events else [0]
        for event in building_events:
            head: Feature = {"building": buildings[number][0]}
            event_name = events[event - 1] if events else ""
            if events:
                if requested and event_name not in requested:
                    continue
                head["event"] = event_name
            runs_of_event = {run: row for run, row in runs.items() if event in (0, run.sample)}
            suite = ((run, *row[4:6], row[_STATUS_INDEX]) for run, row in runs_of_event.items())
            of_levels = results_of_levels[event_name] or repeat(Feature())
            for level, of_level in zip(rules.levels(suite), of_levels, strict=False):
                results = {name: digits(value) for name, value in of_level.items()}
                if level.pair_demand:
                    results["pair_demand"] = level.pair_demand
                demands = _level_properties(level, runs_of_event, units)
                properties = _in_json(head | demands | results) | inventory_properties
                yield {"type": "Feature", "geometry": geometry, "properties": properties}


def _inventory_names(store: Store) -> tuple[str, ...]:
    """Return the names of the map properties (values that the map states for each building) that
    contain the cells of the inventory.

    Each copied column of the inventory is a property with the name of the column, with a prefix if
    a computed property has the same name.
    """
    demands = [
        f"{statistic}_{demand.column}" for demand in _DEMANDS for statistic in ("mean", "max")
    ]
    outcomes = [
        probability_name(name)
        for states in building_damage.stored_states(store).values()
        for name in states.outcomes
    ]
    other_names = (*_PROPERTIES, *demands, *outcomes, LOSS.name)
    copied_names = names(copied_columns(store, other_names))
    # The first copied column is the event, if there are events.
    return copied_names[1:] if store.events() else copied_names


def _position(longitude: str, latitude: str) -> list[float] | None:
    """Return a GeoJSON position, longitude and latitude, from cells of the inventory; None if a
    cell is empty.

    Longitudes are between -180 and 180 degrees, positive to the east; latitudes are positive to the
    north.
    """
    if not (longitude and latitude):
        return None
    east = float(longitude)
    if abs(east) > 180.0:
        east = (east + 180.0) % 360.0 - 180.0
    return [digits(east), digits(float(latitude))]


def _with_losses(
    groups: Sequence[building_damage.TypeDamage], rates: Mapping[str, float], *, costs: bool
) -> Iterator[tuple[building_damage.TypeDamage, Feature]]:
    """Yield each group with its losses: the loss ratio, with costs `value` and `loss`, with rates
    of the events `annual_loss` and `average_annual_loss`, the sum over the events of the same
    entry and level that have a result."""
    annual_losses: dict[tuple[str, float], list[float]] = defaultdict(list)
    losses = [float(group.mean_loss(costs=costs).value[0]) for group in groups]
    for group, loss in zip(groups, losses, strict=True):
        if rates and not math.isnan(loss):
            annual_losses[group.inventory_entry, group.level].append(rates[group.event] * loss)
    for group, loss in zip(groups, losses, strict=True):
        properties = {LOSS.name: float(group.loss.value[0])}
        if costs:
            properties |= {_VALUE: group.value, _LOSS: loss}
        if rates:
            of_events = annual_losses[group.inventory_entry, group.level]
            properties[_ANNUAL] = rates[group.event] * loss
            properties[_AVERAGE] = math.fsum(of_events) if of_events else math.nan
        yield group, properties


def district_features(
    store: Store,
    by: str,
    polygons: Mapping[str, Feature] | None = None,
    requested: Collection[str] = (),
) -> Iterator[Feature]:
    """Yield a GeoJSON feature with the losses of all buildings with the same value of a column, for
    each value, event and level.

    The properties are the value of the column, the level, the event, the numbers of buildings, runs
    and failed runs, the mean loss ratio and, with costs, `value`, `loss` and its standard error;
    with rates of the events also `annual_loss` (rate times loss of the event) and
    `average_annual_loss` (their sum over all events). The geometry is the polygon of the value, or
    the points of the buildings.

    Parameters
    ----------
    polygons : mapping, optional
        Geometries by value of the column (`read_polygons`).
    requested : collection of str
        Events to write; all by default.
    """
    positions, costs = _positions_by_district(store, by), has_costs(store)
    groups = list(building_damage.group_damages(store, by=by))
    pair_demand = store.pair_rule().demand_if_pairs
    for group, losses in _with_losses(groups, store.rates(), costs=costs):
        if requested and group.event not in requested:
            continue
        properties: Feature = {by: group.inventory_entry}
        properties |= {"event": group.event} if group.event else {}
        properties |= {
            "level": group.level,
            "buildings": group.buildings,
            "runs": group.runs,
            "failed": group.failed,
            **losses,
        }
        if costs:
            properties[f"{_LOSS}_error"] = float(group.money.error[0])
        properties |= {"pair_demand": pair_demand} if pair_demand else {}
        points = positions.get(group.inventory_entry, [])
        geometry: Feature | None = {"type": "MultiPoint", "coordinates": points} if points else None
        geometry = geometry if polygons is None else polygons.get(group.inventory_entry)
        yield {"type": "Feature", "geometry": geometry, "properties": _in_json(properties)}


def _positions_by_district(store: Store, by: str) -> dict[str, list[list[float]]]:
    """Return the positions of the buildings of each district.

    The keys are the values of the inventory column `by`; a position is [longitude, latitude] in
    degrees. Buildings without a position are omitted.
    """
    titles = [title.lower() for title in store.inventory_columns()]
    column, *degrees = (titles.index(name) for name in (by.lower(), "longitude", "latitude"))
    return grouped(
        (cells[column], position)
        for cells in map(store.copied_cells, store.buildings())
        if (position := _position(*(cells[index] for index in degrees)))
    )


def read_polygons(store: Store, source: str, by: str) -> dict[str, Feature]:
    """Read the polygons of a GeoJSON file.

    The result contains the geometry of each value of the property `by`, for example of each name of
    a district.

    Parameters
    ----------
    source : str
        GeoJSON file: a FeatureCollection of polygons with longitude and latitude in degrees.
    by : str
        Name of the property, and of the column of the inventory, regardless of case. Each value of
        the column must have a polygon.

    Raises
    ------
    UsageError
        The file cannot be read, is no such collection, or lacks the polygon of a value.
    """
    too_large_text = f"larger than {MOST_BYTES // 1024**2} MiB; simplify the polygons"
    data = read_whole(source, UsageError, {}, too_large_text, MOST_BYTES)
    record_digest(source, data)
    format_text = (
        f"--polygons is a GeoJSON file (FeatureCollection) of polygons with a property {by}"
    )
    try:
        features = json.loads(data)["features"]
        properties_and_geometries = [
            (
                {name.lower(): value for name, value in feature["properties"].items()},
                feature["geometry"],
            )
            for feature in features
        ]
    except (ValueError, LookupError, TypeError, AttributeError, RecursionError):
        raise UsageError(f"{source}: cannot be read; {format_text}") from None
    polygons: dict[str, Feature] = {}
    for properties, geometry in properties_and_geometries:
        if by.lower() in properties:
            if not isinstance(geometry, dict) or geometry.get("type") not in _POLYGONS:
                raise UsageError(
                    f"{source}: the geometry of {properties[by.lower()]!r} must be a Polygon or "
                    "MultiPolygon"
                )
            name = str(properties[by.lower()])
            if name in polygons:
                raise UsageError(
                    f"{source}: two polygons have the {by} {name!r}; merge them to a MultiPolygon"
                )
            polygons[name] = geometry
    # The cells that the store keeps for a building are in the order of the columns.
    column = [title.lower() for title in store.inventory_columns()].index(by.lower())
    districts = {store.copied_cells(number)[column] for number in store.buildings()}
    if missing := sorted(districts - {"", *polygons}):
        raise UsageError(f"{source}: no polygon of {by} {abbreviate(missing, 10)}; {format_text}")
    return polygons


_POLYGONS = ("Polygon", "MultiPolygon")


def _level_properties(
    level: SuiteLevel, runs: Mapping[Run, Sequence[Any]], units: OutputUnits
) -> Feature:
    """Return the properties of a building on a map at an intensity level: the scale factor or the
    level, the numbers of ground motions, and the mean and maximum of each demand. A demand is nan
    without completed runs, or if it is undefined (no drift ratio without height).
    """
    properties: Feature = {}
    for name, number in (("scale", level.scale), ("level", level.level)):
        if not math.isnan(number):
            properties[name] = number
    counts = level.counts
    properties |= {"runs": counts.motions, "collapsed": counts.collapsed, "failed": counts.failed}
    for demand, column_index in zip(_DEMANDS, _DEMAND_INDICES, strict=True):
        column, factor = units.column(demand.column, demand.unit)
        of_runs = np.array([runs[run][column_index] for run in level.runs], float)
        demands = level.demands(dict(zip(level.runs, np.abs(of_runs), strict=True)))
        values = (demands[np.isfinite(demands)] / factor).tolist()
        properties[f"mean_{column}"] = math.fsum(values) / len(values) if values else math.nan
        properties[f"max_{column}"] = max(values, default=math.nan)
    return properties
