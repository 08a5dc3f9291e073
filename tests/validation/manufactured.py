"""Manufactured solutions: the motion of an oscillator is prescribed, and the force follows from the
equation of motion.

The motion is u = A sin(w t). Along this motion, the force of a smooth law is a Fourier series of
odd sines, which is finite (polynomials) or decreases exponentially (tanh). The floor force is
therefore a sum of harmonics, which is exact to rounding. A Bouc-Wen law has a memory with kinks at
changes of sign of the rate, so that its series is not finite. Its motions are compared with DOP853
of SciPy elsewhere (tests/kernels).
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

import tdint
from tdint.errors import TdintError
from tdint.methods.catalogue import catalogue, parse

Array = NDArray[np.float64]

AMPLITUDE = 0.1  # m
OMEGA = 5.0  # rad/s
DAMPER = 0.8  # N s/m
DURATION = 4.0  # s
STEPS = (100, 200, 400, 800)
_TERMS = 40
_ROUNDING = 1e-13  # of the largest coefficient

LAWS: Mapping[str, tuple[Mapping[str, Any], Callable[[Array], Array]]] = {
    "polynomial": (
        {"type": "polynomial", "coefficients": [40.0, 0.0, 900.0]},
        lambda u: 40.0 * u + 900.0 * u**3,
    ),
    "tanh": ({"type": "tanh", "strength": 3.0}, lambda u: 3.0 * np.tanh(40.0 * u / 3.0)),
}


@dataclass(frozen=True)
class Observed:
    """Largest errors of the displacement over A, step by step, and the order that they show (nan:
    rounding)."""

    method: str
    law: str
    declared: float
    errors: tuple[float, ...]
    order: float


def model(law: str) -> dict[str, Any]:
    """Return the oscillator of 1 kg, its dashpot, and the harmonics of its force."""
    declaration, force = LAWS[law]
    story: dict[str, Any] = {"mass": 1.0, "law": dict(declaration), "dashpot": DAMPER}
    if law == "tanh":
        story["stiffness"] = 40.0
    phase = 2.0 * np.pi * (np.arange(4 * _TERMS) + 0.5) / (4 * _TERMS)
    along = force(AMPLITUDE * np.sin(phase))
    sines = {k: float(2.0 * np.mean(along * np.sin(k * phase))) for k in range(1, _TERMS, 2)}
    sines[1] -= AMPLITUDE * OMEGA**2
    largest = max(map(abs, sines.values()))
    forces = [
        {"floor": 1, "amplitude": value, "omega": k * OMEGA, "phase": "sin"}
        for k, value in sines.items()
        if abs(value) > _ROUNDING * largest
    ]
    forces.append(
        {"floor": 1, "amplitude": DAMPER * AMPLITUDE * OMEGA, "omega": OMEGA, "phase": "cos"}
    )
    return {
        "stories": [story],
        "excitation": {"forces": forces},
        "initial": {"displacement": [0.0], "velocity": [AMPLITUDE * OMEGA]},
        "analysis": {"duration": DURATION},
    }


def observe(method: str, law: str) -> Observed | None:
    """Return the errors of a method for a law, or None if the method does not support it."""
    integrator = parse(method)
    if integrator.family.linear_only:
        return None
    building = tdint.load_model(model(law))
    errors = []
    for steps in STEPS:
        try:
            history = tdint.run(building, method=method, dt=DURATION / steps, history=True).history
        except TdintError:
            errors.append(float("nan"))
            continue
        assert history is not None
        exact = AMPLITUDE * np.sin(OMEGA * history.time)
        errors.append(float(np.max(np.abs(history.displacement[:, 0] - exact))) / AMPLITUDE)
    known = [(steps, error) for steps, error in zip(STEPS, errors, strict=True) if error > 1e-11][
        -2:
    ]
    order = float("nan")
    if len(known) == 2:
        order = float(np.log(known[0][1] / known[1][1]) / np.log(known[1][0] / known[0][0]))
    return Observed(method, law, integrator.order, tuple(errors), order)


def observe_all() -> list[Observed]:
    """Return the observations of all methods for all smooth laws."""
    found = (observe(name, law) for law in LAWS for name in catalogue())
    return [observed for observed in found if observed is not None]
