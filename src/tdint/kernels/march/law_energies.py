"""What a march asks of the drift laws beside the steps: a beginning, energies, and the forces where stories turned.

The march is given these as kernels of their own, as it is given the step, so that it is compiled once for all laws.
"""

from __future__ import annotations

from tdint.kernels import layout as at
from tdint.kernels.compiling import I8, TABLE, VECTOR, called_at, inlined, kernel
from tdint.kernels.march.peaks_between_steps import raise_peak
from tdint.kernels.stories.law_state import dissipated, reach, recoverable, start

BEGIN = I8(TABLE, TABLE, TABLE, TABLE)
TAKE_STOCK = I8(TABLE, TABLE, TABLE, TABLE, VECTOR)
RAISE_SHEARS = I8(TABLE, TABLE, TABLE, I8, TABLE)

_call_begin = called_at(BEGIN)
_call_take_stock = called_at(TAKE_STOCK)
_call_raise_shears = called_at(RAISE_SHEARS)


@inlined
def begin_laws(begin, scene, memory):
    """Call the kernel `begin` that a march was given."""
    _call_begin(begin, scene.linear_terms, scene.law_parameters, memory.state, memory.springs)


@inlined
def sum_up(take_stock, scene, memory, seen):
    """Call the kernel `take_stock` that a march was given."""
    _call_take_stock(take_stock, scene.linear_terms, scene.law_parameters, memory.state, memory.springs, seen.totals)


@inlined
def take_shears(raise_shears, scene, memory, seen):
    """Call the kernel `raise_shears` that a march was given."""
    _call_raise_shears(raise_shears, scene.law_parameters, memory.springs, seen.watch, at.TURNED_AT, seen.peaks)


@kernel(BEGIN, parts=("laws",))
def begin(linear_terms, law_parameters, state, springs):
    """Bring all stories from rest to their initial drifts."""
    below = 0.0
    for i in range(linear_terms.shape[1] - 1):
        start(law_parameters, springs, i, state[at.DISPLACEMENT, i] - linear_terms[at.LINK, i] * below)
        below = state[at.DISPLACEMENT, i]
    return 0


@kernel(TAKE_STOCK, parts=("laws",))
def take_stock(linear_terms, law_parameters, state, springs, totals):
    """Kinetic, recoverable and dissipated energy of the present state, J."""
    kinetic = 0.0
    stored = 0.0
    lost = 0.0
    for i in range(linear_terms.shape[1] - 1):
        drift = springs[at.DRIFT, i]
        kinetic += 0.5 * linear_terms[at.MASS, i] * state[at.VELOCITY, i] * state[at.VELOCITY, i]
        stored += recoverable(law_parameters, springs, i) + 0.5 * linear_terms[at.GEOMETRIC, i] * drift * drift
        lost += dissipated(law_parameters, springs, i)
    totals[at.ENERGY_KINETIC] = kinetic
    totals[at.ENERGY_RECOVERABLE] = stored
    totals[at.ENERGY_DISSIPATED] = lost - totals[at.DISSIPATED_BEFORE]
    return 0


@kernel(RAISE_SHEARS, parts=("laws",))
def raise_shears(law_parameters, springs, turns, turn, peaks):
    """Peak shears of the stories that turned within a step, at the drifts in row `turn` of `turns`.

    From the end of the step the way leads back to where the story turned: there it finds the force again that it had.
    """
    for i in range(peaks.shape[1]):
        if turns[turn, i] != springs[at.DRIFT, i]:
            reach(law_parameters, springs, i, at.COMMITTED, at.FIRST_TRIAL, turns[turn, i])
            raise_peak(peaks, at.PEAK_SHEAR, i, springs[at.FIRST_TRIAL + at.FORCE, i])
    return 0
