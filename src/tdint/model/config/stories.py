"""Read the `stories` of a model file and their hysteretic laws.

The value of `law` is the name of a law, or a mapping with `type` and the parameters of the law in
`LAWS`.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

from tdint.kernels.laws.law import DriftLaw, LawParameter
from tdint.model.config.sections import ModelUnits
from tdint.model.definition import (
    LAWS,
    LINEAR,
    MAX_STORIES,
    Law,
    PowerDashpot,
    Story,
    four_points,
    laws,
)
from tdint.model.keys.fields import (
    NOT_NEGATIVE,
    POSITIVE,
    Bounds,
    Choice,
    Either,
    EntriesOf,
    Flag,
    Key,
    Keys,
    Schema,
    Section,
    Value,
    ValueType,
    Whole,
)
from tdint.units import MASS, STANDARD_GRAVITY

Group = Section | float | None
"""Values of a group of parameters: a section, one number in SI units for all of them, or None if
the group is omitted."""

Earlier = Mapping[str, tuple[float, ...]]
"""Parameters that have already been read, by name."""

_LIST = "a list of numbers"
_POINTS = "two to four points [drift, force]"


def _keys(law: DriftLaw, group: str = "") -> tuple[Key, ...]:
    """Return the keys in the mapping of a law, or in one of its groups."""
    keys: dict[str, Key] = {}
    for parameter in law.parameters:
        # A parameter is optional if it has a default, or a value for the case without its group.
        needed = parameter.default is None and parameter.without is None
        inner, bounds = _inner(parameter, group), _bounds(parameter)
        if parameter.group == group:
            value_type: ValueType = EntriesOf(bounds, least=1) if parameter.many else bounds
            if parameter.points:
                value_type = EntriesOf(EntriesOf(bounds, least=2, most=2), least=2, most=4)
            keys[parameter.name] = Key(parameter.name, value_type, needed=needed)
        elif inner and inner not in keys:
            mapping: ValueType = Keys(_keys(law, f"{group}.{inner}" if group else inner))
            whole = (bounds, mapping, Choice(("none",)))
            keys[inner] = Key(inner, Either(whole) if parameter.shared else mapping, needed=needed)
    return tuple(keys.values())


def _inner(parameter: LawParameter, group: str) -> str:
    """Return the key in `group` of the inner group of a parameter, or an empty string."""
    start = f"{group}." if group else ""
    return parameter.group[len(start) :].split(".")[0] if parameter.group.startswith(start) else ""


@dataclass(frozen=True)
class _LawKind:
    """Name of a law, or mapping with its type and parameters."""

    def schema(self) -> Schema:
        bare = [name for name, law in laws().items() if not law.parameters]
        mappings = [
            Keys((Key("type", Choice((law.name,)), law.formula, True), *_keys(law)))
            for law in laws().values()
        ]
        return Either((Choice(tuple(bare)), *mappings)).schema()


LAW = _LawKind()


def read_law(value: Value | None, unit: ModelUnits) -> tuple[Law, float | None]:
    """Read a law and the initial stiffness that follows from its parameters, N/m.

    The stiffness is None if the story specifies it, and nan after an error.

    Parameters
    ----------
    value : Value or None
        Value of the key `law`; None for a linear story.
    unit : ModelUnits
        Units of the model file.
    """
    if value is None:
        return LINEAR, None
    law, section = _read_type(value)
    if law is None:
        return LINEAR, math.nan
    parameters = _read_parameters(section, law, unit) if section else ()
    read = Law(law.name, parameters)
    if law.initial_stiffness is None:
        return read, None

    # The initial stiffness follows from the parameters. It may be invalid although each parameter
    # is valid.
    stiffness = law.initial_stiffness(parameters) if parameters else math.nan
    if stiffness <= 0.0 or stiffness == math.inf:
        shown = f"{stiffness / unit.factor(force=1, length=-1):.10g}"
        value.fault(
            f"the initial stiffness of the {law.name} law must be a positive number, got {shown}"
        )
        return read, math.nan
    return read, stiffness


def _read_type(value: Value) -> tuple[DriftLaw | None, Section | None]:
    """Return the law and the section with its parameters.

    The law is None after an error. The section is None if the value is the name of the law only.
    """
    # A name without parameters is sufficient only if the law has no parameters.
    if not value.is_mapping:
        name = value.choice(_known(value), "law")
        if name and LAWS[name].parameters:
            needed = (
                item.name
                for item in LAWS[name].parameters
                if item.default is None and item.without is None
            )
            names = ", ".join(f"{item}: ..." for item in needed)
            value.fault(f"the {name} law requires parameters; write {{type: {name}, {names}}}")
        return (LAWS[name] if name else None), None
    law_type = value.peek("type")
    name = law_type.choice(_known(law_type), "law") if law_type else None
    # After an error in the name, the keys of all laws are allowed, so that it causes no more
    # errors.
    possible = [LAWS[name]] if name else LAWS.values()
    admitted = dict.fromkeys(
        ["type", *(_inner(item, "") or item.name for law in possible for item in law.parameters)]
    )
    section = value.section(list(admitted))
    if section:
        section.need("type", f"give one of {', '.join(LAWS)}")
    return (LAWS[name] if name else None), section


def _known(name: Value) -> Mapping[str, DriftLaw]:
    """Return the laws by name. Installed packages are searched only if the name is not built in."""
    return LAWS if any(map(name.is_word, LAWS)) else laws()


def _read_parameters(section: Section, law: DriftLaw, unit: ModelUnits) -> tuple[float, ...]:
    """Return the parameters in SI units in the order of the law, with lists flattened.

    Parameters
    ----------
    section : Section
        Section with the parameters.
    law : DriftLaw
        Law that declares the parameters.
    unit : ModelUnits
        Units of the model file.
    """
    # Outer groups are read before inner groups, because they contain them.
    names = sorted(
        dict.fromkeys(member.group for member in law.parameters), key=lambda name: name.count(".")
    )
    groups: dict[str, Group] = {"": section}
    for name in names:
        groups[name] = _read_group(groups, law, name, unit)
    values: list[float] = []
    earlier: dict[str, tuple[float, ...]] = {}
    for parameter in law.parameters:
        if parameter.many:
            entry = section.need(parameter.name, f"give {_LIST}")
            items = entry.items(_LIST, "must contain at least one number") if entry else None
            bounds, numbers = _bounds(parameter), enumerate(items or (), start=1)
            # The unit of the j-th number is force divided by length to the power j.
            read = tuple(
                item.number(bounds, unit.factor(force=1, length=-j)) for j, item in numbers
            ) or (math.nan,)
        elif parameter.points:
            read = _read_points(groups[parameter.group], parameter, unit, earlier)
        else:
            read = (_read_number(groups[parameter.group], parameter, unit, earlier),)
        values += read
        # The default of a parameter may be an earlier parameter.
        earlier.setdefault(parameter.name, read)
    return tuple(values)


def _read_group(groups: Mapping[str, Group], law: DriftLaw, group: str, unit: ModelUnits) -> Group:
    """Return the values of a group of parameters.

    Parameters
    ----------
    groups : mapping of str to Group
        Outer groups that have been read; "" is the section of the law.
    law : DriftLaw
        Law that declares the group.
    group : str
        Name of the group with the names of its outer groups, separated by dots; "" for parameters
        without a group.
    unit : ModelUnits
        Units of the model file.

    Returns
    -------
    Section, float or None
        Section of the group, one number for all parameters, nan after an error, or None if the
        group or its outer group is omitted.
    """
    outer, _, name = group.rpartition(".")
    around = groups.get(outer)
    if not group or not isinstance(around, Section):
        return around
    members = [parameter for parameter in law.parameters if parameter.group == group]
    # A group is required if its parameters have no default.
    if members[0].default is None and members[0].without is None:
        value = around.need(
            name,
            f"give a mapping with the keys {', '.join(parameter.name for parameter in members)}",
        )
        if value is None:
            return math.nan
    value = around.get(name)
    if value is None or (members[0].shared and value.is_word("none")):
        return None
    names = [key.name for key in _keys(law, group)]
    # A single number sets all parameters of a shared group.
    if members[0].shared and not value.is_mapping:
        expected = (
            f"{_bounds(members[0])} for all of {', '.join(names)}, a mapping of them, or none"
        )
        return value.number(
            _bounds(members[0]), unit.factor(members[0].force, members[0].length), expected
        )
    return value.section(names) or math.nan


def _read_points(
    group: Group, parameter: LawParameter, unit: ModelUnits, earlier: Earlier
) -> tuple[float, ...]:
    """Return four points [drift (m), force (N)] as eight numbers.

    If the file contains two or three points, `four_points` adds points on the line before the last
    point.

    Parameters
    ----------
    group : Section, float or None
        Values of the group of the parameter (`_read_group`).
    parameter : LawParameter
        Declaration of the points.
    unit : ModelUnits
        Units of the model file.
    earlier : mapping of str to tuple of float
        Parameters that have already been read, in SI units.
    """
    nothing = (math.nan,) * 8
    if isinstance(group, float):
        return nothing
    # The default of the negative direction is the positive direction.
    if isinstance(parameter.default, str) and (group is None or not group.has(parameter.name)):
        return earlier[parameter.default]
    value = group.need(parameter.name, f"give {_POINTS}") if group else None
    items = value.items(_POINTS) if value else None
    if value is None or items is None:
        return nothing
    # All points are read before their number is checked, so that all errors are reported.
    pairs = [item.items("a point [drift, force]") for item in items]
    if not 2 <= len(pairs) <= 4 or any(pair is not None and len(pair) != 2 for pair in pairs):
        value.fault(f"must be {_POINTS}")
        return nothing
    bounds, factors = _bounds(parameter), (unit.factor(length=1), unit.factor(force=1))
    points = [
        [coordinate.number(bounds, f) for coordinate, f in zip(pair or (), factors, strict=False)]
        for pair in pairs
    ]
    return four_points(points) if all(points) else nothing


def _read_number(
    group: Group, parameter: LawParameter, unit: ModelUnits, earlier: Earlier
) -> float:
    """Return a parameter in SI units, or its default if it is omitted.

    Parameters
    ----------
    group : Section, float or None
        Values of the group of the parameter (`_read_group`).
    parameter : LawParameter
        Declaration of the parameter.
    unit : ModelUnits
        Units of the model file.
    earlier : mapping of str to tuple of float
        Parameters that have already been read, in SI units.
    """
    bounds, factor = _bounds(parameter), unit.factor(parameter.force, parameter.length)
    default = (
        earlier[parameter.default][0] if isinstance(parameter.default, str) else parameter.default
    )
    if isinstance(group, float):
        return group
    if group is None:
        return (
            parameter.without
            if parameter.without is not None
            else default
            if default is not None
            else math.nan
        )
    if default is not None and not group.has(parameter.name):
        return default
    return group.number(parameter.name, bounds, factor)


def _bounds(parameter: LawParameter) -> Bounds:
    ratio = not parameter.force and not parameter.length and parameter.high <= 1.0
    return Bounds(
        parameter.low, parameter.high, parameter.low_allowed, parameter.high_allowed, ratio
    )


_DAMPED = "rayleigh"
_EXPONENT = Bounds(0.0, 2.0, low_allowed=False)
_DASHPOT = Keys(
    (
        Key("coefficient", POSITIVE, "force at the unit of velocity", needed=True),
        Key("exponent", _EXPONENT, "power of the drift rate", needed=True),
        Key("linear_below", NOT_NEGATIVE, "drift rate under which the dashpot is linear"),
    )
)
_STORY = Keys(
    (
        Key("mass", POSITIVE, "mass of the floor above"),
        Key("weight", POSITIVE, "weight of the floor above, instead of its mass"),
        Key("height", POSITIVE, "story height, for drift ratios and P-delta"),
        Key("stiffness", POSITIVE, "initial stiffness: story shear over drift"),
        Key("law", LAW, "hysteretic law; default: linear"),
        Key(
            "dashpot",
            Either((NOT_NEGATIVE, _DASHPOT)),
            "viscous damper between the floors: force over velocity",
        ),
        Key(
            "isolator",
            Either((Flag(), Choice((_DAMPED,)))),
            "true for an isolator: its displacement is reported instead of a drift ratio; "
            "`rayleigh` for an isolator with Rayleigh damping",
        ),
        Key("repeat", Whole(1, MAX_STORIES), "number of equal stories"),
    ),
    one_of=(("mass", "weight"),),
)
STORIES = EntriesOf(_STORY, least=1)
_AGREEMENT = 1e-9  # relative; a stiffness that is specified twice may differ by rounding only


def read_stories(
    value: Value | None, unit: ModelUnits, p_delta: bool
) -> tuple[tuple[Story, ...], int | None]:
    """Return the stories from the ground up and their number, which is None after an error.

    Parameters
    ----------
    value : Value or None
        Value of the key `stories`; None if it is missing.
    unit : ModelUnits
        Units of the model file.
    p_delta : bool
        Require the height of every story.
    """
    entries = value.items("a list of stories", "must contain at least one story") if value else None
    if entries is None:
        return (), None
    stories: list[Story] = []
    count: int | None = 0
    for entry in entries:
        story, repeat = _read_entry(entry, unit, p_delta)
        # Checked before the stories are created: a `repeat` of a billion would fill the memory.
        if len(stories) + (repeat or 1) > MAX_STORIES:
            entry.fault(f"the model has more than {MAX_STORIES} stories; check `repeat`")
            return (), None
        stories += [story] * (repeat or 1)
        count = count + repeat if count is not None and repeat is not None else None
    return tuple(stories), count or None


def _read_entry(entry: Value, unit: ModelUnits, p_delta: bool) -> tuple[Story, int | None]:
    """Return the story of one entry and its number of repetitions, which is None after an error.

    Parameters
    ----------
    entry : Value
        Entry of the list of stories.
    unit : ModelUnits
        Units of the model file.
    p_delta : bool
        Require the height of the story.
    """
    section = entry.section(_STORY)
    if section is None:
        return Story(math.nan, None, math.nan, LINEAR, math.nan), None
    stated_law = section.get("law")
    law, stiffness_of_law = read_law(stated_law, unit)
    dashpot, power_dashpot = _read_dashpot(section.get("dashpot"), unit)
    height = (
        section.need("height", "p_delta needs the height of every story")
        if p_delta
        else section.get("height")
    )
    mass, story_height = (
        _read_mass(section, unit),
        height.number(scale=unit.length) if height else None,
    )

    # If the law defines the initial stiffness, the key `stiffness` must agree with it.
    factor, entry_stiffness = unit.factor(force=1, length=-1), section.get("stiffness")
    if stiffness_of_law is None:
        stiffness = section.number("stiffness", scale=factor)
    else:
        stated = entry_stiffness.number(scale=factor) if entry_stiffness else stiffness_of_law
        if entry_stiffness and abs(stated - stiffness_of_law) > _AGREEMENT * stiffness_of_law:
            initial = (
                f"the initial stiffness {stiffness_of_law / factor:.10g} of its {law.name} law"
            )
            entry_stiffness.fault(
                f"must agree with {initial}, got {stated / factor:.10g}; correct it or omit it"
            )
        stiffness = stiffness_of_law
    # The damping of the building does not apply to isolators unless the file requests it.
    isolator = section.get("isolator")
    is_damped = bool(isolator and isolator.is_word(_DAMPED))
    isolates = is_damped or bool(isolator and isolator.boolean())
    story = Story(
        mass,
        story_height,
        stiffness,
        law,
        dashpot,
        power_dashpot,
        isolates,
        is_damped or not isolates,
    )
    # Errors of the combination of parameters and stiffness, each of which is valid.
    is_known = not any(map(math.isnan, (stiffness, *law.parameters)))
    if (
        stated_law
        and law.parameters
        and is_known
        and (fault := LAWS[law.name].fault(stiffness, law.parameters))
    ):
        stated_law.fault(fault)
    return story, section.read("repeat", 1)


def _read_mass(section: Section, unit: ModelUnits) -> float:
    """Return the mass of the floor, kg, from the key `mass` or `weight`.

    Parameters
    ----------
    section : Section
        Section of the story.
    unit : ModelUnits
        Units of the model file.
    """
    if section.has("weight"):
        if section.has("mass"):
            section.value.fault("give either mass or weight, not both")
        return section.number("weight", scale=unit.force / STANDARD_GRAVITY)
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
    return section.number("mass", scale=unit.mass, default=math.nan)


def _read_dashpot(value: Value | None, unit: ModelUnits) -> tuple[float, PowerDashpot | None]:
    """Return the coefficient of a linear dashpot, N s/m, and the power-law dashpot, if any.

    A number is the coefficient of a linear dashpot; a mapping defines a power-law dashpot.

    Parameters
    ----------
    value : Value or None
        Value of the key `dashpot`; None for a story without a dashpot.
    unit : ModelUnits
        Units of the model file.
    """
    if value is None:
        return 0.0, None
    if not value.is_mapping:
        return value.number(NOT_NEGATIVE, unit.factor(force=1, length=-1)), None
    section = value.section(_DASHPOT)
    if section is None:
        return math.nan, None
    exponent = section.number("exponent")
    # For exponents below 1 the tangent damping is infinite at zero velocity.
    needs_linear_part = exponent < 1.0
    if needs_linear_part and not section.mentions("linear_below"):
        section.need(
            "linear_below",
            "an exponent below 1 requires the drift rate below which the dashpot is linear",
        )
    below = section.number(
        "linear_below", POSITIVE if needs_linear_part else NOT_NEGATIVE, unit.length, default=0.0
    )
    coefficient = section.number("coefficient", scale=unit.factor(force=1, length=-exponent))
    return 0.0, PowerDashpot(coefficient, exponent, below)
