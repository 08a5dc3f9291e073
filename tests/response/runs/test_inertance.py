"""Inerters in stories, attachments and links of linear models."""

import copy

import numpy as np
import pytest

import tdint
from el_centro import el_centro
from tdint.errors import AnalysisError, ModelError
from tdint.ground_motion.record import Record

UNITS = {"length": "m", "force": "N", "mass": "kg"}
FRAME = {
    "units": UNITS,
    "stories": [
        {"mass": 1e5, "height": 3, "stiffness": 6e7},
        {"mass": 9e4, "height": 3, "stiffness": 5e7, "dashpot": 2e5},
        {"mass": 8e4, "height": 3, "stiffness": 4e7},
    ],
    "damping": {"rayleigh": {"ratio": 0.04, "modes": [1, 2]}},
    "p_delta": True,
    "attachments": [{"name": "tmd", "floor": 2, "mass": 3e3, "stiffness": 8e5, "dashpot": 8e3}],
    "links": [{"name": "brace", "from": 1, "to": 3, "stiffness": 5e6, "dashpot": 1e5}],
}
TMDI = {
    "units": UNITS,
    "stories": [
        {"mass": 2e5, "stiffness": stiffness} for stiffness in (2.5e8, 2.5e8, 2.2e8, 2.0e8, 1.8e8)
    ],
    "damping": {"rayleigh": {"ratio": 0.02, "modes": [1, 2]}},
    "attachments": [
        {
            "name": "tmdi",
            "floor": "roof",
            "mass": 4e3,
            "inertance": 2e4,
            "stiffness": 1992080.952,
            "dashpot": 52477.16369,
        }
    ],
}
IN_STORY_2 = {
    "units": UNITS,
    "stories": [{"mass": 1e5, "stiffness": stiffness} for stiffness in (6e7, 5e7, 4e7)],
    "damping": {"rayleigh": {"ratio": 0.04, "modes": [1, 2]}},  # modes without the inerter
    "links": [{"name": "inerter", "from": 1, "to": 2, "inertance": 8e4}],
}
TID = {
    "stories": [{"repeat": 5, "mass": 1e3, "stiffness": 1e6}],
    "damping": {"rayleigh": {"mass": 0.09000780676, "stiffness": 0.00111101474}},
    "attachments": [
        {
            "name": "tid",
            "floor": 1,
            "inertance": 500,
            "stiffness": 41656.90949,
            "dashpot": 780.1897127,
        }
    ],
    "excitation": {
        "forces": [{"floor": 5, "amplitude": 1000, "omega": 9.000780676, "phase": "sin"}]
    },
}
METHODS = {"exact": 0.02, "impulse4": 0.005, "moment4": 0.005, "gauss4": 0.005}
METHODS["newmark-average"] = 0.0005


@pytest.mark.parametrize(("method", "step"), METHODS.items())
def test_mass_damper_with_an_inerter_to_the_ground(method, step):
    # Matrix exponential and DOP853 agree to seven digits (El Centro, 31.18 s).
    response = tdint.run(TMDI, el_centro(duration=31.18), method=method, dt=step, duration=31.18)
    devices = response.devices
    tolerance = 2e-5 if method == "newmark-average" else 2e-6
    assert response.stories.peak_drift[0] == pytest.approx(0.0207307, rel=tolerance)
    assert response.stories.peak_displacement[4] == pytest.approx(0.09187659, rel=tolerance)
    assert devices.stories.peak_drift[0] == pytest.approx(0.2078022, rel=tolerance)
    assert devices.inerter_force[0] == pytest.approx(353714.2, rel=tolerance)
    assert devices.stories.peak_absolute_acceleration[0] == pytest.approx(19.25001, rel=1e-5)
    assert devices.dissipated_energy[0] == pytest.approx(504080.3, rel=1e-5)
    assert response.energy.input == pytest.approx(725141.8, rel=1e-5)
    assert abs(response.energy.error) < 5e-6
    # The true error is within the estimate.
    assert abs(devices.inerter_force[0] - 353714.2) <= devices.inerter_force_error[0] + 0.05


