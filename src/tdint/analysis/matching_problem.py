"""Quadratic program of spectral matching: the smallest change for which extremes equal a target.

The change of a motion, d = P H' lambda, follows from the multipliers lambda of a small quadratic
program. The rows of H are the derivatives of the extremes of the responses with respect to the
samples. `tdint.analysis.matching` explains P and states the sources.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from tdint.analysis.spectra.elastic import recursion_table
from tdint.arrays import Array
from tdint.errors import RecordError
from tdint.ground_motion.reading.suites import GroundMotion
from tdint.kernels.building.compilable import EVERYTHING
from tdint.kernels.oscillators.elastic import BY_DISPLACEMENT, BY_VELOCITY
from tdint.kernels.oscillators.extremes import OSCILLATOR, TIME, VALUE, extremes, radii

Bools: TypeAlias = NDArray[np.bool_]

SMALL_MISFIT = 0.008
"""Misfit below which a period is not added and no further stage is started."""

_NEAR, _MOST = 0.8, 3.0
"""Fraction of the target above which extremes are controlled, and maximum mean number of controlled
extremes per period. Extremes above the target are controlled beyond this number."""

_MOST_ABOVE = 6.0
"""Maximum mean number of controlled extremes per period, those above the target included; the
largest are controlled. Long stationary motions have more than 30 per period above the target at
first, and the matrix of their products would need gigabytes."""

_CLIP, _STEPWISE = 0.3, 0.1
"""Maximum relative change of a response in a round, and misfit below which rounds add to the
change."""

_DAMPED, _POLISHED, _LEAST = 1e-2, 1e-4, 1e-6
"""Levenberg-Marquardt damping relative to the diagonal of the Gram matrix: initial, for refinement,
and minimum."""

_WINDOW = 2.0
"""Half width of the window of the envelope, s."""

_UNEVEN = 0.03, 10.0
"""Limits of the relative damping of a row in added changes. Rows with a larger misfit have less
damping."""

_POWERS = 2.0, 4.0
"""Exponents of |ln(response / target)| in the sum to be reduced: far from the target, and for added
changes."""

_DECAYED = 1e-6
"""Amplitude of a free vibration, relative to its start, after which it is not stored. The rows are
in single precision, 6e-8."""

_TOGETHER = 16
"""Number of oscillators whose free vibrations are filtered at a time: 60 MB at 60 000 samples."""

_BLOCK = 4096
"""Number of samples per block in the products of rows: 16 MB for 1000 rows."""

_GROWING = 0.5
"""Maximum fraction of periods without a peak of the response. Motions with a larger fraction are
rejected; earthquakes have peaks at all periods up to about their duration."""

_TRIES = 6
"""Maximum number of times that the damping of a step is increased, by a factor of four each."""

_ORDER, _CORNER = 8, 1.0
"""Order of the band-pass filter; frequency (Hz) below which changes have a larger weight, because
they cause large ground displacements."""


@dataclass(frozen=True)
class SparseRows:
    """Sparse rows of a matrix over the samples of all components.

    Attributes
    ----------
    size : int
        Number of samples of a component.
    starts : ndarray of int, shape (rows,)
        First sample of each line.
    lines : list of ndarray
        Values of each row over the samples, before the factors of the components.
    directions : ndarray, shape (rows, components)
        Factor of each row for each component.
    """

    size: int
    starts: NDArray[np.int64]
    lines: list[NDArray[np.float32]]
    directions: Array

    def products(self) -> Array:
        """Return the scalar products of all rows, shape (rows, rows), summed block by block."""
        from scipy.linalg.blas import ssyrk

        stops = self.starts + np.array([line.size for line in self.lines])
        result = np.zeros((len(self.lines), len(self.lines)))
        for first in range(0, self.size, _BLOCK):
            last = min(first + _BLOCK, self.size)
            indices = np.flatnonzero((self.starts < last) & (stops > first))
            block = np.zeros((indices.size, last - first), np.float32)
            for row, index in zip(block, indices, strict=True):
                start = self.starts[index]
                begin, end = max(start, first), min(stops[index], last)
                row[begin - first : end - first] = self.lines[index][begin - start : end - start]
            half = ssyrk(1.0, block.T, trans=True)
            result[np.ix_(indices, indices)] += np.triu(half).astype(float) + np.triu(half, 1).T
        return np.asarray(result * (self.directions @ self.directions.T))

    def times(self, samples: NDArray[np.float32]) -> Array:
        """Return the scalar product of each row with a change, shape (rows,)."""
        changes = samples.reshape(-1, self.size)
        result = np.empty(len(self.lines))
        for index, (start, line) in enumerate(zip(self.starts, self.lines, strict=True)):
            part = changes[:, start : start + line.size] @ line
            result[index] = self.directions[index] @ part
        return result

    def sum(self, multipliers: NDArray[np.float32]) -> NDArray[np.float32]:
        """Return the sum of the rows times multipliers, shape (components * size,)."""
        result = np.zeros((self.directions.shape[1], self.size), np.float32)
        factors = (multipliers[:, None] * self.directions).astype(np.float32)
        for start, line, factor in zip(self.starts, self.lines, factors, strict=True):
            for component, value in zip(result, factor, strict=True):
                component[start : start + line.size] += value * line
        return result.ravel()


@dataclass
class MatchingProblem:
    """Components of a motion, oscillators to be matched, and filters of a change.

    An oscillator is a period with a damping ratio; `omega`, `damping` and `wanted` have one entry
    for each.
    """

    start: Array
    dt: float
    wanted: Array
    omega: Array
    damping: Array
    parts: Array
    table: Array
    envelope: Array
    band: Array
    size: int
    ends: Array
    free: list[NDArray[np.float32]]
    impulse: NDArray[np.float32]
    reach: int

    @classmethod
    def of(
        cls, start: Array, dt: float, periods: Array, *, wanted: Array, damping: Array
    ) -> MatchingProblem:
        """Prepare the problem.

        Parameters
        ----------
        start : ndarray, shape (components, n)
            Samples of the scaled seed, m/s^2.
        dt : float
            Sampling interval, s.
        periods : ndarray, shape (k,)
            Period of each oscillator, s.
        wanted : ndarray, shape (k,)
            Target, m/s^2.
        damping : ndarray, shape (k,)
            Damping ratio of each oscillator.
        """
        from scipy.fft import irfft, next_fast_len, rfft

        n, omega = start.shape[1], 2.0 * np.pi / periods
        parts = len(start) * 2.0 ** np.ceil(np.log2(np.maximum(1.0, omega * dt / 0.5)))
        table = recursion_table(omega, dt / parts, damping, 2)
        table[BY_DISPLACEMENT], table[BY_VELOCITY] = omega**2, 2.0 * damping * omega
        window = np.hanning(2 * max(int(_WINDOW / dt), 1) + 1)
        mean_square = np.convolve(np.sum(start**2, axis=0), window / window.sum(), "same")
        envelope = np.sqrt(np.maximum(mean_square, 0.0))[:n]
        # The impulse response of the band-pass filter extends over `reach` samples to either side.
        low, high = 0.6 / np.max(periods), min(1.5 / np.min(periods), 0.45 / dt)
        reach = int(3.0 / low / dt)
        size = next_fast_len(n + 2 * reach, real=True)
        f = np.maximum(np.fft.rfftfreq(size, dt), 1e-12)
        band = np.minimum(f / _CORNER, 1.0) / np.sqrt(
            (1.0 + (low / f) ** _ORDER) * (1.0 + (f / high) ** _ORDER)
        )
        band[0] = 0.0
        # Derivatives of the final velocity and displacement with respect to the samples
        remaining = np.arange(n - 1, -1, -1.0)
        ends = np.stack([np.full(n, dt), dt * dt * remaining])
        # Compute free vibrations (cosine and sine) over the samples since their start, from the
        # latest back to `reach` samples before it. Only the part that has not decayed is stored,
        # and few oscillators are computed at a time: 60 000 samples of all would need a gigabyte.
        rate = omega * (-damping + 1j * np.sqrt(1.0 - damping**2))
        lasting = np.minimum(np.log(1.0 / _DECAYED) / (damping * omega * dt), n - 1).astype(int)
        band32, after = (
            band.astype(np.float32),
            np.concatenate([np.arange(n - 1, -1, -1), -np.arange(1, reach + 1)]),
        )
        free: list[NDArray[np.float32]] = []
        for first in range(0, omega.size, _TOGETHER):
            vibrations = np.exp(rate[first : first + _TOGETHER, None] * dt * np.arange(n))
            vibrations[:, 0] = 0.0  # the two samples at the start are treated separately
            lines = np.stack([vibrations.real, vibrations.imag], axis=1).astype(np.float32)
            filtered = irfft(rfft(lines, size) * band32, size)[..., after]
            free += [
                line[:, max(n - 1 - reach - last, 0) :].copy()
                for line, last in zip(filtered, lasting[first : first + _TOGETHER], strict=True)
            ]
        impulse = irfft(band32, size)[after]
        envelope /= envelope.max()
        return cls(
            start,
            dt,
            wanted,
            omega,
            damping,
            parts,
            table,
            envelope,
            band,
            size,
            ends,
            free,
            impulse,
            reach,
        )

    def filtered(self, rows: Array) -> Array:
        """Return rows of samples after the band-pass filter."""
        from scipy.fft import irfft, rfft

        return np.asarray(
            irfft(rfft(rows, self.size) * self.band, self.size)[..., : rows.shape[-1]]
        )

    def extremes(self, samples: Array, level: Array) -> tuple[Array, Array]:
        """Return extremes above a level, and the maximum of each oscillator.

        The extremes have the rows OSCILLATOR, TIME and VALUE of each component. The maxima have
        two rows: their value, and their index in the extremes.
        """
        found, largest = (
            np.empty((VALUE + len(samples), 400 * level.size)),
            np.empty((2, level.size)),
        )
        kernel = (extremes if len(samples) == 1 else radii).variant(EVERYTHING)
        motions = np.array(samples[0] if len(samples) == 1 else samples)
        count = kernel(motions, self.dt, self.parts, self.table, level, found, largest)
        # Oscillators at rest need a positive value for the logarithm.
        largest[0] = np.maximum(largest[0], np.finfo(float).tiny)
        return found[:, :count], largest

    def rows(self, oscillator: NDArray[np.int64], when: Array, directions: Array) -> SparseRows:
        """Return derivatives of extremes with respect to the samples of all components.

        The derivatives include the band-pass filter and the envelope. The last rows are the
        derivatives of the final velocity and displacement. A sample changes the ground acceleration
        by a hat function, the second difference of a ramp. After the hat, the oscillator is in
        free vibration. The effect of earlier samples on an extreme is thus one vibration, with a
        cosine and a sine part.

        Parameters
        ----------
        oscillator : ndarray of int
            Oscillator of each extreme.
        when : ndarray
            Time of each extreme, s.
        directions : ndarray, shape (components, extremes)
            Direction of each extreme.
        """
        n, w, z, dt = self.envelope.size, self.omega[oscillator], self.damping[oscillator], self.dt
        before = np.minimum((when / dt).astype(int), n - 2)
        late = when - dt * before
        # Displacement over -g for a ground acceleration t / dt: a particular solution minus the
        # free vibration from rest.
        rate = w * (-z + 1j * np.sqrt(1.0 - z * z))
        constant = 2.0 * z / (w**3 * dt)
        begun = constant - 1j * (constant * z * w - 1.0 / (w * w * dt)) / rate.imag
        ramps = [
            -t / dt / w**2 + constant - (begun * np.exp(rate * t)).real for t in (late + dt, late)
        ]
        after = (
            -w * w * begun * (np.exp(rate * dt) - 2.0 + np.exp(-rate * dt)) * np.exp(rate * late)
        )
        about = w * w * np.stack([ramps[0] - 2.0 * ramps[1], ramps[1]])
        parts = np.stack([after.real, -after.imag, *about], axis=1).astype(np.float32)
        starts, lines = [], list[NDArray[np.float32]]()
        envelope = self.envelope.astype(np.float32)
        for k, part, moment in zip(oscillator, parts, before, strict=True):
            # Use samples from the decay of the vibration before the extreme to the reach of the
            # filter after it, where `free` ends.
            free = self.free[k]
            start = max(moment + 1 + self.reach - free.shape[1], 0)
            stop = min(n, moment + 1 + self.reach)
            index = free.shape[1] - self.reach - 1 - moment + start
            size = stop - start
            line = part[:2] @ free[:, index : index + size]
            first = n - 1 - moment + start
            line += part[2] * self.impulse[first : first + size]
            line += part[3] * self.impulse[first - 1 : first - 1 + size]
            line *= envelope[start:stop]
            starts.append(start)
            lines.append(line)
        scaled = directions / self.wanted[oscillator]
        count = len(directions)
        for component in range(count):
            for end in self.filtered(self.ends) * self.envelope:
                starts.append(0)
                lines.append(end.astype(np.float32))
            scaled = np.hstack([scaled, np.repeat(np.eye(count)[:, component, None], 2, axis=1)])
        return SparseRows(n, np.array(starts), lines, scaled.T)

    def equations(
        self, found: Array, largest: Array
    ) -> tuple[NDArray[np.int64], Array, Array, Array, Bools]:
        """Return the equations that the next correction of the motion must satisfy.

        There is an equation for each extremum of the responses that must equal the target, and for
        each extremum that must not exceed the target.

        Parameters
        ----------
        found : ndarray
            Extrema of the responses, with the rows OSCILLATOR, TIME and, from VALUE on, the value
            of each component.
        largest : ndarray
            For each oscillator, in row 1 the column of its maximum in `found`; negative for an
            oscillator at rest.

        Returns
        -------
        tuple
            Oscillator, time, direction over the components, relative difference from the target,
            and True for equality with the target (False for an upper limit).
        """
        oscillator, values = found[OSCILLATOR].astype(int), found[VALUE:]
        size = np.linalg.norm(values, axis=0)
        # The maximum at each period must equal the target; other extremes above `_NEAR` times the
        # target must not exceed it.
        equal = np.zeros(oscillator.size, bool)
        moved = largest[1] >= 0.0  # an oscillator at rest has no maximum
        equal[largest[1, moved].astype(int)] = True
        relative = np.where(equal, np.inf, size / self.wanted[oscillator])
        ordered = np.sort(relative)
        cut, cut_above = (
            ordered[-min(int(count * self.omega.size), relative.size)]
            for count in (_MOST, _MOST_ABOVE)
        )
        cut = max(min(max(cut, _NEAR), 1.0), cut_above)
        controlled = np.flatnonzero(equal | (relative >= cut))
        oscillator, equal = oscillator[controlled], equal[controlled]
        shortfall = 1.0 - size[controlled] / self.wanted[oscillator]
        shortfall = np.where(
            equal | (shortfall < 0.0), np.clip(shortfall, -_CLIP, _CLIP), shortfall
        )
        return (
            oscillator,
            found[TIME, controlled],
            values[:, controlled] / size[controlled],
            shortfall,
            equal,
        )

    def rounds(
        self, samples: Array, multiplied: NDArray[np.float32], most: int, *, first: bool
    ) -> tuple[Array, NDArray[np.float32]]:
        """Return the samples after some rounds, and the multiplied rows that form their change.

        Parameters
        ----------
        samples : ndarray, shape (components, n)
            Samples, m/s^2.
        multiplied : ndarray
            Sum of the rows times multipliers so far.
        most : int
            Maximum number of rounds.
        first : bool
            True in the first stage.
        """
        damped, stepwise = _DAMPED if first else _POLISHED, not first
        ends = np.kron(np.eye(len(samples)), self.ends)
        found, largest = self.extremes(samples, _NEAR * self.wanted)
        merit, misfit = self.merits(largest, stepwise)
        best, least = (samples, multiplied), misfit
        for number in range(most):
            if misfit < 0.5 * SMALL_MISFIT:
                break
            if np.any(largest[1] < 0.0):
                found, largest = self.extremes(
                    samples, np.minimum(_NEAR * self.wanted, 0.9999 * largest[0])
                )
            # Set up the quadratic program: derivatives, differences and products of the rows.
            oscillator, when, directions, shortfall, equal = self.equations(found, largest)
            table = self.rows(oscillator, when, directions)
            shortfall = np.concatenate([shortfall, -ends @ (samples - self.start).ravel()])
            equal = np.concatenate([equal, np.ones(len(ends), bool)])
            gram = table.products()
            scales = 1.0 / np.sqrt(np.maximum(np.diagonal(gram), 1e-300))
            gram *= scales[:, None] * scales
            if not stepwise and (misfit < _STEPWISE or 2 * number > most):
                stepwise, damped = True, min(damped, _POLISHED)
                merit, _ = self.merits(largest, stepwise)
            toward = shortfall if stepwise else shortfall + table.times(multiplied)
            uneven = np.ones(shortfall.size)
            if stepwise:
                far = np.abs(shortfall) + 1e-4  # differences below 0.01 % are not relevant
                uneven = np.clip(np.median(far) / far, *_UNEVEN)
                _exchange_equalities(
                    gram, toward * scales, equal, damped * uneven, oscillator, scales
                )
            # Increase the damping of the step until it reduces the misfit.
            for tried in range(_TRIES):  # noqa: B007
                multipliers = (
                    scales * program(gram, toward * scales, equal, damped * uneven)
                ).astype(np.float32)
                update = table.sum(multipliers) - (0.0 if stepwise else 1.0) * multiplied
                changed = samples + self.filtered(self.envelope * update.reshape(samples.shape))
                found, largest = self.extremes(changed, _NEAR * self.wanted)
                new_merit, misfit = self.merits(largest, stepwise)
                if new_merit < merit:
                    break
                damped *= 4.0
            samples, multiplied, merit = changed, multiplied + update, new_merit
            damped = max(damped / 5.0, _LEAST) if tried == 0 else damped
            if misfit < least:
                best, least = (samples, multiplied), misfit
        return best

    def merits(self, largest: Array, stepwise: bool) -> tuple[float, float]:
        """Return the sum of powers of ln(maximum / target), and the maximum misfit."""
        part = largest[0] / self.wanted
        return float(np.sum(np.abs(np.log(part)) ** _POWERS[stepwise])), float(
            np.max(np.abs(part - 1.0))
        )


def _exchange_equalities(
    gram: Array,
    shortfall: Array,
    equal: Bools,
    damped: Array,
    oscillator: NDArray[np.int64],
    scales: Array,
) -> None:
    """Exchange the equality of a period if another extreme will be closer to the target.

    Parameters
    ----------
    gram : ndarray
        Scaled scalar products of the rows.
    shortfall : ndarray
        Scaled differences from the targets.
    equal : ndarray of bool
        True for equalities; changed in index.
    damped : ndarray
        Damping of each row.
    oscillator : ndarray of int
        Oscillator of each extreme.
    scales : ndarray
        Scale factor of each row.
    """
    for _ in range(2):
        left = (shortfall - gram @ program(gram, shortfall, equal, damped)) / scales
        changed = False
        for index in np.flatnonzero(
            equal[: oscillator.size] & (left[: oscillator.size] > SMALL_MISFIT)
        ):
            others = np.flatnonzero((oscillator == oscillator[index]) & ~equal[: oscillator.size])
            if others.size and left[nearest := others[np.argmin(left[others])]] < 0.7 * left[index]:
                equal[index], equal[nearest], changed = False, True, True
        if not changed:
            return


def program(gram: Array, shortfall: Array, equal: Bools, damped: Array) -> Array:
    """Return the multipliers l that minimize l' (G + diag(damped)) l / 2 - shortfall' l.

    Multipliers of inequalities must not be positive. A primal-dual active set method is used:
    inequalities with a positive multiplier become inactive, violated inequalities become active.

    Parameters
    ----------
    gram : ndarray, shape (n, n)
        Scalar products of the rows.
    shortfall : ndarray, shape (n,)
        Differences from the targets.
    equal : ndarray of bool, shape (n,)
        True for equalities, False for inequalities.
    damped : ndarray, shape (n,)
        Damping of each row.
    """
    from scipy.linalg import cho_factor, cho_solve

    active, result = equal | (shortfall < 0.0), np.zeros(shortfall.size)
    slack = 1e-3 * float(np.median(np.abs(shortfall[equal])))
    for _ in range(20):
        indices = np.flatnonzero(active)
        part = gram[np.ix_(indices, indices)]
        part[np.diag_indices(indices.size)] += damped[indices]
        try:
            factors = cho_factor(part, check_finite=False)
        except np.linalg.LinAlgError:
            damped = np.maximum(10.0 * damped, 1e-5)
            continue
        result[:] = 0.0
        result[indices] = cho_solve(factors, shortfall[indices], check_finite=False)
        leaving = active & ~equal & (result > 0.0)
        joining = ~active & (gram @ result > shortfall + slack)
        if not leaving.any() and not joining.any():
            return result
        active = (active & ~leaving) | joining
    result[~equal] = np.minimum(result[~equal], 0.0)
    return result


def check_peaks(problem: MatchingProblem, seed: GroundMotion, samples: Array) -> None:
    """Raise an error if most oscillators have no maximum before the end of the motion.

    Raises
    ------
    RecordError
        The response increases until the end of the record at more than half of the periods, as
        under a ramp. A change cannot bring such a response to the target.
    """
    largest = problem.extremes(samples, _NEAR * problem.wanted)[1]
    level = np.minimum(_NEAR * problem.wanted, 0.9999 * largest[0])
    largest = problem.extremes(samples, level)[1]
    growing = int(np.sum(largest[1] < 0.0))
    if growing > _GROWING * problem.omega.size:
        raise RecordError(
            f"{seed.source} {seed.component}: cannot be matched: at {growing} of "
            f"{problem.omega.size} periods the response has no peak before the end of the record, "
            "as under a ramp or an offset; remove the trend (--baseline linear), or use another "
            "record"
        )
