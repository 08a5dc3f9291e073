"""`tdint fragility`: functions of tables and studies, their units, and errors."""

import math
import re
from pathlib import Path

import numpy as np
import pytest
from scipy.stats import spearmanr

import tdint as tdint_library
from csv_rows import rows
from facts import states
from peer_files import write_at2

CONFIGS = Path(__file__).parents[3] / "configs"


@pytest.mark.parametrize(
    ("text", "name", "arguments"),
    [
        ("capacity,unit\n0.2,g\n0.3,g\n0.5,g\n", "capacity", ()),
        ("im,collapses,records,unit\n0.2,1,9,g\n0.4,4,9,g\n0.8,8,9,g\n", "im", ()),
        (
            "im,edp,unit\n0.1,0.004,g\n0.2,0.007,g\n0.4,0.019,g\n0.6,0.021,g\n",
            "im",
            ("--threshold", "1%"),
        ),
    ],
    ids=["capacities", "stripes", "cloud"],
)
def test_fragility_in_other_units(folder, tdint, text, name, arguments):
    """The converted median equals the median of converted values. Dispersions have no unit.
    Figures are in g."""
    (folder / "g.csv").write_text(text)
    table = [row | {name: repr(9.80665 * float(row[name])), "unit": "m/s^2"} for row in rows(text)]
    lines = [",".join(table[0]), *(",".join(row.values()) for row in table)]
    converted = tdint(
        "fragility g.csv", *arguments, "--output-units", "m", "--plot=given.svg", code=0
    )
    direct = tdint("fragility -", *arguments, "--plot=direct.svg", stdin="\n".join(lines).encode())
    assert converted.stderr == direct.stderr
    for row, other in zip(rows(converted.stdout), rows(direct.stdout), strict=True):
        assert row["unit"] == other["unit"] == "m/s^2"
        for key in ("theta", "beta", "theta_error", "beta_error"):
            assert float(row[key]) == pytest.approx(float(other[key]), rel=1e-6)
    pictures = [(folder / f"{name}.svg").read_text("utf-8") for name in ("given", "direct")]
    labels = [re.findall(r"<text[^>]*>([^<]*)</text>", picture) for picture in pictures]
    assert labels[0] == labels[1] and any("(g)" in label for label in labels[0])


def test_an_intensity_without_a_unit_is_not_converted(folder, tdint):
    tdint.refused(
        "add a column `unit` to the table",
        "fragility",
        CONFIGS / "stripes.csv",
        "--output-units",
        "g",
    )


def test_fragility_of_an_ida_directory(folder, tdint, make_record):
    for samples in (60, 120):
        make_record(folder / f"{samples}.mseed", "HNE", samples=samples)
    records = ("motion.mseed", "60.mseed", "120.mseed", "--component", "HNE", "--units", "m/s^2")
    tdint("ida", "shaken.yaml", *records, "-o", "out", code=0)
    found = rows(tdint("fragility", "out").stdout)
    assert [row["threshold"] for row in found] == ["0.01", "0.02", "0.04", "0.1"]
    assert {(row["fit"], row["motions"], row["unit"]) for row in found} == {("ida", "3", "m/s^2")}
    assert rows(tdint("fragility", "out", "--threshold", "2%").stdout) == [found[1]]
    (cloud,) = rows(tdint("fragility", "out", "--fit", "cloud", "--threshold", "2%").stdout)
    assert float(cloud["theta"]) == pytest.approx(float(found[1]["theta"]), rel=0.5)


def test_runs_of_a_campaign_at_common_levels_are_stripes(folder, tdint):
    """Runs at common levels are stripes. A run without a result is excluded and reported.
    tests/studies/fragility/test_fit_table.py tests the bounds."""
    header = "building,record,status,peak_drift_ratio,sa_t1_m_s2"
    lines = [
        f"a,{record},{'collapsed' if drift == 0.05 else 'done'},{drift},{level}"
        for level, drifts in (
            (1.0, (0.01, 0.01, 0.02)),
            (2.0, (0.01, 0.05, 0.02)),
            (3.0, (0.04, 0.05, 0.02)),
        )
        for record, drift in enumerate(drifts)
    ]
    (folder / "runs.csv").write_text("\n".join([header, *lines, "a,9,not-converged,,1.0"]) + "\n")
    result = tdint("fragility", ".", "--threshold", "3%")
    (row,) = rows(result.stdout)
    assert (row["fit"], row["im"], row["unit"], row["motions"]) == (
        "stripes", "sa(T1)", "m/s^2", "3",
    )  # fmt: skip
    assert states(result.stderr, "1 of 10 runs ... omitted")
    assert row["failed"] == "1" and "count all of these runs as exceeding" in result.stderr
    assert (
        float(row["theta_failed_exceed"]) < float(row["theta"]) < float(row["theta_failed_stand"])
    )


