"""Loads, damping forces and internal forces of a chain of stories, with attachments and links.

Arguments have the meaning of the vocabulary in `tdint.kernels.layout` (`rows` of `tdint.plugin`).
The load of a floor is p = -m ag + forces on the floor, with its mass m and the ground acceleration
ag, which is linear within the step. With the time s from -1/2 at the start to 1/2 at the end of a
step h,

    impulse        h int p ds
    mean           int p ds
    first moment   12 int s p ds

A table is a straight line within the step, so that value, impulse and moment of its force are those
of the current step. The first moment of a line is its change over the step. A harmonic force has
the value P and the rate R (N/s) at the middle of the step, and x = OMEGA h / 2. Its odd part
R h sin(2 x s) / (2 x) has no mean, and its even part has no moment:

    impulse        h P sin(x) / x, without cancellation
    first moment   3 R h (sin x - x cos x) / x^3, with a relative error less than 1e-13

The deformation of spring `i`, the drift of a story, is the motion of its column minus LINK times
the motion of column `base_of`, and its force acts on both floors with opposite signs (`above` is
the sum over the other springs at a floor). A spring has the column of its upper floor: floor `i` of
the chain is above floor `i` - 1, and the columns of attachments follow. A link is a further spring
between two floors. It has a column without mass after all floors, which moves with its upper floor
(`tie`) and transfers its force to this floor. Laws, dampers, branches and peaks of links are
therefore the same as for stories.

A power-law dashpot with the coefficient c, the threshold rate v0 and the exponent e has at the
drift rate v

    force          c v (v^2 + v0^2)^e
    derivative     c (v^2 + v0^2)^e (1 + 2 e v^2 / (v^2 + v0^2))
"""

from __future__ import annotations

import math

from tdint.kernels import layout as rows
from tdint.kernels.compiling import FULL, inline, outlined


@inline
def is_tree(linear_terms):
    """Return True if the building has attachments or links; plain kernels do not contain this
    test."""
    return linear_terms[rows.UPPER_FLOOR, linear_terms.shape[1] - 1] != 0.0


@inline
def base_of(linear_terms, i):
    """Return the column of the lower floor of spring `i`; of a spring on the ground, a valid
    column."""
    if FULL and is_tree(linear_terms):
        return int(linear_terms[rows.BASE, i])
    return max(i - 1, 0)


@inline
def story_value(linear_terms, table, row, i):
    """Return the difference between the floors above and below story `i` in a row with a motion of
    the floors: the drift for displacements, the drift rate for velocities. The ground has the value
    0.
    """
    return table[row, i] - linear_terms[rows.LINK, i] * table[row, base_of(linear_terms, i)]


@inline
def below_next(linear_terms, i):
    """Return the column of the lower floor of the spring in the next column: `i` in a chain, also
    for the roof."""
    if FULL and is_tree(linear_terms):
        return int(linear_terms[rows.BASE, i + 1])
    return i


@inline
def below(linear_terms, table, row, i, value):
    """Return the entry of a row for the lower floor of spring `i`.

    `value` is the entry of the previous column; the loop over a chain continues with this value.
    """
    if FULL and is_tree(linear_terms):
        return table[row, int(linear_terms[rows.BASE, i])]
    return value


@inline
def above(linear_terms, table, row, i):
    """Return the forces in a row that the other springs exert on floor `i`: the sum over the
    springs that stand on it, minus the sum over the links whose upper floor it is.

    The column of a link returns its own force, so that no force remains in its column.
    """
    if FULL and is_tree(linear_terms):
        return _above(linear_terms, table, row, i, -1.0)
    return linear_terms[rows.LINK, i + 1] * table[row, i + 1]


@inline
def size_above(linear_terms, table, row, i):
    """Return the sum of the absolute values in a row over the other springs at floor `i`."""
    if FULL and is_tree(linear_terms):
        return _above(linear_terms, table, row, i, 1.0)
    return linear_terms[rows.LINK, i + 1] * table[row, i + 1]


