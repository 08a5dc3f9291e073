"""The options that change a record: the same in all commands, told on standard error and in the JSON file."""

import csv
import io
import json
import subprocess
import sys
from textwrap import dedent

import numpy as np
import pytest

from tdint.analysis.run.run import run
from tdint.analysis.spectra.elastic import spectrum
from tdint.ground_motion.processing_steps import process
from tdint.ground_motion.reading.read import read_record
from tdint.model.config.model_file import load_model

OPTIONS = ("--trim", "0.5:2.5", "--baseline", "linear", "--pad", "1:2", "--highpass", "0.5", "--lowpass", "30",
           "--corners", "2", "--resample", "0.005")  # fmt: skip
STEPS = {
    "trim": (0.5, 2.5), "baseline": "linear", "pad": (1.0, 2.0), "highpass": 0.5, "lowpass": 30.0, "corners": 2,
    "resample": 0.005,
}  # fmt: skip


def notes(result):
    return [line.removeprefix("note: ") for line in result.stderr.splitlines() if line.startswith("note: ")]


def test_a_spectrum_of_the_processed_record(folder, tdint):
    result = tdint("spectrum", "other.mseed", "--period", "0.5", *OPTIONS, "-o", "out.csv", "--units", "m/s^2")
    record = process(read_record("other.mseed", units="m/s^2"), **STEPS)
    (row,) = csv.DictReader(io.StringIO((folder / "out.csv").read_text()))
    assert float(row["sd_m"]) == pytest.approx(spectrum(record, np.array([0.5])).sd[0], rel=5.1e-12)
    assert notes(result) == [f"other.mseed: {step}" for step in record.processing]
    summary = json.loads((folder / "out.json").read_text())
    assert summary["settings"]["processing"] == {**STEPS, "trim": [0.5, 2.5], "pad": [1.0, 2.0]}
    assert (summary["records"][0]["processing"], summary["records"][0]["notes"]) == (list(record.processing), [])
    assert (summary["records"][0]["samples"], summary["records"][0]["dt_s"]) == (record.acceleration.size, 0.005)


def test_a_drift_spectrum_of_the_processed_record(folder, tdint):
    result = tdint("drift-spectrum", "other.mseed", "--period", "0.5", "--stories", "1", *OPTIONS, "-o", "out.csv")
    record = process(read_record("other.mseed"), **STEPS)
    (row,) = csv.DictReader(io.StringIO((folder / "out.csv").read_text()))
    sd = spectrum(record, np.array([0.5])).sd[0]
    assert float(row["peak_drift_ratio"]) == pytest.approx(sd / float(row["height_m"]), rel=1e-9)
    assert set(notes(result)) == {f"other.mseed: {note}" for note in record.notes}
    assert json.loads((folder / "out.json").read_text())["records"][0]["processing"] == list(record.processing)


def test_nothing_is_changed_unless_asked_for(folder, tdint):
    result = tdint("spectrum", "other.mseed", "--period", "0.5", "-o", "out.csv", "--units", "m/s^2")
    assert result.stderr == ""
    summary = json.loads((folder / "out.json").read_text())
    assert set(summary["settings"]["processing"].values()) == {None}
    assert summary["records"][0]["processing"] == []


def test_info_of_the_processed_record(folder, tdint):
    result = tdint("info", "motion.mseed", *OPTIONS, "-o", "out.csv")
    record = process(read_record("motion.mseed", component="HNN"), **STEPS)
    _, row = csv.DictReader(io.StringIO((folder / "out.csv").read_text()))
    assert float(row["pga_m_s2"]) == pytest.approx(record.pga, rel=5.1e-12)
    assert "; ".join(record.notes) in row["notes"]
    told = notes(result)
    assert told[0] == "motion.mseed: trimmed to the part from 0.5 to 2.5 s"
    assert [line for line in told if "a line from" in line][1].startswith("motion.mseed: HNN: ")
    summary = json.loads((folder / "out.json").read_text())
    assert summary["command"] == "info"
    assert summary["records"][1]["processing"] == list(record.processing)


def test_a_step_that_does_not_fit_one_record_does_not_stop_the_others(folder, tdint, make_record):
    make_record(folder / "short.mseed", "HNE", samples=100)
    result = tdint("info", "short.mseed", "other.mseed", "--trim", "1:2")
    assert (result.exit_code, len(result.stdout.splitlines())) == (4, 2)
    assert "Error: short.mseed: TD.TEST..HNE: trim 1:2 s leaves the record" in result.stderr


