"""Files are written whole or not at all: under a temporary name in the same folder, renamed once
all is well."""

from __future__ import annotations

import logging
import os
import re
import stat
import sys
import time
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager, suppress
from contextvars import ContextVar
from pathlib import Path
from typing import BinaryIO

from tdint.errors import OutputError, TdintError
from tdint.system import is_running, process_start, this_host

# ---- The bytes of an input, a file or standard input: at most so many, and of nothing that may
# never end

STDIN = "-"
"""The name that stands for standard input."""

MOST_BYTES = 2**28
"""Of the largest file that is read: 256 MiB."""

_PIECE = 2**20  # bytes: large enough that calls cost nothing, small beside any memory

READ: ContextVar[dict[str, str] | None] = ContextVar("read", default=None)
"""SHA-256 of the inputs that the command that runs has read, by name; None where nobody asks."""

KEPT: ContextVar[dict[tuple[int, int], str] | None] = ContextVar("kept", default=None)
"""Device and number of the files that this command reads, with a name of each: never replaced,
whatever they are called there; None where nobody asks."""


def keep_input(source: str | Path) -> None:
    """Have a file that is read never be replaced by what this command writes; - is the file behind
    standard input."""
    kept = KEPT.get()
    if kept is None:
        return
    with suppress(
        OSError, ValueError, AttributeError
    ):  # a name that is no file's, an input that is none
        status = os.fstat(sys.stdin.fileno()) if str(source) == STDIN else Path(source).stat()
        if stat.S_ISREG(status.st_mode):
            kept[status.st_dev, status.st_ino] = str(source)


def is_kept(file: str | Path) -> bool:
    """Whether a name leads, through links, too, to a file that this command reads."""
    try:
        status = Path(file).stat()
        name = (KEPT.get() or {}).get((status.st_dev, status.st_ino))
        # Its number may be another file's by now.
        return name is not None and (name == STDIN or Path(name).samefile(file))
    except (OSError, ValueError):
        return False


def note_input(source: str | Path, content: bytes | Callable[[], str]) -> None:
    """Keep that this was read, for who tells what a result came from; of what is large give what
    makes its SHA-256."""
    keep_input(source)
    seen = READ.get()
    if seen is not None:
        from hashlib import sha256

        seen[str(source)] = sha256(content).hexdigest() if isinstance(content, bytes) else content()


def read_at_most(source: str | Path, most: int, error: type[TdintError]) -> bytes:
    """Read a file, up to one byte beyond `most`, which tells that it is larger.

    Parameters
    ----------
    source : str or Path
        The file, or `-` for standard input.
    most : int
        Bytes.
    error : type
        The error of the reader's kind of file.

    Raises
    ------
    TdintError
        Of the type `error`: the file is a named pipe, or there is no standard input.
    OSError, ValueError
        The system cannot read it, or no file can have this name: readers say it in their own words.
    """
    if str(source) != STDIN:
        if is_named_pipe(source):
            raise error(
                f"{source}: is a named pipe, which may never end; read from it with - and <"
            )
        keep_input(source)
        with Path(source).open("rb") as file:
            return _read(file, most)
    stream = getattr(sys.stdin, "buffer", None)
    if stream is None:
        raise error(f"{STDIN}: there is no standard input to read from")
    return _read(stream, most)


def read_whole(
    source: str | Path,
    error: type[TdintError],
    told: Mapping[type[Exception], str],
    large: str,
    most: int,
) -> bytes:
    """Read a file that must not be larger than `most`; as `read_at_most`, but all that the system
    says becomes an `error`, in the words of `told` where it has some for the kind; `large` is what
    to say of a larger file."""
    try:
        data = read_at_most(source, most, error)
    except (OSError, ValueError) as fault:
        reason = f"cannot be read: {getattr(fault, 'strerror', None) or fault}"
        reason = next((text for kind, text in told.items() if isinstance(fault, kind)), reason)
        raise error(f"{source}: {reason}") from None
    if len(data) > most:
        raise error(f"{source}: {large}")
    return data


def _read(file: BinaryIO, most: int) -> bytes:
    """Read in pieces: an endless device ends at `most`, and memory grows as needed."""
    content = bytearray()
    while len(content) <= most and (piece := file.read(_PIECE)):
        content += piece
    return bytes(content)


def is_named_pipe(source: str | Path) -> bool:
    """Whether opening a file may wait for ever; pipes that a shell has opened (`<(command)`) are
    none of those."""
    if str(source).startswith(("/dev/fd/", "/proc/")):
        return False
    try:
        return stat.S_ISFIFO(Path(source).stat().st_mode)
    except (OSError, ValueError):  # Opening it tells why.
        return False


def is_folder(name: str | Path) -> bool:
    """Whether a name is that of a folder; False also for one that can be no file's (too long,
    say)."""
    return os.path.isdir(name)  # noqa: PTH112  Path's raises of the latter