@outlined
def _above(linear_terms, table, row, i, tied_sign):
    """Return the sum of a row over the springs on floor `i`, and with the sign `tied_sign` over the
    links below it."""
    if FULL and upper_of(linear_terms, i) != i:
        return table[row, i]
    total = 0.0
    j = int(linear_terms[rows.FIRST_ON, i])
    while j > 0:
        total += table[row, j]
        j = int(linear_terms[rows.NEXT_ON, j])
    if FULL:
        j = int(linear_terms[rows.FIRST_TIED, i])
        while j > 0:
            total += tied_sign * table[row, j]
            j = int(linear_terms[rows.NEXT_TIED, j])
    return total


@inline
def upper_of(linear_terms, i):
    """Return the column of the upper floor of spring `i`, which has the mass."""
    if FULL and is_tree(linear_terms):
        return int(linear_terms[rows.UPPER_FLOOR, i])
    return i


@inline
def count_masses(linear_terms):
    """Return the number of columns with a mass; the columns of links follow."""
    count = linear_terms.shape[1] - 1
    if FULL and is_tree(linear_terms):
        while linear_terms[rows.UPPER_FLOOR, count - 1] != count - 1:
            count -= 1
    return count


@inline
def tie(linear_terms, table, row):
    """Give the column of each link the value of its upper floor in a row with a motion."""
    if FULL and is_tree(linear_terms):
        _tie(linear_terms, table, row)


@outlined
def _tie(linear_terms, table, row):
    """Copy the values of the upper floors to the columns of the links, which are the last."""
    i = linear_terms.shape[1] - 2
    floor = int(linear_terms[rows.UPPER_FLOOR, i])
    while floor != i:
        table[row, i] = table[row, floor]
        i -= 1
        floor = int(linear_terms[rows.UPPER_FLOOR, i])


@inline
def force_value(forces, j, t):
    """Return floor force `j` at time `t`, N.

    Parameters
    ----------
    forces : ndarray
        Forces on floors.
    j : int
        Row of the force.
    t : float
        Time, s; for a table, within the current step.
    """
    if forces[j, rows.POINTS] > 0.0:
        return forces[j, rows.LINE_VALUE] + forces[j, rows.LINE_RATE] * (
            t - forces[j, rows.LINE_TIME]
        )
    angle = forces[j, rows.OMEGA] * t
    return forces[j, rows.COSINE] * math.cos(angle) + forces[j, rows.SINE] * math.sin(angle)


@inline
def force_rate(forces, j, t):
    """Return the rate of floor force `j` at time `t`, N/s.

    Parameters
    ----------
    forces : ndarray
        Forces on floors.
    j : int
        Row of the force.
    t : float
        Time, s; for a table, within the current step.
    """
    if forces[j, rows.POINTS] > 0.0:
        return forces[j, rows.LINE_RATE]
    omega = forces[j, rows.OMEGA]
    angle = omega * t
    return omega * (
        forces[j, rows.SINE] * math.cos(angle) - forces[j, rows.COSINE] * math.sin(angle)
    )


@inline
def force_impulse(forces, j, t, h):
    """Return the exact impulse of floor force `j` over [t, t + h], N s.

    Parameters
    ----------
    forces : ndarray
        Forces on floors.
    j : int
        Row of the force.
    t : float
        Start of the step, s.
    h : float
        Time step, s.
    """
    if forces[j, rows.POINTS] > 0.0:
        return h * force_value(forces, j, t + 0.5 * h)
    half_angle = 0.5 * forces[j, rows.OMEGA] * h
    # sin(x) / x, and its Taylor series for small |x|, where the quotient can be 0 / 0
    sinc = (
        math.sin(half_angle) / half_angle
        if abs(half_angle) > 1e-4
        else 1.0 - half_angle * half_angle / 6.0
    )
    return h * sinc * force_value(forces, j, t + 0.5 * h)


