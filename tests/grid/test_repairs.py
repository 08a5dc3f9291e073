"""Cases of repairs that random cases meet too seldom: each fails if its repair is removed."""

import csv
import math
from pathlib import Path

import numpy as np
import pytest

from grid.axes import build
from grid.covering import read
from grid.judge import judge
from grid.solver import solve, springs_of
from tdint import load_model, make_record, run

PEAKS = Path(__file__).with_name("later_peaks.csv")
"""Stories of a building with their initial displacements and true peaks (by a separate
Runge-Kutta solver), and its ground motion."""
MOTION = Path(__file__).with_name("later_peaks_motion.txt")

MASS, PERIOD = 1e5, 0.4
STIFFNESS = MASS * (2.0 * math.pi / PERIOD) ** 2


def flat(mass, stiffness, strength):
    """Return a story without hardening."""
    law = {"type": "bilinear", "yield_force": strength, "hardening": 0.0}
    return {"mass": mass, "height": 3.0, "stiffness": stiffness, "law": law}


def within_rounding_of_a_limit(strength, h):
    """Return the response of the first step of two stories, in which the upper story yields."""
    building = load_model(
        {
            "stories": [flat(MASS, STIFFNESS, strength), flat(MASS, STIFFNESS, 2e4)],
            "initial": {"velocity": [0.5, 1.2]},
        }
    )
    return run(building, method="impulse4", dt=h, duration=h, check=False)


def test_force_at_the_end_of_a_step_within_the_tolerance_of_a_limit():
    """The upper story yields within the step. The drift of the lower story ends beyond its limit,
    by less than the tolerance of the location of branch changes: the branch changes at the end of
    the step, and the force is the strength."""
    h = PERIOD / 10.0
    elastic = within_rounding_of_a_limit(1e9, h)
    assert elastic.branch_changes == 1
    strength = elastic.stories.peak_shear[0] / (1.0 + 0.8e-9)
    found = within_rounding_of_a_limit(strength, h)
    assert found.branch_changes == 2
    assert found.stories.peak_shear[0] == pytest.approx(strength, rel=1e-12)


def test_accelerations_at_the_end_of_an_elastic_substep():
    """The total shear of an undamped story is its force. An elastic substep can end beyond the
    limit: the accelerations there are those of the strength. A negligible dashpot that is not
    linear excludes the limits by equilibrium."""
    strength, negligible = 3e4, {"coefficient": 1e-6, "exponent": 1.5}
    story = flat(MASS, MASS * 60.0**2, strength) | {"dashpot": negligible}
    building = load_model({"stories": [story]})
    times = 0.01 * np.arange(301)
    ground = 4.0 * np.sin(17.0 * times) + 3.0 * np.sin(31.0 * times)
    record = make_record(ground, dt=0.01, units="m/s^2")
    stories = run(building, record, method="impulse4", dt=0.02, check=False).stories
    assert stories.ductility[0] > 3.0
    assert stories.peak_total_shear[0] == pytest.approx(strength, rel=3e-4)


def test_peaks_after_a_maximum_at_the_start():
    """Twelve stories with stops, with initial displacements. The run and the additional run report
    the maximum at the start, and miss a later one."""
    with PEAKS.open() as file:
        stories = [
            {name: float(text) for name, text in row.items() if text}
            for row in csv.DictReader(file)
        ]
    bearings = {"type": "bilinear", "yield_force": 1732985.183509996, "hardening": 0.1}
    definition = {
        "stories": [
            {name: story[name] for name in ("mass", "stiffness", "height")}
            | (
                {"law": {"type": "gap"} | {name: story[name] for name in ("gap", "stop_stiffness")}}
                if "gap" in story
                else {"law": bearings, "isolator": True}
            )
            for story in stories
        ],
        "collapse_drift": 0.9,
        "initial": {"displacement": [story["displacement"] for story in stories]},
    }
    record = make_record(np.loadtxt(MOTION), dt=0.01, units="m/s^2")
    response = run(load_model(definition), record, method="park", dt=0.02, duration=4.0)
    for name in ("peak_drift", "peak_shear"):
        true = np.array([story[name] for story in stories])
        error = np.abs(getattr(response.stories, name) - true)
        assert np.all(error <= 2.0 * getattr(response.check.errors, name)), name


