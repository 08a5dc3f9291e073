"""Capture of messages that ObsPy and its C libraries print or warn about."""

from __future__ import annotations

import os
import sys
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from importlib import import_module
from types import ModuleType
from typing import Any

from tdint.system import unnamed_file

_LONGEST = 300
"""Characters; maximum length of a message, because ObsPy may quote an entire file."""

_DRAWING = "obspy.imaging.source"  # module that plots earthquakes; tdint does not use it

# These warnings are about code, not about a file. They occur while files are read, because the
# plugins of ObsPy are imported late and may use deprecated Python features.
_ABOUT_CODE = (
    DeprecationWarning,
    PendingDeprecationWarning,
    FutureWarning,
    SyntaxWarning,
    ImportWarning,
)


@contextmanager
def quiet_import() -> Iterator[None]:
    """Import a part of ObsPy, or `importlib.metadata`, without warnings about the code of ObsPy.

    The module of ObsPy that plots earthquakes requires a large part of the time; it is imported
    when one of its functions is called.
    """
    with warnings.catch_warnings(), _drawing_when_called():
        for category in _ABOUT_CODE:
            warnings.simplefilter("ignore", category)
        yield


def obspy_function(group: str, name: str) -> Any:
    """Import and return the function that ObsPy registers as an entry point.

    Parameters
    ----------
    group : str
        Group of the entry point, such as `obspy.plugin.waveform.SAC`.
    """
    from importlib.metadata import distribution  # imported late: needed only by two readers

    (entry,) = distribution("obspy").entry_points.select(group=group, name=name)
    with quiet_import():
        return entry.load()


@contextmanager
def _drawing_when_called() -> Iterator[None]:
    """Replace the functions of the module that plots earthquakes by functions that import it."""
    if _DRAWING in sys.modules:
        yield
        return

    def function(name: str) -> Any:
        """Return a function that imports the module and calls its function of this name."""
        # Python also requests names such as __path__, which the placeholder does not have.
        if name.startswith("__"):
            raise AttributeError(name)
        return lambda *args, **kwargs: getattr(import_module(_DRAWING), name)(*args, **kwargs)

    # Python calls __getattr__ of a module for names that the module does not contain.
    sys.modules[_DRAWING] = ModuleType(_DRAWING)
    sys.modules[_DRAWING].__dict__["__getattr__"] = function
    try:
        yield
    finally:
        del sys.modules[_DRAWING]


@contextmanager
def caught_messages() -> Iterator[list[str]]:
    """Collect Python warnings, errors in Python functions called by C code, and the text that C
    code prints to standard error.

    Warnings and standard error belong to the process: output of other threads during the block is
    also collected.

    Yields
    ------
    list of str
        Empty inside the block. After the block, each message one time, without warnings about code:
        first all warnings, then the errors, then the printed text.
    """
    messages: list[str] = []
    # `lost` are messages of exceptions that cannot propagate through C code.
    with (
        warnings.catch_warnings(record=True) as caught,
        _callback_errors() as lost,
        _printed_by_c() as printed,
    ):
        warnings.simplefilter("always")
        yield messages
    # The deprecation warning of ObsPy is a UserWarning. It is compared by name, because an import
    # of its class would load ObsPy.
    others = [w for w in caught if w.category.__name__ != "ObsPyDeprecationWarning"]
    texts = [one_line(str(w.message)) for w in others if not issubclass(w.category, _ABOUT_CODE)]
    messages.extend(dict.fromkeys(texts + lost + printed))


@contextmanager
def _callback_errors() -> Iterator[list[str]]:
    """Collect the messages of exceptions in Python functions called by C code, which cannot
    propagate through the C code.

    For example, ObsPy loses messages of libmseed if they contain a channel code that is not ASCII.
    """
    lost: list[str] = []

    def keep(args: sys.UnraisableHookArgs) -> None:
        """Append the message of an exception to `lost`."""
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
    """Capture standard error at the level of the operating system, because libgse2 and evalresp
    print to it directly. The list is empty inside the block; after the block, it contains the
    printed lines that are not blank.
    """
    lines: list[str] = []
    try:
        saved = os.dup(2)  # 2 is the file descriptor of standard error
    except OSError:  # The process has no standard error.
        yield lines
        return
    with unnamed_file() as spool:
        if sys.stderr is not None:
            sys.stderr.flush()
        # From here on, standard error of the process is written to the spool file.
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


def one_line(text: str) -> str:
    """Convert a message of another program to one line; shorten a long message with an ellipsis."""
    line = " ".join(text[: 2 * _LONGEST].split())
    return line if len(line) <= _LONGEST else f"{line[:_LONGEST]} ..."
