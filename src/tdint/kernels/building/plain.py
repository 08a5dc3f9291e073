"""The decorators where nothing is compiled: kernels are Python that a debugger can walk through."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from tdint.kernels.building.compilable import Signature


def inlined(function: Callable[..., Any]) -> Any:
    """Mark a function of the inner loops: its code is put into each place that calls it."""
    return function


def called(function: Callable[..., Any]) -> Any:
    """Mark a function that kernels call now and then: it is compiled once and called, which keeps compiling short."""
    return function


def specialized(function: Callable[..., Any]) -> Any:
    """Mark a function that is `called`, but compiled anew for each constant argument: a block of springs, a truth."""
    return function


def called_at(signature: Signature) -> Any:
    """A function (kernel, its arguments) that calls a kernel given to another one."""
    return lambda kernel, *arguments: kernel(*arguments)


def local(size: int) -> Any:
    """An array of a kernel's own, not filled, that lasts as long as its call; not to be made in a loop."""
    return np.empty(size)


def local_table(rows: int, columns: int) -> Any:
    """`local` with two dimensions."""
    return np.empty((rows, columns))
