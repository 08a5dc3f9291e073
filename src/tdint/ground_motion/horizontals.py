"""The two horizontal components of a motion, found by their names."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace
from datetime import datetime
from itertools import pairwise
from math import isclose
from pathlib import Path
from typing import TypeVar

from tdint.errors import RecordError, TdintError, UsageError
from tdint.files import STDIN
from tdint.ground_motion.events import is_same_event, parse_event
from tdint.ground_motion.record import Record
from tdint.written_numbers import first_few

_VERTICAL = re.compile(r"UP?|D(OW)?N|DWN|V|VER|VERT|VERTICAL|U-?D\d?|([A-Z]{2})?Z", re.IGNORECASE)
_AZIMUTH = re.compile(r"\d{1,3}")
_QUADRANT = re.compile(r"([NS])(\d{1,2})([EW])", re.IGNORECASE)
_NORTH = re.compile(r"N-?S\d?|([A-Z]{2})?N", re.IGNORECASE)
_EAST = re.compile(r"E-?W\d?|([A-Z]{2})?E", re.IGNORECASE)
_LEAST_AZIMUTH = 4  # 1, 2 and 3 are numbers of channels
_AXES = {"1": "2", "2": "1", "X": "Y", "Y": "X", "R": "T", "T": "R", "N": "P", "P": "N"}
"""Last letters of names at right angles; FN and FP are normal and parallel to the fault."""

_SKEW = 5.0
"""Degrees by which the components may miss the right angle."""

_LONGER = 0.05
"""Part of the longer component that may be cut off to make them equal."""


class SingleHorizontal(RecordError):
    """A file has one horizontal component alone."""

    def __init__(self, file: str, component: str) -> None:
        self.file, self.component = file, component
        whose = component or "one"
        super().__init__(
            f"{file}: has a single horizontal component, {whose}; name the file of the other one, "
            "too"
        )


@dataclass(frozen=True)
class Horizontals:
    """Two horizontal components at right angles, of equal sampling and length.

    Where both names tell a direction the second component lies 90 degrees clockwise of the first
    one.

    Attributes
    ----------
    first, second : Record
        The components.
    notes : tuple of str
        What was assumed or cut off.
    """

    first: Record
    second: Record
    notes: tuple[str, ...] = ()

    @property
    def source(self) -> str:
        """The file, or both, joined by +."""
        return "+".join(dict.fromkeys((self.first.source, self.second.source)))

    @property
    def component(self) -> str:
        """The names of the components, joined by +."""
        return f"{self.first.component or '?'}+{self.second.component or '?'}"


def find_horizontals(records: Sequence[Record]) -> Horizontals:
    """The two horizontals among the components of one motion.

    Parameters
    ----------
    records : sequence of Record
        All components of a file, or of the files of one motion; vertical ones are left out.

    Raises
    ------
    RecordError
        There are not two, they are no pair (same or skew directions, different stations, sampling
        or start), or their lengths differ by much.
    """
    source = "+".join(dict.fromkeys(record.source for record in records))
    matches = [record for record in records if not is_vertical(record.component)]
    if len(matches) == 1:
        raise SingleHorizontal(source, matches[0].component)
    if len(matches) != 2:
        names = (
            ", ".join(record.component or record.id or record.source for record in matches)
            or "none"
        )
        raise RecordError(
            f"{source}: two horizontal components are needed, there are {len(matches)}: {names}"
        )
    first, second = matches
    notes = []

    # At right angles, by azimuths or by names that say so; unknown names are believed.
    ahead, behind = azimuth(first.component), azimuth(second.component)
    if not at_right_angles(first.component, second.component):
        names = f"{first.component or 'one'} and {second.component or 'the other'}"
        if ahead is not None and behind is not None:
            angle = abs((behind - ahead + 90.0) % 180.0 - 90.0)
            raise RecordError(f"{source}: {names} are {angle:g} degrees apart, not at right angles")
        if (
            first.component.strip()
            and first.component.strip().upper() == second.component.strip().upper()
        ):
            raise RecordError(f"{source}: both components are called {first.component}")
        notes.append(
            f"directions unknown from the names: {names} are taken as two horizontals at right "
            "angles"
        )

    # Of one instrument: step, station and start are the same, the samples are not.
    if not isclose(first.dt, second.dt, rel_tol=1e-6):
        raise RecordError(
            f"{source}: the components are sampled at {first.dt:g} and {second.dt:g} s"
        )
    stations = [".".join(record.id.split(".")[:2]).strip(".") for record in (first, second)]
    if all(stations) and stations[0] != stations[1]:
        raise RecordError(
            f"{source}: the components are of different stations, {stations[0]} and {stations[1]}"
        )
    events = parse_event(first.event), parse_event(second.event)
    if all(event.is_known for event in events) and not is_same_event(*events):
        raise RecordError(
            f"{source}: the components are of different events, {first.event} and {second.event}"
        )
    if first.start and second.start:
        late = (
            datetime.fromisoformat(second.start) - datetime.fromisoformat(first.start)
        ).total_seconds()
        if abs(late) > 0.5 * first.dt:
            raise RecordError(
                f"{source}: the components begin {abs(late):g} s apart; cut both to the same start "
                "first"
            )
    if (
        first.acceleration.size == second.acceleration.size
        and (first.acceleration == second.acceleration).all()
    ):
        raise RecordError(f"{source}: both components are the same")

    # The first is the one from which the second is turned clockwise.
    first, second, cut = _of_equal_length(first, second, source)
    if ahead is not None and behind is not None and (behind - ahead) % 360.0 > 180.0:
        first, second = second, first
    return Horizontals(first, second, (*notes, *cut))


def is_vertical(component: str) -> bool:
    """Whether a component's name says up or down."""
    return bool(_VERTICAL.fullmatch(component.strip()))


