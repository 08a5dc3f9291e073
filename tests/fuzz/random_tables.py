"""Random tables without a header, which contain one ground motion in rows or several in columns.

`python tests/fuzz/random_tables.py --cases 5000` reads each table with a specified time step and
units, and counts what the reader decides. A question is never wrong. A wrong decision is a table of
rows that is read as columns, or columns that are read as one ground motion.
"""

import argparse
import logging
from collections import Counter
from collections.abc import Callable
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from scipy.signal import lfilter

from tdint.errors import RecordError
from tdint.ground_motion.choice import TextLayout
from tdint.ground_motion.reading.read import read_records

RECORDS = Path(__file__).parents[2] / "records"
DT = 0.01
RIGHT, ASKED, WRONG = OUTCOMES = "right", "asked", "wrong"

Motion = np.ndarray
Source = np.random.Generator


@cache
def recorded() -> tuple[Motion, ...]:
    """Return the components of the records of the repository, m/s^2."""
    files = [*sorted(RECORDS.glob("*.mseed")), *sorted(RECORDS.glob("kaikoura/*.mseed"))]
    return tuple(part.acceleration for file in files for part in read_records(file))


def motion(source: Source, samples: int) -> Motion:
    """Return a part of a recorded motion with its peak, or an artificial motion; the peak is 1."""
    if source.random() < 0.6:
        record = recorded()[source.integers(len(recorded()))]
        start = max(0, int(np.argmax(np.abs(record)) - source.integers(10, samples - 10)))
        values = record[start : start + samples]
    else:
        t = np.arange(samples) * DT
        center = source.uniform(1.0, 8.0)
        frequencies = center * np.exp(source.normal(0.0, 0.6, 40))
        frequencies = frequencies[frequencies < 0.35 / DT]
        phases = source.uniform(0.0, 2.0 * np.pi, frequencies.size)
        values = np.sin(2.0 * np.pi * np.outer(t, frequencies) + phases).sum(axis=1)
        values *= (t / t[-1]) ** 2 * np.exp(-4.0 * t / t[-1])
    values = values - values.mean()
    return values / np.max(np.abs(values))


def floors(source: Source, ground: Motion, count: int) -> Motion:
    """Return the motions of the ground and of floors, shape (samples, floors): each floor is an
    oscillator on the floor below."""
    period, damping = source.uniform(0.05, 1.0), source.uniform(0.02, 0.2)
    pole = np.exp((-damping + 1j * np.sqrt(1.0 - damping**2)) * 2.0 * np.pi * DT / period)
    denominator = [1.0, -2.0 * pole.real, abs(pole) ** 2]
    columns = [ground]
    for _ in range(count - 1):
        columns.append(lfilter([sum(denominator)], denominator, columns[-1]))
    return np.stack(columns, axis=1)


def delayed(source: Source, samples: int, count: int) -> Motion:
    """Return motions of points along a wave, delayed by whole or fractional steps. Points that are
    advanced by one step divided by their number are excluded: they are rows of samples."""
    lags = np.array([-5, -2, -1, -0.5, -0.25, -0.1, 0.1, 0.25, 0.5, 1, 2, 5])
    lag = source.choice(lags[lags * count != -1.0])
    record = motion(source, samples)
    t = np.arange(record.size)
    return np.stack([np.interp(t - lag * j, t, record) for j in range(count)], axis=1)


COLUMNS: dict[str, Callable[[Source, int, int], Motion]] = {
    "suite": lambda source, n, w: np.stack(
        [np.resize(motion(source, n), n) * source.uniform(0.3, 1.0) for _ in range(w)], axis=1
    ),
    "floors": lambda source, n, w: floors(source, motion(source, n), w),
    "identical": lambda source, n, w: np.stack([motion(source, n)] * w, axis=1),
    "scaled": lambda source, n, w: np.outer(
        motion(source, n), np.linspace(1.0, source.uniform(0.8, 1.25), w)
    ),
    "delayed": delayed,
    "displacements": lambda source, n, w: np.cumsum(
        np.cumsum(floors(source, motion(source, n), w), axis=0), axis=0
    ),
    "noise": lambda source, n, w: source.normal(size=(n, w)),
}
"""Functions of a random generator, the number of samples and the number of motions; they return the
motions in columns."""

KINDS = ("rows", *COLUMNS)


def table(kind: str, source: Source) -> tuple[str, Motion]:
    """Return the text of a table, and its motions in columns; one column for rows."""
    width = int(source.choice([2, 3, 4, 5, 6, 8, 10]))
    samples = int(source.choice([150, 600, 2000]))
    if kind == "rows":
        motions = motion(source, samples)[:, None]
    else:
        motions = COLUMNS[kind](source, samples, width)
    motions = motions / np.max(np.abs(motions))
    form, factor = [("{:10.5f}", 1.0), ("{:8.2f}", 300.0), ("{:15.7E}", 0.3)][source.integers(3)]
    texts = [form.format(value) for value in (factor * motions).ravel()]
    lines = ["".join(texts[i : i + width]) for i in range(0, len(texts), width)]
    return "\n".join(lines) + "\n", np.array(list(map(float, texts))).reshape(motions.shape)


def outcome(kind: str, seed: int, file: Path) -> str:
    """Write a random table to a file, and return what the reader decides."""
    source = np.random.default_rng([KINDS.index(kind), seed])
    text, motions = table(kind, source)
    file.write_text(text)
    try:
        records = read_records(file, units="gal", layout=TextLayout(step=DT))
    except RecordError as error:
        assert "`rows`" in str(error), error
        return ASKED
    is_right = len(records) == motions.shape[1] and all(
        record.acceleration.size == column.size
        and np.allclose(100.0 * record.acceleration, column, rtol=1e-12)
        for record, column in zip(records, motions.T, strict=True)
    )
    return RIGHT if is_right else WRONG


def main() -> None:
    """Read random tables, and print the number of each decision by type of table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--cases", type=int, default=5000)
    cases = parser.parse_args().cases
    logging.getLogger("tdint").setLevel(logging.ERROR)
    found: dict[str, Counter[str]] = {kind: Counter() for kind in KINDS}
    with TemporaryDirectory() as directory:
        for case in range(cases):
            # Every second table contains rows.
            kind = "rows" if case % 2 else KINDS[1 + case // 2 % len(COLUMNS)]
            decision = outcome(kind, case, Path(directory) / "table.txt")
            found[kind][decision] += 1
            if decision == WRONG:
                print(f"wrong: {kind}, seed {case}")
    for kind, counts in found.items():
        print(f"{kind:14}", ", ".join(f"{name} {counts[name]}" for name in OUTCOMES))
    print(f"{sum(counts[WRONG] for counts in found.values())} wrong decisions of {cases}")


if __name__ == "__main__":
    main()
