"""Types of reports that the tests print, read and compare with the tables of the command."""

import shutil
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from peer_files import write_at2

ROOT = Path(__file__).parents[2]
EC8 = "ec8:type=1,soil=C,ag=0.35g"
SPECTRUM = "asce7:sds=1,sd1=0.6,tl=8"
LEVELS = """\
limits:
  levels:
    damage limitation: {drift_ratio: 0.8%, floor_acceleration: 0.9 g}
    life safety: {drift_ratio: 2%, residual_drift_ratio: 0.5%}
"""
KIP = """\
name: steel frame
units: {length: in, force: kip, mass: kip*s^2/in}
output_units: [kip, in, g]
stories:
  - {mass: 1.2, height: 180, stiffness: 900, law: {type: bilinear, yield_force: 420, hardening: 0.03}}
  - {mass: 1.2, height: 150, stiffness: 800, law: {type: bilinear, yield_force: 360, hardening: 0.03}}
  - {mass: 1.0, height: 150, stiffness: 600, law: {type: bilinear, yield_force: 240, hardening: 0.03}}
damping: {rayleigh: {ratio: 0.03, modes: [1, 2]}}
analysis: {method: impulse4}
"""  # noqa: E501
CAMPAIGN = """\
name: two frames
buildings: {models: [kip.yaml, older.yaml]}
records: {files: [firm-soil.mseed, near-fault.mseed], units: m/s^2}
intensity: {scales: [0.3, 0.6]}
analysis: {method: newmark-average}
"""
REGION = """\
name: district
buildings: {inventory: region.csv, rules: capacity, classes: classes.csv, units: {length: m}}
records: {files: [firm-soil.mseed, near-fault.mseed], units: m/s^2}
intensity: {scales: [0.5, 1]}
analysis: {method: newmark-average}
damage:
  thresholds: {slight: 0.4%, moderate: 0.8%, extensive: 1.5%, complete: 4%}
  dispersion: 0.3
  losses: {slight: 5%, moderate: 20%, extensive: 50%, complete: 100%, collapsed: 100%}
"""
BUILDINGS = """\
id,class,NumberOfStories,Latitude,Longitude
school,concrete-frame,3,37.81,-122.26
office,concrete-frame,6,37.80,-122.27
house,timber,1,37.79,-122.40
church,masonry,2,37.77,-122.45
"""
RECORDED = """\
base: {file: firm-soil.mseed, component: HN1, units: m/s^2}
floors:
  5: {file: recorded/floors.mseed, component: F05, units: m/s^2}
  10: {file: recorded/floors.mseed, component: F10, units: m/s^2}
"""


@dataclass(frozen=True)
class Kind:
    """Report of a command.

    Attributes
    ----------
    line : str
        Command without `--report`.
    before : tuple of str
        Commands that write the files which `line` reads.
    models : tuple of str
        Model files of the buildings, without suffix.
    code : int
        Exit code of `line`.
    """

    line: str
    before: tuple[str, ...] = ()
    models: tuple[str, ...] = ("bilinear",)
    code: int = 0


