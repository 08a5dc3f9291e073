"""Damage states of campaigns: damage.csv, damage-types.csv and losses.csv beside closed forms, and what is refused."""

import csv
import io
import json
import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from scipy.special import ndtr

import tdint as package
from cli.conftest import Command
from csv_rows import rows
from tdint.campaign.fragility.fits import Fragility, fit_cloud, fit_stripes
from tdint.model.capacity import CapacityCurve, CapacityFacts, derive_capacity

STUDY = """\
buildings: {models: [shaken.yaml]}
records: {files: [motion.mseed, other.mseed], units: m/s^2}
intensity: {scales: [0.5, 1]}
analysis: {method: newmark-average}
"""
DAMAGE = """\
damage:
  thresholds: {slight: %r, complete: %r}
  dispersion: %g
  losses: {slight: 10%%, complete: 0.8, collapsed: 1}
"""
LOSSES = "losses: {slight: 0.1, complete: 1}"
CLASSES = """\
class,sd_m,sa_g,slight_m,moderate_m,extensive_m,complete_m,beta
A,0.004,0.15,0.003,0.01,0.03,0.06,0.4
A,0.02,0.25,,,,,
A,0.06,0.2,,,,,
B,0.005,0.3,0.004,0.02,0.04,0.05,0.5
B,0.05,0.3,,,,,
"""
BUILDINGS = "id,class,NumberOfStories\none,A,1\ntwo,A,3\nthree,B,2\n"
REGION = """\
buildings: {inventory: buildings.csv, rules: capacity, classes: classes.csv, units: {length: m}}
records: {files: [motion.mseed, other.mseed], units: m/s^2}
intensity: {scales: [0.5, 1]}
analysis: {method: newmark-average}
"""


def drifts(scale: float) -> list[float]:
    """The largest drift ratio of shaken.yaml under each component, to the last digit."""
    model = package.load_model("shaken.yaml")
    files = (("motion.mseed", "HNE"), ("motion.mseed", "HNN"), ("other.mseed", "HNE"))
    records = [package.read_record(file, component=name, units="m/s^2").scaled(scale) for file, name in files]
    return [package.run(model, one, method="newmark-average").stories.peak_drift_ratio.max() for one in records]


def probabilities(row: dict[str, str]) -> dict[str, float]:
    return {name[12:]: float(row[name]) for name in row if name.startswith("probability_")}


@pytest.fixture
def region(folder: Path) -> Path:
    """The working directory with the region of three buildings of two classes."""
    (folder / "classes.csv").write_text(CLASSES)
    (folder / "buildings.csv").write_text(BUILDINGS)
    return folder


def test_a_drift_that_is_the_median(folder: Path, tdint: Command) -> None:
    """The probability of the state or a heavier one is 1/2 there, and Phi(ln(d / median) / beta) elsewhere; those of
    all outcomes make 1; the mean loss is the sum of probability times loss, by hand."""
    median, beta, far = float(drifts(1.0)[1]), 0.35, 0.5
    (folder / "study.yaml").write_text(STUDY + DAMAGE % (median, far, beta))
    assert tdint("campaign", "study.yaml", "-o", "out").exit_code == 0
    table = rows("out/damage.csv")
    found = {(row["record"], row["component"], row["scale"]): row for row in table}
    at = found["motion.mseed", "HNN", "1"]
    assert probabilities(at)["none"] == pytest.approx(0.5, abs=1e-12)
    assert at["state"] == "slight"
    other = found["other.mseed", "HNE", "1"]
    drift = drifts(1.0)[2]
    exceeded = ndtr(math.log(drift / median) / beta)
    assert probabilities(other)["none"] == pytest.approx(1.0 - exceeded, rel=1e-9)
    assert (other["state"], float(other["drift_ratio"])) == ("none", pytest.approx(drift, rel=1e-11))
    for row in table:
        told = probabilities(row)
        assert sum(told.values()) == pytest.approx(1.0, abs=1e-11)
        assert float(row["loss_ratio"]) == pytest.approx(0.1 * told["slight"] + 0.8 * told["complete"], rel=1e-9)


