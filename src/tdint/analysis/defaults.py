"""Defaults, limits and names that the command line tells, too. Nothing is loaded here."""

from __future__ import annotations

DAMPING = 0.05
"""Damping ratio where none is asked for."""

PERIODS = "0.01:10:200"
"""Periods of a spectrum where none are asked for, s."""

DRIFT_PERIODS = "0.2:10:200"
"""Periods of a drift spectrum where none are asked for, s."""

STEPS_PER_PERIOD = 10
"""Steps per period of PEER's sampling; with fewer samples per period the motion between samples
matters."""

MOST_DUCTILE = 1000.0
"""The largest ductility that may be asked for."""

STORY_HEIGHT = 3.5
"""Height of a story where neither it nor the number of stories is given, m."""

HEIGHT_PERIOD = (0.0731, 0.75)
"""a and b of T = a H^b (s, m) where no other relation is given."""


QUANTITIES = {
    "peak-drift": "largest error of a story's peak drift",
    "drift": "error of the drifts (L2 of the history)",
    "displacement": "error of the displacements (L2 of the history)",
    "velocity": "error of the velocities (L2 of the history)",
    "acceleration": "error of the accelerations (L2 of the history)",
}
"""By their names on the command line, what they are: the fields of
`tdint.analysis.chart.problem.Errors`."""

PEAKS = {
    "peak-drift": "largest error of a story's peak drift",
    "peak-absolute-acceleration": "largest error of a floor's peak absolute acceleration",
    "peak-total-shear": "largest error of a story's peak total shear",
}
"""The same of many problems: the fields of `tdint.analysis.chart.profiles.PeakErrors`."""

BETAS = ("1/120", "1/143", "1/144", "1/145", "1/160")
"""Of impulse: the paper's 1/144 and others, with which it is unstable beyond a step."""
