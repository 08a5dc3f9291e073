"""Content of a model file as typed values in SI units.

`tdint.model.config.model_file` reads the file. This module also builds models without a file, for
problems that are part of tdint, and models with changed parameters, for sweeps and sensitivities.
"""

from __future__ import annotations

import itertools
import math
import pathlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from typing import TYPE_CHECKING, Any, NamedTuple

from tdint.errors import UsageError
from tdint.files import STDIN
from tdint.ground_motion.choice import RecordChoice
from tdint.kernels.laws.law import DriftLaw
from tdint.model.parameters import changes_of, check_parameter, check_value
from tdint.model.story import Path, Story, is_linear, spring_label, story_with_numbers
from tdint.model.story_laws import LAWS, of_samples
from tdint.number_parsing import number_or_nan, parse_ratio, pluralize
from tdint.units import SI, OutputUnits, parse_in_units

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from tdint.model.damage_states import DamageStates
    from tdint.model.limits import Limit


class RayleighRatio(NamedTuple):
    """Rayleigh damping through the damping ratios of two modes, or damping proportional to the
    stiffness through the ratio of a single mode.

    Attributes
    ----------
    ratios : tuple of float
        Damping ratio in each of the modes, in [0, 1).
    modes : tuple of int
        Two different modes, or a single mode, counted from 1. If both are 1 (a building with one
        story), the mode has the first ratio, half from the mass and half from the stiffness.
    tangent : bool
        True if the damping follows the tangent stiffness of the stories.
    """

    ratios: tuple[float, ...]
    modes: tuple[int, ...]
    tangent: bool = False


class RayleighCoefficients(NamedTuple):
    """Rayleigh damping C = mass M + stiffness K.

    Attributes
    ----------
    mass : float
        Coefficient of the mass matrix, 1/s, zero or positive.
    stiffness : float
        Coefficient of the stiffness matrix, s, zero or positive.
    tangent : bool
        True for the tangent stiffness, False for the initial stiffness.
    """

    mass: float
    stiffness: float
    tangent: bool = False


class ModalDamping(NamedTuple):
    """Modal damping for the modes of the initial stiffness. It does not change during yielding.

    The modes are the modes of the stories, without attachments and links.

    Attributes
    ----------
    ratios : tuple of float
        Damping ratios in [0, 1) of the first modes in order. The last ratio also applies to all
        further modes; it is 0 if they are undamped.
    p_delta : bool
        True if P-delta reduces the stiffness of these modes.
    """

    ratios: tuple[float, ...]
    p_delta: bool = True


Damping = RayleighRatio | RayleighCoefficients | ModalDamping | None
"""Damping in addition to dashpots; None for an undamped building."""


@dataclass(frozen=True)
class RecordSource:
    """Source of the ground motion.

    Attributes
    ----------
    file : str
        Path, resolved relative to the directory of the model file; `-` is standard input.
    choice : RecordChoice
        Component, units and processing before scaling. The path of the station metadata is resolved
        like `file`.
    scale : float
        Factor on the acceleration, not zero.
    """

    file: str
    choice: RecordChoice = field(default_factory=RecordChoice)
    scale: float = 1.0


class Force(NamedTuple):
    """Harmonic force p = cosine cos(omega t) + sine sin(omega t) on one floor.

    Attributes
    ----------
    floor : int
        Floor, counted from 1 at the bottom.
    cosine, sine : float
        Amplitudes, N.
    omega : float
        Circular frequency, rad/s, zero or positive.
    """

    floor: int
    cosine: float
    sine: float
    omega: float


@dataclass(frozen=True, repr=False)
class LoadTable:
    """Times and values of forces, from a file or from the points of a model file.

    A value is linear between the rows and zero before the first and after the last row. Two rows
    with the same time are a jump. Tables are equal if their names and values are equal.

    Attributes
    ----------
    source : str
        File as the user named it; empty for points of the model file.
    columns : tuple of str
        Names of the columns of values, as in the file.
    data : ndarray, shape (rows, 1 + columns)
        Times (s), then the values of each column (N). The rows of the array are contiguous, because
        kernels read it without a copy, and a time step reads the values of all floors at a time.
    sha256 : str
        SHA-256 of the file; empty for points.
    digest : str
        SHA-256 of `data`.
    """

    source: str
    columns: tuple[str, ...]
    data: NDArray[np.float64] = field(compare=False)
    sha256: str = field(default="", compare=False)
    digest: str = field(init=False)

    def __post_init__(self) -> None:
        import hashlib  # most models have no tables of forces

        object.__setattr__(self, "digest", hashlib.sha256(self.data.data).hexdigest())

    @property
    def times(self) -> NDArray[np.float64]:
        """Times of the rows, s."""
        times: NDArray[np.float64] = self.data[:, 0]
        return times


