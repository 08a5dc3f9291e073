"""Tests of texts that are numbers. Any text gives a valid model or a `ModelError`."""

import io
import re

import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from fuzz.model_files import sound
from model.test_config import EVERYTHING
from tdint.errors import ModelError
from tdint.model.config.model_file import load_model

NUMBERS = [
    ("2e8", 2e8),
    ("2E8", 2e8),
    ("2e+8", 2e8),
    ("1e-3", 1e-3),
    ("1.5e-03", 1.5e-3),
    ("+1.5", 1.5),
    (".5", 0.5),
    ("5.", 5.0),
    ("5.e1", 50.0),
    ("-.5e1", -5.0),
    ("0", 0.0),
    ("-0.0", 0.0),
    ("0e5", 0.0),
    ("0.05", 0.05),
    ("10", 10.0),
    ("123456789012345678901", 123456789012345678901.0),
    ("0e-999", 0.0),
]
NOT_NUMBERS = [
    ("no", "'no'"),
    ("true", "'true'"),
    ("~", "nothing"),
    ("e5", "'e5'"),
    ("1:30", "'1:30'"),
    ("2001-01-01", "'2001-01-01'"),
    ("'12'", "'12' in quotes; remove the quotes"),
    ('"2e8"', "'2e8' in quotes; remove the quotes"),
    ("'abc'", "'abc'"),
    ("|\n     12", "'12' in quotes; remove the quotes"),
    ("012", "'012'; drop the leading zeros"),
    ("-00.5", "'-00.5'; drop the leading zeros"),
    ("1_000", "'1_000'; drop the underscores"),
    ("0,05", "'0,05'; write a decimal point"),
    (".nan", "'.nan'; it must be finite"),
    ("-.inf", "'-.inf'; it must be finite"),
    ("Infinity", "'Infinity'; it must be finite"),
    ("0x10", "'0x10'; write the number without a unit"),
    ("5 kN", "'5 kN'; write the number without a unit"),
    ("5%", "'5%'; write the number without a unit"),
    ("1e", "'1e'; write the number without a unit"),
    ("١٢", "'١٢'"),
    ("[1]", "a list"),
    ("{a: 1}", "a mapping"),
    ("9" * 60 + "x", f"'{'9' * 37}...'; write the number without a unit"),
]
KEYS = sorted({*re.findall(r"(\w+):", EVERYTHING), "modal"})
ATOMS = [
    "", "0", "-1", "3", "0.5", "1e9", "1e999", "012", "1:30", "true", "no", "null", "none",
    "linear", "bilinear",
]  # fmt: skip
ATOMS += ["polynomial", "m", "kN", "t", "cos", "sin", "'1'", "99999999999999999999"]
SIGNS = [*"-:,[]{}#&*!|>'\"%@`?~", "---", "...", "<<", "*a", "&a ", "!!int ", "!x "]


def amplitude_text(number: str) -> str:
    model = (
        "stories: [{mass: 1, stiffness: 1}]\nexcitation:\n  forces:\n  - omega: 1\n    floor: 1\n"
    )
    return f"{model}    amplitude: {number}"


@pytest.mark.parametrize(("text", "number"), NUMBERS)
def test_number_formats_are_read(text: str, number: float) -> None:
    (force,) = load_model(io.StringIO(amplitude_text(text))).excitation.forces
    assert force.cosine == number


@pytest.mark.parametrize(("text", "shown"), NOT_NUMBERS)
def test_invalid_numbers_are_refused(text: str, shown: str) -> None:
    with pytest.raises(ModelError) as caught:
        load_model(io.StringIO(amplitude_text(text)))
    assert (
        str(caught.value)
        == f"<stream>:6:16: excitation.forces[1].amplitude: must be a number, got {shown}"
    )


@settings(max_examples=60, deadline=None)
@given(st.text(max_size=100))
@example('"\\UFFFFFFFF"')
@example("%YAML " + "9" * 5000 + ".1\n--- a")
@example("\ud800")
@example("a: &x [*x]")
@example("? ? ? a")
@pytest.mark.long
def test_any_text_is_read_or_refused(text: str) -> None:
    sound(text)


@settings(max_examples=60, deadline=None)
@given(
    st.lists(
        st.sampled_from([*ATOMS, *SIGNS, *KEYS, " ", "\n", "\n  ", ": ", ", ", "- "]), max_size=40
    ).map("".join)
)
def test_any_sequence_of_tokens_is_read_or_refused(text: str) -> None:
    sound(text)


def flow(tree: object) -> str:
    """Return a tree of lists, mappings and texts as YAML."""
    if isinstance(tree, dict):
        return "{" + ", ".join(f"{key}: {flow(value)}" for key, value in tree.items()) + "}"
    if isinstance(tree, list):
        return "[" + ", ".join(map(flow, tree)) + "]"
    return str(tree)


TREES = st.recursive(
    st.sampled_from(ATOMS),
    lambda child: st.lists(child, max_size=3) | st.dictionaries(st.sampled_from(KEYS), child),
)


@pytest.mark.long
@settings(max_examples=40, deadline=None)
@given(st.dictionaries(st.sampled_from(KEYS), TREES, max_size=4), st.booleans())
def test_any_tree_of_known_keys_is_read_or_refused(
    tree: dict[str, object], sound_stories: bool
) -> None:
    if sound_stories:
        tree["stories"] = "[{mass: 1, stiffness: 1, height: 1, repeat: 3}]"
    sound("\n".join(f"{key}: {flow(value)}" for key, value in tree.items()))
