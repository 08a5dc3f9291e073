"""Other programs in the same chart.

OpenSeesPy is used if it is installed. The methods RK45, Radau and LSODA of SciPy (solve_ivp) choose
the time steps automatically.
"""

from __future__ import annotations

import math
import os
import pickle
import subprocess
import sys
from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from importlib.metadata import PackageNotFoundError, version
from types import SimpleNamespace
from typing import Any

import numpy as np

from tdint import system
from tdint.arrays import Array
from tdint.assessment.chart import opensees_worker
from tdint.assessment.chart.problem import FloorMotion, Problem, Reference, RelativeErrors, errors
from tdint.assessment.chart.work_precision import NOT_RUN, Chart, Peer, Point, Progress, silent
from tdint.kernels import layout as rows
from tdint.methods.catalogue import parse
from tdint.methods.method import Integrator
from tdint.model.building import Building
from tdint.model.plugins import peers
from tdint.model.status import DONE
from tdint.model.story_laws import CODES
from tdint.response.runs.outcome import DIVERGED, NOT_CONVERGED
from tdint.response.time_steps import Steps

# Maximum number of times that a run is timed, because OpenSeesPy may be 500 times slower than
# tdint
_REPEATS = 3
_MINUTES = 5.0  # min; time limit of the process of OpenSeesPy
# A force curve is given to OpenSees as a table. These are its drifts over the maximum drift of the
# table; linear interpolation deviates from a smooth curve by 1e-6 of the force.
_TABLE = np.linspace(-1.0, 1.0, 8001)
# Maximum drift of a table over the peak drift of the reference; long steps exceed this peak
_REACH = 4.0
# Numbers of steps per sampling interval of OpenSees, tried in this order until the extrapolated
# response shows that OpenSees' hysteresis models equal the models of tdint
_CHECKED = (8, 16, 32, 64, 128)
_SAME = 1e-9  # relative difference of ratios that are considered equal, because of rounding errors


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
"""Name and parameters of OpenSees' integrator for a method of tdint: key = method of tdint, value =
function of the first parameter of the method (nan without parameters). The parameters differ,
because the weights of OpenSees refer to the end of the step, and the weights of tdint to its
start."""


# The following functions return an OpenSees material with its parameters. Arguments: stiffness
# (N/m), maximum drift of a table (m), and the parameters of the law.


def _bouc_wen(k: float, _: float, *parameters: float) -> tuple[Any, ...]:
    """Return the material BoucWen with coefficient `A` = 1 and without stiffness degradation.

    The parameters are strength (N), ratio of the stiffness after yield to k, exponent n, and the
    share of beta in beta + gamma.
    """
    strength, hardening, n, beta = parameters[:4]
    # OpenSees' hysteretic variable is a drift. Its limit (beta + gamma)**(-1 / n) must equal the
    # yield drift strength / k.
    beta_plus_gamma = (k / strength) ** n
    return (
        "BoucWen",
        hardening,
        k,
        n,
        (1.0 - beta) * beta_plus_gamma,
        beta * beta_plus_gamma,
        1.0,
        0.0,
        0.0,
        0.0,
    )


def _elastic(drifts: Array, forces: Array) -> tuple[Any, ...]:
    """Return a nonlinear elastic material, given by a table of drifts (m) and forces (N)."""
    return "ElasticMultiLinear", "-strain", *drifts.tolist(), "-stress", *forces.tolist()


def _stops(k: float, _: float, gap: float, stop_stiffness: float, *__: float) -> tuple[Any, ...]:
    """Return the material of a linear story with additional elastic stops at drifts of +-gap."""
    # Four points define the three lines; OpenSees extrapolates the outer two.
    drifts = gap * np.array([-2.0, -1.0, 1.0, 2.0])
    return _elastic(drifts, k * drifts + stop_stiffness * (drifts - np.clip(drifts, -gap, gap)))


def _tanh(k: float, maximum_drift: float, strength: float, *_: float) -> tuple[Any, ...]:
    """Return the table of the force strength tanh(k drift / strength)."""
    drifts = maximum_drift * _TABLE
    return _elastic(drifts, strength * np.tanh(k * drifts / strength))


