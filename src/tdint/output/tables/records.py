"""Table of records: what they are and how strong."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass

from tdint.ground_motion.measures import Measures
from tdint.ground_motion.record import Record
from tdint.output.tables.tables import Table

INFO_COLUMNS = (
    "record",
    "component",
    "id",
    "start",
    "samples",
    "dt_s",
    "duration_s",
    "units",
    "pga_m_s2",
    "pgv_m_s",
    "pgd_m",
    "arias_intensity_m_s",
    "cav_m_s",
    "d5_75_s",
    "d5_95_s",
    "housner_intensity_m",
    "mean_m_s2",
    "leading_zeros",
    "trailing_zeros",
    "notes",
)


@dataclass(frozen=True)
class RecordInfo:
    """A record, its measures and its spectrum intensity, m."""

    record: Record
    measures: Measures
    housner_intensity: float = math.nan


def info_table(infos: Iterable[RecordInfo]) -> Table:
    """One row per record."""
    rows = []
    for info in infos:
        record, measures = info.record, info.measures
        rows.append(
            (
                record.source,
                record.component,
                record.id if record.id.strip(".") else "",
                record.start,
                record.acceleration.size,
                record.dt,
                record.duration,
                record.units,
                measures.pga,
                measures.pgv,
                measures.pgd,
                measures.arias,
                measures.cav,
                measures.d5_75,
                measures.d5_95,
                info.housner_intensity,
                measures.mean,
                measures.leading_zeros,
                measures.trailing_zeros,
                "; ".join((*record.notes, *measures.notes)),
            )
        )
    return Table(INFO_COLUMNS, list(rows))
