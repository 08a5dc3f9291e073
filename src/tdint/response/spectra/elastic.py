"""Elastic response spectra for `tdint spectrum`, and Sa(T1) of the first mode of a building."""

import math
from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, Any, NamedTuple, TypeVar, overload

import numpy as np
from numpy.typing import NDArray

from tdint.arrays import Array, Numbers
from tdint.errors import AnalysisError, UsageError
from tdint.ground_motion.processing_steps import INTERPOLATIONS, LINEAR, Interpolation
from tdint.ground_motion.record import Record
from tdint.kernels.oscillators import elastic as spectra
from tdint.kernels.oscillators.between_steps import (
    A11,
    A12,
    A21,
    B10,
    B11,
    B20,
    B21,
    RECURSION_ROWS,
    Vibration,
    largest_afterwards,
)
from tdint.methods.exact_step import oscillator
from tdint.number_parsing import pluralize
from tdint.response.arguments import AnyRecord, damping_of, numbers_of, record_of
from tdint.response.defaults import STEPS_PER_PERIOD
from tdint.tabular import ResultList, Tabular, map_over_first
from tdint.units import Quantity

if TYPE_CHECKING:
    from tdint.methods.method import Integrator
    from tdint.model.building import Building


# ---- Maximum response of many oscillators to a single ground motion, by the exact recursion with a
# time step that depends on the oscillator

Parts = NDArray[np.int64]

# Value of `Quantity.shown` for columns that a table contains only if the user specified the option.
_IF_REQUESTED = ("asked",)
DampingRatio = Annotated[float, Quantity("1", "viscous damping ratio")]
Periods = Annotated[Array, Quantity("s", "natural period", called="period")]
MaximaName = Annotated[
    str, Quantity("text", "times at which maxima were evaluated", shown=_IF_REQUESTED)
]
InterpolationName = Annotated[
    str, Quantity("text", "the ground motion between its samples", shown=_IF_REQUESTED)
]
"""Declarations that all spectra have in common. The last two are columns only if requested."""

_LANES = 4
"""Number of oscillators that the kernel integrates together: the values of a vector register. More
would hardly be faster, and would increase the memory for the maxima of a long record."""

# Relative reduction of a quotient before it is rounded up, so that a rounding error does not
# increase an integer quotient by 1
_ROUNDING = 1e-9


def recursion_table(omega: Array, h: Array, damping: float | Array, more: int) -> Array:
    """Return the coefficients of the exact solution over one time step (s) for linear oscillators
    in the rows of `tdint.kernels.oscillators.between_steps`, and `more` rows without values.

    The solution is exact for a ground acceleration that is linear within the step (Nigam and
    Jennings 1969). The damping ratio is a single value, or a value for each oscillator.
    """
    # The coefficients are first computed for displacements u, h v (velocity v) and h^2 p (load p),
    # and then converted to u, v and p.
    steps = oscillator(omega * h, np.full_like(omega, damping))
    table = np.empty((RECURSION_ROWS + more, omega.size))
    for row, first in ((0, A11), (1, A21)):
        table[first : first + 4] = steps[:, row].T
    table[A12] *= h
    table[A21] /= h
    table[[B10, B11]] *= h * h
    table[[B20, B21]] *= h
    return table


def check_shortest(periods: Array, dt: float, least: float, otherwise: str = "") -> None:
    """Raise AnalysisError if a positive period is shorter than `least` sampling intervals.

    Parameters
    ----------
    least : float
        Minimum period in sampling intervals.
    otherwise : str, optional
        Alternative to longer periods, appended to the message.

    Raises
    ------
    AnalysisError
        A period is too short.
    """
    shortest = float(np.min(periods[periods > 0.0]))
    if shortest < least * dt:
        raise AnalysisError(
            f"the period {shortest:.6g} s is less than {least:g} sampling intervals of {dt:.6g} s; "
            f"request periods of at least {least * dt:.6g} s{otherwise}"
        )


class Maxima(NamedTuple):
    """Definition of the times of the maxima.

    Attributes
    ----------
    name : str
        Name on the command line and in tables.
    parts : callable
        Function that receives omega (rad/s, shape (k,)) and the sampling interval (s). It returns
        the number of parts, shape (k,), into which the interval is divided for each oscillator.
    between : bool
        True if maxima between the endpoints of these parts are also included.
    description : str
        Description of the times of the maxima, for messages.
    """

    name: str
    parts: Callable[[Array, float], Parts]
    between: bool
    description: str


