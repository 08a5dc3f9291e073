"""Damage states of campaigns: damage.csv, damage-types.csv and losses.csv compared with closed
forms, and errors."""

import json
import math
from pathlib import Path

import pytest
from scipy.special import ndtr

import tdint as package
from cli.conftest import STUDY, Command, change, copy_of, made_once, write_folder, write_record
from cli.test_report import page, table_with
from csv_rows import rows
from selection import every
from tdint.model.capacity import CapacityCurve, CapacityFacts, derive_capacity
from tdint.studies.fragility.fits import fit_cloud, fit_stripes
from tdint.studies.fragility.fragility_function import Fragility
from tdint.studies.fragility.type_states import curve_medians

DAMAGE = """\
damage:
  thresholds: {slight: %r, complete: %r}
  dispersion: %g
  losses: {slight: 10%%, complete: 0.8, collapsed: 1}
"""
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
records: {files: [pair-0.mseed, pair-1.mseed, pair-2.mseed, pair-3.mseed], units: m/s^2, pairs: true, pair_demand: separate}
intensity: {scales: [0.2, 0.5, 1]}
analysis: {method: newmark-average}
"""  # noqa: E501
BY_CURVES = "damage: {thresholds: capacity, dispersion: 0.3}\n"


def drifts(scale: float) -> list[float]:
    """Return the maximum drift ratio of shaken.yaml under each component, to the last digit."""
    model = package.load_model("shaken.yaml")
    files = (("motion.mseed", "HNE"), ("motion.mseed", "HNN"), ("other.mseed", "HNE"))
    records = [
        package.read_record(file, component=name, units="m/s^2").scaled(scale)
        for file, name in files
    ]
    responses = [package.run(model, record, method="newmark-average") for record in records]
    return [float(response.stories.peak_drift_ratio.max()) for response in responses]


def probabilities(row: dict[str, str]) -> dict[str, float]:
    return {name[12:]: float(row[name]) for name in row if name.startswith("probability_")}


@pytest.fixture(scope="module")
def done(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the completed region in `out`: three buildings of two classes, four pairs (the second
    component is twice the first) and three factors, with additional intensity measures."""

    def make(folder: Path) -> None:
        write_folder(folder)
        for number in range(4):
            file = folder / f"pair-{number}.mseed"
            write_record(file, "HNE", "HNN", samples=250 + 60 * number, peak=2.0 + number)
        Path("classes.csv").write_text(CLASSES)
        Path("buildings.csv").write_text(BUILDINGS)
        Path("study.yaml").write_text(REGION + BY_CURVES)
        Command()("campaign", "study.yaml", "-o", "out", "--im", "pgv,arias,sa:0.6,sa-avg", code=0)

    return made_once(tmp_path_factory, make)


region = copy_of("done")


def test_states_probabilities_and_losses_of_runs(folder: Path, tdint: Command) -> None:
    """The probability of at least a state is 1/2 at the median, and otherwise Phi(ln(d / median) /
    beta). The probabilities of all outcomes sum to 1. The mean loss is the sum of probability
    times loss. A collapsed run has the state collapsed with probability 1 and the loss of a
    collapse. tests/studies/fragility/test_damage_counting.py tests means over runs."""
    low, median, high = sorted(drifts(1.0))
    text = STUDY.replace(
        "newmark-average", f"newmark-average, collapse_drift: {math.sqrt(median * high)!r}"
    )
    (folder / "study.yaml").write_text(text + DAMAGE % (median, 2.0 * high, 0.35))
    tdint("campaign", "study.yaml", "-o", "out", code=0)
    table = rows("out/damage.csv")
    at = [row for row in table if row["scale"] == "1" and row["status"] == "done"]
    at.sort(key=lambda row: float(row["drift_ratio"]))
    assert [float(row["drift_ratio"]) for row in at] == pytest.approx([low, median], rel=1e-11)
    exceeded = [1.0 - probabilities(row)["none"] for row in at]
    assert exceeded == pytest.approx([ndtr(math.log(low / median) / 0.35), 0.5], rel=1e-9)
    assert [row["state"] for row in at] == ["none", "slight"]
    (fallen,) = (row for row in table if row["status"] == "collapsed")
    assert (fallen["state"], probabilities(fallen)["collapsed"], fallen["loss_ratio"]) == (
        "collapsed",
        1.0,
        "1",
    )
    for row in table:
        outcomes = probabilities(row)
        assert sum(outcomes.values()) == pytest.approx(1.0, abs=1e-11)
        loss = 0.1 * outcomes["slight"] + 0.8 * outcomes["complete"] + outcomes["collapsed"]
        assert float(row["loss_ratio"]) == pytest.approx(loss, rel=1e-9)
    type_rows = [row for row in rows("out/damage-types.csv") if row["level"] == "1"]
    assert [row["state"] for row in type_rows] == [
        "none", "slight", "complete", "collapsed", "failed-story",
    ]  # fmt: skip
    groups = {(row["type"], row["building"]) for row in rows("out/losses.csv")}
    assert groups == {("shaken", ""), ("shaken", "shaken")}


