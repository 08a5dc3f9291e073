"""Selection of the members of a parametrization that run in the fast tests."""

from collections.abc import Collection, Iterable
from typing import Any

import pytest


def every(stride: int, members: Iterable[Any], always: Collection[Any] = ()) -> list[Any]:
    """Return the members of a parametrization. The mark `long` excludes all but each `stride`-th
    member and the members `always` from the fast tests. The members of a parametrization with
    several arguments are tuples."""
    return [
        pytest.param(*(member if isinstance(member, tuple) else (member,)), marks=pytest.mark.long)
        if number % stride and member not in always
        else member
        for number, member in enumerate(members)
    ]
