"""Other programs in work-precision diagrams: agreement of OpenSeesPy, errors of SciPy, and reports
of missing results."""

import io
import math
import os
import pickle
import subprocess
import sys
from importlib.machinery import ModuleSpec
from importlib.util import find_spec
from types import SimpleNamespace

import numpy as np
import pytest

import readmes
from building_cases import Force, Law, model, noise, story, ten_bilinear, ten_linear
from facts import each_states
from opensees_stand_in import Domain
from selection import every
from tdint.assessment.chart import opensees_worker, peers
from tdint.assessment.chart.peers import (
    openseespy_points,
    solve_ivp_points,
    with_peers,
    with_plugins,
)
from tdint.assessment.chart.problem import Errors, Reference, find_reference, pose
from tdint.assessment.chart.work_precision import measure
from tdint.errors import UsageError
from tdint.methods.catalogue import load_plugin, parse
from tdint.model.definition import ModalDamping, RayleighCoefficients

installed = pytest.mark.skipif(
    find_spec("openseespy") is None, reason="openseespy is not installed"
)
NOTHING = Errors(0.0, 0.0, 0.0, 0.0, 0.0)


def part_of_results():
    """Return the first half of results, as from a process that ends while it writes."""
    content = pickle.dumps([{"displacement": np.arange(1000.0)}])
    return content[: len(content) // 2]


def dashpots():
    """Return a building with dashpots that are not proportional to the stiffness, and one linear
    story among bilinear stories."""
    weak = Law("bilinear", (4e4, 0.05))
    stories = [
        story(1e3, 1e6, weak, dashpot=5e3),
        story(1e3, 8e5),
        story(8e2, 5e5, weak, dashpot=1e3),
    ]
    return model(stories)


def leaning():
    """Return a building with P-delta effects, which do not contribute to Rayleigh damping."""
    return model(
        [story(1e3, 1e6, Law("bilinear", (4e4, 0.05))), story(1e3, 8e5)],
        p_delta=True,
        damping=RayleighCoefficients(0.3, 1e-3),
    )


def forced():
    stories = [story(10.0, 800.0, dashpot=5.0), story(8.0, 600.0, dashpot=4.0)]
    forces = [Force(2, 5.0, 2.0, 6.0), Force(1, 1.0, 0.0, 0.0)]
    return model(stories, forces=forces, velocity=(0.1, -0.2), dt=0.02, duration=2.0)


PROBLEMS = {
    "linear": lambda: pose(ten_linear(), noise(samples=201)),
    "bilinear": lambda: pose(ten_bilinear(), noise(samples=201, peak=6.0)),
    "dashpots": lambda: pose(dashpots(), noise(samples=201, peak=6.0)),
    "leaning": lambda: pose(leaning(), noise(samples=201, peak=6.0)),
    "forced": lambda: pose(forced()),
}


def own_reference(problem, name, dt):
    """Return a reference that equals one of our methods with one step, so that errors against it
    are differences from our result."""
    steps = problem.steps(dt)
    return Reference(name, dt, "", NOTHING, problem.motion(parse(name), steps))


@pytest.fixture(params=["stand-in", pytest.param("openseespy", marks=installed)])
def opensees(request, monkeypatch, capfdbinary):
    """Provide OpenSeesPy, or a stand-in that follows its manual, for the worker, which is executed
    in this process."""

    def run(command, input, **_):
        monkeypatch.setattr(sys, "stdin", SimpleNamespace(buffer=io.BytesIO(input)))
        # The arguments of pytest are not the ID of a parent process.
        monkeypatch.setattr(sys, "argv", ["opensees_worker"])
        output = os.dup(1)
        code = opensees_worker.main()
        os.dup2(output, 1)  # the worker keeps its output free of messages of OpenSees
        os.close(output)
        return subprocess.CompletedProcess(command, code, capfdbinary.readouterr().out, b"")

    if request.param == "stand-in":
        package = SimpleNamespace(opensees=Domain(), __spec__=ModuleSpec("openseespy", None))
        monkeypatch.setitem(sys.modules, "openseespy", package)
        monkeypatch.setitem(sys.modules, "openseespy.opensees", package.opensees)
        monkeypatch.setattr(peers.subprocess, "run", run)


@pytest.mark.usefixtures("opensees")
@pytest.mark.parametrize(
    ("name", "parts"),
    [
        ("bilinear", 1),
        ("forced", 1),
        *(
            pytest.param(name, 4, marks=pytest.mark.long)
            for name in ("linear", "bilinear", "dashpots", "leaning")
        ),
    ],
)
def test_average_acceleration_agrees_with_openseespy(name, parts):
    problem = PROBLEMS[name]()
    dt = problem.interval / parts
    points, notes = openseespy_points(
        problem, [dt], own_reference(problem, "newmark-average", dt), repeats=1
    )
    assert notes == ([] if name == "linear" else [peers.ITERATED])
    point = next(point for point in points if point.line == "openseespy/newmark-average")
    assert (point.outcome, point.dt, point.steps) == ("done", dt, problem.samples * parts)
    assert point.fastest > 0.0
    assert max(point.errors.displacement, point.errors.drift, point.errors.velocity) < 1e-8
    assert point.errors.acceleration < 1e-7


@pytest.mark.long
@pytest.mark.usefixtures("opensees")
def test_gap_to_openseespy_detects_different_law(monkeypatch):
    """With twice the hardening, the gap between the programs does not decrease with the time
    step."""
    problem = PROBLEMS["bilinear"]()
    reference = own_reference(problem, "impulse4", problem.interval / 16)
    gap, note = peers.opensees_gap(problem, reference, 2e-4)
    assert gap < 2e-4 and note.startswith("extrapolated to dt 0 from ")
    monkeypatch.setattr(peers, "_CHECKED", (2, 4))
    monkeypatch.setitem(
        peers._MATERIALS, "bilinear", lambda k, _, f, b, *__: ("Steel01", f, k, 2.0 * b)
    )
    assert peers.opensees_gap(problem, reference, 2e-4)[0] > 1e-2


@installed
@pytest.mark.parametrize(
    "law",
    [
        Law("tanh", (2e4,)),
        Law("polynomial", (1e6, 0.0, 1e9)),
        Law("bouc-wen", (4e4, 0.05, 2.0, 0.5)),
    ],
)
@pytest.mark.long
def test_curved_laws_agree_with_openseespy(law):
    problem = pose(model([story(1e3, 1e6, law), story(1e3, 8e5)]), noise(samples=201, peak=6.0))
    assert (
        peers.opensees_gap(
            problem, own_reference(problem, "impulse4", problem.interval / 16), 2e-5
        )[0]
        <= 2e-5
    )


def test_curved_law_is_approximated_by_table():
    """The table agrees with the curve within its range; the error of linear interpolation is f''
    dx^2 / 8."""
    for name, values, force in (
        ("tanh", (3.0,), lambda d: 3.0 * np.tanh(2.0 * d / 3.0)),
        ("polynomial", (2.0, 0.5, 4.0), lambda d: 2.0 * d + 0.5 * d**2 + 4.0 * d**3),
    ):
        material, strain, *numbers = peers._MATERIALS[name](2.0, 6.0, *values)
        drifts, forces = numbers[: len(numbers) // 2], numbers[len(numbers) // 2 + 1 :]
        assert (material, strain, numbers[len(drifts)]) == (
            "ElasticMultiLinear",
            "-strain",
            "-stress",
        )
        sought = np.linspace(-6.0, 6.0, 9_973)
        np.testing.assert_allclose(
            np.interp(sought, drifts, forces), force(sought), atol=2e-6 * force(6.0)
        )


@pytest.mark.usefixtures("opensees")
@pytest.mark.long
def test_hht_and_generalized_alpha_agree_with_openseespy():
    """The building is linear, and the results differ from average acceleration. Both programs
    report accelerations from equilibrium at the ends of steps, not algorithmic accelerations."""
    problem = PROBLEMS["linear"]()
    for method in ("hht", "generalized-alpha"):
        points, _ = openseespy_points(
            problem, [0.01], own_reference(problem, method, 0.01), repeats=1
        )
        errors = {point.line.partition("/")[2]: point.errors.displacement for point in points}
        assert errors[method] < 1e-8
        assert errors["newmark-average"] > 1e-4
        (same,) = (point for point in points if point.line.endswith(f"/{method}"))
        assert same.errors.acceleration < 1e-7


@pytest.mark.parametrize("opensees", ["stand-in"], indirect=True)
@pytest.mark.long
def test_failed_and_slow_runs_of_openseespy_are_reported(opensees, monkeypatch):
    """The smallest time steps, which take longest, are run last, and they are reported as
    missing."""
    problem = pose(forced())
    reference = own_reference(problem, "newmark-average", 0.02)
    points, _ = openseespy_points(problem, [0.01, 0.02], reference, repeats=5)
    assert [(point.dt, point.steps) for point in points] == [(0.02, 100), (0.01, 200)] * 3
    assert {len(point.times) for point in points} == {3}
    assert [point.iterations for point in points] == [100, 200] * 3
    monkeypatch.setattr(opensees_worker, "ITERATIONS", 1)
    yielding = PROBLEMS["bilinear"]()
    points, _ = openseespy_points(
        yielding, [0.01], own_reference(yielding, "newmark-average", 0.01)
    )
    assert {point.outcome for point in points} == {"not-converged"}
    monkeypatch.setattr(opensees_worker, "SECONDS", -1.0)
    points, notes = openseespy_points(problem, [0.01, 0.02], reference)
    assert len(notes) == 1 and "6 of 6 runs were not run" in notes[0]
    assert {(point.outcome, point.times, point.errors) for point in points} == {
        ("not-run", (), None)
    }


@pytest.mark.parametrize("opensees", ["stand-in"], indirect=True)
def test_time_limit_applies_to_each_integrator(opensees, monkeypatch):
    """The time limit applies to each integrator, and larger time steps are run first."""
    clock = [0.0]
    run = opensees_worker._run

    def slow(ops, problem, run_data):
        clock[0] += 100.0 if run_data["integrator"][0] == "GeneralizedAlpha" else 1.0
        return run(ops, problem, run_data)

    monkeypatch.setattr(opensees_worker, "_run", slow)
    monkeypatch.setattr(opensees_worker.time, "process_time", lambda: clock[0])
    problem = pose(forced())
    reference = own_reference(problem, "newmark-average", 0.02)
    points, _ = openseespy_points(problem, [0.01, 0.02], reference, repeats=1)
    outcomes = {(point.line.partition("/")[2], point.dt): point.outcome for point in points}
    late = outcomes.pop(("generalized-alpha", 0.01))
    assert late == "not-run" and set(outcomes.values()) == {"done"} and len(outcomes) == 5


@pytest.mark.parametrize(
    ("building", "reason"),
    [
        (
            model([story(1.0, 400.0, Law("peak-oriented", (40.0, 0.1, 0.5)))]),
            "linear, bilinear, gap, bouc-wen, tanh, polynomial",
        ),
        (ten_linear(ModalDamping((0.05,))), "modal damping"),
    ],
    ids=["law", "modal"],
)
def test_unsupported_building_is_omitted_for_openseespy(building, reason):
    problem = pose(building, noise(samples=51))
    points, (note,) = openseespy_points(problem, [0.01], own_reference(problem, "impulse4", 0.01))
    assert points == []
    assert note.startswith("openseespy is omitted: ")
    assert reason in note


@pytest.mark.parametrize(
    ("answer", "reason"),
    [
        ((opensees_worker.NOT_INSTALLED, b""), "it is not installed (pip install 'tdint[peers]')"),
        ((opensees_worker.NOT_LOADED, b""), "it cannot be loaded (no libblas)"),
        ((-11, b""), "its process ended with code -11"),
        ((0, b"nonsense"), "its process ended with code 0"),
        ((-9, part_of_results()), "its process ended with code -9"),
        (None, "did not start or did not end"),
    ],
)
def test_failed_openseespy_process_is_one_note(monkeypatch, answer, reason):
    def run(*_, **__):
        if answer is None:
            raise subprocess.TimeoutExpired("python", 1.0)
        return subprocess.CompletedProcess([], *answer, b"some\nno libblas\n")

    monkeypatch.setattr(peers.subprocess, "run", run)
    problem = PROBLEMS["linear"]()
    points, notes = openseespy_points(problem, [0.01], own_reference(problem, "impulse4", 0.01))
    assert points == [] and each_states(notes, [f"openseespy is omitted: ... {reason}"])


@pytest.mark.skipif(find_spec("openseespy") is not None, reason="openseespy is installed")
def test_worker_reports_missing_openseespy():
    done = subprocess.run(
        [sys.executable, "-m", opensees_worker.__name__], input=b"", capture_output=True
    )
    assert done.returncode == opensees_worker.NOT_INSTALLED


@pytest.mark.parametrize(
    ("name", "part"), [("forced", 0.05), pytest.param("dashpots", 0.5, marks=pytest.mark.slow)]
)
def test_errors_of_solve_ivp_decrease_with_tolerance(name, part, monkeypatch):
    """The decrease is smaller for yielding stories, because the error estimate does not detect a
    kink within a step. The affected steps depend on the last bits of a matrix product: for RK45,
    the ratio is below 0.25 on one processor and 0.27 on another."""
    monkeypatch.setattr(peers, "TOLERANCES", (1e-4, 1e-6))
    problem = PROBLEMS[name]()
    points, notes = solve_ivp_points(
        problem, find_reference(problem, problem.samples, cached=False), seconds=60.0
    )
    assert notes == []
    assert [point.line for point in points] == [
        f"scipy/{method}" for method in peers.METHODS for _ in range(2)
    ]
    for coarse, fine in zip(points[::2], points[1::2], strict=True):
        assert coarse.errors.displacement < 0.05
        assert fine.errors.displacement < part * coarse.errors.displacement
        assert fine.errors.displacement < 1e-3
        assert fine.iterations > coarse.iterations


def test_slow_or_unsupported_solve_ivp_is_omitted():
    problem = PROBLEMS["linear"]()
    points, notes = solve_ivp_points(problem, own_reference(problem, "impulse4", 0.01), seconds=0.0)
    assert points == []
    assert each_states(notes, [f"{method} ... rtol 0.001 ... 0 s" for method in peers.METHODS])
    hardening = model([story(1.0, 400.0, Law("polynomial", (400.0, 0.0, 4.0)))])
    problem = pose(hardening, noise(samples=51))
    points, notes = solve_ivp_points(problem, own_reference(problem, "impulse4", 0.01))
    assert points == [] and each_states(notes, ["solve_ivp ... linear nor bilinear"])


@pytest.mark.long
def test_points_of_peers_follow_points_of_methods(monkeypatch):
    monkeypatch.setattr(peers, "TOLERANCES", (1e-3,))
    problem = PROBLEMS["forced"]()
    chart = measure(problem, [parse("impulse4")], [0.02], repeats=1, cached=False)
    both, notes = with_peers(problem, chart, [0.02], repeats=1)
    assert both.points[: len(chart.points)] == chart.points
    lines = [point.line for point in both.points]
    assert [line for line in lines if line.startswith("scipy")] == [
        f"scipy/{name}" for name in peers.METHODS
    ]
    assert any(line.startswith("openseespy") for line in lines) == (
        not any(note.startswith("openseespy is omitted") for note in notes)
    )


@pytest.fixture
def leapfrog(tmp_path):
    """Register the plug-in of the README and remove it after the test."""
    file = tmp_path / "leapfrog.py"
    file.write_text(readmes.block("plugin-peer"))
    load_plugin(str(file))
    yield file
    sys.modules.pop("tdint_plugin_leapfrog", None)


def test_program_of_plugin_is_charted(leapfrog):
    """The line has two points, and twice the time step gives twice the error (order 1)."""
    problem = pose(ten_linear(), noise(samples=301))
    chart = measure(problem, [parse("newmark-average")], [0.01], repeats=1, cached=False)
    both, notes = with_plugins(problem, chart, repeats=2)
    assert notes == []
    assert [peer.name for peer in both.peers] == ["leapfrog"]
    coarse, fine = both.points[1:]
    assert (coarse.method, coarse.line, fine.line) == (
        "leapfrog/leapfrog:parts=4",
        *2 * ["leapfrog/leapfrog"],
    )
    assert (coarse.dt, coarse.steps, coarse.outcome, len(coarse.times)) == (0.0025, 1200, "done", 2)
    assert coarse.errors.displacement / fine.errors.displacement == pytest.approx(2.0, abs=0.1)
    assert math.isnan(coarse.errors.velocity)


def test_progress_of_plugin_programs_is_fraction_of_their_number(leapfrog, monkeypatch):
    """A program that fails counts also."""
    problem = pose(ten_linear(), noise(samples=301))
    chart = measure(problem, [parse("newmark-average")], [0.01], repeats=1, cached=False)
    functions = tuple((name, lambda problem: problem.nothing) for name in "abcd")
    monkeypatch.setattr(sys.modules["tdint_plugin_leapfrog"], "PEERS", functions)
    reported = []
    with_plugins(problem, chart, repeats=1, progress=lambda *report: reported.append(report))
    assert reported == [("leapfrog", fraction) for fraction in (0.0, 0.25, 0.5, 0.75)]


@pytest.mark.parametrize(
    ("function", "message"),
    every(
        3,
        [
            (lambda problem: problem.nothing, "AttributeError: "),
            (
                lambda problem: (np.arange(3.0), np.zeros((3, 1))),
                "ValueError: the program of the plug-in must return times and displacements of",
            ),
            (
                lambda problem: (0.01 * np.arange(3.0), np.zeros((3, 10))),
                "ValueError: the times that the program of the plug-in returns must include the "
                "end",
            ),
            (lambda problem: (0.003 * np.arange(3.0), np.zeros((3, 10))), "UsageError: "),
            (
                lambda problem: (0.01 * np.arange(400.0) ** 1.5, np.zeros((400, 10))),
                "ValueError: the times that the program of the plug-in returns must start at 0",
            ),
        ],
    ),
)
def test_invalid_result_of_plugin_program_is_reported(function, message, leapfrog, monkeypatch):
    problem = pose(ten_linear(), noise(samples=301))
    monkeypatch.setattr(sys.modules["tdint_plugin_leapfrog"], "PEERS", (("other", function),))
    chart = measure(problem, [parse("newmark-average")], [0.01], repeats=1, cached=False)
    both, (note,) = with_plugins(problem, chart, repeats=1)
    assert both.points == chart.points
    assert note.startswith(f"leapfrog/other is omitted: {message}")
    monkeypatch.setattr(sys.modules["tdint_plugin_leapfrog"], "PEERS", (("other",),))
    with pytest.raises(UsageError, match=r"PEERS must .*name.*function"):
        with_plugins(problem, None, repeats=1)
