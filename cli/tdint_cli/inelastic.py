"""Options of `tdint spectrum` for oscillators that yield, and what becomes of them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import click

from tdint.errors import UsageError
from tdint_cli import options

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from tdint.analysis.spectra.inelastic import InelasticSpectrum
    from tdint.ground_motion.record import Record

_MOST_DUCTILE = 1000.0

ductility = click.option(
    "--ductility",
    type=options.Numbers(options.Number(1.0, _MOST_DUCTILE)),
    metavar="MU[,MU...]",
    help="Inelastic spectra instead: the yield strength for each of these ratios of largest to yield displacement (the "
    "largest strength if there are several).",
)
strength = click.option(
    "--strength",
    type=options.Numbers(options.Number(0.0, min_open=True)),
    metavar="RATIO[,RATIO...]",
    help="Inelastic spectra instead: the response for each of these ratios of yield force to weight.",
)
hardening = click.option(
    "--hardening",
    type=options.Number(0.0, 1.0, max_open=True),
    metavar="RATIO",
    help="With --ductility or --strength: stiffness after yielding over the initial one; 0 by default (elastoplastic).",
)


@dataclass(frozen=True)
class Wanted:
    """What is asked of oscillators that yield: ductilities or strengths, and the hardening.

    Raises
    ------
    UsageError
        Both are given, or neither is and the hardening is.
    """

    ductility: tuple[float, ...] | None
    strength: tuple[float, ...] | None
    hardening: float | None

    def __post_init__(self) -> None:
        if self.ductility and self.strength:
            raise UsageError("--ductility and --strength are given; leave one of them out")
        if self.hardening is not None and not self:
            raise UsageError("--hardening is for oscillators that yield: add --ductility or --strength")

    def __bool__(self) -> bool:
        """Whether anything is asked."""
        return bool(self.ductility or self.strength)

    @property
    def stiffness_ratio(self) -> float:
        """Stiffness after yielding over the initial one."""
        return self.hardening or 0.0

    def refuse(self, others: dict[str, object]) -> None:
        """Raise UsageError for an option, by its name, that has no meaning for oscillators that yield."""
        for option, value in others.items():
            if self and value is not None:
                raise UsageError(f"{option} is for elastic spectra; leave it out with --ductility and --strength")

    def spectra(
        self, record: Record, periods: NDArray[np.float64], dampings: Sequence[float]
    ) -> list[InelasticSpectrum]:
        """The spectra of a record."""
        from tdint.analysis.spectra.inelastic import constant_ductility, constant_strength

        results = []
        for damping in dampings:
            if self.ductility:
                results += constant_ductility(record, periods, self.ductility, damping, hardening=self.stiffness_ratio)
            else:
                results += constant_strength(
                    record, periods, self.strength or (), damping, hardening=self.stiffness_ratio
                )
        return results
