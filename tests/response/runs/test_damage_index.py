"""Hysteretic energies of stories, and damage indices by values that two other programs computed."""

from dataclasses import replace

import numpy as np
import pytest

import tdint
from tdint.errors import UsageError
from tdint.response.runs.damage_index import park_ang

STORY = {"ultimate_drift": 0.06, "yield_drift": 0.01, "yield_force": 100.0}


def test_index_of_an_elastic_and_perfectly_plastic_story():
    """Path 0, 0.03, -0.02, 0.04, 0 m with 10000 kN/m and 100 kN: 11 kN m, without the elastic
    energy at the end."""
    index = park_ang(0.04, 11.0, **STORY)
    assert index == pytest.approx(0.7583333333, rel=1e-9)
    assert park_ang(0.04, 11.0, kunnath=True, **STORY) == pytest.approx(0.6916666667, rel=1e-9)


@pytest.mark.parametrize("ultimate", [0.01, 0.005, np.nan])
def test_ultimate_drift_must_exceed_yield(ultimate):
    with pytest.raises(UsageError, match="ultimate_drift must exceed the drift at yield"):
        park_ang(0.04, 11.0, **(STORY | {"ultimate_drift": ultimate}))


@pytest.fixture(scope="module")
def response():
    """Two stories, the second of which is elastic, under a pulse."""
    law = {"type": "bilinear", "yield_force": 150e3, "hardening": 0}
    model = {
        "stories": [
            {"mass": 5e4, "height": 3, "stiffness": 12e6, "law": law},
            {"mass": 5e4, "height": 3, "stiffness": 12e6},
        ],
        "damping": "none",
    }
    time = 0.01 * np.arange(400)
    record = tdint.make_record(3.0 * np.sin(6.0 * time) * (time < 3.0), dt=0.01, units="m/s^2")
    return tdint.run(model, record, dt=0.0025, history=True, check=True)


def test_energy_of_a_story_is_work_minus_stored_energy(response):
    """The work of the force along the drift, by trapezoids of the history."""
    drift, force = response.history.drift[:, 0], response.history.shear[:, 0]
    work = np.sum(0.5 * (force[1:] + force[:-1]) * np.diff(drift))
    stored = 0.5 * force[-1] ** 2 / 12e6
    energy = response.hysteretic_energy
    assert energy[0] == pytest.approx(work - stored, rel=1e-3)
    assert energy[1] == 0.0
    assert energy.sum() == pytest.approx(response.energy.hysteretic, rel=1e-12)
    table = response.to_dict()
    assert table["hysteretic_energy_J"] == pytest.approx(energy, rel=1e-12)
    assert 0.0 <= table["hysteretic_energy_J_error"][0] < 0.01 * energy[0]


def test_index_of_a_response(response):
    yield_drift = 150e3 / 12e6
    index = response.damage_index(0.3)
    expected = park_ang(
        response.stories.peak_drift[0],
        response.hysteretic_energy[0],
        ultimate_drift=0.3,
        yield_drift=yield_drift,
        yield_force=150e3,
    )
    assert index[0] == pytest.approx(float(expected), rel=1e-12) and np.isnan(index[1])
    with pytest.raises(UsageError):
        response.damage_index(yield_drift)


def test_energies_of_two_directions_are_sums():
    """The resultants have the sum of the energies and of their errors; indices have a direction."""
    law = {"type": "bilinear", "yield_force": 150e3, "hardening": 0}
    across = {"stiffness": 8e6, "law": law | {"yield_force": 100e3}}
    stories = [{"mass": 5e4, "height": 3, "x": {"stiffness": 12e6, "law": law}, "y": across}]
    records = [
        tdint.make_record(amplitude * np.sin(0.06 * np.arange(400)), dt=0.01, units="m/s^2")
        for amplitude in (3.0, 2.5)
    ]
    pair = tuple(
        replace(record, component=name)
        for record, name in zip(records, ("000", "090"), strict=True)
    )
    response = tdint.run({"stories": stories}, pair, check=True)
    x, y = response.directions
    energies = [float(run.hysteretic_energy[0]) for run in (x, y)]
    assert energies[0] != energies[1] and min(energies) > 0.0
    assert response.hysteretic_energy == pytest.approx([sum(energies)], rel=1e-12)
    assert response.hysteretic_energy.sum() == pytest.approx(response.energy.hysteretic, rel=1e-9)
    table = response.to_dict()
    assert list(table["direction"]) == ["x", "y", "resultant"]
    for end in ("", "_error"):
        in_x, in_y, total = table[f"hysteretic_energy_J{end}"]
        assert total == pytest.approx(in_x + in_y, rel=1e-12) and in_x != in_y
    assert np.isfinite(x.damage_index(0.3)[0])
    with pytest.raises(UsageError, match="requires one direction"):
        response.damage_index(0.3)


def test_stories_of_a_building_with_an_attachment_have_an_index():
    """The attachment is a column of the building and no story."""
    law = {"type": "bilinear", "yield_force": 2e5, "hardening": 0.03}
    story = {"mass": 1e5, "height": 3.0, "stiffness": 3e7, "law": law}
    model = {
        "stories": [story, story],
        "damping": "3%",
        "attachments": [{"name": "tmd", "floor": "roof", "mass": 5e3, "stiffness": 5e5}],
        "plausibility": "off, test",
    }
    motion = tdint.make_record(4.0 * np.sin(0.08 * np.arange(401)), dt=0.01, units="m/s^2")
    response = tdint.run(model, motion, check=False)
    peak, energy = response.stories.peak_drift, response.hysteretic_energy
    assert response.damage_index(0.3) == pytest.approx(peak / 0.3 + 0.05 * energy / (2e5 * 0.3))