ONE = "firm-soil.mseed --component HN1 --units m/s^2"
TWO = "firm-soil.mseed near-fault.mseed --component HN1 --units m/s^2"
SUITE = "firm-soil.mseed near-fault.mseed soft-soil.mseed --component HN1 --units m/s^2"
KINDS = {
    "linear": Kind("run linear.yaml -o out --history", models=("linear",)),
    "bilinear": Kind("run bilinear.yaml -o out --history --limit 2%"),
    "isolated": Kind("run isolated.yaml -o out --history", models=("isolated",)),
    "collapse": Kind("run older.yaml --scale 3 -o out --history --limit 2%", models=("older",)),
    "kip": Kind(f"run kip.yaml {ONE} -o out --history --limit 1.5%", models=("kip",)),
    "levels": Kind("run levels.yaml -o out --history", models=("levels",)),
    "suite": Kind(f"run bilinear.yaml {SUITE} -o out --limit 2%"),
    "suite of many": Kind("run bilinear.yaml pool -o out --limit 2% --pair-demand separate"),
    "suite of pairs": Kind("run bilinear.yaml pool -o out --limit 2%"),
    "suite with levels": Kind(f"run levels.yaml {SUITE} -o out", models=("levels",)),
    "suite of isolated": Kind(f"run isolated.yaml {SUITE} -o out", models=("isolated",)),
    "scaled suite": Kind(
        "run bilinear.yaml --factors factors.csv -o out --limit 2%",
        (f"scale pool --target {SPECTRUM} --range 0.3:2 --pairs rotd100 -o factors.csv",),
    ),
    "matched": Kind(
        "run bilinear.yaml matched -o out --limit 2%",
        (f"match {TWO} --target {SPECTRUM} -o matched --format at2",),
    ),
    "pushover": Kind(f"pushover older.yaml --target {EC8} -o out.csv", models=("older",)),
    "modes": Kind("modes bilinear.yaml -o out.csv"),
    "modes under a target": Kind(f"modes bilinear.yaml --target {SPECTRUM} -o out.csv"),
    "transfer functions": Kind("modes bilinear.yaml --transfer -o out.csv"),
    "compare": Kind(
        "compare linear.yaml --recorded recorded.yaml --require correlation=0.9 -o out",
        ("run bilinear.yaml --scale 0.5 --export-floors mseed -o recorded",),
        models=("linear",),
    ),
    "ida": Kind(f"ida older.yaml {SUITE} -o out", models=("older",)),
    "fragility": Kind("fragility stripes.csv -o out.csv", models=()),
    "fragility of ida": Kind(
        "fragility ida -o out.csv", (f"ida older.yaml {SUITE} -o ida",), models=("older",)
    ),
    "campaign": Kind("campaign study.yaml -o out --limit 2%", models=("kip", "older")),
    "region": Kind("campaign region.yaml -o out", models=()),
}


def write_pool(folder: Path, pairs: int = 8) -> None:
    """Write pairs of horizontal components in AT2 files, noise of 12 s in an envelope."""
    folder.mkdir()
    dt, samples = 0.01, 1200
    time = np.arange(samples) * dt
    for number in range(pairs):
        for index, direction in enumerate(("000", "090")):
            generator = np.random.default_rng(10 * number + index)
            noise = np.convolve(generator.standard_normal(samples), np.ones(12), "same")
            values = noise * (time / 3.0) ** 2 * np.exp(2.0 - 2.0 * time / 3.0)
            values *= (0.45, 0.3)[index] * (0.7 + 0.1 * number) / np.abs(values).max()
            description = (
                f"Event {number}, {1 + number}/17/1995, Station {number}, {int(direction)}"
            )
            write_at2(folder / f"RSN{100 + number}_S{direction}.AT2", description, values, dt)


def write_inputs(folder: Path) -> None:
    """Write all files that the commands of `KINDS` read into a directory."""
    configs = {
        "linear": "ten-story",
        "bilinear": "ten-story-bilinear",
        "isolated": "base-isolated",
        "older": "collapse-prone-frame",
    }
    for name, config in configs.items():
        text = (ROOT / "configs" / f"{config}.yaml").read_text().replace("../records/", "")
        (folder / f"{name}.yaml").write_text(text)
    (folder / "levels.yaml").write_text((folder / "bilinear.yaml").read_text() + LEVELS)
    for name in ("firm-soil", "near-fault", "soft-soil"):
        shutil.copy(ROOT / "records" / f"{name}.mseed", folder)
    shutil.copy(ROOT / "configs/stripes.csv", folder)
    shutil.copy(ROOT / "configs/capacity-classes.csv", folder / "classes.csv")
    texts = {
        "kip.yaml": KIP, "study.yaml": CAMPAIGN, "region.yaml": REGION,
        "region.csv": BUILDINGS, "recorded.yaml": RECORDED,
    }  # fmt: skip
    for name, text in texts.items():
        (folder / name).write_text(text)
    write_pool(folder / "pool")
