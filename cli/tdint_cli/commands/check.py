"""`tdint check`: validation and summary of model files, without time integration."""

from __future__ import annotations

from collections import deque
from typing import TYPE_CHECKING

import click

from tdint.errors import ModelError, RecordError, TdintError, UsageError
from tdint_cli import options
from tdint_cli.handlers import call
from tdint_cli.options.grammar import refuse_idle
from tdint_cli.options.option_types import FileName
from tdint_cli.terminal import Failures, emit, note, warn

if TYPE_CHECKING:
    from tdint.response.overview import Overview
    from tdint.units import OutputUnits


@options.command
@options.analysis.plugins
@click.argument("models", metavar="MODEL.yaml...", nargs=-1, type=FileName())
@options.analysis.changes
@options.option("--schema", is_flag=False, flag_value="model")
@options.output.units
def command(
    models: tuple[str, ...],
    plugins: tuple[str, ...],
    changes: dict[str, str],
    schema: str | None,
    output_units: OutputUnits | None,
) -> None:
    """Validate model files and summarize them.

    Each MODEL.yaml and its record are read and the first mode is computed, without time
    integration. All errors are reported with line and column, including errors under misspelled
    keys, unknown methods and missing records. Warnings report unusual values, from periods to peaks
    of the ground motion; the most common cause is a wrong unit. A table with a row per valid
    model is written to standard output: stories, height, mass, fundamental period and damping,
    hysteretic laws, method, record. A campaign file is checked together with its models. The exit
    code is 3 if a file is invalid, 4 if a record cannot be read.

    With --plugin and without models, the table lists the methods of the plug-in: declared and
    observed order, stability limit and spectral radius at infinity; the exit code is 5 if a method
    contradicts its declared properties. With models that use laws of the plug-in, these laws are
    tested with drift cycles: force, tangent stiffness and energy must be consistent.
    """
    mode = "schema" if schema else "plugins" if plugins and not models else "models"
    refuse_idle(mode)
    for file in plugins:
        from tdint.model.plugins import private_imports

        for text in private_imports(file):
            note(text)
    if schema:
        from tdint.model.config.model_file import model_schema
        from tdint.output.summary import json_bytes

        emit(json_bytes(model_schema() if schema == "model" else call("schema of campaigns")))
        return
    if mode == "plugins":
        call("methods of plug-ins", plugins)
        return
    if not models:
        raise UsageError(
            "no model file is specified; specify the file to check (tdint check MODEL.yaml), or "
            "write the schema of such files (tdint check --schema)"
        )
    from tdint.output.tables import buildings as columns
    from tdint.output.tables.table import Table
    from tdint.response.overview import overview_in_campaign
    from tdint.units import SI
    from tdint_cli.drawing import emit_table

    # An invalid file does not prevent the check of other files. The models of a campaign file
    # replace it in the list.
    overviews: list[Overview] = []
    failures: list[TdintError] = []
    # The times of analysis that a campaign specifies are not missing in its models.
    waiting_files = deque((file, tuple[str, ...]()) for file in models)
    # A campaign may list a model many times. Every model is read only one time.
    read_files: set[str] = set()
    while waiting_files:
        file, given_times = waiting_files.popleft()
        if file in read_files:
            continue
        read_files.add(file)
        try:
            models_of_campaign = call("models of a campaign", file)
            if models_of_campaign is None:
                overviews.append(
                    overview_in_campaign(
                        file, given_times, lambda m: options.analysis.changed(m, changes)
                    )
                )
                failures += call("laws of plug-ins", file, plugins)
            elif changes:
                raise UsageError(f"--set cannot be used with the campaign {file}; use its `vary`")
            else:
                listed, errors_of_campaign = models_of_campaign
                waiting_files.extendleft(reversed(listed))
                failures += errors_of_campaign
        except (ModelError, RecordError) as error:
            failures.append(error)
    for valid in overviews:
        note(*(f"{valid.model.source}: {text}" for text in valid.notes))
        warn(*(f"{valid.model.source}: {text}" for text in valid.warnings))
    if overviews:
        has_dampers = any(valid.complex_period is not None for valid in overviews)
        shown = columns.OVERVIEW_WITH_DAMPERS if has_dampers else columns.OVERVIEW
        emit_table(Table.of_results(shown, overviews).in_units(output_units or SI))
    if failures:
        raise Failures(failures)
