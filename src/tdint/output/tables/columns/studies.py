"""Columns of studies: factors, incremental dynamic analyses, fragility functions."""

from __future__ import annotations

import numpy as np

from tdint.output.tables.columns.shared import OF_NAMED_RECORD, OF_RECORD
from tdint.output.tables.table import Column

FACTORS = (*OF_RECORD, Column("factor", "factor", "factor on the record, the same for both components of a pair"))

_RECORD = (
    *OF_NAMED_RECORD,
    Column(
        "im_name", "study.im_name", "intensity measure: sa(T) and sa-avg(T) with the period in s, pga, pgv", text=True
    ),
    Column("unit", "study.measure.unit", "its unit", text=True),
)
"""The first columns of the tables of an incremental dynamic analysis."""

IDA = (
    *_RECORD,
    Column(
        "level", lambda one: np.arange(1, len(one.curve.runs) + 1), "number of the level of intensity, from the lowest"
    ),
    Column("im", lambda one: one.of_runs("im"), "intensity"),
    Column("scale", lambda one: one.of_runs("scale"), "factor on the record"),
    Column("status", lambda one: one.of_runs("status"), "how the run ended", text=True),
    Column("peak_drift_ratio", lambda one: one.of_runs("drift_ratio"), "largest peak drift over story height"),
    Column(
        "peak_absolute_acceleration_m_s2",
        lambda one: one.of_runs("acceleration"),
        "largest absolute acceleration of a floor",
    ),
    Column(
        "residual_drift_ratio",
        lambda one: one.of_runs("residual_drift_ratio"),
        "largest drift at the end of the run over story height",
    ),
)
INTENSITIES = ("im", "capacity", "lower", "upper")
"""Columns in the unit that the column `unit` tells."""

CAPACITIES = (
    *_RECORD,
    Column("threshold", "capacity.threshold", "drift ratio; the collapse drift, the largest one, stands for collapse"),
    Column(
        "capacity", "capacity.capacity", "intensity at which it is first exceeded; if censored one that it is above"
    ),
    Column("lower", "capacity.lower", "level next below at which the building was run"),
    Column("upper", "capacity.upper", "level next above at which the building was run; empty if censored"),
    Column("censored", "capacity.censored", "whether it was not exceeded up to the largest level", text=True),
    Column(
        "resurrection",
        "curve.resurrection",
        "whether the building stood again at a level tried above its first collapse: 1.25 and 1.5 times it, and those "
        "of the search",
        text=True,
    ),
)
FRAGILITY = (
    Column("threshold", "threshold", "demand whose exceedance is meant"),
    Column("fit", "fit", "stripes, ida or cloud", text=True),
    Column("theta", "theta", "median intensity"),
    Column("beta", "beta", "standard deviation of the logarithm of the intensity, from record to record"),
    Column("theta_error", "theta_error", "standard error of ln theta: of theta, as a part of it"),
    Column("beta_error", "beta_error", "standard error of beta"),
    Column("records", "records", "records; of stripes those of the largest one, of a cloud of runs the runs"),
    Column("censored", "censored", "records of which the value is known only to lie above a limit"),
    Column("im", "im", "intensity measure, as far as the table tells it", text=True),
    Column("unit", "unit", "its unit, as far as the table tells it", text=True),
)
CLOUD = (
    Column(
        "b0", lambda one: one.cloud.intercept if one.cloud else np.nan, "of a cloud: intercept of ln EDP over ln IM"
    ),
    Column("b1", lambda one: one.cloud.slope if one.cloud else np.nan, "of a cloud: slope of ln EDP over ln IM"),
    Column("sigma", lambda one: one.cloud.sigma if one.cloud else np.nan, "of a cloud: standard deviation of ln EDP"),
)
"""Beside a cloud: its line."""


def _bound(place: int, name: str) -> Column:
    word, meaning = (("exceed", "exceeding"), ("stand", "not exceeding"))[place]
    return Column(
        f"{name}_failed_{word}",
        lambda one: getattr(one.bounds[place], name, np.nan),
        f"{name} with all failed runs counted as {meaning}; empty where that tells none",
    )


FAILED = (
    Column("failed", "failed", "runs without a result, which the fit leaves out"),
    *(_bound(place, name) for place in (0, 1) for name in ("theta", "beta")),
)
"""Beside stripes of which runs have no result."""

FRAGILITY_TOTAL = Column("beta_total", "beta_total", "beta with what is not known of the model (--beta-model)")
