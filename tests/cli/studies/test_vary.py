"""Numbers of `vary` in units of the models, reports of variations and of buildings that are not
compared, and paths in tables of factors."""

import math
import re
from pathlib import Path

import numpy as np
import pytest
from tests.cli.studies.test_routes import write_study

from csv_rows import rows
from tdint.studies.fragility.fragility_function import Fragility
from tdint.studies.fragility.hazard import HazardCurve, at_risk

FRAME = (
    (
        "name: frame\nunits: {length: mm, force: kN}\n"
        "stories: [{repeat: 2, mass: 0.1, height: 3200, stiffness: 40}]\n"
        "attachments: [{name: tmd, floor: 2, mass: 0.002, stiffness: 0.3, dashpot: 0.005}]\n"
        "damping: {rayleigh: {ratio: 5%, modes: [1, 2]}}\n"
    )
    .replace("length: mm, force: kN", "length: mm, force: kN, mass: kN*s^2/m")
    .replace("mass: 0.1", "mass: 100")
    .replace("mass: 0.002", "mass: 2")
)
"""Stiffnesses in kN/mm, the dashpot in kN s/mm."""


def study(folder, vary, models="frame.yaml", more=""):
    (folder / "study.yaml").write_text(
        f"buildings: {{models: [{models}]}}\nrecords: {{files: [other.mseed]}}\n{vary}{more}"
    )


def varied(folder, tdint, vary, column):
    study(folder, f"vary: {{{vary}}}\n")
    shown = tdint("campaign", "study.yaml", "-q", "--overwrite", "-o", "out", code=0).stderr
    table = rows(folder / "out" / "runs.csv")
    return [(float(row[column]), float(row["peak_drift_m"])) for row in table], shown


PARAMETERS = [
    ("stories[1].stiffness", "45", "45 kN/mm", 45e6, "stories[1].stiffness_N_m"),
    ("attachments[tmd].dashpot", "0.009", "9 kN s/m", 9e3, "attachments[tmd]_dashpot_Ns_m"),
    ("story 2.height", "3000", "3 m", 3.0, "story_2_height_m"),
    ("story 2.mass", "90", "90000 kg", 9e4, "story_2_mass_kg"),
]


@pytest.mark.parametrize(("name", "number", "text", "si", "column"), PARAMETERS)
def test_numbers_are_in_units_of_the_model(folder, tdint, name, number, text, si, column):
    """A number, a text with a unit, a distribution without scatter, and the number in the model
    file give the same response; one line states the unit, `check` the values."""
    (folder / "frame.yaml").write_text(FRAME)
    ((value, drift),), shown = varied(folder, tdint, f"'{name}': [{number}]", column)
    unit = tdint("check", "study.yaml", code=0).stderr
    assert value == pytest.approx(si)
    assert f"vary: {name}: numbers are in " in shown and "units of frame.yaml" in shown
    assert re.search(rf"vary: {re.escape(name)}: {number} [kmst]", unit, re.IGNORECASE)
    ((other, same),), shown = varied(folder, tdint, f"'{name}': ['{text}']", column)
    assert (other, same) == pytest.approx((si, drift), rel=1e-9) and "numbers are in" not in shown
    spread = f"'{name}': {{lognormal: {{median: {number}, beta: 1.0e-9}}}}, samples: 1"
    ((other, same),), _ = varied(folder, tdint, spread, column)
    assert (other, same) == pytest.approx((si, drift), rel=1e-6)
    key = name.rpartition(".")[2]
    pattern = r"(name: tmd.*?dashpot: )[\d.]+" if "tmd" in name else rf"(repeat.*?{key}: )[\d.]+"
    if name in ("stories[1].stiffness", "attachments[tmd].dashpot"):
        changed = re.sub(pattern, rf"\g<1>{number}", FRAME)
        if "stories" in name:
            one = "{mass: 100, height: 3200, stiffness: %s}"
            changed = re.sub(r"stories: .*", f"stories: [{one % number}, {one % 40}]", FRAME)
        (folder / "frame.yaml").write_text(changed)
        study(folder, "")
        tdint("campaign", "study.yaml", "-q", "--overwrite", "-o", "out", code=0)
        (row,) = rows(folder / "out" / "runs.csv")
        assert float(row["peak_drift_m"]) == pytest.approx(drift, rel=1e-9)


