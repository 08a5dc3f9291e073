"""Story shears of springs, dashpots and inertia forces of the floors above, and the work of
dashpots."""

from dataclasses import replace

import numpy as np
import pytest

import building_cases
from building_cases import Law, story
from tdint import load_model
from tdint.kernels import layout as rows
from tdint.model.building import assemble
from tdint.model.definition import Force, ModalDamping
from tdint.response.runs.run import run

DAMPED = "configs/fluid-dampers.yaml"


def sum_of_shears(model, history):
    """Return the sum of the shears of springs, P-delta, dashpots and Rayleigh or modal damping;
    shape (steps + 1, n)."""
    building = assemble(model)
    chain = building.linear_terms[:, :-1]
    rate = np.diff(history.velocity, axis=1, prepend=0.0)
    own = history.shear + chain[rows.GEOMETRIC] * history.drift + history.damper_force
    own += (chain[rows.STORY_DAMPER] - chain[rows.DASHPOT]) * rate
    mode_rows = building.modal[:, :-1]
    floors = (
        chain[rows.FLOOR_DAMPER] * history.velocity + history.velocity @ mode_rows.T @ mode_rows
    )
    return own + np.cumsum(floors[:, ::-1], axis=1)[:, ::-1]


@pytest.mark.parametrize("method", ["impulse4", "newmark-average"])
def test_total_shear_is_sum_of_parts_and_of_inertia_forces(method):
    model = replace(load_model(DAMPED), p_delta=True)
    response = run(model, method=method, history=True, duration=12.0)
    history, stories = response.history, response.stories
    mass = np.array([story.mass for story in model.stories])
    moved = -np.cumsum((mass * history.absolute_acceleration)[:, ::-1], axis=1)[:, ::-1]
    size = np.max(np.abs(moved))
    np.testing.assert_allclose(history.total_shear, moved, atol=1e-12 * size)
    np.testing.assert_allclose(history.total_shear, sum_of_shears(model, history), atol=1e-9 * size)
    for peaks, values in (
        (stories.peak_total_shear, history.total_shear),
        (stories.peak_damper_force, history.damper_force),
    ):
        at_the_steps = np.max(np.abs(values), axis=0)
        assert np.all(peaks >= at_the_steps * (1.0 - 1e-12))
        assert np.all(peaks <= at_the_steps * 1.02)


def test_total_shear_peak_at_yielding_with_floor_forces():
    """The peak is the sum of the yield force and the dashpot force at yielding, which occurs within
    a step; it does not depend on the time step."""
    yields = replace(story(1e5, 4e7, Law("bilinear", (2e5, 0.0))), dashpot=3e5)
    pushed = building_cases.model([yields], velocity=(0.2,), forces=[Force(1, 1e4, 20.0, 0.0)])
    peaks = [
        run(pushed, method="impulse4", dt=dt, duration=0.1).stories.peak_total_shear[0]
        for dt in (0.01, 0.01 / 3, 1e-3)
    ]
    assert peaks[0] == pytest.approx(peaks[2], rel=1e-5) and peaks[1] == pytest.approx(
        peaks[2], rel=1e-7
    )
    response = run(pushed, method="impulse4", dt=1e-3, duration=0.1, history=True)
    assert peaks[2] > 1.0001 * np.max(np.abs(response.history.total_shear))


def test_total_shear_peak_between_steps_under_sine_force():
    """For m u'' + k u = P sin(w t) from rest, u = P / (k - m w^2) (sin(w t) - w / omega sin(omega
    t)). Only the spring acts on the mass, so that the maximum total shear is k |u|. The values at
    the ends of steps would miss 4e-3 of the maximum."""
    mass, stiffness, force, w = 1e5, 4e7, 1e6, 9.0
    pushed = building_cases.model([story(mass, stiffness)], forces=[Force(1, 0.0, force, w)])
    omega, times = np.sqrt(stiffness / mass), np.linspace(0.0, 0.96, 200_001)
    moved = (
        force / (stiffness - mass * w**2) * (np.sin(w * times) - w / omega * np.sin(omega * times))
    )
    peaks = [
        run(pushed, method="impulse4", dt=dt, duration=0.96).stories.peak_total_shear[0]
        for dt in (0.02, 0.01)
    ]
    missed = np.abs(np.array(peaks) / (stiffness * np.max(np.abs(moved))) - 1.0)
    assert missed[0] < 1e-4 and missed[1] < missed[0] / 8.0, missed


def test_total_shear_includes_modal_damping():
    model = load_model("configs/ten-story.yaml")
    response = run(replace(model, damping=ModalDamping((0.05,))), history=True, duration=8.0)
    history = response.history
    size = np.max(np.abs(history.total_shear))
    np.testing.assert_allclose(
        history.total_shear, sum_of_shears(response.model, history), atol=1e-9 * size
    )
    assert np.all(
        response.stories.peak_total_shear
        >= np.max(np.abs(history.total_shear), axis=0) * (1.0 - 1e-12)
    )
    assert not np.any(response.stories.peak_damper_force)


@pytest.mark.long
def test_force_peaks_agree_with_fine_steps_within_estimated_errors():
    model = load_model(DAMPED)
    checked = run(model, method="newmark-average", check=True, duration=12.0)
    fine = run(model, method="impulse4", dt=0.01 / 8, duration=12.0).stories
    for name in ("peak_damper_force", "peak_total_shear"):
        error = np.abs(getattr(checked.stories, name) - getattr(fine, name))
        assert np.all(error <= getattr(checked.check.errors, name))
        assert np.all(error < 0.02 * getattr(fine, name))


def test_work_of_dashpots_is_separate_from_viscous_damping():
    model = load_model(DAMPED)
    response = run(model, history=True, dt=0.0025, duration=12.0)
    history, energy = response.history, response.energy
    power = np.sum(history.damper_force * np.diff(history.velocity, axis=1, prepend=0.0), axis=1)
    work = np.concatenate([[0.0], np.cumsum(0.5 * (power[1:] + power[:-1]) * response.dt)])
    np.testing.assert_allclose(history.energy.dampers, work, atol=2e-4 * energy.dampers)
    assert abs(energy.error) < 1e-4 and energy.viscous > 0.0
    bare = replace(
        model,
        stories=tuple(replace(story, dashpot=0.0, power_dashpot=None) for story in model.stories),
    )
    without = run(bare, duration=12.0)
    assert without.energy.dampers == 0.0 and not np.any(without.stories.peak_damper_force)
    undamped = run(replace(model, damping=None), duration=12.0).energy
    assert abs(undamped.viscous) < 1e-3 * undamped.dampers
