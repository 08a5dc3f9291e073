"""Data for maps: columns of an inventory in the tables of its campaign, GeoJSON, Parquet."""

import json
from pathlib import Path
from typing import Any

import pytest

from cli.conftest import Command, check_parquet
from csv_rows import rows

CAMPAIGN = """\
buildings: {inventory: buildings.csv, units: {length: ft}}
records: {files: [motion.mseed], units: m/s^2, pairs: true}
intensity: {scales: [0.5, 1]}
outputs: {stories: true}
"""
BUILDINGS = """\
id,NumberOfStories,YearBuilt,StructureType,PlanArea,Latitude,Longitude,Cost,zip,status,note
a,3,1931,URM,4500,37.80,-122.27,1e6,02138,good,=HYPERLINK(1)
b,2,1968,C1,12000,37.81,237.74,,94110,bad,"two, cells"
c,1,1968,W1,12000,,,5,94110,,
"""
CARRIED = [
    "NumberOfStories", "YearBuilt", "StructureType", "PlanArea", "Latitude",
    "Longitude", "Cost", "zip", "inventory_status", "note",
]  # fmt: skip


@pytest.fixture
def region(working_directory: Path) -> Path:
    """Write campaign.yaml with three buildings (the third without coordinates), a pair and two
    scales."""
    Path("campaign.yaml").write_text(CAMPAIGN)
    Path("buildings.csv").write_text(BUILDINGS)
    Path("motion.mseed").write_bytes(
        (Path(__file__).parents[3] / "records" / "near-fault.mseed").read_bytes()
    )
    return working_directory


@pytest.fixture
def mapped(region: Path, tdint: Command) -> list[dict[str, Any]]:
    """Return the buildings of the map of the campaign in `out`."""
    tdint("campaign", "campaign.yaml", "-o", "out", code=0)
    assert tdint("campaign", "export", "out", "--geojson", code=0).stdout == ""
    return features()


def features() -> list[dict[str, Any]]:
    def refused(name: str) -> float:
        raise AssertionError(f"{name} is no JSON")

    collection = json.loads(
        Path("out/buildings.geojson").read_text("utf-8"), parse_constant=refused
    )
    assert set(collection) == {"type", "features"} and collection["type"] == "FeatureCollection"
    return collection["features"]


def of_building(table: list[dict[str, str]], properties: dict[str, Any]) -> list[dict[str, str]]:
    """Return the rows of both components for a building and a scale."""
    pair = [
        row
        for row in table
        if (row["building"], float(row["scale"])) == (properties["building"], properties["scale"])
    ]
    assert len(pair) == 2
    return pair


def positions(geometry: dict[str, Any] | None) -> list[float] | None:
    """Return the coordinates of a point according to RFC 7946, 3.1.1 and 4: longitude, then
    latitude, degrees."""
    if geometry is None:
        return None
    assert set(geometry) == {"type", "coordinates"} and geometry["type"] == "Point"
    longitude, latitude = geometry["coordinates"]
    assert -180.0 <= longitude <= 180.0 and -90.0 <= latitude <= 90.0
    return [longitude, latitude]


@pytest.mark.long
@pytest.mark.usefixtures("mapped")
def test_columns_of_the_inventory_follow_the_columns_of_the_runs(tdint: Command) -> None:
    """Columns of the inventory follow the other columns. Their texts are unchanged, except for
    texts that a spreadsheet would execute, and duplicate column names have a prefix. Changed
    additional columns do not cause new runs. Shards keep these columns."""
    table, inventory = rows("out/runs.csv"), {row["id"]: row for row in rows("buildings.csv")}
    assert list(table[0])[-len(CARRIED) :] == CARRIED and len(table) == 12
    for row in table:
        written = inventory[row["building"]]
        assert all(row[name] == written[name.removeprefix("inventory_")] for name in CARRIED[:-1])
    assert table[0]["note"] == "'=HYPERLINK(1)" and table[0]["status"] == "done"
    summary = json.loads(Path("out/summary.json").read_text())
    assert (
        summary["columns"]["inventory_status"]["meaning"]
        == "column status of the inventory, unchanged"
    )
    assert "Cost" not in rows("out/stories.csv")[0]
    for part in (1, 2):
        tdint("campaign", "campaign.yaml", "-o", f"p{part}", "--shard", f"{part}/2", code=0)
    tdint("campaign", "merge", "p1", "p2", "-o", "all", code=0)
    assert Path("all/runs.csv").read_bytes() == Path("out/runs.csv").read_bytes()
    Path("buildings.csv").write_text(BUILDINGS.replace("zip", "county").replace("1e6", "2e6"))
    assert "nothing to do" in tdint("campaign", "campaign.yaml", "-o", "out", code=0).stderr
    after = rows("out/runs.csv")
    assert (after[0]["Cost"], after[0]["county"]) == ("2e6", "02138")
    assert [row["peak_drift_m"] for row in after] == [row["peak_drift_m"] for row in table]
    Path("buildings.csv").write_text(BUILDINGS.replace("4500", "4600"))
    tdint("campaign", "campaign.yaml", "-o", "out", code=6)


