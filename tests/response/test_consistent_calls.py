"""`run` and `run_many` accept the same lists and histories, and messages state the number of the
sample."""

import numpy as np
import pytest

import tdint
from tdint.response.runs.history import HISTORIES

LAW = {"type": "bilinear", "yield_force": 2e5, "hardening": 0.05}
STORY = {"mass": 1e5, "height": 3.0, "stiffness": 1e8, "law": LAW}
MODEL = {"stories": [STORY, STORY], "damping": "5%"}
RECORD = tdint.make_record(np.sin(np.arange(200) * 0.1), dt=0.02, units="m/s^2")


def test_run_many_accepts_lists_of_methods_and_time_steps():
    methods, steps = ["impulse4", "hht"], np.array([0.01, 0.02])
    single = tdint.run(MODEL, RECORD, method=methods, dt=steps, check=False)
    many = tdint.run_many(MODEL, RECORD, method=methods, dt=steps)
    assert len(single) == len(many) == 4
    for response, runs in zip(single, many, strict=True):
        assert (response.dt, response.method) == (runs.dt[0], runs.methods[0])
        assert np.array_equal(response.stories.peak_drift, runs.stories.peak_drift[0])
    assert many.to_dict()["method"] == ["impulse4", "impulse4", "hht", "hht"]  # one row per run
    with pytest.raises(tdint.TdintError, match=r"out .*list"):
        tdint.run_many(MODEL, RECORD, method=methods, history="drift", out=np.zeros((1, 1, 1)))


def test_history_true_stores_all_quantities():
    runs = tdint.run_many(MODEL, RECORD, history=True)
    response = tdint.run(MODEL, RECORD, history=True, check=False)
    # Both histories contain the motion after the record.
    rows = runs.history["drift"].shape[1]
    assert runs.record_rows == response.record_rows == 200 < rows == len(response.history.time)
    assert set(runs.history) == set(HISTORIES)
    for name, kept in runs.history.items():
        assert np.array_equal(kept[0], getattr(response.history, name)[:rows]), name
    assert not tdint.run_many(MODEL, RECORD, history=False).history
    with pytest.raises(tdint.TdintError, match=r"history .*True.*False, got 'drift'"):
        tdint.run(MODEL, RECORD, history="drift")


@pytest.mark.parametrize(
    ("name", "values", "sample"),
    [
        ("damping", [0.02, 0.05, 1.5], 2),
        ("stories[1].law.hardening", [0.1, 7.0, 0.2], 1),
        ("stories[1].mass", [1e5, 1e5, np.nan], 2),
    ],
)
def test_sample_out_of_range_is_reported_with_its_number(name, values, sample):
    with pytest.raises(tdint.TdintError, match=rf"\(sample {sample}, counted from 0\)"):
        tdint.run_many(MODEL, RECORD, vary={name: values})
