"""Groups of items with equal keys, and sequences of items that are created on access."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Iterable, Sequence
from typing import TypeVar, overload

Key = TypeVar("Key")
Item = TypeVar("Item")


def grouped(items: Iterable[tuple[Key, Item]]) -> dict[Key, list[Item]]:
    """Return the items of each key, in the order of the first item of the key.

    Parameters
    ----------
    items : iterable of (key, item)
        Items with their keys.
    """
    groups: dict[Key, list[Item]] = {}
    for key, item in items:
        groups.setdefault(key, []).append(item)
    return groups


class LazySequence(Sequence[Item]):
    """Sequence of items that are created on access, because millions of items need much memory."""

    @abstractmethod
    def make(self, number: int) -> Item:
        """Create the item with index `number`."""

    @overload
    def __getitem__(self, index: int) -> Item: ...
    @overload
    def __getitem__(self, index: slice) -> list[Item]: ...
    def __getitem__(self, index: int | slice) -> Item | list[Item]:
        """Create the item with an index, or a list of the items of a slice."""
        # The range converts negative indices and slices.
        selected = range(len(self))[index]
        if isinstance(selected, int):
            return self.make(selected)
        return [self.make(number) for number in selected]
