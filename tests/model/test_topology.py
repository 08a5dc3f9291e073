"""Attachments and links: reading, matrices and their factorization in any topology."""

import io

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import tdint
from law_paths import along, random_path
from tdint.errors import ModelError
from tdint.kernels import layout as rows
from tdint.kernels.equations import tridiagonal
from tdint.kernels.stepping import Factors
from tdint.model.building import assemble
from tdint.model.config.model_file import load_model
from tdint.model.damping import rayleigh
from tdint.model.model_notes import model_notes
from tdint.model.topology import incidence, springs_of
from tdint.response.overview import overview
from tdint.response.runs.prepared import PreparedBuilding

STORIES = (
    "{mass: 100, height: 3, stiffness: 90000}, {repeat: 3, mass: 100, height: 3, stiffness: 80000}"
)


def read(rest: str, stories: str = STORIES):
    return load_model(io.StringIO(f"stories: [{stories}]\n{rest}"))


def spring(ends: dict[int, float], size: int) -> np.ndarray:
    """Outer product of the vector of a deformation."""
    vector = np.zeros(size)
    for floor, sign in ends.items():
        vector[floor] += sign
    return np.outer(vector, vector)


DEVICES = """
damping: {rayleigh: {ratio: 2%, modes: [1, 3]}}
attachments:
  - {name: tank, floor: 2, mass: 4, stiffness: 600, dashpot: 3}
  - {name: absorber, floor: roof, weight: 20, stiffness: 190}
links:
  - {from: ground, to: 3, stiffness: 2000, dashpot: 40}
  - {name: cable, from: roof, to: 1, dashpot: 60}
  - {from: 2, to: 1, stiffness: 500}
  - {from: tank, to: 4, stiffness: 30}
"""


def test_matrices_of_attachments_and_links():
    """M, K and C are sums over springs and dashpots. Rayleigh damping is that of the stories."""
    model = read(DEVICES)
    building = assemble(model)
    bare = assemble(read("damping: none"))
    mass = np.diag([100, 100, 100, 100, 4, 20 / 9.80665])
    stiffness = np.zeros((6, 6))
    stiffness[:4, :4] = bare.stiffness_matrix()
    stiffness += 600 * spring({4: 1, 1: -1}, 6) + 190 * spring({5: 1, 3: -1}, 6)
    stiffness += 2000 * spring({2: 1}, 6) + 500 * spring({0: 1, 1: -1}, 6)
    stiffness += 30 * spring({3: 1, 4: -1}, 6)
    omega = np.sqrt(np.linalg.eigvals(bare.stiffness_matrix() / 100.0).real)
    first, _, third, _ = np.sort(omega)
    coefficients = rayleigh(model.damping, first, third)
    damping = np.zeros((6, 6))
    damping[:4, :4] = coefficients.mass * 100.0 * np.eye(4)
    damping[:4, :4] += coefficients.stiffness * bare.stiffness_matrix()
    damping += 3 * spring({4: 1, 1: -1}, 6) + 40 * spring({2: 1}, 6)
    damping += 60 * spring({0: 1, 3: -1}, 6)
    assert np.diag(building.mass) == pytest.approx(mass)
    assert building.stiffness_matrix() == pytest.approx(stiffness)
    assert building.damping_matrix() == pytest.approx(damping, rel=1e-9, abs=1e-9)
    squared = np.sort(np.linalg.eigvals(np.linalg.solve(mass, stiffness)).real)
    assert building.modes().omega == pytest.approx(np.sqrt(squared), rel=1e-9)
    assert building.first_mode()[0] == pytest.approx(np.sqrt(squared[0]), rel=1e-9)
    assert building.fastest >= np.sqrt(squared[-1])


@st.composite
def topologies(draw):
    """Text of attachments and links of a chain of 2 to 7 stories, with any ends."""
    stories = draw(st.integers(2, 7))
    attachments = draw(st.lists(st.integers(1, stories), max_size=3))
    ends = [str(i) for i in range(1, stories + 1)]
    ends += ["ground", *(f"a{i}" for i in range(len(attachments)))]
    links = draw(st.lists(st.permutations(ends).map(lambda x: x[:2]), min_size=1, max_size=5))
    text = "damping: {rayleigh: {mass: 0.3, stiffness: 0.002}}\n"
    if attachments:
        text += "attachments:\n" + "".join(
            f"  - {{name: a{i}, floor: {floor}, mass: {3 + i}, stiffness: 400}}\n"
            for i, floor in enumerate(attachments)
        )
    text += "links:\n" + "".join(
        f"  - {{from: {start}, to: {end}, stiffness: {2000 + 500 * i}, dashpot: {20 + i}}}\n"
        for i, (start, end) in enumerate(links)
    )
    return f"{{repeat: {stories}, mass: 100, stiffness: 80000}}", text


