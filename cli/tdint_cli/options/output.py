"""Options under the heading Output: where table and picture go, and what writes them."""

from __future__ import annotations

import functools
import os
import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar, cast

import click

from tdint.errors import OutputError, UsageError
from tdint.input_bytes import STDIN
from tdint.output_units import SI, OutputUnits
from tdint.units import LENGTH
from tdint_cli.drawing import emit_table
from tdint_cli.options import headings
from tdint_cli.options.values import FileName, OutputUnitsType

if TYPE_CHECKING:
    from tdint.files import Content
    from tdint.output.figures.style import Figure
    from tdint.output.tables.table import Table

Function = TypeVar("Function", bound=Callable[..., Any])

option = partial(headings.option, heading=headings.OUTPUT)

SUFFIX = ".png"
"""Of a picture that got no name."""

TABLE = "Write the table to this file instead of standard output."


def output(metavar: str = "FILE", text: str = TABLE) -> headings.Declaration:
    """The option -o; what it names differs between the commands."""
    kind = FileName(folder=metavar == "DIR")
    return option("-o", "--output", type=kind, metavar=metavar, callback=refuse_empty, help=text)


def refuse_empty(_: click.Context, parameter: click.Parameter, value: str | None) -> str | None:
    """An empty name is a shell variable that was not set, not the working directory."""
    if value == "":
        raise UsageError(f"{parameter.opts[0]} is empty; give a name")
    return value


def check_report(value: str | None) -> str | None:
    """Refuse the name of another format."""
    if value is not None and not value.lower().endswith((".html", ".htm")):
        raise UsageError(f"--report {value}: the page is HTML; name it .html")
    return value


def plot(text: str) -> headings.Declaration:
    """The option --plot; what it draws differs between the commands."""
    return option("--plot", type=FileName(), metavar="[FILE]", callback=refuse_empty, help=text, behind=_PRINTED)


def _printed(name: str, read: Callable[[Any], Any]) -> Callable[..., None]:
    """A callback that sets what is asked of the pictures of this command."""

    def keep(_: click.Context, __: click.Parameter, value: Any) -> None:
        if value not in (None, (), False):
            from tdint.output.printed import PRINTED

            PRINTED.set(replace(PRINTED.get(), **{name: read(value)}))

    return keep


def _width(text: str) -> float:
    from tdint.output.printed import NARROWEST, WIDEST

    found = re.fullmatch(r"\s*([0-9.]+)\s*([a-z]+)\s*", text)
    try:
        width = float(found[1]) * LENGTH[found[2]] if found else 0.0
    except (KeyError, ValueError):
        width = 0.0
    if not NARROWEST <= width <= WIDEST:
        raise UsageError(f"--figure-width {text!r}: write a length from 30 to 600 mm, such as 90mm or 3.5in")
    return width


def _labels(texts: tuple[str, ...]) -> tuple[tuple[str, str], ...]:
    pairs = [text.partition("=") for text in texts]
    for name, equals, after in pairs:
        if not (name and equals and after):
            raise UsageError(f"--label {name!r}: write NAME=TEXT, such as moment4='present method'")
    return tuple((name, after) for name, _, after in pairs)


def _of_print(name: str, field: str, read: Callable[[Any], Any], **settings: Any) -> headings.Declaration:
    return option(
        name, f"print_{field}", needs="--plot", expose_value=False, callback=_printed(field, read), **settings
    )


_PRINTED = (
    _of_print(
        "--figure-width",
        "width",
        _width,
        metavar="LENGTH",
        help="Draw for print at this width, 90mm or 3.5in: letters of 6 to 8 points, 600 dpi.",
    ),
    _of_print("--font", "font", str, metavar="NAME", help="Font of the picture, such as 'Times New Roman'."),
    _of_print("--no-title", "title", lambda _: False, is_flag=True, help="No title above the picture."),
    _of_print(
        "--label",
        "labels",
        _labels,
        multiple=True,
        metavar="NAME=TEXT",
        help="Another text for a label of the picture: moment4='present method'.",
    ),
    _of_print("--style", "style", str, type=FileName(), metavar="FILE.mplstyle", help="A style sheet of matplotlib."),
)
PICTURE = "Also draw, to this file (.png, .pdf, .svg) or beside -o under its name."
picture = plot(PICTURE)
units = option(
    "--output-units",
    type=OutputUnitsType(),
    metavar="UNIT,...",
    help="Units of tables, summaries and pictures in place of the model's output_units or SI, one each of force, "
    "length, mass, acceleration: kip,in,g.",
)
report = option(
    "--report",
    type=FileName(),
    metavar="FILE.html",
    callback=lambda context, parameter, value: check_report(refuse_empty(context, parameter, value)),
    help="Also write a page for a report: result, building, motions, pictures, assumptions, warnings, hashes; one file "
    "that needs no network and prints on A4.",
)
overwrite = option("--overwrite", is_flag=True, help="Replace existing outputs.")
jobs = headings.option(
    "--jobs",
    heading=headings.GENERAL,
    type=click.IntRange(1, 1024),
    default=1,
    metavar="N",
    help="Processes that share the records; one by default. The output does not depend on it.",
)


