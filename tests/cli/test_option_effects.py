"""Effects of single options as numbers: closed forms, other commands, and keys of files."""

import json
import re
from importlib import resources
from pathlib import Path

import numpy as np
import pytest

from cli.conftest import STUDY
from csv_rows import rows

BUILDINGS = "id,NumberOfStories,YearBuilt,StructureType,PlanArea\ntower,2,1987,C1,900\n"
MOTION = "other.mseed --units m/s^2"


def test_mass_only_damping_of_an_inventory(working_directory, tdint):
    """The damping ratio of a mode is proportional to its period without the part that is
    proportional to stiffness."""
    Path("buildings.csv").write_text(BUILDINGS)
    ratios = {}
    for damping in ("full", "mass-only"):
        call = f"inventory buildings.csv --units m --damping {damping} --models {damping}"
        tdint(*call.split(), code=0)
        modes = rows(tdint("modes", f"{damping}/tower.yaml", code=0).stdout)
        ratios[damping] = np.array([float(row["damping"]) for row in modes])
        periods = np.array([float(row["period_s"]) for row in modes])
    assert ratios["full"] == pytest.approx(ratios["full"][0], rel=1e-6)
    assert ratios["mass-only"] / periods == pytest.approx(ratios["mass-only"][0] / periods[0])
    assert ratios["mass-only"][1] < 0.5 * ratios["full"][1]


def test_method_of_a_comparison(folder, tdint):
    """The option has the effect of the key `analysis.method`."""
    model = Path("forced.yaml").read_text()
    model = model[: model.index("excitation")] + "excitation: {record: {file: motion.mseed, "
    model += "component: HNE, units: m/s^2}}\n"
    recorded = "base: {file: motion.mseed, component: HNE, units: m/s^2}\n"
    recorded += "floors: {1: {file: motion.mseed, component: HNN, units: m/s^2, quantity: "
    recorded += "acceleration}}\n"
    Path("recorded.yaml").write_text(recorded)
    found = {}
    for name, options, line in (
        ("default", "", ""),
        ("option", "--method newmark-average", ""),
        ("key", "", "analysis: {method: newmark-average}\n"),
    ):
        Path("model.yaml").write_text(model + line)
        call = f"compare model.yaml --recorded recorded.yaml {options}"
        found[name] = tdint(*call.split(), code=0).stdout
    assert found["option"] == found["key"] != found["default"]


@pytest.mark.usefixtures("folder", "short_matching")
def test_damping_of_a_matched_spectrum(tdint):
    """The misfit in the table is that of the spectrum with the damping ratio of the option."""
    Path("flat.csv").write_text("period_s,sa_g\n0.05,0.3\n4,0.3\n")
    call = f"match {MOTION} --target flat.csv --range 0.2:0.6 --damping 2% -o m"
    tdint(*call.split(), code=0)
    (row,) = rows("m/matched.csv")
    (file,) = Path("m").glob("*.mseed")
    misfits = {}
    for damping in ("2%", "5%"):
        line = f"spectrum {file} --damping {damping} --periods 0.201:0.599:40"
        values = [float(line["psa_m_s2"]) for line in rows(tdint(*line.split(), code=0).stdout)]
        misfits[damping] = np.max(np.abs(np.array(values) / (0.3 * 9.80665) - 1.0))
    stated = float(row["largest_misfit"])
    assert 0.5 * stated < misfits["2%"] <= 1.001 * stated
    assert abs(misfits["5%"] / stated - 1.0) > 0.1


def test_records_of_a_table_of_factors(folder, tdint):
    """An analysis of intensities reads the records of the table, and ignores its factors."""
    tdint(*f"scale {MOTION} --pga 0.5g -o factors.csv".split(), code=0)
    call = "ida shaken.yaml --im pga --max-im 0.05g -o"
    tdint(*call.split(), "direct", *MOTION.split(), code=0)
    tdint(*call.split(), "listed", "--factors", "factors.csv", code=0)
    expected = rows("direct/ida.csv")
    assert float(expected[0]["peak_drift_ratio"]) > 0.0
    assert rows("listed/ida.csv") == expected


def test_residual_drifts_of_capacities_are_taken_at_rest(folder, tdint):
    """The residual drift ratio is that of `run` with the same factor, which changes with
    --until-rest."""
    ratios = {}
    for options in ((), ("--until-rest",)):
        call = f"ida shaken.yaml {MOTION} --im pga --max-im 0.6g -o out --overwrite"
        tdint(*call.split(), *options, code=0)
        level = rows("out/ida.csv")[-1]
        call = f"run shaken.yaml {MOTION} --scale {level['scale']} --no-check"
        stories = rows(tdint(*call.split(), *options, code=0).stdout)
        ratios[options] = max(float(row["residual_drift_m"]) / 3.0 for row in stories)
        assert float(level["residual_drift_ratio"]) == pytest.approx(ratios[options], rel=1e-6)
    assert len(set(ratios.values())) == 2


def test_all_methods_of_a_figure(working_directory, tdint):
    for options, has_houbolt in (("", False), ("--all", True)):
        tdint(*f"overshoot --steps 5 -o o.csv --plot o.svg --overwrite {options}".split(), code=0)
        assert ("houbolt" in Path("o.svg").read_text()) == has_houbolt


def test_samples_per_step_of_a_record(tdint):
    """The order is kept with several samples per step, and the error is that of another record
    (noise with a smaller sampling interval)."""
    found = []
    for stride in (1, 4):
        call = f"order --method newmark-average --load record --stride {stride}"
        (row,) = rows(tdint(*call.split(), code=0).stdout)
        assert float(row["displacement_order"]) == pytest.approx(2.0, abs=0.01)
        found.append(float(row["displacement_error"]))
    assert abs(found[1] / found[0] - 1.0) > 0.1


def test_publications_of_methods(tdint):
    """Each method of each publication is a row, and each publication is an entry."""
    text = (resources.files("tdint.methods") / "publications.bib").read_text("utf-8")
    described = re.findall(r"keywords = {(.*)}", text)
    table = rows(tdint("methods", "--references", code=0).stdout)
    assert len(table) == sum(len(names.split(", ")) for names in described)
    assert {row["method"] for row in table} == set(", ".join(described).split(", "))
    assert tdint("methods", "--bibtex", code=0).stdout.count("@") == len(described)


def test_compiled_loops_of_a_method(folder, tdint):
    """The loop of the step is that of the method of the option."""
    for method, module in (("moment4", "moment4"), ("newmark-average", "single_step")):
        call = f"compile shaken.yaml --show --method {method}"
        loops = {row["loop"] for row in rows(tdint(*call.split(), code=0).stdout)}
        assert [name for name in loops if name.startswith("tdint.methods.")] == [
            f"tdint.methods.{module}:step"
        ]


def test_name_of_a_campaign(folder, tdint):
    """The name in the summary is that of the file, or the key `name`."""
    for line, name in (("", "study"), ("name: two towers\n", "two towers")):
        Path("study.yaml").write_text(f"{line}{STUDY}")
        tdint("campaign", "study.yaml", "-o", name.partition(" ")[0], code=0)
        summary = json.loads(Path(name.partition(" ")[0], "summary.json").read_text())
        assert summary["name"] == name
