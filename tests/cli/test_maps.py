"""What maps need: columns of an inventory in the tables of its campaign, GeoJSON, Parquet."""

import json
import math
from pathlib import Path

import pytest

from cli.conftest import Command
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
CARRIED = ["NumberOfStories", "YearBuilt", "StructureType", "PlanArea", "Latitude", "Longitude", "Cost", "zip",
           "inventory_status", "note"]  # fmt: skip


@pytest.fixture
def region(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """campaign.yaml with three buildings, one of them nowhere, under a pair at two scales."""
    monkeypatch.chdir(tmp_path)
    Path("campaign.yaml").write_text(CAMPAIGN)
    Path("buildings.csv").write_text(BUILDINGS)
    Path("motion.mseed").write_bytes((Path(__file__).parents[2] / "records" / "near-fault.mseed").read_bytes())
    return tmp_path


def positions(geometry: dict[str, object] | None) -> list[float] | None:
    """The position of a point after RFC 7946, 3.1.1 and 4: longitude, then latitude, degrees."""
    if geometry is None:
        return None
    assert set(geometry) == {"type", "coordinates"} and geometry["type"] == "Point"
    coordinates = geometry["coordinates"]
    assert isinstance(coordinates, list) and len(coordinates) == 2
    longitude, latitude = coordinates
    assert -180.0 <= longitude <= 180.0 and -90.0 <= latitude <= 90.0
    return coordinates


def test_columns_of_the_inventory_stand_behind_those_of_the_runs(region: Path, tdint: Command) -> None:
    """As they are written, but for what a spreadsheet would run; what has the name of another column gets a prefix."""
    assert tdint("campaign", "campaign.yaml", "-o", "out").exit_code == 0
    table, inventory = rows("out/runs.csv"), {row["id"]: row for row in rows("buildings.csv")}
    assert list(table[0])[-len(CARRIED) :] == CARRIED and len(table) == 12
    for row in table:
        own = inventory[row["building"]]
        for name in CARRIED[:-1]:
            assert row[name] == own[name.removeprefix("inventory_")]
    assert table[0]["note"] == "'=HYPERLINK(1)" and table[0]["status"] == "done"
    summary = json.loads(Path("out/summary.json").read_text())
    assert summary["columns"]["inventory_status"]["meaning"] == "column status of the inventory, as it is written there"
    assert "Cost" not in rows("out/stories.csv")[0]


def test_other_columns_of_an_inventory_run_nothing_anew(region: Path, tdint: Command) -> None:
    assert tdint("campaign", "campaign.yaml", "-o", "out").exit_code == 0
    before = rows("out/runs.csv")
    Path("buildings.csv").write_text(BUILDINGS.replace("zip", "county").replace("1e6", "2e6"))
    again = tdint("campaign", "campaign.yaml", "-o", "out")
    assert again.exit_code == 0 and "nothing to do" in again.stderr
    after = rows("out/runs.csv")
    assert (after[0]["Cost"], after[0]["county"]) == ("2e6", "02138")
    assert [row["peak_drift_m"] for row in after] == [row["peak_drift_m"] for row in before]
    Path("buildings.csv").write_text(BUILDINGS.replace("4500", "4600"))
    assert tdint("campaign", "campaign.yaml", "-o", "out").exit_code == 2


def test_shards_carry_them_along(region: Path, tdint: Command) -> None:
    for part in (1, 2):
        assert tdint("campaign", "campaign.yaml", "-o", f"p{part}", "--shard", f"{part}/2").exit_code == 0
    assert tdint("campaign", "merge", "p1", "p2", "-o", "all").exit_code == 0
    assert tdint("campaign", "campaign.yaml", "-o", "whole").exit_code == 0
    assert Path("all/runs.csv").read_bytes() == Path("whole/runs.csv").read_bytes()


def test_a_map_by_the_rules_of_geojson(region: Path, tdint: Command) -> None:
    """RFC 7946: a FeatureCollection without a crs, positions as longitude and latitude, finite numbers alone; and the
    larger component of runs.csv in the properties."""
    assert tdint("campaign", "campaign.yaml", "-o", "out").exit_code == 0
    result = tdint("campaign", "export", "out", "--geojson")
    assert (result.exit_code, result.stdout) == (0, "")

    def refused(name: str) -> float:
        raise AssertionError(f"{name} is no JSON")

    text = Path("out/buildings.geojson").read_text("utf-8")
    found = json.loads(text, parse_constant=refused)
    assert set(found) == {"type", "features"} and found["type"] == "FeatureCollection"
    features = found["features"]
    assert all(set(one) == {"type", "geometry", "properties"} and one["type"] == "Feature" for one in features)
    assert [positions(one["geometry"]) for one in features[::2]] == [[-122.27, 37.8], [-122.26, 37.81], None]
    properties = [one["properties"] for one in features]
    assert [(one["building"], one["scale"], one["runs"]) for one in properties] == [
        (name, scale, 1) for name in "abc" for scale in (0.5, 1.0)
    ]
    table = rows("out/runs.csv")
    for one in properties:
        mine = [row for row in table if (row["building"], float(row["scale"])) == (one["building"], one["scale"])]
        assert len(mine) == 2
        if one["collapsed"]:
            assert one["mean_peak_drift_ratio"] is None
        else:
            largest = max(float(row["peak_drift_ratio"]) for row in mine)
            assert one["mean_peak_drift_ratio"] == one["max_peak_drift_ratio"] == pytest.approx(largest, rel=1e-11)
    assert {(one["Cost"], one["zip"], one["YearBuilt"], one["status"]) for one in properties} == {
        (1e6, "02138", 1931, "good"), (None, "94110", 1968, "bad"), (5, "94110", 1968, ""),
    }  # fmt: skip


def test_a_map_has_the_units_of_the_tables(region: Path, tdint: Command) -> None:
    tdint("campaign", "campaign.yaml", "-o", "out")
    tdint("campaign", "export", "out", "--geojson")
    tdint("campaign", "export", "out", "--geojson", "--output-units", "kip,in,g")
    (first, *_) = json.loads(Path("out/buildings.geojson").read_text("utf-8"))["features"]
    table = rows("out/runs.csv")
    largest = max(float(row["peak_absolute_acceleration_g"]) for row in table[::2][:2])
    assert first["properties"]["max_peak_absolute_acceleration_g"] == pytest.approx(largest, rel=1e-11)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (("Latitude,Longitude", "North,East"), "a map needs an inventory with the columns Latitude and Longitude"),
        (("", ""), "not all runs are done; a map tells what the buildings do under all motions"),
    ],
)
def test_what_a_map_refuses(region: Path, tdint: Command, change: tuple[str, str], message: str) -> None:
    Path("buildings.csv").write_text(BUILDINGS.replace(*change) if change[0] else BUILDINGS)
    assert tdint("campaign", "campaign.yaml", "-o", "out", *(() if change[0] else ("--max-runs", "1"))).exit_code == 0
    result = tdint("campaign", "export", "out", "--geojson")
    assert result.exit_code == 2 and message in result.stderr and result.stderr.count("\n") == 1
    assert not Path("out/buildings.geojson").exists()


