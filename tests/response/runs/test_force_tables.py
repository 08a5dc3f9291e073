"""Forces on floors from tables: closed forms, exact solutions, orders, peaks and energies."""

import math
from bisect import bisect_right
from functools import cache

import numpy as np
import pytest
from scipy.linalg import eigh, expm
from scipy.optimize import brentq

import tdint
from el_centro import el_centro
from selection import every
from tdint.kernels.time_loop import force_tables
from tdint.methods.catalogue import catalogue
from tdint.response.runs.prepared import PreparedBuilding

OMEGA = 2.0 * math.pi  # one story with a period of 1 s
STIFFNESS = OMEGA**2
EXACT = ("impulse4", "moment4", "gauss4", "exact")
LINEAR_METHODS = (*EXACT, "newmark-average")

TWO_STORIES = {
    "units": {"length": "m", "force": "kN", "mass": "t"},
    "stories": [{"mass": 60, "stiffness": 3e4}, {"mass": 50, "stiffness": 2.5e4}],
    "damping": {"modal": "2%"},
}
MASS, SPRINGS = np.array([60.0, 50.0]), np.array([3e4, 2.5e4])

BLAST = {2: [(0.0, 200.0), (0.1, 0.0)]}
LATE_BLAST = {2: [(0.1137, 200.0), (0.1868, 0.0)]}
RAMP = {2: [(0.0, 0.0), (0.1137, 0.0), (0.1337, 200.0), (0.2011, 0.0)]}


def wind(interval):
    """Return the wind on both floors, sampled at an interval (s) up to 2 s, kN."""
    times = np.arange(0.0, 2.01, interval)
    force = 30.0 + 10.0 * np.sin(2.0 * times) + 4.0 * np.cos(5.0 * times)
    return {2: list(zip(times, force, strict=True)), 1: list(zip(times, 0.6 * force, strict=True))}


def excitation(loads, **more):
    """Return the section `excitation` with points on floors."""
    return {"forces": [{"floor": floor, "points": loads[floor]} for floor in loads], **more}


def simulate(loads, method, dt, duration=2.0, **options):
    """Integrate the building of two stories under loads on its floors."""
    model = {**TWO_STORIES, "excitation": excitation(loads)}
    return tdint.run(model, method=method, dt=dt, duration=duration, check=False, **options)


def one_story(points, **story):
    """Return the model of one story of 1 kg and a period of 1 s under a force, N."""
    return {
        "stories": [{"mass": 1.0, "stiffness": STIFFNESS, **story}],
        "damping": "none",
        "excitation": {"forces": [{"floor": 1, "points": points}]},
    }


def triangular_pulse_peak(duration):
    """Return the peak displacement under a triangular pulse, divided by the static displacement."""

    def displacement(t):
        return 1.0 - math.cos(OMEGA * t) + math.sin(OMEGA * t) / (OMEGA * duration) - t / duration

    def velocity(t):
        return OMEGA * math.sin(OMEGA * t) + (math.cos(OMEGA * t) - 1.0) / duration

    # The peak is the amplitude of the free vibration, or the first zero of the velocity.
    peak = math.hypot(displacement(duration), velocity(duration) / OMEGA)
    times = np.linspace(1e-6, duration, 2001)
    signs = np.array([velocity(t) for t in times])
    for k in np.flatnonzero(signs[:-1] * signs[1:] < 0.0):
        peak = max(peak, abs(displacement(brentq(velocity, times[k], times[k + 1]))))
    return peak


