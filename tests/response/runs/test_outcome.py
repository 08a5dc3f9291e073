"""Status of runs with time, story, residual or energy; energy histories; halving of time steps that
do not converge."""

from types import SimpleNamespace

import numpy as np
import pytest

from building_cases import Force, Law, model, noise, oscillator, story, ten_bilinear, ten_linear
from tdint import run
from tdint.kernels import layout as rows
from tdint.response.runs import prepared
from tdint.response.runs.case import _runaway_story
from tdint.response.runs.measured_stability import largest_stable
from tdint.response.runs.outcome import FailedRun
from tdint.units import STANDARD_GRAVITY

TIMES = np.linspace(0.0, 2.0, 201)


def test_energy_histories_of_damped_vibration():
    """Each energy agrees, at every step, with the closed form for u'' + 2 xi omega u' + omega^2 u =
    0 from u = 1."""
    omega, xi = 2.0 * np.pi, 0.05
    case = oscillator(omega, xi, displacement=(1.0,))
    energy = run(case, method="impulse4", dt=0.01, duration=2.0, history=True).history.energy
    damped = omega * np.sqrt(1.0 - xi**2)
    decay = np.exp(-xi * omega * TIMES)
    u = decay * (np.cos(damped * TIMES) + xi * omega / damped * np.sin(damped * TIMES))
    v = -decay * omega**2 / damped * np.sin(damped * TIMES)
    total = 0.5 * omega**2
    assert np.allclose(energy.kinetic, 0.5 * v**2, atol=1e-6 * total)
    assert np.allclose(energy.strain, 0.5 * omega**2 * u**2, atol=1e-6 * total)
    assert np.allclose(
        energy.viscous + energy.dampers,
        total - 0.5 * v**2 - 0.5 * omega**2 * u**2,
        atol=1e-6 * total,
    )
    assert not energy.input.any() and not energy.hysteretic.any()
    assert np.max(np.abs(energy.error)) < 1e-6


def test_energy_histories_end_with_energy_balance_of_run():
    response = run(ten_bilinear(), noise(), method="newmark-average", history=True)
    history, total = response.history.energy, response.energy
    for name in ("input", "kinetic", "viscous", "strain", "hysteretic", "error"):
        assert getattr(history, name)[-1] == pytest.approx(getattr(total, name), rel=1e-12)
    assert np.all(np.diff(history.hysteretic) >= 0.0)
    assert np.all(np.diff(history.viscous) >= 0.0)
    without = run(ten_bilinear(), noise(), method="newmark-average")
    assert without.energy == total


def falling(height):
    """Return a story with P-delta effects that exceed the stiffness after yielding, so that the
    drift grows exponentially."""
    stiffness = 2.0 * STANDARD_GRAVITY / 3.0
    law = Law("bilinear", (0.05 * stiffness, 0.0))
    return model([story(1.0, stiffness, law, height=height)], p_delta=True, velocity=(0.5,))


@pytest.mark.parametrize("method", ["impulse4", "newmark-average", "bathe", "chang"])
def test_falling_building_is_collapsed_for_every_method(method):
    """The displacement grows without bound with a balanced energy, which is a property of the
    building. The results end at the collapse."""
    response = run(falling(3.0), method=method, dt=0.01, duration=100.0, history=True)
    assert response.status == "collapsed"
    assert response.collapse.ended and response.collapse.story == 1
    assert response.steps * response.dt == response.collapse.time
    ratio = np.abs(response.history.drift[:, 0]) / 3.0
    assert ratio[-2] <= 0.1 < ratio[-1] < 0.11
    # If the displacements are still bounded, the run ends with the same step.
    short = run(falling(3.0), method=method, dt=0.01, duration=response.collapse.time + 0.5)
    assert (short.status, short.collapse.time) == ("collapsed", response.collapse.time)
    assert short.collapse.ended and response.collapse.is_unbounded
    assert not short.collapse.is_unbounded
    assert short.stories.peak_drift_ratio[0] == response.stories.peak_drift_ratio[0]


