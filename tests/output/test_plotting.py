"""Figures from Python: figures of every result, main panels on axes of the caller, files."""

import numpy as np
import pytest
from matplotlib.figure import Figure
from scipy.special import ndtr

import figure_rules
import tdint
from selection import every
from tdint.errors import OutputError, UsageError
from tdint.units import STANDARD_GRAVITY

pytestmark = pytest.mark.usefixtures("not_laid_out")

LAW = {"type": "bilinear", "yield_force": 50, "hardening": 0.1}
STORIES = [{"mass": 10.0, "height": 3.0, "stiffness": 8000.0, "law": LAW, "repeat": 2}]
MODEL = {
    "name": "small",
    "stories": STORIES,
    "damping": 0.05,
    "analysis": {"method": "newmark-average"},
}
WAVE = np.sin(9.0 * np.arange(300) * 0.01)
PERIODS = np.geomspace(0.1, 2.0, 20)


@pytest.fixture(scope="module")
def results():
    """Results of each type with a figure."""
    record = tdint.make_record(3.0 * WAVE, dt=0.01, units="m/s^2")
    model = tdint.load_model(MODEL)
    pushed = tdint.pushover(model, "4%", points=40)
    return {
        "record": record,
        "run": tdint.run(model, record, history=True),
        "peaks": tdint.run(model, record),
        "runs": tdint.run_many(model, [record, record], scales=[0.5, 1.0]),
        "gradient": tdint.run(model, record, gradient=["damping", "record.scale"]).gradient,
        "modes": tdint.modes(model),
        "law": tdint.cyclic_test(model, 1, ["1%"]),
        "pushover": pushed,
        "target displacements": tdint.target_displacements(pushed, "asce7:sds=1.0,sd1=0.8,tl=8"),
        "spectrum": tdint.spectrum(record, PERIODS),
        "inelastic": tdint.constant_ductility(record, PERIODS[-2:], [2.0]),
        "drifts": tdint.drift_spectrum(record, PERIODS),
        "scale": tdint.scale([record], "pga", 1.0),
        "sensitivity": tdint.sensitivity(model, record, {"damping": (0.02, 0.05)}),
        "fragility": tdint.fit_stripes([1.0, 2.0, 3.0], [1, 5, 9], [10, 10, 10]),
        "stability": tdint.stability("hht", np.geomspace(0.01, 1.0, 20)),
        "overshoot": tdint.overshoot("hht"),
        "order": tdint.order("hht"),
        "failures": tdint.failures("hht", ["large-step"]),
    }


LAYOUTS = ("run", "runs", "law", "target displacements", "spectrum", "sensitivity", "fragility",
           "stability", "order", "failures")  # fmt: skip
"""Results with different arrangements of panels."""
NARROW = ("order", "stability", "spectrum")
ON_AXES = {
    "record", "run", "peaks", "runs", "modes", "law", "pushover", "spectrum", "scale",
    "fragility", "stability",
}  # fmt: skip


@pytest.mark.usefixtures("laid_out")
@pytest.mark.long
def test_each_result_is_drawn(results):
    """The panels can be laid out. Another test lays out the figures in NARROW; the panels of two
    results are also in the figures of other results."""
    for name, result in results.items():
        figure = tdint.plot(result)
        assert isinstance(figure, Figure) and any(axes.has_data() for axes in figure.axes), name
        if name not in (*NARROW, "peaks", "pushover"):
            figure.draw_without_rendering()


@pytest.mark.long
def test_the_main_panel_is_drawn_on_axes_of_the_caller(results):
    for name, result in results.items():
        axes = Figure().subplots()
        if name not in ON_AXES:
            with pytest.raises(UsageError, match="no main panel"):
                tdint.plot(result, ax=axes)
            continue
        assert tdint.plot(result, axes) is axes
        assert axes.has_data() and axes.get_xlabel() and axes.get_ylabel(), name


@pytest.mark.long
def test_drawn_values_equal_the_result(results):
    axes = Figure().subplots()
    spectrum = results["spectrum"]
    for _ in range(2):
        spectrum.plot(axes)
        np.testing.assert_allclose(
            axes.lines[-1].get_ydata() * STANDARD_GRAVITY, spectrum.psa, rtol=1e-12
        )
    assert axes.lines[0].get_color() != axes.lines[1].get_color() and axes.get_legend() is not None
    inches = Figure().subplots()
    results["law"].plot(ax=inches, units="kip,in,g")
    assert "(in)" in inches.get_xlabel() and "kip" in inches.get_ylabel()
    drift = results["law"].path.drift / 0.0254
    assert any(
        np.allclose(line.get_xdata(), drift)
        for line in inches.lines
        if len(line.get_xdata()) == drift.size
    )
    assert len(results["run"].plot().axes) > len(results["peaks"].plot().axes)
    assert len(tdint.plot([spectrum, spectrum]).axes[0].lines) == 2


