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
from typing import Any, TypeVar

import numpy as np

from tdint.arrays import Array, cached_property
from tdint.errors import AnalysisError, OutputError, UsageError
from tdint.files import is_file, write_files
from tdint.ground_motion.record import Record
from tdint.kernels import layout as rows
from tdint.kernels.building.sources import code_of, digest_of_all
from tdint.kernels.building.store import folder_name
from tdint.kernels.laws import OURS
from tdint.methods.catalogue import parse
from tdint.methods.method import Integrator
from tdint.model import definition
from tdint.model.building import Building, assemble
from tdint.model.damping import rayleigh
from tdint.model.story_laws import CODES
from tdint.response.arguments import model_record
from tdint.response.runs.case import Case
from tdint.response.runs.error_estimate import run_with_error_estimate
from tdint.response.runs.outcome import Response, StoryPeaks
from tdint.response.runs.prepared import PreparedBuilding
from tdint.response.runs.run import run_case
from tdint.response.time_steps import Steps, choose_steps
from tdint.system import cache_subfolder

_Moved = TypeVar("_Moved", definition.Force, definition.TableForce, definition.Attachment)


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
        """Return the motion at every `stride`-th sample, `row_count` rows in total.

        This motion must contain all samples. Its peaks are not changed, although they may occur at
        omitted samples.
        """
        selected_rows = slice(0, (row_count - 1) * stride + 1, stride)
        return FloorMotion(
            stride,
            self.displacement[selected_rows],
            self.velocity[selected_rows],
            self.acceleration[selected_rows],
            self.peak_drift,
        )


@dataclass(frozen=True)
class Problem:
    """Building, excitation, and the duration of the time integration.

    Attributes
    ----------
    model : Model
        Model of the building.
    record : Record | None
        Ground motion; None without ground motion.
    interval : float
        Sampling interval of the record, s. Without a record, it is the time step that other steps
        divide or multiply.
    samples : int
        Number of intervals to be integrated.
    """

    model: definition.Model
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
        """Forces on floors, one row per force.

        The columns are as in `tdint.kernels.layout`, for harmonic forces `FLOOR` (number of the
        floor from 0), `COSINE` (N), `SINE` (N) and `OMEGA` (rad/s).
        """
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
            The step is not positive, or it is not the interval divided or multiplied by a whole
            number.
        """
        if not (math.isfinite(dt) and dt > 0.0):
            raise UsageError(f"dt must be a positive number of seconds, got {dt!r}")
        # Without a record, the interval is the time step of the model.
        name = "sampling interval of the record" if self.record else "time step of the model"
        return choose_steps(dt, self.samples * self.interval, self.interval, 0.0, name)

    def case(self, integrator: Integrator) -> Case:
        """Return the building and the ground motion with a method, as `tdint run` integrates them.

        Parameters
        ----------
        integrator : Integrator
            Method with its parameters.
        """
        return Case(self.model, self.prepared, self.record, integrator)

    def estimate_error(self, integrator: Integrator, steps: Steps) -> float:
        """Return the maximum relative error of the peak drifts that `tdint run` would estimate.

        The error is relative to the peak drift of the same story. The result is nan if no error
        estimate is available.

        Parameters
        ----------
        integrator : Integrator
            Method with its parameters.
        steps : Steps
            Time steps.
        """
        response = run_with_error_estimate(self.case(integrator), steps)
        if response.check is None:
            return math.nan
        peaks = response.stories.peak_drift
        return largest_relative(peaks + response.check.errors.peak_drift, peaks)

    def run_within(self, integrator: Integrator, tolerance: float) -> Response:
        """Integrate all samples with steps chosen for a tolerance, as `tdint run --tolerance` does.

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
        """Return the motion at the samples, or at the steps if they are longer than an interval.

        None is the result if the run does not reach its end.

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
        workspace, floor_count = result.space, self.building.floors
        # A row of the history contains the ground acceleration, and then the displacements,
        # velocities and absolute accelerations of all floors, attachments and links.
        u, v, a = (
            workspace.history[:, 1 + j * self.building.stories :][:, :floor_count].copy()
            for j in range(3)
        )
        return FloorMotion(steps.stride, u, v, a, workspace.peaks[rows.PEAK_DRIFT, :floor_count])


def pose(
    model: definition.Model,
    record: Record | None = None,
    *,
    duration: float | None = None,
    dts: tuple[float, ...] = (),
) -> Problem:
    """Combine a model with its excitation and a duration to a problem.

    Parameters
    ----------
    record : Record, optional
        Ground motion; default is the record of the model.
    duration : float, optional
        Duration, s; default is the duration of the model, otherwise of the record.
    dts : tuple of float
        Time steps of the runs, s; used only without a record and without a time step in the model.
        Without these as well, tables of forces have the default time step of `run`.

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
    if interval is None and (tables := model.excitation.tables):
        # Imported here, because few models have tables of forces.
        from tdint.response.runs.load_notes import default_step

        interval, _ = default_step(tables, PreparedBuilding.of(model).period)
    interval_steps = choose_steps(
        interval, duration, record.dt if record else None, record.duration if record else 0.0
    )
    problem = Problem(model, record, interval_steps.h, interval_steps.count)
    excitations = (
        problem.ground[: problem.samples + 1],
        problem.forces[:, [rows.COSINE, rows.SINE, rows.FACTOR]],
        problem.displacement,
        problem.velocity,
    )
    if not any(np.any(excitation) for excitation in excitations):
        raise AnalysisError(
            f"{model.name}: the building has no excitation; specify a ground motion, a force or an "
            "initial state"
        )
    return problem


