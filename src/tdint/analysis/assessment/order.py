"""Observed order of a method: errors of its compiled march on an oscillator of period 1 s over
halved steps."""

from __future__ import annotations

import math
import sys
import traceback
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cache
from itertools import pairwise
from typing import Any

import numpy as np

from tdint.analysis.assessment.stability import critical_step, false_limit, stability
from tdint.analysis.given import between
from tdint.analysis.run.case import energy_of
from tdint.analysis.run.prepared import PreparedBuilding
from tdint.analysis.run.workspace import (
    HALVINGS,
    VALIDATED_STEPS,
    Steps,
    Workspace,
    find_instability,
    shifts,
)
from tdint.analysis.static import cyclic_test
from tdint.arrays import Array
from tdint.errors import AnalysisError, TdintError, UsageError
from tdint.kernels import layout as rows
from tdint.kernels.stepping import Scene
from tdint.kernels.time_loop.loop import integrate
from tdint.kernels.time_loop.observer import initialize_laws, sum_law_energies, update_shear_peaks
from tdint.methods.catalogue import parse
from tdint.methods.exact import oscillator
from tdint.methods.method import Integrator
from tdint.model.building import Building, assemble, force_table
from tdint.model.definition import LAWS, Force, Law, Model, simple_model, simple_story
from tdint.model.law_checks import path_faults
from tdint.tabular import Tabular, each_of

LOADS = ("free", "harmonic", "record")

STORY_LAWS = {
    "linear": Law("linear", ()),
    "polynomial": Law("polynomial", ((2.0 * math.pi) ** 2, 0.0, 0.5 * (2.0 * math.pi) ** 2)),
}
"""Laws of the oscillator, unit mass and period 1 s: linear, and hardening u + u^3 / 2."""

COARSEST = 0.02
"""The largest step, s."""

OBSERVED_HALVINGS = 4
"""How often it is halved."""

_OMEGA = 2.0 * math.pi
_XI = 0.02  # damping ratio: light, so that orders are seen and not damped away
_START = (0.7, 2.0)  # u (m) and v (m/s)
_AMPLITUDE = 20.0  # of the harmonic force, N
_SAMPLES = 200  # coarsest steps
_HIGHEST = 10.0  # frequency in a record of which several samples go into a step, Hz
_ROUNDING = 3e-12  # errors below this, over the largest value, are rounding
_ENDS = (
    40,
    90,
    130,
    170,
    200,
)  # coarse steps at whose ends the method's own acceleration is looked at


@dataclass(frozen=True, repr=False)
class ObservedOrder(Tabular):
    """Errors over steps and the orders that follow from them.

    Attributes
    ----------
    steps : ndarray, shape (k,)
        Time steps, s, falling.
    displacement, velocity, acceleration : ndarray, shape (k,)
        Largest errors over the coarsest steps, over the largest value; acceleration from
        equilibrium, as it is reported.
    algorithmic_acceleration : ndarray, shape (k,)
        The same of the acceleration that the method carries from step to step; nan for one that
        carries none.
    """

    method: str
    load: str
    law: str
    frequency_ratio: float
    steps: Array
    displacement: Array
    velocity: Array
    acceleration: Array
    algorithmic_acceleration: Array

    def _headline(self) -> str:
        order = self.order("displacement")
        return (
            f"of {self.method}: {order:.3g} of the displacement, load {self.load}, law {self.law}"
        )

    def order(self, quantity: str) -> float:
        """Slope of the error over the step, by regression over the finest three errors that are not
        rounding.

        `quantity` names one of the errors. nan where fewer than two are clear of rounding.
        """
        errors = getattr(self, quantity)
        clear = np.flatnonzero(errors > _ROUNDING)[-3:]
        if clear.size < 2:
            return math.nan
        return float(np.polyfit(np.log(self.steps[clear]), np.log(errors[clear]), 1)[0])


