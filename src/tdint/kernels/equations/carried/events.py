"""Shears and accelerations of the corrected motion where stories turn or change their branches within a step."""

from __future__ import annotations

from tdint.kernels import layout as at
from tdint.kernels.compiling import called, inlined
from tdint.kernels.equations.carried.rows import OWN, Carried, of_story, whole_path
from tdint.kernels.equations.moment4 import ROW
from tdint.kernels.linear_terms import FORCES, MODAL, add_modal_force, force_value
from tdint.kernels.stories import error_path, path
from tdint.kernels.stories.error_path import RESULT


@inlined
def shake_at_events(carried):
    """Raise the peaks of shears, and of accelerations of the floors at both ends of a story, by those at which it turns
    or changes its branch."""
    scene, memory, _, _, base = carried
    work = memory.work
    n = scene.linear_terms.shape[1] - 1
    for i in range(n):
        if work[base + OWN.CALM, i] != 0.0:
            continue
        row = base + OWN.PEAKS + at.PEAK_SHEAR
        work[row, i] = max(work[row, i], work[base + OWN.PATH + RESULT.LARGEST, n + 1 + i])
        first = work[base + OWN.PATH + RESULT.EVENT, n + 1 + i]
        last = work[base + OWN.PATH + RESULT.LAST_EVENT, n + 1 + i]
        if first > 0.0:
            _shake(scene, carried.h, carried.load, memory, base, i, first)
        if last > first:
            _shake(scene, carried.h, carried.load, memory, base, i, last)


@called
def _shake(scene, h, load, memory, base, i, t):
    """Raise the peak accelerations of the floors at both ends of story `i` by those at t."""
    carried = Carried(scene, memory, load, h, base)
    linear_terms, modal, _, forces, _ = scene
    work = memory.work
    n = linear_terms.shape[1] - 1
    if (MODAL or FORCES) and forces.shape[0] + modal.shape[0] > 0:
        for floor in range(n):
            work[base + OWN.TURN, floor] = _rate_at(work, base, t, floor) / h
            work[base + OWN.OTHER, floor] = 0.0
        for j in range(forces.shape[0]):
            work[base + OWN.OTHER, int(forces[j, at.FLOOR])] += force_value(forces, j, load[at.TIME] + t * h)
        add_modal_force(modal, work, base + OWN.TURN, -1.0, work, base + OWN.OTHER, n)
    for floor in range(max(i - 1, 0), i + 1):
        above = _story_at(carried, t, floor + 1) if floor + 1 < n else 0.0
        damped = linear_terms[at.FLOOR_DAMPER, floor] * _rate_at(work, base, t, floor) / h
        force = (
            linear_terms[at.LINK, floor + 1] * above
            - _story_at(carried, t, floor)
            - damped
            + work[base + OWN.OTHER, floor]
        )
        row = base + OWN.PEAKS + at.PEAK_ACCELERATION
        work[row, floor] = max(work[row, floor], abs(linear_terms[at.INVERSE_MASS, floor] * force))


@inlined
def _rate_at(work, base, t, i):
    """h times the velocity of a floor on the companion's path."""
    s = t - 0.5
    parabola = work[ROW.RISE, i] + work[base + OWN.RISE, i] + s * (work[ROW.BEND, i] + work[base + OWN.BEND, i])
    even = 120.0 * s * (s * s - 0.25) * work[base + OWN.EVEN, i]
    return parabola + even + (2.5 - 30.0 * s * s) * work[base + OWN.ODD, i]


@called
def _story_at(carried, t, i):
    """Force of story `i` and its linear damper at t; between changes of branch it is taken as linear."""
    scene, memory, _, h, base = carried
    _, springs, work, _ = memory
    linear_terms = scene.linear_terms
    c = linear_terms.shape[1] + i
    whole = whole_path(carried, i)
    even, odd = of_story(carried, base + OWN.EVEN, i), of_story(carried, base + OWN.ODD, i)
    drift = path.drift_at(whole, t) + error_path.even(t - 0.5) * even + error_path.odd(t - 0.5) * odd
    rate = _rate_at(work, base, t, i)
    if i > 0:
        rate -= linear_terms[at.LINK, i] * _rate_at(work, base, t, i - 1)
    force = springs[at.FORCE, c]
    if work[base + OWN.CALM, i] != 0.0:
        force += springs[at.SLOPE, c] * (drift - whole.start)
    else:
        out = base + OWN.PATH
        first, last = work[out + RESULT.EVENT, c], work[out + RESULT.LAST_EVENT, c]
        begin, end, following = 0.0, 1.0, springs[at.FIRST_TRIAL + at.FORCE, c]
        if first > 0.0 and t <= first:
            end, following = first, work[out + RESULT.EVENT_FORCE, c]
        elif first > 0.0:
            begin, force = first, work[out + RESULT.EVENT_FORCE, c]
            if t <= last and last > first:
                end, following = last, work[out + RESULT.LAST_EVENT_FORCE, c]
            elif last > first:
                begin, force = last, work[out + RESULT.LAST_EVENT_FORCE, c]
        force += (t - begin) / (end - begin) * (following - force)
    return force + linear_terms[at.GEOMETRIC, i] * drift + linear_terms[at.STORY_DAMPER, i] * rate / h
