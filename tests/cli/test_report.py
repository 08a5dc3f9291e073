"""The page of --report: a single well-formed file without external resources, with the values of
the tables."""

import base64
import hashlib
import json
import os
import re
import shutil
import subprocess
import zlib
from collections.abc import Iterator
from html.parser import HTMLParser
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from matplotlib.image import imread

from cli.conftest import WITHOUT_LAW, Command, change, write_record
from csv_rows import rows
from selection import every
from tdint.ground_motion.horizontals import Horizontals
from tdint.ground_motion.reading.suites import suite_motions
from tdint.ground_motion.record import Record
from tdint.output.spectrum_text import spectrum_text
from tdint.studies.campaign.assigned_motions import FactorTable
from tdint.studies.campaign.suite_report import _scaled_motions

CONFIGS, RECORDS = (Path(__file__).parents[2] / name for name in ("configs", "records"))
EMPTY = {"meta", "img", "br"}


class Page(HTMLParser):
    """Parser of a page: cells of all tables, sources of images, and all text. Elements must be
    closed in order."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.open: list[str] = []
        self.sources: list[str] = []
        self.tables: list[list[list[str]]] = []
        self.text = ""
        self.source = text
        self.feed(text)
        self.close()
        assert self.open == []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        attributes = dict(attrs)
        assert not {"href", "onload", "action"} & set(attributes) and tag not in (
            "script",
            "link",
            "iframe",
        )
        if "src" in attributes:
            self.sources.append(attributes["src"] or "")
        if tag not in EMPTY:
            self.open.append(tag)
        if tag == "table":
            self.tables.append([])
        elif tag == "tr":
            self.tables[-1].append([])
        elif tag in ("td", "th"):
            self.tables[-1][-1].append("")

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        data = data.replace("\u00a0", " ")
        self.text += data
        if "table" in self.open and self.open[-1] in ("td", "th"):
            self.tables[-1][-1][-1] += data


def page(file: str) -> Page:
    text = Path(file).read_text(encoding="utf-8")
    assert text.startswith("<!DOCTYPE html>") and "@page { size: A4" in text
    parsed = Page(text)
    for source in parsed.sources:
        media_type, _, data = source.partition(";base64,")
        content = base64.b64decode(data, validate=True)
        assert (media_type, content[:5]) in (
            ("data:image/svg+xml", b"<?xml"),
            ("data:image/png", b"\x89PNG\r"),
        )
    assert "://" not in re.sub(
        r"<style>.*?</style>", "", re.sub(r'src="[^"]*"', "", text), flags=re.DOTALL
    )
    assert len(text) < 600_000
    return parsed


def table_with(found: Page, *headings: str) -> list[dict[str, str]]:
    (table,) = [cells for cells in found.tables if {*headings} <= {*cells[0]}]
    return [dict(zip(table[0], cells, strict=True)) for cells in table[1:]]


def test_the_page_of_a_run(folder: Path, tdint: Command, drawn: None) -> None:
    """Special characters in the name of the model cannot change the page."""
    change("shaken.yaml", ("name: shaken", "name: '<script>alert(1)</script> & \"co\"'"))
    result = tdint("run", "shaken.yaml", "--check", "--report", "page.html", code=0)
    found = page("page.html")
    stories = rows(result.stdout)
    peak_rows, error_rows = (table_with(found, f"peak drift{name} (%)") for name in (" ratio", ""))
    for shown, errors, row in zip(peak_rows, error_rows, stories, strict=True):
        drift = float(row["peak_drift_m"])
        assert shown["peak drift (m)"] == f"{drift:.4g}"
        assert shown["peak drift ratio (%)"] == f"{100.0 * float(row['peak_drift_ratio']):.4g}"
        assert errors["story"] == row["story"]
        for name in ("peak_drift", "residual_drift"):
            percent = 100.0 * float(row[f"{name}_m_error"]) / drift
            # The table has two digits.
            assert float(errors[f"{name.replace('_', ' ')} (%)"]) == pytest.approx(
                percent, rel=0.06
            )
    mode = rows(tdint("modes", "shaken.yaml").stdout)[0]
    period, damping = float(mode["period_s"]), float(mode["damping"])
    assert f"first period {period:.4g} s with {100.0 * damping:.3g} % damping" in found.text
    for file in ("shaken.yaml", "motion.mseed"):
        assert hashlib.sha256(Path(file).read_bytes()).hexdigest() in found.text
    assert len(found.sources) == 3
    for text in (
        "Torsion, floor flexibility",
        "Time integration",
        "newmark-average",
        "tdint 0.",
        '<script>alert(1)</script> & "co"',
    ):
        assert text in found.text, text


def test_the_page_of_several_runs(folder: Path, tdint: Command) -> None:
    records = ("motion.mseed", "other.mseed", "--units", "m/s^2")
    result = tdint(
        "run shaken.yaml", *records, "-o", "out", "--limit", "2%", "--report", "page.html", code=0
    )
    found = page("page.html")
    assert (
        next(line for line in result.stderr.splitlines() if line.startswith("Mean drift"))
        in found.text
    )
    profiles = {(row["quantity"], row["story"]): row for row in rows("out/profiles.csv")}
    for row in table_with(found, "mean peak drift ratio (%)"):
        drift, shear = (profiles[name, row["story"]] for name in ("peak_drift_ratio", "peak_shear"))
        assert row["mean peak drift ratio (%)"] == f"{100.0 * float(drift['mean']):.4g}"
        assert row["max peak drift ratio (%)"] == f"{100.0 * float(drift['max']):.4g}"
        assert row["mean peak shear (kN)"] == f"{float(shear['mean']) / 1e3:.4g}"
        # Without P-delta and dashpots, total shears are omitted.
        assert "mean peak total shear (kN)" not in row
    assert [row["record"] for row in table_with(found, "pga (g)")] == ["motion.mseed"] * 2 + [
        "other.mseed"
    ]
    # A row for each motion, the largest drift first.
    runs = sorted(rows("out/runs.csv"), key=lambda row: -float(row["peak_drift_ratio"]))
    for shown, row in zip(table_with(found, "status"), runs, strict=True):
        assert (shown["record"], shown["component"], shown["status"]) == (
            row["record"],
            row["component"],
            "done",
        )
        assert shown["peak drift ratio (%)"] == f"{100.0 * float(row['peak_drift_ratio']):.4g}"


def test_the_verdict_of_a_run_is_the_first_result(folder: Path, tdint: Command) -> None:
    """The verdict contains limit, value and story, and has a color. With --require, it also
    determines the exit code of a single run."""
    change("shaken.yaml", WITHOUT_LAW)
    drifts = [
        float(row["peak_drift_ratio"]) for row in rows(tdint("run", "shaken.yaml", code=0).stdout)
    ]
    largest, story = max(drifts), drifts.index(max(drifts)) + 1
    for limit, is_met in ((1.01 * largest, True), (0.99 * largest, False)):
        call = (
            "run", "shaken.yaml", "--limit", f"{limit:.8f}", "--require", "--report",
            f"{is_met}.html",
        )  # fmt: skip
        result = tdint(*call, code=0 if is_met else 5)
        drift = f"{100.0 * largest:.3g} % (story {story})"
        message = f"Maximum drift ratio {drift}, limit {100.0 * limit:g} %: "
        assert message + ("met" if is_met else "exceeded") in result.stderr
        body = Path(f"{is_met}.html").read_text().partition("<body>")[2]
        verdict = body[body.index('<p class="v ') : body.index("<h2")]
        assert ("Limit met." if is_met else "Limit EXCEEDED.") in verdict
        assert f'class="v {"kept" if is_met else "broken"}"' in verdict


def test_a_collapse_is_the_headline(folder: Path, tdint: Command) -> None:
    """The report states a collapse with its story and time before the limit."""
    change("shaken.yaml", WITHOUT_LAW)
    table = rows(tdint("run", "shaken.yaml", code=0).stdout)
    drifts = [float(row["peak_drift_ratio"]) for row in table]
    text = Path("shaken.yaml").read_text() + f"collapse_drift: {0.5 * max(drifts):.6f}\n"
    Path("weak.yaml").write_text(text)
    tdint("run", "weak.yaml", "--limit", "90%", "--report", "weak.html", code=0)
    body = Path("weak.html").read_text().partition("<body>")[2]
    verdicts = re.findall(r'<p class="v ?(\w*)">(.*?)</p>', body)
    # A limit is not met after collapse.
    assert [color for color, _ in verdicts] == ["broken", "broken"]
    assert "collapsed" in verdicts[0][1] and "Limit" not in verdicts[0][1]
    assert re.search(r"story \d .* [0-9.]+\ss", verdicts[0][1])


def test_targets_are_printed_with_the_symbols_of_the_code() -> None:
    """Parameters have their symbols and units; files and unknown texts are unchanged."""
    expected = {
        "asce7:sds=1.0,sd1=0.6,tl=8": "ASCE 7, SDS = 1.0 g, SD1 = 0.6 g, TL = 8 s",
        "ec8:type=1,soil=C,ag=0.25g": "EN 1998-1, type 1, soil C, ag = 0.25 g",
        "ec8:type=2,soil=B,ag=1.9613300m/s^2": "EN 1998-1, type 2, soil B, ag = 0.2 g",
        "spectra/site.csv": "spectra/site.csv",
        "c:site.csv": "c:site.csv",
    }
    assert {source: spectrum_text(source) for source in expected} == expected


@pytest.mark.long
def test_the_page_of_a_scaled_suite_shows_the_scaled_motions(folder: Path, tdint: Command) -> None:
    call = "run shaken.yaml motion.mseed --component HNE --units m/s^2 --scale 0.5,2 -o"
    tdint(call, "out", "--report", "page.html", code=0)
    found = page("page.html")
    record_rows = [
        dict(zip(*table[:2], strict=True)) for table in found.tables if "scale" in table[0]
    ]
    assert [row["scale"] for row in record_rows] == ["0.5", "2"]
    peaks = [float(row["pga_m_s2"]) / 9.80665 for row in rows("out/runs.csv")]
    assert [row["pga (g)"] for row in record_rows] == [f"{peak:.4g}" for peak in peaks]
    # The spectra of the second level are a multiple of those of the first level.
    assert "Level 1 of 2, times 0.5:" in found.text and "Level 2 of 2, times 2:" in found.text
    assert re.findall(r"5 % damping, times [0-9.]+", found.text) == ["5 % damping, times 0.5"]
    assert len(found.sources) == 2  # profiles and spectra


@pytest.mark.long
def test_a_page_uses_the_units_and_the_head_of_the_model(folder: Path, tdint: Command) -> None:
    text = (
        "name: twin\nunits: {length: m, force: kN, mass: t}\nreport: 'Project: tower; Author: A. "
        "B.'\n"
        "stories: [{repeat: 2, mass: 200, height: 3.5, stiffness: 2.0e5}]\ndamping: 5%\n"
        "excitation: {record: {file: motion.mseed, component: HNE, units: m/s^2}}\n"
        "analysis: {method: newmark-average}\n"
    )
    Path("kilo.yaml").write_text(text)
    stories = rows(tdint("run", "kilo.yaml", "--report", "page.html", code=0).stdout)
    found = page("page.html")
    assert "Project: tower" in found.text and "Author: A. B." in found.text
    # Equal stories are one row.
    (equal,) = table_with(found, "story", "law")
    assert list(equal.values()) == ["1 to 2", "200", "3.5", "200000", "linear"]
    shears = [f"{float(row['peak_total_shear_N']) / 1e3:.4g}" for row in stories]
    assert [
        row["peak total shear (kN)"] for row in table_with(found, "peak total shear (kN)")
    ] == shears
    # Base shear of the restoring forces, and base shear from equilibrium, which includes Rayleigh
    # damping
    restoring = float(stories[0]["peak_shear_N"]) / 1e3
    assert (
        f"base shear {restoring:.4g} kN (restoring force; {shears[0]} kN with viscous forces)"
        in found.text
    )
    tdint("run", "kilo.yaml", "--report", "us.html", "--output-units", "kip,in", code=0)
    found = page("us.html")
    assert table_with(found, "peak total shear (kip)")
    (equal,) = table_with(found, "story", "law")
    assert float(equal["stiffness (kip/in)"]) == pytest.approx(
        2e8 * 0.0254 / 4448.2216152605, rel=1e-3
    )
    Path("kilo.yaml").write_text(text.replace("Project: tower", "tower"))
    tdint.refused("kilo.yaml:3:9: report", "run", "kilo.yaml", "-q", code=3)


@pytest.mark.parametrize(
    ("p_delta", "damping", "forces"),
    every(
        2,
        [
            (True, "5%", "P-delta and viscous forces"),
            (True, "none", "P-delta"),
            (False, "5%", "viscous forces"),
            (False, "none", ""),
        ],
    ),
)
def test_base_shear_is_the_restoring_force_and_words_state_what_the_total_contains(
    folder: Path, tdint: Command, p_delta: bool, damping: str, forces: str
) -> None:
    Path("tower.yaml").write_text(
        f"name: tower\nunits: {{length: m, force: kN, mass: t}}\np_delta: {str(p_delta).lower()}\n"
        f"stories: [{{mass: 200, height: 3.5, stiffness: 2.0e4}}]\ndamping: {damping}\n"
    )
    arguments = ("motion.mseed", "--component", "HNE", "--units", "m/s^2")
    result = tdint("run", "tower.yaml", *arguments, "--report", "page.html", "-o", "out", code=0)
    (story,) = rows("out/stories.csv")
    peaks = json.loads(Path("out/summary.json").read_text())["peaks"]
    restoring, total = (float(story[name]) for name in ("peak_shear_N", "peak_total_shear_N"))
    assert (peaks["base_shear_N"], peaks["total_base_shear_N"]) == (restoring, total)
    # Without P-delta and dashpots, the terminal states the base shear only.
    terminal = f" ({total:.4g} N with {forces})" if p_delta else ""
    assert f"base shear {restoring:.4g} N{terminal}.\n" in result.stderr
    found = page("page.html")
    words = f" (restoring force; {total / 1e3:.4g} kN with {forces})" if forces else ""
    assert f"base shear {restoring / 1e3:.4g} kN{words}." in found.text
    if p_delta and damping == "none":
        # Equilibrium of the story: the weight on its drift reduces the force on the floor.
        drift = float(story["peak_drift_m"])
        assert restoring - total == pytest.approx(2e5 * 9.80665 * drift / 3.5, rel=1e-3)


def test_the_figure_of_a_collapse_states_the_peak_of_the_record(
    folder: Path, tdint: Command, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The run ends before the peak of the record; the figure states both peaks."""
    from tdint.output.figures import runs

    notes: list[str] = []
    monkeypatch.setattr(runs, "write_note", lambda axes, text, **_: notes.append(text))
    scaled = ("--component", "HN1", "--scale", "12", "-o", "out", "--plot")
    result = tdint(
        "run", CONFIGS / "collapse-prone-frame.yaml", RECORDS / "near-fault.mseed", *scaled, code=0
    )
    assert "analysis stopped" in result.stderr
    (pga,) = re.findall(r"PGA (\S+) m/s", result.stderr)
    (note,) = [text for text in notes if "PGA" in text]
    peaks = re.fullmatch(r"peak (\S+) g at \S+ s, PGA (\S+) g later", note)
    assert peaks
    early, late = map(float, peaks.groups())
    assert late == pytest.approx(float(pga) / 9.80665, rel=2e-3) and early < 0.9 * late


