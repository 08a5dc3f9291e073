"""`tdint rerun`: the command line in the JSON file beside a table, carried out again elsewhere;
tables compared."""

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
from tdint.output import tables
from tdint.output.printed import TRUSTED
from tdint.written_numbers import how_many
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
"""Of a folder that is given in place of its file."""

TABLES = (".csv", ".csv.gz", ".parquet")
"""Ends of the names of files that are compared cell by cell."""

JSON = (".json", ".geojson")
"""Ends of the names of files that are compared value by value."""

OF_STORE = ("-wal", "-shm", "-journal", ".lock")
"""Ends of the names of files that a campaign's store has while it is open; they have no results."""

STORE = Path("campaign.sqlite")
"""Name of the store of a campaign, which lists the files that were made of it. The runs in it are
compared, as are those of other stores of this suffix."""

SHOWN = 1000
"""Cells that the table of differences has at most: of a history of millions nobody reads more."""


@options.request
class Request:
    """The command line of `tdint rerun`."""

    file: str = options.argument("FILE.json|DIR", type=FileName())
    changed: bool = options.option(
        help="Also with inputs that are not those of then; they are named."
    )
    trust: bool = options.option(
        help="Also run code from files: plug-ins and style sheets, which may start programs. Read "
        "them first."
    )
    output: str | None = options.output.output(
        "DIR",
        "Keep what the command writes now, in this folder: a new or an empty one. Without it "
        "nothing is kept.",
        tables=False,
    )


@options.command(
    "rerun",
    "tdint rerun loop.json",
    "tdint rerun loop.json --changed -o again",
    exits={
        2: "other inputs, something needs --trust, or no command line in the file",
        5: "a file differs, or cannot be compared",
    },
)
@options.of(Request)
def command(request: Request) -> None:
    """Repeat a recorded command and compare its results.

    The file's `arguments` are carried out in the folder that they were typed in, with the installed
    version; whatever they write goes to another place, so that no file is replaced. DIR stands for
    DIR/summary.json. Every file that the command writes is compared: tables cell by cell, but for
    measured times, JSON files value by value, the store of a campaign run by run, motions, pictures
    and pages byte by byte. The exit code is 0 if all files are the same or equal within rounding
    (1e-9 of a number; of the peak for errors, residuals and histories). It is 5 if a file differs
    or cannot be compared, and a table of the cells that differ is written to standard output, with
    at most 1000 rows. Standard error reports each file, versions that differ, and whether the time
    loops were interpreted or compiled. What a campaign has exported is exported again.

    The inputs must be those of then, by SHA-256: models, records, tables, plug-ins. They are looked
    for from the folder in which the command was typed, if the file still lies where it was written,
    and then from this one. With --changed other inputs are named, and taken. A command that fails
    ends with its own exit code. Only commands that write tables are carried out, and every file
    that the command line names is looked at first; plug-ins, which are Python code, and style
    sheets, which may start programs, need --trust. Only options that tdint records are accepted:
    not --dask, --jobs and others that specify where or how a command runs.
    """
    told = _Told.read(request.file)
    folder = told.folder()
    # Files that are not what they were are known before the work; what lies in an archive, and
    # standard input, after.
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
    # Nothing that the command line names is opened by it, nor executed, that was not read then; but
    # a table of one record of several knows this one alone.
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
            f"{', '.join(missing)}: a plug-in of {told.file}, not found from {folder}; call `tdint "
            "rerun` in the folder that has it"
        )
    if told.code and not request.trust:
        named = ", ".join(f"{name} (SHA-256 {digest_of(folder / name)})" for name in told.code)
        raise UsageError(
            f"{told.file}: executes the Python code of {named}; read it, then give --trust"
        )
    with ExitStack() as stack:
        # What the command writes now goes into the folder of -o, or into one that goes in the end.
        if request.output is None:
            place = Path(stack.enter_context(TemporaryDirectory(prefix="tdint-rerun-")))
        else:
            place = Path(request.output).absolute()
            if is_there(place) and (not is_folder(place) or any(place.iterdir())):
                raise OutputError(
                    f"{request.output}: is there and not an empty folder; name a new one"
                )
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
                    f"{told.file}: the command writes no file of this name; give it back the one "
                    "that it had"
                )
            raise click.exceptions.Exit(code)
        # Inputs and plug-ins that are others, or that one of both runs alone has read
        again = _Told.read(str(moved.summary))
        then, today = ({**run.inputs, **run.plugins} for run in (told, again))
        names = sorted(
            name for name in {*then, *today} - {*others} if then.get(name) != today.get(name)
        )
        _judge_inputs(
            {name: _otherwise(name, then.get(name), today.get(name)) for name in names},
            request.changed,
        )
        # The version of tdint tells of its sources, too.
        for name in dict.fromkeys((*told.versions, *again.versions)):
            before, now = told.versions.get(name), again.versions.get(name)
            if name != "sources" and before != now:
                note(f"{name} {before or 'none'} then, {now or 'none'} now")
        same = _compare(told, again, moved)
        # A run that fails is recorded with its status, and fails again; no other failure is.
        failed_then = told.content.get("status") not in (None, "done")
    if code and not (failed_then and same):
        complain(f"Error: {told.file}: the command failed, with exit code {code}")
        raise click.exceptions.Exit(code)
    if not same:
        raise AnalysisError(f"{told.file}: the results differ from the stored results")


