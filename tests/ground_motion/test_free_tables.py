"""Accelerograms in tables under a free header: right values, questions, and damaged files."""

import re

import numpy as np
import pytest

from facts import states
from fuzz.random_tables import KINDS, WRONG, outcome
from ground_motion.format_files import text
from ground_motion.free_tables import CASES, F8, GAL, G, accelerogram, column, lines
from ground_motion.samples import SAMPLES
from selection import every
from tdint.errors import RecordError, UsageError
from tdint.ground_motion.choice import TextLayout
from tdint.ground_motion.formats.header_statements import statements
from tdint.ground_motion.formats.lines import ROW
from tdint.ground_motion.reading.contents import other_content
from tdint.ground_motion.reading.read import read_records
from tdint.ground_motion.reading.scale import moved

TIMES = 0.01 * np.arange(len(G))
COUNTED = "NO. OF POINTS: {} INTERVALS OF: 0.01 SEC\nACCELERATION UNIT: CM/SEC/SEC\n"


@pytest.fixture
def file(tmp_path):
    return tmp_path / "a.txt"


def read(file, content, units=None, **layout):
    file.write_bytes(content.encode() if isinstance(content, str) else content)
    return read_records(file, units=units, layout=TextLayout(**layout))


def message(file, content, units=None, **layout):
    with pytest.raises(RecordError) as error:
        read(file, content, units, **layout)
    return str(error.value)


def table(*columns, form="%10.5f"):
    return "".join(
        "".join(form % value for value in row) + "\n" for row in zip(*columns, strict=True)
    )


class TestStatements:
    @pytest.mark.parametrize(
        ("line", "counts", "intervals", "units", "peak"),
        [
            ("NO. OF POINTS:  4003  EQUALLY SPACED INTERVALS OF:  0.005  SEC", {4003}, (0.005,), (),
             ""),
            ("Number of Data                : 3000", {3000}, (), (), ""),
            ("NUMBER OF POINTS 2411", {2411}, (), (), ""),
            ("NPTS = 1200", {1200}, (), (), ""),
            ("1600 POINTS OF ACC DATA EQUALLY SPACED AT   .010 SEC.", {1600}, (0.01,), (), ""),
            ("NO OF POINTS=  1187, UNITS=CM/SEC**2, CM/SEC, AND CM", {1187}, (), ("cm/s^2",), ""),
            ("Number of points = 800, time step = 0.02 s", {800}, (0.02,), (), ""),
            ("Time Increment (s)            : 0.01", set(), (0.01,), (), ""),
            ("Sampling interval (ms): 5", set(), (0.005,), (), ""),
            ("DELTA T = 20 MSEC", set(), (0.02,), (), ""),
            ("Sampling rate: 0.005 sec", set(), (0.005,), (), ""),
            ("SAMPLING RATE 200 HZ", set(), (0.005,), (), ""),
            ("SAMPLES/SEC=200 FILTER TYPE=NONE", set(), (0.005,), (), ""),
            ("100 samples per second", set(), (0.01,), (), ""),
            ("UNCORRECTED ACCELERATION      UNIT: CM/SEC/SEC", set(), (), ("cm/s^2",), ""),
            ("Acceleration time series in m/s/s", set(), (), ("m/s^2",), ""),
            ("ACC. (G)", set(), (), ("g",), ""),
            ("acceleration in units of G/10", set(), (), ("0.1 g",), ""),
            ("Units: mg", set(), (), ("mg",), ""),
            ("PEAK VALUE:    182.340   AT    3.71 SEC", set(), (), (), "182.340"),
            ("PGA (m/s/s)                   : 4.2E+00", set(), (), (), "4.2E+00"),
            ("MAX. ACC. = -48.0742 CMS/SEC/SEC", set(), (), (), "-48.0742"),
            ("Intervalo de muestreo: 0.01 s", set(), (0.01,), (), ""),
            ("Unidades: cm/s2, número de datos: 2411", {2411}, (), ("cm/s^2",), ""),
            ("Pas de temps (s) : 0.005", set(), (0.005,), (), ""),
            ("Fréquence d'échantillonnage = 200 Hz", set(), (0.005,), (), ""),
            ("Frequenza di campionamento (Hz): 200", set(), (0.005,), (), ""),
            ("Unità: cm/s^2; numero di campioni: 800", {800}, (), ("cm/s^2",), ""),
            ("Abtastrate: 100 Hz, Einheit: m/s^2", set(), (0.01,), ("m/s^2",), ""),
            ("Anzahl der Werte 1200", {1200}, (), (), ""),
        ],
    )  # fmt: skip
    def test_statements(self, line, counts, intervals, units, peak):
        found = statements([line])
        assert (found.counts, found.units, found.peak[0]) == (frozenset(counts), units, peak)
        assert found.intervals == pytest.approx(intervals)

    @pytest.mark.parametrize(
        "line",
        [
            "Delta: 5.3 km", "EPICENTRAL DISTANCE DT 12 KM", "8 values per line",
            "POINTS PER LINE: 8", "NO DATA AFTER 300", "corner frequency 100 Hz",
            "time step of the response spectrum 12", "acceleration of station G12",
            "UNITS ARE SEC AND G/10", "COMPONENT 090, DEPTH 11 KM, MAGNITUDE 5.1",
        ],
    )  # fmt: skip
    def test_other_numbers_are_no_statements(self, line):
        found = statements([line])
        assert not (found.counts or found.intervals or found.units or found.peak[0])

    def test_quantity(self):
        assert statements(["VELOCITY IN CM/SEC"]).quantity == "velocity"
        assert statements(["ACC, VELOCITY", "DISPLACEMENT"]).quantity == "acceleration"


