"""Rows of the tables that kernels work on.

Every table has one column per story (and the floor above it), counted from the ground, and one more that stays zero:
the free end of the chain, so that a loop may look one story up without asking.
"""

# chain: what is linear in the building
MASS = 0
INVERSE_MASS = 1
FLOOR_DAMPER = 2  # viscous, floor to ground (mass-proportional damping), N s/m
STORY_DAMPER = 3  # viscous, floor to floor below (dashpots, stiffness-proportional damping), N s/m
GEOMETRIC = 4  # geometric stiffness of the story (P-delta), N/m, not positive
LINK = 5  # 1: the story stands on the floor below; 0: it stands on the ground
POWER_DAMPER = 6  # power-law dashpot of the story: c v (v^2 + v0^2)^e, c in N (s/m)^(2 e + 1); 0 for none
POWER = 7  # e, half of the exponent less 1
THRESHOLD = 8  # v0^2, (m/s)^2
CHAIN_ROWS = 9

# laws: drift laws by story
CODE = 0
STIFFNESS = 1
FIRST_PARAMETER = 2

# springs: the state of the drift laws. The committed state first, then blocks of trial states.
DRIFT = 0
FORCE = 1
INTERNAL = 2
DISSIPATED = 3
PLAIN_ROWS = 4  # what every law has; the rest belongs to piecewise-linear laws
SLOPE = 4  # stiffness of the present branch; infinite if it is curved
UPPER = 5  # drifts between which the branch holds
LOWER = 6
TURN = 7  # sign of the drift rate for which the branch holds; 0 for both
HIGH_DRIFT = 8  # the farthest point reached on either side
HIGH_FORCE = 9
LOW_DRIFT = 10
LOW_FORCE = 11
WORK = 12  # done on the story so far, J
SPRING_ROWS = 13
COMMITTED = 0
FIRST_TRIAL = SPRING_ROWS
SECOND_TRIAL = 2 * SPRING_ROWS
THIRD_TRIAL = 3 * SPRING_ROWS
SPRING_BLOCKS = 4
ADDRESS = SPRING_BLOCKS * SPRING_ROWS  # of the story's own compiled function, where its law is not part of the loops
FURTHER = ADDRESS + 1  # where a law needs more rows: again one block for the committed state, then the trial ones

# state: the memory of the method
DISPLACEMENT = 0
VELOCITY = 1
ACCELERATION = 2
FIRST_OLDER = 3

# load over a step: ground acceleration is linear in it
TIME = 0
GROUND_0 = 1
GROUND_1 = 2
GROUND_2 = 3  # second and third moment of what the ground acceleration has beyond that line
GROUND_3 = 4
LOAD_SIZE = 5

# peaks: largest absolute values; as many rows more for what they may be where a step does not tell
PEAK_DRIFT = 0
PEAK_SHEAR = 1
PEAK_DISPLACEMENT = 2
PEAK_VELOCITY = 3
PEAK_ACCELERATION = 4  # absolute: relative to the ground, plus the ground's
PEAK_ROWS = 5

# forces on floors, one row each
FLOOR = 0
COSINE = 1
SINE = 2
OMEGA = 3
FORCE_COLUMNS = 4

# history: per stored time the ground acceleration, then for all floors displacement, velocity, absolute acceleration,
# and for all stories the shear, then the energies
HISTORY_FIELDS = 4

