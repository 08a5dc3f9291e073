"""The Record itself."""

import numpy as np
import pytest

from tdint.ground_motion.record import Record


def record(samples):
    return Record(acceleration=samples, dt=0.01, start="", id="XX.A..HNE", component="HNE", source="a.mseed")


def test_samples_are_a_read_only_copy():
    samples = np.array([0.0, 1.0, -3.0])
    made = record(samples)
    samples[1] = 9.0
    assert made.acceleration.tolist() == [0.0, 1.0, -3.0]
    with pytest.raises(ValueError, match="read-only"):
        made.acceleration[0] = 1.0


def test_a_view_is_copied():
    samples = np.arange(10.0)
    made = record(samples[::2])
    samples[:] = 0.0
    assert made.acceleration.tolist() == [0.0, 2.0, 4.0, 6.0, 8.0]


def test_integers_become_floating_point():
    assert record(np.array([0, 1])).acceleration.dtype == np.float64


def test_duration_and_peak():
    made = record([0.0, 1.0, -3.0])
    assert made.duration == pytest.approx(0.02)
    assert made.pga == 3.0


def test_scaled_keeps_everything_else():
    made = record([0.0, 1.0, -3.0])
    half = made.scaled(-0.5)
    assert half.acceleration.tolist() == [0.0, -0.5, 1.5]
    assert (half.dt, half.id, half.component, half.source) == (0.01, "XX.A..HNE", "HNE", "a.mseed")
    assert made.pga == 3.0
