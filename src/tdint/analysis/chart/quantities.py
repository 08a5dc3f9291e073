"""The errors that a chart may show. Nothing is loaded here."""

from __future__ import annotations

QUANTITIES = {
    "peak-drift": "largest error of a story's peak drift",
    "drift": "error of the drifts (L2 of the history)",
    "displacement": "error of the displacements (L2 of the history)",
    "velocity": "error of the velocities (L2 of the history)",
    "acceleration": "error of the accelerations (L2 of the history)",
}
"""By their names on the command line, what they are: the fields of `tdint.analysis.chart.reference.Errors`."""
