"""Effects of single options as numbers: closed forms, other commands, and keys of files."""

import json
import re
from collections import Counter
from importlib import resources
from pathlib import Path

import numpy as np
import pytest

import tdint.assessment.stability.stability as stability
from cli.conftest import STUDY, write_record
from csv_rows import rows
from tdint.assessment.chart import problem as references
from tdint.methods.catalogue import parse
from tdint_cli.assessment import method_options

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
    tdint(*f"scale {MOTION} --to pga=0.5g -o factors.csv".split(), code=0)
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
    """Each publication is in the rows of its methods."""
    text = (resources.files("tdint.methods") / "publications.bib").read_text("utf-8")
    described = re.findall(r"keywords = {(.*)}", text)
    table = rows(tdint("methods", code=0).stdout)
    counts = {row["name"]: len(row["reference"].split(" | ")) for row in table}
    assert counts == Counter(", ".join(described).split(", "))
    assert counts == {row["name"]: len(row["doi"].split(" | ")) for row in table}
    (row,) = (row for row in table if row["name"] == "fox-goodwin")
    assert "Fox" in row["reference"]


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


def test_periods_and_damping_of_floor_spectra(folder, tdint):
    options = "--floor-spectra roof --floor-period 0.3,0.7 --floor-damping 2%"
    tdint(*f"run shaken.yaml {MOTION} --no-check -o out {options}".split(), code=0)
    table = rows("out/floor-spectra.csv")
    assert [(row["period_s"], row["damping"]) for row in table] == [
        ("0.3", "0.02"),
        ("0.7", "0.02"),
    ]
    for row in table:
        frequency = 2.0 * np.pi / float(row["period_s"])
        assert float(row["psa_m_s2"]) == pytest.approx(frequency**2 * float(row["sd_m"]), rel=1e-9)


def test_units_of_a_recorded_base(folder, tdint):
    """With a base in g, the floors of a linear building are in g."""
    model = Path("forced.yaml").read_text()
    Path("model.yaml").write_text(model[: model.index("excitation")])
    found = []
    for units in ("m/s^2", "g"):
        sensor = "{{file: motion.mseed, component: {}, units: {}{}}}"
        base = sensor.format("HNE", units, "")
        floor = sensor.format("HNN", units, ", quantity: acceleration")
        Path("recorded.yaml").write_text(f"base: {base}\nfloors: {{1: {floor}}}\n")
        (row,) = rows(
            tdint(*["compare", "model.yaml", "--recorded", "recorded.yaml"], code=0).stdout
        )
        found.append(row)
    for name in ("correlation", "rms_difference", "peak_ratio"):
        assert float(found[0][name]) == pytest.approx(float(found[1][name]), rel=1e-6)


@pytest.fixture
def pool(working_directory):
    """Write ten ground motions with different frequencies."""
    Path("pool").mkdir()
    t = 0.01 * np.arange(400)
    for number in range(10):
        wave = np.sin((4.0 + 3.0 * number) * t) + 0.3 * np.sin((31.0 - 2.0 * number) * t)
        lines = "\n".join(f"{a:.6f}" for a in wave * np.exp(-t))
        Path(f"pool/r{number}.txt").write_text(f"# dt = 0.01 s, units = m/s^2\n{lines}\n")


SELECT = (
    "scale pool --target ec8:type=1,soil=B,ag=0.25g --range 0.2:1 --select 4 -o s.csv --overwrite"
)


def test_range_of_the_factors_of_a_selection(pool, tdint):
    factors = {}
    for limits in ("0.001:1000", "1.5:2.5"):
        tdint(*SELECT.split(), "--factor-range", limits, code=0)
        factors[limits] = [float(row["factor"]) for row in rows("s.csv")]
    assert all(1.5 <= factor <= 2.5 for factor in factors["1.5:2.5"])
    assert not all(1.5 <= factor <= 2.5 for factor in factors["0.001:1000"])


def test_standard_deviation_of_a_selection(pool, tdint):
    """The standard deviation of ln Sa of the selected motions, from separate spectra."""
    found = []
    for target in (0.2, 1.2):
        tdint(*SELECT.split(), "--factor-range", "0.001:1000", "--target-std", target, code=0)
        logs = []
        for row in rows("s.csv"):
            line = f"spectrum {row['record']} --periods 0.2:1:20 --scale {row['factor']}"
            spectrum = rows(tdint(*line.split(), code=0).stdout)
            logs.append([np.log(float(each["psa_m_s2"])) for each in spectrum])
        found.append(np.mean(np.std(logs, axis=0, ddof=1)))
    assert found[1] > 1.3 * found[0]


def test_floor_spectra_of_a_campaign(folder, tdint):
    Path("study.yaml").write_text(STUDY)
    options = "--floor-spectra roof --floor-period 0.3,0.7 --floor-damping 2% -o out"
    tdint(*f"campaign study.yaml {options}".split(), code=0)
    table = rows("out/floor-spectra-mean.csv")
    assert {row["period_s"] for row in table} == {"0.3", "0.7"}
    assert {row["damping"] for row in table} == {"0.02"}


