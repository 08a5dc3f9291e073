"""Rayleigh damping with the tangent stiffness: separately computed results, order, energy, and the
laws and methods for which it is refused."""

import math

import numpy as np
import pytest

from building_cases import Force, Law, model, noise, story
from el_centro import el_centro
from references import orders, smooth
from tdint import load_model, run
from tdint.errors import AnalysisError, ModelError
from tdint.methods.catalogue import catalogue
from tdint.model.building import assemble
from tdint.model.definition import RayleighCoefficients, RayleighRatio

METHODS = [name for name, method in catalogue().items() if method.tangent_damping]
STIFFNESS = 15791.367041742973e3
SHORT = 43864.90844928604e3

# Maximum, minimum and last drift (m) of a story of 100 t under the first 15 s of El Centro, by
# matrix exponentials with bisected branch changes: stiffness (N/m), yield forces (N), hardening,
# coefficients of the mass (1/s) and of the stiffness (s)
UNDER_EL_CENTRO = [
    (STIFFNESS, (1e5, 0.02, 1e5), 0.0, 0.0079577471545948, (0.03234, -0.0559312, 0.0117472)),
    (SHORT, (2e5, 0.03, 2e5), 0.0, 0.0047746482927569, (0.0236305, -0.011373, 0.00161219)),
    (STIFFNESS, (1.2e5, 0.02, 8e4), 0.0, 0.0079577471545948, (0.0223388, -0.111755, -0.0488777)),
]


def tangent_damped(stories, mass, stiffness, **more):
    return model(stories, damping=RayleighCoefficients(mass, stiffness, True), **more)


def bilinear(mass, stiffness, parameters):
    return story(mass, stiffness, Law("bilinear", parameters))


@pytest.mark.parametrize("case", UNDER_EL_CENTRO, ids=["equal sides", "short period", "two sides"])
@pytest.mark.parametrize("name", METHODS)
def test_bilinear_stories_under_el_centro(case, name):
    stiffness, law, mass_part, stiffness_part, expected = case
    record = el_centro()
    building = tangent_damped([bilinear(1e5, stiffness, law)], mass_part, stiffness_part)
    response = run(building, record, method=name, dt=record.dt / 8, check=False, history=True)
    drift = response.history.drift[:, 0]
    # The history has the drifts at the ends of the steps, the peak those between them.
    assert response.stories.peak_drift[0] == pytest.approx(max(map(abs, expected[:2])), rel=3e-6)
    assert drift[-1] == pytest.approx(expected[2], rel=2e-5)
    assert (np.max(drift), np.min(drift)) == pytest.approx(expected[:2], rel=2e-4)
    assert abs(response.energy.error) < (1e-12 if name == "moment4" else 1e-5)


def test_published_case_is_converged_at_the_sampling_interval():
    """impulse4 recomputes the acceleration after each branch change; without it, the error of the
    peak drift is 2e-5."""
    stiffness, law, _, coefficient, _ = UNDER_EL_CENTRO[0]
    building = tangent_damped([bilinear(1e5, stiffness, law)], 0.0, coefficient)
    peak = run(building, el_centro(), dt=0.02, check=False).stories.peak_drift[0]
    assert peak == pytest.approx(0.055931193, rel=1e-6)
    constant = model(
        [bilinear(1e5, stiffness, law)], damping=RayleighCoefficients(0.0, coefficient)
    )
    peak = run(constant, el_centro(), method="moment4", dt=0.0025, check=False).stories.peak_drift[
        0
    ]
    assert peak == pytest.approx(0.0464958, rel=1e-5)


@pytest.mark.parametrize("name", METHODS)
def test_order_with_a_curved_law(name):
    """The reference contains the derivative of the restoring force."""

    def acceleration(t, u, v):
        ratio = 100.0 * u / 40.0
        tangent = 100.0 / math.cosh(ratio) ** 2
        return 60.0 * math.sin(7.0 * t) - 40.0 * math.tanh(ratio) - 0.02 * tangent * v

    times = np.linspace(0.0, 2.0, 26)
    reference = smooth(acceleration, 0.0, 0.0, times)[0]
    building = tangent_damped(
        [story(1.0, 100.0, Law("tanh", (40.0,)))], 0.0, 0.02, forces=[Force(1, 0.0, 60.0, 7.0)]
    )
    errors = []
    for dt in (0.02, 0.01, 0.005):
        history = run(building, method=name, dt=dt, duration=2.0, check=False, history=True).history
        errors.append(np.max(np.abs(history.displacement[:: round(times[1] / dt), 0] - reference)))
    assert errors[-1] < 3e-6
    assert orders(errors)[-1] > 3.6


