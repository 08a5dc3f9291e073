"""Select ground motions whose scaled spectra together fit a target mean and, optionally, a standard
deviation.

The score of a selection is the mean over the periods of (mean ln Sa - ln target)^2, plus half of
(standard deviation - target value)^2. Each motion has a factor (least squares of ln Sa) within
limits. A search adds the best motion repeatedly, then exchanges motions while the score decreases
(Jayaram, Lin and Baker 2011; Baker and Lee 2018). The search is repeated from many starting points.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from datetime import datetime
from itertools import chain
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from tdint.arrays import Array, Numbers
from tdint.errors import AnalysisError, UsageError
from tdint.ground_motion.duplicates import first_copies
from tdint.ground_motion.events import SAME_DATE, Earthquake, event_of, is_same_event
from tdint.ground_motion.horizontals import motion_names
from tdint.ground_motion.reading.suites import GroundMotion, components
from tdint.number_parsing import LARGEST, abbreviate, pluralize
from tdint.response.arguments import AnyMotion, motion_of
from tdint.response.spectra.elastic import SA_DAMPING
from tdint.response.spectra.target import TargetSpectrum
from tdint.studies.motions.intensity import GEOMETRIC_MEAN, pseudo_accelerations
from tdint.studies.motions.scaling import (
    BOUNDS,
    Scaling,
    check_rule,
    pair_of_rule,
    raise_to_rule,
    target_at,
)

_START_LIMITS, _EVALUATED_ROWS = (10, 200), 20_000
"""Minimum and maximum number of starting points of the search. Between these limits, it is 20 000
divided by the number of motions that can be selected. With 20 starting points, the search misses
the best selection of five in one of six pools of 16 motions."""

_SCATTER_WEIGHT = 0.5
"""Weight of the squared error of the standard deviation; the weight of the mean is 1. Baker and Lee
(2018) also use 1 and 2."""

_MAX_TRIALS, _LIMIT_REDUCTION = 40, 0.95
"""Maximum number of selections that are tried for factors within the limits. The upper limit of the
factors before the common factor is multiplied by at most 0.95 after each trial: the last limit is
about a tenth of the first."""

_ROUNDING = 1e-12
"""Relative rounding error of the product of two factors, with a margin."""

_MIN_GAIN = 1e-12
"""Minimum relative decrease of the score for an exchange; otherwise rounding errors could cause an
infinite loop."""


def select(
    motions: Sequence[AnyMotion],
    target: TargetSpectrum | str,
    count: int,
    *,
    rule: str = "mean",
    periods: Numbers | None = None,
    damping: float = SA_DAMPING,
    pair: str = GEOMETRIC_MEAN,
    factors: tuple[float, float] = BOUNDS,
    events: Sequence[object] | None = None,
    per_event: int | None = None,
    scatter: float | Numbers | None = None,
) -> Scaling:
    """Select motions whose scaled spectra together fit a target.

    Parameters
    ----------
    motions, target, periods, damping, pair
        As for `scale`.
    count : int
        Number of motions to select.
    rule : str, default "mean"
        `mean` (each motion has an individual factor within the limits), or `asce7` or `ec8`, which
        are applied to the selected motions, also if they are fewer than the code requires.
    factors : tuple of two floats, default (0.25, 4.0)
        Minimum and maximum factor. A motion that needs a factor outside of these limits is
        considered with the limit. The common factor of a rule is included.
    events : sequence, optional
        Event of each motion, empty if unknown; by default read from the files (`events_of`).
    per_event : int, optional
        Maximum number of selected motions of a single event.
    scatter : float or sequence of float, shape (k,), optional
        Target standard deviation of ln Sa, for all periods or for each period.

    Returns
    -------
    Scaling
        Scaling of the selected motions. `chosen` contains their indices in `motions`, `left_out`
        the number of motions that were not considered, by reason.

    Raises
    ------
    UsageError
        There are fewer motions or events than requested; limits, standard deviation or rule are
        invalid; `per_event` is used for motions with unknown event.
    ModelError, RecordError
        The target spectrum or a motion cannot be read.
    AnalysisError
        No selection meets the rule with factors within the limits.
    """
    low, high = factors
    if not 0.0 < low <= high < np.inf:
        raise UsageError(
            f"factors: the limits must be positive, the minimum first, got {low:g} and {high:g}"
        )
    # `True` is an instance of `int`, but not a number of motions.
    if isinstance(count, bool) or not isinstance(count, int) or count < 1:
        raise UsageError(
            "the number of motions to select must be a whole number of at least 1, got "
            f"{count!r:.60}"
        )
    if per_event is not None and per_event < 1:
        raise UsageError(f"per_event must be at least 1, got {per_event}")
    if events is not None and len(events) != len(motions):
        raise UsageError(
            f"events: must contain one event for each of {len(motions)} motions, got {len(events)}"
        )
    target_spectrum, compared_periods = target_at(target, periods, damping)
    target_scatter = _target_scatter(scatter, compared_periods, count)
    suite = [motion_of(motion) for motion in motions]
    spectrum_pair = pair_of_rule(rule, pair)
    check_rule(rule, suite, target_spectrum)
    # The pool excludes duplicates, zero motions and motions that do not resolve the periods.
    pool, spectra, excluded_counts = _pool(suite, compared_periods, damping, spectrum_pair)
    event_numbers, labels = _number_events(suite, events, per_event)
    pool_events, max_per_event = event_numbers[pool], per_event or len(suite)
    _check_pool_size(count, pool_events, event_numbers, per_event, excluded_counts)
    ln_target, ln_spectra = np.log(target_spectrum.at(compared_periods)), np.log(spectra)
    ln_fitted = np.mean(ln_target - ln_spectra, axis=1)  # ln of the factors without limits
    fitted = Scaling(
        tuple(suite[index] for index in pool),
        np.clip(np.exp(ln_fitted), low, high),
        "mean",
        spectrum_pair,
        damping,
        target=target_spectrum,
        periods=compared_periods,
    )

    def choose(factors: Array) -> list[int]:
        """Return the indices, in the pool, of the best selection if the motions of the pool have
        the given factors."""
        # ln of the scaled spectrum divided by the target, shape (motions, periods)
        deviations = ln_spectra + np.log(factors)[:, None] - ln_target
        return _search(deviations, count, target_scatter, pool_events, max_per_event)

    # A rule such as asce7 multiplies all factors of the selection by a common factor.
    if rule == "mean":
        chosen = choose(fitted.factors)
        scaling, pool_factors = _subset(fitted, chosen), fitted.factors
    else:
        chosen, scaling, pool_factors = _within_limits(fitted, rule, (low, high), choose)
    unselected = np.setdiff1d(np.arange(len(pool)), chosen)
    is_at_limit = (ln_fitted[unselected] <= np.log(low)) | (ln_fitted[unselected] >= np.log(high))
    return replace(
        scaling,
        chosen=tuple(pool[index] for index in chosen),
        left_out=excluded_counts,
        target_std=target_scatter,
        unselected_spectra=spectra[unselected] * pool_factors[unselected, None],
        events=tuple(labels[pool[index]] for index in chosen) if labels else (),
        limits=(low, high),
        others_at_limit=int(np.sum(is_at_limit)),
    )


def _number_events(
    suite: Sequence[GroundMotion], events: Sequence[object] | None, per_event: int | None
) -> tuple[NDArray[np.int64], list[str]]:
    """Return the number of the event of each motion, from 0, and the label of the event of each
    motion.

    Without `events` they are read from the files; an empty event is unknown. Without a maximum
    number of motions per event, events are not needed: each motion is a separate event and the list
    of labels is empty. UsageError is raised if the event of a motion is unknown.
    """
    if per_event is None:
        return np.arange(len(suite)), []
    labels = events_of(suite) if events is None else [str(event or "") for event in events]
    unknown = [motion.source for motion, label in zip(suite, labels, strict=True) if not label]
    if unknown:
        raise UsageError(
            f"per_event: the event of {pluralize(len(unknown), 'motion')} is unknown: "
            f"{', '.join(dict.fromkeys(unknown))}; specify the events of the files (--events "
            "FILE), or omit these files"
        )
    return np.unique(labels, return_inverse=True)[1], labels


def _check_pool_size(
    count: int,
    pool_events: NDArray[np.int64],
    event_numbers: NDArray[np.int64],
    per_event: int | None,
    excluded_counts: Mapping[str, int],
) -> None:
    """Raise UsageError if fewer motions can be selected than requested.

    The pool contains all motions that can be selected; `event_numbers` also those outside of the
    pool.
    """
    motion_count = len(event_numbers)
    # Of each event, at most `per_event` motions can be selected.
    possible_by_event = np.minimum(np.bincount(pool_events), per_event or motion_count)
    possible = int(possible_by_event.sum()) if len(pool_events) else 0
    if possible >= count:
        return
    reasons = [f"{number} {reason}" for reason, number in excluded_counts.items() if number]
    if per_event is not None:
        event_count = pluralize(int(np.max(event_numbers)) + 1, "event")
        reasons.append(f"at most {per_event} of an event, {event_count}")
    explanation = f" ({', '.join(reasons)})" if reasons else ""
    raise UsageError(
        f"{count} motions are requested, but only {possible} of {motion_count} can be selected"
        f"{explanation}; select fewer motions, or add motions"
    )


def _target_scatter(scatter: float | Numbers | None, periods: Array, count: int) -> Array | None:
    """Return the target standard deviation of ln Sa at each period; None if not specified.
    UsageError is raised if a value is negative or above `LARGEST`, or fewer than three motions are
    selected.
    """
    if scatter is None:
        return None
    values = np.broadcast_to(np.asarray(scatter, float), periods.shape)
    if count < 3 or not np.all((values >= 0.0) & (values <= LARGEST)):
        raise UsageError(
            f"a target standard deviation must be between 0 and {LARGEST:g}, and requires a "
            f"selection of at least three motions, got {scatter!r:.60} for {count} motions"
        )
    return values


def _subset(fitted: Scaling, indices: Sequence[int]) -> Scaling:
    """Return the scaling of a part of a suite, with unchanged factors. `indices` are the indices of
    its motions in `fitted.motions`."""
    motions = tuple(fitted.motions[index] for index in indices)
    return replace(fitted, motions=motions, factors=fitted.factors[list(indices)])


def _within_limits(
    fitted: Scaling, rule: str, limits: tuple[float, float], choose: Callable[[Array], list[int]]
) -> tuple[list[int], Scaling, Array]:
    """Return a selection with factors within the limits after the common factor of a rule (`asce7`
    or `ec8`): the indices of the motions, their final factors, and the factors of all motions
    before the common factor.

    The common factor of a selection may raise factors above the upper limit. In this case the
    factors of all motions are limited to a lower value, so that the search prefers stronger
    motions, until the product of this value and the common factor is within the limit.

    `fitted` contains all motions with their individual factors within the limits. `choose` returns
    the indices of the selected motions for the factors of all motions. If no selection is found,
    the AnalysisError reports the selection with the smallest maximum factor.
    """
    low, high = limits
    upper_limit = high
    nearest: Scaling | None = None
    for _trial in range(_MAX_TRIALS):
        factors = np.minimum(fitted.factors, upper_limit)
        chosen = choose(factors)
        scaling = raise_to_rule(_subset(replace(fitted, factors=factors), chosen), rule)
        max_factor = float(np.max(scaling.factors))
        if max_factor <= high * (1.0 + _ROUNDING):
            limited = replace(scaling, factors=np.minimum(scaling.factors, high))
            return chosen, limited, factors
        if nearest is None or max_factor < float(np.max(nearest.factors)):
            nearest = scaling
        # If the upper limit is at or below the smallest individual factor, all limited factors are
        # equal to this limit. A lower limit would only be compensated by a higher common factor.
        if upper_limit <= float(np.min(fitted.factors)):
            break
        # The final factors are the limited factors times the common factor of the rule. With the
        # limit `high` divided by the present common factor, the final factors would be at most
        # `high` for an equal common factor. The next common factor may be larger, so that the limit
        # is always reduced by at least 5 % (`_LIMIT_REDUCTION`).
        common_factor = max_factor / float(np.max(factors[chosen]))
        upper_limit = max(
            min(high / common_factor, upper_limit * _LIMIT_REDUCTION), float(np.min(fitted.factors))
        )
    assert nearest is not None
    outside_text = abbreviate(
        [f"{name} {factor:.4g}" for name, factor in nearest.beyond(low, high)], 5
    )
    # Round the proposed limit up to four decimals, so that the factor is within it.
    required_factor = math.ceil(1e4 * float(np.max(nearest.factors))) / 1e4
    raise AnalysisError(
        f"no selection of {len(nearest.motions)} motions with factors from {low:g} to {high:g} "
        f"meets the rule {rule}; the nearest selection needs factors up to {required_factor:g}: "
        f"{outside_text}; set the limits to {low:g}:{required_factor:g}, or add stronger motions. "
        f"The nearest selection: {', '.join(motion.source for motion in nearest.motions)}"
    )


def events_of(motions: Sequence[GroundMotion]) -> list[str]:
    """Return the label of the earthquake (event) of each motion, from the headers of its files.
    Motions of the same event have equal labels.

    Both components of a recording belong to the same event, whether they are a pair or two files
    with similar names.

    Returns
    -------
    list of str
        Name and date of the event of each motion; empty if the event is unknown.
    """
    from scipy.cluster.hierarchy import DisjointSet  # imported here, because it needs 90 ms

    events = [_event_of_motion(motion) for motion in motions]
    groups = DisjointSet(range(len(events)))  # groups of the indices of motions

    def unite_if_same_event(motion: int, other_motion: int) -> None:
        """Merge the groups of two motions if their headers may describe the same event."""
        if is_same_event(events[motion], events[other_motion]):
            groups.merge(motion, other_motion)

    # Unite motions with the same event in their headers. `first_motions` contains the first motion
    # of each distinct known event.
    first_motions: dict[Earthquake, int] = {}
    for motion, event in enumerate(events):
        if event.is_known:
            groups.merge(motion, first_motions.setdefault(event, motion))
    # Unite motions of the same recording. Files with similar names may contain several recordings:
    # a motion with a known event is united only with a motion of the same event. In a second pass,
    # motions without a known event join the group of their recording.
    motion_of_recording: dict[str, int] = {}
    recordings = _recordings(motions)
    for is_known in (True, False):
        unite = unite_if_same_event if is_known else groups.merge
        for motion, names in enumerate(recordings):
            if events[motion].is_known is is_known:
                for name in names:
                    unite(motion, motion_of_recording.setdefault(name, motion))
    # Unite motions with headers that describe the same event differently, for example with and
    # without the time of day. Compare each pair of distinct descriptions. Two descriptions with a
    # time are compared only if the times are close; in chronological order, these are neighbors.
    # Descriptions without a time are the first, and are compared with all others.
    described = sorted(
        first_motions.values(), key=lambda motion: events[motion].time or datetime.min
    )
    for rank, motion in enumerate(described):
        for other_motion in described[rank + 1 :]:
            earlier, later = events[motion].time, events[other_motion].time
            if earlier and later and later - earlier > 2 * SAME_DATE:
                break
            unite_if_same_event(motion, other_motion)
    # The label of a group is the label of its first motion with a known event.
    label_of_group: dict[int, str] = {}
    for motion, event in enumerate(events):
        if event.is_known:
            label_of_group.setdefault(groups[motion], event.label)
    return [label_of_group.get(groups[motion], "") for motion in range(len(events))]


def named_events(motions: Sequence[GroundMotion], event_of_file: Mapping[str, str]) -> list[str]:
    """Return the event of each motion, which a table of the user specifies for its files.

    If the two components of a recording are in two files, it is sufficient that the table contains
    one of the files.

    Parameters
    ----------
    event_of_file : mapping of str to str
        The event of each file. A file is named by its path, its name or its name without suffix.

    Returns
    -------
    list of str
        Event of each motion; empty if the table does not contain its files.

    Raises
    ------
    UsageError
        The two components of a recording have different events.
    """
    recordings = _recordings(motions)
    file_and_event: dict[str, tuple[str, str]] = {}
    for motion, names in zip(motions, recordings, strict=True):
        files = dict.fromkeys(record.source for record in components(motion))
        for file, name in zip(files, names, strict=True):
            keys = (file, Path(file).name, Path(file).stem)
            event = next((event_of_file[key] for key in keys if event_of_file.get(key)), "")
            # `name` is the recording of the file. If its other component already has an event, both
            # events must be equal.
            first_file, first_event = file_and_event.get(name, (file, event))
            if event and event != first_event:
                raise UsageError(
                    f"{first_file} and {file} are components of one recording, but their events "
                    f"differ: {first_event!r} and {event!r}; specify the same event for both files"
                )
            if event:
                file_and_event[name] = (file, event)
    event_of_recording = {name: event for name, (_, event) in file_and_event.items()}
    return [
        next((event_of_recording[name] for name in names if name in event_of_recording), "")
        for names in recordings
    ]


def _recordings(motions: Sequence[GroundMotion]) -> list[list[str]]:
    """Return the names of the recordings to which the files of each motion belong: one name per
    file, equal for files of the same recording. The two components of a recording may be in one
    file or in two files.
    """
    # Distinct files of each motion: one, or two for a pair in two files
    files_by_motion = [
        list(dict.fromkeys(record.source for record in components(motion))) for motion in motions
    ]
    named_files = list(dict.fromkeys(filter(None, chain.from_iterable(files_by_motion))))
    recording_of_file = dict(zip(named_files, motion_names(named_files), strict=True))
    # Motions that were not read from files have no name; each is a different recording.
    return [
        [recording_of_file.get(file, f"motion {index}") for file in files]
        for index, files in enumerate(files_by_motion)
    ]


def _event_of_motion(motion: GroundMotion) -> Earthquake:
    """Return the event of a motion; for a pair, the event of the component with the most complete
    header."""
    # Prefer a header with date and time of day, then with a date, then with the name of the event.
    events = [event_of(record) for record in components(motion)]
    return max(events, key=lambda event: (event.has_clock, bool(event.time), bool(event.name)))


def _pool(
    motions: Sequence[GroundMotion], periods: Array, damping: float, pair: str
) -> tuple[list[int], Array, dict[str, int]]:
    """Return the indices of the motions that can be selected, their spectra (m/s^2, one row per
    motion), and the number of motions that cannot be selected, by reason.

    The reasons are `duplicate` (a copy of another motion, `tdint.ground_motion.duplicates`), `range
    of periods` (the sampling interval
    is too long for a period) and `zero` (a component without motion).
    """
    excluded_counts = {"duplicate": 0, "range of periods": 0, "zero": 0}
    indices, spectra = [], []
    originals = first_copies([components(motion) for motion in motions])
    for index, motion in enumerate(motions):
        if originals[index] != index:
            excluded_counts["duplicate"] += 1
            continue
        if not all(np.any(record.acceleration) for record in components(motion)):
            excluded_counts["zero"] += 1
            continue
        try:
            spectra.append(pseudo_accelerations(motion, periods, damping, pair))
        except AnalysisError:  # a period is too short for the sampling interval
            excluded_counts["range of periods"] += 1
            continue
        indices.append(index)
    return indices, np.array(spectra).reshape(-1, len(periods)), excluded_counts


def _search(
    deviations: Array,
    count: int,
    target_scatter: Array | None,
    events: NDArray[np.int64],
    max_per_event: int,
) -> list[int]:
    """Search for the selection of `count` motions with the minimum score.

    A deviation is the ln of the scaled spectrum divided by the target, for each motion (row) and
    period. The first starting point is the best single motion; later starting points alternate
    between half of the present best selection and random motions.

    A selection with `count` rows must exist, as `_check_pool_size` checks. A row can then always be
    added to an incomplete selection.
    """
    # A fixed seed makes the selection reproducible.
    generator, best_selection, best_score = np.random.default_rng(0), list[int](), np.inf
    # scores(selection, size) returns one score per row: the score of `selection` with this row in
    # addition, infinite if the row cannot be added. `size` is the number of rows with the addition.
    scores = _scores_with_row(deviations, target_scatter, events, max_per_event)
    start_count = int(np.clip(_EVALUATED_ROWS // len(deviations), *_START_LIMITS))
    for start_number in range(start_count):
        selection: list[int] = []
        if start_number % 2:
            selection = generator.permutation(best_selection)[: count // 2].tolist()
        elif start_number:
            while len(selection) < count:
                # Rows that cannot be added have an infinite score. The size 2 saves time: `scores`
                # then omits the standard deviation, which is always finite.
                possible_rows = np.flatnonzero(np.isfinite(scores(selection, 2)))
                selection.append(int(generator.choice(possible_rows)))
        while len(selection) < count:
            selection.append(int(np.argmin(scores(selection, len(selection) + 1))))
        # Exchange rows as long as the score decreases. Each pass tries to replace every row. The
        # first pass sets the score, which is infinite before.
        score, is_improved = np.inf, True
        while is_improved:
            is_improved = False
            for index in range(count):
                remaining = selection[:index] + selection[index + 1 :]
                all_scores = scores(remaining, count)
                best_row = int(np.argmin(all_scores))
                if all_scores[best_row] < score * (1.0 - _MIN_GAIN):
                    is_improved |= best_row != selection[index]
                    selection[index], score = best_row, float(all_scores[best_row])
        if score < best_score:
            best_selection, best_score = sorted(selection), score
    return best_selection


def _scores_with_row(
    deviations: Array, target_scatter: Array | None, events: NDArray[np.int64], max_per_event: int
) -> Callable[[list[int], int], Array]:
    """Return a function that computes the scores of selections of motions with one additional
    motion (row); a lower score is a better fit to the target.

    Parameters
    ----------
    deviations : ndarray, shape (n, k)
        ln of the scaled spectrum divided by the target, for each motion (row) and period.
    target_scatter : ndarray, shape (k,), or None
        Target standard deviation of ln Sa.
    events : ndarray of int, shape (n,)
        Event of each row.
    max_per_event : int
        Maximum number of rows of a single event.
    """
    # Squared deviations and their sums over the periods, and an array for intermediate results
    squares, period_count = deviations * deviations, deviations.shape[1]
    row_sums, scratch = squares.sum(axis=1), np.empty_like(deviations)

    def with_row(selected: list[int], size: int) -> Array:
        """Return, for each row, the score of the selected rows and this additional row; infinite if
        the row cannot be added.

        `size` is the number of rows including the additional row. The standard deviation is part of
        the score only for more than two rows.
        """
        total = deviations[selected].sum(axis=0)
        # For each row, the mean over the k periods of (mean deviation)^2 is the sum over the
        # periods of (total + row)^2, divided by size^2 k.
        result = (total @ total + 2.0 * (deviations @ total) + row_sums) / (size**2 * period_count)
        if target_scatter is not None and size > 2:
            # For each row and period, compute sqrt(size - 1) times the standard deviation, from
            # (size - 1) variance = sum of squares - (total + row)^2 / size. Then subtract its
            # target. All operations are in place, because this function needs most of the time.
            np.add(deviations, total, out=scratch)
            np.multiply(scratch, scratch, out=scratch)
            np.multiply(scratch, -1.0 / size, out=scratch)
            np.add(scratch, squares, out=scratch)
            np.add(scratch, squares[selected].sum(axis=0), out=scratch)
            np.sqrt(np.maximum(scratch, 0.0, out=scratch), out=scratch)
            np.subtract(scratch, target_scatter * np.sqrt(size - 1.0), out=scratch)
            scatter_errors = np.einsum("ij,ij->i", scratch, scratch)
            result = result + _SCATTER_WEIGHT / ((size - 1) * period_count) * scatter_errors
        # A row cannot be added if it is selected already or if its event has the maximum number.
        result[selected] = np.inf
        count_of_event = np.bincount(events[selected], minlength=events.max() + 1)
        result[count_of_event[events] >= max_per_event] = np.inf
        return np.asarray(result)

    return with_row
