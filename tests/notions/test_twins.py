"""The same building or study in two spellings gives the same numbers, estimated errors included."""

import copy
import dataclasses

import numpy as np
import pytest

import tdint
from separate_streams import runner
from tdint_cli.main import cli

UNITS = {"length": "m", "force": "kN", "mass": "t"}
LINEAR = {
    "units": UNITS,
    "stories": [
        {"mass": 60, "height": 3.2, "stiffness": 3.0e4, "dashpot": 120},
        {"mass": 50, "height": 3.0, "stiffness": 2.5e4},
        {"mass": 40, "height": 3.0, "stiffness": 2.0e4, "dashpot": 50},
    ],
    "damping": {"rayleigh": {"ratio": 0.03, "modes": [1, 2]}},
}
STORIES = len(LINEAR["stories"])


def motion(seed=1, samples=251, dt=0.02):
    time = np.linspace(0.0, 1.0, samples)
    noise = np.convolve(np.random.default_rng(seed).normal(size=samples), np.hanning(12), "same")
    samples = noise * np.sin(np.pi * time) ** 2
    return tdint.make_record(4.0 * samples / np.abs(samples).max(), dt=dt, units="m/s^2")


MOTION = motion()


def yielding():
    building = copy.deepcopy(LINEAR)
    for story, force in zip(building["stories"], (220, 180, 110), strict=True):
        story["law"] = {"type": "bilinear", "yield_force": force, "hardening": 0.03}
    return building


def with_links(building, count=1):
    """Return a tree: links that carry nothing."""
    links = [
        {"name": f"none {i}", "from": "ground", "to": 1 + i % STORIES, "dashpot": 1e-9}
        for i in range(count)
    ]
    return copy.deepcopy(building) | {"links": links}


def with_elements(building):
    """Return the building with one element in each story instead of its law."""
    building = copy.deepcopy(building)
    for story in building["stories"]:
        law = story.pop("law")
        story["elements"] = [{"name": "a", "stiffness": story.pop("stiffness"), **law}]
    return building


def numbers(result, path=""):
    """Yield the arrays of a response by name: of stories in the first columns."""
    for name in ("stories", "energy", "check", "errors", "history", "hysteretic_energy", "steps"):
        value = getattr(result, name, None)
        if dataclasses.is_dataclass(value):
            for field in dataclasses.fields(value):
                part = getattr(value, field.name)
                if isinstance(part, np.ndarray | float) and part is not None:
                    yield f"{path}{name}.{field.name}", np.asarray(part)
            if name == "check":
                yield from numbers(value, "check.")
        elif value is not None:
            yield f"{path}{name}", np.asarray(value)


def check_same(one, other, tolerance, *, skip=()):
    """Compare all numbers of two responses, of the stories that both have."""
    first, second = dict(numbers(one)), dict(numbers(other))
    compared = 0
    for name in first.keys() & second.keys():
        if name in skip:
            continue
        a, b = first[name], second[name]
        columns = min(a.shape[-1], b.shape[-1]) if a.ndim else 0
        a, b = (a[..., :columns], b[..., :columns]) if a.ndim else (a, b)
        size = np.nanmax(np.abs(a), initial=0.0)
        np.testing.assert_allclose(b, a, rtol=0, atol=tolerance * size + 1e-12, err_msg=name)
        compared += 1
    assert compared > 20


@pytest.mark.parametrize("method", ["impulse4", "newmark-average", "moment4", "gauss4"])
@pytest.mark.parametrize("p_delta", [False, True])
def test_a_chain_is_a_tree_with_links_that_carry_nothing(method, p_delta):
    building = yielding() | {"p_delta": p_delta}
    chain, tree = (
        tdint.run(item, MOTION, method=method, history=True)
        for item in (building, with_links(building))
    )
    check_same(chain, tree, 1e-6)


def test_estimated_errors_do_not_depend_on_links_that_carry_nothing():
    one, many = (tdint.run(item, MOTION) for item in (yielding(), with_links(yielding(), 24)))
    for field in dataclasses.fields(one.check.errors):
        a, b = (getattr(item.check.errors, field.name) for item in (one, many))
        np.testing.assert_allclose(b, a, rtol=1e-3, atol=1e-9, err_msg=field.name)


@pytest.mark.parametrize("method", ["impulse4", "newmark-average", "bathe"])
def test_a_law_is_one_element(method):
    one, other = (
        tdint.run(item, MOTION, method=method, history=True)
        for item in (yielding(), with_elements(yielding()))
    )
    check_same(one, other, 0.0)


def test_a_chain_is_a_stiffness_matrix():
    chain = copy.deepcopy(LINEAR)
    for story in chain["stories"]:
        story.pop("dashpot", None)
    k = [story["stiffness"] for story in chain["stories"]]
    rows = [[k[0] + k[1], -k[1], 0], [-k[1], k[1] + k[2], -k[2]], [0, -k[2], k[2]]]
    stories = [{"mass": s["mass"], "height": s["height"]} for s in chain["stories"]]
    matrix = {**chain, "stories": stories, "stiffness_matrix": rows}
    one, other = (
        tdint.run(item, MOTION, method="exact", history=True, check=False)
        for item in (chain, matrix)
    )
    check_same(one, other, 2e-5)


@pytest.mark.parametrize("method", ["impulse4", "newmark-average"])
def test_a_sequence_of_one_event_is_a_run(method):
    case = tdint.prepare(tdint.load_model(yielding()), MOTION, method=method)
    one, other = tdint.run_case(case), tdint.run_sequence(case, [MOTION])
    check_same(one, other, 0.0, skip=("history",))


def test_the_number_of_processes_changes_no_table(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "m.yaml").write_text(
        "stories: [{mass: 10, height: 3, stiffness: 8000, law: {type: bilinear, yield_force: 20, "
        "hardening: 5%}}]\n"
    )
    for number in (1, 2, 3):
        rows = "\n".join(f"{value:.6f}" for value in motion(number, 101).acceleration)
        (tmp_path / f"r{number}.csv").write_text(f"# dt = 0.02 s, units = m/s^2\n{rows}\n")
    files = ["r1.csv", "r2.csv", "r3.csv"]
    for line in (["run", "m.yaml", *files], ["spectrum", *files, "--period", "0.1,1"]):
        outputs = {
            runner().invoke(cli, [*line, "-q", "--jobs", jobs], prog_name="tdint").stdout
            for jobs in ("1", "2")
        }
        assert len(outputs) == 1 and outputs.pop().count("\n") > 3
