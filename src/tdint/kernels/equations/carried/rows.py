"""What carries the error of moment4 along: its rows of work, and what its modules share."""

from __future__ import annotations

from typing import NamedTuple

from tdint.kernels import layout as at
from tdint.kernels.compiling import inlined
from tdint.kernels.equations.iteration import SAME_TANGENT
from tdint.kernels.equations.moment4 import ROW, STORE, solve
from tdint.kernels.laws.choosing import ANY_APART, COUNTING_TURNS, COUNTS_TURNS
from tdint.kernels.linear_terms import FORCES, MODAL, add_modal_force, force_second, force_third
from tdint.kernels.stepping import Array, Memory, Scene, Stretch
from tdint.kernels.stories import error_path, path

STATE_ROWS = 5  # of a drift and of its error
NODES = 28  # at most, within a step at which it is looked closely: 10 events, and 3 pairs of parts beside theirs


class _Rows(NamedTuple):
    """Rows of work behind those of the run's step."""

    RISE: int = 1  # of the error; column n: `struggled`
    BEND: int = 1
    EVEN: int = 1  # bubbles of the floors
    ODD: int = 1
    A1: int = 1  # h^2 A1
    SECOND: int = 1  # moments of the story forces
    THIRD: int = 1
    MEAN: int = 1  # what mean and first moment of a story's force are more than the run's
    MOMENT: int = 1
    CALM: int = 1  # 1 if the story is on the same linear branch in both motions; column n: `unsettled`
    PATH: int = error_path.ERROR_PATH_ROWS
    OTHER: int = 3  # modal damping, and forces on floors
    FORCES: int = NODES  # of stories at the nodes within a step, later total shears; their times in column n
    # Accelerations of the floors there, absolute ones in columns n + 1 ..., that of the ground in column n
    MOTION: int = NODES
    SLOPES: int = NODES  # of the stories' springs there
    PEAKS: int = 2 * at.PEAK_ROWS  # of the corrected motion


OWN, ERROR_ROWS = at.chained(_Rows)

# Parts of what the rate of a story is off by that may be left of it in the corrected motion: of the error that is
# carried along (in nine of ten runs the largest is corrected to less than a tenth of it), and of the rate that the even
# bubble has at most, 5.8 times its factor: a sixth, for the rate asked has that bubble already, and what comes next is
# smaller by the step over the motion's time. Of 21 runs in doubt by .25 and 3, four were told too little.
OF_ERROR = 0.1
OF_BUBBLE = 1.0

_SETTLED = 1e-3  # correction over the error after which there is none more


class Carried(NamedTuple):
    """What the error's step works on; `base` is the first of its own rows of work."""

    scene: Scene
    memory: Memory
    load: Array
    h: float
    base: int


class Corrected(NamedTuple):
    """A floor, or the drift of a story, over the step in the corrected motion."""

    u: float  # at its start
    v: float  # h times the rate there
    rise: float  # of its parabola
    bend: float


def error_peaks(modes: int) -> int:
    """The first of the rows of work with the peaks of the corrected motion, rows as of `Workspace.peaks`."""
    return STORE + 6 * modes + 1 + OWN.PEAKS


def unsettled(modes: int) -> int:
    """The row of work in whose column n is what was left to correct where the passes did not settle, m."""
    return STORE + 6 * modes + 1 + OWN.CALM


def struggled(modes: int) -> int:
    """The row of work in whose column n is what was left to correct after the usual passes, m."""
    return STORE + 6 * modes + 1 + OWN.RISE


@inlined
def first_row(modal):
    """The first of the error's rows of work."""
    return STORE + 6 * modal.shape[0] + 1


@inlined
def begin_error(scene, memory, peaks):
    """Start the companion from the run's state at t = 0, which is the true one: with its peaks so far."""
    n = scene.linear_terms.shape[1] - 1
    first = first_row(scene.modal) + OWN.PEAKS
    for i in range(n):
        for row in range(memory.springs.shape[0]):
            memory.springs[row, n + 1 + i] = memory.springs[row, i]
        for row in range(at.PEAK_ROWS):
            memory.work[first + row, i] = peaks[row, i]


