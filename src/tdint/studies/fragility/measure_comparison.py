"""Comparison of intensity measures by their efficiency and sufficiency.

Efficiency is the standard deviation beta of ln EDP about its line over ln IM (Luco and Cornell
2007, Earthquake Spectra 23(2)). Proficiency is beta over the slope of the line (Padgett, Nielson
and DesRoches 2008, Earthquake Engineering and Structural Dynamics 37). A measure is sufficient if
the residuals of the line do not depend on other characteristics of the ground motions. The slope
of the residuals over a characteristic is reported with its p-value. Runs under the same ground
motion, or of the same event if events are known, are treated as correlated.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.special import stdtr

from tdint.arrays import Array
from tdint.csv_table import CsvTable, read_table
from tdint.errors import AnalysisError, ModelError
from tdint.model.status import DONE
from tdint.studies.fragility.measures import (
    column_of,
    combine_pair_intensities,
    motions_of,
    run_measure,
    with_measures,
)

_NEEDS = (
    "a table of characteristics has the column record and columns of numbers, such as magnitude "
    "and distance_km"
)
_MIN_RUNS = 3  # minimum number of runs for a line with a dispersion
_SCALE = "ln scale"  # name of the logarithm of the scale factor as a characteristic


@dataclass(frozen=True)
class Dependence:
    """Dependence of the residuals of a line of ln EDP over ln IM on a characteristic of the ground
    motions, such as the magnitude.

    Attributes
    ----------
    slope : float
        Slope of the residuals over the characteristic.
    p_value : float
        Probability of a slope of at least this size if the residuals are independent of the
        characteristic.
    """

    characteristic: str
    slope: float
    p_value: float


@dataclass(frozen=True)
class MeasureFit:
    """Line of ln EDP over ln IM, fitted to the runs without collapse. EDP is the maximum drift
    ratio, IM the intensity measure.

    Attributes
    ----------
    im, unit : str
        Name of the measure as requested, and its unit in the table.
    runs, left_out : int
        Number of runs used for the line, and number of omitted runs, which collapsed or have no
        result or no measure.
    slope, slope_error, beta, r_squared : float
        Slope with its standard error, standard deviation about the line (n - 2), and squared
        correlation.
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
        """Beta divided by the slope: the dispersion in terms of the intensity measure; infinite if
        the slope is zero."""
        return self.beta / self.slope if self.slope else math.inf


def compare_measures(
    folder: str | Path, measures: Sequence[str], characteristics: str | Path | None = None
) -> list[MeasureFit]:
    """Compare intensity measures for the runs of a campaign, in ascending order of beta.

    Parameters
    ----------
    folder : str or Path
        Directory of a campaign of one building, with runs.csv. Measures other than `sa` and `pga`
        require measures.csv.
    characteristics : str or Path, optional
        CSV file with a row per record. The scale factor is an additional characteristic if it
        varies.

    Returns
    -------
    list of MeasureFit
        Line of each measure, the most efficient measure (smallest beta) first.

    Raises
    ------
    UsageError
        A measure is unknown or was not computed for these runs.
    ModelError
        A table cannot be read, contains several buildings, or does not contain a record.
    AnalysisError
        Fewer than three runs were completed, or a measure is equal for all runs.
    """
    table = with_measures(
        read_table(str(Path(folder) / "runs.csv"), "the runs of a campaign are a table")
    )
    table.only("building")
    status = np.array(table.texts("status"))
    drift = np.array(table.numbers("peak_drift_ratio", empty=True))
    # Runs without collapse: a maximum drift that can be used for a line.
    has_drift = (status == DONE) & (drift > 0.0)
    characteristic_values, events = _characteristics(table, characteristics)
    values_of_characteristic = {
        _SCALE: np.log(np.abs(table.numbers("scale"))),
        **characteristic_values,
    }
    # Runs of the same event, or under the same ground motion, are correlated.
    motions = events if events is not None else motions_of(table)
    values_of_characteristic = {
        name: values
        for name, values in values_of_characteristic.items()
        if np.unique(values[has_drift]).size > 1
    }
    fits = []
    for name in dict.fromkeys(measures):
        column, unit = column_of(table, run_measure(name).column)
        im = combine_pair_intensities(table, np.array(table.numbers(column, empty=True)))
        # A measure may be unknown for some runs, for example Sa at a period that is too short for
        # the record.
        is_used = has_drift & (im > 0.0)
        used_values = {
            characteristic: values[is_used]
            for characteristic, values in values_of_characteristic.items()
        }
        fit = line(np.log(im[is_used]), np.log(drift[is_used]), used_values, name, motions[is_used])
        fits.append(replace(fit, im=name, unit=unit, left_out=int(np.sum(~is_used))))
    return sorted(fits, key=lambda fit: fit.beta)


