"""What a march asks of the drift laws beside the steps: a beginning, energies, and the
forces where stories turned.

The march is given these as kernels of their own, as it is given the step, so that it is compiled once for all laws.
"""

from __future__ import annotations

from tdint.kernels.compiling import I8, TABLE, VECTOR, called_at, kernel
from tdint.kernels.layout import (
    COMMITTED,
    DISPLACEMENT,
    DRIFT,
    FIRST_TRIAL,
    FORCE,
    GEOMETRIC,
    LINK,
    MASS,
    PEAK_SHEAR,
    VELOCITY,
)
from tdint.kernels.march.observing import DISSIPATED_BEFORE, ENERGY_DISSIPATED, ENERGY_KINETIC, ENERGY_RECOVERABLE
from tdint.kernels.march.within import raise_peak
from tdint.kernels.stories.springs import dissipated, reach, recoverable, start

BEGIN = I8(TABLE, TABLE, TABLE, TABLE)
TAKE_STOCK = I8(TABLE, TABLE, TABLE, TABLE, VECTOR)

RAISE_SHEARS = I8(TABLE, TABLE, TABLE, I8, TABLE)

call_begin = called_at(BEGIN)
call_take_stock = called_at(TAKE_STOCK)
call_raise_shears = called_at(RAISE_SHEARS)


@kernel(BEGIN, parts=("laws",))
def begin(chain, laws, state, springs):
    """Bring all stories from rest to their initial drifts."""
    below = 0.0
    for i in range(chain.shape[1] - 1):
        start(laws, springs, i, state[DISPLACEMENT, i] - chain[LINK, i] * below)
        below = state[DISPLACEMENT, i]
    return 0


@kernel(TAKE_STOCK, parts=("laws",))
def take_stock(chain, laws, state, springs, observed):
    """Kinetic, recoverable and dissipated energy of the present state, J."""
    kinetic = 0.0
    stored = 0.0
    lost = 0.0
    for i in range(chain.shape[1] - 1):
        drift = springs[DRIFT, i]
        kinetic += 0.5 * chain[MASS, i] * state[VELOCITY, i] * state[VELOCITY, i]
        stored += recoverable(laws, springs, i) + 0.5 * chain[GEOMETRIC, i] * drift * drift
        lost += dissipated(laws, springs, i)
    observed[ENERGY_KINETIC] = kinetic
    observed[ENERGY_RECOVERABLE] = stored
    observed[ENERGY_DISSIPATED] = lost - observed[DISSIPATED_BEFORE]
    return 0


@kernel(RAISE_SHEARS, parts=("laws",))
def raise_shears(laws, springs, turns, turn, peaks):
    """Peak shears of the stories that turned within a step, at the drifts in row `turn` of `turns`.

    From the end of the step the way leads back to where the story turned: there it finds the force again that it had.
    """
    for i in range(peaks.shape[1]):
        if turns[turn, i] != springs[DRIFT, i]:
            reach(laws, springs, i, COMMITTED, FIRST_TRIAL, turns[turn, i])
            raise_peak(peaks, PEAK_SHEAR, i, springs[FIRST_TRIAL + FORCE, i])
    return 0
