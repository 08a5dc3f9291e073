"""Read YAML files of recordings to a validated `Recording`; report errors with line and column."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from tdint.model.config.sections import read_sample_units
from tdint.model.keys.document import read_document
from tdint.model.keys.fields import (
    ANY,
    NOT_NEGATIVE,
    POSITIVE,
    ByName,
    Choice,
    Either,
    EntriesOf,
    Key,
    Keys,
    PathOf,
    Value,
    Whole,
    Words,
)

QUANTITIES = ("acceleration", "displacement")


@dataclass(frozen=True)
class Sensor:
    """Recorded motion of a sensor.

    Attributes
    ----------
    file : str
        Path, resolved against the directory of the file that names it.
    component : str or None
        Component of the record; None if the file contains a single component.
    column : str or None
        Column of a table, as an alternative to the component.
    units : str or None
        Units in the notation of `tdint.units.parse_units`; None uses the units in the file.
    quantity : str or None
        Quantity of the samples, an item of `QUANTITIES`; None derives the quantity from the units.
    sign : int
        1, or -1 for a sensor with reversed polarity.
    """

    file: str
    component: str | None = None
    column: str | None = None
    units: str | None = None
    quantity: str | None = None
    sign: int = 1


@dataclass(frozen=True)
class Recording:
    """Recordings of an event in a building.

    Attributes
    ----------
    name : str
        Name of the event; default: the file name without suffix.
    source : str
        File name as specified by the user.
    text : bytes
        Content of the file, for its SHA-256.
    base : tuple of Sensor
        Sensors at the base; the mean of their accelerations is the ground motion. Other quantities
        are differentiated.
    floors : tuple of (int, tuple of Sensor)
        Floors, counted from 1 at the bottom, and their sensors: absolute acceleration, or
        displacement relative to the base.
    band : tuple of two floats or None
        Frequencies between which recording and result are compared, Hz; None for all.
    window : tuple of two floats or None
        Times between which they are compared, s from the first sample of the base; None for all.
    shift : float or str
        Time shift that is added to the times of the floor recordings, s; `AUTO` to estimate it.
    """

    name: str
    source: str
    text: bytes
    base: tuple[Sensor, ...]
    floors: tuple[tuple[int, tuple[Sensor, ...]], ...]
    band: tuple[float, float] | None
    window: tuple[float, float] | None
    shift: float | str


ROOF = "roof"
AUTO = "auto"
"""Value of the time shift that requests an estimate."""

_SENSOR = Keys(
    (
        Key(
            "file",
            PathOf(),
            "the recording",
            needed=True,
            advice="specify the file of the recording",
        ),
        Key("component", Words(), "component of the record, if the file contains several"),
        Key("column", Words(), "for a table instead of a record: name of its column"),
        Key("units", Words(), "units of the samples, if the file does not state them"),
        Key(
            "quantity",
            Choice(QUANTITIES, "quantity"),
            "quantity of the samples; by default, the units decide",
        ),
        Key("sign", Whole(-1, 1, " (a direction)"), "-1 for a sensor with the opposite direction"),
    ),
    what="a file or a mapping with the key file",
    make=lambda value, **given: _sensor(value, **given),
)
_ONE = Either((PathOf(), _SENSOR), _SENSOR.what)
_PLACE = Either(
    (*_ONE.types, EntriesOf(_ONE, 1, None, "a list of files", "must name at least one file")),
    _ONE.what,
)
_BAND = EntriesOf(
    POSITIVE, 2, 2, "a list of two frequencies (Hz) in increasing order", growing=True
)
_WINDOW = EntriesOf(NOT_NEGATIVE, 2, 2, "a list of two times (s) in increasing order", growing=True)
_FLOORS = ByName(
    _PLACE,
    f"a mapping from floors (numbers from 1, or {ROOF}) to their files",
    "must name at least one floor",
    make=lambda value, floors: floors,
)
RECORDING = Keys(
    (
        Key("name", Words(), "name of the event; by default the name of the file"),
        Key(
            "base",
            _PLACE,
            "sensors at the base of the building",
            True,
            "specify the file with the recorded ground motion",
        ),
        Key(
            "floors",
            _FLOORS,
            "floors and their sensors",
            True,
            "specify the floors and their files",
        ),
        Key("band", _BAND, "frequency band in which recorded and computed responses are compared"),
        Key("window", _WINDOW, "time window of the comparison"),
        Key(
            "shift",
            Either((Choice((AUTO,)), ANY), f"{AUTO} or a number of seconds"),
            "time shift that is added to the times of the floors, s",
        ),
    ),
    make=lambda _, **given: given,
)


def load_recording(source: str | Path, stories: int) -> Recording:
    """Read a file of recordings in a building.

    Parameters
    ----------
    source : str or Path
        The YAML file; `-` is standard input. Relative paths refer to the directory of the file.
    stories : int
        Number of stories of the building.

    Raises
    ------
    ModelError
        The file cannot be read, is not YAML or has faults; all faults are reported in one error, in
        file order.
    """
    origin, root = read_document(source, "file of recordings", "`base` and `floors`")
    given = replace(root, type=RECORDING).read()

    # Sort floors by number from the ground up; the roof is the last floor.
    floors: dict[int, tuple[Sensor, ...]] = {}
    for name, (entry, sensors) in given["floors"].items() if given else ():
        floor = (
            stories
            if name == ROOF
            else int(name)
            if name.isascii() and name.isdecimal() and len(name) < 9
            else 0
        )
        if not 1 <= floor <= stories:
            entry.fault(f"must be a floor from 1 to {stories} (the number of stories), or {ROOF}")
        elif floor in floors:
            entry.fault(f"floor {floor} is specified twice")
        floors[floor] = _tuple(sensors)
    root.faults.raise_if_any()
    by_number = tuple(sorted(floors.items()))
    given |= {
        "name": given["name"] or origin.name,
        "base": _tuple(given["base"]),
        "floors": by_number,
    }
    return Recording(
        source=origin.label, text=origin.data, **{**given, "shift": given["shift"] or 0.0}
    )


def _tuple(sensors: Any) -> tuple[Sensor, ...]:
    """Return the sensors as a tuple; convert a file name to a sensor."""
    each = sensors if isinstance(sensors, tuple) else (sensors,)
    return tuple(Sensor(sensor) if isinstance(sensor, str) else sensor for sensor in each)


def _sensor(value: Value, units: str | None, sign: int | None, **given: Any) -> Sensor | None:
    # `column` selects the series of a table, `component` that of a record: they exclude each other.
    column, sign_entry = value.peek("column"), value.peek("sign")
    if column and given["column"] and given["component"]:
        column.fault("`column` applies to tables and `component` to records; omit one of them")
    if sign_entry and sign == 0:
        sign_entry.fault("must be 1 or -1")
    return Sensor(
        units=read_sample_units(value.peek("units"), given["quantity"]), sign=sign or 1, **given
    )
