"""Raw points of the benchmark page as CSV files, from which the page can be written without a run.

`points.csv` has a row for each run: problem, motion, method, time step, steps, iterations, errors
of the three peaks, minimum time and number of times, status. `problems.csv` has a row for each
problem: properties of the building and of the reference, day and load of the measurement.
`conditions.csv` states versions, processor and clock. Empty cells are unknown values.
"""

from __future__ import annotations

import csv
import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from tdint.assessment.chart.performance_profiles import (
    PEAKS,
    STANDARD,
    Measured,
    PeakErrors,
    read_problems,
)
from tdint.assessment.chart.work_precision import Peer, Point, Timing

HERE = Path(__file__).parent
POINTS, PROBLEMS, CONDITIONS = (
    HERE / f"{name}.csv" for name in ("points", "problems", "conditions")
)
DIGITS = 5
"""Significant digits of numbers. Times scatter by 10 %."""

POINT_COLUMNS = (
    "problem", "motion", "method", "line", "dt_s", "steps", "iterations",
    *(f"{name}_error" for name in PEAKS), "time_min_s", "times", "status",
)  # fmt: skip
PROBLEM_COLUMNS = (
    "problem", "motion", "stories", "interval_s", "duration_s", "ductility", "changes",
    "confirmed_by", *(f"{name}_gap" for name in PEAKS), "peer_gap", "peer_note", "day", "load",
    "seconds",
)  # fmt: skip


@dataclass(frozen=True)
class Entry:
    """Results of a problem, with the day, the load of the machine, and the processor time, s."""

    measured: Measured
    day: str
    load: float | None
    seconds: float


@dataclass(frozen=True)
class Conditions:
    """Conditions of the measurement.

    Attributes
    ----------
    versions : str
        Versions of tdint, Python and packages.
    system : str
        Name of the operating system.
    timing : Timing
        Clock, repetitions, processor.
    peers : tuple of Peer
        Other programs.
    kernels : str
        Digest of the sources of kernels and methods; empty if it was not stored.
    commit : str
        Commit of the measured sources; empty if it was not stored.
    """

    versions: str
    system: str
    timing: Timing
    peers: tuple[Peer, ...]
    kernels: str = ""
    commit: str = ""


def number(value: float | None) -> str:
    """Return a number with `DIGITS` digits; empty for an unknown value."""
    return "" if value is None or math.isnan(value) else f"{value:.{DIGITS}g}"


def parse(text: str) -> float:
    """Return the number of a cell; nan for an empty cell."""
    return float(text) if text else math.nan


def point_row(problem: Measured, point: Point) -> list[str]:
    """Return the row of points.csv for a run of a problem; see `POINT_COLUMNS`."""
    errors = [number(point.error(name)) for name in PEAKS]
    counts = ["" if count is None else str(count) for count in (point.steps, point.iterations)]
    return [
        *(
            problem.name,
            problem.motion,
            point.method,
            point.line,
            number(point.dt),
            *counts,
            *errors,
        ),
        *(number(point.fastest), str(len(point.times)), point.outcome),
    ]


def problem_row(entry: Entry) -> list[str]:
    """Return the row of problems.csv for a problem; see `PROBLEM_COLUMNS`."""
    problem = entry.measured
    return [
        *(problem.name, problem.motion, str(problem.stories)),
        *(number(problem.interval), number(problem.duration), number(problem.ductility)),
        *(str(problem.changes), problem.confirmed_by),
        *(number(problem.gap.of(name)) for name in PEAKS),
        *(number(problem.peer_gap), problem.peer_note, entry.day, number(entry.load)),
        number(entry.seconds),
    ]


def write(file: Path, heads: Sequence[str], rows: Iterable[Sequence[str]]) -> None:
    """Write a CSV file with a header and rows."""
    with file.open("w", encoding="utf-8", newline="") as stream:
        writer = csv.writer(stream, lineterminator="\n")
        writer.writerows([heads, *rows])


def read(file: Path) -> list[dict[str, str]]:
    """Return the rows of a CSV file as texts by column."""
    with file.open(encoding="utf-8", newline="") as stream:
        return list(csv.DictReader(stream))


