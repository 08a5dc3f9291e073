"""Tests of work-precision diagrams: errors, the reference and its cache, recommendations."""

import math
import time
from dataclasses import replace

import numpy as np
import pytest
from scipy.linalg import expm

from building_cases import Force, Law, model, noise, oscillator, story, ten_bilinear, ten_linear
from references import drifts, exact_linear
from tdint import load_model, run, system
from tdint.assessment.chart import problem as references
from tdint.assessment.chart.problem import (
    Errors,
    FloorMotion,
    errors,
    find_reference,
    pose,
    stretched,
)
from tdint.assessment.chart.work_precision import (
    CHOOSING,
    Point,
    Timing,
    chart,
    cheapest,
    default_steps,
    measure,
)
from tdint.errors import AnalysisError, UsageError
from tdint.methods.catalogue import parse
from tdint.model.building import assemble
from tdint.model.definition import ModalDamping
from tdint.response.arguments import model_of

HARDENING = Law("polynomial", (400.0, 0.0, 4000.0))


def forced(duration=2.0):
    """Return a building with two hardening stories under a smooth force, whose response has no
    kinks."""
    stories = [story(1.0, 400.0, HARDENING, dashpot=1.0) for _ in range(2)]
    return model(
        stories, forces=[Force(2, 20.0, 0.0, 5.0)], velocity=(0.3, 0.5), dt=0.02, duration=duration
    )


def integrators(*names):
    return [parse(name) for name in names]


def motion(displacement, stride=1):
    u = np.array(displacement, float)
    peaks = np.max(np.abs(drifts(u)), axis=0)
    return FloorMotion(stride, u, 2.0 * u, 3.0 * u, peaks)


def test_all_time_steps_end_at_same_time():
    """The amplitude of the motion increases until its end, so that an additional step would
    increase the peaks."""
    growing = model([story(1.0, 400.0)], forces=[Force(1, 20.0, 0.0, 20.0)], dt=0.02, duration=0.7)
    chart = measure(
        pose(growing), integrators("impulse4"), (0.08, 0.04, 0.02), repeats=1, cached=False
    )
    assert [point.dt * point.steps for point in chart.points] == pytest.approx([0.72] * 3)
    assert [point.errors.peak_drift < 0.01 for point in chart.points] == [False, True, True]


# ---- errors


@pytest.mark.parametrize("part", [0.0, 0.25, -0.5])
def test_relative_error_of_scaled_motion_is_its_excess(part):
    true = motion(np.random.default_rng(3).normal(size=(20, 4)))
    wrong = motion((1.0 + part) * true.displacement)
    assert list(vars(errors(wrong, true)).values()) == pytest.approx([abs(part)] * 5, abs=1e-14)


def test_peaks_below_a_thousandth_of_maximum_are_ignored():
    true = motion([[1.0, 1.0001], [-1.0, -1.0001]])
    wrong = replace(true, peak_drift=true.peak_drift * [1.01, 2.0])
    assert errors(wrong, true).peak_drift == pytest.approx(0.01)
    assert (
        errors(replace(wrong, peak_drift=wrong.peak_drift), motion([[1.0, 1.1]])).peak_drift > 0.9
    )


# ---- the reference


def harmonic_motion(problem, force):
    """Return the closed-form displacements, at the samples, of a linear building that is initially
    at rest under one force cos(omega t)."""
    building = problem.building
    n = building.stories
    inverse = np.diag(1.0 / building.mass)
    c, k = building.damping_matrix(), building.stiffness_matrix()
    step = expm(
        problem.interval * np.block([[np.zeros((n, n)), np.eye(n)], [-inverse @ k, -inverse @ c]])
    )
    amplitude = np.zeros(n)
    amplitude[force.floor - 1] = force.cosine
    dynamic = k - force.omega**2 * np.diag(building.mass) + 1j * force.omega * c
    steady = np.linalg.solve(dynamic, amplitude)
    free = -np.concatenate([steady.real, (1j * force.omega * steady).real])
    times = problem.interval * np.arange(problem.samples + 1)
    motion = (steady * np.exp(1j * force.omega * times)[:, None]).real
    for row in motion:
        row += free[:n]
        free = step @ free
    return motion


@pytest.mark.parametrize("stiffness", [600.0, 1e7])
def test_gap_bounds_error_of_reference(stiffness):
    """The gap is also valid if a stiff part is not resolved, although similar methods would agree
    on the same wrong motion."""
    force = Force(2, 5.0, 0.0, 1.2)
    building = model(
        [story(1.0, stiffness, dashpot=1.0), story(1.0, 1.0, dashpot=0.1)],
        forces=[force],
        dt=0.25,
        duration=10.0,
    )
    problem = pose(building)
    found = find_reference(problem, problem.samples, cached=False)
    truth = harmonic_motion(problem, force)
    drift = drifts(found.motion.displacement) - drifts(truth)
    error = np.linalg.norm(drift) / np.linalg.norm(drifts(truth))
    assert error <= 2.0 * found.gap.drift + 1e-10


