"""The type of arrays of numbers, how an interval is halved, and values that are found once."""

from __future__ import annotations

import functools
from collections.abc import Callable, Iterator, Sequence
from typing import TYPE_CHECKING, Any, Protocol, TypeAlias

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


class HasArray(Protocol):
    """Sequence that numpy converts to an array: an ndarray, a pandas Series, ..."""

    def __array__(self) -> NDArray[Any]:
        """Return the object as an array."""
        ...

    def __len__(self) -> int:
        """Return the number of items."""
        ...

    def __iter__(self) -> Iterator[Any]:
        """Yield the items."""
        ...


Numbers: TypeAlias = Sequence[float] | HasArray
"""Argument that accepts several numbers: a list, a tuple or an array with one axis."""


def halved(
    below: Callable[[float], bool], low: float, high: float, times: int
) -> tuple[float, float]:
    """Both ends of the interval in which something ceases to hold, halved so many times or down to
    the last digit.

    Parameters
    ----------
    below : callable
        Whether it holds: at `low` it does, at `high` it does not.
    """
    for _ in range(times):
        middle = 0.5 * (low + high)
        if not low < middle < high:
            break
        low, high = (middle, high) if below(middle) else (low, middle)
    return low, high


if TYPE_CHECKING:
    from functools import cached_property as cached_property
else:

    class cached_property(functools.cached_property):  # noqa: N801  it stands for that of Python
        """Without the lock that Python before 3.12 has for it: a child that is forked while another
        thread holds it would wait for ever. Two threads may both find a value; the values are the
        same."""

        def __get__(self, instance, owner=None):
            if instance is None:
                return self
            kept = vars(instance)
            if self.attrname not in kept:
                kept[self.attrname] = self.func(instance)
            return kept[self.attrname]
