"""Demands of a campaign under the names of SimCenter's workflows: a row for each building and motion."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import groupby
from typing import TYPE_CHECKING, Any, BinaryIO

from tdint.campaign.store.schema import STORIES
from tdint.errors import UsageError
from tdint.output.tables.campaign import write_rows
from tdint.output.tables.table import Column, cell_text

if TYPE_CHECKING:
    from tdint.campaign.store.store import Store

_AT = {name: place for place, name in enumerate(STORIES.columns)}


def write_simcenter(store: Store, stream: BinaryIO) -> None:
    """Write building, record, scale, sample and, for each direction: 1-PFA-FLOOR-DIR (absolute acceleration, m/s^2;
    floor 0 is the ground), 1-PID-STORY-DIR (drift ratio), 1-PRD-1-DIR (roof displacement over height), 1-PFD-FLOOR-DIR
    (displacement, m). The two components of a pair share a row; components that are no pairs but of one record are told
    apart by a column `component` after `record`. Cells of runs without a result are empty.

    Raises
    ------
    UsageError
        The store has no stories.
    """
    stories, directions = _sizes(store)
    names = [name for direction in range(1, directions + 1) for name in demand_names(stories, direction)]
    apart = _share_a_name(store)
    rows = ([*head[: 2 + apart], *head[3:], *cells] for head, cells in _rows(store, stories, directions))
    header = ("building", "record", *("component",) * apart, "scale", "sample", *names)
    write_rows([Column(name, "1", name, name) for name in header], rows, stream)


def demand_names(stories: int, direction: int) -> list[str]:
    """SimCenter's names of the demands of a building with so many stories, in one direction."""
    floors = range(1, stories + 1)
    return [
        *(f"1-PFA-{floor}-{direction}" for floor in (0, *floors)),
        *(f"1-PID-{story}-{direction}" for story in floors),
        f"1-PRD-1-{direction}",
        *(f"1-PFD-{floor}-{direction}" for floor in floors),
    ]


def _sizes(store: Store) -> tuple[int, int]:
    """The most stories of a building, and the most directions."""
    (stories,) = store.connection.execute("SELECT max(story) FROM story_rows").fetchone()
    if stories is None:
        raise UsageError(
            "SimCenter's names are those of stories: ask for them in the campaign file, outputs: {stories: true}"
        )
    (directions,) = store.connection.execute("SELECT max(direction) FROM records").fetchone()
    return int(stories), int(directions)


def _rows(store: Store, stories: int, directions: int) -> Iterator[tuple[list[Any], list[Any]]]:
    """Of each building, motion, scale and draw what tells it from others, and its demands."""
    buildings, records = store.buildings(), store.records()
    peaks = dict(store.connection.execute("SELECT id, pga_m_s2 FROM records"))
    size = len(demand_names(stories, 1))
    firsts = _firsts(records)
    for building, of_building in groupby(store.stories(), key=lambda row: row[0]):
        found: dict[tuple[int, float, int], list[Any]] = {}
        for (record, scale, sample), of_run in groupby(of_building, key=lambda row: row[1:4]):
            direction = records[record][2]
            cells = found.setdefault((firsts[record], scale, sample), [None] * (size * directions))
            start = size * (direction - 1)
            cells[start : start + size] = _demands(list(of_run), abs(scale) * peaks[record], stories)
        for (record, scale, sample), cells in found.items():
            name, component, _ = records[record]
            yield [cell_text(buildings[building][0]), cell_text(name), cell_text(component), scale, sample], cells


def _share_a_name(store: Store) -> bool:
    """Whether motions that have rows of their own bear one name."""
    names = [name for name, _, direction in store.records().values() if direction == 1]
    return len(set(names)) < len(names)


def _firsts(records: Any) -> dict[int, int]:
    """The number of the first component of each motion's pair: itself, or the one before it."""
    return {number: number - (direction - 1) for number, (_, _, direction) in records.items()}


def _demands(rows: list[tuple[Any, ...]], pga: float, stories: int) -> list[Any]:
    """The cells of one run, those of stories that the building does not have empty."""
    rest = [None] * (stories - len(rows))

    def column(name: str) -> list[Any]:
        return [row[_AT[name]] for row in rows]

    heights = column("height_m")
    roof = rows[-1][_AT["peak_displacement_m"]]
    roof_ratio = roof / sum(heights) if all(heights) else None
    return [
        *(pga, *column("peak_absolute_acceleration_m_s2"), *rest),
        *(*column("peak_drift_ratio"), *rest),
        roof_ratio,
        *(*column("peak_displacement_m"), *rest),
    ]
