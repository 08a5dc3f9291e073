"""Read and write files.

Files are written completely or not at all: under a temporary name in the same directory, and
renamed after all files have been written. A journal in the directory lists the files that are
renamed together: if the process is killed, the next command completes the renaming (`settle`). The
journal is signed with a key of the user: that of somebody else has no effect.
"""

from __future__ import annotations

import errno
import glob
import json
import logging
import os
import re
import stat
import sys
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager, suppress
from contextvars import ContextVar
from functools import cache
from io import BytesIO
from pathlib import Path
from typing import BinaryIO, NamedTuple

from tdint.errors import OutputError, TdintError
from tdint.system import (
    hold_signals,
    is_running,
    is_special,
    locked,
    process_start,
    this_host,
    user_key,
)

_log = logging.getLogger(__name__)

# ---- Read an input, which is a file or standard input, up to a maximum size. Inputs that may never
# end are refused.

STDIN = "-"
"""Name of standard input."""

MOST_BYTES = 2**28
"""Maximum size of a file, bytes (256 MiB)."""

_BYTES_PER_READ = 2**20  # 1 MiB; the cost of calls is negligible, and memory use is small

INPUT_DIGESTS: ContextVar[dict[str, str] | None] = ContextVar("input_digests", default=None)
"""SHA-256 of the inputs that the present command has read, by name. None if inputs are not
recorded, as in a Python session.
"""

PROTECTED: ContextVar[dict[tuple[int, int], str] | None] = ContextVar("protected", default=None)
"""Names of the files that the present command reads, by device and inode. The command does not
replace these files, even under another name (link). None if inputs are not protected, as in a
Python session.
"""


def protect_input(source: str | Path) -> None:
    """Protect an input file from being replaced by an output of the command.

    `-` is the file that standard input is redirected from. Inputs that are not regular files, such
    as pipes, need no protection.
    """
    settle(Path(source).parent, is_read=True)
    protected = PROTECTED.get()
    if protected is None:
        return
    # If no file has this name, or if standard input is closed, these calls raise an error. It is
    # ignored here, because reading the input will report it.
    with suppress(OSError, ValueError, AttributeError):
        status = os.fstat(sys.stdin.fileno()) if str(source) == STDIN else Path(source).stat()
        if stat.S_ISREG(status.st_mode):
            protected[status.st_dev, status.st_ino] = str(source)


def is_protected(file: str | Path) -> bool:
    """Return True if a path, with links resolved, is a file that this command reads."""
    try:
        status = Path(file).stat()
        name = (PROTECTED.get() or {}).get((status.st_dev, status.st_ino))
        # If the input was deleted in the meantime, its inode may belong to another file now.
        return name is not None and (name == STDIN or Path(name).samefile(file))
    except (OSError, ValueError):
        return False


def record_digest(source: str | Path, content: bytes | Callable[[], str]) -> None:
    """Record that the command has read an input, for the list of inputs in its results.

    The file is also protected from being replaced by an output (`protect_input`).

    Parameters
    ----------
    source : str or Path
        Name of the file; `-` is standard input.
    content : bytes or callable
        Content of the file, or, for large files, a function that returns its SHA-256. The function
        is not called if inputs are not recorded.
    """
    protect_input(source)
    digests = INPUT_DIGESTS.get()
    if digests is not None:
        from hashlib import sha256

        digests[str(source)] = (
            sha256(content).hexdigest() if isinstance(content, bytes) else content()
        )


