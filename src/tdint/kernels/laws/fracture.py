"""Fracture of a law at a drift: it loses its force permanently.

`fracturing` returns a law that follows another law until the drift reaches one of the rows
FRACTURE_HIGH and FRACTURE_LOW of `law_parameters`. From then on its force is 0, also after a
return. The stored energy counts as dissipated. The number of this law is the number of the other
law plus FRACTURING: it is a separate law, which is compiled when a building has it.
"""

from __future__ import annotations

import math
from dataclasses import replace
from functools import cache, partial
from typing import Any

from tdint.kernels import layout as rows
from tdint.kernels.laws.law import DriftLaw, LawFunctions

FRACTURING = 0.5
"""Added to the number of a law that can fracture (row CODE)."""

_FRACTURED = 1e6
"""Value of row INTERNAL after the fracture of a law that cannot fail otherwise; larger than any
value that a law stores there."""

AT_LIMIT = 1e-6
"""Fraction of the drift of the fracture. A branch that ends within this distance has reached it. A
path that ends within this distance beyond it has not yet fractured: a step that ends at a located
fracture needs the force before it, although the location has a small error."""


@cache
def fracturing(law: DriftLaw) -> DriftLaw:
    """Return a law that follows `law` until it fractures."""
    fractured = _FRACTURED if math.isnan(law.failed) else law.failed
    return replace(
        law,
        functions=partial(_functions, law, fractured),
        kinked=True,
        concave=False,
        failed=fractured,
        symmetric=lambda values: False,
        equal_directions=lambda values: False,
    )


