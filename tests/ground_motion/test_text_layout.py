"""Text tables without a description of their columns: the user specifies the layout, which must not
contradict the file."""

import io

import numpy as np
import pytest

from facts import states
from ground_motion.format_files import motion, one_column, text, two_columns
from ground_motion.samples import SAMPLES
from selection import every
from tdint.errors import ModelError, RecordError, UsageError
from tdint.ground_motion.choice import AS_STATED, TextLayout
from tdint.ground_motion.reading.contents import other_content
from tdint.ground_motion.reading.read import read_record, read_records
from tdint.ground_motion.reading.scale import moved
from tdint.model.config.model_file import load_model
from tdint.units import STANDARD_GRAVITY

COLUMNS = [motion(60, peak, 4) for peak in (1.0, -2.0, 0.5)]
WORDS = ["Messung 7", "am 3. Mai"]


def table(above, *columns, separator=","):
    rows = [separator.join(f"{value:.4f}" for value in row) for row in zip(*columns, strict=True)]
    return text(above, rows)


def times(dt=0.02, samples=60):
    return np.arange(samples) * dt


@pytest.fixture
def file(tmp_path):
    return tmp_path / "a.txt"


def read(file, content, units=None, **layout):
    file.write_bytes(content.encode() if isinstance(content, str) else content)
    return read_records(file, units=units, layout=TextLayout(**layout))


def fails(match, file, content, units=None, **layout):
    with pytest.raises(RecordError, match=match):
        read(file, content, units, **layout)


class TestStep:
    def test_step_of_column_without_header(self, file):
        (record,) = read(file, one_column(header=None), "gal", step=0.005)
        assert (record.dt, record.pga) == (0.005, 0.015)
        assert states(record.notes[0], "sampling interval of 0.005 s; ... none")

    def test_step_of_columns_without_time(self, file):
        records = read(file, table([], *COLUMNS, separator="  "), "gal", step=0.02)
        assert [(record.component, record.dt) for record in records] == [
            ("1", 0.02),
            ("2", 0.02),
            ("3", 0.02),
        ]
        np.testing.assert_allclose(records[2].acceleration, 0.01 * COLUMNS[2], rtol=1e-15)
        # The samples of one motion may also have this layout.
        message = (
            "each of 3 columns without names is read as a separate ground motion; if the lines "
            "continue"
        )
        assert all(any(note.startswith(message) for note in record.notes) for record in records)
        timed = read(file, table([], 0.02 * np.arange(60), *COLUMNS[:2], separator=" "), "gal")
        named = read(file, table(["N,E,Z"], *COLUMNS), "gal", step=0.02)
        assert not any(
            "columns without names" in note for record in (*timed, *named) for note in record.notes
        )

    def test_step_with_column_of_sample_numbers(self, file):
        counted = table([], np.arange(1, 61), *COLUMNS[:2], separator=" ")
        assert [record.component for record in read(file, counted, "gal", step=0.02)] == ["2", "3"]
        fails(
            r"in the file is 1 s, which contradicts `step=0.02`",
            file,
            table(["time,N,E"], np.arange(1, 61), *COLUMNS[:2]),
            "gal",
            step=0.02,
        )

    @pytest.mark.parametrize(
        "content",
        [one_column(), two_columns(header=None), table(["t,N (g)"], times(0.01), COLUMNS[0])],
    )
    def test_contradicting_step_is_refused(self, file, content):
        units = None if "g" in content else "g"
        assert read(file, content, units, step=0.01)[0].dt == 0.01
        fails(
            r"sampling interval in the file is 0.01 s, which contradicts `step=0.02`",
            file,
            content,
            units,
            step=0.02,
        )

    @pytest.mark.parametrize("name", every(3, sorted(SAMPLES)))
    def test_step_is_compared_in_every_format(self, file, name):
        content = SAMPLES[name][0]()
        units = "gal" if content.lstrip()[:1].isdigit() else None
        dt = read(file, content, units)[0].dt
        assert read(file, content, units, step=dt)[0].dt == dt
        fails("which contradicts `step=.*`; remove it", file, content, units, step=2.0 * dt)


@pytest.mark.parametrize(
    ("dt", "above", "layout"),
    [
        (0.0025, "", {}),
        (0.0025, "# dt = 0.0025 s\n", {}),
        (0.00390625, "# dt = 0.00390625 s\n", {}),
        (0.00390625, "", {"step": 0.00390625}),
    ],
)
def test_rounded_times_of_a_short_table(file, dt, above, layout):
    """Several intervals agree with the rounded times: the stated or the usual one is right."""
    rows = "".join(f"{k * dt:.3f},{np.sin(k):.5f}\n" for k in range(20))
    (record,) = read(file, f"{above}Time (s),Acc (g)\n{rows}", **layout)
    assert record.dt == dt


