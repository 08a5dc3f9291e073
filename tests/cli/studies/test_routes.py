"""Results that several commands give agree: one and several measures, stripes, clouds, tables of
others, functions by building, incremental dynamic analyses, shards and numbers of jobs."""

import math
from pathlib import Path

import numpy as np
import pytest

import tdint as package
from csv_rows import rows
from peer_files import write_at2

MODEL = (
    "name: frame\nunits: {length: m, force: kN, mass: t}\n"
    "stories: [{mass: 100, height: 3, stiffness: 16000, law: {type: bilinear, yield_force: 120, "
    "hardening: 3%}}]\ndamping: 5%\ncollapse_drift: 2.5%\n"
)
MEASURES = ("sa", "pga", "pgv", "sa:0.3")
LIMIT = 0.012


def write_study(folder, components, pairs=8):
    """Write the model and the records of a campaign, of which the first components are a half."""
    (folder / "frame.yaml").write_text(MODEL)
    (folder / "records").mkdir()
    generator = np.random.default_rng(4)
    for number in range(1, pairs + 1):
        for direction in ("010", "100")[:components]:
            time = np.arange(240) * 0.02
            size = 0.1 * (0.5 + generator.random())
            noise = np.convolve(generator.standard_normal(240), np.ones(6) / 2.0, "same")
            values = size * noise * np.exp(-((time - 2.0) ** 2) / 2.0)
            event = f"Event {number}, 1/1/1990, Station, {int(direction)}"
            write_at2(folder / "records" / f"RSN{number}_STA{number}{direction}.AT2", event, values)


def write_campaign(folder, intensity):
    text = f"buildings: {{models: [frame.yaml]}}\nrecords: {{files: [records]}}\n{intensity}\n"
    (folder / "study.yaml").write_text(text)


def numbers(row, *names):
    return [float(row[name]) if row[name] else math.nan for name in names]


def motions_of(folder, column, demand):
    """Return intensities, demands and collapses of motions from runs.csv (and measures.csv), which
    are combined here: the geometric mean and the larger or the mean demand of both components."""
    found = {}
    tables = rows(folder / "runs.csv"), rows(folder / "measures.csv")
    for run, measured in zip(*tables, strict=True):
        im = next(float(row[name]) for row in (measured, run) for name in row if name == column)
        cells = im, float(run["peak_drift_ratio"]), run["status"] == "collapsed"
        found.setdefault((run["record"][8:12], run["scale"]), []).append(cells)
    for (name, _), runs in found.items():
        im, edp, collapsed = zip(*runs, strict=True)
        mean = math.exp(np.mean(np.log(im)))  # also of components that count separately
        if demand == "separate":
            yield from ((mean, *item, name) for item in zip(edp, collapsed, strict=True))
        else:
            combine = np.mean if demand == "mean" else np.max
            yield mean, float(combine(edp)), any(collapsed), name


@pytest.mark.parametrize(
    ("components", "demand"), [(1, "larger"), (2, "larger"), (2, "mean"), (2, "separate")]
)
def test_clouds_of_one_and_several_measures(folder, tdint, components, demand):
    """`--im` with several measures is the sum of its single fits; tables of others and functions by
    building are equal too."""
    write_study(folder, components)
    write_campaign(folder, "intensity: {scales: [1, 1.6, 2.2]}")
    tdint("campaign", "study.yaml", "-o", "out", "--im", ",".join(MEASURES), code=0)
    rule = () if demand == "larger" else ("--pair-demand", demand)
    several = tdint("fragility", "out", "--im", ",".join(MEASURES), *rule, code=0)
    if components == 2 and demand == "larger":
        assert "16 components, 8 recordings, 8 pairs" in several.stderr
    compared = {row["im"]: row for row in rows(several.stdout)}
    columns = dict(zip(MEASURES[:3], ("sa_t1_m_s2", "pga_m_s2", "pgv_m_s"), strict=True))
    fit = ("--fit", "cloud", "--threshold", str(LIMIT), *rule)
    for measure in MEASURES:
        (single,) = rows(tdint("fragility", "out", "--im", measure, *fit, code=0).stdout)
        line = compared[measure]
        assert numbers(line, "slope", "beta") == pytest.approx(numbers(single, "b1", "sigma"))
        survivors = int(single["runs"]) - int(single["collapsed"])
        assert int(line["runs"]) == survivors and int(line["left_out"]) == int(single["collapsed"])
        by = ("fragility", "out", "--im", measure, *fit, "--by", "building")
        (building,) = rows(tdint(*by, code=0).stdout)
        same = ("theta", "beta", "theta_error", "beta_error", "runs", "motions", "a0", "a1")
        assert numbers(building, *same) == pytest.approx(numbers(single, *same), nan_ok=True)
        assert single["im"] == building["im"]
        assert single["im"].startswith("geometric-mean-") == (components == 2)
        if measure in columns:
            cells = motions_of(folder / "out", columns[measure], demand)
            lines = [f"{im!r},{edp!r},{fell},{name}" for im, edp, fell, name in cells]
            header = "im,edp,collapsed,record"
            (folder / "cloud.csv").write_text("\n".join([header, *lines]).lower() + "\n")
            (other,) = rows(tdint("fragility", "cloud.csv", *fit[:4], code=0).stdout)
            assert numbers(other, *same) == pytest.approx(numbers(single, *same), nan_ok=True)


