"""Ground motions matched to a target spectrum by the least change.

A response of an oscillator is linear in the samples of the motion. Wanted is the change d of least
norm d' P^-1 d by which the largest response at each period is the target, while its other extremes
above `_NEAR` of it do not exceed it: a small quadratic program in multipliers, d = P H' lambda. The
rows of H are the derivatives of the extremes with respect to the samples, the oscillators' impulse
responses reversed in time from the extreme's own moment. P = F E^2 F: E is the record's own
envelope, so that nothing is added where it is quiet, F a band of the periods. Two more rows keep
the last velocity and displacement of the ground. Far from the target each round solves for the
whole change from the scaled seed, then stepwise; periods between those that are matched join where
they are worst (after Hancock et al. 2006; Al Atik and Abrahamson 2010; Grant and Diaferia 2013).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from tdint.analysis.given import AnyMotion, damping_of, motion_of
from tdint.analysis.spectra.elastic import SA_DAMPING, recursion_table, spectrum
from tdint.analysis.spectra.rotated import rotated_spectrum
from tdint.analysis.spectra.target import TargetSpectrum, read_target
from tdint.arrays import Array
from tdint.errors import RecordError, UsageError
from tdint.ground_motion.measures import Measures, Motion, integrate, measure
from tdint.ground_motion.reading.suites import GroundMotion, components
from tdint.ground_motion.record import Record
from tdint.kernels.building.compilable import EVERYTHING
from tdint.kernels.oscillators.elastic import BY_DISPLACEMENT, BY_VELOCITY
from tdint.kernels.oscillators.extremes import OSCILLATOR, TIME, VALUE, extremes, radii
from tdint.tabular import Tabular

Bools: TypeAlias = NDArray[np.bool_]

CHECKED = 1000
"""Periods in equal ratios at which a match is judged."""

_FIRST, _STAGES, _ROUNDS = 130, 4, (12, 6, 6, 8, 8)
"""Periods matched at first, how often the worst of those judged join, and rounds of each stage at
most."""

_SHOWN, _RESOLVED = 200, 5.0
"""Number of periods of a figure; shortest period of a figure in sampling intervals, below which the
motion between samples determines the spectrum."""

_ENOUGH = 0.008
"""Misfit up to which a period does not join, nor a stage begins."""

_NEAR, _MOST = 0.8, 3.0
"""Extremes above this part of the target are held, three for each period in all at most."""

_CLIP, _STEPWISE = 0.3, 0.1
"""The largest relative step of a response in a round; and the misfit from which rounds add to the
change."""

_DAMPED, _POLISHED, _LEAST = 1e-2, 1e-4, 1e-6
"""Levenberg and Marquardt's damping over the Gram matrix's diagonal: at first, when polishing, at
least."""

_WINDOW = 2.0
"""Half of the window of the envelope, s."""

_UNEVEN = 0.03, 10.0
"""Damping of a row over the others' in steps: the less the farther it is from what is asked, within
these bounds."""

_POWERS = 2.0, 4.0
"""What is to fall is the sum of these powers of ln of responses over the target: far from it, and
in steps."""

_OF_MEAN = 4.0
"""Weight of the mean misfit beside the largest one, which is about four times as large, where the
best is chosen."""

_DECAYED = 1e-6
"""Amplitude of a free vibration, relative to its start, after which it is not stored. The rows are
in single precision, 6e-8."""

_TOGETHER = 16
"""Number of oscillators whose free vibrations are filtered at a time: 60 MB at 60 000 samples."""

_BLOCK = 4096
"""Samples over which the products of rows are summed at a time: 16 MB for 1000 rows."""

_GROWING = 0.5
"""Part of the periods without a peak of the response above which a motion is refused; earthquakes
have peaks at all periods up to about their duration."""

_TRIES = 6
"""Times that a step is damped more, fourfold each."""

_ORDER, _CORNER = 8, 1.0
"""Order of the band's edges; frequency (Hz) below which changes weigh more, for they move the
ground far."""


@dataclass(frozen=True, repr=False)
class Match(Tabular):
    """A motion whose spectrum was brought to a target.

    Attributes
    ----------
    record, seed : Record or Horizontals
        The matched motion; the one that it was made of, as it was read.
    factor : float
        What the seed was scaled by before.
    target : TargetSpectrum
        The target.
    periods, psa, seed_psa : ndarray, shape (CHECKED,)
        Periods, s; pseudo-accelerations of the match and of the scaled seed, of pairs RotD100,
        m/s^2.
    damping : float
        Damping ratio.
    """

    record: GroundMotion
    seed: GroundMotion
    factor: float
    target: TargetSpectrum
    periods: Array
    psa: Array
    seed_psa: Array
    damping: float

    @property
    def misfit(self) -> Array:
        """Pseudo-acceleration over the target less 1, at the periods."""
        return np.asarray(self.psa / self.target.at(self.periods) - 1.0)

    @property
    def largest_misfit(self) -> float:
        """The largest of all periods."""
        return float(np.max(np.abs(self.misfit)))

    @property
    def mean_misfit(self) -> float:
        """The mean of all periods."""
        return float(np.mean(np.abs(self.misfit)))

    @property
    def change(self) -> float:
        """Root mean square of the change over that of the scaled seed."""
        after, before = (
            np.array([record.acceleration for record in components(motion)])
            for motion in (self.record, self.seed)
        )
        scaled = self.factor * before
        return float(np.linalg.norm(after - scaled) / np.linalg.norm(scaled))

    @property
    def parts(self) -> tuple[Match, ...]:
        """Of each component by itself, with the spectra of the pair: itself if it is of one."""
        if isinstance(self.record, Record):
            return (self,)
        each = zip(components(self.record), components(self.seed), strict=True)
        return tuple(replace(self, record=record, seed=seed) for record, seed in each)

    @property
    def after(self) -> Record:
        """The matched motion, of a part."""
        return components(self.record)[0]

    @cached_property
    def before(self) -> Record:
        """The scaled seed, of a part."""
        return components(self.seed)[0].scaled(self.factor)

    @cached_property
    def measures(self) -> tuple[Measures, Measures]:
        """Of a part, and of its scaled seed."""
        return measure(self.after), measure(self.before)

    @cached_property
    def motions(self) -> tuple[Motion, Motion]:
        """Velocities and displacements of the ground, of a part and of its scaled seed."""
        return integrate(self.after), integrate(self.before)

    @cached_property
    def directions(self) -> tuple[tuple[float, float], tuple[float, float]] | None:
        """Of a pair and of its seed: the mean ratio of RotD100 to RotD50, and the correlation of
        the accelerations."""
        result = []
        for motion in (self.record, self.seed):
            if isinstance(motion, Record):
                return None
            middle, largest = rotated_spectrum(
                motion, self.periods[::10], self.damping, [50, 100]
            ).psa
            first, second = components(motion)
            correlation = np.corrcoef(first.acceleration, second.acceleration)[0, 1]
            result.append((float(np.mean(largest / middle)), float(correlation)))
        return result[0], result[1]

    @property
    def shown_periods(self) -> Array:
        """Periods of a figure, s: from half of the shortest matched period to twice the longest,
        as far as the sampling interval resolves them."""
        dt = components(self.record)[0].dt
        resolved = max(0.5 * self.periods[0], min(_RESOLVED * dt, self.periods[0]))
        return np.geomspace(resolved, 2.0 * self.periods[-1], _SHOWN)

    def spectra_at(self, periods: Array) -> list[tuple[Array, Array]]:
        """Return pseudo-accelerations after the match and of the scaled seed, m/s^2: of the motion,
        of a pair RotD100, and then of each component of a pair."""
        motions = [(self.record, self.seed)]
        if not isinstance(self.record, Record):
            motions += zip(components(self.record), components(self.seed), strict=True)
        return [
            (
                _judged(after, periods, self.damping),
                self.factor * _judged(before, periods, self.damping),
            )
            for after, before in motions
        ]

    def _headline(self) -> str:
        words = (
            f"of {self.seed.source} {self.seed.component}: largest misfit "
            f"{100.0 * self.largest_misfit:.2g} %, mean {100.0 * self.mean_misfit:.2g} %, change "
            f"{self.change:.2g} of the motion"
        )
        if self.directions:
            (ratio, correlation), (ratio_before, correlation_before) = self.directions
            words += (
                f", RotD100 over RotD50 {ratio_before:.3g} before and {ratio:.3g} after, "
                f"correlation of the components {correlation_before:.2f} and {correlation:.2f}"
            )
        return words


def match(
    motion: AnyMotion,
    target: TargetSpectrum | str,
    *,
    periods: tuple[float, float] = (0.05, 4.0),
    damping: float = SA_DAMPING,
) -> Match:
    """Bring the spectrum of a motion, of a pair its RotD100, to a target by the least change.

    Parameters
    ----------
    motion : Record, Horizontals, str, Path, ObsPy trace, or tuple of two of them
        The seed. Both components of a pair are changed together, with one factor.
    target : TargetSpectrum or str
        A file of a spectrum, or the text of a design spectrum
        (`tdint.analysis.spectra.target.read_target`).
    periods : tuple of two floats
        The range over which it is matched, s.
    damping : float
        Damping ratio of the spectra.

    Returns
    -------
    Match
        The scaled seed itself where no change is nearer to the target.

    Raises
    ------
    UsageError
        A range that is none, or beyond the target's; a motion that is too short.
    AnalysisError
        Periods that the sampling interval does not resolve; a motion without any acceleration.
    RecordError
        The record is none, or cannot be read.
    """
    seed, damping = motion_of(motion), damping_of(damping)
    aim, checked = _aim(target, periods, damping)
    return _matched(seed, aim, checked, damping, _judged(seed, checked, damping))


def match_suite(
    motions: Sequence[AnyMotion],
    target: TargetSpectrum | str,
    *,
    periods: tuple[float, float] = (0.05, 4.0),
    damping: float = SA_DAMPING,
    factors: Sequence[float] | None = None,
) -> list[Match]:
    """Bring the mean spectrum of motions to a target, each by the least change to its own scaled
    spectrum times target over mean: their scatter is kept.

    Parameters
    ----------
    motions : sequence
        The seeds, each as of `match`.
    target, periods, damping
        As of `match`.
    factors : sequence of float, optional
        The factor of each seed in the suite, as `tdint.scale` returns it; by default least squares
        of ln Sa.

    Returns
    -------
    list of Match
        One for each seed, in order; its target is its own.

    Raises
    ------
    UsageError, AnalysisError, RecordError
        As of `match`; there are no motions.
    """
    if not motions:
        raise UsageError("a suite has one motion at least")
    seeds, damping = [motion_of(motion) for motion in motions], damping_of(damping)
    aim, checked = _aim(target, periods, damping)
    wanted, before = aim.at(checked), [_judged(seed, checked, damping) for seed in seeds]
    if factors is None:
        factors = [float(np.exp(np.mean(np.log(wanted / psa)))) for psa in before]
    if len(factors) != len(seeds):
        raise UsageError(f"factors: one for each of {len(seeds)} motions, got {len(factors)}")
    scaled = [abs(factor) * psa for factor, psa in zip(factors, before, strict=True)]
    part = wanted / np.mean(scaled, axis=0)
    name = f"{aim.source} in the mean of {len(seeds)}"
    return [
        _matched(seed, TargetSpectrum(name, checked, own * part), checked, damping, psa)
        for seed, own, psa in zip(seeds, scaled, before, strict=True)
    ]


def _aim(
    target: TargetSpectrum | str, periods: tuple[float, float], damping: float
) -> tuple[TargetSpectrum, Array]:
    """A target, and the periods at which a match with it is judged."""
    aim = read_target(target) if isinstance(target, str) else target
    shortest, longest = periods
    if not 0.0 < shortest < longest < math.inf:
        raise UsageError(
            f"the range of periods must rise from a positive number, got {shortest:g} to "
            f"{longest:g} s"
        )
    aim.check_damping(damping, "of the motion")
    checked = np.geomspace(shortest, longest, CHECKED)
    aim.at(checked)  # refused where it has no value
    return aim, checked


def _judged(motion: GroundMotion, periods: Array, damping: float) -> Array:
    """Pseudo-accelerations, m/s^2, shape (k,): of a pair RotD100."""
    fit = all(
        np.any(record.acceleration) and record.acceleration.size >= 100
        for record in components(motion)
    )
    if not (fit and damping > 0.0):
        raise UsageError(
            "a motion is matched that has some acceleration and 100 samples at least, with some "
            "damping"
        )
    if isinstance(motion, Record):
        return spectrum(motion, periods, damping).psa
    return np.asarray(rotated_spectrum(motion, periods, damping, [100]).psa[0])


def _matched(
    seed: GroundMotion, aim: TargetSpectrum, checked: Array, damping: float, before: Array
) -> Match:
    """The match of a seed whose spectrum at the periods is `before`."""
    wanted = aim.at(checked)
    factor = float(np.exp(np.mean(np.log(wanted / before))))
    records = components(seed)
    start = factor * np.array([record.acceleration for record in records])
    # Match at the first periods, then let those join that are worst in between, until all are near.
    places = np.geomspace(checked[0], checked[-1], _FIRST)
    samples, multiplied, best, least = start, np.zeros(start.size, np.float32), start, np.inf
    for stage in range(_STAGES + 1):
        problem = _Problem.of(start, records[0].dt, places, wanted=aim.at(places), damping=damping)
        if stage == 0:
            _check_peaks(problem, seed, start)
        samples, multiplied = problem.rounds(samples, multiplied, _ROUNDS[stage], first=stage == 0)
        off = np.abs(_judged(_with_samples(seed, samples), checked, damping) / wanted - 1.0)
        if (score := float(np.max(off) + _OF_MEAN * np.mean(off))) < least:
            best, least = samples, score
        if np.max(off) < _ENOUGH:
            break
        worst = (off > _ENOUGH) & (off >= np.roll(off, 1)) & (off >= np.roll(off, -1))
        joining = [
            period for period in checked[worst] if np.min(np.abs(np.log(places / period))) > 0.003
        ]
        places = np.sort(np.concatenate([places, joining]))
    # Never a motion that is worse than its seed
    as_it_was = np.abs(factor * before / wanted - 1.0)
    if not least < np.max(as_it_was) + _OF_MEAN * np.mean(as_it_was):
        best = start
    words = (
        f"matched to {aim.source} from {checked[0]:g} to {checked[-1]:g} s, {100.0 * damping:g} % "
        "damping"
    )
    matched = _with_samples(seed, best, words)
    return Match(
        matched,
        seed,
        factor,
        aim,
        checked,
        _judged(matched, checked, damping),
        factor * before,
        damping,
    )


def _check_peaks(problem: _Problem, seed: GroundMotion, samples: Array) -> None:
    """Refuse a motion under which most oscillators have no largest peak before its end.

    Raises
    ------
    RecordError
        The response grows until the end of the record at more than half of the periods, as under a
        ramp. There is no peak then that a change could bring to the target.
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


