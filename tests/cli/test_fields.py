"""Ground motion fields: intensities or records of events at sites, in the formats of OpenQuake and
SimCenter."""

import json
import math
import re
import resource
import shutil
import sqlite3
import tracemalloc
from contextlib import closing
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.stats import beta, norm

from cli.conftest import Command, change, copy_of, made_once, write_record
from csv_rows import rows
from facts import states
from tdint.ground_motion.choice import RecordChoice
from tdint.studies.campaign.assigned_motions import FieldFile, FieldMotions
from tdint.studies.campaign.buildings import RowBuildings
from tdint.studies.campaign.inputs import read_inputs
from tdint.studies.campaign.plan import make_plan
from tdint.studies.campaign.reader import load_campaign
from tdint.studies.regions.sites import CampaignMotions, read_field

CAMPAIGN = """\
buildings: {inventory: buildings.csv, units: {length: ft}}
records: {fields: fields.csv, sites: sites.csv, units: m/s^2, pairs: true, pair_demand: separate}
"""
BUILDINGS = """\
id,NumberOfStories,YearBuilt,StructureType,PlanArea,Latitude,Longitude,site
a,3,1931,URM,4500,37.80,-122.27,west
b,2,1968,C1,12000,37.805,-122.25,east
c,1,1968,W1,1500,37.81,-122.26,east
"""
FIELDS = """\
event,site,record,factor
M7-1,west,firm.mseed,0.5
M7-1,east,soft.mseed,-1.25
M7-2,west,soft.mseed,2
M7-2,east,firm.mseed,
M6,east,firm.mseed,0.25
"""
SITES = "site,longitude,latitude\nwest,-122.27,37.8\neast,-122.25,37.81\n"
DAMAGE = (
    "damage: {thresholds: hazus, losses: {slight: 5%, moderate: 20%, extensive: 60%, complete: "
    "1}}\n"
)
COSTS = ("cost,number,district", "2e6,3,north", "1.5e6,1,south", "4e5,10,north")


