"""Arguments of the functions for suites and studies have their effect: numbers that they change."""

from dataclasses import replace

import numpy as np
import pytest

import tdint
from building_cases import noise, ten_bilinear
from tdint.errors import UsageError
from tdint.ground_motion.horizontals import Horizontals
from tdint.response.spectra.target import read_target
from tdint.studies.campaign.definition import Distribution, ParameterSweep
from tdint.studies.campaign.reader import load_campaign
from tdint.studies.ida import ida as ida_module
from tdint.studies.ida.ida import IdaSettings, ida
from tdint.studies.motions.intensity import pga
from tdint.studies.sensitivity import sensitivity as sensitivity_module

BUILDINGS = "id,NumberOfStories,YearBuilt,StructureType,PlanArea\nhouse,2,1987,C1,900\n"
LOW = IdaSettings(max_im=0.2)
TARGET = "asce7:sds=0.6,sd1=0.4,tl=8"


def named(name, seed=0, component="HN1"):
    """Return a ground motion of 2 s with a file name."""
    motion = noise(samples=201, peak=2.0, seed=seed) if seed else noise(samples=201, peak=2.0)
    return replace(motion, component=component, source=name)


def pair():
    """Return two perpendicular components, of which the second is smaller."""
    first = named("a.csv")
    second = replace(first, acceleration=0.4 * first.acceleration[::-1], component="HN2")
    return Horizontals(first, second)


def drifts(study):
    return [[run.drift_ratio for run in curve.runs] for curve in study.curves]


def test_method_of_a_study_of_intensities():
    model = ten_bilinear()
    found = ida(model, [named("a.csv")], pga(), LOW, method="newmark-average")
    changed = replace(model, analysis=replace(model.analysis, method="newmark-average"))
    assert found.method == "newmark-average"
    assert drifts(found) == drifts(ida(changed, [named("a.csv")], pga(), LOW))
    assert drifts(found) != drifts(ida(model, [named("a.csv")], pga(), LOW))


def test_threads_and_progress_of_a_study_of_intensities(monkeypatch):
    jobs, on_threads, reports = [], ida_module.on_threads, []

    def counted(work, items, count):
        jobs.append(count)
        return on_threads(work, items, count)

    monkeypatch.setattr(ida_module, "on_threads", counted)
    motions = [named("a.csv"), replace(named("b.csv"), acceleration=named("").acceleration[::-1])]
    ida(ten_bilinear(), motions, pga(), LOW, jobs=3, progress=lambda *done: reports.append(done))
    assert jobs == [3]
    assert reports == [(0, 2), (1, 2), (2, 2)]


@pytest.mark.parametrize("rule", ["geometric-mean", "rotd100"])
def test_intensity_and_demand_of_a_pair(rule):
    """The factor of a level is the level divided by the intensity of the pair."""
    study = ida(ten_bilinear(), [pair()], pga(), LOW, pair=rule, pair_demand="mean")
    assert (study.pair, study.pair_demand) == (rule, "mean")
    run = study.curves[0].runs[0]
    assert run.scale == pytest.approx(run.im / pga().of(pair(), rule), rel=1e-12)


@pytest.mark.parametrize("rule", ["geometric-mean", "rotd100"])
@pytest.mark.parametrize("damping", [0.02, 0.05])
def test_damping_and_pair_of_a_target_spectrum(damping, rule):
    """The average of the scaled spectra is the target in the mean."""
    periods, target = np.array([0.2, 0.4, 0.8]), replace(read_target(TARGET), damping=None)
    arguments = {"target": target, "periods": periods, "damping": damping, "pair": rule}
    scaling = tdint.scale([pair()], **arguments)
    assert (scaling.damping, scaling.pair) == (damping, rule)
    chosen = tdint.select(
        [pair()],
        target,
        1,
        **{k: arguments[k] for k in arguments if k != "target"},
        factors=(0.001, 1000.0),
    )
    assert chosen.factors == pytest.approx(scaling.factors, rel=1e-12)
    others = [
        tdint.scale([pair()], **arguments | changed).factors[0]
        for changed in ({"damping": 0.2}, {"pair": "rotd50"})
    ]
    assert min(abs(other / scaling.factors[0] - 1.0) for other in others) > 1e-3


