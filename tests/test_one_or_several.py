"""Functions accept one or several methods, time steps and records by the same names."""

import sys

import numpy as np
import pytest

import tdint

MODEL = {"stories": [{"mass": 1e5, "height": 3.0, "stiffness": 1e7}], "damping": "5%"}
RECORD = tdint.make_record(np.sin(0.3 * np.arange(50)), dt=0.02, units="m/s^2", name="wave")


@pytest.mark.parametrize(
    "call",
    [
        lambda method: tdint.stability(method, np.array([0.1])),
        lambda method: tdint.overshoot(method=method),
        tdint.order,
        lambda method: tdint.run(MODEL, RECORD, method=method, check=False),
    ],
)
def test_several_methods_give_results_of_single_calls(call):
    several = call(["impulse4", "hht:alpha=-0.1"])
    assert [result.method.partition(":")[0] for result in several] == ["impulse4", "hht"]
    assert repr(several[1]) == repr(call("hht:alpha=-0.1"))
    assert len(several) == 2 and several.to_dict()


def test_several_time_steps_and_records():
    runs = tdint.run(MODEL, RECORD, method=("impulse4", "hht"), dt=[0.02, 0.01], check=False)
    assert [(run.method[:3], run.dt) for run in runs] == [
        ("imp", 0.02),
        ("imp", 0.01),
        ("hht", 0.02),
        ("hht", 0.01),
    ]
    spectra = tdint.spectrum([RECORD, RECORD.scaled(2.0)], np.array([0.5, 1.0]))
    np.testing.assert_allclose(spectra[1].psa, 2.0 * spectra[0].psa)
    assert len(tdint.spectrum(record=(RECORD,), periods=np.array([0.5]))) == 1
    assert tdint.spectrum(RECORD, np.array([0.5])).psa.shape == (1,)


def test_several_damping_ratios_give_spectra_of_single_calls():
    ratios, periods = [0.02, "5%"], [0.5, 1.0]
    records = [RECORD, RECORD.scaled(2.0)]
    several = tdint.spectrum(records, periods, damping=ratios)
    singles = [
        tdint.spectrum(record, periods, damping=ratio) for record in records for ratio in ratios
    ]
    assert [curve.damping for curve in several] == [0.02, 0.05] * 2
    for curve, single in zip(several, singles, strict=True):
        np.testing.assert_array_equal(curve.psa, single.psa)


def test_former_names_are_refused():
    with pytest.raises(AttributeError, match="no attribute 'register_law'"):
        tdint.register_law  # noqa: B018
    for call in (tdint.paper_examples, tdint.modes):
        with pytest.raises(tdint.TdintError, match="unexpected keyword argument 'methods'"):
            call([1], methods=["wilson"])


def test_missing_tqdm_does_not_prevent_run(monkeypatch, caplog):
    monkeypatch.setitem(sys.modules, "tqdm.auto", None)
    runs = tdint.run_many(MODEL, RECORD, progress=True)
    assert runs.status.tolist() == ["done"]
    assert (
        "progress=True requires tqdm" in caplog.text and "no progress bar is shown" in caplog.text
    )
