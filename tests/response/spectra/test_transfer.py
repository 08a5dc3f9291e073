"""Tests of transfer functions: closed forms, a state-space model of dampers with braces, modal
superposition, and the Fourier transforms of a run."""

import math

import numpy as np
import pytest

import tdint
from tdint.errors import ModelError, UsageError
from tdint.ground_motion.record import Record
from tdint.response.spectra.transfer import _DynamicStiffness, transfer_function

MASS, STIFFNESS = 1000.0, 4e5  # natural circular frequency 20 rad/s


def building(*stories, **keys):
    """Return a model file as a mapping, with stories of the given keys."""
    return {"name": "test", "stories": list(stories), **keys}


def oscillator(damping):
    """Return a story with a dashpot of this damping ratio."""
    omega = math.sqrt(STIFFNESS / MASS)
    return building({"mass": MASS, "stiffness": STIFFNESS, "dashpot": 2.0 * damping * omega * MASS})


@pytest.mark.parametrize("damping", [0.0, 0.02, 0.3])
def test_one_story_has_the_closed_form(damping):
    """With r = w / w_n, the transmissibility is (1 + 2 i zeta r) / (1 - r^2 + 2 i zeta r), and the
    compliance 1 / k over the same denominator. Their maximum is at r < 1."""
    r = np.array([1e-3, 0.5, 0.99, 1.5, 30.0])
    frequency = r * 20.0 / (2.0 * math.pi)
    denominator = 1.0 - r**2 + 2j * damping * r
    ground = transfer_function(oscillator(damping), frequency=frequency)
    assert ground.response[:, 0] == pytest.approx((1.0 + 2j * damping * r) / denominator, rel=1e-10)
    force = transfer_function(oscillator(damping), frequency, source=1)
    assert force.response[:, 0] == pytest.approx(1.0 / STIFFNESS / denominator, rel=1e-10)
    assert ground.is_damped == force.is_damped == (damping > 0.0)
    # A positive frequency delays the response: the phase is between -180 and 0 degrees.
    assert np.all(force.phase <= 0.0) and force.phase[0, 0] == pytest.approx(0.0, abs=0.1)


def state_space(frequency, mass, stiffness, dashpot, brace, damper):
    """Return the transfer functions of two stories from (i w - A) x = b, with the forces of the
    braced dampers as states: f' = k_b (v - f / c)."""
    relative = np.array([[1.0, 0.0], [-1.0, 1.0]])  # drifts from displacements
    inverse = np.diag(1.0 / np.array(mass))
    A = np.zeros((6, 6))
    A[:2, 2:4] = np.eye(2)
    A[2:4, :2] = -inverse @ relative.T @ np.diag(stiffness) @ relative
    A[2:4, 2:4] = -inverse @ relative.T @ np.diag(dashpot) @ relative
    A[2:4, 4:] = -inverse @ relative.T
    A[4:, 2:4] = np.diag(brace) @ relative
    A[4:, 4:] = -np.diag(np.array(brace) / np.array(damper))
    loads = np.zeros((6, 2))
    loads[2:4, 0] = -1.0  # ground acceleration
    loads[2:4, 1] = inverse[:, 1]  # force on floor 2
    ground, force = [], []
    for omega in 2.0 * math.pi * frequency:
        x = np.linalg.solve(1j * omega * np.eye(6) - A, loads)
        ground.append(1.0 - omega**2 * x[:2, 0])
        force.append(x[:2, 1])
    return np.array(ground), np.array(force)


