"""Which methods fail on which problems, how and by how much: the work behind `tdint failures`."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from tdint.analysis.assessment.hard_problems import HardProblem, problems
from tdint.analysis.run.outcome import FailedRun, History
from tdint.analysis.run.run import run
from tdint.errors import UsageError, did_you_mean
from tdint.methods.catalogue import catalogue, chosen, parse
from tdint.methods.method import Integrator
from tdint.model.building import assemble
from tdint.tabular import Several

PASS = "pass"
BLOWS_UP = "blows up"
NO_CONVERGENCE = "does not converge"
REFUSED = "refused"

_DISSIPATIVE = ("rho_inf=0.5", "rho_inf=0")
_MORE = {"impulse4": _DISSIPATIVE, "moment4": _DISSIPATIVE, "wilson": ("theta=1.3",)}
"""Members that show what their method's default does not: dissipation, and theta below its limit."""

_ENDS = {"diverged": BLOWS_UP, "not-converged": NO_CONVERGENCE}


@dataclass(frozen=True)
class Trial:
    """One method on one problem with one step.

    Attributes
    ----------
    energy_ratio_min, energy_ratio_max : float
        Least and largest energy over the largest of the exact motion; nan for a run without an end, and the least where
        the motion starts from rest.
    error, error_of : float, str
        The problem's error and what it is; nan for a run without an end.
    outcome : str
        The status of `tdint run`; the rest is what it gives with --allow-unstable. `refused` for a method that is not
        for this building.
    verdict : str
        `pass`, the fault found, or how the run failed.
    time, steps : float, int
        Last time reached (s), and whole steps done.
    measure : float
        What the verdict rests on: the energy ratio that is farthest from 1 where the problem judges energy, else the
        error; nan for a run without an end.
    """

    problem: str
    method: str
    dt: float
    outcome: str
    verdict: str
    error_of: str
    energy_ratio_min: float = math.nan
    energy_ratio_max: float = math.nan
    error: float = math.nan
    time: float = 0.0
    steps: int = 0
    measure: float = math.nan


def usual_methods() -> list[Integrator]:
    """All methods at their defaults (`newmark` is `newmark-average`), and a few more members."""
    result: list[Integrator] = []
    for name in catalogue():
        if name != "newmark":
            result.append(parse(name))
        result += [parse(f"{name}:{values}") for values in _MORE.get(name, ())]
    return result


def find_problems(names: Sequence[str]) -> list[HardProblem]:
    """Problems by name, each once; all if none is named.

    Raises
    ------
    UsageError
        An unknown name.
    """
    known = problems()
    for name in names:
        if name not in known:
            raise UsageError(f"unknown problem {name!r}{did_you_mean(name, known)} (known: {', '.join(known)})")
    return [known[name] for name in dict.fromkeys(names or known)]


def failures(methods: str | Iterable[str] | None = None, problems: Sequence[str] = ()) -> Several[Trial]:
    """Put methods to hard problems with known answers.

    Parameters
    ----------
    methods : str or iterable of str, optional
        Specifications; by default `usual_methods`.
    problems : sequence of str
        Names of problems; all if none is given.

    Returns
    -------
    Several of Trial
        One for each problem, method and step.

    Raises
    ------
    UsageError
        An unknown method or problem.
    """
    integrators = usual_methods() if methods is None else chosen(methods)
    hard = find_problems(problems)
    return Several([trial for one in hard for each in integrators for trial in attempt(each, one)])


def attempt(integrator: Integrator, problem: HardProblem) -> list[Trial]:
    """Integrate a problem with each of its steps, and judge."""
    return [_attempt(integrator, problem, dt, steps) for dt, steps in problem.steps]


def _attempt(integrator: Integrator, problem: HardProblem, dt: float, steps: int) -> Trial:
    without = Trial(problem.name, integrator.label, dt, REFUSED, REFUSED, problem.error_of)
    if integrator.family.linear_only and not assemble(problem.model).linear:
        return without
    ended = _run(integrator, problem, dt, steps, allow_unstable=False)
    outcome = "done"
    if isinstance(ended, FailedRun):
        outcome = ended.status
        ended = _run(integrator, problem, dt, steps, allow_unstable=True)
    if isinstance(ended, FailedRun):
        done = round(ended.time / dt)
        return replace(without, outcome=outcome, verdict=_ENDS[ended.status], time=ended.time, steps=done)
    return _judged(replace(without, outcome=outcome), problem, ended)


def _run(
    integrator: Integrator, problem: HardProblem, dt: float, steps: int, allow_unstable: bool
) -> History | FailedRun:
    try:
        response = run(
            problem.model,
            method=integrator.label,
            dt=dt,
            duration=dt * steps,
            history=True,
            allow_unstable=allow_unstable,
        )
    except FailedRun as failure:
        return failure
    assert response.history is not None
    return response.history


def _judged(trial: Trial, problem: HardProblem, history: History) -> Trial:
    ratio = problem.energy(history) / problem.energy_scale
    least, largest = float(np.min(ratio)), float(np.max(ratio))
    error = problem.error(history)
    farthest = least if least * largest < 1.0 else largest
    measure = farthest if problem.by_energy else error
    return replace(
        trial,
        energy_ratio_min=least if ratio[0] > 0.0 else math.nan,
        energy_ratio_max=largest,
        error=error,
        verdict=next((fault.name for fault in problem.faults if fault.found(measure)), PASS),
        time=float(history.time[-1]),
        steps=len(history.time) - 1,
        measure=measure,
    )
