"""Runs in two directions: resultants, rotation of components, ends and refusals."""

import pickle
from dataclasses import replace
from functools import partial

import numpy as np
import pytest
from numpy.polynomial import Polynomial
from numpy.testing import assert_allclose, assert_array_equal

import tdint
from el_centro import el_centro
from tdint.errors import ModelError, RecordError, UsageError
from tdint.ground_motion.axes import PairRecord, along_axes, pga_of
from tdint.ground_motion.horizontals import find_horizontals
from tdint.ground_motion.measures import measure
from tdint.response.runs.history import HISTORIES_OF_MANY, values_of
from tdint.response.runs.outcome import Resultant
from tdint.response.runs.two_directions import combined, peak_of_vector, polynomial

RNG = np.random.default_rng(20261129)
TIME = 0.02 * np.arange(500)


def _record(samples, component="", **more):
    record = tdint.make_record(samples, dt=0.02, units="m/s^2")
    return replace(record, component=component, **more)


def _motion(seed):
    """Return samples of a smooth motion with several frequencies, m/s^2."""
    random = np.random.default_rng(seed)
    phases = random.uniform(0.0, 2.0 * np.pi, 6)
    envelope = np.sin(np.pi * TIME / TIME[-1])
    return envelope * sum(
        np.sin(2.0 * np.pi * f * TIME + phase) for f, phase in zip(range(1, 7), phases, strict=True)
    )


X, Y = _record(_motion(1), "000"), _record(_motion(2), "090")
LINEAR = {
    "stories": [
        {"mass": 2e5, "height": 3.5, "x": {"stiffness": 1.2e8}, "y": {"stiffness": 7e7}},
        {"mass": 1.5e5, "height": 3.0, "x": {"stiffness": 9e7}, "y": {"stiffness": 6e7}},
    ],
    "damping": "5%",
}
EQUAL = {
    "stories": [{"mass": 2e5, "height": 3.5, "stiffness": 1.2e8, "repeat": 2}],
    "damping": "5%",
}


def _yielding(stiffness, force):
    law = {"type": "bilinear", "yield_force": force, "hardening": "5%"}
    return {"stiffness": stiffness, "law": law}


REFERENCE = {
    "stories": [
        {"mass": 2e5, "x": _yielding(1.2e8, 5e5), "y": _yielding(8e7, 3.5e5)},
        {"mass": 2e5, "x": _yielding(1e8, 4e5), "y": _yielding(7e7, 3e5)},
        {"mass": 1.5e5, "x": _yielding(8e7, 2.5e5), "y": _yielding(5e7, 1.8e5)},
    ],
    "damping": {"rayleigh": {"ratio": "5%", "modes": [1, 2]}},
    "analysis": {"duration": 15},
}


def test_resultant_of_two_histories():
    # Entry B1 of the reference values: program A and program B agree within 2e-16.
    x, y = [0.2, 1.0, -0.4, -1.1, 0.3], [-0.5, 0.8, 0.9, 0.2, -0.7]
    components = (
        partial(polynomial, np.stack((values[:-1], np.diff(values)))[..., np.newaxis])
        for values in map(np.array, (x, y))
    )
    (length,), (time,), (x_peak,), (y_peak,) = peak_of_vector(*components, (4, 1))
    peaks = (np.array([np.abs(values).max()]) for values in (x, y))
    found = Resultant(np.array([length]), np.array([time]), np.zeros(1), *peaks, np.zeros(1))
    assert (found.x, found.y) == (1.1, 0.9)
    assert found.srss == pytest.approx(1.42126704, rel=1e-9)
    assert found.rule_100_30 == pytest.approx(1.37, rel=1e-9)
    assert length == pytest.approx(1.280624847, rel=1e-9)
    assert np.degrees(np.arctan2(y_peak, x_peak)) == pytest.approx(38.65980825, rel=1e-9)
    assert time == 1.0


