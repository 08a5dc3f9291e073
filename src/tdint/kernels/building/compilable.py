"""What is compiled: a function with its signature, what it takes and returns, and the parts of a scene that it depends
on."""

from __future__ import annotations

import os
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from tdint.kernels.building.variant import EVERYTHING, Variant


@dataclass(frozen=True)
class Signature:
    """What a kernel returns and takes. A signature among the arguments stands for a function of that kind."""

    returns: Scalar
    arguments: tuple[Argument, ...]


@dataclass(frozen=True)
class Scalar:
    """A number; called with the types of arguments it is the signature of a function that returns such a number."""

    name: str

    def __call__(self, *arguments: Argument) -> Signature:
        return Signature(self, arguments)


@dataclass(frozen=True)
class ArrayOf:
    """An array of floating-point numbers in C order."""

    dimensions: int


Argument = Scalar | ArrayOf | Signature

F8 = Scalar("float64")
I8 = Scalar("int64")

WHOLE = os.environ.get("TDINT_KERNELS") == "whole"
"""Whether one variant serves all scenes: where many different buildings are integrated, less is compiled."""


class Compilable:
    """A function, and what it is compiled for.

    Parameters
    ----------
    parts : tuple of str
        The parts of `Variant` that the kernel depends on.
    vectorized : bool
        Whether loops may be turned into vector instructions.
    """

    def __init__(
        self, function: Callable[..., Any], signature: Signature, parts: tuple[str, ...], vectorized: bool = False
    ) -> None:
        self.function = function
        self.signature = signature
        self.parts = parts
        self.vectorized = vectorized
        self.__doc__ = function.__doc__
        self._loaded: dict[Variant, Callable[..., Any]] = {}
        self._needs: dict[Variant, Variant] = {}  # found once: it is asked for at each call
        self._last: tuple[Variant, Callable[..., Any] | None] = EVERYTHING, None  # most calls are those before again

    @property
    def name(self) -> str:
        """Where the kernel stands, as `package.module:function`."""
        return f"{self.function.__module__}:{self.function.__qualname__}"

    def needs(self, wanted: Variant) -> Variant:
        """What of a variant matters to this kernel."""
        found = self._needs.get(wanted)
        if found is None:
            found = self._needs[wanted] = EVERYTHING if WHOLE and not wanted.outside else wanted.only(self.parts)
        return found

    def loaded(self, wanted: Variant) -> bool:
        """Whether this process has the kernel."""
        last, function = self._last
        return (function is not None and wanted is last) or self.needs(wanted) in self._loaded

    def take(self, wanted: Variant, function: Callable[..., Any]) -> None:
        """Take a compiled function for a variant."""
        self._loaded[self.needs(wanted)] = function