@pytest.mark.long
def test_the_page_of_a_campaign_explains_selection_and_limits(folder: Path, tdint: Command) -> None:
    # The rule requires at least three ground motions. The factor of a strong motion is unusual.
    names = ("motion.mseed", "second.mseed", "third.mseed")
    for name, peak in zip(names[1:], (2.0, 60.0), strict=True):
        write_record(folder / name, "HNE", "HNN", peak=peak)
    scaled = tdint(
        "scale",
        *names,
        "--units",
        "m/s^2",
        "--pairs",
        "geometric-mean",
        "--rule",
        "ec8",
        "--at",
        "0.5",
        "--target",
        "ec8:type=1,soil=B,ag=0.25g",
        "-o",
        "factors.csv",
        code=0,
    )
    warnings = json.loads(Path("factors.json").read_text())["warnings"]
    assert warnings and all(text in scaled.stderr for text in warnings)
    Path("stiff.yaml").write_text(
        Path("shaken.yaml").read_text().replace("name: shaken", "name: stiff")
    )
    Path("study.yaml").write_text(
        "buildings: {models: [shaken.yaml, stiff.yaml]}\nintensity: {factors: factors.csv}\n"
        f"records: {{files: [{', '.join(names)}], units: m/s^2, pairs: true}}\n"
        "analysis: {check: true}\n"
    )
    call = (
        "campaign", "study.yaml", "--limit", "2%", "--baseline", "shaken",
        "--floor-spectra", "roof",
    )  # fmt: skip
    call = (*call, "--floor-period", "0.5")
    tdint.refused(
        "NAME: TEXT", *call, "-o", "out", "--report", "page.html", "--report-head", "no name"
    )
    tdint(*call, "-o", "out", "--report", "page.html", "--report-head", "Date: 2026-01-31", code=0)
    found = page("page.html")
    assert "Date: 2026-01-31" in found.text
    for text in (
        *warnings,
        "12 of 12 runs",
        "rule ec8 (EN 1998-1:2004",
        "target EN 1998-1, type 1, soil B, ag = 0.25 g",
        "mean, maximum, limit 2 %",
    ):
        assert text in found.text, text
    for file in (
        "study.yaml",
        "shaken.yaml",
        "stiff.yaml",
        "motion.mseed",
        "factors.csv",
        "factors.json",
    ):
        digest = hashlib.sha256(Path(file).read_bytes()).hexdigest()
        assert [row["SHA-256"] for row in table_with(found, "SHA-256") if row["file"] == file] == [
            digest
        ], file
    assert len(found.sources) == 4  # profiles, ratios, floor spectra, motions with the target
    # The same building twice: all ratios are 1, and the means of both are equal in each story.
    (ratios,) = [table for table in found.tables if table[0] == ["quantity", "stiff"]]
    assert len(ratios) > 5 and {row[1] for row in ratios[1:]} == {"1"}
    means = [row for row in rows("out/profiles.csv") if row["quantity"] == "peak_drift_ratio"]
    drifts = table_with(found, "shaken (%)", "story")
    assert (
        [row["shaken (%)"] for row in drifts]
        == [row["stiff (%)"] for row in drifts]
        == [f"{1e2 * float(row['mean']):.4g}" for row in means if row["building"] == "shaken"]
    )
    # The first building has a table; the other is compared with it.
    assert "Building: shaken" in found.text and "Stories as of shaken." in found.text
    assert "Building: stiff" in found.text
    # The largest estimated error of the runs, with two digits
    (error,) = re.findall(r"largest estimated error of a maximum drift is ([0-9.]+) %", found.text)
    errors = [
        float(row["peak_drift_m_error"]) / float(row["peak_drift_m"])
        for row in rows("out/runs.csv")
    ]
    assert 0.0 < float(error) < 5.0
    assert float(error) == pytest.approx(1e2 * max(errors), rel=0.06)
    assert found.text.count("Torsion, floor flexibility") == 1
    assert "Scale factors: factors.csv, computed by tdint scale; rule ec8" in found.text
    # For factors that were edited, the report repeats only the columns of the table.
    with Path("factors.csv").open("a") as stream:
        stream.write("another.mseed,,2\n")
    tdint(*call, "-o", "changed", "--report", "changed.html", code=0)
    changed = page("changed.html")
    assert (
        "Scale factors: factors.csv, with the rule and target of its columns; rule ec8 (EN "
        "1998-1:2004, 3.2.3.1.2); target EN 1998-1, type 1, soil B, ag = 0.25 g." in changed.text
    )
    assert not [text for text in warnings if text in changed.text]
    # Without these columns, nothing is known.
    table = rows("factors.csv")
    Path("factors.csv").write_text(
        "record,component,factor\n"
        + "".join(f"{row['record']},{row['component']},{row['factor']}\n" for row in table)
    )
    tdint(*call, "-o", "bare", "--report", "bare.html", code=0)
    assert "the method of scaling is unknown" in page("bare.html").text


