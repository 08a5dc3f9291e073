"""profiles.csv, its picture and the limit of drifts, against numbers computed from stories.csv by hand."""

import json
import math
import statistics
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from cli.conftest import Command
from csv_rows import rows
from tdint.campaign.profiles import Statistics

STUDY = """\
name: study
buildings: {models: [shaken.yaml, stiff.yaml]}
records: {files: [motion.mseed, other.mseed, third.mseed], units: m/s^2}
intensity: {scales: [0.5, 1]}
analysis: {method: newmark-average}
outputs: {stories: true}
"""
STIFF = """\
name: stiff
stories:
  - {mass: 10, height: 3, stiffness: 80000, dashpot: 100}
  - {mass: 10, height: 3, stiffness: 60000, law: {type: bilinear, yield_force: 15, hardening: 0.1}}
damping: {rayleigh: {mass: 0.5, stiffness: 0.001}}
"""
COLUMNS = "building,scale,quantity,story,unit,mean,median,p16,p84,max,runs,collapsed,failed"
UNITS = {"m": "_m", "1": "", "N": "_N", "m/s": "_m_s", "m/s^2": "_m_s2"}
MOTIONS = {"motion.mseed": "pair", "other.mseed": "single", "third.mseed": "single"}


@pytest.fixture
def study(folder: Path, make_record: Callable[..., None]) -> Path:
    """The working directory with study.yaml: two buildings, a pair and two single components, two scales."""
    make_record(folder / "third.mseed", "HNE", peak=2.0)
    (folder / "study.yaml").write_text(STUDY)
    (folder / "stiff.yaml").write_text(STIFF)
    return folder


def fractile(values: list[float], part: float) -> float:
    """On straight lines between the values in order, the first at 0 and the last at 1."""
    ordered, place = sorted(values), part * (len(values) - 1)
    below = min(int(place), len(values) - 2)
    return ordered[below] + (place - below) * (ordered[below + 1] - ordered[below])


def by_hand(stories: list[dict[str, str]], column: str, which: dict[str, str]) -> list[float]:
    """The values of a column over the motions: of both components of a pair the larger one."""
    largest: dict[str, float] = {}
    for row in stories:
        if all(row[name] == value for name, value in which.items()):
            largest[row["record"]] = max(largest.get(row["record"], 0.0), abs(float(row[column])))
    return list(largest.values())


def test_every_number_is_that_of_the_stories(study: Path, tdint: Command) -> None:
    assert tdint("campaign", "study.yaml", "-o", "out").exit_code == 0
    stories, found = rows("out/stories.csv"), rows("out/profiles.csv")
    assert Path("out/profiles.csv").read_text().splitlines()[0] == COLUMNS
    quantities = list(dict.fromkeys(row["quantity"] for row in found))
    assert [name for row in found[:1] for name in row] == COLUMNS.split(",")
    columns = {name: next(c for c in stories[0] if c.startswith(name) and c.removeprefix(name) in UNITS.values())
               for name in quantities}  # fmt: skip
    assert set(columns.values()) == set(stories[0]) - {"building", "record", "component", "scale", "story", "height_m"}
    for row in found:
        assert columns[row["quantity"]].removeprefix(row["quantity"]) == UNITS[row["unit"]]
        if row["quantity"] == "ductility" and not row["mean"]:
            continue  # of a story that does not yield
        which = {name: row[name] for name in ("building", "scale", "story")}
        values = by_hand(stories, columns[row["quantity"]], which)
        wanted = (
            statistics.fmean(values), statistics.median(values), fractile(values, 0.16), fractile(values, 0.84),
            max(values),
        )  # fmt: skip
        told = [float(row[name]) for name in ("mean", "median", "p16", "p84", "max")]
        assert told == pytest.approx(wanted, rel=1e-11, abs=1e-300), row
        assert (row["runs"], row["collapsed"], row["failed"]) == ("3", "0", "0")


