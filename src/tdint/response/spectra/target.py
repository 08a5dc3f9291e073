"""Target spectra and published spectra.

A suite of ground motions is scaled to a target spectrum. This spectrum is a CSV file or a design
spectrum of a code specified by name and parameters (`asce7:sds=1.0,sd1=0.6,tl=8`,
`ec8:type=1,soil=B,ag=0.25g`, `asce7-22:FILE`). Computed spectra are compared with published
spectra.
"""

from __future__ import annotations

import json
import math
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import compress
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tdint.arrays import Array
from tdint.csv_table import CsvTable, TableHeader, read_table
from tdint.errors import ModelError, RecordError, TdintError, UsageError
from tdint.files import read_whole, record_digest
from tdint.ground_motion.formats.table_columns import (
    SECONDS,
    any_names,
    interpret_names,
    name_and_units,
    split_names,
    with_units,
)
from tdint.ground_motion.record import Input, Record
from tdint.number_parsing import parse_named, parse_positive, parse_ratio, pluralize
from tdint.response.spectra.elastic import Spectrum
from tdint.units import ACCELERATION, STANDARD_GRAVITY, canonical, parse_units, parse_with_unit

Texts = Mapping[str, str]

_NAME_PATTERN = re.compile(r"([A-Za-z]\w*)(?::(\w+=.*)?)?", re.DOTALL)

_MCER = 1.5
"""Ratio of the spectrum of the risk-targeted maximum considered earthquake to the design spectrum
(ASCE 7-16, 11.4.7)."""

_MAX_SDS = 5.0
"""Maximum SDS, g. Values in the maps of ASCE 7 are below 3; a larger value was probably specified
in m/s^2."""

_EC8_PARAMETERS = {
    "1": {
        "A": (1.0, 0.15, 0.4, 2.0),
        "B": (1.2, 0.15, 0.5, 2.0),
        "C": (1.15, 0.2, 0.6, 2.0),
        "D": (1.35, 0.2, 0.8, 2.0),
        "E": (1.4, 0.15, 0.5, 2.0),
    },
    "2": {
        "A": (1.0, 0.05, 0.25, 1.2),
        "B": (1.35, 0.05, 0.25, 1.2),
        "C": (1.5, 0.1, 0.25, 1.2),
        "D": (1.8, 0.1, 0.3, 1.2),
        "E": (1.6, 0.05, 0.25, 1.2),
    },
}
"""S, TB, TC, TD by spectrum type and ground type: recommended values of EN 1998-1:2004 (tables 3.2
and 3.3)."""

_MIN_ETA = 0.55  # minimum damping correction factor eta, EN 1998-1 3.2.2.2 (3)
_MIN_OF_DESIGN = 0.2  # beta, lower bound of the design spectrum over ag, EN 1998-1 3.2.2.5 (4)
_EC8_END = 4.0
"""Period, s, above which EN 1998-1 Annex A applies, which covers only spectra of type 1."""
# Period TE, s, by ground type (EN 1998-1:2004 table A.1); for longer periods the displacements of
# Annex A apply
_TE = {"A": 4.5, "B": 5.0, "C": 6.0, "D": 6.0, "E": 6.0}
_TF = 10.0  # s; period TF: at longer periods, spectral and ground displacement are equal

_MAX_PERIOD = 20.0
"""Maximum period of a two-period spectrum, s. TL of the maps is 4 to 16 s, and spectra of isolated
and tall buildings are used up to twice the first period."""


DesignSpectrum: TypeAlias = tuple[Callable[[Array], Array], tuple[float, ...], float, float]
"""Design spectrum of a code: function that returns pseudo-accelerations, m/s^2, at periods (s, 0 or
more), shape (k,); periods where its branches meet, s; its damping ratio; its maximum period,
s."""


