"""A root's bracket narrowed by false position with halved weights: the Illinois method (Dowell and Jarratt 1971)."""

from __future__ import annotations

from tdint.kernels.compiling import inlined


@inlined
def narrowed(left, at_left, right, at_right, side, t, value):
    """The bracket after a look at t, with its values; the value of an end that stays twice in a row is halved.

    `side` is 1 if the right end was moved last, -1 for the left one, 0 at first; returned with the bracket, as is the
    distance by which an end was moved. `value` is not zero.
    """
    if (value > 0.0) == (at_right > 0.0):
        moved = right - t
        if side > 0:
            at_left *= 0.5
        return left, at_left, t, value, 1, moved
    moved = t - left
    if side < 0:
        at_right *= 0.5
    return t, value, right, at_right, -1, moved
