"""Text files of the Turkish network (AFAD, formerly NSMN): three components in columns, gal.

The file consists of lines `KEY : value`, including the peaks of the components, a line with the
names of the components, and the samples (AFAD, strong ground motion records of Turkiye, text
export).
"""

from __future__ import annotations

from tdint.errors import RecordError
from tdint.ground_motion.formats import series
from tdint.ground_motion.formats.lines import COUNT, NUMBER, Lines, recognizer
from tdint.number_parsing import any_case

_TITLE = r"^\s*STRONG GROUND MOTION RECORDS OF TURK"
_POINTS = rf"^\s*NUMBER OF DATA\s*:\s*({COUNT})\s*$"
_STEP = rf"^\s*SAMPLING INTERVAL\s*\(sec\)\s*:\s*({NUMBER})\s*$"
_PEAKS = r"^\s*RAW PGA VALUES\s*\(([^)]*)\)\s*:(.*)"
_PEAK = any_case(rf"\(([-A-Z]+)\)\s*({NUMBER})")
_STATION = r"^\s*STATION ID\s*:\s*(\S+)"
_START = (
    r"^\s*RECORD TIME\s*:\s*(?P<day>\d+)/(?P<month>\d+)/(?P<year>\d+)\s+"
    rf"{series.CLOCK}\s*\((?:GMT|UTC)\)"
)
_EARTHQUAKE = r"^\s*EARTHQUAKE DATE\s*:\s*(\d.*?)\s*\(?(?:GMT|UTC)\)?\s*$"
_NAMES = any_case(r"\s*(?:[NSEWUD]-[NSEWUD]\s*){1,3}")


@recognizer
def is_afad(lines: list[str]) -> object:
    """Return True if a file starts with the title of the Turkish network (AFAD)."""
    return series.Header(lines[:1]).match(_TITLE)


@series.reader
def read_afad(lines: Lines) -> list[series.Series]:
    """Read an AFAD file, and return its components with the units and the peaks in the header."""
    header = series.Header(
        lines.take_until(_NAMES.fullmatch, "line with the names of the components")
    )
    names = lines.take().split()
    points, step, peaks = map(header.match, (_POINTS, _STEP, _PEAKS))
    if not (points and step and peaks):
        raise RecordError(
            "the header of the file must state the number of data, the sampling interval and the "
            "units"
        )
    units = series.required_units(peaks[1])
    peak_by_name = {name.upper(): value for name, value in _PEAK.findall(peaks[2])}
    columns = lines.table(int(points[1]), len(names))
    lines.expect_end()
    return [
        series.Series(
            column,
            float(step[1]),
            units,
            channel=series.code(name).replace("-", "").upper(),
            station=header.code(_STATION),
            start=header.moment(_START),
            event=header.field(_EARTHQUAKE),
            peak=series.stated_peak(peak_by_name.get(name.upper(), ""), units, units),
        )
        for name, column in zip(names, columns, strict=True)
    ]
