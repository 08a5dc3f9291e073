"""Random text tables with a known ground motion: a layout, a header and often an anomaly.

`python tests/fuzz/table_files.py --cases 1000` reads each table as a user does who follows the
messages: options are added if a message asks for them. A wrong motion is a failure. A table whose
motion is damaged, or that contains no motion, must be refused.
"""

import argparse
import random
import re
import warnings
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from tdint.errors import RecordError, UsageError
from tdint.ground_motion.choice import TextLayout
from tdint.ground_motion.reading.read import read_records
from tdint.units import STANDARD_GRAVITY

RIGHT, REFUSED, FAILED, WRONG = OUTCOMES = "right", "refused", "failed", "wrong"
"""`failed`: a motion that is not read although each question of the reader is answered."""

_SCALES = {"g": STANDARD_GRAVITY, "cm/s^2": 0.01, "m/s^2": 1.0}
_PEAKS = {"g": 0.3, "cm/s^2": 290.0, "m/s^2": 2.9}
_SPELLINGS = {
    "g": ("g", "G", "g's", "[g]"),
    "cm/s^2": ("cm/s2", "gal", "cm/s/s", "cm/s^2", "Gal", "gales"),
    "m/s^2": ("m/s2", "m/s^2", "m/s/s"),
}
_TITLES = (
    *("El Centro 1940 NS", "# recorded at station 7", "Time series of station 7 EW"),
    *("Earthquake record, component N-S", "%Northridge 7", "Acceleration time history"),
    *('"Sismo de prueba"', "File created by program 2.1", "Response of a floor"),
    *("Test run 7: time history of the table", ""),
)
_KINDS = (
    *("column", "column", "rows", "rows", "times", "times", "times", "components", "components"),
    *("line numbers", "numbers and times", "pairs", "lines", "no times", "spectrum", "times only"),
    *("row names", "resultant"),
)
_HAS_TIMES = ("times", "components", "numbers and times", "resultant", "line numbers", "row names")
_ATTEMPTS = 5


@dataclass
class TableFile:
    """Text of a table, and what its user knows.

    Attributes
    ----------
    motions : list of ndarray
        Right samples, m/s^2; empty if the file must be refused.
    dt : float
        Sampling interval, s.
    units : str
        Units of the samples.
    columns : tuple of str
        Columns that the user selects if the file does not show them.
    """

    kind: str
    text: str
    dt: float
    units: str
    motions: list[np.ndarray] = field(default_factory=list)
    columns: tuple[str, ...] = ()


def _motion(source: np.random.Generator, samples: int, dt: float) -> np.ndarray:
    """Return a motion that starts with zero, with a peak of 1."""
    t = dt * np.arange(samples)
    frequencies, phases = source.uniform(0.3, 9.0, 12), source.uniform(0.0, 6.0, 12)
    waves = source.normal(size=12) @ np.sin(
        2.0 * np.pi * np.outer(frequencies, t) + phases[:, None]
    )
    values = waves * np.exp(-(((t / t[-1] - 0.35) / 0.22) ** 2))
    values[0] = 0.0
    return values / np.max(np.abs(values))


def _header(choose: Callable[..., Any], count: int, dt: float, units: str, kind: str) -> list[str]:
    """Return the lines that state the number of samples or the step, for some tables."""
    step = f"{dt:g}"
    comment = choose(["", "# ", "% ", "! "])
    free = (f"{count} points at {step} sec", f"NPTS= {count}, DT= {step} SEC")
    free += (f"Number of points: {count}  Time step: {step} s", f"dt = {step} s, npts = {count}")
    first = (
        f"{count} {step}",
        f" {count}    {dt:.5E}",
        f"{count}\n{step}",
        f"{count} {step} 0 0 0.",
    )
    commented = (f" {count} {step}", f"  {count}  {dt:.4E}  0  0  0.")
    forms: dict[str, list[str]] = {
        "none": [],
        "free": [comment + choose(free)],
        "declared": [f"# dt = {step} s, units = {units}"],
        "first": [choose(first)],
        "commented": [choose("%#") + choose(commented)],
        "count": [f"{comment}NPTS: {count}"],
    }
    allowed = ["none", "free", "declared", "count"] if kind == "no times" else [*forms]
    return forms[choose(allowed)]


