"""Row numbers of the arrays that kernels use, and the numbering of scratch rows.

Every table has one column for each story and the floor above it, counted from the ground, and an
additional column that remains zero. The additional column represents the free end of the chain, so
that a loop can access the next story without a test.

Vocabulary: the following names have the same meaning in every kernel. The docstrings of kernels
describe only their other arguments, and the values that are read and changed. Units are SI; the
comments below give the unit of each row.

    i                  index of a story and of the floor above it, from 0 at the ground
    n                  number of stories
    h                  length of the step or substep, s
    link               row LINK of a story: 1 on the floor below, 0 on the ground
    ground             ground acceleration, m/s^2
    u, v, a            displacement, velocity and acceleration of a floor relative to the ground;
                       drift, rate and drift acceleration of a story
    _0, _1, _c         suffixes: start and end of the step, inner point of a quadrature
    by_x               derivative or factor of a quantity with respect to x
    tangent, slope     stiffness of a law at a point, of a linear branch, N/m
    side, direction    1 for increasing, -1 for decreasing drift

    linear_terms       masses, dampers, geometric stiffnesses: one row per property
    law_parameters     parameters of the hysteretic laws: one row per quantity
    law_state          states of the laws: blocks of rows. A block is named by its first row:
                       COMMITTED (0) is the state at the end of the last step or substep;
                       FIRST_TRIAL, SECOND_TRIAL and THIRD_TRIAL are free for the current step.
    block              first row of the state that a function reads and changes
    previous, trial    first row of the state at the start and at the end of a path
    state              memory of the method: displacements, velocities, accelerations
    modal              rows w of the modal damping matrix C = sum of w w^T, one per damped mode
    forces             harmonic forces on floors: one row per force
    load               time and ground accelerations of the step
    scratch            intermediate results of a step. A module numbers its rows by a named tuple
                       (`chained`); an argument such as `out`, `first`, `row` or `factors` is the
                       number of the first row of a group.
    observer_state, peaks, totals, limits, history, flags, step_status    see below

`scene`, `memory`, `seen`, `span`, `ends`, `results` and `segment` are the named tuples `Scene`,
`Memory`, `Seen`, `Span`, `Ends`, `Integrals` and `PathSegment` of `tdint.kernels.stepping`.
"""

from __future__ import annotations

from typing import TypeVar

_Rows = TypeVar("_Rows", bound=tuple[int, ...])


def chained(counts: type[_Rows], first: int = 0) -> tuple[_Rows, int]:
    """Assign consecutive row numbers to the fields of a named tuple.

    Parameters
    ----------
    counts : type
        Named tuple with the number of rows of each field as its default.
    first : int
        Row number of the first field. Default: 0.

    Returns
    -------
    named tuple, int
        First row of each field, and the first row after the last field.
    """
    firsts = []
    for count in counts():
        firsts.append(first)
        first += count
    return counts(*firsts), first  # type: ignore[arg-type]