def test_braced_dampers_and_dashpots_agree_with_a_state_space_model():
    frequency = np.geomspace(0.1, 30.0, 60)
    keys = {"mass": (1000.0, 600.0), "stiffness": (4e5, 2e5), "dashpot": (3e3, 500.0)}
    brace, damper = (6e5, 2e5), (2e4, 9e3)
    # Story 1 has two springs and a dashpot in parallel with a braced damper: the dashpot is
    # therefore a separate damping of the model.
    stories = [
        {
            "mass": mass,
            "stiffness": stiffness,
            "dashpot": {"coefficient": c, "exponent": 1.0, "brace": k},
        }
        for mass, stiffness, c, k in zip(
            keys["mass"], keys["stiffness"], damper, brace, strict=True
        )
    ]
    model = building(*stories, damping={"rayleigh": {"mass": 0.0, "stiffness": 0.004}})
    dashpot = [0.004 * stiffness for stiffness in keys["stiffness"]]
    ground, force = state_space(frequency, keys["mass"], keys["stiffness"], dashpot, brace, damper)
    assert transfer_function(model, frequency=frequency).response == pytest.approx(ground, rel=1e-9)
    result = transfer_function(model, frequency, source=2)
    assert result.response == pytest.approx(force, rel=1e-9)
    assert result.is_damped


def test_a_dashpot_with_exponent_1_is_a_linear_dashpot():
    frequency = np.geomspace(0.5, 20.0, 30)
    story = {"mass": MASS, "stiffness": STIFFNESS}
    power = building({**story, "dashpot": {"coefficient": 6e3, "exponent": 1.0}})
    linear = building({**story, "dashpot": 6e3})
    assert transfer_function(power, frequency=frequency).response == pytest.approx(
        transfer_function(linear, frequency=frequency).response, rel=1e-12
    )


def test_displacements_for_forces_on_other_floors_are_reciprocal():
    """The displacement of floor i for a force on floor j is that of floor j for a force on floor i;
    slow forces on floor 1 move all floors by 1 / k1."""
    frequency = np.array([1e-3, 1.0, 3.0, 12.0])
    model = building(
        {"mass": 1000.0, "stiffness": 4e5, "dashpot": 3e3},
        {"mass": 600.0, "stiffness": 2e5, "dashpot": 500.0},
        {"mass": 400.0, "stiffness": 3e5},
    )
    responses = [transfer_function(model, frequency, source=floor).response for floor in (1, 2, 3)]
    for i in range(3):
        assert responses[0][0, i] == pytest.approx(1.0 / 4e5, rel=1e-4)
        for j in range(i):
            assert responses[i][:, j] == pytest.approx(responses[j][:, i], rel=1e-9)
    assert abs(responses[0][2, 2]) != pytest.approx(abs(responses[2][2, 2]), rel=0.1)


def test_the_brace_of_a_locked_damper_is_a_spring():
    """With a very large coefficient, the brace is a spring in parallel with the story."""
    frequency = np.geomspace(0.5, 20.0, 30)
    story = {"mass": MASS, "stiffness": STIFFNESS}
    stiff = building({**story, "stiffness": 1.5 * STIFFNESS})
    locked = {"coefficient": 1e12, "exponent": 1.0, "brace": 0.5 * STIFFNESS}
    assert transfer_function(
        building({**story, "dashpot": locked}), frequency=frequency
    ).response == pytest.approx(transfer_function(stiff, frequency=frequency).response, rel=1e-4)


def test_modal_damping_is_a_superposition_of_modes():
    """H = 1 + sum Gamma phi w^2 / (w_k^2 - w^2 + 2 i xi w_k w), with p-delta in the modes."""
    story = {"mass": 2e5, "height": 3.0, "stiffness": 8e7}
    model = building(story, story, story, damping={"modal": [0.02, 0.05, 0.1]}, p_delta=True)
    frequency = np.geomspace(0.1, 20.0, 40)
    modes = tdint.modes(model)
    omega = 2.0 * math.pi * frequency[:, None]
    gain = omega**2 / (
        modes.omega**2 - omega**2 + 2j * np.array([0.02, 0.05, 0.1]) * modes.omega * omega
    )
    expected = 1.0 + gain @ (modes.shapes * (modes.mass @ modes.shapes)).T
    result = transfer_function(model, frequency=frequency)
    assert result.response == pytest.approx(expected, rel=1e-9)


