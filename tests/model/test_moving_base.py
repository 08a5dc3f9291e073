"""A base with springs, dashpots and inertia, and devices beside rows of `matrices`: closed forms,
and comparisons with matrices that the tests assemble."""

import math

import numpy as np
import pytest
from scipy.linalg import eigh

import tdint
from tdint.errors import ModelError

MOTION = tdint.make_record(np.sin(np.arange(500) * 0.09) * np.hanning(500), dt=0.02, units="m/s^2")
SHEAR = {"mass": 2.0, "height": 3.0, "repeat": 3, "stiffness": 900.0}
BENDING = {"mass": 2.0, "height": 3.0, "repeat": 3, "flexural": {"EI": 4e4, "GA": 3e3}}
TURNING = BENDING | {"rotary_inertia": 1.5}
SPRINGS = {"rotation": 2.0e4, "translation": 700.0}
DASHPOTS = {"rotation_dashpot": 900.0, "translation_dashpot": 40.0}
INERTIA = {"rotary_inertia": 25.0, "mass": 3.0}
DEVICES = {
    "attachments": [
        {"name": "tmd", "floor": 3, "mass": 0.2, "stiffness": 3.0, "dashpot": 0.2},
        {"name": "tank", "floor": "ground", "mass": 0.5, "stiffness": 30.0},
    ],
    "links": [
        {"from": 1, "to": 3, "dashpot": 6.0, "stiffness": 20.0},
        {"from": "tank", "to": 2, "stiffness": 5.0, "dashpot": 3.0},
        {"from": "ground", "to": 1, "inertance": 0.7},
    ],
}
RAYLEIGH = 0.05, 0.004
"""Coefficients of the mass and of the stiffness."""


NAMES = "mass", "damping", "stiffness", "inertance"


def with_devices(matrices, rows, devices, influence):
    """Return the model of `matrices` with the sums over the springs of the devices; `rows` by their
    names; the ground moves attachments as their rows."""
    attachments = devices.get("attachments", ())
    n, count = len(influence), len(influence) + len(attachments)
    sums = dict(zip(NAMES, np.zeros((4, count, count)), strict=True))
    for name, matrix in zip(NAMES, matrices, strict=False):
        sums[name][:n, :n] = matrix
    rows = rows | {item["name"]: n + i for i, item in enumerate(attachments)}
    springs = [(item["floor"], item["name"], item) for item in attachments]
    for start, end, item in springs + [(x["from"], x["to"], x) for x in devices.get("links", ())]:
        vector = np.zeros(count)
        vector[rows[end]] = 1.0
        if start != "ground":
            vector[rows[start]] = -1.0
        for name, key in (("stiffness", "stiffness"), ("damping", "dashpot"), ("inertance",) * 2):
            sums[name] += item.get(key, 0.0) * np.outer(vector, vector)
    for floor, name, item in springs:
        sums["mass"][rows[name], rows[name]] = item["mass"]
        influence = [*influence, 1.0 if floor == "ground" else influence[rows[floor]]]
    content = {name: matrix.tolist() for name, matrix in sums.items()}
    return {"matrices": content | {"influence": influence}}


def on_base(story, base, devices):
    """Return the matrices of stories on a base: with the deformations w of the stories relative to
    the base, w = u - z theta - u_b, the energy is that of stories on a fixed base."""
    fixed = tdint.matrices({"stories": [story]})
    n, count = 3, len(fixed.stiffness)
    rotation = np.where(np.arange(count) < n, 3.0 * (1.0 + np.arange(count)), 1.0)
    translation = np.where(np.arange(count) < n, 1.0, 0.0)
    relative = np.hstack([np.eye(count), -rotation[:, None], -translation[:, None]])
    stiffness = relative.T @ fixed.stiffness @ relative
    stiffness += np.diag([*np.zeros(count), base["rotation"], base["translation"]])
    inertia = base.get("rotary_inertia", 0.0), base.get("mass", 0.0)
    mass = np.diag([*np.diag(fixed.mass), *inertia])
    damping = RAYLEIGH[0] * mass + RAYLEIGH[1] * stiffness
    dashpots = base.get("rotation_dashpot", 0.0), base.get("translation_dashpot", 0.0)
    damping += np.diag([*np.zeros(count), *dashpots])
    influence = [*translation.tolist(), 0.0, 1.0]
    rows = {1: 0, 2: 1, 3: 2}
    return with_devices((mass, damping, stiffness), rows, devices, influence), count


def assert_equal_runs(found, expected, pairs):
    """Assert that the histories of rows (`pairs` of columns) are equal to 1e-9 of their peaks."""
    for name in ("displacement", "velocity", "absolute_acceleration"):
        other = getattr(expected.history, name)
        values = getattr(found.history, name)
        of_devices = getattr(found.history.devices, name) if found.history.devices else None
        for (part, column), row in pairs:
            value = (values if part == "floors" else of_devices)[:, column]
            assert value == pytest.approx(other[:, row], abs=1e-9 * np.abs(other).max()), name


