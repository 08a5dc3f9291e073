"""One building written in several ways has the same response.

An absorber is a further story, an attachment on the roof (a plain chain), or such an attachment in
a building with another attachment on the ground (a tree). A spring between neighboring floors is an
element of the story or a link. A chain becomes a tree by a lone attachment on the ground.
"""

import copy

import numpy as np
import pytest

import tdint
from building_cases import noise
from tdint.errors import AnalysisError

MOTION = noise(samples=121, dt=0.02, peak=5.0)
METHODS = ["impulse4", "moment4", "newmark-average", "gauss4"]
LAWS = {
    "linear": {},
    "bilinear": {"type": "bilinear", "yield_force": 2e5, "hardening": 0.03},
    "bouc-wen": {"type": "bouc-wen", "yield_force": 2e5, "hardening": 0.03, "exponent": 2.0,
                 "beta": 0.6},
    "gap": {"type": "gap", "gap": 0.006, "stop_stiffness": 1e8, "sides": "both"},
    "fracture": {"type": "bilinear", "yield_force": 2e5, "hardening": 0.03, "fracture_drift": 0.06},
}  # fmt: skip
POWER = {"coefficient": 1.2e5, "exponent": 0.5, "linear_below": 0.01}
BRACE = {"coefficient": 2e5, "brace": 1e8}
JUMP = [{"floor": 2, "points": [[0.0, 0.0], [0.4033, 0.0], [0.4033, 1e5], [1.0, 1e5]]}]
LONE = {"name": "lone", "floor": "ground", "mass": 1e3, "stiffness": 4e5}
STORY_PEAKS = ("drift", "shear", "total_shear", "displacement", "velocity", "absolute_acceleration",
               "damper_force")  # fmt: skip
TOLERANCE = 2e-6
"""Relative. Both runs of a nonlinear building iterate up to a residual that differs."""


def story(stiffness, law="linear", dashpot=2e5, mass=1e5, **more):
    keys = {"mass": mass, "height": 3.0, "stiffness": stiffness, "law": LAWS[law], **more}
    keys["dashpot"] = dashpot
    return {key: copy.deepcopy(value) for key, value in keys.items() if value or key == "mass"}


def frame(stories, **more):
    return {"stories": stories, "damping": "none", "plausibility": "off, test", **more}


def numbers(response, device=None):
    """Return the quantities of the first two stories, of the energies and of an attachment or link,
    or a story, with the number `device`, by name."""
    stories = response.stories
    found = {name: getattr(stories, f"peak_{name}")[:2] for name in STORY_PEAKS}
    found["residual_drift"] = stories.residual_drift[:2]
    found["hysteretic"] = response.hysteretic_energy[:2]
    for name in ("viscous", "dampers", "hysteretic"):
        found[f"energy {name}"] = np.array([getattr(response.energy, name)])
    if device is not None:
        own = stories if response.devices is None else response.devices.stories
        for name in ("drift", "shear", "damper_force"):
            found[f"device {name}"] = getattr(own, f"peak_{name}")[device : device + 1]
    return found


def assert_equal(one, other):
    """Compare numbers relative to their size, and residual drifts relative to the peak drifts."""
    for name, values in one.items():
        size = one["drift"] if name == "residual_drift" else np.maximum(abs(values), 1e-3)
        assert np.all(abs(other[name] - values) <= TOLERANCE * size), (name, values, other[name])


def run(model, method):
    return tdint.run(model, MOTION, method=method, check=False, duration=2.4)


