"""configs/ten-story-bilinear.yaml: impulse4 and average acceleration at the record's step against fine runs."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from tdint import load_model, run

pytestmark = pytest.mark.long

MODEL = load_model(Path(__file__).parents[3] / "configs" / "ten-story-bilinear.yaml")
DT = 0.01


def histories(method, parts):
    response = run(MODEL, method=method, dt=DT / parts, history=True)
    return response.history.displacement[::parts], response


@pytest.fixture(scope="module")
def reference():
    """impulse4 at dt / 256, confirmed by average acceleration, extrapolated from dt / 256 and dt / 512."""
    fine, response = histories("impulse4", 256)
    other = (4.0 * histories("newmark-average", 512)[0] - histories("newmark-average", 256)[0]) / 3.0
    gap = np.linalg.norm(other - fine) / np.linalg.norm(fine)
    assert gap < 1e-6
    return fine, response.stories.peak_drift


def errors(reference, method, parts=1):
    fine, peak = reference
    displacement, response = histories(method, parts)
    l2 = np.linalg.norm(displacement - fine) / np.linalg.norm(fine)
    return l2, np.max(np.abs(response.stories.peak_drift - peak) / peak), response


def test_impulse4_at_the_records_step(reference):
    l2, peak, response = errors(reference, "impulse4")
    assert l2 <= 3e-4
    assert peak <= 3e-3
    assert abs(response.energy.error) < 1e-4


def test_average_acceleration_has_its_known_error(reference):
    """L2 error 4.7e-3 and 1.6 % of peak drift, as measured with OpenSeesPy 3.7.1 and with a plain loop."""
    l2, peak, _ = errors(reference, "newmark-average")
    assert l2 == pytest.approx(4.7e-3, rel=0.02)
    assert peak == pytest.approx(1.6e-2, rel=0.05)


def test_the_stories_yield(reference):
    _, _, response = errors(reference, "impulse4")
    assert 2.0 < response.stories.ductility.min() < response.stories.ductility.max() < 6.0
    assert response.energy.dissipated > 0.2 * response.energy.input