def test_step_that_does_not_resolve_a_stiffened_story():
    """The stiffness at the peak drift d of c1 d + c5 d^5 is 1 + 5 c5 d^4 / c1 times the initial
    stiffness. The note appears if the frequency there times the step exceeds 2.5."""
    drift, ratio, first = 0.1, 16.0, MASS * 20.0**2
    fifth = (ratio - 1.0) * first / (5.0 * drift**4)
    law = {"type": "polynomial", "coefficients": [first, 0.0, 0.0, 0.0, fifth]}
    building = load_model(
        {
            "stories": [{"mass": MASS, "height": 3.0, "law": law, "dashpot": 20.0 * MASS}],
            "initial": {"displacement": [drift]},
        }
    )
    limit = 2.5 / (20.0 * math.sqrt(ratio))
    for dt, is_noted in ((1.05 * limit, True), (0.95 * limit, False)):
        response = run(building, method="moment4", dt=dt, duration=20 * dt, check=False)
        assert response.stories.peak_drift[0] == pytest.approx(drift, rel=1e-9)
        assert any("is 16 times as stiff" in note for note in response.warnings) == is_noted


BOUC_WEN = {"type": "bouc-wen", "yield_force": 4e5, "hardening": 0.05, "exponent": 1.0, "beta": 0.5}
TANH = {"type": "tanh", "strength": 3e5}
DASHPOT = {"coefficient": 1e5, "exponent": 0.5, "linear_below": 1e-3}


def started(velocities, **story):
    """Return a building of equal stories that start with velocities of the floors, m/s."""
    stories = [{"mass": MASS, "stiffness": 4e7, "height": 3.0} | story for _ in velocities]
    return {"stories": stories, "initial": {"velocity": list(velocities)}}


def errors_of(model, method, dt, duration, quantities):
    """Return the largest errors of peaks in a free vibration, divided by the largest peak."""
    true = solve(model, np.zeros(0), 0.01, duration)
    stories = run(load_model(model), method=method, dt=dt, duration=duration, check=False).stories
    return [
        np.max(np.abs(getattr(stories, name) - true[name])) / np.max(true[name])
        for name in quantities
    ]


@pytest.mark.parametrize("method", ["impulse4", "gauss4"])
def test_force_of_a_curved_law_at_a_reversal(method):
    """The law reloads on another curve than it unloads: the force at the reversal follows from the
    state before it."""
    model = started([0.4], law=BOUC_WEN)
    model["stories"][0] |= {"mass": 1.5e5, "stiffness": 4.8e7}
    assert errors_of(model, method, 0.02, 0.4, ["peak_shear"])[0] < 1e-4


@pytest.mark.parametrize("method", ["impulse4", "gauss4"])
def test_accelerations_at_the_rest_of_a_dashpot(method):
    """The force of the dashpot falls steeply before its rest; the mean of this force follows from
    the rule of the method."""
    quantities = ["peak_total_shear", "peak_absolute_acceleration"]
    model = started([0.4, -0.2], dashpot=DASHPOT)
    model["initial"]["displacement"] = [0.004, 0.001]
    assert max(errors_of(model, method, 0.01, 0.3, quantities)) < 3e-4


@pytest.mark.parametrize(
    ("method", "law", "largest"),
    [("moment4:rho_inf=0.5", BOUC_WEN, 5e-5), ("moment4:rho_inf=0", TANH, 2e-4)],
)
def test_accelerations_between_corners_with_numerical_dissipation(method, law, largest):
    """The accelerations at a corner of the upper story follow from the forces of the curved law of
    the lower story, without the numerical dissipation."""
    model = started([0.5, 0.3])
    sliding = {"type": "bilinear", "yield_force": 2e5, "hardening": 0.0}
    model["stories"][0]["law"], model["stories"][1]["law"] = law, sliding
    assert errors_of(model, method, 0.01, 0.4, ["peak_absolute_acceleration"])[0] < largest


