"""Options under the heading Output: where table and picture go, and what writes them."""

from __future__ import annotations

import functools
import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, cast

import click

from tdint.errors import OutputError, UsageError
from tdint.files import STDIN, check_outputs, is_folder, keep_input, write_files
from tdint.units import SI, OutputUnits
from tdint_cli.drawing import emit_table
from tdint_cli.options import grammar
from tdint_cli.options.grammar import FileName, Function, OutputUnitsType
from tdint_cli.terminal import current, warn

if TYPE_CHECKING:
    from tdint.files import Content
    from tdint.output.figures.style import Figure
    from tdint.output.tables.table import Table

option = partial(grammar.option, heading=grammar.OUTPUT)

SUFFIX = ".png"
"""Of a picture that got no name."""

TABLE = "Write the table to this file instead of standard output."

_NO_TABLES = (".png", ".pdf", ".svg", ".jpg", ".xlsx", ".xls", ".ods", ".zip")
"""Ends of names that say of a table what it is not: whoever opens it is told that the file is
damaged."""


def output(metavar: str = "FILE", text: str = TABLE, *, tables: bool = True) -> grammar.Declaration:
    """The option -o; what it names differs between the commands: `tables`, which `tdint rerun` may
    write again."""
    kind = FileName(folder=metavar == "DIR", written=True, tables=tables)
    return option("-o", "--output", type=kind, metavar=metavar, callback=_place, help=text)


def _place(context: click.Context, parameter: click.Parameter, value: str | None) -> str | None:
    """Where a table goes; - is standard output, as without -o. A folder is none, and a table's file
    has a suffix: it is no folder, which is what the same word names in a command that writes
    several files."""
    kinds = (parameter.metavar or "").split("|")
    # A folder cannot go to standard output; a table does so without -o.
    if value == STDIN and kinds == ["DIR"]:
        raise UsageError(
            "-o - is standard output, and this command writes a folder: name it, or leave -o out"
        )
    if value == STDIN:
        return None
    value = refuse_empty(context, parameter, value)
    # What names a folder may end in any way; a file says by its suffix what is written.
    to_folder = "DIR" in kinds and value is not None and is_folder_name(value)
    if value and kinds != ["FILE"] and is_parquet(value) and not to_folder:
        raise UsageError(
            f"-o {value}: this command writes CSV alone; Parquet is for commands with a single "
            "table"
        )
    if value and "FILE" in kinds and Path(value).suffix.lower() in _NO_TABLES and not to_folder:
        warn(
            f"-o {value}: a table is CSV, whatever its file is called: name it .csv; a picture is "
            "--plot=FILE"
        )
    if value and "FILE" in kinds and not (Path(value).suffix or to_folder):
        folder = f"; {value}/ is a folder" if "DIR" in kinds else ""
        raise UsageError(
            f"-o {value}: a table is a file, {value}.csv or {value}.csv.gz{folder}; -o - is "
            "standard output"
        )
    return value


def is_parquet(file: str | Path) -> bool:
    """Whether a table of this name is written as Parquet."""
    return Path(file).suffix.lower() == ".parquet"


def is_folder_name(value: str) -> bool:
    """Whether -o names a folder: one that is there, or is named with a / at its end."""
    return value.endswith(("/", os.sep)) or is_folder(value)


def refuse_empty(_: click.Context, parameter: click.Parameter, value: str | None) -> str | None:
    """An empty name is a shell variable that was not set, not the working directory."""
    if value == "":
        raise UsageError(f"{parameter.opts[0]} is empty; give a name")
    return value


def _page(context: click.Context, parameter: click.Parameter, value: str | None) -> str | None:
    """Refuse the name of another format."""
    if (value := refuse_empty(context, parameter, value)) and not value.lower().endswith(
        (".html", ".htm")
    ):
        raise UsageError(f"--report {value}: the page is HTML; name it .html")
    return value


def plot(text: str) -> grammar.Declaration:
    """The option --plot; what it draws differs between the commands."""
    return option(
        "--plot",
        type=FileName(written=True),
        metavar="[FILE]",
        callback=refuse_empty,
        help=text,
        behind=[style_of("--plot")],
    )


def _styled(_: click.Context, __: click.Parameter, texts: tuple[str, ...]) -> tuple[str, ...]:
    """Set what is asked of the pictures of this command."""
    if texts:
        from tdint.output.printed import PRINTED, parse_style

        for text in texts:
            PRINTED.set(parse_style(text, before=PRINTED.get()))
        if sheet := PRINTED.get().style:
            keep_input(sheet)
    return texts


