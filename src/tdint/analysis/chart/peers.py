"""Other programs in the same chart.

OpenSeesPy is used if it is installed. The methods RK45, Radau and LSODA of SciPy (solve_ivp) choose
their own time steps.
"""

from __future__ import annotations

import io
import json
import math
import subprocess
import sys
from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from importlib.metadata import PackageNotFoundError, version
from types import SimpleNamespace
from typing import Any

import numpy as np

from tdint import system
from tdint.analysis.chart import opensees_worker
from tdint.analysis.chart.problem import FloorMotion, Problem, Reference, RelativeErrors, errors
from tdint.analysis.chart.work_precision import NOT_RUN, Chart, Peer, Point, Progress, silent
from tdint.analysis.run.outcome import DIVERGED, NOT_CONVERGED
from tdint.analysis.time_steps import Steps
from tdint.arrays import Array
from tdint.kernels import layout as rows
from tdint.methods.catalogue import parse
from tdint.methods.method import Integrator
from tdint.model.damage_states import DONE
from tdint.model.definition import CODES
from tdint.model.plugins import peers

_REPEATS = 3  # maximum; OpenSeesPy is up to 500 times slower than tdint
_MINUTES = 5.0  # min; time limit of the process
# Normalized drifts of a table for a curve; its chords deviate by 1e-6 of the force
_TABLE = np.linspace(-1.0, 1.0, 8001)
_REACH = 4.0  # range of the table over the peak drift of the reference; long steps exceed the peak
# Numbers of steps per interval, tried until two solutions show that the hysteresis models agree
_CHECKED = (8, 16, 32, 64, 128)
_SAME = 1e-9  # relative tolerance of equality; exceeds the rounding errors of a division


NO_PROCESS = "its process did not start or did not end"
"""Reason for missing points of OpenSees that may not occur again, for example on a busy machine."""

_OPENSEES: dict[str, Callable[[float], tuple[Any, ...]]] = {
    "newmark-average": lambda _: ("Newmark", 0.5, 0.25),
    "hht": lambda alpha: ("HHT", 1.0 + alpha),
    "generalized-alpha": lambda rho: (
        "GeneralizedAlpha",
        (2.0 - rho) / (1.0 + rho),
        1.0 / (1.0 + rho),
    ),
}
"""Name and parameters of each of our methods in OpenSees, as a function of its first parameter. The
weights of OpenSees refer to the end of the step, ours to the start."""


def _bouc_wen(k: float, _: float, *parameters: float) -> tuple[Any, ...]:
    strength, hardening, n, beta = parameters[:4]
    size = (k / strength) ** n
    return "BoucWen", hardening, k, n, (1.0 - beta) * size, beta * size, 1.0, 0.0, 0.0, 0.0


def _elastic(drifts: Array, forces: Array) -> tuple[Any, ...]:
    return "ElasticMultiLinear", "-strain", *drifts.tolist(), "-stress", *forces.tolist()


def _stops(k: float, _: float, gap: float, stop: float, *__: float) -> tuple[Any, ...]:
    drifts = gap * np.array([-2.0, -1.0, 1.0, 2.0])
    return _elastic(drifts, k * drifts + stop * (drifts - np.clip(drifts, -gap, gap)))


def _tanh(k: float, reach: float, strength: float, *_: float) -> tuple[Any, ...]:
    drifts = reach * _TABLE
    return _elastic(drifts, strength * np.tanh(k * drifts / strength))


def _polynomial(_: float, reach: float, *coefficients: float) -> tuple[Any, ...]:
    drifts = reach * _TABLE
    return _elastic(
        drifts, np.asarray(np.polynomial.polynomial.polyval(drifts, (0.0, *coefficients)))
    )


_MATERIALS: dict[str, Callable[..., tuple[Any, ...]]] = {
    "linear": lambda k, *_: ("Elastic", k),
    "bilinear": lambda k, _, strength, hardening, *__: ("Steel01", strength, k, hardening),
    "gap": _stops,
    "bouc-wen": _bouc_wen,
    "tanh": _tanh,
    "polynomial": _polynomial,
}
"""OpenSees material with its parameters for each of our laws, as a function of the stiffness, the
range of drifts and the parameters of the law. Only laws with an equal material are listed. Curves
are represented by tables."""