@inline
def force_moment(forces, j, t, h):
    """Return the first moment of floor force `j` over [t, t + h], N.

    Parameters
    ----------
    forces : ndarray
        Forces on floors.
    j : int
        Row of the force.
    t : float
        Start of the step, s.
    h : float
        Time step, s.
    """
    if forces[j, rows.POINTS] > 0.0:
        return h * forces[j, rows.LINE_RATE]
    half_angle = 0.5 * forces[j, rows.OMEGA] * h
    # (sin x - x cos x) / x^3, and its Taylor series for small |x|, where the terms would cancel.
    # Omitted terms are less than 1e-14 of the result.
    if abs(half_angle) > 0.1:
        integral = (math.sin(half_angle) - half_angle * math.cos(half_angle)) / (
            half_angle * half_angle * half_angle
        )
    else:
        integral = 1.0 / 3.0 - half_angle * half_angle / 30.0 * (
            1.0 - half_angle * half_angle / 28.0 * (1.0 - half_angle * half_angle / 54.0)
        )
    return 3.0 * h * integral * force_rate(forces, j, t + 0.5 * h)


@inline
def floor_load(linear_terms, forces, t, ground, scratch, row):
    """Store the load of all floors at time `t` in a scratch row, N.

    Parameters
    ----------
    linear_terms : ndarray
        Masses, dampers and geometric stiffnesses.
    forces : ndarray
        Forces on floors.
    t : float
        Time, s.
    ground : float
        Ground acceleration, m/s^2.
    scratch : ndarray
        Scratch array.
    row : int
        Row that receives the load.
    """
    for i in range(linear_terms.shape[1] - 1):
        scratch[row, i] = -linear_terms[rows.MASS, i] * ground
    if FULL and forces.shape[0] > 0:
        _add_forces(forces, t, scratch, row)


@outlined
def _add_forces(forces, t, scratch, row):
    """Add the floor forces at time `t` to a row of `scratch`, N."""
    for j in range(forces.shape[0]):
        scratch[row, int(forces[j, rows.FLOOR])] += force_value(forces, j, t)


@inline
def floor_impulse(linear_terms, forces, t, h, ground_0, ground_1, scratch, row):
    """Store the exact impulse of the load of all floors over [t, t + h] in a scratch row, N s.

    Parameters
    ----------
    linear_terms : ndarray
        Masses, dampers and geometric stiffnesses.
    forces : ndarray
        Forces on floors.
    t : float
        Start of the step, s.
    h : float
        Time step, s.
    ground_0, ground_1 : float
        Ground acceleration at the start and at the end of the step, m/s^2.
    scratch : ndarray
        Scratch array.
    row : int
        Row that receives the impulse.
    """
    for i in range(linear_terms.shape[1] - 1):
        scratch[row, i] = -0.5 * h * linear_terms[rows.MASS, i] * (ground_0 + ground_1)
    if FULL and forces.shape[0] > 0:
        _add_impulses(forces, t, h, scratch, row)


@outlined
def _add_impulses(forces, t, h, scratch, row):
    """Add the impulses of the floor forces over the step [t, t + h] to a row of `scratch`, N s."""
    for j in range(forces.shape[0]):
        scratch[row, int(forces[j, rows.FLOOR])] += force_impulse(forces, j, t, h)


@inline
def mean_load(linear_terms, forces, load, h, r, scratch, row):
    """Store mean and first moment of the load over a step in two consecutive scratch rows, N.

    If the coefficient r of numerical dissipation is positive, the moment of floor forces in method
    moment4 is not the first moment, but with the values q0 and q1 of the force at the endpoints

        q1 - q0 + 12 r ((q0 + q1) / 2 - mean)

    The displacement of a very stiff part of the building, where inertia is negligible, then agrees
    with the force at the endpoints. This moment tends to q1 - q0 as r tends to 0, not to the first
    moment that is used for r = 0. For a force that is linear in time, the two moments are equal.
    """
    ground_0, ground_1 = load[rows.GROUND_0], load[rows.GROUND_1]
    for i in range(linear_terms.shape[1] - 1):
        scratch[row, i] = -0.5 * linear_terms[rows.MASS, i] * (ground_0 + ground_1)
        scratch[row + 1, i] = -linear_terms[rows.MASS, i] * (ground_1 - ground_0)
    if forces.shape[0] > 0:
        _add_means(forces, load[rows.TIME], h, r, scratch, row)


