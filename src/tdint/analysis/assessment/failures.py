"""Which methods fail on which problems, how and by how much: the work behind `tdint failures`."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache

import numpy as np

from tdint.analysis.run import error_estimate
from tdint.analysis.run.case import Case
from tdint.analysis.run.outcome import DIVERGED, NOT_CONVERGED, UNSTABLE, FailedRun, History
from tdint.analysis.run.prepared import PreparedBuilding
from tdint.analysis.run.run import run
from tdint.analysis.run.workspace import LINEAR_OSCILLATORS, kernels
from tdint.arrays import Array
from tdint.errors import UsageError, did_you_mean
from tdint.kernels.building.compilable import Variant
from tdint.kernels.building.load_or_compile import load_or_compile
from tdint.kernels.compiling import Kernel
from tdint.methods.catalogue import catalogue, chosen, parse
from tdint.methods.method import Integrator
from tdint.model.damage_states import DONE
from tdint.model.definition import Force, Law, Model, simple_model, simple_story
from tdint.tabular import Progress, ResultList, told_progress

# ---- The problems on which methods fail, as data: building, load, steps, what is judged, by how
# much, against what
#
# All start from numbers in SI units. Energies count kinetic energy and what the stories store, both
# in closed form.

FINER = 64
"""Steps of the reference of the softening oscillator within one step."""


@dataclass(frozen=True)
class Fault:
    """What makes a run fail a problem: a measure beyond its bounds.

    Attributes
    ----------
    name : str
        What the verdict calls it.
    low, high : float
        The bounds; a value on a bound is within.
    """

    name: str
    low: float = -math.inf
    high: float = math.inf

    def found(self, value: float) -> bool:
        """Whether `value` is beyond the bounds."""
        return not self.low <= value <= self.high


@dataclass(frozen=True)
class HardProblem:
    """A problem with a known answer.

    Attributes
    ----------
    name, about, source : str
        For the command line; what it is, in a sentence; who published it.
    model : Model
        Building, load and start.
    steps : tuple of (float, int)
        Time steps (s) and how many of each.
    energy : callable
        History -> energy at its times, J, shape (steps + 1,).
    energy_scale : float
        Largest energy of the exact motion, J; the initial one where nothing drives it.
    error_of : str
        What `error` is.
    error : callable
        History -> error.
    faults : tuple of Fault
        What the judged number is held against.
    by_energy : bool
        Whether the energy over its scale is judged; else the error is.
    """

    name: str
    about: str
    source: str
    model: Model
    steps: tuple[tuple[float, int], ...]
    energy: Callable[[History], Array]
    energy_scale: float
    error_of: str
    error: Callable[[History], float]
    faults: tuple[Fault, ...]
    by_energy: bool = False


def _keeps(part: float) -> tuple[Fault, Fault]:
    """The faults of a motion that should keep its energy within a part of it."""
    return Fault("gains energy", high=1.0 + part), Fault("loses energy", low=1.0 - part)


def _second_half(history: History, values: Array) -> float:
    """Largest absolute value over the second half of the steps."""
    return float(np.max(np.abs(values[(len(history.time) - 1) // 2 + 1 :])))


def _kinetic(history: History, masses: tuple[float, ...]) -> Array:
    return np.asarray(0.5 * history.velocity**2 @ np.array(masses))


# ---- Hardening oscillator: u'' + 100 u (1 + 10 u^2) = 0 from u = 1.5

_SPRING, _CUBIC, _STRETCH = 100.0, 1000.0, 1.5


def hardening_motion(time: Array) -> Array:
    """Duffing's oscillator in closed form: u = U cn(w t | m), w^2 = a + b U^2, m = b U^2 / (2
    w^2)."""
    from scipy.special import ellipj

    square = _SPRING + _CUBIC * _STRETCH**2
    return np.asarray(
        _STRETCH * ellipj(math.sqrt(square) * time, _CUBIC * _STRETCH**2 / (2.0 * square))[1]
    )


def _hardening() -> HardProblem:
    def energy(history: History) -> Array:
        u = history.displacement[:, 0]
        return _kinetic(history, (1.0,)) + 0.5 * _SPRING * u**2 + 0.25 * _CUBIC * u**4

    def error(history: History) -> float:
        return (
            float(np.max(np.abs(history.displacement[:, 0] - hardening_motion(history.time))))
            / _STRETCH
        )

    return HardProblem(
        name="hardening",
        about="u'' + 100 u (1 + 10 u^2) = 0 from u = 1.5, 10 s: the tangent stiffness changes "
        "68-fold in each swing",
        source="Duffing's oscillator; exact motion by Jacobi's cn (Abramowitz and Stegun 1964, "
        "ch. 16)",
        model=simple_model(
            "hardening oscillator",
            [simple_story(1.0, Law("polynomial", (_SPRING, 0.0, _CUBIC)))],
            displacement=(_STRETCH,),
        ),
        steps=((0.005, 2000), (0.02, 500), (0.05, 200)),
        energy=energy,
        energy_scale=0.5 * _SPRING * _STRETCH**2 + 0.25 * _CUBIC * _STRETCH**4,
        error_of="largest displacement error over the amplitude",
        error=error,
        faults=_keeps(0.02),
        by_energy=True,
    )


# ---- Softening oscillator: u'' + 100 tanh u = 0 from u = 4

_PULL, _STRENGTH = 4.0, 100.0


def _log_cosh(u: Array) -> Array:
    return np.asarray(np.abs(u) + np.log1p(np.exp(-2.0 * np.abs(u))) - math.log(2.0))


def _softening_model() -> Model:
    story = simple_story(1.0, Law("tanh", (_STRENGTH,)), stiffness=_STRENGTH)
    return simple_model("softening oscillator", [story], displacement=(_PULL,))


@cache
def softening_motion(dt: float, steps: int) -> Array:
    """The softening oscillator at the ends of the steps, m: gauss4 with 64 steps in one."""
    fine = run(
        _softening_model(),
        method="gauss4",
        dt=dt / FINER,
        duration=dt * steps,
        history=True,
        check=False,
    )
    assert fine.history is not None
    return fine.history.displacement[::FINER, 0]


def _softening() -> HardProblem:
    def energy(history: History) -> Array:
        return _kinetic(history, (1.0,)) + _STRENGTH * _log_cosh(history.displacement[:, 0])

    def error(history: History) -> float:
        exact = softening_motion(float(history.time[1]), len(history.time) - 1)
        return float(np.max(np.abs(history.displacement[:, 0] - exact))) / _PULL

    return HardProblem(
        name="softening",
        about="u'' + 100 tanh u = 0 from u = 4, 60 s: the tangent stiffness all but vanishes "
        "twice in each swing",
        source="elastic, bounded force; exact energy in closed form, motion by gauss4 with steps "
        "64 times finer",
        model=_softening_model(),
        steps=((0.05, 1200), (0.1, 600)),
        energy=energy,
        energy_scale=float(_STRENGTH * _log_cosh(np.array(_PULL))),
        error_of="largest displacement error over the amplitude",
        error=error,
        faults=_keeps(0.01),
        by_energy=True,
    )


# ---- Stiff and soft node of Bathe and Noh: the base node's motion sin 1.2 t comes through a spring
# of 1e7 N/m

_STIFF, _DRIVE = 1e7, 1.2
_OWN, _DRIVEN = 1.0 / (1.0 - _DRIVE**2) * -_DRIVE, 1.0 / (1.0 - _DRIVE**2)


def soft_node_motion(time: Array) -> Array:
    """Displacement of the soft node for an infinite stiffness: u'' + u = sin 1.2 t from rest."""
    return np.asarray(_OWN * np.sin(time) + _DRIVEN * np.sin(_DRIVE * time))


def _bathe_noh() -> tuple[HardProblem, HardProblem]:
    """The same building twice: a problem looks at its stiff node, another one at the soft node."""

    def energy(history: History) -> Array:
        stretch = history.displacement[:, 0] - np.sin(_DRIVE * history.time)
        return (
            _kinetic(history, (1.0, 1.0))
            + 0.5 * _STIFF * stretch**2
            + 0.5 * history.drift[:, 1] ** 2
        )

    def acceleration_error(history: History) -> float:
        exact = -(_DRIVE**2) * np.sin(_DRIVE * history.time)
        return _second_half(history, history.acceleration[:, 0] - exact)

    def displacement_error(history: History) -> float:
        return float(np.max(np.abs(history.displacement[:, 1] - soft_node_motion(history.time))))

    # The exact energy is that for an infinite stiffness: its largest value is looked for at many
    # times.
    time = np.linspace(0.0, 10.0, 10001)
    driven, drift = _DRIVE * np.cos(_DRIVE * time), soft_node_motion(time) - np.sin(_DRIVE * time)
    natural = _OWN * np.cos(time) + _DRIVEN * driven
    about = (
        "masses 1 and 1, springs 1e7 and 1, from rest, the base moves by sin 1.2 t, 10 s: the {} "
        "node"
    )
    stiff = HardProblem(
        name="stiff-node",
        about=about.format("stiff"),
        source="Bathe and Noh (2012), k1 = 1e7; exact motion that of k1 to infinity",
        model=simple_model(
            "stiff and soft node",
            [simple_story(1.0, stiffness=_STIFF), simple_story(1.0, stiffness=1.0)],
            forces=[Force(1, 0.0, _STIFF, _DRIVE)],
        ),
        steps=((0.2618, 38),),
        energy=energy,
        energy_scale=float(np.max(0.5 * (driven**2 + natural**2 + drift**2))),
        error_of="largest acceleration error of floor 1 in the second half, m/s^2",
        error=acceleration_error,
        faults=(Fault("rings", high=1.0),),
    )
    soft = replace(
        stiff,
        name="soft-node",
        about=about.format("soft"),
        error_of="largest displacement error of floor 2, m",
        error=displacement_error,
        faults=(Fault("inaccurate", high=0.1),),
    )
    return stiff, soft


# ---- Stiff pair: two halves of a mass on a pendulum's frequency, sqrt(9.81) rad/s, joined at 1e4
# rad/s

_SWING, _HALF, _JOINT = 9.81, 0.5, 2.5e7


def _stiff_pair() -> HardProblem:
    release = _HALF * _SWING  # force in the joint at u = 1 while both swing as one

    def energy(history: History) -> Array:
        springs = history.drift**2 @ np.array([_SWING, _JOINT])
        return np.asarray(_kinetic(history, (_HALF, _HALF)) + 0.5 * springs)

    def error(history: History) -> float:
        return _second_half(history, history.shear[:, 1] / release - history.displacement[:, 0])

    return HardProblem(
        name="stiff-pair",
        about="masses 0.5 and 0.5, springs 9.81 and 2.5e7, let go from a pull at the roof to u = "
        "1, 10 s: it has the frequencies of a pendulum of 1 kg and 1 m on a rod of EA 1e8 N, 3.13 "
        "and 1e4 rad/s",
        source="after the stiff pendulum of code_aster V5.02.100; exact motion that of a rigid "
        "joint",
        model=simple_model(
            "stiff pair",
            [simple_story(_HALF, stiffness=_SWING), simple_story(_HALF, stiffness=_JOINT)],
            displacement=(1.0, 1.0 + _SWING / _JOINT),
        ),
        steps=((0.05, 200),),
        energy=energy,
        energy_scale=0.5 * _SWING + 0.5 * _SWING**2 / _JOINT,
        error_of="largest error in the second half of the upper story's force for the "
        "displacement, over its amplitude",
        error=error,
        faults=(Fault("rings", high=0.1),),
    )


# ---- Linear oscillators of omega = 1 rad/s: dt is omega dt


def _sizes(history: History) -> Array:
    """Displacement or velocity / omega, whichever is larger, over the exact amplitude, at each
    step."""
    sizes = np.maximum(np.abs(history.displacement[:, 0]), np.abs(history.velocity[:, 0]))
    return np.asarray(sizes / math.hypot(history.displacement[0, 0], history.velocity[0, 0]))


def _oscillator_energy(history: History) -> Array:
    return np.asarray(0.5 * (history.displacement[:, 0] ** 2 + history.velocity[:, 0] ** 2))


def _oscillator(start: tuple[float, float]) -> Model:
    story = simple_story(1.0, stiffness=1.0)
    return simple_model("oscillator", [story], displacement=start[:1], velocity=start[1:])


def _limit(name: str, description: str, source: str, *dts: float) -> HardProblem:
    def growth(history: History) -> float:
        sizes = _sizes(history)
        half = sizes.size // 2
        return max(0.0, float(np.max(sizes[half + 1 :]) / np.max(sizes[: half + 1])) - 1.0)

    return HardProblem(
        name=name,
        about=f"oscillator of 1 rad/s from u = 1, 200 steps, {description}",
        source=source,
        model=_oscillator((1.0, 0.0)),
        steps=tuple((dt, 200) for dt in dts),
        energy=_oscillator_energy,
        energy_scale=0.5,
        error_of="growth of the amplitude from the first half of the steps to the second, over "
        "the former",
        error=growth,
        faults=(Fault("grows", high=0.01),),
    )


def _overshoot(name: str, start: tuple[float, float]) -> HardProblem:
    return HardProblem(
        name=f"overshoot-{name}",
        about=f"oscillator of 1 rad/s, the first ten steps of dt/T = 10, from a {name} of 1",
        source="Hilber and Hughes (1978)",
        model=_oscillator(start),
        steps=((20.0 * math.pi, 10),),
        energy=_oscillator_energy,
        energy_scale=0.5,
        error_of="amplitude beyond the exact one, over the exact one",
        error=lambda history: max(0.0, float(np.max(_sizes(history))) - 1.0),
        faults=(Fault("overshoots", high=0.01),),
    )


@cache
def problems() -> Mapping[str, HardProblem]:
    """All problems by name, in the order in which they are listed."""
    hughes = "Hughes (1987), sect. 9.1"
    every = (
        _hardening(),
        _softening(),
        *_bathe_noh(),
        _stiff_pair(),
        _limit(
            "limit-2", "about the limit of the central difference, omega dt = 2", hughes, 1.99, 2.01
        ),
        _limit("limit-sqrt-6", "about Fox and Goodwin's limit, the root of 6", hughes, 2.44, 2.46),
        _limit(
            "limit-sqrt-12", "about linear acceleration's limit, the root of 12", hughes, 3.45, 3.48
        ),
        _limit(
            "sqrt-12",
            "omega dt the root of 12: eqs. 15 to 23 of the impulse method divide by zero",
            "the impulse-momentum method of 2022",
            math.sqrt(12.0),
        ),
        _limit(
            "large-step",
            "omega dt = 100: Wilson's theta below 1.366 is unstable",
            "Bathe and Wilson (1973)",
            100.0,
        ),
        _overshoot("displacement", (1.0, 0.0)),
        _overshoot("velocity", (0.0, 1.0)),
    )
    return {problem.name: problem for problem in every}


# ---- Failures

PASS = "pass"
BLOWS_UP = "blows up"
NO_CONVERGENCE = "does not converge"
REFUSED = "refused"

_DISSIPATIVE = ("rho_inf=0.5", "rho_inf=0")
_MORE = {"impulse4": _DISSIPATIVE, "moment4": _DISSIPATIVE, "wilson": ("theta=1.3",)}
"""Members that show what their method's default does not: dissipation, and theta below its
limit."""

_ENDS = {DIVERGED: BLOWS_UP, NOT_CONVERGED: NO_CONVERGENCE}


@dataclass(frozen=True)
class Trial:
    """One method on one problem with one step.

    Attributes
    ----------
    energy_ratio_min, energy_ratio_max : float
        Least and largest energy over the largest of the exact motion; nan for a run without an end,
        and the least where the motion starts from rest.
    error, error_of : float, str
        The problem's error and what it is; nan for a run without an end.
    outcome : str
        The status of `tdint run`; the rest is what it gives with --allow-unstable. `refused` for a
        method that is not for this building.
    verdict : str
        `pass`, the fault found, or how the run failed.
    time, steps : float, int
        Last time reached (s), and whole steps done.
    measure : float
        What the verdict rests on: the energy ratio that is farthest from 1 where the problem judges
        energy, else the error; nan for a run without an end.
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
    by_name = problems()
    for name in names:
        if name not in by_name:
            raise UsageError(
                f"unknown problem {name!r}{did_you_mean(name, by_name)} (known: "
                f"{', '.join(by_name)})"
            )
    return [by_name[name] for name in dict.fromkeys(names or by_name)]


