"""Listed exceptions of the stored cases: values that are beyond twice their error estimates.

    python tests/grid/exceptions.py

judges all stored cases with all methods and time steps, and writes exceptions.csv. The cause of an
exception is `step` if a quarter of the time step is within twice the estimate: both runs of the
estimate then have nearly the same error by accident, or miss the same extremum. Otherwise it is
`persistent`, which has to be explained in tests/MEASUREMENTS.md or repaired. The quantity
`strength` is the relative excess of a force that the law does not reach.
"""

import csv
import sys
import warnings
from concurrent.futures import ProcessPoolExecutor
from itertools import product
from pathlib import Path

if __name__ == "__main__":
    sys.path.insert(0, str(Path(__file__).parents[1]))
    import grid.run  # noqa: F401  (sets the environment before the first import of tdint)

from grid.axes import build
from grid.covering import read
from grid.judge import STEPS, judge, method_labels, model_of

FILE = Path(__file__).with_name("exceptions.csv")

_LISTED = 1.8
"""Error divided by its estimate from which a value is listed. The tests allow 2; rounding depends
on the machine."""

_MARGIN = 1.2
"""Factor on the listed ratio, for the same reason."""


def listed():
    """Return the largest allowed ratios of errors to their estimates by digest of the case, method,
    time step in sampling intervals, and quantity."""
    with FILE.open() as file:
        return {
            (row["digest"], row["method"], float(row["samples"]), row["quantity"]): float(
                row["ratio"]
            )
            for row in csv.DictReader(file)
        }


def found(number):
    """Return the rows of a stored case: digest, method, time step, quantity, ratio and cause."""
    warnings.simplefilter("ignore")
    row, seed, digest, peaks = read()[number]
    case, ratios = build(row, seed), {}
    model = model_of(case)
    if model is None:
        return []
    for method, samples in product(method_labels(), STEPS):
        verdict = judge(case, peaks, method, samples, model, _LISTED)
        for quantity, ratio in verdict.ratios():
            key = method, samples, quantity
            ratios[key] = max(ratio, ratios.get(key, 0.0))
    rows = []
    for (method, samples, quantity), ratio in ratios.items():
        finer = judge(case, peaks, method, 0.25 * samples, model)
        is_beyond = quantity in dict(finer.ratios())
        cause = "persistent" if is_beyond else "step"
        rows.append([digest, method, f"{samples:g}", quantity, f"{_MARGIN * ratio:.2g}", cause])
    return rows


def main():
    """Write the exceptions of all stored cases."""
    with ProcessPoolExecutor() as pool:
        results = list(pool.map(found, range(len(read()))))
    with FILE.open("w", newline="") as file:
        table = csv.writer(file, lineterminator="\n")
        table.writerow(["digest", "method", "samples", "quantity", "ratio", "cause"])
        for rows in results:
            table.writerows(rows)


if __name__ == "__main__":
    main()
