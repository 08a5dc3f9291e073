"""`tdint run`: the table, the files, and all errors with their exit codes."""

import hashlib
import json

import numpy as np
import pytest

from cli.conftest import change
from csv_rows import rows

UNSTABLE = ("--method", "central-difference", "--dt", 0.5, "--duration", 2000, "--allow-unstable")


def files(folder) -> list[str]:
    return sorted(path.name for path in folder.iterdir())


def summary_of(folder):
    return json.loads((folder / "out" / "summary.json").read_text())


def test_the_table_is_written_to_stdout_and_messages_to_stderr(folder, tdint):
    before = files(folder)
    result = tdint("run", "shaken.yaml", code=0)
    table = rows(result.stdout)
    assert [row["story"] for row in table] == ["1", "2"]
    assert float(table[0]["ductility"]) == pytest.approx(
        float(table[0]["peak_drift_m"]) / (50 / 8000)
    )
    for text in (
        "shaken: 2 stories, ",
        "motion.mseed HNE (PGA 2.",
        "newmark-average: 299 steps of 0.01 s",
        "energy error",
        "Maximum drift ratio",
        "roof displacement",
        "base shear",
        "Warning: motion.mseed: m/s^2 is assumed",
    ):
        assert text in result.stderr
    assert files(folder) == before


def test_the_files_of_a_run(folder, tdint, drawn):
    result = tdint("run", "shaken.yaml", "-o", "out", "--history", "--plot", code=0)
    out = folder / "out"
    assert files(out) == ["history.csv", "response.png", "stories.csv", "summary.json"]
    assert (out / "stories.csv").read_bytes() == result.stdout.encode()
    assert (out / "response.png").read_bytes().startswith(b"\x89PNG")
    history, energy = rows(out / "history.csv"), summary_of(folder)["energy"]
    assert len(history) == 300
    for row in rows(result.stdout):
        largest = max(abs(float(step[f"story_{row['story']}_drift_m"])) for step in history)
        # The peak is between two time steps.
        assert largest <= float(row["peak_drift_m"]) < 1.01 * largest
    top, below = (
        max(abs(float(row[f"floor_{i}_displacement_m"])) for row in history) for i in (2, 1)
    )
    assert top > below > 0.0
    assert list(history[0])[-8:] == [
        "energy_input_J", "energy_kinetic_J", "energy_viscous_J", "energy_dampers_J",
        "energy_strain_J", "energy_hysteretic_J", "energy_braces_J", "energy_error",
    ]  # fmt: skip
    for name in energy.keys() - {"initial_J"}:
        assert float(history[-1][f"energy_{name}"]) == pytest.approx(energy[name], rel=1e-11)


def test_the_summary(folder, tdint):
    table = rows(tdint("run", "shaken.yaml", "-o", "out", "--scale", "2").stdout)
    summary = summary_of(folder)
    assert list(summary) == [
        "schema", "status", "name", "method", "method_parameters", "dt_s", "steps",
        "duration_s", "iterations", "halved_steps", "branch_changes", "wall_time_s",
        "time_loop_s", "time_loop_clock", "building", "energy", "peaks", "check",
        "at_end", "collapse_drift", "collapse", "record", "settings", "notes", "inputs",
        "versions", "meanings", "files", "arguments", "command", "time_loops",
    ]  # fmt: skip
    assert summary["schema"] == {"name": "tdint run", "version": 2}
    assert summary["record"]["scale"] == 2.0 and summary["settings"] == {}  # default settings
    assert summary["building"]["damping"] == {
        "type": "rayleigh",
        "ratios": [0.05, 0.05],
        "modes": [1, 2],
    }
    assert summary["meanings"]["t1_s"]["unit"] == "s"
    assert (summary["status"], summary["name"], summary["method"]) == (
        "done",
        "shaken",
        "newmark-average",
    )
    assert (summary["dt_s"], summary["steps"], summary["duration_s"]) == (0.01, 299, 2.99)
    assert 0.0 < summary["time_loop_s"] < summary["wall_time_s"]
    assert set(summary["energy"]) == {
        "input_J", "kinetic_J", "viscous_J", "dampers_J", "strain_J", "hysteretic_J",
        "braces_J", "initial_J", "error",
    }  # fmt: skip
    assert summary["peaks"]["roof_displacement_m"] == float(table[1]["peak_displacement_m"])
    assert summary["peaks"]["base_shear_N"] == float(table[0]["peak_shear_N"])
    assert summary["record"]["component"] == "HNE"
    # An earlier test in this process may have loaded plug-ins.
    versions = set(summary["versions"]) - {"plugins"}
    assert versions == {"tdint", "numpy", "scipy", "numba", "obspy", "python", "sources"}
    assert [item["sha256"] for item in summary["inputs"]] == [
        hashlib.sha256((folder / name).read_bytes()).hexdigest()
        for name in ("shaken.yaml", "motion.mseed")
    ]


