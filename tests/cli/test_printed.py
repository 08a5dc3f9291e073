"""Figures for print: width, fonts, texts, and errors."""

import itertools
import re
import shlex
import zlib
from contextlib import suppress

import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.text import Text

from cli.conftest import STUDY
from facts import states
from selection import every
from tdint.output.figures.style import Picture
from tdint.output.printed import PRINTED, PrintedAs

POINTS = 72.0 / 25.4


STABILITY = ("stability", "--method", "impulse4,hht:alpha=-0.1", "--dt-over-t", "0.01:1:9")


@pytest.mark.long
def test_a_pdf_has_the_requested_width_truetype_fonts_and_text_of_six_to_eight_points(
    working_directory, tdint, drawn
):
    """The font size is read from the page streams: `/F1 8 Tf`."""
    line = ("overshoot", "--method", "impulse4", "--steps", "3")
    tdint(*line, "--style", "90mm", "--plot=a.pdf", code=0)
    data = (working_directory / "a.pdf").read_bytes()
    box = [float(number) for number in re.search(rb"/MediaBox \[ ([^\]]*) \]", data)[1].split()]
    assert abs(box[2] - 90.0 * POINTS) < 0.1
    assert b"/FontFile2" in data and b"/Type3" not in data
    sizes = []
    for stream in re.findall(rb"stream\r?\n(.*?)endstream", data, re.DOTALL):
        with suppress(zlib.error):
            sizes += [
                float(size) for size in re.findall(rb"/F\S+ ([0-9.]+) Tf", zlib.decompress(stream))
            ]
    assert len(sizes) > 20
    # Exponents are smaller.
    assert set(sizes) <= {6.0, 7.0, 8.0} | {0.7 * size for size in (6.0, 7.0, 8.0)}


@pytest.mark.long
def test_a_figure_has_the_requested_width_and_no_title(working_directory, tdint, drawn):
    tdint(*STABILITY, "--style", "width=7in,title=no", "--plot=a.svg", code=0)
    text = (working_directory / "a.svg").read_text()
    assert "Δt/T" in text and "dt/T" not in text and "α=\N{MINUS SIGN}0.1" in text
    assert 'width="504pt"' in text
    assert PRINTED.get() == PrintedAs()  # The style applies only to its command.


@pytest.mark.parametrize(
    ("style", "message"),
    every(
        2,
        [
            ("90", "--style '90': unknown key; ... 90mm ... width=90mm or title=no"),
            ("width=90", "--style: width ... 30 to 600 mm, such as 90mm or 3.5in, got '90'"),
            ("9m", "--style: width ... 30 to 600 mm, such as 90mm or 3.5in, got '9m'"),
            ("widht=90mm", "--style 'widht=90mm': unknown key; did you mean 'width'?"),
            ("title=maybe", "--style 'title=maybe': title must be yes or no"),
            ("font=Times", "--style 'font=Times': unknown key"),
        ],
    ),
)
def test_invalid_styles_are_refused_in_one_line(working_directory, tdint, style, message):
    assert states(tdint(*STABILITY, "--style", style, "--plot=a.svg", code=2).stderr, message)
    assert not (working_directory / "a.svg").exists()


@pytest.mark.long
@pytest.mark.usefixtures("laid_out")
def test_the_narrowest_width_has_room_for_the_panels(folder, tdint):
    call = (
        "modes", "shaken.yaml", "--target", SPECTRUM, "-o", "out/m.csv", "--plot",
        "--style", "30mm",
    )  # fmt: skip
    tdint(*call, code=0)
    assert list((folder / "out").glob("*.png"))


