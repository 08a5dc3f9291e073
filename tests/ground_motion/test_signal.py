"""Values of a motion at times between its samples."""

import numpy as np
import pytest

from tdint.ground_motion.signal import at_times


@pytest.mark.parametrize("first", [0.3, -0.3, 2.3, -2.7, 3.0, -1.0, 1e-8])
def test_times_outside_the_samples_are_nan(first):
    """The motion is a short pulse; times up to half an interval outside are not extrapolated."""
    samples = np.exp(-(((np.arange(40) - 20.0) / 3.0) ** 2))
    found = at_times(samples, 1.0, first, 1.0, 50)
    times = np.arange(50.0)
    inside = (times >= first - 1e-6) & (times <= first + 39.0 + 1e-6)
    assert np.array_equal(np.isfinite(found), inside)
    exact = np.exp(-(((times - first - 20.0) / 3.0) ** 2))
    np.testing.assert_allclose(found[inside], exact[inside], atol=1e-8)
