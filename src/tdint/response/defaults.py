"""Defaults, limits and names that `--help` shows. This module imports no other module."""

from __future__ import annotations

DAMPING = 0.05
"""Default damping ratio."""

NO_METHOD = "no method specified"
"""Beginning of the note on the default method. It is in every JSON summary; the commands print it
only with --debug, because the method is in their results."""

PERIODS = "0.01:10:200"
"""Default periods of a spectrum, s: minimum, maximum and number."""

DRIFT_PERIODS = "0.2:10:200"
"""Default periods of a drift spectrum, s: minimum, maximum and number."""

STEPS_PER_PERIOD = 10
"""Minimum number of samples per period recommended by PEER. With fewer samples per period the
ground motion between the samples matters."""

MOST_DUCTILE = 1000.0
"""Maximum ductility that can be requested."""

STORY_HEIGHT = 3.5
"""Height of a story, m, if the height and the number of stories are not given."""

HEIGHT_PERIOD = (0.0731, 0.75)
"""Default coefficients a and b of the relation T = a H^b between the fundamental period T (s) and
the height H (m)."""


QUANTITIES = {
    "peak-drift": "maximum error of the peak drifts of the stories",
    "drift": "error of the drifts (L2 of the history)",
    "displacement": "error of the displacements (L2 of the history)",
    "velocity": "error of the velocities (L2 of the history)",
    "acceleration": "error of the accelerations (L2 of the history)",
}
"""Descriptions of the errors by their names on the command line. The names are the fields of
`tdint.assessment.chart.problem.Errors`."""

PEAKS = {
    "peak-drift": "maximum error of the peak drifts of the stories",
    "peak-absolute-acceleration": "maximum error of the peak absolute accelerations of the floors",
    "peak-total-shear": "maximum error of the peak total shears of the stories",
}
"""Descriptions of the errors for many problems: the fields of
`tdint.assessment.chart.performance_profiles.PeakErrors`."""

BETAS = ("1/120", "1/143", "1/144", "1/145", "1/160")
"""Values of beta of `impulse`: 1/144 of the paper, and values with a stability limit."""
