"""`tdint scale`: factors of single records, pairs and sets, and `tdint run` with these factors."""

import json
import math
import re
from pathlib import Path

import numpy as np
import pytest

from csv_rows import rows
from facts import states
from ground_motion.files import trace, write
from tdint.ground_motion.measures import MEASURES
from tdint.studies.motions.intensity import AVERAGE

CONFIGS = Path(__file__).parents[3] / "configs"


UNITS = ("--units", "m/s^2")
PGA = ("--pga", "0.6g")
TARGET = ("--target", CONFIGS / "design-spectrum.csv")
EC8 = ("--target", "ec8:type=1,soil=B,ag=0.1g")


def test_factors_to_a_value_of_a_measure(folder, tdint):
    call = ("scale", "motion.mseed", "other.mseed", *UNITS, *PGA)
    assert tdint(*call, "-o", "f/factors.csv", "--plot", code=0).stdout == ""
    infos, found = (
        rows(tdint("info", "motion.mseed", "other.mseed", *UNITS).stdout),
        rows(folder / "f" / "factors.csv"),
    )
    peaks = {(row["record"], row["component"]): float(row["pga_m_s2"]) for row in infos}
    scaled = [float(row["factor"]) * peaks[row["record"], row["component"]] for row in found]
    # The components of motion.mseed have one factor, to the geometric mean of both.
    assert found[0]["factor"] == found[1]["factor"]
    assert [math.sqrt(scaled[0] * scaled[1]), scaled[2]] == pytest.approx([0.6 * 9.80665] * 2)
    summary = json.loads((folder / "f" / "factors.json").read_text())
    assert summary["settings"]["measure"] == "pga"
    us = tdint(*call, "-o", "us.csv", "--output-units", "in,g", code=0)
    assert "3 components, 2 recordings, 1 pair scaled to pga = 0.6 g:" in us.stderr
    us_records = json.loads((folder / "us.json").read_text())["records"]
    peaks = [
        (record["pga_g"], si["pga_m_s2"])
        for record, si in zip(us_records, summary["records"], strict=True)
    ]
    assert len(peaks) == 3 and all(g == pytest.approx(si / 9.80665, rel=1e-11) for g, si in peaks)
    assert (folder / "f" / "factors.png").exists()


@pytest.mark.parametrize(
    ("option", "value", "column", "power"),
    [
        ("--pga", "2m/s^2", "pga_m_s2", 1),
        ("--pgv", "20cm/s", "pgv_m_s", 1),
        ("--arias", "0.2m/s", "arias_intensity_m_s", 2),
        ("--cav", "3m/s", "cav_m_s", 1),
    ],
)
def test_each_measure_reaches_its_value(folder, tdint, option, value, column, power):
    """The Arias intensity increases with the square of the factor."""
    target = {"2m/s^2": 2.0, "20cm/s": 0.2, "0.2m/s": 0.2, "3m/s": 3.0}[value]
    call = ("motion.mseed", "--component", "HNE", *UNITS)
    (row,) = rows(tdint("scale", *call, option, value, code=0).stdout)
    (info,) = rows(tdint("info", *call, code=0).stdout)
    scaled = float(row["factor"]) ** power * float(info[column])
    assert scaled == pytest.approx(target, rel=1e-9)


def test_spectral_accelerations_reach_their_values(folder, tdint):
    """Sa_avg is the geometric mean over 50 periods from 0.2 to 3 times --at."""
    call = ("motion.mseed", "--component", "HNE", *UNITS)
    factors = [
        float(rows(tdint("scale", *call, "--to", value, "--at", "0.5", code=0).stdout)[0]["factor"])
        for value in ("sa=2m/s^2", "sa-avg=2m/s^2")
    ]
    assert factors[0] * spectral_acceleration(tdint, call, ["0.5"]) == pytest.approx(2.0, rel=1e-6)
    periods = [f"{0.5 * multiple:.12g}" for multiple in AVERAGE.values()]
    assert factors[1] * spectral_acceleration(tdint, call, periods) == pytest.approx(2.0, rel=1e-6)