_OF_ORDER_1 = ("bouc-wen",)
"""Laws with a material that uses only the rate at the end of the step: the error of a run decreases
with order 1."""

ITERATED = (
    "openseespy/generalized-alpha: from the second iteration of a step on, OpenSees balances the "
    "forces of the weighted time with the acceleration at the end of the step; its error decreases "
    "with order 1, and its iterations converge by (1 - alpha_m) / alpha_m (shown by "
    "tests/benchmarks/opensees_generalized_alpha.py)"
)
"""Note of a chart if time steps need more than one equation solution."""


def openseespy_points(
    problem: Problem,
    dts: Sequence[float],
    reference: Reference,
    *,
    repeats: int = _REPEATS,
    share: float = 1.0,
    judge: Callable[[Any], RelativeErrors] | None = None,
) -> tuple[list[Point], list[str]]:
    """Return the points of OpenSeesPy: average acceleration, HHT and generalized-alpha.

    The parameters are our defaults. The building is equal: each story is a zeroLength element with
    a material of `_MATERIALS`, in parallel with Viscous for a dashpot and Elastic for P-delta.
    Rayleigh damping uses the initial stiffness. The record is a Path time series, and the initial
    acceleration satisfies equilibrium. Newton's method (for linear buildings Linear, factorized
    one time) iterates until the unbalanced forces are 1e-9 of the maximum inertia force; the
    system of equations is BandSPD. Only `analyze` is timed. Peaks are maxima over the steps.
    Accelerations satisfy equilibrium, as ours do.

    Parameters
    ----------
    problem : Problem
        Building with its excitation.
    dts : sequence of float
        Time steps, s.
    reference : Reference
        Reference solution of the errors.
    repeats : int
        Number of times that each run is timed; at most 3.
    share : float
        Fraction of the time for one problem that all runs of an integrator may use. Runs with large
        steps are executed first; points of runs that are not executed have the outcome `not-run`.
    judge : callable, optional
        Function that returns errors from the peaks; default is the errors of the motion.

    Returns
    -------
    tuple
        List of points, and list of notes on omitted points.
    """
    if reason := _unsupported(problem):
        return [], [f"openseespy is omitted: {reason}"]
    runs = [(parse(name), problem.steps(dt)) for name in _OPENSEES for dt in dts]
    runs.sort(key=lambda run: run[1].count)  # if time is up, the most expensive runs are missing
    answer, why = _ask(problem, runs, reference, min(repeats, _REPEATS), share)
    if why:
        return [], [f"openseespy is omitted: {why}"]
    points = []
    for number, (integrator, steps) in enumerate(runs):
        got = {
            name.partition("_")[2]: value
            for name, value in answer.items()
            if name.startswith(f"{number}_")
        }
        label, outcome = f"openseespy/{integrator.label}", str(got["outcome"])
        point = Point(label, steps.h, steps.count, outcome, line=label)
        if outcome == DONE:
            motion = _motion(problem, steps, got["motion"], got["peak_drift"])
            off = judge(SimpleNamespace(**got)) if judge else errors(motion, reference.motion)
            point = replace(
                point,
                iterations=int(got["iterations"]),
                errors=off,
                times=tuple(got["times"].tolist()),
            )
        points.append(point)
    order = [f"openseespy/{name}" for name in _OPENSEES]
    points.sort(key=lambda point: (order.index(point.line), -point.dt))
    missing = sum(point.outcome == NOT_RUN for point in points)
    notes = (
        [f"openseespy: {missing} of {len(runs)} runs were not run: larger steps used all the time"]
        if missing
        else []
    )
    if missing < len(points) and not _one_solve(problem):
        notes.append(ITERATED)
    return points, notes


