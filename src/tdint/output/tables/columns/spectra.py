"""Columns of ground motions: what they are, and their spectra."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from tdint.output.tables.columns.shared import DAMPING, OF_RECORD, PERIOD
from tdint.output.tables.table import Column


def _units(info: Any) -> str:
    return f"{info.record.units} ({info.record.units_from})"


def _remarks(info: Any) -> str:
    return "; ".join((*info.record.warnings, *info.record.notes, *info.measures.notes))


INFO = (
    *OF_RECORD,
    Column("id", lambda info: info.record.id if info.record.id.strip(".") else "", "full id of the channel", text=True),
    Column("start", "record.start", "time of the first sample, UTC", text=True),
    Column("samples", "record.acceleration.size", "samples"),
    Column("dt_s", "record.dt", "sampling interval"),
    Column("duration_s", "record.duration", "time from the first to the last sample"),
    Column("units", _units, "units of the file's samples and how they are known", text=True),
    Column("pga_m_s2", "measures.pga", "peak ground acceleration"),
    Column("pgv_m_s", "measures.pgv", "peak ground velocity"),
    Column("pgd_m", "measures.pgd", "peak ground displacement"),
    Column("arias_intensity_m_s", "measures.arias", "Arias intensity"),
    Column("cav_m_s", "measures.cav", "cumulative absolute velocity"),
    Column("d5_75_s", "measures.d5_75", "time between 5 and 75 % of the Arias intensity"),
    Column("d5_95_s", "measures.d5_95", "time between 5 and 95 % of the Arias intensity"),
    Column("housner_intensity_m", "housner_intensity", "Housner's spectrum intensity"),
    Column("mean_m_s2", "measures.mean", "mean of the acceleration"),
    Column("leading_zeros", "measures.leading_zeros", "samples at the start that are zero"),
    Column("trailing_zeros", "measures.trailing_zeros", "samples at the end that are zero"),
    Column("notes", _remarks, "remarks", text=True),
)

OF_MOTION = (
    Column("record", "motion.source", "file of the first component", text=True),
    Column("component", "motion.component", "both components", text=True),
)
"""The first columns of tables over pairs of components."""

CHOICES = (
    Column("maxima", "maxima", "where the largest values were looked for", text=True),
    Column("interpolation", "interpolation", "the ground motion between its samples", text=True),
)
"""Last columns of a spectrum, where they are asked for."""

SPECTRUM = (
    DAMPING,
    PERIOD,
    Column("sd_m", "sd", "largest displacement relative to the ground"),
    Column("psv_m_s", "psv", "pseudo-velocity, omega sd"),
    Column("psa_m_s2", "psa", "pseudo-acceleration, omega^2 sd"),
    Column("sv_m_s", "sv", "largest velocity relative to the ground"),
    Column("sa_m_s2", "sa", "largest absolute acceleration"),
)


def difference(published: str) -> tuple[Column, ...]:
    """The columns of spectra beside a published one, of this column of `SPECTRUM`."""
    own = next(column for column in SPECTRUM if column.name == published)
    return (
        *SPECTRUM[:2],
        Column(own.name, "computed", own.meaning),
        Column(f"published_{own.name}", "expected", f"published: {own.meaning}"),
        Column("relative_difference", "relative_difference", "computed over published value, less 1"),
    )


ROTATED_START = (DAMPING, PERIOD)
ROTATED_END = (
    Column(
        "geometric_mean_psa_m_s2",
        "geometric_mean",
        "geometric mean of the pseudo-accelerations of both components",
    ),
    Column("rotd100_angle_deg", "angle", "direction of the largest, from the first component towards the second"),
)


def rotated(percentiles: Sequence[int]) -> tuple[Column, ...]:
    """The columns of a spectrum over all directions with these percentiles."""

    def percentile(place: int) -> Callable[[Any], Any]:
        return lambda spectrum: spectrum.psa[place]

    middle = (
        Column(f"rotd{p:02d}_psa_m_s2", percentile(i), f"pseudo-acceleration, percentile {p} over all directions")
        for i, p in enumerate(percentiles)
    )
    return (*ROTATED_START, *middle, *ROTATED_END)


INELASTIC = (
    DAMPING,
    Column("hardening", "hardening", "stiffness after yielding over the initial one"),
    Column("target_ductility", "target", "ductility asked for"),
    Column("period_s", "periods", "natural period of the initial stiffness"),
    Column("yield_strength_ratio", "yield_strength_ratio", "yield force over weight"),
    Column("ductility", "ductility", "largest over yield displacement"),
    Column("residual_m", "residual", "displacement at rest after the record, with its sign"),
    Column("sd_m", "sd", "largest displacement relative to the ground"),
    Column("yield_sd_m", "yield_displacement", "displacement at first yield"),
    Column("yield_psa_m_s2", "yield_acceleration", "yield force over mass"),
    Column("reduction_factor", "reduction_factor", "largest elastic force over yield force"),
)
DRIFT_SPECTRUM = (
    DAMPING,
    Column("period_s", "periods", "fundamental period"),
    Column("height_m", "heights", "height of the building"),
    Column("peak_drift_ratio", "peak_drift_ratio", "largest story drift over story height"),
    Column("story", lambda spectrum: np.where(spectrum.story > 0, spectrum.story, None), "where that is, from 1"),
    Column("roof_drift_ratio", "roof_drift_ratio", "largest roof displacement relative to the ground, over the height"),
)
