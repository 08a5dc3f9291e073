"""Read YAML files of recordings to a validated `Recording`; report errors with line and column."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from tdint.model.config.sections import read_sample_units
from tdint.model.keys import fields
from tdint.model.keys.document import read_document
from tdint.studies.keys import keys

QUANTITIES = ("acceleration", "displacement")


@dataclass(frozen=True)
class Sensor:
    """Recorded motion of a sensor.

    Attributes
    ----------
    file : str
        Path, resolved against the directory of the file that names it.
    component : str | None
        Component of the record; None if the file contains a single component.
    column : str | None
        Column of a table, as an alternative to the component.
    units : str | None
        Units in the notation of `tdint.units.parse_units`; None uses the units in the file.
    quantity : str | None
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
        Sensors at the base; the mean of their accelerations is the ground motion. Of other
        quantities, this is the acceleration of a spline.
    floors : tuple of (int, tuple of Sensor)
        Floors, counted from 1 at the bottom, and their sensors: absolute acceleration, or
        displacement relative to the base.
    band : tuple of two floats | None
        Frequencies between which recording and result are compared, Hz; None for all.
    window : tuple of two floats | None
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


AUTO = "auto"
"""Value of the time shift that requests an estimate."""

_SENSOR = fields.Keys(
    keys(
        "sensor",
        quantity=fields.Choice(QUANTITIES, "quantity"),
        sign=fields.Integer(-1, 1, " (a direction)"),
    ),
    description="a file or a mapping with the key file",
    make=lambda value, **entries: _make_sensor(value, **entries),
)
# A sensor is the name of a file or a mapping; a location may have several sensors.
_SENSOR_FORMS = fields.Either((fields.PathOf(), _SENSOR), _SENSOR.description)
_SENSORS = fields.Either(
    (
        *_SENSOR_FORMS.types,
        fields.EntriesOf(_SENSOR_FORMS, 1, None, "a list of files", "must name at least one file"),
    ),
    _SENSOR_FORMS.description,
)
_BAND = fields.EntriesOf(
    fields.POSITIVE, 2, 2, "a list of two frequencies (Hz) in increasing order", growing=True
)
_WINDOW = fields.EntriesOf(
    fields.NOT_NEGATIVE, 2, 2, "a list of two times (s) in increasing order", growing=True
)
_FLOORS = fields.NamedEntries(
    _SENSORS,
    description=f"a mapping from floors (numbers from 1, or {fields.ROOF}) to their files",
    empty_message="must name at least one floor",
)
RECORDING = fields.Keys(
    keys(
        "recording",
        base=_SENSORS,
        floors=_FLOORS,
        band=_BAND,
        window=_WINDOW,
        shift=fields.Either((fields.Choice((AUTO,)), fields.ANY), f"{AUTO} or a number of seconds"),
    ),
    make=lambda _, **entries: entries,
)


def load_recording(source: str | Path, stories: int) -> Recording:
    """Read a file of recordings in a building.

    Parameters
    ----------
    source : str or Path
        The YAML file; `-` is standard input. Relative paths refer to the directory of the file.

    Raises
    ------
    ModelError
        The file cannot be read, is not YAML or has invalid entries; all errors are reported in a
        single error, in file order.
    """
    origin, root = read_document(source, "file of recordings", "`base` and `floors`")
    entries = root._replace(type=RECORDING).read()

    # Convert the names of the floors to numbers; the roof is the last floor. Numbers with many
    # digits, which Python may refuse to convert, are invalid in any case.
    floors: dict[int, tuple[Sensor, ...]] = {}
    for name, (entry, sensors) in entries["floors"].items() if entries else ():
        if name == fields.ROOF:
            floor = stories
        elif name.isascii() and name.isdecimal() and len(name) < 9:
            floor = int(name)
        else:
            floor = 0  # represents an invalid name
        if not 1 <= floor <= stories:
            entry.fault(
                f"must be a floor from 1 to {stories} (the number of stories), or {fields.ROOF}"
            )
        elif floor in floors:
            entry.fault(f"floor {floor} is specified twice")
        floors[floor] = _sensor_tuple(sensors)
    root.faults.raise_if_any()
    by_number = tuple(sorted(floors.items()))
    entries |= {
        "name": entries["name"] or origin.name,
        "base": _sensor_tuple(entries["base"]),
        "floors": by_number,
    }
    # Without the key `shift`, the floors and the base have the same clock.
    entries["shift"] = entries["shift"] or 0.0
    return Recording(source=origin.label, text=origin.data, **entries)


def _sensor_tuple(sensors: Any) -> tuple[Sensor, ...]:
    """Return one or several sensors as a tuple, with file names converted to sensors."""
    listed = sensors if isinstance(sensors, tuple) else (sensors,)
    return tuple(Sensor(sensor) if isinstance(sensor, str) else sensor for sensor in listed)


def _make_sensor(
    value: fields.Value, units: str | None, sign: int | None, **entries: Any
) -> Sensor | None:
    """Return the sensor of a mapping, and report errors in the combination of its entries.

    `units` is the text of the key `units`; it is read again together with the quantity. `sign` is
    the value of the key `sign`; None if it is missing.
    """
    # `column` selects a series in a table, `component` a series in a record.
    column, sign_entry = value.peek("column"), value.peek("sign")
    if column and entries["column"] and entries["component"]:
        column.fault("`column` applies to tables and `component` to records; omit one")
    if sign_entry and sign == 0:
        sign_entry.fault("must be 1 or -1")
    return Sensor(
        units=read_sample_units(value.peek("units"), entries["quantity"]), sign=sign or 1, **entries
    )