@pytest.mark.parametrize("devices", [{}, DEVICES], ids=["alone", "devices"])
@pytest.mark.parametrize(
    "base",
    [SPRINGS, SPRINGS | DASHPOTS, SPRINGS | INERTIA, SPRINGS | DASHPOTS | INERTIA],
    ids=["springs", "dashpots", "inertia", "both"],
)
@pytest.mark.parametrize("story", [SHEAR, BENDING, TURNING], ids=["shear", "bending", "turning"])
def test_a_base_equals_assembled_matrices(story, base, devices):
    """Histories, modes and transfer functions; without inertia, the base lags by its dashpots."""
    damping = {"rayleigh": {"mass": RAYLEIGH[0], "stiffness": RAYLEIGH[1]}}
    content = {"stories": [story], "base": base, "damping": damping, "plausibility": "off, test"}
    model = tdint.load_model({**content, **devices})
    assembled, count = on_base(story, base, devices)
    found, expected = (tdint.run(m, MOTION, history=True, check=False) for m in (model, assembled))
    pairs = [(("floors", i), i) for i in range(3)]
    attached = len(devices.get("attachments", ()))
    pairs += [(("devices", i), count + 2 + i) for i in range(attached)]
    assert_equal_runs(found, expected, pairs)
    translation = expected.history.displacement[:, count + 1]
    assert found.flexure.base_displacement == pytest.approx(np.abs(translation).max(), rel=2e-3)
    rotation = np.abs(expected.history.displacement[:, count]).max()
    assert found.flexure.base_rotation == pytest.approx(rotation, rel=2e-3)
    shear = expected.history.displacement[:, 0] - translation
    assert found.stories.peak_drift[0] == pytest.approx(np.abs(shear).max(), rel=2e-3)
    periods = tdint.modes(model).period
    assert periods == pytest.approx(tdint.modes(assembled).period, rel=1e-9)
    assert tdint.modes(model).mass_ratio == pytest.approx(
        tdint.modes(assembled).mass_ratio, abs=1e-9
    )
    system = tdint.matrices(tdint.load_model(assembled))
    frequencies = np.array([0.3, 1.1, 2.5])
    response = tdint.transfer_function(model, frequencies).response
    for frequency, values in zip(frequencies, response, strict=True):
        omega = 2.0 * np.pi * frequency
        matrix = system.stiffness + 1j * omega * system.damping - omega**2 * system.mass
        load = omega**2 * system.loaded_mass @ system.influence
        absolute = np.linalg.solve(matrix, load) + system.influence
        shown = [*range(3), *range(count + 2, count + 2 + attached)]
        assert values == pytest.approx(absolute[shown], rel=1e-9)


def test_a_rigid_block_on_soil():
    """The block of mass m at the height h has with its base two degrees of freedom: frequencies by
    the quadratic equation, and for dashpots proportional to the springs by the factor a the damping
    ratios a omega / 2."""
    m, h, base_mass, inertia, sway, rocking, factor = 5.0, 4.0, 3.0, 30.0, 800.0, 9e4, 0.01
    base = {"rotation": rocking, "translation": sway, "mass": base_mass, "rotary_inertia": inertia}
    base |= {"rotation_dashpot": factor * rocking, "translation_dashpot": factor * sway}
    stories = [{"mass": m, "height": h, "stiffness": 1e12}]
    model = {"stories": stories, "base": base, "plausibility": "off, test"}
    # M = [[m + m_b, m h], [m h, I + m h^2]], K = diag(sway, rocking): a x^2 - b x + c = 0
    a = (m + base_mass) * (inertia + m * h * h) - (m * h) ** 2
    b = sway * (inertia + m * h * h) + rocking * (m + base_mass)
    roots = [(b + sign * math.sqrt(b * b - 4.0 * a * sway * rocking)) / (2 * a) for sign in (-1, 1)]
    omega = np.sqrt(roots)
    modes = tdint.modes(model)
    assert modes.omega[:2] == pytest.approx(omega, rel=1e-6)
    system = tdint.matrices(model)
    assert system.names == ("floor_1", "base_rotation", "base")
    assert modes.own_damping(system.damping)[:2] == pytest.approx(0.5 * factor * omega, rel=1e-5)
    summary = tdint.check(model)
    assert summary.mass == pytest.approx(m + base_mass)
    assert summary.complex_damping == pytest.approx(0.5 * factor * omega[0], rel=1e-5)