def read_at_most(source: str | Path, most: int, error: type[TdintError]) -> bytes:
    """Read at most `most` + 1 bytes of a file. The additional byte shows that the file is larger.

    Parameters
    ----------
    source : str or Path
        Path, or `-` for standard input.
    most : int
        Maximum size, bytes.

    Raises
    ------
    TdintError
        Exception of type `error`: the file is a named pipe, or standard input is closed.
    OSError, ValueError
        The file cannot be read, or its name is invalid. Callers convert these exceptions.
    """
    if str(source) != STDIN:
        if is_named_pipe(source):
            raise error(
                f"{source}: this is a named pipe, which may never end; use - and redirect it with <"
            )
        protect_input(source)
        with Path(source).open("rb") as file:
            return _read(file, most)
    stream = getattr(sys.stdin, "buffer", None)
    if stream is None:
        raise error(f"{STDIN}: standard input is closed; specify a file")
    return _read(stream, most)


def read_whole(
    source: str | Path,
    error: type[TdintError],
    messages: Mapping[type[Exception], str],
    too_large_text: str,
    most: int,
) -> bytes:
    """Read a file that must not be larger than `most` bytes.

    Parameters
    ----------
    messages : mapping of type to str
        Messages for exceptions of the operating system, by the type of the exception. Other
        exceptions are reported with the message of the operating system.
    too_large_text : str
        Message if the file is too large.

    Raises
    ------
    TdintError
        Exception of type `error`: the file cannot be read, or is too large.
    """
    try:
        # A file of a known size is refused before it is read.
        if str(source) != STDIN and is_file(source) and Path(source).stat().st_size > most:
            raise error(f"{source}: {too_large_text}")
        data = read_at_most(source, most, error)
    except (OSError, ValueError) as exception:
        reason = f"cannot be read: {getattr(exception, 'strerror', None) or exception}"
        for exception_type, message in messages.items():
            if isinstance(exception, exception_type):
                reason = message
                break
        raise error(f"{source}: {reason}") from None
    if len(data) > most:
        raise error(f"{source}: {too_large_text}")
    return data


@cache
def declared_rows(module: str) -> tuple[dict[str, str], ...]:
    """Return the rows of the CSV file of a module, which declares facts such as keys or columns.

    `module` is the path of the module (`__file__`), or that of the file if it has another name.
    """
    import csv  # not needed by `tdint --version`

    with Path(module).with_suffix(".csv").open(encoding="utf-8", newline="") as stream:
        return tuple(csv.DictReader(stream))


def _read(file: BinaryIO, most: int) -> bytes:
    """Read a binary stream to its end, or until more than `most` bytes have been read.

    The stream is read in blocks, so that reading an endless device stops, and so that memory is
    allocated only for the bytes that exist.
    """
    content = BytesIO()
    while content.tell() <= most and (block := file.read(_BYTES_PER_READ)):
        content.write(block)
    return content.getvalue()  # without a copy


def is_named_pipe(source: str | Path) -> bool:
    """Return True if a path is a named pipe (FIFO), which may block when it is opened.

    The result is False for the pipes of a shell (`<(command)`), which end with their command.
    """
    if str(source).startswith(("/dev/fd/", "/proc/")):  # names of the pipes of a shell
        return False
    try:
        return stat.S_ISFIFO(Path(source).stat().st_mode)
    except (OSError, ValueError):  # the caller opens the file next, which reports the error
        return False


def is_folder(name: str | Path) -> bool:
    """Return True if a path is a directory; False also for invalid names, for example too long."""
    return os.path.isdir(name)  # noqa: PTH112  Path.is_dir raises an error for names too long


def is_there(name: str | Path) -> bool:
    """Return True if a file or directory exists; False also for invalid names."""
    return os.path.exists(name)  # noqa: PTH110  Path.exists raises an error for names too long


_WILDCARDS = r"[*?[]"


def pattern_of(argument: str) -> str:
    """Return a pattern of file names where the wildcards in the name of an existing directory,
    such as `dir [2024]/*.AT2`, have no special meaning."""
    folder = argument
    while folder and not is_folder(folder):
        folder = os.path.dirname(folder)  # noqa: PTH120  keeps the user's spelling
    return glob.escape(folder) + argument[len(folder) :]