@given(topologies(), st.integers(0, 2**32 - 1))
def test_factorizations_solve_systems_of_any_topology(texts, seed):
    """Real, complex and 2 x 2 block systems have the solutions of the full matrices. The columns
    of links receive the solution of their upper floors."""
    building = assemble(read(texts[1], texts[0]))
    linear_terms, n, masses = building.linear_terms, building.stories, building.masses
    random = np.random.default_rng(seed)
    mass, damping = np.diag(building.mass), building.damping_matrix()
    stiffness, modal = building.stiffness_matrix(), np.zeros((0, n + 1))
    law_state = np.zeros((rows.SLOPE + 1, n + 1))
    law_state[rows.SLOPE, :n] = building.law_parameters[rows.STIFFNESS, :n]
    right = np.zeros((2, n + 1))
    right[:, :masses] = random.normal(size=(2, masses))

    scratch = np.zeros((30, n + 1))
    factors = Factors(scratch, 0, 1, 20, linear_terms)
    combination = tridiagonal.Combination(1.0, 0.1, 0.01)
    tridiagonal.factor_combination(
        linear_terms, modal, law_state, rows.SLOPE, combination, factors, n
    )
    scratch[25] = right[0]
    tridiagonal.solve_damped(factors, modal, 25, n)
    expected = np.linalg.solve(mass + 0.1 * damping + 0.01 * stiffness, right[0, :masses])
    assert scratch[25, :masses] == pytest.approx(expected, rel=1e-9, abs=1e-15)
    upper = linear_terms[rows.UPPER_FLOOR, :n].astype(int)
    assert (scratch[25, :n] == scratch[25, upper]).all()

    scratch[:] = 0.0
    factors = Factors(scratch, 0, 2, 20, linear_terms)
    none = tridiagonal.ModalBlocks(modal, 0.0, 0.0, 0.0, 0.0)
    tridiagonal.factor_pairs(linear_terms, law_state, (0.05, 0.07), factors, none, n)
    scratch[25:27] = right
    tridiagonal.solve_pairs_damped(factors, modal, 25, n)
    root = 0.05 + 0.07j
    load = right[0, :masses] + 1j * right[1, :masses]
    solution = np.linalg.solve(mass + root * damping + root**2 * stiffness, load)
    assert scratch[25, :masses] == pytest.approx(solution.real, rel=1e-9, abs=1e-15)
    assert scratch[26, :masses] == pytest.approx(solution.imag, rel=1e-9, abs=1e-15)

    scratch[:] = 0.0
    factors = Factors(scratch, 0, 4, 20, linear_terms)
    blocks = random.normal(size=(4, n)) + np.array([9.0, 1.0, 1.0, 9.0])[:, None]
    blocks *= law_state[rows.SLOPE, :n]
    scratch[:4, :masses] = np.array([100.0, 0.0, 0.0, 100.0])[:, None]
    scratch[:4, :n] += blocks  # the diagonal of each column contains its own spring
    scratch[4:8, :n] = blocks
    tridiagonal.link_blocks(linear_terms, factors, n)
    tridiagonal.factor_blocks(factors, none, n)
    scratch[25:27] = right
    tridiagonal.solve_blocks_damped(factors, modal, 25, n)
    ends = incidence(linear_terms, masses)
    parts = [(ends.T * block) @ ends for block in blocks]
    identity = 100.0 * np.eye(masses)
    full = np.block([[parts[0] + identity, parts[1]], [parts[2], parts[3] + identity]])
    expected = np.linalg.solve(full, right[:, :masses].ravel())
    assert scratch[25:27, :masses].ravel() == pytest.approx(expected, rel=1e-8, abs=1e-16)


