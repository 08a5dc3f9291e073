"""Limits of model files: their meaning, and their comparison with demands that are known by
hand."""

import io
import math

import numpy as np
import pytest

import tdint
from facts import states
from tdint.model.limits import (
    Limit,
    by_level,
    check_limits,
    chosen_limits,
    design_demands,
)
from tdint.units import STANDARD_GRAVITY

MODEL = """units: {length: mm, force: kN, mass: t}
stories:
  - {mass: 300, stiffness: 100, isolator: true,
     law: {type: bilinear, yield_force: 981, hardening: 0.1}}
  - {mass: 300, height: 4000, stiffness: 1000,
     law: {type: bilinear, yield_force: 9e3, hardening: 0.1}}
  - {repeat: 2, mass: 300, height: 3500, stiffness: 1000}
limits: %s
"""
NAN = math.nan


def limits_of(text: str) -> tuple[Limit, ...]:
    return tdint.load_model(io.StringIO(MODEL % text)).limits


@pytest.mark.parametrize(
    ("text", "values"),
    [
        ("{drift_ratio: 2%}", (NAN, 0.02, 0.02, 0.02)),
        ("{drift_ratio: {2: 0.01, others: 2%}}", (NAN, 0.01, 0.02, 0.02)),
        ("{drift_ratio: {others: 3%, linear: 2%, 3-4: 1%, 4: 0.5%}}", (NAN, 0.03, 0.01, 0.005)),
        ("{residual_drift_ratio: {bilinear: 0.5%}}", (NAN, 0.005, NAN, NAN)),
        ("{isolator_displacement: 400}", (0.4, NAN, NAN, NAN)),
        ("{isolator_displacement: {bilinear: 0.3 m}}", (0.3, NAN, NAN, NAN)),
        ("{floor_acceleration: 3e3}", (3.0,) * 4),
        ("{floor_acceleration: {4: 0.5 g}}", (NAN, NAN, NAN, 0.5 * STANDARD_GRAVITY)),
    ],
)
def test_limits_apply_to_stories_of_file(text, values):
    """Story numbers have priority over types of laws, and types over `others`. Isolators have no
    drift ratio, and only isolators have an isolator displacement. The units are the units of the
    file."""
    (limit,) = limits_of(text)
    np.testing.assert_allclose(limit.values, values, rtol=1e-15)


@pytest.mark.parametrize(
    ("key", "kind", "value"),
    [
        ("residual_drift_ratio: 0.5%", "residual_drift_ratio", 0.005),
        ("floor_acceleration: 0.5 g", "floor_acceleration", 0.5 * STANDARD_GRAVITY),
        ("isolator_displacement: 400", "isolator_displacement", 0.4),
    ],
)
def test_quantities_of_a_level(key, kind, value):
    (limit,) = limits_of(f"{{levels: {{safety: {{{key}}}}}}}")
    assert (limit.level, limit.quantity) == ("safety", kind)
    assert np.nanmax(limit.values) == pytest.approx(value, rel=1e-15)


def test_levels_keep_names_and_order():
    limits = limits_of(
        "{drift_ratio: 3%, levels: {service: {drift_ratio: 1%}, safety: {drift_ratio: 2%}}}"
    )
    assert [(limit.level, limit.values[1]) for limit in limits] == [
        ("", 0.03),
        ("service", 0.01),
        ("safety", 0.02),
    ]


@pytest.mark.parametrize(
    ("text", "column", "message"),
    [
        ("{drift_ration: 2%}", 10, "limits.drift_ration: unknown key; did you mean 'drift_ratio'?"),
        ("{drift_ratio: two}", 23, "limits.drift_ratio: ... above 0 and of at most 1, got 'two'"),
        ("{drift_ratio: {7: 1%}}", 27, "story 7 not found; ... 1 to 4"),
        (f"{{drift_ratio: {{? {'9' * 5000} : 1%}}}}", 5029, "999"),
        ("{drift_ratio: {1: 1%}}", 27, "a drift ratio requires a story with `height`"),
        ("{drift_ratio: {liner: 1%}}", 31, "'liner'; did you mean 'linear'?"),
        ("{isolator_displacement: 5 g}", 33, "unit, such as 500 mm"),
        ("{isolator_displacement: 0}", 33, "must be a positive number, got '0'"),
        ("{floor_acceleration: {linear: 1}}", 39, "floors have no type"),
        ("{levels: {ls: {drift: 1%}}}", 24, "unknown key; did you mean"),
        ("{levels: {}}", 18, "is empty; ... performance level"),
        ("{levels: {1: {drift_ratio: 1%}}}", 22, "must start with a letter"),
        ("{}", 9, "is empty; give one of drift_ratio"),
        ("3", 9, "must be a mapping with the keys drift_ratio"),
    ],
)
def test_errors_have_line_column_and_remedy(text, column, message):
    with pytest.raises(tdint.TdintError) as raised:
        limits_of(text)
    (line,) = str(raised.value).splitlines()
    assert f"8:{column}: " in line and states(line, message)


