"""What a model file says, as typed values in SI units; `tdint.model.config.model_file` reads the
file.

Also models made from numbers, without a file: for problems that are part of tdint; and models with
some of their numbers changed: for sweeps, and what a response is sensitive to.
"""

from __future__ import annotations

import math
import re
import sys
from collections.abc import Mapping, Sequence
from dataclasses import astuple, dataclass, field, replace
from functools import cache
from typing import Any, NamedTuple

from tdint.errors import UsageError, did_you_mean, nearest
from tdint.ground_motion.choice import RecordChoice
from tdint.kernels.laws import LAWS as _LAWS
from tdint.kernels.laws.law import DriftLaw, LawParameter
from tdint.model.damage_states import DamageStates
from tdint.model.plugins import (
    Origin,
    check_name,
    declared,
    faults_of,
    home_of,
    installed,
    module_of,
    same_file,
)
from tdint.units import SI, OutputUnits
from tdint.written_numbers import how_many, parse_ratio

# ---- The drift laws that models may name, ours and those of others, and the law of a story

LAWS: dict[str, DriftLaw] = {law.name: law for law in _LAWS}
"""The drift laws that a model file may name: those of `tdint.kernels.laws`."""

CODES: dict[str, int] = {law.name: code for code, law in enumerate(_LAWS)}
"""The number of each law in the compiled tables."""


def register_law(law: DriftLaw, where: str | Origin = "") -> None:
    """Make a drift law known to models, and compiled where a model has it.

    It is compiled into the loops of the models that have it, whatever it says of `apart`. Its
    functions stand in a module with a file, in which it has a name of its own or stands in a tuple:
    there the process that compiles finds it.

    Parameters
    ----------
    law : DriftLaw
        See `tdint.kernels.laws.law`.
    where : str or Origin
        Where it is from, for messages; by default its name.

    Returns
    -------
    None

    Raises
    ------
    UsageError
        No law; a name that is taken or is none; no file; a declaration that is missing: the force
        is not linear, and neither `curved` nor branches are declared.
    """
    if not isinstance(law, DriftLaw):
        raise UsageError(
            f"{where or law!r}: a law is a tdint.plugin.DriftLaw, not {type(law).__name__}"
        )
    origin = where if isinstance(where, Origin) else Origin(where or f"law {law.name!r}")
    where = origin.where
    check_name(law.name, LAWS, "law", where)
    home = law.functions.__module__
    if home == "__main__" or getattr(sys.modules.get(home), "__file__", None) is None:
        raise UsageError(
            f"{where}: put the law into a module of its own, a file that another process can "
            "execute"
        )
    # Loaded here: commands without plug-ins do without the checks.
    from tdint.kernels.building.sources import OUTSIDE
    from tdint.model.law_checks import verify_declaration

    with faults_of(where):
        verify_declaration(law, where)

    together = replace(law, apart=False)
    OUTSIDE[law.name] = home
    CODES[law.name] = len(_LAWS)
    LAWS[law.name] = together
    origin.keep_code("law", law)
    _LAWS.append(together)


@cache
def laws() -> dict[str, DriftLaw]:
    """All drift laws by name, those of installed packages (entry points `tdint.laws`) among
    them."""

    def take(plugin: Any, origin: Origin) -> None:
        for law in declared(plugin, "LAWS", DriftLaw, origin.where):
            register_law(law, origin)

    installed("tdint.laws", take)
    return LAWS


@dataclass(frozen=True)
class Law:
    """The drift law of a story.

    Attributes
    ----------
    name : str
        A key of `LAWS`.
    parameters : tuple of float
        Values in SI in the order of `LAWS[name].parameters`; a `many` parameter comes last and is
        flattened.
    """

    name: str
    parameters: tuple[float, ...]

    def __reduce__(self) -> tuple[Any, ...]:
        home = home_of(self.name, "LAWS")
        return (
            (_law_again, (self.name, self.parameters, CODES[self.name], *home))
            if home
            else (Law, tuple(astuple(self)))
        )


