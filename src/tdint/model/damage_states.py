"""Damage states: what demand they are told by, and the medians, dispersion and losses of a type of
buildings."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Self

from tdint.errors import UsageError

STATES = ("slight", "moderate", "extensive", "complete")
"""The damage states of Hazus, which are those of GEM's toolkits, too."""

NONE = "none"
DONE = "done"
"""How runs end under which a building stands."""

FALLEN = ("collapsed", "failed-story")
"""How runs end under which a building falls: they are told beside the damage states."""

COST, NUMBER = "cost", "number"
"""Columns of an inventory: what a building costs, and how many of them a row stands for (1 where it
is not told)."""

HAZUS, CAPACITY = "hazus", "capacity"
HAZUS_DISPERSION = 0.4
"""That with which SimCenter takes the drift ratios of Hazus."""


@dataclass(frozen=True)
class DamageDemand:
    """What damage states are told by.

    Attributes
    ----------
    unit : str
        In SI; 1 for a ratio.
    meaning : str
        What it is, for people.
    per : str
        What the roof's displacement is divided by: `height`, `participation`, or nothing where it
        is not of the roof.
    """

    unit: str
    meaning: str
    per: str = ""


DEMANDS = {
    "drift_ratio": DamageDemand("1", "largest peak drift over story height"),
    "roof_drift_ratio": DamageDemand(
        "1", "largest displacement of the roof over the height of the building", "height"
    ),
    "residual_drift_ratio": DamageDemand(
        "1", "largest drift over story height at the end of the run"
    ),
    "acceleration": DamageDemand("m/s^2", "largest absolute acceleration of a floor"),
    "spectral_displacement": DamageDemand(
        "m",
        "largest displacement of the roof over the participation factor of the first mode",
        "participation",
    ),
}
"""By their names in model and campaign files."""


@dataclass(frozen=True)
class DamageStates:
    """The damage states of one type of buildings.

    Attributes
    ----------
    demand : str
        One of `DEMANDS`.
    states : tuple of str
        Their names, from the lightest.
    medians : tuple of float
        The demand at which half of the buildings are in the state or a heavier one, SI units,
        rising.
    dispersion : float
        Standard deviation of the logarithm of that demand; 0: the medians are thresholds.
    losses : tuple of float
        Mean loss ratio in each state, and after a collapse; none where they are not told.

    Raises
    ------
    UsageError
        The medians do not rise, or there are not as many as states.
    """

    demand: str
    states: tuple[str, ...]
    medians: tuple[float, ...]
    dispersion: float = 0.0
    losses: tuple[float, ...] = ()

    def __post_init__(self) -> None:
        if len(self.medians) != len(self.states):
            raise UsageError(
                f"{len(self.states)} damage states need as many thresholds, got {len(self.medians)}"
            )
        for state, median, last in zip(
            self.states, self.medians, (0.0, *self.medians), strict=False
        ):
            if not median > last:
                raise UsageError(
                    f"the thresholds of damage states rise from state to state, {state} is "
                    f"{median:g}"
                )

    @classmethod
    def of_json(cls, said: Mapping[str, Any]) -> Self:
        """The states whose attributes JSON has kept."""
        lists = {name: tuple(said[name]) for name in ("states", "medians", "losses")}
        return cls(demand=said["demand"], dispersion=said["dispersion"], **lists)

    @property
    def outcomes(self) -> tuple[str, ...]:
        """What may become of a building: no damage, the states, and the ends by falling."""
        return NONE, *self.states, *FALLEN

    @property
    def outcome_losses(self) -> tuple[float, ...]:
        """The loss ratio of each of them; none where losses are not told."""
        return (0.0, *self.losses, *self.losses[-1:] * (len(FALLEN) - 1)) if self.losses else ()
