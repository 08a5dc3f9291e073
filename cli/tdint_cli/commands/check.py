"""`tdint check`: validation and summary of model files, without time integration."""

from __future__ import annotations

import re
from collections import deque
from typing import TYPE_CHECKING

import click

from tdint.errors import AnalysisError, ModelError, RecordError, TdintError, UsageError
from tdint.files import is_file
from tdint_cli import options
from tdint_cli.options.grammar import Mode, refuse_idle
from tdint_cli.options.option_types import FileName
from tdint_cli.terminal import Failures, emit, note, say, warn

if TYPE_CHECKING:
    from tdint.analysis.overview import Overview
    from tdint.campaign.definition import CampaignFile
    from tdint.units import OutputUnits

_MODELS = Mode("with models", frozenset(("models", "output_units")))
_SCHEMA, _PLUGINS = Mode("with --schema"), Mode("with --plugin alone")
MODES = (_MODELS, _SCHEMA, _PLUGINS)

_CAMPAIGN = re.compile(rb"^(buildings|records|forces)\s*:", re.MULTILINE)
"""A top-level key of campaign files that model files do not have."""


@options.command(
    "check",
    "tdint check office.yaml",
    "tdint check --schema campaign",
    exits={3: "a file is invalid", 5: "a plug-in contradicts its declared properties"},
)
@options.analysis.plugins(
    " Without models, its methods are compared with their declared properties, in a table."
)
@click.argument("models", metavar="MODEL.yaml...", nargs=-1, type=FileName())
@options.option(
    "--schema",
    is_flag=False,
    flag_value="model",
    type=click.Choice(["model", "campaign"]),
    metavar="[model|campaign]",
    help="Print the JSON schema (draft 7) of model files (default) or campaign files instead; "
    "editors use it for validation and completion.",
)
@options.output.units
def command(
    models: tuple[str, ...],
    plugins: tuple[str, ...],
    schema: str | None,
    output_units: OutputUnits | None,
) -> None:
    """Validate model files and summarize them.

    Each MODEL.yaml and its record are read and the first mode is computed, without time
    integration. All errors are reported with line and column, including errors under misspelled
    keys, unknown methods and missing records. Warnings report unusual values, from periods to peaks
    of the ground motion; the most common cause is a wrong unit. A table with one row per valid
    model is written to standard output: stories, height, mass, fundamental period and damping,
    hysteretic laws, method, record. A campaign file is checked together with its models. The exit
    code is 3 if a file is invalid, 4 if a record cannot be read.

    With --plugin and without models, the table lists the methods of the plug-in: declared and
    observed order, stability limit and spectral radius at infinity; the exit code is 5 if a method
    contradicts its declared properties. With models that use laws of the plug-in, these laws are
    tested with drift cycles: force, tangent stiffness and energy must be consistent.
    """
    mode = _SCHEMA if schema else _PLUGINS if plugins and not models else _MODELS
    refuse_idle(mode, MODES)
    for file in plugins:
        from tdint.model.plugins import private_imports

        for text in private_imports(file):
            note(text)
    if schema:
        from tdint.campaign.reader import campaign_schema
        from tdint.model.config.model_file import model_schema
        from tdint.output.summary import json_bytes

        emit(json_bytes(model_schema() if schema == "model" else campaign_schema()))
        return
    if mode is _PLUGINS:
        _check_methods(plugins)
        return
    if not models:
        raise UsageError(
            "no model file is specified; specify the file to check (tdint check MODEL.yaml), or "
            "write the schema of such files (tdint check --schema)"
        )
    from tdint.analysis.overview import overview_in_campaign
    from tdint.output.tables import buildings as columns
    from tdint.output.tables.table import Table
    from tdint.units import SI
    from tdint_cli.drawing import emit_table

    # An invalid file does not prevent the check of other files. The models of a campaign file
    # replace it in the list.
    overviews: list[Overview] = []
    failures: list[TdintError] = []
    # The times of analysis that a campaign specifies are not missing in its models.
    waiting_files = deque((file, tuple[str, ...]()) for file in models)
    # A campaign may list a model many times. Every model is read once.
    read_files: set[str] = set()
    while waiting_files:
        file, given_times = waiting_files.popleft()
        if file in read_files:
            continue
        read_files.add(file)
        try:
            campaign = _campaign_in(file)
            if campaign is None:
                overviews.append(overview_in_campaign(file, given_times))
                failures += _law_errors(file, plugins)
            else:
                times = _times_given_by(campaign)
                models_of_campaign = [(model, times) for model in _models_of(campaign)]
                waiting_files.extendleft(reversed(models_of_campaign))
        except (ModelError, RecordError) as error:
            failures.append(error)
    from tdint.model.plausibility import model_notes

    for valid in overviews:
        note(*(f"{valid.model.source}: {text}" for text in model_notes(valid.model)))
        warn(*(f"{valid.model.source}: {text}" for text in valid.warnings))
    if overviews:
        emit_table(Table.of_results(columns.OVERVIEW, overviews).in_units(output_units or SI))
    if failures:
        raise Failures(failures)


