"""The linear law."""

from __future__ import annotations

from tdint.kernels import layout as at
from tdint.kernels.laws.law import DriftLaw, LawFunctions


def _functions() -> LawFunctions:
    from tdint.kernels.compiling import inlined
    from tdint.kernels.laws.walking import nothing

    @inlined
    def force(law_parameters, springs, i, past, trial, drift):
        springs[trial + at.FORCE, i] = law_parameters[at.STIFFNESS, i] * drift
        return law_parameters[at.STIFFNESS, i]

    @inlined
    def recoverable(law_parameters, springs, i):
        return 0.5 * law_parameters[at.STIFFNESS, i] * springs[at.DRIFT, i] * springs[at.DRIFT, i]

    return LawFunctions(force=force, recoverable=recoverable, advance=nothing)


LAW = DriftLaw("linear", "f = k d", _functions)
