"""`tdint scale`, `ida` and `fragility`: what they write, how they go on, what they refuse."""

from __future__ import annotations

import csv
import json
import re
import sqlite3
from contextlib import closing
from pathlib import Path

import numpy as np
import pytest

from tdint.campaign.engine.batch import Batch
from tdint.campaign.ida.study import STORE
from tdint.campaign.store.connection import LOCK

CONFIGS = Path(__file__).parents[2] / "configs"
FRAME = CONFIGS / "collapse-prone-frame.yaml"
UNITS = ("--units", "m/s^2")
FEW = (*UNITS, "--max-im", "1.2m/s^2", "--threshold", "0.2%")


def rows(text):
    return list(csv.DictReader(text.splitlines()))


_STUDIES: list[dict[str, bytes]] = []


@pytest.fixture
def studied(folder, tdint):
    """The folder with an incremental dynamic analysis in `out`, made for the first test that asks for it."""
    if not _STUDIES:
        result = tdint("ida", "shaken.yaml", "motion.mseed", "other.mseed", *UNITS, "-o", "out", "--plot", "--jobs", 2)
        assert result.exit_code == 0, result.output
        _STUDIES.append({path.name: path.read_bytes() for path in (folder / "out").iterdir()})
    (folder / "out").mkdir(exist_ok=True)
    for name, data in _STUDIES[0].items():
        (folder / "out" / name).write_bytes(data)
    return folder


def test_an_ida_with_the_errors_of_its_runs(folder, tdint):
    """Beside each demand, of a collapse, too; the runs, and what follows, are the same. The errors are kept, too."""
    call = ("ida", "shaken.yaml", "motion.mseed", *UNITS, "--component", "HNN", "--method", "moment4")
    plain, checked = tdint(*call, "-o", "plain"), tdint(*call, "--check", "-o", "out")
    assert plain.exit_code == checked.exit_code == 0, checked.output
    one, other = (rows((folder / name / "ida.csv").read_text()) for name in ("plain", "out"))
    demands = ("peak_drift_ratio", "peak_absolute_acceleration_m_s2", "residual_drift_ratio")
    assert list(other[0]) == [*one[0], *(f"{name}_error" for name in demands), *(f"corrected_{one}" for one in demands)]
    assert [{name: row[name] for name in one[0]} for row in other] == one
    for row in other:
        assert all(float(row[f"{name}_error"]) >= 0.0 for name in demands)
    assert {"done", "collapsed"} <= {row["status"] for row in other}
    assert (folder / "plain" / "capacities.csv").read_bytes() == (folder / "out" / "capacities.csv").read_bytes()
    about = json.loads((folder / "out" / "ida.json").read_text())
    assert about["settings"]["check"] is True and "peak_drift_ratio_error" in about["columns"]
    again = tdint(*call, "--check", "-o", "out")
    assert "nothing to do" in again.stderr and rows((folder / "out" / "ida.csv").read_text()) == other
    assert tdint(*call, "-o", "out").exit_code == 2  # another study


# ---- scale


def test_factors_to_a_value(folder, tdint):
    result = tdint("scale", "motion.mseed", "other.mseed", *UNITS, "--pga", "0.6g", "-o", "f/factors.csv", "--plot")
    assert (result.exit_code, result.stdout) == (0, "")
    found = rows((folder / "f" / "factors.csv").read_text())
    assert [(row["record"], row["component"]) for row in found] == [
        ("motion.mseed", "HNE"),
        ("motion.mseed", "HNN"),
        ("other.mseed", "HNE"),
    ]
    infos = rows(tdint("info", "motion.mseed", "other.mseed", *UNITS).stdout)
    for row, info in zip(found, infos, strict=True):
        assert float(row["factor"]) * float(info["pga_m_s2"]) == pytest.approx(0.6 * 9.80665)
    summary = json.loads((folder / "f" / "factors.json").read_text())
    assert summary["settings"]["measure"] == "pga"
    assert len(summary["records"]) == 3
    us = ("scale", "motion.mseed", *UNITS, "--pga", "0.6g", "-o", "us.csv", "--output-units", "in,g")
    assert "scaled to pga = 0.6 g:" in tdint(*us).stderr
    told = json.loads((folder / "us.json").read_text())["records"][0]
    assert told["pga_g"] == pytest.approx(summary["records"][0]["pga_m_s2"] / 9.80665, rel=1e-11)
    assert (folder / "f" / "factors.png").read_bytes().startswith(b"\x89PNG")


def test_a_pair_has_one_factor(folder, tdint):
    result = tdint("scale", "motion.mseed", *UNITS, "--sa", "2m/s^2", "--at", 0.5, "--pairs", "rotd50")
    one, other = rows(result.stdout)
    assert one["factor"] == other["factor"]
    assert "1 pair scaled to sa(0.5) = 2 m/s^2" in result.stderr


