"""Rotary inertia of floors in flexural stories: closed-form frequencies of a cantilever and of
uniform beams, and responses of the complete system by `scipy.integrate.solve_ivp`."""

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.linalg import eigh
from scipy.optimize import brentq

import tdint
from tdint.model.building import assemble
from tdint.response.spectra.modal import response_spectrum_analysis
from tdint.response.spectra.transfer import transfer_function

MASSES, HEIGHTS, INERTIAS = [4e5, 3e5, 2e5], [4.0, 3.0, 3.5], [6e6, 0.0, 9e6]
BENDING, SHEAR, SOIL = [9e9, 7e9, 5e9], [1.2e9, 1.5e9, 0.8e9], 2e10
STICK = {
    "stories": [
        {
            "mass": mass,
            "height": height,
            "flexural": {"EI": bending, "GA": shear},
            **({"rotary_inertia": inertia} if inertia else {}),
        }
        for mass, height, bending, shear, inertia in zip(
            MASSES, HEIGHTS, BENDING, SHEAR, INERTIAS, strict=True
        )
    ],
    "base": {"rotation": SOIL},
    "damping": {"rayleigh": {"ratio": 0.04, "modes": [1, 4]}},
    "plausibility": "off, test",
}


def flexibility_of_stick():
    """Return the displacements of the floors, then the rotations of the first and third floor, for
    unit forces and moments on these rows: integrals over the moments and shears."""
    levels = np.cumsum(HEIGHTS)
    points, weights = np.polynomial.legendre.leggauss(3)
    result = np.zeros((5, 5))
    for story, (height, top) in enumerate(zip(HEIGHTS, levels, strict=True)):
        for point, weight in zip(points, weights, strict=True):
            x = top - height * (0.5 + 0.5 * point)
            moments = np.append(np.maximum(levels - x, 0.0), levels[[0, 2]] > x)
            shears = np.append(levels > x, [0.0, 0.0])
            result += 0.5 * height * weight * np.outer(moments, moments) / BENDING[story]
            result += 0.5 * height * weight * np.outer(shears, shears) / SHEAR[story]
    at_base = np.append(levels, [1.0, 1.0])
    return result + np.outer(at_base, at_base) / SOIL


def test_frequencies_of_a_cantilever_with_tip_mass_and_rotary_inertia():
    bending, length, mass, inertia = 3e7, 4.0, 1e3, 9e3
    story = {"mass": mass, "height": length, "flexural": {"EI": bending}}
    content = {"stories": [{**story, "rotary_inertia": inertia}], "plausibility": "off, test"}
    # (3 EI / L^3) and (EI / L) are the stiffnesses of the tip without and with its rotation:
    # det(1 - omega^2 F diag(m, J)) = 0.
    b = mass * length**3 / (3.0 * bending) + inertia * length / bending
    c = mass * inertia * length**4 / (12.0 * bending**2)
    expected = np.sqrt((b - np.array([1, -1]) * math.sqrt(b * b - 4.0 * c)) / (2.0 * c))
    model = tdint.load_model(content)
    modes = tdint.modes(model)
    np.testing.assert_allclose(modes.omega, np.sort(expected), rtol=1e-12)
    assert modes.mass_ratio.sum() == pytest.approx(1.0, rel=1e-12)
    units = {"length": "mm", "force": "kN", "mass": "t"}
    story = {"mass": 1, "height": 4e3, "flexural": {"EI": 3e10}, "rotary_inertia": 9e6}
    other = tdint.modes({"units": units, "stories": [story], "plausibility": "off, test"})
    np.testing.assert_allclose(other.omega, modes.omega, rtol=1e-12)
    # Without rotary inertia, the first frequency is that of the condensed stiffness.
    del content["stories"][0]["rotary_inertia"]
    bare = tdint.modes(content).omega
    assert bare == pytest.approx([math.sqrt(3.0 * bending / length**3 / mass)], rel=1e-12)