def failures(
    methods: str | Iterable[str] | None = None,
    problems: Sequence[str] = (),
    *,
    progress: bool | Progress = False,
) -> ResultList[Trial]:
    """Put methods to hard problems with known answers.

    Parameters
    ----------
    methods : str or iterable of str, optional
        Specifications; by default `usual_methods`.
    problems : sequence of str
        Names of problems; all if none is given.
    progress : bool or callable
        A bar on a terminal or in a notebook, by tqdm, or what is told how much is done, of how
        much.

    Returns
    -------
    ResultList of Trial
        One for each problem, method and step.

    Raises
    ------
    UsageError
        An unknown method or problem.
    """
    integrators = usual_methods() if methods is None else chosen(methods)
    hard = find_problems(problems)
    pairs = [(problem, method) for problem in hard for method in integrators]
    compile_for(integrators, hard)
    trials: list[Trial] = []
    with told_progress(progress, len(pairs), "trial") as told:
        for done, (problem, method) in enumerate(pairs, start=1):
            trials += attempt(method, problem)
            told(done, len(pairs))
    return ResultList(trials)


def compile_for(integrators: Sequence[Integrator], hard: Iterable[HardProblem]) -> None:
    """Load the time loops of all trials, compiled together, and told once, if they are not yet."""
    needed: list[tuple[Kernel, Variant]] = []
    for problem in hard:
        prepared = PreparedBuilding.of(problem.model)
        reference = [] if prepared.building.linear else [parse("gauss4")]
        for integrator in [*integrators, *reference]:
            if not integrator.family.linear_only or prepared.building.linear:
                needed += kernels(integrator, prepared.variant)
                if (
                    integrator.stability_limit < math.inf
                ):  # whether a step is too long is seen on oscillators
                    needed.append((integrator.family.step, LINEAR_OSCILLATORS))
    load_or_compile(list(dict.fromkeys(needed)))


