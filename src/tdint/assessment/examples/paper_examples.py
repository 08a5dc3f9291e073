"""Examples 1 to 3 of the paper of 2022: errors of its methods, also with other loads or initial
states."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache

import numpy as np

from tdint.arrays import Array, max_absolute
from tdint.errors import AnalysisError, UsageError
from tdint.methods.catalogue import chosen
from tdint.methods.method import Integrator
from tdint.model.building import assemble, force_table
from tdint.model.definition import Force, Model, simple_model
from tdint.model.story import simple_story
from tdint.model.story_laws import Law
from tdint.response.arguments import numbers_of
from tdint.response.runs.outcome import DIVERGED, FailedRun
from tdint.response.runs.prepared import PreparedBuilding
from tdint.response.runs.run import run
from tdint.response.time_steps import Steps
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
"""The seven methods of the paper; `impulse` is the method that the paper proposes."""

FIVE = ("impulse", "central-difference", "newmark-linear", "newmark-average", "wilson")
"""Methods in figures 1 to 6 of the paper."""

DT = 0.02
"""Time step of the paper, s."""

REFERENCES = ("paper", "finer")
"""References for errors: the solution that the paper calls exact, or a solution with time steps so
small that its error is negligible."""

EXACT = "newmark-linear"
"""Method that the paper calls exact, with the time step `Example.exact_dt`."""

FINER = 8
"""Number of time steps of the finer reference, rk5, in one time step."""

# Rad per time step. A harmonic force with this small angle per step represents a linear change of
# the force: the sine is linear within 1e-13.
_SLOW = 1e-6


@dataclass(frozen=True)
class ExampleFigure:
    """Figure of the paper with a time history of a floor.

    Attributes
    ----------
    floor : int
        Floor, from 1.
    is_error : bool
        True if the figure shows the error |u - u_exact| of the displacement u, False if it shows
        the displacement.
    """

    number: int
    floor: int
    is_error: bool = False


@dataclass(frozen=True)
class Example:
    """Example of the paper.

    Attributes
    ----------
    model : Model
        The building and its forces. The building is initially at rest.
    duration, exact_dt : float
        Duration, and time step of the solution that the paper calls exact, s.
    remark : str
        Comparison of the ranking of the methods with the ranking in the paper.
    drawn_as : int
        Number of the figure of the paper that shows the building. The default, 0, means no figure.
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
    """Motion of the floors at the time steps.

    Attributes
    ----------
    displacement, velocity, acceleration : ndarray, shape (steps + 1, n)
        Motion of the floors, m, m/s and m/s^2.
    """

    time: Array
    displacement: Array
    velocity: Array
    acceleration: Array