def test_factors_of_a_file_without_levels_are_one_level(folder: Path, tdint: Command) -> None:
    """The motions are one suite of level 1, although each has a factor of its own."""
    factors = "record,component,factor\nmotion.mseed,,0.5\nother.mseed,,1\n"
    (folder / "factors.csv").write_text(factors)
    text = STUDY.replace("scales: [0.5, 1]", "factors: factors.csv")
    (folder / "study.yaml").write_text(text + DAMAGE % (0.01, 0.02, 0.4))
    tdint("campaign", "study.yaml", "-o", "out", code=0)
    groups = {(row["level"], row["runs"]) for row in rows("out/damage-types.csv")}
    assert groups == {("1", "2")}


def test_runs_without_a_result_have_no_state(folder: Path, tdint: Command) -> None:
    """They are excluded from all means and are counted as failed."""
    (folder / "stiff.yaml").write_text(
        "{name: stiff, stories: [{mass: 1, height: 3, stiffness: 1e8}], damping: 0}\n"
    )
    failing = STUDY.replace("shaken.yaml", "stiff.yaml").replace(
        "newmark-average", "central-difference"
    )
    (folder / "failing.yaml").write_text(failing + DAMAGE % (0.01, 0.02, 0.4))
    tdint("campaign", "failing.yaml", "-o", "out", code=0)
    states = {
        (row["status"], row["state"], row["probability_none"]) for row in rows("out/damage.csv")
    }
    assert states == {("unstable-step", "", "")}
    type_rows = {
        (row["runs"], row["failed"], row["probability"]) for row in rows("out/damage-types.csv")
    }
    assert type_rows == {("2", "2", "")}
    assert {row["loss_ratio"] for row in rows("out/losses.csv")} == {""}


def test_medians_of_capacity_curves() -> None:
    """The medians are 0.75 Sdy, 0.5 Sdy + 0.33 Sdu, 0.25 Sdy + 0.67 Sdu and Sdu."""
    published = CapacityFacts(CapacityCurve((0.0017, 0.0087, 0.0656, 0.1), (0.1, 0.2, 0.3, 0.3)), 1)
    assert curve_medians(published) == pytest.approx((0.006525, 0.03735, 0.069175, 0.1), rel=1e-12)
    bilinear = CapacityFacts(CapacityCurve((0.01, 0.05), (0.1, 0.2)), 1)
    assert curve_medians(bilinear) == pytest.approx((0.0075, 0.0215, 0.036, 0.05), rel=1e-12)


@pytest.mark.usefixtures("region")
def test_the_demand_of_capacity_curves() -> None:
    """The demand is the displacement of the roof divided by the participation factor of the first
    mode."""
    stories = {"one": 1, "two": 3}
    curve = CapacityCurve((0.004, 0.02, 0.06), (0.15, 0.25, 0.2))
    for row, run in zip(rows("out/damage.csv"), rows("out/runs.csv"), strict=True):
        assert (row["building"], row["scale"], row["status"]) == (
            run["building"],
            run["scale"],
            run["status"],
        )
        if row["type"] != "A":
            continue
        participation = derive_capacity(
            CapacityFacts(curve, stories[row["building"]])
        ).participation
        demand = float(run["peak_roof_displacement_m"]) / participation
        assert float(row["spectral_displacement_m"]) == pytest.approx(demand, rel=1e-10)
        if row["status"] == "done":
            none = 1.0 - ndtr(math.log(demand / 0.015) / 0.3)
            assert probabilities(row)["none"] == pytest.approx(none, rel=1e-6, abs=1e-11)


