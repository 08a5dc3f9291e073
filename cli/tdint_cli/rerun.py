"""`tdint rerun`: repeat the command line in the JSON file of a table and compare the results.

The outputs of the repeated command are written to another directory.
"""

from __future__ import annotations

import csv
import math
import os
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from contextlib import ExitStack, chdir, redirect_stdout
from dataclasses import dataclass, field, replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any

import click

from tdint.assessment import tables as assessment_tables
from tdint.errors import AnalysisError, OutputError, UsageError
from tdint.files import STDIN, digest_of, is_encodable, is_file, is_folder, is_there
from tdint.number_parsing import pluralize
from tdint.output import tables
from tdint.output.printed import TRUSTED
from tdint_cli import options
from tdint_cli.drawing import emit_table
from tdint_cli.options.grammar import is_recorded, with_named_files
from tdint_cli.options.option_types import ELSEWHERE, FileName, ListOf, SampleUnitsType
from tdint_cli.terminal import Settings, complain, current, note, say, warn

if TYPE_CHECKING:
    from tdint.output.tables.differences import Difference

SUMMARY = "summary.json"
"""Name of the JSON file that is read if the argument of `tdint rerun` is a directory."""

TABLES = (".csv", ".csv.gz", ".parquet")
"""Suffixes of files that are compared cell by cell."""

JSON = (".json", ".geojson")
"""Suffixes of files that are compared value by value."""

STORE_SUFFIXES = ("-wal", "-shm", "-journal", ".lock")
"""Suffixes of temporary files that exist while the store of a campaign is open. They contain no
results and are not compared."""

STORE = Path("campaign.sqlite")
"""Name of the store of a campaign, which lists the files that were exported from it. Stores with
this suffix are compared run by run."""

MAX_SHOWN = 1000
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
    ground motions, figures and pages byte by byte. The figure of `tdint chart` shows measured
    times, so that only its format is compared. Exports of a campaign are repeated. The exit
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
    recorded = _RecordedCommand.read(request.file)
    folder = recorded.folder()
    changes = _check_inputs(recorded, folder, request.changed)
    _check_plugins(recorded, folder, request.trust)
    with ExitStack() as stack:
        if request.output is None:
            new_folder = Path(stack.enter_context(TemporaryDirectory(prefix="tdint-rerun-")))
        else:
            new_folder = Path(request.output).absolute()
            if is_there(new_folder) and (not is_folder(new_folder) or any(new_folder.iterdir())):
                raise OutputError(f"-o {request.output}: must be a new or an empty directory")
        outputs = _NewOutputs(new_folder, recorded, folder)
        stack.callback(TRUSTED.reset, TRUSTED.set(request.trust))
        exit_code = _run_command(recorded.arguments, folder, outputs)
        # The files that `tdint campaign export` wrote later are repeated by a second command, in
        # the new directory of the campaign.
        if recorded.export and is_file(outputs.summary):
            index = _index_of_folder(recorded)
            export = [*recorded.export]
            export[index] = str(outputs.now)
            exit_code = exit_code or _run_command(export, folder, outputs)
        if not is_file(outputs.summary):
            if not exit_code:
                raise UsageError(
                    f"{recorded.file}: the repeated command has written no file named "
                    f"{outputs.summary.name}; if the JSON file was renamed, restore its original "
                    "name"
                )
            raise _report_failure(recorded, exit_code)
        repeated = _RecordedCommand.read(str(outputs.summary))
        _check_provenance(recorded, repeated, changes, request.changed)
        is_same = _compare(recorded, repeated, outputs)
        # Only `tdint run` records a failure, as the status of the run. Such a run must fail again.
        failed_before = recorded.content.get("status") not in (None, "done")
    if exit_code and not (failed_before and is_same):
        raise _report_failure(recorded, exit_code)
    if not is_same:
        raise AnalysisError(
            f"{recorded.file}: the results differ from the stored results; the messages above list "
            "the files"
        )


def _report_failure(recorded: _RecordedCommand, exit_code: int) -> click.exceptions.Exit:
    """Report that the repeated command failed; return an exception that exits with its exit
    code."""
    complain(f"Error: {recorded.file}: the command failed, with exit code {exit_code}")
    return click.exceptions.Exit(exit_code)