def test_limits_require_isolators_or_heights():
    for key, reason in (
        ("isolator_displacement: 1", "requires a story with `isolator: true`"),
        ("drift_ratio: 1%", "requires a story with `height`"),
    ):
        with pytest.raises(tdint.TdintError, match=reason):
            tdint.load_model(
                io.StringIO(f"stories: [{{mass: 1, stiffness: 1}}]\nlimits: {{{key}}}\n")
            )


def test_story_means_are_compared_and_maximum_ratio_governs():
    """For two motions and three stories, the means are 0.015, 0.02 and 0.005, and the ratios 1.5, 1
    and 2. The mean of the maxima (0.025) and the story with the maximum mean are different."""
    ratios = np.array([[0.025, 0.015, 0.004], [0.005, 0.025, 0.006]])
    peaks = {"peak_drift_ratio": ratios}
    limits = [Limit("", "drift_ratio", (0.01, 0.02, 0.0025))]
    (check,) = check_limits(limits, peaks, np.ones(3), ["first", "second"])
    assert (check.story, check.demand, check.limit, check.within) == (3, 0.005, 0.0025, False)
    assert check.ratio == 2.0
    assert (check.largest, check.largest_story, check.motion) == (0.025, 1, "first")


def test_residual_drift_ratio_is_absolute_drift_over_height():
    peaks = {"residual_drift": np.array([[-0.07, 0.02]])}
    limit = Limit("", "residual_drift_ratio", (0.01, 0.01))
    (check,) = check_limits([limit], peaks, np.array([3.5, 4.0]), ["a"])
    assert check.story == 1 and check.demand == pytest.approx(0.02, rel=1e-15)
    assert not check.within


def test_unknown_demand_does_not_meet_limit():
    """A comparison with nan is never true, and a nan is reported even if another story has a larger
    ratio."""
    peaks = {"peak_drift_ratio": np.array([[NAN, 0.001]])}
    (check,) = check_limits([Limit("", "drift_ratio", (0.01, 0.01))], peaks, np.ones(2), ["a"])
    assert not check.within and check.story == 1
    assert next(iter(by_level([check]).values())) == [check]


def test_requested_limit_replaces_limits_of_model():
    own = (Limit("", "drift_ratio", (NAN, 0.5)), Limit("service", "drift_ratio", (NAN, 0.1)))
    ratios = np.array([NAN, 0.01])
    (requested,) = chosen_limits(own, 0.02, ratios, "x")
    np.testing.assert_array_equal(requested.values, (NAN, 0.02))
    assert chosen_limits(own, None, ratios, "x") == own
    assert chosen_limits(own, "service", ratios, "x") == own[1:]
    with pytest.raises(tdint.TdintError, match="did you mean 'service'"):
        chosen_limits(own, "servce", ratios, "x")
    with pytest.raises(tdint.TdintError, match="requires story heights"):
        chosen_limits(own, 0.02, np.array([NAN, NAN]), "x")


def test_limit_check_of_response_uses_peaks():
    model = tdint.load_model(
        io.StringIO(MODEL % "{isolator_displacement: 100, levels: {service: {drift_ratio: 0.1%}}}")
    )
    record = tdint.make_record(np.sin(np.arange(800) * 0.05) * 2.0, dt=0.01, units="m/s^2")
    response = tdint.run(model, record)
    moved, drifts = response.limit_checks()
    assert moved.demand == response.stories.peak_drift[0] and moved.story == 1
    assert drifts.demand == np.nanmax(response.stories.peak_drift_ratio)
    assert drifts.level == "service" and drifts.within == (drifts.demand <= 0.001)
    assert response.isolator_check.demand == moved.demand
    (drift,) = response.limit_checks(0.02)
    assert drift.limit == 0.02 and drift.demand == drifts.demand


@pytest.mark.parametrize("limit", [NAN, math.inf, 0.0, -0.02, [0.01, 0.02], True, np.ones(2), 1j])
def test_non_positive_limit_is_refused(limit):
    """For nan, a limit would be neither met nor exceeded."""
    with pytest.raises(tdint.TdintError, match="must be a positive drift ratio"):
        chosen_limits((), limit, np.array([[0.01, 0.02]]), "x")
    assert chosen_limits((), np.float64(0.02), np.array([[0.01, NAN]]), "x")[0].values[0] == 0.02