def test_scale_component_and_units_apply_to_the_record_of_the_model(folder, tdint):
    run = ("run", "shaken.yaml")
    plain = tdint(*run, "--scale", "2", code=0).stdout
    assert plain == tdint(*run, "--component", "HNN").stdout  # HNN has twice the amplitude of HNE.
    assert plain == tdint(*run, "--units", "2 m/s^2").stdout
    assert plain != tdint(*run).stdout


def test_a_record_option_replaces_record_and_component_of_the_model(folder, tdint):
    scaled = tdint("run", "shaken.yaml", "--record", "other.mseed", "--scale", "3", code=0)
    assert "other.mseed HNE" in scaled.stderr
    assert scaled.stdout == tdint("run", "shaken.yaml").stdout
    # The component of the model does not apply to the new record and must be selected again.
    message = "several components, choose one by --component: HNE, HNN"
    tdint.refused(message, "run", "shaken.yaml", "--record", "motion.mseed", code=4)


def test_units_on_the_command_line_replace_the_inventory_of_the_model(folder, tdint):
    model = (
        (folder / "shaken.yaml")
        .read_text()
        .replace("component: HNE", "component: HNE, inventory: none.xml")
    )
    (folder / "shaken.yaml").write_text(model)
    tdint.refused("none.xml", "run", "shaken.yaml", code=4)
    tdint("run", "shaken.yaml", "--units", "m/s^2", code=0)


@pytest.mark.parametrize(
    ("arguments", "code", "message"),
    [
        (["missing.yaml"], 3, "missing.yaml: file not found"),
        (["shaken.yaml", "--record", "missing.mseed"], 4, "missing.mseed: file not found"),
        (["shaken.yaml", "m" * 300], 4, "File name too long"),
        (["shaken.yaml", "--component", "HNZ"], 4, "component 'HNZ' not found"),
        (["shaken.yaml", "--units", "furlong"], 2, "units 'furlong'"),
        (["shaken.yaml", "--units", "gal", "--inventory", "x.xml"], 2, "with an inventory"),
        (["forced.yaml", "--method", "newmrk"], 2,
         "unknown method 'newmrk'; did you mean 'newmark'?"),
        (["forced.yaml", "--dt", "-1"], 2, "dt must be a positive number"),
        (["forced.yaml", "--duration", "nan"], 2, "duration must be a number, got nan"),
        (["shaken.yaml", "--dt", "0.003"], 2, "dt ... sampling interval ... 0.01 s"),
        (["shaken.yaml", "--scale", "0"], 2, "must not be zero"),
        (["shaken.yaml", "--scale", "inf"], 2, "inf is not a finite number"),
        (["forced.yaml", "--method", "central-difference", "--dt", "0.5"], 5,
         "mode 2 (omega 13.4922 rad/s, omega dt 6.74611) grows; ... 0.148233 s"),
        (["forced.yaml", *UNSTABLE], 5, "diverged after"),
        (["forced.yaml", "-o", ""], 2, "-o must not be empty; specify a name"),
        (["forced.yaml", "-o", "forced.yaml"], 6, "forced.yaml is a file, not a directory"),
        (["shaken.yaml", "--tolerance", "1%", "--no-check"], 2,
         "--tolerance and --no-check cannot be used together"),
        *(
            (["forced.yaml", option, "2"], 2, f"{option} requires a record, ... add --record")
            for option in ("--units", "--component", "--inventory", "--scale")
        ),
    ],
)  # fmt: skip
def test_invalid_arguments_are_refused(folder, tdint, arguments, code, message):
    lines = tdint.refused(message, "run", *arguments, code=code).stderr.splitlines()
    # A failing run first reports the warnings about its building (floors of 10 kg).
    if code == 5:
        lines = [line for line in lines if not line.startswith("Warning: unusual mass of a floor")]
    assert [line[:7] for line in lines if not line.startswith("note: ")] == ["Error: "]


