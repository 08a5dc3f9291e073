"""Content of a model file as typed values in SI units.

`tdint.model.config.model_file` reads the file. This module also builds models without a file, for
problems that are part of tdint, and models with changed parameters, for sweeps and sensitivities.
"""

from __future__ import annotations

import math
import re
import sys
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import astuple, dataclass, field, replace
from functools import cache
from typing import TYPE_CHECKING, Any, NamedTuple

from tdint.errors import UsageError, did_you_mean, nearest
from tdint.ground_motion.choice import RecordChoice
from tdint.kernels.laws import LAWS as _LAWS
from tdint.kernels.laws.law import DriftLaw, LawParameter
from tdint.model.plugins import (
    Origin,
    check_name,
    declared,
    faults_of,
    home_of,
    installed,
    module_of,
    require_version,
    same_file,
)
from tdint.number_parsing import parse_ratio, pluralize
from tdint.units import SI, OutputUnits

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from tdint.model.damage_states import DamageStates
    from tdint.model.limits import Limit

# ---- Hysteretic laws: built-in laws, laws of plug-ins, and the law of a story

CODES: dict[str, int] = {name: code for code, name in enumerate(_LAWS.names())}
"""Number of each law in the tables of the kernels."""


class _LawsByName(Mapping[str, DriftLaw]):
    """Laws by name. A law is imported when it is first used."""

    def __getitem__(self, name: str) -> DriftLaw:
        """Return the law with a name, and import it if necessary."""
        law: DriftLaw = _LAWS[CODES[name]]
        return law

    def __iter__(self) -> Iterator[str]:
        return iter(CODES)

    def __len__(self) -> int:
        return len(CODES)


LAWS: Mapping[str, DriftLaw] = _LawsByName()
"""Hysteretic laws by the name in a model file: laws of `tdint.kernels.laws` and of plug-ins."""


def register_law(law: DriftLaw, where: str | Origin = "") -> None:
    """Register a hysteretic law, so that models can use it.

    The law is compiled into the time loops of the models that contain it, regardless of its
    attribute `compiled_separately`. Its functions must be defined in a module with a file. The
    module, or the module of the plug-in that lists the law, must contain the law as a variable, or
    in a tuple, list, set or dictionary, so that the compiling process can import the law.

    Parameters
    ----------
    law : DriftLaw
        See `tdint.kernels.laws.law`.
    where : str or Origin
        Origin of the law for messages. Default: its name.

    Raises
    ------
    UsageError
        The argument is not a law, its name is invalid or in use, it has no file, or a declaration
        is missing: the force is not linear, and neither `curved` nor branches are declared.
    """
    if not isinstance(law, DriftLaw):
        raise UsageError(
            f"{where or law!r}: a law must be a tdint.plugin.DriftLaw, not {type(law).__name__}"
        )
    origin = where if isinstance(where, Origin) else Origin(where or f"law {law.name!r}")
    where = origin.where
    check_name(law.name, LAWS, "law", where)
    module_name = law.functions.__module__
    if module_name == "__main__" or getattr(sys.modules.get(module_name), "__file__", None) is None:
        raise UsageError(
            f"{where}: the law must be defined in a module file, so that other processes can "
            "import it"
        )
    # Imported here, because commands without plug-ins do not need these checks.
    from tdint.kernels.building.sources import OUTSIDE, module_of_law
    from tdint.model.law_checks import verify_declaration

    with faults_of(where):
        verify_declaration(law, where)

    # The compiling process imports the law from the module in `OUTSIDE`. The number of the
    # law is its index in `_LAWS`.
    compiled_with_building = replace(law, compiled_separately=False)
    OUTSIDE[law.name] = module_of_law(law, (module_name, origin.module))
    CODES[law.name] = len(_LAWS)
    _LAWS.append(compiled_with_building)
    origin.keep_code("law", law)


@cache
def laws() -> Mapping[str, DriftLaw]:
    """Return all hysteretic laws by name, including those of entry points `tdint.laws`."""

    def register(plugin: Any, origin: Origin) -> None:
        """Register the laws of an entry point."""
        for law in declared(plugin, "LAWS", DriftLaw, origin.where):
            register_law(law, origin)

    installed("tdint.laws", register)
    return LAWS


