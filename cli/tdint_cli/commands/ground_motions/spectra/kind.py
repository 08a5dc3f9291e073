"""What a command makes of each record: chosen once, then worked through in `tables`."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from tdint.files import Writer
    from tdint.ground_motion.record import Record
    from tdint.output.tables.table import Table


@dataclass(frozen=True)
class Results:
    """What a command makes of one record.

    Attributes
    ----------
    lines : sequence
        Its results, one per line of a picture.
    records : sequence of Record
        The components that they are of.
    notes : sequence of str
        What there is to say beside the notes of the components.
    """

    lines: Sequence[Any]
    records: Sequence[Record]
    notes: Sequence[str] = ()


def _one_by_one(request: Any, files: Sequence[str]) -> list[tuple[str, ...]]:
    return [(file,) for file in files]


def _no_remark(request: Any, interval: float) -> str:
    return ""


@dataclass(frozen=True)
class Kind:
    """A kind of table over the period. All are functions of a module: other processes find them by name.

    Attributes
    ----------
    command : str
        The command's name.
    default_periods : str
        Where none are asked for.
    check : callable
        Refuses, before any work, a request that makes no sense (UsageError).
    compute : callable
        From the request and the components of a record its results.
    table : callable
        From the request and results their table.
    picture : callable
        From the request, results and a suffix what draws them.
    remark : callable
        From the request and the longest sampling interval of all records (s) what is to be said at the end; empty for
        nothing.
    gather : callable
        From the request and all files the files of each record; by default each is a record by itself.
    """

    command: str
    default_periods: str
    check: Callable[[Any], None]
    compute: Callable[[Any, Sequence[Record]], Results]
    table: Callable[[Any, Sequence[Any]], Table]
    picture: Callable[[Any, Sequence[Any], str], Writer]
    remark: Callable[[Any, float], str] = _no_remark
    gather: Callable[[Any, Sequence[str]], list[tuple[str, ...]]] = _one_by_one
