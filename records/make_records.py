"""Create the ground motions here: python records/make_records.py [DIR] [--geonet DIR]

The artificial motions are computed from the seeds below. The motions of Kaikoura are recorded: with
--geonet they are converted from the files of GeoNet in the directory, with unchanged numbers.
README.md describes the motions.
"""

from __future__ import annotations

import argparse
import hashlib
import warnings
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

with warnings.catch_warnings():
    # obspy loads its plugins through an interface that Python 3.11 deprecates.
    warnings.simplefilter("ignore", DeprecationWarning)
    from obspy import Stream, Trace, UTCDateTime, read

Array = NDArray[np.float64]
Records = dict[str, tuple[str, Callable[[], list[Array]]]]

G = 9.81
"""Gravity for the peaks below, m/s^2."""

START = UTCDateTime(2024, 1, 1)
NETWORK = "TD"


@dataclass(frozen=True)
class Soil:
    """Kanai-Tajimi filter of a soil layer, and Clough-Penzien filter that removes long periods.

    Circular frequencies are in rad/s, damping ratios are fractions of critical damping.
    """

    layer: float
    layer_damping: float
    high_pass: float
    high_pass_damping: float


@dataclass(frozen=True)
class Envelope:
    """Amplitude over time: a parabola up to 1 at `rise` (s), 1 up to `hold` (s), and an exponential
    decrease with the rate `decay` (1/s)."""

    rise: float
    hold: float
    decay: float

    def at(self, time: Array) -> Array:
        """Return the amplitude at `time` (s), between 0 and 1."""
        fading = np.exp(-self.decay * (time - self.hold))
        return np.where(
            time < self.rise, (time / self.rise) ** 2, np.where(time < self.hold, 1.0, fading)
        )


FIRM = Soil(layer=15.0, layer_damping=0.6, high_pass=1.5, high_pass_damping=0.6)
SOFT = Soil(layer=np.pi, layer_damping=0.12, high_pass=0.6, high_pass_damping=0.8)


def sample_times(duration: float, dt: float) -> Array:
    """Return the times of the samples from 0 to `duration`, s."""
    return np.arange(round(duration / dt) + 1) * dt


def filtered_noise(time: Array, soil: Soil, envelope: Envelope, seed: int, peak: float) -> Array:
    """Return white noise, filtered by a soil, times an envelope, scaled to a peak.

    Kanai (1957), Tajimi (1960): the soil layer; Clough and Penzien (1975), section 28-2: the second
    filter.

    Parameters
    ----------
    time : ndarray, shape (n,)
        Times of the samples at equal steps, s.
    soil, envelope : Soil, Envelope
        The filters and the amplitude over time.
    seed : int
        Seed of the noise.
    peak : float
        Largest absolute acceleration, m/s^2.

    Returns
    -------
    ndarray, shape (n,)
        Acceleration, m/s^2; the first sample is zero.
    """
    n, dt = time.size, time[1]
    noise = np.fft.rfft(np.random.default_rng(seed).standard_normal(n), 2 * n)
    omega = 2 * np.pi * np.fft.rfftfreq(2 * n, dt)
    damping = 2j * soil.layer_damping * soil.layer * omega
    layer = (soil.layer**2 + damping) / (soil.layer**2 - omega**2 + damping)
    high_pass = omega**2 / (
        soil.high_pass**2 - omega**2 + 2j * soil.high_pass_damping * soil.high_pass * omega
    )
    motion = np.fft.irfft(noise * layer * high_pass, 2 * n)[:n] * envelope.at(time)
    motion[0] = 0.0
    return motion * (peak / np.abs(motion).max())


def pulse(time: Array, period: float, cycles: float, velocity: float, center: float) -> Array:
    """Return the acceleration of a near-fault velocity pulse.

    Mavroeidis and Papageorgiou (2003), equation 4, with a phase of 90 degrees: velocity and
    displacement are zero before and after.

    Parameters
    ----------
    time : ndarray, shape (n,)
        Times of the samples, s.
    period : float
        Prevailing period of the pulse, s.
    cycles : float
        Number of half cycles, their gamma, greater than 1.
    velocity : float
        Amplitude of the velocity, m/s.
    center : float
        Time of the middle, s.

    Returns
    -------
    ndarray, shape (n,)
        Acceleration, m/s^2.
    """
    omega = 2 * np.pi / period
    phase, slow = omega * (time - center), omega / cycles * (time - center)
    wave = -np.sin(phase)  # cos(phase + 90 degrees)
    slope = -np.cos(phase) * omega
    bell, bell_slope = 1 + np.cos(slow), -np.sin(slow) * omega / cycles
    return np.where(np.abs(slow) <= np.pi, velocity / 2 * (bell_slope * wave + bell * slope), 0.0)


def without_final_velocity(acceleration: Array, shape: Array) -> Array:
    """Subtract a multiple of `shape` (n,) so that the final velocity is zero (trapezoidal rule)."""

    def area(values: Array) -> float:
        return float(values.sum() - 0.5 * (values[0] + values[-1]))

    return acceleration - shape * (area(acceleration) / area(shape))


def firm_soil() -> list[Array]:
    """Return two components of 40 s on firm soil, 0.4 g and 0.32 g."""
    time, envelope = sample_times(40.0, 0.01), Envelope(rise=4.0, hold=20.0, decay=0.15)
    return [
        filtered_noise(time, FIRM, envelope, seed=20240101, peak=0.4 * G),
        filtered_noise(time, FIRM, envelope, seed=20240102, peak=0.32 * G),
    ]


