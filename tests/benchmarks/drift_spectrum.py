"""Measure the wall time of a drift spectrum of buildings with stories of 3.5 m.

    python tests/benchmarks/drift_spectrum.py

200 periods, 4001 samples; the minimum of `REPEATS` calls.
"""

import time
from functools import partial

from common import ROOT, minimum_times

from tdint import read_record
from tdint.grids import parse_grid
from tdint.response.spectra.drift import drift_spectrum

REPEATS = 5
RECORD = ROOT / "records" / "firm-soil.mseed"


def main():
    """Print the time."""
    record = read_record(RECORD, component="HN1", units="m/s^2")
    periods = parse_grid("0.2:10:200").values()
    calls = [partial(drift_spectrum, record, periods)]
    (seconds,) = minimum_times(calls, REPEATS, time.perf_counter)
    print(f"{record.acceleration.size} samples, {periods.size} periods: {seconds * 1e3:.1f} ms")


if __name__ == "__main__":
    main()
