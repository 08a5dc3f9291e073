"""A chunk of runs: what one thread, or a worker far away, does without asking for anything more."""

from __future__ import annotations

import time
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from tdint.analysis.spectra.elastic import SA_DAMPING, spectrum
from tdint.campaign.engine.batch import Batch, Rows
from tdint.campaign.engine.task import BuildingRuns, Motions, Run, RunSettings, Subject
from tdint.errors import AnalysisError
from tdint.ground_motion.joining import JoinedRecord
from tdint.ground_motion.record import Record


@dataclass(frozen=True)
class Chunk:
    """Some runs, with all that they need.

    Attributes
    ----------
    number : int
        Of the chunk in its campaign.
    buildings : tuple of BuildingRuns
        The buildings with their runs.
    records : mapping of int to Record
        The ground motions by their numbers.
    """

    number: int
    buildings: tuple[BuildingRuns, ...]
    records: Mapping[int, Record]
    settings: RunSettings


@dataclass(frozen=True)
class Done:
    """A chunk that is done: its rows, and the processor time that it took, s."""

    number: int
    rows: Rows
    seconds: float


def do(chunk: Chunk) -> Done:
    """Integrate the runs of a chunk. Errors are those of `Batch.results`."""
    began = time.thread_time()
    motions = Motions.of(chunk.records)
    subjects = [part.source.subject() for part in chunk.buildings]
    spectral = _spectral(chunk.records, [(s, p.runs) for s, p in zip(subjects, chunk.buildings, strict=True)])
    rows = Rows()
    for part, subject, sa in zip(chunk.buildings, subjects, spectral, strict=True):
        batch = Batch(part.number, subject, motions, sa, chunk.settings)
        rows.extend(batch.results(part.runs, part.largest))
    return Done(chunk.number, rows, time.thread_time() - began)


def _spectral(
    records: Mapping[int, Record], wanted: list[tuple[Subject, tuple[Run, ...]]]
) -> list[dict[int, float | None]]:
    """Sa(T1) of each building's motions: of one motion the periods of all buildings at once."""
    found: list[dict[int, float | None]] = [{} for _ in wanted]
    users: dict[int, list[int]] = {}
    for place, (_, runs) in enumerate(wanted):
        for motion in dict.fromkeys(run.motion for run in runs):
            users.setdefault(motion, []).append(place)
    for motion, places in users.items():
        values = spectral_accelerations(records[motion], [wanted[place][0].period for place in places])
        for place, value in zip(places, values, strict=True):
            found[place][motion] = value
    return found


def spectral_accelerations(record: Record, periods: list[float]) -> list[float | None]:
    """Sa of a record at some periods, m/s^2, 5 % damping; None for a period that is too short for it. Of shocks the
    largest."""
    if isinstance(record, JoinedRecord):
        of_all = zip(*(spectral_accelerations(shock, periods) for shock in record.shocks), strict=True)
        return [None if None in values else max(filter(None, values), default=0.0) for values in of_all]
    try:
        return list(spectrum(record, np.array(periods), SA_DAMPING).psa.tolist())
    except AnalysisError:
        if len(periods) == 1:
            return [None]
    return [value for period in periods for value in spectral_accelerations(record, [period])]
