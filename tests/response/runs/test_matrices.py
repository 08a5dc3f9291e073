"""Models of matrices and flexural stories against the matrix exponential, beams and chains."""

import math
from itertools import pairwise

import numpy as np
import pytest
from scipy.linalg import eigh, expm, solve

import tdint
from el_centro import el_centro
from tdint.model.building import assemble
from tdint.response.spectra.modal import response_spectrum_analysis
from tdint.response.spectra.transfer import transfer_function

STEP, PARTS = 0.02, 64
MOTION = np.cumsum(np.random.default_rng(5).standard_normal(150)) * np.hanning(150)
FRAME = {
    "stories": [{"mass": 100, "height": 3}, {"mass": 90, "height": 3}, {"mass": 80, "height": 3}],
    "stiffness_matrix": [[90000, -48000, 9000], [-48000, 60000, -25000], [9000, -25000, 17000]],
    "damping": {"rayleigh": {"ratio": 0.04, "modes": [1, 2]}},
    "plausibility": "off, test",
}
L_FRAME = {
    "matrices": {
        "names": ["u", "w"],
        "mass": [[300, 40], [40, 200]],
        "stiffness": [[68571.43, -25714.29], [-25714.29, 17142.86]],
        "damping": [[90, -10], [-10, 20]],
        "influence": [0.8, 0.6],
    }
}
STICK = {
    "stories": [{"repeat": 4, "mass": 2e5, "height": 3.5, "flexural": {"EI": 9e9, "GA": 1.2e9}}],
    "base": {"rotation": 8e9, "translation": 4e8},
    "damping": {"modal": 0.04},
}


@pytest.fixture(scope="module")
def record(tmp_path_factory):
    path = tmp_path_factory.mktemp("motion") / "motion.csv"
    rows = (f"{STEP * i:.2f},{value:.12g}" for i, value in enumerate(MOTION))
    path.write_text("time_s,acceleration_m_s2\n" + "\n".join(rows) + "\n")
    return tdint.read_record(str(path))


def reference(building):
    """Return displacements, velocities and relative accelerations at fine times, and the ground
    acceleration, from the exponential of the complete first-order system."""
    system, n = building.system, building.stories
    inverse = np.linalg.inv(system.mass)
    block = np.zeros((2 * n + 2, 2 * n + 2))
    block[:n, n : 2 * n] = np.eye(n)
    block[n : 2 * n, :n] = -inverse @ system.stiffness
    block[n : 2 * n, n : 2 * n] = -inverse @ system.damping
    block[n : 2 * n, 2 * n] = -system.influence
    block[2 * n, 2 * n + 1] = 1.0
    matrix = expm(block * STEP / PARTS)
    state, rows = np.zeros(2 * n + 2), []
    for start, end in pairwise(MOTION):
        state[2 * n :] = start, (end - start) / STEP
        for _ in range(PARTS):
            rows.append(state)
            state = matrix @ state
    rows = np.array(rows)
    return rows[:, :n], rows[:, n : 2 * n], rows @ block[n : 2 * n].T, rows[:, 2 * n]


def peak(values):
    return np.abs(values).max(axis=0)


@pytest.mark.parametrize("content", [FRAME, L_FRAME, STICK], ids=["frame", "rows", "stick"])
def test_peaks_are_those_of_the_matrix_exponential(content, record):
    model = tdint.load_model(content)
    response = tdint.run(model, record, duration=2.96, history=True)
    building = assemble(model)
    u, v, a, ground = reference(building)
    system, peaks = building.system, response.stories
    absolute = a + ground[:, None] * system.influence
    expected = {
        "peak_displacement": peak(u),
        "peak_velocity": peak(v),
        "peak_absolute_acceleration": peak(absolute),
        "peak_drift": peak(u @ system.deformations.T),
        "peak_shear": peak(u @ system.stiffness @ system.cuts.T),
        "peak_total_shear": peak(absolute @ system.mass @ system.cuts.T),
    }
    for name, values in expected.items():
        # The maxima of the samples are slightly below those of the continuous response.
        np.testing.assert_allclose(getattr(peaks, name), values, rtol=3e-4, err_msg=name)
        assert np.all(getattr(peaks, name) >= values * (1.0 - 1e-7)), name
    history = response.history
    np.testing.assert_allclose(
        history.displacement[:148], u[::PARTS][:148], atol=1e-9 * peak(u)[-1]
    )
    assert abs(response.energy.error) < 1e-4
    coarse = tdint.run(model, record, duration=2.96, dt=4 * STEP, check=False)
    np.testing.assert_allclose(coarse.stories.peak_drift, peaks.peak_drift, rtol=1e-9)
    if content is STICK:
        flexure = system.flexure
        assert response.flexure.peak_moment == pytest.approx(peak(u @ flexure.moment.T), rel=3e-4)
        assert response.flexure.base_rotation == pytest.approx(
            response.flexure.peak_moment[0] / 8e9, rel=1e-9
        )
        assert response.flexure.base_displacement == pytest.approx(
            peaks.peak_shear[0] / 4e8, rel=1e-9
        )