def azimuth(component: str) -> float | None:
    """Degrees from north towards east by a component's name (067, N23E, EW, HNE); None if it tells
    none."""
    name = component.strip()
    if _AZIMUTH.fullmatch(name):
        return float(name) if int(name) >= _LEAST_AZIMUTH or name in ("0", "00", "000") else None
    if match := _QUADRANT.fullmatch(name):
        angle = float(match[2]) * (1.0 if match[3].upper() == "E" else -1.0)
        return angle % 360.0 if match[1].upper() == "N" else (180.0 - angle) % 360.0
    return 0.0 if _NORTH.fullmatch(name) else 90.0 if _EAST.fullmatch(name) else None


def at_right_angles(component: str, other: str) -> bool:
    """Whether the names of two components say that they are: by their azimuths (000, EW, HNE), or
    as HN1 and HN2, X and Y do."""
    first, second = azimuth(component), azimuth(other)
    if first is not None and second is not None:
        return abs(abs((second - first + 90.0) % 180.0 - 90.0) - 90.0) <= _SKEW
    code, partner = component.strip().upper(), other.strip().upper()
    return (
        bool(code and partner) and code[:-1] == partner[:-1] and _AXES.get(code[-1]) == partner[-1]
    )


def _of_equal_length(
    first: Record, second: Record, source: str
) -> tuple[Record, Record, list[str]]:
    """Both without the samples that one of them alone has at its end."""
    sizes = first.acceleration.size, second.acceleration.size
    if sizes[0] == sizes[1]:
        return first, second, []
    size, excess = min(sizes), abs(sizes[0] - sizes[1])
    if excess > _LONGER * max(sizes):
        raise RecordError(
            f"{source}: the components have {sizes[0]} and {sizes[1]} samples; cut them to equal "
            "length"
        )
    longer = first if sizes[0] > size else second
    first, second = (
        replace(record, acceleration=record.acceleration[:size]) for record in (first, second)
    )
    lost = "last sample" if excess == 1 else f"last {excess} samples"
    return (
        first,
        second,
        [
            f"the {lost} of {longer.component or longer.source} left out: the other component is "
            "shorter"
        ],
    )


# ---- Which files hold the two horizontal components of one motion: by the names in use, or by
# names that are given