def test_pairs_by_the_names_of_their_files(folder, tdint, make_record):
    """Whose names are unknown: one message says what would do, and with it two motions are two pairs."""
    (folder / "named").mkdir()
    for i, name in enumerate(("kobe", "taft")):
        for channel, ending in (("HNE", "tran"), ("HNN", "long"), ("HNZ", "vert")):
            peak = 1.0 + i + 0.5 * (ending == "long")
            make_record(folder / "named" / f"{name}_{ending}.mseed", channel, peak=peak)
    names = "{}_long.mseed,{}_tran.mseed"
    wanted = ("scale", "named", *UNITS, "--pga", "0.1g")
    alone = tdint(*wanted, "--pairs", "geometric-mean")
    assert alone.exit_code == 4
    told = [line for line in alone.stderr.splitlines() if "single" in line]
    assert len(told) == 1 and "4 files have a single horizontal component" in told[0]
    assert "--pairs '{}long.mseed,{}tran.mseed'" in told[0]
    for given in (names, f"rotd50,{names}"):
        result = tdint(*wanted, "--pairs", given)
        assert result.exit_code == 0, result.stderr
        assert "2 pairs scaled to pga" in result.stderr
        assert "kobe_vert.mseed" in result.stderr
    assert "2 pairs" in tdint(*wanted[:-2], "--p695", "--pairs", names).stderr
    spectra = tdint("spectrum", "named", *UNITS, "--rotd", "50", "--pairs", names, "--period", "1")
    assert spectra.exit_code == 0 and len(rows(spectra.stdout)) == 2
    assert tdint("spectrum", "named", *UNITS, "--pairs", names).exit_code == 2
    for bad in ("rotd50,rotd100", "rotd5", "{}_long.mseed", "{}_a,{}_b"):
        assert tdint(*wanted, "--pairs", bad).exit_code == 2


def test_a_record_that_fails_does_not_keep_the_others(folder, tdint):
    result = tdint("scale", "motion.mseed", "none.mseed", *UNITS, "--pgv", "10cm/s")
    assert result.exit_code == 4
    assert len(rows(result.stdout)) == 2
    assert "none.mseed" in result.stderr


def test_a_set_is_not_scaled_without_all_of_it(folder, tdint):
    result = tdint("scale", "motion.mseed", "none.mseed", *UNITS, "--p695")
    assert (result.exit_code, result.stdout) == (4, "")
    result = tdint("scale", "motion.mseed", "other.mseed", *UNITS, "--p695")
    assert (result.exit_code, result.stdout) == (4, "")
    assert "single horizontal component" in result.stderr


def test_the_rule_of_asce7(folder, tdint, make_record):
    (folder / "suite").mkdir()
    for i in range(11):
        make_record(folder / "suite" / f"{i:02d}.mseed", "HNE", "HNN", peak=1.0 + 0.2 * i, samples=200 + 10 * i)
    target = ("--target", CONFIGS / "design-spectrum.csv")
    result = tdint("scale", "suite", *UNITS, *target, "--rule", "asce7", "--range", "0.2:2:4", "-o", "f.csv", "--plot")
    assert result.exit_code == 0, result.output
    found = rows((folder / "f.csv").read_text())
    assert len(found) == 22
    assert all(one["factor"] == other["factor"] for one, other in zip(found[::2], found[1::2], strict=True))
    assert "11 pairs scaled to" in result.stderr
    said = float(result.stderr.partition("maximum-direction spectra is ")[2].partition(" %")[0])
    assert said >= 90.0
    settings = json.loads((folder / "f.json").read_text())["settings"]
    assert 100.0 * settings["least_average_over_target"] == pytest.approx(said, abs=0.5)
    assert settings["pairs"] == "rotd100"


EC8 = ("--target", "ec8:type=1,soil=B,ag=0.25g")


def test_the_rule_of_ec8_over_the_periods_of_a_building(folder, tdint):
    """Mean of the scaled spectra against those that `tdint spectrum` writes, and the mean PGA against ag S."""
    building = CONFIGS / "ten-story.yaml"
    (modes,) = [one for one in rows(tdint("modes", building).stdout) if one["mode"] == "1"]
    period = float(modes["period_s"])
    files = ("motion.mseed", "other.mseed")
    outputs = ("-o", "f.csv", "--plot", "--spectra", "s.csv")
    result = tdint("scale", *files, *UNITS, *EC8, "--rule", "ec8", "--building", building, *outputs)
    assert result.exit_code == 0, result.output
    settings = json.loads((folder / "f.json").read_text())["settings"]
    first, last, count = settings["periods_s"]
    assert (first, last, count) == (pytest.approx(0.2 * period), pytest.approx(2.0 * period), 100)
    grid = ("--periods", f"{first!r}:{last!r}:{count}")
    spectra = rows(tdint("spectrum", *files, *UNITS, *grid).stdout)
    aim = [float(row["psa_m_s2"]) for row in rows(tdint("spectrum", *EC8, *grid).stdout)]
    factors = [float(row["factor"]) for row in rows((folder / "f.csv").read_text())]
    peaks = [float(row["pga_m_s2"]) for row in rows(tdint("info", *files, *UNITS).stdout)]
    ratios = [
        sum(factor * float(spectra[100 * i + k]["psa_m_s2"]) for i, factor in enumerate(factors)) / 3.0 / aim[k]
        for k in range(100)
    ]
    zero = sum(factor * peak for factor, peak in zip(factors, peaks, strict=True)) / 3.0 / (0.25 * 1.2 * 9.80665)
    assert min(ratios) >= 0.9 * (1.0 - 1e-9)
    assert zero >= 1.0 - 1e-9
    assert min(min(ratios) / 0.9, zero) == pytest.approx(1.0)  # raised no further than needed
    assert settings["least_average_over_target"] == pytest.approx(min(ratios))
    written = rows((folder / "s.csv").read_text())
    curves = [row["curve"] for row in written]
    assert curves == ["scaled"] * 300 + ["mean"] * 100 + ["target"] * 100
    psa = [float(row["psa_m_s2"]) for row in written]
    for i, factor in enumerate(factors):
        own = [factor * float(row["psa_m_s2"]) for row in spectra[100 * i : 100 * (i + 1)]]
        assert psa[100 * i : 100 * (i + 1)] == pytest.approx(own, rel=1e-9)
    assert psa[300:400] == pytest.approx([ratio * value for ratio, value in zip(ratios, aim, strict=True)], rel=1e-9)
    assert psa[400:] == pytest.approx(aim, rel=1e-9)