@pytest.mark.long
def test_the_page_of_a_pushover_reports_unmet_targets(folder: Path, tdint: Command) -> None:
    target = "ec8:type=1,soil=C,ag=0.35g"
    call = ("pushover", CONFIGS / "collapse-prone-frame.yaml", "--target", target, "-o", "t.csv")
    tdint(*call, "--report", "page.html", code=0)
    found = page("page.html")
    drifts = [f"{1e2 * float(row['drift_ratio']):.4g}" for row in rows("t.csv")]
    assert [row["drift ratio (%)"] for row in table_with(found, "ductility")] == drifts
    (n2, coefficients) = json.loads(Path("t.json").read_text())["targets"]
    # The table of the stories has yield forces as well.
    oscillators = table_with(found, "yield force (kN)", "participation")
    yield_forces = [row["yield force (kN)"] for row in oscillators]
    assert yield_forces == [
        f"{target_values['yield_force_N'] / 1e3:.4g}" for target_values in (n2, coefficients)
    ]
    body = Path("page.html").read_text().partition("<body>")[2]
    assert (
        body.count('class="v broken"') == 2 and "and cannot be met; do not use the computed" in body
    )
    assert len(found.sources) == 1


def test_the_page_of_modal_peaks_has_forces_and_the_share_of_each_mode(
    folder: Path, tdint: Command
) -> None:
    call = (
        "modes", CONFIGS / "ten-story-bilinear.yaml", "--target",
        "ec8:type=1,soil=C,ag=0.35g", "-o", "m.csv",
    )  # fmt: skip
    result = tdint(*call, "--report", "page.html", code=0)
    assert "5 % in the first mode, is ignored" in result.stderr
    found, peaks = page("page.html"), rows("m.csv")
    shown = table_with(found, "overturning moment cqc (kN·m)")
    assert [row["overturning moment cqc (kN·m)"] for row in shown] == [
        str(round(float(f"{float(row['overturning_moment_cqc_Nm']) / 1e3:.4g}"))) for row in peaks
    ]
    # The force of the roof is the shear of the top story, and its moment is shear times height.
    assert float(peaks[-1]["floor_force_cqc_N"]) == pytest.approx(
        float(peaks[-1]["shear_cqc_N"]), rel=1e-9
    )
    assert float(peaks[-1]["overturning_moment_cqc_Nm"]) == pytest.approx(
        3.5 * float(peaks[-1]["shear_cqc_N"])
    )
    acceleration = float(peaks[-1]["floor_force_cqc_N"]) / 2e5
    assert float(peaks[-1]["absolute_acceleration_cqc_m_s2"]) == pytest.approx(acceleration)
    modes = json.loads(Path("m.json").read_text())["modes"]
    assert sum(mode["base_shear_share"] for mode in modes) == pytest.approx(1.0)
    srss = sum(mode["base_shear_N"] ** 2 for mode in modes) ** 0.5
    assert srss == pytest.approx(float(peaks[0]["shear_srss_N"]))


