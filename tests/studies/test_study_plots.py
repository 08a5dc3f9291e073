"""Figures of studies: one or many records, no collapse, no result; names that look like
formulas."""

import math
from dataclasses import replace

import numpy as np
import pytest
from matplotlib.text import Text

from building_cases import model, story
from selection import every
from tdint.ground_motion.horizontals import Horizontals
from tdint.ground_motion.record import Record
from tdint.output.figures.style import add_legends
from tdint.response.spectra.target import TargetSpectrum
from tdint.studies.fragility.fits import fit_capacities, fit_cloud, fit_stripes
from tdint.studies.fragility.fragility_figures import fragility_picture
from tdint.studies.fragility.hazard import HazardCurve, at_risk
from tdint.studies.ida.ida import IdaStudy
from tdint.studies.ida.ida_curve import IdaCurve, IdaRun
from tdint.studies.ida.ida_figures import ida_picture
from tdint.studies.motions.intensity import MotionIntensity, pga, sa, sa_average
from tdint.studies.motions.scaling import Scaling, scale, scale_p695
from tdint.studies.motions.scaling_figures import suite_picture
from tdint.units import SI, STANDARD_GRAVITY

pytestmark = pytest.mark.usefixtures("not_laid_out")

STATUS = {math.inf: "collapsed", -math.inf: "not-converged"}


def figure_texts(figure):
    """Return all texts of a figure, one per line. Rendering detects invalid texts."""
    add_legends(figure)
    figure.draw_without_rendering()
    return "\n".join(text.get_text() for text in figure.findobj(Text))


def record(seed=0, source="a.mseed"):
    t = np.arange(400) * 0.02
    return Record(np.sin((3.0 + seed) * t) * np.exp(-t), 0.02, "", "", "HN1", source)


def curve(seed, *runs):
    made = tuple(
        IdaRun(im, im, STATUS.get(drift, "done"), 0.11 if math.isinf(drift) else drift)
        for im, drift in runs
    )
    return IdaCurve(record(seed, f"{seed}.mseed"), made, 0.1)


def study(*curves, measure=None):
    return IdaStudy(model([story(1.0, 100.0)]), measure or sa(0.5), "impulse4", (0.02, 0.1), curves)


COLLAPSING = ((1.0, 0.01), (2.0, 0.03), (2.1, math.inf))


@pytest.mark.parametrize(
    ("curves", "expected", "missing"),
    every(
        2,
        [
            ([COLLAPSING], ["1 record", "capacity against collapse"],
             ["1 records", "median", "16 %"]),
            ([COLLAPSING] * 44, ["44 records", "median", "16 % and 84 %"], ["does not collapse"]),
            ([((1.0, 0.01), (2.0, 0.03))] * 3, ["does not collapse up to here", "median"],
             ["capacity against"]),
            ([(*COLLAPSING, (2.6, 0.04))] * 2, ["no collapse at a higher level"],
             ["capacity against collapse"]),
            ([((1.0, 0.01), (1.5, -math.inf))], ["run without a result"], ["capacity against"]),
            ([((1.0, math.inf),)], ["1 record"], ["capacity against"]),
            ([((1.0, 0.0), (2.0, 0.0))], ["1 record"], ["capacity against collapse"]),
        ],
    ),
)  # fmt: skip
def test_incremental_dynamic_analyses(curves, expected, missing):
    text = figure_texts(ida_picture(study(*(curve(i, *runs) for i, runs in enumerate(curves)))))
    assert not [part for part in expected if part not in text]
    assert not [part for part in missing if part in text]


@pytest.mark.parametrize(
    ("measure", "pair", "label"),
    [
        (sa(0.51234567), None, "\nSa(0.5123 s) (m/s²)"),
        (pga(), "rotd50", "RotD50 PGA (m/s²)"),
        (MotionIntensity("pgv"), "rotd50", "RotD50 PGV (m/s)"),
    ],
)
def test_axes_state_measure_and_unit(measure, pair, label):
    text = figure_texts(
        ida_picture(replace(study(curve(0, *COLLAPSING), measure=measure), pair=pair))
    )
    assert label in text
    in_g = study(curve(0, *COLLAPSING)).in_units(SI.in_figures)
    assert "(g)" in figure_texts(ida_picture(in_g)) and "(g)" not in text


TARGET = TargetSpectrum("a $target$_x.csv", np.array([0.1, 3.0]), np.array([5.0, 1.0]))
PAIR = Horizontals(record(0), record(1))