def test_several_runs_have_a_row_for_each_scale_and_their_mean(results):
    """Runs without a result are counted in the title of the panel and are in no line."""
    runs = results["runs"]
    figure = runs.plot()
    assert len(figure.axes) == 6
    for row, scale in ((0, 0.5), (3, 1.0)):
        mean = np.mean(runs.stories.peak_drift_ratio[runs.scale == scale], axis=0)
        drawn = [line.get_xdata() for line in figure.axes[row].lines if line.get_label() == "mean"]
        np.testing.assert_allclose(np.unique(drawn[0]), np.unique(100.0 * mean), rtol=1e-12)
    labels = {line.get_label() for line in figure.axes[0].lines}
    assert "one run" in labels
    with_failed_run = tdint.run_many(
        MODEL, results["record"], vary={"damping": [0.05, 2.0]}, errors="keep"
    ).plot()
    assert with_failed_run.axes[0].get_title("left").endswith("1 of 2 motions (array)")


def test_derivatives_have_a_panel_with_errors_for_each_parameter(results):
    gradient = results["gradient"]
    figure = gradient.plot()
    assert len(figure.axes) == 2
    for axes, values, name in zip(
        figure.axes, gradient.peak_drift, gradient.parameters, strict=True
    ):
        assert [bar.get_width() for bar in axes.patches] == values.tolist()
        assert name in axes.get_xlabel()
    ends = figure.axes[1].collections[0].get_segments()[0][:, 0]
    assert np.ptp(ends) == pytest.approx(2.0 * gradient.errors.peak_drift[1, 0])
    with pytest.raises(UsageError, match="units cannot be selected"):
        gradient.plot(units="kip,in,g")
    many = tdint.run_many(MODEL, results["record"], gradient="damping").gradient
    with pytest.raises(UsageError, match="select_run"):
        many.plot()


def lines_of(results):
    """Yield (result, panel, line) with the expected x and y values, in the units of the figure."""
    record, run, law, pushed = (results[name] for name in ("record", "run", "law", "pushover"))
    targets, rates, sharing = (
        results["target displacements"],
        results["drifts"],
        results["overshoot"],
    )
    history, peaks, curve = run.history, run.stories, results["stability"]
    time, g = np.arange(record.acceleration.size) * record.dt, STANDARD_GRAVITY
    yield (("record", 0, 0), time, record.acceleration / g)
    yield (("run", 0, 0), time, record.acceleration / g)
    roof = history.displacement[:, -1]
    yield (("run", 1, 0), history.time, roof)
    at = np.argmax(np.abs(roof))
    yield (("run", 1, 1), [history.time[at]], [roof[at]])
    yield (("run", 2, 0), history.time, run.energy.initial + history.energy.input)
    yield (
        ("run", 4, 0),
        np.array([record.pga, *peaks.peak_absolute_acceleration]) / g,
        [0.5, 1.5, 2.5],
    )
    yield (("run", 6, 0), history.drift[:, 0], history.shear[:, 0])
    for mode, shape in enumerate(results["modes"].normalized("roof").T, start=1):
        yield (("modes", 0, mode), [0.0, *shape], [0, 1, 2])
    yield (("law", 0, 2), law.path.drift, law.path.shear)
    for line, energy in enumerate((law.path.hysteretic_energy, law.path.strain_energy)):
        yield (("law", 1, line), np.linspace(0.0, 1.0, energy.size), energy)
    yield (("pushover", 0, 1), pushed.roof_displacement, pushed.applied_force)
    yield (("pushover", 0, 2), [pushed.roof_at_largest], [pushed.largest_applied_force])
    for line, made in zip((3, 5), targets, strict=True):
        ends = [made.yield_force if made.method == "n2" else made.applied_force]
        corners = [0.0, made.yield_displacement, made.roof_displacement]
        yield (("target displacements", 0, line), corners, [0.0, made.yield_force, *ends])
        yield (
            ("target displacements", 0, line + 1),
            [made.roof_displacement],
            [made.applied_force],
        )
    n2 = targets[0]
    inverse_participation = 1.0 / n2.participation
    shown = slice(np.argmax(n2.target.sd) + 1)
    yield (("target displacements", 1, 0), n2.target.sd[shown], n2.target.psa[shown] / g)
    yield (
        ("target displacements", 1, 2),
        pushed.roof_displacement * inverse_participation,
        pushed.applied_force * inverse_participation / n2.mass / g,
    )
    sd = n2.spectral_acceleration * (n2.period / (2.0 * np.pi)) ** 2
    yield (("target displacements", 1, 4), [0.0, sd], [0.0, n2.spectral_acceleration / g])
    reached, capacity = (
        n2.roof_displacement * inverse_participation,
        n2.yield_force * inverse_participation / n2.mass / g,
    )
    yield (
        ("target displacements", 1, 3),
        [0.0, n2.yield_displacement * inverse_participation, reached],
        [0.0, capacity, capacity],
    )
    yield (("target displacements", 1, 5), [reached], [capacity])
    yield (("spectrum", 1, 0), PERIODS, results["spectrum"].sd)
    yield (("drifts", 0, 0), PERIODS, 100.0 * rates.peak_drift_ratio)
    yield (("drifts", 1, 0), PERIODS, 100.0 * rates.roof_drift_ratio)
    yield (("fragility", 0, 3), [1.0, 2.0, 3.0], [0.1, 0.5, 0.9])
    near = curve.dt_over_t <= 0.4
    for panel, values in (
        (1, curve.amplitude_decay),
        (2, curve.period_error),
        (3, curve.numerical_damping),
    ):
        yield (("stability", panel, 0), curve.dt_over_t[near], 100.0 * values[near])
    yield (("stability", 0, 0), curve.dt_over_t, curve.spectral_radius)
    yield (("overshoot", 0, 0), np.arange(11), sharing.displacement)
    yield (("overshoot", 1, 0), np.arange(11), sharing.velocity)
    for line, name in enumerate(
        ("displacement", "velocity", "acceleration", "algorithmic_acceleration")
    ):
        yield (("order", 0, line), [results["order"].order(name)], [1.0])


