"""Forces on floors as the table that kernels read."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from tdint.kernels import layout as at
from tdint.model.definition import Force


def force_table(forces: Sequence[Force]) -> NDArray[np.float64]:
    """One row per force: floor (counted from 0), cosine and sine amplitude (N), omega (rad/s)."""
    table = np.zeros((len(forces), at.FORCE_COLUMNS))
    for row, force in zip(table, forces, strict=True):
        row[:] = force.floor - 1, force.cosine, force.sine, force.omega
    return table