@pytest.mark.parametrize(
    ("text", "options", "code", "message"),
    [
        ("building,status,peak_drift_ratio,im\na,done,0.1,1\nb,done,0.2,1\n", (), 3,
         "runs.csv: column building ... got a, b"),
        ("building,status,peak_drift_ratio\na,done,0.1\n", (), 3, "no column sa_t1_m_s2"),
        ("building,status,peak_drift_ratio\na,done,0.1\n", ("--im", "pgv"), 2,
         "the runs have no measure pgv"),
        (None, (), 3, "no capacities.csv and no runs.csv"),
    ],
)  # fmt: skip
def test_unusable_runs_are_refused(folder, tdint, text, options, code, message):
    if text:
        (folder / "runs.csv").write_text(text)
    tdint.refused(message, "fragility", ".", "--threshold", "3%", *options, code=code)


def test_thresholds_that_cannot_be_fitted_are_reported_and_the_others_fitted(folder, tdint):
    (folder / "c.csv").write_text(
        "threshold,capacity,censored,im_name,unit\n"
        "0.01,1,false,pga,m/s^2\n0.01,2,false,pga,m/s^2\n0.1,3,true,pga,m/s^2\n0.1,,true,pga,m/s^2\n"
    )
    result = tdint("fragility", "c.csv", code=0)
    assert [row["threshold"] for row in rows(result.stdout)] == ["0.01"]
    assert "Warning: threshold 0.1: an estimate of median" in result.stderr
    assert "omitted 1 row without a capacity" in result.stderr
    result = tdint("fragility", "c.csv", "--threshold", "10%")
    assert (result.exit_code, result.stdout) == (5, "")


@pytest.mark.parametrize(
    ("text", "arguments", "code", "message"),
    [
        ("im,collapses,records\n1,0,3\nx,1,3\n", (), 3, "t.csv:3: im ... got 'x'"),
        ("im,collapses,records\n1,0,3\n2,1.5,3\n", (), 3,
         "t.csv:3: collapses must be a whole number"),
        ("capacity,im,edp\n1,1,1\n2,2,2\n", (), 2,
         "t.csv:1: ... capacity and im,edp ... --fit ida or --fit cloud"),
        ("capacity\n1\n2\n3\n", ("--modeling-dispersion", "1e308"), 2,
         "'--modeling-dispersion': 1e+308 is not in the range"),
        ("im,collapses,records\n1,0,3\n2,4,3\n", (), 3, "t.csv:3: collapses ... records"),
        ("im,collapses,records\n0,0,3\n2,3,3\n", (), 3, "t.csv:2: im must be positive, got '0'"),
        ("im,collapses,records\n1,0,3\n2,0,3\n", (), 5, "no record exceeds at any level"),
        ("im,collapse,records\n1,0,3\n", (), 3, "t.csv:1: ... im,collapses,records (stripes)"),
        ("capacity,censored\n1,perhaps\n", (), 3, "t.csv:2: censored ... got 'perhaps'"),
        ("capacity\n1\n-2\n", (), 3, "t.csv:3: capacity ... got '-2'"),
        ("capacity\n1\n2\n", ("--fit", "cloud"), 2,
         "the columns of this table are for --fit ida, not cloud"),
        ("capacity\n1\n2\n", ("--threshold", "1%,2%"), 2,
         "no column threshold, ... one --threshold"),
        ("threshold,capacity\n0.1,1\n0.1,2\n", ("--threshold", "2%"), 2,
         "threshold 0.02 not found; the thresholds of the table are 0.1"),
        ("capacity,im_name\n1,pga\n2,pgv\n", (), 3, "column im_name ... got pga, pgv"),
        ("im,edp\n1,2\n2,3\n3,4\n", (), 2, "a demand threshold is required; specify --threshold"),
        ("im,edp\n1,2\n2,3\n3,5\n", ("--threshold", "0.3", "--edp-range", "3:2"), 2,
         "LOW must be less than HIGH"),
        ("im,edp\n1,2\n", ("--fit", "stripes", "--edp-range", "2:"), 2,
         "--edp-range can only be used with --fit cloud"),
        ("capacity,threshold\n1,\n2\n", (), 3, "t.csv: no row has a threshold"),
        ("", (), 3, "t.csv: the file is empty"),
        ("im,im,edp\n1,2,3\n", (), 3, "t.csv:1: ... column im twice"),
    ],
)  # fmt: skip
def test_invalid_tables_are_refused(folder, tdint, text, arguments, code, message):
    (folder / "t.csv").write_text(text)
    tdint.refused(message, "fragility", "t.csv", *arguments, code=code)


