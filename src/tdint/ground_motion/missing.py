"""Errors of readers that require an option of the user: properties that a record does not state,
and files that contain something other than a ground motion."""

from __future__ import annotations

from typing import NamedTuple

from tdint.errors import RecordError
from tdint.units import STANDARD_GRAVITY


class Missing(NamedTuple):
    """Properties of a record that the file does not state and that the user must specify.

    A reader lists all properties together, so that a single question requests them. A reader does
    not have the units that the user specified; the caller removes `units` if these are specified.

    Attributes
    ----------
    step : bool
        The sampling interval is required (`step`).
    units : str
        Likely units of the samples, which are required (`units`); empty if these are known.
    columns : tuple of str
        Columns to select from (`column`, at least one): names, or numbers counted from 1.
    rows : bool
        Each line may continue the ground motion; `rows` is then the alternative to `column`.
    skip_lines : int
        Number of lines at the beginning that must be skipped (`skip_lines`); may be 0.
    """

    step: bool = False
    units: str = ""
    columns: tuple[str, ...] = ()
    rows: bool = False
    skip_lines: int = 0


def likely_units(peak: float) -> str:
    """Return the units that make the maximum of an acceleration plausible."""
    if peak <= 1.5:  # g; larger accelerations of the ground are very rare
        return "g"
    return "m/s^2" if peak <= 1.5 * STANDARD_GRAVITY else "cm/s^2"


class IncompleteRecord(RecordError):
    """Record that can be read if the user specifies the properties in `missing`."""

    def __init__(self, message: str, missing: Missing) -> None:
        super().__init__(message)
        self.missing = missing


class OtherContent(RecordError):
    """File that is recognized as something other than a ground motion: response spectra, the table
    of a search. A directory may contain such files.

    Attributes
    ----------
    content : str
        Type of the content, for the list of the files of a directory.
    """

    def __init__(self, message: str, content: str = "other content") -> None:
        super().__init__(message)
        self.content = content