def spectral_acceleration(tdint, call, periods):
    """Return the geometric mean of Sa over periods, m/s^2."""
    found = rows(tdint("spectrum", *call, "--period", ",".join(periods), code=0).stdout)
    return np.exp(np.mean(np.log([float(row["psa_m_s2"]) for row in found])))


def test_records_with_different_units_in_one_call(folder, tdint, make_record):
    """Units by the end of the path, by a table and in a campaign give the same results as units for
    each file in a separate call."""
    make_record(folder / "counts.mseed", "HNE", integer=True)
    (folder / "lab.txt").write_text("# dt = 0.02 s\n0\n0.11\n-0.07\n0.02\n0\n")
    units_by_file = {"motion.mseed": "m/s^2", "counts.mseed": "1e-5 m/s^2", "lab.txt": "g"}
    lines = ["record,units", *(",".join(item) for item in units_by_file.items())]
    (folder / "units.csv").write_text("\n".join(lines) + "\n")
    expected = [
        row
        for file, units in units_by_file.items()
        for row in rows(tdint("scale", file, "--units", units, *PGA).stdout)
    ]
    for units in ("TEXT=g,counts.mseed=1e-5 m/s^2,*.mseed=m/s^2", "units.csv"):
        assert (
            rows(tdint("scale", *units_by_file, "--units", units, *PGA, code=0).stdout) == expected
        )
        records = f"records: {{files: [{', '.join(units_by_file)}], units: '{units}'}}"
        (folder / "study.yaml").write_text(f"buildings: {{models: [shaken.yaml]}}\n{records}\n")
        tdint("campaign", "study.yaml", "-o", units[:5], code=0)
        runs = zip(rows(folder / units[:5] / "runs.csv"), expected, strict=True)
        first, second, *peaks = [float(run["pga_m_s2"]) * float(row["factor"]) for run, row in runs]
        assert [math.sqrt(first * second), *peaks] == pytest.approx([0.6 * 9.80665] * 3)


def test_pairs_are_found_by_file_names(folder, tdint, make_record):
    """For unknown file names, one message states the option that is required; with this option, two
    motions are two pairs."""
    (folder / "named").mkdir()
    for peak, name in enumerate(("kobe", "taft"), start=1):
        for channel, ending, peak_difference in (
            ("HNE", "tran", 0.0),
            ("HNN", "long", 0.5),
            ("HNZ", "vert", 0.0),
        ):
            make_record(
                folder / "named" / f"{name}_{ending}.mseed", channel, peak=peak + peak_difference
            )
    names = "{}_long.mseed,{}_tran.mseed"
    scale = ("scale", "named", *UNITS, "--to", "pga=0.1g", "--pairs")
    messages = [
        line
        for line in tdint(*scale, "geometric-mean", code=4).stderr.splitlines()
        if "single" in line
    ]
    assert len(messages) == 1 and "4 files contain a single horizontal component" in messages[0]
    assert "--pairs '{}long.mseed,{}tran.mseed'" in messages[0]
    for pairs in (names, f"rotd50,{names}"):
        stderr = tdint(*scale, pairs, code=0).stderr
        assert "2 pairs scaled to pga" in stderr and "kobe_vert.mseed" in stderr
    assert "2 pairs" in tdint("scale", "named", *UNITS, "--p695", "--pairs", names).stderr
    spectra = ("spectrum", "named", *UNITS, "--pairs", names)
    assert len(rows(tdint(*spectra, "--rotd", "50", "--period", "1", code=0).stdout)) == 2
    for bad in ("rotd50,rotd100", "rotd5", "{}_long.mseed", "{}_a,{}_b"):
        tdint(*scale, bad, code=2)


def test_a_failing_record_stops_a_set_but_not_single_records(folder, tdint):
    call = ("scale", "motion.mseed", "none.mseed", *UNITS)
    result = tdint(*call, "--to", "pgv=10cm/s", code=4)
    assert len(rows(result.stdout)) == 2 and "none.mseed" in result.stderr
    tdint.refused("none.mseed", *call, "--p695", code=4)
    tdint.refused(
        "only one horizontal component", "scale motion.mseed other.mseed", *UNITS, "--p695", code=4
    )