def test_last_interval_that_differs_is_reported(file):
    """Some programs end a motion at the end of an analysis. The remedy gives the motion."""
    moments = times()
    moments[-1] -= 0.0036
    rows = table(["Time (s),Acc (g)"], moments, COLUMNS[0]).splitlines()
    fails(
        r"last interval .* 0\.0164 s, .* intervals are 0\.02 s; remove the last row",
        file,
        "\n".join(rows),
    )
    (record,) = read(file, "\n".join(rows[:-1]) + "\n")
    assert (record.dt, record.acceleration.size) == (0.02, len(moments) - 1)


class TestColumn:
    names = "Time (s), Sensor A, Sensor B (g), Vel (cm/s), Temp (C)"
    content = table([names], times(), *COLUMNS, np.full(60, 20.0))

    @pytest.mark.parametrize("column", ["3", "Sensor B (g)", "sensor b", "SENSOR B (G)"])
    def test_column_by_number_or_name(self, file, column):
        (record,) = read(file, self.content, column=column)
        assert (record.component, record.units, record.units_from) == ("Sensor-B", "g", "file")
        assert record.pga == pytest.approx(2.0 * STANDARD_GRAVITY)

    def test_unit_applies_to_its_own_column(self, file):
        content = table(["time,N (g),E"], times(), *COLUMNS[:2])
        fails("E: the file does not state the units", file, content)
        assert [record.units_from for record in read(file, content, "g")] == ["file", "given"]

    def test_several_columns_are_selected(self, file):
        found = read(file, self.content, "g", column=("2", "sensor b", "3"))
        assert [record.component for record in found] == ["Sensor-A", "Sensor-B"]

    def test_velocity_column_becomes_an_acceleration(self, file):
        (record,) = read(file, self.content, column="vel")
        expected = moved(0.01 * np.array(COLUMNS[2]), 0.02, "velocity").acceleration
        assert record.quantity == "velocity"
        np.testing.assert_allclose(record.acceleration, expected, atol=1e-12)

    @pytest.mark.parametrize(
        ("column", "units", "message"),
        [
            ("6", None, "column 6 .*columns 1 to 5"),
            ("0", None, "column 0 not found"),
            ("9" * 400, None, "column 9{40} .*columns 1 to 5"),
            ("1", None, r"column 1 contains the time \(Time \(s\)\)"),
            ("sensor", None, "column 'sensor' not found; .* Time"),
            ("5", None, "unit of acceleration, .*'c'"),
            ("3", "gal", r"units \(g\), .*gal"),
            ("2", None, "does not state the units"),
            (
                "4",
                "g",
                r"states its units \(cm/s\), but g is specified|the specified unit g is a "
                r"unit of acc",
            ),
        ],
    )
    def test_invalid_columns_are_refused(self, file, column, units, message):
        fails(message, file, self.content, units, column=column)

    def test_quantity_of_name_must_agree_with_units(self, file):
        for name, units in (("Vel", "g"), ("Acc", "cm/s"), ("Disp", "cm/s")):
            fails(
                "states that its values are of the quantity",
                file,
                table([f"Time,{name}"], times(), COLUMNS[0]),
                units,
            )

    @pytest.mark.parametrize(
        ("names", "layout", "message"),
        [
            (["t,a,a"], {"column": "a"}, "columns 2 and 3 .*'a'; .*number"),
            ([], {"column": "a"}, "no column names; .*number"),
            (["s,P1,P2"], {"step": 0.02}, "acceleration; .*`column`: P1, P2"),
        ],
    )
    def test_ambiguous_and_missing_names_are_refused(self, file, names, layout, message):
        fails(message, file, table(names, times(), *COLUMNS[:2]), "g", **layout)

    def test_column_names_in_comment(self, file):
        (record,) = read(
            file,
            table(["# recorded at night", "# t p7 p8"], times(), *COLUMNS[:2]),
            "gal",
            column="p8",
        )
        assert (record.component, record.dt, record.pga) == ("p8", 0.02, pytest.approx(0.02))

    @pytest.mark.parametrize("last", ["dt = 0.02", "units = gal"])
    def test_declaration_after_names_is_not_a_line_of_names(self, file, last):
        """A declaration has as many words as the table has columns."""
        columns = (times(), *COLUMNS[:2])
        record, _ = read(file, table(["# a table", last], *columns), "gal", skip_lines=1)
        assert (record.component, record.dt) == ("2", 0.02)
        content = table(["not a declaration", last], *columns)
        assert read(file, content, "gal", column="2")[0].component == "2"