def exact_response(loads, end=2.0):
    """Return displacements and velocities at the end, and peak drifts, by matrix exponentials on
    the union of all times of the loads, the points of each floor (s, kN)."""
    stiffness = np.array([[SPRINGS.sum(), -SPRINGS[1]], [-SPRINGS[1], SPRINGS[1]]])
    values, shapes = eigh(stiffness, np.diag(MASS))
    weighted = np.diag(MASS) @ shapes
    damping = weighted @ np.diag(0.04 * np.sqrt(values)) @ weighted.T
    system = np.zeros((8, 8))
    system[:2, 2:4] = np.eye(2)
    system[2:4, :2] = -stiffness / MASS[:, None]
    system[2:4, 2:4] = -damping / MASS[:, None]
    system[2:4, 4:6] = np.diag(1.0 / MASS)  # load at the start of a piece, then its rate
    system[4:6, 6:] = np.eye(2)

    def force(points, t, after):
        """Return the forces just after or just before times, kN."""
        times, forces = np.array(points).T
        k = np.searchsorted(times, t + (1e-10 if after else -1e-10))
        is_outside = (k == 0) | (k == len(times))
        k = np.clip(k, 1, len(times) - 1)
        share = (t - times[k - 1]) / (times[k] - times[k - 1])
        return np.where(is_outside, 0.0, forces[k - 1] + share * (forces[k] - forces[k - 1]))

    def load(t, after):
        """Return the forces on both floors at times, kN."""
        none = [(0, 0), (1e-3, 0)]
        return np.transpose([force(loads.get(floor, none), t, after) for floor in (1, 2)])

    grid = np.concatenate(
        [np.arange(0.0, end + 1e-9, 0.002), *(np.array(points)[:, 0] for points in loads.values())]
    )
    grid = np.unique(np.round(grid[grid <= end + 1e-12], 12))
    lengths = np.round(np.diff(grid), 12)
    exponentials = {length: expm(length * system)[:4] for length in np.unique(lengths)}
    starts, stops = load(grid[:-1], True), load(grid[1:], False)
    states = [np.zeros(4)]
    for length, start, stop in zip(lengths, starts, stops, strict=True):
        pieces = [states[-1], start, (stop - start) / length]
        states.append(exponentials[length] @ np.concatenate(pieces))
    drifts, rates = (
        np.diff(columns, prepend=0.0, axis=1)[..., None]
        for columns in (np.array(states)[:, :2], np.array(states)[:, 2:])
    )
    s, length = np.linspace(0.0, 1.0, 101), lengths[:, None, None]
    cubics = (
        drifts[:-1]
        + length * rates[:-1] * (s - 2 * s**2 + s**3)
        + length * rates[1:] * (s**3 - s**2)
        + np.diff(drifts, axis=0) * (3 * s**2 - 2 * s**3)
    )
    return states[-1], np.abs(cubics).max(axis=(0, 2))


# ---- Reference results


@pytest.mark.parametrize("method", LINEAR_METHODS)
@pytest.mark.parametrize("duration", every(2, [0.1, 0.2, 0.371, 0.5, 1.0, 2.0, 5.0, 10.0]))
def test_triangular_pulse(duration, method):
    """The peak is that of the closed form."""
    points = [(0.0, STIFFNESS), (duration, 0.0)]
    dt = 0.01 if method != "newmark-average" else 0.001
    result = tdint.run(
        one_story(points), method=method, dt=dt, duration=duration + 1.5, check=False
    )
    expected = triangular_pulse_peak(duration)
    tolerance = 2e-6 if method != "newmark-average" else 2e-5
    assert result.stories.peak_drift[0] == pytest.approx(expected, rel=tolerance)


