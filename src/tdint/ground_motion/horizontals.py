"""The two horizontal components of a motion, found by their names."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from datetime import datetime
from math import isclose

from tdint.errors import RecordError
from tdint.ground_motion.record import Record

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
        super().__init__(f"{file}: has a single horizontal component, {whose}; name the file of the other one, too")

    def __reduce__(self) -> tuple[type[SingleHorizontal], tuple[str, str]]:
        return type(self), (self.file, self.component)


@dataclass(frozen=True)
class Horizontals:
    """Two horizontal components at right angles, of equal sampling and length.

    Where both names tell a direction the second component lies 90 degrees clockwise of the first one.

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
        There are not two, they are no pair (same or skew directions, different stations, sampling or start), or their
        lengths differ by much.
    """
    source = "+".join(dict.fromkeys(record.source for record in records))
    found = [record for record in records if not is_vertical(record.component)]
    if len(found) == 1:
        raise SingleHorizontal(source, found[0].component)
    if len(found) != 2:
        names = ", ".join(record.component or record.id or record.source for record in found) or "none"
        raise RecordError(f"{source}: two horizontal components are needed, there are {len(found)}: {names}")
    first, second = found
    notes = [*_check_directions(first, second, source), *_check_instrument(first, second, source)]
    first, second, cut = _of_equal_length(first, second, source)
    ahead, behind = azimuth(first.component), azimuth(second.component)
    if ahead is not None and behind is not None and (behind - ahead) % 360.0 > 180.0:
        first, second = second, first
    return Horizontals(first, second, (*notes, *cut))


def is_vertical(component: str) -> bool:
    """Whether a component's name says up or down."""
    return bool(_VERTICAL.fullmatch(component.strip()))


def azimuth(component: str) -> float | None:
    """Degrees from north towards east by a component's name (067, N23E, EW, HNE); None if it tells none."""
    name = component.strip()
    if _AZIMUTH.fullmatch(name):
        return float(name) if int(name) >= _LEAST_AZIMUTH or name in ("0", "00", "000") else None
    if match := _QUADRANT.fullmatch(name):
        angle = float(match[2]) * (1.0 if match[3].upper() == "E" else -1.0)
        return angle % 360.0 if match[1].upper() == "N" else (180.0 - angle) % 360.0
    return 0.0 if _NORTH.fullmatch(name) else 90.0 if _EAST.fullmatch(name) else None


def at_right_angles(one: str, other: str) -> bool:
    """Whether the names of two components say that they are: by their azimuths (000, EW, HNE), or as HN1 and HN2, X and
    Y do."""
    first, second = azimuth(one), azimuth(other)
    if first is not None and second is not None:
        return abs(abs((second - first + 90.0) % 180.0 - 90.0) - 90.0) <= _SKEW
    code, partner = one.strip().upper(), other.strip().upper()
    return bool(code and partner) and code[:-1] == partner[:-1] and _AXES.get(code[-1]) == partner[-1]


def _check_directions(first: Record, second: Record, source: str) -> list[str]:
    one, other = azimuth(first.component), azimuth(second.component)
    names = f"{first.component or 'one'} and {second.component or 'the other'}"
    if one is not None and other is not None:
        angle = abs((other - one + 90.0) % 180.0 - 90.0)
        if not at_right_angles(first.component, second.component):
            raise RecordError(f"{source}: {names} are {angle:g} degrees apart, not at right angles")
        return []
    if at_right_angles(first.component, second.component):
        return []
    if first.component.strip() and first.component.strip().upper() == second.component.strip().upper():
        raise RecordError(f"{source}: both components are called {first.component}")
    return [f"directions unknown from the names: {names} are taken as two horizontals at right angles"]


def _check_instrument(first: Record, second: Record, source: str) -> list[str]:
    if not isclose(first.dt, second.dt, rel_tol=1e-6):
        raise RecordError(f"{source}: the components are sampled at {first.dt:g} and {second.dt:g} s")
    stations = [".".join(record.id.split(".")[:2]).strip(".") for record in (first, second)]
    if all(stations) and stations[0] != stations[1]:
        raise RecordError(f"{source}: the components are of different stations, {stations[0]} and {stations[1]}")
    if first.start and second.start:
        late = (datetime.fromisoformat(second.start) - datetime.fromisoformat(first.start)).total_seconds()
        if abs(late) > 0.5 * first.dt:
            raise RecordError(f"{source}: the components begin {abs(late):g} s apart; cut both to the same start first")
    if first.acceleration.size == second.acceleration.size and (first.acceleration == second.acceleration).all():
        raise RecordError(f"{source}: both components are the same")
    return []


def _of_equal_length(first: Record, second: Record, source: str) -> tuple[Record, Record, list[str]]:
    """Both without the samples that one of them alone has at its end."""
    sizes = first.acceleration.size, second.acceleration.size
    if sizes[0] == sizes[1]:
        return first, second, []
    size, excess = min(sizes), abs(sizes[0] - sizes[1])
    if excess > _LONGER * max(sizes):
        raise RecordError(f"{source}: the components have {sizes[0]} and {sizes[1]} samples; cut them to equal length")
    longer = first if sizes[0] > size else second
    first, second = (replace(record, acceleration=record.acceleration[:size]) for record in (first, second))
    what = "last sample" if excess == 1 else f"last {excess} samples"
    return (
        first,
        second,
        [f"the {what} of {longer.component or longer.source} left out: the other component is shorter"],
    )
