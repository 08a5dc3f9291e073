"""Registry of the results: class of a result -> its table, its figure and the main panel.

`tdint.to_dict` and `tdint.plot` search a result here. A new class of results needs one entry.
The keys are the names of classes, and modules of tables and figures are imported when they are
used, so that this module does not load matplotlib.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache
from typing import TYPE_CHECKING, Any

from tdint.output import tables
from tdint.tabular import Tabular, on_use

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from tdint.output import figures
    from tdint.output.tables.table import Column, Table
    from tdint.units import OutputUnits
else:
    figures = on_use("tdint.output.figures")


@dataclass(frozen=True)
class Presentation:
    """Table and figure of the results of a class.

    Attributes
    ----------
    table : callable | None
        Result -> its table, or its columns with their values.
    columns : callable | None
        Result -> columns of its table, instead of `table`. Without both, `rows` makes the table.
    rows : callable | None
        (results, units) -> table with a row for each result. Only numbers with their unit in the
        column `unit` of the row are in these units; the caller converts the other columns.
    picture : callable | None
        (results, units) -> figure.
    on_axes : callable | None
        (axes, results, units). Plots the main panel on existing axes.
    alone : bool
        True if a figure shows a single result. `picture` and `on_axes` then receive this result
        instead of a sequence of results.
    only_si : str
        Reason why the units of the table cannot be selected; empty if they can be selected.
    """

    table: Callable[[Any], Table | list[tuple[Column, Any]]] | None = None
    columns: Callable[[Any], Sequence[Column]] | None = None
    rows: Callable[[Sequence[Any], OutputUnits], Table] | None = None
    picture: Callable[[Any, OutputUnits], Figure] | None = None
    on_axes: Callable[[Any, Any, OutputUnits], None] | None = None
    alone: bool = False
    only_si: str = ""


def _record_columns(result: Any) -> Sequence[Column]:
    """Return the columns that the class of a result declares, after the file and the component of
    its record."""
    return (*tables.table.RECORD_COLUMNS, *tables.table.columns_of(type(result)))


def row(find: Callable[[], Sequence[Column]]) -> Callable[[Sequence[Any], OutputUnits], Table]:
    """Return the function `rows` of a class with fixed columns, which `find` returns."""
    return lambda results, _: tables.table.Table.of_results(find(), results)


def _infos(records: Sequence[Any]) -> list[Any]:
    """Return the properties of records; results that already are properties are unchanged."""
    return [
        record
        if isinstance(record, tables.spectra.RecordInfo)
        else tables.spectra.record_info(record)
        for record in records
    ]


def _info_picture(records: Sequence[Any], units: OutputUnits) -> Figure:
    """Return the figure of records or of their properties."""
    return figures.static_curves.info_picture(_infos(records), units)


def _draw_record(axes: Any, records: Sequence[Any], units: OutputUnits) -> None:
    """Plot the acceleration of the first record."""
    figures.static_curves.draw_acceleration(axes, _infos(records)[0].record, units)


PRESENTATIONS: dict[str, Presentation] = {
    "CyclicTest": Presentation(
        columns=lambda _: tables.buildings.CYCLIC,
        picture=figures.static_curves.cyclic_picture,
        on_axes=figures.static_curves.draw_loop,
        alone=True,
    ),
    "DriftSpectrum": Presentation(
        columns=_record_columns,
        picture=figures.spectrum_curves.drift_spectrum_picture,
    ),
    "ElementPeaks": Presentation(columns=lambda _: tables.elements.ELEMENT_COLUMNS),
    "FloorSpectrum": Presentation(
        lambda result: tables.spectra.floor_spectrum_table([result]),
        picture=figures.floor_spectra.floor_picture,
    ),
    "FourierSpectrum": Presentation(
        columns=_record_columns,
        picture=figures.static_curves.fourier_picture,
        on_axes=figures.static_curves.draw_fourier,
    ),
    "DevicePeaks": Presentation(columns=lambda result: tables.devices.device_columns(result)),
    "History": Presentation(lambda result: tables.values.history_columns(result)),
    "InelasticSpectrum": Presentation(
        columns=_record_columns,
        picture=figures.spectrum_curves.inelastic_picture,
    ),
    "Integrator": Presentation(rows=row(lambda: tables.methods.METHOD)),
    "InventoryBuilding": Presentation(rows=row(lambda: tables.buildings.INVENTORY)),
    "ModalResponse": Presentation(
        columns=lambda _: tables.buildings.MODAL_RESPONSE,
        picture=figures.mode_shapes.modal_response_picture,
        on_axes=figures.mode_shapes.draw_modal_drifts,
        alone=True,
    ),
    "Modes": Presentation(
        lambda result: tables.buildings.mode_table(result, result.damping),
        picture=lambda result, _: figures.mode_shapes.mode_picture(result, name="Modes"),
        on_axes=lambda ax, result, _: figures.mode_shapes.draw_modes(ax, result),
        alone=True,
    ),
    "Overview": Presentation(rows=row(lambda: tables.buildings.OVERVIEW)),
    "Pushover": Presentation(
        lambda result: tables.buildings.pushover_table(result),
        picture=figures.static_curves.pushover_picture,
        on_axes=figures.static_curves.draw_curve,
        alone=True,
    ),
    "Record": Presentation(
        columns=lambda _: tables.spectra.SAMPLES, picture=_info_picture, on_axes=_draw_record
    ),
    "RecordInfo": Presentation(
        rows=lambda results, _: tables.spectra.info_table(results),
        picture=_info_picture,
        on_axes=_draw_record,
    ),
    "Response": Presentation(
        lambda result: tables.responses.response_table(result),
        picture=figures.runs.run_picture,
        on_axes=figures.runs.draw_drifts,
        alone=True,
    ),
    "RotatedSpectrum": Presentation(
        lambda result: tables.spectra.rotated_table([result]),
        picture=figures.spectrum_curves.rotated_picture,
    ),
    "Spectrum": Presentation(
        columns=_record_columns,
        picture=lambda results, units: figures.spectrum_curves.spectrum_picture(
            results, units=units
        ),
        on_axes=figures.spectrum_curves.draw_accelerations,
    ),
    "StoryPeaks": Presentation(columns=lambda _: tables.responses.STORY_COLUMNS),
    "TargetDisplacement": Presentation(
        columns=lambda _: tables.buildings.TARGET_DISPLACEMENT,
        picture=figures.static_curves.target_picture,
    ),
    "TransferFunction": Presentation(
        lambda result: tables.transfer.transfer_table(result),
        picture=figures.mode_shapes.transfer_picture,
        alone=True,
    ),
}
"""Presentations by the class name of the results. Messages list them in this order."""


@cache
def presentations() -> dict[str, Presentation]:
    """Return the tables and figures of all classes of results, also of studies and of the
    assessment of methods (`tdint/__init__.py` lists these modules)."""
    return PRESENTATIONS | {
        name: known for module in Tabular._presentations() for name, known in module.items()
    }
