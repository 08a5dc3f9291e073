"""Measure adaptive solvers of SciPy for three standard problems.

    python tests/benchmarks/adaptive.py

DOP853 and LSODA (scipy.integrate.solve_ivp) with relative tolerances from 1e-3 to 1e-9. Branch
changes (yielding, reversals of a drift, for Bouc-Wen also zeros of the hysteretic part) are located
as events. The solver is restarted at each event, so that it integrates smooth equations. The
right-hand side is compiled with numba. Peaks are taken from the dense output at 32 times per sample
with a parabola through the maximum values. Errors are relative to impulse4 with 32 time steps per
sample, times are processor times of all calls of solve_ivp. Results are written to adaptive.csv.
"""

from __future__ import annotations

import csv
import math
import sys
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
from numba import njit
from scipy.integrate import solve_ivp

from tdint.assessment.chart.performance_profiles import STANDARD, FieldProblem, read_problems
from tdint.assessment.chart.problem import largest_relative
from tdint.kernels import layout as rows
from tdint.methods.catalogue import parse
from tdint.model.story_laws import CODES

FILE = Path(__file__).with_name("adaptive.csv")
PROBLEMS = (("linear", "near-fault"), ("bilinear", "near-fault"), ("bouc-wen", "near-fault"))
METHODS = ("DOP853", "LSODA")
TOLERANCES = (1e-3, 1e-5, 1e-7, 1e-9)
SECONDS = 60.0
"""Time limit of a run, s."""
AT_REST = 1e-6
"""Hysteretic part of a Bouc-Wen story at rest, over its strength, up to which branch changes are
not located. A uniform ground acceleration moves only the first story at first: the drift rates of
the other stories are exactly zero, and an event would be located at time zero after each restart.
The branch changes the rate of the hysteretic part by the square of this ratio."""
EVENT_DISTANCE = 1e-12
"""Distance from its bound at which a branch change is located, after the bound: divided by the
strength, or in m/s. With
a distance of exactly zero at a restart, solve_ivp would locate the same event again at the start of
a step in which the story returns."""
FINE = 32
"""Time steps of the reference, and evaluations of the dense output, per sampling interval."""
HEADS = (
    *("problem", "motion", "method", "rtol", "evaluations", "events", "time_s"),
    *("peak_drift_error", "peak_absolute_acceleration_error", "peak_total_shear_error"),
    *("impulse4_time_s", "impulse4_dt_s", "status"),
)


class TooLongError(Exception):
    """A run that exceeds its time limit."""


@njit(error_model="numpy")
def rate(t, y, mode, kind, linear, soft, parameters, mass, damping, ground, interval):
    """Return the rate of displacements, velocities and hysteretic parts.

    Parameters
    ----------
    t, y : float, ndarray
        Time, s, and state.
    mode : ndarray, shape (2, stories)
        Branch of a bilinear story (0 elastic, -1 or 1 yielding), or the signs of the drift rate and
        of the hysteretic part of a Bouc-Wen story (both 0: at rest, see `AT_REST`).
    kind : int
        0 linear, 1 bilinear, 2 Bouc-Wen.
    linear, soft : ndarray
        Stiffness of the elastic part, and initial stiffness of the hysteretic part, N/m.
    parameters : ndarray, shape (3, stories)
        Strength of the hysteretic part, N, exponent and beta of Bouc-Wen.
    mass, damping, ground, interval : ndarray and float
        Masses, damping matrix, ground acceleration at the samples, sampling interval.
    """
    n = mass.size
    at = min(int(t / interval), ground.size - 2)
    part = t / interval - at
    shaking = (1.0 - part) * ground[at] + part * ground[at + 1]
    change = np.zeros_like(y)
    force = -damping @ y[n : 2 * n]
    below = below_rate = 0.0
    for i in range(n):
        d, v = y[i] - below, y[n + i] - below_rate
        shear = linear[i] * d
        if kind > 0:
            z = y[2 * n + i]
            shear += z
            slope = soft[i]
            if kind == 1 and mode[0, i] != 0.0:
                slope = 0.0
            elif kind == 2:
                w = abs(z) / parameters[0, i]
                beta = parameters[2, i]
                side = mode[0, i] * mode[1, i] if mode[1, i] != 0.0 else np.sign(v * z)
                slope *= 1.0 - w ** parameters[1, i] * (beta * side + 1.0 - beta)
            change[2 * n + i] = slope * v
        force[i] -= shear
        if i > 0:
            force[i - 1] += shear
        below, below_rate = y[i], y[n + i]
    for i in range(n):
        change[i] = y[n + i]
        change[n + i] = force[i] / mass[i] - shaking
    return change


