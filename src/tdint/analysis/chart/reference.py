"""The motion that others are measured against: computed by one method, confirmed by another one, kept for later."""

from __future__ import annotations

import hashlib
import time
from contextlib import suppress
from dataclasses import astuple, dataclass, fields
from pathlib import Path
from typing import Any

import numpy as np

from tdint.analysis.chart.problem import FloorMotion, Problem
from tdint.analysis.run.steps import Steps
from tdint.arrays import Array
from tdint.errors import AnalysisError, OutputError
from tdint.files import write_file
from tdint.input_bytes import is_file
from tdint.kernels.building.sources import digest_of_all
from tdint.kernels.building.store import folder_name
from tdint.methods.catalogue import parse
from tdint.system import cache_subfolder

EXACT_UP_TO = 100
"""Stories up to which the exact method serves; the cost of its step grows with their square."""

_EXACT_GOAL, _SMOOTH_GOAL, _KINKED_GOAL = 1e-10, 1e-9, 1e-8  # gaps that are small enough
_SECONDS = 20.0  # after which no finer solution is begun
_FIRST_COST = 0.5  # s, of the first solution, roughly
_STORY_STEP = 6e-8  # s, of one step of one story, roughly
_SMALL = 1e-3  # stories whose peak drift is below this part of the largest are left out of the error of the peaks
_KEPT = 200_000_000  # bytes of references in the cache


@dataclass(frozen=True)
class Errors:
    """Relative errors of a motion.

    Attributes
    ----------
    displacement, drift, velocity, acceleration : float
        Of the whole history, L2: root of the sum of squares of the differences over all floors (stories) and common
        times, over that of the reference. Displacement and velocity relative to the ground, acceleration absolute.
    peak_drift : float
        Largest relative error of a story's peak drift. Stories whose peak is below a thousandth of the largest one
        are left out.
    """

    displacement: float
    drift: float
    velocity: float
    acceleration: float
    peak_drift: float

    def of(self, quantity: str) -> float:
        """One of the errors by its name, with a hyphen or an underscore in it."""
        return float(getattr(self, quantity.replace("-", "_")))

    @property
    def worst(self) -> float:
        """The largest of all."""
        return float(max(astuple(self)))


QUANTITIES = tuple(field.name for field in fields(Errors))


def errors(motion: FloorMotion, reference: FloorMotion) -> Errors:
    """Errors of a motion against the reference, which has all samples, at the times of the motion."""
    true = reference.every(motion.stride, len(motion.displacement))
    counted = true.peak_drift > _SMALL * np.max(true.peak_drift)
    peaks = motion.peak_drift[counted] / true.peak_drift[counted] - 1.0
    of_history = {name: _relative(getattr(motion, name), getattr(true, name)) for name in QUANTITIES[:-1]}
    return Errors(**of_history, peak_drift=float(np.max(np.abs(peaks))))


def _relative(values: Array, true: Array) -> float:
    return float(np.linalg.norm(values - true) / np.linalg.norm(true))


@dataclass(frozen=True)
class Reference:
    """A motion at all samples, how it was computed, and how far another solution is from it.

    Attributes
    ----------
    method, dt : str, float
        What computed it, with which step (s).
    confirmed_by : str
        The other solution, in words.
    gap : Errors
        Of the other solution against this one: below it an error is not known.
    """

    method: str
    dt: float
    confirmed_by: str
    gap: Errors
    motion: FloorMotion


@dataclass(frozen=True)
class _Plan:
    """Which methods compute and confirm (the latter `extrapolated` from two steps, as a method of order 2), and the gap
    between them that is small enough."""

    method: str
    other: str
    extrapolated: bool
    goal: float


def find_reference(problem: Problem, samples: int, *, cached: bool = True) -> Reference:
    """The reference for a problem over some samples, from the cache if it is there.

    Linear buildings under ground motion alone: the exact method, confirmed by impulse4. All others: impulse4, confirmed
    by average acceleration extrapolated from two steps; not by gauss4, which is the same method in linear buildings.
    Steps are halved until the gap is small, does not fall any more, or takes too long to close further.

    Raises
    ------
    AnalysisError
        One of the solutions cannot be had.
    """
    file = _cache_file(problem, samples) if cached else None
    reference = _load(file, problem, samples) if file else None
    if reference is None:
        reference = _solve(problem, samples)
        if file:
            _save(file, reference)
    return reference


def _plan(problem: Problem) -> _Plan:
    building = problem.building
    if building.linear and not len(problem.forces) and building.stories <= EXACT_UP_TO:
        return _Plan("exact", "impulse4", extrapolated=False, goal=_EXACT_GOAL)
    kinked = building.piecewise_linear and not building.linear
    return _Plan("impulse4", "newmark-average", extrapolated=True, goal=_KINKED_GOAL if kinked else _SMOOTH_GOAL)


