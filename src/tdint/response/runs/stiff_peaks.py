"""Warning of time steps that do not resolve a story that has become stiffer than initially."""

from __future__ import annotations

import numpy as np

from tdint.model.building import Building, law_column
from tdint.model.definition import Model
from tdint.model.law_checks import tangent_at
from tdint.model.story_laws import LAWS
from tdint.response.runs.outcome import Response
from tdint.response.runs.prepared import MAX_RESOLVED_OMEGA_DT


def stiff_peak_warnings(model: Model, building: Building, response: Response) -> list[str]:
    """Return a warning if the time step does not resolve the motion of smoothly stiffening stories
    at their peak drifts.

    Without stiffening, the initial stiffness decides (`PreparedBuilding`). Contacts, which are
    located or cause a possible excess of the peaks, are excluded.
    """
    initial = building.initial_stiffness
    stiffness = initial.copy()
    for i, story in enumerate(model.stories):
        for spring in story.springs:
            law = LAWS[spring.law.name]
            if law.stiffens(spring.law.parameters) and not law.kinked:
                column = np.array(law_column(spring.law, spring.stiffness))
                peak = float(response.stories.peak_drift[i])
                tangent = max(tangent_at(law, column, side * peak) for side in (1.0, -1.0))
                stiffness[i] += max(tangent - spring.stiffness, 0.0)
    i = int(np.argmax(stiffness - initial))
    is_resolved = building.frequency_bound(stiffness) * response.dt <= MAX_RESOLVED_OMEGA_DT
    if stiffness[i] == initial[i] or is_resolved:
        return []
    times = f"{stiffness[i] / initial[i]:.2g} times as stiff as" if initial[i] else "stiffer than"
    return [
        f"the time step does not resolve the motion near the peak drift of story {i + 1}, "
        f"where the story is {times} initially: use a smaller step"
    ]
