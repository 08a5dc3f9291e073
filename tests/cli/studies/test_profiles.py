"""profiles.csv, its figure and the drift limit, compared with values computed from stories.csv by
hand."""

import json
import math
import re
import statistics
from collections.abc import Callable
from pathlib import Path

import pytest

from cli.conftest import Command
from csv_rows import rows
from facts import states

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
UNITS = {"m": "_m", "1": "", "N": "_N", "m/s": "_m_s", "m/s^2": "_m_s2"}
MOTIONS = {"motion.mseed": "pair", "other.mseed": "single", "third.mseed": "single"}


@pytest.fixture
def study(folder: Path, make_record: Callable[..., None]) -> Path:
    """Change to a directory with study.yaml: two buildings, a pair and two single components, two
    scales."""
    make_record(folder / "third.mseed", "HNE", peak=2.0)
    (folder / "study.yaml").write_text(STUDY)
    (folder / "stiff.yaml").write_text(STIFF)
    return folder


def limit_results(page: str) -> list[str]:
    """Return the column `result` of the table of limits of a report."""
    body = Path(page).read_text().partition("<body>")[2]
    lines = re.findall(r"<tr>(.*?)</tr>", body, re.DOTALL)
    cells = [re.findall(r"<t[hd][^>]*>(.*?)</t[hd]>", line, re.DOTALL) for line in lines]
    (start,) = (i for i, line in enumerate(cells) if "demand/limit" in line)
    column = cells[start].index("result")
    return [line[column] for line in cells[start + 1 :] if len(line) == len(cells[start])]


def by_hand(stories: list[dict[str, str]], column: str, which: dict[str, str]) -> list[float]:
    """Return the values of a column for each motion: for a pair, the larger value of its two
    components."""
    largest: dict[str, float] = {}
    for row in stories:
        if all(row[name] == value for name, value in which.items()):
            largest[row["record"]] = max(largest.get(row["record"], 0.0), abs(float(row[column])))
    return list(largest.values())


def by_rank(values: list[float], fraction: float) -> float:
    """Return a fractile at the position (n - 1) p, interpolated in logarithms (type 7)."""
    ranked, position = sorted(values), fraction * (len(values) - 1)
    low, high = ranked[math.floor(position)], ranked[math.ceil(position)]
    weight = position - math.floor(position)
    return low * (high / low) ** weight if low > 0.0 else low + weight * (high - low)


QUANTITIES = ("mean", "median", "p16", "p84", "max")
STATISTICS = (
    statistics.fmean,
    lambda values: by_rank(values, 0.5),
    lambda values: by_rank(values, 0.16),
    lambda values: by_rank(values, 0.84),
    max,
)


def test_profiles_equal_statistics_of_the_stories(study: Path, tdint: Command) -> None:
    tdint("campaign", "study.yaml", "-o", "out", code=0)
    stories, profiles = rows("out/stories.csv"), rows("out/profiles.csv")
    columns = {
        row["quantity"]: next(
            name for name in stories[0] if name == row["quantity"] + UNITS[row["unit"]]
        )
        for row in profiles
    }
    assert set(columns.values()) == set(stories[0]) - {
        "building", "record", "component", "scale", "story", "height_m",
    }  # fmt: skip
    for row in profiles:
        if row["quantity"] == "ductility" and not row["mean"]:
            continue  # This story does not yield.
        which = {name: row[name] for name in ("building", "scale", "story")}
        values = by_hand(stories, columns[row["quantity"]], which)
        cells = [float(row[name]) for name in QUANTITIES]
        assert cells == pytest.approx(
            [statistic(values) for statistic in STATISTICS], rel=1e-11, abs=1e-300
        ), row
        assert (row["runs"], row["collapsed"], row["failed"]) == ("3", "0", "0")


