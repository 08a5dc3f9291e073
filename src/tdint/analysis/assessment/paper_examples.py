"""Examples 1 to 3 of the paper of 2022: its methods, their errors, and the same methods fed or
started otherwise."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache

import numpy as np

from tdint.analysis.given import numbers_of
from tdint.analysis.run.outcome import DIVERGED, FailedRun
from tdint.analysis.run.prepared import PreparedBuilding
from tdint.analysis.run.run import run
from tdint.analysis.run.workspace import Steps
from tdint.arrays import Array
from tdint.errors import AnalysisError, UsageError
from tdint.methods.catalogue import chosen, parse
from tdint.methods.method import Integrator
from tdint.model.building import assemble, force_table
from tdint.model.definition import Force, Law, Model, simple_model, simple_story
from tdint.tabular import ResultList

METHODS = (
    "impulse",
    "newmark-average",
    "newmark-linear",
    "central-difference",
    "wilson",
    "u0v0",
    "rk5",
)
"""The paper's seven methods; `impulse` is the one that it proposes."""

FIVE = ("impulse", "central-difference", "newmark-linear", "newmark-average", "wilson")
"""Those of its figures 1 to 6."""

DT = 0.02
"""The paper's time step, s."""

REFERENCES = ("paper", "finer")
"""What errors are told against: what the paper calls exact, or steps so fine that their error is
not seen."""

EXACT = "newmark-linear"
"""The method that the paper calls exact, with the steps of `Example.exact_dt`."""

FINER = 8
"""Steps of rk5, the finer reference, within one step."""

QUANTITIES = ("displacement", "velocity", "acceleration")

_SLOW = 1e-6  # rad within a step: a sine so slow is a straight line, to 1e-13


@dataclass(frozen=True)
class ExampleFigure:
    """A figure of the paper: displacement of one floor (from 1) over time, or its error `|u -
    u_exact|`."""

    number: int
    floor: int
    is_error: bool = False


@dataclass(frozen=True)
class Example:
    """An example of the paper.

    Attributes
    ----------
    number : int
        As in the paper.
    about : str
        What it is, in a sentence.
    model : Model
        The building and its forces; it starts at rest.
    duration, exact_dt : float
        s; the latter is the step of what the paper calls exact.
    figures : tuple of ExampleFigure
        Those of the paper.
    remark : str
        How the methods rank, against what the paper says.
    drawn_as : int
        The figure of the paper that shows the building; 0 for none.
    """

    number: int
    about: str
    model: Model
    duration: float
    exact_dt: float
    figures: tuple[ExampleFigure, ...]
    remark: str
    drawn_as: int = 0


@dataclass(frozen=True)
class ExampleMotion:
    """What is compared: times (s), shape (steps + 1,), and motion of the floors, shape (steps + 1,
    n), SI."""

    time: Array
    displacement: Array
    velocity: Array
    acceleration: Array


@dataclass(frozen=True)
class ExampleRun:
    """One method on one example with one step.

    Attributes
    ----------
    variant : str
        Empty for the method as `tdint run` takes it; else what was done otherwise.
    outcome : str
        The status of `tdint run`; without an end `diverged`, `not-converged` or `unstable-step`,
        and `refused` for a method for linear buildings.
    motion, paper, finer : ExampleMotion
        At the step ends; without an end `motion` holds nan. The latter two are what `REFERENCES`
        names.
    """

    example: int
    method: str
    variant: str
    dt: float
    outcome: str
    motion: ExampleMotion
    paper: ExampleMotion
    finer: ExampleMotion

    def exact(self, reference: str) -> ExampleMotion:
        """The motion that one of `REFERENCES` names."""
        return {"paper": self.paper, "finer": self.finer}[reference]

    def error(self, quantity: str, reference: str = "paper") -> float:
        """Largest error over all floors and steps, SI, against one of `REFERENCES`; nan without an
        end."""
        return float(
            np.max(
                np.abs(getattr(self.motion, quantity) - getattr(self.exact(reference), quantity))
            )
        )


_REMARKS = {
    1: "The paper: the proposed method errs least, the central difference most. Here the proposed "
    "method errs least of all methods of order 2 as well, but the central difference comes next to "
    "it: its period error is half that of average acceleration. Started as if no force acted at t "
    "= 0 (u(-dt) = 0) it errs most, as in the paper, but for an RK5 whose load is held over each "
    "step. RK5 with the load at its stages is closer to the exact motion than newmark-linear with "
    "0.001 s: its error here is that of the reference. With the load linear between the steps it "
    "errs as methods of order 2 do: they differ by little more than what the sampled load does to "
    "all of them.",
    2: "The paper: RK5 errs most, then the central difference. Its data stand in a drawing that "
    "we do not have, so that ranks under our values need not be its own. RK5 with the load at its "
    "stages errs least; with the load held over each step it errs most, as in the paper. The "
    "central difference errs less than average acceleration, U0-V0 and Wilson, started with u(-dt) "
    "= 0 as well.",
    3: "The paper: average acceleration, U0-V0 and RK5 do well, central difference and Wilson "
    "err. Here RK5 does best, for it sees the load itself; all others come within 35 % of each "
    "other and of RK5 with the load linear between the steps, average acceleration and U0-V0 last: "
    "their error is that of the sampled load. The central difference errs 15 times as much once it "
    "starts with u(-dt) = 0. For Wilson we know no reason.",
}


