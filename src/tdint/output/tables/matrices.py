"""Tables of models of matrices and flexural stories: rows, moments, rotations."""

from __future__ import annotations

from typing import Any

import numpy as np

from tdint.output.tables.columns import declared
from tdint.output.tables.table import Column, Table, columns_of, error_columns
from tdint.response.runs.flexure import FLEXURE_QUANTITIES, FlexureValues
from tdint.response.runs.outcome import STORY_QUANTITIES, Response
from tdint.units import OutputUnits

FLEXURE_COLUMNS = columns_of(FlexureValues)
"""Further columns of stories.csv for flexural stories."""
FLEXURE_ERROR = error_columns(FLEXURE_COLUMNS)

(ROW_NAME,) = declared("matrices.row_name", row=lambda model: np.array(model.rows))
_OF_ROWS = {
    "residual_drift": ("residual_displacement_m", "displacement at the end of the run"),
    "peak_displacement": ("peak_displacement_m", "maximum absolute displacement"),
    "peak_velocity": ("peak_velocity_m_s", "maximum absolute velocity"),
    "peak_absolute_acceleration": (
        "peak_absolute_acceleration_m_s2",
        "maximum absolute acceleration: relative acceleration plus influence x ground acceleration",
    ),
}
ROW_COLUMNS = tuple(
    Column.of_quantity(quantity)._replace(name=_OF_ROWS[quantity.name][0], meaning=text)
    for quantity in STORY_QUANTITIES
    if quantity.name in _OF_ROWS
    for text in (_OF_ROWS[quantity.name][1],)
)
"""Columns of rows.csv: the rows of `matrices`, relative to the ground."""
ROW_ERROR = error_columns(ROW_COLUMNS)

_OF_BASE = tuple(quantity for quantity in FLEXURE_QUANTITIES if "table" not in quantity.shown)
BASE_COLUMNS = tuple(Column.of_quantity(quantity) for quantity in _OF_BASE)
COLUMNS = (
    *(*FLEXURE_COLUMNS, *FLEXURE_ERROR, *BASE_COLUMNS, *error_columns(BASE_COLUMNS)),
    *(ROW_NAME, *ROW_COLUMNS, *ROW_ERROR),
)
"""All columns and keys of models with matrices."""


def row_table(response: Response) -> Table:
    """Return the table of the rows of a model that are not floors."""
    errors = response.check.errors if response.check else None
    names = (ROW_NAME,), response.model
    return Table.joined(names, (ROW_COLUMNS, response.stories), (ROW_ERROR, errors))


def flexure_groups(response: Response) -> tuple[tuple[tuple[Column, ...], Any], ...]:
    """Return the columns of flexural stories with their results (None for other stories, or without
    error estimates)."""
    peaks = response.flexure
    return (FLEXURE_COLUMNS, peaks), (FLEXURE_ERROR, peaks and peaks.errors)


def linear_sentences(response: Response, units: OutputUnits) -> list[str]:
    """Return a sentence on the moment at the base of flexural stories, and its motion."""
    flexure = response.flexure
    if flexure is None:
        return []
    moment = units.text(float(flexure.peak_moment[0]), "N*m")
    total = units.text(flexure.total_base_moment, "N*m")
    texts = [f"base moment {moment} (restoring; {total} with viscous forces)"]
    if flexure.base_rotation:
        texts.append(f"base rotation {flexure.base_rotation:.4g} rad")
    if flexure.base_displacement:
        texts.append(f"base displacement {units.text(flexure.base_displacement, 'm')}")
    return [", ".join(texts)]


def as_json(response: Response) -> dict[str, Any]:
    """Return the parts of summary.json of such models: `rows`, or `flexure` and `base`."""
    flexure = response.flexure
    if response.model.rows:
        return {"rows": row_table(response).as_dictionaries()}
    if flexure is None:
        return {}
    base = {quantity.column: getattr(flexure, quantity.name) for quantity in _OF_BASE}
    if flexure.errors:
        base |= {
            f"{quantity.column}_error": getattr(flexure.errors, quantity.name)
            for quantity in _OF_BASE
        }
    stories = Table.joined((FLEXURE_COLUMNS, flexure))
    return {"flexure": stories.as_dictionaries(), "base": base}
