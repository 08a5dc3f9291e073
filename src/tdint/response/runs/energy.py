"""Energy balance of a run: its terms, at the end or at all time steps."""

from dataclasses import dataclass
from functools import reduce
from operator import add
from typing import Annotated, Generic, TypeVar

from tdint.arrays import immutable
from tdint.tabular import Described

Amount = TypeVar("Amount")

ENERGY_ROUNDING = 1e-12
"""Dimensionless. Dissipated energy divided by peak force times peak drift, below which it is 0."""


@immutable
class EnergyTerms(Described, Generic[Amount]):
    """Energy terms, J: one field per row of `tdint.kernels.time_loop.observer`, in its order."""

    input: Annotated[Amount, "work of the load on the motion relative to the ground"]
    kinetic: Annotated[Amount, "kinetic energy of the motion relative to the ground"]
    viscous: Annotated[Amount, "work of viscous damping (Rayleigh, modal), without dashpots"]
    dampers: Annotated[Amount, "work of the dashpots"]
    strain: Annotated[Amount, "stored in the stories, P-delta included"]
    hysteretic: Annotated[Amount, "dissipated by the drift laws"]
    braces: Annotated[Amount, "stored in the braces of dampers"]


ENERGY_TERMS: dict[str, str] = {
    name: hint.__metadata__[0] for name, hint in EnergyTerms.__annotations__.items()
}
"""Description of each term by its name, which is also the name of columns and keys."""


@dataclass(frozen=True, repr=False)
class Energy(EnergyTerms[float]):
    """Energy balance of a run in terms of motion relative to the ground, J (Uang and Bertero 1990,
    relative energy).

    initial + input = the other terms + imbalance.

    Attributes
    ----------
    input : float
        Work of the load on the motion relative to the ground.
    kinetic : float
        Kinetic energy of the motion relative to the ground.
    viscous, dampers : float
        Work of viscous damping (Rayleigh, modal), and of the dashpots.
    strain : float
        Energy stored in the stories, including P-delta.
    hysteretic : float
        Energy dissipated by the hysteresis models.
    braces : float
        Energy stored in the braces of dampers.
    initial : float
        Kinetic and stored energy at the start.
    reference : float
        Maximum of initial + input during the run.
    """

    initial: float
    reference: float

    @property
    def error(self) -> float:
        """Energy imbalance divided by the reference energy; 0 for a run without energy.

        The imbalance is initial + input minus all other terms; it is negative if the method
        produces energy.
        """
        spent = reduce(add, [getattr(self, name) for name in ENERGY_TERMS if name != "input"])
        return (
            float((self.initial + self.input - spent) / self.reference)
            if self.reference > 0.0
            else 0.0
        )
