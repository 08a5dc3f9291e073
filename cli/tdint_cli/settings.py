"""What holds for a whole command line: set by `--debug` and `--quiet`, before or after the command's name."""

from __future__ import annotations

from dataclasses import dataclass

import click


@dataclass
class Settings:
    """Settings that every click context carries.

    Attributes
    ----------
    debug : bool
        Show a traceback with an error.
    quiet : bool
        Say nothing but warnings and errors.
    bar : bool
        A progress bar is shown.
    options : frozenset of str
        The options of the command that runs, --units and so on.
    """

    debug: bool = False
    quiet: bool = False
    bar: bool = False
    options: frozenset[str] = frozenset()


def current() -> Settings:
    """Settings of the command that runs."""
    context = click.get_current_context(silent=True)
    return (context and context.find_object(Settings)) or Settings()


def is_quiet() -> bool:
    """Whether the command that runs was asked to be quiet."""
    return current().quiet
