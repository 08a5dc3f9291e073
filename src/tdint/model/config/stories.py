"""Read the `stories` of a model file and their hysteretic laws.

The value of `law` is the name of a law, or a mapping with `type` and the parameters of the law in
`LAWS`."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from dataclasses import replace
from typing import NamedTuple

from tdint.kernels.laws import OTHER_NAMES, UNAVAILABLE
from tdint.kernels.laws.law import DriftLaw, LawParameter
from tdint.model import story_laws
from tdint.model.config.directions import OF_SPRINGS, OF_STORY, with_directions
from tdint.model.config.keys import keys
from tdint.model.config.sections import ModelUnits, read_inertia
from tdint.model.keys.fields import (
    ANY,
    DRIFT_BOUNDS,
    NOT_NEGATIVE,
    POSITIVE,
    Bounds,
    Choice,
    Either,
    EntriesOf,
    Flag,
    Integer,
    Key,
    Keys,
    Schema,
    Section,
    Value,
    ValueType,
)
from tdint.model.story import MAX_STORIES, Element, PowerDashpot, Relief, Story, column_name
from tdint.model.story_laws import LAWS, Law
from tdint.number_parsing import pluralize
from tdint.units import MASS, STANDARD_GRAVITY

_SIDES = ("positive", "negative")
_DRIFT = Either((POSITIVE, DRIFT_BOUNDS))
(FRACTURE,) = keys(
    "fracture",
    fracture_drift=Either((_DRIFT, Keys(tuple(Key(name, _DRIFT) for name in _SIDES)))),
)
"""Key of every law and element."""


def read_fracture(
    value: Value, law: Law, stiffness: float, unit: ModelUnits, height: float | None
) -> Law:
    """Return a law with the drifts of its fracture: one drift for both sides, or a mapping of the
    sides.

    Parameters
    ----------
    value : Value
        Mapping of the law or of the element.
    stiffness : float
        Initial stiffness, N/m.
    height : float | None
        Height of the story, m.
    """
    entry = value.peek(FRACTURE.name)
    if entry is None:
        return law
    if not entry.is_mapping:
        sides: list[Value | None] = [entry, entry]
    elif section := entry.section(list(_SIDES)):
        sides = [section.get(name) for name in _SIDES]
    else:
        return law
    drifts = [side and _read_drift(side, law, stiffness, unit, height) for side in sides]
    (positive, ratio), (negative, negative_ratio) = (drift or (0.0, 0.0) for drift in drifts)
    if math.isnan(positive + negative):
        return law
    return replace(law, fracture=(positive, -negative), fracture_ratio=(ratio, -negative_ratio))


def _read_drift(
    entry: Value, law: Law, stiffness: float, unit: ModelUnits, height: float | None
) -> tuple[float, float]:
    """Return a drift, m (nan after an error), and its ratio to the height, 0 for a length."""
    ratio = 0.0
    if not entry.is_percentage:
        drift = entry.number(POSITIVE, unit.length)
    elif height is None:
        entry.fault("needs the height of the story, or give a drift in the unit of length")
        return math.nan, ratio
    else:
        # A story height is not divided by the cosine of an inclined element.
        ratio = entry.number(DRIFT_BOUNDS)
        drift = ratio * height
    first_yield = LAWS[law.name].yield_drift(stiffness, law.parameters)
    if drift < first_yield:
        entry.fault(
            f"must be at least the yield drift {first_yield / unit.length:.6g}, got "
            f"{drift / unit.length:.6g}"
        )
    return drift, ratio


Group = Section | float | None
"""Values of a group of parameters: a section with an entry per parameter, one number in SI units
for all parameters; None if the file omits the group."""

EarlierParameters = Mapping[str, tuple[float, ...]]
"""Parameters that have already been read, by name."""

_NUMBER_LIST = "a list of numbers"


def _law_keys(law: DriftLaw, group: str = "") -> tuple[Key, ...]:
    """Return the keys of the mapping of a law, or of the mapping of one of its groups.

    A parameter with `group` "pinching.force" is a key of the mapping `force`, which is the value of
    a key of the mapping `pinching`, which is the value of a key of the law.
    """
    keys: dict[str, Key] = {}
    for parameter in law.parameters:
        # A parameter is optional if it has a default, or a value (`without`) that applies if the
        # file omits its group.
        is_needed = parameter.default is None and parameter.without is None
        inner_group, bounds = _inner_group(parameter, group), bounds_of(parameter)
        if parameter.group == group:
            value_type: ValueType = EntriesOf(bounds, least=1) if parameter.many else bounds
            if parameter.points:
                value_type = EntriesOf(
                    EntriesOf(bounds, least=2, most=2),
                    least=parameter.least_points,
                    most=parameter.points,
                )
            if parameter.choices:
                value_type = Choice(parameter.choices)
            keys[parameter.name] = Key(parameter.name, value_type, needed=is_needed)
        elif inner_group and inner_group not in keys:
            mapping: ValueType = Keys(
                _law_keys(law, f"{group}.{inner_group}" if group else inner_group)
            )
            forms = (bounds, mapping, Choice(("none",)))
            keys[inner_group] = Key(
                inner_group, Either(forms) if parameter.shared else mapping, needed=is_needed
            )
    return tuple(keys.values())


def _inner_group(parameter: LawParameter, group: str) -> str:
    """Return the key of the mapping of `group` that contains a parameter of an inner group.

    For the parameter group "a.b.c" the result is "b" in the group "a", and "a" in the group "" (the
    mapping of the law). The result is empty if the parameter is not in an inner group.
    """
    prefix = f"{group}." if group else ""
    return (
        parameter.group[len(prefix) :].split(".")[0] if parameter.group.startswith(prefix) else ""
    )


_COSINE = Bounds(0.0, 1.0, low_allowed=False)
_ANGLE = Bounds(0.0, 90.0, high_allowed=False)  # degrees
_INCLINATION = keys("inclination", factor=_COSINE, angle=_ANGLE)
"""Keys of an inclined dashpot or element."""


class _LawType(NamedTuple):
    """Type of a mapping with the type of a law, its parameters and further keys.

    Attributes
    ----------
    keys : tuple of Key
        Further keys.
    is_name_allowed : bool
        True if the name of a law without parameters may replace the mapping.
    """

    keys: tuple[Key, ...] = ()
    is_name_allowed: bool = False

    def schema(self) -> Schema:
        """Return the JSON schema: a mapping for each law."""
        types: list[ValueType] = [
            Keys(
                (
                    Key("type", Choice((law.name,)), law.formula, True),
                    *self.keys,
                    FRACTURE,
                    *_law_keys(law),
                )
            )
            for law in story_laws.laws().values()
        ]
        if self.is_name_allowed:
            names = (name for name, law in story_laws.laws().items() if not law.parameters)
            types.insert(0, Choice(tuple(names)))
        return Either(tuple(types)).schema()


LAW = _LawType(is_name_allowed=True)
_ELEMENT_KEYS = (*keys("element"), *_INCLINATION)
_ATTRIBUTES = tuple(key for key in keys("element") if key.name not in ("name", "stiffness"))
"""Keys of further attributes of an element, with the names of fields of `Element`."""
ELEMENTS = EntriesOf(
    Either((_LawType(_ELEMENT_KEYS), Keys((*_ELEMENT_KEYS, Key("law", LAW, needed=True))))),
    least=1,
)


def read_law(value: Value | None, unit: ModelUnits) -> tuple[story_laws.Law, float | None]:
    """Return a law, and its initial stiffness (N/m) if the parameters of the law determine it.

    The stiffness is `None` if the parameters do not determine it, so that the key `stiffness` of
    the story is required. It is nan after an error.

    Parameters
    ----------
    value : Value | None
        Value of the key `law`; None for a linear story.
    """
    if value is None:
        return story_laws.LINEAR, None
    if value.is_list:
        value.fault(
            "must be a law, got a list; several laws in one story are written as "
            "`elements: [{type: ..., stiffness: ...}, ...]`"
        )
        return story_laws.LINEAR, math.nan
    law, section = _read_law_type(value)
    if law is None:
        return story_laws.LINEAR, math.nan
    parameters = _read_parameters(section, law, unit) if section else ()
    result = story_laws.Law(law.name, parameters)
    if law.initial_stiffness is None:
        return result, None

    # The initial stiffness follows from the parameters, unless a parameter has an error. It may be
    # invalid although each parameter is valid.
    is_known = parameters and not any(map(math.isnan, parameters))
    stiffness = law.initial_stiffness(parameters) if is_known else math.nan
    # A law that stiffens may start without stiffness, next to a dashpot or in a chain with masses.
    is_without = stiffness == 0.0 and law.stiffens(parameters)
    if (stiffness <= 0.0 and not is_without) or stiffness == math.inf:
        stiffness_text = f"{stiffness / unit.factor(force=1, length=-1):.10g}"
        value.fault(
            f"the initial stiffness of the {law.name} law must be a positive number, got "
            f"{stiffness_text}"
        )
        return result, math.nan
    return result, stiffness


def _read_law_type(
    value: Value, *further_keys: str, attributes: tuple[Key, ...] = ()
) -> tuple[DriftLaw | None, Section | None]:
    """Return the law and the section with its parameters.

    The law is `None` after an error. The section is `None` if the value is only the
    name of the law. The section can contain `further_keys`, and `attributes` with their types.
    """
    # The name without parameters is valid only if the law has no parameters.
    if not value.is_mapping:
        name = _law_name(value)
        if name and story_laws.LAWS[name].parameters:
            required_names = (
                item.name
                for item in story_laws.LAWS[name].parameters
                if item.default is None and item.without is None
            )
            names = ", ".join(f"{item}: ..." for item in required_names)
            value.fault(f"the {name} law requires parameters; write {{type: {name}, {names}}}")
        return (story_laws.LAWS[name] if name else None), None
    law_type = value.peek("type")
    name = _law_name(law_type) if law_type else None
    # After an error in the name, the keys of all laws are allowed, so that no correct key is
    # reported as unknown.
    possible_laws = [story_laws.LAWS[name]] if name else story_laws.LAWS.values()
    allowed_keys = ["type", FRACTURE.name, *further_keys]
    for law in possible_laws:
        allowed_keys += [_inner_group(item, "") or item.name for item in law.parameters]
    declared = (*(Key(key, ANY) for key in dict.fromkeys(allowed_keys)), *attributes)
    keys = Keys(declared, other_names=story_laws.LAWS[name].other_keys if name else ())
    section = value.section(keys)
    if section:
        section.need("type", f"give one of {', '.join(story_laws.LAWS)}")
    return (story_laws.LAWS[name] if name else None), section


def _law_name(value: Value) -> str | None:
    """Return the name of a law; None after reporting an error."""
    # For a built-in law, the installed packages, which may contain more laws, are not searched.
    candidates = story_laws.LAWS if any(map(value.is_word, story_laws.LAWS)) else story_laws.laws()
    for name, reason in UNAVAILABLE.items():
        if value.is_word(name):
            value.fault(reason)
            return None
    return value.choice(candidates, "law", _advice)


def _advice(text: str) -> str:
    """Return the end of the message about a law with another name; empty for an unknown name."""
    name = re.sub(r"[^a-z0-9]", "", text.casefold())
    return f"; write {OTHER_NAMES[name]}" if name in OTHER_NAMES else ""


def _read_parameters(section: Section, law: DriftLaw, unit: ModelUnits) -> tuple[float, ...]:
    """Return the parameters in SI units in the order of the law, with lists flattened.

    A parameter may be in a group, which is a mapping inside the section. Its name is a path with
    dots, and "" is the complete section. A parameter of several points is a list of pairs. After an
    error, which is added to the errors of the file, the values of a parameter are nan.
    """
    # Sort the groups by depth: an outer group must be read before its inner groups.
    names = sorted(
        dict.fromkeys(parameter.group for parameter in law.parameters),
        key=lambda name: name.count("."),
    )
    groups: dict[str, Group] = {"": section}
    for name in names:
        groups[name] = _read_group(groups, law, name, unit)
    values: list[float] = []
    earlier: dict[str, tuple[float, ...]] = {}
    for parameter in law.parameters:
        numbers = _read_parameter(groups[parameter.group], parameter, unit, earlier)
        values += numbers
        # The default of a parameter may be an earlier parameter. If parameters of several groups
        # have the same name, the first of them is the default.
        earlier.setdefault(parameter.name, numbers)
    return tuple(values)


def _read_group(groups: Mapping[str, Group], law: DriftLaw, group: str, unit: ModelUnits) -> Group:
    """Return the values of a group of parameters in the mapping of a hysteretic law: its section,
    one number for all parameters (nan after an error), or None if the group or its outer group is
    omitted.

    `groups` contains the outer groups that have been read; "" is the section of the law.
    """
    outer, _, name = group.rpartition(".")
    outer_values = groups.get(outer)
    # If the outer group is omitted or is a number, the same applies to its inner groups.
    if not group or not isinstance(outer_values, Section):
        return outer_values
    parameters = [parameter for parameter in law.parameters if parameter.group == group]
    # A group is required if its parameters have no default. The declarations of all parameters of a
    # group agree in this respect, so the first parameter represents the group.
    if parameters[0].default is None and parameters[0].without is None:
        value = outer_values.need(
            name,
            f"give a mapping with the keys {', '.join(parameter.name for parameter in parameters)}",
        )
        if value is None:
            return math.nan
    value = outer_values.get(name)
    if value is None or (parameters[0].shared and value.is_word("none")):
        return None
    keys = [key.name for key in _law_keys(law, group)]
    # A single number sets all parameters of a shared group.
    if parameters[0].shared and not value.is_mapping:
        expected = (
            f"{bounds_of(parameters[0])} for all of {', '.join(keys)}, a mapping of them, or none"
        )
        return value.number(
            bounds_of(parameters[0]),
            unit.factor(parameters[0].force, parameters[0].length),
            expected,
        )
    return value.section(keys) or math.nan


def _read_parameter(
    group: Group, parameter: LawParameter, unit: ModelUnits, earlier: EarlierParameters
) -> tuple[float, ...]:
    """Return the numbers of a parameter in SI units, its default if it is omitted, or nan after an
    error.

    `earlier` contains the parameters that have already been read, in SI units.
    """
    unknown = (math.nan,) * (2 * parameter.points or 1)
    # The file specifies one number for all parameters of the group, or the group has an error.
    if isinstance(group, float):
        return tuple(group for _ in unknown)
    if group is None:
        return story_laws.default_numbers(parameter, earlier) or unknown
    # `without` applies only if the file omits the group.
    default = story_laws.default_numbers(replace(parameter, without=None), earlier)
    if default and not group.has(parameter.name):
        return default
    if parameter.points:
        return _read_points(group, parameter, unit) or unknown
    if parameter.choices:
        value = group.need(parameter.name, f"give one of {', '.join(parameter.choices)}")
        name = value.choice(parameter.choices, parameter.name) if value else None
        return unknown if name is None else (float(parameter.choices.index(name)),)
    bounds = bounds_of(parameter)
    if parameter.many:
        value = group.need(parameter.name, f"give {_NUMBER_LIST}")
        items = value.items(_NUMBER_LIST, "must contain at least one number") if value else None
        # The unit of the j-th number is force divided by length to the power j.
        numbers = tuple(
            item.number(bounds, unit.factor(force=1, length=-j))
            for j, item in enumerate(items or (), start=1)
        )
        return numbers or unknown
    return (group.number(parameter.name, bounds, unit.factor(parameter.force, parameter.length)),)


def _read_points(
    group: Section, parameter: LawParameter, unit: ModelUnits
) -> tuple[float, ...] | None:
    """Return drift (m) and force (N) of each point, with the points that the file omits; None after
    reporting an error.

    Infinite points complete an open-ended list; `four_points` completes four points.
    """
    point_list = f"{parameter.point_count_text} [drift, force]"
    value = group.need(parameter.name, f"give {point_list}")
    items = value.items(point_list) if value else None
    if value is None or items is None:
        return None
    # All points are read before their number is checked, so that all errors are reported.
    pairs = [item.items("a point [drift, force]") for item in items]
    has_allowed_length = parameter.least_points <= len(pairs) <= parameter.points
    if not has_allowed_length or any(pair is not None and len(pair) != 2 for pair in pairs):
        long_forms = [
            f"; for more points use {other.long_form}"
            for law in story_laws.LAWS.values()
            for other in law.parameters
            if parameter.points < len(pairs) <= other.points and other.long_form
        ]
        value.fault(
            f"must be {point_list}, got {pluralize(len(pairs), 'entry')}{''.join(long_forms[:1])}"
        )
        return None
    bounds, factors = bounds_of(parameter), (unit.factor(length=1), unit.factor(force=1))
    points = [
        [
            coordinate.number(bounds, factor)
            for coordinate, factor in zip(pair or (), factors, strict=False)
        ]
        for pair in pairs
    ]
    if not all(points):
        return None
    if not parameter.open_ended:
        return story_laws.four_points(points)
    if points[0][0] == 0.0:
        items[0].fault(
            "must be the first corner, whose force over its drift is the initial stiffness, not "
            "the origin; omit a point [0, 0]"
        )
        return None
    coordinates = [number for point in points for number in point]
    return (*coordinates, *[math.inf] * (2 * parameter.points - len(coordinates)))


def bounds_of(parameter: LawParameter) -> Bounds:
    """Return the allowed range of a parameter.

    A parameter without a unit and with an upper bound of at most 1 can be written as a percentage.
    """
    ratio = parameter.is_ratio and not (parameter.force or parameter.length)
    ratio = ratio and parameter.high <= 1.0
    return Bounds(
        parameter.low, parameter.high, parameter.low_allowed, parameter.high_allowed, ratio
    )


_RAYLEIGH = "rayleigh"
_EXPONENT = Bounds(0.0, 2.0, low_allowed=False)
_RELIEF = Keys(keys("relief"))
_DASHPOT = Keys((*keys("dashpot", exponent=_EXPONENT, relief=_RELIEF), *_INCLINATION))
DASHPOT = Either((NOT_NEGATIVE, _DASHPOT))
_STORY = Keys(
    with_directions(
        keys(
            "story",
            law=LAW,
            elements=ELEMENTS,
            dashpot=DASHPOT,
            isolator=Either((Flag(), Choice((_RAYLEIGH,)))),
            flexural=Keys(keys("flexural")),
            repeat=Integer(1, MAX_STORIES),
        ),
        OF_STORY,
    ),
    one_of=(("mass", "weight"),),
)
STORIES = EntriesOf(_STORY, least=1)
_STIFFNESS_TOLERANCE = 1e-9
"""Relative difference. A stiffness that is specified twice may differ by rounding only."""


def read_stories(
    value: Value | None, unit: ModelUnits, p_delta: bool, has_matrix: bool = False
) -> tuple[tuple[Story, ...], int | None]:
    """Return the stories from the ground up and their number, which is `None` after an error.

    Parameters
    ----------
    p_delta : bool
        Require the height of every story that does not specify `p_delta: false`.
    has_matrix : bool
        A stiffness matrix replaces the springs of the stories.
    """
    entries = value.items("a list of stories", "must contain at least one story") if value else None
    if entries is None:
        return (), None
    stories: list[Story] = []
    count: int | None = 0  # number of stories; None after an error in `repeat`
    for entry in entries:
        story, repeat = Story(math.nan, None, math.nan, story_laws.LINEAR, math.nan), None
        if section := entry.section(_STORY):
            is_flexural = entry.peek("flexural") is not None
            if not is_flexural and (inertia := entry.peek("rotary_inertia")):
                inertia.fault("the floor rotates above a `flexural` story only; omit it")
            is_linear = has_matrix or is_flexural
            read = _read_story_without_spring if is_linear else _read_story
            story, repeat = read(section, unit, p_delta), section.read("repeat", 1)
        # Check the number before the stories are created, because a `repeat` of a billion would
        # fill the memory. An invalid `repeat` (None) counts as one story.
        if len(stories) + (repeat or 1) > MAX_STORIES:
            entry.fault(f"the model has more than {MAX_STORIES} stories; check `repeat`")
            return (), None
        if (period := entry.peek("period")) and (len(entries) > 1 or (repeat or 1) > 1):
            period.fault("applies to a model with one story; give the stiffness of the story")
        stories += [story] * (repeat or 1)
        count = count + repeat if count is not None and repeat is not None else None
    return tuple(stories), count or None


def _read_story(section: Section, unit: ModelUnits, p_delta: bool) -> Story:
    """Return the story of a single entry."""
    story_p_delta = section.read("p_delta")
    if p_delta if story_p_delta is None else story_p_delta:
        height_entry = section.need(
            "height",
            "p_delta needs the height of every story; give it, or `p_delta: false` in this story",
        )
    else:
        height_entry = section.get("height")
    height = height_entry.number(scale=unit.length) if height_entry else None
    dashpot, power_dashpot, damper_factor = read_dashpot(section.get("dashpot"), unit)
    mass = read_mass(section, unit)
    elements: tuple[Element, ...] = ()
    if elements_entry := section.get("elements"):
        elements = _read_elements(section, elements_entry, unit, height)
        stiffness = sum(element.stiffness for element in elements) if elements else math.nan
        law = story_laws.SUM_OF_ELEMENTS
        # A story with a single element, which is not inclined, is a story with a law.
        if len(elements) == 1 and elements[0].factor == 1.0:
            law, elements = elements[0].law, ()
    else:
        stiffness, law = read_spring(section, unit, mass=mass, height=height)
    # The value of `isolator` is true, false or `rayleigh`. The Rayleigh damping of the building
    # does not apply to an isolator unless the value is `rayleigh`.
    isolator_entry = section.get("isolator")
    is_damped_isolator = bool(isolator_entry and isolator_entry.is_word(_RAYLEIGH))
    is_isolator = is_damped_isolator or bool(isolator_entry and isolator_entry.boolean())
    has_rayleigh_damping = section.read("rayleigh", is_damped_isolator or not is_isolator)
    if is_damped_isolator and not has_rayleigh_damping:
        section.value.fault("give either `isolator: rayleigh` or `rayleigh: false`, not both")
    return Story(
        mass,
        height,
        stiffness,
        law,
        dashpot,
        power_dashpot,
        is_isolator,
        has_rayleigh_damping,
        elements,
        damper_factor,
        story_p_delta,
        inertance=read_inertia(section, unit),
    )


def _read_story_without_spring(section: Section, unit: ModelUnits, p_delta: bool) -> Story:
    """Return the story of an entry with stiffness `flexural` or in a matrix."""
    section.refuse(
        OF_SPRINGS,
        f"`flexural` and `stiffness_matrix` are linear and replace {', '.join(OF_SPRINGS)} of "
        "stories; omit it",
    )
    if p_delta:
        section.value.fault(
            "P-delta of stories needs their springs; include it in the matrix, or omit `p_delta`"
        )
    flexural, height = None, section.get("height")
    if section.has("flexural"):
        height = section.need("height", "flexural stories need it")
        stiffness = section.inner("flexural")
        flexural = (
            stiffness.number("EI", scale=unit.factor(force=1, length=2)),
            stiffness.number("GA", scale=unit.force, default=math.inf),
        )
    return Story(
        read_mass(section, unit, NOT_NEGATIVE),
        height.number(scale=unit.length) if height else None,
        math.nan,
        story_laws.LINEAR,
        0.0,
        flexural=flexural,
        rotary_inertia=read_inertia(section, unit, "rotary_inertia", length=2),
    )


def read_spring(
    section: Section,
    unit: ModelUnits,
    *,
    mass: float = math.nan,
    height: float | None = None,
    is_optional: bool = False,
) -> tuple[float, story_laws.Law]:
    """Return the initial stiffness (N/m; nan after an error) and the law of a spring. With
    `is_optional`, the spring may have no stiffness, or no stiffness before it stiffens."""
    entry = section.get("law")
    law, stiffness_of_law = read_law(entry, unit)
    is_held = law == story_laws.LINEAR and section.has("stiffness")
    is_known = law.parameters and not any(map(math.isnan, law.parameters))
    is_soft = is_known and law.values.get("stop_stiffness") == 0.0
    if entry and is_soft and not section.mentions("stiffness"):
        entry.fault("stop_stiffness: the stop has no stiffness; give a positive number")
        return math.nan, law
    may_be_soft = is_held or (is_known and story_laws.LAWS[law.name].stiffens(law.parameters))
    stiffness = _read_stiffness(
        section, law.name, stiffness_of_law, unit, mass, is_optional and bool(may_be_soft)
    )
    return stiffness, _checked_law(entry, law, stiffness, unit, height) if entry else law


def _checked_law(
    entry: Value, law: story_laws.Law, stiffness: float, unit: ModelUnits, height: float | None
) -> story_laws.Law:
    """Return a law with its fracture. Parameters and stiffness can be valid separately, but their
    combination invalid, which is reported."""
    if any(map(math.isnan, (stiffness, *law.parameters))):
        return law
    if fault := story_laws.LAWS[law.name].fault(stiffness, law.parameters):
        entry.fault(fault)
        return law
    return read_fracture(entry, law, stiffness, unit, height)


_FORBIDDEN_IN_NAMES = r"[\[\],=\"']"
"""Characters with a meaning in the names of parameters and in lists of options."""


def _read_elements(
    section: Section, value: Value, unit: ModelUnits, height: float | None
) -> tuple[Element, ...]:
    """Return the elements of a story; errors are added to the errors of the file."""
    for name in ("law", "stiffness", "period"):
        if section.has(name):
            section.value.fault(
                f"give either `{name}` or `elements`, not both; move the {name} into an element"
            )
    entries = value.items("a list of elements", "must contain at least one element")
    elements = [_read_element(entry, unit, height) for entry in entries or ()]
    # An element without a name has the name of its law, and its number if the name is not unique.
    used: dict[str, int] = {}
    for i, element in enumerate(elements, start=1):
        if element.name:
            used.setdefault(column_name(element.name), i)
    for i, (element, entry) in enumerate(zip(elements, entries or (), strict=True), start=1):
        name = element.name
        if name and used[column_name(name)] != i:
            where = entry.peek("name") or entry
            where.fault(
                f"{name!r} is already the name of element {used[column_name(name)]}; names must "
                "be unique within the story"
            )
        if not name:
            name = element.law.name
            if column_name(name) in used:
                name = f"{name} {i}"
            used[column_name(name)] = i
            elements[i - 1] = replace(element, name=name)
    if elements and sum(element.stiffness for element in elements) <= 0.0:
        value.fault(
            "the sum of the initial stiffnesses of the elements must be positive; add the "
            "stiffness of an element"
        )
    return tuple(elements)


def _read_element(entry: Value, unit: ModelUnits, height: float | None) -> Element:
    """Return an element. Its name is empty if the file does not specify it; its stiffness is nan
    after an error.
    """
    unknown = Element("", math.nan, story_laws.LINEAR)
    if not entry.is_mapping:
        entry.fault("must be a mapping with `type`, `stiffness` and the parameters of the law")
        return unknown
    entry = entry.flattened("law", "type")
    if nested := entry.peek("elements"):
        nested.fault("an element cannot contain elements; add them to the list of the story")
    names = ("name", "stiffness", "elements", *(key.name for key in _INCLINATION))
    law, section = _read_law_type(entry, *names, attributes=_ATTRIBUTES)
    if law is None or section is None:
        return unknown
    name_entry = section.get("name")
    name = (name_entry.text() or "") if name_entry else ""
    if name_entry and (re.search(_FORBIDDEN_IN_NAMES, name) or not re.search(r"[^\W\d]", name)):
        name_entry.fault(
            f"must contain a letter and none of [ ] , = and quotation marks, got {name!r}"
        )
    # The file contains the values along the element. In the direction of the drift, forces are
    # multiplied and lengths divided by the cosine of its inclination, as by other units.
    cosine = _read_inclination(section)
    if not math.isnan(cosine):
        unit = unit._replace(length=unit.length / cosine, force=unit.force * cosine)
    parameters = _read_parameters(section, law, unit) if law.parameters else ()
    has_unknown = any(map(math.isnan, parameters))
    stiffness_of_law = None
    if law.initial_stiffness:
        stiffness_of_law = math.nan if has_unknown else law.initial_stiffness(parameters)
    if any(parameter.path == "stiffness" for parameter in law.parameters):
        assert stiffness_of_law is not None
        stiffness = stiffness_of_law  # the law checks the parameter
    else:
        is_optional = has_unknown or law.stiffens(parameters)
        stiffness = _read_stiffness(
            section, law.name, stiffness_of_law, unit, is_optional=is_optional
        )
    result = _checked_law(entry, story_laws.Law(law.name, parameters), stiffness, unit, height)
    if not has_unknown and law.tangent_damping(parameters, 1.0):
        entry.fault("damping of a law in contact is possible in attachments and links only")
    attributes = {
        key.name: section.read(key.name, getattr(unknown, key.name)) for key in _ATTRIBUTES
    }
    return Element(name, math.nan if has_unknown else stiffness, result, cosine, **attributes)


def _read_stiffness(
    section: Section,
    law_name: str,
    stiffness_of_law: float | None,
    unit: ModelUnits,
    mass: float = math.nan,
    is_optional: bool = False,
) -> float:
    """Return the initial stiffness of a story, an element or a device, N/m, or nan after reporting
    an error. For a floor of mass `mass` (kg), the natural period can specify the stiffness.

    If the parameters of the law determine the initial stiffness (otherwise None), the key
    `stiffness` is optional, and a different value is an error. With `is_optional`, it is 0 by
    default: a spring next to other springs that stiffens, such as a stop.
    """
    factor = unit.factor(force=1, length=-1)
    entry, period = section.get("stiffness"), section.get("period")
    if entry and period:
        section.value.fault("give either `stiffness` or `period`, not both; remove one")
    if stiffness_of_law is None and not period:
        bounds = NOT_NEGATIVE if is_optional else POSITIVE
        return section.number("stiffness", bounds, factor, default=0.0 if is_optional else None)
    stiffness = math.nan
    if period:
        stiffness = mass * (2.0 * math.pi / period.number()) ** 2
    elif entry:
        stiffness = entry.number(scale=factor)
    if stiffness_of_law is None:
        return stiffness
    given = entry or period
    if given and abs(stiffness - stiffness_of_law) > _STIFFNESS_TOLERANCE * stiffness_of_law:
        initial = f"the initial stiffness {stiffness_of_law / factor:.10g} of its {law_name} law"
        given.fault(
            f"must agree with {initial}, got {stiffness / factor:.10g}; correct it or omit it"
        )
    return stiffness_of_law


def read_mass(section: Section, unit: ModelUnits, bounds: Bounds = POSITIVE) -> float:
    """Return the mass of the floor within bounds, kg, from the key `mass` or `weight`."""
    if section.has("weight"):
        if section.has("mass"):
            section.value.fault("give either mass or weight, not both")
        return section.number("weight", bounds, scale=unit.force / STANDARD_GRAVITY)
    if not section.mentions("mass", "weight"):
        section.need("mass", "give a positive number, or `weight` instead")
        return math.nan
    mass = section.get("mass")
    # If units are kN or mm, a mass without unit could be in kg or t, so the unit is required.
    if mass and unit.mass_is_open:
        mass.fault(
            "the unit of mass is required, because the units of the file are not m and N: add mass "
            f"to `units` ({', '.join(MASS)}), or give the `weight` of the story"
        )
    return section.number("mass", bounds, scale=unit.mass, default=math.nan)


def read_dashpot(value: Value | None, unit: ModelUnits) -> tuple[float, PowerDashpot | None, float]:
    """Return the coefficient of a linear dashpot, N s/m, the power-law dashpot, and the cosine of
    the inclination.

    A number in the file, or a mapping without exponent and brace, is a linear dashpot. Any other
    mapping defines a power-law dashpot, possibly with a brace. The coefficient is 0 or the
    power-law dashpot None. The coefficient is nan after an error.
    """
    if value is None:
        return 0.0, None, 1.0
    if not value.is_mapping:
        return value.number(NOT_NEGATIVE, unit.factor(force=1, length=-1)), None, 1.0
    section = value.section(_DASHPOT)
    if section is None:
        return math.nan, None, 1.0
    factor = _read_inclination(section)
    exponent = section.number("exponent", default=1.0)
    has_brace = section.mentions("brace")
    brace = section.number("brace", scale=unit.factor(force=1, length=-1)) if has_brace else None
    # For exponents below 1 the tangent damping is infinite at zero velocity. Without a brace, such
    # a dashpot must be linear below a positive drift rate.
    needs_linear_part = exponent < 1.0 and not has_brace
    if needs_linear_part and not section.mentions("linear_below"):
        section.need(
            "linear_below",
            "an exponent below 1 requires the drift rate below which the dashpot is linear, or the "
            "stiffness of its `brace`",
        )
    linear_below = section.number(
        "linear_below", POSITIVE if needs_linear_part else NOT_NEGATIVE, unit.length, default=0.0
    )
    coefficient = section.number("coefficient", scale=unit.factor(force=1, length=-exponent))
    relief = None
    if entry := section.get("relief"):
        if exponent != 1.0 or section.has("linear_below"):
            entry.fault("requires a linear damper, without `exponent` and `linear_below`")
        if not has_brace:
            entry.fault("requires the stiffness of the `brace` in series with the damper")
        if valve := entry.section():
            relief = Relief(valve.number("force", scale=unit.force), valve.number("ratio"))
    if not (has_brace or section.has("exponent") or section.has("linear_below")):
        return coefficient, None, factor
    return 0.0, PowerDashpot(coefficient, exponent, linear_below, brace, relief), factor


def _read_inclination(section: Section) -> float:
    """Return the cosine of the inclination of a dashpot or an element, from the key `factor` or
    `angle`.
    """
    if not section.has("angle"):
        return section.number("factor", _COSINE, default=1.0)
    if section.has("factor"):
        section.value.fault("give either factor or angle, not both")
    return math.cos(math.radians(section.number("angle", _ANGLE)))