def _functions(law: DriftLaw, fractured: float) -> LawFunctions:
    """Return the compiled functions of the law. After the fracture, INTERNAL is `fractured`."""
    from tdint.kernels.compiling import inline, outlined
    from tdint.kernels.laws.branch_following import (
        branch_owner,
        copy_branch,
        extra_rows,
        fail,
        set_branch,
    )
    from tdint.kernels.laws.hooks import hooks_of

    inner = law.functions()
    # In row DISSIPATED; other laws subtract the stored energy from the work.
    stores_energy = inner.hysteretic_energy is None or inner.accumulate_dissipation is not None
    inner_force, inner_strain_energy = inner.force, inner.strain_energy

    hooks = hooks_of(law)
    inner_hysteretic, inner_accumulate = hooks["hysteretic_energy"], hooks["accumulate_dissipation"]
    inner_keep, inner_enter = hooks["keep"], hooks["enter"]
    inner_switch, inner_advance = hooks["switch"], hooks["advance"]

    @inline
    def high_limit(law_parameters, i):
        """Return the drift of the fracture on the positive side, m; infinite for none."""
        limit = law_parameters[rows.FRACTURE_HIGH, i]
        return limit if limit > 0.0 else math.inf

    @inline
    def low_limit(law_parameters, i):
        """Return the drift of the fracture on the negative side, m; infinite for none."""
        limit = law_parameters[rows.FRACTURE_LOW, i]
        return limit if limit < 0.0 else -math.inf

    @inline
    def is_fractured(law_state, i, block):
        """Return True if the state in `block` is that of a fractured law."""
        return law_state[branch_owner(law_state, i, block) + rows.INTERNAL, i] == fractured

    @inline
    def limit_branch(law_parameters, law_state, i, block):
        """End the branch of a state at the drifts of the fracture."""
        high, low = high_limit(law_parameters, i), low_limit(law_parameters, i)
        law_state[block + rows.UPPER, i] = min(law_state[block + rows.UPPER, i], high)
        law_state[block + rows.LOWER, i] = max(law_state[block + rows.LOWER, i], low)

    @outlined
    def exchange(law_state, i, block):
        """Exchange the committed state and the state in `block`."""
        for row in range(rows.LAW_STATE_ROWS):
            value = law_state[row, i]
            law_state[row, i] = law_state[block + row, i]
            law_state[block + row, i] = value
        first, other = extra_rows(law_state, 0), extra_rows(law_state, block)
        for row in range((law_state.shape[0] - rows.EXTRA_ROWS) // rows.LAW_STATE_BLOCKS):
            value = law_state[first + row, i]
            law_state[first + row, i] = law_state[other + row, i]
            law_state[other + row, i] = value

    @outlined
    def fracture(law_parameters, law_state, i, block):
        """Remove the strength of the state in `block`, whose stored energy is dissipated."""
        if block != rows.COMMITTED:
            copy_branch(law_state, i, block)
        if stores_energy:
            # The functions of laws compute the stored energy of the committed state only.
            if block != rows.COMMITTED:
                exchange(law_state, i, block)
            energy = inner_strain_energy(law_parameters, law_state, i)
            energy += inner_hysteretic(law_parameters, law_state, i)
            if block != rows.COMMITTED:
                exchange(law_state, i, block)
            law_state[block + rows.DISSIPATED, i] = energy
        fail(law_state, i, block, fractured)

    @outlined
    def force_beyond_limit(law_parameters, law_state, i, previous, trial, drift):
        """Follow a fractured law, or a path that ends beyond the drift of the fracture."""
        if is_fractured(law_state, i, previous):
            for row in (rows.WORK, rows.DISSIPATED):
                law_state[trial + row, i] = law_state[previous + row, i]
            law_state[trial + rows.BRANCH_OFFSET, i] = 0.0
            fail(law_state, i, trial, fractured)
            return 0.0
        high = high_limit(law_parameters, i)
        limit = high if drift > high else low_limit(law_parameters, i)
        law_state[trial + rows.DRIFT, i] = limit
        inner_force(law_parameters, law_state, i, previous, trial, limit)
        inner_accumulate(law_parameters, law_state, i, previous, trial)
        fracture(law_parameters, law_state, i, trial)
        law_state[trial + rows.DRIFT, i] = drift
        return 0.0

    @inline
    def force(law_parameters, law_state, i, previous, trial, drift):
        """Follow the law, unless it is or becomes fractured; return the tangent stiffness."""
        center = drift / (1.0 + AT_LIMIT)
        is_intact = (center <= high_limit(law_parameters, i)) & (
            center >= low_limit(law_parameters, i)
        )
        if is_intact & (not is_fractured(law_state, i, previous)):
            law_state[trial + rows.INTERNAL, i] = 0.0  # some laws do not set this row
            return inner_force(law_parameters, law_state, i, previous, trial, drift)
        return force_beyond_limit(law_parameters, law_state, i, previous, trial, drift)

    @inline
    def strain_energy(law_parameters, law_state, i):
        """Return the stored energy, J; 0 after the fracture."""
        if law_state[rows.INTERNAL, i] == fractured:
            return 0.0
        return inner_strain_energy(law_parameters, law_state, i)

    @inline
    def hysteretic_energy(law_parameters, law_state, i):
        """Return the dissipated energy, J."""
        if law_state[rows.INTERNAL, i] == fractured:
            return law_state[rows.DISSIPATED, i]
        return inner_hysteretic(law_parameters, law_state, i)

    @inline
    def accumulate_dissipation(law_parameters, law_state, i, previous, trial):
        """Add the dissipated energy; after the fracture, `force` has set it."""
        if not is_fractured(law_state, i, trial):
            inner_accumulate(law_parameters, law_state, i, previous, trial)

    @inline
    def keep(law_parameters, law_state, i, previous, trial):
        """Commit the state, and end its branch at the fracture."""
        if is_fractured(law_state, i, trial):
            law_state[rows.WORK, i] = law_state[trial + rows.WORK, i]
            fail(law_state, i, rows.COMMITTED, fractured)
            law_state[trial + rows.INTERNAL, i] = fractured  # `commit` copies the common rows
        else:
            inner_keep(law_parameters, law_state, i, previous, trial)
            limit_branch(law_parameters, law_state, i, rows.COMMITTED)

    @inline
    def enter(law_parameters, law_state, i):
        """Set the branch of the committed state."""
        if law_state[rows.INTERNAL, i] == fractured:
            set_branch(law_state, i, rows.COMMITTED, 0.0, -math.inf, math.inf, 0.0)
        else:
            inner_enter(law_parameters, law_state, i)
            limit_branch(law_parameters, law_state, i, rows.COMMITTED)

    @inline
    def advance(law_parameters, law_state, i, block, step, mean_force):
        """Update the rows of a law that is not fractured."""
        if law_state[block + rows.INTERNAL, i] != fractured:
            inner_advance(law_parameters, law_state, i, block, step, mean_force)

    @inline
    def switch(law_parameters, law_state, i, block, event):
        """Set the branch that follows: the fracture, or the next branch of the law."""
        # At a reversal of a story, its fractured elements have no branch to change.
        if law_state[block + rows.INTERNAL, i] == fractured:
            return
        # A curved law can have passed its own limit at the commit of the state.
        high, low = high_limit(law_parameters, i), low_limit(law_parameters, i)
        drift = law_state[block + rows.DRIFT, i]
        is_at_limit = (
            (event == rows.ABOVE)
            & (law_state[block + rows.UPPER, i] == high)
            & (drift >= (1.0 - AT_LIMIT) * high)
        ) | (
            (event == rows.BELOW)
            & (law_state[block + rows.LOWER, i] == low)
            & (drift <= (1.0 - AT_LIMIT) * low)
        )
        if is_at_limit:
            fracture(law_parameters, law_state, i, block)
        else:
            inner_switch(law_parameters, law_state, i, block, event)
            limit_branch(law_parameters, law_state, i, block)

    return replace(
        inner,
        force=force,
        strain_energy=strain_energy,
        hysteretic_energy=hysteretic_energy if stores_energy else inner.hysteretic_energy,
        accumulate_dissipation=accumulate_dissipation if stores_energy else None,
        keep=keep if inner.keep else None,
        enter=enter,
        advance=advance,
        switch=switch,
        kink=_kink(hooks["kink"], high_limit, low_limit, is_fractured)
        if law.curved
        else inner.kink,
        branch_first=False,
    )


def _kink(inner_kink: Any, high_limit: Any, low_limit: Any, is_fractured: Any) -> Any:
    """Return the function `kink` of a curved law that can fracture."""
    from tdint.kernels.compiling import inline

    @inline
    def kink(law_parameters, law_state, i, block, side):
        """Return the drift change up to the fracture, or to an earlier kink, m."""
        if is_fractured(law_state, i, block):
            return math.inf
        limit = high_limit(law_parameters, i) if side > 0.0 else low_limit(law_parameters, i)
        distance = max(side * (limit - law_state[block + rows.DRIFT, i]), 0.0)
        return min(inner_kink(law_parameters, law_state, i, block, side), distance)

    return kink
