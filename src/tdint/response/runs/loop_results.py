"""Results of a time integration, computed from the arrays of the time loops."""

from __future__ import annotations

from dataclasses import replace
from functools import reduce
from operator import add
from typing import TypeVar

import numpy as np

from tdint.arrays import Array, each_array
from tdint.kernels import layout as rows
from tdint.methods.workspace import INERTER_FORCE, Workspace
from tdint.model.building import Building
from tdint.response.runs.energy import ENERGY_TERMS, Energy
from tdint.response.runs.outcome import (
    STORY_QUANTITIES,
    DevicePeaks,
    StoryErrors,
    StoryPeaks,
    story_values,
)
from tdint.response.runs.prepared import device_results

ValuesT = TypeVar("ValuesT", StoryPeaks, StoryErrors)


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
    `interstep_peak_errors`; None without devices."""
    if not building.branched:
        return None
    result = replace(
        named_devices(building, all_peaks(building, space), device_results(building, space)),
        interstep_bound=interstep_peak_errors(building, space, late, building.device_columns),
        attachments=tuple(item.name for item in building.attachments),
        links=tuple(item.name for item in building.links),
    )
    if building.system is None:
        return result
    forces = space.observer_state[INERTER_FORCE]
    if building.inertial:
        forces = space.peaks[rows.PEAK_INERTER_FORCE]
    return replace(result, inerter_force=forces[building.device_columns].copy())


def named_devices(building: Building, peaks: StoryPeaks, results: Array) -> DevicePeaks:
    """Return the values of attachments and links from the peaks of all columns and the array of
    `device_results`, of one run or with a first axis of runs. Ductilities end at the fracture; the
    residual deformations of links have the sign for their direction in the model."""
    devices = columns(peaks, building.device_columns)
    energy, times, drifts = np.moveaxis(results, -2, 0)
    residual = devices.residual_drift * building.device_signs
    if not drifts.any():
        return DevicePeaks(replace(devices, residual_drift=residual), energy)
    with np.errstate(divide="ignore", invalid="ignore"):
        shares = np.where(drifts, np.abs(drifts) / devices.peak_drift, 1.0)
    return DevicePeaks(
        replace(devices, residual_drift=residual, ductility=devices.ductility * shares),
        energy,
        fracture_time=np.where(drifts, times, np.nan),
        fracture_drift=drifts * building.device_signs,
    )


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
    isolator = np.zeros(building.heights.size)
    isolator[list(building.isolators)] = 1.0
    return StoryPeaks(height=building.heights, isolator=isolator, **values)


def residual_oscillation(
    building: Building, space: Workspace, inverse_omega: float | None = None
) -> Array:
    """Return approximate amplitudes of the drifts about their positions of rest at the end of a
    run, m.

    As in a free vibration, the amplitude is sqrt(d^2 + (v / omega)^2), with the distance d from the
    position of rest and the drift rate v. At rest, no story has a force, so d is the force of the
    story divided by its present stiffness. 1 / omega is `inverse_omega` (s; by default the maximum
    displacement divided by the maximum velocity of the run, for an attachment with a stiffness that
    of its mass on a floor at rest), times the square root of the ratio of initial to present
    stiffness.
    """
    distance, present_stiffness = building.rest_distance(space.law_state)
    rate = building.drifts(space.state[rows.VELOCITY])
    initial_stiffness = building.initial_stiffness
    inverse = np.full(rate.shape, inverse_omega, dtype=float)
    if inverse_omega is None:
        displacement, velocity = (
            float(space.peaks[row].max()) for row in (rows.PEAK_DISPLACEMENT, rows.PEAK_VELOCITY)
        )
        inverse[:] = displacement / velocity if velocity > 0.0 else 0.0
        attached = np.arange(building.floors, building.floors + len(building.attachments))
        attached = attached[initial_stiffness[attached] > 0.0]
        mass = building.mass
        if building.inertial and building.system is not None:
            mass = np.diagonal(building.system.mass)
        inverse[attached] = np.sqrt(mass[attached] / initial_stiffness[attached])
    softening = np.sqrt(initial_stiffness / present_stiffness)
    return np.asarray(np.hypot(distance, rate * inverse * softening))


def possible_growth(
    building: Building, space: Workspace, period: float, *, is_at_rest: bool
) -> float:
    """Return the possible growth of a peak drift after the end of a run, relative to the peak, for
    the story with the largest growth.

    The drift of a story in free vibration is at most its distance from zero without a force plus
    its amplitude (`residual_oscillation`) with the first period of the building (s), or less if it
    yields (`_reach_of_yielding`). If the ground moves at the end (`is_at_rest` is False), only
    stories count with a drift that is the peak and increases.
    """
    drift, peak = space.law_state[rows.DRIFT, : building.stories], space.peaks[rows.PEAK_DRIFT]
    rate = building.drifts(space.state[rows.VELOCITY])
    distance, present = building.rest_distance(space.law_state)
    inverse_omega = period / (2.0 * np.pi) if np.isfinite(period) else None
    amplitude = residual_oscillation(building, space, inverse_omega)
    reach = np.abs(drift - distance) + amplitude
    yields = (building.initial_stiffness > present) & (distance * rate > 0.0)
    smaller = np.minimum(reach, _reach_of_yielding(building, drift, distance, amplitude, present))
    reach = np.where(yields, smaller, reach)
    counts = peak > 0.0
    if not is_at_rest:
        counts &= (np.abs(drift) >= peak) & (drift * rate > 0.0)
    return float(np.max(reach[counts] / peak[counts] - 1.0, initial=0.0))


def _reach_of_yielding(
    building: Building, drift: Array, distance: Array, amplitude: Array, present: Array
) -> Array:
    """Return the largest absolute drifts in free vibration of stories that yield, m.

    `drift` - `distance` are the drifts without a force on the present branches, with the slopes
    `present`. A story continues on its branch until the work of its force has consumed the energy
    of the amplitude of its drift rate, (amplitude^2 - distance^2) present / 2. From there it
    unloads with its initial stiffness and swings about the drift without a force.
    """
    force = np.abs(distance * present)
    twice_energy = present * np.maximum(amplitude**2 - distance**2, 0.0)
    # Positive root x of force x + present x^2 / 2 = energy
    divisor = force + np.sqrt(force**2 + present * twice_energy)
    further = np.divide(twice_energy, divisor, out=np.zeros_like(drift), where=divisor > 0.0)
    direction = np.sign(distance)
    last = drift + direction * further
    elastic = (force + present * further) / np.maximum(building.initial_stiffness, present)
    return np.asarray(np.maximum(np.abs(last), np.abs(last - direction * elastic) + elastic))


def with_growth(errors: StoryErrors, stories: StoryPeaks, growth: float) -> StoryErrors:
    """Return errors of peaks that may grow after the end of a run, relative to the peak; residual
    drifts are unchanged."""
    values = {
        name: np.maximum(value, growth * getattr(stories, name))
        for name, value in vars(errors).items()
        if name != "residual_drift"
    }
    return StoryErrors(**values, residual_drift=errors.residual_drift)


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
            np.abs(building.drifts(row))
            for row in (
                space.state[rows.VELOCITY],
                space.observer_state[rows.OBSERVED_ACCELERATION],
            )
        )
        # Taylor series of second order, with absolute values of its terms.
        drift_change = late * velocity + 0.5 * late**2 * acceleration
    reported = vars(all_peaks(building, space))
    # If the time steps resolve the motion, all peaks between them are stored as 0.
    largest_peaks = np.maximum(space.peaks[rows.PEAK_ROWS :], space.peaks[: rows.PEAK_ROWS])
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
