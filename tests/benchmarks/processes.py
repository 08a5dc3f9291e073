"""Whole processes: `tdint spectrum` of one record against the imports of its packages, and batches with --jobs 1 and 2.

Run: python tests/benchmarks/processes.py. The commands are run several times, in turns; the shortest times are shown.
"""

from __future__ import annotations

import subprocess
import sys
import tempfile
import time
from pathlib import Path

RECORDS = Path(__file__).parents[2] / "records"
TDINT = (sys.executable, "-c", "from tdint_cli.main import main; main()")
IMPORTS = (sys.executable, "-c", "import numpy, obspy, numba, click")
COPIES = 40


def seconds(*commands, turns=7):
    """Shortest wall time of each command, s, the commands taken in turns."""
    best = [float("inf")] * len(commands)
    for _ in range(turns):
        for i, command in enumerate(commands):
            start = time.perf_counter()
            subprocess.run(list(map(str, command)), check=True, capture_output=True)
            best[i] = min(best[i], time.perf_counter() - start)
    return best


def main():
    one = (*TDINT, "spectrum", RECORDS / "near-fault.mseed", "--component", "HN1", "--units", "m/s^2")
    seconds(one, turns=1)  # compiles
    imports, spectrum = seconds(IMPORTS, one)
    print(f"imports of numpy, obspy, numba, click: {imports:.2f} s")
    print(f"tdint spectrum, 200 periods, one record: {spectrum:.2f} s, {spectrum / imports:.2f} times as much")
    with tempfile.TemporaryDirectory() as name:
        folder, out = Path(name) / "records", Path(name) / "out"
        folder.mkdir()
        files = sorted(RECORDS.glob("*.mseed"))
        for i in range(COPIES):
            (folder / f"{i:02d}.mseed").write_bytes(files[i % len(files)].read_bytes())
        for what, more in (
            ("spectra", ()),
            ("spectra with pictures", ("--plot",)),
            ("spectra by rk5", ("--method", "rk5", "--periods", "0.3:10:200")),
        ):
            command = (*TDINT, "spectrum", folder, "-o", f"{out}/", "--overwrite", *more)
            seconds(command, turns=1)
            times = seconds(*((*command, "--jobs", jobs) for jobs in (1, 2)), turns=3)
            print(f"{COPIES} records, {what}: {times[0]:.2f} s, with --jobs 2 {times[1]:.2f} s")


if __name__ == "__main__":
    main()
