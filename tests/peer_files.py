"""Files of ground motions in the AT2 format of PEER, for tests."""

from collections.abc import Iterable
from pathlib import Path


def write_at2(file: Path, description: str, values: Iterable[float], dt: float = 0.01) -> None:
    """Write a ground motion.

    Parameters
    ----------
    file : Path
        The file.
    description : str
        Second line: event, date, station and direction.
    values : iterable of float
        Accelerations, g.
    dt : float
        Sampling interval, s.
    """
    samples = [f"{value:16.8E}" for value in values]
    interval = f"{dt:.4f}".lstrip("0")  # PEER omits the zero before the decimal point
    lines = [
        "PEER NGA STRONG MOTION DATABASE RECORD",
        description,
        "ACCELERATION TIME SERIES IN UNITS OF G",
        f"NPTS= {len(samples)}, DT= {interval} SEC",
        *samples,
    ]
    file.write_text("\n".join(lines) + "\n", encoding="utf-8")
