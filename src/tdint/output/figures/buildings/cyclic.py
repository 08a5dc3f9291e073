"""Figure of a cyclic test: the loops of a story's drift law and their energy, readable in black and white."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from tdint.files import Writer
from tdint.output.figures.axes import add_ratio_axis
from tdint.output.figures.style import COLORS, DASHES, LIGHT, add_title, picture, scaled_unit
from tdint.output_units import SI, OutputUnits

if TYPE_CHECKING:
    from tdint.analysis.static.cyclic import CyclicTest


def cyclic_picture(test: CyclicTest, suffix: str, units: OutputUnits = SI) -> Writer:
    """Picture of a cyclic test: shear over drift, and the energies over the cycles.

    Return value and errors are those of `tdint.output.figures.style.picture`.

    Parameters
    ----------
    test : CyclicTest
        A result of `tdint.analysis.static.cyclic.cyclic_test`.
    """
    return picture(suffix, lambda: _draw(test, units))


def _draw(test: CyclicTest, units: OutputUnits) -> Figure:
    figure = Figure(figsize=(6.5, 7.6), layout="constrained")
    loop, energy = figure.subplots(2, 1, height_ratios=(2.6, 1.0))
    _draw_loop(loop, test, units)
    _draw_energy(energy, test, units)
    kind = "cyclic test" if test.points else "path of drifts"
    add_title(figure, f"{test.model.name}\nStory {test.story}, {test.law} law: {kind} without dashpots")
    return figure


def _draw_loop(axes: Any, test: CyclicTest, units: OutputUnits) -> None:
    factor, unit = scaled_unit(float(np.max(np.abs(test.path.shear))), "N", units)
    drift = units.of(test.path.drift, "m")
    axes.axhline(0.0, color=LIGHT, linewidth=0.6)
    axes.axvline(0.0, color=LIGHT, linewidth=0.6)
    axes.plot(drift, test.path.shear * factor, color=COLORS[0], label="restoring force of the law")
    if test.geometric_stiffness:
        # Not dashed: the dashes of one cycle would fill the gaps of another.
        force = test.shear_with_p_delta * factor
        axes.plot(drift, force, color=LIGHT, linewidth=0.9, zorder=1.9, label="with P-delta")
    _mark_yielding(axes, test, units)
    if len(axes.get_legend_handles_labels()[0]) > 1:
        axes.legend(loc="upper left")
    axes.set_xlabel(f"drift ({units.label('m')})")
    axes.set_ylabel(f"story shear ({unit})")
    axes.xaxis.set_major_locator(MaxNLocator(9, steps=[1, 2, 5, 10]))
    add_ratio_axis(axes, units.of(test.height, "m"), "drift ratio (%)")


def _mark_yielding(axes: Any, test: CyclicTest, units: OutputUnits) -> None:
    """Dotted lines at the drifts of first yield, where the test goes beyond them."""
    if not test.yield_drift < float(np.max(test.path.drift)):
        return
    for side in (1.0, -1.0):
        axes.axvline(
            side * units.of(test.yield_drift, "m"), color=LIGHT, linestyle=DASHES[2], linewidth=1.0,
            label=f"yield drift {units.of(test.yield_drift, 'm'):.3g} {units.label('m')}" if side > 0.0 else None,
        )  # fmt: skip


def _draw_energy(axes: Any, test: CyclicTest, units: OutputUnits) -> None:
    cycle = np.arange(test.path.drift.size) / (4.0 * test.points if test.points else 1.0)
    factor, unit = scaled_unit(float(np.max(test.path.recoverable + test.path.dissipated)), "J", units)
    axes.plot(cycle, test.path.dissipated * factor, color=COLORS[0], label="dissipated")
    axes.plot(cycle, test.path.recoverable * factor, color=COLORS[1], linestyle=DASHES[1], label="recoverable")
    axes.legend(loc="upper left")
    axes.set_xlim(0.0, max(cycle[-1], 1.0))
    axes.set_ylim(bottom=min(0.0, axes.get_ylim()[0]))
    axes.set_xlabel("cycle" if test.points else "step")
    axes.set_ylabel(f"energy ({unit})")
    axes.xaxis.set_major_locator(MaxNLocator(9, steps=[1, 2, 5, 10]))
