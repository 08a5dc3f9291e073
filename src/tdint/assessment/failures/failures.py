"""Failures of methods on problems with known solutions, as reported by `tdint failures`."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache

import numpy as np

from tdint.arrays import Array, max_absolute
from tdint.errors import UsageError, did_you_mean
from tdint.kernels.building.compilable import Variant
from tdint.kernels.building.load_or_compile import load_or_compile
from tdint.kernels.compiling import Kernel
from tdint.methods.catalogue import catalogue, chosen, parse
from tdint.methods.method import Integrator
from tdint.model.definition import Force, Model, simple_model
from tdint.model.status import DONE
from tdint.model.story import simple_story
from tdint.model.story_laws import Law
from tdint.response.runs import error_estimate
from tdint.response.runs.case import Case
from tdint.response.runs.compiled_steps import LINEAR_OSCILLATORS, kernels
from tdint.response.runs.history import History
from tdint.response.runs.outcome import DIVERGED, NOT_CONVERGED, UNSTABLE, FailedRun
from tdint.response.runs.prepared import PreparedBuilding
from tdint.response.runs.run import run
from tdint.tabular import Progress, ResultList, progress_reporter

# ---- Definitions of the problems: building, load, time steps, judged quantity, bounds, reference
#
# All values are in SI units. Energies are the sum of the kinetic energy and the energy stored in
# the stories, both in closed form.

FINER = 64
"""Number of time steps of the reference solution of the softening oscillator per time step of the
method under test. The reference solution is computed by `gauss4`."""


@dataclass(frozen=True)
class Fault:
    """Criterion for a failure of a method on a problem: the judged quantity is outside its bounds.

    The judged quantity is an energy ratio or an error (`HardProblem.by_energy`).

    Attributes
    ----------
    name : str
        Name of the failure in the verdict, such as `gains energy`.
    low, high : float
        Inclusive bounds of acceptable values, in the unit of the judged quantity.
    """

    name: str
    low: float = -math.inf
    high: float = math.inf

    def is_outside(self, value: float) -> bool:
        """Return True if the judged quantity `value` is nan or outside the bounds."""
        return not self.low <= value <= self.high


@dataclass(frozen=True)
class HardProblem:
    """Problem with a known solution, which some methods fail to solve.

    Attributes
    ----------
    name, about : str
        Name on the command line, and description in a sentence.
    steps : tuple of (float, int)
        Time steps (s), each with the number of steps.
    energy : callable
        Function of a history that returns the energy at its times, J, shape (steps + 1,).
    energy_scale : float
        Maximum energy of the exact motion, J; the initial energy for free vibration.
    error_of : str
        Description of the error that `error` returns, with its unit.
    error : callable
        Function of a history that returns the error as a number.
    by_energy : bool
        True if the judged quantity is the energy divided by `energy_scale`, False if it is the
        error. The default is False.
    """

    name: str
    about: str
    model: Model
    steps: tuple[tuple[float, int], ...]
    energy: Callable[[History], Array]
    energy_scale: float
    error_of: str
    error: Callable[[History], float]
    faults: tuple[Fault, ...]
    by_energy: bool = False


def _energy_bounds(tolerance: float) -> tuple[Fault, Fault]:
    """Return the failure criteria of a free vibration without damping.

    The ratio of the energy to the initial energy must be 1 within `tolerance`.
    """
    return Fault("gains energy", high=1.0 + tolerance), Fault("loses energy", low=1.0 - tolerance)


def _second_half(history: History, values: Array) -> float:
    """Return the maximum absolute value over the second half of the time steps.

    `values` contains the values at the initial time and at the end of each time step.
    """
    steps = len(history.time) - 1
    return max_absolute(values[steps // 2 + 1 :])


def _kinetic(history: History, masses: tuple[float, ...]) -> Array:
    """Return the kinetic energy of all floors at each time, J, shape (steps + 1,).

    `masses` is the mass of each floor, kg.
    """
    return np.asarray(0.5 * history.velocity**2 @ np.array(masses))


# ---- Hardening oscillator: u'' + 100 u (1 + 10 u^2) = 0 from u = 1.5

_SPRING, _CUBIC = 100.0, 1000.0  # N/m and N/m^3; coefficients of the force 100 u + 1000 u^3
_HARDENING_AMPLITUDE = 1.5  # m; initial displacement


def hardening_motion(time: Array) -> Array:
    """Return the exact displacement of the hardening oscillator, m, shape (k,).

    The oscillator has unit mass and the restoring force a u + b u^3 (Duffing's equation). Released
    at u = U, its displacement is u = U cn(w t | m) with w^2 = a + b U^2 and m = b U^2 / (2 w^2),
    where cn is Jacobi's function (Abramowitz and Stegun 1964, ch. 16).
    """
    from scipy.special import ellipj

    squared_frequency = _SPRING + _CUBIC * _HARDENING_AMPLITUDE**2
    parameter = _CUBIC * _HARDENING_AMPLITUDE**2 / (2.0 * squared_frequency)
    _, cn, _, _ = ellipj(math.sqrt(squared_frequency) * time, parameter)
    return np.asarray(_HARDENING_AMPLITUDE * cn)


def _hardening() -> HardProblem:
    """Define the problem of the hardening oscillator, which judges whether a method conserves its
    energy. The exact motion is known."""

    def energy(history: History) -> Array:
        """Return the kinetic energy and the energy of the spring at each time, J."""
        u = history.displacement[:, 0]
        return _kinetic(history, (1.0,)) + 0.5 * _SPRING * u**2 + 0.25 * _CUBIC * u**4

    def error(history: History) -> float:
        """Return the maximum displacement error divided by the amplitude."""
        errors = history.displacement[:, 0] - hardening_motion(history.time)
        return max_absolute(errors) / _HARDENING_AMPLITUDE

    return HardProblem(
        name="hardening",
        about="u'' + 100 u (1 + 10 u^2) = 0 from u = 1.5, 10 s: the tangent stiffness changes "
        "68-fold in each swing",
        model=simple_model(
            "hardening oscillator",
            [simple_story(1.0, Law("polynomial", (_SPRING, 0.0, _CUBIC)))],
            displacement=(_HARDENING_AMPLITUDE,),
        ),
        steps=((0.005, 2000), (0.02, 500), (0.05, 200)),
        energy=energy,
        energy_scale=0.5 * _SPRING * _HARDENING_AMPLITUDE**2
        + 0.25 * _CUBIC * _HARDENING_AMPLITUDE**4,
        error_of="largest displacement error over the amplitude",
        error=error,
        faults=_energy_bounds(0.02),
        by_energy=True,
    )


# ---- Softening oscillator: u'' + 100 tanh u = 0 from u = 4

# Initial displacement, m, and limit of the restoring force, N
_SOFTENING_AMPLITUDE, _STRENGTH = 4.0, 100.0


def _log_cosh(u: Array) -> Array:
    """Return ln cosh u, the integral of tanh u, without overflow of cosh for large u."""
    return np.abs(u) + np.log1p(np.exp(-2.0 * np.abs(u))) - math.log(2.0)


def _softening_model() -> Model:
    """Return the softening oscillator of mass 1 kg, released at its initial displacement."""
    story = simple_story(1.0, Law("tanh", (_STRENGTH,)), stiffness=_STRENGTH)
    return simple_model("softening oscillator", [story], displacement=(_SOFTENING_AMPLITUDE,))


@cache
def softening_motion(dt: float, steps: int) -> Array:
    """Compute the reference displacement of the softening oscillator by the method gauss4 with time
    steps that are 64 times smaller.

    Parameters
    ----------
    dt : float
        Time step of the solution that is compared with the reference, s.

    Returns
    -------
    ndarray, shape (steps + 1,)
        Displacement at the initial time and at the end of each time step, m.
    """
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
    """Define the problem of the softening oscillator, which judges whether a method conserves its
    energy. The exact energy is known."""

    def energy(history: History) -> Array:
        """Return the kinetic energy and the energy of the spring at each time, J."""
        return _kinetic(history, (1.0,)) + _STRENGTH * _log_cosh(history.displacement[:, 0])

    def error(history: History) -> float:
        """Return the maximum displacement error divided by the amplitude."""
        dt, steps = float(history.time[1]), len(history.time) - 1
        reference = softening_motion(dt, steps)
        return max_absolute(history.displacement[:, 0] - reference) / _SOFTENING_AMPLITUDE

    return HardProblem(
        name="softening",
        about="u'' + 100 tanh u = 0 from u = 4, 60 s: the tangent stiffness is almost zero "
        "twice in each cycle",
        model=_softening_model(),
        steps=((0.05, 1200), (0.1, 600)),
        energy=energy,
        energy_scale=float(_STRENGTH * _log_cosh(np.array(_SOFTENING_AMPLITUDE))),
        error_of="largest displacement error over the amplitude",
        error=error,
        faults=_energy_bounds(0.01),
        by_energy=True,
    )


# ---- Stiff and soft node of Bathe and Noh: a spring of 1e7 N/m transmits the motion sin 1.2 t of
# the base node

# Stiffness of the stiff spring, N/m, and circular frequency of the motion of the base, rad/s
_STIFF, _DRIVE = 1e7, 1.2
# Amplitudes (m) of the exact motion of the soft node: free vibration at 1 rad/s, and forced
# vibration at the frequency of the base.
_NATURAL_AMPLITUDE, _DRIVEN_AMPLITUDE = 1.0 / (1.0 - _DRIVE**2) * -_DRIVE, 1.0 / (1.0 - _DRIVE**2)


def soft_node_motion(time: Array) -> Array:
    """Return the displacement of the soft node for infinite stiffness of the stiff spring, m.

    It is the solution of u'' + u = sin 1.2 t from rest, shape (k,).
    """
    return _NATURAL_AMPLITUDE * np.sin(time) + _DRIVEN_AMPLITUDE * np.sin(_DRIVE * time)


def _bathe_noh() -> tuple[HardProblem, HardProblem]:
    """Define the two problems of Bathe and Noh (2012), where a stiff spring (k1 = 1e7) transmits a
    harmonic base motion to a building of two floors. The reference is the exact motion for an
    infinite stiffness of the spring.

    The first problem judges the acceleration of floor 1 (the stiff node), where a method without
    numerical damping oscillates. The second problem judges the displacement of floor 2 (the soft
    node).
    """

    def energy(history: History) -> Array:
        """Return the kinetic energy and the energy of both springs at each time, J."""
        stretch = history.displacement[:, 0] - np.sin(_DRIVE * history.time)
        return (
            _kinetic(history, (1.0, 1.0))
            + 0.5 * _STIFF * stretch**2
            + 0.5 * history.drift[:, 1] ** 2
        )

    def acceleration_error(history: History) -> float:
        """Return the maximum error in the second half of the acceleration of floor 1, m/s^2."""
        exact = -(_DRIVE**2) * np.sin(_DRIVE * history.time)
        return _second_half(history, history.absolute_acceleration[:, 0] - exact)

    def displacement_error(history: History) -> float:
        """Return the maximum error of the displacement of floor 2, m."""
        return max_absolute(history.displacement[:, 1] - soft_node_motion(history.time))

    # The exact energy is the energy for infinite stiffness. Its maximum is computed from a dense
    # sample of times.
    time = np.linspace(0.0, 10.0, 10001)
    base_velocity = _DRIVE * np.cos(_DRIVE * time)
    soft_node_velocity = _NATURAL_AMPLITUDE * np.cos(time) + _DRIVEN_AMPLITUDE * base_velocity
    drift = soft_node_motion(time) - np.sin(_DRIVE * time)
    about = (
        "masses 1 and 1, springs 1e7 and 1, from rest, the base moves by sin 1.2 t, 10 s: the {} "
        "node"
    )
    stiff = HardProblem(
        name="stiff-node",
        about=about.format("stiff"),
        model=simple_model(
            "stiff and soft node",
            [simple_story(1.0, stiffness=_STIFF), simple_story(1.0, stiffness=1.0)],
            forces=[Force(1, 0.0, _STIFF, _DRIVE)],
        ),
        steps=((0.2618, 38),),
        energy=energy,
        energy_scale=float(np.max(0.5 * (base_velocity**2 + soft_node_velocity**2 + drift**2))),
        error_of="largest acceleration error of floor 1 in the second half, m/s^2",
        error=acceleration_error,
        faults=(Fault("rings", high=1.0),),
    )
    soft = replace(
        stiff,
        name="soft-node",
        about=about.format("soft"),
        error_of="maximum displacement error of floor 2, m",
        error=displacement_error,
        faults=(Fault("inaccurate", high=0.1),),
    )
    return stiff, soft


# ---- Stiff pair: two halves of a mass with the frequency of a pendulum, sqrt(9.81) rad/s,
# connected by a spring with the frequency 1e4 rad/s

# Stiffness below the masses, N/m; each mass, kg; stiffness of the spring between the masses, N/m
_PENDULUM_STIFFNESS, _HALF_MASS, _JOINT_STIFFNESS = 9.81, 0.5, 2.5e7


def _stiff_pair() -> HardProblem:
    """Define the problem of two masses connected by a stiff spring, where methods without
    numerical damping may oscillate at the frequency of the spring.

    It is modeled on the stiff pendulum of code_aster V5.02.100. The reference is the exact motion
    for a rigid joint.
    """
    # If both masses move together, the force in the joint is proportional to their displacement.
    joint_force = _HALF_MASS * _PENDULUM_STIFFNESS  # N, at a displacement of 1 m

    def energy(history: History) -> Array:
        """Return the kinetic energy and the energy of both springs at each time, J."""
        springs = history.drift**2 @ np.array([_PENDULUM_STIFFNESS, _JOINT_STIFFNESS])
        return np.asarray(_kinetic(history, (_HALF_MASS, _HALF_MASS)) + 0.5 * springs)

    def error(history: History) -> float:
        """Return the maximum error of the force in the joint in the second half of the motion,
        divided by the amplitude of the force.

        The exact force is `joint_force` times the displacement in m, which is computed by the
        method.
        """
        return _second_half(history, history.shear[:, 1] / joint_force - history.displacement[:, 0])

    return HardProblem(
        name="stiff-pair",
        about="masses 0.5 and 0.5, springs 9.81 and 2.5e7, released from a static roof "
        "displacement u = 1, 10 s: frequencies 3.13 and 1e4 rad/s, as a pendulum of 1 kg and 1 "
        "m on a rod with EA = 1e8 N",
        model=simple_model(
            "stiff pair",
            [
                simple_story(_HALF_MASS, stiffness=_PENDULUM_STIFFNESS),
                simple_story(_HALF_MASS, stiffness=_JOINT_STIFFNESS),
            ],
            displacement=(1.0, 1.0 + _PENDULUM_STIFFNESS / _JOINT_STIFFNESS),
        ),
        steps=((0.05, 200),),
        energy=energy,
        energy_scale=0.5 * _PENDULUM_STIFFNESS + 0.5 * _PENDULUM_STIFFNESS**2 / _JOINT_STIFFNESS,
        error_of="largest error in the second half of the upper story's force for the "
        "displacement, over its amplitude",
        error=error,
        faults=(Fault("rings", high=0.1),),
    )


# ---- Linear oscillators of omega = 1 rad/s, for which dt equals omega dt


def _relative_amplitudes(history: History) -> Array:
    """Return the amplitude of an oscillator with omega = 1 rad/s at each time, divided by the exact
    amplitude, shape (steps + 1,).

    The amplitude is the larger of the absolute displacement and the absolute velocity / omega. The
    exact amplitude follows from the initial displacement and velocity.
    """
    sizes = np.maximum(np.abs(history.displacement[:, 0]), np.abs(history.velocity[:, 0]))
    return sizes / math.hypot(history.displacement[0, 0], history.velocity[0, 0])


def _oscillator_energy(history: History) -> Array:
    """Return the energy at each time step of an oscillator of unit mass and stiffness, J."""
    return 0.5 * (history.displacement[:, 0] ** 2 + history.velocity[:, 0] ** 2)


def _oscillator(start: tuple[float, float]) -> Model:
    """Return an oscillator of unit mass and stiffness, which has omega = 1 rad/s.

    `start` is the initial displacement (m) and initial velocity (m/s).
    """
    story = simple_story(1.0, stiffness=1.0)
    return simple_model("oscillator", [story], displacement=start[:1], velocity=start[1:])


def _limit(name: str, description: str, *dts: float) -> HardProblem:
    """Define a problem where a method fails if its amplitude grows during 200 time steps.

    `*dts` contains the time steps, s, usually on both sides of a stability limit.
    """

    def growth(history: History) -> float:
        """Return the relative growth of the amplitude from the first half of the time steps to the
        second half; 0 if it does not grow."""
        amplitudes = _relative_amplitudes(history)
        half = amplitudes.size // 2
        growth = np.max(amplitudes[half + 1 :]) / np.max(amplitudes[: half + 1])
        return max(0.0, float(growth) - 1.0)

    return HardProblem(
        name=name,
        about=f"oscillator of 1 rad/s from u = 1, 200 steps, {description}",
        model=_oscillator((1.0, 0.0)),
        steps=tuple((dt, 200) for dt in dts),
        energy=_oscillator_energy,
        energy_scale=0.5,
        error_of="relative growth of the amplitude from the first half of the steps to the "
        "second half",
        error=growth,
        faults=(Fault("grows", high=0.01),),
    )


def _overshoot(name: str, start: tuple[float, float]) -> HardProblem:
    """Define a problem where a method fails if its first ten large time steps exceed the exact
    amplitude by more than 1 %, from an initial displacement (m) and velocity (m/s). `name` is the
    quantity with the initial value 1, `displacement` or `velocity`. Source: Hilber and Hughes
    (1978).
    """
    return HardProblem(
        name=f"overshoot-{name}",
        about="oscillator of 1 rad/s, the first ten steps with dt/T = 10, from an initial "
        f"{name} of 1",
        model=_oscillator(start),
        steps=((20.0 * math.pi, 10),),
        energy=_oscillator_energy,
        energy_scale=0.5,
        error_of="amplitude beyond the exact one, over the exact one",
        error=lambda history: max(0.0, float(np.max(_relative_amplitudes(history))) - 1.0),
        faults=(Fault("overshoots", high=0.01),),
    )


@cache
def problems() -> Mapping[str, HardProblem]:
    """Return all problems by name, in the order of the output."""
    every = (
        _hardening(),
        _softening(),
        *_bathe_noh(),
        _stiff_pair(),
        # Stability limits: Hughes (1987), sect. 9.1
        _limit(
            "limit-2",
            "around the stability limit of the central difference, omega dt = 2",
            1.99,
            2.01,
        ),
        _limit(
            "limit-sqrt-6",
            "around the stability limit of Fox and Goodwin's method, omega dt = sqrt(6)",
            2.44,
            2.46,
        ),
        _limit(
            "limit-sqrt-12",
            "around the stability limit of linear acceleration, omega dt = sqrt(12)",
            3.45,
            3.48,
        ),
        # The impulse-momentum method of 2022
        _limit(
            "sqrt-12",
            "omega dt = sqrt(12): eqs. 15 to 23 of the impulse method divide by zero",
            math.sqrt(12.0),
        ),
        # Bathe and Wilson (1973)
        _limit("large-step", "omega dt = 100: Wilson's theta below 1.366 is unstable", 100.0),
        _overshoot("displacement", (1.0, 0.0)),
        _overshoot("velocity", (0.0, 1.0)),
    )
    return {problem.name: problem for problem in every}


# ---- Trials: each method integrates each problem, and the result is judged

PASS = "pass"
BLOWS_UP = "blows up"
NO_CONVERGENCE = "does not converge"
REFUSED = "refused"

_VERDICT_OF_STATUS = {DIVERGED: BLOWS_UP, NOT_CONVERGED: NO_CONVERGENCE}


@dataclass(frozen=True)
class Trial:
    """Result of a method for a problem with one time step.

    Attributes
    ----------
    problem : str
        Name of the problem.
    method : str
        Method specification.
    dt : float
        Time step, s.
    energy_ratio_min, energy_ratio_max : float
        Minimum and maximum energy divided by the maximum energy of the exact motion; nan for an
        incomplete run. The minimum is also nan if the motion starts from rest.
    error, error_of : float, str
        Error of the problem and its description; the error is nan for an incomplete run.
    outcome : str
        Status of `tdint run`; `refused` if the method cannot integrate the building. The other
        attributes are results with --allow-unstable.
    verdict : str
        `pass`, the name of the fault, or the type of failure.
    time, steps : float, int
        Last time reached (s), and number of completed time steps.
    measure : float
        Judged quantity: the energy ratio farthest from 1 if the problem judges the energy,
        otherwise the error; nan for an incomplete run.
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
    """Return all methods with their default parameters and with their `variants`. A method with
    parameters is omitted if its defaults equal another method, as for `newmark`."""
    result: list[Integrator] = []
    for name, method in catalogue().items():
        integrator = parse(name)
        if not (method.parameters and _equals_method_without_parameters(integrator)):
            result.append(integrator)
        result += [parse(f"{name}:{values}") for values in method.variants]
    return result


def _equals_method_without_parameters(integrator: Integrator) -> bool:
    """Return True if a method without parameters has the same step and coefficients."""
    own = integrator.method.coefficients(*integrator.values)
    return any(
        method.family is integrator.family
        and not method.parameters
        and method.coefficients() == own
        for method in catalogue().values()
    )


def find_problems(names: Sequence[str]) -> list[HardProblem]:
    """Return problems by name without duplicates; all problems if `names` is empty.

    Raises
    ------
    UsageError
        A name is unknown.
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
    """Test methods on difficult problems with known solutions.

    Parameters
    ----------
    methods : str or iterable of str, optional
        Specifications of methods. The default is `usual_methods`.
    problems : sequence of str
        Names of problems. The default is all problems.
    progress : bool or callable
        True shows a progress bar (tqdm) on a terminal or in a notebook. A callable is called with
        the number of completed pairs of problem and method, and their total number. The default is
        False.

    Returns
    -------
    ResultList of Trial
        One trial per problem, method and time step.

    Raises
    ------
    UsageError
        A method or problem is unknown.
    """
    integrators = usual_methods() if methods is None else chosen(methods)
    hard = find_problems(problems)
    pairs = [(problem, method) for problem in hard for method in integrators]
    compile_for(integrators, hard)
    trials: list[Trial] = []
    with progress_reporter(progress, len(pairs), "trial") as report_progress:
        for done, (problem, method) in enumerate(pairs, start=1):
            trials += attempt(method, problem)
            report_progress(done, len(pairs))
    return ResultList(trials)


def compile_for(integrators: Sequence[Integrator], hard: Iterable[HardProblem]) -> None:
    """Load the compiled time loops of all trials; loops that are not in the cache are compiled.

    They are compiled together, so that progress is reported one time.
    """
    needed: list[tuple[Kernel, Variant]] = []
    for problem in hard:
        prepared = PreparedBuilding.of(problem.model)
        # The softening oscillator requires gauss4 for its reference solution. For simplicity, it is
        # loaded for all nonlinear problems.
        reference = [] if prepared.building.linear else [parse("gauss4")]
        for integrator in [*integrators, *reference]:
            if not integrator.family.linear_only or prepared.building.linear:
                needed += kernels(integrator, prepared.variant)
                # The stability of a time step is checked with linear oscillators.
                if integrator.stability_limit < math.inf:
                    needed.append((integrator.family.step, LINEAR_OSCILLATORS))
    load_or_compile(list(dict.fromkeys(needed)))


def attempt(integrator: Integrator, problem: HardProblem) -> list[Trial]:
    """Integrate a problem by a method with each of the time steps of the problem.

    Returns
    -------
    list of Trial
        Result and verdict for each time step of the problem.
    """
    return [_attempt(integrator, problem, dt, steps) for dt, steps in problem.steps]


def _attempt(integrator: Integrator, problem: HardProblem, dt: float, count: int) -> Trial:
    """Integrate a problem by a method with one time step (s), and judge the result.

    The outcome is the status of a usual run, which refuses an unstable time step. If it is not
    `DONE`, the problem is integrated again with unstable steps and gains of energy allowed. All
    other results (`verdict`, time, steps, ratios, error) belong to the last integration.
    """
    # A method for linear buildings cannot integrate a nonlinear problem, and is not run.
    trial = Trial(problem.name, integrator.label, dt, REFUSED, REFUSED, problem.error_of)
    case = Case(problem.model, PreparedBuilding.of(problem.model), None, integrator)
    if integrator.family.linear_only and not case.building.linear:
        return trial
    steps = case.steps(dt, dt * count)
    # A run with an unstable time step ends with an error that states the largest stable time step.
    # Computing this step needs more time than most runs. The stability is therefore checked here,
    # and no run with an unstable step is started.
    outcome = UNSTABLE
    if case.prepared.instability(integrator, dt) is None:
        ended = error_estimate.attempt(case, steps, history=True)
        outcome = ended.status if isinstance(ended, FailedRun) else DONE
    if outcome != DONE:
        ended = error_estimate.attempt(replace(case, allow_unstable=True), steps, history=True)
    if isinstance(ended, FailedRun):
        completed = round(ended.time / dt)
        verdict = _VERDICT_OF_STATUS[ended.status]
        return replace(trial, outcome=outcome, verdict=verdict, time=ended.time, steps=completed)
    history = ended.history
    assert history is not None
    ratios = problem.energy(history) / problem.energy_scale
    min_ratio, max_ratio = float(np.min(ratios)), float(np.max(ratios))
    error = problem.error(history)
    # Select the ratio that is farther from 1 on a logarithmic scale. This is the minimum if
    # 1 / min > max. (The ratios are judged only for motions that start with the ratio 1.)
    worst_ratio = min_ratio if min_ratio * max_ratio < 1.0 else max_ratio
    measure = worst_ratio if problem.by_energy else error
    return replace(
        trial,
        outcome=outcome,
        # From rest, the initial energy is 0, and the minimum ratio is not informative.
        energy_ratio_min=min_ratio if ratios[0] > 0.0 else math.nan,
        energy_ratio_max=max_ratio,
        error=error,
        verdict=next((fault.name for fault in problem.faults if fault.is_outside(measure)), PASS),
        time=float(history.time[-1]),
        steps=len(history.time) - 1,
        measure=measure,
    )