def test_a_map_goes_with_its_places(region: Path, tdint: Command) -> None:
    """It is written anew with the other tables, and is gone where the inventory has no places any more."""
    tdint("campaign", "campaign.yaml", "-o", "out")
    tdint("campaign", "export", "out", "--geojson")
    Path("buildings.csv").write_text(BUILDINGS.replace("1e6", "3e6"))
    again = tdint("campaign", "campaign.yaml", "-o", "out")
    assert "buildings.geojson: written anew" in again.stderr
    assert json.loads(Path("out/buildings.geojson").read_text("utf-8"))["features"][0]["properties"]["Cost"] == 3e6
    Path("buildings.csv").write_text(BUILDINGS.replace("Latitude", "North"))
    again = tdint("campaign", "campaign.yaml", "-o", "out")
    assert again.exit_code == 0 and "buildings.geojson: removed" in again.stderr
    assert not Path("out/buildings.geojson").exists()


def test_parquet_has_the_rows_of_the_tables(region: Path, tdint: Command) -> None:
    """Runs and stories; columns of the inventory are numbers where all their cells are."""
    parquet = pytest.importorskip("pyarrow.parquet")
    tdint("campaign", "campaign.yaml", "-o", "out")
    assert tdint("campaign", "export", "out").exit_code == 0
    for name in ("runs", "stories"):
        found, table = parquet.read_table(f"out/{name}.parquet"), rows(f"out/{name}.csv")
        assert found.column_names == list(table[0]) and found.num_rows == len(table)
        for given, told in zip(found.to_pylist(), table, strict=True):
            for column, value in given.items():
                text = told[column]
                if value is None or isinstance(value, str):
                    assert (value or "") == text
                else:
                    assert math.isclose(value, float(text), rel_tol=1e-11)
    kinds = {field.name: str(field.type) for field in parquet.read_schema("out/runs.parquet")}
    assert (kinds["Cost"], kinds["zip"], kinds["steps"], kinds["note"]) == ("double", "string", "int64", "string")


def test_damage_has_them_too(region: Path, tdint: Command) -> None:
    """Columns of the inventory in damage.csv and damage.parquet; the map has the means over the runs of damage.csv."""
    with Path("campaign.yaml").open("a") as stream:
        stream.write(
            "damage: {thresholds: {slight: 0.4%, complete: 2%}, dispersion: 0.3, losses: {slight: 10%, complete: 1}}\n"
        )
    assert tdint("campaign", "campaign.yaml", "-o", "out").exit_code == 0
    assert tdint("campaign", "export", "out", "--geojson").exit_code == 0
    table = rows("out/damage.csv")
    assert list(table[0])[-len(CARRIED) :] == CARRIED
    for feature in json.loads(Path("out/buildings.geojson").read_text("utf-8"))["features"]:
        one = feature["properties"]
        mine = [row for row in table if (row["building"], float(row["scale"])) == (one["building"], one["scale"])]
        for name in ("probability_none", "probability_slight", "probability_collapsed", "loss_ratio"):
            assert one[name] == pytest.approx(sum(float(row[name]) for row in mine) / 2, rel=1e-10, abs=1e-12)
    parquet = pytest.importorskip("pyarrow.parquet")
    found = parquet.read_table("out/damage.parquet")
    assert found.column_names == list(table[0]) and found.num_rows == len(table)
