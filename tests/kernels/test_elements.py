"""Stories with several elements: springs in parallel, each with its own law.

The expected values are closed forms (Masing's rules), or follow from the law of a story with one
element: two halves of a law are the law.
"""

import math
from itertools import pairwise

import numpy as np
import pytest

from building_cases import noise
from selection import every
from small_buildings import BUILDINGS, LAWS, MASS, MOTION, STIFFNESS, STRENGTH, YIELD_DRIFT
from tdint import load_model, make_record, run, run_many
from tdint.errors import ModelError
from tdint.kernels.laws import LAWS as NUMBERED_LAWS
from tdint.model.building import assemble
from tdint.model.definition import simple_model
from tdint.model.story import Element, Story
from tdint.model.story_laws import CODES, SUM_OF_ELEMENTS
from tdint.response.static.cyclic import follow_path

BILINEAR = {"type": "bilinear", "stiffness": STIFFNESS, "yield_force": STRENGTH, "hardening": 0.05}
STOP = {"type": "gap", "gap": 2.0 * YIELD_DRIFT, "stop_stiffness": 3.0 * STIFFNESS}
BOUC_WEN = {**LAWS["bouc-wen"], "stiffness": STIFFNESS}


def building(*elements, stories=1, **more):
    """Return a model with equal stories of several elements."""
    story = {"mass": MASS, "height": 3.0, "elements": list(elements)}
    return load_model({"stories": [story] * stories, "collapse_drift": 0.9, **more})


def masing(backbone, path):
    """Return the forces of a backbone curve (drift -> force for positive drifts) along a path by
    Masing's rules: branches are the backbone curve enlarged by two, and a closed loop is forgotten.
    """
    forces, turns, direction, previous = [], [], 0.0, 0.0
    for drift in path:
        new_direction = math.copysign(1.0, drift - previous)
        if direction and new_direction != direction:
            turns.append((previous, forces[-1]))
        direction, previous = new_direction, drift
        while len(turns) > 1 and direction * drift >= direction * turns[-2][0]:
            del turns[-2:]
        if len(turns) == 1 and abs(drift) > abs(turns[0][0]):
            turns = []
        start, force = turns[-1] if turns else (0.0, 0.0)
        scale = 2.0 if turns else 1.0
        step = (drift - start) / scale
        forces.append(force + scale * math.copysign(backbone(abs(step)), step))
    return np.array(forces)


def test_two_bilinear_springs_are_a_trilinear_law_with_masing_rules():
    model = building(
        {"type": "bilinear", "stiffness": 12e6, "yield_force": 120e3, "hardening": 0.0},
        {"type": "bilinear", "stiffness": 6e6, "yield_force": 180e3, "hardening": 0.05},
    )
    turns = [0.0, 0.05, -0.05, 0.05, 0.02, 0.045, -0.08]
    path = np.concatenate([np.linspace(a, b, 41)[1:] for a, b in pairwise(turns)])

    def backbone(drift):
        steps = np.diff(np.clip([0.0, 0.01, 0.03, 1.0], 0.0, drift))
        return float(steps @ [18e6, 6e6, 0.3e6])

    result = follow_path(assemble(model), 1, path)
    assert result.shear == pytest.approx(masing(backbone, path), abs=1e-6)
    work = np.sum(
        0.5 * np.diff(np.append(0.0, path)) * (result.shear + np.append(0.0, result.shear[:-1]))
    )
    # The trapezoidal rule is exact except in the intervals with kinks.
    energy = result.strain_energy[-1] + result.hysteretic_energy[-1]
    assert energy == pytest.approx(work, rel=2e-3)


def halves(definition):
    """Return a story with a law, and the law as two elements, each with half of all forces."""
    law = NUMBERED_LAWS[CODES[definition["type"]]]
    story = {"mass": MASS, "stiffness": STIFFNESS, "law": definition}
    factors = {"stiffness_factor": 0.5, "strength_factor": 0.5}
    if law.initial_stiffness is not None:  # a factor on the stiffness multiplies all forces
        del story["stiffness"], factors["strength_factor"]
    if not any(item.force == 1 and item.length == 0 for item in law.parameters):
        factors.pop("strength_factor", None)
    model = load_model({"stories": [story]})
    half = model.replace(**factors).stories[0]
    return model.stories[0], tuple(Element(name, half.stiffness, half.law) for name in "ab")


