"""The tables of a store. Numbers stand for buildings and records; the views `runs` and `stories` show their names,
under the columns of the CSV files."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from typing import Any

from tdint.analysis.run.outcome import STORY
from tdint.campaign.engine.rows import DEMANDED, HIDDEN, RUN, RUN_WITH_ERROR, RunRow, StoryRow

VERSION = "5"
"""Of the layout; another one is not read."""

_KEY = {"building": int, "record": int, "scale": float, "sample": int}

_RUN = _KEY | {one.column: one.kind for one in RUN}
_RUN |= {f"{one.column}_error": float for one in RUN_WITH_ERROR}
_RUN |= {f"corrected_{one.column}": float for one in RUN_WITH_ERROR}
_STORY = _KEY | {"story": int, "height_m": float} | {one.column: one.kind for one in STORY}
_STORY |= {f"{one.column}_error": float for one in STORY}
_SHOCK = _KEY | {"shock": int, "start_s": float, "pga_m_s2": float} | {one.column: one.kind for one in DEMANDED}

RUN_COLUMNS = tuple(_RUN)
"""Of the table of runs, in the order of `tdint.campaign.engine.rows.RunRow`."""

STORY_COLUMNS = tuple(_STORY)
"""Of the table of stories, in the order of `tdint.campaign.engine.rows.StoryRow`."""

SHOCK_COLUMNS = tuple(_SHOCK)
"""Of the table of shocks, in the order of `tdint.campaign.engine.rows.ShockRow`."""

_HIDDEN = tuple(one.column for one in RUN if one.shown == HIDDEN)
SHOWN_RUN = tuple(name for name in RUN_COLUMNS if name not in _HIDDEN)
"""What runs.csv shows of a run, after its names; errors only of a campaign that has estimated them."""

_TYPES = {int: "INTEGER", str: "TEXT NOT NULL"}


def _columns(kinds: dict[str, type]) -> str:
    return ", ".join(f"{name} {_TYPES.get(kind, 'REAL')}" for name, kind in kinds.items())


def _view(name: str, table: str, names: tuple[str, ...], key: str) -> str:
    shown = ", ".join(f"{table}.{one}" for one in names if one not in (*_KEY, "dt_s"))
    method = "b.method AS method, " if table == "run_rows" else ""
    step = f"{table}.dt_s, " if table == "run_rows" else ""
    return (
        f"CREATE VIEW {name} AS SELECT b.name AS building, m.name AS record, m.component AS component, "
        f"{table}.scale, {table}.sample, {method}{step}{shown} FROM {table} "
        f"JOIN buildings b ON b.id = {table}.building JOIN records m ON m.id = {table}.record ORDER BY {key}"
    )


TABLES = (
    "CREATE TABLE meta(key TEXT PRIMARY KEY, value TEXT NOT NULL) WITHOUT ROWID",
    "CREATE TABLE buildings(id INTEGER PRIMARY KEY, name TEXT NOT NULL, method TEXT NOT NULL, stories INTEGER NOT NULL,"
    " sha256 TEXT NOT NULL)",
    "CREATE INDEX building_names ON buildings(name)",
    "CREATE TABLE records(id INTEGER PRIMARY KEY, name TEXT NOT NULL, component TEXT NOT NULL, direction INTEGER NOT"
    " NULL, dt_s REAL NOT NULL, samples INTEGER NOT NULL, pga_m_s2 REAL NOT NULL, pgv_m_s REAL NOT NULL, sha256 TEXT"
    " NOT NULL)",
    "CREATE TABLE chunks(id INTEGER PRIMARY KEY, runs INTEGER NOT NULL, stories INTEGER NOT NULL, seconds REAL NOT"
    " NULL, sha256 TEXT NOT NULL)",
    f"CREATE TABLE run_rows({_columns(_RUN)}, chunk INTEGER NOT NULL, PRIMARY KEY({', '.join(_KEY)})) WITHOUT ROWID",
    f"CREATE TABLE story_rows({_columns(_STORY)}, chunk INTEGER NOT NULL, PRIMARY KEY({', '.join(_KEY)}, story))"
    " WITHOUT ROWID",
    f"CREATE TABLE shock_rows({_columns(_SHOCK)}, chunk INTEGER NOT NULL, PRIMARY KEY({', '.join(_KEY)}, shock))"
    " WITHOUT ROWID",
    "CREATE TABLE inventory(building INTEGER PRIMARY KEY, cells TEXT NOT NULL)",
    "CREATE TABLE building_types(building INTEGER PRIMARY KEY, type TEXT NOT NULL, divisor REAL NOT NULL, period_s REAL"
    " NOT NULL)",
    "CREATE TABLE unused(kind TEXT NOT NULL, reason TEXT NOT NULL, PRIMARY KEY(kind, reason))",
    "CREATE TABLE written(file TEXT NOT NULL, sha256 TEXT NOT NULL, PRIMARY KEY(file, sha256))",
    _view("runs", "run_rows", SHOWN_RUN, ", ".join(f"run_rows.{name}" for name in _KEY)),
    _view("stories", "story_rows", STORY_COLUMNS, ", ".join(f"story_rows.{name}" for name in (*_KEY, "story"))),
    _view("shocks", "shock_rows", SHOCK_COLUMNS, ", ".join(f"shock_rows.{name}" for name in (*_KEY, "shock"))),
)
"""What makes an empty store."""

INSERT_RUN = f"INSERT INTO run_rows VALUES({', '.join('?' * (len(RUN_COLUMNS) + 1))})"
INSERT_STORY = f"INSERT INTO story_rows VALUES({', '.join('?' * (len(STORY_COLUMNS) + 1))})"

INSERT_SHOCK = f"INSERT INTO shock_rows VALUES({', '.join('?' * (len(SHOCK_COLUMNS) + 1))})"


def plain_run(row: RunRow) -> tuple[Any, ...]:
    """The values of a run as SQLite gives them back: nan is nothing there, and a column has one type."""
    return _plain(_RUN.values(), (*row[:-2], *row.errors, *row.corrected))


def run_of(row: Sequence[Any]) -> RunRow:
    """The run whose plain values these are."""
    told = len(RUN_WITH_ERROR)
    own = len(RUN_COLUMNS) - 2 * told
    return RunRow(*row[:own])._replace(errors=tuple(row[own : own + told]), corrected=tuple(row[own + told :]))


def plain_story(row: StoryRow) -> tuple[Any, ...]:
    """The values of a story as SQLite gives them back."""
    return _plain(_STORY.values(), (*row[:-2], *row.values, *row.errors))


def plain_shock(row: Sequence[Any]) -> tuple[Any, ...]:
    """The values of a shock as SQLite gives them back."""
    return _plain(_SHOCK.values(), row)


def _plain(kinds: Collection[type], row: Sequence[Any]) -> tuple[Any, ...]:
    """Values without errors are followed by nothing."""
    whole = (*row, *[None] * (len(kinds) - len(row)))
    return tuple(
        None if value is None or value != value else kind(value) for kind, value in zip(kinds, whole, strict=True)
    )
