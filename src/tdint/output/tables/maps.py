"""Maps of a campaign: buildings and districts as GeoJSON (RFC 7946)."""

from __future__ import annotations

import json
import math
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from itertools import groupby
from typing import TYPE_CHECKING, Any, BinaryIO

import numpy as np

from tdint.analysis.run.demands import RUN
from tdint.campaign.fragility.runs import (
    BuildingDamage,
    TypeDamage,
    building_damages,
    damage_by_motion,
    group_damages,
    stored_states,
)
from tdint.campaign.pairs import combine
from tdint.campaign.store_schema import RUNS
from tdint.csv_table import number as cell_number
from tdint.errors import UsageError
from tdint.files import MOST_BYTES, read_whole, record_digest
from tdint.model.damage_states import COST, NUMBER
from tdint.output.tables.campaign import carried_columns, numeric
from tdint.output.tables.damage_states import LOSS, has_costs, probability_name
from tdint.output.tables.table import digits, names
from tdint.units import SI, OutputUnits

if TYPE_CHECKING:
    from tdint.campaign.batch import Run
    from tdint.campaign.profiles import SuiteLevel
    from tdint.campaign.store import Store

_SHOWN = ("peak_drift_ratio", "residual_drift_ratio", "peak_absolute_acceleration")
_DEMANDS = tuple(one for one in RUN if one.name in _SHOWN)
_PLACES = tuple(RUNS.columns.index(one.column) for one in _DEMANDS)
_STATUS = RUNS.columns.index("status")
_VALUE, _LOSS, _ANNUAL, _AVERAGE = "value", "loss", "annual_loss", "average_annual_loss"
_OWN = (
    *("building", "scale", "level", "runs", "collapsed", "failed", "pair_demand"),
    *(_VALUE, _LOSS, _ANNUAL, _AVERAGE),
)

Feature = dict[str, Any]


def write_geojson(
    store: Store, stream: BinaryIO, units: OutputUnits = SI, events: Collection[str] = ()
) -> None:
    """Write a GeoJSON FeatureCollection of points.

    Coordinates are longitude and latitude in degrees; the geometry is null for a building without a
    location. The properties are: the columns of the inventory; the event of a field; the level
    (`scale`, and `level` as in profiles.csv); the numbers of ground motions, collapses and failed
    runs; mean and maximum of the demands over the other runs. `pair_demand` states how the
    components of pairs are counted, if there are pairs. With damage states, the mean probability of
    each state and the mean loss ratio follow; with costs, `value` and the mean `loss` in the unit
    of the costs; with rates of the events, `annual_loss` (rate times loss of the event) and
    `average_annual_loss` (their sum over all events). Without costs both are fractions of the value
    of the building. Unknown values are null. The inventory must have locations (`is_mapped`).

    Parameters
    ----------
    store : Store
        Store of the campaign.
    stream : BinaryIO
        Output.
    units : OutputUnits
        Units of the demands.
    events : collection of str
        Events to write; all by default. The average annual loss is that of all events.
    """
    _write_collection(_features(store, units, events), stream)


def _write_collection(features: Iterable[Feature], stream: BinaryIO) -> None:
    """Write GeoJSON features to a stream."""
    stream.write(b'{"type": "FeatureCollection", "features": [')
    between = b"\n"
    for feature in features:
        stream.write(
            between
            + json.dumps(feature, ensure_ascii=False, allow_nan=False).encode("utf-8", "replace")
        )
        between = b",\n"
    stream.write(b"\n]}\n")


def is_mapped(store: Store) -> bool:
    """Return True if the inventory has locations."""
    return {"longitude", "latitude"} <= {title.lower() for title in store.inventory_columns()}


def check_events(store: Store, chosen: Collection[str]) -> None:
    """Raise UsageError if the campaign has no event of a name."""
    events = store.events()
    for name in chosen:
        if name not in events:
            known = ", ".join(events[:10]) + ", ..." * (len(events) > 10)
            raise UsageError(
                f"--event {name}: {store.name} has no such event; "
                + (f"it has {known}" if events else "only ground motion fields have events")
            )


