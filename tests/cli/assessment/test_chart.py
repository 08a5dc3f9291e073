"""`tdint chart`: rows, messages, files, exit codes."""

import json
import re
import sys
from importlib.metadata import version

import pytest

from csv_rows import rows
from facts import states
from selection import every
from tdint.assessment.chart import peers, problem
from tdint.assessment.chart import performance_profiles as profiles
from tdint.methods.catalogue import parse
from tdint.response.defaults import PEAKS, QUANTITIES
from tdint_cli import terminal
from tdint_cli.assessment import chart

QUICK = (
    "--method", "impulse4", "--method", "newmark-average", "--dt", "0.02,0.01",
    "--repeat", "2",
)  # fmt: skip


@pytest.fixture(scope="module")
def references(tmp_path_factory):
    return tmp_path_factory.mktemp("references")


@pytest.fixture(autouse=True)
def kept_here(monkeypatch, references):
    """Cache reference solutions for the tests of this file, because many tests use the same
    building and ground motion."""
    monkeypatch.setattr(problem, "cache_folder", lambda: references)


@pytest.mark.long
def test_table_messages_and_files(folder, tdint, drawn):
    result = tdint("chart", "shaken.yaml", *QUICK, "-o", "x.csv", "--plot", code=0)
    assert result.stdout == "" and (folder / "x.png").read_bytes().startswith(b"\x89PNG")
    table = rows(folder / "x.csv")
    assert [(row["method"], row["dt_s"], row["steps"], row["outcome"]) for row in table] == [
        (parse(name).label, dt, steps, "done")
        for name in ("impulse4", "newmark-average")
        for dt, steps in (("0.02", "150"), ("0.01", "300"))
    ]
    for row in table:
        assert 0.0 < float(row["time_min_s"]) <= float(row["time_s"])
        assert all(0.0 < float(row[name]) < 1.0 for name in row if name.endswith("_error"))
    assumed, *lines = result.stderr.splitlines()
    assert assumed.startswith("Warning: motion.mseed: ")
    assert lines[0].startswith("2 stories: the reference is impulse4 with dt ")
    time_steps = re.search(
        r"impulse4 with dt (\S+) s.* newmark-average extrapolated from dt (\S+) and (\S+) s",
        lines[0],
    )
    assert [float(time_steps[1]) / float(time_steps[i]) for i in (2, 3)] == pytest.approx(
        [4.0, 8.0], rel=1e-3
    )
    for line, limit in zip(lines[1:3], ("1", "0.1"), strict=True):
        best = (
            rf"For {limit} % \(peak-drift\): (\S+) with dt (\S+) s, .* ms, true error \S+ % "
            r"\(`tdint run` will estimate (\S+) %\)"
        )
        others = r"(; next best: \S+ with dt \S+ s, \S+ times as long, true error \S+ %)?"
        usual = (
            r"(; common choice: newmark-average with dt 0.01 s, \S+ times as long, "
            r"true error \S+ %)?"
        )
        stated = re.fullmatch(f"{best}{others}{usual}\\.", line)
        # Alternatives meet the tolerance and are never cheaper.
        listed = line.partition("will estimate ")[2]
        assert all(float(error) <= float(limit) for error in re.findall(r"error (\S+) %", listed))
        assert all(float(ratio) >= 1.0 for ratio in re.findall(r"(\S+) times as long", listed))
        # The estimated error equals the estimate of `tdint run` with this method and time step.
        method_and_step = ("--method", stated[1], "--dt", stated[2])
        peaks = rows(tdint("run", "shaken.yaml", *method_and_step, code=0).stdout)
        relative_error = max(
            float(row["peak_drift_m_error"]) / float(row["peak_drift_m"]) for row in peaks
        )
        # The message has two digits.
        assert float(stated[3]) == pytest.approx(100.0 * relative_error, rel=0.06)
    assert lines[3].startswith("Common choice, newmark-average with dt 0.01 s of the record: ")
    assert lines[4].startswith("Of the methods that meet the tolerance ")
    assert not any(line.startswith("note: ") for line in lines)

    summary = json.loads((folder / "x.json").read_text())
    assert summary["interval_s"] == 0.01
    assert [entry["limit"] for entry in summary["recommended"]] == [0.01, 0.001]
    assert all(
        0.0 < entry["error"] <= entry["limit"] and entry["told_error"] > 0.0
        for entry in summary["recommended"]
    )
    assert all(
        entry["next_best"]["method"] != entry["method"]
        for entry in summary["recommended"]
        if entry["next_best"]
    )
    assert (summary["model"]["file"], summary["record"]["component"]) == ("shaken.yaml", "HNE")
    (reference,) = summary["references"]
    assert reference["method"] == "impulse4"
    assert set(reference["gap"]) == {name.replace("-", "_") for name in QUANTITIES}
    assert all(0.0 < gap < 1e-6 for gap in reference["gap"].values())
    assert (summary["usual"]["method"], summary["peers"]) == ("newmark-average", [])
    (timing,) = summary["timing"]
    assert (
        2 <= timing["repeats"][0] <= timing["repeats"][1] <= 8
        and timing["processors"] >= 1
        and timing["processor"]
    )
    assert timing["clock"] in ("processor time of the thread", "wall time")