def ending_together(problem: Problem, dts: Iterable[float]) -> Problem:
    """Return the problem, extended so that runs with all time steps end at the same time.

    A run with long steps may otherwise end later than a run with short steps. A longer motion can
    have larger peaks, so the difference of their peaks would not be an error. The problem is not
    extended if the common multiple of the steps exceeds the duration.
    """
    common_multiple = math.lcm(*(problem.steps(dt).stride for dt in dts))
    if common_multiple > problem.samples:
        return problem
    # Round up to a multiple of the common multiple.
    return replace(problem, samples=-(-problem.samples // common_multiple) * common_multiple)


def stretched(model: definition.Model, count: int) -> definition.Model:
    """Return a building with `count` stories in the same pattern as in the model.

    If the number of stories increases, stories are repeated; if it decreases, stories are omitted.
    The coefficients of Rayleigh damping do not change. Modal damping keeps the ratios of the first
    `count` modes. Forces, attachments, links and the initial state move with their floors.
    """
    old_count = len(model.stories)
    if count == old_count:
        return model
    if model.matrices is not None:
        raise UsageError(
            f"{model.name}: the number of stories of a building with matrices or flexural stories "
            "cannot be changed"
        )
    # Index of the original story for each story of the new building.
    old_stories = [i * old_count // count for i in range(count)]
    damping = model.damping
    if isinstance(damping, definition.RayleighRatio):
        # The damping is formed from the stories, without attachments and links.
        vibration = assemble(replace(model, attachments=(), links=())).vibration
        damping = rayleigh(damping, *map(vibration.frequency, damping.modes))
    elif isinstance(damping, definition.ModalDamping):
        damping = damping._replace(ratios=damping.ratios[:count])

    def new_floor(floor: int) -> int:
        """Return the floor of the new building for a floor (from 1), the ground (0), or an
        attachment (numbers above the roof)."""
        if floor > old_count:
            return floor - old_count + count
        return math.ceil(floor * count / old_count)

    def moved(item: _Moved) -> _Moved:
        """Return a force or an attachment on its floor of the new building."""
        return item._replace(floor=new_floor(item.floor))

    links = [
        link._replace(ends=(new_floor(link.ends[0]), new_floor(link.ends[1])))
        for link in model.links
    ]
    for link in links:
        if link.ends[0] == link.ends[1]:
            raise UsageError(
                f"{model.name}: with {count} stories, both ends of the link {link.name} are on the "
                "same floor; use more stories, or remove the link"
            )
    forces = tuple(map(moved, model.excitation.forces))
    tables = tuple(map(moved, model.excitation.tables))
    return replace(
        model,
        stories=tuple(model.stories[i] for i in old_stories),
        damping=damping,
        attachments=tuple(map(moved, model.attachments)),
        links=tuple(links),
        excitation=replace(model.excitation, forces=forces, tables=tables),
        initial=definition.Initial(
            tuple(model.initial.displacement[i] for i in old_stories),
            tuple(model.initial.velocity[i] for i in old_stories),
        ),
    )


# ---- The reference solution of the errors: computed by a method, confirmed by a second method, and
# stored in the cache

EXACT_UP_TO = 100
"""Maximum number of stories for the exact method; the cost of its time step is quadratic in the
number of stories."""

# Target of the relative difference between the solutions of two methods. If the difference is
# larger, the reference is computed again with half the time step. The three targets are for
#   - linear buildings with a reference by the exact method
#   - all other buildings with smooth force curves
#   - buildings with kinks in their force curves, which increase the difference
_EXACT_GOAL, _SMOOTH_GOAL, _KINKED_GOAL = 1e-10, 1e-9, 1e-8
_REFINEMENT_SECONDS = 20.0  # s; no finer solution is started if it would end later
_FIRST_COST = 0.5  # s; approximate cost of the first solution
_STORY_STEP = 6e-8  # s; approximate cost of one time step per story
# Stories with a peak drift below this fraction of the maximum are omitted from the peak error
_OMITTED_BELOW = 1e-3
_KEPT = 200_000_000  # bytes; maximum size of the references in the cache


@dataclass(frozen=True)
class RelativeErrors:
    """Relative errors by name: `Errors` of a motion, or `profiles.PeakErrors` of its peaks."""

    def of(self, quantity: str) -> float:
        """Return an error by its name, written with hyphens or underscores; nan for a quantity
        without errors."""
        return float(getattr(self, quantity.replace("-", "_"), math.nan))

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
        (or stories) and common times, divided by this root for the reference; nan if it is not
        available. Displacement and velocity are relative to the ground, acceleration is absolute.
    peak_drift : float
        Maximum relative error of the peak drifts of the stories. Stories with a peak below a
        thousandth of the maximum are omitted.
    """

    displacement: float = math.nan
    drift: float = math.nan
    velocity: float = math.nan
    acceleration: float = math.nan
    peak_drift: float = math.nan


QUANTITIES = tuple(field.name for field in fields(Errors))


def errors(motion: FloorMotion, reference: FloorMotion) -> Errors:
    """Return the errors of a motion relative to a reference.

    Parameters
    ----------
    reference : FloorMotion
        Reference at all samples; it is compared at the times of the motion.
    """
    reference_rows = reference.every(motion.stride, len(motion.displacement))
    history_errors = {}
    for name in QUANTITIES[:-1]:
        values, reference_values = getattr(motion, name), getattr(reference_rows, name)
        history_errors[name] = float(
            np.linalg.norm(values - reference_values) / np.linalg.norm(reference_values)
        )
    return Errors(
        **history_errors, peak_drift=largest_relative(motion.peak_drift, reference_rows.peak_drift)
    )


def errors_of_peaks(peaks: StoryPeaks, reference: FloorMotion) -> Errors:
    """Return the errors of the peaks of a run without history relative to a reference.

    Only the error of the peak drifts is available; all other errors are nan.
    """
    return Errors(peak_drift=largest_relative(peaks.peak_drift, reference.peak_drift))


def largest_relative(peaks: Array, reference_peaks: Array) -> float:
    """Return the maximum over the stories of |peak / reference peak - 1|.

    Stories with a reference peak below a thousandth of the maximum are omitted, because their
    relative errors are large and not important.
    """
    is_relevant = reference_peaks > _OMITTED_BELOW * np.max(reference_peaks)
    return float(
        np.max(np.abs(peaks[is_relevant] / reference_peaks[is_relevant] - 1.0), initial=0.0)
    )


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
    """

    method: str
    dt: float
    confirmed_by: str
    gap: Errors
    motion: FloorMotion


def find_reference(problem: Problem, samples: int, *, cached: bool = True) -> Reference:
    """Return the reference for a problem over a number of samples, from the cache if available.

    For linear buildings without harmonic forces, the exact method is used and confirmed by
    impulse4. Otherwise impulse4 is used and confirmed by average acceleration, extrapolated from
    two steps. The method gauss4 would not be an independent confirmation, because it equals
    impulse4 for linear buildings. The gap is the difference between the solutions of both methods.
    The time step is halved until the gap reaches its target or no longer decreases by half, or
    until the next solution would exceed the available time.

    Parameters
    ----------
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
    """Compute the reference for a problem over a number of sampling intervals
    (`find_reference`).
    """
    building = problem.building
    # `exact` integrates forces from tables exactly, but approximates harmonic forces.
    has_harmonic_forces = bool(problem.model.excitation.forces)
    if building.linear and not has_harmonic_forces and building.stories <= EXACT_UP_TO:
        method, confirming_method, target_gap = "exact", "impulse4", _EXACT_GOAL
    else:
        method, confirming_method = "impulse4", "newmark-average"
        target_gap = (
            _KINKED_GOAL if building.piecewise_linear and not building.linear else _SMOOTH_GOAL
        )
    problem.prepared.compile(map(parse, (method, confirming_method)))
    # Start with the smallest step (an interval divided by 8, 16, 32 or 64) that costs at most
    # about 0.5 s, so that few buildings need a second solution with half the step.
    steps_per_interval = 8
    while (
        steps_per_interval < 64
        and 2 * steps_per_interval * samples * building.stories * _STORY_STEP < _FIRST_COST
    ):
        steps_per_interval *= 2
    start_time = time.monotonic()
    best = _solve_once(problem, samples, method, confirming_method, steps_per_interval)
    # The next solution has half the step, so it needs about two times the time that was spent
    # before, and would end at three times this time.
    while (
        best.gap.worst > target_gap and 3.0 * (time.monotonic() - start_time) < _REFINEMENT_SECONDS
    ):
        steps_per_interval *= 2
        finer = _solve_once(problem, samples, method, confirming_method, steps_per_interval)
        is_improving = finer.gap.worst < 0.5 * best.gap.worst
        best = min(best, finer, key=lambda reference: reference.gap.worst)
        if not is_improving:
            break
    return best


def _solve_once(
    problem: Problem, samples: int, method: str, confirming_method: str, steps_per_interval: int
) -> Reference:
    """Return a reference with one time step, and its gap to the solution of a second method.

    `steps_per_interval` is the number of time steps of the reference per interval.
    """
    motion = _motion(problem, samples, method, steps_per_interval)
    h = problem.interval / steps_per_interval
    if confirming_method == "newmark-average":
        # Average acceleration is of order 2: the error with half the step is a quarter. Extrapolate
        # two motions with 1/4 and 1/8 of the step of the reference to a step of 0 (Richardson).
        coarse, fine = (
            _motion(problem, samples, confirming_method, 4 * steps_per_interval * m) for m in (1, 2)
        )
        names = [field.name for field in fields(FloorMotion)[1:]]
        limits = ((4.0 * getattr(fine, name) - getattr(coarse, name)) / 3.0 for name in names)
        confirming = FloorMotion(fine.stride, *limits)
        description = f"{confirming_method} extrapolated from dt {h / 4:.4g} and {h / 8:.4g} s"
    else:
        confirming = _motion(problem, samples, confirming_method, steps_per_interval)
        description = f"{confirming_method} with dt {h:.4g} s"
    return Reference(method, h, description, errors(confirming, motion), motion)


def _motion(problem: Problem, samples: int, method: str, steps_per_interval: int) -> FloorMotion:
    """Integrate a problem by a method with several time steps in each sampling interval.

    Raises
    ------
    AnalysisError
        The run does not reach its end.
    """
    h = problem.interval / steps_per_interval
    motion = problem.motion(
        parse(method), Steps(h, samples * steps_per_interval, per_sample=steps_per_interval)
    )
    if motion is None:
        raise AnalysisError(
            f"the reference solution cannot be computed: {method} with the time step {h:.6g} s "
            "fails before the end of the motion; use a smaller scale factor or another model"
        )
    return motion


# ---- The cache: one file per problem and version of the kernels, next to the compiled kernels.


def cache_folder() -> Path | None:
    """Return the cache directory for references of the compiler version; None if not writable."""
    return cache_subfolder(folder_name())


def _cache_file(problem: Problem, samples: int) -> Path | None:
    """Return the file that stores the reference of a problem; None without a cache.

    The name is a digest of everything that determines the reference: this module, the kernels
    including the laws of plug-ins, and all arrays of the problem.
    """
    folder = cache_folder()
    if folder is None:
        return None
    building = problem.building
    digest = hashlib.sha256(Path(__file__).read_bytes() + digest_of_all().encode())
    digest.update(repr((problem.interval, samples)).encode())
    # The number of a law of a plug-in depends on the order of loading. The digest therefore
    # contains the names and the sources of these laws.
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
        problem.prepared.points,
    )
    for table in (*tables, problem.displacement, problem.velocity):
        digest.update(repr(table.shape).encode())
        digest.update(np.ascontiguousarray(table).tobytes())
    return folder / "references" / f"{digest.hexdigest()}.npz"


def _load(file: Path, problem: Problem, samples: int) -> Reference | None:
    """Return the reference of a file; None if the file does not exist, is corrupt or does not fit.

    `samples` is the number of intervals that the motion must contain.
    """
    if not is_file(file):
        return None
    shape = (samples + 1, problem.building.floors)
    # A corrupt zip file, text or array can raise any exception. All are ignored: the result is
    # None, and the caller computes the reference again.
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
    """Store a reference in a file, and delete the oldest references above the size limit.

    If files cannot be written, the reference is not stored, and no error is raised.
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
        write_files({file: lambda stream: np.savez(stream, **content)}, overwrite=True)
        total_bytes = 0
        for stored_file in sorted(
            file.parent.glob("*.npz"),
            key=lambda stored_file: stored_file.stat().st_mtime,
            reverse=True,
        ):
            total_bytes += stored_file.stat().st_size
            if total_bytes > _KEPT and stored_file != file:
                stored_file.unlink(missing_ok=True)