def _check_inputs(recorded: _RecordedCommand, folder: Path, changed: bool) -> dict[str, str]:
    """Compare the SHA-256 of the input files with the recorded values, before the run. A changed
    input is a warning if `changed` allows it, otherwise a UsageError.

    Members of archives and standard input are compared after the run.
    """
    changes: dict[str, str] = {}
    for name, digest in recorded.inputs.items():
        if name != STDIN and is_file(folder / name):
            current_digest = digest_of(folder / name)
            if current_digest != digest:
                changes[name] = _change_text(name, digest, current_digest)
    # The command line must not open or execute a file that the recorded run did not read. The JSON
    # file of one record of several lists only this record, so that only code is checked.
    is_one_of_several = recorded.is_folder and recorded.file.name != SUMMARY
    inputs = [os.path.realpath(folder / name) for name in recorded.inputs]
    for name in recorded.code if is_one_of_several else recorded.files:
        file = os.path.realpath(folder / name)
        # An input may be a member of an archive: its path then begins with the archive.
        is_recorded_input = any(path == file or path.startswith(file + os.sep) for path in inputs)
        if is_file(file) and not is_recorded_input:
            changes[name] = _change_text(name, None, file)
    _refuse_changes(recorded, changes, changed)
    return changes


def _check_plugins(recorded: _RecordedCommand, folder: Path, trust: bool) -> None:
    """Check the plug-ins of the recorded command before they are executed. UsageError is raised if
    a plug-in is missing, or the command has plug-ins and `trust` is false.
    """
    missing = [name for name in recorded.code if not is_file(folder / name)]
    if missing:
        raise UsageError(
            f"{', '.join(missing)}: plug-in of {recorded.file} not found in {folder}; run `tdint "
            "rerun` in the directory that contains it"
        )
    if recorded.code and not trust:
        files = ", ".join(f"{name} (SHA-256 {digest_of(folder / name)})" for name in recorded.code)
        raise UsageError(
            f"{recorded.file}: the command executes the Python code of {files}; read the code, "
            "then add --trust"
        )


def _check_provenance(
    recorded: _RecordedCommand,
    repeated: _RecordedCommand,
    known_changes: Collection[str],
    changed: bool,
) -> None:
    """Report the differences of inputs, plug-ins and versions between two runs, except changed
    inputs that are already reported (`known_changes`). A changed input or plug-in, also if only one
    of the runs has read it, is a warning if `changed` allows it, otherwise a UsageError.
    """
    before, now = ({**run.inputs, **run.plugins} for run in (recorded, repeated))
    changes = {
        name: _change_text(name, before.get(name), now.get(name))
        for name in sorted({*before, *now} - {*known_changes})
        if before.get(name) != now.get(name)
    }
    _refuse_changes(recorded, changes, changed)
    # The digest of the sources is omitted, because the version of tdint also identifies them.
    for name in dict.fromkeys((*recorded.versions, *repeated.versions)):
        version, new_version = recorded.versions.get(name), repeated.versions.get(name)
        if name != "sources" and version != new_version:
            note(
                f"the version of {name} is {new_version or 'unknown'}, but {version or 'unknown'} "
                "in the recorded run; if the results differ, repeat the run with the recorded "
                "version"
            )


