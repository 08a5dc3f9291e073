"""Adjacent buildings that collide: attachments that only links hold, and links with the law gap,
against `scipy.integrate.solve_ivp` with the closings as events."""

import io
from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import simpson, solve_ivp

import tdint
from tdint.errors import ModelError
from tdint.ground_motion.record import Record
from tdint.model.building import assemble
from tdint.model.config.model_file import load_model
from tdint.response.runs.contacts import LinkContact, with_errors

STEP = 0.01
TIME = STEP * np.arange(251)
MOTION = Record(
    3.1 * np.sin(5.3 * TIME) * np.exp(-0.2 * TIME) + 1.3 * np.sin(13.0 * TIME),
    *(STEP, "", "", "", "motion"),
)
BUILDINGS = """
units: {{length: m, force: kN, mass: t}}
stories:
  - {{mass: 90, height: 3, stiffness: 9.0e3, dashpot: 80}}
  - {{mass: 75, height: 3, stiffness: 7.0e3, dashpot: 70}}
damping: none
plausibility: off, test
attachments:
  - {{name: east1, floor: ground, mass: 70, stiffness: 0}}
  - {{name: east2, floor: ground, mass: 55, stiffness: 0}}
links:
  - {{name: column1, from: ground, to: east1, stiffness: 2.4e4, dashpot: 110}}
  - {{name: column2, from: east1, to: east2, stiffness: 2.1e4, dashpot: 90}}
  - {{name: joint, from: 2, to: east2, law: {{type: gap, gap: 0.02, stop_stiffness: 3.0e4,
     sides: negative{law}}}}}
"""
HERTZ = BUILDINGS.replace("type: gap", "type: hertz")
MASS = 1e3 * np.array([90.0, 75.0, 70.0, 55.0])


def reference(stop, damping_of):
    """Peak displacements of the floors, peak spring force of the joint, and time, duration, peak
    force and energy of each contact.

    `stop` is the force of the stop, N, as a function of the overlap, m; `damping_of` the
    coefficient of its dashpot as a function of this force and of the approach velocity.
    """
    stiffness, damping = 1e3 * np.array([9e3, 7e3, 2.4e4, 2.1e4]), 1e3 * np.array([80, 70, 110, 90])
    drifts = np.eye(4)
    drifts[1, 0] = drifts[3, 2] = -1.0

    ground = [*MOTION.acceleration.tolist(), 0.0]
    system = np.zeros((8, 8))
    system[:4, 4:] = np.eye(4)
    for columns, coefficients in ((slice(0, 4), stiffness), (slice(4, 8), damping)):
        system[4:, columns] = -(drifts.T * coefficients @ drifts) / MASS[:, None]

    def contact(y, approach, larger=np.maximum):
        spring = stop(larger(y[1] - y[3] - 0.02, 0.0))
        return spring, damping_of(spring, approach) * (y[5] - y[7])

    def rate(t, y, approach):
        change = system @ y
        sample, rest = divmod(t / STEP, 1.0)  # as np.interp, in a tenth of its time
        first, second = ground[int(sample) : int(sample) + 2]
        change[4:] -= first + rest * (second - first)
        if approach:
            force = sum(contact(y.tolist(), approach, max))
            change[5] -= force / MASS[1]
            change[7] += force / MASS[3]
        return change

    def closing(t, y, _):
        return y[1] - y[3] - 0.02

    closing.terminal = True
    contacts = []
    t, y, approach, peaks = 0.0, np.zeros(8), 0.0, np.zeros(5)
    while t < TIME[-1]:
        closing.direction = -1.0 if approach else 1.0
        part = solve_ivp(
            *(rate, (t, TIME[-1]), y),
            method="DOP853", args=(approach,), events=closing, dense_output=True,
            rtol=1e-9, atol=1e-12, max_step=STEP,
        )  # fmt: skip
        motion = part.sol(np.linspace(t, part.t[-1], 2001))
        spring, damper = contact(motion, approach or 1.0)
        peaks = np.maximum(peaks, np.abs([*motion[:4], spring]).max(axis=1))
        if approach:
            duration, power = part.t[-1] - t, damper * (motion[5] - motion[7])
            energy = simpson(power, dx=duration / 2000)
            contacts.append((t, duration, np.abs(spring + damper).max(), energy))
        t, y = part.t[-1], part.y[:, -1]
        approach = 0.0 if approach else y[5] - y[7]
    return peaks, contacts


def kelvin(dashpot):
    return BUILDINGS, lambda overlap: 3.0e7 * overlap, lambda spring, approach: dashpot


def hertz(factor):
    """Hertz, 30 000 kN/m^1.5, with zeta = `factor` stop_stiffness / approach velocity."""
    return (
        HERTZ,
        lambda overlap: 3.0e7 * overlap**1.5,
        lambda spring, approach: factor * spring / approach,
    )


