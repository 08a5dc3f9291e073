"""Pairs of horizontal components of ground motions, identified by their names."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace
from datetime import datetime
from itertools import pairwise
from math import isclose
from os.path import commonprefix
from pathlib import Path
from typing import NamedTuple, TypeVar

from tdint.errors import RecordError, TdintError, UsageError
from tdint.files import STDIN
from tdint.ground_motion.events import is_same_event, parse_event
from tdint.ground_motion.record import Record, component_names
from tdint.items import grouped
from tdint.number_parsing import abbreviate

_VERTICAL = r"(?i)UP?|D(OW)?N|DWN|V|VER|VERT|VERTICAL|U-?D\d?|([A-Z]{2})?Z"
_WITH_LOCATION = r"([A-Z][GHLN][ENZ12])\d\d"
"""Pattern of a SEED channel code followed by the location code, as in files of NGA-East (BHZ00)."""
_AZIMUTH = r"\d{1,3}"
_QUADRANT = r"(?i)([NS])(\d{1,2})([EW])"
_NORTH = r"(?i)N-?S\d?|([A-Z]{2})?N"
_EAST = r"(?i)E-?W\d?|([A-Z]{2})?E"
_MIN_AZIMUTH = 4  # degrees; the component names 1, 2 and 3 are channel numbers
_PERPENDICULAR_AXES = ({"1", "2"}, {"X", "Y"}, {"R", "T"}, {"N", "P"})
"""Last characters of the names of two perpendicular components, for example HN1 and HN2, radial and
transverse (R, T), fault-normal and fault-parallel (FN, FP)."""

_ANGLE_TOLERANCE = 5.0
"""Maximum deviation of the angle between two components from a right angle, degrees."""

_MAX_TRIMMED = 0.05
"""Maximum fraction of the longer component that is removed to obtain equal lengths."""


class SingleHorizontal(RecordError):
    """Error for a file with a single horizontal component.

    Attributes
    ----------
    component : str
        Name of the component; empty if the file does not state it.
    """

    def __init__(self, file: str, component: str) -> None:
        """Create the error with its message; the parameters are the attributes of the class."""
        self.file, self.component = file, component
        name = component or "without a name"
        super().__init__(
            f"{file}: the file has only one horizontal component, {name}; also specify the "
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
    exchanged : bool
        True if the files contain `second` before `first`.
    """

    first: Record
    second: Record
    notes: tuple[str, ...] = ()
    exchanged: bool = False

    @property
    def source(self) -> str:
        """File name, or the names of both files joined by +."""
        return "+".join(dict.fromkeys((self.first.source, self.second.source)))

    @property
    def component(self) -> str:
        """Names of the components joined by +; an unknown name is a question mark."""
        first, second = (*component_names([self.first]), *component_names([self.second]))
        return f"{first or '?'}+{second or '?'}"

    @property
    def name(self) -> str:
        """File names and component names separated by a space."""
        return f"{self.source} {self.component}"


def find_horizontals(records: Sequence[Record]) -> Horizontals:
    """Select and validate the two horizontal components of a single ground motion.

    Parameters
    ----------
    records : sequence of Record
        All components of a file, or of the files of a single ground motion; vertical components are
        omitted.

    Returns
    -------
    Horizontals
        Components of equal length. If both names state directions, the second component is
        clockwise from the first.

    Raises
    ------
    RecordError
        The number of horizontal components is not two; they are not a pair (directions not
        perpendicular, different stations, events, sampling intervals or start times, or equal
        samples); or their lengths differ by more than 5 %.
    """
    source = "+".join(dict.fromkeys(record.source for record in records))
    horizontals = [record for record in records if not is_vertical(record.component)]
    if len(horizontals) == 1:
        raise SingleHorizontal(source, horizontals[0].component)
    if len(horizontals) != 2:
        names = (
            ", ".join(
                name or record.id or record.source
                for record, name in zip(horizontals, component_names(horizontals), strict=True)
            )
            or "none"
        )
        raise RecordError(
            f"{source}: two horizontal components are required, but the source contains "
            f"{len(horizontals)}: {names}"
        )
    first, second = horizontals
    notes = _check_directions(first, second, source)
    _check_same_recording(first, second, source)
    # The excess samples at the end of the longer component are removed.
    sizes = first.acceleration.size, second.acceleration.size
    if sizes[0] != sizes[1]:
        _check_lengths(first, second, source)  # raises RecordError if they differ by more than 5 %
        excess, longer = abs(sizes[0] - sizes[1]), first if sizes[0] > sizes[1] else second
        first, second = (
            replace(record, acceleration=record.acceleration[: min(sizes)])
            for record in (first, second)
        )
        notes.append(
            f"{'last sample' if excess == 1 else f'last {excess} samples'} of "
            f"{longer.component or longer.source} omitted, because the other component is shorter"
        )
    # The components are exchanged if the second is counterclockwise from the first.
    first_azimuth, second_azimuth = azimuth(first.component), azimuth(second.component)
    is_counterclockwise = False
    if first_azimuth is not None and second_azimuth is not None:
        is_counterclockwise = (second_azimuth - first_azimuth) % 360.0 > 180.0
        if is_counterclockwise:
            first, second = second, first
    return Horizontals(first, second, tuple(notes), is_counterclockwise)


