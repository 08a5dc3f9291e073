"""Figures in every format and for every type of result, with names that matplotlib could interpret
as commands."""

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from matplotlib.figure import Figure
from matplotlib.text import Text

from selection import every
from tdint.assessment.order.order import order
from tdint.assessment.stability.stability import stability
from tdint.assessment.stability.stability_figures import order_picture, stability_picture
from tdint.errors import OutputError
from tdint.files import write_files
from tdint.ground_motion.horizontals import Horizontals
from tdint.ground_motion.processing_steps import process
from tdint.ground_motion.record import Record
from tdint.model.config.model_file import load_model
from tdint.output.figures.loads import load_picture
from tdint.output.figures.runs import loop_story, plan_picture, run_picture
from tdint.output.figures.spectrum_curves import (
    difference_picture,
    draw_adrs,
    draw_tripartite,
    drift_spectrum_picture,
    inelastic_picture,
    low_picture,
    spectrum_picture,
)
from tdint.output.figures.style import add_legends, changed, picture, titled
from tdint.output.report import _pushover_parts
from tdint.response.pairs import COLLAPSED, COMPLETED, Run, with_outcomes
from tdint.response.runs.history import ErrorHistory
from tdint.response.runs.outcome import STORY_QUANTITIES
from tdint.response.runs.run import run
from tdint.response.spectra.drift import HeightPeriod, drift_spectrum
from tdint.response.spectra.elastic import spectrum
from tdint.response.spectra.inelastic import constant_strength
from tdint.response.spectra.target import SpectrumDifference
from tdint.studies.campaign.story_profiles import FloorSuite, Profile
from tdint.studies.campaign.suite_figures import floor_suite_picture, profile_picture, ratio_picture
from tdint.studies.sensitivity.sensitivity import PEAKS, ParameterEffect
from tdint.studies.sensitivity.sensitivity_figures import sensitivity_picture
from tdint.units import parse_output_units

pytestmark = pytest.mark.usefixtures("not_laid_out")

CONFIGS = Path(__file__).parents[2] / "configs"
STARTS = {".png": b"\x89PNG", ".pdf": b"%PDF", ".svg": b"<?xml"}


def motion(component="HNE", source="a.mseed", size=400) -> Record:
    t = np.arange(size) * 0.01
    return Record(
        3.0 * np.sin(9.0 * t) * np.exp(-t), 0.01, "", f"N.S..{component}", component, source
    )


def draw_run(response, file):
    write_files({file: picture(file.suffix, lambda: run_picture(response))}, overwrite=False)


def draw_spectra(spectra, file):
    write_files({file: picture(file.suffix, lambda: spectrum_picture(spectra))}, overwrite=False)


def figure_texts(figure):
    """Return all texts of a figure with its legends, one per line."""
    add_legends(figure)
    return "\n".join(text.get_text() for text in figure.findobj(Text))


def rendered_texts(figure):
    """Return all texts of a rendered figure; rendering detects invalid texts."""
    figure.draw_without_rendering()
    return figure_texts(figure)


@pytest.fixture(scope="module")
def forced():
    return run(load_model(CONFIGS / "two-story-polynomial.yaml"), duration=2.0, history=True)


@pytest.fixture(scope="module")
def shaken():
    return run(load_model(CONFIGS / "ten-story-bilinear.yaml"), motion(), history=True)