# linear_terms: properties of the building that act linearly
MASS = 0  # mass of the floor, kg
INVERSE_MASS = 1  # 1/kg
FLOOR_DAMPER = 2  # viscous coefficient from floor to ground (mass-proportional damping), N s/m
# Viscous coefficient from the floor to the floor below (dashpots and stiffness-proportional
# damping), N s/m
STORY_DAMPER = 3
GEOMETRIC = 4  # geometric stiffness of the story (P-delta), N/m, not positive
LINK = 5  # 1 if the story is on the floor below, 0 if it is on the ground
# Coefficient c of the power-law dashpot of the story with the force c v (v^2 + v0^2)^e,
# N (s/m)^(2 e + 1); 0 for no dashpot
POWER_DAMPER = 6
POWER = 7  # e, half of (exponent of the dashpot - 1)
THRESHOLD = 8  # v0^2, (m/s)^2
DASHPOT = 9  # part of STORY_DAMPER that is a linear dashpot of the model, N s/m
# Added to the initial stiffness in bounds of the shear, N/m: 0, or UNLIMITED if the peak shear of
# the story can occur at a smaller drift than its peak drift, because the story can be stiffer than
# initially and is not symmetric
STIFFENING = 10
# Stiffness of the brace in series with the damper of the story, N/m; 0 for no brace. The three
# following rows describe the damper on this brace, with the force c y (y^2 + y0^2)^e at the damper
# rate y. It has no part in the rows STORY_DAMPER, POWER_DAMPER and DASHPOT.
BRACE = 11
BRACED_DAMPER = 12  # c, N (s/m)^exponent
BRACED_EXPONENT = 13  # exponent = 1 + 2 e
BRACED_THRESHOLD = 14  # y0^2, (m/s)^2
# Force above which the damper has the slope BRACED_RELIEF_RATIO times c, N; 0 for no relief
BRACED_RELIEF = 15
BRACED_RELIEF_RATIO = 16
# Cosine of the inclination of the damper: its force along its axis is the force in the direction of
# the drift divided by this number. It is used for the reported force only.
DAMPER_FACTOR = 17
# Coefficient of Rayleigh damping with the tangent stiffness, s; 0 in stories with a linear law
TANGENT_DAMPING = 18
# The following rows are used only in a building with attachments or links (variant `tree`): the
# ends of the springs, see `tdint.kernels.linear_terms`.
BASE = 19  # column of the lower floor of the spring; smaller than the column of its upper floor
FIRST_ON = 20  # first spring whose lower floor is this floor; 0 for none
NEXT_ON = 21  # next spring with the same lower floor; 0 for none
# Column of the upper floor of the spring: its own column, except for links (variant `links`). The
# last column of this row is not 0 in a building with attachments or links.
UPPER_FLOOR = 22
FIRST_TIED = 23  # first link whose upper floor is this floor; 0 for none
NEXT_TIED = 24  # next link with the same upper floor; 0 for none
# Column that stores the matrix entry of the two floors of a link: that of another spring of these
# floors, or its own; and the next column with an entry of the same upper floor, 0 for none
ENTRY = 25
NEXT_ENTRY = 26
LINEAR_TERM_ROWS = 27
# Further rows in a building with inerters and nonlinear laws only. MASS is then the mass that the
# ground motion loads, and INVERSE_MASS is 1: `distribute` converts forces to accelerations.
STORY_INERTANCE = LINEAR_TERM_ROWS  # of an inerter between the ends of the spring, kg
FLOOR_INERTANCE = LINEAR_TERM_ROWS + 1  # of an inerter from the floor to the ground, kg
# Factors L and U of the mass matrix with inertance, in one square table without the diagonal of L
MASS_FACTORS = LINEAR_TERM_ROWS + 2
UNLIMITED = 1e300  # N/m; finite, because the product with a drift of 0 must be 0

# law_parameters: parameters of the hysteresis models (drift laws), by story. A story with several
# elements (springs in parallel) contains no law. Its elements are the columns after the additional
# column of zeros, in this table and in `law_state`.
CODE = 0  # number of the law, or ELEMENTS
STIFFNESS = 1  # initial stiffness, N/m; of a story with elements, their sum
# Drifts where the law loses its force permanently, m, positive and negative; 0 for none. CODE is
# then the number of the law plus FRACTURING (`tdint.kernels.laws.fracture`)
FRACTURE_HIGH = 2
FRACTURE_LOW = 3
FIRST_PARAMETER = 4  # first parameter of the law, in SI units
# Values of CODE of a story with elements, which are not indices of a law: ELEMENTS if all laws of
# the elements are piecewise linear, CURVED_ELEMENTS otherwise. With ELEMENTS, the story is on a
# linear branch until an element changes its branch. The elements remain at an earlier drift of the
# linear branch (row DRIFT of their columns), and `synchronize` (`tdint.kernels.stories.branches`)
# moves them to the drift of the story.
ELEMENTS = -1e6
CURVED_ELEMENTS = -2e6
FIRST_ELEMENT = 2  # first column of the elements of such a story, and first column after them
END_ELEMENT = 3

