"""`tdint validate`: check an installation against published and exact results."""

from __future__ import annotations

from tdint.errors import AnalysisError
from tdint_cli import options
from tdint_cli.options.output import Outputs
from tdint_cli.terminal import progress_bar, say


@options.command(
    "validate",
    "tdint validate",
    "tdint validate -o validation.csv",
    exits={5: "the difference of a case exceeds its tolerance"},
)
@options.output.to_files(in_units=False)
def command(outputs: Outputs) -> None:
    """Compare results of this installation with published and exact results.

    The references are closed-form solutions, textbook tables and printed results of other programs
    that need no input file. The cases are computed on this machine with its compiled time loops.
    CSV: maximum difference and tolerance of each case; the exit code is 5 if a difference exceeds
    its tolerance. tests/validation in the source tree has all cases with their values, including
    comparisons with other programs and with recordings.
    """
    from tdint.output.tables.methods import validation_table
    from tdint.validation import closed_form_cases, compute_case, textbook_cases

    cases = (*closed_form_cases(), *textbook_cases())
    results = []
    with progress_bar(to_terminal=outputs.table is None) as progress:
        for done, case in enumerate(cases):
            progress("validating", done / len(cases))
            results.append(compute_case(case))
    # Write the table before raising the error: it shows which cases fail and their differences.
    outputs.deliver(validation_table(results))
    outside = [result for result in results if not result.within]
    say(f"{len(results) - len(outside)} of {len(results)} cases are within their tolerances.")
    if outside:
        worst = outside[0]
        more = f", and {len(outside) - 1} more" if len(outside) > 1 else ""
        raise AnalysisError(
            f"{worst.case.name}: the maximum difference, {worst.largest:.3g}, exceeds the "
            f"tolerance {worst.case.tolerance:.3g}{more}: this installation does not reproduce the "
            "results of the released version"
        )