def test_fill_in_has_columns_between_the_floors_of_long_links():
    """Eliminating the roof connects floor 3 with floor 1: one column without a spring."""
    springs, ends = springs_of(read("links: [{from: 1, to: roof, dashpot: 5}]"))
    assert ends[-2:] == [(3, 0), (2, 0)] and springs[-1].stiffness == 0.0
    _, ends = springs_of(read("links: [{from: ground, to: roof, dashpot: 5}]"))
    assert ends[-1] == (3, -1) and len(ends) == 5


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (
            "attachments: [{floor: 9, mass: 1, stiffness: 1}]",
            "floor: must be a whole number from 1",
        ),
        ("attachments: [{floor: 1, stiffness: 1}]", r"attachments\[1\].mass: is missing"),
        ("attachments: [{floor: 1, mass: 1}]", r"attachments\[1\].stiffness: is missing"),
        (
            "attachments: [{name: a, floor: 1, mass: 1, stiffness: 1}, "
            "{name: a, floor: 2, mass: 1, stiffness: 1}]",
            r"attachments\[2\].name: 'a' is already used; names must be unique",
        ),
        ("attachments: [{name: ground, floor: 1, mass: 1, stiffness: 1}]", "name of a floor"),
        (
            "attachments: [{name: a, floor: 1, mass: 1, stiffness: 1}, "
            "{name: b, floor: a, mass: 1, stiffness: 1}]",
            "attachments on attachments are not supported; a link",
        ),
        ("attachments: [{floor: 1, stiffness: 1, inertance: -2}]", "must be a positive number"),
        ("links: [{from: 1, to: 2}]", "give at least one of"),
        ("links: [{from: 2, to: 2, dashpot: 1}]", "`from` and `to` must be different"),
        ("links: [{from: tank, to: 2, dashpot: 1}]", "must be ground, a floor from 1, roof or"),
        ("links: [{from: 1, to: 2, law: {type: bilinear, yield_force: 1}}]", "stiffness"),
        (
            "links: [{from: 2, to: 1, stiffness: 5, law: {type: bilinear, yield_force: 1, "
            "hardening: 0, negative: {yield_force: 2}}}]",
            "`from` must be below `to` for a law that differs",
        ),
        (
            "attachments: [{floor: 1, mass: 1, mass_ratio: 2%, period: 1}]",
            "cannot be used with `mass_ratio`",
        ),
        (
            "attachments: [{floor: 1, mass: 1, stiffness: 2, period: 1}]",
            "give either `stiffness` or `period`",
        ),
        (
            "attachments: [{floor: 1, mass: 1, period: 1, damping: 5%, dashpot: 3}]",
            "cannot be used with `damping`",
        ),
        ("attachments: [{floor: 1, mass: 1}]", "stiffness: is missing"),
        (
            "attachments: [{name: a, floor: 1, mass: 0, stiffness: 1}]\n"
            "links: [{from: 1, to: a, dashpot: 1}]",
            "mass: must be positive, or links with `inertance` must hold it",
        ),
        (
            "attachments: [{name: a, floor: 1, mass: 0, stiffness: 1}, "
            "{name: b, floor: 1, mass: 0, stiffness: 1}]\n"
            "links: [{from: a, to: b, inertance: 1}]",
            "mass: must be positive, or links with `inertance` must hold it",
        ),
        ("links: [{from: 1, to: 3, stiffness: -2}]", "is written as `matrices`"),
        (
            "links: [{from: 1, to: 3, law: {type: gap, gap: 1, stop_stiffness: 0}}]",
            "stop_stiffness: the stop has no stiffness",
        ),
        ("buildings: []", "write the second building as `attachments`"),
        ("absorbers: []", "absorbers: unknown key; did you mean `attachments`?"),
        ("joints: []", r"`stiffness_matrix` of its floors, .*: K = Kff - Kfr Krr\^-1 Krf"),
        ("controller: {}", "integrate the state space of `tdint.matrices` in Python"),
        ("contacts: []", "write the second building as `attachments` with `floor: ground`"),
        ("tmd: {}", "tmd: unknown key; did you mean `attachments`?"),
        ("braces: []", "braces: unknown key; did you mean `links`?"),
        ("buildings: {}\nrecords: {}", "^[^;]*: a campaign file is no model: run it with `tdint"),
    ],
)
def test_invalid_devices_are_refused(text, message):
    with pytest.raises(ModelError, match=message):
        read(text)


IMK = (
    "type: imk, yield_force: 9, plastic_drift: 2, post_capping_drift: 4, capping_ratio: 1.2, "
    "residual_ratio: 0, ultimate_drift: 30, deterioration: 40"
)
PINCHING4 = (
    "type: multilinear-pinching, backbone: [[1, 5], [3, 9]], "
    "pinching: {drift: 0.5, force: 0.2, unloading: 0}"
)