def test_damping_of_the_intensity_of_a_study(folder, tdint):
    """The factor of a level is the level divided by Sa with the damping ratio of the option."""
    tdint(*f"ida shaken.yaml {MOTION} --im sa --damping 10% --max-im 0.02g -o out".split(), code=0)
    level = rows("out/ida.csv")[0]
    period = rows(tdint("modes", "shaken.yaml", code=0).stdout)[0]["period_s"]
    call = f"spectrum {MOTION} --period {period} --damping 10%"
    (row,) = rows(tdint(*call.split(), code=0).stdout)
    expected = float(level["im"]) / float(row["psa_m_s2"])
    assert float(level["scale"]) == pytest.approx(expected, rel=1e-6)


def test_step_and_figure_of_a_sensitivity(folder, tdint):
    """The key `analysis.dt` has the effect of the option."""
    call = f"sensitivity shaken.yaml {MOTION} --vary mass_factor=0.9:1.1"
    plain = rows(tdint(*call.split(), code=0).stdout)
    short = tdint(*call.split(), "--dt", "0.005", "--plot", "s.svg", code=0).stdout
    assert Path("s.svg").stat().st_size > 0
    model = Path("shaken.yaml").read_text()
    Path("shaken.yaml").write_text(model.replace("{method:", "{dt: 0.005, method:"))
    assert rows(short) == rows(tdint(*call.split(), code=0).stdout) != plain


def test_units_of_a_sensitivity(folder, tdint):
    """Each row has its own unit, and its peaks are those of `run` in this unit."""
    call = f"sensitivity shaken.yaml {MOTION} --vary mass_factor=0.9:1.1"
    plain = rows(tdint(*call.split(), code=0).stdout)
    found = rows(tdint(*call.split(), "--output-units", "kip,in,g", code=0).stdout)
    sizes = {"m": ("in", 0.0254), "m/s^2": ("g", 9.80665), "N": ("kip", 4448.2216152605)}
    assert {row["unit"] for row in plain} == {*sizes, "1"}
    for row, other in zip(found, plain, strict=True):
        unit, size = sizes.get(other["unit"], ("1", 1.0))
        assert row["unit"] == unit
        for name in ("at_low", "as_it_is", "at_high"):
            assert float(row[name]) == pytest.approx(float(other[name]) / size, rel=1e-9)
        unchanged = ("quantity", "parameter", "low", "high", "effect")
        assert [row[name] for name in unchanged] == [other[name] for name in unchanged]


def test_periods_of_a_comparison(folder, tdint):
    model = Path("forced.yaml").read_text()
    Path("model.yaml").write_text(model[: model.index("excitation")])
    sensor = "{{file: motion.mseed, component: {}, units: m/s^2{}}}"
    floor = sensor.format("HNN", ", quantity: acceleration")
    Path("recorded.yaml").write_text(f"base: {sensor.format('HNE', '')}\nfloors: {{1: {floor}}}\n")
    call = "compare model.yaml --recorded recorded.yaml --period 0.3,0.7 -o out"
    tdint(*call.split(), code=0)
    table = rows("out/spectra.csv")
    assert {row["period_s"] for row in table} == {"0.3", "0.7"}


@pytest.mark.parametrize("flag", ["true", "false"])
def test_p_delta_of_a_campaign(folder, tdint, flag):
    """The key of the campaign file has the effect of the key of the model, and replaces it."""
    Path("study.yaml").write_text(STUDY.replace("method:", f"p_delta: {flag}, method:"))
    model = Path("shaken.yaml").read_text()
    drifts = []
    for mine in ("true", "false"):
        Path("shaken.yaml").write_text(f"{model}p_delta: {mine}\n")
        tdint(*["campaign", "study.yaml", "-o", "out", "--overwrite"], code=0)
        drifts += [row["peak_drift_m"] for row in rows("out/runs.csv")[-1:]]
    call = "run model.yaml other.mseed --units m/s^2 --no-check"
    found = {}
    for mine in ("true", "false"):
        Path("model.yaml").write_text(f"{model}p_delta: {mine}\n")
        table = rows(tdint(*call.split(), code=0).stdout)
        found[mine] = max((row["peak_drift_m"] for row in table), key=float)
    assert drifts == 2 * [found[flag]]
    assert found["true"] != found["false"]


def test_column_of_the_forces_of_a_campaign(folder, tdint):
    """A column with twice the force doubles the response of a linear building."""
    model = Path("forced.yaml").read_text()
    Path("model.yaml").write_text(model[: model.index("excitation")] + "analysis: {duration: 1}\n")
    Path("gust.csv").write_text("time_s,one_kN,two_kN\n0,0,0\n0.2,40,80\n0.7,-25,-50\n1,0,0\n")
    drifts = []
    for column in ("one_kN", "two_kN"):
        Path("study.yaml").write_text(
            "buildings: {models: [model.yaml]}\n"
            f"forces: {{files: [gust.csv], floor: roof, column: {column}}}\n"
        )
        tdint(*["campaign", "study.yaml", "-o", "out", "--overwrite"], code=0)
        drifts += [float(row["peak_drift_m"]) for row in rows("out/runs.csv")]
    assert drifts[1] == pytest.approx(2.0 * drifts[0], rel=1e-9)