@outlined
def _add_means(forces, t, h, r, scratch, row):
    """Add mean and moment of the forces on floors to two scratch rows (`mean_load`), N."""
    for j in range(forces.shape[0]):
        floor = int(forces[j, rows.FLOOR])
        mean = force_impulse(forces, j, t, h) / h
        scratch[row, floor] += mean
        if r > 0.0:
            force_0 = force_value(forces, j, t)
            force_1 = force_value(forces, j, t + h)
            scratch[row + 1, floor] += (
                force_1 - force_0 + 12.0 * r * (0.5 * (force_0 + force_1) - mean)
            )
        else:
            scratch[row + 1, floor] += force_moment(forces, j, t, h)


@inline
def add_modal_force(modal, table, x, factor, scratch, row, n):
    """Add factor * C x to a row of `scratch`, with the matrix C of modal damping.

    For velocities x and the factor 1, the sum is the modal damping force, N.

    Parameters
    ----------
    modal : ndarray
        Rows w of the modal damping matrix C = sum of w w^T.
    table : ndarray
        Table that contains x.
    x : int
        Row of x in `table`.
    factor : float
        Factor of the product, of either sign.
    scratch : ndarray
        Scratch array.
    row : int
        Row that the product is added to.
    n : int
        Number of floors.
    """
    if FULL and modal.shape[0] > 0:
        _add_modal_force(modal, table, x, factor, scratch, row, n)


@outlined
def _add_modal_force(modal, table, x, factor, scratch, row, n):
    """Add factor * W^T W x to a row of `scratch`; `x` is a row of `table`."""
    for j in range(modal.shape[0]):
        amplitude = 0.0
        for i in range(n):
            amplitude += modal[j, i] * table[x, i]
        amplitude *= factor
        for i in range(n):
            scratch[row, i] += amplitude * modal[j, i]


@inline
def has_inerters(linear_terms):
    """Return True if the building has inerters; plain kernels do not contain this test."""
    return linear_terms.shape[0] > rows.LINEAR_TERM_ROWS


@inline
def inerter_force(linear_terms, table, row, i):
    """Return the force of the inerter in column `i` for the accelerations in a row, N."""
    return linear_terms[rows.STORY_INERTANCE, i] * story_value(linear_terms, table, row, i) + (
        linear_terms[rows.FLOOR_INERTANCE, i] * table[row, i]
    )


@inline
def add_inertance(linear_terms, table, x, factor, scratch, row):
    """Add factor * B x to a row of `scratch`, with the inertance matrix B and row `x` of `table`.

    For accelerations x and the factor 1, the sum is the force of the inerters on the floors, N.
    """
    if FULL and has_inerters(linear_terms):
        _add_inertance(linear_terms, table, x, factor, scratch, row)


@outlined
def _add_inertance(linear_terms, table, x, factor, scratch, row):
    """Add factor * B x to a row of `scratch`."""
    for i in range(linear_terms.shape[1] - 1):
        force = factor * linear_terms[rows.STORY_INERTANCE, i]
        force *= story_value(linear_terms, table, x, i)
        scratch[row, upper_of(linear_terms, i)] += force
        scratch[row, base_of(linear_terms, i)] -= linear_terms[rows.LINK, i] * force
        scratch[row, i] += factor * linear_terms[rows.FLOOR_INERTANCE, i] * table[x, i]


