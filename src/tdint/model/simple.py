"""Models made from numbers, without a file: for problems that are part of tdint."""

from __future__ import annotations

from collections.abc import Sequence

from tdint.model.definition import Analysis, Excitation, Force, Initial, Law, Model, Story
from tdint.model.laws import LAWS

LINEAR = Law("linear", ())


def simple_story(mass: float, law: Law = LINEAR, *, stiffness: float | None = None, dashpot: float = 0.0) -> Story:
    """A story without height; the stiffness (N/m) may be left out where the law has its own."""
    if stiffness is None:
        own = LAWS[law.name].initial_stiffness
        assert own is not None, f"the law {law.name} has no stiffness of its own"
        stiffness = own(law.parameters)
    return Story(mass=mass, height=None, stiffness=stiffness, law=law, dashpot=dashpot)


def simple_model(
    name: str,
    stories: Sequence[Story],
    *,
    forces: Sequence[Force] = (),
    displacement: Sequence[float] = (),
    velocity: Sequence[float] = (),
) -> Model:
    """A model without ground motion, damping and P-delta; it starts at rest where nothing else is said (m, m/s)."""
    rest = (0.0,) * len(stories)
    return Model(
        name=name,
        source=name,
        text=b"",
        stories=tuple(stories),
        damping=None,
        p_delta=False,
        excitation=Excitation(None, tuple(forces)),
        initial=Initial(tuple(displacement) or rest, tuple(velocity) or rest),
        analysis=Analysis(None, None, None),
        collapse_drift=1.0,
    )