def near_fault() -> list[Array]:
    """Return two components of 30 s near a fault.

    HN1 (normal to the fault) contains a pulse of 2 s, and HN2 (parallel) a small pulse.
    """
    time, envelope = sample_times(30.0, 0.01), Envelope(rise=3.0, hold=12.0, decay=0.3)
    components = []
    for seed, peak, velocity in ((20240201, 0.25 * G, 1.25), (20240202, 0.22 * G, 0.2)):
        noise = filtered_noise(time, FIRM, envelope, seed, peak)
        noise = without_final_velocity(noise, envelope.at(time))
        components.append(
            noise + pulse(time, period=2.0, cycles=2.0, velocity=velocity, center=7.0)
        )
    return components


def soft_soil() -> list[Array]:
    """Return two components of 110 s on soft soil with a period of 2 s, 0.15 g and 0.12 g."""
    time, envelope = sample_times(110.0, 0.01), Envelope(rise=20.0, hold=55.0, decay=0.06)
    components = []
    for seed, peak in ((20240301, 0.15 * G), (20240302, 0.12 * G)):
        noise = filtered_noise(time, SOFT, envelope, seed, peak)
        components.append(without_final_velocity(noise, envelope.at(time)))
    return components


RETROFIT_SOILS = (
    Soil(layer=11.0, layer_damping=0.5, high_pass=2.5, high_pass_damping=0.6),
    Soil(layer=15.0, layer_damping=0.6, high_pass=2.5, high_pass_damping=0.6),
)


def retrofit(number: int) -> list[Array]:
    """Return two components of 14 s, 0.28 to 0.45 g, of a small record of the retrofit example."""
    time, envelope = sample_times(14.0, 0.02), Envelope(rise=2.0, hold=4.0, decay=0.6)
    peaks = ((0.35, 0.30), (0.45, 0.38), (0.28, 0.34), (0.40, 0.33))[(number - 1) % 4]
    components = []
    for seed, peak in enumerate(peaks, start=20240399 + 2 * number):
        soil = RETROFIT_SOILS[(number - 1) % 2]
        noise = filtered_noise(time, soil, envelope, seed, peak * G)
        components.append(without_final_velocity(noise, envelope.at(time)))
    return components


RECORDS = {
    "firm-soil": ("FIRM", firm_soil),
    "near-fault": ("FAULT", near_fault),
    "soft-soil": ("SOFT", soft_soil),
    **{f"retrofit/R{number}": (f"R{number}", partial(retrofit, number)) for number in range(1, 5)},
}
"""Station code, and function that returns components HN1 and HN2 (m/s^2), by file; the sampling
interval is 0.02 s in the directory retrofit, 0.01 s otherwise."""

SUITE = {
    f"retrofit/R{number}": (f"R{number}", partial(retrofit, number)) for number in range(1, 12)
}
"""Eleven pairs for --suite: the records of the retrofit example and seven more."""


@dataclass(frozen=True)
class Recording:
    """File of GeoNet, its SHA-256, and the azimuths of its horizontal components."""

    file: str
    sha256: str
    azimuths: tuple[str, str]


KAIKOURA = {
    "WTMC": Recording(
        "20161113_110259_WTMC_20.V2A",
        "90675296305eee264ea42feafb7e2248222bb3a2ec727b2bd3839efe3bacef64",
        ("N28W", "S62W"),
    ),
    "HSES": Recording(
        "20161113_110300_HSES_20.V2A",
        "45193523c08ed432f67346ec6b8efaf21d9647a6dd3315e18548b51a001d5c4c",
        ("N10E", "N80W"),
    ),
}
"""Recordings in the directory kaikoura by station."""


def write_records(folder: Path, records: Records = RECORDS) -> None:
    """Write artificial motions as MiniSEED files (64-bit floating-point numbers, m/s^2)."""
    for name, (station, make) in records.items():
        delta = 0.02 if name.startswith("retrofit/") else 0.01
        header = {"network": NETWORK, "station": station, "starttime": START, "delta": delta}
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        traces = [
            Trace(data, header | {"channel": f"HN{number}"})
            for number, data in enumerate(make(), start=1)
        ]
        _write(traces, folder / f"{name}.mseed")


def write_recordings(folder: Path, geonet: Path) -> None:
    """Write the recordings of Kaikoura in m/s^2, from GeoNet files in mm/s^2.

    tdint must be installed, since it adds the format of GeoNet to ObsPy.
    """
    folder.mkdir(parents=True, exist_ok=True)
    for station, recording in KAIKOURA.items():
        path = geonet / recording.file
        if hashlib.sha256(path.read_bytes()).hexdigest() != recording.sha256:
            raise SystemExit(f"{path} is not the file from which these motions were created")
        codes = dict(zip((*recording.azimuths, "UP"), ("HN1", "HN2", "HNZ"), strict=True))
        traces = [trace for trace in read(str(path)) if trace.stats.channel in codes]
        for trace in traces:
            header = {"network": "NZ", "station": station, "channel": codes[trace.stats.channel]}
            header |= {"starttime": trace.stats.starttime, "delta": trace.stats.delta}
            trace.stats = Trace(header=header).stats
            # The file prints tenths of a millimeter per second squared.
            trace.data = np.round(trace.data * 10.0) / 1e4
        _write(traces, folder / f"{station}.mseed")


def _write(traces: list[Trace], path: Path) -> None:
    Stream(traces).write(str(path), format="MSEED", encoding="FLOAT64", reclen=4096)


if __name__ == "__main__":
    here = Path(__file__).parent
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", nargs="?", type=Path, default=here)
    parser.add_argument("--geonet", type=Path, help="directory of the GeoNet files")
    parser.add_argument(
        "--suite", action="store_true", help="write eleven pairs of components instead"
    )
    arguments = parser.parse_args()
    write_records(arguments.folder, SUITE if arguments.suite else RECORDS)
    if arguments.geonet:
        write_recordings(arguments.folder / "kaikoura", arguments.geonet)