def test_exports_and_merges_have_the_same_damage(region: Path, tdint: Command) -> None:
    written = {
        name: (region / "out" / name).read_bytes() for name in ("damage.csv", "damage-types.csv")
    }
    tdint("campaign", "merge", "out", "-o", "all", code=0)
    for name in written:
        (region / "out" / name).unlink()
    tdint("campaign", "export", "out", code=0)
    for folder in ("all", "out"):
        assert {name: (region / folder / name).read_bytes() for name in written} == written


def test_thresholds_and_losses_by_class_from_tables(region: Path, tdint: Command) -> None:
    (region / "losses.csv").write_text(
        "class,slight,moderate,extensive,complete\nA,.1,.2,.5,.9\nB,0,.1,.4,1\n"
    )
    damage = (
        "damage: {demand: spectral_displacement, thresholds: classes.csv, losses: losses.csv}\n"
    )
    (region / "study.yaml").write_text(REGION + damage)
    result = tdint("campaign", "study.yaml", "-o", "out", code=0)
    # Changed thresholds change the tables, but do not cause new runs.
    assert "nothing to do" in result.stderr
    medians = {"A": (0.003, 0.4), "B": (0.004, 0.5)}
    for row in rows("out/damage.csv"):
        median, beta = medians[row["type"]]
        if row["status"] == "done":
            exceeded = ndtr(math.log(float(row["spectral_displacement_m"]) / median) / beta)
            assert probabilities(row)["none"] == pytest.approx(1.0 - exceeded, rel=1e-6, abs=1e-11)
    assert [row["type"] for row in rows("out/losses.csv") if not row["building"]] == ["A"] * 3 + [
        "B"
    ] * 3


def test_thresholds_of_hazus(folder: Path, tdint: Command) -> None:
    """The thresholds are the values of C1M-high, for the height of the building, with beta
    = 0.4."""
    header = "id,NumberOfStories,YearBuilt,StructureType,PlanArea,height\n"
    (folder / "buildings.csv").write_text(header + "office,5,1990,C1,900,15\n")
    (folder / "study.yaml").write_text(
        "buildings: {inventory: buildings.csv, units: {length: m}}\n"
        "records: {files: [motion.mseed], units: m/s^2, component: HNE}\ndamage: {thresholds: "
        "hazus}\n"
    )
    assert tdint("campaign", "study.yaml", "-o", "out").exit_code == 0
    (row,), (run,) = rows("out/damage.csv"), rows("out/runs.csv")
    demand = float(run["peak_roof_displacement_m"]) / 15.0
    assert (row["type"], float(row["roof_drift_ratio"])) == (
        "C1M-high",
        pytest.approx(demand, rel=1e-10),
    )
    edges = [ndtr(math.log(demand / median) / 0.4) for median in (0.0033, 0.0067, 0.02, 0.0533)]
    expected = [
        1.0 - edges[0],
        *(lower - higher for lower, higher in zip(edges, [*edges[1:], 0.0], strict=True)),
        0.0,
        0.0,
    ]
    assert list(probabilities(row).values()) == pytest.approx(expected, rel=1e-9, abs=1e-12)


def test_damage_states_of_the_model_files(folder: Path, tdint: Command) -> None:
    """`damage` of a model with accelerations and their unit."""
    with Path("shaken.yaml").open("a") as file:
        file.write(
            "damage: {demand: acceleration, thresholds: {dented: 0.1 g, gone: 5 m/s^2}, "
            "dispersion: 0.5}\n"
        )
    (folder / "study.yaml").write_text(STUDY)
    tdint("campaign", "study.yaml", "-o", "out", "--output-units", "g", code=0)
    row = rows("out/damage.csv")[0]
    expected = 1.0 - ndtr(math.log(float(row["acceleration_g"]) / 0.1) / 0.5)
    assert probabilities(row)["none"] == pytest.approx(expected, rel=1e-9)
    assert not Path("out/losses.csv").exists()


