"""Problem of a chart: a building with its excitation over a duration, for any method and time step.

The reference solution of the errors is computed here also.
"""

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

from tdint.analysis.arguments import model_record
from tdint.analysis.run.case import Case
from tdint.analysis.run.error_estimate import run_with_error_estimate
from tdint.analysis.run.outcome import Response
from tdint.analysis.run.prepared import PreparedBuilding
from tdint.analysis.run.run import run_case
from tdint.analysis.time_steps import Steps, choose_steps
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
    """Motion at every `stride`-th sample, with its peaks.

    Attributes
    ----------
    stride : int
        Number of samples between two rows.
    displacement, velocity, acceleration : ndarray, shape (rows, n)
        Motion of the floors: displacement (m) and velocity (m/s) relative to the ground, absolute
        acceleration (m/s^2) that satisfies equilibrium.
    peak_drift : ndarray, shape (n,)
        Maximum absolute drift of each story, m.
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
        """Return the first `row_count` rows of this motion at every `stride`-th sample."""
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
    """Building, excitation, and the duration of the time integration.

    Attributes
    ----------
    model : Model
        Model of the building.
    record : Record or None
        Ground motion; None without ground motion.
    interval : float
        Sampling interval of the record, s. Without a record, it is the time step that other steps
        divide or multiply.
    samples : int
        Number of intervals to be integrated.
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
        """Ground acceleration at the samples, m/s^2; a single zero without a record."""
        return np.zeros(1) if self.record is None else self.record.acceleration.copy()

    @property
    def forces(self) -> Array:
        """Table of the forces on floors, see `force_table`."""
        return self.prepared.forces

    @property
    def displacement(self) -> Array:
        """Initial displacement relative to the ground, m, shape (n,)."""
        return np.asarray(self.prepared.displacement)

    @property
    def velocity(self) -> Array:
        """Initial velocity relative to the ground, m/s, shape (n,)."""
        return np.asarray(self.prepared.velocity)

    def steps(self, dt: float) -> Steps:
        """Return time steps of about dt (s) over all samples; the last step may end later.

        Parameters
        ----------
        dt : float
            Requested time step, s.

        Raises
        ------
        UsageError
            The step is not the interval divided or multiplied by a whole number.
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
        """Return the case that `tdint run` integrates with a method.

        Parameters
        ----------
        integrator : Integrator
            Method with its parameters.
        """
        return Case(self.model, self.prepared, self.record, integrator)

    def told(self, integrator: Integrator, steps: Steps) -> float:
        """Return the maximum relative error of the peak drifts, as estimated by `tdint run`.

        The result is nan if no error estimate is available.

        Parameters
        ----------
        integrator : Integrator
            Method with its parameters.
        steps : Steps
            Time steps.
        """
        response = run_with_error_estimate(self.case(integrator), steps)
        peaks = response.stories.peak_drift
        return (
            math.nan
            if response.check is None
            else largest_relative(peaks + response.check.errors.peak_drift, peaks)
        )

    def within(self, integrator: Integrator, tolerance: float) -> Response:
        """Return the result of `tdint run --tolerance` over all samples.

        Parameters
        ----------
        integrator : Integrator
            Method with its parameters.
        tolerance : float
            Maximum ratio of the estimated error of a peak drift to that drift.

        Raises
        ------
        FailedRun
            The run failed.
        """
        dt = None if self.record else self.interval
        return run_case(
            self.case(integrator), dt=dt, duration=self.samples * self.interval, tolerance=tolerance
        )

    def motion(self, integrator: Integrator, steps: Steps) -> FloorMotion | None:
        """Return the motion at the samples, or at the steps if the steps are longer.

        The result is None if the run does not reach its end.

        Parameters
        ----------
        integrator : Integrator
            Method with its parameters.
        steps : Steps
            Time steps.
        """
        result = self.prepared.integrate(
            integrator, steps, self.ground, history_rows=steps.count // steps.per_sample
        )
        if result.code < 0:
            return None
        space, n = result.space, self.building.stories
        u, v, a = (space.history[:, 1 + j * n : 1 + (j + 1) * n].copy() for j in range(3))
        return FloorMotion(steps.stride, u, v, a, space.peaks[rows.PEAK_DRIFT])


def pose(
    model: Model,
    record: Record | None = None,
    *,
    duration: float | None = None,
    dts: tuple[float, ...] = (),
) -> Problem:
    """Return the problem of a model under a record.

    Parameters
    ----------
    model : Model
        Model of the building.
    record : Record, optional
        Ground motion; default is the record of the model.
    duration : float, optional
        Duration, s; default is the duration of the model, otherwise of the record.
    dts : tuple of float
        Time steps, s. Without a record, the interval is the time step of the model, otherwise the
        maximum of these steps.

    Raises
    ------
    UsageError
        Without a record, the duration or the time step is missing; or a time step is invalid.
    AnalysisError
        The building has no excitation.
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
            f"{model.name}: the building has no excitation; specify a ground motion, a force or an "
            "initial state"
        )
    return problem