def pair_of_models(name, height=3.0, **more):
    """Return a model of one story with a law, and the model with two halves of the law."""
    story, elements = halves(LAWS[name])
    whole = Story(story.mass, height, story.stiffness, story.law, 5e4)
    parts = Story(story.mass, height, story.stiffness, SUM_OF_ELEMENTS, 5e4, elements=elements)
    return [simple_model(name, [one], **more) for one in (whole, parts)]


@pytest.mark.parametrize("name", LAWS)
def test_halves_of_a_law_are_the_law(name):
    path = YIELD_DRIFT * np.concatenate(
        [
            np.linspace(a, b, 23)[1:]
            for a, b in ((0, 3.1), (3.1, -4.2), (-4.2, 1.05), (1.05, -6.3), (-6.3, 8.2))
        ]
    )
    whole, parts = (follow_path(assemble(model), 1, path) for model in pair_of_models(name))
    for quantity in ("shear", "tangent", "strain_energy", "hysteretic_energy"):
        expected = getattr(whole, quantity)
        scale = np.max(np.abs(expected))
        assert getattr(parts, quantity) == pytest.approx(expected, abs=1e-12 * scale), quantity


METHODS = [
    *("impulse4", "moment4", "newmark-average", "hht", "generalized-alpha", "wilson", "bathe"),
    *("noh-bathe", "houbolt", "park", "impulse", "gauss4", "rk5", "chang", "cr", "kr-alpha"),
    *("central-difference", "u0v0"),
]


@pytest.mark.parametrize("method", every(4, METHODS, ("impulse4", "moment4")))
@pytest.mark.parametrize("name", ["bilinear", "gap", "bouc-wen", "tanh", "peak-oriented"])
def test_every_method_gives_halves_the_response_of_the_law(name, method):
    whole, parts = (
        run(model, MOTION, method=method, dt=0.005, check=False) for model in pair_of_models(name)
    )
    # Iterations that end at a tolerance can differ by it; other methods differ by rounding.
    assert parts.stories.peak_drift == pytest.approx(whole.stories.peak_drift, rel=1e-7)
    assert parts.stories.peak_shear == pytest.approx(whole.stories.peak_shear, rel=1e-7)
    assert parts.energy.hysteretic == pytest.approx(whole.energy.hysteretic, rel=1e-6, abs=1e-6)
    forces = parts.elements.peak_force
    assert forces == pytest.approx(0.5 * whole.stories.peak_shear[0] * np.ones(2), rel=1e-6)
    assert parts.elements.dissipated_energy.sum() == pytest.approx(
        whole.energy.hysteretic, rel=1e-6, abs=1e-6
    )


@pytest.mark.parametrize("method", ["impulse4", "moment4", "newmark-average", "gauss4"])
@pytest.mark.parametrize(
    "elements",
    [
        (BILINEAR, STOP),
        (BOUC_WEN, STOP),
        (BOUC_WEN, BILINEAR),
        ({**LAWS["tanh"], "stiffness": STIFFNESS}, BILINEAR),
        ({**LAWS["imk-deteriorating"], "stiffness": STIFFNESS}, BILINEAR),
        ({**LAWS["peak-oriented"], "stiffness": STIFFNESS}, BILINEAR, STOP),
    ],
)
def test_methods_agree_and_close_the_energy_balance(elements, method):
    """Small steps of every method lead to one response. A gap that is switched twice, or a change
    of branch of the wrong element, would create energy."""
    model = building(*elements, stories=2, damping=0.03)
    reference = run(model, MOTION, method="impulse4", dt=0.02 / 16.0, check=False)
    dt, tolerance = (0.01, 2e-2) if method == "newmark-average" else (0.01, 5e-3)
    result = run(model, MOTION, method=method, dt=dt / 4.0, check=False)
    assert abs(result.energy.error) < tolerance
    assert abs(reference.energy.error) < 1e-3
    drifts = reference.stories.peak_drift
    assert result.stories.peak_drift == pytest.approx(drifts, rel=5e-2)
    spent = result.elements.dissipated_energy
    assert spent.sum() == pytest.approx(result.energy.hysteretic, rel=1e-9)
    assert spent == pytest.approx(
        reference.elements.dissipated_energy, rel=5e-2, abs=2e-2 * spent.max()
    )