def test_the_usual_choice_is_listed_only_if_it_meets_the_tolerance(folder, tdint):
    """Otherwise, a separate line states it with its error."""
    options = (
        "--method", "impulse4,moment4", "--dt", "0.01,0.005,0.0025", "--repeat", "1",
        "--target-error", "acceleration",
    )  # fmt: skip
    lines = tdint("chart", "shaken.yaml", *options, code=0).stderr.splitlines()
    (usual,) = (line for line in lines if line.startswith("Common choice, newmark-average"))
    error = float(re.search(r"error (\S+) %", usual)[1])
    advice = [line for line in lines if re.match(r"For \S+ %", line)]
    assert error > 0.1 and len(advice) == 2
    for line in advice:
        limit = float(re.match(r"For (\S+) %", line)[1])
        assert "common choice" not in line or error <= limit


@pytest.mark.long
def test_lines_by_tolerance(folder, tdint):
    """These lines are after the other lines, contain only the error of the peak drifts, and are not
    recommended, because they have no dt."""
    result = tdint(
        "chart shaken.yaml",
        *QUICK,
        "--duration",
        "1.5",
        "--tolerance",
        "5%,1%",
        "--plot",
        "x.svg",
        code=0,
    )
    chosen = rows(result.stdout)[4:]
    assert [row["method"] for row in chosen] == [
        f"{parse(name).label} within {tolerance}"
        for name in ("moment4", "impulse4")
        for tolerance in ("0.05", "0.01")
    ]
    for row in chosen:
        assert (row["dt_s"], row["steps"], row["drift_error"], row["outcome"]) == (
            "", "", "", "done",
        )  # fmt: skip
        assert 0.0 < float(row["peak_drift_error"]) <= float(row["method"].rpartition(" ")[2])
    assert "by tolerance" not in result.stderr and "nan" not in result.stderr
    picture = (folder / "x.svg").read_text(encoding="utf-8")
    texts = " ".join(re.sub("<[^>]*>", " ", picture).split())
    assert "moment4 by tolerance" in texts and "by tolerance: of the whole run" in texts


@pytest.mark.parametrize(
    ("options", "texts"),
    every(
        2,
        [
            (
                (),
                [
                    "maximum error of the peak drifts of the stories",
                    "sampling interval of the record, 0.01 s",
                    "time of the thread in the compiled loop (s)",
                ],
            ),
            (
                ("--target-error", "drift", "--versus", "dt"),
                [
                    "error of the drifts (L2 of the history)",
                    "time step (s)",
                    "vertical line: sampling interval",
                ],
            ),
            (("--versus", "solves"), ["solves against accuracy"]),
            (("--versus", "steps"), [">time steps<", "steps against accuracy"]),
        ],
        ids=["time", "dt", "solves", "steps"],
    ),
)
def test_figure_texts_name_the_plotted_quantities(folder, tdint, options, texts):
    tdint("chart", "shaken.yaml", *QUICK, "--duration", "1", *options, "--plot", "x.svg", code=0)
    picture = (folder / "x.svg").read_text(encoding="utf-8").replace("> impulse4<", ">impulse4<")
    for text in [*texts, "shaken", ">impulse4<", "newmark-average", "reference: impulse4"]:
        assert text in picture, text