@pytest.mark.long
def test_the_values_of_each_figure_equal_its_result(results):
    figures = {name: tdint.plot(result) for name, result in results.items()}
    for (name, panel, line), across, along in lines_of(results):
        drawn = figures[name].axes[panel].lines[line]
        np.testing.assert_allclose(
            np.ravel(drawn.get_xdata()), across, rtol=1e-9, atol=1e-12, err_msg=f"{name} {panel}"
        )
        np.testing.assert_allclose(
            np.ravel(drawn.get_ydata()), along, rtol=1e-9, atol=1e-12, err_msg=f"{name} {panel}"
        )
    run, pushed, record = results["run"].stories, results["pushover"], results["record"]
    for name, panel, rows in (
        (
            "run",
            3,
            (run.peak_drift / 0.03, run.peak_drift / 0.03, np.abs(run.residual_drift) / 0.03),
        ),
        ("run", 5, (run.peak_shear,) * 2),
        ("pushover", 1, (pushed.drift_at_largest / 0.03, pushed.drift[-1] / 0.03)),
        (
            "target displacements",
            2,
            [made.drift / 0.03 for made in results["target displacements"]],
        ),
    ):
        for stairs, values in zip(figures[name].axes[panel].patches, rows, strict=True):
            np.testing.assert_allclose(stairs.get_data().values, values, rtol=1e-9)
            assert stairs.get_data().edges.tolist() == [0.5, 1.5, 2.5]
    periods = 2.0 * np.pi / results["modes"].omega
    named = [line.get_label() for line in figures["modes"].axes[0].lines[1:]]
    assert named == [f"mode {i}, {period:.4g} s" for i, period in enumerate(periods, start=1)]
    # The sum of the energy layers equals the input energy.
    top = figures["run"].axes[2].collections[-1].get_paths()[0].vertices[:, 1].max()
    assert top == pytest.approx(figures["run"].axes[2].lines[0].get_ydata().max(), rel=1e-3)
    # The Husid curve is the integral of the squared acceleration, approximated by the sum.
    energy, (husid, marks) = np.cumsum(record.acceleration**2), figures["record"].axes[3].lines
    np.testing.assert_allclose(husid.get_ydata()[::30], 100.0 * energy[::30] / energy[-1], atol=1.5)
    assert marks.get_ydata() == pytest.approx([5.0, 75.0, 95.0])
    assert np.interp(marks.get_xdata(), *husid.get_data()) == pytest.approx(
        [5.0, 75.0, 95.0], abs=0.1
    )
    parameter_effects = {effect.quantity.name: effect for effect in results["sensitivity"]}
    names = (
        "peak_drift_ratio",
        "peak_absolute_acceleration",
        "peak_roof_displacement",
        "peak_base_shear",
    )
    for axes, effect in zip(
        figures["sensitivity"].axes, map(parameter_effects.get, names), strict=True
    ):
        scale = {"1": 100.0, "m/s^2": 1.0 / 9.80665}.get(effect.quantity.unit, 1.0)
        for bar, value in zip(axes.patches, (effect.at_low, effect.at_high), strict=True):
            assert [bar.get_x(), bar.get_x() + bar.get_width()] == pytest.approx(
                [effect.as_it_is * scale, value * scale]
            )
    curve, fitted = figures["fragility"].axes[0].lines[2], results["fragility"]
    np.testing.assert_allclose(
        curve.get_ydata(), ndtr(np.log(curve.get_xdata() / fitted.theta) / fitted.beta), rtol=1e-9
    )


