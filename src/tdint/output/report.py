"""A page for a report: one HTML file with tables and pictures in it, which needs no network and prints on A4."""

from __future__ import annotations

import base64
import io
import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from html import escape
from typing import TYPE_CHECKING, Any

from tdint.model.definition import ModalDamping, Model, RayleighCoefficients, RayleighRatio
from tdint.output import figures
from tdint.output.summary import versions
from tdint.output.tables.table import TEXT, Cell, Table
from tdint.output_units import SI, OutputUnits
from tdint.quantity import suffix
from tdint.written_numbers import how_many

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_LARGE = 160_000
"""Bytes of a picture as SVG, from which it is put in as PNG: a long history has many points."""

_STYLE = """
@page { size: A4; margin: 15mm }
body { font: 10pt/1.4 system-ui, "Segoe UI", Helvetica, Arial, sans-serif; color: #111; max-width: 180mm;
  margin: 8mm auto; padding: 0 4mm }
h1 { font-size: 16pt; margin: 0 0 2mm } h2 { font-size: 12pt; margin: 7mm 0 2mm; border-bottom: 1px solid #bbb }
table { border-collapse: collapse; font-size: 8.5pt; margin: 2mm 0; width: 100% }
th, td { border-bottom: 1px solid #ddd; padding: 0.6mm 1.5mm; text-align: right; vertical-align: top }
th { border-bottom-color: #888; font-weight: 600 } th.t, td.t { text-align: left; overflow-wrap: anywhere }
thead { display: table-header-group } tr, table, figure, p.w { break-inside: avoid } h2 { break-after: avoid }
figure { margin: 3mm 0 } img { max-width: 100%; max-height: 245mm; display: block; margin: 0 auto }
figcaption { font-size: 8.5pt; color: #444 } p.w { border-left: 3px solid #b03a2e; padding-left: 3mm }
code { font-size: 8pt; overflow-wrap: anywhere } ul { margin: 1mm 0; padding-left: 5mm }
@media print { body { margin: 0; padding: 0; max-width: none } img { max-height: 185mm } }
"""

LEFT_OUT = (
    "Each floor is one mass that moves sideways in one direction; there is no torsion, no floor flexibility, no "
    "overturning and no axial force in columns, no soil.",
    "Each story is one spring from floor to floor: what columns, beams and joints do apart is in its law or not at "
    "all, and two directions of a motion act one at a time.",
    "Story laws do not know of one another; strength does not depend on axial force.",
)
"""What a shear building leaves out."""


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


def page(title: str, about: str, chapters: Iterable[Chapter], warnings: Sequence[str] = ()) -> bytes:
    """The page, UTF-8: title, a sentence about it, warnings, chapters; and the versions that made it."""
    made = ", ".join(f"{name} {number}" for name, number in versions().items() if number)
    body = [f"<h1>{escape(title)}</h1>", f"<p>{escape(about)}</p>"]
    body += [f'<p class="w"><strong>Warning:</strong> {_said(text)}</p>' for text in warnings]
    for chapter in chapters:
        if any(_has(part) for part in chapter.parts):
            body += [f"<h2>{escape(chapter.title)}</h2>", *(_part(part) for part in chapter.parts if _has(part))]
    body.append(f"<h2>Versions</h2><p>{escape(made)}</p>")
    text = (
        '<!DOCTYPE html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        f"<title>{escape(title)}</title>\n<style>{_STYLE}</style>\n</head>\n<body>\n" + "\n".join(body)
    )
    return (text + "\n</body>\n</html>\n").encode("utf-8", "replace")


def _has(part: Part) -> bool:
    return bool(part.rows) if isinstance(part, Table) else bool(part)


def _part(part: Part) -> str:
    if isinstance(part, str):
        return f"<p>{_said(part)}</p>"
    if isinstance(part, Table):
        return _table(part)
    if isinstance(part, Picture):
        return f"<figure>{_image(part)}<figcaption>{escape(part.caption)}</figcaption></figure>"
    return "<ul>" + "".join(f"<li>{_said(point)}</li>" for point in part) + "</ul>"


