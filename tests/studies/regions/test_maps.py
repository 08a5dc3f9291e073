"""Maps of a campaign: positions, polygons, the map that a store cannot have, and the file.

tests/cli/studies/test_maps.py compares the properties of buildings with the tables of a campaign,
and tests/cli/test_fields.py the losses of districts.
"""

from __future__ import annotations

import io
import json
import math

import pytest

from facts import states
from tdint.errors import UsageError
from tdint.studies.regions import maps


class RegionStore:
    """The part of a store that maps read: an inventory with districts, and events."""

    name = "out"

    def __init__(self, columns=("district", "Longitude", "LATITUDE"), events=()):
        self.columns, self.known_events = columns, events
        self.cells = [
            ("north", "-122.5", "37.5"), ("south", "237.25", "37"), ("", "1", "2"),
            ("south", "", ""),
        ]  # fmt: skip

    def inventory_columns(self):
        return self.columns

    def events(self):
        return self.known_events

    def buildings(self):
        return dict.fromkeys(range(len(self.cells)))

    def copied_cells(self, number):
        return self.cells[number]


@pytest.mark.parametrize(
    ("longitude", "latitude", "position"),
    [
        ("-122.27", "37.8", [-122.27, 37.8]),
        ("180", "-90", [180.0, -90.0]),
        ("237.5", "1", [-122.5, 1.0]),
        ("-190", "1", [170.0, 1.0]),
        ("0.1234567890123456", "0", [0.123456789012, 0.0]),
        ("", "37.8", None),
        ("-122.27", "", None),
    ],
)
def test_positions_are_longitude_and_latitude_within_180_degrees(longitude, latitude, position):
    assert maps._position(longitude, latitude) == position


def test_districts_have_the_positions_of_their_buildings():
    assert maps._positions_by_district(RegionStore(), "District") == {
        "north": [[-122.5, 37.5]],
        "south": [[-122.75, 37.0]],
        "": [[1.0, 2.0]],
    }


def test_features_are_written_one_per_line_and_an_empty_map_is_a_collection():
    features = [{"type": "Feature", "properties": {"name": "Lübeck\ud800"}}, {"type": "Feature"}]
    stream = io.BytesIO()
    maps.write_geojson(iter(features), stream)
    assert stream.getvalue().count(b"\n") == 4
    names = [feature.get("properties") for feature in json.loads(stream.getvalue())["features"]]
    assert names == [{"name": "Lübeck?"}, None]
    maps.write_geojson((), empty := io.BytesIO())
    assert json.loads(empty.getvalue()) == {"type": "FeatureCollection", "features": []}
    with pytest.raises(ValueError, match="Out of range"):
        maps.write_geojson([{"loss": math.nan}], io.BytesIO())


def test_unknown_numbers_are_null_and_others_have_12_digits():
    properties = {"loss": math.nan, "drift": 1.0 / 3.0, "runs": 7, "name": "a"}
    assert maps._in_json(properties) == {
        "loss": None, "drift": 0.333333333333, "runs": 7, "name": "a"
    }  # fmt: skip


@pytest.mark.parametrize(
    ("store", "requested", "complete", "message"),
    [
        (RegionStore(("district", "Latitude")), (), True, "no coordinates.*Longitude"),
        (RegionStore(), (), False, "not all runs .* again"),
        (RegionStore(), ("e3",), True, "--event e3: out .* only ground motion fields"),
        (RegionStore(events=("e1", "e2")), ("e2", "e3"), True, "--event e3: .* e1, e2"),
    ],
)
def test_maps_that_a_store_cannot_have_are_refused(store, requested, complete, message):
    with pytest.raises(UsageError, match=message):
        maps.check_map(store, requested, None, complete=complete)


def collection(*features):
    """Return a GeoJSON text of (properties, type of the geometry)."""
    return json.dumps(
        {
            "type": "FeatureCollection",
            "features": [
                {"properties": properties, "geometry": {"type": kind, "coordinates": []}}
                for properties, kind in features
            ],
        }
    )


BOTH = (({"District": "north"}, "Polygon"), ({"DISTRICT": "south"}, "MultiPolygon"))


def test_polygons_are_read_by_the_property_regardless_of_case(tmp_path):
    source = tmp_path / "districts.geojson"
    source.write_text(collection(*BOTH, ({"district": 5}, "Polygon"), ({"name": "x"}, "Point")))
    polygons = maps.read_polygons(RegionStore(), str(source), "district")
    assert {name: geometry["type"] for name, geometry in polygons.items()} == {
        "north": "Polygon", "south": "MultiPolygon", "5": "Polygon"
    }  # fmt: skip


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (collection(BOTH[0]), "no polygon of district south ... FeatureCollection"),
        (collection(*BOTH, BOTH[0]), "two polygons ... district 'north' ... MultiPolygon"),
        (collection(({"district": "north"}, "Point")), "'north' ... Polygon"),
        ("[1]", "cannot be read ... FeatureCollection ... district"),
        ('{"features": [{"properties": null, "geometry": null}]}', "cannot be read"),
        ("[" * 100_000, "cannot be read"),
    ],
)
def test_unusable_polygons_are_refused(tmp_path, text, message):
    source = tmp_path / "districts.geojson"
    source.write_text(text)
    with pytest.raises(UsageError) as refusal:
        maps.read_polygons(RegionStore(), str(source), "district")
    assert states(str(refusal.value), f"{source} ... {message}")
