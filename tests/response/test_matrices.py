"""Matrices and transfer functions of buildings with attachments and links: own assembly, state
space against time integration, and complex modes."""

import numpy as np
import pytest
from scipy.signal import StateSpace, lsim

import tdint
from tdint.errors import ModelError
from tdint.model.building import assemble

MASS, SPRING = np.array([1.2e5, 1.0e5, 9e4]), np.array([8e7, 7e7, 5e7])
TMD, LINK = (6e3, 9e5, 1.1e4), 2e5  # mass, stiffness and dashpot of the absorber; the link
STROKE = np.array([0.0, 0.0, -1.0, 1.0])
MODEL = {
    "stories": [
        {"mass": mass, "height": 3, "stiffness": spring}
        for mass, spring in zip(MASS, SPRING, strict=True)
    ],
    "damping": "5%",
    "attachments": [
        {"name": "tmd", "floor": 3, "mass": TMD[0], "stiffness": TMD[1], "dashpot": TMD[2]}
    ],
    "links": [{"name": "damper", "from": "ground", "to": 2, "dashpot": LINK}],
}
UNLINKED = {name: value for name, value in MODEL.items() if name != "links"}
BRACED = [{**story, "dashpot": {"coefficient": 4e5, "brace": 6e7}} for story in MODEL["stories"]]


def assembled():
    """Return mass, damping and stiffness of `MODEL` by an own assembly: the Rayleigh damping is
    that of the bare building in modes 1 and 3."""
    stiffness = np.diag(SPRING + np.append(SPRING[1:], 0.0))
    stiffness -= np.diag(SPRING[1:], 1) + np.diag(SPRING[1:], -1)
    omega = np.sqrt(np.sort(np.linalg.eigvals(stiffness / MASS[:, None]).real))
    modes = np.array([[0.5 / w, 0.5 * w] for w in omega[[0, 2]]])
    by_mass, by_stiffness = np.linalg.solve(modes, [0.05, 0.05])
    m, c, k = np.diag([*MASS, TMD[0]]), np.zeros((4, 4)), np.zeros((4, 4))
    k[:3, :3] = stiffness
    c[:3, :3] = by_mass * np.diag(MASS) + by_stiffness * stiffness
    k += TMD[1] * np.outer(STROKE, STROKE)
    c += TMD[2] * np.outer(STROKE, STROKE)
    c[1, 1] += LINK
    return m, c, k


def test_matrices_equal_own_assembly():
    found, (mass, damping, stiffness) = tdint.matrices(MODEL), assembled()
    assert found.names == ("floor_1", "floor_2", "floor_3", "tmd")
    for name, expected in (("mass", mass), ("damping", damping), ("stiffness", stiffness)):
        np.testing.assert_allclose(
            getattr(found, name), expected, rtol=1e-12, atol=1e-9 * expected.max(), err_msg=name
        )
    np.testing.assert_array_equal(found.influence, 1.0)


def test_modal_damping_is_that_of_the_bare_building():
    model = {**UNLINKED, "damping": {"modal": 0.03}}
    bare = {name: model[name] for name in ("stories", "damping")}
    expected = TMD[2] * np.outer(STROKE, STROKE)
    expected[:3, :3] += tdint.matrices(bare).damping
    np.testing.assert_allclose(tdint.matrices(model).damping, expected, rtol=1e-12, atol=1e-3)


@pytest.mark.parametrize("stories", [MODEL["stories"], BRACED], ids=["plain", "braces"])
def test_state_space_reproduces_the_time_integration(stories):
    """A record is linear between the samples, like the input of `lsim`."""
    model = {**MODEL, "stories": stories}
    time = 0.01 * np.arange(200)
    ground = 3.0 * np.sin(9.0 * time) * np.sin(0.5 * np.pi * time) ** 2
    record = tdint.make_record(ground, dt=0.01, units="m/s^2")
    history = tdint.run(
        model, record, method="impulse4", dt=0.005, history=True, check=False, duration=1.99
    ).history.every(2)
    found = tdint.matrices(model)
    inputs = np.zeros((time.size, 1 + len(found.names)))
    inputs[:, 0] = ground
    _, output, _ = lsim(StateSpace(*found.state_space()), inputs, time)
    for part, name in enumerate(("displacement", "velocity", "absolute_acceleration")):
        expected = np.hstack(
            [getattr(history, name), getattr(history.devices, name)[:, :1]]
        )  # the last device is a link
        error = np.abs(output[:, 4 * part : 4 * part + 4] - expected).max()
        assert error < 3e-4 * np.abs(expected).max(), name


def test_poles_equal_complex_modes():
    model = {**UNLINKED, "stories": BRACED}
    poles = np.linalg.eigvals(tdint.matrices(model).state_space().a)
    expected = assemble(tdint.load_model(model)).complex_modes().eigenvalues
    np.testing.assert_allclose(np.sort(poles[poles.imag > 1.0]), np.sort(expected), rtol=1e-9)


