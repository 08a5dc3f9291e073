"""Time of a drift spectrum, and its error: python tests/benchmarks/drift_spectrum.py

200 periods, 4001 samples; the fastest of some repeats. Errors against the same motion with 16 times as many samples.
"""

import time
from dataclasses import replace
from pathlib import Path

import numpy as np

from tdint import read_record
from tdint.analysis.spectra.drift import drift_spectrum
from tdint.written_numbers import parse_grid

REPEATS = 5
RECORD = Path(__file__).parents[2] / "records" / "firm-soil.mseed"


def finer(record, parts):
    """The same motion with samples on the lines between."""
    samples = record.acceleration.size
    times = np.arange((samples - 1) * parts + 1) / parts
    return replace(record, acceleration=np.interp(times, np.arange(samples), record.acceleration), dt=record.dt / parts)


def main():
    """Print the table."""
    record = read_record(RECORD, component="HN1", units="m/s^2")
    periods = parse_grid("0.2:10:200").values()
    some = periods[::10]
    print(f"{record.acceleration.size} samples, {periods.size} periods; errors at {some.size} of them")
    for name, kind in (
        ("stories of 3.5 m", {}),
        ("1 story", {"stories": 1}),
        ("5 stories", {"stories": 5}),
        ("100 stories", {"stories": 100}),
        ("beam", {"beam": True}),
    ):
        fastest = np.inf
        for _ in range(REPEATS):
            begin = time.perf_counter()
            drift_spectrum(record, periods, **kind)
            fastest = min(fastest, time.perf_counter() - begin)
        coarse, fine = drift_spectrum(record, some, **kind), drift_spectrum(finer(record, 16), some, **kind)
        error = np.max(np.abs(coarse.peak_drift_ratio / fine.peak_drift_ratio - 1.0))
        print(f"{name:20s} {fastest * 1e3:8.1f} ms   error {error:.1e}")


if __name__ == "__main__":
    main()
