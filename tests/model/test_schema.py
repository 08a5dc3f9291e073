"""JSON schema of model files: accepted models are valid, and the reader refuses invalid models."""

import io
from pathlib import Path

import pytest

from json_schema import spoiled, tree, valid
from tdint.errors import ModelError
from tdint.model.config.model_file import load_model, model_keys, model_schema

SCHEMA = model_schema()
SHIPPED = sorted(Path(__file__).parents[2].joinpath("configs").glob("*.yaml"))

EVERYTHING = """
name: 7
units: {length: mm, force: kN, mass: t}
stories:
  - {mass: 2, height: 3000, stiffness: 4, law: linear, dashpot: {coefficient: 1, exponent: 0.5, linear_below: 1}}
  - {weight: 3, height: 3000, stiffness: 4, dashpot: 2, repeat: 2, law: {type: bilinear, yield_force: 1, hardening: 3%}}
damping: {rayleigh: {ratio: [0.02, 5%], modes: [1, 2]}}
p_delta: true
excitation:
  record: {file: a, units: g, component: HNE, scale: -2, baseline: linear, highpass: 0.1, filter_order: 2, trim: '0:3'}
  forces: [{floor: 1, amplitude: -3, omega: 0, phase: sin}, {floor: 1, amplitude: -3, omega: 0, phase: 0.3}]
initial: {displacement: [1, 2, 3], velocity: [0, 0, 0]}
analysis: {method: impulse4, dt: 0.01, duration: 3}
collapse_drift: 10%
output_units: kip, in, g
"""  # noqa: E501
BUILDING = (
    "building: {rules: mdof-lu, type: C1, stories: 8, year: 1985, area: 600, damping_ratio: 5%}"
)


@pytest.mark.parametrize("path", SHIPPED, ids=lambda path: path.stem)
def test_shipped_models_are_valid(path: Path) -> None:
    assert valid(tree(path.read_text(encoding="utf-8")), SCHEMA)


@pytest.mark.parametrize("text", [EVERYTHING, BUILDING])
def test_model_with_all_keys_is_valid_and_read(text: str) -> None:
    assert valid(tree(text), SCHEMA)
    load_model(io.StringIO(text))


def refused(model: object) -> bool:
    try:
        load_model(model)  # type: ignore[arg-type]
    except ModelError:
        return True
    return False


@pytest.mark.parametrize("text", [EVERYTHING, BUILDING], ids=["stories", "building"])
def test_reader_refuses_models_that_schema_refuses(text: str) -> None:
    model = tree(text)
    cases = spoiled(model, model_keys())
    assert len(cases) > 20
    for case in cases:
        assert not valid(case, SCHEMA), case
        assert refused(case), case


@pytest.mark.parametrize(
    "law",
    [
        "bilinear",
        {"type": "bilinear", "yield_force": 1},
        {"type": "bilinear", "yield_force": 1, "hardening": 1},
        {"type": "linear", "hardening": 0},
        {"type": "polynomial", "coefficients": []},
        {"type": "imk", "yield_force": 1},
        {"yield_force": 1},
    ],
)
def test_invalid_laws_are_refused(law: object) -> None:
    model = {"stories": [{"mass": 1, "stiffness": 1, "law": law}]}
    assert not valid(model, SCHEMA) and refused(model)
