"""Drift laws: restoring force and tangent of a story from its drift and its committed state.

A law is one function and one line in `restoring`; what a model file may say about it stands in `tdint.model.laws`.
Each function writes drift, force and internal variable of the trial state and returns the tangent stiffness, N/m.
"""

from __future__ import annotations

import math

from tdint.kernels.bouc_wen import bouc_wen
from tdint.kernels.branches import (
    BILINEAR_LAW,
    BOUC_WEN_LAW,
    GAP_LAW,
    LINEAR_LAW,
    PEAK_ORIENTED_LAW,
    TANH_LAW,
    elastic_energy,
    enter,
    walk,
)
from tdint.kernels.compiling import inlined
from tdint.kernels.layout import (
    CODE,
    DISSIPATED,
    DRIFT,
    FIRST_PARAMETER,
    FIRST_TRIAL,
    FORCE,
    INTERNAL,
    PLAIN_ROWS,
    SPRING_ROWS,
    STIFFNESS,
    TURN,
)


@inlined
def restoring(laws, springs, i, past, trial, drift):
    """Force of story `i` at `drift`, reached from the state in block `past`; written to block `trial`."""
    springs[trial + DRIFT, i] = drift
    code = laws[CODE, i]
    if code == LINEAR_LAW:
        springs[trial + FORCE, i] = laws[STIFFNESS, i] * drift
        return laws[STIFFNESS, i]
    if code == BILINEAR_LAW:
        return _bilinear(laws, springs, i, past, trial, drift)
    if code == PEAK_ORIENTED_LAW:
        return walk(laws, springs, i, past, trial, drift)
    if code == TANH_LAW:
        return _tanh(laws, springs, i, trial, drift)
    if code == BOUC_WEN_LAW:
        return bouc_wen(laws, springs, i, past, trial, drift)
    if code == GAP_LAW:
        return _gap(laws, springs, i, trial, drift)
    return _polynomial(laws, springs, i, trial, drift)


@inlined
def _polynomial(laws, springs, i, trial, drift):
    """f = c1 d + c2 d^2 + ..., by Horner's rule."""
    force = 0.0
    tangent = 0.0
    for row in range(laws.shape[0] - 1, FIRST_PARAMETER - 1, -1):
        force = force * drift + laws[row, i]
        tangent = tangent * drift + (row - FIRST_PARAMETER + 1) * laws[row, i]
    springs[trial + FORCE, i] = force * drift
    return tangent


@inlined
def _bilinear(laws, springs, i, past, trial, drift):
    """f = a k d + z, dz = (1 - a) k dd, |z| <= (1 - a) Fy: kinematic hardening.

    z is an elastic-perfectly plastic spring beside an elastic one (Prandtl's element with a spring in parallel).
    """
    k = laws[STIFFNESS, i]
    hardening = laws[FIRST_PARAMETER + 1, i]
    strength = (1.0 - hardening) * laws[FIRST_PARAMETER, i]
    z = springs[past + INTERNAL, i] + (1.0 - hardening) * k * (drift - springs[past + DRIFT, i])
    tangent = k
    if z > strength:
        z = strength
        tangent = hardening * k
    elif z < -strength:
        z = -strength
        tangent = hardening * k
    springs[trial + INTERNAL, i] = z
    springs[trial + FORCE, i] = hardening * k * drift + z
    return tangent


@inlined
def _tanh(laws, springs, i, trial, drift):
    """f = F tanh(k d / F): elastic, softening towards the strength F."""
    strength = laws[FIRST_PARAMETER, i]
    part = math.tanh(laws[STIFFNESS, i] * drift / strength)
    springs[trial + FORCE, i] = strength * part
    return laws[STIFFNESS, i] * (1.0 - part * part)


@inlined
def _gap(laws, springs, i, trial, drift):
    """f = k d, and the stop's ks (|d| - gap) more beyond the gap: elastic pounding against a stop on either side."""
    force = laws[STIFFNESS, i] * drift
    tangent = laws[STIFFNESS, i]
    beyond = abs(drift) - laws[FIRST_PARAMETER, i]
    if beyond > 0.0:
        force += math.copysign(laws[FIRST_PARAMETER + 1, i] * beyond, drift)
        tangent += laws[FIRST_PARAMETER + 1, i]
    springs[trial + FORCE, i] = force
    return tangent


