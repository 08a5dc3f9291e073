"""What a campaign file says, as typed values in SI units; nothing here reads the files that it names."""

from __future__ import annotations

from dataclasses import dataclass

from tdint.campaign.engine.runs import RunSettings
from tdint.campaign.fragility.type_states import DamageWishes
from tdint.campaign.motions import GridFile, MeasureLevels, Scales
from tdint.campaign.sweep import ParameterSweep
from tdint.ground_motion.pairing import PairNames
from tdint.ground_motion.processing import RecordChoice


@dataclass(frozen=True)
class ModelFiles:
    """Buildings of model files, by their paths as seen from the working directory."""

    files: tuple[str, ...]


@dataclass(frozen=True)
class InventoryFile:
    """Buildings of an inventory by rules.

    Attributes
    ----------
    file : str
        The CSV file.
    rules : str
        The set of rules.
    length : float
        The unit of the file's lengths, m.
    classes : str or None
        The CSV file of the classes, for rules that have some.
    as_published : bool
        As of `tdint.model.inventory.capacity.CapacityFacts`.
    mass_only : bool
        Leave out the stiffness-proportional damping.
    stiffness_scatter, damping_scatter : float
        Standard deviations of factors on stiffness and damping ratio.
    seed : int
        What the factors are drawn from.
    """

    file: str
    rules: str
    length: float
    mass_only: bool = False
    stiffness_scatter: float = 0.0
    damping_scatter: float = 0.0
    seed: int = 0
    classes: str | None = None
    as_published: bool = False

    @property
    def files(self) -> tuple[str, ...]:
        """What is read of it."""
        return (self.file, *([self.classes] if self.classes else []))


@dataclass(frozen=True)
class RecordFiles:
    """Records by files and folders; `pairs`: how the two horizontals of each motion are named that are taken
    together."""

    files: tuple[str, ...]
    choice: RecordChoice
    pairs: PairNames | None = None


@dataclass(frozen=True)
class SequenceFile:
    """Shocks one after the other, by a CSV file of their records; `rest` seconds between them, None: until the building
    is at rest."""

    file: str
    choice: RecordChoice
    rest: float | None


@dataclass(frozen=True)
class FieldFile:
    """Ground motion fields: what each event does at each site.

    Attributes
    ----------
    file : str
        The CSV file of events, sites, records and factors.
    choice : RecordChoice
        How the records are read.
    pairs : bool
        Take the two horizontals of a record together.
    sites : str or None
        The CSV file of the sites' places; None: the inventory names the site of each building.
    distance : str
        As of `tdint.campaign.motions.COORDINATES`: by which the nearest site is found.
    """

    file: str
    choice: RecordChoice
    pairs: bool = False
    sites: str | None = None
    distance: str = "km"


@dataclass(frozen=True)
class FactorsFile:
    """Factors of each motion from a CSV file, as `tdint scale` writes it."""

    file: str


@dataclass(frozen=True)
class AnalysisWishes:
    """What is the same for all buildings; None leaves it to each model.

    Attributes
    ----------
    method : str or None
        Method with its parameters.
    collapse_drift : float or None
        Drift ratio over which a run is flagged as collapsed.
    p_delta : bool or None
        Whether gravity acts on the displaced buildings.
    """

    method: str | None = None
    collapse_drift: float | None = None
    p_delta: bool | None = None


@dataclass(frozen=True)
class CampaignFile:
    """A campaign file, checked.

    Attributes
    ----------
    name, source : str
        The campaign's name (the file's, where it gives none), and the file as the user named it.
    settings : RunSettings
        How all runs are integrated, and what is kept of them.
    sweep : ParameterSweep or None
        What is varied in every building.
    damage : DamageWishes or None
        How damage is told; None: as the models say.
    """

    name: str
    source: str
    buildings: ModelFiles | InventoryFile
    records: RecordFiles | SequenceFile | GridFile | FieldFile
    intensity: Scales | MeasureLevels | FactorsFile
    analysis: AnalysisWishes
    settings: RunSettings
    sweep: ParameterSweep | None = None
    damage: DamageWishes | None = None
