"""Compare fragility functions of a region with the runs from which they are derived.

    python tests/benchmarks/studies.py

The region of src/tdint/studies/README.md has forty buildings of four classes, under the ground
motions of records at six levels of PGA. The program prints the medians of cloud analysis divided by
the medians of stripe analysis (the reference), and the loss ratios that are computed with fragility
functions divided by the loss ratios of the runs.
"""

import csv
import os
import subprocess
import sys
from collections import defaultdict
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from common import ROOT
from scipy.special import ndtr

TABLE = ROOT / "configs" / "capacity-classes.csv"
CLASSES = ("masonry", "timber", "wall", "concrete-frame")
LOSSES = {"slight": 0.05, "moderate": 0.2, "extensive": 0.6, "complete": 1.0}
LEVELS = (0.05, 0.1, 0.2, 0.3, 0.4, 0.6)  # g
REGION = f"""\
buildings: {{inventory: buildings.csv, rules: capacity, classes: {TABLE}, units: {{length: m}}}}
records: {{files: [{ROOT}/records/], units: m/s^2, pair_demand: separate}}
intensity: {{measure: pga, levels: [{", ".join(f"{level} g" for level in LEVELS)}]}}
damage:
  thresholds: capacity
  dispersion: 0.3
  losses: {{{", ".join(f"{state}: {loss}" for state, loss in LOSSES.items())}}}
"""


def tdint(*arguments: str) -> None:
    """Run the command `tdint` with some arguments."""
    subprocess.run([sys.executable, "-m", "tdint", *arguments], check=True)


def rows(file: Path) -> list[dict[str, str]]:
    """Return the rows of a CSV file."""
    with file.open(newline="") as stream:
        return list(csv.DictReader(stream))


def fragility_functions(directory: Path, fit: str) -> dict[str, list[tuple[float, float]]]:
    """Fit fragility functions to the campaign in the directory `out`.

    Parameters
    ----------
    directory : Path
        Directory that contains `out`. The functions are written to FIT.csv.
    fit : {"stripes", "cloud"}
        Type of analysis.

    Returns
    -------
    dict of str to list of (float, float)
        Median (in the unit of the column `level` of losses.csv) and dispersion of each damage state
        by class, from slight to complete damage.
    """
    file = directory / f"{fit}.csv"
    options = ("--by", "type", "--im", "pga", "--fit", fit, "-o", str(file))
    tdint("fragility", str(directory / "out"), *options)
    functions = defaultdict(list)
    for row in rows(file):
        functions[row["type"]].append((float(row["theta"]), float(row["beta"])))
    return functions


def run_region(directory: Path) -> None:
    """Run the region in a directory and print the comparison."""
    text = "".join(f"b{i},{CLASSES[i % 4]},{1 + i // 4 % 3}\n" for i in range(40))
    (directory / "buildings.csv").write_text("id,class,NumberOfStories\n" + text)
    (directory / "region.yaml").write_text(REGION)
    tdint("campaign", str(directory / "region.yaml"), "-o", str(directory / "out"), "-q")
    functions_by_fit = {fit: fragility_functions(directory, fit) for fit in ("stripes", "cloud")}
    ratios = [
        cloud_median / stripes_median
        for name in CLASSES
        for (stripes_median, _), (cloud_median, _) in zip(
            functions_by_fit["stripes"][name], functions_by_fit["cloud"][name], strict=True
        )
    ]
    differences = np.abs(np.array(ratios) - 1.0)
    print(
        f"medians of cloud / stripes: {min(ratios):.3f} to {max(ratios):.3f}, median difference "
        f"{100 * np.median(differences):.0f} %, maximum {100 * np.max(differences):.0f} %"
    )
    # Loss ratios of the runs by class and level of PGA. The rows without a building are the
    # sums over the buildings of a class.
    losses_of_runs = defaultdict(dict)
    for row in rows(directory / "out/losses.csv"):
        if row["type"] and not row["building"]:
            losses_of_runs[row["type"]][float(row["level"])] = float(row["loss_ratio"])
    # A building in a damage state is also in all lighter states, so each probability of exceedance
    # is multiplied by the increase of the loss ratio.
    loss_increments = np.diff([0.0, *LOSSES.values()])
    for fit, functions in functions_by_fit.items():
        computed = {}  # sum of the loss ratios over the levels, by class
        for name, losses in losses_of_runs.items():
            probabilities = [
                [ndtr(np.log(level / theta) / beta) for theta, beta in functions[name]]
                for level in losses
            ]
            computed[name] = sum(float(loss_increments @ states) for states in probabilities)
        observed = {name: sum(losses.values()) for name, losses in losses_of_runs.items()}
        ratio = sum(computed.values()) / sum(observed.values())
        by_class = ", ".join(f"{name} {computed[name] / observed[name]:.3f}" for name in CLASSES)
        print(
            f"losses of fragility functions ({fit}) / losses of the runs, all levels: {ratio:.3f} "
            f"({by_class})"
        )


if __name__ == "__main__":
    os.environ.setdefault("PYTHONWARNINGS", "ignore")
    with TemporaryDirectory() as temporary:
        run_region(Path(temporary))
