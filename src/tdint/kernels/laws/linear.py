"""The linear law."""

from __future__ import annotations

from tdint.kernels.laws.law import DriftLaw, LawFunctions
from tdint.kernels.layout import DRIFT, FORCE, STIFFNESS


def _functions() -> LawFunctions:
    from tdint.kernels.compiling import inlined

    @inlined
    def force(laws, springs, i, past, trial, drift):
        springs[trial + FORCE, i] = laws[STIFFNESS, i] * drift
        return laws[STIFFNESS, i]

    @inlined
    def recoverable(laws, springs, i):
        return 0.5 * laws[STIFFNESS, i] * springs[DRIFT, i] * springs[DRIFT, i]

    return LawFunctions(force=force, recoverable=recoverable)


LAW = DriftLaw("linear", "f = k d", _functions)