def test_long_steps_show_all_samples_of_the_record_and_the_peaks_of_the_table():
    """The figure shows all samples of the record, including samples between the time steps. The
    peak of the roof is the value in the table."""
    record = replace(motion(), acceleration=np.random.default_rng(1).standard_normal(401))
    model = load_model(CONFIGS / "ten-story.yaml")
    long = run(model, record, dt=0.05, duration=4.0, history=True)
    ground, roof = run_picture(long).axes[:2]
    line = ground.get_lines()[0]
    assert np.max(np.abs(line.get_ydata())) == pytest.approx(record.pga / 9.80665)
    # The test is meaningful only if the time steps omit the peak of the record.
    assert np.max(np.abs(long.history.ground_acceleration)) < 0.99 * record.pga
    peak = long.stories.peak_displacement[-1]
    assert peak > 1.0005 * np.max(np.abs(long.history.displacement[:, -1]))
    # The text has the sign of the marked point.
    roof_motion = long.history.displacement[:, -1]
    peak = np.copysign(peak, roof_motion[np.argmax(np.abs(roof_motion))])
    assert f"peak {peak:.3g} m" in {text.get_text().partition(" at ")[0] for text in roof.texts}
    assert line.get_xdata()[-1] == pytest.approx(4.0)
    part = run(model, record, dt=0.05, duration=1.0, history=True)
    assert run_picture(part).axes[0].get_lines()[0].get_xdata()[-1] == pytest.approx(1.0)


def profile_of_suite(building, stood, fell, height=3.0):
    """Return the profile of two stories under several ground motions, with some collapses."""
    outcome = np.repeat([COMPLETED, COLLAPSED], [stood, fell])
    peaks = {
        quantity.name: with_outcomes(np.full((len(outcome), 2), 0.03), outcome)
        for quantity in STORY_QUANTITIES
    }
    peaks["peak_drift_ratio"] = peaks["peak_drift"] / height
    named = tuple(f"{i}" for i in range(len(outcome)))
    runs = [Run(i, 1.0) for i in range(len(outcome))]
    level = (1.0, np.nan, runs, np.arange(len(outcome)), outcome, outcome, ("level", ""), "")
    return Profile(*level, building, named, np.full(2, height), peaks, {})


def test_ratios_of_profiles_are_lines_for_each_building():
    base, half = profile_of_suite("base", 4, 1), profile_of_suite("half", 5, 0)
    half = replace(half, peaks={name: 0.5 * values for name, values in half.peaks.items()})
    figure = ratio_picture([base, half], "base")
    assert len(figure.axes) == 3
    for axes in figure.axes:
        line, unit = axes.get_lines()
        assert line.get_label() == "half" and set(line.get_xdata()) == {0.5}
        assert set(unit.get_xdata()) == {1.0}
    (legend,) = figure.legends
    assert [text.get_text() for text in legend.get_texts()] == ["half"]


def loaded(record=None):
    """Run three stories under two equal forces and another force until 0.4 s, in kN."""
    table = {"points": [[0.1, 0], [0.1, 3], [0.2, 0]]}
    model = {
        "units": {"length": "m", "force": "kN", "mass": "t"},
        "stories": [{"repeat": 3, "mass": 1, "height": 3, "stiffness": 1000}],
        "excitation": {
            "forces": [
                {"floor": 1, **table},
                {"floor": 2, **table},
                {"floor": 3, "points": [[0, -1], [1, -1]]},
            ]
        },
    }
    return run(model, record, dt=0.01, duration=0.4, history=True)


@pytest.mark.parametrize("record", [None, motion()])
def test_figure_of_run_shows_forces_on_floors(record):
    """Forces are above the response, and below a ground motion; equal forces are one line."""
    axes = run_picture(loaded(record)).axes
    labels = [panel.get_ylabel().split(maxsplit=1)[0] for panel in axes[: 3 if record else 2]]
    assert labels == [*(["ground"] if record else []), "force", "roof"]
    panel = axes[1 if record else 0]
    assert panel.get_ylabel() == "force (kN)" and panel.get_xlim() == (0.0, 0.4)
    lines = {line.get_label(): line.get_xydata().tolist() for line in panel.get_lines()}
    assert list(lines) == ["floor 3", "floors 1, 2"]
    assert lines["floors 1, 2"] == [
        [0.0, 0.0], [0.1, 0.0], [0.1, 0.0], [0.1, 3.0], [0.2, 0.0], [0.2, 0.0], [0.4, 0.0]
    ]  # fmt: skip
    # The force on floor 3 jumps at 0 s, and ends after the run.
    assert lines["floor 3"] == [[0, 0], [0, 0], [0, -1], [1, -1], [1, 0], [1, 0]]


