"""Drift laws (hysteresis models), one file for each law.

The index of a law in `LAWS` is its number in the compiled tables. The compiled selection of a law
uses the last law for any other number. Laws of plug-ins are appended
(`tdint.model.definition.register_law`).
"""

from __future__ import annotations

from tdint.kernels.laws import (
    bilinear,
    bouc_wen,
    gap,
    imk,
    linear,
    multilinear_pinching,
    peak_oriented,
    polynomial,
    tanh,
    trilinear_pinching,
)

LAWS = [
    linear.LAW,
    bilinear.LAW,
    peak_oriented.LAW,
    bouc_wen.LAW,
    gap.LAW,
    tanh.LAW,
    polynomial.LAW,
    trilinear_pinching.LAW,
    imk.LAW,
    multilinear_pinching.LAW,
]

OURS = len(LAWS)
"""Number of laws that are part of tdint."""
LINEAR = LAWS.index(linear.LAW)
"""Number of the linear law."""
