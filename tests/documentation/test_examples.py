"""The scripts and examples of the READMEs run and give the stated results."""

import ast
import doctest
import io
import json
import re
import shlex
import sys

import numpy as np
import pytest
from click.testing import CliRunner

import readmes
from csv_rows import rows
from tdint.assessment.order.order import observed_order, order_problem
from tdint.assessment.stability.stability import critical_step
from tdint.methods import single_step
from tdint.methods.method import Integrator
from tdint.model.config.model_file import load_model
from tdint_cli.main import cli


@pytest.fixture
def checkout():
    """Directory with the files of a checkout, and a function that runs a script there and returns
    its output and messages."""
    with readmes.checkout() as (folder, environment):

        def run(script):
            code, output, messages = readmes.shell(script, folder, environment)
            assert code == 0, messages
            return output, messages

        yield folder, run


@pytest.mark.slow
def test_the_shell_script(checkout):
    folder, run = checkout
    output, _ = run(readmes.block("shell"))
    assert len(rows(output)) == 6
    assert len({row["building"] for row in rows(output)}) == 2
    assert all(0.001 < float(row["peak_drift_ratio"]) < 0.1 for row in rows(output))
    assert len(list((folder / "out").glob("*/pushover.csv"))) == 2


@pytest.mark.slow
def test_the_loops_of_a_law(checkout):
    folder, run = checkout
    assert run(readmes.block("law"))[0] == ""
    drifts = [float(row["drift_ratio"]) for row in rows(folder / "loops.csv")]
    assert (max(drifts), min(drifts), len(drifts)) == (0.03, -0.03, 1 + 6 * 800)
    assert (folder / "loops.png").exists()


def test_the_multilinear_model():
    model = load_model(io.StringIO(readmes.block("multilinear-model")))
    law = model.stories[0].law
    assert law.name == "multilinear"
    assert law.values["last_slope"] == 2e5
    for side in ("", "negative."):
        points = [
            (law.values[f"{side}backbone[{i}].drift"], law.values[f"{side}backbone[{i}].force"])
            for i in range(1, 5)
        ]
        assert points == [(0.01, 4e4), (0.02, 7.2e4), (0.04, 1.12e5), (0.12, 1.6e5)]


@pytest.mark.slow
def test_the_elastic_spectra(checkout):
    folder, run = checkout
    output, _ = run(readmes.block("elastic"))
    assert {row["maxima"] for row in rows(output)} == {"peer"}
    rotated = rows(folder / "rotd.csv")
    values = [
        [float(row[f"rotd{name}_psa_m_s2"]) for name in ("00", "50", "100")] for row in rotated
    ]
    assert len(values) == 200
    assert all(minimum < median < maximum for minimum, median, maximum in values)
    assert (folder / "spectra.png").is_file()


@pytest.mark.slow
def test_the_inelastic_spectra(checkout):
    folder, run = checkout
    assert run(readmes.block("inelastic"))[0] == ""
    ductility_rows, strength_rows = (
        rows(folder / name) for name in ("ductilities.csv", "strengths.csv")
    )
    assert all(
        float(row["ductility"]) == pytest.approx(float(row["target_ductility"]), rel=1e-8)
        for row in ductility_rows
    )
    assert {row["yield_strength_ratio"] for row in strength_rows} == {"0.1", "0.2"}
    assert (folder / "ductilities.png").exists()


@pytest.mark.slow
def test_the_batches(checkout):
    folder, run = checkout
    _, messages = run(readmes.block("batch"))
    assert (
        "note: records/: not used: README.md, make_records.py (document); kaikoura/, retrofit/ "
        "(directory)\n" in messages
    )
    assert {path.stem for path in (folder / "spectra").iterdir()} == {
        "firm-soil",
        "near-fault",
        "soft-soil",
    }
    (east, _) = json.loads((folder / "filtered.json").read_text())["records"]
    assert [step.split(":")[0] for step in east["processing"][2:]] == [
        "highpass 0.1 Hz, lowpass 25 Hz"
    ]
    assert len(json.loads((folder / "records.json").read_text())["records"]) == 6
    assert (folder / "records.png").exists()


@pytest.mark.slow
def test_the_drift_spectra(checkout):
    folder, run = checkout
    assert run(readmes.block("drift"))[0] == ""
    buildings, beams = (rows(folder / name) for name in ("drifts.csv", "beam.csv"))
    assert [row["period_s"] for row in buildings] == [row["period_s"] for row in beams]
    assert max(float(row["peak_drift_ratio"]) for row in buildings) == pytest.approx(
        0.024, rel=0.02
    )
    assert (folder / "drifts.png").exists()