def _check_directions(first: Record, second: Record, source: str) -> list[str]:
    """Raise RecordError if the names of two components state that they are not perpendicular. Names
    without directions, such as A and B, are accepted; the returned note states the assumption.
    """
    if at_right_angles(first.component, second.component):
        return []
    names = f"{first.component or 'one'} and {second.component or 'the other'}"
    angle = _angle_between(first.component, second.component)
    if angle is not None:
        raise RecordError(
            f"{source}: two components at right angles are required, but the directions "
            f"{names} differ by {angle:.4g} degrees; select two other components"
        )
    first_name, second_name = first.component.strip().upper(), second.component.strip().upper()
    if first_name and first_name == second_name:
        raise RecordError(
            f"{source}: both components are called {first.component}; select two different "
            "components"
        )
    return [
        f"the names do not state directions: {names} are assumed to be two perpendicular "
        "horizontal components"
    ]


def _check_same_recording(first: Record, second: Record, source: str) -> None:
    """Raise RecordError if two components are not from the same recording, or if they are the same
    component.

    The sampling interval, station, event and start must agree. The samples must differ.
    """
    _check_sampling_intervals(first, second, source)
    # Network and station are the first two codes of the id NET.STA.LOC.CHA.
    stations = [".".join(record.id.split(".")[:2]).strip(".") for record in (first, second)]
    if all(stations) and stations[0] != stations[1]:
        raise RecordError(
            f"{source}: the components are of different stations, {stations[0]} and {stations[1]}; "
            "select two components of one recording"
        )
    _check_events(first, second, source)
    if first.start and second.start:
        delay = (
            datetime.fromisoformat(second.start) - datetime.fromisoformat(first.start)
        ).total_seconds()
        if abs(delay) > 0.5 * first.dt:
            raise RecordError(
                f"{source}: the components start {abs(delay):.6g} s apart; trim both to the same "
                "start first"
            )
    if (
        first.acceleration.size == second.acceleration.size
        and (first.acceleration == second.acceleration).all()
    ):
        raise RecordError(
            f"{source}: both components are identical; select two different components"
        )


def check_components(first: Record, second: Record) -> None:
    """Raise RecordError if two components, which are a pair by their file names, are not from the
    same recording.

    Raises
    ------
    RecordError
        Sampling intervals, lengths or events are different. The message names both files.
    """
    source = "+".join(dict.fromkeys((first.source, second.source)))
    _check_sampling_intervals(first, second, source)
    _check_events(first, second, source)
    _check_lengths(first, second, source)


def _check_sampling_intervals(first: Record, second: Record, source: str) -> None:
    """Raise RecordError if the sampling intervals of two components differ by more than
    rounding."""
    if not isclose(first.dt, second.dt, rel_tol=1e-6):
        raise RecordError(
            f"{source}: the components have different sampling intervals, {first.dt:g} and "
            f"{second.dt:g} s; resample one of them"
        )


