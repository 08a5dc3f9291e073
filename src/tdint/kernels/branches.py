"""Drift laws branch by branch.

On a branch the force is linear in the drift. A branch ends where the drift leaves (LOWER, UPPER), or where the drift
rate turns against TURN. `switch` tells what follows; the rest is common to all such laws. The Bouc-Wen law is curved,
but it has a kink where the drift rate turns: it has such branches too, without a slope.
"""

from __future__ import annotations

import math

from tdint.kernels.compiling import called, inlined
from tdint.kernels.layout import (
    CODE,
    DISSIPATED,
    DRIFT,
    FIRST_PARAMETER,
    FORCE,
    HIGH_DRIFT,
    HIGH_FORCE,
    INTERNAL,
    LOW_DRIFT,
    LOW_FORCE,
    LOWER,
    SLOPE,
    SPRING_ROWS,
    STIFFNESS,
    TURN,
    UPPER,
    WORK,
)

# Numbers of the laws in the compiled code (tdint.model.laws)
LINEAR_LAW = 0
POLYNOMIAL_LAW = 1
BILINEAR_LAW = 2
PEAK_ORIENTED_LAW = 3
TANH_LAW = 4
BOUC_WEN_LAW = 5
GAP_LAW = 6

# Ways in which a branch ends
ABOVE = 1.0
BELOW = -1.0
TURNED = 0.0

# Kinds of branches of the peak-oriented law, in INTERNAL; negative on the negative side, 0 before the first yielding
YIELDING = 1.0
RELOADING = 2.0
UNLOADING = 3.0


@called
def enter(laws, springs, i):
    """Put the committed state of story `i` on its branch: a law's first one, or the bilinear one that its state
    implies."""
    k = laws[STIFFNESS, i]
    springs[SLOPE, i] = math.inf if laws[CODE, i] in (POLYNOMIAL_LAW, TANH_LAW, BOUC_WEN_LAW) else k
    springs[TURN, i] = 0.0
    springs[UPPER, i] = math.inf
    springs[LOWER, i] = -math.inf
    if laws[CODE, i] == BILINEAR_LAW:
        soft = 1.0 - laws[FIRST_PARAMETER + 1, i]
        strength = soft * laws[FIRST_PARAMETER, i]
        springs[UPPER, i] = springs[DRIFT, i] + (strength - springs[INTERNAL, i]) / (soft * k)
        springs[LOWER, i] = springs[DRIFT, i] - (strength + springs[INTERNAL, i]) / (soft * k)
    elif laws[CODE, i] == PEAK_ORIENTED_LAW:
        strength = laws[FIRST_PARAMETER, i]
        springs[HIGH_DRIFT, i] = springs[UPPER, i] = strength / k
        springs[LOW_DRIFT, i] = springs[LOWER, i] = -strength / k
        springs[HIGH_FORCE, i] = strength
        springs[LOW_FORCE, i] = -strength
    elif laws[CODE, i] == GAP_LAW:
        gap = laws[FIRST_PARAMETER, i]
        drift = springs[DRIFT, i]
        _enter_gap(laws, springs, i, 0, 0.0 if abs(drift) < gap else math.copysign(1.0, drift))


@inlined
def _enter_gap(laws, springs, i, block, side):
    """Put story `i` into the gap (side 0) or against the stop on that side of it."""
    gap = laws[FIRST_PARAMETER, i]
    drift = springs[block + DRIFT, i]
    stop = abs(side) * laws[FIRST_PARAMETER + 1, i]
    springs[block + FORCE, i] = laws[STIFFNESS, i] * drift + stop * (drift - side * gap)
    springs[block + SLOPE, i] = laws[STIFFNESS, i] + stop
    springs[block + UPPER, i] = math.inf if side > 0.0 else side * gap if side < 0.0 else gap
    springs[block + LOWER, i] = -math.inf if side < 0.0 else side * gap if side > 0.0 else -gap


@inlined
def advance(laws, springs, i, block, drift):
    """Go to `drift` on the present branch of the state in `block`."""
    step = drift - springs[block + DRIFT, i]
    force = springs[block + FORCE, i]
    new = force + springs[block + SLOPE, i] * step
    springs[block + DRIFT, i] = drift
    springs[block + FORCE, i] = new
    if laws[CODE, i] == BILINEAR_LAW:
        if springs[block + TURN, i] == 0.0:
            springs[block + INTERNAL, i] = new - laws[FIRST_PARAMETER + 1, i] * laws[STIFFNESS, i] * drift
        else:
            springs[block + DISSIPATED, i] += abs(springs[block + INTERNAL, i] * step)
    elif laws[CODE, i] == PEAK_ORIENTED_LAW:
        springs[block + WORK, i] += 0.5 * (force + new) * step
        springs[block + DISSIPATED, i] = springs[block + WORK, i] - elastic_energy(laws, springs, i, block)


