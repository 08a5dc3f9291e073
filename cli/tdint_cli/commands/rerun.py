"""`tdint rerun`: repeat the command line in the JSON file of a table and compare the results.

The outputs of the repeated command are written to another directory.
"""

from __future__ import annotations

import csv
import math
import os
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import ExitStack, chdir, redirect_stdout
from dataclasses import dataclass, field, replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any

import click

from tdint.errors import AnalysisError, OutputError, UsageError
from tdint.files import STDIN, digest_of, is_file, is_folder, is_there
from tdint.number_parsing import pluralize
from tdint.output import tables
from tdint.output.printed import TRUSTED
from tdint_cli import options
from tdint_cli.drawing import emit_table
from tdint_cli.options.grammar import (
    ELSEWHERE,
    FileName,
    SampleUnitsType,
    is_recorded,
    with_named_files,
)
from tdint_cli.terminal import Settings, complain, current, note, say, warn

if TYPE_CHECKING:
    from tdint.output.tables.differences import Difference

SUMMARY = "summary.json"
"""Name of the JSON file in a directory that is given instead of the file."""

TABLES = (".csv", ".csv.gz", ".parquet")
"""Suffixes of files that are compared cell by cell."""

JSON = (".json", ".geojson")
"""Suffixes of files that are compared value by value."""

OF_STORE = ("-wal", "-shm", "-journal", ".lock")
"""Suffixes of the files that exist while the store of a campaign is open; they have no results."""

STORE = Path("campaign.sqlite")
"""Name of the store of a campaign, which lists the files that were exported from it. Stores with
this suffix are compared run by run."""

SHOWN = 1000
"""Maximum number of rows of the table of differences; a response history can have millions."""


@options.request
class Request:
    """The command line of `tdint rerun`."""

    file: str = options.argument("FILE.json|DIR", type=FileName())
    changed: bool = options.option(
        help="Also run if the inputs have changed; changed inputs are listed."
    )
    trust: bool = options.option(
        help="Allow code from files: plug-ins, and style sheets, which can start programs. Read "
        "these files first."
    )
    output: str | None = options.output.output(
        "DIR",
        "Keep the files that the command writes in this directory, which must be new or empty. By "
        "default they are deleted.",
        tables=False,
    )