def test_the_page_of_modes_requires_no_target(folder: Path, tdint: Command) -> None:
    table = rows(tdint("modes", "shaken.yaml", "--report", "page.html", code=0).stdout)
    found = page("page.html")
    periods = [f"{float(row['period_s']):.4g}" for row in table]
    assert [row["period (s)"] for row in table_with(found, "period (s)")] == periods
    assert f"First period {periods[0]} s" in found.text
    assert len(found.sources) == 2  # shapes, and the modes on the spectrum of the ground motion
    damping = [f"{100.0 * float(row['damping']):.4g}" for row in table]
    assert [row["damping (%)"] for row in table_with(found, "period (s)")] == damping
    assert "Response spectrum of motion.mseed HNE" in found.text


def test_the_page_of_a_comparison_states_the_requirements(folder: Path, tdint: Command) -> None:
    tdint("run", "shaken.yaml", "-o", "out", "--history", code=0)
    Path("recorded.yaml").write_text(
        "base: {file: out/history.csv, column: ground_acceleration_m_s2}\n"
        "floors: {roof: {file: out/history.csv, column: floor_2_absolute_acceleration_m_s2}}\n"
    )
    call = ("compare", "shaken.yaml", "--recorded", "recorded.yaml", "--require", "correlation=0.9")
    table = rows(tdint(*call, "--report", "page.html", code=0).stdout)
    found = page("page.html")
    (shown,) = table_with(found, "correlation")
    assert shown["correlation"] == f"{float(table[0]['correlation']):.4g}"
    assert "Required of every floor: correlation 0.9. Met." in found.text


