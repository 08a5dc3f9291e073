"""Elastic response spectra: the work behind `tdint spectrum`."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tdint.analysis.amplification import find_instability
from tdint.analysis.stepping import Steps, integrate, workspace
from tdint.errors import AnalysisError, UsageError
from tdint.ground_motion.record import Record
from tdint.kernels import observing, spectra
from tdint.methods.catalogue import parse
from tdint.methods.exact import oscillator
from tdint.model.building import oscillators

Array = NDArray[np.float64]

DEFAULT_PERIODS = "0.01:10:200"
"""Periods of a spectrum where none are asked for, s."""

MOST_PERIODS = 1_000_000
_GROUP = 48  # oscillators marched together at most: their numbers stay in the processor's first cache


@dataclass(frozen=True)
class Spectrum:
    """Elastic response spectrum of one record for one damping ratio.

    Attributes
    ----------
    method : str
        `exact`, or the method that integrated the oscillators.
    periods : ndarray, shape (k,)
        Periods, s.
    sd, sv, sa : ndarray, shape (k,)
        Largest relative displacement (m), relative velocity (m/s) and absolute acceleration (m/s^2) at the samples.
    psv, psa : ndarray, shape (k,)
        Pseudo-velocity omega sd (m/s) and pseudo-acceleration omega^2 sd (m/s^2).
    """

    record: Record
    damping: float
    method: str
    periods: Array
    sd: Array
    psv: Array
    psa: Array
    sv: Array
    sa: Array


def spectrum(record: Record, periods: Array, damping: float = 0.05, *, method: str | None = None) -> Spectrum:
    """Elastic response spectrum of a record.

    Parameters
    ----------
    record : Record
        Ground motion; linear between its samples, the oscillators at rest at its first one.
    periods : ndarray, shape (k,)
        Periods, s, positive.
    damping : float
        Damping ratio, in [0, 1).
    method : str, optional
        Integrate with this method at the record's step, instead of the exact solution (Nigam and Jennings 1969).

    Returns
    -------
    Spectrum
        Maxima at the samples, not between them.

    Raises
    ------
    UsageError
        Periods or damping out of range, unknown method.
    AnalysisError
        The method is unstable at a period.
    """
    periods = np.atleast_1d(np.asarray(periods, dtype=np.float64))
    if periods.size == 0 or not np.all(np.isfinite(periods) & (periods > 0.0)):
        raise UsageError("periods must be positive numbers of seconds")
    if not 0.0 <= damping < 1.0:
        raise UsageError(f"damping must be a ratio in [0, 1), got {damping!r}")
    omega = 2.0 * math.pi / periods
    if method is None or parse(method).method.name == "exact":
        label = "exact"
        sd, sv, sa = _exact(record, omega, damping)
    else:
        label, sd, sv, sa = _integrated(record, omega, damping, method)
    return Spectrum(record, damping, label, periods, sd, omega * sd, omega**2 * sd, sv, sa)


def _exact(record: Record, omega: Array, damping: float) -> tuple[Array, Array, Array]:
    """Largest values of the exact recursion at the samples."""
    groups = -(-omega.size // _GROUP)
    lanes = -(-omega.size // groups)
    padded = np.full(lanes * groups, omega[-1])
    padded[: omega.size] = omega
    h = record.dt
    steps = oscillator(padded * h, np.full_like(padded, damping))
    table = np.empty((spectra.COEFFICIENTS, padded.size))
    for row, first in ((0, spectra.A11), (1, spectra.A21)):
        table[first : first + 4] = steps[:, row].T
    table[spectra.A12] *= h
    table[spectra.A21] /= h
    table[[spectra.B10, spectra.B11]] *= h * h
    table[[spectra.B20, spectra.B21]] *= h
    table[spectra.BY_DISPLACEMENT] = padded**2
    table[spectra.BY_VELOCITY] = 2.0 * damping * padded
    peaks = np.empty((spectra.PEAKS, padded.size))
    spectra.sampled_peaks.compiled(record.acceleration.copy(), table, peaks, lanes)
    sd, sv, sa = peaks[:, : omega.size]
    return sd, sv, sa


def _integrated(record: Record, omega: Array, damping: float, method: str) -> tuple[str, Array, Array, Array]:
    """Largest values at the samples, all oscillators integrated side by side by a method of the catalogue."""
    integrator = parse(method)
    ratios = np.full_like(omega, damping)
    found = find_instability(integrator, omega, ratios, record.dt)
    if found is not None:
        raise AnalysisError(
            f"{integrator.label} is unstable at the record's step {record.dt:.6g} s for the period "
            f"{2.0 * math.pi / omega[found.index]:.6g} s; ask for longer periods or use another method"
        )
    building = oscillators(omega, ratios)
    space = workspace(building, integrator)
    steps = Steps(record.dt, record.acceleration.size - 1)
    code = integrate(integrator, building, np.zeros((0, 4)), record.acceleration.copy(), steps, space)
    if code < 0:
        raise AnalysisError(f"{integrator.label} diverged at the record's step {record.dt:.6g} s; use another method")
    peaks = space.peaks
    return (
        integrator.label,
        peaks[observing.PEAK_DISPLACEMENT],
        peaks[observing.PEAK_VELOCITY],
        peaks[observing.PEAK_ACCELERATION],
    )


def parse_periods(text: str) -> Array:
    """Periods from `first:last:count`, in equal ratios, both ends included; shape (count,).

    Raises
    ------
    UsageError
        The text has another form, or the numbers make no sense.
    """
    parts = text.split(":")
    try:
        first, last, count = float(parts[0]), float(parts[1]), int(parts[2])
    except (ValueError, IndexError):
        count, first, last = 0, math.nan, math.nan
    if len(parts) != 3 or not (0.0 < first < last < math.inf) or not 2 <= count <= MOST_PERIODS:
        raise UsageError(f"periods must be first:last:count in seconds, such as {DEFAULT_PERIODS}, got {text!r}")
    result = np.geomspace(first, last, count)
    result[0], result[-1] = first, last
    return result
