"""Time of drift spectra of buildings with stories of 3.5 m: python
tests/benchmarks/drift_spectrum.py

200 periods, 4001 samples; the fastest of some repeats.
"""

import time
from functools import partial

from common import ROOT, least

from tdint import read_record
from tdint.analysis.spectra.drift import drift_spectrum
from tdint.number_parsing import parse_grid

REPEATS = 5
RECORD = ROOT / "records" / "firm-soil.mseed"


def main():
    """Print the time."""
    record = read_record(RECORD, component="HN1", units="m/s^2")
    periods = parse_grid("0.2:10:200").values()
    (fastest,) = least([partial(drift_spectrum, record, periods)], REPEATS, time.perf_counter)
    print(f"{record.acceleration.size} samples, {periods.size} periods: {fastest * 1e3:.1f} ms")


if __name__ == "__main__":
    main()
