"""All types of reports: printed pages, stated facts, and values."""

import json
import math
import re
import shlex
import shutil
from pathlib import Path
from typing import BinaryIO

import pytest
from matplotlib.figure import Figure
from matplotlib.text import Text

from cli.conftest import Command
from cli.report_kinds import EC8, KINDS, SPECTRUM, write_inputs
from cli.report_numbers import Known
from cli.report_numbers import printed as numbers_of
from cli.test_report import CHROMIUM, Page, check_fullness, page
from csv_rows import rows
from tdint.methods.catalogue import parse
from tdint.model.building import assemble
from tdint.model.config.model_file import load_model
from tdint.number_parsing import number_text
from tdint.output.figures.style import Picture
from tdint.output.report import MODEL_LIMITS
from tdint.output.spectrum_text import spectrum_text
from tdint.units import STANDARD_GRAVITY


def write_report(name: str, tdint: Command) -> str:
    """Write a report of the given type to page.html in the working directory and return the
    messages."""
    report = KINDS[name]
    write_inputs(Path())
    for line in report.before:
        tdint(*shlex.split(line), code=0)
    return tdint(*shlex.split(report.line), "--report", "page.html", code=report.code).stderr


@pytest.mark.slow
@pytest.mark.skipif(
    CHROMIUM is None or not shutil.which("pdftoppm"), reason="no Chromium or pdftoppm to print with"
)
@pytest.mark.parametrize("name", KINDS)
def test_pages_are_full(working_directory: Path, tdint: Command, drawn: None, name: str) -> None:
    """On A4, each page except the last is full to 70 %, at most one of them to less than 80 %, and
    the last page to 15 %."""
    write_report(name, tdint)
    check_fullness("page.html")


UNCHECKED = ("Assumptions", "Methods and assumptions", "Inputs", "Notes")
"""Chapters with numbers of publications, digests and messages."""


def sentences_and_cells(text: str) -> list[tuple[str, str, float]]:
    """Return the printed values of a report with their units, and the maximum of their column."""
    text = re.sub(
        r"<style>.*?</style>|<title>.*?</title>|<img[^>]*>|<p class=\"[hw]\">.*?</p>",
        "",
        text,
        flags=re.DOTALL,
    )
    found: list[tuple[str, str, float]] = []
    for chapter in re.split(r"<h2[^>]*>", text):
        title = chapter.partition("</h2>")[0]
        if title in UNCHECKED:
            continue
        for table in re.findall(r"<table.*?</table>", chapter, flags=re.DOTALL):
            heads = re.findall(r"<th[^>]*>(.*?)</th>", table)
            rows = [
                re.findall(r"<td[^>]*>(.*?)</td>", row)
                for row in re.findall(r"<tr>(.*?)</tr>", table)
            ]
            for column, head in enumerate(heads):
                unit = match[1] if (match := re.search(r"\((\S+)\)$", head)) else ""
                cells = [row[column] for row in rows if len(row) == len(heads)]
                values = [cell for cell in cells if re.fullmatch(r"-?[\d.]+", cell)]
                largest = max((abs(float(cell)) for cell in values), default=0.0)
                found += [(cell, unit, largest) for cell in values]
                other_cells = (cell for cell in cells if cell not in values)
                found += [(*pair, 0.0) for cell in other_cells for pair in numbers_of(cell)]
        text_part = re.sub(r"<table.*?</table>", "", chapter, flags=re.DOTALL)
        sentences = re.sub(r"<[^>]+>", " ", text_part).replace("&#x27;", "'").replace("&quot;", '"')
        found += [(*pair, 0.0) for pair in numbers_of(sentences)]
    return found


def figure_texts(figure: Figure) -> list[str]:
    """Return titles, notes and labels of a figure without the tick labels."""
    ticks = set()
    for axes in figure.axes:
        for axis in (axes.xaxis, axes.yaxis):
            for tick in (*axis.majorTicks, *axis.minorTicks):
                ticks |= {tick.label1, tick.label2}
    return [text.get_text() for text in figure.findobj(Text) if text not in ticks]