@options.command(
    "rerun",
    "tdint rerun loop.json",
    "tdint rerun loop.json --changed -o again",
    exits={
        2: "changed inputs, --trust is required, or no command line in the file",
        5: "a file differs or cannot be compared",
    },
)
@options.of(Request)
def command(request: Request) -> None:
    """Repeat a recorded command and compare its results.

    The `arguments` in the file are run in the original working directory with the installed
    version. All outputs are written to another directory, so that no file is replaced. DIR is the
    same as DIR/summary.json. Every file that the command writes is compared: tables cell by cell
    (except measured times), JSON files value by value, the store of a campaign run by run, and
    ground motions, figures and pages byte by byte. Exports of a campaign are repeated. The exit
    code is 0 if all files are identical or equal within rounding (1e-9 of a number; of the peak for
    errors, residuals and histories). It is 5 if a file differs or cannot be compared; a table of
    the cells that differ, at most 1000 rows, is written to standard output. Standard error reports
    each file, versions that differ, and whether the time loops were interpreted or compiled.

    The SHA-256 of all inputs (models, records, tables, plug-ins) must be unchanged. Inputs are
    searched from the original working directory, if the file has not been moved, and then from the
    current directory. With --changed, changed inputs are listed and used. If the command fails, the
    exit code is the exit code of the command. Only commands that write tables are run, and all
    files on the command line are checked first. Plug-ins (Python code) and style sheets, which can
    start programs, require --trust. Only recorded options are accepted: --dask, --jobs and other
    options that specify where or how a command runs are refused.
    """
    told = _Told.read(request.file)
    folder = told.folder()
    # Compare the SHA-256 of input files before the run. Members of archives and standard input are
    # compared after the run.
    digests = {
        name: digest_of(folder / name)
        for name in told.inputs
        if name != STDIN and is_file(folder / name)
    }
    others = {
        name: _otherwise(name, told.inputs[name], now)
        for name, now in digests.items()
        if now != told.inputs[name]
    }
    # The command line must not open or execute a file that the recorded run did not read. The JSON
    # file of one record of several lists only this record, so that only code is checked.
    read = [os.path.realpath(folder / name) for name in told.inputs]
    for name in told.code if told.is_folder and told.file.name != SUMMARY else told.files:
        file = os.path.realpath(folder / name)
        if is_file(file) and not any(
            path == file or path.startswith(file + os.sep) for path in read
        ):
            others[name] = _otherwise(name, None, file)
    _judge_inputs(others, request.changed)
    missing = [name for name in told.code if not is_file(folder / name)]
    if missing:
        raise UsageError(
            f"{', '.join(missing)}: plug-in of {told.file} not found in {folder}; run `tdint "
            "rerun` in the directory that contains it"
        )
    if told.code and not request.trust:
        named = ", ".join(f"{name} (SHA-256 {digest_of(folder / name)})" for name in told.code)
        raise UsageError(
            f"{told.file}: the command executes the Python code of {named}; read the code, then "
            "add --trust"
        )
    with ExitStack() as stack:
        # Outputs are written to the directory of -o, or to a temporary directory.
        if request.output is None:
            place = Path(stack.enter_context(TemporaryDirectory(prefix="tdint-rerun-")))
        else:
            place = Path(request.output).absolute()
            if is_there(place) and (not is_folder(place) or any(place.iterdir())):
                raise OutputError(f"-o {request.output}: must be a new or an empty directory")
        moved = _Elsewhere(place, told, folder)
        stack.callback(TRUSTED.reset, TRUSTED.set(request.trust))
        code = _carry_out(told.arguments, folder, moved)
        if told.export and is_file(moved.summary):
            at = _place_of_folder(told)
            again_there = [*told.export[:at], str(moved.now), *told.export[at + 1 :]]
            code = code or _carry_out(again_there, folder, moved)
        if not is_file(moved.summary):
            if not code:
                raise UsageError(
                    f"{told.file}: the command writes no file with this name; restore the original "
                    "file name"
                )
            raise click.exceptions.Exit(code)
        # Find inputs and plug-ins that have changed, or that only one of the two runs has read.
        again = _Told.read(str(moved.summary))
        then, today = ({**run.inputs, **run.plugins} for run in (told, again))
        names = sorted(
            name for name in {*then, *today} - {*others} if then.get(name) != today.get(name)
        )
        _judge_inputs(
            {name: _otherwise(name, then.get(name), today.get(name)) for name in names},
            request.changed,
        )
        # The version of tdint also identifies its sources.
        for name in dict.fromkeys((*told.versions, *again.versions)):
            before, now = told.versions.get(name), again.versions.get(name)
            if name != "sources" and before != now:
                note(f"version of {name}: recorded {before or 'none'}, now {now or 'none'}")
        same = _compare(told, again, moved)
        # Only the failure of a run is recorded, with its status: this run must fail again.
        failed_then = told.content.get("status") not in (None, "done")
    if code and not (failed_then and same):
        complain(f"Error: {told.file}: the command failed, with exit code {code}")
        raise click.exceptions.Exit(code)
    if not same:
        raise AnalysisError(f"{told.file}: the results differ from the stored results")


