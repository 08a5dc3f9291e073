"""The polynomial law: elastic."""

from __future__ import annotations

from tdint.kernels import layout as at
from tdint.kernels.laws.law import DriftLaw, LawFunctions, LawParameter


def _functions() -> LawFunctions:
    from tdint.kernels.compiling import inlined

    @inlined
    def force(law_parameters, springs, i, past, trial, drift):
        """By Horner's rule; a sum of two products could be contracted in two ways, by the scene it
        is compiled for."""
        secant = 0.0
        slope = 0.0  # of the secant
        for row in range(law_parameters.shape[0] - 1, at.FIRST_PARAMETER - 1, -1):
            slope = slope * drift + secant
            secant = secant * drift + law_parameters[row, i]
        springs[trial + at.FORCE, i] = secant * drift
        return slope * drift + secant

    @inlined
    def recoverable(law_parameters, springs, i):
        d = springs[at.DRIFT, i]
        energy = 0.0
        for row in range(law_parameters.shape[0] - 1, at.FIRST_PARAMETER - 1, -1):
            energy = energy * d + law_parameters[row, i] / (row - at.FIRST_PARAMETER + 2)
        return energy * d * d

    @inlined
    def points(law_parameters, springs, i, way):
        """Exact: of degree q in the drift, the force times s is of degree 2 q + 1 in time."""
        degree = law_parameters.shape[0] - at.FIRST_PARAMETER
        while degree > 1 and law_parameters[at.FIRST_PARAMETER + degree - 1, i] == 0.0:
            degree -= 1
        return degree + 1.0

    return LawFunctions(force=force, recoverable=recoverable, points=points)


LAW = DriftLaw(
    "polynomial",
    "f = c1 d + c2 d^2 + ...",
    _functions,
    parameters=(LawParameter("coefficients", many=True),),
    curved=True,
    stiffens=lambda values: any(
        c > 0.0 or (j % 2 == 1 and c < 0.0) for j, c in enumerate(values[1:], start=1)
    ),
    initial_stiffness=lambda values: values[0],
)
