"""Parsing of numbers, ratios and named parameters on the command line and in files."""

from __future__ import annotations

import math
import re
import sys
from collections.abc import Iterable, Mapping, Sequence
from typing import AnyStr

from tdint.errors import UsageError, did_you_mean

SMALLEST, LARGEST = 1e-60, 1e60
"""Limits of the absolute value of numbers in files, in SI units. Products and squares of numbers
between these limits neither underflow nor overflow in double precision.
"""

_UNDERFLOW = sys.float_info.min
"""Number that represents all numbers that are too small for double precision, 2.2e-308. It is below
`SMALLEST` and is therefore refused."""


def any_case(pattern: AnyStr) -> re.Pattern[AnyStr]:
    """Compile a pattern that does not distinguish upper and lower case."""
    return re.compile(pattern, re.IGNORECASE)


def pluralize(count: int, noun: str) -> str:
    """Return a count with its noun in the singular or the plural: 1 run, 2 runs, 3 stories.

    `noun` is the singular. Its plural is formed by -s, or by -ies if it ends with y.
    """
    plural = f"{noun[:-1]}ies" if noun.endswith("y") else f"{noun}s"
    return f"{count} {noun if count == 1 else plural}"


DIGITS = 4
"""Default number of significant digits in sentences and in the tables of reports."""

_DIGITS_OF_DOUBLES = 17
"""Number of significant digits that distinguishes any two double-precision numbers."""


def number_text(value: float, digits: int = DIGITS, *, unlike: float | None = None) -> str:
    """Return a number as text, rounded to significant digits.

    Parameters
    ----------
    digits : int
        Number of significant digits, 3 or 4; trailing zeros are omitted.
    unlike : float, optional
        A limit that the number does not meet. If the rounded number and the rounded limit are
        equal, digits are added until they differ: 0.89999 with the limit 0.9 is not written as 0.9.
    """
    text = f"{value:.{digits}g}"
    if unlike is None or value == unlike:
        return text
    while text == f"{unlike:.{digits}g}" and digits < _DIGITS_OF_DOUBLES:
        digits += 1
        text = f"{value:.{digits}g}"
    return text


_SMALL = 1e-4
"""Limit below which tables do not show the digits of a number, because readers of a report do not
need these digits. The limit applies to the number or, if the maximum of its column is known, to the
ratio of the number to this maximum."""


def table_number(value: float, largest: float | None = None) -> str:
    """Return a number as text for a table or a report, with four significant digits and without a
    power of ten.

    Parameters
    ----------
    value : float
        The number; nan is an empty cell.
    largest : float, optional
        Largest absolute value of the column. A number that is below 0.0001 times this value is
        written as 0. By default, or if the number would have no digits, a number below 0.0001 is
        written as "below 0.0001".
    """
    if math.isnan(value):
        return ""
    text = number_text(value)
    if "e" not in text or value == 0.0:  # the text has no power of ten
        return text
    if abs(value) >= 1.0:
        return f"{float(text):.0f}"
    # The power of ten is negative, so the absolute value is below 0.0001.
    if largest is not None and abs(value) < _SMALL * largest:
        return "0"
    decimals = f"{value:.7f}"
    return f"below {_SMALL}" if largest is None or float(decimals) == 0.0 else decimals


def abbreviate(names: Sequence[str], limit: int) -> str:
    """Return a list of names as text; names after the first `limit` names are only counted, as in
    `a, b and 7 more`."""
    more = f" and {len(names) - limit} more" if len(names) > limit else ""
    return ", ".join(names[:limit]) + more


def quoted_names(names: Iterable[str]) -> list[str]:
    """Return names for a list, with names that contain a comma in quotation marks."""
    return [repr(name) if "," in name else name for name in names]


def parse_head(text: str) -> tuple[tuple[str, str], ...]:
    """Parse the additional lines at the top of a report, such as `Project: Bridge 7`.

    Parameters
    ----------
    text : str
        Lines in the form NAME: TEXT, separated by semicolons: `Project: Bridge 7; Author: A. B.`.
        The text of a line may be empty, to be written by hand.

    Raises
    ------
    UsageError
        A part has no name or no colon.
    """
    lines = []
    for line in text.split(";"):
        if line.strip():
            name, colon, value = line.partition(":")
            lines.append((name.strip() if colon else "", value.strip()))
    if not lines or not all(name for name, _ in lines):
        raise UsageError(
            "the lines at the top of a report must have the form NAME: TEXT; NAME: TEXT, such as "
            f"'Project: Bridge 7; Author: A. B.', got {text[:60]!r}"
        )
    return tuple(lines)


