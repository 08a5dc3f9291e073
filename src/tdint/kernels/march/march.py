"""The time loop: one compiled march for all methods, which takes the compiled step as an argument."""

from __future__ import annotations

from tdint.kernels import layout as at
from tdint.kernels.compiling import F8, I8, TABLE, VECTOR, called, inlined, kernel
from tdint.kernels.march.ground import ground_at, straightened, straightened_samples
from tdint.kernels.march.observing import (
    ACCELERATION_ROW,
    TURN,
    begin_energies,
    beyond_limits,
    look_between,
    note_collapse,
    observe,
    remember,
    shift_ground,
    store,
)
from tdint.kernels.march.stories import (
    BEGIN,
    RAISE_SHEARS,
    TAKE_STOCK,
    call_begin,
    call_raise_shears,
    call_take_stock,
)
from tdint.kernels.stepping import STEP, call_step

MARCH = I8(
    STEP,  # step
    BEGIN,  # what brings the drift laws to the initial state
    TAKE_STOCK,  # what sums up their energies
    RAISE_SHEARS,  # what finds their forces where they turned
    I8,  # steps of the whole run
    I8,  # steps of it that are done
    I8,  # steps until which to go on
    I8,  # steps per sample of the ground motion
    I8,  # samples per as many steps; 1 where a step is not longer than a sampling interval
    I8,  # how often a step may be halved
    F8,  # h
    VECTOR,  # ground acceleration
    VECTOR,  # coefficients
    VECTOR,  # what of a jump of the ground acceleration each row of the state takes
    TABLE,  # chain
    TABLE,  # modal
    TABLE,  # laws
    TABLE,  # forces
    TABLE,  # state
    TABLE,  # springs
    TABLE,  # work of the step
    VECTOR,  # memo
    VECTOR,  # load, LOAD_SIZE numbers of scratch
    TABLE,  # work of the observer
    TABLE,  # peaks
    TABLE,  # limits of the drifts
    VECTOR,  # observed
    TABLE,  # history: the start and each k-th step, k = steps / (rows - 1) a whole number; no rows for none
)

RUNAWAY = 1e6
"""Displacement beyond which a response is called diverged, m."""


@inlined
def _start(begin, take_stock, chain, modal, laws, forces, ground, state, springs, memo, watch, peaks, observed):
    """Drift laws, acceleration and energy of the initial state."""
    n = chain.shape[1] - 1
    call_begin(begin, chain, laws, state, springs)
    observe(chain, modal, forces, 0.0, 0.0, ground, 0.0, state, springs, memo, watch, peaks, observed)
    remember(state, watch, n)
    for i in range(n):
        state[at.ACCELERATION, i] = watch[ACCELERATION_ROW, i]
    memo[at.CARRIED_GROUND] = ground
    call_take_stock(take_stock, chain, laws, state, springs, observed)
    begin_energies(chain, observed)


@inlined
def _ran_away(state, n):
    here = True
    for i in range(n):
        here &= abs(state[at.DISPLACEMENT, i]) < RUNAWAY
    return not here


@called
def _watch(take_stock, chain, laws, state, springs, limits, peaks, steps, observed):
    """Note a collapse that has not been noted yet."""
    if observed[at.COLLAPSE_STEP] == at.NO_COLLAPSE and beyond_limits(limits, springs, peaks, chain.shape[1] - 1):
        call_take_stock(take_stock, chain, laws, state, springs, observed)
        note_collapse(limits, springs, peaks, steps, observed)


@kernel(MARCH, parts=())
def march(
    step, begin, take_stock, raise_shears, steps, first, last, per_sample, stride, halvings,
    h, ground, coefficients, shifts, chain, modal, laws, forces,
    state, springs, work, memo, load, watch, peaks, limits, observed, history,
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
    `observed[STEPS_REACHED]` counts the whole steps done.
    """
    n = chain.shape[1] - 1
    ground_0 = ground_at(ground, first, per_sample, stride)
    if first == 0:
        _start(begin, take_stock, chain, modal, laws, forces, ground_0, state, springs, memo, watch, peaks, observed)
        if beyond_limits(limits, springs, peaks, n):
            note_collapse(limits, springs, peaks, 0, observed)
        if history.shape[0] > 0:
            store(chain, ground_0, ground_0, state, springs, watch, observed, history, 0)
    every = steps // max(history.shape[0] - 1, 1)
    smallest = 0.5**halvings
    for s in range(first, last):
        ground_1 = ground_at(ground, s + 1, per_sample, stride)
        slope = (ground_1 - ground_0) / h
        done = 0.0  # of the step
        piece = 1.0
        while done < 1.0:
            load[at.TIME] = (s + done) * h
            if stride > 1:
                if per_sample == 1 and piece == 1.0:
                    load[at.GROUND_0], load[at.GROUND_1] = straightened_samples(ground, s * stride, (s + 1) * stride)
                else:
                    samples = stride / per_sample
                    begins, ends = (s + done) * samples, (s + done + piece) * samples
                    load[at.GROUND_0], load[at.GROUND_1] = straightened(ground, begins, ends)
                slope = (load[at.GROUND_1] - load[at.GROUND_0]) / (piece * h)
                shift_ground(
                    chain, modal, forces, load[at.TIME], memo[at.CARRIED_GROUND] - load[at.GROUND_0],
                    load[at.GROUND_0], shifts, state, watch, observed,
                )  # fmt: skip
                memo[at.CARRIED_GROUND] = load[at.GROUND_0]
            else:
                load[at.GROUND_0] = ground_0 + done * (ground_1 - ground_0)
                load[at.GROUND_1] = (
                    ground_1 if done + piece == 1.0 else ground_0 + (done + piece) * (ground_1 - ground_0)
                )
            code = call_step(
                step, coefficients, chain, modal, laws, forces, piece * h, load, state, springs, work, memo
            )
            if code < 0:
                if code == at.NOT_FINITE or piece <= smallest:
                    _watch(take_stock, chain, laws, state, springs, limits, peaks, s, observed)
                    return code
                piece *= 0.5
                observed[at.HALVINGS] += 1.0
                memo[at.STEPS_DONE] = 0.0
                continue
            done += piece
            observed[at.ITERATIONS] += code
            memo[at.CARRIED_GROUND] = load[at.GROUND_1]
            near = observe(
                chain, modal, forces, (s + done) * h, piece * h, load[at.GROUND_1], slope,
                state, springs, memo, watch, peaks, observed,
            )  # fmt: skip
            turned = look_between(
                near, chain, laws, piece * h, load[at.GROUND_0], load[at.GROUND_1], state, springs, watch, work, memo,
                peaks, observed,
            )  # fmt: skip
            if turned > 0:
                call_raise_shears(raise_shears, laws, springs, watch, TURN, peaks)
        memo[at.STEPS_DONE] = memo[at.STEPS_DONE] + 1.0 if piece == 1.0 else 0.0
        observed[at.STEPS_REACHED] += 1.0
        if _ran_away(state, n):
            return at.NOT_FINITE
        if observed[at.COLLAPSE_STEP] == at.NO_COLLAPSE and beyond_limits(limits, springs, peaks, n):
            _watch(take_stock, chain, laws, state, springs, limits, peaks, s + 1, observed)
        if history.shape[0] > 0 and (s + 1) % every == 0:
            call_take_stock(take_stock, chain, laws, state, springs, observed)
            store(chain, ground_1, load[at.GROUND_1], state, springs, watch, observed, history, (s + 1) // every)
        ground_0 = ground_1
    if last == steps:
        call_take_stock(take_stock, chain, laws, state, springs, observed)
    return 0
