"""The time loop: one compiled march for all methods, which takes the compiled step as an
argument."""

from __future__ import annotations

from typing import NamedTuple

from tdint.kernels import layout as rows
from tdint.kernels.compiling import (
    CUBE,
    F8,
    I8,
    TABLE,
    VECTOR,
    indirect_caller,
    inline,
    kernel,
    outlined,
)
from tdint.kernels.march.ground import ground_at, straightened, straightened_samples
from tdint.kernels.march.observing import (
    BEGIN,
    SUM_LAW_ENERGIES,
    UPDATE_SHEAR_PEAKS,
    begin_energies,
    begin_laws,
    beyond_limits,
    look_between,
    note_collapse,
    observe,
    remember,
    shift_ground,
    store,
    sum_up,
    take_shears,
)
from tdint.kernels.stepping import (
    MEMORY,
    SCENE,
    SEEN,
    STEP,
    Array,
    Memory,
    Scene,
    Seen,
    Span,
    take_step,
)

MARCH = I8(
    STEP,  # step
    BEGIN,  # what brings the drift laws to the initial state
    SUM_LAW_ENERGIES,  # what sums up their energies
    UPDATE_SHEAR_PEAKS,  # what finds their forces where they turned
    I8,  # steps of the whole run
    I8,  # steps of it that are done
    I8,  # steps until which to go on
    I8,  # steps from one row of the history to the next
    I8,  # rows of it that stand before those that are given
    I8,  # steps per sample of the ground motion
    I8,  # samples per as many steps; 1 where a step is not longer than a sampling interval
    I8,  # how often a step may be halved
    F8,  # h
    VECTOR,  # ground acceleration
    VECTOR,  # coefficients
    VECTOR,  # what of a jump of the ground acceleration each row of the state takes
    *SCENE,
    *MEMORY,
    VECTOR,  # load, LOAD_SIZE numbers of scratch
    *SEEN,
)

RUNAWAY = 1e6
"""Displacement beyond which a march ends as one whose numbers are not finite, m: no building moves
so far."""


@inline
def start(begin, sum_law_energies, scene, ground, memory, seen):
    """Drift laws, acceleration and energy of the initial state, which may be beyond limits."""
    n = scene.linear_terms.shape[1] - 1
    state = memory.state
    begin_laws(begin, scene, memory)
    observe(scene, Span(0.0, 0.0, ground, ground, False, False, False), 0.0, memory, seen)
    remember(state, seen.observer_state, n)
    for i in range(n):
        state[rows.ACCELERATION, i] = seen.observer_state[rows.OBSERVED_ACCELERATION, i]
    memory.step_status[rows.STATE_GROUND] = ground
    sum_up(sum_law_energies, scene, memory, seen)
    begin_energies(scene.linear_terms, seen.totals)
    watch_limits(sum_law_energies, scene, memory, 0, seen)


@inline
def ran_away(state, n):
    here = True
    for i in range(n):
        here &= abs(state[rows.DISPLACEMENT, i]) < RUNAWAY
    return not here


@inline
def see(update_shear_peaks, scene, span, slope, memory, seen):
    """Observe the motion at the end of a step or of a piece of one, and what it passed on the
    way."""
    near = observe(scene, span, slope, memory, seen)
    if look_between(near, scene, span, memory, seen) > 0:
        take_shears(update_shear_peaks, scene, memory, seen)


@inline
def watch_limits(sum_law_energies, scene, memory, steps, seen):
    """Note a collapse that has not been noted yet."""
    if seen.totals[rows.COLLAPSE_STEP] == rows.NO_COLLAPSE and beyond_limits(
        memory.law_state, seen
    ):
        _collapse(sum_law_energies, scene, memory, steps, seen)


@outlined
def _collapse(sum_law_energies, scene, memory, steps, seen):
    sum_up(sum_law_energies, scene, memory, seen)
    note_collapse(memory.law_state, steps, seen)


