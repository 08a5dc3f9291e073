"""Results of a time integration, computed from the arrays of the time loops."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import reduce
from operator import add, sub
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from tdint.arrays import Array
from tdint.kernels import layout as rows
from tdint.methods.workspace import BASE_ROTATION, MOMENT, TOTAL_BASE_MOMENT, Workspace
from tdint.model.building import Building
from tdint.model.force_arrays import add_force_history
from tdint.model.story import column_name
from tdint.response.runs.outcome import (
    ENERGY_TERMS,
    STORY_QUANTITIES,
    DeviceHistory,
    DevicePeaks,
    Energy,
    EnergyHistory,
    FlexurePeaks,
    History,
    StoryErrors,
    StoryPeaks,
    each_array,
    story_values,
)
from tdint.response.runs.prepared import device_energy

Loads = tuple[Array, Array]
"""Forces on floors and points of their tables (`load_arrays`)."""

ValuesT = TypeVar("ValuesT", StoryPeaks, StoryErrors)

FieldFunction = Callable[[Building, Loads, Array, Array], Array]
"""Function that computes one quantity of the response history for all floors or stories.

Its arguments are the building, the forces on its floors, the times of the rows of the history table
(s), and the history table. It returns an array, shape (rows, n).
"""


def story_peaks(building: Building, space: Workspace) -> StoryPeaks:
    """Return the peaks of all stories at the end of a time integration; the present drifts are the
    residual drifts. The arrays are copies."""
    return columns(all_peaks(building, space), slice(building.floors))


def all_peaks(building: Building, space: Workspace) -> StoryPeaks:
    """Return the peaks of stories, attachments and links at the end of a time integration."""
    drift = space.law_state[rows.DRIFT, : building.stories].copy()
    return named_peaks(building, space.peaks.copy(), drift)


def columns(values: ValuesT, part: slice) -> ValuesT:
    """Return the values of a part of the columns: of the stories, or of attachments and links."""
    selected: ValuesT = each_array(lambda array: array[..., part], values)
    return selected


def device_peaks(building: Building, space: Workspace, late: float) -> DevicePeaks | None:
    """Return the peaks of attachments and links at the end of a run and the bounds of
    `interstep_peak_errors`; None without them."""
    if not building.branched:
        return None
    peaks = device_columns(building, all_peaks(building, space))
    bounds = interstep_peak_errors(building, space, late, building.device_columns)
    return DevicePeaks(peaks, device_energy(building, space), bounds)


def device_columns(building: Building, peaks: StoryPeaks) -> StoryPeaks:
    """Return the peaks of attachments and links; the residual deformations of links have the sign
    of their ends in the model."""
    devices = columns(peaks, building.device_columns)
    return replace(devices, residual_drift=devices.residual_drift * _signs(building))


def _signs(building: Building) -> Array:
    """Return the signs of the deformations of attachments and links: -1 for a link whose end is
    below its start, otherwise 1."""
    return np.array([*(1.0 for _ in building.attachments), *(x.sign for x in building.links)])


def flexure_peaks(building: Building, space: Workspace) -> FlexurePeaks | None:
    """Return the peaks of flexural stories at the end of a run; None for other buildings."""
    if building.system is None or building.system.flexure is None:
        return None
    peaks = space.observer_state
    stories = peaks[MOMENT:BASE_ROTATION, : building.stories].copy()
    return FlexurePeaks(*stories, *peaks[BASE_ROTATION : TOTAL_BASE_MOMENT + 1, 0].tolist())


def named_peaks(building: Building, peaks: Array, residual_drift: Array) -> StoryPeaks:
    """Convert the peaks and final drifts of a time integration to a `StoryPeaks` object.

    Parameters
    ----------
    peaks : ndarray, shape (2 PEAK_ROWS, n) or (runs, 2 PEAK_ROWS, n)
        Peaks in the rows of `Workspace.peaks`.

    Returns
    -------
    StoryPeaks
        Arrays of shape (n,) or (runs, n) with a single attribute for each quantity, in SI units:
        first the stories, then attachments and links.
    """
    values = story_values(building, peaks, residual_drift)
    return StoryPeaks(height=building.heights, **values)


def residual_oscillation(
    building: Building, space: Workspace, inverse_omega: float | None = None
) -> Array:
    """Return approximate amplitudes of the drifts about their positions of rest at the end of a
    run, m.

    As in a free vibration, the amplitude is sqrt(d^2 + (v / omega)^2), with the distance d from the
    position of rest and the drift rate v. At rest, no story has a force, so d is the force of the
    story divided by its present stiffness. 1 / omega is `inverse_omega` (s; by default the maximum
    displacement divided by the maximum velocity of the run), times the square root of the ratio of
    initial to present stiffness.
    """
    distance, present_stiffness = building.rest_distance(space.law_state)
    rate = _drift_rates(building, space.state[rows.VELOCITY])
    if inverse_omega is None:
        displacement, velocity = (
            float(space.peaks[row].max()) for row in (rows.PEAK_DISPLACEMENT, rows.PEAK_VELOCITY)
        )
        inverse_omega = displacement / velocity if velocity > 0.0 else 0.0
    softening = np.sqrt(
        np.divide(
            building.initial_stiffness,
            present_stiffness,
            out=np.ones_like(present_stiffness),
            where=present_stiffness != 0.0,
        )
    )
    return np.asarray(np.hypot(distance, rate * inverse_omega * softening))


def possible_growth(
    building: Building, space: Workspace, period: float, *, is_at_rest: bool
) -> float:
    """Return by how much a peak drift may grow after the end of a run, relative to the peak, for
    the story where this is largest.

    The drift of a story in free vibration is at most its distance from zero without a force plus
    its amplitude (`residual_oscillation`) with the first period of the building (s). If the ground
    moves at the end (`is_at_rest` is False), only stories count with a drift that is the peak and
    increases.
    """
    drift, peak = space.law_state[rows.DRIFT, : building.stories], space.peaks[rows.PEAK_DRIFT]
    reach = np.abs(drift - building.rest_distance(space.law_state)[0])
    inverse_omega = period / (2.0 * np.pi) if np.isfinite(period) else None
    reach = reach + residual_oscillation(building, space, inverse_omega)
    counts = peak > 0.0
    if not is_at_rest:
        rate = _drift_rates(building, space.state[rows.VELOCITY])
        counts &= (np.abs(drift) >= peak) & (drift * rate > 0.0)
    return float(np.max(reach[counts] / peak[counts] - 1.0, initial=0.0))


def with_growth(errors: StoryErrors, stories: StoryPeaks, growth: float) -> StoryErrors:
    """Return errors of peaks that may grow after the end of a run, relative to the peak; residual
    drifts are unchanged."""
    values = {
        name: np.maximum(value, growth * getattr(stories, name))
        for name, value in vars(errors).items()
        if name != "residual_drift"
    }
    return StoryErrors(**values, residual_drift=errors.residual_drift)


def _drift_rates(building: Building, floors: Array) -> Array:
    """Subtract from the velocity or acceleration of each floor that of the floor below.

    The last entry of `floors` is the ground; the result has one entry less.
    """
    if building.system is not None:
        return np.asarray(building.deformations @ floors[:-1])
    link = building.linear_terms[rows.LINK, :-1]
    return np.asarray(floors[:-1] - link * floors[_base(building)])


def _base(building: Building) -> NDArray[np.intp]:
    """Return the columns of the lower floors of all springs; any column for the ground."""
    if building.branched:
        return building.linear_terms[rows.BASE, :-1].astype(np.intp)
    return np.arange(building.stories) - 1


def interstep_peak_errors(
    building: Building, space: Workspace, late: float, part: slice
) -> StoryErrors:
    """Return bounds of the errors that arise because peaks are read at time steps only: the
    possible excess of each peak, and the approximate change of each residual drift.

    If the time step does not resolve the highest modes, peaks between time steps may exceed the
    peaks at time steps. Residual drifts are read at the end of the last time step, `late` s after
    the requested end; their error is the change of the drifts in this interval. The result contains
    the columns `part` of the stories, attachments and links.
    """
    drift_change = np.zeros(building.stories)
    if late > 0.0:
        velocity, acceleration = (
            np.abs(_drift_rates(building, row))
            for row in (
                space.state[rows.VELOCITY],
                space.observer_state[rows.OBSERVED_ACCELERATION],
            )
        )
        # Taylor series of second order, with absolute values of its terms.
        drift_change = late * velocity + 0.5 * late**2 * acceleration
    reported = vars(all_peaks(building, space))
    peaks_between_steps = space.peaks[rows.PEAK_ROWS :]
    # If the time steps resolve the motion, all peaks between them are stored as 0. The bounds are
    # then the reported peaks, and the possible excess is 0.
    bounds = reported
    if peaks_between_steps.any():
        peaks_at_steps = space.peaks[: rows.PEAK_ROWS]
        largest_peaks = np.maximum(peaks_between_steps, peaks_at_steps)
        bounds = story_values(building, largest_peaks, drift_change)
    # The difference is nan for quantities that do not exist, such as ratios without a height.
    differences = {
        quantity.name: bounds[quantity.name] - reported[quantity.name]
        for quantity in STORY_QUANTITIES
    }
    return columns(StoryErrors(**{**differences, "residual_drift": drift_change}), part)


def energy_errors(totals: Array) -> Array:
    """Return the energy imbalance of each run relative to its reference energy (`Energy.error`),
    shape (runs,).

    The imbalance is initial and input energy minus all other terms; it is positive if the method
    dissipates energy. The result is 0 without a reference energy. `totals` has shape (runs,
    TOTALS_SIZE).
    """
    terms = dict(zip(ENERGY_TERMS, totals.T[: rows.ENERGY_TERMS], strict=True))
    stored_or_dissipated = reduce(add, [term for name, term in terms.items() if name != "input"])
    reference = totals[:, rows.ENERGY_REFERENCE]
    imbalance = totals[:, rows.ENERGY_INITIAL] + terms["input"] - stored_or_dissipated
    return np.asarray(
        np.divide(imbalance, reference, out=np.zeros_like(reference), where=reference > 0.0)
    )


def named_energies(totals: Array) -> Energy:
    """Convert the energies at the end of one run, the first entries of `Workspace.totals`, to an
    `Energy` object."""
    terms = dict(zip(ENERGY_TERMS, totals[: rows.ENERGY_TERMS].tolist(), strict=True))
    initial, reference = totals[rows.ENERGY_INITIAL], totals[rows.ENERGY_REFERENCE]
    return Energy(**terms, initial=float(initial), reference=float(reference))


def named_history(
    building: Building,
    loads: Loads,
    space: Workspace,
    h: float,
    max_input_energy: float | None = None,
) -> History:
    """Return the response history that a time integration stored in its workspace: the complete
    run, or a chunk of the run.

    Parameters
    ----------
    max_input_energy : float, optional
        Reference energy of the complete run, J, for the imbalance at each time. The default is the
        reference energy that the workspace contains. If the workspace contains a chunk, this is the
        maximum up to the end of the chunk, so the argument must be specified.
    """
    n = building.stories
    table = space.history
    # The table of a chunk of the run continues after `rows_before` rows of earlier chunks.
    time = h * (
        space.steps_per_row
        * np.arange(space.rows_before, space.rows_before + len(table), dtype=np.float64)
    )
    # The first energy is the input energy; the imbalance is the part of the input and the initial
    # energy that no other term contains.
    first_energy = 1 + (rows.HISTORY_FIELDS + building.braced) * n
    terms = list(table[:, first_energy : first_energy + rows.ENERGY_TERMS].T)
    initial = space.totals[rows.ENERGY_INITIAL]
    if max_input_energy is None:
        max_input_energy = space.totals[rows.ENERGY_REFERENCE]
    imbalance = reduce(sub, terms[1:], initial + terms[0])
    # The reference energy is 0 only for a building that remains at rest.
    has_energy = max_input_energy > 0.0
    relative = imbalance / max_input_energy if has_energy else np.zeros_like(imbalance)
    has_elements = building.elements > 0
    part = slice(building.floors)
    series = {name: compute(building, loads, time, table) for name, compute in HISTORIES.items()}
    first_element = first_energy + rows.ENERGY_TERMS
    return History(
        time=time,
        ground_acceleration=table[:, 0],
        energy=EnergyHistory(**dict(zip(ENERGY_TERMS, terms, strict=True)), error=relative),
        element_force=table[:, first_element:] if has_elements else None,
        element_labels=building.element_labels,
        devices=_device_history(building, series) if building.branched else None,
        rows=building.system.names if building.system is not None else (),
        **{name: values[:, part] for name, values in series.items()},  # type: ignore[arg-type]
    )


def _device_history(building: Building, series: dict[str, Array]) -> DeviceHistory:
    """Return the histories of attachments and links; the deformations of links have the sign of
    their ends in the model."""
    part, signs = building.device_columns, _signs(building)
    signed = ("drift", "shear", "damper_force")
    return DeviceHistory(
        attachments=tuple(column_name(item.name) for item in building.attachments),
        links=tuple(column_name(item.name) for item in building.links),
        **{
            name: series[name][:, part] * (signs if name in signed else 1.0)
            for name in ("displacement", "velocity", "acceleration", *signed)
        },
    )


# Positions of the fields in a row of the history table, in units of n columns, after the first
# column with the ground acceleration.
_DISPLACEMENT_FIELD, _VELOCITY_FIELD, _ACCELERATION_FIELD, _SHEAR_FIELD, _BRACE_FIELD = range(5)


def _stored_field(field: int) -> FieldFunction:
    """Return a `FieldFunction` that reads one field from the history table."""
    return lambda building, loads, time, table: table[
        :, 1 + field * building.stories : 1 + (field + 1) * building.stories
    ]


def _floor_difference(field: int) -> FieldFunction:
    """Return a `FieldFunction` that computes the difference of a field between the floors above and
    below each story, such as the drift from the displacements."""

    def subtract_floor_below(building: Building, loads: Loads, time: Array, table: Array) -> Array:
        """Return the differences, shape (rows, n)."""
        floors = _stored_field(field)(building, loads, time, table)
        if building.system is not None:
            return np.asarray(floors @ building.deformations.T)
        # The values are relative to the ground: springs on the ground keep the values of the floor.
        return np.asarray(
            floors - building.linear_terms[rows.LINK, :-1] * floors[:, _base(building)]
        )

    return subtract_floor_below


def _total_shear(building: Building, loads: Loads, time: Array, table: Array) -> Array:
    """Return the shear in each story that balances the forces on all floors above the story, N.

    This shear contains the forces of springs, dampers and P-delta. It is the sum of applied force
    minus mass times absolute acceleration over these floors.
    """
    acceleration = _absolute_acceleration(building, loads, time, table)
    system = building.system
    if system is not None:
        floor_forces = -acceleration @ system.mass
    else:
        floor_forces = -building.linear_terms[rows.MASS, :-1] * acceleration
    add_force_history(*loads, time, floor_forces)
    if system is not None:
        return np.asarray(floor_forces @ system.cuts.T)
    # Sum from the roof down, attachments first.
    if building.branched:
        for i, item in enumerate(building.attachments, start=building.floors):
            floor_forces[:, item.floor - 1] += floor_forces[:, i]
        floor_forces = floor_forces[:, : building.floors]
    return np.asarray(np.cumsum(floor_forces[:, ::-1], axis=1)[:, ::-1])


_absolute_acceleration = _stored_field(_ACCELERATION_FIELD)
_DRIFT_RATE = _floor_difference(_VELOCITY_FIELD)


def _damper_force(building: Building, loads: Loads, time: Array, table: Array) -> Array:
    """Return the forces along the dampers, N; the arguments are those of `FieldFunction`."""
    force = building.device_force(_DRIFT_RATE(building, loads, time, table))
    if building.braced:
        force = force + _stored_field(_BRACE_FIELD)(building, loads, time, table)
    return building.damper_force(force)


HISTORIES: dict[str, FieldFunction] = {
    "displacement": _stored_field(_DISPLACEMENT_FIELD),
    "velocity": _stored_field(_VELOCITY_FIELD),
    "acceleration": _absolute_acceleration,
    "drift": _floor_difference(_DISPLACEMENT_FIELD),
    "shear": _stored_field(_SHEAR_FIELD),
    "damper_force": _damper_force,
    "total_shear": _total_shear,
}
"""Functions that compute the fields of `History` for stories and floors, shape (rows, n)."""