@pytest.mark.parametrize(
    ("law", "contact"),
    [
        ("", kelvin(0.0)),
        (", dashpot: 500", kelvin(5e5)),
        # 2 xi sqrt(k m) with xi = -ln e / sqrt(pi^2 + ln^2 e), m = 75 x 55 / 130 t
        (", restitution: 0.6", kelvin(2.0 * 0.160500 * np.sqrt(3.0e7 * 31.730769e3))),
        ("", hertz(0.0)),
        (", restitution: 0.5", hertz(0.5625)),  # 3 (1 - e^2) / 4
    ],
)
def test_contact_of_adjacent_buildings(law, contact):
    text, *forces = contact
    model = load_model(io.StringIO(text.format(law=law)))
    response = tdint.run(model, MOTION, dt=STEP / 4, duration=TIME[-1], check=False)
    devices = response.devices.stories
    peaks = [*response.stories.peak_displacement, *devices.peak_displacement[:2]]
    right, contacts = reference(*forces)
    assert [*peaks, devices.peak_shear[-1]] == pytest.approx(right, rel=1e-4)
    found = response.contacts
    assert [item.closing for item in found] == list(range(1, len(contacts) + 1))
    for item, (time, duration, force, energy) in zip(found, contacts, strict=True):
        assert (item.link, item.time) == ("joint", pytest.approx(time, rel=1e-4))
        assert item.duration == pytest.approx(duration, rel=1e-3, abs=1e-5)
        assert item.peak_force == pytest.approx(force, rel=2e-3)
        # The rate has a kink within the steps of a closing.
        assert item.dissipated_energy == pytest.approx(energy, rel=1e-2)
    lost = sum(energy for *_, energy in contacts)
    assert response.devices.dissipated_energy[-1] == pytest.approx(lost, rel=1e-3, abs=1e-6)


@pytest.mark.parametrize("step", [STEP / 4, STEP])
def test_errors_of_contacts_cover_the_true_errors(step):
    """The numbers of all contacts are compared with the separate solution."""
    text, *forces = kelvin(5e5)
    model = load_model(io.StringIO(text.format(law=", dashpot: 500")))
    response = tdint.run(model, MOTION, dt=step, duration=TIME[-1], history=True)
    assert response.check.of_contacts.args[0].history is None
    found = response.contacts
    _, contacts = reference(*forces)
    assert len(found) == len(contacts) == 3
    for item, (time, duration, force, energy) in zip(found, contacts, strict=True):
        errors = item.errors
        assert (errors.link, errors.closing) == (item.link, item.closing)
        for name, right in (
            ("time", time), ("duration", duration), ("peak_force", force),
            ("dissipated_energy", energy),
        ):  # fmt: skip
            error, estimate = abs(getattr(item, name) - right), getattr(errors, name)
            assert error <= 2.0 * estimate + 1e-6 * right, (item.closing, name)
            assert estimate <= 0.2 * right, name


def test_accelerations_just_after_a_damped_closing():
    """Those of `impulse4` converge with order 4; estimates of `moment4` cover its errors."""
    model = load_model(io.StringIO(BUILDINGS.format(law=", dashpot: 3000")))

    def peaks(step, method="impulse4", **options):
        return tdint.run(model, MOTION, dt=step, method=method, duration=TIME[-1], **options)

    right, long, short = (
        peaks(STEP / parts, check=False).stories.peak_absolute_acceleration[0]
        for parts in (32, 1, 2)
    )
    assert abs(long - right) > 12.0 * abs(short - right) > 0.0
    found = peaks(STEP / 4, "moment4")
    error = (
        1.0
        - found.stories.peak_absolute_acceleration[1]
        / (peaks(STEP / 4, check=False).stories.peak_absolute_acceleration[1])
    )
    estimate = found.check.errors.peak_absolute_acceleration[1]
    assert 0.01 < error < 0.04
    assert error <= estimate / found.stories.peak_absolute_acceleration[1] < 0.1


def test_contacts_that_the_additional_run_does_not_have_are_without_error():
    one = LinkContact("joint", 1, 1.0, 0.01, 0.3, 5.0, 0.0)
    other = replace(one, time=1.002, peak_force=5.5)
    grazing, of_another = replace(one, closing=2, time=1.3), replace(one, link="b")
    first, second, third = with_errors(
        (one, grazing, of_another), (other,), lambda own, finer, size: abs(own - finer) + 0 * size
    )
    assert first.errors.numbers == pytest.approx((0.002, 0.0, 0.0, 0.5, 0.0))
    assert np.isnan([*second.errors.numbers, *third.errors.numbers]).all()


