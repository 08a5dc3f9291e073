"""Compare elastic and rotated response spectra with other programs.

    python tests/benchmarks/spectrum.py

200 periods from 0.01 to 10 s, 5 % damping, 4001 samples at 0.01 s (records/firm-soil.mseed). eqsig
and pyrotd are measured by their public functions if they are installed. All programs run
alternately, and the minimum processor time of the repeats counts.

The errors of the pseudo-acceleration are printed for ranges of periods. The reference is a second
implementation (tests/references.py): matrix exponentials for a ground motion that is linear between
its samples, and Brent's method for the maxima between the samples. Rotated spectra of pyrotd are
compared with rotated spectra of tdint, because the second implementation does not compute them.
"""

from collections.abc import Callable
from importlib import import_module
from importlib.util import find_spec

import numpy as np
from common import ROOT, minimum_times

from references import OscillatorResponse
from tdint import read_record, spectrum
from tdint.grids import parse_grid
from tdint.ground_motion.horizontals import find_horizontals
from tdint.response.defaults import PERIODS
from tdint.response.spectra.rotated import rotated_spectrum

REPEATS = 15
RECORD = ROOT / "records" / "firm-soil.mseed"
DAMPING = 0.05
RANGES = ((0.0, 0.02), (0.02, 0.04), (0.04, 0.1), (0.1, 10.0))
"""Ranges of periods, s, without their lower bounds. Bounds are 2, 4 and 10 sampling intervals."""


def reference_spectrum(record, periods):
    """Return pseudo-accelerations, m/s^2, by matrix exponentials and Brent's method."""
    omegas = 2.0 * np.pi / periods
    responses = [OscillatorResponse(record, omega, DAMPING) for omega in omegas]
    return omegas**2 * np.array([response.largest()[0] for response in responses])


def eqsig(record, periods):
    """Return a function that computes pseudo-accelerations, m/s^2, with eqsig; None if eqsig is not
    installed."""
    if not find_spec("eqsig"):
        return None
    signal = import_module("eqsig").AccSignal

    def compute():
        motion = signal(record.acceleration, record.dt)
        motion.generate_response_spectrum(response_times=periods, xi=DAMPING)
        # eqsig provides the spectral displacement s_d; the pseudo-acceleration is omega^2 s_d.
        return (2.0 * np.pi / periods) ** 2 * motion.s_d

    return compute


def pyrotd(record, periods):
    """Return a function that computes pseudo-accelerations with pyrotd, in the unit of the record;
    None if pyrotd is not installed."""
    if not find_spec("pyrotd"):
        return None
    module = import_module("pyrotd")
    module.processes = 1
    return lambda: (
        module.calc_spec_accels(record.dt, record.acceleration, 1.0 / periods, DAMPING).spec_accel
    )


def pyrotd_rotated(first, second, periods):
    """Return a function that computes RotD0, RotD50 and RotD100 with pyrotd, shape (3, periods);
    None if pyrotd is not installed."""
    if not find_spec("pyrotd"):
        return None
    module = import_module("pyrotd")
    module.processes = 1

    def compute():
        table = module.calc_rotated_spec_accels(
            first.dt,
            first.acceleration,
            second.acceleration,
            1.0 / periods,
            DAMPING,
            percentiles=[0, 50, 100],
        )
        return np.array([table[table.percentile == p].spec_accel for p in (0, 50, 100)])

    return compute


def measure(functions: dict[str, Callable | None], repeats):
    """Return minimum processor times, s, and results by name; functions that are None are
    ignored."""
    available = {name: function for name, function in functions.items() if function}
    results = {name: function() for name, function in available.items()}
    times = minimum_times(list(available.values()), repeats)
    return dict(zip(available, times, strict=True)), results


def print_comparison(times, results, exact, periods, base):
    """Print the time and the maximum error in each range of periods for each program.

    Parameters
    ----------
    times, results : dict
        Time, s, and spectrum by name of the program.
    exact : ndarray
        Reference spectrum; the periods are the last axis.
    periods : ndarray
        Periods, s.
    base : str
        Name of the program by which the times are divided.
    """
    for name, seconds in times.items():
        error = np.abs(results[name] / exact - 1.0)
        maxima = [np.max(error[..., (low < periods) & (periods <= high)]) for low, high in RANGES]
        parts = ", ".join(
            f"{high:g} s: {value:.1e}" for (_, high), value in zip(RANGES, maxima, strict=True)
        )
        print(f"{name:24s} {seconds * 1e3:9.3f} ms {seconds / times[base]:8.2f} x   up to {parts}")


def main():
    """Print the tables."""
    first, second = (read_record(RECORD, component=name, units="m/s^2") for name in ("HN1", "HN2"))
    periods = parse_grid(PERIODS).values()
    times, results = measure(
        {
            "tdint": lambda: spectrum(first, periods, DAMPING).psa,
            "eqsig": eqsig(first, periods),
            "pyrotd": pyrotd(first, periods),
        },
        REPEATS,
    )
    print_comparison(times, results, reference_spectrum(first, periods), periods, "tdint")
    print()

    motion = find_horizontals([first, second])
    times, results = measure(
        {
            "tdint --rotd 0,50,100": lambda: rotated_spectrum(motion, periods, DAMPING).psa,
            "pyrotd": pyrotd_rotated(first, second, periods),
        },
        7,
    )
    # The differences from tdint are printed. tests/response/spectra/test_rotated.py compares the
    # rotated spectra of tdint with the spectra of 180 rotated motions.
    print_comparison(
        times, results, results["tdint --rotd 0,50,100"], periods, "tdint --rotd 0,50,100"
    )


if __name__ == "__main__":
    main()
