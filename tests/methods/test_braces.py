"""Dampers in series with a brace (Maxwell elements): published and separate solutions, energy,
order, stability, yielding stories, inclined dampers, and methods that refuse them."""

import functools
import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.linalg import expm

from building_cases import Law, model, noise, story
from el_centro import el_centro
from references import orders
from selection import every
from tdint import load_model, make_record, run, run_many
from tdint.errors import AnalysisError
from tdint.methods.catalogue import catalogue, parse
from tdint.model.building import assemble
from tdint.model.definition import RayleighCoefficients
from tdint.model.story import PowerDashpot
from tdint.output.tables.buildings import model_table

METHODS = [name for name, method in catalogue().items() if method.braces]
ORDER_4 = ["impulse4", "moment4", "gauss4"]
UNCONDITIONAL = [name for name in METHODS if parse(name).stability_limit == math.inf]


def braced(mass, stiffness, coefficient, exponent, brace, law=None, linear_below=0.0, factor=1.0):
    base = story(mass, stiffness, law) if law else story(mass, stiffness)
    dashpot = PowerDashpot(coefficient, exponent, linear_below, brace)
    return replace(base, power_dashpot=dashpot, damper_factor=factor)


# Peak drifts (m) and peak damper forces (N) under the first 15 s of El Centro, by Radau with a
# relative tolerance of 1e-10, the linear damper by the matrix exponential
UNDER_EL_CENTRO = {
    "linear": ([braced(1e5, 8e6, 4e5, 1.0, 2e7)], [0.0408072], [174458.0]),
    "exponent 0.5": ([braced(1e5, 8e6, 2e5, 0.5, 4e6)], [0.0650602], [148534.0]),
    "exponent 0.3, stiff": ([braced(1e5, 8e6, 1e5, 0.3, 4e8)], [0.0516322], [81572.4]),
    "exponent 2": ([braced(1e5, 8e6, 2e6, 2.0, 2e7)], [0.0341845], [259298.0]),
    "three stories": (
        [braced(2e5, 1.2e8, 8e5, 0.3, 8e7)] * 3,
        [0.0263886, 0.0217022, 0.012067],
        [588137.0, 542531.0, 420681.0],
    ),
}


@pytest.mark.parametrize("name", UNDER_EL_CENTRO)
@pytest.mark.parametrize(("method", "parts"), [("impulse4", 16), ("moment4", 16), ("gauss4", 16)])
def test_peaks_under_el_centro(name, method, parts):
    stories, drifts, forces = UNDER_EL_CENTRO[name]
    record = el_centro()
    response = run(model(stories), record, method=method, dt=record.dt / parts, check=False)
    assert response.stories.peak_drift == pytest.approx(drifts, rel=2e-6)
    assert response.stories.peak_damper_force == pytest.approx(forces, rel=5e-6)


@pytest.mark.parametrize("name", ["newmark-average", "central-difference", "generalized-alpha"])
def test_methods_of_order_2_reach_the_published_frame(name):
    """Frame with a fluid damper (Akcelyan and Lignos); with a rigid brace the drift is 25.0 mm."""
    building = model(
        [braced(101936.7992, 8212864.342, 232765.0, 0.35, 2.5e7)],
        damping=RayleighCoefficients(0.3590391604, 0.0),
    )
    record = el_centro()
    peaks = run(building, record, method=name, dt=record.dt / 64, check=False).stories
    assert peaks.peak_drift == pytest.approx([0.0321555], rel=3e-5)
    assert peaks.peak_damper_force == pytest.approx([159561.0], rel=3e-5)


def test_error_estimates_exceed_the_errors_of_coarse_steps():
    stories, drifts, forces = UNDER_EL_CENTRO["three stories"]
    response = run(model(stories), el_centro(), method="impulse4", dt=0.02)
    peaks, errors = response.stories, response.check.errors
    assert np.all(np.abs(peaks.peak_drift - drifts) < 2.0 * errors.peak_drift)
    assert np.all(np.abs(peaks.peak_damper_force - forces) < 2.0 * errors.peak_damper_force)


