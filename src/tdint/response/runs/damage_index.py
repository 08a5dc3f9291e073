"""Damage indices of stories (Park and Ang 1985; Kunnath et al. 1992)."""

from __future__ import annotations

import numpy as np

from tdint.arrays import Array, Numbers
from tdint.errors import UsageError

ENERGY_WEIGHT = 0.05
"""Usual weight of the hysteretic energy for reinforced concrete."""


def park_ang(
    drift: Numbers,
    energy: Numbers,
    *,
    ultimate_drift: Numbers,
    yield_drift: Numbers,
    yield_force: Numbers,
    energy_weight: float = ENERGY_WEIGHT,
    kunnath: bool = False,
) -> Array:
    """Return the damage index d_m / d_u + b E / (F_y d_u) of stories.

    Parameters
    ----------
    drift, energy : array, shape (n,)
        Peak drift d_m, m, and hysteretic energy E without the stored elastic energy, J.
    ultimate_drift, yield_drift : array, shape (n,)
        Drift d_u at failure under monotonic load and drift d_y at yield, m.
    yield_force : array, shape (n,)
        Restoring force F_y at yield, N.
    energy_weight : float
        Weight b; default 0.05.
    kunnath : bool
        True for the first term (d_m - d_y) / (d_u - d_y) of Kunnath et al. (1992), which is 0 up to
        yield; default False.

    Raises
    ------
    UsageError
        An ultimate drift does not exceed the drift at yield.
    """
    peak, spent, ultimate, yielding, force = (
        np.asarray(values, float)
        for values in (drift, energy, ultimate_drift, yield_drift, yield_force)
    )
    if np.any(ultimate <= yielding) or not np.all(np.isfinite(ultimate)):
        raise UsageError(
            f"ultimate_drift must exceed the drift at yield, got {ultimate} and {yielding} m"
        )
    first = peak / ultimate
    if kunnath:
        first = np.maximum(peak - yielding, 0.0) / (ultimate - yielding)
    return np.asarray(first + energy_weight * spent / (force * ultimate))