def test_static_displacement_of_a_force_is_the_flexibility():
    found = tdint.matrices(MODEL)
    a, b, _, _ = found.state_space()
    rest = -np.linalg.solve(a, b[:, 1:])[:4]
    np.testing.assert_allclose(rest, np.linalg.inv(found.stiffness), rtol=1e-8)


def test_models_of_matrices():
    matrices = {
        "names": ["deck", "pier"],
        "mass": [[2e5, 1e4], [1e4, 1e5]],
        "stiffness": [[3e7, -1e7], [-1e7, 2e7]],
        "influence": [1.0, 0.5],
    }
    found = tdint.matrices({"matrices": matrices, "damping": {"modal": 0.02}})
    assert found.names == ("deck", "pier")
    np.testing.assert_array_equal(found.mass, matrices["mass"])
    np.testing.assert_array_equal(found.influence, [1.0, 0.5])
    poles = np.linalg.eigvals(found.state_space().a)
    np.testing.assert_allclose(-poles.real / np.abs(poles), 0.02, rtol=1e-9)


def test_transfer_function_with_attachment_and_link():
    mass, damping, stiffness = assembled()
    frequency = np.array([0.4, 1.0, 1.9, 2.2, 5.0, 9.0])
    ground, force = [], []
    for omega in 2.0 * np.pi * frequency:
        dynamic = stiffness - omega**2 * mass + 1j * omega * damping
        # Mass-proportional damping acts on the motion relative to the ground.
        relative = np.linalg.solve(dynamic, mass @ np.ones(4))
        ground.append(1.0 + omega**2 * relative)
        force.append(np.linalg.solve(dynamic, [0.0, 1.0, 0.0, 0.0]))
    found = tdint.transfer_function(MODEL, frequency)
    assert found.labels == (1, 2, 3, "tmd") and found.response.shape == (6, 4)
    np.testing.assert_allclose(found.response, ground, rtol=1e-9)
    assert found.roof == found.maxima[2] and found.maxima[3].floor == "tmd"
    pushed = tdint.transfer_function(MODEL, frequency, source=2)
    np.testing.assert_allclose(pushed.response, force, rtol=1e-9)
    assert {"floor_3_phase_deg", "tmd_amplitude_m_N"} <= pushed.to_dict().keys()


def test_optimal_absorber_has_the_published_amplification():
    """Absorber of the mass ratio mu with optimal tuning and damping on an undamped mass: the
    amplification is sqrt(1 + 2 / mu) (Den Hartog 1956; the damping is the usual average)."""
    mu, mass, stiffness = 0.05, 1e5, 4e7
    tuned = stiffness * mu / (1.0 + mu) ** 2
    dashpot = 2.0 * np.sqrt(tuned * mu * mass) * np.sqrt(0.375 * mu / (1.0 + mu))
    absorber = {"name": "a", "floor": 1, "mass": mu * mass, "stiffness": tuned, "dashpot": dashpot}
    model = {
        "stories": [{"mass": mass, "stiffness": stiffness}],
        "damping": "none",
        "attachments": [absorber],
    }
    found = tdint.transfer_function(model, source=1).maxima[0].amplitude * stiffness
    assert found == pytest.approx(np.sqrt(1.0 + 2.0 / mu), rel=0.01)


def test_power_law_dampers_are_refused_by_name():
    dashpot = {"coefficient": 1e5, "exponent": 2}
    link = {"name": "damper", "from": 1, "to": 3, "dashpot": dashpot}
    for call in (tdint.matrices, tdint.transfer_function):
        with pytest.raises(ModelError, match=r"damper has a power-law dashpot.*exponent 1"):
            call({**MODEL, "links": [link]})


@pytest.mark.parametrize("dashpot", [{"brace": 9e5}, {}], ids=["braced", "exponent 1"])
def test_dampers_beside_an_inerter(dashpot):
    """A mass of 700 kg with an inerter of 300 kg to the ground and a mass of 1000 kg have equal
    damped modes and responses per force. Formerly, the damper had no effect."""
    damper = {"coefficient": 9e3, "exponent": 1.0, **dashpot}
    story = {"mass": 1000.0, "stiffness": 4e5, "dashpot": damper}
    inerter = {"from": "ground", "to": 1, "inertance": 300.0}
    one = tdint.load_model({"stories": [story]})
    other = tdint.load_model({"stories": [story | {"mass": 700.0}], "links": [inerter]})
    values, expected = (assemble(model).complex_modes().eigenvalues for model in (other, one))
    assert values == pytest.approx(expected, rel=1e-12)
    assert expected.real < -1.0
    frequency = np.array([1.0, 3.0, 9.0])
    values, expected = (
        tdint.transfer_function(model, frequency, source=1).response for model in (other, one)
    )
    assert values == pytest.approx(expected, rel=1e-12)
    values, expected = (np.linalg.eigvals(tdint.matrices(m).state_space().a) for m in (other, one))
    assert np.sort(values) == pytest.approx(np.sort(expected), rel=1e-9)
