"""HTML reports: one file that contains its tables and figures, works offline and prints on A4."""

from __future__ import annotations

import base64
import io
import math
import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from html import escape
from typing import TYPE_CHECKING, Any

from tdint.number_parsing import table_number
from tdint.output import figures
from tdint.output.summary import versions
from tdint.output.tables.table import TEXT, Cell, Table, converted
from tdint.units import OutputUnits, suffix

if TYPE_CHECKING:
    from matplotlib.figure import Figure

MOST_COLUMNS = 9
"""Maximum number of columns of a table on A4, so that four-digit numbers at 8.5 pt do not wrap."""

DIGEST = "SHA-256"
"""Name of the column of SHA-256 digests, which has a small font because digests are long."""

_LARGE = 160_000
"""Size of an SVG figure, bytes, above which PNG is used instead: long histories have many points.
"""

_STYLE = """
@page { size: A4; margin: 15mm 15mm 18mm; @bottom-center { content: counter(page) " / " counter(pages);
  font: 8pt Helvetica, Arial, sans-serif; color: #555 } }
body { font: 10pt/1.4 Helvetica, Arial, sans-serif; color: #111; max-width: 180mm; margin: 8mm auto; padding: 0 4mm }
h1 { font-size: 16pt; margin: 0 0 2mm } h2 { font-size: 12pt; margin: 6mm 0 2mm; border-bottom: 1px solid #bbb }
p { margin: 0 0 2.5mm } table { border-collapse: collapse; font-size: 8.5pt; margin: 2mm 0 3mm; width: 100% }
th, td { border-bottom: 1px solid #ddd; padding: 0.5mm 1.2mm; text-align: right; vertical-align: top }
td { white-space: nowrap } td.t { white-space: normal } p.h { margin: 0 0 3mm }
td.d { font: 6.5pt monospace; text-align: left } th.d { text-align: left }
th { border-bottom-color: #888; font-weight: 600 } th.t, td.t { text-align: left; overflow-wrap: anywhere }
thead { display: table-header-group } tr, figure, p.w, p.v { break-inside: avoid } h2, p.k { break-after: avoid }
figure { margin: 2mm 0 3mm } img { max-width: 100%; display: block; margin: 0 auto }
figcaption { font-size: 8.5pt; color: #444 } p.w { border-left: 3px solid #b03a2e; padding-left: 3mm }
p.v { border: 1.5px solid #555; padding: 1.5mm 3mm; font-weight: 700 }
p.kept { border-color: #1e7d3c; color: #14602c } p.broken { border-color: #b03a2e; color: #a02a1e }
code { font-size: 8pt; overflow-wrap: anywhere } ul { margin: 1mm 0 2.5mm; padding-left: 5mm }
.n { break-before: page }
@media print { body { margin: 0; padding: 0; max-width: none } }
"""  # noqa: E501

# Dimensions of the printed page, mm: area between the margins, and text sizes in Helvetica.
_PAGE, _WIDTH = 262.0, 180.0
_LINE, _LETTERS = 4.94, 96  # line height (10 pt times 1.4), characters per line (1.87 mm each)
_TABLE_LINE, _TABLE_LETTER = 4.2, 1.65
# Vertical margins, as far as they do not collapse with the margin above. The margin of a figure
# includes its caption, the margin of a table row its border.
_PARAGRAPH, _HEADING, _ROW, _FIGURE, _TABLE = 2.5, 11.4, 1.3, 7.4, 3.0
_FIRST_ROWS = 33.0  # height of a heading of three lines and of three rows of a table
_KEPT = 34.0  # minimum height below a heading; otherwise the heading moves to the next page
_WHITE = 52.0  # maximum height left blank before a figure; less than a quarter of a page
_LEAST_PART = 0.6  # minimum fraction of a figure's full size; a smaller figure is postponed
_LEAST_LAST, _MOST_BLANK = 0.33, 0.2
"""Fractions of a page: least content of the last page and most blank area on other pages."""
_SURE = 1.5 * _PAGE  # distance from a fixed break up to which estimated positions are reliable
_TALLEST, _USUAL = 195.0, 110.0  # maximum heights of the first figure and of later figures


@dataclass(frozen=True)
class Picture:
    """Figure with its caption."""

    draw: Callable[[], Figure]
    caption: str


Part = str | Table | Picture | Sequence[str]
"""Paragraph, table, figure, or list of points."""


@dataclass(frozen=True)
class Chapter:
    """Heading with its content."""

    title: str
    parts: Sequence[Part]