@dataclass(frozen=True)
class Law:
    """Hysteretic law of a story with its parameters.

    Attributes
    ----------
    name : str
        A key of `LAWS`.
    parameters : tuple of float
        Values in SI units in the order of `LAWS[name].parameters`. A `many` parameter is the last
        one and is flattened. The last parameters may be omitted if they have defaults.
    """

    name: str
    parameters: tuple[float, ...]

    def __post_init__(self) -> None:
        """Append the defaults of parameters that are omitted at the end."""
        declared_parameters = LAWS[self.name].parameters if self.name in LAWS else ()
        if any(item.many or item.points for item in declared_parameters):
            return
        values = list(self.parameters)
        by_name = {
            item.name: value
            for item, value in zip(declared_parameters, values, strict=False)
            if not item.group
        }
        for item in declared_parameters[len(values) :]:
            if item.default is None:
                return
            default = by_name[item.default] if isinstance(item.default, str) else item.default
            values.append(default)
        object.__setattr__(self, "parameters", tuple(values))

    @property
    def values(self) -> dict[str, float]:
        """Parameters by the names that `vary` accepts after `stories[N].law.`, in SI units.

        Names instead of numbers and points that the model does not specify are omitted.
        """
        return {
            name: value
            for (name, _, _, declaration), value in zip(
                _named_parameters(self), self.parameters, strict=True
            )
            if not (declaration.choices or (declaration.open_ended and math.isinf(value)))
        }

    def __reduce__(self) -> tuple[Any, ...]:
        """Return the function that restores the pickled law in another process, and its arguments.

        A law of a plug-in is pickled with the path and the SHA-256 of the plug-in, so that the
        other process can load it.
        """
        plugin = home_of(LAWS.get(self.name), "LAWS")
        if plugin:
            path, digest = plugin
            return _restore_law, (self.name, self.parameters, CODES[self.name], path, digest)
        return Law, tuple(astuple(self))


@dataclass(frozen=True)
class Element:
    """Spring of a story: one of several springs in parallel, each with its own law.

    Attributes
    ----------
    name : str
        Name in tables and parameters, unique within the story.
    stiffness : float
        Initial stiffness, N/m, zero or positive.
    law : Law
        Hysteretic law.
    factor : float
        Cosine of the inclination of the element, in (0, 1]. Stiffness, law and all results are
        those in the direction of the drift. The force along the element is the force of the law
        divided by this number, and its deformation is the drift times this number.
    """

    name: str
    stiffness: float
    law: Law
    factor: float = 1.0

    def scale(self, force: int, length: int) -> float:
        """Return the factor from a number along the element to the number in the direction of the
        drift, for the unit force^`force` length^`length`."""
        return float(self.factor ** (force - length))


def _restore_law(
    name: str, parameters: tuple[float, ...], code: int, file: str, digest: str
) -> Law:
    """Restore a law of a plug-in in another process, and load the plug-in (path `file`, SHA-256
    `digest`) if necessary.

    Raises
    ------
    UsageError
        The plug-in is missing or has changed; this process uses another version of the law; or the
        law does not have the number `code` in this process, because plug-ins were loaded in another
        order.
    """
    if name in LAWS:
        require_version(LAWS[name], "LAWS", file, digest)
    else:
        module = module_of(same_file(file, digest))
        for law in declared(module, "LAWS", DriftLaw, file):
            register_law(law, Origin(file, module.__name__))
    if CODES[name] != code:
        raise UsageError(
            f"{file}: the law {name!r} of this plug-in is number {CODES[name]} of the laws in this "
            f"process, but number {code} in the process that created the model; load all plug-ins "
            "in the same order in every process"
        )
    return Law(name, parameters)


LINEAR = Law("linear", ())
SUM_OF_ELEMENTS = Law("elements", ())
"""Value of `Story.law` of a story with several elements. It is not a law: its name is not a key of
`LAWS`, so that a function that ignores the elements fails."""


def four_points(points: Sequence[Sequence[float]]) -> tuple[float, ...]:
    """Complete a backbone curve of two to four points to four points, without changing the curve.

    The points are added as in the vulnerability toolkit of GEM: to two points, points at 1/3 and
    2/3 between the two; to three points, the midpoint of the last two.

    Parameters
    ----------
    points : sequence of (float, float)
        Drift and force of each point, in any units.

    Returns
    -------
    tuple of eight floats
        Drift and force of the first point, of the second point, and so on.
    """
    (*first_points, second_last, last) = points
    added_count = 4 - len(points)
    fractions = [j / (added_count + 1) for j in range(1, added_count + 1)]
    # Interpolate drift and force linearly between the last two points.
    added_points = [
        [a + fraction * (b - a) for a, b in zip(second_last, last, strict=True)]
        for fraction in fractions
    ]
    return tuple(
        number for point in (*first_points, second_last, *added_points, last) for number in point
    )


# ---- Definition

