"""Hysteresis models of stories (drift laws), one file for each law.

The number of a law is its index in the sequence `LAWS`. Row CODE of the table `law_parameters`
contains the number of the law of each story. Compiled code selects the law by this number
(`tdint.kernels.laws.selection`). The laws of plug-ins are appended to the sequence
(`tdint.model.story_laws.register_law`).
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, MutableSequence
from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from tdint.kernels.laws.law import DriftLaw

# The order must not change, because the position of a law is its number.
NAMES = (
    "linear",
    "bilinear",
    "peak-oriented",
    "bouc-wen",
    "gap",
    "tanh",
    "polynomial",
    "trilinear-pinching",
    "imk",
    "multilinear-pinching",
    "multilinear",
    "ramberg-osgood",
    "steel",
)
"""Names of the laws of tdint in the order of their numbers."""


UNAVAILABLE = {
    "friction": "friction that depends on the velocity is not available, because the force of a "
    "law depends on the drift only; use bilinear with the sliding force as yield_force and "
    "hardening 0 for a constant friction"
}
"""Reasons by the names of laws that other programs have and tdint lacks."""


class Laws(MutableSequence["DriftLaw"]):
    """Sequence of laws. The module of a law of tdint is imported when the law is first used, so
    that a run loads only the laws of its building.
    """

    def __init__(self, names: Iterable[str]) -> None:
        """Store the names of the laws; the module of a law has its name, with "_" for "-"."""
        self._items: list[DriftLaw | str] = list(names)

    def names(self) -> Iterator[str]:
        """Yield the names of all laws without importing them."""
        for item in self._items:
            yield item if isinstance(item, str) else item.name

    def __len__(self) -> int:
        """Return the number of laws."""
        return len(self._items)

    def __getitem__(self, number: Any) -> Any:
        """Return the law with a number; its module is imported at the first access.

        The number of a law that can fracture is the number of the law plus FRACTURING.
        """
        if not isinstance(number, slice):
            whole = int(number)
            if number != whole:
                from tdint.kernels.laws.fracture import fracturing

                return fracturing(self[whole])
            number = whole
        item = self._items[number]
        if isinstance(item, str):
            item = import_module(f"tdint.kernels.laws.{item.replace('-', '_')}").LAW
            self._items[number] = item
        return item

    def __setitem__(self, number: Any, law: Any) -> None:
        """Replace the law with a number."""
        self._items[number] = law

    def __delitem__(self, number: Any) -> None:
        """Remove the law with a number; the number of each following law decreases."""
        del self._items[number]

    def insert(self, index: int, value: DriftLaw) -> None:
        """Insert the law `value` before the law with the number `index`; the number of each law
        from this position on increases by 1."""
        self._items.insert(index, value)


LAWS = Laws(NAMES)
"""Laws by number: the laws of tdint, then the laws of plug-ins."""

OURS = len(NAMES)
"""Number of built-in laws. Laws with this number or a larger one belong to plug-ins."""

LINEAR = NAMES.index("linear")
"""Number of the linear law in row CODE of `law_parameters`."""
