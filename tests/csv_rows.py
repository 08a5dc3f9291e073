"""The rows of a table, as every test of a command asks for them."""

import csv
from pathlib import Path


def rows(table: str | Path) -> list[dict[str, str]]:
    """Of a table's text, or of a file: a path, or a name, which is a single line."""
    of_file = isinstance(table, Path) or (table and "\n" not in table)
    return list(
        csv.DictReader(
            (Path(table).read_text(encoding="utf-8") if of_file else str(table)).splitlines()
        )
    )
