"""Signature of every compiled step, and named tuples of its arguments.

    step(coefficients, linear_terms, modal, law_parameters, forces, flags, h, load, state,
         law_state, scratch, step_status) -> number of iterations, or a negative error code

1. coefficients: coefficients of the method. For `exact` they include the coefficients that depend
  on the building.
2. linear_terms, modal, law_parameters, forces, flags: the `Scene`, which no step changes (see
  `tdint.kernels.layout` for the rows).
3. h, load: length of the step; time at its start and ground acceleration at both endpoints, linear
  within the step.
4. state, law_state: memory of the method and of the hysteresis models. They are updated by the
  step. If the step returns NOT_CONVERGED, both are unchanged. After NOT_FINITE the time integration
  ends.
5. scratch, step_status: scratch rows with reusable factorizations, and values for the next step. If
  both are cleared, except for `step_status[STEPS_DONE]`, the result of the step changes only by
  rounding.
6. The state row ACCELERATION is the acceleration that the method uses in the next step. Results
  that are reported are never fed back.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from tdint.kernels.building.compilable import GROUPS
from tdint.kernels.compiling import (
    F8,
    I8,
    TABLE,
    VECTOR,
    indirect_caller,
    kernel,
)

# ---- Groups of arrays and numbers that kernels pass to other functions as a single argument. The
# groups are named tuples, which the compiler replaces by their fields. A kernel is called with the
# fields, in the order of the groups. The signatures of the groups are defined here as well.

Array = NDArray[np.float64]


class Scene(NamedTuple):
    """Building and forces on its floors; constant during the time integration (see
    `tdint.kernels.layout`).

    Attributes
    ----------
    linear_terms : ndarray
        Properties of the building that act linearly.
    modal : ndarray
        Rows w of the modal damping matrix C = sum of w w^T.
    law_parameters : ndarray
        Parameters of the hysteresis models.
    forces : ndarray
        Forces on floors: one row per force (see `tdint.kernels.layout`).
    flags : ndarray
        Properties of building and method that are set before the time integration.
    """

    linear_terms: Array
    modal: Array
    law_parameters: Array
    forces: Array
    flags: Array


class Memory(NamedTuple):
    """Memory of the method and of the hysteresis models before and after a step, and scratch
    rows.

    Attributes
    ----------
    state : ndarray
        Memory of the method.
    law_state : ndarray
        States of the hysteresis models.
    scratch : ndarray
        Scratch rows and reusable factorizations.
    step_status : ndarray
        Values for the next step, for the time loop and for messages.
    """

    state: Array
    law_state: Array
    scratch: Array
    step_status: Array


class Seen(NamedTuple):
    """Arrays in which the observer of the response stores its results and its memory.

    Attributes
    ----------
    observer_state : ndarray
        Memory of the observer between two steps: one column per floor or story.
    peaks : ndarray
        Maximum absolute values of the response, then possible peaks between the time steps.
    limits : ndarray
        Collapse limits of the drifts, by story.
    totals : ndarray
        Values of the complete run, such as energies and numbers of steps.
    history : ndarray
        Response at the start and at every k-th step, with k = steps / (rows - 1); no rows if no
        history is stored.
    """

    observer_state: Array
    peaks: Array
    limits: Array
    totals: Array
    history: Array


GROUPS.update(scene=Scene, memory=Memory, seen=Seen)

SCENE = (TABLE, TABLE, TABLE, TABLE, VECTOR)
MEMORY = (TABLE, TABLE, TABLE, VECTOR)
SEEN = (TABLE, TABLE, TABLE, VECTOR, TABLE)


class Span(NamedTuple):
    """Time step or substep that the observer of the response processes.

    Attributes
    ----------
    t : float
        Time at the end, s.
    ground_0, ground_1 : float
        Ground acceleration at both endpoints, m/s^2.
    on_path : bool
        True if the displacements follow parabolas of time within the step.
    fast : bool
        True if the building has modes that the step does not resolve.
    cornered : bool
        True if the step has computed the peaks of accelerations and total shears at discontinuities
        within the step. The values at the endpoints of the step do not determine these peaks.
    kinked : bool
        True if the table of a force is not linear in the step, so that the accelerations in
        equilibrium with its line are not the accelerations of the building
        (`tdint.kernels.time_loop.force_tables`).
    """

    t: float
    h: float
    ground_0: float
    ground_1: float
    on_path: bool
    fast: bool
    cornered: bool
    kinked: bool


class Passage(NamedTuple):
    """Response of all floors at both endpoints of a step, relative to the ground.

    Attributes
    ----------
    old : ndarray
        Table with the response at the start in consecutive rows: displacement (m), velocity (m/s)
        and acceleration (m/s^2). If the building has unresolved modes, velocity and acceleration
        one step earlier follow.
    first : int
        Row of the displacement in `old`.
    state : ndarray
        Table with displacement and velocity at the end of the step.
    accelerations : ndarray
        Table with the acceleration at the end of the step.
    new : int
        Row of the acceleration in `accelerations`.
    """

    old: Array
    first: int
    state: Array
    accelerations: Array
    new: int


class Located(NamedTuple):
    """Rows for the peaks inside a step or substep, and rows of the peaks that they raise.

    Attributes
    ----------
    table : ndarray
        Table with LOCATED_ROWS rows from row `first` on, and a column of zeros after the floors.
    peaks : ndarray
        Table with the peaks from row `first_peak` on.
    """

    table: Array
    first: int
    peaks: Array
    first_peak: int


class Ends(NamedTuple):
    """Motion of a single floor or story at both endpoints of a time step.

    The sum of mass times motion of several floors is represented in the same way.

    Attributes
    ----------
    u0, v0, a0 : float
        Displacement (or story drift, m), velocity (m/s) and acceleration (m/s^2) at the start of
        the step.
    u1, v1, a1 : float
        The same at the end of the step.
    v_earlier, a_earlier : float
        Velocity and acceleration one step before the start of the step.
    """

    u0: float
    v0: float
    a0: float
    u1: float
    v1: float
    a1: float
    v_earlier: float
    a_earlier: float


class Factors(NamedTuple):
    """Location of a factorization of a tridiagonal or block tridiagonal matrix in a table.

    Attributes
    ----------
    table : ndarray
        Table that contains the rows, usually the scratch array: one column per floor.
    pivot : int
        First row of the pivots: the diagonal of the matrix, then of its factors.
    coupling : int
        First row of the couplings: entries of the matrix between adjacent floors, then of the
        factors.
    store : int
        First row of the terms of modal damping (Woodbury formula): solutions for the mode vectors
        and the inverse of a small matrix.
    linear_terms : ndarray
        Linear terms of the building; row BASE is used in the variant `tree`.
    """

    table: Array
    pivot: int
    coupling: int
    store: int
    linear_terms: Array


class EffectiveCoefficients(NamedTuple):
    """Change of the response of a floor for a unit change of its unknown x, an acceleration.

    Displacement, velocity and acceleration are u = U + by_u x, v = V + by_v x and a = A + by_a x.

    Attributes
    ----------
    by_u, by_v, by_a : float
        Change of displacement (s^2), velocity (s) and acceleration (1) per unit of x.
    """

    by_u: float
    by_v: float
    by_a: float


class Integrals(NamedTuple):
    """Rows that receive the integrals of a story force along a path.

    The rows contain mean and first moment of the force and their derivatives, in the order of
    `tdint.kernels.stories.path`.

    Attributes
    ----------
    table : ndarray
        Table that contains the rows, usually the scratch array.
    first : int
        Number of the first row, which contains the mean of the force.
    """

    table: Array
    first: int


class PathSegment(NamedTuple):
    """Part of a parabola of drift from t = `begin` to t = `end`, fractions of the step.

    The drift is start + rise t + bend (t^2 - t) / 2, with t from 0 to 1 over the step.

    Attributes
    ----------
    start, rise, bend : float
        Coefficients of the parabola, m: drift at t = 0, change of drift over the step, and change
        over the step of the derivative with respect to t.
    begin, end : float
        Endpoints of the part, between 0 and 1.
    """

    start: float
    rise: float
    bend: float
    begin: float
    end: float


# ---- Stepping

STEP = I8(VECTOR, *SCENE, F8, VECTOR, *MEMORY)

step_kernel = kernel(STEP)
"""Decorator that converts a step (coefficients, scene, h, load, memory) to a kernel.

The step updates the state, the law states, the scratch array and the status in `memory`. It returns
the number of iterations, which is the number of linear systems of equations that it has solved, but
at least 1. Or a negative error code: NOT_CONVERGED (the state is unchanged) or NOT_FINITE.
"""

take_step = indirect_caller(STEP)
"""Execute one step of the method with the compiled function that the time loop has received:
(step, coefficients, scene, h, load, memory)."""