MAX_STORIES = 100_000
"""Maximum number of stories. Without it, a typing error in `repeat` would fill the memory."""


@dataclass(frozen=True)
class PowerDashpot:
    """Dashpot with the force c v (v^2 + v0^2)^((exponent - 1) / 2) at the drift rate v.

    The force approaches c |v|^exponent for |v| much larger than v0, and a linear dashpot for |v|
    much smaller than v0.

    Attributes
    ----------
    coefficient : float
        c, N (s/m)^exponent, positive.
    exponent : float
        In (0, 2].
    linear_below : float
        v0, m/s; positive if the exponent is less than 1 and there is no brace, otherwise zero or
        positive.
    brace : float | None
        Stiffness of the brace in series with the damper, N/m; v is then the rate of the damper.
        None for a damper without a brace.
    """

    coefficient: float
    exponent: float
    linear_below: float
    brace: float | None = None


@dataclass(frozen=True)
class Story:
    """Story with the floor above it, and the spring and dashpot that support this floor.

    Attributes
    ----------
    mass : float
        Mass of the floor above, kg, positive.
    height : float | None
        Story height, m, positive; None if the file does not specify it.
    stiffness : float
        Initial stiffness, N/m, positive; of a story with elements, their sum.
    law : Law
        Hysteretic law; SUM_OF_ELEMENTS for a story with several elements.
    dashpot : float
        Viscous damper between the floors, N s/m, zero or positive.
    power_dashpot : PowerDashpot | None
        Power-law damper between the floors.
    isolator : bool
        True for an isolator: its displacement is reported instead of a drift ratio, and its height
        is used for P-delta only.
    rayleigh : bool
        True if Rayleigh damping applies to the story.
    elements : tuple of Element
        Elements of a story with several springs in parallel; empty for a story with a single law.
    damper_factor : float
        Cosine of the inclination of the dashpot, in (0, 1]. The deformation of the dashpot with its
        brace is the drift times this number, and so is the story force divided by its force.
    """

    mass: float
    height: float | None
    stiffness: float
    law: Law
    dashpot: float
    power_dashpot: PowerDashpot | None = None
    isolator: bool = False
    rayleigh: bool = True
    elements: tuple[Element, ...] = ()
    damper_factor: float = 1.0

    @property
    def springs(self) -> tuple[Element, ...]:
        """The elements, or the law of the story as its single element, without a name."""
        return self.elements or (Element("", self.stiffness, self.law),)

    @property
    def law_text(self) -> str:
        """Name of the law, or the names of the laws of the elements: `bilinear + gap`."""
        return " + ".join(spring.law.name for spring in self.springs)

    @property
    def drift_height(self) -> float | None:
        """Height of the drift ratio, m; None for isolators and for stories without height."""
        return None if self.isolator else self.height


@dataclass(frozen=True)
class RayleighRatio:
    """Rayleigh damping through the damping ratios of two modes.

    Attributes
    ----------
    ratios : tuple of float
        Damping ratio in each of the two modes, in [0, 1).
    modes : tuple of int
        Two different modes, counted from 1. For a building with one story, both are 1; its mode
        then has the first ratio, one half from the mass and one half from the stiffness.
    tangent : bool
        True if the damping follows the tangent stiffness of the stories.
    """

    ratios: tuple[float, float]
    modes: tuple[int, int]
    tangent: bool = False


@dataclass(frozen=True)
class RayleighCoefficients:
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


@dataclass(frozen=True)
class ModalDamping:
    """Modal damping for the modes of the initial stiffness. It does not change during yielding.

    Attributes
    ----------
    ratios : tuple of float
        Damping ratios in [0, 1) of the first modes in order. The last ratio applies to all further
        modes, too; it is 0 if they are undamped.
    """

    ratios: tuple[float, ...]


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


@dataclass(frozen=True)
class Force:
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

    def __init__(
        self, source: str, columns: tuple[str, ...], data: NDArray[np.float64], sha256: str = ""
    ) -> None:
        self.source = source
        self.sha256 = sha256
        self.columns = columns
        self.data = data
        import hashlib  # most models have no tables of forces

        self.digest = hashlib.sha256(data.data).hexdigest()

    def __eq__(self, other: object) -> bool:
        return isinstance(other, LoadTable) and self._identity == other._identity

    def __hash__(self) -> int:
        return hash(self._identity)

    @property
    def _identity(self) -> tuple[object, ...]:
        """Values that determine if two tables are equal."""
        return self.source, self.columns, self.digest

    @property
    def times(self) -> NDArray[np.float64]:
        """Times of the rows, s."""
        times: NDArray[np.float64] = self.data[:, 0]
        return times