def linear_motion(times, coefficient=5.0, stiffness=100.0, brace=300.0):
    """Displacement of a unit mass with a linear damper and its brace, released at 1 m."""
    # The third state is the force of the brace.
    matrix = [[0.0, 1.0, 0.0], [-stiffness, 0.0, -1.0], [0.0, brace, -brace / coefficient]]
    return np.array([(expm(np.array(matrix) * t) @ [1.0, 0.0, 0.0])[0] for t in times])


TIMES = np.linspace(0.0, 2.0, 26)


@functools.cache
def motion(exponent, coefficient, threshold=0.0):
    """Displacement of a unit mass with a spring of 100 N/m, a damper and its brace of 300 N/m,
    released at 1 m, at TIMES. The third unknown is the force of the damper, or its rate if the
    damper has a linear part."""

    def derivative(t, x):
        if threshold == 0.0:
            rate = math.copysign((abs(x[2]) / coefficient) ** (1.0 / exponent), x[2])
            return [x[1], -100.0 * x[0] - x[2], 300.0 * (x[1] - rate)]
        square = x[2] ** 2 + threshold**2
        secant = coefficient * square ** (0.5 * (exponent - 1.0))
        tangent = secant * (1.0 + (exponent - 1.0) * x[2] ** 2 / square)
        return [x[1], -100.0 * x[0] - secant * x[2], 300.0 * (x[1] - x[2]) / tangent]

    solver = "Radau" if exponent > 1.0 and threshold == 0.0 else "DOP853"
    return solve_ivp(
        derivative, (0.0, TIMES[-1]), [1.0, 0.0, 0.0], solver, TIMES, rtol=1e-11, atol=1e-12
    ).y[0]


def errors_at(steps, building, method, reference):
    found = []
    for dt in steps:
        history = run(building, method=method, dt=dt, duration=2.0, check=False, history=True)
        every = round(TIMES[1] / dt)
        found.append(np.max(np.abs(history.history.displacement[::every, 0] - reference)))
    return found


@pytest.mark.parametrize("name", METHODS)
def test_order_with_linear_damper(name):
    building = model([braced(1.0, 100.0, 5.0, 1.0, 300.0)], displacement=[1.0])
    errors = errors_at((0.02, 0.01, 0.005), building, name, linear_motion(TIMES))
    assert errors[-1] < (2e-8 if name in ORDER_4 else 1e-2)
    assert orders(errors)[-1] == pytest.approx(4 if name in ORDER_4 else 2, abs=0.15)


@pytest.mark.parametrize("name", ORDER_4)
@pytest.mark.parametrize(
    ("exponent", "coefficient", "largest"), [(0.5, 8.0, 9e-7), (0.3, 12.0, 5e-7)]
)
def test_order_with_fluid_damper(name, exponent, coefficient, largest):
    """The order of single halvings is irregular, because g'' jumps at zero force."""
    building = model([braced(1.0, 100.0, coefficient, exponent, 300.0)], displacement=[1.0])
    reference = motion(exponent, coefficient)
    errors = errors_at((0.04, 0.005), building, name, reference)
    assert errors[-1] < largest
    assert math.log2(errors[0] / errors[-1]) / 3.0 > 2.9


@pytest.mark.parametrize(("exponent", "threshold"), every(3, [(0.5, 0.1), (2.0, 0.0), (1.7, 0.2)]))
@pytest.mark.parametrize("name", ["impulse4", "moment4", "gauss4", "newmark-average"])
def test_dampers_that_are_solved_for_their_rate(name, exponent, threshold):
    """Exponents above 1 have a vertical rate at zero force, and dampers with a linear part no
    closed formula of the rate."""
    building = model(
        [braced(1.0, 100.0, 6.0, exponent, 300.0, linear_below=threshold)], displacement=[1.0]
    )
    reference = motion(exponent, 6.0, threshold)
    error = errors_at((0.0025,), building, name, reference)[0]
    assert error < (2e-4 if name == "newmark-average" else 5e-7)


