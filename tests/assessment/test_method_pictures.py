"""Figures of methods: highlighted methods, distinct colors that are equal in all figures, texts
without overlap."""

import itertools
import math
from contextlib import contextmanager
from dataclasses import replace

import pytest

from tdint.assessment.chart.chart_figures import _Drawing, chart_picture, profile_picture
from tdint.assessment.chart.performance_profiles import PARTS, Measured, PeakErrors, field_chart
from tdint.assessment.chart.problem import Errors, Reference
from tdint.assessment.chart.work_precision import Chart, Point, Timing
from tdint.assessment.failures.failure_figures import failure_picture
from tdint.assessment.failures.failures import Trial
from tdint.errors import UsageError
from tdint.methods import catalogue
from tdint.output.figures.style import picture
from tdint.output.printed import PRINTED, parse_style

LONG = [f"a-plug-in-with-a-rather-long-name-{name}" for name in ("one", "two", "three")]
OTHERS = ["hht", "bathe", "wilson"]
NAMES = ["impulse4", "newmark-average", "wilson:theta=1.3", "openseespy/hht", "scipy/RK45", *LONG]


def points(lines, errors):
    return tuple(
        Point(
            line, 0.01 * part, 100, "done", 100, errors(part), (1e-3 * (i + 1) / part,), line=line
        )
        for i, line in enumerate(lines)
        for part in PARTS
    )


def make_chart(lines):
    """Return the points of a single problem; the figure does not use the reference solution."""
    drawn = points(lines, lambda part: Errors(*5 * (1e-3 * part**2,)))
    reference = Reference("impulse4", 1e-4, "moment4", Errors(*5 * (1e-9,)), None)
    return Chart(3, 0.01, True, drawn, reference, drawn[0], Timing.of(drawn))


def make_profile(lines):
    drawn = points(lines, lambda part: PeakErrors(*3 * (1e-3 * part**2,)))
    return field_chart(
        [Measured("p", "m", "", 3, 0.01, 9.0, 4.0, 7, "", PeakErrors(*3 * (1e-9,)), drawn)]
    )


@pytest.fixture
def register_methods(monkeypatch):
    """Return a function that registers a method of a plug-in for each name."""

    def register(names):
        known = dict(catalogue.catalogue())
        known |= dict.fromkeys(names, known["hht"])
        monkeypatch.setattr(catalogue, "catalogue", lambda: known)

    return register


def line_styles(figure, lines):
    """Return color, marker, width and z-order of each line by its name in the legend."""
    (legend,) = figure.legends
    names = [text.get_text().strip() for text in legend.get_texts()]
    drawn = dict(zip(names, legend.get_lines(), strict=False))
    shown = [line for axes in figure.axes for line in axes.lines]
    return {
        name: (
            drawn[name].get_color(),
            drawn[name].get_marker(),
            drawn[name].get_linewidth(),
            max(line.get_zorder() for line in shown if line.get_color() == drawn[name].get_color()),
        )
        for name in lines
    }


def styles_in_figures(lines, highlight=""):
    chart, profile = make_chart(lines), make_profile(lines)
    figures = (
        chart_picture(chart, name="x", target="drift", highlight=highlight),
        chart_picture(chart, name="x", target="drift", versus="dt", highlight=highlight),
        profile_picture(profile, target="peak-drift", highlight=highlight),
    )
    return [line_styles(figure, lines) for figure in figures]


@pytest.mark.long
def test_a_method_has_the_same_distinct_style_in_all_figures(register_methods):
    register_methods(LONG)
    all_styles = styles_in_figures(NAMES)
    for drawn in all_styles:
        assert len({plot_style[:2] for plot_style in drawn.values()}) == len(NAMES)
        assert {name: plot_style[:2] for name, plot_style in drawn.items()} == {
            name: plot_style[:2] for name, plot_style in all_styles[0].items()
        }
    # The styles are equal in figures of other methods. Methods with parameters use free styles.
    subset = [name for name in NAMES if ":" not in name][1::2]
    for drawn in styles_in_figures(subset):
        assert all(drawn[name][:2] == all_styles[0][name][:2] for name in subset)


# ---- The matrix of failures


def trials(names):
    """Return trials with the maximum number of columns, all types of cells and the longest
    numbers."""
    cells = itertools.cycle(
        [("pass", 0.0591), ("loses energy", 1.23e-16), ("blows up", math.nan), ("rings", 1.9e11)]
    )
    columns = [(f"limit-sqrt-{i}", 2.44) for i in range(16)] + [
        ("overshoot-displacement", 62.83),
        ("x", 1.0),
    ]
    return [
        Trial(problem, name, dt, "done", verdict, "energy", time=1.0, steps=132, measure=measure)
        for problem, dt in columns
        for name, (verdict, measure) in zip(names, cells, strict=False)
    ]


@contextmanager
def printed(width):
    token = PRINTED.set(parse_style(f"{width}mm"))
    try:
        yield
    finally:
        PRINTED.reset(token)


def matrix(names, width):
    with printed(width):
        figure = picture(".png", lambda: failure_picture(trials(names))).figure()
        figure.draw_without_rendering()
    return figure


@pytest.mark.long
@pytest.mark.parametrize(
    ("names", "width", "panels"),
    [
        (["impulse4", *LONG], 90, 3),
        *(
            pytest.param(["impulse4", *names], width, 1, marks=pytest.mark.long)
            for names, width in ((OTHERS, 90), (LONG, 180), (OTHERS, 180))
        ),
    ],
)
def test_texts_of_the_matrix_do_not_overlap(names, width, panels):
    figure = matrix(names, width)
    assert len(figure.axes) == panels
    for axes in figure.axes:
        for labels in (axes.get_xticklabels(), axes.get_yticklabels()):
            boxes = [label.get_window_extent() for label in labels]
            # The bounding box of a label that is rotated by 60 degrees is larger than its text.
            if labels[0].get_rotation() != 60.0:
                assert not any(
                    first.overlaps(second) for first, second in itertools.pairwise(boxes)
                )
            assert all(figure.bbox.x0 <= box.x0 and box.x1 <= figure.bbox.x1 for box in boxes)
        for text in axes.texts:
            x, y = text.get_position()
            (x0, y0), (x1, y1) = (
                axes.transData.transform((x + side, y - side)) for side in (-0.5, 0.5)
            )
            box = text.get_window_extent()
            assert x0 <= box.x0 and box.x1 <= x1 and y0 <= box.y0 and box.y1 <= y1, text.get_text()


@pytest.mark.long
def test_a_matrix_without_room_reports_the_required_width():
    with pytest.raises(UsageError, match=r"require a width of at least (\d+) mm") as caught:
        matrix(["impulse4", *LONG], 50)
    least = int(str(caught.value).split(" mm")[0].split()[-1])
    assert len(matrix(["impulse4", *LONG], least).axes) == 3
    with pytest.raises(UsageError, match=f"require a width of at least {least} mm"):
        matrix(["impulse4", *LONG], least - 1)


def test_points_with_an_unknown_error_or_cost_are_not_drawn():
    chart = make_chart(NAMES[:2])
    without_time, failed = replace(chart.points[0], times=()), replace(chart.points[1], errors=None)
    drawing = _Drawing(replace(chart, points=(without_time, failed, *chart.points[2:])), "drift")
    assert drawing.points == list(chart.points[2:])