def _law_again(name: str, parameters: tuple[float, ...], code: int, file: str, digest: str) -> Law:
    """A law of a plug-in, which is loaded if this process does not know it yet.

    Raises
    ------
    UsageError
        The plug-in is not there or another one; the law has another number here than in the arrays
        of buildings.
    """
    if name not in LAWS:
        module = module_of(same_file(file, digest))
        for law in declared(module, "LAWS", DriftLaw, file):
            register_law(law, Origin(file, module.__name__))
    if CODES[name] != code:
        raise UsageError(
            f"{file}: the law {name!r} is another one of the laws here: load the plug-ins in the "
            "same order"
        )
    return Law(name, parameters)


LINEAR = Law("linear", ())


def four_points(points: Sequence[Sequence[float]]) -> tuple[float, ...]:
    """Two to four points as four, flattened: of two the others lie at the thirds between them, of
    three the one that is missing lies midway between the last ones (as the buildings of GEM's
    vulnerability toolkit have it)."""
    (*first, before, last) = points
    missing = 4 - len(points)
    parts = [j / (missing + 1) for j in range(1, missing + 1)]
    between = [[a + part * (b - a) for a, b in zip(before, last, strict=True)] for part in parts]
    return tuple(number for point in (*first, before, *between, last) for number in point)


# ---- Definition

MAX_STORIES = 100_000
"""Stories that a model may have; it keeps a slip in `repeat` from filling the memory."""


@dataclass(frozen=True)
class PowerDashpot:
    """A dashpot whose force grows with a power of the drift rate v: c v (v^2 + v0^2)^((exponent -
    1) / 2).

    That is c |v|^exponent far above v0, and a linear dashpot far below it.

    Attributes
    ----------
    coefficient : float
        c, N (s/m)^exponent, positive.
    exponent : float
        In (0, 2].
    linear_below : float
        v0, m/s; positive where the exponent is less than 1, else zero or positive.
    """

    coefficient: float
    exponent: float
    linear_below: float


@dataclass(frozen=True)
class Story:
    """One story: the floor above it and the spring and dashpot that carry this floor.

    Attributes
    ----------
    mass : float
        Mass of the floor above, kg, positive.
    height : float or None
        Story height, m, positive; None where the file gives none.
    stiffness : float
        Initial stiffness, N/m, positive.
    law : Law
        Drift law.
    dashpot : float
        Viscous damper between the floors, N s/m, zero or positive.
    power_dashpot : PowerDashpot or None
        Power-law damper between the floors.
    isolator : bool
        Whether its drift is a displacement by design, and no drift ratio; its height serves P-delta
        alone.
    rayleigh : bool
        Whether Rayleigh damping reaches it.
    """

    mass: float
    height: float | None
    stiffness: float
    law: Law
    dashpot: float
    power_dashpot: PowerDashpot | None = None
    isolator: bool = False
    rayleigh: bool = True

    @property
    def drift_height(self) -> float | None:
        """The height that its drift is taken over, m; None where it has none, or isolates."""
        return None if self.isolator else self.height


@dataclass(frozen=True)
class RayleighRatio:
    """Rayleigh damping through the damping ratios of two modes.

    Attributes
    ----------
    ratios : tuple of float
        Damping ratio in each of the two modes, in [0, 1).
    modes : tuple of int
        The two modes, counted from 1: different, or 1 twice in a building of one story, whose only
        mode has the first ratio then, half of it from the mass and half from the stiffness.
    """

    ratios: tuple[float, float]
    modes: tuple[int, int]


@dataclass(frozen=True)
class RayleighCoefficients:
    """Rayleigh damping C = mass M + stiffness K.

    Attributes
    ----------
    mass : float
        Coefficient of the mass matrix, 1/s, zero or positive.
    stiffness : float
        Coefficient of the initial stiffness matrix, s, zero or positive.
    """

    mass: float
    stiffness: float


