"""Rules for laid-out figures: what a reader of a page cannot see or cannot distinguish.

The boxes of matplotlib decide, not the pixels, so that the rules hold for each format. Tests of
layouts (tests/output/test_plotting.py) and of commands (tests/output/test_figure_commands.py) use
them.
"""

from collections.abc import Iterator
from itertools import combinations, pairwise
from typing import Any

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.colors import to_hex, to_rgb
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import StepPatch

MIN_FONT, MIN_PANEL, MAX_PAGE = 6.0, 22.0, 240.0  # points, mm, mm
MIN_LIGHTNESS = 20.0  # difference of two lines with equal dashes and markers in gray, CIELAB L*
_MM = 25.4 / 100.0  # mm per pixel at the resolution of the check


def findings(figure: Figure, *, printed: bool) -> list[str]:
    """Return the broken rules of a figure; `printed` adds the rules of a page."""
    figure.dpi = 100
    FigureCanvasAgg(figure)
    for _ in range(2):  # as for a file: ticks depend on the sizes of the panels, and vice versa
        figure.draw_without_rendering()
    found = [*_texts(figure), *(text for panel in panels_of(figure) for text in _panel(panel))]
    height = 25.4 * figure.get_figheight()
    if printed and height > MAX_PAGE + 0.1:
        found.append(f"the figure is {height:.0f} mm high")
    return list(dict.fromkeys(found))


def panels_of(figure: Figure) -> list[Any]:
    return [
        panel for axes in figure.axes if axes.get_visible() for panel in (axes, *axes.child_axes)
    ]


def _shown_texts(figure: Figure) -> list[Any]:
    """Return the visible texts of a figure, with the labels of drawn ticks only."""
    texts = [*figure.texts]
    for panel in panels_of(figure):
        for axis in (panel.xaxis, panel.yaxis) if panel.axison else ():
            texts += [axis.label]
            texts += [
                label for tick in axis._update_ticks() for label in (tick.label1, tick.label2)
            ]
        texts += [*panel.texts, panel.title, panel._left_title, panel._right_title]
    for legend in [*figure.legends, *filter(None, (p.get_legend() for p in panels_of(figure)))]:
        texts += [*legend.get_texts(), legend.get_title()]
    return [text for text in texts if text.get_visible() and text.get_text().strip()]


def _texts(figure: Figure) -> Iterator[str]:
    """Yield texts that are cut off, too small, or over another text."""
    page, boxes = figure.bbox, []
    for text in _shown_texts(figure):
        box, name = text.get_window_extent(), repr(text.get_text().replace("\n", " ")[:40])
        if box.x0 < -1 or box.x1 > page.x1 + 1 or box.y0 < -1 or box.y1 > page.y1 + 1:
            yield f"{name} is cut off"
        if text.get_fontsize() < MIN_FONT - 1e-6:
            yield f"{name} has {text.get_fontsize():.1f} points"
        if text.get_rotation() % 90 == 0:
            boxes.append((name, box))
    for (one, a), (other, b) in combinations(boxes, 2):
        width, height = min(a.x1, b.x1) - max(a.x0, b.x0), min(a.y1, b.y1) - max(a.y0, b.y0)
        if width > 1 and height > 2:
            yield f"{one} overlaps {other}"


def _lines(panel: Any) -> list[Line2D]:
    """Return the lines of a panel, and the profiles over the stories as lines."""
    lines = [line for line in panel.lines if line.get_visible() and len(line.get_xdata())]
    for patch in panel.patches:
        if isinstance(patch, StepPatch) and not patch.get_fill():
            style = {"linestyle": patch.get_linestyle(), "linewidth": patch.get_linewidth()}
            line = Line2D(*patch.get_path().vertices.T, color=patch.get_edgecolor(), **style)
            line.set_label(patch.get_label())
            line.axes = panel
            line.set_transform(panel.transData)
            lines.append(line)
    return [line for line in lines if line.get_transform().contains_branch(panel.transData)]


def _points(line: Line2D) -> np.ndarray:
    """Return points of a line, pixels, at most two pixels apart; a marker is its center."""
    points = line.get_transform().transform(line.get_xydata())
    points = points[np.isfinite(points).all(axis=1)]
    if line.get_linestyle() in ("None", " ", "") or not 1 < len(points) < 20_000:
        return points
    parts = [points[:1]]
    for start, end in pairwise(points):
        count = int(min(np.hypot(*(end - start)) / 2, 2000)) + 1
        parts.append(start + (end - start) * np.linspace(0, 1, count + 1)[1:, None])
    return np.concatenate(parts)


def _count_inside(line: Line2D, box: Any) -> int:
    points = _points(line)
    inside = (points > [box.x0 + 2, box.y0 + 2]) & (points < [box.x1 - 2, box.y1 - 2])
    return int(inside.all(axis=1).sum())


def _panel(panel: Any) -> Iterator[str]:
    """Yield a legend over data, a panel that is too small, and lines that are equal in gray."""
    name, lines = panel.get_ylabel() or panel.get_xlabel(), _lines(panel)
    frame, legend = panel.get_window_extent(), panel.get_legend()
    if legend:
        box = legend.get_window_extent()
        if any(_count_inside(line, box) > 3 for line in lines):
            yield f"the legend covers a line of {name!r}"
        overlaps = box.y1 > frame.y0 + 1 and box.y0 < frame.y1 - 1
        if overlaps and box.x0 < frame.x0 - 1 and box.x1 > frame.x0 + 1:
            yield f"the legend is larger than {name!r}"
    is_own = panel in panel.figure.axes
    if is_own and panel.axison and min(frame.width, frame.height) * _MM < MIN_PANEL - 0.5:
        yield f"{name!r} is {frame.width * _MM:.0f} x {frame.height * _MM:.0f} mm"
    yield from _equal_in_gray(lines)


def _equal_in_gray(lines: list[Line2D]) -> Iterator[str]:
    """Yield pairs of lines with equal dashes and markers whose gray is too similar."""
    groups: dict[Any, set[str]] = {}
    for line in lines:
        has_line = line.get_linestyle() not in ("None", " ", "") and len(line.get_xdata()) > 2
        if has_line and (not line.get_label().startswith("_") or len(lines) <= 12):
            alpha = 1.0 if line.get_alpha() is None else line.get_alpha()
            color = to_hex(alpha * np.array(to_rgb(line.get_color())) + 1.0 - alpha)
            width = round(line.get_linewidth(), 1)
            key = str(line._dash_pattern), str(line.get_marker()), width
            groups.setdefault(key, set()).add(color)
    for colors in groups.values():
        for one, other in combinations(sorted(colors), 2):
            if abs(lightness(one) - lightness(other)) < MIN_LIGHTNESS:
                yield f"{one} and {other} are equal in gray"


def lightness(color: Any) -> float:
    """Return the lightness L* of a color (CIELAB), 0 to 100."""
    rgb = np.array(to_rgb(color))
    linear = np.where(rgb <= 0.04045, rgb / 12.92, ((rgb + 0.055) / 1.055) ** 2.4)
    luminance = float(linear @ [0.2126, 0.7152, 0.0722])
    return 116 * luminance ** (1 / 3) - 16 if luminance > 0.008856 else 903.3 * luminance
