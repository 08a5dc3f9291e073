"""Other programs in the same chart: OpenSeesPy, where it is installed, and SciPy's RK45, Radau and
LSODA (solve_ivp), which choose their own steps.
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
from tdint.analysis.run.workspace import Steps
from tdint.arrays import Array
from tdint.kernels import layout as rows
from tdint.methods.catalogue import parse
from tdint.methods.method import Integrator
from tdint.model.damage_states import DONE
from tdint.model.definition import CODES
from tdint.model.plugins import peers

_REPEATS = 3  # at most: a peer takes up to 500 times as long as tdint
_MINUTES = 5.0  # after which the process is ended
_TABLE = np.linspace(-1.0, 1.0, 8001)  # drifts of a curve: its chords are 1e-6 of the force from it
_REACH = 4.0  # times the reference's peak drifts: long steps go farther than it
_CHECKED = (
    8,
    16,
    32,
    64,
    128,
)  # parts of the interval, until two of them tell that the law is the same
_SAME = 1e-9  # beyond what a division of rounded numbers leaves


NO_PROCESS = "its process did not start or did not end"
"""Reason for missing points of OpenSees that another attempt may not have, as on a busy machine."""

_OPENSEES: dict[str, Callable[[float], tuple[Any, ...]]] = {
    "newmark-average": lambda _: ("Newmark", 0.5, 0.25),
    "hht": lambda alpha: ("HHT", 1.0 + alpha),
    "generalized-alpha": lambda rho: (
        "GeneralizedAlpha",
        (2.0 - rho) / (1.0 + rho),
        1.0 / (1.0 + rho),
    ),
}
"""Our method and, of its first parameter, OpenSees' name for it with its parameters, as weights of
the end of the step instead of the start."""


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
"""Our law and, of its stiffness, the drift that it must reach and its parameters, OpenSees'
material with its own: those whose law is the same. Curves are tables."""

_OF_ORDER_1 = ("bouc-wen",)
"""Laws whose material takes the rate at the end of the step alone: the error of a run falls with
order 1."""

ITERATED = (
    "openseespy/generalized-alpha: from the second iteration of a step on OpenSees balances the "
    "forces of the weighted time with the acceleration at the end of the step; its error falls "
    "with order 1, and its iterations converge by (1 - alpha_m) / alpha_m (shown by "
    "tests/benchmarks/opensees_generalized_alpha.py)"
)
"""What is said of a chart where steps take more than one solve."""


def openseespy_points(
    problem: Problem,
    dts: Sequence[float],
    reference: Reference,
    *,
    repeats: int = _REPEATS,
    share: float = 1.0,
    judge: Callable[[Any], RelativeErrors] | None = None,
) -> tuple[list[Point], list[str]]:
    """OpenSeesPy's points, and what of them is left out: average acceleration, HHT and
    generalized-alpha.

    The parameters are those that ours have by default. The building is the same: of each story a
    zeroLength element (a material of `_MATERIALS`), beside it Viscous for a dashpot and Elastic for
    P-delta; Rayleigh damping from the initial stiffness, the record as a Path, the acceleration of
    equilibrium at the start; Newton's method (Linear in linear buildings, factorized once) until
    the unbalanced forces are 1e-9 of the largest force of inertia, BandSPD. The time is that of
    `analyze` alone. Peaks are those at the steps; `judge` has the errors from them in place of
    those of the motion. Accelerations are those of equilibrium, as ours. All runs of an integrator
    may take a `share` of the time that a problem has, largest steps first; points of the others
    have the outcome `not-run`.
    """
    if reason := _unsupported(problem):
        return [], [f"openseespy is left out: {reason}"]
    runs = [(parse(name), problem.steps(dt)) for name in _OPENSEES for dt in dts]
    runs.sort(key=lambda run: run[1].count)  # if time is up, the dearest ones are missing
    answer, why = _ask(problem, runs, reference, min(repeats, _REPEATS), share)
    if why:
        return [], [f"openseespy is left out: {why}"]
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
        [f"openseespy: {missing} of {len(runs)} runs were not run: larger steps took the time"]
        if missing
        else []
    )
    if missing < len(points) and not _one_solve(problem):
        notes.append(ITERATED)
    return points, notes


def opensees_gap(problem: Problem, reference: Reference, goal: float) -> tuple[float, str]:
    """How far OpenSees' average acceleration is from a reference of ours, and how that was found,
    or why it is not.

    The larger of the differences of the histories of drift and acceleration (L2). Steps are halved
    until those that two of them tend to (Richardson) are within the goal, as a reference is
    confirmed by average acceleration of ours.
    """
    if reason := _unsupported(problem):
        return math.nan, reason
    average = parse("newmark-average")
    codes = problem.building.law_parameters[rows.CODE, :-1]
    powers = (2.0, 4.0) if np.isin(codes, [CODES[name] for name in _OF_ORDER_1]).any() else (4.0,)
    gap, said, before = math.nan, "", list[Array]()
    for parts in _CHECKED:
        steps = problem.steps(problem.interval / parts)
        answer, why = _ask(problem, [(average, steps)], reference, 0, math.inf)
        if why or str(answer["0_outcome"]) != DONE:
            return math.nan, why or f"with dt {steps.h:.3g} s it is {answer['0_outcome']}"
        # What has one order of the error less, and so on, each from itself with the step before
        limits = [answer["0_motion"]]
        for power, coarse in zip(powers, before, strict=False):
            limits.append(limits[-1] + (limits[-1] - coarse) / (power - 1.0))
        before = limits
        if len(limits) > len(powers):
            off = errors(
                _motion(problem, steps, limits[-1], reference.motion.peak_drift), reference.motion
            )
            gap, said = (
                max(off.drift, off.acceleration),
                f"extrapolated to dt 0 from {steps.h:.3g} s and larger",
            )
            if gap <= goal:
                break
    return gap, said


def _unsupported(problem: Problem) -> str:
    """Why OpenSees is not given this building; nothing if it can do it."""
    building = problem.building
    if not np.all(
        np.isin(building.law_parameters[rows.CODE, :-1], [CODES[name] for name in _MATERIALS])
    ):
        return f"a story's law is none of {', '.join(_MATERIALS)}"
    if building.power_damped:
        return "the model has power-law dashpots"
    if len(building.modal):
        return "the model has modal damping"
    if _proportion(building.linear_terms[rows.FLOOR_DAMPER, :-1], building.mass) is None:
        return "dampers from the floors to the ground are not in proportion to the masses"
    return ""


def _proportion(values: Array, other: Array) -> float | None:
    """values / other where that is one number."""
    ratios = values / other
    return float(ratios[0]) if np.ptp(ratios) <= _SAME * np.max(np.abs(ratios)) else None


def _one_solve(problem: Problem) -> bool:
    """Whether a step takes one solve. The tangent of Viscous is not that of a dashpot: with it a
    single one does not do."""
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
    """The worker's answer, and why there is none."""
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
    # In a process of its own: OpenSees' libraries would stay in this one, and may end it.
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
    # The start is that of equilibrium, which OpenSees does not look for.
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
    """The worker's rows (u, v, a relative to the ground) as a motion."""
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
    f"{opensees_worker.TOLERANCE:g} of the largest force of inertia, {opensees_worker.ITERATIONS} "
    f"iterations at most (Linear -factorOnce in linear buildings); least of {_REPEATS} times at "
    "most"
)
_SCIPY_SETTINGS = (
    "solve_ivp, atol = rtol times the largest displacement, velocity and yield force; one time each"
)