def test_a_map_follows_the_geojson_specification(
    mapped: list[dict[str, Any]], tdint: Command
) -> None:
    """RFC 7946: a FeatureCollection without a crs, positions as longitude and latitude, only finite
    numbers. The properties contain the larger component of runs.csv, in the units of the tables."""
    assert all(
        set(feature) == {"type", "geometry", "properties"} and feature["type"] == "Feature"
        for feature in mapped
    )
    assert [positions(feature["geometry"]) for feature in mapped[::2]] == [
        [-122.27, 37.8],
        [-122.26, 37.81],
        None,
    ]
    properties = [feature["properties"] for feature in mapped]
    assert [(feature["building"], feature["scale"], feature["runs"]) for feature in properties] == [
        (name, scale, 1) for name in "abc" for scale in (0.5, 1.0)
    ]
    table = rows("out/runs.csv")
    for feature in properties:
        largest = max(float(row["peak_drift_ratio"]) for row in of_building(table, feature))
        mean = None if feature["collapsed"] else feature["max_peak_drift_ratio"]
        assert feature["mean_peak_drift_ratio"] == mean
        assert feature["collapsed"] or mean == pytest.approx(largest, rel=1e-11)
    columns = ("Cost", "zip", "YearBuilt", "status")
    assert {tuple(feature[name] for name in columns) for feature in properties} == {
        (1e6, "02138", 1931, "good"),
        (None, "94110", 1968, "bad"),
        (5, "94110", 1968, ""),
    }
    tdint("campaign", "export", "out", "--geojson", "--output-units", "kip,in,g", code=0)
    first, table = features()[0]["properties"], rows("out/runs.csv")
    largest = max(float(row["peak_absolute_acceleration_g"]) for row in of_building(table, first))
    assert first["max_peak_absolute_acceleration_g"] == pytest.approx(largest, rel=1e-11)


@pytest.mark.parametrize(
    ("change", "options", "message"),
    [
        (("Latitude,Longitude", "North,East"), (), "map requires ... Latitude and Longitude"),
        (("", ""), ("--max-runs", "1"), "not all runs are completed"),
    ],
)
def test_invalid_maps_are_refused(
    region: Path, tdint: Command, change: tuple[str, str], options: tuple[str, ...], message: str
) -> None:
    Path("buildings.csv").write_text(BUILDINGS.replace(*change, 1))
    tdint("campaign", "campaign.yaml", "-o", "out", *options, code=0)
    result = tdint.refused(message, "campaign", "export", "out", "--geojson")
    assert result.stderr.count("\n") == 1 and not Path("out/buildings.geojson").exists()


@pytest.mark.usefixtures("mapped")
def test_a_map_is_updated_or_removed_with_its_coordinates(tdint: Command) -> None:
    """The map is updated with the other tables, and removed if the inventory no longer has
    coordinates."""
    Path("buildings.csv").write_text(BUILDINGS.replace("1e6", "3e6"))
    assert "buildings.geojson: updated" in tdint("campaign", "campaign.yaml", "-o", "out").stderr
    assert features()[0]["properties"]["Cost"] == 3e6
    Path("buildings.csv").write_text(BUILDINGS.replace("Latitude", "North"))
    assert (
        "buildings.geojson: removed"
        in tdint("campaign", "campaign.yaml", "-o", "out", code=0).stderr
    )
    assert not Path("out/buildings.geojson").exists()


@pytest.mark.usefixtures("mapped")
def test_parquet_has_the_rows_of_the_tables(tdint: Command) -> None:
    """Runs and stories are written. Columns of the inventory are numeric if all their cells are
    numbers."""
    pytest.importorskip("pyarrow")
    tdint("campaign", "export", "out", code=0)
    _, found = (
        check_parquet(f"out/{name}.parquet", rows(f"out/{name}.csv"))
        for name in ("stories", "runs")
    )
    types = {field.name: str(field.type) for field in found.schema}
    assert (types["Cost"], types["zip"], types["steps"], types["note"]) == (
        "double", "string", "int64", "string",
    )  # fmt: skip


def test_damage_tables_contain_the_columns_of_the_inventory(region: Path, tdint: Command) -> None:
    """damage.csv and damage.parquet contain the columns of the inventory; the map contains the
    means over the runs of damage.csv."""
    damage = (
        "{thresholds: {slight: 0.4%, complete: 2%}, dispersion: 0.3, losses: {slight: 10%, "
        "complete: 1}}"
    )
    Path("campaign.yaml").write_text(f"{CAMPAIGN}damage: {damage}\n")
    tdint("campaign", "campaign.yaml", "-o", "out", "--pair-demand", "separate", code=0)
    tdint("campaign", "export", "out", "--geojson", code=0)
    table = rows("out/damage.csv")
    assert list(table[0])[-len(CARRIED) :] == CARRIED
    for properties in (feature["properties"] for feature in features()):
        pair = of_building(table, properties)
        for name in (
            "probability_none",
            "probability_slight",
            "probability_collapsed",
            "loss_ratio",
        ):
            mean = sum(float(row[name]) for row in pair) / 2
            assert properties[name] == pytest.approx(mean, rel=1e-10, abs=1e-12)
    check_parquet("out/damage.parquet", table)