@dataclass(frozen=True)
class _RecordedCommand:
    """The recorded command in the JSON file of a table.

    Attributes
    ----------
    arguments : sequence of str
        The command line after `tdint`.
    command : Command
        The command, which has the option -o.
    is_folder : bool
        True if the value of -o is a directory.
    inputs : dict
        SHA-256 of the files that were read, by name.
    versions : dict
        Versions of tdint and of the packages that it computes with.
    plugins : dict
        SHA-256 of the files of plug-ins, by the name of the method or law that they define.
    export : sequence of str
        The command line of the export of a campaign that wrote the file last; empty without export.
    files : sequence of str
        Values of both command lines for files that are read; the files need not exist.
    code : sequence of str
        Plug-ins in `files`, which contain code that is executed.
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
    def read(cls, name: str) -> _RecordedCommand:
        """Read a JSON file, or the summary in a directory.

        Raises
        ------
        UsageError
            The file is not from tdint, or contains no command line that writes a table.
        """
        from tdint.output.summary import stored_summary

        file = Path(name) / SUMMARY if is_folder(name) else Path(name)
        if not is_file(file):
            raise UsageError(f"{file}: file not found; specify the JSON file of a table")
        content = stored_summary(file)
        if not content:
            raise UsageError(f"{file}: must be a JSON file that tdint wrote with a table")
        command, values = _parsed(file, content.get("arguments"))
        arguments = content["arguments"]
        output_types = [item.type for item in command.params if isinstance(item.type, FileName)]
        output_type = next((item for item in output_types if item.tables), None)
        if output_type is None:
            raise UsageError(
                f"{file}: `arguments` name no command that writes a table: {' '.join(arguments)}; "
                "only such a command can be repeated"
            )
        output = values.get("output")
        if not isinstance(output, str) or output == STDIN:
            raise UsageError(
                f"{file}: `arguments` have no -o: {' '.join(arguments)}; only a command with an "
                "output file or directory can be repeated"
            )
        # The export of a campaign is a second command line.
        export, command_lines = content.get("export", ()), [(command, values)]
        if export:
            export_command, export_values = _parsed(file, export)
            command_lines.append((export_command, export_values))
            action = _texts(export_values, "arguments")[:1]
            if command.name != "campaign" or export[0] != "campaign" or action != ["export"]:
                raise UsageError(
                    f"{file}: `export` must be a command line of `tdint campaign export`"
                )
        if any("\0" in word for word in (*arguments, *export)):
            raise UsageError(
                f"{file}: the command line contains a null character, which no file name can have"
            )
        if not all(map(is_encodable, (*arguments, *export))):
            raise UsageError(
                f"{file}: the command line contains a character that cannot be encoded, which no "
                "file name can have"
            )
        try:
            inputs = {
                str(source["file"]): str(source["sha256"]) for source in content.get("inputs", ())
            }
            versions = dict(content.get("versions", {}))
            plugins = dict(versions.pop("plugins", {}))
        except (LookupError, TypeError, ValueError):
            raise UsageError(f"{file}: must be a JSON file that tdint wrote with a table") from None
        code = [
            name
            for _, values in command_lines
            for text in _texts(values, "plugins")
            for name in ListOf.members(text)
        ]
        return cls(
            file,
            content,
            arguments,
            command,
            output,
            output_type.path_type == "dir" or _is_folder_name(output, file),
            inputs,
            versions,
            plugins,
            export,
            files=[name for line in command_lines for name in _files(*line)],
            code=list(dict.fromkeys(code)),
        )

    @property
    def output_name(self) -> str:
        """Name of the table of -o, with any suffix; empty for a directory."""
        return "" if self.is_folder else Path(self.output).name

    def folder(self) -> Path:
        """Return the directory where the command is repeated.

        The candidates are the original working directory, which follows from -o if the file has not
        been moved, and the current directory. The first one that contains all inputs is returned;
        UsageError if neither does.
        """
        # The path of the JSON file is the original working directory followed by the relative
        # directory of -o, unless the file was moved.
        output_folder = Path(self.output) if self.is_folder else Path(self.output).parent
        file_folder = self.file.absolute().parent
        beginning = file_folder.parts[: len(file_folder.parts) - len(output_folder.parts)]
        original = Path(*beginning)
        is_relative = not output_folder.is_absolute() and ".." not in output_folder.parts
        candidates = [Path.cwd()]
        if is_relative and original / output_folder == file_folder:
            candidates.insert(0, original)
        for candidate in candidates:
            if all(_is_there(candidate, name) for name in self.inputs):
                return candidate
        missing = next(name for name in self.inputs if not _is_there(candidates[0], name))
        searched = " and ".join(dict.fromkeys(map(str, candidates)))
        raise UsageError(
            f"{missing}: input of {self.file} not found in {searched}; run `tdint rerun` in the "
            "original working directory"
        )


def _is_folder_name(output: str, file: Path) -> bool:
    """Return True if the value of -o is a directory.

    The file of a table has a suffix. A directory with a suffix ends with a slash, unless it existed
    before the command; the JSON file (`file`) is then in this directory.
    """
    if output.endswith(("/", os.sep)) or not Path(output).suffix:
        return True
    parts = Path(output).parts
    return bool(parts) and file.absolute().parent.parts[-len(parts) :] == parts


def _parsed(file: Path, arguments: Any) -> tuple[click.Command, dict[str, Any]]:
    """Parse a recorded command line (after `tdint`) with click, without running it. Return the
    command, and the text or list of texts of each parameter that is specified. UsageError is raised
    if this is not a command line of tdint.
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
    values, _, parameters = parser.parse_args(with_named_files(arguments[1:], flags))
    # Options that are not recorded specify where or how a command runs. The author of the file must
    # not control this on the machine of another user.
    refused = [
        "/".join(parameter.opts)
        for parameter in parameters
        if isinstance(parameter, click.Option) and not is_recorded(parameter)
    ]
    if refused:
        raise UsageError(
            f"{file}: the recorded command line has {', '.join(dict.fromkeys(refused))}, which "
            "tdint does not record: the file was changed after it was written; remove the option "
            "from the file"
        )
    return command, values


