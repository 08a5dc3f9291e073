"""Public models with contact, against `scipy.integrate.solve_ivp` with each closing and opening as
an event: a mass with a one-sided stop of a spring and a damper, two sticks that are linked and
collide, and buildings of ten and twenty stories with a contact element on each common floor."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import tdint

STEP = 0.01
TIME = STEP * np.arange(201)
MOTION = 4.0 * np.sin(7.3 * TIME) * np.exp(-0.2 * TIME) + 1.7 * np.sin(19.0 * TIME)
RECORD = tdint.make_record(MOTION, dt=STEP, units="m/s^2")


def reference(mass, springs, dampers, joints):
    """Return the peak displacements of all masses, the peak forces of the stops, and the number of
    closings.

    `springs` and `dampers` are matrices. A joint is (row of deformations, gap, stiffness, dashpot):
    the spring acts on the deformation above the gap, the dashpot while the joint is closed.
    """
    n = len(mass)
    rows, gaps, stops, dashpots = (
        np.array([joint[k] for joint in joints], dtype=float) for k in range(4)
    )

    def rate(t, y, closed):
        u, v = y[:n], y[n:]
        force = springs @ u + dampers @ v
        force += rows.T @ (closed * (stops * (rows @ u - gaps) + dashpots * (rows @ v)))
        return np.append(v, -force / mass - np.interp(t, TIME, MOTION))

    events = [lambda t, y, _, i=i: rows[i] @ y[:n] - gaps[i] for i in range(len(joints))]
    for event in events:
        event.terminal = True
    t, y, closed, closings = 0.0, np.zeros(2 * n), np.zeros(len(joints)), 0
    peaks, forces = np.zeros(n), np.zeros(len(joints))
    while t < TIME[-1]:
        for event, is_closed in zip(events, closed, strict=True):
            event.direction = -1.0 if is_closed else 1.0
        part = solve_ivp(
            *(rate, (t, TIME[-1]), y),
            method="DOP853", args=(closed,), events=events, dense_output=True,
            rtol=1e-9, atol=1e-11, max_step=STEP / 2,
        )  # fmt: skip
        motion = part.sol(np.linspace(t, part.t[-1], 1000))[:n]
        peaks = np.maximum(peaks, np.abs(motion).max(axis=1))
        forces = np.maximum(forces, (stops[:, None] * (rows @ motion - gaps[:, None])).max(axis=1))
        t, y, closed = part.t[-1], part.y[:, -1], closed.copy()
        for i, times in enumerate(part.t_events):
            if times.size:
                closed[i] = 1.0 - closed[i]
                closings += int(closed[i])
    return peaks, forces, closings


def chain(values):
    """Return the matrix of a chain of springs or dampers."""
    ends = np.eye(len(values)) - np.eye(len(values), k=-1)
    return (ends.T * values) @ ends


def joint_between(first, second, count, gap, stop, dashpot):
    """Return a joint for `reference` that closes if mass `first` approaches mass `second`; None
    for a rigid wall."""
    row = np.zeros(count)
    row[first] = 1.0
    if second is not None:
        row[second] = -1.0
    return row, gap, stop, dashpot


def contact(gap, stop, dashpot):
    """Return the law of a joint: it closes if the end of the link moves against the start."""
    law = {"type": "gap", "gap": gap, "stop_stiffness": stop, "sides": "negative"}
    return law | ({"dashpot": dashpot} if dashpot else {})


def second_building(masses, springs, dampers):
    """Return the attachments and links of a building beside the first."""
    attachments = [
        {"name": f"east{i}", "floor": "ground", "mass": mass, "stiffness": 0}
        for i, mass in enumerate(masses, start=1)
    ]
    ends = ["ground", *(item["name"] for item in attachments)]
    columns = [
        {"name": f"column{i}", "from": low, "to": high, "stiffness": k, "dashpot": c}
        for i, (low, high, k, c) in enumerate(
            zip(ends[:-1], ends[1:], springs, dampers, strict=True), start=1
        )
    ]
    return attachments, columns


def compare(model, expected, method="impulse4"):
    """Compare the peaks of a run with the reference; the joints are the last links."""
    peaks, forces, closings = expected
    response = tdint.run(model, RECORD, method=method, dt=STEP / 4, duration=TIME[-1], check=False)
    found, devices = response.stories.peak_displacement, response.devices.stories
    found = np.append(found, devices.peak_displacement[: len(peaks) - found.size])
    assert found == pytest.approx(peaks, rel=1e-4)
    found = devices.peak_shear[-len(forces) :]
    assert found == pytest.approx(forces, rel=1e-4, abs=1e-5 * forces.max())
    assert len(response.contacts) == closings >= 3


@pytest.mark.long
@pytest.mark.parametrize("method", ["impulse4", "moment4"])
def test_mass_with_a_one_sided_stop(method):
    """Number 112: the stop is a link to the ground, which acts on one side of the mass."""
    m, k, c = 2.0e4, 1.6e6, 6.0e3
    link = {"from": "ground", "to": 1, "law": contact(0.008, 2.5e7, 9.0e4)}
    link["law"]["sides"] = "positive"
    model = {
        "stories": [{"mass": m, "stiffness": k, "dashpot": c}],
        "links": [{"name": "stop", **link}],
        "plausibility": "off, test",
    }
    joint = joint_between(0, None, 1, 0.008, 2.5e7, 9.0e4)
    expected = reference(np.array([m]), np.array([[k]]), np.array([[c]]), [joint])
    compare(model, expected, method)


@pytest.mark.long
def test_linked_sticks():
    """Number 114: sticks of three and two stories with a damper between the first floors, and a
    contact between the second floors."""
    one = [3.0e4, 2.5e4, 2.0e4], [2.4e7, 2.0e7, 1.5e7], [6e4, 5e4, 4e4]
    two = [4.0e4, 3.0e4], [9.0e6, 7.0e6], [5e4, 4e4]
    attachments, columns = second_building(*two)
    gap, stop, dashpot, damper = 0.01, 6.0e7, 3.0e5, 8.0e4
    links = [
        *columns,
        {"name": "damper", "from": 1, "to": "east1", "dashpot": damper},
        {"name": "joint", "from": 2, "to": "east2", "law": contact(gap, stop, dashpot)},
    ]
    stories = [
        {"mass": mass, "stiffness": spring, "dashpot": dashpot_of_story}
        for mass, spring, dashpot_of_story in zip(*one, strict=True)
    ]
    model = {"stories": stories, "attachments": attachments, "links": links}
    springs, dampers = np.zeros((5, 5)), np.zeros((5, 5))
    for part, (_, k, c) in ((slice(3), one), (slice(3, 5), two)):
        springs[part, part], dampers[part, part] = chain(k), chain(c)
    tie = np.array([1.0, 0.0, 0.0, -1.0, 0.0])
    dampers += damper * np.outer(tie, tie)
    joint = joint_between(1, 4, 5, gap, stop, dashpot)
    expected = reference(np.array([*one[0], *two[0]]), springs, dampers, [joint])
    compare(model | {"plausibility": "off, test"}, expected)


@pytest.mark.long
def test_buildings_of_ten_and_twenty_stories():
    """Number 149: a contact element of Kelvin and Voigt on each of the ten common floors."""
    tall = [3.0e5] * 20, np.linspace(6.0e8, 2.5e8, 20).tolist(), [1.5e6] * 20
    low = [2.5e5] * 10, np.linspace(9.0e8, 5.0e8, 10).tolist(), [1.0e6] * 10
    attachments, columns = second_building(*low)
    gap, stop, dashpot = 0.02, 8.0e8, 2.0e6
    joints = [
        {
            "name": f"joint{i}",
            "from": i,
            "to": f"east{i}",
            "law": contact(gap, stop, dashpot),
        }
        for i in range(1, 11)
    ]
    stories = [
        {"mass": mass, "height": 3.2, "stiffness": spring, "dashpot": damper}
        for mass, spring, damper in zip(*tall, strict=True)
    ]
    model = {"stories": stories, "attachments": attachments, "links": [*columns, *joints]}
    springs, dampers = np.zeros((30, 30)), np.zeros((30, 30))
    for part, (_, k, c) in ((slice(20), tall), (slice(20, 30), low)):
        springs[part, part], dampers[part, part] = chain(k), chain(c)
    expected = reference(
        np.array([*tall[0], *low[0]]),
        *(springs, dampers),
        [joint_between(i, 20 + i, 30, gap, stop, dashpot) for i in range(10)],
    )
    compare(model | {"plausibility": "off, test"}, expected)