def test_units_of_columns_and_other_units_of_models(folder, tdint):
    (folder / "frame.yaml").write_text(FRAME)
    (folder / "si.yaml").write_text(
        "name: si\ndamping: 5%\n"
        "stories: [{repeat: 2, mass: 1.0e5, height: 3.2, stiffness: 4.0e7}]\n"
    )
    study(folder, "vary: {'story 1.stiffness': [45]}\n", models="frame.yaml, si.yaml")
    for command in (("check", "study.yaml"), ("campaign", "study.yaml", "-o", "out")):
        message = "different units (kN/mm and N/m); write each number with its unit"
        assert message in tdint(*command, code=3).stderr
    study(folder, "vary: {'story 1.stiffness': [45 kN/mm]}\n", models="frame.yaml, si.yaml")
    tdint("campaign", "study.yaml", "-o", "out", "--output-units", "kN,mm", code=0)
    assert {row["story_1_stiffness_kN_mm"] for row in rows(folder / "out" / "runs.csv")} == {"45"}
    study(folder, "vary: {'story 1.stiffness': [45 kN]}\n")
    assert "story 1.stiffness must be a number" in tdint("check", "study.yaml", code=3).stderr
    study(folder, "vary: {damping: [2%, 5%], stiffness_factor: [0.9]}\n")
    tdint("campaign", "study.yaml", "-o", "factors", code=0)
    assert {"damping", "stiffness_factor"} <= rows(folder / "factors" / "runs.csv")[0].keys()


def test_a_store_with_numbers_in_si_is_not_continued(folder, tdint):
    """A store of an earlier version with the same numbers has another setting."""
    (folder / "frame.yaml").write_text(FRAME)
    study(folder, "vary: {'story 1.stiffness': [45000000 N/m]}\n")
    tdint("campaign", "study.yaml", "-o", "out", code=0)
    study(folder, "vary: {'story 1.stiffness': [45]}\n")
    refused = tdint("campaign", "study.yaml", "-o", "out", code=6)
    assert "numbers of vary are in units of the models" in refused.stderr
    assert "kN/mm" in refused.stderr


def test_sensitivity_in_units_of_the_model(folder, tdint):
    (folder / "frame.yaml").write_text(FRAME)
    call = ("sensitivity", "frame.yaml", "motion.mseed", "-q", "--vary")
    plain = tdint(*call, "story 1.stiffness=35:45", code=0)
    texts = tdint(*call, "story 1.stiffness=35 kN/mm:4.5e7 N/m", code=0)
    assert plain.stdout == texts.stdout and "35000000" in plain.stdout
    assert "numbers are in kN/mm, units of frame.yaml" in plain.stderr
    assert "numbers are in" not in texts.stderr
    tdint.refused("LOW less than HIGH", *call, "story 1.stiffness=45:35", code=2)


@pytest.mark.parametrize(
    ("vary", "message"),
    [
        ("vary: {stiffness_factor: []}\n", "stiffness_factor: is empty"),
        ("vary: {'story 9.mass': [100]}\n", "story 9.mass: story not found"),
        (
            "vary: {mass_factor: {normal: {mean: 0.1, sd: 1}}, samples: 9}\n",
            "mass_factor must be a",
        ),
        ("vary: {'story 1.stiffness': {uniform: {low: 30, high: 50 kN/m}}, samples: 3}\n", "unit"),
        ("intensity: {factors: none.csv}\n", "none.csv"),
        ("analysis: {dt: 0.007}\n", "0.007"),
    ],
)
def test_check_finds_what_the_campaign_refuses(folder, tdint, vary, message):
    (folder / "frame.yaml").write_text(FRAME)
    study(folder, vary)
    for command in (("check", "study.yaml"), ("campaign", "study.yaml", "-o", "out")):
        result = tdint(*command)
        assert result.exit_code in (2, 3) and message in result.stderr
    assert tdint("check", "study.yaml").exit_code == 3
    assert not (folder / "out" / "runs.csv").exists()


def lead(page):
    return re.sub(
        r"\s+", " ", re.sub(r"<[^>]+>", " ", Path(page).read_text("utf-8").split("<h2")[0])
    )


