"""Inerters in buildings with laws that are not linear, by the compiled time loop."""

import copy

import numpy as np
import pytest

import tdint
from el_centro import el_centro
from tdint.errors import AnalysisError
from tdint.ground_motion.record import Record

UNITS = {"length": "m", "force": "N", "mass": "kg"}
YIELD_FORCES, STIFFNESSES, MASSES = (5e5, 4e5, 3e5), (6e7, 5e7, 4e7), (1e5, 1e5, 9e4)
STORIES = [
    {
        "mass": mass,
        "height": 3,
        "stiffness": stiffness,
        "law": {"type": "bilinear", "yield_force": force, "hardening": 0.05},
    }
    for mass, stiffness, force in zip(MASSES, STIFFNESSES, YIELD_FORCES, strict=True)
]
INERTANCES = (3e4, 5e4, 2e4)
REFERENCE = {
    "units": UNITS,
    "stories": STORIES,
    "damping": {"rayleigh": {"ratio": 0.05, "modes": [1, 2]}},  # modes without the inerters
    "links": [
        {"from": start, "to": start + 1 if start != "ground" else 1, "inertance": inertance}
        for start, inertance in zip(("ground", 1, 2), INERTANCES, strict=True)
    ],
}
BRANCHED = {
    "units": UNITS,
    "stories": [STORIES[0], {**STORIES[1], "inertance": 5e4}, STORIES[2]],
    "damping": {"rayleigh": {"mass": 0.4, "stiffness": 2e-3}},
    "p_delta": True,
    "attachments": [
        {"name": "tid", "floor": 1, "inertance": 2e4, "stiffness": 4e6, "dashpot": 6e4},
        {
            "name": "tmdi",
            "floor": "roof",
            "mass": 5e3,
            "inertance": 1e4,
            "stiffness": 2e6,
            "dashpot": 2e4,
            "law": {"type": "bilinear", "yield_force": 8e4, "hardening": 0.1},
        },
    ],
    "links": [
        {"name": "grounded", "from": "ground", "to": 2, "inertance": 3e4},
        {
            "name": "brace",
            "from": 1,
            "to": 3,
            "inertance": 2e4,
            "stiffness": 5e6,
            "dashpot": 1e5,
            "law": {"type": "bilinear", "yield_force": 5e4, "hardening": 0.02},
        },
    ],
    "excitation": {"forces": [{"floor": 2, "amplitude": 1e5, "omega": 9.0, "phase": "sin"}]},
}


def in_stories():
    """Return the reference model with the inerters in the stories instead of links."""
    stories = [
        {**story, "inertance": inertance}
        for story, inertance in zip(STORIES, INERTANCES, strict=True)
    ]
    return {**{key: REFERENCE[key] for key in ("units", "damping")}, "stories": stories}


@pytest.mark.long
@pytest.mark.parametrize("model", [REFERENCE, in_stories()], ids=["links", "stories"])
@pytest.mark.parametrize(
    ("method", "step"), [("impulse4", 0.005), ("gauss4", 0.00125), ("newmark-average", 0.0005)]
)
def test_three_bilinear_stories_with_an_inerter_in_each(model, method, step):
    # An event-driven matrix exponential and leapfrog agree to seven digits (El Centro, 31.18 s).
    motion = el_centro(duration=31.18)
    response = tdint.run(model, motion, method=method, dt=step, duration=31.18, check=False)
    stories = response.stories
    assert stories.peak_drift == pytest.approx((0.0264794, 0.02654989, 0.009030094), rel=1e-4)
    assert stories.peak_shear == pytest.approx((554438.2, 446374.7, 303060.2), rel=1e-4)
    assert stories.peak_displacement[2] == pytest.approx(0.05704408, rel=1e-4)
    assert stories.residual_drift[0] == pytest.approx(-0.001563491, rel=1e-4)
    assert abs(response.energy.error) < 1e-5


