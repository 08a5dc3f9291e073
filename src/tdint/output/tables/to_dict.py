"""The columns of a result by name, as pandas takes them, and its first rows for a notebook."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial, singledispatch
from html import escape
from typing import Any

import numpy as np

from tdint.analysis.assessment.stability import StabilityCurve
from tdint.analysis.run.outcome import History, Response, StoryPeaks
from tdint.analysis.spectra.drift import DriftSpectrum
from tdint.analysis.spectra.elastic import Spectrum
from tdint.analysis.spectra.floors import FloorSpectrum
from tdint.analysis.spectra.inelastic import InelasticSpectrum
from tdint.analysis.spectra.rotated import RotatedSpectrum
from tdint.analysis.static.cyclic import CyclicTest
from tdint.analysis.static.pushover import Pushover
from tdint.errors import UsageError
from tdint.ground_motion.record import Record
from tdint.model.modes import Modes
from tdint.output.tables import buildings, runs, spectra
from tdint.output.tables.methods import STABILITY
from tdint.output.tables.table import FLOOR, OF_RECORD, Column
from tdint.output_units import SI, parse_output_units

_ROWS = 20
_DIGITS = 5


def to_dict(result: Any, units: str = "") -> dict[str, Any]:
    """The columns of a result's table by name: arrays of one length, words as lists.

    Parameters
    ----------
    result : object
        What `run`, `spectrum`, `modes`, `law`, `pushover`, `stability`, ... give; also a response's history, a record.
    units : str
        Units in place of SI, such as `kip,in,g`; the names change with them.

    Raises
    ------
    UsageError
        The result has no table, or a unit is unknown.
    """
    wanted = parse_output_units(units) if units else SI
    values = _values(result)
    size = max((len(value) for _, value in values if isinstance(value, np.ndarray)), default=1)
    found: dict[str, Any] = {}
    for column, value in values:
        renamed, factor = wanted.column(column.name, column.unit)
        if isinstance(value, str):
            found[renamed] = [value] * size
        elif isinstance(value, np.ndarray):
            found[renamed] = value / factor if factor != 1.0 else value
        else:
            found[renamed] = np.full(size, np.nan if value is None else value if factor == 1.0 else value / factor)
    return found


def to_html(result: Any, caption: str) -> str:
    """The first rows of a result's table."""
    found = to_dict(result)
    size = len(next(iter(found.values())))
    head = "".join(f"<th>{escape(name)}</th>" for name in found)
    rows = ([escape(_cell(values[row])) for values in found.values()] for row in range(min(size, _ROWS)))
    body = "".join("<tr>" + "".join(f"<td>{cell}</td>" for cell in row) + "</tr>" for row in rows)
    more = f"<p>{size - _ROWS} more rows</p>" if size > _ROWS else ""
    return f"<table><caption>{escape(caption)}</caption><tr>{head}</tr>{body}</table>{more}"


def _cell(value: Any) -> str:
    if isinstance(value, float | np.floating):
        return "" if np.isnan(value) else format(value + 0.0, f".{_DIGITS}g")
    return "" if value is None else str(value)


_Values = list[tuple[Column, Any]]


@singledispatch
def _values(result: object) -> _Values:
    """The value of each column: an array, or what all rows have."""
    raise UsageError(f"{type(result).__name__} has no table")


def _of(own: Sequence[Column], result: Any) -> _Values:
    return [(column, column.of(result)) for column in own]


def _of_record(own: Sequence[Column], result: Any) -> _Values:
    return _of((*OF_RECORD, *own), result)


_values.register(StoryPeaks, lambda result: _of(runs.STORY, result))
_values.register(Spectrum, partial(_of_record, spectra.SPECTRUM))
_values.register(InelasticSpectrum, partial(_of_record, spectra.INELASTIC))
_values.register(DriftSpectrum, partial(_of_record, spectra.DRIFT_SPECTRUM))
_values.register(CyclicTest, lambda result: _of(buildings.CYCLIC, result))
_values.register(Pushover, lambda result: _of(buildings.pushover(result.drift.shape[1]), result))
_values.register(StabilityCurve, lambda result: _of(STABILITY, result))
_values.register(Record, partial(_of, spectra.SAMPLES))


@_values.register
def _(result: Response) -> _Values:
    if result.shocks:
        table = runs.response_table(result)
        columns = (runs.SHOCK, *runs.STORY, *(runs.STORY_ERROR if result.check else ()))
        cells = zip(*table.rows, strict=True)
        return [
            (column, np.array([np.nan if one is None else one for one in values]))
            for column, values in zip(columns, cells, strict=True)
        ]
    errors = _of(runs.STORY_ERROR, result.check.errors) if result.check else []
    return _values(result.stories) + errors


@_values.register
def _(result: FloorSpectrum) -> _Values:
    return _of([FLOOR], result) + _of(spectra.SPECTRUM, result.spectrum)


@_values.register
def _(result: RotatedSpectrum) -> _Values:
    return _of((*spectra.OF_MOTION, *spectra.rotated(result.percentiles)), result)


@_values.register
def _(result: Modes) -> _Values:
    ratios = np.full_like(result.omega, np.nan) if result.damping is None else result.damping
    return _of((*buildings.MODE, buildings.mode_damping(ratios), *buildings.MODE_END), result)


@_values.register
def _(result: History) -> _Values:
    stories, error = result.displacement.shape[1], result.error is not None
    values: list[Any] = []
    for place, columns in runs.history_groups(error):
        found = [column.of(result) for column in columns]
        values += [one[:, i] for i in range(stories) for one in found] if place else found
    return list(zip(runs.history_columns(stories, error), values, strict=True))