def test_unsolvable_building_has_no_reference():
    """Beyond its strength, the story loses all stiffness and the displacement grows without
    bound."""
    falling = model(
        [story(1.0, 1.0, Law("polynomial", (1.0, 0.0, -1.0)))],
        velocity=(3.0,),
        dt=0.1,
        duration=20.0,
    )
    with pytest.raises(AnalysisError, match=r"impulse4 .* time step .* fails"):
        find_reference(pose(falling), 200, cached=False)


@pytest.fixture
def cache(tmp_path, monkeypatch):
    """Return the cache directory and the list of computed references."""
    solved = []
    solve = references._solve

    def count(problem, samples):
        solved.append(samples)
        return solve(problem, samples)

    monkeypatch.setattr(references, "_solve", count)
    monkeypatch.setattr(references, "cache_folder", lambda: tmp_path)
    return tmp_path / "references", solved


def test_each_problem_has_its_own_cached_reference(cache, monkeypatch):
    """The oldest references are removed if the cache is full."""
    folder, solved = cache
    base = pose(forced(0.2))
    own = base.model
    softer = (
        own.stories[0],
        replace(own.stories[1], stiffness=399.0, law=Law("polynomial", (399.0, 0.0, 4000.0))),
    )
    others = [
        pose(replace(own, initial=replace(own.initial, velocity=(0.3, 0.6)))),
        pose(replace(own, excitation=replace(own.excitation, forces=(Force(2, 21.0, 0.0, 5.0),)))),
        pose(own, replace(noise(samples=11), dt=0.02)),
        pose(replace(own, stories=softer)),
        replace(base, interval=0.01),
    ]
    for problem in (base, *others):
        find_reference(problem, base.samples)
    find_reference(base, base.samples + 1)
    assert len(solved) == len(others) + 2
    assert len(list(folder.iterdir())) == len(others) + 2
    monkeypatch.setattr(references, "_KEPT", 1)
    find_reference(base, base.samples - 1)
    assert len(list(folder.iterdir())) == 1


