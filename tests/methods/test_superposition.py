"""A classically damped linear building is the sum of its modes, each integrated by the same step as an oscillator."""

from __future__ import annotations

import numpy as np
import pytest

from building_cases import ModalDamping, model, noise
from step_checks import RAYLEIGH, building, superposed
from tdint import run
from tdint.methods.catalogue import catalogue

METHODS = [
    *catalogue(),
    "bathe:gamma=0.5",
    "bathe:rho_inf=0.5",
    "kr-alpha:rho_inf=0",
    "impulse4:rho_inf=0.5",
    "moment4:rho_inf=0.5",
]


@pytest.mark.parametrize("damping", ["rayleigh", "modal"])
@pytest.mark.parametrize("method", METHODS)
def test_building_is_the_sum_of_its_modes(method, damping):
    case, record = building(ModalDamping((0.07,))), noise(samples=201)
    if damping == "rayleigh":
        case = model(case.stories, damping=RAYLEIGH, displacement=case.initial.displacement)
    got = run(case, record, method=method, history=True).history.displacement
    ratio = (lambda omega: 0.07) if damping == "modal" else (lambda omega: 0.4 / omega + 1e-3 * omega)
    want = superposed(method, case, ratio, record)
    np.testing.assert_allclose(got, want, rtol=0.0, atol=1e-9 * np.max(np.abs(want)))
