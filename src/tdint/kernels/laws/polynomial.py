"""Polynomial elastic law, f = c1 d + c2 d^2 + ..."""

from __future__ import annotations

from tdint.kernels import layout as rows
from tdint.kernels.laws.law import DriftLaw, LawFunctions, LawParameter


def _functions() -> LawFunctions:
    """Return the compiled functions of the law f = c1 d + c2 d^2 + ..., with the drift d."""
    from tdint.kernels.compiling import inline

    @inline
    def force(law_parameters, law_state, i, previous, trial, drift):
        """Compute the force c1 d + c2 d^2 + ... at the drift d; return the tangent stiffness, N/m.

        The polynomial and its derivative are evaluated by Horner's scheme, from the highest power
        to the lowest. In a sum of products, the compiler could combine products and sums in
        different ways in different variants of the code, and the results would differ by rounding.
        """
        secant = 0.0  # secant stiffness c1 + c2 d + ..., N/m
        slope = 0.0  # derivative of the secant stiffness, N/m^2
        for row in range(law_parameters.shape[0] - 1, rows.FIRST_PARAMETER - 1, -1):
            slope = slope * drift + secant
            secant = secant * drift + law_parameters[row, i]
        law_state[trial + rows.FORCE, i] = secant * drift
        return slope * drift + secant

    @inline
    def strain_energy(law_parameters, law_state, i):
        """Return the elastic energy of the committed state, the sum of c_j d^(j + 1) / (j + 1), J.

        c_j (j = 1, 2, ...) are the coefficients of the force c1 d + c2 d^2 + ... at the drift d.
        The sum is d^2 times a polynomial, which is evaluated by Horner's scheme, from the highest
        power to the lowest.
        """
        d = law_state[rows.DRIFT, i]
        energy = 0.0
        for row in range(law_parameters.shape[0] - 1, rows.FIRST_PARAMETER - 1, -1):
            # The divisor is j + 1; the coefficient c1 is in row FIRST_PARAMETER.
            energy = energy * d + law_parameters[row, i] / (row - rows.FIRST_PARAMETER + 2)
        return energy * d * d

    @inline
    def points(law_parameters, law_state, i, drift_change):
        """Return the number of Gauss points that integrate the force exactly over a path.

        The caller integrates the force f and the product f s over the time s of a part of a step.
        If f is a polynomial of degree q in the drift, and the drift is a parabola in s, then f s is
        a polynomial of degree 2 q + 1 in s. The Gauss rule with q + 1 points integrates this
        polynomial exactly. The number is a float because other laws return a number that is not an
        integer; the caller rounds it up.

        `drift_change` is the change of drift along the path, m; not used by this law.
        """
        # The table can have more rows than this story has coefficients; they are zero.
        degree = law_parameters.shape[0] - rows.FIRST_PARAMETER
        while degree > 1 and law_parameters[rows.FIRST_PARAMETER + degree - 1, i] == 0.0:
            degree -= 1
        return degree + 1.0

    return LawFunctions(force=force, strain_energy=strain_energy, points=points)


LAW = DriftLaw(
    "polynomial",
    "f = c1 d + c2 d^2 + ...",
    _functions,
    parameters=(LawParameter("coefficients", many=True),),
    curved=True,
    # A positive coefficient of d^(j + 1) stiffens the story for positive drifts, a negative
    # coefficient of an even power for negative drifts.
    stiffens=lambda values: any(
        c > 0.0 or (j % 2 == 1 and c < 0.0) for j, c in enumerate(values[1:], start=1)
    ),
    symmetric=lambda values: not any(values[1::2]),  # no even powers
    falls=lambda stiffness, values: any(values[1::2]) or min(values) < 0.0,
    initial_stiffness=lambda values: values[0],
)