@called
def switch(laws, springs, i, block, event):
    """Change to the branch that follows the present one in `block` after it ended by `event`."""
    code = laws[CODE, i]
    if code == BILINEAR_LAW:
        _switch_bilinear(laws, springs, i, block, event)
    elif code == PEAK_ORIENTED_LAW:
        _switch_peak_oriented(laws, springs, i, block, event)
    elif code == GAP_LAW:
        inside = springs[block + UPPER, i] + springs[block + LOWER, i] == 0.0
        _enter_gap(laws, springs, i, block, event if inside else 0.0)
    else:  # Bouc-Wen: the drift rate has turned
        springs[block + TURN, i] = -springs[block + TURN, i]


@inlined
def _switch_bilinear(laws, springs, i, block, event):
    k = laws[STIFFNESS, i]
    hardening = laws[FIRST_PARAMETER + 1, i]
    strength = (1.0 - hardening) * laws[FIRST_PARAMETER, i]
    drift = springs[block + DRIFT, i]
    if event == TURNED:
        side = springs[block + TURN, i]
        back = drift - side * 2.0 * strength / ((1.0 - hardening) * k)
        springs[block + SLOPE, i] = k
        springs[block + TURN, i] = 0.0
        springs[block + UPPER, i] = max(drift, back)
        springs[block + LOWER, i] = min(drift, back)
    else:
        springs[block + INTERNAL, i] = event * strength
        springs[block + FORCE, i] = hardening * k * drift + event * strength
        springs[block + SLOPE, i] = hardening * k
        springs[block + TURN, i] = event
        springs[block + UPPER, i] = math.inf
        springs[block + LOWER, i] = -math.inf


@inlined
def unloading_stiffness(laws, springs, i, block, side):
    """k (dy / |largest drift on that side|)^unloading of the peak-oriented law (Takeda, Sozen and Nielsen 1970)."""
    k = laws[STIFFNESS, i]
    drift = springs[block + DRIFT, i]  # the farthest one where the story yields at present
    farthest = max(springs[block + HIGH_DRIFT, i], drift) if side > 0.0 else -min(springs[block + LOW_DRIFT, i], drift)
    return k * (laws[FIRST_PARAMETER, i] / (k * farthest)) ** laws[FIRST_PARAMETER + 2, i]


@called
def elastic_energy(laws, springs, i, block):
    """Energy that the peak-oriented law gives back on unloading from its state in `block`, J."""
    force = springs[block + FORCE, i]
    return 0.5 * force * force / unloading_stiffness(laws, springs, i, block, force)


@inlined
def _switch_peak_oriented(laws, springs, i, block, event):
    """Backbone, unloading to zero force, reloading towards the farthest point of the other side (Clough 1966)."""
    kind = springs[block + INTERNAL, i]
    drift = springs[block + DRIFT, i]
    force = springs[block + FORCE, i]
    if event == TURNED:
        side = springs[block + TURN, i]
        if abs(kind) == YIELDING:
            if side > 0.0:
                springs[block + HIGH_DRIFT, i] = drift
                springs[block + HIGH_FORCE, i] = force
            else:
                springs[block + LOW_DRIFT, i] = drift
                springs[block + LOW_FORCE, i] = force
        slope = unloading_stiffness(laws, springs, i, block, side)
        zero = drift - force / slope
        springs[block + INTERNAL, i] = side * UNLOADING
        springs[block + SLOPE, i] = slope
        springs[block + TURN, i] = 0.0
        springs[block + UPPER, i] = max(drift, zero)
        springs[block + LOWER, i] = min(drift, zero)
        return
    # The branch ended in the direction of `event`: load further on that side.
    target = springs[block + HIGH_DRIFT, i] if event > 0.0 else springs[block + LOW_DRIFT, i]
    target_force = springs[block + HIGH_FORCE, i] if event > 0.0 else springs[block + LOW_FORCE, i]
    springs[block + TURN, i] = event
    if event * (target - drift) > 1e-12 * abs(target):
        springs[block + INTERNAL, i] = event * RELOADING
        springs[block + SLOPE, i] = (target_force - force) / (target - drift)
        springs[block + UPPER, i] = target if event > 0.0 else math.inf
        springs[block + LOWER, i] = target if event < 0.0 else -math.inf
    else:
        springs[block + INTERNAL, i] = event * YIELDING
        springs[block + SLOPE, i] = laws[FIRST_PARAMETER + 1, i] * laws[STIFFNESS, i]
        springs[block + UPPER, i] = math.inf
        springs[block + LOWER, i] = -math.inf


@called
def walk(laws, springs, i, past, trial, drift):
    """Go straight from the state in `past` to `drift`, over as many branches as lie on the way; returns the tangent."""
    for row in range(SPRING_ROWS):
        springs[trial + row, i] = springs[past + row, i]
    if springs[trial + TURN, i] * (drift - springs[trial + DRIFT, i]) < 0.0:
        switch(laws, springs, i, trial, TURNED)
    for _ in range(8):
        if drift > springs[trial + UPPER, i]:
            advance(laws, springs, i, trial, springs[trial + UPPER, i])
            switch(laws, springs, i, trial, ABOVE)
        elif drift < springs[trial + LOWER, i]:
            advance(laws, springs, i, trial, springs[trial + LOWER, i])
            switch(laws, springs, i, trial, BELOW)
        else:
            break
    advance(laws, springs, i, trial, drift)
    return springs[trial + SLOPE, i]