@pytest.mark.parametrize(
    ("method", "dt", "tolerance"),
    [
        ("impulse4", 0.01, 1e-6),
        ("moment4", 0.01, 1e-6),
        pytest.param("gauss4", 0.0002, 1e-6, marks=pytest.mark.long),
        pytest.param("newmark-average", 0.0002, 4e-6, marks=pytest.mark.long),
    ],
)
@pytest.mark.parametrize(
    ("duration", "strength", "ductility"),
    [
        (0.1, 0.2, 1.706908), (0.2, 0.5, 1.222973), (0.5, 0.5, 3.870953), (0.5, 0.8, 1.668926),
        (1.0, 0.8, 3.140290), (1.0, 1.0, 1.889015), (2.0, 0.8, 6.304699), (5.0, 1.2, 2.253947),
    ],
)  # fmt: skip
def test_elastoplastic_ductility_under_triangular_pulse(
    duration, strength, ductility, method, dt, tolerance
):
    """The ductility is that of the exact solution with bisected branch changes, and the plastic
    drift at the end is the ductility minus 1. The duration is in periods, the strength in units of
    the peak force."""
    law = {"type": "bilinear", "yield_force": strength * STIFFNESS, "hardening": 0}
    model = one_story([(0.0, STIFFNESS), (duration, 0.0)], law=law)
    end = duration + 4.0
    result = tdint.run(model, method=method, dt=dt, duration=end, check=False, history=True)
    assert result.stories.ductility[0] == pytest.approx(ductility, rel=tolerance)
    elastic = result.history.shear[-1, 0] / STIFFNESS
    plastic = (result.stories.residual_drift[0] - elastic) / strength
    assert plastic == pytest.approx(ductility - 1.0, rel=5.0 * tolerance)


@pytest.mark.parametrize("method", every(2, LINEAR_METHODS))
@pytest.mark.parametrize(
    ("loads", "expected"),
    [
        (BLAST, (0.00659129, 0.00575545)),
        (LATE_BLAST, (0.00510175, 0.00458383)),
        (RAMP, (0.00602546, 0.00538629)),
        (wind(0.25), (0.00365025, 0.00264931)),
        (wind(0.03), None),
    ],
    ids=["blast", "late blast", "ramp", "wind", "short wind"],
)
def test_two_stories(loads, expected, method):
    """The peak drifts are those of matrix exponentials and, where printed, of the reference."""
    _, peaks = exact_response(loads)
    if expected:
        assert peaks == pytest.approx(expected, rel=2e-6)
    dt, tolerance = (0.00125, 2e-6) if method in EXACT else (0.000625, 5e-5)
    assert simulate(loads, method, dt).stories.peak_drift == pytest.approx(peaks, rel=tolerance)


@pytest.mark.parametrize("method", every(2, LINEAR_METHODS))
@pytest.mark.parametrize(
    ("interval", "expected"), [(0.25, (0.0180007, 0.0119028)), (0.03, (0.0179354, 0.0119454))]
)
def test_two_stories_with_a_ground_motion(interval, expected, method):
    """The sampling intervals of the wind and of the ground motion differ. The reference ends after
    2 s."""
    model = {**TWO_STORIES, "excitation": excitation(wind(interval))}
    dt, tolerance = (0.00125, 5e-6) if method in EXACT else (0.0003125, 5e-5)
    result = tdint.run(
        model, el_centro(duration=2.0), method=method, dt=dt, duration=2.0, check=False
    )
    assert result.stories.peak_drift == pytest.approx(expected, rel=tolerance)


@pytest.mark.long
def test_half_sine_pulse_on_one_floor():
    """Two stories under a half-sine pulse on floor 1 (Newmark example of structdyn)."""
    times = np.arange(0.0, 0.60005, 0.0002)
    points = np.transpose([times, 50e3 * np.sin(np.pi * times / 0.6)])
    model = {
        "stories": [{"mass": 91188, "stiffness": 3.6e6}, {"mass": 45594, "stiffness": 1.8e6}],
        "damping": "none",
        "excitation": {"forces": [{"floor": 1, "points": points}]},
    }
    for method in LINEAR_METHODS:
        dt = 0.002 if method in EXACT else 0.0002
        result = tdint.run(model, method=method, dt=dt, duration=1.0, check=False, history=True)
        peaks = 1e3 * np.asarray(result.stories.peak_displacement)
        assert peaks == pytest.approx([18.09306, 29.69550], rel=1e-6)
        assert result.history.absolute_acceleration[-1, 1] == pytest.approx(-0.0534746, abs=2e-6)


