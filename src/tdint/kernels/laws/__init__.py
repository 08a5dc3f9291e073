"""The drift laws: one file each, and one line here.

A law's place in the list is its number in the compiled tables. The last one is taken for any other
number. Those of plug-ins are put behind ours (`tdint.model.definition.register_law`).
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
LINEAR = LAWS.index(linear.LAW)