# ---- As pages of paper

CHROMIUM = os.environ.get("CHROMIUM") or next(
    filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome", "chrome"))),
    None,
)
A4 = (595.3, 841.9)
"""Points."""


def check_fullness(file: str) -> None:
    """Check that on A4 each page of a report is full to 70 %, all pages but one and the last page
    to 80 %, and the last page to 15 %."""
    assert not re.search(r"\de[+-]\d", page(file).text)
    printed(file)
    subprocess.run(["pdftoppm", "-r", "40", "-png", "page.pdf", "sheet"], check=True)
    sheets = [imread(file) for file in sorted(Path().glob("sheet-*.png"))]
    fullness = []
    for sheet in sheets:
        mm = sheet.shape[0] / 297.0
        area = sheet[int(15 * mm) : int(278 * mm), :, :3]
        inked = np.flatnonzero((area.min(axis=2) < 0.8).any(axis=1))
        fullness.append(inked[-1] / (263 * mm))
    *pages, last = fullness
    assert last > 0.15 and min(pages, default=1.0) > 0.7, fullness
    assert sum(part <= 0.80 for part in pages) <= 1, fullness


def printed(file: str) -> list[tuple[str, float, float]]:
    """Return the printed lines of text, with the positions of their first and last characters in
    points from the left."""
    command = [CHROMIUM, "--headless", "--no-sandbox", "--disable-gpu", "--no-pdf-header-footer"]
    where = (
        f"--user-data-dir={Path('profile').absolute()}",
        f"--print-to-pdf={Path('page.pdf').absolute()}",
    )
    subprocess.run(
        [*command, *where, Path(file).absolute().as_uri()],
        check=True,
        capture_output=True,
        timeout=120,
    )
    objects = dict(
        re.findall(rb"(\d+) 0 obj\b(.*?)endobj", Path("page.pdf").read_bytes(), re.DOTALL)
    )
    pages = [body for body in objects.values() if re.search(rb"/Type /Page\b", body)]
    for body in pages:
        size = re.search(rb"/MediaBox \[0 0 (\S+) (\S+)\]", body)
        assert size and [float(length) for length in size.groups()] == pytest.approx(A4, abs=1.0)
    return [line for body in pages for line in lines_of_page(body, objects)]