def is_set(argument: str) -> bool:
    """Return True if an argument may be several files: a directory or a pattern."""
    if is_folder(argument):
        return True
    plain = re.sub(r"\[[*?[]\]", "", pattern_of(argument))  # without escaped wildcards
    return bool(re.search(_WILDCARDS, plain) and not is_there(argument))


def is_file(name: str | Path) -> bool:
    """Return True if a path is a file; False also for invalid names."""
    return os.path.isfile(name)  # noqa: PTH113  Path.is_file raises an error for names too long


def is_encodable(text: str) -> bool:
    """Return True if a text can be the name of a file: no character is a surrogate without a
    meaning, which results from invalid escapes in JSON files, or missing in the encoding of the
    locale. Bytes of file names that are not UTF-8 are allowed."""
    try:
        os.fsencode(text)
    except UnicodeEncodeError:
        return False
    return True


# ---- Files

Writer = Callable[[BinaryIO], object]
"""Function that writes the content of one file to a stream."""

Content = bytes | Writer
"""Content of a file, or the function that writes it."""

_COMPRESSION_LEVEL = 4
"""Compression level of gzip. A response history is a few percent larger than with the usual level
9, and is written in a third of the time."""

_TEMPORARY = ".tdint-{}.tmp"
_TEMPORARY_PATTERN = r"\.tdint-(?P<host>.+)-(?P<process>\d+)-(?P<start>\d+)-[0-9a-f]{16}\.tmp"
"""Name of a temporary file with host, process and start time of the writer."""

# Temporary files of all threads, which are removed if another thread ends the process
_unfinished: set[Path] = set()


def check_outputs(files: Iterable[Path], *, overwrite: bool) -> None:
    """Check that files can be written, before the results are computed.

    Raises
    ------
    OutputError
        A file is an input of the command, exists already, is a directory, is in a read-only
        directory, is a symbolic link out of its directory, or is named twice. Missing directories
        are not errors, because `write_files` creates them.
    """
    seen: set[str] = set()
    for file in files:
        if "\0" in str(file):
            raise OutputError(f"{file!s:.40}: a file name must not contain a null character")
        with _as_output_error(file):
            real = os.path.realpath(file)
            if real in seen:
                raise OutputError(f"{file}: two outputs have this file name; rename one of them")
            seen.add(real)
            settle(Path(real).parent)
            refuse_protected([file])
            if file.is_symlink() and not Path(real).is_relative_to(os.path.realpath(file.parent)):
                # The directory and its links may come from somebody else.
                raise OutputError(
                    f"{file}: this is a symbolic link out of its directory; remove it, or specify "
                    f"{real}"
                )
            folder = _nearest_folder(file)
            if not is_folder(folder):
                raise OutputError(f"{file}: {folder} is a file, not a directory")
            if not os.access(folder, os.W_OK | os.X_OK):
                raise OutputError(f"{file}: no permission to write to the directory {folder}")
            # The file is examined once: another process can remove or replace it at any time.
            try:
                mode = file.stat().st_mode
            except OSError as error:
                if error.errno not in (errno.ENOENT, errno.ENOTDIR, errno.ELOOP):
                    raise
                continue
            if stat.S_ISDIR(mode):
                raise OutputError(f"{file}: this is a directory; specify a file")
            if not stat.S_ISREG(mode):
                raise OutputError(f"{file}: this is a device or a pipe; specify a regular file")
            if not overwrite:
                raise _exists(file)


def refuse_protected(files: Iterable[Path]) -> None:
    """Raise OutputError if a file to be replaced or removed is an input of the command."""
    for file in files:
        if is_protected(file):
            raise OutputError(
                f"{file}: this command reads the file and cannot overwrite it; use another file "
                "name"
            )


