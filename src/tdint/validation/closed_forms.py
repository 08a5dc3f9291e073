"""Motions that are known exactly."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from scipy.special import ellipj, ellipk

from tdint.analysis.run.outcome import Response
from tdint.analysis.run.run import run
from tdint.analysis.spectra.elastic import spectrum
from tdint.analysis.static.cyclic import cyclic_test
from tdint.ground_motion.reading.read import make_record
from tdint.model.config.model_file import load_model
from tdint.validation.case import Array, ValidationCase, cases_of

_OMEGA = 2.0 * math.pi
_XI = 0.05


def _oscillator(method: str, dt: float, duration: float, **said: Any) -> Response:
    """Motion of an oscillator of 1 kg, of period 1 s unless it has another law."""
    story = {"mass": 1.0} | (said.pop("story", None) or {"stiffness": _OMEGA**2})
    model = {"stories": [story], "analysis": {"method": method, "dt": dt, "duration": duration}} | said
    return run(load_model(model), history=True)


def _last(response: Response) -> float:
    assert response.history is not None
    return float(response.history.displacement[-1, 0])


def _free_vibration() -> Array:
    """Displacement at 1.3 s of a damped oscillator let go at 1 m."""
    start = {"displacement": [1.0], "velocity": [0.0]}
    damped = {"damping": {"modal": _XI}, "initial": start}
    return np.array([_last(_oscillator("exact", 0.1, 1.3, **damped))])


def _freely(t: float) -> float:
    damped = _OMEGA * math.sqrt(1.0 - _XI**2)
    sine = _XI / math.sqrt(1.0 - _XI**2) * math.sin(damped * t)
    return math.exp(-_XI * _OMEGA * t) * (math.cos(damped * t) + sine)


def _resonance() -> Array:
    """Displacement at 4.9 s under a force of 1 N at the natural frequency, from rest, without damping."""
    force = {"excitation": {"forces": [{"floor": 1, "amplitude": 1.0, "omega": _OMEGA, "phase": "sin"}]}}
    return np.array([_last(_oscillator(method, 0.01, 4.9, **force)) for method in ("moment4", "impulse4")])


def _in_resonance(t: float) -> float:
    return (math.sin(_OMEGA * t) - _OMEGA * t * math.cos(_OMEGA * t)) / (2.0 * _OMEGA**2)


def _sudden_step() -> Array:
    """Largest displacement of oscillators under a suddenly constant ground acceleration of 1 m/s^2."""
    record = make_record(np.ones(1001), dt=0.01, units="m/s^2")
    return np.asarray(spectrum(record, np.array([0.3, 1.0, 3.0]), damping=0.0).sd).ravel()


_DUFFING = {"type": "polynomial", "coefficients": [100.0, 0.0, 1000.0]}  # u'' + 100 u + 1000 u^3 = 0 from 1.5 m


def _duffing_frequency() -> tuple[float, float]:
    """Circular frequency of the elliptic cosine, and its parameter m."""
    square = 100.0 + 1000.0 * 1.5**2
    return math.sqrt(square), 1000.0 * 1.5**2 / (2.0 * square)


def _duffing() -> Array:
    """Displacement after 13.3 periods in steps of a 300th of one."""
    omega, m = _duffing_frequency()
    period = 4.0 * float(ellipk(m)) / omega
    start = {"story": {"law": _DUFFING}, "initial": {"displacement": [1.5], "velocity": [0.0]}}
    return np.array(
        [_last(_oscillator(method, period / 300.0, 13.3 * period, **start)) for method in ("moment4", "impulse4")]
    )


def _elliptic_cosine() -> float:
    _, m = _duffing_frequency()
    return 1.5 * float(ellipj(13.3 * 4.0 * float(ellipk(m)), m)[1])


def _energy_kept() -> Array:
    """Largest change of the Duffing oscillator's energy over the energy at the start, 200 steps of `moment4`."""
    start = {"story": {"law": _DUFFING}, "initial": {"displacement": [1.5], "velocity": [0.0]}}
    history = _oscillator("moment4", 0.05, 10.0, **start).history
    assert history is not None
    u, v = history.displacement[:, 0], history.velocity[:, 0]
    energy = 0.5 * v**2 + 50.0 * u**2 + 250.0 * u**4
    return np.array([np.max(np.abs(energy / energy[0] - 1.0))])


def _bilinear_loop() -> Array:
    """Work of a bilinear story over a whole cycle, J: 4 (1 - a) Fy (D - dy)."""
    law = {"type": "bilinear", "yield_force": 10.0, "hardening": 0.05}
    model = load_model({"stories": [{"mass": 1.0, "height": 3.0, "stiffness": 1000.0, "law": law}]})
    return np.array([cyclic_test(model, 1, ["1%", "1%"], points=100).cycles[1].dissipated])


def closed_form_cases() -> tuple[ValidationCase, ...]:
    """Motions that are known exactly."""
    steps = tuple(2.0 * (period / (2.0 * math.pi)) ** 2 for period in (0.3, 1.0, 3.0))
    known = {
        "free-vibration": (_freely(1.3),),
        "resonance": (_in_resonance(4.9),) * 2,
        "sudden-step": steps,
        "duffing": (_elliptic_cosine(),) * 2,
        "energy-kept": (0.0,),
        "bilinear-loop": (4.0 * 0.95 * 10.0 * (0.03 - 0.01),),
    }
    return cases_of("closed-form", _COMPUTED, known)


_COMPUTED = {
    "free-vibration": _free_vibration,
    "resonance": _resonance,
    "sudden-step": _sudden_step,
    "duffing": _duffing,
    "energy-kept": _energy_kept,
    "bilinear-loop": _bilinear_loop,
}
