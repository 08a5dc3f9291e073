"""Listed exceptions of the stored cases: values that are beyond twice their error estimates.

    python tests/grid/exceptions.py

judges all stored cases with all methods and time steps, and writes exceptions.csv. Rows that are
already listed keep their causes; the cause of a new row is empty, and has to be found and added.
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
from grid.judge import STEPS, judge, load_model, method_labels

FILE = Path(__file__).with_name("exceptions.csv")

_MARGIN = 1.2  # of the listed ratio, because rounding can change the location of a branch change


def listed():
    """Return the largest allowed ratios of errors to their estimates, and the causes, by digest of
    the case, method, time step in sampling intervals, and quantity."""
    with FILE.open() as file:
        return {
            (row["digest"], row["method"], float(row["samples"]), row["quantity"]): (
                float(row["ratio"]),
                row["cause"],
            )
            for row in csv.DictReader(file)
        }


def found(number):
    """Return the ratios of the values of a stored case that are beyond, by the key of `listed`."""
    warnings.simplefilter("ignore")
    row, seed, digest, peaks = read()[number]
    case, ratios = build(row, seed), {}
    model = load_model(case.model)
    for method, samples in product(method_labels(), STEPS):
        for excess in judge(case, peaks, method, samples, model).beyond:
            key = (digest, method, samples, excess.quantity)
            ratios[key] = max(excess.ratio, ratios.get(key, 0.0))
    return ratios


def main():
    """Write the exceptions of all stored cases."""
    causes = {key: cause for key, (_, cause) in listed().items()}
    with ProcessPoolExecutor() as pool:
        results = list(pool.map(found, range(len(read()))))
    with FILE.open("w", newline="") as file:
        table = csv.writer(file, lineterminator="\n")
        table.writerow(["digest", "method", "samples", "quantity", "ratio", "cause"])
        for ratios in results:
            for (digest, method, samples, quantity), ratio in ratios.items():
                cause = causes.get((digest, method, samples, quantity), "")
                limit = f"{_MARGIN * ratio:.2g}"
                table.writerow([digest, method, f"{samples:g}", quantity, limit, cause])


if __name__ == "__main__":
    main()