@dataclass(frozen=True)
class _Told:
    """The recorded command in the JSON file of a table.

    Attributes
    ----------
    file : Path
        The JSON file.
    content : mapping
        The content of the file.
    arguments : sequence of str
        The command line after `tdint`.
    command : Command
        The command, which has the option -o.
    output : str
        The value of -o.
    is_folder : bool
        True if the value of -o is a directory.
    inputs : dict
        SHA-256 of the files that were read, by name.
    versions : dict
        Versions of tdint and of the packages that it computes with.
    plugins : dict
        SHA-256 of the files of plug-ins, by what they define.
    export : sequence of str
        The command line of the export of a campaign that wrote the file last; empty without export.
    files : sequence of str
        Values of both command lines for files that are read; the files need not exist.
    code : sequence of str
        Those files that are executed.
    """

    file: Path
    content: Mapping[str, Any]
    arguments: Sequence[str]
    command: click.Command
    output: str
    is_folder: bool
    inputs: dict[str, str]
    versions: dict[str, Any]
    plugins: dict[str, str]
    export: Sequence[str]
    files: Sequence[str]
    code: Sequence[str]

    @classmethod
    def read(cls, name: str) -> _Told:
        """Read a JSON file, or the summary in a directory.

        Parameters
        ----------
        name : str
            Name of a JSON file, or of a directory with a summary.

        Raises
        ------
        UsageError
            The file is not from tdint, or contains no command line that writes a table.
        """
        from tdint.output.summary import told_of

        file = Path(name) / SUMMARY if is_folder(name) else Path(name)
        if not is_file(file):
            raise UsageError(f"{file}: file not found; specify the JSON file of a table")
        content = told_of(file)
        if not content:
            raise UsageError(f"{file}: must be a JSON file that tdint wrote with a table")
        command, given = _parsed(file, content.get("arguments"))
        arguments = content["arguments"]
        named = next(
            (
                item
                for item in command.params
                if isinstance(item.type, FileName) and item.type.tables
            ),
            None,
        )
        if named is None:
            raise UsageError(
                f"{file}: `arguments` name no command that writes a table: {' '.join(arguments)}"
            )
        output = given.get("output")
        if not isinstance(output, str) or output == STDIN:
            raise UsageError(f"{file}: `arguments` have no -o: {' '.join(arguments)}")
        # The export of a campaign is a second command line.
        export, both = content.get("export", ()), [(command, given)]
        if export:
            both.append(_parsed(file, export))
            if (
                command.name != "campaign"
                or export[0] != "campaign"
                or _words(both[1][1], "words")[:1] != ["export"]
            ):
                raise UsageError(
                    f"{file}: `export` must be a command line of `tdint campaign export`"
                )
        if any("\0" in word for words in (arguments, export) for word in words):
            raise UsageError(
                f"{file}: the command line contains a null character, which no file name can have"
            )
        # The file of a table has a suffix. A directory may have been given without a / at its end
        # if it existed.
        whole = Path(output).parts
        within = file.absolute().parent.parts[-len(whole) :] == whole if whole else False
        only = isinstance(named.type, FileName) and named.type.kind == "dir"
        to_folder = only or within or output.endswith(("/", os.sep)) or not Path(output).suffix
        try:
            inputs = {
                str(source["file"]): str(source["sha256"]) for source in content.get("inputs", ())
            }
            versions = dict(content.get("versions", {}))
            plugins = dict(versions.pop("plugins", {}))
        except (LookupError, TypeError, ValueError):
            raise UsageError(f"{file}: must be a JSON file that tdint wrote with a table") from None
        files = [name for line in both for name in _files(*line)]
        code = list(dict.fromkeys(name for _, line in both for name in _words(line, "plugins")))
        return cls(
            file,
            content,
            arguments,
            command,
            output,
            to_folder,
            inputs,
            versions,
            plugins,
            export,
            files,
            code,
        )

    @property
    def output_name(self) -> str:
        """Name of the table of -o, with any suffix; empty for a directory."""
        return "" if self.is_folder else Path(self.output).name

    def folder(self) -> Path:
        """Return the directory in which the command is repeated.

        The candidates are the original working directory, which follows from -o if the file has not
        been moved, and the current directory. The first one that contains all inputs is returned.

        Raises
        ------
        UsageError
            An input is not found in either directory.
        """
        typed = Path(self.output) if self.is_folder else Path(self.output).parent
        here = self.file.absolute().parent
        above = Path(*here.parts[: len(here.parts) - len(typed.parts)])
        # The original working directory cannot be found from a file that was moved.
        from_there = not typed.is_absolute() and ".." not in typed.parts and above / typed == here
        places = [above, Path.cwd()] if from_there else [Path.cwd()]
        missing = [name for name in self.inputs if not _is_there(places[0], name)]
        for place in places:
            if all(_is_there(place, name) for name in self.inputs):
                return place
        looked = " and ".join(dict.fromkeys(str(place) for place in places))
        raise UsageError(
            f"{missing[0]}: input of {self.file} not found in {looked}; run `tdint rerun` in the "
            "original working directory"
        )


