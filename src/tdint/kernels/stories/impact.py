"""Damping of contacts with the law `hertz`, whose force is INTERNAL times the rate of the strain
energy (`tdint.kernels.laws.hertz`); INTERNAL is the inverse of the approach velocity, s/m."""

from __future__ import annotations

import math

from tdint.kernels import layout as rows
from tdint.kernels.compiling import inline, outlined
from tdint.kernels.laws import NAMES

HERTZ = float(NAMES.index("hertz"))
"""Number of the law in row CODE of `law_parameters`."""

# Parameters of the law. A run must not import laws that its building does not have.
_GAP = rows.FIRST_PARAMETER  # m
RESTITUTION = rows.FIRST_PARAMETER + 3  # 1 without damping of the contact


@inline
def has_impact(law_parameters, i):
    """Return True if spring `i` is a contact of Hertz with a restitution below 1.

    The coefficient of tangent damping of another spring of Hertz is that of Rayleigh damping.
    """
    return law_parameters[rows.CODE, i] == HERTZ and law_parameters[RESTITUTION, i] != 1.0


@outlined
def start_impact(law_parameters, law_state, i, rate):
    """Store the inverse of the approach velocity `rate` (m/s) of spring `i`, if it is a contact of
    Hertz that is closed. A contact with the rate 0 has no damping."""
    if has_impact(law_parameters, i) and law_state[rows.SLOPE, i] == math.inf:
        law_state[rows.INTERNAL, i] = 1.0 / abs(rate) if rate != 0.0 else 0.0


@outlined
def damping_slope(law_parameters, law_state, i, block, tangent):
    """Return the factor of the drift rate in the force of tangent damping of spring `i`, divided by
    its coefficient: the tangent stiffness `tangent`, N/m, or in a contact of Hertz the force in
    `block` times INTERNAL."""
    if not has_impact(law_parameters, i):
        return tangent
    return law_state[rows.INTERNAL, i] * abs(law_state[block + rows.FORCE, i])


@inline
def damping_potential(law_parameters, law_state, i, force, drift):
    """Return the integral of `damping_slope` over the drift of a contact of Hertz, with the force
    (N) at the drift (m)."""
    penetration = abs(drift) - law_parameters[_GAP, i]
    return law_state[rows.INTERNAL, i] * 0.4 * math.copysign(force, drift) * penetration
