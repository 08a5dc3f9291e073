"""Tests against published numbers that are not cases of the validation page (tests/validation)."""

import numpy as np
import pytest

from building_cases import ModalDamping, model, oscillator, story
from tdint import run
from tdint.ground_motion.record import Record
from tdint.model.building import assemble

# A. K. Chopra, Dynamics of Structures, 4th ed., example 5.3
AVERAGE_A = [
    17.4666, 23.1801, 12.3719, -11.5175, -38.1611, -54.6722, -33.6997, -2.1211, 28.4423, 47.3701,
]  # fmt: skip


def test_average_acceleration_agrees_with_published_table():
    """The load is a half-cycle sine p = 10 sin(pi t / 0.6) up to 0.6 s, as a ground motion -p / m
    that is sampled at the steps."""
    t, mass = 0.1 * np.arange(11), 0.2533
    load = np.where(t < 0.6, 10.0 * np.sin(np.pi * t / 0.6), 0.0)
    record = Record(-load / mass, 0.1, "", "", "", "half-sine")
    building = model([story(mass, 10.0)], damping=ModalDamping((0.05,)))
    history = run(building, record, method="newmark-average", history=True).history
    relative = history.absolute_acceleration[:, 0] - history.ground_acceleration
    # The table was computed with m to four digits: 1e-3 of the largest entry.
    assert relative[1:] == pytest.approx(AVERAGE_A, abs=1e-3 * 54.7)


def test_roof_displacement_of_five_stories_by_two_modes():
    """The roof displacement at 2 s under ag = 1.93 sin 2 pi t for t <= 1 s is the sum of the
    responses of two modal oscillators."""
    modes = assemble(model([story(25910.0, 1e7)] * 5)).modes()
    t, roof = 0.1 * np.arange(21), 0.0
    record = Record(
        np.where(t < 1.05, 1.93 * np.sin(2.0 * np.pi * t), 0.0), 0.1, "", "", "", "sine"
    )
    for j in range(2):
        history = run(
            oscillator(modes.omega[j], 0.05), record, method="newmark-linear", history=True
        ).history
        roof += (
            modes.shapes[-1, j] * (modes.mass @ modes.shapes[:, j]) * history.displacement[-1, 0]
        )
    assert roof == pytest.approx(0.05888401249961952, rel=1e-12)
