"""Load case: forces on floors from a table that replace a ground motion."""

from __future__ import annotations

import hashlib
import math
from dataclasses import replace

import numpy as np

from tdint.arrays import immutable
from tdint.ground_motion.record import Input, Record
from tdint.model.definition import Model, TableForce


@immutable
class LoadCase(Record):
    """Forces on floors, which an analysis applies with the ground at rest.

    The attributes of `Record` describe the ground at rest, so that a load case is stored, sent and
    scaled as a ground motion is: `scale` is the factor on the forces.

    Attributes
    ----------
    loads : tuple of TableForce
        Forces from the columns of a table. The floor 0 is the roof of each building.
    """

    loads: tuple[TableForce, ...] = ()

    @classmethod
    def of(cls, loads: tuple[TableForce, ...]) -> LoadCase:
        """Return the load case of forces from the columns of one file."""
        table = loads[0].table
        # Two samples are the minimum of a record; they are zero, and their interval is not used.
        interval = float(table.times[-1] - table.times[0]) or 1.0
        inputs = (Input(table.source, table.sha256),)
        return cls(np.zeros(2), interval, "", "", "", table.source, inputs=inputs, loads=loads)

    @property
    def pga(self) -> float:
        """NaN: there is no ground motion."""
        return math.nan

    @property
    def digest(self) -> str:
        """Hexadecimal SHA-256 checksum of the forces: their tables, floors, columns, factors and
        start times."""
        parts = [
            (load.floor, load.table.digest, load.column, load.factor, load.start)
            for load in self.loads
        ]
        return hashlib.sha256(repr((parts, self.scale)).encode()).hexdigest()

    def scaled(self, factor: float) -> LoadCase:
        """Return the load case with its forces multiplied by `factor`, which may be negative.

        Returns
        -------
        LoadCase
            Its attribute `scale` is the product of all factors.
        """
        return replace(self, scale=self.scale * factor)

    def on(self, model: Model) -> Model:
        """Return a model under the load case, which replaces the tables of forces of the model (as
        a ground motion replaces its record); harmonic forces are kept."""
        tables = tuple(
            load._replace(
                floor=load.floor or len(model.stories),
                factor=load.factor * self.scale,
            )
            for load in self.loads
        )
        return replace(model, excitation=replace(model.excitation, record=None, tables=tables))
