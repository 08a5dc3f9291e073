"""What a time loop offers holds for each kind of model: steps from outside, forces, states, copies,
histories and continued runs (compiled loops and the loop of matrices)."""

import copy
import pickle

import numpy as np
import pytest

import tdint
from tdint.errors import ModelError, UsageError

DT, STEPS = 0.01, 60
LAW = {"type": "bilinear", "yield_force": 3e5, "hardening": 0.05}
STORY = {"repeat": 3, "mass": 1e5, "height": 3.0, "stiffness": 8e7}
DAMPED = {"damping": {"rayleigh": {"ratio": 0.03, "modes": [1, 2]}}}
MATRIX = [[1.6e8, -8e7, 0], [-8e7, 1.6e8, -8e7], [0, -8e7, 8e7]]
MODELS = {
    "chain": ({"stories": [STORY | {"law": LAW}], **DAMPED}, "impulse4"),
    "tree": (
        {
            "stories": [STORY | {"law": LAW}],
            "attachments": [
                {"name": "tmd", "floor": 3, "mass": 6e3, "stiffness": 4e5, "dashpot": 6e3}
            ],
            "links": [{"name": "damper", "from": "ground", "to": 2, "dashpot": 2e6}],
            **DAMPED,
        },
        "newmark-average",
    ),
    "inerters": ({"stories": [STORY | {"inertance": 2e4}], **DAMPED}, "exact"),
    "inerters by steps": ({"stories": [STORY | {"inertance": 2e4}], **DAMPED}, "newmark-average"),
    "yielding with inerters": (
        {"stories": [STORY | {"law": LAW, "inertance": 2e4}], **DAMPED},
        "newmark-average",
    ),
    "flexural": (
        {
            "stories": [
                {"repeat": 3, "mass": 1e5, "height": 3.0, "flexural": {"EI": 5e9, "GA": 4e8}}
            ],
            "damping": {"modal": 0.03},
        },
        "exact",
    ),
    "stiffness matrix": (
        {
            "stories": [{"repeat": 3, "mass": 1e5, "height": 3.0}],
            "stiffness_matrix": MATRIX,
            **DAMPED,
        },
        "exact",
    ),
    "stiff stiffness matrix": (
        {
            "stories": [{"repeat": 3, "mass": 1e5, "height": 3.0}],
            "stiffness_matrix": (100.0 * np.array(MATRIX)).tolist(),
            **DAMPED,
        },
        "exact",
    ),
    "matrices": (
        {
            "matrices": {"mass": [1e5] * 3, "stiffness": MATRIX, "influence": [1.0, 1.0, 0.5]},
            "damping": {"modal": 0.03},
        },
        "exact",
    ),
}
"""Model and method by the kind of model."""

WITHOUT_TABLES = ("yielding with inerters",)
"""Kinds that are refused with forces from tables."""

RANDOM = np.random.default_rng(4)
GROUND = np.concatenate([[0.0], 3.0 * RANDOM.normal(size=STEPS)])
FORCES = 2e5 * RANDOM.normal(size=(STEPS, 3))
RECORD = tdint.make_record(GROUND, dt=DT, units="m/s^2")
QUANTITIES = (
    "displacement", "velocity", "absolute_acceleration", "drift", "shear", "total_shear",
)  # fmt: skip


@pytest.fixture(params=MODELS)
def kind(request):
    return request.param


def stepper_of(kind):
    model, method = MODELS[kind]
    return tdint.Stepper(model, method, DT)


def run(kind, **options):
    model, method = MODELS[kind]
    return tdint.run(model, RECORD, method=method, dt=DT, check=False, history=True, **options)


def check_rows(found, expected, row, tolerance=1e-9):
    """Compare the only row of a history with a row of another."""
    for name in QUANTITIES:
        values = getattr(expected, name)
        size = np.max(np.abs(values))
        np.testing.assert_allclose(
            getattr(found, name)[0], values[row], rtol=0, atol=tolerance * size, err_msg=name
        )


