"""Tables of attachments and links: peaks, and their columns in response histories."""

from __future__ import annotations

import math
from itertools import chain
from typing import Any

import numpy as np

from tdint.model.definition import Attachment, Link, Model
from tdint.output.tables.columns import declared
from tdint.output.tables.elements import FRACTURE
from tdint.output.tables.table import Cell, Column, Table, error_columns, joined_rows, rows_of
from tdint.response.runs.contacts import LinkContact
from tdint.response.runs.elements import fracture_sides
from tdint.response.runs.history import DeviceHistory, History
from tdint.response.runs.outcome import STORY_QUANTITIES, DevicePeaks, Response
from tdint.units import OutputUnits, quantities

_MEANINGS = {
    "peak_drift": "maximum absolute displacement of the mass relative to its floor (stroke)",
    "residual_drift": "displacement relative to the floor at the end of the run",
    "peak_shear": "maximum absolute force of the spring, without the dashpot",
    "peak_damper_force": "maximum absolute force of the dashpot; 0 without a dashpot",
    "ductility": "peak drift divided by drift at first yield",
    "peak_displacement": "maximum absolute displacement of the mass, relative to the ground",
    "peak_velocity": "maximum absolute velocity of the mass, relative to the ground",
    "peak_absolute_acceleration": "maximum absolute acceleration of the mass",
}
_OF_LINKS = {
    "peak_drift": (
        "peak_deformation_m",
        "maximum absolute deformation: displacement of the end relative to the start",
    ),
    "residual_drift": ("residual_deformation_m", "deformation at the end of the run"),
    "peak_shear": ("peak_force_N", "maximum absolute force of the spring; 0 without a spring"),
    "peak_damper_force": ("peak_damper_force_N", _MEANINGS["peak_damper_force"]),
    "ductility": ("ductility", "peak deformation divided by deformation at first yield"),
}
_QUANTITIES = {quantity.name: quantity for quantity in STORY_QUANTITIES}
ATTACHMENT_COLUMNS = tuple(
    Column.of_quantity(_QUANTITIES[name])._replace(meaning=meaning)
    for name, meaning in _MEANINGS.items()
)
ATTACHMENT_ERROR = error_columns(ATTACHMENT_COLUMNS)
LINK_COLUMNS = tuple(
    Column(column, _QUANTITIES[name].unit, name, meaning)
    for name, (column, meaning) in _OF_LINKS.items()
)
LINK_ERROR = error_columns(LINK_COLUMNS)
ENERGY = declared("devices.energy")
INERTER = declared("devices.inerter", peak_inerter_force_N="inerter_force")
ENERGY_ERROR, INERTER_ERROR = (
    tuple(column._replace(value=f"{column.value}_error") for column in error_columns(columns))
    for columns in (ENERGY, INERTER)
)
ATTACHMENT_NAMES = (
    Column("attachment", "text", "name", "name of the attachment"),
    Column.named("floor", "floor on which it stands, numbered from the ground (0), or row"),
)
LINK_NAMES = declared("devices.link_names", **{"link": "name", "from": "start", "to": "end"})

CONTACT_COLUMNS = (
    LINK_NAMES[0]._replace(value="link", meaning="name of a link with stops"),
    Column.named("closing", "number of the closing of this link, from 1"),
    *map(Column.of_quantity, quantities(LinkContact)),
)
CONTACT_ERROR = error_columns(CONTACT_COLUMNS[2:])

TABLES = (
    ((*ATTACHMENT_NAMES, *ATTACHMENT_COLUMNS, *ENERGY), (*ATTACHMENT_ERROR, *ENERGY_ERROR)),
    ((*LINK_NAMES, *LINK_COLUMNS, *ENERGY), (*LINK_ERROR, *ENERGY_ERROR)),
)
"""Columns of the tables of attachments and of links, and their additional columns with error
estimates."""
COLUMNS = (
    *chain.from_iterable(chain(*TABLES)),
    *(*INERTER, *INERTER_ERROR, *CONTACT_COLUMNS, *CONTACT_ERROR),
)
"""All columns of the tables of attachments, links and contacts."""

_HISTORY = {quantity.name: quantity for quantity in quantities(History)}
_ATTACHMENT_SERIES = (
    "displacement",
    "velocity",
    "absolute_acceleration",
    "drift",
    "shear",
    "damper_force",
)
_LINK_SERIES = {"drift": "deformation_m", "shear": "force_N", "damper_force": "damper_force_N"}


def _series(kind: str, name: str, column: str, meaning: str) -> Column:
    """Return the history column of attachments or links."""

    def values(history: History) -> Any:
        """Return the values, shape (steps, attachments) or (steps, links)."""
        devices = history.devices
        assert devices is not None
        count = len(devices.attachments)
        part = slice(count) if kind == "attachment" else slice(count, None)
        return getattr(devices, name)[:, part]

    return Column(column, _HISTORY[name].unit, values, meaning)


HISTORY_ATTACHMENT = tuple(
    _series(
        "attachment", name, _HISTORY[name].column, f"of the attachment: {_HISTORY[name].meaning}"
    )
    for name in _ATTACHMENT_SERIES
)
"""Columns of each attachment in a response history; its name precedes the name of the column."""
HISTORY_LINK = tuple(
    _series("link", name, column, f"of the link: {column.rpartition('_')[0].replace('_', ' ')}")
    for name, column in _LINK_SERIES.items()
)
"""Columns of each link in a response history; its name precedes the name of the column."""


def history_groups(
    devices: DeviceHistory | None,
) -> tuple[tuple[tuple[str, ...], tuple[Column, ...]], ...]:
    """Return the names and columns of the groups of attachments and links in a history."""
    if devices is None:
        return ()
    return (devices.attachments, HISTORY_ATTACHMENT), (devices.links, HISTORY_LINK)


