"""`tdint compare` with a recording that consists of computed responses with added noise."""

import json
import re
from pathlib import Path

import numpy as np
import pytest

from cli.conftest import Command, made_once
from csv_rows import rows
from tdint.model.config.model_file import load_model
from tdint.studies.recordings import fit as fitting

MODEL = """\
name: frame
stories:
  - {mass: 1.0, stiffness: 900}
  - {mass: 1.0, stiffness: 700}
damping: {modal: [0.02, 0.03]}
excitation: {record: {file: base.txt}}
"""
RECORDED = """\
base: {file: recorded.csv, column: ground_acceleration_m_s2}
floors:
  1: {file: recorded.csv, column: floor_1_displacement_m, quantity: displacement}
  roof: {file: recorded.csv, column: floor_2_absolute_acceleration_m_s2, quantity: acceleration}
band: [0.4, 15]
"""
SAMPLES = 500
FIT = ("--recorded", "fitted.yaml", "--fit", "stiffness", "--blind", "blind.yaml")
"""Options of a fit to the roof; the first floor is not used in the fit (blind)."""


FITS = []
"""Result of the fit in the fixture `recorded`."""


@pytest.fixture(scope="module")
def recorded(tmp_path_factory):
    """Directory with a model, a base motion, and a response history of the model with noise in the
    roof acceleration."""
    return made_once(tmp_path_factory, write_recorded)


def write_recorded(folder):
    generator = np.random.default_rng(4)
    base = generator.normal(size=SAMPLES) * np.hanning(SAMPLES)
    np.savetxt("base.txt", base, header="dt = 0.02 s, units = m/s^2")
    Path("model.yaml").write_text(MODEL)
    Path("recorded.yaml").write_text(RECORDED)
    Command()("run", "model.yaml", "--method", "exact", "--history", "-o", "out", code=0)
    names = Path("out/history.csv").read_text().partition("\n")[0].split(",")
    table = np.loadtxt("out/history.csv", delimiter=",", skiprows=1)
    roof = names.index("floor_2_absolute_acceleration_m_s2")
    table[:, roof] += 0.5 + 0.2 * np.std(table[:, roof]) * generator.normal(size=SAMPLES)
    np.savetxt("recorded.csv", table, "%.12g", ",", header=",".join(names), comments="")
    for name, floor in (("fitted", "  1:"), ("blind", "  roof:")):
        lines = [line for line in RECORDED.splitlines() if not line.startswith((floor, "band:"))]
        Path(f"{name}.yaml").write_text("\n".join(lines))
    Path("off.yaml").write_text(MODEL.replace("900", "1100").replace("700", "600"))
    fit = fitting.fit
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(fitting, "fit", lambda *arguments: FITS.append(fit(*arguments)) or FITS[-1])
        Command()("compare", "off.yaml", *FIT, "-o", "si/table.csv", code=0)


@pytest.mark.long
def test_table_files_and_requirements(recorded, tdint, tmp_path, drawn):
    out = tmp_path / "deep" / "out"
    files = (recorded / "model.yaml", "--recorded", recorded / "recorded.yaml")
    tdint(
        "compare",
        *files,
        "-o",
        out,
        "--plot",
        "--require",
        "correlation=0.95,peak_ratio=0.8",
        code=0,
    )
    names = ["comparison.csv", "comparison.png", "spectra.csv", "summary.json"]
    assert sorted(file.name for file in out.iterdir()) == names
    first, roof = rows(out / "comparison.csv")
    assert list(first) == ["floor", "quantity", "correlation", "peak_ratio", "rms_difference"]
    assert (first["quantity"], roof["floor"], roof["quantity"]) == (
        "displacement",
        "2",
        "acceleration",
    )
    assert float(first["correlation"]) > 0.999 > float(roof["correlation"]) > 0.95
    assert list(rows(out / "spectra.csv")[0]) == [
        "floor", "period_s", "computed_sa_m_s2", "recorded_sa_m_s2",
    ]  # fmt: skip
    summary = json.loads((out / "summary.json").read_text())
    assert summary["schema"] == {"name": "tdint compare", "version": 1}
    assert summary["events"][0]["floors"][1]["correlation"] == pytest.approx(
        float(roof["correlation"])
    )
    inputs = [str(recorded / name) for name in ("model.yaml", "recorded.yaml", "recorded.csv")]
    assert [entry["file"] for entry in summary["inputs"]] == inputs
    again = tdint("compare", *files, "--require", "correlation=0.999", code=5)
    shown = f"{float(roof['correlation']):.4g}"
    assert f"floor 2: correlation is {shown}, required is at least 0.999" in again.stderr
    assert again.stdout == (out / "comparison.csv").read_text()