def test_reports_of_variations_name_no_best(folder, tdint):
    """Draws are pooled, bounds have the largest value, methods their difference; models are
    compared with a baseline only."""
    (folder / "frame.yaml").write_text(FRAME)
    soft = FRAME.replace("name: frame", "name: soft").replace("stiffness: 40", "stiffness: 30")
    (folder / "soft.yaml").write_text(soft)
    more = "intensity: {scales: [1, 2]}\n"
    draws = "vary: {stiffness_factor: {lognormal: {median: 1, beta: 0.2}}, samples: 5}\n"
    cases = {
        "draws": (draws, "frame.yaml", "median drift"),
        "bounds": ("vary: {stiffness_factor: [0.8, 1.2]}\n", "frame.yaml", "largest mean drift"),
        "methods": ("analysis: {methods: [bathe, hht]}\n", "frame.yaml", "errors of the time"),
        "models": ("", "frame.yaml, soft.yaml", "Largest drift ratio"),
    }
    for name, (vary, models, text) in cases.items():
        study(folder, vary, models, more)
        call = ("campaign", "study.yaml", "-o", name, "--report", f"{name}.html")
        shown = tdint(*call, code=0).stderr
        first = lead(folder / f"{name}.html")
        page = (folder / f"{name}.html").read_text("utf-8")
        assert text in first, first[:400]
        assert "Best" not in first and "times baseline" not in page.lower()
        assert ("--baseline NAME" in shown) == (name == "models")
        if name == "draws":
            drifts = [
                float(row["peak_drift_ratio"])
                for row in rows(folder / name / "runs.csv")
                if row["scale"] == "1"
            ]
            median = math.exp(np.median(np.log(drifts)))
            assert f"median drift {100.0 * median:.3g} %" in first
            assert f"mean {100.0 * np.mean(drifts):.3g} %" in first
            assert page.count("Statistics over the ground motions") == 2
    call = ("campaign", "study.yaml", "-o", "models", "--report", "best.html", "--baseline", "soft")
    tdint(*call, code=0)
    assert "Best at scale 1: frame" in lead(folder / "best.html")


def test_levels_at_the_period_of_each_building_are_not_compared(folder, tdint):
    (folder / "frame.yaml").write_text(FRAME)
    soft = FRAME.replace("name: frame", "name: soft").replace("stiffness: 40", "stiffness: 30")
    (folder / "soft.yaml").write_text(soft)
    more = "intensity: {measure: sa, period: T1, levels: [1 m/s^2]}\n"
    study(folder, "", "frame.yaml, soft.yaml", more)
    call = ("campaign", "study.yaml", "-o", "out")
    refused = tdint(*call, "--baseline", "soft", code=3)
    period = re.search(r"`period: ([\d.]+)`", refused.stderr)[1]
    assert not (folder / "out" / "runs.csv").exists()
    assert "factors of a motion differ between the buildings" in tdint(*call, code=0).stderr
    export = ("campaign", "export", "out", "--baseline", "soft")
    tdint.refused("factors of a motion differ", *export, code=3)
    study(folder, "", "frame.yaml, soft.yaml", more.replace("T1", period))
    tdint("campaign", "study.yaml", "-o", "one", "--baseline", "soft", code=0)
    assert len({row["scale"] for row in rows(folder / "one" / "runs.csv")}) == 1
    assert any(row["mean_ratio"] for row in rows(folder / "one" / "ratios.csv"))