@pytest.mark.parametrize(
    ("options", "steps", "usual"),
    [
        (("--method", "exact", "--target-error", "displacement"), ["100", "200"] * 3,
         "with dt 0.02 s of the model"),
        (("--record", "other.mseed", "--duration", "1"), ["50", "100"] * 2,
         "with dt 0.01 s of the record"),
    ],
    ids=["only forces", "a record on the command line"],
)  # fmt: skip
def test_a_linear_building_under_forces(folder, tdint, options, steps, usual):
    result = tdint("chart", "forced.yaml", *QUICK, *options, code=0)
    assert [row["steps"] for row in rows(result.stdout)] == steps
    assert "the reference is impulse4" in result.stderr and usual in result.stderr
    assert "skip samples" not in result.stderr


def test_positional_records_equal_record_options(folder, tdint, make_record):
    """A positional record is the record of --record; several records make several problems."""
    make_record("other.mseed", "HNE", samples=250)
    units = ("--component", "HNE", "--units", "m/s^2", "--duration", "1", "--repeat", "1")
    steps = ("--method", "impulse4,newmark-average", "--dt", "0.02,0.01")
    positional, by_option = (
        rows(tdint("chart", "shaken.yaml", *record, *units, *steps).stdout)
        for record in (("other.mseed",), ("--record", "other.mseed"))
    )
    for row in (*positional, *by_option):
        del row["time_s"], row["time_min_s"]
    assert positional == by_option and float(positional[0]["drift_error"]) > 0.0
    many = rows(tdint("chart", "shaken.yaml", "motion.mseed", "other.mseed", *units, *LINES).stdout)
    assert {row["problems"] for row in many} == {"2"}
    tdint.refused(
        "--record other.mseed and motion.mseed cannot",
        *("chart", "shaken.yaml", "motion.mseed", "--record", "other.mseed"),
    )


@pytest.mark.long
def test_unstable_steps_are_rows_of_the_table(folder, tdint):
    options = (
        "--method", "central-difference", "--dt", "0.2,0.02", "--repeat", "1", "--plot",
        "x.svg",
    )  # fmt: skip
    result = tdint("chart", "shaken.yaml", *options, code=0)
    first, second = rows(result.stdout)
    assert (first["outcome"], second["outcome"]) == ("unstable-step", "done")
    assert [name for name, cell in first.items() if cell] == ["method", "dt_s", "steps", "outcome"]
    assert "note: central-difference: unstable-step with dt 0.2 s" in result.stderr
    assert states(result.stderr, "For 0.1 % (peak-drift): no method ... add ")


def test_no_recommendation_if_the_peaks_occur_at_the_start(folder, tdint):
    (folder / "free.yaml").write_text(
        "stories: [{mass: 1, stiffness: 100}]\ninitial: {displacement: [0.1]}\nanalysis: {dt: "
        "0.02, duration: 2}\n",
        encoding="utf-8",
    )
    result = tdint("chart", "free.yaml", *QUICK, "-o", "x.csv")
    assert "note: the peak drifts occur at" in result.stderr
    assert "For 1 %" not in result.stderr
    assert json.loads((folder / "x.json").read_text())["recommended"] == []
    assert (
        "For 1 % (drift)" in tdint("chart", "free.yaml", *QUICK, "--target-error", "drift").stderr
    )


@pytest.mark.long
def test_costs_over_the_number_of_stories(folder, tdint, drawn):
    options = ("--stories", "1,2,4", "--method", "impulse4", "--repeat", "1", "--duration", "1")
    result = tdint("chart", "shaken.yaml", *options, "-o", "x.csv", "--plot", "x.svg", code=0)
    assert [(row["stories"], row["dt_s"]) for row in rows(folder / "x.csv")] == [
        ("1", "0.01"),
        ("2", "0.01"),
        ("4", "0.01"),
    ]
    assert [line.split(":")[0] for line in result.stderr.splitlines()[1:4]] == [
        "1 story",
        "2 stories",
        "4 stories",
    ]
    assert "time per step (us)" in (folder / "x.svg").read_text(encoding="utf-8")
    assert [
        entry["stories"] for entry in json.loads((folder / "x.json").read_text())["references"]
    ] == [1, 2, 4]