def number_or_nan(text: str) -> float:
    """Convert a text to a float; return nan if the text is not a number.

    A number that is too small for double precision, such as 1e-400, is not read as 0 but as
    `_UNDERFLOW`.
    """
    try:
        number = float(text)
    except ValueError:
        return math.nan
    return number or (_UNDERFLOW if has_underflow(text) else 0.0)


def has_underflow(text: str) -> bool:
    """Return True if a text that `float` converts to 0 is another number, such as 1e-400."""
    mantissa = text.lower().partition("e")[0]
    return any(digit in mantissa for digit in "123456789")


def parse_ratio(text: str) -> float:
    """Parse a ratio: a number such as `0.05`, a percentage such as `5%`, or a fraction such as
    `1/550`.

    Raises
    ------
    UsageError
        The text has another form, or the number is not finite.
    """
    stripped = text.strip()
    number, divisor = ratio_parts(stripped)
    divided_by = number_or_nan(divisor)
    ratio = number_or_nan(number) / divided_by if divided_by else math.nan
    if not math.isfinite(ratio):
        raise UsageError(
            f"{text!r} is neither a ratio such as 0.05 or 1/20 nor a percentage such as 5%"
        )
    return ratio


def ratio_parts(text: str) -> tuple[str, str]:
    """Return the texts of numerator and denominator of a ratio: `5%` is 5 over 100, `1/550` is
    1 over 550, and `0.05` is 0.05 over 1.
    """
    number = text.removesuffix("%")
    if number != text:
        return number.rstrip(), "100"
    number, slash, divisor = text.partition("/")
    return (number.rstrip(), divisor.lstrip()) if slash else (text, "1")


def parse_positive(name: str, text: str) -> float:
    """Parse a positive number.

    Parameters
    ----------
    name : str
        Name of the value, for the message.

    Raises
    ------
    UsageError
        The text is not a positive number between `SMALLEST` and `LARGEST`.
    """
    number = number_or_nan(text)
    if not SMALLEST <= number <= LARGEST:
        raise UsageError(f"{name} must be a positive number, got {text[:40]!r}")
    return number


def parse_named(
    name: str, text: str, parameters: Mapping[str, bool], example: str
) -> dict[str, str]:
    """Parse the parameters of a named object: `key=value` pairs separated by commas.

    Parameters
    ----------
    name : str
        Name of the object, such as a method or a design spectrum, for messages.
    text : str
        The pairs, such as `damping=0.05,site=C`.
    parameters : mapping of str to bool
        Names of the parameters; True if the parameter is required.
    example : str
        Valid text, for messages.

    Returns
    -------
    dict of str to str
        Texts of the values by name of the parameter.

    Raises
    ------
    UsageError
        A parameter is missing, unknown or given twice.
    """
    values: dict[str, str] = {}
    for part in text.split(","):
        key, equal, value = (token.strip() for token in part.partition("="))
        if not part.strip():
            continue
        if not equal or key.lower() not in parameters:
            raise UsageError(
                f"{name} has no parameter {key!r}; it has "
                f"{', '.join(parameters)}{did_you_mean(key, parameters)}"
            )
        if key.lower() in values:
            raise UsageError(f"{key} is specified twice; keep one value")
        values[key.lower()] = value
    missing = [key for key, needed in parameters.items() if needed and key not in values]
    if missing:
        raise UsageError(f"{name} requires {', '.join(missing)}, such as {example}")
    return values


WARNING_LENGTH = 60
"""Maximum number of characters of a warning in the one-line description of a result. The attribute
`warnings` contains the complete text.
"""


def first_warning(warnings: Sequence[str]) -> str:
    """Return a text about the warnings of a result, for the end of its one-line description.

    The text contains the first warning, which is shortened if it is long, and the number of further
    warnings. It is empty without warnings.
    """
    if not warnings:
        return ""
    more = f" (and {len(warnings) - 1} more: `warnings`)" if len(warnings) > 1 else ""
    first = warnings[0]
    if len(first) > WARNING_LENGTH:
        # `rsplit` removes the last word, which may be cut off in the middle.
        first = f"{first[:WARNING_LENGTH].rsplit(' ', 1)[0]} ..."
    return f"; warning: {first}{more}"
