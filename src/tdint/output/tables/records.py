"""Table of records: what they are and how strong."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass

from tdint.ground_motion.measures import Measures
from tdint.ground_motion.record import Record
from tdint.output.tables import columns
from tdint.output.tables.table import Table


@dataclass(frozen=True)
class RecordInfo:
    """A record, its measures and its spectrum intensity, m."""

    record: Record
    measures: Measures
    housner_intensity: float = math.nan


def info_table(infos: Iterable[RecordInfo]) -> Table:
    """One row per record."""
<<<<<<< HEAD
    return Table.of_results(columns.INFO, infos)
=======
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
                f"{record.units} ({record.units_from})",
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
                "; ".join((*record.warnings, *record.notes, *measures.notes)),
            )
        )
    return Table(INFO_COLUMNS, list(rows))
>>>>>>> 8a9bb9f (Units are stated by the format, the file or the user; m/s^2 is assumed of an accelerometer's MiniSEED alone, said and doubted)
