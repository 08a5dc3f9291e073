"""Artificial ground motions in closed form, for teaching and for first analyses without a recorded
ground motion."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tdint.arrays import Array
from tdint.errors import UsageError
from tdint.number_parsing import parse_named, parse_positive
from tdint.units import ACCELERATION, parse_with_unit

_DT, _SAMPLES_PER_CYCLE = 0.01, 40  # s, maximum time step; minimum samples per cycle
_REST, _SHORTEST = 5.0, 20.0  # s; rest after the motion, minimum total duration
_MOST_TURNS = 100_000  # cycles; more cycles (10^7 samples) indicate a wrong unit


@dataclass(frozen=True)
class VelocityPulse:
    """Near-fault pulse of the ground velocity: a cosine with a cosine-shaped envelope.

    v(t) = V/2 (1 + cos(omega (t - t0) / gamma)) cos(omega (t - t0) + phase) for
    |t - t0| <= gamma pi / omega, otherwise 0 (Mavroeidis and Papageorgiou 2003, eq. 4).

    Attributes
    ----------
    velocity : float
        Amplitude V, m/s.
    period : float
        Period 2 pi / omega, s.
    cycles : float
        Duration gamma of the pulse, periods.
    phase : float
        Phase angle, rad; for pi/2 the final displacement is zero.
    """

    velocity: float = 0.4
    period: float = 1.2
    cycles: float = 3.0
    phase: float = 0.5 * math.pi

    @property
    def duration(self) -> float:
        """Duration of the motion, s."""
        return self.cycles * self.period

    def acceleration(self, t: NDArray[np.floating]) -> Array:
        """Return the acceleration (m/s^2), the derivative of v, at times from the start (s)."""
        omega = 2.0 * math.pi / self.period
        slow = omega / self.cycles
        since = t - 0.5 * self.duration
        envelope, change = 1.0 + np.cos(slow * since), -slow * np.sin(slow * since)
        carrier, turn = (
            np.cos(omega * since + self.phase),
            -omega * np.sin(omega * since + self.phase),
        )
        inside = np.abs(since) <= 0.5 * self.duration
        return np.asarray(
            np.where(inside, 0.5 * self.velocity * (change * carrier + envelope * turn), 0.0)
        )


@dataclass(frozen=True)
class Sweep:
    """Sine with a frequency that changes linearly from `first` to `last` (Hz) during `duration`
    (s), with amplitude `pga` (m/s^2)."""

    first: float
    last: float
    duration: float
    pga: float

    def acceleration(self, t: NDArray[np.floating]) -> Array:
        """Return the acceleration (m/s^2) at times from the start (s); 0 after the duration."""
        turns = self.first * t + 0.5 * (self.last - self.first) * t**2 / self.duration
        inside = (t >= 0.0) & (t <= self.duration)
        return np.asarray(np.where(inside, self.pga * np.sin(2.0 * math.pi * turns), 0.0))


Artificial = VelocityPulse | Sweep
"""Artificial ground motion in closed form."""

EXAMPLES = {
    "sine": "sine:frequency=1.5,duration=20,pga=0.1g",
    "sweep": "sweep:first=0.5,last=10,duration=40,pga=0.1g",
    "pulse": "pulse:period=1.2,velocity=0.4",
}
_PARAMETERS: dict[str, dict[str, bool]] = {
    "sine": {"frequency": True, "duration": True, "pga": True},
    "sweep": {"first": True, "last": True, "duration": True, "pga": True},
    "pulse": {"period": True, "velocity": True, "cycles": False},
}


def parse_motion(text: str) -> Artificial:
    """Parse the text of a sine, a sweep or a pulse.

    Parameters
    ----------
    text : str
        For example `sine:frequency=1.5,duration=20,pga=0.1g`; other examples are in `EXAMPLES`.
        Frequencies are in Hz, times in s and velocities in m/s.

    Raises
    ------
    UsageError
        The name is unknown, or a parameter is missing, unknown or invalid.
    """
    name, _, words = text.partition(":")
    if name not in _PARAMETERS:
        raise UsageError(
            f"artificial ground motion {name[:40]!r} not found; examples of all types: "
            f"{', '.join(EXAMPLES.values())}"
        )
    arguments = parse_named(name, words, _PARAMETERS[name], EXAMPLES[name])
    numbers = {key: parse_positive(key, value) for key, value in arguments.items() if key != "pga"}
    if name == "pulse":
        return VelocityPulse(numbers["velocity"], numbers["period"], numbers.get("cycles", 3.0))
    pga, duration = (
        parse_with_unit(arguments["pga"], "acceleration", "0.1g", "pga"),
        numbers["duration"],
    )
    first, last = (numbers["frequency" if name == "sine" else end] for end in ("first", "last"))
    if not duration * max(first, last) <= _MOST_TURNS:
        raise UsageError(
            f"{name}: the motion must have at most {_MOST_TURNS} cycles, got "
            f"{duration * max(first, last):.4g}"
        )
    return Sweep(first, last, duration, pga)


def motion_text(motion: Artificial, *, unit: str) -> str:
    """Return the text of a record file with a motion followed by rest.

    The first line declares time step and unit. Each further line has one sample.

    Parameters
    ----------
    motion : VelocityPulse or Sweep
        Artificial ground motion.
    unit : str
        Unit of acceleration of the samples.
    """
    fastest = max(motion.first, motion.last) if isinstance(motion, Sweep) else 1.0 / motion.period
    dt = min(_DT, round(1.0 / (_SAMPLES_PER_CYCLE * fastest), 4) or 1e-4)
    duration = max(motion.duration + _REST, _SHORTEST)
    times = dt * np.arange(round(duration / dt) + 1, dtype=np.float64)
    samples = motion.acceleration(times) / ACCELERATION[unit]
    if isinstance(motion, Sweep):
        last = "" if motion.first == motion.last else f" to {motion.last:g}"
        words = (
            f"a sine of {motion.first:g}{last} Hz and {motion.pga:.6g} m/s^2 over "
            f"{motion.duration:g} s"
        )
    else:
        words = (
            f"a velocity pulse of {motion.velocity:g} m/s and {motion.period:g} s\n"
            "# (Mavroeidis and Papageorgiou 2003, equation 4)"
        )
    lines = [
        f"# dt = {dt:g} s, units = {unit}",
        f"# Artificial ground motion, not a record: {words}, followed by rest.",
        *(f"{sample:.7g}" for sample in np.where(np.abs(samples) < 1e-12, 0.0, samples)),
    ]
    return "\n".join(lines) + "\n"
