"""Adjacent buildings that collide: attachments that only links hold, and links with the law gap,
against `scipy.integrate.solve_ivp` with the closings as events."""

import io

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import tdint
from tdint.errors import ModelError
from tdint.ground_motion.record import Record
from tdint.model.building import assemble
from tdint.model.config.model_file import load_model

STEP = 0.01
TIME = STEP * np.arange(251)
MOTION = Record(
    3.1 * np.sin(5.3 * TIME) * np.exp(-0.2 * TIME) + 1.3 * np.sin(13.0 * TIME),
    *(STEP, "", "", "", "motion"),
)
BUILDINGS = """
units: {{length: m, force: kN, mass: t}}
stories:
  - {{mass: 90, height: 3, stiffness: 9.0e3, dashpot: 80}}
  - {{mass: 75, height: 3, stiffness: 7.0e3, dashpot: 70}}
damping: none
plausibility: off, test
attachments:
  - {{name: east1, floor: ground, mass: 70, stiffness: 0}}
  - {{name: east2, floor: ground, mass: 55, stiffness: 0}}
links:
  - {{name: column1, from: ground, to: east1, stiffness: 2.4e4, dashpot: 110}}
  - {{name: column2, from: east1, to: east2, stiffness: 2.1e4, dashpot: 90}}
  - {{name: joint, from: 2, to: east2, law: {{type: gap, gap: 0.02, stop_stiffness: 3.0e4,
     sides: negative{law}}}}}
"""
MASS = 1e3 * np.array([90.0, 75.0, 70.0, 55.0])


def reference(dashpot):
    """Peak displacements of the floors, peak spring force of the joint, and time, duration, peak
    force and energy of each contact."""
    stiffness, damping = 1e3 * np.array([9e3, 7e3, 2.4e4, 2.1e4]), 1e3 * np.array([80, 70, 110, 90])
    gap, stop = 0.02, 3.0e7
    drifts = np.eye(4)
    drifts[1, 0] = drifts[3, 2] = -1.0

    def rate(t, y, is_closed):
        force = drifts.T @ (stiffness * (drifts @ y[:4]) + damping * (drifts @ y[4:]))
        if is_closed:
            contact = stop * (y[1] - y[3] - gap) + dashpot * (y[5] - y[7])
            force += contact * np.array([0.0, 1.0, 0.0, -1.0])
        return [*y[4:], *(-force / MASS - np.interp(t, TIME, MOTION.acceleration))]

    def closing(t, y, _):
        return y[1] - y[3] - gap

    closing.terminal = True
    contacts = []
    t, y, is_closed, peaks = 0.0, np.zeros(8), False, np.zeros(5)
    while t < TIME[-1]:
        closing.direction = -1.0 if is_closed else 1.0
        part = solve_ivp(
            *(rate, (t, TIME[-1]), y),
            method="DOP853", args=(is_closed,), events=closing, dense_output=True,
            rtol=1e-10, atol=1e-12, max_step=STEP / 2,
        )  # fmt: skip
        motion = part.sol(np.linspace(t, part.t[-1], 2000))
        overlap = np.maximum(motion[1] - motion[3] - gap, 0.0)
        found = np.abs([*motion[:4], stop * overlap]).max(axis=1)
        if is_closed:
            rates = motion[5] - motion[7]
            force = np.abs(stop * (motion[1] - motion[3] - gap) + dashpot * rates).max()
            duration, power = part.t[-1] - t, 0.5 * (rates[1:] ** 2 + rates[:-1] ** 2)
            contacts.append((t, duration, force, dashpot * duration * np.mean(power)))
        peaks, t, y, is_closed = np.maximum(peaks, found), part.t[-1], part.y[:, -1], not is_closed
    return peaks, contacts


@pytest.mark.parametrize(
    ("law", "dashpot"),
    [
        ("", 0.0),
        (", dashpot: 500", 5e5),
        # 2 xi sqrt(k m) with xi = -ln e / sqrt(pi^2 + ln^2 e), m = 75 x 55 / 130 t
        (", restitution: 0.6", 2.0 * 0.160500 * np.sqrt(3.0e7 * 31.730769e3)),
    ],
)
def test_contact_of_adjacent_buildings(law, dashpot):
    model = load_model(io.StringIO(BUILDINGS.format(law=law)))
    response = tdint.run(model, MOTION, dt=STEP / 4, duration=TIME[-1], check=False)
    devices = response.devices.stories
    peaks = [*response.stories.peak_displacement, *devices.peak_displacement[:2]]
    right, contacts = reference(dashpot)
    assert [*peaks, devices.peak_shear[-1]] == pytest.approx(right, rel=1e-4)
    found = response.contacts
    assert [item.closing for item in found] == list(range(1, len(contacts) + 1))
    for item, (time, duration, force, energy) in zip(found, contacts, strict=True):
        assert (item.link, item.time) == ("joint", pytest.approx(time, rel=1e-4))
        assert item.duration == pytest.approx(duration, rel=1e-3, abs=1e-5)
        assert item.peak_force == pytest.approx(force, rel=2e-3)
        # The rate has a kink within the steps of a closing.
        assert item.dissipated_energy == pytest.approx(energy, rel=1e-2)
    lost = sum(energy for *_, energy in contacts)
    assert response.devices.dissipated_energy[-1] == pytest.approx(lost, rel=1e-3, abs=1e-6)


@pytest.mark.parametrize("method", ["gauss4", "moment4", "newmark-average"])
def test_methods_agree_on_pounding(method):
    model = load_model(io.StringIO(BUILDINGS.format(law="")))
    response = tdint.run(model, MOTION, method=method, dt=STEP / 10, duration=1.0, check=False)
    other = tdint.run(model, MOTION, dt=STEP / 10, duration=1.0, check=False)
    assert response.devices.stories.peak_drift == pytest.approx(
        other.devices.stories.peak_drift, rel=2e-3
    )


def test_masses_on_the_ground_are_no_part_of_the_building():
    text = BUILDINGS.format(law="")
    model = load_model(io.StringIO(text.replace("damping: none", "damping: none\np_delta: true")))
    building = assemble(model)
    bare = assemble(load_model(io.StringIO(text.partition("attachments")[0].replace("{{", "{")
        .replace("damping: none", "damping: none\np_delta: true"))))  # fmt: skip
    assert building.initial_stiffness[:2] == pytest.approx(bare.initial_stiffness)
    history = tdint.run(model, MOTION, duration=0.3, history=True, check=False).history
    inertia = -history.absolute_acceleration @ (1e3 * np.array([90.0, 75.0]))
    assert history.total_shear[:, 0] == pytest.approx(inertia)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("from: ground, to: east1", "from: ground, to: 1", "or links with a stiffness must"),
        ("stop_stiffness: 3.0e4", "stop_stiffness: 0", "stiffness: is missing"),
        (
            "to: east2, law",
            "to: east2, stiffness: 9, law",
            "a dashpot or a restitution acts in contact only",
        ),
        ("sides: negative", "sides: negative, restitution: 0.5", "either dashpot or restitution"),
        ("stiffness: 7.0e3", "elements: [{type: linear, stiffness: 7e3}, {type: gap, gap: 0.1, "
         "stop_stiffness: 1e4, restitution: 0.5}]", "possible in attachments and links only"),
    ],
)  # fmt: skip
def test_invalid_contacts(old, new, message):
    text = BUILDINGS.format(law=", dashpot: 500").replace(old, new)
    with pytest.raises(ModelError, match=message):
        load_model(io.StringIO(text))