# Results of central differences with return mapping, steps of 0.1 and 0.2 ms extrapolated: initial
# motion, and a power-law dashpot without initial motion
SECOND_SOLVER = {
    "initial": {
        "drift": (0.031232447, 0.027836203, 0.0099359035),
        "shear": (568697.34, 449590.51, 304871.81),
        "displacement": (0.031232447, 0.053236891, 0.060423238),
        "acceleration": (4.4964261, 2.7238583, 3.8913087),
        "total_shear": (559930.07, 442056.28, 351017.66),
        "device_drift": (0.020878654, 0.059771158, 0.053236891, 0.034961008),
        "device_acceleration": (6.1575986, 6.8239453),
        "inerter_force": (85822.929, 67877.432, 115017.65, 105279.74),
        "kinetic": 3424.035,
        "input": 110055.35,
    },
    "power": {
        "drift": (0.01852252, 0.021399217, 0.0079361325),
        "shear": (530567.56, 433498.04, 300872.26),
        "displacement": (0.01852252, 0.033883866, 0.039426827),
        "acceleration": (3.5949594, 2.6309218, 3.3716326),
        "total_shear": (636843.93, 473354.16, 315658.8),
        "device_drift": (0.019381302, 0.060937912, 0.033883866, 0.023683546),
        "device_acceleration": (6.0862838, 6.7627179),
        "inerter_force": (79420.021, 67700.536, 108462.54, 74840.764),
        "kinetic": 3581.3023,
        "input": 99922.186,
    },
}


def branched(variant):
    """Return the branched building with initial motion, or with a power-law dashpot."""
    model = copy.deepcopy(BRANCHED)
    if variant == "initial":
        model["initial"] = {"displacement": [0.004, 0.006, 0.01], "velocity": [0.2, 0.3, 0.5]}
    else:
        dashpot = {"coefficient": 2e5, "exponent": 0.5, "linear_below": 0.01}
        model["stories"][0]["dashpot"] = dashpot
    return model


@pytest.mark.parametrize("variant", ["initial", "power"])
@pytest.mark.parametrize(
    ("method", "step", "tolerance"),
    [
        pytest.param("impulse4", 0.005, 1e-4, id="impulse4"),
        pytest.param("gauss4", 0.0025, 4e-4, id="gauss4", marks=pytest.mark.long),
        pytest.param("newmark-average", 0.001, 6e-4, id="newmark", marks=pytest.mark.long),
    ],
)
def test_grounded_and_tuned_inerters_on_a_bilinear_building(variant, method, step, tolerance):
    expected = SECOND_SOLVER[variant]
    response = tdint.run(
        branched(variant), el_centro(duration=6), method=method, dt=step, duration=6, check=False
    )
    stories, devices = response.stories, response.devices
    found = {
        "drift": stories.peak_drift,
        "shear": stories.peak_shear,
        "displacement": stories.peak_displacement,
        "acceleration": stories.peak_absolute_acceleration,
        "total_shear": stories.peak_total_shear,
        "device_drift": devices.stories.peak_drift,
        "device_acceleration": devices.stories.peak_absolute_acceleration[:2],
        "inerter_force": devices.inerter_force,
        "kinetic": response.energy.kinetic,
        "input": response.energy.input,
    }
    for name, values in found.items():
        assert values == pytest.approx(expected[name], rel=tolerance), name
    assert abs(response.energy.error) < (1e-6 if method == "impulse4" else 2e-5)


def test_errors_of_inerter_forces_are_estimated():
    exact = np.array(SECOND_SOLVER["initial"]["inerter_force"])
    response = tdint.run(
        branched("initial"), el_centro(duration=6), method="impulse4", dt=0.02, duration=6
    )
    error = np.abs(response.devices.inerter_force - exact)
    assert np.all(error <= response.devices.inerter_force_error)
    assert np.all(response.devices.inerter_force_error < 0.02 * exact)


@pytest.mark.parametrize("method", ["impulse4", "gauss4", "newmark-average", "central-difference"])
def test_negligible_inerters_change_nothing(method):
    bare = copy.deepcopy(BRANCHED)
    del bare["links"][0], bare["attachments"][0]
    bare["damping"] = {"modal": {"ratio": 0.05}}
    bare["stories"][1]["law"]["fracture_drift"] = 0.01
    for part in (bare["stories"][1], bare["attachments"][0], bare["links"][0]):
        del part["inertance"]
    with_inerters = copy.deepcopy(bare)
    for part in ("stories", "attachments", "links"):
        with_inerters[part][0]["inertance"] = 1e-6
    own, other = (
        tdint.run(
            model,
            el_centro(duration=3.0),
            method=method,
            dt=0.01,
            duration=3.0,
            check=False,
            history=True,
        )
        for model in (with_inerters, bare)
    )
    assert other.stories.peak_drift[1] > 0.01
    for name in ("displacement", "velocity", "absolute_acceleration", "total_shear", "shear"):
        values, expected = getattr(own.history, name), getattr(other.history, name)
        np.testing.assert_allclose(values, expected, rtol=0, atol=1e-8 * np.abs(expected).max())
    for name in ("peak_drift", "peak_absolute_acceleration", "peak_total_shear", "peak_velocity"):
        values, expected = getattr(own.stories, name), getattr(other.stories, name)
        assert values == pytest.approx(expected, rel=1e-8)
    for name in ("peak_drift", "peak_shear"):
        values, expected = getattr(own.devices.stories, name), getattr(other.devices.stories, name)
        assert values == pytest.approx(expected, rel=1e-8)


