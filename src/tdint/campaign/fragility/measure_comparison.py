"""How well intensity measures tell the demands of a campaign's runs: efficiency and sufficiency.

Efficiency is the standard deviation beta of ln EDP about its line over ln IM (Luco and Cornell 2007, Earthquake Spectra
23(2)), proficiency beta over the slope of that line (Padgett, Nielson and DesRoches 2008, Earthquake Engineering and
Structural Dynamics 37). A measure is sufficient where what the line leaves does not depend on what else is known of the
motions: the slope of the residuals over it is told with its p-value.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.stats import linregress

from tdint.campaign.fragility.run_measures import run_measure
from tdint.campaign.ida.runs import COLLAPSED, DONE
from tdint.csv_table import CsvTable, read_table
from tdint.errors import AnalysisError, ModelError, UsageError
from tdint.quantity import suffix
from tdint.units import ACCELERATION, LENGTH, VELOCITY

Array = NDArray[np.float64]

MEASURES = "measures.csv"
"""Beside runs.csv, by `tdint campaign --im`."""

_KEYS = ("building", "record", "component", "scale", "sample")
_UNITS = (*ACCELERATION, *VELOCITY, *LENGTH, *(f"{one}/s" for one in LENGTH), *(f"{one}/s^2" for one in LENGTH), "s")
_NEEDS = "a table of characteristics has the column record and others of numbers, such as magnitude and distance_km"
_LEAST = 3  # runs of a line with a dispersion
_SCALE = "ln scale"


@dataclass(frozen=True)
class Dependence:
    """Of the residuals on a characteristic of the motions: slope, and the chance of one as large if there were none."""

    characteristic: str
    slope: float
    p_value: float


@dataclass(frozen=True)
class MeasureFit:
    """The line of ln EDP over ln IM of the runs that ended, EDP the largest drift ratio.

    Attributes
    ----------
    im, unit : str
        The measure as it was asked for, and its unit in the table.
    runs, collapsed : int
        Runs on the line; runs left out, for they collapsed or have no result or no measure.
    slope, slope_error, beta, r_squared : float
        Of the line, with the standard error of the slope and the standard deviation about it (n - 2).
    dependences : tuple of Dependence
        Of what it leaves.
    """

    im: str
    unit: str
    runs: int
    left_out: int
    slope: float
    slope_error: float
    beta: float
    r_squared: float
    dependences: tuple[Dependence, ...] = ()

    @property
    def proficiency(self) -> float:
        """Beta over the slope: the dispersion in terms of the measure."""
        return self.beta / self.slope if self.slope else math.inf


def compare_measures(
    folder: str | Path, measures: Sequence[str], characteristics: str | Path | None = None
) -> list[MeasureFit]:
    """Compare intensity measures on the runs of a campaign, from the least beta to the largest.

    Parameters
    ----------
    folder : str or Path
        Of a campaign of one building, with runs.csv and, for other measures than `sa` and `pga`, measures.csv.
    measures : sequence of str
        As `tdint.campaign.fragility.run_measures.run_measure` reads them.
    characteristics : str or Path, optional
        CSV file of the motions, a row for each record; beside them stands the factor, where it differs.

    Raises
    ------
    UsageError
        A measure is unknown or was not found for these runs.
    ModelError
        A table cannot be read, has several buildings, or lacks a record.
    AnalysisError
        Fewer than three runs ended, or a measure is the same in all of them.
    """
    table = with_measures(read_table(str(Path(folder) / "runs.csv"), "the runs of a campaign are a table"))
    table.only("building")
    status = np.array(table.texts("status"))
    drift = np.array(table.numbers("peak_drift_ratio", empty=True))
    stood = (status == DONE) & ~np.isin(status, COLLAPSED) & (drift > 0.0)
    known = {_SCALE: np.log(np.abs(table.numbers("scale"))), **_characteristics(table, characteristics)}
    known = {name: values for name, values in known.items() if np.unique(values[stood]).size > 1}
    fits = []
    for name in dict.fromkeys(measures):
        column, unit = column_of(table, run_measure(name).column)
        im = np.array(table.numbers(column, empty=True))
        taken = stood & (im > 0.0)
        parts = {about: values[taken] for about, values in known.items()}
        found = line(np.log(im[taken]), np.log(drift[taken]), parts, name)
        fits.append(replace(found, im=name, unit=unit, left_out=int(np.sum(~taken))))
    return sorted(fits, key=lambda one: one.beta)


def line(x: Array, y: Array, characteristics: dict[str, Array], name: str = "the measure") -> MeasureFit:
    """The line of y over x, both logarithms, shape (n,), and how what it leaves depends on characteristics."""
    if x.size < _LEAST:
        raise AnalysisError(f"{name}: {x.size} runs that ended have it; a line with a dispersion needs {_LEAST}")
    if np.ptp(x) == 0.0:
        raise AnalysisError(f"{name}: is the same in all runs")
    fit = linregress(x, y)
    residual = y - (fit.intercept + fit.slope * x)
    beta = math.sqrt(float(residual @ residual) / (x.size - 2))
    dependences = []
    for about, values in characteristics.items():
        if np.ptp(values) > 0.0:
            of = linregress(values, residual)
            dependences.append(Dependence(about, float(of.slope), float(of.pvalue)))
    slope, error, r = float(fit.slope), float(fit.stderr), float(fit.rvalue)
    return MeasureFit("", "", x.size, 0, slope, error, beta, r * r, tuple(dependences))


def with_measures(table: CsvTable) -> CsvTable:
    """The table of runs with the columns of the measures beside it, if they are there.

    Raises
    ------
    ModelError
        They are not of these runs.
    """
    file = Path(table.source).with_name(MEASURES)
    if table.source == "-" or not file.is_file():
        return table
    others = read_table(str(file), "the measures of a campaign are a table")
    cells = {key: row for key, (_, row) in zip(_keys(others), others.rows, strict=True)}
    places = [place for place, name in enumerate(others.header) if name not in table.header]
    rows = []
    for key, (number, row) in zip(_keys(table), table.rows, strict=True):
        if key not in cells:
            raise ModelError(f"{file}: has no row of {' '.join(key)}; call `tdint campaign` with --im again")
        rows.append((number, [*row, *(cells[key][place] for place in places)]))
    names = tuple(others.header[place] for place in places)
    return replace(table, header=(*table.header, *names), titles=(*table.titles, *names), rows=tuple(rows))


def _keys(table: CsvTable) -> list[tuple[str, ...]]:
    return list(zip(*(table.texts(name) for name in _KEYS), strict=True))


def column_of(table: CsvTable, name: str) -> tuple[str, str]:
    """The column of a measure, whatever its unit is, and this.

    Raises
    ------
    UsageError
        The table has none.
    """
    for unit in _UNITS:
        if table.has(f"{name}{suffix(unit)}"):
            return f"{name}{suffix(unit)}", unit
    raise UsageError(
        f"{table.source}: the runs have no measure {name}; call `tdint campaign` on the same folder with --im, which "
        f"writes {MEASURES}"
    )


def _characteristics(table: CsvTable, file: str | Path | None) -> dict[str, Array]:
    """Of each run what is known of its record, by the names of the columns."""
    if file is None:
        return {}
    given = read_table(str(file), _NEEDS)
    records = given.texts("record")
    names = [name for name in given.header if name not in ("record", "component")]
    if not names:
        raise ModelError(f"{file}: {_NEEDS}")
    found = {name: dict(zip(records, given.numbers(name), strict=True)) for name in names}
    wanted = table.texts("record")
    missing = [one for one in dict.fromkeys(wanted) if one not in set(records)]
    if missing:
        raise ModelError(f"{file}: has no row of the record {missing[0]}; records are named as in runs.csv")
    return {name: np.array([values[one] for one in wanted]) for name, values in found.items()}