@cache
def examples() -> Mapping[int, Example]:
    """The examples by number."""
    oscillator = simple_model(
        "example 1",
        [simple_story(10.0, Law("polynomial", (200.0, 3.0)), dashpot=5.0)],
        forces=[Force(1, 500.0, 0.0, 25.0), Force(1, 0.0, -200.0, 10.0)],
    )
    # The paper has these values in a drawing only: ours.
    two_stories = simple_model(
        "example 2",
        [
            simple_story(10.0, Law("polynomial", (800.0, 40.0, 1000.0)), dashpot=5.0),
            simple_story(8.0, Law("polynomial", (600.0, 30.0, 750.0)), dashpot=4.0),
        ],
        forces=[Force(1, 150.0, 0.0, 6.0), Force(2, 0.0, 100.0, 4.0)],
    )
    pushes = [
        force
        for floor in (1, 150)
        for force in (Force(floor, 1e3, 0.0, 50.0), Force(floor, 0.0, 500.0, 30.0))
    ]
    masses = [simple_story(50.0, Law("polynomial", (500.0, 0.2)), dashpot=10.0)] * 150
    chain = simple_model("example 3", masses, forces=pushes)
    return {
        1: Example(
            1,
            "10 u'' + 5 u' + 200 u + 3 u^2 = 500 cos 25t - 200 sin 10t",
            oscillator,
            5.0,
            0.001,
            (ExampleFigure(7, 1), ExampleFigure(8, 1, is_error=True)),
            _REMARKS[1],
        ),
        2: Example(
            2,
            "two stories with cubic springs under two harmonic forces (own values)",
            two_stories,
            10.0,
            0.001,
            (ExampleFigure(10, 1), ExampleFigure(11, 2), ExampleFigure(12, 2, is_error=True)),
            _REMARKS[2],
            drawn_as=9,
        ),
        3: Example(
            3,
            "150 masses of 50 kg in a row, f = 500 d + 0.2 d^2, both ends pushed",
            chain,
            10.0,
            0.002,
            (ExampleFigure(14, 1), ExampleFigure(15, 150), ExampleFigure(16, 1, is_error=True)),
            _REMARKS[3],
            drawn_as=13,
        ),
    }


def exact_steps(example: Example, dt: float) -> int:
    """Steps of what the paper calls exact within one step dt: its own where they divide it, else
    shorter ones."""
    return math.ceil(dt / example.exact_dt - 1e-9)


def reference(
    example: Example, dt: float, method: str = "rk5", finer: int = FINER
) -> ExampleMotion:
    """The motion at the ends of steps dt, by a method that takes several steps in one; rk5 with the
    load at its stages.

    Raises
    ------
    AnalysisError
        A step so large that even a part of it is too large.
    """
    end = _steps(example, dt) * dt
    history = run(
        example.model, method=method, dt=dt / finer, duration=end, history=True, check=False
    ).history
    assert history is not None
    return ExampleMotion(
        history.time[::finer],
        history.displacement[::finer],
        history.velocity[::finer],
        history.acceleration[::finer],
    )


def gap(example: Example, dt: float, method: str, finer: int = FINER) -> float:
    """Largest difference of the displacements, m, between the finer reference and that of another
    method."""
    other = reference(example, dt, method, finer)
    return float(np.max(np.abs(reference(example, dt).displacement - other.displacement)))


def run_example(
    example: Example, dt: float, integrators: Sequence[Integrator]
) -> Iterator[ExampleRun]:
    """Methods on an example, and the variants of those that have some, each beside both
    references."""
    paper, finer = reference(example, dt, EXACT, exact_steps(example, dt)), reference(example, dt)
    unknown = np.full_like(finer.displacement, math.nan)
    for integrator in integrators:
        for variant, solve in {"": _as_run, **VARIANTS.get(integrator.method.name, {})}.items():
            motion = ExampleMotion(finer.time, unknown, unknown, unknown)  # of a run without an end
            try:
                outcome, motion = "done", solve(example, dt, integrator)
            except FailedRun as failure:
                outcome = failure.status
            except AnalysisError:
                outcome = "refused" if integrator.family.linear_only else DIVERGED
            yield ExampleRun(
                example.number, integrator.label, variant, dt, outcome, motion, paper, finer
            )


