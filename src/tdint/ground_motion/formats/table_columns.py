"""Names of the columns of a text table, and declarations `key = value` in its header.

A column is a time, an acceleration, a velocity, a displacement, or a component of the acceleration:
`Time,Acc,Vel,Disp`, `t N V E`, `time_s,HNE_m_s2,HNN_m_s2`, `Time (s); Acceleration (g)`. Names are
separated by blanks, commas, semicolons or tabs. Units are in brackets or after an underscore. In a
table with a time, any other name with a unit of acceleration (`base_m_s2`) is a component.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, replace
from unicodedata import combining, normalize

from tdint.errors import RecordError, UsageError
from tdint.number_parsing import any_case
from tdint.units import parse_units

TIME, OTHER, NO_MOTION = "time", "other", "no motion"
SECONDS = dict.fromkeys(("", "s", "sec", "secs", "second", "seconds"), 1.0)
SECONDS |= dict.fromkeys(("ms", "msec"), 1e-3) | dict.fromkeys(("us", "µs"), 1e-6) | {"ns": 1e-9}
"""Values of the units of time, s."""

MOTIONS = ("acceleration", "velocity", "displacement")

_NAME = r"[^\s(\[]+(?:\s*[(\[][^)\]]*[)\]])?"
_UNITS_IN_BRACKETS = r"(.*?)\s*[(\[]\s*(.*?)\s*[)\]]"
_UNITS_AT_END = r"(.*?)_((?:mm|cm|m|in|ft)_s2|(?:mm|cm|m|in|ft)_s|gal|g|sec|s|ms|mm|cm|m|in|ft)"
_SEPARATORS = ",;\t"
_COMPONENT = (
    r"[nsewudzvhxylr]\d?|[nsewudo]-?[nsewudo]|up|down|dn|ver(?:t(?:ical)?)?|north|south|east|west|"
    r"trans(?:v(?:erse)?)?|long(?:itudinal)?|rad(?:ial)?|\d{1,3}|[a-z][hn][a-z0-9]|[ns]\d{1,2}[ew]"
)
_TIMES = ("t", "time", "times", "s", "sec", "zeit", "temps", "tiempo", "tempo")
_TIME = (
    r"(?:(?:relative|elapsed|unix|epoch) ?)?"
    r"(?:time ?(?:s|stamps?)?|zeit|temps|tiempo|tempo)|seconds elapsed"
)
"""Pattern of the name of a time in any column."""

_SPECTRUM = (
    r"(?:natural |response |oscillator )?(?:periods?|periodes?|periodos?|periodo|"
    r"schwingungsdauer|freq|frequenc(?:y|ies)|frequenz|frequence|frecuencia|frequenza|"
    r"frequencia)(?: .*)?"
)
"""Pattern of the name of the abscissa of a spectrum."""

_ORDINATE = (
    r"(?:p?s[avd]|ps[avd]|sa[ _]?\(?.*|fas|rotd\d+|(?:pseudo[ -]?)?spectral .*|.* spectrum|"
    r"spectrum|target|geomean)(?: .*)?"
)
"""Pattern of the name of an ordinate of a spectrum."""

_NO_MOTION = (
    r"(?:.* )?(?:arias|intensit\w*|cav|fas|fourier|fft|psd|spectr\w*|espectro|spettro|housner|"
    r"husid|pga|pgv|pgd|energy|cumulative|gyro\w*|magnet\w*|latitude|longitude|"
    r"temperature)(?: .*)?|i[ _]?a|p?s[av]|psd|rotd\d+"
)
"""Pattern of a name that states a quantity other than a ground motion."""

_NO_MOTION_UNITS = r"(?:rad|deg|°)(?:/s)?|[uµμ]t|h?pa|°c"
"""Pattern of the units of the other sensors of a telephone."""

_RESULTANT = (
    r"(?:.* )?(?:total|resultants?|resultante|risultante|abs(?:olute)?|magnitude|norm|modulus|srss|"
    r"vector|sum|betrag|envelope)(?: .*)?|[|].*[|]"
)
"""Pattern of a name of the resultant of the components, or of absolute values. It may also name the
total acceleration of a floor, which has both signs."""

_GENERAL = (
    r"(?:y|values?|data|signals?|amplitudes?|records?|motions?|ground motion|series|samples?|"
    r"(?:ch|channel|col|column|sensor|comp|component|[a-z])[ #.-]?\d*)"
)
"""Pattern of a name that states no quantity; other names may state a temperature or a force."""
# English, German, French, Spanish, Italian and Portuguese, without accents
_WORDS = {
    "acceleration": "a|ag|acc|accel|acceleration|beschleunigung|aceleracion|accelerazione|"
    "aceleracao",
    "velocity": "vg|vel|veloc|velocity|geschwindigkeit|vitesse|velocidade?|velocita",
    "displacement": "dg|dis|disp|displ|displacement|verschiebung|deplacement|desplazamiento|"
    "spostamento|deslocamento",
}
_QUANTITIES = {
    quantity: re.compile(rf"(?:ground )?(?:{words})(?:(?:[ -]|(?=[xyz]$))({_COMPONENT}))?")
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
        `TIME`, one of `MOTIONS`, `NO_MOTION` if the name states another quantity, or `OTHER` if it
        does not state the quantity.
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

    @property
    def may_be_resultant(self) -> bool:
        """True if the column is the resultant of the components if its values have one sign."""
        return bool(re.fullmatch(_RESULTANT, _unaccented(self.plain)))


def split_names(line: str, separator: str) -> list[str]:
    """Split a line into names at the separator of the rows; a comment mark and separators at the
    end of the line are omitted. Separators between quotation marks become blanks."""
    comment = COMMENT.fullmatch(line)
    text = (comment[1] if comment else line).rstrip(" \t\r,;")
    parts = text.split('"')  # the parts with an odd index are between quotation marks
    parts[1:-1:2] = [re.sub("[,;\t]", " ", part) for part in parts[1:-1:2]]
    text = '"'.join(parts)
    if separator and separator in _SEPARATORS:
        return text.lstrip(" ").split(separator) if separator in text else [text]
    if mark := next((mark for mark in ";\t," if mark in text), ""):
        return text.split(mark)
    return re.findall(_NAME, text)


def column_names(line: str, separator: str = "") -> tuple[ColumnName, ...]:
    """Return the column names in a line; empty if the line is not a line of names.

    Each name must state a ground motion (`MOTIONS`), a time, a component of the acceleration, or,
    in a table with a time, another quantity; at least one name must state a ground motion.

    Parameters
    ----------
    separator : str
        Separator of the rows. Default: the first separator in the line.
    """
    columns = interpret_names(split_names(line, separator))
    if not columns or any(column.quantity == OTHER for column in columns):
        return ()
    motions = [column for column in columns if column.quantity in MOTIONS]
    quantities = {column.quantity for column in columns}
    if NO_MOTION in quantities and TIME not in quantities:  # such as `Spectral acceleration`
        return ()
    # A single component, such as `N` or `up`, may be any word of a text and is not a line of names.
    if not motions or (len(columns) == 1 and columns[0].component):
        return ()
    return columns


def any_names(line: str, separator: str, width: int) -> tuple[ColumnName, ...]:
    """Return `width` column names in arbitrary text; empty if the line has another number of names.

    Names are separated as the rows, by single blanks, or by two or more blanks.
    """
    wide = re.split(r"\s{2,}|\t", line.strip())
    for names in (split_names(line, separator), split_names(line, " "), wide):
        if len(names) == width:
            return interpret_names(names)
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
    """Return the index of the only column with a name, in upper or lower case; RecordError for no
    column or several.

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


