"""The linear law."""

from __future__ import annotations

from tdint.kernels import layout as at
from tdint.kernels.laws.law import DriftLaw, LawFunctions


def _functions() -> LawFunctions:
    from tdint.kernels.compiling import inlined

    @inlined
    def force(laws, springs, i, past, trial, drift):
        springs[trial + at.FORCE, i] = laws[at.STIFFNESS, i] * drift
        return laws[at.STIFFNESS, i]

    @inlined
    def recoverable(laws, springs, i):
        return 0.5 * laws[at.STIFFNESS, i] * springs[at.DRIFT, i] * springs[at.DRIFT, i]

    return LawFunctions(force=force, recoverable=recoverable)


LAW = DriftLaw("linear", "f = k d", _functions)