def _features(store: Store, units: OutputUnits, chosen: Collection[str]) -> Iterator[Feature]:
    """Yield the feature of each building, event and level, as in `write_geojson`."""
    from tdint.campaign.batch import Run
    from tdint.campaign.profiles import SuiteRules

    titles = [title.lower() for title in store.inventory_columns()]
    longitude, latitude = titles.index("longitude"), titles.index("latitude")
    rules, events, buildings, damages = (
        SuiteRules.of(store),
        store.events(),
        store.buildings(),
        building_damages(store),
    )
    rates, costs = store.rates(), has_costs(store)
    # Inventory columns get names that differ from all other properties.
    demands = [
        f"{statistic}_{demand.column}" for demand in _DEMANDS for statistic in ("mean", "max")
    ]
    outcomes = [
        probability_name(name)
        for states in stored_states(store).values()
        for name in states.outcomes
    ]
    columns = names(carried_columns(store, (*_OWN, *demands, *outcomes, LOSS.name)))[
        1 if events else 0 :
    ]
    kinds = numeric(store)
    for number, rows in groupby(store.runs(), key=lambda row: row[0]):
        of_runs = next(damages, None)
        damage = damage_by_motion(of_runs, rules.pairs) if of_runs else None
        runs = {Run(*row[1:4]): row for row in rows}
        cells = store.copied_cells(number)
        carried = {
            name: (json.loads(text) if text else None) if is_number else text
            for name, text, is_number in zip(columns, cells, kinds, strict=True)
        }
        position = _position(cells[longitude], cells[latitude])
        geometry = {"type": "Point", "coordinates": position} if position else None
        value = _value_of(dict(zip(titles, cells, strict=False))) if costs else math.nan
        building_events = sorted({key.sample for key in runs}) if events else [0]
        annual = _annual_losses(damage, rates, events) if damage and rates else {}
        for event in building_events:
            if chosen and events[event - 1] not in chosen:
                continue
            head: Feature = {"building": buildings[number][0]} | (
                {"event": events[event - 1]} if events else {}
            )
            # Without events, all runs belong to event 0.
            runs_of_event = {key: row for key, row in runs.items() if event in (0, key.sample)}
            for rank, level in enumerate(
                rules.levels({key: row[_STATUS] for key, row in runs_of_event.items()})
            ):
                results = _damage(damage, rank, event) if damage else {}
                results |= _losses(results, value, annual, rank, event)
                results |= {"pair_demand": level.pair_demand} if level.pair_demand else {}
                feature = head | _of_level(level, runs_of_event, units) | results | carried
                yield {"type": "Feature", "geometry": geometry, "properties": feature}


def _position(longitude: str, latitude: str) -> list[float] | None:
    """Return a GeoJSON position, or None if the inventory does not state it.

    Longitudes are between -180 and 180 degrees, positive to the east; latitudes are positive to the
    north.
    """
    if not (longitude and latitude):
        return None
    east = float(longitude)
    east = (east + 180.0) % 360.0 - 180.0 if abs(east) > 180.0 else east
    return [digits(east), digits(float(latitude))]


def _annual_losses(
    damage: BuildingDamage, rates: Mapping[str, float], events: Sequence[str]
) -> dict[tuple[int, int], float]:
    """Return rate times mean loss ratio of each level and event of a building.

    Events whose runs have no result are omitted, as in exceedance.csv.
    """
    if not damage.states.losses:
        return {}
    losses: dict[tuple[int, int], list[float]] = {}
    known = zip(damage.rank.tolist(), damage.keys, damage.loss.tolist(), strict=True)
    for rank, key, loss in known:
        if not math.isnan(loss):
            losses.setdefault((rank, key.sample), []).append(loss)
    return {
        (rank, event): rates[events[event - 1]] * math.fsum(ratios) / len(ratios)
        for (rank, event), ratios in losses.items()
    }


def _losses(
    results: Feature, value: float, annual: Mapping[tuple[int, int], float], rank: int, event: int
) -> Feature:
    """Return value, loss and annual losses of a building.

    Parameters
    ----------
    results : Feature
        Results of the damage states, with the mean loss ratio.
    value : float
        Cost of all buildings of the row; nan without costs.
    annual : mapping
        Rate times mean loss ratio by level and event.
    rank, event : int
        Level and event.
    """
    if LOSS.name not in results:
        return {}
    # Without costs, annual losses are fractions of the value of the building.
    ratio, feature, unit = results[LOSS.name], Feature(), 1.0
    if not math.isnan(value):
        unit = value
        feature = {
            _VALUE: digits(value),
            _LOSS: None if ratio is None else digits(value * ratio),
        }
    if annual:
        by_event = annual.get((rank, event))
        over_events = math.fsum(loss for (level, _), loss in annual.items() if level == rank)
        feature |= {
            _ANNUAL: None if by_event is None else digits(unit * by_event),
            _AVERAGE: digits(unit * over_events),
        }
    return feature


