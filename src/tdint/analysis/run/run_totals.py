"""What a march left in its arrays, as results."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import fields
from functools import reduce
from operator import add, sub

import numpy as np

from tdint.analysis.run.outcome import (
    ENERGY_TERMS,
    Energy,
    EnergyHistory,
    ErrorEstimate,
    ErrorHistory,
    History,
    StoryErrors,
    StoryPeaks,
    story_values,
)
from tdint.analysis.run.workspace import Workspace
from tdint.arrays import Array
from tdint.kernels import layout as at
from tdint.kernels.equations.carried.rows import error_peaks, unsettled
from tdint.model.building import Building

_ROUNDING = 1e-12
"""Error over the peak that is always there."""

_TINY = np.finfo(float).tiny

Telling = Callable[[Building, Array, Array, Array], Array]
"""Of the rows of a history, from the building, the forces on its floors (`force_table`) and the times of the rows."""


def story_peaks(building: Building, space: Workspace) -> StoryPeaks:
    """The peaks of all stories."""
    return peaks_of(building, space.peaks.copy(), space.springs[at.DRIFT, : building.stories].copy())


def peaks_of(building: Building, peaks: Array, residual_drift: Array) -> StoryPeaks:
    """The peaks of all stories from the rows of `Workspace.peaks` and the drifts at the end."""
    return StoryPeaks(height=building.heights, **story_values(building, peaks, residual_drift))


def moving_drift(building: Building, space: Workspace) -> Array:
    """Amplitudes with which the drifts move about their rest at the end of a march, about, m; shape (n,).

    At rest no story has a force. One is as far from that as the force it has takes by its initial stiffness, and moves
    with the largest displacement of the run over the largest velocity (s).
    """
    displacement, velocity = (np.max(space.peaks[row]) for row in (at.PEAK_DISPLACEMENT, at.PEAK_VELOCITY))
    seconds = displacement / velocity if velocity > 0.0 else 0.0
    drift, force = (space.springs[row, : building.stories] for row in (at.DRIFT, at.FORCE))
    away = (force + building.linear_terms[at.GEOMETRIC, :-1] * drift) / building.initial_stiffness
    return np.asarray(np.hypot(away, _of_drifts(building, space.state[at.VELOCITY]) * seconds))


def _of_drifts(building: Building, floors: Array) -> Array:
    """Rates of the drifts from those of the floors, a row of a table."""
    return np.asarray(floors[:-1] - building.linear_terms[at.LINK, :-1] * np.roll(floors, 1)[:-1])


def unresolved(building: Building, space: Workspace, late: float) -> StoryErrors:
    """How much larger the peaks may be between steps that do not resolve the motion; and by how much, about, the drifts
    have changed since the time that was asked for, which was `late` (s) before the end."""
    peaks, rest = space.peaks[: at.PEAK_ROWS], np.zeros(building.stories)
    rate, bend = (_of_drifts(building, row) for row in (space.state[at.VELOCITY], space.watch[at.ACCELERATION_NOW]))
    changed = late * np.abs(rate) + 0.5 * late**2 * np.abs(bend)
    told = story_values(building, peaks, rest)
    doubt = story_values(building, np.maximum(space.peaks[at.PEAK_ROWS :], peaks), changed)
    return StoryErrors(**{name: doubt[name] - values for name, values in told.items()})


def carried_error(building: Building, space: Workspace, stories: StoryPeaks, doubt: StoryErrors) -> ErrorEstimate:
    """What the error that a run has carried along says of its peaks, which may be in `doubt` beside that.

    An error is what the corrected peak differs by, and what steps whose iteration did not settle left to correct.
    """
    n = building.stories
    first = error_peaks(building.modal.shape[0])
    residual = space.springs[at.DRIFT, n + 1 : 2 * n + 1].copy()
    peaks = space.work[first : first + at.PEAK_ROWS, :n].copy()
    corrected = peaks_of(building, peaks, residual)
    sizes = {field.name: getattr(stories, field.name) for field in fields(StoryErrors)}
    sizes["residual_drift"] = stories.peak_drift
    left = space.work[unsettled(building.modal.shape[0]), n] / max(float(stories.peak_drift.max()), _TINY)
    errors = {
        name: np.maximum(
            np.abs(getattr(corrected, name) - getattr(stories, name)),
            np.maximum((_ROUNDING + left) * size, getattr(doubt, name)),
        )
        for name, size in sizes.items()
    }
    told = StoryErrors(**errors)
    return ErrorEstimate.of(stories, told, dts=(), corrected=corrected, left=told)


def energy_errors(totals: Array) -> Array:
    """`Energy.error` at the end of each run, from rows of `Workspace.totals`; shape (runs,)."""
    terms = dict(zip(ENERGY_TERMS, totals.T[: at.ENERGY_TERMS], strict=True))
    spent = reduce(add, [term for name, term in terms.items() if name != "input"])
    largest = totals[:, at.ENERGY_LARGEST]
    imbalance = totals[:, at.ENERGY_START] + terms["input"] - spent
    return np.asarray(np.divide(imbalance, largest, out=np.zeros_like(largest), where=largest > 0.0))


def energy_of(numbers: Array) -> Energy:
    """The energies that stand at the beginning of some numbers."""
    terms = dict(zip(ENERGY_TERMS, numbers[: at.ENERGY_TERMS].tolist(), strict=True))
    start, largest = float(numbers[at.ENERGY_START]), float(numbers[at.ENERGY_LARGEST])
    return Energy(**terms, start=start, largest=largest)


def history(building: Building, forces: Array, space: Workspace, h: float, largest: float | None = None) -> History:
    """The history of a march with steps h (s) under forces on floors (`force_table`); of a piece of it the largest
    energy of the whole must be told."""
    n = building.stories
    table = space.history
    behind = 1 + at.HISTORY_FIELDS * n
    time = h * (space.every * np.arange(space.before, space.before + len(table), dtype=np.float64))
    return History(
        time=time,
        ground_acceleration=table[:, 0],
        energy=_energy_history(table[:, behind : behind + at.ENERGY_TERMS], space.totals, largest),
        error=_error_history(table[:, behind + at.ENERGY_TERMS :], n),
        **{name: told(building, forces, time, table) for name, told in HISTORIES.items()},
    )


def _field(place: int) -> Telling:
    """What rows of a history hold themselves."""
    return lambda building, forces, time, table: table[
        :, 1 + place * building.stories : 1 + (place + 1) * building.stories
    ]


def _over_story(place: int) -> Telling:
    """What of such a field lies between the floors above and below a story."""

    def told(building: Building, forces: Array, time: Array, table: Array) -> Array:
        floors = _field(place)(building, forces, time, table)
        found = floors.copy()
        found[:, 1:] -= floors[:, :-1]
        return found

    return told


def _error_history(table: Array, n: int) -> ErrorHistory | None:
    if not table.size:
        return None
    displacement, velocity, shear = (table[:, j * n : (j + 1) * n] for j in range(at.ERROR_FIELDS))
    drift = displacement.copy()
    drift[:, 1:] -= displacement[:, :-1]
    return ErrorHistory(displacement, velocity, drift, shear)


def _total_shear(building: Building, forces: Array, time: Array, table: Array) -> Array:
    """What moves the floors above each story: forces on them less masses times absolute accelerations."""
    moved = -building.linear_terms[at.MASS, :-1] * _ACCELERATION(building, forces, time, table)
    for force in forces:
        angle = force[at.OMEGA] * time
        moved[:, int(force[at.FLOOR])] += force[at.COSINE] * np.cos(angle) + force[at.SINE] * np.sin(angle)
    return np.asarray(np.cumsum(moved[:, ::-1], axis=1)[:, ::-1])


def _energy_history(table: Array, totals: Array, largest: float | None) -> EnergyHistory:
    terms = list(table.T)
    start, largest = totals[at.ENERGY_START], totals[at.ENERGY_LARGEST] if largest is None else largest
    imbalance = reduce(sub, terms[1:], start + terms[0])
    error = imbalance / largest if largest > 0.0 else np.zeros_like(imbalance)
    return EnergyHistory(**dict(zip(ENERGY_TERMS, terms, strict=True)), error=error)


_ACCELERATION = _field(2)
_DRIFT_RATE = _over_story(1)

HISTORIES: dict[str, Telling] = {
    "displacement": _field(0),
    "velocity": _field(1),
    "acceleration": _ACCELERATION,
    "drift": _over_story(0),
    "shear": _field(3),
    "damper_force": lambda building, *told: building.device_force(_DRIFT_RATE(building, *told)),
    "total_shear": _total_shear,
}
"""What gives each field of `History` that stories and floors have, shape (rows, n)."""