def uniform(count, radius, shear):
    """Return the first three frequencies of a uniform cantilever in `count` stories, rad/s."""
    height, mass = 30.0 / count, 2e3 * 30.0 / count
    flexural = {"EI": 3e9, **({"GA": shear} if shear else {})}
    story = {"height": height, "flexural": flexural}
    stories = [
        {"repeat": count - 1, "mass": mass, "rotary_inertia": mass * radius**2, **story},
        {"mass": mass / 2, "rotary_inertia": mass / 2 * radius**2, **story},
    ]
    model = tdint.load_model({"stories": stories, "plausibility": "off, test"})
    return assemble(model).modes().omega[:3]


def closed_form(radius, shear):
    """Return the first three frequencies of a uniform cantilever, rad/s: the differential equation
    of Timoshenko, or without shear deformation that of Rayleigh.

    With b = mu r^2 omega^2 / EI, c = mu omega^2 / EI and a = mu omega^2 / GA, the displacement has
    the form exp(k x) with k^4 + (a + b) k^2 + a b - c = 0. The rotation of exp(k x) is
    (k + a / k) exp(k x).
    """

    def determinant(omega):
        a = 2e3 * omega**2 / shear if shear else 0.0
        b, c = 2e3 * radius**2 * omega**2 / 3e9, 2e3 * omega**2 / 3e9
        k = np.roots([1.0, 0.0, a + b, 0.0, a * b - c]).astype(complex)
        turn = k + a / k
        end = np.exp(k * 30.0)
        # At the base no displacement and rotation; at the tip no moment, and no shear GA (u' -
        # rotation), in a form that also holds without shear deformation: M' + b EI rotation = 0.
        rows = [np.ones(4), turn, turn * k * end, (turn * k * k + b * turn) * end]
        # The roots are in arbitrary order, which changes the sign: scale by their Vandermonde.
        value = np.linalg.det(np.array(rows)) / np.linalg.det(np.vander(k, increasing=True))
        return value.real / math.cosh(30.0 * np.abs(k.real).max())

    grid = np.linspace(0.5, 90.0, 400)
    values = [determinant(omega) for omega in grid]
    return np.array(
        [
            brentq(determinant, grid[i], grid[i + 1], xtol=1e-12, rtol=1e-14)
            for i in range(len(grid) - 1)
            if values[i] * values[i + 1] < 0.0
        ][:3]
    )


@pytest.mark.parametrize("shear", [None, 4e7], ids=["Rayleigh", "Timoshenko"])
def test_frequencies_of_uniform_beams_converge_to_the_closed_form(shear):
    thin = closed_form(1e-4, None)
    beam = 3.51601527 * math.sqrt(3e9 / 2e3) / 30.0**2
    assert thin[0] == pytest.approx(beam, rel=1e-7)
    expected = closed_form(4.0, shear)
    coarse, fine = uniform(20, 4.0, shear), uniform(40, 4.0, shear)
    assert np.all(np.abs(fine / expected - 1.0) < 3e-3)
    np.testing.assert_allclose((4.0 * fine - coarse) / 3.0, expected, rtol=3e-5)
    # Rotary inertia changes the third frequency by more than 5 %.
    assert np.abs(uniform(40, 1e-2, shear)[2] / expected[2] - 1.0) > 0.05


TIME = np.linspace(0.0, 3.0, 301)
GROUND = 2.0 * np.sin(14.0 * TIME) * np.exp(-0.8 * TIME) + 1.5 * np.sin(45.0 * TIME) * (TIME < 1.5)


