"""Pairs of horizontal components of ground motions, identified by their names."""

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
from tdint.number_parsing import abbreviate

_VERTICAL = re.compile(r"UP?|D(OW)?N|DWN|V|VER|VERT|VERTICAL|U-?D\d?|([A-Z]{2})?Z", re.IGNORECASE)
_AZIMUTH = re.compile(r"\d{1,3}")
_QUADRANT = re.compile(r"([NS])(\d{1,2})([EW])", re.IGNORECASE)
_NORTH = re.compile(r"N-?S\d?|([A-Z]{2})?N", re.IGNORECASE)
_EAST = re.compile(r"E-?W\d?|([A-Z]{2})?E", re.IGNORECASE)
_LEAST_AZIMUTH = 4  # degrees; 1, 2 and 3 are channel numbers
_AXES = {"1": "2", "2": "1", "X": "Y", "Y": "X", "R": "T", "T": "R", "N": "P", "P": "N"}
"""Last letters of names of perpendicular components; FN and FP are fault-normal and
fault-parallel."""

_SKEW = 5.0
"""Degrees; permitted deviation of the components from a right angle."""

_LONGER = 0.05
"""Maximum fraction of the longer component that is removed to obtain equal lengths."""


class SingleHorizontal(RecordError):
    """Error for a file with only one horizontal component."""

    def __init__(self, file: str, component: str) -> None:
        self.file, self.component = file, component
        whose = component or "one"
        super().__init__(
            f"{file}: the file has only one horizontal component, {whose}; also specify the "
            "file of the other component"
        )


@dataclass(frozen=True)
class Horizontals:
    """Two perpendicular horizontal components with the same sampling interval and length.

    If both names state a direction, the second component is 90 degrees clockwise from the first.

    Attributes
    ----------
    first, second : Record
        Components.
    notes : tuple of str
        Notes about assumptions and omitted samples.
    """

    first: Record
    second: Record
    notes: tuple[str, ...] = ()

    @property
    def source(self) -> str:
        """File, or both files joined by +."""
        return "+".join(dict.fromkeys((self.first.source, self.second.source)))

    @property
    def component(self) -> str:
        """Names of the components joined by +."""
        return f"{self.first.component or '?'}+{self.second.component or '?'}"