def test_peak_of_a_vector_with_polynomial_components():
    terms = RNG.normal(size=(2, 6, 40, 3))
    components = (partial(polynomial, part) for part in terms)
    length, time, x, y = peak_of_vector(*components, terms.shape[2:])
    s = np.linspace(0.0, 1.0, 20_001)
    powers = s[:, np.newaxis] ** np.arange(6)
    sampled = np.hypot(*(np.einsum("pk,kij->pij", powers, values) for values in terms))
    assert_allclose(length, sampled.max(axis=(0, 1)), rtol=1e-8)
    assert (length >= sampled.max(axis=(0, 1)) * (1.0 - 1e-15)).all()
    step = np.maximum(np.ceil(time).astype(int) - 1, 0)
    at_time = (time - step)[:, np.newaxis] ** np.arange(6)
    values = [np.einsum("ik,ki->i", at_time, part[:, step, [0, 1, 2]]) for part in terms]
    assert_allclose(values, (x, y), atol=1e-9)


def test_bilinear_building_agrees_with_a_second_solver():
    # Event-driven matrix exponential, confirmed by leapfrog with return mapping within 2e-8.
    x = el_centro()
    delay = round(0.4 / x.dt)
    samples = np.zeros_like(x.acceleration)
    samples[delay:] = -0.7 * x.acceleration[:-delay]
    y = tdint.make_record(samples, dt=x.dt, units="m/s^2")
    result = tdint.run(REFERENCE, PairRecord(x, y), dt=x.dt / 4)
    drift = result.resultants.drift
    assert_allclose(drift.value, [0.02881306, 0.01548767, 0.01212229], rtol=5e-6)
    assert_allclose(drift.x, [0.02881136, 0.01472212, 0.00757749], rtol=5e-6)
    assert_allclose(drift.y, [0.02498324, 0.01297994, 0.01209508], rtol=5e-6)
    coarse = tdint.run(REFERENCE, PairRecord(x, y), method="newmark-average").resultants.drift
    assert (np.abs(coarse.value - drift.value) <= coarse.error).all()


@pytest.fixture(scope="module")
def linear():
    return tdint.run(LINEAR, (X, Y), method="exact", history=True)


