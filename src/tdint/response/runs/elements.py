"""Results of the elements of stories with several elements in a run."""

from dataclasses import dataclass
from typing import Annotated

import numpy as np
from numpy.typing import NDArray

from tdint.arrays import Array, immutable
from tdint.model.building import element_yield_drifts
from tdint.model.definition import Model
from tdint.number_parsing import pluralize
from tdint.response.runs.energy import ENERGY_ROUNDING
from tdint.tabular import WithTable
from tdint.units import Quantity, quantities


@dataclass(frozen=True, eq=False)
class ElementValues:
    """Quantities of the elements of stories with several elements, or their errors; arrays with a
    single value per element.
    """

    peak_force: Annotated[Array, Quantity("N", "maximum absolute force of the element")]
    dissipated_energy: Annotated[Array, Quantity("J", "dissipated by the element since the start")]
    ductility: Annotated[
        Array, Quantity("1", "peak drift of the story divided by the yield drift of the element")
    ]


ELEMENT_QUANTITIES = quantities(ElementValues)
"""Quantities of an element that have an error estimate."""


@immutable
class ElementPeaks(WithTable, ElementValues):
    """Results of the elements of stories with several elements, one value per element.

    Attributes
    ----------
    peak_force : ndarray
        Maximum absolute forces, N.
    dissipated_energy : ndarray
        Energies dissipated since the start, J.
    ductility : ndarray
        Peak drift of the story, up to the fracture of the element, divided by the yield drift of
        the element; nan for an element that does not yield.
    story : ndarray of int
        Numbers of the stories, from 1.
    element, law : ndarray of str
        Names of the elements and of their laws.
    yield_drift : ndarray
        Drifts at first yield, m; nan for an element that does not yield.
    fracture_time : ndarray
        Times of the fractures, s; nan for an element that has not fractured.
    fracture_side : ndarray of str
        `positive` or `negative`; empty for an element that has not fractured.
    """

    story: Annotated[NDArray[np.int64], Quantity("1", "story, numbered from the ground")]
    element: Annotated[NDArray[np.str_], Quantity("text", "name of the element in the model file")]
    law: Annotated[NDArray[np.str_], Quantity("text", "hysteretic law of the element")]
    yield_drift: Array
    fracture_time: Array
    fracture_side: NDArray[np.str_]

    def _headline(self) -> str:
        return f"of {pluralize(len(self.element), 'element')}"


def fracture_sides(drift: Array) -> NDArray[np.str_]:
    """Return the sides of fractures at drifts; empty texts where the drift is 0."""
    return np.asarray(np.array(["", "positive", "negative"])[np.sign(drift).astype(int)])


def element_peaks(model: Model, results: Array, peak_drift: Array) -> ElementPeaks | None:
    """Return the results of the elements of all stories with several elements in a run; None
    without such stories. `results` is the array of `element_results`."""
    elements = [
        (i, story, j) for i, story in enumerate(model.stories) for j in range(len(story.elements))
    ]
    if not elements:
        return None
    yield_drift = np.array([element_yield_drifts(story)[j] for _, story, j in elements])
    indices = np.array([i for i, _, _ in elements])
    peak_force, energy, fracture_time, fracture_drift = results.copy()
    # The difference of work and stored energy of an elastic element is a rounding error.
    energy[np.abs(energy) <= ENERGY_ROUNDING * peak_force * peak_drift[indices]] = 0.0
    return ElementPeaks(
        peak_force=peak_force,
        dissipated_energy=energy,
        ductility=np.where(fracture_drift, np.abs(fracture_drift), peak_drift[indices])
        / yield_drift,
        story=indices + 1,
        element=np.array([story.elements[j].name for _, story, j in elements]),
        law=np.array([story.elements[j].law.name for _, story, j in elements]),
        yield_drift=yield_drift,
        fracture_time=np.where(fracture_drift, fracture_time, np.nan),
        fracture_side=fracture_sides(fracture_drift),
    )