def _files(command: click.Command, values: Mapping[str, Any]) -> Iterator[str]:
    """Yield the names of the input files on a command line.

    `values` contains the values of the parameters of the command line, by parameter name.
    """
    for item in command.params:
        if isinstance(item.type, ListOf) and isinstance(item.type.item, FileName):
            for text in _texts(values, item.name or ""):
                yield from ListOf.members(text)
        if isinstance(item.type, SampleUnitsType) or (
            isinstance(item.type, FileName) and not item.type.written
        ):
            yield from _texts(values, item.name or "")


def _texts(values: Mapping[str, Any], name: str) -> list[str]:
    """Return the texts of a parameter, which may be repeated; empty if it is not specified.

    click represents a missing value by a special object, which is not text.
    """
    value = values.get(name)
    items = value if isinstance(value, list | tuple) else [value]
    return [item for item in items if isinstance(item, str)]


def _is_there(folder: Path, name: str) -> bool:
    """Return True if a file or the archive that contains it exists, or for standard input.

    `name` is the name of the file or of a member of an archive; '-' is standard input.
    """
    return name == STDIN or any(map(is_file, (folder / name, *(folder / name).parents)))


@dataclass
class _NewOutputs:
    """Replacement paths of the outputs of a command line, and the files to compare.

    Attributes
    ----------
    new_folder : Path
        Directory of all replacements.
    folder : Path
        Working directory of the command.
    others : list of (str, str)
        Outputs other than -o: the original name and the replacement.
    """

    new_folder: Path
    recorded: _RecordedCommand
    folder: Path
    others: list[tuple[str, str]] = field(default_factory=list)

    def __call__(self, parameter: str, name: str, folder: bool) -> str:
        """Return the new path that replaces the path of an output: the value of -o in the new
        directory; other outputs are in separate subdirectories.
        """
        # click can convert a value twice: a replacement is not replaced again.
        if parameter == "output":
            replacement = self.new_folder / _last_part(name)
            if Path(name) == replacement:
                return name
            return f"{replacement}{os.sep if self.recorded.is_folder else ''}"
        if name in [replacement for _, replacement in self.others]:
            return name
        path = self._others_folder / str(len(self.others)) / _last_part(name)
        self.others.append((name, f"{path}{os.sep if folder else ''}"))
        return self.others[-1][1]

    @property
    def _others_folder(self) -> Path:
        """The directory of the outputs other than -o."""
        return self.new_folder / "others"

    @property
    def now(self) -> Path:
        """New directory of the outputs that the recorded command wrote next to the JSON file."""
        if self.recorded.is_folder:
            return self.new_folder / _last_part(self.recorded.output)
        return self.new_folder

    @property
    def summary(self) -> Path:
        """The JSON file of the repeated command."""
        return self.now / self.recorded.file.name

    def files(self) -> Iterator[tuple[str, Path, Path]]:
        """Yield name, original path and new path of each file that the repeated command wrote."""
        # Each item contains a new directory and the original directory that it replaces.
        folders = [(self.now, self.recorded.file.absolute().parent)]
        for original, replacement in self.others:
            folders.append((Path(replacement).parent, (self.folder / original).parent))
        for new_folder, original_folder in folders:
            for file in sorted(new_folder.rglob("*")):
                # The directory of -o may contain the directory of the other outputs.
                is_other = new_folder == self.new_folder and self._others_folder in file.parents
                if is_file(file) and not file.name.endswith(STORE_SUFFIXES) and not is_other:
                    name = file.relative_to(new_folder)
                    yield str(name), original_folder / name, file