def _parsed(file: Path, arguments: Any) -> tuple[click.Command, dict[str, Any]]:
    """Parse a recorded command line with click, without running it.

    Parameters
    ----------
    file : Path
        The JSON file, for messages.
    arguments : Any
        The command line after `tdint`.

    Returns
    -------
    command : Command
        The command.
    given : dict
        The text of each parameter that is specified.

    Raises
    ------
    UsageError
        The arguments are not a command line of tdint.
    """
    if (
        not isinstance(arguments, list)
        or not arguments
        or not all(isinstance(word, str) for word in arguments)
    ):
        raise UsageError(
            f"{file}: contains no command line (`arguments`), because an earlier version wrote it; "
            "run the original command again"
        )
    context = click.get_current_context().find_root()
    group = context.command
    assert isinstance(group, click.Group)
    command = group.get_command(context, arguments[0])
    if command is None:
        raise UsageError(
            f"{file}: `arguments` name no command that writes a table: {' '.join(arguments)}"
        )
    flags = {flag for parameter in command.params for flag in parameter.opts}
    parser = command.make_parser(
        click.Context(command, info_name=arguments[0], resilient_parsing=True)
    )
    given, _, typed = parser.parse_args(with_named_files(arguments[1:], flags))
    # The author of the file must not control where or how a command runs on this machine.
    refused = [
        "/".join(option.opts)
        for option in typed
        if isinstance(option, click.Option) and not is_recorded(option)
    ]
    if refused:
        raise UsageError(
            f"{file}: the recorded command line has {', '.join(dict.fromkeys(refused))}, which "
            "tdint does not record: the file was changed after it was written; remove the option "
            "from the file"
        )
    return command, given


def _files(command: click.Command, given: Mapping[str, Any]) -> Iterator[str]:
    """Yield the values on a command line for files that are read.

    Parameters
    ----------
    command : click.Command
        Command of the command line.
    given : mapping
        Values of the parameters of the command line, by parameter name.
    """
    for item in command.params:
        if isinstance(item.type, SampleUnitsType) or (
            isinstance(item.type, FileName) and not item.type.written
        ):
            yield from _words(given, item.name or "")


def _words(given: Mapping[str, Any], name: str) -> list[str]:
    """Return the texts of a parameter, which may be repeated; empty if it is not specified.

    click represents a missing value by a special object, which is not text.

    Parameters
    ----------
    given : mapping
        Values of the parameters of the command line, by parameter name.
    name : str
        Name of the parameter.
    """
    value = given.get(name)
    values = value if isinstance(value, list | tuple) else [value]
    return [word for word in values if isinstance(word, str)]


def _is_there(folder: Path, name: str) -> bool:
    """Return True if a file or the archive that contains it exists, or for standard input.

    Parameters
    ----------
    folder : Path
        Directory to which the name is relative.
    name : str
        Name of the file or of a member of an archive; '-' is standard input.
    """
    return name == STDIN or any(map(is_file, (folder / name, *(folder / name).parents)))