def _polynomial(_: float, maximum_drift: float, *coefficients: float) -> tuple[Any, ...]:
    """Return the table of a force that is a polynomial in the drift."""
    drifts = maximum_drift * _TABLE
    return _elastic(
        drifts, np.asarray(np.polynomial.polynomial.polyval(drifts, (0.0, *coefficients)))
    )


_MATERIALS: dict[str, Callable[..., tuple[Any, ...]]] = {
    "linear": lambda k, *_: ("Elastic", k),
    # Parameters of Steel01: yield force, initial stiffness, stiffness ratio after yield.
    "bilinear": lambda k, _, strength, hardening, *__: ("Steel01", strength, k, hardening),
    "gap": _stops,
    "bouc-wen": _bouc_wen,
    "tanh": _tanh,
    "polynomial": _polynomial,
}
"""Function that returns the OpenSees material, with its parameters, of each law of tdint (key).
Only laws that OpenSees can represent exactly are listed; curves are represented by tables."""

_FIRST_ORDER_LAWS = ("bouc-wen",)
"""Laws with an OpenSees material that uses only the drift rate at the end of the step. The
discretization error of a run is then proportional to the time step; with other materials, to its
square."""

ITERATED = (
    "openseespy/generalized-alpha: from the second iteration of a step on, OpenSees balances the "
    "forces of the weighted time with the acceleration at the end of the step; its error decreases "
    "with order 1, and its iterations converge by (1 - alpha_m) / alpha_m (shown by "
    "tests/benchmarks/opensees_generalized_alpha.py)"
)
"""Note of a chart if time steps need several solutions of the equations."""


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

    The methods have the default parameters of tdint, and the building is the same: each story is a
    zeroLength element with a material of `_MATERIALS`, in parallel with Viscous for a dashpot and
    Elastic for P-delta. Rayleigh damping uses the initial stiffness. The record is a Path time
    series, and the initial acceleration satisfies equilibrium. Newton's method (for linear
    buildings Linear, factorized one time) iterates until the unbalanced forces are 1e-9 of the
    maximum inertia force; the system of equations is BandSPD. Only `analyze` is timed. Peaks are
    maxima over the steps.

    `share` is the fraction of `opensees_worker.SECONDS` that all runs of a single integrator
    together may use. Runs with large steps are executed first; runs that are not executed have the
    outcome `not-run`. `judge` returns the errors of an object with the attributes `peak_drift`,
    `peak_absolute_acceleration` and `peak_total_shear`, by default the errors of the motion.
    """
    if reason := _unsupported(problem):
        return [], [f"openseespy is omitted: {reason}"]
    method_steps = [(parse(name), problem.steps(dt)) for name in _OPENSEES for dt in dts]
    # Start with the fewest steps: if the time is used up, the most expensive runs are missing.
    method_steps.sort(key=lambda run: run[1].count)
    worker_results, failure_reason = _run_worker(
        problem, method_steps, reference, min(repeats, _REPEATS), share
    )
    if failure_reason:
        return [], [f"openseespy is omitted: {failure_reason}"]
    points = []
    for (integrator, steps), run_results in zip(method_steps, worker_results, strict=True):
        label, outcome = f"openseespy/{integrator.label}", run_results["outcome"]
        point = Point(label, steps.h, steps.count, outcome, line=label)
        if outcome == DONE:
            motion = _motion(problem, steps, run_results["motion"], run_results["peak_drift"])
            run_errors = (
                judge(SimpleNamespace(**run_results)) if judge else errors(motion, reference.motion)
            )
            point = replace(
                point,
                iterations=run_results["iterations"],
                errors=run_errors,
                times=tuple(run_results["times"]),
            )
        points.append(point)
    line_order = [f"openseespy/{name}" for name in _OPENSEES]
    points.sort(key=lambda point: (line_order.index(point.line), -point.dt))
    not_run_count = sum(point.outcome == NOT_RUN for point in points)
    notes = []
    if not_run_count:
        notes.append(
            f"openseespy: {not_run_count} of {len(method_steps)} runs were not run, because runs "
            "with larger steps used all of the time"
        )
    if not_run_count < len(points) and not _needs_one_solution(problem):
        notes.append(ITERATED)
    return points, notes


def opensees_gap(problem: Problem, reference: Reference, goal: float) -> tuple[float, str]:
    """Return the relative difference between OpenSees' average acceleration and the reference.

    The difference is the larger of the errors of the drift and acceleration histories (L2). Time
    steps are halved, and the histories are extrapolated to a time step of 0 (Richardson), until the
    difference is at most `goal` or the smallest step has been used. A small difference shows that
    OpenSees integrates the same building.

    Parameters
    ----------
    goal : float
        Relative difference that ends the sequence of smaller steps.
    """
    if reason := _unsupported(problem):
        return math.nan, reason
    average = parse("newmark-average")
    # The error of a run has terms in proportion to h^2, and also to h if a material is of order 1.
    # Halving the step h divides these terms by the following factors.
    law_codes = problem.building.story_laws[rows.CODE]
    error_factors: tuple[float, ...] = (4.0,)
    if np.isin(law_codes, [CODES[name] for name in _FIRST_ORDER_LAWS]).any():
        error_factors = (2.0, 4.0)
    gap, description, previous_limits = math.nan, "", list[Array]()
    for steps_per_interval in _CHECKED:
        steps = problem.steps(problem.interval / steps_per_interval)
        worker_results, failure_reason = _run_worker(
            problem, [(average, steps)], reference, 0, math.inf
        )
        if failure_reason:
            return math.nan, failure_reason
        (run_results,) = worker_results
        if run_results["outcome"] != DONE:
            return math.nan, f"with dt {steps.h:.3g} s it is {run_results['outcome']}"
        # Each further entry eliminates one more term, by extrapolation from the entry at the
        # previous (twice as long) step.
        limits = [run_results["motion"]]
        for error_factor, coarser_limit in zip(error_factors, previous_limits, strict=False):
            limits.append(limits[-1] + (limits[-1] - coarser_limit) / (error_factor - 1.0))
        previous_limits = limits
        if len(limits) > len(error_factors):
            limit_errors = errors(
                _motion(problem, steps, limits[-1], reference.motion.peak_drift), reference.motion
            )
            gap = max(limit_errors.drift, limit_errors.acceleration)
            description = f"extrapolated to dt 0 from {steps.h:.3g} s and larger"
            if gap <= goal:
                break
    return gap, description


def _unsupported(problem: Problem) -> str:
    """Return the reason why OpenSees cannot represent the building; empty if it can."""
    building = problem.building
    if not np.all(np.isin(building.story_laws[rows.CODE], [CODES[name] for name in _MATERIALS])):
        return f"a story's law is not one of {', '.join(_MATERIALS)}"
    if _has_two_strengths(building):
        return "a bilinear story has a different strength in each direction"
    if building.power_damped:
        return "the model has power-law dashpots"
    if building.braced or building.tangent_damped:
        return "the model has dampers with braces or damping with the tangent stiffness"
    if problem.model.excitation.tables:
        return "forces on floors are from tables"
    if len(building.modal):
        return "the model has modal damping"
    if _proportion(building.linear_terms[rows.FLOOR_DAMPER, :-1], building.mass) is None:
        return "dampers from the floors to the ground are not in proportion to the masses"
    return ""


def _has_two_strengths(building: Building) -> bool:
    """Return True if a bilinear story has different yield forces on both sides."""
    table = building.law_parameters[:, :-1]
    bilinear = table[:, table[rows.CODE] == CODES["bilinear"]]
    first = rows.FIRST_PARAMETER
    return bool(bilinear.size and np.any(bilinear[first] != bilinear[first + 2]))


def _proportion(numerators: Array, denominators: Array) -> float | None:
    """Return numerators / denominators if it is equal for all entries, otherwise None."""
    ratios = numerators / denominators
    return float(ratios[0]) if np.ptp(ratios) <= _SAME * np.max(np.abs(ratios)) else None


def _needs_one_solution(problem: Problem) -> bool:
    """Return True if OpenSees needs a single solution of the equations per time step: for a linear
    building with Rayleigh damping and no other dampers.

    Other dampers are the material Viscous. Its tangent is not exact.
    """
    building = problem.building
    dampers = building.linear_terms[rows.STORY_DAMPER, :-1]
    return building.linear and _proportion(dampers, building.story_laws[rows.STIFFNESS]) is not None


def _run_worker(
    problem: Problem,
    runs: Sequence[tuple[Integrator, Steps]],
    reference: Reference,
    repeats: int,
    share: float,
) -> tuple[list[dict[str, Any]], str]:
    """Run OpenSeesPy in a separate process, because its libraries would stay loaded and may crash;
    return the results of each run by name, and the reason of a failure, empty if it succeeds.

    The maximum inertia force of the reference scales the tolerance of OpenSees' iterations, and its
    peak drifts scale the drifts of the force tables that replace curved laws.
    """
    run_descriptions = [
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
    content = {"runs": run_descriptions, "share": share} | _arrays(problem, reference)
    # The worker receives the ID of the present process, so that both processes end together.
    command = [sys.executable, "-P", "-m", opensees_worker.__name__, str(os.getpid())]
    try:
        process = subprocess.run(
            command, input=pickle.dumps(content), capture_output=True, timeout=60.0 * _MINUTES
        )
    except (OSError, subprocess.TimeoutExpired):
        return [], NO_PROCESS
    if process.returncode == opensees_worker.NOT_INSTALLED:
        return [], "it is not installed (pip install 'tdint[peers]')"
    if process.returncode == opensees_worker.NOT_LOADED:
        last_error_line = process.stderr.decode(errors="replace").strip().splitlines()[-1:]
        return [], f"it cannot be loaded ({' '.join(last_error_line)})"
    try:
        return pickle.loads(process.stdout), ""
    # The standard output is not complete if the process crashed before or while it wrote.
    except (pickle.UnpicklingError, EOFError):
        return [], f"its process ended with code {process.returncode}"


def _arrays(problem: Problem, reference: Reference) -> dict[str, Any]:
    """Return the values that describe a problem for `opensees_worker`, by name, in SI units.

    Dampers in proportion to the stiffness are passed as the Rayleigh coefficient `beta_stiffness`,
    other dampers as separate `dashpot` elements. `largest` is the maximum inertia force, N.
    """
    building = problem.building
    stiffness = building.story_laws[rows.STIFFNESS]
    law_names = {CODES[name]: name for name in _MATERIALS}
    story_parameters = building.story_laws.T.tolist()
    maximum_drifts = _REACH * reference.motion.peak_drift
    materials = [
        _MATERIALS[law_names[parameters[rows.CODE]]](
            parameters[rows.STIFFNESS], maximum_drift, *parameters[rows.FIRST_PARAMETER :]
        )
        for parameters, maximum_drift in zip(story_parameters, maximum_drifts.tolist(), strict=True)
    ]
    dampers = building.linear_terms[rows.STORY_DAMPER, :-1]
    beta = _proportion(dampers, stiffness)  # None for dampers without proportion
    # Compute the acceleration of equilibrium, because OpenSees does not compute it at the start.
    start_force = (
        -building.damping_matrix() @ problem.velocity
        - building.stiffness_matrix() @ problem.displacement
    )
    # At t = 0, the sine terms of the forces are 0.
    for row in problem.forces:
        start_force[int(row[rows.FLOOR])] += row[rows.COSINE]
    return {
        "mass": building.mass,
        "materials": materials,
        "alpha_mass": _proportion(building.linear_terms[rows.FLOOR_DAMPER, :-1], building.mass),
        "beta_stiffness": 0.0 if beta is None else beta,
        "dashpot": dampers if beta is None else np.zeros_like(dampers),
        "story_damper": dampers,
        "geometric": building.linear_terms[rows.GEOMETRIC, :-1],
        "forces": problem.forces,
        "ground": problem.ground,
        "interval": problem.interval,
        "one_solve": _needs_one_solution(problem),
        "u_start": problem.displacement,
        "v_start": problem.velocity,
        "a_start": np.asarray(start_force / building.mass - problem.ground[0]),
        "largest": float(np.max(building.mass * np.abs(reference.motion.acceleration))),
    }


def _motion(problem: Problem, steps: Steps, motion_rows: Array, peak_drift: Array) -> FloorMotion:
    """Return a motion of the worker with absolute instead of relative accelerations.

    `motion_rows` is the displacement (m), velocity (m/s) and acceleration (m/s^2) relative to the
    ground. `peak_drift` is the maximum absolute drift of each story, m.
    """
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
"""Right-hand side of a system of ordinary differential equations: rate(t, state)."""

METHODS = ("RK45", "Radau", "LSODA")
TOLERANCES = (1e-3, 1e-4, 1e-5, 1e-6, 1e-7, 1e-8)
"""Relative tolerances of solve_ivp, from cheap to expensive."""

SECONDS = 8.0
"""Time limit of a run of solve_ivp, s. A run that exceeds it is stopped, and smaller tolerances of
its method are omitted."""


class _TimeExceeded(Exception):
    """A run exceeds `SECONDS`."""


def solve_ivp_points(
    problem: Problem, reference: Reference, *, seconds: float = SECONDS
) -> tuple[list[Point], list[str]]:
    """Return the points of solve_ivp: one line per method, one point (run of at most `seconds`) per
    relative tolerance.

    Only linear and bilinear stories are supported. The hysteretic force z of a bilinear story is a
    state variable. Its rate is (1 - a) k times the drift rate (stiffness k, stiffness ratio after
    yield a), and zero during yielding; the events of solve_ivp are not used. The absolute tolerance
    is the relative tolerance times the maximum value of the reference. The motion is computed at
    the samples, and its peaks are the maxima over the samples.
    """
    if problem.model.excitation.tables:
        return [], ["scipy's solve_ivp is omitted: forces on floors are from tables"]
    law = _bilinear_parts(problem)
    if law is None:
        return [], [
            "scipy's solve_ivp is omitted: a story's law is neither linear nor bilinear with equal "
            "strengths in both directions"
        ]
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


def _bilinear_parts(problem: Problem) -> tuple[Array, Array, Array] | None:
    """Return stiffness (N/m) of an elastic spring, and stiffness and strength (N) of a parallel
    elastic-perfectly plastic spring, of each story.

    The elastic spring has the stiffness after yield, and includes P-delta. For a linear story, the
    second spring has the stiffness 0 and the strength inf. None is the result if a story is not
    linear and not bilinear with equal strengths.
    """
    law_parameters = problem.building.story_laws
    is_bilinear = law_parameters[rows.CODE] == CODES["bilinear"]
    if not np.all(is_bilinear | (law_parameters[rows.CODE] == CODES["linear"])):
        return None
    if _has_two_strengths(problem.building):
        return None
    yield_force, ratio_after_yield = (
        law_parameters[rows.FIRST_PARAMETER : rows.FIRST_PARAMETER + 2]
        if is_bilinear.any()
        else (0.0, 1.0)
    )
    elastic_fraction = np.where(is_bilinear, ratio_after_yield, 1.0)
    stiffness, hysteretic_fraction = law_parameters[rows.STIFFNESS], 1.0 - elastic_fraction
    strength = np.where(is_bilinear, hysteretic_fraction * yield_force, math.inf)
    return (
        elastic_fraction * stiffness + problem.building.linear_terms[rows.GEOMETRIC, :-1],
        hysteretic_fraction * stiffness,
        strength,
    )


def _rate_function(problem: Problem, law: tuple[Array, Array, Array], deadline: float) -> Rate:
    """Return the right-hand side of the equations of motion as a function rate(t, state).

    The state (u, v, z) contains the displacements and velocities of the floors relative to the
    ground, and the hysteretic forces of the stories, without z if no story is bilinear. The
    function raises `_TimeExceeded` after the reading `deadline` of `tdint.system.seconds`.
    """
    building = problem.building
    floor_count = building.stories
    elastic, hysteretic, strength = law
    has_hysteresis = bool(hysteretic.any())
    damping = building.damping_matrix()
    times = problem.interval * np.arange(problem.ground.size + 1)
    ground = np.append(problem.ground, 0.0)
    floors = problem.forces[:, rows.FLOOR].astype(int)
    cosine, sine, omega = (problem.forces[:, i] for i in (rows.COSINE, rows.SINE, rows.OMEGA))

    def rate(t: float, state: Array) -> Array:
        """Return the time derivative of the state at time t (s)."""
        if system.seconds() > deadline:
            raise _TimeExceeded
        u, v = state[:floor_count], state[floor_count : 2 * floor_count]
        shear = elastic * np.diff(u, prepend=0.0)
        hysteretic_rate = state[2 * floor_count :]  # empty without bilinear stories
        if has_hysteresis:
            z = state[2 * floor_count :]
            shear += np.clip(z, -strength, strength)
            hysteretic_rate = hysteretic * np.diff(v, prepend=0.0)
            hysteretic_rate = np.where(
                (np.abs(z) >= strength) & (z * hysteretic_rate > 0.0), 0.0, hysteretic_rate
            )
        # A floor is pulled back by the story below and forward by the story above.
        force = -damping @ v - shear
        force[:-1] += shear[1:]
        np.add.at(force, floors, cosine * np.cos(omega * t) + sine * np.sin(omega * t))
        return np.concatenate(
            [v, force / building.mass - np.interp(t, times, ground), hysteretic_rate]
        )

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

    `law` is the elastic stiffness, hysteretic stiffness and hysteretic strength of each story.
    `seconds` is the time limit, s.
    """
    from scipy.integrate import solve_ivp

    floor_count = problem.building.stories
    _, hysteretic, strength = law
    drift = np.diff(problem.displacement, prepend=0.0)
    hysteretic_forces = (
        [np.clip(hysteretic * drift, -strength, strength)] if hysteretic.any() else []
    )
    initial_state = np.concatenate([problem.displacement, problem.velocity, *hysteretic_forces])
    reference_motion = reference.motion
    state_scales = [
        np.full(floor_count, np.max(np.abs(reference_motion.displacement))),
        np.full(floor_count, np.max(np.abs(reference_motion.velocity))),
    ]
    if hysteretic_forces:
        state_scales.append(np.where(np.isfinite(strength), strength, 1.0))
    times = problem.interval * np.arange(problem.samples + 1)
    start_time = system.seconds()
    limited_rate = _rate_function(problem, law, start_time + seconds)
    try:
        tolerances = {"rtol": tolerance, "atol": tolerance * np.concatenate(state_scales)}
        solution = solve_ivp(
            limited_rate, (0.0, times[-1]), initial_state, method=method, t_eval=times, **tolerances
        )
    except _TimeExceeded:
        return None
    elapsed = system.seconds() - start_time
    name, line = f"scipy/{method}:rtol={tolerance:g}", f"scipy/{method}"
    if not solution.success:
        return Point(name, math.nan, None, NOT_CONVERGED, line=line)
    u, v = solution.y[:floor_count].T, solution.y[floor_count : 2 * floor_count].T
    # The accelerations relative to the ground are the second part of the rate of the state.
    unlimited_rate = _rate_function(problem, law, math.inf)
    a = np.array(
        [
            unlimited_rate(t, state)[floor_count : 2 * floor_count]
            for t, state in zip(times, solution.y.T, strict=True)
        ]
    )
    # The duration may end before or after the end of the record.
    recorded_times = min(times.size, problem.ground.size)
    ground = np.interp(times, times[:recorded_times], problem.ground[:recorded_times], right=0.0)
    peaks = np.max(np.abs(np.diff(u, axis=1, prepend=0.0)), axis=0)
    motion = FloorMotion(1, u, v, a + ground[:, None], peaks)
    return Point(
        name,
        math.nan,
        None,
        DONE,
        int(solution.nfev),
        errors(motion, reference_motion),
        (elapsed,),
        line=line,
    )