def test_means_over_the_motions_with_their_errors(folder: Path, tdint: Command) -> None:
    """Thresholds that are exact between the three drifts at full scale; two components of one record are one motion of
    two runs, so that the error is that of the ratio of sums over two motions. At half the scale none is reached."""
    low, middle, high = sorted(drifts(1.0))
    slight, complete = math.sqrt(low * middle), math.sqrt(middle * high)
    assert max(drifts(0.5)) < slight or max(drifts(0.5)) < complete
    (folder / "study.yaml").write_text(STUDY + DAMAGE % (float(slight), float(complete), 0.0))
    assert tdint("campaign", "study.yaml", "-o", "out").exit_code == 0
    states = [row["state"] for row in rows("out/damage.csv") if row["scale"] == "1"]
    assert sorted(states) == ["complete", "none", "slight"]
    of_type = {row["state"]: row for row in rows("out/damage-types.csv") if row["level"] == "1"}
    assert set(of_type) == {"none", "slight", "complete", "collapsed", "failed-story"}
    assert {row["runs"] for row in of_type.values()} == {"3"}
    assert sum(float(row["probability"]) for row in of_type.values()) == pytest.approx(1.0, abs=1e-12)
    # Motion 1 has two runs (p = 0 and 1, or both), motion 2 has one: sum over motions of (sum of p - n mean)^2.
    for place, name in enumerate(("none", "slight", "complete")):
        hits = [float(state == name) for state in states]
        mean = sum(hits) / 3.0
        spread = (hits[0] + hits[1] - 2.0 * mean) ** 2 + (hits[2] - mean) ** 2
        assert float(of_type[name]["probability"]) == pytest.approx(mean), place
        assert float(of_type[name]["probability_error"]) == pytest.approx(math.sqrt(2.0 * spread) / 3.0)
    whole, alone = (row for row in rows("out/losses.csv") if row["level"] == "1")
    losses = [{"none": 0.0, "slight": 0.1, "complete": 0.8}[state] for state in states]
    mean = sum(losses) / 3.0
    deviation = math.sqrt(sum((loss - mean) ** 2 for loss in losses) / 3.0)
    for row, name in ((whole, ""), (alone, "shaken")):
        assert (row["type"], row["building"], row["failed"]) == ("shaken", name, "0")
        assert float(row["loss_ratio"]) == pytest.approx(mean)
        assert float(row["loss_ratio_sd"]) == pytest.approx(deviation)


def test_falls_and_failures_are_what_they_are(folder: Path, tdint: Command) -> None:
    """A run that collapses is collapsed with certainty, and costs what a collapse does; one without a result has no
    state and no part in any mean, but a place among those that failed."""
    _, middle, high = sorted(drifts(1.0))
    text = STUDY.replace("newmark-average", f"newmark-average, collapse_drift: {float(math.sqrt(middle * high))!r}")
    (folder / "study.yaml").write_text(text + DAMAGE % (2.0 * float(high), 3.0 * float(high), 0.0))
    assert tdint("campaign", "study.yaml", "-o", "out").exit_code == 0
    table = [row for row in rows("out/damage.csv") if row["scale"] == "1"]
    assert sorted(row["state"] for row in table) == ["collapsed", "none", "none"]
    fallen = next(row for row in table if row["state"] == "collapsed")
    assert (fallen["status"], probabilities(fallen)["collapsed"], fallen["loss_ratio"]) == ("collapsed", 1.0, "1")
    whole = next(row for row in rows("out/losses.csv") if row["level"] == "1")
    assert float(whole["loss_ratio"]) == pytest.approx(1.0 / 3.0)

    (folder / "stiff.yaml").write_text("{name: stiff, stories: [{mass: 1, height: 3, stiffness: 1e8}], damping: 0}\n")
    failing = STUDY.replace("shaken.yaml", "shaken.yaml, stiff.yaml").replace("newmark-average", "central-difference")
    (folder / "failing.yaml").write_text(failing + DAMAGE % (0.01, 0.02, 0.4))
    assert tdint("campaign", "failing.yaml", "-o", "failed").exit_code == 0
    lost = [row for row in rows("failed/damage.csv") if row["building"] == "stiff"]
    assert {row["status"] for row in lost} == {"unstable-step"}
    assert {row["state"] for row in lost} == {""} == {row["probability_none"] for row in lost}
    of_type = [row for row in rows("failed/damage-types.csv") if row["type"] == "stiff"]
    assert {(row["runs"], row["failed"], row["probability"]) for row in of_type} == {("3", "3", "")}
    assert all(row["loss_ratio"] == "" for row in rows("failed/losses.csv") if row["type"] == "stiff")