@dataclass
class _Elsewhere:
    """Replacement paths of the outputs of a command line, and the files to compare."""

    place: Path
    told: _Told
    folder: Path
    others: list[tuple[str, str]] = field(default_factory=list)
    """Outputs other than -o: the original name and the replacement."""

    def __call__(self, parameter: str, name: str, folder: bool) -> str:
        """Return the replacement for the name of an output.

        Parameters
        ----------
        parameter : str
            Name of the option.
        name : str
            The original name.
        folder : bool
            True if the name is a directory.

        Returns
        -------
        str
            The value of -o in the new directory; other outputs are in separate subdirectories.
        """
        end = os.sep if folder else ""
        if parameter == "output":
            instead = self.place / _last(name)
            return (
                name
                if Path(name) == instead
                else f"{instead}{os.sep if self.told.is_folder else ''}"
            )
        if name not in [
            moved for _, moved in self.others
        ]:  # a value can occur twice, as the original and as the replacement
            self.others.append((name, f"{self._apart / str(len(self.others)) / _last(name)}{end}"))
            return self.others[-1][1]
        return name

    @property
    def _apart(self) -> Path:
        return self.place / "others"

    @property
    def now(self) -> Path:
        """The directory that now contains the files that were next to the JSON file."""
        return self.place / _last(self.told.output) if self.told.is_folder else self.place

    @property
    def summary(self) -> Path:
        """The JSON file of the repeated command."""
        return self.now / self.told.file.name

    def files(self) -> Iterator[tuple[str, Path, Path]]:
        """Yield each file that was written: name, original path and new path."""
        places = [(self.now, self.told.file.absolute().parent)]
        places += [
            (Path(moved).parent, (self.folder / typed).parent) for typed, moved in self.others
        ]
        for now, before in places:
            for file in sorted(now.rglob("*")):
                apart = now == self.place and self._apart in file.parents
                if is_file(file) and not file.name.endswith(OF_STORE) and not apart:
                    name = file.relative_to(now)
                    yield str(name), before / name, file


def _last(name: str) -> str:
    """Return the last part of a path; 'output' for . and .., which have no name."""
    last = Path(name).name
    return "output" if last in ("", "..") else last


def _place_of_folder(told: _Told) -> int:
    """Return the index of the campaign directory in the command line of its export.

    Other arguments may be equal to it, for example in `export export`.
    """
    for place in range(1, len(told.export)):
        marked = [*told.export[:place], "\0", *told.export[place + 1 :]]
        if _words(_parsed(told.file, marked)[1], "words")[1:] == ["\0"]:
            return place
    raise UsageError(
        f"{told.file}: `export` must contain exactly one directory: {' '.join(told.export)}"
    )


def _carry_out(arguments: Sequence[str], folder: Path, moved: _Elsewhere) -> int:
    """Run a command line in its directory with replaced outputs and return its exit code.

    Parameters
    ----------
    arguments : sequence of str
        Words of the command line after `tdint`.
    folder : Path
        Working directory of the command.
    moved : _Elsewhere
        Replacement paths of the outputs.
    """
    settings = current()
    before = ELSEWHERE.set(moved)
    say(f"tdint {' '.join(arguments)}")
    try:
        with chdir(folder), Path(os.devnull).open("w") as nowhere, redirect_stdout(nowhere):
            click.get_current_context().find_root().command.main(
                list(arguments), "tdint", obj=Settings(debug=settings.debug, quiet=settings.quiet)
            )
    except SystemExit as end:
        code = end.code if isinstance(end.code, int) else 1
    finally:
        ELSEWHERE.reset(before)
    if code >= 128:  # a signal
        raise click.exceptions.Exit(code)
    return code


def _judge_inputs(others: Mapping[str, str], changed: bool) -> None:
    """Raise UsageError for changed inputs, or print a warning for each with --changed.

    Parameters
    ----------
    others : mapping of str to str
        Messages about the changed inputs, by name of the input.
    changed : bool
        True with --changed, which allows changed inputs.
    """
    if others and not changed:
        raise UsageError("\n".join([*others.values(), "add --changed to use the changed inputs"]))
    warn(*others.values())


