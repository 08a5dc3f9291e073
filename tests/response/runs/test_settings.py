"""Settings of a run have the same names in Python, campaign files and on the command line."""

import inspect
import math
from dataclasses import fields
from types import SimpleNamespace

import pytest

import tdint
from tdint.errors import UsageError
from tdint.response.runs.settings import RunSettings, settings_from
from tdint.studies.campaign.chunks import CampaignSettings
from tdint.studies.campaign.reader import campaign_schema
from tdint_cli.commands import run
from tdint_cli.studies import ida

NAMES = {item.name for item in fields(RunSettings)}


@pytest.mark.parametrize("function", [tdint.run, tdint.run_case, tdint.IdaSettings])
def test_arguments_have_names_of_settings(function):
    assert set(inspect.signature(function).parameters) >= NAMES


@pytest.mark.parametrize("command", [run.command, ida.command])
def test_options_have_names_of_settings(command):
    assert {option.name for option in command.params} >= NAMES


def test_keys_of_campaigns_have_names_of_settings():
    assert set(campaign_schema()["properties"]["analysis"]["properties"]) >= NAMES


def test_settings_are_attributes_of_the_same_name():
    """Attributes that are no settings are ignored; arguments replace attributes."""
    request = SimpleNamespace(dt=0.01, duration=None, until_rest=True, check=None, jobs=3)
    settings = settings_from(request, CampaignSettings, check=True, stories=True)
    expected = CampaignSettings(dt=0.01, until_rest=True, check=True, stories=True)
    assert settings == expected


@pytest.mark.parametrize("name", ["dt", "duration"])
@pytest.mark.parametrize("value", [math.nan, "0.01"])
def test_time_that_is_not_a_number_is_refused(name, value):
    with pytest.raises(UsageError, match=f"{name} must be a number, got {value!r}"):
        RunSettings(**{name: value})