class TableForce(NamedTuple):
    """Force on one floor from a column of a table.

    Attributes
    ----------
    floor : int
        Floor, counted from 1 at the bottom.
    table : LoadTable
        Table, which forces on several floors can share.
    column : int
        Index of the column of values, from 0.
    factor : float
        Factor on the values.
    start : float
        Time that is added to the times of the table, s.
    """

    floor: int
    table: LoadTable
    column: int
    factor: float
    start: float

    @property
    def times(self) -> NDArray[np.float64]:
        """Times of the points, s."""
        return self.table.times + self.start

    @property
    def values(self) -> NDArray[np.float64]:
        """Force at the points, N."""
        values: NDArray[np.float64] = self.factor * self.table.data[:, 1 + self.column]
        return values


@dataclass(frozen=True)
class Excitation:
    """Ground motion and forces. Without both, the building performs free vibration."""

    record: RecordSource | None
    forces: tuple[Force, ...] = ()
    tables: tuple[TableForce, ...] = ()

    @property
    def has_forces(self) -> bool:
        """True if forces act on floors."""
        return bool(self.forces or self.tables)

    def is_zero_at(self, time: float) -> bool:
        """Return True if no force acts on a floor at a time (s) and afterwards, unless a table
        continues."""
        import numpy as np

        return not any(force.cosine or force.sine for force in self.forces) and all(
            np.interp(time, force.times, force.values, left=0.0, right=0.0) == 0.0
            for force in self.tables
        )

    @property
    def table_end(self) -> float:
        """Time when the last force from a table ends, s; 0 without tables."""
        return max((float(force.times[-1]) for force in self.tables), default=0.0)


class Attachment(NamedTuple):
    """Mass on a floor, with its spring and dashpot: an absorber, a tank or equipment.

    Attributes
    ----------
    name : str
        Name in tables, unique among attachments and links.
    floor : int
        Floor of the attachment, counted from 1; 0 for the ground.
    spring : Story
        Spring and dashpot, and as mass of its floor the attached mass.
    """

    name: str
    floor: int
    spring: Story


class Link(NamedTuple):
    """Spring, dashpot or both between two floors, or between a floor and the ground.

    Attributes
    ----------
    name : str
        Name in tables, unique among attachments and links.
    ends : tuple of int
        Start and end. Floors are counted from 1, attachments continue after the roof, and 0 is the
        ground. The deformation is the displacement of the end minus that of the start.
    spring : Story
        Spring and dashpot; the mass is 0, and also the stiffness of a link without a spring.
    """

    name: str
    ends: tuple[int, int]
    spring: Story

    @property
    def sign(self) -> float:
        """Deformation divided by the displacement of the upper floor minus the lower floor."""
        return 1.0 if self.ends[0] < self.ends[1] else -1.0