def opensees_gap(problem: Problem, reference: Reference, goal: float) -> tuple[float, str]:
    """Return the difference between OpenSees' average acceleration and our reference.

    The difference is the larger of the errors of the histories of drift and acceleration (L2).
    Steps are halved until the extrapolated limit (Richardson) is within the goal. Our references
    are confirmed by average acceleration in the same manner.

    Parameters
    ----------
    problem : Problem
        Building with its excitation.
    reference : Reference
        Our reference solution.
    goal : float
        Relative difference at which no smaller steps are tried.

    Returns
    -------
    tuple
        Difference, and a description of the steps. If the difference cannot be computed, it is nan
        and the text is the reason.
    """
    if reason := _unsupported(problem):
        return math.nan, reason
    average = parse("newmark-average")
    codes = problem.building.law_parameters[rows.CODE, :-1]
    powers = (2.0, 4.0) if np.isin(codes, [CODES[name] for name in _OF_ORDER_1]).any() else (4.0,)
    gap, note, before = math.nan, "", list[Array]()
    for parts in _CHECKED:
        steps = problem.steps(problem.interval / parts)
        answer, why = _ask(problem, [(average, steps)], reference, 0, math.inf)
        if why or str(answer["0_outcome"]) != DONE:
            return math.nan, why or f"with dt {steps.h:.3g} s it is {answer['0_outcome']}"
        # Each entry eliminates one more error term by extrapolation from the step before.
        limits = [answer["0_motion"]]
        for power, coarse in zip(powers, before, strict=False):
            limits.append(limits[-1] + (limits[-1] - coarse) / (power - 1.0))
        before = limits
        if len(limits) > len(powers):
            off = errors(
                _motion(problem, steps, limits[-1], reference.motion.peak_drift), reference.motion
            )
            gap, note = (
                max(off.drift, off.acceleration),
                f"extrapolated to dt 0 from {steps.h:.3g} s and larger",
            )
            if gap <= goal:
                break
    return gap, note


def _unsupported(problem: Problem) -> str:
    """Return the reason why OpenSees cannot represent the building; empty if it can."""
    building = problem.building
    if not np.all(
        np.isin(building.law_parameters[rows.CODE, :-1], [CODES[name] for name in _MATERIALS])
    ):
        return f"a story's law is not one of {', '.join(_MATERIALS)}"
    if building.power_damped:
        return "the model has power-law dashpots"
    if len(building.modal):
        return "the model has modal damping"
    if _proportion(building.linear_terms[rows.FLOOR_DAMPER, :-1], building.mass) is None:
        return "dampers from the floors to the ground are not in proportion to the masses"
    return ""


def _proportion(values: Array, other: Array) -> float | None:
    """Return the ratio values / other if it is equal for all entries, otherwise None."""
    ratios = values / other
    return float(ratios[0]) if np.ptp(ratios) <= _SAME * np.max(np.abs(ratios)) else None


def _one_solve(problem: Problem) -> bool:
    """Return True if a time step needs one equation solution.

    The tangent of Viscous differs from the tangent of a dashpot, so that a single solution is not
    sufficient for dashpots.
    """
    building = problem.building
    dampers, stiffness = (
        building.linear_terms[rows.STORY_DAMPER, :-1],
        building.law_parameters[rows.STIFFNESS, :-1],
    )
    return building.linear and _proportion(dampers, stiffness) is not None


