"""A self-centering damper: the flag-shaped law of Christopoulos, Filiatrault and Folz (2002,
Earthquake Engineering and Structural Dynamics 31).

It slides along f = Fy + a k (d - dy), goes back by k until beta Fy below that, along that line, and
from the elastic line f = k d to zero: no drift stays.
"""

from tdint.plugin import DriftLaw, LawParameter, at, yields_at_its_strength

STRENGTH, HARDENING, LOSS = range(at.FIRST_PARAMETER, at.FIRST_PARAMETER + 3)
ELASTIC, SLIDING, BETWEEN, RETURNING = (
    0.0,
    1.0,
    2.0,
    3.0,
)  # the branch in row INTERNAL, times its side


def _functions():
    import math

    from tdint.plugin import called, inlined, put_on_branch, walking

    @inlined
    def way_between(law_parameters, i):
        """Drift between the two sloping lines along k."""
        soft = (1.0 - law_parameters[HARDENING, i]) * law_parameters[at.STIFFNESS, i]
        return law_parameters[LOSS, i] * law_parameters[STRENGTH, i] / soft

    @called
    def enter(law_parameters, springs, i):
        """At rest, or as it was left."""
        if springs[at.INTERNAL, i] == ELASTIC:
            dy = law_parameters[STRENGTH, i] / law_parameters[at.STIFFNESS, i]
            put_on_branch(springs, i, at.COMMITTED, law_parameters[at.STIFFNESS, i], -dy, dy, 0.0)

    @called
    def switch(law_parameters, springs, i, block, event):
        k = law_parameters[at.STIFFNESS, i]
        dy = law_parameters[STRENGTH, i] / k
        between = way_between(law_parameters, i)
        drift = springs[block + at.DRIFT, i]
        branch = abs(springs[block + at.INTERNAL, i])
        side = math.copysign(1.0, springs[block + at.INTERNAL, i]) if branch != ELASTIC else event
        sloping = law_parameters[HARDENING, i] * k
        if branch == ELASTIC or (branch == BETWEEN and event == side):
            springs[block + at.INTERNAL, i] = side * SLIDING
            put_on_branch(springs, i, block, sloping, -math.inf, math.inf, side)
        elif branch == BETWEEN:
            springs[block + at.INTERNAL, i] = side * RETURNING
            end = side * (dy - between)
            lower = end if side > 0.0 else -math.inf
            put_on_branch(springs, i, block, sloping, lower, math.inf if side > 0.0 else end, -side)
        elif event == at.TURNED:
            springs[block + at.INTERNAL, i] = side * BETWEEN
            other = drift + side * between * (1.0 if branch == RETURNING else -1.0)
            put_on_branch(springs, i, block, k, min(drift, other), max(drift, other), 0.0)
        else:
            springs[block + at.INTERNAL, i] = ELASTIC
            put_on_branch(springs, i, block, k, -dy, dy, 0.0)

    @inlined
    def recoverable(law_parameters, springs, i):
        """By the way back: to the lower line, along it, along the elastic line."""
        k = law_parameters[at.STIFFNESS, i]
        f = abs(springs[at.FORCE, i])
        if springs[at.INTERNAL, i] == ELASTIC:
            return 0.5 * f * f / k
        end = law_parameters[STRENGTH, i] / k - way_between(law_parameters, i)
        d = abs(springs[at.DRIFT, i])
        line = k * end + law_parameters[HARDENING, i] * k * (
            d - end
        )  # the lower line below the story's point
        back = (f - line) / ((1.0 - law_parameters[HARDENING, i]) * k)
        met = f - k * back
        return 0.5 * ((f + met) * back + (met + k * end) * (d - back - end) + k * end * end)

    return walking(switch, recoverable, enter)


LAWS = (
    DriftLaw(
        "flag",
        "f along k, beyond Fy along a k, back beta Fy lower: self-centering damper",
        _functions,
        parameters=(
            LawParameter("yield_force", force=1, low=0.0, low_allowed=False),
            LawParameter("hardening", low=0.0, high=1.0, high_allowed=False),
            LawParameter("loss", low=0.0, high=1.0, low_allowed=False),
        ),
        kinked=True,
        yield_drift=yields_at_its_strength,
        fault=lambda stiffness, values: (
            None if values[1] + values[2] < 1.0 else "hardening + loss must be below 1"
        ),
    ),
)