@dataclass(frozen=True, eq=False)
class Matrices:
    """Matrices of a linear model, which replace the springs of its stories.

    The equation of motion is (M + B) a + C v + K u = -M r ag + p with the influence vector r. Each
    row is a displacement, m, of a floor or of another point.

    Attributes
    ----------
    stiffness : ndarray
        K, N/m; empty for flexural stories, which determine it.
    names : tuple of str
        Names of rows that are not floors; empty if the rows are the floors of the stories.
    mass : ndarray
        M, kg; empty for the masses of the floors.
    damping : ndarray
        C, N s/m; empty for the damping of the model.
    influence : tuple of float
        r: displacements of the rows for a unit displacement of the ground; empty if all are 1.
    base : tuple of float
        Stiffness of the springs under flexural stories for rotation and translation, N m/rad and
        N/m; infinite for a fixed base.
    inertance : ndarray
        B, kg; empty without inerters.
    base_dashpots : tuple of float
        Dashpots beside the springs of `base`, N m s/rad and N s/m.
    base_inertia : tuple of float
        Rotary inertia (kg m^2) and mass (kg) of the base.
    """

    stiffness: NDArray[np.float64] | tuple[()] = ()
    names: tuple[str, ...] = ()
    mass: NDArray[np.float64] | tuple[()] = ()
    damping: NDArray[np.float64] | tuple[()] = ()
    influence: tuple[float, ...] = ()
    base: tuple[float, float] = (math.inf, math.inf)
    inertance: NDArray[np.float64] | tuple[()] = ()
    base_dashpots: tuple[float, float] = (0.0, 0.0)
    base_inertia: tuple[float, float] = (0.0, 0.0)

    @property
    def base_rows(self) -> list[int]:
        """Motions of the base that are rows, because they have an inertia or a dashpot: 0 for the
        rotation, 1 for the displacement."""
        return [k for k in (0, 1) if self.base_dashpots[k] or self.base_inertia[k]]


@dataclass(frozen=True)
class Initial:
    """Displacement (m) and velocity (m/s) at t = 0 relative to the ground.

    Attributes
    ----------
    displacement, velocity : tuple of float
        One value per floor.
    attachments : tuple of (float, float)
        Displacement and velocity of each attachment; nan for the value of its floor. Empty without
        values for attachments.
    """

    displacement: tuple[float, ...]
    velocity: tuple[float, ...]
    attachments: tuple[tuple[float, float], ...] = ()

    @property
    def moves(self) -> bool:
        """True if a floor or an attachment is not in its position at rest."""
        values = (*self.displacement, *self.velocity, *itertools.chain(*self.attachments))
        return any(value and not math.isnan(value) for value in values)


@dataclass(frozen=True)
class Analysis:
    """Analysis settings of the model file; None for settings that it does not specify.

    Attributes
    ----------
    method : str | None
        Method with its parameters, as on the command line. The catalogue of methods checks it
        later.
    dt : float | None
        Time step, s, positive.
    duration : float | None
        Duration, s, positive.
    """

    method: str | None
    dt: float | None
    duration: float | None


