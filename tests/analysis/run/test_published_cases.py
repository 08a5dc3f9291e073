"""Published numbers.

Step tables: A. K. Chopra, Dynamics of Structures, 4th ed., examples 5.3 to 5.6, as in OpenSees' verification files.
Eigenvalues: OpenSees, SmallEigen example. Periods: Chopra, sect. 12.8, five-story shear building.
"""

import math

import numpy as np
import pytest

from building_cases import LINEAR, Law, ModalDamping, model, oscillator, story
from tdint import run
from tdint.ground_motion.record import Record
from tdint.model.building import assemble

AVERAGE_U = [0.0437, 0.2326, 0.6121, 1.0825, 1.4309, 1.4231, 0.9622, 0.1908, -0.6044, -1.1442]
AVERAGE_A = [17.4666, 23.1801, 12.3719, -11.5175, -38.1611, -54.6722, -33.6997, -2.1211, 28.4423, 47.3701]
LINEAR_U = [0.0300, 0.2193, 0.6166, 1.1130, 1.4782, 1.4625, 0.9514, 0.1273, -0.6954, -1.2208]
PLASTIC_U = [0.0437, 0.2326, 0.6121, 1.1143, 1.6214, 1.9891, 2.0951, 1.9240, 1.5602]

M, K = 0.2533, 10.0
C = 2.0 * 0.05 * math.sqrt(K * M)


def chopra(method, law=LINEAR):
    """Half-cycle sine p = 10 sin(pi t / 0.6) to 0.6 s, then nothing; dt 0.1, steps 0 to 10.

    Newmark's methods see the load at the steps only, so it may come as a ground motion -p / m sampled there.
    """
    t = 0.1 * np.arange(11)
    load = np.where(t < 0.6, 10.0 * np.sin(np.pi * t / 0.6), 0.0)
    building = model([story(M, K, law, dashpot=C)])
    return run(building, Record(-load / M, 0.1, "", "", "", "half-sine"), method=method, history=True).history


@pytest.mark.parametrize(
    ("method", "table"), [("newmark-average", AVERAGE_U), ("newmark-linear", LINEAR_U)], ids=["average", "linear"]
)
def test_displacement_tables(method, table):
    assert chopra(method).displacement[1:, 0] == pytest.approx(table, abs=1e-3)


def test_acceleration_table():
    history = chopra("newmark-average")
    relative = history.acceleration[:, 0] - history.ground_acceleration
    # The table was computed with m to four digits: 1e-3 of the largest entry.
    assert relative[1:] == pytest.approx(AVERAGE_A, abs=1e-3 * 54.7)


def test_elastoplastic_table():
    """Yield displacement 0.75."""
    history = chopra("newmark-average", Law("bilinear", (0.75 * K, 0.0)))
    assert history.displacement[1:10, 0] == pytest.approx(PLASTIC_U, abs=1e-3)


def test_eigenvalues():
    stories = [story(m, k) for m, k in ((11.1, 30.0), (22.2, 20.0), (33.3, 10.0))]
    omega = assemble(model(stories)).modes().omega
    assert omega**2 == pytest.approx([0.139300647653736, 1.05865310768512, 4.9582024008173], rel=1e-6)


def test_periods_of_the_five_story_building():
    """m = 100 kip / g, k = 31.54 kip / in, g = 386.4 in / s^2."""
    modes = assemble(model([story(100.0 / 386.4, 31.54)] * 5)).modes()
    assert 2.0 * math.pi / modes.omega == pytest.approx([1.99963, 0.68504, 0.43456, 0.33828, 0.29659], abs=2e-5)


def five_stories(law=LINEAR):
    """Five floors of 25 910 kg, k = 1e7 N/m, 5 % in all modes (constant, from the initial stiffness)."""
    return model([story(25910.0, 1e7, law)] * 5, damping=ModalDamping((0.05,)))


def one_sine():
    """ag = 1.93 sin 2 pi t for t <= 1 s, then nothing; dt 0.1, to 2 s."""
    t = 0.1 * np.arange(21)
    return Record(np.where(t < 1.05, 1.93 * np.sin(2.0 * np.pi * t), 0.0), 0.1, "", "", "", "sine")


@pytest.mark.parametrize(
    ("hardening", "roof", "digits"), [(0.05 / 1.05, 0.03998638459760687, 1e-13), (0.05, 0.0403738049, 2e-9)]
)
def test_five_yielding_stories_with_modal_damping(hardening, roof, digits):
    """Roof displacement at 2 s, average acceleration, yield force 125 kN (published, computed again)."""
    response = run(
        five_stories(Law("bilinear", (125e3, hardening))), one_sine(), method="newmark-average", history=True
    )
    assert response.history.displacement[-1, -1] == pytest.approx(roof, rel=digits)
    assert response.stories.ductility.max() > 5.0


def test_five_linear_stories_by_their_first_two_modes():
    """Linear acceleration: the first two modes as oscillators, added up."""
    modes = assemble(five_stories()).modes()
    roof = 0.0
    for j in range(2):
        history = run(oscillator(modes.omega[j], 0.05), one_sine(), method="newmark-linear", history=True).history
        roof += modes.shapes[-1, j] * (modes.mass @ modes.shapes[:, j]) * history.displacement[-1, 0]
    assert roof == pytest.approx(0.05888401249961952, rel=1e-12)
