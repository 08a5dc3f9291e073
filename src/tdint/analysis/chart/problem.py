"""What a chart is made of: a building under its load over some time, for any method at any step
that fits."""

from __future__ import annotations

import hashlib
import math
import time
from collections.abc import Iterable
from contextlib import suppress
from dataclasses import astuple, dataclass, fields, replace
from pathlib import Path
from typing import Any

import numpy as np

from tdint.analysis.given import model_record
from tdint.analysis.run.case import Case
from tdint.analysis.run.error_estimate import run_with_error_estimate
from tdint.analysis.run.outcome import Response
from tdint.analysis.run.prepared import PreparedBuilding
from tdint.analysis.run.run import run_case
from tdint.analysis.run.workspace import Steps, choose_steps
from tdint.arrays import Array, cached_property
from tdint.errors import AnalysisError, OutputError, UsageError
from tdint.files import is_file, write_file
from tdint.ground_motion.record import Record
from tdint.kernels import layout as rows
from tdint.kernels.building.sources import code_of, digest_of_all
from tdint.kernels.building.store import folder_name
from tdint.kernels.laws import OURS
from tdint.methods.catalogue import parse
from tdint.methods.method import Integrator
from tdint.model.building import Building, assemble
from tdint.model.definition import (
    CODES,
    Initial,
    ModalDamping,
    Model,
    RayleighCoefficients,
    RayleighRatio,
)
from tdint.system import cache_subfolder


@dataclass(frozen=True)
class FloorMotion:
    """A motion at every `stride`-th sample and its peaks.

    Attributes
    ----------
    displacement, velocity, acceleration : ndarray, shape (rows, n)
        Of the floors: m and m/s relative to the ground, m/s^2 absolute, from equilibrium.
    peak_drift : ndarray, shape (n,)
        Largest absolute drift of each story, m.
    """

    stride: int
    displacement: Array
    velocity: Array
    acceleration: Array
    peak_drift: Array

    @property
    def drift(self) -> Array:
        """Drifts of the stories, m, shape (rows, n)."""
        return np.diff(self.displacement, axis=1, prepend=0.0)

    def every(self, stride: int, row_count: int) -> FloorMotion:
        """The first `row_count` rows of this motion `stride` samples apart."""
        part = slice(0, (row_count - 1) * stride + 1, stride)
        return FloorMotion(
            stride,
            self.displacement[part],
            self.velocity[part],
            self.acceleration[part],
            self.peak_drift,
        )


@dataclass(frozen=True)
class Problem:
    """A building, its load, and the time over which it is integrated.

    Attributes
    ----------
    interval : float
        Time between two samples, s: those of the record, or without one those of the step that
        others divide.
    samples : int
        Intervals to be integrated.
    """

    model: Model
    record: Record | None
    interval: float
    samples: int

    @cached_property
    def prepared(self) -> PreparedBuilding:
        """The building, its forces and its initial state."""
        return PreparedBuilding.of(self.model)

    @property
    def building(self) -> Building:
        """The building as arrays."""
        return self.prepared.building

    @cached_property
    def ground(self) -> Array:
        """Ground acceleration at the samples, m/s^2; a zero without a record."""
        return np.zeros(1) if self.record is None else self.record.acceleration.copy()

    @property
    def forces(self) -> Array:
        """Forces on floors, as `force_table` makes them."""
        return self.prepared.forces

    @property
    def displacement(self) -> Array:
        """At t = 0 relative to the ground, m, shape (n,)."""
        return np.asarray(self.prepared.displacement)

    @property
    def velocity(self) -> Array:
        """At t = 0 relative to the ground, m/s, shape (n,)."""
        return np.asarray(self.prepared.velocity)

    def steps(self, dt: float) -> Steps:
        """Time steps of about dt (s) over all samples; the last one may end after them.

        Raises
        ------
        UsageError
            A step that is neither a whole part nor a whole multiple of the interval.
        """
        if not (math.isfinite(dt) and dt > 0.0):
            raise UsageError(f"dt must be a positive number of seconds, got {dt!r}")
        try:
            return choose_steps(dt, self.samples * self.interval, self.interval, 0.0)
        except UsageError as error:
            if self.record:
                raise
            raise UsageError(
                str(error).replace("record's sampling interval", "model's own step")
            ) from None

    def case(self, integrator: Integrator) -> Case:
        """What `tdint run` integrates with a method."""
        return Case(self.model, self.prepared, self.record, integrator)

    def told(self, integrator: Integrator, steps: Steps) -> float:
        """The largest error of a story's peak drift, over it, that `tdint run` tells beside these;
        nan for none."""
        response = run_with_error_estimate(self.case(integrator), steps)
        peaks = response.stories.peak_drift
        return (
            math.nan
            if response.check is None
            else largest_relative(peaks + response.check.errors.peak_drift, peaks)
        )

    def within(self, integrator: Integrator, tolerance: float) -> Response:
        """What `tdint run --tolerance` gives over all samples; FailedRun where it ends
        otherwise."""
        dt = None if self.record else self.interval
        return run_case(
            self.case(integrator), dt=dt, duration=self.samples * self.interval, tolerance=tolerance
        )

    def motion(self, integrator: Integrator, steps: Steps) -> FloorMotion | None:
        """The motion at the samples (or at the steps, if these are longer); None where the march
        does not reach its end."""
        marched = self.prepared.integrate(
            integrator, steps, self.ground, history_rows=steps.count // steps.per_sample
        )
        if marched.code < 0:
            return None
        space, n = marched.space, self.building.stories
        u, v, a = (space.history[:, 1 + j * n : 1 + (j + 1) * n].copy() for j in range(3))
        return FloorMotion(steps.stride, u, v, a, space.peaks[rows.PEAK_DRIFT])


