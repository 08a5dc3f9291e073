"""Jumps of the ground acceleration between steps that are longer than the sampling interval."""

import numpy as np
import pytest

from tdint.kernels import layout as rows
from tdint.kernels.stepping import Memory, Scene, Seen
from tdint.kernels.time_loop.observer import shift_ground

MASS = np.array([2.0, 3.0])
VELOCITY = np.array([0.4, -1.1])
ACCELERATION = np.array([5.0, 0.7])


@pytest.mark.parametrize("grounds", [(1.0,), (1.0, 3.0), (1.0, 3.0, -0.5)])
def test_power_of_load_after_jumps(grounds):
    """The relative accelerations change by the old minus the new ground acceleration. The power of
    the load is -ag (sum of m v), and its rate -ag (sum of m a), also after several jumps without a
    step between them, as when a step fails and is halved."""
    linear_terms = np.zeros((rows.LINEAR_TERM_ROWS, 3))
    linear_terms[rows.MASS, :2] = MASS
    scene = Scene(
        linear_terms,
        np.zeros((0, 3)),
        np.zeros((0, 3)),
        np.zeros((0, rows.FORCE_COLUMNS)),
        np.zeros(rows.FLAGS_SIZE),
    )
    step_status = np.zeros(rows.STEP_STATUS_SIZE)
    old_ground = step_status[rows.STATE_GROUND] = 0.3
    memory = Memory(np.zeros((3, 3)), np.zeros((0, 3)), np.zeros((0, 3)), step_status)
    memory.state[2, :2] = ACCELERATION
    observer_state = np.zeros((rows.OBSERVER_ROWS, 3))
    observer_state[rows.A_PREVIOUS, :2] = ACCELERATION
    totals = np.zeros(rows.TOTALS_SIZE)
    totals[rows.TOTAL_MASS] = MASS.sum()
    totals[rows.MOMENTUM] = MASS @ VELOCITY
    totals[rows.TOTAL_INERTIA] = MASS @ ACCELERATION
    totals[rows.POWER_INPUT] = -old_ground * (MASS @ VELOCITY)
    totals[rows.RATE_INPUT] = -old_ground * (MASS @ ACCELERATION)
    seen = Seen(observer_state, np.zeros(0), np.zeros((3, 2)), totals, np.zeros((0, 0)))

    for ground in grounds:
        load = np.zeros(rows.LOAD_SIZE)
        load[rows.GROUND_0] = ground
        shift_ground(scene, load, np.array([0.0, 0.0, 1.0]), memory, seen)

    acceleration = ACCELERATION + old_ground - grounds[-1]
    assert memory.state[2, :2] == pytest.approx(acceleration, rel=1e-14)
    assert observer_state[rows.A_PREVIOUS, :2] == pytest.approx(acceleration, rel=1e-14)
    assert totals[rows.POWER_INPUT] == pytest.approx(-grounds[-1] * (MASS @ VELOCITY), rel=1e-14)
    assert totals[rows.RATE_INPUT] == pytest.approx(-grounds[-1] * (MASS @ acceleration), rel=1e-14)
    assert totals[rows.TOTAL_INERTIA] == pytest.approx(MASS @ acceleration, rel=1e-14)