@pytest.mark.parametrize(
    "equal, law",
    [
        (True, "{type: linear}"),
        (True, "{type: tanh, strength: 9}"),
        (True, "{type: bilinear, yield_force: 9, hardening: 0}"),
        (True, "{type: peak-oriented, yield_force: 9, hardening: 0, unloading: 0}"),
        (True, "{type: steel, yield_force: 9, hardening: 0}"),
        (True, "{type: bouc-wen, yield_force: 9, hardening: 0, exponent: 1, beta: 0.5}"),
        (True, "{type: gap, gap: 1, stop_stiffness: 9, sides: both}"),
        (True, "{type: multilinear, rule: peak, backbone: [[1, 5]], sides: both}"),
        (True, "{type: bilinear, yield_force: 9, hardening: 0, negative: {yield_force: 9}}"),
        (True, "{type: ramberg-osgood, yield_force: 9, alpha: 1, exponent: 3}"),
        (
            True,
            "{type: trilinear-pinching, yield_force: 9, ultimate_force: 12, ultimate_drift: 4, "
            "pinching: 0.5, unloading: 0}",
        ),
        (True, f"{{{IMK}}}"),
        (True, f"{{{PINCHING4}}}"),
        (True, "{type: linear, fracture_drift: 2}"),
        (False, "{type: bilinear, yield_force: 9, hardening: 0, negative: {yield_force: 8}}"),
        (False, f"{{{IMK}, negative: {{rate: 0.5}}}}"),
        (False, f"{{{PINCHING4}, negative: {{backbone: [[1, 5], [3, 8]]}}}}"),
        (
            False,
            f"{{{PINCHING4}, negative: {{pinching: {{drift: 0.2, force: 0.2, unloading: 0}}}}}}",
        ),
        (False, "{type: linear, fracture_drift: {positive: 2, negative: 3}}"),
        (
            False,
            "{type: bouc-wen, yield_force: 9, hardening: 0, exponent: 1, beta: 1, asymmetry: 0.1}",
        ),
        (
            False,
            "{type: steel, yield_force: 9, hardening: 0, isotropic: {a1: 1, a2: 1, a3: 0, a4: 1}}",
        ),
        (False, "{type: gap, gap: 1, stop_stiffness: 9, sides: positive}"),
        (False, "{type: multilinear, rule: elastic, backbone: [[1, 5]], sides: negative}"),
        (False, "{type: multilinear, rule: peak, backbone: [[1, 5]], sides: positive}"),
        (False, "{type: polynomial, coefficients: [5, 1]}"),
    ],
)
def test_only_laws_that_differ_by_direction_need_the_lower_end_first(equal, law):
    """A law of one side, or with different fractures, acted on the other side in a link from a
    floor to a lower one; other laws that are equal in both directions were refused. Forces along a
    path and along the opposite path show whether a law is equal in both directions."""
    has_stiffness = "multilinear" not in law and "polynomial" not in law
    stiffness = ", stiffness: 5" if has_stiffness else ""
    spring = read(f"links: [{{from: 1, to: 2, law: {law}{stiffness}}}]").links[0].spring
    path = random_path(1, largest=5.0)
    there, back = (
        along(spring.law, side * path, stiffness=spring.stiffness).shear for side in (1.0, -1.0)
    )
    assert np.allclose(there, -back, rtol=0.0, atol=1e-9) == equal
    link = f"from: 2, to: 1, law: {law}{stiffness}"
    if equal:
        assert read(f"links: [{{{link}}}]").links[0].ends == (2, 1)
    else:
        with pytest.raises(ModelError, match="`from` must be below `to` for a law that differs"):
            read(f"links: [{{{link}}}]")


def test_height_of_a_building_is_that_of_its_stories():
    """Attachments and links have no height, and do not make the height unknown."""
    assert overview(io.StringIO(f"stories: [{STORIES}]\n{DEVICES}")).height == 12.0


def test_attachments_by_mass_ratio_period_and_damping_ratio():
    stories = "stories: [{repeat: 3, mass: 100, stiffness: 6.0e4}]\n"
    tmd = "attachments: [{floor: 3, mass_ratio: 3%, period: 0.5, damping: 12%}]"
    spring = load_model(io.StringIO(stories + tmd)).attachments[0].spring
    omega = 4.0 * np.pi
    assert (spring.mass, spring.stiffness) == pytest.approx((9.0, 9.0 * omega**2))
    assert spring.dashpot == pytest.approx(2.0 * 0.12 * 9.0 * omega)


def test_initial_state_of_attachments_and_p_delta_of_their_weight():
    """Attachments move with their floor at the start. Their weight acts in the stories below."""
    model = read(
        "p_delta: true\ninitial: {displacement: [1, 2, 3, 4]}\nattachments: [{floor: 2, mass: 50, "
        "stiffness: 9}]\nlinks: [{from: ground, to: 3, dashpot: 1}]"
    )
    from tdint.response.runs.prepared import PreparedBuilding

    prepared = PreparedBuilding.of(model)
    assert prepared.displacement.tolist() == [1.0, 2.0, 3.0, 4.0, 2.0, 3.0]
    assert not prepared.velocity.any()
    weight = 9.80665 * np.array([450.0, 350.0, 200.0, 100.0]) / 3.0
    assert prepared.building.linear_terms[rows.GEOMETRIC, :4] == pytest.approx(-weight)
    assert not prepared.building.linear_terms[rows.GEOMETRIC, 4:].any()


