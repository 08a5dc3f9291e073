"""Many marches of one building in one call: other ground motions, scales and steps, the same method."""

from __future__ import annotations

from tdint.kernels import layout as at
from tdint.kernels.compiling import CUBE, F8, I8, TABLE, VECTOR, called_at, inlined, kernel
from tdint.kernels.march.march import MARCH
from tdint.kernels.march.stories import BEGIN, RAISE_SHEARS, TAKE_STOCK
from tdint.kernels.stepping import STEP

# runs: one row each
GROUND_START = 0  # of the run's ground acceleration among all samples
GROUND_SIZE = 1  # its number of samples
SCALE = 2  # factor on them
STEPS = 3
PER_SAMPLE = 4
STRIDE = 5
RUN_COLUMNS = 6

# ends: one row for each run
CODE = 0  # as `march` returns it
STEPS_TAKEN = 1
AT_REST = 2  # 1 if the motion has died, or that was not asked for
END_COLUMNS = 3

call_march = called_at(MARCH)


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


@kernel(
    I8(
        MARCH, STEP, BEGIN, TAKE_STOCK, RAISE_SHEARS,
        I8,  # how often a step may be halved
        F8,  # h
        VECTOR,  # samples of all ground motions
        TABLE,  # runs
        VECTOR, VECTOR,  # coefficients, shifts
        TABLE, TABLE, TABLE, TABLE,  # chain, modal, laws, forces
        TABLE, TABLE, VECTOR, VECTOR,  # what state, springs, memo and observed are at the start
        TABLE, TABLE, TABLE,  # state, springs, work
        VECTOR, VECTOR, VECTOR,  # memo, load, ground: as long as the longest motion
        TABLE, TABLE,  # watch, limits
        VECTOR,  # kept: a number for each story
        TABLE,  # history, without rows
        I8,  # steps of a window at the end in which the motion is seen to have died
        I8,  # most windows; 0: runs end with their steps
        F8,  # largest velocity in a window at rest, over the largest displacement of the run, 1/s
        CUBE,  # peaks of each run
        TABLE,  # drifts of each run at its end
        TABLE,  # observed of each run
        TABLE,  # ends
    ),
    parts=(),
)  # fmt: skip
def many(
    march, step, begin, take_stock, raise_shears, halvings, h, samples, runs, coefficients, shifts, chain, modal, laws,
    forces, state_0, springs_0, memo_0, observed_0, state, springs, work, memo, load, ground, watch, limits, kept,
    history, window, windows, quiet, peaks, drifts, observed, ends,
):  # fmt: skip
    """March through all runs; each begins as if it were alone. Returns how many of them did not get to their end."""
    failed = 0
    n = chain.shape[1] - 1
    for r in range(runs.shape[0]):
        first = int(runs[r, GROUND_START])
        size = int(runs[r, GROUND_SIZE])
        for i in range(ground.size):
            ground[i] = samples[first + i] * runs[r, SCALE] if i < size else 0.0
        _copy(state_0, state)
        _copy(springs_0, springs)
        _fill(work, 0.0)
        _fill(watch, 0.0)
        for i in range(memo.size):
            memo[i] = memo_0[i]
        for i in range(at.OBSERVED_SIZE):
            observed[r, i] = observed_0[i]
        done = 0
        steps = int(runs[r, STEPS])
        last = steps
        code = 0
        at_rest = 1.0 if windows == 0 else 0.0
        for w in range(windows + 1):
            for i in range(n):  # velocities of this window alone
                kept[i] = peaks[r, at.PEAK_VELOCITY, i]
                peaks[r, at.PEAK_VELOCITY, i] = 0.0
                if memo[at.OWN_PEAKS] != 0.0:
                    work[int(memo[at.OWN_PEAKS]) + at.PEAK_VELOCITY, i] = 0.0
            code = call_march(
                march, step, begin, take_stock, raise_shears, last, done, last, int(runs[r, PER_SAMPLE]),
                int(runs[r, STRIDE]), halvings, h, ground, coefficients, shifts, chain, modal, laws, forces,
                state, springs, work, memo, load, watch, peaks[r], limits, observed[r], history,
            )  # fmt: skip
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