def interpret_names(texts: list[str]) -> tuple[ColumnName, ...]:
    """Return the meanings of column names; empty if all names are empty."""
    columns = []
    for index, given in enumerate(texts):
        name, units = name_and_units(given)
        text = " ".join(given.strip().strip("\"'").split())
        quantity, component = _quantity_of_name(name)
        if (index == 0 and len(texts) > 1 and name in _TIMES) or re.fullmatch(_TIME, name):
            quantity, component = TIME, ""
        if re.fullmatch(_NO_MOTION, _unaccented(name)) or re.fullmatch(_NO_MOTION_UNITS, units):
            quantity, component = NO_MOTION, ""
        # The unit determines the quantity of a name that is only a component. Any other name with a
        # unit of acceleration is a component. The first column is excluded, because it may be a
        # time. `name` is the start of `text` in lower case, without the unit.
        of_units = quantity_of_units(units)
        if component and of_units and not _QUANTITIES["acceleration"].fullmatch(name):
            quantity = of_units if quantity == "acceleration" else quantity
        if quantity == OTHER and index > 0 and of_units == "acceleration":
            quantity, component = of_units, text[: len(name)]
        columns.append(ColumnName(quantity, component, units, text, plain=name))
    if not any(column.plain for column in columns):
        return ()
    motions = [column for column in columns if column.quantity != TIME]
    if any(column.quantity == "acceleration" and not column.component for column in motions):
        # The names v and d were read as components. If a column is named acceleration without a
        # component, they are the velocity and the displacement.
        for index, column in enumerate(columns):
            if letter := _LETTERS.get(column.component.lower()):
                columns[index] = replace(column, quantity=letter, component="")
    return tuple(columns)


