"""How far studies mislead: python tests/benchmarks/studies.py

A region of forty buildings of four classes under the shipped motions at six levels of PGA (the one
of src/tdint/campaign/README.md): the medians of clouds over those of stripes, which count, and the
loss ratios that follow from the functions over those of the runs themselves.
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
records: {{files: [{ROOT}/records/], units: m/s^2}}
intensity: {{measure: pga, levels: [{", ".join(f"{level} g" for level in LEVELS)}]}}
damage:
  thresholds: capacity
  dispersion: 0.3
  losses: {{{", ".join(f"{state}: {loss}" for state, loss in LOSSES.items())}}}
"""


def tdint(*words: str) -> None:
    subprocess.run([sys.executable, "-m", "tdint", *words], check=True)


def rows(file: Path) -> list[dict[str, str]]:
    with file.open(newline="") as stream:
        return list(csv.DictReader(stream))


def functions_of(folder: Path, fit: str) -> dict[str, list[tuple[float, float]]]:
    """Median and dispersion of each class, from the lightest state."""
    file = folder / f"{fit}.csv"
    tdint(
        "fragility",
        str(folder / "out"),
        "--by",
        "type",
        "--im",
        "pga",
        "--fit",
        fit,
        "-o",
        str(file),
    )
    found = defaultdict(list)
    for row in rows(file):
        found[row["type"]].append((float(row["theta"]), float(row["beta"])))
    return found


def region(folder: Path) -> None:
    text = "".join(f"b{i},{CLASSES[i % 4]},{1 + i // 4 % 3}\n" for i in range(40))
    (folder / "buildings.csv").write_text("id,class,NumberOfStories\n" + text)
    (folder / "region.yaml").write_text(REGION)
    tdint("campaign", str(folder / "region.yaml"), "-o", str(folder / "out"), "-q")
    both = {fit: functions_of(folder, fit) for fit in ("stripes", "cloud")}
    parts = [
        cloud / stripes
        for name in CLASSES
        for (stripes, _), (cloud, _) in zip(both["stripes"][name], both["cloud"][name], strict=True)
    ]
    off = np.abs(np.array(parts) - 1.0)
    print(
        f"medians of cloud over stripes: {min(parts):.3f} to {max(parts):.3f}, off by "
        f"{100 * np.median(off):.0f} % in the median, {100 * np.max(off):.0f} % at worst"
    )
    direct = defaultdict(dict)
    for row in rows(folder / "out/losses.csv"):
        if row["type"] and not row["building"]:
            direct[row["type"]][float(row["level"])] = float(row["loss_ratio"])
    steps = np.diff([0.0, *LOSSES.values()])
    for fit, functions in both.items():
        told = {
            name: [
                float(steps @ [ndtr(np.log(im / theta) / beta) for theta, beta in functions[name]])
                for im in of
            ]
            for name, of in direct.items()
        }
        by_class = {name: sum(told[name]) / sum(direct[name].values()) for name in CLASSES}
        whole = sum(map(sum, told.values())) / sum(sum(of.values()) for of in direct.values())
        listed = ", ".join(f"{name} {part:.3f}" for name, part in by_class.items())
        print(f"losses by functions ({fit}) over direct losses, all levels: {whole:.3f} ({listed})")


if __name__ == "__main__":
    os.environ.setdefault("PYTHONWARNINGS", "ignore")
    with TemporaryDirectory() as place:
        region(Path(place))
