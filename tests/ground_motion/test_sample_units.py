"""Units of several files in one call: by format, by the end of the path, by a table, and with an
inventory."""

from __future__ import annotations

import zipfile
from pathlib import Path

import numpy as np
import pytest

from ground_motion.files import counts, refused, trace, wave, write
from ground_motion.test_response import station_xml
from tdint.errors import ModelError, UsageError
from tdint.ground_motion.choice import RecordChoice
from tdint.ground_motion.reading.read import read_record
from tdint.ground_motion.reading.suites import records_of
from tdint.units import STANDARD_GRAVITY

UNITS = {"SAC": "g", "*.mseed": "m/s^2"}


@pytest.fixture
def suite(tmp_path: Path) -> dict[str, Path]:
    """Return four files with the same motion, one of which states its units."""
    (tmp_path / "in").mkdir()
    folder = tmp_path / "in"
    return {
        "sac": write(folder / "a.sac", trace(wave().astype(np.float32)), format="SAC"),
        "mseed": write(folder / "B.MSEED", trace(wave(), channel="X")),
        "counts": write(folder / "c.mseed", trace(counts())),
        "stated": write(folder / "d.txt", trace(wave(), ascii={"unit": "CM/S**2"}), format="SLIST"),
    }


@pytest.mark.parametrize(
    "units", [UNITS, "SAC=g,*.mseed=m/s^2", "*.mseed=m/s^2, sac = g", "in/*.sac=g,in/b.mseed=m/s^2"]
)
def test_units_by_format_and_path(suite, units) -> None:
    records = {name: read_record(suite[name], units=units) for name in ("sac", "mseed", "stated")}
    assert {name: record.units_from for name, record in records.items()} == {
        "sac": "given",
        "mseed": "given",
        "stated": "file",
    }
    assert records["sac"].pga == pytest.approx(3.0 * STANDARD_GRAVITY)
    assert records["mseed"].pga == 3.0
    assert records["stated"].pga == pytest.approx(0.03)


def test_first_matching_entry_is_used(suite) -> None:
    assert read_record(suite["sac"], units={"*.sac": "gal", "SAC": "g"}).pga == pytest.approx(0.03)
    refused(
        suite["sac"],
        "does not state the units of its samples",
        units={"in/*.txt": "g", "out/*.sac": "g"},
    )


def test_inventory_applies_to_counts_without_units(suite, tmp_path) -> None:
    station = station_xml(tmp_path / "a.xml", "HNE")
    by_response = read_record(suite["counts"], inventory=station)
    for units in (
        UNITS,
        {"c.mseed": "counts", "*.mseed": "g"},
    ):  # m/s^2 is not a unit of counts and does not contradict the inventory
        record = read_record(suite["counts"], units=units, inventory=station)
        assert record.units_from == "inventory"
        np.testing.assert_array_equal(record.acceleration, by_response.acceleration)
    by_value = read_record(suite["counts"], units={"*.mseed": "1e-5 m/s^2"}, inventory=station)
    assert (by_value.units_from, len(by_value.inputs)) == ("given", 1)
    assert read_record(suite["sac"], units=UNITS, inventory=station).units_from == "given"
    refused(suite["counts"], "the samples are counts", units=UNITS)


def test_units_from_table(suite, tmp_path) -> None:
    table = tmp_path / "units.csv"
    table.write_text("record,units\nin/a.sac,g\n../in/b.mseed,cm/s^2\nd.txt,\n")
    assert read_record(suite["sac"], units=str(table)).pga == pytest.approx(3.0 * STANDARD_GRAVITY)
    assert read_record(suite["mseed"], units=str(table)).pga == pytest.approx(0.03)
    assert read_record(suite["stated"], units=str(table)).units_from == "file"
    table.write_text("record,units\na.sac,g\na.sac,gal\n")
    with pytest.raises(UsageError, match=r"units\.csv:3: a\.sac .*g and gal"):
        read_record(suite["sac"], units=str(table))
    table.write_text("record,units,component\na.sac,g,HNE\n")
    with pytest.raises(UsageError, match=r"unknown columns component"):
        read_record(suite["sac"], units=str(table))
    table.write_text("record,unit\na.sac,g\n")
    with pytest.raises(ModelError, match=r"units\.csv:1: no column units"):
        read_record(suite["sac"], units=str(table))


def test_wildcards_in_table_are_literal(tmp_path) -> None:
    path = write(tmp_path / "a[1].sac", trace(wave().astype(np.float32)), format="SAC")
    (tmp_path / "units.csv").write_text("record,units\na[1].sac,g\n")
    assert read_record(path, units=str(tmp_path / "units.csv")).pga == pytest.approx(
        3.0 * STANDARD_GRAVITY
    )


@pytest.mark.parametrize(
    ("units", "message"),
    [
        (
            "SAK=g",
            r"of 'SAK': unknown file format; specify files with a pattern such as \*\.txt; did you "
            r"mean 'SAC'",
        ),
        ("*.sac=gg", r"of '\*\.sac': units 'gg'"),
        ("SAC=g,gal", "'gal'; expected FORMAT=UNITS"),
        ("=g", "'=g'; expected FORMAT=UNITS"),
        ({"SAC": 9.81}, "units of 'SAC' must be a text"),
        ("SAC=g,SAC=m/s^2", "'SAC' is specified twice, as g and m/s"),
        ("SAC=g,sac=g", "'sac' is specified twice"),
    ],
)
def test_invalid_units_are_refused(suite, units, message) -> None:
    with pytest.raises(UsageError, match=message):
        read_record(suite["sac"], units=units)


def test_entries_without_matching_file_are_refused(suite, tmp_path) -> None:
    """If an entry was intended for a file, its units are not assumed. Paths within archives, which
    are only known after reading, count as matches."""
    with pytest.raises(UsageError, match=r"units by file .*: at2"):
        read_record(write(tmp_path / "assumed", trace(wave(peak=1.0))), units={"AT2": "g"})
    folder = str(suite["sac"].parent)
    for units, unfit in (("SAC=g,AT2=g", "'at2'"), ("*.sac=g,*.mseeed=g,b*=gal", r"'\*\.mseeed'")):
        with pytest.raises(UsageError, match=f"units of {unfit}: no file of this call matches"):
            records_of([folder], RecordChoice(units=units))
    records_of([folder], RecordChoice(units="SAC=g,*.mseed=m/s^2,SLIST=gal"))
    with zipfile.ZipFile(tmp_path / "a.zip", "w") as archive:
        archive.write(suite["sac"], "within/x.sac")
    records_of([str(tmp_path / "a.zip")], RecordChoice(units="SAC=g,within/x.sac=g"))
    # these names are only checked when the files are read
    records_of(["-", str(tmp_path / "none")], RecordChoice(units="AT2=g"))


def test_contradiction_with_file_is_refused(suite) -> None:
    refused(suite["stated"], "the file states its units", units={"*.txt": "g"})
