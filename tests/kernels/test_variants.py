"""Loops that are compiled for a specific variant and for all variants agree to the last bit, except
for total shears, which agree to rounding."""

from dataclasses import fields, replace
from pathlib import Path

import numpy as np
import pytest

from law_examples import example
from tdint import load_model
from tdint.kernels import layout as rows
from tdint.kernels.building import compilable
from tdint.kernels.building.compilable import EVERYTHING
from tdint.kernels.building.load_or_compile import compile_ahead
from tdint.methods.catalogue import parse
from tdint.model.building import assemble
from tdint.model.story_laws import LAWS, Law
from tdint.response.runs.compiled_steps import kernels
from tdint.response.runs.prepared import PreparedBuilding
from tdint.response.time_steps import choose_steps

CONFIG = Path(__file__).parents[2] / "configs" / "ten-story-bilinear.yaml"
RATES = [
    rows.PEAK_DRIFT_RATE,
    rows.PEAK_ROWS + rows.PEAK_DRIFT_RATE,
]  # of drift rates, for dashpots, which the building does not have
TOTAL_SHEARS = [rows.PEAK_TOTAL_SHEAR, rows.PEAK_ROWS + rows.PEAK_TOTAL_SHEAR]
METHODS = ("newmark-average", "impulse4", "moment4")

SCENES = [(name,) for name in LAWS]

# Compilation dominates the time: linear stories are run with all methods, and other laws with one
# method each, so that each method has two of the other laws.
CASES = [pytest.param(("linear",), METHODS, id="linear", marks=pytest.mark.long)] + [
    pytest.param(laws, METHODS[i % 3 : i % 3 + 1], id=" ".join(laws), marks=pytest.mark.slow)
    for i, laws in enumerate(SCENES)
    if laws != ("linear",)
]


def building(laws):
    """Return the ten stories with alternating laws of equal yield force, and every third story
    linear."""
    model = load_model(CONFIG)
    linear = Law("linear", ())
    stories = tuple(
        replace(
            story,
            law=linear
            if i % 3 == 2 or law == "linear"
            else example(law, story.stiffness, strength),
        )
        for i, story in enumerate(model.stories)
        for law, strength in [(laws[i % len(laws)], story.law.parameters[0])]
    )
    assert {story.law.name for story in stories} == {*laws, "linear"}
    return assemble(replace(model, stories=stories))


def integrated(prepared, method):
    """Return all arrays of the workspace after a time integration."""
    ground = np.random.default_rng(1).normal(0.0, 4.0, 400)
    steps = choose_steps(None, None, 0.02, 0.02 * (ground.size - 1))
    result = prepared.integrate(parse(method), steps, ground, history_rows=steps.count)
    assert result.code == 0
    return {array.name: getattr(result.space, array.name) for array in fields(result.space)}


@pytest.mark.parametrize(("laws", "methods"), CASES)
def test_specific_variant_and_general_variant_agree_to_last_bit(laws, methods, monkeypatch):
    assembled = building(laws)
    variant = PreparedBuilding(assembled).variant
    # All loops are compiled at once, so that common loops are compiled only once.
    required = [item for method in methods for item in kernels(parse(method), variant)]
    monkeypatch.setattr(compilable, "WHOLE", False)
    compile_ahead(required, ["native"], None, lambda done: None)
    for method in methods:
        own, everything = {}, {}
        for is_general, result in ((True, everything), (False, own)):
            monkeypatch.setattr(compilable, "WHOLE", is_general)
            # Each kernel caches the function of the last call.
            for kernel, _ in kernels(parse(method), EVERYTHING):
                monkeypatch.setattr(kernel, "_last", (EVERYTHING, None))
            result.update(integrated(PreparedBuilding(assembled), method))
        step = parse(method).family.step
        assert {
            EVERYTHING,
            step.required_variant(variant),
        } <= step._loaded.keys() and step.required_variant(variant) != EVERYTHING
        # The sum of the forces at a located instant is compiled in another order.
        np.testing.assert_allclose(
            *(result["peaks"][TOTAL_SHEARS] for result in (own, everything)), rtol=4e-16
        )
        for result in (own, everything):
            result["peaks"] = np.delete(result["peaks"], RATES + TOTAL_SHEARS, axis=0)
        for name in ("state", "peaks", "totals", "history"):
            np.testing.assert_array_equal(own[name], everything[name], err_msg=f"{method}: {name}")