def _solve(problem: Problem, samples: int) -> Reference:
    plan = _plan(problem)
    problem.prepared.compile(parse(method) for method in (plan.method, plan.other))
    parts = 8
    while parts < 64 and 2 * parts * samples * problem.building.stories * _STORY_STEP < _FIRST_COST:
        parts *= 2
    begin = time.monotonic()
    best = _solve_once(problem, samples, plan, parts)
    while best.gap.worst > plan.goal and 3.0 * (time.monotonic() - begin) < _SECONDS:
        parts *= 2
        finer = _solve_once(problem, samples, plan, parts)
        falls = finer.gap.worst < 0.5 * best.gap.worst
        best = min(best, finer, key=lambda reference: reference.gap.worst)
        if not falls:
            break
    return best


def _solve_once(problem: Problem, samples: int, plan: _Plan, parts: int) -> Reference:
    motion = _motion(problem, samples, plan.method, parts)
    h = problem.interval / parts
    if plan.extrapolated:
        coarse, fine = (_motion(problem, samples, plan.other, 4 * parts * m) for m in (1, 2))
        other = _extrapolated(coarse, fine)
        words = f"{plan.other} extrapolated from dt {h / 4:.4g} and {h / 8:.4g} s"
    else:
        other = _motion(problem, samples, plan.other, parts)
        words = f"{plan.other} with dt {h:.4g} s"
    return Reference(plan.method, h, words, errors(other, motion), motion)


def _motion(problem: Problem, samples: int, method: str, parts: int) -> FloorMotion:
    h = problem.interval / parts
    march = problem.march(parse(method), Steps(h, samples * parts, per_sample=parts), keep=True)
    if march.motion is None:
        raise AnalysisError(f"no reference: {method} with dt {h:.6g} s does not reach the end")
    return march.motion


def _extrapolated(coarse: FloorMotion, fine: FloorMotion) -> FloorMotion:
    """The limit of two motions of a method of order 2, the step of the second half of the first's (Richardson)."""
    names = [one.name for one in fields(FloorMotion)[1:]]
    return FloorMotion(fine.stride, *((4.0 * getattr(fine, name) - getattr(coarse, name)) / 3.0 for name in names))


# ---- The cache: a file per problem and sources of the kernels, in the folder of the compiled ones.


def cache_folder() -> Path | None:
    """The folder for references made by these versions of the compiler; None if none can be written."""
    return cache_subfolder(folder_name())


def _cache_file(problem: Problem, samples: int) -> Path | None:
    folder = cache_folder()
    if folder is None:
        return None
    building = problem.building
    digest = hashlib.sha256(Path(__file__).read_bytes() + digest_of_all().encode())
    digest.update(repr((problem.interval, samples)).encode())
    tables = (building.linear_terms, building.law_parameters, building.modal, problem.ground, problem.forces)
    for table in (*tables, problem.displacement, problem.velocity):
        digest.update(repr(table.shape).encode())
        digest.update(np.ascontiguousarray(table).tobytes())
    return folder / "references" / f"{digest.hexdigest()}.npz"


def _load(file: Path, problem: Problem, samples: int) -> Reference | None:
    """What the file holds; None if there is none or it is damaged."""
    if not is_file(file):
        return None
    shape = (samples + 1, problem.building.stories)
    # A zip file, a text or an array that is broken: whatever is raised, the reference is computed anew.
    with suppress(Exception), file.open("rb") as stream, np.load(stream, allow_pickle=False) as content:
        table = content["table"]
        motion = FloorMotion(1, table[0], table[1], table[2], content["peak_drift"])
        if table.shape == (3, *shape) and motion.peak_drift.shape == shape[1:] and np.all(np.isfinite(table)):
            gap = Errors(*content["gap"].tolist())
            return Reference(str(content["method"]), float(content["dt"]), str(content["confirmed_by"]), gap, motion)
    return None


def _save(file: Path, reference: Reference) -> None:
    """Keep a reference, and of older ones those that have room; a cache that cannot be written is none."""
    motion = reference.motion
    content: dict[str, Any] = {
        "table": np.array([motion.displacement, motion.velocity, motion.acceleration]),
        "peak_drift": motion.peak_drift,
        "gap": np.array(astuple(reference.gap)),
        "method": reference.method,
        "dt": reference.dt,
        "confirmed_by": reference.confirmed_by,
    }
    with suppress(OSError, OutputError):
        file.parent.mkdir(exist_ok=True, mode=0o700)
        write_file(file, lambda stream: np.savez(stream, **content), overwrite=True)
        size = 0
        for old in sorted(file.parent.glob("*.npz"), key=lambda old: old.stat().st_mtime, reverse=True):
            size += old.stat().st_size
            if size > _KEPT and old != file:
                old.unlink(missing_ok=True)
