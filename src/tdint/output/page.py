"""HTML reports: one file that contains its tables and figures, works offline and prints on A4."""

from __future__ import annotations

import base64
import io
import math
import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from tdint.arrays import cached_property
from tdint.errors import write_out_controls
from tdint.number_parsing import table_number
from tdint.output import figures
from tdint.output.summary import files_read, versions
from tdint.output.tables.table import TEXT, Cell, Table, converted
from tdint.units import OutputUnits, suffix

if TYPE_CHECKING:
    from matplotlib.figure import Figure

MOST_COLUMNS = 10
"""Maximum number of columns of a table on A4, so that four-digit numbers at 8.5 pt do not wrap."""

DIGEST = "SHA-256"
"""Name of the column of SHA-256 digests, which has a small font because digests are long."""

_MAX_SVG = 160_000
"""Size of an SVG figure, bytes, above which PNG is used instead: long histories have many points.
"""

_STYLE = Path(__file__).with_name("page.css").read_text(encoding="utf-8")

# These dimensions of the printed page, mm, are used to estimate the positions of page breaks. They
# follow from the margins and the fonts in `_STYLE`, with text in Helvetica.
_PAGE, _WIDTH = 262.0, 180.0  # height and width between the margins
_LINE, _LETTERS = 4.94, 96  # height of a line (10 pt times 1.4), number of its characters (1.87 mm)
_TABLE_LINE, _TABLE_LETTER = 4.2, 1.65  # line height and width of a character in tables
# Each height is the additional space of a part, because the margins of successive parts overlap.
# The space of a figure includes its caption, the space of a table row its border.
_PARAGRAPH, _HEADING, _ROW, _FIGURE, _TABLE = 2.5, 11.4, 1.3, 7.4, 3.0
_FIRST_ROWS = 33.0  # height of a table heading of three lines and of three rows
_MIN_BELOW_HEADING = 34.0  # minimum space for a heading with text; otherwise it moves to a new page
_MAX_BLANK = 52.0  # maximum height left blank before a figure; less than a quarter of a page
_MIN_SCALE = 0.6  # minimum fraction of a figure's full size; a smaller figure is postponed
_MIN_LAST_PAGE, _MAX_BLANK_FRACTION = 0.33, 0.2
"""Fractions of a page: minimum content of the last page, maximum blank area on other pages."""
_MIN_ROWS = 3
"""Minimum number of rows of a table that continues on a new page."""
_MAX_WHOLE_TABLE = 75.0
"""Maximum height of a table that is not divided, mm."""
_KNOWN_DISTANCE = 2.0 * _PAGE
"""Distance from a fixed page break, mm, up to which estimated positions are reliable."""
_MAX_FIRST_FIGURE, _MAX_FIGURE = 195.0, 110.0
"""Maximum heights of the first figure and of later figures, mm."""


@dataclass(frozen=True)
class Picture:
    """Figure of a report.

    Attributes
    ----------
    caption : str
        Text below the figure, which is also its description for screen readers.
    """

    draw: Callable[[], Figure]
    caption: str

    @cached_property
    def image(self) -> tuple[str, float]:
        """Attributes of the HTML image, and height divided by width. The figure is drawn once for
        all layouts. The format is PNG if lines with thousands of points make the SVG file large.
        """
        for image_format in ("svg+xml", "png"):
            # The first three characters are the file extension of the format.
            drawing, stream = figures.style.picture(f".{image_format[:3]}", self.draw), io.BytesIO()
            figure = drawing.figure()
            drawing.save(figure, stream)
            if len(stream.getvalue()) <= _MAX_SVG:
                break
        data = base64.b64encode(stream.getvalue()).decode("ascii")
        width, height = figure.get_size_inches()
        source = f"data:image/{image_format};base64,{data}"
        return f'alt="{escape(self.caption)}" src="{source}"', height / width


Part = str | Table | Picture | Sequence[str]
"""Paragraph, table, figure, or list of points."""


@dataclass(frozen=True)
class Chapter:
    """Chapter of a report.

    Attributes
    ----------
    parts : sequence of Part
        Content; a chapter without content is omitted.
    """

    title: str
    parts: Sequence[Part]