@pytest.mark.parametrize(
    "law",
    [
        Law("bilinear", (1.5e5, 0.03, 1.5e5)),
        Law("peak-oriented", (1.5e5, 0.05, 0.0)),
        Law("bouc-wen", (1.5e5, 0.05, 2.0, 0.5)),
    ],
    ids=lambda law: law.name,
)
def test_yielding_buildings_agree_between_families(law):
    building = model(
        [story(1e5, 4e7, law)] * 3, damping=RayleighRatio((0.05, 0.05), (1, 3), True), p_delta=True
    )
    record = noise(samples=201, dt=0.02, peak=4.0)
    peaks = []
    for name in METHODS:
        response = run(building, record, method=name, dt=record.dt / 16, check=False)
        assert abs(response.energy.error) < 1e-5
        stories = response.stories
        peaks.append([stories.peak_drift, stories.peak_absolute_acceleration])
    drifts, accelerations = zip(*peaks, strict=True)
    assert drifts[0] == pytest.approx(drifts[1], rel=2e-5)
    assert accelerations[0] == pytest.approx(accelerations[1], rel=5e-3)


def test_elements_share_the_damping_of_their_story():
    """Two equal elements are one story with twice the stiffness and strength."""
    half = {"type": "bilinear", "stiffness": 2e7, "yield_force": 7.5e4, "hardening": 0.03}
    whole = {"type": "bilinear", "yield_force": 1.5e5, "hardening": 0.03}
    stories = (
        {"mass": 1e5, "elements": [half, half]},
        {"mass": 1e5, "stiffness": 4e7, "law": whole},
    )
    damping = {"rayleigh": {"mass": 0.1, "stiffness": 0.005, "tangent": True}}
    record = noise(samples=201, dt=0.02, peak=4.0)
    for name in METHODS:
        drifts = [
            run({"stories": [one], "damping": damping}, record, method=name, check=False)
            for one in stories
        ]
        expected = drifts[1].stories.peak_drift
        assert drifts[0].stories.peak_drift == pytest.approx(expected, rel=1e-9)


def test_damping_dissipates_in_every_step():
    stiffness, law, _, coefficient, _ = UNDER_EL_CENTRO[0]
    building = tangent_damped([bilinear(1e5, stiffness, law)], 0.0, coefficient)
    for name in METHODS:
        history = run(
            building, el_centro(), method=name, dt=0.02, check=False, history=True
        ).history
        work = np.diff(history.energy.viscous)
        assert np.min(work) > -1e-9 * history.energy.viscous[-1]


def test_linear_stories_have_the_damping_of_the_initial_stiffness():
    record = noise(samples=101)
    stories = [story(2e5, 4e7)] * 2
    tangent, initial = (
        run(model(stories, damping=RayleighRatio((0.05, 0.05), (1, 2), flag)), record, check=False)
        for flag in (True, False)
    )
    assert np.array_equal(tangent.stories.peak_drift, initial.stories.peak_drift)


def test_first_mode_has_the_damping_of_the_initial_stiffness():
    stories = [story(2e5, 4e7, Law("bilinear", (1e5, 0.02, 1e5)))] * 3
    ratios = [
        assemble(model(stories, damping=RayleighRatio((0.05, 0.05), (1, 3), flag))).first_mode()
        for flag in (True, False)
    ]
    assert ratios[0] == pytest.approx(ratios[1], rel=1e-12)


@pytest.mark.parametrize("name", [name for name in catalogue() if name not in METHODS])
def test_other_methods_refuse_tangent_damping(name):
    building = tangent_damped([bilinear(1.0, 100.0, (1.0, 0.1, 1.0))], 0.0, 0.01, velocity=[1.0])
    with pytest.raises(AnalysisError, match="use one of impulse4, moment4"):
        run(building, method=name, dt=0.01, duration=0.1)


TEXT = """
stories:
  - {{mass: 1, height: 3, stiffness: 100, law: {law}}}
damping: {{rayleigh: {{mass: 0.1, stiffness: 0.01, tangent: true}}}}
"""


@pytest.mark.parametrize(
    "law",
    [
        "{type: bilinear, yield_force: 1, hardening: -0.05}",
        "{type: polynomial, coefficients: [100, 0, -3]}",
        "{type: multilinear, rule: peak, backbone: [[0.01, 1], [0.03, 1.5], [0.06, 0.8]]}",
    ],
)
def test_laws_with_a_negative_stiffness_are_refused(tmp_path, law):
    path = tmp_path / "model.yaml"
    path.write_text(TEXT.format(law=law), encoding="utf-8")
    with pytest.raises(ModelError, match="story 1 can be negative"):
        load_model(path)
    path.write_text(TEXT.format(law=law).replace("true", "false"), encoding="utf-8")
    assert load_model(path).damping == RayleighCoefficients(0.1, 0.01)