def write_files(
    contents: Mapping[Path, Content],
    *,
    overwrite: bool,
    stale: Mapping[Path, str] | None = None,
    on_written: Callable[[Mapping[Path, str]], None] | None = None,
    last: tuple[Path, Callable[[Mapping[Path, str]], bytes]] | None = None,
    complete: Mapping[Path, Path] | None = None,
) -> None:
    """Write files completely or not at all, in the given order. Missing directories are created.

    All files are written under temporary names first and renamed afterwards. After an error or a
    signal before that, the directory is unchanged; a signal during the renaming is handled after
    it. If the process is killed during the renaming, the next command that reads or writes in the
    directory completes it (`settle`). The files that several new files replace are removed before
    the first of these is renamed: new files are never next to earlier files. Symbolic links within
    a directory are followed. Temporary files of killed processes are removed from the directories.

    `contents` is the content of each file, or a function that writes it to a binary stream. `stale`
    contains files of an earlier run that are not part of the new results, with their SHA-256; with
    `overwrite`, they are removed if their content is unchanged, or always if the SHA-256 is empty.
    `complete` contains files that are complete under another name in their directory, and are
    renamed with the new files. `on_written` receives the SHA-256 of each file before the files are
    renamed. `last` is an additional file, and the function that returns its content from the
    SHA-256 of all other files.

    Raises
    ------
    OutputError
        A file cannot be written.
    """
    check_outputs([*contents, *([last[0]] if last else ())], overwrite=overwrite)
    new_folders: list[Path] = []
    temporaries: dict[Path, Path] = {}

    def write(file: Path, content: Content) -> None:
        """Write the content to a temporary file in the directory of `file`; see `temporaries`."""
        new_folders.extend(_make_folders(file.parent))
        temporary = Path(os.path.realpath(file)).with_name(_temporary_name())
        temporaries[file] = temporary
        _unfinished.add(temporary)
        with _as_output_error(file), temporary.open("xb") as stream:
            _write(file, content, stream)

    def digests() -> dict[Path, str]:
        """Return the SHA-256 of each file that has been written under its temporary name."""
        return {file: digest_of(temporary) for file, temporary in temporaries.items()}

    try:
        for file, content in contents.items():
            write(file, content)
        if last:
            write(last[0], last[1](digests()))
        if on_written:
            on_written(digests())
        ready = {**temporaries, **(complete or {})}
        removed = _removable(stale or {}, ready) if overwrite else []
        folders = {temporary.parent for temporary in temporaries.values()}
        with hold_signals():
            _rename_together(ready, removed, overwrite, on_commit=temporaries.clear)
    except BaseException:
        for temporary in temporaries.values():
            with suppress(OSError):
                temporary.unlink()
        for folder in reversed(new_folders):
            with suppress(OSError):  # not empty: it contains a renamed file
                folder.rmdir()
        raise
    finally:
        _unfinished.difference_update(temporaries.values())
    for folder in folders:
        remove_abandoned(folder)


def _removable(stale: Mapping[Path, str], ready: Mapping[Path, Path]) -> list[Path]:
    """Return the files of an earlier run with unchanged content (SHA-256) that would not match the
    new files, `ready`."""
    new_files = {os.path.realpath(file) for file in ready}
    return [
        file
        for file, digest in stale.items()
        if os.path.realpath(file) not in new_files
        and not file.is_symlink()
        and file.is_file()
        and not is_protected(file)
        and digest in ("", digest_of(file))
    ]


# ---- Journal of the files that are renamed together. The journal of a directory is also the lock
# of the renaming in this directory. It lists names in the same directory, and is signed with a key
# of the user: somebody else may have made the directory. If the files are in several directories,
# the journal of the first directory is written last: it makes the other journals valid.

_JOURNAL = ".tdint-journal"

_MOST_BYTES_OF_JOURNAL = 2**24  # 16 MiB, more than a hundred thousand names


