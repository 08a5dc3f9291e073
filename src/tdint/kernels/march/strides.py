"""The time loop in strides that are chosen on the way: long where the motion is weak beside what it has come to."""

from __future__ import annotations

from tdint.kernels import layout as at
from tdint.kernels.compiling import F8, I8, VECTOR, inlined, kernel
from tdint.kernels.equations.carried.rows import OWN, first_row
from tdint.kernels.march.ground import beyond_line, ground_at, straightened_samples
from tdint.kernels.march.march import ran_away, see, start, watch_limits
from tdint.kernels.march.observing import BEGIN, RAISE_SHEARS, TAKE_STOCK, shift_ground, sum_up
from tdint.kernels.stepping import MEMORY, SCENE, SEEN, STEP, Memory, Scene, Seen, Span, take_step

# choice
ALLOWED = 0  # the largest (h / T)^4 (T^3 j)^(5/3)
PERIOD = 1  # T, s
PACE = 2  # T^3 j of the last steps, the older the less
NEXT = 3  # the next stride, in units
SHORTEST = 4  # of the strides so far, in units
LONGEST = 5
TAKEN = 6  # strides
FASTEST = 7  # a unit over the longest step that follows the building's fastest mode
DRIFTS = 8  # from here on what the stories' peak drifts are taken for at least, m

_POWER = 5.0 / 3.0  # with it a stride goes with the motion to the power of -5/12 (`march_in_strides`)
_KEPT = 0.7  # of the pace, from one step to the next: it passes zero where all stories' do
_DOUBLE = 1.0 / 24.0  # of what is allowed, below which a stride may be doubled; it then misses 16 times as much

MARCH_IN_STRIDES = I8(
    STEP,
    BEGIN,
    TAKE_STOCK,
    RAISE_SHEARS,
    I8,  # units of the whole run
    I8,  # units until which to go on
    I8,  # units per sample of the ground motion
    I8,  # units of the longest stride
    F8,  # h, s: a unit
    VECTOR,  # choice
    VECTOR,  # ground acceleration
    VECTOR,  # coefficients
    VECTOR,  # what of a jump of the ground acceleration each row of the state takes
    *SCENE,
    *MEMORY,
    VECTOR,  # load
    *SEEN,
)


@kernel(MARCH_IN_STRIDES, parts=())
def march_in_strides(
    step, begin, take_stock, raise_shears, units, last, per_sample, longest,
    h, choice, ground, coefficients, shifts, linear_terms, modal, law_parameters, forces, flags,
    state, springs, work, report, load, watch, peaks, limits, totals, history,
):  # fmt: skip
    """Integrate over `units` of h by a step that carries its error along; returns as `march` does.

    A stride has 1, 2, 4 ... `longest` units and begins at a multiple of its length. With j the largest third derivative
    of a story's drift over the step, over its peak drift so far, it is halved where (h / T)^4 (T^3 j)^(5/3) is more
    than is allowed, and doubled where it is far less. So error goes with the fourth power of the stride, and a stride
    with the motion to the power of -5/12: more than the -1/4 of a given error per time, for what is missed while the
    motion is weak hardly reaches its peaks.

    Until `last` or the first stride that ends behind it; the next call goes on from there. `totals[STEPS_REACHED]`
    counts units. No history is kept: its rows are equally far from each other.
    """
    scene = Scene(linear_terms, modal, law_parameters, forces, flags)
    memory = Memory(state, springs, work, report)
    seen = Seen(watch, peaks, limits, totals, history)
    on_path = flags[at.ON_PATH] != 0.0
    if choice[TAKEN] == 0.0:
        start(begin, take_stock, scene, ground_at(ground, 0, per_sample, 1), memory, seen)
        choice[NEXT] = min(per_sample, longest)
        choice[SHORTEST] = longest
    s = int(totals[at.STEPS_REACHED])
    stride = int(choice[NEXT])
    while s < last:
        while s % stride != 0 or s + stride > units:
            stride //= 2
        span_h = stride * h
        load[at.TIME] = s * h
        if stride > per_sample:
            begins, ends = s // per_sample, (s + stride) // per_sample
            load[at.GROUND_0], load[at.GROUND_1] = straightened_samples(ground, begins, ends)
            load[at.GROUND_2], load[at.GROUND_3] = beyond_line(ground, float(begins), float(ends))
        else:
            load[at.GROUND_0] = ground_at(ground, s, per_sample, 1)
            load[at.GROUND_1] = ground_at(ground, s + stride, per_sample, 1)
            load[at.GROUND_2] = load[at.GROUND_3] = 0.0
        if load[at.GROUND_0] != report[at.CARRIED_GROUND]:
            shift_ground(scene, load, shifts, memory, seen)
        code = take_step(step, coefficients, scene, span_h, load, memory)
        if code < 0:
            if code == at.NOT_FINITE or stride == 1:
                watch_limits(take_stock, scene, memory, s, seen)
                return code
            stride //= 2
            totals[at.HALVINGS] += 1.0
            continue
        s += stride
        totals[at.ITERATIONS] += code
        totals[at.STEPS_REACHED] = s
        choice[TAKEN] += 1.0
        choice[SHORTEST] = min(choice[SHORTEST], stride)
        choice[LONGEST] = max(choice[LONGEST], stride)
        report[at.CARRIED_GROUND] = load[at.GROUND_1]
        slope = (load[at.GROUND_1] - load[at.GROUND_0]) / span_h
        fast = choice[FASTEST] * stride > 1.0
        span = Span(span_h, load[at.GROUND_0], load[at.GROUND_1], on_path, fast, report[at.WITHIN] != 0.0)
        see(raise_shears, scene, s * h, span, slope, memory, seen)
        if ran_away(state, linear_terms.shape[1] - 1):
            return at.NOT_FINITE
        watch_limits(take_stock, scene, memory, s, seen)
        part = span_h / choice[PERIOD]
        pace = _jerk(linear_terms, work, first_row(modal) + OWN.A1, peaks, choice) / (part * part * part)
        choice[PACE] = max(pace, _KEPT * choice[PACE])
        missed = part * part * part * part * choice[PACE] ** _POWER / choice[ALLOWED]
        if missed > 1.0:
            stride = max(stride // (4 if missed > 16.0 else 2), 1)
        elif missed < _DOUBLE and stride < longest and s % (2 * stride) == 0:
            stride *= 2
    choice[NEXT] = stride
    if s == units:
        sum_up(take_stock, scene, memory, seen)
    return 0


@inlined
def _jerk(linear_terms, work, row, peaks, choice):
    """The most by which the third derivative of a story's drift, times h^3, is more than its peak drift so far; `row`
    has that of the floors."""
    most = below = 0.0
    for i in range(linear_terms.shape[1] - 1):
        jerk = abs(work[row, i] - linear_terms[at.LINK, i] * below)
        below = work[row, i]
        most = max(most, jerk / max(peaks[at.PEAK_DRIFT, i], choice[DRIFTS + i]))
    return most