def test_thresholds_of_capacity_curves(region: Path, tdint: Command) -> None:
    """0.75 Sdy, 0.5 Sdy + 0.33 Sdu, 0.25 Sdy + 0.67 Sdu and Sdu; the demand is the displacement of the roof over the
    participation factor of the first mode."""
    from tdint.campaign.fragility.type_states import curve_medians

    published = CapacityFacts(CapacityCurve((0.0017, 0.0087, 0.0656, 0.1), (0.1, 0.2, 0.3, 0.3)), 1)
    assert curve_medians(published) == pytest.approx((0.006525, 0.03735, 0.069175, 0.1), rel=1e-12)
    bilinear = CapacityFacts(CapacityCurve((0.01, 0.05), (0.1, 0.2)), 1)
    assert curve_medians(bilinear) == pytest.approx((0.0075, 0.0215, 0.036, 0.05), rel=1e-12)
    (region / "study.yaml").write_text(REGION + "damage: {thresholds: capacity, dispersion: 0.3}\n")
    assert tdint("campaign", "study.yaml", "-o", "out").exit_code == 0
    facts = {"one": 1, "two": 3}
    curve = CapacityCurve((0.004, 0.02, 0.06), (0.15, 0.25, 0.2))
    for row, run in zip(rows("out/damage.csv"), rows("out/runs.csv"), strict=True):
        assert (row["building"], row["scale"], row["status"]) == (run["building"], run["scale"], run["status"])
        if row["type"] != "A":
            continue
        participation = derive_capacity(CapacityFacts(curve, facts[row["building"]])).participation
        demand = float(run["peak_roof_displacement_m"]) / participation
        assert float(row["spectral_displacement_m"]) == pytest.approx(demand, rel=1e-10)
        if row["status"] == "done":
            told = probabilities(row)
            assert told["none"] == pytest.approx(1.0 - ndtr(math.log(demand / 0.015) / 0.3), rel=1e-6, abs=1e-11)


def test_a_table_of_thresholds_and_losses_by_class(region: Path, tdint: Command) -> None:
    (region / "losses.csv").write_text("class,slight,moderate,extensive,complete\nA,.1,.2,.5,.9\nB,0,.1,.4,1\n")
    damage = "damage: {demand: spectral_displacement, thresholds: classes.csv, losses: losses.csv}\n"
    (region / "study.yaml").write_text(REGION + damage)
    assert tdint("campaign", "study.yaml", "-o", "out").exit_code == 0
    medians = {"A": (0.003, 0.4), "B": (0.004, 0.5)}
    for row in rows("out/damage.csv"):
        median, beta = medians[row["type"]]
        if row["status"] == "done":
            exceeded = ndtr(math.log(float(row["spectral_displacement_m"]) / median) / beta)
            assert probabilities(row)["none"] == pytest.approx(1.0 - exceeded, rel=1e-6, abs=1e-11)
    assert [row["type"] for row in rows("out/losses.csv") if not row["building"]] == ["A", "A", "B", "B"]


def test_thresholds_of_hazus(folder: Path, tdint: Command) -> None:
    """Those of C1M-high over the height of the whole building, with 0.4."""
    header = "id,NumberOfStories,YearBuilt,StructureType,PlanArea,height\n"
    (folder / "buildings.csv").write_text(header + "office,5,1990,C1,900,15\n")
    (folder / "study.yaml").write_text(
        "buildings: {inventory: buildings.csv, units: {length: m}}\n"
        "records: {files: [motion.mseed], units: m/s^2, component: HNE}\ndamage: {thresholds: hazus}\n"
    )
    assert tdint("campaign", "study.yaml", "-o", "out").exit_code == 0
    (row,), (run,) = rows("out/damage.csv"), rows("out/runs.csv")
    demand = float(run["peak_roof_displacement_m"]) / 15.0
    assert (row["type"], float(row["roof_drift_ratio"])) == ("C1M-high", pytest.approx(demand, rel=1e-10))
    edges = [ndtr(math.log(demand / median) / 0.4) for median in (0.0033, 0.0067, 0.02, 0.0533)]
    expected = [1.0 - edges[0], *(one - other for one, other in zip(edges, [*edges[1:], 0.0], strict=True)), 0.0, 0.0]
    assert list(probabilities(row).values()) == pytest.approx(expected, rel=1e-9, abs=1e-12)


