"""Tests of the iteration of impulse4: its first estimates, and its stop criterion."""

import numpy as np
import pytest

from building_cases import Law, model, noise, story
from step_checks import refined
from tdint.kernels import layout as rows
from tdint.kernels.equations import impulse_momentum as momentum
from tdint.kernels.equations.impulse4 import ROW
from tdint.methods.impulse4 import _shorten_increments


@pytest.mark.parametrize("fraction", [0.01, 0.3, 0.5, 0.97, 1.0])
def test_first_estimate_of_shortened_step_is_cubic_of_longer_step(fraction):
    h, n = 0.02, 3
    rng = np.random.default_rng(1)
    state, scratch = np.zeros((3, n)), np.zeros((ROW.REMAINING + 2, n))
    cubics = [np.polynomial.Polynomial(rng.normal(size=4)) for _ in range(n)]
    for i, u in enumerate(cubics):
        v = u.deriv()
        state[rows.DISPLACEMENT, i], state[rows.VELOCITY, i] = u(0.0), v(0.0)
        scratch[momentum.DU, i], scratch[momentum.DV, i] = u(h) - u(0.0), v(h) - v(0.0)
    _shorten_increments(fraction, h, state, scratch, n)
    s = fraction * h
    for i, u in enumerate(cubics):
        assert scratch[momentum.DU, i] == pytest.approx(u(s) - u(0.0), rel=1e-9, abs=1e-15)
        v = u.deriv()
        assert scratch[momentum.DV, i] == pytest.approx(v(s) - v(0.0), rel=1e-9, abs=1e-12)


def test_residual_tolerance_does_not_limit_order_4():
    """For smooth stories, the order remains 4 down to errors far below the tolerated residual, and
    coarse steps need one or two corrections."""
    stories = [story(1e5, 4e7, Law("tanh", (2.5e5,))) for _ in range(3)]
    runs, _, errors = refined(model(stories), noise(samples=301), (1, 2, 4, 8, 32))
    assert runs[0].iterations < 2.0 * runs[0].steps
    assert errors[3] < 1e-7
    observed = np.log2(np.array(errors[:-1]) / np.array(errors[1:]))
    assert observed[1:] == pytest.approx(4.0, abs=0.3)