def _with_samples(motion: GroundMotion, samples: Array, *words: str) -> GroundMotion:
    """A motion with other samples, shape (components, n), and what was done to it."""
    records = [
        replace(
            record,
            acceleration=of_one,
            processing=(*record.processing, *words),
            peaks=(None, None),
            header_checks=(),
        )
        for record, of_one in zip(components(motion), samples, strict=True)
    ]
    return (
        records[0]
        if isinstance(motion, Record)
        else replace(motion, first=records[0], second=records[1])
    )


@dataclass(frozen=True)
class _SparseRows:
    """Rows of a matrix over the samples of all components, each stored where it is not zero.

    Attributes
    ----------
    size : int
        Number of samples of a component.
    starts : ndarray of int, shape (rows,)
        The first sample of each line.
    lines : list of ndarray
        The values of each row over the samples, before the factors of the components.
    directions : ndarray, shape (rows, components)
        The factor of each row for each component.
    """

    size: int
    starts: NDArray[np.int64]
    lines: list[NDArray[np.float32]]
    directions: Array

    def products(self) -> Array:
        """Return the scalar products of all rows, shape (rows, rows), summed over blocks of
        samples."""
        from scipy.linalg.blas import ssyrk

        stops = self.starts + np.array([line.size for line in self.lines])
        result = np.zeros((len(self.lines), len(self.lines)))
        for first in range(0, self.size, _BLOCK):
            last = min(first + _BLOCK, self.size)
            places = np.flatnonzero((self.starts < last) & (stops > first))
            block = np.zeros((places.size, last - first), np.float32)
            for row, place in zip(block, places, strict=True):
                start = self.starts[place]
                begin, end = max(start, first), min(stops[place], last)
                row[begin - first : end - first] = self.lines[place][begin - start : end - start]
            half = ssyrk(1.0, block.T, trans=True)
            result[np.ix_(places, places)] += np.triu(half).astype(float) + np.triu(half, 1).T
        return np.asarray(result * (self.directions @ self.directions.T))

    def times(self, samples: NDArray[np.float32]) -> Array:
        """Return the scalar product of each row with a change, shape (rows,)."""
        changes = samples.reshape(-1, self.size)
        result = np.empty(len(self.lines))
        for place, (start, line) in enumerate(zip(self.starts, self.lines, strict=True)):
            part = changes[:, start : start + line.size] @ line
            result[place] = self.directions[place] @ part
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
class _Problem:
    """A motion's components, the periods at which they are matched, and what a change may be made
    of."""

    start: Array
    dt: float
    wanted: Array
    omega: Array
    damping: float
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
        cls, start: Array, dt: float, periods: Array, *, wanted: Array, damping: float
    ) -> _Problem:
        """Put it together."""
        from scipy.fft import irfft, next_fast_len, rfft

        n, omega = start.shape[1], 2.0 * np.pi / periods
        parts = len(start) * 2.0 ** np.ceil(np.log2(np.maximum(1.0, omega * dt / 0.5)))
        table = recursion_table(omega, dt / parts, damping, 2)
        table[BY_DISPLACEMENT], table[BY_VELOCITY] = omega**2, 2.0 * damping * omega
        window = np.hanning(2 * max(int(_WINDOW / dt), 1) + 1)
        mean_square = np.convolve(np.sum(start**2, axis=0), window / window.sum(), "same")
        envelope = np.sqrt(np.maximum(mean_square, 0.0))[:n]
        # The band; its own response to one sample ends within `reach` samples to either side.
        low, high = 0.6 / periods[-1], min(1.5 / periods[0], 0.45 / dt)
        reach = int(3.0 / low / dt)
        size = next_fast_len(n + 2 * reach, real=True)
        f = np.maximum(np.fft.rfftfreq(size, dt), 1e-12)
        band = np.minimum(f / _CORNER, 1.0) / np.sqrt(
            (1.0 + (low / f) ** _ORDER) * (1.0 + (f / high) ** _ORDER)
        )
        band[0] = 0.0
        left = np.arange(
            n - 1, -1, -1.0
        )  # what a sample does to the last velocity and displacement
        ends = np.stack([np.full(n, dt), dt * dt * left])
        # Free vibrations, cosine and sine, over the samples since, from the latest back to `reach`
        # before the moment.
        # Only the part before it has decayed is kept, and few oscillators are computed at a time:
        # at 60 000 samples all of them would need a gigabyte.
        rate = omega * complex(-damping, math.sqrt(1.0 - damping**2))
        lasting = np.minimum(np.log(1.0 / _DECAYED) / (damping * omega * dt), n - 1).astype(int)
        band32, after = (
            band.astype(np.float32),
            np.concatenate([np.arange(n - 1, -1, -1), -np.arange(1, reach + 1)]),
        )
        free: list[NDArray[np.float32]] = []
        for first in range(0, omega.size, _TOGETHER):
            vibrations = np.exp(rate[first : first + _TOGETHER, None] * dt * np.arange(n))
            vibrations[:, 0] = 0.0  # the two samples about the moment are dealt with by themselves
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
        """Rows of samples, through the band."""
        from scipy.fft import irfft, rfft

        return np.asarray(
            irfft(rfft(rows, self.size) * self.band, self.size)[..., : rows.shape[-1]]
        )

    def extremes(self, samples: Array, level: Array) -> tuple[Array, Array]:
        """Extremes above a level, rows OSCILLATOR, TIME and VALUE of each component; the largest
        of each
        oscillator, and its place among them."""
        found, largest = (
            np.empty((VALUE + len(samples), 400 * level.size)),
            np.empty((2, level.size)),
        )
        kernel = (extremes if len(samples) == 1 else radii).variant(EVERYTHING)
        motions = np.array(samples[0] if len(samples) == 1 else samples)
        count = kernel(motions, self.dt, self.parts, self.table, level, found, largest)
        largest[0] = np.maximum(
            largest[0], np.finfo(float).tiny
        )  # of what does not move: ln of nothing is none
        return found[:, :count], largest

    def rows(self, who: NDArray[np.int64], when: Array, directions: Array) -> _SparseRows:
        """Derivatives of sizes of extremes with respect to the samples of all components, through
        band and envelope, and below them those of the last velocity and displacement.

        A sample changes the ground by a hat, the second difference of a ramp. Once the hat is over,
        the oscillator vibrates freely: what an earlier sample does to a moment is one vibration, by
        its cosine and its sine.
        """
        n, w, z, dt = self.envelope.size, self.omega[who], self.damping, self.dt
        before = np.minimum((when / dt).astype(int), n - 2)
        late = when - dt * before
        # Displacement over -g for a ground acceleration t / dt: a particular solution, less the
        # vibration from rest.
        rate = w * complex(-z, math.sqrt(1.0 - z * z))
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
        for k, part, moment in zip(who, parts, before, strict=True):
            # Samples from the decay of the vibration before the moment to the reach of the band
            # after it; `free` ends there.
            free = self.free[k]
            start = max(moment + 1 + self.reach - free.shape[1], 0)
            stop = min(n, moment + 1 + self.reach)
            place = free.shape[1] - self.reach - 1 - moment + start
            size = stop - start
            line = part[:2] @ free[:, place : place + size]
            first = n - 1 - moment + start
            line += part[2] * self.impulse[first : first + size]
            line += part[3] * self.impulse[first - 1 : first - 1 + size]
            line *= envelope[start:stop]
            starts.append(start)
            lines.append(line)
        scaled = directions / self.wanted[who]
        count = len(directions)
        for component in range(count):
            for end in self.filtered(self.ends) * self.envelope:
                starts.append(0)
                lines.append(end.astype(np.float32))
            scaled = np.hstack([scaled, np.repeat(np.eye(count)[:, component, None], 2, axis=1)])
        return _SparseRows(n, np.array(starts), lines, scaled.T)

    def asked(
        self, found: Array, largest: Array
    ) -> tuple[NDArray[np.int64], Array, Array, Array, Bools]:
        """What a change is asked for, a row each: oscillator, moment, direction over the
        components, how much is short of the target over it, and whether it is to be the target or
        not to exceed it."""
        who, values = found[OSCILLATOR].astype(int), found[VALUE:]
        size = np.linalg.norm(values, axis=0)
        # The largest of each period is to be the target, others above `_NEAR` of it no more than
        # that.
        equal = np.zeros(who.size, bool)
        moved = largest[1] >= 0.0  # an oscillator that the motion does not move has none
        equal[largest[1, moved].astype(int)] = True
        relative = np.where(equal, np.inf, size / self.wanted[who])
        cut = max(_NEAR, np.sort(relative)[-min(int(_MOST * self.omega.size), relative.size)])
        held = np.flatnonzero(equal | (relative >= min(cut, 1.0)))
        who, equal = who[held], equal[held]
        short = 1.0 - size[held] / self.wanted[who]
        short = np.where(equal | (short < 0.0), np.clip(short, -_CLIP, _CLIP), short)
        return who, found[TIME, held], values[:, held] / size[held], short, equal

    def rounds(
        self, samples: Array, multiplied: NDArray[np.float32], most: int, *, first: bool
    ) -> tuple[Array, NDArray[np.float32]]:
        """The samples after some rounds, and what the band and the envelope make their change
        of."""
        damped, stepwise = _DAMPED if first else _POLISHED, not first
        ends = np.kron(np.eye(len(samples)), self.ends)
        found, largest = self.extremes(samples, _NEAR * self.wanted)
        merit, misfit = self.merits(largest, stepwise)
        best, least = (samples, multiplied), misfit
        for number in range(most):
            if misfit < 0.5 * _ENOUGH:
                break
            if np.any(largest[1] < 0.0):
                found, largest = self.extremes(
                    samples, np.minimum(_NEAR * self.wanted, 0.9999 * largest[0])
                )
            # The quadratic program: each row's derivatives, how much it is short of, all rows'
            # products
            who, when, directions, short, equal = self.asked(found, largest)
            table = self.rows(who, when, directions)
            short = np.concatenate([short, -ends @ (samples - self.start).ravel()])
            equal = np.concatenate([equal, np.ones(len(ends), bool)])
            gram = table.products()
            scales = 1.0 / np.sqrt(np.maximum(np.diagonal(gram), 1e-300))
            gram *= scales[:, None] * scales
            if not stepwise and (misfit < _STEPWISE or 2 * number > most):
                stepwise, damped = True, min(damped, _POLISHED)
                merit, _ = self.merits(largest, stepwise)
            toward = short if stepwise else short + table.times(multiplied)
            uneven = np.ones(short.size)
            if stepwise:
                far = np.abs(short) + 1e-4  # closer than a hundredth of a percent nobody asks
                uneven = np.clip(np.median(far) / far, *_UNEVEN)
                _exchange(gram, toward * scales, equal, damped * uneven, who, scales)
            # The step, more damped until it is one towards the target
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
        """Sum of powers of ln of the largest extremes over the target; the largest of their
        misfits."""
        part = largest[0] / self.wanted
        return float(np.sum(np.abs(np.log(part)) ** _POWERS[stepwise])), float(
            np.max(np.abs(part - 1.0))
        )


