"""Names with control characters, numbers beyond the range of floats, models at the limits of what
is possible, and an interrupted replacement."""

import csv
import io
import json
import re
import zipfile
from pathlib import Path

import numpy as np
import pytest

import tdint as tdint_package
from cli.conftest import WITHOUT_LAW, change, write_record
from facts import states
from tdint.number_parsing import SMALLEST
from tdint.studies.campaign.chunks import Batch
from tdint.studies.ida.ida import STORE

# ---- Names

NAMES = (
    "line\nfeed", "carriage\r\nContent-Type: text\n\n", "esc\x1b[31m", "bidi\u202egnp",
    "a<script>b", 'quo"te,comma', "tab\tb", "-o", "=cmd()", "next\x85line", "isolate\u2066b",
)  # fmt: skip
CONTROLS = {*map(chr, range(32)), *map(chr, range(0x7F, 0xA0)), *"\u202e\u2066\u2028"} - {"\n"}


def check_text(text: str, *, page: bool = False) -> None:
    """Check that a text can be printed and that a page contains no element of a name."""
    assert not CONTROLS & set(text)
    assert not page or "a<script>b" not in text


def test_names_of_records_add_no_line_cell_or_element(folder, tdint):
    """CSV has one row per component and one cell per column; tables, messages, pages and JSON files
    have no control character. A line of a name in a message begins as all lines of the message."""
    files = [f"./{name}.mseed" for name in NAMES]
    for file in files:
        write_record(Path(file), "HNE")
    change("shaken.yaml", WITHOUT_LAW)
    every_name = "".join(NAMES).replace("/", "")
    write_record(Path(f"{every_name}.mseed"), "HNE")
    units = ("--units", "m/s^2")
    table = tdint("info", *files, *units, code=0)
    header, *body = csv.reader(io.StringIO(table.stdout))
    assert len(body) == len(files) and {len(row) for row in body} == {len(header)}
    for name, records in {"one": [f"./{every_name}.mseed"], "all": files}.items():
        page = f"{name}/r.html"
        tdint("run shaken.yaml", *records, *units, "-o", name, "--report", page, code=0)
        for file in Path(name).iterdir():
            if file.suffix != ".sqlite":
                check_text(file.read_text(), page=file.suffix == ".html")
        json.loads(Path(name, "summary.json").read_text())
    refused = [tdint("run shaken.yaml", f"./{name}.none", code=4).stderr for name in NAMES]
    for text in (table.stdout, table.stderr, *refused):
        check_text(text)
    lines = "".join(refused).splitlines()
    assert len(lines) >= len(NAMES) and all(line.startswith("Error: ") for line in lines)


@pytest.mark.parametrize("name", NAMES)
def test_names_of_models_add_no_line_cell_or_element(folder, tdint, name):
    """ASCII and C1 controls are refused; the others are written out."""
    model = {"name": name, "stories": [{"mass": 10, "height": 3, "stiffness": 8000}]}
    Path("named.yaml").write_text(json.dumps(model))
    is_refused = any(character < " " or character == "\x85" for character in name)
    result = tdint("modes named.yaml --report r.html", code=3 if is_refused else 0)
    check_text(result.output)
    if not is_refused:
        check_text(Path("r.html").read_text(), page=True)


# ---- Archives

ARCHIVES = {
    "outside": {"../../evil.mseed": b"MOTION"},
    "absolute": {"/evil.mseed": b"MOTION"},
    "zeros": {"zeros.mseed": bytes(2_000_000)},
    "other": {"passwd": b"root:secret-hash:20228\n"},
    "nothing": {},
}