@pytest.mark.parametrize(("text", "method"), [
    *((BUILDINGS, method) for method in ("gauss4", "moment4", "newmark-average")),
    *((HERTZ, method) for method in ("gauss4", "moment4", "newmark-average")),
])  # fmt: skip
def test_methods_agree_on_pounding(text, method):
    model = load_model(io.StringIO(text.format(law="")))
    response = tdint.run(model, MOTION, method=method, dt=STEP / 10, duration=1.0, check=False)
    other = tdint.run(model, MOTION, dt=STEP / 10, duration=1.0, check=False)
    assert response.devices.stories.peak_drift == pytest.approx(
        other.devices.stories.peak_drift, rel=2e-3
    )


FREE = """
units: {length: cm, force: kN, mass: t}
stories:
  - {mass: 90, height: 300, stiffness: 1.0e-6}
damping: none
plausibility: off, test
attachments:
  - {name: east, floor: ground, mass: 60, stiffness: 1.0e-6}
links:
  - {name: joint, from: 1, to: east, law: {type: hertz, gap: 2, stop_stiffness: 400, sides: SIDE,
     restitution: 0.6}}
initial: {velocity: [SPEED]}
"""
"""Two free masses, one of which collides with the other at 1 m/s. 400 kN/cm^1.5 are 4e8 N/m^1.5."""


@pytest.mark.parametrize(("side", "speed"), [("negative", 100), ("positive", -100)])
def test_impact_of_hertz_damp(side, speed):
    text = FREE.replace("SIDE", side).replace("SPEED", str(speed))
    motion = Record(np.zeros(21), 0.01, "", "", "", "rest")
    model = load_model(io.StringIO(text))
    response = tdint.run(model, motion, dt=0.001, history=True, check=False)
    history = response.history
    velocity, other = history.velocity[-1, 0], history.devices.velocity[-1, 0]
    assert 90.0 * velocity + 60.0 * other == pytest.approx(0.9 * speed, rel=1e-6)
    # m d'' = -k d^1.5 (1 + z d' / v) with z = 3 (1 - e^2) / 4 has the ratio r of the velocities
    # after and before the impact with ln((1 + z) / (1 - z r)) = z (1 + r): 0.756 for e = 0.6.
    ratio = abs(other - velocity) / abs(speed / 100)
    assert np.log(1.48 / (1.0 - 0.48 * ratio)) == pytest.approx(0.48 * (1.0 + ratio), rel=1e-6)
    assert ratio == pytest.approx(0.7561487, rel=1e-5)
    lost = 0.5 * 36e3 * (1.0 - ratio**2)  # of the reduced mass 90 x 60 / 150 t
    assert response.devices.dissipated_energy[-1] == pytest.approx(lost, rel=1e-4)
    (contact,) = response.contacts
    assert contact.dissipated_energy == pytest.approx(lost, rel=1e-4)
    assert contact.approach_velocity == pytest.approx(1.0, rel=1e-6)
    assert abs(response.energy.error) < 1e-4


def test_hertz_damp_requires_impulse4():
    model = load_model(io.StringIO(HERTZ.format(law=", restitution: 0.5")))
    message = "moment4 does not support `restitution` of the law hertz; use impulse4"
    with pytest.raises(tdint.TdintError, match=message):
        tdint.run(model, MOTION, method="moment4")


def test_masses_on_the_ground_are_no_part_of_the_building():
    text = BUILDINGS.format(law="")
    model = load_model(io.StringIO(text.replace("damping: none", "damping: none\np_delta: true")))
    building = assemble(model)
    bare = assemble(load_model(io.StringIO(text.partition("attachments")[0].replace("{{", "{")
        .replace("damping: none", "damping: none\np_delta: true"))))  # fmt: skip
    assert building.initial_stiffness[:2] == pytest.approx(bare.initial_stiffness)
    history = tdint.run(model, MOTION, duration=0.3, history=True, check=False).history
    inertia = -history.absolute_acceleration @ (1e3 * np.array([90.0, 75.0]))
    assert history.total_shear[:, 0] == pytest.approx(inertia)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("links:", "  - {name: free, floor: ground, mass: 55, stiffness: 0}\nlinks:",
         "or links with a stiffness must"),
        ("stop_stiffness: 3.0e4", "stop_stiffness: 0", "the stop has no stiffness"),
        (
            "to: east2, law",
            "to: east2, stiffness: 9, law",
            "a dashpot or a restitution acts in contact only",
        ),
        ("sides: negative", "sides: negative, restitution: 0.5", "either dashpot or restitution"),
        ("stiffness: 7.0e3", "elements: [{type: linear, stiffness: 7e3}, {type: gap, gap: 0.1, "
         "stop_stiffness: 1e4, restitution: 0.5}]", "possible in attachments and links only"),
    ],
)  # fmt: skip
def test_invalid_contacts(old, new, message):
    text = BUILDINGS.format(law=", dashpot: 500").replace(old, new)
    with pytest.raises(ModelError, match=message):
        load_model(io.StringIO(text))