def style_of(needs: str) -> grammar.Declaration:
    """The option --style, of the pictures that are drawn with what it `needs`."""
    return option(
        "--style",
        needs=needs,
        multiple=True,
        expose_value=False,
        callback=_styled,
        metavar="LOOKS",
        rare=True,
        help="Looks of the picture: 90mm, paper.mplstyle. A width is for print: letters of 6 to 8 "
        "points, 600 dpi; a style sheet is matplotlib's. All words: "
        "\"width=90mm,file=paper.mplstyle,font='Times New Roman',title=no,"
        'label:moment4=present method".',
    )


PICTURE = "Also draw, to this file (.png, .pdf, .svg) or beside -o under its name."
picture = plot(PICTURE)
units = option(
    "--output-units",
    type=OutputUnitsType(),
    rare=True,
    help="Units of tables, summaries and pictures in place of the model's output_units or SI, one "
    "each of force, length, mass, velocity, acceleration: kip,in,g.",
)
report = option(
    "--report",
    type=FileName(written=True),
    metavar="FILE.html",
    callback=_page,
    help="Also write a page for a report: result, building, motions, pictures, assumptions, "
    "warnings, hashes; one file that needs no network and prints on A4.",
)
overwrite = option("--overwrite", is_flag=True, recorded=False, help="Replace existing outputs.")


def threads(text: str, heading: str = grammar.OWN, **settings: Any) -> grammar.Declaration:
    """The option --jobs; `text` says what the threads of this process do, or several processes."""
    told = f"{text} by default. The output does not depend on it."
    return grammar.option(
        "--jobs",
        heading=heading,
        type=click.IntRange(1, 1024),
        metavar="N",
        rare=True,
        recorded=False,
        help=told,
        **settings,
    )


jobs = threads("Processes that share the records; one", grammar.GENERAL, default=1)


@dataclass(frozen=True)
class Outputs:
    """Where a command's table goes (standard output if None) and, if asked for, its picture and its
    summary; in which units, or None where nobody said.
    """

    table: Path | None
    picture: Path | None
    summary: Path | None
    overwrite: bool
    units: OutputUnits | None = None
    report: Path | None = None

    @property
    def files(self) -> list[Path]:
        """The files that are written."""
        return [file for file in (self.table, self.picture, self.summary, self.report) if file]

    @classmethod
    def checked(
        cls,
        output: str | None,
        plot: str | None,
        overwrite: bool,
        *,
        units: OutputUnits | None = None,
        report: str | None = None,
    ) -> Outputs:
        """The outputs of a command line, after what can be seen to fail was refused; the summary is
        a JSON file beside the table.

        Raises
        ------
        UsageError
            A picture without a name and without a table beside which it could lie; Parquet without
            pyarrow.
        OutputError
            A file that cannot be written, or a picture of an unknown format.
        """
        table = Path(output) if output else None
        if table and is_parquet(table):
            from tdint.output.tables.table import PARQUET
            from tdint.tabular import optional

            optional("pyarrow", *PARQUET)
        picture = picture_file(plot, table)
        # Files before the picture's format: that loads matplotlib.
        page = Path(report) if report else None
        outputs = cls(
            table, picture, beside(table, ".json") if table else None, overwrite, units, page
        )
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
        page: Callable[[], bytes] | None = None,
    ) -> None:
        """Write all; `draw` makes the picture's figure, `summarize` what the summary holds, if that
        is more than the command line, what was read and what the columns mean, `page` that of
        --report."""
        from tdint.output import figures

        assert draw or not self.picture, "a command without a drawing declares no --plot"
        # What the summary says is found before anything is written: it may fail.
        told = summarize() if self.summary and summarize else None
        meanings = table.meanings
        table = table.in_units(self.shown_units)
        files: dict[Path, Content] = {}
        if self.table:
            files[self.table] = table.parquet() if is_parquet(self.table) else table.csv()
        if self.picture and draw is not None:
            files[self.picture] = figures.style.picture(self.picture.suffix, draw)
        if self.report and page is not None:
            files[self.report] = page()
        if self.summary:
            files[self.summary] = provenance(meanings, self.shown_units, told)
        # The table goes to standard output before the files: a reader of a pipe need not wait for a
        # picture.
        if not self.table:
            emit_table(table)
        write_files(files, overwrite=self.overwrite)