def test_factors_that_are_too_large_are_told_or_refused(folder, tdint):
    target = ("--target", "ec8:type=1,soil=B,ag=50g", "--range", "0.2:2")
    result = tdint("scale", "motion.mseed", *UNITS, *target)
    assert result.exit_code == 0
    assert "Warning: factors beyond 0.25 to 4, the bounds of common practice: motion.mseed HNE" in result.stderr
    refused = tdint("scale", "motion.mseed", *UNITS, *target, "--max-factor", 5, "-o", "f.csv")
    assert refused.exit_code == 5
    assert "larger than --max-factor 5: motion.mseed HNE" in refused.stderr
    assert not (folder / "f.csv").exists()


TARGET = ("--target", CONFIGS / "design-spectrum.csv")


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ((), "nothing to scale to: give one of --target"),
        (("--sa", "0.5g"), "--sa needs a period: add --at"),
        (("--sa", "0.5", "--at", 1), "'0.5': write a number with its unit, such as 0.6g"),
        (("--sa", "5cm/s", "--at", 1), "write a number with its unit, such as 0.6g"),
        (("--pgv", "0.4g"), "such as 40cm/s"),
        (("--pga", "0.4g", "--pgv", "40cm/s"), "--pga and --pgv are given"),
        (("--pga", "0.4g", *TARGET), "--target and --pga are given"),
        (("--pga", "0.4g", "--at", 1), "--at is for --sa"),
        (("--pga", "0.4g", "--rule", "mean"), "--rule has nothing to act on without --target"),
        (("--pga", "0.4g", "--average", "0.2:3:9"), "--average has nothing to act on without --sa-avg"),
        (("--p695", "--pga", "0.4g"), "--p695 is scaled on by --sa"),
        (("--p695", "--pairs", "rotd50"), "--pairs: --p695 says itself"),
        ((*TARGET, "--range", "2"), "'2' is no range; write FIRST:LAST"),
        ((*TARGET, "--range", "0.2:9"), "has periods from 0.02 to 5 s; asked for are 0.2 to 9 s"),
        ((*TARGET, "--rule", "asce7"), "give the period T by --at, or --building, or --range"),
        ((*TARGET, "--rule", "ec8"), "--rule ec8 compares over 0.2 T to 2 T"),
        ((*TARGET, "--rule", "ec8", "--at", 0.5), "the rule ec8 compares at the period 0, too"),
        ((*TARGET, "--building", "x.yaml", "--at", 0.5), "--at is for --sa"),
        ((*TARGET, "--building", "x.yaml", "--range", "0.2:2"), "--building and --range are given"),
        (("--pga", "0.4g", "--building", "x.yaml"), "--building has nothing to act on without --target"),
        (("--target", "ec8:type=1,soil=B,ag=0.25g", "--damping", "2%"), "is for 5 % damping"),
        ((*TARGET, "--rule", "asce7", "--at", 0.5), "11 pairs of components at least (16.2.2), got 1"),
        ((*TARGET, "--rule", "asce7", "--at", 0.5, "--component", "HNE"), "--component names single components"),
    ],
)
def test_scaling_that_is_refused(folder, tdint, arguments, message):
    result = tdint("scale", "motion.mseed", *UNITS, *arguments)
    assert (result.exit_code, result.stdout) == (2, "")
    assert message in result.stderr
    assert result.stderr.startswith("Error: ")


# ---- ida


def test_a_study_and_its_files(studied):
    names = {"ida.csv", "capacities.csv", "ida.json", "ida.png", STORE, LOCK}
    assert {path.name for path in (studied / "out").iterdir()} == names
    runs, capacities = (rows((studied / "out" / f"{name}.csv").read_text()) for name in ("ida", "capacities"))
    names = list(dict.fromkeys((row["record"], row["component"]) for row in runs))
    assert names == [("motion.mseed", "HNE"), ("motion.mseed", "HNN"), ("other.mseed", "HNE")]
    for name in names:
        own = [row for row in runs if (row["record"], row["component"]) == name]
        assert [int(row["level"]) for row in own] == list(range(1, len(own) + 1))
        stable = [float(row["im"]) for row in own if row["status"] == "done"]
        collapsed = [float(row["im"]) for row in own if row["status"] == "collapsed"]
        found = [row for row in capacities if (row["record"], row["component"]) == name]
        assert [row["threshold"] for row in found] == ["0.01", "0.02", "0.04", "0.1"]
        assert float(found[-1]["upper"]) == min(collapsed)
        assert float(found[-1]["lower"]) == max(im for im in stable if im < min(collapsed))
        assert float(found[-1]["upper"]) / float(found[-1]["lower"]) <= 1.05 + 1e-9
        assert {row["censored"] for row in found} == {"false"}
    summary = json.loads((studied / "out" / "ida.json").read_text())
    assert summary["settings"]["collapse_drift"] == 0.1
    assert summary["columns"]["capacity"]["unit"] == "m/s^2"