def _two_period(parameters: Texts, factor: float = 1.0) -> DesignSpectrum:
    """Return the two-period design spectrum of ASCE 7-10 and 7-16 (section 11.4) for the texts of
    `sds` and `sd1` (design accelerations at short periods and at 1 s, g) and `tl` (long-period
    transition period, s).
    """
    sds, sd1, tl = (parse_positive(key, parameters[key]) for key in ("sds", "sd1", "tl"))
    if sds > _MAX_SDS:
        raise UsageError(
            f"sds must be at most {_MAX_SDS:g} g, got {sds:g}; if it is in m/s^2, "
            f"use {sds / STANDARD_GRAVITY:.3g}"
        )
    ts = sd1 / sds
    if not ts < tl:
        raise UsageError(f"tl must be longer than TS = sd1/sds = {ts:.4g} s, got {tl:g} s")
    t0 = 0.2 * ts

    def curve(periods: Array) -> Array:
        """Return the pseudo-accelerations (m/s^2) at periods (s), shape (k,)."""
        t = np.maximum(periods, t0)  # avoids a division by 0
        # Constant acceleration, constant velocity and constant displacement; g.
        shape = np.where(t <= ts, sds, np.where(t <= tl, sd1 / t, sd1 * tl / t**2))
        return (
            factor
            * STANDARD_GRAVITY
            * np.where(periods < t0, sds * (0.4 + 0.6 * periods / t0), shape)
        )

    return curve, (t0, ts, tl), 0.05, _MAX_PERIOD


def _ec8(parameters: Texts) -> DesignSpectrum:
    """Return the elastic spectrum Se of Eurocode 8 (EN 1998-1:2004, 3.2.2.2), or the design
    spectrum Sd (3.2.2.5) if the parameters include the behavior factor `q`.

    The design spectrum is 2/3 ag S at period 0, 2.5 ag S / q on the plateau and at least 0.2 ag for
    longer periods; damping is included in q. An elastic spectrum of type 1 extends to 10 s; above
    the period TE it follows the displacements of eq. A.2 (Annex A). A spectrum of type 2 extends to
    4 s. The parameters are the texts of `type` (1 or 2), `soil` (A to E), `ag` (peak ground
    acceleration with its unit) and `damping` (ratio, 5 % by default); and `s` (soil factor), `tb`,
    `tc` and `td` (corner periods, s) of a National Annex, by default the recommended values.
    """
    soils = _EC8_PARAMETERS.get(parameters["type"])
    if soils is None:
        raise UsageError(f"the spectrum type must be 1 or 2, got {parameters['type']!r}")
    if parameters["soil"].upper() not in soils:
        raise UsageError(
            f"the ground type (soil) must be one of {', '.join(soils)}, got {parameters['soil']!r}"
        )
    recommended = dict(zip(("s", "tb", "tc", "td"), soils[parameters["soil"].upper()], strict=True))
    s, tb, tc, td = (
        parse_positive(key, parameters[key]) if key in parameters else value
        for key, value in recommended.items()
    )
    if not tb < tc < td < _EC8_END:
        raise UsageError(
            f"tb, tc and td must increase and be less than {_EC8_END:g} s, got {tb:g}, {tc:g} and "
            f"{td:g} s"
        )
    ag = parse_with_unit(parameters["ag"], "acceleration", "0.25g", "ag")
    damping = parse_ratio(parameters.get("damping", "5%"))
    if not 0.0 < damping < 1.0:
        raise UsageError(f"damping must be between 0 and 100 %, got {parameters['damping']!r}")
    corners = [tb, tc, td]
    if "q" in parameters:
        q = parse_positive("q", parameters["q"])
        if q < 1.0:
            raise UsageError(f"the behavior factor q must be at least 1, got {q:g}")
        if "damping" in parameters:
            raise UsageError("q includes the damping of the building; remove damping or q")
        at_zero, plateau, lowest = 2.0 / 3.0, 2.5 / q, _MIN_OF_DESIGN / s
        te, last = _TF, _TF  # Annex A applies to elastic spectra
        # Period where the spectrum reaches its lower bound
        end = plateau * tc / lowest
        corners.append(end if end <= td else math.sqrt(end * td))
    else:
        eta = max(math.sqrt(10.0 / (5.0 + 100.0 * damping)), _MIN_ETA)
        at_zero, plateau, lowest, te = 1.0, 2.5 * eta, 0.0, _TE[parameters["soil"].upper()]
        last = _TF if parameters["type"] == "1" else _EC8_END

    def curve(periods: Array) -> Array:
        """Return the pseudo-accelerations (m/s^2) at periods (s), shape (k,)."""
        t = np.maximum(periods, tb)  # avoids a division by 0
        # Branches of constant acceleration, velocity and displacement, relative to ag S.
        shape = plateau * np.where(t <= tc, 1.0, np.where(t <= td, tc / t, tc * td / t**2))
        # Displacement of eq. A.2 relative to ag S: it decreases between TE and TF to the ground
        # displacement.
        part = np.clip((t - te) / max(_TF - te, tb), 0.0, 1.0)
        displacement = 0.025 * tc * td * (plateau + part * (1.0 - plateau))
        shape = np.where(t <= te, shape, displacement * (2.0 * np.pi / t) ** 2)
        shape = np.maximum(shape, np.where(t > tc, lowest, 0.0))
        rise = at_zero + periods / tb * (plateau - at_zero)
        return ag * s * np.where(periods < tb, rise, shape)

    return curve, tuple(corners), damping, last