@pytest.mark.parametrize("components", [1, 2])
def test_stripes_of_a_campaign_of_counts_and_of_an_ida(folder, tdint, components):
    """Stripes of a directory, by building and of a table of counts are equal; the drift at a level
    of `ida` is that of a campaign at the level."""
    write_study(folder, components)
    levels = (1.0, 2.0, 3.0, 4.5)
    listed = ", ".join(f"{level} m/s^2" for level in levels)
    write_campaign(folder, f"intensity: {{measure: sa, period: 0.5, levels: [{listed}]}}")
    tdint("campaign", "study.yaml", "-o", "out", code=0)
    (single,) = rows(tdint("fragility", "out", "--threshold", str(LIMIT), code=0).stdout)
    by = ("fragility", "out", "--threshold", str(LIMIT), "--by", "building")
    (building,) = rows(tdint(*by, code=0).stdout)
    same = ("theta", "beta", "theta_error", "beta_error", "motions")
    assert single["fit"] == building["fit"] == "stripes"
    assert numbers(building, *same) == pytest.approx(numbers(single, *same), nan_ok=True)
    demands = {}
    for run in rows(folder / "out" / "runs.csv"):
        drift = math.inf if run["status"] == "collapsed" else float(run["peak_drift_ratio"])
        key = float(run["level"]), run["record"][8:13]
        demands[key] = max(drift, demands.get(key, 0.0))
    lines = [
        f"{level},{sum(d >= LIMIT for (im, _), d in demands.items() if im == level)},8"
        for level in levels
    ]
    (folder / "counts.csv").write_text("\n".join(["im,collapses,records", *lines]) + "\n")
    (counted,) = rows(tdint("fragility", "counts.csv", code=0).stdout)
    assert numbers(counted, "theta", "beta") == pytest.approx(numbers(single, "theta", "beta"))
    pairs = ("--pairs", "geometric-mean") if components == 2 else ()
    ida = ("ida", "frame.yaml", "records", "--period", "0.5", *pairs, "-o", "ida")
    tdint(*ida, "--threshold", str(LIMIT), code=0)
    (run,) = [row for row in rows(folder / "ida" / "ida.csv") if "STA3010" in row["record"]][1:2]
    write_campaign(folder, f"intensity: {{scales: [{run['scale']}]}}")
    tdint("campaign", "study.yaml", "-o", "one", code=0)
    (other,) = [row for row in rows(folder / "one" / "runs.csv") if "STA3010" in row["record"]]
    assert numbers(other, "peak_drift_ratio") == pytest.approx(numbers(run, "peak_drift_ratio"))


@pytest.mark.parametrize("demand", ["larger", "mean", "separate"])
def test_limits_of_pairs(folder, tdint, demand):
    """The mean demand that is compared with a limit has one value in Python, in a run of several
    records and in a campaign: that of the components, combined here."""
    write_study(folder, 2, pairs=3)
    write_campaign(folder, "intensity: {scales: [0.5]}")
    files = sorted(map(str, Path("records").iterdir()))
    records = [package.read_record(file).scaled(0.5) for file in files]
    drifts = [
        package.run("frame.yaml", record, check=False).stories.peak_drift_ratio
        for record in records
    ]
    pairs = np.reshape(drifts, (3, 2))
    combined = {"larger": pairs.max(axis=1), "mean": pairs.mean(axis=1), "separate": pairs}[demand]
    ((check,),) = (
        package.run_many("frame.yaml", files, scales=0.5).limit_checks(0.02, demand).values()
    )
    assert check.demand == pytest.approx(np.mean(combined), rel=1e-12)
    assert (check.largest, check.motions) == (np.max(combined), np.size(combined))
    number = np.argmax(combined) + 1
    if demand != "separate":
        assert check.motion == f"records/RSN{number}_STA{number}010+100.AT2"
    rule = ("--pair-demand", demand)
    tdint("run", "frame.yaml", "records", "--scale", "0.5", *rule, "-o", "many", code=0)
    text = (
        (folder / "study.yaml")
        .read_text()
        .replace("[records]", f"[records], pair_demand: {demand}")
    )
    (folder / "study.yaml").write_text(text)
    tdint("campaign", "study.yaml", "-o", "out", code=0)
    for name in ("many", "out"):
        (row,) = [
            row
            for row in rows(folder / name / "profiles.csv")
            if row["quantity"] == "peak_drift_ratio"
        ]
        assert numbers(row, "mean") == [pytest.approx(check.demand, rel=1e-9)]
        assert int(row["runs"]) == check.motions


