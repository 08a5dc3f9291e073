"""Ground motions matched to a target spectrum by the least change.

A response of an oscillator is linear in the samples of the motion. Wanted is the change d of least norm d' P^-1 d by
which the largest response at each period is the target, while its other extremes above `_NEAR` of it do not exceed it:
a small quadratic program in multipliers, d = P H' lambda. The rows of H are the derivatives of the extremes with
respect to the samples, the oscillators' impulse responses reversed in time from the extreme's own moment. P = F E^2 F:
E is the record's own envelope, so that nothing is added where it is quiet, F a band of the periods. Two more rows keep
the last velocity and displacement of the ground. Far from the target each round solves for the whole change from the
scaled seed, then stepwise; periods between those that are matched join where they are worst (after Hancock et al. 2006;
Al Atik and Abrahamson 2010; Grant and Diaferia 2013).
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from tdint.analysis.given import AnyRecord, damping_of, record_of
from tdint.analysis.spectra.elastic import SA_DAMPING, recursion_table, spectrum
from tdint.analysis.spectra.target import TargetSpectrum, read_target
from tdint.arrays import Array
from tdint.errors import UsageError
from tdint.ground_motion.measures import Measures, Motion, integrate, measure
from tdint.ground_motion.record import Record
from tdint.kernels.building.compilable import EVERYTHING
from tdint.kernels.oscillators.elastic import BY_DISPLACEMENT, BY_VELOCITY
from tdint.kernels.oscillators.extremes import VALUE, WHEN, WHO, extremes
from tdint.tabular import Tabular

Bools: TypeAlias = NDArray[np.bool_]

CHECKED = 1000
"""Periods in equal ratios at which a match is judged."""

_FIRST, _STAGES, _ROUNDS = 130, 4, (12, 6, 6, 8, 8)
"""Periods matched at first, how often the worst of those judged join, and rounds of each stage at most."""

_ENOUGH = 0.008
"""Misfit up to which a period does not join, nor a stage begins."""

_NEAR, _MOST = 0.8, 3.0
"""Extremes above this part of the target are held, three for each period in all at most."""

_CLIP, _STEPWISE = 0.3, 0.1
"""The largest relative step of a response in a round; and the misfit from which rounds add to the change."""

_DAMPED, _POLISHED, _LEAST = 1e-2, 1e-4, 1e-6
"""Levenberg and Marquardt's damping over the Gram matrix's diagonal: at first, when polishing, at least."""

_WINDOW = 2.0
"""Half of the window of the envelope, s."""

_FORGOTTEN = 14.0
"""Exponent of an impulse response's decay beyond which it is nothing: 1e-6."""

_ORDER, _CORNER = 8, 1.0
"""Order of the band's edges; frequency (Hz) below which changes weigh more, for they move the ground far."""


@dataclass(frozen=True, repr=False)
class Match(Tabular):
    """A motion whose spectrum was brought to a target.

    Attributes
    ----------
    record, seed : Record
        The matched motion; the one that it was made of, as it was read.
    factor : float
        What the seed was scaled by before.
    target : TargetSpectrum
        The target.
    periods, psa, seed_psa : ndarray, shape (CHECKED,)
        Periods, s; pseudo-accelerations of the match and of the scaled seed, m/s^2.
    damping : float
        Damping ratio.
    """

    record: Record
    seed: Record
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
        scaled = self.factor * self.seed.acceleration
        return float(np.linalg.norm(self.record.acceleration - scaled) / np.linalg.norm(scaled))

    @cached_property
    def before(self) -> Record:
        """The scaled seed."""
        return self.seed.scaled(self.factor)

    @cached_property
    def measures(self) -> tuple[Measures, Measures]:
        """Of the match, and of the scaled seed."""
        return measure(self.record), measure(self.before)

    @cached_property
    def motions(self) -> tuple[Motion, Motion]:
        """Velocities and displacements of the ground, of the match and of the scaled seed."""
        return integrate(self.record), integrate(self.before)

    def _headline(self) -> str:
        return (
            f"of {self.seed.source} {self.seed.component}: largest misfit {100.0 * self.largest_misfit:.2g} %, "
            f"mean {100.0 * self.mean_misfit:.2g} %, change {self.change:.2g} of the motion"
        )