@dataclass(frozen=True, repr=False)
class Model:
    """Validated model in SI units.

    Attributes
    ----------
    name : str
        Name of the building. Default: name of the file without suffix, or `model` for a stream.
    source : str
        File as the user named it; `-` for standard input.
    text : bytes
        Content of the file, for its SHA-256.
    stories : tuple of Story
        Stories from the ground up; entries with `repeat` are expanded.
    damping : Damping
        Damping in addition to dashpots.
    p_delta : bool
        True if gravity acts on the displaced building, in each story that does not specify its
        P-delta. Stories with P-delta have a height (`p_delta_stories`).
    excitation : Excitation
        Ground motion and forces.
    initial : Initial
        State at t = 0.
    analysis : Analysis
        Method, time step and duration, if the file specifies them.
    collapse_drift : float
        Drift ratio above which a run is reported as collapsed, positive.
    output_units : OutputUnits
        Units of tables and summaries.
    page_units : OutputUnits
        Units of reports: `output_units` of the file, otherwise the units of the file.
    page_head : tuple of (str, str)
        Names and texts of the lines at the top of a report.
    varied_parameters : tuple of (str, float)
        Names and values of the parameters that `replace` has changed.
    label : str
        Name of the variation of the building.
    damage : DamageStates | None
        Damage states of the building.
    plausibility_off : str
        Reason for disabled plausibility checks (`plausibility: off, ...`); empty if the checks are
        enabled.
    limits : tuple of Limit
        Limits of demands, in the order of the file.
    weight_factor : float
        Masses of the model over the true masses if the values of the key `mass` are weights in the
        unit of force of the file; 1 if the file specifies weights or derives the stories.
    units : OutputUnits
        Units of the numbers of the file.
    attachments : tuple of Attachment
        Masses on floors that are not part of the chain of stories.
    links : tuple of Link
        Springs and dashpots between any two floors.
    matrices : Matrices | None
        Matrices of a linear model, which replace the springs of the stories: their stiffness is
        nan. Rows that are not floors are stories without a height.
    document : Node | None
        Nodes of the model file (`tdint.model.keys.nodes`), for `to_dict`.
    across : Model | None
        Model of direction y, if the file has two directions; all other attributes then describe
        direction x. If the ground motion of x has two components, y has no ground motion.
    axis_azimuth : float | None
        Azimuth of axis x, degrees clockwise from north; None for the azimuth of the first
        component.
    """

    name: str
    source: str
    text: bytes
    stories: tuple[Story, ...]
    damping: Damping
    p_delta: bool
    excitation: Excitation
    initial: Initial
    analysis: Analysis
    collapse_drift: float
    output_units: OutputUnits = SI
    page_units: OutputUnits = SI
    page_head: tuple[tuple[str, str], ...] = ()
    varied_parameters: tuple[tuple[str, float], ...] = ()
    label: str = ""
    damage: DamageStates | None = None
    plausibility_off: str = ""
    limits: tuple[Limit, ...] = ()
    weight_factor: float = 1.0
    units: OutputUnits = SI
    attachments: tuple[Attachment, ...] = ()
    links: tuple[Link, ...] = ()
    matrices: Matrices | None = None
    document: Any = field(default=None, compare=False)
    across: Model | None = None
    axis_azimuth: float | None = None

    @property
    def directions(self) -> tuple[Model, ...]:
        """Models of direction x and of direction y, or only the model of a single direction."""
        return (self,) if self.across is None else (replace(self, across=None), self.across)

    def in_directions(self, **values: Any) -> Model:
        """Return the model with new values of attributes, in both directions if it has two.

        Parameters
        ----------
        **values : any
            Values by name of the attribute.

        Returns
        -------
        Model
            Copy with the values.
        """
        across = None if self.across is None else replace(self.across, **values)
        return replace(self, across=across, **values)

    def to_dict(self) -> dict[str, Any]:
        """Return the content of the model file, which `load_model` accepts.

        Numbers are in the units of the file. Paths of records, inventories and forces refer to the
        working directory.

        Returns
        -------
        dict
            Mappings, lists, numbers and text.

        Raises
        ------
        UsageError
            The model was not read from a file or a mapping, or parameters were changed afterwards.
        """
        # Imported here, because only this method reads a file again.
        from tdint.model.keys.fields import resolve
        from tdint.model.keys.nodes import plain_values

        if self.document is None or self.varied_parameters:
            raise UsageError(
                f"{self.name} has changed parameters, which its file does not state; change the "
                "content of the model before load_model"
                if self.varied_parameters
                else f"{self.name} was not read from a file or a mapping"
            )
        content: dict[str, Any] = plain_values(self.document)
        excitation, folder = content.get("excitation") or {}, pathlib.Path(self.source).parent
        for loads in (excitation, excitation.get("x") or {}, excitation.get("y") or {}):
            record = loads.get("record")
            if isinstance(record, str) and record != STDIN:
                loads["record"] = resolve(record, folder)
            for files in (record, *(loads.get("forces") or ())):
                for name in ("file", "inventory"):
                    if isinstance(files, dict) and files.get(name, STDIN) != STDIN:
                        files[name] = resolve(files[name], folder)
        return content

    @property
    def rows(self) -> tuple[str, ...]:
        """Names of the rows of a model with rows that are not floors; empty for a building."""
        return self.matrices.names if self.matrices else ()

    @property
    def devices(self) -> tuple[Attachment | Link, ...]:
        """Attachments and links: all springs in addition to the stories."""
        return (*self.attachments, *self.links)

    @property
    def springs(self) -> tuple[tuple[str, Story], ...]:
        """Springs of stories, attachments and links, with their labels as in names of parameters,
        such as `stories[1]` and `links[damper]`."""
        return (
            *((f"stories[{number}]", story) for number, story in enumerate(self.stories, start=1)),
            *((f"attachments[{item.name}]", item.spring) for item in self.attachments),
            *((f"links[{item.name}]", item.spring) for item in self.links),
        )

    @property
    def has_inertance(self) -> bool:
        """True if a story, an attachment or a link has an inerter."""
        return any(spring.inertance for _, spring in self.springs)

    @property
    def has_linear_springs(self) -> bool:
        """True if all springs of stories, attachments and links have linear laws and dampers."""
        return all(is_linear(spring) for _, spring in self.springs)

    def end_name(self, end: int) -> str:
        """Return the name of an end of a link: ground, the number of a floor, a row, or an
        attachment.

        Parameters
        ----------
        end : int
            0 for the ground, the number of a floor, or for attachment j (from 1) the number of
            stories plus j.
        """
        if end > len(self.stories):
            return self.attachments[end - len(self.stories) - 1].name
        if end and self.rows:
            return self.rows[end - 1]
        return str(end) if end else "ground"

    def require_springs(self, subject: str) -> None:
        """Raise UsageError if matrices or flexural stories replace the springs of the stories.

        Parameters
        ----------
        subject : str
            Computation that needs springs, such as `pushover`.
        """
        if self.matrices is not None:
            raise UsageError(
                f"{self.source}: {subject} needs springs of stories, which a model of matrices or "
                "flexural stories does not have; use run, modes or a campaign"
            )

    def require_chain(self, subject: str) -> None:
        """Raise UsageError if the building has attachments or links, or rows that are not floors.

        Parameters
        ----------
        subject : str
            Computation that does not support them, such as `pushover`.
        """
        if self.devices:
            raise UsageError(
                f"{self.source}: {subject} does not support attachments and links; use time "
                "histories, or omit them"
            )
        self.require_floors(subject)

    def require_floors(self, subject: str) -> None:
        """Raise UsageError if the model has rows that are not floors, as `require_chain`.

        Parameters
        ----------
        subject : str
            Computation that is for floors only.
        """
        if self.rows:
            raise UsageError(
                f"{self.source}: {subject} is for floors, not for rows of `matrices`; use `tdint "
                "run` with one record, or `stories` with a `stiffness_matrix`"
            )

    @property
    def p_delta_stories(self) -> tuple[bool, ...]:
        """For each story, True if gravity acts on the displaced story."""
        return tuple(
            self.p_delta if story.p_delta is None else story.p_delta for story in self.stories
        )

    @property
    def has_p_delta(self) -> bool:
        """True if gravity acts on at least one displaced story."""
        return any(self.p_delta_stories)

    def without_p_delta(self) -> Model:
        """Return the building without P-delta in any story."""
        stories = tuple(replace(story, p_delta=None) for story in self.stories)
        return replace(self, stories=stories, p_delta=False)

    @property
    def has_dashpots(self) -> bool:
        """True if a story, an attachment, a link or the base has a dashpot."""
        springs = (*self.stories, *(device.spring for device in self.devices))
        of_base = self.matrices.base_dashpots if self.matrices else ()
        return any(of_base) or any(spring.dashpot or spring.power_dashpot for spring in springs)

    @property
    def has_samples(self) -> bool:
        """True if `assemble` accepts arrays over samples."""
        is_chain = not (self.devices or self.matrices or self.has_inertance or self.across)
        return (
            is_chain
            and not getattr(self.damping, "tangent", False)
            and all(
                story.rayleigh and not story.elements and not any(story.law.fracture)
                for story in self.stories
            )
        )

    @property
    def forces_of_total_shear(self) -> str:
        """Forces that total shears contain in addition to the restoring forces, such as
        `P-delta and viscous forces`; empty if both shears are equal."""
        return self._forces_of_total_shear(bool(self.links))

    @property
    def forces_of_total_base_shear(self) -> str:
        """The same forces of the base shear, which contains links to the ground only."""
        return self._forces_of_total_shear(any(0 in link.ends for link in self.links))

    def _forces_of_total_shear(self, has_links: bool) -> str:
        """Return the names of the forces."""
        forces = ["P-delta"] if self.has_p_delta else []
        if self.damping is not None or self.has_dashpots:
            forces.append("viscous forces")
        if has_links:
            forces.append("links")
        return " and ".join(filter(None, [", ".join(forces[:-1]), *forces[-1:]]))

    def replace(self, **changes: float | str) -> Model:
        """Return the building with changed parameters: `model.replace(damping=0.02)`.

        Names are from `PARAMETERS`, or keys of the model file in SI units, with the number of a
        story counted from the ground: `model.replace(**{"stories[2].law.hardening": 0.05,
        "stories.mass": 2e5})`. Without a number, all stories that have the parameter are changed.
        Modes, yield drifts and P-delta are updated.

        Parameters
        ----------
        **changes : float or str
            Values by name: a number in SI units, also if the model file has other units, or a text
            with a unit, such as `500 kN/cm` for a stiffness or `2%` for a ratio.

        Returns
        -------
        Model
            Copy with the changed parameters.

        Raises
        ------
        UsageError
            A name is unknown, a value is out of range, or no story has the parameter.
        """
        return self.changed({name: self.si_value(name, value) for name, value in changes.items()})

    def si_value(self, name: str, value: float | str) -> float:
        """Return the value of a parameter, as for `replace`, in SI units.

        Parameters
        ----------
        name : str
            Name of the parameter.
        value : float or str
            Number in SI units, or text with a unit.

        Raises
        ------
        UsageError
            The name is unknown, or the value is not a number or has a wrong unit.
        """
        check_parameter(name)
        try:
            if not isinstance(value, str):
                return float(value)
            units = self._units_of(name)[1]
            return parse_in_units(value, units, name) if units else parse_ratio(value)
        except UsageError as error:
            named = str(error).startswith(name)
            raise UsageError(str(error) if named else f"{name}: {error}") from None
        except (TypeError, ValueError, OverflowError):
            raise UsageError(f"{name} must be a number, got {value!r:.60}") from None

    def file_value(self, name: str, value: float | str) -> float:
        """Return the value of a parameter in SI units, like `si_value`.

        Parameters
        ----------
        name : str
            Name of the parameter.
        value : float or str
            Text, or number in the units of the file.
        """
        number = number_or_nan(value) if isinstance(value, str) else float(value)
        if math.isfinite(number):
            return number * self.unit_of(name)[1]
        return self.si_value(name, value)

    def unit_of(self, name: str, named: OutputUnits | None = None) -> tuple[str, float]:
        """Return the unit of a parameter and its factor to SI units; an empty text and 1 for a
        factor or a ratio. UsageError as by `si_value`.

        Parameters
        ----------
        name : str
            Name of the parameter.
        named : OutputUnits, optional
            Units instead of those of the file.
        """
        unit, units = self._units_of(name, named)
        return unit, units.get(unit, 1.0)

    def _units_of(
        self, name: str, named: OutputUnits | None = None
    ) -> tuple[str, Mapping[str, float]]:
        """Return the unit of a parameter and all its units (`Change.unit`)."""
        changes = changes_of(self.name, self.springs, name)
        springs = [spring for _, spring in self.springs]
        return changes[0].unit(springs, named or self.units) if changes else ("", {})

    def changed(self, numbers: Mapping[str, Any]) -> Model:
        """Return the building with changed parameters, like `replace` for numbers only.

        Parameters
        ----------
        numbers : mapping of str to float, or to ndarray
            Values by the names that `vary` of `run_many` accepts, SI units. Arrays over samples,
            each value in its range, return a building of many samples for `assemble`: its changed
            numbers are arrays.

        Raises
        ------
        UsageError
            A name is unknown, a value is out of range, or no story has the parameter.
        """
        if self.across is not None and numbers:
            raise UsageError(
                f"{min(numbers)} cannot be changed: {self.name} has two directions; write a model "
                "file for each value"
            )
        if self.matrices is not None and (others := numbers.keys() - {"damping"}):
            raise UsageError(
                f"{min(others)} cannot be changed: {self.name} is given by matrices or flexural "
                "stories; only damping can"
            )
        # Changes are applied in order; factors multiply values that were set before.
        damping = self.damping
        springs = [spring for _, spring in self.springs]
        changed: dict[int, dict[Path, float]] = {}  # numbers by the index of their story
        has_changed_law: set[int] = set()  # indices of stories with a changed parameter of a law
        set_by_name: set[tuple[int, Path]] = set()
        for name, value in numbers.items():
            if isinstance(value, float):
                check_value(name, value)
            if name == "damping":
                damping = damped_by(self, value)
            for change in changes_of(self.name, self.springs, name):
                if change.is_superseded(set_by_name):
                    continue
                if isinstance(value, float):
                    change.check(name, value)
                of_story = changed.setdefault(change.story, {})
                of_story[change.path] = (
                    of_story.get(change.path, change.number(springs)) * value
                    if change.factor
                    else value * change.scale
                )
                if change.sets_law_parameter:
                    has_changed_law.add(change.story)
        # Only changed stories are built again and checked by their laws, as in a file.
        for i, of_story in changed.items():
            springs[i] = story_with_numbers(springs[i], of_story, i in has_changed_law)
            for spring in springs[i].springs:
                law = LAWS[spring.law.name]
                if law.fault is DriftLaw.fault and not any(spring.law.fracture):
                    continue
                faults = of_samples(
                    partial(_fault, law, spring.law.fracture),
                    spring.stiffness,
                    *spring.law.parameters,
                )
                if fault := faults if isinstance(faults, str) else max(faults, default=""):
                    is_story = i < len(self.stories)
                    place = spring_label(i, spring) if is_story else self.springs[i][0]
                    raise UsageError(f"{self.name}: invalid variation of {place}: {fault}")
        # A parameter that has been changed before keeps its position and gets the new value.
        varied = tuple({**dict(self.varied_parameters), **numbers}.items())
        changed_springs = iter(springs[len(self.stories) :])
        return replace(
            self,
            stories=tuple(springs[: len(self.stories)]),
            attachments=tuple(
                item._replace(spring=next(changed_springs)) for item in self.attachments
            ),
            links=tuple(item._replace(spring=next(changed_springs)) for item in self.links),
            damping=damping,
            varied_parameters=varied,
        )

    def __repr__(self) -> str:
        count = len(self.stories)
        return f"<Model {self.name!r}: {pluralize(count, 'story')}>"


