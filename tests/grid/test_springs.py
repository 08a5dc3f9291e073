"""The laws of the separate solver and of tdint have the same forces along random paths."""

import numpy as np
import pytest

import tdint
from grid.springs import LAWS
from selection import every
from tdint.model.building import assemble
from tdint.model.story_laws import LAWS as TDINT_LAWS
from tdint.response.static.cyclic import follow_path

STIFFNESS, STRENGTH = 4e7, 2e5  # N/m, N
POINTS = 100  # drifts between two reversals, for laws that tdint integrates along the path
EXAMPLES = [(name, label) for name, spring in LAWS.items() for label in spring.loops]


def example(name, label):
    """Return the story of an example."""
    spring = LAWS[name]
    parameters = spring.loops[label](np.random.default_rng(1), STIFFNESS, STRENGTH)
    story = {"mass": 1e5, "law": {"type": name, **parameters}}
    return story if spring.defines_stiffness else {**story, "stiffness": STIFFNESS}


@pytest.mark.parametrize(("name", "label"), every(2, EXAMPLES))
@pytest.mark.parametrize("seed", every(3, range(3)))
def test_forces_along_a_path(name, label, seed):
    """The drifts at the reversals grow to six times the yield drift."""
    random, story = np.random.default_rng(seed), example(name, label)
    reversals = np.linspace(0.3, 6.0, 24) * STRENGTH / STIFFNESS * random.uniform(-1.0, 1.0, 24)
    reversals[::5] *= 0.1
    path = np.interp(np.arange(24 * POINTS + 1) / POINTS, np.arange(25), [0.0, *reversals])
    forces = follow_path(assemble(tdint.load_model({"stories": [story]})), 1, path).shear
    spring = LAWS[name](story, story["law"])
    for number, drift in enumerate(reversals):
        spring.go(drift)
        expected = forces[(number + 1) * POINTS]
        assert spring.force == pytest.approx(expected, rel=1e-6, abs=1e-6 * STRENGTH), number


@pytest.mark.parametrize("name", TDINT_LAWS)
def test_each_parameter_occurs_in_an_example(name):
    """A new law of tdint, or a new parameter, is declared in `grid.springs`."""

    def paths(content, path=""):
        for key, item in content.items():
            yield path + key
            if isinstance(item, dict):
                yield from paths(item, f"{path}{key}.")

    used = {path for label in LAWS[name].loops for path in paths(example(name, label)["law"])}
    assert {parameter.path for parameter in TDINT_LAWS[name].parameters} <= used