def test_impulse4_has_order_four_with_located_branch_changes():
    """The smooth motion has no kinks, so that only the location of the events limits the order."""
    stop = {**STOP, "gap": 0.7 * YIELD_DRIFT, "stop_stiffness": 0.5 * STIFFNESS}
    initial = {"displacement": [0.0], "velocity": [1.1 * YIELD_DRIFT * math.sqrt(STIFFNESS / MASS)]}
    model = building(
        {**BILINEAR, "hardening": 0.1}, stop, initial=initial, analysis={"duration": 0.8}
    )
    ends = [
        run(model, dt=0.8 / count, method="impulse4", check=False).stories.residual_drift[0]
        for count in (40, 80, 160, 320)
    ]
    differences = np.abs(np.diff(ends))
    orders = np.log2(differences[:-1] / differences[1:])
    assert np.all(orders > 3.6), orders


def test_a_story_fails_when_all_elements_have_failed():
    weak = {**LAWS["imk"], "stiffness": STIFFNESS, "ultimate_drift": 6.0 * YIELD_DRIFT}
    motion = noise(samples=101, dt=0.02, peak=12.0)
    both = run(building(weak, weak), motion, method="newmark-average", check=False)
    assert both.status == "failed-story"
    one = run(building(weak, BILINEAR), motion, method="newmark-average", check=False)
    assert one.status == "done"
    located = run(building(weak, weak), motion, method="impulse4", check=False)
    assert located.status == "failed-story"


def test_parameters_reach_the_elements():
    model = building(BILINEAR, {**STOP, "name": "moat wall"})
    names = ("stories[1].elements[bilinear].yield_force", "stories[1].elements[1].yield_force")
    for name in names:
        changed = model.replace(**{name: 123.0}).stories[0]
        assert changed.elements[0].law.parameters[0] == 123.0
        assert changed.elements[1] == model.stories[0].elements[1]
    softer = model.replace(stiffness_factor=0.5).stories[0]
    assert softer.stiffness == 0.5 * STIFFNESS
    assert softer.elements[1].law.parameters[1] == 1.5 * STIFFNESS
    weaker = model.replace(strength_factor=0.5).stories[0]
    assert weaker.elements[0].law.parameters[0] == 0.5 * STRENGTH
    stiffer = model.replace(**{"stories[1].elements[moat wall].stiffness": 2e6}).stories[0]
    assert stiffer.stiffness == STIFFNESS + 2e6


def test_the_building_of_the_other_cases_has_no_elements():
    assert all(not assemble(load_model(case)).elements for case in BUILDINGS.values())


COSINE = 0.8
FRAME = {"name": "frame", "type": "linear", "stiffness": 0.2 * STIFFNESS}
# Elements along their axes, and their equivalents in the direction of the drift: forces times the
# cosine, lengths divided by it
INCLINED = [
    (
        {"type": "bilinear", "stiffness": STIFFNESS, "yield_force": STRENGTH, "hardening": 0.05},
        {
            "type": "bilinear",
            "stiffness": STIFFNESS * COSINE**2,
            "yield_force": STRENGTH * COSINE,
            "hardening": 0.05,
        },
    ),
    (
        {"type": "gap", "gap": YIELD_DRIFT, "stop_stiffness": STIFFNESS},
        {"type": "gap", "gap": YIELD_DRIFT / COSINE, "stop_stiffness": STIFFNESS * COSINE**2},
    ),
    (
        {"type": "polynomial", "coefficients": [STIFFNESS, 0.0, 1e9]},
        {"type": "polynomial", "coefficients": [STIFFNESS * COSINE**2, 0.0, 1e9 * COSINE**4]},
    ),
    (
        {"type": "multilinear", "rule": "elastic", "backbone": [[0.02, 1e5]], "last_slope": 1e6},
        {
            "type": "multilinear",
            "rule": "elastic",
            "backbone": [[0.02 / COSINE, 1e5 * COSINE]],
            "last_slope": 1e6 * COSINE**2,
        },
    ),
]


