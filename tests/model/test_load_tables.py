"""Forces on floors from CSV files and points: reading, units, and messages."""

import numpy as np
import pytest

from tdint import load_model
from tdint.errors import ModelError

UNITS = "units: {length: m, force: kN, mass: t}\n"
STORIES = "stories: [{repeat: 3, mass: 60, stiffness: 3.0e+4}]\n"
TABLE = "time_s,roof_kN,side\n0,200,1\n0.1,0,2\n0.1,50,3\n2,0,4\n"


@pytest.fixture
def load(tmp_path):
    """Return a function that reads a model with some forces and a table."""

    def read(forces, table=TABLE, name="blast.csv", units=UNITS):
        (tmp_path / name).write_text(table, encoding="utf-8")
        text = f"{units}{STORIES}excitation: {{forces: {forces}}}\n"
        (tmp_path / "model.yaml").write_text(text, encoding="utf-8")
        return load_model(tmp_path / "model.yaml")

    return read


def message(load, *arguments, **keywords):
    """Return the message of the error without the directory."""
    with pytest.raises(ModelError) as caught:
        load(*arguments, **keywords)
    text = str(caught.value)
    directory = text[: text.index("model.yaml")]
    return text.replace(directory, "")


def test_columns_of_floors_have_factors_and_share_a_table(load):
    model = load(
        "[{file: blast.csv, floors: {3: roof_kN, 2: 0.6 roof_kN, 1: -2 * side}, start: 0.5,"
        " scale: 10}]"
    )
    roof, middle, first = model.excitation.tables
    assert roof.table is middle.table is first.table
    assert [force.floor for force in (roof, middle, first)] == [3, 2, 1]
    assert roof.times.tolist() == [0.5, 0.6, 0.6, 2.5]
    assert roof.values.tolist() == pytest.approx([2e6, 0.0, 5e5, 0.0])
    assert middle.values.tolist() == pytest.approx([1.2e6, 0.0, 3e5, 0.0])
    # The column `side` has no unit: kN, as in the model.
    assert first.values.tolist() == pytest.approx([-2e4, -4e4, -6e4, -8e4])
    assert model.excitation.forces == ()
    assert model.excitation.table_end == 2.5


@pytest.mark.parametrize(
    ("column", "newtons"),
    [("f_N", 1.0), ("f_kN", 1e3), ("f_kn", 1e3), ("f_MN", 1e6), ("f_lbf", 4.4482216152605),
     ("f_kip", 4448.2216152605), ("force", 1e3), ("wind_1", 1e3), ("f (N)", 1.0),
     ("f[lbf]", 4.4482216152605), ("top floor kip", 4448.2216152605), ("top floor", 1e3),
     ("f (top)", 1e3)],
)  # fmt: skip
def test_unit_of_a_column(load, column, newtons):
    (force,) = load(
        "[{floor: 1, file: blast.csv}]", f"time_s,{column}\n0,3\n1,0\n"
    ).excitation.tables
    assert force.values[0] == pytest.approx(3.0 * newtons, rel=1e-14)


@pytest.mark.parametrize(
    ("column", "factor"),
    [("time_ms", 1e-3), ("time", 1.0), ("T_min", 60.0), ("Time (ms)", 1e-3), ("t[s]", 1.0)],
)
def test_unit_of_the_times(load, column, factor):
    (force,) = load("[{floor: 1, file: blast.csv}]", f"{column},f\n0,3\n5,0\n").excitation.tables
    assert force.times.tolist() == [0.0, 5.0 * factor]


def test_cells_may_be_separated_by_semicolons_and_have_decimal_commas(load):
    (force,) = load(
        "[{floor: 1, file: blast.csv}]", "time_s;f_kN\n0;1,5\n0,5;2\n"
    ).excitation.tables
    assert (force.times.tolist(), force.values.tolist()) == ([0.0, 0.5], [1500.0, 2000.0])


def test_points_are_in_the_unit_of_the_model(load):
    forces = (
        "[{floor: 2, points: [[0, 200], [0.1, 0]], scale: 2}, {floor: 1, amplitude: 5, omega: 3}]"
    )
    model = load(forces)
    (force,) = model.excitation.tables
    assert (force.times.tolist(), force.values.tolist()) == ([0.0, 0.1], [4e5, 0.0])
    assert len(model.excitation.forces) == 1
    assert model == load(forces)


def test_large_tables_are_read_in_blocks(load):
    times = np.arange(2000) / 100.0
    table = "time_s,a_N\n" + "".join(f"{t:.2f},{t * t:.6f}\n" for t in times)
    (force,) = load("[{floor: 1, file: blast.csv}]", table).excitation.tables
    assert force.times == pytest.approx(times, abs=1e-12)
    assert force.values == pytest.approx(times**2, abs=1e-6)