def test_only_the_time_of_a_short_pulse_is_drawn():
    """A force of 0.05 s and a ground motion of 0.05 s in a run of 10 s have time axes of their own;
    a force that acts longer has the axis of the response."""
    pulse = np.where((np.arange(1000) >= 300) & (np.arange(1000) < 305), 1.0, 0.0)
    points = {"points": [[5, 0], [5.02, 3000], [5.05, 0]]}
    model = {
        "stories": [{"mass": 1e3, "height": 3, "stiffness": 1e6}],
        "excitation": {"forces": [{"floor": 1, **points}]},
    }
    record = Record(pulse, 0.01, "a.csv", "", "", "")
    response = run(model, record, dt=0.01, duration=10.0, history=True)
    ground, force, roof = (panel.get_xlim() for panel in run_picture(response).axes[:3])
    assert 2.9 < ground[0] < 3.0 < 3.05 < ground[1] < 3.1
    assert force == pytest.approx((4.9875, 5.0625)) and roof[0] < 4.9 and roof[1] == 10.0
    assert load_picture(response.model, 10.0).axes[0].get_xlim() == force
    assert load_picture(response.model, 5.04).axes[0].get_xlim() == (0.0, 5.04)


def yielding(quiet):
    """Return the run of a yielding story under a pulse that starts after a quiet time, s."""
    pulse = np.where(np.arange(200) < 100, 6.0 * np.sin(np.linspace(0.0, 12.0, 200)), 0.0)
    values = np.concatenate([np.zeros(int(quiet / 0.01)), pulse])
    record = replace(motion(), acceleration=values)
    model = {
        "name": "one story",
        "stories": [
            {"mass": 1e4, "stiffness": 4e6, "height": 3.0, "p_delta": False}
            | {"law": {"type": "bilinear", "yield_force": 2e4, "hardening": 0.05}}
        ],
        "damping": {"rayleigh": {"ratio": 0.05, "modes": [1]}},
        "analysis": {"method": "impulse4"},
    }
    return run(model, record, history=True, check=False)


def test_the_time_axis_covers_the_strong_motion_and_states_its_rule():
    """Peaks are written above the panels, where they cover no curve."""
    figure = run_picture(yielding(5.0))
    ground, roof, energies = figure.axes[:3]
    for axes in (ground, roof, energies):
        start, end = axes.get_xlim()
        assert 4.9 < start <= 5.01 and 6.0 < end <= 7.0
    assert energies.get_xlabel() == "time (s), strong motion only"
    notes = [text for axes in (ground, roof) for text in axes.texts if "peak" in text.get_text()]
    assert len(notes) == 2 and all(note.xy == (1.0, 1.0) for note in notes)
    # Without a long quiet part, the axis covers the run.
    figure = run_picture(yielding(0.0))
    assert figure.axes[1].get_xlim() == (0.0, pytest.approx(1.99, abs=0.02))
    assert figure.axes[2].get_xlabel() == "time (s)"


