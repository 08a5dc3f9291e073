"""Peaks of moment4 in steps with branch changes, in buildings with a curved story."""

import math

import numpy as np
import pytest

import tdint
from building_cases import noise
from small_buildings import LAWS, _stories
from tdint.kernels import layout as rows
from tdint.kernels.equations.iteration import RESIDUAL_TOLERANCE, is_balanced


@pytest.mark.parametrize("rho_inf", [0.0, 0.5])
def test_peaks_of_curved_story_exclude_numerical_dissipation(rho_inf):
    """The peaks between branch changes of the bilinear story are computed from the force of the
    curved story, without the numerical dissipation that the equations of the step contain."""
    model = tdint.load_model(
        {"stories": _stories(LAWS["bouc-wen"], LAWS["bilinear"]), "damping": 0.03}
    )
    motion = noise(samples=51, dt=0.02, seed=1, peak=8.0)

    def total_shear(method, dt):
        return tdint.run(model, motion, method=method, dt=dt, check=False).stories.peak_total_shear

    expected = total_shear("moment4", 0.02 / 16)
    errors = total_shear(f"moment4:rho_inf={rho_inf}", 0.02) / expected - 1.0
    assert np.max(np.abs(errors)) < 1e-3


@pytest.mark.parametrize("residual", [math.inf, math.nan, 1e-6])
def test_residuals_that_are_not_balanced(residual):
    """With an infinite force, the scale of the residual is infinite also."""
    status = np.zeros(rows.STEP_STATUS_SIZE)
    scale = 1.0 if residual == 1e-6 else residual
    assert not is_balanced(True, RESIDUAL_TOLERANCE, status, 1, residual, scale)
    assert status[rows.WORST_STORY] == 1.0