def _check_events(first: Record, second: Record, source: str) -> None:
    """Raise RecordError if the files of two components name different earthquakes.

    A file without the name of an earthquake is accepted.
    """
    events = parse_event(first.event), parse_event(second.event)
    if all(event.is_known for event in events) and not is_same_event(*events):
        raise RecordError(
            f"{source}: the components are of different events, {first.event} and {second.event}; "
            "select two components of one recording"
        )


def _check_lengths(first: Record, second: Record, source: str) -> None:
    """Raise RecordError if the lengths of two components differ by more than 5 %."""
    sizes = first.acceleration.size, second.acceleration.size
    if abs(sizes[0] - sizes[1]) > _MAX_TRIMMED * max(sizes):
        raise RecordError(
            f"{source}: the components have {sizes[0]} and {sizes[1]} samples; trim them to "
            "equal length"
        )


def is_vertical(component: str) -> bool:
    """Return True if the name of a component is a vertical direction."""
    return bool(re.fullmatch(_VERTICAL, _channel_code(component)))


def azimuth(component: str) -> float | None:
    """Return the azimuth that a component name states, degrees clockwise from north.

    Recognized are degrees (067), quadrants (N23E is 23, S10W is 190), and names of north and east
    (NS, HNN, EW, HNE).

    Returns
    -------
    float | None
        Azimuth from 0 to 360; a number above 360 is returned unchanged. None if the name states no
        direction.
    """
    name = _channel_code(component)
    if re.fullmatch(_AZIMUTH, name):
        # The numbers 1 to 3 are channel numbers, not directions.
        is_direction = int(name) >= _MIN_AZIMUTH or name in ("0", "00", "000")
        return float(name) if is_direction else None
    if match := re.fullmatch(_QUADRANT, name):
        # The angle is measured from north or south towards east or west.
        angle = float(match[2]) * (1.0 if match[3] == "E" else -1.0)
        return angle % 360.0 if match[1] == "N" else (180.0 - angle) % 360.0
    if re.fullmatch(_NORTH, name):
        return 0.0
    return 90.0 if re.fullmatch(_EAST, name) else None


def _channel_code(component: str) -> str:
    """Return a component name in upper case, without the location after a channel code."""
    name = component.strip().upper()
    match = re.fullmatch(_WITH_LOCATION, name, re.I)
    return match[1] if match else name


def _angle_between(component: str, other: str) -> float | None:
    """Return the angle between two directions, degrees; None if a name states no direction."""
    first, second = azimuth(component), azimuth(other)
    if first is None or second is None:
        return None
    # Opposite directions are parallel, so the angle is between 0 and 90 degrees.
    return abs((second - first + 90.0) % 180.0 - 90.0)


def at_right_angles(component: str, other: str) -> bool:
    """Return True if two component names are perpendicular: by their azimuths (000, EW, HNE), or as
    a pair such as HN1 and HN2 or X and Y. Of names that differ in one word, such as the columns
    acc_N and acc_E, this word counts."""
    words, other_words = (re.split(r"[\s_.:-]+", name.strip()) for name in (component, other))
    differing = [pair for pair in zip(words, other_words, strict=False) if pair[0] != pair[1]]
    if len(words) == len(other_words) > 1 and len(differing) == 1:
        component, other = differing[0]
    angle = _angle_between(component, other)
    if angle is not None:
        return abs(angle - 90.0) <= _ANGLE_TOLERANCE
    name, other_name = map(_channel_code, (component, other))
    # R01 and R02 are numbers of motions.
    return (
        bool(name and other_name)
        and name[:-1] == other_name[:-1]
        and not name[-2:-1].isdigit()
        and {name[-1], other_name[-1]} in _PERPENDICULAR_AXES
    )


# ---- Grouping of files into pairs of horizontal components, by usual or user-specified names