@pytest.fixture(scope="module")
def done(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Directory `out` of a completed campaign with three buildings at two sites, three events and
    two records. One event has no row for one of the sites."""

    def make(folder: Path) -> None:
        write_record(folder / "firm.mseed", "HN1", "HN2", samples=400)
        write_record(folder / "soft.mseed", "HN1", "HN2", samples=300, peak=4.0)
        files = {
            "campaign.yaml": CAMPAIGN,
            "buildings.csv": BUILDINGS,
            "fields.csv": FIELDS,
            "sites.csv": SITES,
        }
        for name, text in files.items():
            Path(name).write_text(text)
        Command()("campaign", "campaign.yaml", "-o", "out", code=0)

    return made_once(tmp_path_factory, make)


region = copy_of("done")


@pytest.fixture(scope="module")
def done_with_losses(done: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The same region with costs of buildings and annual rates of events; damage and losses by
    district."""

    def make(folder: Path) -> None:
        shutil.copytree(done, folder, dirs_exist_ok=True, ignore=shutil.ignore_patterns("out"))
        lines = [
            f"{line},{cells}\n" for line, cells in zip(BUILDINGS.splitlines(), COSTS, strict=True)
        ]
        Path("buildings.csv").write_text("".join(lines))
        Path("rates.csv").write_text("event,rate\nM7-1,0.002\nM7-2,0.004\nM6,0.05\nM5,1\n")
        Path("campaign.yaml").write_text(
            CAMPAIGN.replace("pairs: true", "pairs: true, rates: rates.csv") + DAMAGE
        )
        Command()("campaign", "campaign.yaml", "-o", "out", "--by", "District", code=0)

    return made_once(tmp_path_factory, make)


losing = copy_of("done_with_losses")


PLACED = ("site", "distance_km", "inventory_site")


def outcome(
    row: dict[str, str], *, but: tuple[str, ...] = ("sample", "event", "level")
) -> dict[str, str]:
    return {name: text for name, text in row.items() if name not in (*but, *PLACED)}


def test_runs_equal_separate_campaigns_of_each_row(region: Path, tdint: Command) -> None:
    """Each row of the table equals, to the last digit, a separate campaign with its record and
    factor."""
    found = rows("out/runs.csv")
    # 2 components; 2, 3 and 3 events at the sites of a, b and c
    assert len(found) == 2 * (2 + 3 + 3)
    sites, numbers = {"a": "west", "b": "east", "c": "east"}, {"M7-1": "1", "M7-2": "2", "M6": "3"}
    by_hand = []
    for index, row in enumerate(rows("fields.csv")):
        files = f"files: [{row['record']}]"
        scales = f"intensity: {{scales: [{row['factor'] or 1}]}}\n"
        Path("one.yaml").write_text(
            CAMPAIGN.replace("fields: fields.csv, sites: sites.csv", files) + scales
        )
        tdint("campaign", "one.yaml", "-o", f"one-{index}", code=0)
        by_hand += [
            run | {"event": row["event"], "sample": numbers[row["event"]]}
            for run in rows(f"one-{index}/runs.csv")
            if sites[run["building"]] == row["site"]
        ]

    def in_order(runs: list[dict[str, str]]) -> list[list[str]]:
        names = ["building", "record", "component", "scale", "sample"]
        # The factors of a table of fields are no levels, and a campaign numbers its own motions.
        names += [name for name in found[0] if name not in (*names, *PLACED, "level", "motion")]
        return sorted([run[name] for name in names] for run in runs)

    assert in_order(found) == in_order(by_hand)
    assert {row["level"] for row in found} == {""}
    motions: dict[str, list[str]] = {}
    for row in found:
        motions.setdefault(row["motion"], []).append(row["record"])
    # Both components of a record are one motion in each building and event.
    assert all(len(set(records)) == 1 for records in motions.values()), motions
    assert {(row["building"], row["site"]) for row in found} == set(sites.items())


def test_the_site_of_a_building_is_the_nearest_or_its_named_site(
    region: Path, tdint: Command
) -> None:
    """Buildings with a column `site` need no coordinates. If the table has no sites, every event
    applies to every building."""
    change("campaign.yaml", (" sites: sites.csv,", ""))
    tdint("campaign", "campaign.yaml", "-o", "named", code=0)
    named, nearest = (
        [outcome(row, but=()) for row in rows(f"{out}/runs.csv")] for out in ("named", "out")
    )
    assert named == nearest
    Path("fields.csv").write_text("event,record\nA,firm.mseed\nB,soft.mseed\n")
    tdint("campaign", "campaign.yaml", "-o", "all", code=0)
    assert [(row["building"], row["event"]) for row in rows("all/runs.csv")[::2]] == [
        (name, event) for name in "abc" for event in "AB"
    ]


def test_distances_in_degrees_select_another_site_than_distances_in_km(
    region: Path, tdint: Command
) -> None:
    """At 60 degrees north, a degree of longitude is half as long as a degree of latitude, so that
    distances in degrees select another nearest site than distances in km."""
    Path("buildings.csv").write_text(BUILDINGS.splitlines()[0] + "\na,1,1968,W1,1500,60,10,\n")
    Path("sites.csv").write_text("site,longitude,latitude\nwest,10.15,60\neast,10,60.1\n")
    Path("fields.csv").write_text("event,site,record\n1,west,firm.mseed\n1,east,soft.mseed\n")
    for option, record in (
        ("", "firm"),
        (", distance: km", "firm"),
        (", distance: degrees", "soft"),
    ):
        Path("campaign.yaml").write_text(CAMPAIGN.replace("pairs: true", f"pairs: true{option}"))
        assert tdint("campaign", "campaign.yaml", "-o", "out", "--overwrite").exit_code == 0
        assert {row["record"] for row in rows("out/runs.csv")} == {f"{record}.mseed"}


def test_tables_of_openquake_are_read(region: Path, tdint: Command) -> None:
    """Tables with the column names of OpenQuake and its comment line above the header are read."""
    above = "#,,,\"generated_by='OpenQuake engine 3.26.2', start_date='2026-01-01T00:00:00'\"\n"
    Path("fields.csv").write_text(above + FIELDS.replace("event,site", "event_id,site_id"))
    Path("sites.csv").write_text(
        above + SITES.replace("site,longitude,latitude", "site_id,lon,lat")
    )
    tdint("campaign", "campaign.yaml", "-o", "theirs", code=0)
    assert Path("theirs/runs.csv").read_bytes() == Path("out/runs.csv").read_bytes()


@pytest.mark.parametrize(
    ("column", "measure", "unit"),
    [("gmv_PGA", "pga", "g"), ("gmv_SA(0.6)", "sa", "g"), ("gmv_PGV", "pgv", "m/s")],
)
def test_intensities_of_openquake_scale_the_records(
    region: Path, tdint: Command, column: str, measure: str, unit: str
) -> None:
    """A record scaled to the intensity in its row gives the same result, to the last digit, as a
    campaign with this intensity level."""
    value = "0.31" if unit == "g" else "31"
    Path("fields.csv").write_text(f"event_id,site_id,{column},record\n0,west,{value},firm.mseed\n")
    Path("sites.csv").write_text("site_id,lon,lat\nwest,-122.27,37.8\n")
    tdint("campaign", "campaign.yaml", "-o", "theirs", code=0)
    period = ", period: 0.6" if measure == "sa" else ""
    Path("campaign.yaml").write_text(
        CAMPAIGN.replace("fields: fields.csv, sites: sites.csv", "files: [firm.mseed]")
        + f"intensity: {{measure: {measure}{period}, levels: [0.31 {unit}]}}\n"
    )
    tdint("campaign", "campaign.yaml", "-o", "levels", code=0)
    openquake_rows, levels = (
        [outcome(row) for row in rows(f"{out}/runs.csv")] for out in ("theirs", "levels")
    )
    assert openquake_rows == levels


def test_rows_of_simcenter_files_are_events(region: Path, tdint: Command) -> None:
    """With `events` of a grid, row k of the file of each grid point is event k, and a building has
    the events of the nearest point. The runs equal the runs of an equivalent table of fields."""
    random = np.random.default_rng(5)
    for name in ("m1", "m2", "m3"):
        data = {key: (0.1 * random.standard_normal(300)).tolist() for key in ("data_x", "data_y")}
        Path(f"{name}.json").write_text(json.dumps({"name": name, "dT": 0.01, **data}))
    Path("EventGrid.csv").write_text(
        "GP_file,Longitude,Latitude\np1.csv,-122.27,37.8\np2.csv,-122.25,37.81\n"
    )
    Path("p1.csv").write_text("TH_file,factor\nm1,1\nm2,0.5\n")
    Path("p2.csv").write_text("TH_file,factor\nm3,2\nm1,1.5\n")
    buildings = CAMPAIGN.splitlines()[0]
    Path("grid.yaml").write_text(
        f"{buildings}\nrecords: {{grid: EventGrid.csv, units: g, events: true}}\n"
    )
    tdint("campaign", "grid.yaml", "-o", "grid", code=0)
    Path("fields.csv").write_text(
        "event,site,record,factor\n1,west,m1.json,1\n2,west,m2.json,.5\n1,east,m3.json,2\n2,east,m1.json,1.5\n"
    )
    change("campaign.yaml", ("m/s^2", "g"))
    tdint("campaign", "campaign.yaml", "-o", "fields", code=0)
    grid, fields = (
        sorted(
            rows(f"{out}/runs.csv"),
            key=lambda row: (row["building"], row["event"], row["component"]),
        )
        for out in ("grid", "fields")
    )
    assert [outcome(row, but=("record",)) for row in grid] == [
        outcome(row, but=("record",)) for row in fields
    ]
    Path("p2.csv").write_text("TH_file\nm3\n")
    tdint.refused("p2.csv: ... 1 motions ... p1.csv lists 2", "campaign grid.yaml -o other", code=3)


@pytest.mark.parametrize(
    ("file", "before", "after", "code", "message"),
    [
        ("fields.csv", "M7-2,east", "M7-2,north", 3,
         "fields.csv:5: site 'north' not found in sites.csv"),
        ("fields.csv", "M7-2,east", "M7-1,east", 3,
         "fields.csv:5: event 'M7-1' at site 'east' ... line 3; ... one record"),
        ("fields.csv", "-1.25", "0", 3, "fields.csv:3: factor must not be zero, got '0'"),
        ("fields.csv", "-1.25", "x", 3, "fields.csv:3: factor ... got 'x'"),
        ("fields.csv", "M7-2,west", ",west", 3, "fields.csv:4: event is missing"),
        ("fields.csv", "event,", "quake,", 3, "fields.csv:1: no column event"),
        ("fields.csv", FIELDS, "event,site,record,gmv_PGA\n1,east,firm.mseed,\n", 3,
         "fields.csv:2: gmv_pga is missing"),
        ("fields.csv", FIELDS, "event,record,gmv_SA(0.6)\n1,firm.mseed,-1\n", 3,
         "fields.csv:1: no column site"),
        ("fields.csv", FIELDS, "event,site,record,gmv_SA(0.6)\n1,east,firm.mseed,-1\n", 3,
         "fields.csv:2: gmv_sa(0.6) must be a positive number, got '-1'"),
        ("fields.csv", FIELDS, "event,site,record,gmv_SA(1e-5)\n1,east,firm.mseed,1\n", 3,
         "gmv_SA(period)"),
        ("fields.csv", FIELDS, "event,site,record,gmv_SA(.0001)\n1,east,firm.mseed,1\n", 4,
         "fields.csv:2: "),
        ("fields.csv", "record,factor", "record,gmv_MMI", 3, "fields.csv:1: ... gmv_mmi; "),
        ("sites.csv", "37.81", "97.81", 3,
         "sites.csv:3: latitude ... -90 to 90 degrees, got '97.81'"),
        ("sites.csv", "east", "west", 3, "sites.csv:3: site 'west' is already on line 2"),
        ("buildings.csv", "Latitude,Longitude", "north,east", 3,
         "buildings.csv:1: no column Latitude"),
        ("fields.csv", "event,site", "event,place", 3, "fields.csv:1: no column site"),
        ("campaign.yaml", "sites: sites.csv", "distance: degrees", 3,
         "has no effect without `sites`"),
        ("campaign.yaml", "sites: sites.csv", "files: [firm.mseed]", 3,
         "cannot be used with `fields`"),
        ("campaign.yaml", "pair_demand: separate}",
         "pair_demand: separate}\nintensity: {measure: pga, levels: [1 g]}", 3,
         "cannot be used with events"),
    ],
)  # fmt: skip
def test_invalid_input_is_refused_with_file_and_line(
    region: Path, tdint: Command, file: str, before: str, after: str, code: int, message: str
) -> None:
    """Invalid input causes a one-line error with file and line, and no output is written."""
    text = Path(file).read_text()
    assert before in text
    Path(file).write_text(text.replace(before, after, 1))
    result = tdint.refused(message, "campaign", "campaign.yaml", "-o", "new", code=code)
    assert result.stderr.count("\n") == 1


def test_all_errors_of_a_table_are_reported_at_once(region: Path, tdint: Command) -> None:
    changes = (
        ("-1.25", "0"),
        ("M7-2,west", ",west"),
        ("M7-2,east", "M7-2,north"),
        ("M6,east", "M7-1,west"),
    )
    change("fields.csv", *changes)
    result = tdint("campaign", "campaign.yaml", "-o", "new", code=3)
    beginnings = (
        "3: factor must not be zero",
        "4: event is missing",
        "5: site 'north' not found in sites.csv",
        "6: event 'M7-1' at site",
    )
    errors = [line.partition("fields.csv:")[2] for line in result.stderr.splitlines()]
    assert len(errors) == 4 and all(
        line.startswith(beginning) for line, beginning in zip(errors, beginnings, strict=True)
    )
    Path("fields.csv").write_text("event,site,record\n" + ",east,firm.mseed\n" * 1050)
    result = tdint("campaign", "campaign.yaml", "-o", "new")
    assert (
        result.stderr.splitlines()[-1].endswith("and at least 990 more errors")
        and result.stderr.count("\n") == 11
    )


def test_distant_buildings_and_buildings_without_coordinates_are_skipped(
    region: Path, tdint: Command
) -> None:
    """Distances follow the haversine formula. A building on the other hemisphere is skipped, a
    building without coordinates is an invalid row, and the results of the other buildings are
    unchanged to the last digit."""
    first = rows("out/runs.csv")
    additional_rows = "d,1,1968,W1,1500,-37.8,57.7,east\ne,1,1968,W1,1500,37.9,-122.26,east\n"
    Path("buildings.csv").write_text(BUILDINGS + additional_rows)
    result = tdint("campaign", "campaign.yaml", "-o", "far", "-q", code=4)
    assert re.search("1 building .*max_distance", result.stderr)
    found = rows("far/runs.csv")
    assert [row for row in found if row["building"] != "e"] == first
    distances = {row["building"]: float(row["distance_km"]) for row in found}
    for building, position, site in (
        ("a", (37.80, -122.27), (37.8, -122.27)),
        ("c", (37.81, -122.26), (37.81, -122.25)),
        ("e", (37.9, -122.26), (37.81, -122.25)),
    ):
        building_angles, site_angles = np.radians(position), np.radians(site)
        half = np.sin((building_angles - site_angles) / 2.0) ** 2
        haversine = half[0] + math.cos(building_angles[0]) * math.cos(site_angles[0]) * half[1]
        assert distances[building] == pytest.approx(
            2 * 6371.0 * math.asin(math.sqrt(haversine)), rel=1e-4, abs=1e-6
        )
    skipped = json.loads(Path("far/summary.json").read_text())["not_used"]["buildings"]
    (reason,) = skipped["reasons"]
    assert (
        skipped["count"] == 1 and "buildings.csv:5:" in reason and "max_distance is 15 km" in reason
    )
    change("campaign.yaml", ("pairs: true", "pairs: true, max_distance: 900 m"))
    tdint("campaign", "campaign.yaml", "-o", "near", code=4)
    assert {row["building"] for row in rows("near/runs.csv")} == {
        name for name in distances if distances[name] <= 0.9
    }
    Path("campaign.yaml").write_text(CAMPAIGN)
    Path("buildings.csv").write_text(BUILDINGS.replace("37.805,-122.25", "37.805,"))
    result = tdint("campaign", "campaign.yaml", "-o", "lost", "-q", code=3)
    assert "buildings.csv:3:7: Longitude: is missing; motions at sites" in result.stderr
    assert rows("lost/runs.csv") == [row for row in first if row["building"] != "b"]


def test_a_row_of_a_field_needs_at_most_100_bytes_of_memory(working_directory: Path) -> None:
    """A row of a field needs at most 100 bytes of memory, for any number of rows, because its text
    is not kept."""
    write_record(working_directory / "firm.mseed", "HN1")

    def read(count: int) -> CampaignMotions:
        lines = (
            f"M{row % 400},s{row // 400},firm.mseed,{1.0 + 1e-3 * row:.4f}\n"
            for row in range(count)
        )
        Path("fields.csv").write_text("event,site,record,factor\n" + "".join(lines))
        return read_field(FieldFile("fields.csv", RecordChoice(units="m/s^2")))

    read(1)  # Allocate objects that are shared by all files.
    tracemalloc.start()
    count = 6_000
    found = read(count)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert isinstance(found.site_motions, FieldMotions) and peak < 100 * count + 1_000_000
    draws = replace(found.site_motions, site_of=np.arange(15)).draws(7)
    assert [draw.sample for draw in draws] == list(range(1, 401))
    assert [draw.scale for draw in draws] == pytest.approx(
        [1.0 + 1e-3 * (2800 + index) for index in range(400)]
    )


def test_a_plan_derives_no_building(region: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Only the shard that runs a building derives its model. Deriving all of a million buildings
    took most of the time of a shard before its first run."""
    made, make = list[int](), RowBuildings.make
    monkeypatch.setattr(
        RowBuildings, "make", lambda self, number: (made.append(number), make(self, number))[1]
    )
    campaign = load_campaign("campaign.yaml")
    plan = make_plan(campaign, read_inputs(campaign))
    # The first building represents the methods of all.
    assert plan.runs > 0 and plan.buildings_of([0]) and set(made) <= {0}


@pytest.mark.long
def test_a_shard_reports_its_own_skipped_buildings_and_the_merge_all_of_them(
    region: Path, tdint: Command
) -> None:
    """A shard reports the skipped buildings of its part, and the merged campaign reports all
    skipped buildings, also if very few files can be open at the same time. Ten of 30 buildings are
    at a site without an event."""
    rng, sites = (
        np.random.default_rng(7),
        [("west", -122.27, 37.8), ("east", -122.25, 37.81), ("none", -122.2, 37.85)],
    )
    lines = [
        f"b{i},{rng.integers(1, 4)},1968,C1,{1000 + i},{sites[i % 3][2]},{sites[i % 3][1]}"
        for i in range(30)
    ]
    lines[4] = lines[4].replace("1968", "soon")
    Path("buildings.csv").write_text(
        "\n".join([BUILDINGS.splitlines()[0].removesuffix(",site"), *lines, ""])
    )
    Path("sites.csv").write_text(
        "site,longitude,latitude\n" + "".join(f"{a},{b},{c}\n" for a, b, c in sites)
    )
    Path("campaign.yaml").write_text(CAMPAIGN + DAMAGE)
    tdint("campaign", "campaign.yaml", "-o", "whole", code=3)
    parts = [f"part-{k}" for k in range(1, 11)]
    for k, part in enumerate(parts, start=1):
        tdint("campaign", "campaign.yaml", "-o", part, "--shard", f"{k}/10", code=3)
        building_rows, run_rows = (tables(part)[name] for name in ("buildings", "run_rows"))
        assert {row[0] for row in run_rows} <= {row[0] for row in building_rows} and len(
            building_rows
        ) < 20
    before = resource.getrlimit(resource.RLIMIT_NOFILE)
    resource.setrlimit(
        resource.RLIMIT_NOFILE, (len(list(Path("/proc/self/fd").iterdir())) + 12, before[1])
    )
    try:
        tdint("campaign", "merge", *reversed(parts), "-o", "all", code=3)
    finally:
        resource.setrlimit(resource.RLIMIT_NOFILE, before)
    assert tables("all") == tables("whole") and len(tables("all")["buildings"]) == 29
    for file in Path("whole").glob("*.csv"):
        assert (Path("all") / file.name).read_bytes() == file.read_bytes()
    # A campaign of some merged shards can be completed.
    tdint("campaign", "merge", *parts[::3], "-o", "some", "--partial")
    assert len(tables("some")["buildings"]) < 29
    tdint("campaign", "campaign.yaml", "-o", "some", code=3)
    assert tables("some") == tables("whole")
    # The additional columns must be equal in all shards.
    change("buildings.csv", ("Longitude", "Longitude,note"))
    tdint("campaign", "campaign.yaml", "-o", "part-2", "--shard", "2/10")
    refused = tdint("campaign", "merge", *parts, "-o", "other", code=2)
    assert states(refused.stderr, "inventory ... damage ... differ")
    # A building that has moved to another site changes the fields, but the inventory is the cause.
    change("buildings.csv", (",1002,37.85,-122.2", ",1002,37.8,-122.27"))
    tdint("campaign", "campaign.yaml", "-o", "moved", "--shard", "2/10", code=3)
    refused = tdint("campaign", "merge", "part-1", "moved", "-o", "other", code=2)
    assert "inventory has changed" in refused.stderr


def tables(folder: str) -> dict[str, list[tuple[Any, ...]]]:
    """Return all tables of a store without times, files and the process that wrote it."""
    with closing(sqlite3.connect(Path(folder) / "campaign.sqlite")) as store:
        names = ("buildings", "records", "inventory", "building_types", "run_rows", "unused")
        found = {name: store.execute(f"SELECT * FROM {name}").fetchall() for name in names}
        found["chunks"] = store.execute("SELECT id, runs FROM chunks ORDER BY id").fetchall()
        found["meta"] = store.execute(
            "SELECT * FROM meta WHERE key NOT IN ('seal', 'shard_runs') ORDER BY key"
        ).fetchall()
    return found


def test_a_building_with_an_unknown_site_is_refused(region: Path, tdint: Command) -> None:
    change("campaign.yaml", (" sites: sites.csv,", ""))
    change("buildings.csv", ("-122.26,east", "-122.26,nowhere"))
    result = tdint("campaign", "campaign.yaml", "-o", "new", code=3)
    (line,) = result.stderr.splitlines()
    assert states(line, "buildings.csv:4:8: site: 'nowhere' ... fields.csv; ... west, east")


def test_rows_with_a_missing_record_are_skipped(region: Path, tdint: Command) -> None:
    """Rows with other records are run, and the exit code reports unreadable records."""
    change("fields.csv", ("M7-2,west,soft", "M7-2,west,none"))
    result = tdint("campaign", "campaign.yaml", "-o", "new", "-q", code=4)
    (line,) = [line for line in result.stderr.splitlines() if "none.mseed" in line]
    assert "fields.csv:4: none.mseed: " in line
    assert len(rows("new/runs.csv")) == 2 * (1 + 3 + 3)


@pytest.mark.usefixtures("losing")
def test_damage_of_each_event() -> None:
    """The damage of a type in an event is the mean of the probabilities and losses of its runs."""
    runs, types, losses = (rows(f"out/{name}.csv") for name in ("damage", "damage-types", "losses"))
    assert {row["event"] for row in types} == {"M7-1", "M7-2", "M6"}
    for row in types:
        column = f"probability_{row['state'].replace('-', '_')}"
        run_values = [
            float(run[column])
            for run in runs
            if (run["type"], run["event"]) == (row["type"], row["event"])
        ]
        assert int(row["runs"]) == len(run_values) > 0
        assert float(row["probability"]) == pytest.approx(
            sum(run_values) / len(run_values), abs=1e-11
        )
    for row in losses:
        if row["building"]:
            names = ("type", "event", "building")
            run_values = [
                float(run["loss_ratio"])
                for run in runs
                if all(run[name] == row[name] for name in names)
            ]
            assert float(row["loss_ratio"]) == pytest.approx(
                sum(run_values) / len(run_values), rel=1e-9
            )


def test_losses_are_sums_over_the_buildings(losing: Path, tdint: Command) -> None:
    """A loss is the sum of cost times number times mean loss ratio, computed by hand for each
    event, class and district. Its standard error follows from the sums under each ground motion;
    it is empty for events with one record."""
    found, runs = rows("out/losses.csv"), rows("out/damage.csv")
    value = {"a": 6e6, "b": 1.5e6, "c": 4e6}
    district = {"a": "north", "b": "south", "c": "north"}
    groups = 0
    for row in found:
        group_runs = [
            run
            for run in runs
            if run["event"] == row["event"]
            and row["building"] in ("", run["building"])
            and row["type"] in ("", run["type"])
            and row["District"] in ("", district[run["building"]])
        ]
        names = {run["building"] for run in group_runs}
        each = {
            name: [float(run["loss_ratio"]) for run in group_runs if run["building"] == name]
            for name in names
        }
        expected = sum(value[name] * sum(ratios) / len(ratios) for name, ratios in each.items())
        assert float(row["value"]) == pytest.approx(sum(value[name] for name in names), rel=1e-12)
        assert float(row["loss"]) == pytest.approx(expected, rel=1e-9)
        groups += not row["building"]
        if len({run["record"] for run in group_runs}) == 1:
            assert row["loss_error"] == ""
            continue
        # Jackknife of two ground motions: each partial loss ratio follows from a single motion.
        under = {record: [0.0, 0.0] for record in {run["record"] for run in group_runs}}
        for run in group_runs:
            share = value[run["building"]] / len(each[run["building"]])
            under[run["record"]][0] += share
            under[run["record"]][1] += share * float(run["loss_ratio"])
        first, second = (loss / worth for worth, loss in under.values())
        assert float(row["loss_error"]) == pytest.approx(
            0.5 * float(row["value"]) * abs(first - second), rel=1e-7
        )
    # Groups by event (3), type (8), district (6), and buildings (8)
    assert groups == 3 + 8 + 6 and len(found) == groups + 8
    again = tdint("campaign", "campaign.yaml", "-o", "out", "--by", "county", code=2)
    assert states(again.stderr, "--by county: ... not found ... available")
    change("buildings.csv", ("1.5e6", "much"))
    wrong = tdint("campaign", "campaign.yaml", "-o", "new", code=3)
    assert states(wrong.stderr, "buildings.csv:3:9: cost: ... got 'much'")
    change("buildings.csv", ("much,1,", "1.5e6,,"))
    missing = tdint("campaign", "campaign.yaml", "-o", "new", code=3)
    assert states(missing.stderr, "buildings.csv:3:10: number: is missing; give zero or a positive")


def test_only_selected_tables_are_written(losing: Path, tdint: Command) -> None:
    """Selected tables equal the same tables of a complete output, and other tables are not written.
    Another selection does not repeat runs."""
    campaign = Path("campaign.yaml").read_text()
    call = ("campaign", "campaign.yaml", "-o", "new", "--by", "District")
    Path("campaign.yaml").write_text(campaign + "outputs: [losses]\n")
    tdint(*call, code=0)
    assert sorted(file.name for file in Path("new").glob("[a-z]*.*")) == [
        "campaign.sqlite", "exceedance.csv", "losses.csv", "summary.json",
    ]  # fmt: skip
    Path("campaign.yaml").write_text(campaign + "outputs: [runs, damage]\n")
    assert "nothing to do" in tdint(*call, code=0).stderr
    for name in ("runs", "damage", "damage-types", "losses"):
        assert Path(f"new/{name}.csv").read_bytes() == Path(f"out/{name}.csv").read_bytes()
    Path("campaign.yaml").write_text(campaign + "outputs: [runs, cost]\n")
    tdint.refused("campaign.yaml:4:17: outputs[2]: unknown table 'cost'", *call, code=3)


def test_pairs_of_files_with_one_component_each(region: Path, tdint: Command) -> None:
    """The second component is found by its file name as in `records: files`
    (tests/ground_motion/test_horizontals.py tests the names), or is specified in a column. The
    results equal the results with the same files in `files`."""
    files = ("NZ.WTMC.20.HNE.mseed", "NZ.WTMC.20.HNN.mseed", "one.mseed", "two.mseed")
    for peak, name in enumerate((*files, "NZ.WTMC.20.HNZ.mseed"), start=1):
        channel = {"one.mseed": "HN1", "two.mseed": "HN2"}.get(name, name[11:14])
        write_record(Path(name), channel, samples=300, peak=float(peak))
    Path("fields.csv").write_text(
        "event,site,record,record_2\nM7,east,one.mseed,two.mseed\nM6,west,NZ.WTMC.20.HNN.mseed,\n"
    )
    tdint("campaign", "campaign.yaml", "-o", "new", code=0)
    runs = {(row["building"], row["record"], row["component"]): row for row in rows("new/runs.csv")}
    # Building a is at the site west, b and c are at east.
    assert len(runs) == 6 and {name for _, name, _ in runs} == set(files)
    study = CAMPAIGN.replace("fields: fields.csv, sites: sites.csv", f"files: [{', '.join(files)}]")
    Path("plain.yaml").write_text(study.replace(", pairs: true", ""))
    tdint("campaign", "plain.yaml", "-o", "plain", code=0)
    plain = {
        (row["building"], row["record"], row["component"]): row for row in rows("plain/runs.csv")
    }
    for key, row in runs.items():
        assert row["peak_drift_ratio"] == plain[key]["peak_drift_ratio"]
    Path("NZ.WTMC.20.HNE.mseed").unlink()
    messages = tdint("campaign", "campaign.yaml", "-o", "again", code=4).stderr
    assert (
        "fields.csv:3: NZ.WTMC.20.HNN.mseed+" in messages
        and "has only one horizontal component" in messages
    )
    change("campaign.yaml", (", pairs: true", ""))
    tdint.refused(
        "fields.csv:1: ... record_2 ... pairs", "campaign campaign.yaml -o single", code=3
    )


def test_annual_exceedance_rates_of_losses(losing: Path, tdint: Command) -> None:
    """The annual rate of exceedance of a loss is the sum of the rates of all events with at least
    this loss. The average annual loss is the sum of rate times loss."""
    rates, found = {"M7-1": 0.002, "M7-2": 0.004, "M6": 0.05}, rows("out/exceedance.csv")
    losses = [row for row in rows("out/losses.csv") if not row["type"]]
    districts = {"a": "north", "b": "south", "c": "north"}
    worth = {(row["District"], row["event"]): float(row["value"]) for row in losses}
    for part in ("", "north", "south"):
        event_losses = {
            row["event"]: float(row["loss"]) for row in losses if row["District"] == part
        }
        group_rows = [row for row in found if row["District"] == part]
        assert [row["event"] for row in group_rows] == sorted(
            event_losses, key=lambda event: -event_losses[event]
        )
        for row in group_rows:
            as_large = [
                event for event in event_losses if event_losses[event] >= event_losses[row["event"]]
            ]
            assert float(row["exceedance_rate"]) == pytest.approx(
                sum(rates[event] for event in as_large), rel=1e-10
            )
        annual = sum(rates[event] * event_losses[event] for event in event_losses)
        assert sum(float(row["annual_loss"]) for row in group_rows) == pytest.approx(
            annual, rel=1e-10
        )
        assert float(group_rows[-1]["cumulative_annual_loss"]) == pytest.approx(annual, rel=1e-10)
        # The scatter of each event follows from its buildings, independent or fully correlated.
        for row in group_rows:
            building_rows = [
                building_row
                for building_row in rows("out/losses.csv")
                if building_row["building"]
                and building_row["event"] == row["event"]
                and part in ("", districts[building_row["building"]])
            ]
            spread = [
                float(building_row["value"]) * float(building_row["loss_ratio_sd"])
                for building_row in building_rows
            ]
            numbers = [
                float({"a": 3, "b": 1, "c": 10}[building_row["building"]])
                for building_row in building_rows
            ]
            independent_sd = math.sqrt(
                sum(sd**2 / number for sd, number in zip(spread, numbers, strict=True))
            )
            assert float(row["loss_sd_independent"]) == pytest.approx(independent_sd, rel=1e-9)
            assert float(row["loss_sd_correlated"]) == pytest.approx(sum(spread), rel=1e-9)
        # Rates of exceedance with beta distributions of the losses
        for name in ("independent", "correlated"):
            for row in group_rows:
                rate, loss = 0.0, float(row["loss"])
                for other in group_rows:
                    cost = worth[part, other["event"]]
                    mean, sd = float(other["loss"]) / cost, float(other[f"loss_sd_{name}"]) / cost
                    k = mean * (1.0 - mean) / sd**2 - 1.0
                    rate += float(other["rate"]) * float(
                        beta.sf(loss / cost, mean * k, (1.0 - mean) * k)
                    )
                assert float(row[f"exceedance_rate_{name}"]) == pytest.approx(rate, rel=1e-6)
    Path("rates.csv").write_text("event,rate\nM7-1,0.002\n")
    message = "rates.csv: 2 events of the fields have no rate in this file, such as 'M7-2'"
    tdint.refused(message, "campaign", "campaign.yaml", "-o", "new", code=3)


@pytest.mark.parametrize("demand", ["larger", "mean", "separate"])
def test_the_annual_loss_for_each_rule_of_pairs(losing: Path, tdint: Command, demand: str) -> None:
    """Losses computed from the drift ratios of the runs agree with losses, exceedance rates, damage
    by type and the map, for each rule for component pairs."""
    tdint("campaign", "export", "out", "--geojson", "--pair-demand", demand, code=0)
    types = json.loads(Path("out/summary.json").read_text())["damage"]["types"]
    worth = {"a": 2e6 * 3, "b": 1.5e6, "c": 4e5 * 10}
    rates = {"1": 0.002, "2": 0.004, "3": 0.05}

    def loss(building_type: str, drift: float) -> float:
        states = types[building_type]
        exceeded = [
            float(norm.cdf(math.log(drift / median) / states["dispersion"]))
            for median in states["medians"]
        ]
        steps = np.diff([0.0, *states["losses"][: len(exceeded)]])
        return float(np.dot(exceeded, steps))

    # The demands of both components of each pair, by building and event; a collapse has a demand
    # larger than all thresholds.
    pairs: dict[tuple[str, str, str], list[float]] = {}
    for run in rows("out/damage.csv"):
        key = run["building"], run["type"], run["sample"]
        demand_column = list(run)[list(run).index("status") + 1]
        drift = float(run[demand_column]) if run["status"] == "done" else 1e9
        pairs.setdefault(key, []).append(drift)
    assert all(len(drifts) == 2 for drifts in pairs.values())
    assert any(max(drifts) < 1e9 and drifts[0] != drifts[1] for drifts in pairs.values())
    by_hand = {
        (building, event): {
            "larger": loss(building_type, max(drifts)),
            "mean": loss(building_type, sum(drifts) / 2.0),
            "separate": sum(loss(building_type, drift) for drift in drifts) / 2.0,
        }[demand]
        for (building, building_type, event), drifts in pairs.items()
    }
    annual = sum(rates[event] * worth[name] * value for (name, event), value in by_hand.items())
    # The export keeps the districts of the campaign; the rows of all buildings have none.
    exceedance = [row for row in rows("out/exceedance.csv") if not row["District"]]
    assert sum(float(row["annual_loss"]) for row in exceedance) == pytest.approx(annual, rel=1e-9)
    names = {"1": "M7-1", "2": "M7-2", "3": "M6"}
    losses = {(row["building"], row["event"]): row for row in rows("out/losses.csv")}
    features = [
        feature["properties"]
        for feature in json.loads(Path("out/buildings.geojson").read_text())["features"]
    ]
    on_map = {
        (feature_properties["building"], feature_properties["event"]): feature_properties
        for feature_properties in features
    }
    for (building, event), value in by_hand.items():
        row, feature = losses[building, names[event]], on_map[building, names[event]]
        assert float(row["loss_ratio"]) == pytest.approx(value, rel=1e-9)
        assert feature["loss_ratio"] == pytest.approx(value, rel=1e-9)
        assert row["pair_demand"] == feature["pair_demand"] == demand
        assert int(row["runs"]) == (2 if demand == "separate" else 1)
        annual_losses = {
            number: rates[number] * worth[name] * ratio
            for (name, number), ratio in by_hand.items()
            if name == building
        }
        assert (feature["value"], feature["loss"], feature["annual_loss"]) == pytest.approx(
            (worth[building], worth[building] * value, annual_losses[event]), rel=1e-9
        )
        assert feature["average_annual_loss"] == pytest.approx(
            sum(annual_losses.values()), rel=1e-9
        )
    for table in (exceedance, rows("out/damage-types.csv"), rows("out/losses.csv")):
        assert {row["pair_demand"] for row in table} == {demand}


def districts() -> list[dict[str, Any]]:
    return json.loads(Path("out/districts.geojson").read_text())["features"]


POLYGON = {"type": "Polygon", "coordinates": [[[0, 0], [1, 0], [1, 1], [0, 0]]]}


def polygons(*names: str) -> str:
    """Return GeoJSON text with the same triangle for each name."""
    features = [
        {"type": "Feature", "properties": {"DISTRICT": name}, "geometry": POLYGON} for name in names
    ]
    return json.dumps({"type": "FeatureCollection", "features": features})


def test_losses_of_districts_on_a_map(losing: Path, tdint: Command) -> None:
    """A district has the rows of losses.csv and exceedance.csv, at the points of its buildings or
    as its polygon. Its average annual loss is the sum over its buildings and all events, also in
    the map of a single event."""
    tdint("campaign", "export", "out", "--geojson", "--by", "District", code=0)
    losses = {
        (row["District"], row["event"]): row for row in rows("out/losses.csv") if row["District"]
    }
    annual: dict[str, float] = {}
    for row in rows("out/exceedance.csv"):
        annual[row["District"]] = annual.get(row["District"], 0.0) + float(row["annual_loss"])
    found = districts()
    assert {
        (properties["properties"]["District"], properties["properties"]["event"])
        for properties in found
    } == set(losses)
    for feature in found:
        properties = feature["properties"]
        row = losses[properties["District"], properties["event"]]
        for name in ("value", "loss", "loss_ratio", "buildings", "runs"):
            assert properties[name] == pytest.approx(float(row[name]), rel=1e-11)
        assert properties["average_annual_loss"] == pytest.approx(
            annual[properties["District"]], rel=1e-9
        )
        assert feature["geometry"]["type"] == "MultiPoint"
    (north,) = (
        properties["geometry"]["coordinates"]
        for properties in found
        if (properties["properties"]["District"], properties["properties"]["event"])
        == ("north", "M6")
    )
    assert north == [[-122.27, 37.8], [-122.26, 37.81]]
    buildings = json.loads(Path("out/buildings.geojson").read_text())["features"]
    by_building = {
        properties["properties"]["building"]: properties["properties"]["average_annual_loss"]
        for properties in buildings
    }
    assert annual["north"] == pytest.approx(by_building["a"] + by_building["c"], rel=1e-9)
    assert annual[""] == pytest.approx(sum(by_building.values()), rel=1e-9)
    # One event, and polygons.
    Path("shapes.geojson").write_text(polygons("north", "south", "west"))
    options = ("--by", "district", "--event", "M6", "--polygons", "shapes.geojson")
    tdint("campaign", "export", "out", "--geojson", *options, code=0)
    selected = districts()
    assert [properties["geometry"] for properties in selected] == [POLYGON, POLYGON]
    expected = [
        properties["properties"]
        for properties in found
        if properties["properties"]["event"] == "M6"
    ]
    assert [
        {name.lower(): cell for name, cell in properties["properties"].items()}
        for properties in selected
    ] == [{name.lower(): cell for name, cell in properties.items()} for properties in expected]
    remaining = json.loads(Path("out/buildings.geojson").read_text())["features"]
    assert remaining == [
        properties for properties in buildings if properties["properties"]["event"] == "M6"
    ]
    assert 'shapes.geojson"' in Path("out/summary.json").read_text()
    # An export keeps the districts of the campaign, and their map.
    tdint("campaign", "export", "out", code=0)
    assert Path("out/districts.geojson").exists()


@pytest.mark.parametrize(
    ("arguments", "shapes", "message"),
    [
        (("--by", "quarter"), "", "--by quarter: column not found in the inventory"),
        (("--event", "M9"), "",
         "--event M9: out/campaign.sqlite has no such event; it has M7-1, M7-2, M6"),
        (("--polygons", "s.json"), "{}", "--polygons requires --by COLUMN"),
        (("--by", "district", "--polygons", "s.json"), polygons("north"),
         "s.json: no polygon of district south"),
        (("--by", "district", "--polygons", "s.json"), polygons("north", "south", "north"),
         "s.json: two polygons have the district 'north'"),
        (("--by", "district", "--polygons", "s.json"),
         polygons("north", "south").replace("Polygon", "Point"),
         "s.json: ... 'north' ... MultiPolygon"),
        (("--by", "district", "--polygons", "s.json"), "[1]",
         "s.json: cannot be read; --polygons is a GeoJSON file"),
    ],
)  # fmt: skip
def test_invalid_maps_of_districts_are_refused(
    losing: Path, tdint: Command, arguments: tuple[str, ...], shapes: str, message: str
) -> None:
    Path("s.json").write_text(shapes)
    result = tdint.refused(message, "campaign", "export", "out", "--geojson", *arguments)
    assert result.stderr.count("\n") == 1
