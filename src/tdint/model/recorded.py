"""Files of recordings: YAML to a checked `Recording`, with every fault at its line and column."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path

from tdint.model.config.units import read_sample_units
from tdint.model.keys.document import read_document
from tdint.model.keys.fields import Section, Value
from tdint.model.keys.kinds import ANY, NOT_NEGATIVE, POSITIVE
from tdint.model.keys.nodes import MappingNode, ScalarNode

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
    floors : tuple of (int, tuple of Sensor)
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
    floors: tuple[tuple[int, tuple[Sensor, ...]], ...]
    band: tuple[float, float] | None
    window: tuple[float, float] | None
    shift: float | str

    @property
    def sensors(self) -> tuple[Sensor, ...]:
        """All sensors, those of the base first."""
        return (*self.base, *(sensor for _, sensors in self.floors for sensor in sensors))


_KEYS = ("name", "base", "floors", "band", "window", "shift")
_SENSOR_KEYS = ("file", "component", "column", "units", "quantity", "sign")
_SENSOR = "a file or a mapping with the key file"
ROOF = "roof"


def load_recording(source: str | Path, stories: int) -> Recording:
    """Read a file of recordings made in a building with so many stories.

    Parameters
    ----------
    source : str or Path
        The YAML file; `-` is standard input. Relative paths in it start from its folder.

    Raises
    ------
    ModelError
        The file cannot be read, is not YAML or has faults; all faults are reported in one error, in file order.
    """
    origin, root = read_document(source, "file of recordings", "`base` and `floors`")
    section = root.section(_KEYS)
    recording = None
    if section:
        base = section.need("base", "give the file that the ground's motion was recorded in, or a list of them")
        floors = section.need("floors", "give the floors and the files that their motions were recorded in")
        recording = Recording(
            name=section.text("name") or origin.name,
            source=origin.label,
            text=origin.data,
            base=_read_place(base) if base else (),
            floors=_read_floors(floors, stories) if floors else (),
            band=_read_pair(section, "band", "two frequencies (Hz), the lower one first", lowest_open=True),
            window=_read_pair(section, "window", "two times (s), the earlier one first", lowest_open=False),
            shift=_read_shift(section.get("shift")),
        )
    root.faults.raise_if_any()
    assert recording is not None
    return recording


def _read_place(value: Value) -> tuple[Sensor, ...]:
    """One sensor or a list of them."""
    if not value.is_list:
        return tuple(filter(None, [_read_sensor(value)]))
    items = value.items("a list of files", "must name at least one file") or ()
    return tuple(filter(None, [_read_sensor(item) for item in items]))


def _read_floors(value: Value, stories: int) -> tuple[tuple[int, tuple[Sensor, ...]], ...]:
    """The sensors by floor, from the ground up."""
    node = value.node
    if not isinstance(node, MappingNode):
        value.section((), f"a mapping from floors (1 to {stories}, or {ROOF}) to their files")
        return ()
    names = [key.text for key, _ in node.entries if isinstance(key, ScalarNode)]
    section = value.section(names)
    assert section is not None
    if not node.entries:
        value.fault("must name at least one floor")
    found: dict[int, tuple[Sensor, ...]] = {}
    for name in dict.fromkeys(names):
        entry = section.get(name)
        if entry is None:
            continue
        floor = stories if name == ROOF else int(name) if name.isascii() and name.isdecimal() and len(name) < 9 else 0
        if not 1 <= floor <= stories:
            entry.fault(f"must be a floor from 1 to {stories} (the number of stories), or {ROOF}")
        elif floor in found:
            entry.fault(f"floor {floor} is given twice")
        if sensors := _read_place(entry):
            found[floor] = sensors
    return tuple(sorted(found.items()))


def _read_sensor(value: Value) -> Sensor | None:
    if not value.is_list and not value.is_mapping:
        file = value.file(stdin=True)
        return Sensor(file) if file else None
    section = value.section(_SENSOR_KEYS, _SENSOR)
    if section is None:
        return None
    section.need("file", "give the file of the recording")
    column = section.get("column")
    if column and section.has("component"):
        column.fault("is for a table, component for a record; leave one of them out")
    said = section.get("quantity")
    quantity = said.choice(QUANTITIES, "quantity") if said else None
    sign = section.get("sign")
    return Sensor(
        file=section.file("file", stdin=True) or "",
        component=section.text("component"),
        column=column.text() if column else None,
        units=read_sample_units(section.get("units"), quantity),
        quantity=quantity,
        sign=_read_sign(sign) if sign else 1,
    )


def _read_sign(value: Value) -> int:
    number = value.number(ANY)
    if not math.isnan(number) and abs(number) != 1.0:
        value.fault("must be 1 or -1")
    return -1 if number < 0.0 else 1


def _read_pair(section: Section, name: str, what: str, *, lowest_open: bool) -> tuple[float, float] | None:
    """Two growing numbers; None if they are left out or faulty."""
    value = section.get(name)
    items = value.items(f"a list of {what}") if value else None
    if value is None or items is None:
        return None
    if len(items) != 2:
        value.fault(f"must be a list of {what}, got {len(items)}")
        return None
    low, high = items[0].number(POSITIVE if lowest_open else NOT_NEGATIVE), items[1].number(POSITIVE)
    if low >= high:
        value.fault(f"must be {what}")
    return low, high


def _read_shift(value: Value | None) -> float | str:
    if value is None:
        return 0.0
    return AUTO if value.is_word(AUTO) else value.number(ANY, what=f"{AUTO} or a number of seconds")
