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

_MAX_TIME_STEP = 0.01  # s; a usual sampling interval of records
_SAMPLES_PER_CYCLE = 40  # minimum number, so that linear interpolation between samples is accurate
_REST, _MIN_DURATION = 5.0, 20.0
"""Rest after the motion and minimum total duration, s; free vibration of a building is then
visible."""

_MAX_CYCLES = 100_000  # a motion with more cycles (10^7 samples) indicates a wrong unit


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
        """Return the ground acceleration, m/s^2: the derivative of the velocity v.

        Parameters
        ----------
        t : ndarray
            Times from the start of the pulse, s.
        """
        omega = 2.0 * math.pi / self.period
        envelope_omega = omega / self.cycles
        time = t - 0.5 * self.duration  # from the middle of the pulse
        # The velocity is the product of an envelope and a cosine, so its derivative has two terms.
        envelope = 1.0 + np.cos(envelope_omega * time)
        envelope_rate = -envelope_omega * np.sin(envelope_omega * time)
        cosine = np.cos(omega * time + self.phase)
        cosine_rate = -omega * np.sin(omega * time + self.phase)
        is_inside = np.abs(time) <= 0.5 * self.duration
        rate = 0.5 * self.velocity * (envelope_rate * cosine + envelope * cosine_rate)
        return np.asarray(np.where(is_inside, rate, 0.0))


@dataclass(frozen=True)
class Sweep:
    """Sine with a frequency that changes linearly with time.

    Attributes
    ----------
    first, last : float
        Frequency at the start and at the end, Hz; equal for a sine of constant frequency.
    duration : float
        Duration of the motion, s.
    pga : float
        Amplitude of the acceleration, m/s^2.
    """

    first: float
    last: float
    duration: float
    pga: float

    def acceleration(self, t: NDArray[np.floating]) -> Array:
        """Return the ground acceleration of the sweep, m/s^2: a sine with a frequency that changes
        linearly from `first` to `last`. It is 0 before the start and after the duration.
        """
        # The number of cycles is the integral of the frequency over time.
        cycles = self.first * t + 0.5 * (self.last - self.first) * t**2 / self.duration
        is_inside = (t >= 0.0) & (t <= self.duration)
        return np.asarray(np.where(is_inside, self.pga * np.sin(2.0 * math.pi * cycles), 0.0))


Artificial = VelocityPulse | Sweep
"""Artificial ground motion in closed form."""

EXAMPLES = {
    "sine": "sine:frequency=1.5,duration=20,pga=0.1g",
    "sweep": "sweep:first=0.5,last=10,duration=40,pga=0.1g",
    "pulse": "pulse:period=1.2,velocity=0.4",
}
"""Example of the text of each type of artificial ground motion, for messages and help."""

_PARAMETERS: dict[str, dict[str, bool]] = {
    "sine": {"frequency": True, "duration": True, "pga": True},
    "sweep": {"first": True, "last": True, "duration": True, "pga": True},
    "pulse": {"period": True, "velocity": True, "cycles": False},
}
"""Parameters of each type of artificial ground motion; True for a required parameter."""


def parse_motion(text: str) -> Artificial:
    """Parse the text of a sine, a sweep or a pulse.

    Parameters
    ----------
    text : str
        For example `sine:frequency=1.5,duration=20,pga=0.1g`; other examples are in `EXAMPLES`.
        Frequencies are in Hz, times in s and velocities in m/s.

    Returns
    -------
    VelocityPulse or Sweep
        Artificial ground motion. A sine is a sweep with equal frequencies.

    Raises
    ------
    UsageError
        The name is unknown, or a parameter is missing, unknown or invalid.
    """
    name, _, argument_text = text.partition(":")
    if name not in _PARAMETERS:
        raise UsageError(
            f"artificial ground motion {name[:40]!r} not found; examples of all types: "
            f"{', '.join(EXAMPLES.values())}"
        )
    arguments = parse_named(name, argument_text, _PARAMETERS[name], EXAMPLES[name])
    numbers = {key: parse_positive(key, value) for key, value in arguments.items() if key != "pga"}
    if name == "pulse":
        return VelocityPulse(numbers["velocity"], numbers["period"], numbers.get("cycles", 3.0))
    pga = parse_with_unit(arguments["pga"], "acceleration", "0.1g", "pga")
    duration = numbers["duration"]
    if name == "sine":
        first = last = numbers["frequency"]
    else:
        first, last = numbers["first"], numbers["last"]
    cycles = duration * max(first, last)
    if not cycles <= _MAX_CYCLES:
        raise UsageError(
            f"{name}: the motion must have at most {_MAX_CYCLES} cycles, got {cycles:.4g}"
        )
    return Sweep(first, last, duration, pga)


def motion_text(motion: Artificial, *, unit: str) -> str:
    """Return the text of a record file with an artificial ground motion followed by rest.

    The first line states the time step and the unit, the second line describes the motion. Each
    further line without # contains one sample of the acceleration.

    Parameters
    ----------
    unit : str
        Unit of acceleration of the samples, a key of `tdint.units.ACCELERATION`.
    """
    if isinstance(motion, Sweep):
        max_frequency = max(motion.first, motion.last)
    else:
        max_frequency = 1.0 / motion.period
    # The time step is a multiple of 0.1 ms, so that the file states it exactly.
    resolving_step = round(1.0 / (_SAMPLES_PER_CYCLE * max_frequency), 4) or 1e-4
    dt = min(_MAX_TIME_STEP, resolving_step)
    duration = max(motion.duration + _REST, _MIN_DURATION)
    times = dt * np.arange(round(duration / dt) + 1, dtype=np.float64)
    samples = motion.acceleration(times) / ACCELERATION[unit]
    if isinstance(motion, Sweep):
        last = "" if motion.first == motion.last else f" to {motion.last:g}"
        description = (
            f"a sine of {motion.first:g}{last} Hz and {motion.pga:.6g} m/s^2 over "
            f"{motion.duration:g} s"
        )
    else:
        description = (
            f"a velocity pulse of {motion.velocity:g} m/s and {motion.period:g} s\n"
            "# (Mavroeidis and Papageorgiou 2003, equation 4)"
        )
    # Rounding errors at zeros of the motion are written as 0.
    rounded = np.where(np.abs(samples) < 1e-12, 0.0, samples)
    lines = [
        f"# dt = {dt:g} s, units = {unit}",
        f"# Artificial ground motion, not a record: {description}, followed by rest.",
        *(f"{sample:.7g}" for sample in rounded),
    ]
    return "\n".join(lines) + "\n"