def _otherwise(name: str, then: str | None, now: str | None) -> str:
    """Return a message about a changed input.

    Parameters
    ----------
    name : str
        Name of the input.
    then : str or None
        SHA-256 of the input in the recorded run; None if the recorded run did not read it.
    now : str or None
        Present SHA-256 of the input; None if it is not read now. If `then` is None, any nonempty
        text has the same effect.
    """
    if then is None or now is None:
        return (
            f"{name}: was {'not ' if then is None else ''}read by the recorded command, and is "
            f"{'' if now else 'not '}read now"
        )
    return f"{name}: has changed (SHA-256 recorded {then[:12]}..., now {now[:12]}...)"


def _compare(told: _Told, now: _Told, moved: _Elsewhere) -> bool:
    """Compare all files that the command has written, and how a run ended.

    Parameters
    ----------
    told, now : _Told
        The JSON file as it was stored, and as it is written now.
    moved : _Elsewhere
        The files that are written now.

    Returns
    -------
    bool
        True if all of them are the same, or equal within rounding.
    """
    measured = tables.methods.MEASURED if told.command.name == "chart" else ()
    same = True
    shown: list[Difference] = []
    written = list(moved.files())
    results = [before for _, before, _ in written if before != told.file.absolute()]
    for name, before, file in written:
        if not is_file(before):
            say(f"{name}: is written now, but the original file is missing ({before})")
            same = False
            continue
        is_table = name.lower().endswith(TABLES) or name == told.output_name
        text, is_same, differences = _compare_file(before, file, name, is_table, measured)
        say(text)
        shown += differences[: SHOWN - len(shown)]
        same = same and is_same
    # Files that were written then and are not written now cannot be compared.
    for file in _recorded_files(told) if told.is_folder else ():
        if file not in {before for _, before, _ in written}:
            say(f"{file.name}: not comparable: it was written originally, but is not written now")
            same = False
    # The status of a run can differ even if the peaks up to its end are equal.
    ends = [run.content.get("status") for run in (told, now)]
    if ends[0] != ends[1]:
        say(f"status of the run: recorded {ends[0]}, now {ends[1]}")
    elif ends[0] not in (None, "done"):
        say(f"status of the run: recorded {ends[0]}, now the same")
    loops = [run.content.get("time_loops") for run in (told, now)]
    if loops[0] != loops[1] and all(loops):
        note(f"time loops: recorded {loops[0]}, now {loops[1]}")
    if shown:
        emit_table(tables.table.Table.of_results(tables.differences.DIFFERENCE, shown))
    if same and not results and ends[0] in (None, "done"):
        raise AnalysisError(f"{told.file}: the command writes no file that can be compared")
    return same and ends[0] == ends[1]


def _compare_file(
    before: Path, now: Path, name: str, is_table: bool, measured: Sequence[str]
) -> tuple[str, bool, list[Difference]]:
    """Compare a file that was written then with the file that is written now.

    Parameters
    ----------
    before, now : Path
        The files.
    name : str
        Name of the file, for messages.
    is_table : bool
        True for a table; its name can have any suffix.
    measured : sequence of str
        Columns with measured times, which are not compared.

    Returns
    -------
    text : str
        The result of the comparison.
    is_same : bool
        True if the files are the same, or equal within rounding.
    differences : list of Difference
        The first differences.
    """
    if digest_of(before) == digest_of(now):
        return f"{name}: the same, byte for byte", True, []
    lower = name.lower()
    but = f" (not compared: {', '.join(measured)}, which are measured)" if measured else ""
    # All numbers of a chart except those of its table are measured, or derived from measured times;
    # its figure shows them.
    if measured and lower.endswith((*JSON, ".png", ".svg", ".pdf")):
        return f"{name}: not compared, because it contains measured times", True, []
    if lower.endswith(JSON):
        return _judge(name, tables.differences.json_differences(before, now), "value by value")
    if now.suffix == STORE.suffix:
        return _judge(name, _store_differences(before, now), "run by run")
    if is_table:
        differences = tables.differences.differences(before, now, but=measured)
        return _judge(name, differences, f"cell by cell{but}")
    return f"{name}: not comparable: its bytes differ, and it is not a table", False, []


