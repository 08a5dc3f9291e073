"""Standard acceleration files of the Mexican networks (ASA, version 2): up to twelve channels in
columns.

The header consists of lines `KEY : value` in Spanish, with the values of channels separated by
slashes. A line with the directions of the channels between two rulers and the samples follow (Base
mexicana de sismos fuertes, archivo estandar de aceleracion, 2.0).
"""

from __future__ import annotations

import re
import warnings

from tdint.arrays import Array
from tdint.errors import RecordError
from tdint.ground_motion.formats import series
from tdint.ground_motion.formats.lines import Lines, is_row_of_numbers, recognizer, row_of_numbers
from tdint.number_parsing import any_case, pluralize

_TITLE = r"^\s*ARCHIVO EST[AÁ]NDAR DE ACELERACI[OÓ]N"
_DATA = any_case(r"\s*DATOS DE ACELERACI[OÓ]N")
_RULER = re.compile(r"[-+]{20,}\s*")
_STATION = r"^\s*CLAVE DE LA ESTACI[OÓ]N\s*:\s*(\S+)"
_UNITS = r"^\s*UNIDADES DE LOS DATOS\s*:\s*([A-Z/^0-9]+)"
_STEPS, _COUNTS, _PEAKS, _NAMES = (
    any_case(rf"^\s*{key}[^:]*C\d+-C\d+[^:]*:\s*(/.*)")
    for key in (
        "INTERVALO DE MUESTREO",
        r"NUM\. TOTAL DE MUESTRAS",
        r"ACEL\. MAX\.\s*\(Gal\)",
        "ORIENTACI[OÓ]N",
    )
)
_DATE = r"^\s*FECHA DEL SISMO\s*\[GMT\]\s*:\s*(\d+)/(\d+)/(\d+)"
_ORIGIN = r"^\s*HORA EPICENTRO\s*\(GMT\)\s*:\s*(\d+):(\d+):(\d+(?:\.\d*)?)"
_FIRST = r"^\s*HORA DE LA PRIMERA MUESTRA\s*\(GMT\)\s*:\s*(\d+):(\d+):(\d+(?:\.\d*)?)"
_GAL = "gal"  # unit of the peaks in the header


@recognizer
def is_unam(lines: list[str]) -> object:
    """Return True if the first 20 lines of a file contain the title of an ASA file."""
    return series.Header(lines[:20]).match(_TITLE)


@series.reader
def read_unam(lines: Lines) -> list[series.Series]:
    """Read an ASA file, and return its channels with the units and the peaks in the header."""
    header = series.Header(lines.take_until(_DATA.match, "start-of-data line"))
    steps, counts, peaks, names = (
        _values_of_channels(pattern, header) for pattern in (_STEPS, _COUNTS, _PEAKS, _NAMES)
    )
    if (
        not names
        or not len(names) == len(steps) == len(counts)
        or len(set(counts)) > 1
        or not counts[0].isdigit()
    ):
        raise RecordError(
            "the header of the file must state direction, sampling interval and the same number of "
            "samples for each channel"
        )
    # The samples follow the second ruler. The directions between the rulers are already known.
    for _line in range(2):
        lines.take_until(_RULER.fullmatch, "ruler before the samples")
        lines.take()
    columns = lines.table(int(counts[0]), len(names))
    _skip_repeated_rows(lines, columns)
    units = header.field(_UNITS)
    unit = series.required_units(units) if units else ""

    intervals = []
    for step in steps:
        try:
            intervals.append(float(step))
        except ValueError:
            raise RecordError(
                f"the sampling interval must be a number, but the header states {step!r}"
            ) from None

    # The date of the first sample is the date of the earthquake, or the day after or before it if
    # midnight is between the two times.
    start = None
    date, origin, first = map(header.match, (_DATE, _ORIGIN, _FIRST))
    if date and first:
        year, month, day = map(float, date.groups())
        hour, minute, second = map(float, first.groups())
        added_days = round((int(origin[1]) - int(first[1])) / 24) if origin else 0
        # The last argument is a time zone in hours.
        start = series.moment(year, month, day, hour, minute, second, -24.0 * added_days)
    # The date starts with the year.
    event = "-".join(date.groups()) if date else ""
    if date and origin:
        event += f" {int(origin[1]):02d}:{int(origin[2]):02d}:{int(float(origin[3])):02d}"

    # Directions are, for example, N90E, or V for vertical. Other text may precede a direction.
    return [
        series.Series(
            column,
            intervals[index],
            unit,
            channel=series.code(name.rpartition(";")[2]).upper(),
            station=header.code(_STATION),
            start=start,
            event=event,
            peak=series.stated_peak(peaks[index], _GAL, unit)
            if unit and len(peaks) == len(names)
            else None,
        )
        for index, (name, column) in enumerate(zip(names, columns, strict=True))
    ]


def _values_of_channels(pattern: re.Pattern[str], header: series.Header) -> list[str]:
    """Return the values of a header key as text, in the order of the channels. A key has a second
    line if there are more than six channels.

    The first group of the pattern is a list of values between slashes. Empty values are omitted,
    because a line may have places for unused channels. The caller compares the number of values
    with the number of channels.
    """
    values: list[str] = []
    for match in filter(None, map(pattern.search, header)):
        values += match[1].strip().lstrip("/").split("/")
    return [value.strip() for value in values if value.strip()]


def _skip_repeated_rows(lines: Lines, columns: Array) -> None:
    """Skip rows at the end of a file that repeat the last row stated in the header, with a warning.
    Published files repeat the last row, although the header does not count these rows.

    RecordError is raised if any other line follows, or a row is missing.
    """
    last_row = [float(column[-1]) for column in columns]
    repeated = 0
    while (
        (line := lines.peek()) is not None
        and is_row_of_numbers(line)
        and row_of_numbers(line) == last_row
    ):
        lines.take()
        repeated += 1
    lines.expect_end()
    # If a row is missing, the last row stated in the header is already a repeated row.
    if repeated and all(column.size > 1 and column[-2] == column[-1] for column in columns):
        count = columns.shape[1]
        raise RecordError(
            f"the last of the {count} rows stated in the header equals the row before it and "
            f"{pluralize(repeated, 'extra row')} after it: a row is missing from the file; "
            "download it again"
        )
    if repeated:
        warnings.warn(
            f"{pluralize(repeated, 'row')} omitted that repeat the last row stated in the header",
            stacklevel=3,
        )
