"""Options under the heading Output: the files of tables and figures, and functions that write
them."""

from __future__ import annotations

import os
import shlex
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

import click

from tdint.errors import OutputError, UsageError
from tdint.files import STDIN, Content, check_outputs, is_folder, write_files
from tdint.units import SI, OutputUnits
from tdint_cli.drawing import emit_table
from tdint_cli.options import grammar
from tdint_cli.options.grammar import Function
from tdint_cli.options.option_types import BESIDE, FileName
from tdint_cli.terminal import current, warn

if TYPE_CHECKING:
    from tdint.output.figures.style import Figure
    from tdint.output.tables.table import Table

SUFFIX = ".png"
"""Default suffix of a figure, for --plot without a file name."""

_NO_TABLES = (".png", ".pdf", ".svg", ".jpg", ".xlsx", ".xls", ".ods", ".zip")
"""Suffixes that are wrong for a table: programs would report the file as corrupt."""

_FILES = (*_NO_TABLES, ".csv", ".csv.gz", ".json", ".html", ".txt")
"""Suffixes of names that users mean as a file."""


def _check_output(value: str, parameter: click.Parameter) -> str | None:
    """Check the value of -o and return it; None for standard output (-).

    The file of a table must have a suffix, because a name without a suffix is a directory in
    commands that write several files. UsageError is raised if the value is a directory on standard
    output, a file without a suffix, or a Parquet file in a command that writes several tables.
    """
    alternatives = (parameter.metavar or "").split("|")
    # The metavar of -o is FILE, DIR or FILE|DIR. A directory cannot be written to standard output;
    # a table is written to standard output without -o.
    if value == STDIN and alternatives == ["DIR"]:
        raise UsageError(
            "-o - is standard output, but this command writes a directory; specify a directory, or "
            "omit -o"
        )
    if value == STDIN:
        return None
    if alternatives == ["DIR"] and value.lower().endswith(_FILES) and not is_folder_name(value):
        raise UsageError(
            f"-o {value}: this command writes a directory with several tables, not a file; use a "
            f"name without suffix, or {value}/"
        )
    # The name of a directory may have any suffix; the suffix of a file states its format.
    is_directory = "DIR" in alternatives and is_folder_name(value)
    if alternatives != ["FILE"] and is_parquet(value) and not is_directory:
        raise UsageError(
            f"-o {value}: this command writes only CSV; Parquet is supported by commands with a "
            "single table"
        )
    if "FILE" in alternatives and Path(value).suffix.lower() in _NO_TABLES and not is_directory:
        warn(
            f"-o {value}: the table is written as CSV; use the suffix .csv, and --plot=FILE for a "
            "figure"
        )
    if "FILE" in alternatives and not (Path(value).suffix or is_directory):
        folder = f", or {value}/ for a directory" if "DIR" in alternatives else ""
        raise UsageError(
            f"-o {value}: the file of a table must have a suffix; use {value}.csv or "
            f"{value}.csv.gz{folder}; -o - is standard output"
        )
    return value


def is_parquet(file: str | Path) -> bool:
    """Return True if a table with this file name is written as Parquet."""
    return Path(file).suffix.lower() == ".parquet"


def is_folder_name(value: str) -> bool:
    """Return True if -o specifies a directory: an existing one, or a name that ends with /."""
    return value.endswith(("/", os.sep)) or is_folder(value)


def _check_report(value: str, parameter: click.Parameter) -> str:
    """Return the file name of --report; raise UsageError if it is not an HTML file."""
    if not value.lower().endswith((".html", ".htm")):
        raise UsageError(f"--report {value}: the report is HTML; use the suffix .html")
    return value


def _check_plot(value: str, parameter: click.Parameter) -> str:
    """Return the value of --plot; raise UsageError if its suffix is no format of figures."""
    if value != BESIDE:
        from tdint.output.figures.style import picture_format

        try:
            picture_format(Path(value).suffix)
        except OutputError as error:  # the user typed this name, so it is a usage error
            raise UsageError(str(error)) from None
    return value


def _styled(_: click.Context, __: click.Parameter, texts: tuple[str, ...]) -> tuple[str, ...]:
    """Apply the values of --style to the figures of the command (callback of the option).

    A later value overrides an earlier one.
    """
    if texts:
        from tdint.output.printed import PRINTED, parse_style

        for text in texts:
            PRINTED.set(parse_style(text, before=PRINTED.get()))
    return texts