def test_outputs_are_checked_before_the_run(folder, tdint):
    """The outputs are checked before the model is read: the model file does not exist."""
    (folder / "out").mkdir()
    (folder / "out" / "history.csv").write_text("old")
    tdint.refused(
        "out/history.csv: the file exists; add --overwrite", "run missing.yaml -o out", code=6
    )


def test_a_run_under_forces_and_a_diverged_run_write_a_summary(folder, tdint):
    done = tdint("run", "forced.yaml", "--check", "-o", "out", "--history", code=0)
    assert "forced: 2 stories, no ground motion." in done.stderr
    (first, _) = rows(done.stdout)
    assert (
        first["ductility"] == first["ductility_error"] == ""
        and float(first["peak_drift_m_error"]) > 0.0
    )
    call = ("run", "forced.yaml", *UNSTABLE, "-o", "out", "--overwrite", "--history")
    result = tdint.refused("diverged after", *call, code=5)
    assert files(folder / "out") == ["summary.json"]
    summary = summary_of(folder)
    assert result.stderr.endswith(f"Error: {summary['message']}\n")
    assert (summary["status"], summary["method"]) == ("diverged", "central-difference")
    assert (summary["dt_s"], summary["story"]) == (0.5, 2)
    assert summary["time_s"] > 0.0 and summary["kinetic_J"] > 1e6 and "peaks" not in summary
    assert summary["inputs"][0]["file"] == "forced.yaml"


def test_a_story_without_initial_stiffness(folder, tdint):
    """It has no first period; only free vibration until rest needs one."""
    law = "{type: polynomial, coefficients: [0, 0, 4e9]}"
    (folder / "cubic.yaml").write_text(f"stories: [{{mass: 1e5, height: 3, law: {law}}}]\n")
    call = ("cubic.yaml", "motion.mseed", "--units", "m/s^2", "--component", "HNE")
    (row,) = rows(tdint("run", *call, "--duration", 2, code=0).stdout)
    drift = float(row["peak_drift_m"])
    assert float(row["peak_shear_N"]) == pytest.approx(4e9 * drift**3, rel=1e-6)
    (mode,) = rows(tdint("modes", "cubic.yaml", code=0).stdout)
    (overview,) = rows(tdint("check", "cubic.yaml", code=0).stdout)
    assert mode["period_s"] == overview["t1_s"] == ""
    assert mode["frequency_hz"] == "0"
    tdint.refused("no initial stiffness; give a duration", "run", *call, "--until-rest", code=3)
    for option in (("--transfer",), ("--target", "ec8:type=1,soil=C,ag=0.3g")):
        tdint.refused("no initial stiffness; use time", "modes", "cubic.yaml", *option, code=3)
    tdint.refused("use a measure without a period, such as pga", "ida", *call, "--max-im", "1g")
    tdint("modes", "cubic.yaml", "--report", "modes.html", code=0)
    checked = tdint("check", "cubic.yaml", code=0)
    assert "unusual fundamental period" not in checked.stderr
    first, _ = rows(tdint("run", *call, "--duration", 2, "--scale", "1,2", code=0).stdout)
    assert float(first["peak_drift_m"]) == pytest.approx(drift, rel=1e-9)
    assert first["sa_t1_m_s2"] == ""