@pytest.mark.long
def test_the_rule_of_asce7(folder, tdint, make_record):
    (folder / "suite").mkdir()
    for i in range(11):
        make_record(
            folder / "suite" / f"{i:02d}.mseed",
            "HNE",
            "HNN",
            peak=1.0 + 0.2 * i,
            samples=100 + 10 * i,
        )
    options = ("--rule", "asce7", "--range", "0.2:2:4", "-o", "f.csv", "--plot")
    result = tdint("scale", "suite", *UNITS, *TARGET, *options, code=0)
    factors = [row["factor"] for row in rows(folder / "f.csv")]
    assert len(factors) == 22 and factors[::2] == factors[1::2]
    assert "11 pairs scaled to" in result.stderr
    least_average = float(
        result.stderr.partition("maximum-direction spectra to the target is ")[2].partition(" %")[0]
    )
    assert least_average >= 90.0
    settings = json.loads((folder / "f.json").read_text())["settings"]
    assert 100.0 * settings["least_average_over_target"] == pytest.approx(least_average, abs=0.5)
    assert settings["pairs"] == "rotd100"


EC8 = ("--target", "ec8:type=1,soil=B,ag=0.25g")


def test_the_rule_of_ec8_over_the_periods_of_a_building(folder, tdint, make_record):
    """The mean of the scaled spectra is compared with the output of `tdint spectrum`, and the mean
    PGA with ag S."""
    building = CONFIGS / "ten-story.yaml"
    period = float(rows(tdint("modes", building).stdout)[0]["period_s"])
    make_record(folder / "third.mseed", "HNE", frequency=7.0)
    files = ("motion.mseed", "other.mseed", "third.mseed", "--component", "HNE")
    tdint.refused(  # a pair is one ground motion
        "ec8 requires at least 3 ground motions (EN 1998-1:2004, 3.2.3.1.2(4)), got 2",
        *("scale", *files[:2], *UNITS, *EC8, "--rule", "ec8", "--building", building),
    )
    outputs = ("-o", "f.csv", "--plot", "--spectra", "s.csv")
    tdint("scale", *files, *UNITS, *EC8, "--rule", "ec8", "--building", building, *outputs, code=0)
    settings = json.loads((folder / "f.json").read_text())["settings"]
    first, last, count = settings["periods_s"]
    assert (first, last, count) == (pytest.approx(0.2 * period), pytest.approx(2.0 * period), 100)
    grid = ("--periods", f"{first!r}:{last!r}:{count}")
    unscaled, (target,) = (
        np.array(
            [float(row["psa_m_s2"]) for row in rows(tdint("spectrum", *arguments, *grid).stdout)]
        ).reshape(-1, 100)
        for arguments in ((*files, *UNITS), EC8)
    )
    factors = np.array([float(row["factor"]) for row in rows(folder / "f.csv")])
    peaks = [float(row["pga_m_s2"]) for row in rows(tdint("info", *files, *UNITS).stdout)]
    scaled = factors[:, None] * unscaled
    ratios = scaled.mean(axis=0) / target
    zero = (factors * peaks).mean() / (0.25 * 1.2 * 9.80665)
    assert min(ratios) >= 0.9 * (1.0 - 1e-9) and zero >= 1.0 - 1e-9
    # The factor is not larger than necessary.
    assert min(min(ratios) / 0.9, zero) == pytest.approx(1.0)
    assert settings["least_average_over_target"] == pytest.approx(min(ratios))
    written = rows(folder / "s.csv")
    assert [row["curve"] for row in written] == ["scaled"] * 300 + ["mean"] * 100 + ["target"] * 100
    curves = np.array([float(row["psa_m_s2"]) for row in written]).reshape(-1, 100)
    assert curves == pytest.approx(np.vstack([scaled, scaled.mean(axis=0), target]), rel=1e-9)


def test_factors_from_wrong_units_cause_a_warning(folder, tdint):
    messages = tdint(
        "-q scale motion.mseed --units", "1e3 m/s^2", "--to", "pga=0.1g", code=0
    ).stderr
    assert "peak ground acceleration" in messages and "factors outside 0.05 to 20" in messages


