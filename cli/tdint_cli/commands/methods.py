"""`tdint methods`: the catalogue as CSV."""

from __future__ import annotations

import click

from tdint.errors import UsageError
from tdint_cli import options


@options.command(
    "methods",
    "tdint methods",
    "tdint methods newmark:beta=0.25:gamma=0.5",
)
@click.argument("names", nargs=-1, type=options.analysis.method_name, metavar="[SPEC]...")
@options.analysis.plugin
@options.option(
    "--references", is_flag=True, help="A row for each publication of each method, in full."
)
@options.option("--bibtex", is_flag=True, help="The publications as BibTeX, in place of the table.")
def command(names: tuple[str, ...], references: bool, bibtex: bool) -> None:
    """List the time-integration methods: parameters, order, stability, source.

    If in doubt: impulse4, which is taken where none is named.

    CSV on standard output: name, family, parameters with their values (the defaults, or those of
    SPEC) and ranges. Then, at these values, the order for a smooth load, whether the method is
    implicit, the largest stable omega dt without damping (none: stable at any step) and the
    spectral radius for omega dt to infinity.
    """
    from tdint.methods.catalogue import chosen
    from tdint.output.tables.methods import method_table, reference_table
    from tdint_cli.drawing import emit_table
    from tdint_cli.terminal import emit

    if references and bibtex:
        raise UsageError("--references and --bibtex are given; leave one of the two out")
    listed = chosen(names or None)
    methods = list(dict.fromkeys(integrator.method for integrator in listed))
    if bibtex:
        from tdint.methods.catalogue import references_of

        publications = dict.fromkeys(
            reference for method in methods for reference in references_of(method)
        )
        emit("\n".join(reference.bibtex for reference in publications).encode())
        return
    emit_table(reference_table(methods) if references else method_table(listed))