def _resolving(omega: Array, dt: float) -> Parts:
    """Return the number of parts of the interval dt (s) for each oscillator, so that omega h <= 1.

    The search for maxima within a part of length h requires this limit. All numbers of parts are
    powers of two, so that many oscillators have the same number and are integrated together.
    """
    return 2 ** np.ceil(np.log2(np.maximum(1.0, omega * dt * (1.0 - _ROUNDING)))).astype(np.int64)


def _ten_per_period(omega: Array, dt: float) -> Parts:
    """Return the number of parts of the interval dt (s) for each oscillator, with at least
    `STEPS_PER_PERIOD` parts in a period.
    """
    periods = 2.0 * math.pi / omega
    return np.ceil(STEPS_PER_PERIOD * dt / periods * (1.0 - _ROUNDING)).astype(np.int64)


def _undivided(omega: Array, dt: float) -> Parts:
    """Return the number 1 for each oscillator: the sampling interval is not divided."""
    return np.ones(omega.shape, dtype=np.int64)


EXACT = Maxima("exact", _resolving, between=True, description="also between the samples")
PEER = Maxima(
    "peer",
    _ten_per_period,
    between=False,
    description=f"at {STEPS_PER_PERIOD} or more time steps per period",
)
SAMPLES = Maxima("samples", _undivided, between=False, description="only at the samples")
INTERPOLATED = Maxima(
    "interpolated",
    _undivided,
    between=True,
    description="also between the samples, on the interpolant of the method",
)
MAXIMA = {maxima.name: maxima for maxima in (EXACT, PEER, SAMPLES)}


def largest(ground: Array, dt: float, omega: Array, damping: float, maxima: Maxima) -> Array:
    """Return the maximum displacement (m) and velocity (m/s) relative to the ground, and maximum
    absolute acceleration (m/s^2) of linear oscillators, shape (3, k).

    The ground acceleration (m/s^2) is linear between samples. The oscillators are at rest at the
    first sample. With maxima between the samples, the ground acceleration decreases to zero within
    a sampling interval after the last sample, and maxima include the free vibration. Otherwise,
    maxima are evaluated until the last sample.
    """
    # A copy, because kernels have no read-only arguments
    ground = np.append(ground, [0.0] if maxima.between else [])
    result = np.empty((spectra.PEAKS, omega.size))
    for indices, parts, table in groups(omega, damping, dt, maxima, _LANES):
        peaks = np.empty((spectra.PEAKS, indices.size))
        # The scratch arrays, which may be larger than the record, are not kept for the next group.
        spectra.peaks.compiled(
            ground,
            dt,
            parts,
            table,
            _LANES,
            int(maxima.between),
            peaks,
            *spectra.scratch(ground.size, parts, _LANES),
        )
        result[:, indices] = peaks
    return result


def groups(
    omega: Array, damping: float, dt: float, maxima: Maxima, lanes: int
) -> Iterator[tuple[NDArray[np.intp], int, Array]]:
    """Yield groups of oscillators with the same part of the sampling interval as time step: their
    indices in `omega`, the number of time steps in a sampling interval, and a table of coefficients
    for the kernel.

    The kernel integrates `lanes` oscillators together. The table has a column for each
    oscillator. The last column is repeated until the number of columns is a multiple of `lanes`.
    """
    parts = maxima.parts(omega, dt)
    table = recursion_table(omega, dt / parts, damping, more=2)
    # Coefficients of displacement and velocity in the absolute acceleration.
    table[spectra.BY_DISPLACEMENT] = omega**2
    table[spectra.BY_VELOCITY] = 2.0 * damping * omega
    # `np.unique` would import numpy.ma, which is slower than the spectrum of one record.
    for count in sorted(set(parts.tolist())):
        indices = np.flatnonzero(parts == count)
        missing_columns = -indices.size % lanes
        columns = np.append(indices, np.full(missing_columns, indices[-1]))
        yield indices, count, table.take(columns, axis=1)


# ---- Elastic response spectra

Choice = TypeVar("Choice")

SHORTEST = 0.05
"""Minimum positive period in sampling intervals. A record contains no information on shorter
periods.
"""

OR_ZERO = ", or for 0: the peak ground acceleration"


class RecordSpectrum(Tabular):
    """Base class of spectra of one record for a single damping ratio."""

    record: Record
    damping: DampingRatio
    periods: Array

    def _headline(self) -> str:
        return (
            f"of {self.record.name or 'a record'}, damping {self.damping:g}, "
            f"{pluralize(self.periods.size, 'period')}"
        )