@pytest.mark.parametrize("name", every(2, CASES))
def test_right_values(file, name):
    case = CASES[name]
    records = read(file, case.text, case.units, **case.layout)
    values = np.atleast_2d(case.values)
    assert len(records) == len(values)
    for record, samples in zip(records, values, strict=True):
        assert record.dt == pytest.approx(case.dt, rel=1e-12)
        np.testing.assert_allclose(record.acceleration, case.unit * samples, rtol=1e-12, atol=1e-15)
    assert all(
        ("number of samples" in record.header_checks) == case.is_stated for record in records
    )


def test_peak_is_compared(file):
    content = CASES["network"].text
    assert "peak" in read(file, content)[0].header_checks
    peak = f"{F8[np.argmax(np.abs(F8))]:9.3f}"
    assert states(message(file, content.replace(peak, "  220.500")), "220.5 cm/s^2 ... 182")
    # The last decimal of the samples is a permitted difference.
    rounded = content.replace(peak, f"{GAL[np.argmax(np.abs(GAL))]:9.4f}")
    assert not [note for note in read(file, rounded)[0].notes if "peak" in note]


class TestQuestions:
    """Tables without sufficient evidence are refused with a question; each answer is accepted."""

    noise = np.round(np.random.default_rng(1).normal(size=(300, 4)), 4)

    def test_answers(self, file):
        content = table(*self.noise.T)
        facts = "line 1 ... 4 values per line ... `rows` ... `column`"
        assert states(message(file, content), facts)
        assert states(message(file, content, "g", step=0.01), facts)
        (rows,) = read(file, content, "m/s^2", step=0.01, rows=True)
        np.testing.assert_allclose(rows.acceleration, self.noise.ravel(), rtol=1e-12)
        (second,) = read(file, content, "m/s^2", step=0.01, column=2)
        np.testing.assert_allclose(second.acceleration, self.noise[:, 1], rtol=1e-12)

    def test_two_values_per_line(self, file):
        content = lines(F8[:1180], 2, "%10.2f")
        assert states(message(file, content, "gal", step=0.01), "2 values ... `rows` ... `column`")
        (record,) = read(file, content, "gal", step=0.01, rows=True)
        np.testing.assert_allclose(record.acceleration, 0.01 * F8[:1180], rtol=1e-12)

    def test_rows_without_interval_or_units(self, file):
        content = lines(F8, 8, "%10.2f")
        assert states(message(file, content), "each line continues ... `step`")
        assert states(message(file, content, step=0.01), "units")
        assert "`column`" not in message(file, content)

    def test_contradicting_answers(self, file):
        rows = lines(F8[:1184], 8, "%10.2f")
        assert states(message(file, rows, "gal", step=0.01, column=1), "`column` cannot ... remove")
        counted = COUNTED.format(1184) + rows
        assert states(message(file, counted, column=1), "`column` cannot ... 1184")
        timed = table(TIMES, G)
        named = text("t,N (g)", [f"{t:.2f},{a:.6f}" for t, a in zip(TIMES, G, strict=True)])
        for content in (timed, named):
            assert states(message(file, content, "g", rows=True), "`rows` contradicts")
        columns = CASES["columns by count"].text
        assert states(message(file, columns, rows=True), "`rows` contradicts ... 800 samples")
        assert states(message(file, columns), "3 columns ... 800 samples ... `column`")
        with pytest.raises(UsageError, match="cannot be combined"):
            TextLayout(rows=True, column="1")
        with pytest.raises(UsageError, match="`rows`"):
            TextLayout(rows=1)

    @pytest.mark.parametrize("name", sorted(set(SAMPLES) - {"TEXT"}))
    def test_rows_of_other_formats(self, file, name):
        found = message(file, SAMPLES[name][0](), rows=True)
        assert states(found, f"`rows` cannot be used with the file format {name}")

    def test_floors_are_not_rows(self, file):
        floors = [accelerogram(2000, 0.2)]
        for _ in range(4):
            floors.append(1.15 * np.convolve(floors[-1], np.ones(5) / 5, "same"))
        try:
            records = read(file, table(*np.round(floors, 5)), "g", step=0.01)
        except RecordError as error:
            assert states(str(error), "`rows` ... `column`")
        else:
            assert len(records) == 5

    def test_directory(self, file):
        """A table of numbers is a record of a directory, also if it cannot be read."""
        for content in (table(*self.noise.T), CASES["network"].text):
            file.write_text(content)
            assert other_content(file) == ""
        file.write_text("a table\n3 4\n1 2\n")
        assert other_content(file)