LEVELS = "intensity: {measure: pga, levels: [0.3 m/s^2, 1 m/s^2, 2.5 m/s^2]}"


def test_fragility_of_each_type_and_state(region: Path, tdint: Command, drawn: None) -> None:
    """Stripes: the fit to the sums of probabilities at each level, including collapses. The
    standard errors are jackknife estimates over ground motions: variance (g - 1)/g sum (theta_i
    - mean)^2."""
    change(
        "study.yaml",
        ("intensity: {scales: [0.2, 0.5, 1]}", LEVELS),
        (", pairs: true", ", component: HNE"),
    )
    tdint("campaign", "study.yaml", "-o", "levels", code=0)
    by_type = ("fragility", "levels", "--by", "type", "--im")
    tdint.refused("no measure pgv", *by_type, "pgv")
    result = tdint(*by_type, "pga", "-o", "f.csv", "--plot", "--openquake", "f.xml", code=0)
    assert "f.xml: B is omitted" in result.stderr
    found = {(row["type"], row["state"]): row for row in rows("f.csv")}
    assert Path("f.png").read_bytes().startswith(b"\x89PNG")
    runs = [
        (row["record"], round(float(run["pga_m_s2"]), 6), 1.0 - probabilities(row)["none"])
        for row, run in zip(rows("levels/damage.csv"), rows("levels/runs.csv"), strict=True)
        if row["type"] == "A"
    ]

    def fit(left_out: str) -> Fragility:
        levels: dict[float, list[float]] = {}
        for record, pga, exceeded in runs:
            if record != left_out:
                levels.setdefault(pga, []).append(exceeded)
        return fit_stripes(
            list(levels),
            [sum(part) for part in levels.values()],
            [len(part) for part in levels.values()],
        )

    complete, partial = fit(""), [fit(motion) for motion in sorted({record for record, *_ in runs})]
    row = found["A", "slight"]
    assert (float(row["theta"]), float(row["beta"])) == pytest.approx(
        (complete.theta, complete.beta), rel=1e-6
    )
    for name, values in (
        ("theta", [math.log(part.theta) for part in partial]),
        ("beta", [part.beta for part in partial]),
    ):
        mean, count = sum(values) / len(values), len(values)
        error = math.sqrt((count - 1) / count * sum((value - mean) ** 2 for value in values))
        assert float(row[f"{name}_error"]) == pytest.approx(error, rel=1e-4)
    states = max(([state for name, state in found if name == part] for part in "AB"), key=len)
    assert f"<limitStates>{' '.join(states)}</limitStates>" in Path("f.xml").read_text()


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("out", "--threshold", "1%"), "omit --threshold"),
        (("out", "--fit", "ida"), "--fit stripes or --fit cloud"),
        (
            ("out", "--openquake", "f.xml", "--states", "a,b"),
            "--states cannot be used with --by type",
        ),
        (("out", "--im", "cav"), "no measure cav"),
        ((".",), "no campaign in this directory"),
    ],
)
def test_refusals_of_functions_by_type(
    region: Path, tdint: Command, arguments: tuple[str, ...], message: str
) -> None:
    tdint.refused(message, "fragility", *arguments, "--by", "type")