class _Journal(NamedTuple):
    """Content of a journal.

    Attributes
    ----------
    identifier : str
        Common text of the journals that belong together.
    folders : list of str
        Their directories. The journal of the first directory is written last; the other journals
        are not valid before.
    renamed : dict of str to str
        Temporary and final names.
    removed : list of str
        Names of files to be removed.
    overwrite : bool
        True if existing files are replaced.
    """

    identifier: str
    folders: list[str]
    renamed: dict[str, str]
    removed: list[str]
    overwrite: bool


def _rename_together(
    ready: Mapping[Path, Path],
    removed: Sequence[Path],
    overwrite: bool,
    on_commit: Callable[[], object],
) -> None:
    """Rename files to their final names, and remove `removed`. `on_commit` is called as soon as the
    temporary files must not be removed after an error, because a later call completes the
    renaming."""
    if len(ready) == 1 and not removed:
        ((file, temporary),) = ready.items()
        _move(temporary, Path(os.path.realpath(file)), overwrite)
        return
    changes: dict[str, tuple[dict[str, str], list[str]]] = {}
    for file, temporary in ready.items():
        folder, target = os.path.realpath(temporary.parent), Path(os.path.realpath(file))
        # The store of a campaign replaces a symbolic link to another directory.
        name = target.name if str(target.parent) == folder else file.name
        changes.setdefault(folder, ({}, []))[0][temporary.name] = name
    for file in removed:
        changes.setdefault(os.path.realpath(file.parent), ({}, []))[1].append(file.name)
    # Directories are locked in the order of their names, so that two processes cannot block each
    # other.
    folders, identifier = sorted(changes), os.urandom(8).hex()
    journals = {
        Path(folder): _Journal(identifier, folders, *changes[folder], overwrite)
        for folder in folders
    }
    with ExitStack() as stack:
        for file in (folder / _JOURNAL for folder in journals):
            stack.enter_context(locked(file, on_wait=lambda: None))
            if is_there(file) and file.stat().st_size:
                raise OutputError(_foreign_journal(file))
        try:
            for file in () if overwrite else ready:
                if file.exists():
                    raise _exists(file)
            if overwrite:  # the earlier files are removed before the new files are renamed
                for file, temporary in ready.items():
                    with _as_output_error(file):
                        _flush(temporary)
            for folder in reversed(folders):
                file = Path(folder) / _JOURNAL
                with _as_output_error(file):
                    file.touch()
                    text = json.dumps(journals[Path(folder)]).encode()
                    _flush(file, _signature(text) + b"\n" + text)
        except BaseException:
            # No file has been renamed. Without the first journal, the other journals are not valid.
            for folder in folders:
                with suppress(OSError):
                    (Path(folder) / _JOURNAL).unlink(missing_ok=True)
            raise
        _unfinished.difference_update(ready.values())
        on_commit()
        _carry_out(journals)


def _flush(file: Path, content: bytes | None = None) -> None:
    """Write the content of a file to the disk. With `content`, this is its new content."""
    with file.open("r+b" if content is None else "wb") as stream:
        stream.write(content or b"")
        stream.flush()
        os.fsync(stream.fileno())


def _carry_out(journals: dict[Path, _Journal]) -> None:
    """Remove and rename the files of journals, and remove the journals, the first journal last. An
    interrupted call can be repeated: files without a temporary file have been renamed.

    Raises
    ------
    OutputError
        A file cannot be removed or renamed, or exists although it must not be replaced. The other
        files have been renamed.
    """
    failure: OutputError | None = None
    renamed = [
        (folder / temporary, folder / name, journal.overwrite)
        for folder, journal in journals.items()
        for temporary, name in journal.renamed.items()
        if is_there(folder / temporary)
    ]
    removed = [folder / name for folder, journal in journals.items() for name in journal.removed]
    replaced = [file for _, file, overwrite in renamed if overwrite] if len(renamed) > 1 else []
    for file in (*replaced, *removed):
        with _as_output_error(file):
            file.unlink(missing_ok=True)
    for temporary, file, overwrite in renamed:
        try:
            _move(temporary, file, overwrite)
        except OutputError as error:
            failure = failure or error
            if not overwrite:
                temporary.unlink(missing_ok=True)
    if failure is None or not all(overwrite for _, _, overwrite in renamed):
        for folder in reversed(journals):
            with _as_output_error(folder / _JOURNAL):
                (folder / _JOURNAL).unlink(missing_ok=True)
    if failure:
        raise failure