@pytest.mark.parametrize("method", ["newmark-average", "moment4"])
def test_a_run_reports_estimated_errors(folder, tdint, method):
    """By default and with --check, the errors of any method are estimated by one run of impulse4.
    --no-check omits them and changes no other number."""
    call = ("run", "shaken.yaml", "--method", method)
    plain = tdint(*call, "--no-check")
    result = tdint(*call, "-o", "out", "--history", "--plot", code=0)
    assert tdint(*call, "--check").stdout == result.stdout
    assert (folder / "out" / "stories.csv").read_bytes() == result.stdout.encode()
    table, bare = rows(result.stdout), rows(plain.stdout)
    names = list(bare[0])
    *peaks, energy = names
    errors = [f"{name}_error" for name in peaks[2:]]
    assert list(table[0]) == [*peaks, *errors, energy, f"{energy}_error"]
    assert energy == "hysteretic_energy_J"
    assert [{name: row[name] for name in names} for row in table] == bare
    relative = [float(row["peak_drift_m_error"]) / float(row["peak_drift_m"]) for row in table]
    check = summary_of(folder)["check"]
    assert check["drift_error"] == pytest.approx(max(relative)) and 1e-6 < max(relative) < 0.05
    assert relative[check["drift_error_story"] - 1] == pytest.approx(max(relative), rel=1e-9)
    assert (check["time_steps_s"], check["method"], check["tolerance"]) == (
        [0.005],
        "impulse4",
        None,
    )
    assert check["errors"]["base_shear_N_error"] == float(table[0]["peak_shear_N_error"])
    assert check["errors"]["roof_displacement_m_error"] == float(
        table[1]["peak_displacement_m_error"]
    )
    message = (
        f"Maximum estimated error of a peak drift: {100 * max(relative):.2g} % (story "
        f"{check['drift_error_story']})"
    )
    assert f"{message}, from a run of impulse4 with dt 0.005 s." in result.stderr
    assert "estimated" not in plain.stderr
    # The peaks of the run of impulse4 are only in the summary.
    finer = tdint("run shaken.yaml --method impulse4 --dt 0.005 --no-check").stdout
    assert f"{check['corrected_peaks']['drift_m']:.12g}" in {
        row["peak_drift_m"] for row in rows(finer)
    }
    assert ("In that run: maximum drift " in result.stderr) == (method == "newmark-average")


def test_a_history_contains_errors_on_request(folder, tdint):
    """Its maximum drifts, corrected by the errors at the time steps, do not exceed the corrected
    peaks. Without --check, it contains no errors."""
    run = ("run", "shaken.yaml", "--method", "moment4")
    result = tdint(*run, "--check", "--history", "-o", "out", "--plot", code=0)
    tdint(*run, "--history", "h.csv", code=0)
    table, bare = rows(folder / "out" / "history.csv"), list(rows(folder / "h.csv")[0])
    assert list(table[0]) == [
        *bare,
        *(f"floor_{i}_{name}_error" for i in (1, 2) for name in ("displacement_m", "velocity_m_s")),
        *(f"story_{i}_{name}_error" for i in (1, 2) for name in ("drift_m", "shear_N")),
    ]
    first = [
        abs(float(row["story_1_drift_m"]) + float(row["story_1_drift_m_error"])) for row in table
    ]
    corrected = summary_of(folder)["check"]["corrected_peaks"]
    assert corrected["drift_story"] == 1
    assert 0.9 * corrected["drift_m"] < max(first) <= corrected["drift_m"] * (1.0 + 1e-9)
    final_error = abs(float(table[-1]["story_2_drift_m_error"]))
    assert 0.0 < final_error <= float(rows(result.stdout)[1]["residual_drift_m_error"]) * 1.001


