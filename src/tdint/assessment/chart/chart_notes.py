"""Explanations below work-precision diagrams: band, circle, triangle, reference and times."""

from __future__ import annotations

import math
from collections.abc import Sequence
from textwrap import wrap
from typing import TYPE_CHECKING

from tdint.output.tables.methods import PEER
from tdint.system import CLOCKS, version_of_sources

if TYPE_CHECKING:
    from tdint.assessment.chart.work_precision import Chart, Peer, Point, Timing

BAND_RULE = "no other point is cheaper and more accurate"
NARROW_FOOT = 62  # number of 6 pt characters in the width of a column
_FOOT = 100  # characters per line of the footnote


def short_footnote(chart: Chart, target: str, has_circles: bool, has_triangles: bool) -> str:
    """Return the short explanation of a work-precision diagram for one column of a page.

    It states the meaning of band, circle and triangle in at most three lines. In contrast to
    `footnote`, it omits the reference of the errors and the conditions of the time measurements,
    for lack of space. The command prints both on the terminal.

    Parameters
    ----------
    has_circles, has_triangles : bool
        True if the diagram contains circles (triangles).
    """
    interval = "sampling interval" if chart.recorded else "time step of the model"
    text = f"band: {BAND_RULE}"
    if has_circles:
        text += f"; circle: {interval}, {chart.interval:.4g} s"
    if has_triangles:
        gap = f"{chart.reference.gap.of(target):.1e}"
        text += f"; triangle: error below {gap}, the uncertainty of the reference"
    return "\n".join(wrap(text, NARROW_FOOT))


def footnote(
    chart: Chart, target: str, points: Sequence[Point], mark: str, has_triangles: bool
) -> str:
    """Return the explanation below a work-precision diagram: meaning of circle and triangle,
    reference of the errors, and conditions of the times.

    Parameters
    ----------
    mark : str
        Symbol of the sampling interval in the diagram; empty if no point has this time step.
    """
    reference = chart.reference
    gap = reference.gap.of(target)
    interval = "sampling interval of the record" if chart.recorded else "time step of the model"
    # The time step of a point is nan for a run with a tolerance (--tolerance) and for other
    # programs; the names of their lines contain a slash (PEER). The note is for runs with a
    # tolerance only.
    tolerance_note = ""
    if any(math.isnan(point.dt) and PEER not in point.line for point in points):
        tolerance_note = "; by tolerance: of the whole run"
    triangle = "; triangle: smaller error" if has_triangles else ""
    mark_text = f"{mark}: {interval}, {chart.interval:.4g} s; " if mark else ""
    return "\n".join(
        wrap(
            f"{mark_text}reference: {reference.method}, dt {reference.dt:.3g} s; difference from "
            f"{reference.confirmed_by}: {gap:.1e}{triangle}; times: "
            f"{conditions(chart.timing)}{tolerance_note}; {programs(chart.peers)}",
            _FOOT,
        )
    )


def conditions(timing: Timing) -> str:
    """Return the conditions of times: clock, number of repetitions, load, processor."""
    return f"{CLOCKS[timing.clock]}, {timing.description}, {timing.processor}"


def programs(peers: Sequence[Peer]) -> str:
    """Return the versions of tdint and of the other programs of a chart."""
    versions = (f"{peer.name} {peer.version}" for peer in peers)
    return ", ".join([f"tdint {version_of_sources()[0]}", *versions])
