"""Linear elastic law, f = k d."""

from __future__ import annotations

from tdint.kernels import layout as rows
from tdint.kernels.laws.law import DriftLaw, LawFunctions


def _functions() -> LawFunctions:
    """Return the compiled functions of the law f = k d, with the stiffness k and the drift d."""
    from tdint.kernels.compiling import inline
    from tdint.kernels.laws.branch_following import no_operation

    @inline
    def force(law_parameters, law_state, i, previous, trial, drift):
        """Compute the force k d at the drift d; return the tangent stiffness k, N/m."""
        law_state[trial + rows.FORCE, i] = law_parameters[rows.STIFFNESS, i] * drift
        return law_parameters[rows.STIFFNESS, i]

    @inline
    def strain_energy(law_parameters, law_state, i):
        """Return the elastic energy k d^2 / 2 of the committed state, J."""
        drift = law_state[rows.DRIFT, i]
        return 0.5 * law_parameters[rows.STIFFNESS, i] * drift * drift

    return LawFunctions(force=force, strain_energy=strain_energy, advance=no_operation)


LAW = DriftLaw(
    "linear",
    "f = k d",
    _functions,
    concave=True,
    equal_directions=lambda values: True,
    last_line=lambda stiffness, values, side: (0.0, stiffness),
)
