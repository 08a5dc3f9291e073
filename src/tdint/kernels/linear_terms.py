"""Loads, damping forces and equilibrium of a chain of stories."""

from __future__ import annotations

import math

from tdint.kernels import layout as rows
from tdint.kernels.compiling import VARIANT, inline, outlined

# What the kernels are compiled for: numba leaves out what stands behind a constant that is false.
MODAL = VARIANT.modal
FORCES = VARIANT.forces
DASHPOTS = VARIANT.dashpots


@inline
def force_value(forces, j, t):
    """Floor force `j` at time t, N."""
    angle = forces[j, rows.OMEGA] * t
    return forces[j, rows.COSINE] * math.cos(angle) + forces[j, rows.SINE] * math.sin(angle)


@inline
def force_rate(forces, j, t):
    """Rate of floor force `j` at time t, N/s."""
    omega = forces[j, rows.OMEGA]
    angle = omega * t
    return omega * (
        forces[j, rows.SINE] * math.cos(angle) - forces[j, rows.COSINE] * math.sin(angle)
    )


@inline
def force_impulse(forces, j, t, h):
    """Exact impulse of floor force `j` over [t, t + h], N s.

    The integral of cos over the step is h sinc(omega h / 2) times cos at mid-step, and likewise for
    sin: no cancellation.
    """
    half = 0.5 * forces[j, rows.OMEGA] * h
    sinc = math.sin(half) / half if half > 1e-4 else 1.0 - half * half / 6.0
    return h * sinc * force_value(forces, j, t + 0.5 * h)


@inline
def force_moment(forces, j, t, h):
    """Twelve times the mean of s times floor force `j` over [t, t + h], s in [-1/2, 1/2], exact, N.

    With the rate R at mid-step the part of the force that is odd there is R h / (2 x) sin(2 x s), x
    = omega h / 2.
    """
    x = 0.5 * forces[j, rows.OMEGA] * h
    if abs(x) > 0.1:
        share = (math.sin(x) - x * math.cos(x)) / (x * x * x)
    else:
        share = 1.0 / 3.0 - x * x / 30.0 * (1.0 - x * x / 28.0 * (1.0 - x * x / 54.0))
    return 3.0 * h * share * force_rate(forces, j, t + 0.5 * h)


@inline
def floor_load(linear_terms, forces, t, ground, scratch, row):
    """Load p = -m ag + floor forces at time t into a row of work, N."""
    for i in range(linear_terms.shape[1] - 1):
        scratch[row, i] = -linear_terms[rows.MASS, i] * ground
    if FORCES and forces.shape[0] > 0:
        _add_forces(forces, t, scratch, row)


@outlined
def _add_forces(forces, t, scratch, row):
    for j in range(forces.shape[0]):
        scratch[row, int(forces[j, rows.FLOOR])] += force_value(forces, j, t)


@inline
def floor_impulse(linear_terms, forces, t, h, ground_0, ground_1, scratch, row):
    """Exact impulse of the load over [t, t + h] into a row of work, N s; the ground acceleration is
    linear in between."""
    for i in range(linear_terms.shape[1] - 1):
        scratch[row, i] = -0.5 * h * linear_terms[rows.MASS, i] * (ground_0 + ground_1)
    if FORCES and forces.shape[0] > 0:
        _add_impulses(forces, t, h, scratch, row)


@outlined
def _add_impulses(forces, t, h, scratch, row):
    for j in range(forces.shape[0]):
        scratch[row, int(forces[j, rows.FLOOR])] += force_impulse(forces, j, t, h)


@inline
def mean_load(linear_terms, forces, load, h, r, scratch, row):
    """Mean of the load over a step into a row of work, and its first moment, twelve times the mean
    of the load times s in [-1/2, 1/2], into the next, N; the ground acceleration is linear.

    With r > 0 the moment of a floor force is the one that makes a part so stiff that it has no mass
    follow the force at the ends of the steps: p1 - p0 + 12 r ((p0 + p1) / 2 - mean), the first
    moment where the force is linear.
    """
    for i in range(linear_terms.shape[1] - 1):
        scratch[row, i] = (
            -0.5 * linear_terms[rows.MASS, i] * (load[rows.GROUND_0] + load[rows.GROUND_1])
        )
        scratch[row + 1, i] = -linear_terms[rows.MASS, i] * (
            load[rows.GROUND_1] - load[rows.GROUND_0]
        )
    if forces.shape[0] > 0:
        _add_means(forces, load[rows.TIME], h, r, scratch, row)