@pytest.mark.long
def test_print_options(results, tmp_path):
    file = tmp_path / "a.pdf"
    figure = tdint.plot(results["modes"], file=file, width=0.09, title=False)
    assert figure.get_size_inches()[0] * 25.4 == pytest.approx(90.0)
    assert figure.get_suptitle() == "" and b"/FontFile2" in file.read_bytes()
    once_more = tdint.plot(results["modes"])
    assert once_more.get_size_inches()[0] * 25.4 > 120.0  # The options apply to a single figure.


def test_results_without_a_figure_are_refused(results, tmp_path):
    with pytest.raises(UsageError, match="Record and Spectrum"):
        tdint.plot([results["record"], results["spectrum"]])
    with pytest.raises(UsageError, match=r"Response.* got \d+"):
        tdint.plot([results["run"], results["run"]])
    with pytest.raises(UsageError, match="no figure is available"):
        tdint.methods().plot()
    with pytest.raises(UsageError, match="cannot be used with ax"):
        tdint.plot(results["run"], ax=Figure().subplots(), width=0.09)
    with pytest.raises(OutputError, match=r"written as \.png, \.pdf or \.svg"):
        tdint.plot(results["run"], file=tmp_path / "a.jpg")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.usefixtures("laid_out")
@pytest.mark.parametrize("name", every(3, NARROW))
def test_no_legend_is_wider_than_the_page(results, name):
    """A page of 90 mm is too narrow for four entries of the legend in a row."""
    several = [results[name], results[name]]
    figure = tdint.plot(several, width=0.09, title=False)  # `plot` lays out the figure.
    for legend in figure.legends:
        box = legend.get_window_extent()
        assert box.x0 >= 0.0 and box.x1 <= figure.bbox.x1


@pytest.mark.usefixtures("laid_out")
@pytest.mark.parametrize("width", [None, 0.09, 0.18])
@pytest.mark.parametrize("name", LAYOUTS)
def test_layout_at_each_width(results, name, width):
    """A reader sees all lines and texts, and distinguishes lines in gray."""
    figure = tdint.plot(results[name], width=width)
    assert figure_rules.findings(figure, printed=width is not None) == []


def test_the_inelastic_demand_meets_the_target(results):
    """At the period T*, the reduced demand is the yield acceleration of the oscillator, and its
    displacement is the target displacement (annex B of EN 1998-1)."""
    n2 = results["target displacements"][0]
    assert n2.strength_ratio > 1.0
    demand = tdint.plot(results["target displacements"]).axes[1].lines[1]
    periods = n2.target.periods[: len(demand.get_xdata())]
    at_period = [np.interp(n2.period, periods, values) for values in demand.get_data()]
    expected = (
        n2.roof_displacement / n2.participation,
        n2.yield_force / n2.participation / n2.mass / STANDARD_GRAVITY,
    )
    assert at_period == pytest.approx(expected, rel=5e-3)


def test_loops_of_all_stories_are_drawn(results):
    """The loop of the story is in front of the loops of all other stories."""
    run = results["run"]
    first, *others = (line for line in tdint.plot(run).axes[6].lines if len(line.get_xdata()) > 2)
    np.testing.assert_allclose(first.get_xdata(), run.history.drift[:, 0])
    np.testing.assert_allclose([line.get_xdata() for line in others], run.history.drift.T[1:])
    assert all(line.get_zorder() < first.get_zorder() for line in others)


def test_a_linear_run_has_no_loop(results):
    """The loop of a linear law is a straight line."""
    story = {"mass": 10.0, "height": 3.0, "stiffness": 8000.0}
    run = tdint.run({"stories": [story]}, results["record"], history=True)
    assert len(tdint.plot(run).axes) == len(tdint.plot(results["run"]).axes) - 1