@njit(error_model="numpy")
def distances(y, mode, kind, strength):
    """Return quantities that are positive until a story changes its branch, shape (2 stories,).

    The first quantity of each story concerns yielding or the drift rate; the second (Bouc-Wen)
    the sign of the hysteretic part. See `rate` for the parameters; `strength` is in N.
    """
    n = strength.size
    out = np.ones(2 * n)  # without `EVENT_DISTANCE`, which is added below
    below = 0.0
    for i in range(n):
        v = y[n + i] - below
        below = y[n + i]
        z = y[2 * n + i] / strength[i]
        if kind == 1:
            out[i] = 1.0 - abs(z) if mode[0, i] == 0.0 else mode[0, i] * v
        elif mode[1, i] == 0.0:
            out[i] = AT_REST - abs(z)
        else:
            out[i] = mode[0, i] * v
            out[n + i] = mode[1, i] * z
    return out + EVENT_DISTANCE


class Building:
    """Arrays of a standard problem for `rate`."""

    def __init__(self, problem: FieldProblem) -> None:
        posed = problem.posed
        building, laws = posed.building, posed.building.law_parameters
        n = building.stories
        code = int(laws[rows.CODE, 0])
        self.kind = {CODES["linear"]: 0, CODES["bilinear"]: 1, CODES["bouc-wen"]: 2}[code]
        first = rows.FIRST_PARAMETER
        hardening = laws[first + 1, :n] if self.kind else np.ones(n)
        stiffness = laws[rows.STIFFNESS, :n]
        self.linear = hardening * stiffness + building.linear_terms[rows.GEOMETRIC, :n]
        self.soft = (1.0 - hardening) * stiffness
        strength = (1.0 - hardening) * laws[first, :n] if self.kind else np.ones(n)
        shape = laws[first + 2 : first + 4, :n] if self.kind == 2 else np.zeros((2, n))
        self.parameters = np.array([strength, *shape])
        self.mass = building.mass.copy()
        self.damping = np.ascontiguousarray(building.damping_matrix())
        self.ground = np.append(posed.ground, 0.0)
        self.interval = posed.interval
        self.end = posed.samples * posed.interval
        self.stories = n

    def rate(self, mode: np.ndarray) -> Callable[[float, np.ndarray], np.ndarray]:
        """Return the right-hand side, a function of time and state, for the branches `mode`."""
        arguments = (self.kind, self.linear, self.soft, self.parameters, self.mass, self.damping)
        return lambda t, y: rate(t, y, mode, *arguments, self.ground, self.interval)

    def modes(self, y: np.ndarray, earlier: np.ndarray, changed: list[int]) -> np.ndarray:
        """Return the branches after events at a state.

        Parameters
        ----------
        y : ndarray
            State.
        earlier : ndarray, shape (2, stories)
            Branches before the events; see `rate`.
        changed : list of int
            Indices of the events in the result of `distances`.
        """
        n, mode = self.stories, earlier.copy()
        for number in changed:
            # The second half of the events concerns the sign of the hysteretic part.
            story, row = number % n, number // n
            if self.kind == 1:
                mode[0, story] = np.sign(y[2 * n + story]) if mode[0, story] == 0.0 else 0.0
                continue
            drift_rate = y[n + story] - (y[n + story - 1] if story > 0 else 0.0)
            if mode[1, story] == 0.0:
                mode[:, story] = np.sign([drift_rate, y[2 * n + story]])
            else:
                mode[row, story] *= -1.0
        return mode