def total(history):
    energy = history.energy
    return energy.kinetic + energy.strain + energy.braces


@pytest.mark.parametrize("name", ["impulse4", "moment4", "gauss4", "newmark-average"])
@pytest.mark.parametrize("exponent", [0.3, 0.5, 1.0, 2.0])
def test_energy_of_free_vibration_falls_in_every_step(name, exponent):
    """Steps up to three periods, and braces from a tenth to a million times the stiffness."""
    for ratio in (0.1, 10.0, 1e3, 1e6):
        building = model([braced(1.0, 100.0, 12.0, exponent, 100.0 * ratio)], displacement=[1.0])
        for periods in (0.02, 0.3, 3.0):
            dt = periods * 0.2 * math.pi
            response = run(
                building, method=name, dt=dt, duration=40 * dt, check=False, history=True
            )
            energy = total(response.history)
            assert np.max(np.diff(energy)) < 1e-12 * energy[0], (ratio, periods)
            bound = 1e-5 if name == "newmark-average" else 1e-6
            assert abs(response.energy.error) < bound, (ratio, periods)


@pytest.mark.parametrize("name", UNCONDITIONAL)
def test_linear_dampers_are_stable_for_large_steps(name):
    for ratio in (0.1, 10.0, 1e3, 1e6):
        for coefficient in (1.0, 12.0, 1e3):
            building = model(
                [braced(1.0, 100.0, coefficient, 1.0, 100.0 * ratio)],
                displacement=[1.0],
                velocity=[3.0],
            )
            dt = 0.6 * math.pi  # three periods
            response = run(
                building, method=name, dt=dt, duration=300 * dt, check=False, history=True
            )
            amplitude = np.sqrt(total(response.history))
            first, second = np.max(amplitude[:150]), np.max(amplitude[150:])
            assert second <= first * (1.0 + 1e-9), (ratio, coefficient)


def test_brace_limits_the_step_of_central_difference():
    """The limit is that of the building with locked dampers, for any coefficient."""
    for coefficient in (0.1, 50.0):
        building = model([braced(1.0, 100.0, coefficient, 0.5, 300.0)], displacement=[1.0])
        limit = 2.0 / math.sqrt(100.0 + 300.0)
        history = run(
            building,
            method="central-difference",
            dt=0.999 * limit,
            duration=300 * limit,
            history=True,
            check=False,
        ).history
        assert np.max(np.abs(history.displacement)) < 1.2
        with pytest.raises(AnalysisError, match=r"largest stable step is 0\.1 s"):
            run(building, method="central-difference", dt=1.01 * limit, duration=1.0)


def test_stiff_brace_reports_a_damper_force_without_oscillation():
    """The force at the end of a step is up to 20 times the true force of 81 572 N; the largest
    reported force and the acceleration follow from the mean force."""
    stories, _, forces = UNDER_EL_CENTRO["exponent 0.3, stiff"]
    for name in ("impulse4", "moment4", "newmark-average"):
        response = run(model(stories), el_centro(), method=name, dt=0.02, check=False, history=True)
        assert response.stories.peak_damper_force == pytest.approx(forces, rel=6e-3)
        reached = np.max(np.abs(response.history.damper_force))
        assert reached == pytest.approx(forces[0], rel=6e-3)
        shear = response.history.shear + response.history.damper_force
        assert np.allclose(shear, response.history.total_shear, atol=1e-3)


