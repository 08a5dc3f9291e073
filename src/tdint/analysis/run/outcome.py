"""What comes out of a run: peaks, energies, a history, error estimates; or the failure that ended
it."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, field, fields, replace
from functools import reduce
from operator import add
from typing import TYPE_CHECKING, Annotated, Any, Generic, TypeVar, get_type_hints

import numpy as np
from numpy.typing import NDArray

from tdint.arrays import Array
from tdint.errors import AnalysisError
from tdint.kernels import layout as rows
from tdint.tabular import Tabular
from tdint.units import Quantity, quantities
from tdint.written_numbers import how_many, warned_first

if TYPE_CHECKING:
    from tdint.ground_motion.record import Record
    from tdint.model.building import Building
    from tdint.model.definition import Model


def _peak(row: int) -> Callable[[Building, Array, Array], Array]:
    """What a row of peaks holds itself."""
    return lambda building, peaks, end: peaks[..., row, :]


@dataclass(frozen=True)
class StoryValues:
    """A number of each kind for each story, or for the floor above it; arrays of shape (n,), of
    several runs (runs, n).

    A field is all there is to a quantity: it has its column in tables, stores and units, its error,
    its meaning. Its value follows from the building, the rows of peaks, shape (..., PEAK_ROWS, n),
    and the drifts at the end, (..., n).
    """

    peak_drift: Annotated[
        Array,
        Quantity(
            "m",
            "largest drift to either side: displacement relative to the floor below",
            _peak(rows.PEAK_DRIFT),
        ),
    ]
    peak_drift_ratio: Annotated[
        Array,
        Quantity(
            "1",
            "peak drift over story height; empty without one, as of isolators: awk takes it for 0",
            lambda building, peaks, end: peaks[..., rows.PEAK_DRIFT, :] / building.heights,
        ),
    ]
    residual_drift: Annotated[
        Array, Quantity("m", "drift at the end of the run", lambda building, peaks, end: end)
    ]
    peak_shear: Annotated[
        Array,
        Quantity(
            "N",
            "largest restoring force of the story to either side, without viscous forces",
            _peak(rows.PEAK_SHEAR),
        ),
    ]
    peak_damper_force: Annotated[
        Array,
        Quantity(
            "N",
            "largest force of the story's dashpots to either side; 0 without",
            lambda building, peaks, end: building.device_force(peaks[..., rows.PEAK_DRIFT_RATE, :]),
        ),
    ]
    peak_total_shear: Annotated[
        Array,
        Quantity(
            "N",
            "largest force that moves all floors above, to either side: restoring, P-delta and all "
            "viscous forces",
            _peak(rows.PEAK_TOTAL_SHEAR),
        ),
    ]
    ductility: Annotated[
        Array,
        Quantity(
            "1",
            "peak drift over drift at first yield",
            lambda building, peaks, end: peaks[..., rows.PEAK_DRIFT, :] / building.yield_drift,
        ),
    ]
    peak_displacement: Annotated[
        Array,
        Quantity(
            "m",
            "largest displacement of the floor, relative to the ground",
            _peak(rows.PEAK_DISPLACEMENT),
        ),
    ]
    peak_velocity: Annotated[
        Array,
        Quantity(
            "m/s",
            "largest velocity of the floor, relative to the ground",
            _peak(rows.PEAK_VELOCITY),
        ),
    ]
    peak_absolute_acceleration: Annotated[
        Array,
        Quantity(
            "m/s^2",
            "largest absolute acceleration of the floor",
            _peak(rows.PEAK_ACCELERATION),
        ),
    ]


STORY = quantities(StoryValues)
"""The quantities of a story, in the order of their columns."""


def story_values(building: Building, peaks: Array, end: Array) -> dict[str, Array]:
    """The quantities of all stories by their names."""
    return {
        quantity.name: quantity.value(building, peaks, end) for quantity in STORY if quantity.value
    }


@dataclass(frozen=True, repr=False)
class StoryPeaks(Tabular, StoryValues):
    """Peaks of a run.

    All are looked for between the steps too, on the quintic through displacement, velocity and
    acceleration at both ends of a step, or of each piece of it between two changes of branch that
    the method locates (`tdint.kernels.peaks_between_steps`), or at those that its paths tell
    (`tdint.kernels.equations.corners`).

    Attributes
    ----------
    height : ndarray, shape (n,)
        Story height, m; nan where the model gives none.
    """

    height: Array

    def _headline(self) -> str:
        largest = np.nanmax(self.peak_drift, initial=0.0)
        return f"of {how_many(self.peak_drift.shape[-1], 'story')}, largest drift {largest:.4g} m"


@dataclass(frozen=True)
class StoryErrors(StoryValues):
    """Estimated absolute errors of the peaks of the same names, in their units; nan where
    unknown."""


@dataclass(frozen=True, repr=False)
class Gradient(StoryValues):
    """Derivatives of the peaks of the same names, in their units over those of the parameters;
    arrays have the parameters first, shape (parameters, n), of many runs (runs, parameters, n); nan
    where a neighbor has no result.

    Attributes
    ----------
    parameters : tuple of str
        What they are by, as asked for.
    values : ndarray, shape (parameters,) or (runs, parameters)
        The numbers at which they are taken, SI units; of factors 1.
    kink : StoryErrors
        Half of what the differences to either side part by: rounding and curvature where the peak
        is smooth, the jump at a kink. An indication, no bound.
    history : mapping of str to ndarray, shape (parameters, rows, n) or (runs, parameters, rows, n)
        Derivatives of the histories that were kept.
    by : str
        How they were found.
    """

    parameters: tuple[str, ...]
    values: Array
    kink: StoryErrors
    history: dict[str, NDArray[np.floating[Any]]]
    by: str = "central differences"

    def __repr__(self) -> str:
        return f"<Gradient by {how_many(len(self.parameters), 'parameter')}: {self.by}>"

    def of_run(self, number: int) -> Gradient:
        """Those of one of many runs."""
        kept = {name: array[number] for name, array in self.history.items()}
        peaks, kink = (
            {one.name: getattr(of, one.name)[number] for one in fields(StoryErrors)}
            for of in (self, self.kink)
        )
        both: dict[str, Any] = {**peaks, "kink": StoryErrors(**kink)}
        return replace(self, **both, values=self.values[number], history=kept)


@dataclass(frozen=True)
class StepChoice:
    """A step that was chosen for a tolerance.

    Attributes
    ----------
    tolerance : float
        Largest estimated error of a peak drift, over it, that was allowed.
    runs : int
        Runs with other steps, or this one, that were made for it.
    samples : float or None
        Sampling intervals of the record in the step; None without a record.
    solves_at_record : int or None
        Solves of a run with the record's own step, where there was one.
    """

    tolerance: float
    runs: int
    samples: float | None
    solves_at_record: int | None


@dataclass(frozen=True)
class ErrorEstimate:
    """How far off a run is, by one more run (`tdint.analysis.run.error_estimate`).

    Attributes
    ----------
    errors : StoryErrors
        Estimated errors of the run's peaks.
    time_steps : tuple of float
        The step of the run that tells them, s; none where that failed. Of a run that was chosen for
        a tolerance, the steps of the pair.
    drift_error : float or None
        Largest estimated error of a peak drift over that drift; None where there is no estimate.
    drift_story : int or None
        The story that has it, counted from 1.
    method : str
        The method of that run.
    step_choice : StepChoice or None
        How the step was chosen, if it was for a tolerance.
    corrected : StoryPeaks or None
        The peaks of that run, nearer to the truth; None where a collapse ended the run.
    """

    errors: StoryErrors
    time_steps: tuple[float, ...]
    drift_error: float | None
    drift_story: int | None
    method: str = ""
    step_choice: StepChoice | None = None
    corrected: StoryPeaks | None = None

    @classmethod
    def of(cls, stories: StoryPeaks, errors: StoryErrors, **more: Any) -> ErrorEstimate:
        """The estimate of a run with these peaks, the story with the largest error of a drift
        found."""
        drift = stories.peak_drift
        relative = np.divide(errors.peak_drift, drift, out=np.zeros_like(drift), where=drift > 0.0)
        worst = int(np.argmax(relative))
        return cls(errors, drift_error=float(relative[worst]), drift_story=worst + 1, **more)


Amount = TypeVar("Amount")


@dataclass(frozen=True)
class EnergyTerms(Generic[Amount]):
    """Where energy comes from and goes to, J: a field for each row of
    `tdint.kernels.time_loop.observer`, in its order."""

    input: Annotated[Amount, "work of the load on the motion relative to the ground"]
    kinetic: Annotated[Amount, "kinetic energy of the motion relative to the ground"]
    viscous: Annotated[Amount, "work of viscous damping (Rayleigh, modal), without dashpots"]
    dampers: Annotated[Amount, "work of the dashpots"]
    strain: Annotated[Amount, "stored in the stories, P-delta included"]
    hysteretic: Annotated[Amount, "dissipated by the drift laws"]


ENERGY_TERMS: dict[str, str] = {
    name: hint.__metadata__[0]
    for name, hint in get_type_hints(EnergyTerms, include_extras=True).items()
}
"""What each term is, by its name: that of columns and keys, too."""


@dataclass(frozen=True)
class Energy(EnergyTerms[float]):
    """Energy balance of a run in terms of motion relative to the ground, J (Uang and Bertero 1990,
    relative energy).

    initial + input = the other terms + imbalance.

    Attributes
    ----------
    initial : float
        Kinetic and stored energy at the start.
    reference : float
        Maximum of initial + input on the way.
    """

    initial: float
    reference: float

    @property
    def error(self) -> float:
        """Imbalance over the largest input energy; 0 for a run without energy."""
        spent = reduce(add, [getattr(self, name) for name in ENERGY_TERMS if name != "input"])
        return (
            float((self.initial + self.input - spent) / self.reference)
            if self.reference > 0.0
            else 0.0
        )


@dataclass(frozen=True)
class EnergyHistory(EnergyTerms[Array]):
    """The terms at all steps, J, and the imbalance over the run's largest input energy; shape
    (steps + 1,)."""

    error: Array


@dataclass(frozen=True)
class ErrorHistory:
    """The error at all steps, true less computed, by the run that tells a run's errors; shape
    (steps + 1, n)."""

    displacement: Annotated[
        Array, Quantity("m", "estimated error, true less computed", shown=("floor",))
    ]
    velocity: Annotated[
        Array, Quantity("m/s", "estimated error, true less computed", shown=("floor",))
    ]
    drift: Annotated[Array, Quantity("m", "estimated error, true less computed", shown=("story",))]
    shear: Annotated[Array, Quantity("N", "estimated error, true less computed", shown=("story",))]


@dataclass(frozen=True, repr=False)
class History(Tabular):
    """Response at all steps: `time` and `ground_acceleration` of shape (steps + 1,), the rest
    (steps + 1, n).

    `error` is what all but the accelerations are off by, where that was asked for; else None.
    """

    time: Annotated[Array, Quantity("s", "time from the first sample", shown=("ground",))]
    ground_acceleration: Annotated[
        Array, Quantity("m/s^2", "acceleration of the ground", shown=("ground",))
    ]
    displacement: Annotated[Array, Quantity("m", "relative to the ground", shown=("floor",))]
    velocity: Annotated[Array, Quantity("m/s", "relative to the ground", shown=("floor",))]
    acceleration: Annotated[
        Array,
        Quantity(
            "m/s^2", "absolute, from equilibrium", shown=("floor",), called="absolute_acceleration"
        ),
    ]
    drift: Annotated[Array, Quantity("m", "relative to the floor below", shown=("story",))]
    shear: Annotated[
        Array, Quantity("N", "restoring force, without viscous forces", shown=("story",))
    ]
    damper_force: Annotated[Array, Quantity("N", "force of the story's dashpots", shown=("story",))]
    total_shear: Annotated[
        Array,
        Quantity(
            "N",
            "moves all floors above: restoring, P-delta and all viscous forces",
            shown=("story",),
        ),
    ]
    energy: EnergyHistory
    error: ErrorHistory | None = None

    def _headline(self) -> str:
        stories, steps = (
            how_many(self.displacement.shape[1], "story"),
            how_many(len(self.time) - 1, "step"),
        )
        return f"of {stories}, {steps} to {self.time[-1]:.6g} s"

    @staticmethod
    def joined(pieces: Iterable[History]) -> History:
        """Pieces of a history as one."""
        parts = list(pieces)
        return parts[0] if len(parts) == 1 else _joined(parts)

    def every(self, steps: int) -> History:
        """Every so many steps, from the first one; nothing is copied."""
        thinned: History = _joined([self], lambda arrays: arrays[0][::steps])
        return thinned


def _joined(parts: Sequence[Any], join: Callable[[Sequence[Array]], Array] = np.concatenate) -> Any:
    """Records of arrays, which may hold records of arrays: one after the other, or joined in
    another way."""
    if parts[0] is None:
        return None
    if isinstance(parts[0], np.ndarray):
        return join(parts)
    names = [member.name for member in fields(parts[0])]
    return type(parts[0])(
        **{name: _joined([getattr(part, name) for part in parts], join) for name in names}
    )


@dataclass(frozen=True)
class Collapse:
    """When a drift ratio first exceeded the model's collapse drift, or a story failed for good:
    what came first.

    Attributes
    ----------
    time : float
        End of the step in which it did, s.
    story : int
        The story, counted from 1.
    ended : bool
        Whether the run ends there, because the motion ran away after it.
    failed : bool
        Whether the story carries nothing from then on, by its law; else its drift ratio exceeded
        the limit.
    """

    time: float
    story: int
    ended: bool
    failed: bool = False

    @property
    def status(self) -> str:
        """As of `Response`."""
        return "failed-story" if self.failed else "collapsed"


@dataclass(frozen=True)
class Shock:
    """What a building did in one shock of a sequence: until the ground moves in the next one, or to
    the end.

    Attributes
    ----------
    record : Record
        The ground motion, scaled.
    start : float
        Time of its first sample in the sequence, s.
    stories : StoryPeaks
        Peaks in this time, of displacements from where the building stood at first: what the shocks
        before have left is in them.
    interstep_bound : StoryErrors
        As of `Response`.
    errors : StoryErrors or None
        Estimated errors of the peaks, if they were asked for.
    """

    record: Record
    start: float
    stories: StoryPeaks
    interstep_bound: StoryErrors
    errors: StoryErrors | None = None


@dataclass(frozen=True, repr=False)
class Response(Tabular):
    """Result of a run.

    Attributes
    ----------
    status : str
        `done`; `collapsed` where a drift ratio exceeded the model's collapse drift, `failed-story`
        where a story had lost all its force before.
    model, record : Model, Record or None
        The building and its ground motion, scaled.
    method : str
        The method's specification as given: its name, and the parameters that were specified.
    dt, steps : float, int
        Time step (s) and number of steps.
    iterations, substeps, branch_changes : int
        Solves; steps that were halved to converge; changes of branch that were located.
    solver_time : float
        Time that the compiled time loop alone took, s, by `tdint.system.clock`: of the processor,
        where that is told.
    stories : StoryPeaks
        Peak responses of each story and floor, SI units, arrays of shape (n,).
    energy : Energy
        Energy balance at the end of the run, J.
    history : History or None
        Response history, if it was requested.
    collapse : Collapse or None
        When and where, if the status is `collapsed` or `failed-story`.
    interstep_bound : StoryErrors
        How much larger peaks may be between steps that do not resolve the motion, in their units; 0
        where the step does. Of residual drifts: by how much they have changed since the time that
        was asked for, after which a long step ends.
    residual_oscillation : ndarray, shape (n,)
        Amplitudes with which the drifts still move about their rest at the end, about, m; without
        forces on floors.
    check : ErrorEstimate or None
        Estimated errors, unless they were left out.
    history_chunks : callable or None
        Called with a number of steps, the history of every so many in pieces, made again: all
        memory need not hold.
    time_at_rest : float or None
        Time by which the building was at rest, s, if the run was to go on until then and came to
        that.
    notes : tuple of str
        What a person should know of the run.
    warnings : tuple of str
        What changes what its numbers mean: a person must see it.
    events : tuple of Shock
        Of a sequence what each shock did, up to the one in which the run ended; `record` and
        `stories` are those of the whole sequence.
    gradient : Gradient or None
        Derivatives of the peaks, if they were asked for (`tdint.analysis.run.gradient`).
    """

    model: Model
    record: Record | None
    status: str
    method: str
    dt: float
    steps: int
    iterations: int
    substeps: int
    branch_changes: int
    solver_time: float
    stories: StoryPeaks
    energy: Energy
    history: History | None
    notes: tuple[str, ...]
    interstep_bound: StoryErrors
    residual_oscillation: Array
    collapse: Collapse | None = None
    check: ErrorEstimate | None = None
    time_at_rest: float | None = None
    history_chunks: Callable[..., Iterator[History]] | None = field(default=None, compare=False)
    warnings: tuple[str, ...] = ()
    events: tuple[Shock, ...] = ()
    gradient: Gradient | None = None

    def _headline(self) -> str:
        story = int(np.argmax(self.stories.peak_drift))
        return (
            f"of {self.model.name!r}: {self.status}, {self.method}, {how_many(self.steps, 'step')} "
            f"of {self.dt:.6g} s, largest drift {self.stories.peak_drift[story]:.4g} m in story "
            f"{story + 1}{warned_first(self.warnings)}"
        )


DIVERGED, NOT_CONVERGED = "diverged", "not-converged"
UNSTABLE, NO_STEP = "unstable-step", "not-within-tolerance"
FAILED = (DIVERGED, NOT_CONVERGED, UNSTABLE, NO_STEP)
"""How runs end that have no result."""


@dataclass(eq=False, repr=False)
class FailedRun(AnalysisError):
    """A run without a result: it ended before its time, or was refused.

    Attributes
    ----------
    message : str
        What happened, for people.
    status : str
        `diverged`, `not-converged`, `unstable-step` or `not-within-tolerance`.
    method, dt : str, float
        The method's specification as given, and the time step, s.
    time : float
        Last time reached, s.
    story : int or None
        The story, counted from 1, that did not converge, whose drift ran away, or is least within a
        tolerance.
    residual : float or None
        Where a step did not converge: what is out of balance over the story's forces.
    energy : float or None
        Where the motion ran away: its kinetic energy at the last time, J, if it is a finite number.
    largest_stable_dt : float or None
        Where the step was refused: the largest stable one, s; 0 if there is none.
    notes : tuple of str
        What a person should know of the run.
    """

    message: str
    status: str
    method: str
    dt: float
    time: float = field(default=0.0, kw_only=True)
    story: int | None = field(default=None, kw_only=True)
    residual: float | None = field(default=None, kw_only=True)
    energy: float | None = field(default=None, kw_only=True)
    largest_stable_dt: float | None = field(default=None, kw_only=True)
    notes: tuple[str, ...] = field(default=(), kw_only=True)

    def __post_init__(self) -> None:
        super().__init__(self.message)

    @property
    def finer_may_help(self) -> bool:
        """Whether the same run with a finer step may come to its end."""
        return self.status in (DIVERGED, NOT_CONVERGED)