def _last_part(name: str) -> str:
    """Return the last part of a path; 'output' for . and .., which have no name."""
    last = Path(name).name
    return "output" if last in ("", "..") else last


def _index_of_folder(recorded: _RecordedCommand) -> int:
    """Return the index of the campaign directory in the command line of its export; UsageError if
    there is not exactly one.

    Other arguments may be equal to it, for example in `export export`. Each argument is therefore
    replaced by a null character, until the parser reports this character as the directory.
    """
    for index in range(1, len(recorded.export)):
        marked = [*recorded.export]
        marked[index] = "\0"
        if _texts(_parsed(recorded.file, marked)[1], "arguments")[1:] == ["\0"]:
            return index
    raise UsageError(
        f"{recorded.file}: `export` must contain exactly one directory: {' '.join(recorded.export)}"
    )


def _run_command(arguments: Sequence[str], folder: Path, outputs: _NewOutputs) -> int:
    """Run a command line (after `tdint`) in its directory with replaced outputs, without its
    standard output, and return its exit code. If a signal ends the command, `click.exceptions.Exit`
    with its exit code is raised, so that `tdint rerun` ends also.
    """
    settings = current()
    before = ELSEWHERE.set(outputs)
    say(f"tdint {' '.join(arguments)}")
    try:
        with chdir(folder), Path(os.devnull).open("w") as null_device, redirect_stdout(null_device):
            click.get_current_context().find_root().command.main(
                list(arguments), "tdint", obj=Settings(debug=settings.debug, quiet=settings.quiet)
            )
    # `main` always raises SystemExit, with an integer exit code.
    except SystemExit as end:
        code = end.code if isinstance(end.code, int) else 1
    finally:
        ELSEWHERE.reset(before)
    # An exit code from 128 means that a signal ended the command. It also ends this command.
    if code >= 128:
        raise click.exceptions.Exit(code)
    return code


def _refuse_changes(recorded: _RecordedCommand, changes: Mapping[str, str], changed: bool) -> None:
    """Raise UsageError for changed inputs, or print a warning for each with --changed.

    `changes` contains the messages about the changed inputs, by name of the input. `changed` is
    True with --changed, which allows changed inputs.
    """
    if changes and not changed:
        remedy = f"{recorded.file} records other inputs; add --changed to use the changed inputs"
        raise UsageError("\n".join([*changes.values(), remedy]))
    warn(*changes.values())


def _change_text(name: str, before: str | None, now: str | None) -> str:
    """Return a message about a changed input. A SHA-256 is None if the run (recorded, or now) did
    not read the input. If `before` is None, any nonempty `now` has the same effect.
    """
    # If a SHA-256 is missing, only one of the two runs has read the input.
    if before is None or now is None:
        return (
            f"{name}: was {'not ' if before is None else ''}read by the recorded command, and is "
            f"{'' if now else 'not '}read now"
        )
    return f"{name}: has changed (SHA-256 recorded {before[:12]}..., now {now[:12]}...)"


