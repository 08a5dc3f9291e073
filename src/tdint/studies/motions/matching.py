"""Spectral matching of ground motions by the smallest change.

The response of an oscillator is linear in the samples of the motion. The change d with the minimum
norm d' P^-1 d is computed for which the maximum response at each period equals the target, and the
other extremes above 0.8 times the target do not exceed it. This is a small quadratic program in
multipliers, d = P H' lambda. The rows of H are the derivatives of the extremes with respect to the
samples: the impulse responses of the oscillators, reversed in time from the time of the extreme.
P = F E^2 F, with the envelope E of the record, so that quiet parts remain quiet, and a band-pass
filter F for the periods. Two more rows preserve the final velocity and displacement of the ground.
The program is solved repeatedly (in rounds), because the extremes move. Far from the target each
round computes the complete change from the scaled seed; close to the target rounds add to the
change. Periods between the matched periods are added where the misfit is largest (after Hancock et
al. 2006; Al Atik and Abrahamson 2010; Grant and Diaferia 2013).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from tdint.arrays import Array, immutable
from tdint.errors import UsageError
from tdint.ground_motion.measures import Measures, Motion, integrate, measure
from tdint.ground_motion.origin import MotionOrigin, change_text
from tdint.ground_motion.processing_steps import pad
from tdint.ground_motion.reading.suites import GroundMotion, components
from tdint.ground_motion.record import Record
from tdint.response.arguments import AnyMotion, damping_of, is_list, motion_of
from tdint.response.spectra.elastic import SA_DAMPING, SAMPLES, spectrum
from tdint.response.spectra.rotated import rotated_spectrum
from tdint.response.spectra.target import TargetSpectrum, read_targets, source_of
from tdint.studies.motions import matching_problem
from tdint.studies.motions.intensity import pseudo_accelerations
from tdint.tabular import Progress, Tabular, progress_reporter

CHECKED = 1000
"""Number of checked periods, in equal ratios, for the misfit of a match."""

_FIRST_PERIODS = 130
"""Number of periods that are matched in the first stage."""

_STAGES, _MAX_ROUNDS = 4, (12, 6, 6, 8, 8)
"""`_STAGES` is the maximum number of stages after the first. Each of these stages also matches the
periods with the largest misfits of the previous stage. `_MAX_ROUNDS` is the maximum number of
rounds of each stage, including the first."""

_FIGURE_PERIODS, _SHORTEST_RESOLVED = 200, 5.0
"""Number of periods of a figure, and shortest period of a figure in sampling intervals. At shorter
periods the spectrum depends on the interpolation of the motion between samples."""

_COUNTED_INTERVALS, _LATER = 20.0, 1.02
"""Shortest period in sampling intervals, and ratio of the maximum of the response to its maximum at
the samples, for a maximum after the last sample. A maximum between the samples is at most 1.012
times as large."""

_MEAN_WEIGHT = 4.0
"""Weight of the mean misfit in the score by which the best motion is selected (`_score`). The
maximum misfit has the weight 1, because it is about four times as large as the mean misfit."""


@immutable
class Match(Tabular):
    """Ground motion with a spectrum that was matched to a target.

    Attributes
    ----------
    record, seed : Record or Horizontals
        Matched motion; original motion.
    factor : float
        Scale factor of the seed.
    target : TargetSpectrum
        Target spectrum.
    periods, psa, seed_psa : ndarray, shape (CHECKED,)
        Periods, s; pseudo-accelerations of the match and of the scaled seed (RotD100 for pairs),
        m/s^2.
    damping : float
        Damping ratio.
    further : tuple of Match
        Spectra and targets of the same motion for the remaining damping ratios.
    """

    record: GroundMotion
    seed: GroundMotion
    factor: float
    target: TargetSpectrum
    periods: Array
    psa: Array
    seed_psa: Array
    damping: float
    further: tuple[Match, ...] = ()

    @property
    def by_damping(self) -> tuple[Match, ...]:
        """The match at each damping ratio, in the requested order."""
        return (self, *self.further)

    @property
    def misfit(self) -> Array:
        """Pseudo-acceleration over the target minus 1, at each period."""
        return np.asarray(self.psa / self.target.at(self.periods) - 1.0)

    @property
    def largest_misfit(self) -> float:
        """Maximum absolute misfit over the periods."""
        return float(np.max(np.abs(self.misfit)))

    @property
    def mean_misfit(self) -> float:
        """Mean absolute misfit over the periods."""
        return float(np.mean(np.abs(self.misfit)))

    @property
    def change(self) -> float:
        """Root mean square of the change relative to the scaled seed."""
        matched, seed = (
            np.array([record.acceleration for record in components(motion)])
            for motion in (self.record, self.seed)
        )
        scaled_seed = self.factor * seed
        return float(np.linalg.norm(matched - scaled_seed) / np.linalg.norm(scaled_seed))

    @property
    def parts(self) -> tuple[Match, ...]:
        """One match per component of a pair, with the spectra of the pair; otherwise this match."""
        if isinstance(self.record, Record):
            return (self,)
        component_pairs = zip(components(self.record), components(self.seed), strict=True)
        return tuple(
            replace(self, record=record, seed=seed, further=()) for record, seed in component_pairs
        )

    def origin(self, warnings: Sequence[str] = ()) -> MotionOrigin:
        """Return the origin of the matched motion (of a pair: of its first component) for its file.

        Parameters
        ----------
        warnings : sequence of str
            Warnings about the match. Default: none.
        """
        return MotionOrigin(
            seed=components(self.seed)[0].source,
            seed_component=components(self.seed)[0].component,
            processing=self.after.processing,
            target=source_of([match.target for match in self.by_damping]),
            factor=self.factor,
            change=self.change,
            largest_misfit=max(match.largest_misfit for match in self.by_damping),
            mean_misfit=float(np.mean([match.mean_misfit for match in self.by_damping])),
            warnings=tuple(warnings),
        )

    @property
    def after(self) -> Record:
        """Matched motion (of a pair: its first component)."""
        return components(self.record)[0]

    @cached_property
    def before(self) -> Record:
        """Scaled seed (of a pair: its first component)."""
        return components(self.seed)[0].scaled(self.factor)

    @cached_property
    def measures(self) -> tuple[Measures, Measures]:
        """Intensity measures of the matched motion and of the scaled seed (first component)."""
        return measure(self.after), measure(self.before)

    @cached_property
    def motions(self) -> tuple[Motion, Motion]:
        """Ground velocities and displacements of match and scaled seed (first component)."""
        return integrate(self.after), integrate(self.before)

    @cached_property
    def directions(self) -> tuple[tuple[float, float], tuple[float, float]] | None:
        """Mean ratio of RotD100 to RotD50, and correlation between the two components.

        The first tuple contains both values of the matched pair, the second the values of its seed.
        The property is `None` for a single component.
        """
        values = []
        for motion in (self.record, self.seed):
            if isinstance(motion, Record):
                return None
            rotd50, rotd100 = rotated_spectrum(
                motion, self.periods[::10], self.damping, [50, 100]
            ).psa
            first, second = components(motion)
            correlation = np.corrcoef(first.acceleration, second.acceleration)[0, 1]
            values.append((float(np.mean(rotd100 / rotd50)), float(correlation)))
        return values[0], values[1]

    @property
    def shown_periods(self) -> Array:
        """Periods of a figure, s, in equal ratios.

        They extend from half of the shortest matched period to twice the longest matched period.
        Periods below five sampling intervals are omitted unless they are matched.
        """
        dt = components(self.record)[0].dt
        shortest = max(0.5 * self.periods[0], min(_SHORTEST_RESOLVED * dt, self.periods[0]))
        return np.geomspace(shortest, 2.0 * self.periods[-1], _FIGURE_PERIODS)

    def spectra_at(self, periods: Array) -> list[tuple[Array, Array]]:
        """Return pseudo-accelerations after the match and of the scaled seed, m/s^2.

        The first entry is the motion (RotD100 for a pair); the components of a pair follow.

        Parameters
        ----------
        periods : ndarray, shape (k,)
            Periods, s.
        """
        motions = [(self.record, self.seed)]
        if not isinstance(self.record, Record):
            motions += zip(components(self.record), components(self.seed), strict=True)
        return [
            (
                _spectra(matched, periods, (self.damping,))[0],
                self.factor * _spectra(seed, periods, (self.damping,))[0],
            )
            for matched, seed in motions
        ]

    def _headline(self) -> str:
        misfits = [
            f"largest misfit {100.0 * spectrum.largest_misfit:.2g} %, mean "
            f"{100.0 * spectrum.mean_misfit:.2g} %"
            + (f" at {100.0 * spectrum.damping:g} % damping" if self.further else "")
            for spectrum in self.by_damping
        ]
        text = (
            f"of {self.seed.name}: {'; '.join(misfits)}, change "
            f"{change_text(self.change)} of the scaled seed (root mean square)"
        )
        if self.directions:
            (ratio, correlation), (ratio_before, correlation_before) = self.directions
            text += (
                f", RotD100 over RotD50 {ratio_before:.3g} before and {ratio:.3g} after, "
                f"correlation of the components {correlation_before:.2f} and {correlation:.2f}"
            )
        return text


def match(
    motion: AnyMotion,
    target: TargetSpectrum | str | Sequence[TargetSpectrum],
    *,
    periods: tuple[float, float] = (0.05, 4.0),
    damping: float | Sequence[float] = SA_DAMPING,
    progress: bool | Progress = False,
) -> Match:
    """Match the spectrum of a motion (RotD100 for a pair) to a target by the smallest change.

    Parameters
    ----------
    motion : Record, Horizontals, str, Path, ObsPy trace, or tuple of two of them
        Seed. Both components of a pair are changed together, with a common factor.
    target : TargetSpectrum, str, or sequence of TargetSpectrum
        File of a spectrum, or text of a design spectrum
        (`tdint.response.spectra.target.read_target`). For several damping ratios: a file with the
        column `damping`, a spectrum of Eurocode 8, or a sequence with a spectrum per ratio.
    periods : tuple of two floats
        Range of periods to be matched, s; default 0.05 to 4.
    damping : float or sequence of float
        Damping ratios of the spectra; default 0.05. The motion is matched at all these ratios
        together.
    progress : bool or callable, default False
        True for a progress bar by tqdm on a terminal or in a notebook, or a function that receives
        the number of completed stages and the maximum number of stages.

    Returns
    -------
    Match
        The motion is the scaled seed if no change reduces the misfit. `psa` belongs to the first
        damping ratio, `further` contains the remaining ratios.

    Raises
    ------
    UsageError
        The range is invalid or exceeds the range of the target, or the motion is too short.
    AnalysisError
        The sampling interval does not resolve the periods, or the motion has no acceleration.
    ModelError
        The target spectrum cannot be read.
    RecordError
        The record is invalid or cannot be read.
    """
    match_target = _MatchTarget.of(target, periods, damping)
    seed = _continued(motion_of(motion), match_target)
    with progress_reporter(progress, _STAGES + 1, "stage") as report_progress:
        return _match_seed(
            seed,
            match_target,
            _spectra(seed, match_target.checked, match_target.dampings),
            lambda completed: report_progress(completed, _STAGES + 1),
        )


def match_suite(
    motions: Sequence[AnyMotion],
    target: TargetSpectrum | str | Sequence[TargetSpectrum],
    *,
    periods: tuple[float, float] = (0.05, 4.0),
    damping: float | Sequence[float] = SA_DAMPING,
    factors: Sequence[float] | None = None,
    progress: bool | Progress = False,
) -> list[Match]:
    """Match the mean spectrum of a suite to a target, and preserve the scatter of the spectra.

    Each motion is matched to a separate target: its scaled spectrum times the ratio of the target
    to the mean of all scaled spectra.

    Parameters
    ----------
    motions : sequence
        Seeds, as in `match`.
    target, periods, damping, progress
        As in `match`; `progress` receives the stages of all motions.
    factors : sequence of float, optional
        Scale factor of each seed, as returned by `tdint.scale`; default by least squares of ln Sa.

    Returns
    -------
    list of Match
        One match per seed, in order, with the target of the seed.

    Raises
    ------
    UsageError, ModelError, AnalysisError, RecordError
        As in `match`; or the suite is empty.
    """
    if not motions:
        raise UsageError("a suite must contain at least one motion")
    match_target = _MatchTarget.of(target, periods, damping)
    seeds = [_continued(motion_of(motion), match_target) for motion in motions]
    target_psa = match_target.at(match_target.checked)
    seed_psa = [_spectra(seed, match_target.checked, match_target.dampings) for seed in seeds]
    if factors is None:
        factors = [
            float(np.exp(np.mean(np.log(target_psa / unscaled_psa)))) for unscaled_psa in seed_psa
        ]
    if len(factors) != len(seeds):
        raise UsageError(
            f"factors must contain one factor for each of {len(seeds)} motions, got {len(factors)}"
        )
    scaled_psa = [
        abs(factor) * unscaled_psa for factor, unscaled_psa in zip(factors, seed_psa, strict=True)
    ]
    # Each scaled spectrum is multiplied by this ratio, so that the mean equals the target.
    ratio = target_psa / np.mean(scaled_psa, axis=0)
    stages = _STAGES + 1
    matches: list[Match] = []
    with progress_reporter(progress, len(seeds) * stages, "stage") as report_progress:

        def report_stage(completed: int) -> None:
            """Report the completed stages of the motion and of all previous motions."""
            report_progress(len(matches) * stages + completed, len(seeds) * stages)

        for seed, psa_of_seed, unscaled_psa in zip(seeds, scaled_psa, seed_psa, strict=True):
            own_target = match_target.with_spectra(psa_of_seed * ratio, len(seeds))
            matches.append(_match_seed(seed, own_target, unscaled_psa, report_stage))
    return matches


@dataclass(frozen=True)
class _MatchTarget:
    """Target spectra, one per damping ratio, and the checked periods.

    Attributes
    ----------
    checked : ndarray, shape (CHECKED,)
        Periods for the misfit, s.
    """

    targets: tuple[TargetSpectrum, ...]
    dampings: tuple[float, ...]
    checked: Array

    @classmethod
    def of(
        cls,
        target: TargetSpectrum | str | Sequence[TargetSpectrum],
        periods: tuple[float, float],
        damping: float | Sequence[float],
    ) -> _MatchTarget:
        """Check the arguments `target`, `periods` and `damping` of `match` and combine them.

        Raises
        ------
        ModelError, UsageError
            An argument is invalid, or a target does not cover the range of periods.
        """
        ratios: Any = damping if is_list(damping) else [damping]
        dampings = tuple(map(damping_of, ratios))
        if not dampings or len(set(dampings)) < len(dampings):
            raise UsageError(
                "damping must contain distinct ratios between 0 and 1, got "
                f"{', '.join(f'{ratio:g}' for ratio in dampings) or 'none'}"
            )
        if isinstance(target, str):
            targets = read_targets(target, dampings)
        else:
            targets = (target,) if isinstance(target, TargetSpectrum) else tuple(target)
        if len(targets) != len(dampings):
            raise UsageError(
                f"target must contain a spectrum for each of {len(dampings)} damping ratios, got "
                f"{len(targets)}"
            )
        shortest, longest = periods
        if not 0.0 < shortest < longest < math.inf:
            raise UsageError(
                "the range of periods must be two positive numbers, the shortest period first, got "
                f"{shortest:g} to {longest:g} s"
            )
        for spectrum_of_target, ratio in zip(targets, dampings, strict=True):
            spectrum_of_target.check_damping(ratio, "of the motion")
        match_target = cls(targets, dampings, np.geomspace(shortest, longest, CHECKED))
        match_target.at(match_target.checked)  # raises an error outside the range of a target
        return match_target

    def at(self, periods: Array) -> Array:
        """Return the targets at periods (s), m/s^2, shape (damping ratios, k)."""
        return np.array([target.at(periods) for target in self.targets])

    def with_spectra(self, psa: Array, count: int) -> _MatchTarget:
        """Return the target of one motion in a suite of `count` motions.

        `psa` contains the pseudo-accelerations of this target at the checked periods, m/s^2.
        """
        targets = [
            TargetSpectrum(f"{target.source} in the mean of {count}", self.checked, target_psa)
            for target, target_psa in zip(self.targets, psa, strict=True)
        ]
        return replace(self, targets=tuple(targets))


def _spectra(motion: GroundMotion, periods: Array, dampings: Sequence[float]) -> Array:
    """Compute the pseudo-acceleration spectra of a motion (RotD100 for a pair) for several damping
    ratios, m/s^2, shape (damping ratios, k).

    Raises
    ------
    UsageError
        The motion has fewer than 100 samples or no acceleration, or a damping ratio is zero.
    """
    is_suitable = all(
        np.any(record.acceleration) and record.acceleration.size >= 100
        for record in components(motion)
    )
    if not (is_suitable and min(dampings) > 0.0):
        raise UsageError(
            "a motion to be matched must have at least 100 samples, an acceleration that is not "
            "zero, and a positive damping ratio"
        )
    return np.array([pseudo_accelerations(motion, periods, ratio, "rotd100") for ratio in dampings])


def _continued(seed: GroundMotion, match_target: _MatchTarget) -> GroundMotion:
    """Return a seed with zeros over half the longest period after it if the response at some period
    is largest after the last sample, so that the matching controls these peaks, too; otherwise the
    seed itself.

    At more than half of the periods, this is a trend of the motion, which `check_peaks` refuses.
    """
    first = components(seed)[0]
    periods = match_target.checked[match_target.checked >= _COUNTED_INTERVALS * first.dt]
    if not periods.size:
        return seed
    is_later = np.zeros(periods.size, dtype=bool)
    for record in components(seed):
        for ratio in match_target.dampings:
            within = spectrum(record, periods, ratio, maxima=SAMPLES.name).psa
            is_later |= spectrum(record, periods, ratio).psa > _LATER * within
    if not is_later.any() or np.mean(is_later) > matching_problem.MAX_GROWING_FRACTION:
        return seed
    duration = 0.5 * match_target.checked[-1] + first.dt
    return _with_components(seed, [pad(record, 0.0, duration) for record in components(seed)])


def _match_seed(
    seed: GroundMotion,
    match_target: _MatchTarget,
    seed_spectra: Array,
    report_stage: Callable[[int], None],
) -> Match:
    """Match a seed to target spectra; return the result for the first damping ratio, which contains
    the remaining ratios (`Match.further`).

    The factor of the scaled seed minimizes the squares of ln(spectrum / target). The best motion of
    all stages is returned, or the scaled seed if no stage reduces the misfit. `report_stage`
    receives the number of completed stages.
    """
    checked, dampings = match_target.checked, match_target.dampings
    target_psa = match_target.at(checked)
    factor = float(np.exp(np.mean(np.log(target_psa / seed_spectra))))
    scaled_seed = factor * np.array([record.acceleration for record in components(seed)])
    best_samples, best_score = _solve_stages(seed, match_target, scaled_seed, report_stage)
    if not best_score < _score(np.abs(factor * seed_spectra / target_psa - 1.0)):
        best_samples = scaled_seed
    percentages = ", ".join(f"{100.0 * ratio:g}" for ratio in dampings)
    description = (
        f"matched to {source_of(match_target.targets)} from {checked[0]:g} to {checked[-1]:g} s, "
        f"{percentages} % damping"
    )
    motion = _with_samples(seed, best_samples, description)
    matched_spectra = _spectra(motion, checked, dampings)
    report_stage(_STAGES + 1)
    results = [
        Match(motion, seed, factor, target, checked, psa, factor * seed_psa, ratio)
        for target, psa, seed_psa, ratio in zip(
            match_target.targets, matched_spectra, seed_spectra, dampings, strict=True
        )
    ]
    return replace(results[0], further=tuple(results[1:]))


def _solve_stages(
    seed: GroundMotion,
    match_target: _MatchTarget,
    scaled_seed: Array,
    report_stage: Callable[[int], None],
) -> tuple[Array, float]:
    """Match a seed in several stages, and return the best motion of all stages with its score.

    The first stage matches few periods. Each further stage adds the periods with the largest
    misfits, until all misfits are small.
    """
    checked, dampings = match_target.checked, match_target.dampings
    target_psa = match_target.at(checked)
    periods_of_ratios = [np.geomspace(checked[0], checked[-1], _FIRST_PERIODS)] * len(dampings)
    samples, row_sum = scaled_seed, np.zeros(scaled_seed.size, np.float32)
    best_samples, best_score = scaled_seed, np.inf
    for stage in range(_STAGES + 1):
        report_stage(stage)
        problem = matching_problem.MatchingProblem(
            scaled_seed,
            components(seed)[0].dt,
            np.concatenate(periods_of_ratios),
            wanted=np.concatenate(
                [
                    target.at(periods)
                    for target, periods in zip(match_target.targets, periods_of_ratios, strict=True)
                ]
            ),
            damping=np.repeat(dampings, [periods.size for periods in periods_of_ratios]),
        )
        if stage == 0:
            matching_problem.check_peaks(problem, seed, scaled_seed)
        samples, row_sum = problem.rounds(
            samples, row_sum, _MAX_ROUNDS[stage], is_first_stage=stage == 0
        )
        del problem  # the next stage must not need the memory of two sets of free vibrations
        # The misfit is checked at all checked periods, not only at the matched periods.
        matched_psa = _spectra(_with_samples(seed, samples), checked, dampings)
        misfit = np.abs(matched_psa / target_psa - 1.0)
        if (score := _score(misfit)) < best_score:
            best_samples, best_score = samples, score
        if np.max(misfit) < matching_problem.SMALL_MISFIT:
            break
        periods_of_ratios = [
            _with_worst(periods, checked, misfit_of_ratio)
            for periods, misfit_of_ratio in zip(periods_of_ratios, misfit, strict=True)
        ]
    return best_samples, best_score


def _score(misfit: Array) -> float:
    """Return the score of a motion: maximum plus weighted mean absolute misfit; small is good."""
    return float(np.max(misfit) + _MEAN_WEIGHT * np.mean(misfit))


def _with_worst(periods: Array, checked: Array, misfit: Array) -> Array:
    """Add periods with a large misfit to the matched periods of a damping ratio, at local maxima of
    the misfit above `SMALL_MISFIT`, except next to matched periods (within 0.3 %).
    """
    is_maximum = (
        (misfit > matching_problem.SMALL_MISFIT)
        & (misfit >= np.roll(misfit, 1))
        & (misfit >= np.roll(misfit, -1))
    )
    added = [
        period for period in checked[is_maximum] if np.min(np.abs(np.log(periods / period))) > 0.003
    ]
    return np.sort(np.concatenate([periods, added]))


def _with_samples(motion: GroundMotion, samples: Array, *notes: str) -> GroundMotion:
    """Return a motion with new samples, and with additional notes on its processing.

    The stated peaks and header checks of the file are removed, because they concern other samples.

    `samples` contains the new accelerations, m/s^2.
    """
    records = [
        replace(
            record,
            acceleration=component_samples,
            processing=(*record.processing, *notes),
            peaks=(None, None),
            header_checks=(),
        )
        for record, component_samples in zip(components(motion), samples, strict=True)
    ]
    return _with_components(motion, records)


def _with_components(motion: GroundMotion, records: Sequence[Record]) -> GroundMotion:
    """Return a ground motion with its one or two components replaced."""
    if isinstance(motion, Record):
        return records[0]
    return replace(motion, first=records[0], second=records[1])