def test_a_factor_belongs_to_a_file(folder, tdint, monkeypatch):
    """A table of factors is used from any directory; a name that two files have is refused."""
    (folder / "study").mkdir()
    (folder / "study" / "frame.yaml").write_text(FRAME)
    (folder / "study" / "c.yaml").write_text(
        "buildings: {models: [frame.yaml]}\nrecords: {files: [../in]}\n"
        "intensity: {factors: factors.csv}\n"
    )
    (folder / "in").mkdir()
    for name in ("motion", "other"):
        (folder / f"{name}.mseed").rename(folder / "in" / f"{name}.mseed")
    table = folder / "study" / "factors.csv"
    found = []
    for text in ("in/", "./in/", str(folder / "in") + "/", "../in/", "elsewhere/", ""):
        table.write_text(f"record,component,factor\n{text}motion.mseed,,2\n{text}other.mseed,,3\n")
        for directory, file in ((folder, "study/c.yaml"), (folder / "study", "c.yaml")):
            if text == "in/" and directory == folder / "study":
                continue  # neither relative to the directory nor to the table: by the name
            monkeypatch.chdir(directory)
            tdint("campaign", file, "--overwrite", "-o", str(folder / "out"), code=0)
            found.append(sorted(row["scale"] for row in rows(folder / "out" / "runs.csv")))
    assert found == [["2", "2", "3"]] * len(found)
    monkeypatch.chdir(folder)
    table.write_text("record,component,factor\nelsewhere/motion.mseed,,2\nin/other.mseed,,3\n")
    (folder / "in" / "b").mkdir()
    (folder / "in" / "b" / "motion.mseed").write_bytes((folder / "in/motion.mseed").read_bytes())
    text = (folder / "study" / "c.yaml").read_text().replace("[../in]", "[../in, ../in/b]")
    (folder / "study" / "c.yaml").write_text(text)
    assert "elsewhere/motion.mseed can be" in tdint("check", "study/c.yaml", code=3).stderr


def test_srss_of_a_pair(folder, tdint):
    """The factor of SRSS is the target over the square root of the sum of squares."""
    write_study(folder, 2, pairs=1)
    call = ("scale", "records", "--to", "sa=0.5g", "--at", "0.3", "--pairs", "srss")
    factors = {row["factor"] for row in rows(tdint(*call, code=0).stdout)}
    spectra = rows(tdint("spectrum", "records", "--period", "0.3", code=0).stdout)
    values = [float(row["psa_m_s2"]) for row in spectra]
    assert [float(factor) for factor in factors] == pytest.approx(
        [0.5 * 9.80665 / math.hypot(*values)]
    )


def test_a_given_function_and_the_expected_annual_loss(folder, tdint):
    """The annual frequency of a given function is that of the fit with its values; the expected
    annual loss is the integral of the mean loss over the hazard."""
    (folder / "h.csv").write_text("im,unit,rate\n0.1,g,0.02\n0.4,g,0.001\n1.6,g,2e-5\n")
    call = ("fragility", "--theta", "0.4g", "--beta", "0.3", "--hazard", "h.csv")
    (row,) = rows(tdint(*call, code=0).stdout)
    curve = HazardCurve(np.array([0.1, 0.4, 1.6]), np.array([0.02, 0.001, 2e-5]), unit="g")
    given = Fragility("given", 0.4, 0.3, np.full((2, 2), math.nan), 0, unit="g")
    assert float(row["annual_frequency"]) == pytest.approx(curve.risk(given).annual_frequency)
    assert float(row["theta"]) == pytest.approx(0.4 * 9.80665) and row["unit"] == "m/s^2"
    tdint.refused("--theta requires --beta", *call[:3], "--hazard", "h.csv", code=2)
    tdint.refused("TABLE.csv or DIR is required", "fragility", code=2)
    states = [(0.2, 0.1), (0.4, 0.5), (0.9, 0.4)]
    functions = [
        Fragility("given", theta, 0.4, given.covariance, 0, unit="g", type="a", loss_increment=loss)
        for theta, loss in states
    ]
    results, _ = at_risk(functions, curve)
    im = np.geomspace(1e-3, 1e3, 400_001)
    loss = sum(item.loss_increment * item.probability(im) for item in functions)
    integral = -np.sum(0.5 * (loss[1:] + loss[:-1]) * np.diff(curve.rates(im)))
    assert [item.annual_loss for item in results] == pytest.approx([integral] * 3, rel=1e-4)


def test_a_curve_without_a_period_for_several(folder):
    curve = HazardCurve(np.array([0.1, 1.6]), np.array([0.02, 2e-5]), unit="g", source="h.csv")
    functions = [
        Fragility("stripes", 0.4, 0.3, np.full((2, 2), math.nan), 9, unit="g", im=name)
        for name in ("sa(0.5)", "sa(0.8)")
    ]
    assert "does not state its intensity measure" in at_risk(functions, curve)[1][0]
    assert not at_risk(functions[:1], curve)[1]
