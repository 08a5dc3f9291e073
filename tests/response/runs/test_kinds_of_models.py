"""What a time loop offers holds for each kind of model: steps from outside, forces, states, copies,
histories and continued runs (compiled loops and the loop of matrices)."""

import copy
import pickle

import numpy as np
import pytest

import tdint
from feature_buildings import two_stories
from small_buildings import LAWS
from tdint.errors import ModelError, UsageError
from tdint.response.runs.history import History, values_of

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
    "base": (
        {"stories": [STORY], "base": {"rotation": 1e11, "translation": 1e9}, **DAMPED},
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


def test_a_run_continues_from_the_end_of_a_run(kind):
    """From a pickled state: rows, chunks of the history, energies from zero, and peaks from the
    state on."""
    model, method = MODELS[kind]
    more = {"method": method, "dt": DT, "check": False, "history": True}
    whole = run(kind)
    first = tdint.run(model, RECORD, duration=25 * DT, **more)
    state = pickle.loads(pickle.dumps(first.final_state))
    later = tdint.make_record(GROUND[25:], dt=DT, units="m/s^2")
    second = tdint.run(model, later, initial=state, duration=(STEPS - 25) * DT, **more)
    chunks = History.joined(second.history_chunks(5))
    assert second.history.time[0] == pytest.approx(25 * DT)
    for name in QUANTITIES:
        expected, found = getattr(whole.history, name), getattr(second.history, name)
        tolerance = 1e-9 * np.max(np.abs(expected))
        np.testing.assert_allclose(
            found, expected[25 : STEPS + 1], rtol=0, atol=tolerance, err_msg=name
        )
        np.testing.assert_allclose(getattr(chunks, name), found[::5], rtol=0, atol=tolerance)
    energy = second.history.energy
    assert energy.input[0] == energy.viscous[0] == energy.hysteretic[0] == 0.0
    stored = energy.kinetic[0] + energy.strain[0]
    assert second.energy.initial == pytest.approx(stored, rel=1e-9)
    reference = whole.history.energy.kinetic[25] + whole.history.energy.strain[25]
    assert stored == pytest.approx(reference, rel=1e-6)
    for peak, name in (("peak_drift", "drift"), ("peak_total_shear", "total_shear")):
        largest = np.abs(getattr(second.history, name)).max(axis=0)
        found = getattr(second.stories, peak)
        assert (found >= largest * (1.0 - 1e-9)).all() and (found <= 1.2 * largest).all()


def test_histories_of_many_runs_are_those_of_single_runs(kind):
    model, method = MODELS[kind]
    if "matrices" in model:
        with pytest.raises(UsageError, match="runs is for floors, not for rows of `matrices`"):
            tdint.run_many(model, RECORD, method=method, history=True)
        return
    runs = tdint.run_many(model, RECORD, method=method, dt=DT, history=True, every=3)
    history = run(kind).history
    for name, found in runs.history.items():
        expected = values_of(history, name)[::3]
        np.testing.assert_array_equal(found[0, : len(expected)], expected, err_msg=name)


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
        ((np.ones((2, 2)),), "got array([[1., 1.], [1., 1.]])"),
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


def moved(kind, steps=20):
    """Return a stepper after some steps."""
    stepper = stepper_of(kind)
    for acceleration in GROUND[1 : steps + 1]:
        stepper.step(acceleration)
    return stepper


@pytest.mark.parametrize("with_forces", [False, True])
def test_a_stepper_returns_to_a_state(kind, with_forces):
    """Bit for bit, also with forces in the steps before, and to the end of a run."""
    if with_forces and kind in WITHOUT_TABLES:
        pytest.skip("refused, as in a run")
    forces = FORCES if with_forces else [None] * STEPS
    stepper, other = stepper_of(kind), stepper_of(kind)
    for number in range(30):
        stepper.step(GROUND[number + 1], forces[number])
    state, ends = stepper.state, []
    for each in (stepper, other, stepper):
        if ends:
            each.reset(state)
        for number in range(30, 50):
            each.step(GROUND[number + 1], forces[number])
        assert each.time == pytest.approx(50 * DT)
        ends.append(each.state.displacement)
    np.testing.assert_array_equal(ends[1], ends[0])
    np.testing.assert_array_equal(ends[2], ends[0])
    stepper.reset(run(kind).final_state)
    check_rows(stepper.state.history, run(kind).history, -1)
    stepper.reset()
    assert stepper.time == 0.0


def test_replaced_motion_is_that_of_a_run_from_it(kind):
    """Free vibration of the linear building from displacements and velocities that are set in the
    state after some steps, and from those of the model, at first and after a step."""
    model, method = MODELS[kind]
    if "law" in model.get("stories", [{}])[0]:
        model = model | {"stories": [model["stories"][0] | {"law": {"type": "linear"}}]}
    u, v = [2e-3, -1e-3, 3e-3], [0.01, 0.02, -0.03]
    extra = {}
    if kind == "tree":
        u, v = [*u, 1e-2], [*v, 0.1]
        extra = {"attachments": {"tmd": {"displacement": 1e-2, "velocity": 0.1}}}
    initial = {"displacement": u[:3], "velocity": v[:3], **extra}
    expected = tdint.Stepper(model | {"initial": initial}, method, DT)
    first, later = (tdint.Stepper(model, method, DT) for _ in range(2))
    first.reset(first.state.replace(u, v))
    later.step(1.0)
    later.step(0.0)
    later.reset(later.state.replace(displacement=u, velocity=v))
    check_rows(first.state.history, expected.state.history, 0, 1e-12)
    check_rows(later.state.history, expected.state.history, 0, 1e-12)
    energy = later.state.history.energy
    reference = first.state.history.energy
    assert energy.strain[0] == pytest.approx(reference.strain[0], rel=1e-9)
    assert energy.kinetic[0] == pytest.approx(reference.kinetic[0], rel=1e-9)
    for _ in range(20):
        for each in (expected, first, later):
            each.step(0.0)
    check_rows(first.state.history, expected.state.history, 0, 1e-12)
    check_rows(later.state.history, expected.state.history, 0, 1e-9)


def test_a_run_from_a_replaced_state_balances_its_energies(kind):
    state = moved(kind).state
    state = state.replace(state.displacement + 1e-3, 0.5 * state.velocity)
    model, method = MODELS[kind]
    response = tdint.run(model, duration=0.5, method=method, initial=state, check=False)
    assert abs(response.energy.error) < (3e-2 if method == "newmark-average" else 2e-3)
    assert response.energy.initial > 0.0


@pytest.mark.parametrize("law", LAWS)
def test_variables_of_laws_are_those_of_a_state(law):
    """A state with the motion and the variables of another state is the other state. With another
    displacement only, each law moves on a straight line: the force of `law_path`."""
    model = two_stories(law, law) | {"plausibility": "off, test"}
    path, other = (tdint.Stepper(model, "newmark-average", DT) for _ in range(2))
    drifts = [0.0]
    for number in range(40):
        acceleration = 2.0 * GROUND[number + 1] if number < 39 else 0.0
        path.step(acceleration)
        drifts.append(path.state.displacement[0])
        other.step(-acceleration if number < 30 else 0.0)
    goal = path.state
    there = goal.displacement * np.array([-0.5, 1.0])
    found = goal.replace(displacement=there).history.shear[0, 0]
    expected = tdint.law_path(model, 1, [*drifts, there[0]]).path.shear
    assert found == pytest.approx(expected[-1], abs=1e-6 * np.max(np.abs(expected)))
    replaced = other.state.replace(goal.displacement, goal.velocity, goal.laws)
    np.testing.assert_allclose(replaced.history.shear, goal.history.shear, rtol=1e-12)
    other.reset(replaced)
    for acceleration in GROUND[1:11]:
        for each in (path, other):
            each.step(acceleration)
    scale = np.max(np.abs(path.state.displacement))
    np.testing.assert_allclose(
        other.state.displacement, path.state.displacement, rtol=0, atol=1e-9 * scale
    )


def test_internal_variable_of_a_bilinear_law():
    """A particle with another force z of the plastic spring: f = a k d + z, |z| <= (1 - a) Fy."""
    state = moved("chain").state
    drift = np.array([1e-3, -2e-3, 1e-3])
    laws = state.laws.copy()
    laws[0, :3], laws[2, :3] = drift, [1e5, -2e5, 2.8e5]
    particle = state.replace(np.cumsum(drift), laws=laws)
    expected = 0.05 * 8e7 * drift + laws[2, :3]
    np.testing.assert_allclose(particle.history.shear[0], expected, rtol=1e-12)
    np.testing.assert_allclose(particle.laws[1, :3], particle.history.shear[0], rtol=1e-15)
    with pytest.raises(ValueError, match="read-only"):
        state.laws[2] = 0.0
    branches = tdint.Stepper(two_stories("kinematic", "kinematic"), dt=DT)
    branches.step(0.1)
    without_force = branches.state.laws.copy()
    without_force[1, 0] = np.nan
    with pytest.raises(UsageError, match="column 1 contradict its law"):
        branches.state.replace(laws=without_force)
    laws[2, 1] = -3e5
    with pytest.raises(UsageError, match=r"column 2 contradict its law.*-300000 to -285000"):
        state.replace(laws=laws)


@pytest.mark.parametrize(
    ("kind", "arguments", "message"),
    [
        ("chain", {"displacement": [1.0]}, "displacement must contain 3 finite numbers"),
        ("tree", {"velocity": [1.0]}, "for each floor, or 4, also for each attachment"),
        ("chain", {"velocity": [1.0, np.nan, 2.0]}, "velocity must contain 3 finite numbers"),
        ("chain", {"displacement": [1j, 0, 0]}, "displacement must contain 3 finite numbers"),
        ("chain", {"laws": [1.0]}, r"laws must contain numbers in the shape \(76, 4\)"),
        ("chain", {"laws": np.full((76, 4), np.nan)}, "column 1 contradict its law"),
        ("matrices", {"laws": [1.0]}, "laws must contain numbers .* model without matrices"),
    ],
)
def test_values_that_a_state_cannot_have_are_refused(kind, arguments, message):
    with pytest.raises(UsageError, match=message) as caught:
        moved(kind).state.replace(**arguments)
    assert "\n" not in str(caught.value)


def test_two_directions_are_refused():
    model = {"stories": [STORY | {"x": {"stiffness": 8e7}, "y": {"stiffness": 6e7}}]}
    del model["stories"][0]["stiffness"]
    with pytest.raises(UsageError, match="Stepper: the model has two directions; use a model for"):
        tdint.Stepper(model, dt=DT)
    state = moved("chain").state
    with pytest.raises(UsageError, match="two directions cannot continue another run"):
        tdint.run(model, tdint.Horizontals(RECORD, RECORD), initial=state)


def test_states_of_other_steppers_are_refused():
    stepper = stepper_of("chain")
    with pytest.raises(UsageError, match="after the first step of a model"):
        stepper.state.replace(laws=stepper.state.laws)
    other = tdint.Stepper(MODELS["chain"][0], "impulse4", DT / 2)
    other.step(1.0)
    with pytest.raises(UsageError, match=r"reset: the state has dt 0\.005 s, the stepper 0\.01"):
        stepper.reset(other.state)
    with pytest.raises(UsageError, match="state of another building"):
        stepper.reset(moved("tree").state)