def _steps(example: Example, dt: float) -> int:
    return max(1, math.floor(example.duration / dt + 1e-9))


def _as_run(example: Example, dt: float, integrator: Integrator) -> ExampleMotion:
    return reference(example, dt, integrator.label, 1)


def _from_rest_before(example: Example, dt: float, integrator: Integrator) -> ExampleMotion:
    """Central difference with u(-dt) = 0 in place of u(-dt) = dt^2 a0 / 2: it sees the velocity v0
    = dt a0 / 2."""
    building = assemble(example.model)
    damped = np.diag(building.mass) + 0.5 * dt * building.damping_matrix()
    velocity = np.linalg.solve(damped, 0.5 * dt * _load(example.model, np.zeros(1))[0])
    start = replace(example.model.initial, velocity=tuple(velocity.tolist()))
    return _as_run(replace(example, model=replace(example.model, initial=start)), dt, integrator)


def _load(model: Model, times: Array) -> Array:
    """Forces on the floors at the times, N, shape (times, n)."""
    loads: Array = np.zeros((times.size, len(model.stories)))
    for force in model.excitation.forces:
        angle = force.omega * times
        loads[:, force.floor - 1] += force.cosine * np.cos(angle) + force.sine * np.sin(angle)
    return loads


def _stepwise(hold: bool) -> Callable[[Example, float, Integrator], ExampleMotion]:
    """A method that remembers displacement and velocity alone, fed with the load's samples at the
    step ends.

    The load is held over each step at its value before, or linear in it: every step is a march of
    its own, under constant forces and slow sines.
    """

    def solve(example: Example, dt: float, integrator: Integrator) -> ExampleMotion:
        count = _steps(example, dt)
        times = dt * np.arange(count + 2, dtype=np.float64)
        loads = _load(example.model, times)
        building = assemble(example.model)
        n = building.stories
        motion = np.zeros((3, count + 1, n))
        state = np.array([example.model.initial.displacement, example.model.initial.velocity])
        for j in range(count + 1):
            # Forces that go from `begin` to `end` (N, shape (n,)) within a step.
            begin = loads[j]
            end = loads[j] if hold else loads[j + 1]
            slope = (end - begin) / math.sin(_SLOW)
            constant = [
                Force(floor, value, 0.0, 0.0)
                for floor, value in enumerate(begin.tolist(), start=1)
                if value
            ]
            ramp = [
                Force(floor, 0.0, value, _SLOW / dt)
                for floor, value in enumerate(slope.tolist(), start=1)
                if value
            ]
            forces = force_table(constant + ramp)
            marched = PreparedBuilding(building, forces, *state).integrate(
                integrator, Steps(dt, 1), history_rows=1
            )
            if marched.code < 0:
                raise AnalysisError(f"{integrator.label} ran away with dt {dt:.6g} s")
            motion[:, j] = marched.space.history[0, 1 : 1 + 3 * n].reshape(3, n)
            state = marched.space.history[1, 1 : 1 + 2 * n].reshape(2, n)
        return ExampleMotion(times[:-1], *motion)

    return solve


VARIANTS: Mapping[str, Mapping[str, Callable[[Example, float, Integrator], ExampleMotion]]] = {
    "rk5": {
        "load linear between the steps": _stepwise(False),
        "load held over each step": _stepwise(True),
    },
    "central-difference": {"start with u(-dt) = 0": _from_rest_before},
}
"""What else is done with a method, by its name: the likely reasons for the paper's ranking."""


def default_integrators() -> list[Integrator]:
    """The methods of `METHODS`."""
    return [parse(text) for text in METHODS]


def paper_examples(
    numbers: Sequence[int] = (1, 2, 3),
    method: str | Iterable[str] | None = None,
    dt: float | Sequence[float] = DT,
) -> ResultList[ExampleRun]:
    """The examples of the paper of 2022, run.

    Parameters
    ----------
    numbers : sequence of int
        Which: 1, 2, 3.
    method : str or iterable of str, optional
        Specifications; by default the paper's methods.
    dt : float or sequence of float
        Steps, s; by default the paper's.

    Returns
    -------
    ResultList of ExampleRun
        One for each example, step and method.

    Raises
    ------
    UsageError
        No such example, an unknown method.
    """
    by_number = examples()
    if unknown := [number for number in numbers if number not in by_number]:
        raise UsageError(
            f"the paper has no example {unknown[0]}; there are {', '.join(map(str, by_number))}"
        )
    integrators = default_integrators() if method is None else chosen(method)
    steps = numbers_of(dt, "dt").tolist()
    return ResultList(
        [
            run
            for one in numbers
            for h in steps
            for run in run_example(by_number[one], h, integrators)
        ]
    )
