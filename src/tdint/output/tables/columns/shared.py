"""Columns that tables of several subjects have."""

from __future__ import annotations

from tdint.output.tables.table import Column

OF_RECORD = (
    Column("record", "record.source", "file of the record", text=True),
    Column("component", "record.component", "component of the record", text=True),
)
"""The first columns of tables over records; of several records the components' cells are found together."""

OF_NAMED_RECORD = (
    Column("record", "record", "file of the record", text=True),
    Column("component", "component", "component of the record", text=True),
)
"""The same, of what has the names alone."""

DAMPING = Column("damping", "damping", "viscous damping ratio")
PERIOD = Column("period_s", "periods", "natural period")
FLOOR = Column("floor", "floor", "floor, from 1 at the bottom")
METHOD_SPEC = Column("method", "method", "time-integration method with its parameters", text=True)
