"""Rows of the tables that kernels work on, and how rows of scratch follow each other.

Every table has one column per story (and the floor above it), counted from the ground, and one more
that stays zero: the free end of the chain, so that a loop may look one story up without asking.
"""

from __future__ import annotations

from typing import TypeVar

_Kind = TypeVar("_Kind", bound=tuple[int, ...])


def chained(counts: type[_Kind], first: int = 0) -> tuple[_Kind, int]:
    """Rows that follow each other from `first` on.

    Parameters
    ----------
    counts : type
        A named tuple whose defaults say how many rows each field has.

    Returns
    -------
    named tuple, int
        The first row of each field; the row behind the last one.
    """
    firsts = []
    for count in counts():
        firsts.append(first)
        first += count
    return counts(*firsts), first  # type: ignore[arg-type]


# linear_terms: what is linear in the building
MASS = 0
INVERSE_MASS = 1
FLOOR_DAMPER = 2  # viscous, floor to ground (mass-proportional damping), N s/m
STORY_DAMPER = 3  # viscous, floor to floor below (dashpots, stiffness-proportional damping), N s/m
GEOMETRIC = 4  # geometric stiffness of the story (P-delta), N/m, not positive
LINK = 5  # 1: the story stands on the floor below; 0: it stands on the ground
POWER_DAMPER = (
    6  # power-law dashpot of the story: c v (v^2 + v0^2)^e, c in N (s/m)^(2 e + 1); 0 for none
)
POWER = 7  # e, half of the exponent less 1
THRESHOLD = 8  # v0^2, (m/s)^2
DASHPOT = 9  # of STORY_DAMPER what is a dashpot that the model has, N s/m
LINEAR_TERM_ROWS = 10

# law_parameters: drift laws by story
CODE = 0
STIFFNESS = 1
FIRST_PARAMETER = 2

# springs: the state of the drift laws. The committed state first, then blocks of trial states.
DRIFT = 0
FORCE = 1
INTERNAL = 2
DISSIPATED = 3
COMMON_ROWS = 4  # what every law has; the rest belongs to piecewise-linear laws
SLOPE = 4  # stiffness of the present branch; infinite if it is curved
UPPER = 5  # drifts between which the branch holds
LOWER = 6
RATE_SIGN = 7  # sign of the drift rate for which the branch holds; 0 for both
HIGH_DRIFT = 8  # the farthest point reached on either side
HIGH_FORCE = 9
LOW_DRIFT = 10
LOW_FORCE = 11
WORK = 12  # done on the story so far, J
# rows from a trial block to the one that has its branch (INTERNAL, SLOPE to LOW_FORCE, more); 0:
# its own
BRANCH_OFFSET = 13
LAW_STATE_ROWS = 14
COMMITTED = 0
FIRST_TRIAL = LAW_STATE_ROWS
SECOND_TRIAL = 2 * LAW_STATE_ROWS
THIRD_TRIAL = 3 * LAW_STATE_ROWS
LAW_STATE_BLOCKS = 4
ADDRESS = (
    LAW_STATE_BLOCKS * LAW_STATE_ROWS
)  # of the story's own compiled function, where its law is not part of the loops
EXTRA_ROWS = (
    ADDRESS + 1
)  # where a law needs more rows: again one block for the committed state, then the trial ones

# state: the memory of the method
DISPLACEMENT = 0
VELOCITY = 1
ACCELERATION = 2
FIRST_OLDER = 3

# load: over a step, in which the ground acceleration is linear
TIME = 0
GROUND_0 = 1
GROUND_1 = 2
LOAD_SIZE = 3

# peaks: largest absolute values; as many rows more for what they may be where a step does not tell
PEAK_DRIFT = 0
PEAK_SHEAR = 1
PEAK_DISPLACEMENT = 2
PEAK_VELOCITY = 3
PEAK_ACCELERATION = 4  # absolute: relative to the ground, plus the ground's
PEAK_TOTAL_SHEAR = 5  # of springs, P-delta and all viscous forces: what moves all floors above
PEAK_DRIFT_RATE = 6  # of stories, in a building with dashpots
PEAK_ROWS = 7

# watch: what an observer of the motion keeps
OBSERVED_ACCELERATION = 0  # that of equilibrium, whatever the method carries
FLOOR_FORCE = 1  # forces on floors less modal damping
TOTAL_SHEAR = 2  # of stories
U_PREVIOUS = 3  # at the last observed time
V_PREVIOUS = 4
A_PREVIOUS = 5
V_EARLIER = 6  # one step before that
A_EARLIER = 7
REVERSAL_DRIFT = 8  # drifts where stories turned
MODAL_FORCE = 9  # of modal damping on floors
OBSERVER_ROWS = 10

# forces: on floors, one row each with these columns
FLOOR = 0
COSINE = 1
SINE = 2
OMEGA = 3
FORCE_COLUMNS = 4

# history: per stored time the ground acceleration, then for all floors displacement, velocity,
# absolute acceleration, and for all stories the shear, then the energies
HISTORY_FIELDS = 4

