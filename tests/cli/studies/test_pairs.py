"""The two components of a recording count as a single ground motion in every command."""

import json
import re

import numpy as np
import pytest

from cli.test_report import Page
from csv_rows import rows
from ground_motion.files import trace, wave, write
from peer_files import write_at2
from tdint import studies
from tdint.ground_motion.record import Record
from tdint.studies.ida.ida_curve import IdaCurve, IdaRun, PairCurve

MATCH = "match RSN1_EQ_GIL067.AT2 RSN1_EQ_GIL337.AT2 --pairs rotd100"
TARGET = "--target asce7:sds=1,sd1=0.6,tl=8 --range 0.2:0.5"


def write_pair(folder, name="RSN1_EQ_GIL", event="Loma Prieta", seed=0, sizes=(1.0, 0.6)):
    """Write two PEER files, 067 and 337, with decaying noise of the given amplitudes."""
    generator = np.random.default_rng(seed)
    for direction, size in zip(("067", "337"), sizes, strict=True):
        time = np.arange(600) * 0.01
        values = 0.2 * size * generator.standard_normal(600) * np.exp(-((time - 2.0) ** 2))
        description = f"{event}, 10/18/1989, Gilroy - Gavilan Coll., {int(direction)}"
        write_at2(folder / f"{name}{direction}.AT2", description, values)


@pytest.mark.parametrize(
    "suffix", ["at2", *(pytest.param(name, marks=pytest.mark.long) for name in ("mseed", "csv"))]
)
def test_commands_recognize_a_matched_pair(folder, tdint, suffix):
    write_pair(folder)
    tdint(*MATCH.split(), *TARGET.split(), "--format", suffix, "-o", "m", code=0)
    files = [f"m/RSN1_EQ_GIL{direction}.{suffix}" for direction in ("337", "067")]
    rotd = rows(tdint("spectrum", *files, "--rotd", "100", "--period", "0.3", code=0).stdout)
    assert [row["component"] for row in rotd] == ["337+67"]
    assert float(rotd[0]["rotd100_psa_m_s2"]) == pytest.approx(9.80665, rel=0.02)
    scaling = ("scale", "m", "--pairs", "geometric-mean", "--to", "sa=1g", "--at", "0.3")
    scaled = rows(tdint(*scaling, code=0).stdout)
    assert len(scaled) == 2 and len({row["factor"] for row in scaled}) == 1
    study = "buildings: {models: [shaken.yaml]}\nrecords: {files: [m], pairs: true}\n"
    (folder / "study.yaml").write_text(study + "intensity: {scales: [1]}\n", encoding="utf-8")
    tdint("campaign", "study.yaml", "-o", "out", code=0)
    runs = rows((folder / "out" / "runs.csv").read_text())
    assert [row["component"] for row in runs] == ["337", "67"]


def test_components_of_different_events_are_refused(folder, tdint):
    write_pair(folder, event="Loma Prieta")
    other = (folder / "RSN1_EQ_GIL337.AT2").read_text().replace("Loma Prieta", "Kobe")
    (folder / "RSN1_EQ_GIL337.AT2").write_text(other, encoding="utf-8")
    result = tdint.refused("different events", *MATCH.split(), *TARGET.split(), "-o", "m", code=4)
    assert all(name in result.stderr for name in ("GIL067.AT2", "GIL337.AT2", "Kobe"))


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("DT= .0100", "DT= .0200", "sampling intervals, 0.01 and 0.02 s"),
        ("Loma Prieta", "Kobe", "the components are of different events"),
        ("NPTS= 600", "NPTS= 500", "the components have 600 and 500 samples"),
    ],
)
def test_components_that_do_not_belong_together_are_refused(folder, tdint, old, new, message):
    """Commands that combine components refuse them; as separate motions they are run."""
    (folder / "one.yaml").write_text(ONE_STORY, encoding="utf-8")
    (folder / "in").mkdir()
    write_pair(folder / "in")
    file = folder / "in" / "RSN1_EQ_GIL337.AT2"
    lines = file.read_text().replace(old, new).splitlines()
    file.write_text("\n".join(lines[:504] if "500" in new else lines) + "\n", encoding="utf-8")
    (folder / "study.yaml").write_text("buildings: {models: [one.yaml]}\nrecords: {files: [in]}\n")
    for call in (
        ("run", "one.yaml", "in", "-o", "out"),
        ("campaign", "study.yaml", "-o", "out"),
        ("scale", "in", "--pairs", "rotd100", "--to", "sa=1g", "--at", "0.3"),
        ("ida", "one.yaml", "in", "--pairs", "geometric-mean"),
        ("match", "in", "--pairs", "rotd100", *TARGET.split(), "-o", "m"),
    ):
        result = tdint.refused(message, *call, code=4)
        assert all(
            f"in/RSN1_EQ_GIL{direction}.AT2" in result.stderr for direction in ("067", "337")
        )
    tdint("run", "one.yaml", "in", "--pair-demand", "separate", code=0)