def solve(building: Building, method: str, rtol: float) -> tuple[dict[str, np.ndarray], int, int]:
    """Return peaks by name, evaluations and events of a run.

    Parameters
    ----------
    building : Building
        Building and its excitation.
    method : str
        Method of solve_ivp.
    rtol : float
        Relative tolerance. The absolute tolerances are this fraction of 1 cm, of 0.1 m/s and of the
        strength.
    """
    n, start = building.stories, time.thread_time()
    size = (2 if building.kind == 0 else 3) * n
    scale = np.concatenate([np.full(n, 0.01), np.full(n, 0.1), building.parameters[0]])[:size]
    y, t = np.zeros(size), 0.0
    mode = np.zeros((2, n))  # elastic, or at rest
    peaks = {name: np.zeros(n) for name in HEADS[7:10]}
    evaluations = events = 0
    while t < building.end * (1.0 - 1e-12):
        # One event for each bilinear story, two for each Bouc-Wen story.
        events_to_locate = [_branch(building, mode, i, start) for i in range(building.kind * n)]
        # A linear building has no branch changes; its only event enforces the time limit.
        events_to_locate = events_to_locate or [_deadline(start)]
        solution = solve_ivp(
            building.rate(mode),
            (t, building.end),
            y,
            method=method,
            rtol=rtol,
            atol=rtol * scale,
            events=events_to_locate,
            dense_output=True,
        )
        evaluations += solution.nfev
        update(peaks, building, mode, solution.sol, t, float(solution.t[-1]))
        t, y = float(solution.t[-1]), solution.y[:, -1].copy()
        if solution.status != 1:  # the end of the motion, not an event
            break
        changed = [i for i, times in enumerate(solution.t_events) if times.size]
        events += len(changed)
        y = with_exact_strength(building, mode, y, changed)
        mode = building.modes(y, mode, changed)
    return peaks, evaluations, events


def _branch(
    building: Building, mode: np.ndarray, number: int, begin: float
) -> Callable[[float, np.ndarray], float]:
    """Return the event of a branch change.

    Parameters
    ----------
    building, mode : Building, ndarray
        Building, and branches of its stories.
    number : int
        Number of the quantity of `distances`.
    begin : float
        Start of the run by `time.thread_time`, s.
    """

    def event(t: float, y: np.ndarray) -> float:
        if time.thread_time() - begin > SECONDS:
            raise TooLongError
        return float(distances(y, mode, building.kind, building.parameters[0])[number])

    event.terminal, event.direction = True, -1  # type: ignore[attr-defined]
    return event


def _deadline(begin: float) -> Callable[[float, np.ndarray], float]:
    """Return an event that never occurs, but raises TooLongError after the time limit.

    `begin` is the start of the run by `time.thread_time`, s.
    """

    def event(t: float, y: np.ndarray) -> float:
        if time.thread_time() - begin > SECONDS:
            raise TooLongError
        return 1.0

    return event


def with_exact_strength(
    building: Building, mode: np.ndarray, y: np.ndarray, changed: list[int]
) -> np.ndarray:
    """Return the state after stories that start to yield are set exactly to their strength.

    The hysteretic part keeps this value until the drift rate reverses.

    Parameters
    ----------
    building, mode : Building, ndarray
        Building, and branches of its stories before the events.
    y : ndarray
        State.
    changed : list of int
        Indices of the events.
    """
    n, y = building.stories, y.copy()
    if building.kind == 1:
        for story in changed:
            if mode[0, story] == 0.0:
                y[2 * n + story] = math.copysign(building.parameters[0, story], y[2 * n + story])
    return y


def update(
    peaks: dict[str, np.ndarray],
    building: Building,
    mode: np.ndarray,
    solution: Callable[[np.ndarray], np.ndarray],
    begin: float,
    end: float,
) -> None:
    """Update the peaks with a part of the motion from its dense output.

    Parameters
    ----------
    peaks : dict
        Peaks by name, changed in place.
    building, mode : Building, ndarray
        Building, and branches of its stories in this part.
    solution : callable
        Dense output.
    begin, end : float
        Times of the part, s.
    """
    count = max(4, int((end - begin) / building.interval * FINE) + 2)
    times = np.linspace(begin, end, count)
    states = solution(times)
    n = building.stories
    function = building.rate(mode)
    ground = np.interp(times, building.interval * np.arange(building.ground.size), building.ground)
    rates = np.array(
        [function(t, y) for t, y in zip(times, np.ascontiguousarray(states.T), strict=True)]
    )
    absolute = rates[:, n : 2 * n] + ground[:, None]
    shear = np.cumsum((building.mass * absolute)[:, ::-1], axis=1)[:, ::-1]
    drift = np.diff(states[:n].T, axis=1, prepend=0.0)
    for name, values in zip(peaks, (drift, absolute, shear), strict=True):
        peaks[name] = np.maximum(peaks[name], max_absolute(values))