def _said(text: str) -> str:
    """Text of files' names and headers, lines kept."""
    return "<br>".join(escape(line) for line in text.splitlines())


def _image(picture: Picture) -> str:
    kind, content = "svg+xml", _drawn(picture, ".svg")
    if len(content) > _LARGE:
        kind, content = "png", _drawn(picture, ".png")
    data = base64.b64encode(content).decode("ascii")
    return f'<img alt="{escape(picture.caption)}" src="data:image/{kind};base64,{data}">'


def _drawn(picture: Picture, end: str) -> bytes:
    stream = io.BytesIO()
    figures.style.picture(end, picture.draw)(stream)
    return stream.getvalue()


def _table(table: Table) -> str:
    """A table with its units in the heading, columns without any value left out."""
    kept = [i for i in range(len(table.columns)) if any(_shown(row[i]) for row in table.rows)]
    words = {i for i in kept if table.meanings.get(table.columns[i], {}).get("unit", TEXT) == TEXT}
    side = {i: ' class="t"' if i in words else "" for i in kept}
    head = "".join(f"<th{side[i]}>{escape(_heading(table, i))}</th>" for i in kept)
    rows = ("".join(f"<td{side[i]}>{escape(_shown(row[i]))}</td>" for i in kept) for row in table.rows)
    lines = "\n".join(f"<tr>{cells}</tr>" for cells in rows)
    return f"<table><thead><tr>{head}</tr></thead><tbody>\n{lines}\n</tbody></table>"


def _heading(table: Table, i: int) -> str:
    name = table.columns[i]
    unit = table.meanings.get(name, {}).get("unit", TEXT)
    error = " error" * name.endswith("_error")
    bare = name.removesuffix("_error").removesuffix(suffix(unit)).replace("_", " ")
    return f"{bare}{error}" + ("" if unit in (TEXT, "1") else f" ({unit.replace('^2', '²')})")


def _shown(cell: Cell) -> str:
    if cell is None or (isinstance(cell, float) and math.isnan(cell)):
        return ""
    return f"{cell:.4g}" if isinstance(cell, float) else str(cell)


def model_chapter(model: Model, period: float, damping: float, units: OutputUnits = SI) -> Chapter:
    """The building: its stories from the ground up, period (s) and damping ratio of its first mode, P-delta."""
    from tdint.output.tables.buildings import model_table

    p_delta = "with P-delta" if model.p_delta else "without P-delta"
    facts = (
        f"{how_many(len(model.stories), 'story')}, first period {period:.4g} s with {100.0 * damping:.3g} % damping, "
        f"{p_delta}, {damping_words(model)}. A drift ratio over {100.0 * model.collapse_drift:g} % counts as collapse."
    )
    return Chapter(f"Building: {model.name}", (facts, model_table(model, units)))


def damping_words(model: Model) -> str:
    """The damping besides dashpots, in a few words."""
    left_out = "" if all(story.rayleigh for story in model.stories) else ", less what it would be in isolators"
    match model.damping:
        case RayleighRatio(ratios, modes):
            pairs = dict.fromkeys(zip(ratios, modes, strict=True))
            told = " and ".join(f"{100.0 * ratio:g} % in mode {mode}" for ratio, mode in pairs)
            return f"Rayleigh damping of {told}{left_out}"
        case RayleighCoefficients(mass, stiffness):
            return f"Rayleigh damping of {mass:.4g} 1/s times mass and {stiffness:.4g} s times stiffness{left_out}"
        case ModalDamping(ratios):
            return f"modal damping of {', '.join(f'{100.0 * ratio:g}' for ratio in ratios)} %"
    return "no damping besides dashpots"


def input_points(inputs: Iterable[Mapping[str, Any]]) -> list[str]:
    """Files with their SHA-256, each once."""
    return list(dict.fromkeys(f"{one['file']}: SHA-256 {one['sha256']}" for one in inputs))
