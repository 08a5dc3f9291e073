"""Header of a text table: declarations `key = value` and names of columns.

A column is a time, an acceleration, a velocity, a displacement, or a component of the acceleration:
`Time,Acc,Vel,Disp`, `t N V E`, `time_s,HNE_m_s2,HNN_m_s2`, `Time (s); Acceleration (g)`. Names are
separated by blanks, commas, semicolons or tabs. Units are in brackets or after an underscore. In a
table with a time, any other name with a unit of acceleration (`base_m_s2`) is a component.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from unicodedata import combining, normalize

from tdint.errors import RecordError
from tdint.ground_motion.formats.lines import NUMBER
from tdint.number_parsing import pluralize

TIME, OTHER = "time", "other"
SECONDS = {
    "": 1.0,
    "s": 1.0,
    "sec": 1.0,
    "secs": 1.0,
    "second": 1.0,
    "seconds": 1.0,
    "ms": 1e-3,
    "msec": 1e-3,
}
"""Values of the units of time, s."""

MOTIONS = ("acceleration", "velocity", "displacement")

_NAME = re.compile(r"[^\s(\[]+(?:\s*[(\[][^)\]]*[)\]])?")
_UNITS_IN_BRACKETS = re.compile(r"(.*?)\s*[(\[]\s*(.*?)\s*[)\]]")
_UNITS_AT_END = re.compile(
    r"(.*?)_((?:mm|cm|m|in|ft)_s2|(?:mm|cm|m|in|ft)_s|gal|g|sec|s|ms|mm|cm|m|in|ft)"
)
_COMPONENT = (
    r"[nsewudzvhxylr]\d?|[nsewud]-?[nsewud]|up|down|dn|ver(?:t(?:ical)?)?|north|south|east|west|"
    r"trans(?:v(?:erse)?)?|long(?:itudinal)?|rad(?:ial)?|\d{1,3}|[a-z][hn][a-z0-9]|[ns]\d{1,2}[ew]"
)
_ACCELERATION = re.compile(r"(?:mm|cm|m|in|ft)/s(?:\^?2|/s)|gal|g")
_TIMES = ("t", "time", "times", "s", "sec", "zeit", "temps", "tiempo", "tempo")
# English, German, French, Spanish, Italian and Portuguese, without accents
_WORDS = {
    "acceleration": "a|ag|acc|accel|acceleration|beschleunigung|aceleracion|accelerazione|"
    "aceleracao",
    "velocity": "vg|vel|veloc|velocity|geschwindigkeit|vitesse|velocidade?|velocita",
    "displacement": "dg|dis|disp|displ|displacement|verschiebung|deplacement|desplazamiento|"
    "spostamento|deslocamento",
}
_QUANTITIES = {
    quantity: re.compile(rf"(?:ground )?(?:{words})(?:[ -]({_COMPONENT}))?")
    for quantity, words in _WORDS.items()
}
_LETTERS = {"v": "velocity", "d": "displacement"}
"""Quantities of these letters if a column is named acceleration; otherwise they are components."""


@dataclass(frozen=True)
class ColumnName:
    """Name of a column and its meaning.

    Attributes
    ----------
    quantity : str
        `TIME`, one of `MOTIONS`, or `OTHER` if the name does not state the quantity.
    component, units : str
        Component and units in the name; empty if the name does not include them.
    text, plain : str
        The name in the spelling of the file, and the name in lower case without units.
    """

    quantity: str
    component: str = ""
    units: str = ""
    text: str = ""
    plain: str = ""


def column_names(text: str) -> list[ColumnName]:
    """Return the column names in a line; empty if the line is not a line of names.

    Each name must state a ground motion (`MOTIONS`) or a component of the acceleration. The first
    of several names may be a time; `_interpret_names` accepts a time only there.
    """
    columns = _interpret_names(_split_names(text))
    if not columns or any(column.quantity == OTHER for column in columns):
        return []
    motions = [column for column in columns if column.quantity != TIME]
    # A single component, such as `N` or `up`, may be any word of a text and is not a line of names.
    if not motions or (len(columns) == 1 and columns[0].component):
        return []
    if any(column.quantity == "acceleration" and not column.component for column in motions):
        # The names v and d were read as components. If a column is named acceleration without a
        # component, they are the velocity and the displacement.
        for index, column in enumerate(columns):
            if quantity := _LETTERS.get(column.component.lower()):
                columns[index] = replace(column, quantity=quantity, component="")
    return columns


def any_names(text: str, width: int) -> tuple[ColumnName, ...]:
    """Return `width` column names in arbitrary text; empty if the line has another number of names.

    Names are separated by commas, semicolons, tabs or blanks; if this gives another number of
    names, by two or more blanks. A first column in seconds is a time, regardless of its name.

    Raises
    ------
    RecordError
        The time is in a unit other than s or ms.
    """
    for name_texts in (_split_names(text), re.split(r"\s{2,}|\t", text.strip())):
        # The first separation that gives the required number of names is used.
        columns = _interpret_names(name_texts)
        if len(columns) != width:
            continue
        first = columns[0]
        if width > 1 and first.quantity == OTHER and first.units and first.units in SECONDS:
            columns[0] = first = replace(first, quantity=TIME)
        if first.quantity == TIME and first.units not in SECONDS:
            raise RecordError(
                f"the times must be in s or ms, but the header states {first.units!r}"
            )
        return tuple(columns)
    return ()


def column_index(text: str, names: tuple[ColumnName, ...], width: int) -> int:
    """Return the index, counted from 0, of a column selected by number or name.

    Parameters
    ----------
    text : str
        Number, counted from 1, or name in upper or lower case.
    names : tuple of ColumnName
        Names of the columns; may be empty.

    Raises
    ------
    RecordError
        No column matches, several columns match, or the column is the time.
    """
    if text.isdecimal():
        # Longer numbers are not converted, because Python limits the digits of an integer.
        index = int(text) - 1 if len(text) < 10 else -1
        if not 0 <= index < width:
            raise RecordError(f"column {text[:40]} not found; the table has columns 1 to {width}")
    elif not names:
        raise RecordError(
            f"column {text[:40]!r} not found: the table has no column names; specify the number"
        )
    else:
        index = _index_of_name(text, names)
    if names and names[index].quantity == TIME:
        raise RecordError(
            f"column {text} contains the time ({names[index].text}); select a column with a ground "
            "motion"
        )
    return index


def _index_of_name(name: str, names: tuple[ColumnName, ...]) -> int:
    """Return the index of the only column with a name, in upper or lower case; RecordError if there
    is none or several.

    The name is compared with the complete column names, then with the names without units, and then
    with the components.
    """
    plain_name = " ".join(name.lower().split())
    spellings = [
        [column.text.lower() for column in names],
        [column.plain for column in names],
        [column.component.lower() for column in names],
    ]
    for column_texts in spellings:
        indices = [index for index, text in enumerate(column_texts) if text == plain_name]
        if len(indices) == 1:
            return indices[0]
        if indices:
            numbers = " and ".join(str(index + 1) for index in indices)
            raise RecordError(f"columns {numbers} have the name {name[:40]!r}; specify the number")
    raise RecordError(
        f"column {name[:40]!r} not found; the columns are "
        f"{', '.join(column.text[:40] for column in names)}"
    )


def lacks_first_name(line: str) -> bool:
    """Return True if a line names all columns except the first, as pandas writes a table with its
    index."""
    name_texts = re.split("[,;\t]", line)
    return (
        len(name_texts) > 1
        and not name_texts[0].strip().strip("\"'")
        and bool(_interpret_names(name_texts[1:]))
    )


def _split_names(text: str) -> list[str]:
    """Split a line into column names at commas, semicolons and tabs; at blanks if the line has no
    such character."""
    return re.split("[,;\t]", text) if re.search("[,;\t]", text) else _NAME.findall(text)


def _interpret_names(name_texts: list[str]) -> list[ColumnName]:
    """Return the meanings of column names; return an empty list if a name is empty."""
    names_and_units = [name_and_units(text) for text in name_texts]
    if not names_and_units or any(not name for name, _ in names_and_units):
        return []
    columns = []
    for index, (name, units) in enumerate(names_and_units):
        text = " ".join(name_texts[index].strip().strip("\"'").split())
        quantity, component = _quantity_of_name(name)
        if index == 0 and len(names_and_units) > 1 and name in _TIMES:
            quantity, component = TIME, ""
        # Any other name with a unit of acceleration is a component. The first column is excluded,
        # because it may be a time. `name` is the start of `text` in lower case, without the unit.
        if quantity == OTHER and index > 0 and _ACCELERATION.fullmatch(units):
            quantity, component = "acceleration", text[: len(name)]
        columns.append(ColumnName(quantity, component, units, text, plain=name))
    return columns


def _quantity_of_name(name: str) -> tuple[str, str]:
    """Return the quantity and the component of a column name without units, in lower case.

    The quantity is one of `MOTIONS`, or `OTHER` if the name does not state it. A name that is only
    a component, such as `hne`, is an acceleration.
    """
    for quantity, pattern in _QUANTITIES.items():
        if match := pattern.fullmatch(_unaccented(name)):
            return quantity, (match[1] or "").upper()
    if re.fullmatch(_COMPONENT, name):
        return "acceleration", name.upper()
    return OTHER, ""


def name_and_units(text: str) -> tuple[str, str]:
    """Split a column name into name and units, in lower case.

    `Time (s)` and `time_s` give time and s; `acceleration_m_s2` gives acceleration and m/s^2.
    """
    name = text.strip().strip("\"'").lower()
    match = _UNITS_IN_BRACKETS.fullmatch(name) or _UNITS_AT_END.fullmatch(name)
    name, units = (match[1], match[2]) if match else (name, "")
    return name.replace("_", " ").strip(), re.sub("_s$", "/s", re.sub("_s2$", "/s^2", units))


COMMENT = re.compile(r"\s*(?:[#%;!]|//)+\s*(.*)")

_DECLARATION = re.compile(r"\s*([a-zÀ-ÿ][a-zÀ-ÿ _]*?)\s*[=:]\s*(\S.*?)\s*", re.IGNORECASE)
_QUANTITY = re.compile(rf"({NUMBER})\s*([a-z/]*)", re.IGNORECASE)

# English, then Spanish, French, Italian, Portuguese and German, without accents
_KEYS = {
    "dt": (
        *("dt", "delta", "time step", "timestep", "sampling interval", "sample interval"),
        *("intervalo de muestreo", "paso de tiempo", "pas de temps", "intervallo di campionamento"),
        *("intervalo de amostragem", "zeitschritt", "abtastintervall"),
    ),
    "rate": (
        *("sampling rate", "sample rate", "sampling frequency", "fs", "tasa de muestreo"),
        *("frecuencia de muestreo", "frequenza di campionamento", "taxa de amostragem"),
        *("abtastrate", "abtastfrequenz"),
    ),
    "units": (
        *("units", "unit", "acceleration units", "unidades", "unidad", "unidade", "unites"),
        *("unite", "unita", "einheit", "einheiten"),
    ),
    "samples": (
        *("samples", "npts", "number of samples", "number of points", "numero de muestras"),
        *("numero de datos", "numero de puntos", "nombre de points", "numero di campioni"),
        *("numero de amostras", "anzahl der werte"),
    ),
    "start": ("start", "start time", "starttime"),
    "component": ("component", "channel", "componente", "composante", "komponente"),
    "station": ("station", "estacion", "stazione", "estacao"),
    "network": ("network",),
    "location": ("location",),
    "event": ("event", "earthquake"),
}
COLUMNS = "columns"
"""Key of the line of column names in the header."""

ORIGIN = "tdint origin"
"""Key of the origin of a motion that tdint wrote (`header_statement`)."""

_MEANINGS = {name: meaning for meaning, names in _KEYS.items() for name in names}
_PER_SECOND = {"": 1.0, "hz": 1.0, "sps": 1.0, "/s": 1.0}


@dataclass(frozen=True)
class TableHeader:
    """Declarations and column names in the header of a text table.

    Attributes
    ----------
    declared : dict of str to str
        Declared values by key: the keys of `_KEYS` (such as `dt`), `COLUMNS` and `ORIGIN`.
    names : tuple of ColumnName
        Names of the columns; empty if the header does not name them.
    """

    declared: dict[str, str]
    names: tuple[ColumnName, ...] = ()

    def get(self, key: str) -> str:
        """Return the declared value of a key; empty if it is not declared."""
        return self.declared.get(key, "")

    def intervals(self) -> list[float]:
        """Return the declared sampling intervals, s: the interval and the reciprocal of the
        sampling rate. A quantity that the header does not declare is omitted.

        Raises
        ------
        RecordError
            A declaration is not a positive number with a unit of time or rate.
        """
        intervals = []
        if "dt" in self.declared:
            intervals.append(_convert_quantity(self.declared["dt"], SECONDS, "dt"))
        if "rate" in self.declared:
            rate = _convert_quantity(self.declared["rate"], _PER_SECOND, "the sampling rate")
            intervals.append(1.0 / rate)
        return intervals

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


def read_header(lines: list[str], width: int) -> TableHeader:
    """Read the header of a table that was recognized without a user-specified layout.

    Raises
    ------
    RecordError
        The header is contradictory, or has another number of column names.
    """
    # A declaration may be repeated with the same value, but not with a different value.
    declared: dict[str, str] = {}
    for line in lines:
        for key, value in declared_in(line) or []:
            if declared.setdefault(key, value) != value:
                raise RecordError(
                    f"the header of the table states {key} twice, {declared[key]!r} and {value!r}; "
                    "remove one of these entries"
                )
    names = tuple(column_names(declared.get(COLUMNS, "")))
    if names and len(names) != width:
        raise RecordError(
            f"the header of the table names {pluralize(len(names), 'column')}, but the rows have "
            f"{pluralize(width, 'value')}"
        )
    return TableHeader(declared, names)


def read_foreign_header(lines: list[str], width: int, skipped: int) -> TableHeader:
    """Read the header of a table with a user-specified layout.

    Unlike in `read_header`, the last line may name the columns in arbitrary text.

    Parameters
    ----------
    lines : list of str
        All lines between the skipped lines and the numbers.
    skipped : int
        Number of lines skipped before the header, for error messages.

    Raises
    ------
    RecordError
        The header contradicts itself, names more or fewer columns, or has a line that is neither a
        declaration nor a line of column names.
    """
    header = read_header(lines, width)
    filled = [index for index, line in enumerate(lines) if line.strip()]
    # `declared_in` returns None for an unknown line: it is not blank, not a comment, not a
    # declaration, and does not contain recognized column names.
    unknown = [index for index in filled if declared_in(lines[index]) is None]
    # If the column names have not been recognized, the last filled line may contain them, unless it
    # is a declaration such as `dt = 0.01`.
    is_candidate = bool(filled) and not header.names and not declared_in(lines[filled[-1]])
    last_line = lines[filled[-1]] if is_candidate else ""
    comment = COMMENT.fullmatch(last_line)
    names = any_names(comment[1] if comment else last_line, width) if last_line else ()
    # A comment with as many words as columns is usually a sentence. It contains the column names
    # only if the first name is a time.
    if comment and names and names[0].quantity != TIME:
        names = ()
    # A last line that is not a comment was the last unknown line. It now names the columns.
    if not comment and names:
        unknown = unknown[:-1]
    if unknown:
        number = skipped + unknown[-1] + 1
        raise RecordError(
            f"line {number}: {lines[unknown[-1]].strip()[:60]!r} is neither a declaration "
            f"(dt = 0.01 s) nor the names of {width} columns; skip it with `skip_lines={number}`"
        )
    return TableHeader(header.declared, header.names or names)


def declared_in(line: str) -> list[tuple[str, str]] | None:
    """Return the declarations in a header line.

    Returns
    -------
    list of tuple of str, or None
        Keys and values; empty for blank lines and other comments. None if the line is neither
        blank, a comment, a declaration nor a line of column names.
    """
    comment = COMMENT.fullmatch(line)
    content = comment[1] if comment else line
    # An origin contains commas and other texts of the user, and is not searched further.
    if comment and content.startswith(f"{ORIGIN} = "):
        return [(ORIGIN, content.removeprefix(f"{ORIGIN} = ").strip())]
    if names := column_names(content):
        # A table with times in another unit, such as minutes, is not recognized.
        if names[0].quantity == TIME and names[0].units not in SECONDS:
            return None
        declarations = [(COLUMNS, content.strip())]
        # Equal units of all acceleration columns are the units of the table.
        units = {name.units for name in names if name.quantity == "acceleration"}
        if len(units) == 1 and "" not in units:
            declarations += [("units", unit) for unit in units]
        return declarations
    assignments = [text for text in re.split("[,;]", content) if text.strip()]
    declarations = []
    for assignment in assignments:
        match = _DECLARATION.fullmatch(assignment)
        if not match:
            continue
        # Keys may be in upper or lower case, with blanks or underscores, and with accents.
        key = _unaccented(" ".join(match[1].lower().replace("_", " ").split()))
        if key in _MEANINGS:
            declarations.append((_MEANINGS[key], match[2]))
    # A comment may contain other text, another line may not.
    return declarations if comment or len(declarations) == len(assignments) else None


def _unaccented(text: str) -> str:
    """Return a text with plain letters in place of letters with accents."""
    return "".join(letter for letter in normalize("NFKD", text) if not combining(letter))


def _convert_quantity(text: str, units: dict[str, float], quantity: str) -> float:
    """Convert a positive number with a unit, such as `10 ms`, to SI units. The key "" of the
    allowed units allows a number without a unit. Any other text is a RecordError.
    """
    match = _QUANTITY.fullmatch(text)
    factor = units.get(match[2].lower()) if match else None
    if not match or factor is None or not float(match[1]) > 0.0:
        names = ", ".join(filter(None, units))
        raise RecordError(
            f"{quantity} must be a positive number in {names}, but the header states {text!r}"
        )
    return float(match[1]) * factor
