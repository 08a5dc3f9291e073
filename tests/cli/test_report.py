"""The page of --report: one file, well-formed, without anything from elsewhere, with the numbers of the tables."""

from __future__ import annotations

import base64
import csv
import hashlib
import io
import re
from collections.abc import Callable
from html.parser import HTMLParser
from pathlib import Path

import pytest
from click.testing import Result

Run = Callable[..., Result]

EMPTY = {"meta", "img", "br"}


class Page(HTMLParser):
    """The texts of the cells of all tables, the sources of pictures, and all text; every element is closed in order."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.open: list[str] = []
        self.sources: list[str] = []
        self.tables: list[list[list[str]]] = []
        self.text = ""
        self.feed(text)
        self.close()
        assert self.open == []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        given = dict(attrs)
        assert not {"href", "onload", "action"} & set(given) and tag not in ("script", "link", "iframe")
        if "src" in given:
            self.sources.append(given["src"] or "")
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
        self.text += data
        if "table" in self.open and self.open[-1] in ("td", "th"):
            self.tables[-1][-1][-1] += data


def page(file: str) -> Page:
    text = Path(file).read_text(encoding="utf-8")
    assert text.startswith("<!DOCTYPE html>") and "@page { size: A4" in text
    found = Page(text)
    for source in found.sources:
        kind, _, data = source.partition(";base64,")
        content = base64.b64decode(data, validate=True)
        assert (kind, content[:5]) in (("data:image/svg+xml", b"<?xml"), ("data:image/png", b"\x89PNG\r"))
    assert "://" not in re.sub(r"<style>.*?</style>", "", re.sub(r'src="[^"]*"', "", text), flags=re.DOTALL)
    assert len(text) < 600_000
    return found


def rows(text: str) -> list[dict[str, str]]:
    return list(csv.DictReader(io.StringIO(text)))


def table_with(found: Page, heading: str) -> list[dict[str, str]]:
    (table,) = [one for one in found.tables if heading in one[0]]
    return [dict(zip(table[0], cells, strict=True)) for cells in table[1:]]


def test_the_page_of_a_run(folder: Path, tdint: Run) -> None:
    result = tdint("run", "shaken.yaml", "--check", "--report", "page.html")
    assert result.exit_code == 0, result.stderr
    found = page("page.html")
    stories = rows(result.stdout)
    for told, row in zip(table_with(found, "peak drift (m)"), stories, strict=True):
        assert told["peak drift (m)"] == f"{float(row['peak_drift_m']):.4g}"
        assert told["peak drift error (m)"] == f"{float(row['peak_drift_m_error']):.4g}"
    mode = rows(tdint("modes", "shaken.yaml").stdout)[0]
    period, damping = float(mode["period_s"]), float(mode["damping"])
    assert f"first period {period:.4g} s with {100.0 * damping:.3g} % damping" in found.text
    assert hashlib.sha256(Path("shaken.yaml").read_bytes()).hexdigest() in found.text
    assert hashlib.sha256(Path("motion.mseed").read_bytes()).hexdigest() in found.text
    assert len(found.sources) == 2
    for words in ("no torsion", "Time integration", "newmark-average", "tdint 0."):
        assert words in found.text, words


def test_the_page_of_several_runs(folder: Path, tdint: Run) -> None:
    result = tdint(
        "run", "shaken.yaml", "motion.mseed", "other.mseed", "--units", "m/s^2", "-o", "out", "--limit", "2%",
        "--report", "page.html",
    )  # fmt: skip
    assert result.exit_code == 0, result.stderr
    found = page("page.html")
    said = next(line for line in result.stderr.splitlines() if line.startswith("Mean drift"))
    assert said in found.text
    profiles = {(row["quantity"], row["story"]): row for row in rows(Path("out/profiles.csv").read_text())}
    for row in table_with(found, "mean peak drift ratio"):
        wanted = profiles["peak_drift_ratio", row["story"]]
        assert row["mean peak drift ratio"] == f"{float(wanted['mean']):.4g}"
        assert row["max peak drift ratio"] == f"{float(wanted['max']):.4g}"
        shear = profiles["peak_total_shear", row["story"]]
        assert row["mean peak total shear (N)"] == f"{float(shear['mean']):.4g}"
    assert [row["record"] for row in table_with(found, "pga (m/s²)")] == ["motion.mseed"] * 2 + ["other.mseed"]


def test_the_page_of_a_campaign(folder: Path, tdint: Run) -> None:
    Path("study.yaml").write_text(
        "buildings: {models: [shaken.yaml]}\nrecords: {files: [motion.mseed], units: m/s^2, pairs: true}\n"
    )
    result = tdint("campaign", "study.yaml", "-o", "out", "--report", "page.html")
    assert result.exit_code == 0, result.stderr
    assert "2 of 2 runs" in page("page.html").text
    again = tdint("campaign", "export", "out", "--report", "other.html")
    assert again.exit_code == 2 and "--report is not for" in again.stderr


def test_names_cannot_write_into_the_page(folder: Path, tdint: Run) -> None:
    text = Path("shaken.yaml").read_text()
    Path("shaken.yaml").write_text("name: '<script>alert(1)</script> & \"co\"'\n" + re.sub("name:.*\n", "", text))
    assert tdint("run", "shaken.yaml", "--report", "page.html").exit_code == 0
    assert '<script>alert(1)</script> & "co"' in page("page.html").text


@pytest.mark.parametrize(
    ("options", "code", "message"),
    [(["--report", "page.pdf"], 2, "name it .html"), (["--report", "forced.yaml.html"], 6, "exists")],
)
def test_pages_that_are_not_written(folder, tdint, options, code, message):
    Path("forced.yaml.html").write_text("mine")
    result = tdint("run", "shaken.yaml", *options)
    assert result.exit_code == code and message in result.stderr


def test_the_page_of_a_scaled_suite_shows_the_motions_as_they_were_run(folder: Path, tdint: Run) -> None:
    given = ("run", "shaken.yaml", "motion.mseed", "--component", "HNE", "--units", "m/s^2", "--scale", "0.5,2", "-o")
    assert tdint(*given, "out", "--report", "page.html").exit_code == 0
    found = page("page.html")
    levels = [table for table in found.tables if "scale" in table[0]]
    told = [dict(zip(table[0], table[1], strict=True)) for table in levels]
    assert [row["scale"] for row in told] == ["0.5", "2"]
    runs = rows(Path("out/runs.csv").read_text())
    assert [row["pga (m/s²)"] for row in told] == [f"{float(row['pga_m_s2']):.4g}" for row in runs]
    assert "Level 1 of 2, times 0.5" in found.text and "5 % damping, times 2" in found.text
