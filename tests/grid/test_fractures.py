"""Fractures of elements against the separate solver.

Each law that can fracture would be another compiled loop, so that these few buildings run
interpreted and are not in the array.
"""

import pytest

from grid.axes import build
from grid.covering import reference
from grid.judge import DONE, judge
from registered import plain as interpreted  # noqa: F401
from selection import every

BUILDING = {
    **{"stories": "2", "profile": "uniform", "isolator": "none", "p-delta": "off"},
    **{"law": "bilinear", "elements": "with friction", "damper": "linear"},
    **{"damping": "two ratios", "devices": "none", "record": "pulse .02 s", "scale": "1"},
    **{"duration": "shorter", "load": "record", "initial": "rest"},
}

FRACTURES = {
    ("first element", "impulse4"): {"element": 0, "elements": "with polynomial"},
    ("steel", "impulse4"): {"element": 0, "law": "steel", "p-delta": "on"},
    ("degrading", "impulse4"): {"element": 0, "law": "degrading", "damper": "power .35"},
    ("second element", "gauss4"): {"element": 1, "damping": "modal", "load": "record and points"},
    ("one side", "impulse4"): {"element": 1, "side": "positive", "initial": "elastic drift"},
    ("x brace", "moment4"): {"element": 1, "elements": "with x brace", "law": "flag"},
    ("rod", "gauss4"): {"element": 1, "elements": "with rod", "law": "peak"},
    ("link", "moment4"): {"element": 1, "devices": "yielding link", "scale": "-2"},
}
"""Changes of `BUILDING` by name and method; `element` fractures, on one side or on both."""


def fractured(element, side=None):
    """Return the function that lets an element of each story of a case fracture at 1.8 times the
    approximate yield drift of the story."""

    def fracture(case):
        for i, story in enumerate(case.model["stories"]):
            drift = 1.8 * float(case.strength[i] / case.stiffness[i])
            story["elements"][element]["fracture_drift"] = {side: drift} if side else drift

    return fracture


@pytest.mark.parametrize(("name", "method"), every(8, FRACTURES))
def test_errors_are_within_twice_their_estimates(name, method, request):
    changes = dict(FRACTURES[name, method])
    change = fractured(changes.pop("element"), changes.pop("side", None))
    row = BUILDING | changes
    case, whole = build(row, 1, change), build(row, 1)
    peaks = reference(case)
    assert peaks, "another seed"
    drift = peaks["peak_drift"][0]
    assert abs(drift / reference(whole)["peak_drift"][0] - 1.0) > 1e-3, "the element fractures"
    request.getfixturevalue("interpreted")
    verdict = judge(case, peaks, method, 0.5)
    assert verdict.outcome == DONE, verdict.message
    assert not list(verdict.ratios())
