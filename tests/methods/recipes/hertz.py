"""Contact of two bodies with the force of Hertz, f = c (d - gap)^1.5 on the positive side
(Muthukumar and DesRoches 2006, Earthquake Engineering and Structural Dynamics 35).

The unit of c is force / length^1.5; the plug-in receives it in SI units (N/m^1.5).
"""

from tdint.plugin import DriftLaw, LawFunctions, LawParameter, rows

GAP, COEFFICIENT = rows.FIRST_PARAMETER, rows.FIRST_PARAMETER + 1


def _functions():
    import math

    from tdint.plugin import inline, set_branch

    @inline
    def force(law_parameters, law_state, i, previous, trial, drift):
        depth = max(drift - law_parameters[GAP, i], 0.0)
        law_state[trial + rows.FORCE, i] = law_parameters[COEFFICIENT, i] * depth**1.5
        return 1.5 * law_parameters[COEFFICIENT, i] * depth**0.5

    @inline
    def strain_energy(law_parameters, law_state, i):
        depth = max(law_state[rows.DRIFT, i] - law_parameters[GAP, i], 0.0)
        return 0.4 * law_parameters[COEFFICIENT, i] * depth**2.5

    @inline
    def set_side(law_parameters, law_state, i, block, is_closed):
        """Set the limit of the branch: the gap."""
        gap = law_parameters[GAP, i]
        slope = math.inf if is_closed else 0.0  # infinite: the branch is curved
        lower, upper = (gap, math.inf) if is_closed else (-math.inf, gap)
        set_branch(law_state, i, block, slope, lower, upper, 0.0)

    @inline
    def enter(law_parameters, law_state, i):
        is_closed = law_state[rows.DRIFT, i] > law_parameters[GAP, i]
        set_side(law_parameters, law_state, i, rows.COMMITTED, is_closed)

    @inline
    def switch(law_parameters, law_state, i, block, event):
        set_side(law_parameters, law_state, i, block, event == rows.ABOVE)

    return LawFunctions(force=force, strain_energy=strain_energy, enter=enter, switch=switch)


LAWS = (
    DriftLaw(
        "hertz",
        "f = c (d - gap)^1.5 for d > gap: contact of Hertz",
        _functions,
        parameters=(
            LawParameter("gap", length=1, low=0.0),
            LawParameter("coefficient", low=0.0, low_allowed=False),
        ),
        curved=True,
        kinked=True,
        stiffens=lambda values: True,
        initial_stiffness=lambda values: 0.0,
    ),
)