def _ask(
    problem: Problem,
    runs: Sequence[tuple[Integrator, Steps]],
    reference: Reference,
    repeats: int,
    share: float,
) -> tuple[dict[str, Any], str]:
    """Run OpenSeesPy in a separate process.

    Parameters
    ----------
    problem : Problem
        Building with its excitation.
    runs : sequence of tuple
        Methods and time steps.
    reference : Reference
        Reference solution; it scales the tolerance and the tables of curves.
    repeats : int
        Number of times that each run is timed.
    share : float
        Fraction of `opensees_worker.SECONDS` that each integrator may use.

    Returns
    -------
    tuple
        Arrays of the worker by name, and an empty text; or an empty dict and the reason.
    """
    jobs = [
        {
            "integrator": _OPENSEES[integrator.method.name](
                next(iter(integrator.values), math.nan)
            ),
            "h": steps.h,
            "steps": steps.count,
            "per_sample": steps.per_sample,
            "repeats": repeats,
            "clock": system.clock(),
        }
        for integrator, steps in runs
    ]
    # A separate process is used because OpenSees' libraries would stay loaded and may crash.
    stream = io.BytesIO()
    np.savez(
        stream,
        runs=np.array(json.dumps(jobs)),
        share=np.array(share),
        **_arrays(problem, reference),
    )
    command = [sys.executable, "-P", "-m", opensees_worker.__name__]
    try:
        done = subprocess.run(
            command, input=stream.getvalue(), capture_output=True, timeout=60.0 * _MINUTES
        )
    except (OSError, subprocess.TimeoutExpired):
        return {}, NO_PROCESS
    if done.returncode == opensees_worker.NOT_INSTALLED:
        return {}, "it is not installed (pip install 'tdint[peers]')"
    if done.returncode == opensees_worker.NOT_LOADED:
        why = done.stderr.decode(errors="replace").strip().splitlines()[-1:]
        return {}, f"it cannot be loaded ({' '.join(why)})"
    try:
        with np.load(io.BytesIO(done.stdout), allow_pickle=False) as content:
            return dict(content), ""
    except (ValueError, OSError, EOFError):
        return {}, f"its process ended with code {done.returncode}"


def _arrays(problem: Problem, reference: Reference) -> dict[str, Any]:
    building = problem.building
    stiffness = building.law_parameters[rows.STIFFNESS, :-1]
    names = {CODES[name]: name for name in _MATERIALS}
    stories = building.law_parameters[:, :-1].T.tolist()
    reaches = _REACH * reference.motion.peak_drift
    materials = [
        _MATERIALS[names[story[rows.CODE]]](
            story[rows.STIFFNESS], reach, *story[rows.FIRST_PARAMETER :]
        )
        for story, reach in zip(stories, reaches.tolist(), strict=True)
    ]
    dampers = building.linear_terms[rows.STORY_DAMPER, :-1]
    beta = _proportion(dampers, stiffness)
    # Compute the acceleration of equilibrium, because OpenSees does not compute it at the start.
    start_force = (
        -building.damping_matrix() @ problem.velocity
        - building.stiffness_matrix() @ problem.displacement
    )
    for row in problem.forces:
        start_force[int(row[rows.FLOOR])] += row[rows.COSINE]
    return {
        "mass": building.mass,
        "materials": np.array(json.dumps(materials)),
        "alpha_mass": np.array(
            _proportion(building.linear_terms[rows.FLOOR_DAMPER, :-1], building.mass)
        ),
        "beta_stiffness": np.array(0.0 if beta is None else beta),
        "dashpot": dampers if beta is None else np.zeros_like(dampers),
        "story_damper": dampers,
        "geometric": building.linear_terms[rows.GEOMETRIC, :-1],
        "forces": problem.forces,
        "ground": problem.ground,
        "interval": np.array(problem.interval),
        "one_solve": np.array(_one_solve(problem)),
        "u_start": problem.displacement,
        "v_start": problem.velocity,
        "a_start": np.asarray(start_force / building.mass - problem.ground[0]),
        "largest": np.array(np.max(building.mass * np.abs(reference.motion.acceleration))),
    }


def _motion(problem: Problem, steps: Steps, motion_rows: Array, peak_drift: Array) -> FloorMotion:
    """Return the rows of the worker (u, v, a relative to the ground) as a motion."""
    ground = np.interp(
        problem.interval * steps.stride * np.arange(motion_rows.shape[1]),
        problem.interval * np.arange(problem.ground.size + 1),
        np.append(problem.ground, 0.0),
    )
    return FloorMotion(
        steps.stride, motion_rows[0], motion_rows[1], motion_rows[2] + ground[:, None], peak_drift
    )


_OPENSEES_SETTINGS = (
    "zeroLength elements (Elastic, Steel01, BoucWen, ElasticMultiLinear; Viscous), curves as "
    f"tables of {_TABLE.size} points, BandSPD, Newton until NormUnbalance is "
    f"{opensees_worker.TOLERANCE:g} of the maximum inertia force, at most "
    f"{opensees_worker.ITERATIONS} iterations (Linear -factorOnce in linear buildings); minimum of "
    f"at most {_REPEATS} times"
)
_SCIPY_SETTINGS = (
    "solve_ivp, atol = rtol times the maximum displacement, velocity and yield force; timed one "
    "time"
)