@pytest.mark.parametrize(
    ("file", "least"), [("README.md", 6), pytest.param("src/README.md", 21, marks=pytest.mark.long)]
)
def test_the_notebook(monkeypatch, file, least):
    monkeypatch.chdir(readmes.ROOT)
    text = (readmes.ROOT / file).read_text()
    page = "".join(re.findall(r"^```pycon\n(.*?)^```", text, re.DOTALL | re.MULTILINE))
    cells = doctest.DocTestParser().get_doctest(page, {}, file, None, None)
    assert len(cells.examples) >= least
    output = []
    result = doctest.DocTestRunner(verbose=False).run(cells, out=output.append)
    assert result.failed == 0, "".join(output)


@pytest.mark.slow
def test_the_study_in_python(checkout):
    _, run = checkout
    output, _ = run(shlex.join([sys.executable, "-c", readmes.block("studies")]))
    *curves, fragility = [line.split() for line in output.splitlines()]
    assert [name for name, *_ in curves] == ["HN1", "HN2"]
    assert all(1.0 < float(upper) / float(lower) <= 1.05 for _, _, lower, upper, _ in curves)
    assert 0.0 < float(fragility[-1]) < 1.0


@pytest.mark.slow
def test_the_day_of_a_researcher(checkout):
    """The differences between methods have the stated size, and figures are 90 mm wide with
    TrueType fonts."""
    folder, run = checkout
    script = readmes.block("day")
    statements = [node for node in ast.walk(ast.parse(script)) if isinstance(node, ast.stmt)]
    assert len(statements) <= 45  # The example must be short.
    script = script.replace("rotated(125)", "rotated(25)")  # fewer spectra, for a faster test
    output, _ = run(shlex.join([sys.executable, "-W", "error", "-c", script]))
    spectra, *lines = output.splitlines()
    assert spectra.startswith("100 spectra") and len(lines) == 15
    differences = {
        tuple(line.split(":")[0].split(", ")): float(re.findall(r"up to ([\d.e-]+) %", line)[0])
        for line in lines
    }
    for (_, method), difference in differences.items():
        assert (
            difference == 0.0
            if method == "impulse4"
            else difference < 0.1
            if method == "moment4"
            else 1.0 < difference < 12.0
        )
    for name in ("spectra.pdf", "fragility.pdf"):
        data = (folder / name).read_bytes()
        width = float(re.findall(rb"/MediaBox \[ 0 0 ([\d.]+)", data)[0])
        assert width / 72.0 * 25.4 == pytest.approx(90.0, abs=0.1) and b"/FontFile2" in data


def test_transfer_functions_tune_an_absorber(checkout):
    _, run = checkout
    script = readmes.block("absorber")
    # A third of the evaluations, for a faster test
    method = 'method="Nelder-Mead",'
    assert script.count(method) == 1
    script = script.replace(method, f"{method} options={{'maxfev': 45}},")
    output, _ = run(shlex.join([sys.executable, "-W", "error", "-c", script]))
    before, after = [float(number) for number in re.findall(r"\d+\.\d+", output)]
    assert after < 0.3 * before


def test_a_regulator_controls_a_building_from_one_sensor(checkout):
    """The regulator halves the displacement; the filter finds it without its sensor, with errors
    that are small compared with it; the particle is near its state."""
    _, run = checkout
    output, _ = run(shlex.join([sys.executable, "-W", "error", "-c", readmes.block("regulator")]))
    free, lost, controlled, with_control, particle = map(float, re.findall(r"-?\d+\.\d+", output))
    assert 2.0 < controlled < 0.6 * free
    assert lost < 0.1 * free and with_control < 0.2 * controlled
    assert abs(particle) < controlled


def test_a_fit_of_factors(checkout):
    """The factors of a known building are found within 0.1 %."""
    _, run = checkout
    output, _ = run(shlex.join([sys.executable, "-W", "error", "-c", readmes.block("fit")]))
    stiffness, damping = map(float, re.findall(r"\d+\.\d+", output))
    assert stiffness == pytest.approx(0.85, rel=1e-3) and damping == pytest.approx(1.4, rel=1e-3)


