"""Incremental dynamic analysis of the frame of configs/collapse-prone-frame.yaml under many
motions.

The motions are the shipped records, turned, shifted and scaled: no two are alike. Told are the
time, the widest bracket of a capacity, and how the runs ended.

    python tests/benchmarks/ida.py [--records 22] [--jobs 2]
"""

import argparse
import time
from collections import Counter

from common import ROOT, turned

from tdint import load_model
from tdint.campaign.ida import ida


def main():
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--records", type=int, default=22)
    parser.add_argument("--jobs", type=int, default=2)
    given = parser.parse_args()
    model, records = (
        load_model(ROOT / "configs" / "collapse-prone-frame.yaml"),
        turned(given.records),
    )
    ida(model, records[:1])  # loads the compiled kernels before the timer starts
    wall, processor = time.perf_counter(), time.process_time()
    study = ida(model, records, jobs=given.jobs)
    wall, processor = time.perf_counter() - wall, time.process_time() - processor
    runs = [run for curve in study.curves for run in curve.runs]
    widest = max(curve.collapse.upper / curve.collapse.lower for curve in study.curves) - 1.0
    print(
        f"{len(records)} records, {len(runs)} runs: {wall:.2f} s, {processor:.2f} s of processor "
        "time"
    )
    print(f"widest bracket {100.0 * widest:.2f} %")
    print(
        "ends:",
        ", ".join(
            f"{status} {count}" for status, count in Counter(run.status for run in runs).items()
        ),
    )


if __name__ == "__main__":
    main()
