"""`tdint check`: all that is wrong with model files, or what they are; nothing is run."""

from __future__ import annotations

import click

from tdint.errors import ModelError, UsageError
from tdint_cli import options
from tdint_cli.errors import Failures
from tdint_cli.options.values import FileName


@options.command("check")
@click.argument("models", metavar="MODEL.yaml...", nargs=-1, type=FileName())
@options.option(
    "--schema",
    is_flag=True,
    help="Print the JSON schema (draft 7) of model files instead: editors check and complete a file with it.",
)
def command(models: tuple[str, ...], schema: bool) -> None:
    """What is wrong with model files, all at once, or what they are.

    Each MODEL.yaml is read, its first mode is found, and nothing is run. Every fault is reported with its line and
    column, those under misspelled keys, too; also an unknown method and a record that is not there. A table with a row
    for each sound model goes to standard output: stories, height, mass, fundamental period and damping, drift laws,
    method, record. Exit code 3 if one of them has a fault.
    """
    if schema:
        if models:
            raise UsageError("--schema takes no model")
        _print_schema()
        return
    if not models:
        raise UsageError("nothing to check: give a MODEL.yaml, or --schema")
    from tdint.analysis.run.overview import overview
    from tdint.output.tables import columns
    from tdint.output.tables.table import Table
    from tdint_cli.terminal.drawing import emit_table

    sound, failures = [], []
    for model in models:
        try:
            sound.append(overview(model))
        except ModelError as error:
            failures.append(error)
    if sound:
        emit_table(Table.of_results(columns.OVERVIEW, sound))
    if failures:
        raise Failures(list(failures))


def _print_schema() -> None:
    from tdint.model.config.schema import model_schema
    from tdint.output.summaries.summary import json_bytes
    from tdint_cli.terminal.streams import emit

    emit(json_bytes(model_schema()))