Rate = Callable[[float, Array], Array]

METHODS = ("RK45", "Radau", "LSODA")
TOLERANCES = (1e-3, 1e-4, 1e-5, 1e-6, 1e-7, 1e-8)
SECONDS = 8.0
"""Time limit of a run, s. If a run exceeds it, the run is stopped, and smaller tolerances of the
method are omitted."""


class _TooLong(Exception):
    """A run takes longer than `SECONDS`."""


def solve_ivp_points(
    problem: Problem, reference: Reference, *, seconds: float = SECONDS
) -> tuple[list[Point], list[str]]:
    """Return the points of solve_ivp: one line per method, one point per relative tolerance.

    Each point is one run. Only linear and bilinear stories are supported. The hysteretic part z of
    a bilinear story is a state variable. Its rate is (1 - a) k times the drift rate, and zero
    during yielding; events are not used. The absolute tolerance is the relative tolerance times
    the maximum value of the reference. The motion is computed at the samples, and its peaks are
    the maxima over the samples.

    Parameters
    ----------
    problem : Problem
        Building with its excitation.
    reference : Reference
        Reference solution of the errors.
    seconds : float
        Time limit of a run, s.

    Returns
    -------
    tuple
        List of points, and list of notes on omitted points.
    """
    law = _stories(problem)
    if law is None:
        return [], ["scipy's solve_ivp is omitted: a story's law is neither linear nor bilinear"]
    points: list[Point] = []
    notes: list[str] = []
    for method in METHODS:
        for tolerance in TOLERANCES:
            point = _solve(problem, reference, law, method, tolerance, seconds)
            if point is None:
                notes.append(
                    f"scipy's {method} is omitted from rtol {tolerance:g} on: a run exceeds "
                    f"{seconds:g} s"
                )
                break
            points.append(point)
    return points, notes


def _stories(problem: Problem) -> tuple[Array, Array, Array] | None:
    """Return elastic stiffness, hysteretic stiffness and hysteretic strength of each story.

    The elastic stiffness is the total stiffness of a linear story, and the stiffness after yield
    of a bilinear story. The result is None for other laws.
    """
    laws = problem.building.law_parameters
    bilinear = laws[rows.CODE, :-1] == CODES["bilinear"]
    if not np.all(bilinear | (laws[rows.CODE, :-1] == CODES["linear"])):
        return None
    yields, after = (
        laws[rows.FIRST_PARAMETER : rows.FIRST_PARAMETER + 2, :-1] if bilinear.any() else (0.0, 1.0)
    )
    hardening = np.where(bilinear, after, 1.0)
    stiffness, soft = laws[rows.STIFFNESS, :-1], 1.0 - hardening
    strength = np.where(bilinear, soft * yields, math.inf)
    return (
        hardening * stiffness + problem.building.linear_terms[rows.GEOMETRIC, :-1],
        soft * stiffness,
        strength,
    )


def _rate(problem: Problem, law: tuple[Array, Array, Array], deadline: float) -> Rate:
    """Return the function that computes the rate of the state (u, v, z).

    Parameters
    ----------
    problem : Problem
        Building with its excitation.
    law : tuple of ndarray
        Result of `_stories`.
    deadline : float
        Time by `tdint.system.seconds` after which the function raises `_TooLong`, s.
    """
    building = problem.building
    n = building.stories
    elastic, hysteretic, strength = law
    hysteresis = bool(hysteretic.any())
    damping = building.damping_matrix()
    times = problem.interval * np.arange(problem.ground.size + 1)
    ground = np.append(problem.ground, 0.0)
    floors = problem.forces[:, rows.FLOOR].astype(int)
    cosine, sine, omega = (
        problem.forces[:, rows.COSINE],
        problem.forces[:, rows.SINE],
        problem.forces[:, rows.OMEGA],
    )

    def rate(t: float, state: Array) -> Array:
        if system.seconds() > deadline:
            raise _TooLong
        u, v = state[:n], state[n : 2 * n]
        shear = elastic * np.diff(u, prepend=0.0)
        change = state[2 * n :]
        if hysteresis:
            # The hysteretic part of a bilinear story is elastic until it reaches its strength, and
            # constant afterwards.
            z = state[2 * n :]
            shear += np.clip(z, -strength, strength)
            change = hysteretic * np.diff(v, prepend=0.0)
            change = np.where((np.abs(z) >= strength) & (z * change > 0.0), 0.0, change)
        force = -damping @ v - shear
        force[:-1] += shear[1:]
        np.add.at(force, floors, cosine * np.cos(omega * t) + sine * np.sin(omega * t))
        return np.concatenate([v, force / building.mass - np.interp(t, times, ground), change])

    return rate