def test_fourier_transforms_of_a_run_have_the_same_ratio():
    """The ground motion is a pulse without frequencies near the Nyquist frequency, and the building
    comes to rest, so that the discrete transforms are those of the continuous motion."""
    dt, count = 0.005, 8192
    t = dt * np.arange(count) - 1.0
    a = (math.pi * 3.0 * t) ** 2
    record = Record((1.0 - 2.0 * a) * np.exp(-a), dt, "", "pulse", "", "pulse")
    dashpot = {"coefficient": 8e6, "exponent": 1.0, "brace": 4e7}
    story = {"mass": 2e5, "height": 3.0, "stiffness": 8e7}
    model = building({**story, "dashpot": dashpot}, {**story, "dashpot": 2e6}, damping=0.05)
    response = tdint.run(model, record, method="impulse4", history=True, check=False)
    assert np.abs(response.history.displacement[-1]).max() < 1e-9
    ratio = (
        np.fft.rfft(response.history.absolute_acceleration, axis=0)
        / np.fft.rfft(record.acceleration)[:, None]
    )
    frequency = np.fft.rfftfreq(count, dt)
    shown = (frequency > 0.5) & (frequency < 8.0)
    # Linear interpolation between the samples multiplies the transform of the ground by sinc^2.
    interpolation = np.sinc(frequency[shown] * dt)[:, None] ** 2
    expected = transfer_function(model, frequency=frequency[shown]).response * interpolation
    assert ratio[shown] == pytest.approx(expected, rel=5e-5)


@pytest.mark.parametrize("damping", [0.002, 0.05])
def test_default_frequencies_resolve_the_resonances(damping):
    """The maximum of the transmissibility is found to 1e-3, also for a narrow resonance."""
    result = transfer_function(oscillator(damping))
    r = np.sqrt(np.sqrt(1.0 + 8.0 * damping**2) - 1.0) / (2.0 * damping)
    expected = abs((1.0 + 2j * damping * r) / (1.0 - r**2 + 2j * damping * r))
    floor, frequency, amplitude = result.maxima[-1]
    assert floor == 1
    assert amplitude == pytest.approx(expected, rel=1e-3)
    assert frequency == pytest.approx(r * 20.0 / (2.0 * math.pi), rel=2e-3)
    assert np.all(np.diff(result.frequency) > 0.0)


def test_default_frequencies_contain_each_mode_of_a_tall_building():
    story = {"mass": 1000.0, "stiffness": 1e6}
    model = building(*[story] * 20, damping={"modal": 0.01})
    result, omega = transfer_function(model, source=20), tdint.modes(model).omega
    # The driving-point compliance has a maximum near each natural frequency.
    amplitude = result.amplitude[:, -1]
    inner = amplitude[1:-1]
    peaks = result.frequency[1:-1][(inner > amplitude[:-2]) & (inner > amplitude[2:])]
    for frequency in omega[:6] / (2.0 * math.pi):
        assert np.min(np.abs(peaks / frequency - 1.0)) < 0.01


def test_invalid_sources_dampers_and_frequencies_are_refused():
    model = oscillator(0.05)
    for source in (0, 2, "top", 1.5):
        with pytest.raises(UsageError, match="roof or a floor from 1 to 1"):
            transfer_function(model, source=source)
    for frequency in ([], [0.0], [math.nan]):
        with pytest.raises(UsageError, match="positive"):
            transfer_function(model, frequency=frequency)
    for brace in ({}, {"brace": 1e6}):
        dashpot = {"coefficient": 1e4, "exponent": 1.5, **brace}
        with pytest.raises(ModelError, match="story 1 has a power-law dashpot"):
            transfer_function(building({"mass": MASS, "stiffness": STIFFNESS, "dashpot": dashpot}))


