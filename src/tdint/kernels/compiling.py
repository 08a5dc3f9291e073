"""The decorators of kernels.

A kernel has one explicit signature. In the process of a user the decorated functions stay plain
Python, and a kernel is loaded from an object file when it is first called
(`tdint.kernels.building`). If there is none a process of its own compiles it: there the same
decorators are those of numba, and what a variant does without is left out.
"""

from __future__ import annotations

import os
from collections.abc import Callable
from typing import Any

import numpy as np

from tdint.kernels.building.compilable import (
    EVERYTHING,
    F8,
    I8,
    ArrayOf,
    Compilable,
    Signature,
    Variant,
    parse,
)

__all__ = [
    "CUBE",
    "F8",
    "I8",
    "TABLE",
    "VARIANT",
    "VECTOR",
    "Kernel",
    "indirect_caller",
    "inline",
    "kernel",
    "local",
    "local_table",
    "outlined",
    "specialized",
]

VECTOR = ArrayOf(1)
TABLE = ArrayOf(2)
CUBE = ArrayOf(3)

COMPILES = os.environ.get("TDINT_KERNELS") == "compile"
"""Whether this process compiles kernels, as `tdint.kernels.building.process` starts it."""

VARIANT = parse(os.environ["TDINT_KERNELS_VARIANT"]) if COMPILES else EVERYTHING
"""What this process compiles for; everything in other processes, for there kernels are chosen at
run time."""

_LAWS_AND_LOADS = ("laws", "modal", "forces", "dashpots")


class Kernel(Compilable):
    """A function that is compiled for one signature, or loaded, when it is first asked for."""

    @property
    def compiled(self) -> Callable[..., Any]:
        """The kernel for all that there is."""
        return self.variant(EVERYTHING)

    def variant(self, variant: Variant) -> Callable[..., Any]:
        """The kernel for what a scene needs."""
        last, function = self._last
        if function is not None and variant is last:
            return function
        needed = self.needs(variant)
        if needed not in self._loaded:
            from tdint.kernels.building.obtaining import obtain

            obtain([(self, needed)])
        function = self._loaded[needed]
        self._last = variant, function
        return function


def kernel(
    signature: Signature, parts: tuple[str, ...] = _LAWS_AND_LOADS, vectorized: bool = False
) -> Callable[[Callable[..., Any]], Kernel]:
    """Make a `Kernel` of a function.

    A loop over stories is short, and before each that could be vectorized compiled code would ask
    whether its rows overlap: that costs a building of three stories a third of its time and one of
    ten up to a seventh; one of 300 would gain a fifth. Loops over many oscillators gain more than
    half.
    """
    return lambda function: Kernel(function, signature, parts, vectorized)


if COMPILES:
    from tdint.kernels.building.compiler import (
        indirect_caller,
        inline,
        local,
        local_table,
        outlined,
        specialized,
    )
else:
    # Nothing is compiled: kernels are Python that a debugger can walk through.

    def inline(function: Callable[..., Any]) -> Any:
        """Mark a function of the inner loops: its code is put into each place that calls it."""
        return function

    def outlined(function: Callable[..., Any]) -> Any:
        """Mark a function that kernels call now and then: compiled once and called, it keeps
        compiling short."""
        return function

    def specialized(function: Callable[..., Any]) -> Any:
        """The same, compiled anew for each constant argument: a block of springs, a truth."""
        return function

    def indirect_caller(signature: Signature) -> Any:
        """A function (kernel, its arguments) that calls a kernel given to another one."""
        return lambda kernel, *arguments: kernel(*arguments)

    def local(size: int) -> Any:
        """An array of a kernel's own, not filled, that lasts as long as its call; not to be made in
        a loop."""
        return np.empty(size)

    def local_table(rows: int, columns: int) -> Any:
        """`local` with two dimensions."""
        return np.empty((rows, columns))
