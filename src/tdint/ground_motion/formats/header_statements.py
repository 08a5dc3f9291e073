"""Statements in the header of a table in free wording: number of samples, sampling interval, units
and peak of an accelerogram.

The words are English, and for the interval, the number of samples and the units also German,
French, Spanish, Italian and Portuguese. A number counts as a statement only next to a word that
names its quantity. Wrong statements are worse than none: a distance (`Delta: 5.3 km`) is not an
interval, and `8 values per line` is not a number of samples.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from tdint.ground_motion.formats.lines import COUNT, NUMBER
from tdint.ground_motion.formats.series import motion_units
from tdint.ground_motion.formats.table_columns import COMMENT

MIN_COUNT = 20
"""Smallest number that counts as a number of samples; smaller numbers are values per line."""

MIN_STEP, MAX_STEP = 1e-5, 1.0
"""Sampling intervals of accelerograms, s; other numbers are something else."""

_SECONDS = {"MS": 1e-3, "MSEC": 1e-3}
"""Units of an interval other than the second, s."""

_ITEMS = r"(?:POINTS|DATA|SAMPLES|VALUES|PTS|STEPS)"
_COUNTS = tuple(
    re.compile(pattern, re.IGNORECASE)
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
    re.compile(rf"{pattern}\s*({NUMBER})\s*{_UNIT_OF_TIME}", re.IGNORECASE)
    for pattern in (
        rf"\b(?:DT|DELTA[ _-]?T)\b\s*{_IN_SECONDS}\s*[=:]?",
        r"\b(?:TIME|SAMPLING|SAMPLE|DIGITI[SZ]ATION)[-_ ]*"
        r"(?:STEP|INCREMENT|INTERVAL|PERIOD|SPACING|RATE)\b\s*"
        rf"{_IN_SECONDS}\s*(?:OF|IS)?\s*[=:]?",
        r"\b(?:(?:INTERVAL(?:O|LO)|PASO|PASSO|P[EÉ]RIODO)\s+D(?:E|I)\s+"
        r"(?:MUESTREO|TIEMPO|CAMPIONAMENTO|TEMPO|AMOSTRAGEM)|PAS\s+DE\s+TEMPS|"
        r"(?:PAS|P[EÉ]RIODE)\s+D['\u2019][EÉ]CHANTILLONNAGE|ABTASTINTERVALL|ZEITSCHRITT)\b\s*"
        rf"{_IN_SECONDS}\s*[=:]?",
        r"\b(?:EQUALLY[ -]SPACED|(?:EQUAL\s+)?(?:TIME\s+)?INTERVALS?)\b\s*(?:\bINTERVALS?\s*)?"
        rf"(?:OF|AT)?\s*{_IN_SECONDS}\s*[=:]?",
    )
)
"""Patterns of an interval. Groups: unit in brackets after the name, number, unit after the
number."""

_OTHER_UNIT = re.compile(r"\s*\(?\s*(?:KM|DEG|M|CM|MM|HZ|SPS|%|SAMPLES)(?![A-Z])", re.IGNORECASE)
"""Units that show that a number is not an interval."""

_RATES = tuple(
    re.compile(pattern, re.IGNORECASE)
    for pattern in (
        r"\b(?:SAMPL(?:E|ING)[-_ ]*(?:RATE|FREQUENCY|FREQ\.?)|"
        r"SAMPLES\s*(?:/|PER)\s*S(?:EC(?:OND)?)?)(?![A-Z])\s*"
        rf"(?:[(\[]\s*(?:HZ|SPS)\s*[)\]])?\s*(?:OF|IS)?\s*[=:]?\s*({NUMBER})",
        r"\b(?:(?:TASA|FRECUENCIA|FREQUENZA|FREQU[EÊ]NCIA|TAXA)\s+D(?:E|I)\s+"
        r"(?:MUESTREO|CAMPIONAMENTO|AMOSTRAGEM)|FR[EÉ]QUENCE\s+D['\u2019][EÉ]CHANTILLONNAGE|"
        rf"ABTAST(?:RATE|FREQUENZ))\b\s*(?:[(\[]\s*HZ\s*[)\]])?\s*[=:]?\s*({NUMBER})",
        rf"({NUMBER})\s*(?:SAMPLES\s*(?:/|PER)\s*S(?:EC(?:OND)?)?|SPS)\b",
    )
)
_MAX_RATE = 1e5  # samples per second

_UNIT = (
    r"(?:CMS?|MM|M|IN|FT)\s*/\s*S(?:EC)?(?:\s*/\s*S(?:EC)?|\s*(?:\*\*|\^)?\s*2|\u00b2)|"
    r"GALS?|MILLI-?GS?|MG|G(?:'S)?(?:/10)?"
)
_NO_LONGER_UNIT = r"(?![\w/*^])"
_UNITS = tuple(
    re.compile(rf"{pattern}\s*({_UNIT}){_NO_LONGER_UNIT}", re.IGNORECASE)
    for pattern in (
        r"\b(?:UNITS?|UNIDAD(?:ES)?|UNIT[EÉÀ]S?|UNIDADES?|EINHEIT(?:EN)?)(?!\w)[\s:=]*(?:(?:OF|ARE|IS|IN|ACCELERATION)[\s:=]+)*[(\[]?",
        r"\bACC(?:EL\w*)?\b\.?(?:\s+(?:TIME|SERIES|HISTORY|DATA|VALUES))*\s*(?:IN\b|[:=,(\[])",
    )
)
_PEAK = re.compile(
    r"\b(?:PGA|PEAK\s+(?:GROUND\s+)?(?:VALUE|ACC\w*\.?)|"
    r"MAX(?:IMUM)?\.?\s+(?:ABS\w*\.?\s+)?(?:VALUE|ACC\w*\.?))\s*"
    rf"[(\[]?\s*({_UNIT})?\s*[)\]]?\s*[=:]?\s*({NUMBER})\s*[(\[]?\s*({_UNIT})?{_NO_LONGER_UNIT}",
    re.IGNORECASE,
)
"""Pattern of a peak. Groups: unit after the name, number, unit after the number."""

_ACCELERATION = re.compile(r"\bACC(?:EL\w*)?\b", re.IGNORECASE)
_INTEGRALS = {
    "velocity": re.compile(r"\bVEL(?:OCITY)?\b|CM/SEC(?![/*^\w])", re.IGNORECASE),
    "displacement": re.compile(r"\bDISPL?(?:ACEMENT)?\b", re.IGNORECASE),
}
_SPECTRA = re.compile(
    r"\b(?:RESPONSE (?:AND FOURIER AMPLITUDE )?|FOURIER (?:AMPLITUDE )?)SPECTR(?:A|UM)\b",
    re.IGNORECASE,
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
        Units of the acceleration in the spelling of `motion_units`, without repetition.
    peak : tuple of (str, str)
        Peak in the spelling of the header and its units; both empty if it is not stated.
    integrals : tuple of str
        Quantities that the header names in addition to an acceleration.
    quantity : str
        Quantity of the samples if the header names no acceleration; otherwise `acceleration`.
    """

    counts: frozenset[int] = frozenset()
    intervals: tuple[float, ...] = ()
    units: tuple[str, ...] = ()
    peak: tuple[str, str] = ("", "")
    integrals: tuple[str, ...] = ()
    quantity: str = "acceleration"