@pytest.mark.long
def test_wind_on_six_floors():
    """Six floors under wind with a phase that changes along the height."""
    times = np.arange(0.0, 60.001, 0.0025)
    forces = []
    for floor in range(1, 7):
        gusts = 1.0 + 0.3 * np.sin(2.0 * np.pi * 0.35 * times + 0.5 * (floor - 1))
        force = 1e5 * (floor / 6) ** 0.3333 * gusts
        forces.append({"floor": floor, "points": np.transpose([times, force])})
    model = {
        "stories": [{"repeat": 6, "mass": 1019367.9918450561, "stiffness": 1e8}],
        "damping": {"modal": "2%"},
        "excitation": {"forces": forces},
    }
    model = tdint.load_model(model)  # reads the points only once
    for method in LINEAR_METHODS:
        dt = 0.02 if method in EXACT else 0.0025
        stories = tdint.run(model, method=method, dt=dt, duration=60.0, check=False).stories
        assert 1e3 * stories.peak_displacement[5] == pytest.approx(68.325, abs=5e-4)
        assert 1e3 * stories.peak_drift[0] == pytest.approx(16.915, abs=5e-4)


# ---- Orders and exactness


@pytest.mark.parametrize("dt", every(2, [0.04, 0.02, 0.01]))
@pytest.mark.parametrize("loads", [LATE_BLAST, RAMP, wind(0.03)], ids=["jump", "ramp", "wind"])
def test_exact_has_no_error_with_kinks_and_jumps_inside_steps(loads, dt):
    """The response at the end does not depend on the time step."""
    state, _ = exact_response(loads)
    result = simulate(loads, "exact", dt, history=True)
    drifts = np.array([state[0], state[1] - state[0]])
    assert result.history.drift[-1] == pytest.approx(drifts, rel=1e-9, abs=1e-13)


ORDERS = {
    "impulse4": 4, "moment4": 4, "gauss4": 4, "impulse": 4, "impulse4:rho_inf=0": 3,
    "moment4:rho_inf=0.5": 3, "rk5": 4, "newmark-average": 2, "bathe": 2, "noh-bathe": 2,
    "park": 2, "chang": 2,
}  # fmt: skip
"""Orders under forces with kinks inside the steps, one method for each family, and variants."""


@pytest.mark.parametrize("method", every(3, ORDERS))
@pytest.mark.parametrize("force", [0.0, 100.0], ids=["kinks", "jumps"])
def test_order_with_kinks_and_jumps_inside_steps(method, force):
    """Kinks inside steps keep the order of each method. The line does not contain the second moment
    of a jump, which changes the velocity by a term of order 3. The error at a single position of a
    jump scatters; the root mean square over several positions does not."""
    steps = (0.005, 0.0025, 0.00125) if ORDERS[method] == 2 else (0.02, 0.01, 0.005)
    errors = {dt: [] for dt in steps}
    for delay in (0.0, 0.0031, 0.0072, 0.0113, 0.0154):
        shape = ((0.1137, force), (0.2, 200.0), (0.31, 0.5 * force))
        points = [(t + delay, value) for t, value in shape]
        expected, _ = exact_response({2: points}, end=0.4)
        for dt, listed in errors.items():
            result = simulate({2: points}, method, dt, 0.4, history=True)
            listed.append(result.history.drift[-1, 0] - expected[0])
    sizes = [np.sqrt(np.mean(np.square(values))) for values in errors.values()]
    order = math.log2(sizes[0] / sizes[2]) / 2.0
    assert order > min(ORDERS[method], 3 if force else 4) - 0.4


def test_every_family_is_integrated_here():
    """Each family of the catalogue is integrated under a table."""
    tested = {catalogue()[name.partition(":")[0]].family.name for name in ORDERS} | {"exact"}
    assert {method.family.name for method in catalogue().values()} <= tested


# ---- Superposition, harmonic forces, ground motion