def test_a_missing_component_is_reported(folder, tdint):
    write_pair(folder)
    (folder / "RSN1_EQ_GIL337.AT2").unlink()
    tdint.refused(
        "RSN1_EQ_GIL067.AT2: ... one horizontal component, 67; ",
        *("scale", "RSN1_EQ_GIL067.AT2", "--pairs", "rotd100", "--to", "sa=1g", "--at", "0.3"),
        code=4,
    )


@pytest.mark.parametrize("codes", [("HNN", "HNE"), ("HN1", "HN2")])
@pytest.mark.parametrize("command", ["ida", "run"])
def test_stations_in_one_file_are_recordings_of_their_own(folder, tdint, command, codes):
    """Results are those of a file for each station, also if their stations have other codes."""
    (folder / "one.yaml").write_text(ONE_STORY, encoding="utf-8")
    stations = {
        station: [
            trace(wave(400, peak=peak) * np.hanning(400), channel=code, station=station)
            for code, peak in zip(codes if station == "S2" else ("HNN", "HNE"), peaks, strict=True)
        ]
        for station, peaks in {"S1": (2.0, 1.5), "S2": (1.2, 1.8)}.items()
    }
    for name, channels in stations.items():
        write(folder / f"{name}.mseed", *channels)
    write(folder / "both.mseed", *stations["S1"], *stations["S2"])
    table = {"ida": "capacities.csv", "run": "profiles.csv"}[command]
    found = []
    for out, files in {"apart": ("S1.mseed", "S2.mseed"), "together": ("both.mseed",)}.items():
        if command == "ida":
            tdint("ida", "one.yaml", *files, "--units", "m/s^2", "-o", out, code=0)
            (function,) = rows(tdint("fragility", out, "--threshold", "1%", code=0).stdout)
            assert function["motions"] == "2"
        else:
            options = ("--units", "m/s^2", "--scale", "1,2", "-o", out)
            tdint("run", "one.yaml", *files, *options, code=0)
        found.append(
            [
                {name: value for name, value in row.items() if name not in ("record", "component")}
                for row in rows((folder / out / table).read_text())
            ]
        )
    assert found[0] == found[1]


def drift_means(runs, combine):
    """Return the mean over motions of the drift ratios of each pair, combined by `combine`, from a
    table of runs (one story) with consecutive rows for the components of a pair."""
    drifts = [float(row["peak_drift_ratio"]) for row in runs]
    return np.mean([combine(drifts[i : i + 2]) for i in range(0, len(drifts), 2)])


ONE_STORY = """\
name: one
stories:
  - {mass: 10, height: 3, stiffness: 3000, law: {type: bilinear, yield_force: 20, hardening: 0.05}}
damping: none
analysis: {method: newmark-average}
"""


@pytest.fixture(scope="module")
def matched_files():
    """Return the files of the matched pairs by name, empty before the first test that uses them."""
    return {}