def test_states_of_the_models_themselves(folder: Path, tdint: Command) -> None:
    """`damage` of a model, by accelerations with their unit; other thresholds change the tables, and no run is done
    anew; what was told no longer goes."""
    model = Path("shaken.yaml").read_text()
    section = "damage: {demand: acceleration, thresholds: {dented: 0.1 g, gone: 5 m/s^2}, dispersion: 0.5}\n"
    Path("shaken.yaml").write_text(model + section)
    (folder / "study.yaml").write_text(STUDY)
    assert tdint("campaign", "study.yaml", "-o", "out", "--output-units", "g").exit_code == 0
    row = rows("out/damage.csv")[0]
    expected = 1.0 - ndtr(math.log(float(row["acceleration_g"]) / 0.1) / 0.5)
    assert probabilities(row)["none"] == pytest.approx(expected, rel=1e-9)
    assert not Path("out/losses.csv").exists()
    Path("shaken.yaml").write_text(model + section.replace("0.1 g", "0.2 g"))
    result = tdint("campaign", "study.yaml", "-o", "out", "--output-units", "g")
    assert (result.exit_code, "nothing to do" in result.stderr) == (0, True)
    expected = 1.0 - ndtr(math.log(float(row["acceleration_g"]) / 0.2) / 0.5)
    assert probabilities(rows("out/damage.csv")[0])["none"] == pytest.approx(expected, rel=1e-9)


def test_parts_that_are_put_together_tell_the_same(region: Path, tdint: Command) -> None:
    (region / "study.yaml").write_text(REGION + "damage: {thresholds: capacity, dispersion: 0.3}\n")
    tdint("campaign", "study.yaml", "-o", "out")
    for part in ("1", "2"):
        tdint("campaign", "study.yaml", "-o", part, "--shard", f"{part}/2")
    assert not Path("1/damage-types.csv").exists() or Path("2/damage-types.csv").exists()
    assert tdint("campaign", "merge", "1", "2", "-o", "all").exit_code == 0
    for name in ("damage.csv", "damage-types.csv"):
        assert (region / "all" / name).read_bytes() == (region / "out" / name).read_bytes()
        (region / "out" / name).unlink()
    assert tdint("campaign", "export", "out").exit_code == 0
    assert (region / "all" / "damage.csv").read_bytes() == (region / "out" / "damage.csv").read_bytes()


LEVELS = "intensity: {measure: pga, levels: [0.3 m/s^2, 1 m/s^2, 3 m/s^2]}"


@pytest.fixture
def fitted(region: Path, tdint: Command, make_record: Callable[..., None]) -> Path:
    """The region under four motions at three levels, done in `out`."""
    for number in range(2):
        make_record(region / f"more-{number}.mseed", "HNE", samples=250 + 70 * number)
    files = "[motion.mseed, other.mseed, more-0.mseed, more-1.mseed]"
    text = REGION.replace("[motion.mseed, other.mseed]", files).replace("intensity: {scales: [0.5, 1]}", LEVELS)
    (region / "study.yaml").write_text(text + "damage: {thresholds: capacity, dispersion: 0.3}\n")
    assert tdint("campaign", "study.yaml", "-o", "out").exit_code == 0
    return region


def of_type(name: str) -> list[dict[str, str]]:
    """The runs of a type, each with its peak ground acceleration."""
    table = zip(rows("out/damage.csv"), rows("out/runs.csv"), strict=True)
    return [{**row, "pga": run["pga_m_s2"]} for row, run in table if row["type"] == name]


def test_fragility_of_each_type_and_state(fitted: Path, tdint: Command) -> None:
    """Stripes: the fit of the sums of probabilities at each level, falls among them; its errors are those of leaving
    out one motion after the other: variance (g - 1)/g sum (theta_i - mean)^2."""
    tdint("fragility", "out", "--by", "type", "--im", "pga", "-o", "f.csv", "--plot", "--openquake", "f.xml", code=0)
    found = {(row["type"], row["state"]): row for row in rows("f.csv")}
    assert ("A", "slight") in found and Path("f.png").read_bytes().startswith(b"\x89PNG")
    runs = of_type("A")
    motions = sorted({row["record"] for row in runs})

    def fit(left_out: str) -> Fragility:
        levels: dict[float, list[float]] = {}
        for row in runs:
            if row["record"] != left_out:
                levels.setdefault(round(float(row["pga"]), 6), []).append(1.0 - probabilities(row)["none"])
        return fit_stripes(list(levels), [sum(one) for one in levels.values()], [len(one) for one in levels.values()])

    whole, parts = fit(""), [fit(motion) for motion in motions]
    row = found["A", "slight"]
    assert (float(row["theta"]), float(row["beta"])) == pytest.approx((whole.theta, whole.beta), rel=1e-6)
    for name, values in (("theta", [math.log(one.theta) for one in parts]), ("beta", [one.beta for one in parts])):
        mean, count = sum(values) / len(values), len(values)
        error = math.sqrt((count - 1) / count * sum((value - mean) ** 2 for value in values))
        assert float(row[f"{name}_error"]) == pytest.approx(error, rel=1e-4)
    states = max(([state for name, state in found if name == one] for one in "AB"), key=len)
    assert f"<limitStates>{' '.join(states)}</limitStates>" in Path("f.xml").read_text()


