"""`tdint init` and `tdint check`: first models that run, and errors of other models."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import tdint as api
from cli.conftest import Command
from csv_rows import rows
from json_schema import valid
from selection import every
from tdint.ground_motion.pulse import VelocityPulse
from tdint.ground_motion.reading.read import read_record
from tdint.model.building import assemble
from tdint.model.config.model_file import load_model, model_schema
from tdint.studies.campaign.reader import campaign_schema


@pytest.mark.parametrize("units", every(2, ["si", "us"]))
@pytest.mark.parametrize(("stories", "period"), every(2, [(1, 0.3), (2, 0.5), (5, 0.8), (40, 4.0)]))
def test_the_model_has_the_requested_period(
    folder: Path, tdint: Command, stories: int, period: float, units: str
) -> None:
    tdint("init new/own.yaml --stories", stories, "--period", period, "--units", units, code=0)
    (row,) = rows(tdint("check", "new/own.yaml").stdout)
    assert float(row["t1_s"]) == pytest.approx(period, rel=1e-8)
    assert (row["stories"], row["laws"], row["record"]) == (
        str(stories),
        "bilinear",
        "new/own-motion.txt",
    )
    assert float(row["t1_damping"]) == pytest.approx(0.05)
    # The first mode is a straight line, and all stories yield at the same amplitude of this mode.
    building = assemble(load_model("new/own.yaml"))
    _, shape = building.vibration.first
    np.testing.assert_allclose(shape / shape[0], np.arange(1.0, stories + 1.0), rtol=1e-6)
    np.testing.assert_allclose(building.yield_drift, building.yield_drift[0], rtol=1e-5)


def test_the_motion_is_the_pulse_of_its_parameters(folder: Path, tdint: Command) -> None:
    assert tdint("init").exit_code == 0
    record = read_record("building-motion.txt")
    pulse = VelocityPulse()
    assert (record.dt, record.duration, record.units_from) == (0.01, 20.0, "file")
    velocity = 0.01 * np.cumsum(record.acceleration)
    assert np.max(np.abs(velocity)) < pulse.velocity
    # Velocity and displacement end at zero; with the phase pi/2, v is odd about the middle of the
    # pulse.
    assert abs(velocity[-1]) < 1e-5
    assert abs(0.01 * velocity.sum()) < 1e-4
    t = 0.01 * np.arange(1 + round(pulse.duration / 0.01))
    angle = 2.0 * np.pi * (t - 0.5 * pulse.duration) / pulse.period
    shape = (
        0.5 * pulse.velocity * (1.0 + np.cos(angle / pulse.cycles)) * np.cos(angle + pulse.phase)
    )
    trapezoids = velocity - 0.005 * record.acceleration
    np.testing.assert_allclose(trapezoids[: t.size], shape, atol=5e-4 * pulse.velocity)


@pytest.mark.parametrize("units", ["si", "us"])
def test_the_campaign_runs(folder: Path, tdint: Command, units: str) -> None:
    """Each level is a multiple of the peak of the pulse; the variation in a comment is valid."""
    said = tdint("init new/we're.yaml --campaign --stories 2 --units", units, code=0).stderr
    campaign, model = Path("new/we're.yaml"), Path("new/we're-model.yaml")
    assert "tdint campaign" in said and str(model) in said
    tdint("check", campaign, code=0)
    tdint("campaign", campaign, "-o", "out", "-q", "--output-units", "g", code=0)
    runs = rows(Path("out/runs.csv"))
    assert [float(row["pga_g"]) for row in runs] == pytest.approx([0.1, 0.2, 0.4], rel=1e-3)
    assert {row["status"] for row in runs} == {"done"}
    text = campaign.read_text()
    campaign.write_text(text.replace("# vary: ", "vary: "))
    tdint("check", campaign, code=0)
    tdint("campaign", campaign, "-o", "varied", "-q", code=0)
    assert len(rows(Path("varied/runs.csv"))) == 6
    # No file is replaced, and none is written if one exists.
    tdint.refused("the file exists", "init", campaign, "--campaign", code=6)
    tdint.refused("not a valid file name", "init", "-", "--campaign", code=2)


def test_a_model_on_standard_output_has_no_ground_motion(folder: Path, tdint: Command) -> None:
    text = tdint("init", "-", "--stories", 3).stdout
    done = tdint("check", "-", stdin=text.encode(), code=0)
    assert rows(done.stdout)[0]["record"] == ""
    assert not (folder / "building.yaml").exists()


@pytest.mark.parametrize(
    ("arguments", "code", "message"),
    [
        (("init", "--period", 0), 2, "--period"),
        (("init", "--weights", f"{'9' * 5000}x3900"), 2, "invalid weight"),
        (("init", "forced.yaml"), 6, "forced.yaml: the file exists"),
        (("check",), 2, "no model file is specified"),
        (("check", "--schema", "model", "forced.yaml"), 2,
         "MODEL.yaml has no effect with --schema"),
        (("check", "--schema", "forced.yaml"), 2, "MODEL.yaml has no effect with --schema"),
        (("check", "none.yaml"), 3, "none.yaml: file not found"),
    ],
)  # fmt: skip
def test_invalid_arguments_are_refused(
    folder: Path, tdint: Command, arguments: tuple[Any, ...], code: int, message: str
) -> None:
    tdint.refused(message, *arguments, code=code)


STEP = "analysis: {dt: %.17g}"
RECORD = "excitation: {record: {file: motion.mseed, component: HNE, units: m/s^2}}"


@pytest.mark.parametrize(
    ("period", "force", "story_keys", "sections", "warning"),
    [
        (0.2, 1e5, "", STEP % (0.2 / 11.0), ""),
        (0.2, 1e5, "", STEP % (0.2 / 5.0), "5 steps in the fundamental period; "),
        (0.2, 2e4, "", STEP % (0.2 / 11.0), "weight: 0.0204; usual values are 0.03 to 3"),
        (0.2, 2e4, ", isolator: true", STEP % (0.2 / 11.0), ""),
        # If the time step is the sampling interval, the ground motion is linear within each step,
        # and the limit of the default method is lower.
        (0.08, 1e5, "", RECORD, ""),
        (0.06, 1e5, "", RECORD, "steps in the fundamental period"),
    ],
    ids=["usual", "long", "weak", "bearing", "eight samples", "six samples"],
)
def test_long_steps_and_weak_bases_cause_warnings(
    folder: Path,
    tdint: Command,
    period: float,
    force: float,
    story_keys: str,
    sections: str,
    warning: str,
) -> None:
    """A time step above a tenth of the period, and a base shear at yield below 3 % of the weight,
    cause warnings, but not for an isolator."""
    law = f"{{type: bilinear, yield_force: {force}, hardening: 0.02}}{story_keys}"
    stiffness = 1e5 * (2.0 * np.pi / period) ** 2
    story = f"stories: [{{mass: 1e5, height: 3, stiffness: {stiffness}, law: {law}}}]"
    (folder / "of.yaml").write_text(f"{story}\n{sections}\n")
    messages = tdint("check", "of.yaml", code=0).stderr
    assert warning in messages and bool(warning) == (
        "steps in" in messages or "base shear" in messages
    )


KN_AND_T = """\
name: without units
stories:
  - repeat: 2
    mass: 200
    height: 3
    stiffness: 4.0e+4
    law: {type: bilinear, yield_force: 300, hardening: 0.02}
