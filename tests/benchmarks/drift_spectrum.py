"""Time of a drift spectrum, and its error: python tests/benchmarks/drift_spectrum.py

200 periods, 4001 samples; the fastest of some repeats. Errors against the same motion with 16 times as many samples.
"""

import time
from functools import partial

import numpy as np
from common import ROOT, least

from references import finer
from tdint import read_record
from tdint.analysis.spectra.drift import drift_spectrum
from tdint.written_numbers import parse_grid

REPEATS = 5
RECORD = ROOT / "records" / "firm-soil.mseed"


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
        (fastest,) = least([partial(drift_spectrum, record, periods, **kind)], REPEATS, time.perf_counter)
        coarse, fine = drift_spectrum(record, some, **kind), drift_spectrum(finer(record, 16), some, **kind)
        error = np.max(np.abs(coarse.peak_drift_ratio / fine.peak_drift_ratio - 1.0))
        print(f"{name:20s} {fastest * 1e3:8.1f} ms   error {error:.1e}")


if __name__ == "__main__":
    main()
