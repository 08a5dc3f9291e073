"""The drift laws that a model file may name: those of `tdint.kernels.laws`."""

from __future__ import annotations

from tdint.kernels.laws import LAWS as _LAWS
from tdint.kernels.laws.law import DriftLaw

__all__ = ["CODES", "LAWS", "DriftLaw"]

LAWS: dict[str, DriftLaw] = {law.name: law for law in _LAWS}
CODES: dict[str, int] = {law.name: code for code, law in enumerate(_LAWS)}
"""The number of each law in the compiled tables."""