def test_the_sufficiency_of_a_measure(checkout):
    """The p-value is small only if the residuals depend on the magnitude."""
    folder, run = checkout
    random = np.random.default_rng(3)
    magnitude, pgv = random.uniform(5, 8, 40), random.lognormal(size=40)
    (folder / "measures").mkdir(exist_ok=True)
    key = [f"building,r{i}.csv,HNE,1,0" for i in range(40)]
    events = "".join(f"r{i}.csv,{value}\n" for i, value in enumerate(magnitude))
    (folder / "events.csv").write_text(f"record,magnitude\n{events}")
    script = shlex.join([sys.executable, "-W", "error", "-c", readmes.block("sufficiency")])
    noise = np.exp(0.1 * random.normal(size=40))
    for drift, least, most in (
        (pgv * noise, 0.01, 1.0),
        (pgv * noise * np.exp(magnitude), 0, 1e-6),
    ):
        for name, column, values in (
            ("measures", "pgv_m_s", pgv),
            ("runs", "peak_drift_ratio", drift),
        ):
            rows = "".join(f"{text},{value}\n" for text, value in zip(key, values, strict=True))
            header = f"building,record,component,scale,sample,{column}\n"
            (folder / "measures" / f"{name}.csv").write_text(header + rows)
        output, _ = run(script)
        assert least < float(output.rpartition(":")[2]) < most


@pytest.mark.slow
def test_a_fit_by_derivatives(checkout):
    """Ten stiffnesses are estimated within four standard errors. The number of calls is smaller
    than finite differences would need for a single step."""
    _, run = checkout
    output, _ = run(shlex.join([sys.executable, "-W", "error", "-c", readmes.block("derivatives")]))
    *stories, calls = output.splitlines()
    numbers = np.array(
        [[float(number) for number in re.findall(r"\d\.\d+", line)] for line in stories]
    )
    assert numbers.shape == (10, 2) and np.all(np.abs(numbers[:, 0] - 1.0) < 4.0 * numbers[:, 1])
    assert np.all(numbers[:, 1] < 0.05)
    assert sum(map(int, re.findall(r"\d+", calls))) < 40


@pytest.mark.long
def test_your_own_record_on_your_own_building(checkout):
    """An AT2 file and the model of the page give peaks with errors, a figure and a report."""
    folder, run = checkout
    times = 0.01 * np.arange(1500)
    samples = 0.3 * np.exp(-(((times - 4.0) / 2.0) ** 2)) * np.sin(2.4 * np.pi * times)
    heading = (
        "PEER NGA STRONG MOTION DATABASE RECORD\nInvented event, 1/1/2000, Mine, 90\n"
        "ACCELERATION TIME SERIES IN UNITS OF G\nNPTS=  1500, DT=   .0100 SEC,\n"
    )
    lines = ["".join(f"{value:15.7E}" for value in row) for row in samples.reshape(-1, 5)]
    (folder / "RSN1_MINE_090.AT2").write_text(heading + "\n".join(lines) + "\n")
    (folder / "frame.yaml").write_text(readmes.block("own-model"))
    run(readmes.block("own-run"))
    (first, *upper_stories) = rows(folder / "result" / "stories.csv")
    assert len(upper_stories) == 2 and float(first["height_m"]) == 4.0
    assert 0.0 < float(first["peak_drift_m_error"]) < 1e-3 * float(first["peak_drift_m"])
    assert {path.name for path in (folder / "result").iterdir()} == {
        *("stories.csv", "summary.json", "response.png", "report.html")
    }


@pytest.mark.long
def test_force_on_the_roof_of_an_example(checkout):
    """The table and the section of the page load the roof of the example: the gust of 240 kN moves
    the building more than the constant 60 kN, whose static displacement follows from the
    stiffnesses."""
    folder, run = checkout
    text = (folder / "configs" / "ten-story.yaml").read_text()
    section = text[text.index("excitation:") : text.index("analysis:")]
    (folder / "gust.yaml").write_text(
        text.replace(section, readmes.block("roof-excitation") + "\n")
    )
    (folder / "roof.csv").write_text(readmes.block("roof-force"))
    run(readmes.block("roof-run"))
    roof = rows(folder / "gust" / "stories.csv")[-1]
    static = 60e3 * 10 / 3.5e8
    assert 1.5 * static < float(roof["peak_displacement_m"]) < 8.0 * static
    summary = json.loads((folder / "gust" / "summary.json").read_text())
    assert any(item["file"].endswith("roof.csv") for item in summary["inputs"])
    assert "a fiftieth of the first period" in " ".join(summary["notes"])


def test_the_model_with_all_keys(checkout):
    folder, _ = checkout
    (folder / "models").mkdir()
    (folder / "models" / "model.yaml").write_text(readmes.block("model"))
    model, out = str(folder / "models" / "model.yaml"), str(folder / "out")
    assert CliRunner().invoke(cli, ["run", model, "-o", out]).exit_code == 0
    summary = json.loads((folder / "out" / "summary.json").read_text())
    assert (summary["name"], summary["status"], summary["duration_s"]) == (
        "ten-story office",
        "done",
        40.0,
    )
    assert summary["record"]["component"] == "HN1"