class TestFirstLine:
    """Numbers in a first line are never samples."""

    @pytest.mark.parametrize(
        ("first", "facts"),
        [
            ("1010 0.01\n", "line 1: '1010 0.01' ... 1000"),
            ("0.01 1010\n", "line 1: '0.01 1010' ... 1000"),
            ("1010\n0.01\n", "line 1: '1010' ... skip_lines=1"),
            ("0.01\n1010\n", "line 1: '0.01' ... skip_lines=1"),
            ("1010\n", "line 1: '1010' ... 1000 values ... skip_lines=1"),
            ("a motion\n1010 0.01\n", "line 2: '1010 0.01' ... 1000"),
        ],
    )
    @pytest.mark.parametrize("step", [None, 0.01])
    def test_contradictions_are_refused(self, file, first, facts, step):
        assert states(message(file, first + column(G), "g", step=step), facts)

    def test_answers(self, file):
        content = "0.010000\n" + column(G)
        for layout in ({}, {"step": 0.01}, {"skip_lines": 1, "step": 0.01}):
            assert read(file, content, "g", **layout)[0].acceleration.size == 1000
        assert states(message(file, content, "g", step=0.02), "0.01 s, which contradicts")
        (sample,) = read(file, content, "g", step=0.01, skip_lines=0)
        assert sample.acceleration.size == 1001
        # Numbers with few digits may be samples.
        content = "0.01\n" + column(np.round(100 * G[:300]) / 100, "%.2f")
        facts = "0.01 in line 1 ... skip_lines=1 ... skip_lines=0"
        assert states(message(file, content, "g", step=0.01), facts)

    def test_declared_interval_and_first_line(self, file):
        header = "# dt = 0.01 s, units = g\n"
        (record,) = read(file, header + "1000\n0.01\n" + column(G))
        assert (record.acceleration.size, record.dt) == (1000, 0.01)
        assert states(message(file, header + "1000\n0.02\n" + column(G)), "0.01 s and 0.02 s")

    def test_line_numbers_are_no_times(self, file):
        numbered = table(np.arange(1, 1001), G)
        assert states(message(file, numbered, "g"), "numbers the lines ... `step`")
        assert read(file, numbered, "g", step=0.02)[0].dt == 0.02
        assert read(file, numbered, "g", step=1)[0].dt == 1.0

    def test_pairs_of_times_and_values(self, file):
        pairs = np.stack((TIMES, G), axis=1).reshape(-1, 8)
        (record,) = read(file, table(*pairs.T), "m/s^2")
        assert record.dt == 0.01
        np.testing.assert_allclose(record.acceleration, G, atol=0.51e-5)