def test_curved_laws_have_the_same_results_with_other_methods():
    curved = {"type": "bouc-wen", "yield_force": 4e5, "hardening": 0.05, "exponent": 2, "beta": 0.5}
    model = copy.deepcopy(BRANCHED)
    for story in model["stories"]:
        story["law"] = curved
    del model["attachments"][1]["law"], model["links"][1]["law"]
    first, other = (
        tdint.run(
            model, el_centro(duration=4.0), method=method, dt=0.005, duration=4.0, check=False
        )
        for method in ("impulse4", "gauss4")
    )
    assert other.stories.peak_drift == pytest.approx(first.stories.peak_drift, rel=1e-4)
    assert other.devices.inerter_force == pytest.approx(first.devices.inerter_force, rel=1e-4)
    assert max(abs(first.energy.error), abs(other.energy.error)) < 1e-6


def test_history_has_the_peak_total_shear():
    response = tdint.run(
        BRANCHED, el_centro(duration=4.0), dt=0.0025, duration=4.0, check=False, history=True
    )
    found = np.abs(response.history.total_shear).max(axis=0)
    assert found == pytest.approx(response.stories.peak_total_shear, rel=1e-3)


def test_sets_of_runs_and_steps_have_the_numbers_of_a_run():
    motion = el_centro(duration=3.0)
    model = {key: value for key, value in BRANCHED.items() if key != "excitation"}
    single = tdint.run(model, motion, dt=0.02, duration=3.0, check=False, history=True)
    assert single.method == "impulse4"
    several = tdint.run_many(model, [motion, motion], dt=0.02, duration=3.0)
    assert np.array_equal(several.stories.peak_drift[1], single.stories.peak_drift)
    stepper = tdint.Stepper(model, "impulse4", 0.02)
    for value in motion.acceleration[1:]:
        stepper.step(value)
    assert np.array_equal(stepper.state.displacement, single.history.displacement[-1])


def test_continued_run_starts_with_the_force_of_the_inerter():
    model = {key: value for key, value in BRANCHED.items() if key != "excitation"}
    first = tdint.run(
        model, el_centro(duration=3.0), dt=0.02, duration=3.0, check=False, history=True
    )
    history = first.history
    relative = history.devices.absolute_acceleration[-1, 0] - history.ground_acceleration[-1]
    at_start = 2e4 * abs(relative)
    ground = Record(np.full(3, history.ground_acceleration[-1]), 0.02, "", "", "", "motion")
    second = tdint.run(
        model, ground, initial=first.final_state, dt=0.02, duration=0.02, check=False
    )
    assert second.devices.inerter_force[0] == pytest.approx(at_start, rel=1e-12)
    assert second.devices.inerter_force[0] < 0.9 * first.devices.inerter_force[0]


OTHERS = (
    "impulse4, newmark, newmark-average, newmark-linear, fox-goodwin, central-difference, hht, "
    "wbz, generalized-alpha, collocation, wilson, u0v0, gauss4"
)


@pytest.mark.parametrize("method", ["moment4", "bathe", "exact", "rk5", "kr-alpha"])
def test_other_methods_are_refused(method):
    message = f"^{method} does not support inertance with a law that is not linear; use one of "
    with pytest.raises(AnalysisError, match=message + OTHERS):
        tdint.run(REFERENCE, el_centro(duration=1.0), method=method, duration=1.0, check=False)


@pytest.mark.parametrize(
    ("change", "step", "message"),
    [
        ({}, 0.04, "time step of at most the sampling interval, 0.02 s; use a shorter"),
        (
            {"damping": {"rayleigh": {"ratio": 0.05, "modes": [1, 2], "tangent": True}}},
            0.02,
            "does not support inertance together with braces of dampers",
        ),
        (
            {"excitation": {"forces": [{"floor": 2, "points": [[0, 0], [0.013, 1e5]]}]}},
            0.02,
            "has no forces from tables, pulses or files; use harmonic forces",
        ),
    ],
)
def test_unsupported_loads_and_dampers_are_refused(change, step, message):
    model = {**REFERENCE, **change}
    with pytest.raises(AnalysisError, match=message):
        tdint.run(model, el_centro(duration=1.0), dt=step, duration=1.0, check=False)
