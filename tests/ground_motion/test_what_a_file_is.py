"""Which files are ground motions: tables of other quantities, first lines, header lines, spellings
of numbers and units, and the files of directories."""

import json
import zipfile
from pathlib import Path

import numpy as np
import pytest

from facts import states
from tdint.errors import RecordError
from tdint.ground_motion.choice import RecordChoice, TextLayout
from tdint.ground_motion.reading.read import read_records
from tdint.ground_motion.reading.suites import read_suite
from tdint.units import STANDARD_GRAVITY

DT = 0.01
T = DT * np.arange(600)
A = np.round(0.25 * np.sin(11.0 * T) * np.exp(-(((T - 2.5) / 1.3) ** 2)), 5)
B = np.round(0.2 * np.sin(7.0 * T + 0.3) * np.exp(-T), 5)
C = np.round(0.1 * np.sin(17.0 * T) * np.exp(-T / 2.0), 5)
TOTAL = np.round(np.sqrt(A**2 + B**2 + C**2), 5)
PEAK = float(np.max(np.abs(A)))
PULSE = 0.4 * np.sin(np.pi * T[:121] / 1.2)


def column(values, form="%.5f"):
    return "".join(f"{form % value}\n" for value in values)


def table(*columns, names="", mark=",", forms=("%.2f", *(["%.5f"] * 8))):
    rows = zip(*columns, strict=True)
    lines = [mark.join(f % v for f, v in zip(forms, row, strict=False)) for row in rows]
    return "\n".join([*([names] if names else []), *lines, ""])


def read(folder, content, units=None, **layout):
    file = folder / "a.txt"
    file.write_text(content)
    return read_records(file, units=units, layout=TextLayout(**layout))


def message(folder, content, units=None, **layout):
    with pytest.raises(RecordError) as error:
        read(folder, content, units, **layout)
    return str(error.value)


def is_right(folder, content, units=None, size=600, peak=PEAK * STANDARD_GRAVITY, **layout):
    """Check a single motion with the samples A, and return it."""
    (record,) = read(folder, content, units, **layout)
    assert (record.acceleration.size, record.dt) == (size, pytest.approx(DT, rel=1e-12))
    assert record.pga == pytest.approx(peak, rel=2e-4)
    return record


PERIODS = np.geomspace(0.01, 10.0, 60)
SA = 0.6 * np.exp(-PERIODS / 2.0) + 0.1
NO_MOTIONS = {
    "periods": (table(PERIODS, SA, SA, mark=" ", forms=["%.4f"] * 3), {}, "periods ... one_sided"),
    "frequencies": (table(T, TOTAL, mark="\t"), {}, "frequencies ... one_sided"),
    "T": (table(T, TOTAL, names="T (s);A (g)", mark=";"), {}, "periods ... one_sided"),
    "Arias": (
        table(T, np.cumsum(A**2), names="Time [s],Arias intensity [m/s]"),
        {"column": "Arias intensity [m/s]"},
        "'Arias intensity [m/s]' states ... not a ground motion",
    ),
    "Ia": (table(T, np.cumsum(A**2), names="time,Ia (m/s)"), {}, "Ia (m/s) ... not a ground"),
    "CAV": (table(T, np.cumsum(TOTAL), names="Time (s),CAV (m/s)"), {}, "CAV ... not a ground"),
    "force": (table(T, A, B, names="Time (s),Force (kN),Temp [C]"), {}, "Force (kN), Temp [C]"),
    "total": (
        table(T, A, B, C, TOTAL, names="t (s),X (g),Y (g),Z (g),Total (g)"),
        {"column": "Total"},
        "'Total (g)' is a resultant ... X (g), Y (g), Z (g)",
    ),
}


@pytest.mark.parametrize("name", NO_MOTIONS)
def test_other_quantities_are_refused(tmp_path, name):
    content, layout, facts = NO_MOTIONS[name]
    units = None if "(" in content[:20] or "[" in content[:20] else "g"
    assert states(message(tmp_path, content, units, **layout), facts)


@pytest.mark.parametrize("name", ["Total", "Resultant", "abs", "A"])
def test_resultant_is_left_out_with_a_note(tmp_path, name):
    content = table(T, A, B, C, TOTAL, names=f"Time (s),X (g),Y (g),Z (g),{name} (g)")
    records = read(tmp_path, content)
    assert [record.component for record in records] == ["X", "Y", "Z"]
    assert any(f"not read: {name} (g)" in note for note in records[0].notes)
    # The total acceleration of a floor has both signs.
    assert len(read(tmp_path, table(T, A, B, names=f"Time (s),X (g),{name} (g)"))) == 2