@inline
def distribute(linear_terms, table, row):
    """Replace the forces on all floors in a row of `table` by the accelerations that they cause, if
    inerters couple the floors; forces have been multiplied by INVERSE_MASS, which is then 1."""
    if FULL and has_inerters(linear_terms):
        _distribute(linear_terms, table, row)


@outlined
def _distribute(linear_terms, table, row):
    """Solve L U a = b for b in a row of `table`, which receives a."""
    first, count = rows.MASS_FACTORS, linear_terms.shape[0] - rows.MASS_FACTORS
    for i in range(count):
        for j in range(i):
            table[row, i] -= linear_terms[first + i, j] * table[row, j]
    i = count
    while i > 0:
        i -= 1
        for j in range(i + 1, count):
            table[row, i] -= linear_terms[first + i, j] * table[row, j]
        table[row, i] /= linear_terms[first + i, i]
    tie(linear_terms, table, row)


@inline
def has_dashpot(linear_terms, i):
    """Return True if story `i` has a dashpot without a brace, linear or of a power law."""
    return (linear_terms[rows.DASHPOT, i] != 0.0) | (linear_terms[rows.POWER_DAMPER, i] != 0.0)


@inline
def power_damper(linear_terms, i, rate):
    """Return force and derivative of the power-law dashpot of story `i`; 0 without a dashpot.

    Parameters
    ----------
    linear_terms : ndarray
        Dampers of the stories.
    i : int
        Index of the story.
    rate : float
        Drift rate v, m/s.

    Returns
    -------
    float, float
        Force, N, and its derivative with respect to the drift rate, N s/m.
    """
    if FULL and linear_terms[rows.POWER_DAMPER, i] != 0.0:
        return _power_damper(linear_terms, i, rate)
    return 0.0, 0.0


@inline
def observed_power_damper(linear_terms, i, rate):
    """Return the result of `power_damper`, for the observer.

    Also the variant without power laws contains this call. Without this call, the time of the
    compiled loop over the floors is up to 1.3 times as large with three stories, depending on the
    addresses of the kernels.
    """
    if linear_terms[rows.POWER_DAMPER, i] != 0.0:
        return _power_damper(linear_terms, i, rate)
    return 0.0, 0.0


@outlined
def _power_damper(linear_terms, i, rate):
    """Return force (N) and derivative (N s/m) of the power-law dashpot of story `i`."""
    squared_rate = rate * rate + linear_terms[rows.THRESHOLD, i]
    if squared_rate == 0.0:
        # Zero rate and no threshold v0 require e >= 0. The derivative at zero rate is c for a
        # linear dashpot (e = 0), otherwise 0.
        if linear_terms[rows.POWER, i] == 0.0:
            return 0.0, linear_terms[rows.POWER_DAMPER, i]
        return 0.0, 0.0
    # Force divided by the rate, N s/m
    secant = linear_terms[rows.POWER_DAMPER, i] * squared_rate ** linear_terms[rows.POWER, i]
    return secant * rate, secant * (
        1.0 + 2.0 * linear_terms[rows.POWER, i] * rate * rate / squared_rate
    )