@dataclass(frozen=True)
class ModalDamping:
    """Modal damping, of the modes of the initial stiffness; it stays as it is when stories yield.

    Attributes
    ----------
    ratios : tuple of float
        Damping ratios in [0, 1). One ratio: all modes have it. Several: the first modes, one each;
        higher modes are undamped.
    """

    ratios: tuple[float, ...]


Damping = RayleighRatio | RayleighCoefficients | ModalDamping | None
"""Damping besides the dashpots; None is none."""


@dataclass(frozen=True)
class RecordSource:
    """Where the ground motion comes from.

    Attributes
    ----------
    file : str
        Path, already resolved against the folder of the model file; `-` is standard input.
    choice : RecordChoice
        What is taken of it, and what is done to that before it is scaled; the path of the station
        metadata is resolved like `file`.
    scale : float
        Factor on the acceleration, not zero.
    """

    file: str
    choice: RecordChoice = field(default_factory=RecordChoice)
    scale: float = 1.0


@dataclass(frozen=True)
class Force:
    """A harmonic force p = cosine cos(omega t) + sine sin(omega t) on one floor.

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


@dataclass(frozen=True)
class Excitation:
    """Ground motion and forces; without either the building vibrates freely."""

    record: RecordSource | None
    forces: tuple[Force, ...]


@dataclass(frozen=True)
class Initial:
    """Displacement (m) and velocity (m/s) at t = 0 relative to the ground, one entry per floor from
    the bottom."""

    displacement: tuple[float, ...]
    velocity: tuple[float, ...]


@dataclass(frozen=True)
class Analysis:
    """Wishes of the model file for its analysis; None where it has none.

    Attributes
    ----------
    method : str or None
        Method with its parameters, as on the command line; the catalogue of methods judges it
        later.
    dt : float or None
        Time step, s, positive.
    duration : float or None
        Duration, s, positive.
    """

    method: str | None
    dt: float | None
    duration: float | None


@dataclass(frozen=True, repr=False)
class Model:
    """A model file, checked and in SI units.

    Attributes
    ----------
    name : str
        The building's name: the file's name without suffix where the file gives none, `model` for a
        stream.
    source : str
        The file as the user named it; `-` for standard input.
    text : bytes
        The file's content, for its SHA-256.
    stories : tuple of Story
        From the ground up, `repeat` written out.
    damping : Damping
        Damping besides the dashpots.
    p_delta : bool
        Whether gravity acts on the displaced building; every story has a height then.
    excitation : Excitation
        Ground motion and forces.
    initial : Initial
        State at t = 0.
    analysis : Analysis
        Method, time step and duration, as far as given.
    collapse_drift : float
        Drift ratio over which a run is flagged as collapsed, positive.
    output_units : OutputUnits
        What tables and summaries are written in.
    page_units : OutputUnits
        What pages for people are written in: the units of the file where it names none for the
        output.
    page_head : tuple of (str, str)
        Names and texts of the lines at the top of its page.
    varied_parameters : tuple of (str, float)
        What `replace` changed, and the values.
    label : str
        What tells it from other variations of the building.
    damage : DamageStates or None
        How its damage is told.
    plausibility_off : str
        Why nothing that is unusual of the building is told (`plausibility: off, ...`); empty where
        it is.
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

    def replace(self, **changes: float | str) -> Model:
        """The building with some of its numbers changed: `model.replace(damping=0.02,
        stiffness_factor=1.1)`.

        Names are those of `PARAMETERS`, which tells what they mean, or keys of the model file in SI
        units, a story by its number from the ground: `model.replace(**{"stories[2].law.hardening":
        0.05, "stories.mass": 2e5})`. Without a number all stories are meant that have it. What
        changes with them (modes, drifts at yield, P-delta) follows.

        Parameters
        ----------
        **changes : float or str
            Values by name; a text such as `2%` is a ratio.

        Returns
        -------
        Model

        Raises
        ------
        UsageError
            An unknown name, a value out of range, or nothing that it could act on.
        """
        # Texts such as 2% are ratios, as in a file.
        numbers = {}
        for name, given in changes.items():
            check_parameter(name)
            try:
                numbers[name] = parse_ratio(given) if isinstance(given, str) else float(given)
            except (TypeError, ValueError, OverflowError):
                raise UsageError(f"{name} must be a number, got {given!r:.60}") from None
        return self.changed(numbers)

    def changed(self, numbers: Mapping[str, float]) -> Model:
        """The same of numbers by name."""
        # Changes act one after the other on the numbers of the stories, factors on what was set
        # before.
        table = [list(story_numbers(story)) for story in self.stories]
        damping, touched = self.damping, dict[int, bool]()
        for name, value in numbers.items():
            check_value(name, value)
            if name == "damping":
                damping = damped_by(self, value)
            for change in changes_of(self, name):
                change.check(name, value)
                row = table[change.story]
                row[change.column] = row[change.column] * value if change.factor else value
                touched[change.story] = touched.get(change.story, False) or change.of_law
        # Only what was touched is made anew, and judged by its law as in a file.
        stories = list(self.stories)
        for i, law_set in touched.items():
            story, row = stories[i], table[i]
            law, stiffness_of = (
                Law(story.law.name, tuple(row[OF_LAW:])),
                LAWS[story.law.name].initial_stiffness,
            )
            stories[i] = replace(
                story,
                mass=row[MASS],
                height=None if story.height is None else row[HEIGHT],
                # Of a law that has its own stiffness it follows where the law was set.
                stiffness=stiffness_of(law.parameters)
                if law_set and stiffness_of
                else row[STIFFNESS],
                law=law,
                dashpot=row[DASHPOT],
                power_dashpot=PowerDashpot(*row[POWER]) if story.power_dashpot else None,
            )
            if fault := LAWS[stories[i].law.name].fault(
                stories[i].stiffness, stories[i].law.parameters
            ):
                raise UsageError(f"{self.name}: story {i + 1} cannot be varied so: {fault}")
        varied = tuple({**dict(self.varied_parameters), **numbers}.items())
        return replace(self, stories=tuple(stories), damping=damping, varied_parameters=varied)

    def __repr__(self) -> str:
        count = len(self.stories)
        return f"<Model {self.name!r}: {how_many(count, 'story')}>"