def _check_methods(plugins: tuple[str, ...]) -> None:
    """Compare the methods of plug-ins with their declared properties, and write the table. Failures
    is raised afterwards if a method contradicts its properties.
    """
    from tdint.analysis.assessment.order import check_method
    from tdint.methods.catalogue import load_plugin, parse
    from tdint.output.tables.methods import DECLARATION
    from tdint.output.tables.table import Table
    from tdint_cli.drawing import emit_table

    # The result of `load_plugin` has two parts: the methods and the laws that a plug-in defines.
    definitions = [load_plugin(file) for file in plugins]
    checks = [check_method(parse(method.name)) for methods, _ in definitions for method in methods]
    # Report the errors after the table that shows them.
    if checks:
        emit_table(Table.of_results(DECLARATION, checks))
    for check in checks:
        note(*check.notes)
    if law_names := [law.name for _, laws in definitions for law in laws]:
        note(f"to check the laws ({', '.join(law_names)}), add a model file that uses them")
    if errors := [AnalysisError(fault) for check in checks for fault in check.faults]:
        raise Failures([*errors])


def _law_errors(file: str, plugins: tuple[str, ...]) -> list[TdintError]:
    """Return the errors of the plug-in laws that a model uses.

    Each law with its parameters is tested once, in the last story that has it. The list is empty
    without plug-ins, and for a model on standard input, which can be read only once.
    """
    if not plugins or file == "-":
        return []
    from tdint.analysis.assessment.order import check_law
    from tdint.methods.catalogue import load_plugin
    from tdint.model.config.model_file import load_model

    plugin_laws = {law.name for plugin in plugins for law in load_plugin(plugin)[1]}
    model = load_model(file)
    story_of_law = {
        tuple(spring.law for spring in story.springs): number
        for number, story in enumerate(model.stories, start=1)
        if any(spring.law.name in plugin_laws for spring in story.springs)
    }
    return [
        AnalysisError(f"{file}: {inconsistency}")
        for number in story_of_law.values()
        for inconsistency in check_law(model, number)
    ]


def _campaign_in(file: str) -> CampaignFile | None:
    """Return the campaign of a file; None if the file is not a campaign file. ModelError lists all
    errors of the file, RecordError those of its load cases."""
    if file == "-" or not is_file(file):
        return None
    from tdint.model.keys.document import read_source

    if not _CAMPAIGN.search(read_source(file).data):
        return None
    from tdint.campaign.inputs import check_load_cases
    from tdint.campaign.load_cases import LoadFiles
    from tdint.campaign.reader import load_campaign

    campaign = load_campaign(file)
    say(f"{file}: valid campaign file")
    if isinstance(campaign.records, LoadFiles):
        check_load_cases(campaign)
    return campaign


def _models_of(campaign: CampaignFile) -> tuple[str, ...]:
    """Return the model files of a campaign; none if the buildings are derived from an inventory,
    which is checked: ModelError lists its errors, and warnings about unusual rows are printed.
    """
    from tdint.campaign.definition import ModelFiles

    if isinstance(campaign.buildings, ModelFiles):
        return campaign.buildings.files
    from tdint.campaign.inputs import read_rows
    from tdint.model.unusual_rows import unusual_rows

    rows, errors = read_rows(campaign.buildings)
    warn(*unusual_rows(rows, campaign.buildings.rules))
    if errors:
        raise errors[0]
    return ()


def _times_given_by(campaign: CampaignFile) -> tuple[str, ...]:
    """Return `dt` and `duration` if the runs of a campaign have them without their models.

    Both are those of the ground motions. Load cases have the time step of their table only.
    """
    from tdint.campaign.load_cases import LoadFiles

    is_missing = isinstance(campaign.records, LoadFiles) and campaign.settings.duration is None
    return ("dt",) if is_missing else ("dt", "duration")
