"""Linear elastic law, f = k d."""

from __future__ import annotations

from tdint.kernels import layout as rows
from tdint.kernels.laws.law import DriftLaw, LawFunctions


def _functions() -> LawFunctions:
    """Return the compiled functions of the law."""
    from tdint.kernels.compiling import inline
    from tdint.kernels.laws.branch_following import no_operation

    @inline
    def force(law_parameters, law_state, i, previous, trial, drift):
        """Return the constant tangent stiffness k, N/m, and write the force k d to block `trial`.

        Parameters
        ----------
        law_parameters, law_state : ndarray
            Parameters and states of the laws.
        i : int
            Index of the story.
        previous : int
            First row of the state at the start of the path.
        trial : int
            First row of the state at the end of the path.
        drift : float
            Drift, m.
        """
        law_state[trial + rows.FORCE, i] = law_parameters[rows.STIFFNESS, i] * drift
        return law_parameters[rows.STIFFNESS, i]

    @inline
    def strain_energy(law_parameters, law_state, i):
        """Return k d^2 / 2, J."""
        return (
            0.5
            * law_parameters[rows.STIFFNESS, i]
            * law_state[rows.DRIFT, i]
            * law_state[rows.DRIFT, i]
        )

    return LawFunctions(force=force, strain_energy=strain_energy, advance=no_operation)


LAW = DriftLaw("linear", "f = k d", _functions)