def test_a_campaign_keeps_the_style_of_its_file(folder, tdint, monkeypatch):
    """The command line overrides the campaign file."""
    applied = []

    def record_style(self, stream):
        applied.append(PRINTED.get())
        stream.write(b"a picture")

    monkeypatch.setattr(Picture, "__call__", record_style)
    run = ("campaign", "study.yaml", "-o", "out", "--plot")
    export = ("campaign", "export", "out", "--plot", "--overwrite")
    (folder / "study.yaml").write_text(STUDY + "style: '90mm,title=no'\n")
    tdint(*run, code=0)
    tdint(*export, code=0)
    assert applied == [PrintedAs(width=0.09, title=False)] * 2
    tdint(*export, "--style", "120mm", code=0)
    assert applied[-1] == PrintedAs(width=0.12, title=False)
    # The runs do not depend on the style.
    (folder / "study.yaml").write_text(STUDY + "style: 60mm\n")
    tdint(*run, code=0)
    tdint(*export, code=0)
    assert {style.width for style in applied[-2:]} == {0.06}


@pytest.mark.parametrize(
    ("style", "message"),
    [
        ("widht=90mm", "study.yaml: style: 'widht=90mm': unknown key; did you mean 'width'?"),
        ("title=", "study.yaml: style: 'title=': title must be yes or no"),
    ],
)
def test_invalid_styles_of_a_campaign_are_reported_before_the_runs(folder, tdint, style, message):
    (folder / "study.yaml").write_text(f"{STUDY}style: {style}\n")
    result = tdint.refused(message, "campaign", "study.yaml", "-o", "out", "--plot", code=3)
    assert len(result.stderr.splitlines()) == 1


# ---- Texts are within the page and do not overlap

RECORDED = """\
base: {file: motion.mseed, component: HNE}
floors:
  1: {file: recorded/floors.mseed, component: F01, units: m/s^2}
  2: {file: recorded/floors.mseed, component: F02, units: m/s^2}
"""
STRIPES = "im,collapses,records\n0.2,0,40\n0.4,4,40\n0.6,17,40\n0.8,30,40\n1.0,38,40\n"
SPECTRUM = "ec8:type=1,soil=B,ag=0.25g"
DRAWN = {
    "run": "run shaken.yaml",
    "runs": "run shaken.yaml --scale 0.5,1",
    "sequence": "run shaken.yaml motion.mseed other.mseed --sequence --component HNE",
    "report": "run shaken.yaml --report page.html",
    "modes": "modes shaken.yaml",
    "modes under a target": f"modes shaken.yaml --target {SPECTRUM}",
    "law": "law shaken.yaml --drift 1%,2%",
    "pushover": "pushover shaken.yaml",
    "pushover to a target": f"pushover shaken.yaml --target {SPECTRUM}",
    "compare": "compare shaken.yaml --recorded recorded.yaml",
    "info": "info motion.mseed",
    "spectrum": "spectrum motion.mseed --damping 2%,5%",
    "tripartite spectrum": "spectrum motion.mseed --axes tripartite",
    "adrs spectrum": "spectrum motion.mseed --axes adrs",
    "inelastic spectrum": "spectrum other.mseed --ductility 2,4 --periods 0.1:3:10",
    "rotated spectrum": "spectrum motion.mseed --rotd 0,50,100",
    "spectrum against another": "spectrum motion.mseed --component HNE --scale 1.05 --against "
    "published.csv --against-column psa_m_s2",
    "target": f"spectrum --target {SPECTRUM}",
    "drift spectrum": "drift-spectrum other.mseed",
    "campaign": "campaign study.yaml -o out --limit 2%",
    "report of a campaign": "campaign study.yaml -o out --report page.html",
    "scale": f"scale motion.mseed --target {SPECTRUM}",
    "ida": "ida shaken.yaml motion.mseed --threshold 2%",
    "sensitivity": "sensitivity shaken.yaml motion.mseed "
    "--vary damping=2%:5%,mass_factor=0.9:1.1,story\\ 2.stiffness_factor=0.8:1.2",
    "fragility": "fragility stripes.csv",
    "stability": "stability",
    "stability near 1/144": "stability --beta-scan",
    "overshoot": "overshoot",
    "order": "order --method impulse4,hht,newmark-average --load free",
    "failures": "failures --method impulse4,hht,newmark-average,wilson",
    "examples": "examples 1 --method impulse4,newmark-average -o out",
    "chart": "chart shaken.yaml --method impulse4,newmark-average,hht",
    "chart of several": "chart shaken.yaml forced.yaml --method impulse4,newmark-average,hht",
}
FAST = {"run": (0.09,), "law": (0.09, 0.18)}
"""Widths (m) of the tests that are not slow. All texts have the same size, so that the narrow
figure is the more difficult layout."""