ABSORBERS = [
    *((law, 2e5, {}) for law in LAWS),
    *(("linear", dashpot, {}) for dashpot in (0.0, POWER, BRACE)),
    ("linear", 2e5, {"excitation": {"forces": JUMP}}),
    ("bilinear", 2e5, {"initial": {"velocity": [0.2, -0.1]}}),
    ("linear", 2e5, {"inertance": 2e4}),
]


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("case", ABSORBERS, ids=range(len(ABSORBERS)))
def test_absorber_is_a_story_or_an_attachment(case, method):
    """The energy of the absorber is the sum of its spring and its dashpot in all forms."""
    law, dashpot, more = case
    more = dict(more)
    inertance = more.pop("inertance", 0.0)
    below = [story(6e7, "linear" if inertance else "bilinear"), story(5e7)]
    above = story(4e6, law, dashpot, mass=8e3, inertance=inertance)
    device = {"name": "absorber", "floor": "roof", **above}
    device.pop("height")
    if inertance:  # that of an attachment acts on its motion relative to the ground
        device.pop("inertance")
        more["links"] = [{"name": "i", "from": 2, "to": "absorber", "inertance": inertance}]
    moving = copy.deepcopy(more)
    if "initial" in more:
        moving["initial"]["velocity"].append(-0.1)
    try:
        roof = run(frame(below, attachments=[device], **more), method)
    except AnalysisError as error:
        assert "does not support" in str(error)
        return
    moving.pop("links", None)
    as_story = numbers(run(frame([*below, above], **moving), method), 2)
    as_tree = run(frame(below, attachments=[device, LONE], **more), method)
    assert_equal(as_story, numbers(roof, 0))
    assert_equal(as_story, numbers(as_tree, 0))
    energies = [response.devices.dissipated_energy[0] for response in (roof, as_tree)]
    assert energies[0] == pytest.approx(energies[1], rel=TOLERANCE, abs=1e-3)
    assert (energies[0] > 0.0) == (bool(dashpot) or law != "linear")


@pytest.mark.parametrize("method", METHODS[:3])
@pytest.mark.parametrize("law", LAWS)
def test_spring_is_an_element_or_a_link(law, method):
    spring = {"name": "b", "stiffness": 3e7, **(LAWS[law] or {"type": "linear"})}
    first = {"name": "a", "stiffness": 4e7, "type": "bilinear", "yield_force": 1.5e5,
             "hardening": 0.05}  # fmt: skip
    upper = {"mass": 1e5, "height": 3.0, "elements": [first, spring], "dashpot": 3e5}
    with_elements = run(frame([story(6e7), upper]), method)
    alone = {"mass": 1e5, "height": 3.0, "stiffness": 4e7,
             "law": {key: first[key] for key in ("type", "yield_force", "hardening")}}  # fmt: skip
    link = {"name": "b", "from": 1, "to": 2, "stiffness": 3e7, "dashpot": 3e5}
    if LAWS[law]:
        link["law"] = LAWS[law]
    with_link = run(frame([story(6e7), alone], links=[link]), method)
    one, other = numbers(with_elements), numbers(with_link)
    for name in ("shear", "damper_force", "hysteretic"):  # of a part of the story
        one[name], other[name] = one[name][:1], other[name][:1]
    assert_equal(one, other)
    forces = with_elements.elements.peak_force
    assert forces[0] == pytest.approx(with_link.stories.peak_shear[1], rel=TOLERANCE)
    assert forces[1] == pytest.approx(with_link.devices.stories.peak_shear[0], rel=TOLERANCE)


DAMPINGS = {
    "modal": {"modal": {"ratio": 0.04}},
    "rayleigh": {"rayleigh": {"ratio": 0.04, "modes": [1, 2]}},
    "tangent": {"rayleigh": {"mass": 0.2, "stiffness": 0.002, "tangent": True}},
}


@pytest.mark.parametrize("method", METHODS[:3])
@pytest.mark.parametrize("damping", DAMPINGS)
@pytest.mark.parametrize("p_delta", [False, True])
def test_chain_is_a_tree_with_a_lone_attachment(damping, p_delta, method):
    """The attachment on the ground does not interact with the building."""
    more = {"damping": DAMPINGS[damping]}
    if p_delta:
        more["p_delta"] = True
    model = frame([story(6e7, "bilinear"), story(5e7, "bilinear", POWER)])
    model |= more
    if damping == "tangent" and method == "newmark-average":
        method = "moment4"  # one of the two methods that support it in trees
    chain, tree = (run(model | extra, method) for extra in ({}, {"attachments": [LONE]}))
    assert_equal(numbers(chain), numbers(tree))
