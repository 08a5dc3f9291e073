"""What a number of a result is: its unit, its meaning and where it comes from, declared once, where its field is."""

from __future__ import annotations

import sys
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any, get_args, get_type_hints

_SHORT = {"1": "", "text": "", "degree": "_deg", "Hz": "_hz"}


def suffix(unit: str) -> str:
    """The end of a name that says a unit: `_m_s2` for m/s^2, `_kipin` for kip*in; none for a number without a unit and
    for words (`text`)."""
    return _SHORT.get(unit, "_" + unit.replace("*", "").replace("^", "").replace("/", "_"))


@dataclass(frozen=True)
class Quantity:
    """A number of a result, or an array of them, as the annotation of its field.

    Attributes
    ----------
    unit : str
        In SI; 1 for a number without a unit, `text` for words.
    meaning : str
        What it is, for people.
    value : callable or None
        What gives it from what the class that declares it says; None where it is just put there.
    shown : tuple of str
        Where it appears, in words of that class.
    called : str
        Its name in columns and keys, where these say more than the field.
    name : str
        Of the field; filled in by `quantities`, as is the next one.
    kind : type
        Of a value: float, int or str.
    """

    unit: str
    meaning: str
    value: Callable[..., Any] | None = None
    shown: tuple[str, ...] = ("table", "summary")
    called: str = ""
    name: str = ""
    kind: type = float

    @property
    def column(self) -> str:
        """Its name with its unit, as in the header of a table."""
        return (self.called or self.name) + suffix(self.unit)


def quantities(declaring: type) -> tuple[Quantity, ...]:
    """The quantities among the fields of a class, in their order."""
    # Functions in annotations look for names in the modules where they stand, and not in the class.
    place: dict[str, Any] = {}
    for base in reversed(declaring.__mro__):
        place |= vars(sys.modules[base.__module__])
    found = []
    for name, hint in get_type_hints(declaring, place, include_extras=True).items():
        for one in getattr(hint, "__metadata__", ()):
            if isinstance(one, Quantity):
                kind = (*get_args(hint.__origin__), hint.__origin__)[0]
                found.append(replace(one, name=name, kind=kind if kind in (int, str) else float))
    return tuple(found)