def test_the_same_call_again_has_nothing_to_do(studied, tdint):
    before = {path: path.read_bytes() for path in (studied / "out").iterdir()}
    result = tdint("ida", "shaken.yaml", "motion.mseed", "other.mseed", *UNITS, "-o", "out")
    assert result.exit_code == 0
    assert "nothing to do: all records were done" in result.stderr
    assert {path: path.read_bytes() for path in (studied / "out").iterdir()} == before


def test_an_interrupted_study_gives_the_same_bytes(studied, tdint):
    out = studied / "out"
    before = {name: (out / name).read_bytes() for name in ("ida.csv", "capacities.csv", "ida.json")}
    for name in before:
        (out / name).unlink()
    sql("DELETE FROM run_rows WHERE chunk > 0", "DELETE FROM chunks WHERE id > 0")
    result = tdint("ida", "shaken.yaml", "motion.mseed", "other.mseed", *UNITS, "-o", "out")
    assert "1 of 3 records were done before" in result.stderr
    assert {name: (out / name).read_bytes() for name in before} == before


def sql(*statements):
    with closing(sqlite3.connect(f"out/{STORE}")) as connection, connection:
        for statement in statements:
            connection.execute(statement)


@pytest.mark.parametrize(
    "statement",
    [
        "DELETE FROM run_rows WHERE chunk = 1 AND scale > 1",
        "UPDATE run_rows SET peak_drift_ratio = 9e999",
        "UPDATE run_rows SET status = 'done'",
        "UPDATE run_rows SET status = '=1+1', residual_drift_ratio = 'null'",
        "UPDATE run_rows SET scale = 1.001 * scale",
        "UPDATE chunks SET id = id + 7",
        "DELETE FROM chunks",
        "UPDATE chunks SET runs = 1e9",
    ],
)
def test_runs_of_a_study_that_are_not_as_they_were_written_are_done_again(studied, tdint, statement):
    before = {path.name: path.read_bytes() for path in (studied / "out").iterdir() if path.suffix != ".sqlite"}
    sql(statement)
    result = tdint("ida", "shaken.yaml", "motion.mseed", "other.mseed", *UNITS, "-o", "out")
    assert (result.exit_code, "they are done again" in result.stderr) == (0, True), result.stderr
    assert {name: (studied / "out" / name).read_bytes() for name in before} == before


@pytest.mark.parametrize(
    "statement",
    [
        "UPDATE meta SET value = '9' WHERE key = 'schema'",
        "DELETE FROM meta WHERE key = 'fingerprint'",
        "UPDATE records SET sha256 = ''",
        "DROP TABLE run_rows",
    ],
)
def test_a_study_that_cannot_be_trusted_is_refused_with_a_way_out(studied, tdint, statement):
    tables = [studied / "out" / name for name in ("ida.csv", "capacities.csv")]
    before = [file.read_bytes() for file in tables]
    sql(statement)
    call = ("ida", "shaken.yaml", "motion.mseed", "other.mseed", *UNITS, "-o", "out")
    result = tdint(*call)
    assert (result.exit_code, len(result.stderr.splitlines())) == (6, 1), result.stderr
    assert "cannot be trusted" in result.stderr and "--overwrite" in result.stderr
    assert tdint(*call, "--overwrite").exit_code == 0
    assert [file.read_bytes() for file in tables] == before


def test_a_study_replaces_only_what_it_wrote(studied, tdint):
    """Neither a table that was changed since, nor one of others, nor a picture that lies elsewhere."""
    call = ("ida", "shaken.yaml", "motion.mseed", "other.mseed", *UNITS, "-o", "out")
    before = {name: (studied / "out" / name).read_bytes() for name in ("ida.csv", "capacities.csv", "ida.png")}
    for name in before:
        (studied / "out" / name).write_bytes(b"mine")
        result = tdint(*call, "--plot")
        assert (result.exit_code, f"out/{name}: exists already" in result.stderr) == (6, True), result.stderr
        assert (studied / "out" / name).read_bytes() == b"mine"
        (studied / "out" / name).write_bytes(before[name])
    (studied / "elsewhere.png").write_bytes(b"mine")
    result = tdint(*call, "--plot=elsewhere.png")
    assert (result.exit_code, (studied / "elsewhere.png").read_bytes()) == (6, b"mine"), result.stderr
    assert tdint(*call, "--plot=elsewhere.png", "--overwrite").exit_code == 0
    assert tdint(*call, "--plot=elsewhere.png").exit_code == 0
    (studied / "new").mkdir()
    (studied / "new" / "ida.csv").write_bytes(b"mine")
    result = tdint(*call[:-1], "new")
    assert (result.exit_code, sorted(path.name for path in (studied / "new").iterdir())) == (6, ["ida.csv"])