def stream(body: bytes) -> bytes:
    head, _, body_part = body.partition(b"stream\n")
    content = body_part.rpartition(b"endstream")[0]
    return zlib.decompress(content) if b"FlateDecode" in head else content


def letters(font: bytes, objects: dict[bytes, bytes]) -> dict[bytes, str]:
    """Return the characters for the codes of a font, from its table ToUnicode."""
    reference = re.search(rb"/ToUnicode (\d+) 0 R", font)
    assert reference
    table, found = stream(objects[reference[1]]).decode("ascii"), {}
    for block in re.findall(r"beginbfchar(.*?)endbfchar", table, re.DOTALL):
        for code, to in re.findall(r"<(\w+)> *<(\w+)>", block):
            found[bytes.fromhex(code)] = bytes.fromhex(to).decode("utf-16-be")
    for block in re.findall(r"beginbfrange(.*?)endbfrange", table, re.DOTALL):
        for first, last, to in re.findall(r"<(\w+)> *<(\w+)> *<(\w+)>", block):
            for i in range(int(last, 16) - int(first, 16) + 1):
                found[(int(first, 16) + i).to_bytes(2, "big")] = chr(int(to, 16) + i)
    return found


def lines_of_page(body: bytes, objects: dict[bytes, bytes]) -> Iterator[tuple[str, float, float]]:
    """Return the texts between BT and ET, one per line or table cell, with the matrices of the page
    and the text."""
    named = re.search(rb"/Font <<(.*?)>>", body, re.DOTALL)
    fonts = {
        name: letters(objects[reference], objects)
        for name, reference in re.findall(rb"/(\w+) (\d+) 0 R", named[1])
    }
    content = re.search(rb"/Contents (\d+) 0 R", body)
    assert content
    word = rb"<[0-9A-Fa-f]+>|\((?:\\.|[^\\)])*\)|/[^\s<>\[\]/()]+|[-+]?[0-9.]+|[A-Za-z*]+"
    page_of, saved, operands = np.eye(3), [], []
    text, positions, table, at = "", [], {}, np.eye(3)
    for token in re.findall(word, stream(objects[content[1]])):
        if not re.fullmatch(rb"[A-Za-z*]+", token):
            operands.append(token)
            continue
        if token in (b"cm", b"Tm"):
            a, b, c, d, e, f = map(float, operands[-6:])
            matrix = np.array([[a, b, 0.0], [c, d, 0.0], [e, f, 1.0]])
            page_of, at = (matrix @ page_of, at) if token == b"cm" else (page_of, matrix)
        elif token == b"Td":
            at = (
                np.array([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [*map(float, operands[-2:]), 1.0]]) @ at
            )
        elif token == b"q":
            saved.append(page_of)
        elif token == b"Q":
            page_of = saved.pop()
        elif token == b"BT":
            text, positions, at = "", [], np.eye(3)
        elif token == b"Tf":
            table = fonts[operands[-2][1:]]
        elif token == b"Tj":
            codes = bytes.fromhex(operands[-1][1:-1].decode())
            text += "".join(table.get(codes[i : i + 2], "?") for i in range(0, len(codes), 2))
            positions.append(float((at @ page_of)[2, 0]))
        elif token == b"ET" and positions:
            yield text, positions[0], positions[-1]
        operands = []


