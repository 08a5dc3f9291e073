"""The laws of the separate solver and of tdint have the same forces along random paths."""

import numpy as np
import pytest

import tdint
from grid.springs import LAWS, spring_of
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
    follow_both(name, story, reversals)


@pytest.mark.parametrize("points", [1, 3])
def test_unloading_of_the_peak_rule_after_large_drifts(points):
    """The slopes of the curve bound the unloading stiffness, also at the end of a segment."""
    drifts = STRENGTH / STIFFNESS * np.array([1.0, 20.0, 60.0])[:points]
    forces = STRENGTH * np.array([1.0, 6.0, 8.0])[:points]
    law = {
        **{"type": "multilinear", "rule": "peak", "last_slope": 0.02 * STIFFNESS},
        **{"backbone": np.transpose([drifts, forces]).tolist(), "unloading": 0.5},
    }
    reversals = STRENGTH / STIFFNESS * np.array([15.0, 10.0, -40.0, 30.0, 300.0, 290.0, -200.0])
    follow_both("multilinear", {"mass": 1e5, "law": law}, reversals)


def follow_both(name, story, reversals):
    """Require the same forces of tdint and of the separate solver at all reversals of the drift."""
    count = len(reversals)
    path = np.interp(np.arange(count * POINTS + 1) / POINTS, np.arange(count + 1), [0, *reversals])
    forces = follow_path(assemble(tdint.load_model({"stories": [story]})), 1, path).shear
    spring = spring_of(story, story["law"])
    for number, drift in enumerate(reversals):
        spring.go(drift)
        expected = forces[(number + 1) * POINTS]
        assert spring.force == pytest.approx(expected, rel=1e-6, abs=1e-6 * STRENGTH), number


OF_CONTACTS = {"dashpot", "restitution"}
"""Parameters of contact laws that act in links, which the chains of the grid do not have;
tests/response/runs/test_contact.py compares them with a separate solution."""


@pytest.mark.parametrize("name", TDINT_LAWS)
def test_each_parameter_occurs_in_an_example(name):
    """A new law of tdint, or a new parameter, is declared in `grid.springs`."""

    def paths(content, path=""):
        for key, item in content.items():
            yield path + key
            if isinstance(item, dict):
                yield from paths(item, f"{path}{key}.")

    used = {path for label in LAWS[name].loops for path in paths(example(name, label)["law"])}
    declared = {parameter.path for parameter in TDINT_LAWS[name].parameters}
    assert declared - (OF_CONTACTS if name in ("gap", "hertz") else set()) <= used