@outlined
def _add_means(forces, t, h, r, scratch, row):
    for j in range(forces.shape[0]):
        floor = int(forces[j, rows.FLOOR])
        mean = force_impulse(forces, j, t, h) / h
        scratch[row, floor] += mean
        if r > 0.0:
            before = force_value(forces, j, t)
            after = force_value(forces, j, t + h)
            scratch[row + 1, floor] += after - before + 12.0 * r * (0.5 * (before + after) - mean)
        else:
            scratch[row + 1, floor] += force_moment(forces, j, t, h)


@inline
def add_modal_force(modal, table, x, factor, scratch, row, n):
    """Add factor * C_modal * x to a row of work, with C_modal = W^T W; row `x` of `table` is the
    velocity."""
    if MODAL and modal.shape[0] > 0:
        _add_modal_force(modal, table, x, factor, scratch, row, n)


@outlined
def _add_modal_force(modal, table, x, factor, scratch, row, n):
    for j in range(modal.shape[0]):
        amplitude = 0.0
        for i in range(n):
            amplitude += modal[j, i] * table[x, i]
        amplitude *= factor
        for i in range(n):
            scratch[row, i] += amplitude * modal[j, i]


@inline
def power_damper(linear_terms, i, rate):
    """Force of the power-law dashpot of story `i` at a drift rate, N, and its slope, N s/m."""
    if DASHPOTS and linear_terms[rows.POWER_DAMPER, i] != 0.0:
        return _power_damper(linear_terms, i, rate)
    return 0.0, 0.0


@outlined
def _power_damper(linear_terms, i, rate):
    size = rate * rate + linear_terms[rows.THRESHOLD, i]
    if size == 0.0:  # an exponent of 1 or more
        return 0.0, linear_terms[rows.POWER_DAMPER, i] if linear_terms[
            rows.POWER, i
        ] == 0.0 else 0.0
    secant = linear_terms[rows.POWER_DAMPER, i] * size ** linear_terms[rows.POWER, i]
    return secant * rate, secant * (1.0 + 2.0 * linear_terms[rows.POWER, i] * rate * rate / size)


@inline
def internal_forces(linear_terms, modal, law_state, block, scratch, velocity, row, sums):
    """C v + f(u) of every floor into row `row` of work, N; story forces from the spring states in
    `block`.

    Row `velocity` of work is the velocity; its row `sums` receives the force of each story, column
    and damper.
    """
    n = linear_terms.shape[1] - 1
    below = 0.0
    for i in range(n):
        v = scratch[velocity, i]
        rate = v - linear_terms[rows.LINK, i] * below
        below = v
        scratch[sums, i] = (
            law_state[block + rows.FORCE, i]
            + linear_terms[rows.GEOMETRIC, i] * law_state[block + rows.DRIFT, i]
            + linear_terms[rows.STORY_DAMPER, i] * rate
        )
        scratch[sums, i] += power_damper(linear_terms, i, rate)[0]
    scratch[sums, n] = 0.0
    for i in range(n):
        scratch[row, i] = (
            linear_terms[rows.FLOOR_DAMPER, i] * scratch[velocity, i]
            + scratch[sums, i]
            - linear_terms[rows.LINK, i + 1] * scratch[sums, i + 1]
        )
    add_modal_force(modal, scratch, velocity, 1.0, scratch, row, n)


@inline
def finite(state, n):
    """Whether the new displacements, velocities and accelerations are numbers."""
    numbers = True
    for i in range(n):
        numbers &= (
            abs(state[rows.DISPLACEMENT, i])
            + abs(state[rows.VELOCITY, i])
            + abs(state[rows.ACCELERATION, i])
            < 1e300
        )
    return numbers
