"""What a file of recordings says, as typed values. `tdint.model.recorded.read` reads it."""

from __future__ import annotations

from dataclasses import dataclass

AUTO = "auto"
"""A shift in time that is to be found."""

QUANTITIES = ("acceleration", "displacement")


@dataclass(frozen=True)
class Sensor:
    """Where the motion of one place was recorded.

    Attributes
    ----------
    file : str
        Path, already resolved against the folder of the file that names it.
    component : str or None
        The component to use, None where the file has only one.
    column : str or None
        In place of that: the column of a table.
    units : str or None
        As `tdint.units.parse_units` understands them; None leaves it to the file.
    quantity : str or None
        What the samples must be: one of `QUANTITIES`. None takes what their units say.
    sign : int
        1, or -1 for a sensor that points the other way.
    """

    file: str
    component: str | None = None
    column: str | None = None
    units: str | None = None
    quantity: str | None = None
    sign: int = 1


@dataclass(frozen=True)
class Recording:
    """An event as it was recorded in a building.

    Attributes
    ----------
    name : str
        The file's name without suffix, where it gives none.
    source : str
        The file as the user named it.
    text : bytes
        The file's content, for its SHA-256.
    base : tuple of Sensor
        Those whose mean is the ground motion: accelerations, or what is differentiated to be one.
    floors : tuple of (int, Sensor)
        Floors, counted from 1 at the bottom, and their sensors: absolute acceleration, or displacement relative to the
        base.
    band : tuple of two floats or None
        Frequencies between which recording and result are compared, Hz; None for all.
    window : tuple of two floats or None
        Times between which they are compared, s from the first sample of the base; None for all.
    shift : float or str
        What is added to the times of the floors' recordings, s; `AUTO` to be found.
    """

    name: str
    source: str
    text: bytes
    base: tuple[Sensor, ...]
    floors: tuple[tuple[int, Sensor], ...]
    band: tuple[float, float] | None
    window: tuple[float, float] | None
    shift: float | str

    @property
    def sensors(self) -> tuple[Sensor, ...]:
        """All sensors, those of the base first."""
        return (*self.base, *(sensor for _, sensor in self.floors))