def _value_of(cells: Mapping[str, str]) -> float:
    """Return the cost of all buildings of a row of an inventory; nan for an empty cost."""
    count = cell_number(cells[NUMBER]) if cells.get(NUMBER) else 1.0
    return cell_number(cells.get(COST, "")) * count


def write_districts(
    store: Store,
    stream: BinaryIO,
    by: str,
    polygons: Mapping[str, Feature] | None = None,
    events: Collection[str] = (),
) -> None:
    """Write a GeoJSON FeatureCollection of the losses of all buildings with each value of a column.

    The properties are the value of the column, the level, the event, the numbers of buildings, runs
    and failed runs, the mean loss ratio and, with costs, `value`, `loss` and its standard error;
    with rates of the events also `annual_loss` and `average_annual_loss` as in `write_geojson`. The
    geometry is the polygon of the value, or the points of the buildings.

    Parameters
    ----------
    store : Store
        Store of a campaign with losses.
    stream : BinaryIO
        Output.
    by : str
        Column of the inventory.
    polygons : mapping, optional
        Geometries by value of the column (`read_polygons`).
    events : collection of str
        Events to write; all by default.
    """
    _write_collection(_districts(store, by, polygons, events), stream)


def _districts(
    store: Store, by: str, polygons: Mapping[str, Feature] | None, chosen: Collection[str]
) -> Iterator[Feature]:
    """Yield a feature for each district (value of the column `by`), event and level.

    The properties are the numbers of buildings and runs, the mean loss, and with event rates the
    annual loss due to the event and the average annual loss of the district over all events.

    Parameters
    ----------
    store, by, polygons
        As in `write_districts`.
    chosen : collection of str
        Events to write; all if empty.
    """
    positions, rates, costs = _positions_by_district(store, by), store.rates(), has_costs(store)
    groups = list(group_damages(store, by=by))
    pair_demand = store.pair_rule().demand_if_pairs

    def mean_loss(group: TypeDamage) -> float:
        """Return the mean loss of a group; without costs the mean loss ratio."""
        return float((group.money if costs else group.loss).value[0])

    def cell(value: float) -> float | None:
        return None if math.isnan(value) else digits(value)

    # The average annual loss of a district is the sum over all events, also those not written.
    annual: dict[tuple[str, float], list[float]] = {}
    for group in groups:
        if rates and not math.isnan(mean_loss(group)):
            annual.setdefault((group.inventory_entry, group.level), []).append(
                rates[group.event] * mean_loss(group)
            )
    for group in groups:
        if chosen and group.event not in chosen:
            continue
        feature: Feature = {by: group.inventory_entry} | (
            {"event": group.event} if group.event else {}
        )
        feature |= {"level": digits(group.level), "buildings": group.buildings, "runs": group.runs}
        feature |= {"failed": group.failed, LOSS.name: cell(float(group.loss.value[0]))}
        if costs:
            feature |= {_VALUE: cell(group.value), _LOSS: cell(float(group.money.value[0]))}
            feature[f"{_LOSS}_error"] = cell(float(group.money.error[0]))
        if rates:
            losses_of_events = annual.get((group.inventory_entry, group.level), [])
            feature |= {
                _ANNUAL: cell(rates[group.event] * mean_loss(group)),
                _AVERAGE: cell(math.fsum(losses_of_events) if losses_of_events else math.nan),
            }
        feature |= {"pair_demand": pair_demand} if pair_demand else {}
        points = positions.get(group.inventory_entry, [])
        geometry: Feature | None = {"type": "MultiPoint", "coordinates": points} if points else None
        geometry = geometry if polygons is None else polygons.get(group.inventory_entry)
        yield {"type": "Feature", "geometry": geometry, "properties": feature}