def statements(lines: Sequence[str]) -> Statements:
    """Return the statements in the lines of a header."""
    peaks = [
        (match[2], _units(match[1] or match[3])) for line in lines for match in _PEAK.finditer(line)
    ]
    # The unit of a peak is not always the unit of the samples.
    units = tuple(
        dict.fromkeys(
            unit
            for line in lines
            if not _PEAK.search(line)
            for pattern in _UNITS
            for match in pattern.finditer(line)
            if (unit := _units(match[1]))
        )
    )
    integrals = named_integrals(lines)
    names_acceleration = bool(units or peaks) or any(map(_ACCELERATION.search, lines))
    return Statements(
        counts=frozenset(
            int(match[1])
            for line in lines
            for pattern in _COUNTS
            for match in pattern.finditer(line)
            if int(match[1]) >= MIN_COUNT
        ),
        intervals=tuple(dict.fromkeys(_stated_intervals(lines))),
        units=units,
        peak=peaks[0] if peaks else ("", ""),
        integrals=integrals,
        quantity="acceleration" if names_acceleration or not integrals else integrals[0],
    )


def named_spectra(lines: Sequence[str]) -> str:
    """Return the name of spectra in the lines of a header; empty if there is none.

    Comments are ignored, because they may name the spectrum of an accelerogram.
    """
    matches = (_SPECTRA.search(line) for line in lines if not COMMENT.fullmatch(line))
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
                unit = (match[3] or match[1] or "").upper()
                interval = float(match[2]) * _SECONDS.get(unit, 1.0)
                is_time = bool(match[3]) or not _OTHER_UNIT.match(line, match.end())
                if is_time and MIN_STEP <= interval <= MAX_STEP:
                    yield interval
        for pattern in _RATES:
            for match in pattern.finditer(line):
                rate = float(match[1])
                if 1.0 < rate < _MAX_RATE:
                    yield 1.0 / rate


def _units(text: str | None) -> str:
    """Return a unit of acceleration in the spelling of `motion_units`; empty if there is none."""
    plain = re.sub(r"\s+", "", text or "").upper().replace("\u00b2", "^2")
    if plain.startswith("M") and plain.rstrip("S").endswith("G"):  # milli-g
        return "0.001 g"
    return (motion_units(plain.replace("GALS", "GAL")) if plain else None) or ""
