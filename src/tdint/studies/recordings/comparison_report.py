"""HTML report of a comparison with recordings."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

from tdint.number_parsing import abbreviate, number_text
from tdint.output import figures, report
from tdint.output.page import Chapter, PageText, Picture, page, page_units
from tdint.studies.recordings import comparison_tables as comparison
from tdint.units import OutputUnits

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from tdint.studies.recordings.compare import Comparison


def _sensors(comparisons: Sequence[Comparison]) -> str:
    """Return a list of the recordings at the base of the building as text, for example
    `station.mseed HNE, station.mseed HNN`: file, and component or column."""
    sensors = [sensor for item in comparisons for sensor in item.event.recording.base]
    names = (
        " ".join(
            filter(
                None, (figures.style.record_name(sensor.file), sensor.component or sensor.column)
            )
        )
        for sensor in sensors
    )
    return abbreviate(list(dict.fromkeys(names)), _MOST_SENSORS)


_MOST_SENSORS = 6
"""Maximum number of sensors at the base that a report lists."""


def comparison_page(
    comparisons: Sequence[Comparison],
    draw: Callable[[], Figure],
    page_text: PageText,
    units: OutputUnits,
) -> bytes:
    """Return the report of a comparison of computed and recorded responses."""
    response, units = comparisons[0].response, page_units(units)
    integration = f"{report.method_text(response.method)}, time step {response.dt:.6g} s"
    band = comparisons[0].event.recording.band
    motions = [item.event.base for item in comparisons]
    chapters = [
        page_text.result(comparison.comparison_table(comparisons[0])),
        Chapter(
            "Recorded and computed",
            (Picture(draw, "Recorded and computed histories and spectra of the floors"),),
        ),
        report.model_chapter(response.model, units),
        report.unscaled_motions(motions, response.model, units),
        report.assumptions(
            integration,
            (
                "the error of the time integration was not estimated; the energy imbalance is "
                f"{number_text(100.0 * abs(response.energy.error), 2)} % of the input energy",
                f"the ground motion is that of the base, unscaled: {_sensors(comparisons)}",
                f"recorded and computed responses are filtered from {band[0]:g} to {band[1]:g} Hz "
                "(zero phase)"
                if band
                else "recorded and computed responses are not filtered",
                "correlation, peak ratio (computed over recorded) and rms difference (over the "
                "rms of the recording) are those of the compared histories",
            ),
        ),
    ]
    return page(
        response.model.name,
        f"Comparison of {response.model.name} with recordings.",
        chapters,
        page_text,
    )