@pytest.mark.parametrize("kind", [*ARCHIVES, "cut off", "not an archive"])
def test_archives_write_nothing_and_are_refused_in_one_line(folder, tdint, kind):
    """A member with a path outside the archive is read as if it were inside. Tried as a file and in
    a directory."""
    motion = Path("motion.mseed").read_bytes()
    content = io.BytesIO()
    with zipfile.ZipFile(content, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, data in ARCHIVES.get(kind, {"a.mseed": motion}).items():
            archive.writestr(name, motion if data == b"MOTION" else data)
    Path("in").mkdir()
    data = {"cut off": content.getvalue()[:-60], "not an archive": b"PK\x03\x04" + bytes(30)}
    Path("in/a.zip").write_bytes(data.get(kind, content.getvalue()))
    before = {*Path().rglob("*"), *Path("/").glob("evil*"), *Path("..").glob("evil*")}
    for name in ("in/a.zip", "in"):
        result = tdint("info", name, "--units", "m/s^2")
        assert result.exit_code == (0 if kind in ("outside", "absolute") else 4)
        errors = [line for line in result.stderr.splitlines() if line.startswith("Error")]
        assert len(errors) == (result.exit_code != 0)
        assert "secret" not in result.output and "Traceback" not in result.output
    assert {*Path().rglob("*"), *Path("/").glob("evil*"), *Path("..").glob("evil*")} == before


# ---- Numbers and models

TINY = "1e-400"


def test_numbers_below_the_range_of_floats_are_refused(folder, tdint):
    """1e-400 is not read as 0, as 1e-320 is not."""
    for number in (TINY, "1e-320"):
        Path("load.csv").write_text(f"time_s,f_N\n0,1\n1,{number}\n")
        Path("m.yaml").write_text(
            "stories: [{mass: 1, stiffness: 1}]\nanalysis: {duration: 1}\n"
            "excitation: {forces: [{floor: 1, file: load.csv, column: f_N}]}\n"
        )
        tdint.refused(f"load.csv:3 ... {number}", "check", "m.yaml", code=3)
        Path("m.yaml").write_text(f"stories: [{{mass: 1, stiffness: 1, dashpot: {number}}}]\n")
        tdint.refused("dashpot: must have an absolute value between", "check", "m.yaml", code=3)
        tdint.refused(number, "run", "shaken.yaml", "--scale", number)


def test_records_with_a_negligible_peak_are_refused(folder, tdint):
    """A peak of 0 is allowed; a peak below 1e-60 m/s^2 is an error of units or of the file."""
    for peak, code in ((1e-250, 4), (0.5 * SMALLEST, 4), (2.0 * SMALLEST, 0), (0.0, 0)):
        write_record("tiny.mseed", "HNE", peak=peak)
        result = tdint("info tiny.mseed --units m/s^2 -q", code=code)
        assert ("must be 0 or at least 1e-60 m/s^2" in result.stderr) == (code == 4)


@pytest.mark.parametrize("stories", [200, 1000])
def test_usual_values_of_very_tall_buildings_are_a_range(folder, tdint, stories):
    """The lower limit of the usual periods does not exceed the upper limit."""
    Path("tall.yaml").write_text(
        f"stories: [{{repeat: {stories}, mass: 1e5, height: 3, stiffness: 1e10}}]\n"
    )
    message = tdint("check tall.yaml", code=0).stderr
    assert stories < 1000 or "usual values are 0.03 s to 12 s" in message
    for line in message.splitlines():
        if "usual values are" in line and "at most" not in line:
            first, _, last = line.partition("usual values are ")[2].partition(" to ")
            assert float(first.split()[0]) < float(last.split()[0]), line


def test_a_story_crosses_more_corners_than_a_law_has(folder, tdint):
    """An element with 30 corners beside a bilinear one. Sum of both at the drift 0.06 m."""
    drift = 1e-3 * np.arange(1, 31)
    force = (1e5 * np.sqrt(drift / 1e-3)).round(1)
    points = [list(pair) for pair in zip(drift.tolist(), force.tolist(), strict=True)]
    elements = [
        {"name": "a", "type": "multilinear", "rule": "kinematic", "backbone": points}
        | {"last_slope": 1000.0},
        {"name": "b", "type": "bilinear", "stiffness": 1e8, "yield_force": 1e4, "hardening": 0.1},
    ]
    Path("m.yaml").write_text(
        json.dumps({"stories": [{"mass": 1e5, "height": 3, "elements": elements}]})
    )
    result = tdint("law m.yaml --drift 2% --points 3 -q", code=0)
    forces = [float(row["shear_N"]) for row in csv.DictReader(io.StringIO(result.stdout))]
    expected = force[-1] + 0.03 * 1000.0 + 1e4 + 0.1 * 1e8 * (0.06 - 1e4 / 1e8)
    assert max(forces) == pytest.approx(expected, rel=1e-9)


def test_modes_of_damping_beyond_the_stories(folder, tdint):
    """The error has no other error as its cause."""
    Path("m.yaml").write_text(
        "stories: [{mass: 1, stiffness: 1}]\ndamping: {rayleigh: {ratio: 5%, modes: [1, 3]}}\n"
    )
    result = tdint("--debug", "check", "m.yaml", code=3)
    assert "IndexError" not in result.stderr
    tdint.refused("modes ... 3", "check", "m.yaml", code=3)


def test_output_units_of_sensitivities(folder, tdint):
    """The table and the figure are in the requested units."""
    line = (
        "sensitivity shaken.yaml motion.mseed --component HNE --units m/s^2 "
        "--vary mass_factor=0.9:1.1"
    )
    metric = list(csv.DictReader(io.StringIO(tdint(line, code=0).stdout)))
    result = tdint(f"{line} --output-units in --plot=f.svg", code=0)
    inches = list(csv.DictReader(io.StringIO(result.stdout)))
    assert {row["unit"] for row in metric} >= {"m", "N"}
    for before, after in zip(metric, inches, strict=True):
        is_length = before["unit"].startswith("m")
        assert after["unit"] == before["unit"].replace("m", "in")
        for name in ("at_low", "as_it_is", "at_high"):
            factor = 0.0254 if is_length else 1.0
            assert factor * float(after[name]) == pytest.approx(float(before[name]), rel=1e-10)
    texts = re.findall("<text>(.*?)</text>", Path("f.svg").read_text(), re.DOTALL)
    assert any(re.search(r"\bin\b", text) for text in texts)
    assert not any(re.search(r"[( ]m(\)|$)", text) for text in texts)


# ---- Interruption


def test_an_interrupted_ida_keeps_the_earlier_study(folder, tdint, monkeypatch):
    """Store, tables and description remain those of the earlier study until the new one is
    complete, and the next call gives the files of a new study."""
    call = "ida shaken.yaml motion.mseed other.mseed --component HNE --units m/s^2 --max-im 1g -q"
    call += " --precision 40% --jobs 1"
    tdint(call, "-o", "out", code=0)

    def files(folder):
        return {
            file.name: file.read_bytes()
            for file in Path(folder).iterdir()
            if file.suffix in (".csv", ".json") or file.name == STORE
        }

    earlier = files("out")
    assert sorted(earlier) == sorted(
        ["ida.csv", "capacities.csv", "fractiles.csv", "ida.json", STORE]
    )
    text = Path("shaken.yaml").read_text()
    Path("shaken.yaml").write_text(text.replace("stiffness: 8000", "stiffness: 9000"))
    original, calls = Batch.results, []

    def interrupted(batch, *arguments, **options):
        calls.append(batch)
        if len(calls) == 2:
            raise KeyboardInterrupt
        return original(batch, *arguments, **options)

    with monkeypatch.context() as patch:
        patch.setattr(Batch, "results", interrupted)
        tdint(call, "-o", "out", "--overwrite", code=130)
    assert len(calls) >= 2 and files("out") == earlier
    tdint(call, "-o", "out", "--overwrite", code=0)
    tdint(call, "-o", "new", code=0)
    tables = {name for name in earlier if name.endswith(".csv")}
    now, new = files("out"), files("new")
    assert {name: now[name] for name in tables} == {name: new[name] for name in tables}
    assert all(now[name] != earlier[name] for name in earlier)
    assert not list(Path("out").glob("*.new")) and states("".join(sorted(now)), "csv")


def test_a_wrong_energy_balance_is_an_error(folder, tdint, monkeypatch):
    """A run without a collapse whose imbalance reaches the input energy ends with code 5; the
    imbalance of this run is larger than the limit that is set here."""
    call = ("run", "shaken.yaml", "--dt", "0.01", "--no-check", "-q")
    tdint(*call, code=0)
    monkeypatch.setattr("tdint.response.runs.case._WRONG_BALANCE", 1e-9)
    message = tdint(*call, code=5).stderr
    assert states(message, "the final energy is ... times the input energy")


@pytest.mark.parametrize(
    ("error", "expected"), [(0.5, False), (1.01, True), (-1.01, True), (np.nan, True)]
)
def test_imbalances_of_either_sign_above_the_input_energy_are_wrong(folder, error, expected):
    case = tdint_package.prepare("shaken.yaml")
    assert case._has_diverged(error, is_collapse=False) == expected