@pytest.fixture
def drawn_texts(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """Texts of all figures of a report; the list is filled when the figures are rendered."""
    texts: list[str] = []
    save = Picture.save

    def noted(self: Picture, figure: Figure, stream: BinaryIO) -> None:
        save(self, figure, stream)
        texts.extend(figure_texts(figure))

    monkeypatch.setattr(Picture, "save", noted)
    return texts


def known_numbers(name: str) -> Known:
    """Return the values in the outputs, the models and the records of a type of report."""
    outputs = [*Path("out").rglob("*"), *Path().glob("out[-.]*"), *Path("ida").glob("*.json")]
    models = [*(Path(f"{model}.yaml") for model in KINDS[name].models), *Path("models").glob("*")]
    known = Known(sorted(outputs), models)
    for record in Path().glob("*.mseed"):
        for component in ("HN1", "HN2"):
            known.add_record(record, component)
    for record in (*Path("pool").glob("*.AT2"), *Path("matched").glob("*.AT2")):
        known.add_record(record, None)
    if name == "pushover":
        targets = json.loads(Path("out.json").read_text(encoding="utf-8"))["targets"]
        known.add_pushover(Path("older.yaml"), targets[0]["roof_displacement_m"])
    if name.startswith("fragility"):
        known.add_functions(Path("out.csv"))
    if name == "region":
        known.add_region(Path("out"))
    if name == "campaign":
        known.add_means(Path("out/profiles.csv"), models)
    if "ida" in name:
        known.add_capacities(Path("out" if name == "ida" else "ida") / "capacities.csv")
    return known


MARKS = {"kip": [], "bilinear": [pytest.mark.long], "suite": [pytest.mark.long]}
"""Marks of the types of reports that are not slow."""
EXCEPTIONS = {
    "suite of many": {"16"},  # fractile, %
    "scaled suite": {"84"},
    "ida": {"16"},
    "pushover": {"1998", "2.24"},  # number of the standard; ASCE 41-17, eq. 7-32
    "fragility": {"95"},  # confidence, %
    "fragility of ida": {"95", "1969", "2022"},  # also the years of publications
    "compare": {"0.64", "1.52"},  # oscillation and displacement at the end, in messages
    # displacements at the end on two machines, in the warnings of the match
    "matched": {"1.53", "1.57", "1.67", "1.35", "0.331", "0.342", "64"},
    "collapse": {"0.0001"},  # "energy error below 0.0001"
    "isolated": {"2.395", "0.0001"},  # period with the secant stiffness; "below 0.0001 %"
    "suite of isolated": {"5"},  # damping ratio of the spectra
    "transfer functions": {"0.9951"},  # first natural frequency, Hz
}
"""Printed numbers that are not values of a table, by type of report."""


@pytest.mark.long
@pytest.mark.parametrize(
    "name", [pytest.param(kind, marks=MARKS.get(kind, [pytest.mark.slow])) for kind in KINDS]
)
def test_numbers_equal_the_numbers_of_the_tables(
    working_directory: Path, tdint: Command, drawn_texts: list[str], name: str
) -> None:
    """Headline, verdict, sentences, tables and texts of figures within their printed digits.

    Whole numbers below 100 without unit are numbers of stories, modes and runs."""
    write_report(name, tdint)
    if name == "region":
        # The models of the buildings, which the campaign generates.
        rules = "--rules capacity --classes classes.csv --units m"
        tdint(*f"inventory region.csv {rules} --models models -o stories.csv".split(), code=0)
    known = known_numbers(name)
    numbers = sentences_and_cells(page("page.html").source)
    drawn = [(*pair, 0.0) for text in drawn_texts for pair in numbers_of(text)]
    assert len(numbers) > 40 and len(drawn) > 1
    unknown = [
        number
        for number in (*numbers, *drawn)
        if not known.holds(*number)
        and number[0].lstrip("-") not in EXCEPTIONS.get(name, ())
        and not (number[1] == "" and re.fullmatch(r"\d\d?", number[0]))
    ]
    assert not unknown, str(unknown)


def test_a_number_that_is_in_no_table_is_detected(working_directory: Path) -> None:
    Path("out").mkdir()
    Path("out/stories.csv").write_text("story,peak_shear_N,peak_drift_m\n1,8897123,0.54312\n")
    known = Known(Path("out").iterdir(), ())
    found = sentences_and_cells("<p>base shear 8897 kN, 8847 kN; 543.1 mm, 543.2 mm</p>")
    assert [known.holds(*number) for number in found] == [True, False, True, False]


@pytest.mark.long
def test_thresholds_of_a_study_are_drift_ratios(working_directory: Path, tdint: Command) -> None:
    """Thresholds of a table of another program can have any unit."""
    assert "Drift ratio 1 %: ida" in write_report("fragility of ida", tdint)
    shutil.copy("ida/capacities.csv", "table.csv")
    assert "Threshold 0.01: ida" in tdint("fragility", "table.csv", code=0).stderr


# ---- Facts that the printed pages state

WITHOUT_MOTION = ("pushover", "modes under a target")
FROM_ELSEWHERE = "fragility"
"""Kind whose table states neither building nor ground motions."""


def matching_rows(found: Page, *names: str) -> list[dict[str, str]]:
    """Return the rows of all tables with these columns."""
    tables = [table for table in found.tables if set(names) <= set(table[0])]
    return [dict(zip(table[0], row, strict=False)) for table in tables for row in table[1:]]


def check_building(found: Page, name: str) -> None:
    """Name, number of stories and first period of each building."""
    for file in KINDS[name].models:
        model = load_model(f"{file}.yaml")
        omega, damping = assemble(model).first_mode()
        assert model.name in found.text
        assert f"{len(model.stories)} stories" in found.text
        assert f"first period {number_text(2.0 * math.pi / omega)} s" in found.text
        if not name.startswith("fragility"):
            assert f"{100.0 * damping:.3g} % damping" in found.text
            # Properties that all stories have in common have one row for a range of stories.
            stories = {
                row[table[0].index("story")]
                for table in found.tables
                if "story" in table[0]
                for row in table[1:]
            }
            assert {str(story) for story in range(1, len(model.stories) + 1)} <= stories
            cells = " ".join(cell for table in found.tables for row in table for cell in row)
            assert {story.law.name for story in model.stories} <= set(
                re.findall(r"[\w-]+", f"{found.text} {cells}")
            )
    if name == "region":
        buildings = {row["building"] for row in rows("out/runs.csv")}
        assert all(f"Building: {building}" in found.text for building in buildings)


def check_motions(found: Page, name: str) -> None:
    """File, component and scale factor of each ground motion; transfer functions have none."""
    if name == "transfer functions":
        return
    stated = {
        (row["record"], row["component"], row.get("scale", row.get("factor", "")))
        for row in matching_rows(found, "record", "component")
    }
    runs = Path("out/runs.csv")
    if runs.exists():
        for row in rows(runs):
            scale = f"{float(row['scale']):.4g}"
            assert (Path(row["record"]).name, row["component"], scale) in stated
    elif name in WITHOUT_MOTION:
        assert spectrum_text({"pushover": EC8}.get(name, SPECTRUM)) in found.text
    elif name == "compare":
        assert "firm-soil.mseed HN1" in found.text and "unscaled" in found.text
    elif len(KINDS[name].models) == 1 and "ida" not in name:
        # A single run, or modes with the ground motion of the model.
        source = load_model(f"{KINDS[name].models[0]}.yaml").excitation.record
        file = Path(source.file).name if source else "firm-soil.mseed"
        scale = "3" if "--scale 3" in KINDS[name].line else "1"
        assert (file, "HN1", scale) in stated
    else:
        expected = [item["file"] for item in json.loads(summary_of(name))["records"]]
        assert expected and {Path(file).name for file in expected} <= {
            motion[0] for motion in stated
        }


def summary_of(name: str) -> str:
    """Return the summary of a run, of a study, or of the study that a fit reads."""
    candidates = ("out/summary.json", "out/ida.json", "ida/ida.json")
    (file,) = [Path(candidate) for candidate in candidates if Path(candidate).exists()]
    return file.read_text(encoding="utf-8")


def check_limits(found: Page) -> None:
    """Each limit with its demand, its ratio and whether it is met."""
    limits = json.loads(summary_of(""))["limits"]
    stated = matching_rows(found, "demand/limit", "result")
    assert len(stated) == len(limits) > 0
    for limit in limits:
        quantity = limit["quantity"]
        ratio = number_text(limit["limit_ratio"], unlike=1.0)
        result = "met" if limit["met"] else "exceeded"
        matching = [
            row
            for row in stated
            if (row["quantity"], row["demand/limit"], row["result"].partition(": ")[0])
            == (quantity.replace("_", " "), ratio, result)
            # Only a result that does not follow from the ratio has a reason.
            and (": " in row["result"]) == (limit["limit_ratio"] <= 1.0 and not limit["met"])
            and row.get("level", "-") in (limit.get("level", "-"), "-")
        ]
        assert matching, limit
        (value,) = [limit[key] for key in limit if key.startswith(f"{quantity}_limit")]
        unit = {"%": 0.01, "m": 1.0, "g": STANDARD_GRAVITY}
        number, _, label = matching[0]["limit"].partition(" ")
        assert float(number) * unit[label] == pytest.approx(value, rel=1e-3)


def check_method(found: Page, name: str) -> None:
    """Method with its publication, time step, and the errors or their absence."""
    methods = {
        "campaign": ["newmark-average"], "region": ["newmark-average"], "pushover": [],
        "modes": [], "modes under a target": [], "transfer functions": [],
    }.get(name, ["impulse4"])  # fmt: skip
    for method in methods:
        assert f"{method} ({parse(method).method.source})" in found.text
        if name not in ("ida", "fragility of ida"):
            assert re.search(r"(steps? of|time step|dt) 0\.0\d+ s", found.text)
    estimated = "Estimated errors of the time integration" in found.text
    assert not methods or estimated != ("was not estimated" in found.text)
    if name == "pushover":
        assert all(text in found.text for text in ("N2, EN 1998-1 annex B", "ASCE 41-17"))


@pytest.mark.parametrize(
    "name", [pytest.param(kind, marks=MARKS.get(kind, [pytest.mark.slow])) for kind in KINDS]
)
@pytest.mark.long
def test_the_pages_answer_the_questions_of_a_checking_engineer(
    working_directory: Path, tdint: Command, drawn: None, name: str
) -> None:
    """Building, motions and factors, limits and demands, method and error, assumptions."""
    write_report(name, tdint)
    found = page("page.html")
    if name == FROM_ELSEWHERE:
        assert "not known to this report" in found.text
        return
    check_building(found, name)
    check_motions(found, name)
    if "demand/limit" in found.text:
        check_limits(found)
    else:
        assert name in (*WITHOUT_MOTION, "linear", "compare", "ida", "modes", "region") or (
            name in ("fragility of ida", "transfer functions")
        )
    check_method(found, name)
    assert all(text.split(". ")[-1] in found.text for text in MODEL_LIMITS)
    # The first paragraph of a report is its result.
    assert re.search(r'</h1>\s*<p class="h">.*</p>\s*<p class="v', found.source)