def test_unstable_method_is_diverged():
    """The central difference method above its stability limit also exceeds the collapse drift, but
    with energy that the method produces."""
    with pytest.raises(FailedRun) as failure:
        run(
            model([story(1.0, 2500.0), story(1.0, 2500.0)], displacement=(0.01, 0.02)),
            method="central-difference", dt=0.06, duration=60.0, allow_unstable=True,
        )  # fmt: skip
    failed = failure.value
    assert (failed.status, failed.residual) == ("diverged", None)
    assert failed.story in (1, 2) and failed.energy > 1e6
    assert f"the drift of story {failed.story} grew without bound, kinetic energy" in str(failed)


def test_refused_time_step_reports_largest_stable_step():
    with pytest.raises(FailedRun) as failure:
        run(oscillator(50.0), method="central-difference", dt=0.05, duration=1.0)
    failed = failure.value
    assert (failed.status, failed.time, failed.dt) == ("unstable-step", 0.0, 0.05)
    assert failed.largest_stable_dt == pytest.approx(0.04, rel=1e-6)


@pytest.mark.parametrize("method", ["chang", "cr", "kr-alpha"])
def test_stiffening_laws_cause_note_for_model_based_methods(method):
    def notes(*coefficients):
        case = model(
            [story(1.0, 100.0), story(1.0, 100.0, Law("polynomial", coefficients))],
            forces=[Force(1, 1, 0, 2)],
        )
        return run(case, method=method, dt=0.01, duration=0.1).notes

    for stiffening in ((100.0, 5.0), (100.0, -5.0), (100.0, 0.0, 1.0)):
        (note,) = notes(*stiffening)
        assert "stable only for small time steps" in note and "story 2" in note
    assert notes(100.0) == notes(100.0, 0.0, -1.0) == ()


def test_run_that_gains_energy_is_diverged():
    """There are two cases: a collapse with energy that is produced by the method, and a final
    energy that is too large."""

    def overshooting(height, allow_unstable=False):
        case = model([story(1.0, 1.0, height=height)], velocity=(1.0,))
        return run(
            case,
            method="wilson",
            dt=20.0 * np.pi,
            duration=100.0 * np.pi,
            allow_unstable=allow_unstable,
        )

    with pytest.raises(
        FailedRun, match=r"diverged .* exceeded the collapse drift with .* times the input energy"
    ) as first:
        overshooting(15.0)
    with pytest.raises(
        FailedRun, match=r"diverged .* the final energy is .* times the input energy"
    ) as second:
        overshooting(None)
    for failure in (first, second):
        assert (failure.value.status, failure.value.story) == ("diverged", 1)
        assert failure.value.energy > 0.0
    allowed = overshooting(15.0, allow_unstable=True)
    assert allowed.status == "collapsed" and any(
        "produced by the method" in first for first in allowed.warnings
    )


@pytest.mark.parametrize("method", ["houbolt", "park"])
def test_multi_step_method_starts_substeps_with_average_acceleration(method):
    """If the first step is halved, two steps of average acceleration with half the time step are
    used."""
    case = model(
        [story(1.0, 100.0, Law("tanh", (5.0,)), height=None)] * 3, velocity=(-27.0, -6.0, 2.0)
    )
    halved, average = (
        run(case, method=name, dt=dt, duration=20.0, history=True, allow_unstable=True)
        for name, dt in ((method, 20.0), ("newmark-average", 10.0))
    )
    assert (halved.substeps, average.substeps) == (1, 0)
    assert np.allclose(halved.history.displacement[1], average.history.displacement[2], rtol=1e-10)
    assert any("halved" in note for note in halved.notes)


@pytest.mark.parametrize("method", ["impulse4", "impulse4:rho_inf=0"])
@pytest.mark.parametrize("dt", [2.0, 5.0, 50.0])
def test_branch_changes_within_very_large_steps_are_ignored(method, dt):
    """With time steps of many periods, the interpolation does not determine the unloading of a
    story. The laws remain on their branches."""
    law = Law("peak-oriented", (5.0, 0.01, 0.4))
    case = model([story(1.0, 100.0, law, height=None)] * 3, velocity=(5.0, 30.0, -20.0))
    history = run(
        case, method=method, dt=dt, duration=40 * dt, history=True, allow_unstable=True
    ).history
    backbone = 5.0 + 0.01 * 100.0 * (np.max(np.abs(history.drift)) - 0.05)
    assert np.all(np.abs(history.shear) <= backbone * (1.0 + 1e-9))
    assert np.all(history.energy.hysteretic >= -1e-9 * np.max(history.energy.kinetic))