@pytest.mark.parametrize("damage", ["none", "empty", "cut", "text", "flipped"])
def test_reference_is_cached_and_corrupt_file_is_recomputed(cache, damage):
    folder, solved = cache
    problem = pose(forced(0.2))
    good = find_reference(problem, problem.samples)
    (file,) = folder.iterdir()
    data = bytearray(file.read_bytes())
    kept = bytes(data)
    data[len(data) // 2] ^= 0xFF
    damaged = {
        "none": kept,
        "empty": b"",
        "cut": data[: len(data) // 3],
        "text": b"hello",
        "flipped": data,
    }
    file.write_bytes(damaged[damage])
    for _ in range(2):
        again = find_reference(problem, problem.samples)
        assert len(solved) == (1 if damage == "none" else 2)
        assert (again.method, again.dt, again.confirmed_by) == (
            good.method,
            good.dt,
            good.confirmed_by,
        )
        assert again.gap == good.gap
        for name in ("displacement", "velocity", "acceleration", "peak_drift"):
            np.testing.assert_array_equal(getattr(again.motion, name), getattr(good.motion, name))
    assert len(list(folder.iterdir())) == 1
    find_reference(problem, problem.samples, cached=False)
    assert len(solved) == (2 if damage == "none" else 3)


def test_unwritable_cache_is_ignored(cache, monkeypatch, tmp_path):
    _, solved = cache
    (tmp_path / "file").write_text("")
    for folder in (tmp_path / "file", None):
        monkeypatch.setattr(references, "cache_folder", lambda folder=folder: folder)
        problem = pose(forced(0.2))
        assert find_reference(problem, problem.samples).gap.worst < 1e-8
    assert len(solved) == 2


# ---- the chart


def test_errors_of_chart_agree_with_run():
    building, record = ten_linear(), noise(samples=201)
    chart = measure(
        pose(building, record), integrators("newmark-average"), [0.005], repeats=1, cached=False
    )
    response = run(building, record, method="newmark-average", dt=0.005, history=True)
    exact = exact_linear(building, record)
    difference = response.history.displacement[::2] - exact
    found = chart.points[0].errors
    assert found.displacement == pytest.approx(
        np.linalg.norm(difference) / np.linalg.norm(exact), rel=1e-6
    )
    drift = np.linalg.norm(drifts(difference)) / np.linalg.norm(drifts(exact))
    assert found.drift == pytest.approx(drift, rel=1e-6)


@pytest.mark.parametrize("name", ["diverged", "not-converged"])
def test_failed_run_remains_in_chart(name, monkeypatch):
    from tdint.kernels import layout as rows
    from tdint.response.runs.prepared import PreparedBuilding

    loop = PreparedBuilding.loop
    code = rows.NOT_FINITE if name == "diverged" else rows.NOT_CONVERGED

    def fail(self, integrator, *arguments):
        return (
            (lambda *_: code)
            if integrator.label == "houbolt"
            else loop(self, integrator, *arguments)
        )

    monkeypatch.setattr(PreparedBuilding, "loop", fail)
    chart = measure(
        pose(forced()), integrators("houbolt", "impulse4"), [0.02], repeats=2, cached=False
    )
    assert [(point.outcome, point.errors is None) for point in chart.points] == [
        (name, True),
        ("done", False),
    ]
    assert cheapest(chart.points, "displacement", 1.0).line == "impulse4"


def point(line, dt, time, error):
    found = None if error is None else Errors(error, error, error, error, error)
    return Point(
        line, dt, 1, "done" if found else "unstable-step", 1, found, (time, 2.0 * time), line=line
    )


@pytest.mark.parametrize(("verdicts", "turns"), [("aaaaaaaa", 2), ("abbbbbbb", 3), ("abababab", 8)])
def test_timing_is_repeated_until_verdict_is_stable(verdicts, turns):
    """The number of repetitions is at least the requested two, and at most four times this
    number."""
    problem = pose(ten_linear(), noise(samples=21))
    remaining_verdicts = iter(verdicts)
    chart = measure(
        problem, integrators("newmark-average"), (problem.interval,), repeats=2, cached=False,
        judge=lambda points: next(remaining_verdicts),
    )  # fmt: skip
    assert len(chart.points[0].times) == turns


@pytest.mark.long
def test_recommended_run_meets_target_error():
    """The building is bilinear, and its reference is confirmed by another method."""
    building, record = stretched(ten_bilinear(), 4), noise(samples=201, peak=6.0)
    problem = pose(building, record)
    methods = integrators("impulse4", "newmark-average", "central-difference", "bathe")
    chart = measure(
        problem, methods, default_steps(problem, len(methods), 1), repeats=1, cached=False
    )
    assert chart.reference.method == "impulse4"
    assert "newmark-average" in chart.reference.confirmed_by
    assert chart.reference.gap.worst < 1e-6
    # error of this run: 4e-6
    fine = run(building, record, method="newmark-average", dt=record.dt / 64)
    for limit in (1e-2, 1e-3):
        advice = cheapest(chart.points, "peak_drift", limit)
        response = run(building, record, method=advice.method, dt=advice.dt)
        assert np.max(np.abs(response.stories.peak_drift / fine.stories.peak_drift - 1.0)) <= limit


def test_default_time_steps_are_halvings_and_intermediate_steps():
    problem = pose(oscillator(10.0), noise(samples=21))
    intervals = [8, 6, 4, 3, 2, 1, 1 / 2, 1 / 3, 1 / 4, 1 / 6, 1 / 8, 1 / 12, 1 / 16]
    assert np.array(default_steps(problem, 1, 1)) / problem.interval == pytest.approx(intervals)


def test_long_runs_have_fewer_default_time_steps():
    problem = replace(pose(ten_linear(), noise()), samples=100_000_000)
    assert default_steps(problem, 9, 5) == pytest.approx([0.08, 0.06, 0.04, 0.03, 0.02, 0.01])


def test_problem_with_tables_of_forces_has_default_step_of_run():
    """It is a fiftieth of the first period, or the interval of the table if that is shorter."""
    story = {"mass": 1.0, "stiffness": (2.0 * math.pi / 0.8) ** 2}
    for interval, expected in ((0.5, 0.016), (0.002, 0.002)):
        forces = [{"floor": 1, "points": [[0, 1.0], [interval, 0.0]]}]
        loaded = {"stories": [story], "damping": "none", "excitation": {"forces": forces}}
        definition = model_of(loaded)
        problem = pose(definition, duration=1.6)
        assert problem.interval == pytest.approx(expected, rel=1e-12)
        assert problem.interval == run(loaded, duration=1.6, check=False).dt
        assert pose(definition, duration=1.6, dts=(0.02,)).interval == 0.02


def test_invalid_problems_are_refused():
    with pytest.raises(UsageError, match=r"time step .*0\.02 s"):
        measure(pose(forced()), integrators("impulse4"), [0.013], cached=False)
    with pytest.raises(UsageError, match="dt must be a positive number"):
        measure(pose(forced()), integrators("impulse4"), [math.nan], cached=False)
    with pytest.raises(UsageError, match="the time step is required"):
        pose(oscillator(1.0, displacement=(1.0,), duration=1.0))
    with pytest.raises(UsageError, match="the duration is required"):
        pose(oscillator(1.0, displacement=(1.0,), dt=0.1))
    assert pose(oscillator(1.0, displacement=(1.0,), duration=1.0), dts=(0.1, 0.2)).interval == 0.2


# ---- sizes


@pytest.mark.parametrize("count", [1, 3, 25])
def test_stretched_building_keeps_pattern_and_damping(count):
    building = ten_bilinear()
    assert stretched(building, 10) is building
    taller = stretched(building, count)
    assert len(taller.stories) == count
    assert taller.stories[0] == building.stories[0]
    assert set(taller.stories) <= set(building.stories)
    a, b = assemble(building), assemble(taller)
    for row in range(2, 4):  # dampers of floor and story over mass and stiffness
        np.testing.assert_allclose(b.linear_terms[row, 0], a.linear_terms[row, 0], rtol=1e-12)


@pytest.mark.parametrize(
    ("lowest", "story_keys", "tangent"),
    [
        ({"mass": 1.0, "stiffness": 5.0, "isolator": True}, {}, False),
        ({}, {"dashpot": {"coefficient": 0.5, "angle": 35}}, False),
        ({}, {"law": {"type": "bilinear", "yield_force": 1.0, "hardening": 0.1}}, True),
    ],
)
def test_coefficients_of_a_stretched_building_are_those_of_the_building(
    lowest, story_keys, tangent
):
    above = {"mass": 1.0, "stiffness": 100.0, "repeat": 3, **story_keys}
    ratios = {"ratio": 0.05, "modes": [1, 3], "tangent": tangent}
    content = {"stories": [lowest, above] if lowest else [above], "damping": {"rayleigh": ratios}}
    taller = stretched(load_model(content), 7)
    omega = assemble(load_model(content)).modes().omega[[0, 2]]
    a0, a1, is_tangent = taller.damping
    np.testing.assert_allclose(a0 / (2.0 * omega) + a1 * omega / 2.0, 0.05)
    assert is_tangent == tangent


DEVICES = {
    "name": "frame",
    "stories": [{"mass": 1.0, "stiffness": 400.0, "repeat": 4}],
    "damping": {"rayleigh": {"ratio": 0.05, "modes": [1, 3]}},
    "attachments": [{"name": "box", "floor": "roof", "mass": 0.1, "stiffness": 3.0}],
    "links": [
        {"name": "brace", "from": "ground", "to": 2, "stiffness": 80.0},
        {"name": "rope", "from": "box", "to": 3, "dashpot": 0.1},
    ],
}


def test_stretched_building_moves_attachments_and_links():
    for count, floor, brace, rope in ((2, 2, (0, 1), (3, 2)), (8, 8, (0, 4), (9, 6))):
        other = stretched(load_model(DEVICES), count)
        assert other.attachments[0].floor == floor
        assert [link.ends for link in other.links] == [brace, rope]
        assemble(other)
    with pytest.raises(UsageError, match="both ends of the link tie are on the same floor"):
        tie = {"name": "tie", "from": 3, "to": 4, "stiffness": 80.0}
        stretched(load_model(DEVICES | {"links": [tie]}), 2)
    matrix = {"stories": [{"mass": 1.0}, {"mass": 1.0}], "stiffness_matrix": [[2, -1], [-1, 1]]}
    with pytest.raises(UsageError, match="matrices or flexural stories cannot be changed"):
        stretched(load_model(matrix), 3)


def test_errors_of_a_building_with_attachments_and_links_are_those_of_its_floors():
    problem = pose(load_model(DEVICES), noise(samples=101))
    step = problem.interval
    measured = measure(problem, integrators("newmark-average"), [step], cached=False, repeats=1)
    assert measured.stories == measured.reference.motion.drift.shape[1] == 4
    case = problem.case(parse("newmark-average"))
    displacement = case.integrate(case.steps(step, 100 * step), history=True).history.displacement
    drift = np.diff(displacement[:, :4], axis=1, prepend=0.0)
    true = measured.reference.motion.every(1, len(drift)).drift
    assert measured.points[0].errors.drift == pytest.approx(
        np.linalg.norm(drift - true) / np.linalg.norm(true)
    )


def test_stretched_building_moves_forces_and_initial_state():
    shaken = model(
        [story(1.0, 100.0)] * 4, forces=[Force(1, 1.0, 0.0, 1.0), Force(4, 2.0, 0.0, 1.0)],
        displacement=(0.1, 0.2, 0.3, 0.4), damping=ModalDamping((0.05, 0.04, 0.03)),
    )  # fmt: skip
    for count in (2, 8):
        other = stretched(shaken, count)
        assert [force.floor for force in other.excitation.forces] == [max(1, count // 4), count]
        assert other.initial.displacement[0] == 0.1
        assert len(other.initial.displacement) == count
        assemble(other)
    assert stretched(shaken, 2).damping.ratios == (0.05, 0.04)


# ---- Clock for time integrations


def test_clock_excludes_waiting_time_of_thread(monkeypatch):
    """The thread clock is used if its resolution is sufficient. With a resolution of ticks, as on
    Windows, or a stopped clock, wall time is used."""
    system.clock.cache_clear()
    if system.clock() == "thread_time":
        begin, wall = system.seconds(), time.perf_counter()
        time.sleep(0.2)
        assert system.seconds() - begin < 0.1 < time.perf_counter() - wall
    for ticks in (lambda: time.perf_counter() // 0.016 * 0.016, lambda: 0.0):
        monkeypatch.setattr(time, "thread_time", ticks)
        system.clock.cache_clear()
        assert system.clock() == "perf_counter"
    assert Timing.of([timed(3.0, (1.0,), (2.0,))]).stretch is None
    monkeypatch.undo()
    system.clock.cache_clear()


def timed(dt, times, walls):
    return Point("one", dt, 1, "done", 1, Errors(0.0, 0.0, 0.0, 0.0, 0.0), times, walls=walls)


@pytest.mark.parametrize(
    ("walls", "stretch", "disturbed"), [((1.05, 1.05), 1.05, False), ((1.0, 1.3), 1.15, True)]
)
def test_timing_reports_ratio_of_wall_time_to_processor_time(
    walls, stretch, disturbed, monkeypatch
):
    monkeypatch.setattr(system, "clock", lambda: "thread_time")
    unstable = Point("one", 1.0, 1, "unstable-step")
    timing = Timing.of([unstable, timed(0.5, (1.0, 1.0), walls), timed(0.2, (1.0,), (stretch,))])
    assert timing.stretch == pytest.approx(stretch)
    assert timing.disturbed == disturbed
    assert timing.repeats == (1, 2)
    assert timing.description.startswith("minimum of 1 to 2 times")


# ---- Lines with time steps that are chosen for a tolerance


@pytest.mark.long
def test_lines_by_tolerance_equal_runs_with_tolerance():
    """Errors of peak drifts and times equal those of separate runs with a separate reference; other
    errors are unknown."""
    building, record = ten_bilinear(), noise(samples=101)
    charted = chart(
        building,
        record,
        method="impulse4",
        dt=record.dt,
        repeats=2,
        tolerances=["0.1%", 0.02],
        cached=False,
    )
    lines = [point for point in charted.points if math.isnan(point.dt)]
    assert [(point.line, point.method.rpartition(" ")[2]) for point in lines] == [
        (f"{method} by tolerance", tolerance)
        for method in CHOOSING
        for tolerance in ("0.02", "0.001")
    ]
    fine = run(building, record, dt=record.dt / 64).stories.peak_drift
    for point in lines:
        own = run(
            building,
            record,
            method=point.line.partition(" ")[0],
            tolerance=float(point.method.rpartition(" ")[2]),
        )
        error = np.max(np.abs(own.stories.peak_drift / fine - 1.0))
        assert point.error("peak-drift") == pytest.approx(error, rel=1e-3, abs=1e-6)
        assert error <= float(point.method.rpartition(" ")[2])
        assert math.isnan(point.error("drift")) and point.steps is None
        assert len(point.times) == 2 and min(point.times) > 0.0
    plain = next(point for point in charted.points if point.line == "impulse4")
    assert (
        min(point.fastest for point in lines) > plain.fastest
    )  # a run with an error estimate takes longer than the time integration alone


def test_unreachable_tolerance_is_reported_as_outcome():
    charted = chart(
        ten_linear(),
        noise(samples=51),
        method="exact",
        repeats=1,
        tolerances=[1e-300],
        cached=False,
        dt=[0.01],
    )
    outcomes = {
        point.line: (point.outcome, point.errors)
        for point in charted.points
        if math.isnan(point.dt)
    }
    assert outcomes == {
        f"{method} by tolerance": ("not-within-tolerance", None) for method in CHOOSING
    }