@dataclass(frozen=True)
class TableForce:
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

    @property
    def table_end(self) -> float:
        """Time when the last force from a table ends, s; 0 without tables."""
        return max((float(force.times[-1]) for force in self.tables), default=0.0)


@dataclass(frozen=True)
class Initial:
    """Displacement (m) and velocity (m/s) at t = 0 relative to the ground, one per floor."""

    displacement: tuple[float, ...]
    velocity: tuple[float, ...]


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
        True if gravity acts on the displaced building. Every story has a height in this case.
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
        Name of this variation of the building.
    damage : DamageStates | None
        Damage states of the building.
    plausibility_off : str
        Reason for disabled plausibility checks (`plausibility: off, ...`); empty if the checks are
        enabled.
    limits : tuple of Limit
        Limits of demands, in the order of the file.
    weight_factor : float
        Factor by which the masses are too large if the numbers of the key `mass` are weights in the
        unit of force of the file; 1 if the file specifies weights or derives the stories.
    force_unit : str
        Unit of force of the file.
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
    force_unit: str = "N"

    @property
    def has_dashpots(self) -> bool:
        """True if a story has a dashpot."""
        return any(story.dashpot or story.power_dashpot for story in self.stories)

    @property
    def forces_of_total_shear(self) -> str:
        """Forces that total shears contain in addition to the restoring forces, such as
        `P-delta and viscous forces`; empty if both shears are equal."""
        forces = ["P-delta"] if self.p_delta else []
        if self.damping is not None or self.has_dashpots:
            forces.append("viscous forces")
        return " and ".join(forces)

    def replace(self, **changes: float | str) -> Model:
        """Return the building with changed parameters: `model.replace(damping=0.02)`.

        Names are those of `PARAMETERS`, or keys of the model file in SI units, with the number of a
        story counted from the ground: `model.replace(**{"stories[2].law.hardening": 0.05,
        "stories.mass": 2e5})`. Without a number, all stories that have the parameter are changed.
        Modes, yield drifts and P-delta are updated.

        Parameters
        ----------
        **changes : float or str
            Values by name; a text such as `2%` is a ratio.

        Returns
        -------
        Model
            Copy with the changed parameters.

        Raises
        ------
        UsageError
            A name is unknown, a value is out of range, or no story has the parameter.
        """
        numbers = {}
        for name, value in changes.items():
            check_parameter(name)
            try:
                numbers[name] = parse_ratio(value) if isinstance(value, str) else float(value)
            except (TypeError, ValueError, OverflowError):
                raise UsageError(f"{name} must be a number, got {value!r:.60}") from None
        return self.changed(numbers)

    def changed(self, numbers: Mapping[str, float]) -> Model:
        """Return the building with changed parameters, like `replace` for numbers only.

        Parameters
        ----------
        numbers : mapping of str to float
            Values by the names that `vary` of `run_many` accepts, SI units.

        Raises
        ------
        UsageError
            A name is unknown, a value is out of range, or no story has the parameter.
        """
        # Changes are applied in order; factors multiply values that were set before.
        table = [list(story_numbers(story)) for story in self.stories]
        damping = self.damping
        # Indices of the changed stories. The value is True if a parameter of the law is changed.
        changed_stories: dict[int, bool] = {}
        set_by_name: set[tuple[int, int]] = set()
        for name, value in numbers.items():
            check_value(name, value)
            if name == "damping":
                damping = damped_by(self, value)
            for change in changes_of(self, name):
                if change.is_superseded(set_by_name):
                    continue
                change.check(name, value)
                row = table[change.story]
                row[change.column] = (
                    row[change.column] * value if change.factor else value * change.scale
                )
                earlier_law_change = changed_stories.get(change.story, False)
                sets_law = earlier_law_change or change.sets_law_parameter
                changed_stories[change.story] = sets_law
        # Only changed stories are built again and checked by their laws, as in a file.
        stories = list(self.stories)
        for i, is_law_changed in changed_stories.items():
            stories[i] = _story_with_numbers(stories[i], table[i], is_law_changed)
            for spring in stories[i].springs:
                fault = LAWS[spring.law.name].fault(spring.stiffness, spring.law.parameters)
                if fault:
                    raise UsageError(
                        f"{self.name}: invalid variation of {spring_label(i, spring)}: {fault}"
                    )
        # A parameter that has been changed before keeps its position and gets the new value.
        varied = tuple({**dict(self.varied_parameters), **numbers}.items())
        return replace(self, stories=tuple(stories), damping=damping, varied_parameters=varied)

    def __repr__(self) -> str:
        count = len(self.stories)
        return f"<Model {self.name!r}: {pluralize(count, 'story')}>"