damping: 5%
excitation: {record: {file: motion.mseed, component: HNE, units: m/s^2}}
"""
"""Model with values in kN and t that are read as N and kg; period (0.7 s) and strength are
usual."""


@pytest.mark.long
def test_all_analyses_report_the_warnings_of_check_first(folder: Path, tdint: Command) -> None:
    """The warnings are before all other messages, also with --quiet, in runs, several runs,
    campaigns, modes, pushover curves, and in Python."""
    (folder / "plain.yaml").write_text(KN_AND_T)
    (expected,) = [
        line.partition("plain.yaml: ")[2]
        for line in tdint("check", "plain.yaml", code=0).stderr.splitlines()
        if "mass of a floor: 200 kg" in line
    ]
    assert expected.startswith("unusual mass of a floor: 200 kg in story 1, 200 kg in story 2; ")
    (folder / "study.yaml").write_text(
        "name: study\nbuildings: {models: [plain.yaml]}\n"
        "records: {files: [motion.mseed], component: HNE, units: m/s^2}\n"
    )
    single = ("run", "plain.yaml", "--no-check")
    several = ("run", "plain.yaml", "motion.mseed", "--scale", "1,2", "--component", "HNE")
    several = (*several, "--units", "m/s^2")
    calls = [single, several, ("campaign", "study.yaml", "-o", "out"), ("modes", "plain.yaml")]
    calls += [("pushover", "plain.yaml")]
    for call in calls:
        for quiet in ((), ("-q",)):
            options = ("--overwrite",) if call[0] == "campaign" else ()
            first = tdint(*call, *options, *quiet, code=0).stderr.splitlines()[0]
            assert first.startswith("Warning: ") and first.endswith(expected), (call, first)
    response = api.run("plain.yaml")
    assert response.warnings[0] == expected
    assert f"; warning: {expected[:40]}" in repr(response)
    motion = api.read_record("motion.mseed", component="HNE", units="m/s^2")
    for results in (api.run_many(["plain.yaml"], [motion]), api.campaign("study.yaml")):
        assert results.warnings == (f"plain.yaml: {expected}",)
        assert f"; warning: plain.yaml: {expected[:25]}" in repr(results)


def test_all_errors_of_all_files_are_reported(folder: Path, tdint: Command) -> None:
    (folder / "bad.yaml").write_text(
        "storeys: [{mass: -1, stiffness: 1}]\nanalysis: {method: newmrk}\n"
        "excitation: {record: {file: motoin.mseed, inventory: motion.mseed}}\n"
    )
    (folder / "weak.yaml").write_text(
        "p_delta: true\nstories: [{mass: 1, stiffness: 1, height: 1}]\n"
    )
    (folder / "two.yaml").write_text(
        "stories:\n  - {mass: 1, stiffness: 1000}\n"
        "  - {repeat: 2, mass: 1, stiffness: 1000, law: {type: tanh, strength: 1}}\n"
    )
    done = tdint("check", "bad.yaml", "forced.yaml", "weak.yaml", "shaken.yaml", "two.yaml", code=3)
    # The floors of 10 kg cause warnings.
    errors = [line for line in done.stderr.splitlines() if not line.startswith("Warning: ")]
    assert [line.split(": ", 3)[1:3] for line in errors] == [
        ["bad.yaml:1:1", "storeys"],
        ["bad.yaml:1:18", "storeys[1].mass"],
        ["bad.yaml:2:20", "analysis.method"],
        ["bad.yaml:3:29", "excitation.record.file"],
        ["weak.yaml", "story 1"],
    ]
    forced, shaken, two = rows(done.stdout)
    assert (forced["model"], forced["laws"], forced["mass_kg"], forced["record"]) == (
        "forced.yaml", "linear", "18", "",
    )  # fmt: skip
    assert (shaken["laws"], shaken["mass_kg"], shaken["record"]) == (
        "bilinear",
        "20",
        "motion.mseed",
    )
    assert forced["method"].startswith("impulse4")
    assert (two["laws"], two["height_m"]) == ("1 linear, 2 tanh", "")


@pytest.mark.parametrize(
    ("arguments", "schema"),
    [((), model_schema), (("model",), model_schema), (("campaign",), campaign_schema)],
)
def test_check_writes_the_schemas(
    tdint: Command, arguments: tuple[str, ...], schema: Callable[[], object]
) -> None:
    assert json.loads(tdint("check", "--schema", *arguments, code=0).stdout) == schema()


def test_an_unusual_peak_causes_one_warning_for_a_model_or_campaign(
    folder: Path, tdint: Command, make_record: Callable[..., None]
) -> None:
    text = (folder / "shaken.yaml").read_text()
    (folder / "large.yaml").write_text(text.replace("component: HNE", "component: HNE, scale: 100"))
    assert "large.yaml: unusual peak ground" in tdint("check", "large.yaml", code=0).stderr
    (folder / "harmed.yaml").write_text(text.replace("motion.mseed", "harmed.mseed"))
    (folder / "harmed.mseed").write_bytes(b"no record")
    tdint("check", "harmed.yaml", code=4)
    for number in range(4):
        make_record(folder / f"{number}.mseed", "HNE", peak=66.0)  # 5.4 g
    records = "{files: [0.mseed, 1.mseed, 2.mseed, 3.mseed, motion.mseed], units: m/s^2}"
    (folder / "study.yaml").write_text(
        f"buildings: {{models: [shaken.yaml]}}\nrecords: {records}\n"
    )
    done = tdint("-q", "campaign", "study.yaml", "-o", "study", code=0)
    assert (
        done.stderr.count("peak ground acceleration")
        == done.stderr.count("2.mseed HNE and 1 more")
        == 1
    )


def test_a_campaign_is_checked_with_its_models(folder: Path, tdint: Command) -> None:
    def check(models: str, sections: str) -> tuple[str, list[str]]:
        (folder / "study.yaml").write_text(f"buildings: {{models: [{models}]}}\n{sections}\n")
        done = tdint("check", "study.yaml")
        # The floors of 10 kg cause warnings.
        messages = [
            line for line in done.stderr.splitlines(True) if not line.startswith("Warning: ")
        ]
        return "".join(messages), [row["model"] for row in rows(done.stdout)]

    (folder / "bad.yaml").write_text("stories: []\n")
    expected = "Error: bad.yaml:1:10: stories: must contain at least one story\n"
    assert check("bad.yaml, shaken.yaml", "records: {files: [motion.mseed]}") == (
        expected,
        ["shaken.yaml"],
    )
    messages, _ = check("shaken.yaml", "recrods: {files: []}")
    assert "study.yaml:2:1: recrods: unknown key; did you mean 'records'?" in messages
    assert check("shaken.yaml, forced.yaml", "records: {files: [a]}")[1] == [
        "shaken.yaml",
        "forced.yaml",
    ]
    assert not valid(
        {"buildings": {"models": ["a.yaml"]}, "records": {"file": []}}, campaign_schema()
    )
    assert valid(
        {"buildings": {"models": ["a.yaml"]}, "records": {"files": ["a"]}}, campaign_schema()
    )


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        *((["-", "--period", period], "") for period in ("nan", "1e-300")),
        *(([name], "is not a valid file name; use") for name in (" .yaml", "..", "m.yaml.gz")),
        *(([name], "") for name in ("a\nb.yaml", "\udcff.yaml", "/")),
    ],
)
def test_invalid_names_and_periods_are_refused(
    working_directory: Path, tdint: Command, arguments: list[str], message: str
) -> None:
    tdint.refused(message, "init", *arguments)