_KNET = r"(?i)\.(?P<component>EW|NS|UD)(?=\d?$)"
_NGA_EAST = rf"(?i)(?<![A-Z0-9])(?P<component>{_WITH_LOCATION})(?=\.AT2$)"
_PEER = r"(?i)[-_]?(?P<component>\d{3}|UP|DOWN|DWN|DN|VERT?|V)(?=\.AT2$)"
_SEED = r"(?i)(?<![A-Z0-9])(?P<component>[A-Z][GHLN][ENZ123])(?![A-Z0-9])"
_ENDING = (
    r"(?i)(?:(?<=[-_])|(?<=\.)(?=\w+\.))"
    r"(?P<component>(?:NS|EW|UD)[12]?|SN|WE|UP|DN|VERT?|FN|FP|H[12]|[NEZXYRT])"
    r"(?=(?:\.[A-Z]\w*){0,2}$)"
)
_DIRECTION = r"(?i)[-_]?(?P<component>(?<!\d)\d{3}|(?<![A-Z0-9])[NS]\d{1,2}[EW])(?=\.[A-Z]\w*$)"
"""Direction in degrees at the end of a file name of any format. A number is not necessarily a
component (R001.csv), so this pattern counts only for two files at right angles."""

Failure = TypeVar("Failure", bound=TdintError)

_PLACEHOLDER = "{}"  # represents the common part of two file names in a pattern
_MAX_DIFFERENCE = 5
"""Maximum number of different characters in the file names of two components of a pair."""

_MAX_LISTED_FILES = 4  # maximum number of files that a message lists


class PairNames(NamedTuple):
    """Patterns of the file names of the two components of a ground motion.

    Attributes
    ----------
    first, second : str
        Pattern of each component, with {} for the part that is common to both names. If both are
        empty, usual names are recognized.
    """

    first: str = ""
    second: str = ""

    @classmethod
    def parse(cls, text: str) -> PairNames:
        """Parse two names separated by a comma: `{}_N.AT2,{}_E.AT2`.

        Raises
        ------
        UsageError
            The text does not contain two different names with exactly one {} per name.
        """
        parts = [part.strip() for part in text.split(",")]
        are_patterns = all(part.count(_PLACEHOLDER) == 1 for part in parts)
        if len(parts) != 2 or parts[0] == parts[1] or not are_patterns:
            raise UsageError(
                f"{text!r}: must be two file name patterns with {{}} for the common part, such as "
                f"{{}}_N.AT2,{{}}_E.AT2"
            )
        return cls(*parts)

    def motion(self, file: str) -> str:
        """Return the name of the ground motion of a file, with {} instead of the component; empty
        if the file matches neither name."""
        if self == ONE_MOTION:
            return _PLACEHOLDER
        path = Path(file).as_posix()
        for pattern in (self.first, self.second):
            before, _, after = pattern.partition(_PLACEHOLDER)
            # The first group is the directory, the second group the common part of the names.
            expression = f"((?:.*/)?){re.escape(before)}([^/]+){re.escape(after)}"
            if match := re.fullmatch(expression, path):
                directory, common_part = match[1], match[2]
                return f"{directory}{common_part}{_PLACEHOLDER}"
        return ""


USUAL = PairNames()
"""Names used by K-NET, PEER and networks, and other usual endings."""

ONE_MOTION = PairNames("{}", "{}")
"""All files belong to the same ground motion, regardless of their names."""


def motion_name(file: str) -> str:
    """Return the name of a file with a question mark instead of its component.

    The files of a single ground motion have the same result. If no component is recognized, the
    name is unchanged. The recognized components are

        .EW, .NS2                  extension of a K-NET file
        067.AT2, -UP.AT2, BH100    end of the name of a PEER file
        HNE                        channel code of a seismic network
        x_N.csv, x_EW.csv,         end of the name of any file before its extension: also E, NS,
        x-H1.csv, x_FP.csv         H2, X, Y, FN, and vertical components such as Z and UP

    `motion_names` also recognizes directions in degrees in other formats, for which it needs the
    names of all files.
    """
    return _replace_component(file, _find_component(Path(file).name))