_TWO_PERIOD = {"sds": True, "sd1": True, "tl": True}
CODES: Mapping[str, tuple[Callable[[Texts], DesignSpectrum], Mapping[str, bool]]] = {
    "asce7": (_two_period, _TWO_PERIOD),
    "mcer": (partial(_two_period, factor=_MCER), _TWO_PERIOD),
    "ec8": (
        _ec8,
        {
            "type": True,
            "soil": True,
            "ag": True,
            "damping": False,
            "q": False,
            "s": False,
            "tb": False,
            "tc": False,
            "td": False,
        },
    ),
}
"""Function that returns the design spectrum, and its parameters (True if required), by name."""

EXAMPLES = {
    "asce7": "asce7:sds=1.0,sd1=0.6,tl=8",
    "mcer": "mcer:sds=1.0,sd1=0.6,tl=8",
    "ec8": "ec8:type=1,soil=B,ag=0.25g",
}


_MULTI_PERIOD = {
    "asce7-22": "multiPeriodDesignSpectrum",
    "mcer-22": "multiPeriodMCErSpectrum",
}
"""Key of each multi-period spectrum of ASCE 7-22 in the file of the USGS service, by its name."""

_MULTI_PERIOD_PATTERN = re.compile(
    rf"({'|'.join(_MULTI_PERIOD)})(?::(.*))?", re.DOTALL | re.IGNORECASE
)
_MAX_BYTES = 1_000_000  # maximum size of a file of the USGS service, which has about 10 000 bytes
_MAX_SA = 10.0  # g; values of ASCE 7-22 are below 5, a larger value is probably in m/s^2
_NEEDS = (
    "a target spectrum is a CSV file with the columns period_s and sa_g or sa_m_s2, or a design "
    "spectrum by name, such as asce7:sds=1.0,sd1=0.6,tl=8"
)
_GRID = (0.01, 241)
"""Minimum period (s) and number of periods where a design spectrum is plotted and written, in
addition to its corner periods."""


@dataclass(frozen=True, eq=False)
class TargetSpectrum:
    """Pseudo-accelerations as a function of the period: a formula of a code, or linear
    interpolation between points on logarithmic axes.

    Attributes
    ----------
    source : str
        The file, or the name and parameters of the code, as the user specified them.
    periods : ndarray, shape (k,)
        Periods, s, positive and increasing.
    psa : ndarray, shape (k,)
        Pseudo-accelerations, m/s^2, positive.
    zero : float | None
        Pseudo-acceleration at period 0, m/s^2; None if unknown.
    damping : float | None
        Damping ratio of the spectrum; None if unknown.
    curve : callable | None
        The formula of the code; None for a table.
    formula_corner : float | None
        Period where the constant acceleration of the formula ends, s; None for a table.
    """

    source: str
    periods: Array
    psa: Array
    zero: float | None = None
    damping: float | None = None
    curve: Callable[[Array], Array] | None = None
    formula_corner: float | None = None

    def __reduce__(self) -> tuple[Any, ...]:
        # The function of a formula cannot be pickled; create it again from its name.
        if self.curve is not None:
            return read_target, (self.source,)
        return TargetSpectrum, (self.source, self.periods, self.psa, self.zero, self.damping)

    @property
    def sd(self) -> Array:
        """Displacements Sa (T/2 pi)^2, m, shape (k,)."""
        return self.psa * (self.periods / (2.0 * np.pi)) ** 2

    @property
    def psv(self) -> Array:
        """Pseudo-velocities Sa T/2 pi, m/s, shape (k,)."""
        return self.psa * self.periods / (2.0 * np.pi)

    @property
    def corner(self) -> float:
        """Period where the constant acceleration ends (TC or TS), s. For a table, this is the
        period where the maximum pseudo-acceleration and the maximum pseudo-velocity
        intersect."""
        if self.formula_corner is not None:
            return self.formula_corner
        return float(2.0 * np.pi * np.max(self.psv) / np.max(self.psa))

    def check_damping(self, damping: float, spectra: str) -> None:
        """Raise an error if the damping ratio of other spectra differs from the ratio of the
        target.

        Parameters
        ----------
        damping : float
            Damping ratio of the other spectra.
        spectra : str
            Description of these spectra in the message, such as `of the motion`.

        Raises
        ------
        UsageError
            The damping ratios differ.
        """
        if self.damping is not None and abs(self.damping - damping) > _TOLERANCE:
            raise UsageError(
                f"{self.source}: the target applies to {100.0 * self.damping:g} % damping, the "
                f"spectra {spectra} to {100.0 * damping:g} %; use the same damping ratio for both "
                "(--damping)"
            )

    def at(self, periods: ArrayLike) -> Array:
        """Return the pseudo-accelerations at periods (s), m/s^2, shape (k,).

        The formula of a code also applies to periods below `self.periods`, down to 0, where its
        value is the peak ground acceleration. A table is interpolated.

        Parameters
        ----------
        periods : array of float, shape (k,)
            Periods, s.

        Raises
        ------
        UsageError
            A period is nan or outside the range of the spectrum.
        """
        low, high = 0.0 if self.curve else float(self.periods[0]), float(self.periods[-1])
        periods = np.atleast_1d(np.asarray(periods, float))
        # The condition is False for nan.
        is_within = (periods >= low * (1.0 - 1e-9)) & (periods <= high * (1.0 + 1e-9))
        if not is_within.all():
            raise UsageError(
                f"{self.source}: periods must be within the spectrum, {low:g} to {high:g} s, got "
                f"{np.min(periods):.6g} to {np.max(periods):.6g} s"
            )
        if self.curve is not None:
            return self.curve(periods)
        return np.asarray(
            np.exp(np.interp(np.log(periods), np.log(self.periods), np.log(self.psa)))
        )


