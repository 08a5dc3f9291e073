"""The stories of a building in a report: parameters of laws in columns, common properties in a
sentence, and differences from another building."""

import re

import numpy as np
import pytest
from matplotlib.figure import Figure

from tdint import load_model
from tdint.output.page import Chapter, PageText, Picture, Table, page
from tdint.output.report import model_chapter
from tdint.output.tables.buildings import model_table
from tdint.response.pairs import COMPLETED, Run
from tdint.response.runs.outcome import STORY_QUANTITIES
from tdint.studies.campaign.story_profiles import Profile
from tdint.studies.campaign.suite_report import _drifts_of_buildings, _ratio_parts, _statistics
from tdint.units import parse_output_units

UNITS = parse_output_units("kN,m")


def frame(*, strength=1.0, dashpots=(0, 0, 0), heights=(4, 3, 3), isolator=False):
    law = {"type": "imk", "plastic_drift": 0.05, "post_capping_drift": 0.1, "capping_ratio": 1.1}
    law |= {"residual_ratio": 0.2, "ultimate_drift": 0.3}
    stories = [
        {"mass": 1e5, "height": height, "stiffness": 1e8 / number, "dashpot": dashpot}
        | {"law": law | {"yield_force": strength * 1e6 / number}}
        for number, (height, dashpot) in enumerate(zip(heights, dashpots, strict=True), start=1)
    ]
    bearings = {"mass": 2e5, "stiffness": 1e7, "isolator": True}
    return load_model({"name": "frame", "stories": [bearings] * isolator + stories})


def parts(model, base=None):
    """Return the sentences about the stories and their table."""
    text, *tables = model_chapter(model, UNITS, base=base).parts
    return text.partition("counts as collapse. ")[2], tables


def test_parameters_are_columns_and_common_ones_a_row():
    text, (table, common) = parts(frame())
    assert table.columns == ("story", "height_m", "stiffness_kN_m", "yield_force")
    assert [row[3] for row in table.rows] == pytest.approx([1000, 500, 333.3])
    assert table.meanings["yield_force"]["unit"] == "kN"
    assert text == ""
    columns = ("story", "mass_kg", "law", "plastic_drift", "post_capping_drift", "capping_ratio")
    assert common.columns[:6] == columns
    assert [row[:6] for row in common.rows] == [("1 to 3", 1e5, "imk", 0.05, 0.1, 1.1)]
    # The table of a model contains every parameter.
    assert "ultimate_drift" in model_table(frame(), UNITS).columns


def test_a_variant_shows_its_differences():
    base = frame()
    assert parts(frame(), base) == ("Stories as of frame.", [])
    assert parts(frame(strength=1.5), base) == ("Stories as of frame; yield force 1.5 times.", [])
    text, (table,) = parts(frame(dashpots=(5e5, 5e5, 0)), base)
    assert text == "Stories as of frame, except dashpots:"
    assert table.rows == [("1 to 2", "500 v (kN; v in m/s)"), ("3", "")]
    text, (table,) = parts(frame(heights=(4, 3.5, 3)), base)
    assert text == "Stories as of frame, except height:"
    assert (table.columns, [row[1] for row in table.rows]) == (("story", "height_m"), [4, 3.5, 3])
    # What the other building has, the sentence names.
    assert parts(base, frame(dashpots=(5e5,) * 3))[0] == "Stories as of frame; without dashpots."


def test_an_isolator_is_below_the_stories_of_the_other_building():
    text, (table,) = parts(frame(isolator=True), frame())
    assert text == "Stories 2 to 4 as of frame; story 1:"
    assert [row[0] for row in table.rows] == [1]
    assert "linear; isolator" in table.rows[0] and "plastic_drift" not in table.columns


def test_a_short_table_is_not_divided_and_a_wide_one_is_continued():
    def shown(rows, columns, cell=1.0):
        units = {"story": "1"} | {f"value{i}": "1" for i in range(columns)}
        table = Table.of_units(units, [(i, *[cell] * columns) for i in range(rows)])
        chapter = Chapter("Second", ("The table:", table))
        return page("title", "About.", [chapter], PageText(inputs=())).decode()

    assert '<p class="k">The table:</p>\n<table class="w">' in shown(9, 1)
    assert '<p class="k">The table:</p>\n<table><thead>' in shown(10, 1)
    # Twelve narrow columns fit on A4, sixteen columns of long numbers do not.
    assert shown(3, 11).count("<table") == 1
    wide = shown(3, 15, 123456.7)
    assert wide.count("<table") == 2 and wide.count("<th>story</th>") == 2


