"""A page for people: one HTML file with tables and pictures in it, which needs no network and
prints on A4."""

from __future__ import annotations

import base64
import io
import math
import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from html import escape
from typing import TYPE_CHECKING, Any

from tdint.output import figures
from tdint.output.summary import versions
from tdint.output.tables.table import TEXT, Cell, Table, converted
from tdint.units import OutputUnits, suffix

if TYPE_CHECKING:
    from matplotlib.figure import Figure

MOST_COLUMNS = 9
"""Of a table on a page of A4: numbers of four digits, at 8.5 points, do not break."""

DIGEST = "SHA-256"
"""Name of the column of digests, which are long."""

_LARGE = 160_000
"""Bytes of a picture as SVG, from which it is put in as PNG: a long history has many points."""

_STYLE = """
@page { size: A4; margin: 15mm 15mm 18mm; @bottom-center { content: counter(page) " / " counter(pages);
  font: 8pt Helvetica, Arial, sans-serif; color: #555 } }
body { font: 10pt/1.4 Helvetica, Arial, sans-serif; color: #111; max-width: 180mm; margin: 8mm auto; padding: 0 4mm }
h1 { font-size: 16pt; margin: 0 0 2mm } h2 { font-size: 12pt; margin: 6mm 0 2mm; border-bottom: 1px solid #bbb }
p { margin: 0 0 2.5mm } table { border-collapse: collapse; font-size: 8.5pt; margin: 2mm 0 3mm; width: 100% }
th, td { border-bottom: 1px solid #ddd; padding: 0.5mm 1.2mm; text-align: right; vertical-align: top }
td { white-space: nowrap } td.t { white-space: normal } p.h { margin: 0 0 3mm }
td.d { font: 6.5pt monospace; text-align: left }
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

# Of a printed page, mm: what lies between its margins, and what Helvetica of the sizes above takes.
_PAGE, _WIDTH = 262.0, 180.0
_LINE, _LETTERS = 4.94, 96  # of a paragraph: 10 points times 1.4, letters of 1.87 mm
_TABLE_LINE, _TABLE_LETTER = 4.2, 1.65
_PARAGRAPH, _HEADING, _ROW, _FIGURE = (
    2.5,
    12.0,
    1.3,
    9.5,
)  # margins, of which the larger counts; a caption with them
_KEPT = 34.0  # a heading with less below it goes to the next page with what it heads
_WHITE = 52.0  # less than a quarter of a page: so much may stay white before a picture
_LEAST_PART = 0.6  # of a picture's size: one that would be smaller waits for what comes behind it
_SURE = 1.5 * _PAGE  # estimates of longer ways are off by more than a heading
_TALLEST, _USUAL = 195.0, 110.0  # of the first picture, and of what comes after it


@dataclass(frozen=True)
class Picture:
    """A picture and what stands below it."""

    draw: Callable[[], Figure]
    caption: str


Part = str | Table | Picture | Sequence[str]
"""A paragraph, a table, a picture, or a list of points."""


@dataclass(frozen=True)
class Chapter:
    """A heading and what stands below it."""

    title: str
    parts: Sequence[Part]


@dataclass(frozen=True)
class Told:
    """What a page says beside the numbers that it is made of.

    Attributes
    ----------
    said : sequence of str
        The result in a few sentences.
    verdict : sequence of (bool or None, str)
        What was judged, and whether it is kept; None where nothing was asked for.
    warnings : sequence of str
        What changes the meaning of a number.
    head : sequence of (str, str)
        Names and texts of the lines at its top: project, author, date.
    inputs : sequence of mapping
        The files that were read, with their SHA-256.
    """

    said: Sequence[str] = ()
    warnings: Sequence[str] = ()
    head: Sequence[tuple[str, str]] = ()
    inputs: Sequence[Mapping[str, Any]] = ()
    verdict: Sequence[tuple[bool | None, str]] = ()


def page_units(units: OutputUnits) -> OutputUnits:
    """The units of a page: as given, but kN in place of N, t beside kN, accelerations in g where
    none is named; so tables have the units of pictures and no number needs a power of ten."""
    force = "kN" if units.force == "N" else units.force
    mass = "t" if (force, units.mass) == ("kN", "kg") else units.mass
    return replace(units, force=force, mass=mass).in_pictures


class _Flow:
    """The parts of a page one after the other, and how far down the printed page they have come,
    mm, by estimate: what would part from its heading or leave much of a page white is moved, and
    pictures shrink to the space there is."""

    def __init__(self) -> None:
        self.body: list[str] = []
        self.down = 0.0
        self.since = 0.0  # the last break that is sure
        self.waiting: list[tuple[str, str, float]] = []

    def text(self, element: str, text: str, *, more: str = "", height: float = 0.0) -> None:
        """A paragraph: its element, what stands in it, and mm beside its lines."""
        lines = sum(
            -(-max(len(line), 1) // _LETTERS) for line in re.sub("<br>", "\n", text).split("\n")
        )
        self.body.append(f"<{element}{more}>{text}</{element.split()[0]}>")
        self.go(lines * _LINE + (height or _PARAGRAPH))

    def go(self, height: float) -> None:
        """Down by something that may break between pages."""
        self.since += height
        self.down = (self.down + height) % _PAGE

    def kept(self, height: float) -> str:
        """The class of what needs so much room below it: on the next page where that is not there,
        which is left to the browser far from the last sure break."""
        if _PAGE - self.down >= height:
            return ""
        sure, self.down = self.since < _SURE, 0.0
        self.since = 0.0 if sure else self.since
        return ' class="n"' if sure else ""

    def heading(self, title: str) -> None:
        """A chapter's heading, with what begins it on the same page."""
        self.body.append(f"<h2{self.kept(_KEPT)}>{escape(title)}</h2>")
        self.go(_HEADING)

    def picture(self, image: str, caption: str, ratio: float, *, last: bool = False) -> None:
        """A picture as large as there is room for; one that would be small waits for what comes
        behind it."""
        first = not any(text.startswith("<figure") for text in self.body)
        whole, room = (
            min(_WIDTH * ratio, _TALLEST if first else _USUAL),
            _PAGE - self.down - _FIGURE,
        )
        large = whole <= room
        if not large and room >= _WHITE - _FIGURE and room < _LEAST_PART * whole and not last:
            self.waiting.append((image, caption, ratio))
            return
        onward = self.kept(_WHITE) if not large else ""
        height = min(
            whole, _PAGE - self.down - _FIGURE, math.inf if self.since < _SURE or first else _WHITE
        )
        size = f'style="width: {min(height / ratio, _WIDTH):.0f}mm"'
        self.body.append(
            f"<figure{onward}><img {size} {image}><figcaption>{caption}</figcaption></figure>"
        )
        self.go(height + _FIGURE)

    def place(self, *, last: bool = False) -> None:
        """The pictures that wait, where there is room for them now."""
        waiting, self.waiting = self.waiting, []
        for image, caption, ratio in waiting:
            self.picture(image, caption, ratio, last=last)