def _damaged(choose: Callable[..., Any], rows: list[list[str]], dt: float) -> list[list[str]]:
    """Return rows with an error that must be named."""
    index = choose(range(20, len(rows) - 20))
    match choose(["repeated", "restarted", "lost", "short", "last step"]):
        case "repeated":
            return [*rows[:index], rows[index], *rows[index:]]
        case "restarted":
            return [*rows, *rows[:index]]
        case "lost":
            rows[index][1] = choose(["nan", "NaN", "null", "-", "***"])
        case "short":
            rows[index] = rows[index][:-1]
        case _:
            rows[-1][0] = f"{float(rows[-1][0]) + 3.3 * dt:.4f}"
    return rows


def _names(choose: Callable[..., Any], count: int, time: str, units: str) -> list[str]:
    """Return the names of times and `count` columns, with or without units."""
    if choose([True, False]):
        return ["Time", "X", "Y", "Z", "Total"][: count + 1] if count > 1 else ["Time", "Acc"]
    names = ["X", "Y", "Z", "Abs"][:count] if count > 1 else ["Acceleration"]
    unit = choose(_SPELLINGS[units]).strip("[]")
    return [f"Time ({time})", *(f"{name} ({unit})" for name in names)]


def random_table(seed: int) -> TableFile:
    """Return the table of a seed."""
    source, choose = np.random.default_rng(seed), random.Random(seed).choice
    kind, units = choose(_KINDS), choose([*_SCALES])
    count, dt = choose([300, 517, 900, 1203, 2000]), choose([0.005, 0.01, 0.02, 0.004, 0.0025])
    decimals = choose([1, 2, 3] if units == "cm/s^2" else [3, 4, 5, 6])
    peak = _PEAKS[units] * source.uniform(0.3, 1.5)
    x, y, z = (
        np.round(_motion(source, count, dt) * factor * peak, decimals) for factor in (1.0, 0.8, 0.5)
    )
    form = choose([f"%.{decimals}f", f"%.{decimals}f", f"%{decimals + 7}.{decimals}f", "%.6E"])
    separator = choose([" ", "\t", ",", ";"])
    t, places = dt * np.arange(count), max(len(f"{dt:g}".partition(".")[2]), 2)
    table = TableFile(kind, "", dt, units, [x])
    lines = [title] if (title := choose(_TITLES)) else []
    if kind in ("column", "rows", "pairs", "no times") or (
        kind in _HAS_TIMES and choose([True, False, False])
    ):
        lines += _header(choose, count, dt, units, kind)

    if kind == "column":
        lines += [form % value for value in x]
    elif kind == "rows":
        width, mark = choose([4, 5, 6, 8, 10]), " " if separator in "\t;" else separator
        texts = [form % value for value in x]
        rows = [mark.join(texts[i : i + width]) for i in range(0, count, width)]
        lines += choose([rows, rows, [f"{row}\\" for row in rows]])
    elif kind == "no times":
        table.motions, table.columns = [x, y, z], ("1", "2", "3")
        lines += [separator.join(form % v for v in row) for row in zip(x, y, z, strict=True)]
    elif kind == "pairs":
        width = choose([2, 3, 4])
        used = count - count % width
        words = [f"{a:.{places}f} {form % b}" for a, b in zip(t, x, strict=True)]
        lines = [line for line in lines if str(count) not in line]  # the rest has no number
        lines += ["  ".join(words[i : i + width]) for i in range(0, used, width)]
        table.motions = [x[:used]]
    elif kind == "lines":
        rows = [[f"{v:.{places}f}" for v in t], [(form % v).strip() for v in x]]
        named = choose([[["t"], ["a"]], [[], []]])
        lines = [";".join(name + row) for name, row in zip(named, rows, strict=True)]
        lines = lines[:: choose([1, -1])]
    elif kind == "spectrum":
        periods = choose([np.geomspace(0.01, 10.0, 80), 0.05 * np.arange(1, 101)])
        periods = choose([periods, np.append(periods, -1.0)])  # the last row is the PGV
        ordinates = peak * (0.3 + np.exp(-np.abs(periods)))
        names = (f"Period (s){separator}Sa (g)", f"T{separator}PSA", "Per(s) PSA damp 5%")
        titles = ("Response spectrum, damping 5 %", "Espectro de respuesta")
        lines = [choose([*names, *titles])]
        rows = zip(periods, ordinates, strict=True)
        lines += [f"{a:.4f}{separator}{form % b}" for a, b in rows]
        table.motions = []
    elif kind == "times only":
        lines = [choose(["Time", "t", "T [s]", "Time (s)"])] if choose([True, False]) else []
        lines += [f"{v:.{places}f}" for v in t]
        table.motions = []
    else:
        _add_rows_with_times(table, lines, choose, [x, y, z], (form, separator, places))
    for motion in table.motions:
        motion *= _SCALES[units]
    table.text = "\n".join([*lines, ""])
    return table