def test_steps_equal_a_run(kind):
    """The state after each step is that of the run, with all quantities and energies."""
    stepper, response = stepper_of(kind), run(kind)
    check_rows(stepper.state.history, response.history, 0)
    for number, acceleration in enumerate(GROUND[1:], start=1):
        stepper.step(acceleration)
        if number % 20 == 0:
            check_rows(stepper.state.history, response.history, number)
    check_rows(response.final_state.history, response.history, -1)
    energy = stepper.state.history.energy
    for name in ("input", "viscous", "kinetic", "strain"):
        expected = getattr(response.history.energy, name)[STEPS]
        tolerance = 1e-9 * response.energy.input
        assert getattr(energy, name)[0] == pytest.approx(expected, rel=1e-8, abs=tolerance)


@pytest.mark.parametrize("first", [0, 17])
def test_forces_of_steps_equal_those_of_a_table(kind, first, tmp_path):
    """Forces on floors that start with a later step have a table of the same points."""
    if kind in WITHOUT_TABLES:
        pytest.skip("refused, as in a run")
    model, method = MODELS[kind]
    forces = np.where(np.arange(STEPS)[:, None] >= first, FORCES, 0.0)
    rows = np.column_stack([DT * np.arange(STEPS + 1), np.vstack([np.zeros(3), forces])])
    header = "time (s)," + ",".join(f"f{i} (N)" for i in (1, 2, 3))
    text = "\n".join(",".join(f"{value:.17g}" for value in row) for row in rows)
    (tmp_path / "f.csv").write_text(f"{header}\n{text}\n")
    file = {"file": str(tmp_path / "f.csv")}
    tables = [file | {"floor": floor, "column": f"f{floor} (N)"} for floor in (1, 2, 3)]
    loaded = model | {"excitation": {"forces": tables}}
    response = tdint.run(loaded, RECORD, method=method, dt=DT, check=False, history=True)
    stepper = tdint.Stepper(model, method, DT)
    for number in range(STEPS):
        stepper.step(GROUND[number + 1], forces[number] if number >= first else None)
    check_rows(stepper.state.history, response.history, STEPS, 1e-8)


@pytest.mark.parametrize("clone", [copy.copy, copy.deepcopy, tdint.Stepper.copy, "pickle"])
def test_copies_are_independent(kind, clone):
    stepper, reference = stepper_of(kind), stepper_of(kind)
    with_forces = [] if kind in WITHOUT_TABLES else [FORCES[0]]
    for each in (stepper, reference):
        each.step(1.0)
        each.step(-2.0, *with_forces)
    other = pickle.loads(pickle.dumps(stepper)) if clone == "pickle" else clone(stepper)
    before = stepper.state.displacement.copy()
    for _ in range(5):
        other.step(3.0, *with_forces)
    np.testing.assert_array_equal(stepper.state.displacement, before)
    for each in (stepper, reference):
        each.step(0.5)
    np.testing.assert_array_equal(stepper.state.displacement, reference.state.displacement)
    assert not np.allclose(other.state.displacement, before)


def test_a_run_continues_from_the_state_of_a_stepper(kind):
    """Uninterrupted run, and a run from the state after 25 steps."""
    stepper, response = stepper_of(kind), run(kind)
    for acceleration in GROUND[1:26]:
        stepper.step(acceleration)
    model, method = MODELS[kind]
    later = tdint.make_record(GROUND[25:], dt=DT, units="m/s^2")
    continued = tdint.run(
        model, later, method=method, dt=DT, initial=stepper.state, check=False, history=True
    )
    for row in (0, 10, -1):
        index = row if row < 0 else 25 + row
        for name in QUANTITIES:
            expected = getattr(response.history, name)
            np.testing.assert_allclose(
                getattr(continued.history, name)[row], expected[index], rtol=0,
                atol=1e-9 * np.max(np.abs(expected)), err_msg=name,
            )  # fmt: skip


def test_values_of_a_state_are_read_only(kind):
    state = run(kind).final_state
    for values in (state.displacement, state.velocity):
        with pytest.raises(ValueError, match="read-only"):
            values[0] = 1.0


