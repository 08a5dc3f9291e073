"""Kernels of one story along a parabola of drift, for tests/kernels: a kernel stands in a module that
the process that compiles it can load by itself."""

from __future__ import annotations

from tdint.kernels import layout as at
from tdint.kernels.compiling import F8, I8, TABLE, kernel
from tdint.kernels.stories.law_state import commit, restoring
from tdint.kernels.stories.path import arrive, follow, keep_to_branch, stays


@kernel(I8(TABLE, F8, F8, TABLE))
def integrate_on_branch(state, rise, bend, out):
    """As `go` where the story stays on its branch: 1, else 0."""
    if not stays(state, 0, rise, bend):
        return 0
    keep_to_branch(state, 0, rise, bend, out, 0)
    return 1


@kernel(I8(TABLE, TABLE, F8, F8, TABLE))
def go(law_parameters, state, rise, bend, out):
    """Mean, moment and the four tangents into the first rows of `out`; the story goes there."""
    follow(law_parameters, state, 0, rise, bend, out, 0)
    arrive(law_parameters, state, 0, rise)
    return 0


@kernel(I8(TABLE, TABLE, F8, F8, I8, TABLE))
def walk(law_parameters, state, rise, bend, parts, out):
    """The integrals by Simpson's rule from point to point, each a drift that the law goes to straight."""
    first = state[at.DRIFT, 0]
    out[0, 0] = out[1, 0] = 0.0
    for half in range(2 * parts + 1):
        t = 0.5 * half / parts
        drift = first + t * rise + 0.5 * bend * (t * t - t)
        restoring(law_parameters, state, 0, at.COMMITTED, at.FIRST_TRIAL, drift)
        commit(law_parameters, state, 0, at.COMMITTED, at.FIRST_TRIAL)
        weight = (4.0 if half % 2 else 1.0 if half in (0, 2 * parts) else 2.0) / (6.0 * parts)
        out[0, 0] += weight * state[at.FORCE, 0]
        out[1, 0] += 12.0 * weight * (t - 0.5) * state[at.FORCE, 0]
    return 0


KERNELS = (integrate_on_branch, go, walk)