@pytest.mark.parametrize(("exponent", "coefficient", "brace"), [(0.5, 2e5, 2e7), (2.0, 2e6, 2e7)])
def test_yielding_stories_agree_between_families(exponent, coefficient, brace):
    """impulse4 locates branch changes within a step, moment4 integrates along the path."""
    law = Law("bilinear", (1.5e5, 0.03))
    building = replace(
        model([braced(1e5, 4e7, coefficient, exponent, brace, law)] * 3), p_delta=True
    )
    record = noise(samples=401, dt=0.02, peak=4.0)
    peaks = []
    for name in ("impulse4", "moment4"):
        response = run(building, record, method=name, dt=record.dt / 16, check=False)
        assert abs(response.energy.error) < 1e-7
        stories = response.stories
        peaks.append(
            [
                stories.peak_drift,
                stories.peak_damper_force,
                stories.peak_total_shear,
                stories.peak_absolute_acceleration,
            ]
        )
        if name == "impulse4":
            assert response.branch_changes > 20
    assert peaks[0] == pytest.approx(np.array(peaks[1]), rel=2e-5)


def test_curved_story_with_brace_agrees_between_families():
    law = Law("bouc-wen", (1.5e5, 0.05, 2.0, 0.5))
    building = model([braced(1e5, 4e7, 2e5, 0.5, 2e7, law)] * 2)
    record = noise(samples=401, dt=0.02, peak=4.0)
    drifts = [
        run(building, record, method=name, dt=record.dt / 16, check=False).stories.peak_drift
        for name in ("impulse4", "moment4", "gauss4")
    ]
    assert drifts[0] == pytest.approx(drifts[1], rel=1e-5)
    assert drifts[2] == pytest.approx(drifts[1], rel=1e-4)


def test_unbraced_story_beside_a_braced_one_keeps_its_dashpot():
    stories = [braced(1e5, 4e7, 2e5, 0.5, 2e7), story(1e5, 4e7, dashpot=2e5)]
    response = run(model(stories), noise(samples=201, dt=0.02), method="moment4", dt=0.005)
    assert np.all(response.stories.peak_damper_force > 0.0)
    assert abs(response.energy.error) < 1e-12
    assert response.energy.dampers > 0.0


def test_a_rigid_brace_equals_a_dashpot_without_brace():
    record = noise(samples=201, dt=0.02)
    rigid = model([braced(1e5, 4e7, 4e5, 1.0, 1e12)])
    plain = model([story(1e5, 4e7, dashpot=4e5)])
    drifts = [
        run(building, record, method="moment4", dt=0.001, check=False).stories.peak_drift
        for building in (rigid, plain)
    ]
    assert drifts[0] == pytest.approx(drifts[1], rel=1e-5)


@pytest.mark.parametrize("name", ORDER_4)
@pytest.mark.parametrize("exponent", [0.5, 1.0, 2.0])
def test_a_rigid_brace_has_its_peak_force_between_the_ends_of_a_step(name, exponent):
    """Free vibration in ten steps per period: the drift rate has its peak, omega times the initial
    drift, in the middle of the third step, and is 5 % smaller at its ends."""
    omega, coefficient = 10.0, 1e-3
    building = model([braced(1.0, omega**2, coefficient, exponent, 1e8)], displacement=[1.0])
    period = 2.0 * math.pi / omega
    response = run(building, method=name, dt=period / 10, duration=0.4 * period, check=False)
    peak = coefficient * omega**exponent
    assert response.stories.peak_damper_force == pytest.approx([peak], rel=3e-3)


TEXT = """
units: {{length: m, force: kN, mass: t}}
stories:
  - {{mass: 100, height: 3, stiffness: 8000, dashpot: {dashpot}}}
damping: none
"""


def loaded(tmp_path, dashpot):
    path = tmp_path / "model.yaml"
    path.write_text(TEXT.format(dashpot=dashpot), encoding="utf-8")
    return load_model(path)


