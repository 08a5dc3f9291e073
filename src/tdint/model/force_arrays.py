"""Forces on floors as the arrays that kernels read, and their histories."""

from __future__ import annotations

from itertools import accumulate

import numpy as np

from tdint.arrays import Array
from tdint.kernels import layout as rows
from tdint.model.building import force_table
from tdint.model.definition import Excitation

_TIME_ROUNDING = 1e-12
"""Fraction of a time within which a point of a table of forces is at this time."""


def load_arrays(excitation: Excitation) -> tuple[Array, Array]:
    """Return the forces on floors as the arrays `forces` and `points` of the kernels.

    The rows of harmonic forces precede the rows of tables, in the order of the floors. The points
    of a single table are not copied; several tables are joined.
    """
    harmonic = force_table(excitation.forces)
    table_forces = sorted(excitation.tables, key=lambda force: force.floor)
    tables = list(dict.fromkeys(force.table for force in table_forces))
    firsts = accumulate((table.data.size for table in tables), initial=0)
    first_of = dict(zip(tables, firsts, strict=False))
    forces = np.zeros((len(table_forces), rows.FORCE_COLUMNS))
    for row, force in zip(forces, table_forces, strict=True):
        (count, stride), first = force.table.data.shape, first_of[force.table]
        row[rows.FLOOR] = force.floor - 1
        row[rows.POINTS], row[rows.TIMES] = count, first
        row[rows.VALUES], row[rows.STRIDE] = first + 1 + force.column, stride
        row[rows.FACTOR], row[rows.DELAY] = force.factor, force.start
    shared = [rows.POINTS, rows.TIMES, rows.DELAY]
    forces[1:, rows.NEW_TIMES] = (forces[1:, shared] != forces[:-1, shared]).any(axis=1)
    forces[:1, rows.NEW_TIMES] = 1.0
    if len(tables) == 1:
        points = tables[0].data.ravel()
    else:
        points = np.concatenate([np.zeros(0), *(table.data.ravel() for table in tables)])
    return np.concatenate([harmonic, forces]), points


def add_force_history(forces: Array, points: Array, time: Array, total: Array) -> None:
    """Add the forces on floors at given times to an array, N.

    At a jump it is the force before the jump; at t = 0, the force after it. This is the force with
    which the time loop computes the accelerations of its history.

    Parameters
    ----------
    forces, points : ndarray
        Arrays of `load_arrays`.
    total : ndarray, shape (times, floors)
        The forces are added to this array.
    """
    for row in forces:
        floor, count = int(row[rows.FLOOR]), int(row[rows.POINTS])
        if not count:
            angle = row[rows.OMEGA] * time
            total[:, floor] += row[rows.COSINE] * np.cos(angle) + row[rows.SINE] * np.sin(angle)
            continue
        if row[rows.NEW_TIMES]:  # the following rows with equal times have the same points
            stride = int(row[rows.STRIDE])
            times = points[int(row[rows.TIMES]) :: stride][:count]
            at = time - row[rows.DELAY]
            # Points within the rounding of a time are at this time, after it for t = 0.
            margin = np.where(time > 0.0, -_TIME_ROUNDING * time, _TIME_ROUNDING)
            k = np.searchsorted(times, at + margin, side="right")
            inside = (k > 0) & (k < count)
            last = k[inside] - 1
            share = (at[inside] - times[last]) / (times[last + 1] - times[last])
        values = points[int(row[rows.VALUES]) :: stride]
        before = row[rows.FACTOR] * values[last]
        total[inside, floor] += before + (row[rows.FACTOR] * values[last + 1] - before) * share