_KNET = re.compile(r"\.(?P<component>EW|NS|UD)(?=\d?$)", re.IGNORECASE)
_PEER = re.compile(r"[-_]?(?P<component>\d{3}|UP|DOWN|DWN|DN|VERT?|V)(?=\.AT2$)", re.IGNORECASE)
_SEED = re.compile(r"(?<![A-Z0-9])(?P<component>[A-Z][GHLN][ENZ123])(?![A-Z0-9])", re.IGNORECASE)
_ENDING = re.compile(
    r"(?:(?<=[-_])|(?<=\.)(?=\w+\.))"
    r"(?P<component>(?:NS|EW|UD)[12]?|SN|WE|UP|DN|VERT?|FN|FP|H[12]|[NEZXYRT])"
    r"(?=(?:\.[A-Z]\w*){0,2}$)",
    re.IGNORECASE,
)
_DIRECTION = re.compile(
    r"[-_]?(?P<component>(?<!\d)\d{3}|(?<![A-Z0-9])[NS]\d{1,2}[EW])(?=\.[A-Z]\w*$)", re.IGNORECASE
)
"""Direction in degrees at the end of a file name of any format. A number alone does not identify a
component (R001.csv), so this pattern counts only for two files at right angles."""

Failure = TypeVar("Failure", bound=TdintError)

_MARK = "{}"
_LONGEST = 5  # letters by which the names of two components differ
_SHOWN = 4  # files that a message names


@dataclass(frozen=True)
class PairNames:
    """How the files of a pair are named: `first` and `second` with {} for what both share, or as is
    usual without."""

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
            raise UsageError(
                f"{text!r}: write two names with {{}} for what they share, such as "
                "{}_N.AT2,{}_E.AT2"
            )
        return cls(*parts)

    def motion(self, file: str) -> str:
        """The motion that a file belongs to, a name with {} for the component; empty if it has
        neither name."""
        if self == ONE_MOTION:
            return _MARK
        path = Path(file).as_posix()
        for name in (self.first, self.second):
            before, _, after = name.partition(_MARK)
            if match := re.fullmatch(
                f"((?:.*/)?){re.escape(before)}([^/]+){re.escape(after)}", path
            ):
                return f"{match[1]}{match[2]}{_MARK}"
        return ""


USUAL = PairNames()
"""Names as K-NET, PEER and networks give them, and the usual endings."""

ONE_MOTION = PairNames("{}", "{}")
"""All files are of one motion, whatever their names are."""


def motion_name(file: str) -> str:
    """Return the name of a file without its component: equal for the files of one motion.

    Recognized are the endings of K-NET (.EW, .NS2), of PEER's AT2 files (067.AT2, -UP.AT2), channel
    codes (HNE), and before the suffix _N and _E, _NS and _EW, -H1 and -H2, _X and _Y, _FN and _FP,
    with the corresponding vertical components. `motion_names` also recognizes directions in degrees
    in other formats, for which it needs the names of all files.
    """
    return _name_without(file, _component(Path(file).name))


def motion_names(files: Sequence[str]) -> list[str]:
    """Return the motion that each file belongs to: equal for the files of one motion.

    Recognized are the names of `motion_name`, and two files that differ only in a direction at
    their end (GIL-067.mseed and GIL-337.mseed, x_S16W.csv and x_S74E.csv), if the two directions
    are at right angles and no third file is named in the same way.
    """
    names = [motion_name(file) for file in files]

    # Files without a recognized component, by their names without the direction.
    groups: dict[str, list[tuple[int, str]]] = {}
    for place, (file, name) in enumerate(zip(files, names, strict=True)):
        match = _DIRECTION.search(Path(file).name) if name == file else None
        if match:
            key = _name_without(file, match)
            groups.setdefault(key, []).append((place, match["component"]))

    # The same file may be listed more than once (a record with several rows in a table).
    for key, members in groups.items():
        directions = sorted({direction.upper() for _, direction in members})
        if len(directions) == 2 and at_right_angles(*directions):
            for place, _ in members:
                names[place] = key
    return names


