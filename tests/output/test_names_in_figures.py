"""Names in figures are text: dollar signs are no formulas, and control characters are visible."""

import io
import re

import pytest
from matplotlib.figure import Figure

from tdint.output.figures.style import picture

NAMES = (r"$\undefined{a}$", r"tank $\frac{", "a$b$c", "$x_1$", "left\u202eright", "tab\u0007")


@pytest.mark.parametrize("suffix", [".svg", ".png", ".pdf"])
@pytest.mark.parametrize("name", NAMES)
def test_names_are_drawn_as_written(suffix: str, name: str) -> None:
    def draw() -> Figure:
        figure = Figure()
        axes = figure.add_subplot()
        axes.plot([1, 100], [1, 100], label=name)
        axes.set(xscale="log", xlabel=name, title=name)
        axes.annotate(name, (1.0, 1.0))
        figure.suptitle(name)
        return figure

    stream = io.BytesIO()
    picture(suffix, draw)(stream)
    if suffix == ".svg":
        text = text_of(stream)
        assert not any(character in text for character in "\u202e\u0007")
        # Each of the five texts; a formula would be drawn as separate parts. The ticks of the
        # logarithmic axis remain formulas.
        assert "$" not in name or text.count(name) >= 5
        assert "mathdefault" not in text


def text_of(stream: io.BytesIO) -> str:
    """Return an SVG file without its comments, which repeat the texts."""
    return re.sub(r"<!--.*?-->", "", stream.getvalue().decode(), flags=re.DOTALL)


def test_formulas_of_figures_remain() -> None:
    def draw() -> Figure:
        figure = Figure()
        figure.add_subplot().set_title(r"5 %$\theta$ = 1, $\beta_{total}$ = 0.4, $\pm\sigma$ = 2")
        return figure

    stream = io.BytesIO()
    picture(".svg", draw)(stream)
    assert "theta" not in text_of(stream) and "sigma" not in text_of(stream)
