"""A building's first mode, and what a ground motion does to an oscillator of its period."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from tdint.analysis.spectra.elastic import spectrum
from tdint.errors import AnalysisError
from tdint.ground_motion.record import Record
from tdint.model.building import Building

SA_DAMPING = 0.05
"""Damping ratio of Sa(T1) as an intensity measure."""


@dataclass(frozen=True)
class FirstMode:
    """The first mode of a building's initial stiffness.

    Attributes
    ----------
    period, damping : float
        T1, s, and its viscous damping ratio (of the diagonal of the modal damping matrix, without power-law dashpots).
    sa : float or None
        Pseudo-acceleration of the ground motion at T1, m/s^2; None without a motion, or for a period that is too short
        for it.
    sa_damping : float
        The damping ratio of `sa`.
    """

    period: float
    damping: float
    sa: float | None
    sa_damping: float = SA_DAMPING


def first_mode(building: Building, record: Record | None) -> FirstMode:
    """The first mode, and Sa(T1) of a record."""
    omega, damping = building.first_mode()
    period = 2.0 * math.pi / omega
    return FirstMode(period, damping, None if record is None else _sa(record, period))


def _sa(record: Record, period: float) -> float | None:
    try:
        return float(spectrum(record, np.array([period]), SA_DAMPING).psa[0])
    except AnalysisError:
        return None
