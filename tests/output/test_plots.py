"""Figures in every format and for every type of result, with names that matplotlib could interpret
as commands."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from matplotlib.text import Text

from tdint.analysis.assessment.order import order
from tdint.analysis.run.outcome import ErrorHistory
from tdint.analysis.run.run import run
from tdint.analysis.spectra.elastic import spectrum
from tdint.errors import OutputError
from tdint.files import write_file
from tdint.ground_motion.record import Record
from tdint.model.config.model_file import load_model
from tdint.output.figures.assessment import order_picture
from tdint.output.figures.runs import (
    run_picture,
)
from tdint.output.figures.spectrum_curves import (
    draw_adrs,
    draw_tripartite,
    spectrum_picture,
)
from tdint.output.figures.style import picture
from tdint.units import parse_output_units

pytestmark = pytest.mark.usefixtures("not_laid_out")

CONFIGS = Path(__file__).parents[2] / "configs"
STARTS = {".png": b"\x89PNG", ".pdf": b"%PDF", ".svg": b"<?xml"}


def motion(component="HNE", source="a.mseed", size=400) -> Record:
    t = np.arange(size) * 0.01
    return Record(
        3.0 * np.sin(9.0 * t) * np.exp(-t), 0.01, "", f"N.S..{component}", component, source
    )


def draw_run(response, file):
    write_file(file, picture(file.suffix, lambda: run_picture(response)), overwrite=False)


def draw_spectra(spectra, file):
    write_file(file, picture(file.suffix, lambda: spectrum_picture(spectra)), overwrite=False)


def figure_texts(figure):
    """Return all texts of a figure, one per line."""
    return "\n".join(text.get_text() for text in figure.findobj(Text))


def rendered_texts(figure):
    """Return all texts of a rendered figure; rendering detects invalid texts."""
    figure.draw_without_rendering()
    return figure_texts(figure)


@pytest.fixture(scope="module")
def forced():
    return run(load_model(CONFIGS / "two-story-polynomial.yaml"), duration=2.0, history=True)


@pytest.fixture(scope="module")
def shaken():
    return run(load_model(CONFIGS / "ten-story-bilinear.yaml"), motion(), history=True)


def test_long_steps_show_all_samples_of_the_record_and_the_peaks_of_the_table():
    """The figure shows all samples of the record, including samples between the time steps. The
    peak of the roof is the value in the table."""
    record = replace(motion(), acceleration=np.random.default_rng(1).standard_normal(401))
    long = run(load_model(CONFIGS / "ten-story.yaml"), record, dt=0.05, history=True)
    ground, roof = run_picture(long).axes[:2]
    line = ground.get_lines()[0]
    assert np.max(np.abs(line.get_ydata())) == pytest.approx(record.pga / 9.80665)
    # The test is meaningful only if the time steps omit the peak of the record.
    assert np.max(np.abs(long.history.ground_acceleration)) < 0.99 * record.pga
    peak = long.stories.peak_displacement[-1]
    assert peak > 1.0005 * np.max(np.abs(long.history.displacement[:, -1]))
    assert f"peak {peak:.3g} m" in {text.get_text().partition(" at ")[0] for text in roof.texts}
    assert line.get_xdata()[-1] == pytest.approx(4.0)
    part = run(load_model(CONFIGS / "ten-story.yaml"), record, dt=0.05, duration=1.0, history=True)
    assert run_picture(part).axes[0].get_lines()[0].get_xdata()[-1] == pytest.approx(1.0)


def loaded(record=None):
    """Run three stories under two equal forces and another force until 0.4 s, in kN."""
    table = {"points": [[0.1, 0], [0.1, 3], [0.2, 0]]}
    model = {
        "units": {"length": "m", "force": "kN", "mass": "t"},
        "stories": [{"repeat": 3, "mass": 1, "height": 3, "stiffness": 1000}],
        "excitation": {
            "forces": [
                {"floor": 1, **table},
                {"floor": 2, **table},
                {"floor": 3, "points": [[0, -1], [1, -1]]},
            ]
        },
    }
    return run(model, record, dt=0.01, duration=0.4, history=True)


@pytest.mark.parametrize("record", [None, motion()])
def test_figure_of_run_shows_forces_on_floors(record):
    """Forces are above the response, and below a ground motion; equal forces are one line."""
    axes = run_picture(loaded(record)).axes
    labels = [panel.get_ylabel().split(maxsplit=1)[0] for panel in axes[: 3 if record else 2]]
    assert labels == [*(["ground"] if record else []), "force", "roof"]
    panel = axes[1 if record else 0]
    assert panel.get_ylabel() == "force (kN)" and panel.get_xlim() == (0.0, 0.4)
    lines = {line.get_label(): line.get_xydata().tolist() for line in panel.get_lines()}
    assert list(lines) == ["floor 3", "floors 1, 2"]
    assert lines["floors 1, 2"] == [
        [0.0, 0.0], [0.1, 0.0], [0.1, 0.0], [0.1, 3.0], [0.2, 0.0], [0.2, 0.0], [0.4, 0.0]
    ]  # fmt: skip
    # The force on floor 3 jumps at 0 s, and ends after the run.
    assert lines["floor 3"] == [[0, 0], [0, 0], [0, -1], [1, -1], [1, 0], [1, 0]]


@pytest.mark.parametrize(
    "suffix", [pytest.param(name, marks=[pytest.mark.long] * (name == ".pdf")) for name in STARTS]
)
def test_formats(tmp_path, suffix):
    """Each file starts with the signature of its format. Equal results give equal files. No file is
    replaced without permission."""
    file, again = tmp_path / f"x{suffix}", tmp_path / f"again{suffix}"
    spectra = [spectrum(motion(), np.array([0.1, 1.0]))]
    for name in (file, again):
        draw_spectra(spectra, name)
        with pytest.raises(OutputError, match="the file exists"):
            draw_spectra(spectra, name)
    assert file.read_bytes().startswith(STARTS[suffix])
    assert file.read_bytes() == again.read_bytes()
    assert sorted(tmp_path.iterdir()) == sorted([file, again])


@pytest.mark.long
def test_names_are_drawn_literally(tmp_path, forced):
    name = "_a $x_ 建物"
    draw_run(replace(forced, model=replace(forced.model, name=name)), tmp_path / "run.svg")
    spectra = [
        spectrum(motion(c, f"{name}.mseed"), np.geomspace(0.1, 1.0, 9)) for c in ("_E", "$N")
    ]
    draw_spectra(spectra, tmp_path / "spectrum.svg")
    for file, text in (("run.svg", name), ("spectrum.svg", "_E")):
        assert text in (tmp_path / file).read_text(encoding="utf-8")
    long = "two\nlines" + "x" * 300
    rendered_texts(run_picture(replace(forced, model=replace(forced.model, name=long))))


@pytest.mark.parametrize(
    ("choices", "method_text"),
    [
        ({}, "exact solution"),
        ({"interpolation": "band-limited"}, "exact solution, band-limited motion"),
        ({"maxima": "samples"}, "exact solution, maxima: samples"),
        ({"method": "newmark-average"}, "newmark-average"),
    ],
)
def test_a_spectrum_states_its_method_of_computation(choices, method_text):
    computed = spectrum(motion(), np.array([0.5, 1.0]), **choices)
    assert f"5 % damping, {method_text}" in figure_texts(spectrum_picture([computed])).split("\n")


@pytest.mark.parametrize(
    ("ratios", "axis", "title"),
    [
        ((0.5,), "observed order", ", frequency ratio 0.5"),
        ((0.5, 2.0), "ω₀ / ω, frequency of the load over natural frequency", ""),
    ],
)
def test_orders_are_drawn_over_several_frequency_ratios(ratios, axis, title):
    texts = figure_texts(
        order_picture([order("newmark-average", frequency_ratio=ratio) for ratio in ratios])
    ).split("\n")
    assert axis in texts
    assert f"Observed order: harmonic load, linear law{title}" in texts


@pytest.mark.parametrize(
    ("axes", "count"),
    [
        ("periods", 1),
        ("periods", 22),
        ("tripartite", 2),
        ("tripartite", 22),
        ("adrs", 2),
        ("adrs", 22),
    ],
)
def test_axes_and_suites(axes, count):
    """The legend of a suite of 22 lines contains only the fractiles. The period 0 is not shown on a
    logarithmic axis."""
    periods = np.array([0.0, *np.geomspace(0.05, 2.0, 9)])
    motions = [motion(source=f"{i}.txt").scaled(1.0 + i) for i in range(count)]
    spectra = [spectrum(record, periods, ratio) for record in motions for ratio in (0.02, 0.05)]
    text = rendered_texts(spectrum_picture(spectra, axes))
    for named in (
        "median",
        *(("22 components", "median, 2 %", "16 % and 84 %, 5 %") if axes == "periods" else ()),
    ):
        assert (named in text) is (count == 22), named
    assert ("1.txt" in text) is (count == 2)


@pytest.mark.parametrize("units", ["m", "kip,in,g", "kip,ft,g", "kN,mm", "kN,cm,m/s^2"])
def test_scales_of_a_spectrum_in_any_units(units):
    """psv = sd omega = psa / omega: labels of the diagonal scales are at the correct position and
    do not overlap; the same is tested for the rays of constant period."""
    shown = parse_output_units(units).in_figures
    spectra = [spectrum(motion(), np.geomspace(0.05, 10.0, 30))]
    axes = draw_tripartite(spectra, ["one"], shown).axes[0]
    seconds_in = {shown.label(si): shown.unit(si)[1] for si in ("m", "m/s^2")}
    assert len(axes.texts) >= 6
    for text in axes.texts:
        (period, speed), (value, unit) = text.get_position(), text.get_text().split(" ")
        omega = 2.0 * np.pi / period
        expected = (
            float(value) * seconds_in[unit] * (omega if unit == shown.label("m") else 1.0 / omega)
        )
        assert speed * shown.unit("m/s")[1] == pytest.approx(expected, rel=1e-9)
    positions = np.log([text.get_position() for text in axes.texts])
    extent = np.ptp(np.log([axes.get_xlim(), axes.get_ylim()]), axis=1)
    apart = np.abs(positions[:, None] - positions) / extent
    assert np.all(np.max(apart, axis=2) + np.eye(len(positions)) > 0.05)
    for ray in draw_adrs(spectra, ["one"], shown).axes[0].texts:
        end, height = ray.xy
        omega = 2.0 * np.pi / float(ray.get_text().removesuffix(" s"))
        assert height * shown.unit("m/s^2")[1] == pytest.approx(
            omega**2 * end * shown.unit("m")[1], rel=1e-9
        )


@pytest.mark.parametrize(
    ("units", "labels", "limit", "part"),
    [
        (
            "kip,in,g",
            ("ground (g)", "kip·in)", "story shear (kip)", "drift (in)", "acceleration (g)"),
            1.0,
            0.02,
        ),
        (
            "kN,mm",
            ("ground (g)", "kN·m)", "story shear (kN)", "drift (mm)", "acceleration (g)"),
            100.0,
            0.001,
        ),
        (
            "lbf,m/s^2",
            ("ground (m/s²)", "lbf·m)", "lbf)", "drift (m)", "acceleration (m/s²)"),
            1.0,
            np.nan,
        ),
    ],
)
def test_a_run_in_other_units(shaken, units, labels, limit, part):
    """Labels and peaks are in the requested units, with g as default for accelerations. A collapse
    drift close to the peak is marked. The error band of the roof is shown if it exceeds a
    hundredth of the maximum displacement and an error estimate exists."""
    history, chosen = shaken.history, parse_output_units(units)
    errors = (
        part * getattr(history, name) for name in ("displacement", "velocity", "drift", "shear")
    )
    near = replace(
        shaken.model, collapse_drift=limit * float(np.max(shaken.stories.peak_drift_ratio))
    )
    shown = replace(shaken, model=near, history=replace(history, error=ErrorHistory(*errors)))
    text = figure_texts(run_picture(shown, chosen))
    assert not [label for label in labels if label not in text]
    peak = np.max(np.abs(history.displacement[:, -1])) / chosen.unit("m")[1]
    assert f"peak {peak:.3g} {chosen.unit('m')[0]} at " in text
    assert ("collapse drift" in text) is (limit == 1.0)
    assert ("estimated error" in text) is (part == 0.02)