def test_the_base_shear_of_a_run_is_beside_the_pushover():
    """The first excursion of a run without viscous forces follows the curve of the pushover."""
    response = yielding(0.0)
    (picture,) = _pushover_parts(response, parse_output_units("kN,m"))
    axes = picture.draw().axes[0]
    assert axes.get_xlabel() == "roof drift ratio (%)" and axes.get_ylabel() == "base shear (kN)"
    drawn, curve = (line.get_xydata() for line in axes.lines[:2])
    peak = 100.0 * response.stories.peak_displacement[-1] / 3.0
    assert np.max(np.abs(drawn[:, 0])) == pytest.approx(peak, rel=1e-3)
    assert np.max(np.abs(curve[:, 0])) == pytest.approx(peak, rel=1e-5)
    # The ends of the run and of the pushover have the same sign and the same strength.
    end = drawn[np.argmax(np.abs(drawn[:, 0]))]
    assert np.sign(end[0]) == np.sign(curve[-1, 0])
    expected = 20.0 + 0.05 * 4e3 * (0.03 * peak - 20.0 / 4e3)
    assert abs(curve[-1, 1]) == pytest.approx(expected, rel=1e-6)
    # An elastic run, and a run without a history, have no figure.
    assert _pushover_parts(replace(response, history=None), parse_output_units("kN,m")) == ()


def test_spectra_of_a_set_have_their_mean():
    spectra = [
        spectrum(motion(source=f"{factor}").scaled(factor), np.geomspace(0.1, 2.0, 9))
        for factor in (1.0, 2.0, 6.0)
    ]
    axes = low_picture(spectra, periods=[("frame", 0.5)]).axes[0]
    (mean,) = (line for line in axes.lines if line.get_label() == "mean")
    factor = parse_output_units("g").of(1.0, "m/s^2")
    np.testing.assert_allclose(mean.get_ydata(), 3.0 * factor * spectra[0].psa, rtol=1e-9)
    assert any("T1" in str(line.get_label()) for line in axes.lines)


def test_a_building_with_collapses_only_does_not_determine_the_drift_unit():
    """Drifts of the other buildings remain in percent of the story height, or all drifts are
    lengths. The figure names the motions that it omits."""
    stood, fell, flat = (
        profile_of_suite("stood", 3, 1),
        profile_of_suite("fell", 0, 4),
        profile_of_suite("flat", 4, 0, height=np.nan),
    )
    drifts = profile_picture([stood, fell]).axes[0]
    assert (drifts.get_xlabel(), drifts.get_title("left")) == (
        "drift (% of height)",
        "collapsed or failed, not drawn: 1 of 4 motions of stood (3), 4 of 4 motions of fell "
        "(0, 1, 2 and 1 more)",
    )
    assert {line.get_xdata().max() for line in drifts.get_lines()} == {1.0}
    alone = profile_picture([fell]).axes[0].get_title("left")
    assert alone == "collapsed or failed, not drawn: 4 of 4 motions (0, 1, 2 and 1 more)"
    axes = profile_picture([stood, flat]).axes[0]
    assert axes.get_xlabel() == "drift (m)" and {
        line.get_xdata().max() for line in axes.get_lines()
    } == {0.03}


def test_the_panels_of_a_level_have_equal_heights():
    """In all panels, a floor is at the top of the story below it."""
    drifts, accelerations, shears = profile_picture([profile_of_suite("frame", 3, 0)]).axes
    assert drifts.get_ylim() == accelerations.get_ylim() == shears.get_ylim() == (0.5, 2.5)
    assert {tuple(line.get_ydata()) for line in drifts.lines} == {(0.5, 1.5, 1.5, 2.5), ()}
    assert {tuple(line.get_ydata()) for line in accelerations.lines} == {(1.5, 2.5), ()}


def test_a_single_story_has_its_number_only():
    """The axis of a one-story building shows no fractions of a story."""
    profile = profile_of_suite("frame", 3, 0)
    low = replace(
        profile,
        height=profile.height[:1],
        peaks={name: values[:, :1] for name, values in profile.peaks.items()},
    )
    panel = profile_picture([low]).axes[0]
    bottom, top = panel.get_ylim()
    assert [tick for tick in panel.get_yticks() if bottom <= tick <= top] == [1.0]


