"""What the commands that measure methods share: the methods, and where table and picture go."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from tdint_cli.terminal import emit, say

if TYPE_CHECKING:
    from tdint.methods.method import Integrator
    from tdint.output.files import Writer
    from tdint.output.tables import Table


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
    """Where a command's table goes (standard output if None) and, if asked for, its picture."""

    table: Path | None
    picture: Path | None
    overwrite: bool

    @classmethod
    def checked(cls, output: str | None, plot: str | None, overwrite: bool) -> Outputs:
        """The outputs of a command line, after what can be seen to fail was refused.

        Raises
        ------
        OutputError
            A file that cannot be written, or a picture of an unknown format.
        """
        from tdint.output.files import check_outputs

        outputs = cls(Path(output) if output else None, Path(plot) if plot else None, overwrite)
        check_outputs([file for file in (outputs.table, outputs.picture) if file], overwrite=overwrite)
        if outputs.picture:
            from tdint.output.plots import picture_format

            picture_format(outputs.picture.suffix)
        return outputs

    def deliver(self, table: Table, draw: Callable[[str], Writer]) -> None:
        """Write table and picture; `draw` makes the picture's writer from its suffix."""
        from tdint.output.files import write_files

        data = table.csv()
        files: dict[Path, Writer] = {}
        if self.table:
            files[self.table] = lambda stream: stream.write(data)
        if self.picture:
            files[self.picture] = draw(self.picture.suffix)
        if not self.table:
            emit(data)
        if files:
            write_files(files, overwrite=self.overwrite)


def say_table(rows: Sequence[Sequence[str]]) -> None:
    """Rows of words on standard error, in columns; the first row is the header."""
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    for row in rows:
        say("  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)).rstrip())