@dataclass(frozen=True)
class OrderProblem:
    """An oscillator, its load and its exact motion, to be solved by any number of methods.

    Attributes
    ----------
    load, law : str
        One of `LOADS` and of `STORY_LAWS`.
    frequency_ratio : float
        Circular frequency of the load over that of the oscillator; nan for a load without a
        frequency.
    exact : ndarray, shape (3, samples)
        Displacement (m), velocity (m/s) and acceleration (m/s^2) at the ends of the coarsest steps.
    stride : int
        Sampling intervals of a record in the coarsest step.
    """

    load: str
    law: str
    frequency_ratio: float
    prepared: PreparedBuilding
    ground: Array
    exact: Array
    stride: int = 1

    @property
    def building(self) -> Building:
        """The oscillator as arrays."""
        return self.prepared.building


@each_of
def order(
    method: Integrator | str,
    *,
    load: str = "harmonic",
    law: str = "linear",
    frequency_ratio: float = 0.5,
    stride: int = 1,
) -> ObservedOrder:
    """Measure the order of a method: errors of an oscillator over halved steps.

    Parameters
    ----------
    method : Integrator or str
        The method, or its specification; of a list or tuple there are `ResultList` results.
    load, law, frequency_ratio, stride
        The oscillator and its load, as `order_problem` has them.

    Returns
    -------
    ObservedOrder
        Errors of displacement, velocity and acceleration at each step, and the orders that they
        tell.

    Raises
    ------
    UsageError
        An unknown method, load or law; a stride that is none or without a record.
    AnalysisError
        The method is for linear buildings and the law is not linear, or it failed.
    """
    return observed_order(
        method if isinstance(method, Integrator) else parse(method),
        order_problem(load, law, frequency_ratio, stride),
    )


def order_problem(
    load: str = "harmonic", law: str = "linear", frequency_ratio: float = 0.5, stride: int = 1
) -> OrderProblem:
    """Set an oscillator of period 1 s, damping ratio 0.02, from a displacement and a velocity, and
    solve it over 4 s.

    Parameters
    ----------
    load : str
        `free` vibration, a `harmonic` force 20 cos(r omega t) N on 1 kg, or a `record`: a ground
        motion that is linear between samples 0.02 s apart.
    law : str
        A key of `STORY_LAWS`.
    frequency_ratio : float
        r, circular frequency of the load over that of the oscillator.
    stride : int
        Samples of the record are so many times closer than the coarsest step: a power of 2.

    Raises
    ------
    UsageError
        An unknown load or law, a frequency ratio out of range, a stride that is none or without a
        record.
    """
    if not isinstance(stride, int | np.integer) or stride < 1 or stride & (stride - 1):
        raise UsageError(
            f"the stride is a power of 2, so that halved steps are whole samples, got {stride}"
        )
    if stride > 1 and load != "record":
        raise UsageError(f"a stride is about the samples of a record; the load {load!r} has none")
    if load not in LOADS or law not in STORY_LAWS:
        names = f"loads {', '.join(LOADS)}; laws {', '.join(STORY_LAWS)}"
        raise UsageError(f"no order problem {load!r} with {law!r}: {names}")
    # With 10 there are five coarsest steps to a period of the load.
    ratio = (
        between(frequency_ratio, "frequency_ratio", 0.01, 10.0) if load == "harmonic" else math.nan
    )
    applied = (Force(1, _AMPLITUDE, 0.0, ratio * _OMEGA),) if load == "harmonic" else ()
    story = simple_story(1.0, STORY_LAWS[law], stiffness=_OMEGA**2, dashpot=2.0 * _XI * _OMEGA)
    building = assemble(simple_model("oscillator", [story]))
    ground = _sampled_motion(stride) if load == "record" else np.zeros(1)
    if load == "record" and law == "linear":
        # Exact motion of the linear oscillator at the samples.
        h = COARSEST / stride
        step = oscillator(np.array([_OMEGA * h]), np.array([_XI]))[0]
        states = np.empty((2, ground.size))
        states[:, 0] = _START[0], h * _START[1]
        for j in range(ground.size - 1):
            states[:, j + 1] = step @ np.concatenate([states[:, j], -h * h * ground[j : j + 2]])
        u, v = states[0], states[1] / h
        exact = np.array([u, v, -ground - 2.0 * _XI * _OMEGA * v - _OMEGA**2 * u])
    else:
        exact = _by_dop853(load, law, ratio, ground, stride)
    displacement, velocity = _START
    prepared = PreparedBuilding(building, force_table(applied), displacement, velocity)
    return OrderProblem(load, law, ratio, prepared, ground, exact[:, ::stride], stride)