class TestOtherFiles:
    def test_times_with_a_different_last_step(self, file):
        late = TIMES.copy()
        late[-1] -= 0.004
        content = "MADE UP\nACCELERATION IN G\n" + table(late, G, form="%12.4f")
        assert states(message(file, content), "last interval ... 0.006 s ... 0.01 s")

    def test_spectra(self, file):
        content = (
            "RESPONSE AND FOURIER AMPLITUDE SPECTRA\nACCELERATION IN CM/SEC/SEC, 5 PERCENT\n"
            + lines(np.abs(F8), 8, "%10.3f")
        )
        for layout in ({}, {"step": 0.01}):
            found = message(file, content, **layout)
            assert states(found, "response and fourier amplitude spectra ... volume 1 or 2")

    def test_velocity_requires_its_units(self, file):
        content = "VELOCITY, NPTS: 1187\nDT: 0.01 SEC\n" + lines(F8, 8, "%10.2f")
        assert states(message(file, content, "g"), "velocity")
        (record,) = read(file, content, "cm/s")
        expected = moved(0.01 * np.array(F8), 0.01, "velocity").acceleration
        np.testing.assert_allclose(record.acceleration, expected, atol=1e-9)

    def test_several_units_are_not_used(self, file):
        content = "UNITS: G\nACCELERATION IN GAL\nNPTS: 1187\nDT: 0.01 SEC\n" + lines(
            F8, 8, "%10.2f"
        )
        assert states(message(file, content), "units")
        assert "several units" in "".join(read(file, content, "gal")[0].notes)

    def test_several_intervals_are_refused(self, file):
        content = COUNTED.format(1187) + "SAMPLING RATE: 200 HZ\n" + lines(F8, 8, "%10.2f")
        assert states(message(file, content), "several sampling intervals, 0.01 s and 0.005 s")

    @pytest.mark.parametrize(
        ("content", "facts"),
        [
            (
                "nodes and their coordinates\n"
                + table(np.arange(50), np.arange(50) ** 0.5, 5.0 - np.arange(50)),
                "equal steps",
            ),
            ("time drift\n" + table(TIMES, G), "`column` ... drift"),
            ("a poem\nof two lines\n", "unknown format"),
        ],
    )
    def test_other_tables_are_refused(self, file, content, facts):
        assert states(message(file, content, "g"), facts)


@pytest.mark.parametrize("mark", every(3, [b"\x1a\r\n", b"\x1a", b"\x1a\x1a"]))
@pytest.mark.parametrize("name", sorted(SAMPLES))
def test_end_mark_of_every_format(file, name, mark):
    for write in SAMPLES[name]:
        content = write().encode()
        units = "gal" if content[:1].isdigit() or name == "SACTEXT" else None
        expected = read(file, content, units)
        for record, other in zip(read(file, content + mark, units), expected, strict=True):
            np.testing.assert_array_equal(record.acceleration, other.acceleration)


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("seed", every(3, range(3)))
def test_random_tables(file, kind, seed):
    """`python tests/fuzz/random_tables.py` reads thousands."""
    assert outcome(kind, seed, file) != WRONG


STATED = [name for name, case in CASES.items() if case.is_stated]
"""Files that state the number of samples."""