def simple_story(
    mass: float, law: Law = LINEAR, *, stiffness: float | None = None, dashpot: float = 0.0
) -> Story:
    """A story without height; the stiffness (N/m) may be left out where the law has its own."""
    if stiffness is None:
        stiffness_of = LAWS[law.name].initial_stiffness
        assert stiffness_of is not None, f"the law {law.name} has no stiffness of its own"
        stiffness = stiffness_of(law.parameters)
    return Story(mass=mass, height=None, stiffness=stiffness, law=law, dashpot=dashpot)


def simple_model(
    name: str,
    stories: Sequence[Story],
    *,
    forces: Sequence[Force] = (),
    displacement: Sequence[float] = (),
    velocity: Sequence[float] = (),
) -> Model:
    """A model without ground motion, damping and P-delta; it starts at rest where nothing else is
    said (m, m/s)."""
    rest = (0.0,) * len(stories)
    return Model(
        name=name,
        source=name,
        text=b"",
        stories=tuple(stories),
        damping=None,
        p_delta=False,
        excitation=Excitation(None, tuple(forces)),
        initial=Initial(tuple(displacement) or rest, tuple(velocity) or rest),
        analysis=Analysis(None, None, None),
        collapse_drift=1.0,
    )


# ---- What can be changed in a building: its numbers by name, the same of a model and of arrays of
# many

_PLAIN = (
    "mass",
    "height",
    "stiffness",
    "dashpot",
    "dashpot.coefficient",
    "dashpot.exponent",
    "dashpot.linear_below",
)
"""The first numbers of a story by their keys; those of its law follow."""

MASS, HEIGHT, STIFFNESS, DASHPOT, POWER, OF_LAW = 0, 1, 2, 3, slice(4, 7), len(_PLAIN)
"""Where they stand."""