def read_target(source: str) -> TargetSpectrum:
    """Read a target spectrum from a file, or compute it from the formula of a code.

    The points exclude period 0, because a logarithmic axis cannot show it.

    Parameters
    ----------
    source : str
        Name and parameters of a design spectrum (`ec8:type=1,soil=B,ag=0.25g`); a multi-period
        spectrum of ASCE 7-22 in a file of the USGS service (`asce7-22:FILE`, `mcer-22:FILE`); or a
        CSV file with a column of periods (`period_s`, `T (s)`) and a column of accelerations
        (`sa_g`, `psa_m_s2`, `Sa (g)`).

    Returns
    -------
    TargetSpectrum
        `at(periods)` evaluates it.

    Raises
    ------
    ModelError
        The file cannot be read, lacks a column, or does not contain a valid spectrum.
    UsageError
        The name is unknown, or the parameters are invalid.
    """
    if match := _MULTI_PERIOD_PATTERN.fullmatch(source.strip()):
        return _multi_period(source, match[1].lower(), match[2] or "")
    if (named := _name_and_parameters(source)) is None:
        table = read_table(source, _NEEDS, find_header=find_spectrum_header)
        table.only("damping")  # raises an error for the spectra of several ratios
        damping = table.numbers("damping")[0] if table.has("damping") else None
        return _read_points(table, damping)
    name, text = named
    if name not in CODES:
        raise UsageError(
            f"{source[:60]!r}: unknown design spectrum {name!r} (known: "
            f"{', '.join((*CODES, *_MULTI_PERIOD))})"
        )
    design_spectrum, parameters = CODES[name]
    try:
        curve, corners, damping, longest = design_spectrum(
            parse_named(name, text, parameters, EXAMPLES[name])
        )
    except UsageError as error:
        raise UsageError(f"{source[:60]!r}: {error}") from None
    # The points of a formula are used for plots and tables.
    low, count = _GRID
    grid = np.geomspace(low, longest, int(count))
    periods = np.unique([*grid, *(corner for corner in corners if grid[0] < corner < grid[-1])])
    zero = float(curve(np.zeros(1))[0])
    _, end_of_constant_acceleration, *_ = corners
    return TargetSpectrum(
        source, periods, curve(periods), zero, damping, curve, end_of_constant_acceleration
    )


def _name_and_parameters(source: str) -> tuple[str, str] | None:
    """Split `name:parameters` of a design spectrum; return None if the source is a file of points.

    The second text is empty if there are no parameters.
    """
    # A text without parameters is the name of a file, unless it is the name of a code.
    match = _NAME_PATTERN.fullmatch(source.strip())
    if match is None or (match[2] is None and match[1].lower() not in CODES):
        return None
    return match[1].lower(), match[2] or ""


