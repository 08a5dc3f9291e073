"""Reading a grid of ground motions, as the regional workflow of SimCenter has it.

EventGrid.csv names a file for each point (GP_file, Longitude, Latitude), that file the ground motions there (TH_file
and, if they differ, their factor), and NAME.json holds one of these: name, dT, data_x and, of a pair, data_y.
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from tdint.campaign.definition import GridFile
from tdint.campaign.draws import GridMotions, PointMotion, SuiteMotion
from tdint.csv_table import read_table
from tdint.errors import RecordError
from tdint.ground_motion.header_checks.statement import LONGEST_STEP, SHORTEST_STEP
from tdint.ground_motion.horizontals import Horizontals
from tdint.ground_motion.reading.segments import check_possible
from tdint.ground_motion.record import Record
from tdint.input_bytes import MOST_BYTES, read_at_most
from tdint.units import parse_units

_COMPONENTS = {"data_x": "x", "data_y": "y"}


def read_grid(grid: GridFile) -> tuple[tuple[SuiteMotion, ...], GridMotions, list[RecordError]]:
    """The ground motions of a grid, at which points they are, and why others could not be read and are left out.

    Raises
    ------
    ModelError
        The grid cannot be read.
    RecordError
        No point has a motion.
    """
    unit = parse_units(grid.units)
    if unit.quantity != "acceleration":
        raise RecordError(
            f"{grid.file}: the motions of a grid are accelerations, their units are given as {grid.units}"
        )
    folder = Path(grid.file).parent
    motions: list[SuiteMotion] = []
    numbers: dict[str, tuple[int, ...]] = {}
    failures: list[RecordError] = []
    points, of_points = [], []
    for file, place in _points(grid.file):
        found: list[PointMotion] = []
        for name, factor in _motions_at(str(folder / file)):
            if name not in numbers:
                numbers[name] = _add(motions, folder, name, unit.scale, failures)
            if numbers[name]:
                found.append((numbers[name], factor))
        if found:
            points.append(place)
            of_points.append(tuple(found))
    if not points:
        raise RecordError("\n".join(map(str, failures)) or f"{grid.file}: no point has a ground motion")
    return tuple(motions), GridMotions(points, tuple(of_points)), failures


def _points(file: str) -> list[tuple[str, tuple[float, float]]]:
    """The file of each point of a grid, and its longitude and latitude, degrees."""
    columns = ("GP_file", "Longitude", "Latitude")
    table = read_table(file, f"a grid is a CSV file with the columns {', '.join(columns)}", columns=columns)
    table.need(*columns)
    longitude, latitude = table.numbers("Longitude"), table.numbers("Latitude")
    table.check("Longitude", (abs(one) <= 360.0 for one in longitude), "must be from -360 to 360 degrees")
    table.check("Latitude", (abs(one) <= 90.0 for one in latitude), "must be from -90 to 90 degrees")
    return list(zip(table.texts("GP_file", empty=False), zip(longitude, latitude, strict=True), strict=True))


def _motions_at(file: str) -> list[tuple[str, float]]:
    """The ground motions of a point, and their factors."""
    needs = "the file of a grid's point is a CSV file with the column TH_file and, if they differ, factor"
    table = read_table(file, needs, columns=("TH_file", "factor"))
    names = table.texts("TH_file", empty=False)
    if not table.has("factor"):
        return [(name, 1.0) for name in names]
    factors = table.numbers("factor", empty=True)
    table.check("factor", (one != 0.0 for one in factors), "must not be zero")
    return [(name, 1.0 if math.isnan(factor) else factor) for name, factor in zip(names, factors, strict=True)]


def _add(
    motions: list[SuiteMotion], folder: Path, name: str, unit: float, failures: list[RecordError]
) -> tuple[int, ...]:
    """Add the components of a ground motion; their numbers, none if it cannot be read."""
    try:
        records = _read_motion(folder, name, unit)
    except RecordError as error:
        failures.append(error)
        return ()
    whole = records[0] if len(records) == 1 else Horizontals(records[0], records[1])
    first = len(motions)
    for direction, record in enumerate(records, start=1):
        motions.append(SuiteMotion(record, name, record.component, whole, direction))
    return tuple(range(first, len(motions)))


def _read_motion(folder: Path, name: str, scale: float) -> list[Record]:
    file = folder / (name if name.endswith(".json") else f"{name}.json")
    content = _read_json(file)
    if not isinstance(content, Mapping) or "dT" not in content or "data_x" not in content:
        raise RecordError(f"{file}: needs dT and data_x")
    dt = content["dT"]
    if not (isinstance(dt, float) and SHORTEST_STEP <= dt <= LONGEST_STEP):
        limits = f"{SHORTEST_STEP:g} to {LONGEST_STEP:g} s"
        raise RecordError(f"{file}: dT must be a sampling interval, a number from {limits}, got {dt!r:.40}")
    found = []
    for key, component in _COMPONENTS.items():
        if key in content:
            samples = content[key]
            if not isinstance(samples, list) or not all(isinstance(one, float) for one in samples):
                raise RecordError(f"{file}: {key} is no list of numbers")
            record = Record(np.array(samples) * scale, dt, "", "", component, str(file))
            check_possible(record.acceleration, f"{file}: {key}")
            found.append(record)
    if len(found) == 2 and found[0].acceleration.size != found[1].acceleration.size:
        raise RecordError(f"{file}: data_x and data_y have different lengths")
    return found


def _read_json(file: Path) -> object:
    """What a JSON file holds; all its numbers are floats."""
    try:
        data = read_at_most(file, MOST_BYTES, RecordError)
    except (OSError, ValueError) as error:
        raise RecordError(f"{file}: cannot be read: {getattr(error, 'strerror', None) or error}") from None
    if len(data) > MOST_BYTES:
        raise RecordError(f"{file}: larger than {MOST_BYTES // 1024**2} MiB; this is no ground motion")
    try:
        found: object = json.loads(data, parse_int=float)
    except (ValueError, RecursionError) as error:
        raise RecordError(f"{file}: not JSON: {error}") from None
    return found