STRIPES = """im,collapses,records,im_name,unit
0.15,1,20,sa(0.8),g
0.3,5,20,sa(0.8),g
0.6,14,20,sa(0.8),g
"""
HAZARD = """im,unit,rate
0.05,g,0.04
0.1,g,0.016
0.2,g,0.0045
0.4,g,0.0009
0.8,g,0.00013
1.6,g,1.1e-05
3.2,g,6e-07
"""


def test_annual_frequency(folder, tdint):
    """Another program computed the frequencies of both dispersions. Output units change neither
    frequencies nor probabilities."""
    (folder / "stripes.csv").write_text(STRIPES)
    (folder / "hazard.csv").write_text(HAZARD)
    command = "fragility stripes.csv --hazard hazard.csv --modeling-dispersion 0.35"
    shown = tdint(command, "--report", "page.html", code=0)
    (row,) = rows(shown.stdout)
    expected = {
        "annual_frequency": 0.0017473356639399673,
        "annual_frequency_total": 0.002162875811259686,
        "probability_50_years": 0.08365906446989191,
        "probability_50_years_total": 0.10250146466789978,
    }
    for name, value in expected.items():
        assert float(row[name]) == pytest.approx(value, rel=1e-6)
    assert "8.37 % in 50 years" in shown.stderr and "Risk target" in shown.stderr
    page = (folder / "page.html").read_text("utf-8")
    assert "Mean annual frequency of exceedance" in page and "0.4985" in page
    (other,) = rows(tdint(command, "--output-units", "m", code=0).stdout)
    for name in expected:
        assert float(other[name]) == pytest.approx(float(row[name]), rel=1e-9)
    for name in ("contributing_im", "risk_targeted_theta", "risk_targeted_im"):
        assert float(other[name]) == pytest.approx(9.80665 * float(row[name]), rel=1e-9)


def test_frequency_from_outside_the_curve(folder, tdint):
    """The uncertainty by other continuations: up to 1 % without a message, up to 10 % with a
    warning, and more only if it is allowed."""
    (folder / "stripes.csv").write_text(STRIPES)
    lines = HAZARD.splitlines(keepends=True)
    (folder / "some.csv").write_text("".join(lines[:-2]))
    (folder / "few.csv").write_text("".join(lines[:4]))
    assert "outside the points" in tdint("fragility stripes.csv --hazard some.csv", code=0).stderr
    refused = tdint("fragility stripes.csv --hazard few.csv -o out.csv", code=5)
    assert "add points to the curve" in refused.stderr
    assert not (folder / "out.csv").exists()
    allowed = tdint("fragility stripes.csv --hazard few.csv --allow-outside", code=0)
    assert float(rows(allowed.stdout)[0]["share_outside"]) > 0.1
    assert "outside the points" in allowed.stderr
    tdint.refused("--hazard", "fragility", "stripes.csv", "--allow-outside")


def test_k3_capacities_of_draws_are_pooled(folder, tdint):
    """K3: three draws of the properties under four motions; the jackknife omits motions."""
    logarithms = [[-1.2, -0.9, -0.8, -0.5], [-1.0, -0.6, -0.7, -0.3], [-1.5, -1.1, -0.9, -0.8]]
    lines = ["record,draw,capacity"]
    for draw, values in enumerate(logarithms):
        lines += [f"r{i},{draw},{math.exp(value)!r}" for i, value in enumerate(values)]
    (folder / "capacities.csv").write_text("\n".join(lines) + "\n")
    result = tdint("fragility capacities.csv", code=0)
    (row,) = rows(result.stdout)
    found = [
        float(row[name])
        for name in ("theta", "beta", "beta_within", "beta_between", "theta_error", "motions")
    ]
    assert found == pytest.approx(
        [0.4238679405, 0.3232177238, 0.2958039892, 0.2126225137, 0.1442573575, 4], rel=1e-9
    )
    assert "beta within draws 0.296, between draws 0.213" in result.stderr
    # A single draw, and a draw with one capacity, determine no dispersion between draws.
    for kept in (lines[:5], lines[:-3]):
        (folder / "fewer.csv").write_text("\n".join(kept) + "\n")
        (row,) = rows(tdint("fragility fewer.csv", code=0).stdout)
        assert "beta_within" not in row


