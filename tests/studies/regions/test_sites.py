"""Ground motions at sites: grids of points in SimCenter's format, and fields of events.

tests/cli/test_fields.py compares the runs of campaigns with fields with separate runs.
"""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from facts import states
from tdint.errors import ModelError, RecordError
from tdint.ground_motion.choice import RecordChoice
from tdint.ground_motion.horizontals import Horizontals
from tdint.studies.campaign.assigned_motions import FieldFile, FieldMotions, GridFile, GridMotions
from tdint.studies.regions.sites import read_field, read_grid
from tdint.units import STANDARD_GRAVITY

MOTION = [0.0, 0.1, -0.2, 0.05]
POINTS = "GP_file,Longitude,Latitude\nsite0.csv,-122.5,37.5\nsite1.csv,237.75,38\n"
FILES = {
    "grid.csv": POINTS,
    "site0.csv": "TH_file,factor\npair,2\nsingle,\n",
    "site1.csv": "TH_file,factor\nsingle,-0.5\nmissing,3\n",
    "pair.json": json.dumps({"name": "pair", "dT": 0.02, "data_x": MOTION, "data_y": MOTION[::-1]}),
    "single.json": json.dumps({"name": "single", "dT": 0.01, "data_x": MOTION}),
}


@pytest.fixture
def region(tmp_path):
    """Write two points, a pair and a single component, and return the directory."""
    for name, text in FILES.items():
        (tmp_path / name).write_text(text)
    return tmp_path


def grid(region, **settings):
    return read_grid(GridFile(str(region / "grid.csv"), "g", 2, 4, 7, **settings))


def test_motions_of_a_grid_are_read_once_in_its_units(region):
    found = grid(region)
    assert [(motion.name, motion.component) for motion in found.motions] == [
        ("pair", "x"), ("pair", "y"), ("single", "x")
    ]  # fmt: skip
    first, second, single = (motion.record for motion in found.motions)
    np.testing.assert_allclose(first.acceleration, STANDARD_GRAVITY * np.array(MOTION))
    np.testing.assert_array_equal(second.acceleration, first.acceleration[::-1])
    assert (first.dt, single.dt) == (0.02, 0.01)
    assert isinstance(found.motions[0].ground_motion, Horizontals)
    assert not isinstance(found.motions[2].ground_motion, Horizontals)


def test_points_of_a_grid_have_the_numbers_and_factors_of_their_motions(region):
    found = grid(region)
    assert isinstance(found.site_motions, GridMotions)
    # The motion that cannot be read is a failure, and no motion of its point.
    assert found.site_motions.motions == ((((0, 1), 2.0), ((2,), 1.0)), (((2,), -0.5),))
    assert found.site_motions.locations == [(-122.5, 37.5), (237.75, 38.0)]
    assert len(found.failures) == 1 and "missing.json" in str(found.failures[0])


def test_a_point_without_readable_motions_is_omitted(region):
    (region / "site0.csv").write_text("TH_file\nmissing\n")
    found = grid(region)
    assert found.site_motions.locations == [(237.75, 38.0)]
    assert found.site_motions.motions == ((((0,), -0.5),),)
    (region / "site1.csv").write_text("TH_file\nother\n")
    with pytest.raises(RecordError, match=r"(?s)missing\.json.*other\.json"):
        grid(region)


def test_rows_of_points_are_events(region):
    found = grid(region, events=True).site_motions
    assert isinstance(found, FieldMotions) and found.events == ("1", "2")
    draws = replace(found, site_of=np.array([0, 1])).draws(0)
    assert [(draw.motion, draw.scale, draw.sample) for draw in draws] == [
        (0, 2.0, 1), (1, 2.0, 1), (2, 1.0, 2)
    ]  # fmt: skip
    # The second event of the second site has a motion that cannot be read.
    draws = replace(found, site_of=np.array([0, 1])).draws(1)
    assert [(draw.motion, draw.scale, draw.sample) for draw in draws] == [(2, -0.5, 1)]
    (region / "site1.csv").write_text("TH_file\nsingle\n")
    with pytest.raises(ModelError, match=r"site1\.csv: .* 1 motions, but site0\.csv lists 2"):
        grid(region, events=True)


@pytest.mark.parametrize(
    ("file", "text", "error", "message"),
    [
        (
            "grid.csv",
            POINTS.replace("37.5", "97.5"),
            ModelError,
            "grid.csv:2: Latitude ... -90 ... 90 ... 97.5",
        ),
        ("grid.csv", POINTS.replace("Latitude", "North"), ModelError, "grid.csv:1: ... Latitude"),
        ("site1.csv", "TH_file,factor\nsingle,0\n", ModelError, "site1.csv:2: factor ... zero"),
        ("single.json", '{"dT": 1}', RecordError, "single.json: ... dT ... data_x"),
        ("single.json", '{"dT": 0, "data_x": [1]}', RecordError, "single.json: dT ... 0.0"),
        (
            "single.json",
            '{"dT": 0.1, "data_x": [null]}',
            RecordError,
            "single.json: data_x ... numbers",
        ),
        (
            "single.json",
            '{"dT": 0.1, "data_x": [1, 2], "data_y": [1, 2, 3]}',
            RecordError,
            "single.json: ... data_y ... 2 and 3",
        ),
        ("single.json", '{"dT": 0.1,', RecordError, "single.json: not JSON"),
    ],
)
def test_unusable_grids_are_refused_with_file_and_line(region, file, text, error, message):
    (region / file).write_text(text)
    if error is RecordError:  # no other motion: the failure is the error
        for site in ("site0.csv", "site1.csv"):
            (region / site).write_text("TH_file\nsingle\n")
    with pytest.raises(error) as refusal:
        grid(region)
    assert states(str(refusal.value), message), refusal.value


