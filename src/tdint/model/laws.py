"""The drift laws that a model file may name: one entry each. Their compiled forms stand in `tdint.kernels.springs`.

d is the story's drift, k its initial stiffness, f the restoring force.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass


@dataclass(frozen=True)
class LawParameter:
    """A parameter of a law.

    `force` and `length` are the exponents of its dimension (a stiffness is force^1 length^-1); a parameter with
    `many` is a list whose j-th entry (from 1) has the dimension force^1 length^-j.
    """

    name: str
    force: int = 0
    length: int = 0
    low: float = -math.inf
    high: float = math.inf
    low_allowed: bool = True
    high_allowed: bool = True
    many: bool = False


@dataclass(frozen=True)
class DriftLaw:
    """A drift law: what a model file may say about it and what follows from that.

    Attributes
    ----------
    code : int
        The law's number in the compiled kernels.
    parameters : tuple of LawParameter
        In the order in which `Story.law` holds their values (a `many` parameter comes last).
    piecewise_linear : bool
        Whether the force is linear branch by branch.
    kinked : bool
        Whether the tangent jumps somewhere; where it does can be located in a step.
    stiffens : callable
        Parameter values -> whether a story can become stiffer than at rest.
    initial_stiffness : callable, optional
        The law's own initial stiffness from the parameter values; None where the story gives it.
    yield_drift : callable
        (initial stiffness, parameter values) -> drift at first yield, m; nan for a law that does not yield.
    """

    name: str
    code: int
    parameters: tuple[LawParameter, ...]
    formula: str
    piecewise_linear: bool = False
    kinked: bool = False
    stiffens: Callable[[Sequence[float]], bool] = lambda values: False
    initial_stiffness: Callable[[Sequence[float]], float] | None = None
    yield_drift: Callable[[float, Sequence[float]], float] = lambda stiffness, values: math.nan


LAWS = {
    law.name: law
    for law in (
        DriftLaw("linear", 0, (), "f = k d", piecewise_linear=True),
        DriftLaw(
            "polynomial",
            1,
            (LawParameter("coefficients", many=True),),
            "f = c1 d + c2 d^2 + ...",
            stiffens=lambda values: any(c > 0.0 or (j % 2 == 1 and c < 0.0) for j, c in enumerate(values[1:], start=1)),
            initial_stiffness=lambda values: values[0],
        ),
        DriftLaw(
            "bilinear",
            2,
            (
                LawParameter("yield_force", force=1, low=0.0, low_allowed=False),
                LawParameter("hardening", low=0.0, high=1.0, high_allowed=False),
            ),
            "f = a k d + z, |z| <= (1 - a) Fy: yield force Fy, kinematic hardening a",
            piecewise_linear=True,
            kinked=True,
            yield_drift=lambda stiffness, values: values[0] / stiffness,
        ),
        DriftLaw(
            "peak-oriented",
            3,
            (
                LawParameter("yield_force", force=1, low=0.0, low_allowed=False),
                LawParameter("hardening", low=0.0, high=1.0, high_allowed=False),
                LawParameter("unloading", low=0.0, high=1.0, high_allowed=False),
            ),
            "bilinear backbone; unloads with k (dy / dmax)^unloading, reloads towards the farthest point (Clough)",
            piecewise_linear=True,
            kinked=True,
            yield_drift=lambda stiffness, values: values[0] / stiffness,
        ),
        DriftLaw(
            "tanh",
            4,
            (LawParameter("strength", force=1, low=0.0, low_allowed=False),),
            "f = F tanh(k d / F): elastic, strength F",
        ),
        DriftLaw(
            "bouc-wen",
            5,
            (
                LawParameter("yield_force", force=1, low=0.0, low_allowed=False),
                LawParameter("hardening", low=0.0, high=1.0, high_allowed=False),
                LawParameter("exponent", low=1.0, high=100.0),
                LawParameter("beta", low=0.5, high=1.0),
            ),
            "f = a k d + (1 - a) Fy w, dw = (1 - |w|^n (beta sgn(w dd) + 1 - beta)) k dd / Fy: smooth hysteresis",
            kinked=True,
            yield_drift=lambda stiffness, values: values[0] / stiffness,
        ),
        DriftLaw(
            "gap",
            6,
            (
                LawParameter("gap", length=1, low=0.0, low_allowed=False),
                LawParameter("stop_stiffness", force=1, length=-1, low=0.0),
            ),
            "f = k d, beyond the gap stop_stiffness (|d| - gap) more: elastic pounding against a stop on either side",
            piecewise_linear=True,
            kinked=True,
            stiffens=lambda values: values[1] > 0.0,
        ),
    )
}