def test_inclined_damper_equals_its_horizontal_equivalent(tmp_path):
    """Damper force and deformation are those along the damper; the reported force, too."""
    cosine = 5.0 / math.sqrt(34.0)
    inclined = loaded(
        tmp_path, f"{{coefficient: 200, exponent: 0.35, brace: 25000, factor: {cosine!r}}}"
    )
    horizontal = model([braced(1e5, 8e6, 2e5 * cosine**1.35, 0.35, 2.5e7 * cosine**2)])
    peaks = [
        run(building, el_centro(), method="moment4", dt=0.02, check=False, history=True)
        for building in (inclined, horizontal)
    ]
    assert peaks[0].stories.peak_drift == pytest.approx(peaks[1].stories.peak_drift, rel=1e-12)
    along = peaks[1].stories.peak_damper_force / cosine
    assert peaks[0].stories.peak_damper_force == pytest.approx(along, rel=1e-12)
    along = peaks[1].history.damper_force / cosine
    assert np.allclose(peaks[0].history.damper_force, along, rtol=1e-9, atol=1e-6)


def test_angle_and_factor_of_linear_and_power_law_dashpots(tmp_path):
    angle = math.degrees(math.acos(0.8))
    for keys in ("", ", exponent: 0.5, linear_below: 0.01"):
        tables = [
            assemble(loaded(tmp_path, f"{{coefficient: 300{keys}, {inclination}}}")).linear_terms
            for inclination in ("factor: 0.8", f"angle: {angle!r}")
        ]
        assert np.allclose(*tables, rtol=1e-12)
    linear = assemble(loaded(tmp_path, "{coefficient: 300, factor: 0.8}"))
    assert linear.linear
    assert linear.damping_matrix() == pytest.approx(np.array([[3e5 * 0.64]]))


def test_brace_can_be_varied(tmp_path):
    building = loaded(tmp_path, "{coefficient: 200, exponent: 0.5, brace: 4000, factor: 0.8}")
    changes = {"stories[1].dashpot.brace": 5e6, "stories[1].dashpot.exponent": 0.4}
    other = building.replace(**changes)
    assert other.stories[0].power_dashpot == PowerDashpot(2e5, 0.4, 0.0, 5e6)
    record = noise(samples=101, dt=0.02)
    batch = run_many(building, record, vary={name: [value] for name, value in changes.items()})
    single = run(other, record, check=False)
    assert np.array_equal(batch.stories.peak_drift[0], single.stories.peak_drift)
    assert np.array_equal(batch.stories.peak_damper_force[0], single.stories.peak_damper_force)


def test_brace_is_listed_in_the_table_of_stories(tmp_path):
    building = loaded(tmp_path, "{coefficient: 200, exponent: 0.5, brace: 4000, factor: 0.8}")
    assert model_table(building).rows[0][-1].endswith("brace 4e+06 N/m, factor 0.8")


@pytest.mark.parametrize(
    "name", [name for name, method in catalogue().items() if not method.braces]
)
def test_other_methods_refuse_a_brace_and_name_those_that_can(name):
    building = model([braced(1.0, 100.0, 5.0, 1.0, 300.0)], velocity=(1.0,))
    with pytest.raises(AnalysisError, match="does not support dampers with a brace; use one of"):
        run(building, method=name, dt=0.01, duration=0.1)


@pytest.mark.parametrize(
    ("dashpot", "message"),
    [
        ("{coefficient: 200, brace: 0}", "must be a positive number"),
        ("{coefficient: 200, brace: -4}", "must be a positive number"),
        ("{coefficient: 200, factor: 0}", "factor"),
        ("{coefficient: 200, factor: 1.2}", "factor"),
        ("{coefficient: 200, angle: 90}", "angle"),
        ("{coefficient: 200, angle: 20, factor: 0.9}", "give either factor or angle, not both"),
        ("{brace: 4000}", "coefficient"),
        ("{coefficient: 200, exponent: 0.5}", "or the stiffness of its `brace`"),
        ("{coefficient: 200, braces: 4000}", "brace"),
    ],
)
def test_invalid_dashpots(tmp_path, dashpot, message):
    with pytest.raises(Exception, match="dashpot") as error:
        loaded(tmp_path, dashpot)
    assert message in str(error.value)