@pytest.mark.parametrize(
    ("damage", "message"),
    [
        ("{dispersion: 0.3}", "damage.thresholds: is missing; ... hazus, capacity"),
        ("{thresholds: {slight: 1%}}", "damage.dispersion: is missing; "),
        ("{thresholds: {slight: 1%, worse: 0.5%}, dispersion: 0}",
         "damage.thresholds: the thresholds of damage"),
        ("{demand: drift, thresholds: {slight: 1%}, dispersion: 0}",
         "damage.demand: unknown demand 'drift'"),
        ("{demand: acceleration, thresholds: {slight: 1}, dispersion: 0}", "0.3 g, got"),
        ("{thresholds: hazus}", "hazus ... inventory ... mdof-lu"),
        ("{thresholds: other.csv, dispersion: 0}",
         "damage.demand: is missing; specify one of drift_ratio"),
        ("{thresholds: {slight: 1%}, dispersion: 0, losses: {complete: 1}}",
         "damage.losses: no loss ratio of slight"),
        ("{thresholds: {slight: 1%}, dispersion: 0, losses: {slight: 2}}",
         "losses.slight: must be a number"),
        ("{demand: drift_ratio, states: [a, a], thresholds: t.csv, dispersion: 0}",
         "damage.states: must be different names"),
    ],
)  # fmt: skip
def test_invalid_damage_sections_are_refused(
    folder: Path, tdint: Command, damage: str, message: str
) -> None:
    (folder / "study.yaml").write_text(f"{STUDY}damage: {damage}\n")
    result = tdint.refused(message, "campaign", "study.yaml", "-o", "out", code=3)
    assert len(result.stderr.splitlines()) == 1


@pytest.mark.parametrize(
    ("classes", "message"),
    [
        ("class,slight_m\nA,0.1\n", "no column moderate_m"),
        (CLASSES.replace("B,", "C,"), "class 'B' not found"),
        (CLASSES.replace("0.003,", "0.02,"), "class A: ... thresholds ... increase"),
        (CLASSES.replace("0.003,", "x,"), "table.csv:2: slight_m ... 'x'"),
        (CLASSES.replace(",0.4\n", ",\n"), "table.csv:2: beta is missing"),
        (
            CLASSES.replace("A,0.02,0.25,,,,,", "A,0.02,0.25,1,2,3,4,1"),
            "table.csv:3: class A has slight_m 1, but 0.003 in a row above",
        ),
    ],
)
def test_invalid_tables_of_thresholds_are_refused(
    region: Path, tdint: Command, classes: str, message: str
) -> None:
    (region / "table.csv").write_text(classes)
    (region / "study.yaml").write_text(
        REGION + "damage: {demand: spectral_displacement, thresholds: table.csv}\n"
    )
    result = tdint.refused(message, "campaign", "study.yaml", "-o", "new", code=3)
    assert len(result.stderr.splitlines()) == 1


@pytest.mark.parametrize(
    "call", [("campaign", "study.yaml"), ("run", "own.yaml", "motion.mseed", "--units", "m/s^2")]
)
def test_drift_ratios_need_heights(folder: Path, tdint: Command, call: tuple[str, ...]) -> None:
    change("shaken.yaml", ("height: 3, ", ""))
    damage = DAMAGE % (0.01, 0.02, 0.0)
    Path("own.yaml").write_text(Path("shaken.yaml").read_text() + damage)
    Path("study.yaml").write_text(STUDY + damage)
    tdint.refused("drift_ratio requires the heights", *call, "-o", "out", code=3)


@pytest.mark.parametrize(
    ("demand", "unit", "slight", "complete"),
    [
        ("drift_ratio", "", "0.002", "0.05"),
        ("acceleration", "_m_s2", "0.5 m/s^2", "9 m/s^2"),
        ("spectral_displacement", "_m", "0.04 m", "0.2 m"),
    ],
)
def test_a_single_run_reports_the_damage_of_its_model(
    folder: Path, tdint: Command, demand: str, unit: str, slight: str, complete: str
) -> None:
    """summary.json and the printed text contain the results of a campaign with this run. Without
    damage states they contain no damage."""
    call = ("run", "shaken.yaml", "motion.mseed", "--component", "HNN", "--units", "m/s^2", "-o")
    result = tdint(*call, "plain", code=0)
    assert (
        "damage" not in json.loads(Path("plain/summary.json").read_text())
        and "Damage" not in result.stderr
    )
    thresholds = f"{{slight: {slight}, complete: {complete}}}"
    losses = "losses: {slight: 0.1, complete: 1}"
    with Path("shaken.yaml").open("a") as file:
        file.write(
            f"damage: {{demand: {demand}, thresholds: {thresholds}, dispersion: 0.5, {losses}}}\n"
        )
    result = tdint(*call, "out", code=0)
    summary = json.loads(Path("out/summary.json").read_text())["damage"]
    assert "Damage by " in result.stderr and ": slight (" in result.stderr
    Path("study.yaml").write_text(STUDY)
    tdint("campaign", "study.yaml", "-o", "many", code=0)
    (row,) = (
        row for row in rows("many/damage.csv") if (row["component"], row["scale"]) == ("HNN", "1")
    )
    assert (
        f"{summary[demand + unit]:.12g}" == row[demand + unit]
        and summary["state"] == row["state"] == "slight"
    )
    for outcome in summary["outcomes"]:
        name = f"probability_{outcome['outcome'].replace('-', '_')}"
        assert outcome["probability"] == pytest.approx(float(row[name]), rel=1e-11, abs=1e-300)
    assert f"{summary['loss_ratio']:.12g}" == row["loss_ratio"]


