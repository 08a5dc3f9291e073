"""Time and error of constant-ductility spectra: python tests/benchmarks/inelastic.py

200 periods, 4001 samples, ductilities 2 and 4, elastoplastic, 5 %. Beside tdint, in the same run, a
plain search: average acceleration at the record's step in a loop that numba compiles, largest
displacement at the samples, bisection of the strength. Errors are those of the strengths, over
tdint's for the same motion with 8 times as many samples.
"""

import math
import time
from functools import partial

import numba
import numpy as np
from common import ROOT, least

from references import finer
from tdint import read_record
from tdint.analysis.spectra.inelastic import constant_ductility
from tdint.number_parsing import parse_grid

REPEATS = 3
DUCTILITIES = [2.0, 4.0]
RECORD = ROOT / "records" / "firm-soil.mseed"


@numba.njit(error_model="numpy")
def plain_peak(ground, h, omega, damping, strength):
    """Largest displacement of an elastoplastic oscillator of unit mass."""
    k, c = omega * omega, 2.0 * damping * omega
    u, v, f, a, peak = 0.0, 0.0, 0.0, -ground[0], 0.0
    for p in -ground[1:]:
        new_u, new_f = u, f
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
    """Strengths over mass by bisection, as if the ductility were monotone; shape (ductilities,
    periods)."""
    ground = record.acceleration.copy()
    result = np.empty((len(DUCTILITIES), periods.size))
    for i, period in enumerate(periods):
        omega = 2.0 * math.pi / period
        elastic = omega**2 * plain_peak(ground, record.dt, omega, 0.05, math.inf)
        for j, target in enumerate(DUCTILITIES):
            low, high = 0.0, elastic
            while high - low > 1e-4 * high:
                middle = 0.5 * (low + high)
                ductile = (
                    omega**2 * plain_peak(ground, record.dt, omega, 0.05, middle) / middle > target
                )
                low, high = (middle, high) if ductile else (low, middle)
            result[j, i] = 0.5 * (low + high)
    return result


def exact_search(record, periods):
    """Strengths over mass; shape (ductilities, periods)."""
    return np.array(
        [s.yield_acceleration for s in constant_ductility(record, periods, DUCTILITIES)]
    )


def main():
    """Print the tables."""
    record = read_record(RECORD, component="HN1", units="m/s^2")
    periods = parse_grid("0.01:10:200").values()
    reference = exact_search(finer(record, 8), periods)
    print(f"{record.acceleration.size} samples, {periods.size} periods, ductilities {DUCTILITIES}")
    searches = {"tdint": exact_search, "plain search": plain_search}
    for search in searches.values():
        search(record, periods[:1])
    works = [partial(search, record, periods) for search in searches.values()]
    fastest = least(works, REPEATS, time.perf_counter)
    for (name, search), seconds in zip(searches.items(), fastest, strict=True):
        errors = np.abs(search(record, periods) / reference - 1.0)
        print(
            f"{name:14s} {seconds:6.2f} s   largest error of a strength {errors.max():.1e}, from "
            f"0.1 s on {errors[:, periods >= 0.1].max():.1e}, median {np.median(errors):.1e}"
        )


if __name__ == "__main__":
    main()
