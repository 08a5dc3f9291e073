"""A campaign as points on a map: GeoJSON (RFC 7946) with a feature for each building, event and level."""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from itertools import groupby
from typing import TYPE_CHECKING, Any, BinaryIO

import numpy as np

from tdint.campaign.engine.runs import RUN
from tdint.campaign.fragility.run_damage import BuildingDamage, building_damages, stored_states
from tdint.campaign.store.schema import RUNS
from tdint.output.tables.campaign import carried_columns, numeric
from tdint.output.tables.damage_states import LOSS, probability_name
from tdint.output.tables.table import names
from tdint.output_units import SI, OutputUnits

if TYPE_CHECKING:
    from tdint.campaign.engine.runs import Run
    from tdint.campaign.profiles import SuiteLevel
    from tdint.campaign.store.store import Store

_SHOWN = ("peak_drift_ratio", "residual_drift_ratio", "peak_acceleration")
_DEMANDS = tuple(one for one in RUN if one.name in _SHOWN)
_PLACES = tuple(RUNS.columns.index(one.column) for one in _DEMANDS)
_STATUS = RUNS.columns.index("status")
_OWN = ("building", "scale", "level", "runs", "collapsed", "failed")

Feature = dict[str, Any]


def write_geojson(store: Store, stream: BinaryIO, units: OutputUnits = SI) -> None:
    """Write a FeatureCollection of points: longitude and latitude, degrees; null for a building without a place.

    Properties are the columns of the inventory, the event of a field, the level (`scale`, and `level` as in
    profiles.csv), how many motions there were and under how many the building collapsed or a run failed, and of the
    demands the mean and the largest over the others: of a pair the larger component counts. Where damage is told, the
    mean probability of each state and the mean loss ratio follow. What is not known is null.
    The store must have places (`is_mapped`).
    """
    stream.write(b'{"type": "FeatureCollection", "features": [')
    between = b"\n"
    for feature in _features(store, units):
        stream.write(between + json.dumps(feature, ensure_ascii=False, allow_nan=False).encode("utf-8", "replace"))
        between = b",\n"
    stream.write(b"\n]}\n")


def is_mapped(store: Store) -> bool:
    """Whether its inventory has places."""
    return {"longitude", "latitude"} <= {title.lower() for title in store.inventory_columns()}


def _features(store: Store, units: OutputUnits) -> Iterator[Feature]:
    from tdint.campaign.engine.runs import Run
    from tdint.campaign.profiles import SuiteRules

    titles = [title.lower() for title in store.inventory_columns()]
    longitude, latitude = titles.index("longitude"), titles.index("latitude")
    rules, properties, events = SuiteRules.of(store), _properties(store), store.events()
    buildings, damages = store.buildings(), building_damages(store)
    for number, rows in groupby(store.runs(), key=lambda row: row[0]):
        damage = next(damages, None)
        runs = {Run(*row[1:4]): row for row in rows}
        cells = store.carried(number)
        geometry = _point(cells[longitude], cells[latitude])
        for event in sorted({key.sample for key in runs}) if events else (0,):
            head: Feature = {"building": buildings[number][0]} | ({"event": events[event - 1]} if events else {})
            mine = {key: row for key, row in runs.items() if event in (0, key.sample)}
            for rank, level in enumerate(rules.levels({key: row[_STATUS] for key, row in mine.items()})):
                told = _damage(damage, rank, event) if damage else {}
                found = head | _of_level(level) | _demands(level, mine, units) | told | properties(cells)
                yield {"type": "Feature", "geometry": geometry, "properties": found}


def _point(longitude: str, latitude: str) -> Feature | None:
    """A position from -180 to 180 degrees: east of the meridian of Greenwich, then north of the equator."""
    if not longitude or not latitude:
        return None
    east = float(longitude)
    return {"type": "Point", "coordinates": [_digits((east + 180.0) % 360.0 - 180.0 if abs(east) > 180.0 else east),
                                             _digits(float(latitude))]}  # fmt: skip


def _of_level(level: SuiteLevel) -> Feature:
    values = {"scale": level.scale, "level": level.value}
    runs = len(level.stood) + level.collapsed + level.failed
    known = {name: _digits(value) for name, value in values.items() if not math.isnan(value)}
    return {**known, "runs": runs, "collapsed": level.collapsed, "failed": level.failed}


def _demands(level: SuiteLevel, runs: Mapping[Run, Sequence[Any]], units: OutputUnits) -> Feature:
    """Mean and largest of each demand; None without a motion, or without the demand (no heights, no ratio)."""
    found: Feature = {}
    for one, place in zip(_DEMANDS, _PLACES, strict=True):
        column, factor = units.column(one.column, one.unit)
        cells = [[runs[key][place] for key in keys] for keys in level.stood]
        values = [max(abs(cell) for cell in of_motion) / factor for of_motion in cells if None not in of_motion]
        found[f"mean_{column}"] = _digits(math.fsum(values) / len(values)) if values else None
        found[f"max_{column}"] = _digits(max(values)) if values else None
    return found


def _damage(of: BuildingDamage, rank: int, event: int) -> Feature:
    """Mean probability of each damage state and mean loss ratio over the runs of a level, of one event if not 0."""
    mine = np.array([event in (0, sample) for _, _, sample in of.keys])
    chosen = of.known & (of.rank == rank) & mine
    means = of.probability[chosen].mean(axis=0).tolist() if chosen.any() else [None] * len(of.states.outcomes)
    if of.states.losses:
        means.append(float(of.loss[chosen].mean()) if chosen.any() else None)
    names = [*map(probability_name, of.states.outcomes), *(LOSS.name,) * bool(of.states.losses)]
    return {name: None if mean is None else _digits(mean) for name, mean in zip(names, means, strict=True)}


def _properties(store: Store) -> Callable[[Sequence[str]], Feature]:
    """What makes the properties of the inventory's cells: numbers where a column has numbers alone."""
    demands = [f"{what}_{one.column}" for one in _DEMANDS for what in ("mean", "max")]
    outcomes = [probability_name(name) for states in stored_states(store).values() for name in states.outcomes]
    columns = names(carried_columns(store, (*_OWN, *demands, *outcomes, LOSS.name)))[1 if store.events() else 0 :]
    kinds = numeric(store)

    def properties(cells: Sequence[str]) -> Feature:
        return {
            name: (json.loads(text) if text else None) if is_number else text
            for name, text, is_number in zip(columns, cells, kinds, strict=True)
        }

    return properties


def _digits(value: float) -> float:
    """Twelve significant digits, as in tables."""
    return float(format(value + 0.0, ".12g"))
