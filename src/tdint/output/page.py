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
from tdint.system import date
from tdint.units import OutputUnits, suffix

if TYPE_CHECKING:
    from matplotlib.figure import Figure

MOST_COLUMNS = 10
"""Maximum number of columns of a table that is not divided, for any width of the columns:
four-digit numbers at 8.5 pt do not wrap."""

DIGEST = "SHA-256"
"""Name of the column of SHA-256 digests, which has a small font because digests are long."""

_MAX_SVG = 160_000
"""Size of an SVG figure, bytes, above which PNG is used instead: long histories have many points.
"""

_STYLE = Path(__file__).with_name("page.css").read_text(encoding="utf-8")


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
    def image(self) -> tuple[str, float, float]:
        """HTML image, its printed height, mm, and the smallest height at which its texts have 6 pt.
        The format is PNG if lines with thousands of points make the SVG file large.
        """
        for image_format in ("svg+xml", "png"):
            # The first three characters are the file extension of the format.
            drawing, stream = figures.style.picture(f".{image_format[:3]}", self.draw), io.BytesIO()
            figure = drawing.figure()
            drawing.save(figure, stream)
            if len(stream.getvalue()) <= _MAX_SVG:
                break
        data = base64.b64encode(stream.getvalue()).decode("ascii")
        width, height = 25.4 * figure.get_size_inches()
        scale = min(1.0, _WIDTH / width)
        texts: Any = figure.findobj(lambda artist: hasattr(artist, "get_fontsize"))
        sizes = [text.get_fontsize() for text in texts if text.get_text()]
        least = height * min(scale, _LEAST_FONT / min(sizes, default=math.inf))
        source = f'src="data:image/{image_format};base64,{data}" style="--least: {least:.0f}mm"'
        return f'<img alt="{escape(self.caption)}" {source}>', height * scale, least


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