@pytest.fixture
def suite(folder, tdint, matched_files):
    """Change to a directory with three matched pairs and a building with a single story. The pairs
    are matched for the first test and reused, because matching needs seconds."""
    (folder / "one.yaml").write_text(ONE_STORY, encoding="utf-8")
    (folder / "in").mkdir()
    for seed, (name, event) in enumerate((("A", "Loma Prieta"), ("B", "Kobe"), ("C", "Duzce"))):
        write_pair(folder / "in", name, event, seed, sizes=(1.0, 0.4))
    if not matched_files:
        tdint(*["match", "in", "--pairs", "rotd100", "-o", "m"], *TARGET.split(), code=0)
        matched_files.update({file.name: file.read_bytes() for file in (folder / "m").iterdir()})
    (folder / "m").mkdir(exist_ok=True)
    for name, data in matched_files.items():
        (folder / "m" / name).write_bytes(data)
    return folder


@pytest.mark.parametrize(
    ("demand", "combine"), [("larger", max), ("mean", np.mean), ("separate", None)]
)
@pytest.mark.long
def test_a_limit_of_matched_pairs_uses_the_specified_demand(suite, tdint, demand, combine):
    """This is the unsafe case: the average over separate components meets a limit that the average
    of the larger components exceeds."""
    runs = rows(tdint("run", "one.yaml", "m", code=0).stdout)
    assert len(runs) == 6
    expected = drift_means(runs, combine or np.mean)
    means = {
        name: drift_means(runs, combination)
        for name, combination in (("larger", max), ("mean", np.mean))
    }
    between = 100.0 * np.mean(list(means.values()))
    assert means["larger"] > 1.05 * means["mean"]
    result = tdint("run", "one.yaml", "m", "--limit", f"{between}%", "--pair-demand", demand)
    assert f"{100.0 * expected:.3g} %" in result.stderr
    assert ("exceeded" in result.stderr) == (demand == "larger")
    assert f"pair_demand: {demand}" in result.stderr
    # Without an explicit choice the larger component counts.
    result = tdint("run", "one.yaml", "m", "--limit", f"{between}%", "--require", code=5)
    (line,) = [line for line in result.stderr.splitlines() if "pair_demand" in line]
    assert "3 pairs" in line and "larger" in line


def test_tables_contain_the_demand_of_pairs(suite, tdint):
    for demand, combine, count in (("larger", max, 3), ("mean", np.mean, 3), ("separate", None, 6)):
        call = ("run", "one.yaml", "m", "-o", demand, "--pair-demand", demand, "--no-check")
        tdint(*call, code=0)
        runs = rows((suite / demand / "runs.csv").read_text())
        profile = [
            row
            for row in rows((suite / demand / "profiles.csv").read_text())
            if row["quantity"] == "peak_drift_ratio"
        ]
        assert [row["pair_demand"] for row in profile] == [demand]
        assert int(profile[0]["runs"]) == count
        expected = drift_means(runs, combine or np.mean)
        assert float(profile[0]["mean"]) == pytest.approx(expected, rel=1e-9)


def test_a_pair_demand_without_pairs_is_refused(suite, tdint):
    tdint.refused(
        "the records contain no pairs",
        *["run", "one.yaml", "m/A067.mseed", "m/B067.mseed", "--pair-demand", "mean"],
    )
    tdint.refused("has no effect", *["run", "one.yaml", "m/A067.mseed", "--pair-demand", "mean"])