@dataclass(frozen=True)
class Outputs:
    """Where a command's table goes (standard output if None) and, if asked for, its picture and its summary; in which
    units, or None where nobody said.
    """

    table: Path | None
    picture: Path | None
    summary: Path | None
    overwrite: bool
    units: OutputUnits | None = None

    @property
    def files(self) -> list[Path]:
        """The files that are written."""
        return [file for file in (self.table, self.picture, self.summary) if file]

    @classmethod
    def checked(
        cls,
        output: str | None,
        plot: str | None,
        overwrite: bool,
        *,
        units: OutputUnits | None = None,
    ) -> Outputs:
        """The outputs of a command line, after what can be seen to fail was refused; the summary is a JSON file beside
        the table. From now on it is noted what the command reads.

        Raises
        ------
        UsageError
            A picture without a name and without a table beside which it could lie.
        OutputError
            A file that cannot be written, or a picture of an unknown format.
        """
        from tdint.files import check_outputs

        note_inputs()
        table = Path(output) if output else None
        picture = picture_file(plot, table)
        outputs = cls(table, picture, beside(table, ".json") if table else None, overwrite, units)
        check_outputs(outputs.files, overwrite=overwrite)
        if outputs.picture:
            check_picture(outputs.picture)
        return outputs

    @property
    def shown_units(self) -> OutputUnits:
        """The units of all that is written."""
        return self.units or SI

    def else_in(self, units: OutputUnits) -> Outputs:
        """The same, in these units if the command line names none."""
        return self if self.units else replace(self, units=units)

    def deliver(
        self,
        table: Table,
        draw: Callable[[], Figure] | None = None,
        summarize: Callable[[], dict[str, Any]] | None = None,
    ) -> None:
        """Write all; `draw` makes the picture's figure, `summarize` what the summary holds, if that is more than the
        command line, what was read and what the columns mean."""
        from tdint.files import write_files
        from tdint.output import figures

        told = summarize() if self.summary and summarize else None
        meanings = table.meanings
        table = table.in_units(self.shown_units)
        files: dict[Path, Content] = {}
        if self.table:
            files[self.table] = table.csv()
        if self.picture and draw:
            files[self.picture] = figures.style.picture(self.picture.suffix, draw)
        if self.summary:
            files[self.summary] = provenance(meanings, self.shown_units, told)
        if not self.table:
            emit_table(table)
        if files:
            write_files(files, overwrite=self.overwrite)


def to_files(
    text: str = TABLE,
    *,
    picture: str | None = PICTURE,
    in_units: bool = True,
    more: Sequence[Callable[[Any], Any]] = (),
) -> Callable[[Function], Function]:
    """The options of a command with a table: -o, `--plot` (`picture` says what it draws, None that there is none), what
    is peculiar to the command, units, --overwrite. The command gets them together as `outputs`, checked."""

    def declared(command: Function) -> Function:
        @functools.wraps(command)
        def collected(**given: Any) -> Any:
            wanted = {name: given.pop(name, None) for name in ("output", "plot", "overwrite", "output_units")}
            outputs = Outputs.checked(
                wanted["output"], wanted["plot"], bool(wanted["overwrite"]), units=wanted["output_units"]
            )
            return command(**given, outputs=outputs)

        plots = () if picture is None else (plot(picture),)
        declarations = (output(text=text), *plots, *more, *((units,) if in_units else ()), overwrite)
        return headings.with_options(declarations, cast(Function, collected))

    return declared


def note_inputs() -> None:
    """From now on note what the command reads."""
    from tdint.input_bytes import READ

    if READ.get() is None:
        READ.set({})


def provenance(
    meanings: Mapping[str, Mapping[str, str]], units: OutputUnits, told: dict[str, Any] | None = None
) -> bytes:
    """The JSON file beside a table whose columns mean this: what is `told`, by default the options of the command
    line, and with it all that was read."""
    from tdint.input_bytes import READ
    from tdint.output.summary import in_units, json_bytes, merged_inputs, table_summary

    if told is None:
        context = click.get_current_context()
        left_out = ("output", "plot", "overwrite", "jobs", "output_units")
        settings = {name: _plain(value) for name, value in context.params.items() if name not in left_out}
        told = table_summary(str(context.info_name), settings, [], meanings)
        del told["records"]
    read = [{"file": file, "sha256": digest} for file, digest in (READ.get() or {}).items()]
    return json_bytes(in_units(told | {"inputs": merged_inputs(told.get("inputs", ()), read)}, units))


def _plain(value: Any) -> Any:
    """The value of an option as it was written."""
    if isinstance(value, tuple):
        return [_plain(one) for one in value]
    return value if value is None or isinstance(value, bool | int | float | str) else getattr(value, "text", str(value))


def check_picture(file: Path) -> None:
    """Raise OutputError for a picture of an unknown format, UsageError for a font or style sheet that is not there."""
    from tdint.output.figures.style import check_print, picture_format
    from tdint.output.printed import PRINTED

    picture_format(file.suffix)
    check_print(PRINTED.get())


def picture_file(plot: str | None, table: Path | None) -> Path | None:
    """The file of a picture, if one is asked for; the table's name with another suffix if it got no name.

    Raises
    ------
    UsageError
        It has no name, and there is no table beside which it could lie.
    """
    if plot != headings.BESIDE:
        return Path(plot) if plot else None
    if table is None:
        raise UsageError("--plot alone puts the picture beside the output: add -o, or name it: --plot=FILE.png")
    return beside(table, SUFFIX)


def beside(table: Path, suffix: str) -> Path:
    """The file of another kind beside a table, which may be packed (.csv.gz)."""
    return (table.with_suffix("") if table.suffix.lower() == ".gz" else table).with_suffix(suffix)


def refuse_inputs(outputs: Iterable[Path], inputs: Iterable[str | None]) -> None:
    """Raise OutputError for an output that is one of the files that are read, whatever --overwrite says."""
    read = {os.path.realpath(file) for file in inputs if file and file != STDIN}
    for output in outputs:
        if os.path.realpath(output) in read:
            raise OutputError(f"{output}: is read by this command; write to another place")
