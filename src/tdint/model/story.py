"""Story of a building with its elements and dashpots."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, NamedTuple

from tdint.model.story_laws import LAWS, LINEAR, Law, of_samples


@dataclass(frozen=True)
class Element:
    """Spring of a story: one of several springs in parallel, each with its own law.

    Attributes
    ----------
    name : str
        Name in tables and parameters, unique within the story.
    stiffness : float
        Initial stiffness, N/m, zero or positive.
    law : Law
        Hysteretic law.
    factor : float
        Cosine of the inclination of the element, in (0, 1]. Stiffness, law and all results are in
        the direction of the drift. The force along the element is the force of the law divided by
        this number, and its deformation is the drift times this number.
    """

    name: str
    stiffness: float
    law: Law
    factor: float = 1.0

    def scale(self, force: int, length: float) -> float:
        """Return the factor from a number along the element to the number in the direction of the
        drift, for the unit force^`force` length^`length`."""
        return float(self.factor ** (force - length))


def is_linear(story: Story) -> bool:
    """Return True if a story has a single linear law and no damper of a power law or with a
    brace."""
    return story.law == LINEAR and not story.elements and story.power_dashpot is None


MAX_STORIES = 100_000
"""Maximum number of stories. Without a limit, a typing error in `repeat` would fill the memory."""


class Relief(NamedTuple):
    """Relief valve of a damper: above the force `force` (N), the slope of its force over its rate
    is `ratio` times its coefficient."""

    force: float
    ratio: float


class PowerDashpot(NamedTuple):
    """Dashpot with the force c v (v^2 + v0^2)^((exponent - 1) / 2) at the drift rate v.

    The force approaches c |v|^exponent for |v| much larger than v0, and a linear dashpot for |v|
    much smaller than v0.

    Attributes
    ----------
    coefficient : float
        c, N (s/m)^exponent, positive.
    exponent : float
        In (0, 2].
    linear_below : float
        v0, m/s; positive if the exponent is less than 1 and there is no brace, otherwise zero or
        positive.
    brace : float | None
        Stiffness of the brace in series with the damper, N/m; v is then the rate of the damper.
        None for a damper without a brace.
    relief : Relief | None
        Relief valve of a linear damper with a brace.
    """

    coefficient: float
    exponent: float
    linear_below: float
    brace: float | None = None
    relief: Relief | None = None


@dataclass(frozen=True)
class Story:
    """Story with the floor above it, and the spring and dashpot that support this floor.

    Attributes
    ----------
    mass : float
        Mass of the floor above, kg, positive.
    height : float | None
        Story height, m, positive; None if the file does not specify it.
    stiffness : float
        Initial stiffness, N/m, positive; of a story with elements, their sum; nan in a model of
        matrices or flexural stories.
    law : Law
        Hysteretic law; SUM_OF_ELEMENTS for a story with several elements.
    dashpot : float
        Viscous damper between the floors, N s/m, zero or positive.
    power_dashpot : PowerDashpot | None
        Power-law damper between the floors.
    isolator : bool
        True for an isolator: its displacement is reported instead of a drift ratio, and its height
        is used for P-delta only.
    rayleigh : bool
        True if Rayleigh damping applies to the story.
    p_delta : bool | None
        True if gravity acts on the displaced story; None for the value of the model.
    elements : tuple of Element
        Elements of a story with several springs in parallel; empty for a story with a single law.
    damper_factor : float
        Cosine of the inclination of the dashpot, in (0, 1]. The deformation of the dashpot with its
        brace is the drift times this number, and so is the story force divided by its force.
    flexural : tuple of float | None
        Bending stiffness EI, N m^2, and shear stiffness GA with the shape factor, N, of a story
        that bends; GA is infinite without shear deformation, EI without bending.
    inertance : float
        Inertance, kg: force of an inerter over the acceleration of the drift; of an attachment,
        over its acceleration relative to the ground.
    rotary_inertia : float
        Rotary inertia of the floor above a flexural story, kg m^2.
    """

    mass: float
    height: float | None
    stiffness: float
    law: Law
    dashpot: float
    power_dashpot: PowerDashpot | None = None
    isolator: bool = False
    rayleigh: bool = True
    elements: tuple[Element, ...] = ()
    damper_factor: float = 1.0
    p_delta: bool | None = None
    flexural: tuple[float, float] | None = None
    inertance: float = 0.0
    rotary_inertia: float = 0.0

    @cached_property
    def springs(self) -> tuple[Element, ...]:
        """The elements, or the law of the story as its single element, without a name."""
        return self.elements or (Element("", self.stiffness, self.law),)

    @property
    def law_text(self) -> str:
        """Name of the law, or the names of the laws of the elements: `bilinear + gap`."""
        return " + ".join(spring.law.name for spring in self.springs)

    @property
    def drift_height(self) -> float | None:
        """Height of the drift ratio, m; None for isolators and for stories without height."""
        return None if self.isolator else self.height


Path = tuple[str | int, ...]
"""Attributes and indices that lead from a story to one of its numbers, such as `mass`, or
`elements`, 2, `law`, `parameters`, 0."""


def story_with_numbers(story: Story, numbers: Mapping[Path, float], is_law_changed: bool) -> Story:
    """Return a story with other numbers.

    The stiffness of a story with elements is the sum of their stiffnesses. If a parameter of the
    law has been changed and the law defines the initial stiffness, the stiffness is computed from
    the parameters. A drift of fracture that is a ratio follows the height.
    """
    if (height := numbers.get(("height",))) is not None:
        fractures: dict[Path, float] = {
            (*(("elements", number) if story.elements else ()), "law", "fracture", side): ratio
            * height
            for number, spring in enumerate(story.springs)
            for side, ratio in enumerate(spring.law.fracture_ratio)
            if ratio
        }
        numbers = {**numbers, **fractures}
    changed: Story = _with_numbers(story, numbers)
    if not (is_law_changed or story.elements):
        return changed
    springs = changed.springs
    if is_law_changed:
        springs = tuple(
            replace(spring, stiffness=of_samples(initial_stiffness, *spring.law.parameters))
            if (initial_stiffness := LAWS[spring.law.name].initial_stiffness)
            else spring
            for spring in springs
        )
    stiffness = sum(spring.stiffness for spring in springs)
    return replace(changed, stiffness=stiffness, elements=springs if story.elements else ())


def _with_numbers(item: Any, numbers: Mapping[Path, float]) -> Any:
    """Return a copy of a story, or of a part of a story, with other numbers."""
    if () in numbers:
        return numbers[()]
    parts: dict[Any, dict[Path, float]] = {}
    for (first, *rest), number in numbers.items():
        parts.setdefault(first, {})[tuple(rest)] = number
    changed = {
        part: _with_numbers(item[part] if isinstance(part, int) else getattr(item, part), of_part)
        for part, of_part in parts.items()
    }
    if not isinstance(item, tuple):
        return replace(item, **changed)
    if hasattr(item, "_replace"):
        return item._replace(**changed)
    return tuple(changed.get(index, part) for index, part in enumerate(item))


def simple_story(
    mass: float, law: Law = LINEAR, *, stiffness: float | None = None, dashpot: float = 0.0
) -> Story:
    """Return a story without height.

    Parameters
    ----------
    stiffness : float, optional
        Initial stiffness, N/m. Default: the stiffness that the law defines.
    dashpot : float
        Coefficient of the dashpot, N s/m.
    """
    if stiffness is None:
        compute_stiffness = LAWS[law.name].initial_stiffness
        assert compute_stiffness is not None, f"the law {law.name} does not define a stiffness"
        stiffness = compute_stiffness(law.parameters)
    return Story(mass=mass, height=None, stiffness=stiffness, law=law, dashpot=dashpot)


def column_name(name: str) -> str:
    """Return the name of an element as a part of the name of a column: `moat wall` is
    `moat_wall`."""
    return re.sub(r"\W+", "_", name).strip("_")


def spring_label(i: int, spring: Element) -> str:
    """Return the name of a spring of the story with index `i` in messages."""
    return f"element {spring.name!r} of story {i + 1}" if spring.name else f"story {i + 1}"
