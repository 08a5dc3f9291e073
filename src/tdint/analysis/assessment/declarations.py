"""What methods and laws declare of themselves beside what is measured of them: for authors of new ones."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from tdint.analysis.assessment.order import observed_order, order_problem
from tdint.analysis.assessment.stability import critical_step, false_limit, stability
from tdint.analysis.static.cyclic import CyclicTest, cyclic_test
from tdint.methods.method import Integrator
from tdint.model.definition import Model

_ORDER = 0.1
_RADIUS = 1e-3
_FAST = 1e6
"""omega dt that stands for infinity; rounding grows with it."""
_ENERGY = 1e-3
_TANGENT = 1e-2


@dataclass(frozen=True)
class MethodCheck:
    """What a method declares, and what its compiled steps show.

    Attributes
    ----------
    integrator : Integrator
        The method with its parameters.
    order : float
        The smaller of the observed orders of displacement and velocity, of a linear oscillator in free vibration and
        under a harmonic force; nan where errors are nothing but rounding.
    limit : float
        Measured largest stable omega dt without damping, inf if there is none up to 100.
    rho_inf : float
        Measured spectral radius at omega dt = 1e6; nan where steps have a limit.
    faults : tuple of str
        What is declared and not so, a line each.
    """

    integrator: Integrator
    order: float
    limit: float
    rho_inf: float
    faults: tuple[str, ...]


def check_method(integrator: Integrator) -> MethodCheck:
    """Measure what a method declares.

    Parameters
    ----------
    integrator : Integrator
        The method; its step is compiled.
    """
    observed = [observed_order(integrator, order_problem(load)) for load in ("free", "harmonic")]
    orders = [one.order(quantity) for one in observed for quantity in ("displacement", "velocity")]
    order = min((one for one in orders if not math.isnan(one)), default=math.nan)
    limit = critical_step(integrator)
    with np.errstate(all="ignore"):
        fast = stability(integrator, np.array([_FAST / (2.0 * math.pi)])).spectral_radius
    radius = float(fast[0]) if limit == math.inf else math.nan
    label, faults = integrator.label, []
    if abs(order - integrator.order) > _ORDER:
        faults.append(f"{label}: declares order {integrator.order}, observed is {order:.2f}")
    if told := false_limit(integrator, limit):
        faults.append(told)
    declared = integrator.rho_inf
    if not (math.isnan(declared) and math.isnan(radius)) and not abs(declared - radius) <= _RADIUS:
        found = "none, for steps have a limit" if math.isnan(radius) else f"{radius:.4g}"
        faults.append(f"{label}: declares the spectral radius {declared:.4g} at infinity, measured is {found}")
    return MethodCheck(integrator, order, limit, radius, tuple(faults))


def check_law(model: Model, story: int) -> list[str]:
    """What is wrong with the law of a story as a cyclic test shows it: tangents that are no slopes of the force, energy
    that is not accounted for.

    Parameters
    ----------
    model : Model
        A building.
    story : int
        Counted from 1. It goes through cycles to 0.5, 1 and 2 % of its height; without one, 5, 10 and 20 mm.
    """
    high = model.stories[story - 1].height is not None
    test = cyclic_test(model, story, ["0.5%", "1%", "2%"] if high else ["5mm", "10mm", "20mm"], points=2000)
    path, name = test.path, model.stories[story - 1].law.name
    step, mean = np.diff(path.drift), 0.5 * (path.shear[1:] + path.shear[:-1])
    done = np.append(0.0, np.cumsum(mean * step))
    kept = path.recoverable + path.dissipated
    off = np.max(np.abs(done - (kept - kept[0]))) / np.max(np.abs(done))
    faults = []
    if not off <= _ENERGY:
        faults.append(f"law {name}: stored and dissipated energy differ from the work done by {off:.2g} of the most")
    if (wrong := _wrong_tangents(test)) > 0:
        faults.append(f"law {name}: the tangent is not the slope of the force at {wrong} of {step.size} points")
    if np.any(np.diff(path.dissipated) < -_ENERGY * np.max(np.abs(done))):
        faults.append(f"law {name}: dissipated energy comes back")
    return faults


def _wrong_tangents(test: CyclicTest) -> int:
    """Points at which the tangent is neither the slope before nor that behind, nor between them.

    Where a path turns or a branch ends the slopes on both sides differ, and any between them will do.
    """
    path = test.path
    slopes = np.diff(path.shear) / np.diff(path.drift)
    low, high = np.minimum(slopes[1:], slopes[:-1]), np.maximum(slopes[1:], slopes[:-1])
    room = _TANGENT * np.max(np.abs(slopes))
    tangent = path.tangent[1:-1]
    return int(np.count_nonzero((tangent < low - room) | (tangent > high + room)))