def _compare(recorded: _RecordedCommand, repeated: _RecordedCommand, outputs: _NewOutputs) -> bool:
    """Compare all files that the repeated command has written, and the status of the run. Return
    True if all files are the same, or equal within rounding, and the status is the same.

    The result for each file is printed, and a table of the first differences is written to standard
    output. AnalysisError is raised if the command writes no file that can be compared.
    """
    is_chart = recorded.command.name == "chart"
    loops, new_loops = (run.content.get("time_loops") for run in (recorded, repeated))
    # The JSON files of the same version of tdint have the same keys. Notes of interpreted time
    # loops differ from those of compiled ones, and charts have keys with measured times.
    is_same_version = recorded.versions.get("sources") == repeated.versions.get("sources")
    ignored_keys = assessment_tables.assessment.MEASURED_KEYS if is_chart else ()
    if loops != new_loops:
        ignored_keys = (*ignored_keys, "notes", "warnings")
    rules = _Rules(
        measured=assessment_tables.assessment.MEASURED if is_chart else (),
        is_same_version=is_same_version,
        ignored_keys=ignored_keys,
        original_paths={replacement: original for original, replacement in outputs.others},
    )
    is_same = True
    shown: list[Difference] = []
    files = list(outputs.files())
    own_folders = (recorded.file.absolute().parent, outputs.folder)
    for name, original, file in files:
        if not is_file(original):
            say(f"{name}: not compared, because the original file is missing ({original})")
            is_same = False
            continue
        # The author of the JSON file must not have the cells of other files printed.
        if not _is_inside(original, [original.parents[len(Path(name).parts) - 1]]):
            say(
                f"{name}: not compared, because {original} is a link to a file in another "
                "directory; replace the link by the file"
            )
            is_same = False
            continue
        if not _is_inside(original, own_folders) and digest_of(original) != digest_of(file):
            say(
                f"{name}: the bytes differ; the contents are not compared, because {original} is "
                "outside of the directory of the command"
            )
            is_same = False
            continue
        is_table = name.lower().endswith(TABLES) or name == recorded.output_name
        text, file_is_same, differences = _compare_file(original, file, name, is_table, rules)
        say(text)
        shown += differences[: MAX_SHOWN - len(shown)]
        is_same = is_same and file_is_same
    # Original files that are not written now cannot be compared.
    originals = {original for _, original, _ in files}
    for file in _recorded_files(recorded):
        if file not in originals:
            say(f"{file.name}: not compared, because the repeated command did not write this file")
            is_same = False
    # The status of a run can differ even if the peaks up to its end are equal.
    status, new_status = (run.content.get("status") for run in (recorded, repeated))
    if status != new_status:
        say(f"status of the run: recorded {status}, now {new_status}")
    elif status not in (None, "done"):
        say(f"status of the run: recorded {status}, now the same")
    if loops and new_loops and loops != new_loops:
        note(f"time loops: recorded {loops}, now {new_loops}")
    if shown:
        emit_table(tables.table.Table.of_results(tables.differences.DIFFERENCE, shown))
    # If only the JSON file was compared, the results were not compared. A failed run is an
    # exception, because it writes no other file.
    has_results = any(original != recorded.file.absolute() for original in originals)
    if is_same and not has_results and status in (None, "done"):
        raise AnalysisError(f"{recorded.file}: the command writes no file that can be compared")
    return is_same and status == new_status


def _is_inside(file: Path, folders: Iterable[Path]) -> bool:
    """Return True if a file, with links resolved, is in one of the directories."""
    real = Path(os.path.realpath(file))
    return any(real.is_relative_to(os.path.realpath(folder)) for folder in folders)


@dataclass(frozen=True)
class _Rules:
    """Rules for the comparison of the files of a command.

    Attributes
    ----------
    measured : tuple of str
        Columns of tables with measured times, which are not compared.
    is_same_version : bool
        True if the same version of tdint has written both results. The keys of JSON files must then
        be the same.
    ignored_keys : tuple of str
        Keys of JSON files that are not compared.
    original_paths : mapping of str to str
        Original paths of outputs, by the paths that replace them in the repeated command.
    """

    measured: tuple[str, ...]
    is_same_version: bool
    ignored_keys: tuple[str, ...]
    original_paths: Mapping[str, str]