FRAME = """\
name: frame
stories:
  - {repeat: 2, mass: 10, height: 3, stiffness: 8000}
damping: %s
"""


def frame(damping):
    return tdint.load_model(io.StringIO(FRAME % damping))


def sine(size, frequency):
    values = size * np.sin(np.arange(600) * 0.01 * frequency)
    return tdint.make_record(values, dt=0.01, units="m/s^2")


def test_limit_check_of_many_runs_uses_story_means():
    """The result is the mean over the records in each story, then the maximum over the stories, by
    numpy."""
    model, records = frame("{modal: 5%}"), [sine(1.0, 9.0), sine(2.0, 30.0), sine(0.5, 14.0)]
    runs = tdint.run_many(model, records, scales=[1.0, 2.0])
    checks = runs.limit_checks(0.01)
    assert list(checks) == [("frame", "scale 1"), ("frame", "scale 2")]
    for scale, ((check,), factor) in enumerate(zip(checks.values(), (1.0, 2.0), strict=True)):
        drifts = runs.stories.peak_drift_ratio[runs.scale == factor]
        mean = drifts.mean(axis=0)
        assert check.demand == mean.max() and check.story == int(mean.argmax()) + 1, scale
        assert check.within == (mean.max() <= 0.01)
        assert check.largest == drifts.max()
    first, second = (scale_checks[0].demand for scale_checks in checks.values())
    assert second == pytest.approx(2.0 * first, rel=1e-12)  # linear
    # Factors that are varied as a parameter are factors, too.
    varied = tdint.run_many(model, records, vary={"record.scale": [1.0, 2.0]}).limit_checks(0.01)
    assert list(varied) == list(checks)
    # One record: the check of the response.
    (alone,) = tdint.run(model, records[0]).limit_checks(0.01)
    ((many,),) = tdint.run_many(model, records[:1]).limit_checks(0.01).values()
    assert (many.demand, many.story, many.within) == (alone.demand, alone.story, alone.within)


def test_failed_or_collapsed_run_meets_no_limit():
    text = FRAME % "{modal: 5%}" + "collapse_drift: 0.1%\n"
    model = tdint.load_model(io.StringIO(text))
    runs = tdint.run_many(model, [sine(0.001, 9.0), sine(3.0, 20.0)])
    assert set(runs.status) == {"done", "collapsed"}
    ((check,),) = runs.limit_checks(0.5).values()
    assert check.demand < 0.5 and not check.within


def test_undamped_building_under_ground_motion_causes_warning():
    record, undamped = sine(0.1, 9.0), frame("none")
    text = "the first mode is undamped"
    assert any(text in warning for warning in tdint.run(undamped, record).warnings)
    assert any(text in warning for warning in tdint.run_many(undamped, [record]).warnings)
    assert not any(text in warning for warning in tdint.run(frame("{modal: 1%}"), record).warnings)
    # A small ratio is below the usual range, and free vibration is often studied without damping.
    small = tdint.run(frame("{modal: 0.02%}"), record).warnings
    assert any("damping ratio of the first mode: 0.0002" in warning for warning in small)
    free = FRAME % "none" + "initial: {velocity: [0.1, 0.2]}\nanalysis: {duration: 2, dt: 0.01}\n"
    assert not any(text in warning for warning in tdint.run(io.StringIO(free)).warnings)
    without_check = FRAME % "none" + "plausibility: off, textbook example\n"
    assert not any(
        text in warning for warning in tdint.run(io.StringIO(without_check), record).warnings
    )


def test_one_unacceptable_response_of_eleven():
    """ASCE 7-16, 16.4.1.1: 1.2 times the median over all motions, the unacceptable response being
    the largest, but at least the mean of the others; another program computed these values. The
    median of the acceptable responses would give 2.16."""
    acceptable = np.array([1.1, 1.3, 1.4, 1.6, 1.7, 1.9, 2.0, 2.2, 2.5, 2.9])[:, np.newaxis]
    assert design_demands(acceptable) == pytest.approx(1.86, rel=1e-12)
    assert design_demands(acceptable, unacceptable=1) == pytest.approx(2.28, rel=1e-12)
    skewed = np.where(acceptable == 2.9, 20.0, acceptable)
    assert design_demands(skewed, unacceptable=1) == pytest.approx(3.57, rel=1e-12)
