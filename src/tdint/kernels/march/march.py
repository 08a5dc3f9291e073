"""The time loop: one compiled march for all methods, which takes the compiled step as an argument."""

from __future__ import annotations

from tdint.kernels import layout as at
from tdint.kernels.bundles import MEMORY, SCENE, SEEN, Memory, Scene, Seen, Span
from tdint.kernels.compiling import F8, I8, VECTOR, called, inlined, kernel
from tdint.kernels.march.ground import beyond_line, ground_at, straightened, straightened_samples
from tdint.kernels.march.law_energies import BEGIN, RAISE_SHEARS, TAKE_STOCK, begin_laws, sum_up, take_shears
from tdint.kernels.march.observing import (
    begin_energies,
    beyond_limits,
    look_between,
    note_collapse,
    observe,
    remember,
    shift_ground,
    store,
)
from tdint.kernels.stepping import STEP, take_step

MARCH = I8(
    STEP,  # step
    BEGIN,  # what brings the drift laws to the initial state
    TAKE_STOCK,  # what sums up their energies
    RAISE_SHEARS,  # what finds their forces where they turned
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
"""Displacement beyond which a response is called diverged, m."""


@inlined
def start(begin, take_stock, scene, ground, memory, seen):
    """Drift laws, acceleration and energy of the initial state, which may be beyond limits."""
    n = scene.linear_terms.shape[1] - 1
    state = memory.state
    begin_laws(begin, scene, memory)
    observe(scene, 0.0, Span(0.0, ground, ground, False, False), 0.0, memory, seen)
    remember(state, seen.watch, n)
    for i in range(n):
        state[at.ACCELERATION, i] = seen.watch[at.ACCELERATION_NOW, i]
    memory.report[at.CARRIED_GROUND] = ground
    sum_up(take_stock, scene, memory, seen)
    begin_energies(scene.linear_terms, seen.totals)
    watch_limits(take_stock, scene, memory, 0, seen)


@inlined
def ran_away(state, n):
    here = True
    for i in range(n):
        here &= abs(state[at.DISPLACEMENT, i]) < RUNAWAY
    return not here


@inlined
def see(raise_shears, scene, t, span, slope, memory, seen):
    """Observe the motion at time t, the end of a step or of a piece of one, and what it passed on the way."""
    near = observe(scene, t, span, slope, memory, seen)
    if look_between(near, scene, span, memory, seen) > 0:
        take_shears(raise_shears, scene, memory, seen)


@inlined
def watch_limits(take_stock, scene, memory, steps, seen):
    """Note a collapse that has not been noted yet."""
    if seen.totals[at.COLLAPSE_STEP] == at.NO_COLLAPSE and beyond_limits(memory.springs, seen):
        _collapse(take_stock, scene, memory, steps, seen)


@called
def _collapse(take_stock, scene, memory, steps, seen):
    sum_up(take_stock, scene, memory, seen)
    note_collapse(memory.springs, steps, seen)


@kernel(MARCH, parts=())
def march(
    step, begin, take_stock, raise_shears, steps, first, last, every, before, per_sample, stride, halvings,
    h, ground, coefficients, shifts, linear_terms, modal, law_parameters, forces, flags,
    state, springs, work, report, load, watch, peaks, limits, totals, history,
):  # fmt: skip
    """Integrate over the steps `first` to `last` of a run of `steps` steps of h; returns 0, or the code of the step
    that failed.

    The run begins with `first` 0 and goes on from what the march before has left: in so many pieces that whoever runs
    it can be interrupted.

    A step longer than a sampling interval takes the ground acceleration as the straight line that has its impulse and
    its first moment over the step. The lines of two steps do not meet: in between the accelerations jump as the ground
    does.

    A step that does not converge is halved up to `halvings` times over; the rest of it goes on in the smaller pieces.
    A multi-step method, whose memory holds whole steps, starts anew in and after such a step.
    `totals[STEPS_REACHED]` counts the whole steps done.
    """
    scene = Scene(linear_terms, modal, law_parameters, forces, flags)
    memory = Memory(state, springs, work, report)
    seen = Seen(watch, peaks, limits, totals, history)
    on_path = flags[at.ON_PATH] != 0.0
    fast = flags[at.FAST] != 0.0
    ground_0 = ground_at(ground, first, per_sample, stride)
    if first == 0:
        start(begin, take_stock, scene, ground_0, memory, seen)
        if history.shape[0] > 0:
            store(ground_0, ground_0, memory, seen, 0)
    smallest = 0.5**halvings
    for s in range(first, last):
        ground_1 = ground_at(ground, s + 1, per_sample, stride)
        slope = (ground_1 - ground_0) / h
        done = 0.0  # of the step
        piece = 1.0
        while done < 1.0:
            load[at.TIME] = (s + done) * h
            if stride > 1:
                samples = stride / per_sample
                begins, ends = (s + done) * samples, (s + done + piece) * samples
                if per_sample == 1 and piece == 1.0:
                    load[at.GROUND_0], load[at.GROUND_1] = straightened_samples(ground, s * stride, (s + 1) * stride)
                else:
                    load[at.GROUND_0], load[at.GROUND_1] = straightened(ground, begins, ends)
                if flags[at.CARRIES_ERROR] != 0.0:
                    load[at.GROUND_2], load[at.GROUND_3] = beyond_line(ground, begins, ends)
                slope = (load[at.GROUND_1] - load[at.GROUND_0]) / (piece * h)
                shift_ground(scene, load, shifts, memory, seen)
            else:
                load[at.GROUND_0] = ground_0 + done * (ground_1 - ground_0)
                load[at.GROUND_1] = (
                    ground_1 if done + piece == 1.0 else ground_0 + (done + piece) * (ground_1 - ground_0)
                )
            code = take_step(step, coefficients, scene, piece * h, load, memory)
            if code < 0:
                if code == at.NOT_FINITE or piece <= smallest:
                    watch_limits(take_stock, scene, memory, s, seen)
                    return code
                piece *= 0.5
                totals[at.HALVINGS] += 1.0
                report[at.STEPS_DONE] = 0.0
                continue
            done += piece
            totals[at.ITERATIONS] += code
            report[at.CARRIED_GROUND] = load[at.GROUND_1]
            span = Span(piece * h, load[at.GROUND_0], load[at.GROUND_1], on_path, fast)
            see(raise_shears, scene, (s + done) * h, span, slope, memory, seen)
        report[at.STEPS_DONE] = report[at.STEPS_DONE] + 1.0 if piece == 1.0 else 0.0
        totals[at.STEPS_REACHED] += 1.0
        if ran_away(state, linear_terms.shape[1] - 1):
            return at.NOT_FINITE
        watch_limits(take_stock, scene, memory, s + 1, seen)
        if history.shape[0] > 0 and (s + 1) % every == 0:
            sum_up(take_stock, scene, memory, seen)
            store(ground_1, load[at.GROUND_1], memory, seen, (s + 1) // every - before)
        ground_0 = ground_1
    if last == steps:
        sum_up(take_stock, scene, memory, seen)
    return 0
