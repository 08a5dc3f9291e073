"""`tdint methods`: the catalogue of time-integration methods as CSV."""

from __future__ import annotations

import click

from tdint.errors import UsageError
from tdint_cli import options


@options.command
@click.argument("names", nargs=-1, type=options.analysis.method_name, metavar="[SPEC]...")
@options.analysis.plugin
@options.option("--references", is_flag=True)
@options.option("--bibtex", is_flag=True)
def command(names: tuple[str, ...], references: bool, bibtex: bool) -> None:
    """List the time-integration methods: parameters, order, stability, source.

    If in doubt: impulse4, which is the default.

    CSV on standard output: name, family, parameters with values (defaults, or the values of SPEC)
    and ranges. For these values also the order for a smooth load, implicit or explicit, the maximum
    stable omega dt without damping (none: unconditionally stable) and the spectral radius for omega
    dt to infinity. The column source names the publication of the method.
    """
    from tdint.methods.catalogue import chosen
    from tdint.output.tables.methods import METHOD, reference_table
    from tdint.output.tables.table import Table
    from tdint_cli.drawing import emit_table
    from tdint_cli.terminal import emit

    if references and bibtex:
        raise UsageError("--references and --bibtex cannot be used together; omit one")
    listed = chosen(names or None)
    methods = list(dict.fromkeys(integrator.method for integrator in listed))
    if bibtex:
        from tdint.methods.publications import references_of

        publications = dict.fromkeys(
            reference for method in methods for reference in references_of(method)
        )
        emit("\n".join(reference.bibtex for reference in publications).encode())
        return
    emit_table(reference_table(methods) if references else Table.of_results(METHOD, listed))