@dataclass(frozen=True)
class _Told:
    """What a JSON file beside a table says of how it came about.

    Attributes
    ----------
    file : Path
        The file.
    content : mapping
        All that it holds.
    arguments : sequence of str
        The command line behind `tdint`.
    command : Command
        The command, which has -o.
    output : str
        What was typed behind -o.
    is_folder : bool
        Whether that is a folder.
    inputs : dict
        SHA-256 of the files that were read, by name.
    versions : dict
        Of tdint and of what it computes with.
    plugins : dict
        SHA-256 of the plug-ins' files, by what is in them.
    export : sequence of str
        The command line of a campaign's export, which wrote the file last; empty if none did.
    files : sequence of str
        What is typed in both in the place of a file that is read, whether there is one or not.
    code : sequence of str
        Those among them that are executed.
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
        """Read the file, or that of a folder.

        Raises
        ------
        UsageError
            It is none of tdint, or says no command line that writes a table.
        """
        from tdint.output.summary import told_of

        file = Path(name) / SUMMARY if is_folder(name) else Path(name)
        if not is_file(file):
            raise UsageError(f"{file}: no such file; give the JSON file beside a table")
        content = told_of(file)
        if not content:
            raise UsageError(f"{file}: is no JSON file that tdint wrote beside a table")
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
        # The export of a campaign has no command line but that.
        export, both = content.get("export", ()), [(command, given)]
        if export:
            both.append(_parsed(file, export))
            if (
                command.name != "campaign"
                or export[0] != "campaign"
                or _words(both[1][1], "words")[:1] != ["export"]
            ):
                raise UsageError(f"{file}: `export` is no command line of `tdint campaign export`")
        # A table's file has a suffix; a folder that was there may have been named without a / at
        # its end.
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
            raise UsageError(f"{file}: is no JSON file that tdint wrote beside a table") from None
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
        """The name of the table that -o names, which may end in any way; empty for a folder."""
        return "" if self.is_folder else Path(self.output).name

    def folder(self) -> Path:
        """The folder that the command line was typed in: the one that its -o leads from, if the
        file still lies there, or else the working directory; the one that has the inputs.

        Raises
        ------
        UsageError
            An input is in neither.
        """
        typed = Path(self.output) if self.is_folder else Path(self.output).parent
        here = self.file.absolute().parent
        above = Path(*here.parts[: len(here.parts) - len(typed.parts)])
        # A file that was moved says nothing of where the command was typed.
        from_there = not typed.is_absolute() and ".." not in typed.parts and above / typed == here
        places = [above, Path.cwd()] if from_there else [Path.cwd()]
        missing = [name for name in self.inputs if not _is_there(places[0], name)]
        for place in places:
            if all(_is_there(place, name) for name in self.inputs):
                return place
        looked = " and ".join(dict.fromkeys(str(place) for place in places))
        raise UsageError(
            f"{missing[0]}: an input of {self.file}, is not there, seen from {looked}; call `tdint "
            "rerun` in the folder in which the command was typed"
        )


def _parsed(file: Path, arguments: Any) -> tuple[click.Command, dict[str, Any]]:
    """The command of a command line and what it is given, as words, found as click finds them;
    nothing is carried out.

    Raises
    ------
    UsageError
        It is no command line of tdint.
    """
    if (
        not isinstance(arguments, list)
        or not arguments
        or not all(isinstance(word, str) for word in arguments)
    ):
        raise UsageError(
            f"{file}: says no command line (`arguments`): an earlier version wrote it; call the "
            "command once more"
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
    # The author of the file must not choose where or how a command runs on this machine.
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
    """What stands on a command line in the place of files that are read."""
    for item in command.params:
        if isinstance(item.type, SampleUnitsType) or (
            isinstance(item.type, FileName) and not item.type.written
        ):
            yield from _words(given, item.name or "")


def _words(given: Mapping[str, Any], name: str) -> list[str]:
    """What a parameter is given, once or several times; click has a sign of its own for what is not
    given."""
    value = given.get(name)
    values = value if isinstance(value, list | tuple) else [value]
    return [word for word in values if isinstance(word, str)]


def _is_there(folder: Path, name: str) -> bool:
    """Whether a file, or the archive that it lies in, is there; of standard input nobody knows."""
    return name == STDIN or any(map(is_file, (folder / name, *(folder / name).parents)))


@dataclass
class _Elsewhere:
    """Where what a command line writes goes instead, and what it is compared with there."""

    place: Path
    told: _Told
    folder: Path
    others: list[tuple[str, str]] = field(default_factory=list)
    """What it writes beside -o: the name that was typed and the one instead."""

    def __call__(self, parameter: str, name: str, folder: bool) -> str:
        """The name for one that was typed: that of -o in the new place, others in folders of their
        own there."""
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
        ]:  # a value may come twice, as typed and moved
            self.others.append((name, f"{self._apart / str(len(self.others)) / _last(name)}{end}"))
            return self.others[-1][1]
        return name

    @property
    def _apart(self) -> Path:
        return self.place / "others"

    @property
    def now(self) -> Path:
        """The folder that now has what lay beside the JSON file."""
        return self.place / _last(self.told.output) if self.told.is_folder else self.place

    @property
    def summary(self) -> Path:
        """The JSON file there."""
        return self.now / self.told.file.name

    def files(self) -> Iterator[tuple[str, Path, Path]]:
        """Each file that was written: its name, where it was before, and where it is now."""
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
    """The last part of a path, which . and .. have none of."""
    last = Path(name).name
    return "output" if last in ("", "..") else last


def _place_of_folder(told: _Told) -> int:
    """Return the place of the campaign's folder in the words of its export, of which others may be
    the same: `export export`."""
    for place in range(1, len(told.export)):
        marked = [*told.export[:place], "\0", *told.export[place + 1 :]]
        if _words(_parsed(told.file, marked)[1], "words")[1:] == ["\0"]:
            return place
    raise UsageError(f"{told.file}: `export` names no single folder: {' '.join(told.export)}")


def _carry_out(arguments: Sequence[str], folder: Path, moved: _Elsewhere) -> int:
    """Run the command line in its folder, its data and outputs elsewhere; its exit code."""
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
    """Refuse other inputs, or name them."""
    if others and not changed:
        raise UsageError("\n".join([*others.values(), "--changed runs with the inputs of now"]))
    warn(*others.values())


def _otherwise(name: str, then: str | None, now: str | None) -> str:
    """What is to be said of an input that is another one."""
    if then is None or now is None:
        return (
            f"{name}: was {'not read' if then is None else 'read'} then, and is "
            f"{'' if now else 'not '}read now"
        )
    return f"{name}: is not what was read then (SHA-256 {then[:12]}..., now {now[:12]}...)"


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
            say(f"{name}: is written now, and not there where it was then ({before})")
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
            say(f"{file.name}: not comparable: it was written then, and is not written now")
            same = False
    # A run may end otherwise with the same peaks up to there.
    ends = [run.content.get("status") for run in (told, now)]
    if ends[0] != ends[1]:
        say(f"the run was {ends[0]} then, and is {ends[1]} now")
    elif ends[0] not in (None, "done"):
        say(f"the run was {ends[0]} then, and is so now")
    loops = [run.content.get("time_loops") for run in (told, now)]
    if loops[0] != loops[1] and all(loops):
        note(f"the time loops were {loops[0]} then, and are {loops[1]} now")
    if shown:
        emit_table(tables.table.Table.of_results(tables.differences.DIFFERENCE, shown))
    if same and not results and ends[0] in (None, "done"):
        raise AnalysisError(f"{told.file}: nothing of what the command writes can be compared")
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
        True for a table, whatever its name ends in.
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
    return f"{name}: not comparable: its bytes differ, and it is no table", False, []


def _judge(
    name: str, differences: Iterable[Difference], how: str
) -> tuple[str, bool, list[Difference]]:
    """Count the differences of two files and name the largest; see `_compare_file`."""
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
        digits = f": {how_many(rounded, 'number')} with other last digits" if rounded else ""
        text = f"equal within rounding{digits}" if rounded else f"the same, {how}"
        return f"{name}: {text}", True, []
    text = f"{name}: {how_many(count, 'difference')}"
    if largest is not None and not math.isnan(largest.relative):
        row = "" if largest.row is None else f", row {largest.row}"
        text += f", at most {100.0 * largest.relative:.3g} % ({largest.column}{row})"
    return text, False, shown


def _store_differences(before: Path, now: Path) -> Iterator[Difference]:
    """Yield the differences of the rows in two stores: of runs, stories and events."""
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
    """Yield the files that the command is known to have written into its folder, if they are there:
    its JSON file and the store of a campaign list them."""
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
        # Pictures and pages may be written to other folders; names there are those of files here.
        if name == Path(name).name and is_file(here / name):
            yield here / name


def _size(difference: Difference) -> float:
    """Return the number by which differences are ranked; words come last."""
    return -1.0 if math.isnan(difference.relative) else difference.relative