@dataclass(frozen=True)
class ExampleRun:
    """Result of a method for an example with one time step.

    Attributes
    ----------
    example : int
        Number of the example in the paper.
    method : str
        Method specification.
    dt : float
        Time step, s.
    variant : str
        Description of the variant; empty for the method as used by `tdint run`.
    outcome : str
        Status of `tdint run`. An incomplete run has the status `diverged`, `not-converged` or
        `unstable-step`; a method for linear buildings only has the status `refused`.
    motion, paper, finer : ExampleMotion
        Computed motion and the two references of `REFERENCES` at the ends of the time steps.
        `motion` contains nan for an incomplete run.
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
        """Return the reference motion for an element of `REFERENCES`.

        Parameters
        ----------
        reference : str
            `paper` or `finer`.
        """
        return {"paper": self.paper, "finer": self.finer}[reference]

    def error(
        self,
        quantity: str,
        reference: str = "paper",
        norm: str = "maximum",
        floor: int | None = None,
    ) -> float:
        """Return the difference from a reference over all time steps, in SI units.

        The result is nan for an incomplete run.

        Parameters
        ----------
        quantity : str
            `displacement` (m), `velocity` (m/s) or `acceleration` (m/s^2).
        reference : str, default "paper"
            Reference, an element of `REFERENCES`: `paper` or `finer`.
        norm : str, default "maximum"
            A key of `NORMS`: maximum, root mean square or mean of the absolute differences.
        floor : int, optional
            Floor, from 1. By default, all floors are compared.
        """
        difference = getattr(self.motion, quantity) - getattr(self.exact(reference), quantity)
        if floor is not None:
            difference = difference[:, floor - 1]
        return NORMS[norm](np.abs(difference))


NORMS: Mapping[str, Callable[[Array], float]] = {
    "maximum": lambda errors: float(np.max(errors)),
    "rms": lambda errors: float(np.sqrt(np.mean(errors**2))),
    "mean": lambda errors: float(np.mean(errors)),
}
"""Norms of absolute errors over floors and time steps: maximum, root mean square, mean."""

EQUAL_ERRORS = 0.05
"""Maximum relative difference of two errors that are called equal. Sampling the load and the choice
of the compared times change the errors by similar amounts."""


def ordered_methods(
    runs: Sequence[ExampleRun], reference: str, norm: str, floor: int | None = None
) -> list[list[str]]:
    """Return groups of methods in the order of their displacement errors.

    The errors in a group exceed the smallest of the group by at most `EQUAL_ERRORS`. Variants and
    incomplete runs are omitted. The other arguments are the arguments of `ExampleRun.error`.
    """
    errors = {
        run.method: run.error("displacement", reference, norm, floor)
        for run in runs
        if run.outcome == "done" and not run.variant
    }
    groups: list[list[str]] = []
    for method in sorted(errors, key=lambda name: errors[name]):
        if groups and errors[method] <= (1.0 + EQUAL_ERRORS) * errors[groups[-1][0]]:
            groups[-1].append(method)
        else:
            groups.append([method])
    return groups


_REMARKS = {
    1: "Paper: the proposed method has the smallest error, the central difference the largest. "
    "Here the errors of the proposed method and of the central difference are equal within 5 % "
    "(maximum, rms and mean), and the smallest of all second-order methods, because the period "
    "error of the central difference is half the period error of average acceleration. If the "
    "central difference ignores the force at t = 0 (start with u(-dt) = 0), its error is the "
    "largest, as in the paper, except for RK5 with a load that is constant in each step. RK5 with "
    "the load at its stages is more accurate than the reference of the paper (newmark-linear with "
    "0.001 s), so that its listed error is the error of that reference. With a load that is linear "
    "between the steps, the error of RK5 is similar to the errors of second-order methods, because "
    "sampling the load causes most of the error of all these methods.",
    2: "Paper: RK5 has the largest error, the central difference the second largest. The data of "
    "this example are only in a drawing that is not available to us. We use assumed values, "
    "for which the ranking may differ. RK5 with the load at its stages has the smallest error "
    "here; with a load that is constant in each step it has the largest, as in the paper. The "
    "error of the central difference is smaller than the errors of average acceleration, "
    "U0-V0 and Wilson, even if it starts with u(-dt) = 0.",
    3: "Paper: average acceleration, U0-V0 and RK5 are accurate, central difference and Wilson "
    "are not. Here RK5 is the most accurate, because it evaluates the load itself: its listed "
    "error is mostly the error of the reference of the paper (newmark-linear with 0.002 s). The "
    "errors of the other methods, and of RK5 with a load that is linear between the steps, agree "
    "within 35 % over all masses, and within 70 % for mass 1, which the paper draws, because "
    "sampling the load causes most of them; average acceleration and U0-V0 have the largest. "
    "The error of the central difference is 15 times as large if it starts with u(-dt) = 0. We "
    "know no reason for the error of Wilson in the paper.",
}


@cache
def examples() -> Mapping[int, Example]:
    """Return the examples of the paper on the impulse method (2022) by their number in the paper.

    The polynomial law f = k1 d + k2 d^2 + k3 d^3 has the coefficients (k1, k2, k3) for the drift d.
    A force on floor i is cosine cos(omega t) + sine sin(omega t): `Force(i, cosine, sine, omega)`.
    Units are N, m, s and kg.
    """
    oscillator = simple_model(
        "example 1",
        [simple_story(10.0, Law("polynomial", (200.0, 3.0)), dashpot=5.0)],
        forces=[Force(1, 500.0, 0.0, 25.0), Force(1, 0.0, -200.0, 10.0)],
    )
    # The paper shows the values of the example in a drawing only, so these values are our own.
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
    stories = [simple_story(50.0, Law("polynomial", (500.0, 0.2)), dashpot=10.0)] * 150
    chain = simple_model("example 3", stories, forces=pushes)
    # The arguments of `ExampleFigure` are the number of the figure and the floor that it shows.
    return {
        1: Example(
            1,
            about="10 u'' + 5 u' + 200 u + 3 u^2 = 500 cos 25t - 200 sin 10t",
            model=oscillator,
            duration=5.0,
            exact_dt=0.001,
            figures=(ExampleFigure(7, 1), ExampleFigure(8, 1, is_error=True)),
            remark=_REMARKS[1],
        ),
        2: Example(
            2,
            about="two stories with cubic springs under two harmonic forces (assumed values)",
            model=two_stories,
            duration=10.0,
            exact_dt=0.001,
            figures=(
                ExampleFigure(10, 1),
                ExampleFigure(11, 2),
                ExampleFigure(12, 2, is_error=True),
            ),
            remark=_REMARKS[2],
            drawn_as=9,  # number of the figure that shows the building
        ),
        3: Example(
            3,
            about="150 masses of 50 kg in a row, f = 500 d + 0.2 d^2, forces at both ends",
            model=chain,
            duration=10.0,
            exact_dt=0.002,
            figures=(
                ExampleFigure(14, 1),
                ExampleFigure(15, 150),
                ExampleFigure(16, 1, is_error=True),
            ),
            remark=_REMARKS[3],
            drawn_as=13,
        ),
    }


def exact_steps(example: Example, dt: float) -> int:
    """Return the number of time steps of the exact solution of the paper in one time step dt (s).

    The time step of the exact solution is `Example.exact_dt` if it divides dt, otherwise it is
    smaller.
    """
    return math.ceil(dt / example.exact_dt - 1e-9)


def reference(
    example: Example, dt: float, method: str = "rk5", finer: int = FINER
) -> ExampleMotion:
    """Compute the motion at the ends of time steps dt (s) by a method with the time step dt /
    finer. The default method rk5 evaluates the load at its stages. AnalysisError is raised if the
    time step is too large for the method.
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
        history.absolute_acceleration[::finer],
    )