@pytest.mark.long
def test_peers_are_rows_and_lines_of_the_chart(folder, tdint, monkeypatch):
    monkeypatch.setattr(peers, "TOLERANCES", (1e-3,))
    result = tdint(
        "chart shaken.yaml", *QUICK, "--peers", "--plot", "x.svg", "--duration", "1", code=0
    )
    table = rows(result.stdout)
    assert [row["method"] for row in table[:4:2]] == [
        parse(name).label for name in ("impulse4", "newmark-average")
    ]
    peer_rows = {row["method"]: row for row in table[4:]}
    assert {f"scipy/{name}:rtol=0.001" for name in peers.METHODS} <= set(peer_rows)
    assert (
        peer_rows["scipy/RK45:rtol=0.001"]["dt_s"],
        peer_rows["scipy/RK45:rtol=0.001"]["outcome"],
    ) == ("", "done")
    assert any("openseespy" in name for name in peer_rows) == (
        "openseespy is omitted" not in result.stderr
    )
    picture = (folder / "x.svg").read_text(encoding="utf-8")
    assert "scipy/RK45" in picture and f"scipy {version('scipy')}" in picture
    assert "scipy: in solve_ivp" in picture  # The label of the axis states the measured time.
    assert f"note: scipy {version('scipy')}: solve_ivp, atol = rtol times" in result.stderr
    assert not any(
        "scipy" in line or "openseespy" in line for line in result.stderr.splitlines()[:4]
    )


@pytest.mark.long
def test_the_reference_is_cached_between_calls(folder, tdint, monkeypatch):
    monkeypatch.setattr(problem, "cache_folder", lambda: folder)
    first = tdint("chart", "shaken.yaml", *QUICK, code=0)
    assert len(list((folder / "references").iterdir())) == 1
    monkeypatch.setattr(problem, "_solve", None)
    second = tdint("chart", "shaken.yaml", *QUICK, code=0)
    assert first.stderr.splitlines()[0] == second.stderr.splitlines()[0]
    tdint("chart", "shaken.yaml", *QUICK, "--no-cache", code=1)  # calls `_solve`, which is None


def test_a_progress_bar_is_written_at_a_terminal(folder, tdint, monkeypatch):
    """Standard error is not a terminal here, so that only the text of the progress bar is
    written."""
    monkeypatch.setattr(terminal, "is_terminal", lambda stream: stream is sys.stderr)
    result = tdint("chart", "shaken.yaml", *QUICK, "--duration", "1", "-o", "x.csv", code=0)
    assert re.search(r"(?m)^reference\b", result.stderr)


@pytest.mark.parametrize(
    ("arguments", "code", "message"),
    [
        (["--dt", "0.013"], 2, "dt ... sampling interval ... 0.01 s"),
        (["--dt", "-1"], 2, "-1.0 is not in the range 0.0<x<=1000000.0"),
        (["--dt", "nan"], 2, "nan is not a finite number"),
        (["--stories", "1,2.5"], 2, "'2.5' is not a valid integer"),
        (["--stories", "0"], 2, "0 is not in the range 1<=x<=10000"),
        (["--stories", "1000000"], 2, "1000000 is not in the range 1<=x<=10000"),
        (["--dt", "0.01", "--halvings", "2"], 2, "--halvings cannot be used with --dt"),
        (["--tolerance", "0"], 2, "Invalid value for '--tolerance'"),
        (["--halvings", "-1"], 2, "Invalid value for '--halvings'"),
        (["--repeat", "0"], 2, "Invalid value for '--repeat'"),
        (["--target-error", "force"], 2, "Invalid value for '--target-error'"),
        (["--highlight", "hht", "--plot", "y.png", *QUICK], 2,
         "must be one of the methods impulse4, newmark-average"),
        (["--highlight", "impulse4"], 2, "--plot"),
        (["--method", "newmrk"], 2, "unknown method 'newmrk'"),
        (["--method", "exact"], 2, "exact does not support nonlinear stories"),
        (["--scale", "0"], 2, "must not be zero"),
        (["--duration", "-1"], 2, "duration must be a positive number"),
        (["--record", "missing.mseed"], 4, "missing.mseed"),
        (["-o", "x.json"], 6, "x.json: two outputs have this file name"),
        (["--record", "motion.mseed", "-o", "motion.mseed", "--overwrite"], 6,
         "this command reads the file"),
    ],
)  # fmt: skip
def test_invalid_arguments_are_refused(folder, tdint, arguments, code, message):
    record = (folder / "motion.mseed").read_bytes()
    result = tdint.refused(message, "chart", "shaken.yaml", *arguments, code=code)
    assert "internal error" not in result.stderr
    assert (folder / "motion.mseed").read_bytes() == record