def test_a_study_in_other_units_and_back(folder, tdint):
    """The units of intensities stand in a column: it changes with the numbers; the store knows nothing of them."""
    study = ("ida", "shaken.yaml", "motion.mseed", *UNITS, "-o", "out", "--jobs", 1)
    first = tdint(*study, "--output-units", "kip,in,g")
    assert first.exit_code == 0, first.output
    names = ("ida.csv", "capacities.csv")
    us = [rows((folder / "out" / name).read_text()) for name in names]
    told = json.loads((folder / "out" / "ida.json").read_text())
    fitted = rows(tdint("fragility", "out").stdout)
    again = tdint(*study)
    assert "nothing to do" in again.stderr and "m/s^2" in again.stderr
    assert " g, 16 and 84 %" in first.stderr and "m/s^2" not in first.stderr
    for table, name in zip(us, names, strict=True):
        for row, si in zip(table, rows((folder / "out" / name).read_text()), strict=True):
            assert (row.pop("unit"), si.pop("unit")) == ("g", "m/s^2")
            for key, cell in row.items():
                if key in ("im", "capacity", "lower", "upper", "peak_absolute_acceleration_g"):
                    other = si[key.replace("_g", "_m_s2")]
                    assert bool(cell) == bool(other)
                    assert not cell or float(cell) * 9.80665 == pytest.approx(float(other), rel=1e-11)
                else:
                    assert cell == si[key]
    assert told["columns"]["capacity"]["unit"] == told["columns"]["peak_absolute_acceleration_g"]["unit"] == "g"
    assert "pga_g" in told["records"][0] and told["settings"]["output_units"] == "kip,in,kg,g"
    assert all(row["unit"] == "g" for row in fitted)


CLOUD = "im,edp,unit\n0.1,0.004,g\n0.2,0.007,g\n0.4,0.019,g\n0.6,0.021,g\n"


@pytest.mark.parametrize(
    ("text", "arguments"),
    [
        ("capacity,unit\n0.2,g\n0.3,g\n0.5,g\n", ()),
        ("im,collapses,records,unit\n0.2,1,9,g\n0.4,4,9,g\n0.8,8,9,g\n", ()),
        (CLOUD, ("--threshold", "1%")),
    ],
)
def test_fragility_in_other_units(folder, tdint, text, arguments):
    """A median converted is the median of what is converted; dispersions have no unit; the picture goes with them."""
    header, *lines = text.splitlines()
    name = "capacity" if "capacity" in header else "im"
    place = header.split(",").index(name)
    cells = [line.replace(",g", ",m/s^2").split(",") for line in lines]
    converted = [[repr(9.80665 * float(x)) if i == place else x for i, x in enumerate(row)] for row in cells]
    (folder / "g.csv").write_text(text)
    (folder / "si.csv").write_text("\n".join([header, *map(",".join, converted)]) + "\n")
    given = tdint("fragility", "g.csv", *arguments, "--output-units", "m", "--plot=given.svg")
    direct = tdint("fragility", "si.csv", *arguments, "--plot=direct.svg")
    assert (given.exit_code, given.stderr) == (0, direct.stderr)
    for row, other in zip(rows(given.stdout), rows(direct.stdout), strict=True):
        assert row["unit"] == other["unit"] == "m/s^2"
        for key in ("theta", "beta", "theta_error", "beta_error"):
            assert float(row[key]) == pytest.approx(float(other[key]), rel=1e-6)
    pictures = [(folder / f"{name}.svg").read_text("utf-8") for name in ("given", "direct")]
    labels = [re.findall(r"<text[^>]*>([^<]*)</text>", picture) for picture in pictures]
    assert labels[0] == labels[1] and any("m/s²" in label for label in labels[0])


def test_an_intensity_without_a_unit_is_not_converted(folder, tdint):
    result = tdint("fragility", CONFIGS / "stripes.csv", "--output-units", "g")
    assert (result.exit_code, result.stdout) == (2, "")
    assert "give the table a column unit" in result.stderr


def test_another_study_needs_another_folder_or_overwrite(studied, tdint):
    arguments = ("ida", "shaken.yaml", "motion.mseed", *UNITS, "--precision", "20%", "-o", "out")
    result = tdint(*arguments)
    assert result.exit_code == 2
    assert "setting precision: 0.05 in the store, 0.2 in this study" in result.stderr
    assert "record other.mseed HNE: in the store alone" in result.stderr
    assert tdint(*arguments, "--overwrite").exit_code == 0
    assert len(rows((studied / "out" / "capacities.csv").read_text())) == 8


def test_files_in_the_way(folder, tdint):
    (folder / "out").mkdir()
    (folder / "out" / "ida.csv").write_text("mine")
    result = tdint("ida", "shaken.yaml", "motion.mseed", *UNITS, "-o", "out")
    assert result.exit_code == 6
    assert "exists already" in result.stderr
    assert [path.name for path in (folder / "out").iterdir()] == ["ida.csv"]