def gap(example: Example, dt: float, method: str, finer: int = FINER) -> float:
    """Return the maximum difference of displacements, m, between two accurate solutions at the
    multiples of dt (s).

    The first solution is computed by rk5 with the time step dt / `FINER` (the reference `finer` of
    `REFERENCES`). The second is computed by `method` with the time step dt / `finer`.
    """
    other = reference(example, dt, method, finer)
    return max_absolute(reference(example, dt).displacement - other.displacement)


def run_example(
    example: Example, dt: float, integrators: Sequence[Integrator]
) -> Iterator[ExampleRun]:
    """Run methods and their variants on an example.

    Parameters
    ----------
    integrators : sequence of Integrator
        Methods. If a method has `VARIANTS`, they are run also.

    Yields
    ------
    ExampleRun
        Result of a method or variant, with both references.
    """
    paper, finer = reference(example, dt, EXACT, exact_steps(example, dt)), reference(example, dt)
    unknown = np.full_like(finer.displacement, math.nan)
    for integrator in integrators:
        for variant, solve in {"": _as_run, **VARIANTS.get(integrator.method.name, {})}.items():
            # An incomplete run has no motion to compare, so its values are nan.
            motion = ExampleMotion(finer.time, unknown, unknown, unknown)
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
    """Return the number of complete time steps dt (s) in the duration of an example."""
    return max(1, math.floor(example.duration / dt + 1e-9))


def _as_run(example: Example, dt: float, integrator: Integrator) -> ExampleMotion:
    """Integrate an example with a method and time step dt (s), as `tdint run` does."""
    return reference(example, dt, integrator.label, 1)