Rate = Callable[[float, Array], Array]

METHODS = ("RK45", "Radau", "LSODA")
TOLERANCES = (1e-3, 1e-4, 1e-5, 1e-6, 1e-7, 1e-8)
SECONDS = 8.0
"""A run that takes longer is broken off, and so are the smaller tolerances of the method."""


class _TooLong(Exception):
    """A run takes longer than `SECONDS`."""


def solve_ivp_points(
    problem: Problem, reference: Reference, *, seconds: float = SECONDS
) -> tuple[list[Point], list[str]]:
    """Points of solve_ivp, and what is left out: a line per method, a point per relative tolerance,
    one run each.

    Linear and bilinear stories. The hysteretic part z of a bilinear story is a state whose rate is
    (1 - a) k times the drift's, and zero while it yields: no events. The absolute tolerance is the
    relative one times the largest value of the reference. The motion is asked for at the samples;
    its peaks are those at the samples.
    """
    law = _stories(problem)
    if law is None:
        return [], ["scipy's solve_ivp is left out: a story's law is neither linear nor bilinear"]
    points: list[Point] = []
    notes: list[str] = []
    for method in METHODS:
        for tolerance in TOLERANCES:
            point = _solve(problem, reference, law, method, tolerance, seconds)
            if point is None:
                notes.append(
                    f"scipy's {method} is left out from rtol {tolerance:g} on: it takes over "
                    f"{seconds:g} s"
                )
                break
            points.append(point)
    return points, notes