@pytest.mark.long
def test_fitted_and_blind_floors(recorded):
    """The stem of the table is the prefix of all other files."""
    si = recorded / "si"
    roof, first = rows(si / "table.csv")
    assert (roof["floor"], roof["recorded"]) == ("2", "fitted.yaml")
    assert (first["floor"], first["recorded"]) == ("1", "blind.yaml")
    assert float(first["correlation"]) > 0.99
    fitted = rows(si / "table-fit.csv")
    assert [(row["parameter"], row["place"]) for row in fitted] == [
        ("stiffness_N_m", "1"),
        ("stiffness_N_m", "2"),
    ]
    assert [float(row["start"]) for row in fitted] == [1100.0, 600.0]
    assert [float(row["fitted"]) for row in fitted] == pytest.approx([900.0, 700.0], rel=0.01)
    written = {
        "table.csv", "table-spectra.csv", "table-fit.csv", "table-fitted.yaml",
        "table-summary.json",
    }  # fmt: skip
    assert {file.name for file in si.iterdir()} == written


@pytest.mark.long
def test_a_fitted_model_is_written_with_its_comments(recorded, tdint, tmp_path, monkeypatch):
    """The written model can be run from its directory and has the parameters of fit.csv; all other
    lines are unchanged."""
    entries = (
        "  # from the ground up\n  - {repeat: 2, mass: 1.0, stiffness: 800}  # equal at first\n"
    )
    model = re.sub("  - .*\n  - .*\n", entries, MODEL)
    model = re.sub("damping: .*", "damping: {modal: 4%}  # d", model)
    (recorded / "equal.yaml").write_text(model)
    monkeypatch.chdir(recorded)
    # The first floor has no noise.
    floor = [line for line in RECORDED.splitlines() if not line.startswith(("  roof:", "band:"))]
    Path("first.yaml").write_text("\n".join(floor))
    recording = ("--recorded", "first.yaml")
    tdint(
        "compare equal.yaml",
        *recording,
        "--fit",
        "stiffness,damping",
        "-o",
        tmp_path / "out",
        code=0,
    )
    file = tmp_path / "out" / "fitted.yaml"
    written = load_model(file)
    fitted = [float(row["fitted"]) for row in rows(tmp_path / "out" / "fit.csv")]
    assert [story.stiffness for story in written.stories] == pytest.approx(fitted[:2], rel=1e-11)
    assert written.damping.ratios == pytest.approx(fitted[2:], rel=1e-11)
    assert Path(written.excitation.record.file).samefile("base.txt")
    text = file.read_text()
    assert text.startswith("# equal.yaml with stiffness,damping fitted to first.yaml\n")
    assert all(
        comment in text for comment in ("# from the ground up\n", "# equal at first\n", "# d\n")
    )
    tdint("compare", file, *recording, "-o", tmp_path / "again", code=0)
    pairs = zip(
        *(rows(tmp_path / name / "comparison.csv") for name in ("again", "out")), strict=True
    )
    for row, other in pairs:
        assert float(row["rms_difference"]) == pytest.approx(
            float(other["rms_difference"]), rel=1e-8
        )
    plain = [
        line for line in model.splitlines() if "stiffness" not in line and "damping" not in line
    ]
    assert [line for line in plain if "base.txt" not in line] == [
        line for line in text.splitlines() if line in plain and "base.txt" not in line
    ]