def _solve(
    problem: Problem,
    reference: Reference,
    law: tuple[Array, Array, Array],
    method: str,
    tolerance: float,
    seconds: float,
) -> Point | None:
    """Return the point of one run; None if the run exceeds its time limit.

    Parameters
    ----------
    problem : Problem
        Building with its excitation.
    reference : Reference
        Reference solution of the errors.
    law : tuple of ndarray
        Result of `_stories`.
    method : str
        Method of solve_ivp.
    tolerance : float
        Relative tolerance.
    seconds : float
        Time limit, s.
    """
    from scipy.integrate import solve_ivp

    n = problem.building.stories
    _, hysteretic, strength = law
    drift = np.diff(problem.displacement, prepend=0.0)
    inner = [np.clip(hysteretic * drift, -strength, strength)] if hysteretic.any() else []
    start = np.concatenate([problem.displacement, problem.velocity, *inner])
    true = reference.motion
    sizes = [
        np.full(n, np.max(np.abs(true.displacement))),
        np.full(n, np.max(np.abs(true.velocity))),
    ]
    if inner:
        sizes.append(np.where(np.isfinite(strength), strength, 1.0))
    times = problem.interval * np.arange(problem.samples + 1)
    begin = system.seconds()
    rate = _rate(problem, law, begin + seconds)
    try:
        near = {"rtol": tolerance, "atol": tolerance * np.concatenate(sizes)}
        solution = solve_ivp(rate, (0.0, times[-1]), start, method=method, t_eval=times, **near)
    except _TooLong:
        return None
    taken = system.seconds() - begin
    name, line = f"scipy/{method}:rtol={tolerance:g}", f"scipy/{method}"
    if not solution.success:
        return Point(name, math.nan, None, NOT_CONVERGED, line=line)
    u, v = solution.y[:n].T, solution.y[n : 2 * n].T
    quiet = _rate(problem, law, math.inf)
    a = np.array([quiet(t, state)[n : 2 * n] for t, state in zip(times, solution.y.T, strict=True)])
    # The duration may end before or after the end of the record.
    size = min(times.size, problem.ground.size)
    ground = np.interp(times, times[:size], problem.ground[:size], right=0.0)
    peaks = np.max(np.abs(np.diff(u, axis=1, prepend=0.0)), axis=0)
    motion = FloorMotion(1, u, v, a + ground[:, None], peaks)
    return Point(
        name, math.nan, None, DONE, int(solution.nfev), errors(motion, true), (taken,), line=line
    )


def with_plugins(
    problem: Problem, chart: Chart, *, repeats: int, progress: Progress = silent
) -> tuple[Chart, list[str]]:
    """Return the chart with one additional point for each peer of the plug-ins.

    A peer is a function of the problem that returns times and displacements. The times (s) are
    equally spaced and start at 0. They end at or after the last sample, and their spacing is the
    interval divided or multiplied by a whole number. The displacements (m) of the floors at these
    times are relative to the ground, with shape (times, stories). The complete call is timed.
    Errors of velocities and accelerations are not available.

    Parameters
    ----------
    problem : Problem
        Building with its excitation.
    chart : Chart
        Chart to which the points are added.
    repeats : int
        Number of times that each function is timed.
    progress : callable
        Callback for progress reports.

    Returns
    -------
    tuple
        Chart, and list of notes on omitted points.
    """
    points: list[Point] = []
    notes: list[str] = []
    for plugin, name, function in peers():
        progress(plugin, len(points) / (len(points) + 1.0))
        full, line = f"{plugin}/{name}", f"{plugin}/{name.partition(':')[0]}"
        try:
            points.append(
                replace(
                    _called(problem, chart.reference, function, repeats), method=full, line=line
                )
            )
        except Exception as error:  # a function of a plug-in can raise any exception
            notes.append(
                f"{full} is omitted: {type(error).__name__}: {' '.join(str(error).split())}"
            )
    plugins = {point.line.partition("/")[0]: None for point in points}
    added = tuple(
        Peer(plugin, "of a plug-in", "settings of its function", "its complete call")
        for plugin in plugins
    )
    return replace(chart, points=(*chart.points, *points), peers=(*chart.peers, *added)), notes


