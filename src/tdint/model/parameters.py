"""Parameters of a building that can be changed by name."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from functools import lru_cache
from typing import Any, NamedTuple

from tdint.errors import UsageError, did_you_mean, nearest
from tdint.kernels.laws.law import LawParameter
from tdint.model.story import Path, Story
from tdint.model.story_laws import LAWS, Law, named_parameters
from tdint.number_parsing import pluralize
from tdint.units import MASS, OutputUnits, compound_unit, compound_units

_POWER_DASHPOT: dict[str, Path] = {
    f"dashpot.{key}": ("power_dashpot", *key.split("."))
    for key in (
        *("coefficient", "exponent", "linear_below", "brace"),
        *("relief.force", "relief.ratio"),
    )
}
"""Numbers of a power-law dashpot by their keys in a model file."""

_STORY_KEYS = ("mass", "height", "stiffness", "dashpot", *_POWER_DASHPOT)

_FACTOR_NAMES = ("mass_factor", "stiffness_factor", "strength_factor")

_STORY_PARAMETER = r"(?:stories(?:\[(\d+)\])?|story (\d+))\.(\w.*)"
"""Pattern of a parameter of stories. Its groups are the number of the story in `stories[3].mass`,
the number in `story 3.mass` (both None for all stories), and the key of the parameter."""

_DEVICE_PARAMETER = r"((?:attachments|links)\[[^\]]+\])\.(\w.*)"
"""Pattern of a parameter of an attachment or a link. Its groups are the label of the spring, such
as `links[damper]` (`Model.springs`), and the key of the parameter."""

_ELEMENT_PARAMETER = r"elements\[[^\]]+\]\.\w"
"""Pattern of the start of the key of a parameter of an element, such as
`elements[bearings].yield_force`."""

_ELEMENT_NUMBER = r"elements\[\d+\]"
"""Pattern of the start of the key of a parameter of an element that is given by its number."""


_POWERS: dict[str, tuple[float, float, float]] = {
    "height": (0, 1, 0),
    "stiffness": (1, -1, 0),
    "brace": (1, -1, 0),
    "dashpot": (1, -1, 1),
    "linear_below": (0, 1, -1),
    "force": (1, 0, 0),
}
"""Powers of force, length and time in the units of the numbers of a story, except masses, by the
names of their attributes."""


class Change(NamedTuple):
    """Change of a single number of a story by a parameter.

    Attributes
    ----------
    story : int
        Index of the story, or of the spring of an attachment or a link (`Model.springs`).
    path : tuple of str or int
        Attributes and indices that lead from the story to the number.
    factor : bool
        The value is a factor on the number, otherwise its new value.
    bounds : LawParameter, optional
        Declaration of the parameter with its bounds.
    follows : tuple of tuple
        Not empty if the number is not named by the parameter, but follows it by default: the model
        does not state a separate value (for the negative side of a law). The paths lead
        to this number and to numbers between both; it does not follow if such a number is set.
    scale : float
        Number of the story divided by the value, which is a number along an inclined element.
    """

    story: int
    path: Path
    factor: bool = False
    bounds: LawParameter | None = None
    follows: tuple[Path, ...] = ()
    scale: float = 1.0

    def number(self, stories: Sequence[Story]) -> float:
        """Return the number in the stories of a building; nan for an attribute that is `None`."""
        item: Any = stories[self.story]
        for part in self.path:
            if item is None:
                return math.nan
            item = item[part] if isinstance(part, int) else getattr(item, part)
        return math.nan if item is None else float(item)

    def is_superseded(self, set_by_name: set[tuple[int, Path]]) -> bool:
        """Return True if the number follows another number, but has been set by its name before.

        A number that this change sets by its name is added to `set_by_name`: index of the story and
        path of each number.
        """
        if self.follows:
            return any((self.story, path) in set_by_name for path in self.follows)
        if not self.factor:
            set_by_name.add((self.story, self.path))
        return False

    def unit(self, springs: Sequence[Story], named: OutputUnits) -> tuple[str, Mapping[str, float]]:
        """Return the unit of the value in a system of units, and all its units with their factors
        to SI units; an empty text and mapping for a factor or a ratio."""
        last = self.path[-1]
        if last == "mass" and not self.factor:
            return named.mass, MASS
        story = springs[self.story]
        powers = _POWERS.get(str(last), (0, 0, 0))
        if last == "coefficient" and story.power_dashpot:
            powers = (1, -story.power_dashpot.exponent, story.power_dashpot.exponent)
        elif isinstance(last, int):
            spring = story.springs[int(self.path[1]) if self.path[0] == "elements" else 0]
            _, force, length, _ = named_parameters(spring.law)[last]
            powers = (force, length, 0)
        if self.factor:
            powers = (0, 0, 0)
        return compound_unit(named.force, named.length, *powers), compound_units(*powers)

    @property
    def sets_law_parameter(self) -> bool:
        """True if the change sets a number of an element or of the law, which may define the
        stiffness."""
        return self.path[0] in ("elements", "law") and not self.factor

    def check(self, name: str, value: float) -> None:
        """Raise UsageError if a value is outside the bounds that the law declares."""
        bounds = self.bounds or LawParameter(name)  # by default without bounds
        low, high = bounds.low, bounds.high
        is_inside = low < value < high
        is_allowed_bound = (value == low and bounds.low_allowed) or (
            value == high and bounds.high_allowed
        )
        if not (is_inside or is_allowed_bound):
            raise UsageError(f"{name} must be between {low:g} and {high:g}, got {value:.6g}")


def _followed_name(law: Law, name: str, declaration: LawParameter) -> str:
    """Return the number of a law that is the default of another number; "" without such a number.

    For `negative.backbone[1].drift` it is `backbone[1].drift`.
    """
    if not isinstance(declaration.default, str):
        return ""
    # The default is the first parameter with this name (`stories.read_law`).
    source = next(item for item in LAWS[law.name].parameters if item.name == declaration.default)
    return source.path + name.removeprefix(declaration.path)


def _changes_by_parameter(i: int, story: Story) -> dict[str, list[Change]]:
    """Return the changes of the story with index `i` by each parameter, by the name of the
    parameter. The list is empty for a parameter that cannot be changed.

    If a law defines the stiffness, a factor on the stiffness multiplies all forces of the law.
    """
    changes: dict[str, list[Change]] = {
        "mass_factor": [Change(i, ("mass",), factor=True)] if story.mass else [],
        "stiffness_factor": [],
        "strength_factor": [],
        "mass": [Change(i, ("mass",))] if story.mass else [],
        "height": [] if story.height is None else [Change(i, ("height",))],
        "stiffness": [],
        "dashpot": [] if story.power_dashpot else [Change(i, ("dashpot",))],
    }
    for key, path in _POWER_DASHPOT.items():
        if not math.isnan(Change(0, path).number([story])):
            changes[key] = [Change(i, path)]
    for number, spring in enumerate(story.springs, start=1):
        to_spring: Path = ("elements", number - 1) if story.elements else ()
        has_stiffness = LAWS[spring.law.name].initial_stiffness is not None
        changes["stiffness_factor"].append(Change(i, (*to_spring, "stiffness"), factor=True))
        if story.stiffness and not (has_stiffness or story.elements):
            changes["stiffness"].append(Change(i, ("stiffness",)))
        # An element has two prefixes: its number, counted from 1, and its name. The law of a story
        # is its first element.
        prefixes = f"elements[{number}]", f"elements[{spring.name}]" if story.elements else "law"
        for prefix in prefixes:
            if prefix != "law" and not has_stiffness:
                bounds, scale = LawParameter("stiffness", low=0.0), spring.scale(1, -1)
                change = Change(i, (*to_spring, "stiffness"), bounds=bounds, scale=scale)
                changes[f"{prefix}.stiffness"] = [change]
        values = spring.law.values
        paths: dict[str, Path] = {}
        sources: dict[str, str] = {}
        for k, (name, force, length, declaration) in enumerate(named_parameters(spring.law)):
            paths[name] = path = (*to_spring, "law", "parameters", k)
            if name not in values:
                continue
            change = Change(i, path, bounds=declaration, scale=spring.scale(force, length))
            sources[name] = source = _followed_name(spring.law, name, declaration)
            for prefix in prefixes:
                changes[f"{prefix}.{name}"] = [change]
            # A number with another number as its default changes as well, if it is equal. This
            # number can also be the default of another number.
            follows: tuple[Path, ...] = (path,)
            while source in values and values[source] == values[name]:
                for prefix in prefixes:
                    changes[f"{prefix}.{source}"].append(change._replace(follows=follows))
                follows, source = (*follows, paths[source]), sources[source]
            # Factors apply to all numbers with the dimension of a stiffness or of a strength
            # (force). The points of a curve move along the line of the initial stiffness.
            if force == 1 and (has_stiffness or length == -1):
                changes["stiffness_factor"].append(Change(i, path, factor=True))
            if (force, length) == (1, 0) or declaration.open_ended:
                changes["strength_factor"].append(Change(i, path, factor=True))
    return changes


@lru_cache(maxsize=64)  # all samples of a study change the same parameters
def changes_of(building: str, springs: tuple[tuple[str, Story], ...], name: str) -> list[Change]:
    """Return the changes of the values of springs that a parameter causes; empty for `damping`.

    Parameters
    ----------
    building : str
        Name of the building, for messages.
    springs : tuple of (str, Story)
        Labels and springs of the stories, attachments and links (`Model.springs`).
    name : str
        Name of the parameter, as for `Model.replace`.

    Raises
    ------
    UsageError
        The name is unknown, the story or device does not exist, or it does not have the parameter.
    """
    check_parameter(name)
    if name == "damping":
        return []
    # `stories[3]`, as in model files, and `story 3`, as in messages, are equivalent. Without a
    # number, the parameter applies to all stories.
    story_match = re.fullmatch(_STORY_PARAMETER, name)
    number, key = None, name
    if story_match:
        number, key = story_match[1] or story_match[2], story_match[3]
    device_match = re.fullmatch(_DEVICE_PARAMETER, name)
    labels = [label for label, _ in springs]
    if device_match:
        label, key = device_match.groups()
        if label not in labels:
            devices = [label for label in labels if not label.startswith("stories")]
            hint = did_you_mean(label, devices)
            raise UsageError(
                f"{name}: {label} not found in {building}{hint} (available: "
                f"{', '.join(devices) or 'no attachments and links'})"
            )
        indices, place = [labels.index(label)], f"{label} of {building}"
    else:
        count = sum(label.startswith("stories") for label in labels)
        if number and not 1 <= int(number) <= count:
            hint = "" if int(number) else "; counting starts at 1"
            raise UsageError(
                f"{name}: story not found; {building} has {pluralize(count, 'story')}{hint}"
            )
        indices = [int(number) - 1] if number else [*range(count)]
        place = f"story {number} of {building}" if number else ""
    changes_by_story = [_changes_by_parameter(i, springs[i][1]) for i in indices]
    changes = [change for by_name in changes_by_story for change in by_name.get(key, ())]
    if changes:
        return changes
    if key == "strength_factor":
        raise UsageError(
            f"{name} has no effect: the law of {place or f'every story of {building}'} has no "
            "strength; use a law with a strength, or change another parameter"
        )
    available: dict[str, None] = {}
    for story_changes in changes_by_story:
        available |= dict.fromkeys(
            parameter for parameter, numbers in story_changes.items() if numbers
        )
    # An element is listed by its name only.
    names = [parameter for parameter in available if not re.match(_ELEMENT_NUMBER, parameter)]
    story_has_no = f"{place} has no" if place else f"no story of {building} has a"
    hint = "; counting starts at 1" if key.startswith("elements[0]") else did_you_mean(key, names)
    raise UsageError(
        f"{name}: {story_has_no} parameter {key!r} that can be changed{hint} "
        f"(available parameters: {', '.join(names)})"
    )


PARAMETERS = {
    "damping": "damping ratio that replaces the ratio of the model: of both modes of Rayleigh "
    "damping, or of all modes of modal damping",
    "mass_factor": "factor on the masses",
    "stiffness_factor": "factor on the initial stiffnesses; strengths are unchanged, yield drifts "
    "change",
    "strength_factor": "factor on the strengths of the hysteretic laws; stiffnesses are unchanged",
}
"""Parameters of the complete building, with their descriptions."""


def parameter_meaning(name: str) -> str:
    """Return the description of a parameter of the building or of its stories."""
    key = name
    for pattern in (_STORY_PARAMETER, _DEVICE_PARAMETER):
        if match := re.fullmatch(pattern, name):
            key = match.groups()[-1]
    return PARAMETERS.get(key, f"{key} of the model file")


def check_parameter(name: str) -> None:
    """Raise UsageError if a name cannot be a parameter of `Model.replace` for any model.

    The names of the parameters of a law are not checked.
    """
    device_match = re.fullmatch(_DEVICE_PARAMETER, name)
    story_match = re.fullmatch(_STORY_PARAMETER, name)
    key = story_match[3] if story_match else device_match[2] if device_match else ""
    if name in PARAMETERS or key in _STORY_KEYS or key in _FACTOR_NAMES:
        return
    if key.startswith("law.") or re.match(_ELEMENT_PARAMETER, key):
        return
    similar_key = nearest(key, (*_STORY_KEYS, *_FACTOR_NAMES)) if key else None
    # The hint is the name with its key, which is at the end of the name, replaced.
    hint = (
        f"; did you mean {name[: -len(key)] + similar_key!r}?"
        if similar_key
        else did_you_mean(name, PARAMETERS)
    )
    names = ", ".join(PARAMETERS)
    raise UsageError(
        f"unknown parameter {name!r}{hint}; available: {names}, and parameters of one story, "
        "`stories[3].NAME`, attachment or link, `attachments[tmd].NAME`"
    )


def check_value(name: str, value: float) -> None:
    """Raise UsageError if a value is outside the range that follows from its name."""
    is_law_parameter = ".law." in name or ".elements[" in name
    if name == "damping":
        is_valid, allowed = 0.0 <= value < 1.0, "a ratio from 0 to less than 1"
    elif name.endswith((".dashpot", ".linear_below")):
        is_valid, allowed = value >= 0.0, "zero or a positive number"
    elif name.endswith("dashpot.exponent") and 2.0 < value < math.inf:
        # The last branch checks smaller exponents, which must be positive.
        is_valid, allowed = False, "in (0, 2]"
    elif is_law_parameter:
        is_valid, allowed = True, "a number"
    else:
        is_valid, allowed = value > 0.0, "a positive number"
    if not (is_valid and math.isfinite(value)):
        raise UsageError(f"{name} must be {allowed}, got {value!r}")
