"""The sections `attachments` and `links` of a model file: masses on floors, and springs and
dashpots between any two floors."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

from tdint.model.config import stories
from tdint.model.config.keys import keys
from tdint.model.config.sections import ModelUnits, read_inertia
from tdint.model.definition import Attachment, Link
from tdint.model.keys.fields import (
    NOT_NEGATIVE,
    ROOF,
    Bounds,
    Either,
    EntriesOf,
    Integer,
    Keys,
    Section,
    TextLine,
    Value,
)
from tdint.model.story import MAX_STORIES, Story, column_name
from tdint.model.story_laws import LAWS, LINEAR, Law

GROUND = "ground"
_Floors = tuple[int | None, Sequence[str]]
_MASS_RATIO = Bounds(0.0, low_allowed=False, ratio=True)
_END = Either((Integer(1, MAX_STORIES), TextLine()))
_ATTACHMENT = Keys(
    keys(
        "attachment",
        floor=_END,
        mass_ratio=_MASS_RATIO,
        law=stories.LAW,
        dashpot=stories.DASHPOT,
    )
)
ATTACHMENTS = EntriesOf(_ATTACHMENT, least=1)
_LINK = Keys(
    keys("link", law=stories.LAW, dashpot=stories.DASHPOT, **dict.fromkeys(("from", "to"), _END))
)
LINKS = EntriesOf(_LINK, least=1)


@dataclass
class _Names:
    """Names of the attachments and links of a file by their names in columns, which are unique."""

    used: dict[str, str]

    def read(self, section: Section, kind: str, number: int) -> str:
        """Return the name of an entry, or its default; report a name that is already used."""
        value = section.get("name")
        name = (value.text() if value else None) or f"{kind}_{number}"
        # Attachments are ends of links; otherwise the names of the ends are the names of floors.
        if kind == "attachment" and (name in (GROUND, ROOF) or name.isdecimal()):
            (value or section.value).fault(f"{name!r} is the name of a floor; use another name")
        elif column_name(name) in self.used:
            (value or section.value).fault(f"{name!r} is already used; names must be unique")
        self.used.setdefault(column_name(name), name)
        return name


def read_devices(
    section: Section, unit: ModelUnits, floors: _Floors, floor_mass: float
) -> tuple[tuple[Attachment, ...], tuple[Link, ...]]:
    """Return the attachments and links of a model file; errors are added to its errors.

    `floors` are the number of stories, None if it is unknown because of an error, and the names of
    rows that are not floors. `floor_mass` is the mass of all floors, kg.
    """
    count, rows = floors
    names = _Names({column_name(row): row for row in rows})
    attachments = []
    # Attachments without a spring, and without mass, which links must hold.
    loose: list[Section | None] = []
    massless: list[Section | None] = []
    for number, entry in enumerate(_entries(section, "attachments"), start=1):
        if item := entry.section(_ATTACHMENT):
            attachment = _read_attachment(item, number, unit, (floors, floor_mass), names)
            attachments.append(attachment)
            spring = attachment.spring
            loose.append(item if spring.stiffness == 0.0 else None)
            massless.append(item if spring.mass == 0.0 == spring.inertance else None)
    masses = list(names.used.values())[len(rows) :]
    links = []
    for number, entry in enumerate(_entries(section, "links"), start=1):
        if item := entry.section(_LINK):
            link_name = names.read(item, "link", number)
            links.append(_read_link(item, link_name, unit, floors, masses))
    if count and None not in links:
        springs = [link.ends for link in links if link and _is_spring(link.spring)]
        inerters = [link.ends for link in links if link and link.spring.inertance]
        for item in _not_held(loose, count, springs):
            item.value.fault("stiffness: must be positive, or links with a stiffness must hold it")
        for item in _not_held(massless, count, inerters):
            item.value.fault("mass: must be positive, or links with `inertance` must hold it")
    return tuple(attachments), tuple(link for link in links if link)


def _not_held(
    loose: Sequence[Section | None], count: int, links: Sequence[tuple[int, int]]
) -> Iterator[Section]:
    """Yield the attachments in `loose` (None for other attachments) that no chain of links
    connects to the building, to the ground or to another attachment."""
    held = {*range(count + 1), *(count + i for i, item in enumerate(loose, start=1) if not item)}
    while added := {end for ends in links if {*ends} & held for end in ends} - held:
        held |= added
    for number, item in enumerate(loose, start=count + 1):
        if item and number not in held:
            yield item


def _is_spring(spring: Story) -> bool:
    """Return True if a spring has a stiffness, at first or in contact."""
    law = spring.law
    return spring.stiffness != 0.0 or bool(
        law.parameters and LAWS[law.name].stiffens(law.parameters)
    )


def _entries(section: Section, name: str) -> Sequence[Value]:
    """Return the entries of a list; empty without the list."""
    value = section.get(name)
    return (
        value.items(f"a list of {name}", "must contain at least one entry") if value else ()
    ) or ()


def _read_attachment(
    section: Section,
    number: int,
    unit: ModelUnits,
    building: tuple[_Floors, float],
    names: _Names,
) -> Attachment:
    """Return an attachment on a building with these floors and a mass of its floors, kg.
    Invalid values are reported and replaced by nan, the floor by 1."""
    (count, rows), floor_mass = building
    name = names.read(section, "attachment", number)
    value = section.need("floor", "give the floor, counted from 1 at the bottom, roof or ground")
    floor = 1
    if value and value.word in names.used.values() and value.word not in rows:
        value.fault(
            "must be a floor of the building: attachments on attachments are not supported; a link "
            "between both attachments has the same effect"
        )
    elif value:
        floor = 0 if value.is_word(GROUND) else value.floor(count, rows) or 1
    if section.has("mass_ratio"):
        section.refuse(("mass", "weight"), "cannot be used with `mass_ratio`; give one of them")
        mass = section.number("mass_ratio") * floor_mass
    elif section.has("inertance") and not section.mentions("mass", "weight"):
        mass = 0.0
    else:
        mass = stories.read_mass(section, unit, NOT_NEGATIVE)
    spring = _read_device(section, unit, has_spring=True, mass=mass)
    if section.has("damping"):
        section.refuse(("dashpot",), "cannot be used with `damping`; give one of them")
        if spring.stiffness == 0.0:
            section.value.fault("damping: needs the stiffness or the period of its spring")
        ratio = section.number("damping")
        inertia = mass + spring.inertance
        spring = replace(spring, dashpot=2.0 * ratio * math.sqrt(spring.stiffness * inertia))
    return Attachment(name, floor, spring)


def _read_device(
    section: Section, unit: ModelUnits, *, has_spring: bool, mass: float = 0.0
) -> Story:
    """Return the spring and the dashpot of a device, with an attached mass, kg."""
    inertance = read_inertia(section, unit)
    stiffness, law = 0.0, LINEAR
    value = section.get("stiffness") if has_spring else None
    if value and value.word.startswith("-"):
        value.fault(
            f"must not be negative, got {value.word!r}; a linear model with negative springs is "
            "written as `matrices`"
        )
        stiffness = math.nan
    elif has_spring:
        inertia = mass + inertance
        is_optional = inertia != 0.0 or section.has("law")
        stiffness, law = stories.read_spring(section, unit, mass=inertia, is_optional=is_optional)
    dashpot, power_dashpot, factor = stories.read_dashpot(section.get("dashpot"), unit)
    return Story(
        mass=mass,
        height=None,
        stiffness=stiffness,
        law=law,
        dashpot=dashpot,
        power_dashpot=power_dashpot,
        rayleigh=False,
        damper_factor=factor,
        p_delta=False,
        inertance=inertance,
    )


def _read_link(
    section: Section, name: str, unit: ModelUnits, floors: _Floors, attachments: Sequence[str]
) -> Link | None:
    """Return a link; None after an error in its start or end."""
    ends = [_read_end(section, key, floors, attachments) for key in ("from", "to")]
    has_spring = section.mentions("stiffness", "law")
    if not (has_spring or section.mentions("dashpot", "inertance")):
        section.value.fault("give at least one of `stiffness`, `law`, `dashpot` and `inertance`")
    spring = _read_device(section, unit, has_spring=has_spring)
    start, end = ends
    if start is None or end is None:
        return None
    if start == end:
        section.value.fault("`from` and `to` must be different")
        return None
    if start > end and not _has_equal_directions(spring.law):
        section.value.fault(
            "`from` must be below `to` for a law that differs in both directions; exchange both "
            "ends and both directions"
        )
    return Link(name, (start, end), spring)


def _has_equal_directions(law: Law) -> bool:
    """Return True if a law is equal in both directions."""
    declared, values = LAWS[law.name], law.parameters
    # The drifts of fractures have opposite signs.
    return sum(law.fracture) == 0.0 and (
        declared.symmetric(values) or declared.equal_directions(values)
    )


def _read_end(
    section: Section, key: str, floors: _Floors, attachments: Sequence[str]
) -> int | None:
    """Return an end of a link: 0 for the ground, a floor from 1, or an attachment after the roof;
    None after an error."""
    count, rows = floors
    value = section.need(key, "give ground, a floor, roof or an attachment")
    if value is None:
        return None
    if value.is_word(GROUND):
        return 0
    if value.word in attachments and not value.word.isdecimal():
        return (count or 0) + 1 + attachments.index(value.word)
    if not value.word.isdecimal() and not value.is_word(ROOF) and not rows:
        known = f"; attachments: {', '.join(attachments)}" if attachments else ""
        value.fault(f"must be ground, a floor from 1, roof or the name of an attachment{known}")
        return None
    return value.floor(count, rows) or None