@dataclass(frozen=True)
class Told:
    """Texts of a report that are not computed from its tables.

    Attributes
    ----------
    said : sequence of str
        Results in a few sentences.
    verdict : sequence of (bool or None, str)
        Headline sentences. True: the limit is met; False: the limit is exceeded or the building
        collapsed; None: no limit was requested.
    warnings : sequence of str
        Warnings about the results.
    head : sequence of (str, str)
        Names and texts of the first lines: project, author, date.
    inputs : sequence of mapping
        Input files with their SHA-256.
    limits : Table or None
        Comparisons of the demands with several limits; None if the verdict contains everything.
    governing_story : int or None
        Story of the highest ratio of demand to limit, from 1; None without limits of stories.
    """

    said: Sequence[str] = ()
    warnings: Sequence[str] = ()
    head: Sequence[tuple[str, str]] = ()
    inputs: Sequence[Mapping[str, Any]] = ()
    verdict: Sequence[tuple[bool | None, str]] = ()
    limits: Table | None = None
    governing_story: int | None = None


def page_units(units: OutputUnits) -> OutputUnits:
    """Return the units of a report.

    N is replaced by kN, kg by the unit of mass that belongs to the unit of force, and
    accelerations are in g unless a unit was selected. Tables then have the same units as figures,
    and no number needs a power of ten.
    """
    units = replace(units, force="kN") if units.force == "N" else units
    return replace(units, mass=units.matching_mass_unit).in_figures


