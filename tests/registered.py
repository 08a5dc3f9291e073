"""Fixtures for tests of plug-ins: registrations are removed after each test, and methods are
compared with a motion that is computed quickly."""

import sys
from functools import cache

import numpy as np
import pytest

from tdint.ground_motion import measures
from tdint.kernels.laws import LAWS as NUMBERED
from tdint.kernels.laws import OURS
from tdint.kernels.stories.law_state import follow
from tdint.kernels.time_loop.loop import integrate
from tdint.methods import catalogue as methods
from tdint.methods import step_check
from tdint.model import story_laws
from tdint.model.building import assemble
from tdint.model.definition import simple_model
from tdint.model.story import simple_story
from tdint.model.story_laws import Law
from tdint.response.runs import batch as runs
from tdint.response.runs.analysis_kernels import all_kernels
from tdint.response.runs.compiled_steps import LOOP_KERNELS
from tdint.response.runs.prepared import PreparedBuilding
from tdint.response.time_steps import Steps

SHORTER = 80  # steps of `step_check._H`; methods with errors differ at the 60th step


def forget():
    """Remove everything that files and packages have registered, as in a new process."""
    for name in list(story_laws.CODES)[OURS:]:
        del story_laws.CODES[name]
    del NUMBERED[OURS:]
    # Another law can get the number of a removed law. `all_kernels` would execute the steps of
    # plug-ins and load installed plug-ins.
    steps = [method.family.step for method in methods._known().values()]
    for kernel in (*steps, integrate, *LOOP_KERNELS, follow):
        kernel._last = None
    for name in set(measures.MEASURES) - set(measures.BUILTIN_MEASURES):
        del measures.MEASURES[name]
    for cached in (methods._known, methods.catalogue, story_laws.laws, runs._parse_cached):
        cached.cache_clear()
    for name in [name for name in sys.modules if name.startswith(("tdint_plugin_", "outside"))]:
        del sys.modules[name]


@pytest.fixture(autouse=True)
def forgotten():
    """Remove the registrations of a test after it."""
    yield
    forget()


@cache
def true_motion(law):
    """Return the displacements of `step_check._reference_displacements`, computed by the compiled
    time loop."""
    story = simple_story(1.0, Law(law, step_check._YIELDING[law]), stiffness=1000.0, dashpot=1.0)
    prepared = PreparedBuilding(
        assemble(simple_model(law, [story, story])), velocity=np.array([0.2, 0.3])
    )
    ground = 9.0 * np.sin(14.0 * np.arange(SHORTER + 1) * step_check._H)
    steps = Steps(step_check._H / 16, 16 * SHORTER, 16)
    space = prepared.integrate(
        methods.parse("impulse4"), steps, ground, history_rows=steps.count
    ).space
    return step_check._displacements(space, 16)


@pytest.fixture
def compiled_truth(monkeypatch):
    """Compute the reference motion with the compiled time loop, limited to the time in which wrong
    methods differ."""
    monkeypatch.setattr(step_check, "_SECONDS", SHORTER * step_check._H)
    monkeypatch.setattr(step_check, "_reference_displacements", true_motion)


@pytest.fixture
def plain(monkeypatch):
    """Execute kernels without compilation."""
    monkeypatch.setenv("TDINT_KERNELS", "python")
    for kernel, _ in all_kernels():
        monkeypatch.setattr(kernel, "_loaded", {})
        monkeypatch.setattr(kernel, "_last", None)