def with_plugins(
    problem: Problem, chart: Chart, *, repeats: int, progress: Progress = silent
) -> tuple[Chart, list[str]]:
    """Return the chart with an additional point for each peer of the plug-ins, and notes on omitted
    points.

    A peer is a function of the problem that returns times and displacements. The times (s) are
    equally spaced and start at 0. They end at or after the last sample, and their spacing is the
    interval divided or multiplied by a whole number. The displacements (m) of the floors at these
    times are relative to the ground, with shape (times, stories). The complete call is timed.
    Errors of velocities and accelerations are not available.
    """
    points: list[Point] = []
    notes: list[str] = []
    functions = peers()
    for completed, (plugin, name, function) in enumerate(functions):
        progress(plugin, completed / len(functions))
        # The part of a name before a colon is the line of the chart: `leapfrog` contains the point
        # `leapfrog:parts=4`.
        point_name, line = f"{plugin}/{name}", f"{plugin}/{name.partition(':')[0]}"
        try:
            point = _plugin_point(problem, chart.reference, function, repeats)
            points.append(replace(point, method=point_name, line=line))
        except Exception as error:  # a function of a plug-in can raise any exception
            notes.append(
                f"{point_name} is omitted: {type(error).__name__}: {' '.join(str(error).split())}"
            )
    plugin_peers = (
        Peer(plugin, "of a plug-in", "settings of its function", "its complete call")
        for plugin in dict.fromkeys(point.line.partition("/")[0] for point in points)
    )
    return replace(
        chart, points=(*chart.points, *points), peers=(*chart.peers, *plugin_peers)
    ), notes


