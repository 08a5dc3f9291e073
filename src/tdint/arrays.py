"""Type of arrays, classes with arrays, maxima, bisection, and properties that are computed once."""

from __future__ import annotations

import functools
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, fields
from typing import TYPE_CHECKING, Any, Protocol, TypeAlias, TypeVar, dataclass_transform

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
"""Argument that accepts several numbers: a list, a tuple or a one-dimensional array."""


_Class = TypeVar("_Class")


@dataclass_transform(frozen_default=True, eq_default=False)
def immutable(cls: type[_Class]) -> type[_Class]:
    """Return a class with arrays as a data class whose objects cannot be changed.

    Two objects are equal only if they are the same object, because arrays have no single truth
    value. The class or its base class defines how an object is shown.
    """
    return dataclass(frozen=True, eq=False, repr=False)(cls)


def max_absolute(values: Array) -> float:
    """Return the maximum absolute value, without a copy of the values; 0 for an empty array."""
    return max(float(np.max(values, initial=0.0)), -float(np.min(values, initial=0.0)))


def bisect_interval(
    is_true: Callable[[float], bool], low: float, high: float, max_bisections: int
) -> tuple[float, float]:
    """Bisect an interval where a condition changes from True to False.

    Parameters
    ----------
    is_true : callable
        The condition: True at `low`, False at `high`.
    max_bisections : int
        Maximum number of bisections. The bisection stops earlier if the endpoints are adjacent
        floating-point numbers.

    Returns
    -------
    tuple of float
        Endpoints of the final interval; the condition is True at the first and False at the second.
    """
    for _ in range(max_bisections):
        middle = 0.5 * (low + high)
        if not low < middle < high:
            break
        low, high = (middle, high) if is_true(middle) else (low, middle)
    return low, high


if TYPE_CHECKING:
    from functools import cached_property as cached_property
else:

    class cached_property(functools.cached_property):  # noqa: N801  same name as in functools
        """Property that is computed once, without the lock that Python before 3.12 uses.

        A child process that is forked while another thread has acquired the lock would wait
        forever. Without the lock, two threads may both compute the value; the values are equal.
        """

        def __get__(self, instance, owner=None):
            """Return the value for an instance; the value is computed and stored at the first call.

            With `instance` None (access through the class), return the property.
            """
            if instance is None:
                return self
            attributes = vars(instance)
            if self.attrname not in attributes:
                attributes[self.attrname] = self.func(instance)
            return attributes[self.attrname]


def join_arrays(*arrays: Array) -> Array:
    """Return arrays as a single array, joined along the first axis."""
    return np.concatenate(arrays)


def each_array(function: Callable[..., Array], *parts: Any) -> Any:
    """Return a dataclass with the results of a function of each array and number of `parts`.

    Parameters
    ----------
    function : callable
        Function of the arrays of the same name, one array of each part.
    parts
        Dataclasses of the same type, which may contain other dataclasses, mappings of arrays, and
        texts and tuples of labels, which all parts have in common. If a part has None, the result
        has None.
    """
    if any(part is None for part in parts):
        return None
    if isinstance(parts[0], np.ndarray | float):
        return function(*parts)
    if isinstance(parts[0], dict):
        return {name: each_array(function, *(part[name] for part in parts)) for name in parts[0]}
    if isinstance(parts[0], str | tuple):
        return parts[0]
    names = [member.name for member in fields(parts[0])]
    return type(parts[0])(
        **{name: each_array(function, *(getattr(part, name) for part in parts)) for name in names}
    )
