"""Table of the elements of stories with several elements."""

from __future__ import annotations

from typing import TYPE_CHECKING

from tdint.output.tables.table import TEXT, Column, Table, error_columns
from tdint.response.runs.elements import ELEMENT_QUANTITIES, ElementPeaks
from tdint.units import quantities

if TYPE_CHECKING:
    from tdint.response.runs.outcome import Response

_ELEMENT = {quantity.name: quantity for quantity in ELEMENT_QUANTITIES}

ELEMENT_COLUMNS: tuple[Column, ...] = (
    *(
        Column.of_quantity(quantity)
        for quantity in quantities(ElementPeaks)
        if quantity.name not in _ELEMENT
    ),
    Column.of_quantity(_ELEMENT["peak_force"]),
    Column.of_quantity(_ELEMENT["dissipated_energy"]),
    Column.named("yield_drift", "drift at first yield; empty without yielding", "m"),
    Column.of_quantity(_ELEMENT["ductility"]),
)
"""Columns of elements.csv: the elements of stories with several elements."""
FRACTURE = (
    Column.named("fracture_time", "time of the fracture; empty without a fracture", "s"),
    Column.named("fracture_side", "side of the fracture, positive or negative", TEXT),
)
"""Additional columns of the tables of elements, attachments and links that can fracture."""
ELEMENT_ERROR = error_columns(Column.of_quantity(quantity) for quantity in _ELEMENT.values())


def element_table(response: Response) -> Table | None:
    """Return the table of the elements of stories with several elements, with error estimates if
    the run has them; None without such stories."""
    if response.elements is None:
        return None
    errors = response.check.elements if response.check else None
    can_fracture = any(
        any(element.law.fracture) for story in response.model.stories for element in story.elements
    )
    columns = (*ELEMENT_COLUMNS, *(FRACTURE if can_fracture else ()))
    return Table.joined((columns, response.elements), (ELEMENT_ERROR, errors))