@pytest.mark.parametrize(
    "command", ["run shaken.yaml", "info other.mseed", "spectrum other.mseed", "drift-spectrum other.mseed"]
)
@pytest.mark.parametrize(
    ("options", "message"),
    [
        ("--trim 2", "trim must be START:END in seconds, got '2'"),
        ("--trim 3:2", "with START below END"),
        ("--baseline cubic", "'cubic' is not one of"),
        ("--pad a", "pad must be SECONDS or BEFORE:AFTER"),
        ("--highpass 0", "--highpass"),
        ("--lowpass nan", "--lowpass"),
        ("--highpass 2 --lowpass 1", "highpass (2 Hz) must be below lowpass (1 Hz)"),
        ("--corners 3", "corners are those of a filter"),
        ("--highpass 1 --corners 99", "--corners"),
        ("--resample -1", "--resample"),
    ],
)
def test_usage_errors(folder, tdint, command, options, message):
    tdint.refused(message, *command.split(), *options.split())


# tdint run


def test_model_command_line_and_library_agree(folder, tdint):
    """The record of a model is processed by its own entries, by options in their place, or before it is given."""
    text = (folder / "shaken.yaml").read_text()
    processed = dedent("""\
        excitation:
          record: {file: motion.mseed, component: HNE, trim: 0.5:2.5, baseline: linear, pad: 1:2, highpass: 0.5,
                   lowpass: 30, corners: 2, resample: 0.005}
    """)
    (folder / "processed.yaml").write_text(
        text[: text.index("excitation")] + processed + "analysis: {method: impulse4}\n"
    )
    by_model = tdint("run", "processed.yaml", "-o", "out")
    by_options = tdint("run", "shaken.yaml", "--method", "impulse4", *OPTIONS)
    assert by_model.exit_code == 0
    assert by_model.stdout == by_options.stdout
    record = process(read_record("motion.mseed", component="HNE"), **STEPS)
    response = run(load_model("shaken.yaml"), record, method="impulse4")
    drifts = [float(row["peak_drift_m"]) for row in csv.DictReader(io.StringIO(by_model.stdout))]
    np.testing.assert_allclose(drifts, response.stories.peak_drift, rtol=5.1e-12)
    assert set(record.processing) <= set(notes(by_model))
    summary = json.loads((folder / "out" / "summary.json").read_text())
    assert summary["record"]["processing"] == list(record.processing)


def test_an_option_replaces_what_the_model_says_of_the_same_step(folder, tdint):
    text = (folder / "shaken.yaml").read_text().replace("component: HNE", "component: HNE, highpass: 1, lowpass: 20")
    (folder / "shaken.yaml").write_text(text)
    told = notes(tdint("run", "shaken.yaml", "--lowpass", "10"))
    assert any(note.startswith("highpass 1 Hz") for note in told)
    assert any(note.startswith("lowpass 10 Hz") for note in told)
    assert not any("lowpass 20" in note for note in told)
    other = tdint("run", "shaken.yaml", "--record", "other.mseed", "--units", "m/s^2", "--lowpass", "10")
    assert next(note for note in notes(other) if "pass" in note).startswith("lowpass 10 Hz")
    result = tdint("run", "shaken.yaml", "--highpass", "25")
    assert (result.exit_code, result.stderr) == (
        2, "Error: highpass (25 Hz) must be below lowpass (20 Hz): nothing would be left\n",
    )  # fmt: skip


def test_processing_needs_a_record(folder, tdint):
    tdint.refused("processing needs a record, the model has none", "run", "forced.yaml", "--pad", "1")


def test_scipys_filters_are_loaded_for_filters_only(folder):
    code = (
        "import sys; from tdint_cli.main import cli\n"
        "try: cli.main(['info', 'other.mseed', *sys.argv[1:]])\n"
        "except SystemExit as end: assert not end.code\n"
        "print('scipy.signal' in sys.modules)"
    )
    for options, expected in ((OPTIONS[:6], "False"), (OPTIONS, "True")):
        done = subprocess.run([sys.executable, "-c", code, *options], capture_output=True, text=True, check=True)
        assert done.stdout.splitlines()[-1] == expected
