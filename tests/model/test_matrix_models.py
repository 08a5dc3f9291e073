"""Errors of models of matrices and flexural stories, one line each."""

import io
import re
import time
import tracemalloc

import numpy as np
import pytest

import tdint
from tdint.errors import AnalysisError, ModelError, UsageError

TWO = [{"mass": 1, "height": 3}, {"mass": 1, "height": 3}]
GOOD = [[3.0, -1.0], [-1.0, 1.0]]
STIFF = {"flexural": {"EI": 1e9}}


def frame(matrix=GOOD, stories=TWO, **more):
    return {"stories": stories, "stiffness_matrix": matrix, **more}


def rows(mass=(1.0, 1.0), stiffness=GOOD, **more):
    return {"matrices": {"mass": list(mass), "stiffness": stiffness, **more}}


YIELDING = {"type": "bilinear", "yield_force": 1, "hardening": 0}


def on_base(**story):
    stories = [{"mass": 2.0, "height": 3.0, "stiffness": 400.0, "repeat": 2, **story}]
    return {"stories": stories, "base": {"rotation": 900.0, "translation": 700.0}}


def test_shear_stories_on_a_base_that_rotates_and_moves():
    """Flexibilities add: the springs of the stories, h h' / rotation stiffness, and 1 / translation
    stiffness. Flexural stories that hardly bend approach the result."""
    levels = np.array([3.0, 6.0])
    flexibility = np.minimum.outer([1.0, 2.0], [1.0, 2.0]) / 400.0
    flexibility += np.outer(levels, levels) / 900.0 + 1.0 / 700.0
    stiffness = tdint.matrices(tdint.load_model(on_base())).stiffness
    assert stiffness == pytest.approx(np.linalg.inv(flexibility), rel=1e-12)
    bending = on_base(stiffness=None, flexural={"EI": 1e9, "GA": 1200.0})
    del bending["stories"][0]["stiffness"]
    assert stiffness == pytest.approx(tdint.matrices(tdint.load_model(bending)).stiffness, rel=1e-5)
    fixed = on_base()["stories"]
    alone = tdint.matrices(tdint.load_model({"stories": fixed})).stiffness
    rigid = {"stories": fixed, "base": {"rotation": 1e15}}
    assert tdint.matrices(tdint.load_model(rigid)).stiffness == pytest.approx(alone, rel=1e-9)


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (frame([[3.0, -1.0], [-0.9, 1.0]]), r"must be symmetric; \[1, 2\] is -1, \[2, 1\] is -0.9"),
        (frame([[3.0, -1.0], [-1.0, -1.0]]), r"row 2, column 2 \(2\) is -1"),
        (frame([[1.0, -2.0], [-2.0, 1.0]]), r"must be positive definite; row 2, column 2"),
        (frame([[1.0]]), r"must have 2 rows of 2 numbers, got 1 row"),
        (frame([[1.0, 0.0], [0.0]]), r"must have 2 rows of 2 numbers, got 1 number in row 2"),
        (frame(stories=[{**TWO[0], "stiffness": 5}, TWO[1]]), r"stories\[1\].stiffness: .*replace"),
        (frame(stories=[{**TWO[0], "law": "linear"}, TWO[1]]), r"stories\[1\].law: .*linear"),
        (frame(stories=[{**TWO[0], "elements": []}, TWO[1]]), r"stories\[1\].elements"),
        (frame(stories=[{**TWO[0], "dashpot": 5}, TWO[1]]), r"stories\[1\].dashpot"),
        (frame(p_delta=True), r"P-delta of stories needs their springs"),
        (frame(base={"rotation": 1}), r"base: cannot be used with `stiffness_matrix`"),
        (on_base(law=YIELDING), r"base: story 1 has a law or elements; the floors above"),
        (on_base(dashpot=5), r"base: story 1 has a dashpot"),
        (on_base(isolator=True), r"base: story 1 has `isolator`"),
        (on_base(p_delta=True), r"base: story 1 has P-delta"),
        ({"stories": [{"mass": 1, "stiffness": 4}], "base": {"rotation": 1}}, r"has no height"),
        (
            frame(damping={"rayleigh": {"mass": 0, "stiffness": 0.1, "tangent": True}}),
            r"a linear model has no tangent",
        ),
        (rows(mass=(1.0, -2.0)), r"matrices.mass: .*row 2, column 2 \(row_2\) is -2"),
        (rows(mass=(0.0, 0.0)), r"at least one row needs a mass"),
        (rows(stiffness=[]), r"matrices.stiffness: must contain at least one row$"),
        (rows(names=["u"]), r"must have 2 names"),
        (rows(names=["u", "u"]), r"must be different names"),
        (rows(influence=[1]), r"influence must have 2 numbers"),
        (rows(influence=[0, 0]), r"influence must not be zero"),
        ({**rows(damping=[1, 1]), "damping": {"modal": 0.05}}, r"give one of the two"),
        ({**rows(), "stories": TWO}, r"stories: cannot be used with `matrices`"),
        (
            {"stories": [{**TWO[0], **STIFF}, {**TWO[1], "stiffness": 4}]},
            r"story 2 needs `flexural`",
        ),
        ({"stories": [{"mass": 1, **STIFF}]}, r"height: is missing"),
        (
            {"stories": [{**TWO[0], "stiffness": 5, "rotary_inertia": 3}]},
            r"stories\[1\].rotary_inertia: the floor rotates above a `flexural` story only",
        ),
        (frame(stories=[{**TWO[0], "rotary_inertia": 3}, TWO[1]]), r"only; omit it$"),
        ({"stories": [{**TWO[0], **STIFF, "rotary_inertia": -1}]}, r"must be a positive number"),
        (
            {
                "units": {"length": "mm", "force": "kN"},
                "stories": [{"weight": 1, "height": 3, **STIFF, "rotary_inertia": 3}],
            },
            r"rotary_inertia: the unit of mass is required",
        ),
    ],
)
def test_errors(content, message):
    with pytest.raises(ModelError, match=message) as raised:
        tdint.load_model(content)
    assert "Traceback" not in str(raised.value)