# law_state: states of the hysteresis models. A block of rows with the committed state, then blocks
# of the same rows with trial states and with the state at the start of a step.
DRIFT = 0  # m
FORCE = 1  # N
INTERNAL = 2  # internal variable of the law
DISSIPATED = 3  # dissipated energy, J
COMMON_ROWS = 4  # rows that all laws use; the remaining rows belong to piecewise-linear laws
SLOPE = 4  # stiffness of the current branch, N/m; infinite for a curved branch
UPPER = 5  # maximum and minimum drift for which the branch is valid, m
LOWER = 6
RATE_SIGN = 7  # sign of the drift rate for which the branch is valid; 0 for both signs
HIGH_DRIFT = 8  # maximum drift (m) with its force (N), and minimum drift with its force
HIGH_FORCE = 9
LOW_DRIFT = 10
LOW_FORCE = 11
WORK = 12  # work done on the story since the start, J
# Number of rows from a trial block to the block that contains its branch (INTERNAL, SLOPE to
# LOW_FORCE and the extra rows); 0 if the trial block contains its branch
BRANCH_OFFSET = 13
LAW_STATE_ROWS = 14
COMMITTED = 0
FIRST_TRIAL = LAW_STATE_ROWS
SECOND_TRIAL = 2 * LAW_STATE_ROWS
THIRD_TRIAL = 3 * LAW_STATE_ROWS
# State at the start of the last observed step or substep, if flags[KEEPS_START] is 1, or if a
# method with parabolic displacements has set STEP_PEAKS
STEP_START = 4 * LAW_STATE_ROWS
LAW_STATE_BLOCKS = 5
# The next rows are used in the columns of elements, the energies also in the columns of stories. In
# the column of a story with elements, the committed rows DRIFT, FORCE, SLOPE, UPPER, LOWER and
# RATE_SIGN describe the sum of the elements, and INTERNAL is 1 if all elements have failed.
# Value of INTERNAL after the failure; nan if the law cannot fail
FAILED_INTERNAL = LAW_STATE_BLOCKS * LAW_STATE_ROWS
PEAK_FORCE = FAILED_INTERNAL + 1  # maximum absolute force, N
# Dissipated energy since the start, J, when energies were last summed
ENERGY_SPENT = FAILED_INTERNAL + 2
INITIAL_SPENT = FAILED_INTERNAL + 3  # dissipated energy up to the initial drift, J
# Time of the fracture (s), and peak drift of the story up to it (m) with the sign of its side; 0
# without a fracture
FRACTURE_TIME = FAILED_INTERNAL + 4
FRACTURE_DRIFT = FAILED_INTERNAL + 5
# First extra row, for laws that need more rows: one block for each block of the states, in the same
# order
EXTRA_ROWS = FAILED_INTERNAL + 6

# state: memory of the method, by floor
DISPLACEMENT = 0  # relative to the ground, m
VELOCITY = 1  # m/s
ACCELERATION = 2  # m/s^2
FIRST_OLDER = 3  # first row of values of previous steps (multi-step methods)
# The last rows of the state of a building with braces or tangent damping, counted from the end of
# the table
# Mean rate of the force of the law over the step before the last step, and over the last step, N/s
# (multi-step methods)
OLDER_FORCE_RATE = -9
FORCE_RATE = -8
# Force of tangent damping in the equations of the methods of order 2, N. Its impulse is exact, but
# it oscillates after a change of the stiffness
DAMPING_STATE = -7
DAMPING_FORCE = -6  # force of tangent damping at the end of the step, N
DAMPING_WORK = -5  # work of tangent damping since the start, J
BRACE_FORCE = -4  # force of brace and damper in the equations of the method, N
# Force of brace and damper for the results, N: BRACE_FORCE, or another estimate if the damper is
# too stiff for the step (`tdint.kernels.stories.brace`)
BRACE_REPORTED = -3
BRACE_PEAK = -2  # maximum absolute force since the last observed time, N
BRACE_DISSIPATED = -1  # energy that the damper has dissipated since the start, J
BRACE_START = -10  # BRACE_REPORTED at the start of the last step or substep, N
ADDED_STATE_ROWS = 10

# load: load of a step. The ground acceleration is linear within the step.
TIME = 0  # start of the step, s
GROUND_0 = 1  # ground acceleration at the start and at the end, m/s^2
GROUND_1 = 2
LOAD_SIZE = 3

# peaks: maximum absolute values. The same number of rows follows with possible peaks between the
# time steps, which the response at the endpoints of the steps does not determine reliably.
PEAK_DRIFT = 0  # m
PEAK_SHEAR = 1  # N
PEAK_DISPLACEMENT = 2  # m
PEAK_VELOCITY = 3  # m/s
PEAK_ACCELERATION = 4  # absolute acceleration: relative acceleration plus ground acceleration
# Sum of restoring force, P-delta force and all viscous forces of a story, which accelerates all
# floors above, N
PEAK_TOTAL_SHEAR = 5
PEAK_DRIFT_RATE = 6  # drift rate of stories with a dashpot, m/s; 0 for other stories
PEAK_BRACE_FORCE = 7  # force of dampers with a brace, N
PEAK_INERTER_FORCE = 7  # in a building with inerters, which has no braces, force of the inerter, N
PEAK_ROWS = 8

