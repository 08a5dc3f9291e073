"""Texts beside the points of a figure, as many as have room."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

_SIZE = 6.5  # points
_WIDTH = 0.6  # of a character, over its height
_MARK = 3.5  # half the size of a marker, points
_PLACES = ((8, 0, "left", "center"), (0, 7, "center", "bottom"), (0, -7, "center", "top"), (-8, 0, "right", "center"))
_PART = {"left": 0.0, "center": 0.5, "right": 1.0, "bottom": 0.0, "top": 1.0}

Box = tuple[float, float, float, float]


def write_labels(
    figure: Any, axes: Any, labels: Iterable[tuple[float, float, str]], marks: Sequence[tuple[float, float]]
) -> None:
    """Write each label (x, y, text) beside its point, the first ones first, where it covers no mark and no other label.

    Labels that find no room are left out. Call this when everything else of the figure is in its place.

    Parameters
    ----------
    marks : sequence of (x, y)
        Points that no label may cover.
    """
    figure.draw_without_rendering()
    unit = figure.dpi / 72.0
    frame = axes.get_window_extent()
    taken: list[Box] = []
    if len(marks):
        half = _MARK * unit
        taken = [(x - half, y - half, x + half, y + half) for x, y in axes.transData.transform(marks)]
    for x, y, text in labels:
        across, along = axes.transData.transform((x, y))
        for dx, dy, horizontal, vertical in _PLACES:
            width, height = _WIDTH * _SIZE * unit * len(text), _SIZE * unit
            left = across + dx * unit - _PART[horizontal] * width
            low = along + dy * unit - _PART[vertical] * height
            box = (left, low, left + width, low + height)
            inside = frame.x0 < left and box[2] < frame.x1 and frame.y0 < low and box[3] < frame.y1
            if inside and not any(_overlap(box, other) for other in taken):
                taken.append(box)
                axes.annotate(
                    text, (x, y), xytext=(dx, dy), textcoords="offset points", ha=horizontal, va=vertical,
                    fontsize=_SIZE, color="0.25",
                )  # fmt: skip
                break


def _overlap(a: Box, b: Box) -> bool:
    return a[0] < b[2] and b[0] < a[2] and a[1] < b[3] and b[1] < a[3]
