"""How pictures are drawn for print: a column's width, a journal's font, the words of the paper. No
matplotlib here."""

from __future__ import annotations

import re
from contextvars import ContextVar
from dataclasses import dataclass, replace

from tdint.errors import UsageError, did_you_mean
from tdint.units import LENGTH

NARROWEST, WIDEST = 0.03, 0.6
"""Widths of a figure, m: no panel has room on less than a narrow column, no journal's page is
wider."""


@dataclass(frozen=True)
class PrintedAs:
    """What is asked of a picture beside what it shows.

    Attributes
    ----------
    width : float or None
        Width of the figure, m; letters have 6 to 8 points then, and lines are thinner.
    font : str or None
        Name of a font of this machine.
    title : bool
        Whether it has a title; papers have captions.
    labels : tuple of (str, str)
        What stands in the picture, and what shall: `trio` and `present method`.
    style : str or None
        A style sheet of matplotlib, which has the last word on sizes, lines and colors.
    """

    width: float | None = None
    font: str | None = None
    title: bool = True
    labels: tuple[tuple[str, str], ...] = ()
    style: str | None = None

    def over(self, other: PrintedAs) -> PrintedAs:
        """The same, and where nothing is asked for what the other one asks."""
        return PrintedAs(
            self.width or other.width,
            self.font or other.font,
            self.title and other.title,
            (*self.labels, *other.labels),
            self.style or other.style,
        )


ON_SCREEN = PrintedAs()

PRINTED: ContextVar[PrintedAs] = ContextVar("printed", default=ON_SCREEN)
"""What is asked for in the command that runs."""

TRUSTED: ContextVar[bool] = ContextVar("trusted", default=True)
"""Whether a style sheet may have programs started: not one that came with a file of somebody
else."""

_PART = re.compile(r"""(?:'[^']*'|"[^"]*"|[^,'"])+""")
_QUOTED = re.compile(r"""'([^']*)'|"([^"]*)\"""")
_LENGTH = re.compile(r"([0-9.]+)\s*([a-z]+)")
_WORDS = ("width", "font", "title", "label:NAME", "file")


def parse_style(text: str, of: str = "--style", before: PrintedAs = ON_SCREEN) -> PrintedAs:
    """Looks as they are written: a width, a style sheet or KEY=VALUE, with commas between them,
    quotes around commas.

    Parameters
    ----------
    text : str
        Such as `90mm`, `paper.mplstyle`, `width=90mm,font='Times New
        Roman',title=no,label:moment4=present method`.
    of : str
        Where it stands, for errors.
    before : PrintedAs
        What was asked for before; the text goes over it.

    Raises
    ------
    UsageError
        A part that is none of these, or a width out of range.
    """
    # What is left between the parts are commas, or a quotation mark that nothing closes.
    if not text.strip() or re.sub(_PART, "", text).strip(","):
        raise UsageError(
            f"{of} {text!r}: write a width (90mm), a style sheet (paper.mplstyle) or KEY=VALUE,..."
        )
    printed = before
    for part in (part.strip() for part in _PART.findall(text)):
        key, equals, value = part.partition("=")
        key, value = (
            _QUOTED.sub(lambda match: match[1] or match[2] or "", words).strip()
            for words in (key, value)
        )
        name = key.removeprefix("label:")
        # A style sheet and a width say by themselves what they are.
        if not equals and key.lower().endswith(".mplstyle"):
            printed = replace(printed, style=key)
        elif not equals and _LENGTH.fullmatch(key):
            printed = replace(printed, width=figure_width(key, of))
        elif key == "width":
            printed = replace(printed, width=figure_width(value, of))
        elif key == "font" and value:
            printed = replace(printed, font=value)
        elif key == "file" and value:
            printed = replace(printed, style=value)
        elif key == "title" and value in ("yes", "no"):
            printed = replace(printed, title=value == "yes")
        elif key.startswith("label:") and name and value:
            printed = replace(printed, labels=(*printed.labels, (name, value)))
        else:
            raise UsageError(f"{of} {part!r}: {_told(key, bool(equals))}")
    return printed


def _told(key: str, has_value: bool) -> str:
    """What is wrong with a part of a style."""
    if key == "title":
        return "title is yes or no"
    if key.partition(":")[0] == "label":
        return "write label:NAME=TEXT, such as label:moment4='present method'"
    if has_value and key in _WORDS:
        return f"{key} has no value"
    hint = did_you_mean(key, _WORDS) or f"; the words are {', '.join(_WORDS)}"
    return f"no such word{hint}"


def figure_width(text: str, of: str = "--style") -> float:
    """A width in m of what is written with its unit, 90mm or 3.5in; UsageError outside of what a
    page has."""
    length = _LENGTH.fullmatch(text.strip())
    try:
        width = float(length[1]) * LENGTH[length[2]] if length else 0.0
    except (KeyError, ValueError):
        width = 0.0
    if not NARROWEST <= width <= WIDEST:
        raise UsageError(
            f"{of} width {text!r}: write a length from 30 to 600 mm, such as 90mm or 3.5in"
        )
    return width


SYMBOLS = {
    "dt/T": "Δt/T",
    "dt / T": "Δt/T",
    "omega dt": "ωΔt",
    "rho_inf": "ρ∞",
    "omega": "ω",
    "alpha=": "α=",
    "beta=": "β=",
    "gamma=": "γ=",
    "theta=": "θ=",
    "m/s^2": "m/s²",
    "^2": "²",
    "^3": "³",
}
"""Of print, for words that can be typed; the first ones go first."""


def in_print(text: str, printed: PrintedAs) -> str:
    """A text of a picture as it is printed: another label in its place, symbols as the field writes
    them."""
    # Words of the paper stay as they were given; symbols are put into all others.
    for before, after in printed.labels:
        if text.strip() == before or text.strip().startswith(before + ":"):
            return text.replace(text.strip(), after)
    for word, symbol in SYMBOLS.items():
        text = text.replace(word, symbol)
    return text
