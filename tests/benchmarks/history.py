"""Measure the processor time and the memory for writing a response history of ten stories as CSV,
compared with the text output of NumPy for the same table, compressed.

    python tests/benchmarks/history.py [STEPS]
"""

import io
import sys
import tracemalloc
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from common import ROOT, least

from tdint import load_model, run
from tdint.files import write_file
from tdint.output.tables.responses import history_columns, write_history

MODEL = ROOT / "configs" / "ten-story.yaml"


def fastest(work):
    """The least processor time of five, s."""
    return least([work], 5)[0]


def main():
    """Print times, sizes and memory."""
    steps = int(sys.argv[1]) if len(sys.argv) > 1 else 4000
    model = load_model(MODEL)
    run(model, duration=0.1, history=True)  # compiles
    tracemalloc.start()
    history = run(model, duration=0.01 * steps, history=True).history
    columns = history_columns(history.displacement.shape[1])
    tracemalloc.reset_peak()
    with Path("/dev/null").open("wb") as nowhere:
        before, _ = tracemalloc.get_traced_memory()
        write_history(history, nowhere)
        _, writing = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    stream = io.BytesIO()
    write_history(history, stream)
    table = np.genfromtxt(io.BytesIO(stream.getvalue()), delimiter=",", skip_header=1)
    ours = fastest(lambda: write_history(history, io.BytesIO()))
    numpys = fastest(lambda: np.savetxt(io.BytesIO(), table, fmt="%.12g", delimiter=","))
    print(
        f"{len(history.time)} rows, {len(columns)} columns: {ours:.2f} s, numpy.savetxt "
        f"{numpys:.2f} s"
    )
    with TemporaryDirectory() as folder:
        file = Path(folder) / "history.csv.gz"
        packed = fastest(lambda: write_file(file, partial(write_history, history), overwrite=True))
    print(f"packed: {packed:.2f} s")
    size = 8 * len(columns) * len(history.time)
    print(f"the table {size / 1e6:.1f} MB, the writing takes {(writing - before) / 1e6:.1f} MB")


if __name__ == "__main__":
    main()
