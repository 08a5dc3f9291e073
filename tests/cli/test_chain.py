"""Selection, matching, run and report of pairs of records in five formats, compared with results of
a script that does not use tdint (tests/pair_demands.py)."""

import json
from pathlib import Path

import numpy as np
import pytest

import pair_demands as pairs
from cli.test_report import Page
from csv_rows import rows
from peer_files import write_at2

TARGET = ("--target", "asce7:sds=1,sd1=0.6,tl=8", "--range", "0.2:0.5")
EVENTS = (("Loma Prieta", "10/18/1989"), ("Kobe", "1/16/1995"), ("Duzce", "11/12/1999"))
SAMPLES, DT = 600, 0.01
FRAME = """\
name: one
stories:
  - {mass: 10, height: 3, stiffness: 3000, law: {type: bilinear, yield_force: 20, hardening: 0.05}}
damping: none
analysis: {method: newmark-average}
"""


def motion(seed, size):
    """Return noise in an envelope, g; the components have different frequencies."""
    generator, time = np.random.default_rng(seed), np.arange(SAMPLES) * DT
    values = generator.standard_normal(SAMPLES) * np.exp(-((time - 2.0) ** 2))
    return 0.25 * size * values / np.abs(values).max()


def write_peer(folder, number, direction, values):
    name, date = EVENTS[number % 3]
    description = f"{name}, {date}, Station {number}, {int(direction)}"
    write_at2(folder / f"RSN{number}_S{direction}.AT2", description, values, DT)


def write_csv(folder, number, direction, values):
    lines = ["time_s,acceleration_g"]
    lines += [f"{sample * DT:.2f},{value:.8e}" for sample, value in enumerate(values)]
    (folder / f"S{number}-{direction}.csv").write_text("\n".join(lines) + "\n")


def write_waveform(folder, number, direction, values, suffix):
    import obspy

    channel = {"067": "HN1", "337": "HN2"}[direction]
    header = {"network": "XX", "station": f"S{number}", "channel": channel, "delta": DT}
    start = obspy.UTCDateTime(2000 + number, 1, 1)
    trace = obspy.Trace(np.asarray(values, np.float32), {**header, "starttime": start})
    trace.write(str(folder / f"XX.S{number}.{channel}.{suffix}"), format=suffix.upper())


def write_knet(folder, number, direction, values):
    direction_name = {"067": "E-W", "337": "N-S"}[direction]
    counts = np.round(values * 980.665 * 1e6 / 200.0).astype(int)
    day = f"200{number}/01/02"
    lines = [
        ("Origin Time", f"{day} 03:04:00"),
        ("Lat.", "35.0"),
        ("Long.", "135.0"),
        ("Depth. (km)", "10"),
        ("Mag.", "6.0"),
        ("Station Code", f"AOM00{number}"),
        ("Station Lat.", "35.1"),
        ("Station Long.", "135.1"),
        ("Station Height(m)", "10"),
        ("Record Time", f"{day} 03:04:20"),
        ("Sampling Freq(Hz)", "100Hz"),
        ("Duration Time(s)", f"{SAMPLES * DT:g}"),
        ("Dir.", direction_name),
        ("Scale Factor", "200(gal)/1000000"),
        ("Max. Acc. (gal)", f"{np.abs(counts - counts.mean()).max() * 200.0 / 1e6:.3f}"),
        ("Last Correction", f"{day} 03:04:00"),
    ]
    text = "".join(f"{name:<18}{value}\n" for name, value in lines) + "Memo.\n"
    for start in range(0, SAMPLES, 8):
        text += " ".join(f"{value:8d}" for value in counts[start : start + 8]) + "\n"
    (folder / f"AOM00{number}0{number}01020304.{direction_name.replace('-', '')}").write_text(text)


WRITERS = {
    "at2": (write_peer, ()),
    "csv": (write_csv, ("--units", "g")),
    "mseed": (lambda *of: write_waveform(*of, "mseed"), ("--units", "g")),
    "sac": (lambda *of: write_waveform(*of, "sac"), ("--units", "g")),
    "knet": (write_knet, ()),
}


@pytest.fixture
def pool(working_directory, request):
    """Write six pairs in a format into `pool`, and a model; return the options for the format."""
    writer, options = WRITERS[request.param]
    Path("pool").mkdir()
    Path("frame.yaml").write_text(FRAME)
    for number in range(6):
        for index, (direction, size) in enumerate((("067", 1.0), ("337", 0.6))):
            writer(Path("pool"), number, direction, motion(10 * number + index, size))
    return options


def select_and_match(tdint, record_options):
    """Select three pairs of `pool` and match them; check that pairs stay pairs. The matched files
    are in the directory `m`."""
    choice = ("--pairs", "rotd100", *TARGET)
    selection = ("--select", "3", "--factor-range", ".25:40", "--max-factor", "40")
    tdint("scale", "pool", *record_options, *selection, *choice, "-o", "factors.csv", code=0)
    factors = rows("factors.csv")
    assert len(factors) == 6 and len({row["factor"] for row in factors}) == 3
    matching = ("match", "--factors", "factors.csv", *record_options, *choice)
    tdint(*matching, "--format", "at2", "-o", "m", code=0)
    assert len(list(Path("m").glob("*.at2"))) == 6


