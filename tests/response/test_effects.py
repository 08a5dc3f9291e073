"""Arguments of public functions have their effect: numbers that they change."""

from dataclasses import replace

import numpy as np
import pytest
from matplotlib.figure import Figure

import tdint
from building_cases import noise, ten_bilinear
from tdint.assessment.chart import performance_profiles as profiles
from tdint.assessment.chart import problem as references
from tdint.methods.catalogue import parse
from tdint.response.runs import analysis_kernels

MOTION = noise(samples=201, peak=6.0)
ONE_STORY = {"stories": [{"mass": 1.0, "height": 3.0, "stiffness": 200.0}], "damping": 0.05}


@pytest.fixture(scope="module")
def case():
    return tdint.prepare(ten_bilinear(), MOTION, method="newmark-average")


def once(case, **wishes):
    return tdint.run_case(case, **wishes)


def twice(case, **wishes):
    return tdint.run_sequence(case, [MOTION, MOTION], rest=1.0, **wishes)


@pytest.mark.parametrize("run", [once, twice])
def test_tolerance_history_and_check(case, run):
    coarse, fine = (run(case, tolerance=tolerance) for tolerance in (0.2, 0.005))
    assert fine.dt < coarse.dt
    assert coarse.history is None
    assert run(case, history=True, check=False).history.displacement.shape[1] == 10
    assert run(case, check=False).check is None
    assert run(case, check=True).check.errors.peak_drift.shape == (10,)


def test_a_sequence_continues_until_rest(case):
    short, long = (
        twice(case, until_rest=rest, check=False, history=True).history.time[-1]
        for rest in (False, True)
    )
    assert short == pytest.approx(5.0)
    assert long > short + 1.0


def test_name_of_a_record():
    assert tdint.make_record(np.ones(9), dt=0.1, units="g", name="mine").source == "mine"


def test_plot_into_axes_and_in_units():
    """Pseudo-accelerations in g are those in m/s^2 over 9.80665."""
    spectrum = tdint.spectrum(MOTION, np.array([0.2, 0.5, 1.0]))
    lines = []
    for units in ("g", "m/s^2"):
        axes = Figure().subplots()
        assert tdint.plot(spectrum, axes, units) is axes
        lines.append(axes.lines[0].get_ydata())
    assert lines[1] == pytest.approx(9.80665 * np.asarray(lines[0]), rel=1e-12)


@pytest.mark.parametrize("points", [4, 9])
def test_points_of_a_cyclic_test(points):
    found = tdint.cyclic_test(ten_bilinear(), 1, ["1%"], points=points)
    assert found.path.drift.size == 1 + 4 * points


def test_gradient_of_many_runs():
    runs = tdint.run_many(ten_bilinear(), MOTION, method="impulse4", gradient="stiffness_factor")
    alone = tdint.run(ten_bilinear(), MOTION, method="impulse4", gradient="stiffness_factor")
    assert runs.gradient.peak_drift[0] == pytest.approx(alone.gradient.peak_drift, rel=1e-6)


def test_methods_and_problems_of_failures():
    reports = []
    found = tdint.failures(
        ["impulse4", "hht"], ["large-step"], progress=lambda *done: reports.append(done)
    )
    assert reports == [(1, 2), (2, 2)]
    assert [(trial.method, trial.problem) for trial in found] == [
        ("impulse4", "large-step"),
        ("hht", "large-step"),
    ]


@pytest.mark.long
def test_load_law_and_frequency_of_an_order():
    plain = tdint.order("newmark-average").displacement
    for changed in ({"load": "free"}, {"law": "polynomial"}, {"frequency_ratio": 0.7}):
        other = tdint.order("newmark-average", **changed).displacement
        assert not np.allclose(other, plain, rtol=1e-3)


def test_numbers_methods_and_steps_of_the_examples_of_the_paper():
    found = tdint.paper_examples([1], "impulse", [0.04, 0.02])
    assert [(run.method, run.dt) for run in found] == [("impulse", 0.04), ("impulse", 0.02)]


def test_period_name_and_units_of_a_template(tmp_path):
    (tmp_path / "model.yaml").write_text(
        tdint.model_template(2, period=0.7, name="tower", units="us")
    )
    model = tdint.load_model(tmp_path / "model.yaml")
    assert model.name == "tower"
    assert 2.0 * np.pi / tdint.modes(model).omega[0] == pytest.approx(0.7, rel=1e-3)
    assert "kip" in (tmp_path / "model.yaml").read_text()


def test_duration_of_many_runs():
    runs = tdint.run_many(ten_bilinear(), MOTION, method="hht", duration=0.5)
    alone = tdint.run(ten_bilinear(), MOTION, method="hht", duration=0.5)
    assert runs.stories.peak_drift[0] == pytest.approx(alone.stories.peak_drift, rel=1e-12)
    assert (
        runs.stories.peak_drift[0].max()
        < 0.9 * tdint.run(ten_bilinear(), MOTION, method="hht").stories.peak_drift.max()
    )


def test_title_of_a_figure():
    spectrum = tdint.spectrum(MOTION, np.array([0.2, 0.5, 1.0]))
    titles = [tdint.plot(spectrum, title=title).get_suptitle() for title in (True, False)]
    assert titles[0]
    assert not titles[1]


