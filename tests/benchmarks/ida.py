"""Measure an incremental dynamic analysis of the frame of configs/collapse-prone-frame.yaml.

    python tests/benchmarks/ida.py [--records 22] [--jobs 2]

The ground motions are derived from the records of this repository by rotation, delay and scaling
(`common.rotated_motions`). The program prints the time, the widest bracket
of a collapse capacity, and the number of runs by status.
"""

import argparse
import time
from collections import Counter

from common import ROOT, rotated_motions

from tdint import load_model
from tdint.studies.ida.ida import ida


def main():
    """Run the analysis and print time, brackets and statuses."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--records", type=int, default=22)
    parser.add_argument("--jobs", type=int, default=2)
    options = parser.parse_args()
    model = load_model(ROOT / "configs" / "collapse-prone-frame.yaml")
    records = rotated_motions(options.records)
    ida(model, records[:1])  # loads the compiled kernels before the timer starts
    wall_start, processor_start = time.perf_counter(), time.process_time()
    study = ida(model, records, jobs=options.jobs)
    wall, processor = time.perf_counter() - wall_start, time.process_time() - processor_start
    runs = [run for curve in study.curves for run in curve.runs]
    # The capacity is between the largest intensity without and the smallest with collapse.
    widest = max(curve.collapse.upper / curve.collapse.lower for curve in study.curves) - 1.0
    print(
        f"{len(records)} records, {len(runs)} runs: {wall:.2f} s, {processor:.2f} s of processor "
        "time"
    )
    print(f"widest bracket {100.0 * widest:.2f} %")
    counts = Counter(run.status for run in runs)
    print("statuses:", ", ".join(f"{status} {count}" for status, count in counts.items()))


if __name__ == "__main__":
    main()
