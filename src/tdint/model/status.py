"""Statuses of runs."""

from __future__ import annotations

DONE = "done"
"""Status of a run without collapse of the building."""

FALLEN = ("collapsed", "failed-story")
"""Statuses of runs where the building collapses; they are reported in addition to the damage
states."""

NO_RESULT = ("diverged", "not-converged", "unstable-step", "not-within-tolerance")
"""Statuses of runs without a result."""