@pytest.mark.slow
def test_each_model_of_the_page_runs_as_it_stands(checkout):
    """A model without an excitation is checked."""
    folder, _ = checkout
    (folder / "models").mkdir()
    pages = [path.read_text("utf-8") for path in (readmes.ROOT / "configs").glob("*.md")]
    models = [text for text in re.findall(r"```yaml\n(.*?)```", "\n".join(pages), re.DOTALL) if
        re.search("^(?:stories|matrices|building):", text, re.MULTILINE)]  # fmt: skip
    assert len(models) >= 16 and any("attachments:" in text for text in models)
    for text in models:
        path = folder / "models" / "model.yaml"
        path.write_text(text)
        command = ["run", "--duration", "1"] if "excitation:" in text else ["check"]
        result = CliRunner().invoke(cli, [*command, str(path)])
        assert result.exit_code == 0, result.output


def test_the_model_in_us_units():
    model = load_model(io.StringIO(readmes.block("weights")))
    # 400 kip are the weight of 400 000 lb.
    assert model.stories[0].mass == pytest.approx(400e3 * 0.45359237)
    assert model.output_units.unit("m/s^2")[0] == "g"


def test_an_additional_method_is_defined_in_one_line():
    member = eval(readmes.block("member").strip("+, \n"), vars(single_step))
    integrator = Integrator(member)
    observed = observed_order(integrator, order_problem("harmonic", "linear"))
    assert observed.order("displacement") == pytest.approx(integrator.order, abs=0.1)
    assert critical_step(integrator) == pytest.approx(integrator.stability_limit, rel=1e-4)


@pytest.mark.long
def test_the_script_of_an_array(checkout, monkeypatch):
    """The first of two tasks runs in this process, the second with the environment of Slurm. The
    merged tables equal the tables of a single call to the last byte."""
    folder, run = checkout
    monkeypatch.chdir(folder)
    campaign = (
        readmes.block("campaign")
        .replace("records/]", "records/near-fault.mseed]")
        .replace("0.2 g, ", "")
    )
    (folder / "campaign.yaml").write_text(campaign)
    (folder / "array.sh").write_text(readmes.block("slurm"))
    run("TMPDIR=$PWD SLURM_ARRAY_TASK_COUNT=2 SLURM_ARRAY_TASK_ID=2 sh array.sh")
    first = ("campaign.yaml", "-o", "parts/part-1", "--shard", "1/2")
    merged = ("merge", "parts/part-1", "parts/part-2", "-o", "all")
    for arguments in (first, ("export", "parts/part-1"), merged, ("campaign.yaml", "-o", "whole")):
        assert CliRunner().invoke(cli, ["campaign", *arguments, "-q"]).exit_code == 0
    for name in ("runs.csv", "stories.csv", "profiles.csv"):
        assert (folder / "all" / name).read_bytes() == (folder / "whole" / name).read_bytes()
    dataset = pytest.importorskip("pyarrow.dataset")
    parts = dataset.dataset(sorted(map(str, (folder / "parts").glob("part-*/runs.parquet"))))
    assert parts.count_rows() == len(rows(folder / "whole/runs.csv"))
    assert parts.schema.field("peak_drift_m").metadata[b"unit"] == b"m"


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "package"), [("calibration", "emcee"), ("sobol", "SALib"), ("surrogate", "numpy")]
)
def test_the_studies_with_other_packages(checkout, name, package):
    """The Markov chain recovers the true parameters, the drifts depend most on the hardening, and
    the surrogate explains most of the variance."""
    pytest.importorskip(package)
    _, run = checkout
    script = (readmes.ROOT / "tests" / "external" / f"{name}.py").read_text()
    statements = [node for node in ast.walk(ast.parse(script)) if isinstance(node, ast.stmt)]
    assert len(statements) <= 45  # The example must be short.
    output, _ = run(shlex.join([sys.executable, "-c", script]))
    numbers = [
        [float(number) for number in re.findall(r"-?\d+\.\d+", line)]
        for line in output.splitlines()
    ]
    if name == "calibration":
        (_, *numbers) = numbers
        assert all(abs(mean - true) < 5.0 * spread + 0.05 * true for mean, spread, true in numbers)
    elif name == "sobol":
        assert max(range(4), key=lambda i: numbers[i][1]) == 2
    else:
        (error, spread) = numbers[-1]
        assert error < 0.5 * spread