def test_errors_of_the_runs_are_carried_to_the_statistics(study: Path, tdint: Command) -> None:
    """All values a little larger or smaller give other statistics: by so much these may be off, and no more."""
    text = Path("study.yaml").read_text().replace("{method: newmark-average}", "{method: moment4, check: true}")
    Path("study.yaml").write_text(text)
    assert tdint("campaign", "study.yaml", "-o", "out").exit_code == 0
    stories, found = rows("out/stories.csv"), rows("out/profiles.csv")
    of_statistics = {
        "mean": statistics.fmean, "median": statistics.median, "p16": lambda those: fractile(those, 0.16),
        "p84": lambda those: fractile(those, 0.84), "max": max,
    }  # fmt: skip
    assert list(found[0]) == [*COLUMNS.split(","), *(f"{name}_error" for name in of_statistics)]
    for row in stories:
        for name in ("peak_drift_m", "peak_absolute_acceleration_m_s2"):
            value, error = float(row[name]), float(row[f"{name}_error"])
            row[f"{name}_up"], row[f"{name}_down"] = str(value + error), str(value - error)
    told = 0
    for row in found:
        if row["quantity"] not in ("peak_drift", "peak_absolute_acceleration"):
            continue
        which = {name: row[name] for name in ("building", "scale", "story")}
        column = row["quantity"] + UNITS[row["unit"]]
        up, own, down = (by_hand(stories, f"{column}{end}", which) for end in ("_up", "", "_down"))
        for name, of in of_statistics.items():
            wanted = max(of(up) - of(own), of(own) - of(down))
            assert float(row[f"{name}_error"]) == pytest.approx(wanted, rel=1e-6, abs=1e-11 * of(own))
            told += wanted > 1e-9 * of(own)
    assert told > 40
    summary = json.loads(Path("out/summary.json").read_text())
    assert list(summary["profiles"]["columns"])[-1] == "max_error"


def test_the_limit_is_of_the_mean_in_the_worst_story(study: Path, tdint: Command) -> None:
    """Not of the mean over motions of their worst stories, which is another number."""
    run = ("run", "stiff.yaml", *MOTIONS, "--units", "m/s^2", "--method", "newmark-average")
    tdint("campaign", "study.yaml", "-o", "out")
    stories = [row for row in rows("out/stories.csv") if row["building"] == "stiff"]
    means = {
        story: statistics.fmean(by_hand(stories, "peak_drift_ratio", {"scale": "1", "story": story}))
        for story in ("1", "2")
    }
    worst = max(means, key=lambda story: means[story])
    largest = max(float(row["peak_drift_ratio"]) for row in stories if row["scale"] == "1")
    ahead = f"Mean drift {100.0 * means[worst]:.3g} % (story {worst}), limit "
    above, below = 1.001 * means[worst], 0.999 * means[worst]
    within = tdint(*run, "--limit", f"{above:.8g}", "--require")
    assert within.exit_code == 0 and ahead in within.stderr
    assert within.stderr.endswith(f"%: within; largest {100.0 * largest:.3g} %.\n")
    said = tdint(*run, "--limit", f"{below:.8g}")
    assert said.exit_code == 0 and "%: beyond; largest" in said.stderr
    required = tdint(*run, "--limit", f"{below:.8g}", "--require", "-o", "kept")
    assert required.exit_code == 5 and "is not met: stiff" in required.stderr
    assert Path("kept/profiles.csv").exists()
    campaign = tdint("campaign", "study.yaml", "-o", "out", "--limit", f"{below:.8g}", "--require")
    assert campaign.exit_code == 5 and "stiff, scale 1: mean drift" in campaign.stderr


