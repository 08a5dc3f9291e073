"""Measure the wall time and the error of constant-ductility spectra.

    python tests/benchmarks/inelastic.py

200 periods, 4001 samples, ductilities 2 and 4, elastoplastic oscillators, 5 % damping. tdint is
compared with a plain search: average acceleration with the sampling interval as time step in a loop
compiled by numba, maximum displacement at the samples, and bisection of the strength. The errors
are relative errors of the strengths. The reference values are strengths of tdint for the same
ground motion with an eighth of the sampling interval.
"""

import math
import time
from functools import partial

import numba
import numpy as np
from common import ROOT, minimum_times

from references import finer
from tdint import read_record
from tdint.grids import parse_grid
from tdint.response.spectra.inelastic import constant_ductility

REPEATS = 3
DUCTILITIES = [2.0, 4.0]
RECORD = ROOT / "records" / "firm-soil.mseed"


@numba.njit(error_model="numpy")
def plain_peak(ground, h, omega, damping, strength):
    """Return the maximum displacement of an elastoplastic oscillator of unit mass, m.

    Parameters
    ----------
    ground : ndarray
        Ground acceleration at the samples, m/s^2.
    h : float
        Sampling interval, s.
    omega : float
        Circular frequency, rad/s.
    damping : float
        Damping ratio.
    strength : float
        Yield force divided by the mass, m/s^2; inf for an elastic oscillator.
    """
    k, c = omega * omega, 2.0 * damping * omega
    # Displacement, velocity, restoring force and relative acceleration, divided by the mass.
    u, v, f, a, peak = 0.0, 0.0, 0.0, -ground[0], 0.0
    for p in -ground[1:]:
        new_u, new_f = u, f
        # Newton's method for the displacement at the end of the step.
        for _ in range(40):
            new_a = 4.0 / h**2 * (new_u - u - h * v) - a
            new_v = v + 0.5 * h * (a + new_a)
            trial = f + k * (new_u - u)
            new_f = min(max(trial, -strength), strength)
            tangent = k if new_f == trial else 0.0
            change = (p - new_a - c * new_v - new_f) / (4.0 / h**2 + 2.0 / h * c + tangent)
            new_u += change
            if abs(change) <= 1e-10 * (abs(new_u) + 1e-6):
                break
        new_a = 4.0 / h**2 * (new_u - u - h * v) - a
        v += 0.5 * h * (a + new_a)
        u, f, a = new_u, new_f, new_a
        peak = max(peak, abs(u))
    return peak


def plain_search(record, periods):
    """Return strengths divided by the mass by bisection, m/s^2, shape (ductilities, periods).

    The search assumes that the ductility decreases monotonically with the strength.
    """
    ground = record.acceleration.copy()
    result = np.empty((len(DUCTILITIES), periods.size))
    for i, period in enumerate(periods):
        omega = 2.0 * math.pi / period
        elastic = omega**2 * plain_peak(ground, record.dt, omega, 0.05, math.inf)
        for j, target in enumerate(DUCTILITIES):
            low, high = 0.0, elastic
            while high - low > 1e-4 * high:
                middle = 0.5 * (low + high)
                # Ductility: maximum displacement divided by the yield displacement
                # middle / omega^2.
                peak = plain_peak(ground, record.dt, omega, 0.05, middle)
                if omega**2 * peak / middle > target:
                    low = middle
                else:
                    high = middle
            result[j, i] = 0.5 * (low + high)
    return result


def exact_search(record, periods):
    """Return strengths divided by the mass by tdint, m/s^2, shape (ductilities, periods)."""
    spectra = constant_ductility(record, periods, DUCTILITIES)
    return np.array([spectrum.yield_acceleration for spectrum in spectra])


def main():
    """Print the time and the errors of both searches."""
    record = read_record(RECORD, component="HN1", units="m/s^2")
    periods = parse_grid("0.01:10:200").values()
    reference = exact_search(finer(record, 8), periods)
    print(f"{record.acceleration.size} samples, {periods.size} periods, ductilities {DUCTILITIES}")
    searches = {"tdint": exact_search, "plain search": plain_search}
    # Load or compile the loops before the measurement.
    for search in searches.values():
        search(record, periods[:1])
    calls = [partial(search, record, periods) for search in searches.values()]
    times = minimum_times(calls, REPEATS, time.perf_counter)
    for (name, search), seconds in zip(searches.items(), times, strict=True):
        errors = np.abs(search(record, periods) / reference - 1.0)
        print(
            f"{name:14s} {seconds:6.2f} s   errors of strengths: maximum {errors.max():.1e}, "
            f"maximum for periods of at least 0.1 s {errors[:, periods >= 0.1].max():.1e}, median "
            f"{np.median(errors):.1e}"
        )


if __name__ == "__main__":
    main()
