"""HTML reports of --report for analyses of a building without a suite: pushover, response spectrum
analysis, natural modes, and comparison with recordings."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from tdint.arrays import Array
from tdint.ground_motion.record import Record
from tdint.model.building import assemble
from tdint.model.definition import Model
from tdint.number_parsing import number_text, pluralize
from tdint.output import figures
from tdint.output.page import Chapter, PageText, Part, Picture, page, page_units
from tdint.output.report import (
    MODEL_LIMITS,
    SPECTRUM_PERIODS,
    model_chapter,
    motion_chapter,
    simplifications,
)
from tdint.output.spectrum_text import spectrum_text
from tdint.output.tables import buildings, transfer
from tdint.output.tables.table import Table
from tdint.response.spectra.elastic import spectrum
from tdint.units import SI, OutputUnits

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from tdint.response.spectra.modal import ModalResponse
    from tdint.response.spectra.transfer import TransferFunction
    from tdint.response.static.pushover import Pushover
    from tdint.response.static.target_displacement import TargetDisplacement


def pushover_page(
    result: Pushover,
    targets: Sequence[TargetDisplacement],
    page_text: PageText,
    units: OutputUnits = SI,
) -> bytes:
    """Return the report of a pushover analysis and of its target displacements.

    Parameters
    ----------
    targets : sequence of TargetDisplacement
        Target displacements under a design spectrum; may be empty.
    """
    model, units = result.model, page_units(units)
    draw = partial(figures.static_curves.pushover_picture, result, units)
    # The figure shows the curve; the tables list the story drifts at the target displacements.
    parts: list[Part] = []
    if targets:
        draw = partial(figures.static_curves.target_picture, targets, units)
        parts = [
            _with_method_names(Table.of_results(buildings.TARGET_DISPLACEMENT, targets)),
            "The equivalent oscillators, and the building at the target displacement:",
            _with_method_names(Table.of_results(buildings.TARGET_OF_BUILDING, targets)).in_units(
                units
            ),
        ]
    chapters = [
        page_text.result(Picture(draw, f"Pushover, {result.pattern} pattern")),
        Chapter("Stories at the target displacement", parts),
        model_chapter(model, units),
        Chapter("Assumptions", ((*_PUSHOVER_ASSUMPTIONS, *MODEL_LIMITS),)),
    ]
    target = f", target spectrum {spectrum_text(targets[0].target.source)}" if targets else ""
    about = f"Pushover of {model.name}, {result.pattern} force pattern{target}."
    return page(model.name, about, chapters, page_text)


def _with_method_names(table: Table) -> Table:
    """Replace the keys of the methods for target displacements in a table by their names."""
    return table.with_values("method", lambda key: METHOD_NAMES[str(key)])


METHOD_NAMES = {"n2": "N2, EN 1998-1 annex B", "coefficients": "ASCE 41-17, 7.4.3.3"}
"""Name of each method for target displacements and its clause in the building code."""
_PUSHOVER_ASSUMPTIONS = (
    "The building is pushed slowly by forces of one pattern, without dashpots and damping; P-delta "
    "effects are included if the model has them.",
    "A target displacement is an estimate from one curve and an elastic spectrum; time history "
    "analyses may give other results.",
)


def modal_page(result: ModalResponse, page_text: PageText, units: OutputUnits = SI) -> bytes:
    """Return the report of a response spectrum analysis."""
    model, units = result.model, page_units(units)
    draw = partial(figures.mode_shapes.modal_response_picture, result, units)
    # The table has only the CQC values, which are also valid for close modes. The text states the
    # base shear by SRSS.
    table = Table.of_results(buildings.MODAL_RESPONSE, [result])
    table = table.chosen([name for name in table.columns if name == "story" or "_cqc" in name])
    target = spectrum_text(result.target.source)
    chapters = [
        page_text.result(Picture(draw, f"Peaks of the stories under {target}")),
        Chapter("Peaks of the stories", (table.in_units(units),)),
        Chapter(
            "Modes",
            (
                Table.of_results(buildings.MODAL_SHARE, [result]).in_units(units),
                Picture(
                    partial(_modes_on_target, result, units),
                    "Target spectrum with the modes, and effective modal masses",
                ),
            ),
        ),
        model_chapter(model, units),
        Chapter("Assumptions", ((*_MODAL_ASSUMPTIONS, *MODEL_LIMITS),)),
    ]
    return page(
        model.name,
        f"Response spectrum analysis of {model.name}: {target}.",
        chapters,
        page_text,
    )


def transfer_page(result: TransferFunction, page_text: PageText, units: OutputUnits = SI) -> bytes:
    """Return the report of the transfer functions of a building."""
    model, units = result.model, page_units(units)
    draw = partial(figures.mode_shapes.transfer_picture, result, units)
    chapters = [
        page_text.result(Picture(draw, "Amplitudes and phases over the frequency")),
        Chapter("Maximum of each floor", (transfer.resonance_table(result).in_units(units),)),
        model_chapter(model, units),
        Chapter("Assumptions", ((*_TRANSFER_ASSUMPTIONS, *MODEL_LIMITS),)),
    ]
    return page(model.name, f"Transfer functions of {model.name}.", chapters, page_text)


_TRANSFER_ASSUMPTIONS = (
    "Harmonic steady-state response of the building with its initial stiffness: no story yields.",
    "Damping of the model, linear dashpots and braced dampers are included exactly, by the complex "
    "dynamic stiffness at each frequency.",
)


def _modes_on_target(result: ModalResponse, units: OutputUnits) -> Figure:
    """Return the figure of the target spectrum with marks at the modes of the building."""
    # Show the usual periods of a report, extended to include all modes. `result.period` is in
    # descending order.
    target = result.target
    shortest = min(SPECTRUM_PERIODS[0], 0.9 * float(result.period[-1]))
    longest = max(SPECTRUM_PERIODS[1], 1.3 * float(result.period[0]))
    shown = (target.periods >= shortest) & (target.periods <= longest)
    # Omitted modes have no spectral acceleration.
    values = np.where(result.spectral_acceleration > 0.0, result.spectral_acceleration, math.nan)
    curve = figures.mode_shapes.SpectrumAtModes(
        spectrum_text(target.source), target.periods[shown], target.psa[shown], values
    )
    return figures.mode_shapes.mode_spectrum_picture(result.period, result.mass_ratio, curve, units)


_MOST_MODES = 20
"""Maximum number of modes in a report; the table of the command lists all."""

_ENOUGH_MASS = 0.9
"""Fraction of the mass that the modes of an analysis must contain (EN 1998-1, 4.3.3.3.1)."""


def mode_page(
    model: Model,
    table: Table,
    draw: Callable[[], Figure],
    page_text: PageText,
    units: OutputUnits = SI,
    record: Record | None = None,
) -> bytes:
    """Return the report of the natural modes of a building.

    Parameters
    ----------
    table : Table
        Modes, longest period first (`mode_table`).
    record : Record, optional
        Ground motion of the model; its response spectrum shows the modes.
    """
    units = page_units(units)
    modes = {column.name: values for column, values in table.by_column()}
    # The modes of stories without initial stiffness are not in the figure.
    is_finite = np.isfinite(modes["period_s"])
    periods, mass_ratios = modes["period_s"][is_finite], modes["mass_ratio"][is_finite]
    # Damping ratios are in percent, as in the sentences of the report.
    meanings = {**table.meanings, "damping": {**table.meanings["damping"], "unit": "%"}}
    shown_table = table._replace(rows=table.rows[:_MOST_MODES], meanings=meanings)
    shown_table = shown_table.with_values("damping", lambda ratio: 100.0 * float(ratio or 0.0))
    omission = f"The first {_MOST_MODES} of {pluralize(len(table.rows), 'mode')}."
    curve, caption = None, "Effective modal masses"
    if record is not None and periods.size:
        curve = _spectrum_at_modes(record, periods)
        caption = f"Response spectrum of {curve.label}, 5 % damping, and effective modal masses"
    shapes = Picture(partial(figures.style.lowered, draw), "Shapes of the first modes")
    chapters = [
        Chapter("Modes", (list(page_text.sentences), shown_table)),
        Chapter("Further modes", (omission,) if len(table.rows) > _MOST_MODES else ()),
        Chapter(
            "Modes and spectrum",
            (
                Picture(
                    lambda: figures.mode_shapes.mode_spectrum_picture(
                        periods, mass_ratios, curve, units
                    ),
                    caption,
                ),
            )
            if periods.size
            else (),
        ),
        Chapter("Shapes", (shapes,)),
        model_chapter(model, units),
        *([motion_chapter([[(record, 1.0)]], units, drawn=True)] if record is not None else []),
        Chapter(
            "Assumptions",
            (
                (
                    "Undamped modes with the initial stiffness; damping ratios without the "
                    "coupling of modes.",
                    *simplifications(),
                ),
            ),
        ),
    ]
    verdict = _mode_verdict(model, modes["mass_ratio"], modes["cumulative_mass_ratio"])
    page_text = replace(page_text, verdict=[(None, verdict)])
    return page(model.name, f"Natural modes of {model.name}.", chapters, page_text)


def _spectrum_at_modes(record: Record, periods: Array) -> figures.mode_shapes.SpectrumAtModes:
    """Return the response spectrum of a record with 5 % damping, and its values at the modes.

    `periods` contains the periods of the modes, s; the spectrum continues to 1.3 times the maximum.
    """
    longest = max(SPECTRUM_PERIODS[1], 1.3 * float(periods.max(initial=0.0)))
    grid = np.geomspace(SPECTRUM_PERIODS[0], longest, int(SPECTRUM_PERIODS[2]))
    name = figures.style.motion_name(record)
    values = spectrum(record, grid).psa, spectrum(record, periods).psa
    return figures.mode_shapes.SpectrumAtModes(name, grid, *values)


def _mode_verdict(model: Model, mass_ratios: Array, cumulative_mass_ratios: Array) -> str:
    """Return the headline of a report of modes: first period, damping ratio and modal masses.

    `cumulative_mass_ratios` contains the sums of `mass_ratios` from the first mode to each mode.
    """
    building = assemble(model)
    period, damping = building.first_period, building.first_mode()[1]
    # For an array of Booleans, `argmax` returns the index of the first True: the first mode at
    # which the cumulative mass reaches the required fraction.
    count = int(np.argmax(cumulative_mass_ratios >= _ENOUGH_MASS)) + 1
    return (
        f"First period {number_text(period)} s with {number_text(100.0 * damping, 3)} % damping, "
        f"{number_text(100.0 * float(mass_ratios[0]))} % of the mass; {pluralize(count, 'mode')} "
        f"{'contains' if count == 1 else 'contain'} "
        f"{number_text(100.0 * float(cumulative_mass_ratios[count - 1]))} % of the mass."
    )


_MODAL_ASSUMPTIONS = (
    "The building is linear with its initial stiffness. The modal peaks of each response are "
    "combined by the square root of the sum of squares (SRSS) and by the complete quadratic "
    "combination (CQC).",
    "The same target spectrum applies to all modes, independently of the damping of the model.",
)