# observer_state: memory of the observer of the response, by floor or story
OBSERVED_ACCELERATION = 0  # acceleration from equilibrium, independent of the method, m/s^2
FLOOR_FORCE = 1  # forces on floors minus modal damping forces, N
TOTAL_SHEAR = 2  # N
U_PREVIOUS = 3  # displacement, velocity and acceleration at the previous observed time
V_PREVIOUS = 4
A_PREVIOUS = 5
V_EARLIER = 6  # velocity and acceleration one step before the previous observed time
A_EARLIER = 7
MODAL_FORCE = 8  # modal damping force on the floor, N
# The following rows are used only in a building with forces on floors.
START_FORCE = 9  # sum of the lines of the tables on the floor at the start of the step, N
ACCELERATION_JUMP = 10  # jump of the acceleration between two steps by the lines, m/s^2
# Sum of the deviations of the tables from their lines at the end of the step, divided by the mass
# of the floor, m/s^2
ACCELERATION_DEVIATION = 11
# Upper bounds of the absolute deviations from the response under the lines in the step: of the
# acceleration of the floor (m/s^2), of its velocity (m/s), and of the total shear of the story (N)
DEVIATION_BOUND = 12
VELOCITY_BOUND = 13
SHEAR_BOUND = 14
# Half of the increase of the rate of the power of all dampers except modal damping (W/s) per unit
# increase of the acceleration of the floor (m/s^2)
VISCOUS_FACTOR = 15
# Half of the increase of the rate of the power of the dashpot of the story (W/s) per unit increase
# of the drift acceleration (m/s^2)
DASHPOT_FACTOR = 16
# Deviations from the response under the lines at the start and, in the next row, at the end of a
# part of the step: sum of the forces of the tables on the floor (N), velocity of the floor (m/s),
# and modal damping force (N). The third row of the last two is the bulge in the part: 4 times the
# difference, at its middle, from the straight line between the endpoint values.
LOAD_DEVIATION = 17
VELOCITY_DEVIATION = 19
MODAL_DEVIATION = 22
# Bulge, in the same sense, of the velocity under the lines in the step (m/s), and its modal damping
# force (N)
VELOCITY_BULGE = 25
MODAL_BULGE = 26
# First of LOCATED_ROWS rows
LOCATED = 27
# Sums over all stories on the floor, only in the variant `tree`: force of the stories; damping
# forces of the floors, mass times absolute acceleration at the start of the step, its bulge, and
# factors of the drift accelerations
FORCE_ON = 42
DAMPING_ON = 43
INERTIA_ON = 44
BULGE_ON = 45
FACTOR_ON = 46
# Power of the dashpot of the story (W), its rate (W/s) and its work since the start (J), in the
# variant `tree`
DASHPOT_POWER = 47
DASHPOT_RATE = 48
DASHPOT_WORK = 49
OBSERVER_ROWS = 50

# Rows of a step or substep for the peaks inside it (`tdint.kernels.located_peaks`), relative to the
# first row
REVERSAL_DRIFT = 0  # drift of a reversal, m; without a reversal, the drift at the end of the step
# Instants of an extremum of the acceleration of a floor and of the total shear of a story, as
# fractions of the step; 0 for none
ACCELERATION_INSTANT = 1
TOTAL_SHEAR_INSTANT = 2
# Response at an instant: displacement (m) and velocity (m/s) of the floor, force of brace and
# tangent damping of the story, sum of its other forces, and internal force of the floor (N)
LOCATED_DISPLACEMENT = 3
LOCATED_VELOCITY = 4
LOCATED_DEVICE = 5
LOCATED_SUM = 6
LOCATED_INTERNAL = 7
LOCATED_BRACE = 8  # results of `tdint.kernels.stories.brace.follow_brace`
LOCATED_ROWS = 15