def test_all_stories_are_drawn_in_both_directions():
    """The axis begins and ends half a story beyond the first and the last story."""
    one = {"mass": 2e5, "x": {"stiffness": 1.2e8}, "y": {"stiffness": 8e7}}
    pair = Horizontals(motion("HNE"), motion("HNN"))
    figure = plan_picture(run(load_model({"stories": [one, one]}), pair, history=True))
    (panel,) = (axes for axes in figure.axes if axes.get_ylabel() == "story")
    assert panel.get_ylim() == (0.5, 2.5) and len(panel.patches) == 3


def test_the_shorter_bar_of_a_tornado_is_in_front():
    """If both values of a parameter change a peak in the same direction, the shorter bar is in
    front."""
    peaks = {quantity.name: quantity for quantity in PEAKS}
    parameter_effects = [
        ParameterEffect("frame", "strength_factor", peaks[name], 0.8, 1.2, *peak)
        for name in (
            "peak_drift_ratio",
            "peak_absolute_acceleration",
            "peak_roof_displacement",
            "peak_base_shear",
        )
        for peak in ((0.7, 1.0, 0.9), (0.9, 1.0, 0.7), (1.2, 1.0, 0.7), (np.nan, 1.0, 0.7))
    ]
    for axes in sensitivity_picture(parameter_effects).axes:
        for low, high in zip(axes.patches[::2], axes.patches[1::2], strict=True):
            if not np.isnan(low.get_width()):
                first, last = sorted((low, high), key=lambda bar: bar.get_zorder())
                assert abs(first.get_width()) >= abs(last.get_width())


def test_all_buildings_of_floors_are_in_the_legend():
    """The legend contains all buildings, also if they have different numbers of floors and some are
    not in the first panel."""
    runs, outcome = [Run(0, 1.0), Run(1, 1.0)], np.array([COMPLETED, COMPLETED])
    level = (1.0, np.nan, runs, np.arange(2), outcome, outcome, ("level", ""), "")
    floor_suite = FloorSuite(*level, "low", 2, 0.05, np.array([0.5, 1.0]), np.ones((2, 2)))
    (legend,) = floor_suite_picture(
        [floor_suite, replace(floor_suite, building="tall", floor=5)]
    ).legends
    names = {text.get_text().partition(",")[0] for text in legend.get_texts()}
    assert names == {"low", "tall"}


def test_the_band_of_growth_contains_the_limit_of_linear_acceleration():
    curves = stability(["gauss4", "newmark-linear"], dt_over_t=[0.1, 0.55])
    *_, zoom = stability_picture(curves, band=True).axes
    low, high = zoom.get_xlim()
    assert 3.0 < low < np.sqrt(12.0) < high < 4.0


def test_differences_of_spectra_have_a_line_at_zero():
    computed = spectrum(motion(), [0.2, 0.5])
    published = SimpleNamespace(quantity="psa", source="page.csv")
    compared = SpectrumDifference(computed, published, 0.98 * computed.psa)
    _, lower = difference_picture([compared]).axes
    levels = [tuple(line.get_ydata()) for line in lower.lines]
    assert (0.0, 0.0) in levels
    assert any(np.allclose(level, 100.0 * (1.0 / 0.98 - 1.0)) for level in levels)


@pytest.mark.usefixtures("laid_out")
def test_a_legend_of_long_names_is_within_its_figure():
    named = (
        "base-isolated five-story building",
        "five-story frame with fluid viscous dampers",
        "gap",
    )
    profiles = [profile_of_suite(name, 3, 0) for name in named]
    figure = picture(".png", lambda: profile_picture(profiles)).figure()
    figure.draw_without_rendering()
    (legend,) = figure.legends
    box = legend.get_window_extent()
    assert len(legend.get_texts()) == 6 and box.x0 > 0.0 and box.x1 < figure.bbox.width


def test_a_title_is_not_wider_than_its_figure():
    """A long title with record names is wrapped and remains complete."""
    figure = Figure(figsize=(7.2, 3.0))
    content = (
        "Incremental dynamic analysis, RSN763_LOMAP_GIL337.AT2 337, moment4, 5 % damping of Sa"
    )
    titled(figure, f"imk\n{content}")
    assert figure.get_suptitle().split() == ["imk", *content.split()]
    figure.draw_without_rendering()
    box = figure._suptitle.get_window_extent()
    assert box.x0 > 0.0 and box.x1 < figure.bbox.width