def attempt(integrator: Integrator, problem: HardProblem) -> list[Trial]:
    """Integrate a problem with each of its steps, and judge."""
    return [_attempt(integrator, problem, dt, steps) for dt, steps in problem.steps]


def _attempt(integrator: Integrator, problem: HardProblem, dt: float, count: int) -> Trial:
    trial = Trial(problem.name, integrator.label, dt, REFUSED, REFUSED, problem.error_of)
    case = Case(problem.model, PreparedBuilding.of(problem.model), None, integrator)
    if integrator.family.linear_only and not case.building.linear:
        return trial
    steps = case.steps(dt, dt * count)
    # A run that is refused names the largest stable step, which takes longer than most runs: it is
    # asked for before.
    outcome = UNSTABLE
    if case.prepared.instability(integrator, dt) is None:
        ended = error_estimate.attempt(case, steps, history=True)
        outcome = ended.status if isinstance(ended, FailedRun) else DONE
    if outcome != DONE:
        ended = error_estimate.attempt(replace(case, allow_unstable=True), steps, history=True)
    if isinstance(ended, FailedRun):
        done = round(ended.time / dt)
        return replace(
            trial, outcome=outcome, verdict=_ENDS[ended.status], time=ended.time, steps=done
        )
    history = ended.history
    assert history is not None
    ratio = problem.energy(history) / problem.energy_scale
    least, largest = float(np.min(ratio)), float(np.max(ratio))
    error = problem.error(history)
    farthest = least if least * largest < 1.0 else largest
    measure = farthest if problem.by_energy else error
    return replace(
        trial,
        outcome=outcome,
        energy_ratio_min=least if ratio[0] > 0.0 else math.nan,
        energy_ratio_max=largest,
        error=error,
        verdict=next((fault.name for fault in problem.faults if fault.found(measure)), PASS),
        time=float(history.time[-1]),
        steps=len(history.time) - 1,
        measure=measure,
    )