def test_a_bad_record_is_named_and_the_others_are_done(folder, tdint):
    result = tdint("ida", FRAME, "motion.mseed", "none.mseed", "--component", "HNE", *FEW)
    assert result.exit_code == 4
    (low, collapse) = rows(result.stdout)
    assert (low["censored"], collapse["censored"], collapse["capacity"]) == ("false", "true", "1.2")
    assert "none.mseed" in result.stderr
    assert "1 of 1 censored" in result.stderr
    kept = tdint("ida", FRAME, "motion.mseed", "none.mseed", "--component", "HNE", *FEW, "-o", "kept")
    assert kept.exit_code == 4
    unused = json.loads((folder / "kept/ida.json").read_text())["not_used"]["records"]
    assert unused["count"] == 1 and "none.mseed" in unused["reasons"][0]


@pytest.mark.parametrize(
    ("arguments", "code", "message"),
    [
        (("--im", "pga", "--period", 1), 2, "--period has nothing to act on without --im sa or sa-avg"),
        (("--average", "0.2:3:5"), 2, "--average has nothing to act on without --im sa-avg"),
        (("--max-im", "3"), 2, "'3': write a number with its unit"),
        (("--max-im", "30cm/s"), 2, "--max-im 30cm/s: sa("),
        (("--im", "d5-95"), 2, "d5-95: a duration does not change with a factor; there are no levels of it"),
        (("--im", "pgv", "--max-im", "3g"), 2, "--max-im 3g: pgv is in m/s"),
        (("--threshold", "20%"), 2, "threshold 0.2: a drift ratio above 0 and at most the collapse drift, 0.1"),
        (("--period", "T2"), 2, "'T2' is not a valid float"),
        (("--method", "central-difference", "--dt", "1"), 5, "unstable"),
        (("--plot",), 2, "--plot alone"),
    ],
)
def test_studies_that_are_refused(folder, tdint, arguments, code, message):
    result = tdint("ida", "shaken.yaml", "other.mseed", *UNITS, *arguments)
    assert (result.exit_code, result.stdout) == (code, "")
    assert message in result.stderr


def test_what_has_no_result_is_told(folder, tdint, monkeypatch):
    """Runs that fail around the collapse: no number is made of them, and the wide bracket is told."""
    original = Batch.results

    def results(self, runs):
        rows = original(self, runs)
        if rows.runs[0].status == "collapsed" and runs[0].scale < 30.0:
            rows.runs[0] = rows.runs[0]._replace(status="not-converged", peak_drift_ratio=None, energy_error=None)
        return rows

    monkeypatch.setattr(Batch, "results", results)
    result = tdint("ida", "shaken.yaml", "motion.mseed", "--component", "HNE", *UNITS, "-o", "out")
    assert result.exit_code == 0
    assert "runs have no result, also with a finer step; they count neither way" in result.stderr
    assert "1 of 1 capacities are bracketed less closely than 5 %" in result.stderr
    found = rows((folder / "out" / "ida.csv").read_text())
    assert all((row["status"] == "not-converged") == (row["peak_drift_ratio"] == "") for row in found)


def test_a_model_without_heights(folder, tdint):
    result = tdint("ida", CONFIGS / "stiff-soft-node.yaml", "other.mseed", *UNITS)
    assert result.exit_code == 3
    assert "give story 1 a height" in result.stderr


def test_every_measure(folder, tdint):
    """Levels go with a power of the factor; where the building collapses is the same in all of them."""
    fell = []
    for im, power in {"pga": 1, "pgv": 1, "sa-avg": 1, "arias": 2, "cav": 1}.items():
        call = ("ida", FRAME, "other.mseed", *UNITS, "--im", im, "--precision", "20%", "--threshold", "5%")
        result = tdint(*call, "-o", im)
        assert result.exit_code == 0, result.output
        found = rows((folder / im / "ida.csv").read_text())
        assert found[0]["im_name"].startswith(im)
        ratios = [float(row["im"]) / float(row["scale"]) ** power for row in found]
        assert ratios == pytest.approx([ratios[0]] * len(found), rel=1e-10)
        fell.append(min(float(row["scale"]) for row in found if row["status"] == "collapsed"))
    assert fell == pytest.approx([fell[0]] * 5, rel=0.2)


def test_pairs(folder, tdint):
    result = tdint("ida", FRAME, "motion.mseed", *FEW, "--pairs", "rotd50")
    assert result.exit_code == 0, result.output
    assert {(row["component"], row["im_name"]) for row in rows(result.stdout)} == {
        ("HNE", "rotd50-sa(1.09504)"),
        ("HNN", "rotd50-sa(1.09504)"),
    }


# ---- fragility


def test_a_table_of_stripes(folder, tdint):
    result = tdint("fragility", CONFIGS / "stripes.csv", "--beta-model", 0.2, "-o", "f.csv", "--plot=f.svg")
    assert result.exit_code == 0, result.output
    (row,) = rows((folder / "f.csv").read_text())
    assert (row["fit"], row["theta"][:7], row["beta"][:7]) == ("stripes", "1.07611", "0.42923")
    assert float(row["beta_total"]) ** 2 == pytest.approx(float(row["beta"]) ** 2 + 0.04)
    assert (row["threshold"], row["im"], row["records"]) == ("", "", "40")
    assert "95 % confidence" in (folder / "f.svg").read_text()


