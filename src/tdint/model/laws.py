"""The drift laws that models may name, ours and those of others, and the law of a story."""

from __future__ import annotations

import os
import sys
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cache
from typing import Any

from tdint.errors import UsageError
from tdint.kernels.laws import LAWS as _LAWS
from tdint.kernels.laws.law import DriftLaw
from tdint.model.plugins import check_name, declared, faults_of, installed

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


LINEAR = Law("linear", ())


def four_points(points: Sequence[Sequence[float]]) -> tuple[float, ...]:
    """Two to four points as four, flattened: of two the others lie at the thirds between them, of three the one that is
    missing lies midway between the last ones (as the buildings of GEM's vulnerability toolkit have it)."""
    (*first, before, last) = points
    missing = 4 - len(points)
    parts = [j / (missing + 1) for j in range(1, missing + 1)]
    between = [[a + part * (b - a) for a, b in zip(before, last, strict=True)] for part in parts]
    return tuple(number for point in (*first, before, *between, last) for number in point)
