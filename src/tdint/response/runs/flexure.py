"""Moments, rotations and parts of the drifts of flexural stories in a run."""

from dataclasses import dataclass
from typing import Annotated

from tdint.arrays import Array
from tdint.methods.workspace import BASE_ROTATION, MOMENT, TOTAL_BASE_MOMENT, Workspace
from tdint.units import Quantity, quantities


@dataclass(frozen=True, eq=False)
class FlexureValues:
    """Quantities of flexural stories, shape (n,), and of their base, or the errors of these."""

    peak_moment: Annotated[
        Array, Quantity("N*m", "maximum absolute moment at the bottom of the story")
    ]
    peak_rotation: Annotated[
        Array, Quantity("rad", "maximum absolute rotation at the top of the story")
    ]
    peak_drift_without_rotation: Annotated[
        Array,
        Quantity("m", "maximum absolute drift minus rotation at the bottom of the story x height"),
    ]
    peak_shear_drift: Annotated[
        Array, Quantity("m", "maximum absolute part of the drift by shear deformation")
    ]
    peak_bending_drift: Annotated[
        Array,
        Quantity("m", "maximum absolute part of the drift by bending of the story itself"),
    ]
    base_rotation: Annotated[
        float, Quantity("rad", "maximum absolute rotation of the base", shown=("summary",))
    ]
    base_displacement: Annotated[
        float, Quantity("m", "maximum absolute displacement of the base", shown=("summary",))
    ]
    total_base_moment: Annotated[
        float,
        Quantity(
            "N*m",
            "maximum absolute moment of all inertia forces and loads about the base",
            shown=("summary",),
        ),
    ]


FLEXURE_QUANTITIES = quantities(FlexureValues)
"""Quantities of flexural stories and of their base."""


@dataclass(frozen=True, eq=False)
class FlexurePeaks(FlexureValues):
    """Peaks of flexural stories; `errors` are their estimated errors, if they were requested."""

    errors: FlexureValues | None = None


def flexure_peaks(space: Workspace, n: int) -> FlexurePeaks:
    """Return the peaks of flexural stories at the end of a run; `n` is the number of stories."""
    peaks = space.observer_state
    stories = peaks[MOMENT:BASE_ROTATION, :n].copy()
    return FlexurePeaks(*stories, *peaks[BASE_ROTATION : TOTAL_BASE_MOMENT + 1, 0].tolist())