@pytest.mark.slow
@pytest.mark.skipif(
    CHROMIUM is None or not shutil.which("pdftoppm"), reason="no Chromium or pdftoppm to print with"
)
@pytest.mark.parametrize(
    "arguments",
    [
        ("pushover", "collapse-prone-frame.yaml", "--target", "ec8:type=1,soil=C,ag=0.35g"),
        ("modes", "ten-story-bilinear.yaml", "--target", "ec8:type=1,soil=C,ag=0.35g"),
        ("run", "base-isolated.yaml"),
        ("run", "ten-story-bilinear.yaml"),
        ("run", "fluid-dampers.yaml"),
        ("run", "ten-story-bilinear.yaml", RECORDS / "firm-soil.mseed",
         RECORDS / "soft-soil.mseed", "--limit", "2%"),
        ("ida", "collapse-prone-frame.yaml", RECORDS / "firm-soil.mseed"),
    ],
)  # fmt: skip
def test_every_page_except_the_last_is_three_quarters_full(
    folder: Path, tdint: Command, drawn: None, arguments: tuple[str, ...]
) -> None:
    """Printed on A4, the content of each page reaches the lowest quarter of the printable area, and
    the last page is at least 15 % full."""
    tdint(
        arguments[0], CONFIGS / arguments[1], *arguments[2:], "-q", "--report", "page.html", code=0
    )
    check_fullness("page.html")