def test_matrix_in_a_file(tmp_path):
    (tmp_path / "K.csv").write_text("3,-1\n-1,1\n")
    model = tmp_path / "model.yaml"
    model.write_text(
        "{stories: [{mass: 1, height: 3}, {mass: 1, height: 3}], stiffness_matrix: K.csv}"
    )
    assert tdint.load_model(model).matrices.stiffness.tolist() == [[3.0, -1.0], [-1.0, 1.0]]
    (tmp_path / "K.csv").write_text("3,-1\n-1,x\n")
    with pytest.raises(ModelError, match=r"K.csv:2: column 2 is not a number; give a list of"):
        tdint.load_model(model)
    (tmp_path / "K.csv").write_text("")
    model.write_text("matrices: {mass: [1], stiffness: K.csv}")
    with pytest.raises(ModelError, match=r"matrices.stiffness: must contain at least one row"):
        tdint.load_model(model)


SECRETS = ("root:hidden:20228\n", "1,2\n3,hidden\n", "hidden,20228\n1,2\n", "nan,1\n1,inf\n")


@pytest.mark.parametrize("key", ["stiffness_matrix", "stiffness", "mass", "damping"])
@pytest.mark.parametrize("text", SECRETS)
def test_no_text_of_a_file_is_in_a_message(tmp_path, key, text):
    """The file is named with the line and the column that has no number."""
    (tmp_path / "other.txt").write_text(text)
    content = {"matrices": {"mass": [1, 1], "stiffness": GOOD, key: str(tmp_path / "other.txt")}}
    if key == "stiffness_matrix":
        content = frame(str(tmp_path / "other.txt"))
    with pytest.raises(
        ModelError, match=r"other.txt:\d: column \d is not a number; give a"
    ) as error:
        tdint.load_model(content)
    assert not any(word in str(error.value) for word in ("hidden", "20228", "nan", "inf"))