def motion_names(files: Sequence[str]) -> list[str]:
    """Return the name of the ground motion of each file, which is equal for the files of a single
    ground motion.

    Recognized are the names of `motion_name`, and two files that differ only in a direction at
    their end (GIL-067.mseed and GIL-337.mseed, x_S16W.csv and x_S74E.csv), if the two directions
    are at right angles and no third file is named in the same way.

    Returns
    -------
    list of str
        Name for each file, with a question mark instead of the component; the file name if no
        component was recognized.
    """
    names = [motion_name(file) for file in files]

    # Files without a recognized component are grouped by their names without the direction.
    groups: dict[str, list[tuple[int, str]]] = {}  # (index in files, direction) of each file
    for index, (file, name) in enumerate(zip(files, names, strict=True)):
        match = re.search(_DIRECTION, Path(file).name) if name == file else None
        if match:
            group_name = _replace_component(file, match)
            groups.setdefault(group_name, []).append((index, match["component"]))

    # Directions are compared without repetition, because a file may be listed more than once (a
    # record with several rows in a table).
    for group_name, members in groups.items():
        directions = sorted({direction.upper() for _, direction in members})
        if len(directions) == 2 and at_right_angles(*directions):
            for index, _ in members:
                names[index] = group_name
    return names


def pair_name(first: str, second: str) -> str:
    """Return the name of a pair in two files with both components, such as `CLC..HNE+HNN.mseed`; of
    files that do not differ in a recognized component, the name of the first file."""
    matches = [_find_component(Path(file).name) for file in (first, second)]
    if not all(matches):
        matches = [re.search(_DIRECTION, Path(file).name) for file in (first, second)]
    if first == second or not (matches[0] and matches[1]):
        return first
    name = Path(first).name
    start, end = matches[0].span("component")
    both = f"{matches[0]['component']}+{matches[1]['component']}"
    return str(Path(first).with_name(f"{name[:start]}{both}{name[end:]}"))


def _replace_component(file: str, match: re.Match[str] | None) -> str:
    """Replace the component (group `component` of the match in the last part of the file name) by a
    question mark. Without a match, the name is unchanged.
    """
    if not match:
        return file
    path = Path(file)
    start, end = match.span("component")
    before = path.name[:start]
    # The separator before a direction is optional, so that it does not distinguish ground motions.
    name = before.rstrip("-_") if match.re.pattern in (_PEER, _DIRECTION) else before
    # The first two characters of a channel code (HN of HNE) identify the instrument, and are kept.
    # The digits after the code are the location.
    is_code = match.re.pattern in (_SEED, _NGA_EAST)
    instrument, location = (match["component"][:2], match["component"][3:]) if is_code else ("", "")
    return str(path.with_name(f"{name}{instrument}?{location}{path.name[end:]}"))