def test_a_model_without_excitation_is_refused(folder, tdint):
    (folder / "still.yaml").write_text(
        "stories: [{mass: 1, stiffness: 1}]\nanalysis: {dt: 0.1, duration: 1}\n", encoding="utf-8"
    )
    for arguments in (("still.yaml",), ("shaken.yaml", "--pad", "5:0", "--duration", "1")):
        tdint.refused("the building has no excitation", "chart", *arguments, code=5)


def test_the_targets_equal_the_quantities_of_the_library():
    assert set(chart.TARGETS) == {*QUANTITIES, *PEAKS}
    assert set(PEAKS) == {name.replace("_", "-") for name in profiles.PEAKS}


# ---- Many problems

PROBLEMS = """\
records:
  near: {file: motion.mseed, component: HNE, units: m/s^2}
problems:
  - name: two stories
    reason: a test
    model: shaken.yaml
    scales: {near: 1, far: 1}
"""
LINES = ("--method", "newmark-average,impulse4")


@pytest.mark.long
def test_profiles_of_several_ground_motions(folder, tdint, make_record, drawn):
    make_record("other.mseed", "HNE", samples=250)
    result = tdint(
        "chart shaken.yaml --record motion.mseed --record other.mseed --component HNE",
        *LINES,
        "--units",
        "m/s^2",
        "--repeat",
        "1",
        "-o",
        "x.csv",
        "--plot",
        code=0,
    )
    table = rows((folder / "x.csv").read_text())
    assert len(table) == 3 * 6 * 2
    assert {row["problems"] for row in table} <= {"1", "2"}
    assert all(int(row["within_2"]) <= int(row["within_10"]) <= int(row["solved"]) for row in table)
    assert re.search(
        r"2 problems\. Best overall .*: (impulse4|newmark-average); for errors of 3 %",
        result.stderr,
    )
    summary = json.loads((folder / "x.json").read_text())
    assert [entry["motion"] for entry in summary["problems"]] == ["motion HNE", "other HNE"]
    assert len(summary["points"]) == len(summary["problems"][0]["points"][0])
    assert set(summary["recommended"]) == {"overall", "coarse", "safest"}
    assert (folder / "x.png").read_bytes().startswith(b"\x89PNG")


@pytest.mark.long
def test_a_file_of_problems_and_its_figure(folder, tdint):
    (folder / "mine.yaml").write_text(PROBLEMS.replace(", far: 1", ""))
    call = (
        "chart", "--problems", "mine.yaml", *LINES, "--repeat", "1", "--plot", "x.svg",
        "--target-error",
    )  # fmt: skip
    result = tdint(*call, "peak-absolute-acceleration", "--peers", "--tolerance", "1%", code=0)
    assert re.search(
        r"two stories, near: openseespy: (omitted: .* not installed|\S+ from the reference, "
        r"extrapolated)",
        result.stderr,
    )
    assert {row["method"] for row in rows(result.stdout)} >= {
        "newmark-average",
        "impulse4",
        "impulse4 by tolerance",
    }
    picture = (folder / "x.svg").read_text(encoding="utf-8")
    for text in (
        "Performance profiles over 1 problem",
        "peak absolute acceleration",
        "error within 0.1 %",
        "impulse4",
    ):
        assert text in picture


@pytest.mark.parametrize(
    ("options", "code", "message"),
    [
        ((), 2, "model is required; ... MODEL.yaml"),
        (("shaken.yaml", "--problems", "standard"), 2, "MODEL.yaml has no effect with --problems"),
        (("--problems", "standard", "--record", "motion.mseed"), 2, "--record has no effect"),
        (("--problems", "standard", "--target-error", "drift"), 2,
         "--target-error drift requires one building"),
        (("shaken.yaml", "--target-error", "peak-total-shear"), 2,
         "--target-error peak-total-shear"),
        (("--problems", "bad.yaml"), 3, "bad.yaml:7:23: problems[1].scales.far: unknown key"),
        (("--problems", "none.yaml"), 3, "none.yaml: file not found"),
    ],
)  # fmt: skip
def test_invalid_arguments_for_many_problems_are_refused(folder, tdint, options, code, message):
    (folder / "bad.yaml").write_text(PROBLEMS)
    result = tdint.refused(message, "chart", *options, code=code)
    assert len(result.stderr.strip().splitlines()) == 1
