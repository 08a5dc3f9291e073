"""CSV files with a header: files that every reader refuses, and allowed cells of columns."""

import io
import itertools
import math
import os
import re
import sys
import tracemalloc

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tdint import csv_table
from tdint.csv_table import TextColumn, read_table
from tdint.errors import ModelError, RecordError, UsageError
from tdint.response.spectra.target import read_target
from tdint.response.static.cyclic import read_drift_path
from tdint.studies.campaign.assigned_motions import GridFile
from tdint.studies.campaign.inputs import read_factors
from tdint.studies.fragility.fit_table import fragility
from tdint.studies.fragility.type_states import DamageRequest, read_class_damage
from tdint.studies.regions.inventory import read_inventory
from tdint.studies.regions.sites import read_grid


def grid(source):
    return read_grid(GridFile(source, "g", 2, 4, 7))


READERS = {
    "inventory": (lambda source: read_inventory(source, 1.0), ModelError, b"id"),
    "target": (read_target, ModelError, b"sa_g"),
    "fragility": (fragility, ModelError, b"im"),
    "path": (read_drift_path, UsageError, b"drift_m"),
    "factors": (read_factors, ModelError, b"factor"),
    "grid": (grid, ModelError, b"Longitude"),
}
"""All that read such a file, the error that each raises, and a column that it reads."""


@pytest.fixture(params=READERS)
def refused(request, tmp_path):
    """Return a function that checks that a reader refuses a file with a message; `COLUMN`
    represents the column that it reads."""
    read, error, column = READERS[request.param]

    def check(content, message, source=None):
        file = tmp_path / "t.csv"
        if content is not None:
            file.write_bytes(content.replace(b"COLUMN", column))
        with pytest.raises(error, match=message.replace("COLUMN", column.decode())) as caught:
            read(source or str(file))
        assert caught.value.exit_code == error.exit_code

    return check


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (None, r"t\.csv: file not found; \w+"),
        (b"", r"t\.csv: the file is empty; \w+"),
        (b"\n , \n", r"t\.csv: the file is empty"),
        (b"COLUMN,name\n1,Z\xfcrich\n", r"t\.csv: not UTF-8 text \(byte 0xfc\); save it as UTF-8"),
        ("id\n1\n".encode("utf-16"), r"t\.csv: not UTF-8 text \(byte 0xff\)"),
        (b"COLUMN\n1\n2\0\n", r"t\.csv:3: null character"),
        (b'COLUMN,name\n1,a\n2,"b\n3,c\n', r"t\.csv: .*quotation mark .*line 2"),
        (b"COLUMN," + 200_000 * b"x" + b"\n1,2\n", r"t\.csv:1: invalid CSV: field larger"),
        (b"\nCOLUMN,x, COLUMN\n1,2,3\n", r"t\.csv:2: the header contains the column COLUMN twice"),
    ],
)
def test_every_reader_refuses_invalid_files(refused, content, message):
    refused(content, message)


def test_every_reader_refuses_endless_files(refused, tmp_path, monkeypatch):
    monkeypatch.setattr(csv_table, "MOST_BYTES", 2**20)
    refused(b"COLUMN\n" + 2**20 * b"1", r"t\.csv: larger than 1 MiB")
    refused(None, "/dev/zero: larger than 1 MiB", "/dev/zero")
    os.mkfifo(tmp_path / "pipe")
    refused(None, "pipe: this is a named pipe, which may never end", str(tmp_path / "pipe"))


def test_too_large_file_is_refused_before_reading(tmp_path):
    """A sparse file has its size although it has no blocks on the disk."""
    with (tmp_path / "t.csv").open("wb") as file:
        file.truncate(2**30)
    tracemalloc.start()
    with pytest.raises(ModelError, match="larger than 256 MiB"):
        read_table(str(tmp_path / "t.csv"), "a table")
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < 2**22


def raises(reader, folder, text, message):
    """Check that a reader refuses a file with this text."""
    read, error, _ = READERS[reader]
    (folder / "t.csv").write_text(text)
    with pytest.raises(error, match=message):
        read(str(folder / "t.csv"))


FULL = {
    "target": ("period_s,sa_g", "1,2"),
    "fragility": ("im,edp", "1,2"),
    "path": ("drift_m", "1"),
    "factors": ("record,component,factor", "a,b,2"),
    "grid": ("GP_file,Longitude,Latitude", "a.csv,1,2"),
}
"""Headers and rows of all but the inventory, which tells the faults of all rows together."""