def store(entries: Sequence[Entry], conditions: Conditions, directory: Path = HERE) -> None:
    """Write points.csv, problems.csv and conditions.csv to a directory."""
    rows = [
        point_row(entry.measured, point) for entry in entries for point in entry.measured.points
    ]
    write(directory / POINTS.name, POINT_COLUMNS, rows)
    write(directory / PROBLEMS.name, PROBLEM_COLUMNS, map(problem_row, entries))
    timing = conditions.timing
    values = {
        "versions": conditions.versions,
        "system": conditions.system,
        "kernels": conditions.kernels,
        "commit": conditions.commit,
        "clock": timing.clock,
        "load": number(timing.load),
        "processor": timing.processor,
        "processors": str(timing.processors),
    }
    for peer in conditions.peers:
        values |= {
            f"{peer.name} {key}": getattr(peer, key) for key in ("version", "settings", "timed")
        }
    write(directory / CONDITIONS.name, ("condition", "value"), values.items())


def load(directory: Path = HERE) -> tuple[list[Entry], Conditions]:
    """Return the results and the conditions from the three files in a directory."""
    points: dict[tuple[str, str], list[Point]] = {}
    for row in read(directory / POINTS.name):
        points.setdefault((row["problem"], row["motion"]), []).append(point_of(row))
    reasons = {
        (problem.name, problem.motion): problem.reason for problem in read_problems(STANDARD)
    }
    entries = []
    for row in read(directory / PROBLEMS.name):
        name = row["problem"], row["motion"]
        entries.append(entry_of(row, reasons[name], tuple(points[name])))
    values = {row["condition"]: row["value"] for row in read(directory / CONDITIONS.name)}
    counts = [len(point.times) for runs in points.values() for point in runs if point.times]
    timing = Timing(
        values["clock"],
        (min(counts), max(counts)),
        parse(values["load"]) if values["load"] else None,
        values["processor"],
        int(values["processors"]),
        None,
    )
    programs = [key.removesuffix(" version") for key in values if key.endswith(" version")]
    peers = [Peer(name, *_peer_values(values, name)) for name in programs]
    sources = (values.get("kernels", ""), values.get("commit", ""))
    return entries, Conditions(values["versions"], values["system"], timing, tuple(peers), *sources)


def _peer_values(values: Mapping[str, str], name: str) -> list[str]:
    """Return version, settings and measured part of another program from the conditions."""
    return [values[f"{name} {key}"] for key in ("version", "settings", "timed")]


def point_of(row: Mapping[str, str]) -> Point:
    """Return the run of a row of points.csv. The file contains only the minimum time and the number
    of times, so all times of the result are equal to the minimum."""
    errors = [parse(row[f"{name}_error"]) for name in PEAKS]
    return Point(
        row["method"],
        parse(row["dt_s"]),
        int(row["steps"]) if row["steps"] else None,
        row["status"],
        int(row["iterations"]) if row["iterations"] else None,
        None if all(map(math.isnan, errors)) else PeakErrors(*errors),
        int(row["times"]) * (parse(row["time_min_s"]),),
        line=row["line"],
    )


def entry_of(row: Mapping[str, str], reason: str, points: tuple[Point, ...]) -> Entry:
    """Return the results of a problem from its row of problems.csv and its runs.

    Parameters
    ----------
    row : mapping
        Row of problems.csv.
    reason : str
        Reason for which the problem is one of the standard problems.
    points : tuple of Point
        Runs of all methods.
    """
    measured = Measured(
        name=row["problem"],
        motion=row["motion"],
        reason=reason,
        stories=int(row["stories"]),
        interval=parse(row["interval_s"]),
        duration=parse(row["duration_s"]),
        ductility=parse(row["ductility"]),
        changes=int(row["changes"]),
        confirmed_by=row["confirmed_by"],
        gap=PeakErrors(*(parse(row[f"{name}_gap"]) for name in PEAKS)),
        points=points,
        peer_gap=parse(row["peer_gap"]),
        peer_note=row["peer_note"],
    )
    load = parse(row["load"]) if row["load"] else None
    return Entry(measured, row["day"], load, parse(row["seconds"]))
