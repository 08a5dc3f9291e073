"""A building of a campaign, put together once for all its runs."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property, lru_cache

from tdint.analysis.run.prepared import PreparedBuilding
from tdint.methods.catalogue import parse
from tdint.methods.method import Integrator
from tdint.model.definition import Model


@lru_cache(maxsize=64)
def integrator_of(method: str) -> Integrator:
    """The method of a specification, read once for all buildings that share it."""
    return parse(method)


@dataclass(frozen=True)
class Subject:
    """A building and the method that integrates it; what follows from both is found once and kept.

    Attributes
    ----------
    model : Model
        The building; what it says of a record is not asked.
    method : str
        The method with its parameters.
    """

    model: Model
    method: str

    @cached_property
    def prepared(self) -> PreparedBuilding:
        """The building as arrays."""
        return PreparedBuilding.of(self.model)

    @cached_property
    def integrator(self) -> Integrator:
        """The method."""
        return integrator_of(self.method)

    @cached_property
    def period(self) -> float:
        """First period of the initial stiffness, s."""
        return self.prepared.period

    def __reduce__(self) -> tuple[type[Subject], tuple[Model, str]]:
        return Subject, (self.model, self.method)  # what was kept is found again where it goes
