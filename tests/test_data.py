"""Classes of data are those of `dataclasses`, by which each is made a second time."""

import copy
import dataclasses
import inspect
import pickle
from functools import cached_property

import pytest

from tdint.data import dataclass


def classes(make):
    """A class with everything that ours have, and one that inherits from it."""

    @make(frozen=True)
    class Base:
        """Words."""

        number: float
        names: tuple[str, ...] = ()
        table: dict = dataclasses.field(default_factory=dict, compare=False)
        made: list = dataclasses.field(default_factory=list, init=False, repr=False, compare=False)

        def __post_init__(self):
            self.made.append(self.number)

        @cached_property
        def twice(self):
            return 2.0 * self.number

    @make(frozen=True, kw_only=True)
    class Child(Base):
        """Words."""

        unit: str = "m"
        hidden: int = dataclasses.field(default=3, compare=False)

    @make
    class Open:
        """Words."""

        value: int
        other: int = 2

    return Base, Child, Open


OURS, THEIRS = classes(dataclass), classes(dataclasses.dataclass)


@pytest.mark.parametrize("ours, theirs", list(zip(OURS, THEIRS, strict=True)))
def test_fields_signature_and_text_are_those_of_dataclasses(ours, theirs):
    assert str(inspect.signature(ours)) == str(inspect.signature(theirs))
    assert [field.name for field in dataclasses.fields(ours)] == [
        field.name for field in dataclasses.fields(theirs)
    ]
    assert ours.__match_args__ == theirs.__match_args__
    assert repr(ours(1)) == repr(theirs(1)) and dataclasses.asdict(ours(1)) == dataclasses.asdict(
        theirs(1)
    )
    assert ours.__init__.__qualname__ == theirs.__init__.__qualname__
    assert ours.__init__.__module__ == ours.__module__


def test_equal_ones_are_equal_and_others_not():
    base, child, plain = OURS
    assert base(1.0, ("a",), {1: 2}) == base(1.0, ("a",)) != base(2.0, ("a",))
    assert (
        hash(child(1.0, unit="s"))
        == hash(child(1.0, unit="s", hidden=4))
        != hash(child(1.0, unit="m"))
    )
    assert child(1.0) != base(1.0) and plain(1) == plain(1, 2) and plain.__hash__ is None
    assert dataclasses.replace(child(1.0, unit="s"), number=2.0) == child(2.0, unit="s")


def test_a_frozen_one_stays_as_it_is():
    base, _, plain = OURS
    record = base(1.0)
    with pytest.raises(dataclasses.FrozenInstanceError):
        record.number = 2.0
    with pytest.raises(dataclasses.FrozenInstanceError):
        del record.number
    assert record.twice == 2.0 and record.made == [1.0] and copy.copy(record) == record
    changed = plain(1)
    changed.value = 5
    assert changed == plain(5)


def test_what_is_missing_or_too_much_is_refused_in_the_same_words():
    for arguments, named in (((), {}), ((1, 2, 3, 4, 5), {}), ((1,), {"color": 2})):
        said = []
        for cls in (OURS[0], THEIRS[0]):
            with pytest.raises(TypeError) as refused:
                cls(*arguments, **named)
            said.append(str(refused.value))
        assert said[0] == said[1]


@dataclass(frozen=True)
class Kept:
    """For pickle, which looks classes up by name."""

    number: float


def test_it_is_pickled():
    assert pickle.loads(pickle.dumps(Kept(1.5))) == Kept(1.5)