_DAMPED = ",damping="
"""Text between a spectrum of Eurocode 8 and its damping ratio."""


def source_of(targets: Sequence[TargetSpectrum]) -> str:
    """Return the user's text of one or several targets (`read_targets`).

    Several targets of a code differ in their damping ratio, which is removed.
    """
    source = targets[0].source
    return source if len(targets) == 1 else source.partition(_DAMPED)[0]


def read_targets(source: str, dampings: Sequence[float]) -> tuple[TargetSpectrum, ...]:
    """Read the target spectra for damping ratios.

    Parameters
    ----------
    source : str
        CSV file with the column `damping`, or `ec8:...` without its parameter `damping`; for a
        single ratio any source of `read_target`.

    Raises
    ------
    ModelError, UsageError
        As by `read_target`; or the source lacks a spectrum for a ratio.
    """
    named = _name_and_parameters(source)
    if named is None and not _MULTI_PERIOD_PATTERN.fullmatch(source.strip()):
        table = read_table(source, _NEEDS, find_header=find_spectrum_header)
        if table.has("damping"):
            return tuple(_read_points(_with_damping(table, ratio), ratio) for ratio in dampings)
        if len(dampings) == 1:
            return (_read_points(table),)
    elif len(dampings) == 1 or (named and not named[1]):
        return (read_target(source),)  # raises an error for a name without parameters
    elif named and named[0] == "ec8" and "damping" not in named[1].lower():
        return tuple(read_target(f"{source}{_DAMPED}{ratio!r}") for ratio in dampings)
    raise UsageError(
        f"{source[:60]!r}: is a spectrum for a single damping ratio, got {len(dampings)} ratios; "
        "specify a single ratio, ec8:... without its damping, or a CSV file with the columns "
        "damping, period_s and sa_g"
    )


def _multi_period(source: str, name: str, file: str) -> TargetSpectrum:
    """Return a multi-period spectrum of ASCE 7-22 (11.4.5.1) with 5 % damping, linear between the
    periods of a JSON file of the USGS design maps service; accelerations are in g.

    UsageError is raised if there is no file; ModelError, if it cannot be read, is not from the
    service for ASCE 7-22, or is invalid.
    """
    key = _MULTI_PERIOD[name]
    if not file:
        raise UsageError(
            f"{source}: add the JSON file of the USGS design maps service, such as {name}:site.json"
        )
    required_file = (
        f"a JSON file of the USGS design maps service for ASCE 7-22 with response.data.{key}"
    )
    size_message = f"is larger than {_MAX_BYTES} bytes; it must be {required_file}"
    data = read_whole(file, ModelError, {}, size_message, _MAX_BYTES)
    record_digest(file, data)
    try:
        content: Any = json.loads(data)
        points = content["response"]["data"][key]
        periods, ordinates = (
            np.array([_number(value) for value in points[part]])
            for part in ("periods", "ordinates")
        )
    except (ValueError, KeyError, TypeError, RecursionError):
        raise ModelError(f"{file}: must be {required_file}") from None
    if periods.size != ordinates.size or periods.size < 3:
        raise ModelError(
            f"{file}: {key}: periods and ordinates must be lists of equal length, got "
            f"{periods.size} and {ordinates.size}"
        )
    if periods[0] != 0.0 or np.any(np.diff(periods) <= 0.0):
        raise ModelError(f"{file}: {key}: periods must start at 0 s and increase")
    largest = float(np.max(ordinates))
    if np.min(ordinates) <= 0.0 or largest > _MAX_SA:
        raise ModelError(
            f"{file}: {key}: ordinates must be in g, above 0 and at most {_MAX_SA:g}, got "
            f"{np.min(ordinates):g} to {largest:g}"
        )
    psa = STANDARD_GRAVITY * ordinates
    return TargetSpectrum(
        source,
        periods[1:],
        psa[1:],
        float(psa[0]),
        0.05,
        lambda at: np.asarray(np.interp(at, periods, psa)),
    )


def _number(value: Any) -> float:
    """Return a finite number of a JSON file; raise ValueError for another value."""
    if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
        raise ValueError
    return float(value)


