"""Covering array of the grid: all pairs of values of two axes occur in a case.

    python tests/grid/covering.py

adds cases for pairs that the stored array (cases.csv) does not contain, and computes the reference
peaks (peaks.csv) of new and changed cases with the separate solver. Cases with values that no
longer exist are removed.
"""

import csv
import random
import sys
from concurrent.futures import ProcessPoolExecutor
from itertools import combinations, product
from pathlib import Path

if __name__ == "__main__":
    sys.path.insert(0, str(Path(__file__).parents[1]))

import numpy as np

from grid.axes import AXES, build, is_allowed
from grid.solver import sizes_of, solve
from grid.springs import StoryFailureError

CASES = Path(__file__).with_name("cases.csv")
PEAKS = Path(__file__).with_name("peaks.csv")

RESOLUTION = 2e-6
"""Largest difference of two solutions with different tolerances, divided by the largest value of
the quantity. Buildings with larger differences amplify any error and are replaced."""

_TOLERANCES = (1e-10, 1e-8)
_CANDIDATES = 6  # rows from which the next row is chosen
_SEEDS = 8  # seeds that are tried for a row
_ROUNDS = 4  # other rows are tried for pairs of rows without an accurate reference


def pairs_of(row):
    """Return the pairs of values in a row."""
    return set(combinations(row.items(), 2))


def all_pairs():
    """Return all pairs of values that do not exclude each other."""
    return {
        pair
        for first, second in combinations(AXES, 2)
        for pair in product(
            ((first, name) for name in AXES[first]), ((second, name) for name in AXES[second])
        )
        if is_allowed(dict(pair))
    }


def uncovered(rows):
    """Return the pairs that no row contains."""
    return all_pairs().difference(*map(pairs_of, rows))


def covering_rows(rows, seed):
    """Yield rows that cover the pairs that `rows` do not contain; the choice depends on `seed`."""
    generator, missing = random.Random(seed), uncovered(rows)
    while missing:
        pair = min(missing)
        candidates = [_row_with(pair, missing, generator) for _ in range(_CANDIDATES)]
        candidates = [row for row in candidates if row]
        if not candidates:  # the pair is excluded by three values together
            missing.discard(pair)
            continue
        best = max(candidates, key=lambda row: len(pairs_of(row) & missing))
        missing -= pairs_of(best)
        yield best


def _row_with(pair, missing, generator):
    """Return an allowed row with a pair of values; None if there is none.

    The axes are filled in random order with the value that adds most missing pairs.
    """
    row = dict(pair)
    for axis in generator.sample(list(AXES), len(AXES)):
        if axis in row:
            continue
        names = [name for name in AXES[axis] if is_allowed(row | {axis: name})]
        if not names:
            return None
        generator.shuffle(names)
        row[axis] = max(names, key=lambda name: _added_pairs(row, (axis, name), missing))
    return {axis: row[axis] for axis in AXES}


def _added_pairs(row, item, missing):
    """Return the number of missing pairs of a value with the values of a row."""
    order = list(AXES)
    return sum(
        ((other, item) if order.index(other[0]) < order.index(item[0]) else (item, other))
        in missing
        for other in row.items()
    )


def reference(case):
    """Return the peaks of a case by name; None if its solution is not accurate or not complete."""
    try:
        fine, coarse = (
            solve(case.model, case.ground, case.interval, case.duration, tolerance)
            for tolerance in _TOLERANCES
        )
    except StoryFailureError:
        return None
    heights = np.array([story.get("height", 3.5) for story in case.model["stories"]])
    if np.max(fine["peak_drift"][: case.n] / heights) > 0.5:
        return None
    for name, size in sizes_of(fine, case.n).items():
        if np.any(np.abs(fine[name] - coarse[name]) > RESOLUTION * size):
            return None
    return fine


def referenced(row, seed):
    """Return the first accurate case with a row, from a seed on, and its peaks; None if there is
    none."""
    for attempt in range(_SEEDS):
        case = build(row, seed + attempt)
        peaks = reference(case)
        if peaks:
            return case, peaks
    return None


def read():
    """Return the stored cases and their peaks, as a list of (case, digest, peaks)."""
    with PEAKS.open() as file:
        rows = list(csv.DictReader(file))
    peaks = {}
    for row in rows:
        peaks.setdefault(int(row.pop("case")), []).append(row)
    stored = []
    with CASES.open() as file:
        for number, entry in enumerate(csv.DictReader(file)):
            seed, digest = int(entry.pop("seed")), entry.pop("digest")
            columns = {
                name: np.array([float(story[name]) for story in peaks[number]])
                for name in peaks[number][0]
            }
            stored.append((entry, seed, digest, columns))
    return stored


def write(stored):
    """Write cases and peaks."""
    with CASES.open("w", newline="") as file:
        table = csv.writer(file, lineterminator="\n")
        table.writerow(["seed", "digest", *AXES])
        table.writerows([seed, digest, *row.values()] for row, seed, digest, _ in stored)
    with PEAKS.open("w", newline="") as file:
        table = csv.writer(file, lineterminator="\n")
        table.writerow(["case", *stored[0][3]])
        for number, (*_, peaks) in enumerate(stored):
            for story in zip(*peaks.values(), strict=True):
                table.writerow([number, *(f"{number:.8g}" for number in story)])


def valid(stored):
    """Return the stored cases that are up to date, and the rows of changed cases."""
    kept, changed = [], []
    for row, seed, digest, peaks in stored:
        if set(row) == set(AXES) and all(name in AXES[axis] for axis, name in row.items()):
            row = {axis: row[axis] for axis in AXES}
            if build(row, seed).digest == digest:
                kept.append((row, seed, digest, peaks))
            else:
                changed.append(row)
    return kept, changed


def extend(kept, changed):
    """Add cases with changed rows and with missing pairs to the list of cases, and write it."""
    for attempt in range(_ROUNDS):
        rows = [row for row, *_ in kept]
        new = [*changed, *covering_rows([*rows, *changed], attempt)]
        changed = []
        first = 1000 * (1 + max((seed for _, seed, *_ in kept), default=0) // 1000)
        with ProcessPoolExecutor() as pool:
            results = pool.map(referenced, new, range(first, first + 1000 * len(new), 1000))
            for case, peaks in filter(None, results):
                kept.append((case.row, case.seed, case.digest, peaks))
                write(kept)


if __name__ == "__main__":
    kept, changed = valid(read() if CASES.exists() else [])
    extend(kept, changed)
    print(f"{len(kept)} cases, {len(uncovered([row for row, *_ in kept]))} pairs missing")
