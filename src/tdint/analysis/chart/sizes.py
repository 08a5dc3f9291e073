"""A building with more or fewer stories, for what methods cost over the number of stories."""

from __future__ import annotations

import math
from dataclasses import replace

from tdint.kernels import layout as at
from tdint.model.building import assemble
from tdint.model.definition import Initial, ModalDamping, Model, RayleighCoefficients, RayleighRatio


def stretched(model: Model, count: int) -> Model:
    """The model with `count` stories: its own ones, each repeated (or left out) so that their pattern stays.

    Rayleigh damping keeps its coefficients. Of modal damping of the first modes those remain that there are. Forces
    and the initial state move with their floors.
    """
    own = len(model.stories)
    if count == own:
        return model
    floors = [i * own // count for i in range(count)]
    damping = model.damping
    if isinstance(damping, RayleighRatio):
        building = assemble(model)
        first = model.stories[0]
        damping = RayleighCoefficients(
            mass=float(building.linear_terms[at.FLOOR_DAMPER, 0] / building.linear_terms[at.MASS, 0]),
            stiffness=float((building.linear_terms[at.STORY_DAMPER, 0] - first.dashpot) / first.stiffness),
        )
    elif isinstance(damping, ModalDamping):
        damping = ModalDamping(damping.ratios[:count])
    forces = tuple(
        replace(force, floor=max(1, math.ceil(force.floor * count / own))) for force in model.excitation.forces
    )
    return replace(
        model,
        stories=tuple(model.stories[i] for i in floors),
        damping=damping,
        excitation=replace(model.excitation, forces=forces),
        initial=Initial(
            tuple(model.initial.displacement[i] for i in floors), tuple(model.initial.velocity[i] for i in floors)
        ),
    )
