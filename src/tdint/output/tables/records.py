"""Table of records: what they are and how strong."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass

from tdint.ground_motion.measures import Measures
from tdint.ground_motion.record import Record
from tdint.output.tables.columns.spectra import INFO
from tdint.output.tables.table import Table


@dataclass(frozen=True)
class RecordInfo:
    """A record, its measures and its spectrum intensity, m."""

    record: Record
    measures: Measures
    housner_intensity: float = math.nan


def info_table(infos: Iterable[RecordInfo]) -> Table:
    """One row per record."""
    return Table.of_results(INFO, infos)
