"""Tables of textbooks, and results that other programs print, for models that can be written down in full."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from functools import partial
from typing import Any

import numpy as np

from tdint.analysis.run.overview import modes
from tdint.analysis.run.run import run
from tdint.campaign.fragility.fits import fit_stripes
from tdint.ground_motion.reading.read import make_record
from tdint.model.config.model_file import load_model
from tdint.tabular import Several
from tdint.validation.case import Array, ValidationCase, ValidationResult, carry_out, cases_of
from tdint.validation.closed_forms import closed_form_cases

INCH = 0.0254


def _chopra_5(method: str, law: Mapping[str, Any] | None = None, steps: int = 10) -> Array:
    """Displacements (in) of the oscillator of Chopra's examples 5.1 to 5.5 after each of so many steps of 0.1 s."""
    model = load_model(
        {
            "units": {"length": "in", "force": "kip", "mass": "kip*s^2/in"},
            "stories": [{"mass": 0.2533, "stiffness": 10.0} | ({"law": dict(law)} if law else {})],
            "damping": {"modal": 0.05},
        }
    )
    force = [10.0 * math.sin(math.pi * i / 6.0) if i < 6 else 0.0 for i in range(11)]
    record = make_record([-p / 0.2533 for p in force], dt=0.1, units="in/s^2")
    history = run(model, record, method=method, history=True).history
    assert history is not None
    return np.asarray(history.displacement[1 : steps + 1, 0] / INCH)


_PLASTIC = {"type": "bilinear", "yield_force": 7.5, "hardening": 0.0}


def _bathe(method: str) -> Array:
    """Both displacements at 3.36 s of Bathe's two masses between walls, 12 steps of 0.28 s."""
    model = load_model(
        {
            # The spring from the second mass to the wall is a story under a mass that stays where it is.
            "stories": [{"mass": 2, "stiffness": 4}, {"mass": 1, "stiffness": 2}, {"mass": 1e12, "stiffness": 2}],
            "excitation": {"forces": [{"floor": 2, "amplitude": 10, "omega": 0, "phase": "cos"}]},
            "analysis": {"dt": 0.28, "duration": 3.36},
        }
    )
    history = run(model, method=method, history=True).history
    assert history is not None
    return np.asarray(history.displacement[-1, :2])


def _five_yielding_stories() -> Array:
    """Roof displacement at 2 s, m (Chopra, example 16.4, as StructDyn computes it)."""
    law = {"type": "bilinear", "yield_force": 125, "hardening": 0.05 / 1.05}
    model = load_model(
        {
            "units": {"length": "m", "force": "kN", "mass": "t"},
            "stories": [{"repeat": 5, "mass": 25.91, "stiffness": 10000, "law": law}],
            "damping": {"modal": 0.05},
        }
    )
    samples = [1.93 * math.sin(2.0 * math.pi * i / 10) if i <= 10 else 0.0 for i in range(21)]
    record = make_record(samples, dt=0.1, units="m/s^2")
    history = run(model, record, method="newmark-average", history=True).history
    assert history is not None
    return np.asarray(history.displacement[-1:, 4])


def _circular_frequencies(*stories: dict[str, Any]) -> Array:
    return np.asarray(modes(load_model({"stories": list(stories)})).omega)


def _eigenvalues_of_three_masses() -> Array:
    stories = ({"mass": 11.1, "stiffness": 30}, {"mass": 22.2, "stiffness": 20}, {"mass": 33.3, "stiffness": 10})
    return _circular_frequencies(*stories) ** 2


def _frequencies_of_eight_masses() -> Array:
    """Frequencies (Hz) of eight masses between walls; that of the wall, which is a mass, is left out."""
    masses, wall = {"repeat": 8, "mass": 10, "stiffness": 1e5}, {"mass": 1e13, "stiffness": 1e5}
    return _circular_frequencies(masses, wall)[1:] / (2.0 * math.pi)


def _forced_by_a_sine() -> Array:
    """Natural frequency (Hz) and displacement (m) at 1 s of code_aster's SDLD106."""
    model = load_model(
        {
            "stories": [{"mass": 100, "stiffness": 100.0 * (0.2 * math.pi) ** 2}],
            "excitation": {"forces": [{"floor": 1, "amplitude": 1, "omega": 1, "phase": "sin"}]},
            "analysis": {"dt": 0.05, "duration": 1},
        }
    )
    history = run(model, method="impulse4", history=True).history
    assert history is not None
    return np.array([modes(model).omega[0] / (2.0 * math.pi), history.displacement[-1, 0]])


def _stripes() -> Array:
    found = fit_stripes([0.2, 0.3, 0.4, 0.6, 0.7, 0.8, 0.9, 1.0], [0, 0, 0, 4, 6, 13, 12, 16], [40] * 8)
    return np.array([found.theta, found.beta])


_COMPUTED: dict[str, Callable[[], Array]] = {
    "chopra-E5.1": partial(_chopra_5, "exact"),
    "chopra-E5.2": partial(_chopra_5, "central-difference"),
    "chopra-E5.3": partial(_chopra_5, "newmark-average"),
    "chopra-E5.4": partial(_chopra_5, "newmark-linear"),
    "chopra-E5.5": partial(_chopra_5, "newmark-average", _PLASTIC, 9),
    "chopra-E5.5 by Hyfeast": partial(_chopra_5, "newmark-average", _PLASTIC),
    "bathe-9.1": partial(_bathe, "central-difference"),
    "bathe-9.3": partial(_bathe, "newmark-average"),
    "bathe-9.3 (1976)": partial(_bathe, "wilson:theta=1.4"),
    "bathe-9.4": partial(_bathe, "bathe"),
    "bathe-9.7": partial(_bathe, "exact"),
    "structdyn-16.4": _five_yielding_stories,
    "opensees-eigen": _eigenvalues_of_three_masses,
    "chopra-10.4": partial(_circular_frequencies, {"mass": 2, "stiffness": 2}, {"mass": 1, "stiffness": 1}),
    "code-aster-sdld02": _frequencies_of_eight_masses,
    "code-aster-sdld106": _forced_by_a_sine,
    "baker-2015": _stripes,
}


def textbook_cases() -> tuple[ValidationCase, ...]:
    """Tables of textbooks and printed results of other programs."""
    return cases_of("textbook", _COMPUTED, {})


def validate() -> Several[ValidationResult]:
    """Closed forms, tables of textbooks and printed results of other programs beside those of this installation: for
    each case the largest difference and whether it is within what the case allows."""
    return Several([carry_out(case) for case in (*closed_form_cases(), *textbook_cases())])