def test_errors_of_the_runs_are_propagated_to_the_statistics(study: Path, tdint: Command) -> None:
    """The error of a statistic is the maximum change if all values change within their errors."""
    Path("study.yaml").write_text(
        STUDY.replace("{method: newmark-average}", "{method: moment4, check: true}")
    )
    tdint("campaign", "study.yaml", "-o", "out", code=0)
    stories, profiles = rows("out/stories.csv"), rows("out/profiles.csv")
    error_columns = [*(f"{name}_error" for name in QUANTITIES), "pair_demand"]
    assert list(profiles[0])[-len(error_columns) :] == error_columns
    for row in stories:
        for name in ("peak_drift_m", "peak_absolute_acceleration_m_s2"):
            value, error = float(row[name]), float(row[f"{name}_error"])
            row[f"{name}_up"], row[f"{name}_down"] = str(value + error), str(value - error)
    nonzero_errors = 0
    for row in profiles:
        if row["quantity"] not in ("peak_drift", "peak_absolute_acceleration"):
            continue
        which = {name: row[name] for name in ("building", "scale", "story")}
        column = row["quantity"] + UNITS[row["unit"]]
        up, middle, down = (
            by_hand(stories, f"{column}{end}", which) for end in ("_up", "", "_down")
        )
        for name, statistic in zip(QUANTITIES, STATISTICS, strict=True):
            change = max(statistic(up) - statistic(middle), statistic(middle) - statistic(down))
            assert float(row[f"{name}_error"]) == pytest.approx(
                change, rel=1e-6, abs=1e-11 * statistic(middle)
            )
            nonzero_errors += change > 1e-9 * statistic(middle)
    assert nonzero_errors > 40
    summary = json.loads(Path("out/summary.json").read_text())
    assert list(summary["profiles"]["columns"])[-1] == "max_error"


def test_the_limit_applies_to_the_mean_in_the_governing_story(study: Path, tdint: Command) -> None:
    """The limit applies to the maximum over stories of the mean drift, which differs from the mean
    of the maximum drifts."""
    run = (
        "run", "stiff.yaml", *MOTIONS, "--units", "m/s^2", "--method",
        "newmark-average", "--limit",
    )  # fmt: skip
    campaign = ("campaign", "study.yaml", "-o", "out")
    tdint(*campaign, code=0)
    stories = [
        row for row in rows("out/stories.csv") if (row["building"], row["scale"]) == ("stiff", "1")
    ]
    means = {
        story: statistics.fmean(by_hand(stories, "peak_drift_ratio", {"story": story}))
        for story in ("1", "2")
    }
    worst = max(means, key=lambda story: means[story])
    top = max(stories, key=lambda row: float(row["peak_drift_ratio"]))
    largest = float(top["peak_drift_ratio"])
    above, below = f"{1.001 * means[worst]:.8g}", f"{0.999 * means[worst]:.8g}"
    within = tdint(*run, above, "--require", code=0).stderr
    assert f"Mean drift {100.0 * means[worst]:.4g} % (story {worst}, 3 motions), limit " in within
    assert within.endswith(
        f"%: met; largest {100.0 * largest:.3g} % (story {top['story']}, {top['record']}). "
        "Demand of pairs: larger.\n"
    )
    assert "%: exceeded; largest" in tdint(*run, below, code=0).stderr
    assert "is not met: stiff" in tdint(*run, below, "--require", "-o", "kept", code=5).stderr
    assert Path("kept/profiles.csv").exists()
    assert (
        "stiff, scale 1: mean drift"
        in tdint(*campaign, "--limit", below, "--require", code=5).stderr
    )


@pytest.mark.long
def test_a_requirement_is_not_met_before_all_runs_are_completed(
    study: Path, tdint: Command, make_record: Callable[..., None]
) -> None:
    """The complete study meets the large limit. Parts of the study nevertheless cause exit code 5
    with --require; without --require, exit code 0 and a warning that --quiet does not suppress."""
    make_record(study / "third.mseed", "HNE", peak=2.0, samples=12000)  # several chunks
    requirement = ("--limit", "90%", "--require")
    parts = {
        "first": (
            ("campaign", "study.yaml", "-o", "first", "--max-runs", "1"),
            ("campaign", "export", "first"),
        ),
        "half": (("campaign", "study.yaml", "-o", "half", "--shard", "1/2"),),
    }
    for folder, call in ((folder, call) for folder, calls in parts.items() for call in calls):
        required = tdint("-q", *call, *requirement, code=5)
        done = len(rows(f"{folder}/runs.csv"))
        assert 0 < done < 16
        last = required.stderr.splitlines(keepends=True)[-1]
        assert states(last, f"Error: ... 90 % is not checked: {done} of 16 runs"), call
    assert (
        "is not checked"
        in tdint("-q", "campaign", "export", "first", *requirement[:2], code=0).stderr
    )
    assert (
        "is not checked"
        in tdint("campaign", "merge", "half", "-o", "all", *requirement, "--partial", code=5).stderr
    )
    assert "met" in tdint("campaign", "study.yaml", "-o", "first", *requirement, code=0).stderr
    Path("broken.mseed").write_bytes(b"no record at all")
    Path("study.yaml").write_text(STUDY.replace("motion.mseed,", "motion.mseed, broken.mseed,"))
    tdint("campaign", "study.yaml", "-o", "lost", *requirement, code=4)
    again = tdint("campaign", "export", "lost", *requirement, code=5)
    assert states(again.stderr, "not met: 1 record")


