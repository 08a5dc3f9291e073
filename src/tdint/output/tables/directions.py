"""Tables of a run in two directions: stories in both directions, and resultants."""

from __future__ import annotations

from collections.abc import Callable

from tdint.output.tables.columns import declared
from tdint.output.tables.table import (
    TEXT,
    Cell,
    Column,
    Table,
    describe,
    error_columns,
    numbered,
    placeholder,
)
from tdint.response.runs.outcome import Response, Resultants
from tdint.units import suffix

DIRECTION = Column.named("direction", "x, y, or resultant of both directions", TEXT)

_QUANTITIES = {
    "drift": ("m", "drift of the story"),
    "displacement": ("m", "displacement of the floor"),
    "absolute_acceleration": ("m/s^2", "absolute acceleration of the floor"),
    "shear": ("N", "restoring force of the story (story 1: base shear)"),
}
"""Unit and meaning of each quantity in `Response.resultants`."""

_ATTRIBUTES = {
    "value": ("resultant", "", "peak over time of the resultant of the {}"),
    "time": ("time", "s", "time of the peak of the resultant of the {}"),
    "direction": ("direction", "degree", "direction of the {} at this time, from x towards y"),
    "x": ("x", "", "peak of the absolute {} in x"),
    "y": ("y", "", "peak of the absolute {} in y"),
    "srss": ("srss", "", "square root of the sum of the squares of both peaks of the {}"),
    "rule_100_30": ("100_30", "", "100 % + 30 % of both peaks of the {}, the larger combination"),
}
"""Part of the name, unit (empty: that of the quantity) and meaning of each column of a quantity."""

_resultants: Resultants = placeholder()
_COLUMNS = [
    Column(
        f"{quantity}_{name}{suffix(unit or own_unit)}",
        unit or own_unit,
        getattr(getattr(_resultants, quantity), attribute),
        meaning.format(text),
    )
    for quantity, (own_unit, text) in _QUANTITIES.items()
    for attribute, (name, unit, meaning) in _ATTRIBUTES.items()
]
RESULTANT_COLUMNS = (
    *declared("directions.resultant_columns", story=numbered(_resultants.drift.value)),
    *_COLUMNS,
)
RESULTANT_ERROR = tuple(
    column._replace(value=getattr(_resultants, quantity).error)
    for column, quantity in zip(
        error_columns(_COLUMNS[:: len(_ATTRIBUTES)]), _QUANTITIES, strict=True
    )
)


def direction_table(response: Response, table_of: Callable[[Response], Table]) -> Table:
    """Return the table of the stories in both directions and of their resultants; the first column
    is the direction. `table_of` returns the table of a run in one direction."""
    parts = {**dict(zip(("x", "y"), response.directions, strict=True)), "resultant": response}
    tables = {name: table_of(part) for name, part in parts.items()}
    # Flexural stories have further columns in the directions only.
    width = len(tables["x"].columns)
    rows: list[tuple[Cell, ...]] = [
        (name, *row, *(None,) * (width - len(row)))
        for name, table in tables.items()
        for row in table.rows
    ]
    columns = (DIRECTION.name, *tables["x"].columns)
    return Table(columns, rows, describe([DIRECTION]) | tables["x"].meanings)


def resultant_table(response: Response) -> Table:
    """Return the table of the resultants, one row per story, with errors if they were estimated."""
    errors = response.resultants if response.check else None
    return Table.joined((RESULTANT_COLUMNS, response.resultants), (RESULTANT_ERROR, errors))