# forces: forces on floors; one row for each force, with the following columns. A row is a harmonic
# force COSINE cos(OMEGA t) + SINE sin(OMEGA t) if POINTS is 0. Otherwise it is a table, linear
# between its points and zero before the first and after the last point. All methods integrate the
# straight line with the impulse and the first moment of the table over the step or substep
# (`tdint.kernels.time_loop.force_tables`). The columns from LINE_TIME on change from step to step.
# Harmonic forces are first, then tables in the order of their floors.
FLOOR = 0  # index of the floor
COSINE = 1  # N
SINE = 2  # N
OMEGA = 3  # rad/s
POINTS = 4  # number of points of the table
TIMES = 5  # index of the first time in the array of points
VALUES = 6  # index of the first value in the array of points
FACTOR = 7  # the force is this factor times the value, N per unit of the values
DELAY = 8  # added to the times of the table, s
LINE_TIME = 9  # start of the step, s
LINE_VALUE = 10  # value of the line at this time, N
LINE_RATE = 11  # N/s
NEXT_POINT = 12  # number of points until the start of the step
DEVIATION = 13  # maximum absolute deviation of the table from the line within the step, N
NEW_TIMES = 14  # 1 if the times of the table differ from those of the table in the row before
STRIDE = 15  # distance of successive times and of successive values in the array of points
FORCE_COLUMNS = 16
# Further columns, only for methods that integrate tables exactly (`Family.moments`): Legendre
# coefficients of the table over the step from degree 2 on, N. The line has the degrees 0 and 1.

# points: tables of forces, row by row: time (s) and values; several forces can share their times

# history: one row for each stored time: ground acceleration; displacement, velocity and absolute
# acceleration of all floors; shear of all stories; in a building with braces their forces; energies
HISTORY_FIELDS = 4

# totals: values of the complete run. The first ENERGY_TERMS values are the energies at the end of
# the run, J; a history contains the energies at each stored time.
ENERGY_INPUT = 0  # work of the load on the motion relative to the ground
ENERGY_KINETIC = 1  # kinetic energy of the motion relative to the ground
ENERGY_VISCOUS = 2  # work of viscous damping without dashpots
ENERGY_DASHPOTS = 3  # work of the dashpots
ENERGY_STRAIN = 4  # energy stored in the stories, P-delta included
ENERGY_HYSTERETIC = 5  # energy dissipated by the laws since the start
ENERGY_BRACES = 6  # energy stored in the braces of dampers
ENERGY_TERMS = 7
ENERGY_INITIAL = ENERGY_TERMS  # kinetic and strain energy at the start, J
ENERGY_REFERENCE = ENERGY_TERMS + 1  # maximum of ENERGY_INITIAL + ENERGY_INPUT in the run, J
ITERATIONS = ENERGY_TERMS + 2  # number of iterations
HALVINGS = ENERGY_TERMS + 3  # number of halvings of a step that did not converge
STEPS_REACHED = ENERGY_TERMS + 4  # number of complete steps
POWER_INPUT = ENERGY_TERMS + 5  # power of the load at the last observed time, W
# Rate of the power of the load, W/s, without the part due to the rate of the ground acceleration
RATE_INPUT = ENERGY_TERMS + 6
MOMENTUM = ENERGY_TERMS + 7  # momentum of all floors, N s
POWER_VISCOUS = ENERGY_TERMS + 8  # power of all dampers, W, and its rate, W/s
RATE_VISCOUS = ENERGY_TERMS + 9
INITIAL_DISSIPATION = ENERGY_TERMS + 10  # dissipated by the laws up to the initial drifts, J
# Number of complete steps after which a story first exceeded a limit; NO_COLLAPSE if no story did
COLLAPSE_STEP = ENERGY_TERMS + 11
# Index of the first failed story, or of the story with the largest excess of its drift ratio limit
COLLAPSE_STORY = ENERGY_TERMS + 12
# 1 if the story has failed, NO_RESISTANCE if its drift has exceeded HIGH_LIMIT or LOW_LIMIT
COLLAPSE_FAILED = ENERGY_TERMS + 13
# Energies at the collapse, then ENERGY_INITIAL and ENERGY_REFERENCE, J
COLLAPSE_ENERGIES = ENERGY_TERMS + 14
TOTAL_INERTIA = COLLAPSE_ENERGIES + ENERGY_TERMS + 2  # sum of mass times acceleration, N
# Half of the increase of RATE_VISCOUS (W/s) if the acceleration of all floors increases by 1 m/s^2
VISCOUS_PER_ACCELERATION = TOTAL_INERTIA + 1
TOTAL_MASS = TOTAL_INERTIA + 2  # kg
POWER_DASHPOTS = TOTAL_INERTIA + 3  # power of the dashpots only, W, and its rate, W/s
RATE_DASHPOTS = TOTAL_INERTIA + 4
DASHPOTS_PER_ACCELERATION = TOTAL_INERTIA + 5  # VISCOUS_PER_ACCELERATION of the dashpots only
# Energy that the dampers with braces have dissipated until the last observed time, J
BRACED_DISSIPATION = TOTAL_INERTIA + 6
TANGENT_WORK = TOTAL_INERTIA + 7  # work of tangent damping until the last observed time, J
TOTALS_SIZE = TOTAL_INERTIA + 8

