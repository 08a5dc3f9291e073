"""Statements in the header of a table: number of samples, sampling interval, units and peak of an
accelerogram, as declarations (`dt = 0.01 s, units = g`) or in free wording.

The words are English, and for the interval, the number of samples and the units also German,
French, Spanish, Italian and Portuguese. A number counts as a statement only next to a word that
names its quantity. Wrong statements are worse than none: a distance (`Delta: 5.3 km`) is not an
interval, and `8 values per line` is not a number of samples.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from datetime import UTC, datetime

from tdint.errors import RecordError
from tdint.ground_motion.choice import SAME_STEP
from tdint.ground_motion.formats import table_columns
from tdint.ground_motion.formats.lines import COUNT, NUMBER
from tdint.ground_motion.formats.series import motion_units
from tdint.number_parsing import any_case

MIN_COUNT = 20
"""Smallest number that counts as a number of samples; smaller numbers are values per line."""

MIN_STEP, MAX_STEP = 1e-5, 1.0
"""Sampling intervals of accelerograms, s; other numbers are not sampling intervals."""

_LONGEST_STATEMENT = 1000
"""Characters of the longest line that states properties. The time to search a line for words may
increase with the square of its length."""

_ITEMS = r"(?:POINTS|DATA|SAMPLES|VALUES|PTS|STEPS)"
_COUNTS = tuple(
    any_case(pattern)
    for pattern in (
        rf"\bN(?:PTS?|DATA|SAMPLES|POINTS)\b\s*[=:]?\s*({COUNT})\b(?!\.\d)",
        # Words may precede and follow the name: `NUMBER OF DATA POINTS (ACC) = 4000`.
        rf"(?:\b(?:NO\.?|NUMBER|NUM\.?)|#)\s*OF\s+(?:\w+\s+)?{_ITEMS}\b[^=:\d\n]{{0,20}}[=:]?"
        rf"\s*({COUNT})\b(?!\.\d)",
        rf"\b(?:NO\.|NUM\.?|N)\s*{_ITEMS}\s*[=:]\s*({COUNT})\b(?!\.\d)",
        rf"\b(?:DATA\s*)?{_ITEMS}\s*[=:]\s*({COUNT})\b(?!\.\d)",
        r"(?:\bN[UÚ]MERO\s+(?:DE|DI)\s+(?:MUESTRAS|DATOS|PUNTOS|CAMPIONI|PUNTI|DATI|AMOSTRAS)|"
        r"\bNOMBRE\s+DE\s+(?:POINTS|VALEURS|DONN[EÉ]ES)|\bANZAHL\s+(?:DER\s+)?(?:WERTE|PUNKTE))"
        rf"\b\s*[=:]?\s*({COUNT})\b(?!\.\d)",
        rf"(?<![\d.])({COUNT})\s+(?:\w+\s+)?(?:POINTS|SAMPLES|VALUES|PTS)\b(?!\s*/|\s+PER)",
    )
)

_IN_SECONDS = r"(?:[(\[]\s*(SECONDS?|SEC|S|MSEC|MS)\.?\s*[)\]])?"
_UNIT_OF_TIME = r"(?:\(?\s*(SECONDS?|SEC|S|MSEC|MS)\b)?"
_INTERVALS = tuple(
    any_case(rf"{pattern}\s*({NUMBER})\s*{_UNIT_OF_TIME}")
    for pattern in (
        rf"\b(?:DT|DELTA[ _-]?T)\b\s*{_IN_SECONDS}\s*[=:]?",
        r"\b(?:TIME|SAMPLING|SAMPLE|DIGITI[SZ]ATION)[-_ ]*"
        r"(?:STEP|INCREMENT|INTERVAL|PERIOD|SPACING|RATE)\b\s*"
        rf"{_IN_SECONDS}\s*(?:OF|IS)?\s*[=:]?",
        r"\b(?:(?:INTERVAL(?:O|LO)|PASO|PASSO|P[EÉ]RIODO)\s+D(?:E|I)\s+"
        r"(?:MUESTREO|TIEMPO|CAMPIONAMENTO|TEMPO|AMOSTRAGEM)|PAS\s+DE\s+TEMPS|"
        r"(?:PAS|P[EÉ]RIODE)\s+D['\u2019][EÉ]CHANTILLONNAGE|ABTASTINTERVALL|ZEITSCHRITT)\b\s*"
        rf"{_IN_SECONDS}\s*[=:]?",
        r"\b(?:EQUAL(?:LY)?[ -]SPAC(?:ED|INGS?)|(?:EQUAL\s+)?(?:TIME\s+)?INTERVALS?)\b\s*"
        rf"(?:\bINTERVALS?\s*)?(?:OF|AT)?\s*{_IN_SECONDS}\s*[=:]?",
        rf"\b(?:{_ITEMS}\s+(?:AT|SPACED)(?:\s+(?:AT|BY))?|EVERY)\s*{_IN_SECONDS}",
    )
)
"""Patterns of an interval. Groups: unit in brackets after the name, number, unit after the
number."""

_OTHER_UNIT = any_case(r"\s*\(?\s*(?:KM|DEG|M|CM|MM|HZ|SPS|%|SAMPLES|H|HR|HOURS?|MIN)(?![A-Z])")
"""Units that show that a number is not an interval."""

_RATES = tuple(
    any_case(pattern)
    for pattern in (
        r"\b(?:SAMPL(?:E|ING)[-_ ]*(?:RATE|FREQUENCY|FREQ\.?)|"
        r"SAMPLES\s*(?:/|PER)\s*S(?:EC(?:OND)?)?)(?![A-Z])\s*"
        rf"(?:[(\[]\s*(?:HZ|SPS)\s*[)\]])?\s*(?:OF|IS)?\s*[=:]?\s*({NUMBER})",
        r"\b(?:(?:TASA|FRECUENCIA|FREQUENZA|FREQU[EÊ]NCIA|TAXA)\s+D(?:E|I)\s+"
        r"(?:MUESTREO|CAMPIONAMENTO|AMOSTRAGEM)|FR[EÉ]QUENCE\s+D['\u2019][EÉ]CHANTILLONNAGE|"
        rf"ABTAST(?:RATE|FREQUENZ))\b\s*(?:[(\[]\s*HZ\s*[)\]])?\s*[=:]?\s*({NUMBER})",
        rf"({NUMBER})\s*(?:(?:SAMPLES|POINTS)\s*(?:/|PER)\s*S(?:EC(?:OND)?)?|SPS)\b",
        r"\b(?:SAMPLED|RECORDED|DIGITI[SZ]ED|SAMPLING|RECORDING|FS)\s*(?:AT|WITH|=|:)\s*"
        rf"({NUMBER})\s*(?:HZ|SPS)\b",
        rf"({NUMBER})\s*HZ\s+(?:SAMPLING|SAMPLE|DATA)\b",
    )
)
_MAX_RATE = 1e5  # samples per second

_UNIT = (
    r"(?:CMS?|MM|M|IN|FT)\s*(?:/\s*S(?:EC|EG)?(?:\s*/\s*S(?:EC|EG)?|\s*(?:\*\*|\^)?\s*2|\u00b2)|"
    r"[ .*\u00b7]\s*S(?:EC|EG)?\s*(?:\*\*|\^)?\s*(?:-\s*2|\u207b\u00b2))|"
    r"GAL(?:E?S)?|MILLI-?GS?|MG|%\s*G|G(?:'S)?(?:/10)?"
)
_LONG_UNIT = rf"(?:{_UNIT.partition('|GAL')[0]}|GAL(?:E?S)?)"
"""Units that are no letter and no abbreviation of another word, and need no word before them."""

_NO_LONGER_UNIT = r"(?![\w/*^])"
_UNITS = tuple(
    any_case(rf"{pattern}\s*({_UNIT}){_NO_LONGER_UNIT}")
    for pattern in (
        r"\b(?:UNITS?|UNIDAD(?:ES)?|UNIT[EÉÀ]S?|UNIDADES?|EINHEIT(?:EN)?)(?!\w)[\s:=]*(?:(?:OF|ARE|IS|IN|ACCELERATION)[\s:=]+)*[(\[]?",
        r"\bA(?:CC(?:EL\w*)?|CELERACION\w*|CCELERAZION\w*|CC\u00c9L\w*)\b\.?"
        r"(?:\s+(?:TIME|SERIES|HISTORY|DATA|VALUES|RECORD))*\s*(?:IN\b|[:=,(\[])",
        r"\b(?:VALUES|DATA|SAMPLES|AMPLITUDES?|RECORD|HISTORY|MOTION)\s+(?:ARE\s+)?IN\b",
    )
)
_INTEGRAL_UNIT = any_case(
    r"\b(?:VEL(?:OCITY)?|DISPL?(?:ACEMENTS?)?)\b[\w ]{0,20}?(?:\bIN\b|[(\[=:,])\s*"
    rf"((?:CM|MM|M|IN|FT)(?:/S(?:EC)?)?){_NO_LONGER_UNIT}"
)
_ACCELERATION_UNIT = any_case(rf"\bACC(?:EL\w*)?\b[^\d]*?(?<![\w/])({_LONG_UNIT}){_NO_LONGER_UNIT}")
"""Unit after a word for the acceleration, used if no other pattern matches."""

_BARE_UNIT = any_case(rf"(?<![\w/*^]){_LONG_UNIT}{_NO_LONGER_UNIT}")
_AFTER_NUMBER = re.compile(r"\d\.?\s*[(\[]?\s*$")
_OTHER_VALUE = any_case(
    r"peak|max|min|limit|threshold|trigger|noise|offset|drift|gravity|scale|factor|resolution|"
    r"sensitivity|\bp?s[avd]\b|\bpg[avd]\b|vel|dis"
)
"""Words that show that a unit in a line without the word acceleration belongs to another value."""

_PEAK = any_case(
    r"\b(?:PGA|PEAK\s+(?:GROUND\s+)?(?:VALUE|ACC\w*\.?)|"
    r"MAX(?:IMUM)?\.?\s+(?:ABS\w*\.?\s+)?(?:VALUE|ACC\w*\.?))\s*"
    rf"[(\[]?\s*({_UNIT})?\s*[)\]]?\s*[=:]?\s*({NUMBER})\s*[(\[]?\s*({_UNIT})?{_NO_LONGER_UNIT}"
)
"""Pattern of a peak. Groups: unit after the name, number, unit after the number."""

_ACCELERATION = any_case(r"\bACC(?:EL\w*)?\b")
_INTEGRALS = {
    "velocity": any_case(r"\bVEL(?:OCITY)?\b|CM/SEC(?![/*^\w])"),
    "displacement": any_case(r"\bDISPL?(?:ACEMENT)?\b"),
}
_SPECTRA = any_case(
    r"\b(?:(?:RESPONSE (?:AND FOURIER AMPLITUDE )?|FOURIER (?:AMPLITUDE )?)SPECTR(?:A|UM)|"
    r"FOURIER AMPLITUDES)\b"
)
"""Pattern of a header of spectra, which data centers store as volume 3 of a record."""


@dataclass(frozen=True)
class Statements:
    """Statements of a header.

    Attributes
    ----------
    counts : frozenset of int
        Numbers of samples. A header may contain several, for example of the unprocessed record.
    intervals : tuple of float
        Sampling intervals, s, without repetition.
    units : tuple of str
        Units of the samples in the spelling of `motion_units`, without repetition. A declared unit
        that is not a unit of ground motion is unchanged.
    peak : tuple of (str, str)
        Peak in the spelling of the header and its units; both empty if it is not stated.
    integrals : tuple of str
        Quantities that the header names in addition to an acceleration.
    quantity : str
        Quantity of the samples if the header names no acceleration; otherwise `acceleration`.
    declared : dict of str to str
        Other declared values (`component`, `station`, `event`, ...).
    """

    counts: frozenset[int] = frozenset()
    intervals: tuple[float, ...] = ()
    units: tuple[str, ...] = ()
    peak: tuple[str, str] = ("", "")
    integrals: tuple[str, ...] = ()
    quantity: str = "acceleration"
    declared: dict[str, str] = field(default_factory=dict)

    def __bool__(self) -> bool:
        """Return True if the header states a property of the samples."""
        return bool(self.counts or self.intervals or self.units or self.peak[0] or self.declared)

    def with_interval(self, interval: float) -> Statements:
        """Return the statements with another statement of the sampling interval, s."""
        return replace(self, intervals=_without_repetition((*self.intervals, interval)))

    def get(self, key: str) -> str:
        """Return the declared value of a key; empty if it is not declared."""
        return self.declared.get(key, "")

    @property
    def start(self) -> datetime | None:
        """Start time in UTC, without time zone; None if the header declares no time in ISO 8601.

        A declared time without time zone is in UTC.
        """
        try:
            start = datetime.fromisoformat(self.get("start"))
            return start.astimezone(UTC).replace(tzinfo=None) if start.tzinfo else start
        except (ValueError, OverflowError):
            return None


def statements(lines: Sequence[str]) -> Statements:
    """Return the statements in the lines of a header.

    Raises
    ------
    RecordError
        A declared sampling interval or rate is not a positive number with a unit of time or rate.
    """
    # The origin of a motion that tdint wrote contains texts of the user, which are not statements.
    origins = [line for line in lines if line.lstrip("# ").startswith(f"{table_columns.ORIGIN} = ")]
    lines = [line for line in lines if len(line) <= _LONGEST_STATEMENT]
    lines = [_plain_text(line) for line in lines if line not in origins]
    declared = dict(pair for line in origins for pair in table_columns.declarations(line))
    counts: list[int] = []
    intervals: list[float] = []
    declared_units: list[str] = []
    for line in lines:
        intervals += _stated_intervals([line])
        for key, value in table_columns.declarations(line):
            if key in _INTERVAL_NAMES:
                wording = f"{_INTERVAL_NAMES[key]} = {value}"
                intervals += list(_stated_intervals([wording])) or _declared_interval(key, value)
            elif key == "samples" and re.fullmatch(COUNT, value):
                counts.append(int(value))
            elif key == "units":
                declared_units.append(_units(value) or value)
            elif key not in ("dt", "rate", "samples"):
                declared.setdefault(key, value)
    counts += [
        int(match[1])
        for line in lines
        for pattern in _COUNTS
        for match in pattern.finditer(line)
        if int(match[1]) >= MIN_COUNT
    ]
    peaks = [
        (match[2], _units(match[1] or match[3])) for line in lines for match in _PEAK.finditer(line)
    ]
    units = _stated_units(lines, declared_units)
    integrals = named_integrals(lines)
    has_unit = any(table_columns.quantity_of_units(unit) == "acceleration" for unit in units)
    names_acceleration = bool(has_unit or peaks) or any(map(_ACCELERATION.search, lines))
    return Statements(
        frozenset(counts),
        _without_repetition(intervals),
        units,
        peaks[0] if peaks else ("", ""),
        integrals,
        "acceleration" if names_acceleration or not integrals else integrals[0],
        declared,
    )


def _plain_text(line: str) -> str:
    """Return a header line without quotation marks and separators that a spreadsheet program adds.

    `"@ DT =",.02` becomes `@ DT = .02`, and `Sampling rate (Hz),100,,` becomes `Sampling rate (Hz)
    = 100`.
    """
    text = line.replace('"', "").rstrip(" \t\r,;")
    text = re.sub(r"([=:])\s*[,;\t]\s*", r"\1 ", text)
    name, mark, value = text.partition(next((mark for mark in "\t;," if mark in text), ","))
    is_pair = bool(mark) and (
        bool(re.fullmatch(rf"\s*{NUMBER}\s*[a-z/]*\s*", value, re.IGNORECASE))
        or (table_columns.is_key(name) and not re.search("[,;\t]", value))
    )
    return f"{name} = {value.strip()}" if is_pair and not re.search("[=:]", name) else text


def _stated_units(lines: Sequence[str], declared: list[str]) -> tuple[str, ...]:
    """Return the units of the samples; `declared` contains the declared units."""
    # The unit of a peak is not always the unit of the samples.
    others = [line for line in lines if not _PEAK.search(line)]
    units = [
        unit
        for line in others
        for pattern in _UNITS
        for match in pattern.finditer(line)
        if (unit := _units(match[1]))
    ]
    # A declaration that is not a unit may contain further text.
    known = [unit for unit in declared if motion_units(unit)]
    units += known or ([] if units else declared)
    if not units:
        is_integral = not any(map(_ACCELERATION.search, lines))
        matches = [match for line in others if (match := _INTEGRAL_UNIT.search(line))]
        units = [unit for match in matches if is_integral and (unit := _units(match[1]))]
    if not units:
        matches = [match for line in others if (match := _ACCELERATION_UNIT.search(line))]
        units = [unit for match in matches if (unit := _units(match[1]))]
    if not units:
        units = [unit for line in others for unit in _bare_units(line)]
    return tuple(dict.fromkeys(units))


def _bare_units(line: str) -> list[str]:
    """Return the units of an acceleration or a velocity in a line that names no quantity, such as
    `cm/s2; dt = 0.01`, `dt=0.01 g` and `# [gal]`.

    A short unit must be a complete part of the line. A unit after a number, such as 9.81 m/s2, is
    the unit of the number.
    """
    if _OTHER_VALUE.search(line):
        return []
    comment = table_columns.COMMENT.fullmatch(line)
    rest = comment[1] if comment else line
    for pattern in (*_INTERVALS, *_RATES, *_COUNTS):
        rest = pattern.sub(";", rest)
    cells = [cell.strip(" \t()[]'\"") for cell in re.split(r"[,;\t]|\s{2,}", rest)]
    exact = [
        unit
        for cell in cells
        if cell
        and not cell[0].isdigit()
        and (unit := _units(cell))
        and table_columns.quantity_of_units(unit) in ("acceleration", "velocity")
    ]
    return exact or [
        unit
        for match in _BARE_UNIT.finditer(rest)
        if not _AFTER_NUMBER.search(rest[: match.start()]) and (unit := _units(match[0]))
    ]


def _declared_interval(key: str, value: str) -> list[float]:
    """Return a declared sampling interval, or the reciprocal of a declared sampling rate, s; empty
    if the value is a distance."""
    if re.fullmatch(rf"{NUMBER}\s*(?:KM|DEG|M|CM|MM)", value, re.IGNORECASE):
        return []
    if key == "dt":
        return [_convert_quantity(value, table_columns.SECONDS, "dt")]
    return [1.0 / _convert_quantity(value, _PER_SECOND, "the sampling rate")]


_INTERVAL_NAMES = {"dt": "DT", "rate": "SAMPLING RATE"}
"""Names of the keys of the sampling interval and rate in free wording."""

_QUANTITY = any_case(rf"({NUMBER})\s*([a-z/]*)")
_PER_SECOND = {"": 1.0, "hz": 1.0, "sps": 1.0, "/s": 1.0}


def _convert_quantity(text: str, units: dict[str, float], quantity: str) -> float:
    """Convert a positive number with a unit, such as `10 ms`, to SI units. The key "" of the
    allowed units allows a number without a unit. Any other text is a RecordError.
    """
    match = _QUANTITY.fullmatch(text.strip())
    factor = units.get(match[2].lower()) if match else None
    if not match or factor is None or not float(match[1]) > 0.0:
        names = ", ".join(filter(None, units))
        raise RecordError(
            f"{quantity} must be a positive number in {names}, but the header states {text!r}"
        )
    return float(match[1]) * factor


def _without_repetition(intervals: Sequence[float]) -> tuple[float, ...]:
    """Return sampling intervals without repetitions."""
    different: list[float] = []
    for interval in intervals:
        if not any(abs(interval - other) <= SAME_STEP * other for other in different):
            different.append(interval)
    return tuple(different)


def named_spectra(lines: Sequence[str]) -> str:
    """Return the name of spectra in the lines of a header; empty without a name.

    Comments are ignored, because they may name the spectrum of an accelerogram.
    """
    matches = (_SPECTRA.search(line) for line in lines if not table_columns.COMMENT.fullmatch(line))
    return next((" ".join(match[0].split()) for match in matches if match), "")


def named_integrals(lines: Sequence[str]) -> tuple[str, ...]:
    """Return the quantities, velocity and displacement, that lines of text name."""
    text = "\n".join(lines)
    return tuple(name for name, pattern in _INTEGRALS.items() if pattern.search(text))


def _stated_intervals(lines: Sequence[str]) -> Iterator[float]:
    """Yield the sampling intervals, s, and the reciprocals of the sampling rates in a header."""
    for line in lines:
        for pattern in _INTERVALS:
            for match in pattern.finditer(line):
                unit = (match[3] or match[1] or "").lower()
                interval = float(match[2]) * table_columns.SECONDS[unit]
                is_time = bool(match[3]) or not _OTHER_UNIT.match(line, match.end())
                if is_time and MIN_STEP <= interval <= MAX_STEP:
                    yield interval
        for pattern in _RATES:
            for match in pattern.finditer(line):
                rate = float(match[1])
                if 1.0 < rate < _MAX_RATE:
                    yield 1.0 / rate


def _units(text: str | None) -> str:
    """Return a unit in the spelling of `motion_units`; empty if the text is not a unit of ground
    motion."""
    return (motion_units(text) if text and text.strip() else None) or ""