@pytest.mark.parametrize("reader", FULL)
def test_rows_with_additional_cells_are_refused(tmp_path, reader):
    header, row = FULL[reader]
    raises(
        reader,
        tmp_path,
        f"{header}\n{row},9\n",
        r"t\.csv:2: the row has (\d) cells, but the header has \d columns?",
    )


def test_empty_cells_at_end_of_row_are_ignored(tmp_path):
    """Spreadsheets write such cells."""
    (tmp_path / "t.csv").write_text("drift_m,\n1,,,\n2\n")
    assert read_drift_path(str(tmp_path / "t.csv")) == [1.0, 2.0]
    rows = "id,NumberOfStories,YearBuilt,StructureType,PlanArea,,\na,3,1990,C1,600,,,\nb,3,1990,C1,600,,,1\n"  # noqa: E501
    (tmp_path / "t.csv").write_text(rows)
    (found,), (fault,) = read_inventory(str(tmp_path / "t.csv"), 1.0)
    assert (found.id, str(fault).partition("t.csv:")[2]) == (
        "a",
        "3:8: the row has 8 cells, but the header has 7 columns",
    )


@pytest.mark.parametrize("reader", [name for name in FULL if name != "path"])
def test_files_without_rows_are_refused(tmp_path, reader):
    raises(
        reader,
        tmp_path,
        f"{FULL[reader][0]}\n\n",
        r"t\.csv: the table has no rows below its header; \w+",
    )


def ending_in(cell, reader):
    """Return the text of a valid table for a reader, with the cell at the end of its row."""
    header, row = FULL[reader]
    return f"{header}\n{row.rpartition(',')[0]}{',' * (',' in row)}{cell}\n"


@pytest.mark.parametrize("cell", ["nan", "inf", "-1e999", "x", "1,5", "1_0", "\uff11"])
@pytest.mark.parametrize("reader", FULL)
def test_non_finite_numbers_are_refused(tmp_path, reader, cell):
    last = FULL[reader][0].split(",")[-1]
    raises(
        reader,
        tmp_path,
        ending_in(f'"{cell}"', reader),
        rf"t\.csv:2: {last}:? must be a .*, got '{cell}'",
    )


@pytest.mark.parametrize("cell", ["1e308", "-1e61", "5e-324"])
@pytest.mark.parametrize("reader", FULL)
def test_excessive_numbers_are_refused(tmp_path, reader, cell):
    """As in model files, the square of such a number would overflow or underflow."""
    raises(
        reader,
        tmp_path,
        ending_in(cell, reader),
        rf"got '{cell}'; the absolute value must be between 1e-60 and 1e\+60",
    )


# Row of the grid, motions of its site, error
GRIDS = r"""
site.csv,-122,90.5 -> TH_file;m -> grid\.csv:2: Latitude must be from -90 to 90 degrees
site.csv,37,-90.5 -> TH_file;m -> grid\.csv:2: Latitude must be .*, got '-90.5'
site.csv,361,37 -> TH_file;m -> grid\.csv:2: Longitude must be from -360 to 360 degrees
site.csv,,37 -> TH_file;m -> grid\.csv:2: Longitude is missing
,-122,37 -> TH_file;m -> grid\.csv:2: GP_file is missing
site.csv,-122,37 -> TH_file,factor;,2 -> site\.csv:2: TH_file is missing
site.csv,-122,37 -> TH_file,factor;m,0 -> site\.csv:2: factor must not be zero, got '0'
site.csv,-122,37 -> TH_file,factor;m,x -> site\.csv:2: factor .*got 'x'
site.csv,-122,37 -> TH-file,factor;m,1 -> no column TH_file .*rename the column 'th-file'
site.csv,-122,37 -> TH_file, factor;m, -> m\.json: cannot be read
"""


@pytest.mark.parametrize("line", GRIDS.strip().splitlines())
def test_invalid_grids_are_refused(tmp_path, line):
    point, motions, message = line.split(" -> ")
    (tmp_path / "grid.csv").write_text(f"GP_file,Longitude,Latitude\n{point}\n")
    (tmp_path / "site.csv").write_text(motions.replace(";", "\n") + "\n")
    error = RecordError if "json" in message else ModelError
    with pytest.raises(error, match=message):
        grid(str(tmp_path / "grid.csv"))