def test_step_method_threads_and_progress_of_a_sensitivity(monkeypatch):
    """The effects are those of a model with the method and the time step."""
    model, reports, jobs = ten_bilinear(), [], []
    threads = sensitivity_module.threads
    monkeypatch.setattr(
        sensitivity_module, "threads", lambda count: jobs.append(count) or threads(count)
    )
    ranges = {"stiffness_factor": (0.8, 1.2)}
    found = tdint.sensitivity(
        model,
        [named("a.csv")],
        ranges,
        method="newmark-average",
        dt=0.005,
        jobs=97,  # not the number of processors
        progress=lambda *done: reports.append(done),
    )
    assert jobs == [97]
    analysis = replace(model.analysis, method="newmark-average", dt=0.005)
    expected = tdint.sensitivity(replace(model, analysis=analysis), [named("a.csv")], ranges)
    other = tdint.sensitivity(model, [named("a.csv")], ranges)
    assert [row.at_high for row in found] == [row.at_high for row in expected]
    assert [row.at_high for row in found] != [row.at_high for row in other]
    assert reports[-1][0] == reports[-1][1] > 0


def test_units_of_a_table_of_sensitivities():
    """The numbers of a row are in the unit of the row."""
    found = tdint.sensitivity(ten_bilinear(), [named("a.csv")], {"mass_factor": (0.9, 1.1)})
    table, plain = tdint.to_dict(found, "mm,kN"), tdint.to_dict(found)
    sizes = {"mm": 0.001, "mm/s^2": 0.001, "kN": 1000.0, "1": 1.0}
    assert set(table["unit"]) == {*sizes}
    for name in ("at_low", "as_it_is", "at_high"):
        expected = [value / sizes[u] for value, u in zip(plain[name], table["unit"], strict=True)]
        assert table[name] == pytest.approx(expected, rel=1e-12)
    assert table["effect"] == pytest.approx(plain["effect"], rel=1e-9)


def test_units_scatter_and_seed_of_an_inventory(tmp_path):
    """Areas are in the square of the unit; the same seed gives the same buildings."""
    (tmp_path / "b.csv").write_text(BUILDINGS)

    def building(**arguments):
        return tdint.inventory(tmp_path / "b.csv", **{"units": "m"} | arguments)[0].building

    with pytest.raises(UsageError, match="no unit of length; known: m"):
        tdint.inventory(tmp_path / "b.csv")
    plain = building()
    ratio = building(units="ft").stories[0].mass / plain.stories[0].mass
    assert ratio == pytest.approx(0.3048**2, rel=1e-9)
    scattered = [
        building(stiffness_scatter=0.3, damping_scatter=0.4, seed=seed) for seed in (1, 1, 2)
    ]
    stiffness = [model.stories[0].stiffness for model in scattered]
    ratios = [model.damping for model in scattered]
    assert stiffness[0] == stiffness[1] != stiffness[2]
    assert ratios[0] == ratios[1] != ratios[2]
    changed = building(damping_scatter=0.3)
    assert building(stiffness_scatter=0.3).damping == plain.damping != changed.damping
    assert changed.stories[0].stiffness == plain.stories[0].stiffness


CLOUD = "im,edp,unit\n0.1,0.004,g\n0.2,0.007,g\n0.4,0.019,g\n0.6,0.021,g\n1,0.09,g\n"


def test_range_and_dispersion_of_a_fragility_function(tmp_path):
    """Rows below the range of demands are ignored; dispersions are added by their squares."""
    (tmp_path / "all.csv").write_text(CLOUD)
    (tmp_path / "part.csv").write_text(CLOUD.replace("0.1,0.004,g\n", ""))

    def fitted(name, **arguments):
        (function,) = tdint.fragility(tmp_path / name, 0.01, fit="cloud", **arguments).functions
        return function.theta, function.beta_total

    assert fitted("all.csv", edp_range=(0.006, np.inf)) == pytest.approx(fitted("part.csv"))
    assert fitted("all.csv") != pytest.approx(fitted("part.csv"), rel=1e-3)
    theta, beta = fitted("part.csv", modeling_dispersion=0.3)
    assert theta == pytest.approx(fitted("part.csv")[0], rel=1e-12)
    assert beta == pytest.approx(np.hypot(fitted("part.csv")[1], 0.3), rel=1e-12)


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("{lognormal: {median: 1.2, beta: 0.3}}", Distribution("lognormal", 1.2, 0.3)),
        ("{normal: {mean: 1.1, sd: 0.2}}", Distribution("normal", 1.1, 0.2)),
    ],
)
def test_distribution_of_a_campaign_file(tmp_path, text, expected):
    """The factors are those of a sweep with this distribution."""
    file = tmp_path / "study.yaml"
    file.write_text(
        "buildings: {models: [m.yaml]}\nrecords: {files: [a.csv]}\n"
        f"vary: {{strength_factor: {text}, samples: 8, seed: 3}}\n"
    )
    sweep = ParameterSweep(random={"strength_factor": expected}, samples=8, seed=3)
    assert load_campaign(file).sweep.changes() == sweep.changes()


