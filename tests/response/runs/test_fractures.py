"""Springs that fracture are reported with time and side, and their ductility ends there."""

import numpy as np
import pytest

import tdint
from registered import plain as interpreted  # noqa: F401
from tdint.output.tables.devices import device_tables
from tdint.output.tables.elements import element_table

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


def test_link_that_fractures(interpreted):  # noqa: F811
    stories = [{"mass": 1e5, "height": 3.0, "stiffness": 6e6}] * 2
    link = {"name": "strut", "from": "ground", "to": 2, "stiffness": STIFFNESS}
    link["law"] = {key: ROD[key] for key in ("type", "yield_force", "hardening")}
    link["law"]["fracture_drift"] = 0.03
    model = {"stories": stories, "links": [link], "damping": 0.05}
    response = tdint.run(model, pushed(), check=False)
    assert response.devices.stories.ductility[0] == pytest.approx(2.0, rel=1e-9)
    assert any("link strut fractured at" in text for text in response.warnings)
    table = device_tables(response)[1]
    assert table.rows[0][-1] == "positive"


def test_models_without_fracture_have_no_columns(interpreted):  # noqa: F811
    response = tdint.run(with_rod(), pushed(), check=False)
    assert "fracture_side" not in element_table(response).columns