def page(title: str, about: str, chapters: Iterable[Chapter], told: Told) -> bytes:
    """The page, UTF-8: title, head, a sentence about it, warnings, chapters, the files; and the
    versions that made it."""
    # Sixteen digits of a plug-in's digest tell its versions apart.
    of_all = versions()
    code = {f"plug-in {name}": digest[:16] for name, digest in of_all.pop("plugins", {}).items()}
    made = ", ".join(f"{name} {number}" for name, number in (of_all | code).items() if number)
    flow = _Flow()
    flow.text("h1", escape(title), height=_LINE)
    if told.head:
        lines = (f"<strong>{escape(name)}:</strong> {escape(text)}" for name, text in told.head)
        flow.text("p", "<br>".join(lines), more=' class="h"')
    # What was judged comes first, and what changes the meaning of a number before all numbers.
    for kept, text in told.verdict:
        kind = "" if kept is None else " kept" if kept else " broken"
        flow.text("p", _said(text), more=f' class="v{kind}"', height=7.0)
    flow.text("p", _said(about))
    for text in once(told.warnings):
        flow.text("p", f"<strong>Warning:</strong> {_said(text)}", more=' class="w"')
    # Last come the files, each once.
    files: list[tuple[Cell, ...]] = list(
        dict.fromkeys((given["file"], given["sha256"]) for given in told.inputs)
    )
    for chapter in (*chapters, Chapter("Inputs", (Table(("file", DIGEST), files),))):
        # What there is nothing to say of has no heading.
        if parts := [part for part in chapter.parts if _has(part)]:
            flow.place()
            flow.heading(chapter.title)
            for part in parts:
                _add(flow, part)
    flow.place(last=True)
    flow.text("p", f"Made by {escape(made)}.")
    text = (
        '<!DOCTYPE html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        f"<title>{escape(title)}</title>\n<style>{_STYLE}</style>\n</head>\n<body>\n"
        + "\n".join(flow.body)
    )
    return (text + "\n</body>\n</html>\n").encode("utf-8", "replace")


def _has(part: Part) -> bool:
    return bool(part.rows) if isinstance(part, Table) else bool(part)


