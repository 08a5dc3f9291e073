"""What is compiled: a function with its signature, and which parts of a scene: what it does without
is left out."""

from __future__ import annotations

import os
from collections.abc import Callable
from dataclasses import dataclass, fields, replace
from typing import Any


@dataclass(frozen=True)
class Signature:
    """What a kernel returns and takes. A signature among the arguments stands for a function of
    that kind."""

    returns: Scalar
    arguments: tuple[Argument, ...]


@dataclass(frozen=True)
class Scalar:
    """A number; called with the types of arguments it is the signature of a function that returns
    such a number."""

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
"""Whether one variant serves all scenes: where many different buildings are integrated, less is
compiled."""


@dataclass(frozen=True)
class Variant:
    """What a kernel is compiled for.

    Attributes
    ----------
    laws : tuple of str
        Drift laws of the stories by name, in the order of `tdint.kernels.laws.LAWS`; empty for all
        of ours. One of a plug-in is named with its number, `name@9`.
    modal : bool
        Modal damping.
    forces : bool
        Forces on floors.
    dashpots : bool
        Dashpots, linear ones or of a power law.
    """

    laws: tuple[str, ...] = ()
    modal: bool = True
    forces: bool = True
    dashpots: bool = True

    @property
    def text(self) -> str:
        """The variant in a word that a file name may hold, read by `parse`."""
        parts = "".join(f"+{name}" for name in FEATURES if getattr(self, name))
        return (",".join(self.laws) or "all") + parts

    @property
    def outside(self) -> dict[str, int]:
        """The numbers of the laws of plug-ins, by name."""
        split = (law.partition("@") for law in self.laws)
        return {name: int(code) for name, at, code in split if at}

    def only(self, parts: tuple[str, ...]) -> Variant:
        """The variant of a kernel that depends on some `parts` alone (names of the attributes)."""
        return replace(
            self, **{name: getattr(EVERYTHING, name) for name in _PARTS if name not in parts}
        )


EVERYTHING = Variant()
_PARTS = tuple(field.name for field in fields(Variant))
FEATURES = _PARTS[1:]


def parse(text: str) -> Variant:
    """Read what `Variant.text` writes."""
    laws, *features = text.split("+")
    if unknown := set(features) - set(FEATURES):
        raise ValueError(f"variant {text!r}: unknown {', '.join(sorted(unknown))}")
    chosen = () if laws == "all" else tuple(laws.split(","))
    return Variant(chosen, **{name: name in features for name in FEATURES})


_TAKEN: set[str] = set()
"""How the loops that this process has taken are executed: compiled, interpreted or both."""


def time_loops() -> str | None:
    """Return how this process executes time loops: "compiled", or "interpreted" if it has taken any
    loop so; None if it has taken no loop."""
    return "interpreted" if "interpreted" in _TAKEN else next(iter(_TAKEN), None)


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
        self,
        function: Callable[..., Any],
        signature: Signature,
        parts: tuple[str, ...],
        vectorized: bool = False,
    ) -> None:
        self.function = function
        self.signature = signature
        self.parts = parts
        self.vectorized = vectorized
        self.__doc__ = function.__doc__
        self._loaded: dict[Variant, Callable[..., Any]] = {}
        self._needs: dict[Variant, Variant] = {}  # found once: it is asked for at each call
        self._last: tuple[Variant, Callable[..., Any] | None] = (
            EVERYTHING,
            None,
        )  # most calls are those before again

    @property
    def name(self) -> str:
        """Where the kernel stands, as `package.module:function`."""
        return f"{self.function.__module__}:{self.function.__qualname__}"

    def needs(self, variant: Variant) -> Variant:
        """What of a variant matters to this kernel."""
        needed = self._needs.get(variant)
        if needed is None:
            needed = self._needs[variant] = (
                EVERYTHING if WHOLE and not variant.outside else variant.only(self.parts)
            )
        return needed

    def loaded(self, variant: Variant) -> bool:
        """Whether this process has the kernel."""
        last, function = self._last
        return (function is not None and variant is last) or self.needs(variant) in self._loaded

    def take(
        self, variant: Variant, function: Callable[..., Any], *, interpreted: bool = False
    ) -> None:
        """Take the function for a variant: compiled, or interpreted by Python as it is written."""
        _TAKEN.add("interpreted" if interpreted else "compiled")
        self._loaded[self.needs(variant)] = function
        self._last = EVERYTHING, None
