"""Options for the processing of records: equal in all commands, reported on standard error and in
the JSON file."""

import json

import numpy as np
import pytest

from csv_rows import rows
from selection import every
from tdint.ground_motion.processing_steps import process
from tdint.ground_motion.reading.read import read_record
from tdint.model.config.model_file import load_model
from tdint.response.runs.run import run
from tdint.response.spectra.elastic import spectrum

OPTIONS = (
    "--trim", "0.5:2.5", "--baseline", "linear", "--pad", "1:2", "--highpass", "0.5",
    "--lowpass", "30", "--filter-order", "2", "--resample", "0.005",
)  # fmt: skip
STEPS = {
    "trim": (0.5, 2.5), "baseline": "linear", "pad": (1.0, 2.0), "highpass": 0.5,
    "lowpass": 30.0, "filter_order": 2, "resample": 0.005,
}  # fmt: skip


def notes(result):
    return [
        line.removeprefix("note: ")
        for line in result.stderr.splitlines()
        if line.startswith("note: ")
    ]


@pytest.fixture
def processed(folder):
    return process(read_record("other.mseed", units="m/s^2"), **STEPS)


@pytest.mark.parametrize(
    ("command", "column"),
    [
        (("spectrum", "--period", "0.5"), "sd_m"),
        (("info",), "pga_m_s2"),
    ],
)
def test_results_equal_the_results_of_the_processed_record(
    folder, tdint, processed, command, column
):
    """The processing steps are reported on standard error and in the JSON file."""
    name, *options = command
    result = tdint(
        name, "other.mseed", *options, *OPTIONS, "--units", "m/s^2", "-o", "out.csv", code=0
    )
    (row,) = rows(folder / "out.csv")
    sd = spectrum(processed, np.array([0.5])).sd[0]
    values = {
        "sd_m": sd,
        "peak_drift_ratio": sd / float(row.get("height_m", 1)),
        "pga_m_s2": processed.pga,
    }
    assert float(row[column]) == pytest.approx(
        values[column], rel=1e-9 if "drift" in column else 5.1e-12
    )
    assert notes(result) == [f"other.mseed: {step}" for step in processed.processing]
    expected_notes = "; ".join(processed.notes)
    assert expected_notes in row.get("notes", expected_notes)
    about = json.loads((folder / "out.json").read_text())
    assert about["settings"]["processing"] == {
        **STEPS,
        "time_scale": None,
        "trim": [0.5, 2.5],
        "pad": [1.0, 2.0],
    }
    (record,) = about["records"]
    assert (record["processing"], record["notes"]) == (list(processed.processing), [])
    assert (record["samples"], record["dt_s"]) == (processed.acceleration.size, 0.005)


def test_records_are_unchanged_by_default(folder, tdint):
    result = tdint("spectrum other.mseed --period 0.5 -o out.csv --units m/s^2")
    assert result.stderr == ""
    summary = json.loads((folder / "out.json").read_text())
    assert set(summary["settings"]["processing"].values()) == {None}
    assert summary["records"][0]["processing"] == []


def test_an_invalid_processing_step_of_one_record_does_not_stop_the_others(
    folder, tdint, make_record
):
    make_record(folder / "short.mseed", "HNE", samples=100)
    result = tdint("info", "short.mseed", "other.mseed", "--trim", "1:2")
    assert (result.exit_code, len(result.stdout.splitlines())) == (4, 2)
    assert "Error: short.mseed: TD.TEST..HNE: trim " in result.stderr


@pytest.mark.parametrize(
    "command",
    every(
        2,
        [
            "run shaken.yaml",
            "info other.mseed",
            "spectrum other.mseed",
        ],
    ),
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
        ("--filter-order 3", "filter_order requires highpass or lowpass"),
        ("--highpass 1 --filter-order 99", "--filter-order"),
        ("--resample -1", "--resample"),
    ],
)
def test_usage_errors(folder, tdint, command, options, message):
    tdint.refused(message, *command.split(), *options.split())


# Processing in `tdint run`


def test_model_command_line_and_library_agree(folder, tdint):
    """The record is processed by entries of the model, by options, or before it is passed to
    `run`, with equal results."""
    entries = (
        "trim: 0.5:2.5, baseline: linear, pad: 1:2, highpass: 0.5, lowpass: 30, filter_order: 2, "
        "resample: 0.005"
    )
    text = (folder / "shaken.yaml").read_text()
    (folder / "processed.yaml").write_text(
        text.replace("component: HNE", f"component: HNE, {entries}")
    )
    by_model = tdint("run", "processed.yaml", "-o", "out", code=0)
    assert by_model.stdout == tdint("run", "shaken.yaml", *OPTIONS).stdout
    record = process(read_record("motion.mseed", component="HNE"), **STEPS)
    response = run(load_model("shaken.yaml"), record)
    drifts = [float(row["peak_drift_m"]) for row in rows(by_model.stdout)]
    np.testing.assert_allclose(drifts, response.stories.peak_drift, rtol=5.1e-12)
    # The notes on both filters are one line.
    assert all(step.partition(":")[0] in by_model.stderr for step in record.processing)
    summary = json.loads((folder / "out" / "summary.json").read_text())
    assert summary["record"]["processing"] == list(record.processing)


def test_an_option_replaces_the_same_step_of_the_model(folder, tdint):
    text = (
        (folder / "shaken.yaml")
        .read_text()
        .replace("component: HNE", "component: HNE, highpass: 1, lowpass: 20")
    )
    (folder / "shaken.yaml").write_text(text)
    messages = tdint("run", "shaken.yaml", "--lowpass", "10").stderr
    assert "highpass 1 Hz" in messages and "lowpass 10 Hz" in messages
    assert "lowpass 20" not in messages
    other = tdint("run shaken.yaml --record other.mseed --units m/s^2 --lowpass 10")
    assert next(note for note in notes(other) if "pass" in note).startswith("lowpass 10 Hz")
    message = (
        "Error: highpass (25 Hz) must be below lowpass (20 Hz), otherwise the filters remove the "
    )
    message += "entire motion\n"
    tdint.refused(message, "run", "shaken.yaml", "--highpass", "25")


def test_processing_requires_a_record(folder, tdint):
    tdint.refused("processing requires a record", "run", "forced.yaml", "--pad", "1")
