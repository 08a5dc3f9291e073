"""Other forms of keys: fractions, damping proportional to the stiffness, the period of a story."""

import math

import pytest

from tdint.errors import ModelError, UsageError
from tdint.model.building import assemble
from tdint.model.config.model_file import load_model
from tdint.number_parsing import parse_ratio

TWO = "stories: [{repeat: 2, mass: 100, height: 3, stiffness: 4e4}]\n"


def loaded(tmp_path, text):
    path = tmp_path / "model.yaml"
    path.write_text(text, encoding="utf-8")
    return load_model(path)


@pytest.mark.parametrize(
    ("text", "value"), [("1/550", 1 / 550), ("1 / 20", 0.05), ("5%", 0.05), ("0.05", 0.05)]
)
def test_ratio_is_a_number_a_percentage_or_a_fraction(tmp_path, text, value):
    assert parse_ratio(text) == pytest.approx(value)
    model = loaded(tmp_path, f"{TWO}collapse_drift: {text}\n")
    assert model.collapse_drift == pytest.approx(value)


@pytest.mark.parametrize("text", ["1/0", "1/", "/20", "1/2/3", "a/b"])
def test_other_fractions_are_errors(tmp_path, text):
    with pytest.raises(UsageError, match=r"neither a ratio such as 0\.05 or 1/20"):
        parse_ratio(text)
    with pytest.raises(ModelError, match=r"collapse_drift: must be a number above 0"):
        loaded(tmp_path, f"{TWO}collapse_drift: {text}\n")


def test_fraction_is_only_a_ratio(tmp_path):
    with pytest.raises(ModelError, match=r"height: must be a positive number, got '7/2'"):
        loaded(tmp_path, "stories: [{mass: 100, height: 7/2, stiffness: 4e4}]\n")


@pytest.mark.parametrize("mode", [1, 2])
def test_rayleigh_damping_with_one_mode_is_proportional_to_the_stiffness(tmp_path, mode):
    text = f"damping: {{rayleigh: {{ratio: 2%, modes: [{mode}]}}}}\n"
    building = assemble(loaded(tmp_path, TWO + text))
    modes = building.modes()
    ratios = modes.own_damping(building.damping_matrix())
    expected = 0.02 * modes.omega / modes.omega[mode - 1]
    assert ratios == pytest.approx(expected, rel=1e-12)
    matrix = building.stiffness_matrix() * 0.04 / modes.omega[mode - 1]
    assert building.damping_matrix() == pytest.approx(matrix, rel=1e-12)


def test_two_ratios_need_two_modes(tmp_path):
    with pytest.raises(ModelError, match="two damping ratios require two modes"):
        loaded(tmp_path, TWO + "damping: {rayleigh: {ratio: [1%, 2%], modes: [1]}}\n")


def test_period_of_a_story_determines_its_stiffness(tmp_path):
    units = "units: {length: m, force: kN, mass: t}\n"
    model = loaded(tmp_path, units + "stories: [{mass: 100, period: 1.0}]\n")
    assert model.stories[0].stiffness == pytest.approx(1e5 * (2.0 * math.pi) ** 2)
    assert assemble(model).first_period == pytest.approx(1.0)
    law = "law: {type: bilinear, yield_force: 100, hardening: 1/20}"
    model = loaded(tmp_path, units + f"stories: [{{mass: 100, period: 1.0, {law}}}]\n")
    assert model.stories[0].law.parameters[:2] == pytest.approx((1e5, 0.05))


@pytest.mark.parametrize(
    ("stories", "message"),
    [
        ("{mass: 1, period: 1}, {mass: 1, stiffness: 1}", r"stories\[1\].period: applies to a"),
        ("{repeat: 2, mass: 1, period: 1}", r"stories\[1\].period: applies to a model with one"),
        ("{mass: 1, period: 1, stiffness: 1}", "give either `stiffness` or `period`"),
        ("{mass: 1, period: 0}", r"stories\[1\].period: must be a positive number"),
        ("{mass: 1, period: 1, elements: [{type: linear, stiffness: 1}]}", "move the period"),
    ],
)
def test_period_is_for_one_story_without_a_stiffness(tmp_path, stories, message):
    with pytest.raises(ModelError, match=message):
        loaded(tmp_path, f"stories: [{stories}]\n")
