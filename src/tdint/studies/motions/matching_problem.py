"""Quadratic program of spectral matching: the smallest change for which extremes equal a target.

The change of a motion, d = P H' lambda, follows from the multipliers lambda of a small quadratic
program. The rows of H are the derivatives of the extremes of the responses with respect to the
samples. P = F E^2 F contains the envelope E of the motion and a band-pass filter F. A round
computes the complete change from the seed, or adds to the change of the previous rounds
(`is_stepwise`). `row_sum` is the sum of rows times multipliers that forms the change of the samples
from the scaled seed. `tdint.studies.motions.matching` states the sources.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from tdint.arrays import Array
from tdint.errors import RecordError
from tdint.ground_motion.reading.suites import GroundMotion
from tdint.kernels.building.compilable import EVERYTHING
from tdint.kernels.oscillators.elastic import BY_DISPLACEMENT, BY_VELOCITY
from tdint.kernels.oscillators.extremes import OSCILLATOR, TIME, VALUE, extremes, radii
from tdint.response.spectra.elastic import recursion_table

Bools: TypeAlias = NDArray[np.bool_]

SMALL_MISFIT = 0.008
"""Misfit below which a period is not added and no further stage is started."""

_CONTROLLED_FRACTION, _MAX_EXTREMES = 0.8, 3.0
"""An extreme of a response has an equation in the quadratic program ("is controlled") if it exceeds
the first number times the target. The second number is the maximum mean number of such extremes per
period; extremes above the target are also controlled if there are more of them."""

_MAX_EXTREMES_ABOVE = 6.0
"""Maximum mean number of controlled extremes per period, including the extremes above the target;
the largest are controlled. Long stationary motions have more than 30 per period above the target at
first, and the matrix of their products would need gigabytes."""

_MAX_RELATIVE_CHANGE, _STEPWISE_MISFIT = 0.3, 0.1
"""Maximum relative change of a response in a round. Maximum misfit below which a round adds to the
change of the previous rounds instead of computing the complete change again."""

_INITIAL_DAMPING, _REFINEMENT_DAMPING, _MIN_DAMPING = 1e-2, 1e-4, 1e-6
"""Levenberg-Marquardt damping, relative to the diagonal of the Gram matrix (the scalar products of
the rows): initial value, value for rounds that add to the change, and minimum."""

_ENVELOPE_WINDOW = 2.0
"""Half width of the window of the envelope, s."""

_ROW_DAMPING_LIMITS = 0.03, 10.0
"""Minimum and maximum factor on the damping of a row in rounds that add to the change. Rows with a
larger misfit have a smaller factor."""

_POWERS = 2.0, 4.0
"""Exponents of |ln(response / target)| in the sum that a round must reduce: for rounds that compute
the complete change, and for rounds that add to the change."""

_DECAYED = 1e-6
"""Amplitude relative to the start of a free vibration, below which the vibration is not stored. The
precision of the rows is 6e-8 (single precision)."""

_OSCILLATORS_AT_A_TIME = 16
"""Number of oscillators whose free vibrations are filtered at a time: 60 MB at 60 000 samples."""

_BLOCK = 4096
"""Number of samples per block in the products of rows: 16 MB for 1000 rows."""

MAX_GROWING_FRACTION = 0.5
"""Maximum fraction of periods without a peak of the response. Motions with a larger fraction are
rejected; earthquakes have peaks at all periods up to about their duration."""

_MAX_DAMPING_INCREASES = 6
"""Maximum number of times that the damping of a step is increased, by a factor of four each."""

_ORDER, _CORNER_FREQUENCY = 8, 1.0
"""Order of the band-pass filter, and frequency (Hz) below which the filter reduces changes, because
they would cause large ground displacements."""


@dataclass(frozen=True)
class SparseRows:
    """Matrix with a row for each equation and one column for each sample of each component.

    A row contains the derivatives of an extreme of a response (or of the final velocity or
    displacement of the ground) with respect to the samples. In the part of a row for component c,
    the values are zero except for a range of successive samples:

        columns starts[row] to starts[row] + lines[row].size - 1: directions[row, c] * lines[row]

    Attributes
    ----------
    starts : ndarray of int, shape (rows,)
        Number of the first sample where a row is not zero.
    lines : list of ndarray
        Values of each row from this sample on, for a component factor of 1.
    directions : ndarray, shape (rows, components)
        Factor of each row for each component.
    """

    size: int
    starts: NDArray[np.int64]
    lines: list[NDArray[np.float32]]
    directions: Array

    def products(self) -> Array:
        """Return the scalar products of all pairs of rows, shape (rows, rows).

        The sum over the samples is accumulated in blocks of samples, to limit the memory.
        """
        from scipy.linalg.blas import ssyrk

        row_ends = self.starts + np.array([line.size for line in self.lines])
        result = np.zeros((len(self.lines), len(self.lines)))
        for block_start in range(0, self.size, _BLOCK):
            block_end = min(block_start + _BLOCK, self.size)
            indices = np.flatnonzero((self.starts < block_end) & (row_ends > block_start))
            block = np.zeros((indices.size, block_end - block_start), np.float32)
            for block_row, index in zip(block, indices, strict=True):
                row_start = self.starts[index]
                overlap_start = max(row_start, block_start)
                overlap_end = min(row_ends[index], block_end)
                block_row[overlap_start - block_start : overlap_end - block_start] = self.lines[
                    index
                ][overlap_start - row_start : overlap_end - row_start]
            # `ssyrk` computes only the upper triangle, in Fortran order. Copies of the whole matrix
            # would need 50 MB each for 2500 rows.
            upper_triangle = ssyrk(1.0, block.T, trans=True)
            for column, index in enumerate(indices):
                result[index, indices[: column + 1]] += upper_triangle[: column + 1, column]
        # Symmetric matrix, with the factors of the rows for the components
        for row in range(1, len(result)):
            result[:row, row] = result[row, :row]
        result *= self.directions @ self.directions.T
        return result

    def times(self, samples: NDArray[np.float32]) -> Array:
        """Return the product of this matrix and a vector, shape (rows,); `samples` contains all
        samples of the first component, then all samples of the second component.
        """
        component_samples = samples.reshape(-1, self.size)
        result = np.empty(len(self.lines))
        for index, (row_start, row_values) in enumerate(zip(self.starts, self.lines, strict=True)):
            component_products = (
                component_samples[:, row_start : row_start + row_values.size] @ row_values
            )
            result[index] = self.directions[index] @ component_products
        return result

    def sum(self, multipliers: NDArray[np.float32]) -> NDArray[np.float32]:
        """Return the sum of the rows times their multipliers, shape (components * size,).

        This is the product of the transpose of the matrix and the multipliers, shape (rows,).
        """
        result = np.zeros((self.directions.shape[1], self.size), np.float32)
        factors = (multipliers[:, None] * self.directions).astype(np.float32)
        for row_start, row_values, factor in zip(self.starts, self.lines, factors, strict=True):
            for component_sum, component_factor in zip(result, factor, strict=True):
                component_sum[row_start : row_start + row_values.size] += (
                    component_factor * row_values
                )
        return result.ravel()


@dataclass(frozen=True)
class _MotionState:
    """Changed motion of a round, and its difference from the target (`MatchingProblem.extremes` and
    `merits`).
    """

    samples: Array
    row_sum: NDArray[np.float32]
    extremes: Array
    maxima: Array
    merit: float
    misfit: float


@dataclass(frozen=True)
class _QuadraticProgram:
    """Quadratic program of a round: its equations and their scalar products.

    Each row belongs to an extreme of a response, or to the final velocity or displacement of the
    ground.

    Attributes
    ----------
    gram : ndarray, shape (rows, rows)
        Scalar products of the scaled rows.
    shortfall : ndarray, shape (rows,)
        Required change of each quantity, or its upper limit if `is_equality` is False. The change
        of an extreme is relative to its target.
    """

    rows: SparseRows
    gram: Array
    scales: Array
    shortfall: Array
    is_equality: Bools
    oscillator: NDArray[np.int64]

    def refine(self, damping: float) -> Array:
        """Select the extremes that must equal the target (`is_equality` is changed), and return the
        factor on the damping of each row.

        Rows with a larger difference have less damping. The equality of an oscillator is moved to
        another of its extremes if the damped solution leaves the selected extreme below the target
        and brings the other extreme closer to it.
        """
        # Differences below 0.01 % are not relevant.
        absolute_shortfall = np.abs(self.shortfall) + 1e-4
        row_damping = np.clip(
            np.median(absolute_shortfall) / absolute_shortfall, *_ROW_DAMPING_LIMITS
        )
        shortfall, is_equality = self.shortfall * self.scales, self.is_equality
        oscillator = self.oscillator
        # An exchange changes the solution.
        for _ in range(2):
            solution = solve_program(self.gram, shortfall, is_equality, damping * row_damping)
            remaining_shortfall = (shortfall - self.gram @ solution) / self.scales
            has_changed = False
            for index in np.flatnonzero(
                is_equality[: oscillator.size]
                & (remaining_shortfall[: oscillator.size] > SMALL_MISFIT)
            ):
                other_extremes = np.flatnonzero(
                    (oscillator == oscillator[index]) & ~is_equality[: oscillator.size]
                )
                # The other extreme must be closer to the target by at least 30 %.
                if (
                    other_extremes.size
                    and remaining_shortfall[
                        nearest := other_extremes[np.argmin(remaining_shortfall[other_extremes])]
                    ]
                    < 0.7 * remaining_shortfall[index]
                ):
                    is_equality[index], is_equality[nearest], has_changed = False, True, True
            if not has_changed:
                break
        return np.asarray(row_damping)

    def multipliers(self, required_change: Array, damping: Array) -> NDArray[np.float32]:
        """Solve the quadratic program, and return the multipliers of the unscaled rows.

        The change of the motion is the sum of the rows times these multipliers. The multiplier of
        an upper limit is at most 0, so that it can only reduce an extreme. `required_change` is
        relative to the target; for an upper limit, the largest change that is allowed. `damping` is
        added to the diagonal elements of `gram`, which are 1.
        """
        scaled = solve_program(self.gram, required_change * self.scales, self.is_equality, damping)
        return (self.scales * scaled).astype(np.float32)


class MatchingProblem:
    """Components of a motion, oscillators to be matched, and filters of a change.

    An oscillator is a period with a damping ratio.

    Attributes
    ----------
    scaled_seed : ndarray, shape (components, n)
        Samples of the scaled seed, m/s^2.
    wanted, omega, damping : ndarray, shape (oscillators,)
        Target of each oscillator, m/s^2; its circular frequency, rad/s; its damping ratio.
    substeps, table : ndarray
        Number of time steps per sampling interval, and coefficients of the recursion, for each
        oscillator.
    envelope : ndarray, shape (n,)
        Smoothed amplitude of the seed, with a maximum of 1.
    band : ndarray
        Factor of the band-pass filter at each frequency of the Fourier transform.
    size : int
        Number of samples of the Fourier transform.
    end_derivatives : ndarray, shape (2, n)
        Derivatives of the final velocity and displacement of the ground with respect to the samples
        of a component, s and s^2.
    free_vibrations : list of ndarray
        For each oscillator, the filtered free vibration (cosine and sine) over the samples, in
        reversed order of time.
    impulse_response : ndarray
        Impulse response of the band-pass filter, in reversed order of time.
    filter_reach : int
        Number of samples to either side over which this impulse response extends.
    """

    def __init__(
        self, scaled_seed: Array, dt: float, periods: Array, *, wanted: Array, damping: Array
    ) -> None:
        """Prepare the recursion, the filters and the free vibrations of a matching problem."""
        from scipy.fft import irfft, next_fast_len

        self.scaled_seed = scaled_seed
        self.dt = dt
        self.wanted = wanted
        self.damping = damping
        sample_count = scaled_seed.shape[1]
        # The extremes of a single component require omega h <= 0.5, at least 4 pi substeps in a
        # period; the extremes of two components require half this substep.
        self.omega: Array = 2.0 * np.pi / periods
        self.substeps: Array = len(scaled_seed) * 2.0 ** np.ceil(
            np.log2(np.maximum(1.0, self.omega * dt / 0.5))
        )
        self.table = recursion_table(self.omega, dt / self.substeps, damping, 2)
        self.table[BY_DISPLACEMENT] = self.omega**2
        self.table[BY_VELOCITY] = 2.0 * damping * self.omega
        # Smoothed amplitude of the motion, with a maximum of 1
        window = np.hanning(2 * max(int(_ENVELOPE_WINDOW / dt), 1) + 1)
        mean_square = np.convolve(np.sum(scaled_seed**2, axis=0), window / window.sum(), "same")
        self.envelope: Array = np.sqrt(np.maximum(mean_square, 0.0))[:sample_count]
        self.envelope /= self.envelope.max()
        low_frequency, high_frequency = 0.6 / np.max(periods), min(1.5 / np.min(periods), 0.45 / dt)
        self.filter_reach = int(3.0 / low_frequency / dt)
        self.size: int = next_fast_len(sample_count + 2 * self.filter_reach, real=True)
        f = np.maximum(np.fft.rfftfreq(self.size, dt), 1e-12)  # avoids a division by 0
        self.band: Array = np.minimum(f / _CORNER_FREQUENCY, 1.0) / np.sqrt(
            (1.0 + (low_frequency / f) ** _ORDER) * (1.0 + (f / high_frequency) ** _ORDER)
        )
        self.band[0] = 0.0
        # A sample a changes the final velocity by a dt, and the final displacement by a dt times
        # the remaining time.
        remaining = np.arange(sample_count - 1, -1, -1.0)
        self.end_derivatives = np.stack([np.full(sample_count, dt), dt * dt * remaining])
        # The filter also affects the samples before the start.
        band32 = self.band.astype(np.float32)
        sample_order = np.concatenate(
            [np.arange(sample_count - 1, -1, -1), -np.arange(1, self.filter_reach + 1)]
        )
        self.free_vibrations = self._free_vibrations(band32, sample_order)
        self.impulse_response: NDArray[np.float32] = irfft(band32, self.size)[sample_order]

    def _free_vibrations(
        self, band: NDArray[np.float32], sample_order: NDArray[np.int64]
    ) -> list[NDArray[np.float32]]:
        """Return the free vibrations of all oscillators after the band-pass filter, cosine and sine
        in reversed order of time.

        The free vibration of an oscillator is exp(exponent t); its real part is called cosine, its
        imaginary part sine. Only the part that has not decayed is stored, and few oscillators are
        computed at a time: 60 000 samples of all oscillators would need a gigabyte. `sample_order`
        contains the samples from the latest back to the first, then those before the start that the
        filter reaches, as negative numbers.
        """
        from scipy.fft import irfft, rfft

        sample_count, damping = self.envelope.size, self.damping
        exponent = self.omega * (-damping + 1j * np.sqrt(1.0 - damping**2))
        stored_samples = np.minimum(
            np.log(1.0 / _DECAYED) / (damping * self.omega * self.dt), sample_count - 1
        ).astype(int)
        free_vibrations: list[NDArray[np.float32]] = []
        for first_oscillator in range(0, self.omega.size, _OSCILLATORS_AT_A_TIME):
            chunk = slice(first_oscillator, first_oscillator + _OSCILLATORS_AT_A_TIME)
            vibrations = np.exp(exponent[chunk, None] * self.dt * np.arange(sample_count))
            # A row of derivatives treats the two samples next to the extreme separately (`_row`).
            vibrations[:, 0] = 0.0
            parts = np.stack([vibrations.real, vibrations.imag], axis=1).astype(np.float32)
            filtered = irfft(rfft(parts, self.size) * band, self.size)[..., sample_order]
            # The filter widens the stored part to either side.
            first_samples = sample_count - 1 - self.filter_reach - stored_samples[chunk]
            free_vibrations += [
                filtered_pair[:, max(first_sample, 0) :].copy()
                for filtered_pair, first_sample in zip(filtered, first_samples, strict=True)
            ]
        return free_vibrations

    def filtered(self, rows: Array) -> Array:
        """Apply the band-pass filter to the samples along the last axis."""
        from scipy.fft import irfft, rfft

        return np.asarray(
            irfft(rfft(rows, self.size) * self.band, self.size)[..., : rows.shape[-1]]
        )

    def extremes(self, samples: Array, level: Array) -> tuple[Array, Array]:
        """Return the extremes of the responses above a level (m/s^2, one per oscillator), and the
        maximum of each oscillator.

        The first array has a column for each extreme: index of the oscillator (row OSCILLATOR),
        time in s (TIME) and, from row VALUE on, the response to each component in m/s^2. The second
        array contains the maximum of each oscillator in m/s^2, and its column in the first array,
        or a negative number if the maximum is not an extreme above the level.
        """
        # 400 extremes per oscillator
        found_extremes = np.empty((VALUE + len(samples), 400 * level.size))
        maxima = np.empty((2, level.size))
        kernel = (extremes if len(samples) == 1 else radii).variant(EVERYTHING)
        motions = np.array(samples[0] if len(samples) == 1 else samples)
        count = kernel(motions, self.dt, self.substeps, self.table, level, found_extremes, maxima)
        # Oscillators at rest need a positive value for the logarithm.
        maxima[0] = np.maximum(maxima[0], np.finfo(float).tiny)
        return found_extremes[:, :count], maxima

    def rows(self, oscillator: NDArray[np.int64], when: Array, directions: Array) -> SparseRows:
        """Compute the derivatives of extremes with respect to the samples of all components.

        The derivatives include the band-pass filter and the envelope, and are relative to the
        target. The last rows, two for each component, are the derivatives of the final velocity and
        displacement. A sample changes the ground acceleration by a hat function (linear
        interpolation between samples), which is the second difference of a ramp. After the hat, the
        oscillator is in free vibration. As a function of the sample, the derivative of an extreme
        is therefore a free vibration that is reversed in time, with a cosine and a sine part. The
        two samples next to the extreme are treated separately. `directions` contains the unit
        vector of each extreme over the components.
        """
        sample_before = np.minimum((when / self.dt).astype(int), self.envelope.size - 2)
        factors_of_rows = self._factors_of_rows(oscillator, when - self.dt * sample_before)
        starts, lines = [], list[NDArray[np.float32]]()
        envelope = self.envelope.astype(np.float32)
        for k, row_factors, sample_of_extreme in zip(
            oscillator, factors_of_rows, sample_before, strict=True
        ):
            row_start, row_values = self._row(k, row_factors, sample_of_extreme)
            row_values *= envelope[row_start : row_start + row_values.size]
            starts.append(row_start)
            lines.append(row_values)
        relative_directions = directions / self.wanted[oscillator]
        component_count = len(directions)
        for component in range(component_count):
            for end in self.filtered(self.end_derivatives) * self.envelope:
                starts.append(0)
                lines.append(end.astype(np.float32))
            relative_directions = np.hstack(
                [
                    relative_directions,
                    np.repeat(np.eye(component_count)[:, component, None], 2, axis=1),
                ]
            )
        return SparseRows(self.envelope.size, np.array(starts), lines, relative_directions.T)

    def _factors_of_rows(
        self, oscillator: NDArray[np.int64], time_after_sample: Array
    ) -> NDArray[np.float32]:
        """Return four dimensionless factors C, -S, H0 and H1 of each extreme, shape (extremes, 4),
        for `_row`.

        Sample n is the last sample before the extreme. A unit change of sample j adds a hat
        function to the ground acceleration: 1 at sample j, 0 at all other samples, and linear in
        between. The derivative of the extreme with respect to sample j is the response to this hat
        at the time of the extreme:

            j < n        c C - s S    The hat has ended; the oscillator vibrates freely.
            j = n        H0           The extreme is in the second half of the hat.
            j = n + 1    H1           The extreme is in the first half of the hat.
            j > n + 1    0            The hat starts after the extreme.

        Only c and s depend on j. They are the damped cosine and sine

            c + i s = exp((n - j) dt w (-z + i sqrt(1 - z^2)))

        with the sampling interval dt, the circular frequency w and the damping ratio z. C + i S is
        a complex amplitude of the free vibration (`vibration_after` in the body).

        `_row` multiplies the four factors by four stored functions of j: c, s, and the unit
        impulses at the samples n and n + 1, all after the band-pass filter of the correction. Their
        sum contains the derivatives with respect to all samples.

        `time_after_sample` is the time of the extreme after sample n, s.
        """
        w, z, dt = self.omega[oscillator], self.damping[oscillator], self.dt
        # Response x to a ramp, x'' + 2 z w x' + w^2 x = -t / dt from rest: the particular solution
        # -t / (dt w^2) + constant, minus the free vibration with the same initial displacement and
        # velocity.
        exponent = w * (-z + 1j * np.sqrt(1.0 - z * z))
        constant = 2.0 * z / (w**3 * dt)
        free_amplitude = constant - 1j * (constant * z * w - 1.0 / (w * w * dt)) / exponent.imag
        ramp_responses = [
            -t / dt / w**2 + constant - (free_amplitude * np.exp(exponent * t)).real
            for t in (time_after_sample + dt, time_after_sample)
        ]
        # The hat of sample j is the sum of three ramps that start at the samples j - 1, j and j +
        # 1, with the factors 1, -2 and 1. For j < n their particular solutions cancel, and the free
        # vibrations remain. The responses are multiplied by w^2, because they are
        # pseudo-accelerations.
        vibration_after = (
            -w
            * w
            * free_amplitude
            * (np.exp(exponent * dt) - 2.0 + np.exp(-exponent * dt))
            * np.exp(exponent * time_after_sample)
        )
        hat_responses = (
            w * w * np.stack([ramp_responses[0] - 2.0 * ramp_responses[1], ramp_responses[1]])
        )
        return np.stack(
            [vibration_after.real, -vibration_after.imag, *hat_responses], axis=1
        ).astype(np.float32)

    def _row(
        self, oscillator: int, factors: NDArray[np.float32], sample_of_extreme: int
    ) -> tuple[int, NDArray[np.float32]]:
        """Return the first sample of the derivatives of a single extreme, and the derivatives
        without the envelope from this sample on.

        The row extends from the decay of the vibration before the extreme to the reach of the
        filter after it. `sample_of_extreme` is the number of the sample before the extreme.
        """
        sample_count = self.envelope.size
        vibration = self.free_vibrations[oscillator]
        row_start = max(sample_of_extreme + 1 + self.filter_reach - vibration.shape[1], 0)
        row_end = min(sample_count, sample_of_extreme + 1 + self.filter_reach)
        row_size = row_end - row_start
        # Stored in reversed order of time, so that it is read forward here
        first_vibration = vibration.shape[1] - self.filter_reach - 1 - sample_of_extreme + row_start
        row_values = factors[:2] @ vibration[:, first_vibration : first_vibration + row_size]
        first_impulse = sample_count - 1 - sample_of_extreme + row_start
        row_values += factors[2] * self.impulse_response[first_impulse : first_impulse + row_size]
        row_values += (
            factors[3] * self.impulse_response[first_impulse - 1 : first_impulse - 1 + row_size]
        )
        return row_start, row_values

    def equations(
        self, found_extremes: Array, maxima: Array
    ) -> tuple[NDArray[np.int64], Array, Array, Array, Bools]:
        """Return the equations that the next correction of the motion must satisfy, for the result
        of `extremes` with at least one extreme (ensured by `check_peaks`): time (s), unit vector
        over the components, shortfall, and True for an equality, False for an upper limit.

        The maximum of each oscillator must equal the target (an equality). Other large extremes
        must not exceed the target (an upper limit); their number is limited, to save memory. The
        shortfall is 1 minus the ratio of the extremum to the target; positive if it is below the
        target. Its absolute value is limited to `_MAX_RELATIVE_CHANGE`, except for extremes below
        their upper limit.
        """
        oscillator, values = found_extremes[OSCILLATOR].astype(int), found_extremes[VALUE:]
        magnitude = np.linalg.norm(values, axis=0)
        is_equality = np.zeros(oscillator.size, bool)
        has_maximum = maxima[1] >= 0.0
        is_equality[maxima[1, has_maximum].astype(int)] = True
        relative_magnitude = np.where(is_equality, np.inf, magnitude / self.wanted[oscillator])
        sorted_magnitudes = np.sort(relative_magnitude)
        # Upper limits are applied to the extremes with a relative magnitude of at least `cut`. Only
        # `_MAX_EXTREMES` extremes per period are above the first value of `cut`. It is increased to
        # `_CONTROLLED_FRACTION`, because smaller extremes need no limit, and reduced to 1 (the
        # target), because extremes above the target need one. If more than `_MAX_EXTREMES_ABOVE`
        # extremes per period are above the target, only this number is used (`cut_above`).
        cut, cut_above = (
            sorted_magnitudes[-min(int(count * self.omega.size), relative_magnitude.size)]
            for count in (_MAX_EXTREMES, _MAX_EXTREMES_ABOVE)
        )
        cut = max(min(max(cut, _CONTROLLED_FRACTION), 1.0), cut_above)
        controlled = np.flatnonzero(is_equality | (relative_magnitude >= cut))
        oscillator, is_equality = oscillator[controlled], is_equality[controlled]
        shortfall = 1.0 - magnitude[controlled] / self.wanted[oscillator]
        # The shortfall of an extreme below its upper limit is no required change, but the distance
        # from the limit, and is not changed.
        shortfall = np.where(
            is_equality | (shortfall < 0.0),
            np.clip(shortfall, -_MAX_RELATIVE_CHANGE, _MAX_RELATIVE_CHANGE),
            shortfall,
        )
        return (
            oscillator,
            found_extremes[TIME, controlled],
            values[:, controlled] / magnitude[controlled],
            shortfall,
            is_equality,
        )

    def rounds(
        self, samples: Array, row_sum: NDArray[np.float32], max_rounds: int, *, is_first_stage: bool
    ) -> tuple[Array, NDArray[np.float32]]:
        """Reduce the misfit of a motion in several rounds; return the motion with the smallest
        misfit and its `row_sum`.

        Each round solves a quadratic program. Its damping (Levenberg-Marquardt) is increased until
        the misfit decreases. The rounds end early if the misfit is small. In the first stage, the
        first rounds compute the complete change from the seed; in later stages, all rounds add to
        the change.
        """
        is_stepwise = not is_first_stage
        damping = _INITIAL_DAMPING if is_first_stage else _REFINEMENT_DAMPING
        state = self._state(samples, row_sum, is_stepwise)
        best_state = state
        for round_number in range(max_rounds):
            if state.misfit < 0.5 * SMALL_MISFIT:
                break
            # An oscillator without an extreme above the level needs a lower level.
            if np.any(state.maxima[1] < 0.0):
                level = np.minimum(_CONTROLLED_FRACTION * self.wanted, 0.9999 * state.maxima[0])
                found_extremes, maxima = self.extremes(state.samples, level)
                state = replace(state, extremes=found_extremes, maxima=maxima)
            quadratic_program = self._quadratic_program(state)
            # Near the target, and in the second half of the rounds, add to the change.
            is_near = state.misfit < _STEPWISE_MISFIT or 2 * round_number > max_rounds
            if not is_stepwise and is_near:
                is_stepwise, damping = True, min(damping, _REFINEMENT_DAMPING)
                state = replace(state, merit=self.merits(state.maxima, is_stepwise)[0])
            # A complete change must also contain the change of the previous rounds, which it
            # replaces.
            required_change = quadratic_program.shortfall
            row_damping = np.ones(required_change.size)
            if is_stepwise:
                row_damping = quadratic_program.refine(damping)
            else:
                required_change = required_change + quadratic_program.rows.times(state.row_sum)
            first_damping = damping
            for _ in range(_MAX_DAMPING_INCREASES):
                multipliers = quadratic_program.multipliers(required_change, damping * row_damping)
                kept_part = 0.0 if is_stepwise else 1.0
                update = quadratic_program.rows.sum(multipliers) - kept_part * state.row_sum
                changed_state = self._state(
                    state.samples + self.filtered(self.envelope * update.reshape(samples.shape)),
                    state.row_sum + update,
                    is_stepwise,
                )
                if changed_state.merit < state.merit:
                    break
                damping *= 4.0
            state = changed_state
            if damping == first_damping:
                damping = max(damping / 5.0, _MIN_DAMPING)
            if state.misfit < best_state.misfit:
                best_state = state
            # The next round must not need the memory of two sets of rows.
            del quadratic_program
        return best_state.samples, best_state.row_sum

    def _state(
        self, samples: Array, row_sum: NDArray[np.float32], is_stepwise: bool
    ) -> _MotionState:
        """Return a changed motion with its extremes and its differences from the target.

        `row_sum` is the change before it is multiplied by the envelope and filtered.
        """
        # Smaller extremes have no equation in the next round.
        found_extremes, maxima = self.extremes(samples, _CONTROLLED_FRACTION * self.wanted)
        merit, misfit = self.merits(maxima, is_stepwise)
        return _MotionState(samples, row_sum, found_extremes, maxima, merit, misfit)

    def _quadratic_program(self, state: _MotionState) -> _QuadraticProgram:
        """Return the quadratic program of the next change of a motion.

        Two equations per component require that the final velocity and displacement of the ground
        equal the final values of the seed.
        """
        oscillator, when, directions, shortfall, is_equality = self.equations(
            state.extremes, state.maxima
        )
        # The last rows belong to the final velocity and displacement; their required changes cancel
        # the changes of the previous rounds.
        rows = self.rows(oscillator, when, directions)
        # Derivatives of the final velocity (s) and displacement (s^2) of each component with
        # respect to the samples of all components, shape (2 components, components * n)
        end_derivatives = np.kron(np.eye(len(self.scaled_seed)), self.end_derivatives)
        change = (state.samples - self.scaled_seed).ravel()
        shortfall = np.concatenate([shortfall, -end_derivatives @ change])
        is_equality = np.concatenate([is_equality, np.ones(len(end_derivatives), bool)])
        # Rows of unit length, so that the same Levenberg-Marquardt damping is suitable for all
        # rows. The methods of `_QuadraticProgram` scale `shortfall`.
        gram = rows.products()
        scales = 1.0 / np.sqrt(np.maximum(np.diagonal(gram), 1e-300))
        gram *= scales[:, None] * scales
        return _QuadraticProgram(rows, gram, scales, shortfall, is_equality, oscillator)

    def merits(self, maxima: Array, is_stepwise: bool) -> tuple[float, float]:
        """Return the sum of powers of |ln(maximum / target)|, which a round must reduce, and the
        misfit, the maximum of |maximum / target - 1|.

        Row 0 of `maxima` contains the maximum of each oscillator. `is_stepwise` selects the
        exponent from `_POWERS`.
        """
        ratio = maxima[0] / self.wanted
        return float(np.sum(np.abs(np.log(ratio)) ** _POWERS[is_stepwise])), float(
            np.max(np.abs(ratio - 1.0))
        )


def solve_program(gram: Array, shortfall: Array, is_equality: Bools, damping: Array) -> Array:
    """Solve the quadratic program of a round, and return the multipliers.

    The multipliers l minimize l' (G + diag(damping)) l / 2 - shortfall' l, where G is `gram`.
    Multipliers of inequalities (upper limits) must not be positive. A primal-dual active set method
    is used: inequalities with a positive multiplier become inactive, violated inequalities become
    active.
    """
    from scipy.linalg import cho_factor, cho_solve

    is_active, multipliers = is_equality | (shortfall < 0.0), np.zeros(shortfall.size)
    tolerance = 1e-3 * float(np.median(np.abs(shortfall[is_equality])))
    for _ in range(20):
        indices = np.flatnonzero(is_active)
        active_gram = gram[np.ix_(indices, indices)]
        active_gram[np.diag_indices(indices.size)] += damping[indices]
        try:
            factors = cho_factor(active_gram, check_finite=False)
        except np.linalg.LinAlgError:
            # Because of rounding, the matrix is not positive definite.
            damping = np.maximum(10.0 * damping, 1e-5)
            continue
        multipliers[:] = 0.0
        multipliers[indices] = cho_solve(factors, shortfall[indices], check_finite=False)
        is_leaving = is_active & ~is_equality & (multipliers > 0.0)
        is_joining = ~is_active & (gram @ multipliers > shortfall + tolerance)
        if not is_leaving.any() and not is_joining.any():
            return multipliers
        is_active = (is_active & ~is_leaving) | is_joining
    # The active set has not converged: omit the inadmissible multipliers.
    multipliers[~is_equality] = np.minimum(multipliers[~is_equality], 0.0)
    return multipliers


def check_peaks(problem: MatchingProblem, seed: GroundMotion, samples: Array) -> None:
    """Raise an error if the response increases until the end of the motion at more than half of the
    periods, as under a ramp: a change cannot bring such a response to the target.
    """
    # An oscillator without an extreme above the lowered level reaches its maximum at the end of the
    # motion.
    _, maxima = problem.extremes(samples, _CONTROLLED_FRACTION * problem.wanted)
    level = np.minimum(_CONTROLLED_FRACTION * problem.wanted, 0.9999 * maxima[0])
    _, maxima = problem.extremes(samples, level)
    growing_count = int(np.sum(maxima[1] < 0.0))
    if growing_count > MAX_GROWING_FRACTION * problem.omega.size:
        raise RecordError(
            f"{seed.name}: cannot be matched: at {growing_count} of "
            f"{problem.omega.size} periods the response has no peak before the end of the record, "
            "as under a ramp or an offset; remove the trend (--baseline linear), or use another "
            "record"
        )
