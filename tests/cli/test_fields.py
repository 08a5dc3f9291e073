"""Ground motion fields: what each event does at each site, as OpenQuake and SimCenter name things."""

from __future__ import annotations

import csv
import json
import math
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from click.testing import Result

Run = Callable[..., Result]

CAMPAIGN = """\
buildings: {inventory: buildings.csv, units: {length: ft}}
records: {fields: fields.csv, sites: sites.csv, units: m/s^2, pairs: true}
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


@pytest.fixture
def region(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """campaign.yaml with three buildings at two sites, three events of which one leaves a site out, two records."""
    monkeypatch.chdir(tmp_path)
    records = Path(__file__).parents[2] / "records"
    for file in ("firm", "soft"):
        Path(f"{file}.mseed").write_bytes((records / f"{file}-soil.mseed").read_bytes())
    files = {"campaign.yaml": CAMPAIGN, "buildings.csv": BUILDINGS, "fields.csv": FIELDS, "sites.csv": SITES}
    for name, text in files.items():
        Path(name).write_text(text)
    return tmp_path


def rows(file: str) -> list[dict[str, str]]:
    with Path(file).open(newline="") as lines:
        return list(csv.DictReader(lines))


def outcome(row: dict[str, str], *, but: tuple[str, ...] = ("sample", "event", "site")) -> dict[str, str]:
    return {name: text for name, text in row.items() if name not in but}


def test_runs_are_those_listed_by_hand(region: Path, tdint: Run) -> None:
    """Each row of the table is a campaign of its own with that record and factor, to the last digit."""
    assert tdint("campaign", "campaign.yaml", "-o", "out").exit_code == 0
    found = rows("out/runs.csv")
    assert len(found) == 2 * (2 + 3 + 3)  # components; events at the sites of a, b, c
    sites, numbers = {"a": "west", "b": "east", "c": "east"}, {"M7-1": "1", "M7-2": "2", "M6": "3"}
    by_hand = []
    for place, row in enumerate(rows("fields.csv")):
        factor = row["factor"] or "1"
        Path("one.yaml").write_text(
            CAMPAIGN.replace("fields: fields.csv, sites: sites.csv", f"files: [{row['record']}]")
            + f"intensity: {{scales: [{factor}]}}\n"
        )
        assert tdint("campaign", "one.yaml", "-o", f"one-{place}").exit_code == 0
        by_hand += [
            one | {"event": row["event"], "sample": numbers[row["event"]]}
            for one in rows(f"one-{place}/runs.csv")
            if sites[one["building"]] == row["site"]
        ]
    key = ["building", "record", "component", "scale", "sample"]
    in_order = sorted(found, key=lambda row: [row[name] for name in key])
    assert in_order == sorted(
        ({name: row[name] for name in found[0]} for row in by_hand), key=lambda row: [row[name] for name in key]
    )


def test_the_site_is_the_nearest_or_named(region: Path, tdint: Run) -> None:
    """With a column `site` no places are needed; without sites in the table all buildings have all events."""
    assert tdint("campaign", "campaign.yaml", "-o", "out").exit_code == 0
    Path("campaign.yaml").write_text(CAMPAIGN.replace(" sites: sites.csv,", ""))
    assert tdint("campaign", "campaign.yaml", "-o", "named").exit_code == 0
    assert Path("named/runs.csv").read_bytes() == Path("out/runs.csv").read_bytes()
    Path("fields.csv").write_text("event,record\nA,firm.mseed\nB,soft.mseed\n")
    assert tdint("campaign", "campaign.yaml", "-o", "all").exit_code == 0
    assert [(row["building"], row["event"]) for row in rows("all/runs.csv")[::2]] == [
        (name, event) for name in "abc" for event in "AB"
    ]


def test_distances_in_degrees_are_not_those_on_the_earth(region: Path, tdint: Run) -> None:
    """At 60 degrees north a degree of longitude is half a degree of latitude: the nearest site changes."""
    Path("buildings.csv").write_text(BUILDINGS.splitlines()[0] + "\na,1,1968,W1,1500,60,10,\n")
    Path("sites.csv").write_text("site,longitude,latitude\nwest,10.15,60\neast,10,60.1\n")
    Path("fields.csv").write_text("event,site,record\n1,west,firm.mseed\n1,east,soft.mseed\n")
    for option, record in (("", "firm"), (", distance: km", "firm"), (", distance: degrees", "soft")):
        Path("campaign.yaml").write_text(CAMPAIGN.replace("pairs: true", f"pairs: true{option}"))
        assert tdint("campaign", "campaign.yaml", "-o", "out", "--overwrite").exit_code == 0
        assert {row["record"] for row in rows("out/runs.csv")} == {f"{record}.mseed"}


def test_tables_of_openquake(region: Path, tdint: Run) -> None:
    """Their names of the columns, and the line above the header."""
    assert tdint("campaign", "campaign.yaml", "-o", "out").exit_code == 0
    above = "#,,,\"generated_by='OpenQuake engine 3.26.2', start_date='2026-01-01T00:00:00'\"\n"
    Path("fields.csv").write_text(above + FIELDS.replace("event,site", "event_id,site_id"))
    Path("sites.csv").write_text(above + SITES.replace("site,longitude,latitude", "site_id,lon,lat"))
    assert tdint("campaign", "campaign.yaml", "-o", "theirs").exit_code == 0
    assert Path("theirs/runs.csv").read_bytes() == Path("out/runs.csv").read_bytes()


@pytest.mark.parametrize(("column", "measure", "unit"), [("gmv_PGA", "pga", "g"), ("gmv_SA(0.6)", "sa", "g"),
                                                         ("gmv_PGV", "pgv", "m/s")])  # fmt: skip
def test_intensities_of_openquake(region: Path, tdint: Run, column: str, measure: str, unit: str) -> None:
    """A record has the value of its row: what levels of the measure do, to the last digit."""
    value = "0.31" if unit == "g" else "31"
    Path("fields.csv").write_text(f"event_id,site_id,{column},record\n0,west,{value},firm.mseed\n")
    Path("sites.csv").write_text("site_id,lon,lat\nwest,-122.27,37.8\n")
    assert tdint("campaign", "campaign.yaml", "-o", "out").exit_code == 0
    period = ", period: 0.6" if measure == "sa" else ""
    Path("campaign.yaml").write_text(
        CAMPAIGN.replace("fields: fields.csv, sites: sites.csv", "files: [firm.mseed]")
        + f"intensity: {{measure: {measure}{period}, levels: [0.31 {unit}]}}\n"
    )
    assert tdint("campaign", "campaign.yaml", "-o", "levels").exit_code == 0
    assert [outcome(row) for row in rows("out/runs.csv")] == [outcome(row) for row in rows("levels/runs.csv")]


def test_rows_of_simcenters_files_are_events(region: Path, tdint: Run) -> None:
    """`events` of a grid: the k-th row of each point's file is event k, and buildings have those of the nearest point;
    the runs are those of a table of fields that says the same."""
    random = np.random.default_rng(5)
    for name in ("m1", "m2", "m3"):
        data = {key: (0.1 * random.standard_normal(300)).tolist() for key in ("data_x", "data_y")}
        Path(f"{name}.json").write_text(json.dumps({"name": name, "dT": 0.01, **data}))
    Path("EventGrid.csv").write_text("GP_file,Longitude,Latitude\np1.csv,-122.27,37.8\np2.csv,-122.25,37.81\n")
    Path("p1.csv").write_text("TH_file,factor\nm1,1\nm2,0.5\n")
    Path("p2.csv").write_text("TH_file,factor\nm3,2\nm1,1.5\n")
    buildings = CAMPAIGN.splitlines()[0]
    Path("campaign.yaml").write_text(f"{buildings}\nrecords: {{grid: EventGrid.csv, units: g, events: true}}\n")
    assert tdint("campaign", "campaign.yaml", "-o", "out").exit_code == 0
    Path("fields.csv").write_text(
        "event,site,record,factor\n1,west,m1.json,1\n2,west,m2.json,.5\n1,east,m3.json,2\n2,east,m1.json,1.5\n"
    )
    Path("campaign.yaml").write_text(CAMPAIGN.replace("m/s^2", "g"))
    assert tdint("campaign", "campaign.yaml", "-o", "fields").exit_code == 0
    key = ["building", "event", "component"]
    both = [sorted(rows(f"{out}/runs.csv"), key=lambda row: [row[name] for name in key]) for out in ("out", "fields")]
    assert [outcome(row, but=("record",)) for row in both[0]] == [outcome(row, but=("record",)) for row in both[1]]
    Path("p2.csv").write_text("TH_file\nm3\n")
    Path("campaign.yaml").write_text(f"{buildings}\nrecords: {{grid: EventGrid.csv, units: g, events: true}}\n")
    result = tdint("campaign", "campaign.yaml", "-o", "other")
    assert result.exit_code == 3 and "p2.csv: 1 motions, where p1.csv has 2" in result.stderr


def test_a_map_and_damage_of_each_event(region: Path, tdint: Run) -> None:
    with Path("campaign.yaml").open("a") as stream:
        stream.write("damage: {thresholds: {slight: 0.4%}, dispersion: 0.3}\n")
    assert tdint("campaign", "campaign.yaml", "-o", "out").exit_code == 0
    assert tdint("campaign", "export", "out", "--geojson").exit_code == 0
    features = [one["properties"] for one in json.loads(Path("out/buildings.geojson").read_text())["features"]]
    table, damage = rows("out/runs.csv"), rows("out/damage.csv")
    assert [(one["building"], one["event"], one["runs"]) for one in features] == [
        (name, event, 1) for name in "abc" for event in ("M7-1", "M7-2", "M6") if (name, event) != ("a", "M6")
    ]
    for one in features:
        mine = [
            place
            for place, row in enumerate(table)
            if (row["building"], row["event"]) == (one["building"], one["event"])
        ]
        assert len(mine) == 2 and all(damage[place]["event"] == one["event"] for place in mine)
        slight = [float(damage[place]["probability_slight"]) for place in mine]
        assert one["probability_slight"] == pytest.approx(sum(slight) / 2, rel=1e-10, abs=1e-12)
        drifts = [float(table[place]["peak_drift_ratio"]) for place in mine if table[place]["status"] == "done"]
        if len(drifts) == 2:
            assert math.isclose(one["max_peak_drift_ratio"], max(drifts), rel_tol=1e-11)


@pytest.mark.parametrize(
    ("file", "change", "code", "message"),
    [
        ("fields.csv", ("M7-2,east", "M7-2,north"), 3, "fields.csv:5: site 'north' is not in sites.csv"),
        ("fields.csv", ("M7-2,east", "M7-1,east"), 3,
         "fields.csv:5: event 'M7-1' at site 'east' is already on line 3; give each event one record at a site"),
        ("fields.csv", ("-1.25", "0"), 3, "fields.csv:3: factor must not be zero, got '0'"),
        ("fields.csv", ("-1.25", "x"), 3, "fields.csv:3: factor must be a number, got 'x'"),
        ("fields.csv", ("M7-2,west", ",west"), 3, "fields.csv:4: event is missing"),
        ("fields.csv", ("event,", "quake,"), 3, "fields.csv:1: no column event"),
        ("fields.csv", ("record,factor", "record,gmv_PGA"), 3, "fields.csv:5: gmv_pga is missing"),
        ("fields.csv", (FIELDS, "event,record,gmv_SA(0.6)\n1,firm.mseed,-1\n"), 3, "fields.csv:1: no column site"),
        ("fields.csv", (FIELDS, "event,site,record,gmv_SA(0.6)\n1,east,firm.mseed,-1\n"), 3,
         "fields.csv:2: gmv_sa(0.6) must be a positive number, got '-1'"),
        ("fields.csv", (FIELDS, "event,site,record,gmv_SA(1e-5)\n1,east,firm.mseed,1\n"), 3, "gmv_SA(period)"),
        ("fields.csv", (FIELDS, "event,site,record,gmv_SA(.0001)\n1,east,firm.mseed,1\n"), 4, "fields.csv:2: "),
        ("fields.csv", ("record,factor", "record,gmv_MMI"), 3, "fields.csv:1: gmv_mmi: leave the one"),
        ("sites.csv", ("37.81", "97.81"), 3, "sites.csv:3: latitude must be from -90 to 90 degrees, got '97.81'"),
        ("sites.csv", ("east", "west"), 3, "sites.csv:3: site 'west' is there twice"),
        (
            "buildings.csv",
            ("37.805,-122.25", "37.805,"),
            3,
            "buildings.csv:3:7: Longitude: is missing; motions at places need that of each building",
        ),
        ("buildings.csv", ("Latitude,Longitude", "north,east"), 3, "buildings.csv:1: no column Latitude"),
        ("fields.csv", ("event,site", "event,place"), 3, "fields.csv:1: no column site"),
        ("campaign.yaml", ("sites: sites.csv", "distance: degrees"), 3, "has nothing to act on without `sites`"),
        ("campaign.yaml", ("sites: sites.csv", "files: [firm.mseed]"), 3, "has no part in `fields`"),
        ("campaign.yaml", ("pairs: true}", "pairs: true}\nintensity: {measure: pga, levels: [1 g]}"), 3,
         "has no part in events, whose factors are given; `scales` multiply them"),
    ],
)  # fmt: skip
def test_faults(region: Path, tdint: Run, file: str, change: tuple[str, str], code: int, message: str) -> None:
    """One line, with the file and the line in it, and nothing written."""
    text = Path(file).read_text()
    assert change[0] in text
    Path(file).write_text(text.replace(*change, 1))
    result = tdint("campaign", "campaign.yaml", "-o", "out")
    assert result.exit_code == code and message in result.stderr and result.stderr.count("\n") == 1
    assert not Path("out/runs.csv").exists()


def test_a_building_that_names_no_site(region: Path, tdint: Run) -> None:
    Path("campaign.yaml").write_text(CAMPAIGN.replace(" sites: sites.csv,", ""))
    Path("buildings.csv").write_text(BUILDINGS.replace("-122.26,east", "-122.26,nowhere"))
    result = tdint("campaign", "campaign.yaml", "-o", "out")
    assert result.exit_code == 3
    assert result.stderr == ("Error: buildings.csv:4:8: site: 'nowhere' is not in fields.csv; known: west, east\n")


def test_a_record_that_is_missing_leaves_its_rows_out(region: Path, tdint: Run) -> None:
    """The others are done, and the exit code is that of records that could not be read."""
    Path("fields.csv").write_text(FIELDS.replace("M7-2,west,soft", "M7-2,west,none"))
    result = tdint("campaign", "campaign.yaml", "-o", "out", "-q")
    assert result.exit_code == 4
    (line,) = [line for line in result.stderr.splitlines() if "none.mseed" in line]
    assert "fields.csv:4: none.mseed: " in line
    assert len(rows("out/runs.csv")) == 2 * (1 + 3 + 3)


def test_damage_of_each_event(region: Path, tdint: Run) -> None:
    """Of each type in each event the mean of its runs' probabilities and losses, told once with the event's name."""
    damage = "damage: {thresholds: hazus, losses: {slight: 5%, moderate: 20%, extensive: 60%, complete: 1}}\n"
    Path("campaign.yaml").write_text(CAMPAIGN + damage)
    assert tdint("campaign", "campaign.yaml", "-o", "out").exit_code == 0
    runs, types, losses = (rows(f"out/{name}.csv") for name in ("damage", "damage-types", "losses"))
    assert {row["event"] for row in types} == {"M7-1", "M7-2", "M6"}
    for row in types:
        column = f"probability_{row['state'].replace('-', '_')}"
        told = [float(run[column]) for run in runs if (run["type"], run["event"]) == (row["type"], row["event"])]
        assert int(row["runs"]) == len(told) > 0
        assert float(row["probability"]) == pytest.approx(sum(told) / len(told), abs=1e-11)
    for row in losses:
        names = ("type", "event", *(("building",) if row["building"] else ()))
        told = [float(run["loss_ratio"]) for run in runs if all(run[name] == row[name] for name in names)]
        assert float(row["loss_ratio"]) == pytest.approx(sum(told) / len(told), rel=1e-9)