def test_flexibility_of_a_stick_is_the_integral_over_its_moments_and_shears():
    model = tdint.load_model(STICK)
    heights = 3.5 * np.arange(1, 5)
    flexibility = np.linalg.inv(assemble(model).system.stiffness)
    for i, top in enumerate(heights):
        for j, other in enumerate(heights):
            x = min(top, other)
            bending = (top * other * x - (top + other) * x**2 / 2 + x**3 / 3) / 9e9
            expected = bending + x / 1.2e9 + top * other / 8e9 + 1 / 4e8
            assert flexibility[i, j] == pytest.approx(expected, rel=1e-10)


def test_first_frequency_of_a_uniform_cantilever():
    mass, height, stiffness, n = 100.0, 2.0, 3e7, 60
    stories = [{"repeat": n, "mass": mass, "height": height, "flexural": {"EI": stiffness}}]
    omega = assemble(tdint.load_model({"stories": stories})).modes().omega[0]
    # The last mass belongs to half an element only.
    expected = 3.51602 * math.sqrt(stiffness / (mass / height)) / (n * height) ** 2
    assert omega == pytest.approx(expected, rel=2.0 / n)


def chain_and_matrix():
    """Return a chain and the same building by its matrix."""
    masses, springs = [120.0, 100.0, 80.0], [3e4, 2.5e4, 2e4]
    chain = [{"mass": m, "height": 3, "stiffness": k} for m, k in zip(masses, springs, strict=True)]
    matrix = np.diag(np.add(springs, [*springs[1:], 0.0]))
    matrix -= np.diag(springs[1:], 1) + np.diag(springs[1:], -1)
    more = {"damping": {"modal": [0.02, 0.05]}, "plausibility": "off, test"}
    floors = [{"mass": m, "height": 3} for m in masses]
    return (
        tdint.load_model({"stories": chain, **more}),
        tdint.load_model({"stories": floors, "stiffness_matrix": matrix.tolist(), **more}),
    )


def test_matrix_of_a_chain_has_its_modes_transfer_functions_and_design_spectra():
    chain, matrix = chain_and_matrix()
    first, second = (assemble(model).modes() for model in (chain, matrix))
    np.testing.assert_allclose(second.omega, first.omega, rtol=1e-9)
    np.testing.assert_allclose(second.participation, first.participation, rtol=1e-7)
    np.testing.assert_allclose(second.mass_ratio, first.mass_ratio, rtol=1e-7)
    frequency = np.array([0.3, 1.0, 2.5])
    for source in ("ground", 2):
        one, other = (
            transfer_function(m, frequency, source=source).response for m in (chain, matrix)
        )
        np.testing.assert_allclose(other, one, rtol=1e-9)
    target = "asce7:sds=1,sd1=0.5,tl=8"
    one, other = (response_spectrum_analysis(model, target) for model in (chain, matrix))
    for name in ("drift_cqc", "shear_cqc", "acceleration_cqc", "moment_cqc"):
        np.testing.assert_allclose(getattr(other, name), getattr(one, name), rtol=1e-7)


def test_participation_follows_the_influence_vector():
    modes = assemble(tdint.load_model(L_FRAME)).modes()
    assert modes.mass_ratio.sum() == pytest.approx(1.0, rel=1e-12)
    mass, influence = np.array([[300, 40], [40, 200]]), np.array([0.8, 0.6])
    factor = modes.shapes[:, 0] @ mass @ influence
    assert modes.mass_ratio[0] == pytest.approx(factor**2 / (influence @ mass @ influence))


def test_floor_without_mass_follows_statically(record):
    stories = [{"mass": 100, "height": 3}, {"mass": 0, "height": 3}, {"mass": 80, "height": 3}]
    matrix = np.array(FRAME["stiffness_matrix"], dtype=float)
    model = tdint.load_model({**FRAME, "stories": stories, "damping": {"modal": 0.05}})
    kept = [0, 2]
    condensed = (
        matrix[np.ix_(kept, kept)] - np.outer(matrix[kept, 1], matrix[1, kept]) / matrix[1, 1]
    )
    small = {
        "stories": [stories[0], stories[2]],
        "stiffness_matrix": condensed.tolist(),
        "damping": {"modal": 0.05},
        "plausibility": "off, test",
    }
    one, other = (tdint.run(m, record, check=False) for m in (model, tdint.load_model(small)))
    np.testing.assert_allclose(
        one.stories.peak_displacement[kept], other.stories.peak_displacement, rtol=1e-8
    )
    assert any("without mass: floor 2" in text for text in one.notes)