def test_linear_superposition():
    """The response to two tables is the sum of the responses to each."""
    loads = {1: LATE_BLAST[2], 2: RAMP[2]}
    parts = [simulate({floor: loads[floor]}, "impulse4", 0.01, history=True) for floor in loads]
    total = simulate(loads, "impulse4", 0.01, history=True)
    for name in ("displacement", "velocity", "absolute_acceleration", "shear", "total_shear"):
        added = sum(getattr(part.history, name) for part in parts)
        expected = getattr(total.history, name)
        assert np.abs(added - expected).max() < 1e-11 * np.abs(expected).max()


def test_table_of_a_harmonic_force_tends_to_the_harmonic_force():
    """The difference falls by four if the interval of the table is halved."""
    harmonic = {"floor": 2, "amplitude": 50, "omega": 9.0, "phase": "sin"}
    model = {**TWO_STORIES, "excitation": {"forces": [harmonic]}}
    expected = tdint.run(model, dt=0.005, duration=2.0, check=False).stories.peak_drift[0]
    differences = []
    for interval in (0.05, 0.025, 0.0125):
        times = np.arange(0.0, 2.0 + interval, interval)
        points = np.transpose([times, 50.0 * np.sin(9.0 * times)])
        found = simulate({2: points.tolist()}, "impulse4", 0.005).stories.peak_drift[0]
        differences.append(abs(found / expected - 1.0))
    assert differences[0] / differences[1] == pytest.approx(4.0, rel=0.1)
    assert differences[1] / differences[2] == pytest.approx(4.0, rel=0.1)


@pytest.mark.parametrize("stride", [0.5, 1.0, 3.0])
def test_force_equal_to_a_ground_motion(stride):
    """Forces -m ag on all floors cause the relative motion of the ground acceleration ag, with
    steps shorter and longer than the sampling interval. The absolute accelerations differ by ag."""
    times = np.arange(0.0, 1.9, 0.02)
    motion = 2.0 * np.sin(11.0 * times) * np.exp(-times) + 0.3 * np.cos(31.0 * times)
    record = tdint.Record(motion, 0.02, "", "", "", "motion")
    options = {"dt": 0.02 * stride, "duration": 2.4, "check": False, "history": True}
    shaken = tdint.run(TWO_STORIES, record, **options)
    # The record is linear to zero in the interval after its last sample.
    times = np.append(times, times[-1] + 0.02)
    loads = {
        floor: np.transpose([times, np.append(-MASS[floor - 1] * motion, 0.0)]).tolist()
        for floor in (1, 2)
    }
    model = {**TWO_STORIES, "excitation": excitation(loads)}
    pushed = tdint.run(model, **options)
    scale = np.abs(shaken.history.displacement).max()
    assert np.abs(shaken.history.displacement - pushed.history.displacement).max() < 1e-12 * scale
    assert pushed.stories.peak_drift == pytest.approx(shaken.stories.peak_drift, rel=1e-9)
    assert pushed.energy.error == pytest.approx(shaken.energy.error, abs=1e-9)
    assert pushed.energy.input == pytest.approx(shaken.energy.input, rel=1e-9)
    # Relative acceleration: absolute acceleration of the forced building, and absolute minus ground
    # acceleration of the shaken building.
    ground = np.interp(pushed.history.time, times, np.append(motion, 0.0))
    relative = shaken.history.absolute_acceleration - ground[:, None]
    difference = np.abs(relative - pushed.history.absolute_acceleration)
    assert difference.max() < 1e-9 * np.abs(relative).max()


# ---- Peaks and energies


@pytest.mark.parametrize("method", ["impulse4", "moment4", "newmark-average", "exact"])
def test_peak_acceleration_at_a_jump(method):
    """The acceleration of a floor at rest is force / mass immediately after a jump, at a time step
    or inside a step."""
    for time in (0.0, 0.1, 0.1137):
        points = [(time, STIFFNESS), (time + 0.05, 0.0)]
        result = tdint.run(one_story(points), method=method, dt=0.01, duration=0.15, check=False)
        assert result.stories.peak_absolute_acceleration[0] == pytest.approx(STIFFNESS, rel=1e-3)