@pytest.mark.parametrize(
    "suffix",
    every(2, [pytest.param(name, marks=[pytest.mark.long] * (name == ".pdf")) for name in STARTS]),
)
def test_formats(tmp_path, suffix):
    """Each file starts with the signature of its format. Equal results give equal files. No file is
    replaced without permission."""
    file, again = tmp_path / f"x{suffix}", tmp_path / f"again{suffix}"
    spectra = [spectrum(motion(), np.array([0.1, 1.0]))]
    for name in (file, again):
        draw_spectra(spectra, name)
        with pytest.raises(OutputError, match="the file exists"):
            draw_spectra(spectra, name)
    assert file.read_bytes().startswith(STARTS[suffix])
    assert file.read_bytes() == again.read_bytes()
    assert sorted(tmp_path.iterdir()) == sorted([file, again])


def test_profiles_of_a_run_without_history_are_drawn(forced):
    labels = [axes.get_xlabel() for axes in run_picture(replace(forced, history=None)).axes]
    assert len(labels) == 3 and "story shear" in labels[2]


@pytest.mark.long
def test_names_are_drawn_literally(tmp_path, forced):
    name = "_a $x_ 建物"
    draw_run(replace(forced, model=replace(forced.model, name=name)), tmp_path / "run.svg")
    spectra = [
        spectrum(motion(c, f"{name}.mseed"), np.geomspace(0.1, 1.0, 9)) for c in ("_E", "$N")
    ]
    draw_spectra(spectra, tmp_path / "spectrum.svg")
    for file, text in (("run.svg", name), ("spectrum.svg", "_E")):
        assert text in (tmp_path / file).read_text(encoding="utf-8")
    long = "two\nlines" + "x" * 300
    rendered_texts(run_picture(replace(forced, model=replace(forced.model, name=long))))


@pytest.mark.long
def test_motions_at_rest_are_drawn():
    still = replace(motion(), acceleration=np.zeros(50))
    assert "roof displacement" in rendered_texts(
        run_picture(run(load_model(CONFIGS / "ten-story.yaml"), still, history=True))
    )
    assert "period (s)" in rendered_texts(spectrum_picture([spectrum(still, np.array([1.0]))]))
    for axes in ("tripartite", "adrs"):
        rendered_texts(spectrum_picture([spectrum(still, np.array([0.5, 1.0]))], axes))


@pytest.mark.parametrize(
    ("choices", "method_text"),
    [
        ({}, "exact solution"),
        ({"interpolation": "band-limited"}, "exact solution, band-limited motion"),
        ({"maxima": "samples"}, "exact solution, maxima: samples"),
        ({"method": "newmark-average"}, "newmark-average"),
    ],
)
def test_a_spectrum_states_its_method_of_computation(choices, method_text):
    computed = spectrum(motion(), np.array([0.5, 1.0]), **choices)
    assert f"5 % damping, {method_text}" in figure_texts(spectrum_picture([computed])).split("\n")


@pytest.mark.parametrize(
    ("ratios", "axis", "title"),
    [
        ((0.5,), "observed order", ", frequency ratio 0.5"),
        ((0.5, 2.0), "ω₀ / ω, frequency of the load over natural frequency", ""),
    ],
)
def test_orders_are_drawn_over_several_frequency_ratios(ratios, axis, title):
    texts = figure_texts(
        order_picture([order("newmark-average", frequency_ratio=ratio) for ratio in ratios])
    ).split("\n")
    assert axis in texts
    assert f"Observed order: harmonic load, linear law{title}" in texts