@pytest.mark.parametrize(
    ("base", "message"),
    [
        ({"rotation": 1.0, "translation_dashpot": 1.0}, "translation_dashpot: needs `translation`"),
        ({"rotation": 1.0, "mass": 1.0}, "mass: needs `translation`, without which"),
        ({"translation": 1.0, "rotary_inertia": 1.0}, "rotary_inertia: needs `rotation`"),
        ({"translation": 1.0, "mass": -1.0}, "base.mass: must be a positive number"),
    ],
)
def test_a_fixed_base_has_no_inertia(base, message):
    with pytest.raises(ModelError, match=message):
        tdint.load_model({"stories": [SHEAR], "base": base})


def test_yielding_stories_on_a_moving_base_are_refused():
    story = SHEAR | {"law": {"type": "bilinear", "yield_force": 9.0, "hardening": 0.1}}
    with pytest.raises(ModelError, match="the floors above a base that moves are linear"):
        tdint.load_model({"stories": [story], "base": SPRINGS | DASHPOTS | INERTIA})


def test_inertia_of_the_base_in_units_of_the_file():
    units = {"length": "mm", "force": "kN", "mass": "t"}
    story = SHEAR | {"height": 3000.0}
    base = SPRINGS | DASHPOTS | INERTIA
    matrices = tdint.load_model({"units": units, "stories": [story], "base": base}).matrices
    assert matrices.base == pytest.approx((2e4, 7e8))
    assert matrices.base_dashpots == pytest.approx((900.0, 4e7))
    assert matrices.base_inertia == pytest.approx((0.025, 3000.0))


# ---- Devices beside rows of `matrices`

ROWS = {
    "names": ["deck", "side", "tip"],
    "mass": [[3.0, 0.2, 0.0], [0.2, 2.0, 0.0], [0.0, 0.0, 0.0]],
    "stiffness": [[900.0, -200.0, -300.0], [-200.0, 700.0, -100.0], [-300.0, -100.0, 500.0]],
    "damping": [[9.0, 0.0, -2.0], [0.0, 4.0, 0.0], [-2.0, 0.0, 6.0]],
    "influence": [1.0, 0.3, 0.5],
}
ON_ROWS = {
    "attachments": [
        {"name": "tmd", "floor": "deck", "mass": 0.2, "stiffness": 20.0, "dashpot": 0.9},
        {"name": "tank", "floor": "ground", "mass": 0.5, "stiffness": 30.0},
        {"name": "box", "floor": 2, "mass": 0.1, "stiffness": 9.0},
    ],
    "links": [
        {"name": "strut", "from": "deck", "to": "tip", "dashpot": 6.0, "stiffness": 50.0},
        {"from": "tank", "to": "side", "stiffness": 20.0, "dashpot": 3.0},
        {"from": "ground", "to": "deck", "inertance": 0.7},
    ],
}


def test_devices_beside_rows_of_matrices():
    """Also beside a row without mass, an influence vector and coupled masses."""
    model = tdint.load_model({"matrices": ROWS, **ON_ROWS})
    own = tuple(np.array(ROWS[name]) for name in NAMES[:3])
    rows = {"deck": 0, "side": 1, "tip": 2, 2: 1}
    masses = len(ON_ROWS["attachments"])
    assembled = with_devices(own, rows, ON_ROWS, ROWS["influence"])
    found, expected = (tdint.run(m, MOTION, history=True, check=False) for m in (model, assembled))
    pairs = [(("floors", i), i) for i in range(3)]
    assert_equal_runs(found, expected, pairs + [(("devices", i), 3 + i) for i in range(masses)])
    assert tdint.modes(model).period == pytest.approx(tdint.modes(assembled).period, rel=1e-9)
    ratios = tdint.modes(model).mass_ratio
    assert ratios == pytest.approx(tdint.modes(assembled).mass_ratio, abs=1e-9)
    assert tdint.matrices(model).names == ("deck", "side", "tip", "tmd", "tank", "box")
    force = found.history.total_shear[:, 0]
    # The tank on the ground is not above the rows.
    right = expected.history.total_shear[:, 0] + 0.5 * expected.history.absolute_acceleration[:, 4]
    assert force == pytest.approx(right, abs=1e-9 * np.abs(right).max())
    deformation = expected.history.displacement[:, 2] - expected.history.displacement[:, 0]
    drift = found.history.devices.drift[:, masses]
    assert drift == pytest.approx(deformation, abs=1e-9 * np.abs(deformation).max())


@pytest.mark.parametrize(
    ("devices", "message"),
    [
        (
            {"links": [{"from": "deck", "to": "top", "stiffness": 1}]},
            r"to: unknown row or attachment 'top'",
        ),
        (
            {"attachments": [{"name": "tmd", "floor": "deek", "mass": 1, "stiffness": 1}]},
            "floor: unknown row or attachment 'deek'; did you mean 'deck'",
        ),
        (
            {"attachments": [{"name": "deck", "floor": 1, "mass": 1, "stiffness": 1}]},
            "'deck' is already used",
        ),
        (
            {
                "links": [
                    {
                        "from": "deck",
                        "to": "tip",
                        "stiffness": 1,
                        "dashpot": {"coefficient": 1, "exponent": 0.5},
                    }
                ]
            },
            "beside `flexural`, `base`, `stiffness_matrix` and `matrices`",
        ),
    ],
)
def test_invalid_devices_beside_rows(devices, message):
    with pytest.raises(ModelError, match=message):
        tdint.load_model({"matrices": ROWS, **devices})