def line(
    x: Array,
    y: Array,
    characteristics: dict[str, Array],
    name: str,
    motion: NDArray[np.intp],
) -> MeasureFit:
    """Fit a line by least squares to logarithms of the intensity measure and of the demand, and
    lines of its residuals over characteristics of the ground motions.

    Runs with the same number in `motion` are correlated. Name and unit of the result are empty, and
    no runs count as omitted.

    Raises
    ------
    AnalysisError
        There are fewer than three runs, or all have the same intensity.
    """
    # Imported here, because the import needs half a second and other fits do not need it.
    from scipy.stats import linregress

    if x.size < _MIN_RUNS:
        raise AnalysisError(
            f"{name}: the regression of ln drift over ln IM requires at least {_MIN_RUNS} "
            f"completed runs, got {x.size}"
        )
    if np.ptp(x) == 0.0:
        raise AnalysisError(
            f"{name}: this intensity measure has the same value in all runs; the regression of ln "
            "drift over ln IM requires different values"
        )
    # Two parameters are estimated from the runs.
    fit = linregress(x, y)
    residuals = y - (fit.intercept + fit.slope * x)
    beta = math.sqrt(float(residuals @ residuals) / (x.size - 2))
    dependences = []
    for characteristic, values in characteristics.items():
        if np.ptp(values) > 0.0:
            change = float(linregress(values, residuals).slope)
            p_value = _clustered_p_value(values, residuals, motion)
            dependences.append(Dependence(characteristic, change, p_value))
    # The slope without a ground motion follows from the sums of 1, x, y, x^2 and x y over all runs,
    # minus the sums over the motion.
    motion_number = np.unique(motion, return_inverse=True)[1]
    x, y = x - np.mean(x), y - np.mean(y)
    sums = np.column_stack(
        [np.bincount(motion_number, values) for values in (np.ones(x.size), x, y, x * x, x * y)]
    )
    count, sum_x, sum_y, sum_xx, sum_xy = (sums.sum(axis=0) - sums).T
    with np.errstate(divide="ignore", invalid="ignore"):
        slopes = (sum_xy - sum_x * sum_y / count) / (sum_xx - sum_x**2 / count)
    # The jackknife variance is m - 1 times the variance of the m slopes without a motion.
    slope_error = math.nan
    if slopes.size > 2:
        slope_error = math.sqrt((slopes.size - 1) * float(np.var(slopes)))
    slope, r_squared = float(fit.slope), float(fit.rvalue**2)
    return MeasureFit("", "", x.size, 0, slope, slope_error, beta, r_squared, tuple(dependences))


def _clustered_p_value(x: Array, y: Array, cluster: NDArray[np.intp]) -> float:
    """Return the p-value of the slope of the line of y over x, for residuals that are correlated
    within clusters.

    The variance is a sum over clusters (Liang and Zeger 1986, Biometrika 73(1)), with the factor G
    / (G - 1) (n - 1) / (n - 2) and Student's t distribution with G - 1 degrees of freedom (Cameron
    and Miller 2015, Journal of Human Resources 50(2)), where G is the number of clusters and n the
    number of points. The result is nan for fewer than three clusters.
    """
    names, cluster_number = np.unique(cluster, return_inverse=True)
    count, groups = x.size, names.size
    if groups < 3:
        return math.nan
    # Intercept (index 0) and slope (index 1)
    design = np.column_stack([np.ones(count), x - np.mean(x)])
    inverse = np.linalg.inv(design.T @ design)
    solution = inverse @ design.T @ y
    # Clustered covariance: inverse @ (sum over clusters of s s^T) @ inverse, where s is the sum of
    # the rows of `scores` in the cluster.
    scores = design * (y - design @ solution)[:, np.newaxis]
    sums = np.column_stack([np.bincount(cluster_number, column, groups) for column in scores.T])
    variance = (
        (inverse @ sums.T @ sums @ inverse)[1, 1]
        * groups
        / (groups - 1)
        * (count - 1)
        / (count - 2)
    )
    # Without any variance, the points are exactly on the line.
    if not variance > 0.0:
        return 0.0
    return 2.0 * float(stdtr(groups - 1, -abs(solution[1]) / math.sqrt(variance)))


def _characteristics(
    table: CsvTable, file: str | Path | None
) -> tuple[dict[str, Array], NDArray[np.intp] | None]:
    """Read the characteristics of ground motions from a CSV file with a row per record; none
    without a file.

    The result contains the values for the record of each run of `table`, by the name of the
    characteristic, and the index of the event of each run, or None if the file has no column
    `event`. ModelError is raised if the file cannot be read or does not contain a record.
    """
    if file is None:
        return {}, None
    record_table = read_table(str(file), _NEEDS)
    records = record_table.texts("record")
    names = [name for name in record_table.header if name not in ("record", "component", "event")]
    if not names:
        raise ModelError(f"{file}: {_NEEDS}")
    value_of_record = {
        name: dict(zip(records, record_table.numbers(name), strict=True)) for name in names
    }
    records_of_runs = table.texts("record")
    # Every record is required, because a dependence for a selection of records would be biased.
    missing = [record for record in dict.fromkeys(records_of_runs) if record not in set(records)]
    if missing:
        raise ModelError(
            f"{file}: the row of the record {missing[0]} is missing; add it, with the name of the "
            "record in runs.csv"
        )
    events = None
    if record_table.has("event"):
        event_of_record = dict(zip(records, record_table.texts("event", empty=False), strict=True))
        events = np.unique(
            [event_of_record[record] for record in records_of_runs], return_inverse=True
        )[1]
    characteristics = {
        name: np.array([values[record] for record in records_of_runs])
        for name, values in value_of_record.items()
    }
    return characteristics, events