@pytest.mark.parametrize("first", ["index", "Sample", "No.", "n"])
@pytest.mark.parametrize("others", ["X (m/s^2),Y (m/s^2)", "a_x[m/s2],a_y[m/s2]"])
def test_first_column_numbers_the_lines(tmp_path, first, others):
    content = table(
        np.arange(600.0), A, B, names=f"{first},{others}", forms=["%.0f", "%.5f", "%.5f"]
    )
    records = read(tmp_path, content, step=DT)
    assert [record.component for record in records] == ["X", "Y"]
    np.testing.assert_allclose(records[0].acceleration, A, atol=1e-5)
    assert "numbers the lines" in message(tmp_path, content)


def test_message_never_proposes_another_quantity(tmp_path):
    content = table(T, A, np.cumsum(A**2), names="Time,A1 drift,Arias (m/s)")
    assert "Arias" not in message(tmp_path, content, "g")


def test_samples_of_one_sign(tmp_path):
    named = table(T[:121], PULSE, names="Time (s),Acceleration (g)")
    (record,) = read(tmp_path, named)
    assert any("below zero" in warning for warning in record.warnings)
    (record,) = read(tmp_path, named, one_sided=True)
    assert not record.warnings
    unnamed = table(T[:121], PULSE)
    assert "one_sided" in message(tmp_path, unnamed, "g")
    assert read(tmp_path, unnamed, "g", one_sided=True)[0].acceleration.size == 121
    negative = column(-0.1 - PULSE[1:-1])
    assert "one_sided" in message(tmp_path, negative, "g", step=DT)
    (record,) = read(tmp_path, f"# dt = {DT} s, units = g\n{negative}")
    assert any("none is above" in warning for warning in record.warnings)


READ_FIRST_LINES = {
    "count": "600\n",
    "count in exponents": "6.0000E+02\n1.0000E-02\n",
    "count, factor, step": "600\n9.81\n0.01\n",
    "count and coordinates": "42.76\n142.13\n600\n",
    "count and peak": f"600\n{PEAK:.5f}\n",
    "factor and specified step": "1.5\n0.01\n",
    "specified step and factor": "0.01\n1.5\n",
    "small factor and specified step": "0.001\n0.01\n",
}
DOUBTFUL = {
    "peak": (f"{PEAK:.5f}\n", 1),
    "negative peak": (f"{-PEAK:.5f}\n", 1),
    "factor": ("9.81\n", 1),
    "coordinates": ("42.76\n142.13\n", 2),
    "factor and another step": ("1.5\n0.02\n", 2),
}


@pytest.mark.parametrize("name", READ_FIRST_LINES)
def test_parameters_are_no_samples(tmp_path, name):
    is_right(tmp_path, READ_FIRST_LINES[name] + column(A), "g", step=DT)


@pytest.mark.parametrize("name", DOUBTFUL)
def test_doubtful_first_lines_are_a_question(tmp_path, name):
    first, lines = DOUBTFUL[name]
    content = first + column(A)
    found = message(tmp_path, content, "g", step=DT)
    assert states(found, f"line {lines} ... `skip_lines={lines}` ... `skip_lines=0`")
    is_right(tmp_path, content, "g", step=DT, skip_lines=lines)
    (record,) = read(tmp_path, content, "g", step=DT, skip_lines=0)
    assert record.acceleration.size == 600 + lines


@pytest.mark.parametrize(
    ("first", "lines"), [("42.76,142.13", 1), ("-12.5,-77.0", 1), ("0.5,2\n42.76,142.13", 2)]
)
def test_lines_that_break_equal_times_are_a_question(tmp_path, first, lines):
    content = f"{first}\n{table(T, A)}"
    assert f"`skip_lines={lines}`" in message(tmp_path, content, "g", step=DT)
    is_right(tmp_path, content, "g", skip_lines=lines)
    is_right(tmp_path, f"{first}\n600\n{table(T, A)}", "g")


@pytest.mark.parametrize(
    "samples", [0.3 * np.cos(5.0 * T), 0.3 * np.exp(-T) * np.cos(9.0 * T)], ids=["cos", "decay"]
)
def test_true_first_samples(tmp_path, samples):
    (record,) = read(tmp_path, column(samples), "g", step=DT)
    assert record.acceleration.size == 600
    # A stated number of samples confirms the first sample, which is otherwise doubtful.
    (record,) = read(tmp_path, f"NPTS = 600\n9.81\n{column(A[1:])}", "g", step=DT)
    assert record.acceleration.size == 600


