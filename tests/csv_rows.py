"""Rows of tables, for tests of commands."""

import csv
from pathlib import Path


def rows(table: str | Path) -> list[dict[str, str]]:
    """Return the rows of a table, given as text, as a path or as a file name in a single line."""
    is_file = isinstance(table, Path) or (table and "\n" not in table)
    return list(
        csv.DictReader(
            (Path(table).read_text(encoding="utf-8") if is_file else str(table)).splitlines()
        )
    )