def test_large_factors_cause_a_warning_or_are_refused(folder, tdint):
    call = (
        "scale", "motion.mseed", *UNITS, "--target", "ec8:type=1,soil=B,ag=50g",
        "--range", "0.2:2",
    )  # fmt: skip
    messages = tdint(*call, code=0).stderr
    assert states(messages, "Warning: factors outside 0.25 to 4, ... motion.mseed HNN+HNE")
    tdint.refused(
        "larger than --max-factor 5: motion.mseed HNN+HNE",
        *call,
        "--max-factor",
        5,
        "-o",
        "f.csv",
        code=5,
    )


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ((), "no target is specified; specify one of --target"),
        (("--to", "sa=0.5g"), "--to sa requires a period; add --at"),
        (("--to", "sa=0.5", "--at", 1), "'0.5' ... use one of"),
        (("--to", "sa=5cm/s", "--at", 1), "number with a unit of m/s^2, such as sa=0.4g"),
        (("--to", "pgv=0.4g"), "number with a unit of m/s, such as pgv=40cm/s"),
        (("--to", "pga=0.4g", *TARGET), "--target and --to cannot be used together"),
        (("--to", "pga=0.4g", "--at", 1), "--at requires --to sa"),
        (("--p695", "--to", "pga=0.4g"), "--p695 cannot be used with --to pga"),
        (("--p695", "--pairs", "rotd50"), "--pairs rotd50 cannot be used with --p695"),
        ((*TARGET, "--range", "2"), "'2' must be a range FIRST:LAST"),
        ((*TARGET, "--range", "0.2:9"), "0.02 to 5 s, got 0.2 to 9 s"),
        ((*TARGET, "--rule", "asce7"), "add --at, --building or --range"),
        ((*TARGET, "--rule", "ec8"), "--rule ec8 compares spectra from 0.2 T to 2 T"),
        ((*TARGET, "--rule", "ec8", "--at", 0.5), "ec8 requires ... period 0"),
        ((*TARGET, "--building", "x.yaml", "--at", 0.5), "--at requires --to sa"),
        ((*TARGET, "--building", "x.yaml", "--range", "0.2:2"),
         "--building and --range cannot be used together"),
        (("--to", "pga=0.4g", "--building", "x.yaml"), "--building has no effect without --target"),
        (("--target", "ec8:type=1,soil=B,ag=0.25g", "--damping", "2%"),
         "the target applies to 5 % damping"),
        ((*TARGET, "--rule", "asce7", "--at", 0.5),
         "at least 11 pairs of components (ASCE 7-16, 16.2.2), got 1"),
        ((*TARGET, "--rule", "asce7", "--at", 0.5, "--component", "HNE"),
         "--component cannot be used with pairs"),
    ],
)  # fmt: skip
def test_invalid_arguments_are_refused(folder, tdint, arguments, message):
    result = tdint.refused(message, "scale", "motion.mseed", *UNITS, *arguments)
    # A note on the displacements at the end of the motions may precede the error.
    assert result.stderr.splitlines()[-1].startswith("Error: ")


def test_a_run_with_the_factors_of_a_suite(folder, tdint):
    """`tdint run` reads the output of `tdint scale`: each component has its factor, with the same
    results as --scale."""
    suite = ("motion.mseed", "other.mseed", *UNITS)
    target = ("--target", "ec8:type=1,soil=B,ag=0.1g", "--range", "0.2:2")
    tdint("scale", *suite, *target, "-o", "suite.csv", code=0)
    call = ("run", "shaken.yaml", *suite, "--factors", "suite.csv", "-o", "out")
    run = tdint(*call, "--limit", "50%", code=0)
    runs, factors = rows("out/runs.csv"), rows("suite.csv")
    # The verdict and the summary state rule, target and factors.
    low, *_, high = sorted(float(row["factor"]) for row in factors)
    assert states(
        run.stderr, f"scaled to ... EN 1998-1 ... (rule mean, factors {low:.3g} to {high:.3g})."
    )
    assert json.loads(Path("out/summary.json").read_text())["scaling"] == {
        "file": "suite.csv",
        "rule": "mean",
        "target": target[1],
    }
    assert sorted((row["record"], row["component"], row["scale"]) for row in runs) == sorted(
        (row["record"], row["component"], row["factor"]) for row in factors
    )
    assert (runs[1]["component"], factors[0]["component"]) == ("HNN", "HNN")
    single_run = ("motion.mseed", *UNITS, "--component", "HNN", "--scale", factors[0]["factor"])
    stories = rows(tdint("run", "shaken.yaml", *single_run, code=0).stdout)
    largest = max(float(story["peak_drift_ratio"]) for story in stories)
    assert float(runs[1]["peak_drift_ratio"]) == pytest.approx(largest, rel=1e-9)


