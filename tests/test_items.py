"""Groups of items, and sequences of items that are created on access."""

import pytest

from tdint.items import LazySequence, grouped


def test_groups_have_the_order_of_their_first_items():
    items = [("b", 1), ("a", 2), ("b", 3), (("a", 0.1), None)]
    assert list(grouped(iter(items)).items()) == [("b", [1, 3]), ("a", [2]), (("a", 0.1), [None])]
    assert grouped([]) == {}


def test_items_of_a_lazy_sequence_are_those_of_a_list():
    class Squares(LazySequence[int]):
        def __len__(self):
            return 5

        def make(self, number):
            return number**2

    squares, listed = Squares(), [0, 1, 4, 9, 16]
    assert list(squares) == listed
    for index in (0, -1, slice(None), slice(3, 0, -2), slice(-2, 9), slice(7, 9)):
        assert squares[index] == listed[index]
    with pytest.raises(IndexError):
        squares[5]
