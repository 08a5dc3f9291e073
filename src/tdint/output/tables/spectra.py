"""Tables of ground motions: properties, intensity measures and spectra."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any

import numpy as np

from tdint.arrays import Array
from tdint.errors import AnalysisError
from tdint.ground_motion.measures import (
    BUILTIN_MEASURES,
    HOUSNER_PERIODS,
    MEASURES,
    Measures,
    integrate,
    measure,
    spectrum_intensity,
)
from tdint.ground_motion.record import Record, named_components
from tdint.items import grouped
from tdint.output.tables.columns import declared
from tdint.output.tables.table import FLOOR, RECORD_COLUMNS, Column, Table, columns_of, placeholder
from tdint.response.spectra.elastic import SA_DAMPING, Spectrum, spectrum
from tdint.tabular import Tabular
from tdint.units import suffix

if TYPE_CHECKING:
    from tdint.response.arguments import AnyRecord
    from tdint.response.spectra.floor_motions import FloorSpectrum
    from tdint.response.spectra.rotated import RotatedSpectrum
    from tdint.response.spectra.target import SpectrumDifference


def _measure_column(name: str) -> Column:
    """Return the column of an intensity measure of `MEASURES` in the table of `tdint info`."""
    intensity = MEASURES[name]
    head = f"{intensity.head}{suffix(intensity.unit)}"
    return Column(head, intensity.unit, lambda info: info.measures.value(name), intensity.meaning)


_info: RecordInfo = placeholder()
INFO = (
    *RECORD_COLUMNS,
    *declared(
        "spectra.info-1",
        _info.record,
        samples=_info.record.acceleration.size,
        id=lambda info: info.record.id if info.record.id.strip(".") else "",
        units=lambda info: f"{info.record.units} ({info.record.units_from})",
    ),
    *map(_measure_column, BUILTIN_MEASURES),
    *declared(
        "spectra.info-2",
        _info.measures,
        housner_intensity_m=_info.housner_intensity,
        predominant_period_s=_info.predominant_period,
        notes=lambda info: "; ".join(info.notes),
    ),
)

MOTION = (*RECORD_COLUMNS, *declared("spectra.motion"))
"""Columns of ground motions after processing and scaling."""

SAMPLES: tuple[Column, ...] = (
    Column.named("time", "time from the first sample", "s"),
    Column.named("acceleration", "ground acceleration", "m/s^2"),
)
"""Columns of a record."""

GROUND = (*SAMPLES, *declared("spectra.ground"))
"""Columns of an exported ground motion."""


def ground_table(record: Record) -> Table:
    """Return acceleration, velocity and displacement of a record at its samples."""
    motion = integrate(record)
    attributes = {"time": record.time, "acceleration": record.acceleration} | motion._asdict()
    return Table.of_results(GROUND, [SimpleNamespace(**attributes)])


_rotated: RotatedSpectrum = placeholder()
MOTION_COLUMNS = (
    Column("record", "text", _rotated.motion.source, "file of the first component"),
    Column("component", "text", _rotated.motion.component, "both components"),
)
"""First columns of tables over pairs of components."""

SPECTRUM = columns_of(Spectrum)


TARGET = (
    Column("target", "text", "source", "design spectrum with its parameters, or file"),
    SPECTRUM[1],
    *declared("spectra.target"),
)
"""Columns of a target spectrum."""


def difference(published: str) -> tuple[Column, ...]:
    """Return the columns of the comparison of a computed with a published spectrum.

    `published` is the column of spectra that the published file contains, such as `psa_m_s2`.
    """
    compared = next(column for column in SPECTRUM if column.name == published)
    published_meaning = f"published: {compared.meaning}"
    return (
        *SPECTRUM[:2],
        Column(compared.name, compared.unit, "computed", compared.meaning),
        Column(f"published_{compared.name}", compared.unit, "expected", published_meaning),
        Column.named("relative_difference", "computed value divided by published value, minus 1"),
    )


ROTATED_END = declared(
    "spectra.rotated_end",
    geometric_mean_psa_m_s2=_rotated.geometric_mean,
    rotd100_angle_deg=_rotated.angle,
)


def rotated(percentiles: Sequence[int]) -> tuple[Column, ...]:
    """Return the columns of a rotated spectrum (RotDnn), with a column for each percentile.

    Parameters
    ----------
    percentiles : sequence of int
        Percentiles of the pseudo-acceleration over all horizontal directions: 100 for the maximum
        (RotD100), 50 for the median (RotD50). They are the rows of the attribute `psa`.
    """
    percentile_columns = (
        Column(
            f"rotd{percentile:02d}_psa_m_s2",
            "m/s^2",
            _rotated.psa[row],
            f"pseudo-acceleration, percentile {percentile} over all directions",
        )
        for row, percentile in enumerate(percentiles)
    )
    return (*SPECTRUM[:2], *percentile_columns, *ROTATED_END)


@dataclass(frozen=True, repr=False)
class RecordInfo(Tabular):
    """Properties of a record: its intensity measures, Housner intensity and predominant period.

    Attributes
    ----------
    record : Record
        Ground motion.
    measures : Measures
        Intensity measures.
    housner_intensity : float
        Housner intensity, m.
    predominant_period : float
        Predominant period, s.
    """

    record: Record
    measures: Measures
    housner_intensity: float = math.nan
    predominant_period: float = math.nan

    @property
    def notes(self) -> tuple[str, ...]:
        """Notes and warnings about the record."""
        return (*self.record.warnings, *self.record.notes, *self.measures.notes)

    def _headline(self) -> str:
        """Return source, component, duration and PGA of the record, for the text of a notebook."""
        record = self.record
        return f"of {record.name}: {record.duration:.4g} s, PGA {record.pga:.4g} m/s^2"


_HOUSNER = 481
"""Number of periods of the spectrum that the Housner intensity integrates, at steps of 0.005 s."""


def record_info(record: AnyRecord) -> RecordInfo:
    """Return properties and intensity measures of a record: the columns of `tdint info`.

    Parameters
    ----------
    record : Record, str, Path or ObsPy trace
        Record, in any form that `run` accepts.

    Returns
    -------
    RecordInfo
        Sampling, processing and intensity measures.

    Raises
    ------
    RecordError
        The record is invalid or cannot be read.
    """
    from tdint.response.arguments import record_of

    ground_motion = record_of(record)
    housner = _spectrum(ground_motion, np.linspace(*HOUSNER_PERIODS, _HOUSNER))
    return RecordInfo(
        ground_motion,
        measure(ground_motion),
        spectrum_intensity(housner.periods, housner.psv) if housner else math.nan,
        _predominant_period(ground_motion, housner),
    )


_PREDOMINANT = (0.02, 10.0, 625)
"""First and last period, s, and number of periods of the spectrum for the predominant period. Their
steps of 1 % are finer than the width of the peaks of a spectrum with 5 % damping."""

_STRIDES = (16, 8, 4, 2, 1)
"""Distances of the periods that are evaluated one after the other."""

_MARGIN = 1e-6  # relative margin of a bound for the errors of the maxima


def _predominant_period(record: Record, known: Spectrum | None) -> float:
    """Return the period of the maximum of the pseudo-acceleration at the periods `_PREDOMINANT`, s;
    nan if it cannot be computed.

    Periods whose pseudo-acceleration cannot be the maximum are not evaluated. `known` is a spectrum
    at other periods, which also limits the values between its periods. With p = ln omega,
    y = du/dp is the response of the oscillator to the load f = 2 omega^2 u + 2 xi omega u'. The
    maximum of omega^2 y is at most C = coth(pi xi / (2 sqrt(1 - xi^2))) times that of f, and that
    of omega y' too. With z, the larger one of omega^2 |u| and omega |u'|, follows
    |dz/dp| <= 2 (1 + C (1 + xi)) z, so that z changes by the factor exp(28.8 |dp|) at most.
    """
    if not 0.0 < record.pga < math.inf:
        return math.nan
    periods = np.geomspace(*_PREDOMINANT)
    xi = SA_DAMPING
    rate = 2.0 * (1.0 + (1.0 + xi) / math.tanh(0.5 * math.pi * xi / math.sqrt(1.0 - xi**2)))
    psa, bounds = np.zeros(periods.size), np.full(periods.size, math.inf)
    spectra = known
    for stride in _STRIDES:
        if spectra is not None:
            sizes = np.maximum(spectra.psa, 2.0 * math.pi / spectra.periods * spectra.sv)
            distances = np.abs(np.log(periods[:, None] / spectra.periods))
            bounds = np.minimum(bounds, np.min(sizes * np.exp(rate * distances), axis=1))
        is_chosen = bounds * (1.0 + _MARGIN) >= np.max(psa)
        is_chosen &= (psa == 0.0) & (np.arange(periods.size) % stride == 0)
        if not np.any(is_chosen):
            continue
        spectra = _spectrum(record, periods[is_chosen])
        if spectra is None:
            return math.nan
        psa[is_chosen] = spectra.psa
    return float(periods[int(np.argmax(psa))])


def _spectrum(record: Record, periods: Array) -> Spectrum | None:
    """Return the spectrum with 5 % damping; None if the shortest period requires a shorter sampling
    interval. The user did not request it, so this is not an error."""
    try:
        return spectrum(record, periods, SA_DAMPING)
    except AnalysisError:
        return None


_PAIRED_MEASURES = ("pga", "pgv", "pgd", "arias", "d5-95")
"""Intensity measures of both the matched ground motion and its scaled seed."""


def _match_measure(index: int, name: str) -> Callable[[Any], Any]:
    """Return a function of a spectral match, which returns the intensity measure `name` of the
    matched ground motion (index 0) or of its scaled seed (index 1), shape (1,)."""
    return lambda matched: np.array([matched.measures[index].value(name)])


def _end_displacement(index: int) -> Callable[[Any], Any]:
    """Return a function of a spectral match, which returns the ground displacement (m) at the end
    of the matched ground motion (index 0) or of its scaled seed (index 1), shape (1,)."""
    return lambda matched: np.array([matched.motions[index].displacement[-1]])


MATCHED = (
    *declared("spectra.matched"),
    *(
        Column(
            f"{seed}{MEASURES[name].head}{suffix(MEASURES[name].unit)}",
            MEASURES[name].unit,
            _match_measure(index, name),
            f"{MEASURES[name].meaning}{', of the scaled seed' if seed else ''}",
        )
        for name in _PAIRED_MEASURES
        for index, seed in enumerate(("", "seed_"))
    ),
    *(
        Column(
            f"{seed}end_displacement_m",
            "m",
            _end_displacement(index),
            "ground displacement at the end, starting from "
            f"rest{', of the scaled seed' if seed else ''}",
        )
        for index, seed in enumerate(("", "seed_"))
    ),
)
"""Columns of matched.csv."""


def info_table(infos: Iterable[RecordInfo]) -> Table:
    """Return the table of the properties and intensity measures of records, one row per record.

    Measures of plug-ins have columns before the notes. A note about all components of a file is
    listed only with the first component.
    """
    rows = list(infos)
    by_file = grouped((info.record.source, info) for info in rows)
    listed = []
    for info in rows:
        first, *others = by_file[info.record.source]
        common = {text for text in first.notes if all(text in other.notes for other in others)}
        listed.append([text for text in info.notes if info is first or text not in common])
    added = [_measure_column(name) for name in MEASURES if name not in BUILTIN_MEASURES]
    table = Table.of_results((*INFO[:-1], *added, INFO[-1]), rows)
    return table._replace(
        rows=[(*row[:-1], "; ".join(texts)) for row, texts in zip(table.rows, listed, strict=True)]
    )


def record_table(columns: Sequence[Column], results: Sequence[Any]) -> Table:
    """Return the table of results that have an attribute `record`.

    The first two columns are the file of the record and its component; `columns` are the further
    columns.
    """
    # The names of the components depend on all records: a component that a file contains twice gets
    # its full identifier.
    records = [result.record for result in results]
    return Table.of_results((*RECORD_COLUMNS, *columns), results, named_components(records))


def result_table(results: Sequence[Any], additional: Sequence[str] = ()) -> Table:
    """Return the table of results of a class, such as spectra, that have an attribute `record`.

    Parameters
    ----------
    results : sequence of object
        Results of the same class. The annotations of the class declare the columns (`Quantity`).
    additional : sequence of str
        Names of optional quantities that have columns in this table, such as settings that differ
        between the results; empty by default.
    """
    return record_table(columns_of(type(results[0]), *additional), results)


def difference_table(lines: Sequence[SpectrumDifference]) -> Table:
    """Return the table of the comparison of computed with published spectra.

    There is one row per record, component, damping ratio and period, with both values and their
    relative difference.
    """
    from tdint.response.spectra.target import QUANTITIES

    return record_table(difference(QUANTITIES[lines[0].published.quantity][1]), lines)


def rotated_table(spectra: Sequence[RotatedSpectrum], additional: Sequence[str] = ()) -> Table:
    """Return the table of rotated spectra, with a row per ground motion, damping ratio and
    period.

    Parameters
    ----------
    spectra : sequence of RotatedSpectrum
        Spectra with the same percentiles. Each percentile has a column.
    """
    # The columns of the settings follow the columns that all spectra have.
    setting_columns = columns_of(Spectrum, *additional)[len(SPECTRUM) :]
    columns = (*MOTION_COLUMNS, *rotated(spectra[0].percentiles), *setting_columns)
    return Table.of_results(columns, spectra)


def motion_table(records: Sequence[Record]) -> Table:
    """Return the table of the sampling, scale factor and peak of ground motions, one row per
    record."""
    return Table.of_results(MOTION, records, named_components(records))


def _percent(name: str) -> Callable[[Record], float]:
    """Return a function that returns a value of the origin of a record in percent."""
    return lambda record: 100.0 * float(getattr(record.origin, name))


_MATCH_ORIGIN = (
    *RECORD_COLUMNS,
    Column(
        "seed",
        "text",
        lambda record: f"{Path(record.origin.seed).name} {record.origin.seed_component}".rstrip(),
        "file and component of the seed",
    ),
    Column("seed_factor", "1", placeholder().origin.factor, "scale factor of the seed"),
    *(
        Column(name, "%", _percent(name), meaning)
        for name, meaning in (
            ("change", "root mean square of the change over that of the scaled seed"),
            ("largest_misfit", "maximum misfit of the spectrum to the target"),
            ("mean_misfit", "mean misfit of the spectrum to the target"),
        )
    ),
)
"""Columns of the origins of matched motions in a report."""


def match_origin_table(records: Sequence[Record]) -> Table:
    """Return the table of seeds, factors, changes and misfits of all records that are matched
    motions."""
    is_matched = [bool(record.origin and record.origin.target) for record in records]
    matched = list(itertools.compress(records, is_matched))
    heads = itertools.compress(named_components(records), is_matched)
    return Table.of_results(_MATCH_ORIGIN, matched, heads)


def floor_spectrum_table(spectra: Sequence[FloorSpectrum]) -> Table:
    """Return the table of floor spectra, with a row per floor, damping ratio and period."""
    heads = [(floor_spectrum.floor,) for floor_spectrum in spectra]
    return Table.of_results(
        (FLOOR, *SPECTRUM), [floor_spectrum.spectrum for floor_spectrum in spectra], heads
    )