output = grammar.option("-o", "--output", type=FileName(written=True, check=_check_output))
style = grammar.option("--style", multiple=True, expose_value=False, callback=_styled)
plot = grammar.option(
    "--plot",
    is_flag=False,
    flag_value=BESIDE,
    type=FileName(written=True, check=_check_plot),
    behind=[style],
)
"""The option --plot, followed by --style, which requires it."""

units = grammar.option("--output-units")
report = grammar.option("--report", type=FileName(written=True, check=_check_report))
overwrite = grammar.option("--overwrite", is_flag=True)
jobs = grammar.option("--jobs", default=1)


@dataclass(frozen=True, eq=False, repr=False)
class Outputs:
    """Outputs of a command: the files of its table, figure, summary and report, and their units.

    Attributes
    ----------
    table : Path | None
        The file of the table; None for standard output.
    picture, summary, report : Path | None
        The files of the figure, of the JSON summary and of the HTML report; None if not requested.
    units : OutputUnits | None
        The units of the command line; None if it does not specify units.
    """

    table: Path | None
    picture: Path | None
    summary: Path | None
    overwrite: bool
    units: OutputUnits | None = None
    report: Path | None = None

    @property
    def files(self) -> list[Path]:
        """All files that are written."""
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
        """Check the outputs of a command line and return them. The summary is a JSON file next to
        the table.

        Raises
        ------
        UsageError
            --plot has no file name and -o is not given, or the table is Parquet and pyarrow is
            missing.
        OutputError
            A file cannot be written.
        """
        table = Path(output) if output else None
        if table and is_parquet(table):
            from tdint.output.tables.table import PARQUET
            from tdint.tabular import import_optional

            import_optional("pyarrow", *PARQUET)
        picture = picture_file(plot, table)
        # Check the files first, because the check of the figure format loads matplotlib.
        page = Path(report) if report else None
        outputs = cls(
            table, picture, beside(table, ".json") if table else None, overwrite, units, page
        )
        check_outputs(outputs.files, overwrite=overwrite)
        return outputs

    @property
    def shown_units(self) -> OutputUnits:
        """Units of all outputs; SI by default."""
        return self.units or SI

    def else_in(self, units: OutputUnits) -> Outputs:
        """Return the same outputs, in these units if the command line does not specify units."""
        return self if self.units else replace(self, units=units)

    def deliver(
        self,
        table: Table,
        draw: Callable[[], Figure] | None = None,
        summarize: Callable[[], dict[str, Any]] | None = None,
        page: Callable[[], bytes] | None = None,
        more: Mapping[Path, Content] | None = None,
    ) -> None:
        """Write all outputs, and the files `more` together with them.

        Parameters
        ----------
        draw : callable, optional
            Returns the figure of --plot.
        summarize : callable, optional
            Returns the contents of the summary in addition to the command line, the files that
            were read and the meanings of the columns.

        Raises
        ------
        OutputError
            A file cannot be written.
        """
        from tdint.output import figures

        assert draw or not self.picture, "a command without a figure must not declare --plot"
        # Compute the summary before any file is written, because the computation can fail.
        contents = summarize() if self.summary and summarize else None
        meanings = table.meanings
        table = table.in_units(self.shown_units)
        files: dict[Path, Content] = dict(more or {})
        if self.table:
            files[self.table] = table.parquet() if is_parquet(self.table) else table.csv()
        if self.picture and draw is not None:
            files[self.picture] = figures.style.picture(self.picture.suffix, draw)
        if self.report and page is not None:
            files[self.report] = page()
        if self.summary:
            files[self.summary] = provenance(meanings, self.shown_units, contents)
        # Write the table to standard output first, so that the reader of a pipe does not wait for
        # the figure.
        if not self.table:
            emit_table(table)
        write_files(files, overwrite=self.overwrite)


def to_files(
    *,
    picture: bool = False,
    in_units: bool = True,
    page: bool = False,
    more: Sequence[Callable[[Any], Any]] = (),
) -> Callable[[Function], Function]:
    """Return a decorator that adds the output options to a command with a table.

    The command receives the checked options as the argument `outputs`.

    Parameters
    ----------
    picture : bool
        True if the command has --plot; false by default.
    in_units : bool
        True (the default) if the command has --output-units.
    page : bool
        True if the command has --report; false by default.
    more : sequence of callable
        Declarations of further options under the heading Output.
    """

    declarations: list[Callable[[Any], Any]] = [output]
    if picture:
        declarations.append(plot)
    if page:
        declarations.append(report)
    declarations += more
    if in_units:
        declarations.append(units)
    return grammar.together(*declarations, overwrite, grammar.adapted(_with_outputs))