@pytest.mark.parametrize("initial", [0, False, "", [], {}, 1.0])
def test_an_initial_state_that_is_none_is_refused(initial):
    with pytest.raises(UsageError, match="initial must be RunState or None"):
        tdint.run(MODELS["chain"][0], RECORD, initial=initial)


@pytest.mark.parametrize(
    ("change", "kind"),
    [
        (
            {"matrices": {"mass": [1e5] * 3, "stiffness": MATRIX, "influence": [1, 1, 1]}},
            "matrices",
        ),
        ({"stories": [STORY | {"inertance": 1e4}]}, "inerters"),
        ({"excitation": {"forces": [{"floor": 1, "amplitude": 5, "omega": 6}]}}, "chain"),
    ],
)
def test_a_state_of_another_building_is_refused(change, kind):
    model, method = MODELS[kind]
    state = run(kind).final_state
    with pytest.raises(UsageError, match="state of another building"):
        tdint.run(model | change, RECORD, method=method, initial=state)


def test_tables_of_forces_with_other_values_are_another_building(tmp_path):
    for name, value in (("a", 1e4), ("b", 2e4)):
        (tmp_path / f"{name}.csv").write_text(f"time (s),f (N)\n0,0\n0.5,{value}\n1,0\n")
    model, method = MODELS["chain"]
    models = [
        model | {"excitation": {"forces": [{"file": str(tmp_path / f"{name}.csv"), "floor": 1}]}}
        for name in "ab"
    ]
    state = tdint.run(models[0], RECORD, method=method, dt=DT, check=False).final_state
    tdint.run(models[0], RECORD, method=method, dt=DT, initial=state, check=False)
    with pytest.raises(UsageError, match="forces must be those of the run"):
        tdint.run(models[1], RECORD, method=method, dt=DT, initial=state, check=False)


@pytest.mark.parametrize("inertance", [{}, {"inertance": 5e4}])
def test_state_space_with_inerters_equals_exact(inertance):
    """Inerters to the ground: the first story, and a link."""
    from scipy.signal import lsim

    model = {
        "stories": [STORY | inertance],
        "links": [{"name": "inerter", "from": "ground", "to": 2, "inertance": 3e4}],
        "damping": {"modal": 0.03},
    }
    matrices = tdint.matrices(model)
    system = matrices.state_space()
    time = DT * np.arange(STEPS + 1)
    loads = np.zeros((STEPS + 1, 4))
    loads[:, 0] = GROUND
    _, output, _ = lsim(tuple(system), loads, time)
    history = tdint.run(model, RECORD, method="exact", check=False, history=True).history
    for i, name in enumerate(("displacement", "velocity", "absolute_acceleration")):
        expected = getattr(history, name)[: STEPS + 1]
        atol = 1e-7 * np.max(np.abs(expected))
        np.testing.assert_allclose(output[:, 3 * i : 3 * i + 3], expected, rtol=0, atol=atol)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ((None,), "ground_acceleration must be a finite number, got None"),
        (({},), "got {}"),
        (("1",), "got '1'"),
        ((1j,), "got 1j"),
        ((10**400,), "got 1000"),
        ((np.nan,), "got nan"),
        (([1.0, 2.0],), "got"),
        ((0.1, "abc"), "floor_forces must contain 3 finite numbers, one for each floor, got 'abc'"),
        ((0.1, {"x": 2}), "got {'x': 2}"),
        ((0.1, [1.0, 2.0]), "got"),
        ((0.1, [1j, 0, 0]), "got"),
    ],
)
def test_wrong_arguments_of_a_step_are_one_line(arguments, message):
    stepper = stepper_of("chain")
    with pytest.raises(UsageError, match=r"^step: .*") as caught:
        stepper.step(*arguments)
    assert message in str(caught.value) and "\n" not in str(caught.value)
    stepper.step(np.array([0.1]), (1, 2, 3))  # accepted


