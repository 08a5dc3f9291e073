"""How pictures are drawn for print: a column's width, a journal's font, the words of the paper. No matplotlib here."""

from __future__ import annotations

from contextvars import ContextVar
from dataclasses import dataclass

NARROWEST, WIDEST = 0.03, 0.6


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


ON_SCREEN = PrintedAs()

PRINTED: ContextVar[PrintedAs] = ContextVar("printed", default=ON_SCREEN)
"""What is asked for in the command that runs."""

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
    """A text of a picture as it is printed: another label in its place, symbols as the field writes them."""
    for before, after in printed.labels:
        if text.strip() == before or text.strip().startswith(before + ":"):
            return text.replace(text.strip(), after)
    for word, symbol in SYMBOLS.items():
        text = text.replace(word, symbol)
    return text