def _add_rows_with_times(
    table: TableFile,
    lines: list[str],
    choose: Callable[..., Any],
    components: list[np.ndarray],
    forms: tuple[str, str, int],
) -> None:
    """Add the rows of a table with times or line numbers, and the names of its columns."""
    (form, separator, places), kind, dt = forms, table.kind, table.dt
    count = len(components[0])
    columns = components if kind in ("components", "resultant") else components[:1]
    table.motions = [*columns]
    if kind == "resultant":  # the last component contains gravity
        gravity = STANDARD_GRAVITY / _SCALES[table.units]
        columns = [*columns[:2], columns[2] + gravity]
        table.motions = [*columns]
        columns.append(np.sqrt(sum(column**2 for column in columns)))
    unit, scale = choose([("s", 1.0)] * 9 + [("ms", 1000.0)])
    start = choose([0.0, 0.0, dt, 12.0, 1.7e9]) if unit == "s" else 0.0
    times = [scale * (start + dt * i) for i in range(count)]
    texts = [f"{v:.10g}" if unit == "ms" else f"{v:.{max(places, 4)}f}" for v in times]
    rows = [[text, *(form % c[i] for c in columns)] for i, text in enumerate(texts)]
    names = _names(choose, len(columns), unit, table.units)
    if kind == "line numbers":
        rows = [[str(i + 1), *row[1:]] for i, row in enumerate(rows)]
        names = ["n", *names[1:]]
    elif kind != "row names" and unit == "s" and start < 1e9 and choose([True, False, False]):
        rows, table.motions = _damaged(choose, rows, dt), []
    if kind == "numbers and times":
        rows = [[str(i + 1), *row] for i, row in enumerate(rows)]
        names = ["No.", *names]
    if kind == "row names":
        rows = [[f'"{i + 1}"', *row] for i, row in enumerate(rows)]
    # Damaged rows with different numbers of cells cannot be told from rows without names.
    if kind == "row names" or choose([True, True, False]):
        lines.append(separator.join(names))
    lines += [separator.join(row) for row in rows]


def _is_right(found: list[Any], table: TableFile) -> bool:
    """Return True if records are the motions of a table."""
    return len(found) == len(table.motions) > 0 and all(
        record.acceleration.size == motion.size
        and abs(record.dt / table.dt - 1.0) < 2e-4
        and np.allclose(record.acceleration, motion, rtol=0.0, atol=2e-4 * np.max(np.abs(motion)))
        for record, motion in zip(found, table.motions, strict=True)
    )


def outcome(seed: int, file: Path) -> str:
    """Write the table of a seed to a file, read it, follow the messages, and return the outcome."""
    table = random_table(seed)
    file.write_text(table.text)
    options: dict[str, Any] = {}
    units = None
    for _ in range(_ATTEMPTS):
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")
                found = read_records(file, units=units, layout=TextLayout(**options))
            return RIGHT if _is_right(found, table) else WRONG
        except (RecordError, UsageError) as error:
            missing = getattr(error, "missing", None) or getattr(error.__cause__, "missing", None)
            before = units, dict(options)
            if "`step" in str(error) or (missing and missing.step):
                options.setdefault("step", table.dt)
            if "units" in str(error):
                units = table.units
            if missing and missing.rows and table.kind == "rows":
                options["rows"] = True
            elif missing and missing.columns and table.kind != "rows":
                options.setdefault("column", table.columns or missing.columns[0])
            if skip := re.search(r"`skip_lines=(\d+)`", str(error)):
                options.setdefault("skip_lines", int(skip[1]))
            if before == (units, options):
                break
    return FAILED if table.motions else REFUSED


def main() -> None:
    """Read random tables, and print the number of each outcome by kind, and the seeds that fail."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--cases", type=int, default=1000)
    parser.add_argument("--first", type=int, default=0)
    arguments = parser.parse_args()
    found: dict[str, Counter[str]] = {kind: Counter() for kind in dict.fromkeys(_KINDS)}
    with TemporaryDirectory() as directory:
        for seed in range(arguments.first, arguments.first + arguments.cases):
            kind, result = random_table(seed).kind, outcome(seed, Path(directory) / "table.txt")
            found[kind][result] += 1
            if result in (FAILED, WRONG):
                print(f"{result}: {kind}, seed {seed}")
    for kind, counts in found.items():
        print(f"{kind:18}", ", ".join(f"{name} {counts[name]}" for name in OUTCOMES))


if __name__ == "__main__":
    main()