class TestSkippedLines:
    def test_skipped_lines_are_not_interpreted(self, file):
        for above in (WORDS, ["dt = 7 s", "1 2 3 4"], ["\xe9", "# units = g"]):
            (record,) = read(
                file, text(above, one_column(header=None)), "gal", skip_lines=2, step=0.01
            )
            assert (record.dt, record.pga) == (0.01, 0.015)
            assert "2 lines ignored at the beginning, as requested" in record.notes

    @pytest.mark.parametrize("mark", [b"", b"\xef\xbb\xbf"])
    def test_names_after_skipped_lines_with_byte_order_mark(self, file, mark):
        content = text(
            WORDS, ["Zeit (s);Kanal 1;Kanal 2"], table([], times(), *COLUMNS[:2], separator=";")
        )
        (record,) = read(
            file, mark + content.replace(".", ",").encode(), "gal", skip_lines=2, column="Kanal 2"
        )
        assert (record.component, record.dt, record.pga) == ("Kanal-2", 0.02, pytest.approx(0.02))

    def test_lines_that_need_not_be_skipped(self, file):
        content = text(WORDS, two_columns(header=None, separator=" "))
        for skipped in (None, 1, 2):
            assert read(file, content, "g", step=0.01, skip_lines=skipped)[0].dt == 0.01
        fails(
            r"unknown format, and no table of numbers found below its first 500",
            file,
            content,
            "g",
            skip_lines=500,
        )


def test_column_with_unit_of_acceleration_is_ground_motion(file):
    base, drift = (
        text(["time_s,base_m_s2"], table([], times(), COLUMNS[0])),
        table([], times(), *COLUMNS[:2]),
    )
    (record,) = read(file, base)
    assert (record.component, record.units, record.pga) == ("base", "m/s^2", pytest.approx(1.0))
    (record,) = read(file, text(["time_s,base_m_s2,drift_m"], drift))
    assert record.component == "base"


def test_numbers_in_quotation_marks(file):
    quoted = "\n".join(f'"{t:.2f}","{a:.4f}"' for t, a in zip(times(), COLUMNS[0], strict=True))
    for layout in ({}, {"column": "2"}):
        (record,) = read(file, '"time_s","a_m_s2"\n' + quoted, **layout)
        assert (record.dt, record.pga) == (0.02, 1.0)
    fails("only one row of numbers; a record needs at least two", file, "time_s,a_m_s2\n0.0,1.0\n")


def test_layout_is_refused_for_other_formats(file):
    for name in sorted(set(SAMPLES) - {"TEXT"}):
        for layout in ({"column": "2"}, {"skip_lines": 1}):
            fails(
                f"cannot be used with the file format {name}; it applies",
                file,
                SAMPLES[name][0](),
                **layout,
            )


def test_layout_of_files_in_directory(file):
    file.write_text(text(WORDS, one_column(header=None)))
    assert other_content(file) == ""
    assert other_content(file, TextLayout(skip_lines=2)) == ""
    assert read_record(file, units="gal", layout=TextLayout(0.01, (), 2)).pga == 0.015


@pytest.mark.parametrize(
    ("name", "value"),
    [
        *(("step", value) for value in (0.0, float("nan"), "1")),
        *(("column", value) for value in ("", ("1", " "), 1.5)),
        *(("skip_lines", value) for value in (-1, 1.0, True)),
    ],
)
def test_invalid_layouts_are_refused(name, value):
    with pytest.raises(UsageError):
        TextLayout(**{name: value})


class TestModelFile:
    MODEL = "stories: [{mass: 1, stiffness: 1}]\nexcitation: {record: {file: r.txt, %s}}\n"

    def layout(self, entries):
        return load_model(io.StringIO(self.MODEL % entries)).excitation.record.choice.layout

    def test_layout_keys_of_model_file(self):
        assert self.layout("step: 0.01, column: Sensor B, skip_lines: 3") == TextLayout(
            0.01, ("Sensor B",), 3
        )
        assert self.layout("column: 2") == TextLayout(column="2")
        assert self.layout("scale: 2") == AS_STATED

    @pytest.mark.parametrize(
        "wrong",
        [
            "step: 0", "step: a", "step: [1]", "column: ''", "skip_lines: -1",
            "skip_lines: 1.5",
        ],
    )  # fmt: skip
    def test_invalid_layout_keys_are_refused(self, wrong):
        with pytest.raises(
            ModelError, match=rf":2:\d+: excitation.record.{wrong.partition(':')[0]}: "
        ):
            self.layout(wrong)