@dataclass(frozen=True, eq=False, kw_only=True, repr=False)
class Spectrum(RecordSpectrum):
    """Elastic response spectrum of one record for a single damping ratio; arrays of shape (k,).

    `method` is `exact`, or the method that integrated the oscillators. `maxima` and `interpolation`
    are names of `MAXIMA` and `INTERPOLATIONS`.

    Attributes
    ----------
    record : Record
        Ground motion.
    damping : float
        Damping ratio.
    method : str
        `exact`, or specification of the method that integrated the oscillators.
    periods : ndarray
        Natural periods, s.
    sd : ndarray
        Maximum displacements relative to the ground, m.
    psv : ndarray
        Pseudo-velocities omega sd, m/s.
    psa : ndarray
        Pseudo-accelerations omega^2 sd, m/s^2.
    sv : ndarray
        Maximum velocities relative to the ground, m/s.
    sa : ndarray
        Maximum absolute accelerations, m/s^2.
    maxima : str
        Treatment of maxima between the samples, an element of `MAXIMA`.
    interpolation : str
        Ground acceleration between the samples, an element of `INTERPOLATIONS`.
    """

    record: Record
    damping: DampingRatio
    method: str
    periods: Periods
    sd: Annotated[Array, Quantity("m", "largest displacement relative to the ground")]
    psv: Annotated[Array, Quantity("m/s", "pseudo-velocity, omega sd")]
    psa: Annotated[Array, Quantity("m/s^2", "pseudo-acceleration, omega^2 sd")]
    sv: Annotated[Array, Quantity("m/s", "largest velocity relative to the ground")]
    sa: Annotated[Array, Quantity("m/s^2", "largest absolute acceleration")]
    maxima: MaximaName = EXACT.name
    interpolation: InterpolationName = LINEAR.name


@dataclass(frozen=True)
class SpectrumSettings:
    """Settings for the computation of a spectrum.

    Attributes
    ----------
    method : str | None
        Method that integrates the oscillators; None for the exact solution.
    """

    method: str | None
    maxima: Maxima
    interpolation: Interpolation


@overload
def spectrum(
    record: AnyRecord,
    periods: Numbers,
    damping: float | str = 0.05,
    *,
    method: str | None = None,
    maxima: str | None = None,
    interpolation: str | None = None,
) -> Spectrum: ...


@overload
def spectrum(
    record: AnyRecord,
    periods: Numbers,
    damping: list[Any] | tuple[float | str, ...] | Array,
    *,
    method: str | None = None,
    maxima: str | None = None,
    interpolation: str | None = None,
) -> ResultList[Spectrum]: ...


@overload
def spectrum(
    record: list[Any] | tuple[AnyRecord, ...] | ResultList[Any],
    periods: Numbers,
    damping: float | str | list[Any] | tuple[float | str, ...] | Array = 0.05,
    *,
    method: str | None = None,
    maxima: str | None = None,
    interpolation: str | None = None,
) -> ResultList[Spectrum]: ...


