"""Common elements of figures: labels of points, legends, units with a power of ten."""

from collections import Counter
from dataclasses import replace
from itertools import combinations

import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

import figure_rules
from tdint.assessment.chart.performance_profiles import METHODS
from tdint.ground_motion.horizontals import Horizontals
from tdint.ground_motion.record import Record
from tdint.methods.catalogue import catalogue
from tdint.output.figures.style import (
    add_legend,
    add_ratio_axis,
    line_style,
    method_styles,
    motion_name,
    new_axes,
    new_panels,
    picture,
    scaled_unit,
    write_labels,
)
from tdint.output.printed import PRINTED, PrintedAs
from tdint.units import SI, parse_output_units


def test_labels_are_next_to_their_points_without_overlap():
    """Labels overlap no marker and no other label, and are within the frame. The first labels have
    priority; some labels are omitted."""
    points = np.random.default_rng(3).uniform(size=(60, 2))
    figure = Figure(figsize=(5.0, 4.0))
    axes = figure.subplots()
    axes.plot(*points.T, "o", markersize=5.0)
    write_labels(figure, axes, [(x, y, f"p {i}") for i, (x, y) in enumerate(points)], points)
    figure.draw_without_rendering()
    unit, frame, boxes = (
        figure.dpi / 72.0,
        axes.get_window_extent(),
        [text.get_window_extent() for text in axes.texts],
    )
    assert 20 < len(boxes) < 60 and {"p 0", "p 1"} <= {text.get_text() for text in axes.texts}
    marks = axes.transData.transform(points)
    for i, (text, box) in enumerate(zip(axes.texts, boxes, strict=True)):
        assert (
            frame.x0 <= box.x0 and box.x1 <= frame.x1 and frame.y0 <= box.y0 and box.y1 <= frame.y1
        )
        assert not any(box.overlaps(other) for other in boxes[:i])
        assert not any(box.x0 < x < box.x1 and box.y0 < y < box.y1 for x, y in marks)
        x, y = axes.transData.transform(points[int(text.get_text()[2:])])
        distance = np.hypot(max(box.x0 - x, 0.0, x - box.x1), max(box.y0 - y, 0.0, y - box.y1))
        assert 3.5 * unit < distance < 12.0 * unit


@pytest.mark.parametrize(("width", "seed"), [(None, 18), (0.09, 4), (0.18, 18)])
def test_labels_do_not_overlap_in_the_final_layout(width, seed):
    """The legend is arranged after the labels are written, which moves points and labels."""
    points = np.random.default_rng(seed).uniform(size=(80, 2))

    def draw():
        figure, axes = new_axes(7.5, 5.6)
        lines = [axes.plot(*point, "o", color="0.5")[0] for point in points]
        add_legend(figure, lines[:12], [f"a line with the number {i}" for i in range(12)])
        write_labels(figure, axes, [(x, y, f"p {i}") for i, (x, y) in enumerate(points)], points)
        return figure

    token = PRINTED.set(PrintedAs(width))
    try:
        figure = picture(".png", draw).figure()
    finally:
        PRINTED.reset(token)
    figure.draw_without_rendering()
    labels = [text for text in figure.axes[0].texts if text.get_visible()]
    boxes = [text.get_window_extent() for text in labels]
    assert len(boxes) > 5
    assert not any(one.overlaps(other) for one, other in combinations(boxes, 2))


def with_legend(labels):
    """Return a figure with a line for each label and a legend below its panel."""
    figure = Figure(figsize=(7.5, 4.0), layout="constrained")
    axes = figure.subplots()
    lines = [axes.plot([0, 1], [i, i])[0] for i in range(len(labels))]
    add_legend(figure, lines, labels)
    return picture(".png", lambda: figure).figure()


def test_a_legend_lists_some_lines_and_counts_the_others():
    assert not with_legend(["alone"]).legends
    figure = with_legend([f"line {i}" for i in range(30)])
    named = [text.get_text().strip() for text in figure.legends[0].get_texts()]
    assert named == [*(f"line {i}" for i in range(23)), "... and 7 more"]


@pytest.mark.parametrize("size", [20, 60, 110, 300])
def test_a_legend_is_not_wider_than_its_figure(size):
    """The ends of long labels remain visible, because they distinguish the lines."""
    labels = [f"{'a_file_name ' * (size // 12)}, RotD{number}" for number in range(9)]
    figure = with_legend(labels)
    (legend,) = figure.legends
    extent = legend.get_window_extent(FigureCanvasAgg(figure).get_renderer())
    assert extent.width <= figure.bbox.width
    shown = [" ".join(text.get_text().split()) for text in legend.get_texts()]
    assert shown == [" ".join(label.split()) for label in labels]
    # The height of the figure increases by the height of the legend.
    assert figure.get_figheight() - 4.0 == pytest.approx(extent.height / figure.dpi, abs=0.5)


def test_a_legend_over_a_curve_stands_above_its_panel():
    t = np.linspace(0.0, 1.0, 500)
    for is_free in (False, True):
        figure = Figure(figsize=(4.0, 3.0), layout="constrained")
        axes = figure.subplots()
        axes.plot(t, np.sin(90.0 * t) * (0.1 if is_free else 1.0), label="motion")
        axes.set(ylim=(-1.1, 1.1))
        axes.legend(loc="upper right")
        shown = picture(".png", lambda figure=figure: figure).figure()
        shown.draw_without_rendering()
        box, frame = axes.get_legend().get_window_extent(), axes.get_window_extent()
        assert (box.y0 >= frame.y1) != is_free
        assert (shown.get_figheight() > 3.0) != is_free


