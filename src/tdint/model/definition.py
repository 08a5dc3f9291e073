"""What a model file says, as typed values in SI units; `tdint.model.config.model_file` reads the file.

Also models made from numbers, without a file: for problems that are part of tdint; and models with some of their
numbers changed: for sweeps, and what a response is sensitive to.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace

from tdint.errors import UsageError, did_you_mean
from tdint.ground_motion.processing import RecordChoice
from tdint.model.damage_states import DamageStates
from tdint.model.laws import LAWS, LINEAR, Law
from tdint.output_units import SI, OutputUnits
from tdint.written_numbers import how_many, parse_ratio

MAX_STORIES = 100_000
"""Stories that a model may have; it keeps a slip in `repeat` from filling the memory."""


@dataclass(frozen=True)
class PowerDashpot:
    """A dashpot whose force grows with a power of the drift rate v: c v (v^2 + v0^2)^((exponent - 1) / 2).

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
        Whether its drift is a displacement by design, and no drift ratio; its height serves P-delta alone.
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
        The two modes, counted from 1: different, or 1 twice in a building of one story, whose only mode has the first
        ratio then, half of it from the mass and half from the stiffness.
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
        Damping ratios in [0, 1). One ratio: all modes have it. Several: the first modes, one each; higher modes are
        undamped.
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
        What is taken of it, and what is done to that before it is scaled; the path of the station metadata is resolved
        like `file`.
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
    """Displacement (m) and velocity (m/s) at t = 0 relative to the ground, one entry per floor from the bottom."""

    displacement: tuple[float, ...]
    velocity: tuple[float, ...]


