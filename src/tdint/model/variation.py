"""A building with some of its numbers changed: for sweeps, and what a response is sensitive to."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping
from dataclasses import replace

from tdint.errors import UsageError, did_you_mean
from tdint.model.definition import LAWS, Damping, Law, ModalDamping, Model, RayleighRatio, Story

_OF_STORY = re.compile(r"story (\d+)\.(\w+)")


def _mass(story: Story, factor: float) -> Story:
    return replace(story, mass=story.mass * factor)


def _scaled_law(law: Law, factor: float, chosen: Callable[[int, int], bool]) -> Law:
    """The law with the parameters of some dimensions (exponents of force and length) times a factor."""
    own = LAWS[law.name].parameters
    kinds = [*own, *own[-1:] * (len(law.parameters) - len(own))]  # one that is a list comes last
    powers = [(1, -j) if one.many else (one.force, one.length) for j, one in enumerate(kinds, start=2 - len(own))]
    values = zip(law.parameters, powers, strict=True)
    return Law(law.name, tuple(value * factor if chosen(*power) else value for value, power in values))


def _stiffness(story: Story, factor: float) -> Story:
    """With a law that has its own stiffness all of its forces grow alike."""
    own = LAWS[story.law.name].initial_stiffness is not None
    law = _scaled_law(story.law, factor, lambda force, length: force == 1 and (own or length == -1))
    return replace(story, stiffness=story.stiffness * factor, law=law)


def _strength(story: Story, factor: float) -> Story:
    return replace(story, law=_scaled_law(story.law, factor, lambda force, length: (force, length) == (1, 0)))


_FACTORS: Mapping[str, Callable[[Story, float], Story]] = {
    "mass_factor": _mass,
    "stiffness_factor": _stiffness,
    "strength_factor": _strength,
}

PARAMETERS = {
    "damping": "damping ratio, in place of the model's: of both modes of Rayleigh damping, or of all of modal damping",
    "mass_factor": "factor on the masses",
    "stiffness_factor": "factor on the initial stiffnesses; strengths stay, drifts at yield change",
    "strength_factor": "factor on the strengths of the drift laws; stiffnesses stay",
}
"""What can be changed in a building, and what it means; factors also of one story, as `story 3.mass_factor`."""


def check_parameter(name: str) -> None:
    """Raise UsageError for a name that is no parameter of `varied`."""
    found = _OF_STORY.fullmatch(name)
    if name not in PARAMETERS and not (found and found[2] in _FACTORS):
        hint = did_you_mean(name, PARAMETERS)
        names = ", ".join(PARAMETERS)
        raise UsageError(f"no parameter {name!r}{hint}; there are {names}, and factors of one story, `story 3.NAME`")


def check_value(name: str, value: float) -> None:
    """Raise UsageError for a value out of range."""
    if name == "damping":
        if not 0.0 <= value < 1.0:
            raise UsageError(f"{name} must be a ratio from 0 to less than 1, got {value!r}")
    elif not (math.isfinite(value) and value > 0.0):
        raise UsageError(f"{name} must be a positive number, got {value!r}")


def varied(model: Model, changes: Mapping[str, float]) -> Model:
    """A building with some of its numbers changed, the others as they are.

    Parameters
    ----------
    model : Model
        The building.
    changes : mapping of str to float
        Values by name (`PARAMETERS`). What changes with them (modes, drifts at yield, P-delta) follows.

    Raises
    ------
    UsageError
        An unknown name, a value out of range, or nothing that it could act on.
    """
    for name, value in changes.items():
        check_parameter(name)
        check_value(name, value)
        if name == "damping":
            model = replace(model, damping=_damped(model, value))
            continue
        found = _OF_STORY.fullmatch(name)
        stories = [int(found[1]) - 1] if found else range(len(model.stories))
        change = _FACTORS[found[2] if found else name]
        if found and not 0 <= stories[0] < len(model.stories):
            raise UsageError(f"{name}: {model.name} has {len(model.stories)} stories")
        changed = [change(one, value) if i in stories else one for i, one in enumerate(model.stories)]
        if change is _strength and not any(_strength(model.stories[i], 2.0) != model.stories[i] for i in stories):
            raise UsageError(f"{name} has nothing to act on: no such story of {model.name} has a strength")
        model = replace(model, stories=tuple(changed))
    for number, story in enumerate(model.stories, start=1):
        if fault := LAWS[story.law.name].fault(story.stiffness, story.law.parameters):
            raise UsageError(f"{model.name}: story {number} cannot be varied so: {fault}")
    before = dict(model.varied)
    return replace(model, varied=tuple((before | dict(changes)).items()))


def _damped(model: Model, ratio: float) -> Damping:
    match model.damping:
        case RayleighRatio(_, modes):
            return RayleighRatio((ratio, ratio), modes)
        case ModalDamping(ratios):
            return ModalDamping((ratio,) * len(ratios))
    what = "has none" if model.damping is None else "states it by coefficients"
    raise UsageError(f"damping has no ratio to vary: {model.name} {what}")