def dispersed_cloud(im: list[float], demand: list[float], fell: list[bool]) -> list[Fragility]:
    """Of class A, slight at 0.015 m and complete at 0.06 m with a dispersion of 0.3: three sets of all runs."""
    x, y, above = [], [], []
    for part in (math.exp(-0.3 * math.sqrt(1.5)), 1.0, math.exp(0.3 * math.sqrt(1.5))):
        for one, value, gone in zip(im, demand, fell, strict=True):
            x.append(one)
            above.append(gone or part * value >= 0.06)
            y.append(0.06 if above[-1] else part * value)
    return fit_cloud(x, y, [0.015], above, lightest=0.015)


def test_fragility_of_types_by_clouds(fitted: Path, tdint: Command) -> None:
    """The line through the demands of all runs of the type, falls known only to be above the heaviest state, those
    below the lightest one only to be below, and counted; each is seen with three thresholds, so that beta has their
    dispersion. Sa is at the period of the class's curve."""
    result = tdint("fragility", "out", "--by", "type")  # at each Sa there are the runs of one motion alone: a cloud
    row = next(row for row in rows(result.stdout) if (row["type"], row["state"]) == ("A", "slight"))
    runs = [
        (
            float(run["sa_t1_m_s2"]),
            float(row["spectral_displacement_m"]) if row["status"] == "done" else 0.06,
            row["status"] != "done",
        )
        for row, run in zip(rows("out/damage.csv"), rows("out/runs.csv"), strict=True)
        if row["type"] == "A"
    ]
    im, demand, fell = (list(one) for one in zip(*runs, strict=True))
    (line,) = dispersed_cloud(im, demand, fell)
    assert line.cloud is not None
    assert int(row["below"]) == sum(one < 0.015 for one in demand) > 0
    assert (int(row["records"]), int(row["censored"])) == (len(runs), sum(fell))
    assert (float(row["theta"]), float(row["beta"])) == pytest.approx((line.theta, line.beta), rel=1e-6)
    period = 2.0 * math.pi * math.sqrt(0.004 / (0.15 * 9.81))
    assert row["im"] == f"sa({period:.6g})"


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (("out", "--threshold", "1%"), "leave --threshold out"),
        (("out", "--fit", "ida"), "--fit stripes or cloud"),
        (("out", "--openquake", "f.xml", "--states", "a,b"), "--states is not for --by type"),
        ((".",), "holds no campaign"),
        (("bare",), "says nothing of damage"),
    ],
)
def test_refusals_of_functions_by_type(region: Path, tdint: Command, arguments: tuple[str, ...], said: str) -> None:
    for name, damage in (("out", "damage: {thresholds: capacity, dispersion: 0}\n"), ("bare", "")):
        (region / "study.yaml").write_text(REGION + damage)
        tdint("campaign", "study.yaml", "-o", name)
    tdint.refused(said, "fragility", *arguments, "--by", "type")


@pytest.mark.parametrize(
    ("damage", "said"),
    [
        ("{dispersion: 0.3}", "damage.thresholds: is missing; give the demand of each state, hazus, capacity"),
        ("{thresholds: {slight: 1%}}", "damage.dispersion: is missing; give 0 for thresholds that are exact"),
        ("{thresholds: {slight: 1%, worse: 0.5%}, dispersion: 0}", "damage.thresholds: the thresholds of damage"),
        ("{demand: drift, thresholds: {slight: 1%}, dispersion: 0}", "damage.demand: unknown demand 'drift'"),
        ("{demand: acceleration, thresholds: {slight: 1}, dispersion: 0}", "number with its unit, such as 0.3 g, got"),
        ("{thresholds: hazus}", "hazus has thresholds of buildings of an inventory by the rules mdof-lu"),
        ("{thresholds: other.csv, dispersion: 0}", "damage.demand: is missing; give one of drift_ratio"),
        (
            "{thresholds: {slight: 1%}, dispersion: 0, losses: {complete: 1}}",
            "damage.losses: no loss ratio of slight; the states are slight",
        ),
        ("{thresholds: {slight: 1%}, dispersion: 0, losses: {slight: 2}}", "losses.slight: must be a number"),
        ("{demand: drift_ratio, states: [a, a], thresholds: t.csv, dispersion: 0}", "damage.states: must be names"),
    ],
)
def test_faults_of_the_file(folder: Path, tdint: Command, damage: str, said: str) -> None:
    (folder / "study.yaml").write_text(f"{STUDY}damage: {damage}\n")
    result = tdint("campaign", "study.yaml", "-o", "out")
    assert (result.exit_code, len(result.stderr.splitlines())) == (3, 1), result.stderr
    assert said in result.stderr