def device_columns(devices: DevicePeaks) -> list[Column]:
    """Return the columns of the table of attachments and links, with error estimates if the run has
    them. The motions of links, which have no mass, are nan."""
    has_mass = np.arange(len(devices.stories.peak_drift)) < len(devices.attachments)

    def of(part: Any, column: Column) -> Column:
        """Return the column of a quantity of the peaks (`stories`) or of their errors."""
        values = column.of(part)
        is_known = has_mass | (column.value in _OF_LINKS)
        return column._replace(value=np.where(is_known, values, math.nan))

    names = [*devices.attachments, *devices.links]
    columns = [Column("device", "text", lambda _: names, "name of the attachment or link")]
    columns += [of(devices.stories, column) for column in ATTACHMENT_COLUMNS]
    columns += ENERGY
    if devices.errors is not None:
        columns += [of(devices.errors, column) for column in ATTACHMENT_ERROR]
        columns += ENERGY_ERROR
    if devices.inerter_force is not None:
        columns += (*INERTER, *(INERTER_ERROR if devices.errors else ()))
    return columns


def device_tables(response: Response) -> tuple[Table | None, Table | None]:
    """Return the tables of attachments and links, with error estimates if the run has them; None
    for a table without rows."""
    devices = response.devices
    if devices is None:
        return None, None
    has_errors = devices.errors is not None
    model, count = response.model, len(response.model.attachments)
    parts = slice(count), slice(count, None)
    results: list[Table | None] = []
    for (columns, errors), table_rows, part in zip(
        TABLES, device_rows(model, devices), parts, strict=True
    ):
        columns = (*columns, *(errors if has_errors else ()))
        if any(any(item.spring.law.fracture) for item in model.devices[part]):
            columns = (*columns, *FRACTURE)
            fractures = _fracture_cells(devices)[part]
            table_rows = [(*row, *more) for row, more in zip(table_rows, fractures, strict=True)]
        if devices.inerter_force is not None:
            inerter_columns = (*INERTER, *(INERTER_ERROR if has_errors else ()))
            columns = (*columns, *inerter_columns)
            forces = rows_of(inerter_columns, devices)[part]
            table_rows = [(*row, *more) for row, more in zip(table_rows, forces, strict=True)]
        results.append(Table.of(columns, table_rows) if table_rows else None)
    return results[0], results[1]


def _fracture_cells(devices: DevicePeaks) -> list[tuple[Cell, ...]]:
    """Return time and side of the fracture of each attachment and link; empty without fracture."""
    if devices.fracture_time is None or devices.fracture_drift is None:
        return [(math.nan, "")] * len(devices.stories.peak_drift)
    sides = fracture_sides(devices.fracture_drift).tolist()
    return list(zip(devices.fracture_time.tolist(), sides, strict=True))


def contact_table(response: Response) -> Table | None:
    """Return the table of the contacts of links with stops; None without a contact."""
    rows = [
        (item.link, item.closing, *item.numbers, *(item.errors.numbers if item.errors else ()))
        for item in response.contacts
    ]
    columns = (*CONTACT_COLUMNS, *CONTACT_ERROR)
    return Table.of(columns[: len(rows[0])], rows) if rows else None


def device_rows(
    model: Model, devices: DevicePeaks | None
) -> tuple[list[tuple[Cell, ...]], list[tuple[Cell, ...]]]:
    """Return the rows of both tables; empty without attachments and links (None)."""
    if devices is None:
        return [], []
    energy_errors = devices if devices.errors else None
    count = len(model.attachments)
    attachment_cells, link_cells = (
        joined_rows(
            (
                (peaks, devices.stories),
                (ENERGY, devices),
                (errors, devices.errors),
                (ENERGY_ERROR, energy_errors),
            )
        )
        for peaks, errors in ((ATTACHMENT_COLUMNS, ATTACHMENT_ERROR), (LINK_COLUMNS, LINK_ERROR))
    )
    return (
        [
            (item.name, model.end_name(item.floor) if model.rows else item.floor, *cells)
            for item, cells in zip(model.attachments, attachment_cells[:count], strict=True)
        ],
        [
            (item.name, *map(model.end_name, item.ends), *cells)
            for item, cells in zip(model.links, link_cells[count:], strict=True)
        ],
    )


def device_sentences(response: Response, units: OutputUnits) -> list[str]:
    """Return a sentence with the main peaks of each attachment and link."""
    devices, model = response.devices, response.model
    assert devices is not None
    peaks, sentences = devices.stories, []
    for i, item in enumerate(model.devices):
        drift = units.text(float(peaks.peak_drift[i]), "m")
        forces = [
            f"{name} force {units.text(float(values[i]), 'N')}"
            for name, values in (
                ("spring", peaks.peak_shear),
                ("damper", peaks.peak_damper_force),
                ("inerter", devices.inerter_force),
            )
            if values is not None and values[i] > 0.0
        ]
        match item:
            case Attachment(name, floor):
                acceleration = units.text(float(peaks.peak_absolute_acceleration[i]), "m/s^2")
                texts = [f"stroke {drift}", *forces, f"absolute acceleration {acceleration}"]
                kind = "row" if model.rows else "floor"
                place = f"{kind} {model.end_name(floor)}" if floor else "the ground"
                sentences.append(f"attachment {name} on {place}: {', '.join(texts)}")
            case Link(name):
                sentences.append(f"link {name}: {', '.join([f'deformation {drift}', *forces])}")
    return sentences


def as_json(response: Response) -> dict[str, Any]:
    """Return the rows of both tables under the keys `attachments` and `links`, if they exist."""
    return {
        key: table.as_dictionaries()
        for key, table in zip(("attachments", "links"), device_tables(response), strict=True)
        if table is not None
    }