PULSE = [6.0 * math.sin(0.05 * k) * min(k / 50.0, 1.0) for k in range(250)]  # m/s^2, 0.01 s apart
RELIEF_FORCE = 1e5  # N
DAMPERS = {
    "linear": {},
    "exponent 0.3": {"coefficient": 1.2e5, "exponent": 0.3},
    "exponent 2": {"coefficient": 3e6, "exponent": 2.0},
    "relief": {"relief": {"force": RELIEF_FORCE, "ratio": 0.0}},
    "relief 0.1": {"relief": {"force": RELIEF_FORCE, "ratio": 0.1}},
    "stiff relief": {"brace": 1e9, "relief": {"force": RELIEF_FORCE, "ratio": 0.0}},
    "inclined relief": {"relief": {"force": RELIEF_FORCE, "ratio": 0.0}, "factor": 0.8},
}


def with_damper(damper):
    """Return a building of two stories with equal dampers."""
    dashpot = {"coefficient": 1e6, "brace": 2e8, **DAMPERS[damper]}
    story = {"mass": 1e5, "height": 3.5, "stiffness": 2e7, "dashpot": dashpot}
    return {"stories": [story] * 2, "damping": {"rayleigh": {"mass": 0.2, "stiffness": 0.001}}}


@functools.cache
def largest_forces(damper):
    """Return the forces of the dampers alone at their largest rates, N: a brace in series cannot
    increase them."""
    record = make_record(PULSE, dt=0.01, units="m/s^2")
    response = run(
        with_damper(damper), record, method="gauss4", dt=0.0025, history=True, check=False
    )
    rates = np.max(np.abs(np.diff(response.history.velocity, axis=1, prepend=0.0)), axis=0)
    dashpot = with_damper(damper)["stories"][0]["dashpot"]
    rates *= dashpot.get("factor", 1.0)
    forces = dashpot["coefficient"] * rates ** dashpot.get("exponent", 1.0)
    if "relief" in dashpot:
        ratio = dashpot["relief"]["ratio"]
        forces = np.where(
            forces > RELIEF_FORCE, RELIEF_FORCE + ratio * (forces - RELIEF_FORCE), forces
        )
    return forces


@pytest.mark.parametrize("damper", DAMPERS)
@pytest.mark.parametrize("method", METHODS)
def test_no_damper_force_exceeds_its_law(method, damper):
    record = make_record(PULSE, dt=0.01, units="m/s^2")
    response = run(with_damper(damper), record, method=method, history=True, check=False)
    allowed = largest_forces(damper)
    if DAMPERS[damper].get("relief", {}).get("ratio") == 0.0:
        assert response.stories.peak_damper_force == pytest.approx(allowed, rel=1e-12)
        assert np.max(np.abs(response.history.damper_force)) <= RELIEF_FORCE
    else:
        # The drift rates of methods of order 2 differ.
        assert np.all(response.stories.peak_damper_force <= 1.02 * allowed)


@pytest.mark.parametrize("method", [*ORDER_4, "newmark-average"])
@pytest.mark.parametrize(
    ("damper", "drifts", "forces", "total_shears"),
    [
        ("relief", [0.12017875, 0.06345106], [1e5, 1e5], [2494768.6, 1327664.6]),
        ("relief 0.1", [0.11567272, 0.06173194], [153536.9, 131229.8], [2403141.6, 1296297.6]),
    ],
)
def test_relief_forces(damper, drifts, forces, total_shears, method):
    """Values of the separate solver (tests/grid/solver.py)"""
    record = make_record([*PULSE[:241], *60 * [0.0]], dt=0.01, units="m/s^2")
    response = run(with_damper(damper), record, method=method, duration=3.0, check=False)
    stories, rel = response.stories, 2e-4 if method in ORDER_4 else 2e-3
    assert stories.peak_drift == pytest.approx(drifts, rel=rel)
    assert stories.peak_damper_force == pytest.approx(forces, rel=rel)
    assert stories.peak_total_shear == pytest.approx(total_shears, rel=rel)
