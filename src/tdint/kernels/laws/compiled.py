"""Laws as objects of compilation."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from functools import cache
from typing import Any

from tdint.kernels.building.compilable import LAW_PREFIX, Compilable
from tdint.kernels.building.sources import FRACTURES, OUTSIDE
from tdint.kernels.laws import LAWS, OURS
from tdint.kernels.laws.law import DriftLaw


class CompiledLaw(Compilable):
    """Object file of a law, for all kernels.

    Parameters
    ----------
    code : float
        Number of the law, in row CODE of the table `law_parameters`.
    name : str
        Name of the law.
    """

    def __init__(self, code: float, name: str) -> None:
        """Store the number and the name."""
        super().__init__()
        self.code = code
        self._law = name

    @property
    def name(self) -> str:
        """Name in the process that compiles, as `package.module:law.NAME`."""
        if self.code >= OURS:
            module = OUTSIDE[self._law]
        else:
            module = f"tdint.kernels.laws.{self._law.replace('-', '_')}"
        return f"{module}:{LAW_PREFIX}{self._law}{FRACTURES if self.code % 1.0 else ''}"

    def loaded(self, form: str) -> bool:
        """Return True if the table of laws contains this law."""
        law, _ = _IN_TABLE.get(self.code, (None, None))
        return law is self

    def load(self, form: str, code: bytes, description: dict[str, Any]) -> None:
        """Load the functions of the law, and write their addresses to the table of laws."""
        from tdint.kernels.building.loading import load_law

        _IN_TABLE[self.code] = self, load_law(self.code, code, description["properties"])

    def interpret(self, form: str, wrap: Callable[[Callable[..., Any]], Any]) -> None:
        """Do nothing: kernels in plain Python call the functions of the law itself, and the table
        of laws, from which compiled kernels call it, does not contain it yet."""


_IN_TABLE: dict[float, tuple[CompiledLaw, Any]] = {}
"""Laws in the table of laws of this process, with the engines that own the memory of their
functions. A law does not refer to its engine, because models with laws are pickled."""


def compiled_laws(codes: Iterable[float]) -> tuple[CompiledLaw, ...]:
    """Return the laws with these numbers."""
    return tuple(_compiled_law(float(code), LAWS[int(code)]) for code in codes)


@cache
def _compiled_law(code: float, law: DriftLaw) -> CompiledLaw:
    """Return a law; another law of a plug-in can have had the same number before (in tests)."""
    return CompiledLaw(code, law.name)
