"""Damping and P-delta that are switched off for single stories, and the modes of modal damping."""

import io

import numpy as np
import pytest

from tdint.errors import ModelError
from tdint.model.building import assemble
from tdint.model.config.model_file import load_model
from tdint.model.plausibility import plausibility_warnings
from tdint.units import STANDARD_GRAVITY

SOIL = "{mass: 300, stiffness: 2.0e5, dashpot: 6.0e3%s}"
FRAME = "{repeat: 3, mass: 100, height: 3.5, stiffness: 1.0e5}"


def read(stories: str, rest: str = "damping: none"):
    return load_model(io.StringIO(f"stories: [{stories}]\n{rest}"))


def spring_matrix(stiffness):
    """Stiffness matrix of a chain, summed spring by spring."""
    n = len(stiffness)
    matrix = np.zeros((n, n))
    for i, k in enumerate(stiffness):
        ends = np.zeros(n)
        ends[i] = 1.0
        if i:
            ends[i - 1] = -1.0
        matrix += k * np.outer(ends, ends)
    return matrix


def test_rayleigh_damping_leaves_out_a_soil_spring():
    """The coefficients are those of the complete chain. The stiffness part leaves out the soil
    spring, and the mass part acts relative to the floor on the soil."""
    model = read(f"{SOIL % ', rayleigh: false'}, {FRAME}", "damping: 5%")
    mass, stiffness = np.array([300.0, 100, 100, 100]), np.array([2e5, 1e5, 1e5, 1e5])
    squared = np.linalg.eigvals(spring_matrix(stiffness) / mass[:, None]).real
    first, _, third, _ = np.sqrt(np.sort(squared))
    by_mass, by_stiffness = 0.1 * first * third / (first + third), 0.1 / (first + third)
    expected = by_stiffness * spring_matrix([0.0, 1e5, 1e5, 1e5]) + spring_matrix([6e3, 0, 0, 0])
    for floor in (1, 2, 3):
        relative = np.zeros(4)
        relative[floor], relative[0] = 1.0, -1.0
        expected += by_mass * mass[floor] * np.outer(relative, relative)
    assert assemble(model).damping_matrix() == pytest.approx(expected, rel=1e-10, abs=1e-6)


def test_the_default_of_rayleigh_follows_the_isolator():
    isolators = ("isolator: true", "isolator: rayleigh", "isolator: true, rayleigh: true", "")
    flags = [read(SOIL % (text and f", {text}")).stories[0].rayleigh for text in isolators]
    assert flags == [False, True, True, True]


@pytest.mark.parametrize(
    ("default", "switches"),
    [(True, (False, None, None, None)), (False, (None, True, True, True))],
)
def test_p_delta_acts_in_the_stories_that_specify_it(default, switches):
    """The key of a story has priority over the key of the model. A story without P-delta needs no
    height, and its weight is carried by no other story."""
    texts = [
        f", p_delta: {str(switch).lower()}" if switch is not None else "" for switch in switches
    ]
    frame = f"{{mass: 100, height: 3.5, stiffness: 1.0e5{texts[1]}}}"
    model = read(
        f"{SOIL % texts[0]}, {frame}, {frame}, {frame}", f"p_delta: {str(default).lower()}"
    )
    loss = STANDARD_GRAVITY * np.array([0.0, 300.0, 200.0, 100.0]) / 3.5
    expected = spring_matrix(np.array([2e5, 1e5, 1e5, 1e5]) - loss)
    assert assemble(model).stiffness_matrix() == pytest.approx(expected, rel=1e-12)
    assert model.has_p_delta and model.p_delta_stories == (False, True, True, True)


def test_modal_damping_without_p_delta_uses_the_modes_without_p_delta():
    """C phi = 2 xi omega M phi for the modes of the chosen stiffness."""
    mass, stiffness = np.full(3, 100.0), np.full(3, 1e3)
    for switch, loss in (("true", 100.0 * STANDARD_GRAVITY / 3.5), ("false", 0.0)):
        model = read(
            "{repeat: 3, mass: 100, height: 3.5, stiffness: 1.0e3}",
            f"p_delta: true\ndamping: {{modal: {{ratio: 5%, p_delta: {switch}}}}}",
        )
        chosen = spring_matrix(stiffness - loss * np.array([3.0, 2.0, 1.0]))
        squared, shapes = np.linalg.eigh(chosen / mass[0])
        expected = 0.1 * mass[0] * shapes @ np.diag(np.sqrt(squared)) @ shapes.T
        assert assemble(model).damping_matrix() == pytest.approx(expected, rel=1e-9, abs=1e-9)
        assert model.replace(damping=0.05).damping == model.damping


@pytest.mark.parametrize(
    ("stories", "rest", "message"),
    [
        (SOIL % ", rayleigh: false", "damping: {modal: 5%}", "modal damping acts on all stories"),
        (SOIL % ", isolator: rayleigh, rayleigh: false", "", "`isolator: rayleigh` or `rayleigh: "),
        (SOIL % ", p_delta: true", "", "`p_delta: false` in this story"),
        (SOIL % "", "damping: {modal: {ratio: [1%, 2%], modes: 1}}", "a list of at most|not both"),
    ],
)
def test_switches_without_effect_or_height_are_refused(stories, rest, message):
    with pytest.raises(ModelError, match=message):
        read(stories, rest)


ABSORBER = "{mass: 5, stiffness: 200, dashpot: 4%s}"


@pytest.mark.parametrize(
    ("stories", "rest", "story"),
    [
        (f"{SOIL % ''}, {FRAME}", "damping: 5%", "story 1"),
        (f"{FRAME}, {ABSORBER % ''}", "damping: 5%", "story 4"),
        (f"{FRAME}, {ABSORBER % ', height: 3'}", "damping: 5%", "story 4"),
        (f"{SOIL % ', rayleigh: false'}, {FRAME}", "damping: 5%", ""),
        (f"{FRAME}, {ABSORBER % ', isolator: true'}", "damping: 5%", ""),
        (f"{FRAME}, {ABSORBER % ''}", "damping: {modal: 5%}", ""),
        (f"{FRAME}, {ABSORBER % ''}", "damping: 5%\nplausibility: off, test", ""),
        ("{repeat: 3, mass: 100, stiffness: 1.0e5, dashpot: 10}", "damping: 5%", ""),
    ],
)
def test_damping_of_an_attached_story_is_reported(stories, rest, story):
    """Rayleigh damping of an absorber or a soil spring is an error of modeling in most cases."""
    model = read(stories, rest)
    found = [text for text in plausibility_warnings(model, assemble(model)) if "Rayleigh" in text]
    assert bool(found) == bool(story) and all(f"acts on {story} " in text for text in found)