def test_ida_uses_the_medians_of_the_damage_states(folder: Path, tdint: Command) -> None:
    """Without --threshold, the medians of drift ratios are used; medians of other demands are
    ignored."""
    with Path("shaken.yaml").open("a") as file:
        file.write(DAMAGE % (0.003, 0.012, 0.4))
    call = "ida shaken.yaml other.mseed --units m/s^2 --im pga --precision 50%"
    for options, thresholds in (
        ((), ["0.003", "0.012", "0.1"]),
        (("--threshold", "2%"), ["0.02", "0.1"]),
    ):
        assert [row["threshold"] for row in rows(tdint(call, *options).stdout)] == thresholds


@pytest.mark.parametrize(
    ("im", "column", "imt"),
    every(
        2,
        [
            ("pgv", "pgv_m_s", "PGV"),
            ("arias", "arias_intensity_m_s", "IA"),
            ("sa:0.6", "sa_0p6_m_s2", "SA(0.6)"),
            ("sa-avg", "sa_avg_t1_m_s2", "AvgSA("),
            ("pga", "pga_m_s2", "PGA"),
            ("sa", "sa_t1_m_s2", "SA("),
        ],
    ),
)
def test_clouds_use_the_requested_measure_of_the_pair(
    region: Path, tdint: Command, im: str, column: str, imt: str
) -> None:
    """Clouds are computed separately from the geometric mean of both components, for each type and
    for a single building. The regression includes the demands of all runs without collapse, and
    does not depend on the other states. Collapses have their own probability. Beta includes the
    dispersion of the thresholds. Sa is at the period of the capacity curve of the class."""
    call = (
        "fragility", "out", "--by", "type", "--im", im, "--fit", "cloud", "-o", "f.csv",
        "--openquake", "f.xml",
    )  # fmt: skip
    result = tdint(*call, code=0)
    runs, damage, measures = (rows(f"out/{name}.csv") for name in ("runs", "damage", "measures"))
    values: dict[tuple[str, ...], list[float]] = {}
    for run, measure in zip(runs, measures, strict=True):
        key = (run["building"], run["record"], run["scale"])
        values.setdefault(key, []).append(float({**run, **measure}[column]))
    mean = {key: math.sqrt(first * second) for key, (first, second) in values.items()}
    x, y, fell = [], [], []
    for run, row in zip(runs, damage, strict=True):
        if row["type"] == "A":
            x.append(mean[run["building"], run["record"], run["scale"]])
            fell.append(run["status"] != "done")
            y.append(0.06 if fell[-1] else float(row["spectral_displacement_m"]))
    (line,) = fit_cloud(x, y, [0.015], collapsed=fell, dispersion=0.3)
    row = next(row for row in rows("f.csv") if (row["type"], row["state"]) == ("A", "slight"))
    assert (float(row["theta"]), float(row["beta"])) == pytest.approx(
        (line.theta, line.beta), rel=1e-6
    )
    assert (int(row["runs"]), int(row["censored"])) == (len(x), sum(fell))
    # The number of ground motions does not depend on fit and type.
    assert {found["motions"] for found in rows("f.csv")} == {"4"}
    if im == "sa":
        period = 2.0 * math.pi * math.sqrt(0.004 / (0.15 * 9.81))
        assert row["im"] == f"geometric-mean-sa({period:.6g})"
    assert f'imt="{imt}' in Path("f.xml").read_text()
    assert "is the geometric mean of both components" in result.stderr

    # Functions without types, for a single building
    table = Path("out/runs.csv").read_text().splitlines()
    Path("out/runs.csv").write_text(
        "".join(f"{row}\n" for row in table if row.startswith(("building,", "one,")))
    )
    (fitted,) = rows(
        tdint("fragility", "out", "--im", im, "--fit", "cloud", "--threshold", "1%", code=0).stdout
    )
    building_runs = [run for run in runs if run["building"] == "one"]
    x = [mean["one", run["record"], run["scale"]] for run in building_runs]
    fell = [run["status"] != "done" for run in building_runs]
    drift = [
        0.01 if run["status"] != "done" else float(run["peak_drift_ratio"]) for run in building_runs
    ]
    (line,) = fit_cloud(x, drift, [0.01], collapsed=fell)
    assert float(fitted["theta"]) == pytest.approx(line.theta, rel=1e-6)


