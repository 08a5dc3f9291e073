"""A published spectrum, and how far a computed one is from it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from tdint.analysis.spectra.elastic import Spectrum
from tdint.arrays import Array
from tdint.errors import RecordError, UsageError
from tdint.ground_motion.formats.table_columns import name_and_units
from tdint.ground_motion.reading.named_table import SECONDS, NamedTable, read_named_table
from tdint.ground_motion.record import Input, Record
from tdint.units import parse_units

QUANTITIES = {
    "sd": ("displacement", "sd_m"),
    "psv": ("velocity", "psv_m_s"),
    "psa": ("acceleration", "psa_m_s2"),
    "sv": ("velocity", "sv_m_s"),
    "sa": ("acceleration", "sa_m_s2"),
}
"""By its name in a table and in `Spectrum`, the quantity that a value's units must be of, and our column of it."""

_PERIODS = ("t", "period", "periods")
_SAME = 1e-6
"""Relative difference up to which two periods, or damping ratios, are one: what is printed is rounded."""


@dataclass(frozen=True)
class PublishedSpectrum:
    """A spectrum as a file has it.

    Attributes
    ----------
    source : str
        The file as the user named it.
    quantity : str
        A key of `QUANTITIES`.
    periods, values : ndarray, shape (k,)
        s, growing, and SI units.
    input : Input
        The file with its SHA-256.
    """

    source: str
    quantity: str
    periods: Array
    values: Array
    input: Input

    def at(self, periods: Array, log_log: bool) -> Array:
        """The values at periods (s): those that the file has or, if `log_log`, on straight lines between their
        logarithms.

        Raises
        ------
        UsageError
            A period that the file does not have, or beyond those that it has.
        """
        near = np.abs(self.periods[:, None] - periods) <= _SAME * periods
        if np.all(near.any(axis=0)):
            found: Array = self.values[near.argmax(axis=0)]
            return found
        other = float(periods[~near.any(axis=0)][0])
        if not log_log:
            raise UsageError(
                f"{self.source} has no period {other:.6g} s; leave the periods out for those of the file, or "
                "interpolate with --against-interpolation log-log"
            )
        known = (self.periods > 0.0) & (self.values > 0.0)
        low, high = self.periods[known][0], self.periods[known][-1]
        outside = (periods < low * (1.0 - _SAME)) | (periods > high * (1.0 + _SAME))
        if np.any(outside):
            raise UsageError(f"{self.source} goes from {low:.6g} to {high:.6g} s, without {periods[outside][0]:.6g} s")
        return np.exp(np.interp(np.log(periods), np.log(self.periods[known]), np.log(self.values[known])))


@dataclass(frozen=True)
class SpectrumDifference:
    """A computed spectrum beside a published one; arrays of shape (k,).

    Attributes
    ----------
    spectrum : Spectrum
        As it was computed.
    published : PublishedSpectrum
        The file.
    expected : ndarray
        The published values at the periods of the spectrum.
    """

    spectrum: Spectrum
    published: PublishedSpectrum
    expected: Array

    @property
    def record(self) -> Record:
        """The ground motion."""
        return self.spectrum.record

    @property
    def damping(self) -> float:
        """The damping ratio."""
        return self.spectrum.damping

    @property
    def periods(self) -> Array:
        """Periods, s."""
        return self.spectrum.periods

    @property
    def computed(self) -> Array:
        """The computed values."""
        values: Array = getattr(self.spectrum, self.published.quantity)
        return values

    @property
    def relative_difference(self) -> Array:
        """Computed over published values, less 1; nan where the published value is 0."""
        expected = np.where(self.expected == 0.0, np.nan, self.expected)
        return self.computed / expected - 1.0

    @property
    def largest(self) -> tuple[float, float] | None:
        """The largest relative difference to either side, and its period, s; None if there is none."""
        difference = self.relative_difference
        if not np.any(np.isfinite(difference)):
            return None
        i = int(np.nanargmax(np.abs(difference)))
        return float(difference[i]), float(self.periods[i])