def settle(folder: Path, *, is_read: bool = False) -> None:
    """Complete the renaming of files in a directory that a killed command has started, or remove
    its journal if the journal is not complete.

    This has no effect while the command is running, or if the directory cannot be written. With
    `is_read`, the command does not write to the directory; a journal without a signature of this
    user is then reported, and remains.

    Raises
    ------
    OutputError
        The command writes to the directory, and its journal has no signature of this user.
    """

    def refuse() -> None:
        """Raise an error, because the command of the journal is running."""
        raise BlockingIOError

    if not os.path.lexists(folder / _JOURNAL):
        return
    folder = Path(os.path.realpath(folder))
    own = _read_journal(folder)
    # The directory of a single journal may have another name now.
    folders = [Path(name) for name in own.folders] if own and len(own.folders) > 1 else [folder]
    journals = {}
    is_foreign = False
    with suppress(OSError, OutputError), ExitStack() as stack:
        for name in folders:
            stack.enter_context(locked(name / _JOURNAL, on_wait=refuse, create=False))
            journal = _read_journal(name)
            if journal and own and journal.identifier == own.identifier:
                journals[name] = journal
        if folders[0] in journals:
            _carry_out(journals)
        elif own or _is_empty(folder / _JOURNAL):
            # The journal of a command that was killed before it renamed a file
            if own or not is_read:
                (folder / _JOURNAL).unlink(missing_ok=True)
        else:
            is_foreign = os.path.lexists(folder / _JOURNAL) and not _read_journal(folder)
    if is_foreign and not is_read:
        raise OutputError(_foreign_journal(folder / _JOURNAL))
    if is_foreign:
        _report_foreign_journal(folder / _JOURNAL)


def _is_empty(file: Path) -> bool:
    """Return True if a path is an empty file and not a link."""
    return not file.is_symlink() and is_file(file) and not file.stat().st_size


def _foreign_journal(file: Path) -> str:
    """Return the message for a journal without a signature of this user."""
    return (
        f"{file}: this list of interrupted changes is not used, because it has no signature of "
        "this user on this machine; delete it, then repeat the interrupted command with --overwrite"
    )


@cache
def _report_foreign_journal(file: Path) -> None:
    """Report a journal in a directory that is only read, once for all inputs in the directory."""
    _log.warning("%s", _foreign_journal(file))


def _signature(text: bytes) -> bytes:
    """Return the signature of the text of a journal; empty if the user has no key."""
    import hmac

    key = user_key()
    return hmac.digest(key, text, "sha256").hex().encode() if key else b""


def _read_journal(folder: Path) -> _Journal | None:
    """Return the journal of a directory; None if this user did not sign it."""
    file = folder / _JOURNAL
    try:
        if file.is_symlink() or is_special(file):
            return None
        with file.open("rb") as stream:
            signature, _, text = stream.read(_MOST_BYTES_OF_JOURNAL).partition(b"\n")
    except OSError:
        return None
    is_signed = len(signature) > 0 and signature == _signature(text)
    return _Journal(*json.loads(text)) if is_signed else None


def digest_of(file: Path) -> str:
    """Return the SHA-256 of a file.

    Raises
    ------
    OutputError
        The file cannot be read.
    """
    import hashlib

    try:
        with file.open("rb") as stream:
            return hashlib.file_digest(stream, "sha256").hexdigest()
    except OSError as error:
        raise OutputError(f"{file}: cannot be read: {error.strerror or error}") from None