@inlined
def corrected(carried, i):
    """Floor `i` in the corrected motion: that of the run, and its error."""
    _, memory, _, h, base = carried
    state, _, work, _ = memory
    return Corrected(
        u=state[at.DISPLACEMENT, i] + state[at.ERROR_DISPLACEMENT, i],
        v=h * (state[at.VELOCITY, i] + state[at.ERROR_VELOCITY, i]),
        rise=work[ROW.RISE, i] + work[base + OWN.RISE, i],
        bend=work[ROW.BEND, i] + work[base + OWN.BEND, i],
    )


@inlined
def relative(floor, below, link):
    """The drift of the story between a floor and the one below it; the floor itself with a link of 0."""
    return Corrected(
        u=floor.u - link * below.u,
        v=floor.v - link * below.v,
        rise=floor.rise - link * below.rise,
        bend=floor.bend - link * below.bend,
    )


@inlined
def story_of(carried, i):
    """The drift of story `i` in the corrected motion."""
    link = carried.scene.linear_terms[at.LINK, i]
    return relative(corrected(carried, i), corrected(carried, max(i - 1, 0)), link)


@inlined
def same_slope(carried, i):
    """Whether story `i` has the stiffness of a linear branch in both motions: about, where laws remember what went
    before, and that differs."""
    scene, memory, _, _, _ = carried
    springs = memory.springs
    slope, other = springs[at.SLOPE, i], springs[at.SLOPE, scene.linear_terms.shape[1] + i]
    if ANY_APART:
        return abs(other - slope) <= SAME_TANGENT * scene.law_parameters[at.STIFFNESS, i]
    return slope == other


@inlined
def of_slopes(carried, i):
    """Mean and moment of what the force of story `i` has more in the companion over the run's own way, where its branch
    is stiffer there: `same_slope` allows for that."""
    scene, memory, _, _, _ = carried
    springs = memory.springs
    more = springs[at.SLOPE, scene.linear_terms.shape[1] + i] - springs[at.SLOPE, i]
    way = of_story(carried, ROW.RISE, i)
    return more * (0.5 * way - of_story(carried, ROW.BEND, i) / 12.0), more * way


@inlined
def whole_path(carried, i):
    """The companion's parabola of story `i`, without its bubbles."""
    linear_terms = carried.scene.linear_terms
    story = relative(corrected(carried, i), corrected(carried, max(i - 1, 0)), linear_terms[at.LINK, i])
    return Stretch(carried.memory.springs[at.DRIFT, linear_terms.shape[1] + i], story.rise, story.bend, 0.0, 1.0)


@inlined
def of_story(carried, row, i):
    """What story `i` has of a row of the floors."""
    return of_story_in(carried, carried.memory.work, row, i)


@inlined
def of_story_in(carried, table, row, i):
    """The same of another table."""
    return table[row, i] - carried.scene.linear_terms[at.LINK, i] * (table[row, i - 1] if i > 0 else 0.0)


@inlined
def bubbles_of(carried, i):
    """The factors of the bubbles of story `i`."""
    base = carried.base
    return of_story(carried, base + OWN.EVEN, i), of_story(carried, base + OWN.ODD, i)


@inlined
def turns_of(carried, i, even):
    """Where story `i` turns in the corrected motion (`path.turns`): its rate is that of the state at both ends, to
    which the odd bubble leads, and that of the even bubble, whose factor is `even`, grows by 60 times that at first."""
    story = story_of(carried, i)
    odd = (story.rise - 0.5 * story.bend - story.v) / 5.0
    start = story.bend + 30.0 * odd + 60.0 * even
    return path.turns(story.rise, story.v, story.v + story.bend, start)