def _plugin_point(
    problem: Problem, reference: Reference, function: Callable[[Any], Any], repeats: int
) -> Point:
    """Time a function of a plug-in and return its point; the caller adds the name of the point.
    ValueError is raised if the arrays have wrong shapes, the times are not equally spaced from 0,
    or they end before the last sample.
    """
    call_times = []
    for _ in range(repeats):
        start_time = system.seconds()
        result = function(problem)
        call_times.append(system.seconds() - start_time)
    times, u = (np.asarray(values, dtype=np.float64) for values in result)
    floor_count = problem.building.stories
    if times.ndim != 1 or times.size < 2 or u.shape != (times.size, floor_count):
        raise ValueError(
            "the program of the plug-in must return times and displacements of the shapes (rows,) "
            f"and (rows, {floor_count}), got {times.shape} and {u.shape}"
        )
    if not np.all(np.isfinite(u)):
        return Point("", math.nan, times.size - 1, DIVERGED, times=tuple(call_times))
    dt = float(times[1])  # the times start at 0
    steps = problem.steps(dt)
    # Times computed by repeated addition deviate by rounding errors.
    if np.max(np.abs(times - dt * np.arange(times.size))) > 1e-6 * dt:
        raise ValueError(
            "the times that the program of the plug-in returns must start at 0 and be equally "
            "spaced"
        )
    # Keep every `per_sample`-th time, so that all rows are at samples of the record.
    motion_rows = steps.count // steps.per_sample + 1
    if times.size <= steps.count:
        raise ValueError(
            "the times that the program of the plug-in returns must include the end of the "
            f"analysis, but end at {times[-1]:.6g} s"
        )
    peaks = np.max(np.abs(np.diff(u[: steps.count + 1], axis=1, prepend=0.0)), axis=0)
    u = u[:: steps.per_sample][:motion_rows]
    unknown = np.full_like(u, math.nan)
    motion = FloorMotion(steps.stride, u, unknown, unknown, peaks)
    return Point(
        "", dt, steps.count, DONE, errors=errors(motion, reference.motion), times=tuple(call_times)
    )


