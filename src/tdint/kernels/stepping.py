"""The signature of every compiled step:

    step(coefficients, linear_terms, modal, law_parameters, forces, flags, h, load, state, springs,
    work, report)
    -> iterations, or a negative code

1. coefficients: the method's numbers, with the step's own where they depend on the building
  (`exact`).
2. linear_terms, modal, law_parameters, forces, flags: the `Scene`, never written
  (`tdint.kernels.stepping`,
   `tdint.kernels.layout`).
3. load: time at the step's start and the ground acceleration at both ends, linear in between.
4. state, springs: the whole memory of the method and of the drift laws, before and after. A step
  that returns
   NOT_CONVERGED leaves both as they were; after NOT_FINITE the march ends.
5. work, report: scratch and kept factorizations, and what a step leaves for the next one. It gives
  the same result from
   fresh ones with the same `report[STEPS_DONE]`, but for rounding.
6. State row ACCELERATION is what the method itself uses next; nothing that is reported is fed back.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from tdint.kernels.compiling import F8, I8, TABLE, VECTOR, indirect_caller, inline

# ---- Arrays and numbers that go together, as kernels hand them on: tuples with names, which the
# compiler takes apart
#
# A kernel is entered with flat arguments, in the order of the fields, and makes its bundles of
# them. Their signatures stand here, too.

Array = NDArray[np.float64]


class Scene(NamedTuple):
    """The building and the forces on its floors, never written (`tdint.kernels.layout`)."""

    linear_terms: Array  # what is linear in the building
    modal: Array  # rows w of the modal damping C = sum of w w^T
    law_parameters: Array  # drift laws of the stories
    forces: Array  # harmonic forces on floors
    flags: Array  # what is known of building and method before the march


class Memory(NamedTuple):
    """What method and drift laws remember, before and after a step, and scratch."""

    state: Array  # of the method
    law_state: Array  # of the drift laws
    scratch: Array  # scratch and kept factorizations
    step_status: Array  # what a step leaves for the next one, for the march, and for people


class Seen(NamedTuple):
    """What is seen of the motion (`tdint.kernels.march.observing`)."""

    observer_state: Array  # what the observer keeps
    peaks: Array  # and their doubt
    limits: Array  # of the drifts
    totals: Array  # numbers of the whole run
    # the start and each k-th step, k = steps / (rows - 1) a whole number; no rows for none
    history: Array


SCENE = (TABLE, TABLE, TABLE, TABLE, VECTOR)
MEMORY = (TABLE, TABLE, TABLE, VECTOR)
SEEN = (TABLE, TABLE, TABLE, VECTOR, TABLE)


class Span(NamedTuple):
    """A step, or a piece of one: when it ends, how long it is, the ground acceleration at its ends,
    and how floors move in it."""

    t: float
    h: float
    ground_0: float
    ground_1: float
    on_path: bool  # displacements follow parabolas
    fast: bool  # the building has modes that the step does not follow
    # the step has looked at accelerations and total shears: at corners that its ends do not tell of
    cornered: bool


class Passage(NamedTuple):
    """Where a motion stands at both ends of a step, one column for each floor.

    Rows from `first` of `old` are displacement, velocity and acceleration at its start, and, of a
    fast span, velocity and acceleration one step before; rows of `state`, and row `new` of
    `accelerations`, those at its end, relative to the ground.
    """

    old: Array
    first: int
    state: Array
    accelerations: Array
    new: int


class Ends(NamedTuple):
    """Motion of one floor or story at both endpoints of a time step.

    Attributes
    ----------
    u0, v0, a0 : float
        Displacement (or story drift), velocity and acceleration at the start of the step.
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
    """Where a factorization lies (`tdint.kernels.equations.tridiagonal`): rows of a table."""

    table: Array
    pivot: int
    coupling: int
    store: int  # the modes'


class EffectiveCoefficients(NamedTuple):
    """What one unknown of a floor moves: its displacement, velocity and acceleration."""

    by_u: float
    by_v: float
    by_a: float


class Integrals(NamedTuple):
    """Where those along a path go (`tdint.kernels.stories.path`): rows of a table from `first`
    on."""

    table: Array
    first: int


class Stretch(NamedTuple):
    """The part from t = begin to t = end of a parabola of drift, start + rise t + bend (t^2 - t) /
    2."""

    start: float
    rise: float
    bend: float
    begin: float
    end: float


# ---- Stepping

STEP = I8(VECTOR, *SCENE, F8, VECTOR, *MEMORY)

_call_step = indirect_caller(STEP)


@inline
def take_step(step, coefficients, scene, h, load, memory):
    """Take a step by the kernel that a march was given."""
    linear_terms, modal, law_parameters, forces, flags = scene
    state, law_state, scratch, step_status = memory
    return _call_step(
        step,
        coefficients,
        linear_terms,
        modal,
        law_parameters,
        forces,
        flags,
        h,
        load,
        state,
        law_state,
        scratch,
        step_status,
    )
