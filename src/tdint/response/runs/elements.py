"""Results of the elements of stories with several elements in a run."""

from __future__ import annotations

import numpy as np

from tdint.arrays import Array
from tdint.model.building import element_yield_drifts
from tdint.model.definition import Model
from tdint.response.runs.outcome import ElementPeaks, StoryPeaks

_ROUNDING = 1e-12
"""Dimensionless. Dissipated energy divided by peak force times peak drift, below which it is 0."""


def element_peaks(model: Model, results: Array, stories: StoryPeaks) -> ElementPeaks | None:
    """Return the results of the elements of all stories with several elements in a run; None
    without such stories. `results` is the array of `element_results`."""
    elements = [
        (i, story, j) for i, story in enumerate(model.stories) for j in range(len(story.elements))
    ]
    if not elements:
        return None
    yield_drift = np.array([element_yield_drifts(story)[j] for _, story, j in elements])
    indices = np.array([i for i, _, _ in elements])
    peak_force, energy = results.copy()
    # The difference of work and stored energy of an elastic element is a rounding error.
    energy[np.abs(energy) <= _ROUNDING * peak_force * stories.peak_drift[indices]] = 0.0
    return ElementPeaks(
        peak_force=peak_force,
        dissipated_energy=energy,
        ductility=stories.peak_drift[indices] / yield_drift,
        story=indices + 1,
        element=np.array([story.elements[j].name for _, story, j in elements]),
        law=np.array([story.elements[j].law.name for _, story, j in elements]),
        yield_drift=yield_drift,
    )