def with_peers(
    problem: Problem,
    chart: Chart,
    dts: Sequence[float],
    *,
    repeats: int,
    progress: Progress = silent,
) -> tuple[Chart, list[str]]:
    """Add points of OpenSeesPy and SciPy to a chart.

    The errors of these points refer to the same reference, and their times include only the
    analysis loops of the programs.

    Parameters
    ----------
    dts : sequence of float
        Time steps of OpenSeesPy, s.
    repeats : int
        Number of times that each run is timed.
    """
    progress("openseespy", 0.0)
    opensees_points, notes = openseespy_points(
        problem, sorted(set(dts), reverse=True), chart.reference, repeats=repeats
    )
    progress("scipy", 0.5)
    scipy_points, scipy_notes = solve_ivp_points(problem, chart.reference)
    chart = replace(
        chart,
        points=(*chart.points, *opensees_points, *scipy_points),
        peers=peers_of([*opensees_points, *scipy_points]),
    )
    return chart, [*notes, *scipy_notes]


def peers_of(points: Iterable[Point]) -> tuple[Peer, ...]:
    """Return a description of each other program (OpenSeesPy, SciPy) that has points."""
    programs = {point.line.partition("/")[0] for point in points}
    used_peers = []
    for name, settings, timed_call in (
        ("openseespy", _OPENSEES_SETTINGS, "analyze"),
        ("scipy", _SCIPY_SETTINGS, "solve_ivp"),
    ):
        if name in programs:
            try:
                version_text = version(name)
            except PackageNotFoundError:
                version_text = "of unknown version"
            used_peers.append(Peer(name, version_text, settings, timed_call))
    return tuple(used_peers)