def read_published(source: str | Path, damping: float, column: str | None = None) -> PublishedSpectrum:
    """Read a published spectrum: CSV with names in its first line, which say quantity and units.

    Parameters
    ----------
    source : str or Path
        The file. It needs a column of periods (`period_s`, `T (s)`) and one of values (`psa_g`, `PSA (cm/s^2)`,
        `sd_cm`); names of quantities are those of `QUANTITIES`. Where it has a column `damping`, the rows of `damping`
        are taken.
    damping : float
        Damping ratio.
    column : str, optional
        Which of several columns of values.

    Raises
    ------
    RecordError
        The file cannot be read, has no such columns or units, or says a period twice.
    UsageError
        There are several columns of values, and none is named.
    """
    table = read_named_table(source)
    place, factor = _period_column(table)
    quantity, values = _values(table, column)
    periods = factor * table.numbers(place)
    rows = np.argsort(periods, kind="stable")
    if "damping" in table.names:
        ratios = table.numbers(table.place("damping"))
        rows = rows[np.abs(ratios[rows] - damping) <= _SAME]
        if not rows.size:
            known = ", ".join(f"{ratio:g}" for ratio in np.unique(ratios)[:8])
            raise RecordError(f"{source}: has no damping ratio {damping:g}; it has {known}")
    periods, values = periods[rows], values[rows]
    if periods[0] < 0.0 or np.any(values < 0.0):
        raise RecordError(f"{source}: periods and values of a spectrum are not negative")
    if np.any(np.diff(periods) == 0.0):
        twice = float(periods[:-1][np.diff(periods) == 0.0][0])
        raise RecordError(f"{source}: has the period {twice:g} s twice; leave one spectrum in it")
    return PublishedSpectrum(str(source), quantity, periods, values, table.input)


def differences(spectra: Sequence[Spectrum], published: PublishedSpectrum, log_log: bool) -> list[SpectrumDifference]:
    """Computed spectra beside a published one."""
    return [SpectrumDifference(one, published, published.at(one.periods, log_log)) for one in spectra]


def _period_column(table: NamedTable) -> tuple[int, float]:
    """Its place, and the factor to seconds."""
    for place, text in enumerate(table.names):
        name, units = name_and_units(text)
        if name in _PERIODS:
            if units not in SECONDS:
                raise RecordError(
                    f"{table.source}: the name of the column {text!r} must say its unit, such as period_s"
                )
            return place, SECONDS[units]
    raise RecordError(f"{table.source}: has no column of periods (period_s); there are {', '.join(table.names)[:200]}")


def _values(table: NamedTable, column: str | None) -> tuple[str, Array]:
    """Quantity and values (SI units) of the column."""
    known = {text: name_and_units(text) for text in table.names if name_and_units(text)[0] in QUANTITIES}
    if column is not None:
        table.place(column)
        if column not in known:
            raise RecordError(
                f"{table.source}: the column {column!r} is none of {', '.join(QUANTITIES)} with its units"
            )
    elif len(known) != 1:
        if known:
            raise UsageError(f"{table.source}: name one of its columns with --against-column: {', '.join(known)}")
        raise RecordError(
            f"{table.source}: has no column of a spectrum ({', '.join(QUANTITIES)}, with units: psa_g); there are "
            f"{', '.join(table.names)[:200]}"
        )
    chosen = column if column is not None else next(iter(known))
    name, text = known[chosen]
    try:
        units = parse_units(text)
    except UsageError:
        raise RecordError(
            f"{table.source}: the name of the column {chosen!r} must end with its units (psa_g)"
        ) from None
    if units.quantity != QUANTITIES[name][0]:
        raise RecordError(f"{table.source}: the column {chosen!r} has units of a {units.quantity}: {text}")
    values = units.scale * table.numbers(table.place(chosen))
    return name, values