@pytest.mark.long
def test_text_and_figure_of_a_report_have_the_same_average(suite, tdint, monkeypatch):
    """The pairs were scaled as pairs and are run as separate files."""

    drawn = []
    draw = studies.scaling_figures.suite_picture
    monkeypatch.setattr(
        studies.scaling_figures,
        "suite_picture",
        lambda *arguments: drawn.append(arguments[0]) or draw(*arguments),
    )
    scale = "scale m --pairs rotd100 --rule ec8 --target ec8:type=1,soil=B,ag=0.25g --at 1"
    tdint(*scale.split(), "-o", "factors.csv", code=0)
    settings = json.loads((suite / "factors.json").read_text())["settings"]
    call = "run one.yaml m --factors factors.csv --report page.html"
    tdint(*call.split(), code=0)
    (scaling,) = drawn
    assert len(scaling.motions) == 3
    average = np.mean(scaling.spectra(scaling.periods), axis=0)
    least = np.min(average / scaling.target.at(scaling.periods))
    assert least == pytest.approx(settings["least_average_over_target"], rel=2e-3)
    text = Page((suite / "page.html").read_text("utf-8")).text
    assert f"{100.0 * settings['least_average_over_target']:.3g} %" in text
    assert "with the larger demand of its two components." in text


@pytest.mark.long
def test_capacities_of_pairs(suite, tdint):
    """Each pair has one capacity: with the larger demand the smaller capacity of its components,
    with the mean demand a value between them. Fragility functions state the rule."""
    call = "ida one.yaml m --threshold 0.5%,1% --max-im 3g"
    tables = {}
    for demand in ("larger", "mean", "separate"):
        choice = ("--pair-demand", demand, "--pairs", "geometric-mean")
        tdint(*call.split(), *choice, "-o", demand, code=0)
        tables[demand] = rows((suite / demand / "capacities.csv").read_text())
        assert {row["pair_demand"] for row in tables[demand]} == {demand}
        fitted = rows(tdint("fragility", demand, code=0).stdout)
        assert {row["pair_demand"] for row in fitted} == {demand}
        assert {row["motions"] for row in fitted} == {"3"}
        assert {row["runs"] for row in fitted} == {"6" if demand == "separate" else "3"}
    apart: dict[tuple[str, str], list[float]] = {}
    for row in tables["separate"]:
        key = row["record"].replace("067", "?").replace("337", "?"), row["threshold"]
        apart.setdefault(key, []).append(float(row["capacity"]))
    assert all(len(capacities) == 2 for capacities in apart.values())
    for demand in ("larger", "mean"):
        assert len(tables[demand]) == len(apart)
        for row in tables[demand]:
            key = row["record"].replace("067", "?").replace("337", "?"), row["threshold"]
            capacity, (low, high) = float(row["capacity"]), sorted(apart[key])
            assert row["component"] == "337+67"
            if demand == "larger":
                assert capacity == pytest.approx(low, rel=1e-9)
            else:
                assert low * (1.0 - 1e-9) <= capacity <= high * (1.0 + 1e-9)
    # Without a choice the larger demand counts, which one line reports.
    result = tdint(*call.split(), code=0)
    (line,) = [line for line in result.stderr.splitlines() if "pair_demand" in line]
    assert "3 pairs" in line and rows(result.stdout) == tables["larger"]
    # The summary counts the components, their recordings and the pairs.
    assert re.search(r": 6 components, 3 recordings, 3 pairs, \d+ runs with ", result.stderr)


def test_the_mean_curve_of_a_pair_equals_the_analytical_curve():
    """The mean of two straight lines through the origin is a line with the mean slope."""
    record = Record(np.ones(10), 0.01, "", "", "", "")
    curves = []
    for slope in (0.01, 0.03):
        levels = np.geomspace(0.1, 1.0, 6 if slope == 0.01 else 8)
        runs = [IdaRun(im, 1.0, "done", slope * im) for im in levels]
        curves.append(IdaCurve(record, tuple(runs), 0.1))
    mean = PairCurve.combine_components(*curves, "mean")
    assert mean.capacity(0.01).capacity == pytest.approx(0.5, rel=1e-9)
    assert mean.capacity(0.001).capacity == pytest.approx(0.05, rel=1e-9)
    assert PairCurve.combine_components(*curves, "larger").capacity(0.01).capacity == pytest.approx(
        1.0 / 3.0
    )
    assert mean.collapse.censored and mean.collapse.capacity == 1.0