@dataclass(frozen=True)
class PageText:
    """Texts of a report that are not computed from its tables.

    Attributes
    ----------
    sentences : sequence of str
        Results in a few sentences.
    verdict : sequence of (bool or None, str)
        Headline sentences. True: the limit is met; False: the limit is exceeded or the building
        collapsed; None: no limit was requested.
    head : sequence of (str, str)
        Names and texts of the first lines: project, author, date.
    inputs : sequence of mapping
        Input files with their SHA-256; by default the files that the command has read.
    answer : sequence of Part
        Table and text of the main result. They precede the warnings, and are therefore on the
        first page.
    limits : Table | None
        Comparisons of the demands with several limits; None if the verdict contains everything.
    governing_story : int | None
        Story of the highest ratio of demand to limit, from 1; None without limits of stories.
    """

    sentences: Sequence[str] = ()
    warnings: Sequence[str] = ()
    head: Sequence[tuple[str, str]] = ()
    inputs: Sequence[Mapping[str, Any]] = field(default_factory=files_read)
    verdict: Sequence[tuple[bool | None, str]] = ()
    answer: Sequence[Part] = ()
    limits: Table | None = None
    governing_story: int | None = None

    def result(self, *parts: Part) -> Chapter:
        """Return the first chapter of most reports: the sentences, followed by other parts."""
        return Chapter("Result", (list(self.sentences), *parts))


def page_units(units: OutputUnits) -> OutputUnits:
    """Return the units of a report.

    N is replaced by kN, kg by the unit of mass that belongs to the unit of force, and
    accelerations are in g unless a unit was selected. Tables then have the same units as figures,
    and no number needs a power of ten.
    """
    units = units._replace(force="kN") if units.force == "N" else units
    return units._replace(mass=units.matching_mass_unit).in_figures


