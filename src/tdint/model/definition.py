"""What a model file says, as typed values in SI units; `tdint.model.config.model_file` reads the file.

Also models made from numbers, without a file: for problems that are part of tdint.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cache
from typing import Any

from tdint.errors import UsageError
from tdint.ground_motion.processing import Processing
from tdint.ground_motion.text_layout import AS_STATED, TextLayout
from tdint.kernels.laws import LAWS as _LAWS
from tdint.kernels.laws.law import DriftLaw
from tdint.model.damage_states import DamageStates
from tdint.model.plugins import check_name, declared, faults_of, installed
from tdint.output_units import SI, OutputUnits

MAX_STORIES = 100_000
"""Stories that a model may have; it keeps a slip in `repeat` from filling the memory."""

LAWS: dict[str, DriftLaw] = {law.name: law for law in _LAWS}
"""The drift laws that a model file may name: those of `tdint.kernels.laws`."""

CODES: dict[str, int] = {law.name: code for code, law in enumerate(_LAWS)}
"""The number of each law in the compiled tables."""


def register_law(law: DriftLaw, where: str = "") -> None:
    """Make a drift law known to models, and compiled where a model has it.

    It is compiled into the loops of the models that have it, whatever it says of `apart`. Its functions stand in a
    module with a file, in which it has a name of its own or stands in a tuple: there the process that compiles finds
    it.

    Parameters
    ----------
    law : DriftLaw
        See `tdint.kernels.laws.law`.
    where : str
        Where it is from, for messages; by default its name.

    Raises
    ------
    UsageError
        No law; a name that is taken or is none; no file.
    """
    if not isinstance(law, DriftLaw):
        raise UsageError(f"{where or law!r}: a law is a tdint.DriftLaw, not {type(law).__name__}")
    where = where or f"law {law.name!r}"
    check_name(law.name, LAWS, "law", where)
    home = law.functions.__module__
    if home == "__main__" or getattr(sys.modules.get(home), "__file__", None) is None:
        raise UsageError(f"{where}: put the law into a module of its own, a file that another process can execute")
    if os.environ.get("TDINT_KERNELS") == "python" and "tdint.kernels.laws.choosing" in sys.modules:
        raise UsageError(f"{where}: under TDINT_KERNELS=python laws are registered before methods are imported")
    with faults_of(where):
        law.functions()
    from tdint.kernels.building.sources import OUTSIDE

    own = replace(law, apart=False)
    OUTSIDE[law.name] = home
    CODES[law.name] = len(_LAWS)
    LAWS[law.name] = own
    _LAWS.append(own)


@cache
def laws() -> dict[str, DriftLaw]:
    """All drift laws by name, those of installed packages (entry points `tdint.laws`) among them."""

    def take(found: Any, where: str) -> None:
        for law in declared(found, "LAWS", DriftLaw, where):
            register_law(law, where)

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
        Values in SI in the order of `LAWS[name].parameters`; a `many` parameter comes last and is flattened.
    """

    name: str
    parameters: tuple[float, ...]


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
    units : str or None
        As `tdint.units.parse_units` understands them; None leaves it to the record.
    component : str or None
        The component to use; None where the record has only one.
    scale : float
        Factor on the acceleration, not zero.
    inventory : str or None
        Path of the station metadata, resolved like `file`.
    processing : Processing
        What is done to the record, before it is scaled.
    layout : TextLayout
        What a text table does not tell itself.
    """

    file: str
    units: str | None
    component: str | None
    scale: float
    inventory: str | None
    processing: Processing = field(default_factory=Processing)
    layout: TextLayout = AS_STATED


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

    def replace(self, **changes: float) -> Model:
        """The building with some of its numbers changed: `model.replace(damping=0.02, stiffness_factor=1.1)`.

        Names are those of `tdint.model.variation.PARAMETERS`, which tells what they mean; a factor of one story is
        given as `model.replace(**{"story 3.stiffness_factor": 0.8})`.

        Raises
        ------
        UsageError
            An unknown name, a value out of range, or nothing that it could act on.
        """
        from tdint.model.variation import varied

        return varied(self, changes)

    def __repr__(self) -> str:
        count = len(self.stories)
        return f"<Model {self.name!r}: {count} {'story' if count == 1 else 'stories'}>"


LINEAR = Law("linear", ())


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


def four_points(points: Sequence[Sequence[float]]) -> tuple[float, ...]:
    """Two to four points as four, flattened: of two the others lie at the thirds between them, of three the one that is
    missing lies midway between the last ones (as the buildings of GEM's vulnerability toolkit have it)."""
    (*first, before, last) = points
    missing = 4 - len(points)
    parts = [j / (missing + 1) for j in range(1, missing + 1)]
    between = [[a + part * (b - a) for a, b in zip(before, last, strict=True)] for part in parts]
    return tuple(number for point in (*first, before, *between, last) for number in point)