def test_force_on_a_floor_comes_to_rest_at_the_static_displacement():
    force = {"floor": 2, "points": [[0, 0], [1, 500], [400, 500]]}
    content = {**FRAME, "excitation": {"forces": [force]}}
    response = tdint.run(content, dt=0.05, duration=300, history=True, check=False)
    expected = solve(np.array(FRAME["stiffness_matrix"], dtype=float), [0.0, 500.0, 0.0])
    np.testing.assert_allclose(response.history.displacement[-1], expected, rtol=1e-6)
    np.testing.assert_allclose(response.history.total_shear[-1], [500, 500, 0], atol=1e-3)


def test_free_vibration_and_history_in_chunks():
    initial = {"displacement": [0.01, 0.02, 0.03]}
    content = {**FRAME, "initial": initial, "damping": "none"}
    response = tdint.run(content, dt=0.01, duration=5, history=True, check=False)
    assert response.stories.peak_displacement[2] >= 0.03
    stiffness = np.array(FRAME["stiffness_matrix"], dtype=float)
    start = np.array(initial["displacement"])
    assert response.energy.initial == pytest.approx(0.5 * start @ stiffness @ start)
    every = np.concatenate([chunk.displacement for chunk in response.history_chunks(4)])
    np.testing.assert_allclose(every, response.history.displacement[::4], atol=1e-12)


def test_inertance_is_not_loaded_by_the_ground_motion(tmp_path):
    # Roof mass of 4 t with an inerter of 20 t to the ground on five stories, and an inerter of 80 t
    # in story 2 of three stories: `topology_references.json`.
    masses, springs = [2e5] * 5 + [4e3], [2.5e8, 2.5e8, 2.2e8, 2.0e8, 1.8e8, 1992080.952]
    damping, chain = [0.0] * 5 + [52477.16369], chain_of(springs)
    bare = np.diag([2e5] * 5), chain_of(springs[:5])
    omega = np.sqrt(eigh(bare[1], bare[0], eigvals_only=True)[:2])
    a1 = 2 * 0.02 / omega.sum()
    rayleigh = np.zeros((6, 6))
    rayleigh[:5, :5] = a1 * omega[0] * omega[1] * bare[0] + a1 * bare[1]
    rows = ("1", "2", "3", "4", "5", "tmdi")
    model = {
        "matrices": {
            "names": [f"row {row}" for row in rows],
            "mass": masses,
            "inertance": [0.0] * 5 + [2e4],
            "stiffness": chain.tolist(),
            "damping": (rayleigh + chain_of(damping)).tolist(),
        }
    }
    motion = el_centro(duration=31.18)
    response = tdint.run(tdint.load_model(model), motion, duration=31.18, history=True)
    peak = response.stories.peak_displacement
    assert (peak[0], peak[4]) == pytest.approx((0.0207307, 0.09187659), rel=1e-5)
    acceleration = response.stories.peak_absolute_acceleration[5]
    assert acceleration == pytest.approx(19.25001, rel=1e-4)
    stroke = np.abs(np.diff(response.history.displacement[:, 4:], axis=1)).max()
    assert stroke == pytest.approx(0.2078022, rel=1e-3)  # at the time steps

    inerter = np.array([[8e4, -8e4, 0.0], [-8e4, 8e4, 0.0], [0.0, 0.0, 0.0]])
    model = {
        "matrices": {
            "mass": [1e5] * 3,
            "inertance": inerter.tolist(),
            "stiffness": chain_of([6e7, 5e7, 4e7]).tolist(),
        },
        "damping": {"rayleigh": {"ratio": 0.04, "modes": [1, 2]}},  # modes without the inerter
    }
    response = tdint.run(tdint.load_model(model), motion, duration=31.18)
    assert response.stories.peak_absolute_acceleration == pytest.approx(
        (8.083706, 6.122147, 8.968529), rel=1e-4
    )
    assert response.stories.peak_displacement[0] == pytest.approx(0.03399496, rel=1e-5)
    assert assemble(response.model).modes().omega / (2 * np.pi) == pytest.approx(
        (1.578937, 3.934013, 4.40924), rel=1e-6
    )


def chain_of(springs):
    """Return the matrix of a chain of springs."""
    ends = np.eye(len(springs)) - np.eye(len(springs), k=-1)
    return (ends.T * springs) @ ends