IDA = "ida shaken.yaml motion.mseed --units m/s^2 --component HNE --max-im 1m/s^2"


def test_until_rest(folder, tdint):
    """Residual drifts are values at rest, and the summary states the time of rest. Without
    --until-rest, a note states the remaining motion."""
    plain = tdint("run", "shaken.yaml", "-o", "out")
    summaries = [summary_of(folder)]
    rested = tdint("run", "shaken.yaml", "-o", "out", "--overwrite", "--until-rest")
    summaries.append(summary_of(folder))
    assert "still vibrates at the end" in plain.stderr and "--until-rest" in plain.stderr
    ends = [summary["at_end"] for summary in summaries]
    assert (
        ends[0]["time_at_rest_s"] is None
        and ends[1]["time_at_rest_s"] == summaries[1]["duration_s"] > 2.99
    )
    assert f"Free vibration has decayed at {ends[1]['time_at_rest_s']:.6g} s." in rested.stderr
    assert "still moves" not in rested.stderr
    assert ends[1]["residual_oscillation_m"] < 0.1 * ends[0]["residual_oscillation_m"]
    row = rows(tdint("run", "shaken.yaml", "--scale", "1,2", "--until-rest").stdout)[0]
    assert float(row["residual_drift_ratio"]) == pytest.approx(
        summaries[1]["peaks"]["residual_drift_ratio"], rel=1e-9
    )


@pytest.mark.parametrize(
    "command", ["run shaken.yaml", "run shaken.yaml --scale 1,2", IDA], ids=["run", "many", "ida"]
)
def test_a_run_shorter_than_its_record_is_reported(folder, tdint, command):
    """A duration of a third of the record, from the option or from the model (possibly intended for
    another record), causes a note."""
    note = (
        "note: the analysis ends at 1 s and omits a part of the Arias intensity: motion.mseed HNE "
    )
    change("shaken.yaml", ("analysis: {", "analysis: {duration: 1, "))
    arguments = command.split()
    assert note in tdint(*arguments, code=0).stderr
    assert note not in tdint(*arguments, "--duration", "10", code=0).stderr


@pytest.mark.parametrize("tolerance", ["0.1%", "0.001", " 0.1 %"])
def test_a_tolerance_selects_the_time_step(folder, tdint, tolerance):
    result = tdint("run", "shaken.yaml", "--tolerance", tolerance, "-o", "out", code=0)
    summary = summary_of(folder)
    check, samples = summary["check"], summary["check"]["samples_in_the_step"]
    assert check["tolerance"] == 0.001 and check["drift_error"] <= 0.001
    chosen = (
        f"from {check['runs_for_the_step']} runs: {summary['dt_s']:.6g} s, {samples:g} sampling"
    )
    assert f"below 0.1 %, {chosen}" in result.stderr
    if samples != 1.0 and check["solves_at_record_step"]:
        assert f"the sampling interval requires {check['solves_at_record_step']}." in result.stderr
    assert summary["dt_s"] == pytest.approx(0.01 * samples) and summary["dt_s"] < 0.04
    assert tdint("run", "shaken.yaml", "--dt", summary["dt_s"]).stdout == result.stdout


def test_an_unreachable_tolerance_is_an_error(folder, tdint):
    words = ("--duration", 0.2, "--method", "houbolt", "--tolerance", "1e-12", "-o", "out")
    result = tdint("run", "forced.yaml", *words, code=5)
    assert (
        "houbolt does not reach the tolerance of 1e-10 %" in result.stderr and result.stdout == ""
    )
    summary = summary_of(folder)
    assert summary["status"] == "not-within-tolerance" and "peaks" not in summary


@pytest.mark.parametrize("tolerance", ["0", "1", "100%", "-1%", "much", "nan", "%"])
def test_invalid_tolerances_are_refused(folder, tdint, tolerance):
    tdint.refused("Invalid value for '--tolerance'", "run", "forced.yaml", "--tolerance", tolerance)


