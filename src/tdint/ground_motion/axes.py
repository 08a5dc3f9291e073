"""Ground motions in two directions: the components of a recording along the axes of a building.

Axis y is 90 degrees clockwise from axis x, seen from above, as east is from north.
"""

from __future__ import annotations

import hashlib
import math
from collections.abc import Callable
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from tdint.errors import RecordError, UsageError
from tdint.ground_motion.record import Record

if TYPE_CHECKING:
    from tdint.ground_motion.horizontals import Horizontals


class PairRecord(Record):
    """Ground motion along two axes, as one motion with a common factor.

    It has a name, times, notes and the number of samples, and no acceleration, peak or spectrum of
    its own: these are attributes of both components, and intensities are those of `intensity_of`.

    Attributes
    ----------
    components : tuple of two Records
        Ground motions along x and y, m/s^2.
    larger : bool
        True if the demands of a building are the larger values of both directions, instead of
        resultants.

    Raises
    ------
    RecordError
        The sampling intervals or the start times of the components differ.
    AttributeError
        The attribute is not defined for two components.
    """

    components: tuple[Record, Record]
    larger: bool

    def __init__(self, along: Record, across: Record, *, larger: bool = False) -> None:
        """Create the ground motion from its components along x and y."""
        names = f"{along.name} and {across.name}"
        if not math.isclose(along.dt, across.dt, rel_tol=1e-9):
            raise RecordError(
                f"{names}: the components of x and y have different sampling intervals, "
                f"{along.dt:g} and {across.dt:g} s; resample one of them"
            )
        if along.start and across.start and along.start != across.start:
            raise RecordError(
                f"{names}: the components of x and y start at different times, {along.start} and "
                f"{across.start}; trim both to the same start"
            )
        # The dataclass is frozen, so that its attributes cannot be assigned.
        attributes = vars(self)
        attributes |= {"components": (along, across), "larger": larger}
        attributes |= {"dt": along.dt, "start": along.start or across.start}
        attributes["scale"] = along.scale if along.scale == across.scale else math.nan
        for name in ("notes", "warnings", "inputs", "processing", "header_checks"):
            both = (*getattr(along, name), *getattr(across, name))
            attributes[name] = tuple(dict.fromkeys(both))
        for name in ("source", "component", "id", "event", "quantity", "units", "units_from"):
            both = (getattr(along, name), getattr(across, name))
            attributes[name] = "+".join(filter(None, dict.fromkeys(both)))

    def __getattr__(self, name: str) -> Any:
        raise AttributeError(
            f"a ground motion in two directions has no {name}: use its `components`, the records "
            "along x and y"
        )

    def _headline(self) -> str:
        return "; ".join(record._headline() for record in self.components)

    @property
    def samples(self) -> int:
        """Number of samples of the longer component."""
        return max(record.samples for record in self.components)

    @property
    def digest(self) -> str:
        """Hexadecimal SHA-256 checksum of both components."""
        parts = [*(record.digest for record in self.components), *["larger"] * self.larger]
        return hashlib.sha256(" ".join(parts).encode()).hexdigest()

    def scaled(self, factor: float) -> PairRecord:
        """Return a copy with both components multiplied by `factor`."""
        x, y = (record.scaled(factor) for record in self.components)
        return PairRecord(x, y, larger=self.larger)


def components_of(record: Record | None) -> tuple[Record | None, Record | None]:
    """Return the ground motions along x and y, None for the ground at rest.

    Raises
    ------
    UsageError
        The record is a single component.
    """
    if isinstance(record, PairRecord):
        return record.components
    if record is not None:
        raise UsageError(
            f"{record.name}: a building with two directions requires both horizontal components; "
            "use a pair of records (`read_horizontals`)"
        )
    return None, None


def pga_of(record: Record) -> float:
    """Return the peak ground acceleration, m/s^2, as `intensity_of`."""
    return float(intensity_of(record, lambda part: part.pga))


def intensity_of(record: Record, value: Callable[[Record], Any]) -> Any:
    """Return an intensity, or an array of intensities, of a ground motion: `value` of the record,
    or the geometric mean of the values of both components of a pair."""
    if not isinstance(record, PairRecord):
        return value(record)
    x, y = map(value, record.components)
    return np.sqrt(x * y)


def along_axes(pair: Horizontals, axis: float | None = None, *, larger: bool = False) -> PairRecord:
    """Return the components of a recording along the axes x and y.

    Components that state their azimuths are rotated: the motion along the axis with azimuth A is
    the projection of the horizontal motion on this axis. Without azimuths, the first component of
    the files acts along x, and the second along y, which a note states.

    Parameters
    ----------
    axis : float | None
        Azimuth of axis x, degrees clockwise from north; None for the azimuth of the first
        component.
    larger : bool
        As in `PairRecord`; default False.
    """
    # Imported here, because most runs have one direction.
    from tdint.ground_motion.horizontals import azimuth

    first, second = (pair.first, pair.second)[:: -1 if pair.exchanged else 1]
    first = replace(first, notes=(*first.notes, *pair.notes))
    first_azimuth, second_azimuth = azimuth(first.component), azimuth(second.component)
    if first_azimuth is None or second_azimuth is None:
        names = " and ".join(record.name for record in (first, second))
        effect = "" if axis is None else f"; the azimuth {axis:g} of axis x has no effect"
        note = f"{names} state no azimuths: the first acts along x, the second along y{effect}"
        return PairRecord(replace(first, notes=(*first.notes, note)), second, larger=larger)
    angles, axis = (first_azimuth, second_azimuth), first_azimuth if axis is None else axis
    # Angles of the components from x towards y. Without a rotation, the samples are unchanged.
    turns = [(angle - axis) % 360.0 for angle in angles]
    if turns == [0.0, 90.0]:
        return PairRecord(first, second, larger=larger)
    directions = np.array([(math.cos(turn), math.sin(turn)) for turn in map(math.radians, turns)])
    # A turn by right angles exchanges the components without rounding.
    is_right = np.remainder(turns, 90.0) == 0.0
    directions[is_right] = np.rint(directions[is_right])
    # Each component is the projection of the motion on its direction, also if the directions are
    # not exactly at right angles.
    samples = np.linalg.solve(directions, [first.acceleration, second.acceleration])
    note = (
        f"rotated from the azimuths {angles[0]:g} and {angles[1]:g} to {axis % 360.0:g} (x) and "
        f"{(axis + 90.0) % 360.0:g} (y)"
    )
    x, y = (
        replace(
            record,
            acceleration=acceleration,
            component=f"{round((axis + turn) % 360.0):03d}",
            notes=(*record.notes, note),
            peaks=(None, None),
        )
        for record, acceleration, turn in zip((first, second), samples, (0.0, 90.0), strict=True)
    )
    return PairRecord(x, y, larger=larger)