def test_collapsed_runs_are_counted_and_excluded_from_means(study: Path, tdint: Command) -> None:
    """One of three ground motions causes collapse. The mean includes only the other two motions,
    and no limit is met."""
    factors = {"motion.mseed": "40", "other.mseed": "0.5", "third.mseed": "0.6"}
    lines = [
        "record,component,factor",
        *(f"{record},,{factor}" for record, factor in factors.items()),
    ]
    Path("factors.csv").write_text("\n".join(lines) + "\n")
    Path("weak.yaml").write_text(STIFF.replace("name: stiff", "name: weak\ncollapse_drift: 0.02"))
    run = ("run", "weak.yaml", *MOTIONS, "--units", "m/s^2", "--factors", "factors.csv")
    result = tdint(*run, "-o", "out", "--limit", "50%", "--require", "--report", "out.html", code=5)
    lost = "of 3 ground motions, 1 collapsed under a component, 2 of 4 components completed"
    assert f"{lost}; " in result.stderr
    assert f"exceeded ({lost})" in result.stderr
    # The table states why a demand below its limit does not meet it. A limit that the mean exceeds
    # needs no reason.
    assert limit_results("out.html") == ["exceeded: 1 collapsed"]
    tdint(*run, "--limit", "0.0001%", "--report", "low.html", code=0)
    assert limit_results("low.html") == ["exceeded"]
    (row,) = (
        row
        for row in rows("out/profiles.csv")
        if (row["quantity"], row["story"]) == ("peak_drift", "1")
    )
    assert (row["scale"], row["runs"], row["collapsed"], row["failed"]) == ("", "3", "1", "0")
    peaks, ratios = [], []
    for record in ("other.mseed", "third.mseed"):
        single_run = tdint("run weak.yaml", record, "--units", "m/s^2", "--scale", factors[record])
        peaks.append(float(rows(single_run.stdout)[0]["peak_drift_m"]))
        ratios.append(float(rows(single_run.stdout)[0]["peak_drift_ratio"]))
    assert float(row["mean"]) == pytest.approx(statistics.fmean(peaks), rel=1e-11)
    # Risk category II accepts the collapse; the demand is then 1.2 times the median of all motions,
    # which is the larger of the other two.
    export = ("campaign", "export", "out", "--limit", "50%", "--require", "--risk-category")
    accepted = tdint(*export, "II", code=0).stderr
    assert f"1.2 times the median drift {120.0 * max(ratios):.3g} %" in accepted
    assert f"met ({lost}: this demand is the larger of 1.2 times the median" in accepted
    refused = tdint(*export, "III", code=5).stderr
    assert "accepts one in the risk categories I and II" in refused


def test_at_most_ten_of_many_buildings_are_listed(study: Path, tdint: Command) -> None:
    """A building that is listed twice is reported. The table states the number of excluded motions
    of each mean."""
    names = [f"weak-{index}.yaml" for index in range(7)]
    for name in names:
        Path(name).write_text(
            STIFF.replace("name: stiff", f"name: {name[:-5]}") + "collapse_drift: 1e-6\n"
        )
    listed = ", ".join([*names, names[0]])
    Path("study.yaml").write_text(
        STUDY.replace("shaken.yaml, stiff.yaml", listed).replace("stories: true", "profiles: true")
    )
    result = tdint("campaign", "study.yaml", "-o", "out", code=0)
    assert states(result.stderr, "note: ... more than once, ... weak-0.yaml")
    messages = [line for line in result.stderr.splitlines() if "no mean can be computed" in line]
    collapsed = {
        (row["building"], row["scale"]) for row in rows("out/profiles.csv") if int(row["collapsed"])
    }
    # 7 names at two levels; one is run twice.
    assert (
        len(messages) == 1
        and "and 8 more: of 3 ground motions, 3 collapsed" in messages[0]
        and len(collapsed) == 14
    )
    assert states(result.stderr, "6 more buildings ... collapsed and failed of profiles.csv")


