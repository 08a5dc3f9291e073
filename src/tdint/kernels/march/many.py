"""Many marches of one building in one call: other ground motions, scales and steps, the same method."""

from __future__ import annotations

from typing import NamedTuple

from tdint.kernels import layout as at
from tdint.kernels.bundles import MEMORY, SCENE, Array, Memory, Scene, Seen
from tdint.kernels.compiling import CUBE, F8, I8, TABLE, VECTOR, called_at, inlined, kernel
from tdint.kernels.march.law_energies import BEGIN, RAISE_SHEARS, TAKE_STOCK
from tdint.kernels.march.march import MARCH
from tdint.kernels.stepping import STEP

# runs: one row each
GROUND_START = 0  # of the run's ground acceleration among all samples
GROUND_SIZE = 1  # its number of samples
SCALE = 2  # factor on them
STEPS = 3
PER_SAMPLE = 4
STRIDE = 5

# ends: one row for each run
CODE = 0  # as `march` returns it
STEPS_TAKEN = 1
AT_REST = 2  # 1 if the motion has died, or that was not asked for
END_COLUMNS = 3

_call_march = called_at(MARCH)


@inlined
def _copy(source, target):
    for i in range(source.shape[0]):
        for j in range(source.shape[1]):
            target[i, j] = source[i, j]


@inlined
def _fill(target, value):
    for i in range(target.shape[0]):
        for j in range(target.shape[1]):
            target[i, j] = value


MANY = I8(
    MARCH,
    STEP,
    BEGIN,
    TAKE_STOCK,
    RAISE_SHEARS,
    I8,  # how often a step may be halved
    F8,  # h
    VECTOR,  # samples of all ground motions
    TABLE,  # runs
    VECTOR,  # coefficients
    VECTOR,  # shifts
    *SCENE,
    *MEMORY,  # as it is at the start
    VECTOR,  # totals, likewise
    *MEMORY,
    VECTOR,  # load
    VECTOR,  # ground: as long as the longest motion
    TABLE,  # watch
    TABLE,  # limits
    VECTOR,  # kept: a number for each story
    TABLE,  # history, without rows
    I8,  # steps of a window at the end in which the motion is seen to have died
    I8,  # most windows; 0: runs end with their steps
    F8,  # largest velocity in a window at rest, over the largest displacement of the run, 1/s
    CUBE,  # peaks of each run
    TABLE,  # drifts of each run at its end
    TABLE,  # totals of each run
    TABLE,  # ends
)


class _Called(NamedTuple):
    """The kernels of a march."""

    march: int
    step: int
    begin: int
    take_stock: int
    raise_shears: int


class _Motion(NamedTuple):
    """What all runs have in common: how a step is taken, and scratch for the run's own ground motion."""

    halvings: int
    h: float
    coefficients: Array
    shifts: Array
    load: Array
    ground: Array


@inlined
def _go_on(kernels, motion, run, steps, done, scene, memory, seen):
    """March on from `done` steps to `steps` of them; `run` is the number of steps per sample and samples per step."""
    return _call_march(
        kernels.march, kernels.step, kernels.begin, kernels.take_stock, kernels.raise_shears,
        steps, done, steps, 1, 0, run[0], run[1],
        motion.halvings, motion.h, motion.ground, motion.coefficients, motion.shifts,
        scene.linear_terms, scene.modal, scene.law_parameters, scene.forces, scene.flags,
        memory.state, memory.springs, memory.work, memory.report, motion.load,
        seen.watch, seen.peaks, seen.limits, seen.totals, seen.history,
    )  # fmt: skip


@inlined
def _begin(initial, memory, watch):
    """Bring all memory to what it is at the start."""
    _copy(initial.state, memory.state)
    _copy(initial.springs, memory.springs)
    _fill(memory.work, 0.0)
    _fill(watch, 0.0)
    for i in range(memory.report.size):
        memory.report[i] = initial.report[i]


@kernel(MANY, parts=())
def many(
    march, step, begin, take_stock, raise_shears, halvings, h, samples, runs, coefficients, shifts,
    linear_terms, modal, law_parameters, forces, flags, state_0, springs_0, work_0, report_0, totals_0,
    state, springs, work, report, load, ground, watch, limits, kept, history,
    window, windows, quiet, peaks, drifts, totals, ends,
):  # fmt: skip
    """March through all runs; each begins as if it were alone. Returns how many of them did not get to their end."""
    kernels = _Called(march, step, begin, take_stock, raise_shears)
    motion = _Motion(halvings, h, coefficients, shifts, load, ground)
    scene = Scene(linear_terms, modal, law_parameters, forces, flags)
    initial = Memory(state_0, springs_0, work_0, report_0)
    memory = Memory(state, springs, work, report)
    failed = 0
    n = linear_terms.shape[1] - 1
    for r in range(runs.shape[0]):
        first = int(runs[r, GROUND_START])
        size = int(runs[r, GROUND_SIZE])
        for i in range(ground.size):
            ground[i] = samples[first + i] * runs[r, SCALE] if i < size else 0.0
        _begin(initial, memory, watch)
        for i in range(at.TOTALS_SIZE):
            totals[r, i] = totals_0[i]
        seen = Seen(watch, peaks[r], limits, totals[r], history)
        run = (int(runs[r, PER_SAMPLE]), int(runs[r, STRIDE]))
        done = 0
        last = int(runs[r, STEPS])
        code = 0
        at_rest = 1.0 if windows == 0 else 0.0
        for w in range(windows + 1):
            for i in range(n):  # velocities of this window alone
                kept[i] = peaks[r, at.PEAK_VELOCITY, i]
                peaks[r, at.PEAK_VELOCITY, i] = 0.0
                if report[at.OWN_PEAKS] != 0.0:
                    work[int(report[at.OWN_PEAKS]) + at.PEAK_VELOCITY, i] = 0.0
            code = _go_on(kernels, motion, run, last, done, scene, memory, seen)
            fastest = 0.0
            farthest = 0.0
            for i in range(n):
                fastest = max(fastest, peaks[r, at.PEAK_VELOCITY, i])
                farthest = max(farthest, peaks[r, at.PEAK_DISPLACEMENT, i])
                peaks[r, at.PEAK_VELOCITY, i] = max(kept[i], peaks[r, at.PEAK_VELOCITY, i])
            if code < 0:
                break
            done = last
            last += window
            if w > 0 and fastest <= quiet * farthest:
                at_rest = 1.0
                break
        if code < 0:
            failed += 1
        for i in range(n):
            drifts[r, i] = springs[at.DRIFT, i]
        ends[r, CODE] = code
        ends[r, STEPS_TAKEN] = done
        ends[r, AT_REST] = at_rest
    return failed
