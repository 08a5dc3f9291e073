"""Small valid files of every supported format, and the statements that can reveal a change."""

import tempfile
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ground_motion import network_files
from ground_motion.files import counts, obspy_data, trace, wave, write
from ground_motion.samples import SAMPLES
from ground_motion.test_archive import packed

COUNT, STEP, PEAK, ALL = "number of samples", "sampling interval", "peak", "checksum"

_OWN = {
    "AFAD": {COUNT, PEAK},
    "AT2": {COUNT},
    "BHRC": {COUNT, STEP},
    "COSMOS": {COUNT, PEAK},
    "CSMIP": {COUNT, PEAK},
    "CSMNC": {COUNT, PEAK},
    "CWB": {COUNT, STEP, PEAK},
    "ESM": {COUNT, PEAK},
    "GEONET": {COUNT, STEP, PEAK},
    "SACTEXT": {COUNT, PEAK},
    "SMC": {COUNT, PEAK},
    "TEXT": set(),
    "UNAM": {COUNT, PEAK},
    "USC": {COUNT},
}
"""What each of tdint's own formats states twice, so that a change of it alone can be told."""

_RECORDERS = {
    "KINEMETRICS_EVT": ("kinemetrics/tests/data/BI008_MEMA-04823.evt", None, {COUNT, ALL}),
    "GCF": ("gcf/tests/data/20160603_1955n.gcf", "1e-6 m/s^2", {COUNT}),
    "REFTEK130 C2": ("reftek/tests/data/104800000_000093F8", "1e-6 m/s^2", {COUNT}),
    "REFTEK130 16": ("reftek/tests/data/065520000_013EE8A0.rt130", "1e-6 m/s^2", {COUNT}),
    "KNET": ("nied/tests/data/test.knet", None, {COUNT, PEAK}),
}


@dataclass(frozen=True)
class Sound:
    """Valid file: its format, its bytes, the required units, and the statements that can reveal a
    change."""

    name: str
    data: bytes
    units: str | None
    tells: frozenset[str]

    @property
    def ends(self) -> list[int]:
        """Return the numbers of samples up to the end of each record except the last, for a
        MiniSEED file."""
        counts = [
            int.from_bytes(self.data[i + 30 : i + 32], "big") for i in range(0, len(self.data), 512)
        ]
        return np.cumsum(counts[:-1]).tolist()


def corpus() -> list[Sound]:
    """Return all valid files in a fixed order."""
    found = [
        Sound(name, make().encode(), _units(make()), frozenset(_OWN[name]))
        for name, makes in sorted(SAMPLES.items())
        for make in makes
    ]
    found += [
        Sound("ZIP", packed({"a.dat": network_files.cwb()}), None, frozenset({COUNT, STEP, PEAK}))
    ]
    found += _written()
    for name, (file, units, tells) in _RECORDERS.items():
        if path := obspy_data(file):
            found.append(Sound(name, path.read_bytes(), units, frozenset(tells)))
    return found


def _units(text: str) -> str | None:
    """Return the units of a table without column names and of a SAC file."""
    return "gal" if text.lstrip()[:1].isdigit() else None


def _written() -> list[Sound]:
    """Return files that ObsPy writes."""
    files = []
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "file"
        for encoding in ("FLOAT32", "FLOAT64", "INT32", "STEIM1", "STEIM2"):
            data = wave(700) if encoding.startswith("FLOAT") else counts(700)
            data = data.astype(np.float32) if encoding == "FLOAT32" else data
            write(path, trace(data), reclen=512, encoding=encoding)
            units = None if encoding.startswith("FLOAT") else "1e-6 m/s^2"
            files.append(Sound(f"MSEED {encoding}", path.read_bytes(), units, frozenset({COUNT})))
        for name, data, units, tells in (
            ("SAC", wave(300).astype(np.float32), "m/s^2", {COUNT, STEP, PEAK}),
            ("GSE2", counts(300), "1e-6 m/s^2", {COUNT, ALL}),
            ("SLIST", wave(100), "m/s^2", {COUNT}),
            ("TSPAIR", wave(100), "m/s^2", {COUNT, STEP}),
            ("SH_ASC", wave(100), "m/s^2", {COUNT}),
        ):
            write(path, trace(data), format=name)
            files.append(Sound(name, path.read_bytes(), units, frozenset(tells)))
    return files