def _called(
    problem: Problem, reference: Reference, function: Callable[[Any], Any], repeats: int
) -> Point:
    """Return the point of a function of a plug-in, without a name.

    Raises
    ------
    ValueError
        The function returns arrays of other shapes or times.
    """
    taken = []
    for _ in range(repeats):
        begin = system.seconds()
        result = function(problem)
        taken.append(system.seconds() - begin)
    times, u = (np.asarray(values, dtype=np.float64) for values in result)
    n = problem.building.stories
    if times.ndim != 1 or times.size < 2 or u.shape != (times.size, n):
        raise ValueError(
            f"returns times {times.shape} and displacements {u.shape}, expected (rows,) and "
            f"(rows, {n})"
        )
    if not np.all(np.isfinite(u)):
        return Point("", math.nan, times.size - 1, DIVERGED, times=tuple(taken))
    dt = float(times[1])
    steps = problem.steps(dt)
    # Times computed by repeated addition deviate by rounding errors.
    if np.max(np.abs(times - dt * np.arange(times.size))) > 1e-6 * dt:
        raise ValueError("returns times that do not start at 0 or are not equally spaced")
    motion_rows = steps.count // steps.per_sample + 1
    if times.size <= steps.count:
        raise ValueError(f"ends at {times[-1]:.6g} s, before the last sample")
    peaks = np.max(np.abs(np.diff(u[: steps.count + 1], axis=1, prepend=0.0)), axis=0)
    u = u[:: steps.per_sample][:motion_rows]
    unknown = np.full_like(u, math.nan)
    motion = FloorMotion(steps.stride, u, unknown, unknown, peaks)
    return Point(
        "", dt, steps.count, DONE, errors=errors(motion, reference.motion), times=tuple(taken)
    )


def with_peers(
    problem: Problem,
    chart: Chart,
    dts: Sequence[float],
    *,
    repeats: int,
    progress: Progress = silent,
) -> tuple[Chart, list[str]]:
    """Return the chart with additional points of OpenSeesPy and SciPy, and notes on omitted points.

    Their errors refer to the same reference. Their times include only their analysis loops.

    Parameters
    ----------
    problem : Problem
        Building with its excitation.
    chart : Chart
        Chart to which the points are added.
    dts : sequence of float
        Time steps of OpenSeesPy, s.
    repeats : int
        Number of times that each run is timed.
    progress : callable
        Callback for progress reports.
    """
    progress("openseespy", 0.0)
    openseespy, notes = openseespy_points(
        problem, sorted(set(dts), reverse=True), chart.reference, repeats=repeats
    )
    progress("scipy", 0.5)
    others, more = solve_ivp_points(problem, chart.reference)
    chart = replace(
        chart, points=(*chart.points, *openseespy, *others), peers=peers_of([*openseespy, *others])
    )
    return chart, [*notes, *more]


def peers_of(points: Iterable[Point]) -> tuple[Peer, ...]:
    """Return the other programs to which the points belong."""
    programs = {point.line.partition("/")[0] for point in points}
    peers = []
    for name, settings, timed in (
        ("openseespy", _OPENSEES_SETTINGS, "analyze"),
        ("scipy", _SCIPY_SETTINGS, "solve_ivp"),
    ):
        if name in programs:
            try:
                number = version(name)
            except PackageNotFoundError:
                number = "of unknown version"
            peers.append(Peer(name, number, settings, timed))
    return tuple(peers)
