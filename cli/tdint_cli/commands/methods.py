"""`tdint methods`: the catalogue of time-integration methods as CSV."""

from __future__ import annotations

import click

from tdint_cli import options


@options.command
@click.argument("names", nargs=-1, type=options.analysis.method_name, metavar="[SPEC]...")
@options.analysis.plugin
def command(names: tuple[str, ...]) -> None:
    """List the time-integration methods: parameters, order, stability, source.

    If in doubt: impulse4, which is the default.

    CSV on standard output: name, family, parameters with values (defaults, or the values of SPEC)
    and ranges. For these values also the order for a smooth load, implicit or explicit, the maximum
    stable omega dt without damping (none: unconditionally stable) and the spectral radius for omega
    dt to infinity. The last columns are the publications of the method.
    """
    from tdint.methods.catalogue import chosen
    from tdint.output.tables.methods import METHOD
    from tdint.output.tables.table import Table
    from tdint_cli.drawing import emit_table

    emit_table(Table.of_results(METHOD, chosen(names or None)))