def match(
    record: AnyRecord,
    target: TargetSpectrum | str,
    *,
    periods: tuple[float, float] = (0.05, 4.0),
    damping: float = SA_DAMPING,
) -> Match:
    """Bring the spectrum of a motion to a target by the least change.

    Parameters
    ----------
    record : Record, str, Path or ObsPy trace
        The seed.
    target : TargetSpectrum or str
        A file of a spectrum, or the text of a design spectrum (`tdint.analysis.spectra.target.read_target`).
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
    seed, damping = record_of(record), damping_of(damping)
    aim = read_target(target) if isinstance(target, str) else target
    shortest, longest = periods
    if not 0.0 < shortest < longest < math.inf:
        raise UsageError(f"the range of periods must rise from a positive number, got {shortest:g} to {longest:g} s")
    if seed.acceleration.size < 100 or not np.any(seed.acceleration) or not damping > 0.0:
        raise UsageError("a motion is matched that has some acceleration and 100 samples at least, with some damping")
    if aim.damping is not None and abs(aim.damping - damping) > 1e-9:
        raise UsageError(
            f"{aim.source}: is for {100.0 * aim.damping:g} % damping, the spectra of the motion for "
            f"{100.0 * damping:g} %"
        )
    checked = np.geomspace(shortest, longest, CHECKED)
    wanted = aim.at(checked)
    before = spectrum(seed, checked, damping).psa
    factor = float(np.exp(np.mean(np.log(wanted / before))))
    start = factor * seed.acceleration
    # Match at the first periods, then let those join that are worst in between, until all are near.
    places = np.geomspace(shortest, longest, _FIRST)
    motion, multiplied, best, least = start, np.zeros(start.size), start, np.inf
    for stage in range(_STAGES + 1):
        problem = _Problem.of(seed, places, wanted=aim.at(places), damping=damping)
        motion, multiplied = problem.rounds(start, motion, multiplied, _ROUNDS[stage], first=stage == 0)
        off = spectrum(replace(seed, acceleration=motion), checked, damping).psa / wanted - 1.0
        if (largest := float(np.max(np.abs(off)))) < least:
            best, least = motion, largest
        if least < _ENOUGH:
            break
        size = np.abs(off)
        worst = (size > _ENOUGH) & (size >= np.roll(size, 1)) & (size >= np.roll(size, -1))
        joining = [period for period in checked[worst] if np.min(np.abs(np.log(places / period))) > 0.003]
        places = np.sort(np.concatenate([places, joining]))
    if not least < float(np.max(np.abs(factor * before / wanted - 1.0))):
        best = start  # never a motion that is worse than its seed
    words = f"matched to {aim.source} from {shortest:g} to {longest:g} s, {100.0 * damping:g} % damping"
    matched = replace(seed, acceleration=best, processing=(*seed.processing, words), peaks=(None, None), compared=())
    psa = spectrum(matched, checked, damping).psa
    return Match(matched, seed, factor, aim, checked, psa, factor * before, damping)


@dataclass
class _Problem:
    """A motion's samples, the periods at which it is matched, and what a change may be made of."""

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

    @classmethod
    def of(cls, seed: Record, periods: Array, *, wanted: Array, damping: float) -> _Problem:
        """Put it together."""
        from scipy.fft import next_fast_len

        a, dt, omega = seed.acceleration, seed.dt, 2.0 * np.pi / periods
        parts = 2.0 ** np.ceil(np.log2(np.maximum(1.0, omega * dt / 0.5)))
        table = recursion_table(omega, dt / parts, damping, 2)
        table[BY_DISPLACEMENT], table[BY_VELOCITY] = omega**2, 2.0 * damping * omega
        window = np.hanning(2 * max(int(_WINDOW / dt), 1) + 1)
        envelope = np.sqrt(np.maximum(np.convolve(a * a, window / window.sum(), "same"), 0.0))[: a.size]
        low, high = 0.6 / periods[-1], min(1.5 / periods[0], 0.45 / dt)
        size = next_fast_len(a.size + int(3.0 / low / dt), real=True)
        f = np.maximum(np.fft.rfftfreq(size, dt), 1e-12)
        band = 1.0 / np.sqrt((1.0 + (low / f) ** _ORDER) * (1.0 + (f / high) ** _ORDER))
        band *= np.minimum(f / _CORNER, 1.0)
        band[0] = 0.0
        left = np.arange(a.size - 1, -1, -1.0)  # what a sample does to the last velocity and displacement
        ends = np.stack([np.full(a.size, dt), dt * dt * left])
        return cls(dt, wanted, omega, damping, parts, table, envelope / envelope.max(), band, size, ends)

    def filtered(self, rows: NDArray[np.floating[Any]]) -> Array:
        """Rows of samples, through the band, in single precision where they are."""
        from scipy.fft import irfft, rfft

        n, band = rows.shape[-1], self.band.astype(rows.dtype)
        return np.asarray(irfft(rfft(rows, self.size) * band, self.size)[..., :n])

    def extremes(self, motion: Array, level: Array) -> tuple[Array, Array]:
        """Extremes above a level, rows WHO, WHEN, VALUE; the largest of each oscillator, and its place among them."""
        found, largest = np.empty((3, 400 * level.size)), np.empty((2, level.size))
        kernel = extremes.variant(EVERYTHING)
        count = kernel(np.array(motion), self.dt, self.parts, self.table, level, found, largest)
        largest[0] = np.maximum(largest[0], np.finfo(float).tiny)  # of what does not move: ln of nothing is none
        return found[:, :count], largest

    def rows(self, who: Array, when: Array, n: int) -> Array:
        """Derivatives of pseudo-accelerations at a moment with respect to the samples, through band and envelope.

        A sample changes the ground by a hat. The response at a moment to it is that of an oscillator to the second
        difference of a ramp, in closed form.
        """
        result, w, z, dt = np.zeros((who.size, n), np.float32), self.omega[who], self.damping, self.dt
        damped = w * math.sqrt(1.0 - z * z)

        def ramp(t: Array, k: int) -> Array:
            """Displacement over -g for a ground acceleration t / dt from rest, 0 before."""
            t = np.maximum(t, 0.0)
            c = 2.0 * z / (w[k] ** 3 * dt)
            free = c * np.cos(damped[k] * t)
            free += (c * z * w[k] - 1.0 / (w[k] ** 2 * dt)) / damped[k] * np.sin(damped[k] * t)
            return np.asarray(-(t / dt) / w[k] ** 2 + c - np.exp(-z * w[k] * t) * free)

        for k in range(who.size):
            # Samples from those of which nothing is left to the one after the moment
            last = min(int(when[k] / dt) + 2, n)
            begin = max(0, last - 3 - int(_FORGOTTEN / (z * w[k] * dt)))
            values = ramp(when[k] - dt * np.arange(begin - 1, last + 1), k)
            result[k, begin:last] = w[k] ** 2 * (values[:-2] - 2.0 * values[1:-1] + values[2:])
        return self.filtered(result) * self.envelope.astype(np.float32)

    def rounds(self, start: Array, motion: Array, multiplied: Array, most: int, *, first: bool) -> tuple[Array, Array]:
        """The motion after some rounds, and what the band and the envelope make its change of."""
        damped, stepwise = _DAMPED if first else _POLISHED, not first
        ends = self.filtered(self.ends) * self.envelope
        found, largest = self.extremes(motion, _NEAR * self.wanted)
        merit = float(np.sum(np.log(largest[0] / self.wanted) ** 2))
        best, least = (motion, multiplied), float(np.max(np.abs(largest[0] / self.wanted - 1.0)))
        for number in range(most):
            misfit = float(np.max(np.abs(largest[0] / self.wanted - 1.0)))
            if misfit < least:
                best, least = (motion, multiplied), misfit
            if misfit < 0.5 * _ENOUGH:
                break
            if np.any(largest[1] < 0.0):
                found, largest = self.extremes(motion, np.minimum(_NEAR * self.wanted, 0.9999 * largest[0]))
            # The largest of each period is to be the target, others above `_NEAR` of it no more than that.
            who, size = found[WHO].astype(int), np.abs(found[VALUE])
            equal = np.zeros(who.size, bool)
            known = largest[1] >= 0.0  # an oscillator that the motion does not move has none
            equal[largest[1, known].astype(int)] = True
            relative = np.where(equal, np.inf, size / self.wanted[who])
            cut = max(_NEAR, np.sort(relative)[-min(int(_MOST * self.omega.size), relative.size)])
            held = np.flatnonzero(equal | (relative >= min(cut, 1.0)))
            who, equal = who[held], equal[held]
            short = np.clip(1.0 - size[held] / self.wanted[who], -_CLIP, _CLIP)
            short = np.where(equal | (short < 0.0), short, 1.0 - size[held] / self.wanted[who])
            table = np.vstack([self.rows(who, found[WHEN, held], motion.size), ends.astype(np.float32)])
            table[: who.size] *= (np.sign(found[VALUE, held]) / self.wanted[who]).astype(np.float32)[:, None]
            short = np.concatenate([short, -self.ends @ (motion - start)])
            equal = np.concatenate([equal, [True, True]])
            gram = (table @ table.T).astype(np.float64)
            scales = 1.0 / np.sqrt(np.maximum(np.diagonal(gram), 1e-300))
            gram *= scales[:, None] * scales
            if not stepwise and (misfit < _STEPWISE or 2 * number > most):
                stepwise, damped = True, min(damped, _POLISHED)
            toward = short if stepwise else short + table @ multiplied
            if stepwise:
                _exchange(gram, toward * scales, equal, damped, who, scales)
            tried = 0
            for tried in range(6):  # noqa: B007
                multipliers = scales * program(gram, toward * scales, equal, damped)
                update = multipliers @ table - (0.0 if stepwise else 1.0) * multiplied
                change = self.filtered(self.envelope * update)
                new_found, new_largest = self.extremes(motion + change, _NEAR * self.wanted)
                new_merit = float(np.sum(np.log(new_largest[0] / self.wanted) ** 2))
                if new_merit < merit:
                    break
                damped *= 4.0
            motion, multiplied = motion + change, multiplied + update
            found, largest, merit = new_found, new_largest, new_merit
            damped = max(damped / 5.0, _LEAST) if tried == 0 else damped
        misfit = float(np.max(np.abs(largest[0] / self.wanted - 1.0)))
        return (motion, multiplied) if misfit < least else best