@pytest.mark.parametrize("time", [0.113, 0.107, 0.119])
@pytest.mark.parametrize("method", ["impulse4", "moment4", "gauss4"])
def test_peaks_at_a_jump_inside_a_step_of_a_damped_story(method, time):
    """The velocity of the line of a step differs from the velocity at a jump inside the step, and
    so does the damping force. Immediately after the jump, the acceleration is force / mass. Without
    damping, the velocity at a change of the sign of a force p from rest is p / (m omega) sin(omega
    t)."""
    force, h = 10.0, 0.02
    rising = one_story([(time, force), (1.0, force)], dashpot=8.0)
    stories = tdint.run(rising, method=method, dt=h, duration=1.0, check=False).stories
    assert stories.peak_absolute_acceleration[0] == pytest.approx(force, rel=2e-5)
    points = [(0.0, force), (time, force), (time, -force), (0.2, -force)]
    stories = tdint.run(one_story(points), method=method, dt=h, duration=0.18, check=False).stories
    velocity = force / OMEGA * math.sin(OMEGA * time)
    assert stories.peak_velocity[0] == pytest.approx(velocity, rel=1e-4)


def order_at_jumps(peak_error, step):
    """Return the order of the root mean square error of a peak over several positions of a jump in
    a step, and this error with the shorter of two steps."""
    sizes = []
    for h in (step, 0.5 * step):
        errors = [peak_error(0.1 + share * h, h) for share in (0.0, 0.13, 0.37, 0.58, 0.81)]
        sizes.append(np.sqrt(np.mean(np.square(errors))))
    return math.log2(sizes[0] / max(sizes[1], 1e-15)), sizes[1]


DAMPINGS = {
    "rayleigh": ({"rayleigh": {"ratio": "5%", "modes": [1, 2]}}, {}),
    "modal": ({"modal": "8%"}, {}),
    "dashpots": ("none", {"dashpot": 120.0}),
    "power law": ("none", {"dashpot": {"coefficient": 300.0, "exponent": 1.5}}),
}
"""Section `damping` and keys of each story."""

OF_LOWER_ORDER = ("impulse4:rho_inf=0", "moment4:rho_inf=0.5", "park")
"""Methods whose velocities in a step with a jump have errors that reduce the order of the peaks."""

WITHOUT_POWER_LAW = ("impulse", "noh-bathe", "chang")


@pytest.mark.parametrize("damping", DAMPINGS)
@pytest.mark.parametrize("method", ORDERS)
def test_peak_acceleration_at_a_jump_of_the_forces_on_all_floors(method, damping):
    """The peak acceleration of a floor from rest is force / mass, immediately after the jump. The
    lines of a step with a jump inside move all floors before the jump. Without these velocities,
    the error is of order 1. The force of a dashpot with the exponent 1.5 has the order 1.5 at
    rest."""
    if damping == "power law" and method in WITHOUT_POWER_LAW:
        return
    section, keys = DAMPINGS[damping]
    stories = [{**story, **keys} for story in TWO_STORIES["stories"]]

    def peak_error(time, h):
        loads = {1: [(time, 300.0), (time + 0.4, 0.0)], 2: [(time, 100.0), (time + 0.4, 0.0)]}
        changed = {"stories": stories, "damping": section, "excitation": excitation(loads)}
        model = {**TWO_STORIES, **changed}
        result = tdint.run(model, method=method, dt=h, duration=time + 2.5 * h, check=False)
        return result.stories.peak_absolute_acceleration[0] / (300.0 / MASS[0]) - 1.0

    order, error = order_at_jumps(peak_error, 0.002)
    assert error < 5e-4
    if method not in OF_LOWER_ORDER:
        assert order > (1.4 if damping == "power law" else 1.9)