def text_boxes(figure):
    """Return the visible texts and their boxes, in points; hidden tick labels are excluded."""
    figure.draw_without_rendering()
    panels = [member for axes in figure.axes for member in (axes, *axes.child_axes)]
    tick_labels, shown = set(), set()
    for axis in (axis for member in panels for axis in (member.xaxis, member.yaxis)):
        tick_labels |= {
            label
            for tick in (*axis.majorTicks, *axis.minorTicks)
            for label in (tick.label1, tick.label2)
        }
        shown |= {label for tick in axis._update_ticks() for label in (tick.label1, tick.label2)}
    texts = [
        text for text in figure.findobj(Text) if text.get_visible() and text.get_text().strip()
    ]
    seen = [
        (text, text.get_window_extent().extents)
        for text in texts
        if text not in tick_labels or text in shown
    ]
    return [(text, box * 72.0 / figure.dpi) for text, box in seen if box[2] > box[0]]


def layout_errors(figure):
    """Return texts that exceed the page by more than half a point, and pairs of texts that overlap
    by more than a point in both directions."""
    boxes, (wide, high) = text_boxes(figure), 72.0 * figure.get_size_inches()
    beyond = [
        text.get_text() for text, box in boxes if min(*box[:2], wide - box[2], high - box[3]) < -0.5
    ]
    upright = [(text.get_text(), box) for text, box in boxes if text.get_rotation() % 90.0 == 0.0]
    over = [
        (text_a, text_b)
        for (text_a, a), (text_b, b) in itertools.combinations(upright, 2)
        if min(a[2], b[2]) - max(a[0], b[0]) > 1.0 and min(a[3], b[3]) - max(a[1], b[1]) > 1.0
    ]
    return beyond + over


@pytest.fixture
def studied(folder, tdint, request):
    """Return a directory with the inputs of the commands: a study, recordings of floors, collapse
    counts and a spectrum."""
    for name, text in {
        "study.yaml": STUDY,
        "recorded.yaml": RECORDED,
        "stripes.csv": STRIPES,
    }.items():
        (folder / name).write_text(text, encoding="utf-8")
    made = {
        "compare": "run shaken.yaml -o recorded --export-floors mseed",
        "spectrum against another": "spectrum motion.mseed --component HNE --damping 5% -o "
        "published.csv",
    }.get(request.node.callspec.params["line"])
    assert made is None or tdint(*made.split()).exit_code == 0


@pytest.mark.usefixtures("laid_out", "studied")
@pytest.mark.parametrize(
    "line",
    [
        pytest.param(
            entry, marks={"run": [], "law": [pytest.mark.long]}.get(entry, [pytest.mark.slow])
        )
        for entry in DRAWN
    ],
)
@pytest.mark.long
def test_texts_are_within_the_page_and_do_not_overlap(tdint, monkeypatch, line):
    found = []

    def measured(self, stream):
        for width in FAST.get(line, (0.09,)):
            before = PRINTED.set(PrintedAs(width=width))
            found.append((width, layout_errors(self.figure())))
            PRINTED.reset(before)
        stream.write(b"a picture")

    monkeypatch.setattr(Picture, "__call__", measured)
    # Figures of a report
    monkeypatch.setattr(Picture, "save", lambda self, figure, stream: measured(self, stream))
    arguments = shlex.split(DRAWN[line])
    tdint(*arguments, *["--plot=a.png"] * (not {"examples", "--report"} & set(arguments)), code=0)
    assert found and [entry for entry in found if entry[1]] == []


def test_texts_beyond_the_page_and_overlaps_are_detected():
    figure = Figure(figsize=(2.0, 2.0))
    FigureCanvasAgg(figure)
    figure.text(0.1, 0.5, "within")
    assert layout_errors(figure) == []
    figure.text(0.12, 0.5, "over")
    figure.text(0.9, 0.1, "beyond the page")
    assert layout_errors(figure) == ["beyond the page", ("within", "over")]