@pytest.mark.parametrize(
    ("arguments", "code", "message"),
    [
        (("--factors", "lost.csv"), 3, "lost.csv: records not found: gone.mseed, (empty)"),
        (("--factors", "component.csv"), 3,
         "component.csv: other.mseed has no usable component HNZ"),
        (("other.mseed", "--scale", "2", "--factors", "suite.csv"), 2,
         "--factors and --scale cannot be used together"),
        (("other.mseed", "--factors", "none.csv"), 3, "none.csv: file not found"),
        (("motion.mseed", "other.mseed", "--factors", "suite.csv"), 3,
         "no factor for motion.mseed HNE"),
        (("other.mseed", "--factors", "zero.csv"), 3, "zero.csv:3: factor ... got '0'"),
    ],
)  # fmt: skip
def test_invalid_factor_tables_are_refused(folder, tdint, arguments, code, message):
    Path("suite.csv").write_text("record,component,factor\nother.mseed,HNE,2\n")
    Path("lost.csv").write_text("record,component,factor\ngone.mseed,HNE,2\n,HNN,2\n")
    Path("component.csv").write_text("record,component,factor\nother.mseed,HNZ,2\n")
    Path("zero.csv").write_text("record,component,factor\nother.mseed,HNE,1\nother.mseed,HNN,0\n")
    assert states(tdint("run", "shaken.yaml", *UNITS, *arguments, code=code).stderr, message)


@pytest.mark.usefixtures("short_matching")
@pytest.mark.long
def test_records_of_the_table_of_factors(folder, tdint, make_record):
    """Select, match, run, ida and campaign require no record arguments: the table lists both
    components of the selected recordings, and the other motions of the suite are not used."""
    (folder / "pool").mkdir()
    for seed in range(4):
        make_record(
            folder / "pool" / f"m{seed}.mseed",
            "HNE",
            "HNN",
            peak=1.0 + seed,
            samples=300 + 40 * seed,
            frequency=9.0 + 5.0 * seed,
        )
    target = ("--target", "ec8:type=1,soil=B,ag=0.1g", "--range", "0.2:2")
    tdint("scale", "pool", *UNITS, *target, "--select", 3, "-o", "factors.csv", code=0)
    factors = rows("factors.csv")
    listed = [(row["record"], row["component"], row["factor"]) for row in factors]
    # Three recordings, each with one factor for both components
    assert len({(record, factor) for record, _, factor in listed}) == 3
    assert len({(record, component) for record, component, _ in listed}) == len(listed) == 6

    # The runs equal separate runs with the records of the pool and the same factors.
    tdint("run", "shaken.yaml", *UNITS, "--factors", "factors.csv", "-o", "out", code=0)
    runs = rows("out/runs.csv")
    assert sorted((run["record"], run["component"], run["scale"]) for run in runs) == sorted(listed)
    for run in runs:
        options = ("--component", run["component"], "--scale", run["scale"])
        stories = rows(tdint("run", "shaken.yaml", run["record"], *UNITS, *options, code=0).stdout)
        largest = max(float(story["peak_drift_ratio"]) for story in stories)
        assert float(run["peak_drift_ratio"]) == pytest.approx(largest, rel=1e-9)

    # The campaign file is in another directory than the table.
    (folder / "studies").mkdir()
    study = "buildings: {models: [../shaken.yaml]}\nrecords: {units: m/s^2}\n"
    (folder / "studies" / "a.yaml").write_text(study + "intensity: {factors: ../factors.csv}\n")
    tdint("campaign", "studies/a.yaml", "-o", "campaign", code=0)
    campaign_runs = rows("campaign/runs.csv")
    assert [run["peak_drift_ratio"] for run in campaign_runs] == [
        run["peak_drift_ratio"] for run in runs
    ]

    # IDA and match
    call = ("ida", "shaken.yaml", *UNITS, "--factors", "factors.csv", "--max-im", "1m/s^2")
    call += ("--pair-demand", "separate")
    capacities = rows(tdint(*call, code=0).stdout)
    assert {(row["record"], row["component"]) for row in capacities} == {row[:2] for row in listed}
    call = ("match", *UNITS, "--factors", "factors.csv", *target, "-o", "matched")
    tdint(*call, "--suite", "mean", "--format", "csv", code=0)
    matched = rows("matched/matched.csv")
    assert [row["record"] for row in matched] == [row[0] for row in listed]
    assert {(row["record"], row["component"]) for row in matched} == {row[:2] for row in listed}
    for command in (("match", *target, "-o", "m"), ("ida", "shaken.yaml")):
        tdint.refused("RECORD is required; specify either records", *command, code=2)
        conflicting = (*command, "pool", "--factors", "factors.csv")
        tdint.refused("RECORD and --factors cannot be used together", *conflicting, code=2)