@pytest.mark.parametrize("method", [*ORDERS, "newmark-linear"])
def test_peaks_with_a_jump_inside_a_step_are_proportional_to_the_forces(method):
    """The peaks of a linear building are not decided by rounding. Bulge and tilt of the
    accelerations of `newmark-linear` are rounding errors, as is their ratio."""
    points = ((0.0, 10.0), (0.113, 2.0), (0.113, 30.0), (0.4, 0.0))
    peaks = []
    for scale in (1.0, 1.1, 1.3, 1.7, 1.9):
        loads = [(time, scale * force) for time, force in points]
        model = one_story(loads, dashpot=8.0)
        stories = tdint.run(model, method=method, dt=0.02, duration=0.4, check=False).stories
        peaks.append([stories.peak_absolute_acceleration[0], stories.peak_total_shear[0]])
        peaks[-1] = np.array(peaks[-1]) / scale
    assert np.ptp(peaks, axis=0) == pytest.approx(0.0, abs=1e-9 * np.min(peaks))


@pytest.mark.parametrize("method", ORDERS)
def test_peaks_of_a_damped_story_at_a_jump_inside_a_step(method):
    """If a force p from rest changes its sign, the velocity, the drift rate and the total shear of
    a story with much damping have their peaks at this time. With w = omega sqrt(1 - zeta^2),

        v = p / (m w) exp(-zeta omega t) sin(w t)
        V = p - m dv/dt
    """
    force, zeta = 10.0, 0.6
    dashpot, damped = 2.0 * zeta * OMEGA, OMEGA * math.sqrt(1.0 - zeta**2)

    @cache
    def peak_errors(time, h):
        points = [(0.0, force), (time, force), (time, -force), (0.3, -force)]
        model, duration = one_story(points, dashpot=dashpot), time + 1.5 * h
        stories = tdint.run(model, method=method, dt=h, duration=duration, check=False).stories
        decay = math.exp(-zeta * OMEGA * time)
        velocity = force / damped * decay * math.sin(damped * time)
        acceleration = force * decay * math.cos(damped * time) - zeta * OMEGA * velocity
        return (
            stories.peak_velocity[0] / velocity - 1.0,
            stories.peak_damper_force[0] / (dashpot * velocity) - 1.0,
            stories.peak_total_shear[0] / (force - acceleration) - 1.0,
        )

    for quantity in range(3):
        order, error = order_at_jumps(lambda t, h, k=quantity: peak_errors(t, h)[k], 0.01)
        assert error < (1e-2 if method in OF_LOWER_ORDER else 1e-3)
        if method not in OF_LOWER_ORDER:
            assert order > 1.9


@pytest.mark.parametrize("loads", [LATE_BLAST, RAMP, wind(0.03)], ids=["jump", "ramp", "wind"])
def test_peaks_of_long_steps(loads):
    """Peaks with kinks inside the steps agree with those of short steps."""
    fine = simulate(loads, "impulse4", 0.0005).stories
    coarse = simulate(loads, "impulse4", 0.01).stories
    for name in ("peak_absolute_acceleration", "peak_total_shear", "peak_velocity", "peak_drift"):
        assert getattr(coarse, name) == pytest.approx(getattr(fine, name), rel=1e-3)


def test_acceleration_within_a_step_with_a_short_pulse():
    """A pulse within a single step has the acceleration force / mass, although no time step shows
    it; the line of the pulse alone would have a third of it."""
    points = [(0.103, 0.0), (0.105, STIFFNESS), (0.107, 0.0)]
    result = tdint.run(one_story(points), dt=0.01, duration=0.15, check=False)
    assert result.stories.peak_absolute_acceleration[0] == pytest.approx(STIFFNESS, rel=1e-3)