@pytest.mark.parametrize("kind", [name for name in MODELS if name not in WITHOUT_TABLES])
@pytest.mark.parametrize("key", ["floor", "floors"])
def test_tables_of_forces_on_attachments_equal_forces_of_steps(kind, key, tmp_path):
    """A table of a model, and the same forces as arguments of steps, beside those of a floor."""
    model, method = MODELS[kind]
    if "matrices" in model:
        pytest.skip("rows instead of attachments")
    tmd = {"name": "tmd", "floor": 2, "mass": 6e3, "stiffness": 4e5, "dashpot": 6e3}
    model = model | {"attachments": [tmd]}
    rows = np.column_stack([DT * np.arange(STEPS + 1), np.append(0.0, FORCES[:, 0])])
    if key == "floor":
        table = {"floor": "tmd", "points": rows.tolist()}
    else:
        lines = "\n".join(f"{time:.17g},{value:.17g}" for time, value in rows)
        (tmp_path / "f.csv").write_text(f"time (s),f (N)\n{lines}\n")
        table = {"file": str(tmp_path / "f.csv"), "floors": {"tmd": "f (N)"}}
    loaded = model | {"excitation": {"forces": [table, {"floor": 1, "points": rows.tolist()}]}}
    response = tdint.run(loaded, RECORD, method=method, dt=DT, check=False, history=True)
    stepper = tdint.Stepper(model, method, DT)
    for number in range(STEPS):
        force = FORCES[number, 0]
        stepper.step(GROUND[number + 1], [force, 0.0, 0.0, force])
    check_rows(stepper.state.history, response.history, STEPS, 1e-8)
    found, expected = stepper.state.history.devices.drift[0, 0], response.history.devices.drift
    np.testing.assert_allclose(found, expected[STEPS, 0], rtol=0, atol=1e-8 * np.max(expected))
    still = tdint.run(model, RECORD, method=method, dt=DT, check=False, history=True).history
    assert np.abs(still.devices.drift[STEPS] - expected[STEPS]).max() > 0.1 * np.max(expected)
    loaded["excitation"]["forces"][0] = {"floor": "tdm", "points": rows.tolist()}
    with pytest.raises(ModelError, match="unknown row or attachment 'tdm'; did you mean 'tmd'"):
        tdint.load_model(loaded)


def test_harmonic_force_on_an_attachment_alone():
    """The steady amplitude of a mass on a fixed floor: F / |k - m omega^2 + i c omega|."""
    tmd = {"name": "tmd", "floor": "ground", "mass": 6e3, "stiffness": 4e5, "dashpot": 3e4}
    force = {"floor": "tmd", "amplitude": 2e3, "omega": 10.0}
    model = {"stories": [STORY], "attachments": [tmd], "excitation": {"forces": [force]}}
    history = tdint.run(model, dt=0.005, duration=10.0, check=False, history=True).history
    amplitude = 2e3 / abs(4e5 - 6e3 * 100.0 + 1j * 3e4 * 10.0)
    found = np.max(np.abs(history.devices.drift[-200:, 0]))
    assert found == pytest.approx(amplitude, rel=1e-4)
    assert not np.any(history.displacement)
    points = {"floor": "tmd", "points": [[0.0, 1.0], [1.0, 2e3]]}
    notes = tdint.run(model | {"excitation": {"forces": [points]}}, duration=2.0).notes
    assert any("points on floor tmd: the last force on floor tmd, at 1 s" in note for note in notes)


def test_forces_on_attachments():
    """Equal forces on an attachment and, with the opposite sign, on its floor: an actuator between
    them. The reference is a model of matrices."""
    model, _ = MODELS["tree"]
    linear = model | {"stories": [STORY]}
    matrices = tdint.matrices(linear)
    stepper = tdint.Stepper(linear, "impulse4", DT / 4)
    rows = {
        "matrices": {
            "mass": matrices.mass.tolist(),
            "stiffness": matrices.stiffness.tolist(),
            "damping": matrices.damping.tolist(),
            "influence": [1.0] * 4,
        }
    }
    reference = tdint.Stepper(rows, "exact", DT / 4)
    for number in range(200):
        force = 3e4 * np.sin(0.2 * number)
        forces = [0.0, 0.0, -force, force]
        for each in (stepper, reference):
            each.step(0.0, forces)
    found, expected = stepper.state, reference.state
    np.testing.assert_allclose(found.displacement, expected.displacement[:3], rtol=2e-5)