# Value of totals[COLLAPSE_STEP] without collapse
NO_COLLAPSE = -1.0
# Value of totals[COLLAPSE_FAILED] that ends the time integration
NO_RESISTANCE = 2.0

# limits: collapse limits, by story
LIMIT = 0  # drift ratio above which the story has collapsed
HEIGHT = 1  # story height, m; nan for a story without a limit
FAILED = 2  # value of INTERNAL after the story has lost its strength; nan for laws without failure
HIGH_LIMIT = 3  # drifts beyond which the story has no resistance left, m; infinite for no limit
LOW_LIMIT = 4
# Smallest absolute drift that can exceed one of the limits above, m: a fast test for all stories
SMALLEST_LIMIT = 5
LIMIT_ROWS = 6

# flags: properties that are set before the time integration and remain constant
LINEAR = 0  # 1 if every law is linear
BRANCHES = 1  # laws with branches whose changes can be located: one of the values below
# 1 if a story has a power-law dashpot, a damper with a brace, tangent damping or an inerter
POWER_DAMPERS = 2
OWN_WORK = 3  # 1 if the step reports the work of the load and of the dampers
UNRESOLVED_MODES = 4  # 1 if the building has modes with periods that the step does not resolve
PARABOLIC = 5  # 1 if the displacements follow parabolas within a step
HAS_DASHPOTS = 6  # 1 if a story has a dashpot, linear or of a power law, with or without a brace
KEEPS_START = 7  # 1 if the law states at the start of a step are kept in block STEP_START
HAS_BRACES = 8  # 1 if a story has a damper with a brace
HAS_TANGENT_DAMPING = 9  # 1 if a story has Rayleigh damping with the tangent stiffness
# Rule of the mean over a step (`Family.mean_rule`): weight of two points, and their distance from
# the middle as a fraction of the step
MEAN_WEIGHT = 10
MEAN_DISTANCE = 11
CAN_FRACTURE = 12  # 1 if a law can fracture and block STEP_START is kept, -1 if it is not kept
# 1 if a story has a damper with a brace or tangent damping: the state has ADDED_STATE_ROWS
HAS_DAMPER_STATE = 13
FLAGS_SIZE = 14

# Values of flags[BRANCHES]
NO_BRANCHES = 0
ALL_BRANCHES = 1  # every law is linear or piecewise linear
SOME_BRANCHES = 2  # some laws have branches, some are curved

# step_status: values that a step passes to the next step, to the time loop and to messages
# Ground acceleration for which the acceleration of the state is valid, if a step is longer than a
# sampling interval, m/s^2
STATE_GROUND = 0
STEPS_DONE = 1  # number of steps since the start, or since a step that was halved
FACTORED_STEP = 2  # step size of the factorization in the scratch array, s; 0 for none
# First scratch row of the peaks within the step that the step has computed; 0 for none
STEP_PEAKS = 3
WORK_INPUT = 4  # work of the load in the last step, J
WORK_VISCOUS = 5  # work of the viscous dampers in the last step, J
WORST_STORY = 6  # index of the equation with the largest relative residual if a step failed
RESIDUAL = 7  # largest residual relative to the sum of the absolute values of the terms
BRANCH_CHANGES = 8  # number of located changes of branch
STEP_STATUS_SIZE = 9

# Return values of a step that failed; otherwise the number of iterations
NOT_CONVERGED = -1
NOT_FINITE = -2

# Events that end a branch of a law
ABOVE = 1.0  # the drift exceeds the upper limit
BELOW = -1.0  # the drift falls below the lower limit
REVERSED = 0.0  # the drift rate changes its sign