def _with_damping(table: CsvTable, damping: float) -> CsvTable:
    """Return a table with only those rows that have a damping ratio in the column `damping`."""
    has_ratio = _has_damping(table.source, np.array(table.numbers("damping")), damping, ModelError)
    return replace(table, rows=tuple(compress(table.rows, has_ratio)))


def _has_damping(
    source: str | Path, ratios: Array, damping: float, error: type[TdintError]
) -> NDArray[np.bool_]:
    """Return True for each row of a file that has the required damping ratio.

    `ratios` is the damping ratio of each row. `error` is the type of the exception if no row has
    this ratio.
    """
    has_ratio = np.abs(ratios - damping) <= _TOLERANCE
    if not np.any(has_ratio):
        listed = ", ".join(f"{ratio:g}" for ratio in np.unique(ratios)[:8])
        raise error(f"{source}: damping ratio {damping:g} not found; the file contains {listed}")
    return has_ratio


def _read_points(table: CsvTable, damping: float | None = None) -> TargetSpectrum:
    """Return the target spectrum of a table with a column of periods and one column of
    accelerations. ModelError is raised if a column is missing, or its values are invalid.
    """
    # Columns of pseudo-acceleration have precedence over other accelerations.
    period, factor_of_periods = _period_column(table, ModelError)
    columns = [(title, *spectral_name(title)) for title in table.titles]
    values = [title for title, quantity, _ in columns if quantity in ("psa", "sa")]
    with_units = [title for title in values if canonical(spectral_name(title)[1]) in ACCELERATION]
    if values and not with_units:
        raise ModelError(
            f"{table.source}:{table.header_line}: the name of the column {values[0][:40]!r} must "
            "contain its unit, such as Sa (g)"
        )
    values = [title for title in with_units if spectral_name(title)[0] == "psa"] or with_units
    if not values:
        raise ModelError(
            f"{table.source}:{table.header_line}: no column of accelerations, such as sa_g or "
            f"sa_m_s2, among {pluralize(len(table.header), 'column')}"
        )
    if len(values) > 1:
        raise ModelError(
            f"{table.source}:{table.header_line}: the table contains several spectra, "
            f"{', '.join(values)}; keep only one of these columns"
        )
    value = values[0]
    factor = ACCELERATION[canonical(spectral_name(value)[1])]
    periods = factor_of_periods * np.array(table.numbers(period))
    psa = factor * np.array(table.numbers(value, positive=True))
    not_increasing = np.flatnonzero(np.diff(periods, prepend=-1.0) <= 0.0)
    if not_increasing.size or periods[0] < 0.0:
        row = int(not_increasing[0]) if not_increasing.size else 0
        # The first item of a row of the table is its line number in the file.
        raise ModelError(
            f"{table.source}:{table.rows[row][0]}: the periods of a spectrum must be 0 or "
            f"positive, and increase, got {periods[row]:g} s"
        )
    positive = periods > 0.0
    if np.sum(positive) < 2:
        raise ModelError(f"{table.source}: a spectrum requires at least two positive periods")
    zero = None if positive[0] else float(psa[0])
    return TargetSpectrum(table.source, periods[positive], psa[positive], zero, damping)


# ---- Names of the columns of spectra

_OF = r"(?:(?:rotd\d+|geometric mean|geomean|mean|median|target|design|elastic|srss) )?"
_SPECTRAL_NAMES = {
    "period": r"t|tn|t1|(?:(?:natural|structural|oscillator|vibration) )?(?:periods?|periodos?|"
    r"periodes?|periode|perioden|schwingungsdauer)(?: t)?",
    "psa": rf"{_OF}(?:psa|pseudo[- ]?(?:spectral )?acc(?:el|eleration)?\.?)",
    "sa": rf"{_OF}(?:sa|sae|se|(?:spectral )?acc(?:el|eleration)?\.?|a|spectrum|design spectrum)",
    "psv": r"psv|pseudo[- ]?(?:spectral )?velocity",
    "sv": r"sv|(?:spectral )?velocity",
    "sd": r"sd|(?:spectral )?disp(?:l|lacement)?\.?",
}
"""Patterns of the names of columns, in lower case with blanks and without units."""

_MAX_TITLES = 20  # lines above the names of the columns