_FACTORS = ("mass_factor", "stiffness_factor", "strength_factor")
_NAME = re.compile(r"(?:stories(?:\[(\d+)\])?|story (\d+))\.(\w.*)")
_OF_POINT = {"drift": (0, 1), "force": (1, 0)}


class Change(NamedTuple):
    """What a parameter does to one number of a story, both counted from 0: it sets it within
    bounds, or is a factor."""

    story: int
    column: int
    factor: bool
    bounds: LawParameter | None = None

    @property
    def of_law(self) -> bool:
        """Whether it sets a number of the law, from which a stiffness may follow."""
        return self.column >= OF_LAW and not self.factor

    def check(self, name: str, *values: float) -> None:
        """Raise UsageError for a value that the law does not take."""
        for value in values:
            low, high = (
                (self.bounds.low, self.bounds.high) if self.bounds else (-math.inf, math.inf)
            )
            inside = low <= value <= high and (
                value > low or self.bounds is None or self.bounds.low_allowed
            )
            if not inside or (self.bounds and value == high and not self.bounds.high_allowed):
                raise UsageError(f"{name} must lie between {low:g} and {high:g}, got {value:.6g}")


def story_numbers(story: Story) -> tuple[float, ...]:
    """The numbers of a story, nan for what it does not have; those of its law last."""
    power = story.power_dashpot
    dashpot = (power.coefficient, power.exponent, power.linear_below) if power else (math.nan,) * 3
    height = math.nan if story.height is None else story.height
    return (story.mass, height, story.stiffness, story.dashpot, *dashpot, *story.law.parameters)


def _columns(story: Story) -> dict[str, list[tuple[int, bool, LawParameter | None]]]:
    """What each name changes in a story: columns of its numbers, whether as a factor, and bounds.

    With a law that has its own stiffness all of its forces grow with the stiffness.
    """
    has_stiffness = LAWS[story.law.name].initial_stiffness is not None
    # Of each number of the law its key, the exponents of force and length in its dimension, and its
    # bounds.
    numbers: list[tuple[str, int, int, LawParameter]] = []
    for parameter in LAWS[story.law.name].parameters:
        path = f"law.{parameter.path}"
        if parameter.points:
            numbers += [
                (f"{path}[{k}].{at}", *of, parameter)
                for k in range(1, 5)
                for at, of in _OF_POINT.items()
            ]
        elif parameter.many:
            count = len(story.law.parameters) - len(numbers)
            numbers += [(f"{path}[{k}]", 1, -k, parameter) for k in range(1, count + 1)]
        else:
            numbers.append((path, parameter.force, parameter.length, parameter))
    law = list(enumerate(numbers, start=OF_LAW))
    # What has the dimension of a stiffness or a strength goes with the factor on it.
    stiff = [
        at for at, (_, force, length, _) in law if force == 1 and (has_stiffness or length == -1)
    ]
    strong = [at for at, (_, force, length, _) in law if (force, length) == (1, 0)]
    columns: dict[str, list[tuple[int, bool, LawParameter | None]]] = {
        "mass_factor": [(MASS, True, None)],
        "stiffness_factor": [(at, True, None) for at in (STIFFNESS, *stiff)],
        "strength_factor": [(at, True, None) for at in strong],
        "mass": [(MASS, False, None)],
        "height": [] if story.height is None else [(HEIGHT, False, None)],
        "stiffness": [] if has_stiffness else [(STIFFNESS, False, None)],
        "dashpot": [] if story.power_dashpot else [(DASHPOT, False, None)],
    }
    power = range(POWER.start, POWER.stop) if story.power_dashpot else ()
    columns |= {_PLAIN[at]: [(at, False, None)] for at in power}
    return columns | {key: [(at, False, bounds)] for at, (key, _, _, bounds) in law}