@pytest.mark.parametrize("story", [SHEAR, BENDING, TURNING], ids=["shear", "bending", "turning"])
def test_a_design_spectrum_on_a_moving_base(tmp_path, story):
    """SRSS over the modes of the assembled matrices, with a constant spectrum of 2 m/s^2."""
    spectrum = tmp_path / "flat.csv"
    spectrum.write_text("period_s,sa_m_s2\n0,2\n1,2\n100,2\n")
    base = SPRINGS | DASHPOTS | INERTIA
    model = {"stories": [story], "base": base, "plausibility": "off, test"}
    result = tdint.response_spectrum_analysis(model, str(spectrum))
    assembled, count = on_base(story, base, {})
    system = tdint.matrices(tdint.load_model(assembled))
    squared, shapes = eigh(system.stiffness, system.mass)
    factors = shapes.T @ system.mass @ system.influence
    displacement = shapes * (2.0 * factors / squared)
    forces = system.stiffness @ displacement
    drift = displacement[:3] - np.vstack([displacement[count + 1], displacement[:2]])
    shear = np.cumsum(forces[2::-1], axis=0)[::-1]
    for found, peaks in (
        (result.displacement_srss, displacement[:3]),
        (result.drift_srss, drift),
        (result.shear_srss, shear),
    ):
        assert found == pytest.approx(np.sqrt(np.sum(peaks**2, axis=1)), rel=1e-9)
    assert result.mass_ratio.sum() == pytest.approx(1.0)
    moments = 3.0 * np.cumsum(shear[::-1], axis=0)[::-1]
    if story is TURNING:
        moments += np.cumsum(forces[5:2:-1], axis=0)[::-1]
    ratios = np.sqrt(squared)[:, None] / np.sqrt(squared)
    zeta = 0.05
    correlation = 8.0 * zeta**2 * (1.0 + ratios) * ratios**1.5
    correlation /= (1.0 - ratios**2) ** 2 + 4.0 * zeta**2 * ratios * (1.0 + ratios) ** 2
    cqc = np.sqrt(np.einsum("ji,ik,jk->j", moments, correlation, moments))
    assert result.moment_cqc == pytest.approx(cqc, rel=1e-9)


@pytest.mark.parametrize("base", [SPRINGS | DASHPOTS, SPRINGS | DASHPOTS | INERTIA])
def test_a_run_on_a_moving_base_is_continued(base):
    """Initial displacements of the floors move the base to its static position; the state at the
    end contains the motion of the base and of the devices."""
    initial = {"displacement": [0.1, 0.2, 0.3]}
    model = {"stories": [SHEAR], "base": base, "initial": initial, "plausibility": "off, test"}
    samples = np.sin(np.arange(201) * 0.09)
    motions = (samples, samples[:101], samples[100:])
    motions = [tdint.make_record(part, dt=0.02, units="m/s^2") for part in motions]
    for devices in ({}, DEVICES):
        settings = {"history": True, "check": False}
        whole = tdint.run({**model, **devices}, motions[0], **settings).history
        first = tdint.run({**model, **devices}, motions[1], check=False)
        second = tdint.run({**model, **devices}, motions[2], initial=first.final_state, **settings)
        expected = whole.displacement[100:201]
        found = second.history.displacement[:101]
        assert found == pytest.approx(expected, abs=1e-12 * np.abs(expected).max())
        assert np.abs(whole.displacement[0]) == pytest.approx([0.1, 0.2, 0.3])


def test_a_force_on_an_attachment_of_a_row():
    own = tuple(np.array(ROWS[name]) for name in NAMES[:3])
    rows = {"deck": 0, "side": 1, "tip": 2, 2: 1}
    assembled = with_devices(own, rows, ON_ROWS, ROWS["influence"])
    model = {"matrices": ROWS, **ON_ROWS}
    histories = []
    for content, place in ((model, "box"), (assembled, 6)):
        force = {"floor": place, "points": [[0, 0], [1, 3], [2, -1], [4, 0]]}
        loaded = {**content, "excitation": {"forces": [force]}}
        histories.append(tdint.run(loaded, dt=0.02, duration=5, history=True, check=False).history)
    found, expected = (item.displacement[:, :3] for item in histories)
    assert found == pytest.approx(expected, abs=1e-9 * np.abs(expected).max())
    assert np.abs(expected).max() > 0.0