@pytest.mark.parametrize(
    ("forces", "expected"),
    [
        ("[{floor: 4, file: blast.csv, column: side}]",
         "excitation.forces[1].floor: must be a whole number from 1 to 3 (the number of stories)"),
        ("[{file: blast.csv, floors: {4: side}}]",
         "excitation.forces[1].floors: the keys must be floors from 1 to 3 (the number of "
         "stories) or roof, got '4'"),
        ("[{file: other.csv, floors: {4: side}}]",
         "excitation.forces[1].floors: the keys must be floors from 1 to 3 (the number of "
         "stories) or roof, got '4'"),
        ("[{file: blast.csv, floors: {top: side}}]",
         "excitation.forces[1].floors: the keys must be floors from 1 to 3 (the number of "
         "stories) or roof, got 'top'"),
        ("[{floor: 1, file: blast.csv, column: sides}]",
         "no column 'sides' in blast.csv; the columns of forces are roof_kN, side; did you mean "
         "side?"),
        ("[{floor: 1, file: blast.csv}]",
         "the file has 2 columns of forces; give `column`: one of roof_kN, side"),
        ("[{floor: 1, file: other.csv, column: side}]",
         "excitation.forces[1].column: other.csv: file not found; a table of forces is a CSV file"),
        ("[{floor: 1, column: side}]",
         "excitation.forces[1].file: is missing; give the file of the table, or `points`"),
        ("[{file: blast.csv, column: side}]",
         "excitation.forces[1].floor: is missing; give the floor, counted from 1 at the bottom"),
        ("[{floor: 1, file: blast.csv, floors: {1: side}}]",
         "excitation.forces[1].floor: cannot be used with `floors`; give one of the two"),
        ("[{floor: 1, file: blast.csv, points: [[0, 1], [1, 0]]}]",
         "excitation.forces[1].file: cannot be used with `points`"),
        ("[{floor: 1, points: [[0, 1]]}]",
         "points: must be a list of at least two points [time in s, force], got 1"),
        ("[{floor: 1, points: [[0, 1], [1]]}]",
         "excitation.forces[1].points[2]: must be a point [time in s, force], got 1"),
        ("[{floor: 1, points: [[0, 1], [1, x]]}]",
         "excitation.forces[1].points[2][2]: must be a number, got 'x'"),
        ("[{floor: 1, points: [[0, 1], [1, 2], [0.5, 0]]}]",
         "excitation.forces[1].points[3]: times must not decrease, and at most two rows have the "
         "same time (a jump), got 0.5 s"),
        ("[{floor: 1, points: [[0, 1], [0, 2], [0, 3]]}]",
         "points[3]: times must not decrease, and at most two rows have the same time (a jump), "
         "got 0 s"),
        ("[{floor: 1, points: [[0, 1], [1, 0]], strat: 2}]",
         "excitation.forces[1].strat: unknown key; did you mean 'start'?"),
        ("[{floor: 1, file: blast.csv, column: side, scale: a}]",
         "excitation.forces[1].scale: must be a number, got 'a'"),
    ],
)  # fmt: skip
def test_messages_of_the_model_file(load, forces, expected):
    assert expected in message(load, forces)


@pytest.mark.parametrize(
    ("table", "expected"),
    [
        ("time_s,f_kN\n0,1\n0.2,2\n0.1,3\n",
         "blast.csv:4: time_s: times must not decrease, and at most two rows have the same time (a "
         "jump), got 0.1 s"),
        ("time_s,f_kN\n0,1\n1,2\n1,3\n1,4\n",
         "blast.csv:5: time_s: times must not decrease, and at most two rows have the same time (a "
         "jump), got 1 s"),
        ("time_s,f_kN\n0,1\n1,x\n", "blast.csv:3: f_kN must be a number, got 'x'"),
        ("time_s,f_kN\n0,1\n1,\n", "blast.csv:3: f_kN is missing"),
        ("time_s,f_kN\n0,1\n1,2,3\n", "blast.csv:3: the row has 3 cells"),
        ("time_s,f_kN\n0,1\n", "blast.csv: the table must have at least two rows, got 1"),
        ("time_s,f_kN\n", "blast.csv: the table must have at least two rows, got 0"),
        ("", "blast.csv: the file is empty"),
        ("f_kN,g\n0,1\n1,2\n",
         "blast.csv:1: no column of times, such as time_s or time_ms, among 2 columns; the "
         "first line must contain the names"),
        ("time_s;f_kN\n0;1,5\n1;2,x\n", "blast.csv:3: f_kN must be a number, got '2,x'"),
        ("time_s,f (t)\n0,1\n1,2\n", "the column f (t) has the unit t, which is not a unit"),
        ("t,time_s,f\n0,0,1\n1,1,2\n", "several columns of times"),
        ("time_s,f_mm\n0,1\n1,2\n",
         "blast.csv:1: the column f_mm has the unit mm, which is not a unit of force; known: N, "
         "kN, MN, lbf, kip"),
        ("time_s,f_mN\n0,1\n1,2\n", "the column f_mN has the unit mN, which is not a unit"),
    ],
)  # fmt: skip
def test_messages_of_the_file(load, table, expected):
    text = message(load, "[{floor: 1, file: blast.csv}]", table)
    assert expected in text
    assert text.startswith("model.yaml:3:")


@pytest.mark.parametrize(
    "forces",
    [
        "[{floor: FLOOR, points: [[0, 0], [1, 5]]}]",
        "[{floors: {FLOOR: side}, file: blast.csv}]",
        "[{floor: FLOOR, amplitude: 5, omega: 3}]",
    ],
)
def test_the_roof_is_the_highest_floor(load, forces):
    roof, number = (load(forces.replace("FLOOR", floor)).excitation for floor in ("roof", "3"))
    assert [force.floor for force in roof.forces] == [force.floor for force in number.forces]
    assert [force.floor for force in roof.tables] == [force.floor for force in number.tables]
    assert [force.floor for force in (*roof.forces, *roof.tables)] == [3]