def _stories(problem: Problem) -> tuple[Array, Array, Array] | None:
    """Elastic stiffness, stiffness of the hysteretic part and its strength of each story; None for
    other laws.

    The first is that of the whole story where it is linear, after yield where it is bilinear.
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
    """The rate of the state (u, v, z)."""
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
            # The hysteretic part of a bilinear story: elastic until it reaches its strength, and
            # constant there.
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
    """One run; None for one that takes too long."""
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
    size = min(
        times.size, problem.ground.size
    )  # A duration may end before the record does, or after.
    ground = np.interp(times, times[:size], problem.ground[:size], right=0.0)
    peaks = np.max(np.abs(np.diff(u, axis=1, prepend=0.0)), axis=0)
    motion = FloorMotion(1, u, v, a + ground[:, None], peaks)
    return Point(
        name, math.nan, None, DONE, int(solution.nfev), errors(motion, true), (taken,), line=line
    )


def with_plugins(
    problem: Problem, chart: Chart, *, repeats: int, progress: Progress = silent
) -> tuple[Chart, list[str]]:
    """The chart with a point for each of the PEERS of plug-ins behind its own, and what of them is
    left out.

    A peer is a function of the problem that gives times (s, equally spaced, from 0 to the last
    sample or beyond, whole parts or multiples of the interval apart) and displacements of the
    floors at these (m, relative to the ground, shape (times, stories)). All of the call is timed.
    Errors of velocities and accelerations are not known.
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
        except Exception as error:  # whatever a function of somebody else's raises
            notes.append(
                f"{full} is left out: {type(error).__name__}: {' '.join(str(error).split())}"
            )
    others = {point.line.partition("/")[0]: None for point in points}
    told = tuple(
        Peer(plugin, "of a plug-in", "those of its function", "its whole call") for plugin in others
    )
    return replace(chart, points=(*chart.points, *points), peers=(*chart.peers, *told)), notes


def _called(
    problem: Problem, reference: Reference, function: Callable[[Any], Any], repeats: int
) -> Point:
    """The point that a function of the problem makes, yet without a name; ValueError where it gives
    something else."""
    taken = []
    for _ in range(repeats):
        begin = system.seconds()
        answer = function(problem)
        taken.append(system.seconds() - begin)
    times, u = (np.asarray(values, dtype=np.float64) for values in answer)
    n = problem.building.stories
    if times.ndim != 1 or times.size < 2 or u.shape != (times.size, n):
        raise ValueError(
            f"gives times {times.shape} and displacements {u.shape}, not (rows,) and (rows, {n})"
        )
    if not np.all(np.isfinite(u)):
        return Point("", math.nan, times.size - 1, DIVERGED, times=tuple(taken))
    dt = float(times[1])
    steps = problem.steps(dt)
    if (
        np.max(np.abs(times - dt * np.arange(times.size))) > 1e-6 * dt
    ):  # a clock that was summed up is no nearer
        raise ValueError("gives times that do not begin with 0 or are not equally spaced")
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
    """The chart with the points of other programs behind its own, and what of them is left out, a
    sentence each.

    Their errors are against the same reference; their times are those of their analysis loops
    alone.
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
    """The other programs that some points are of."""
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