@pytest.mark.parametrize("after", [3.0, -1.0])
def test_peaks_at_a_change_of_the_force_inside_a_step(after):
    """A force p on a floor at rest changes to 3 p or -p at a time inside a step. The acceleration
    after the change is (3 p - k u) / m, its maximum; with -p, the velocity has its peak there."""
    force, when = 1e5, 0.0337
    points = [[0.0, force], [when, force], [when, after * force], [9.0, after * force]]
    model = {
        "stories": [flat(MASS, STIFFNESS, 1e9)],
        "excitation": {"forces": [{"floor": 1, "points": points}]},
    }
    stories = run(load_model(model), dt=0.01, duration=0.05, check=False).stories
    omega = math.sqrt(STIFFNESS / MASS)
    if after > 0.0:
        expected = force / MASS * (after - 1.0 + math.cos(omega * when))
        assert stories.peak_absolute_acceleration[0] == pytest.approx(expected, rel=1e-4)
    else:
        expected = force / (MASS * omega) * math.sin(omega * when)
        assert stories.peak_velocity[0] == pytest.approx(expected, rel=1e-4)


@pytest.mark.parametrize("method", ["impulse4", "moment4", "gauss4", "newmark"])
def test_total_shear_without_damping_is_the_strength(method):
    """A cubic between the ends of the step in which the story yields exceeds the strength."""
    strength = 3e4
    building = load_model({"stories": [flat(MASS, MASS * 30.0**2, strength)]})
    times = 0.01 * np.arange(301)
    ground = 4.0 * np.sin(17.0 * times) + 3.0 * np.sin(31.0 * times)
    record = make_record(ground, dt=0.01, units="m/s^2")
    stories = run(building, record, method=method, dt=0.02, check=False).stories
    assert stories.peak_total_shear[0] == pytest.approx(strength, rel=1e-9)


@pytest.mark.parametrize("method", ["impulse4", "moment4", "newmark-average"])
@pytest.mark.parametrize("is_split", [False, True])
def test_tangent_damping_at_the_start(method, is_split):
    """A story has yielded at its initial drift. The tangent stiffness is zero if it continues: m a
    = -F, and k if it moves back: m a = -F + b k v. Two elements are the same story."""
    strength, b = 3e4, 0.02
    law = {"type": "bilinear", "yield_force": 0.5 * strength, "hardening": 0.0}
    element = law | {"stiffness": 0.5 * STIFFNESS}
    story = flat(MASS, STIFFNESS, strength)
    if is_split:
        story = {"mass": MASS, "height": 3.0, "elements": [element, element]}
    for velocity, tangent in ((0.3, 0.0), (-0.3, STIFFNESS)):
        model = {
            "stories": [story],
            "damping": {"rayleigh": {"mass": 0.0, "stiffness": b, "tangent": True}},
            "initial": {"displacement": [0.01], "velocity": [velocity]},
        }
        response = run(load_model(model), method=method, dt=1e-3, duration=0.01, history=True)
        expected = -(strength + b * tangent * velocity) / MASS
        assert response.history.absolute_acceleration[0, 0] == pytest.approx(expected, rel=1e-9)


# ---- Peaks of stories and elements within a step


def bilinear(stiffness, strength, hardening=0.0):
    """Return a bilinear element."""
    law = {"type": "bilinear", "yield_force": strength, "hardening": hardening}
    return law | {"stiffness": stiffness}


def stop(gap, stiffness):
    """Return an element without force up to the drift `gap`."""
    return {"type": "gap", "gap": gap, "stop_stiffness": stiffness}


def capped(stiffness, strength, drift):
    """Return an element whose force falls after 1.1 times its strength, at the `drift` after its
    yield drift."""
    law = {"type": "imk", "stiffness": stiffness, "yield_force": strength, "capping_ratio": 1.1}
    law |= {"plastic_drift": drift, "post_capping_drift": 2.0 * drift, "residual_ratio": 0.3}
    return law | {"ultimate_drift": 50.0 * drift}


def of_elements(*elements):
    """Return a story of elements."""
    return {"mass": MASS, "height": 3.0, "elements": list(elements)}


def vibration(stories, velocity, method, h, duration):
    """Return the response of stories to initial velocities of their floors."""
    model = load_model({"stories": stories, "initial": {"velocity": velocity}})
    return run(model, method=method, dt=h, duration=duration, check=False)