@pytest.mark.parametrize(
    "pool",
    ["knet", *(pytest.param(name, marks=pytest.mark.long) for name in ("csv", "mseed", "sac"))],
    indirect=True,
)
@pytest.mark.long
def test_pairs_of_each_format_are_selected_and_matched(pool, tdint, short_matching):
    """The formats differ only in the files that `scale` and `match` read. The next test executes
    the complete chain, for these formats as a slow test."""
    select_and_match(tdint, pool)
    options = ("--limit", "2%", "-o", "larger", "--pair-demand", "larger")
    messages = tdint("run", "frame.yaml", "m", *options, code=0).stderr
    mean = pairs.mean_drift(rows("larger/runs.csv"), "larger")
    assert f"Mean drift {100.0 * mean:.3g} %" in messages and "Demand of pairs: larger" in messages


@pytest.mark.parametrize(
    "pool",
    ["at2", *(pytest.param(name, marks=pytest.mark.slow) for name in WRITERS if name != "at2")],
    indirect=True,
)
@pytest.mark.long
def test_commands_from_a_directory_of_records_to_a_report(pool, tdint):
    """All commands recognize the pairs, without edits of the files. RotD100 of the matched records
    equals the target within 3 %, and the mean over pairs equals the result of the script for each
    rule."""
    select_and_match(tdint, pool)
    means = {}
    for rule in pairs.RULES:
        page = ("--report", f"{rule}.html", "-o", rule, "--pair-demand", rule)
        messages = tdint("run", "frame.yaml", "m", "--limit", "2%", *page, code=0).stderr
        runs = rows(f"{rule}/runs.csv")
        means[rule] = pairs.mean_drift(runs, rule)
        (profile,) = (
            row
            for row in rows(f"{rule}/profiles.csv")
            if row["quantity"] == "peak_drift_ratio" and row["story"] == "1"
        )
        assert float(profile["mean"]) == pytest.approx(means[rule], rel=1e-10)
        assert f"Mean drift {100.0 * means[rule]:.3g} %" in messages
        assert f"Demand of pairs: {rule}" in messages
        assert f"{100.0 * means[rule]:.3g} %" in Page(Path(f"{rule}.html").read_text("utf-8")).text
    assert means["larger"] > 1.02 * means["mean"]
    # The components of a pair have consecutive rows.
    named = [Path(row["record"]) for row in rows("larger/runs.csv")]
    for first, second in zip(named[::2], named[1::2], strict=True):
        for period in pairs.PERIODS:
            target = min(1.0, 0.6 / period) * pairs.GRAVITY
            assert pairs.rotd100(first, second, period) == pytest.approx(target, rel=0.03)


@pytest.mark.parametrize("pool", ["at2"], indirect=True)
@pytest.mark.long
def test_annual_losses_of_matched_pairs(pool, tdint):
    """In a campaign with the matched pairs as events with annual rates, the average annual losses
    of tables and map equal the results of the script for each rule."""
    tdint("match", "pool", "--pairs", "rotd100", *TARGET, "--format", "at2", "-o", "m", code=0)
    files = sorted(Path("m").glob("*067.at2"))
    rates = {f"event-{index}": 0.01 * (1 + index) for index in range(len(files))}
    Path("classes.csv").write_text("class,sd_m,sa_g\nA,0.005,0.2\nA,0.1,0.25\n")
    Path("buildings.csv").write_text(
        "id,class,NumberOfStories,Longitude,Latitude,cost,number\na,A,1,10,45,1e6,3\n"
        "b,A,2,10,45,5e5,1\n"
    )
    Path("sites.csv").write_text("site,longitude,latitude\nhere,10,45\n")
    fields = [f"{event},here,{file},1" for event, file in zip(rates, files, strict=True)]
    Path("fields.csv").write_text("\n".join(["event,site,record,factor", *fields]) + "\n")
    text = "".join(f"{event},{rate}\n" for event, rate in rates.items())
    Path("rates.csv").write_text(f"event,rate\n{text}")
    Path("study.yaml").write_text(
        "buildings: {inventory: buildings.csv, rules: capacity, classes: classes.csv, units: "
        "{length: m}}\nrecords: {fields: fields.csv, sites: sites.csv, rates: rates.csv, pairs: "
        "true}\ndamage: {thresholds: {slight: 0.5%, complete: 3%}, dispersion: 0.4, losses: "
        "{slight: 10%, complete: 1}}\n"
    )
    states = {"medians": (0.005, 0.03), "dispersion": 0.4, "losses": (0.1, 1.0)}
    annual = []
    for rule in pairs.RULES:
        tdint("campaign", "study.yaml", "-o", "out", "--pair-demand", rule, code=0)
        tdint("campaign", "export", "out", "--geojson", code=0)
        worth = {"a": 3e6, "b": 5e5}
        found = pairs.annual_losses(rows("out/damage.csv"), rule, rates, states, worth)
        table_loss = sum(float(row["annual_loss"]) for row in rows("out/exceedance.csv"))
        assert table_loss == pytest.approx(sum(found.values()), rel=1e-8)
        for feature in json.loads(Path("out/buildings.geojson").read_text())["features"]:
            properties = feature["properties"]
            expected = found[properties["building"]]
            assert properties["average_annual_loss"] == pytest.approx(expected, rel=1e-8)
        annual.append(table_loss)
    assert annual[0] > annual[1] and len(set(annual)) == 3