def page(title: str, about: str, chapters: Iterable[Chapter], page_text: PageText) -> bytes:
    """Return a report as UTF-8 HTML.

    The order is: title, verdict, introduction, answer, warnings, chapters, input files, software
    versions.
    The style sheet states which parts remain on one printed page; the browser breaks the pages.

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
    body = [f"<h1>{escape(title)}</h1>"]
    # A line of the user can state another date.
    has_date = any(name.casefold() == "date" for name, _ in page_text.head)
    head = page_text.head if has_date else (*page_text.head, ("Date", date()))
    lines = (f"<strong>{escape(name)}:</strong> {escape(text)}" for name, text in head)
    body.append(f'<p class="h">{"<br>".join(lines)}</p>')
    # CSS classes of the verdict, which is the first paragraph. Warnings precede all numbers.
    classes = {None: "v", True: "v kept", False: "v broken"}
    body += [f'<p class="{classes[met]}">{_html(text)}</p>' for met, text in page_text.verdict]
    body += [f"<p>{_html(about)}</p>", *map(_part, page_text.answer)]
    body += [
        f'<p class="w"><strong>Warning:</strong> {_html(text)}</p>'
        for text in once(page_text.warnings)
    ]
    has_figure = False
    # Chapters without content are omitted, because their heading would be empty.
    for chapter in (*chapters, Chapter("Inputs", (Table(("file", DIGEST), files),))):
        if parts := [part for part in chapter.parts if _has_content(part)]:
            body.append(f"<h2>{escape(chapter.title)}</h2>")
        for part in parts:
            body.append(_part(part))
            if isinstance(part, Picture) and not has_figure:
                has_figure = True
                # A tall figure is reduced to the space below the text of the first page, if its
                # texts can still be read.
                above = sum(map(_estimated_height, body[:-1]))
                _, height, least = part.image
                if above < _MAX_TEXT and above + least < _MAX_PAGE < above + height:
                    body[:] = ["<section>", *body, "</section>"]
    body.append(f"<p>Made by {escape(software)}.</p>")
    text = (
        '<!DOCTYPE html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        f"<title>{escape(title)}</title>\n<style>\n{_STYLE}</style>\n</head>\n<body>\n"
        + "\n".join(body)
    )
    document = write_out_controls(text + "\n</body>\n</html>\n", keep="\n")
    return document.encode("utf-8", "replace")


def _estimated_height(element: str) -> float:
    """Return the approximate printed height of a paragraph or a table, mm."""
    rows = element.count("<tr>")
    return 6.0 * rows + 8.0 if rows else 5.0 * math.ceil(len(element) / _LETTERS) + 3.0


_LETTERS = 96
"""Approximate number of characters of a printed line."""

_WIDTH = 180.0
"""Printed width of a page between the margins, mm."""

_MAX_TEXT = 185.0
"""Maximum height of the text before the first figure, mm, if the figure is on the first page."""

_MAX_PAGE = 250.0
"""Maximum height of the text and the first figure on the first page, mm."""

_LEAST_FONT = 6.0
"""Smallest printed size of the texts of a figure, points."""


def _has_content(part: Part) -> bool:
    """Return True unless a part of a report is an empty text, an empty list or a table without
    rows."""
    return bool(part.rows) if isinstance(part, Table) else bool(part)


def _part(part: Part) -> str:
    """Return a paragraph, a table, a figure or a list of points as HTML."""
    if isinstance(part, str):
        # A sentence that ends with a colon remains on the page of the table that follows it.
        css_class = ' class="k"' if part.endswith(":") else ""
        return f"<p{css_class}>{_html(part)}</p>"
    if isinstance(part, Table):
        return _table(part)
    if isinstance(part, Picture):
        return f"<figure>{part.image[0]}<figcaption>{escape(part.caption)}</figcaption></figure>"
    return "<ul>" + "".join(f"<li>{_html(point)}</li>" for point in part) + "</ul>"


def _html(text: str) -> str:
    """Return a text as HTML, with its line breaks, with numbers without powers of ten, and without
    clauses on options of the command line, which readers of a report do not know."""
    text = _OPTIONS.sub("", text)
    return "<br>".join(escape(_keep_units(_plain(line))) for line in text.splitlines())


_CLAUSE = r"[^;()\n]*?(?<![\w-])--[a-z](?:[^;().\n]|\.(?=\w))*"
_OPTIONS = re.compile(
    rf" \({_CLAUSE}\)|; {_CLAUSE}|(?<=\(){_CLAUSE}; |, [^,;()\n]*?--[a-z][^;().\n]*"
)
"""Clause of a message that names an option, such as `; --no-check omits it`."""


_BEFORE_UNIT = r"(?<=\d) (?=%|(?:kN|kip|mm|kg|Hz|m|in|ft|s|g|t|N)(?![\w]))"
_NO_BREAK_SPACE = "\u00a0"


def _keep_units(text: str) -> str:
    """Return a text with no-break spaces between numbers and their units."""
    return re.sub(_BEFORE_UNIT, _NO_BREAK_SPACE, text)


_POWER = r"(?<![\w.])(-?)(\d(?:\.\d+)?)e([+-]\d+)\b"


def _plain(text: str) -> str:
    """Return a text with numbers such as 1.2e-05 rewritten as decimals (`table_number`)."""
    return re.sub(_POWER, lambda match: table_number(float(match[0])), text)


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


_MAX_WHOLE_TABLE = 9
"""Maximum number of rows of a table that is not divided between pages."""

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
    def width(self) -> float:
        """Estimated minimum width without a wrapped number, mm."""
        return 1.75 * max(map(len, [*self.heading.split(), *self.cells])) + 2.4


def _table(table: Table) -> str:
    """Return a table as HTML, with units in its heading and drift ratios in percent.

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
    if len(columns) > MOST_COLUMNS and sum(column.width for column in columns) > _WIDTH:
        parts = -(-len(others) // (MOST_COLUMNS - keys))
        part_size = 2 * math.ceil(len(others) / parts / 2)
    else:
        part_size = max(len(others), 1)
    return "\n".join(
        _part_of_table([*first, *others[start : start + part_size]])
        for start in range(0, max(len(others), 1), part_size)
    )


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


def _part_of_table(columns: Sequence[_Column]) -> str:
    """Return columns as an HTML table. The browser does not divide a short table."""
    rows = []
    for cells in zip(*(column.cells for column in columns), strict=True):
        row = ""
        for column, cell in zip(columns, cells, strict=True):
            # Only long words may be divided: otherwise browsers also divide words in headings.
            is_long = column.is_text and max(map(len, cell.split()), default=0) > _MAX_WORD
            css_class = _LONG_TEXT_CLASS if is_long else column.css_class
            row += f"<td{css_class}>{escape(_keep_units(cell))}</td>"
        rows.append(f"<tr>{row}</tr>")
    table_class = ' class="w"' if len(rows) <= _MAX_WHOLE_TABLE else ""
    heading = "".join(f"<th{column.css_class}>{column.heading}</th>" for column in columns)
    body = "\n".join(rows)
    return f"<table{table_class}><thead><tr>{heading}</tr></thead><tbody>\n{body}\n</tbody></table>"


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