def _positions_by_district(store: Store, by: str) -> dict[str, list[list[float]]]:
    """Return the positions of the buildings with each value of a column of the inventory."""
    titles = [title.lower() for title in store.inventory_columns()]
    column, *degrees = (titles.index(name) for name in (by.lower(), "longitude", "latitude"))
    positions: dict[str, list[list[float]]] = {}
    for building in store.buildings():
        cells = store.copied_cells(building)
        east, north = (cells[index] for index in degrees)
        if position := _position(east, north):
            positions.setdefault(cells[column], []).append(position)
    return positions


def read_polygons(source: str, by: str, values: Iterable[str]) -> dict[str, Feature]:
    """Read the polygons of a GeoJSON file.

    The result contains the geometry of each value of the property `by`, for example of each name of
    a district.

    Parameters
    ----------
    source : str
        GeoJSON file: a FeatureCollection of polygons with longitude and latitude in degrees.
    by : str
        Name of the property; the column of the inventory has the same name, regardless of case.
    values : iterable of str
        Values of the column. Each one must have a polygon.

    Raises
    ------
    UsageError
        The file cannot be read, is no such collection, or lacks the polygon of a value.
    """
    large = f"larger than {MOST_BYTES // 1024**2} MiB; simplify the polygons"
    data = read_whole(source, UsageError, {}, large, MOST_BYTES)
    record_digest(source, data)
    needs = f"--polygons is a GeoJSON file (FeatureCollection) of polygons with a property {by}"
    try:
        features = json.loads(data)["features"]
        named = [
            (
                {name.lower(): text for name, text in feature["properties"].items()},
                feature["geometry"],
            )
            for feature in features
        ]
    except (ValueError, LookupError, TypeError, AttributeError, RecursionError):
        raise UsageError(f"{source}: cannot be read; {needs}") from None
    shapes: dict[str, Feature] = {}
    for properties, geometry in named:
        if by.lower() in properties:
            if not isinstance(geometry, dict) or geometry.get("type") not in _POLYGONS:
                raise UsageError(
                    f"{source}: the geometry of {properties[by.lower()]!r} must be a Polygon or "
                    "MultiPolygon"
                )
            name = str(properties[by.lower()])
            if name in shapes:
                raise UsageError(f"{source}: {by} {name!r} is there twice; merge its polygons")
            shapes[name] = geometry
    missing = [value for value in dict.fromkeys(values) if value and value not in shapes]
    if missing:
        listed = ", ".join(missing[:10]) + ", ..." * (len(missing) > 10)
        raise UsageError(f"{source}: no polygon of {by} {listed}; {needs}")
    return shapes


_POLYGONS = ("Polygon", "MultiPolygon")


def _of_level(level: SuiteLevel, runs: Mapping[Run, Sequence[Any]], units: OutputUnits) -> Feature:
    """Return the level, the counts of its ground motions, and mean and maximum of each demand.

    A demand is None without completed runs, or if it is undefined (no drift ratio without height).
    """
    feature: Feature = {"scale": level.scale, "level": level.level}
    feature = {name: digits(value) for name, value in feature.items() if not math.isnan(value)}
    feature |= {"runs": level.runs, "collapsed": level.collapsed, "failed": level.failed}
    for demand, place in zip(_DEMANDS, _PLACES, strict=True):
        column, factor = units.column(demand.column, demand.unit)
        cells = [[runs[key][place] for key in keys] for keys in level.completed]
        values = [
            float(combine(np.abs(of_motion), level.pair_demand)) / factor
            for of_motion in cells
            if None not in of_motion
        ]
        feature[f"mean_{column}"] = digits(math.fsum(values) / len(values)) if values else None
        feature[f"max_{column}"] = digits(max(values)) if values else None
    return feature


def _damage(damage: BuildingDamage, rank: int, event: int) -> Feature:
    """Return mean probabilities of damage states and the mean loss ratio of the runs of a level.

    If `event` is not 0, only the runs of this event are included.
    """
    is_of_event = np.array([event in (0, sample) for _, _, sample in damage.keys])
    chosen = damage.known & (damage.rank == rank) & is_of_event
    outcomes = damage.states.outcomes
    means = (
        damage.probability[chosen].mean(axis=0).tolist() if chosen.any() else [None] * len(outcomes)
    )
    names = [*map(probability_name, outcomes)]
    if damage.states.losses:
        means.append(float(damage.loss[chosen].mean()) if chosen.any() else None)
        names.append(LOSS.name)
    return {
        name: None if mean is None else digits(mean)
        for name, mean in zip(names, means, strict=True)
    }
