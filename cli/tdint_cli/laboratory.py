"""What the commands that measure methods share: the methods, and where table and picture go."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from tdint_cli.terminal import emit, say

if TYPE_CHECKING:
    from tdint.files import Writer
    from tdint.methods.method import Integrator
    from tdint.output.tables.tables import Table


def chosen(specifications: Sequence[str]) -> list[Integrator]:
    """The methods that are asked for, each once; all of the catalogue at their defaults if none is.

    Raises
    ------
    UsageError
        An unknown method or parameter, or a value out of range.
    """
    from tdint.methods.catalogue import catalogue, parse

    return list(dict.fromkeys(parse(text) for text in specifications or catalogue()))


@dataclass(frozen=True)
class Outputs:
    """Where a command's table goes (standard output if None) and, if asked for, its picture and its summary."""

    table: Path | None
    picture: Path | None
    summary: Path | None
    overwrite: bool

    @property
    def files(self) -> list[Path]:
        """The files that are written."""
        return [file for file in (self.table, self.picture, self.summary) if file]

    @classmethod
    def checked(cls, output: str | None, plot: str | None, overwrite: bool, *, summary: bool = False) -> Outputs:
        """The outputs of a command line, after what can be seen to fail was refused; the summary is a JSON file beside
        the table.

        Raises
        ------
        OutputError
            A file that cannot be written, or a picture of an unknown format.
        """
        from tdint.files import check_outputs

        table = Path(output) if output else None
        beside = table.with_suffix(".json") if table and summary else None
        outputs = cls(table, Path(plot) if plot else None, beside, overwrite)
        check_outputs(outputs.files, overwrite=overwrite)
        if outputs.picture:
            from tdint.output.figures.run import picture_format

            picture_format(outputs.picture.suffix)
        return outputs

    def deliver(
        self, table: Table, draw: Callable[[str], Writer], summarize: Callable[[], dict[str, Any]] | None = None
    ) -> None:
        """Write all; `draw` makes the picture's writer from its suffix, `summarize` what the summary holds."""
        from tdint.files import write_files

        data = table.csv()
        files: dict[Path, Writer] = {}
        if self.table:
            files[self.table] = lambda stream: stream.write(data)
        if self.picture:
            files[self.picture] = draw(self.picture.suffix)
        if self.summary and summarize:
            from tdint.output.summaries.summary import json_bytes

            summary = json_bytes(summarize())
            files[self.summary] = lambda stream: stream.write(summary)
        if not self.table:
            emit(data)
        if files:
            write_files(files, overwrite=self.overwrite)


def say_table(rows: Sequence[Sequence[str]]) -> None:
    """Rows of words on standard error, in columns; the first row is the header."""
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    for row in rows:
        say("  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)).rstrip())