def test_a_gate_does_not_pass_before_all_runs_are_done(
    study: Path, tdint: Command, make_record: Callable[..., None]
) -> None:
    """The limit is so wide that the whole study is within: parts of it end with 5 all the same, and without the gate
    with 0 and a warning that cannot be silenced."""
    make_record(study / "third.mseed", "HNE", peak=2.0, samples=12000)  # more than one chunk
    gate = ("--limit", "90%", "--require")
    parts = (("campaign", "study.yaml", "-o", "first", "--max-runs", "1"), ("campaign", "export", "first"))
    for words in (*parts, ("campaign", "study.yaml", "-o", "half", "--shard", "1/2")):
        required = tdint("-q", *words, *gate)
        done, every = len(rows(f"{words[2] if words[1] == 'export' else words[3]}/runs.csv")), 16
        told = f"the drift limit of 90 % is not judged: {done} of {every} runs are done\n"
        assert (required.exit_code, required.stderr) == (5, f"Error: {told}"), words
        assert 0 < done < every
    open_gate = tdint("-q", "campaign", "export", "first", *gate[:2])
    assert open_gate.exit_code == 0 and "is not judged" in open_gate.stderr
    lacking = tdint("campaign", "merge", "half", "-o", "all", *gate, "--partial")
    assert lacking.exit_code == 5 and "is not judged" in lacking.stderr
    whole = tdint("campaign", "study.yaml", "-o", "first", *gate)
    assert whole.exit_code == 0 and "within" in whole.stderr
    Path("broken.mseed").write_bytes(b"no record at all")
    text = Path("study.yaml").read_text()
    Path("study.yaml").write_text(text.replace("motion.mseed,", "motion.mseed, broken.mseed,"))
    assert tdint("campaign", "study.yaml", "-o", "lost", *gate).exit_code == 4
    again = tdint("campaign", "export", "lost", *gate)
    assert again.exit_code == 5 and "is not met: 1 record could not be used" in again.stderr
    counted = tdint("campaign", "study.yaml", "-o", "first", "--limit", "3")
    assert counted.exit_code == 2 and "the number of runs is --max-runs 3" in counted.stderr


def test_collapsed_runs_are_counted_and_in_no_mean(study: Path, tdint: Command) -> None:
    """One motion of three is made to collapse the building: the mean is that of the others, and beyond any limit."""
    Path("factors.csv").write_text(
        "record,component,factor\nmotion.mseed,,40\nother.mseed,,0.5\nthird.mseed,,0.6\n"
    )  # fmt: skip
    Path("weak.yaml").write_text(STIFF.replace("name: stiff", "name: weak\ncollapse_drift: 0.02"))
    run = ("run", "weak.yaml", *MOTIONS, "--units", "m/s^2", "--factors", "factors.csv")
    result = tdint(*run, "-o", "out", "--limit", "50%", "--require", code=5)
    assert "of 3 motions 1 collapsed; the means are those of the 2 others" in result.stderr
    assert "beyond, for 1 of 3 motions collapsed or failed" in result.stderr
    found = [row for row in rows("out/profiles.csv") if row["quantity"] == "peak_drift" and row["story"] == "1"]
    (row,) = found
    assert (row["scale"], row["runs"], row["collapsed"], row["failed"]) == ("", "3", "1", "0")
    peaks = []
    for record, factor in (("other.mseed", "0.5"), ("third.mseed", "0.6")):
        one = tdint("run", "weak.yaml", record, "--units", "m/s^2", "--scale", factor)
        peaks.append(float(rows(one.stdout)[0]["peak_drift_m"]))
    assert float(row["mean"]) == pytest.approx(statistics.fmean(peaks), rel=1e-11)


def test_levels_of_a_measure_stand_in_their_column(study: Path, tdint: Command) -> None:
    levels = "intensity: {measure: pga, levels: [0.1 g, 0.2 g]}"
    Path("study.yaml").write_text(STUDY.replace("intensity: {scales: [0.5, 1]}", levels))
    tdint("campaign", "study.yaml", "-o", "out")
    found = rows("out/profiles.csv")
    assert {(row["scale"], row["level"]) for row in found} == {("", "0.980665"), ("", "1.96133")}
    verdicts = tdint("campaign", "export", "out", "--limit", "2%").stderr
    assert "pga 0.9807 m/s^2: mean drift" in verdicts and "pga 1.961 m/s^2: mean drift" in verdicts
    stories = rows("out/stories.csv")
    row = next(row for row in found if row["building"] == "stiff" and row["quantity"] == "peak_displacement")
    low = {
        key: min(float(one["scale"]) for one in stories if (one["record"], one["component"]) == key)
        for key in {(one["record"], one["component"]) for one in stories}
    }
    first = [one for one in stories if math.isclose(float(one["scale"]), low[one["record"], one["component"]])]
    values = by_hand(first, "peak_displacement_m", {"building": "stiff", "story": "1"})
    assert float(row["mean"]) == pytest.approx(statistics.fmean(values), rel=1e-11)


