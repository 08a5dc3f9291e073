"""What a comparison must come to."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

from tdint.errors import UsageError, did_you_mean

if TYPE_CHECKING:
    from tdint.analysis.comparison.compare import Comparison

_MET: dict[str, tuple[Callable[[float, float], bool], str]] = {
    "correlation": (lambda value, limit: value >= limit, "at least {limit:g}"),
    "peak_ratio": (
        lambda value, limit: min(limit, 1.0 / limit) <= value <= max(limit, 1.0 / limit),
        "between {limit:g} and its inverse",
    ),
    "rms_difference": (lambda value, limit: value <= limit, "at most {limit:g}"),
}
"""By name, whether a value meets its limit, and what that is in words."""


def parse_requirement(text: str) -> tuple[str, float]:
    """Name and number of a requirement such as `correlation=0.9`.

    Raises
    ------
    UsageError
        Another form, an unknown name, or a number that is not positive.
    """
    name, _, number = (part.strip() for part in text.partition("="))
    if name not in _MET:
        hint = did_you_mean(name, _MET) or f"; known: {', '.join(_MET)}"
        raise UsageError(f"{text!r}: write NAME=NUMBER, such as correlation=0.9{hint}")
    try:
        limit = float(number)
    except ValueError:
        limit = math.nan
    if not 0.0 < limit < math.inf:
        raise UsageError(f"{text!r}: {name} must be a positive number")
    return name, limit


def unmet(comparison: Comparison, requirements: Sequence[tuple[str, float]]) -> list[str]:
    """A sentence for each floor and requirement that it does not meet."""
    return [
        f"{comparison.event.recording.source}: floor {floor.floor}: {name} is {value:.4g}, required is "
        + words.format(limit=limit)
        for floor in comparison.floors
        for name, limit in requirements
        for meets, words in [_MET[name]]
        if not meets(value := float(getattr(floor, name)), limit)
    ]
