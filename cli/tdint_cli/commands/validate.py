"""`tdint validate`: a user's own check of an installation."""

from __future__ import annotations

from tdint.errors import AnalysisError
from tdint_cli import options
from tdint_cli.options.output import Outputs
from tdint_cli.terminal import progress_bar, say


@options.command(
    "validate",
    "tdint validate",
    "tdint validate -o validation.csv",
    exits={5: "a case is beyond what it allows"},
)
@options.output.to_files(in_units=False)
def command(outputs: Outputs) -> None:
    """Compare results of this installation with published and exact results.

    Closed forms, tables of textbooks and printed results of other programs that need no file,
    computed on this machine with its compiled time loops. CSV: for each case its largest difference
    and what the case allows; exit code 5 if one is beyond that. With all numbers, other programs
    and recordings the cases stand in tests/validation of the source.
    """
    from tdint.output.tables.methods import validation_table
    from tdint.validation import carry_out, closed_form_cases, textbook_cases

    cases = (*closed_form_cases(), *textbook_cases())
    results = []
    with progress_bar(to_terminal=outputs.table is None) as progress:
        for done, case in enumerate(cases):
            progress("validating", done / len(cases))
            results.append(carry_out(case))
    # The table comes before the error: it shows which case is beyond, and by how much.
    outputs.deliver(validation_table(results))
    outside = [result for result in results if not result.within]
    say(f"{len(results) - len(outside)} of {len(results)} cases are within their tolerances.")
    if outside:
        worst = outside[0]
        more = f", and {len(outside) - 1} more" if len(outside) > 1 else ""
        raise AnalysisError(
            f"{worst.case.name}: the largest difference, {worst.largest:.3g}, is beyond "
            f"{worst.case.tolerance:.3g}{more}: this installation computes something else than the "
            "one that was released"
        )
