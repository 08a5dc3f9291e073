"""Columns of the tables of studies, declared in `columns.csv` (`tdint.output.tables.columns`)."""

from __future__ import annotations

from tdint.output.tables.columns import ColumnFile

declared = ColumnFile(__file__)
