"""A progress bar on standard error, for people at a terminal."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager

import click

_PARTS = 1000


@contextmanager
def progress_bar(to_terminal: bool) -> Iterator[Callable[[str, float], None]]:
    """What is to be told what is being done and how much is done, from 0 to 1.

    No bar is drawn if standard error is no terminal, nor into data that go to one (`to_terminal`).
    """
    if not _is_terminal(sys.stderr) or (to_terminal and _is_terminal(sys.stdout)):
        yield lambda what, part: None
        return
    with click.progressbar(length=_PARTS, file=sys.stderr) as bar:

        def tell(what: str, part: float) -> None:
            bar.label = f"{what:<12}"
            bar.update(max(0, round(part * _PARTS) - bar.pos))

        yield tell


def _is_terminal(stream: object) -> bool:
    isatty = getattr(stream, "isatty", None)
    return bool(isatty and isatty())
