"""Tests of linear buildings, under motions that are linear between their samples, against the dense
matrix exponential."""

import numpy as np
import pytest

from building_cases import (
    ModalDamping,
    RayleighCoefficients,
    RayleighRatio,
    model,
    noise,
    story,
    ten_linear,
)
from references import drifts, exact_linear, orders
from selection import every
from tdint import run

DAMPINGS = {
    "rayleigh": RayleighRatio((0.05, 0.05), (1, 3)),
    "coefficients": RayleighCoefficients(0.2, 0.001),
    "modal": ModalDamping((0.05,)),
    "some modes": ModalDamping((0.05, 0.02, 0.1)),
    "none": None,
}


def drift_errors(building, method, halvings):
    record = noise()
    reference = drifts(exact_linear(building, record))
    errors = []
    for halving in range(halvings):
        parts = 2**halving
        response = run(building, record, method=method, dt=record.dt / parts, history=True)
        errors.append(
            np.max(np.abs(response.history.drift[::parts] - reference)) / np.max(np.abs(reference))
        )
    return np.array(errors)


@pytest.mark.parametrize("damping", DAMPINGS.values(), ids=DAMPINGS)
def test_exact_equals_matrix_exponential(damping):
    assert drift_errors(ten_linear(damping), "exact", 3).max() < 1e-9


def test_exact_with_dashpots_coupling_modes():
    building = model([story(2e5, 3.5e8, dashpot=5e6 if i == 3 else 0.0) for i in range(10)])
    assert drift_errors(building, "exact", 2).max() < 1e-9


@pytest.mark.parametrize("damping", every(2, DAMPINGS))
@pytest.mark.parametrize("method", ["impulse", "impulse4", "moment4"])
def test_impulse_methods_are_of_order_4(method, damping):
    errors = drift_errors(ten_linear(DAMPINGS[damping]), method, 3)
    assert orders(errors).min() >= 3.9
    assert errors[0] < 1e-3


def test_ground_is_at_rest_after_record():
    record = noise()
    building = ten_linear()
    response = run(building, record, method="exact", duration=12.0, history=True)
    assert response.history.time[-1] == pytest.approx(12.0)
    assert not response.history.ground_acceleration[record.acceleration.size :].any()
    # Free vibration after the record: the reference motion is padded with zeros.
    longer = type(record)(np.append(record.acceleration, np.zeros(400)), record.dt, "", "", "", "")
    reference = exact_linear(building, longer)
    assert np.max(np.abs(response.history.displacement - reference)) < 1e-9 * np.max(
        np.abs(reference)
    )


def test_energy_balance_error_is_of_order_of_method():
    record = noise()
    errors = [
        abs(run(ten_linear(), record, method="impulse4", dt=record.dt / 2**j).energy.error)
        for j in range(3)
    ]
    assert errors[0] < 1e-4
    assert orders(errors).min() > 3.5