def test_pairs_of_the_table_of_factors(folder, tdint, make_record):
    """The table of selected pairs lists both components, and can be used without the records."""
    (folder / "study").mkdir()
    for seed in range(3):
        make_record(
            folder / "study" / f"p{seed}.mseed",
            "HNE",
            "HNN",
            peak=1.0 + seed,
            samples=300 + 40 * seed,
            frequency=9.0 + 5.0 * seed,
        )
    target = ("--target", "ec8:type=1,soil=B,ag=0.1g", "--range", "0.2:2")
    call = ("scale", "study", *UNITS, *target, "--pairs", "rotd50", "--select", 2)
    tdint(*call, "-o", "study/pairs.csv", code=0)
    # Without --pairs, a recording is also selected with both components and one factor.
    joined = rows(tdint("scale", "study", *UNITS, *target, "--select", 2, code=0).stdout)
    assert len(joined) == 4
    assert len({(row["record"], row["factor"]) for row in joined}) == 2
    listed = rows("study/pairs.csv")
    relative = "".join(
        f"{Path(row['record']).name},{row['component']},{row['factor']}\n" for row in listed
    )
    (folder / "study" / "moved.csv").write_text("record,component,factor\n" + relative)
    for table in ("study/pairs.csv", "study/moved.csv"):
        runs = rows(tdint("run", "shaken.yaml", *UNITS, "--factors", table, code=0).stdout)
        assert sorted((run["record"], run["component"], run["scale"]) for run in runs) == sorted(
            (row["record"], row["component"], row["factor"]) for row in listed
        )


def test_a_selection_omits_files_that_cannot_be_used(folder, tdint, make_record):
    """A single component and a corrupt file are listed; the selection is written although the code
    requires more pairs, which a warning states."""
    (folder / "study").mkdir()
    for seed in range(4):
        frequency = 9.0 + 5.0 * seed
        make_record(folder / "study" / f"p{seed}.mseed", "HNE", "HNN", frequency=frequency)
    make_record(folder / "study" / "single.mseed", "HNE")
    (folder / "study" / "broken.csv").write_text("Time (s),E (g)\n0,0.0\n0.02,x\n0.04,0.1\n")
    call = ("scale", "study", *UNITS, "--target", "asce7:sds=1,sd1=0.6,tl=8", "--range", "0.2:2")
    for rule, needed in (("asce7", "at least 11 pairs"), ("ec8", "at least 3 ground motions")):
        target = call if rule == "asce7" else (*call[:4], *EC8, *call[-2:], "--pairs", "rotd50")
        result = tdint(*target, "--rule", rule, "--select", 2, code=4)
        assert len({row["record"] for row in rows(result.stdout)}) == 2
        assert states(
            result.stderr, f"Warning: the rule {rule} requires {needed} ... got 2; select"
        )
        assert "broken.csv" in result.stderr and "single.mseed" in result.stderr