def is_there(name: str | Path) -> bool:
    """Return True if a file or a folder has this name; False also for a name that no file can have,
    such as one of 300 characters."""
    return os.path.exists(name)  # noqa: PTH110  as above


def is_file(name: str | Path) -> bool:
    """Whether a name is that of a file, as `is_folder`."""
    return os.path.isfile(name)  # noqa: PTH113  as above


# ---- Files

Writer = Callable[[BinaryIO], object]
"""Writes the content of one file to a stream."""

Content = bytes | Writer
"""What a file shall hold, or what writes it."""

_PACKED = 4
"""Level of gzip: a history is a few percent larger than with the usual 9, and written in a third of
the time."""

_TEMPORARY = ".tdint-{}.tmp"
_OF_PROCESS = re.compile(r"\.tdint-(?P<host>.+)-(?P<process>\d+)-(?P<start>\d+)-[0-9a-f]{16}\.tmp")
"""The name of a temporary file: who writes it."""

_WEEK = 7 * 86400.0
"""Age in s from which a temporary file of another machine is told: no run takes so long, and nobody
here knows whether its process is gone."""

_log = logging.getLogger(__name__)

_unfinished: set[Path] = set()  # of the whole process: for who ends it from another thread


def check_outputs(files: Iterable[Path], *, overwrite: bool) -> None:
    """Make sure that files can be written, before the work whose results they shall hold.

    Parameters
    ----------
    files : iterable of Path
        All outputs of a command.
    overwrite : bool
        Whether existing files may be replaced.

    Raises
    ------
    OutputError
        The first obstacle: a file that this command reads, an existing file, a folder in the way, a
        read-only folder, two outputs of one name. Missing folders are none: `write_files` makes
        them.
    """
    seen: set[str] = set()
    for file in files:
        if "\0" in str(file):
            raise OutputError(f"{file!s:.40}: a file name has no null character")
        with _in_words(file):
            real = os.path.realpath(file)
            if real in seen:
                raise OutputError(f"{file}: two outputs would have this name")
            seen.add(real)
            refuse_kept([file])
            folder = _nearest_folder(file)
            if not is_folder(folder):
                raise OutputError(f"{file}: {folder} is a file, not a folder")
            if not os.access(folder, os.W_OK | os.X_OK):
                raise OutputError(f"{file}: no permission to write in the folder {folder}")
            if file.is_dir():
                raise OutputError(f"{file}: is a folder; give the name of a file")
            if file.exists() and not file.is_file():
                raise OutputError(f"{file}: is a device or a pipe, not a file")
            if file.exists() and not overwrite:
                raise _exists(file)


def refuse_kept(files: Iterable[Path]) -> None:
    """Raise OutputError for a file, to be replaced or removed, that this command reads, under
    whatever name."""
    for file in files:
        if is_kept(file):
            raise OutputError(f"{file}: is read by this command; write to another place")


def write_files(
    contents: Mapping[Path, Content],
    *,
    overwrite: bool,
    stale: Mapping[Path, str] | None = None,
    tell: Callable[[Mapping[Path, str]], None] | None = None,
    last: tuple[Path, Callable[[Mapping[Path, str]], bytes]] | None = None,
) -> None:
    """Write files so that each is there whole or not at all, in the order given; missing folders
    are made.

    All are written under temporary names first; only then they take their places. Whatever goes
    wrong before, Ctrl-C too, leaves the folder as it was. A symbolic link is followed.

    Parameters
    ----------
    contents : mapping of Path to bytes or callable
        What each file shall hold, or what writes it to a binary stream.
    overwrite : bool
        Whether existing files may be replaced.
    stale : mapping of Path to str, optional
        Files of an earlier run that do not belong to the new ones, with what their SHA-256 was:
        removed, with `overwrite` and if it still is.
    tell : callable, optional
        Told the SHA-256 of each file when all are written, before any takes its place.
    last : Path and callable, optional
        One more file, behind the others, and what makes its content of their SHA-256.

    Raises
    ------
    OutputError
        A file cannot be written.
    """
    check_outputs([*contents, *([last[0]] if last else ())], overwrite=overwrite)
    made: list[Path] = []
    temporaries: dict[Path, Path] = {}

    def write(file: Path, content: Content) -> None:
        made.extend(_made(file.parent))
        temporary = Path(os.path.realpath(file)).with_name(_temporary_name())
        temporaries[file] = temporary
        _unfinished.add(temporary)
        with _in_words(file), temporary.open("xb") as stream:
            _write(file, content, stream)

    def digests() -> dict[Path, str]:
        return {file: digest_of(temporary) for file, temporary in temporaries.items()}

    try:
        for file, content in contents.items():
            write(file, content)
        if last:
            write(last[0], last[1](digests()))
        if tell:
            tell(digests())
        for file, temporary in temporaries.items():
            _move(temporary, file, overwrite)
    except BaseException:
        for temporary in temporaries.values():
            with suppress(OSError):
                temporary.unlink()
        for folder in reversed(made):
            with suppress(OSError):  # Not empty: some file has taken its place.
                folder.rmdir()
        raise
    finally:
        _unfinished.difference_update(temporaries.values())
    for file, digest in (stale or {}).items() if overwrite else ():
        if (
            file not in temporaries
            and not file.is_symlink()
            and file.is_file()
            and not is_kept(file)
        ):
            with _in_words(file):
                if digest_of(file) == digest:
                    file.unlink(missing_ok=True)