@pytest.mark.parametrize(
    "method", ["newmark-average", "impulse4", "houbolt", "park", "gauss4", "wilson", "hht"]
)
def test_halved_steps_converge_and_are_counted(method, monkeypatch):
    """Weak stories with a large initial velocity and a time step of thirty periods do not converge
    without halving."""
    case = model(
        [story(1.0, 100.0, Law("tanh", (5.0,)), height=None)] * 3, velocity=(100.0, -50.0, 10.0)
    )
    response = run(case, method=method, dt=20.0, duration=800.0, allow_unstable=True)
    assert response.substeps > 0
    assert any(f"were halved ({response.substeps} time" in note for note in response.notes)
    assert np.all(response.stories.peak_drift > 0.0) and np.all(
        np.isfinite(response.stories.peak_drift)
    )
    monkeypatch.setattr(prepared, "HALVINGS", 0)
    with pytest.raises(FailedRun) as failure:
        run(case, method=method, dt=20.0, duration=800.0)
    failed = failure.value
    assert (failed.status, failed.energy, failed.largest_stable_dt) == ("not-converged", None, None)
    assert failed.time < 800.0 and failed.story in (1, 2, 3) and 1e-11 < failed.residual <= 1.0


def test_history_has_ground_motion_and_relative_energy_error():
    """Under a motion scaled by 1e-4, a linear building has 1e-8 of the energy and the same relative
    error."""
    record = noise(samples=201)
    unscaled, small = (
        run(ten_linear(), motion, method="bathe", history=True)
        for motion in (record, record.scaled(1e-4))
    )
    assert np.array_equal(unscaled.history.ground_acceleration, record.acceleration)
    assert np.max(np.abs(unscaled.history.energy.error)) > 1e-6
    assert small.history.energy.error == pytest.approx(
        unscaled.history.energy.error, rel=1e-6, abs=1e-12
    )


def test_diverging_story_has_largest_drift():
    """The first story with a non-finite drift has priority. The last value of the state is the
    displacement of the ground."""
    for displacements, number in (
        ([1.0, -2.0, -2.5], 2),
        ([4.0, 5.0, 6.0], 1),
        ([0.1, 0.2, 3.0], 3),
        ([1.0, np.inf, np.nan], 2),
        ([np.nan, 1e9, 0.0], 1),
        ([0.0, 0.0, -np.inf], 3),
    ):
        state = np.zeros((5, 4))
        state[rows.DISPLACEMENT] = [*displacements, 1e99]
        assert _runaway_story(SimpleNamespace(state=state), state.shape[1] - 1) == number


def test_largest_stable_step_is_end_of_first_stable_range():
    """The result is rounded down. It is the end of the first of several stable ranges, the complete
    range if all steps are stable, and 0 if no step is stable."""
    tried_steps = []

    def within(*ranges):
        return lambda step: (
            tried_steps.append(step) or any(low < step <= high for low, high in ranges)
        )

    for ends, expected in (
        (((0.0, 0.37),), 0.37),
        (((0.0, 0.113), (0.2, 9.0)), 0.113),
        (((0.0, 9.0),), 2.0),
    ):
        found = largest_stable(within(*ends), 2.0)
        assert found <= expected and found == pytest.approx(expected, rel=1e-9)
    assert largest_stable(within((0.5, 9.0)), 2.0) == 0.0
    assert min(tried_steps) > 0.0 and max(tried_steps) <= 2.0


@pytest.mark.parametrize(
    ("duration", "noted"), [(1.0, False), (0.99 * 2, False), (2.0, True), (2.5, True)]
)
def test_run_beyond_end_of_record_has_note(duration, noted):
    """A record of 199 intervals of 0.01 s ends at 1.99 s."""
    response = run(
        oscillator(6.0, 0.05),
        noise(samples=200),
        method="newmark-average",
        duration=duration,
        dt=0.01,
    )
    assert ("the record ends at 1.99 s; the ground is at rest after it" in response.notes) == noted