@pytest.mark.parametrize("key", ["mass", "damping", "stiffness"])
@pytest.mark.parametrize("kind", ["list", "array", "rows", "file", "wide file"])
def test_the_size_is_checked_before_a_table_is_expanded(tmp_path, key, kind):
    """A table of 20 000 numbers or rows needs memory in proportion to it: less than 100 MB."""
    numbers = [1.0] * 20_000
    table = {
        "list": numbers,
        "array": np.ones(20_000),
        "rows": [[1.0]] * 20_000,
        "file": str(tmp_path / "t.csv"),
        "wide file": str(tmp_path / "wide.csv"),
    }[kind]
    (tmp_path / "t.csv").write_text("1\n" * 20_000)
    (tmp_path / "wide.csv").write_text(",".join(["1"] * 20_000) + "\n")
    tracemalloc.start()
    with pytest.raises(ModelError) as error:
        tdint.load_model({"matrices": {"mass": [1, 1], "stiffness": GOOD, key: table}})
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < 100e6
    assert re.search(rf"matrices.{key}: must have (?:at most 2000 rows|2 )", str(error.value))


def test_aliases_cannot_multiply_a_matrix(tmp_path):
    """60 kB of text could define a matrix of 400 million numbers."""
    file = tmp_path / "m.yaml"
    row = "&a [" + ", ".join(["1"] * 3000) + "]"
    rows = ", ".join([row, *["*a"] * 2999])
    file.write_text(f"matrices: {{mass: [1], stiffness: [{rows}]}}")
    with pytest.raises(ModelError, match=r"repeat more than|at most 2000 rows"):
        tdint.load_model(file)


def points_of(kind, floors=10, count=4000):
    time = np.linspace(0.0, 40.0, count)
    tables = [np.column_stack([time, 1e3 * np.sin(k * time)]) for k in range(1, floors + 1)]
    return tables if kind == "array" else [table.tolist() for table in tables]


@pytest.mark.parametrize("kind", ["array", "list"])
def test_tables_of_forces_are_read_as_arrays(kind):
    """Ten tables of 4000 points took 0.8 s, because each number was validated alone."""
    tables = points_of(kind)
    forces = [{"floor": k, "points": table} for k, table in enumerate(tables, start=1)]
    content = {"stories": [{"repeat": 10, "mass": 1e5, "stiffness": 1e8}]}
    start = time.process_time()
    for _ in range(3):
        model = tdint.load_model({**content, "excitation": {"forces": forces}})
    assert time.process_time() - start < 0.3
    for read, table in zip(model.excitation.tables, tables, strict=True):
        assert np.array_equal(read.table.data, table)


@pytest.mark.parametrize(
    ("points", "message"),
    [
        ([[0, 1], [1, float("nan")]], r"points\[2\]\[2\]: must be a number, got 'nan'"),
        ([[0, 1], [1, float("inf")]], r"points\[2\]\[2\]: must be a number, got 'inf'"),
        ([[0, 1], [1, 1e300]], r"points\[2\]\[2\]: must have an absolute value"),
        ([[0, 1], [1, True]], r"points\[2\]\[2\]: must be a number, got 'true'"),
        ([[0, 1], [1, 10**400]], r"points\[2\]\[2\]: "),
        ([[0, 1, 2], [1, 2, 3]], r"points\[1\]: must be a point \[time in s, force\], got 3"),
        ([[0, 1]], r"points: must be a list of at least two points .*got 1"),
        ([[0, 1], [1, 5], [0.5, 5]], r"points\[3\]: times must not decrease"),
        (np.zeros((0, 2)), r"points: must be a list of at least two points .*got 0"),
        (np.array([[0, 1], [1, np.nan]]), r"points\[2\]\[2\]: must be a number, got 'nan'"),
        (np.array([[False, True], [True, True]]), r"points\[1\]\[1\]: must be a number"),
    ],
)
def test_points_from_python_are_checked_like_those_of_a_file(points, message):
    content = {"stories": [{"mass": 1, "stiffness": 1}]}
    with pytest.raises(ModelError, match=message):
        tdint.load_model({**content, "excitation": {"forces": [{"floor": 1, "points": points}]}})