def test_inerter_between_two_floors():
    inerter_in_story = copy.deepcopy(IN_STORY_2)
    del inerter_in_story["links"]
    inerter_in_story["stories"][1]["inertance"] = 8e4
    motion = el_centro(duration=31.18)
    for model in (IN_STORY_2, inerter_in_story):
        response = tdint.run(model, motion, duration=31.18, check=False)
        stories = response.stories
        assert response.method == "exact"
        assert stories.peak_drift == pytest.approx((0.03399496, 0.03844828, 0.02237307), rel=1e-6)
        acceleration = stories.peak_absolute_acceleration
        assert acceleration == pytest.approx((8.083706, 6.122147, 8.968529), rel=1e-6)
        assert stories.peak_total_shear[1] == pytest.approx(1455659.0, rel=1e-6)
        # The restoring force does not contain the force of the inerter.
        assert stories.peak_shear[1] == pytest.approx(5e7 * 0.03844828, rel=1e-6)
        assert response.energy.viscous == pytest.approx(215532.8, rel=5e-5)
        modes = tdint.modes(model)
        assert modes.frequency == pytest.approx((1.578937, 3.934013, 4.40924), rel=1e-6)
        assert modes.mass_ratio.sum() == pytest.approx(1.0)
        matrices = tdint.matrices(model)
        expected = np.diag([1e5] * 3) + 8e4 * np.array([[1, -1, 0], [-1, 1, 0], [0, 0, 0]])
        assert np.array_equal(matrices.mass, expected)
    force = tdint.run(IN_STORY_2, motion, duration=31.18).devices.inerter_force
    assert force == pytest.approx([532424.4], rel=1e-6)


def test_tuned_inerter_damper_without_a_mass():
    # Forces are linear within a step.
    response = tdint.run(TID, dt=0.0005, duration=30, check=False)
    displacement = response.stories.peak_displacement
    assert displacement[[0, 4]] == pytest.approx((0.01313871, 0.04413494), rel=5e-6)
    assert response.devices.stories.peak_drift == pytest.approx([0.07192033], rel=5e-6)
    assert response.devices.inerter_force == pytest.approx([3038.082], rel=5e-6)


@pytest.mark.parametrize(
    "method",
    ["newmark-average", "gauss4", "impulse4", "impulse4:rho_inf=0.5", "moment4:rho_inf=0.2"],
)
def test_step_is_that_of_the_compiled_method(method):
    motion = el_centro(duration=4.0)
    with_inerter = copy.deepcopy(FRAME)
    with_inerter["stories"][0]["inertance"] = 1e-6  # negligible: other time loop, same numbers
    own, other = (
        tdint.run(model, motion, method=method, dt=0.01, duration=4.0, check=False, history=True)
        for model in (with_inerter, FRAME)
    )
    for name in ("displacement", "velocity", "total_shear", "damper_force", "shear"):
        values, expected = getattr(own.history, name), getattr(other.history, name)
        np.testing.assert_allclose(values, expected, rtol=0, atol=1e-9 * np.abs(expected).max())
    for name in ("displacement", "drift", "damper_force"):
        values, expected = (getattr(run.history.devices, name) for run in (own, other))
        scale = np.abs(expected).max()
        tolerance = 1e-9 * scale
        part = slice(1) if name == "displacement" else slice(None)
        np.testing.assert_allclose(values[:, part], expected[:, part], rtol=0, atol=tolerance)
    for name in ("input", "kinetic", "strain", "viscous", "dampers"):
        value, expected = getattr(own.energy, name), getattr(other.energy, name)
        assert value == pytest.approx(expected, abs=2e-4 * other.energy.input)
    assert own.devices.dissipated_energy == pytest.approx(other.devices.dissipated_energy, rel=1e-3)