class _Flow:
    """Parts of a report in their order, with an estimate of the position on the printed page.

    The estimated position (`down`, mm) is used to keep headings with their content, to avoid large
    blank areas and to reduce figures to the available space.
    """

    def __init__(self, scale: float = 1.0, fresh: int = 0) -> None:
        self.scale = scale  # factor of the heights of figures
        self.fresh = fresh  # number of chapters from the end, of which the first begins a page
        self.blank = 0.0  # largest blank area at the end of a page, mm
        self.body: list[str] = []
        self.down = 0.0
        self.since = 0.0  # mm since the last page break whose position is known
        self.waiting: list[tuple[str, str, float]] = []

    @property
    def cost(self) -> float:
        """Measure of blank areas and of reduced figures; 0 for a page without either."""
        last = max(_LEAST_LAST - self.down / _PAGE, 0.0)
        return 10.0 * (last + max(self.blank / _PAGE - _MOST_BLANK, 0.0)) + 1.0 - self.scale

    def text(self, element: str, text: str, *, more: str = "", height: float = 0.0) -> None:
        """Add a paragraph.

        Parameters
        ----------
        element : str
            Name of the HTML element.
        text : str
            HTML content.
        more : str
            Attributes of the element; empty by default.
        height : float
            Height in addition to the text lines, mm; 0 selects the margin of a paragraph.
        """
        lines = sum(
            -(-max(len(line), 1) // _LETTERS) for line in re.sub("<br>", "\n", text).split("\n")
        )
        self.body.append(f"<{element}{more}>{text}</{element.split()[0]}>")
        self.go(lines * _LINE + (height or _PARAGRAPH))

    def go(self, height: float) -> None:
        """Advance the position by the height (mm) of content that may break between pages."""
        self.since += height
        self.down = (self.down + height) % _PAGE

    def kept(self, height: float) -> str:
        """Return the HTML class that moves content to the next page if less than `height` is left.

        Far from the last known break, the decision is left to the browser.
        """
        if _PAGE - self.down >= height:
            return ""
        self.blank = max(self.blank, _PAGE - self.down)
        # The heights are estimates, so the position is unknown far from the last known page break.
        # A chapter that must begin a new page (infinite height) does not depend on the estimate.
        is_known = self.since < _SURE or math.isinf(height)
        self.down = 0.0
        self.since = 0.0 if is_known else self.since
        return ' class="n"' if is_known else ""

    def heading(self, title: str, part: Part = "", *, fresh: bool = False) -> None:
        """Add the heading of a chapter; it remains on the page of the content that follows.

        Parameters
        ----------
        title : str
            Heading.
        part : Part
            First part of the chapter; the first rows of a table remain below its heading.
        fresh : bool
            True to begin a new page; false by default.
        """
        rows = _HEADING + _FIRST_ROWS if isinstance(part, Table) else _KEPT
        needed = math.inf if fresh and self.down > 0.0 else rows
        self.body.append(f"<h2{self.kept(needed)}>{escape(title)}</h2>")
        self.go(_HEADING)

    def picture(self, image: str, caption: str, ratio: float, *, last: bool = False) -> None:
        """Add a figure as large as the space allows, or postpone a figure that would be small.

        Parameters
        ----------
        image : str
            Attributes of the HTML image.
        caption : str
            Caption.
        ratio : float
            Height divided by width.
        last : bool
            True if no content follows, so that the figure cannot be postponed; false by default.
        """
        first = not any(text.startswith("<figure") for text in self.body)
        full, room = (
            self.scale * min(_WIDTH * ratio, _TALLEST if first else _USUAL),
            _PAGE - self.down - _FIGURE,
        )
        large = full <= room
        if not large and room >= _WHITE - _FIGURE and room < _LEAST_PART * full and not last:
            self.waiting.append((image, caption, ratio))
            return
        page_class = self.kept(_WHITE) if not large else ""
        height = min(
            full, _PAGE - self.down - _FIGURE, math.inf if self.since < _SURE or first else _WHITE
        )
        size = f'style="width: {min(height / ratio, _WIDTH):.0f}mm"'
        self.body.append(
            f"<figure{page_class}><img {size} {image}><figcaption>{caption}</figcaption></figure>"
        )
        self.go(height + _FIGURE)

    def place(self, *, last: bool = False) -> None:
        """Add the postponed figures, as far as there is space now."""
        waiting, self.waiting = self.waiting, []
        for image, caption, ratio in waiting:
            self.picture(image, caption, ratio, last=last)


def page(title: str, about: str, chapters: Iterable[Chapter], told: Told) -> bytes:
    """Return a report as UTF-8 HTML.

    The order is: title, verdict, introduction, warnings, chapters, input files, software versions.

    Parameters
    ----------
    title : str
        Title of the report.
    about : str
        Introduction of one sentence.
    chapters : iterable of Chapter
        Chapters; a chapter without content is omitted.
    told : Told
        Verdict, warnings, lines of the head and input files.
    """
    # The first 16 digits of a plug-in's digest are enough to distinguish its versions.
    packages = versions()
    plugins = {
        f"plug-in {name}": digest[:16] for name, digest in packages.pop("plugins", {}).items()
    }
    made = ", ".join(f"{name} {number}" for name, number in (packages | plugins).items() if number)
    title_text, listed = title, list(chapters)
    drawn: dict[int, tuple[str, float]] = {}

    def laid_out(scale: float, fresh: int = 0) -> _Flow:
        """Return all parts with figures of this scale; the last `fresh` chapters begin a page."""
        return _laid_out(title_text, about, listed, told, made, _Flow(scale, fresh), drawn)

    # Figures are reduced until neither the last page nor another page is nearly blank. If that is
    # not sufficient, one of the last chapters begins on the last page.
    flow = min(map(laid_out, _SCALES), key=lambda found: found.cost)
    if flow.cost > 1.0 - _SCALES[-1]:
        broken = (laid_out(scale, fresh) for fresh in _FRESH for scale in _SCALES)
        flow = min(flow, *broken, key=lambda found: found.cost)
    text = (
        '<!DOCTYPE html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        f"<title>{escape(title)}</title>\n<style>{_STYLE}</style>\n</head>\n<body>\n"
        + "\n".join(flow.body)
    )
    return (text + "\n</body>\n</html>\n").encode("utf-8", "replace")


_SCALES = tuple(1.0 - 0.04 * step for step in range(9))
"""Factors of the heights of figures that are tried; smaller figures are hard to read."""

_FRESH = (1, 2, 3)
"""Numbers of chapters from the end that begin on a new page, if the last page is nearly blank."""


def _laid_out(
    title: str,
    about: str,
    chapters: Sequence[Chapter],
    told: Told,
    made: str,
    flow: _Flow,
    drawn: dict[int, tuple[str, float]],
) -> _Flow:
    """Return the flow with all parts of a page.

    Parameters
    ----------
    title, about : str
        Title and introduction.
    chapters : sequence of Chapter
        Chapters.
    told : Told
        Verdict, warnings, lines of the head and input files.
    made : str
        Versions of the software.
    flow : _Flow
        Empty flow with its scale of figures.
    drawn : dict
        Attributes of the HTML image and ratio of height to width of each figure that is already
        drawn.
    """
    flow.text("h1", escape(title), height=_LINE)
    if told.head:
        lines = (f"<strong>{escape(name)}:</strong> {escape(text)}" for name, text in told.head)
        flow.text("p", "<br>".join(lines), more=' class="h"')
    # The verdict comes first; warnings precede all numbers.
    for kept, text in told.verdict:
        kind = "" if kept is None else " kept" if kept else " broken"
        flow.text("p", _said(text), more=f' class="v{kind}"', height=6.3)
    flow.text("p", _said(about))
    for text in once(told.warnings):
        flow.text("p", f"<strong>Warning:</strong> {_said(text)}", more=' class="w"')
    # The last chapter lists each input file once.
    files: list[tuple[Cell, ...]] = list(
        dict.fromkeys((item["file"], item["sha256"]) for item in told.inputs)
    )
    written = (
        (chapter.title, [part for part in chapter.parts if _has(part)])
        for chapter in (*chapters, Chapter("Inputs", (Table(("file", DIGEST), files),)))
    )
    # A chapter without content has no heading.
    shown = [(title, parts) for title, parts in written if parts]
    for left, (title, parts) in zip(range(len(shown), 0, -1), shown, strict=True):
        flow.place()
        flow.heading(title, parts[0], fresh=left == flow.fresh)
        for part in parts:
            _add(flow, part, drawn)
    flow.place(last=True)
    flow.text("p", f"Made by {escape(made)}.")
    return flow


def _has(part: Part) -> bool:
    """Return True if the part has content."""
    return bool(part.rows) if isinstance(part, Table) else bool(part)


def _add(flow: _Flow, part: Part, drawn: dict[int, tuple[str, float]]) -> None:
    """Add a part to the page; `drawn` has the figures that are already drawn."""
    if isinstance(part, str):
        flow.text("p", _said(part), more=' class="k"' if part.endswith(":") else "")
    elif isinstance(part, Table):
        _add_table(flow, part)
    elif isinstance(part, Picture):
        caption = escape(part.caption)
        if id(part) not in drawn:
            kind, content, (wide, high) = _drawn(part)
            data = base64.b64encode(content).decode("ascii")
            source = f'alt="{caption}" src="data:image/{kind};base64,{data}"'
            drawn[id(part)] = source, high / wide
        flow.picture(drawn[id(part)][0], caption, drawn[id(part)][1])
    else:
        lines = sum(-(-len(point) // _LETTERS) for point in part)
        flow.body.append("<ul>" + "".join(f"<li>{_said(point)}</li>" for point in part) + "</ul>")
        flow.go(lines * _LINE + 1.0 + _PARAGRAPH)


def _said(text: str) -> str:
    """Return a text as HTML: lines are kept, and numbers are written without powers of ten."""
    return "<br>".join(escape(_plain(line)) for line in text.splitlines())


_POWER = re.compile(r"(?<![\w.])(-?)(\d(?:\.\d+)?)e([+-]\d+)\b")


def _plain(text: str) -> str:
    """Return a text in which numbers have no power of ten (`table_number`)."""
    return _POWER.sub(lambda match: table_number(float(match[0])), text)


def once(texts: Iterable[str]) -> list[str]:
    """Return distinct texts; texts `FILE: text` that differ only in the file name are merged."""
    files: dict[str, dict[str, None]] = {}  # dictionaries keep the order of the texts
    for text in texts:
        file, colon, message = text.partition(": ")
        files.setdefault(message if colon else text, {})[file if colon else ""] = None
    return [f"{'; '.join(names)}: {text}" if any(names) else text for text, names in files.items()]


def _drawn(picture: Picture) -> tuple[str, bytes, tuple[float, float]]:
    """Return the format, the content and the size of a figure.

    PNG is used instead of SVG if lines with thousands of points make the SVG file large.
    """
    for kind in ("svg+xml", "png"):
        drawing, stream = figures.style.picture(f".{kind[:3]}", picture.draw), io.BytesIO()
        figure = drawing.figure()
        drawing.save(figure, stream)
        if len(stream.getvalue()) <= _LARGE:
            break
    return kind, stream.getvalue(), tuple(figure.get_size_inches())


def _add_table(flow: _Flow, table: Table) -> None:
    """Add a table with units in its heading and drift ratios in percent.

    Empty columns and the zero forces of absent dampers are omitted. A table that is wider than the
    page is continued below, again with its first column.
    """
    # The heading is the column name with spaces and the unit in parentheses. Text and digests are
    # left-aligned.
    heads, sides, cells = [], [], []
    moved = _largest_of(table, (name for name in table.columns if _is_moved(table, name)))
    for i, name in enumerate(table.columns):
        column = [row[i] for row in table.rows]
        unit, factor = table.meanings.get(name, {}).get("unit", TEXT), 1.0
        error = " error" * name.endswith("_error")
        bare = name.removesuffix("_error").removesuffix(suffix(unit)).replace("_", " ")
        # Drifts and displacements of a table have one unit.
        largest = moved if _is_moved(table, name) else _largest_of(table, (name,))
        if "drift_ratio" in name:
            unit, factor = "%", 0.01
        elif unit == "m" and 0.0 < largest < _MILLIMETERS:
            unit, factor = "mm", 1e-3
        elif unit == "t" and 0.0 < largest < 1.0:
            unit, factor = "kg", 1e-3
        heads.append(
            escape(
                f"{bare}{error}" + ("" if unit in (TEXT, "1") else f" ({unit.replace('^2', '²')})")
            )
        )
        sides.append(' class="d"' if name == DIGEST else ' class="t"' if unit == TEXT else "")
        if name == "record":
            # Files have short, distinct names here; the chapter Inputs lists their paths.
            short_names = figures.style.record_names(map(str, column))
            column = [short_names[str(cell)] for cell in column]
        written = [_shown(converted(cell, factor), largest / factor) for cell in column]
        cells.append([""] * len(written) if "damper_force" in name and largest == 0.0 else written)
    kept = [i for i, column in enumerate(cells) if any(column)]
    # Each part of a divided table repeats the first column, which identifies the row.
    widths = [kept[:MOST_COLUMNS]]
    for first in range(MOST_COLUMNS, len(kept), MOST_COLUMNS - 1):
        widths.append([kept[0], *kept[first : first + MOST_COLUMNS - 1]])
    for columns in widths:
        # The width of a number column follows from its longest cell and heading word. The remaining
        # width is divided between the text columns.
        most = {i: max(map(len, cells[i])) for i in columns}
        wide = [i for i in columns if sides[i] and "d" not in sides[i]]
        numbers = sum(max(most[i], *map(len, heads[i].split())) for i in columns if i not in wide)
        words = (_WIDTH - 2.4 * len(columns)) / _TABLE_LETTER - numbers
        part = min(1.0, max(words, 20.0) / max(sum(most[i] for i in wide), 1))
        head = "".join(f"<th{sides[i]}>{heads[i]}</th>" for i in columns)
        one_line = numbers + sum(len(heads[i]) for i in columns) < words + numbers
        high = (
            1 if one_line else max(-(-len(heads[i]) // 15) for i in columns)
        ) * _TABLE_LINE + _ROW
        page_class = flow.kept(high + 3.0 * (_TABLE_LINE + _ROW))
        flow.go(high + _TABLE)
        lines = []
        for number in range(len(table.rows)):
            row = "".join(f"<td{sides[i]}>{escape(cells[i][number])}</td>" for i in columns)
            lines.append(f"<tr>{row}</tr>")
            tall = max(
                (math.ceil(len(cells[i][number]) / max(part * most[i], 1.0)) for i in wide),
                default=1,
            )
            step = max(tall, 1) * _TABLE_LINE + _ROW
            # The heading is repeated on each page.
            flow.go(step if flow.down + step <= _PAGE else _PAGE - flow.down + high + step)
        rows = "\n".join(lines)
        flow.body.append(
            f"<table{page_class}><thead><tr>{head}</tr></thead><tbody>\n{rows}\n</tbody></table>"
        )


def _is_moved(table: Table, name: str) -> bool:
    """Return True for a column of drifts or displacements, with their errors."""
    unit = table.meanings.get(name, {}).get("unit", TEXT)
    return unit == "m" and any(word in name for word in ("drift", "displacement"))


def _largest_of(table: Table, names: Iterable[str]) -> float:
    """Return the largest absolute number of some columns; 0 without a number."""
    places = [table.columns.index(name) for name in names]
    numbers = (row[i] for row in table.rows for i in places)
    return max(
        (abs(cell) for cell in numbers if isinstance(cell, float) and math.isfinite(cell)),
        default=0.0,
    )


_MILLIMETERS = 0.01
"""m; a column of lengths with smaller values is printed in mm, so that it needs no power of ten."""


def _shown(cell: Cell, largest: float = 1.0) -> str:
    """Return a cell; `largest` is the maximum of its column."""
    if isinstance(cell, float):
        return table_number(cell, largest)
    return "" if cell is None else _plain(str(cell))