@pytest.mark.parametrize(
    ("method", "stories", "velocity"),
    [
        ("impulse4", (("gap", 1.8e7, 2e5), ("flat", 2.3e7, 7e5)), [0.4, 0.5]),
        ("moment4", (("gap", 1.5e7, 4e5), ("hard", 4.2e7, 9e4)), [-0.4, -0.1]),
    ],
)
def test_force_at_a_limit_that_the_drift_hardly_reaches(method, stories, velocity):
    """The lower story reaches the limit of its branch at the end of its movement. Its drift can be
    before the limit by less than the tolerance of the location. The reported force is the force of
    the law at the reported peak drift."""

    def definition(limits):
        laws = {
            "gap": lambda k, force: {"type": "gap", "gap": force / k, "stop_stiffness": 5.0 * k},
            "hard": lambda k, force: {"type": "bilinear", "yield_force": force, "hardening": 0.1},
            "flat": lambda k, force: {"type": "bilinear", "yield_force": force, "hardening": 0.0},
        }
        return [
            {"mass": MASS, "height": 3.0, "stiffness": k, "law": laws[name](k, force)}
            for (name, k, _), force in zip(stories, limits, strict=True)
        ]

    limits = [force for _, _, force in stories]
    for h in (0.02, 0.04):
        limits[0] = 1e9
        elastic = vibration(definition(limits), velocity, method, h, 0.3).stories
        largest = stories[0][1] * elastic.peak_drift[0]
        for distance in (0.0, 1e-9, 1e-8, 1e-7, 1e-6, 1e-5):
            limits[0] = largest * (1.0 - distance)
            listed = definition(limits)
            found = vibration(listed, velocity, method, h, 0.3).stories
            for story, drift, shear in zip(listed, found.peak_drift, found.peak_shear, strict=True):
                assert shear <= springs_of(story)[0].largest(float(drift)) * (1.0 + 2e-9)


def test_forces_at_a_reversal_in_a_substep():
    """The upper story yields and ends a substep in which the lower story reverses at its stop. The
    forces of the lower story and of the stop belong to the peak drift."""
    gap, stiffness, own = 0.01, 7.5e7, 1.6e7
    lower = of_elements(stop(gap, stiffness), {"type": "linear", "stiffness": own})
    found = vibration([lower, flat(MASS, 2.2e7, 2.8e5)], [-0.42, 0.2], "impulse4", 0.01, 0.2)
    drift = found.stories.peak_drift[0]
    assert drift > 1.2 * gap
    force = stiffness * (drift - gap)
    assert found.elements.peak_force[0] == pytest.approx(force, rel=1e-9)
    assert found.stories.peak_shear[0] == pytest.approx(force + own * drift, rel=1e-9)


@pytest.mark.parametrize("method", ["impulse4", "moment4", "gauss4", "newmark-average"])
def test_force_of_a_stop_at_a_reversal(method):
    """The largest force of the stop belongs to the peak drift, inside a step."""
    gap, stiffness = 0.01, 4.8e7
    story = of_elements(stop(gap, stiffness), bilinear(1e7, 1.1e5))
    for velocity in (0.2, 0.23, 0.26):
        found = vibration([story], [velocity], method, 0.02, 0.4)
        force = stiffness * (found.stories.peak_drift[0] - gap)
        assert force > 1e5
        assert found.elements.peak_force[0] == pytest.approx(force, rel=1e-9)


@pytest.mark.parametrize("h", [0.02, 0.04])
def test_force_of_an_element_beside_a_curved_element(h):
    """The story has no slope, because one element is curved. The excess beyond the limit of the
    elastic-plastic element is removed with the slopes of the linear elements."""
    strength = 6.5e4
    curved = BOUC_WEN | {"yield_force": 2.6e4, "stiffness": 2.4e6}
    story = of_elements(bilinear(6e6, strength), bilinear(4e6, 4e4, 0.1), curved)
    for velocity in np.linspace(0.3, 0.6, 7):
        found = vibration([story], [float(velocity)], "impulse4", h, 0.4)
        assert found.elements.peak_force[0] == pytest.approx(strength, rel=1e-12)