@pytest.mark.parametrize("method", ["impulse4", "moment4", "newmark-average", "bathe", "gauss4"])
@pytest.mark.parametrize("law", [None, {"type": "bilinear", "yield_force": 60, "hardening": 0.02}])
def test_energy_balance(method, law):
    """The work of the forces is the sum of all other energies, with jumps inside the steps."""
    stories = [{**story, **({"law": law} if law else {})} for story in TWO_STORIES["stories"]]
    damping = {"rayleigh": {"ratio": 0.03, "modes": [1, 2]}} if law else {"modal": 0.02}
    stories[0]["dashpot"] = 40.0
    forces = excitation(LATE_BLAST)["forces"] + [{"floor": 1, "amplitude": 20, "omega": 7}]
    errors = []
    for dt in (0.004, 0.002):
        model = {
            **TWO_STORIES, "stories": stories, "damping": damping, "excitation": {"forces": forces}
        }  # fmt: skip
        result = tdint.run(model, method=method, dt=dt, duration=1.0, check=False)
        errors.append(abs(result.energy.error))
    if method == "moment4":
        assert max(errors) < 1e-12
    else:
        assert max(errors) < 3e-4


def test_work_of_a_force_at_a_jump():
    """The input energy is the integral of force times velocity of the exact solution: the energy of
    the free vibration after the pulse."""
    duration = 0.371
    points = [(0.1137, STIFFNESS), (0.1137 + duration, 0.0)]
    result = tdint.run(one_story(points), dt=0.01, duration=1.5, check=False)
    t = duration
    u = 1.0 - math.cos(OMEGA * t) + math.sin(OMEGA * t) / (OMEGA * t) - 1.0
    v = OMEGA * math.sin(OMEGA * t) + math.cos(OMEGA * t) / t - 1.0 / t
    energy = 0.5 * v * v + 0.5 * STIFFNESS * u * u
    assert result.energy.input == pytest.approx(energy, rel=1e-5)


@pytest.mark.parametrize("loads", [BLAST, LATE_BLAST, RAMP, wind(0.03)])
@pytest.mark.parametrize("method", ["impulse4", "newmark-average", "moment4"])
def test_error_estimates_cover_the_errors(loads, method):
    """The true errors of peak drifts are at most twice the estimates, with kinks at other places of
    the steps of the reference run."""
    _, peaks = exact_response(loads)
    model = {**TWO_STORIES, "excitation": excitation(loads)}
    result = tdint.run(model, method=method, dt=0.01, duration=2.0)
    errors = np.abs(np.asarray(result.stories.peak_drift) - peaks)
    assert (errors <= 2.0 * np.asarray(result.check.errors.peak_drift) + 1e-7 * peaks).all()


# ---- Runs in parts and in batches


def test_batch_and_chunks_equal_the_run():
    """Many runs share the tables. Each run starts at the start of its tables, and the repeated
    integration in chunks continues them."""
    record = tdint.Record(np.sin(np.arange(80) / 7.0), 0.02, "", "", "", "motion")
    model = {**TWO_STORIES, "excitation": excitation(LATE_BLAST)}
    single = tdint.run(model, record, check=False, history=True)
    many = tdint.run_many(model, [record, record], scales=[1.0, 2.0])
    assert np.array_equal(many.stories.peak_drift[0], single.stories.peak_drift)
    assert np.array_equal(many.stories.peak_drift[2], single.stories.peak_drift)
    doubled = tdint.run(model, record.scaled(2.0), check=False)
    assert np.array_equal(many.stories.peak_drift[1], doubled.stories.peak_drift)
    chunks = list(single.history_chunks(1))
    acceleration = np.concatenate([chunk.absolute_acceleration for chunk in chunks])
    assert np.array_equal(acceleration, single.history.absolute_acceleration)


def test_points_of_a_table_are_counted_from_any_point():
    """A position of an earlier or a later step finds the points until a time (bisection)."""
    times = [0.1, 0.2, 0.3, 0.4, 0.5]
    prepared = PreparedBuilding.of(tdint.load_model(one_story([(t, 1.0) for t in times])))
    forces, points = prepared.loads
    for start in range(len(times) + 1):
        for t in (0.0, 0.1, 0.15, 0.35, 0.5, 0.6):
            found = force_tables._points_until(forces, points, 0, start, t)
            assert found == bisect_right(times, t)
