"""Which files hold the two horizontal components of one motion: by the names in use, or by names that are given."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path
from typing import TypeVar

from tdint.errors import RecordError, TdintError, UsageError
from tdint.ground_motion.horizontals import SingleHorizontal
from tdint.ground_motion.record import Record
from tdint.input_bytes import STDIN

_KNET = re.compile(r"\.(?P<component>EW|NS|UD)(?=\d?$)", re.IGNORECASE)
_PEER = re.compile(r"[-_]?(?P<component>\d{3}|UP|DOWN|DWN|DN|VERT?|V)(?=\.AT2$)", re.IGNORECASE)
_SEED = re.compile(r"(?<![A-Z0-9])(?P<component>[A-Z][GHLN][ENZ123])(?![A-Z0-9])", re.IGNORECASE)
_ENDING = re.compile(
    r"(?:(?<=[-_])|(?<=\.)(?=\w+\.))(?P<component>NS|SN|EW|WE|UD|UP|DN|VERT?|FN|FP|H[12]|[NEZXYRT])"
    r"(?=(?:\.[A-Z]\w*){0,2}$)",
    re.IGNORECASE,
)
Failure = TypeVar("Failure", bound=TdintError)

_MARK = "{}"
_LONGEST = 5  # letters by which the names of two components differ
_SHOWN = 4


@dataclass(frozen=True)
class PairNames:
    """How the files of a pair are named: `first` and `second` with {} for what both share, or as is usual without."""

    first: str = ""
    second: str = ""

    @classmethod
    def parse(cls, text: str) -> PairNames:
        """Two names with a comma between them: `{}_N.AT2,{}_E.AT2`.

        Raises
        ------
        UsageError
            There are not two different ones, or one has not exactly one {}.
        """
        parts = [part.strip() for part in text.split(",")]
        if len(parts) != 2 or parts[0] == parts[1] or any(part.count(_MARK) != 1 for part in parts):
            raise UsageError(f"{text!r}: write two names with {{}} for what they share, such as {{}}_N.AT2,{{}}_E.AT2")
        return cls(*parts)

    def motion(self, file: str) -> str:
        """The motion that a file belongs to, a name with {} for the component; empty if it has neither name."""
        path = Path(file).as_posix()
        for name in (self.first, self.second):
            before, _, after = name.partition(_MARK)
            if found := re.fullmatch(f"((?:.*/)?){re.escape(before)}([^/]+){re.escape(after)}", path):
                return f"{found[1]}{found[2]}{_MARK}"
        return ""


USUAL = PairNames()
"""Names as K-NET, PEER and networks give them, and the usual endings."""


def motion_name(file: str) -> str:
    """The name of a file without what tells its component: equal for the files of one motion.

    Known are the endings of K-NET (.EW, .NS2), of PEER's AT2 files (067.AT2, -UP.AT2), channel codes (HNE), and before
    the suffix _N and _E, _NS and _EW, -H1 and -H2, _X and _Y, _FN and _FP with the vertical ones beside them.
    """
    path = Path(file)
    found = _component(path.name)
    if not found:
        return file
    start, end = found.span("component")
    name = path.name[:start].rstrip("-_") if found.re is _PEER else path.name[:start]
    channel = found["component"][:2] if found.re is _SEED else ""
    return str(path.with_name(f"{name}{channel}?{path.name[end:]}"))


def files_of_motions(files: Sequence[str], names: PairNames = USUAL) -> tuple[list[tuple[str, ...]], list[str]]:
    """The files of each motion, in the order of the first ones, and those that belong to none by the names given.

    Raises
    ------
    UsageError
        No file has one of the names given.
    """
    motions: dict[str, list[str]] = {}
    for file in files:
        name = file if file == STDIN else motion_name(file) if names == USUAL else names.motion(file)
        motions.setdefault(name, []).append(file)
    others = motions.pop("", [])
    if files and not motions:
        raise UsageError(f"no file is named {names.first} or {names.second}; there are {_listed(others)}")
    return [tuple(members) for members in motions.values()], others


def with_component(record: Record) -> Record:
    """A record with the component that its file's name tells, where its file tells none."""
    found = None if record.component.strip() else _component(Path(record.source).name)
    return replace(record, component=found["component"].upper()) if found else record


def told_once(failures: Sequence[Failure]) -> list[Failure | RecordError]:
    """The failures, those of files without a partner as one: with the names that nearly fit each other."""
    single = [failure for failure in failures if isinstance(failure, SingleHorizontal)]
    if len(single) < 2:
        return list(failures)
    files = [failure.file for failure in single]
    text = f"{len(files)} files have a single horizontal component and, by their names, no partner: {_listed(files)}"
    close = Counter(_nearly(files)).most_common(1)
    if close:
        first, second = close[0][0]
        text += f"; if these are pairs, say how they are named: --pairs '{first},{second}' (`pairs` of a campaign)"
    return [*(failure for failure in failures if failure not in single), RecordError(text)]


def _component(name: str) -> re.Match[str] | None:
    """Where the name of a file tells the component."""
    return next((found for kind in (_KNET, _PEER, _SEED, _ENDING) if (found := kind.search(name))), None)


def _listed(files: Sequence[str]) -> str:
    more = f" and {len(files) - _SHOWN} more" if len(files) > _SHOWN else ""
    return ", ".join(files[:_SHOWN]) + more


def _nearly(files: Sequence[str]) -> list[tuple[str, str]]:
    """Names of pairs, as `PairNames` has them, by which two of the files each would be one."""
    names = sorted(Path(file).name for file in files)
    found: list[tuple[str, str]] = []
    for one, other in map(sorted, [*pairwise(names), *pairwise(sorted(names, key=lambda name: name[::-1]))]):
        head = _shared(one, other)
        tail = min(_shared(one[::-1], other[::-1]), len(one) - head, len(other) - head)
        while head and all(text[head - 1 : head + 1].isdigit() for text in (one, other)):
            head -= 1  # 000 and 090 differ as numbers do, not in a digit
        if max(len(one), len(other)) - head - tail > _LONGEST:
            continue
        if head:
            found.append((_MARK + one[head:], _MARK + other[head:]))
        elif tail > len(suffix := Path(one).suffix):
            found.append((f"{one[: len(one) - tail]}{_MARK}{suffix}", f"{other[: len(other) - tail]}{_MARK}{suffix}"))
    return found


def _shared(one: str, other: str) -> int:
    """How many letters two texts have in common at their beginning."""
    return next((i for i, (a, b) in enumerate(zip(one, other, strict=False)) if a != b), min(len(one), len(other)))