HEADERS = {
    "cm/s2; dt = 0.01": 0.01,
    "dt=0.01, gal": 0.01,
    "dt=0.01 s g": STANDARD_GRAVITY,
    "# g, dt = 0.01": STANDARD_GRAVITY,
    "[m/s^2] dt: 0.01 s": 1.0,
    "DT = 0.01 SEC   CM/SEC/SEC": 0.01,
    "! in/s2, dt=.01": 0.0254,
    "Sampling rate: 100 Hz; mm/s2": 0.001,
    "# acceleration in m/s2 (g = 9.81 m/s2)\n# dt=0.01": 1.0,
}


@pytest.mark.parametrize("header", HEADERS)
def test_header_with_a_unit(tmp_path, header):
    samples = A * STANDARD_GRAVITY / HEADERS[header]
    for content in (column(samples), table(T, samples, mark="\t")):
        is_right(tmp_path, f"{header}\n{content}")
        found = message(tmp_path, f"{header}\n{content}", "ft/s^2")
        assert states(found, "the file states its units ... ft/s^2 is specified")


@pytest.mark.parametrize("header", ["# g = 9.81 m/s2", "PGA 245 gal", "noise 0.1 cm/s2"])
def test_unit_of_another_value(tmp_path, header):
    assert "does not state the units" in message(tmp_path, f"{header}; dt = 0.01\n{column(A)}")


@pytest.mark.parametrize("statement", ["dt = 0.01;", "fs = 100;"])
def test_statement_below_a_list(tmp_path, statement):
    values = " ; ".join(f"{value:.5f}" for value in A)
    is_right(tmp_path, f"a = [{values}];\n{statement}\n", "g")
    is_right(tmp_path, f"a = [\n{column(A)}];\n{statement}\n", "g")


@pytest.mark.parametrize("mark", [",", ";", "\t", " "])
@pytest.mark.parametrize("names", [("", ""), ("Time (s)", "Acc (g)")])
def test_table_of_long_lines(tmp_path, mark, names):
    if mark == " " and names[0]:
        names = ("t", "a")
    rows = [
        [*filter(None, [name]), *(f"{v:.5f}" for v in row)]
        for name, row in zip(names, (T, A), strict=True)
    ]
    content = "\n".join(map(mark.join, rows)) + "\n"
    record = is_right(tmp_path, content, None if "(" in content else "g")
    assert any("lines are the columns" in note for note in record.notes)


def test_times_that_cannot_be_seconds(tmp_path):
    for factor, unit in ((1000, "ms"), (1_000_000, "us")):
        content = table(factor * T, A, forms=["%d", "%.5f"])
        assert states(
            message(tmp_path, content, "g"), f"times increase by ... in {unit}, specify `step="
        )
        record = is_right(tmp_path, content, "g", step=DT)
        assert any(f"times are read in {unit}" in note for note in record.notes)


def test_unequal_times_name_the_remedy(tmp_path):
    content = table(T + 1e-4 * np.arange(600) ** 1.5, A, forms=["%.4f", "%.5f"])
    assert "numpy.interp" in message(tmp_path, content, "g")


NUMBERS = {
    "minus": lambda t, a: f"{t:.2f};{a:.5f}".replace("-", "\N{MINUS SIGN}"),
    "minus and comma": lambda t, a: f"{t:.2f};{a:.5f}".replace("-", "\N{MINUS SIGN}").replace(
        ".", ","
    ),
    "quoted decimal commas": lambda t, a: f'"{t:.2f}";"{a:.5f}"'.replace(".", ",").replace(
        ";", ","
    ),
    "one quoted decimal comma": lambda t, a: f'{t:.2f},"' + f'{a:.5f}"'.replace(".", ","),
}


@pytest.mark.parametrize("name", NUMBERS)
def test_forms_of_numbers(tmp_path, name):
    mark = "," if "quoted" in name else ";"
    rows = "\n".join(NUMBERS[name](t, a) for t, a in zip(T, A, strict=True))
    is_right(tmp_path, f"t (s){mark}a (g)\n{rows}\n")