def test_a_tall_first_figure_is_on_the_first_page():
    """The figure has the space that the text leaves; a figure that fits has its own height."""

    def shown(lines, height, font=0.0):
        def draw():
            figure = Figure(figsize=(4.0, height))
            if font:
                figure.text(0.5, 0.5, "text", fontsize=font)
            return figure

        picture = Picture(draw, "caption")
        chapters = [Chapter("Result", ("line " * 18,) * lines + (picture,))]
        text = page("title", "About.", chapters, PageText(inputs=())).decode()
        return "<section>" in text, text.index("<figure>") < text.index("</body>")

    assert shown(2, 9.5) == (True, True)
    assert shown(2, 6.0) == (False, True)  # it fits with its own height
    assert shown(30, 6.0) == (False, True)  # too little space remains
    # Texts of 6.2 points must not become smaller than 6 points, those of 12 points can.
    assert shown(2, 9.5, 6.2) == (False, True)
    assert shown(2, 9.5, 12.0) == (True, True)


def test_the_texts_of_a_figure_are_printed_with_6_points():
    def least(width, height, font):
        def draw():
            figure = Figure(figsize=(width, height))
            figure.text(0.5, 0.5, "text", fontsize=font)
            return figure

        return Picture(draw, "caption").image[1:]

    # Height and least height: a figure of 90 mm keeps its size, one of 360 mm is halved.
    assert least(90 / 25.4, 2.0, 8.0) == pytest.approx((50.8, 0.75 * 50.8))
    assert least(360 / 25.4, 4.0, 24.0) == pytest.approx((50.8, 25.4))
    assert least(360 / 25.4, 4.0, 8.0) == pytest.approx((50.8, 50.8))  # 4 points at any height


def test_the_means_of_variants_have_a_column_for_each_building():
    old, new = profile("old", 3), profile("new", 4, isolators=(1,))
    (chapter,) = _statistics([old, new], UNITS, {}, has_variants=True)
    assert chapter.title == "Means in each story, scale 1"
    assert [part for part in chapter.parts if isinstance(part, str)] == [
        "Drift ratio:",
        "Residual drift:",
        "Shear with the forces of dashpots and of P-delta:",
        "Absolute acceleration of the floor above the story:",
    ]
    drifts, residuals, shears, _ = (part for part in chapter.parts if isinstance(part, Table))
    # The isolator has no drift ratio, and the story above it is story 1.
    assert drifts.columns == ("story", "old_%", "new_%")
    assert [row[0] for row in drifts.rows] == ["1", "2", "3"]
    assert drifts.rows[0] == ("1", pytest.approx(1.5), pytest.approx(3.0))
    assert [row[0] for row in residuals.rows] == ["isolator", "1", "2", "3"]
    assert residuals.rows[0] == ("isolator", None, pytest.approx(0.015))
    # Without dashpots and P-delta, the total shear is the restoring force.
    assert shears.rows[1][1] == pytest.approx(1.5 * 2.0)
    # Buildings of different stories have a chapter each.
    titles = [
        item.title for item in _statistics([old, profile("low", 2)], UNITS, {}, has_variants=True)
    ]
    assert titles == [
        f"Statistics over the ground motions: {name}, scale 1" for name in ("old", "low")
    ]