def test_a_folder_of_a_study(folder, tdint, make_record):
    for samples in (60, 120):
        make_record(folder / f"{samples}.mseed", "HNE", samples=samples)
    records = ("motion.mseed", "60.mseed", "120.mseed")
    assert tdint("ida", "shaken.yaml", *records, "--component", "HNE", *UNITS, "-o", "out").exit_code == 0
    result = tdint("fragility", "out")
    found = rows(result.stdout)
    assert [row["threshold"] for row in found] == ["0.01", "0.02", "0.04", "0.1"]
    assert {(row["fit"], row["records"], row["unit"]) for row in found} == {("ida", "3", "m/s^2")}
    (one,) = rows(tdint("fragility", "out", "--threshold", "2%").stdout)
    assert one == found[1]
    (cloud,) = rows(tdint("fragility", "out", "--fit", "cloud", "--threshold", "2%").stdout)
    assert float(cloud["theta"]) == pytest.approx(float(one["theta"]), rel=0.5)


def test_runs_of_a_campaign(folder, tdint):
    """Stripes where the runs stand at common levels; a run without a result counts neither way, and is told."""
    header = "building,record,status,peak_drift_ratio,sa_t1_m_s2"
    lines = [
        f"a,{record},{status},{drift},{level}"
        for level, drifts in ((1.0, (0.01, 0.01, 0.02)), (2.0, (0.01, 0.05, 0.02)), (3.0, (0.04, 0.05, 0.02)))
        for record, drift in enumerate(drifts)
        for status in ("collapsed" if drift == 0.05 else "done",)
    ]
    (folder / "runs.csv").write_text("\n".join([header, *lines, "a,9,not-converged,,1.0"]) + "\n")
    result = tdint("fragility", ".", "--threshold", "3%")
    (row,) = rows(result.stdout)
    assert (row["fit"], row["im"], row["unit"], row["records"]) == ("stripes", "sa(T1)", "m/s^2", "3")
    assert "1 of 10 runs have no result and are left out" in result.stderr
    assert row["failed"] == "1" and "counted as exceeding, and as not" in result.stderr
    for hits, word in ((1, "exceed"), (0, "stand")):  # the fourth run of the first level
        (folder / "stripes.csv").write_text(f"im,collapses,records\n1,{hits},4\n2,1,3\n3,2,3\n")
        (bound,) = rows(tdint("fragility", "stripes.csv").stdout)
        assert (bound["theta"], bound["beta"]) == (row[f"theta_failed_{word}"], row[f"beta_failed_{word}"])
        assert "failed" not in bound
    (folder / "stripes.csv").write_text("im,collapses,records\n1,0,3\n2,1,3\n3,2,3\n")
    (same,) = rows(tdint("fragility", "stripes.csv").stdout)
    assert (same["theta"], same["beta"]) == (row["theta"], row["beta"])


def test_runs_of_several_buildings_are_no_fragility(folder, tdint):
    (folder / "runs.csv").write_text("building,status,peak_drift_ratio,im\na,done,0.1,1\nb,done,0.2,1\n")
    result = tdint("fragility", ".", "--threshold", "3%")
    assert result.exit_code == 3
    assert "runs.csv: column building has several values, a, b: leave the rows of one" in result.stderr


@pytest.mark.parametrize(
    ("options", "code", "message"),
    [((), 3, "no column sa_t1_m_s2"), (("--im", "pgv"), 2, "the runs have no measure pgv")],
)
def test_runs_without_the_intensity_that_is_wanted(folder, tdint, options, code, message):
    (folder / "runs.csv").write_text("building,status,peak_drift_ratio\na,done,0.1\na,done,0.2\n")
    result = tdint("fragility", ".", "--threshold", "3%", *options)
    assert result.exit_code == code and message in result.stderr


def test_what_cannot_be_fitted_is_told_beside_what_can(folder, tdint):
    (folder / "c.csv").write_text(
        "threshold,capacity,censored,im_name,unit\n"
        "0.01,1,false,pga,m/s^2\n0.01,2,false,pga,m/s^2\n0.1,3,true,pga,m/s^2\n0.1,,true,pga,m/s^2\n"
    )
    result = tdint("fragility", "c.csv")
    assert result.exit_code == 0
    assert [row["threshold"] for row in rows(result.stdout)] == ["0.01"]
    assert "Warning: threshold 0.1: of 1 capacities none is known" in result.stderr
    assert "1 row without a capacity left out" in result.stderr
    result = tdint("fragility", "c.csv", "--threshold", "10%")
    assert (result.exit_code, result.stdout) == (5, "")