def _story_with_numbers(story: Story, numbers: Sequence[float], is_law_changed: bool) -> Story:
    """Return a story with other numbers.

    Keys that the story does not have remain absent. The stiffness of a story with elements is the
    sum of their stiffnesses. If a parameter of the law has been changed and the law defines the
    initial stiffness, the stiffness is computed from the parameters.
    """
    springs = []
    for spring, columns in zip(story.springs, spring_columns(story), strict=True):
        law = Law(spring.law.name, tuple(numbers[columns.first : columns.end]))
        compute_stiffness = LAWS[law.name].initial_stiffness
        stiffness = numbers[columns.stiffness]
        if is_law_changed and compute_stiffness:
            stiffness = compute_stiffness(law.parameters)
        springs.append(replace(spring, stiffness=stiffness, law=law))
    return replace(
        story,
        mass=numbers[MASS],
        height=None if story.height is None else numbers[HEIGHT],
        stiffness=sum(spring.stiffness for spring in springs),
        law=SUM_OF_ELEMENTS if story.elements else springs[0].law,
        elements=tuple(springs) if story.elements else (),
        dashpot=numbers[DASHPOT],
        power_dashpot=_power_dashpot(*numbers[POWER]) if story.power_dashpot else None,
    )


def _power_dashpot(
    coefficient: float, exponent: float, linear_below: float, brace: float
) -> PowerDashpot:
    """Return a power-law dashpot from its numbers in `story_numbers`; nan for no brace."""
    return PowerDashpot(coefficient, exponent, linear_below, None if math.isnan(brace) else brace)


def simple_story(
    mass: float, law: Law = LINEAR, *, stiffness: float | None = None, dashpot: float = 0.0
) -> Story:
    """Return a story without height.

    Parameters
    ----------
    stiffness : float, optional
        Initial stiffness, N/m. Default: the stiffness that the law defines.
    dashpot : float
        Coefficient of the dashpot, N s/m.
    """
    if stiffness is None:
        compute_stiffness = LAWS[law.name].initial_stiffness
        assert compute_stiffness is not None, f"the law {law.name} does not define a stiffness"
        stiffness = compute_stiffness(law.parameters)
    return Story(mass=mass, height=None, stiffness=stiffness, law=law, dashpot=dashpot)


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


# ---- Parameters of a building that can be changed by name, in a model or in arrays of many models

_STORY_KEYS = (
    "mass",
    "height",
    "stiffness",
    "dashpot",
    "dashpot.coefficient",
    "dashpot.exponent",
    "dashpot.linear_below",
    "dashpot.brace",
)
"""Keys of the values of a story in the order of `story_numbers`. Parameters of the law follow."""

MASS, HEIGHT, STIFFNESS, DASHPOT, POWER = 0, 1, 2, 3, slice(4, 8)
"""Indices of the values in `story_numbers`. `POWER` selects the values of the power-law dashpot."""

FIRST_LAW_PARAMETER = len(_STORY_KEYS)
"""Index of the first parameter of the law in `story_numbers`."""

_FACTOR_NAMES = ("mass_factor", "stiffness_factor", "strength_factor")
_STORY_PARAMETER = re.compile(r"(?:stories(?:\[(\d+)\])?|story (\d+))\.(\w.*)")
"""Pattern of a parameter of stories. Its groups are the number of the story in `stories[3].mass`,
the number in `story 3.mass` (both None for all stories), and the key of the parameter."""

_ELEMENT_PARAMETER = re.compile(r"elements\[[^\]]+\]\.\w")
"""Pattern of the start of the key of a parameter of an element, such as
`elements[bearings].yield_force`."""

_ELEMENT_NUMBER = re.compile(r"elements\[\d+\]")
"""Pattern of the start of the key of a parameter of an element that is given by its number."""

_POINT_DIMENSIONS = {"drift": (0, 1), "force": (1, 0)}  # exponents of force and length


