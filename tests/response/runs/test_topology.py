"""Response of buildings with attachments and links against the matrix exponential, against the same
building written as a chain, and between methods."""

import io
from dataclasses import replace

import numpy as np
import pytest
from scipy.linalg import expm

import tdint
from tdint.errors import AnalysisError, UsageError
from tdint.ground_motion.record import Record
from tdint.model.building import assemble
from tdint.model.config.model_file import load_model

STEP, SAMPLES = 0.02, 60
TIME = STEP * np.arange(SAMPLES)
MOTION = Record(
    3.0 * np.sin(9.0 * TIME) * np.exp(-TIME) + np.sin(31.0 * TIME), STEP, "", "", "", "motion"
)
LINEAR = """
units: {length: m, force: kN, mass: t}
stories: [{repeat: 3, mass: 100, height: 3, stiffness: 6.0e4}]
damping: {rayleigh: {ratio: 3%, modes: [1, 2]}}
plausibility: off, test
attachments:
  - {name: tank, floor: 1, mass: 4, stiffness: 630, dashpot: 3}
  - {name: tmd, floor: roof, mass: 6, stiffness: 900, dashpot: 9}
links:
  - {name: lower, from: ground, to: 2, dashpot: 600}
  - {name: cable, from: 3, to: 1, stiffness: 9000, dashpot: 50}
  - {name: tie, from: tank, to: 2, stiffness: 40}
"""
BILINEAR = LINEAR.replace("stiffness: 6.0e4", "stiffness: 6.0e4, law: {type: bilinear, "
    "yield_force: 60, hardening: 5%}").replace("stiffness: 9000", "stiffness: 9000, law: {type: "
    "bilinear, yield_force: 4, hardening: 2%}")  # fmt: skip


def exact(model, parts=50):
    """Displacements, velocities and absolute accelerations of all masses at steps of STEP / parts,
    by the matrix exponential for a load that is linear between the samples."""
    building = assemble(model)
    n, h = building.masses, STEP / parts
    inverse = 1.0 / building.mass[:, None]
    a = np.zeros((2 * n + 2, 2 * n + 2))
    a[:n, n : 2 * n] = np.eye(n)
    a[n : 2 * n, :n] = -inverse * building.stiffness_matrix()
    a[n : 2 * n, n : 2 * n] = -inverse * building.damping_matrix()
    a[n : 2 * n, 2 * n], a[2 * n, 2 * n + 1] = -1.0, 1.0
    step, state, rows = expm(a * h), np.zeros(2 * n + 2), []
    for i in range(SAMPLES - 1):
        state[2 * n] = MOTION.acceleration[i]
        state[2 * n + 1] = (MOTION.acceleration[i + 1] - MOTION.acceleration[i]) / STEP
        for _ in range(parts):
            state = step @ state
            rows.append([*state[: 2 * n], *(a[n : 2 * n, : 2 * n] @ state[: 2 * n])])
    return np.split(np.array(rows), 3, axis=1)


@pytest.mark.long
@pytest.mark.parametrize(
    ("method", "tolerance"),
    [("impulse4", 1e-3), ("moment4", 1e-3), ("gauss4", 1e-3), ("exact", 1e-3), ("bathe", 5e-2),
     ("newmark-average", 5e-2), ("hht:alpha=-0.1", 5e-2)],
)  # fmt: skip
def test_peaks_equal_those_of_the_matrix_exponential(method, tolerance):
    model = load_model(io.StringIO(LINEAR))
    u, v, a = exact(model)
    response = tdint.run(model, MOTION, method=method, duration=TIME[-1], check=False)
    ends = assemble(model).deformations
    drift, rate = np.abs(u @ ends.T).max(axis=0), np.abs(v @ ends.T).max(axis=0)
    stories, devices = response.stories, response.devices.stories
    assert stories.peak_drift == pytest.approx(drift[:3], rel=tolerance)
    assert devices.peak_drift == pytest.approx(drift[3:8], rel=tolerance)
    assert devices.peak_shear == pytest.approx(
        1e3 * np.array([630, 900, 0, 9000, 40]) * drift[3:8], rel=tolerance
    )
    assert devices.peak_damper_force == pytest.approx(
        1e3 * np.array([3, 9, 600, 50, 0]) * rate[3:8], rel=tolerance
    )
    acceleration = np.abs(a).max(axis=0)
    assert devices.peak_absolute_acceleration[:2] == pytest.approx(acceleration[3:], rel=tolerance)
    assert stories.peak_absolute_acceleration == pytest.approx(acceleration[:3], rel=tolerance)
    # The total shear of a story is the inertia of all masses above it: it includes the links.
    inertia = assemble(model).mass * a
    shears = [
        inertia.sum(axis=1),
        inertia[:, [1, 2, 4]].sum(axis=1),
        inertia[:, [2, 4]].sum(axis=1),
    ]
    expected = [np.abs(shear).max() for shear in shears]
    assert stories.peak_total_shear == pytest.approx(expected, rel=tolerance)
    assert abs(response.energy.error) < tolerance