def find_horizontals(records: Sequence[Record]) -> Horizontals:
    """Return the two horizontal components of one ground motion.

    Parameters
    ----------
    records : sequence of Record
        All components of a file, or of the files of one ground motion; vertical components are
        omitted.

    Raises
    ------
    RecordError
        The number of horizontal components is not two; they are not a pair (directions not
        perpendicular, different stations, events, sampling intervals or start times, or equal
        samples); or their lengths differ by more than 5 %.
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
            f"{source}: two horizontal components are required, but the source contains "
            f"{len(matches)}: {names}"
        )
    first, second = matches
    notes = []

    # The components must be perpendicular by their azimuths or names. Unknown names are accepted
    # with a note.
    ahead, behind = azimuth(first.component), azimuth(second.component)
    if not at_right_angles(first.component, second.component):
        names = f"{first.component or 'one'} and {second.component or 'the other'}"
        if ahead is not None and behind is not None:
            angle = abs((behind - ahead + 90.0) % 180.0 - 90.0)
            raise RecordError(
                f"{source}: two components at right angles are required, but the directions "
                f"{names} differ by {angle:.4g} degrees; select two other components"
            )
        if (
            first.component.strip()
            and first.component.strip().upper() == second.component.strip().upper()
        ):
            raise RecordError(f"{source}: both components are called {first.component}")
        notes.append(
            f"the names do not state directions: {names} are assumed to be two perpendicular "
            "horizontal components"
        )

    # The components must have the same time step, station, event and start, but different samples.
    _refuse_steps(first, second, source)
    stations = [".".join(record.id.split(".")[:2]).strip(".") for record in (first, second)]
    if all(stations) and stations[0] != stations[1]:
        raise RecordError(
            f"{source}: the components are of different stations, {stations[0]} and {stations[1]}"
        )
    _refuse_events(first, second, source)
    if first.start and second.start:
        late = (
            datetime.fromisoformat(second.start) - datetime.fromisoformat(first.start)
        ).total_seconds()
        if abs(late) > 0.5 * first.dt:
            raise RecordError(
                f"{source}: the components start {abs(late):.6g} s apart; trim both to the same "
                "start first"
            )
    if (
        first.acceleration.size == second.acceleration.size
        and (first.acceleration == second.acceleration).all()
    ):
        raise RecordError(
            f"{source}: both components are identical; select two different components"
        )

    # Order the components so that the second is clockwise from the first.
    first, second, cut = _of_equal_length(first, second, source)
    if ahead is not None and behind is not None and (behind - ahead) % 360.0 > 180.0:
        first, second = second, first
    return Horizontals(first, second, (*notes, *cut))


def check_components(first: Record, second: Record) -> None:
    """Refuse two components that are one recording by their names, but not by their contents.

    Parameters
    ----------
    first, second : Record
        Horizontal components.

    Raises
    ------
    RecordError
        Sampling intervals, lengths or events are different. The message names both files.
    """
    source = "+".join(dict.fromkeys((first.source, second.source)))
    _refuse_steps(first, second, source)
    _refuse_events(first, second, source)
    _refuse_lengths(first, second, source)


def _refuse_steps(first: Record, second: Record, source: str) -> None:
    """Raise RecordError if the sampling intervals of two components are different.

    Parameters
    ----------
    first, second : Record
        Horizontal components.
    source : str
        Names of the files, for messages.
    """
    if not isclose(first.dt, second.dt, rel_tol=1e-6):
        raise RecordError(
            f"{source}: the components have different sampling intervals, {first.dt:g} and "
            f"{second.dt:g} s; resample one of them"
        )


def _refuse_events(first: Record, second: Record, source: str) -> None:
    """Raise RecordError if two components are of different events.

    Parameters
    ----------
    first, second : Record
        Horizontal components.
    source : str
        Names of the files, for messages.
    """
    events = parse_event(first.event), parse_event(second.event)
    if all(event.is_known for event in events) and not is_same_event(*events):
        raise RecordError(
            f"{source}: the components are of different events, {first.event} and {second.event}"
        )


def _refuse_lengths(first: Record, second: Record, source: str) -> None:
    """Raise RecordError if two components differ in length by more than a few samples.

    Parameters
    ----------
    first, second : Record
        Horizontal components.
    source : str
        Names of the files, for messages.
    """
    sizes = first.acceleration.size, second.acceleration.size
    if abs(sizes[0] - sizes[1]) > _LONGER * max(sizes):
        raise RecordError(
            f"{source}: the components have {sizes[0]} and {sizes[1]} samples; trim them to "
            "equal length"
        )


def is_vertical(component: str) -> bool:
    """Return True if the name of a component is a vertical direction."""
    return bool(_VERTICAL.fullmatch(component.strip()))


def azimuth(component: str) -> float | None:
    """Return the azimuth in a component name (067, N23E, EW, HNE), degrees clockwise from north;
    None if the name states no direction."""
    name = component.strip()
    if _AZIMUTH.fullmatch(name):
        return float(name) if int(name) >= _LEAST_AZIMUTH or name in ("0", "00", "000") else None
    if match := _QUADRANT.fullmatch(name):
        angle = float(match[2]) * (1.0 if match[3].upper() == "E" else -1.0)
        return angle % 360.0 if match[1].upper() == "N" else (180.0 - angle) % 360.0
    return 0.0 if _NORTH.fullmatch(name) else 90.0 if _EAST.fullmatch(name) else None


def at_right_angles(component: str, other: str) -> bool:
    """Return True if two component names are perpendicular: by their azimuths (000, EW, HNE), or as
    a pair such as HN1 and HN2 or X and Y."""
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
    """Remove the excess samples at the end of the longer component; also return a note.

    Parameters
    ----------
    first, second : Record
        Components.
    source : str
        File names, for messages.
    """
    sizes = first.acceleration.size, second.acceleration.size
    if sizes[0] == sizes[1]:
        return first, second, []
    size, excess = min(sizes), abs(sizes[0] - sizes[1])
    _refuse_lengths(first, second, source)
    longer = first if sizes[0] > size else second
    first, second = (
        replace(record, acceleration=record.acceleration[:size]) for record in (first, second)
    )
    lost = "last sample" if excess == 1 else f"last {excess} samples"
    return (
        first,
        second,
        [
            f"{lost} of {longer.component or longer.source} omitted, because the other "
            "component is shorter"
        ],
    )


# ---- Grouping of files into pairs of horizontal components, by usual or user-specified names

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

_MARK = "{}"  # placeholder for the common part of two file names
_LONGEST = 5  # characters; maximum different part of the names of two components
_SHOWN = 4  # maximum number of files in a message


@dataclass(frozen=True)
class PairNames:
    """File names of pairs: `first` and `second` with {} for the common part; if both are empty, the
    usual names are recognized."""

    first: str = ""
    second: str = ""

    @classmethod
    def parse(cls, text: str) -> PairNames:
        """Parse two names separated by a comma: `{}_N.AT2,{}_E.AT2`.

        Raises
        ------
        UsageError
            The text does not contain two different names with exactly one {} in each.
        """
        parts = [part.strip() for part in text.split(",")]
        if len(parts) != 2 or parts[0] == parts[1] or any(part.count(_MARK) != 1 for part in parts):
            raise UsageError(
                f"{text!r}: must be two file name patterns with {{}} for the common part, such as "
                f"{{}}_N.AT2,{{}}_E.AT2"
            )
        return cls(*parts)

    def motion(self, file: str) -> str:
        """Return the name of the ground motion of a file, with {} instead of the component; empty
        if the file matches neither name."""
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
"""Names used by K-NET, PEER and networks, and other usual endings."""

ONE_MOTION = PairNames("{}", "{}")
"""All files belong to one ground motion, regardless of their names."""


def motion_name(file: str) -> str:
    """Return the name of a file without its component: equal for the files of one motion.

    Recognized are the endings of K-NET (.EW, .NS2), of PEER AT2 files (067.AT2, -UP.AT2), channel
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
    """Group files by ground motion.

    Parameters
    ----------
    files : sequence of str
        File names.
    names : PairNames
        File names of pairs. Default: the usual names.

    Returns
    -------
    groups : list of tuple of str
        Files of each ground motion, in the order of their first files.
    others : list of str
        Files that do not match `names`.

    Raises
    ------
    UsageError
        No file matches the names.
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
        listed = abbreviate(others, _SHOWN)
        raise UsageError(
            f"no file name matches {names.first} or {names.second}; the files are {listed}"
        )
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
    """Combine the errors of files with a single horizontal component into one error, which suggests
    names of pairs."""
    single = [failure for failure in failures if isinstance(failure, SingleHorizontal)]
    if len(single) < 2:
        return list(failures)
    files = [failure.file for failure in single]
    listed = abbreviate(files, _SHOWN)
    text = (
        f"{len(files)} files contain a single horizontal component without a matching second "
        f"component: {listed}"
    )
    close = Counter(_nearly(files)).most_common(1)
    if close:
        first, second = close[0][0]
        text += (
            f"; if these are pairs, specify their file names: --pairs '{first},{second}' "
            "(`pairs` of a campaign)"
        )
    return [*(failure for failure in failures if failure not in single), RecordError(text)]


def _component(name: str) -> re.Match[str] | None:
    """Return the match of the component in a file name; None if no pattern matches."""
    return next(
        (match for kind in (_KNET, _PEER, _SEED, _ENDING) if (match := kind.search(name))), None
    )


def _nearly(files: Sequence[str]) -> list[tuple[str, str]]:
    """Return names of pairs, in the form of `PairNames`, that match two of the files each."""
    names = sorted(Path(file).name for file in files)
    patterns: list[tuple[str, str]] = []
    for first, other in map(
        sorted, [*pairwise(names), *pairwise(sorted(names, key=lambda name: name[::-1]))]
    ):
        head = _shared(first, other)
        tail = min(_shared(first[::-1], other[::-1]), len(first) - head, len(other) - head)
        while head and all(text[head - 1 : head + 1].isdigit() for text in (first, other)):
            head -= 1  # 000 and 090 are compared as numbers, not by digits
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
    """Return the length of the common start of two texts.

    Parameters
    ----------
    text, other : str
        Texts to compare.
    """
    return next(
        (i for i, (a, b) in enumerate(zip(text, other, strict=False)) if a != b),
        min(len(text), len(other)),
    )