def test_output_units_change_numbers_and_the_unit_beside_them(study: Path, tdint: Command) -> None:
    run = ("run", "stiff.yaml", *MOTIONS, "--units", "m/s^2", "--method", "newmark-average")
    tdint(*run, "-o", "si")
    tdint(*run, "-o", "mm", "--output-units", "kN,mm")
    for si, mm in zip(rows("si/profiles.csv"), rows("mm/profiles.csv"), strict=True):
        factor = {"m": 1e3, "N": 1e-3, "1": 1.0, "m/s": 1e3, "m/s^2": 1e3}[si["unit"]]
        assert mm["unit"] == {"m": "mm", "N": "kN", "1": "1", "m/s": "mm/s", "m/s^2": "mm/s^2"}[si["unit"]]
        if si["mean"]:
            assert float(mm["mean"]) == pytest.approx(factor * float(si["mean"]), rel=1e-10)


@pytest.mark.usefixtures("laid_out")
def test_a_mean_is_told_when_all_runs_are_done(
    study: Path, tdint: Command, make_record: Callable[..., None]
) -> None:  # fmt: skip
    make_record(study / "motion.mseed", "HNE", "HNN", samples=6000)  # so long that there are several chunks
    tdint("campaign", "study.yaml", "-o", "part", "--shard", "1/2")
    tdint("campaign", "study.yaml", "-o", "rest", "--shard", "2/2")
    assert not Path("part/profiles.csv").exists()
    assert tdint("campaign", "merge", "part", "rest", "-o", "all", "--plot").exit_code == 0
    tdint("campaign", "study.yaml", "-o", "once")
    assert Path("all/profiles.csv").read_bytes() == Path("once/profiles.csv").read_bytes()
    assert Path("all/profiles.png").stat().st_size > 10_000


def test_an_inventory_or_a_wish_goes_without(study: Path, tdint: Command) -> None:
    Path("study.yaml").write_text(STUDY.replace("stories: true", "profiles: false"))
    tdint("campaign", "study.yaml", "-o", "out")
    assert not Path("out/profiles.csv").exists()
    result = tdint("campaign", "study.yaml", "-o", "out", "--plot")
    assert result.exit_code == 5 and "outputs: {profiles: true}" in result.stderr


def test_one_record_has_no_mean(study: Path, tdint: Command) -> None:
    result = tdint("run", "shaken.yaml", "--limit", "2%")
    assert result.exit_code == 2 and "the mean over several records" in result.stderr
    result = tdint("run", "shaken.yaml", "motion.mseed", "other.mseed", "--require")
    assert result.exit_code == 2 and "--limit" in result.stderr


def test_ratios_are_those_of_the_profiles(study: Path, tdint: Command) -> None:
    result = tdint("campaign", "study.yaml", "-o", "out", "--baseline", "shaken", "--plot", code=0)
    profiles = {
        (row["building"], row["scale"], row["quantity"], row["story"]): row for row in rows("out/profiles.csv")
    }  # fmt: skip
    found = rows("out/ratios.csv")
    assert {row["building"] for row in found} == {"stiff"} and {row["baseline"] for row in found} == {"shaken"}
    told = rows(result.stdout)
    assert told == [row for row in found if not row["story"]]
    for row in found:
        for name in ("mean", "median", "max"):
            values = [
                max(
                    float(one[name] or 0.0)
                    for key, one in profiles.items()
                    if key[:3] == (building, row["scale"], row["quantity"]) and row["story"] in ("", key[3])
                )
                for building in ("stiff", "shaken")
            ]
            if not all(values):
                assert row[f"{name}_ratio"] == ""
            else:
                assert float(row[f"{name}_ratio"]) == pytest.approx(values[0] / values[1], rel=1e-10)


def test_a_baseline_that_is_no_building(study: Path, tdint: Command) -> None:
    result = tdint("campaign", "study.yaml", "-o", "out", "--baseline", "shakn")
    assert result.exit_code == 2 and "shaken" in result.stderr


def test_without_a_motion_there_is_no_number() -> None:
    """Where all runs of a building collapse; one motion is each of its statistics."""
    for values in vars(Statistics.of(np.empty((0, 3)))).values():
        assert values.shape == (3,)
        assert np.isnan(values).all()
    for values in vars(Statistics.of(np.array([[1.0, 2.0, 3.0]]))).values():
        assert values.tolist() == [1.0, 2.0, 3.0]
