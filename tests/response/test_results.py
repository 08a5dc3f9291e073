"""Results at a Python prompt: short descriptions, comparison, parts of many runs, and models and
records as plain values."""

import sys
import types
from dataclasses import fields, is_dataclass
from pathlib import Path

import numpy as np
import pytest

import tdint
from feature_buildings import building
from small_buildings import MOTION
from tdint.errors import UsageError
from tdint.kernels.laws.law import DriftLaw
from tdint.model.definition import simple_model
from tdint.public_names import PUBLIC
from tdint.tabular import Described
from tdint.validated_calls import in_python

ROOT = Path(__file__).parents[2]
MODEL = tdint.load_model(
    {
        "stories": [{"repeat": 3, "mass": 1e5, "height": 3.0, "stiffness": 3e7}],
        "damping": "5%",
        "attachments": [{"name": "tmd", "floor": 3, "mass": 6e3, "stiffness": 4e5}],
    }
)
RECORD = tdint.make_record(2.0 * np.sin(0.1 * np.arange(120)), dt=0.01, units="m/s^2", name="sine")


@pytest.fixture(scope="module")
def response():
    return tdint.run(MODEL, RECORD, history=True, check=True)


def parts(result):
    """Return a result and all results in its attributes."""
    yield result
    for field in fields(result) if is_dataclass(result) else ():
        value = getattr(result, field.name)
        if isinstance(value, Described):
            yield from parts(value)


def test_descriptions_have_one_short_line(response):
    results = [*parts(response), *parts(tdint.prepare(MODEL, RECORD)), RECORD, MODEL]
    names = {type(result).__name__ for result in results}
    assert {"Case", "Energy", "ErrorEstimate", "StoryErrors", "EnergyHistory"} <= names
    for result in results:
        assert len(repr(result)) <= 200 and "\n" not in repr(result), repr(result)
    assert repr(response.energy).startswith("<Energy input ")


def test_fragility_describes_median_and_dispersion():
    result = tdint.fit_stripes([0.2, 0.4, 0.8], [1, 5, 9], [10, 10, 10])
    assert repr(result).startswith("<Fragility by stripes: theta 0.4")


@pytest.mark.parametrize("name", sorted(PUBLIC))
def test_comparison_of_results_is_a_truth_value(name):
    """The comparison of two dataclasses with arrays raises ValueError if it compares the arrays."""
    value = getattr(tdint, name)
    if isinstance(value, type) and is_dataclass(value) and "__eq__" in vars(value):
        arrays = [f.name for f in fields(value) if f.compare and "rray" in str(f.type)]
        assert not arrays


def test_only_results_with_a_figure_have_plot(response):
    assert not hasattr(response.history, "plot") and not hasattr(response.stories, "plot")
    assert response.history.to_dict() and response.plot()


def test_periods_frequencies_and_times():
    modes = tdint.modes(MODEL)
    np.testing.assert_allclose(modes.period * modes.omega, 2.0 * np.pi, rtol=1e-15)
    np.testing.assert_allclose(modes.frequency * modes.period, 1.0, rtol=1e-15)
    np.testing.assert_allclose(RECORD.time, 0.01 * np.arange(120), rtol=1e-15)


