"""Peaks of the motion that a run of moment4 is corrected to by the error that it carries along."""

from __future__ import annotations

from tdint.kernels import layout as at
from tdint.kernels.bundles import Passage, Span
from tdint.kernels.compiling import called, inlined
from tdint.kernels.equations.carried.rows import OWN, first_row
from tdint.kernels.linear_terms import FORCES, MODAL, add_modal_force, force_value, power_damper
from tdint.kernels.march.peaks_between_steps import look_within, raise_peak
from tdint.kernels.stories.law_state import reach

_SET = 5  # rows of one of two sets
_NEAR = 0.7  # of a peak: from there on a resolved motion may pass it within a step


@inlined
def observe_error(scene, h, load, memory):
    """Take in the corrected motion at the end of a step h; at the start with h = 0.

    Accelerations are found where some value may be near its peak, as that of the run tells, and what lies within the
    step is looked at where, besides, something turns.
    """
    linear_terms = scene.linear_terms
    state, springs, work, report = memory
    n = linear_terms.shape[1] - 1
    base = first_row(scene.modal)
    ground = load[at.GROUND_1] if h > 0.0 else load[at.GROUND_0]
    side = int(report[at.ERROR_SIDE])
    old = base + OWN.SEEN + side * _SET
    now = base + OWN.SEEN + (1 - side) * _SET
    peaks = base + OWN.PEAKS
    near = h == 0.0
    turning = False
    v_below = 0.0
    old_below = 0.0
    for i in range(n):
        link = linear_terms[at.LINK, i]
        u = state[at.DISPLACEMENT, i] + state[at.ERROR_DISPLACEMENT, i]
        v = state[at.VELOCITY, i] + state[at.ERROR_VELOCITY, i]
        v_old = work[old + 1, i]
        work[now, i] = u
        work[now + 1, i] = v
        a = state[at.ACCELERATION, i]
        shaken = abs(a + ground) >= _NEAR * work[peaks + at.PEAK_ACCELERATION, i]
        story = _raise(work, peaks + at.PEAK_DRIFT, i, springs[at.DRIFT, n + 1 + i])
        story |= _raise(work, peaks + at.PEAK_SHEAR, i, springs[at.FORCE, n + 1 + i])
        floor = _raise(work, peaks + at.PEAK_DISPLACEMENT, i, u)
        fast = _raise(work, peaks + at.PEAK_VELOCITY, i, v)
        turning |= shaken | (story & ((v - link * v_below) * (v_old - link * old_below) <= 0.0))
        turning |= (floor & (v * v_old <= 0.0)) | (fast & (a * work[base + OWN.BEFORE, i] <= 0.0))
        near |= shaken | story | floor | fast
        work[base + OWN.BEFORE, i] = a
        v_below = v
        old_below = v_old
    known = 0.0
    if near:
        known = 1.0
        _accelerations(scene, load[at.TIME] + h, memory, base, now)
        if turning and report[at.ERROR_KNOWN] != 0.0:
            _look(scene, Span(h, load[at.GROUND_0], ground, True, scene.flags[at.FAST] != 0.0), memory, old, now)
    report[at.ERROR_KNOWN] = known
    report[at.ERROR_SIDE] = 1.0 - side
    if scene.flags[at.FAST] != 0.0:
        for i in range(n):
            work[now + 3, i] = work[old + 1, i]
            work[now + 4, i] = work[old + 2, i]


@inlined
def _raise(work, row, i, value):
    """Raise a peak; returns whether the value is near it."""
    size = abs(value)
    peak = work[row, i]
    work[row, i] = max(size, peak)
    return size >= _NEAR * peak


@called
def _look(scene, span, memory, old, now):
    """Peaks within the step, between two sets of rows."""
    springs, work = memory.springs, memory.work
    n = scene.linear_terms.shape[1] - 1
    base = first_row(scene.modal)
    story = base + OWN.STORY
    for i in range(n):
        work[old + 2, i] -= span.ground_0
        work[now + 2, i] -= span.ground_1
        work[story + at.DRIFT, i] = springs[at.DRIFT, n + 1 + i]
        work[story + at.FORCE, i] = springs[at.FORCE, n + 1 + i]
    passage = Passage(work, old, work[now : now + 2], work, now + 2)
    stories = work[story : story + 2]
    if look_within(span, scene, passage, stories, work, base + OWN.TURN, work, base + OWN.PEAKS) > 0:
        for i in range(n):
            turn = work[base + OWN.TURN, i]
            if turn != work[story, i]:
                reach(scene.law_parameters, springs, n + 1 + i, at.COMMITTED, at.FIRST_TRIAL, turn)
                raise_peak(work, base + OWN.PEAKS + at.PEAK_SHEAR, i, springs[at.FIRST_TRIAL + at.FORCE, n + 1 + i])
    for i in range(n):
        work[old + 2, i] += span.ground_0
        work[now + 2, i] += span.ground_1


@inlined
def _accelerations(scene, t, memory, base, now):
    """Absolute accelerations of the corrected motion from equilibrium, and their peaks."""
    linear_terms, modal, _, forces, _ = scene
    _, springs, work, _ = memory
    n = linear_terms.shape[1] - 1
    if (MODAL or FORCES) and forces.shape[0] + modal.shape[0] > 0:
        for i in range(n):
            work[base + OWN.OTHER, i] = 0.0
        for j in range(forces.shape[0]):
            work[base + OWN.OTHER, int(forces[j, at.FLOOR])] += force_value(forces, j, t)
        add_modal_force(modal, work, now + 1, -1.0, work, base + OWN.OTHER, n)
    before = v_below = 0.0
    for i in range(n + 1):
        story = v = 0.0
        link = linear_terms[at.LINK, i]
        if i < n:
            v = work[now + 1, i]
            rate = v - link * v_below
            story = springs[at.FORCE, n + 1 + i] + linear_terms[at.GEOMETRIC, i] * springs[at.DRIFT, n + 1 + i]
            story += linear_terms[at.STORY_DAMPER, i] * rate + power_damper(linear_terms, i, rate)[0]
        if i > 0:
            inner = (
                work[base + OWN.OTHER, i - 1] - linear_terms[at.FLOOR_DAMPER, i - 1] * v_below - before + link * story
            )
            a = linear_terms[at.INVERSE_MASS, i - 1] * inner
            work[now + 2, i - 1] = a
            raise_peak(work, base + OWN.PEAKS + at.PEAK_ACCELERATION, i - 1, a)
        v_below = v
        before = story