@inline
def internal_forces(linear_terms, modal, law_state, block, scratch, velocity, row, sums):
    """Store the internal forces C v + f(u) of all floors in a scratch row, N.

    The force of a story is the sum of restoring force, P-delta, linear damper and power-law
    dashpot. The internal force of a floor is the force of the story below minus the force of the
    story above, plus the forces of floor damper and modal damping.

    Parameters
    ----------
    linear_terms : ndarray
        Masses, dampers and geometric stiffnesses.
    modal : ndarray
        Rows w of the modal damping matrix C = sum of w w^T.
    law_state : ndarray
        States of the hysteretic laws.
    block : int
        First row of the state with forces (N) and drifts (m) of the stories.
    scratch : ndarray
        Scratch array.
    velocity : int
        Row of `scratch` with the velocities of the floors, m/s.
    row : int
        Row of `scratch` that receives the internal forces.
    sums : int
        Row of `scratch` that receives the force of each story, N.
    """
    n = linear_terms.shape[1] - 1
    velocity_below = 0.0
    for i in range(n):
        v = scratch[velocity, i]
        rate = v - linear_terms[rows.LINK, i] * below(
            linear_terms, scratch, velocity, i, velocity_below
        )
        velocity_below = v
        scratch[sums, i] = (
            law_state[block + rows.FORCE, i]
            + linear_terms[rows.GEOMETRIC, i] * law_state[block + rows.DRIFT, i]
            + linear_terms[rows.STORY_DAMPER, i] * rate
        )
        scratch[sums, i] += power_damper(linear_terms, i, rate)[0]
    # The floor is loaded by the story below and the story above it. There is no story above the
    # roof: column n is zero.
    scratch[sums, n] = 0.0
    for i in range(n):
        scratch[row, i] = (
            linear_terms[rows.FLOOR_DAMPER, i] * scratch[velocity, i]
            + scratch[sums, i]
            - above(linear_terms, scratch, sums, i)
        )
    add_modal_force(modal, scratch, velocity, 1.0, scratch, row, n)


@inline
def finite(state, n):
    """Return True if the displacements, velocities and accelerations of all floors are finite.

    A sum of absolute values of 1e300 or more is regarded as not finite.

    Parameters
    ----------
    state : ndarray
        Memory of the method.
    n : int
        Number of floors.
    """
    is_finite = True
    for i in range(n):
        size = abs(state[rows.DISPLACEMENT, i]) + abs(state[rows.VELOCITY, i])
        is_finite &= size + abs(state[rows.ACCELERATION, i]) < 1e300
    return is_finite


@inline
def hermite_rate(h, ends, s):
    """Return the velocity at `s`, m/s, by the cubic Hermite interpolant of the velocity."""
    _, v0, a0, _, v1, a1, _, _ = ends
    change = v1 - v0
    c2 = 3.0 * change - h * (2.0 * a0 + a1)
    c3 = h * (a0 + a1) - 2.0 * change
    return v0 + s * (h * a0 + s * (c2 + s * c3))


@inline
def damping_change(h, scene, law_state, story, part, deviations, i):
    """Return the changes of the damping force of story `i` by the deviations of its drift rate
    (m/s) at both endpoints of a part of the step, the bulge of this change in the part, and the
    bulge of the force under the lines in the step, N.

    A bulge is 4 times the difference, at the middle, from the straight line between the values at
    the endpoints; in a part, power-law dashpots have no bulge. Tangent damping has the stiffness at
    the end of the step.
    """
    linear_terms = scene.linear_terms
    coefficient = linear_terms[rows.STORY_DAMPER, i]
    if FULL and linear_terms[rows.TANGENT_DAMPING, i] != 0.0:
        # A curved branch can have the slope inf.
        stiffness = min(law_state[rows.SLOPE, i], scene.law_parameters[rows.STIFFNESS, i])
        coefficient += linear_terms[rows.TANGENT_DAMPING, i] * stiffness
    change_0 = coefficient * deviations[0]
    change_1 = coefficient * deviations[1]
    bulge = 0.5 * h * coefficient * (story.a0 - story.a1)
    if FULL and linear_terms[rows.POWER_DAMPER, i] != 0.0:
        rate = hermite_rate(h, story, part[0])
        change_0 += power_damper(linear_terms, i, rate + deviations[0])[0]
        change_0 -= power_damper(linear_terms, i, rate)[0]
        rate = hermite_rate(h, story, part[1])
        change_1 += power_damper(linear_terms, i, rate + deviations[1])[0]
        change_1 -= power_damper(linear_terms, i, rate)[0]
        ends = (
            power_damper(linear_terms, i, story.v0)[0] + power_damper(linear_terms, i, story.v1)[0]
        )
        middle = power_damper(linear_terms, i, hermite_rate(h, story, 0.5))[0]
        bulge += 4.0 * middle - 2.0 * ends
    return change_0, change_1, coefficient * deviations[4], bulge