@pytest.mark.parametrize("cached", [True, False])
def test_points_times_and_stored_reference_of_a_chart(tmp_path, monkeypatch, cached):
    """A run is timed up to four times per repetition."""
    monkeypatch.setattr(references, "cache_folder", lambda: tmp_path)
    methods, steps, reports = ["impulse4", "newmark-average"], [0.04, 0.02], []
    chart = tdint.chart(
        ONE_STORY,
        MOTION,
        method=methods,
        dt=steps,
        duration=0.8,
        repeats=1,
        cached=cached,
        progress=lambda *done: reports.append(done),
    )
    assert [total for _, total in reports] == [100] * len(reports)
    assert reports == sorted(reports)
    assert reports[-1][0] > 50
    assert [(point.method, point.dt, point.steps) for point in chart.points] == [
        (method, dt, round(0.8 / dt)) for method in methods for dt in steps
    ]
    assert all(1 <= len(point.times) <= 4 for point in chart.points)
    assert len(list(tmp_path.rglob("*.*"))) == cached


@pytest.mark.parametrize("damping", [0.02, 0.1])
def test_damping_of_floor_spectra(case, damping):
    response = tdint.run_case(case, history=True, check=False)
    periods = np.array([0.1, 0.5])
    (found,) = tdint.floor_spectra(response, [10], periods, [damping])
    floor = tdint.make_record(
        response.history.absolute_acceleration[:, 9], dt=response.dt, units="m/s^2"
    )
    expected = tdint.spectrum(floor, periods, damping).psa
    np.testing.assert_allclose(found.spectrum.psa, expected, rtol=1e-12)


def test_units_of_two_components(tmp_path):
    for name, wave in (("HN1", np.sin), ("HN2", np.cos)):
        times = "".join(f"{0.01 * i:.2f},{wave(0.1 * i):.6f}\n" for i in range(60))
        (tmp_path / f"a.{name}.csv").write_text(f"time,a\n{times}")
    files = sorted(tmp_path.iterdir())
    pair, other = (tdint.read_horizontals(*files, units=units) for units in ("g", "m/s^2"))
    for component in ("first", "second"):
        np.testing.assert_allclose(
            getattr(pair, component).acceleration,
            9.80665 * getattr(other, component).acceleration,
            rtol=1e-12,
        )


@pytest.mark.parametrize("method", ["moment4", "houbolt"])
def test_loop_of_a_compiled_model(monkeypatch, method):
    """The kernels that are compiled are those of the method. They are not compiled here."""
    compiled = []
    monkeypatch.setattr(analysis_kernels, "compile_ahead", lambda pairs, *_: compiled.extend(pairs))
    tdint.compile_model(ten_bilinear(), method)
    assert compiled == list(analysis_kernels.kernels_of_model(ten_bilinear(), parse(method)))
    assert compiled != list(analysis_kernels.kernels_of_model(ten_bilinear(), parse("impulse4")))


def test_arguments_of_performance_profiles(monkeypatch):
    """Two motions with a method and tolerances: the points of the steps and of the tolerances."""
    note = "asked for OpenSees"
    monkeypatch.setattr(profiles, "_opensees_results", lambda *_: ([], np.nan, note))
    motions, reports = [noise(samples=21), noise(samples=21, seed=8)], []
    plain = tdint.performance_profiles(ONE_STORY, motions, method=["hht"], repeats=1)
    assert {point.line for each in plain.measured for point in each.points} == {"hht"}
    assert [each.peer_note for each in plain.measured] == ["", ""]
    chart = tdint.performance_profiles(
        ONE_STORY,
        motions[0],
        method="impulse4",
        tolerances=(0.1, 0.01),
        repeats=3,
        peers=True,
        progress=lambda *done: reports.append(done),
    )
    (found,) = chart.measured
    assert found.peer_note == note
    chosen = ["impulse4 within 0.1", "impulse4 within 0.01"]
    assert [point.method for point in found.points][-2:] == chosen
    times = [[len(point.times) for point in each.points] for each in (found, plain.measured[0])]
    assert [max(counts) for counts in times] == [3, 1]
    assert 0.9 < reports[-1][1] <= 1.0


def test_stride_of_an_order():
    """The order is kept, and the record of the larger stride has another sampling interval."""
    one, four = (tdint.order("newmark-average", load="record", stride=n) for n in (1, 4))
    assert one.order("displacement") == pytest.approx(2.0, abs=0.01)
    assert four.order("displacement") == pytest.approx(2.0, abs=0.01)
    assert abs(one.displacement[-1] / four.displacement[-1] - 1.0) > 0.1


def test_load_and_law_of_an_order():
    """Free vibration has no frequency of a load."""
    found = tdint.order("impulse4", load="free", law="polynomial")
    assert (found.load, found.law) == ("free", "polynomial")
    assert np.isnan(found.frequency_ratio)
    assert found.order("displacement") == pytest.approx(4.0, abs=0.1)


def test_arguments_of_a_matched_suite(short_matching):
    """The spectra before and after are those of the damping ratio and of the factors, within the
    range of periods."""
    target, reports = "ec8:type=1,soil=B,ag=0.2g,damping=2%", []
    motions = [MOTION, replace(MOTION, acceleration=MOTION.acceleration[::-1])]
    matches = tdint.match_suite(
        motions,
        target,
        periods=(0.3, 0.6),
        damping=0.02,
        factors=[0.5, 2.0],
        progress=lambda *done: reports.append(done),
    )
    assert reports[-1][0] == reports[-1][1] > 0
    assert matches[1].factor == pytest.approx(4.0 * matches[0].factor)
    for match, motion in zip(matches, motions, strict=True):
        assert 0.3 <= min(match.periods) < max(match.periods) <= 0.6
        seed = match.factor * tdint.spectrum(motion, match.periods, 0.02).psa
        np.testing.assert_allclose(match.seed_psa, seed, rtol=1e-9)
        after = tdint.spectrum(match.record, match.periods, 0.02).psa
        np.testing.assert_allclose(match.psa, after, rtol=1e-9)