def observed_order(
    integrator: Integrator, problem: OrderProblem, halvings: int = OBSERVED_HALVINGS
) -> ObservedOrder:
    """Measure the order of a method on one problem, with the steps 0.02 s / 2^j for j = 0 ..
    halvings.

    Raises
    ------
    UsageError
        A nonlinear law for a method that integrates linear buildings only.
    AnalysisError
        The method is unstable or does not converge.
    """
    if integrator.family.linear_only and not problem.building.linear:
        raise UsageError(f"{integrator.label} integrates linear buildings only")
    if find_instability(integrator, np.array([_OMEGA]), np.array([_XI]), COARSEST):
        raise AnalysisError(f"{integrator.label} is unstable at dt {COARSEST} s")
    exact, label = problem.exact, integrator.label
    largest = np.max(np.abs(exact), axis=1)
    # The method's own acceleration is compared where it has one; over several samples it is that
    # under another motion.
    carries = rows.ACCELERATION in integrator.family.memory and problem.stride == 1
    all_parts = 2 ** np.arange(halvings + 1)
    errors = []
    for parts in map(int, all_parts):
        # Relative to the ground, at the coarse steps.
        history = _march(integrator, problem, parts, _SAMPLES)[1][::parts]
        motion = history[:, 1:4].T
        motion[2] -= history[:, 0]
        carried_error = math.nan
        if carries:
            carried_error = max(
                abs(_march(integrator, problem, parts, end)[0] - exact[2, end]) for end in _ENDS
            )
        errors.append(
            [*np.max(np.abs(motion - exact), axis=1) / largest, carried_error / largest[2]]
        )
    return ObservedOrder(
        label,
        problem.load,
        problem.law,
        problem.frequency_ratio,
        COARSEST / all_parts,
        *np.array(errors).T,
    )