def spectral_name(title: str) -> tuple[str, str]:
    """Return the meaning of a column of a spectrum, `period` or a key of `QUANTITIES`, empty for
    another name, and its unit. `Sa(T) (g)`, `sa_g` and `Spectral Acceleration [g]` are equivalent.
    """
    name, unit = name_and_units(re.sub(r"(?i)\s*\((?:tn?\d?|\d+ ?%)\)", "", title))
    found = (key for key, names in _SPECTRAL_NAMES.items() if re.fullmatch(names, name))
    return next(found, ""), unit


def find_spectrum_header(lines: Sequence[str]) -> TableHeader | None:
    """Return the line of the names in the first lines of a spectrum, which titles may precede and
    a line of units may follow; None if the lines name no period and no ordinate.

    The separator is the same as in the rows below, which may be blanks.
    """
    for number, line in enumerate(lines[:_MAX_TITLES], start=1):
        below = [text.strip() for text in lines[number : number + 3] if text.strip()]
        rows = below[-1] if below else ""
        has_decimal_commas = re.fullmatch(r"[\d,Ee+-]+\s+[\d,Ee+-]+", rows)
        mark = next((m for m in "\t;," if m in rows and not (m == "," and has_decimal_commas)), " ")
        width = len(rows.split(mark if mark != " " else None))
        text = re.sub(r"^\s*[#%!]+\s*", "", line)
        names = any_names(text, mark, width) or interpret_names(split_names(text, mark))
        meanings = {spectral_name(name.text)[0] for name in names}
        if "period" in meanings and meanings & set(QUANTITIES):
            units = with_units(names, below[0], mark) if below else ()
            return TableHeader(number + bool(units), mark, [name.text for name in units or names])
    return None


def _period_column(table: CsvTable, error: type[TdintError]) -> tuple[str, float]:
    """Return the name of the column of periods, and the value of its unit, s."""
    for title in table.titles:
        meaning, unit = spectral_name(title)
        if meaning == "period" and unit in SECONDS:
            return title, SECONDS[unit]
    raise error(
        f"{table.source}:{table.header_line}: no column of periods, such as period_s or T (s), "
        f"among {pluralize(len(table.titles), 'column')}; the first line must contain the names, "
        "such as T (s),Sa (g)"
    )


# ---- Published spectra and their differences from computed spectra

QUANTITIES = {
    "sd": ("displacement", "sd_m"),
    "psv": ("velocity", "psv_m_s"),
    "psa": ("acceleration", "psa_m_s2"),
    "sv": ("velocity", "sv_m_s"),
    "sa": ("acceleration", "sa_m_s2"),
}
"""Physical quantity of the units and output column, by the name of the spectral quantity in tables
and in `Spectrum`."""

_TOLERANCE = 1e-6
"""Tolerance within which two periods (relative) or damping ratios (absolute) are equal, because
printed values are rounded."""


@dataclass(frozen=True, eq=False)
class PublishedSpectrum:
    """Published spectrum, read from a file.

    Attributes
    ----------
    quantity : str
        A key of `QUANTITIES`.
    periods, values : ndarray, shape (k,)
        Increasing periods, s, and spectral values in SI units.
    """

    source: str
    quantity: str
    periods: Array
    values: Array
    input: Input

    def at(self, periods: Array) -> Array:
        """Return the spectral values in the file at given periods, in SI units.

        Parameters
        ----------
        periods : ndarray, shape (k,)
            Periods, s; they may differ from the periods of the file by rounding.

        Raises
        ------
        UsageError
            The file does not contain a period.
        """
        near = np.abs(self.periods[:, None] - periods) <= _TOLERANCE * periods
        missing = periods[~near.any(axis=0)]
        if missing.size:
            raise UsageError(
                f"{self.source} has no period {missing[0]:.6g} s; omit the periods to use those of "
                "the file"
            )
        values: Array = self.values[near.argmax(axis=0)]
        return values