def test_fit_and_measure_of_a_fragility_function(tmp_path):
    """With the columns of two fits, the function is that of the columns of the fit. The intensities
    are those of the measure."""
    columns = ("im,collapses,records", "capacity")
    counts = ("0.2,1,9", "0.4,4,9", "0.8,8,9")
    capacities = ("0.3", "0.5", "0.9")
    files = {
        "stripes": counts,
        "ida": capacities,
        "both": map(",".join, zip(counts, capacities, strict=True)),
    }
    for (name, lines), header in zip(files.items(), (*columns, ",".join(columns)), strict=True):
        (tmp_path / f"{name}.csv").write_text("\n".join([header, *lines]) + "\n")
    for fit in ("stripes", "ida"):
        (found,) = tdint.fragility(tmp_path / "both.csv", fit=fit).functions
        (expected,) = tdint.fragility(tmp_path / f"{fit}.csv").functions
        assert (found.fit, found.theta, found.beta) == (fit, expected.theta, expected.beta)
    lines = "".join(
        f"a,r{i},done,{0.01 * x * (1.0 + 0.1 * (-1) ** i)},{x},{0.1 * x}\n"
        for i, x in enumerate((0.5, 0.8, 1.1, 1.6, 2.2))
    )
    header = "building,record,status,peak_drift_ratio,sa_t1_m_s2,pgv_m_s\n"
    (tmp_path / "study").mkdir()
    (tmp_path / "study/runs.csv").write_text(header + lines)
    by_sa, by_pgv = (
        tdint.fragility(tmp_path / "study", 0.02, fit="cloud", measure=measure).functions[0]
        for measure in (None, "pgv")
    )
    assert by_pgv.theta == pytest.approx(0.1 * by_sa.theta, rel=1e-9)
    assert by_pgv.beta == pytest.approx(by_sa.beta, rel=1e-9)


def test_mapping_of_an_exposure_model(tmp_path):
    """The buildings are those of an inventory with the rows of their taxonomies."""
    assets = "".join(
        f'<asset id="{name}" taxonomy="{taxonomy}" number="1" area="900">'
        '<location lon="10" lat="45"/></asset>\n'
        for name, taxonomy in (("a", "X"), ("b", "Y"))
    )
    (tmp_path / "e.xml").write_text(
        '<nrml xmlns="http://openquake.org/xmlns/nrml/0.5"><exposureModel id="e">\n'
        f"<assets>\n{assets}</assets></exposureModel></nrml>\n"
    )
    columns = "NumberOfStories,YearBuilt,StructureType,PlanArea"
    lines = {"X": "2,1987,C1,900", "Y": "3,1960,C1,500"}
    for name, key, keys in (("types", "taxonomy", "XY"), ("plain", "id", "ab")):
        table = "".join(f"{k},{line}\n" for k, line in zip(keys, lines.values(), strict=True))
        (tmp_path / f"{name}.csv").write_text(f"{key},{columns}\n{table}")
    found = tdint.inventory(tmp_path / "e.xml", units="m", mapping=tmp_path / "types.csv")
    expected = tdint.inventory(tmp_path / "plain.csv", units="m")
    assert [item.building.stories for item in found] == [item.building.stories for item in expected]
    with pytest.raises(UsageError, match="unknown rules"):
        tdint.inventory(tmp_path / "plain.csv", units="m", rules="other")


def test_layout_of_a_pair(tmp_path):
    """The components are the columns of the layout."""
    text = "".join(f"{i} {2 * i % 7} {3 * i % 11}\n" for i in range(60))
    (tmp_path / "pair.txt").write_text(text)
    layout = tdint.TextLayout(step=0.02, column=("2", "3"))
    pair = tdint.read_horizontals(tmp_path / "pair.txt", units="m/s^2", layout=layout)
    assert pair.first.dt == 0.02
    np.testing.assert_array_equal(pair.first.acceleration, [2 * i % 7 for i in range(60)])
    np.testing.assert_array_equal(pair.second.acceleration, [3 * i % 11 for i in range(60)])