def test_a_table_of_numbers_determines_the_digest_of_a_model():
    """An array and the equal list have the same text; another number has another text."""
    texts = {
        kind: tdint.load_model(
            {
                "stories": [{"mass": 1, "stiffness": 1}],
                "excitation": {"forces": [{"floor": 1, "points": table}]},
            }
        ).text
        for kind, table in {
            "list": [[0.0, 1.0], [2.0, 3.0]],
            "array": np.array([[0.0, 1.0], [2.0, 3.0]]),
            "other": [[0.0, 1.0], [2.0, 3.5]],
        }.items()
    }
    assert texts["list"] == texts["array"] != texts["other"]


def test_units():
    units = {"length": "mm", "force": "kN", "mass": "t"}
    model = tdint.load_model({"units": units, **rows(stiffness=[[2.0, 0.0], [0.0, 1.0]])})
    assert np.diag(model.matrices.stiffness) == pytest.approx([2e6, 1e6])
    assert model.stories[0].mass == 1000.0


def test_forces_on_rows_by_name():
    text = """
matrices: {names: [deck, tip], mass: [300, 120], stiffness: [[9000, -3000], [-3000, 3000]]}
excitation:
  forces:
    - {floor: tip, amplitude: 40, omega: 4.1}
    - {floor: deck, points: [[0, 1], [1, 2]]}
    - {floor: roof, points: [[0, 1], [1, 2]]}
"""
    excitation = tdint.load_model(io.StringIO(text)).excitation
    assert [force.floor for force in (*excitation.forces, *excitation.tables)] == [2, 1, 2]
    with pytest.raises(
        ModelError, match=r"forces\[1\].floor: unknown row or attachment 'tup'; did you mean 'tip'"
    ):
        tdint.load_model(io.StringIO(text.replace("floor: tip", "floor: tup")))


def test_what_needs_springs_is_refused():
    model = tdint.load_model(frame())
    with pytest.raises(AnalysisError, match=r"impulse4 does not support models of matrices.*exact"):
        tdint.run(model, method="impulse4", dt=0.1, duration=1)
    with pytest.raises(UsageError, match="pushover needs springs of stories"):
        tdint.pushover(model, 0.01)
    with pytest.raises(UsageError, match=r"stories.mass cannot be changed"):
        model.replace(**{"stories.mass": 2.0})
    with pytest.raises(UsageError, match="the transfer function is for floors"):
        tdint.transfer_function(tdint.load_model(rows()))


PSD = [[2.0, -2.0], [-2.0, 2.0]]


@pytest.mark.parametrize(
    "damping", [[0.0, 0.0], [3.0, 0.0], PSD, [[1.0, -1.0000001], [-1.0000001, 1.0]]]
)
def test_semidefinite_damping_is_accepted(damping):
    """A damper between two rows has no damping of their common movement."""
    tdint.load_model(rows(damping=damping))


@pytest.mark.parametrize(
    ("damping", "row"),
    [
        ([-1.0, -1.0], 1),
        ([1.0, -1e-3], 2),
        ([[1.0, 2.0], [2.0, 1.0]], 2),
        ([[0.0, 1.0], [1.0, 5.0]], 1),
        ([[1.0, -1.001], [-1.001, 1.0]], 2),
    ],
)
def test_damping_that_adds_energy_is_refused(damping, row):
    with pytest.raises(ModelError, match=rf"damping: must be positive semidefinite; row {row}, "):
        tdint.load_model(rows(damping=damping))


@pytest.mark.parametrize("key", [{"stiffness_matrix": GOOD}, {}])
def test_a_model_without_masses_is_refused(key):
    stories = [{"mass": 0, "height": 3} | ({} if key else STIFF)] * 2
    with pytest.raises(ModelError, match="at least one floor needs a mass"):
        tdint.load_model({"stories": stories, **key})


def warnings_of(content):
    return " ".join(tdint.check(content).warnings)