class Change(NamedTuple):
    """Change of a single number of a story by a parameter.

    Attributes
    ----------
    story, column : int
        Index of the story and of the number in `story_numbers`.
    factor : bool
        The value is a factor on the number, otherwise its new value.
    bounds : LawParameter, optional
        Declaration of the parameter with its bounds.
    follows : bool
        The number is not named by the parameter, but follows it by default: the model does not
        state a value of its own (for the negative side of a law).
    scale : float
        Number in `story_numbers` divided by the value, which is a number along an inclined element.
    """

    story: int
    column: int
    factor: bool
    bounds: LawParameter | None = None
    follows: bool = False
    scale: float = 1.0

    def is_superseded(self, set_by_name: set[tuple[int, int]]) -> bool:
        """Return True if the number follows another one, but has been set by its own name before.

        A number that this change sets by its name is added to `set_by_name`: index of the story and
        column of each number.
        """
        if self.follows:
            return (self.story, self.column) in set_by_name
        if not self.factor:
            set_by_name.add((self.story, self.column))
        return False

    @property
    def sets_law_parameter(self) -> bool:
        """True if the change sets a parameter of the law, which may define the stiffness."""
        return self.column >= FIRST_LAW_PARAMETER and not self.factor

    def check(self, name: str, *values: float) -> None:
        """Raise UsageError if a value is outside the bounds that the law declares."""
        if self.bounds:
            low, high = self.bounds.low, self.bounds.high
            low_allowed, high_allowed = self.bounds.low_allowed, self.bounds.high_allowed
        else:
            low, high, low_allowed, high_allowed = -math.inf, math.inf, True, True
        for value in values:
            is_inside = low < value < high
            is_allowed_bound = (value == low and low_allowed) or (value == high and high_allowed)
            if not (is_inside or is_allowed_bound):
                raise UsageError(f"{name} must be between {low:g} and {high:g}, got {value:.6g}")


class SpringColumns(NamedTuple):
    """Indices of the values of a spring in `story_numbers`.

    Attributes
    ----------
    first, end : int
        Index of the first parameter of its law, and index after the last parameter.
    """

    stiffness: int
    first: int
    end: int


def spring_columns(story: Story) -> list[SpringColumns]:
    """Return the indices of the values of the springs of a story in `story_numbers`."""
    if not story.elements:
        end = FIRST_LAW_PARAMETER + len(story.law.parameters)
        return [SpringColumns(STIFFNESS, FIRST_LAW_PARAMETER, end)]
    columns, first = [], FIRST_LAW_PARAMETER
    for element in story.elements:
        end = first + 1 + len(element.law.parameters)
        columns.append(SpringColumns(first, first + 1, end))
        first = end
    return columns


def column_name(name: str) -> str:
    """Return the name of an element as a part of the name of a column: `moat wall` is
    `moat_wall`."""
    return re.sub(r"\W+", "_", name).strip("_")


def spring_label(i: int, spring: Element) -> str:
    """Return the name of a spring of the story with index `i` in messages."""
    return f"element {spring.name!r} of story {i + 1}" if spring.name else f"story {i + 1}"


def story_numbers(story: Story) -> tuple[float, ...]:
    """Return the values of a story, SI units: first `_STORY_KEYS`, then the parameters of its law,
    or the stiffness and the parameters of each element.

    The values of a missing height, power-law dashpot or brace are nan.
    """
    dashpot = (math.nan,) * 4
    if power := story.power_dashpot:
        brace = math.nan if power.brace is None else power.brace
        dashpot = (power.coefficient, power.exponent, power.linear_below, brace)
    height = math.nan if story.height is None else story.height
    parameters = list(story.law.parameters)
    for element in story.elements:
        parameters += [element.stiffness, *element.law.parameters]
    return (story.mass, height, story.stiffness, story.dashpot, *dashpot, *parameters)


def _named_parameters(law: Law) -> list[tuple[str, int, int, LawParameter]]:
    """Return for each number in the parameters of a law its name, the exponents of force and length
    in its unit, and the declaration of the parameter. Numbers of a list or of points have an index
    in the name, such as `backbone[1].drift`.
    """
    numbers: list[tuple[str, int, int, LawParameter]] = []
    for parameter in LAWS[law.name].parameters:
        path = parameter.path
        if parameter.points:
            numbers += [
                (f"{path}[{k}].{coordinate}", *dimension, parameter)
                for k in range(1, parameter.points + 1)
                for coordinate, dimension in _POINT_DIMENSIONS.items()
            ]
        elif parameter.many:
            # A list is the last parameter, so that it contains all remaining numbers. Number k is
            # the coefficient of drift^k and has the unit force / length^k.
            count = len(law.parameters) - len(numbers)
            numbers += [(f"{path}[{k}]", 1, -k, parameter) for k in range(1, count + 1)]
        else:
            numbers.append((path, parameter.force, parameter.length, parameter))
    return numbers


_ChangedNumber = (
    tuple[int, bool, LawParameter | None] | tuple[int, bool, LawParameter | None, bool, float]
)