@pytest.mark.parametrize("kind", ["records", "pairs", "two directions"])
def test_shards_and_jobs(folder, tdint, kind):
    """The tables of shards that are merged, and of one and two jobs, have equal bytes; `ida` and
    functions as well, with one and several measures."""
    write_study(folder, 1 if kind == "records" else 2, pairs=3)
    sweep = "vary: {stiffness_factor: [0.9, 1.1]}"
    if kind == "two directions":
        (folder / "frame.yaml").write_text(MODEL + "excitation: {azimuth: 10}\n")
        (folder / "other.yaml").write_text(
            MODEL.replace("name: frame", "name: other").replace("16000", "14000")
            + "excitation: {azimuth: 10}\n"
        )
        sweep = ""
    write_campaign(folder, f"intensity: {{scales: [0.4, 0.6, 0.8]}}\n{sweep}")
    if kind == "two directions":
        text = (
            (folder / "study.yaml").read_text().replace("[frame.yaml]", "[frame.yaml, other.yaml]")
        )
        (folder / "study.yaml").write_text(text)
    measures = ("--im", "sa,pga,pgv")
    for jobs in ("1", "2"):
        tdint("campaign", "study.yaml", "-o", f"jobs{jobs}", "--jobs", jobs, *measures, code=0)
        tdint("campaign", "study.yaml", "-o", f"part{jobs}", "--shard", f"{jobs}/2", code=0)
        pairs = ("--pairs", "geometric-mean") if kind == "pairs" else ()
        ida = ("ida", "frame.yaml", "records", "--period", "0.5", "--jobs", jobs, *pairs)
        tdint(*ida, "--threshold", str(LIMIT), "-o", f"ida{jobs}", code=0)
    tdint("campaign", "merge", "part1", "part2", "-o", "merged", code=0)
    for name in ("runs.csv", "profiles.csv", "measures.csv"):
        right = (folder / "jobs1" / name).read_bytes()
        assert (folder / "jobs2" / name).read_bytes() == right
        # Other measures require the models, which merge does not read.
        assert name == "measures.csv" or (folder / "merged" / name).read_bytes() == right
    for file in (folder / "ida1").glob("*.csv"):
        assert (folder / "ida2" / file.name).read_bytes() == file.read_bytes(), file.name
    functions = ("--by", "building", "--threshold", "0.5%", "--im", "sa", "--fit", "cloud")
    right = tdint("fragility", "jobs1", *functions, code=0).stdout
    assert len(rows(right)) == 2
    for folder_name in ("jobs2", "merged"):
        assert tdint("fragility", folder_name, *functions, code=0).stdout == right


def test_one_and_several_measures_in_two_directions(folder, tdint):
    """The fits of several measures are the single fits, and those by building and of `--by`."""
    write_study(folder, 2)
    (folder / "frame.yaml").write_text(MODEL + "excitation: {azimuth: 10}\n")
    write_campaign(folder, "intensity: {scales: [1, 1.6, 2.2]}")
    tdint("campaign", "study.yaml", "-o", "out", "--im", ",".join(MEASURES), code=0)
    several = tdint("fragility", "out", "--im", ",".join(MEASURES), code=0)
    compared = {row["im"]: row for row in rows(several.stdout)}
    fit = ("--fit", "cloud", "--threshold", str(LIMIT))
    for measure in MEASURES:
        line = compared[measure]
        (single,) = rows(tdint("fragility", "out", "--im", measure, *fit, code=0).stdout)
        assert numbers(line, "slope", "beta") == pytest.approx(numbers(single, "b1", "sigma"))
        assert int(line["runs"]) + int(line["left_out"]) == int(single["runs"]) == 24
        assert single["motions"] == "8" and single["im"].startswith("geometric-mean-")
        by = ("fragility", "out", "--im", measure, *fit, "--by", "building")
        (building,) = rows(tdint(*by, code=0).stdout)
        same = ("theta", "beta", "theta_error", "beta_error", "runs", "motions", "a0", "a1")
        assert numbers(building, *same) == pytest.approx(numbers(single, *same), nan_ok=True)
