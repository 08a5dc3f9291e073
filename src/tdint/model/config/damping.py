"""The `damping` of a model file."""

from __future__ import annotations

from tdint.model.definition import MAX_STORIES, Damping, ModalDamping, RayleighCoefficients, RayleighRatio
from tdint.model.keys.fields import Section, Value
from tdint.model.keys.kinds import NOT_NEGATIVE, RATIO, Choice, Either, EntriesOf, Key, Keys, Whole

_FORMS = "none, a ratio such as 5%, {rayleigh: ...} or {modal: ...}"
_RAYLEIGH_FORMS = "{ratio: ..., modes: ...} or {mass: ..., stiffness: ...}"
_ONE_STORY = (
    "a one-story model has one mode, and the ratio form needs two; "
    "write the ratio alone (damping: 5%), {rayleigh: {mass: a0, stiffness: a1}} or {modal: ratio}"
)

_LAST_MODE = 3
"""Of the two modes with the ratio of `damping: 5%`, the higher one, as far as there are so many."""

_MODE = Whole(1, MAX_STORIES)
_RATIOS = Either((RATIO, EntriesOf(RATIO, least=2)))
_RAYLEIGH = Keys(
    (
        Key("ratio", Either((RATIO, EntriesOf(RATIO, least=2, most=2))), "damping ratio in both modes, or in each"),
        Key("modes", EntriesOf(_MODE, least=2, most=2), "two modes, from 1 at the longest period"),
        Key("mass", NOT_NEGATIVE, "coefficient of the mass matrix, 1/s"),
        Key("stiffness", NOT_NEGATIVE, "coefficient of the initial stiffness matrix, s"),
    )
)
_FIRST_MODES = Keys(
    (Key("ratio", RATIO, "damping ratio", needed=True), Key("modes", _MODE, "how many modes have it", needed=True))
)
_MAPPING = Keys(
    (
        Key("rayleigh", _RAYLEIGH, "C = a0 M + a1 K, through the damping ratios of two modes or by coefficients"),
        Key("modal", Either((_RATIOS, _FIRST_MODES)), "damping ratios of modes"),
    ),
    one_of=(("rayleigh", "modal"),),
)
DAMPING = Either((Choice(("none",)), RATIO, _MAPPING))


def read_damping(value: Value | None, count: int | None) -> Damping:
    """The damping; `count` is the number of stories, None where a fault leaves it open."""
    if value is None or value.is_word("none"):
        return None
    if not value.is_list and not value.is_mapping:
        ratio = value.number(RATIO, what=_FORMS)
        return RayleighRatio((ratio, ratio), (1, min(count or 1, _LAST_MODE)))
    section = value.section(_MAPPING, _FORMS)
    if section is None:
        return None
    rayleigh, modal = section.get("rayleigh"), section.get("modal")
    if rayleigh and modal:
        value.fault("give either rayleigh or modal, not both")
    elif not section.mentions("rayleigh", "modal"):
        value.fault(f"must be {_FORMS}, got a mapping without either")
    if rayleigh:
        return _read_rayleigh(rayleigh, count)
    return _read_modal(modal, count) if modal else None


def _read_rayleigh(value: Value, count: int | None) -> Damping:
    section = value.section(_RAYLEIGH, _RAYLEIGH_FORMS)
    if section is None:
        return None
    by_ratio = section.mentions("ratio", "modes")
    if section.has("ratio", "modes") and section.has("mass", "stiffness"):
        value.fault("give either ratio and modes or mass and stiffness, not both")
        return None
    if not by_ratio and not section.mentions("mass", "stiffness"):
        value.fault(f"must be {_RAYLEIGH_FORMS}, got a mapping without either")
        return None
    if by_ratio:
        return _read_ratio_form(section, count)
    return RayleighCoefficients(section.number("mass"), section.number("stiffness"))


def _read_ratio_form(section: Section, count: int | None) -> Damping:
    if count == 1:
        section.value.fault(_ONE_STORY)
        return None
    ratio = section.need("ratio", "give one damping ratio or a list of two")
    ratios = _read_ratios(ratio) if ratio else None
    if ratio and ratios and len(ratios) > 2:
        ratio.fault(f"must be one damping ratio or a list of two, got {len(ratios)}")
    modes = _read_modes(section.need("modes", "give a list of two modes"), count)
    return RayleighRatio((ratios[0], ratios[-1]), modes) if ratios and modes else None


def _read_ratios(value: Value) -> tuple[float, ...] | None:
    """One ratio, or those of a list with at least two."""
    if not value.is_list:
        return (value.number(RATIO),)
    items = value.items("a list of damping ratios") or ()
    if len(items) < 2:
        value.fault("a list must hold at least two damping ratios; write a single one without brackets")
        return None
    return tuple(item.number(RATIO) for item in items)


def _read_modes(value: Value | None, count: int | None) -> tuple[int, int] | None:
    items = value.items("a list of two modes") if value else None
    if value is None or items is None:
        return None
    if len(items) != 2:
        value.fault(f"must be a list of two modes, got {len(items)}")
        return None
    first, second = (item.counted(count) for item in items)
    if first is None or second is None:
        return None
    if first == second:
        value.fault(f"must be two different modes, got {first} twice")
    return first, second


def _read_modal(value: Value, count: int | None) -> Damping:
    if value.is_mapping:
        return _read_first_modes(value, count)
    ratios = _read_ratios(value)
    if ratios and count and len(ratios) > count:
        value.fault(f"must hold at most {count} damping ratios (one per mode), got {len(ratios)}")
    return ModalDamping(ratios) if ratios else None


def _read_first_modes(value: Value, count: int | None) -> Damping:
    """One ratio for the first modes; the rest are undamped."""
    section = value.section(_FIRST_MODES)
    if section is None:
        return None
    ratio = section.number("ratio")
    modes = section.need("modes", "give the number of modes to damp")
    damped = modes.counted(count) if modes else None
    if damped is None:
        return None
    # A single ratio would mean all modes, so a lone first mode is followed by an undamped one.
    return ModalDamping((ratio, 0.0) if damped == 1 and count != 1 else (ratio,) * damped)