def pose(
    model: Model,
    record: Record | None = None,
    *,
    duration: float | None = None,
    dts: tuple[float, ...] = (),
) -> Problem:
    """The problem that a model is under a record, by default its own.

    The interval is the record's; without a record the model's step, else the largest of `dts` (s).
    The duration (s) is by default the model's, else the record's.

    Raises
    ------
    UsageError
        No duration, or no step, where there is no record to take it from; a step that does not fit.
    AnalysisError
        Nothing moves the building.
    """
    record = model_record(model) if record is None else record
    duration = model.analysis.duration if duration is None else duration
    if duration is not None and not (math.isfinite(duration) and duration > 0.0):
        raise UsageError(f"duration must be a positive number of seconds, got {duration!r}")
    interval = record.dt if record else model.analysis.dt or max(dts, default=None)
    whole = choose_steps(
        interval, duration, record.dt if record else None, record.duration if record else 0.0
    )
    problem = Problem(model, record, whole.h, whole.count)
    causes = (
        problem.ground[: problem.samples + 1],
        problem.forces[:, 1:3],
        problem.displacement,
        problem.velocity,
    )
    if not any(np.any(cause) for cause in causes):
        raise AnalysisError(
            f"{model.name}: nothing moves this building: no ground motion, no force, no initial "
            "state"
        )
    return problem