def test_a_force_on_the_roof_is_a_force_on_the_highest_floor():
    model = {"stories": [{"repeat": 2, "mass": 1e5, "stiffness": 6e7}], "damping": "2%"}
    floor, roof = (tdint.transfer_function(model, [1.0, 2.0], source=s) for s in (2, "roof"))
    np.testing.assert_array_equal(floor.response, roof.response)


TREE = {
    "attachments": [
        {"name": "tmd", "floor": 4, "mass": 40.0, "stiffness": 900.0, "dashpot": 30.0},
        {"name": "tank", "floor": 2, "mass": 60.0, "stiffness": 9000.0},
        {"name": "wall", "floor": "ground", "mass": 500.0, "stiffness": 5e4, "inertance": 70.0},
    ],
    "links": [
        {"from": 1, "to": 3, "stiffness": 3e4, "dashpot": 200.0},
        {"from": "tmd", "to": "tank", "inertance": 15.0},
        {
            "from": "ground",
            "to": 4,
            "dashpot": {"coefficient": 900.0, "exponent": 1.0, "brace": 2e4},
        },
        {"from": "wall", "to": 2, "stiffness": 1e4},
    ],
}
STORY = {"mass": MASS, "height": 3.0, "stiffness": STIFFNESS, "repeat": 4}
RAYLEIGH = {"rayleigh": {"ratio": 0.03, "modes": [1, 2]}}


@pytest.mark.parametrize("source", ["ground", 3])
@pytest.mark.parametrize(
    "keys",
    [
        {"damping": RAYLEIGH},
        {"damping": {"modal": [0.03, 0.0]}},
        {"damping": {"modal": 0.03}},
        {**TREE, "damping": RAYLEIGH},
        {**TREE, "damping": {"modal": 0.03}},
        {**TREE, "p_delta": True},
    ],
)
def test_the_dynamic_stiffness_of_the_matrices(keys, source):
    """D = K + i w C + K_b - w^2 M of `tdint.matrices` gives the same response, also where a part of
    the building resonates without damping, so that a pivot of the elimination is zero."""
    model = building(STORY, plausibility="off, test", **keys)
    matrices = tdint.matrices(model)
    tank = math.sqrt(9000.0 / 60.0) / (2.0 * math.pi)  # without damping on a fixed floor
    frequency = np.array([0.1, 0.7, tank * (1.0 - 1e-9), tank, 3.0, 20.0])
    response = transfer_function(model, frequency, source=source).response
    drifts, brace, damper = matrices.braces
    for values, omega in zip(response, 2.0 * math.pi * frequency, strict=True):
        series = np.diag(1.0 / (1.0 / brace + 1.0 / (1j * omega * damper)))
        matrix = matrices.stiffness + 1j * omega * matrices.damping + drifts.T @ series @ drifts
        matrix = matrix - omega**2 * matrices.mass
        load, ground = np.eye(len(matrix))[2], 0.0
        if source == "ground":
            load, ground = omega**2 * matrices.loaded_mass @ matrices.influence, 1.0
        expected = np.linalg.solve(matrix, load) + ground
        assert values == pytest.approx(expected, rel=1e-9, abs=1e-12 * np.abs(expected).max())


@pytest.mark.parametrize("damping", [RAYLEIGH, {"modal": 0.03}])
def test_absorbers_are_eliminated_without_complete_matrices(monkeypatch, damping):
    """The operations for a frequency are then proportional to the number of absorbers."""
    monkeypatch.delattr(_DynamicStiffness, "_solved")
    absorbers = [
        {"name": f"a{i}", "floor": i % 4 + 1, "mass": 2.0, "period": 0.9 + 0.01 * i, "damping": 0.1}
        for i in range(40)
    ]
    result = transfer_function(building(STORY, attachments=absorbers, damping=damping))
    assert result.response.shape[1] == 44 and np.all(np.isfinite(result.response))