def _march(
    integrator: Integrator, problem: OrderProblem, parts: int, count: int
) -> tuple[float, Array]:
    """The method's own acceleration at the end, and the history."""
    within = math.gcd(parts, problem.stride)
    steps = Steps(COARSEST / parts, parts * count, parts // within, problem.stride // within)
    marched = problem.prepared.integrate(
        integrator, steps, problem.ground, history_rows=parts * count
    )
    if marched.code < 0:
        raise AnalysisError(f"{integrator.label} failed with dt {steps.h:.6g} s")
    return float(marched.space.state[rows.ACCELERATION, 0]), marched.space.history


def _sampled_motion(stride: int) -> Array:
    """Ground acceleration at samples 0.02 s / stride apart, m/s^2: seeded noise; where steps go
    over several samples, noise up to `_HIGHEST` as ground motions have it. (Of white noise each
    step leaves out a second moment as large as the two that it takes, which leaves orders of 2.6
    and less.)"""
    generator = np.random.default_rng(20221120)
    if stride == 1:
        return 5.0 * generator.standard_normal(_SAMPLES + 1)
    times = COARSEST / stride * np.arange(_SAMPLES * stride + 1)
    frequencies = np.linspace(0.5, _HIGHEST, 40)
    phases = 2.0 * math.pi * (np.outer(times, frequencies) + generator.uniform(size=40))
    return np.asarray(np.sin(phases) @ generator.standard_normal(40))


def _by_dop853(load: str, law: str, ratio: float, ground: Array, stride: int) -> Array:
    """Motion at the samples by SciPy's DOP853 at a tolerance of 1e-13, restarted at the samples of
    a record."""
    from scipy.integrate import solve_ivp

    coefficients = STORY_LAWS[law].parameters or (_OMEGA**2,)
    times = COARSEST / stride * np.arange(_SAMPLES * stride + 1)

    def acceleration(t: float, u: float, v: float) -> float:
        resistance = u * sum(c * u**j for j, c in enumerate(coefficients))
        driving = _AMPLITUDE * math.cos(ratio * _OMEGA * t) if load == "harmonic" else 0.0
        if load == "record":
            driving = -float(np.interp(t, times, ground))
        return driving - 2.0 * _XI * _OMEGA * v - resistance

    # A record has a kink at each sample, at which the order of DOP853 would be lost.
    states = [np.array(_START)]
    for first, end in pairwise(times) if load == "record" else [(times[0], times[-1])]:
        solution = solve_ivp(
            lambda t, y: (y[1], acceleration(t, y[0], y[1])),
            (first, end),
            states[-1],
            method="DOP853",
            t_eval=[end] if load == "record" else times[1:],
            rtol=1e-13,
            atol=1e-14,
        )
        states.extend(solution.y.T)
    u, v = np.array(states).T
    return np.array([u, v, [acceleration(*row) for row in zip(times, u, v, strict=True)]])


# ---- What methods and laws declare of themselves beside what is measured of them: for authors of
# new ones

_ORDER = 0.1
_RADIUS = 1e-3
_FAST = 1e6
"""omega dt that stands for infinity; rounding grows with it."""
_ENERGY = 1e-3


@dataclass(frozen=True)
class MethodCheck:
    """What a method declares, and what its compiled steps show.

    Attributes
    ----------
    integrator : Integrator
        The method with its parameters.
    order : float
        The smaller of the observed orders of displacement and velocity, of a linear oscillator in
        free vibration and under a harmonic force; nan where errors are nothing but rounding.
    limit : float
        Measured largest stable omega dt without damping, inf if there is none up to 100.
    rho_inf : float
        Measured spectral radius at omega dt = 1e6; nan where steps have a limit.
    faults : tuple of str
        What is declared and not so, a line each.
    """

    integrator: Integrator
    order: float
    limit: float
    rho_inf: float
    faults: tuple[str, ...]


def check_method(integrator: Integrator) -> MethodCheck:
    """Measure what a method declares.

    Parameters
    ----------
    integrator : Integrator
        The method; its step is executed in plain Python first, where no row beyond the declared
        ones is written, and then compiled.
    """
    yielding: dict[str, str] = {}
    VALIDATED_STEPS.add(integrator.family.step)  # here, with more than a fault to tell
    try:
        _plain_march("linear", integrator, 1)
        yielding = {} if integrator.family.linear_only else _yielding_faults(integrator)
        observed = [
            observed_order(integrator, order_problem(load)) for load in ("free", "harmonic")
        ]
    except AnalysisError as error:
        told = tuple(yielding.values()) or (str(error),)
        return MethodCheck(integrator, math.nan, math.nan, math.nan, told)
    orders = [
        order_seen.order(quantity)
        for order_seen in observed
        for quantity in ("displacement", "velocity")
    ]
    order = min(
        (order_seen for order_seen in orders if not math.isnan(order_seen)), default=math.nan
    )
    limit = critical_step(integrator)
    with np.errstate(all="ignore"):
        fast = stability(integrator, np.array([_FAST / (2.0 * math.pi)])).spectral_radius
    radius = float(fast[0]) if limit == math.inf else math.nan
    label, faults = integrator.label, []
    if abs(order - integrator.order) > _ORDER:
        faults.append(f"{label}: declares order {integrator.order}, observed is {order:.2f}")
        yielding.pop("order", None)  # it would be told twice
    if told_limit := false_limit(integrator, limit):
        faults.append(told_limit)
    declared = integrator.rho_inf
    if not (math.isnan(declared) and math.isnan(radius)) and not abs(declared - radius) <= _RADIUS:
        measured_words = "none, for steps have a limit" if math.isnan(radius) else f"{radius:.4g}"
        faults.append(
            f"{label}: declares the spectral radius {declared:.4g} at infinity, measured is "
            f"{measured_words}"
        )
    faults += yielding.values()
    return MethodCheck(integrator, order, limit, radius, tuple(faults))


def faults_of_step(integrator: Integrator) -> list[str]:
    """What is wrong with a method's step as plain Python shows it: rows beyond those declared,
    stories that yield, of one law alone, for it is waited for (3 s)."""
    try:
        _plain_march("linear", integrator, 1)
        return (
            []
            if integrator.family.linear_only
            else list(_yielding_faults(integrator, ["bilinear"]).values())
        )
    except AnalysisError as error:
        return [str(error)]


def check_law(model: Model, story: int) -> list[str]:
    """What is wrong with the law of a story as a cyclic test shows it: tangents that are no slopes
    of the force, energy that is not accounted for.

    Parameters
    ----------
    model : Model
        A building.
    story : int
        Counted from 1. It goes through cycles to 0.5, 1 and 2 % of its height; without one, 5, 10
        and 20 mm.
    """
    name = model.stories[story - 1].law.name
    try:
        faults = _branch_faults(model, story)
    except AnalysisError as error:  # compiled code would do the same in silence
        return [str(error)]
    high = model.stories[story - 1].height is not None
    path = cyclic_test(
        model, story, ["0.5%", "1%", "2%"] if high else ["5mm", "10mm", "20mm"], points=2000
    ).path
    # The work done is stored or dissipated.
    step, mean = np.diff(path.drift), 0.5 * (path.shear[1:] + path.shear[:-1])
    done = np.append(0.0, np.cumsum(mean * step))
    kept = path.strain_energy + path.hysteretic_energy
    off = np.max(np.abs(done - (kept - kept[0]))) / np.max(np.abs(done))
    if not off <= _ENERGY:
        faults.append(
            f"law {name}: stored and dissipated energy differ from the work done by {off:.2g} of "
            "the most"
        )
    if np.any(np.diff(path.hysteretic_energy) < -_ENERGY * np.max(np.abs(done))):
        faults.append(f"law {name}: dissipated energy comes back")
    return faults


# ---- Yielding stories, in plain Python: bounds are checked, and nothing is compiled


class _Beyond(IndexError):
    """A row or a column that an array does not have."""


class _Guarded(np.ndarray):
    """An array that names itself where more of it is used than there is: compiled code would write
    beyond its end."""

    name = ""

    @classmethod
    def of(cls, array: Array, name: str) -> _Guarded:
        """A view of an array."""
        view = array.view(cls)
        view.name = name
        return view

    def __getitem__(self, key: Any) -> Any:
        self._check(key)
        return super().__getitem__(key)

    def __setitem__(self, key: Any, value: Any) -> None:
        self._check(key)
        super().__setitem__(key, value)

    def _check(self, key: Any) -> None:
        for axis, place in enumerate(key if isinstance(key, tuple) else (key,)):
            if (
                isinstance(place, int | np.integer)
                and not -self.shape[axis] <= place < self.shape[axis]
            ):
                kind = "row" if axis == 0 else "column"
                raise _Beyond(
                    f"{kind} {place} of {self.name} is used, {self.shape[axis]} are declared"
                )


_YIELDING = {"bilinear": (30.0, 0.05), "tanh": (30.0,), "peak-oriented": (30.0, 0.05, 0.3)}
"""One law that is linear branch by branch, a curved one, one that deteriorates, and their
parameters."""

_H, _SECONDS = 0.01, 1.2  # s; the building has periods of 0.35 and 0.13 s, and yields from 0.1 s on
_KINK_ORDER = 2  # of any method that does not look for the kinks within its steps
# of an order over one halving or two: where kinks lie in their steps changes errors by half
_ROOM = 0.6
_NOTHING = 1e-6  # over the largest drift: an error as small as the reference's own
_BALANCE = (
    1e-2  # of the largest input energy at the finest step, where methods of order 2 are within 1e-3
)


def _plain_march(
    law: str, integrator: Integrator, parts: int, *, fresh_at: int = -1, halve_at: int = -1
) -> Workspace:
    """March in plain Python with steps `_H` / parts.

    Parameters
    ----------
    fresh_at : int
        The step before which scratch is wiped: the march was interrupted and goes on in other
        arrays.
    halve_at : int
        The step that is told not to have converged, so that it is halved.

    Raises
    ------
    AnalysisError
        What the method does wrong: where in its file, and what.
    """
    # Two stories of a law, under no force, let go with a velocity: the ground is given to the
    # march.
    story = simple_story(1.0, Law(law, _YIELDING.get(law, ())), stiffness=1000.0, dashpot=1.0)
    prepared = PreparedBuilding(
        assemble(simple_model(law, [story, story])), velocity=np.array([0.2, 0.3])
    )
    h, count, building = _H / parts, round(_SECONDS / _H) * parts, prepared.building
    space = prepared.arrays(integrator, h, count + 1)
    ground = 9.0 * np.sin(14.0 * np.arange(round(_SECONDS / _H) + 1) * _H)
    guarded = {
        name: _Guarded.of(getattr(space, name), name)
        for name in ("state", "law_state", "scratch", "step_status")
    }
    scene = Scene(
        building.linear_terms, building.modal, building.law_parameters, prepared.forces, space.flags
    )
    scene = Scene(*(_Guarded.of(array, name) for name, array in scene._asdict().items()))
    home = sys.modules.get(integrator.family.step.function.__module__)
    calls = 0

    def step(*arguments: Any) -> int:
        nonlocal calls
        calls += 1
        if calls == halve_at:
            return rows.NOT_CONVERGED
        return int(integrator.family.step.function(*arguments))

    # A march that goes on elsewhere takes along the state, and of the report what counts steps and
    # ground.
    pieces = [(0, fresh_at), (fresh_at, count)] if fresh_at > 0 else [(0, count)]
    for first, last in pieces:
        if first:
            done = space.step_status[rows.STEPS_DONE], space.step_status[rows.STATE_GROUND]
            space.step_status[:], space.scratch[:] = 0.0, 0.0
            space.step_status[[rows.STEPS_DONE, rows.STATE_GROUND]] = done
        with np.errstate(all="ignore"), _faults_in(home, integrator.label):
            code = integrate.function(
                *(
                    step,
                    initialize_laws.function,
                    sum_law_energies.function,
                    update_shear_peaks.function,
                ),
                *(
                    count,
                    first,
                    last,
                    1,
                    0,
                    parts,
                    1,
                    HALVINGS if integrator.family.halvable else 0,
                    h,
                ),
                *(
                    ground,
                    prepared.coefficients(integrator, h),
                    shifts(integrator, h),
                    *scene,
                    *guarded.values(),
                ),
                *(np.zeros(rows.LOAD_SIZE), *space.seen),
            )
        if code < 0:
            words = "does not converge" if code == rows.NOT_CONVERGED else "gives no finite numbers"
            raise AnalysisError(
                f"{integrator.label}: {words} with dt {h:.4g} s, stories of law {law}"
            )
    return space


@contextmanager
def _faults_in(module: Any, name: str) -> Iterator[None]:
    """What plain Python says of a plug-in's code becomes a line with the file and the line in its
    module."""
    try:
        yield
    except TdintError:
        raise
    except Exception as error:
        file = getattr(module, "__file__", None) or ""
        lines = [
            frame.lineno
            for frame in traceback.extract_tb(error.__traceback__)
            if frame.filename == file
        ]
        place = f"{file}:{lines[-1]}" if lines else name
        kind = "" if isinstance(error, _Beyond) else f"{type(error).__name__}: "
        raise AnalysisError(f"{place}: {kind}{error}") from None


@cache
def _true_motion(law: str) -> Array:
    """The displacements of `impulse4` with a step 16 times finer than `_H`: within 1e-7 of the
    largest."""
    return _displacements(_plain_march(law, parse("impulse4"), 16), 16)


def _yielding_faults(integrator: Integrator, laws: Iterable[str] = _YIELDING) -> dict[str, str]:
    """What a method does wrong where stories yield, a line by what it is: each for the law that
    shows it first."""
    label, faults = integrator.label, dict[str, str]()
    for law in laws:
        true = _true_motion(law)
        size = float(np.max(np.abs(true)))
        try:
            spaces = {parts: _plain_march(law, integrator, parts) for parts in (1, 2, 4)}
        except AnalysisError as error:
            faults["failed"] = str(error)
            continue
        errors = {
            parts: _distance(_displacements(space, parts), true) / size
            for parts, space in spaces.items()
        }
        # It comes to the motion of impulse4, with its order, or that of the kinks.
        due = min(integrator.order, 4 if law == "tanh" else _KINK_ORDER)
        rates = (
            (0.5 * math.log2(errors[1] / errors[4]), math.log2(errors[2] / errors[4]))
            if errors[4]
            else (math.inf,)
        )
        if not (max(rates) >= due - _ROOM or errors[4] <= _NOTHING):
            measured = [f"{error:.2g} off at dt {_H / n:g} s" for n, error in errors.items()]
            faults.setdefault(
                "order",
                f"{label}: with stories of law {law} displacements are {', '.join(measured)}, "
                f"of order {max(rates):.1f} where {due:.2g} is due: is each story's state "
                "committed once a step, with the drift at its end?",
            )
        # What is put in is stored, damped or dissipated.
        balance = abs(energy_of(spaces[4].totals).error)
        if not balance <= _BALANCE:
            faults.setdefault(
                "energy",
                f"{label}: with stories of law {law} the energies are {100.0 * balance:.2g} % of "
                f"the largest input out of balance at dt {_H / 4:g} s: is dissipation added up "
                "(`commit`, or `accumulate_dissipation` before "
                "`commit_without_dissipation`)?",
            )
        # The state is all that a method remembers: other scratch, and halved steps, change nothing
        # but rounding.
        fresh = _displacements(_plain_march(law, integrator, 1, fresh_at=60), 1)
        if not _distance(fresh, _displacements(spaces[1], 1)) <= _NOTHING * size:
            faults.setdefault(
                "scratch",
                f"{label}: the result changes if the scratch rows are cleared between steps: "
                "values that a later step needs must be stored in the state",
            )
        if integrator.family.halvable:
            halved = (
                _distance(_displacements(_plain_march(law, integrator, 1, halve_at=60), 1), true)
                / size
            )
            if not halved <= 2.0 * errors[1] + _NOTHING:
                faults.setdefault(
                    "halved",
                    f"{label}: with a halved step displacements are {halved:.2g} off, "
                    f"{errors[1]:.2g} without: its coefficients do not hold for any step "
                    "(`Family.halvable`), or the state is not left right",
                )
    return faults


def _displacements(space: Workspace, parts: int) -> Array:
    """Of all floors at the ends of the steps `_H`."""
    floors = space.state.shape[1] - 1
    return np.asarray(space.history[::parts, 1 : 1 + floors])


def _distance(array: Array, other: Array) -> float:
    return float(np.max(np.abs(np.asarray(array) - other)))


def _branch_faults(model: Model, story: int) -> list[str]:
    """Return what a story's law declares of its branches and curvature and does not do.

    The law is executed in plain Python, with bounds checked (`path_faults`).

    Raises
    ------
    AnalysisError
        Its functions cannot be executed, or use rows that are not declared.
    """
    building, i, law = assemble(model), story - 1, LAWS[model.stories[story - 1].law.name]
    with _faults_in(sys.modules[law.functions.__module__], f"law {law.name}"):
        return path_faults(
            law, building.law_parameters[:, i], float(building.yield_drift[i]), _Guarded.of
        )
