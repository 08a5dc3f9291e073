"""Other programs in the same chart: OpenSeesPy, where it is installed, and SciPy's RK45, Radau and LSODA (solve_ivp),
which choose their own steps.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from tdint.analysis.chart.opensees import openseespy_points
from tdint.analysis.chart.problem import FloorMotion, Problem
from tdint.analysis.chart.reference import Reference, errors
from tdint.analysis.chart.work_precision import DONE, Chart, Point, Progress, silent
from tdint.arrays import Array
from tdint.kernels import layout as at
from tdint.model.laws import CODES

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
    """Points of solve_ivp, and what is left out: a line per method, a point per relative tolerance, one run each.

    Linear and bilinear stories. The hysteretic part z of a bilinear story is a state whose rate is (1 - a) k times the
    drift's, and zero while it yields: no events. The absolute tolerance is the relative one times the largest value of
    the reference. The motion is asked for at the samples; its peaks are those at the samples.
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
                notes.append(f"scipy's {method} is left out from rtol {tolerance:g} on: it takes over {seconds:g} s")
                break
            points.append(point)
    return points, notes


def _stories(problem: Problem) -> tuple[Array, Array, Array] | None:
    """Elastic stiffness, stiffness of the hysteretic part and its strength of each story; None for other laws.

    The first is that of the whole story where it is linear, after yield where it is bilinear.
    """
    laws = problem.building.law_parameters
    bilinear = laws[at.CODE, :-1] == CODES["bilinear"]
    if not np.all(bilinear | (laws[at.CODE, :-1] == CODES["linear"])):
        return None
    yields = np.where(bilinear, laws[at.FIRST_PARAMETER, :-1] if bilinear.any() else 0.0, math.inf)
    hardening = np.where(bilinear, laws[at.FIRST_PARAMETER + 1, :-1] if bilinear.any() else 1.0, 1.0)
    stiffness = laws[at.STIFFNESS, :-1]
    soft = 1.0 - hardening
    strength = np.where(bilinear, soft * np.where(bilinear, yields, 0.0), math.inf)
    return hardening * stiffness + problem.building.linear_terms[at.GEOMETRIC, :-1], soft * stiffness, strength


def _rate(problem: Problem, law: tuple[Array, Array, Array], deadline: float) -> Rate:
    """The rate of the state (u, v, z)."""
    building = problem.building
    n = building.stories
    elastic, hysteretic, strength = law
    hysteresis = bool(hysteretic.any())
    damping = building.damping_matrix()
    times = problem.interval * np.arange(problem.ground.size + 1)
    ground = np.append(problem.ground, 0.0)
    floors = problem.forces[:, at.FLOOR].astype(int)
    cosine, sine, omega = problem.forces[:, at.COSINE], problem.forces[:, at.SINE], problem.forces[:, at.OMEGA]

    def rate(t: float, state: Array) -> Array:
        if time.perf_counter() > deadline:
            raise _TooLong
        u, v = state[:n], state[n : 2 * n]
        shear = elastic * np.diff(u, prepend=0.0)
        change = state[2 * n :]
        if hysteresis:
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
    sizes = [np.full(n, np.max(np.abs(true.displacement))), np.full(n, np.max(np.abs(true.velocity)))]
    if inner:
        sizes.append(np.where(np.isfinite(strength), strength, 1.0))
    times = problem.interval * np.arange(problem.samples + 1)
    begin = time.perf_counter()
    rate = _rate(problem, law, begin + seconds)
    try:
        near = {"rtol": tolerance, "atol": tolerance * np.concatenate(sizes)}
        found = solve_ivp(rate, (0.0, times[-1]), start, method=method, t_eval=times, **near)
    except _TooLong:
        return None
    taken = time.perf_counter() - begin
    name, line = f"scipy/{method}:rtol={tolerance:g}", f"scipy/{method}"
    if not found.success:
        return Point(name, math.nan, None, "not-converged", line=line)
    u, v = found.y[:n].T, found.y[n : 2 * n].T
    quiet = _rate(problem, law, math.inf)
    a = np.array([quiet(t, state)[n : 2 * n] for t, state in zip(times, found.y.T, strict=True)])
    size = min(times.size, problem.ground.size)  # A duration may end before the record does, or after.
    ground = np.interp(times, times[:size], problem.ground[:size], right=0.0)
    peaks = np.max(np.abs(np.diff(u, axis=1, prepend=0.0)), axis=0)
    motion = FloorMotion(1, u, v, a + ground[:, None], peaks)
    return Point(name, math.nan, None, DONE, int(found.nfev), errors(motion, true), (taken,), line=line)


def with_peers(
    problem: Problem, chart: Chart, dts: Sequence[float], *, repeats: int, progress: Progress = silent
) -> tuple[Chart, list[str]]:
    """The chart with the points of other programs behind its own, and what of them is left out, a sentence each.

    Their errors are against the same reference; their times are those of their analysis loops alone.
    """
    progress("openseespy", 0.0)
    own, notes = openseespy_points(problem, sorted(set(dts), reverse=True), chart.reference, repeats=repeats)
    progress("scipy", 0.5)
    others, more = solve_ivp_points(problem, chart.reference)
    return replace(chart, points=(*chart.points, *own, *others)), [*notes, *more]
