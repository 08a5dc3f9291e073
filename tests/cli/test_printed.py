"""Pictures for print: their width, fonts, words, and what is refused."""

from __future__ import annotations

import re
import zlib

import pytest

from tdint.output.printed import PRINTED, PrintedAs, in_print

POINTS = 72.0 / 25.4


@pytest.fixture
def here(tmp_path, monkeypatch):
    """The working directory, empty."""
    monkeypatch.chdir(tmp_path)
    return tmp_path


def stability(tdint, *more):
    return tdint("stability", "--method", "impulse4,hht:alpha=-0.1", "--dt-over-t", "0.01:1:9", *more)


def numbers(found):
    return [float(one) for one in found.split()]


def test_a_pdf_has_the_width_and_embedded_truetype(here, tdint):
    for words, width in ((("--figure-width", "90mm"), 90.0), (("--figure-width", "7in"), 177.8)):
        assert stability(tdint, *words, "--plot=a.pdf", "--overwrite").exit_code == 0
        data = (here / "a.pdf").read_bytes()
        box = numbers(re.search(rb"/MediaBox \[ ([^\]]*) \]", data)[1].decode())
        assert abs(box[2] - width * POINTS) < 0.1
        assert b"/FontFile2" in data and b"/Type3" not in data


def test_letters_have_six_to_eight_points(here, tdint):
    """As the page's streams set them: `/F1 8 Tf`."""
    assert stability(tdint, "--figure-width", "140mm", "--plot=a.pdf").exit_code == 0
    streams = re.findall(rb"stream\r?\n(.*?)endstream", (here / "a.pdf").read_bytes(), re.DOTALL)
    sizes = []
    for one in streams:
        try:
            sizes += [float(size) for size in re.findall(rb"/F\S+ ([0-9.]+) Tf", zlib.decompress(one))]
        except zlib.error:
            continue
    assert len(sizes) > 20
    assert set(sizes) <= {6.0, 7.0, 8.0} | {0.7 * size for size in (6.0, 7.0, 8.0)}  # exponents are smaller


def test_words_are_those_of_the_paper(here, tdint):
    assert stability(tdint, "--label", "impulse4=present method", "--no-title", "--plot=a.svg").exit_code == 0
    text = (here / "a.svg").read_text()
    assert "present method" in text and "impulse4" not in text
    assert "Δt/T" in text and "dt/T" not in text and "α=-0.1" in text
    assert stability(tdint, "--plot=b.svg").exit_code == 0  # what was asked for before is over
    assert "impulse4" in (here / "b.svg").read_text()
    assert PRINTED.get() == PrintedAs()


def test_a_style_sheet_has_its_say(here, tdint):
    (here / "own.mplstyle").write_text("lines.linewidth: 4.5\n")
    assert stability(tdint, "--style", "own.mplstyle", "--plot=a.svg").exit_code == 0
    assert "stroke-width: 4.5" in (here / "a.svg").read_text()


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("--figure-width", "90"), "--figure-width '90': write a length from 30 to 600 mm"),
        (("--figure-width", "9m"), "--figure-width '9m': write a length from 30 to 600 mm"),
        (("--font", "No Such Font"), "--font 'No Such Font': this machine has no such font"),
        (("--label", "impulse4"), "--label 'impulse4': write NAME=TEXT"),
        (("--label", "nothing=x"), "--label nothing=...: nothing in the picture is called so"),
        (("--style", "none.mplstyle"), "--style none.mplstyle: "),
    ],
)
def test_what_cannot_be_drawn_is_one_line(here, tdint, words, message):
    result = stability(tdint, *words, "--plot=a.svg")
    assert result.exit_code == 2
    assert [line for line in result.stderr.splitlines() if message in line]
    assert not (here / "a.svg").exists()


@pytest.mark.usefixtures("laid_out")
@pytest.mark.usefixtures("laid_out")
def test_panels_without_room_are_refused(folder, tdint):
    result = tdint("run", "shaken.yaml", "-o", "out", "--history", "--plot", "--figure-width", "60mm")
    assert result.exit_code == 2
    assert "the panels of this picture find no room at 60 mm" in result.stderr
    assert not list((folder / "out").glob("*.png"))


def test_symbols():
    assert in_print("omega dt of rho_inf=0.5, m/s^2", PrintedAs()) == "ωΔt of ρ∞=0.5, m/s²"
    assert in_print(" trio:rho_inf=1", PrintedAs(labels=(("trio", "ours"),))) == " ours"