def test_a_collapse_is_reported_without_an_error(folder, tdint):
    result = tdint("run", "shaken.yaml", "--scale", "50", "-o", "out", "--history", code=0)
    collapse = summary_of(folder)["collapse"]
    assert summary_of(folder)["status"] == "collapsed" and collapse["run_ended"] is True
    message = (
        f"Status collapsed: the drift ratio of story {collapse['story']} exceeds 10 % at "
        f"{collapse['time_s']:.6g} s; analysis stopped."
    )
    assert message in result.stderr
    history = rows(folder / "out" / "history.csv")
    drift = [abs(float(row[f"story_{collapse['story']}_drift_m"])) / 3.0 for row in history]
    at = round(collapse["time_s"] / 0.01)
    assert len(drift) <= at + 1 and drift[-2] < 0.1 < drift[-1]


def test_a_refused_step_writes_only_the_summary(folder, tdint):
    run = ("run", "forced.yaml", "--method", "central-difference", "--dt")
    assert "largest stable step" in tdint(*run, 0.5, "-o", "out", "--plot", code=5).stderr
    assert files(folder / "out") == ["summary.json"]
    summary = summary_of(folder)
    assert (summary["status"], summary["dt_s"], summary["time_s"]) == ("unstable-step", 0.5, 0.0)
    stable = summary["largest_stable_dt_s"]
    assert "peaks" not in summary and 0.0 < stable < 0.5
    tdint(*run, 0.999 * stable, code=0)


@pytest.mark.parametrize(
    ("error", "code"), [(KeyboardInterrupt, 130), (MemoryError, 5), (ZeroDivisionError, 1)]
)
def test_interrupted_writing_leaves_no_file(folder, tdint, monkeypatch, error, code):
    def half_a_history(_, stream, units):
        stream.write(b"half a li")
        raise error

    monkeypatch.setattr("tdint.output.tables.histories.write_history", half_a_history)
    result = tdint("run", "forced.yaml", "-o", "out", "--history", code=code)
    assert "Traceback" not in result.stderr
    assert not (folder / "out").exists()


def test_lost_energy_causes_a_warning_despite_quiet(folder, tdint):
    result = tdint("run shaken.yaml -q --method newmark:beta=0.5:gamma=0.9 -o out", code=0)
    (line,) = (line for line in result.stderr.splitlines() if "energy imbalance" in line)
    assert line.startswith("Warning: the energy imbalance is")
    assert "dissipated by the method" in line
    assert line.removeprefix("Warning: ") in summary_of(folder)["notes"]


def test_a_drift_of_the_baseline_is_reported(folder, tdint):
    """Without its mean, the motion has no drift."""
    samples = 0.2 + np.sin(0.3 * np.arange(400))
    lines = ["# dt = 0.01, units = m/s^2", *(f"{value:.6f}" for value in samples)]
    (folder / "drift.txt").write_text("\n".join(lines) + "\n")
    result = tdint("run", "shaken.yaml", "--record", "drift.txt", "-o", "out", code=0)
    expected = "the velocity at the end is 0.8"
    assert f"note: {expected}" in result.stderr
    notes = json.loads((folder / "out" / "summary.json").read_text())["notes"]
    assert any(note.startswith(expected) for note in notes)
    result = tdint("run", "shaken.yaml", "drift.txt", "--highpass", "0.5", "--pad", "5", code=0)
    assert "at the end is" not in result.stderr


@pytest.mark.parametrize("name", ["stories.csv", "elements.csv"])
def test_two_outputs_with_one_name_are_refused(folder, tdint, name):
    """A history must not replace a table of the same run."""
    tdint.refused(f"{name}: two outputs", "run forced.yaml -o out", f"--history=out/{name}", code=6)
    tdint("run", "forced.yaml", "-o", "out", "--history=out/history.csv", "--plot", code=0)