def test_a_processed_record_is_labeled():
    plain = Record(np.ones(3), 0.01, "", "", "", "x.mseed")
    assert changed([plain]) == ""
    assert changed([plain, process(plain, baseline="constant")]) == " (processed)"


@pytest.mark.parametrize(
    ("axes", "count"),
    every(
        2,
        [("periods", 1), ("periods", 22), ("tripartite", 2), ("tripartite", 22), ("adrs", 2),
         ("adrs", 22)],
    ),
)  # fmt: skip
def test_axes_and_suites(axes, count):
    """The legend of a suite of 22 lines contains only the fractiles. The period 0 is not shown on a
    logarithmic axis."""
    periods = np.array([0.0, *np.geomspace(0.05, 2.0, 9)])
    motions = [motion(source=f"{i}.txt").scaled(1.0 + i) for i in range(count)]
    spectra = [spectrum(record, periods, ratio) for record in motions for ratio in (0.02, 0.05)]
    text = rendered_texts(spectrum_picture(spectra, axes))
    for named in (
        "median",
        *(("22 components", "median, 2 %", "16 % and 84 %, 5 %") if axes == "periods" else ()),
    ):
        assert (named in text) is (count == 22), named
    assert ("1.txt" in text) is (count == 2)


def test_vertical_components_of_a_suite_differ_from_the_others():
    """The median omits vertical components; their lines are dotted and have an entry."""
    motions = [motion(source=f"{i}.txt").scaled(1.0 + i) for i in range(7)]
    vertical = motion("HNZ", "0.txt")
    spectra = [spectrum(record, np.geomspace(0.05, 2.0, 9)) for record in (*motions, vertical)]
    figure = spectrum_picture(spectra)
    texts = [text.get_text() for text in figure.legends[0].get_texts()]
    assert texts[:3] == ["7 components", "1 vertical components", "median without verticals"]
    (dotted,) = (line for line in figure.axes[0].lines if line.get_linestyle() == ":")
    np.testing.assert_allclose(dotted.get_ydata(), spectra[-1].psa / 9.80665, rtol=1e-12)


def test_an_isolator_has_the_loop_of_its_building():
    """The ductility of an isolator is no measure of damage."""
    response = run(load_model(CONFIGS / "base-isolated.yaml"), motion(), history=True, check=False)
    assert loop_story(response)[1].startswith("isolator 0.1")


@pytest.mark.parametrize("units", every(3, ["m", "kip,in,g", "kip,ft,g", "kN,mm", "kN,cm,m/s^2"]))
def test_scales_of_a_spectrum_in_any_units(units):
    """psv = sd omega = psa / omega: labels of the diagonal scales are at the correct position and
    do not overlap; the same is tested for the rays of constant period."""
    shown = parse_output_units(units).in_figures
    spectra = [spectrum(motion(), np.geomspace(0.05, 10.0, 30))]
    axes = draw_tripartite(spectra, ["one"], shown).axes[0]
    seconds_in = {shown.label(si): shown.unit(si)[1] for si in ("m", "m/s^2")}
    assert len(axes.texts) >= 6
    for text in axes.texts:
        (period, speed), (value, unit) = text.get_position(), text.get_text().split(" ")
        omega = 2.0 * np.pi / period
        expected = (
            float(value) * seconds_in[unit] * (omega if unit == shown.label("m") else 1.0 / omega)
        )
        assert speed * shown.unit("m/s")[1] == pytest.approx(expected, rel=1e-9)
    positions = np.log([text.get_position() for text in axes.texts])
    extent = np.ptp(np.log([axes.get_xlim(), axes.get_ylim()]), axis=1)
    apart = np.abs(positions[:, None] - positions) / extent
    assert np.all(np.max(apart, axis=2) + np.eye(len(positions)) > 0.05)
    for ray in draw_adrs(spectra, ["one"], shown).axes[0].texts:
        end, height = ray.xy
        omega = 2.0 * np.pi / float(ray.get_text().removesuffix(" s"))
        assert height * shown.unit("m/s^2")[1] == pytest.approx(
            omega**2 * end * shown.unit("m")[1], rel=1e-9
        )