@inlined
def settle(laws, springs, i, past, trial):
    """Energy that the law dissipates on the way from block `past` to block `trial`; adds it up in `trial`, J."""
    if laws[CODE, i] == PEAK_ORIENTED_LAW or laws[CODE, i] == BOUC_WEN_LAW:
        return  # summed up on the way
    dissipated = springs[past + DISSIPATED, i]
    if laws[CODE, i] == BILINEAR_LAW:
        z = springs[trial + INTERNAL, i]
        soft = 1.0 - laws[FIRST_PARAMETER + 1, i]
        if abs(z) == soft * laws[FIRST_PARAMETER, i]:  # else the way was elastic
            stretch = springs[trial + DRIFT, i] - springs[past + DRIFT, i]
            slip = stretch - (z - springs[past + INTERNAL, i]) / (soft * laws[STIFFNESS, i])
            dissipated += abs(z * slip)
    springs[trial + DISSIPATED, i] = dissipated


@inlined
def recoverable(laws, springs, i):
    """Energy stored in the law's committed state, J."""
    d = springs[DRIFT, i]
    if laws[CODE, i] == LINEAR_LAW:
        return 0.5 * laws[STIFFNESS, i] * d * d
    if laws[CODE, i] == BILINEAR_LAW:
        hardening = laws[FIRST_PARAMETER + 1, i]
        k = laws[STIFFNESS, i]
        z = springs[INTERNAL, i]
        return 0.5 * hardening * k * d * d + 0.5 * z * z / ((1.0 - hardening) * k)
    if laws[CODE, i] == PEAK_ORIENTED_LAW:
        return elastic_energy(laws, springs, i, 0)
    if laws[CODE, i] == TANH_LAW:
        strength = laws[FIRST_PARAMETER, i]
        x = abs(laws[STIFFNESS, i] * d / strength)
        # ln cosh x, without overflow
        return strength * strength / laws[STIFFNESS, i] * (x + math.log1p(math.exp(-2.0 * x)) - math.log(2.0))
    if laws[CODE, i] == BOUC_WEN_LAW:
        strength = laws[FIRST_PARAMETER, i]
        hardening = laws[FIRST_PARAMETER + 1, i]
        z = strength * springs[INTERNAL, i]
        return 0.5 * hardening * laws[STIFFNESS, i] * d * d + 0.5 * (1.0 - hardening) * z * z / laws[STIFFNESS, i]
    if laws[CODE, i] == GAP_LAW:
        beyond = max(abs(d) - laws[FIRST_PARAMETER, i], 0.0)
        return 0.5 * laws[STIFFNESS, i] * d * d + 0.5 * laws[FIRST_PARAMETER + 1, i] * beyond * beyond
    energy = 0.0
    for row in range(laws.shape[0] - 1, FIRST_PARAMETER - 1, -1):
        energy = energy * d + laws[row, i] / (row - FIRST_PARAMETER + 2)
    return energy * d * d


@inlined
def commit(laws, springs, i, past, trial):
    """Make the trial state of story `i` the committed one; `past` is the block that it was reached from."""
    settle(laws, springs, i, past, trial)
    if laws[CODE, i] == BOUC_WEN_LAW:
        stretch = springs[trial + DRIFT, i] - springs[past + DRIFT, i]
        if stretch != 0.0:
            springs[TURN, i] = math.copysign(1.0, stretch)
    rows = SPRING_ROWS if laws[CODE, i] == PEAK_ORIENTED_LAW else PLAIN_ROWS
    for row in range(rows):
        springs[row, i] = springs[trial + row, i]


@inlined
def resume(laws, springs, i):
    """Put story `i` on the branch that its committed state implies, after a step that does not follow branches."""
    if laws[CODE, i] != PEAK_ORIENTED_LAW and laws[CODE, i] != BOUC_WEN_LAW:  # which always follow them
        enter(laws, springs, i)


@inlined
def start(laws, springs, i, drift):
    """Bring story `i` from rest to its initial drift."""
    enter(laws, springs, i)
    restoring(laws, springs, i, 0, FIRST_TRIAL, drift)
    commit(laws, springs, i, 0, FIRST_TRIAL)
    resume(laws, springs, i)