def test_motions_are_selected(folder, tdint, make_record):
    """The best selection from three motions is printed with the omitted motions. The table has the
    format of `scale`. At most one motion of an earthquake is selected."""
    known = "record,event\nmotion.mseed,here\nthird.mseed,there\n"
    (folder / "events.csv").write_text(f"{known}other.mseed,there\n")
    make_record(folder / "motion.mseed", "HNE")
    make_record(folder / "other.mseed", "HNE", frequency=12.0)
    make_record(folder / "third.mseed", "HNE", frequency=20.0)
    call = (
        "scale", "motion.mseed", "other.mseed", "third.mseed", *UNITS, *TARGET,
        "--range", "0.3:2", "--select", 2,
    )  # fmt: skip
    result = tdint(
        *call, "--per-event", 1, "--events", "events.csv", "-o", "chosen.csv", "--plot", code=0
    )
    assert "Selected from 3: the mean of ln Sa" in result.stderr
    table = rows(folder / "chosen.csv")
    assert [row["record"] for row in table] == ["motion.mseed", "other.mseed"]
    settings = json.loads((folder / "chosen.json").read_text())["settings"]
    assert len(settings["selected"]) == 2 and settings["left_out"]["duplicate"] == 0
    assert (folder / "chosen.png").exists()
    (folder / "scatter.csv").write_text("period_s,scatter\n0.1,0.2\n3,0.4\n")
    tdint(*call[:-1], 3, "--target-std", "scatter.csv", "--factor-range", "0.001:1000", code=0)
    tdint.refused("between 0 and 1e+60", *call[:-1], 3, "--target-std", "1e308", code=2)
    tdint.refused("4 motions ... 3 of 3", *call[:-1], 4, code=2)
    without_selection = ("scale", "motion.mseed", *UNITS, *TARGET, "--per-event", 1)
    (folder / "events.csv").write_text(known)
    unknown = "the event of 1 motion is unknown: other.mseed"
    tdint.refused(unknown, *call, "--per-event", 1, "--events", "events.csv", code=2)
    tdint.refused("has no effect without --select", *without_selection, code=2)


@pytest.mark.parametrize("command", ["scale", "ida", "campaign"])
def test_the_help_names_every_measure_of_the_registry(tdint, command):
    """A measure that is added to the registry must be added to the help of each command."""
    text = tdint(command, "--help-all", code=0).stdout
    missing = [
        name
        for name, measure in MEASURES.items()
        if not re.search(rf"\b{name}\b", text)
        and not (measure.without_levels and command != "campaign")
    ]
    assert not missing


@pytest.mark.parametrize(
    ("value", "message"),
    [
        ("pgd=5cm", ""),
        ("pgd=0.4g", "with a unit of m, such as pgd=5cm"),
        ("pga=0g", "positive number"),
        ("d5-95=10", "does not change with a factor"),
        ("pgx=1g", "MEASURE=VALUE with pga, pgv, pgd"),
    ],
)
def test_a_value_of_any_measure_of_the_registry_is_a_target(folder, tdint, value, message):
    result = tdint(
        "scale motion.mseed --units m/s^2 --component HNE --to", value, code=2 if message else 0
    )
    assert message in result.stderr
    if not message:
        assert "scaled to pgd = 0.05 m" in result.stderr


@pytest.mark.parametrize(
    "options",
    [("--component", "XX.S2.00.HNE", *PGA), ("--select", "2", *TARGET, "--range", "0.2:1")],
)
def test_a_part_of_the_channels_of_a_file_has_names_that_select_them(folder, tdint, options):
    """The names were those of all channels of the file with the same code."""
    noise = np.random.default_rng(0).normal(size=(4, 600)) * np.hanning(600)
    names = [(station, code) for station in ("S1", "S2") for code in ("HNE", "HNN")]
    channels = [
        trace(samples, channel=code, station=station)
        for samples, (station, code) in zip(noise, names, strict=True)
    ]
    write(folder / "stations.mseed", *channels)
    tdint("scale", "stations.mseed", *UNITS, *options, "-o", "suite.csv", code=0)
    factors = rows(folder / "suite.csv")
    runs = rows(
        tdint("run", "shaken.yaml", "--factors", "suite.csv", *UNITS, "-o", "o", code=0).stdout
    )
    assert {row["component"] for row in runs} == {row["component"] for row in factors}
    assert all(row["component"].startswith("XX.S") for row in runs)