def _compare_file(
    before: Path, now: Path, name: str, is_table: bool, rules: _Rules
) -> tuple[str, bool, list[Difference]]:
    """Compare an original file with the file that is written now, by rules that name columns and
    keys that are not compared. Return a text with the result, True if the files are the same or
    equal within rounding, and the first differences.
    """
    if digest_of(before) == digest_of(now):
        return f"{name}: the same, byte for byte", True, []
    lower = name.lower()
    measured, keys = rules.measured, rules.ignored_keys
    # The figure of a chart shows measured times, so that its bytes differ.
    if measured and lower.endswith((".png", ".svg", ".pdf")):
        if _first_bytes(before) != _first_bytes(now):
            return f"{name}: not comparable: it is not a figure of this format", False, []
        text = "only the format was compared, because the figure shows measured times"
        return f"{name}: {text}", True, []
    if lower.endswith(JSON):
        differences = tables.differences.json_differences(
            before,
            now,
            is_same_version=rules.is_same_version,
            ignored_keys=keys,
            original_paths=rules.original_paths,
        )
        exception = f" (not compared: {', '.join(keys)})" if keys else ""
        return _summarize_differences(name, differences, f"value by value{exception}")
    if now.suffix == STORE.suffix:
        return _summarize_differences(name, _store_differences(before, now), "run by run")
    if is_table:
        differences = tables.differences.differences(before, now, but=measured)
        exception = f" (not compared: {', '.join(measured)}, measured times)" if measured else ""
        return _summarize_differences(name, differences, f"cell by cell{exception}")
    return f"{name}: not comparable: its bytes differ, and it is not a table", False, []


def _first_bytes(file: Path) -> bytes:
    """Return the first five bytes of a figure, which identify its format."""
    try:
        with file.open("rb") as stream:
            return stream.read(5)
    except OSError as error:
        raise OutputError(f"{file}: cannot be read: {error.strerror}") from None


def _summarize_differences(
    name: str, differences: Iterable[Difference], manner: str
) -> tuple[str, bool, list[Difference]]:
    """Count the differences of two files and find the maximum. Return a text with the result and
    the manner of the comparison (such as 'value by value'), True if the files are the same or equal
    within rounding, and the first other differences.
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
        if len(shown) < MAX_SHOWN:
            shown.append(difference)
    if not count and rounded:
        numbers = pluralize(rounded, "number")
        text = f"equal within rounding: {numbers} with different last digits"
        return f"{name}: {text}", True, []
    if not count:
        return f"{name}: the same, {manner}", True, []
    text = f"{name}: {pluralize(count, 'difference')}"
    if largest is not None and not math.isnan(largest.relative):
        row = "" if largest.row is None else f", row {largest.row}"
        text += f", at most {100.0 * largest.relative:.3g} % ({largest.column}{row})"
    return text, False, shown


def _store_differences(before: Path, now: Path) -> Iterator[Difference]:
    """Yield the differences of the rows in two stores: of runs, stories and events."""
    from tdint.studies.store_schema import (
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
            # Write the rows of both stores to CSV files, which can be compared cell by cell.
            files = [Path(folder, f"{table.name}-{run}.csv") for run in ("before", "now")]
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


def _recorded_files(recorded: _RecordedCommand) -> Iterator[Path]:
    """Yield the existing outputs of a recorded command in the directory of its JSON file.

    The JSON file and the store of a campaign list the names of the outputs.
    """
    folder = recorded.file.absolute().parent
    # `files` is a list of mappings with the key `file`, and `motions` a list of names. The content
    # may have been changed: ignore values of other types.
    files, motions = recorded.content.get("files"), recorded.content.get("motions")
    names: list[Any] = []
    if isinstance(files, list):
        names += [file.get("file") for file in files if isinstance(file, dict)]
    if isinstance(motions, list):
        names += motions
    if is_file(folder / STORE):
        from tdint.studies.store_opening import open_existing

        with open_existing(folder) as store:
            names += sorted({name for name, _ in store.written()})
    for name in dict.fromkeys(name for name in names if isinstance(name, str)):
        # Figures and reports may be in other directories. Only names without a directory refer to
        # files next to the JSON file.
        if name == Path(name).name and is_file(folder / name):
            yield folder / name


def _size(difference: Difference) -> float:
    """Return the relative size of a difference, or -1 for texts, which have no size."""
    return -1.0 if math.isnan(difference.relative) else difference.relative