@pytest.mark.parametrize(
    ("units", "labels", "limit", "part"),
    every(
        3,
        [
            ("kip,in,g",
             ("ground (g)", "kip·in)", "story shear (kip)", "drift (in)", "acceleration (g)"), 1.0,
             0.02),
            ("kN,mm",
             ("ground (g)", "kN·m)", "story shear (kN)", "drift (mm)", "acceleration (g)"), 1.5,
             0.001),
            ("lbf,m/s^2", ("ground (m/s²)", "lbf·m)", "lbf)", "drift (m)", "acceleration (m/s²)"),
             1.0, np.nan),
        ],
    ),
)  # fmt: skip
def test_a_run_in_other_units(shaken, units, labels, limit, part):
    """Labels and peaks are in the requested units, with g as default for accelerations. A collapse
    drift close to the peak is marked. The error band of the roof is shown if it exceeds a
    hundredth of the maximum displacement and an error estimate exists."""
    history, chosen = shaken.history, parse_output_units(units)
    errors = (
        part * getattr(history, name) for name in ("displacement", "velocity", "drift", "shear")
    )
    near = replace(
        shaken.model, collapse_drift=limit * float(np.max(shaken.stories.peak_drift_ratio))
    )
    shown = replace(shaken, model=near, history=replace(history, error=ErrorHistory(*errors)))
    text = figure_texts(run_picture(shown, chosen))
    assert not [label for label in labels if label not in text]
    roof = history.displacement[:, -1]
    peak = roof[np.argmax(np.abs(roof))] / chosen.unit("m")[1]
    assert f"peak {peak:.3g} {chosen.unit('m')[0]} at " in text
    assert ("collapse drift" in text) is (limit == 1.0)
    assert ("estimated error" in text) is (part == 0.02)


@pytest.mark.parametrize(
    ("floors", "height"), [(1, None), (3, 3.0), pytest.param(60, None, marks=pytest.mark.long)]
)
def test_profiles_of_low_and_tall_buildings_with_an_isolator(floors, height):
    """The drift of isolators without a height is written as a length. If no story has a height, no
    story is shown separately, for any drift; a collapse is shown as a collapse."""
    upper = {"repeat": floors, "mass": 10, "stiffness": 40000} | (
        {"height": height} if height else {}
    )
    model = load_model({"stories": [{"mass": 10, "stiffness": 100}, upper]})
    response = run(model, motion(), method="newmark-average", history=True)
    shown = rendered_texts(run_picture(response))
    drift = f"{response.stories.peak_drift[0]:#.3g} m"
    assert (drift in shown.splitlines()) is bool(height)
    assert ("drift (% of height)" in shown) is bool(height)
    assert "absolute floor" in shown


@pytest.mark.long
def test_equal_heights_have_no_axis():
    """With a large exponent, the height hardly depends on the period, and no axis of heights is
    possible."""
    periods = np.array([0.5, 1.0, 2.0])
    for exponent, count in ((0.75, 1), (1e17, 0)):
        found = drift_spectrum(
            motion(), periods, 0.05, stories=2, height_period=HeightPeriod(0.0731, exponent)
        )
        assert rendered_texts(drift_spectrum_picture([found])).count("height (m)") == count


def test_every_column_of_ductilities_has_the_line_of_first_yield():
    records = motion(), motion("HNN")
    spectra = [
        spectrum
        for record in records
        for spectrum in constant_strength(record, np.array([0.5, 1.0, 2.0]), [0.1])
    ]
    figure = inelastic_picture(spectra)
    lines = [
        sum(np.array_equal(line.get_ydata(), [1.0, 1.0]) for line in axes.get_lines())
        for axes in figure.axes
    ]
    assert lines == [1, 1, 0, 0]