def quantity_of_units(units: str) -> str:
    """Return the quantity of a unit of ground motion; empty for another unit."""
    if not units:
        return ""
    try:
        return parse_units(units).quantity
    except UsageError:
        return ""


def with_units(names: tuple[ColumnName, ...], line: str, separator: str) -> tuple[ColumnName, ...]:
    """Return column names with the units in the line below them; empty if the line does not contain
    units.

    At least one cell must be a unit of time or of ground motion, and no cell may be a name.
    """
    cells = split_names(line, separator)
    if len(cells) != len(names):
        cells = line.split()
    texts = [text.strip().strip("\"'()[] ") for text in cells]
    known = [bool(text) and is_unit(text) for text in texts]
    if not any(known) or len(texts) != len(names):
        return ()
    return interpret_names(
        [
            f"{name.text} ({text})" if is_known and not name.units else name.text
            for name, text, is_known in zip(names, texts, known, strict=True)
        ]
    )


def is_unit(text: str) -> bool:
    """Return True if a text is a unit of time or of ground motion."""
    return text.lower() in SECONDS or bool(quantity_of_units(text))


def spectrum_name(names: tuple[ColumnName, ...]) -> str:
    """Return the name of a column that shows that a table contains spectra; empty without
    spectra."""
    for name in names:
        if re.fullmatch(_SPECTRUM, _unaccented(name.plain)) or name.units == "hz":
            return name.text
    has_ordinate = any(re.fullmatch(_ORDINATE, name.plain) for name in names[1:])
    is_period = bool(names) and names[0].plain in ("t", "tn", "f")
    return names[0].text if is_period and has_ordinate else ""


def is_general(name: ColumnName) -> bool:
    """Return True if a name without a quantity may belong to a ground motion."""
    return bool(re.fullmatch(_GENERAL, name.plain)) and (not name.units or is_unit(name.units))


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
    match = re.fullmatch(_UNITS_IN_BRACKETS, name) or re.fullmatch(_UNITS_AT_END, name)
    name, units = (match[1], match[2]) if match else (name, "")
    return name.replace("_", " ").strip(), re.sub("_s$", "/s", re.sub("_s2$", "/s^2", units))


COMMENT = re.compile(r"\s*(?:[#%;!]|//)+\s*(.*)")

_DECLARATION = any_case(r"\s*([a-zÀ-ÿ][a-zÀ-ÿ _]*?)\s*[=:]\s*(\S.*?)\s*")

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
ORIGIN = "tdint origin"
"""Key of the origin of a motion that tdint wrote (`header_statement`)."""

_MEANINGS = {name: meaning for meaning, names in _KEYS.items() for name in names}


def is_key(name: str) -> bool:
    """Return True if a text is a key of a declaration."""
    return _unaccented(" ".join(name.lower().replace("_", " ").split())) in _MEANINGS


def declarations(line: str) -> list[tuple[str, str]]:
    """Return the keys (of `_KEYS`, or `ORIGIN`) and values that a header line declares."""
    comment = COMMENT.fullmatch(line)
    content = comment[1] if comment else line
    # An origin contains commas and other texts of the user, and is not searched further.
    if comment and content.startswith(f"{ORIGIN} = "):
        return [(ORIGIN, content.removeprefix(f"{ORIGIN} = ").strip())]
    declared = []
    for assignment in re.split("[,;]", content):
        if match := _DECLARATION.fullmatch(assignment):
            # Keys may be in upper or lower case, with blanks or underscores, and with accents.
            key = _unaccented(" ".join(match[1].lower().replace("_", " ").split()))
            if key in _MEANINGS:
                declared.append((_MEANINGS[key], match[2]))
    return declared


def _unaccented(text: str) -> str:
    """Return a text without accents."""
    return "".join(letter for letter in normalize("NFKD", text) if not combining(letter))