@dataclass(frozen=True)
class Analysis:
    """Wishes of the model file for its analysis; None where it has none.

    Attributes
    ----------
    method : str or None
        Method with its parameters, as on the command line; the catalogue of methods judges it later.
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
        The building's name: the file's name without suffix where the file gives none, `model` for a stream.
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
    varied : tuple of (str, float)
        What `replace` changed, and the values.
    label : str
        What tells it from other variations of the building.
    damage : DamageStates or None
        How its damage is told.
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
    varied: tuple[tuple[str, float], ...] = ()
    label: str = ""
    damage: DamageStates | None = None

    def replace(self, **changes: float | str) -> Model:
        """The building with some of its numbers changed: `model.replace(damping=0.02, stiffness_factor=1.1)`.

        Names are those of `PARAMETERS`, which tells what they mean; what changes with them (modes, drifts at yield,
        P-delta) follows; a factor of one story is
        given as `model.replace(**{"story 3.stiffness_factor": 0.8})`.

        Raises
        ------
        UsageError
            An unknown name, a value out of range, or nothing that it could act on.
        """
        return self.changed({name: _number(name, given) for name, given in changes.items()})

    def changed(self, numbers: Mapping[str, float]) -> Model:
        """The same of numbers by name."""
        model = self
        for name, value in numbers.items():
            check_parameter(name)
            check_value(name, value)
            if name == "damping":
                model = replace(model, damping=_damped(model, value))
                continue
            found = _OF_STORY.fullmatch(name)
            stories = [int(found[1]) - 1] if found else range(len(model.stories))
            change = _FACTORS[found[2] if found else name]
            if found and not 0 <= stories[0] < len(model.stories):
                raise UsageError(f"{name}: {model.name} has {how_many(len(model.stories), 'story')}")
            changed = [change(one, value) if i in stories else one for i, one in enumerate(model.stories)]
            if change is _strength and not any(_strength(model.stories[i], 2.0) != model.stories[i] for i in stories):
                raise UsageError(f"{name} has nothing to act on: no such story of {model.name} has a strength")
            model = replace(model, stories=tuple(changed))
        for number, story in enumerate(model.stories, start=1):
            if fault := LAWS[story.law.name].fault(story.stiffness, story.law.parameters):
                raise UsageError(f"{model.name}: story {number} cannot be varied so: {fault}")
        return replace(model, varied=tuple({**dict(model.varied), **numbers}.items()))

    def __repr__(self) -> str:
        count = len(self.stories)
        return f"<Model {self.name!r}: {how_many(count, 'story')}>"


def simple_story(mass: float, law: Law = LINEAR, *, stiffness: float | None = None, dashpot: float = 0.0) -> Story:
    """A story without height; the stiffness (N/m) may be left out where the law has its own."""
    if stiffness is None:
        own = LAWS[law.name].initial_stiffness
        assert own is not None, f"the law {law.name} has no stiffness of its own"
        stiffness = own(law.parameters)
    return Story(mass=mass, height=None, stiffness=stiffness, law=law, dashpot=dashpot)


def simple_model(
    name: str,
    stories: Sequence[Story],
    *,
    forces: Sequence[Force] = (),
    displacement: Sequence[float] = (),
    velocity: Sequence[float] = (),
) -> Model:
    """A model without ground motion, damping and P-delta; it starts at rest where nothing else is said (m, m/s)."""
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


_OF_STORY = re.compile(r"story (\d+)\.(\w+)")


def _scaled_law(law: Law, factor: float, chosen: Callable[[int, int], bool]) -> Law:
    """The law with the parameters of some dimensions (exponents of force and length) times a factor."""
    own = LAWS[law.name].parameters
    kinds = [*own, *own[-1:] * (len(law.parameters) - len(own))]  # one that is a list comes last
    powers = [(1, -j) if one.many else (one.force, one.length) for j, one in enumerate(kinds, start=2 - len(own))]
    values = zip(law.parameters, powers, strict=True)
    return Law(law.name, tuple(value * factor if chosen(*power) else value for value, power in values))


def _stiffness(story: Story, factor: float) -> Story:
    """With a law that has its own stiffness all of its forces grow alike."""
    own = LAWS[story.law.name].initial_stiffness is not None
    law = _scaled_law(story.law, factor, lambda force, length: force == 1 and (own or length == -1))
    return replace(story, stiffness=story.stiffness * factor, law=law)


def _strength(story: Story, factor: float) -> Story:
    return replace(story, law=_scaled_law(story.law, factor, lambda force, length: (force, length) == (1, 0)))


_FACTORS: Mapping[str, Callable[[Story, float], Story]] = {
    "mass_factor": lambda story, factor: replace(story, mass=story.mass * factor),
    "stiffness_factor": _stiffness,
    "strength_factor": _strength,
}

PARAMETERS = {
    "damping": "damping ratio, in place of the model's: of both modes of Rayleigh damping, or of all of modal damping",
    "mass_factor": "factor on the masses",
    "stiffness_factor": "factor on the initial stiffnesses; strengths stay, drifts at yield change",
    "strength_factor": "factor on the strengths of the drift laws; stiffnesses stay",
}
"""What can be changed in a building, and what it means; factors also of one story, as `story 3.mass_factor`."""


def check_parameter(name: str) -> None:
    """Raise UsageError for a name that is no parameter of `Model.replace`."""
    found = _OF_STORY.fullmatch(name)
    if name not in PARAMETERS and not (found and found[2] in _FACTORS):
        hint = did_you_mean(name, PARAMETERS)
        names = ", ".join(PARAMETERS)
        raise UsageError(f"no parameter {name!r}{hint}; there are {names}, and factors of one story, `story 3.NAME`")


def _number(name: str, given: float | str) -> float:
    """The number of a parameter, or that of a text such as `2%`."""
    check_parameter(name)
    try:
        return parse_ratio(given) if isinstance(given, str) else float(given)
    except (TypeError, ValueError):
        raise UsageError(f"{name} must be a number, got {given!r:.60}") from None


def check_value(name: str, value: float) -> None:
    """Raise UsageError for a value out of range."""
    if name == "damping":
        if not 0.0 <= value < 1.0:
            raise UsageError(f"{name} must be a ratio from 0 to less than 1, got {value!r}")
    elif not (math.isfinite(value) and value > 0.0):
        raise UsageError(f"{name} must be a positive number, got {value!r}")


def _damped(model: Model, ratio: float) -> Damping:
    match model.damping:
        case RayleighRatio(_, modes):
            return RayleighRatio((ratio, ratio), modes)
        case ModalDamping(ratios):
            return ModalDamping((ratio,) * len(ratios))
    what = "has none" if model.damping is None else "states it by coefficients"
    raise UsageError(f"damping has no ratio to vary: {model.name} {what}")