def ending_together(problem: Problem, dts: Iterable[float]) -> Problem:
    """The problem, longer by as many samples as it takes for all steps (s) to end at one time.

    A motion that goes on has larger peaks: those of two durations are no measure of an error. Steps
    whose common multiple is longer than the motion stay as they are.
    """
    common = math.lcm(*(problem.steps(dt).stride for dt in dts))
    if common > problem.samples:
        return problem
    return replace(problem, samples=-(-problem.samples // common) * common)


def stretched(model: Model, count: int) -> Model:
    """The model with `count` stories: its own ones, each repeated (or left out) so that their
    pattern stays.

    Rayleigh damping keeps its coefficients. Of modal damping of the first modes those remain that
    there are. Forces and the initial state move with their floors.
    """
    stories = len(model.stories)
    if count == stories:
        return model
    floors = [i * stories // count for i in range(count)]
    damping = model.damping
    if isinstance(damping, RayleighRatio):
        # Its coefficients, from the mass and the stiffness of the lowest story.
        building = assemble(model)
        first = model.stories[0]
        damping = RayleighCoefficients(
            mass=float(
                building.linear_terms[rows.FLOOR_DAMPER, 0] / building.linear_terms[rows.MASS, 0]
            ),
            stiffness=float(
                (building.linear_terms[rows.STORY_DAMPER, 0] - first.dashpot) / first.stiffness
            ),
        )
    elif isinstance(damping, ModalDamping):
        damping = ModalDamping(damping.ratios[:count])
    forces = tuple(
        replace(force, floor=max(1, math.ceil(force.floor * count / stories)))
        for force in model.excitation.forces
    )
    return replace(
        model,
        stories=tuple(model.stories[i] for i in floors),
        damping=damping,
        excitation=replace(model.excitation, forces=forces),
        initial=Initial(
            tuple(model.initial.displacement[i] for i in floors),
            tuple(model.initial.velocity[i] for i in floors),
        ),
    )


# ---- The motion that others are measured against: computed by one method, confirmed by another
# one, kept for later

EXACT_UP_TO = 100
"""Stories up to which the exact method serves; the cost of its step grows with their square."""

_EXACT_GOAL, _SMOOTH_GOAL, _KINKED_GOAL = 1e-10, 1e-9, 1e-8  # gaps that are small enough
_SECONDS = 20.0  # after which no finer solution is begun
_FIRST_COST = 0.5  # s, of the first solution, roughly
_STORY_STEP = 6e-8  # s, of one step of one story, roughly
# stories whose peak drift is below this part of the largest are left out of the error of the peaks
_SMALL = 1e-3
_KEPT = 200_000_000  # bytes of references in the cache


@dataclass(frozen=True)
class RelativeErrors:
    """Relative errors by their names: `Errors` of a motion, or of peaks alone
    `profiles.PeakErrors`."""

    def of(self, quantity: str) -> float:
        """One of the errors by its name, with a hyphen or an underscore in it."""
        return float(getattr(self, quantity.replace("-", "_")))

    @property
    def worst(self) -> float:
        """The largest of all."""
        return float(max(astuple(self)))


@dataclass(frozen=True)
class Errors(RelativeErrors):
    """Relative errors of a motion.

    Attributes
    ----------
    displacement, drift, velocity, acceleration : float
        Of the whole history, L2: root of the sum of squares of the differences over all floors
        (stories) and common times, over that of the reference. Displacement and velocity relative
        to the ground, acceleration absolute.
    peak_drift : float
        Largest relative error of a story's peak drift. Stories whose peak is below a thousandth of
        the largest one are left out.
    """

    displacement: float
    drift: float
    velocity: float
    acceleration: float
    peak_drift: float


QUANTITIES = tuple(field.name for field in fields(Errors))


def errors(motion: FloorMotion, reference: FloorMotion) -> Errors:
    """Errors of a motion against the reference, which has all samples, at the times of the
    motion."""
    true = reference.every(motion.stride, len(motion.displacement))
    of_history = {}
    for name in QUANTITIES[:-1]:
        values, exact = getattr(motion, name), getattr(true, name)
        of_history[name] = float(np.linalg.norm(values - exact) / np.linalg.norm(exact))
    return Errors(**of_history, peak_drift=largest_relative(motion.peak_drift, true.peak_drift))


def errors_of_peaks(response: Response, reference: FloorMotion) -> Errors:
    """The error of the peak drifts of a run that keeps no history; nan for the others."""
    unknown = dict.fromkeys(QUANTITIES[:-1], math.nan)
    return Errors(
        **unknown, peak_drift=largest_relative(response.stories.peak_drift, reference.peak_drift)
    )


def largest_relative(peaks: Array, true: Array) -> float:
    """Largest relative error of the stories' peaks, but for those below a thousandth of the largest
    one."""
    counted = true > _SMALL * np.max(true)
    return float(np.max(np.abs(peaks[counted] / true[counted] - 1.0), initial=0.0))


@dataclass(frozen=True)
class Reference:
    """A motion at all samples, how it was computed, and how far another solution is from it.

    Attributes
    ----------
    method, dt : str, float
        What computed it, with which step (s).
    confirmed_by : str
        The other solution, in words.
    gap : Errors
        Of the other solution against this one: below it an error is not known.
    """

    method: str
    dt: float
    confirmed_by: str
    gap: Errors
    motion: FloorMotion


def find_reference(problem: Problem, samples: int, *, cached: bool = True) -> Reference:
    """The reference for a problem over some samples, from the cache if it is there.

    Linear buildings under ground motion alone: the exact method, confirmed by impulse4. All others:
    impulse4, confirmed by average acceleration extrapolated from two steps; not by gauss4, which is
    the same method in linear buildings. Steps are halved until the gap is small, does not fall any
    more, or takes too long to close further.

    Raises
    ------
    AnalysisError
        One of the solutions cannot be had.
    """
    file = _cache_file(problem, samples) if cached else None
    reference = _load(file, problem, samples) if file else None
    if reference is None:
        reference = _solve(problem, samples)
        if file:
            _save(file, reference)
    return reference


def _solve(problem: Problem, samples: int) -> Reference:
    # Which methods; kinks of the force keep two solutions further apart.
    building = problem.building
    if building.linear and not len(problem.forces) and building.stories <= EXACT_UP_TO:
        method, other, goal = "exact", "impulse4", _EXACT_GOAL
    else:
        method, other = "impulse4", "newmark-average"
        goal = _KINKED_GOAL if building.piecewise_linear and not building.linear else _SMOOTH_GOAL
    problem.prepared.compile(map(parse, (method, other)))
    # The first step is as small as half a second allows, so that few buildings need a second one.
    parts = 8
    while parts < 64 and 2 * parts * samples * building.stories * _STORY_STEP < _FIRST_COST:
        parts *= 2
    begin = time.monotonic()
    best = _solve_once(problem, samples, method, other, parts)
    while best.gap.worst > goal and 3.0 * (time.monotonic() - begin) < _SECONDS:
        parts *= 2
        finer = _solve_once(problem, samples, method, other, parts)
        falls = finer.gap.worst < 0.5 * best.gap.worst
        best = min(best, finer, key=lambda reference: reference.gap.worst)
        if not falls:
            break
    return best


def _solve_once(problem: Problem, samples: int, method: str, other: str, parts: int) -> Reference:
    motion = _motion(problem, samples, method, parts)
    h = problem.interval / parts
    if other == "newmark-average":
        # The limit of two motions of a method of order 2 (Richardson).
        coarse, fine = (_motion(problem, samples, other, 4 * parts * m) for m in (1, 2))
        names = [field.name for field in fields(FloorMotion)[1:]]
        limits = ((4.0 * getattr(fine, name) - getattr(coarse, name)) / 3.0 for name in names)
        confirming = FloorMotion(fine.stride, *limits)
        words = f"{other} extrapolated from dt {h / 4:.4g} and {h / 8:.4g} s"
    else:
        confirming = _motion(problem, samples, other, parts)
        words = f"{other} with dt {h:.4g} s"
    return Reference(method, h, words, errors(confirming, motion), motion)


def _motion(problem: Problem, samples: int, method: str, parts: int) -> FloorMotion:
    h = problem.interval / parts
    motion = problem.motion(parse(method), Steps(h, samples * parts, per_sample=parts))
    if motion is None:
        raise AnalysisError(f"no reference: {method} with dt {h:.6g} s does not reach the end")
    return motion


# ---- The cache: a file per problem and sources of the kernels, in the folder of the compiled ones.


def cache_folder() -> Path | None:
    """The folder for references made by these versions of the compiler; None if none can be
    written."""
    return cache_subfolder(folder_name())


def _cache_file(problem: Problem, samples: int) -> Path | None:
    folder = cache_folder()
    if folder is None:
        return None
    building = problem.building
    digest = hashlib.sha256(Path(__file__).read_bytes() + digest_of_all().encode())
    digest.update(repr((problem.interval, samples)).encode())
    # Laws of plug-ins have numbers in the order of their loading.
    laws = {
        name
        for name, code in CODES.items()
        if code >= OURS and code in building.law_parameters[rows.CODE]
    }
    digest.update(repr((sorted(laws), code_of(f"law {name}" for name in laws))).encode())
    tables = (
        building.linear_terms,
        building.law_parameters,
        building.modal,
        problem.ground,
        problem.forces,
    )
    for table in (*tables, problem.displacement, problem.velocity):
        digest.update(repr(table.shape).encode())
        digest.update(np.ascontiguousarray(table).tobytes())
    return folder / "references" / f"{digest.hexdigest()}.npz"


def _load(file: Path, problem: Problem, samples: int) -> Reference | None:
    """What the file holds; None if there is none or it is damaged."""
    if not is_file(file):
        return None
    shape = (samples + 1, problem.building.stories)
    # A zip file, a text or an array that is broken: whatever is raised, the reference is computed
    # anew.
    with (
        suppress(Exception),
        file.open("rb") as stream,
        np.load(stream, allow_pickle=False) as content,
    ):
        table = content["table"]
        motion = FloorMotion(1, table[0], table[1], table[2], content["peak_drift"])
        if (
            table.shape == (3, *shape)
            and motion.peak_drift.shape == shape[1:]
            and np.all(np.isfinite(table))
        ):
            gap = Errors(*content["gap"].tolist())
            return Reference(
                str(content["method"]),
                float(content["dt"]),
                str(content["confirmed_by"]),
                gap,
                motion,
            )
    return None


def _save(file: Path, reference: Reference) -> None:
    """Keep a reference, and of older ones those that have room; a cache that cannot be written is
    none."""
    motion = reference.motion
    content: dict[str, Any] = {
        "table": np.array([motion.displacement, motion.velocity, motion.acceleration]),
        "peak_drift": motion.peak_drift,
        "gap": np.array(astuple(reference.gap)),
        "method": reference.method,
        "dt": reference.dt,
        "confirmed_by": reference.confirmed_by,
    }
    # The youngest that fit into `_KEPT` stay, this one whatever its size.
    with suppress(OSError, OutputError):
        file.parent.mkdir(exist_ok=True, mode=0o700)
        write_file(file, lambda stream: np.savez(stream, **content), overwrite=True)
        size = 0
        for old in sorted(
            file.parent.glob("*.npz"), key=lambda old: old.stat().st_mtime, reverse=True
        ):
            size += old.stat().st_size
            if size > _KEPT and old != file:
                old.unlink(missing_ok=True)
