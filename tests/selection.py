"""Selection of the members of a parametrization that run in the fast tests."""

from collections.abc import Collection, Iterable
from typing import Any

import pytest

_Marked = type(pytest.param())


def every(stride: int, members: Iterable[Any], always: Collection[Any] = ()) -> list[Any]:
    """Return the members of a parametrization. The mark `long` excludes all but each `stride`-th
    member and the members `always` from the fast tests. The members of a parametrization with
    several arguments are tuples. Members of `pytest.param` keep their marks."""
    return [
        _long(member) if number % stride and member not in always else member
        for number, member in enumerate(members)
    ]


def _long(member: Any) -> Any:
    """Return a member of a parametrization with the mark `long`."""
    if isinstance(member, _Marked):
        return pytest.param(*member.values, marks=[*member.marks, pytest.mark.long], id=member.id)
    return pytest.param(
        *(member if isinstance(member, tuple) else (member,)), marks=pytest.mark.long
    )
