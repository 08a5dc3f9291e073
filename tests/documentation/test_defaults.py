"""Docstrings and help texts state the defaults and the allowed values of parameters and options."""

import inspect
import re

import click
import pytest

import tdint
from docstring_sections import entries
from tdint.assessment.order.order import LOADS
from tdint.assessment.stability.stability import LAWS, STARTS
from tdint.model.building_rules import RULES as BUILDING_RULES
from tdint.response.spectra.elastic import MAXIMA
from tdint.response.static.pushover import PATTERNS
from tdint.studies.motions.intensity import PAIRS
from tdint.studies.motions.scaling import RULES
from tdint_cli.main import COMMANDS, cli

CALLABLES = sorted(
    name
    for name in tdint.__all__
    if name in ("Stepper", "IdaSettings", "HeightPeriod")
    or inspect.isfunction(getattr(tdint, name))
)
REFERENCE = re.compile(r"\b[Aa]s (?:for|by|in|of) `(?:tdint\.)?(\w+)`")
"""Descriptions that refer to the parameter of another public function."""


def descriptions(name):
    """Return type and description of each parameter of a public function by name."""
    found = {}
    text = inspect.getdoc(getattr(tdint, name))
    for section in ("Parameters", "Attributes"):
        for names, kind, description in entries(text, section):
            found.update(dict.fromkeys(names, f"{kind}. {description}"))
    return found


def spellings(value):
    """Return the texts that state a default value."""
    if isinstance(value, bool):
        return {str(value)}
    if isinstance(value, int | float):
        words = {1: "one"} | {number: str(number) for number in (2, 3)}
        return {
            f"{value:g}",
            str(value),
            f"{100 * value:g}%",
            f"{100 * value:g} %",
            words.get(value, "-"),
        }
    return {str(value)}


def unstated(name):
    """Return the parameters of a function whose description does not state the default."""
    found = []
    described = descriptions(name)
    for parameter in inspect.signature(getattr(tdint, name)).parameters.values():
        default = parameter.default
        if default is parameter.empty or default in (None, (), ""):
            continue
        text = described.get(parameter.name, "")
        other = REFERENCE.search(text)
        if other and other[1] in tdint.__all__ and "default" not in text:
            continue
        is_value = isinstance(default, bool | int | float | str)
        if "default" not in text.lower() or (
            is_value and not any(spelling in text for spelling in spellings(default))
        ):
            found.append(f"{name}({parameter.name}={default!r}): {text}")
    return found


@pytest.mark.parametrize("name", CALLABLES)
def test_defaults_are_in_the_docstring(name):
    assert unstated(name) == []


VALUES = {
    ("overshoot", "start"): STARTS,
    ("overshoot", "law"): LAWS,
    ("order", "law"): LAWS,
    ("order", "load"): LOADS,
    ("pushover", "pattern"): PATTERNS,
    ("ida", "pair"): PAIRS,
    ("intensity", "pairs"): PAIRS,
    ("scale", "pair"): PAIRS,
    ("scale", "rule"): RULES,
    ("select", "rule"): RULES,
    ("spectrum", "maxima"): MAXIMA,
    ("spectrum", "interpolation"): ("linear", "band-limited"),
    ("inventory", "rules"): BUILDING_RULES,
    ("run_many", "errors"): ("raise", "keep"),
    ("model_template", "units"): ("si", "us"),
}
"""Allowed values of parameters."""


@pytest.mark.parametrize(("name", "parameter"), VALUES)
def test_allowed_values_are_in_the_docstring(name, parameter):
    text = descriptions(name)[parameter]
    assert {value for value in VALUES[name, parameter] if f"{value}" not in text} == set()


@pytest.mark.parametrize("name", CALLABLES)
def test_values_are_not_behind_a_constant(name):
    """A reader of `help` does not see internal constants such as `PAIRS`."""
    assert (
        re.findall(r"`(?:[a-z_.]+\.)?[A-Z][A-Z_]{3,}`", inspect.getdoc(getattr(tdint, name))) == []
    )


def options():
    """Yield commands and their options with a default value."""
    context = click.Context(cli)
    for name in COMMANDS:
        command = cli.get_command(context, name)
        for option in command.params:
            if isinstance(option, click.Option) and not option.hidden and not option.is_flag:
                default = option.get_default(click.Context(command), call=False)
                if isinstance(default, int | float | str) and default not in (True, False, ""):
                    yield f"{name} {option.opts[0]}", default, option.help
                elif isinstance(default, tuple) and len(default) == 1:
                    yield f"{name} {option.opts[0]}", default[0], option.help


def test_defaults_are_in_the_help_of_options():
    found = list(options())
    assert len(found) >= 20
    missing = [
        (name, default)
        for name, default, text in found
        if "default" not in text or not any(spelling in text for spelling in spellings(default))
    ]
    assert missing == []
