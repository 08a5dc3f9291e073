"""Derivatives of a run's peaks by numbers of its building and by the scale of its record:
differences of neighbors.

Every method and law has them. They are derivatives of what is computed: where a peak passes from
one time or side to another, or a story just yields, that has a kink, and the one-sided differences
part.
"""

from __future__ import annotations

import math

import numpy as np

from tdint.arrays import Array
from tdint.errors import UsageError
from tdint.model.definition import (
    DASHPOT,
    Model,
    changes_of,
    check_parameter,
    check_value,
    story_numbers,
)

SCALE = "record.scale"
"""What of `vary` is not the building's: a factor on the ground motion."""

SIZE = 1e-4
"""Of a neighbor's distance, over the number. Of 13 771 pairs in 75 random buildings 95 % are within
4e-6 of differences ten times smaller, .2 % beyond 1 % of the story's largest derivative; ten times
larger ones 4e-4 and .7 %."""


def slopes(base: Array, near: Array, offsets: Array) -> tuple[Array, Array]:
    """Derivatives at 0 of the parabolas through values there and at two offsets, and half of what
    the two one-sided differences part by.

    Parameters
    ----------
    base : ndarray, shape (runs, ...)
        Values at 0.
    near : ndarray, shape (runs, parameters, 2, ...)
        Values at the offsets.
    offsets : ndarray, shape (runs, parameters, 2)
    """
    one, other = np.moveaxis(offsets.reshape(offsets.shape + (1,) * (near.ndim - 3)), 2, 0)
    to_one, to_other = (
        (near[:, :, side] - base[:, None]) / at for side, at in ((0, one), (1, other))
    )
    return (to_one * other - to_other * one) / (other - one), 0.5 * np.abs(to_other - to_one)


def number_at(model: Model, name: str) -> float:
    """The number of a model that a parameter sets; 1 of factors.

    Raises
    ------
    UsageError
        There is none, or several stories or modes have others: no number is the one at which to
        differentiate.
    """
    if name == SCALE:
        return 1.0
    check_parameter(name)
    if name == "damping":
        numbers = set(getattr(model.damping, "ratios", ()))
        if not numbers:
            raise UsageError(
                f"gradient: damping has no ratio to vary: {model.name} has none, or coefficients"
            )
    else:
        numbers = {
            1.0 if change.factor else story_numbers(model.stories[change.story])[change.column]
            for change in changes_of(model, name)
        }
    if len(numbers) > 1:
        told = ", ".join(f"{number:.6g}" for number in sorted(numbers))
        hint = "" if name == "damping" else "; take one story, stories[1]..., or a factor"
        raise UsageError(
            f"gradient: {name} is {told} in {model.name}: no one number to change{hint}"
        )
    return float(numbers.pop())


def neighbors(model: Model, name: str, value: float) -> tuple[float, float]:
    """Two numbers near one: on both sides, or on one where the other is out of range.

    Raises
    ------
    UsageError
        It is 0, and nothing tells what is near.
    """
    size = SIZE * abs(value)
    changes = [] if name == SCALE else changes_of(model, name)
    if not size:
        # Of a ratio 1 is the measure, of a dashpot that of the story's own motion.
        bounds, story = (
            changes[0].bounds if changes else None,
            model.stories[changes[0].story if changes else 0],
        )
        if changes and changes[0].column == DASHPOT:
            size = SIZE * math.sqrt(story.stiffness * story.mass)
        elif name == "damping" or (bounds and not bounds.force and not bounds.length):
            size = SIZE
        else:
            raise UsageError(
                f"gradient: {name} is 0, and nothing tells what is near it; take another number"
            )

    def allowed(number: float) -> bool:
        try:
            check_value(name, number)
            for change in changes:
                change.check(name, number)
        except UsageError:
            return False
        return True

    for one, other in ((-size, size), (size, 2.0 * size), (-size, -2.0 * size)):
        if allowed(value + one) and allowed(value + other):
            return value + one, value + other
    raise UsageError(f"gradient: {name} {value:.6g} has no room on either side")