@pytest.mark.parametrize(
    ("scaling", "expected"),
    every(
        2,
        [
            (scale([record()], sa(1.0), 2.0), ["1 record", "Sa(1 s) = 0.2039 g"]),
            (scale([record(), record(2)], sa_average(1.0), 2.0),
             ["2 records", "median", "Sa_avg = 0.2039 g"]),
            (scale([PAIR], MotionIntensity("pgv"), 0.3, pair="rotd50"),
             ["1 pair", "RotD50", "PGV = 0.3 m/s"]),
            (scale([record(i) for i in range(44)], target=TARGET,
                   periods=np.geomspace(0.2, 2.0, 5)),
             ["44 records", "16 % and 84 %", "target", "a $target$_x.csv"]),
            (scale_p695([PAIR] * 3, sa(1.0), 2.0),
             ["6 components", "FEMA P-695, scaled to", "Sa(1.00 s) = 0.2039 g"]),
            (
                Scaling(
                    (PAIR,) * 11,
                    np.ones(11),
                    "asce7",
                    "rotd100",
                    0.05,
                    target=TARGET,
                    periods=np.array([0.2, 2.0]),
                    least=(1.02, 0.4),
                ),
                ["11 pairs", "90 % of the target", "\nmean\n", "by ASCE 7"],
            ),
        ], ids=["value", "average", "pair", "target", "p695", "asce7"]),
)  # fmt: skip
def test_suites(scaling, expected):
    text = figure_texts(suite_picture(scaling))
    assert not [part for part in expected if part not in text]


def test_motions_that_are_not_selected_do_not_change_the_height_of_the_axis():
    scaling = scale([record(), record(2)], target=TARGET, periods=np.geomspace(0.2, 2.0, 5))
    others = replace(scaling, unselected_spectra=1e-4 * scaling.spectra(scaling.periods))
    limits = [suite_picture(item).axes[0].get_ylim() for item in (scaling, others)]
    assert limits[0] == limits[1]


CLOUD = ([1.0, 2.0, 3.0, 4.0], [0.01, 0.02, 0.02, 0.05], [0.02, 0.04])


@pytest.mark.parametrize(
    ("functions", "expected"),
    every(
        2,
        [
            (
                [fit_capacities([1.0, 2.0])],
                ["2 ground motions", "method of moments", "intensity measure", "95 % confidence"],
            ),
            (
                [fit_capacities([1.0, 2.0, 2.0], [False, False, True]).named(0.1, "pga", "m/s^2")],
                ["1 censored", "PGA"],
            ),
            (
                [
                    fit_stripes([1.0, 2.0, 3.0], [0, 1, 2], [3] * 3).named(t)
                    for t in np.arange(1, 9) / 100.0
                ],
                ["0.08: "],
            ),
            (fit_cloud(*CLOUD), ["slope", "probability of exceedance", "4 runs"]),
            (fit_cloud(*CLOUD, [False] * 3 + [True]), ["above the limit", "1 censored"]),
        ],
        ids=["two", "censored", "many", "cloud", "censored-cloud"],
    ),
)
def test_fragility_functions(functions, expected):
    text = figure_texts(fragility_picture(functions))
    assert not [part for part in expected if part not in text]


@pytest.mark.parametrize(("count", "panels"), [(1, 1), (2, 1), (4, 2)])
def test_functions_with_modeling_dispersion_have_their_own_panel(count, panels):
    """With at most two functions, both lines of each function, its band and its observations are in
    one panel; with more functions, in two panels."""
    fitted = fit_stripes([1.0, 2.0, 3.0], [0, 1, 2], [3] * 3)
    functions = [
        replace(fitted.named(t, "pga", "m/s^2"), modeling_dispersion=0.3)
        for t in np.arange(1, count + 1) / 100.0
    ]
    figure = fragility_picture(functions)
    add_legends(figure)
    shown = [axes for axes in figure.axes if axes.get_legend()]
    assert len(shown) == panels
    totals = [text.get_text() for text in shown[-1].get_legend().get_texts()]
    assert sum(f"{fitted.beta:.2f}" in text for text in totals) == (count if panels == 1 else 0)
    assert sum(f"{functions[0].beta_total:.2f}" in text for text in totals) == count


