"""Hysteresis models of stories (drift laws), one file for each law.

The number of a law is its index in the list `LAWS`. Row CODE of the table `law_parameters` contains
the number of the law of each story. Compiled code selects the law by this number
(`tdint.kernels.laws.selection`). The laws of plug-ins are appended to the list
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

# The order must not change, because the numbers of the laws depend on it.
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
"""Number of built-in laws. Laws with this number or a larger one belong to plug-ins."""
LINEAR = LAWS.index(linear.LAW)
"""Number of the linear law in row CODE of `law_parameters`."""
