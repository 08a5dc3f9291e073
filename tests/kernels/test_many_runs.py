"""Many runs in one kernel, compared with single runs of the same small buildings."""

import dataclasses

import numpy as np
import pytest

from small_buildings import BUILDINGS, MOTION
from tdint import load_model, run, run_many


@pytest.mark.parametrize(
    ("name", "method"),
    [
        ("bilinear", "impulse4"), ("bouc-wen", "moment4"), ("forces", "newmark-average"),
        ("failure", "impulse4"), ("forces", "houbolt"), ("isolated", "generalized-alpha"),
    ],
)  # fmt: skip
def test_runs_of_one_kernel_agree_with_single_runs(name, method):
    """Each run starts from the initial state, whatever the run before it has left. The motions
    have different lengths and scales."""
    model = load_model(BUILDINGS[name])
    short = dataclasses.replace(MOTION, acceleration=MOTION.acceleration[7:33])
    many = run_many(model, [MOTION, short], scales=[1.0, 0.4], method=method, jobs=1)
    records = [MOTION, short]
    for k, (record, scale) in enumerate(zip(many.record, many.scale, strict=True)):
        one = run(model, records[int(record)].scaled(scale), method=method, check=False)
        for field in dataclasses.fields(one.stories):
            expected = getattr(one.stories, field.name)
            if isinstance(expected, np.ndarray) and hasattr(many.stories, field.name):
                found = getattr(many.stories, field.name)[k]
                assert found == pytest.approx(expected, rel=1e-9, nan_ok=True), field.name
    assert np.ptp(many.stories.peak_drift[:, 0]) > 0.1 * np.max(many.stories.peak_drift[:, 0])