def _from_rest_before(example: Example, dt: float, integrator: Integrator) -> ExampleMotion:
    """Run the central difference method with u(-dt) = 0 instead of u(-dt) = dt^2 a0 / 2, which is
    equivalent to the initial velocity v0 = dt a0 / 2, with the initial acceleration a0.
    """
    building = assemble(example.model)
    # v0 = dt a0 / 2 with the initial acceleration M a0 = p(0) - C v0 for zero displacements: solve
    # (M + dt C / 2) v0 = dt p(0) / 2.
    effective_mass = np.diag(building.mass) + 0.5 * dt * building.damping_matrix()
    velocity = np.linalg.solve(effective_mass, 0.5 * dt * _load(example.model, np.zeros(1))[0])
    start = replace(example.model.initial, velocity=tuple(velocity.tolist()))
    return _as_run(replace(example, model=replace(example.model, initial=start)), dt, integrator)


def _load(model: Model, times: Array) -> Array:
    """Return the applied forces on the floors of a model at times (s), N, shape (times, n)."""
    loads: Array = np.zeros((times.size, len(model.stories)))
    for force in model.excitation.forces:
        angle = force.omega * times
        loads[:, force.floor - 1] += force.cosine * np.cos(angle) + force.sine * np.sin(angle)
    return loads


def _stepwise(hold: bool) -> Callable[[Example, float, Integrator], ExampleMotion]:
    """Return a function (example, time step in s, method) that integrates an example with a load
    that is sampled at the time steps, and returns the motion.

    With `hold`, the load is constant in each time step and equal to its value at the start of the
    step, otherwise linear. The function applies to methods that store only displacement and
    velocity from step to step, because each time step is a separate integration.
    """

    def solve(example: Example, dt: float, integrator: Integrator) -> ExampleMotion:
        """Integrate an example step by step and return its motion at the time steps."""
        count = _steps(example, dt)
        times = dt * np.arange(count + 2, dtype=np.float64)
        loads = _load(example.model, times)
        building = assemble(example.model)
        n = building.stories
        motion = np.zeros((3, count + 1, n))
        state = np.array([example.model.initial.displacement, example.model.initial.velocity])
        for j in range(count + 1):
            # The forces (N, shape (n,)) change from `begin` to `end` within this time step. They
            # are the sum of constant forces and the start of slow sines, which are practically
            # linear.
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
            result = PreparedBuilding(building, forces, *state).integrate(
                integrator, Steps(dt, 1), history_rows=1
            )
            if result.code < 0:
                raise AnalysisError(
                    f"{integrator.label} diverged with dt {dt:.6g} s; use a smaller time step"
                )
            # The rows of the history are the start and the end of the step. After the ground
            # acceleration, they contain displacements, velocities and accelerations.
            motion[:, j] = result.space.history[0, 1 : 1 + 3 * n].reshape(3, n)
            state = result.space.history[1, 1 : 1 + 2 * n].reshape(2, n)
        return ExampleMotion(times[:-1], *motion)

    return solve


VARIANTS: Mapping[str, Mapping[str, Callable[[Example, float, Integrator], ExampleMotion]]] = {
    "rk5": {
        "load linear between the steps": _stepwise(False),
        "load constant in each step": _stepwise(True),
    },
    "central-difference": {"start with u(-dt) = 0": _from_rest_before},
}
"""Variants of methods by name of the method; they are likely reasons for the ranking in the
paper."""


def paper_examples(
    numbers: Sequence[int] = (1, 2, 3),
    method: str | Iterable[str] | None = None,
    dt: float | Sequence[float] = DT,
) -> ResultList[ExampleRun]:
    """Run the examples of the paper of 2022.

    Parameters
    ----------
    numbers : sequence of int
        Numbers of the examples: 1, 2, 3. The default is all three.
    method : str or iterable of str, optional
        Specifications of methods. The default is the seven methods of the paper.
    dt : float or sequence of float
        Time steps, s. The default is the time step of the paper, 0.02 s.

    Returns
    -------
    ResultList of ExampleRun
        One result per example, time step, method and variant.

    Raises
    ------
    UsageError
        An example or a method is unknown.
    """
    by_number = examples()
    if unknown := [number for number in numbers if number not in by_number]:
        raise UsageError(
            f"example {unknown[0]} not found; the examples are {', '.join(map(str, by_number))}"
        )
    integrators = chosen(METHODS if method is None else method)
    steps = numbers_of(dt, "dt").tolist()
    return ResultList(
        [
            run
            for number in numbers
            for h in steps
            for run in run_example(by_number[number], h, integrators)
        ]
    )