def test_levels_of_a_measure_have_their_own_column(study: Path, tdint: Command) -> None:
    levels = "intensity: {measure: pga, levels: [0.1 g, 0.2 g]}"
    Path("study.yaml").write_text(STUDY.replace("intensity: {scales: [0.5, 1]}", levels))
    verdicts = tdint("campaign", "study.yaml", "-o", "out", "--limit", "2%", code=0).stderr
    assert "pga 0.9807 m/s^2: mean drift" in verdicts and "pga 1.961 m/s^2: mean drift" in verdicts
    profiles, stories = rows("out/profiles.csv"), rows("out/stories.csv")
    assert {(row["scale"], row["level"]) for row in profiles} == {("", "0.980665"), ("", "1.96133")}
    row = next(
        row
        for row in profiles
        if row["building"] == "stiff" and row["quantity"] == "peak_displacement"
    )
    low = {(row["record"], row["component"]): math.inf for row in stories}
    for motion in low:
        low[motion] = min(
            float(row["scale"]) for row in stories if (row["record"], row["component"]) == motion
        )
    first = [
        row
        for row in stories
        if math.isclose(float(row["scale"]), low[row["record"], row["component"]])
    ]
    values = by_hand(first, "peak_displacement_m", {"building": "stiff", "story": "1"})
    assert float(row["mean"]) == pytest.approx(statistics.fmean(values), rel=1e-11)


def test_profiles_can_be_disabled(study: Path, tdint: Command) -> None:
    Path("study.yaml").write_text(STUDY.replace("stories: true", "profiles: false"))
    campaign = ("campaign", "study.yaml", "-o", "out")
    tdint(*campaign, code=0)
    assert not Path("out/profiles.csv").exists()
    assert "outputs: {profiles: true}" in tdint(*campaign, "--plot", code=5).stderr
    # In a new directory, the error is reported before the runs.
    new = tdint("campaign", "study.yaml", "-o", "new", "--plot", code=5)
    assert "outputs: {profiles: true}" in new.stderr and not Path("new").exists()


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (("run", "shaken.yaml", "motion.mseed", "other.mseed", "--require"), "--limit"),
        (("campaign", "study.yaml", "-o", "out", "--baseline", "shakn"), "shaken"),
        (
            ("campaign", "study.yaml", "-o", "out", "--limit", "3"),
            "For the number of runs, specify --max-runs 3",
        ),
    ],
)
def test_invalid_arguments_are_refused(
    study: Path, tdint: Command, call: tuple[str, ...], message: str
) -> None:
    assert message in tdint(*call, code=2).stderr


def test_ratios_equal_quotients_of_the_profiles(study: Path, tdint: Command) -> None:
    result = tdint("campaign", "study.yaml", "-o", "out", "--baseline", "shaken", "--plot", code=0)
    profiles, ratios = rows("out/profiles.csv"), rows("out/ratios.csv")
    assert {(row["building"], row["baseline"]) for row in ratios} == {("stiff", "shaken")}
    assert rows(result.stdout) == [row for row in ratios if not row["story"]]

    def largest(building: str, ratio: dict[str, str], name: str) -> float:
        keys = ("scale", "quantity", "story") if ratio["story"] else ("scale", "quantity")
        if ratio["quantity"] == "base_shear":
            ratio = ratio | {"quantity": "peak_shear", "story": "1"}
            keys = ("scale", "quantity", "story")
        building_rows = (row for row in profiles if row["building"] == building)
        return max(
            float(row[name] or 0.0)
            for row in building_rows
            if all(row[key] == ratio[key] for key in keys)
        )

    for row in ratios:
        for name in ("mean", "median", "max"):
            value, baseline = largest("stiff", row, name), largest("shaken", row, name)
            if value and baseline:
                assert float(row[f"{name}_ratio"]) == pytest.approx(value / baseline, rel=1e-10)
            else:
                assert row[f"{name}_ratio"] == ""
