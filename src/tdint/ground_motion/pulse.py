"""An artificial ground motion in closed form, for a first run of a building that has no record yet."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tdint.units import ACCELERATION

Array = NDArray[np.float64]


@dataclass(frozen=True)
class VelocityPulse:
    """A pulse of the ground's velocity as close to a fault: a cosine under a longer one.

    v(t) = V/2 (1 + cos(omega (t - t0) / gamma)) cos(omega (t - t0) + phase) for |t - t0| <= gamma pi / omega, 0 beyond
    (Mavroeidis and Papageorgiou 2003, eq. 4).

    Attributes
    ----------
    velocity : float
        V, m/s.
    period : float
        2 pi / omega, s.
    cycles : float
        gamma: how many periods the pulse is long.
    phase : float
        rad; pi/2 leaves the ground where it was.
    """

    velocity: float = 0.4
    period: float = 1.2
    cycles: float = 3.0
    phase: float = 0.5 * math.pi

    @property
    def duration(self) -> float:
        """Time that the ground moves, s."""
        return self.cycles * self.period

    def acceleration(self, t: NDArray[np.floating]) -> Array:
        """Acceleration at times from the start of the pulse (s), m/s^2: the derivative of v."""
        omega = 2.0 * math.pi / self.period
        slow = omega / self.cycles
        since = t - 0.5 * self.duration
        envelope, change = 1.0 + np.cos(slow * since), -slow * np.sin(slow * since)
        carrier, turn = np.cos(omega * since + self.phase), -omega * np.sin(omega * since + self.phase)
        inside = np.abs(since) <= 0.5 * self.duration
        return np.asarray(np.where(inside, 0.5 * self.velocity * (change * carrier + envelope * turn), 0.0))


def pulse_text(pulse: VelocityPulse, *, dt: float, duration: float, unit: str) -> str:
    """The pulse, and rest after it, as a text that tdint reads as a record: its step and its unit, a sample a line."""
    times = dt * np.arange(round(duration / dt) + 1, dtype=np.float64)
    samples = pulse.acceleration(times) / ACCELERATION[unit]
    lines = [
        f"# dt = {dt:g} s, units = {unit}",
        f"# An artificial ground motion, no record: a velocity pulse of {pulse.velocity:g} m/s and {pulse.period:g} s",
        "# (Mavroeidis and Papageorgiou 2003, equation 4), and rest.",
        *(f"{sample + 0.0:.7g}" for sample in np.where(np.abs(samples) < 1e-12, 0.0, samples)),
    ]
    return "\n".join(lines) + "\n"