def _exchange(
    gram: Array, short: Array, equal: Bools, damped: Array, who: NDArray[np.int64], scales: Array
) -> None:
    """Where another extreme of a period comes nearer to its target than the largest one, it becomes
    the equality."""
    for _ in range(2):
        left = (short - gram @ program(gram, short, equal, damped)) / scales
        changed = False
        for place in np.flatnonzero(equal[: who.size] & (left[: who.size] > _ENOUGH)):
            others = np.flatnonzero((who == who[place]) & ~equal[: who.size])
            if others.size and left[nearest := others[np.argmin(left[others])]] < 0.7 * left[place]:
                equal[place], equal[nearest], changed = False, True, True
        if not changed:
            return


def program(gram: Array, short: Array, equal: Bools, damped: Array) -> Array:
    """Multipliers l of the least l' (G + diag(damped)) l / 2 - short' l, of inequalities (not
    `equal`) none above 0.

    A primal-dual active set: those above 0 leave it, those whose bound is passed join.
    """
    from scipy.linalg import cho_factor, cho_solve

    active, result = equal | (short < 0.0), np.zeros(short.size)
    slack = 1e-3 * float(np.median(np.abs(short[equal])))
    for _ in range(20):
        places = np.flatnonzero(active)
        part = gram[np.ix_(places, places)]
        part[np.diag_indices(places.size)] += damped[places]
        try:
            factors = cho_factor(part, check_finite=False)
        except np.linalg.LinAlgError:
            damped = np.maximum(10.0 * damped, 1e-5)
            continue
        result[:] = 0.0
        result[places] = cho_solve(factors, short[places], check_finite=False)
        leaving = active & ~equal & (result > 0.0)
        joining = ~active & (gram @ result > short + slack)
        if not leaving.any() and not joining.any():
            return result
        active = (active & ~leaving) | joining
    result[~equal] = np.minimum(result[~equal], 0.0)
    return result