def test_sets_of_runs_have_the_same_numbers_as_single_runs():
    motion = el_centro(duration=4.0)
    single = tdint.run(IN_STORY_2, motion, duration=4.0, check=False)
    several = tdint.run_many(IN_STORY_2, [motion, motion], duration=4.0)
    assert np.array_equal(several.stories.peak_drift[1], single.stories.peak_drift)


def test_inerter_to_the_ground_is_a_mass_with_a_force():
    """An inerter to the ground is a mass of the floor with a force."""
    time = 0.01 * np.arange(101)
    motion = Record(3.0 * np.sin(9.0 * time), 0.01, "", "", "", "motion")
    story = {"mass": 9e4, "height": 3.0, "stiffness": 9e6, "dashpot": 8e4}
    model = {"stories": [story, story], "damping": "none"}
    inerter = {**model, "links": [{"from": "ground", "to": 2, "inertance": 3e4}]}
    points = [
        [t, 3e4 * a] for t, a in zip(time.tolist(), motion.acceleration.tolist(), strict=True)
    ]
    mass = {
        **model,
        "stories": [story, {**story, "mass": 12e4}],
        "excitation": {"forces": [{"floor": 2, "points": points}]},
    }
    runs = [
        tdint.run(tdint.load_model(each), motion, method="impulse4", duration=1.0, check=False)
        for each in (inerter, mass)
    ]
    first, second = (run.stories.peak_drift for run in runs)
    assert first == pytest.approx(second, rel=1e-8)


def test_other_methods_are_refused():
    motion = el_centro(duration=4.0)
    message = "hht does not support inertance; use one of impulse4, moment4, newmark-average"
    with pytest.raises(AnalysisError, match=message):
        tdint.run(IN_STORY_2, motion, method="hht", duration=4.0)
    with pytest.raises(AnalysisError, match=r"at most the sampling interval, 0.02 s"):
        tdint.run(IN_STORY_2, motion, method="gauss4", dt=0.04, duration=4.0, check=False)


def test_period_and_damping_of_an_attachment_contain_its_inertance():
    model = copy.deepcopy(TMDI)
    model["attachments"] = [
        {"floor": 5, "mass": 4e3, "inertance": 2e4, "period": 0.6896592, "damping": 0.12}
    ]
    spring = tdint.load_model(model).attachments[0].spring
    assert spring.stiffness == pytest.approx(2.4e4 * (2 * np.pi / 0.6896592) ** 2)
    assert spring.dashpot == pytest.approx(0.24 * np.sqrt(spring.stiffness * 2.4e4))


def test_response_spectrum_analysis_loads_only_the_masses():
    # One mode: Gamma = phi m / (phi^2 (m + b)) and the force of the spring is m Sa.
    model = {
        "units": UNITS,
        "stories": [{"mass": 1e5, "height": 3, "stiffness": 6e7, "inertance": 5e4}],
    }
    spectrum = tdint.response_spectrum_analysis(model, "asce7:sds=1,sd1=0.6,tl=8")
    period = 2 * np.pi * np.sqrt(1.5e5 / 6e7)
    assert tdint.modes(model).period == pytest.approx([period])
    bare = tdint.response_spectrum_analysis(
        {**model, "stories": [{"mass": 1e5, "height": 3, "stiffness": 4e7}]},
        "asce7:sds=1,sd1=0.6,tl=8",
    )
    assert spectrum.shear_cqc == pytest.approx(bare.shear_cqc)


def test_inertance_of_weights_needs_the_unit_of_mass():
    model = {
        "units": {"length": "m", "force": "kN"},
        "stories": [{"weight": 980.665, "stiffness": 6e4, "inertance": 5}],
    }
    with pytest.raises(ModelError, match=r"stories\[1\].inertance: the unit of mass is required"):
        tdint.load_model(model)
    with pytest.raises(ModelError, match=r"inertance: must be a positive number, got '-5'"):
        tdint.load_model(
            {"units": UNITS, "stories": [{"mass": 1, "stiffness": 60, "inertance": -5}]}
        )