def test_cells_of_table(tmp_path):
    """The table has names in upper and lower case, blank lines, a byte-order mark, quoted commas
    and line breaks, and rows with missing cells."""
    file = tmp_path / "t.csv"
    file.write_text(
        '\n A, b,Is,c\n"1, ""x""", 2, yes\n\n,-3e1,,5\n"two\nlines", "4"\n', encoding="utf-8-sig"
    )
    table = read_table(str(file), "a table is needed")
    assert table.has("a", "B") and not table.has("a", "d")
    assert table.texts("A") == ['1, "x"', "", "two\nlines"]
    assert table.numbers("b") == [2.0, -30.0, 4.0]
    assert table.truths("is") == [True, False, False] and table.truths("none") == [False] * 3
    assert list(table.lines("c")) == [(3, ""), (5, "5"), (7, "")]
    assert list(map(math.isnan, table.numbers("c", empty=True))) == [True, False, True]
    with pytest.raises(ModelError, match=r"t\.csv:5: b must .*got '-3e1'"):
        table.numbers("b", positive=True)
    with pytest.raises(ModelError, match=r"t\.csv:3: c is missing"):
        table.numbers("c")
    with pytest.raises(ModelError, match=r"t\.csv:5: c must be even, got '5'"):
        table.check("c", [True, False, True], "must be even")
    with pytest.raises(ModelError, match=r"t\.csv:5: c must .*got '5'"):
        table.truths("c")
    with pytest.raises(ModelError, match=r"t\.csv: column b .*same .*got 2, -3e1, 4; keep"):
        table.only("b")


@pytest.mark.parametrize(
    ("read", "header", "rows"),
    [
        (lambda source: read_target(source).psa.tolist(), "period_s,sa_g", "0.5,0.2\n1,0.1\n"),
        (read_drift_path, "drift_m,name", "0.1,a\n-0.2,b\n"),
        (read_factors, "record,component,factor", "a.txt,N,1.5\nb.txt,,2\n"),
        (
            lambda source: (
                read_class_damage(
                    DamageRequest("drift_ratio", ("slight",), None, source, 0.4, (), None)
                )
                .states["C1"]
                .medians
            ),
            "class,slight",
            "C1,0.5\n",
        ),
    ],
)
def test_separators_of_cells(tmp_path, read, header, rows):
    """Tabs and semicolons separate the cells of every table, with decimal points or commas. Some
    readers refused the files that others accepted."""
    file, found = tmp_path / "t.csv", []
    for mark, point in ((",", "."), ("\t", "."), (";", "."), ("\t", ","), (";", ",")):
        cells = (header + "\n" + rows).replace(",", mark)
        # The point in the name of a file is not a decimal point.
        file.write_text("\n" + re.sub(r"(?<=\d)\.(?=\d)", point, cells))
        found.append(read(str(file)))
    assert found == found[:1] * 5


def test_names_of_columns_may_contain_other_separators(tmp_path):
    file = tmp_path / "t.csv"
    file.write_text("record,component,Vs30; m/s,factor\na.txt,N,1,1.5\n")
    assert read_table(str(file), "").numbers("factor") == [1.5]


def test_table_is_read_from_standard_input(monkeypatch):
    monkeypatch.setattr(sys, "stdin", io.TextIOWrapper(io.BytesIO(b"drift_m\n0.1\n-0.2\n")))
    assert read_drift_path("-") == [0.1, -0.2]
    monkeypatch.setattr(sys, "stdin", None)
    with pytest.raises(UsageError, match="standard input is closed"):
        read_drift_path("-")


@given(
    st.lists(
        st.sampled_from(
            ["", "1", " 2.5 ", "-3e5", "1e-320", "1e400", "nan", "inf", "1_0", "\u0661", "x", "0"]
        )
    )
)
def test_numbers_of_many_cells_equal_numbers_of_each(texts: list[str]) -> None:
    np.testing.assert_array_equal(
        csv_table.numbers_in(texts), [csv_table.number(text) for text in texts]
    )


@settings(max_examples=15)
@given(st.lists(st.text(st.characters(exclude_characters="\0", codec="utf-8"), max_size=3)))
def test_text_column_returns_its_texts(texts: list[str]) -> None:
    """Iteration, indices from both ends, slices and parts return the texts, including empty texts
    and texts with line breaks."""
    many = texts * 30
    column = TextColumn(iter(many))
    assert list(column) == many and len(column) == len(many)
    assert [column[at] for at in range(-len(many), len(many))] == many * 2
    assert column[1::7] == many[1::7]
    assert list(itertools.chain.from_iterable(column.parts())) == many
    with pytest.raises(IndexError):
        column[len(many)]


@pytest.mark.long
def test_memory_of_text_column_is_limited() -> None:
    """A column needs little more memory than its characters; a list of the same texts needs 60
    bytes more per text."""
    tracemalloc.start()
    column = TextColumn(f"b{number:07d}" for number in range(100_000))
    memory = tracemalloc.get_traced_memory()[0]
    tracemalloc.stop()
    assert len(column) == 100_000 and memory < 12 * 100_000