def _with_outputs(values: dict[str, Any]) -> dict[str, Any]:
    """Replace the values of the output options by the checked outputs."""
    units, report = values.pop("output_units", None), values.pop("report", None)
    outputs = Outputs.checked(
        values.pop("output"),
        values.pop("plot", None),
        values.pop("overwrite"),
        units=units,
        report=report,
    )
    return {**values, "outputs": outputs}


def provenance(
    meanings: Mapping[str, Mapping[str, str]],
    units: OutputUnits,
    contents: dict[str, Any] | None = None,
) -> bytes:
    """Return the JSON file next to a table, which describes the table and its origin.

    The file contains the `contents`, all files that were read, and the command line. The settings
    of the command line and the meanings of the columns are added, unless the contents are complete
    (with the key `schema`).

    Parameters
    ----------
    contents : dict, optional
        Results and settings of the command, in SI units.
    """
    from tdint.output.summary import table_summary

    contents = contents or {}
    if "schema" not in contents:
        context = click.get_current_context()
        omitted = ("output", "plot", "report", "overwrite", "jobs", "output_units")
        settings = {
            name: _plain(value) for name, value in context.params.items() if name not in omitted
        }
        summary = table_summary(str(context.info_name), settings, [], meanings)
        del summary["records"]
        contents = summary | contents
    return summary_bytes(contents, units)


def summary_bytes(
    contents: Mapping[str, Any],
    units: OutputUnits,
    keys: Mapping[str, str] = MappingProxyType({}),
    converted: Mapping[str, Any] = MappingProxyType({}),
) -> bytes:
    """Return the JSON file of tables: the contents, all files that were read, and the command
    line, also as one line for a POSIX shell.

    Parameters
    ----------
    contents : mapping
        Results and settings in SI units.
    keys : mapping of str to str
        SI units of keys in addition to the standard keys. The values of all these keys are
        converted.
    converted : mapping
        Contents that are in these units already.
    """
    from tdint.kernels.building.compilable import time_loops
    from tdint.output.summary import files_read, in_units, json_bytes, merged_inputs

    # The inputs that the command lists are first; other files that it read follow.
    inputs = list(contents.get("inputs", ()))
    inputs += [source for source in merged_inputs(files_read()) if source not in inputs]
    contents = {**contents, "inputs": inputs}
    execution = {**command_line(), "time_loops": time_loops()}
    return json_bytes({**in_units(contents, units, keys), **converted, **execution})


def command_line() -> dict[str, Any]:
    """Return the arguments of the command, and the line for a POSIX shell that repeats it."""
    arguments = list(current().arguments)
    return {"arguments": arguments, "command": shlex.join(["tdint", *arguments])}


def _plain(value: Any) -> Any:
    """Return the value of an option in a form that JSON can represent.

    None, a boolean, a number or a text is returned unchanged, a tuple as a list, a
    dictionary with such values. Any other
    value, such as a grid of periods, is returned as its text on the command line.
    """
    if isinstance(value, tuple):
        return [_plain(item) for item in value]
    if isinstance(value, dict):
        return {name: _plain(item) for name, item in value.items()}
    if value is None or isinstance(value, bool | int | float | str):
        return value
    return getattr(value, "text", str(value))


def picture_file(plot: str | None, table: Path | None) -> Path | None:
    """Return the file of the figure; None without --plot.

    Parameters
    ----------
    plot : str | None
        Value of --plot: a file name; `BESIDE` for the name of the table with another suffix; None
        without --plot.
    table : Path | None
        File of the table; None without -o.

    Raises
    ------
    UsageError
        The figure has no file name, and no table file is specified.
    """
    if plot != BESIDE:
        return Path(plot) if plot else None
    if table is None:
        raise UsageError(
            "--plot without a file name requires -o; add -o, or specify the file: --plot=FILE.png"
        )
    return beside(table, SUFFIX)


def beside(table: Path, suffix: str) -> Path:
    """Return the path of a table with another suffix; the table may be compressed (.csv.gz)."""
    if table.suffix.lower() == ".gz":
        table = table.with_suffix("")
    return table.with_suffix(suffix)
