"""What a model file says of the laws that soften and pinch."""

from __future__ import annotations

import io
import math

import pytest

from tdint import load_model
from tdint.errors import ModelError

TRILINEAR = "type: trilinear-pinching, yield_force: 10, ultimate_force: 20, ultimate_drift: 100, pinching: 0.5"
IMK = "type: imk, yield_force: 10, plastic_drift: 50, post_capping_drift: 100, capping_ratio: 1.1, residual_ratio: 0.2"
SIDE = (1e4, 0.05, 0.1, 1.1, 0.2, 0.4, 1.0)
NUMBERS = "a positive number for all of strength, capping, reloading, unloading, a mapping of them, or none"


def law(text: str) -> tuple[float, ...]:
    """Parameters of the law of a story with k = 1 kN/mm, in SI."""
    model = f"units: {{force: kN, length: mm}}\nstories: [{{mass: 1, stiffness: 1, law: {{{text}}}}}]"
    return load_model(io.StringIO(model)).stories[0].law.parameters


def test_trilinear_pinching() -> None:
    assert law(f"{TRILINEAR}, unloading: 0.3") == pytest.approx((1e4, 2e4, 0.1, 0.5, 0.3), rel=1e-15)


def test_imk_with_its_defaults() -> None:
    expected = (*SIDE, *SIDE, *4 * [math.inf], 1.0, 1.0, 1.0)
    assert law(f"{IMK}, ultimate_drift: 400") == pytest.approx(expected, rel=1e-15)
    assert law(f"{IMK}, ultimate_drift: 400, deterioration: none") == law(f"{IMK}, ultimate_drift: 400")
    peak_oriented = f"{IMK}, ultimate_drift: 400, pinching: {{force: 1, drift: 1}}"
    assert law(peak_oriented) == law(f"{IMK}, ultimate_drift: 400")


def test_imk_with_all_that_it_may_have() -> None:
    more = (
        "deterioration: {strength: 900, unloading: 600}, exponent: 1.5, rate: 0.9, pinching: {drift: 0.5, force: 0.3}"
    )
    other = "negative: {yield_force: 8, rate: 0.5, ultimate_drift: 300}"
    expected = (
        *SIDE[:6], 0.9, 8e3, *SIDE[1:5], 0.3, 0.5, 0.9, math.inf, math.inf, 0.6, 1.5, 0.3, 0.5,
    )  # fmt: skip
    assert law(f"{IMK}, ultimate_drift: 400, {more}, {other}") == pytest.approx(expected, rel=1e-15)
    assert law(f"{IMK}, ultimate_drift: 400, deterioration: 700")[14:18] == pytest.approx(4 * [0.7], rel=1e-15)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (f"{TRILINEAR}, unloading: 1", "law.unloading: must be a number of at least 0 and below 1, got '1'"),
        (f"{TRILINEAR}, unloading: 0".replace("20,", "9,"), "law: ultimate_force must be at least yield_force"),
        (
            f"{TRILINEAR}, unloading: 0".replace("100", "10"),
            "law: ultimate_drift must be beyond the yield drift 0.01 m",
        ),
        (f"{TRILINEAR}, unloading: 0".replace("100", "15"), "law: the ultimate point must lie below the line of"),
        (IMK, "law.ultimate_drift: is missing; give a positive number"),
        (f"{IMK}, ultimate_drift: 9", "law: ultimate_drift must be beyond the yield drift 0.01 m, got 0.009 m"),
        (
            f"{IMK}, ultimate_drift: 99, negative: {{yield_force: 100}}",
            "law: negative.ultimate_drift must be beyond the yield drift 0.1 m, got 0.099 m",
        ),
        (f"{IMK}, ultimate_drift: 99, negative: {{yeld: 1}}", "law.negative.yeld: unknown key"),
        (f"{IMK}, ultimate_drift: 99, negative: 3", "law.negative: must be a mapping with the keys yield_force, "),
        (f"{IMK}, ultimate_drift: 99, pinching: 0.5", "law.pinching: must be a mapping with the keys force, drift"),
        (f"{IMK}, ultimate_drift: 99, pinching: {{force: 0.5}}", "law.pinching.drift: is missing; give a number"),
        (f"{IMK}, ultimate_drift: 99, deterioration: [1]", f"law.deterioration: must be {NUMBERS}, got a list"),
        (f"{IMK}, ultimate_drift: 99, deterioration: 0", f"law.deterioration: must be {NUMBERS}, got '0'"),
        (
            f"{IMK}, ultimate_drift: 99, deterioration: {{caping: 1}}",
            "law.deterioration.caping: unknown key; did you mean",
        ),
    ],
)
def test_faults(text: str, message: str) -> None:
    with pytest.raises(ModelError) as caught:
        law(text)
    assert f"stories[1].{message}" in str(caught.value)
    assert len(str(caught.value).splitlines()) == 1