def changes_of(model: Model, name: str) -> list[Change]:
    """What a parameter changes in the stories of a model; nothing for its damping.

    Raises
    ------
    UsageError
        An unknown name, a story that is not there, or nothing that it could act on.
    """
    check_parameter(name)
    if name == "damping":
        return []
    # Keys in the words of model files, or of messages: stories[3] and story 3 are the same.
    said = _NAME.fullmatch(name)
    number, key = (said[1] or said[2], said[3]) if said else (None, name)
    if number and not 1 <= int(number) <= len(model.stories):
        counted = "" if int(number) else "; counting starts at 1"
        raise UsageError(
            f"{name}: {model.name} has {how_many(len(model.stories), 'story')}{counted}"
        )
    places = [int(number) - 1] if number else range(len(model.stories))
    # In each story a key may mean another number: laws differ.
    columns = {i: _columns(model.stories[i]) for i in places}
    changes = [Change(i, *column) for i in places for column in columns[i].get(key, ())]
    if not changes and key == "strength_factor":
        raise UsageError(
            f"{name} has nothing to act on: no such story of {model.name} has a strength"
        )
    if not changes:
        names = list(
            dict.fromkeys(
                there for by_name in columns.values() for there, act in by_name.items() if act
            )
        )
        where = f"story {number}" if number else "no story"
        raise UsageError(
            f"{name}: {where} of {model.name} has {'no' if number else 'a'} {key!r} that can be "
            f"set{did_you_mean(key, names)} (there are {', '.join(names)})"
        )
    return changes


PARAMETERS = {
    "damping": "damping ratio, in place of the model's: of both modes of Rayleigh damping, or of "
    "all of modal damping",
    "mass_factor": "factor on the masses",
    "stiffness_factor": "factor on the initial stiffnesses; strengths stay, drifts at yield change",
    "strength_factor": "factor on the strengths of the drift laws; stiffnesses stay",
}
"""What can be changed in all of a building, and what it means."""


def parameter_meaning(name: str) -> str:
    """What a parameter is, for people."""
    said = _NAME.fullmatch(name)
    key = said[3] if said else name
    return PARAMETERS.get(key, f"{key} of the model file, in SI units")


def check_parameter(name: str) -> None:
    """Raise UsageError for a name that cannot be a parameter of `Model.replace`, whatever the
    model."""
    said = _NAME.fullmatch(name)
    key = said[3] if said else ""
    if name in PARAMETERS or key in _PLAIN or key in _FACTORS or key.startswith("law."):
        return
    near = nearest(key, (*_PLAIN, *_FACTORS)) if said else None
    hint = (
        f"; did you mean {name[: -len(key)] + near!r}?" if near else did_you_mean(name, PARAMETERS)
    )
    names = ", ".join(PARAMETERS)
    raise UsageError(
        f"no parameter {name!r}{hint}; there are {names}, and numbers of stories, `stories[3].NAME`"
    )


def check_value(name: str, value: float) -> None:
    """Raise UsageError for a value out of range, as far as its name alone tells."""
    of_law = ".law." in name
    if name == "damping":
        is_right, kind = 0.0 <= value < 1.0, "be a ratio from 0 to less than 1"
    elif name.endswith((".dashpot", ".linear_below")):
        is_right, kind = value >= 0.0, "be a number from 0 on"
    elif name.endswith("dashpot.exponent") and 2.0 < value < math.inf:
        is_right, kind = False, "lie in (0, 2]"
    else:
        is_right, kind = of_law or value > 0.0, "be a number" if of_law else "be a positive number"
    if not (is_right and math.isfinite(value)):
        raise UsageError(f"{name} must {kind}, got {value!r}")


def damped_by(model: Model, ratio: float) -> Damping:
    """The damping of a model with another ratio; UsageError where it has none."""
    match model.damping:
        case RayleighRatio(_, modes):
            return RayleighRatio((ratio, ratio), modes)
        case ModalDamping(ratios):
            return ModalDamping((ratio,) * len(ratios))
    reason = "has none" if model.damping is None else "states it by coefficients"
    raise UsageError(f"damping has no ratio to vary: {model.name} {reason}")