def to_files(
    text: str = TABLE,
    *,
    picture: str | None = None,
    in_units: bool = True,
    page: bool = False,
    more: Sequence[Callable[[Any], Any]] = (),
) -> Callable[[Function], Function]:
    """The options of a command with a table: -o, `--plot` for one that draws (`picture` says what),
    what is peculiar to the command, --report with a `page`, units, --overwrite. The command gets
    them together as `outputs`, checked."""

    def declared(command: Function) -> Function:
        @functools.wraps(command)
        def collected(**given: Any) -> Any:
            units, report = given.pop("output_units", None), given.pop("report", None)
            outputs = Outputs.checked(
                given.pop("output"),
                given.pop("plot", None),
                given.pop("overwrite"),
                units=units,
                report=report,
            )
            return command(**given, outputs=outputs)

        plots = () if picture is None else (plot(picture),)
        pages = (report,) if page else ()
        declarations = (
            output(text=text),
            *plots,
            *pages,
            *more,
            *((units,) if in_units else ()),
            overwrite,
        )
        return grammar.together(*declarations)(cast(Function, collected))

    return declared


def provenance(
    meanings: Mapping[str, Mapping[str, str]],
    units: OutputUnits,
    told: dict[str, Any] | None = None,
) -> bytes:
    """The JSON file beside a table whose columns mean this: what is `told`, all that was read, and
    the options of the command line where what is told has no schema of its own."""
    from tdint.output.summary import table_summary

    told = told or {}
    if "schema" not in told:
        context = click.get_current_context()
        left_out = ("output", "plot", "report", "overwrite", "jobs", "output_units")
        settings = {
            name: _plain(value) for name, value in context.params.items() if name not in left_out
        }
        summary = table_summary(str(context.info_name), settings, [], meanings)
        del summary["records"]
        told = summary | told
    return summary_bytes(told, units)


def summary_bytes(
    told: Mapping[str, Any],
    units: OutputUnits,
    keys: Mapping[str, str] = MappingProxyType({}),
    converted: Mapping[str, Any] = MappingProxyType({}),
) -> bytes:
    """A JSON file beside tables: what is `told`, in these units (of `keys` beside those that all
    have), what is `converted` to them already, all that was read, and the command line that `tdint
    rerun` carries out."""
    from tdint.kernels.building.compilable import time_loops
    from tdint.output.summary import files_read, in_units, json_bytes, merged_inputs

    # The command names its own inputs first; what it read beside them comes behind.
    inputs = list(told.get("inputs", ()))
    read = merged_inputs(files_read())
    told = {**told, "inputs": [*inputs, *(source for source in read if source not in inputs)]}
    made = {"arguments": list(current().arguments), "time_loops": time_loops()}
    return json_bytes({**in_units(told, units, keys), **converted, **made})


def _plain(value: Any) -> Any:
    """The value of an option as it was written."""
    if isinstance(value, tuple):
        return [_plain(item) for item in value]
    return (
        value
        if value is None or isinstance(value, bool | int | float | str)
        else getattr(value, "text", str(value))
    )


def check_picture(file: Path) -> None:
    """Raise UsageError for a picture of an unknown format, a font or a style sheet that is not
    there."""
    from tdint.output.figures.style import check_print, picture_format
    from tdint.output.printed import PRINTED

    try:
        picture_format(file.suffix)
    except OutputError as error:  # of a name that somebody has just written
        raise UsageError(str(error)) from None
    check_print(PRINTED.get())


def picture_file(plot: str | None, table: Path | None) -> Path | None:
    """The file of a picture, if one is asked for; the table's name with another suffix if it got no
    name.

    Raises
    ------
    UsageError
        It has no name, and there is no table beside which it could lie.
    """
    if plot != grammar.BESIDE:
        return Path(plot) if plot else None
    if table is None:
        raise UsageError(
            "--plot alone puts the picture beside the output: add -o, or name it: --plot=FILE.png"
        )
    return beside(table, SUFFIX)


def beside(table: Path, suffix: str) -> Path:
    """The file of another kind beside a table, which may be packed (.csv.gz)."""
    return (table.with_suffix("") if table.suffix.lower() == ".gz" else table).with_suffix(suffix)