def test_output_units_of_the_command_line_and_of_the_model(recorded, tdint, tmp_path, monkeypatch):
    """Floor spectra, fitted stiffnesses with their column names, summary and messages are
    converted. The fit is taken from the fixture `recorded`."""
    monkeypatch.chdir(recorded)
    monkeypatch.setattr(fitting, "fit", lambda *_: FITS[0])
    Path("named.yaml").write_text(Path("off.yaml").read_text() + "output_units: kip, in, g\n")
    named = tdint("compare", "named.yaml", *FIT, "-o", tmp_path / "table.csv", code=0)
    assert " g; exact" in named.stderr and "stiffness_kip_in 1 " in named.stderr
    for name, columns, factor in (
        ("table-spectra", ("computed_sa_m_s2", "recorded_sa_m_s2"), 9.80665),
        ("table-fit", ("start", "fitted", "standard_error"), 4448.2216152605 / 0.0254),
    ):
        si, us = (rows(folder / f"{name}.csv") for folder in (recorded / "si", tmp_path))
        for row, other in zip(si, us, strict=True):
            for column in columns:
                changed = float(other[column.replace("_m_s2", "_g")])
                assert changed * factor == pytest.approx(float(row[column]), rel=1e-10)
    assert [row["parameter"] for row in us] == ["stiffness_kip_in"] * 2
    us_summary, si_summary = (
        json.loads((folder / "table-summary.json").read_text())
        for folder in (tmp_path, recorded / "si")
    )
    assert us_summary["events"][0]["base"]["pga_g"] * 9.80665 == pytest.approx(
        si_summary["events"][0]["base"]["pga_m_s2"]
    )
    assert [value["parameter"] for value in us_summary["fit"]["values"]] == ["stiffness_kip_in"] * 2
    options = (
        "--recorded", "recorded.yaml", "--output-units", "kip,in,g", "-o",
        tmp_path / "given",
    )  # fmt: skip
    tdint("compare", "model.yaml", *options, code=0)
    assert list(rows(tmp_path / "given" / "spectra.csv")[0])[2:] == [
        "computed_sa_g",
        "recorded_sa_g",
    ]


def test_all_errors_of_a_recording_file_are_reported_at_once(recorded, tdint):
    (recorded / "bad.yaml").write_text(
        "bas: x\n"
        "base: {file: a, column: b, component: c, quantity: displacment}\n"
        "floors:\n"
        "  2: {file: a, sign: 2}\n"
        "  roof: {fil: a}\n"
        "  7: {file: b, units: cm, quantity: acceleration}\n"
        "band: [25, 0.5]\n"
        "window: [2]\n"
        "shift: soon\n"
    )
    result = tdint("compare", recorded / "model.yaml", "--recorded", recorded / "bad.yaml", code=3)
    faults = [line.partition("bad.yaml:")[2].split(": ")[:2] for line in result.stderr.splitlines()]
    assert [" ".join(fault) for fault in faults] == [
        "1:1 bas", "2:25 base.column", "2:52 base.quantity", "4:22 floors.2.sign",
        "5:9 floors.roof", "5:10 floors.roof.fil", "6:6 floors.7", "6:23 floors.7.units",
        "7:7 band", "8:9 window", "9:8 shift",
    ]  # fmt: skip
    for message in (
        "did you mean 'base'?",
        "did you mean 'displacement'?",
        "floor 2 is specified twice",
        "from 1 to 2",
    ):
        assert message in result.stderr


@pytest.mark.parametrize(
    ("arguments", "code", "message"),
    [
        (["--require", "corelation=1"], 2, "did you mean 'correlation'?"),
        (["--require", "correlation=much"], 2, "correlation must be a positive number"),
        (["--plot"], 2, "--plot without a file name requires -o"),
        (["-o", "{folder}/recorded.csv"], 6, "recorded.csv"),
        (["--dt", "0.04"], 2, "sampling interval of the recording"),
    ],
)
def test_invalid_arguments_are_refused(recorded, tdint, arguments, code, message):
    filled = [argument.format(folder=recorded) for argument in arguments]
    call = (recorded / "model.yaml", "--recorded", recorded / "recorded.yaml", *filled)
    assert message in tdint("compare", *call, code=code).stderr


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "empty; ... `base` and `floors`"),
        ("base: x.csv\n", "floors: is missing; specify the floors"),
        ("base: []\nfloors: {}\n", "base: must name at least one file"),
        ("base: x.csv\nfloors: [x.csv]\n", "floors: ... mapping ... roof"),
        (None, "file not found; ... (YAML)"),
    ],
)
def test_files_without_recordings_are_refused(recorded, tdint, tmp_path, text, message):
    if text is not None:
        (tmp_path / "other.yaml").write_text(text)
    tdint.refused(
        message, "compare", recorded / "model.yaml", "--recorded", tmp_path / "other.yaml", code=3
    )
