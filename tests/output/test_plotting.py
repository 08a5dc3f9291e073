"""Pictures from Python: figures of every result, main panels on axes of the caller, files."""

import subprocess
import sys

import numpy as np
import pytest
from matplotlib.figure import Figure

import tdint
from tdint.errors import OutputError, UsageError
from tdint.units import STANDARD_GRAVITY

pytestmark = pytest.mark.usefixtures("not_laid_out")

LAW = {"type": "bilinear", "yield_force": 50, "hardening": 0.1}
STORIES = [{"mass": 10.0, "height": 3.0, "stiffness": 8000.0, "law": LAW, "repeat": 2}]
MODEL = {"name": "small", "stories": STORIES, "damping": 0.05, "analysis": {"method": "newmark-average"}}
WAVE = np.sin(9.0 * np.arange(300) * 0.01)
PERIODS = np.geomspace(0.1, 2.0, 20)


@pytest.fixture(scope="module")
def results():
    """A result of each kind that has a picture."""
    record = tdint.make_record(3.0 * WAVE, dt=0.01, units="m/s^2")
    model = tdint.load_model(MODEL)
    pushed = tdint.pushover(model, "4%", points=40)
    return {
        "record": record,
        "run": tdint.run(model, record, history=True),
        "peaks": tdint.run(model, record),
        "modes": tdint.modes(model),
        "law": tdint.cyclic_test(model, 1, ["1%"]),
        "pushover": pushed,
        "target displacements": tdint.target_displacements(pushed, "asce7:sds=0.2,sd1=0.1,tl=8"),
        "spectrum": tdint.spectrum(record, PERIODS),
        "inelastic": tdint.constant_ductility(record, PERIODS[-2:], [2.0]),
        "drifts": tdint.drift_spectrum(record, PERIODS),
        "scale": tdint.scale([record], "pga", 1.0),
        "sensitivity": tdint.sensitivity(model, record, {"damping": (0.02, 0.05)}),
        "fragility": tdint.fit_stripes([1.0, 2.0, 3.0], [1, 5, 9], [10, 10, 10]),
        "stability": tdint.stability("hht", np.geomspace(0.01, 1.0, 20)),
        "overshoot": tdint.overshoot("hht"),
        "order": tdint.order("hht"),
        "failures": tdint.failures("hht", ["large-step"]),
    }


NARROW = ("order", "stability", "spectrum")
ON_AXES = {"record", "run", "peaks", "modes", "law", "pushover", "spectrum", "scale", "fragility", "stability"}


@pytest.mark.usefixtures("laid_out")
def test_each_is_drawn(results):
    """Its panels find their places, too; those of NARROW do so below, those of two are in another one's figure."""
    for name, result in results.items():
        figure = tdint.plot(result)
        assert isinstance(figure, Figure) and any(axes.has_data() for axes in figure.axes), name
        if name not in (*NARROW, "peaks", "pushover"):
            figure.draw_without_rendering()


def test_the_main_panel_goes_onto_axes(results):
    for name, result in results.items():
        axes = Figure().subplots()
        if name not in ON_AXES:
            with pytest.raises(UsageError, match="no single panel"):
                tdint.plot(result, ax=axes)
            continue
        assert tdint.plot(result, axes) is axes
        assert axes.has_data() and axes.get_xlabel() and axes.get_ylabel(), name


def test_what_is_drawn_is_the_result(results):
    axes = Figure().subplots()
    spectrum = results["spectrum"]
    spectrum.plot(axes)
    np.testing.assert_allclose(axes.lines[0].get_ydata() * STANDARD_GRAVITY, spectrum.psa, rtol=1e-12)
    spectrum.plot(ax=axes)
    assert axes.lines[0].get_color() != axes.lines[1].get_color() and axes.get_legend() is not None
    inches = Figure().subplots()
    results["law"].plot(ax=inches, units="kip,in,g")
    assert "(in)" in inches.get_xlabel() and "kip" in inches.get_ylabel()
    drift = results["law"].path.drift / 0.0254
    assert any(np.allclose(line.get_xdata(), drift) for line in inches.lines if len(line.get_xdata()) == drift.size)
    assert len(results["run"].plot().axes) > len(results["peaks"].plot().axes)
    assert len(tdint.plot([spectrum, spectrum]).axes[0].lines) == 2


