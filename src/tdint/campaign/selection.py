"""Ground motions chosen from many so that the mean of their scaled spectra, and if asked their
scatter, fit a target.

The score of a choice is the mean over the periods of (mean ln Sa - ln target)^2, plus half of
(scatter - asked)^2, each motion with its own factor (least squares of ln Sa) within limits. Motions
are added one by one, each time the best, then exchanged for others while that helps (Jayaram, Lin
and Baker 2011; Baker and Lee 2018), from many starts.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from datetime import datetime
from itertools import product
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from tdint.analysis.given import AnyMotion, motion_of
from tdint.analysis.spectra.elastic import SA_DAMPING
from tdint.analysis.spectra.target import TargetSpectrum
from tdint.arrays import Array
from tdint.campaign.intensity import GEOMETRIC_MEAN, pseudo_accelerations
from tdint.campaign.scaling import (
    BOUNDS,
    MAXIMUM_DIRECTION,
    Scaling,
    check_rule,
    raise_to_rule,
    target_at,
)
from tdint.errors import AnalysisError, UsageError
from tdint.ground_motion.events import SAME_DATE, Earthquake, event_of, is_same_event
from tdint.ground_motion.horizontals import motion_names
from tdint.ground_motion.reading.suites import GroundMotion, components
from tdint.written_numbers import first_few, how_many

_STARTS, _ROWS = (10, 200), 20_000
"""Beginnings, at least and at most, and motions in all of them together: the best motion alone,
then by turns half of the best choice so far, and any motions. With 20, pools of 16 miss their best
choice of five in one case of six."""

_OF_SCATTER = 0.5
"""Weight of the scatter's misfit beside that of the mean (Baker and Lee 2018 have 1 and 2 among
theirs)."""

_TRIALS, _LOWER = 40, 0.95
"""Number of selections that are tried for factors within the limits, and the largest ratio of two
successive upper limits of the factors before the common factor: a tenth of a limit after 40."""

_ROUNDING = 1e-12
"""Relative rounding error of the product of two factors, with a margin."""

_GAIN = 1e-12
"""Part of the score by which an exchange must be better: else rounding goes on for ever."""


def select(
    motions: Sequence[AnyMotion],
    target: TargetSpectrum | str,
    count: int,
    *,
    rule: str = "mean",
    periods: Sequence[float] | Array | None = None,
    damping: float = SA_DAMPING,
    pair: str = GEOMETRIC_MEAN,
    factors: tuple[float, float] = BOUNDS,
    events: Sequence[object] | None = None,
    per_event: int | None = None,
    scatter: float | Sequence[float] | Array | None = None,
) -> Scaling:
    """Choose motions whose scaled spectra fit a target together.

    Parameters
    ----------
    motions, target, periods, damping, pair
        As of `scale`.
    count : int
        How many are chosen.
    rule : str
        `mean` (each with its own factor within the limits), or `asce7` or `ec8`, which then act on
        those chosen.
    factors : tuple of two floats
        The smallest and the largest factor. A motion that needs a factor outside of these limits
        is considered with the limit. The common factor of a rule is included.
    events : sequence, optional
        The event of each motion, empty if unknown; by default as the files state it
        (`events_of`).
    per_event : int, optional
        Maximum number of selected motions of one event.
    scatter : float or sequence of float, shape (k,), optional
        Standard deviation of ln Sa that is asked for, at all periods or at each.

    Returns
    -------
    Scaling
        That of the chosen motions; `chosen` are their places among those given, `left_out` says how
        many were not looked at and why, `rest` are the scaled spectra of the others.

    Raises
    ------
    UsageError
        Fewer motions, or events, than are asked for; limits, a scatter or a rule that make no
        sense; `per_event` for motions whose event is unknown.
    AnalysisError
        No selection meets the rule with factors within the limits.
    """
    low, high = factors
    if not 0.0 < low <= high < np.inf:
        raise UsageError(
            f"factors: the limits must be positive, the least first, got {low:g} and {high:g}"
        )
    if isinstance(count, bool) or not isinstance(count, int) or count < 1:
        raise UsageError(
            f"the number of motions to select must be a whole number, 1 at least, got {count!r:.60}"
        )
    if per_event is not None and per_event < 1:
        raise UsageError(f"per_event must be 1 at least, got {per_event}")
    if events is not None and len(events) != len(motions):
        raise UsageError(f"events: one for each of {len(motions)} motions, got {len(events)}")
    aim, places = target_at(target, periods)
    wanted = None if scatter is None else np.broadcast_to(np.asarray(scatter, float), places.shape)
    if wanted is not None and (count < 3 or not np.all((wanted >= 0.0) & np.isfinite(wanted))):
        raise UsageError("a scatter is a positive number, of three motions at least")
    # The pool: what is there twice, and what does not resolve the periods, is left out.
    whole = [motion_of(motion) for motion in motions]
    spectrum_pair = MAXIMUM_DIRECTION if rule == "asce7" else pair
    check_rule(rule, whole, count, aim)
    pool, spectra, left_out = _pool(whole, places, damping, spectrum_pair)
    numbers, labels = np.arange(len(whole)), list[str]()
    if per_event is not None:
        labels = events_of(whole) if events is None else [str(event or "") for event in events]
        _check_events_known(whole, labels)
        numbers = np.unique(labels, return_inverse=True)[1]
    of_pool, most = numbers[pool], len(whole) if per_event is None else per_event
    possible = int(np.minimum(np.bincount(of_pool), most).sum()) if len(pool) else 0
    if possible < count:
        why = [f"{number} {reason}" for reason, number in left_out.items() if number]
        why += (
            [f"at most {per_event} of an event, {how_many(int(np.max(numbers)) + 1, 'event')}"]
            if per_event is not None
            else []
        )
        told = f" ({', '.join(why)})" if why else ""
        raise UsageError(
            f"{count} motions are asked for, {possible} of {len(whole)} can be taken{told}"
        )
    # Factors by least squares within the limits, then the motions whose mean fits the target.
    ln_aim, ln_spectra = np.log(aim.at(places)), np.log(spectra)
    ln_fitted = np.mean(ln_aim - ln_spectra, axis=1)
    fitted = Scaling(
        tuple(whole[place] for place in pool),
        np.clip(np.exp(ln_fitted), low, high),
        "mean",
        spectrum_pair,
        damping,
        target=aim,
        periods=places,
    )

    def choose(factors: Array) -> list[int]:
        off = ln_spectra + np.log(factors)[:, None] - ln_aim
        return _search(off, count, wanted, of_pool, most)

    if rule == "mean":
        chosen = choose(fitted.factors)
        scaling, scaled = _part(fitted, chosen), fitted.factors
    else:
        chosen, scaling, scaled = _within_limits(fitted, rule, (low, high), choose)
    others = np.setdiff1d(np.arange(len(pool)), chosen)
    at_limit = (ln_fitted[others] <= np.log(low)) | (ln_fitted[others] >= np.log(high))
    return replace(
        scaling,
        chosen=tuple(pool[place] for place in chosen),
        left_out=left_out,
        rest=spectra[others] * scaled[others, None],
        events=tuple(labels[pool[place]] for place in chosen) if labels else (),
        limits=(low, high),
        others_at_limit=int(np.sum(at_limit)),
    )


def _part(fitted: Scaling, places: Sequence[int]) -> Scaling:
    """Return some motions of a suite with their factors."""
    motions = tuple(fitted.motions[place] for place in places)
    return replace(fitted, motions=motions, factors=fitted.factors[list(places)])


def _within_limits(
    fitted: Scaling,
    rule: str,
    limits: tuple[float, float],
    choose: Callable[[Array], list[int]],
) -> tuple[list[int], Scaling, Array]:
    """Return a selection whose factors are within the limits after the common factor of a rule.

    The common factor of a selection may raise factors beyond the upper limit. Then the factors of
    all motions are limited to a lower value, by which the search prefers stronger motions, until
    the product of this value and the common factor is within the limit.

    Parameters
    ----------
    fitted : Scaling
        All motions with their own factors within the limits.
    rule : str
        `asce7` or `ec8`.
    limits : tuple of two floats
        The smallest and the largest factor.
    choose : callable
        The places of the selected motions for the factors of all motions.

    Returns
    -------
    chosen : list of int
        Places of the selected motions.
    scaling : Scaling
        The selected motions with their final factors.
    factors : ndarray
        Factors of all motions before the common factor.

    Raises
    ------
    AnalysisError
        No selection was found. The message reports the one whose largest factor is the smallest.
    """
    low, high = limits
    upper = high
    nearest: Scaling | None = None
    for _trial in range(_TRIALS):
        factors = np.minimum(fitted.factors, upper)
        chosen = choose(factors)
        scaling = raise_to_rule(_part(replace(fitted, factors=factors), chosen), rule)
        largest = float(np.max(scaling.factors))
        if largest <= high * (1.0 + _ROUNDING):
            within = replace(scaling, factors=np.minimum(scaling.factors, high))
            return chosen, within, factors
        if nearest is None or largest < float(np.max(nearest.factors)):
            nearest = scaling
        # The common factor for the next selection is at least about that of this one. If every
        # factor is limited already, no lower limit changes anything.
        if upper <= float(np.min(fitted.factors)):
            break
        common = largest / float(np.max(factors[chosen]))
        upper = max(min(high / common, upper * _LOWER), float(np.min(fitted.factors)))
    assert nearest is not None
    over = first_few([f"{name} {factor:.4g}" for name, factor in nearest.beyond(low, high)], 5)
    needed = math.ceil(1e4 * float(np.max(nearest.factors))) / 1e4
    raise AnalysisError(
        f"no selection of {len(nearest.motions)} motions with factors from {low:g} to {high:g} "
        f"meets the rule {rule}; the nearest selection needs factors up to {needed:g}: {over}; set "
        f"the limits to {low:g}:{needed:g}, or add stronger motions. The nearest selection: "
        f"{', '.join(motion.source for motion in nearest.motions)}"
    )


def events_of(motions: Sequence[GroundMotion]) -> list[str]:
    """Return a label of the event of each motion, equal for the motions of one event.

    Both components of a recording belong to one event, whether they are given as a pair or as two
    files that are named alike.

    Returns
    -------
    list of str
        Name and date of the event; empty if the event of a motion is unknown.
    """
    # Motions of one event become one group: groups[i] is the group of motion i.
    known = [_event_of_motion(motion) for motion in motions]
    groups = list(range(len(known)))

    def root(place: int) -> int:
        while groups[place] != place:
            groups[place] = groups[groups[place]]
            place = groups[place]
        return place

    def unite(place: int, other: int) -> None:
        first, second = sorted((root(place), root(other)))
        groups[second] = first

    # Files with the same entry, then the two files of one recording: first those whose event is
    # known (one file may also contain several recordings), then the other files.
    first_of: dict[Earthquake, int] = {}
    for place, event in enumerate(known):
        if event.is_known:
            unite(place, first_of.setdefault(event, place))
    of_recording: dict[str, int] = {}
    for is_second, (place, names) in product((False, True), enumerate(_recordings(motions))):
        for name in names if known[place].is_known is not is_second else []:
            other = of_recording.setdefault(name, place)
            if is_second or is_same_event(known[place], known[other]):
                unite(place, other)

    # Different entries of one event: dated entries in order of time, as far as they may agree.
    distinct = list(first_of.values())
    dated = sorted(
        (place for place in distinct if known[place].time),
        key=lambda place: known[place].time or datetime.min,
    )
    undated = [place for place in distinct if not known[place].time]
    for rank, place in enumerate(dated):
        for other in dated[rank + 1 :]:
            later, earlier = known[other].time, known[place].time
            if later is None or earlier is None or later - earlier > 2 * SAME_DATE:
                break
            if is_same_event(known[place], known[other]):
                unite(place, other)
    for rank, place in enumerate(undated):
        for other in [*undated[rank + 1 :], *dated]:
            if is_same_event(known[place], known[other]):
                unite(place, other)

    # The label of a group is that of its first motion with a known event.
    labels: dict[int, str] = {}
    for place, event in enumerate(known):
        if event.is_known and root(place) not in labels:
            labels[root(place)] = event.label
    return [labels.get(root(place), "") for place in range(len(known))]


def named_events(motions: Sequence[GroundMotion], of_file: Mapping[str, str]) -> list[str]:
    """Return the event of each motion by a table of files.

    A row of the table is enough for both components of a recording.

    Parameters
    ----------
    motions : sequence of Record or Horizontals
        The motions.
    of_file : mapping of str to str
        The event of each file. A file is named by its path, its name or its name without suffix.

    Returns
    -------
    list of str
        Empty for a motion of which the table has no file.

    Raises
    ------
    UsageError
        The two components of a recording have different events.
    """
    recordings = _recordings(motions)
    of_recording: dict[str, tuple[str, str]] = {}
    for motion, names in zip(motions, recordings, strict=True):
        files = dict.fromkeys(record.source for record in components(motion))
        for file, name in zip(files, names, strict=True):
            keys = (file, Path(file).name, Path(file).stem)
            event = next((of_file[key] for key in keys if of_file.get(key)), "")
            other, before = of_recording.get(name, (file, event))
            if event and event != before:
                raise UsageError(
                    f"{other} and {file} are components of one recording, but their events differ: "
                    f"{before!r} and {event!r}"
                )
            if event:
                of_recording[name] = (file, event)
    return [
        next((of_recording[name][1] for name in names if name in of_recording), "")
        for names in recordings
    ]


def _recordings(motions: Sequence[GroundMotion]) -> list[list[str]]:
    """Return a name for each file of each motion, equal for the files of one recording."""
    files = [
        list(dict.fromkeys(record.source for record in components(motion))) for motion in motions
    ]
    every = list(dict.fromkeys(file for of_motion in files for file in of_motion if file))
    name_of = dict(zip(every, motion_names(every), strict=True))
    # Motions that do not come from files have nothing in common.
    return [
        [name_of.get(file, f"motion {place}") for file in of_motion]
        for place, of_motion in enumerate(files)
    ]


def _check_events_known(motions: Sequence[GroundMotion], events: Sequence[str]) -> None:
    """Refuse motions whose event is unknown.

    Raises
    ------
    UsageError
        With the files of these motions.
    """
    unknown = [motion.source for motion, event in zip(motions, events, strict=True) if not event]
    if unknown:
        raise UsageError(
            f"per_event: the event of {how_many(len(unknown), 'motion')} is unknown: "
            f"{', '.join(dict.fromkeys(unknown))}; name the events of the files (--events FILE), "
            "or omit these files"
        )


def _event_of_motion(motion: GroundMotion) -> Earthquake:
    """Return the event of a motion; for a pair, of the component whose header states most."""
    events = [event_of(record) for record in components(motion)]
    return max(events, key=lambda event: (event.has_clock, bool(event.time), bool(event.name)))


def _pool(
    motions: Sequence[GroundMotion], periods: Array, damping: float, pair: str
) -> tuple[list[int], Array, dict[str, int]]:
    """Places of the motions to choose from, their spectra (m/s^2), and how many others there are,
    by the reason."""
    left_out = {"duplicate": 0, "range of periods": 0, "zero": 0}
    places, spectra, seen = [], [], set()
    for place, motion in enumerate(motions):
        samples = tuple((record.dt, record.acceleration.tobytes()) for record in components(motion))
        key = hash(samples)
        if key in seen:
            left_out["duplicate"] += 1
            continue
        seen.add(key)
        if not all(np.any(record.acceleration) for record in components(motion)):
            left_out["zero"] += 1
            continue
        try:
            spectra.append(pseudo_accelerations(motion, periods, damping, pair))
        except AnalysisError:  # too short a period for its sampling interval
            left_out["range of periods"] += 1
            continue
        places.append(place)
    return places, np.array(spectra).reshape(-1, len(periods)), left_out


def _search(
    off: Array, count: int, wanted: Array | None, events: NDArray[np.int64], most: int
) -> list[int]:
    """Rows of `off`, ln of scaled spectra over the target, shape (n, k), that have the least score
    together."""
    random, best, least = np.random.default_rng(0), list[int](), np.inf
    squares = off * off
    of_row, parts = squares.sum(axis=1), np.empty_like(off)

    def scores(rest: list[int], size: int) -> Array:
        """The score of the rows `rest` with each one more, infinite for what may not be taken."""
        total = off[rest].sum(axis=0)
        result = (total @ total + 2.0 * (off @ total) + of_row) / (size**2 * off.shape[1])
        if wanted is not None and size > 2:
            # (size - 1) variance = sum of squares - (total + row)^2 / size, in one table
            np.add(off, total, out=parts)
            np.multiply(parts, parts, out=parts)
            np.multiply(parts, -1.0 / size, out=parts)
            np.add(parts, squares, out=parts)
            np.add(parts, squares[rest].sum(axis=0), out=parts)
            np.sqrt(np.maximum(parts, 0.0, out=parts), out=parts)
            np.subtract(parts, wanted * np.sqrt(size - 1.0), out=parts)
            result = result + _OF_SCATTER / ((size - 1) * off.shape[1]) * np.einsum(
                "ij,ij->i", parts, parts
            )
        result[rest] = np.inf
        result[np.bincount(events[rest], minlength=events.max() + 1)[events] >= most] = np.inf
        return np.asarray(result)

    for start in range(int(np.clip(_ROWS // len(off), *_STARTS))):
        # Begin, add the best one by one, then exchange each for the best while that helps.
        chosen: list[int] = []
        if start % 2:
            chosen = random.permutation(best)[: count // 2].tolist()
        elif start:
            while len(chosen) < count:
                chosen.append(int(random.choice(np.flatnonzero(np.isfinite(scores(chosen, 2))))))
        while len(chosen) < count:
            chosen.append(int(np.argmin(scores(chosen, len(chosen) + 1))))
        score, moved = np.inf, True
        while moved:
            moved = False
            for place in range(count):
                rest = chosen[:place] + chosen[place + 1 :]
                of_all = scores(rest, count)
                better = int(np.argmin(of_all))
                if of_all[better] < score * (1.0 - _GAIN):
                    moved |= better != chosen[place]
                    chosen[place], score = better, float(of_all[better])
        if score < least:
            best, least = sorted(chosen), score
    return best