@pytest.mark.parametrize(
    ("largest", "si", "units", "factor", "label"),
    [(0.5, "N", "", 1.0, "N"), (999.0, "J", "", 1.0, "J"), (1e3, "N", "", 1e-3, "kN"),
     (1e6, "J", "", 1e-6, "MJ"), (99e6, "N", "kN", 1e-3, "kN"), (1e8, "N", "kN", 1e-6, "10³ kN"),
     (3e11, "N", "kN", 1e-9, "10⁶ kN")],
)  # fmt: skip
def test_scaled_units_give_short_numbers(largest, si, units, factor, label):
    assert scaled_unit(largest, si, parse_output_units(units) if units else SI) == (
        pytest.approx(factor),
        label,
    )


def test_a_ratio_axis_is_at_the_top():
    axes = Figure().subplots()
    axes.set_xlim(0.0, 0.06)
    add_ratio_axis(axes, 3.0, "drift ratio (%)")
    (top,) = axes.child_axes
    assert top.get_xlabel() == "drift ratio (%)" and top._functions[0](0.06) == pytest.approx(2.0)
    assert top._functions[1](2.0) == pytest.approx(0.06)
    add_ratio_axis(axes, np.nan, "none")
    assert axes.child_axes == [top]


def test_each_method_has_a_unique_style_in_all_figures():
    """The style of a method does not depend on the other methods of a figure. Methods with
    parameters and other programs use the remaining styles."""
    lines = [*catalogue(), "wilson:theta=1.3", "impulse4:rho_inf=0", "openseespy/hht", "scipy/RK45"]
    plot_styles = method_styles(lines)
    assert len(
        {(plot_styles[line]["color"], plot_styles[line]["marker"]) for line in lines}
    ) == len(lines)
    assert all(method_styles([name])[name] == plot_styles[name] for name in catalogue())
    # There are twelve colors. Methods of the standard chart that share a color differ in dashes.
    shared = Counter(plot_styles[name]["color"] for name in METHODS)
    assert max(shared.values()) <= 2 and len(shared) >= 12
    pairs = {(plot_styles[name]["color"], str(plot_styles[name]["linestyle"])) for name in METHODS}
    assert len(pairs) == len(METHODS)


def test_name_of_a_motion_is_its_name_in_tables():
    """Figures of a channel of several stations showed its code only."""
    record = Record(np.ones(5), 0.01, "", "NZ.S1..HNE", "HNE", "in/a.mseed")
    assert motion_name(record) == "a.mseed HNE"
    record = replace(record, is_one_of_several=True)
    assert motion_name(record) == "a.mseed NZ.S1..HNE"
    other = replace(record, id="NZ.S1..HNN", component="HNN", acceleration=np.arange(5.0))
    assert motion_name(Horizontals(record, other)) == "a.mseed NZ.S1..HNE+NZ.S1..HNN"


def test_lines_with_equal_dashes_differ_in_gray():
    """The dashes of `line_style` repeat after five lines; the lightness of these lines differs by
    at least 20 L*."""
    styles = [line_style(number) for number in range(10)]
    for one, other in combinations(styles, 2):
        if one["linestyle"] == other["linestyle"]:
            gray, other_gray = (figure_rules.lightness(style["color"]) for style in (one, other))
            assert abs(gray - other_gray) >= figure_rules.MIN_LIGHTNESS


@pytest.mark.parametrize(("width", "columns"), [(None, 4), (0.18, 4), (0.09, 2), (0.05, 1)])
def test_a_panel_is_at_least_45_mm_wide(width, columns):
    """A row with more panels continues below; each printed panel is at least 22 mm high."""
    token = PRINTED.set(PrintedAs(width))
    try:
        grid = []

        def draw():
            figure, rows = new_panels(8.0, (1.2, (1,)), (1.5, (1,) * 4))
            grid.extend(rows[1])
            for axes in figure.axes:
                axes.set(xlabel="time (s)", ylabel="x (m)")
            return figure

        figure = picture(".png", draw).figure()
    finally:
        PRINTED.reset(token)
    assert {axes.get_subplotspec().get_gridspec().ncols for axes in grid} == {columns}
    if width:
        assert figure.get_figwidth() * 0.0254 == pytest.approx(width)
        assert min(axes.bbox.height for axes in figure.axes) / figure.dpi * 25.4 > 21.5
        assert figure.get_figheight() * 25.4 <= 240.1


def test_negative_numbers_have_a_minus_sign():
    """A hyphen in a name remains."""
    figure = Figure()
    axes = figure.subplots()
    axes.set(title="peak -0.3 m (-1 to 2), newmark-average -x", xscale="log")
    shown = picture(".png", lambda: figure).figure()
    (title,) = (panel.get_title() for panel in shown.axes)
    assert title == "peak \N{MINUS SIGN}0.3 m (\N{MINUS SIGN}1 to 2), newmark-average -x"