@inlined
def surely_keeps(carried, i, story):
    """Whether the Bezier points of the path of story `i`, and those of its rate (`turns_of`), say without a root, and
    without a doubt (`note_doubt`), that it keeps to its linear branch."""
    _, memory, _, h, base = carried
    springs = memory.springs
    c = carried.scene.linear_terms.shape[1] + i
    turn, upper, lower = springs[at.TURN, c], springs[at.UPPER, c], springs[at.LOWER, c]
    even = of_story(carried, base + OWN.EVEN, i)
    middle = 2.0 * story.rise - story.v - 0.5 * story.bend
    tilt = 20.0 * even - story.bend / 6.0
    least = 0.0
    if COUNTS_TURNS and carried.scene.law_parameters[at.CODE, i] in COUNTING_TURNS:
        off = h * of_story_in(carried, memory.state, at.ERROR_VELOCITY, i)
        off = max(abs(off), abs(off + of_story(carried, base + OWN.BEND, i)))
        least = abs(turn) * (OF_ERROR * off + OF_BUBBLE * abs(even))
    surely = (turn * story.v >= least) & (turn * (story.v + story.bend) >= least)
    surely &= (turn * (middle + tilt) >= least) & (turn * (middle - tilt) >= least)
    # What the bubbles are at most, about
    far = 0.1 * abs(story.rise - 0.5 * story.bend - story.v) + 2.0 * abs(even)
    start = springs[at.DRIFT, c]
    middle, end = start + 0.5 * story.rise - 0.25 * story.bend, start + story.rise
    return surely & (middle + far <= upper) & (end <= upper) & (middle - far >= lower) & (end >= lower)


@inlined
def note_doubt(carried, i, turned, failed):
    """Mark the run as in doubt where it hangs on less than what the rate of story `i` may be off by whether it turns,
    if its law counts turns, and where a story has failed, whose force jumps. At a turn in the first step no law takes
    anything: there is no way behind it."""
    _, memory, load, h, base = carried
    state, springs, _, report = memory
    c = carried.scene.linear_terms.shape[1] + i
    first = h * of_story_in(carried, state, at.ERROR_VELOCITY, i)
    off = max(abs(first), abs(first + of_story(carried, base + OWN.BEND, i)))
    unsure = OF_ERROR * off + OF_BUBBLE * abs(of_story(carried, base + OWN.EVEN, i))
    counting = (carried.scene.law_parameters[at.CODE, i] in COUNTING_TURNS) & (load[at.TIME] > 0.0)
    loading = (springs[at.TURN, c] != 0.0) | (springs[at.FIRST_TRIAL + at.TURN, c] != 0.0)
    if (failed or (counting and loading and turned[4] < unsure)) and report[at.DOUBTFUL_STORY] == 0.0:
        report[at.DOUBTFUL_STORY] = i + 1.0
        report[at.DOUBTFUL_TIME] = load[at.TIME]


@inlined
def add_loads(carried):
    """What modal damping and floor forces add to the bubbles."""
    scene, memory, load, h, base = carried
    modal, forces = scene.modal, scene.forces
    work = memory.work
    if (MODAL or FORCES) and forces.shape[0] + modal.shape[0] > 0:
        n = scene.linear_terms.shape[1] - 1
        for i in range(n):
            work[base + OWN.SECOND, i] = 0.0
            work[base + OWN.THIRD, i] = 0.0
        add_modal_force(modal, work, base + OWN.A1, 0.5 / h, work, base + OWN.SECOND, n)
        for j in range(forces.shape[0]):
            floor = int(forces[j, at.FLOOR])
            work[base + OWN.SECOND, floor] -= force_second(forces, j, load[at.TIME], h)
            work[base + OWN.THIRD, floor] -= force_third(forces, j, load[at.TIME], h)
        for i in range(n):
            inverse = h * h * scene.linear_terms[at.INVERSE_MASS, i]
            work[base + OWN.EVEN, i] -= inverse / 360.0 * work[base + OWN.SECOND, i]
            work[base + OWN.ODD, i] -= 2.0 * inverse * work[base + OWN.THIRD, i]


@inlined
def correct(carried):
    """Correct rise and bend of the error. Returns the size of the corrections, 0 if they are small."""
    scene, memory, _, h, base = carried
    work = memory.work
    n = scene.linear_terms.shape[1] - 1
    solve(scene.modal, h, work, ROW.X, n)
    change = 0.0
    size = 0.0
    for i in range(n):
        for row in range(2):
            work[base + OWN.RISE + row, i] += work[ROW.X + row, i]
            change += abs(work[ROW.X + row, i])
            size += abs(work[base + OWN.RISE + row, i])
    return 0.0 if change <= _SETTLED * size else change