def response_of_stick(time):
    """Return displacements, velocities, accelerations and the ground acceleration at times."""
    mass = np.diag([*MASSES, INERTIAS[0], INERTIAS[2]])
    stiffness = np.linalg.inv(flexibility_of_stick())
    omega = np.sqrt(eigh(stiffness, mass, eigvals_only=True))
    # Damping ratio 4 % in modes 1 and 4 of the five modes.
    by_stiffness = 2.0 * 0.04 / (omega[0] + omega[3])
    damping = by_stiffness * omega[0] * omega[3] * mass + by_stiffness * stiffness
    loaded = np.append(MASSES, [0.0, 0.0])

    def acceleration(t, u, v):
        force = -loaded[:, None] * np.interp(t, TIME, GROUND) - damping @ v - stiffness @ u
        force[2] += np.interp(t, [0.0, 0.04, 0.08, 9.0], [0.0, 8e5, 0.0, 0.0])  # pulse on the roof
        return np.linalg.solve(mass, force)

    def rate(t, y):
        return np.append(y[5:], acceleration(np.array([t]), y[:5, None], y[5:, None]))

    start = np.zeros(10)
    start[:3], start[5:8] = (1e-3, 2e-3, 4e-3), (0.0, 0.02, 0.05)
    for rows in (slice(0, 5), slice(5, 10)):  # static rotations
        u = start[rows]
        u[3:] = -np.linalg.solve(stiffness[3:, 3:], stiffness[3:, :3] @ u[:3])
    y = solve_ivp(
        rate, (0.0, time[-1]), start, "DOP853", time, rtol=1e-10, atol=1e-13, max_step=0.01
    ).y
    return (
        stiffness,
        mass,
        y[:5],
        y[5:],
        acceleration(time, y[:5], y[5:]),
        np.interp(time, TIME, GROUND),
    )


@pytest.mark.long
def test_response_to_ground_motion_and_pulse_against_solve_ivp():
    fine = np.linspace(0.0, 3.0, 6001)
    stiffness, mass, u, v, a, ground = response_of_stick(fine)
    content = {
        **STICK,
        "initial": {"displacement": [1e-3, 2e-3, 4e-3], "velocity": [0.0, 0.02, 0.05]},
        "excitation": {
            "forces": [{"floor": 3, "points": [[0, 0], [0.04, 8e5], [0.08, 0], [9, 0]]}]
        },
    }
    record = tdint.make_record(GROUND, dt=0.01, units="m/s^2")
    response = tdint.run(content, record, duration=3.0, history=True)
    history, peaks, flexure = response.history, response.stories, response.flexure
    assert history.displacement.shape == (301, 3)
    for name, values in (
        ("displacement", u),
        ("velocity", v),
        ("absolute_acceleration", a + ground),
    ):
        expected = values[:3, ::20].T
        np.testing.assert_allclose(
            getattr(history, name), expected, rtol=0.0, atol=1e-6 * np.abs(expected).max()
        )
    forces = stiffness @ u
    levels, arms = (
        np.cumsum(HEIGHTS),
        np.array([[4.0, 7.0, 10.5], [0.0, 3.0, 6.5], [0.0, 0.0, 3.5]]),
    )
    moment = arms @ forces[:3]
    moment[0] += forces[3] + forces[4]  # of the first and third floor
    moment[1:] += forces[4]
    shear = np.cumsum(forces[:3][::-1], axis=0)[::-1]
    pulse = np.interp(fine, [0.0, 0.04, 0.08, 9.0], [0.0, 8e5, 0.0, 0.0])
    total = -(levels * MASSES) @ (a[:3] + ground) - mass[3, 3] * a[3] - mass[4, 4] * a[4]
    base_rotation = moment[0] / SOIL
    drift = np.diff(u[:3], axis=0, prepend=0.0)
    # Without rotation of the bottom of the first story; rotation of the first floor under story 2
    own = drift[:2] - np.array([[4.0], [3.0]]) * np.array([base_rotation, u[3]])
    for computed, values in (
        (peaks.peak_drift, drift),
        (peaks.peak_shear, shear),
        (flexure.peak_moment, moment),
        (flexure.peak_rotation[[0, 2]], u[3:]),
        (flexure.peak_drift_without_rotation[:2], own),
        (flexure.peak_shear_drift, shear * np.divide(HEIGHTS, SHEAR)[:, None]),
        (flexure.base_rotation, base_rotation),
        (flexure.total_base_moment, total + levels[2] * pulse),
    ):
        # The maxima of the samples are slightly below those of the continuous response.
        assert computed == pytest.approx(np.abs(values).max(axis=-1), rel=1e-4)
    energy = history.energy
    kinetic = 0.5 * np.einsum("it,ij,jt->t", v, mass, v)[::20]
    np.testing.assert_allclose(energy.kinetic, kinetic, rtol=0.0, atol=1e-6 * kinetic.max())
    strain = 0.5 * np.einsum("it,ij,jt->t", u, stiffness, u)[::20]
    np.testing.assert_allclose(energy.strain, strain, rtol=0.0, atol=1e-6 * strain.max())
    assert abs(response.energy.error) < 1e-4
    assert response.check.errors.peak_drift.shape == (3,)