def damaged(content):
    """Yield a name and a text for each kind of damage at several lines of numbers."""
    rows = content.split("\n")
    numbers = [i for i, row in enumerate(rows) if ROW.fullmatch(row) and row.count(".") > 1]
    numbers = numbers or [i for i, row in enumerate(rows) if ROW.fullmatch(row) and "." in row]
    for i in (numbers[0], numbers[1 % len(numbers)], numbers[len(numbers) // 2], numbers[-1]):
        before, row, after = rows[:i], rows[i], rows[i + 1 :]
        words = row.split()
        changes = {
            "file cut": before,
            "file cut within a line": [*before, row[: len(row) // 2]],
            "file cut within a number": [*before, row.rstrip()[:-1]],
            "line lost": [*before, *after],
            "line twice": [*before, row, row, *after],
            "number lost": [*before, "  ".join(words[:-1]), *after],
            "number twice": [*before, f"{row} {words[-1]}", *after],
            "text inside": [*before, "Page 2", *after],
            "letter": [*before, f"{row[:-4]}x{row[-3:]}", *after],
            "missing number": [*before, row.replace(words[-1], "nan"), *after],
            "asterisks": [*before, row.replace(words[-1], "*" * len(words[-1])), *after],
            "glued": [*before, re.sub(r"(?<=\d) +(?=[\d.])", "", row, count=1), *after],
            "signs glued": [*before, re.sub(r"(?<=\d) +(?=[-\d.])", "", row, count=1), *after],
        }
        for name, changed in changes.items():
            yield f"{name} {i}", "\n".join(changed)
    first = numbers[0]
    values = "\n".join(rows[first:])
    yield "blank line", "\n".join([*rows[: first + 5], "", *rows[first + 5 :]])
    yield "file joined", f"{content}{content}"
    yield "numbers joined", f"{content}{values}"
    yield "numbers joined after a blank line", f"{content}\n{values}"
    yield "numbers joined after text", f"{content}SECOND RECORD\n{values}"
    yield "part joined", content + "\n".join(rows[first : first + len(rows) // 3])
    yield "part before", "\n".join([*rows[:first], *rows[first : first + len(rows) // 4], values])


@pytest.mark.parametrize("name", every(10, STATED))
def test_damage_never_changes_a_stated_motion(file, name):
    case = CASES[name]
    expected = read(file, case.text, case.units, **case.layout)
    refused = 0
    for damage, content in damaged(case.text):
        try:
            records = read(file, content, case.units, **case.layout)
        except RecordError as error:
            refused += 1
            assert len(str(error).splitlines()) == 1
            continue
        assert len(records) == len(expected), damage
        for record, other in zip(records, expected, strict=True):
            np.testing.assert_array_equal(record.acceleration, other.acceleration, damage)
    assert refused > 20


@pytest.mark.parametrize("damage", ["lost", "text", "joined"])
def test_damage_of_the_stated_peak(file, damage):
    """Without a number of samples, the stated peak shows that the samples at the peak are lost."""
    peak = f"DT: 0.01 SEC\nACCELERATION UNIT: GAL\nPEAK VALUE: {np.max(np.abs(F8)):.2f}\n"
    rows = lines(F8, 8, "%10.2f").splitlines(keepends=True)
    assert read(file, peak + "".join(rows))[0].header_checks == ("peak",)
    at = int(np.argmax(np.abs(F8))) // 8
    content = {
        "lost": peak + "".join(rows[:at] + rows[at + 1 :]),
        "text": peak + "".join([*rows[:at], "Page 2\n", *rows[at:]]),
        "joined": 2 * (peak + "".join(rows)),
    }
    message(file, content[damage])


def pairs(times, values, per_line):
    words = [f"{t:.3f}, {a:.6f}" for t, a in zip(times, values, strict=True)]
    rows = [", ".join(words[i : i + per_line]) for i in range(0, len(words), per_line)]
    return "\n".join(rows) + "\n"


@pytest.mark.parametrize("above", ["", "*AMPLITUDE, NAME=EQ, DEFINITION=TABULAR\n"])
@pytest.mark.parametrize("count", [1000, 998, 997])
def test_pairs_end_with_a_shorter_line(file, above, count):
    """Finite element programs write four times and values in a line."""
    content = above + pairs(TIMES[:count], G[:count], 4)
    assert "units" in message(file, content)
    (record,) = read(file, content, "g")
    assert record.dt == pytest.approx(0.01)
    np.testing.assert_allclose(record.acceleration, 9.80665 * G[:count], rtol=1e-12)


class TestDecimalCommas:
    HEADER = "Pas de temps : 0,01 s\nUnité : m/s2\n"

    @pytest.mark.parametrize("separator", ["\n", "  ", ";"])
    def test_values(self, file, separator):
        """A comma without other separators is a decimal comma, not the end of a number."""
        width = 1 if separator == "\n" else 8
        words = [f"{value:.6f}".replace(".", ",") for value in G]
        rows = [separator.join(words[i : i + width]) for i in range(0, len(words), width)]
        (record,) = read(file, self.HEADER + "\n".join(rows) + "\n", rows=width > 1)
        assert record.dt == pytest.approx(0.01)
        np.testing.assert_allclose(record.acceleration, G, rtol=0, atol=1e-12)

    def test_times(self, file):
        rows = [f"{t:.2f} {a:.6f}" for t, a in zip(TIMES, G, strict=True)]
        content = "Zeit (s)  Beschleunigung (g)\n" + "\n".join(rows).replace(".", ",")
        (record,) = read(file, content)
        np.testing.assert_allclose(record.acceleration, 9.80665 * G, rtol=1e-12)

    @pytest.mark.parametrize("form", ["%.1f", "%.3f", "%.5e", "%g"])
    @pytest.mark.parametrize("encoding", ["latin-1", "utf-16"])
    def test_single_column(self, file, form, encoding):
        """Commas were separators if less than half of the rows had a zero after the comma or before
        it after a sign, or in a file in UTF-16."""
        words = [form % value for value in GAL]
        content = "Einheit: gal\nZeitschritt: 0,01 s\n" + "\n".join(words).replace(".", ",")
        (record,) = read(file, (content + "\n").encode(encoding))
        assert record.dt == 0.01
        np.testing.assert_allclose(record.acceleration, 0.01 * np.array(words, float), rtol=1e-12)

    def test_integers_keep_their_separator(self, file):
        """Pairs of integers without a zero after the comma are times in ms and counts."""
        counts = np.round(1e5 * G).astype(int)
        content = "t (ms),a (mm/s2)\n" + "".join(f"{10 * i},{a}\n" for i, a in enumerate(counts))
        (record,) = read(file, content)
        assert record.dt == pytest.approx(0.01)
        np.testing.assert_allclose(record.acceleration, 1e-3 * counts, rtol=1e-12)


@pytest.mark.parametrize("names", ["no,time,acc(gal)", "Index,Time (s),Acceleration (cm/s^2)"])
def test_line_numbers_before_the_times(file, names):
    rows = [f"{i},{t:.2f},{a:.6f}" for i, (t, a) in enumerate(zip(TIMES, G, strict=True), 1)]
    (record,) = read(file, names + "\n" + "\n".join(rows) + "\n")
    assert record.dt == pytest.approx(0.01)
    np.testing.assert_allclose(record.acceleration, 0.01 * G, rtol=1e-12)


def test_numbers_of_a_header_are_named_with_the_option_to_skip_them(file):
    content = "EL CENTRO\n2.5 0.01\n" + lines(G[:996], 12, "%9.6f")
    assert states(message(file, content), "line 2 ... skip_lines=2")
    (record,) = read(file, content, "g", step=0.01, skip_lines=2, rows=True)
    np.testing.assert_allclose(record.acceleration, 9.80665 * G[:996], rtol=1e-12)


@pytest.mark.parametrize("flag", ["1", "1.0", "0.01 1.0"])
def test_a_flag_in_front_of_rows_is_not_the_sampling_interval(file, flag):
    flag_and_step = flag if " " in flag else f"{flag} 0.01"
    content = f"EL CENTRO\n{flag_and_step}\n" + lines(G[:996], 12, "%9.6f")
    (record,) = read(file, content, "g")
    assert record.dt == pytest.approx(0.01) and record.acceleration.size == 996


@pytest.mark.parametrize(
    "header",
    [
        "# Tasa de muestreo: 100 Hz\n# Unidades: m/s/s\n# Número de muestras: 1000\n",
        "# Abtastrate = 100 Hz\n# Einheit = m/s^2\n# Anzahl der Werte = 1000\n",
    ],
)
def test_comments_in_other_languages(file, header):
    (record,) = read(file, header + column(G))
    assert record.dt == pytest.approx(0.01)
    np.testing.assert_allclose(record.acceleration, G, rtol=1e-12)
    assert "1000 samples" in message(file, header + column(G[:-3]))