class _Flow:
    """Parts of a report in their order, with an estimate of the position on the printed page.

    The estimated position is used to keep headings with their content, to avoid large blank areas
    and to reduce figures to the available space.

    CSS rules alone keep headings with their content, but do not postpone a figure or reduce it to
    the space that remains. With such rules, two of 18 types of reports ended with a nearly blank
    page.

    Attributes
    ----------
    scale : float
        Factor of the heights of figures, at most 1.
    body : list of str
        HTML elements.
    position : float
        Estimated distance from the top of the current page, mm.
    distance : float
        Estimated distance from the last page break with a known position, mm.
    blank : float
        Height of the largest blank area at the end of a page, mm.
    separated_rows : int
        Number of tables that have only the last one or two rows on a new page.
    postponed : list of Picture
        Figures that did not fit.
    """

    def __init__(self, scale: float) -> None:
        """Start an empty flow at the top of the first page."""
        self.scale = scale
        self.blank = 0.0
        self.separated_rows = 0
        self.body: list[str] = []
        self.position = 0.0
        self.distance = 0.0
        self.postponed: list[Picture] = []

    @property
    def cost(self) -> float:
        """Measure of blank areas and of reduced figures; 0 for a page without either."""
        missing_content = max(_MIN_LAST_PAGE - self.position / _PAGE, 0.0)
        excess_blank = max(self.blank / _PAGE - _MAX_BLANK_FRACTION, 0.0)
        # Blank areas have the weight 10, because they are worse than reduced figures. Rows without
        # their table are worse than figures that are reduced by two steps of `_SCALES`.
        return (
            10.0 * (missing_content + excess_blank) + 0.1 * self.separated_rows + 1.0 - self.scale
        )

    def text(self, element: str, text: str, *, more: str = "", height: float = 0.0) -> None:
        """Add a paragraph.

        `more` contains the attributes of the element; empty by default. `height` is the height in
        addition to the text lines, mm; 0 selects the margin of a paragraph.
        """
        # A long line needs several printed lines, an empty line needs one. -(-a // b) is a / b
        # rounded up.
        lines = re.sub("<br>", "\n", text).split("\n")
        line_count = sum(-(-max(len(line), 1) // _LETTERS) for line in lines)
        # The closing tag has the name of the element without attributes.
        self.body.append(f"<{element}{more}>{text}</{element.split()[0]}>")
        self.advance(line_count * _LINE + (height or _PARAGRAPH))

    def advance(self, height: float) -> None:
        """Advance the estimated position by the height (mm) of content that may continue on the
        next page."""
        self.distance += height
        self.position = (self.position + height) % _PAGE

    def break_class(self, height: float) -> str:
        """Return the HTML attribute that moves content of a height (mm; infinite to require a new
        page) to a new page if the current page has no space for it, and update the estimated
        position.

        The attribute is empty if the content fits. It is also empty far from the last known page
        break, where the estimated position is unreliable and the browser decides.
        """
        if _PAGE - self.position >= height:
            return ""
        self.blank = max(self.blank, _PAGE - self.position)
        # A chapter that must start on a new page (infinite height) does not depend on the estimate.
        is_known = self.distance < _KNOWN_DISTANCE or math.isinf(height)
        self.position = 0.0
        if not is_known:
            return ""
        self.distance = 0.0
        return ' class="n"'

    def break_before_table(self, height: float) -> str:
        """Return the attribute of `break_class` for a table; the heading and the sentence that
        introduce the table move with it."""
        first = len(self.body)
        while first and self.body[first - 1].startswith(("<h2", '<p class="k')):
            first -= 1
        attribute = self.break_class(height)
        if not attribute or first == len(self.body):
            return attribute
        kept = self.body[first]
        self.body[first] = (
            kept.replace("<h2", '<h2 class="n"', 1)
            if kept.startswith("<h2>")
            else kept.replace('class="k"', 'class="k n"', 1)
        )
        for element in self.body[first:]:
            is_heading = element.startswith("<h2")
            lines = 1 if is_heading else -(-len(element) // _LETTERS)
            self.advance(_HEADING if is_heading else lines * _LINE + _PARAGRAPH)
        return ""

    def heading(self, title: str, part: Part = "", *, on_new_page: bool = False) -> None:
        """Add the heading of a chapter; it remains on the page of the content that follows.

        `part` is the first part of the chapter; the first rows of a table remain below its heading.
        `on_new_page` is True to start a new page; false by default.
        """
        needed = _MIN_BELOW_HEADING  # mm, height of the heading and of the content that must follow
        if isinstance(part, Table):
            needed = _HEADING + _FIRST_ROWS
        elif _introduces_table(part):
            needed = _HEADING + _LINE + _PARAGRAPH + _FIRST_ROWS
        if on_new_page and self.position > 0.0:
            needed = math.inf
        self.body.append(f"<h2{self.break_class(needed)}>{escape(title)}</h2>")
        self.advance(_HEADING)

    def picture(self, picture: Picture, *, last: bool = False) -> None:
        """Add a figure as large as the space allows, or postpone a figure that would be small.

        `last` is True if no content follows, so that the figure cannot be postponed; false by
        default.
        """
        image, ratio = picture.image
        # `_FIGURE` (mm) is the space of the caption and the margins, in addition to the image.
        is_first = not any(text.startswith("<figure") for text in self.body)
        max_height = _MAX_FIRST_FIGURE if is_first else _MAX_FIGURE
        full_height = self.scale * min(_WIDTH * ratio, max_height)
        space = _PAGE - self.position - _FIGURE
        fits = full_height <= space
        # `space` (mm) is the height for the image on this page. A figure that does not fit has
        # three treatments:
        #
        # 1. The page has less free height than `_MAX_BLANK`: the figure moves to a new page
        #    (`break_class`), because the blank area is small.
        # 2. The free height is larger, and the figure would be reduced to less than `_MIN_SCALE` of
        #    its full height: it is postponed, and following text fills the page. This is not
        #    possible for the last content, which has treatment 3.
        # 3. Otherwise the figure is reduced to the space on this page.
        would_be_too_small = _MAX_BLANK - _FIGURE <= space < _MIN_SCALE * full_height
        if would_be_too_small and not fits and not last:
            self.postponed.append(picture)
            return
        # `break_class` sets the position to 0 if the figure moves to a new page.
        page_class = "" if fits else self.break_class(_MAX_BLANK)
        height = min(full_height, _PAGE - self.position - _FIGURE)
        # Far from the last known page break, a tall figure may not fit and cause a large blank
        # area, so its height is limited.
        if self.distance >= _KNOWN_DISTANCE and not is_first:
            height = min(height, _MAX_BLANK)
        size = f'style="width: {min(height / ratio, _WIDTH):.0f}mm"'
        self.body.append(
            f"<figure{page_class}><img {size} {image}>"
            f"<figcaption>{escape(picture.caption)}</figcaption></figure>"
        )
        self.advance(height + _FIGURE)

    def add_postponed(self, *, last: bool = False) -> None:
        """Add the postponed figures that have enough space now.

        `last` is True at the end of the report, where all postponed figures are added.
        """
        postponed, self.postponed = self.postponed, []
        for picture in postponed:
            self.picture(picture, last=last)


def page(title: str, about: str, chapters: Iterable[Chapter], page_text: PageText) -> bytes:
    """Return a report as UTF-8 HTML.

    The order is: title, verdict, introduction, answer, warnings, chapters, input files, software
    versions.
    The layout with the smallest blank areas on printed pages is selected.

    Parameters
    ----------
    about : str
        Introduction of a single sentence.
    """
    # The first 16 digits of a plug-in's digest are enough to distinguish its versions.
    packages = versions()
    plugins = {
        f"plug-in {name}": digest[:16] for name, digest in packages.pop("plugins", {}).items()
    }
    software = ", ".join(
        f"{name} {number}" for name, number in (packages | plugins).items() if number
    )
    # The chapter Inputs lists each file one time, also if several runs have read it.
    files: list[tuple[Cell, ...]] = list(
        dict.fromkeys((item["file"], item["sha256"]) for item in page_text.inputs)
    )
    # Chapters without content are omitted, because their heading would be empty.
    contents = []
    for chapter in (*chapters, Chapter("Inputs", (Table(("file", DIGEST), files),))):
        if parts := [part for part in chapter.parts if _has_content(part)]:
            contents.append(Chapter(chapter.title, parts))

    def lay_out(scale: float, last_chapters: int = 0) -> _Flow:
        """Return the layout with the relative height `scale` of the figures and with a page break
        before the last `last_chapters` chapters (0: no page break)."""
        flow = _Flow(scale)
        flow.text("h1", escape(title), height=_LINE)
        if page_text.head:
            lines = (
                f"<strong>{escape(name)}:</strong> {escape(text)}" for name, text in page_text.head
            )
            flow.text("p", "<br>".join(lines), more=' class="h"')
        # CSS classes of the verdict, which is the first paragraph. Warnings precede all numbers.
        classes = {None: "v", True: "v kept", False: "v broken"}
        for is_met, text in page_text.verdict:
            flow.text("p", _html(text), more=f' class="{classes[is_met]}"', height=6.3)
        flow.text("p", _html(about))
        for part in page_text.answer:
            _add(flow, part)
        for text in once(page_text.warnings):
            flow.text("p", f"<strong>Warning:</strong> {_html(text)}", more=' class="w"')
        for index, chapter in enumerate(contents):
            flow.add_postponed()
            on_new_page = len(contents) - index == last_chapters
            flow.heading(chapter.title, chapter.parts[0], on_new_page=on_new_page)
            for part in chapter.parts:
                _add(flow, part)
        flow.add_postponed(last=True)
        flow.text("p", f"Made by {escape(software)}.")
        return flow

    # The cost of reduced figures is at most 1 - min(_SCALES). A higher cost means that a nearly
    # blank page remains; then page breaks before the last chapters are tried as well.
    flow = min(map(lay_out, _SCALES), key=lambda layout: layout.cost)
    if flow.cost > 1.0 - _SCALES[-1]:
        with_break = (lay_out(scale, count) for count in _LAST_CHAPTERS for scale in _SCALES)
        flow = min(flow, *with_break, key=lambda layout: layout.cost)
    text = (
        '<!DOCTYPE html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        f"<title>{escape(title)}</title>\n<style>\n{_STYLE}</style>\n</head>\n<body>\n"
        + "\n".join(flow.body)
    )
    document = write_out_controls(text + "\n</body>\n</html>\n", keep="\n")
    return document.encode("utf-8", "replace")


_SCALES = tuple(1.0 - 0.04 * step for step in range(9))
"""Factors of the heights of figures that are tried; smaller figures are hard to read."""

_LAST_CHAPTERS = (1, 2, 3)
"""Numbers of chapters at the end, before which a page break is tried."""


def _has_content(part: Part) -> bool:
    """Return True unless a part of a report is an empty text, an empty list or a table without
    rows."""
    return bool(part.rows) if isinstance(part, Table) else bool(part)


def _introduces_table(part: Part) -> bool:
    """Return True for a sentence that ends with a colon, which a table follows."""
    return isinstance(part, str) and part.endswith(":")


def _add(flow: _Flow, part: Part) -> None:
    """Add a paragraph, a table, a figure or a list of points to a flow."""
    if isinstance(part, str):
        css_class = ""
        if _introduces_table(part):
            # The browser keeps the sentence together with the table (class k). It does not keep the
            # first rows of the table together with the sentence, so that the space is checked here.
            on_new_page = flow.break_class(_LINE + _PARAGRAPH + _FIRST_ROWS)
            css_class = ' class="k n"' if on_new_page else ' class="k"'
        flow.text("p", _html(part), more=css_class)
    elif isinstance(part, Table):
        _add_table(flow, part)
    elif isinstance(part, Picture):
        flow.picture(part)
    else:
        line_count = sum(-(-len(point) // _LETTERS) for point in part)
        flow.body.append("<ul>" + "".join(f"<li>{_html(point)}</li>" for point in part) + "</ul>")
        flow.advance(line_count * _LINE + 1.0 + _PARAGRAPH)


def _html(text: str) -> str:
    """Return a text as HTML, with its line breaks and with numbers without powers of ten."""
    return "<br>".join(escape(_keep_units(_plain(line))) for line in text.splitlines())


_BEFORE_UNIT = re.compile(r"(?<=\d) (?=%|(?:kN|kip|mm|kg|Hz|m|in|ft|s|g|t|N)(?![\w]))")
_NO_BREAK_SPACE = "\u00a0"


def _keep_units(text: str) -> str:
    """Return a text with no-break spaces between numbers and their units."""
    return _BEFORE_UNIT.sub(_NO_BREAK_SPACE, text)


_POWER = re.compile(r"(?<![\w.])(-?)(\d(?:\.\d+)?)e([+-]\d+)\b")


def _plain(text: str) -> str:
    """Return a text with numbers such as 1.2e-05 rewritten as decimals (`table_number`)."""
    return _POWER.sub(lambda match: table_number(float(match[0])), text)


def once(texts: Iterable[str]) -> list[str]:
    """Return messages without duplicates, and merge messages that differ only in the file.

    `a.yaml: no height` and `b.yaml: no height` become `a.yaml; b.yaml: no height`.
    """
    # The keys of `files` are the messages without their file; the keys of the inner dictionaries
    # are the files, in the order of the messages. The file is empty for a message without a file.
    files: dict[str, dict[str, None]] = {}
    for text in texts:
        file, colon, message = text.partition(": ")
        files.setdefault(message if colon else text, {})[file if colon else ""] = None
    return [f"{'; '.join(names)}: {text}" if any(names) else text for text, names in files.items()]


_TEXT_CLASS = ' class="t"'
"""Attribute of the cells of a text column."""


_LONG_TEXT_CLASS = ' class="t l"'
"""Attribute of the cells of a text column with a word that may be divided."""

_MAX_WORD = 24
"""Number of characters of a word, such as a path, above which it may be divided: 40 mm."""


_MOST_KEYS = 4
"""Maximum number of columns that each part of a divided table repeats."""


class _Column(NamedTuple):
    """Column of a table on a page.

    Attributes
    ----------
    heading : str
        HTML text: the name of the column with spaces, and the unit in parentheses.
    css_class : str
        Attribute of the cells: class t for text, d for digests, empty for numbers. Text and digests
        are left-aligned.
    """

    heading: str
    css_class: str
    cells: list[str]

    @property
    def is_text(self) -> bool:
        """True for text, which can be wrapped."""
        return self.css_class == _TEXT_CLASS

    @property
    def longest_cell(self) -> int:
        """Number of characters of the longest cell."""
        return max(map(len, self.cells))


def _add_table(flow: _Flow, table: Table) -> None:
    """Add a table to the flow of a report, with units in its heading and drift ratios in percent.

    Empty columns and the zero forces of absent dampers are omitted. A table that is wider than the
    page is continued below, again with its first columns.
    """
    # All drifts and displacements of a table have the same unit, m or mm, so that their columns can
    # be compared. The unit follows from their common maximum.
    max_length = _max_number(table, [name for name in table.columns if _is_motion(table, name)])
    columns = []
    for name in table.columns:
        maximum = max_length if _is_motion(table, name) else _max_number(table, [name])
        column = _column(table, name, maximum)
        is_absent_damper = "damper_force" in name and maximum == 0.0
        if any(column.cells) and not is_absent_damper:
            columns.append(column)
    # Each part of a divided table repeats the first columns that identify the row. The parts
    # have about equal numbers of columns. Their number is even, so that a mean is not separated
    # from the maximum that follows it.
    keys = next((n for n in range(1, _MOST_KEYS + 1) if _are_distinct(columns[:n])), 1)
    first, others = columns[:keys], columns[keys:]
    if len(columns) > MOST_COLUMNS:
        parts = -(-len(others) // (MOST_COLUMNS - keys))
        part_size = 2 * math.ceil(len(others) / parts / 2)
    else:
        part_size = max(len(others), 1)
    for start in range(0, max(len(others), 1), part_size):
        _add_columns(flow, [*first, *others[start : start + part_size]])


def _are_distinct(columns: Sequence[_Column]) -> bool:
    """Return True if no two rows have the same cells in the columns."""
    rows = [*zip(*(column.cells for column in columns), strict=True)]
    return len(set(rows)) == len(rows)


def _column(table: Table, name: str, maximum: float) -> _Column:
    """Return a column of a table with the unit for a page.

    `name` is the name of the column. `maximum` is the largest absolute number of the column, or of
    all columns that must have the same unit.
    """
    index = table.columns.index(name)
    cells = [row[index] for row in table.rows]
    unit, factor = table.meanings.get(name, {}).get("unit", TEXT), 1.0
    heading = name.removesuffix("_error").removesuffix(suffix(unit)).replace("_", " ")
    if name.endswith("_error"):
        heading += " error"
    if "drift_ratio" in name:
        unit, factor = "%", 0.01
    elif unit == "m" and 0.0 < maximum < _MILLIMETERS:
        unit, factor = "mm", 1e-3
    elif unit == "t" and 0.0 < maximum < 1.0:
        unit, factor = "kg", 1e-3
    if unit not in (TEXT, "1"):
        heading += f" ({unit.replace('^2', '²').replace('*', '·')})"
    css_class = _TEXT_CLASS if unit == TEXT else ""
    if name == DIGEST:
        css_class = ' class="d"'
    if name in ("record", "motion"):
        # Files have short, distinct names here; the chapter Inputs lists their paths.
        short_names = figures.style.record_names(map(str, cells))
        cells = [short_names[str(cell)] for cell in cells]
    texts = [_cell_text(converted(cell, factor), maximum / factor) for cell in cells]
    return _Column(escape(heading), css_class, texts)


def _add_columns(flow: _Flow, columns: Sequence[_Column]) -> None:
    """Add a table to a flow, and estimate its height on the printed page."""
    # The estimate assumes that browsers make columns of numbers as wide as their longest cell or
    # heading word, and divide the remaining width between the columns of text. Widths are in
    # characters; each cell has a horizontal padding of 2.4 mm.
    text_columns = [column for column in columns if column.is_text]
    number_width = sum(
        max(column.longest_cell, *map(len, column.heading.split()))
        for column in columns
        if not column.is_text
    )
    text_width = (_WIDTH - 2.4 * len(columns)) / _TABLE_LETTER - number_width
    longest_texts = sum(column.longest_cell for column in text_columns)
    # All text columns have the same fraction of the width of their longest cell.
    width_fraction = min(1.0, max(text_width, 20.0) / max(longest_texts, 1))
    # A heading is wrapped to about 15 characters if not all headings fit in one line; to about 8
    # with the maximum number of columns.
    letters = 15 if len(columns) < MOST_COLUMNS else 8
    heading_lines = max((-(-len(column.heading) // letters) for column in columns), default=1)
    if sum(len(column.heading) for column in columns) < text_width:
        heading_lines = 1
    heading_height = heading_lines * _TABLE_LINE + _ROW
    rows, heights = [], []
    for cells in zip(*(column.cells for column in columns), strict=True):
        row = ""
        line_count = 1
        for column, cell in zip(columns, cells, strict=True):
            # Only long words may be divided: otherwise browsers also divide words in headings.
            is_long = column.is_text and max(map(len, cell.split()), default=0) > _MAX_WORD
            css_class = _LONG_TEXT_CLASS if is_long else column.css_class
            row += f"<td{css_class}>{escape(_keep_units(cell))}</td>"
            if column.is_text:
                column_width = max(width_fraction * column.longest_cell, 1.0)
                line_count = max(line_count, math.ceil(len(cell) / column_width))
        rows.append(f"<tr>{row}</tr>")
        heights.append(line_count * _TABLE_LINE + _ROW)
    # A short table is not divided. The heading of a long table remains together with three rows, so
    # that it is not the last line of a page.
    total = heading_height + sum(heights)
    is_short = total <= _MAX_WHOLE_TABLE
    page_class = flow.break_before_table(
        total if is_short else heading_height + 3.0 * (_TABLE_LINE + _ROW)
    )
    flow.advance(heading_height + _TABLE)
    rows_on_page = 0
    for row_height in heights:
        # The heading is repeated on each page.
        if flow.position + row_height <= _PAGE:
            flow.advance(row_height)
            rows_on_page += 1
        else:
            flow.advance(_PAGE - flow.position + heading_height + row_height)
            rows_on_page = 1
    if rows_on_page < min(_MIN_ROWS, len(rows)):
        flow.separated_rows += 1
    if is_short:
        page_class = ' class="n w"' if page_class else ' class="w"'
    heading = "".join(f"<th{column.css_class}>{column.heading}</th>" for column in columns)
    body = "\n".join(rows)
    flow.body.append(
        f"<table{page_class}><thead><tr>{heading}</tr></thead><tbody>\n{body}\n</tbody></table>"
    )


def _is_motion(table: Table, name: str) -> bool:
    """Return True if the column `name` of a table contains drifts or displacements in m, or their
    errors."""
    unit = table.meanings.get(name, {}).get("unit", TEXT)
    return unit == "m" and any(word in name for word in ("drift", "displacement"))


def _max_number(table: Table, names: Sequence[str]) -> float:
    """Return the largest absolute number in the columns `names` of a table; 0 without a number."""
    indices = [table.columns.index(name) for name in names]
    numbers = (row[i] for row in table.rows for i in indices)
    return max(
        (abs(cell) for cell in numbers if isinstance(cell, float) and math.isfinite(cell)),
        default=0.0,
    )


_MILLIMETERS = 0.01
"""m; a column of lengths with smaller values is printed in mm, so that it needs no power of ten."""


def _cell_text(cell: Cell, maximum: float = 1.0) -> str:
    """Return the text of a cell for a report; empty for a missing value.

    `maximum` is the largest absolute number of the column: a number below 0.0001 times this value
    is written as 0.
    """
    if isinstance(cell, float):
        return table_number(cell, maximum)
    return "" if cell is None else _plain(str(cell))