def test_grids_of_velocities_are_refused(region):
    with pytest.raises(RecordError, match=r"accelerations, but .* cm/s"):
        read_grid(GridFile(str(region / "grid.csv"), "cm/s", 2, 4, 7))


# ---- Fields

RECORD = "time_s,acceleration\n" + "".join(f"{0.01 * i:.2f},{a}\n" for i, a in enumerate(MOTION))
SITES = "site,longitude,latitude\nA,1,2\nB,3,4\n"


def field(region, text, **settings):
    """Read a table of fields beside a record with a peak of 0.2 m/s^2."""
    (region / "record.csv").write_text(RECORD)
    (region / "fields.csv").write_text(text)
    settings.setdefault("choice", RecordChoice(units="m/s^2"))
    return read_field(FieldFile(str(region / "fields.csv"), **settings))


def scales(found, site):
    """Return event and scale factor of each motion of a site."""
    draws = replace(found.site_motions, site_of=np.array([site])).draws(0)
    return [(draw.sample, pytest.approx(draw.scale)) for draw in draws]


def test_fields_have_the_factors_of_their_rows(region):
    text = "event,site,record,factor\ne1,A,record.csv,2\ne2,B,record.csv,\ne1,B,record.csv,-3\n"
    found = field(region, text)
    assert found.site_motions.events == ("e1", "e2") and len(found.motions) == 1
    assert scales(found, 0) == [(1, 2.0)]
    assert scales(found, 1) == [(1, -3.0), (2, 1.0)]


def test_intensities_of_fields_scale_the_records(region):
    """gmv_PGA is in g; the record has 0.2 m/s^2."""
    text = "event_id,site_id,record,gmv_PGA\n7,0,record.csv,0.1\n"
    assert scales(field(region, text), 0) == [(1, 0.1 * STANDARD_GRAVITY / 0.2)]


def test_sites_of_fields_have_the_locations_of_their_table(region):
    (region / "sites.csv").write_text(SITES)
    sites = str(region / "sites.csv")
    text = "event,site,record\ne1,B,record.csv\n"
    found = field(region, text, sites=sites)
    assert list(found.site_motions.locations) == [(1.0, 2.0), (3.0, 4.0)]
    assert (scales(found, 0), scales(found, 1)) == ([], [(1, 1.0)])
    with pytest.raises(ModelError, match=r"fields\.csv:2: .*'C'"):
        field(region, text.replace("B", "C"), sites=sites)


def test_each_event_needs_a_rate(region):
    text = "event,record\ne1,record.csv\ne2,record.csv\n"
    rates = region / "rates.csv"
    rates.write_text("event,rate\nother,1\ne2,0\ne1,0.01\n")
    assert field(region, text, rates=str(rates)).rates == {"e1": 0.01, "e2": 0.0}
    rates.write_text("event,rate\ne1,0.01\n")
    with pytest.raises(ModelError, match=r"rates\.csv: 1 event .*'e2'"):
        field(region, text, rates=str(rates))
    rates.write_text("event,rate\ne1,-0.01\n")
    with pytest.raises(ModelError, match=r"rates\.csv:2: rate"):
        field(region, text, rates=str(rates))


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (
            "event,site,record\ne1,A,record.csv\ne1,A,record.csv\n",
            "fields.csv:3: ... 'e1' ... 'A' ... line 2",
        ),
        ("event,record,factor\ne1,record.csv,zero\n", "fields.csv:2: factor ... 'zero'"),
        ("event,record\n", "fields.csv: ... no rows"),
    ],
)
def test_unusable_fields_are_refused_with_file_and_line(region, text, message):
    with pytest.raises(ModelError) as refusal:
        field(region, text)
    assert states(str(refusal.value), message), refusal.value


def test_records_of_fields_that_cannot_be_read_are_failures(region):
    text = "event,site,record\ne1,A,record.csv\ne2,A,none.csv\n"
    found = field(region, text)
    assert len(found.failures) == 1 and states(str(found.failures[0]), "fields.csv:3: ... none.csv")
    assert scales(found, 0) == [(1, 1.0)]
    with pytest.raises(RecordError, match=r"fields\.csv:2: .*none\.csv"):
        field(region, "event,record\ne1,none.csv\n")


def test_the_second_component_is_in_a_file_with_a_similar_name(region):
    for name in ("quake_000.csv", "quake_090.csv", "other_000.csv"):
        (region / name).write_text(RECORD.replace("0.2", "0.3") if "090" in name else RECORD)
    found = field(region, "event,site,record\ne1,A,quake_000.csv\n", pairs=True)
    names = sorted(Path(motion.record.source).name for motion in found.motions)
    assert names == ["quake_000.csv", "quake_090.csv"]
    with pytest.raises(RecordError, match="no file with a similar name"):
        field(region, "event,site,record\ne1,A,other_000.csv\n", pairs=True)