@pytest.mark.parametrize(("coefficient", "warns"), [(0.1, False), (2.0, True), (1e-5, True)])
def test_damping_ratios_of_matrices_are_compared_as_those_of_stories(coefficient, warns):
    content = rows(damping=[coefficient, coefficient])
    assert ("damping ratio of the first mode" in warnings_of(content)) == warns
    spring = {"mass": 1.0, "stiffness": 1.0, "dashpot": coefficient}
    assert ("damping ratio of the first mode" in warnings_of({"stories": [spring]})) == warns


@pytest.mark.parametrize(
    ("bending", "shear", "warns"),
    [(9e10, 1.2e10, False), (9e16, 1.2e10, True), (9e10, 1.2e16, True), (9e10, None, False)],
)
def test_bending_stiffness_without_effect_is_reported(bending, shear, warns):
    flexural = {"EI": bending} | ({"GA": shear} if shear else {})
    story = {"repeat": 4, "mass": 3e5, "height": 3.5, "flexural": flexural}
    assert ("bending (EI)" in warnings_of({"stories": [story]})) == warns


@pytest.mark.parametrize(("stiffness", "warns"), [(1e3, True), (1e8, False), (1e18, True)])
def test_the_stiffness_of_a_link_is_compared_with_the_springs_between_its_ends(stiffness, warns):
    story = {"repeat": 3, "mass": 1e5, "height": 3, "stiffness": 5e7}
    tank = {"name": "tank", "floor": 3, "mass": 1e3, "stiffness": 1e6}
    for link in ({"from": "ground", "to": 2}, {"from": 3, "to": "tank"}):
        content = {"stories": [story], "attachments": [tank]}
        links = [{"name": "strut", **link, "stiffness": stiffness}]
        expected = warns and not (stiffness == 1e3 and link["to"] == "tank")
        assert ("link" in warnings_of({**content, "links": links})) == expected


@pytest.mark.parametrize(
    ("initial", "message"),
    [
        ({"displacement": [2500.0]}, "initial drift ratio"),
        ({"displacement": [0.1]}, ""),
        ({"velocity": [3000.0]}, "initial velocity"),
        ({"velocity": [1.0]}, ""),
    ],
)
def test_unusual_initial_states_are_reported(initial, message):
    stories = [{"mass": 1e5, "height": 3, "stiffness": 5e7}]
    found = warnings_of({"stories": stories, "damping": "3%", "initial": initial})
    assert (message in found) if message else "initial" not in found
    # Without heights, the displacement itself is compared.
    found = warnings_of({**rows((1.0,), [[1.0]]), "initial": initial})
    expected = message.replace("drift ratio", "displacement")
    assert (expected in found) if message else "initial" not in found


@pytest.mark.parametrize(
    ("damper", "works"), [(1e7, True), (2e8, True), (1e11, False), (1e16, False)]
)
def test_exact_is_refused_if_rounding_destroys_it(tmp_path, damper, works):
    """The row behind the damper follows c v = f. From 1e11 N s/m on, its peak was wrong by 18 % and
    more; at 1e16 it was 237 m."""
    step = tmp_path / "step.csv"
    step.write_text("# dt = 0.01 s, units = m/s^2\n0\n" + "1\n" * 400)

    def peak(coefficient):
        damping = [[coefficient, 0.0], [0.0, 100.0]]
        stiffness = [[3000.0, -1000.0], [-1000.0, 2000.0]]
        model = rows((300.0, 200.0), stiffness, damping=damping)
        return tdint.run(model, step, check=False).stories.peak_displacement[0]

    if works:
        assert peak(damper) * damper == pytest.approx(peak(1e8) * 1e8, rel=3e-3)
        return
    with pytest.raises(AnalysisError, match=r"damping ratio .* of a mode.*rounding destroys"):
        peak(damper)


FRAME = {
    "stories": [{"mass": 2.0, "height": 3.0, "repeat": 3, "flexural": {"EI": 4e4, "GA": 3e4}}],
    "base": {"rotation": 9e4},
    "damping": {"modal": 0.03},
}
DEVICES = {
    "attachments": [
        {"name": "tmd", "floor": 3, "mass": 0.2, "stiffness": 40.0, "dashpot": 0.9},
        {"name": "tank", "floor": "ground", "mass": 0.5, "stiffness": 300.0},
    ],
    "links": [
        {"from": 1, "to": 3, "dashpot": 6.0, "stiffness": 50.0},
        {"from": "tank", "to": 2, "stiffness": 20.0, "dashpot": 3.0},
        {"from": "ground", "to": 1, "inertance": 0.7},
    ],
}


