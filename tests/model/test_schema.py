"""The JSON schema of model files: what runs is valid, and what it refuses, the reader refuses, too."""

from __future__ import annotations

import copy
import io
import json
import re
from pathlib import Path
from typing import Any

import pytest
import yaml

from json_schema import valid
from tdint.errors import ModelError
from tdint.model.config.model_file import load_model, model_keys, model_schema
from tdint.model.keys.kinds import Bounds, Choice, Either, EntriesOf, Keys, ValueKind, Whole

SCHEMA = model_schema()
SHIPPED = sorted(Path(__file__).parents[2].joinpath("configs").glob("*.yaml"))
_FLOAT = re.compile(r"[-+]?(\d+\.?\d*|\.\d+)([eE][-+]?\d+)?")

EVERYTHING = """
name: 7
units: {length: mm, force: kN, mass: t}
stories:
  - {mass: 2, height: 3000, stiffness: 4, law: linear, dashpot: {coefficient: 1, exponent: 0.5, linear_below: 1}}
  - {weight: 3, height: 3000, stiffness: 4, dashpot: 2, repeat: 2, law: {type: bilinear, yield_force: 1, hardening: 3%}}
damping: {rayleigh: {ratio: [0.02, 5%], modes: [1, 2]}}
p_delta: true
excitation:
  record: {file: a, units: g, component: HNE, scale: -2, baseline: linear, highpass: 0.1, corners: 2, trim: '0:3'}
  forces: [{floor: 1, amplitude: -3, omega: 0, phase: sin}, {floor: 1, amplitude: -3, omega: 0, phase: 0.3}]
initial: {displacement: [1, 2, 3], velocity: [0, 0, 0]}
analysis: {method: impulse4, dt: 0.01, duration: 3}
collapse_drift: 10%
output_units: kip, in, g
"""
BUILDING = "building: {rules: mdof-lu, type: C1, stories: 8, year: 1985, area: 600, damping_ratio: 5%}"


def tree(text: str) -> Any:
    """YAML as an editor reads it (version 1.2, where 2e8 is a number)."""

    def converted(value: Any) -> Any:
        if isinstance(value, dict):
            return {key: converted(item) for key, item in value.items()}
        if isinstance(value, list):
            return [converted(item) for item in value]
        return float(value) if isinstance(value, str) and _FLOAT.fullmatch(value) else value

    return converted(yaml.safe_load(text))


@pytest.mark.parametrize("path", SHIPPED, ids=lambda path: path.stem)
def test_shipped_models_are_valid(path: Path) -> None:
    assert valid(tree(path.read_text(encoding="utf-8")), SCHEMA)


@pytest.mark.parametrize("text", [EVERYTHING, BUILDING])
def test_all_keys_are_valid_and_read(text: str) -> None:
    assert valid(tree(text), SCHEMA)
    load_model(io.StringIO(text))


def refused(model: object) -> bool:
    try:
        load_model(model)  # type: ignore[arg-type]
    except ModelError:
        return True
    return False


def wrong(kind: ValueKind) -> list[object]:
    """Values that a kind does not allow, made from what it declares."""
    if isinstance(kind, Bounds):
        outside = [kind.low - 1.0, kind.high + 1.0, kind.low * (not kind.low_allowed), kind.high]
        return [[1], "abc", *(value for value in outside if abs(value) < 1e30 and not kind.allow(value))]
    if isinstance(kind, Whole):
        return [kind.low - 1, kind.high + 1, kind.low + 0.5, "a"]
    if isinstance(kind, Choice):
        return ["no such name", {}]
    if isinstance(kind, EntriesOf):
        return [{}, 3, *([[]] if kind.least else []), *([one] for one in wrong(kind.kind))]
    if isinstance(kind, Keys):
        return ["text", [1], {"no such key": 1}]
    return [[[]]] if not isinstance(kind, Either) else [[[]], {"no such key": 1}]


def spoiled(model: dict[str, Any], keys: Keys) -> list[dict[str, Any]]:
    """The model with one wrong value under each key that it has, one key too many, one too few."""
    found: list[dict[str, Any]] = []
    for key in keys.declared:
        if key.name not in model:
            continue
        found += [{**copy.deepcopy(model), key.name: value} for value in wrong(key.kind)]
        kinds = key.kind.kinds if isinstance(key.kind, Either) else (key.kind,)
        inner = [kind for kind in kinds if isinstance(kind, Keys)]
        if inner and isinstance(model[key.name], dict):
            found += [{**model, key.name: value} for value in spoiled(model[key.name], inner[0])]
        if isinstance(key.kind, EntriesOf) and isinstance(key.kind.kind, Keys):
            first, *rest = model[key.name]
            found += [{**model, key.name: [value, *rest]} for value in spoiled(first, key.kind.kind)]
        if key.needed:
            found.append({name: value for name, value in model.items() if name != key.name})
    return [*found, {**model, "no such key": 1}]


@pytest.mark.parametrize("text", [EVERYTHING, BUILDING], ids=["stories", "building"])
def test_what_the_schema_refuses_the_reader_refuses(text: str) -> None:
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
def test_laws_that_are_none(law: object) -> None:
    model = {"stories": [{"mass": 1, "stiffness": 1, "law": law}]}
    assert not valid(model, SCHEMA) and refused(model)


def test_one_of_some_keys() -> None:
    story = {"mass": 1, "stiffness": 1}
    for model in (
        {},
        {"stories": [story], **tree(BUILDING)},
        {"stories": [{"stiffness": 1}]},
        {"stories": [{**story, "weight": 1}]},
        {"stories": [story], "damping": {}},
    ):
        assert not valid(model, SCHEMA) and refused(model)


def test_it_is_json_and_says_what_keys_mean() -> None:
    assert json.loads(json.dumps(SCHEMA)) == SCHEMA
    properties = SCHEMA["properties"]
    assert all(told["description"] for told in properties.values())
    assert list(properties) == list(model_keys())