def _peak_of_histories(x, y, rows):
    """Return the largest length of vectors with histories x and y at `rows` rows per sampling
    interval. The exact response is smooth within an interval, where the ground acceleration is a
    straight line: polynomials through its rows are evaluated densely."""
    top = int(np.hypot(x, y).argmax())
    dense, times = np.linspace(-1.0, 1.0, 40_001), np.linspace(-1.0, 1.0, rows + 1)
    lengths = []
    for first in {(top - 1) // rows * rows, top // rows * rows}:
        values = (history[first : first + rows + 1] for history in (x, y))
        lengths.append(np.hypot(*(Polynomial.fit(times, v, 12)(dense) for v in values)).max())
    return max(lengths)


def test_linear_building_agrees_with_exact_histories(linear):
    # Histories of separate runs, with a fine step of the exact method
    histories = []
    for direction, record in (("x", X), ("y", Y)):
        stories = [{**story, **story[direction]} for story in LINEAR["stories"]]
        for story in stories:
            del story["x"], story["y"]
        model = {**LINEAR, "stories": stories}
        run = tdint.run(model, record, method="exact", dt=0.02 / 64, history=True, check=False)
        histories.append(run.history)
    fine = tdint.run(LINEAR, (X, Y), method="exact", dt=0.02 / 16)
    for name in ("displacement", "drift", "absolute_acceleration", "shear"):
        x, y = (getattr(history, name) for history in histories)
        peaks = [_peak_of_histories(x[:, i], y[:, i], 64) for i in range(2)]
        resultant = getattr(fine.resultants, name)
        assert_allclose(resultant.value, peaks, rtol=1e-9, err_msg=name)
        row, column = np.hypot(x, y).argmax(axis=0), np.arange(2)
        assert_allclose(resultant.time, histories[0].time[row], atol=0.02 / 64)
        angle = np.degrees(np.arctan2(y[row, column], x[row, column])) % 360.0
        assert_allclose(resultant.direction, angle, atol=0.5)
        # With the sampling interval as time step, the curves within the steps are less accurate.
        coarse = 2e-5 if name == "absolute_acceleration" else 2e-7
        assert_allclose(getattr(linear.resultants, name).value, peaks, rtol=coarse, err_msg=name)


def test_resultants_are_between_the_larger_peak_and_the_srss(linear):
    for resultant in vars(linear.resultants).values():
        assert (resultant.value >= np.maximum(resultant.x, resultant.y)).all()
        assert (resultant.value <= resultant.srss).all()
        expected = np.maximum(resultant.x + 0.3 * resultant.y, 0.3 * resultant.x + resultant.y)
        assert_allclose(resultant.rule_100_30, expected)


def test_each_direction_is_the_run_of_a_model_with_one_direction(linear):
    for direction, record, part in zip("xy", (X, Y), linear.directions, strict=True):
        stories = [
            {"mass": story["mass"], "height": story["height"], **story[direction]}
            for story in LINEAR["stories"]
        ]
        alone = tdint.run(
            {**LINEAR, "stories": stories},
            record,
            method="exact",
            duration=linear.steps * linear.dt,
        )
        for name, values in vars(alone.stories).items():
            assert_allclose(getattr(part.stories, name), values, rtol=0.0, err_msg=name)


@pytest.mark.parametrize("axis", [0.0, 30.0, 117.0, 270.0])
def test_a_rotated_pair_has_the_same_resultants(axis):
    pair = find_horizontals([X, Y])
    model = {**EQUAL, "excitation": {"azimuth": axis}}
    result = tdint.run(model, pair, method="exact")
    straight = tdint.run({**EQUAL, "excitation": {"azimuth": 0.0}}, pair, method="exact")
    for name, resultant in vars(straight.resultants).items():
        rotated = getattr(result.resultants, name)
        assert_allclose(rotated.value, resultant.value, rtol=1e-6)
        turned = (rotated.direction + axis - resultant.direction + 180.0) % 360.0 - 180.0
        assert_allclose(turned, 0.0, atol=1e-3)


def test_rotation_of_components():
    # A motion of 1 m/s^2 towards the azimuth 30, in components of 120 and 210
    shape = _motion(3)
    towards = [np.cos(np.radians(a - 30.0)) for a in (120.0, 210.0)]
    pair = find_horizontals(
        [
            _record(c * shape + 1e-9 * i * TIME, n)
            for i, (c, n) in enumerate(zip(towards, ("120", "210"), strict=True))
        ]
    )
    motion = along_axes(pair, 30.0)
    x, y = motion.components
    assert_allclose(x.acceleration, shape, atol=1e-7)
    assert_allclose(y.acceleration, 0.0, atol=1e-7)
    # Without an azimuth, the first component of the files is x, and y is clockwise from it.
    backwards = along_axes(find_horizontals([Y, X]))
    assert_allclose(backwards.components[0].acceleration, Y.acceleration, atol=1e-15)
    assert_allclose(backwards.components[1].acceleration, -X.acceleration, atol=1e-15)
    unknown = along_axes(find_horizontals([replace(X, component="A"), replace(Y, component="B")]))
    assert unknown.components[0].acceleration is not None
    assert any("the first acts along x" in note for note in unknown.notes)
    assert unknown.scaled(2.0).components[1].pga == 2.0 * Y.pga


def test_both_directions_end_at_the_same_time():
    soft = {"mass": 2e5, "height": 3.5, "x": {"stiffness": 1.2e8}, "y": {"stiffness": 6e5}}
    rising = _record(0.2 * TIME, "000"), _record(0.1 * TIME, "090")
    result = tdint.run({"stories": [soft], "damping": "2%"}, rising)
    x, y = result.directions
    assert x.steps == y.steps == result.steps > len(TIME)
    # With a tolerance, both directions have the smaller time step.
    result = tdint.run(LINEAR, (X, Y), tolerance=1e-5)
    assert len({part.dt for part in result.directions}) == 1


def test_collapse_of_a_direction_ends_the_resultants():
    brittle = {
        "mass": 2e5,
        "height": 3.5,
        "x": {"stiffness": 1.2e8},
        "y": _yielding(4e7, 3e4)
        | {"law": {"type": "bilinear", "yield_force": 3e4, "hardening": 0}},
    }
    model = {"stories": [brittle], "damping": "5%", "p_delta": True, "collapse_drift": 0.01}
    result = tdint.run(model, (X, Y))
    assert result.status == "collapsed"
    assert result.directions[0].status == "done"
    assert result.steps == round(result.collapse.time / result.dt)
    assert result.resultants.drift.time[0] <= result.collapse.time
    assert 0.035 < result.resultants.drift.value[0] < 0.045


@pytest.mark.parametrize(
    ("y", "message"),
    [
        (tdint.make_record(_motion(2)[::2], dt=0.04, units="m/s^2"), "different sampling"),
        (_record(_motion(2), start="2026-01-01T00:00:01"), "start at different times"),
    ],
)
def test_unequal_components_are_refused(y, message):
    with pytest.raises(RecordError, match=message):
        PairRecord(_record(_motion(1), start="2026-01-01T00:00:00"), y)


def test_a_pair_has_no_motion_of_its_own():
    """Nothing is taken from one component in silence: intensities are geometric means, and other
    quantities of a motion are those of the components."""
    case = tdint.prepare(LINEAR, (X, Y))
    pair = tdint.run_case(case, duration=0.2).record
    for quantity in (
        lambda: pair.acceleration,
        lambda: pair.pga,
        lambda: tdint.spectrum(pair, 0.5),
        lambda: measure(pair),
        lambda: case.ground,
    ):
        with pytest.raises(AttributeError, match="use its `components`"):
            quantity()
    assert [part.component for part in pair.components] == ["000", "090"]
    assert pair.duration == X.duration
    assert pga_of(pair) == pytest.approx(np.sqrt(X.pga * Y.pga))
    assert all(f"PGA {part.pga:.4g}" in repr(pair) for part in (X, Y))
    for single in (lambda: case.under(X), lambda: tdint.run_many(LINEAR, [X])):
        with pytest.raises((RecordError, UsageError), match="horizontal component"):
            single()
    moved = pickle.loads(pickle.dumps(pair.scaled(2.0)))
    assert moved.scale == 2.0 and moved.digest == pair.scaled(2.0).digest


@pytest.mark.parametrize("model", [LINEAR, REFERENCE])
def test_many_runs_of_pairs_are_single_runs(model):
    """Pairs in any form have the peaks, errors and status of `run`; what one run cannot do for two
    directions is refused with the other way."""
    pairs = [(X, Y), find_horizontals([X, Y]), tdint.prepare(model, (X, Y)).record]
    many = tdint.run_many(model, pairs, scales=[0.5, 1.0], check=True)
    for number, run in enumerate(many):
        single = tdint.run(model, PairRecord(X, Y).scaled(float(many.scale[number])))
        assert many.status[number] == single.status and many.steps[number] == single.steps
        for name in ("peak_drift", "peak_shear", "peak_absolute_acceleration", "residual_drift"):
            assert_allclose(getattr(many.stories, name)[number], getattr(single.stories, name))
            errors = getattr(single.check.errors, name)
            assert_allclose(getattr(many.errors, name)[number], errors)
        assert run.records == many.records
    ((check,), _) = many.limit_checks(0.01).values() if model is LINEAR else (((None,), None))
    assert check is None or check.motions == 3
    for message, call in {
        "for each direction": lambda: tdint.run_many(model, [(X, Y)], history="drift"),
        "two directions; write": lambda: tdint.run_many(model, [(X, Y)], vary={"damping": [0.1]}),
        "separately": lambda: tdint.run_many([model, EQUAL], [(X, Y)]),
        "a sequence requires one direction": lambda: tdint.run_sequence(
            tdint.prepare(model, (X, Y)), [X, X]
        ),
    }.items():
        with pytest.raises(UsageError, match=message):
            call()


def test_components_of_different_durations_need_an_earlier_end():
    pair = PairRecord(X, _record(_motion(2)[:400]))
    with pytest.raises(UsageError, match=r"last 9.98 and 7.98 s; trim or pad"):
        tdint.run(LINEAR, pair)
    assert tdint.run(LINEAR, pair, duration=7.0).steps == 350


def test_a_model_with_two_directions_needs_two_components():
    with pytest.raises(RecordError, match="only one horizontal component"):
        tdint.run(LINEAR, X)


def test_other_analyses_refuse_two_directions():
    for call in (
        lambda: tdint.Stepper(LINEAR, dt=0.01),
        lambda: tdint.run(LINEAR, (X, Y), gradient="damping"),
        lambda: tdint.load_model(LINEAR).replace(damping=0.02),
    ):
        with pytest.raises(UsageError, match=r"one direction|two directions"):
            call()
    for analysis in (tdint.modes, lambda model: tdint.pushover(model, "1%")):
        with pytest.raises(ModelError, match="the model has two directions"):
            analysis(LINEAR)


CORNERS = {
    "stories": [{"mass": 1e5, "x": _yielding(1.2e7, 2e5), "y": _yielding(0.9e7, 1.6e5)}],
    "damping": "3%",
    "plausibility": "off, test",
}


@pytest.mark.parametrize("method", ["impulse4", "newmark-average"])
def test_peak_of_resultant_shear_at_a_corner_in_a_step(method):
    """The resultant has its peak where one direction yields or unloads, inside a step. A fine time
    step gives the same value; with the secant slope of the step, .3 % of the force would be
    missing."""
    t = 0.02 * np.arange(151)
    window = np.minimum(1.0, (3.0 - t) / 0.3)
    x = _record(4.0 * np.sin(9.0 * t) * window, "000")
    y = _record(3.5 * np.sin(7.3 * t + t * t / 3.0) * window, "090")
    coarse, fine = (
        tdint.run(CORNERS, (x, y), method=method, dt=dt, duration=4.0).resultants.shear
        for dt in (0.02, 0.02 / 32)
    )
    assert abs(coarse.value - fine.value)[0] <= 2.0 * coarse.error[0]
    if method == "impulse4":
        assert coarse.value == pytest.approx(fine.value, rel=1e-4)


def test_histories_of_directions_are_those_of_runs_of_each():
    """Of stories, attachments and links; the response itself has no history."""
    more = {
        "damping": "5%",
        "attachments": [{"name": "tmd", "floor": 2, "mass": 3e3, "stiffness": 1e6, "dashpot": 2e4}],
        "links": [{"from": 2, "to": "ground", "dashpot": 2e5}],
    }
    both = tdint.run({**LINEAR, **more}, (X, Y), history=True, check=False)
    assert both.history is None
    for part, key, record in zip(both.directions, "xy", (X, Y), strict=True):
        stories = [
            {"mass": story["mass"], "height": story["height"], **story[key]}
            for story in LINEAR["stories"]
        ]
        one = tdint.run({"stories": stories, **more}, record, history=True, check=False).history
        for name in HISTORIES_OF_MANY:
            found, expected = values_of(part.history, name), values_of(one, name)
            rows = min(len(found), len(expected))
            assert rows >= len(X.acceleration)
            assert_allclose(found[:rows], expected[:rows], rtol=1e-12, err_msg=name)


def test_no_direction_keeps_the_history_of_its_additional_run():
    response = tdint.run(CORNERS, (X, Y), history=True, check=True)
    assert all(part.check.history is None for part in response.directions)
    assert tdint.run(EQUAL, X, history=True, check=True).check.history is None


COLLAPSING = {"type": "bilinear", "yield_force": 3e4, "hardening": 0.0}


def _collapsing(**story):
    one = {"mass": 2e5, "height": 3.5} | story
    return {"stories": [one], "damping": "none", "p_delta": True, "collapse_drift": 0.01}


@pytest.mark.parametrize("at_rest", ["x", "y"])
@pytest.mark.parametrize("check", [False, True])
def test_a_direction_at_rest_adds_nothing_to_a_collapse(at_rest, check):
    """A run of a building that can yield ends with the step of its collapse, in one and in two
    directions, singly and in a batch: the same peaks, energies, ductilities and histories."""
    moved = {"stiffness": 4e7, "law": COLLAPSING}
    still = tdint.make_record(np.zeros(500), dt=0.02, units="m/s^2")
    pair, parts = (still, Y), {"x": {"stiffness": 1e8}, "y": moved}
    if at_rest == "y":
        pair, parts = (Y, still), {"x": moved, "y": {"stiffness": 1e8}}
    one = tdint.run(_collapsing(**moved), Y, check=check, history=True)
    both = tdint.run(_collapsing(**parts), pair, check=check, history=True)
    assert one.status == both.status == "collapsed"
    assert one.steps == both.steps == round(one.collapse.time / one.dt)
    assert len(one.history.time) == one.steps + 1
    for name in ("peak_drift", "peak_shear", "ductility", "peak_displacement", "peak_velocity"):
        values, others = (getattr(run.stories, name) for run in (one, both))
        assert others == pytest.approx(values, rel=1e-9)
        if name == "peak_drift":
            assert values[0] == np.abs(one.history.drift).max()
    assert both.energy.input == pytest.approx(one.energy.input, rel=1e-9)
    assert both.energy.hysteretic == pytest.approx(one.energy.hysteretic, rel=1e-9)
    for run in (one, both):
        assert np.isnan(run.stories.residual_drift).all() and run.time_at_rest is None
        assert run.growth == 0.0
    many = tdint.run_many(_collapsing(**moved), [Y], check=check)
    assert many.steps[0] == one.steps and many.status[0] == "collapsed"
    assert many.stories.peak_drift[0] == pytest.approx(one.stories.peak_drift, rel=1e-9)
    assert many.stories.ductility[0] == pytest.approx(one.stories.ductility, rel=1e-9)


def test_linear_buildings_run_on_after_the_collapse_drift():
    """A linear building, and a run that begins beyond the limit, are flagged and run on."""
    linear = tdint.run(_collapsing(stiffness=4e6), Y, check=False)
    assert linear.status == "collapsed" and not linear.collapse.ended and linear.steps == 499
    beyond = _collapsing(stiffness=4e7, law=COLLAPSING) | {"initial": {"displacement": [0.05]}}
    beyond["p_delta"] = False
    started = tdint.run(beyond, Y, check=False)
    assert started.status == "collapsed" and not started.collapse.ended and started.steps == 499


@pytest.mark.parametrize("azimuth", [90.0, 180.0, 270.0])
def test_a_rotated_pair_exchanges_the_directions(azimuth):
    """A pair that is rotated by right angles exchanges x and y exactly."""
    stiffness = ({"stiffness": 4e7, "law": COLLAPSING}, {"stiffness": 2e7})
    turned = stiffness if azimuth == 180.0 else stiffness[::-1]
    runs = [
        tdint.run(
            _collapsing(x=x, y=y) | {"excitation": {"azimuth": axis}, "collapse_drift": 0.5},
            find_horizontals([X, Y]),
        )
        for (x, y), axis in ((stiffness, 0.0), (turned, azimuth))
    ]
    directions = runs[1].directions[:: 1 if azimuth == 180.0 else -1]
    pairs = [*zip(runs[0].directions, directions, strict=True), runs]
    for name in ("peak_drift", "peak_shear", "ductility", "peak_absolute_acceleration"):
        for one, other in pairs:
            values = [getattr(part.stories, name) for part in (one, other)]
            assert_array_equal(*values, err_msg=name)
            errors = [getattr(part.check.errors, name) for part in (one, other)]
            assert_allclose(*errors, rtol=1e-6, err_msg=name)
    assert runs[0].energy.input == pytest.approx(runs[1].energy.input, rel=1e-14)


def test_devices_without_an_estimate_in_one_direction():
    """The larger peaks and the sum of the energies remain; their errors are unknown."""
    stories = [{"mass": 1e5, "height": 3.0, "x": {"stiffness": 4e7}, "y": {"stiffness": 2e7}}]
    tmd = {"name": "tmd", "floor": 1, "mass": 3e3, "stiffness": 1e6, "dashpot": 2e4}
    model = tdint.load_model({"stories": stories, "damping": "5%", "attachments": [tmd]})
    motions = [np.sin(0.1 * factor * np.arange(200)) for factor in (1.0, 2.0)]
    x, y = (
        tdint.make_record(motion, dt=0.01, units="m/s^2", component=component)
        for motion, component in zip(motions, "EN", strict=True)
    )
    run = tdint.run(model, tdint.Horizontals(x, y), history=True)
    first, second = run.directions
    unknown = replace(second.devices, errors=None, dissipated_energy_error=None)
    found = combined([first, replace(second, devices=unknown)], None).devices
    assert found.errors is None and found.dissipated_energy_error is None
    assert found.dissipated_energy == run.devices.dissipated_energy
    strokes = [part.devices.stories.peak_drift for part in run.directions]
    assert found.stories.peak_drift == run.devices.stories.peak_drift == np.maximum(*strokes)