def profile(name, stories, isolators=()):
    """Return a profile of two motions, whose values are multiples of 1 to `stories`."""
    values = np.array([[1.0], [2.0]]) * np.arange(1.0, stories + 1.0)
    heights = np.full(stories, 3.0)
    heights[[number - 1 for number in isolators]] = np.nan
    ratios = np.where(np.isnan(heights), np.nan, 0.01 * values)
    missing = np.full_like(values, np.nan)
    peaks = {quantity.name: 0.01 * values for quantity in STORY_QUANTITIES}
    peaks |= {
        "peak_drift_ratio": ratios,
        "peak_shear": 2000.0 * values,
        "peak_total_shear": missing,
    }
    outcome = np.full(2, COMPLETED)
    runs = [Run(0, 1.0, 0), Run(1, 1.0, 0)]
    level = (1.0, np.nan, runs, np.arange(2), outcome, outcome, ("", ""), "")
    return Profile(*level, name, ("a", "b"), heights, peaks, {}, isolators=isolators)


def test_runs_and_ratios_of_variants_have_a_column_for_each_building():
    runs = [
        (building, "a.csv", component, 2.0, ratio, 0.1, 1, None, status)
        for building, component, ratio, status in (
            ("old", "HN1", 0.02, "done"),
            ("old", "HN2", 0.06, "collapsed"),
            ("new", "HN1", 0.01, "done"),
            ("new", "HN2", 0.015, "done"),
        )
    ]
    # The columns have the order of the campaign, although the runs with a collapse are first.
    _, table = _drifts_of_buildings(runs, ["new", "old", "without runs"])
    assert table.columns == ("record", "component", "factor", "new", "old")
    assert table.rows == [("a.csv", "HN1", 2.0, 1.0, 2.0), ("a.csv", "HN2", 2.0, 1.5, "collapse")]
    _, table = _drifts_of_buildings(runs, ["old", "new"])
    assert table.columns == ("record", "component", "factor", "old", "new")
    # A run without a drift ratio, or a missing run, needs the list of runs.
    names = ["new", "old"]
    assert _drifts_of_buildings(runs[:3], names) == ()
    assert _drifts_of_buildings([*runs[:3], (*runs[3][:4], None, *runs[3][5:])], names) == ()
    columns = ("building", "baseline", "scale", "quantity", "story", "mean_ratio", "motions")
    units = dict.fromkeys(columns, "1")
    text, table = _ratio_parts(
        Table.of_units(
            units,
            [
                ("new", "old", 1.0, "peak_drift", None, 0.5, 3),
                ("new", "old", 1.0, "base_shear", None, 1.25, 3),
                ("new", "old", 1.0, "peak_velocity", None, 1.5, 3),
                ("weak, tall", "old", 1.0, "peak_drift", None, 2.0, 4),
                ("weak, tall", "old", 1.0, "base_shear", None, float("nan"), 4.0),
            ],
        )
    )
    assert "those of old" in text and "(new 3, 'weak, tall' 4" in text
    assert table.columns == ("scale", "quantity", "new", "weak, tall")
    # Without drift ratios, the drifts are listed.
    assert len(table.rows) == 2 and table.rows[0] == (1.0, "peak drift", 0.5, 2.0)
    assert table.rows[1][:3] == (1.0, "base shear", 1.25)


def test_a_page_has_a_date_and_no_options(monkeypatch):
    """Clauses on options are for the user of the command; the rest of the message remains."""

    def shown(*texts, head=()):
        text = PageText(texts, inputs=(), head=head)
        return page("title", "About.", [text.result()], text).decode()

    monkeypatch.setenv("SOURCE_DATE_EPOCH", "951782400")  # 29 February 2000
    assert shown().count("<strong>Date:</strong> 2000-02-29<") == 1
    assert "2000-02-29" not in shown(head=(("Date", "May 2026"),))
    monkeypatch.delenv("SOURCE_DATE_EPOCH")
    assert re.search(r"<strong>Date:</strong> 20\d\d-\d\d-\d\d<", shown())
    found = {
        "not estimated (--no-check).": "not estimated.",
        "one run estimates the errors; --no-check omits it": "one run estimates the errors",
        "larger demand (larger; --pair-demand mean changes this)": "larger demand (larger)",
        "no levels; use --fit cloud, or --im. Then": "no levels. Then",
        "a ramp or an offset (--baseline linear), or a trend": "a ramp or an offset, or a trend",
        "no runs, add --overwrite": "no runs",
        "a story - the first -- yields": "a story - the first -- yields",
    }
    for text, right in found.items():
        assert f"<li>{right}</li>" in shown(text)