def _fault(law: DriftLaw, fracture: tuple[float, float], numbers: Sequence[float]) -> str:
    """Return the reason why the stiffness and the parameters of a law that fractures at the drifts
    `fracture` are invalid; empty if they are valid."""
    stiffness, *parameters = numbers
    first_yield = law.yield_drift(stiffness, parameters)
    drifts = [abs(drift) for drift in fracture if drift]
    if (fault := law.fault(stiffness, parameters)) or not (drifts and min(drifts) < first_yield):
        return fault or ""
    return (
        f"its fracture_drift is {min(drifts):.6g} m and must be at least the yield drift "
        f"{first_yield:.6g} m"
    )


def simple_model(
    name: str,
    stories: Sequence[Story],
    *,
    forces: Sequence[Force] = (),
    displacement: Sequence[float] = (),
    velocity: Sequence[float] = (),
) -> Model:
    """Return a model without ground motion, damping and P-delta.

    Parameters
    ----------
    displacement, velocity : sequence of float
        Initial state of the floors, m and m/s. Default: at rest.
    """
    zeros = (0.0,) * len(stories)
    return Model(
        name=name,
        source=name,
        text=b"",
        stories=tuple(stories),
        damping=None,
        p_delta=False,
        excitation=Excitation(None, tuple(forces)),
        initial=Initial(tuple(displacement) or zeros, tuple(velocity) or zeros),
        analysis=Analysis(None, None, None),
        collapse_drift=1.0,
    )


def damped_by(model: Model, ratio: float) -> Damping:
    """Return the damping of a model with another damping ratio in all its modes.

    Raises
    ------
    UsageError
        The model has no damping, or specifies it by coefficients.
    """
    match model.damping:
        case RayleighRatio(_, modes, tangent):
            return RayleighRatio((ratio,) * len(modes), modes, tangent)
        case ModalDamping(old_ratios) as modal:
            return modal._replace(ratios=tuple(ratio if old else 0.0 for old in old_ratios))
    has_no_ratio = "is undamped" if model.damping is None else "specifies damping by coefficients"
    raise UsageError(
        f"the damping ratio cannot be changed, because {model.name} {has_no_ratio}; specify "
        "damping ratios in the model"
    )