def test_matrices_transfer_functions_and_design_spectra_contain_the_rotations():
    model = tdint.load_model(STICK)
    given = tdint.matrices(model)
    assert given.names == ("floor_1", "floor_2", "floor_3", "rotation_1", "rotation_3")
    np.testing.assert_allclose(np.linalg.inv(given.stiffness), flexibility_of_stick(), rtol=1e-9)
    np.testing.assert_array_equal(given.influence, [1, 1, 1, 0, 0])
    np.testing.assert_array_equal(np.diagonal(given.mass), [*MASSES, 6e6, 9e6])
    omega = 2.0 * math.pi * 3.0
    dynamic = given.stiffness + 1j * omega * given.damping - omega**2 * given.mass
    load = np.array([*MASSES, 0.0, 0.0]) * omega**2
    result = transfer_function(model, np.array([3.0]))
    expected = np.linalg.solve(dynamic, load)[:3] + 1.0
    np.testing.assert_allclose(result.response[0], expected, rtol=1e-9)
    # The moment of one mode is that of the inertia forces and inertia moments.
    design = response_spectrum_analysis(model, "asce7:sds=1,sd1=0.5,tl=8")
    modes = tdint.modes(model)
    factor = (np.array([*MASSES, 0.0, 0.0]) @ modes.shapes) * design.spectral_acceleration
    inertia = given.mass @ modes.shapes * factor
    moments = np.append(np.cumsum(HEIGHTS), [1.0, 1.0]) @ inertia
    correlation = np.eye(5)
    for i in range(5):
        for k in range(5):
            r = modes.omega[i] / modes.omega[k]
            correlation[i, k] = 8 * 0.05**2 * (1 + r) * r**1.5
            correlation[i, k] /= (1 - r**2) ** 2 + 4 * 0.05**2 * r * (1 + r) ** 2
    assert design.moment_cqc[0] == pytest.approx(
        math.sqrt(moments @ correlation @ moments), rel=1e-9
    )
    assert design.drift_cqc.shape == design.acceleration_cqc.shape == (3,)


@pytest.mark.long
def test_campaigns_and_restarts_contain_the_rotations():
    record = tdint.make_record(GROUND, dt=0.01, units="m/s^2")
    whole = tdint.run(STICK, record, duration=2.0, history=True, check=False)
    runs = tdint.run_many([STICK], [record], scales=[1.0, 2.0], duration=2.0)
    np.testing.assert_allclose(runs.stories.peak_drift[0], whole.stories.peak_drift, rtol=1e-12)
    first = tdint.run(STICK, record, duration=0.5, check=False)
    rest = tdint.make_record(GROUND[50:], dt=0.01, units="m/s^2")
    second = tdint.run(
        STICK, rest, duration=1.5, initial=first.final_state, history=True, check=False
    )
    expected = whole.history.displacement[50:]
    np.testing.assert_allclose(
        second.history.displacement, expected, rtol=0.0, atol=1e-10 * np.abs(expected).max()
    )