def _followed_name(law: Law, name: str, declaration: LawParameter) -> str:
    """Return the number of a law whose value a number has by default; "" without such a number.

    For `negative.backbone[1].drift` it is `backbone[1].drift`.
    """
    if not isinstance(declaration.default, str):
        return ""
    # The default is the first parameter with this name (`stories.read_law`).
    source = next(item for item in LAWS[law.name].parameters if item.name == declaration.default)
    return source.path + name.removeprefix(declaration.path)


def _changes_by_parameter(story: Story) -> dict[str, list[_ChangedNumber]]:
    """Return the values of a story that each parameter changes, by the name of the parameter: the
    fields `column`, `factor`, `bounds`, `follows` and `scale` of a `Change` (the last two may be
    omitted). The list is empty for a parameter that cannot be changed.

    If a law defines the stiffness, a factor on the stiffness multiplies all forces of the law.
    """
    # Indices of the values that the factors on the stiffness and on the strength multiply.
    stiffness_indices, strength_indices = [], []
    set_law: dict[str, list[_ChangedNumber]] = {}
    has_stiffness = False
    for number, (spring, columns) in enumerate(
        zip(story.springs, spring_columns(story), strict=True), start=1
    ):
        has_stiffness = LAWS[spring.law.name].initial_stiffness is not None
        stiffness_indices.append(columns.stiffness)
        # An element has two prefixes: its number, counted from 1, and its name. The law of a story
        # is its first element.
        prefixes = [f"elements[{number}]"]
        prefixes.append(f"elements[{spring.name}]" if story.elements else "law")
        values = spring.law.values
        described_numbers = [
            (i, *described)
            for i, described in enumerate(_named_parameters(spring.law), start=columns.first)
            if described[0] in values
        ]
        for prefix in prefixes:
            if prefix != "law" and not has_stiffness:
                bounds = LawParameter("stiffness", low=0.0)
                scale = spring.scale(1, -1)
                set_law[f"{prefix}.stiffness"] = [(columns.stiffness, False, bounds, False, scale)]
            for i, name, force, length, declaration in described_numbers:
                scale = spring.scale(force, length)
                set_law[f"{prefix}.{name}"] = [(i, False, declaration, False, scale)]
                # The number of the other side with the same default changes as well, if it is
                # equal.
                source = _followed_name(spring.law, name, declaration)
                if source in values and values[source] == values[name]:
                    set_law[f"{prefix}.{source}"].append((i, False, declaration, True, scale))
        # Factors apply to all numbers with the dimension of a stiffness or of a strength (force).
        for i, _, force, length, declaration in described_numbers:
            if force == 1 and (has_stiffness or length == -1):
                stiffness_indices.append(i)
            # The points of a curve move along the line of the initial stiffness.
            if (force, length) == (1, 0) or declaration.open_ended:
                strength_indices.append(i)
    changes: dict[str, list[_ChangedNumber]] = {
        "mass_factor": [(MASS, True, None)],
        "stiffness_factor": [(i, True, None) for i in stiffness_indices],
        "strength_factor": [(i, True, None) for i in strength_indices],
        "mass": [(MASS, False, None)],
        "height": [] if story.height is None else [(HEIGHT, False, None)],
        "stiffness": [] if has_stiffness or story.elements else [(STIFFNESS, False, None)],
        "dashpot": [] if story.power_dashpot else [(DASHPOT, False, None)],
    }
    if story.power_dashpot:
        for i in range(POWER.start, POWER.stop - (story.power_dashpot.brace is None)):
            changes[_STORY_KEYS[i]] = [(i, False, None)]
    return changes | set_law