def _write(file: Path, content: Content, stream: BinaryIO) -> None:
    """Write the content of a file to a stream, compressed with gzip if its name ends with .gz.

    The compressed bytes do not depend on the time or the name, so that equal contents result in
    equal files.
    """
    writer = (lambda into: into.write(content)) if isinstance(content, bytes) else content
    if file.suffix.lower() != ".gz":
        writer(stream)
        return
    import gzip

    with gzip.GzipFile(
        filename="", mode="wb", compresslevel=_COMPRESSION_LEVEL, fileobj=stream, mtime=0
    ) as packed:
        writer(packed)  # type: ignore[arg-type]


def _temporary_name() -> str:
    """Return the name of a new temporary file of the process."""
    process = os.getpid()
    return _TEMPORARY.format(
        f"{this_host()}-{process}-{process_start(process)}-{os.urandom(8).hex()}"
    )


def remove_abandoned(folder: Path) -> None:
    """Remove the temporary files of terminated processes of the machine from a directory.

    Files of other machines remain, because this machine cannot determine if their processes still
    run. Files that a killed command has started to rename get their final names.
    """
    settle(folder)
    if is_there(folder / _JOURNAL):  # another process is renaming files
        return
    for temporary in folder.glob(_TEMPORARY.format("*")):
        with suppress(OSError):
            writer = re.fullmatch(_TEMPORARY_PATTERN, temporary.name)
            if (
                writer
                and writer["host"] == this_host()
                and not is_running(int(writer["process"]), int(writer["start"]))
            ):
                temporary.unlink()


def remove_unfinished() -> None:
    """Remove the temporary files of the process before it is terminated."""
    for temporary in list(_unfinished):
        with suppress(OSError):
            temporary.unlink()


def _nearest_folder(file: Path) -> Path:
    """Return the directory of a file, or its nearest parent that exists."""
    folder = file.parent
    while not folder.exists() and folder != folder.parent:
        folder = folder.parent
    return folder


def _make_folders(folder: Path) -> list[Path]:
    """Create a directory and its missing parents, and return the new directories, outermost first.

    Directories that another process creates in the meantime are not returned, so they are not
    removed after an error.
    """
    if folder.exists():
        return []
    created = _make_folders(folder.parent)
    with _as_output_error(folder):
        try:
            folder.mkdir()
        except FileExistsError:
            return created
    return [*created, folder]


def _move(temporary: Path, file: Path, overwrite: bool) -> None:
    """Rename a temporary file to its final name. A symbolic link of this name is replaced.

    Raise OutputError if the file exists and `overwrite` is False. Another process may have created
    it after `check_outputs`.
    """
    with _as_output_error(file):
        if not overwrite:
            # Creating a hard link fails if the target exists. Renaming would replace the target.
            try:
                os.link(temporary, file)
            except FileExistsError:
                raise _exists(file) from None
            except OSError:  # the file system does not support hard links
                if os.path.lexists(file):
                    raise _exists(file) from None
            else:
                temporary.unlink()
                return
        temporary.replace(file)


def _exists(file: Path) -> OutputError:
    """Return the error for an existing file that must not be replaced."""
    return OutputError(f"{file}: the file exists; add --overwrite to replace it")


@contextmanager
def _as_output_error(path: Path) -> Iterator[None]:
    """Convert an error of the operating system about a path to an OutputError."""
    try:
        yield
    except OSError as error:
        raise OutputError(f"{path}: cannot be written: {reason_of(error, path)}") from error


def reason_of(error: OSError, path: Path) -> str:
    """Return the reason for which a file or directory cannot be written. The system reports a disk
    without free inodes as full."""
    with suppress(OSError, AttributeError):  # Windows has no `statvfs`
        disk = os.statvfs(_nearest_folder(path))
        if error.errno == errno.ENOSPC and disk.f_files > 0 and disk.f_favail == 0:
            return "no free inode on the disk (df -i); remove files, or use another disk"
    return error.strerror or str(error)