@pytest.fixture
def drawn(folder, tdint):
    """Run a campaign of six draws of a linear frame under five motions at five levels."""
    (folder / "frame.yaml").write_text(
        "name: frame\nunits: {length: m, force: kN, mass: t}\n"
        "stories: [{mass: 100, height: 3, stiffness: 16000}]\ndamping: 5%\n"
    )
    time = np.arange(500) * 0.01
    for number, omega in enumerate((8.0, 10.0, 12.0, 15.0, 19.0)):
        values = 0.2 * np.sin(omega * time) * np.exp(-((time - 2.0) ** 2))
        write_at2(folder / f"RSN{number}.AT2", f"RSN{number}, 000", values)
    (folder / "draws.yaml").write_text(
        "buildings: {models: [frame.yaml]}\n"
        "records: {files: [RSN0.AT2, RSN1.AT2, RSN2.AT2, RSN3.AT2, RSN4.AT2]}\n"
        "analysis: {method: exact}\n"
        "intensity: {measure: pga, levels: [0.1 g, 0.2 g, 0.3 g, 0.4 g, 0.6 g]}\n"
        "vary:\n  stiffness_factor: {lognormal: {median: 1, beta: 0.3}}\n"
        "  mass_factor: {uniform: {low: 0.9, high: 1.1}}\n  samples: 6\n"
        "  correlation: {parameters: [stiffness_factor, mass_factor], "
        "matrix: [[1, 0.9], [0.9, 1]]}\n"
    )
    return tdint("campaign draws.yaml -o out", code=0)


def test_draws_of_a_campaign_are_pooled(folder, tdint, drawn):
    """All draws and motions are one set. The jackknife omits motions with all their draws."""
    assert states(drawn.stderr, "ranks (Spearman) of stiffness_factor, mass_factor")
    runs = rows((folder / "out/runs.csv").read_text())
    properties = {
        run["building"]: (float(run["stiffness_factor"]), float(run["mass_factor"])) for run in runs
    }
    assert spearmanr(np.array([*properties.values()]))[0] > 0.75
    result = tdint("fragility out --by type --threshold 1.5%", code=0)
    (row,) = rows(result.stdout)
    assert (row["type"], row["motions"], row["runs"]) == ("frame", "5", "150")

    def fit(kept):
        """Fit stripes to some of the runs."""
        levels = sorted({float(run["level"]) for run in runs})
        exceeding = [
            [float(run["peak_drift_ratio"]) > 0.015 for run in kept if float(run["level"]) == level]
            for level in levels
        ]
        return tdint_library.fit_stripes(
            np.array(levels), np.array([*map(sum, exceeding)]), np.array([*map(len, exceeding)])
        )

    pooled = fit(runs)
    assert float(row["theta"]) == pytest.approx(pooled.theta, rel=1e-6)
    assert float(row["beta"]) == pytest.approx(pooled.beta, rel=1e-6)
    logarithms = [
        math.log(fit([run for run in runs if run["motion"] != motion]).theta)
        for motion in {run["motion"] for run in runs}
    ]
    assert float(row["theta_error"]) == pytest.approx(2.0 * np.std(logarithms), rel=1e-4)
    draws = [fit([run for run in runs if run["building"] == name]) for name in properties]
    betas, thetas = ([getattr(item, name) for item in draws] for name in ("beta", "theta"))
    within, between = np.sqrt(np.mean(np.square(betas))), np.std(np.log(thetas), ddof=1)
    assert float(row["beta_within"]) == pytest.approx(within, rel=1e-6)
    assert float(row["beta_between"]) == pytest.approx(between, rel=1e-6)
    assert states(result.stderr, f"frame, ds1: beta within draws {within:.3g}, between draws")


def test_messages_on_draws(folder, tdint, drawn):
    by_type = "fragility out --by type --threshold 1.5% --modeling-dispersion 0.2"
    result = tdint(by_type, "--report", "page.html", code=0)
    assert states(result.stderr, "dispersion between the draws ... must not contain it again")
    assert "beta_between that of the medians" in (folder / "page.html").read_text("utf-8")
    tdint.refused("--by building ... variations of a model together with --by type",
                  "fragility out --threshold 1.5%", code=3)  # fmt: skip
    result = tdint("fragility out --by type --threshold 2.5%", code=0)
    assert states(result.stderr, "a draw alone determines no function")
    assert "beta_within" not in rows(result.stdout)[0]