def test_initial_motion_of_attachments():
    """Attachments without values start with their floors; the columns of links follow."""
    model = read(
        "attachments: [{name: a, floor: 2, mass: 5, stiffness: 900}, {name: b, floor: 4, mass: 5,"
        " stiffness: 900}, {name: c, floor: 1, mass: 5, stiffness: 900}]\n"
        "links: [{name: d, from: a, to: 3, dashpot: 10}]\n"
        "initial: {displacement: [1, 2, 3, 4], velocity: [5, 6, 7, 8],"
        " attachments: {b: {velocity: 0}, c: {displacement: -1, velocity: 0.5}}}"
    )
    prepared = PreparedBuilding.of(model)
    assert prepared.displacement[:7].tolist() == [1.0, 2.0, 3.0, 4.0, 2.0, 4.0, -1.0]
    assert prepared.velocity[:7].tolist() == [5.0, 6.0, 7.0, 8.0, 6.0, 0.0, 0.5]
    assert model_notes(model) == [
        "start with the motion of their floors: a (`initial: {attachments: ...}` states another "
        "motion)"
    ]
    still = read(
        "attachments: [{name: a, floor: 2, mass: 5, stiffness: 900}]\n"
        "initial: {attachments: {a: {displacement: 0.1}}}"
    )
    assert still.initial.moves and not model_notes(still)


@pytest.mark.parametrize(
    ("initial", "message"),
    [
        ("{attachments: {b: {velocity: 1}}}", "attachment 'b' not found .known: a"),
        ("{attachments: {a: {speed: 1}}}", "unknown key"),
        ("{attachments: {}}", "is empty"),
        ("{attachments: {a: {velocity: x}}}", "must be a number"),
    ],
)
def test_invalid_initial_motion_of_attachments(initial, message):
    device = "attachments: [{name: a, floor: 2, mass: 5, stiffness: 900}]"
    with pytest.raises(ModelError, match=message):
        read(f"{device}\ninitial: {initial}")


@pytest.mark.parametrize("law", ["linear", "{type: bilinear, yield_force: 6, hardening: 0.1}"])
def test_a_node_without_mass_is_held_by_an_inerter(law: str) -> None:
    """The history is the limit of those of small masses: differences are proportional to them."""
    stories = f"stories: [{{mass: 10, stiffness: 400, law: {law}}}]\ndamping: none\n"
    node = "attachments: [{name: node, floor: 1, mass: %g, stiffness: 90}]\n"
    link = "links: [{from: ground, to: node, inertance: 3, dashpot: 6}]\n"
    motion = tdint.make_record(np.sin(np.linspace(0.0, 20.0, 401)), dt=0.01, units="m/s^2")
    drifts = [
        tdint.run(
            load_model(io.StringIO(stories + node % mass + link)),
            motion,
            duration=4.0,
            history=True,
        ).history.drift
        for mass in (0.0, 1e-3, 1e-4)
    ]
    errors = [np.abs(drift - drifts[0]).max() / np.abs(drifts[0]).max() for drift in drifts[1:]]
    assert errors[1] < 1e-4 and errors[0] == pytest.approx(10.0 * errors[1], rel=0.05)


def test_a_mass_between_stops_is_held_by_contact() -> None:
    """Before the first contact the mass is at rest; the displacement of the floor is that of an
    oscillator without it."""
    stories = "stories: [{mass: 10, stiffness: 400}]\ndamping: none\n"
    stop = "{from: 1, to: ball, law: {type: gap, gap: 0.02, stop_stiffness: 500}}"
    ball = f"attachments: [{{name: ball, floor: 1, mass: 1, stiffness: 0}}]\nlinks: [{stop}]"
    motion = tdint.make_record(np.full(201, 0.5), dt=0.01, units="m/s^2")
    alone, both = (
        tdint.run(
            load_model(io.StringIO(text)), motion, duration=1.5, dt=0.002, history=True
        ).history.drift
        for text in (stories, stories + ball)
    )
    # The absolute acceleration of the floor is at most 2 a, so that it moves by at most a t^2.
    first = int(np.sqrt(0.02 / 0.5) / 0.002)
    assert both[:first, 0] == pytest.approx(alone[:first, 0], abs=1e-9)
    assert np.abs(both - alone).max() > 1e-4