@pytest.mark.parametrize(
    ("text", "arguments", "code", "message"),
    [
        ("im,collapses,records\n1,0,3\nx,1,3\n", (), 3, "t.csv:3: im must be a number, got 'x'"),
        ("im,collapses,records\n1,0,3\n2,1.5,3\n", (), 3, "t.csv:3: collapses must be a whole number"),
        ("capacity,im,edp\n1,1,1\n2,2,2\n", (), 2, "t.csv:1: this is a table of capacity and of im,edp; say which is"),
        ("capacity\n1\n2\n3\n", ("--beta-model", "1e308"), 2, "'--beta-model': 1e+308 is not in the range"),
        ("im,collapses,records\n1,0,3\n2,4,3\n", (), 3, "t.csv:3: collapses must be from 0 to the number of records"),
        ("im,collapses,records\n0,0,3\n2,3,3\n", (), 3, "t.csv:2: im must be positive, got '0'"),
        ("im,collapses,records\n1,0,3\n2,0,3\n", (), 5, "no record exceeds at any level"),
        ("im,collapse,records\n1,0,3\n", (), 3, "t.csv:1: a table has the columns im,collapses,records (stripes)"),
        ("capacity,censored\n1,perhaps\n", (), 3, "t.csv:2: censored must be true or false, got 'perhaps'"),
        ("capacity\n1\n-2\n", (), 3, "t.csv:3: capacity must be a positive number, got '-2'"),
        ("capacity\n1\n2\n", ("--fit", "cloud"), 2, "this table is for --fit ida, not cloud"),
        ("capacity\n1\n2\n", ("--threshold", "1%,2%"), 2, "has no column threshold: one --threshold at most"),
        ("threshold,capacity\n0.1,1\n0.1,2\n", ("--threshold", "2%"), 2, "has no threshold 0.02; there are 0.1"),
        ("capacity,im_name\n1,pga\n2,pgv\n", (), 3, "column im_name has several values, pga, pgv"),
        ("im,edp\n1,2\n2,3\n3,4\n", (), 2, "which demands are exceeded? Give --threshold"),
        ("im,edp\n1,2\n2,3\n3,5\n", ("--threshold", "3", "--edp-range", "3:2"), 2, "LOW must be below HIGH"),
        ("im,edp\n1,2\n", ("--fit", "stripes", "--edp-range", "2:"), 2, "--edp-range is for --fit cloud"),
        ("capacity,threshold\n1,\n2\n", (), 3, "t.csv: no row has a threshold; fill the column in or leave it out"),
        ("", (), 3, "t.csv: is empty"),
        ("im,im,edp\n1,2,3\n", (), 3, "t.csv:1: the column im is there twice"),
    ],
)
def test_tables_that_are_refused(folder, tdint, text, arguments, code, message):
    (folder / "t.csv").write_text(text)
    result = tdint("fragility", "t.csv", *arguments)
    assert (result.exit_code, result.stdout) == (code, "")
    assert message in result.stderr


def test_a_folder_without_tables(folder, tdint):
    result = tdint("fragility", ".")
    assert result.exit_code == 3
    assert "this folder has no capacities.csv and no runs.csv" in result.stderr


def test_standard_input(folder, tdint):
    result = tdint("fragility", "-", stdin=b"capacity\n1\n2\n3\n")
    assert result.exit_code == 0
    assert rows(result.stdout)[0]["records"] == "3"


def test_the_line_of_a_cloud_is_written(folder, tdint):
    """b0, b1 and sigma are those of least squares of ln EDP where nothing is censored, also in other units."""
    im, edp = np.array([1.0, 2.0, 3.0, 4.0, 5.0]), np.array([0.011, 0.018, 0.033, 0.037, 0.052])
    lines = [f"{x},{y},m/s^2" for x, y in zip(im, edp, strict=True)]
    (folder / "cloud.csv").write_text("\n".join(["im,edp,unit", *lines]) + "\n")
    design = np.column_stack([np.ones(5), np.log(im)])
    (b0, b1), (square,), *_ = np.linalg.lstsq(design, np.log(edp), rcond=None)
    (row,) = rows(tdint("fragility", "cloud.csv", "--threshold", "2%").stdout)
    assert [float(row[name]) for name in ("b0", "b1", "sigma")] == pytest.approx(
        [b0, b1, np.sqrt(square / 5)], rel=1e-9
    )
    assert float(row["theta"]) == pytest.approx(np.exp((np.log(0.02) - b0) / b1), rel=1e-9)
    (other,) = rows(tdint("fragility", "cloud.csv", "--threshold", "2%", "--output-units", "N,m,g").stdout)
    assert float(other["b0"]) == pytest.approx(b0 + b1 * np.log(9.80665), rel=1e-9)
    assert (other["b1"], other["sigma"]) == (row["b1"], row["sigma"])


def test_runs_in_other_units_are_understood(folder, tdint):
    """A campaign's runs.csv in the units of its models: the column's end tells the unit of the intensity."""
    body = [f"a,{k},done,{0.01 * k * (1 + 0.3 * (k % 2))},{0.1 * k}" for k in range(1, 8)]
    found = {}
    for unit, name in (("g", "sa_t1_g"), ("m/s^2", "sa_t1_m_s2")):
        (folder / "runs.csv").write_text("\n".join([f"building,record,status,peak_drift_ratio,{name}", *body]) + "\n")
        (found[unit],) = rows(tdint("fragility", ".", "--threshold", "3%", "--fit", "cloud").stdout)
        assert found[unit]["unit"] == unit
    assert found["g"]["theta"] == found["m/s^2"]["theta"]