def _exchange(gram: Array, short: Array, equal: Bools, damped: float, who: Array, scales: Array) -> None:
    """Where another extreme of a period comes nearer to its target than the largest one, it becomes the equality."""
    for _ in range(2):
        left = (short - gram @ program(gram, short, equal, damped)) / scales
        changed = False
        for place in np.flatnonzero(equal[: who.size] & (left[: who.size] > _ENOUGH)):
            others = np.flatnonzero((who == who[place]) & ~equal[: who.size])
            if others.size and left[nearest := others[np.argmin(left[others])]] < 0.7 * left[place]:
                equal[place], equal[nearest], changed = False, True, True
        if not changed:
            return


def program(gram: Array, short: Array, equal: Bools, damped: float) -> Array:
    """Multipliers l of the least l' (G + damped) l / 2 - short' l, of inequalities (not `equal`) none above 0.

    A primal-dual active set: those above 0 leave it, those whose bound is passed join.
    """
    from scipy.linalg import cho_factor, cho_solve

    active, result = equal | (short < 0.0), np.zeros(short.size)
    slack = 1e-3 * float(np.median(np.abs(short[equal])))
    for _ in range(20):
        places = np.flatnonzero(active)
        part = gram[np.ix_(places, places)]
        part[np.diag_indices(places.size)] += damped
        try:
            factors = cho_factor(part, check_finite=False)
        except np.linalg.LinAlgError:
            damped = max(10.0 * damped, 1e-5)
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
