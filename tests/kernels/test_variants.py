"""The plain loops of a building without optional features and the full loops agree to the last bit,
except for total shears, which agree to rounding."""

from dataclasses import fields, replace
from pathlib import Path

import numpy as np
import pytest

from law_examples import example
from tdint import load_model
from tdint.kernels import layout as rows
from tdint.kernels.building.compilable import FULL, PLAIN, Variant
from tdint.kernels.laws.compiled import compiled_laws
from tdint.methods.catalogue import parse
from tdint.model.building import assemble
from tdint.model.story_laws import CODES, LAWS, Law
from tdint.response.runs.prepared import PreparedBuilding
from tdint.response.time_steps import choose_steps

CONFIG = Path(__file__).parents[2] / "configs" / "ten-story-bilinear.yaml"
RATES = [
    rows.PEAK_DRIFT_RATE,
    rows.PEAK_ROWS + rows.PEAK_DRIFT_RATE,
]  # of drift rates, for dashpots, which the building does not have
TOTAL_SHEARS = [rows.PEAK_TOTAL_SHEAR, rows.PEAK_ROWS + rows.PEAK_TOTAL_SHEAR]
METHODS = ("newmark-average", "impulse4", "moment4")

# Linear stories are run with all methods, and other laws with one method each, so that each method
# has several of the other laws.
CASES = [("linear", method) for method in METHODS]
CASES += [(law, METHODS[i % 3]) for i, law in enumerate(LAWS) if law != "linear"]


def building(law):
    """Return the ten stories with a law, and every third story linear."""
    model = load_model(CONFIG)
    linear = Law("linear", ())
    stories = tuple(
        replace(
            story,
            law=linear
            if i % 3 == 2 or law == "linear"
            else example(law, story.stiffness, story.law.parameters[0]),
        )
        for i, story in enumerate(model.stories)
    )
    assert {story.law.name for story in stories} == {law, "linear"}
    return assemble(replace(model, stories=stories))


def integrated(prepared, method):
    """Return all arrays of the workspace after a time integration."""
    ground = np.random.default_rng(1).normal(0.0, 4.0, 400)
    steps = choose_steps(None, None, 0.02, 0.02 * (ground.size - 1))
    result = prepared.integrate(parse(method), steps, ground, history_rows=steps.count)
    assert result.code == 0
    return {array.name: getattr(result.space, array.name) for array in fields(result.space)}


@pytest.mark.parametrize(("law", "method"), CASES)
def test_plain_and_full_loops_agree_to_last_bit(law, method):
    assembled = building(law)
    own, full = PreparedBuilding(assembled), PreparedBuilding(assembled)
    assert own.variant == Variant(PLAIN, compiled_laws(sorted({0.0, float(CODES[law])})))
    # The value of the cached property
    vars(full)["variant"] = own.variant._replace(form=FULL)
    results = [integrated(prepared, method) for prepared in (own, full)]
    # The sum of the forces at a located instant is compiled in another order.
    np.testing.assert_allclose(*(result["peaks"][TOTAL_SHEARS] for result in results), rtol=4e-16)
    for result in results:
        result["peaks"] = np.delete(result["peaks"], RATES + TOTAL_SHEARS, axis=0)
    for name in ("state", "peaks", "totals", "history"):
        np.testing.assert_array_equal(*(result[name] for result in results), err_msg=name)
