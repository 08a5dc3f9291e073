"""Tables on standard output: aligned text for a terminal, CSV for a pipe or a file."""

from __future__ import annotations

import sys
from typing import TYPE_CHECKING

from tdint_cli.terminal import emit, is_terminal

if TYPE_CHECKING:
    from tdint.output.tables.table import Table


def reading_width() -> int | None:
    """Return the width of the terminal in characters; None if there is no terminal."""
    if not is_terminal(sys.stdout):
        return None
    import shutil

    return shutil.get_terminal_size().columns


def table_bytes(table: Table, width: int | None) -> bytes:
    """Return a table as text for a screen of `width` characters, or as CSV if `width` is `None`.

    In the text, estimated errors are in percent of their values. Both are encoded as UTF-8.
    """
    if width is None:
        return table.csv()
    from tdint_cli.aligned_text import draw, with_percent_errors

    table = with_percent_errors(table)
    units = {name: meaning.get("unit", "1") for name, meaning in table.meanings.items()}
    return draw(table.columns, table.rows, width, units).encode("utf-8", "replace")


def emit_table(table: Table) -> None:
    """Write a table to standard output: aligned text to a terminal, CSV to a pipe or a file."""
    emit(table_bytes(table, reading_width()))
