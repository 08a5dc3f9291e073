"""Samples, sampling interval and scaling of `Record`."""

import numpy as np
import pytest

from tdint.errors import RecordError
from tdint.ground_motion.record import Record


def record(samples):
    return Record(
        acceleration=samples, dt=0.01, start="", id="XX.A..HNE", component="HNE", source="a.mseed"
    )


def test_samples_are_read_only_copy():
    samples = np.array([0, 9, 1, 9, -3, 9])
    copied_record = record(samples[::2])
    samples[:] = 7
    assert (
        copied_record.acceleration.tolist() == [0.0, 1.0, -3.0]
        and copied_record.acceleration.dtype == np.float64
    )
    assert (copied_record.duration, copied_record.pga) == (pytest.approx(0.02), 3.0)
    with pytest.raises(ValueError, match="read-only"):
        copied_record.acceleration[0] = 1.0


@pytest.mark.parametrize(
    ("samples", "message"),
    [
        ([0.0, np.nan], r"got nan for sample 1 \(counted from 0\)"),
        ([np.inf, 0.0], "got inf for sample 0"),
        (np.ma.masked_array([0.0, 1.0, 2.0], [False, True, False]), "1 sample masked"),
        ([0.0, 1.0j], "must be real numbers, got complex128"),
        (["a", "b"], "must be real numbers"),
        ([True, False], "must be real numbers, got bool"),
        ([[0.0, 1.0]], r"got shape \(1, 2\)"),
        ([1.0], r"got shape \(1,\)"),
        (None, "must be real numbers"),
    ],
)
def test_invalid_samples_are_refused(samples, message):
    with pytest.raises(RecordError, match=message):
        record(samples)