def _as_matrices(frame, devices):
    """Return the model of `matrices` with the sums over the springs of the devices."""
    own = tdint.matrices(tdint.load_model(frame))
    n, count = 3, 3 + len(devices["attachments"])
    rows = {"ground": None, 1: 0, 2: 1, 3: 2, "tmd": 3, "tank": 4}
    mass, damping, stiffness = (np.zeros((count, count)) for _ in range(3))
    for matrix, of_frame in ((mass, own.mass), (damping, own.damping), (stiffness, own.stiffness)):
        matrix[:n, :n] = of_frame
    inertance = np.zeros((count, count))
    springs = [(item["floor"], item["name"], item) for item in devices["attachments"]]
    for start, end, item in springs + [(x["from"], x["to"], x) for x in devices["links"]]:
        vector = np.zeros(count)
        vector[rows[end]] = 1.0
        if rows[start] is not None:
            vector[rows[start]] = -1.0
        stiffness += item.get("stiffness", 0.0) * np.outer(vector, vector)
        damping += item.get("dashpot", 0.0) * np.outer(vector, vector)
        inertance += item.get("inertance", 0.0) * np.outer(vector, vector)
    for item in devices["attachments"]:
        mass[rows[item["name"]], rows[item["name"]]] = item["mass"]
    matrices = {"mass": mass, "stiffness": stiffness, "damping": damping, "inertance": inertance}
    return {"matrices": {name: matrix.tolist() for name, matrix in matrices.items()}}


def test_devices_beside_flexural_stories_equal_assembled_matrices():
    frame = {**FRAME, "plausibility": "off, test"}
    tree, assembled = tdint.load_model({**frame, **DEVICES}), _as_matrices(frame, DEVICES)
    motion = tdint.make_record(np.sin(np.arange(600) * 0.07), dt=0.01, units="m/s^2")
    one, other = (tdint.run(model, motion, history=True) for model in (tree, assembled))
    for name in ("displacement", "velocity", "absolute_acceleration"):
        values, right = getattr(one.history, name), getattr(other.history, name)[:, :3]
        assert values == pytest.approx(right, abs=1e-9 * np.abs(right).max())
    strokes = one.devices.stories.peak_drift
    right = np.abs(other.history.displacement[:, 3] - other.history.displacement[:, 2]).max()
    assert strokes[0] == pytest.approx(right, rel=1e-3)
    first, second = tdint.matrices(tree), tdint.matrices(assembled)
    for name in ("mass", "stiffness", "damping", "loaded_mass"):
        right = getattr(second, name)
        assert getattr(first, name) == pytest.approx(right, abs=1e-12 * np.abs(right).max())
    assert tdint.modes(tree).period == pytest.approx(tdint.modes(assembled).period, rel=1e-9)
    frequencies = np.array([0.4, 1.1, 2.5])
    for frequency, found in zip(
        frequencies, tdint.transfer_function(tree, frequencies).response, strict=True
    ):
        omega = 2.0 * np.pi * frequency
        matrix = second.stiffness + 1j * omega * second.damping - omega**2 * second.mass
        load = omega**2 * second.loaded_mass @ second.influence
        assert found == pytest.approx(np.linalg.solve(matrix, load) + 1.0, rel=1e-9)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"law": {**YIELDING, "yield_force": 9}}, "tmd: beside `flexural`"),
        ({"dashpot": {"coefficient": 1, "exponent": 0.5}}, "tmd: beside `flexural`"),
    ],
)
def test_devices_beside_flexural_stories_are_linear(change, message):
    first, *others = DEVICES["attachments"]
    devices = {**DEVICES, "attachments": [{**first, **change}, *others]}
    with pytest.raises(ModelError, match=message):
        tdint.load_model({**FRAME, **devices})
