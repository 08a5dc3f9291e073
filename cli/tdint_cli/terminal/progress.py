"""A progress bar on standard error, for people at a terminal."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from typing import TypeVar

import click

from tdint_cli.settings import current, is_quiet

_PARTS = 1000

Item = TypeVar("Item")

Progress = Callable[[str, float], None]
"""To be told what is being done and how much of it is done, from 0 to 1."""


@contextmanager
def progress_bar(to_terminal: bool) -> Iterator[Progress]:
    """A bar that is told of the progress.

    No bar is drawn if standard error is no terminal, nor into data that go to one (`to_terminal`), nor with `--quiet`.
    """
    if is_quiet() or not is_terminal(sys.stderr) or (to_terminal and is_terminal(sys.stdout)):
        yield lambda what, part: None
        return
    with click.progressbar(length=_PARTS, file=sys.stderr) as bar:

        def tell(what: str, part: float) -> None:
            bar.label = f"{what:<12}"
            bar.update(max(0, round(part * _PARTS) - bar.pos))

        settings = current()
        settings.bar = True
        try:
            yield tell
        finally:
            settings.bar = False


@contextmanager
def counted(items: Iterable[Item], count: int, label: str, *, to_terminal: bool) -> Iterator[Iterable[Item]]:
    """The items, with a bar that counts them if there are several."""
    if count < 2:
        yield items
        return

    def told(progress: Progress) -> Iterator[Item]:
        progress(f"{label} 0/{count}", 0.0)
        for done, item in enumerate(items, start=1):
            yield item
            progress(f"{label} {done}/{count}", done / count)

    with progress_bar(to_terminal) as progress:
        yield told(progress)


def part_of(progress: Progress, start: float, end: float, name: str = "") -> Progress:
    """What tells of a part of the work, from `start` to `end` of the whole, with a name before what is done."""
    return lambda what, part: progress(f"{name}{what}", start + (end - start) * part)


def is_terminal(stream: object) -> bool:
    """Whether a person sees what is written there."""
    isatty = getattr(stream, "isatty", None)
    return bool(isatty and isatty())