@map_over_first
def spectrum(
    record: AnyRecord,
    periods: Numbers,
    damping: float | str | list[Any] | tuple[float | str, ...] | Array = 0.05,
    *,
    method: str | None = None,
    maxima: str | None = None,
    interpolation: str | None = None,
) -> Any:
    """Compute the elastic response spectrum of a record.

    Parameters
    ----------
    record : Record, str, Path or ObsPy trace
        Ground motion, or a list of ground motions, for which the result is a `ResultList`. The
        oscillators are at rest at its first sample. The ground is at rest after its last sample,
        and maxima include the free vibration.
    periods : ndarray, shape (k,)
        Periods, s. At period 0 (rigid oscillator), accelerations are the peak ground acceleration
        and all other quantities are 0.
    damping : float or sequence of float, default 0.05
        Damping ratio, in [0, 1); several for a `ResultList` with a spectrum for each.
    method : str, optional
        Method that integrates the oscillators with the sampling interval as time step. By default,
        the exact solution is used (Nigam and Jennings 1969).
    maxima : str, optional
        `exact`, the default, includes maxima between samples and after the last sample. `peer`
        evaluates steps of dt / ceil(10 dt / T), as in spectra published by PEER. `samples`
        evaluates the samples of the record, as USGS does. Both end with the record. These names
        cannot be used with a method; its maxima are `interpolated` between time steps by the
        quintic through displacements, velocities and accelerations at the endpoints.
    interpolation : str, optional
        Ground motion between its samples: `linear`, the default, or `band-limited`, the unique
        motion through the samples without frequencies above half the sampling rate.

    Returns
    -------
    Spectrum
        Exact maxima of the motion between samples have a relative error below 1e-8 (measured) for
        linear interpolation. The error of the band-limited motion is given in
        `tdint.ground_motion.processing_steps`.

    Raises
    ------
    UsageError
        Periods or damping are out of range, a name is unknown, or options cannot be combined.
    RecordError
        The record is invalid or cannot be read.
    AnalysisError
        A period is too short for the record, or the method is unstable at a period.
    """
    record = record_of(record)
    if isinstance(damping, list | tuple | np.ndarray):
        options: dict[str, Any] = {"method": method, "maxima": maxima}
        options["interpolation"] = interpolation
        return ResultList(spectrum(record, periods, ratio, **options) for ratio in damping)
    damping = damping_of(damping)
    periods = checked_periods(periods)
    settings = choose_settings(method, maxima, interpolation)
    positive = periods > 0.0
    omega = np.divide(2.0 * math.pi, periods, out=np.zeros_like(periods), where=positive)
    values = np.zeros((3, periods.size))
    label = settings.method or "exact"
    if np.any(positive):
        check_shortest(periods, record.dt, SHORTEST, OR_ZERO)
        oscillating = omega[positive]
        if settings.method is not None:
            label, values[:, positive] = _integrated(record, oscillating, damping, settings.method)
        else:
            ground, dt = settings.interpolation.resample(
                record, 2.0 * math.pi / float(np.max(oscillating))
            )
            values[:, positive] = largest(ground, dt, oscillating, damping, settings.maxima)
    sd, sv, sa = values
    psv, psa = omega * sd, omega**2 * sd
    # A rigid oscillator moves with the ground.
    if not np.all(positive):
        psa[~positive] = sa[~positive] = settings.interpolation.peak(record)
    return Spectrum(
        record=record,
        damping=damping,
        method=label,
        periods=periods,
        sd=sd,
        psv=psv,
        psa=psa,
        sv=sv,
        sa=sa,
        maxima=settings.maxima.name,
        interpolation=settings.interpolation.name,
    )


LONGEST_PERIOD = 1e6
"""Maximum period, s. Squares of longer periods could exceed the range of floating-point numbers."""


def checked_periods(periods: Numbers, *, zero: bool = True) -> Array:
    """Return periods (s) as an array, shape (k,); raise UsageError if one is negative, not finite,
    above `LONGEST_PERIOD`, or zero without `zero`.
    """
    periods = numbers_of(periods, "periods")
    is_allowed = np.isfinite(periods) & (periods >= 0.0 if zero else periods > 0.0)
    if periods.size == 0 or not np.all(is_allowed):
        allowed = "numbers of seconds, 0 or positive" if zero else "positive numbers of seconds"
        raise UsageError(f"periods must be {allowed}, got {' '.join(str(periods).split()):.60}")
    if np.max(periods) > LONGEST_PERIOD:
        raise UsageError(
            f"periods must be at most {LONGEST_PERIOD:.0e} s, got {np.max(periods):.3g} s"
        )
    return periods


def choose_settings(
    method: str | None, maxima: str | None, interpolation: str | None
) -> SpectrumSettings:
    """Check the options of a spectrum, and return its settings with defaults for missing options.

    Parameters
    ----------
    method, maxima, interpolation : str | None
        As in `spectrum`.

    Raises
    ------
    UsageError
        A name is unknown, or settings cannot be combined.
    """
    integrated = method is not None and _parse(method).method.name != "exact"
    chosen_maxima = (
        INTERPOLATED
        if integrated and maxima is None
        else _lookup(MAXIMA, maxima or EXACT.name, "maxima")
    )
    chosen_interpolation = _lookup(INTERPOLATIONS, interpolation or LINEAR.name, "interpolation")
    if integrated and (chosen_maxima is not INTERPOLATED or chosen_interpolation is not LINEAR):
        raise UsageError(
            f"maxima and interpolation cannot be selected for the method {method}: it is run with "
            "the sampling interval as time step and linear interpolation of the record, and its "
            "maxima between the samples are included; remove maxima and interpolation, or use the "
            "method exact"
        )
    if chosen_interpolation is not LINEAR and chosen_maxima is not EXACT:
        raise UsageError(
            f"maxima {chosen_maxima.name} require the interpolation {LINEAR.name}, got "
            f"{chosen_interpolation.name}; remove one of them"
        )
    return SpectrumSettings(method if integrated else None, chosen_maxima, chosen_interpolation)


