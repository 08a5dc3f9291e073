"""Results of a run: peaks, energies, history, error estimates, or the failure that ended it."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from operator import add, itemgetter
from typing import TYPE_CHECKING, Annotated, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from tdint.arrays import Array, Numbers, each_array, immutable
from tdint.errors import AnalysisError, UsageError
from tdint.kernels import layout as rows
from tdint.model.status import NO_RESULT
from tdint.number_parsing import first_warning, pluralize
from tdint.response.runs.energy import ENERGY_ROUNDING
from tdint.tabular import Described, Tabular, WithTable
from tdint.units import Quantity, quantities

if TYPE_CHECKING:
    from tdint.ground_motion.record import Record
    from tdint.model.building import Building
    from tdint.model.definition import Model
    from tdint.model.limits import LimitCheck
    from tdint.response.runs.contacts import LinkContact
    from tdint.response.runs.elements import ElementPeaks, ElementValues
    from tdint.response.runs.energy import Energy
    from tdint.response.runs.flexure import FlexurePeaks
    from tdint.response.runs.history import History
    from tdint.response.runs.run_state import RunState


def _peak(row: int) -> "Callable[[Building, Array, Array], Array]":
    """Return the function of a `Quantity` that reads one row of the peaks of all stories."""
    return lambda building, peaks, end: peaks[..., row, :]


@immutable
class StoryValues(Described):
    """One value of each quantity for each story, or for the floor above it.

    The arrays have the shape (n,), or (runs, n) for several runs. A field defines a quantity
    completely: its column in tables, stores and units, its error and its description. Its value is
    computed from the building, the rows of peaks, shape (..., PEAK_ROWS, n), and the drifts at the
    end, (..., n).
    """

    peak_drift: Annotated[
        Array,
        Quantity(
            "m",
            "maximum absolute story drift: displacement relative to the floor below",
            _peak(rows.PEAK_DRIFT),
        ),
    ]
    peak_drift_ratio: Annotated[
        Array,
        Quantity(
            "1",
            "peak drift divided by story height; empty without height (isolators): awk reads 0",
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
            "maximum absolute restoring force of the story, without viscous forces",
            _peak(rows.PEAK_SHEAR),
        ),
    ]
    peak_damper_force: Annotated[
        Array,
        Quantity(
            "N",
            "maximum absolute force of the dashpots of the story, along an inclined dashpot; 0 "
            "without dashpots",
            lambda building, peaks, end: building.peak_damper_force(peaks),
        ),
    ]
    peak_total_shear: Annotated[
        Array,
        Quantity(
            "N",
            "maximum absolute force on all floors above: restoring, P-delta and all viscous forces",
            _peak(rows.PEAK_TOTAL_SHEAR),
        ),
    ]
    ductility: Annotated[
        Array,
        Quantity(
            "1",
            "peak drift divided by drift at first yield",
            lambda building, peaks, end: peaks[..., rows.PEAK_DRIFT, :] / building.yield_drift,
        ),
    ]
    peak_displacement: Annotated[
        Array,
        Quantity(
            "m",
            "maximum absolute displacement of the floor, relative to the ground",
            _peak(rows.PEAK_DISPLACEMENT),
        ),
    ]
    peak_velocity: Annotated[
        Array,
        Quantity(
            "m/s",
            "maximum absolute velocity of the floor, relative to the ground",
            _peak(rows.PEAK_VELOCITY),
        ),
    ]
    peak_absolute_acceleration: Annotated[
        Array,
        Quantity(
            "m/s^2",
            "maximum absolute acceleration of the floor",
            _peak(rows.PEAK_ACCELERATION),
        ),
    ]


STORY_QUANTITIES = quantities(StoryValues)
"""Quantities of a story, in the order of their columns."""


def story_values(building: "Building", peaks: Array, end: Array) -> dict[str, Array]:
    """Compute the quantities of all stories.

    Parameters
    ----------
    peaks : ndarray, shape (..., PEAK_ROWS, n)
        Peaks in the rows of `Workspace.peaks`. The time loops fill the row of the drift rates only
        for a building with dashpots, and the row of the forces of braces only with braces.
    end : ndarray, shape (..., n)
        Drifts at the end of the run, m.

    Returns
    -------
    dict of str to ndarray, shape (..., n)
        Values by the name of the quantity (`StoryValues`), SI units.
    """
    return {
        quantity.name: quantity.value(building, peaks, end)
        for quantity in STORY_QUANTITIES
        if quantity.value
    }


@immutable
class StoryPeaks(WithTable, StoryValues):
    """Peaks of a run.

    Peaks between time steps are included. Displacements, drifts and velocities are searched on the
    quintic through displacement, velocity and acceleration at both endpoints of a time step, or of
    each substep between two located branch changes (`tdint.kernels.peaks_between_steps`). A shear
    is the force of the law at the extreme drift, or at the end of the step. The extrema of
    accelerations and total shears are located on the deviation of the quintic from the straight
    line between their endpoint values, with a weight that falls to zero where the deviation is
    unreliable; their values satisfy the equations of motion (`tdint.kernels.located_peaks`). Some
    methods compute peaks from separate paths (`tdint.kernels.equations.corners`). Two extrema of a
    quantity in one step, and motion that the step does not resolve, are not included.

    Attributes
    ----------
    peak_drift : ndarray
        Maximum absolute story drifts (displacements relative to the floor below), m.
    peak_drift_ratio : ndarray
        Peak drifts divided by the story heights; nan without a height.
    residual_drift : ndarray
        Drifts at the end of the run, m.
    peak_shear : ndarray
        Maximum absolute restoring forces of the stories, without viscous forces, N.
    peak_damper_force : ndarray
        Maximum absolute forces of the dashpots of the stories, N.
    peak_total_shear : ndarray
        Maximum absolute forces on all floors above (restoring, P-delta and all viscous forces), N.
    ductility : ndarray
        Peak drifts divided by the drifts at first yield.
    peak_displacement, peak_velocity : ndarray
        Maximum absolute motions of the floors relative to the ground, m and m/s.
    peak_absolute_acceleration : ndarray
        Maximum absolute accelerations of the floors, m/s^2.
    height : ndarray, shape (n,)
        Story height, m; nan if the model does not specify it.
    isolator : ndarray, shape (n,)
        1 for an isolator, 0 for another story.

    After a collapse, residual drifts are nan: the drifts where the run stopped are not at rest.
    """

    height: Array
    isolator: Array

    def settled(self, is_settled: NDArray[np.bool_]) -> "StoryPeaks":
        """Return the peaks with residual drifts of zero where the drift at the end is vibration.

        Parameters
        ----------
        is_settled : ndarray of bool
            True for runs that end without forces on a building that rests at zero
            (`Building.rests_at_zero`): one value, or one per run.
        """
        zero = np.where(is_settled[..., np.newaxis], 0.0, self.residual_drift)
        return replace(self, residual_drift=zero)

    def without_residual(self) -> "StoryPeaks":
        """Return the peaks of a collapsed run, with unknown residual drifts (nan)."""
        return replace(self, residual_drift=np.full_like(self.residual_drift, np.nan))

    def _headline(self) -> str:
        largest = np.nanmax(self.peak_drift, initial=0.0)
        return f"of {pluralize(self.peak_drift.shape[-1], 'story')}, largest drift {largest:.4g} m"


class StoryErrors(StoryValues):
    """Estimated absolute errors of the attributes of `StoryPeaks`, with the same names, shapes and
    units; nan if unknown.
    """

    def _headline(self) -> str:
        largest = np.nanmax(self.peak_drift, initial=0.0)
        return f"of {pluralize(self.peak_drift.shape[-1], 'story')}, drifts {largest:.2g} m"


@immutable
class Gradient(Tabular, StoryValues):
    """Derivatives of the peaks of a run.

    The derivatives have the names of the attributes of `StoryPeaks`, and the units of the peaks
    divided by the units of the parameters.

    The first axis of the arrays is the parameter: shape (parameters, n), or (runs, parameters, n)
    for many runs. Values are nan if a neighboring run has no result.

    Attributes
    ----------
    parameters : tuple of str
        Names of the parameters as requested.
    values : ndarray, shape (parameters,) or (runs, parameters)
        Parameter values of the derivatives, SI units; 1 for factors.
    kink : StoryErrors
        Half the difference of the one-sided derivatives: rounding and curvature if the peak is
        smooth, the jump at a kink. An indication, not a bound.
    history : mapping of str to ndarray, shape (parameters, rows, n) or (runs, parameters, rows, n)
        Derivatives of the histories that were kept, with the names of `run_many`.
    devices : Gradient | None
        Derivatives of the peaks of attachments and then links; None without.
    axis : str
        `story`, or `device` for attachments and links.
    by : str
        Method of differentiation.
    errors : StoryErrors | None
        Estimated discretization errors of the derivatives of the same names, from one additional
        set of runs with half the time step. None if error estimates were omitted (`check=False`);
        nan without an estimate.
    """

    parameters: tuple[str, ...]
    values: Array
    kink: StoryErrors
    history: dict[str, NDArray[np.floating[Any]]]
    by: str = "central differences"
    errors: StoryErrors | None = None
    devices: "Gradient | None" = None
    axis: str = "story"

    def _headline(self) -> str:
        parameters = f"of peaks by {pluralize(len(self.parameters), 'parameter')}: {self.by}"
        if self.errors is None:
            return f"{parameters}, errors not estimated"
        size = np.nanmax(np.abs(self.peak_drift), axis=-1)
        errors = np.nanmax(self.errors.peak_drift, axis=-1)
        worst = np.nanmax(np.divide(errors, size, out=np.zeros_like(size), where=size > 0.0))
        return f"{parameters}, errors of drift derivatives up to {worst:.2g} of the largest"

    def select_run(self, number: int) -> "Gradient":
        """Return the derivatives of one of many runs.

        Parameters
        ----------
        number : int
            Index of the run, from 0.
        """
        selected: Gradient = each_array(itemgetter(number), self)
        return selected


class StepChoice(NamedTuple):
    """Choice of a time step for a tolerance.

    Attributes
    ----------
    tolerance : float
        Maximum allowed ratio of the estimated error of a peak drift to that drift.
    runs : int
        Number of runs for the choice, including this run.
    samples : float | None
        Time step in sampling intervals of the record; None without a record.
    solves_at_record : int | None
        Number of solves of a run with the sampling interval as time step, if such a run was made.
    """

    tolerance: float
    runs: int
    samples: float | None
    solves_at_record: int | None


@immutable
class ErrorEstimate(Described):
    """Error estimate of a run from one additional run (`tdint.response.runs.error_estimate`).

    Attributes
    ----------
    errors : StoryErrors
        Estimated errors of the peaks of the run.
    time_steps : tuple of float
        Time step of the additional run, s; empty if it failed. For a run chosen for a tolerance,
        the time steps of the pair.
    drift_error : float | None
        Maximum ratio of the estimated error of a peak drift to that drift; None without an
        estimate; inf if a story has a drift in the additional run only.
    drift_story : int | None
        Story with this maximum, from 1.
    method : str
        Method of the additional run.
    step_choice : StepChoice | None
        Choice of the time step, if it was chosen for a tolerance.
    corrected : StoryPeaks | None
        Peaks of the additional run, which are more accurate; None if a collapse ended the run.
    elements : ElementValues | None
        Estimated errors of the elements of stories with several elements.
    hysteretic_energy : ndarray | None
        Estimated errors of `Response.hysteretic_energy`, J.
    history : History | None
        History of the additional run, if the errors of a history in memory were estimated.
    of_contacts : callable | None
        Function that returns contacts with their estimated errors, for which it repeats the
        additional run; None without stops.
    """

    errors: StoryErrors
    time_steps: tuple[float, ...]
    drift_error: float | None
    drift_story: int | None
    method: str = ""
    step_choice: StepChoice | None = None
    corrected: StoryPeaks | None = None
    elements: "ElementValues | None" = None
    hysteretic_energy: Array | None = field(default=None, compare=False)
    history: "History | None" = field(default=None, compare=False)
    of_contacts: "Callable[[tuple[LinkContact, ...]], tuple[LinkContact, ...]] | None" = field(
        default=None, compare=False
    )

    def _headline(self) -> str:
        if self.drift_error is None:
            return "without an estimate"
        return f"by {self.method}: drifts {self.drift_error:.2g} (story {self.drift_story})"

    @classmethod
    def of(cls, stories: StoryPeaks, errors: StoryErrors, **more: Any) -> "ErrorEstimate":
        """Return an error estimate after computing its maximum relative drift error and the story.

        Parameters
        ----------
        stories : StoryPeaks
            Peaks of the run.
        errors : StoryErrors
            Estimated errors of the peaks.
        more
            Other attributes by name.
        """
        drift = stories.peak_drift
        # A story without drift has the relative error 0 if it does not move in the additional run
        # either, otherwise inf.
        without_drift = np.where(errors.peak_drift > 0.0, np.inf, 0.0)
        relative = np.divide(errors.peak_drift, drift, out=without_drift, where=drift > 0.0)
        worst = int(np.argmax(relative))
        return cls(errors, drift_error=float(relative[worst]), drift_story=worst + 1, **more)


@immutable
class DevicePeaks(WithTable):
    """Peaks of the attachments and then the links of a building.

    Attributes
    ----------
    stories : StoryPeaks
        Peaks, as of stories: the drift is the deformation (the stroke of an attachment), the shear
        the force of the spring. Displacement, velocity and acceleration are motions of the mass.
    dissipated_energy : ndarray
        Energies dissipated by spring and dashpot since the start, J.
    interstep_bound : StoryErrors | None
        As for a `Response`; None for a run of a batch, which has no error estimate.
    errors : StoryErrors | None
        Estimated errors.
    dissipated_energy_error : ndarray | None
        Estimated errors of the dissipated energies, J.
    fracture_time, fracture_drift : ndarray | None
        Times (s; nan without a fracture) and peak deformations up to it with the sign of its side
        (m; 0 without); None if no spring has fractured. Ductilities end at the fracture.
    inerter_force, inerter_force_error : ndarray | None
        Maximum absolute forces of inerters and their estimated errors, N; None without inerters.
    attachments, links : tuple of str
        Names; empty for a run of a batch.
    """

    stories: StoryPeaks
    dissipated_energy: Array
    interstep_bound: StoryErrors | None = None
    errors: StoryErrors | None = None
    dissipated_energy_error: Array | None = None
    fracture_time: Array | None = None
    fracture_drift: Array | None = None
    inerter_force: Array | None = None
    inerter_force_error: Array | None = None
    attachments: tuple[str, ...] = ()
    links: tuple[str, ...] = ()

    def _headline(self) -> str:
        return f"of {', '.join((*self.attachments, *self.links))}"

    def larger(self, other: "DevicePeaks | None") -> "DevicePeaks | None":
        """Return the larger peaks of two runs with the same attachments and links, which act in
        both directions separately, and the sums of their energies; None with other ones."""
        if other is None or (self.attachments, self.links) != (other.attachments, other.links):
            return None
        # A fracture is reported with its direction; errors can be unknown in one direction.
        larger: DevicePeaks = each_array(lambda *values: np.fmax(*np.abs(values)), self, other)
        energies = {
            name: each_array(add, getattr(self, name), getattr(other, name))
            for name in ("dissipated_energy", "dissipated_energy_error")
        }
        return replace(larger, fracture_time=None, fracture_drift=None, **energies)

    def demands(self, attachments: int) -> dict[str, Array]:
        """Return the demands of one run that limits apply to (`tdint.model.limits`), shape
        (1, attachments) or (1, links); `attachments` is the number of attachments."""
        from tdint.model.limits import device_demands

        peaks = self.stories
        return device_demands(
            peaks.peak_drift[np.newaxis],
            peaks.peak_shear[np.newaxis],
            peaks.peak_damper_force[np.newaxis],
            attachments,
        )


@dataclass(frozen=True)
class Collapse:
    """First time when a drift ratio exceeded the collapse drift or a story failed.

    Attributes
    ----------
    time : float
        End of the time step where the collapse occurred, s.
    story : int
        Story, from 1.
    ended : bool
        True if the run ends at this time: the building can yield, or the integration then failed.
    failed : bool
        True if the story lost its resistance according to its law; False if its drift ratio
        exceeded the limit.
    is_unbounded : bool
        True if the integration failed after the collapse, because the motion grew without bound.
    """

    time: float
    story: int
    ended: bool
    failed: bool = False
    is_unbounded: bool = False

    @property
    def status(self) -> str:
        """Status as in `Response`."""
        return "failed-story" if self.failed else "collapsed"


@dataclass(frozen=True, eq=False)
class EventResponse:
    """Response to a single event of a sequence, until the ground motion of the next event or to the
    end.

    Attributes
    ----------
    record : Record
        Scaled ground motion.
    start : float
        Time of its first sample in the sequence, s.
    stories : StoryPeaks
        Peaks in this time. Displacements are relative to the initial position, so they include
        residual displacements of earlier events.
    interstep_bound : StoryErrors
        As in `Response`.
    errors : StoryErrors | None
        Estimated errors of the peaks, if requested.
    """

    record: "Record"
    start: float
    stories: StoryPeaks
    interstep_bound: StoryErrors
    errors: StoryErrors | None = None


@immutable
class Resultant(Described):
    """Peaks over time of the resultant of a quantity, arrays over the stories or floors, SI units.

    Attributes
    ----------
    value : ndarray
        Peak of sqrt(x^2 + y^2).
    time : ndarray
        Time of the peak, s.
    direction : ndarray
        Direction at this time, degrees from x to y, from 0 to 360.
    x, y : ndarray
        Peaks of the absolute values in both directions.
    error : ndarray
        Estimated error of `value`; nan if it is unknown.
    """

    value: Array
    time: Array
    direction: Array
    x: Array
    y: Array
    error: Array

    @property
    def srss(self) -> Array:
        """Square root of the sum of the squares of x and y: an upper limit of `value`."""
        return np.hypot(self.x, self.y)

    @property
    def rule_100_30(self) -> Array:
        """Combination 100 % + 30 % of x and y, the larger of both (EN 1998-1, 4.3.3.5.1)."""
        return np.maximum(self.x + 0.3 * self.y, 0.3 * self.x + self.y)


@immutable
class Resultants(Described):
    """Resultants of each floor (displacement, absolute acceleration) and story (drift, shear).

    The shear of the first story is the base shear.
    """

    displacement: Resultant
    drift: Resultant
    absolute_acceleration: Resultant
    shear: Resultant

    def _headline(self) -> str:
        largest = int(np.argmax(self.drift.value))
        value, direction = self.drift.value[largest], self.drift.direction[largest]
        return f"largest drift {value:.4g} m in story {largest + 1}, {direction:.4g} degrees from x"


@immutable
class Response(Tabular):
    """Result of a run.

    Attributes
    ----------
    status : str
        `done`; `collapsed` if a drift ratio exceeded the model's collapse drift; `failed-story` if
        a story lost its resistance before.
    model, record : Model, Record or None
        Building and its scaled ground motion.
    method : str
        Method specification as given: name and specified parameters.
    dt, steps : float, int
        Time step (s) and number of steps.
    iterations, substeps, branch_changes : int
        Number of solves, of steps that were halved to converge, and of located branch changes.
    solver_time : float
        Time of the compiled time loop, s, by `tdint.system.clock`: processor time if available.
    stories : StoryPeaks
        Peak responses of each story and floor, SI units, arrays of shape (n,).
    energy : Energy
        Energy balance at the end of the run, J.
    history : History | None
        Response history, if it was requested: a row for each step to the end of the run, which
        includes the motion after the record.
    record_rows : int
        Number of rows of a history up to the last sample of the record.
    collapse : Collapse | None
        Time and story, if the status is `collapsed` or `failed-story`.
    interstep_bound : StoryErrors
        Possible excess of the peaks between time steps that do not resolve the motion, in their
        units; 0 if the time step resolves it. For residual drifts: their change between the
        requested time and the end of the last step.
    growth : float
        Growth of the peaks after a requested end of the run, relative to the peaks (approximate); 0
        if they do not grow, or if the run has continued.
    residual_oscillation : ndarray, shape (n,)
        Approximate amplitudes of the drifts about their positions of rest at the end, m, without
        forces on floors.
    check : ErrorEstimate | None
        Estimated errors, unless they were omitted.
    history_chunks : callable | None
        Returns the history in chunks when called with a number N: every N-th step. The time
        integration is repeated, so that the complete history does not need to be in memory.
    time_at_rest : float | None
        Time when the building was at rest, s, if the run was continued until rest and reached
        it.
    notes : tuple of str
        Information on the run for the user.
    warnings : tuple of str
        Warnings that affect the meaning of the results.
    events : tuple of EventResponse
        For a sequence: the response to each event up to the event where the run ended. `record`
        and `stories` are the values of the complete sequence.
    gradient : Gradient | None
        Derivatives of the peaks, if requested (`tdint.response.runs.gradient`).
    devices : DevicePeaks | None
        Peaks of attachments and links; None without attachments and links.
    flexure : FlexurePeaks | None
        Moments, rotations and parts of the drifts of flexural stories; None for other stories.
    elements : ElementPeaks | None
        Results of the elements of stories with several elements; None without such stories.
    final_state : RunState
        State at the end of the run: `run(..., initial=response.final_state)` continues the run.
    directions : tuple of Response
        Runs along x and y of a building in two directions (`stories` contains the resultants);
        empty for a single direction.
    resultants : Resultants | None
        Resultants of displacements, drifts, accelerations and shears in two directions, with their
        times and directions; None for one direction.
    """

    model: "Model"
    record: "Record | None"
    status: str
    method: str
    dt: float
    steps: int
    iterations: int
    substeps: int
    branch_changes: int
    solver_time: float
    stories: StoryPeaks
    energy: "Energy"
    history: "History | None"
    notes: tuple[str, ...]
    interstep_bound: StoryErrors
    residual_oscillation: Array
    final_state: "RunState" = field(compare=False)
    collapse: Collapse | None = None
    check: ErrorEstimate | None = None
    time_at_rest: float | None = None
    history_chunks: Callable[..., Iterator["History"]] | None = field(default=None, compare=False)
    warnings: tuple[str, ...] = ()
    events: tuple["EventResponse", ...] = ()
    gradient: "Gradient | None" = None
    devices: DevicePeaks | None = None
    flexure: "FlexurePeaks | None" = None
    elements: "ElementPeaks | None" = None
    growth: float = 0.0
    record_rows: int = 0
    directions: "tuple[Response, ...]" = ()
    resultants: Resultants | None = None

    @property
    def contacts(self) -> "tuple[LinkContact, ...]":
        """Closings of links with stops, with their times, forces, energies and estimated errors.
        Without a kept history, the time integration is repeated."""
        # Imported here, because few models have stops.
        from tdint.response.runs.contacts import contacts_of, has_stops

        if self.directions:
            return tuple(contact for part in self.directions for contact in part.contacts)
        from tdint.response.runs.history import History

        history, repeat = self.history, self.history_chunks
        if not has_stops(self.model) or (history is None and repeat is None):
            return ()
        if history is None and repeat is not None:
            history = History.joined(repeat(1))
        assert history is not None
        contacts = contacts_of(self.model, history)
        estimate = self.check.of_contacts if self.check else None
        return estimate(contacts) if estimate else contacts

    @property
    def hysteretic_energy(self) -> Array:
        """Energy that the restoring force of each story has dissipated since the start of the run,
        J, shape (n,): the work of the force minus the stored elastic energy; of two directions the
        sum."""
        if self.directions:
            x, y = self.directions
            return x.hysteretic_energy + y.hysteretic_energy
        spent = self.final_state.space.law_state[rows.ENERGY_SPENT, : len(self.model.stories)]
        # The difference of work and stored energy of an elastic story is a rounding error.
        size = self.stories.peak_shear * self.stories.peak_drift
        return np.where(np.abs(spent) <= ENERGY_ROUNDING * size, 0.0, spent)

    def damage_index(
        self, ultimate_drift: Numbers, *, energy_weight: float = 0.05, kunnath: bool = False
    ) -> Array:
        """Return the damage index of Park and Ang (1985) of each story, shape (n,); nan after a
        collapse, and for a story that does not yield.

        The index of the building is the mean of the indices, weighted by `hysteretic_energy`.

        Parameters
        ----------
        ultimate_drift : float or array, shape (n,)
            Drifts at failure under monotonic load, m.
        energy_weight : float
            Weight of the energy; default 0.05.
        kunnath : bool
            True for the index of Kunnath et al. (1992); default False.

        Raises
        ------
        UsageError
            An ultimate drift does not exceed the drift at yield, or there are two directions.
        """
        if self.directions:
            raise UsageError("a damage index requires one direction; use each of `directions`")
        # Imported here, because few runs need them.
        from tdint.model.building import yield_strength
        from tdint.response.runs.damage_index import park_ang

        if self.collapse is not None:
            return np.full(len(self.model.stories), np.nan)
        # Without the columns of attachments and links
        yield_drift = self.final_state.building.yield_drift[: len(self.model.stories)]
        yield_drift = np.where(np.isfinite(yield_drift), yield_drift, np.nan)
        return park_ang(
            self.stories.peak_drift,
            self.hysteretic_energy,
            ultimate_drift=np.broadcast_to(ultimate_drift, yield_drift.shape),
            yield_drift=yield_drift,
            yield_force=np.array([yield_strength(story) for story in self.model.stories]),
            energy_weight=energy_weight,
            kunnath=kunnath,
        )

    def limit_checks(self, limit: float | str | None = None) -> "tuple[LimitCheck, ...]":
        """Compare the demands with limits.

        A building that collapsed does not meet any limit, regardless of the demands. In two
        directions, strokes and forces of attachments and links are the larger of both.

        Parameters
        ----------
        limit : float or str, optional
            Drift limit that is used instead of the limits of the model, or the name of a
            performance level of the model. By default, all limits of the model.

        Returns
        -------
        tuple of LimitCheck
            One comparison for each limit.

        Raises
        ------
        UsageError
            No story has a height, or the model does not have the performance level.
        """
        if limit is None and not self.model.limits:
            return ()
        # Imported here, because most models have no limits.
        from tdint.model.limits import check_demands

        stories = self.stories
        peaks = dict(vars(each_array(itemgetter(np.newaxis), stories)))
        if self.devices is not None:
            peaks |= self.devices.demands(len(self.model.attachments))
        return check_demands(
            self.model.limits,
            limit,
            peaks,
            stories.height,
            [self.record.name if self.record else ""],
            name=self.model.name,
            has_failure=self.collapse is not None,
        )

    @property
    def isolator_check(self) -> "LimitCheck | None":
        """Peak displacement of the isolators, as a comparison with an infinite limit; None without
        isolators.
        """
        from tdint.model.limits import isolator_check

        isolators = [i for i, story in enumerate(self.model.stories, start=1) if story.isolator]
        peaks = {"peak_drift": self.stories.peak_drift[np.newaxis]}
        # The last argument is the list of the names of the motions.
        return isolator_check(isolators, peaks, self.stories.height, [""])

    def _headline(self) -> str:
        story = int(np.argmax(self.stories.peak_drift))
        return (
            f"of {self.model.name!r}: {self.status}, {self.method}, "
            f"{pluralize(self.steps, 'step')} "
            f"of {self.dt:.6g} s, largest drift {self.stories.peak_drift[story]:.4g} m in story "
            f"{story + 1}{first_warning(self.warnings)}"
        )


DIVERGED, NOT_CONVERGED, UNSTABLE, NO_STEP = FAILED = NO_RESULT
"""Status values of runs without a result."""


if TYPE_CHECKING:

    class ResponseWithHistory(Response):
        """Result of a run with `history=True`."""

        history: History

else:
    ResponseWithHistory = Response  # only type checkers distinguish both


@dataclass(eq=False, repr=False)
class FailedRun(AnalysisError):
    """Exception for a run without a result: it ended early or was rejected.

    Attributes
    ----------
    message : str
        Description for the user.
    status : str
        `diverged`, `not-converged`, `unstable-step` or `not-within-tolerance`.
    method, dt : str, float
        Method specification as given, and time step, s.
    time : float
        Last time reached, s.
    story : int | None
        Story, from 1, that did not converge, had unbounded drift, or was least accurate for a
        tolerance.
    residual : float | None
        If a step did not converge: residual divided by the force of the story.
    energy : float | None
        If the motion grew without bound: kinetic energy at the last time, J, if it is finite.
    largest_stable_dt : float | None
        If the time step was rejected: largest stable time step, s; 0 if it does not exist.
    notes : tuple of str
        Information on the run for the user.
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
        """True if the same run may reach its end with a smaller time step."""
        return self.status in (DIVERGED, NOT_CONVERGED)
