"""Signatures of kernels, without the compiler: what a kernel takes and returns."""

from __future__ import annotations

from dataclasses import dataclass


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