def test_levels_of_a_pair_are_values_of_the_measure(region: Path, tdint: Command) -> None:
    """If a campaign scaled pairs to levels, their intensity is known without measures.csv, in any
    direction."""
    levels = (
        "intensity: {measure: sa, period: 0.6, levels: [0.5 m/s^2, 2 m/s^2, 6 m/s^2], pair: rotd50}"
    )
    change("study.yaml", ("intensity: {scales: [0.2, 0.5, 1]}", levels))
    tdint("campaign", "study.yaml", "-o", "levels", code=0)
    tdint("fragility", "levels", "--by", "type", "--im", "sa:0.6", "-o", "f.csv", code=0)
    (row,) = (row for row in rows("f.csv") if (row["type"], row["state"]) == ("A", "slight"))
    bins = [row for row in rows("f-bins.csv") if (row["type"], row["state"]) == ("A", "slight")]
    assert [float(row["bin_im"]) for row in bins] == pytest.approx([0.5, 2.0, 6.0])
    assert (row["fit"], row["im"], bins[0]["bin_runs"]) == ("stripes", "rotd50-sa(0.6)", "16")
    below = [
        float(row["probability_none"]) for row in rows("levels/damage.csv") if row["type"] == "A"
    ]
    shares = [1.0 - sum(below[level::3]) / len(below[level::3]) for level in range(3)]
    counted = [float(row["bin_share"]) for row in bins]
    assert counted == pytest.approx(shares, rel=1e-9, abs=1e-12)


def test_functions_of_each_building(region: Path, tdint: Command) -> None:
    """Each of two models has functions for thresholds of the drift ratio over Sa at its fundamental
    period, which the OpenQuake file states. A campaign with a single model gives equal
    parameters."""
    shaken = Path("shaken.yaml").read_text()
    Path("soft.yaml").write_text(
        shaken.replace("name: ", "name: soft ").replace("stiffness: 8000", "stiffness: 4000")
    )
    lines = REGION.partition("\n")[2].replace(", pairs: true", "")
    for name, models in (("both", "[shaken.yaml, soft.yaml]"), ("alone", "[soft.yaml]")):
        (region / f"{name}.yaml").write_text(f"buildings: {{models: {models}}}\n{lines}")
        tdint("campaign", f"{name}.yaml", "-o", name, code=0)
    tdint.refused("with --by building", "fragility", "both", "--threshold", "0.5%", code=3)
    tdint.refused("has no damage states", "fragility", "both", "--by", "type")
    call = (
        "--threshold", "0.5%,1%", "-o", "f.csv", "--overwrite", "--states",
        "light,heavy", "--openquake", "f.xml",
    )  # fmt: skip
    tdint("fragility", "both", "--by", "building", *call, code=0)
    found = rows("f.csv")
    assert [row["state"] for row in found] == ["light", "heavy"] * 2 and len(
        {row["building"] for row in found}
    ) == 2
    assert len({row["im"] for row in found}) == 2 and all(
        row["im"].startswith("geometric-mean-sa(0.") for row in found
    )
    (own,) = rows(tdint("fragility", "alone", "--threshold", "1%", "--fit", "cloud").stdout)
    (same,) = (
        row for row in found if row["building"].startswith("soft") and row["state"] == "heavy"
    )
    numbers = [[float(row[name]) for name in ("theta", "beta")] for row in (same, own)]
    assert numbers[0] == pytest.approx(numbers[1], rel=1e-9) and same["im"] == own["im"]
    assert f'imt="{own["im"].replace("geometric-mean-sa", "SA")}"' in Path("f.xml").read_text()