@pytest.mark.parametrize(
    ("classes", "said"),
    [
        ("class,slight_m\nA,0.1\n", "no column moderate_m"),
        (CLASSES.replace("B,", "C,"), "has no damage thresholds of the class 'B'"),
        (CLASSES.replace("0.003,", "0.02,"), "class A: the thresholds of damage states rise"),
        (CLASSES.replace("0.003,", "x,"), "table.csv:2: slight_m must be zero or a positive number, got 'x'"),
        (CLASSES.replace(",0.4\n", ",\n"), "table.csv:2: beta is missing"),
        (CLASSES.replace("A,0.02,0.25,,,,,", "A,0.02,0.25,1,2,3,4,1"), "class A has other numbers in a row above"),
    ],
)
def test_faults_of_a_table_of_thresholds(region: Path, tdint: Command, classes: str, said: str) -> None:
    (region / "table.csv").write_text(classes)
    (region / "study.yaml").write_text(REGION + "damage: {demand: spectral_displacement, thresholds: table.csv}\n")
    result = tdint("campaign", "study.yaml", "-o", "out")
    assert (result.exit_code, len(result.stderr.splitlines())) == (3, 1), result.stderr
    assert said in result.stderr


def test_drift_ratios_need_heights(folder: Path, tdint: Command) -> None:
    Path("shaken.yaml").write_text(Path("shaken.yaml").read_text().replace("height: 3, ", ""))
    (folder / "study.yaml").write_text(STUDY + DAMAGE % (0.01, 0.02, 0.0))
    result = tdint("campaign", "study.yaml", "-o", "out")
    assert (result.exit_code, result.stderr) == (
        3, "Error: shaken.yaml: damage by drift_ratio needs the heights of the stories\n",
    )  # fmt: skip


@pytest.mark.parametrize("demand", ["drift_ratio", "acceleration", "spectral_displacement"])
def test_a_single_run_tells_the_damage_of_its_model(folder: Path, tdint: Command, demand: str) -> None:
    """In summary.json and in a line, with the numbers of a campaign of that run; nothing without damage states."""
    unit, low, high = {"drift_ratio": ("", 2e-3, 0.05), "acceleration": ("_m_s2", 0.5, 9.0),
                       "spectral_displacement": ("_m", 0.04, 0.2)}[demand]  # fmt: skip
    assert "damage" not in summary_of(tdint, "plain")
    text = {"": "%r", "_m": "%r m", "_m_s2": "%r m/s^2"}[unit]
    thresholds = f"slight: {text % low}, complete: {text % high}"
    with Path("shaken.yaml").open("a") as file:
        file.write(f"damage: {{demand: {demand}, thresholds: {{{thresholds}}}, dispersion: 0.5, {LOSSES}}}\n")
    told = summary_of(tdint, "out")["damage"]
    campaign = STUDY.replace(", other.mseed", "").replace("[0.5, 1]", "[1]").replace("units", "component: HNN, units")
    Path("study.yaml").write_text(campaign)
    assert tdint("campaign", "study.yaml", "-o", "many").exit_code == 0
    (row,) = rows("many/damage.csv")
    assert f"{told[demand + unit]:.12g}" == row[demand + unit] and told["state"] == row["state"] == "slight"
    for one in told["outcomes"]:
        name = f"probability_{one['outcome'].replace('-', '_')}"
        assert one["probability"] == pytest.approx(float(row[name]), rel=1e-11, abs=1e-300)
    assert f"{told['loss_ratio']:.12g}" == row["loss_ratio"]


def summary_of(tdint: Command, name: str) -> dict[str, Any]:
    """summary.json of a run of shaken.yaml; what it says of damage is said in a line, too."""
    call = ("run", "shaken.yaml", "motion.mseed", "--component", "HNN", "--units", "m/s^2", "-o", name)
    result = tdint(*call, code=0)
    found = json.loads(Path(name, "summary.json").read_text())
    assert ("damage" in found) == ("Damage by " in result.stderr)
    if "damage" in found:
        assert f": {found['damage']['state']} (" in result.stderr
    return dict(found)