def max_absolute(values: np.ndarray) -> np.ndarray:
    """Return the maximum absolute value of each column, with a parabola through three values."""
    size = np.abs(values)
    at = np.clip(np.argmax(size, axis=0), 1, len(size) - 2)
    columns = np.arange(size.shape[1])
    before, middle, after = (values[at + k, columns] for k in (-1, 0, 1))
    slope, bend = 0.5 * (after - before), before - 2.0 * middle + after
    # The vertex is used only if it is between the neighbors of the middle value.
    with np.errstate(all="ignore"):
        vertex = np.where(
            (bend != 0.0) & (np.abs(slope) < np.abs(bend)), middle - slope**2 / (2.0 * bend), middle
        )
    return np.asarray(np.maximum(np.max(size, axis=0), np.abs(vertex)))


def reference_times(problem: FieldProblem) -> tuple[object, list[tuple[float, float, list[float]]]]:
    """Return the true peaks, and step, time and errors of impulse4 from long to short steps."""
    posed, method = problem.posed, parse("impulse4")
    posed.prepared.compile([method])
    case = posed.case(method)
    true = case.integrate(posed.steps(posed.interval / FINE)).stories
    lines = []
    for part in (4.0, 2.0, 1.0, 1 / 2, 1 / 3, 1 / 4, 1 / 6, 1 / 8, 1 / 12):
        runs = [case.integrate(posed.steps(posed.interval * part)) for _ in range(3)]
        errors = [
            largest_relative(getattr(runs[0].stories, name), getattr(true, name)) for name in NAMES
        ]
        lines.append((runs[0].dt, min(run.solver_time for run in runs), errors))
    return true, lines


NAMES = tuple(name.removesuffix("_error") for name in HEADS[7:10])
"""Names of the three peaks, whose errors are columns 7 to 9."""


def run(problem: FieldProblem) -> list[list[str]]:
    """Return the rows of adaptive.csv for a problem (columns `HEADS`).

    The columns of impulse4 refer to its longest time step with an error of the drifts that is not
    larger than the error of the solver.
    """
    true, lines = reference_times(problem)
    building = Building(problem)
    solve(building, METHODS[0], 1e-2)  # compiles
    table = []
    for method in METHODS:
        for rtol in TOLERANCES:
            head = [problem.name, problem.motion, f"scipy/{method}", f"{rtol:g}"]
            start = time.thread_time()
            try:
                peaks, evaluations, events = solve(building, method, rtol)
            except TooLongError:
                table.append([*head, "", "", "", "", "", "", "", "", "not-run"])
                print(*head, f"more than {SECONDS:g} s", flush=True)
                break
            seconds = time.thread_time() - start
            errors = [
                largest_relative(peaks[f"{name}_error"], getattr(true, name)) for name in NAMES
            ]
            # Errors below 1e-9 may be errors of the reference.
            dt, impulse4_seconds, _ = next(
                (line for line in lines if line[2][0] <= max(errors[0], 1e-9)), lines[-1]
            )
            numbers = [f"{x:.4g}" for x in (seconds, *errors, impulse4_seconds, dt)]
            table.append([*head, str(evaluations), str(events), *numbers, "done"])
            print(*table[-1], flush=True)
    return table


def main() -> None:
    """Run all problems and write the file."""
    selected = [
        problem for problem in read_problems(STANDARD) if (problem.name, problem.motion) in PROBLEMS
    ]
    with FILE.open("w", encoding="utf-8", newline="") as stream:
        writer = csv.writer(stream, lineterminator="\n")
        writer.writerow(HEADS)
        for problem in selected:
            writer.writerows(run(problem))


if __name__ == "__main__":
    sys.exit(main())