@pytest.mark.slow
@pytest.mark.skipif(CHROMIUM is None, reason="there is no Chromium to print with")
def test_a_page_prints_complete_numbers_within_its_margins(
    folder: Path, tdint: Command, drawn: None
) -> None:
    """Every cell with a number is a single text in the PDF, and no text exceeds the paper."""
    assert (
        tdint("run", "shaken.yaml", "--method", "moment4", "--report", "page.html").exit_code == 0
    )
    assert tdint("run shaken.yaml --scale 0.5,1 --check -o out --report suite.html").exit_code == 0
    for file in ("page.html", "suite.html"):
        lines = printed(file)
        found = page(file)
        assert all(len(table[0]) <= 9 for table in found.tables)
        pieces = {text for text, _, _ in lines}
        numbers = {
            cell
            for table in found.tables
            for row in table[1:]
            for cell in row
            if re.fullmatch(r"[-+.\de]+", cell)
        }
        assert len(numbers) > 20 and numbers <= pieces, numbers - pieces
        # Margins of 15 mm, 42 points
        assert all(left > 30.0 and last < A4[0] - 30.0 for _, left, last in lines)


def test_runs_without_drift_ratio_state_the_drift(folder: Path, tdint: Command) -> None:
    """In a suite of buildings with and without story heights, every completed run has a drift."""
    model = Path("shaken.yaml").read_text()
    bare = re.sub(r",? *height: [0-9.]+", "", model).replace("name: shaken", "name: bare")
    assert "height" in model and "height" not in bare
    Path("bare.yaml").write_text(bare)
    Path("study.yaml").write_text(
        "buildings: {models: [shaken.yaml, bare.yaml]}\n"
        "records: {files: [motion.mseed], units: m/s^2}\n"
    )
    tdint("campaign", "study.yaml", "-o", "out", "--report", "page.html", code=0)
    shown = table_with(page("page.html"), "status")
    ratio, length = "peak drift ratio (%)", next(name for name in shown[0] if "drift (" in name)
    for row in shown:
        assert bool(row[ratio].strip("–- ")) is (row["building"] == "shaken")
        assert float(row[length]) > 0.0


def test_components_that_are_no_pair_remain_single_in_the_suite() -> None:
    """If the components of a recording have different sampling intervals, both are shown."""
    samples = np.random.default_rng(0).standard_normal((2, 400))

    def shown(*intervals: float) -> list[object]:
        records = [
            Record(row, dt, "", f".S..{name}", name, f"A-{name}.txt")
            for row, dt, name in zip(samples, intervals, ("X", "Y"), strict=True)
        ]
        plan: Any = SimpleNamespace(motions=suite_motions(records))
        factors = FactorTable("", {}, by_motion={0: (2.0,), 1: (2.0,)})
        return [motion for motion, _ in _scaled_motions(plan, factors, paired=True)]

    (pair,) = shown(0.01, 0.01)
    assert isinstance(pair, Horizontals)
    assert [type(motion) for motion in shown(0.01, 0.02)] == [Record, Record]