def test_damage_that_a_single_run_cannot_tell_is_refused_before(folder: Path, tdint: Command) -> None:
    text = Path("shaken.yaml").read_text().replace("height: 3, ", "")
    Path("shaken.yaml").write_text(text + DAMAGE % (0.01, 0.04, 0.4))
    result = tdint("run", "shaken.yaml", "motion.mseed", "--units", "m/s^2", "-o", "out")
    assert result.exit_code == 3 and "damage by drift_ratio needs the heights of the stories" in result.stderr
    assert not Path("out").exists()


def test_an_ida_asks_for_the_medians_of_the_damage_states(folder: Path, tdint: Command) -> None:
    """Where no thresholds are asked for; of other demands than drift ratios it tells nothing."""
    with Path("shaken.yaml").open("a") as file:
        file.write(DAMAGE % (0.003, 0.012, 0.4))
    call = ("ida", "shaken.yaml", "other.mseed", "--units", "m/s^2", "--im", "pga", "--precision", "50%")
    told = csv.DictReader(io.StringIO(tdint(*call).stdout))
    assert [row["threshold"] for row in told] == ["0.003", "0.012", "0.1"]
    asked = csv.DictReader(io.StringIO(tdint(*call, "--threshold", "2%").stdout))
    assert [row["threshold"] for row in asked] == ["0.02", "0.1"]


@pytest.fixture
def paired(region: Path, make_record: Callable[..., None]) -> Path:
    """The region with four pairs, whose second component is twice the first, at three factors."""
    for number in range(4):
        make_record(region / f"pair-{number}.mseed", "HNE", "HNN", samples=250 + 60 * number, peak=2.0 + number)
    text = REGION.replace("[motion.mseed, other.mseed]", "[pair-0.mseed, pair-1.mseed, pair-2.mseed, pair-3.mseed]")
    text = text.replace("units: m/s^2", "units: m/s^2, pairs: true").replace("[0.5, 1]", "[0.2, 0.5, 1]")
    (region / "study.yaml").write_text(text + "damage: {thresholds: capacity, dispersion: 0.3}\n")
    return region


@pytest.mark.parametrize(
    ("im", "column", "imt"),
    [("pgv", "pgv_m_s", "PGV"), ("arias", "arias_intensity_m_s", "IA"), ("sa:0.6", "sa_0p6_m_s2", "SA(0.6)"),
     ("sa-avg", "sa_avg_t1_m_s2", "AvgSA("), ("pga", "pga_m_s2", "PGA"), ("sa", "sa_t1_m_s2", "SA(")],
)  # fmt: skip
def test_the_measure_that_was_asked_for_of_the_pair(
    paired: Path, tdint: Command, im: str, column: str, imt: str
) -> None:
    """Clouds by hand over the geometric mean of what both components have; and without the measure exit 2."""
    assert tdint("campaign", "study.yaml", "-o", "out").exit_code == 0
    if im not in ("pga", "sa"):
        result = tdint("fragility", "out", "--by", "type", "--im", im)
        assert result.exit_code == 2 and f"no measure {column.split('_m_s')[0]}" in result.stderr
    assert tdint("campaign", "study.yaml", "-o", "out", "--im", "pgv,arias,sa:0.6,sa-avg").exit_code == 0
    call = ("fragility", "out", "--by", "type", "--im", im, "--fit", "cloud", "-o", "f.csv", "--openquake", "f.xml")
    result = tdint(*call, code=0)
    runs, damage, measures = (rows(f"out/{name}.csv") for name in ("runs", "damage", "measures"))
    values: dict[tuple[str, ...], list[float]] = {}
    for run, measure in zip(runs, measures, strict=True):
        key = (run["building"], run["record"], run["scale"])
        values.setdefault(key, []).append(float({**run, **measure}[column]))
    x, y, fell = [], [], []
    for run, row in zip(runs, damage, strict=True):
        if row["type"] == "A":
            one, other = values[run["building"], run["record"], run["scale"]]
            x.append(math.sqrt(one * other))
            fell.append(run["status"] != "done")
            y.append(0.06 if fell[-1] else float(row["spectral_displacement_m"]))
    (line,) = dispersed_cloud(x, y, fell)
    row = next(row for row in rows("f.csv") if (row["type"], row["state"]) == ("A", "slight"))
    assert float(row["theta"]) == pytest.approx(line.theta, rel=1e-6)
    assert f'imt="{imt}' in Path("f.xml").read_text()
    assert "is the geometric mean of both components" in result.stderr
    # The same without types, of one building.
    text = Path("out/runs.csv").read_text().splitlines()
    own = [line for line in text if line.startswith(("building,", "one,"))]
    Path("out/runs.csv").write_text("\n".join(own) + "\n")
    (told,) = rows(tdint("fragility", "out", "--im", im, "--fit", "cloud", "--threshold", "1%", code=0).stdout)
    mine = [(run, values[run["building"], run["record"], run["scale"]]) for run in runs if run["building"] == "one"]
    drift = [float(run["peak_drift_ratio"]) if run["status"] == "done" else 0.01 for run, _ in mine]
    (line,) = fit_cloud(
        [math.sqrt(a * b) for _, (a, b) in mine], drift, [0.01], [r["status"] != "done" for r, _ in mine]
    )
    assert float(told["theta"]) == pytest.approx(line.theta, rel=1e-6)