def test_parts_of_many_runs():
    short = tdint.make_record(RECORD.acceleration[:50], dt=0.01, units="m/s^2", name="short")
    runs = tdint.run_many(
        MODEL, [RECORD, short], scales=[0.5, 1.0, 1e9], history="drift", check=True
    )
    assert len(runs) == 6 and len(list(runs)) == 6
    assert [one.scale.item() for one in runs] == [0.5, 1.0, 1e9] * 2
    for i, one in enumerate(runs):
        assert one.records[one.record.item()].name == ("sine", "short")[i // 3]
        np.testing.assert_array_equal(one.stories.peak_drift[0], runs.stories.peak_drift[i])
        np.testing.assert_array_equal(one.history["drift"][0], runs.history["drift"][i])
        np.testing.assert_array_equal(one.errors.peak_drift[0], runs.errors.peak_drift[i])
    np.testing.assert_array_equal(runs[-1].scale, [1e9])
    np.testing.assert_array_equal(runs[1:4].scale, runs.scale[1:4])
    with pytest.raises(IndexError):
        runs[6]


def test_failures_of_selected_runs_have_their_new_index():
    runs = tdint.run_many(MODEL, RECORD, vary={"mass_factor": [1.0, -1.0, 2.0]}, errors="keep")
    assert list(runs.failures) == [1]
    assert list(runs[1:].failures) == [0] and not runs[2].failures


@pytest.mark.parametrize("file", sorted((ROOT / "configs").glob("*.yaml")), ids=lambda f: f.stem)
def test_content_of_a_model_defines_the_same_model(file, monkeypatch):
    monkeypatch.chdir(ROOT)
    model = tdint.load_model(file.relative_to(ROOT))
    content = model.to_dict()
    again = tdint.load_model(content)
    for name in ("stories", "damping", "excitation", "initial", "limits", "attachments", "links"):
        found, expected = getattr(again, name), getattr(model, name)
        # A stiffness of nan, as in models of matrices, is not equal to itself.
        assert found == expected or repr(found) == repr(expected), name
    assert again.to_dict() == content


def test_content_of_changed_models_and_of_models_without_file():
    with pytest.raises(UsageError, match="changed parameters, which its file does not state"):
        MODEL.replace(damping=0.02).to_dict()
    with pytest.raises(UsageError, match="not read from a file"):
        simple_model("chain", MODEL.stories).to_dict()


def test_law_of_a_notebook_is_refused_with_the_line_that_loads_it():
    law = DriftLaw("spring", "f = k d", functions=lambda: None)
    for call in (
        lambda: tdint.load_plugin(law),
        lambda: tdint.load_model({"stories": [{"mass": 1e5, "stiffness": 1e7, "law": law}]}),
        lambda: tdint.load_model({"stories": [{"mass": 1.0, "law": {"type": law}}]}),
    ):
        with pytest.raises(
            tdint.TdintError, match=r'%%writefile.*tdint.load_plugin\("my_law.py"\)'
        ):
            call()


def test_frequencies_of_a_transfer_function_are_the_second_argument():
    frame = {"stories": [{"mass": 1e5, "stiffness": 4e6, "dashpot": 3e4}]}
    frequency = np.array([0.5, 1.0])
    by_name = tdint.transfer_function(frame, frequency=frequency)
    np.testing.assert_array_equal(
        tdint.transfer_function(frame, frequency).response, by_name.response
    )


def test_peaks_of_devices_have_names_a_table_and_a_short_description():
    model = building(("attachments", "links"))
    response = tdint.run(model, MOTION)
    devices = response.devices
    assert repr(devices) == "<DevicePeaks of tank, shelf, cable>"
    table = devices.to_dict("mm")
    assert table["device"] == ["tank", "shelf", "cable"]
    np.testing.assert_allclose(table["peak_drift_mm"], 1e3 * devices.stories.peak_drift)
    np.testing.assert_array_equal(table["dissipated_energy_J"], devices.dissipated_energy)
    np.testing.assert_array_equal(table["peak_shear_N_error"], devices.errors.peak_shear)
    assert np.isnan(table["peak_velocity_mm_s"]).tolist() == [False, False, True]
    without = tdint.run(model, MOTION, check=False).devices.to_dict()
    assert "peak_shear_N_error" not in without


def test_history_as_dataset(monkeypatch):
    """The dimensions of each variable have the lengths of their coordinates."""

    def dataset(variables, coordinates):
        return {name: value[:2] for name, value in variables.items()}, coordinates

    monkeypatch.setitem(sys.modules, "xarray", types.SimpleNamespace(Dataset=dataset))
    for feature in ("elements", "links"):
        history = tdint.run(building((feature,)), MOTION, history=True, check=False).history
        variables, coordinates = history.to_xarray()
        sizes = {name: len(value[1]) for name, value in coordinates.items()}
        for dimensions, values in variables.values():
            names = (dimensions,) if isinstance(dimensions, str) else dimensions
            assert values.shape == tuple(sizes[name] for name in names)
        np.testing.assert_array_equal(variables["energy_kinetic"][1], history.energy.kinetic)
        assert variables["drift"] == (("time", "story"), history.drift)
    assert variables["device_shear"][1] is history.devices.shear
    assert coordinates["device"][1].tolist() == ["cable"]


def test_messages_and_notes_name_arguments():
    still = {"stories": [{"mass": 1e5, "stiffness": 4e7}], "initial": {"displacement": [0.1]}}
    with pytest.raises(UsageError, match=r"; specify dt, or analysis\.dt in"):
        tdint.run(still)
    with pytest.raises(tdint.FailedRun, match=r"or use allow_unstable$") as caught:
        tdint.run(still, method="central-difference", dt=0.5, duration=5.0)
    assert caught.value.message.endswith("use allow_unstable")
    undamped = {"stories": [{"mass": 1e5, "stiffness": 4e7}], "damping": 0.0}
    notes = tdint.run(undamped, MOTION, check=False).notes
    assert any(note.endswith("see until_rest") for note in notes)
    assert in_python("--no-check omits it, `tdint check --plugin` and --output", tdint.run) == (
        "check=False omits it, `tdint check --plugin` and --output"
    )