@pytest.mark.parametrize("h", [0.02, 0.04])
def test_force_before_a_loss_of_strength_within_a_step(h):
    """The largest force of the story and of its elements is inside a step, where a branch ends."""
    stiffness, strength, drift = 3.9e7, 4.3e4, 2.2e-3
    alone = flat(MASS, stiffness, 1.0)
    law = capped(stiffness, strength, drift)
    alone |= {"law": {key: law[key] for key in law if key != "stiffness"}}
    found = vibration([alone], [-0.2], "moment4", h, 0.2)
    assert found.stories.peak_shear[0] == pytest.approx(1.1 * strength, rel=1e-12)

    rising = bilinear(9.6e6, 1.3e4, 0.1)
    found = vibration([of_elements(law, rising)], [0.32], "moment4", h, 0.2)
    assert found.elements.peak_force[0] == pytest.approx(1.1 * strength, rel=1e-12)


def test_sum_of_forces_before_a_loss_of_strength_within_a_step():
    """The sum of two elements has its maximum inside a step, where one of them loses strength; the
    other element rises on."""
    stiffness, strength, plastic = 1.3e7, 5.1e4, 7.8e-3
    falling, rising = capped(stiffness, strength, plastic), bilinear(5e6, 2e4, 0.05)
    cap = strength / stiffness + plastic
    largest = 1.1 * strength + 2e4 + 0.05 * 5e6 * (cap - 2e4 / 5e6)
    for h in (0.02, 0.04):
        found = vibration([of_elements(falling, rising)], [0.56], "moment4", h, 0.2)
        assert found.stories.peak_drift[0] > cap
        assert found.stories.peak_shear[0] == pytest.approx(largest, rel=1e-9)


# ---- Peaks that satisfy the equations of motion

SATURATED = {
    "stories": [
        {"mass": 147e3, "height": 3.7, "stiffness": 1.09e7},
        {
            "mass": 136e3,
            "height": 3.6,
            "stiffness": 2.78e7,
            "law": {"type": "tanh", "strength": 4.5e5},
        },
        {
            "mass": 127e2,
            "height": 3.8,
            "stiffness": 1.9e7,
            "law": {"type": "tanh", "strength": 5.3e4},
        },
    ],
    "excitation": {"forces": [{"floor": 3, "amplitude": 1.74e5, "omega": 7.25, "phase": "cos"}]},
}


@pytest.mark.parametrize("method", ["impulse4", "moment4"])
@pytest.mark.parametrize(
    ("change", "h", "shear"),
    [
        ({"damping": {"modal": {"ratio": 0.04, "modes": 1}}}, 0.02, 54365.562),
        ({"damping": "none", "p_delta": True}, 0.01, 52600.089),
    ],
)
def test_total_shear_of_a_law_that_saturates_and_reverses_in_a_step(method, change, h, shear):
    """The roof story saturates and reverses inside a step. A cubic between the ends of the step
    exceeds the forces by up to 23 %. True values: DOP853 with a relative tolerance of 1e-10, force
    on the roof minus mass times acceleration."""
    source = SATURATED | {"collapse_drift": "100%"} | change
    found = run(load_model(source), method=method, dt=h, duration=2.0, check=False)
    assert found.stories.peak_total_shear[2] == pytest.approx(shear, rel=5e-5)


@pytest.mark.parametrize("method", ["impulse4", "moment4", "newmark-average"])
def test_rigid_brace(method):
    """A brace of 1e20 to 1e30 N/m is rigid: the force of the damper is its coefficient times the
    drift rate, and the peaks are those without a brace."""
    coefficient = 0.2 * MASS * 15.0
    story = {"mass": MASS, "height": 3.0, "stiffness": STIFFNESS}

    def peak_drift(dashpot):
        building = {"stories": [story | {"dashpot": dashpot}], "initial": {"velocity": [0.3]}}
        found = run(load_model(building), method=method, dt=0.01, duration=0.5, check=False)
        return found.stories.peak_drift[0]

    rigid = peak_drift(coefficient)
    for brace in (1e15, 1e30):
        braced = {"coefficient": coefficient, "exponent": 1.0, "brace": brace}
        assert peak_drift(braced) == pytest.approx(rigid, rel=1e-4)


@pytest.mark.parametrize(
    ("digest", "samples"),
    [
        ("9a3b523e", 1.0),  # acceleration of the first step, too large with both steps
        ("022a4551", 2.0),  # total shear at a reversal within the step, tangent damping
    ],
)
def test_errors_that_the_run_and_half_of_its_step_have_in_common(digest, samples):
    row, seed, _, peaks = next(entry for entry in read() if entry[2] == digest)
    assert judge(build(row, seed), peaks, "moment4", samples).beyond == []
