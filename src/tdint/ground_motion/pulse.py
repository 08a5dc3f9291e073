"""Artificial ground motion in closed form, for teaching and for first analyses without a recorded
ground motion."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tdint.arrays import Array
from tdint.units import ACCELERATION

_MAX_TIME_STEP = 0.01  # s; a usual sampling interval of records
_SAMPLES_PER_CYCLE = 40  # minimum number, so that linear interpolation between samples is accurate
_REST, _MIN_DURATION = 5.0, 20.0
"""Rest after the motion and minimum total duration, s; free vibration of a building is then
visible."""


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
        return np.where(is_inside, rate, 0.0)


def motion_text(motion: VelocityPulse, *, unit: str) -> str:
    """Return the text of a record file with an artificial ground motion followed by rest.

    The first line states the time step and the unit, the second line describes the motion. Each
    further line without # contains one sample of the acceleration.

    Parameters
    ----------
    unit : str
        Unit of acceleration of the samples, a key of `tdint.units.ACCELERATION`.
    """
    # The time step is a multiple of 0.1 ms, so that the file states it exactly.
    resolving_step = round(1.0 / (_SAMPLES_PER_CYCLE / motion.period), 4) or 1e-4
    dt = min(_MAX_TIME_STEP, resolving_step)
    duration = max(motion.duration + _REST, _MIN_DURATION)
    times = dt * np.arange(round(duration / dt) + 1, dtype=np.float64)
    samples = motion.acceleration(times) / ACCELERATION[unit]
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
