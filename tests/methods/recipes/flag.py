"""Flag-shaped law of a self-centering damper by Christopoulos, Filiatrault and Folz (2002,
Earthquake Engineering and Structural Dynamics 31).

The damper slides along f = Fy + a k (d - dy), unloads with stiffness k to the parallel line beta Fy
below, follows this line, and returns to zero along the elastic line f = k d without residual drift.
"""

from tdint.plugin import DriftLaw, LawParameter, rows, yields_at_its_strength

STRENGTH, HARDENING, LOSS = range(rows.FIRST_PARAMETER, rows.FIRST_PARAMETER + 3)
ELASTIC, SLIDING, BETWEEN, RETURNING = (
    0.0,
    1.0,
    2.0,
    3.0,
)  # the branch in row INTERNAL, times its side


def _functions():
    import math

    from tdint.plugin import follow_branches, inline, outlined, set_branch

    @inline
    def distance_between_lines(law_parameters, i):
        """Return the drift between the two sloping lines along k."""
        soft = (1.0 - law_parameters[HARDENING, i]) * law_parameters[rows.STIFFNESS, i]
        return law_parameters[LOSS, i] * law_parameters[STRENGTH, i] / soft

    @outlined
    def enter(law_parameters, law_state, i):
        """Set the branch at rest; otherwise keep the current branch."""
        if law_state[rows.INTERNAL, i] == ELASTIC:
            dy = law_parameters[STRENGTH, i] / law_parameters[rows.STIFFNESS, i]
            set_branch(
                law_state, i, rows.COMMITTED, law_parameters[rows.STIFFNESS, i], -dy, dy, 0.0
            )

    @outlined
    def switch(law_parameters, law_state, i, block, event):
        k = law_parameters[rows.STIFFNESS, i]
        dy = law_parameters[STRENGTH, i] / k
        between = distance_between_lines(law_parameters, i)
        drift = law_state[block + rows.DRIFT, i]
        branch = abs(law_state[block + rows.INTERNAL, i])
        side = (
            math.copysign(1.0, law_state[block + rows.INTERNAL, i]) if branch != ELASTIC else event
        )
        sloping = law_parameters[HARDENING, i] * k
        if branch == ELASTIC or (branch == BETWEEN and event == side):
            law_state[block + rows.INTERNAL, i] = side * SLIDING
            set_branch(law_state, i, block, sloping, -math.inf, math.inf, side)
        elif branch == BETWEEN:
            law_state[block + rows.INTERNAL, i] = side * RETURNING
            end = side * (dy - between)
            lower = end if side > 0.0 else -math.inf
            set_branch(law_state, i, block, sloping, lower, math.inf if side > 0.0 else end, -side)
        elif event == rows.REVERSED:
            law_state[block + rows.INTERNAL, i] = side * BETWEEN
            other = drift + side * between * (1.0 if branch == RETURNING else -1.0)
            set_branch(law_state, i, block, k, min(drift, other), max(drift, other), 0.0)
        else:
            law_state[block + rows.INTERNAL, i] = ELASTIC
            set_branch(law_state, i, block, k, -dy, dy, 0.0)

    @inline
    def strain_energy(law_parameters, law_state, i):
        """Return the energy of the unloading path: to the lower line, along it, and along the
        elastic line."""
        k = law_parameters[rows.STIFFNESS, i]
        f = abs(law_state[rows.FORCE, i])
        if law_state[rows.INTERNAL, i] == ELASTIC:
            return 0.5 * f * f / k
        end = law_parameters[STRENGTH, i] / k - distance_between_lines(law_parameters, i)
        d = abs(law_state[rows.DRIFT, i])
        line = k * end + law_parameters[HARDENING, i] * k * (
            d - end
        )  # the lower line below the story's point
        back = (f - line) / ((1.0 - law_parameters[HARDENING, i]) * k)
        met = f - k * back
        return 0.5 * ((f + met) * back + (met + k * end) * (d - back - end) + k * end * end)

    return follow_branches(switch, strain_energy, enter)


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