EXPOSURE = """\
<nrml xmlns="http://openquake.org/xmlns/nrml/0.5"><exposureModel id="e">
<conversions><costTypes><costType name="structural" type="aggregated" unit="EUR"/></costTypes>
</conversions>
<assets>
%s</assets></exposureModel></nrml>
"""
ASSET = """\
<asset id="%s" taxonomy="%s" number="%g"><location lon="10" lat="45"/>
<costs><cost type="structural" value="%g"/></costs></asset>
"""


def test_losses_of_an_exposure_model(region: Path, tdint: Command) -> None:
    """The damage equals the damage of the same buildings in an inventory, to the last digit. The
    value of an asset is its structural cost. A map contains the losses."""
    assets = (("one", "A/1", 4.0, 8e5), ("two", "A/3", 0.5, 1e6), ("three", "B/2", 1.0, 3e5))
    Path("exposure.xml").write_text(EXPOSURE % "".join(ASSET % asset for asset in assets))
    Path("types.csv").write_text("taxonomy,class,NumberOfStories\nA/1,A,1\nA/3,A,3\nB/2,B,2\n")
    losses = "losses: {slight: 5%, moderate: 20%, extensive: 60%, complete: 1}"
    study = REGION.replace(
        "inventory: buildings.csv", "inventory: exposure.xml, mapping: types.csv"
    )
    Path("exposure.yaml").write_text(study + BY_CURVES.replace("}", f", {losses}}}"))
    tdint("campaign", "exposure.yaml", "-o", "exposed", "--report", "page.html", code=0)
    # The parts of the divided table identify each row by the same cells.
    shown, keys = page("page.html"), ("type", "building", "level")
    for name in ("loss ratio", "value"):
        for part, row in zip(table_with(shown, name), rows("exposed/losses.csv"), strict=True):
            assert [part[key] for key in keys] == [row[key] for key in keys]
    found, expected = rows("exposed/damage.csv"), rows("out/damage.csv")
    assert [probabilities(row) for row in found] == [probabilities(row) for row in expected]
    values = {
        row["building"]: float(row["value"])
        for row in rows("exposed/losses.csv")
        if row["building"] or not row["type"]
    }
    assert values == pytest.approx({"": 2.1e6} | {name: value for name, _, _, value in assets})
    tdint("campaign", "export", "exposed", "--geojson", "--by", "taxonomy", code=0)
    (map_loss,) = {
        feature["properties"]["loss"]
        for feature in json.loads(Path("exposed/districts.geojson").read_text())["features"]
        if (feature["properties"]["taxonomy"], feature["properties"]["level"]) == ("B/2", 1.0)
    }
    (table_loss,) = (
        float(row["loss"])
        for row in rows("exposed/losses.csv")
        if (row["building"], row["level"]) == ("three", "1")
    )
    assert map_loss == pytest.approx(table_loss, rel=1e-11) and table_loss > 0.0
    assert {"types.csv", "exposure.xml"} <= {
        Path(item["file"]).name
        for item in json.loads(Path("exposed/summary.json").read_text())["inputs"]
    }
    result = tdint(
        *("inventory", "exposure.xml", "--mapping", "types.csv", "--units", "m"),
        *("--rules", "capacity", "--classes", "classes.csv"),
        code=0,
    )
    assert {row["id"] for row in rows(result.stdout)} == {"one", "two", "three"}
