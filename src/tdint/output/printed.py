"""Settings of figures for print: width, font, title and labels. This module does not need
matplotlib."""

from __future__ import annotations

import re
from contextvars import ContextVar
from dataclasses import dataclass, replace

from tdint.errors import UsageError, did_you_mean
from tdint.units import LENGTH

NARROWEST, WIDEST = 0.03, 0.6
"""Minimum and maximum width of a figure, m: panels need a narrow column, and no journal page is
wider than the maximum."""


@dataclass(frozen=True)
class PrintedAs:
    """Settings of a figure for print.

    Attributes
    ----------
    width : float | None
        Width of the figure, m; with a width, font sizes are 6 to 8 pt and lines are thinner.
    font : str | None
        Name of an installed font.
    title : bool
        True if the figure has a title; figures of papers have captions instead.
    labels : tuple of (str, str)
        Labels and their replacements: `trio` and `present method`.
    style : str | None
        A matplotlib style sheet, which overrides sizes, lines and colors.
    """

    width: float | None = None
    font: str | None = None
    title: bool = True
    labels: tuple[tuple[str, str], ...] = ()
    style: str | None = None

    def over(self, other: PrintedAs) -> PrintedAs:
        """Return these settings, completed by the settings of `other` that are not set here.

        A title is omitted if either object omits it; the labels of both are joined.
        """
        return PrintedAs(
            self.width or other.width,
            self.font or other.font,
            self.title and other.title,
            (*self.labels, *other.labels),
            self.style or other.style,
        )


ON_SCREEN = PrintedAs()

PRINTED: ContextVar[PrintedAs] = ContextVar("printed", default=ON_SCREEN)
"""Settings of the running command."""

_ITEM = re.compile(r"""(?:'[^']*'|"[^"]*"|[^,'"])+""")
_QUOTED = re.compile(r"""'([^']*)'|"([^"]*)\"""")
_LENGTH = re.compile(r"([0-9.]+)\s*([a-z]+)")
_KEYS = ("width", "font", "title", "label:NAME", "file")


def parse_style(text: str, of: str = "--style", before: PrintedAs = ON_SCREEN) -> PrintedAs:
    """Return the settings that a text specifies.

    The text is a list of items, separated by commas: a width, a style sheet or KEY=VALUE. Values
    with commas are quoted.

    Parameters
    ----------
    text : str
        For example `90mm`, `paper.mplstyle`, `width=90mm,font='Times New
        Roman',title=no,label:moment4=present method`.
    of : str
        Source of the text, for error messages.

    Raises
    ------
    UsageError
        A part is invalid, or a width is out of range.
    """
    # Without the items, only commas may remain. Any other character is an unclosed quotation mark.
    if not text.strip() or re.sub(_ITEM, "", text).strip(","):
        raise UsageError(
            f"{of} {text!r} must be a width (90mm), a style sheet (paper.mplstyle) or "
            "KEY=VALUE,..., with closed quotation marks"
        )
    printed = before
    for item in (item.strip() for item in _ITEM.findall(text)):
        key, equals, value = item.partition("=")
        key, value = _unquoted(key), _unquoted(value)
        name = key.removeprefix("label:")
        # A style sheet and a width are recognized without a key.
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
            raise UsageError(f"{of} {item!r}: {_style_error(key, bool(equals))}")
    return printed


def _unquoted(text: str) -> str:
    """Return a text without its quotation marks and without spaces at its ends."""
    return _QUOTED.sub(lambda match: match[1] or match[2] or "", text).strip()


def _style_error(key: str, has_value: bool) -> str:
    """Return the error message for an invalid item of a style.

    `key` is the text before the equals sign of the item, or the complete item without an equals
    sign. `has_value` is True if the item has an equals sign.
    """
    if key == "title":
        return "title must be yes or no"
    if key.partition(":")[0] == "label":
        return "a label must be label:NAME=TEXT, such as label:moment4='present method'"
    if has_value and key in _KEYS:
        return f"{key} requires a value"
    hint = did_you_mean(key, _KEYS) or f"; the keys are {', '.join(_KEYS)}"
    return f"unknown key{hint}"


def figure_width(text: str, of: str = "--style") -> float:
    """Return the width of a figure in m from a text with a unit, such as 90mm or 3.5in.

    Raises
    ------
    UsageError
        The text is invalid, or the width is out of range.
    """
    length = _LENGTH.fullmatch(text.strip())
    try:
        width = float(length[1]) * LENGTH[length[2]] if length else 0.0
    except (KeyError, ValueError):
        width = 0.0
    if not NARROWEST <= width <= WIDEST:
        raise UsageError(
            f"{of}: width must be a length from 30 to 600 mm, such as 90mm or 3.5in, got {text!r}"
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
"""Printed symbols of ASCII text, replaced in this order."""


def in_print(text: str, printed: PrintedAs) -> str:
    """Return the printed form of a text in a figure.

    A label with a replacement is replaced. In other texts, mathematical symbols replace ASCII words
    such as omega.

    Parameters
    ----------
    printed : PrintedAs
        Print settings, which contain the replacements of labels.
    """
    # The parameters of a method may follow its label after a colon. A text such as `trio:rho=0.5`
    # is replaced completely by the replacement of `trio`.
    for label, replacement in printed.labels:
        if text.strip() == label or text.strip().startswith(f"{label}:"):
            return text.replace(text.strip(), replacement)
    for word, symbol in SYMBOLS.items():
        text = text.replace(word, symbol)
    return text