def test_treatment_of_pairs_of_a_study_by_a_fragility_function(folder, tdint):
    """The functions are those of a study with this treatment."""
    for number in (1, 2, 3):
        write_record(f"{number}.mseed", "HN1", "HN2", peak=1.0 + number, samples=40 + 20 * number)
    Path("study.yaml").write_text(
        "buildings: {models: [shaken.yaml]}\nintensity: {scales: [0.25, 0.5, 0.75, 1]}\n"
        "records: {files: [1.mseed, 2.mseed, 3.mseed], units: m/s^2, pairs: true}\n"
    )
    found = {}
    for demand in ("larger", "separate"):
        study = f"campaign study.yaml --pair-demand {demand} -o {demand}"
        tdint(*study.split(), code=0)
        call = f"fragility {demand} --fit cloud --threshold 0.5%"
        found[demand] = rows(tdint(*call.split(), code=0).stdout)
    call = "fragility larger --fit cloud --threshold 0.5% --pair-demand separate"
    assert rows(tdint(*call.split(), code=0).stdout) == found["separate"] != found["larger"]


@pytest.mark.usefixtures("folder", "short_matching")
def test_factors_of_a_matched_mean(tdint):
    """The factors of the table have a common ratio to the factors in the result."""
    Path("flat.csv").write_text("period_s,sa_g\n0.05,0.3\n4,0.3\n")
    files = ("motion.mseed", "other.mseed")
    call = "match --target flat.csv --range 0.2:0.6 --suite mean --units m/s^2 -o m --overwrite"
    for factors in ((1.0, 1.0, 1.0), (1.0, 1.0, 4.0)):
        lines = zip((files[0], files[0], files[1]), ("HNE", "HNN", "HNE"), factors, strict=True)
        table = "".join(f"{file},{channel},{factor}\n" for file, channel, factor in lines)
        Path("factors.csv").write_text(f"record,component,factor\n{table}")
        tdint(*call.split(), "--factors", "factors.csv", "--plot", "m.svg", code=0)
        found = np.array([float(row["factor"]) for row in rows("m/matched.csv")])
        assert found / found[0] == pytest.approx(factors, rel=1e-9)
        assert "scaled seed" in Path("m.svg").read_text("utf-8")


def test_impulse_with_other_parameters(tdint, monkeypatch):
    """The additional methods are unstable within a band of additional steps near the square root
    of 12. The limits of the messages are not computed."""
    monkeypatch.setattr(stability, "critical_step", lambda *_: np.inf)
    table = rows(tdint(*["stability", "--beta-scan", "--dt-over-t", "0.01"], code=0).stdout)
    steps = sorted({float(row["dt_over_t"]) for row in table})
    assert 2.0 * np.pi * np.array(steps[1:]) == pytest.approx(np.linspace(3.1, 3.7, 301))
    unstable = {row["method"] for row in table if float(row["spectral_radius"]) > 1.0 + 1e-9}
    assert {row["method"] for row in table} - unstable == {"impulse:beta=1/144"}


def test_all_methods_in_a_figure_of_overshoots(working_directory, tdint, monkeypatch):
    """A figure contains houbolt only with --all. Two methods replace the catalogue, because the
    time loops of all methods would be compiled."""
    methods = [parse("newmark-average"), parse("houbolt")]
    monkeypatch.setattr(method_options, "integrators", lambda _: methods)
    for options, is_drawn in ((("--plot=few.svg",), False), (("--plot=all.svg", "--all"), True)):
        assert "houbolt" in tdint("overshoot", *options, code=0).stdout
        figure = Path(options[0].partition("=")[2]).read_text("utf-8")
        assert ("houbolt" in figure) == is_drawn
        assert "newmark-average" in figure


def test_other_programs_and_stored_reference_of_a_chart(folder, tdint, monkeypatch):
    """SciPy solves the problem with --peers; the reference is not stored with --no-cache."""
    (folder / "cache").mkdir()
    monkeypatch.setattr(references, "cache_folder", lambda: folder / "cache")
    Path("one.yaml").write_text("stories: [{mass: 1, height: 3, stiffness: 200}]\ndamping: 5%\n")
    call = f"chart one.yaml --record {MOTION} --method hht --dt 0.02 --duration 0.1 --repeat 1"
    for options, is_stored, programs in (
        ("--no-cache", False, set()),
        ("--peers", True, {"scipy"}),
    ):
        table = rows(tdint(*call.split(), options, code=0).stdout)
        found = {row["method"].partition("/")[0] for row in table if "/" in row["method"]}
        assert found - {"openseespy"} == programs
        assert any((folder / "cache").iterdir()) == is_stored