@pytest.mark.parametrize("form", ['{:.2f},"{:,.1f}"', "{:.2f};{:,.1f}", "{:.2f}\t{:,.1f}"])
def test_separators_of_thousands(tmp_path, form):
    rows = "\n".join(form.format(t, 9806.65 * a) for t, a in zip(T, A, strict=True))
    assert ",2" in rows
    is_right(tmp_path, f"Time (s){form[6]}Acc (mm/s2)\n{rows}\n")


@pytest.mark.parametrize("unit", ["10^-3 g", "x10^-3 g", "10**-3 g", "1e-3 g", "0.001 g"])
def test_power_of_ten_in_a_unit(tmp_path, unit):
    is_right(tmp_path, table(T, 1000.0 * A, names=f"Time (s),Acc ({unit})"))


ROW = " ".join(f"{value:.5f}" for value in A)
UNREADABLE = {
    "tabs": ROW.replace(" ", "\t"),
    "decimal commas": ROW.replace(".", ",").replace(" ", ";"),
    "pipes": "\n".join(f"{t:.2f}|{a:.5f}" for t, a in zip(T, A, strict=True)),
    "colons": "\n".join(f"{t:.2f}:{a:.5f}" for t, a in zip(T, A, strict=True)),
    "assignments": "\n".join(f"t={t:.2f} a={a:.5f}" for t, a in zip(T, A, strict=True)),
    "units": "\n".join(f"{a:.5f} g" for a in A),
    "long rows": "\n".join(",".join(f"{v:.5f}" for v in row) for row in A.reshape(3, -1)),
    "tags": "\n".join(f"<v>{a:.5f}</v>" for a in A),
    "JSON lines": "\n".join(
        json.dumps({"t": t, "a": a}) for t, a in zip(T.tolist(), A.tolist(), strict=True)
    ),
    "JSON": json.dumps({"dt": DT, "a": A.tolist()}),
    "binary": A.astype("<f4").tobytes(),
    "text within": column(A[:300]) + "pause\n" + column(A[300:]),
}
FLATFILE = "RSN,EQID,Earthquake Name,Station Name,Magnitude,Rrup (km),PGA (g)\n" + "".join(
    f'{i},00{i},"Town, North",Station {i},6.{i % 9},{i}.5,0.{i}\n' for i in range(1, 150)
)
LISTED = {
    "flatfile": (FLATFILE, "table of metadata"),
    "flatfile below a title": (f"Flatfile\n\n{FLATFILE}", "table of metadata"),
    "flatfile with semicolons": (
        FLATFILE.replace('"Town, North"', "Town").replace(",", ";"),
        "table of metadata",
    ),
    "notes": ("Sensor 5 was moved by 2.5 m on 3 May 2021 at 10:30.\n" * 30, "no numbers"),
    "parameters": ("".join(f"Parameter {i}: {i}.5 km\n" for i in range(40)), "no numbers"),
    "station": (json.dumps({f"key {i}": i / 7.0 for i in range(30)}), "no numbers"),
}


def suite_with(folder: Path, content: str | bytes, is_archive: bool):
    """Read a directory or an archive with a ground motion and the file b.csv."""
    files = {"a.txt": f"# dt = 0.01 s, units = g\n{column(A)}".encode()}
    files["b.csv"] = content if isinstance(content, bytes) else content.encode()
    if is_archive:
        with zipfile.ZipFile(folder / "all.zip", "w") as archive:
            for name, data in files.items():
                archive.writestr(name, data)
        return read_suite([str(folder / "all.zip")], RecordChoice())
    for name, data in files.items():
        (folder / name).write_bytes(data)
    return read_suite([str(folder)], RecordChoice())


@pytest.mark.parametrize("is_archive", [False, True])
@pytest.mark.parametrize("name", UNREADABLE)
def test_no_file_with_numbers_is_lost(tmp_path, name, is_archive):
    (failure,) = suite_with(tmp_path, UNREADABLE[name], is_archive).failures
    assert "b.csv" in str(failure)


@pytest.mark.parametrize("is_archive", [False, True])
@pytest.mark.parametrize("name", LISTED)
def test_listed_files(tmp_path, name, is_archive):
    content, reason = LISTED[name]
    suite = suite_with(tmp_path, content, is_archive)
    assert not suite.failures
    (record,) = suite.records
    assert any(f"b.csv ({reason})" in note for note in (*suite.notes, *record.notes))


def test_tar_archive_in_an_archive(tmp_path):
    data = bytearray(1024)
    data[257:262] = b"ustar"
    (failure,) = suite_with(tmp_path, bytes(data), is_archive=True).failures
    assert states(str(failure), "b.csv: ... tar archive; extract its files")
