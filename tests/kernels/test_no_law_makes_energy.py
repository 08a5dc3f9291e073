"""What a hysteretic story dissipates never becomes less: no path, closed or not, gives back more than was put in."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tdint.analysis.static.cyclic import follow_path
from tdint.model.building import assemble
from tdint.model.definition import simple_model, simple_story
from tdint.model.laws import Law

PART = st.floats(0.0, 0.99)


@st.composite
def peak_oriented(draw):
    return Law("peak-oriented", (1.0, draw(PART), draw(PART)))


@st.composite
def trilinear(draw):
    """Of those that do not unload past zero drift."""
    unloading, drift = draw(PART), draw(st.floats(1.5, 30.0))
    highest = max(drift ** (1.0 - unloading), 1.0)
    return Law(
        "trilinear-pinching",
        (1.0, draw(st.floats(1.0, highest)), 1.01 * drift, draw(st.floats(0.05, 1.0)), unloading),
    )


@st.composite
def bilinear(draw):
    return Law("bilinear", (1.0, draw(PART)))


@st.composite
def bouc_wen(draw):
    return Law("bouc-wen", (1.0, draw(PART), draw(st.floats(1.0, 10.0)), draw(st.floats(0.5, 1.0))))


def along(law, drifts):
    """A story with stiffness and yield force 1 along a path, from rest."""
    building = assemble(simple_model("one", [simple_story(1.0, law, stiffness=1.0)]))
    return follow_path(building, 1, np.asarray(drifts, float))


@settings(max_examples=200, deadline=None)
@given(
    st.one_of(peak_oriented(), trilinear(), bilinear(), bouc_wen()),
    st.lists(st.floats(-40.0, 40.0), min_size=2, max_size=40),
)
def test_dissipation_never_falls(law, drifts):
    path = along(law, [0.0, *drifts])
    work = path.dissipated + path.recoverable
    assert np.min(np.diff(path.dissipated)) >= -1e-12 * np.max(work, initial=1.0)
    assert np.min(work) >= -1e-12


@pytest.mark.parametrize("hardening", [0.02, 0.1, 0.5])
@pytest.mark.parametrize("unloading", [0.5, 0.9])
def test_cycles_of_a_peak_oriented_story_that_hardens(hardening, unloading):
    """Cycles of growing and of constant amplitude: the work of a closed one is the area that it encloses."""
    for largest in (3.0, 10.0, 100.0):
        law = Law("peak-oriented", (1.0, hardening, unloading))
        corners = np.outer([*np.linspace(1.5, largest, 6), largest, largest], [1.0, -1.0]).ravel()
        ways = zip([0.0, *corners], corners, strict=False)
        path = along(law, np.concatenate([np.linspace(a, b, 400) for a, b in ways]))
        work = np.concatenate([[0.0], np.cumsum(0.5 * (path.shear[1:] + path.shear[:-1]) * np.diff(path.drift))])
        last = work[-1] - work[-801]
        assert last >= -1e-12 * work[-1]  # nothing where the bounds make of it a line through the origin
        assert path.dissipated[-1] + path.recoverable[-1] == pytest.approx(work[-1], rel=1e-3)
        # Unloading ends on the side where it began: what comes back is at most the triangle to the origin.
        peak = np.argmax(path.drift)
        assert path.recoverable[peak] <= 0.5 * path.shear[peak] * path.drift[peak] * (1.0 + 1e-12)


def test_the_bounds_leave_common_stories_alone():
    """Takeda's 0.4 with 5 % hardening unloads as stated up to a ductility of hundreds."""
    for ductility in (1.5, 6.0, 300.0):
        path = along(Law("peak-oriented", (1.0, 0.05, 0.4)), [0.0, ductility, ductility - 0.001])
        assert (path.shear[1] - path.shear[2]) / 0.001 == pytest.approx(ductility**-0.4, rel=1e-9)