@pytest.mark.long
@pytest.mark.parametrize("method", ["impulse4", "moment4", "gauss4", "newmark-average"])
def test_a_roof_attachment_equals_a_story(method):
    """The same building as a chain, without damping of the building: every result agrees."""
    law = "law: {type: bilinear, yield_force: 4, hardening: 5%}"
    top = f"mass: 6, stiffness: 900, {law}, dashpot: 9"
    frame = "{repeat: 3, mass: 100, stiffness: 6.0e4, law: {type: bilinear, yield_force: 90, " \
        "hardening: 5%}}"  # fmt: skip
    units = "units: {length: m, force: kN, mass: t}\nplausibility: off, test\n"
    chain = load_model(io.StringIO(f"{units}stories: [{frame}, {{{top}}}]"))
    tree = load_model(
        io.StringIO(f"{units}stories: [{frame}]\nattachments: [{{floor: roof, {top}}}]")
    )
    one, other = (
        tdint.run(model, MOTION, method=method, duration=TIME[-1]) for model in (chain, tree)
    )
    for name in ("peak_drift", "peak_shear", "peak_damper_force", "peak_absolute_acceleration"):
        values = np.append(getattr(other.stories, name), getattr(other.devices.stories, name))
        assert values == pytest.approx(getattr(one.stories, name), rel=1e-9)
        errors = np.append(getattr(other.check.errors, name), getattr(other.devices.errors, name))
        assert errors == pytest.approx(getattr(one.check.errors, name), rel=1e-3, abs=1e-12)
    assert other.energy.hysteretic == pytest.approx(one.energy.hysteretic, rel=1e-9)


@pytest.mark.long
def test_methods_agree_on_yielding_links():
    """Two methods of different kind converge to the same response."""
    model = load_model(io.StringIO(BILINEAR))
    runs = [
        tdint.run(model, MOTION, method=method, dt=STEP / 4, duration=0.8, check=False)
        for method in ("impulse4", "moment4")
    ]
    for part in ("stories", "devices"):
        first, second = (getattr(run, part) for run in runs)
        first, second = (getattr(item, "stories", item) for item in (first, second))
        for name in ("peak_drift", "peak_shear", "residual_drift"):
            values, others = getattr(first, name), getattr(second, name)
            assert values == pytest.approx(others, rel=2e-3, abs=1e-3 * np.abs(values).max())
    assert runs[0].energy.hysteretic > 0.0


def test_peak_forces_of_stiff_braces_beside_floors():
    """The brace of a stiff damper follows the motion of the floor below, which is not the mass
    before: impulse4 and moment4 solve the same equations."""
    model = load_model(
        io.StringIO(
            LINEAR.replace("dashpot: 3}", "dashpot: {coefficient: 20, exponent: 0.5, brace: 3e4}}")
            .replace("dashpot: 600}", "dashpot: {coefficient: 200, exponent: 0.4, brace: 2e5}}")
        )
    )  # fmt: skip
    forces = [
        tdint.run(model, MOTION, method=method, check=False).devices.stories.peak_damper_force
        for method in ("impulse4", "moment4")
    ]
    np.testing.assert_allclose(forces[1][[0, 2]], forces[0][[0, 2]], rtol=1e-6)


def test_history_and_signs_of_links():
    """The deformation of a link is the displacement of `to` minus that of `from`."""
    model = load_model(io.StringIO(LINEAR))
    response = tdint.run(
        model, MOTION, duration=0.2, history=True, check=False, method="newmark-average"
    )
    history = response.history
    devices, u = history.devices, history.displacement
    assert devices.attachments == ("tank", "tmd") and devices.links == ("lower", "cable", "tie")
    assert devices.drift[:, 0] == pytest.approx(devices.displacement[:, 0] - u[:, 0])
    assert devices.drift[:, 2] == pytest.approx(u[:, 1])
    assert devices.drift[:, 3] == pytest.approx(u[:, 0] - u[:, 2])
    assert devices.shear[:, 3] == pytest.approx(9e6 * devices.drift[:, 3])
    assert devices.drift[:, 4] == pytest.approx(u[:, 1] - devices.displacement[:, 0])
    peaks = response.devices.stories
    assert np.array_equal(peaks.residual_drift, np.zeros(5))  # linear springs at rest


def test_elements_beside_links():
    """Two equal halves of the spring of each story have its response and its error estimates."""
    half = "{type: bilinear, stiffness: 3.0e4, yield_force: 30, hardening: 5%}"
    whole = "stiffness: 6.0e4, law: {type: bilinear, yield_force: 60, hardening: 5%}"
    halves = BILINEAR.replace(whole, f"elements: [{half}, {half}]")
    initial = "\ninitial: {displacement: [0.001, 0.002, 0.004], velocity: [0.1, 0, 0]}"
    one, other = (
        tdint.run(load_model(io.StringIO(text + initial)), MOTION, duration=0.4)
        for text in (BILINEAR, halves)
    )
    for first, second in (
        (one.stories.peak_drift, other.stories.peak_drift),
        (one.check.errors.peak_drift, other.check.errors.peak_drift),
        (one.devices.stories.peak_shear, other.devices.stories.peak_shear),
        (one.stories.peak_shear, other.elements.peak_force[::2] + other.elements.peak_force[1::2]),
    ):
        assert second == pytest.approx(first, rel=1e-6)
    assert np.all(np.isfinite(other.check.elements.peak_force))


@pytest.mark.parametrize("method", ["rk5", "impulse", "noh-bathe", "houbolt", "chang"])
def test_other_methods_refuse_devices(method):
    model = replace(load_model(io.StringIO(LINEAR)), links=())
    with pytest.raises(
        (AnalysisError, UsageError), match="does not support attachments and links; use one of"
    ):
        tdint.run(model, MOTION, method=method, check=False)


def test_studies_of_chains_refuse_devices():
    model = load_model(io.StringIO(LINEAR))
    with pytest.raises(UsageError, match="pushover does not support springs between floors"):
        tdint.pushover(model, "20mm")
    result = tdint.response_spectrum_analysis(model, "ec8:type=1,soil=C,ag=0.3g")
    assert result.device_deformation_cqc.shape == (len(model.devices),)
