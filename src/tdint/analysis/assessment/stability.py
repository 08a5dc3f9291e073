"""Spectral radius, period error and numerical damping of a method, measured on its compiled step."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import NDArray

from tdint.analysis.run.amplification import STABLE, amplification
from tdint.arrays import Array
from tdint.methods.catalogue import parse
from tdint.methods.method import Integrator
from tdint.tabular import Tabular
from tdint.written_numbers import how_many

_SMALLEST = 1e-3  # dt/T at which the principal root is beyond doubt
_REAL = 1e-9  # imaginary part of a root that is real but for rounding
_LEAD = 60  # points between there and the first one that was asked for
LARGEST = 1e4
"""omega dt up to which a critical step is searched."""

_AGREEMENT = 1e-3  # of a declared and a measured limit
_ROUNDING = 1e-15  # over (omega dt)^2: how far rounding alone lifts a spectral radius above 1


@dataclass(frozen=True, repr=False)
class StabilityCurve(Tabular):
    """What one step does to an undriven oscillator; arrays of shape (k,).

    Period error, numerical damping and amplitude decay are nan where the principal roots are real, and for steps longer
    than half the damped period, which tell no period.

    Attributes
    ----------
    damping : float
        Damping ratio xi of the oscillator.
    dt_over_t : ndarray
        Step over undamped period.
    spectral_radius : ndarray
        Largest modulus of the eigenvalues of the amplification matrix.
    period_error : ndarray
        Numerical over exact damped period, minus 1.
    numerical_damping : ndarray
        Damping ratio of the numerical oscillation minus xi: from the principal root exp(-d + i f), d / sqrt(d^2 + f^2)
        (Hughes 1987, sect. 9.1).
    amplitude_decay : ndarray
        Part of the amplitude lost in one cycle by the method, 1 - exp(-2 pi xi') with xi' the numerical damping.
    """

    method: str
    damping: float
    dt_over_t: Array
    spectral_radius: Array
    period_error: Array
    numerical_damping: Array
    amplitude_decay: Array

    def _headline(self) -> str:
        return f"of {self.method}, damping {self.damping:g}, {how_many(self.dt_over_t.size, 'step')}"


def stability(integrator: Integrator | str, dt_over_t: Array, damping: float = 0.0) -> StabilityCurve:
    """Measure a method (or the one of this name) at rising dt/T, shape (k,), for a damping ratio in [0, 1)."""
    integrator = parse(integrator) if isinstance(integrator, str) else integrator
    dt_over_t = np.asarray(dt_over_t, dtype=np.float64)
    lead = np.geomspace(_SMALLEST, dt_over_t[0], _LEAD)[:-1] if dt_over_t[0] > _SMALLEST else np.empty(0)
    ratios = np.concatenate([lead, dt_over_t])
    roots = _roots(integrator, 2.0 * math.pi * ratios, damping)
    principal = _follow(roots, 2.0 * math.pi * ratios, damping)[lead.size :]
    exact_phase = 2.0 * math.pi * dt_over_t * math.sqrt(1.0 - damping**2)
    tells = (np.abs(principal.imag) > _REAL) & (exact_phase <= math.pi)
    with np.errstate(divide="ignore", invalid="ignore"):
        decay, phase = -np.log(np.abs(principal)), np.angle(principal)
        period_error = np.where(tells, exact_phase / phase - 1.0, math.nan)
        numerical = np.where(tells, decay / np.hypot(decay, phase) - damping, math.nan)
    return StabilityCurve(
        method=integrator.label,
        damping=damping,
        dt_over_t=dt_over_t,
        spectral_radius=np.max(np.abs(roots[lead.size :]), axis=1),
        period_error=period_error,
        numerical_damping=numerical,
        amplitude_decay=1.0 - np.exp(-2.0 * math.pi * numerical),
    )


def _roots(integrator: Integrator, omega_h: Array, damping: float) -> NDArray[np.complex128]:
    """Eigenvalues of the amplification matrices at steps omega h, shape (k, m); the step is 1 s."""
    matrices = amplification(integrator, omega_h, np.full_like(omega_h, damping), 1.0)
    return np.asarray(np.linalg.eigvals(matrices), dtype=np.complex128)


def _follow(roots: NDArray[np.complex128], omega_h: Array, damping: float) -> NDArray[np.complex128]:
    """The root that stands for the oscillation, followed from small steps on; positive imaginary part while complex."""
    followed = np.empty(len(roots), dtype=np.complex128)
    guess = np.exp(complex(-damping, math.sqrt(1.0 - damping**2)) * omega_h[0])
    for index, candidates in enumerate(roots):
        upper = np.where(candidates.imag < 0.0, candidates.conj(), candidates)
        followed[index] = guess = upper[np.argmin(np.abs(upper - guess))]
    return followed


@cache
def critical_step(integrator: Integrator, damping: float = 0.0, largest: float = LARGEST) -> float:
    """Smallest omega dt from which on the spectral radius exceeds 1, bisected to rounding; inf if there is none.

    Searched at 4000 points up to `largest`, and just above the limit that the method declares: an unstable band
    elsewhere that is narrower than half a percent of omega dt can be missed.
    """
    grid = np.geomspace(1e-3, largest, 4000)
    declared = integrator.stability_limit
    if 0.0 < declared < largest:
        grid = np.sort(np.concatenate([grid, declared * (1.0 + np.geomspace(1e-6, 1e-2, 40))]))
    unstable = np.flatnonzero(_grows(integrator, grid, damping))
    if not unstable.size:
        return math.inf
    high = grid[unstable[0]]
    low = grid[unstable[0] - 1] if unstable[0] else 0.0
    for _ in range(50):
        middle = 0.5 * (low + high)
        if _grows(integrator, np.array([middle]), damping)[0]:
            high = middle
        else:
            low = middle
    return float(low)


def false_limit(integrator: Integrator, measured: float) -> str:
    """What there is to say of a declared stability limit that is not the measured one (`critical_step` without
    damping); nothing where they agree or none is declared (nan)."""
    declared = integrator.stability_limit
    unlimited = declared > LARGEST and measured == math.inf
    if math.isnan(declared) or unlimited or math.isclose(declared, measured, rel_tol=_AGREEMENT):
        return ""
    found = f"{measured:.6g}" if math.isfinite(measured) else f"none up to {LARGEST:g}"
    return (
        f"{integrator.label}: the catalogue declares it stable up to omega dt {declared:.6g}, measured is {found}; "
        "`tdint run` goes by what is declared"
    )


def _grows(integrator: Integrator, omega_h: Array, damping: float) -> NDArray[np.bool_]:
    """Whether the spectral radius exceeds 1 by more than rounding."""
    radius = np.max(np.abs(_roots(integrator, omega_h, damping)), axis=1)
    return np.asarray(radius > 1.0 + np.maximum(STABLE, _ROUNDING * omega_h**2))
