"""Damage states of buildings: demands, and medians, dispersion and losses of a building type."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Self

from tdint.errors import UsageError
from tdint.model.status import FALLEN

STATES = ("slight", "moderate", "extensive", "complete")
"""Damage states of Hazus; the toolkits of GEM use the same states."""

NONE = "none"
"""Outcome of a building without damage."""


COST, NUMBER = "cost", "number"
"""Columns of an inventory: cost of a building, and number of buildings that a row represents
(default 1)."""

HAZUS, CAPACITY = "hazus", "capacity"
HAZUS_DISPERSION = 0.4
"""Dispersion that SimCenter uses with the drift ratios of Hazus."""


@dataclass(frozen=True)
class DamageDemand:
    """Demand that determines the damage state.

    Attributes
    ----------
    unit : str
        SI unit; 1 for a ratio.
    quantity : str
        Quantity of a run (`run_values.RUN`) that determines the demand.
    per : str
        Divisor of the roof displacement: `height` or `participation`; empty for demands that are
        not computed from the roof displacement.
    """

    unit: str
    meaning: str
    quantity: str
    per: str = ""


DEMANDS = {
    "drift_ratio": DamageDemand(
        "1", "maximum peak drift divided by story height", "peak_drift_ratio"
    ),
    "roof_drift_ratio": DamageDemand(
        "1",
        "maximum displacement of the roof divided by the height of the building",
        "peak_roof_displacement",
        "height",
    ),
    "residual_drift_ratio": DamageDemand(
        "1", "maximum drift at the end of the run, divided by story height", "residual_drift_ratio"
    ),
    "acceleration": DamageDemand(
        "m/s^2", "maximum absolute acceleration of a floor", "peak_absolute_acceleration"
    ),
    "spectral_displacement": DamageDemand(
        "m",
        "maximum displacement of the roof divided by the participation factor of the first mode",
        "peak_roof_displacement",
        "participation",
    ),
}
"""Demands by name in model and campaign files."""


@dataclass(frozen=True)
class DamageStates:
    """Damage states of a building type.

    Attributes
    ----------
    demand : str
        A key of `DEMANDS`.
    states : tuple of str
        Names of the states, from the lightest to the most severe.
    medians : tuple of float
        Demand with half of the buildings in the state or a more severe state, SI units, increasing.
    dispersion : float
        Standard deviation of the logarithm of the demand; 0 if the medians are thresholds.
    losses : tuple of float
        Mean loss ratio in each state and after a collapse; empty without losses.

    Raises
    ------
    UsageError
        The medians do not increase, or their number differs from the number of states.
    """

    demand: str
    states: tuple[str, ...]
    medians: tuple[float, ...]
    dispersion: float = 0.0
    losses: tuple[float, ...] = ()

    def __post_init__(self) -> None:
        """Check that each state has a median, and that the medians increase."""
        if len(self.medians) != len(self.states):
            raise UsageError(
                f"{len(self.states)} damage states require the same number of thresholds, got "
                f"{len(self.medians)}"
            )
        if DEMANDS[self.demand].unit == "1" and max(self.medians, default=0.0) > 1.0:
            raise UsageError(
                f"the thresholds of drift ratios must be at most 1, got {max(self.medians):g}; "
                "write a percentage as 4% or 0.04"
            )
        # The lightest state is compared with zero, each other state with the state before.
        previous_medians = (0.0, *self.medians)
        for state, median, previous in zip(
            self.states, self.medians, previous_medians, strict=False
        ):
            if not median > previous:
                raise UsageError(
                    "the thresholds of damage states must be positive and increase from state to "
                    f"state, got {median:g} for {state} after {previous:g}"
                )

    @classmethod
    def from_json(cls, stored: Mapping[str, Any]) -> Self:
        """Create the states from a mapping with their attributes, where tuples are lists, as
        JSON stores them."""
        lists = {name: tuple(stored[name]) for name in ("states", "medians", "losses")}
        return cls(demand=stored["demand"], dispersion=stored["dispersion"], **lists)

    @property
    def outcomes(self) -> tuple[str, ...]:
        """Possible outcomes of a building: no damage, the states, and the types of collapse."""
        return NONE, *self.states, *FALLEN

    @property
    def outcome_losses(self) -> tuple[float, ...]:
        """Loss ratio of each outcome, in the order of `outcomes`; empty without losses."""
        if not self.losses:
            return ()
        # The last loss ratio is the ratio of collapse. It applies to all types of collapse.
        return (0.0, *self.losses[:-1], *[self.losses[-1]] * len(FALLEN))