def _add(flow: _Flow, part: Part) -> None:
    if isinstance(part, str):
        flow.text("p", _said(part), more=' class="k"' if part.endswith(":") else "")
    elif isinstance(part, Table):
        _add_table(flow, part)
    elif isinstance(part, Picture):
        kind, content, (wide, high) = _drawn(part)
        data, caption = base64.b64encode(content).decode("ascii"), escape(part.caption)
        flow.picture(f'alt="{caption}" src="data:image/{kind};base64,{data}"', caption, high / wide)
    else:
        lines = sum(-(-len(point) // _LETTERS) for point in part)
        flow.body.append("<ul>" + "".join(f"<li>{_said(point)}</li>" for point in part) + "</ul>")
        flow.go(lines * _LINE + 1.0 + _PARAGRAPH)


def _said(text: str) -> str:
    """Text of files' names and headers, lines kept, numbers without powers of ten."""
    return "<br>".join(escape(_plain(line)) for line in text.splitlines())


_POWER = re.compile(r"(?<![\w.])(-?)(\d(?:\.\d+)?)e([+-]\d+)\b")


def _plain(text: str) -> str:
    """A text whose numbers have no powers of ten: four digits, and what is next to nothing by what
    it is below."""

    def written(found: re.Match[str]) -> str:
        value = float(found[0])
        return (
            "below 0.0001"
            if 0.0 < abs(value) < 1e-4
            else f"{value:.0f}"
            if abs(value) >= 1e4
            else f"{value:.4g}"
        )

    return _POWER.sub(written, text)


def once(texts: Iterable[str]) -> list[str]:
    """Texts, each once: what is said of several files (`FILE: text`) with their names before it."""
    files: dict[str, dict[str, None]] = {}  # sets in the order of arrival
    for text in texts:
        file, colon, rest = text.partition(": ")
        files.setdefault(rest if colon else text, {})[file if colon else ""] = None
    return [f"{'; '.join(names)}: {text}" if any(names) else text for text, names in files.items()]


def _drawn(picture: Picture) -> tuple[str, bytes, tuple[float, float]]:
    """The format, the content and the size of a picture: lines of thousands of points make a
    drawing that is larger than its pixels."""
    for kind in ("svg+xml", "png"):
        drawing, stream = figures.style.picture(f".{kind[:3]}", picture.draw), io.BytesIO()
        figure = drawing.figure()
        drawing.save(figure, stream)
        if len(stream.getvalue()) <= _LARGE:
            break
    return kind, stream.getvalue(), tuple(figure.get_size_inches())


def _add_table(flow: _Flow, table: Table) -> None:
    """A table with its units in the heading and drift ratios in percent, columns without any value
    and zeros of dampers that are not there left out; one that is wider than a page goes on below
    with its first column again."""
    # A heading is the name of its column in words, the unit in brackets; words and digests stand on
    # the left.
    heads, sides, cells = [], [], []
    for i, name in enumerate(table.columns):
        column = [row[i] for row in table.rows]
        unit, factor = table.meanings.get(name, {}).get("unit", TEXT), 1.0
        error = " error" * name.endswith("_error")
        bare = name.removesuffix("_error").removesuffix(suffix(unit)).replace("_", " ")
        largest = max(
            (abs(cell) for cell in column if isinstance(cell, float) and math.isfinite(cell)),
            default=0.0,
        )
        if "drift_ratio" in name:
            unit, factor = "%", 0.01
        elif unit == "m" and 0.0 < largest < _MILLIMETERS:
            unit, factor = "mm", 1e-3
        heads.append(
            escape(
                f"{bare}{error}" + ("" if unit in (TEXT, "1") else f" ({unit.replace('^2', '²')})")
            )
        )
        sides.append(' class="d"' if name == DIGEST else ' class="t"' if unit == TEXT else "")
        if (
            name == "record"
        ):  # files by the names that tell them apart: where they lie stands under Inputs
            called = figures.style.record_names(map(str, column))
            column = [called[str(cell)] for cell in column]
        written = [_shown(converted(cell, factor), largest / factor) for cell in column]
        cells.append([""] * len(written) if "damper_force" in name and largest == 0.0 else written)
    kept = [i for i, column in enumerate(cells) if any(column)]
    # The first column says which row it is, on each width.
    widths = [kept[:MOST_COLUMNS]]
    for first in range(MOST_COLUMNS, len(kept), MOST_COLUMNS - 1):
        widths.append([kept[0], *kept[first : first + MOST_COLUMNS - 1]])
    for columns in widths:
        # As wide as their longest cells and words of headings; columns of words share what those of
        # numbers leave.
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
        onward = flow.kept(high + 3.0 * (_TABLE_LINE + _ROW))
        flow.go(high + 1.0)
        lines = []
        for number in range(len(table.rows)):
            row = "".join(f"<td{sides[i]}>{escape(cells[i][number])}</td>" for i in columns)
            lines.append(f"<tr>{row}</tr>")
            tall = max(
                (math.ceil(len(cells[i][number]) / max(part * most[i], 1.0)) for i in wide),
                default=1,
            )
            step = max(tall, 1) * _TABLE_LINE + _ROW
            # The heading is there again on each page.
            flow.go(step if flow.down + step <= _PAGE else _PAGE - flow.down + high + step)
        rows = "\n".join(lines)
        flow.body.append(
            f"<table{onward}><thead><tr>{head}</tr></thead><tbody>\n{rows}\n</tbody></table>"
        )


_MILLIMETERS = 0.01
"""Lengths in m below this are told in mm: a column of them has four digits without a power of
ten."""


def _shown(cell: Cell, largest: float = 1.0) -> str:
    """A cell in four digits, without a power of ten: what is next to nothing beside the largest of
    its column is 0."""
    if cell is None or (isinstance(cell, float) and math.isnan(cell)):
        return ""
    if not isinstance(cell, float):
        return _plain(str(cell))
    text = f"{cell:.4g}"
    if "e" in text:
        text = (
            f"{float(text):.0f}"
            if abs(cell) >= 1.0
            else "0"
            if abs(cell) < 1e-4 * largest
            else f"{cell:.7f}"
        )
    return text
