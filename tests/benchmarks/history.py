"""Measure the processor time and the memory for writing a response history as CSV.

    python tests/benchmarks/history.py [STEPS]

The building has ten stories; default 4000 steps. The times are compared with `numpy.savetxt` for
the same table. A compressed file is also measured.
"""

import io
import sys
import tracemalloc
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from common import ROOT, minimum_times

from tdint import load_model, run
from tdint.files import write_files
from tdint.output.tables.histories import HistoryLayout, write_history

MODEL = ROOT / "configs" / "ten-story.yaml"


def minimum_time(function):
    """Return the minimum processor time of five calls of a function without arguments, s."""
    return minimum_times([function], 5)[0]


def main():
    """Print times, sizes and memory."""
    steps = int(sys.argv[1]) if len(sys.argv) > 1 else 4000
    model = load_model(MODEL)
    run(model, duration=0.1, history=True)  # compiles the kernels before the measurement
    tracemalloc.start()
    history = run(model, duration=0.01 * steps, history=True).history
    columns = HistoryLayout(history.displacement.shape[1]).columns
    tracemalloc.reset_peak()
    with Path("/dev/null").open("wb") as null_device:
        memory_before, _ = tracemalloc.get_traced_memory()
        write_history([history], null_device)
        _, peak_memory = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    stream = io.BytesIO()
    write_history(history, stream)
    table = np.genfromtxt(io.BytesIO(stream.getvalue()), delimiter=",", skip_header=1)
    time_tdint = minimum_time(lambda: write_history(history, io.BytesIO()))
    time_numpy = minimum_time(lambda: np.savetxt(io.BytesIO(), table, fmt="%.12g", delimiter=","))
    print(
        f"{len(history.time)} rows, {len(columns)} columns: {time_tdint:.2f} s, numpy.savetxt "
        f"{time_numpy:.2f} s"
    )
    with TemporaryDirectory() as directory:
        file = Path(directory) / "history.csv.gz"
        time_compressed = minimum_time(
            lambda: write_files({file: partial(write_history, [history])}, overwrite=True)
        )
    print(f"compressed file: {time_compressed:.2f} s")
    size = 8 * len(columns) * len(history.time)  # bytes
    print(
        f"size of the table {size / 1e6:.1f} MB, memory for writing "
        f"{(peak_memory - memory_before) / 1e6:.1f} MB"
    )


if __name__ == "__main__":
    main()