def test_contributions_to_the_frequency_have_the_area_of_the_curve():
    """The density over ln s is 1 in sum, except for intensities outside the points of the curve."""
    curve = HazardCurve(np.array([0.3, 1.0, 3.0]), np.array([0.1, 0.01, 1e-4]), "pga", "m/s^2")
    fitted = fit_stripes([1.0, 2.0, 3.0], [0, 1, 2], [3] * 3).named(0.01, "pga", "m/s^2")
    (function,), _ = at_risk([fitted], curve, allow_outside=True)
    *_, rates, density = fragility_picture([function], curve).axes
    np.testing.assert_array_equal(rates.lines[0].get_data(), (curve.im, curve.rate))
    x, y = density.lines[0].get_data()
    area = np.sum(0.5 * (y[1:] + y[:-1]) * np.diff(np.log(x)))
    assert area == pytest.approx(1.0 - function.risk.share_outside, rel=2e-2)


@pytest.mark.usefixtures("laid_out")
def test_panels_are_laid_out():
    assert "1 record" in figure_texts(ida_picture(study(curve(0, *COLLAPSING))))


# ---- Values and labels of curves


def drawn(axes, label):
    """Return the points of the only line or group of marks of a panel with a label."""
    (drawing,) = (item for item in axes.get_children() if item.get_label() == label)
    return np.asarray(getattr(drawing, "get_xydata", getattr(drawing, "get_offsets", None))())


def test_ida_curves_lead_through_their_runs_to_the_capacity():
    curves = [curve(0, *COLLAPSING), curve(1, (1.0, 0.02), (2.0, 0.05))]
    axes = ida_picture(study(*curves)).axes[0]
    capacity = curves[0].collapse.capacity
    assert 2.0 < capacity <= 2.1
    lines = [line.get_xydata() for line in axes.lines]
    for expected in (
        [(0.0, 0.0), (1.0, 1.0), (3.0, 2.0), (3.0, capacity), (10.4, capacity)],
        [(0.0, 0.0), (2.0, 1.0), (5.0, 2.0)],  # without collapse
    ):
        assert any(np.allclose(line, expected) for line in lines if len(line) == len(expected))
    assert drawn(axes, "capacity against collapse") == pytest.approx(np.array([(3.0, capacity)]))
    assert drawn(axes, "does not collapse up to here") == pytest.approx(np.array([(5.0, 2.0)]))


def test_ida_fractiles_are_those_of_the_levels_at_a_drift():
    """Curves without collapse are lines through the origin: at each drift the median level is that
    of the middle one."""
    slopes = np.arange(1.0, 8.0)
    straight = [curve(i, (0.5 * s, 0.02), (s, 0.04)) for i, s in enumerate(slopes)]
    axes = ida_picture(study(*straight)).axes[0]
    points = drawn(axes, "median")
    inside = (points[:, 0] > 0.0) & (points[:, 0] < 4.0)
    assert np.count_nonzero(inside) > 10
    np.testing.assert_allclose(points[inside, 1], 4.0 * points[inside, 0] / 4.0, rtol=1e-9)


def test_scaled_spectra_are_drawn_with_their_median_average_and_target():
    scaling = scale(
        [record(i) for i in range(44)], target=TARGET, periods=np.geomspace(0.2, 2.0, 5)
    )
    axes = suite_picture(scaling).axes[0]
    median = drawn(axes, "median")
    spectra = scaling.spectra(median[:, 0]) / STANDARD_GRAVITY
    assert spectra.shape == (44, len(median))
    single = [line for line in axes.lines if len(line.get_xdata()) == len(median)][:44]
    np.testing.assert_allclose([line.get_ydata() for line in single], spectra, rtol=1e-9)
    np.testing.assert_allclose(median[:, 1], np.exp(np.median(np.log(spectra), axis=0)), rtol=1e-2)
    assert np.all((spectra.min(axis=0) < median[:, 1]) & (median[:, 1] < spectra.max(axis=0)))
    target = drawn(axes, "target")
    np.testing.assert_allclose(
        target, np.column_stack([TARGET.periods, TARGET.psa / STANDARD_GRAVITY]), rtol=1e-12
    )


def test_the_target_value_of_a_scaling_is_drawn_at_its_period():
    axes = suite_picture(scale([record(), record(2)], sa(1.0), 2.0)).axes[0]
    (label,) = (line.get_label() for line in axes.lines if "Sa(1 s)" in line.get_label())
    assert drawn(axes, label)[0] == pytest.approx([1.0, 2.0 / STANDARD_GRAVITY])
    lines = [line for line in axes.lines if len(line.get_xdata()) > 10]
    for line in lines[:2]:
        assert np.exp(np.interp(0.0, np.log(line.get_xdata()), np.log(line.get_ydata()))) == (
            pytest.approx(2.0 / STANDARD_GRAVITY, rel=1e-2)
        )
