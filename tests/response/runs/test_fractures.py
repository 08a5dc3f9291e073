"""Springs that fracture are reported with time and side, and their ductility ends there."""

import numpy as np
import pytest

import tdint
from registered import plain as interpreted  # noqa: F401
from tdint.output.tables.devices import device_rows, device_tables
from tdint.output.tables.elements import element_table
from tdint.response.pairs import Run
from tdint.response.runs.batch import Subject
from tdint.studies.campaign.chunks import Batch, CampaignSettings

YIELD_FORCE, STIFFNESS = 6e4, 4e6  # N, N/m: the yield drift is 15 mm
ROD = {
    "type": "bilinear",
    "stiffness": STIFFNESS,
    "yield_force": YIELD_FORCE,
    "hardening": 0.0,
}


def pushed(side=1.0):
    """Return a motion that pushes a building slowly, in the positive direction with `side` 1."""
    acceleration = -side * 4.0 * np.sin(3.0 * 0.01 * np.arange(101))
    return tdint.make_record(acceleration, dt=0.01, units="m/s^2")


def with_rod(**fracture):
    """Return a story of a frame and a rod that fractures."""
    elements = [{"name": "frame", "type": "linear", "stiffness": 6e6}, {"name": "rod", **ROD}]
    elements[1].update(fracture)
    return {"stories": [{"mass": 1e5, "height": 3.0, "elements": elements}], "damping": 0.05}


@pytest.mark.parametrize("side", [1.0, -1.0])
@pytest.mark.parametrize("method", ["impulse4", "moment4", "gauss4", "newmark-average"])
def test_element_that_fractures(method, side, interpreted):  # noqa: F811
    model = with_rod(fracture_drift=0.03)
    response = tdint.run(model, pushed(side), method=method, history=True, check=False)
    elements = response.elements
    name = "positive" if side > 0.0 else "negative"
    assert elements.fracture_side.tolist() == ["", name]
    drift, time = side * response.history.drift[:, 0], response.history.time
    beyond = int(np.argmax(drift >= 0.03))
    assert time[beyond - 1] < elements.fracture_time[1] <= time[beyond]
    expected = np.interp(0.03, drift[beyond - 1 : beyond + 1], time[beyond - 1 : beyond + 1])
    assert elements.fracture_time[1] == pytest.approx(expected, abs=2e-4)
    assert elements.ductility[1] == pytest.approx(2.0, rel=1e-9)
    assert np.isnan(elements.fracture_time[0])
    warning = f"element rod fractured at {elements.fracture_time[1]:.4g} s on the {name} side"
    assert any(warning in text for text in response.warnings)
    table = element_table(response)
    assert table.columns[-2:] == ("fracture_time_s", "fracture_side")
    assert table.rows[1][-1] == name


def test_fracture_after_a_larger_drift_on_the_other_side(interpreted):  # noqa: F811
    model = with_rod(fracture_drift={"positive": 0.2, "negative": 0.02})
    model["initial"] = {"displacement": [0.06]}
    response = tdint.run(model, dt=0.01, duration=1.0, check=False)
    assert response.elements.fracture_side[1] == "negative"
    assert response.elements.ductility[1] == pytest.approx(4.0, rel=1e-3)


def with_devices():
    """Return two stories with a strut from the ground to the roof that fractures at 30 mm, and a
    mass on a spring that fractures at 30 mm and a soft tie."""
    law = {key: ROD[key] for key in ("type", "yield_force", "hardening")} | {"fracture_drift": 0.03}
    device = {"stiffness": STIFFNESS, "law": law}
    return {
        "stories": [{"mass": 1e5, "height": 3.0, "stiffness": 6e6}] * 2,
        "attachments": [{"name": "tank", "floor": 1, "mass": 3e4, "dashpot": 2e4, **device}],
        "links": [
            {"name": "strut", "from": "ground", "to": 2, **device},
            {"name": "tie", "from": 1, "to": "tank", "stiffness": 5e5},
        ],
        "damping": 0.05,
    }


def test_devices_that_fracture(interpreted):  # noqa: F811
    response = tdint.run(with_devices(), pushed(), method="newmark-average", check=False)
    assert response.devices.stories.ductility[:2] == pytest.approx([2.0, 2.0], rel=1e-9)
    for name in ("attachment tank", "link strut"):
        assert any(f"{name} fractured at" in text for text in response.warnings)
    assert device_tables(response)[1].rows[0][-1] == "positive"


def test_ductilities_of_a_batch_end_at_the_fracture(interpreted):  # noqa: F811
    """The rows of campaigns, of one run that fractures and one that does not."""
    model = tdint.load_model(with_devices())
    settings = CampaignSettings(stories=True)
    motions, method = {0: pushed()}, "newmark-average"
    batch = Batch(0, Subject(model, method), motions, {0: None}, settings)
    found = batch.results([Run(0, scale) for scale in (1.0, 0.02)])
    parts = [(part.scale, part.cells[1:]) for part in (*found.attachments, *found.links)]
    expected = []
    for scale in (1.0, 0.02):
        response = tdint.run(model, pushed().scaled(scale), method=method, check=False)
        tables = device_rows(response.model, response.devices)
        expected += [(scale, cells) for cells in (*tables[0], *tables[1])]
    np.testing.assert_equal(sorted(parts), sorted(expected))
    assert response.devices.fracture_time is None


def test_models_without_fracture_have_no_columns(interpreted):  # noqa: F811
    response = tdint.run(with_rod(), pushed(), check=False)
    assert "fracture_side" not in element_table(response).columns