# observed: numbers of the whole run, the energies first: so many, and a history has them at each stored time. Those at
# the end of the run, J
ENERGY_INPUT = 0  # work of the load on the motion relative to the ground
ENERGY_KINETIC = 1  # of the motion relative to the ground
ENERGY_DAMPED = 2  # work of the viscous dampers
ENERGY_RECOVERABLE = 3  # stored in the stories
ENERGY_DISSIPATED = 4  # by the drift laws since the start
ENERGY_TERMS = 5
ENERGY_START = ENERGY_TERMS  # kinetic and stored energy at the start, J
ENERGY_LARGEST = ENERGY_TERMS + 1  # largest ENERGY_START + ENERGY_INPUT on the way, J
ITERATIONS = ENERGY_TERMS + 2
HALVINGS = ENERGY_TERMS + 3
STEPS_REACHED = ENERGY_TERMS + 4
POWER_INPUT = ENERGY_TERMS + 5  # powers and their rates at the last observed time
RATE_INPUT = ENERGY_TERMS + 6  # without the ground's own rate
MOMENTUM = ENERGY_TERMS + 7
POWER_DAMPED = ENERGY_TERMS + 8
RATE_DAMPED = ENERGY_TERMS + 9
ON_PATH = ENERGY_TERMS + 10  # set before the march: 1 if displacements follow parabolas within a step
DISSIPATED_BEFORE = ENERGY_TERMS + 11  # by the drift laws on the way to the initial drifts, J
COLLAPSE_STEP = ENERGY_TERMS + 12  # whole steps after which a story was first beyond a limit; NO_COLLAPSE for none
COLLAPSE_STORY = ENERGY_TERMS + 13  # the first story that failed, else the one farthest beyond its limit then
COLLAPSE_FAILED = ENERGY_TERMS + 14  # 1 if it failed
COLLAPSE_ENERGIES = ENERGY_TERMS + 15  # the energies then, ENERGY_START and ENERGY_LARGEST after them
NEAR_PEAK = COLLAPSE_ENERGIES + ENERGY_TERMS + 2  # 1 if a value at the last observed time was near its peak
ALL_FORCES = NEAR_PEAK + 1  # masses times accelerations at that time
DAMPED_BY_ALL = NEAR_PEAK + 2  # half of what the damped power's rate gains where floors accelerate by 1 m/s^2 more
ALL_MASSES = NEAR_PEAK + 3
OBSERVED_SIZE = NEAR_PEAK + 4

# observed[COLLAPSE_STEP]
NO_COLLAPSE = -1.0

# limits: by story
LIMIT = 0  # drift ratio beyond which it has collapsed
HEIGHT = 1  # m; nan for a story without a limit
FAILED = 2  # what INTERNAL is once the story carries nothing any more; nan where that does not happen

# memo: numbers that a step leaves for the next one and for whoever asks why it failed
LINEAR = 0  # 1 if every law is linear
FACTORED_STEP = 1  # the step size of the factorization in work, 0 for none
STEPS_DONE = 2  # since the start, or since a step that was halved
WORST_STORY = 3
RESIDUAL = 4
BRANCHES = 5  # which laws have branches, whose changes can be located
EVENTS = 6  # changes of branch located so far
POWER_DAMPERS = 7  # 1 if a story has a power-law dashpot
OWN_WORK = 8  # 1 if the step tells what work it does
WORK_INPUT = 9  # of the load in the last step, J
WORK_DAMPED = 10  # of the viscous dampers in the last step, J
CARRIED_GROUND = 11  # ground acceleration that the acceleration of the state stands with, where steps are long
WITHIN = 12  # row of work from which on the step has raised its own peaks between its ends; 0 if it has not
FAST = 13  # 1 if the building has modes that the step does not follow
OWN_PEAKS = 14  # row of work from which on the step keeps peaks of the run beside those it has raised; 0 for none
ERROR_BEGUN = 15  # 1 once the error is carried along
ERROR_NEAR = 16  # 1 if the accelerations of the corrected motion are known
ERROR_SIDE = 17  # which of two sets of rows holds the last step's
MEMO_SIZE = 18

# memo[BRANCHES]
NO_BRANCHES = 0
ALL_BRANCHES = 1  # every law is linear, or linear branch by branch
SOME_BRANCHES = 2  # some laws have branches, some are curved

# what a step returns instead of its number of iterations
NOT_CONVERGED = -1
NOT_FINITE = -2

# ways in which a branch of a law ends
ABOVE = 1.0  # the drift leaves it upwards
BELOW = -1.0
TURNED = 0.0  # the drift rate turns
