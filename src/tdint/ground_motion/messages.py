"""What ObsPy and its C libraries say while they work, caught before it reaches the user's
terminal."""

from __future__ import annotations

import os
import sys
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from importlib import import_module
from types import ModuleType
from typing import IO, Any

from tdint.system import unnamed_file

_LONGEST = 300
"""Characters of a message; ObsPy's may quote a whole file."""

_DRAWING = "obspy.imaging.source"

# Warnings about code, not about a file: obspy's plugins are imported late, and Python's own changes
# show up here.
_ABOUT_CODE = (
    DeprecationWarning,
    PendingDeprecationWarning,
    FutureWarning,
    SyntaxWarning,
    ImportWarning,
)


@contextmanager
def quiet_import() -> Iterator[None]:
    """Import a part of obspy without the warnings that its own code (not the user's file) gives
    rise to.

    And without what its earthquakes are drawn by, a quarter of the time that all of obspy takes.
    """
    with warnings.catch_warnings(), _put_off(_DRAWING):
        for category in _ABOUT_CODE:
            warnings.simplefilter("ignore", category)
        yield


@contextmanager
def _put_off(name: str) -> Iterator[None]:
    """Give who imports functions of a module such ones as import it when they are called."""
    if name in sys.modules:
        yield
        return

    def later(function: str) -> Any:
        if function.startswith("__"):
            raise AttributeError(function)
        return lambda *given, **named: getattr(import_module(name), function)(*given, **named)

    stand_in = ModuleType(name)
    stand_in.__dict__["__getattr__"] = later
    sys.modules[name] = stand_in
    try:
        yield
    finally:
        if sys.modules.get(name) is stand_in:
            del sys.modules[name]


@contextmanager
def caught_messages() -> Iterator[list[str]]:
    """Collect Python warnings and what C code prints to standard error.

    Both are the whole process's: another thread that writes to standard error at this time is
    caught as well.

    Yields
    ------
    list of str
        Empty inside the block; afterwards every message once, in the order of appearance, without
        the warnings that are about code.
    """
    messages: list[str] = []
    with (
        warnings.catch_warnings(record=True) as caught,
        _lost_in_callbacks() as lost,
        _printed_by_c() as printed,
    ):
        warnings.simplefilter("always")
        yield messages
    # ObsPy's own deprecation warning is a UserWarning; importing its class here would load obspy.
    told = [w for w in caught if w.category.__name__ != "ObsPyDeprecationWarning"]
    texts = [one_line(str(w.message)) for w in told if not issubclass(w.category, _ABOUT_CODE)]
    messages.extend(dict.fromkeys(texts + lost + printed))


@contextmanager
def _lost_in_callbacks() -> Iterator[list[str]]:
    """Catch what goes wrong in Python functions that C code calls: nothing can be raised through
    the C code.

    ObsPy loses libmseed's messages this way when a channel code in them is not ASCII.
    """
    lost: list[str] = []

    def keep(args: sys.UnraisableHookArgs) -> None:
        error = args.exc_value
        text = (
            error.object.decode("utf-8", "replace")
            if isinstance(error, UnicodeDecodeError)
            else str(error)
        )
        lost.append(one_line(text))

    previous = sys.unraisablehook
    sys.unraisablehook = keep
    try:
        yield lost
    finally:
        sys.unraisablehook = previous


@contextmanager
def _printed_by_c() -> Iterator[list[str]]:
    """Catch standard error at the level of the operating system, where libgse2 and evalresp print
    to."""
    lines: list[str] = []
    try:
        saved = os.dup(2)
    except OSError:  # There is no standard error to guard.
        yield lines
        return
    with _spool() as spool:
        if sys.stderr is not None:
            sys.stderr.flush()
        os.dup2(spool.fileno(), 2)
        try:
            yield lines
        finally:
            os.dup2(saved, 2)
            os.close(saved)
        spool.seek(0)
        lines.extend(
            filter(None, map(one_line, spool.read().decode("utf-8", "replace").splitlines()))
        )


def _spool() -> IO[bytes]:
    """A file without a name; in memory where there is no folder for temporary files."""
    from tempfile import TemporaryFile  # for formats that need the guard alone

    try:
        return TemporaryFile()
    except OSError:
        return unnamed_file()


def one_line(text: str) -> str:
    """A message of another program as one line that a person can read: what is too long ends in an
    ellipsis."""
    line = " ".join(text[: 2 * _LONGEST].split())
    return line if len(line) <= _LONGEST else f"{line[:_LONGEST]} ..."