@kernel(MARCH, parts=())
def march(
    step,
    begin,
    sum_law_energies,
    update_shear_peaks,
    steps,
    first,
    last,
    every,
    before,
    per_sample,
    stride,
    halvings,
    h,
    ground,
    coefficients,
    shifts,
    linear_terms,
    modal,
    law_parameters,
    forces,
    flags,
    state,
    law_state,
    scratch,
    step_status,
    load,
    observer_state,
    peaks,
    limits,
    totals,
    history,
):
    """Integrate over the steps `first` to `last` of a run of `steps` steps of h; returns 0, or the
    code of the step that failed.

    The run begins with `first` 0 and goes on from what the march before has left: in so many pieces
    that whoever runs it can be interrupted.

    A step longer than a sampling interval takes the ground acceleration as the straight line that
    has its impulse and its first moment over the step. The lines of two steps do not meet: in
    between the accelerations jump as the ground does.

    A step that does not converge is halved up to `halvings` times over; the rest of it goes on in
    the smaller pieces. A multi-step method, whose memory holds whole steps, starts anew in and
    after such a step. `totals[STEPS_REACHED]` counts the whole steps done.
    """
    scene = Scene(linear_terms, modal, law_parameters, forces, flags)
    memory = Memory(state, law_state, scratch, step_status)
    seen = Seen(observer_state, peaks, limits, totals, history)
    on_path = flags[rows.PARABOLIC] != 0.0
    fast = flags[rows.UNRESOLVED_MODES] != 0.0
    ground_0 = ground_at(ground, first, per_sample, stride)
    if first == 0:
        start(begin, sum_law_energies, scene, ground_0, memory, seen)
        if history.shape[0] > 0:
            store(ground_0, ground_0, memory, seen, 0)
    smallest = 0.5**halvings
    for s in range(first, last):
        ground_1 = ground_at(ground, s + 1, per_sample, stride)
        slope = (ground_1 - ground_0) / h
        done = 0.0  # of the step
        piece = 1.0
        while done < 1.0:
            load[rows.TIME] = (s + done) * h
            if stride > 1:
                samples = stride / per_sample
                begins, ends = (s + done) * samples, (s + done + piece) * samples
                if per_sample == 1 and piece == 1.0:
                    load[rows.GROUND_0], load[rows.GROUND_1] = straightened_samples(
                        ground, s * stride, (s + 1) * stride
                    )
                else:
                    load[rows.GROUND_0], load[rows.GROUND_1] = straightened(ground, begins, ends)
                slope = (load[rows.GROUND_1] - load[rows.GROUND_0]) / (piece * h)
                shift_ground(scene, load, shifts, memory, seen)
            else:
                load[rows.GROUND_0] = ground_0 + done * (ground_1 - ground_0)
                load[rows.GROUND_1] = (
                    ground_1
                    if done + piece == 1.0
                    else ground_0 + (done + piece) * (ground_1 - ground_0)
                )
            code = take_step(step, coefficients, scene, piece * h, load, memory)
            if code < 0:
                if code == rows.NOT_FINITE or piece <= smallest:
                    watch_limits(sum_law_energies, scene, memory, s, seen)
                    return code
                piece *= 0.5
                totals[rows.HALVINGS] += 1.0
                step_status[rows.STEPS_DONE] = 0.0
                continue
            done += piece
            totals[rows.ITERATIONS] += code
            step_status[rows.STATE_GROUND] = load[rows.GROUND_1]
            t, cornered = (s + done) * h, step_status[rows.STEP_PEAKS] != 0.0
            span = Span(
                t, piece * h, load[rows.GROUND_0], load[rows.GROUND_1], on_path, fast, cornered
            )
            see(update_shear_peaks, scene, span, slope, memory, seen)
        step_status[rows.STEPS_DONE] = step_status[rows.STEPS_DONE] + 1.0 if piece == 1.0 else 0.0
        totals[rows.STEPS_REACHED] += 1.0
        if ran_away(state, linear_terms.shape[1] - 1):
            return rows.NOT_FINITE
        watch_limits(sum_law_energies, scene, memory, s + 1, seen)
        if history.shape[0] > 0 and (s + 1) % every == 0:
            sum_up(sum_law_energies, scene, memory, seen)
            store(ground_1, load[rows.GROUND_1], memory, seen, (s + 1) // every - before)
        ground_0 = ground_1
    if last == steps:
        sum_up(sum_law_energies, scene, memory, seen)
    return 0


# ---- Many marches of one building in one call: other ground motions, scales and steps, the same
# method

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

_call_march = indirect_caller(MARCH)


@inline
def _copy(source, target):
    for i in range(source.shape[0]):
        for j in range(source.shape[1]):
            target[i, j] = source[i, j]


@inline
def _fill(target, value):
    for i in range(target.shape[0]):
        for j in range(target.shape[1]):
            target[i, j] = value


MANY = I8(
    MARCH,
    STEP,
    BEGIN,
    SUM_LAW_ENERGIES,
    UPDATE_SHEAR_PEAKS,
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
    sum_law_energies: int
    update_shear_peaks: int


class _Motion(NamedTuple):
    """What all runs have in common: how a step is taken, and scratch for the run's own ground
    motion."""

    halvings: int
    h: float
    coefficients: Array
    shifts: Array
    load: Array
    ground: Array


@inline
def _go_on(kernels, motion, run, steps, done, scene, memory, seen):
    """March on from `done` steps to `steps` of them; `run` is the number of steps per sample and
    samples per step."""
    return _call_march(
        kernels.march, kernels.step, kernels.begin,
        kernels.sum_law_energies, kernels.update_shear_peaks,
        steps, done, steps, 1, 0, run[0], run[1],
        motion.halvings, motion.h, motion.ground, motion.coefficients, motion.shifts,
        scene.linear_terms, scene.modal, scene.law_parameters, scene.forces, scene.flags,
        memory.state, memory.law_state, memory.scratch, memory.step_status, motion.load,
        seen.observer_state, seen.peaks, seen.limits, seen.totals, seen.history,
    )  # fmt: skip


@inline
def _begin(initial, memory, observer_state):
    """Bring all memory to what it is at the start."""
    _copy(initial.state, memory.state)
    _copy(initial.law_state, memory.law_state)
    _fill(memory.scratch, 0.0)
    _fill(observer_state, 0.0)
    for i in range(memory.step_status.size):
        memory.step_status[i] = initial.step_status[i]


@kernel(MANY, parts=())
def many(
    march,
    step,
    begin,
    sum_law_energies,
    update_shear_peaks,
    halvings,
    h,
    samples,
    runs,
    coefficients,
    shifts,
    linear_terms,
    modal,
    law_parameters,
    forces,
    flags,
    state_0,
    springs_0,
    work_0,
    report_0,
    totals_0,
    state,
    law_state,
    scratch,
    step_status,
    load,
    ground,
    observer_state,
    limits,
    kept,
    history,
    window,
    windows,
    quiet,
    peaks,
    drifts,
    totals,
    ends,
):
    """March through all runs; each begins as if it were alone. Returns how many of them did not get
    to their end."""
    kernels = _Called(march, step, begin, sum_law_energies, update_shear_peaks)
    motion = _Motion(halvings, h, coefficients, shifts, load, ground)
    scene = Scene(linear_terms, modal, law_parameters, forces, flags)
    initial = Memory(state_0, springs_0, work_0, report_0)
    memory = Memory(state, law_state, scratch, step_status)
    failed = 0
    n = linear_terms.shape[1] - 1
    for r in range(runs.shape[0]):
        first = int(runs[r, GROUND_START])
        size = int(runs[r, GROUND_SIZE])
        for i in range(ground.size):
            ground[i] = samples[first + i] * runs[r, SCALE] if i < size else 0.0
        _begin(initial, memory, observer_state)
        for i in range(rows.TOTALS_SIZE):
            totals[r, i] = totals_0[i]
        seen = Seen(observer_state, peaks[r], limits, totals[r], history)
        run = (int(runs[r, PER_SAMPLE]), int(runs[r, STRIDE]))
        done = 0
        last = int(runs[r, STEPS])
        code = 0
        at_rest = 1.0 if windows == 0 else 0.0
        for w in range(windows + 1):
            for i in range(n):  # velocities of this window alone
                kept[i] = peaks[r, rows.PEAK_VELOCITY, i]
                peaks[r, rows.PEAK_VELOCITY, i] = 0.0
                if step_status[rows.RUN_PEAKS] != 0.0:
                    scratch[int(step_status[rows.RUN_PEAKS]) + rows.PEAK_VELOCITY, i] = 0.0
            code = _go_on(kernels, motion, run, last, done, scene, memory, seen)
            fastest = 0.0
            farthest = 0.0
            for i in range(n):
                fastest = max(fastest, peaks[r, rows.PEAK_VELOCITY, i])
                farthest = max(farthest, peaks[r, rows.PEAK_DISPLACEMENT, i])
                peaks[r, rows.PEAK_VELOCITY, i] = max(kept[i], peaks[r, rows.PEAK_VELOCITY, i])
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
            drifts[r, i] = law_state[rows.DRIFT, i]
        ends[r, CODE] = code
        ends[r, STEPS_TAKEN] = done
        ends[r, AT_REST] = at_rest
    return failed
