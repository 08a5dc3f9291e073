"""Seconds to write a history of 4001 steps and ten stories as CSV: python tests/benchmarks/history.py"""

from __future__ import annotations

import io
import time
from pathlib import Path

from tdint import load_model, run
from tdint.output.tables.tables import write_history

MODEL = Path(__file__).parents[2] / "configs" / "ten-story.yaml"


def main():
    """Print the fastest of five."""
    history = run(load_model(MODEL), duration=40.0, history=True).history
    seconds = []
    for _ in range(5):
        begin = time.process_time()
        write_history(history, io.BytesIO())
        seconds.append(time.process_time() - begin)
    print(f"{len(history.time)} rows, {history.displacement.shape[1]} stories: {min(seconds):.2f} s")


if __name__ == "__main__":
    main()
