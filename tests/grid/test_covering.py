"""The stored array covers all pairs of declared values, and contains all declarations of tdint."""

import pytest

from grid.axes import LAW_GROUPS, build
from grid.covering import CASES, read, uncovered
from grid.solver import members_of
from grid.springs import LAWS
from tdint.model.config.model_file import model_schema

ROWS = [row for row, *_ in read()]


def test_all_pairs_of_values_occur():
    missing = uncovered(ROWS)
    assert not missing, f"run `python tests/grid/covering.py`: {sorted(missing)[:5]}"


def test_each_example_of_a_law_is_in_a_group():
    examples = {f"{name} {label}" for name, law in LAWS.items() for label in law.examples}
    assert examples == {text for group in LAW_GROUPS.values() for text in group}


@pytest.mark.long
def test_cases_are_those_of_the_references():
    for row, seed, digest, peaks in read():
        case = build(row, seed)
        assert case.digest == digest, f"run `python tests/grid/covering.py`: {row}"
        members, _ = members_of(case.model)
        assert all(len(values) == len(members) for values in peaks.values())
    assert CASES.stat().st_size < 60_000


def keys_of(content, path=""):
    """Return the paths of all keys in nested content, without numbers of lists."""
    if isinstance(content, dict):
        inner = (keys_of(item, f"{path}.{key}") for key, item in content.items())
        return {f"{path}.{key}" for key in content}.union(*inner)
    if isinstance(content, list):
        return set().union(*(keys_of(item, path) for item in content))
    return set()


def schema_keys(schema, path=""):
    """Return the paths of all keys that a JSON schema allows."""
    keys = set()
    for key, inner in schema.get("properties", {}).items():
        keys |= {f"{path}.{key}"} | schema_keys(inner, f"{path}.{key}")
    for alternative in (*schema.get("anyOf", ()), *schema.get("oneOf", ())):
        keys |= schema_keys(alternative, path)
    return keys | (schema_keys(schema["items"], path) if "items" in schema else set())


SAME_MOTION = {
    # other ways to write the same building
    *("name", "units", "building", "stories.weight", "stories.repeat"),
    # the record and the analysis are arguments of the runs
    *("excitation.record", "excitation.displacement", "excitation.velocity", "analysis"),
    # a table of forces from a file, instead of points
    *("excitation.forces.file", "excitation.forces.floors", "excitation.forces.column"),
    # laws and dashpots of attachments and links are those of stories
    *(f"{device}.{key}" for device in ("attachments", "links") for key in ("law", "dashpot")),
    # inerters: tests/response/runs/test_inertance.py and test_inertance_with_laws.py
    *("attachments.weight", "attachments.inertance", "links.inertance", "stories.inertance"),
    *("attachments.mass_ratio", "attachments.period", "attachments.damping"),
    # two directions, each a building of the grid: tests/response/runs/test_two_directions.py
    *("x", "y", "stories.x", "stories.y", "excitation.x", "excitation.y", "excitation.azimuth"),
    # contacts in links: tests/response/runs/test_contact.py
    *("stories.law.dashpot", "stories.law.restitution"),
    # initial motion of attachments: tests/model/test_topology.py
    "initial.attachments",
    # fracture: tests/grid/test_fractures.py
    *("stories.law.fracture_drift", "stories.elements.fracture_drift"),
    # linear models: tests/response/runs/test_matrices.py, test_rotary_inertia.py
    *("base", "matrices", "stiffness_matrix", "stories.flexural", "stories.period"),
    "stories.rotary_inertia",
    # evaluation and output
    *("plausibility", "damage", "limits", "output_units", "report"),
}
"""Keys that do not change the motion, or are compared by other tests than the grid."""


@pytest.mark.long
def test_each_key_of_a_model_occurs():
    """A new damper, law parameter or load is declared in `grid.axes` or `grid.springs`."""
    used = set().union(*(keys_of(build(row, seed).model) for row, seed, *_ in read()))
    # Elements have the keys of laws, which can stand in their own `law`.
    used, allowed = (
        {key.replace(".elements.law", ".law").replace(".elements", ".law") for key in keys}
        for keys in (used, schema_keys(model_schema()))
    )
    missing = {
        key.lstrip(".")
        for key in allowed - used
        if not any(f"{key}.".startswith(f".{other}.") for other in SAME_MOTION)
    }
    assert not missing