@dataclass(frozen=True)
class SpectrumDifference:
    """Comparison of a computed spectrum with a published spectrum; arrays of shape (k,).

    Attributes
    ----------
    expected : ndarray
        The published values at the periods of the computed spectrum.
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
        """Ratio of computed to published values, minus 1; nan where the published value is 0."""
        expected = np.where(self.expected == 0.0, np.nan, self.expected)
        return self.computed / expected - 1.0

    @property
    def largest(self) -> tuple[float, float] | None:
        """Relative difference of largest magnitude, with its sign, and its period, s; None if no
        difference is finite."""
        difference = self.relative_difference
        if not np.any(np.isfinite(difference)):
            return None
        i = int(np.nanargmax(np.abs(difference)))
        return float(difference[i]), float(self.periods[i])


def read_published(
    source: str | Path, damping: float, column: str | None = None
) -> PublishedSpectrum:
    """Read a published spectrum from a CSV file with quantities and units in its header.

    Parameters
    ----------
    source : str or Path
        The file. It needs a column of periods (`period_s`, `T (s)`) and a column of values
        (`psa_g`, `PSA (cm/s^2)`, `sd_cm`) with a quantity that is a key of `QUANTITIES`. If the
        file has a column `damping`, only the rows with the requested damping ratio are used.
    column : str, optional
        Name of the column of values. Required if the file contains several columns of values.

    Raises
    ------
    RecordError
        The file cannot be read, lacks a column or units, or contains a period twice.
    UsageError
        The file contains several columns of values, and `column` is `None`.
    """
    needs = "a published spectrum is a CSV file with periods, values and their units"
    table = read_table(str(source), needs, error=RecordError, find_header=find_spectrum_header)
    if len(table.rows) < _MIN_ROWS:
        raise RecordError(
            f"{source}: the table must have at least {_MIN_ROWS} rows, got {len(table.rows)}"
        )
    text, second = _period_column(table, RecordError)
    if not spectral_name(text)[1]:
        raise RecordError(
            f"{table.source}: the name of the column {text!r} must contain its unit, such as "
            "period_s"
        )
    quantity, values = _values(table, column)
    periods = second * np.array(table.numbers(text))
    # Sort them by period, because interpolation requires increasing periods.
    rows = np.argsort(periods, kind="stable")
    if table.has("damping"):
        ratios = np.array(table.numbers("damping"))
        rows = rows[_has_damping(source, ratios, damping, RecordError)[rows]]
    periods, values = periods[rows], values[rows]
    if periods[0] < 0.0 or np.any(values < 0.0):
        raise RecordError(f"{source}: periods and values of a spectrum must not be negative")
    if np.any(np.diff(periods) == 0.0):
        twice = float(periods[:-1][np.diff(periods) == 0.0][0])
        raise RecordError(
            f"{source}: the period {twice:g} s occurs twice; keep only one spectrum in the file"
        )
    published = Input(str(source), table.digest)
    return PublishedSpectrum(str(source), quantity, periods, values, published)


def differences(
    spectra: Sequence[Spectrum], published: PublishedSpectrum
) -> list[SpectrumDifference]:
    """Compare computed spectra with a published spectrum at their periods."""
    return [
        SpectrumDifference(spectrum, published, published.at(spectrum.periods))
        for spectrum in spectra
    ]


_MIN_ROWS = 2  # rows; a spectrum is interpolated between two periods


def _values(table: CsvTable, column: str | None) -> tuple[str, Array]:
    """Return the quantity (key of `QUANTITIES`) and the values, in SI units, of a column of a
    published spectrum; without a name, of the only column of a spectral quantity.

    RecordError is raised if the column is missing, or its name has no valid units; UsageError, if
    there are several columns of spectra and no name.
    """
    columns = {
        text: spectral_name(text) for text in table.titles if spectral_name(text)[0] in QUANTITIES
    }
    if column is not None:
        table.need(column)
        if column not in columns:
            raise RecordError(
                f"{table.source}: the column {column!r} is not a spectrum; it must be one of "
                f"{', '.join(QUANTITIES)} with its units"
            )
    elif len(columns) != 1:
        if columns:
            raise UsageError(
                f"{table.source}: the file contains several spectra; select one with "
                f"--against-column: {', '.join(columns)}"
            )
        raise RecordError(
            f"{table.source}: no column of a spectrum ({', '.join(QUANTITIES)}, with units, such "
            "as "
            f"psa_g); the columns are {', '.join(table.titles)[:200]}"
        )
    # The name of the column ends with the units, which must match its quantity.
    chosen = column if column is not None else next(iter(columns))
    name, text = columns[chosen]
    try:
        units = parse_units(text)
    except UsageError:
        raise RecordError(
            f"{table.source}: the name of the column {chosen!r} must end with its units (psa_g)"
        ) from None
    if units.quantity != QUANTITIES[name][0]:
        raise RecordError(
            f"{table.source}: the name of the column {chosen!r} contradicts its units: {text} is a "
            f"unit of {units.quantity}, not of {QUANTITIES[name][0]}"
        )
    values = units.scale * np.array(table.numbers(chosen))
    return name, values