def files_of_motions(
    files: Sequence[str], names: PairNames = USUAL
) -> tuple[list[tuple[str, ...]], list[str]]:
    """Group files by ground motion.

    Parameters
    ----------
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
    if names == USUAL:
        motion_of_file = motion_names(files)
    else:
        motion_of_file = [file if file == STDIN else names.motion(file) for file in files]
    motions = grouped(zip(motion_of_file, files, strict=True))
    others = motions.pop("", [])  # the motion name of a file that matches no pattern is empty
    if files and not motions:
        listed = abbreviate(others, _MAX_LISTED_FILES)
        raise UsageError(
            f"no file name matches {names.first} or {names.second}; the files are {listed}"
        )
    return [tuple(members) for members in motions.values()], others


def component_in_name(file: str) -> str:
    """Return the component in the name of a file, also in degrees; empty without a component."""
    match = _find_component(Path(file).name, in_degrees=True)
    return match["component"] if match else ""


def with_component(record: Record, *, in_degrees: bool = False) -> Record:
    """Return a record with the component that its file name states, if the record has no component.

    Parameters
    ----------
    in_degrees : bool
        True to accept also a direction in degrees at the end of the file name, for files that
        `motion_names` has recognized as a pair by their directions. The default is False.
    """
    if record.component.strip():
        return record
    match = _find_component(Path(record.source).name, in_degrees=in_degrees)
    return replace(record, component=match["component"].upper()) if match else record


def recordings(records: Sequence[Record], names: PairNames = USUAL) -> list[list[Record]]:
    """Return the components of a file or of a group of files as one recording, or if they have more
    than two horizontal components, divided by station and, for the files of an archive, by names
    that differ only in the component. A record without a component has that of its file name.
    """
    parts: dict[tuple[str, str], list[Record]] = {("", ""): [*records]}
    if sum(not is_vertical(record.component) for record in records) > 2:
        parts = {}
        motions = motion_names([record.source for record in records])
        for record, motion in zip(records, motions, strict=True):
            station, _, _ = record.id.rpartition(".")
            parts.setdefault((motion, station), []).append(record)
    # With the usual names, two files may differ in a direction in degrees.
    are_usual = names == USUAL
    return [
        [
            with_component(record, in_degrees=are_usual and len({r.source for r in part}) == 2)
            for record in part
        ]
        for part in parts.values()
    ]


def combine_single_components(failures: Sequence[Failure]) -> list[Failure | RecordError]:
    """Combine the errors of all files with a single horizontal component into one error.

    The combined error suggests file name patterns if the names of the files are similar.

    Parameters
    ----------
    failures : sequence of TdintError
        Errors of the files that could not be read as pairs.

    Returns
    -------
    list of TdintError
        Other errors in the same order, then the combined error. Fewer than two errors of single
        components are not combined.
    """
    single = [failure for failure in failures if isinstance(failure, SingleHorizontal)]
    if len(single) < 2:
        return list(failures)
    files = [failure.file for failure in single]
    listed = abbreviate(files, _MAX_LISTED_FILES)
    text = (
        f"{len(files)} files contain a single horizontal component without a matching second "
        f"component: {listed}"
    )
    most_common = Counter(_suggested_patterns(files)).most_common(1)
    if most_common:
        (first, second), _count = most_common[0]
        text += (
            f"; if these are pairs, specify their file names: --pairs '{first},{second}' "
            "(`pairs` of a campaign)"
        )
    return [*(failure for failure in failures if failure not in single), RecordError(text)]


def _find_component(name: str, *, in_degrees: bool = False) -> re.Match[str] | None:
    """Return the match of the component in a file name without directories, in its group
    `component`; None if no pattern matches. With `in_degrees`, the name of a component may also be
    a direction in degrees."""
    patterns = (_KNET, _NGA_EAST, _PEER, _SEED, _ENDING, *((_DIRECTION,) if in_degrees else ()))
    return next((match for pattern in patterns if (match := re.search(pattern, name))), None)


def _suggested_patterns(files: Sequence[str]) -> list[tuple[str, str]]:
    """Return pairs of file name patterns that could identify the components of a single ground
    motion, in the form of `PairNames`.

    Each pair matches two different names, which differ in a few characters. A pair of patterns is
    repeated for each pair of names that it matches.
    """
    # Names with a common start are neighbors in alphabetical order. Names with a common end are
    # neighbors in the order of the reversed names. Equal names in different directories count one
    # time.
    by_start = sorted({Path(file).name for file in files})
    by_end = sorted(by_start, key=lambda name: name[::-1])
    patterns: list[tuple[str, str]] = []
    for first, other in map(sorted, [*pairwise(by_start), *pairwise(by_end)]):
        # `start` is the number of equal characters at the start of both names, and `end` at their
        # end. The two parts must not overlap.
        start = len(commonprefix([first, other]))  # noqa: RUF071  of letters
        end = len(commonprefix([first[::-1], other[::-1]]))  # noqa: RUF071  of letters
        end = min(end, len(first) - start, len(other) - start)
        # The common start must not end inside a number of either name: a000 and a090 give {}000 and
        # {}090, not {}00 and {}90; a1 and a10 give {}1 and {}10.
        while start and any(_is_in_number(text, start) for text in (first, other)):
            start -= 1
        if max(len(first), len(other)) - start - end > _MAX_DIFFERENCE:
            continue
        suffix = Path(first).suffix
        # A common start becomes {}: a_N.csv and a_E.csv give {}N.csv and {}E.csv. Otherwise, the
        # common end without the suffix becomes {}: N_a.csv and E_a.csv give N{}.csv and E{}.csv.
        if start:
            patterns.append((_PLACEHOLDER + first[start:], _PLACEHOLDER + other[start:]))
        elif end > len(suffix):
            patterns.append(
                (
                    f"{first[: len(first) - end]}{_PLACEHOLDER}{suffix}",
                    f"{other[: len(other) - end]}{_PLACEHOLDER}{suffix}",
                )
            )
    return patterns


def _is_in_number(text: str, index: int) -> bool:
    """Return True if the characters of a text before and at an index are both digits."""
    return text[index - 1 : index].isdigit() and text[index : index + 1].isdigit()
