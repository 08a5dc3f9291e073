"""Settings of figures for print: width and title. This module does not need matplotlib."""

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
    title : bool
        True if the figure has a title; figures of papers have captions instead.
    """

    width: float | None = None
    title: bool = True

    def over(self, other: PrintedAs) -> PrintedAs:
        """Return these settings, completed by the settings of `other` that are not set here.

        A title is omitted if either object omits it.
        """
        return PrintedAs(self.width or other.width, self.title and other.title)


ON_SCREEN = PrintedAs()

PRINTED: ContextVar[PrintedAs] = ContextVar("printed", default=ON_SCREEN)
"""Settings of the running command."""

_LENGTH = re.compile(r"([0-9.]+)\s*([a-z]+)")
_KEYS = ("width", "title")


def parse_style(text: str, of: str = "--style", before: PrintedAs = ON_SCREEN) -> PrintedAs:
    """Return the settings that a text specifies.

    The text is a list of items, separated by commas: a width or KEY=VALUE.

    Parameters
    ----------
    text : str
        For example `90mm` or `width=90mm,title=no`.
    of : str
        Source of the text, for error messages.

    Raises
    ------
    UsageError
        A part is invalid, or a width is out of range.
    """
    printed = before
    for item in text.split(","):
        key, equals, value = (part.strip() for part in item.partition("="))
        # A width is recognized without a key.
        if not equals and _LENGTH.fullmatch(key):
            key, value = "width", key
        if key == "width":
            printed = replace(printed, width=figure_width(value, of))
        elif key == "title" and value in ("yes", "no"):
            printed = replace(printed, title=value == "yes")
        elif key == "title":
            raise UsageError(f"{of} {item.strip()!r}: title must be yes or no")
        else:
            hint = did_you_mean(key, _KEYS) or "; specify a width (90mm), width=90mm or title=no"
            raise UsageError(f"{of} {item.strip()!r}: unknown key{hint}")
    return printed


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


def in_print(text: str) -> str:
    """Return the printed form of a text in a figure, with symbols instead of ASCII words such as
    omega."""
    for word, symbol in SYMBOLS.items():
        text = text.replace(word, symbol)
    return text