def test_collapse_and_sets_of_runs(record):
    content = {**FRAME, "collapse_drift": 0.001}
    response = tdint.run(content, record, check=False)
    assert response.status == "collapsed"
    step = round(response.collapse.time / STEP)
    history = tdint.run(content, record, check=False, history=True).history
    ratio = np.abs(history.drift).max(axis=1) / 3.0
    assert ratio[step - 1] <= 0.001 * 1.01 and ratio[: step + 1].max() > 0.001 * 0.9
    runs = tdint.run_many([FRAME], [record], scales=[1.0, 2.0])
    drift = runs.stories.peak_drift
    assert drift[1] == pytest.approx(2.0 * drift[0], rel=1e-9)


M, K, KB, CD, KF, CF, CS = 1e5, 4e6, 6e6, 4e5, 5e6, 3e5, 1e5
LAGGING = {  # masses, stiffness and damping; the last rows have no mass
    "Maxwell damper": ([M, 0], [[K + KB, -KB], [-KB, KB]], [[0, 0], [0, CD]]),
    "footing": ([M, 0], [[K, -K], [-K, K + KF]], [[CS, -CS], [-CS, CS + CF]]),
    "two stories": (
        [M, M, 0],
        [[2 * K, -K, 0], [-K, K + KB, -KB], [0, -KB, KB + KF]],
        [[0, 0, 0], [0, CS, -CS], [0, -CS, CS + CD]],
    ),
    "dashpot between two rows": (
        [M, M, 0, 0],
        [[2 * K + KB, -K, -KB, 0], [-K, K + KF, 0, -KF], [-KB, 0, KB, 0], [0, -KF, 0, KF]],
        [[0, 0, 0, 0], [0, 0, 0, 0], [0, 0, CD, -CD], [0, 0, -CD, CD]],
    ),
}


def descriptor(name, step, count, motion):
    """Return the displacements of all rows at `count` + 1 times, by the exponential of the system
    in which each row without mass has a mass so small that its vibration decays within a step."""
    mass, stiffness, damping = (np.array(item, dtype=float) for item in LAGGING[name])
    small = np.where(mass == 0.0, 1e-7 * M, mass)
    n = len(mass)
    block = np.zeros((2 * n + 2, 2 * n + 2))
    block[:n, n : 2 * n] = np.eye(n)
    block[n : 2 * n, :n] = -stiffness / small[:, None]
    block[n : 2 * n, n : 2 * n] = -damping / small[:, None]
    block[n : 2 * n, 2 * n] = -mass / small
    block[2 * n, 2 * n + 1] = 1.0
    matrix = expm(block * step)
    state, rows = np.zeros(2 * n), [np.zeros(n)]
    for start, end in pairwise(motion[: count + 1]):
        state = (matrix @ np.concatenate([state, [start, (end - start) / step]]))[: 2 * n]
        rows.append(state[:n])
    return np.array(rows)


def lagging(name, **keys):
    """Return a model with rows without mass that have dashpots."""
    mass, stiffness, damping = LAGGING[name]
    return {"matrices": {"mass": mass, "stiffness": stiffness, "damping": damping}, **keys}


@pytest.mark.parametrize("name", LAGGING)
def test_rows_without_mass_lag_behind_their_dashpots(name):
    time = 0.01 * np.arange(301)
    motion = 3.0 * np.sin(6.0 * time) * (time < 2.0)
    record = tdint.make_record(motion, dt=0.01, units="m/s^2")
    response = tdint.run(lagging(name), record, history=True, check=False)
    expected = descriptor(name, 0.01, 300, motion)
    largest = np.abs(expected).max()
    np.testing.assert_allclose(response.history.displacement, expected, atol=2e-5 * largest)
    assert response.energy.error < 1e-5
    assert any("with their dashpots" in note for note in response.notes)


def test_damped_modes_of_a_maxwell_damper():
    """The roots of m s^3 + m s^2 / tau + (k + kb) s + k / tau"""
    tau = CD / KB
    roots = np.roots([M, M / tau, K + KB, K / tau])
    damped = assemble(tdint.load_model(lagging("Maxwell damper"))).complex_modes()
    np.testing.assert_allclose(damped.eigenvalues, roots[roots.imag > 0.0], rtol=1e-9)


def test_forces_on_rows_without_mass_and_indefinite_damping_are_refused():
    force = {"floor": 2, "amplitude": 1.0, "omega": 3.0, "phase": "sin"}
    with pytest.raises(tdint.TdintError, match="row_2: it has no mass"):
        tdint.run(lagging("footing", excitation={"forces": [force]}), dt=0.01, duration=1)
    content = lagging("footing")
    content["matrices"]["damping"] = [[CS, -3 * CS], [-3 * CS, CS + CF]]
    with pytest.raises(tdint.TdintError, match="positive semidefinite"):
        tdint.load_model(content)
