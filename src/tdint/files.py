"""Files are written whole or not at all: under a temporary name in the same folder, renamed once all is well."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import BinaryIO

from tdint.errors import OutputError

Writer = Callable[[BinaryIO], object]
"""Writes the content of one file to a stream."""

Content = bytes | Writer
"""What a file shall hold, or what writes it."""

_PACKED = 4
"""Level of gzip: a history is a few percent larger than with the usual 9, and written in a third of the time."""

_TEMPORARY = ".tdint-{}.tmp"

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
        The first obstacle: an existing file, a folder in the way, a read-only folder, two outputs of one name. Missing
        folders are none: `write_files` makes them.
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
            _check_folder(file)
            _check_free(file, overwrite)


def write_files(
    contents: Mapping[Path, Content],
    *,
    overwrite: bool,
    stale: Iterable[Path] = (),
    tell: Callable[[Mapping[Path, str]], None] | None = None,
) -> None:
    """Write files so that each is there whole or not at all, in the order given; missing folders are made.

    All are written under temporary names first; only then they take their places. Whatever goes wrong before, Ctrl-C
    too, leaves the folder as it was. A symbolic link is followed.

    Parameters
    ----------
    contents : mapping of Path to bytes or callable
        What each file shall hold, or what writes it to a binary stream.
    overwrite : bool
        Whether existing files may be replaced.
    stale : iterable of Path
        Files of an earlier run that do not belong to the new ones: removed, with `overwrite` only.
    tell : callable, optional
        Told the SHA-256 of each file when all are written, before any takes its place.

    Raises
    ------
    OutputError
        A file cannot be written.
    """
    check_outputs(contents, overwrite=overwrite)
    made: list[Path] = []
    temporaries: list[Path] = []
    try:
        for folder in {file.parent: None for file in contents}:
            made += _made(folder)
        for file, content in contents.items():
            temporary = Path(os.path.realpath(file)).with_name(_TEMPORARY.format(os.urandom(8).hex()))
            temporaries.append(temporary)
            _unfinished.add(temporary)
            with _in_words(file), temporary.open("xb") as stream:
                _write(file, content, stream)
        if tell:
            tell({file: digest_of(temporary) for file, temporary in zip(contents, temporaries, strict=True)})
        for file, temporary in zip(contents, temporaries, strict=True):
            _move(temporary, file, overwrite)
    except BaseException:
        for temporary in temporaries:
            with suppress(OSError):
                temporary.unlink()
        for folder in reversed(made):
            with suppress(OSError):  # Not empty: some file has taken its place.
                folder.rmdir()
        raise
    finally:
        _unfinished.difference_update(temporaries)
    for file in stale if overwrite else ():
        with _in_words(file):
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
    """Write the content of a file, packed if its name ends in .gz: the same bytes at any time, under any name."""
    writer = (lambda into: into.write(content)) if isinstance(content, bytes) else content
    if file.suffix.lower() != ".gz":
        writer(stream)
        return
    import gzip

    with gzip.GzipFile(filename="", mode="wb", compresslevel=_PACKED, fileobj=stream, mtime=0) as packed:
        writer(packed)  # type: ignore[arg-type]


def remove_abandoned(folder: Path) -> None:
    """Remove the temporary files that killed processes have left in a folder which is this process's alone."""
    for temporary in folder.glob(_TEMPORARY.format("*")):
        with suppress(OSError):
            temporary.unlink()


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

    folder = file.parent
    while not folder.exists() and folder != folder.parent:
        folder = folder.parent
    with _in_words(file):
        free = shutil.disk_usage(folder).free
    if least > free:
        raise OutputError(
            f"{file}: takes {least / 1e9:.3g} GB at least, {free / 1e9:.3g} GB are free; write fewer rows (--every), "
            "or to another disk"
        )


def _check_folder(file: Path) -> None:
    """Make sure that the file's folder, or what is there of the folders above it, can be written into."""
    folder = file.parent
    while not folder.exists() and folder != folder.parent:
        folder = folder.parent
    if not folder.is_dir():
        raise OutputError(f"{file}: {folder} is a file, not a folder")
    if not os.access(folder, os.W_OK | os.X_OK):
        raise OutputError(f"{file}: no permission to write in the folder {folder}")


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


def _check_free(file: Path, overwrite: bool) -> None:
    if file.is_dir():
        raise OutputError(f"{file}: is a folder; give the name of a file")
    if file.exists() and not file.is_file():
        raise OutputError(f"{file}: is a device or a pipe, not a file")
    if file.exists() and not overwrite:
        raise _exists(file)


def _move(temporary: Path, file: Path, overwrite: bool) -> None:
    """Give the temporary file its place; without `overwrite` even a file that came up meanwhile is kept."""
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
