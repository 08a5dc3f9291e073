"""Springs between any two floors: their start and end in the tables of the kernels, and their
matrices.

A spring is a story, an attachment (a mass with its spring on a floor) or a link. Each spring has a
column of the tables. The columns of stories and attachments are also the columns of their upper
floors; links have columns without a mass after them (`tdint.kernels.linear_terms`).

The matrices of a step are factorized from the last floor to the first. The elimination of a floor
with several lower floors creates an entry for each pair of these floors (fill-in). If no spring
connects such a pair, it receives a link without stiffness, and the column of the link stores the
entry.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import combinations
from typing import TYPE_CHECKING

import numpy as np

from tdint.arrays import Array
from tdint.kernels import layout as rows
from tdint.model.story import Story
from tdint.model.story_laws import LINEAR

if TYPE_CHECKING:
    from tdint.model.definition import Model

GROUND = -1
"""Lower end of a spring on the ground."""

Ends = tuple[int, int]
"""Columns of the upper floor and of the lower floor of a spring, or GROUND."""

NO_SPRING = Story(mass=0.0, height=None, stiffness=0.0, law=LINEAR, dashpot=0.0)
"""Link that only stores an entry of the matrices."""


def springs_of(model: Model) -> tuple[tuple[Story, ...], list[Ends]]:
    """Return the springs of a model in the order of their columns, with their start and end."""
    stories = model.stories
    ends = [(i, i - 1) for i in range(len(stories))]  # the first story is on the ground: -1
    ends += [(i, item.floor - 1) for i, item in enumerate(model.attachments, start=len(stories))]
    floors = len(ends)
    # Floors of the model file count from 1, the ground is 0.
    ends += [(max(item.ends) - 1, min(item.ends) - 1) for item in model.links]
    springs = (*stories, *(item.spring for item in model.devices))
    if model.links:
        filled = _fill_in(ends, floors)
        springs += (NO_SPRING,) * len(filled)
        ends += filled
    return springs, ends


def _fill_in(ends: Sequence[Ends], floors: int) -> list[Ends]:
    """Return the pairs of floors that the elimination connects and that no spring connects."""
    lower_floors: list[set[int]] = [set() for _ in range(floors)]
    for upper, lower in ends:
        if lower != GROUND:
            lower_floors[upper].add(lower)
    filled = []
    for floor in range(floors - 1, 0, -1):
        for first, second in combinations(sorted(lower_floors[floor]), 2):
            if first not in lower_floors[second]:
                lower_floors[second].add(first)
                filled.append((second, first))
    return filled


def store_ends(linear_terms: Array, ends: Sequence[Ends]) -> None:
    """Store the ends of all springs in the table of linear terms, with the lists of the springs at
    each floor and of the matrix entries of each floor."""
    count = len(ends)
    is_chain = all(end == (i, i - 1) for i, end in enumerate(ends))
    linear_terms[rows.UPPER_FLOOR, count] = 0.0 if is_chain else 1.0
    columns: dict[Ends, int] = {}
    # The list of a floor starts in the column of the floor, also if its spring is on the ground.
    last_entry = {upper: upper for upper, _ in ends}
    for i, (upper, lower) in enumerate(ends):
        is_on_floor = lower != GROUND
        linear_terms[rows.LINK, i] = float(is_on_floor)
        linear_terms[rows.UPPER_FLOOR, i] = upper
        linear_terms[rows.BASE, i] = lower if is_on_floor else i
        linear_terms[rows.ENTRY, i] = i
        if is_on_floor:
            linear_terms[rows.ENTRY, i] = columns.setdefault((upper, lower), i)
            if columns[upper, lower] == i != upper:
                linear_terms[rows.NEXT_ENTRY, last_entry[upper]] = i
                last_entry[upper] = i
    # From the last column down, so that each list is in the order of the columns.
    for i in range(len(ends) - 1, 0, -1):
        upper, lower = ends[i]
        if lower != GROUND:
            linear_terms[rows.NEXT_ON, i] = linear_terms[rows.FIRST_ON, lower]
            linear_terms[rows.FIRST_ON, lower] = i
        if upper != i:
            linear_terms[rows.NEXT_TIED, i] = linear_terms[rows.FIRST_TIED, upper]
            linear_terms[rows.FIRST_TIED, upper] = i


def extended(
    linear_terms: Array, floor_values: Sequence[float], attachment_values: Sequence[float]
) -> Array:
    """Return the initial displacements or velocities of all columns: attachments without a value
    (nan) start with the motion of their floors."""
    values = np.zeros(linear_terms.shape[1] - 1)
    given = (*floor_values, *attachment_values)
    values[: len(given)] = given
    for i in range(len(floor_values), len(values)):
        if i >= len(given) or math.isnan(values[i]):
            upper, lower = linear_terms[[rows.UPPER_FLOOR, rows.BASE], i].astype(int).tolist()
            # The lower end of an attachment on the ground is the attachment itself.
            values[i] = values[upper] if upper != i else values[lower] if lower != i else 0.0
    return values


def incidence(linear_terms: Array, floors: int) -> Array:
    """Return the matrix of deformations, shape (springs, floors): the deformations of all springs
    are the product with the displacements of the floors, attachments included."""
    count = linear_terms.shape[1] - 1
    springs = np.arange(count)
    matrix = np.zeros((count, floors))
    matrix[springs, linear_terms[rows.UPPER_FLOOR, :count].astype(int)] = 1.0
    lower = springs[linear_terms[rows.LINK, :count] != 0.0]
    matrix[lower, linear_terms[rows.BASE, lower].astype(int)] -= 1.0
    return matrix