def _judge(
    name: str, differences: Iterable[Difference], how: str
) -> tuple[str, bool, list[Difference]]:
    """Count the differences of two files and report the maximum; see `_compare_file`.

    Parameters
    ----------
    name : str
        Name of the file in the message.
    differences : iterable of Difference
        Differences between the recorded file and the new file.
    how : str
        Comparison method in the message, such as 'value by value'.
    """
    shown: list[Difference] = []
    rounded = count = 0
    largest: Difference | None = None
    for difference in differences:
        if difference.is_rounding:
            rounded += 1
            continue
        count += 1
        largest = max(largest or difference, difference, key=_size)
        shown += [difference] if len(shown) < SHOWN else []
    if not count:
        digits = f": {pluralize(rounded, 'number')} with different last digits" if rounded else ""
        text = f"equal within rounding{digits}" if rounded else f"the same, {how}"
        return f"{name}: {text}", True, []
    text = f"{name}: {pluralize(count, 'difference')}"
    if largest is not None and not math.isnan(largest.relative):
        row = "" if largest.row is None else f", row {largest.row}"
        text += f", at most {100.0 * largest.relative:.3g} % ({largest.column}{row})"
    return text, False, shown


def _store_differences(before: Path, now: Path) -> Iterator[Difference]:
    """Yield the differences of the rows in two stores: of runs, stories and events.

    Parameters
    ----------
    before : Path
        Store of the recorded run.
    now : Path
        Store of the repeated run.
    """
    from tdint.campaign.store_schema import (
        ROW_TABLES,
        check_store,
        connect_to_read,
        sqlite_errors_reported,
    )

    with TemporaryDirectory(prefix="tdint-rerun-") as folder, ExitStack() as stack:
        stores = []
        for file in (before, now):
            with sqlite_errors_reported(str(file)):
                stores.append(connect_to_read(file))
                stack.callback(stores[-1].close)
                check_store(stores[-1], str(file))
        for table in ROW_TABLES:
            files = [Path(folder, f"{table.name}-{place}.csv") for place in ("before", "now")]
            for file, store in zip(files, stores, strict=True):
                with (
                    sqlite_errors_reported(str(before)),
                    file.open("w", encoding="utf-8", newline="") as stream,
                ):
                    writer = csv.writer(stream)
                    writer.writerow(table.columns)
                    writer.writerows(store.execute(table.select()))
            for difference in tables.differences.differences(*files):
                yield replace(difference, file=f"{now.name}: {table.view}")


def _recorded_files(told: _Told) -> Iterator[Path]:
    """Yield the existing files in the directory that the JSON file or the store of a campaign lists
    as outputs of the command."""
    here = told.file.absolute().parent
    files, motions = (
        value if isinstance(value := told.content.get(key), list) else []
        for key in ("files", "motions")
    )
    names = [file.get("file") for file in files if isinstance(file, dict)]
    names += motions
    if is_file(here / STORE):
        from tdint.campaign.store import open_existing

        with open_existing(here) as store:
            names += sorted({name for name, _ in store.written()})
    for name in dict.fromkeys(name for name in names if isinstance(name, str)):
        # Figures and pages may be in other directories: only names without a directory are used.
        if name == Path(name).name and is_file(here / name):
            yield here / name


def _size(difference: Difference) -> float:
    """Return the value by which differences are ranked; differences of text are ranked last.

    Parameters
    ----------
    difference : Difference
        Difference between two values.
    """
    return -1.0 if math.isnan(difference.relative) else difference.relative
