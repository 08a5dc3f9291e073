"""Selection of the members of a parametrization that run in the fast tests."""

from collections.abc import Collection, Iterable, Sequence
from typing import Any

import pytest

_Marked = type(pytest.param())

FAST = "not slow and not long"
"""Expression of the marks of the fast tests, which `pyproject.toml` selects."""

_only_fast = False


def select_fast(config: pytest.Config) -> None:
    """Let `every` omit the long members, and `is_omitted` the slow and long tests, if only the fast
    tests are selected, and no test by its name: a fifth of the time of the collection."""
    global _only_fast
    _only_fast = config.getoption("markexpr") == FAST and not any("::" in a for a in config.args)


def is_omitted(*objects: Any) -> bool:
    """Return True if a function, its class or its module has the mark `slow` or `long`, and only
    the fast tests are selected."""
    marks = (getattr(item, "pytestmark", ()) for item in objects)
    listed = (mark if isinstance(mark, list | tuple) else [mark] for mark in marks)
    return _only_fast and any(mark.name in ("slow", "long") for marks in listed for mark in marks)


def every(
    stride: int, members: Iterable[Any], always: Collection[Any] = (), ids: Sequence[str] = ()
) -> list[Any]:
    """Return the members of a parametrization. The mark `long` excludes all but each `stride`-th
    member and the members `always` from the fast tests. The members of a parametrization with
    several arguments are tuples. Members of `pytest.param` keep their marks. `ids` are the names of
    all members."""
    fast, result = [], []
    for number, member in enumerate(members):
        named = _named(member, ids[number]) if ids else member
        if number % stride == 0 or member in always:
            fast.append(named)
            result.append(named)
        else:
            result.append(_long(named))
    return fast if _only_fast else result


def _named(member: Any, name: str) -> Any:
    """Return a member of a parametrization with a name."""
    return pytest.param(*(member if isinstance(member, tuple) else (member,)), id=name)


def _long(member: Any) -> Any:
    """Return a member of a parametrization with the mark `long`."""
    if isinstance(member, _Marked):
        return pytest.param(*member.values, marks=[*member.marks, pytest.mark.long], id=member.id)
    return pytest.param(
        *(member if isinstance(member, tuple) else (member,)), marks=pytest.mark.long
    )