def ending_together(problem: Problem, dts: Iterable[float]) -> Problem:
    """Return the problem with as many additional samples as all steps (s) need to end together.

    A longer motion can have larger peaks, so the peaks of two durations do not measure an error.
    The problem is not extended if the common multiple of the steps exceeds the duration.
    """
    common = math.lcm(*(problem.steps(dt).stride for dt in dts))
    if common > problem.samples:
        return problem
    return replace(problem, samples=-(-problem.samples // common) * common)


def stretched(model: Model, count: int) -> Model:
    """Return the model with `count` stories and an unchanged pattern of stories.

    The stories are repeated or omitted. Coefficients of Rayleigh damping do not change. Of modal
    damping, the ratios of the existing modes are kept. Forces and the initial state move with
    their floors.
    """
    stories = len(model.stories)
    if count == stories:
        return model
    floors = [i * stories // count for i in range(count)]
    damping = model.damping
    if isinstance(damping, RayleighRatio):
        # Compute the coefficients from the mass and the stiffness of the lowest story.
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


# ---- The reference solution of the errors: computed by one method, confirmed by a second method,
# and stored in the cache

EXACT_UP_TO = 100
"""Maximum number of stories for the exact method; the cost of its time step is quadratic in the
number of stories."""

# Relative gaps at which no finer reference is computed: exact method, smooth and kinked forces
_EXACT_GOAL, _SMOOTH_GOAL, _KINKED_GOAL = 1e-10, 1e-9, 1e-8
_SECONDS = 20.0  # s; no finer solution is started afterwards
_FIRST_COST = 0.5  # s; approximate cost of the first solution
_STORY_STEP = 6e-8  # s; approximate cost of one time step per story
# Stories with a peak drift below this fraction of the maximum are omitted from the peak error
_SMALL = 1e-3
_KEPT = 200_000_000  # bytes; maximum size of the references in the cache


@dataclass(frozen=True)
class RelativeErrors:
    """Relative errors by name: `Errors` of a motion, or `profiles.PeakErrors` of its peaks."""

    def of(self, quantity: str) -> float:
        """Return an error by its name, written with hyphens or underscores."""
        return float(getattr(self, quantity.replace("-", "_")))

    @property
    def worst(self) -> float:
        """Maximum of all errors."""
        return float(max(astuple(self)))


@dataclass(frozen=True)
class Errors(RelativeErrors):
    """Relative errors of a motion.

    Attributes
    ----------
    displacement, drift, velocity, acceleration : float
        Error of the complete history (L2): root of the sum of squared differences over all floors
        (or stories) and common times, divided by this root for the reference. Displacement and
        velocity are relative to the ground, acceleration is absolute.
    peak_drift : float
        Maximum relative error of the peak drifts of the stories. Stories with a peak below a
        thousandth of the maximum are omitted.
    """

    displacement: float
    drift: float
    velocity: float
    acceleration: float
    peak_drift: float


QUANTITIES = tuple(field.name for field in fields(Errors))


def errors(motion: FloorMotion, reference: FloorMotion) -> Errors:
    """Return the errors of a motion at its times. The reference contains all samples."""
    true = reference.every(motion.stride, len(motion.displacement))
    of_history = {}
    for name in QUANTITIES[:-1]:
        values, exact = getattr(motion, name), getattr(true, name)
        of_history[name] = float(np.linalg.norm(values - exact) / np.linalg.norm(exact))
    return Errors(**of_history, peak_drift=largest_relative(motion.peak_drift, true.peak_drift))


def errors_of_peaks(response: Response, reference: FloorMotion) -> Errors:
    """Return the error of the peak drifts of a run without history; the other errors are nan."""
    unknown = dict.fromkeys(QUANTITIES[:-1], math.nan)
    return Errors(
        **unknown, peak_drift=largest_relative(response.stories.peak_drift, reference.peak_drift)
    )


def largest_relative(peaks: Array, true: Array) -> float:
    """Return the maximum relative error of the peaks of the stories.

    Stories with a peak below a thousandth of the maximum are omitted.
    """
    counted = true > _SMALL * np.max(true)
    return float(np.max(np.abs(peaks[counted] / true[counted] - 1.0), initial=0.0))


@dataclass(frozen=True)
class Reference:
    """Reference motion at all samples, with its method and an estimate of its error.

    Attributes
    ----------
    method, dt : str, float
        Method and time step (s) of the reference.
    confirmed_by : str
        Description of the second solution.
    gap : Errors
        Errors of the second solution relative to the reference; smaller errors cannot be measured.
    motion : FloorMotion
        Motion at all samples.
    """

    method: str
    dt: float
    confirmed_by: str
    gap: Errors
    motion: FloorMotion


def find_reference(problem: Problem, samples: int, *, cached: bool = True) -> Reference:
    """Return the reference for a problem over a number of samples, from the cache if available.

    For linear buildings under ground motion only, the exact method is used and confirmed by
    impulse4. Otherwise impulse4 is used and confirmed by average acceleration, extrapolated from
    two steps. The method gauss4 would not be an independent confirmation, because it equals
    impulse4 for linear buildings. Steps are halved until the gap is small, stops decreasing, or
    would take too much time to decrease.

    Parameters
    ----------
    problem : Problem
        Building with its excitation.
    samples : int
        Number of intervals.
    cached : bool
        True (default) to read and to store the reference in the cache.

    Raises
    ------
    AnalysisError
        One of the solutions cannot be computed.
    """
    file = _cache_file(problem, samples) if cached else None
    reference = _load(file, problem, samples) if file else None
    if reference is None:
        reference = _solve(problem, samples)
        if file:
            _save(file, reference)
    return reference


def _solve(problem: Problem, samples: int) -> Reference:
    # Select the methods. Kinks of the force increase the gap between two solutions.
    building = problem.building
    if building.linear and not len(problem.forces) and building.stories <= EXACT_UP_TO:
        method, other, goal = "exact", "impulse4", _EXACT_GOAL
    else:
        method, other = "impulse4", "newmark-average"
        goal = _KINKED_GOAL if building.piecewise_linear and not building.linear else _SMOOTH_GOAL
    problem.prepared.compile(map(parse, (method, other)))
    # Start with the smallest step that costs about 0.5 s, so that few buildings need a second step.
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
        # Extrapolate to the limit of two motions of a second-order method (Richardson).
        coarse, fine = (_motion(problem, samples, other, 4 * parts * m) for m in (1, 2))
        names = [field.name for field in fields(FloorMotion)[1:]]
        limits = ((4.0 * getattr(fine, name) - getattr(coarse, name)) / 3.0 for name in names)
        confirming = FloorMotion(fine.stride, *limits)
        description = f"{other} extrapolated from dt {h / 4:.4g} and {h / 8:.4g} s"
    else:
        confirming = _motion(problem, samples, other, parts)
        description = f"{other} with dt {h:.4g} s"
    return Reference(method, h, description, errors(confirming, motion), motion)


def _motion(problem: Problem, samples: int, method: str, parts: int) -> FloorMotion:
    h = problem.interval / parts
    motion = problem.motion(parse(method), Steps(h, samples * parts, per_sample=parts))
    if motion is None:
        raise AnalysisError(f"no reference: {method} with dt {h:.6g} s does not reach the end")
    return motion


# ---- The cache: one file per problem and version of the kernels, next to the compiled kernels.


def cache_folder() -> Path | None:
    """Return the cache directory for references of this compiler version; None if not writable."""
    return cache_subfolder(folder_name())


def _cache_file(problem: Problem, samples: int) -> Path | None:
    folder = cache_folder()
    if folder is None:
        return None
    building = problem.building
    digest = hashlib.sha256(Path(__file__).read_bytes() + digest_of_all().encode())
    digest.update(repr((problem.interval, samples)).encode())
    # Laws of plug-ins are numbered in the order in which they are loaded.
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
    """Return the reference of a file; None if the file does not exist or is corrupt."""
    if not is_file(file):
        return None
    shape = (samples + 1, problem.building.stories)
    # A corrupt zip file, text or array can raise any exception: the reference is computed again.
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
    """Store a reference and delete the oldest references above the size limit.

    Write errors are ignored, so the cache is optional.
    """
    motion = reference.motion
    content: dict[str, Any] = {
        "table": np.array([motion.displacement, motion.velocity, motion.acceleration]),
        "peak_drift": motion.peak_drift,
        "gap": np.array(astuple(reference.gap)),
        "method": reference.method,
        "dt": reference.dt,
        "confirmed_by": reference.confirmed_by,
    }
    # Keep the newest files up to a total of `_KEPT` bytes, and always the present file.
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