def test_the_levels_of_a_pair_are_the_measure(paired: Path, tdint: Command) -> None:
    """Where a campaign has brought pairs to levels, their measure is known without measures.csv, of any direction."""
    text = (paired / "study.yaml").read_text()
    levels = "intensity: {measure: sa, period: 0.6, levels: [0.5 m/s^2, 2 m/s^2, 6 m/s^2], pair: rotd50}"
    (paired / "study.yaml").write_text(text.replace("intensity: {scales: [0.2, 0.5, 1]}", levels))
    assert tdint("campaign", "study.yaml", "-o", "out").exit_code == 0
    tdint("fragility", "out", "--by", "type", "--im", "sa:0.6", "-o", "f.csv", code=0)
    (row,) = (row for row in rows("f.csv") if (row["type"], row["state"]) == ("A", "slight"))
    assert [float(row[f"bin_{place}_im"]) for place in (1, 2, 3)] == pytest.approx([0.5, 2.0, 6.0])
    assert (row["fit"], row["im"], row["bin_1_runs"]) == ("stripes", "sa(0.6)", "16")
    below = [float(row["probability_none"]) for row in rows("out/damage.csv") if row["type"] == "A"]
    shares = [1.0 - sum(below[place::3]) / len(below[place::3]) for place in range(3)]
    assert [float(row[f"bin_{place}_share"]) for place in (1, 2, 3)] == pytest.approx(shares, rel=1e-9, abs=1e-12)


def test_functions_of_each_building(paired: Path, tdint: Command) -> None:
    """Of two models by thresholds of the drift ratio, each over Sa at its own period, which the file for OpenQuake has;
    the numbers are those of a campaign of one of them."""
    shaken = Path("shaken.yaml").read_text()
    Path("soft.yaml").write_text(
        shaken.replace("name: ", "name: soft ", 1).replace("stiffness: 8000", "stiffness: 4000")
    )
    study = REGION.replace("[motion.mseed, other.mseed]", "[pair-0.mseed, pair-1.mseed, pair-2.mseed, pair-3.mseed]")
    lines = study.replace("[0.5, 1]", "[0.2, 0.5, 1]").splitlines()
    for name, models in (("both", "[shaken.yaml, soft.yaml]"), ("alone", "[soft.yaml]")):
        (paired / f"{name}.yaml").write_text("\n".join([f"buildings: {{models: {models}}}", *lines[1:]]))
        assert tdint("campaign", f"{name}.yaml", "-o", name).exit_code == 0
    tdint.refused("fit functions of each with --by building", "fragility", "both", "--threshold", "0.5%", code=3)
    call = ("--threshold", "0.5%,1%", "-o", "f.csv", "--overwrite", "--states", "light,heavy", "--openquake", "f.xml")
    tdint("fragility", "both", "--by", "building", *call, code=0)
    found = rows("f.csv")
    assert [row["state"] for row in found] == ["light", "heavy"] * 2 and len({row["building"] for row in found}) == 2
    assert len({row["im"] for row in found}) == 2 and all(row["im"].startswith("sa(0.") for row in found)
    (own,) = csv.DictReader(tdint("fragility", "alone", "--threshold", "1%", "--fit", "cloud").stdout.splitlines())
    (same,) = (row for row in found if row["building"].startswith("soft") and row["state"] == "heavy")
    numbers = [[float(row[name]) for name in ("theta", "beta")] for row in (same, own)]
    assert numbers[0] == pytest.approx(numbers[1], rel=1e-9) and same["im"] == own["im"]
    assert f'imt="SA({own["im"][3:-1]})"' in Path("f.xml").read_text()