# totals: numbers of the whole run, the energies first: so many, and a history has them at each
# stored time. Those at the end of the run, J
ENERGY_INPUT = 0  # work of the load on the motion relative to the ground
ENERGY_KINETIC = 1  # of the motion relative to the ground
ENERGY_VISCOUS = 2  # work of viscous damping, without dashpots
ENERGY_DASHPOTS = 3  # work of the dashpots
ENERGY_STRAIN = 4  # stored in the stories
ENERGY_HYSTERETIC = 5  # by the drift laws since the start
ENERGY_TERMS = 6
ENERGY_INITIAL = ENERGY_TERMS  # kinetic and stored energy at the start, J
ENERGY_REFERENCE = ENERGY_TERMS + 1  # largest ENERGY_INITIAL + ENERGY_INPUT on the way, J
ITERATIONS = ENERGY_TERMS + 2
HALVINGS = ENERGY_TERMS + 3
STEPS_REACHED = ENERGY_TERMS + 4
POWER_INPUT = ENERGY_TERMS + 5  # powers and their rates at the last observed time
RATE_INPUT = ENERGY_TERMS + 6  # without the ground's own rate
MOMENTUM = ENERGY_TERMS + 7
POWER_VISCOUS = ENERGY_TERMS + 8  # of all dampers
RATE_VISCOUS = ENERGY_TERMS + 9
INITIAL_DISSIPATION = ENERGY_TERMS + 10  # by the drift laws on the way to the initial drifts, J
COLLAPSE_STEP = (
    ENERGY_TERMS + 11
)  # whole steps after which a story was first beyond a limit; NO_COLLAPSE for none
COLLAPSE_STORY = (
    ENERGY_TERMS + 12
)  # the first story that failed, else the one farthest beyond its limit then
COLLAPSE_FAILED = ENERGY_TERMS + 13  # 1 if it failed
COLLAPSE_ENERGIES = (
    ENERGY_TERMS + 14
)  # the energies then, ENERGY_INITIAL and ENERGY_REFERENCE after them
TOTAL_INERTIA = COLLAPSE_ENERGIES + ENERGY_TERMS + 2  # masses times accelerations at that time
VISCOUS_PER_ACCELERATION = (
    TOTAL_INERTIA + 1
)  # half of what the damped power's rate gains where floors accelerate by 1 m/s^2 more
TOTAL_MASS = TOTAL_INERTIA + 2
POWER_DASHPOTS = TOTAL_INERTIA + 3  # of the dashpots alone
RATE_DASHPOTS = TOTAL_INERTIA + 4
DASHPOTS_PER_ACCELERATION = TOTAL_INERTIA + 5
TOTALS_SIZE = TOTAL_INERTIA + 6

# totals[COLLAPSE_STEP]
NO_COLLAPSE = -1.0

# limits: by story
LIMIT = 0  # drift ratio beyond which it has collapsed
HEIGHT = 1  # m; nan for a story without a limit
FAILED = (
    2  # what INTERNAL is once the story carries nothing any more; nan where that does not happen
)

# flags: set before a march and never written
LINEAR = 0  # 1 if every law is linear
BRANCHES = 1  # which laws have branches, whose changes can be located
POWER_DAMPERS = 2  # 1 if a story has a power-law dashpot
OWN_WORK = 3  # 1 if the step tells what work it does
UNRESOLVED_MODES = 4  # 1 if the building has modes that the step does not follow
PARABOLIC = 5  # 1 if displacements follow parabolas within a step
HAS_DASHPOTS = 6  # 1 if a story has a dashpot, linear or of a power law
FLAGS_SIZE = 7

# flags[BRANCHES]
NO_BRANCHES = 0
ALL_BRANCHES = 1  # every law is linear, or linear branch by branch
SOME_BRANCHES = 2  # some laws have branches, some are curved

# report: what a step leaves: for the next one, for the march, and for people
STATE_GROUND = (
    0  # ground acceleration that the acceleration of the state stands with, where steps are long
)
STEPS_DONE = 1  # since the start, or since a step that was halved
FACTORED_STEP = 2  # the step size of the factorization in work, 0 for none
# row of work from which on the step has raised its own peaks between its ends; 0 if it has not
STEP_PEAKS = 3
# row of work from which on the step keeps peaks of the run beside those it has raised; 0 for none
RUN_PEAKS = 4
WORK_INPUT = 5  # of the load in the last step, J
WORK_VISCOUS = 6  # of the viscous dampers in the last step, J
WORST_STORY = 7  # where the equations are farthest from balance, if they are
RESIDUAL = 8  # there: what is out of balance over the sizes of the terms
BRANCH_CHANGES = 9  # changes of branch located so far
REPORT_SIZE = 10

# what a step returns instead of its number of iterations
NOT_CONVERGED = -1
NOT_FINITE = -2

# ways in which a branch of a law ends
ABOVE = 1.0  # the drift leaves it upwards
BELOW = -1.0
REVERSED = 0.0  # the drift rate turns
