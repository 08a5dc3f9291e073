"""Time step and notes of runs with forces from tables."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from pathlib import Path

import numpy as np

from tdint.items import grouped
from tdint.model.definition import Model, TableForce
from tdint.number_parsing import pluralize

_STEPS_PER_PERIOD = 50
"""Number of time steps in the first period, if no record determines the time step. With 50 steps,
errors of `impulse4` in the first mode are of the order 1e-5."""

_MAX_STEPS_PER_PERIOD = 1000
"""Number of time steps in the first period above which shorter intervals of tables do not shorten
the time step. A shorter pulse acts by its impulse and first moment, which the step contains."""

_ROUNDING = 1e-9
"""Fraction of a time or of the largest force that is regarded as rounding."""


def default_step(tables: Sequence[TableForce], period: float) -> tuple[float, str]:
    """Return the time step of a run without a record (s), and the note that describes it.

    It is a fiftieth of the first period, or the shortest interval of the tables if that is shorter.
    """
    step = period / _STEPS_PER_PERIOD
    intervals = np.concatenate([np.diff(force.table.times) for force in tables])
    shortest = float(np.min(intervals[intervals > 0.0], initial=step))
    least = period / _MAX_STEPS_PER_PERIOD
    if shortest < least:
        return least, (
            f"the time step is {least:.6g} s, a thousandth of the first period; the forces have "
            f"intervals of {shortest:.3g} s, whose impulse and first moment act on the building"
        )
    if shortest < step:
        return shortest, f"the time step is {shortest:.6g} s, the shortest interval of the forces"
    return step, f"the time step is {step:.6g} s, a fiftieth of the first period"


def table_notes(model: Model, end: float) -> list[str]:
    """Return the notes on tables of a model that end with a force, or after the end of the run.

    Parameters
    ----------
    end : float
        End of the run, s.
    """
    notes = []
    groups = grouped(((force.table, force.start), force) for force in model.excitation.tables)
    for members in groups.values():
        first, last = float(members[0].times[0]), float(members[0].times[-1])
        floors = sorted({force.floor for force in members if _ends_with_force(force)})
        # The name of a table for messages
        place = f"points on floor {model.end_name(members[0].floor)}"
        name = Path(members[0].table.source).name or place
        if floors and last < end * (1.0 - _ROUNDING):
            listed = (
                f"floor{'s' if len(floors) > 1 else ''} {', '.join(map(model.end_name, floors))}"
            )
            if len(floors) > 5:
                listed = pluralize(len(floors), "floor")
            notes.append(
                f"{name}: the last force on {listed}, at {last:.6g} s, is not zero; the force is "
                "zero after this time"
            )
        if first < -_ROUNDING * last:
            notes.append(f"{name}: the forces start at {first:.6g} s; the part before 0 s is cut")
        if last > end * (1.0 + _ROUNDING):
            notes.append(f"{name}: the forces end at {last:.6g} s, after the run ({end:.6g} s)")
    return notes


def _ends_with_force(force: TableForce) -> bool:
    """Return True if the last value is not zero."""
    values = np.abs(force.values)
    return bool(values[-1] > _ROUNDING * np.max(values))


def missing_times(model: Model, given: Collection[str] = ()) -> tuple[str, ...]:
    """Return a sentence about the time step and the duration that a run of a model without a record
    requires and the file does not contain; empty if both are given.

    `given` contains `dt` and `duration` if a campaign specifies them.
    """
    # Tables of forces have a default time step.
    missing = {
        "dt": model.analysis.dt is None and not model.excitation.tables,
        "duration": model.analysis.duration is None,
    }
    names = [name for name, is_missing in missing.items() if is_missing and name not in given]
    if not names:
        return ()
    options, keys = (
        " and ".join(prefix + name for name in names) for prefix in ("--", "analysis.")
    )
    return (f"without a record, `tdint run` requires {options}, or {keys} in the model file",)