@pytest.mark.parametrize(("inclined", "horizontal"), INCLINED, ids=lambda item: item["type"])
def test_inclined_element_equals_its_equivalent_in_the_direction_of_the_drift(inclined, horizontal):
    angle = math.degrees(math.acos(COSINE))
    responses = [
        run(building(FRAME, {"name": "brace", **element}), MOTION, check=False)
        for element in (
            horizontal,
            {**inclined, "factor": COSINE},
            {**inclined, "angle": angle},
        )
    ]
    expected = responses[0]
    for response in responses[1:]:
        assert response.stories.peak_drift == pytest.approx(expected.stories.peak_drift, rel=1e-9)
        assert response.stories.peak_shear == pytest.approx(expected.stories.peak_shear, rel=1e-9)
        elements, equivalent = response.elements, expected.elements
        assert elements.dissipated_energy == pytest.approx(equivalent.dissipated_energy, rel=1e-9)
        # Forces and yield drifts are those in the direction of the drift.
        assert elements.peak_force == pytest.approx(equivalent.peak_force, rel=1e-9)
        assert elements.yield_drift == pytest.approx(equivalent.yield_drift, rel=1e-12, nan_ok=True)


def test_numbers_of_an_inclined_element_are_varied_along_its_axis():
    inclined = {**INCLINED[0][0], "name": "brace", "factor": COSINE}
    model = building(FRAME, inclined)
    changes = {"stories[1].elements[brace].yield_force": 2.0 * STRENGTH}
    changes["stories[1].elements[2].stiffness"] = 3.0 * STIFFNESS
    twice = {**inclined, "yield_force": 2.0 * STRENGTH, "stiffness": 3.0 * STIFFNESS}
    assert model.replace(**changes).stories == building(FRAME, twice).stories
    runs = run_many([model], [MOTION], vary={name: [value] for name, value in changes.items()})
    single = run(building(FRAME, twice), MOTION, check=False)
    peaks = runs.stories.peak_drift.ravel()
    assert peaks == pytest.approx(single.stories.peak_drift, rel=1e-12)


@pytest.mark.parametrize(
    ("keys", "message"),
    [
        ({"factor": 0.8, "angle": 30.0}, "give either factor or angle, not both"),
        ({"factor": 0.0}, r"elements\[2\].factor"),
        ({"factor": 1.5}, r"elements\[2\].factor"),
        ({"angle": 90.0}, r"elements\[2\].angle"),
    ],
)
def test_invalid_inclinations(keys, message):
    with pytest.raises(ModelError, match=message) as caught:
        building(FRAME, {**INCLINED[0][0], **keys})
    assert len(str(caught.value).splitlines()) == 1


@pytest.mark.slow
def test_the_story_of_a_fractured_element_reverses():
    """The fractured element has no branch that a reversal of the story could change."""
    first = {"type": "ramberg-osgood", "yield_force": 2e5, "alpha": 0.2, "exponent": 7.0}
    elements = [
        {"name": "first", **first, "stiffness": 4e7, "fracture_drift": 0.02},
        {"name": "second", "type": "linear", "stiffness": 2e7},
    ]
    story = {"mass": 1e5, "height": 3.0, "elements": elements}
    motion = make_record(6.0 * np.sin(8.0 * np.arange(0.0, 4.0, 0.02)), dt=0.02, units="m/s^2")
    response = run(load_model({"stories": [story]}), motion, method="impulse4", check=False)
    assert response.status == "done" and abs(response.energy.error) < 2e-3
    (peak_drift,) = response.stories.peak_drift
    assert peak_drift > 0.04
    assert response.elements.peak_force[1] == pytest.approx(2e7 * peak_drift)
    assert response.elements.peak_force[0] < 4e5