def _parse(method: str) -> "Integrator":
    """Parse a method specification, such as `hht:alpha=-0.1`."""
    # Imported here, because most spectra need no method.
    from tdint.methods.catalogue import parse

    return parse(method)


def _lookup(table: dict[str, Choice], name: str, quantity: str) -> Choice:
    """Return the item `name` of a table; raise UsageError if the table does not contain it.

    `quantity` is the name of the option in the message.
    """
    if name not in table:
        raise UsageError(f"{quantity} must be one of {', '.join(table)}, got {name!r}")
    return table[name]


def _integrated(record: Record, omega: Array, damping: float, method: str) -> tuple[str, Array]:
    """Integrate oscillators together by a method with the sampling interval as time step. Return
    the name of the method with its parameters, and the maxima as `largest`. AnalysisError is raised
    if the method is unstable or diverges with this time step.
    """
    # Imported here, because the import loads all methods, which most spectra do not need.
    from tdint.kernels import layout as rows
    from tdint.model.building import oscillators
    from tdint.response.runs.measured_stability import find_instability
    from tdint.response.runs.prepared import PreparedBuilding
    from tdint.response.time_steps import Steps

    integrator = _parse(method)
    ratios = np.full_like(omega, damping)
    # Check the stability first, because an unstable oscillator would end the integration of all
    # oscillators.
    instability = find_instability(integrator, omega, ratios, record.dt)
    if instability is not None:
        raise AnalysisError(
            f"{integrator.label} is unstable with the sampling interval {record.dt:.6g} s for the "
            f"period {2.0 * math.pi / omega[instability.index]:.6g} s; use longer periods or "
            "another method"
        )
    # The ground is at rest at the end of the last step, one sampling interval after the record.
    steps = Steps(record.dt, record.acceleration.size)
    result = PreparedBuilding(oscillators(omega, ratios)).integrate(
        integrator, steps, record.acceleration.copy()
    )
    if result.code < 0:
        raise AnalysisError(
            f"{integrator.label} diverged with the sampling interval {record.dt:.6g} s; use "
            "another "
            "method"
        )
    peak_rows = [rows.PEAK_DISPLACEMENT, rows.PEAK_VELOCITY, rows.PEAK_ACCELERATION]
    u, v = result.space.state[[rows.DISPLACEMENT, rows.VELOCITY], :-1]
    by_u, by_v = omega**2, 2.0 * damping * omega
    p = by_u * u + by_v * v  # the relative acceleration is -p
    vibrations = [
        Vibration(k, c, record.dt) for k, c in zip(by_u.tolist(), by_v.tolist(), strict=True)
    ]
    peaks = [
        list(map(largest_afterwards, values, rates, vibrations, result.space.peaks[row]))
        for values, rates, row in zip(
            (u, v, p), (v, -p, by_u * v - by_v * p), peak_rows, strict=True
        )
    ]
    return integrator.label, np.array(peaks)


SA_DAMPING = 0.05
"""Damping ratio of Sa(T1) as an intensity measure."""


class FirstMode(NamedTuple):
    """First mode of the initial stiffness of a building.

    Attributes
    ----------
    period, damping : float
        T1, s, and its viscous damping ratio (diagonal of the modal damping matrix, without
        power-law dashpots).
    sa : float | None
        Pseudo-acceleration of the ground motion at T1, m/s^2; None without ground motion, or if the
        period is too short for this ground motion.
    sa_damping : float
        Damping ratio of `sa`.
    """

    period: float
    damping: float
    sa: float | None
    sa_damping: float = SA_DAMPING


def first_mode(record: Record | None, *directions: "Building") -> FirstMode:
    """Return the first mode of a building, and the pseudo-acceleration of a ground motion at its
    period (`intensity_of`). Of two directions it is that of the longer period.
    """
    building = max(directions, key=lambda item: item.first_period)
    period, damping, sa = building.first_period, building.first_mode()[1], None
    # Sa is unknown (None) if the building has no period, or a period that is too short for the
    # sampling interval of the record.
    if record is not None and math.isfinite(period):
        # Imported here, because spectra of files need no pairs along axes.
        from tdint.ground_motion.axes import intensity_of

        with suppress(AnalysisError):
            at = np.array([period])
            sa = float(intensity_of(record, lambda part: spectrum(part, at, SA_DAMPING).psa)[0])
    return FirstMode(period, damping, sa)