def digest_of(file: Path) -> str:
    """SHA-256 of what a file holds.

    Raises
    ------
    OutputError
        It cannot be read.
    """
    import hashlib

    try:
        with file.open("rb") as stream:
            return hashlib.file_digest(stream, "sha256").hexdigest()
    except OSError as error:
        raise OutputError(f"{file}: cannot be read: {error.strerror or error}") from None


def _write(file: Path, content: Content, stream: BinaryIO) -> None:
    """Write the content of a file, packed if its name ends in .gz: the same bytes at any time,
    under any name."""
    writer = (lambda into: into.write(content)) if isinstance(content, bytes) else content
    if file.suffix.lower() != ".gz":
        writer(stream)
        return
    import gzip

    with gzip.GzipFile(
        filename="", mode="wb", compresslevel=_PACKED, fileobj=stream, mtime=0
    ) as packed:
        writer(packed)  # type: ignore[arg-type]


def _temporary_name() -> str:
    """The name of a new temporary file of this process."""
    process = os.getpid()
    return _TEMPORARY.format(
        f"{this_host()}-{process}-{process_start(process)}-{os.urandom(8).hex()}"
    )


def remove_abandoned(folder: Path) -> None:
    """Remove the temporary files that processes of this machine have left in a folder and that are
    gone; of others, of which nobody here can know, tell what is older than a week."""
    for temporary in folder.glob(_TEMPORARY.format("*")):
        with suppress(OSError):
            writer = _OF_PROCESS.fullmatch(temporary.name)
            if writer and writer["host"] == this_host():
                if not is_running(int(writer["process"]), int(writer["start"])):
                    temporary.unlink()
            elif time.time() - temporary.stat().st_mtime > _WEEK:
                _log.info(
                    "%s: a temporary file, older than a week; remove it if no tdint writes it",
                    temporary,
                )


def remove_unfinished() -> None:
    """Remove the temporary files of this process, before it is ended where it stands."""
    for temporary in list(_unfinished):
        with suppress(OSError):
            temporary.unlink()


def write_file(file: Path, writer: Content, *, overwrite: bool) -> None:
    """Write one file; see `write_files`."""
    write_files({file: writer}, overwrite=overwrite)


def check_room(file: Path, least: float) -> None:
    """Make sure that a disk has so many bytes for a file, before the work.

    Raises
    ------
    OutputError
        It has not; of a file that is replaced, the old one stays until the new one is whole.
    """
    import shutil

    folder = _nearest_folder(file)
    with _in_words(file):
        free = shutil.disk_usage(folder).free
    if least > free:
        raise OutputError(
            f"{file}: takes {least / 1e9:.3g} GB at least, {free / 1e9:.3g} GB are free; write "
            "fewer rows (--history-every), or to another disk"
        )


def _nearest_folder(file: Path) -> Path:
    """The folder of a file, or the first one above it that is there."""
    folder = file.parent
    while not folder.exists() and folder != folder.parent:
        folder = folder.parent
    return folder


def _made(folder: Path) -> list[Path]:
    """Make a folder and those above it that are missing; the new ones, the outermost first.

    What another process makes meanwhile is not new; and it may stay, with what it holds.
    """
    if folder.exists():
        return []
    made = _made(folder.parent)
    with _in_words(folder):
        try:
            folder.mkdir()
        except FileExistsError:
            return made
    return [*made, folder]


def _move(temporary: Path, file: Path, overwrite: bool) -> None:
    """Give the temporary file its place; without `overwrite` even a file that came up meanwhile is
    kept."""
    target = os.path.realpath(file)
    with _in_words(file):
        if not overwrite:
            try:
                os.link(temporary, target)
            except FileExistsError:
                raise _exists(file) from None
            except OSError:  # A file system without hard links.
                if Path(target).exists():
                    raise _exists(file) from None
            else:
                temporary.unlink()
                return
        temporary.replace(target)


def _exists(file: Path) -> OutputError:
    return OutputError(f"{file}: exists already; give --overwrite to replace it")


@contextmanager
def _in_words(path: Path) -> Iterator[None]:
    """Turn what the operating system says about a path into an OutputError."""
    try:
        yield
    except OSError as error:
        raise OutputError(f"{path}: cannot be written: {error.strerror or error}") from error