def test_print(results, tmp_path):
    file = tmp_path / "a.pdf"
    figure = tdint.plot(results["modes"], file=file, width=0.09, title=False)
    assert figure.get_size_inches()[0] * 25.4 == pytest.approx(90.0)
    assert figure.get_suptitle() == "" and b"/FontFile2" in file.read_bytes()
    once_more = tdint.plot(results["modes"])
    assert once_more.get_size_inches()[0] * 25.4 > 120.0  # what is asked of one picture is not asked of the next
    with pytest.raises(UsageError, match="no such font"):
        tdint.plot(results["stability"], font="No Such Font")


def test_what_has_no_picture_is_refused(results, tmp_path):
    with pytest.raises(UsageError, match="Record and Spectrum"):
        tdint.plot([results["record"], results["spectrum"]])
    with pytest.raises(UsageError, match="several of Response"):
        tdint.plot([results["run"], results["run"]])
    with pytest.raises(UsageError, match="there is no picture"):
        tdint.methods().plot()
    with pytest.raises(UsageError, match="those of their figure"):
        tdint.plot(results["run"], ax=Figure().subplots(), width=0.09)
    with pytest.raises(OutputError, match=r"written as \.png, \.pdf or \.svg"):
        tdint.plot(results["run"], file=tmp_path / "a.jpg")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.usefixtures("laid_out")
def test_words_at_ticks_are_those_of_print(results):
    figure = tdint.plot([results["order"], tdint.order("moment4")], width=0.09, label={"moment4:rho_inf=1": "present"})
    figure.draw_without_rendering()
    assert [text.get_text() for text in figure.axes[0].get_yticklabels()] == ["hht:α=-0.05", "present"]


@pytest.mark.usefixtures("laid_out")
@pytest.mark.parametrize("name", NARROW)
def test_no_legend_is_wider_than_the_page(results, name):
    """At 90 mm four marks do not stand beside each other."""
    several = [results[name], results[name]]
    figure = tdint.plot(several, width=0.09, title=False)  # which lays it out
    for legend in figure.legends:
        box = legend.get_window_extent()
        assert box.x0 >= 0.0 and box.x1 <= figure.bbox.x1


NOTEBOOK = """
import sys, tdint
modes = tdint.modes({"stories": [{"mass": 1.0, "stiffness": 1.0}]})
print("matplotlib.figure" in sys.modules)
figure = modes.plot()
shown = figure._repr_png_()
print(shown[:4] == b"\\x89PNG", int.from_bytes(shown[16:20], "big") == round(100 * figure.get_figwidth()))
print(figure._repr_png_() == shown, "matplotlib.pyplot" in sys.modules)
"""


def test_a_notebook_shows_a_figure_without_pyplot():
    """What IPython asks the last value of a cell for: a picture, the same each time; matplotlib comes with it."""
    printed = subprocess.run([sys.executable, "-c", NOTEBOOK], capture_output=True, text=True)
    assert printed.stdout.split() == ["False", "True", "True", "True", "False"], printed.stderr


def test_looks_are_said_as_on_the_command_line(results, tmp_path):
    """`style` is a style sheet, or all words of --style; a keyword goes over it."""
    sheet = tmp_path / "own.mplstyle"
    sheet.write_text("lines.linewidth: 4.5\n")
    for style in (sheet, f"120mm,{sheet}"):
        figure = tdint.plot(results["modes"], style=style, width="90mm")
        assert 4.5 in [line.get_linewidth() for line in figure.axes[0].lines]
        assert figure.get_figwidth() == pytest.approx(90 / 25.4)
    with pytest.raises(UsageError, match="plot: style 'widht=90mm': no such word; did you mean 'width'"):
        tdint.plot(results["stability"], style="widht=90mm")
    with pytest.raises(UsageError, match=r"style sheet none\.mplstyle: "):
        tdint.plot(results["stability"], style="none.mplstyle")