def _name_without(file: str, match: re.Match[str] | None) -> str:
    """Return a file name in which a question mark replaces the component that was found."""
    if not match:
        return file
    path = Path(file)
    start, end = match.span("component")
    before = path.name[:start]
    name = before.rstrip("-_") if match.re in (_PEER, _DIRECTION) else before
    channel = match["component"][:2] if match.re is _SEED else ""
    return str(path.with_name(f"{name}{channel}?{path.name[end:]}"))


def files_of_motions(
    files: Sequence[str], names: PairNames = USUAL
) -> tuple[list[tuple[str, ...]], list[str]]:
    """The files of each motion, in the order of the first ones, and those that belong to none by
    the names given.

    Raises
    ------
    UsageError
        No file has one of the names given.
    """
    motions: dict[str, list[str]] = {}
    if names == USUAL:
        named = motion_names(files)
    else:
        named = [file if file == STDIN else names.motion(file) for file in files]
    for file, name in zip(files, named, strict=True):
        motions.setdefault(name, []).append(file)
    others = motions.pop("", [])
    if files and not motions:
        listed = first_few(others, _SHOWN)
        raise UsageError(f"no file is named {names.first} or {names.second}; there are {listed}")
    return [tuple(members) for members in motions.values()], others


def with_component(record: Record, *, in_degrees: bool = False) -> Record:
    """Return a record with the component in its file name, if its file states none.

    `in_degrees` also accepts a direction in degrees at the end of the name, for files that
    `motion_names` has recognized as a pair by their directions.
    """
    name = Path(record.source).name
    match = None if record.component.strip() else _component(name)
    if in_degrees and not match and not record.component.strip():
        match = _DIRECTION.search(name)
    return replace(record, component=match["component"].upper()) if match else record


def told_once(failures: Sequence[Failure]) -> list[Failure | RecordError]:
    """The failures, those of files without a partner as one: with the names that nearly fit each
    other."""
    single = [failure for failure in failures if isinstance(failure, SingleHorizontal)]
    if len(single) < 2:
        return list(failures)
    files = [failure.file for failure in single]
    listed = first_few(files, _SHOWN)
    text = (
        f"{len(files)} files have a single horizontal component and, by their names, no partner: "
        f"{listed}"
    )
    close = Counter(_nearly(files)).most_common(1)
    if close:
        first, second = close[0][0]
        text += (
            f"; if these are pairs, say how they are named: --pairs '{first},{second}' (`pairs` of "
            "a campaign)"
        )
    return [*(failure for failure in failures if failure not in single), RecordError(text)]


def _component(name: str) -> re.Match[str] | None:
    """Where the name of a file tells the component."""
    return next(
        (match for kind in (_KNET, _PEER, _SEED, _ENDING) if (match := kind.search(name))), None
    )


def _nearly(files: Sequence[str]) -> list[tuple[str, str]]:
    """Names of pairs, as `PairNames` has them, by which two of the files each would be one."""
    names = sorted(Path(file).name for file in files)
    patterns: list[tuple[str, str]] = []
    for first, other in map(
        sorted, [*pairwise(names), *pairwise(sorted(names, key=lambda name: name[::-1]))]
    ):
        head = _shared(first, other)
        tail = min(_shared(first[::-1], other[::-1]), len(first) - head, len(other) - head)
        while head and all(text[head - 1 : head + 1].isdigit() for text in (first, other)):
            head -= 1  # 000 and 090 differ as numbers do, not in a digit
        if max(len(first), len(other)) - head - tail > _LONGEST:
            continue
        if head:
            patterns.append((_MARK + first[head:], _MARK + other[head:]))
        elif tail > len(suffix := Path(first).suffix):
            patterns.append(
                (
                    f"{first[: len(first) - tail]}{_MARK}{suffix}",
                    f"{other[: len(other) - tail]}{_MARK}{suffix}",
                )
            )
    return patterns


def _shared(text: str, other: str) -> int:
    """How many letters two texts have in common at their beginning."""
    return next(
        (i for i, (a, b) in enumerate(zip(text, other, strict=False)) if a != b),
        min(len(text), len(other)),
    )
