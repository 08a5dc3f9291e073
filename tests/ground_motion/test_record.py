"""Samples, sampling interval and scaling of `Record`."""

import numpy as np
import pytest

from tdint.errors import ModelError, RecordError
from tdint.ground_motion.record import Record
from tdint.model.config.model_file import load_model


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


def test_scaling_keeps_other_attributes():
    original = record([0.0, 1.0, -3.0])
    half = original.scaled(-0.5)
    assert half.acceleration.tolist() == [0.0, -0.5, 1.5]
    assert (half.dt, half.id, half.component, half.source) == (0.01, "XX.A..HNE", "HNE", "a.mseed")
    assert original.pga == 3.0


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


@pytest.mark.parametrize("dt", [0.0, -0.01, np.nan, np.inf, None, "0.01", 0.01j, True])
def test_sampling_interval_must_be_positive(dt):
    with pytest.raises(RecordError, match="sampling interval must be a positive number"):
        Record(acceleration=[0.0, 1.0], dt=dt, start="", id="", component="", source="")


def test_overflowing_scale_is_refused():
    with pytest.raises(RecordError, match="got inf"):
        record(np.array([0.0, 1e300])).scaled(1e100)


@pytest.mark.parametrize("source", [3, None, ["a.yaml"]])
def test_model_must_be_file_or_stream(source):
    with pytest.raises(ModelError, match="name of a file or a text stream, not"):
        load_model(source)
