"""`tdint methods`: the catalogue as CSV."""

from __future__ import annotations

from tdint_cli import options


@options.command("methods")
@options.analysis.plugin
def command() -> None:
    """The time-integration methods: parameters, order, stability, source.

    CSV on standard output: name, family, parameters with their defaults and ranges; then, at the defaults, the order
    for a smooth load, whether the method is implicit, the largest stable omega dt without damping (none: stable at
    any step) and the spectral radius for omega dt to infinity.
    """
    from tdint.methods.catalogue import catalogue, parse
    from tdint.output.tables.methods import method_table
    from tdint_cli.terminal.drawing import emit_table

    emit_table(method_table(map(parse, catalogue())))
