"""Settings of a run, which the command line, campaign files and Python calls specify."""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import Any, TypeVar

from tdint.response.arguments import number_of


@dataclass(frozen=True, kw_only=True)
class RunSettings:
    """Settings of a run. They are passed unchanged from the interfaces to the time integration.

    The options of the command line and the keys of campaign files have the names of the fields.

    Attributes
    ----------
    dt, duration : float | None
        Time step and duration, s. None: the value in the model or, if the model has none, the value
        of the record.
    until_rest : bool
        Continue with the ground at rest until free vibration has decayed
        (`tdint.response.runs.case`), so that residual drifts are the drifts at rest.
    check : bool
        Estimate the errors of the peaks.
    """

    dt: float | None = None
    duration: float | None = None
    until_rest: bool = False
    check: bool = False

    def __post_init__(self) -> None:
        """Raise UsageError if the time step or the duration is not a number."""
        for name in ("dt", "duration"):
            object.__setattr__(self, name, number_of(getattr(self, name), name))


SettingsT = TypeVar("SettingsT", bound=RunSettings)


def settings_from(request: object, settings_class: type[SettingsT], **values: Any) -> SettingsT:
    """Return settings with the values of the attributes of `request` that have the names of the
    fields. `values` contains the other fields, or replaces these attributes."""
    names = [item.name for item in fields(settings_class) if hasattr(request, item.name)]
    return settings_class(**{name: getattr(request, name) for name in names} | values)