def changes_of(model: Model, name: str) -> list[Change]:
    """Return the changes of the values of stories that a parameter causes; empty for `damping`.

    Parameters
    ----------
    name : str
        Name of the parameter, as for `Model.replace`.

    Raises
    ------
    UsageError
        The name is unknown, the story does not exist, or no story has the parameter.
    """
    check_parameter(name)
    if name == "damping":
        return []
    # `stories[3]`, as in model files, and `story 3`, as in messages, are equivalent. Without a
    # number, the parameter applies to all stories.
    story_match = _STORY_PARAMETER.fullmatch(name)
    number, key = None, name
    if story_match:
        number, key = story_match[1] or story_match[2], story_match[3]
    if number and not 1 <= int(number) <= len(model.stories):
        hint = "" if int(number) else "; counting starts at 1"
        raise UsageError(
            f"{name}: story not found; {model.name} has "
            f"{pluralize(len(model.stories), 'story')}{hint}"
        )
    indices = [int(number) - 1] if number else range(len(model.stories))
    changes_by_story = {i: _changes_by_parameter(model.stories[i]) for i in indices}
    changes = [Change(i, *change) for i in indices for change in changes_by_story[i].get(key, ())]
    if changes:
        return changes
    if key == "strength_factor":
        stories_without_strength = (
            f"story {number} of {model.name}" if number else f"every story of {model.name}"
        )
        raise UsageError(
            f"{name} has no effect: the law of {stories_without_strength} has no strength; use "
            "a law with a strength, or change another parameter"
        )
    available: dict[str, None] = {}
    for story_changes in changes_by_story.values():
        available |= dict.fromkeys(
            parameter for parameter, numbers in story_changes.items() if numbers
        )
    # An element is listed by its name only.
    names = [parameter for parameter in available if not _ELEMENT_NUMBER.match(parameter)]
    story_has_no = (
        f"story {number} of {model.name} has no" if number else f"no story of {model.name} has a"
    )
    hint = "; counting starts at 1" if key.startswith("elements[0]") else did_you_mean(key, names)
    raise UsageError(
        f"{name}: {story_has_no} parameter {key!r} that can be changed{hint} "
        f"(available parameters: {', '.join(names)})"
    )


PARAMETERS = {
    "damping": "damping ratio that replaces the ratio of the model: of both modes of Rayleigh "
    "damping, or of all modes of modal damping",
    "mass_factor": "factor on the masses",
    "stiffness_factor": "factor on the initial stiffnesses; strengths are unchanged, yield drifts "
    "change",
    "strength_factor": "factor on the strengths of the hysteretic laws; stiffnesses are unchanged",
}
"""Parameters of the complete building, with their descriptions."""


def parameter_meaning(name: str) -> str:
    """Return the description of a parameter of the building or of its stories."""
    story_match = _STORY_PARAMETER.fullmatch(name)
    key = story_match[3] if story_match else name
    return PARAMETERS.get(key, f"{key} of the model file, in SI units")


def check_parameter(name: str) -> None:
    """Raise UsageError if a name cannot be a parameter of `Model.replace` for any model.

    The names of the parameters of a law are not checked.
    """
    story_match = _STORY_PARAMETER.fullmatch(name)
    key = story_match[3] if story_match else ""
    if name in PARAMETERS or key in _STORY_KEYS or key in _FACTOR_NAMES:
        return
    if key.startswith("law.") or _ELEMENT_PARAMETER.match(key):
        return
    similar_key = nearest(key, (*_STORY_KEYS, *_FACTOR_NAMES)) if story_match else None
    # The hint is the name with its key, which is at the end of the name, replaced.
    hint = (
        f"; did you mean {name[: -len(key)] + similar_key!r}?"
        if similar_key
        else did_you_mean(name, PARAMETERS)
    )
    names = ", ".join(PARAMETERS)
    raise UsageError(
        f"unknown parameter {name!r}{hint}; available: {names}, and parameters of one story, "
        "`stories[3].NAME`"
    )


def check_value(name: str, value: float) -> None:
    """Raise UsageError if a value is outside the range that follows from its name."""
    is_law_parameter = ".law." in name or ".elements[" in name
    if name == "damping":
        is_valid, allowed = 0.0 <= value < 1.0, "a ratio from 0 to less than 1"
    elif name.endswith((".dashpot", ".linear_below")):
        is_valid, allowed = value >= 0.0, "zero or a positive number"
    elif name.endswith("dashpot.exponent") and 2.0 < value < math.inf:
        # The last branch checks smaller exponents, which must be positive.
        is_valid, allowed = False, "in (0, 2]"
    elif is_law_parameter:
        is_valid, allowed = True, "a number"
    else:
        is_valid, allowed = value > 0.0, "a positive number"
    if not (is_valid and math.isfinite(value)):
        raise UsageError(f"{name} must be {allowed}, got {value!r}")


def damped_by(model: Model, ratio: float) -> Damping:
    """Return the damping of a model with another damping ratio in all its modes.

    Raises
    ------
    UsageError
        The model has no damping, or specifies it by coefficients.
    """
    match model.damping:
        case RayleighRatio(_, modes, tangent):
            return RayleighRatio((ratio, ratio), modes, tangent)
        case ModalDamping(old_ratios):
            return ModalDamping(tuple(ratio if old else 0.0 for old in old_ratios))
    has_no_ratio = "is undamped" if model.damping is None else "specifies damping by coefficients"
    raise UsageError(
        f"the damping ratio cannot be changed, because {model.name} {has_no_ratio}; specify "
        "damping ratios in the model"
    )
