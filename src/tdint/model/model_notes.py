"""Notes on a model: assumptions that its file does not state."""

from __future__ import annotations

import math

import numpy as np

from tdint.model.definition import ModalDamping, Model
from tdint.number_parsing import abbreviate

POWER_LAW_OMITTED = "power-law dampers are omitted, because their damping depends on the amplitude"
"""Note on damping ratios of a building with power-law dampers."""

_MAX_LISTED = 3
"""Maximum number of names in a note."""


def model_notes(model: Model) -> list[str]:
    """Return notes on a model: the reason for a suppressed plausibility check, rows without mass,
    attachments without an initial motion, and the modes with the last of several modal damping
    ratios."""
    notes = []
    if model.plausibility_off:
        notes.append(f"plausibility warnings are not shown: {model.plausibility_off}")
    if massless := [
        i
        for i, story in enumerate(model.stories)
        if model.matrices is not None and story.mass == 0.0
    ]:
        names = [model.rows[i] if model.rows else f"floor {i + 1}" for i in massless]
        damping = model.matrices.damping if model.matrices is not None else ()
        is_damped = any(np.any(damping[i]) for i in massless) if len(damping) else False
        how = "with their dashpots" if is_damped else "statically"
        notes.append(
            f"without mass: {abbreviate(names, _MAX_LISTED)}; the displacements follow the "
            f"other floors {how}"
        )
    if model.initial.moves and (
        followers := [
            item.name
            for i, item in enumerate(model.attachments)
            if not model.initial.attachments or all(map(math.isnan, model.initial.attachments[i]))
        ]
    ):
        notes.append(
            f"start with the motion of their floors: {abbreviate(followers, _MAX_LISTED)} "
            "(`initial: {attachments: ...}` states another motion)"
        )
    if isinstance(model.damping, ModalDamping):
        ratios, count = model.damping.ratios, len(model.stories)
        if 1 < len(ratios) < count and ratios[-1] > 0.0:
            first = len(ratios) + 1
            modes = f"modes {first} to {count}" if first < count else f"mode {count}"
            notes.append(
                f"the last of {len(ratios)} modal damping ratios, {100.0 * ratios[-1]:g} %, "
                f"applies to {modes}, too"
            )
    return notes
